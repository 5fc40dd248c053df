"""Check the map of a planned test by a truth of OpenSees: python -m benchmarks.plan_truth [--sets N]

The frame is a gantry of six members. Each set draws an effect that the map names at a plausible size, puts it
at 0.5, 1, 1.5 or 2 times that size into a fine model of OpenSees, simulates the planned test, and diagnoses
it. The structure is not quite the described one: Young's modulus, density, damping and the gains of the
channels are drawn. The interpreter of OpenSees is that of the peers (`benchmarks.peers.exchange`).
"""

import argparse
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from benchmarks.peers.exchange import TIMOSHENKO, PeerFrame, run
from dovetail.disk.output import write_json
from fem import (
    DIRECTIONS,
    FRF,
    Damping,
    Effect,
    Frame,
    Material,
    MemberProperties,
    Mesh,
    Model,
    Section,
    Support,
)
from updating import Measurement, Nuisance, Outlook, Plan, Sensor, diagnose, plan_test
from updating.plan import SURE, planned_measurement

Floats = NDArray[np.float64]

MULTIPLES = (0.5, 1.0, 1.5, 2.0)
"""Amplitudes of the effects, in parts of those that the map names [-]."""
KINDS = (
    "point_mass",
    "member_stiffness",
    "member_density",
    "stiffness_loss",
    "support_flexibility",
    "end_release",
    "crack",
)
"""Kinds that the truth can have."""
NOISE, GAIN = 0.01, 0.03
"""Noise of the plan, and standard deviation of the gain of a channel [-]."""
UNCERTAIN = {"E": 0.02, "rho": 0.01}
"""Relative standard deviations of the material [-]."""
RATIO = 0.01
"""Damping ratio of the description; that of each mode is drawn about it [-]."""
PIECES = 12
"""Elements of a member in the truth."""
N_MODES = 250
STEEL = Material("steel", 210e9, 7850.0)
TUBE, BOX = Section.tube(0.042, 0.003), Section.hollow_rectangle(0.030, 0.050, 0.003)
SHEAR = {"left": 0.53, "right": 0.53, "strut": 0.53}
"""Shear coefficients of the truth for thin tubes; 0.45 for the boxes [-]."""

POINTS = {
    "left foot": (0.0, 0.0, 0.0),
    "right foot": (1.1, 0.0, 0.0),
    "back foot": (0.5, 0.95, 0.0),
    "left top": (0.0, 0.0, 0.9),
    "right top": (1.1, 0.0, 0.9),
    "middle": (0.5, 0.0, 0.9),
    "tip": (0.5, 0.6, 0.9),
}
MEMBERS = {
    "left": ("left foot", "left top", TUBE),
    "right": ("right foot", "right top", TUBE),
    "beam1": ("left top", "middle", BOX),
    "beam2": ("middle", "right top", BOX),
    "arm": ("middle", "tip", BOX),
    "strut": ("back foot", "tip", TUBE),
}
SENSORS = (
    ("left", 0.5, "x"),
    ("left", 0.5, "y"),
    ("right", 0.6, "y"),
    ("beam1", 0.0, "x"),
    ("beam1", 0.5, "z"),
    ("beam2", 0.5, "y"),
    ("beam2", 0.6, "z"),
    ("arm", 0.5, "x"),
    ("arm", 1.0, "z"),
    ("strut", 0.4, "x"),
)
FORCES = (("beam1", 0.5, "z"), ("arm", 0.5, "x"))
FREQUENCY = np.arange(10.0, 400.5, 0.5)


def model_of_gantry() -> Model:
    """Return the description, with a node at each sensor."""
    names, points = list(POINTS), np.array(list(POINTS.values()))
    lines = [[names.index(a), names.index(b)] for a, b, _ in MEMBERS.values()]
    mesh = Mesh.from_lines(points, lines, {m: [k] for k, m in enumerate(MEMBERS)}).split(10)
    frame = Frame(members={m: MemberProperties(STEEL, section) for m, (*_, section) in MEMBERS.items()})
    feet = (Support(name=n, point=k) for k, n in enumerate(names) if n.endswith("foot"))
    return Model(mesh, (frame, *feet), Damping.modal(RATIO))


def at(member: str, share: float) -> Floats:
    """Return the point at a share of a member [m]."""
    a, b = (np.array(POINTS[p]) for p in MEMBERS[member][:2])
    return a + share * (b - a)


def length_of(member: str) -> float:
    """Return the length of a member [m]."""
    return float(np.linalg.norm(at(member, 1.0) - at(member, 0.0)))


def channels(some: Sequence[tuple[str, float, str]]) -> tuple[Sensor, ...]:
    """Return sensors or forces."""
    return tuple(Sensor(f"{m} {100 * s:.0f} {d}", at(m, s), np.eye(3)["xyz".index(d)]) for m, s, d in some)


@dataclass(frozen=True)
class Structure:
    """The structure as it is: what an analyst does not know, without the effect.

    Attributes
    ----------
    E, rho : float
        Young's modulus [Pa] and density [kg/m³].
    damping : ndarray (N_MODES,)
        Damping ratios of the modes [-].
    gains : ndarray (n_out, n_in)
        Factors of the FRFs [-].
    """

    E: float
    rho: float
    damping: Floats
    gains: Floats

    @classmethod
    def drawn(cls, rng: np.random.Generator) -> "Structure":
        """Draw a structure."""
        E, rho = (
            value * np.exp(UNCERTAIN[key] * rng.standard_normal())
            for key, value in (("E", STEEL.E), ("rho", STEEL.rho))
        )
        level = 0.3 * rng.standard_normal()
        damping = RATIO * np.exp(level + 0.1 * rng.standard_normal(N_MODES))
        out, into = (1 + GAIN * rng.standard_normal(n) for n in (len(SENSORS), len(FORCES)))
        return cls(E, rho, damping, np.outer(out, into))


def receptances(effect: Effect, structure: Structure, axes: dict[str, Floats]) -> NDArray[np.complex128]:
    """Return the FRFs (n_freq, n_out, n_in) of a structure with an effect [m/N], by K and M of OpenSees.

    Parameters
    ----------
    effect : Effect
        Of one of the `KINDS`.
    structure : Structure
    axes : dict of str to ndarray (3, 3)
        Local axes of the members as rows.
    """
    v = {p.name: float(p.value) for p in effect.parameters()}
    where: Any = effect
    member = getattr(effect, "member", None)
    places = {m: set(np.linspace(0, 1, PIECES + 1).round(9).tolist()) for m in MEMBERS}
    for m, s, _ in (*SENSORS, *FORCES):
        places[m].add(s)
    cut = None
    if effect.kind in ("point_mass", "crack"):
        cut = v["position"] / length_of(where.member)
    if effect.kind == "end_release":
        cut = float(where.end - 1)
    stretch = (0.0, 0.0)
    if effect.kind == "stiffness_loss":
        ends = v["position"] - where.width / 2, v["position"] + where.width / 2
        stretch = ends[0] / length_of(where.member), ends[1] / length_of(where.member)
    for s in (*(() if cut is None else (cut,)), *(stretch if any(stretch) else ())):
        places[where.member].add(round(s, 9))
    hinged = effect.kind in ("crack", "end_release")
    nodes: dict[Any, int] = {}
    points: list[Floats] = []

    def node(point: Floats, key: str = "") -> int:
        found = (*np.round(point, 6), key)
        if found not in nodes:
            nodes[found] = len(points)
            points.append(point)
        return nodes[found]

    lines, local_z, rows, pair = [], [], [], (0, 0)
    for m, (*_, section) in MEMBERS.items():
        every = sorted(places[m])
        every = [s for k, s in enumerate(every) if not k or s - every[k - 1] > 1e-6]
        for s, t in pairwise(every):
            i, j = node(at(m, s)), node(at(m, t))
            if cut is not None and hinged and m == member:
                # the element on the far side of the hinge has a node of its own there
                if abs(s - cut) < 1e-6 and cut < 1:
                    pair = i, node(at(m, s), "hinge")
                    i = pair[1]
                elif abs(t - cut) < 1e-6 and cut == 1:
                    pair = j, node(at(m, t), "hinge")
                    j = pair[1]
            middle = 0.5 * (s + t)
            stiff = 1 + v["change"] if effect.kind == "member_stiffness" and m == member else 1.0
            if m == member and stretch[0] < middle < stretch[1]:
                stiff *= 1 - v["loss"]
            heavy = 1 + v["change"] if effect.kind == "member_density" and m == member else 1.0
            E, shear = stiff * structure.E, SHEAR.get(m, 0.45)
            moments = section.A, section.Iy, section.Iz, section.J
            rows.append((E, E / (2 + 2 * STEEL.nu), heavy * structure.rho, *moments, shear, shear))
            lines.append((i, j))
            local_z.append(axes[m][2])
    n = len(points)
    K, M = _matrices(np.array(points), np.array(lines), np.array(local_z), np.array(rows))
    if effect.kind == "point_mass":
        i = 6 * node(at(where.member, round(cut or 0.0, 9)))
        M[range(i, i + 3), range(i, i + 3)] += v["mass"]
    free, B = np.ones(6 * n, dtype=bool), np.eye(6 * n)
    for name in (p for p in POINTS if p.endswith("foot")):
        i = 6 * node(np.array(POINTS[name]))
        free[i : i + 6] = False
        if effect.kind == "support_flexibility" and name in where.supports:
            k = i + DIRECTIONS.index(where.direction)
            free[k] = True
            K[k, k] += v["stiffness"]
    if hinged:
        i, j = (6 * p for p in pair)
        axis = axes[where.member]["xyz".index(where.direction[1])]
        row = np.zeros(6 * n)
        row[i + 3 : i + 6], row[j + 3 : j + 6] = -axis, axis
        K += np.outer(row, row) / v["compliance"]
        B[j : j + 6] = np.eye(6 * n)[i : i + 6]
        B[j + 3 : j + 6, j + 3] = axis
        free[[j, j + 1, j + 2, j + 4, j + 5]] = False
    B = B[:, free]
    K, M = B.T @ K @ B, B.T @ M @ B
    squared, V = eigh(0.5 * (K + K.T), 0.5 * (M + M.T), subset_by_index=[0, N_MODES - 1])
    omega, natural = 2 * np.pi * FREQUENCY[:, None], np.sqrt(squared)
    D = squared - omega**2 + 2j * structure.damping * natural * omega
    shapes = [
        np.array([B[6 * node(at(m, s)) + "xyz".index(d)] for m, s, d in some]) @ V
        for some in (SENSORS, FORCES)
    ]
    return np.einsum("om,fm,im->foi", shapes[0], 1 / D, shapes[1], optimize=True)


def _matrices(points: Floats, lines: NDArray[Any], local_z: Floats, rows: Floats) -> tuple[Floats, Floats]:
    """Return K and M of OpenSees, (6 n, 6 n)."""
    n, m = len(points), len(lines)
    names = ("E", "G", "rho", "A", "Iy", "Iz", "J", "ky", "kz")
    frame = PeerFrame(
        points=points,
        lines=lines,
        local_z=local_z,
        fixed=np.zeros((n, 6), dtype=bool),
        loads=np.zeros((n, 6)),
        uniform=np.zeros((0, 3)),
        released=np.zeros((m, 2, 2), dtype=bool),
        theory=TIMOSHENKO,
        static=False,
        matrices=True,
        **dict(zip(names, rows.T, strict=True)),
    )
    with tempfile.TemporaryDirectory() as folder:
        (result,) = run("drive_opensees", [frame], Path(folder))
    return result.K, result.M


def simulated(
    test: Measurement, effect: Effect, axes: dict[str, Floats], rng: np.random.Generator
) -> Measurement:
    """Return the measurement of a planned test on a drawn structure with an effect."""
    structure = Structure.drawn(rng)
    H = receptances(effect, structure, axes)
    H = H * structure.gains * -((2 * np.pi * FREQUENCY[:, None, None]) ** 2)
    assert test.scatter is not None
    sigma = test.scatter * np.abs(test.frf.H)  # of the real and of the imaginary part
    parts = rng.standard_normal((2, *H.shape))
    H = H + sigma * (parts[0] + 1j * parts[1])
    frf = FRF.from_arrays(FREQUENCY, H, "accelerance", test.frf.outputs, test.frf.inputs)
    return replace(test, frf=frf, scatter=sigma / np.abs(H), name="simulated")


def planned(model: Model) -> Plan:
    """Return the map of the test."""
    test = planned_measurement(model, channels(SENSORS), channels(FORCES), FREQUENCY, NOISE)
    return plan_test(model, test, _nuisances())


def _nuisances() -> tuple[Nuisance, ...]:
    return tuple(Nuisance("frame", f"{key}:steel", std) for key, std in UNCERTAIN.items())


def sets(plan: Plan, model: Model, n: int, seed: int, first: int = 1) -> Any:
    """Yield what the diagnosis of each set says, as rows for a table and JSON."""
    kinds: dict[str, list[Outlook]] = {}
    for o in plan.relevant:
        if o.visible.is_plausible(MULTIPLES[-1] * o.visible.enough[2]) and o.relevant.kind in KINDS:
            kinds.setdefault(o.relevant.kind, []).append(o)
    rotations = next(iter(model.of_kind(Frame))).rotations(model.mesh)
    axes = {m: rotations[rows[0]] for m, rows in model.mesh.members.items()}
    for k in range(first, first + n):
        rng = np.random.default_rng([seed, k])
        some = kinds[sorted(kinds)[int(rng.integers(len(kinds)))]]
        visible = some[int(rng.integers(len(some)))].visible
        multiple = MULTIPLES[(k - 1) % len(MULTIPLES)]
        amplitude = multiple * visible.enough[2]
        effect = visible.at(amplitude)
        assert effect is not None
        start = time.process_time()
        found = diagnose(model, [simulated(plan.measurement, effect, axes, rng)], _nuisances())
        nothing = sum(p for some, p in found.posterior if not some)
        right = sum(p for some, p in found.posterior if effect.name in some)
        best, _ = max(found.posterior, key=lambda each: each[1])
        yield {
            "set": k,
            "kind": effect.kind,
            "where": effect.where,
            "values": {p.name: float(p.value) for p in effect.parameters()},
            "size": multiple,
            "predicted": visible.chances(amplitude),
            "rival": visible.rival.name,
            "alike": visible.alike,
            "seen": nothing <= 1 - SURE,
            "named": right >= SURE,
            "nothing": nothing,
            "right": right,
            "best": best,
            "verdict": found.verdict,
            "cpu_seconds": time.process_time() - start,
        }


def main() -> None:
    """Print a row for each set, and the counts."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--sets", type=int, default=16)
    parser.add_argument("--first", type=int, default=1, help="number of the first set")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    model, rows = model_of_gantry(), []
    plan = planned(model)
    print(f"map: {plan.coverage('seen'):.2f} seen, {plan.coverage('named'):.2f} named", flush=True)
    for row in sets(plan, model, options.sets, options.seed, options.first):
        rows.append(row)
        print(
            f"{row['set']:3d} {row['size']:4g} {row['kind']:20s}{row['where']:45s} seen {row['seen']:d} "
            f"named {row['named']:d} p {row['right']:.2f} nothing {row['nothing']:.2f} {row['best']}",
            flush=True,
        )
        write_json(options.json, {"seed": options.seed, "sets": rows})
    print("\nsize   n  seen  named   by the map: seen  named")
    for size in MULTIPLES:
        some = [row for row in rows if row["size"] == size]
        if some:
            chances = np.mean([row["predicted"] for row in some], axis=0)
            counts = (sum(row[what] for row in some) for what in ("seen", "named"))
            print("{:4g} {:3d} {:5d} {:6d} {:18.2f} {:6.2f}".format(size, len(some), *counts, *chances))


if __name__ == "__main__":
    sys.exit(main())
