"""A frame of three bars on a solid corner piece, by centre lines and with the corner as a superelement.

CalculiX solves all of it as solid elements, and exports K and M of the corner piece by itself. Each model is
compared with these FRFs without any fit.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.parts_ccx.calculix import (
    Material,
    Solid,
    SolidModes,
    accelerance,
    export_matrices,
    hexahedra,
    solve,
)
from dovetail import load_study
from fem import FRF
from fem.io import write_npz
from updating import Comparison

STEEL = Material(209e3, 0.3, 7.82e-9)
BLOCK = 24.0
"""Half the edge of the block in which the bars meet [mm]."""
CUT = 60.0
"""Where the corner piece ends on each bar [mm]: one and a half depths from the block."""
LENGTH = (420.0, 348.0, 294.0)
"""From the middle of the block to the end of the bars along x, y and z [mm]."""
B, H = 24.0, 16.0
"""Section of the bars: width and height [mm]."""
HEIGHT_AXIS = (2, 2, 1)
"""Axis along which the height of each bar is."""
PIECE = 18.0
"""Longest element along a bar [mm]."""
SENSORS = {
    1: (0, 420),
    2: (0, 312),
    3: (0, 186),
    4: (1, 348),
    5: (1, 240),
    6: (1, 132),
    7: (2, 294),
    8: (2, 204),
    9: (2, 114),
}
"""Node of the test: its bar, and the distance from the middle of the block [mm]."""
FORCES = {21: (0, 384, "z"), 22: (1, 312, "z"), 23: (2, 258, "x")}
LINES = np.arange(60.0, 1500.0, 2.0)
ZETA = 0.005
N_MODES = 160


def solids(reach: tuple[float, ...] = LENGTH) -> Solid:
    """Return block and bars up to a distance from the middle of the block along x, y and z."""
    lines = []
    for end in reach:
        n = round((end - CUT) / PIECE)
        beyond = np.linspace(CUT, end, n + 1)[1:]
        lines.append([-BLOCK, -B / 2, -H / 2, 0, H / 2, B / 2, BLOCK, 36, 48, CUT, *beyond])

    def keep(middle: NDArray[np.float64]) -> bool:
        if (abs(middle) < BLOCK).all():
            return True
        (bar,) = np.flatnonzero(middle >= BLOCK) if (middle >= BLOCK).sum() == 1 else (None,)
        if bar is None:
            return False
        sides = [H / 2 if axis == HEIGHT_AXIS[bar] else B / 2 for axis in range(3)]
        return all(axis == bar or abs(middle[axis]) < sides[axis] for axis in range(3))

    return hexahedra(lines, STEEL, keep)


def place(bar: int, distance: float) -> list[float]:
    """Return a place on the axis of a bar [mm]."""
    return [distance if axis == bar else 0.0 for axis in range(3)]


def measured(folder: Path) -> tuple[FRF, SolidModes]:
    """Return accelerances and modes of block and bars as solids, by CalculiX."""
    solid = solids()
    at = {**SENSORS, **{n: (bar, s) for n, (bar, s, _) in FORCES.items()}}
    nodes = [solid.at(place(bar, s)) for bar, s in at.values()]
    modes = solve(folder, "whole", (solid,), (), N_MODES, nodes)
    out = [(k, d) for k, (bar, _) in enumerate(SENSORS.values()) for d in range(3) if d != bar]
    force = [(len(SENSORS) + k, "xyz".index(d)) for k, (_, _, d) in enumerate(FORCES.values())]
    H = accelerance(modes, LINES, out, force, ZETA)
    order = list(at)
    outputs = [f"{order[k]}{'xyz'[d]}" for k, d in out]
    return FRF.from_arrays(
        LINES, H, "accelerance", outputs, [f"{n}{d}" for n, (*_, d) in FORCES.items()]
    ), modes


def study_text(model: str) -> str:
    """Return a study: the corner as a "rigid" or "average" superelement, "lines" alone, or with "zones"."""
    part = model in ("rigid", "average")
    start = CUT if part else 0.0
    t = ["[study]", f'name = "Three bars on a solid corner: {model}"', "", "[points]"]
    for bar, axis in enumerate("xyz"):
        if part:
            t.append(f"corner{axis} = {_metres(place(bar, start))}")
        t.append(f"end{axis} = {_metres(place(bar, LENGTH[bar]))}")
    if not part:
        t.append("corner = [0.0, 0.0, 0.0]")
    for bar, axis in enumerate("xyz"):
        t += ["", f"[members.{axis}]", f'from = "corner{axis if part else ""}"', f'to = "end{axis}"']
        t.append(f'orientation = "{"xyz"[HEIGHT_AXIS[bar]]}"')
        if model == "zones":
            t.append(f"rigid1 = {BLOCK * 1e-3}")
    t += [
        "",
        "[materials.steel]",
        f"E = {STEEL.E * 1e6:g}",
        f"rho = {STEEL.rho * 1e12:g}",
        f"nu = {STEEL.nu}",
    ]
    t += [
        "",
        "[sections.bar]",
        'shape = "rectangle"',
        f"b = {B * 1e-3}",
        f"h = {H * 1e-3}",
        f"nu = {STEEL.nu}",
    ]
    if part:
        corner = solids((CUT, CUT, CUT))
        t += [
            "",
            "[[superelements]]",
            'name = "corner"',
            'file = "corner.sti"',
            'mesh = "corner.inp"',
            'units = "mm-t-s"',
            "attach = [",
        ]
        for bar, axis in enumerate("xyz"):
            nodes = corner.on_plane(bar, CUT)
            t.append(f'  {{ point = "corner{axis}", nodes = {nodes}, tie = "{model}" }},')
        t.append("]")
    else:
        mass, centre, inertia = _block_beyond_bars()
        t += ["", "[[masses]]", 'name = "block"', 'point = "corner"', f"mass = {mass:.6g}"]
        t += [
            f"arm = {[round(v, 9) for v in centre.tolist()]}",
            f"inertia = {[float(f'{v:.6g}') for v in inertia.tolist()]}",
        ]
    across = [(n, bar, s, d) for n, (bar, s) in SENSORS.items() for d in "xyz".replace("xyz"[bar], "")]
    for n, bar, s, d in across:
        t += ["", "[[sensors]]", f'name = "{n}{d}"', f'member = "{"xyz"[bar]}"']
        t += [f"position = {round((s - start) * 1e-3, 9)}", f'direction = "{d}"']
    for n, (bar, s, d) in FORCES.items():
        t += ["", "[[excitations]]", f'name = "{n}{d}"', f'member = "{"xyz"[bar]}"']
        t += [f"position = {round((s - start) * 1e-3, 9)}", f'direction = "{d}"']
    t += ["", "[[measurements]]", 'file = "frf.npz"', "", "[damping]", f"modal = {ZETA}"]
    return "\n".join(t) + "\n"


def _metres(place: list[float]) -> list[float]:
    return [round(v * 1e-3, 9) for v in place]


def _block_beyond_bars() -> tuple[float, NDArray[np.float64], NDArray[np.float64]]:
    """Return mass [kg], centre [m] and moments of inertia about it [kg·m²] of the block less its bars."""
    rho, a = STEEL.rho * 1e12, 2 * BLOCK * 1e-3
    bodies = [(rho * a**3, np.zeros(3), np.full(3, a))]
    for bar in range(3):
        size = np.array([H if axis == HEIGHT_AXIS[bar] else B for axis in range(3)]) * 1e-3
        size[bar] = BLOCK * 1e-3
        bodies.append((-rho * float(size.prod()), np.array(_metres(place(bar, BLOCK / 2))), size))
    mass = sum(m for m, _, _ in bodies)
    centre = sum((m * c for m, c, _ in bodies), np.zeros(3)) / mass
    inertia = np.zeros(3)
    for m, c, size in bodies:
        square = size**2 / 12 + (c - centre) ** 2
        inertia += m * (square.sum() - square)
    return float(mass), centre, inertia


@dataclass(frozen=True)
class Agreement:
    """How far a model is from CalculiX, without a fit: FRFs [dB], and the first elastic frequencies [-]."""

    model: str
    all_db: float
    frequency: tuple[float, ...]


def compare(
    folder: Path, models: tuple[str, ...] = ("lines", "zones", "rigid", "average")
) -> list[Agreement]:
    """Write studies of some models into a folder, and compare each with the solids."""
    folder.mkdir(parents=True, exist_ok=True)
    export_matrices(folder, "corner", solids((CUT, CUT, CUT)))
    frf, modes = measured(folder)
    write_npz(folder / "frf.npz", frf)
    elastic = np.array([f for f in modes.frequency if 1.0 < f < LINES[-1]])
    out = []
    for model in models:
        (folder / f"{model}.toml").write_text(study_text(model))
        study = load_study(folder / f"{model}.toml")
        found = study.solve_modes(elastic.size).frequency
        error = tuple((found[-elastic.size :] / elastic - 1).tolist())
        compared = study.compare()
        assert isinstance(compared, Comparison)
        out.append(Agreement(model, float(compared.total_db), error))
    return out
