"""Two plates of solid elements that four bolts hold together; one bolt may be soft in two directions.

CalculiX exports K and M of either plate by itself, and solves both with springs in place of the bolts. The
study has the plates as ``[[superelements]]`` and the bolts as ``[[joints]]``. What the truth has otherwise is
drawn from a seed: Young's modulus of the plates, the stiffness of the bolts, the damping, and the soft bolt.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.parts_ccx.calculix import (
    Material,
    Solid,
    Spring,
    accelerance,
    export_matrices,
    hexahedra,
    solve,
    with_noise,
)
from fem import FRF
from fem.io import write_uff

STEEL, ALUMINIUM = Material(206e3, 0.29, 7.83e-9), Material(71.5e3, 0.33, 2.72e-9)
BOLTS = {"P": (256.0, 36.0), "Q": (256.0, 132.0), "R": (352.0, 36.0), "S": (352.0, 132.0)}
"""Name and place (x, y) of each bolt [mm]."""
BASE_TOP, COVER_BOTTOM = 9.0, 17.0
"""Heights of the faces that look at each other [mm]: distance washers are between them."""
REACH = 14.0
"""Radius of the area that a bolt clamps [mm]."""
BOLT = (4.0e7, 4.0e7, 1.2e8, 9.0e3, 9.0e3, 6.0e3)
"""Stiffness of a bolt with its washers along x, y, z [N/m] and about them [N·m/rad], in the study."""
SCATTER = 0.08
"""Largest relative deviation of a bolt's stiffness where nothing is hidden: the study has 5 % (1 σ)."""
HIDDEN_DIRECTIONS = "xy"
BASE_SENSORS = {
    1: (16, 12, 9),
    2: (16, 156, 9),
    3: (128, 84, 9),
    4: (192, 12, 9),
    5: (304, 168, 9),
    6: (400, 84, 9),
}
COVER_SENSORS = {
    11: (224, 84, 23),
    12: (304, 12, 23),
    13: (416, 36, 23),
    14: (464, 156, 23),
    15: (528, 12, 23),
    16: (528, 168, 23),
}
"""Nodes of the test and their places [mm]; each has three directions."""
FORCES = {21: ((48, 156, 9), "z"), 22: ((496, 12, 23), "z"), 23: ((0, 36, 9), "x")}
"""Node, place [mm] and direction of the hammer; at no sensor, as a force bends a solid locally."""
LINES = np.arange(80.0, 1600.0, 2.0)
NOISE = 0.01
N_MODES = 300
"""Modes of CalculiX that are superposed."""


def plates() -> tuple[Solid, Solid]:
    """Return the base, 400 x 168 x 9 mm of steel, and the cover, 320 x 168 x 6 mm of aluminium."""
    y = [0, 12, 24, 36, 48, 60, 84, 108, 120, 132, 144, 156, 168]
    x = [0, 16, 48, 80, 104, 128, 160, 192, 224, 244, 256, 268, 304, 340, 352, 364, 400]
    base = hexahedra([x, y, [0, BASE_TOP]], STEEL)
    x = [208, 224, 244, 256, 268, 304, 340, 352, 364, 390, 416, 440, 464, 496, 528]
    return base, hexahedra([x, y, [COVER_BOTTOM, 23]], ALUMINIUM)


@dataclass(frozen=True)
class Truth:
    """What a seed draws: factors of E of the plates and of the bolts' stiffnesses, damping, the soft bolt."""

    moduli: tuple[float, float]
    bolts: dict[str, tuple[float, ...]]  # stiffness of each [N/m, N·m/rad]
    zeta: float
    soft: str  # "" where nothing is hidden


def draw(seed: int, hidden: bool) -> Truth:
    """Return the truth of a seed; with and without the soft bolt all else is the same."""
    rng = np.random.default_rng(seed)
    moduli = 1 + rng.uniform(-0.03, 0.03, 2)
    bolts = {name: np.array(BOLT) * (1 + rng.uniform(-SCATTER, SCATTER, 6)) for name in BOLTS}
    zeta = 0.004 * np.exp(0.2 * rng.standard_normal())
    soft, share = str(rng.choice(list(BOLTS))), rng.uniform(0.02, 0.08, 2)
    if hidden:
        bolts[soft][["xyz".index(d) for d in HIDDEN_DIRECTIONS]] *= share
    stiffness = {name: tuple(k.tolist()) for name, k in bolts.items()}
    return Truth((float(moduli[0]), float(moduli[1])), stiffness, float(zeta), soft if hidden else "")


def clamped_nodes(solid: Solid, name: str, height: float) -> list[int]:
    """Return the nodes of a plate that a bolt clamps."""
    away = np.linalg.norm(solid.nodes[:, :2] - BOLTS[name], axis=1)
    face = np.isin(np.arange(len(solid.nodes)) + 1, solid.on_plane(2, height))
    return (np.flatnonzero(face & (away <= REACH)) + 1).tolist()


def measured(folder: Path, truth: Truth) -> FRF:
    """Return the accelerances of both plates by CalculiX, without noise."""
    base, cover = (s.with_stiffness(f) for s, f in zip(plates(), truth.moduli, strict=True))
    first = len(base.nodes)  # nodes of the cover follow those of the base
    springs = [
        Spring(
            tuple(clamped_nodes(base, name, BASE_TOP)),
            tuple(n + first for n in clamped_nodes(cover, name, COVER_BOTTOM)),
            (*BOLTS[name], (BASE_TOP + COVER_BOTTOM) / 2),
            tuple(np.array(k) * [1e-3, 1e-3, 1e-3, 1e3, 1e3, 1e3]),
        )
        for name, k in truth.bolts.items()
    ]
    places = {**BASE_SENSORS, **COVER_SENSORS, **{n: place for n, (place, _) in FORCES.items()}}
    nodes = [base.at(place) if place[2] <= BASE_TOP else cover.at(place) + first for place in places.values()]
    modes = solve(folder, "whole", (base, cover), springs, N_MODES, nodes)
    order = list(places)
    out = [(k, d) for k in range(len(BASE_SENSORS) + len(COVER_SENSORS)) for d in range(3)]
    force = [(order.index(n), "xyz".index(d)) for n, (_, d) in FORCES.items()]
    H = accelerance(modes, LINES, out, force, truth.zeta)
    outputs = [f"{order[k]}{'xyz'[d]}" for k, d in out]
    return FRF.from_arrays(LINES, H, "accelerance", outputs, [f"{n}{d}" for n, (_, d) in FORCES.items()])


def study_text(name: str) -> str:
    """Return the study of the plates with all bolts as drawn."""
    base, cover = plates()
    parts = []
    for part, solid, height, sensors in (
        ("base", base, BASE_TOP, BASE_SENSORS),
        ("cover", cover, COVER_BOTTOM, COVER_SENSORS),
    ):
        rows = [f'  {{ name = "{part}.{b}", nodes = {clamped_nodes(solid, b, height)} }},' for b in BOLTS]
        hit = {n: place for n, (place, _) in FORCES.items() if (place[2] <= BASE_TOP) == (part == "base")}
        rows += [
            f'  {{ name = "{n}", nodes = [{solid.at(place)}] }},' for n, place in {**sensors, **hit}.items()
        ]
        parts += ["[[superelements]]", f'name = "{part}"', f'file = "{part}.sti"', f'mesh = "{part}.inp"']
        parts += ['units = "mm-t-s"']
        parts += ["attach = [", *rows, "]", ""]
    k = ", ".join(f"k{d} = {v:g}" for d, v in zip(("x", "y", "z", "rx", "ry", "rz"), BOLT, strict=True))
    for b, (x, y) in BOLTS.items():
        place = [round(v * 1e-3, 9) for v in (x, y, (BASE_TOP + COVER_BOTTOM) / 2)]
        parts += ["[[joints]]", f'name = "bolt {b}"', f'point1 = "base.{b}"', f'point2 = "cover.{b}"']
        parts += [f"location = {place}", f"k = {{ {k} }}", ""]
    for n, (_, d) in FORCES.items():
        parts += [
            "[[excitations]]",
            f'name = "{n}{d}"',
            f'point = "{n}"',
            f'direction = "{d}"',
            f"node = {n}",
            "",
        ]
    parts += ["[[measurements]]", 'file = "frf.uff"', "", "[damping]", "modal = 0.004", ""]
    return "\n".join(['sensors = "sensors.csv"', "", "[study]", f'name = "{name}"', "", *parts])


def make(folder: Path, seed: int, hidden: bool, noise: float = NOISE) -> Truth:
    """Write study.toml, frf.uff and the matrices of both plates into a folder; return the truth."""
    folder.mkdir(parents=True, exist_ok=True)
    truth = draw(seed, hidden)
    for part, solid in zip(("base", "cover"), plates(), strict=True):
        export_matrices(folder, part, solid)
    frf = measured(folder, truth)
    noisy = FRF.from_arrays(LINES, with_noise(frf.H, noise, seed), "accelerance", frf.outputs, frf.inputs)
    write_uff(
        folder / "frf.uff", noisy, dofs={c: f"{c[:-1]}{c[-1].upper()}+" for c in (*frf.outputs, *frf.inputs)}
    )
    rows = [f"{n},{n},xyz,{n}" for n in (*BASE_SENSORS, *COVER_SENSORS)]
    (folder / "sensors.csv").write_text("\n".join(["name,point,direction,node", *rows]) + "\n")
    (folder / "study.toml").write_text(study_text("Two plates held by four bolts"))
    return truth
