"""Make A-frames with hidden effects by OpenSees: python -m benchmarks.independent.a_frames FOLDER [NAMES]

The structure is that of the two shared A-frames: hollow legs and rings, two rods as braces. OpenSees gives K
and M of a fine mesh of Timoshenko beams, whose shear coefficients are one number for all hollow sections;
hidden effects are added to them. Runs under the peers' interpreter.
"""

import itertools
import sys
from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import eigh

from benchmarks.independent.bodies import geometric_stiffness
from benchmarks.independent.casefiles import AXES, NOTHING, named, with_noise, write_cases, write_files
from benchmarks.peers.drive_opensees import build, matrices
from benchmarks.peers.exchange import TIMOSHENKO, PeerFrame

E, NU, RHO = 2.10e11, 0.3, 7850.0
PIECES = 12
"""Elements of a member."""
SHEAR = {"rhs": 0.45, "round": 0.886}
"""Shear coefficients of the truth, in both directions [-]."""
DAMPING = 0.006, 0.35, 260.0, 0.7
"""ζ(f) = ζ0 (1 + a sin(2π f/f1 + φ))."""
N_MODES = 400
"""Modes that a damper couples; those above respond as without it."""
FREQUENCY = np.arange(5.0, 500.25, 0.5)
DIRECTIONS = (*AXES, "rx", "ry", "rz")

LEG = {"type": "rhs", "b": 0.025, "h": 0.025, "t": 0.002, "A": 1.84e-4, "Iy": 1.63453e-8, "Iz": 1.63453e-8}
LEG |= {"J": 2.4334e-8}
RING = {"type": "rhs", "b": 0.015, "h": 0.025, "t": 0.0015, "h_direction": "vertical", "A": 1.11e-4}
RING |= {"Iy": 8.88325e-9, "Iz": 3.86325e-9, "J": 8.16061e-9}
ROD = {"type": "round", "d": 0.008, "A": 5.02655e-5, "Iy": 2.01062e-10, "Iz": 2.01062e-10, "J": 4.02124e-10}


def corners(x, y, z):
    return [np.array([sx * x, sy * y, z]) for sx, sy in ((-1, -1), (1, -1), (1, 1), (-1, 1))]


FEET, MIDDLE, TOP = corners(0.3, 0.25, 0.0), corners(0.2175, 0.18125, 0.55), corners(0.15, 0.125, 1.0)
MEMBERS = {
    f"L{k + 1}{part}": (LEG, a[k], b[k])
    for k in range(4)
    for part, a, b in (("a", FEET, MIDDLE), ("b", MIDDLE, TOP))
}
MEMBERS |= {
    f"R{n}_{k + 1}{(k + 1) % 4 + 1}": (RING, ring[k], ring[(k + 1) % 4])
    for n, ring in ((1, MIDDLE), (2, TOP))
    for k in range(4)
}
MEMBERS |= {"B1": (ROD, MIDDLE[0], TOP[1]), "B2": (ROD, MIDDLE[2], TOP[3])}
SENSORS = [
    (f"L{k}{part}", s) for part, s in (("a", 0.5), ("a", 1.0), ("b", 0.5), ("b", 1.0)) for k in range(1, 5)
]
SENSORS += [("R1_12", 0.5), ("R2_23", 0.5), ("R1_34", 0.5), ("B1", 0.5), ("B2", 0.5), ("R2_41", 0.5)]
EXCITATIONS = ("14x", "8y")
SUPPORTS = ("110", "120", "130", "140")


def at(member, s):
    """Return the point at a fraction of a member."""
    _, a, b = MEMBERS[member]
    return a + s * (b - a)


def length_of(member):
    return float(np.linalg.norm(at(member, 1.0) - at(member, 0.0)))


def axes_of(member):
    """Return the local axes as rows: y horizontal."""
    x = (at(member, 1.0) - at(member, 0.0)) / length_of(member)
    y = np.cross([0.0, 0.0, 1.0], x)
    y /= np.linalg.norm(y)
    return np.array([x, y, np.cross(x, y)])


@dataclass(frozen=True)
class Hidden:
    """What is hidden in the truth.

    `modulus`, `density`: factors of members. `notch`: member, from, to [m], factor of E. `masses`: member,
    fraction, mass [kg]. `springs`, `dampers`: member, fraction, direction, constant. `feet`: (support,
    direction) to stiffness. `tension`: of members [N]. `hinge`: member, local direction and stiffness of a
    turn at its first end. `faults`: factors of sensors.
    """

    modulus: dict = field(default_factory=dict)
    density: dict = field(default_factory=dict)
    notch: tuple = ()
    masses: tuple = ()
    springs: tuple = ()
    dampers: tuple = ()
    feet: dict = field(default_factory=dict)
    tension: dict = field(default_factory=dict)
    hinge: tuple = ()
    faults: dict = field(default_factory=dict)


class Mesh:
    """Points and elements; a member with a hinge has a point of its own at its first end."""

    def __init__(self, hidden):
        self.points, self.of, self.lines, known = [], {}, [], {}
        for member in MEMBERS:
            s = np.linspace(0, 1, PIECES + 1)
            if hidden.notch and hidden.notch[0] == member:
                s = np.unique(np.round([*s, *np.array(hidden.notch[1:3]) / length_of(member)], 9))
            ids = []
            for k, fraction in enumerate(s):
                point = at(member, fraction)
                key = (*np.round(point, 7), member if hidden.hinge[:1] == (member,) and k == 0 else "")
                if key not in known:
                    known[key] = len(self.points)
                    self.points.append(point)
                ids.append(known[key])
            self.of[member] = (np.array(ids), s)
            self.lines += [
                (member, 0.5 * (t + u), i, j)
                for (t, i), (u, j) in itertools.pairwise(zip(s, ids, strict=True))
            ]
        self.known = known

    def point(self, member, s):
        return self.known[(*np.round(at(member, s), 7), "")]

    def dof(self, member, s, direction):
        return 6 * self.point(member, s) + DIRECTIONS.index(direction)


def matrices_of(mesh, hidden):
    """Return K, M of OpenSees and C of the dampers, with what is hidden but for feet and hinges."""
    rows = []
    for member, s, _, _ in mesh.lines:
        section = MEMBERS[member][0]
        factor = hidden.modulus.get(member, 1.0)
        if (
            hidden.notch
            and hidden.notch[0] == member
            and hidden.notch[1] < s * length_of(member) < hidden.notch[2]
        ):
            factor *= hidden.notch[3]
        constants = (section[key] for key in ("A", "Iy", "Iz", "J"))
        k = SHEAR[section["type"]]
        rows.append(
            (factor * E, factor * E / (2 + 2 * NU), hidden.density.get(member, 1.0) * RHO, *constants, k, k)
        )
    names = ("E", "G", "rho", "A", "Iy", "Iz", "J", "ky", "kz")
    n = len(mesh.points)
    build(
        PeerFrame(
            points=np.array(mesh.points),
            lines=np.array([line[2:] for line in mesh.lines]),
            local_z=np.array([axes_of(member)[2] for member, *_ in mesh.lines]),
            fixed=np.zeros((n, 6), dtype=bool),
            loads=np.zeros((n, 6)),
            uniform=np.zeros((0, 3)),
            released=np.zeros((len(mesh.lines), 2, 2), dtype=bool),
            theory=TIMOSHENKO,
            matrices=True,
            **dict(zip(names, np.array(rows).T, strict=True)),
        )
    )
    K, M = matrices(6 * n)
    C = np.zeros_like(K)
    for member, s, mass in hidden.masses:
        for d in AXES:
            M[mesh.dof(member, s, d), mesh.dof(member, s, d)] += mass
    for X, connections in ((K, hidden.springs), (C, hidden.dampers)):
        for member, s, d, value in connections:
            X[mesh.dof(member, s, d), mesh.dof(member, s, d)] += value
    for member, force in hidden.tension.items():
        add_tension(K, mesh, member, force)
    return K, M, C


def add_tension(K, mesh, member, force):
    """Add the geometric stiffness of a member under tension."""
    ids, s = mesh.of[member]
    for i, j, h in zip(ids[:-1], ids[1:], np.diff(s) * length_of(member), strict=True):
        dofs = np.concatenate([6 * i + np.arange(6), 6 * j + np.arange(6)])
        K[np.ix_(dofs, dofs)] += geometric_stiffness(axes_of(member), h, force)


def free_motions(mesh, hidden, K):
    """Return the free motions of all DOFs as columns, and add soft feet and hinges to K."""
    keep, B = np.ones(len(K), dtype=bool), np.eye(len(K))
    for k, support in enumerate(SUPPORTS):
        for d in DIRECTIONS:
            dof = mesh.dof(f"L{k + 1}a", 0.0, d)
            soft = hidden.feet.get((support, d))
            keep[dof] = soft is not None
            K[dof, dof] += soft or 0.0
    if hidden.hinge:
        member, d, stiffness = hidden.hinge
        own, other = mesh.of[member][0][0], mesh.point(member, 0.0)
        axis = axes_of(member)[AXES.index(d[1])]
        row = np.zeros(len(K))
        row[6 * own + 3 : 6 * own + 6], row[6 * other + 3 : 6 * other + 6] = axis, -axis
        K += stiffness * np.outer(row, row)
        # it moves with the other point but for its turn, which stays as the coordinate of its first rotation
        B[6 * own : 6 * own + 6] = np.eye(len(K))[6 * other : 6 * other + 6]
        B[6 * own + 3 : 6 * own + 6, 6 * own + 3] = axis
        keep[[6 * own + k for k in (0, 1, 2, 4, 5)]] = False
    return B[:, keep]


def accelerances(hidden, sensors, excitations=EXCITATIONS, frequency=FREQUENCY):
    """Return FRFs (n_freq, n_out, n_in) [(m/s²)/N]."""
    mesh = Mesh(hidden)
    K, M, C = matrices_of(mesh, hidden)
    B = free_motions(mesh, hidden, K)
    K, M, C = (B.T @ X @ B for X in (K, M, C))
    squared, V = eigh(0.5 * (K + K.T), 0.5 * (M + M.T))
    own = np.sqrt(np.maximum(squared, 0.0))
    level, swing, period, phase = DAMPING
    f = own / (2 * np.pi)
    zeta = level * (1 + np.where(f < 3 * frequency[-1], swing * np.sin(2 * np.pi * f / period + phase), 0.0))
    out = np.array([B[mesh.dof(s["member"], s["position"], s["direction"])] for s in sensors]) @ V
    names = [s["name"] for s in sensors]
    into = out[[names.index(name) for name in excitations]]
    omega = 2 * np.pi * frequency
    D = squared - omega[:, None] ** 2 + 2j * omega[:, None] * zeta * own
    H = np.einsum("on,fn,in->foi", out, 1 / D, into, optimize=True)
    if C.any():
        modal, part = (V.T @ C @ V)[:N_MODES, :N_MODES], slice(0, N_MODES)
        for k, w in enumerate(omega):
            coupled = np.linalg.solve(np.diag(D[k, part]) + 1j * w * modal, into[:, part].T)
            H[k] += out[:, part] @ (coupled - into[:, part].T / D[k, part, None])
    H *= -(omega[:, None, None] ** 2)
    for sensor, factor in hidden.faults.items():
        H[:, names.index(sensor)] *= factor
    return H


def nominal_of(name, rng, sensors=SENSORS, excitations=EXCITATIONS, frequency=FREQUENCY):
    """Return what an analyst knows: a material 1.5 and 0.4 % off, and no hidden effect."""
    places = list(enumerate(sensors, start=1))
    return {
        "case": name,
        "structure": "A-frame tower, hollow-section legs and rings, two rod braces",
        "units": "SI (m, N, kg, s, Pa, Hz)",
        "material": {
            "name": "steel",
            "E": E * (1 + float(rng.choice([-1, 1])) * 0.015),
            "nu": NU,
            "rho": RHO * (1 + float(rng.choice([-1, 1])) * 0.004),
        },
        "points": {str(k): at(member, s).tolist() for k, (member, s) in places}
        | dict(zip(SUPPORTS, (p.tolist() for p in FEET), strict=True)),
        "members": [
            {"name": m, "end1": a.tolist(), "end2": b.tolist(), "section": section}
            for m, (section, a, b) in MEMBERS.items()
        ],
        "joints": "all connections welded (rigid), centre lines meet",
        "supports": [{"point": s, "fixed": "all six"} for s in SUPPORTS],
        "sensors": [
            {"name": f"{k}{d}", "node": k, "direction": d, "sign": 1, "member": member, "position": s}
            for k, (member, s) in places
            for d in AXES
        ],
        "excitations": [{"sensor": s} for s in excitations],
        "frequency": {"start": float(frequency[0]), "stop": float(frequency[-1]), "lines": len(frequency)},
        "response": "accelerance, (m/s^2)/N",
        "damping_guess_modal": 0.0051,
        "tolerances": "E +-2 %, rho +-0.5 %, joint data +-3 %, dimensions +-0.5 %",
        "files": ["frf.uff"],
    }  # fmt: skip


FOOT = named("support_flexibility", "110", "ry", value=3000.0, unit="N·m/rad")


def mass(member, size):
    """Return the words of a mass in the middle of a member."""
    length = length_of(member)
    return named("point_mass", member, value=size, unit="kg", position=0.5 * length, length=length)


def fault(sensor, factor):
    return {"type": "sensor_fault", "location": sensor, "magnitude": {"factor": factor}}


def end(member, k, *more):
    """Return the words of a member's end."""
    return "end", str(k), "of", member, *more


def released(member, axis, stiffness):
    words = end(member, 1, "bending", "about", "local", axis)
    return named("end_release", *words, value=1 / stiffness, unit="rad/(N·m)")


def notched(member, position, loss):
    kinds, length = ("stiffness_loss", "crack"), length_of(member)
    return named(kinds, member, value=loss, unit="-", position=position, length=length)


CASES = {
    "a-frame-nothing": (31, Hidden(), [NOTHING]),
    "a-frame-mass": (32, Hidden(masses=(("L1b", 0.5, 0.06),)), [mass("L1b", 0.06)]),
    "a-frame-stiffness": (
        33, Hidden(modulus={"R1_23": 1.07}), [named("member_stiffness", "R1_23", value=0.07, unit="-")],
    ),
    "a-frame-heavier": (
        34, Hidden(density={"R2_34": 1.08}), [named("member_density", "R2_34", value=0.08, unit="-")],
    ),
    "a-frame-foot": (35, Hidden(feet={("110", "ry"): 3000.0}), [FOOT]),
    "a-frame-ground-spring": (
        36, Hidden(springs=(("L3b", 1.0, "x", 2e4),)),
        [named("ground_spring", *end("L3b", 2, "x"), value=2e4, unit="N/m")],
    ),
    "a-frame-brace": (
        37, Hidden(tension={"B2": 1500.0}), [named("preload", "B2", value=1500.0, unit="N")],
    ),
    "a-frame-release": (38, Hidden(hinge=("R1_12", "ry", 800.0)), [released("R1_12", "y", 800.0)]),
    "a-frame-notch": (39, Hidden(notch=("L2b", 0.19, 0.21, 0.3)), [notched("L2b", 0.2, 0.7)]),
    "a-frame-damper": (
        40, Hidden(dampers=(("L2a", 1.0, "x", 8.0),)),
        [named("ground_damper", *end("L2a", 2, "x"), value=8.0, unit="N·s/m")],
    ),
    "a-frame-faults": (41, Hidden(faults={"12x": 0.8, "3y": -1.0}), [fault("12x", 0.8), fault("3y", -1.0)]),
    # the six that follow were first run when shear coefficients had become uncertain
    "a-frame-softer": (
        43, Hidden(modulus={"L4a": 0.94}), [named("member_stiffness", "L4a", value=-0.06, unit="-")],
    ),
    "a-frame-foot-again": (
        44, Hidden(feet={("130", "rx"): 4000.0}),
        [named("support_flexibility", "130", "rx", value=4000.0, unit="N·m/rad")],
    ),
    "a-frame-brace-mass": (45, Hidden(masses=(("B1", 0.5, 0.03),)), [mass("B1", 0.03)]),
    "a-frame-release-again": (46, Hidden(hinge=("R2_23", "rz", 400.0)), [released("R2_23", "z", 400.0)]),
    "a-frame-notch-again": (47, Hidden(notch=("R1_34", 0.1, 0.12, 0.25)), [notched("R1_34", 0.11, 0.75)]),
    "a-frame-fault-and-mass": (
        48, Hidden(masses=(("R2_41", 0.5, 0.05),), faults={"7y": 1.25}),
        [fault("7y", 1.25), mass("R2_41", 0.05)],
    ),
    "a-frame-two": (
        42, Hidden(masses=(("L1b", 0.5, 0.06),), feet={("110", "ry"): 3000.0}), [mass("L1b", 0.06), FOOT],
    ),
}  # fmt: skip


def write(folder, name):
    """Write a case and return its truth."""
    seed, hidden, effects = CASES[name]
    rng = np.random.default_rng(seed)
    nominal = nominal_of(name, rng)
    write_files(folder / name, nominal, FREQUENCY, with_noise(accelerances(hidden, nominal["sensors"]), rng))
    return {"code": "OpenSees", "effects": effects}


if __name__ == "__main__":
    write_cases(sys.argv[1:], CASES, write)
