"""Make frames on a shaker table, and with a reference in place of the force: OpenSees' beams.

python -m benchmarks.independent.base_motion FOLDER [NAMES], under the peers' interpreter

With Z the dynamic stiffness of the structure without its connections to the ground, K of these and r the
table's unit translation at each, the absolute motion is (Z + Σ R K Rᵀ)⁻¹ Σ R K r: connections drive it, and
no load or large mass is needed. Parts come from :mod:`benchmarks.independent.foreign`.
"""

import sys

import numpy as np

from benchmarks.independent.bodies import coupled, zeta_of
from benchmarks.independent.casefiles import AXES, NOTHING, named, with_noise, write_cases, write_files
from benchmarks.independent.foreign.bench import Bench, Hidden, attachments, dynamic_stiffness
from benchmarks.independent.foreign.kinds import connection_truth
from benchmarks.independent.foreign.structure import nominal_of, read

TABLE_NODE = 900
"""Node of the accelerometer on the table, in the files."""
ALONG = "xy"
"""The table moves along these axes, one after the other."""
FORCES = {
    "bay": (("P22x", "P11x"), ("R22y", "Q11y")),
    "mast": (("M22x", "M11x"), ("X1y", "M11y")),
}
"""Where structures are hit by forces that nobody measures, one at a time, and what responses refer to."""


def transmissibilities(bench, hidden, along=ALONG):
    """Return absolute accelerations over that of the table, (n_freq, n_sensors, n_directions) [-]."""
    structure, omega = bench.structure, 2 * np.pi * bench.structure.frequency
    if hidden.dashpots or hidden.springs or hidden.dampers:
        msg = "connections to a table have no dashpots here, and nothing else is tied to it"
        raise ValueError(msg)
    squares, whole = bench.coordinates(hidden, {})
    parts, inputs = attachments(hidden, omega, whole, bench.turning), 0.0
    for c in structure.connections.values():
        R, K = bench.relative(c, hidden, whole), dynamic_stiffness(c, hidden, omega, 1.0)
        parts.append((R, K))
        if len(c.sides) == 1:
            inputs = inputs + R @ K[0][:, [AXES.index(d) for d in along]]
    out = np.array([bench.reading(s, hidden, whole) for s in structure.channels]).T
    return coupled(
        squares, np.zeros(len(squares)), zeta_of(structure.damping, squares), parts, out, inputs, omega
    )


def over_reference(bench, hidden, rng):
    """Return accelerations over those of references, all as measured, (n_freq, n_sensors, n_forces) [-]."""
    names = [s["name"] for s in bench.structure.channels]
    forces, references = zip(*FORCES[bench.structure.name], strict=True)
    omega = 2 * np.pi * bench.structure.frequency
    squares, whole = bench.coordinates(hidden, {})
    parts = attachments(hidden, omega, whole, bench.turning)
    for c in bench.structure.connections.values():
        parts.append((bench.relative(c, hidden, whole), dynamic_stiffness(c, hidden, omega, 1.0)))
    out = np.array([bench.reading(s, hidden, whole) for s in bench.structure.channels]).T
    zeta = zeta_of(bench.structure.damping, squares)
    inputs = out[:, [names.index(force) for force in forces]]
    H = coupled(squares, np.zeros(len(squares)), zeta, parts, out, inputs, omega)
    H = with_noise(-(omega[:, None, None] ** 2) * H, rng)
    return H / H[:, [names.index(name) for name in references], range(len(forces))][:, None]


def soft(bench, name, i, k):
    """Return a connection that gives way in a direction, 0 to 5, and the words of truth.json."""
    return Hidden(stiffness={(name, i): k}), [connection_truth(bench.structure.connections[name], {i: k})]


def mass(bench, name, s, kg):
    """Return a mass on a member, and the words of truth.json."""
    length = bench.structure.members[name].length
    words = named("point_mass", name, value=kg, unit="kg", position=s, length=length)
    return Hidden(masses=((name, s, kg),)), [words]


def nothing(bench):
    """Return nothing, and the words of truth.json."""
    return Hidden(), [NOTHING]


CASES = {
    "table-bay-soft-foot": (51, "bay", True, (soft, "F2", 4, 4e3)),
    "table-mast-mass": (52, "mast", True, (mass, "X", 0.35, 0.04)),
    "table-bay-nothing": (53, "bay", True, (nothing,)),
    "table-mast-nothing": (54, "mast", True, (nothing,)),
    "reference-bay-soft-foot": (55, "bay", False, (soft, "F2", 4, 4e3)),
    "reference-bay-softer-foot": (58, "bay", False, (soft, "F2", 4, 1e3)),
    "reference-mast-mass": (56, "mast", False, (mass, "M2", 0.3, 0.06)),
    "reference-bay-nothing": (57, "bay", False, (nothing,)),
}
"""Seed, structure, whether it is on a table, and what is hidden.

Effects change the ratios by more than 1 dB beyond what E, ρ, damping and joints imitate.
"""


def write(folder, name):
    """Write a case and return its truth."""
    seed, structure, on_table, (make, *arguments) = CASES[name]
    rng, bench = np.random.default_rng(seed), Bench(read()[structure])
    hidden, effects = make(bench, *arguments)
    nominal = nominal_of(name, bench.structure, rng) | {"response": "transmissibility, -"}
    if on_table:
        nominal["excitations"] = [{"base": d, "node": TABLE_NODE} for d in ALONG]
        T = with_noise(transmissibilities(bench, hidden), rng)
    else:
        nominal["excitations"] = [{"sensor": f, "reference": r} for f, r in FORCES[structure]]
        T = over_reference(bench, hidden, rng)
    write_files(folder / name, nominal, bench.structure.frequency, T)
    return {"code": "OpenSees", "effects": effects}


if __name__ == "__main__":
    write_cases(sys.argv[1:], CASES, write)
