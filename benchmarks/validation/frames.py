"""Random frames as an analyst has them: members, joints, feet or cords, sensors and drive points."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

import fem
from benchmarks.validation.truth import Attached, Cut, Member, Reading, TrueFrame, TrueJoint, TrueSupport
from fem import DIRECTIONS, Environment, assemble
from updating import Sensor, place_sensors

Generator = np.random.Generator

MATERIALS = {"steel": (207e9, 0.3, 7850.0), "aluminium": (70e9, 0.33, 2700.0)}
"""Young's modulus [Pa], Poisson's ratio, density [kg/m³]."""
NOMINAL_RATIO = 0.003
"""Modal damping ratio of every model [-]."""
RIGID_JOINTS = 0.3
"""Share of joints that the model has rigid."""
FOOT_INWARDS = (0.03, 0.08)
"""Least and largest distance of an elastic foot from its member's end, in parts of its length [-]."""


@dataclass(frozen=True, slots=True, eq=False)
class Draft:
    """A frame with nominal parameters and its test."""

    family: str
    frame: TrueFrame  # with nominal parameters and without damping
    materials: dict[str, str]  # material of each member
    sensors: tuple[Reading, ...]  # drives are sensors too
    drives: tuple[Reading, ...]
    frequency: NDArray[np.float64]  # (n_freq,) [Hz]
    n_modes: int  # modes in the band, of the nominal model


Lines = dict[str, tuple[list[float], list[float]]]


@dataclass(frozen=True, slots=True, eq=False)
class _Outline:
    """Members' ends; joints as (first member, fraction, second member, fraction); feet as (member, end)."""

    lines: Lines
    joints: tuple[tuple[str, float, str, float], ...] = ()
    feet: tuple[tuple[str, int], ...] = ()


def _cross(rng: Generator) -> _Outline:
    a, b, gap = rng.uniform(0.5, 1.0), rng.uniform(0.4, 0.9), 0.02
    s, t = rng.uniform(0.3, 0.7, 2)
    lines: Lines = {"U": ([0, 0, gap], [a, 0, gap]), "D": ([s * a, -t * b, 0], [s * a, (1 - t) * b, 0])}
    return _Outline(lines, (("U", s, "D", t),))


def _lap(rng: Generator) -> _Outline:
    a, b, s = rng.uniform(0.5, 0.9), rng.uniform(0.3, 0.6), rng.uniform(0.25, 0.75)
    t = 0.02 / b
    lines: Lines = {"A": ([0, 0, 0], [a, 0, 0]), "B": ([s * a, -0.02, 0.012], [s * a, b - 0.02, 0.012])}
    return _Outline(lines, (("A", s, "B", t),))


def _angle(rng: Generator) -> _Outline:
    a, b, out = rng.uniform(0.3, 0.7), rng.uniform(0.3, 0.7), rng.uniform(0, 0.3)
    lines: Lines = {"post": ([0, 0, 0], [0, 0, a]), "arm": ([0, 0, a], [b, out, a])}
    return _Outline(lines, feet=(("post", 0),))


def _tee(rng: Generator) -> _Outline:
    a, b, s = rng.uniform(0.3, 0.7), rng.uniform(0.4, 0.9), rng.uniform(0.3, 0.6)
    lines: Lines = {
        "post": ([0, 0, 0], [0, 0, a]),
        "bar": ([-s * b, 0, a + 0.02], [(1 - s) * b, 0, a + 0.02]),
    }
    return _Outline(lines, (("post", 1.0, "bar", s),), (("post", 0),))


def _portal(rng: Generator) -> _Outline:
    w, h, h2 = rng.uniform(0.4, 0.8), rng.uniform(0.4, 0.7), rng.uniform(0.2, 0.4)
    lines: Lines = {
        "left": ([0, 0, 0], [0, 0, h]),
        "beam": ([0, 0, h], [w, 0, h]),
        "right": ([w, 0, 0], [w, 0, h]),
        "arm": ([w, 0, h], [w, h2, h]),
    }
    return _Outline(lines, feet=(("left", 0), ("right", 0)))


def _bolted_portal(rng: Generator) -> _Outline:
    w, h = rng.uniform(0.4, 0.8), rng.uniform(0.4, 0.7)
    lines: Lines = {
        "left": ([0, 0, 0], [0, 0, h]),
        "right": ([w, 0, 0], [w, 0, 1.1 * h]),
        "beam": ([0.015, 0.02, 0.95 * h], [w - 0.015, 0.02, 0.95 * h]),
    }
    return _Outline(
        lines, (("left", 0.95, "beam", 0.0), ("right", 0.95 / 1.1, "beam", 1.0)), (("left", 0), ("right", 0))
    )


def _bracket(rng: Generator) -> _Outline:
    a, b, c = rng.uniform(0.3, 0.6, 3)
    lines: Lines = {
        "post": ([0, 0, 0], [0, 0, c]),
        "armx": ([0, 0, c], [a, 0, c]),
        "army": ([0, 0, c], [0, b, c]),
        "tie": ([a, 0, c], [0, b, c]),
    }
    return _Outline(lines, feet=(("post", 0),))


def _ladder(rng: Generator) -> _Outline:
    a, b, w = rng.uniform(0.3, 0.5), rng.uniform(0.3, 0.5), rng.uniform(0.2, 0.4)
    x = [0.0, a, a + b]
    lines: Lines = {
        f"{side}{i + 1}": ([x[i], y, 0], [x[i + 1], y, 0])
        for side, y in (("A", 0.0), ("B", w))
        for i in (0, 1)
    }
    lines |= {f"R{i + 1}": ([x[i], 0, 0], [x[i], w, 0]) for i in range(3)}
    return _Outline(lines)


def _tower(rng: Generator) -> _Outline:
    w, d, h = rng.uniform(0.3, 0.6), rng.uniform(0.3, 0.6), rng.uniform(0.4, 0.8)
    foot = [(0, 0), (w, 0), (w, d), (0, d)]
    lines: Lines = {f"C{i + 1}": ([x, y, 0], [x, y, h]) for i, (x, y) in enumerate(foot)}
    lines |= {f"B{i + 1}": ([*foot[i], h], [*foot[(i + 1) % 4], h]) for i in range(4)}
    return _Outline(lines, feet=tuple((f"C{i + 1}", 0) for i in range(4)))


def _box(rng: Generator) -> _Outline:
    w, d, h = rng.uniform(0.3, 0.6, 3)
    foot = [(0, 0), (w, 0), (w, d), (0, d)]
    lines: Lines = {f"C{i + 1}": ([x, y, 0], [x, y, h]) for i, (x, y) in enumerate(foot)}
    for name, z in (("L", 0.0), ("U", h)):
        lines |= {f"{name}{i + 1}": ([*foot[i], z], [*foot[(i + 1) % 4], z]) for i in range(4)}
    return _Outline(lines)


FAMILIES: dict[str, Callable[[Generator], _Outline]] = {
    draw.__name__[1:]: draw
    for draw in (_cross, _lap, _angle, _tee, _portal, _bolted_portal, _bracket, _ladder, _tower, _box)
}
"""Functions that draw an outline, by name."""
SMALL = ("cross", "lap", "angle", "tee")
"""Families of two members."""


def draw_frame(rng: Generator, family: str) -> tuple[TrueFrame, dict[str, str]]:
    """Return a frame with nominal parameters, and each member's material."""
    outline = FAMILIES[family](rng)
    metal = str(rng.choice(list(MATERIALS)))
    materials = dict.fromkeys(outline.lines, metal)
    if outline.joints and rng.random() < 0.3:
        materials[outline.joints[-1][2]] = next(m for m in MATERIALS if m != metal)
    b, h = rng.uniform(0.02, 0.04), rng.uniform(0.008, 0.015)
    members = {}
    for name, (first, second) in outline.lines.items():
        E, nu, rho = MATERIALS[materials[name]]
        members[name] = Member(np.array(first, float), np.array(second, float), b, h, E, nu, rho, 0.0)
    joints = []
    for i, (m, s, n, t) in enumerate(outline.joints):
        first, second = Cut(m, s * members[m].length), Cut(n, t * members[n].length)
        location = (members[m].place(first.position) + members[n].place(second.position)) / 2
        k = _stiffnesses(rng, members[m])
        rigid = rng.random() < RIGID_JOINTS
        joints.append(
            TrueJoint(
                f"J{i + 1}", first, second, location, np.diag(0 * k if rigid else k), (bool(rigid),) * 6
            )
        )
    supports = tuple(
        TrueSupport(f"S{i + 1}", Cut(m, end * members[m].length)) for i, (m, end) in enumerate(outline.feet)
    )
    return TrueFrame(members, tuple(joints), supports), materials


def draw_sensors(rng: Generator, frame: TrueFrame) -> tuple[tuple[Reading, ...], tuple[Reading, ...]]:
    """Return sensors across the members, one- and three-axial, and drive points at some of them."""
    lengths = np.array([m.length for m in frame.members.values()])
    total = int(rng.integers(max(12, 2 * len(lengths)), 25))
    share = np.maximum(1, np.round(total * lengths / lengths.sum())).astype(int)
    triaxial = len(lengths) < 9 and rng.random() < 0.25
    sensors: list[Reading] = []
    for (name, member), n in zip(frame.members.items(), share, strict=True):
        n_places = max(1, n // 3) if triaxial else n
        edges = np.linspace(0.06, 0.98, n_places + 1)
        # Free of corners and of each other, but nowhere in particular.
        places = edges[:-1] + rng.uniform(0.15, 0.85, n_places) * np.diff(edges)
        for i, s in enumerate(places):
            at = Cut(name, float(np.round(s * member.length, 4)))
            across = [d for d in range(3) if abs(member.axes[0][d]) < 0.8]
            chosen = [0, 1, 2] if triaxial else [across[(i + rng.integers(2)) % len(across)]]
            for d in chosen:
                sensors.append(Reading(f"{name}{i + 1}{'xyz'[d]}", at, np.eye(3)[d]))
    lateral = [s for s in sensors if abs(frame.members[s.at.member].axes[0] @ s.direction) < 0.8]
    n_drives = int(rng.integers(1, 4))
    order = rng.permutation(len(lateral))
    drives: list[Reading] = []
    for k in order:
        if len(drives) == n_drives:
            break
        new_place = all(d.at != lateral[k].at for d in drives)
        new_kind = all(
            abs(d.direction @ lateral[k].direction) < 0.5 or d.at.member != lateral[k].at.member
            for d in drives
        )
        if new_place and new_kind:
            drives.append(lateral[k])
    return tuple(sensors), tuple(drives)


def build_model(
    frame: TrueFrame, materials: dict[str, str], sensors: tuple[Reading, ...], elements: int
) -> fem.Model:
    """Return the finite-element model that a user would make of a nominal frame, its springs as cords.

    Each member has about so many elements, short ones fewer.
    """
    points: list[list[float]] = []
    lines, sets = [], {}

    def point(place: NDArray[np.float64]) -> int:
        for i, p in enumerate(points):
            if np.abs(np.array(p) - place).max() < 1e-9:
                return i
        points.append(place.tolist())
        return len(points) - 1

    for i, (name, member) in enumerate(frame.members.items()):
        lines.append([point(member.first), point(member.second)])
        sets[name] = [i]
    mesh = fem.Mesh.from_lines(points, lines, sets)
    for j in frame.joints:
        for side, at in enumerate(j.cuts, start=1):
            mesh = mesh.with_point_on(at.member, at.position, f"{j.name}.{side}")
    for i, a in enumerate(frame.attached):
        mesh = mesh.with_point_on(a.at.member, a.at.position, f"cord{i + 1}")
    for s in frame.supports:
        if 0.0 < s.at.position < frame.members[s.at.member].length:
            mesh = mesh.with_point_on(s.at.member, s.at.position, s.name)
    mesh = place_sensors(mesh, sensors_of(frame, sensors))
    stuff = {}
    for name in dict.fromkeys(materials.values()):
        E, nu, rho = MATERIALS[name]
        stuff[name] = fem.Material(name, E, rho, nu)
    properties = {}
    for name, m in frame.members.items():
        key = (materials[name], m.b, m.h)
        properties.setdefault(
            key, fem.MemberProperties(stuff[materials[name]], fem.Section.rectangle(m.b, m.h))
        )
    effects: list[fem.Effect] = [
        fem.Frame(members={n: properties[materials[n], m.b, m.h] for n, m in frame.members.items()})
    ]
    for s in frame.supports:
        effects.append(fem.Support(name=s.name, point=mesh.nearest_point(frame.place(s.at))[0]))
    for j in frame.joints:
        ends = [mesh.point_names[f"{j.name}.{side}"] for side, _ in enumerate(j.cuts, start=1)]
        one, two = (*ends, None)[:2]
        assert one is not None
        rigid = DIRECTIONS if j.rigid[0] else ()
        effects.append(
            fem.Joint(name=j.name, point1=one, point2=two, location=j.location, K=j.K, rigid=rigid)
        )
    for i, a in enumerate(frame.attached):
        p = mesh.point_names[f"cord{i + 1}"]
        effects.append(fem.Joint(name=f"cord{i + 1}", point1=p, location=mesh.points[p], K=a.K))
    longest = max(m.length for m in frame.members.values())
    mesh = mesh.refined(size=min(longest / elements, min(m.length for m in frame.members.values()) / 8))
    # All kinds are hidden alike, so that every situation is stated.
    return fem.Model(
        mesh, tuple(effects), fem.Damping.modal(NOMINAL_RATIO), environment=frozenset(Environment)
    )


def sensors_of(frame: TrueFrame, readings: tuple[Reading, ...]) -> tuple[Sensor, ...]:
    """Return readings as the sensors of a measurement."""
    return tuple(Sensor(r.name, frame.place(r.at), r.direction, r.at.member) for r in readings)


def n_elements(frame: TrueFrame) -> int:
    """Return elements for each member: a user's usual number, fewer where there are many members."""
    return 40 if len(frame.members) <= 4 else 24


def _frequencies(frame: TrueFrame, materials: dict[str, str], number: int) -> NDArray[np.float64]:
    modes = fem.solve_modes(assemble(build_model(frame, materials, (), 10)), n=number)
    return modes.frequency[modes.frequency > 1.0]


def on_elastic_feet(rng: Generator, frame: TrueFrame) -> TrueFrame:
    """Return a frame whose clamps are elastic feet a little further along their members."""
    feet = []
    for n, s in enumerate(frame.supports, start=1):
        m = frame.members[s.at.member]
        inwards = rng.uniform(*FOOT_INWARDS) * m.length
        at = Cut(s.at.member, float(inwards if s.at.position == 0 else m.length - inwards))
        K = np.diag(_stiffnesses(rng, m))
        feet.append(TrueJoint(f"F{n}", at, None, m.place(at.position), K, (False,) * 6))
    return replace(frame, supports=(), joints=(*frame.joints, *feet))


def _stiffnesses(rng: Generator, member: Member) -> NDArray[np.float64]:
    """Return the six stiffnesses of a joint, some of EI/L³ and EI/L of a member [N/m, N·m/rad]."""
    EI, L = member.E * member.b * member.h**3 / 12, 0.7
    k = np.array([3e4] * 3 + [8.0] * 3) * EI / L ** np.array([3, 3, 3, 1, 1, 1])
    return k * rng.uniform(0.4, 2.0, 6)


def draw_draft(rng: Generator, family: str, small: bool = False, elastic_feet: bool = False) -> Draft:
    """Draw a frame, its test and its band; a small one has few modes and lines."""
    frame, materials = draw_frame(rng, family)
    if elastic_feet:
        frame = on_elastic_feet(rng, frame)
    n_modes = int(rng.integers(5, 8) if small else rng.integers(8, 26))
    f = _frequencies(frame, materials, n_modes + 8)
    if not frame.supports and all(j.second is not None for j in frame.joints):
        mass = sum(m.mass for m in frame.members.values())
        names = list(frame.members)
        n = 4
        cords = []
        for i in range(n):
            name = names[(i * max(1, len(names) // n)) % len(names)]
            position = (0.03, 0.94, 0.07, 0.9)[i] * frame.members[name].length
            k = mass * (2 * np.pi * f[0] / 15) ** 2 / n
            cords.append(Attached(Cut(name, position), K=np.diag([k, k, k, 0.0, 0.0, 0.0])))
        frame = replace(frame, attached=tuple(cords))
        f = _frequencies(frame, materials, n_modes + 14)
        f = f[f > 1.1 * float(np.max(f[:6]))] if f.size > 6 else f
    n_modes = min(n_modes, f.size - 2)
    low, high = 0.5 * f[0], float((f[n_modes - 1] + f[n_modes]) / 2)
    n_lines = int(rng.integers(200, 300) if small else rng.integers(500, 1201))
    frequency = np.linspace(low, high, n_lines)
    sensors, drives = draw_sensors(rng, frame)
    return Draft(family, frame, materials, sensors, drives, frequency, n_modes)


def perturbed(rng: Generator, draft: Draft, material: float, joint: float, damping: float) -> TrueFrame:
    """Return the frame as it really is: moduli, densities, joints and damping not as assumed.

    Half widths of uniform relative deviations of E and ρ, and of joint stiffnesses, are given; damping lies
    within a factor of the model's.
    """
    frame = draft.frame
    factor = {m: 1 + material * rng.uniform(-1, 1, 2) for m in dict.fromkeys(draft.materials.values())}
    rng.uniform()  # keeps the cases of a seed
    ratio = NOMINAL_RATIO * damping ** rng.uniform(-1, 1)
    share = rng.dirichlet([3.0, 1.0, 1.0])
    low, high = 2 * np.pi * draft.frequency[[0, -1]]
    middle = float(np.sqrt(low * high))
    loss = 2 * ratio * share[0]
    members = {
        name: replace(
            m,
            E=m.E * factor[draft.materials[name]][0],
            rho=m.rho * factor[draft.materials[name]][1],
            loss=loss * rng.uniform(0.9, 1.1),
        )
        for name, m in frame.members.items()
    }
    law = constant_loss(2 * ratio)
    joints = tuple(
        replace(j, K=j.K * np.diag(1 + joint * rng.uniform(-1, 1, 6)), law=law) for j in frame.joints
    )
    alpha, beta = 2 * ratio * share[1] * middle, 2 * ratio * share[2] / middle
    return replace(frame, members=members, joints=joints, alpha=alpha, beta=beta)


def constant_loss(eta: float) -> Callable[[NDArray[np.float64]], NDArray[np.complex128]]:
    """Return the law 1 + iη."""
    return lambda omega: np.full(omega.size, 1 + 1j * eta)
