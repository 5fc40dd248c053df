"""Decks of quadratic hexahedra for CalculiX, and what it computes from them.

Decks are in mm, t, s, N and MPa; results are in SI.
"""

import shutil
import subprocess
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

CORNERS = ((0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0), (0, 0, 2), (2, 0, 2), (2, 2, 2), (0, 2, 2))
EDGES = ((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7))
SAME_PLACE = 1e-6
"""Nodes closer than this are one node [mm]."""


class CalculixError(RuntimeError):
    """CalculiX is missing, or a run of it failed."""


@dataclass(frozen=True)
class Material:
    """An isotropic material: E [MPa], nu [-], rho [t/mm³]."""

    E: float
    nu: float
    rho: float


@dataclass(frozen=True, eq=False)
class Solid:
    """Hexahedra with 20 nodes (C3D20).

    Attributes
    ----------
    nodes : ndarray (n, 3)
        Places of the nodes, which count from 1 [mm].
    elements : ndarray (m, 20)
        Numbers of their nodes.
    material : Material
    """

    nodes: NDArray[np.float64]
    elements: NDArray[np.int64]
    material: Material

    def at(self, place: ArrayLike) -> int:
        """Return the number of the node at a place."""
        away = np.linalg.norm(self.nodes - np.asarray(place), axis=1)
        if away.min() > SAME_PLACE:
            msg = f"there is no node at {place} mm; the nearest is {away.min():g} mm away"
            raise ValueError(msg)
        return int(np.argmin(away)) + 1

    def on_plane(self, axis: int, value: float) -> list[int]:
        """Return the numbers of the nodes with one value of a coordinate."""
        return (np.flatnonzero(abs(self.nodes[:, axis] - value) <= SAME_PLACE) + 1).tolist()

    def with_stiffness(self, factor: float) -> "Solid":
        """Return the solid with another Young's modulus."""
        return replace(self, material=replace(self.material, E=factor * self.material.E))


def hexahedra(
    lines: Sequence[ArrayLike], material: Material, keep: Callable[[NDArray[np.float64]], bool] | None = None
) -> Solid:
    """Return the cells between grid lines along x, y and z [mm].

    ``keep`` is asked for the middle of each cell.
    """
    grid = [np.asarray(line, dtype=float) for line in lines]
    # each second entry is the middle between two grid lines, where edges have their third node
    fine = [np.interp(np.arange(2 * g.size - 1) / 2, np.arange(g.size), g) for g in grid]
    number: dict[tuple[int, ...], int] = {}
    nodes, elements = [], []
    for cell in np.ndindex(*(g.size - 1 for g in grid)):
        middle = np.array([f[2 * i + 1] for f, i in zip(fine, cell, strict=True)])
        if keep is not None and not keep(middle):
            continue
        corners = [tuple(2 * i + c for i, c in zip(cell, corner, strict=True)) for corner in CORNERS]
        edges = [tuple((p + q) // 2 for p, q in zip(corners[a], corners[b], strict=True)) for a, b in EDGES]
        for place in (*corners, *edges):
            if place not in number:
                number[place] = len(nodes) + 1
                nodes.append([f[i] for f, i in zip(fine, place, strict=True)])
        elements.append([number[place] for place in (*corners, *edges)])
    return Solid(np.array(nodes), np.array(elements), material)


@dataclass(frozen=True)
class Spring:
    """Springs between rigid patches of two solids, which act at one place.

    Attributes
    ----------
    first, second : tuple of int
        Nodes of either patch, by their numbers in the deck of all solids.
    place : tuple of float
        Where the springs act [mm].
    stiffness : tuple of float
        Along x, y, z [N/mm] and about them [N·mm].
    """

    first: tuple[int, ...]
    second: tuple[int, ...]
    place: tuple[float, float, float]
    stiffness: tuple[float, ...]


def _rows(cells: Sequence[object], width: int) -> list[str]:
    words = [str(cell) for cell in cells]
    return [
        ", ".join(words[k : k + width]) + ("," if k + width < len(words) else "")
        for k in range(0, len(words), width)
    ]


def _rigid_patch(
    nodes: NDArray[np.float64], patch: Sequence[int], place: ArrayLike, moved: int, turned: int
) -> list[str]:
    """Return equations u = u_moved + θ × r of a patch, θ being the displacements of the node ``turned``."""
    lines = []
    for n in patch:
        x, y, z = nodes[n - 1] - np.asarray(place)
        for d, turns in ((1, ((2, z), (3, -y))), (2, ((3, x), (1, -z))), (3, ((1, y), (2, -x)))):
            terms = [(n, d, 1.0), (moved, d, -1.0)] + [(turned, t, -arm) for t, arm in turns if arm]
            lines += ["*EQUATION", str(len(terms))]
            lines += _rows([f"{node}, {k}, {factor:.12e}" for node, k, factor in terms], 4)
    return lines


def deck(solids: Sequence[Solid], springs: Sequence[Spring] = (), step: Sequence[str] = ()) -> str:
    """Return a deck of solids, whose nodes are numbered one after the other, and springs between them."""
    places = np.vstack([s.nodes for s in solids])
    text = ["*NODE, NSET=SOLIDS"]
    text += [f"{k}, {x:.10g}, {y:.10g}, {z:.10g}" for k, (x, y, z) in enumerate(places, 1)]
    n_nodes, n_elements = 0, 0
    for k, solid in enumerate(solids, 1):
        text.append(f"*ELEMENT, TYPE=C3D20, ELSET=SOLID{k}")
        for element in solid.elements + n_nodes:
            n_elements += 1
            text += _rows([n_elements, *element], 12)
        m = solid.material
        text += [f"*MATERIAL, NAME=M{k}", "*ELASTIC", f"{m.E:.10g}, {m.nu:.10g}", "*DENSITY", f"{m.rho:.10g}"]
        text.append(f"*SOLID SECTION, ELSET=SOLID{k}, MATERIAL=M{k}")
        n_nodes += len(solid.nodes)
    for spring in springs:
        # displacements and rotations of the first patch, and of the second
        ends = [n_nodes + k for k in (1, 2, 3, 4)]
        n_nodes += 4
        text += ["*NODE", *(f"{n}, {', '.join(f'{v:.10g}' for v in spring.place)}" for n in ends)]
        text += _rigid_patch(places, spring.first, spring.place, *ends[:2])
        text += _rigid_patch(places, spring.second, spring.place, *ends[2:])
        for d, k in enumerate(spring.stiffness):
            n_elements += 1
            at, axis = d // 3, d % 3 + 1
            text += [f"*ELEMENT, TYPE=SPRING2, ELSET=S{n_elements}"]
            text += [f"{n_elements}, {ends[at]}, {ends[at + 2]}"]
            text += [f"*SPRING, ELSET=S{n_elements}", f"{axis}, {axis}", f"{k:.10e}"]
    return "\n".join([*text, *step]) + "\n"


def run(folder: Path, job: str, text: str) -> None:
    """Write a deck and run CalculiX on it.

    Raises
    ------
    CalculixError
        If there is no CalculiX, or it does not finish.
    """
    program = shutil.which("ccx")
    if program is None:
        msg = "CalculiX is needed: `ccx` on the PATH (on Debian: apt-get install calculix-ccx)"
        raise CalculixError(msg)
    (folder / f"{job}.inp").write_text(text)
    done = subprocess.run([program, job], cwd=folder, capture_output=True, text=True, check=False)
    if "Job finished" not in done.stdout or "*ERROR" in done.stdout:
        msg = f"CalculiX did not finish {job}.inp:\n{done.stdout[-3000:]}"
        raise CalculixError(msg)


def export_matrices(folder: Path, job: str, solid: Solid) -> None:
    """Write job.inp and let CalculiX write job.sti, job.mas and job.dof of a free solid."""
    run(folder, job, deck([solid], step=["*STEP", "*FREQUENCY, SOLVER=MATRIXSTORAGE", "", "*END STEP"]))


@dataclass(frozen=True, eq=False)
class SolidModes:
    """Natural frequencies [Hz], and displacements (mode, node, 3) with unit modal mass [kg^-1/2]."""

    frequency: NDArray[np.float64]
    shape: NDArray[np.float64]


def solve(
    folder: Path, job: str, solids: Sequence[Solid], springs: Sequence[Spring], n: int, nodes: Sequence[int]
) -> SolidModes:
    """Return the lowest modes by CalculiX at some nodes, in their order."""
    wanted = ["*NSET, NSET=WANTED", *_rows(sorted(set(nodes)), 12)]
    step = ["*STEP", "*FREQUENCY", str(n), "*NODE PRINT, NSET=WANTED", "U", "*END STEP"]
    run(folder, job, deck(solids, springs, [*wanted, *step]))
    lines = (folder / f"{job}.dat").read_text().splitlines()
    frequency: list[float] = []
    shapes: list[dict[int, list[float]]] = []
    for line in lines:
        words = line.split()
        if "displacements" in line:
            shapes.append({})
        elif len(words) == 5 and words[0].isdigit() and len(frequency) < n and not shapes:
            frequency.append(float(words[3]))
        elif len(words) == 4 and words[0].isdigit() and shapes:
            shapes[-1][int(words[0])] = [float(v) for v in words[1:]]
    if not len(frequency) == len(shapes) == n or any(len(shape) < len(set(nodes)) for shape in shapes):
        msg = f"{job}.dat has {len(frequency)} frequencies and {len(shapes)} shapes; {n} were asked for"
        raise CalculixError(msg)
    phi = np.array([[shape[node] for node in nodes] for shape in shapes])
    # with tonnes, shapes are in t^-1/2
    return SolidModes(np.array(frequency), phi / np.sqrt(1000.0))


def accelerance(
    modes: SolidModes,
    lines: NDArray[np.float64],
    out: Sequence[tuple[int, int]],
    force: Sequence[tuple[int, int]],
    zeta: float,
) -> NDArray[np.complex128]:
    """Return accelerances by superposition of modes, shape (line, output, force) [1/kg].

    ``out`` and ``force`` are (index of a node in ``modes``, axis 0 to 2). Each mode has the damping ratio
    ``zeta``; motions as a rigid body have next to no frequency, and keep it.
    """
    w, wn = 2 * np.pi * lines[:, None], 2 * np.pi * np.abs(modes.frequency)
    gain = -(w**2) / (wn**2 - w**2 + 2j * zeta * wn * w)
    a, b = (np.array([modes.shape[:, k, d] for k, d in dofs]) for dofs in (out, force))
    return np.einsum("im,fm,jm->fij", a, gain, b)


def with_noise(H: NDArray[np.complex128], level: float, seed: int) -> NDArray[np.complex128]:
    """Return FRFs with complex noise, relative to each value."""
    noise = np.random.default_rng(seed).standard_normal((2, *H.shape))
    return H * (1 + level * (noise[0] + 1j * noise[1]) / np.sqrt(2))
