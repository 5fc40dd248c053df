"""Make cases with a known hidden effect from bars of solid elements.

    python -m benchmarks.independent.solids FOLDER [NAME ...]

Bars, or frames of bars that are one body, are reduced to their modes and their responses to forces where
something is attached; joints, masses, springs and dampers are added to that exactly, line by line, and what
depends on amplitude by harmonic balance. Each case becomes a folder with nominal.json and frf.uff, as in
../shared/data/independent-cases, and all of them one truth.json. Structures and cases are in
solid_structures.toml and solid_cases.toml. It runs where scikit-fem and pyuff are installed (make peers), and
imports nothing of Dovetail.
"""

import sys
import tomllib
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from scipy.optimize import brentq

from benchmarks.independent.bodies import NU, PATCH, RHO, Bar, E, bar_alone, coupled, welded, zeta_of
from benchmarks.independent.casefiles import (
    AXES,
    DIRECTIONS,
    NOTHING,
    fault,
    named,
    with_noise,
    write_cases,
    write_files,
)

HERE = Path(__file__).parent
TRUE_JOINT = dict(zip(DIRECTIONS, (5e7, 5e7, 1e7, 3e3, 3e3, 5e3), strict=True))
JOINT_LOSS = 0.006
HELD = 1e11
"""Stiffness of a soft base in its other directions [N/m, N·m/rad]."""
LEVELS_N = {"frf.uff": 1.0, "frf_level2.uff": 20.0}
"""Amplitudes of the force where something depends on amplitude, by the file that they make [N]."""
N_MODES, N_MODES_WELDED = 60, 100
WELDED = (
    "all bar-to-bar connections welded (rigid); centre lines given; the clear length of a bar ends 10 mm "
    "from the centre line of the bar it meets (solid corner: usual practice is a rigid end zone of half of "
    "that, about 5 mm at every member end)"
)


@dataclass(frozen=True)
class Structure:
    """Bars, joints (name, bar, position, bar, position), and what is measured up to a frequency [Hz].

    Welded bars have no joints and are one body, which may be held at first ends of bars.
    """

    bars: dict
    joints: tuple
    sensors: tuple  # (bar, position [m], directions)
    excitations: tuple  # names of sensors
    stop: float
    held: tuple = ()
    step: float = 2.0
    damping: tuple = (0.003, 1700.0)  # of modes, and how its variation goes with frequency [-, Hz]
    clamped: float = 0.0  # joints hold patches of this reach as good as rigidly [m]
    disc: str = ""  # or flats that touch hold a disc of that radius on their faces, "mean" or "rigid"

    @property
    def welded(self):
        return not self.joints


@dataclass(frozen=True)
class Hidden:
    """What a case hides; everything is nominal unless it is named here.

    Bars, by name: ``E``, ``rho``, ``b`` and ``h`` are factors, ``loss`` loss factors beyond modal damping
    of bars that are not welded, and ``weaker`` is (from, to, factor of E) of a stretch.

    Places: ``masses``, ``ground``, ``dampers``, ``inertias`` and ``rotors`` are (bar, position, …) with a
    mass [kg]; a direction, a stiffness [N/m] and a loss factor; a direction and a dashpot to the ground
    [N·s/m]; a rotary inertia alike about all axes [kg·m²]; the axis of rotation, global, and the angular
    momentum about it [kg·m²/s]. What turns takes the mean motion of what lies within `PATCH` along the bar.
    ``bases`` are stiffnesses [N·m/rad, N/m] of held ends by (bar, direction), and ``base_dashpots`` dashpots
    [N·m·s/rad, N·s/m] beside them.

    Joints, by (joint, direction): ``joints`` are factors of stiffnesses, ``dashpots`` dampers [N·m·s/rad,
    N·s/m], ``zener`` the (r, τ [s]) of k (1 + r iωτ/(1 + iωτ)). ``couplings`` are the shares c of
    k_ij = c √(k_ii k_jj) by (joint, direction, direction). By joint: ``joint_masses`` are masses, half on
    each side [kg], and ``offsets`` where the springs act, from the middle [m]. ``nonlinear`` is one (joint,
    direction, law of `LAWS`, values of the law), beside the joint's spring.

    Faults of the measurement, by sensor: ``gains``, ``delays`` [s], ``tilts`` (towards a direction, angle
    [rad]) and ``places`` where a sensor truly is [m]; ``swaps`` are pairs of exchanged labels, and
    ``force_gains`` what the readings of excitations carry.
    """

    E: dict = field(default_factory=dict)
    rho: dict = field(default_factory=dict)
    b: dict = field(default_factory=dict)
    h: dict = field(default_factory=dict)
    loss: dict = field(default_factory=dict)
    weaker: dict = field(default_factory=dict)
    masses: tuple = ()
    ground: tuple = ()
    dampers: tuple = ()
    inertias: tuple = ()
    rotors: tuple = ()
    joints: dict = field(default_factory=dict)
    dashpots: dict = field(default_factory=dict)
    zener: dict = field(default_factory=dict)
    couplings: dict = field(default_factory=dict)
    joint_masses: dict = field(default_factory=dict)
    offsets: dict = field(default_factory=dict)
    nonlinear: tuple = ()
    bases: dict = field(default_factory=dict)
    base_dashpots: dict = field(default_factory=dict)
    gains: dict = field(default_factory=dict)
    delays: dict = field(default_factory=dict)
    tilts: dict = field(default_factory=dict)
    places: dict = field(default_factory=dict)
    swaps: tuple = ()
    force_gains: dict = field(default_factory=dict)

    @property
    def points(self):
        """Where something acts on displacements: (bar, position)."""
        return [(bar, s) for bar, s, *_ in (*self.masses, *self.ground, *self.dampers)]

    @property
    def turning(self):
        """Where something acts on rotations: (bar, position)."""
        return [(bar, s) for bar, s, *_ in (*self.inertias, *self.rotors)]

    def changed(self, name, bar):
        """Return a bar with the section that it truly has."""
        return replace(bar, b=bar.b * self.b.get(name, 1.0), h=bar.h * self.h.get(name, 1.0))


def as_written(value):
    """Return tuples for lists, and for keys of several words tuples of these."""
    if isinstance(value, list):
        return tuple(as_written(v) for v in value)
    if isinstance(value, dict):
        return {tuple(k.split()) if " " in k else k: as_written(v) for k, v in value.items()}
    return value


def read_structures():
    """Return the structures of solid_structures.toml by name."""
    out = {}
    for name, table in tomllib.loads((HERE / "solid_structures.toml").read_text(encoding="utf-8")).items():
        if "like" in table:
            out[name] = replace(out[table.pop("like")], **table)
            continue
        given = as_written(table)
        bars = {bar: Bar(**values) for bar, values in given.pop("bars").items()}
        out[name] = Structure(bars, given.pop("joints", ()), **given)
    return out


def read_cases():
    """Return the cases of solid_cases.toml: structure, seed, what is hidden, the truth's words."""
    out = {}
    for name, table in tomllib.loads((HERE / "solid_cases.toml").read_text(encoding="utf-8")).items():
        hidden = Hidden(**as_written(table.get("hidden", {})))
        out[name] = table["structure"], table["seed"], hidden, list(map(truth_of, table.get("effects", [])))
    return {name: (*case[:3], case[3] or [NOTHING]) for name, case in out.items()}


def truth_of(effect):
    """Return what truth.json says of an effect or of a sensor's fault."""
    if "sensor" in effect:
        return fault(effect["sensor"], **{k: v for k, v in effect.items() if k != "sensor"})
    rest = {k: v for k, v in effect.items() if k not in ("kind", "place")}
    return named(effect["kind"], *effect["place"].split(), **rest)


STRUCTURES = read_structures()
CASES = read_cases()


def disc_cuts(structure, name):
    """Return where a bar is cut besides, so that elements on discs are short [m]."""
    ends = [(bar, s) for _, bar1, s1, bar2, s2 in structure.joints for bar, s in ((bar1, s1), (bar2, s2))]
    marks = [s + r * structure.clamped for bar, s in ends if bar == name for r in (-1, -0.5, 0, 0.5, 1)]
    return marks if structure.disc else []


def sensors_of(structure):
    """Return sensors as nominal.json lists them; nodes are counted along each bar as they are named."""
    out, node = [], 0
    for bar in structure.bars:
        for n, (_, s, directions) in enumerate(p for p in structure.sensors if p[0] == bar):
            node += 1
            out += [
                {
                    "name": f"{bar}{n + 1}{d}",
                    "node": node,
                    "direction": d,
                    "sign": 1,
                    "member": bar,
                    "position": s,
                }
                for d in directions
            ]
    return out


def receptances(structure, hidden, frequency):
    """Return FRFs (n_freq, n_sensors, n_excitations) [m/N] without noise.

    The relative motion of what depends on amplitude, without it, is one more response and one more force.
    """
    sensors = sensors_of(structure)
    attached = {bar: {s["position"] for s in sensors if s["member"] == bar} for bar in structure.bars}
    for bar, s in hidden.points:
        attached[bar].add(s)
    for s in sensors:
        attached[s["member"]].add(hidden.places.get(s["name"], s["position"]))
    if structure.welded:
        bodies = [welded(structure, hidden)]
    else:
        bodies = [
            bar_alone(name, bar, hidden, disc_cuts(structure, name)) for name, bar in structure.bars.items()
        ]
    squares, more_loss, places, n = [], [], {}, 0
    for body in bodies:
        soft = {name for name, _ in hidden.bases}
        ends = {(name, s): body.point(name, s) for name in body.bars for s in sorted(attached[name])}
        discs = []
        for joint, bar1, s1, bar2, s2 in structure.joints:
            middle = 0.5 * (structure.bars[bar1].at(s1) + structure.bars[bar2].at(s2))
            about = middle + hidden.offsets.get(joint, np.zeros(3))
            for name, s in ((bar1, s1), (bar2, s2)):
                if name in body.bars:
                    disc = middle if structure.disc else None
                    ends[joint, name] = body.patch(name, s, about, structure.clamped or PATCH, disc)
                    if structure.disc == "rigid":
                        discs.append((body.near(name, s, structure.clamped, middle), middle))
                    if joint in hidden.joint_masses:
                        ends["mass", joint, name] = body.patch(name, s, middle, structure.clamped or PATCH)
        for name in sorted(soft):
            ends["base", name] = body.patch(name, 0.0, body.bars[name].at(0.0), reach=0.0)
        for name, s in hidden.turning:
            if name in body.bars:
                ends["turns", name, s] = body.patch(name, s, body.bars[name].at(s))
        T = body.hold(structure, soft, discs)
        ends = {key: T.T @ P for key, P in ends.items()}
        forces = np.hstack(list(ends.values()))
        n_modes = N_MODES_WELDED if structure.welded else N_MODES
        w2, V = body.reduced(forces, n_modes, free=not structure.held)
        places |= {key: (n, V.T @ P) for key, P in ends.items()}
        n += len(w2)
        squares.append(w2)
        more_loss.append(np.full(len(w2), 0.0 if structure.welded else hidden.loss.get(*body.bars, 0.0)))
    w2, more_loss = np.concatenate(squares), np.concatenate(more_loss)

    def whole(*place):
        start, P = places[place]
        out = np.zeros((n, P.shape[1]))
        out[start : start + len(P)] = P
        return out

    omega = 2 * np.pi * frequency
    apart = {joint: whole(joint, bar1) - whole(joint, bar2) for joint, bar1, _, bar2, _ in structure.joints}
    parts = [(apart[joint], joint_stiffness(joint, structure, hidden, omega)) for joint in apart]
    parts += attachments(structure, hidden, omega, whole)

    out = np.array([reading(s, hidden, whole) for s in sensors]).T
    stated = {s["name"]: whole(s["member"], s["position"])[:, AXES.index(s["direction"])] for s in sensors}
    inputs = np.array([stated[name] for name in structure.excitations]).T
    if hidden.nonlinear:
        joint, direction, *_ = hidden.nonlinear
        own = apart[joint][:, [DIRECTIONS.index(direction)]]
        out, inputs = np.hstack([out, own]), np.hstack([inputs, own])
    return coupled(w2, more_loss, zeta_of(structure.damping, w2), parts, out, inputs, omega)


def joint_stiffness(joint, structure, hidden, omega):
    """Return the dynamic stiffness (n_freq, 6, 6) of a joint."""
    known = [HELD if structure.clamped else TRUE_JOINT[d] for d in DIRECTIONS]
    k = np.array([v * hidden.joints.get((joint, d), 1.0) for v, d in zip(known, DIRECTIONS, strict=True)])
    K = np.diag(k)
    for (name, *pair), share in hidden.couplings.items():
        if name == joint:
            i, j = (DIRECTIONS.index(d) for d in pair)
            K[i, j] = K[j, i] = share * np.sqrt(k[i] * k[j])
    if np.linalg.eigvalsh(K / np.sqrt(np.outer(k, k)))[0] <= 0:
        msg = f"the stiffness of joint {joint} is not positive definite"
        raise ValueError(msg)
    Z = np.tile(K * (1 + 1j * JOINT_LOSS), (len(omega), 1, 1))
    for i, d in enumerate(DIRECTIONS):
        r, tau = hidden.zener.get((joint, d), (0.0, 1.0))
        Z[:, i, i] += 1j * omega * hidden.dashpots.get((joint, d), 0.0)
        Z[:, i, i] += k[i] * r * 1j * omega * tau / (1 + 1j * omega * tau)
    return Z


def attachments(structure, hidden, omega, whole):
    """Return what hangs on the structure beside joints: motions (n, m), dynamic stiffness (n_freq, m, m)."""
    one = np.ones((len(omega), 1, 1))
    w = omega[:, None, None]
    out = []
    for joint, bar1, _, bar2, _ in structure.joints:
        if joint in hidden.joint_masses:
            half = -(w**2) * 0.5 * hidden.joint_masses[joint] * np.eye(3)
            out += [(whole("mass", joint, bar)[:, :3], half) for bar in (bar1, bar2)]
    for bar, s, mass in hidden.masses:
        out.append((whole(bar, s), -(w**2) * mass * np.eye(3)))
    for bar, s, d, stiffness, loss in hidden.ground:
        out.append((whole(bar, s)[:, [AXES.index(d)]], stiffness * (1 + 1j * loss) * one))
    for bar, s, d, dashpot in hidden.dampers:
        out.append((whole(bar, s)[:, [AXES.index(d)]], 1j * w * dashpot))
    for bar, s, inertia in hidden.inertias:
        out.append((whole("turns", bar, s)[:, 3:], -(w**2) * inertia * np.eye(3)))
    for bar, s, axis, momentum in hidden.rotors:
        # the rotor takes the moment momentum · (rate of turn × axis), that by which its momentum changes
        gyroscopic = momentum * np.cross(np.eye(3), axis).T
        out.append((whole("turns", bar, s)[:, 3:], 1j * w * gyroscopic))
    for bar in sorted({name for name, _ in hidden.bases}):
        held = np.diag([hidden.bases.get((bar, d), HELD) for d in DIRECTIONS])
        dashpots = np.diag([hidden.base_dashpots.get((bar, d), 0.0) for d in DIRECTIONS])
        out.append((whole("base", bar), held * one + 1j * w * dashpots))
    return out


def reading(sensor, hidden, whole):
    """Return the motion (n,) that a sensor takes, where it truly is and in the direction that it has."""
    name = sensor["name"]
    motions = whole(sensor["member"], hidden.places.get(name, sensor["position"]))
    towards, angle = hidden.tilts.get(name, (sensor["direction"], 0.0))
    along, across = (motions[:, AXES.index(d)] for d in (sensor["direction"], towards))
    return along if angle == 0 else np.cos(angle) * along + np.sin(angle) * across


def gap(a, k, g):
    """Return the stiffness at amplitude a of a spring that acts beyond a gap g on either side."""
    x = np.minimum(g / a, 1.0)
    return k * (1 - 2 / np.pi * (np.arcsin(x) + x * np.sqrt(1 - x**2)))


LAWS = {
    "cubic": lambda a, k3: 0.75 * k3 * a**2,
    "friction": lambda a, F: 4j * F / (np.pi * a),
    "gap": gap,
}


def steady(R, law, force):
    """Return receptances at a level of force where one relative motion has a stiffness k(a).

    R is of :func:`receptances`. With h the motion by the force and g by a pair of forces at it, both without
    k, a |1 + k(a) g| = force |h|. Of several solutions the one is taken that goes on from the line before, as
    a slow sweep upwards does; without any the motion is held.
    """
    H, c, h, g = R[:, :-1, :-1], R[:, :-1, -1], R[:, -1, :-1], R[:, -1, -1]
    out = np.array(H)
    for j in range(h.shape[1]):
        before = None
        for k in range(len(h)):
            found = amplitudes(law, force * abs(h[k, j]), g[k])
            if found:
                a = min(found, key=lambda x: abs(np.log(x / before))) if before else found[0]
                q = law(a) / (1 + law(a) * g[k])
                before = a
            else:
                q, before = 1 / g[k], None
            out[k, :, j] -= c[k] * q * h[k, j]
    return out


def amplitudes(law, free, g):
    """Return the amplitudes of stable steady motions, the lowest first; ``free`` is that without k."""

    def excess(a):
        return a * abs(1 + law(a) * g) - free

    grid = free * np.geomspace(1e-6, 1e4, 4001)  # near a fold two solutions are close
    above = excess(grid) > 0
    return [brentq(excess, grid[i], grid[i + 1]) for i in np.flatnonzero(~above[:-1] & above[1:])]


def accelerances(R, structure, hidden, frequency, force=1.0):
    """Return FRFs [m/s²/N] without noise as the instruments read them, from receptances, at a level [N]."""
    if hidden.nonlinear:
        _, _, law, *values = hidden.nonlinear
        R = steady(R, lambda a: LAWS[law](a, *values), force)
    H = -((2 * np.pi * frequency[:, None, None]) ** 2) * R
    names = [s["name"] for s in sensors_of(structure)]
    for name, gain in hidden.gains.items():
        H[:, names.index(name)] *= gain
    for name, delay in hidden.delays.items():
        H[:, names.index(name)] *= np.exp(-2j * np.pi * frequency * delay)[:, None]
    for pair in hidden.swaps:
        i, j = (names.index(name) for name in pair)
        H[:, [i, j]] = H[:, [j, i]]
    for name, gain in hidden.force_gains.items():
        H[:, :, structure.excitations.index(name)] /= gain
    return H


def nominal_of(name, structure, frequency, rng):
    """Return what an analyst knows: a material 1.5 and 0.4 % off, joints up to 2 %, and no hidden effect."""
    sensors = sensors_of(structure)
    joints = []
    for joint, bar1, s1, bar2, s2 in structure.joints:
        middle = 0.5 * (structure.bars[bar1].at(s1) + structure.bars[bar2].at(s2))
        k = {f"k{d}": float(f"{v * (1 + 0.02 * rng.uniform(-1, 1)):.4g}") for d, v in TRUE_JOINT.items()}
        kind = f"elastic, 6 uncoupled springs in global directions, loss factor {JOINT_LOSS}"
        if structure.clamped:
            kind = f"rigid (bolt; clamped patch of {2000 * structure.clamped:g} mm, flats on each other)"
        joints.append(
            {"name": joint, "type": kind, "member1": bar1, "s1": s1, "member2": bar2, "s2": s2}
            | {"location": middle.tolist()}
            | ({} if structure.clamped else {"k": k})
        )
    return {
        "case": name,
        "structure": f"{len(structure.bars)} bars, "
        + (
            "welded"
            if structure.welded
            else f"{len(joints)} {'rigid' if structure.clamped else 'elastic'} joint(s)"
        )
        + (", clamped" if structure.held else ", free"),
        "units": "SI (m, N, kg, s, Pa, Hz)",
        "material": {
            "name": "steel",
            "E": E * (1 + float(rng.choice([-1, 1])) * 0.015),
            "nu": NU,
            "rho": RHO * (1 + float(rng.choice([-1, 1])) * 0.004),
        },
        "points": {str(s["node"]): structure.bars[s["member"]].at(s["position"]).tolist() for s in sensors}
        | {name: structure.bars[name].at(0.0).tolist() for name in structure.held},
        "members": [
            {
                "name": bar,
                "end1": b.at(0.0).tolist(),
                "end2": b.at(b.length).tolist(),
                "section": {"type": "rect", "b": b.b, "h": b.h, "h_direction": b.rotation[:, 2].tolist()},
            }
            for bar, b in structure.bars.items()
        ],
        "joints": WELDED if structure.welded else joints,
        "supports": [{"point": name, "fixed": "all six"} for name in structure.held] or "free-free",
        "sensors": sensors,
        "excitations": [{"sensor": s} for s in structure.excitations],
        "frequency": {"start": float(frequency[0]), "stop": float(frequency[-1]), "lines": len(frequency)},
        "response": "accelerance, (m/s^2)/N",
        "damping_guess_modal": round(0.87 * structure.damping[0], 4),
        "tolerances": "E +-2 %, rho +-0.5 %, joint data +-3 %, dimensions +-0.5 %",
        "files": ["frf.uff"],
    }


def write(folder, name):
    """Write a case and return its truth."""
    structure_name, seed, hidden, effects = CASES[name]
    structure, rng = STRUCTURES[structure_name], np.random.default_rng(seed)
    frequency = np.arange(structure.step, structure.stop + 1e-9, structure.step)
    R = receptances(structure, hidden, frequency)
    levels = LEVELS_N if hidden.nonlinear else {"frf.uff": 1.0}
    measured = {
        file: with_noise(accelerances(R, structure, hidden, frequency, force), rng)
        for file, force in levels.items()
    }
    nominal = nominal_of(name, structure, frequency, rng)
    seen = {"rotation": hidden.rotors, "elastomer": hidden.zener}
    if environment := [word for word, there in seen.items() if there]:
        nominal["environment"] = environment  # a tester sees what turns, and what is of rubber
    if hidden.nonlinear:
        nominal |= {"files": list(levels), "levels_N": levels}
        nominal["files_note"] = "the same channels and lines at the amplitudes of force of levels_N"
    for file, H in measured.items():
        write_files(folder / name, nominal, frequency, H, file)
    return {"code": "scikit-fem, quadratic hexahedra", "effects": effects}


if __name__ == "__main__":
    write_cases(sys.argv[1:], CASES, write)
