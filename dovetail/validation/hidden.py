"""The kinds of effects and faults that may be hidden in a truth, and what a diagnosis should call them.

`KINDS` is the table of all of them. Each kind draws a place on a frame and says how an amplitude changes
the truth; the amplitude is proportional to what the effect does as long as it is weak.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.validation.frames import Draft, Generator, constant_loss
from dovetail.validation.spectral import Law
from dovetail.validation.truth import (
    Attached,
    Cut,
    EndSpring,
    Member,
    Reading,
    Stretch,
    TrueFrame,
    rectangle_constants,
    rigid_body,
)
from fem.model import DIRECTIONS

NEAR = 0.05
"""A place is right within this part of the member's length [-]."""

Readings = tuple[Reading, ...]
Matrix = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Place:
    """Where something is hidden; what is None or empty need not agree.

    Attributes
    ----------
    words : str
    member : str or None
    xyz : ndarray (3,) or None
        [m].
    tolerance : float
        How far from there a found effect may lie [m].
    joint, direction, support : str or None
    pair : tuple of str
        Two directions that are coupled.
    of_member : bool
        Whether an effect at a corner must be of the very member.
    sensors : tuple of str
        Of faults.
    turns : tuple of (str, str)
        Members and local directions of which one must agree, as one rotation at a corner has several names.
    """

    words: str
    member: str | None = None
    xyz: NDArray[np.float64] | None = None
    tolerance: float = 0.0
    joint: str | None = None
    direction: str | None = None
    support: str | None = None
    pair: tuple[str, ...] = ()
    of_member: bool = False
    sensors: tuple[str, ...] = ()
    turns: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Hidden:
    """An effect at a place, its strength still open.

    Attributes
    ----------
    kind : str
    place : Place
    bounds : (float, float)
        Least and largest amplitude.
    change : callable
        From the true frame and the amplitude to the frame with the effect.
    values : callable
        From the amplitude to parameters as the candidates name them; only those that can be compared.
    readings : callable or None
        From the sensors to the places and directions where they really are.
    data : callable or None
        From frequencies (n_freq,), exact FRFs (n_freq, n_out, n_in) and the amplitude to what is recorded.
    """

    kind: str
    place: Place
    bounds: tuple[float, float]
    change: Callable[[TrueFrame, float], TrueFrame] = lambda frame, a: frame
    values: Callable[[float], dict[str, float]] = lambda a: {}
    readings: Callable[[Readings, float], Readings] | None = None
    data: Callable[[NDArray[np.float64], NDArray[Any], float], NDArray[Any]] | None = None


Draw = Callable[[Generator, Draft, TrueFrame], Hidden | None]


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of effect or fault.

    Attributes
    ----------
    name : str
    found_as : tuple of str
        Kinds of candidates (of faults, for faults) that are the right answer. The program may not know any
        of them yet.
    draw : callable
        Gives a place, or None if the frame has none.
    fault : bool
        True for faults of the measurement.
    """

    name: str
    found_as: tuple[str, ...]
    draw: Draw = field(repr=False)
    fault: bool = False


# --------------------------------------------------------------------------------------------- helpers


def _member(rng: Generator, draft: Draft) -> tuple[str, Member]:
    name = str(rng.choice(list(draft.frame.members)))
    return name, draft.frame.members[name]


def _bending(m: Member) -> tuple[float, float]:
    """Return E Iy and E Iz of the nominal member [N·m²]."""
    _, Iy, Iz, _ = rectangle_constants(m.b, m.h)
    return m.E * Iy, m.E * Iz


def _on(draft: Draft, name: str, position: float) -> Place:
    m = draft.frame.members[name]
    return Place(f"member {name} at {position:.3f} m", name, m.place(position), NEAR * m.length)


def _whole(name: str) -> Place:
    return Place(f"member {name}", name)


def _spot(rng: Generator, draft: Draft) -> tuple[str, Member, float]:
    name, m = _member(rng, draft)
    return name, m, float(rng.uniform(0.06, 0.94) * m.length)


def _end_or_joint(rng: Generator, draft: Draft) -> tuple[str, Member, float]:
    """Return a member's end that is no foot, or a joint's place: where things are fastened."""
    feet = [s.at for s in draft.frame.supports]
    places = [Cut(name, x) for name, m in draft.frame.members.items() for x in (0.0, m.length)]
    places += [c for j in draft.frame.joints for c in (j.first, j.second)]
    free = [p for p in places if p not in feet]
    at = free[int(rng.integers(len(free)))]
    return at.member, draft.frame.members[at.member], at.position


def _joint(rng: Generator, draft: Draft, elastic: bool = False) -> int | None:
    allowed = [i for i, j in enumerate(draft.frame.joints) if not (elastic and j.rigid[0])]
    return int(rng.choice(allowed)) if allowed else None


def _middle(draft: Draft) -> float:
    """Return the middle of the band, geometric [rad/s]."""
    return float(2 * np.pi * np.sqrt(draft.frequency[0] * draft.frequency[-1]))


def _one(d: int, value: float) -> Matrix:
    out = np.zeros((6, 6))
    out[d, d] = value
    return out


def _soft(draft: Draft, member: str, d: int) -> float:
    """Return a stiffness that a member feels in a direction, for scale [N/m or N·m/rad]."""
    m = draft.frame.members[member]
    EI = min(_bending(m))
    return 300 * EI / m.length if d > 2 else 1e5 * EI / m.length**3


def _times(law: Law | None, other: Law) -> Law:
    return other if law is None else lambda omega: law(omega) * other(omega)


# ---------------------------------------------------------------------------------------------- joints


def _joint_stiffness(directions: range) -> Draw:
    def draw(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
        i = _joint(rng, draft)
        if i is None:
            return None
        d, j = int(rng.choice(directions)), truth.joints[i]

        def stiffness(a: float) -> float:
            return _soft(draft, j.first.member, d) / a if j.rigid[d] else float(j.K[d, d]) / (1 + a)

        def change(frame: TrueFrame, a: float) -> TrueFrame:
            own = next(x for x in frame.joints if x.name == j.name)
            K = own.K.copy()
            K[d, d] = stiffness(a)
            return frame.with_joint(j.name, K=K, rigid=tuple(r and k != d for k, r in enumerate(own.rigid)))

        place = Place(f"joint {j.name}, {DIRECTIONS[d]}", joint=j.name, direction=DIRECTIONS[d])
        bounds = (0.03, 1e6) if j.rigid[d] else (0.1, 1e4)
        return Hidden("", place, bounds, change, lambda a: {"stiffness": stiffness(a)})

    return draw


def _joint_coupled(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
    i = _joint(rng, draft, elastic=True)
    if i is None:
        return None
    j = truth.joints[i]
    d, e = [(1, 5), (2, 4), (0, 4), (2, 3), (1, 3), (0, 5)][int(rng.integers(6))]
    full = float(np.sqrt(j.K[d, d] * j.K[e, e])) * float(rng.choice([-1, 1]))

    def change(frame: TrueFrame, a: float) -> TrueFrame:
        K = next(x for x in frame.joints if x.name == j.name).K.copy()
        K[d, e] = K[e, d] = a * full
        return frame.with_joint(j.name, K=K)

    place = Place(
        f"joint {j.name}, {DIRECTIONS[d]} with {DIRECTIONS[e]}",
        joint=j.name,
        pair=(DIRECTIONS[d], DIRECTIONS[e]),
    )
    sign = float(np.sign(full))
    return Hidden("", place, (0.01, 0.9), change, lambda a: {"coupling": sign * a})


def _joint_body(rotary: bool) -> Draw:
    def draw(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
        i = _joint(rng, draft)
        if i is None:
            return None
        j = truth.joints[i]
        m = draft.frame.members[j.first.member]
        unit = m.mass * m.length**2 / 12 if rotary else m.mass

        def change(frame: TrueFrame, a: float) -> TrueFrame:
            return frame.with_joint(j.name, M=rigid_body(0.0, a * unit) if rotary else rigid_body(a * unit))

        name = "inertia" if rotary else "mass"
        return Hidden(
            "", Place(f"joint {j.name}", joint=j.name), (1e-4, 1.0), change, lambda a: {name: a * unit}
        )

    return draw


def _joint_viscous(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
    i = _joint(rng, draft, elastic=True)
    if i is None:
        return None
    j, d = truth.joints[i], int(rng.integers(6))
    unit = float(j.K[d, d]) / _middle(draft)
    place = Place(f"joint {j.name}, {DIRECTIONS[d]}", joint=j.name, direction=DIRECTIONS[d])
    return Hidden(
        "",
        place,
        (1e-3, 10.0),
        lambda frame, a: frame.with_joint(j.name, C=_one(d, a * unit)),
        lambda a: {"damping": a * unit},
    )


def _joint_law(
    law: Callable[[float, float], Law], values: Callable[[float, float], dict[str, float]]
) -> Draw:
    def draw(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
        i = _joint(rng, draft, elastic=True)
        if i is None:
            return None
        j, tau = truth.joints[i], float(1 / _middle(draft) * rng.uniform(0.7, 1.4))
        return Hidden(
            "",
            Place(f"joint {j.name}", joint=j.name),
            (1e-2, 3.0),
            lambda frame, a: frame.with_joint(j.name, law=_times(j.law, law(a, tau))),
            lambda a: values(a, tau),
        )

    return draw


def _in_one_direction(
    law: Callable[[float, float], Law], values: Callable[[float, float], dict[str, float]]
) -> Draw:
    def draw(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
        i = _joint(rng, draft, elastic=True)
        if i is None:
            return None
        j, d, tau = truth.joints[i], int(rng.integers(6)), float(rng.uniform(0.7, 1.4) / _middle(draft))

        def own(a: float) -> Law:
            base, extra = j.law, law(a, tau)

            def factors(omega: NDArray[np.float64]) -> NDArray[np.complex128]:
                out = np.ones((omega.size, 6), dtype=complex)
                out[:, d] = extra(omega)
                return out if base is None else out * base(omega)[:, None]

            return factors

        place = Place(f"joint {j.name}, {DIRECTIONS[d]}", joint=j.name, direction=DIRECTIONS[d])
        return Hidden(
            "",
            place,
            (1e-2, 10.0),
            lambda frame, a: frame.with_joint(j.name, law=own(a)),
            lambda a: values(a, tau),
        )

    return draw


def _zener(a: float, tau: float) -> Law:
    return lambda omega: 1 + a * 1j * omega * tau / (1 + 1j * omega * tau)


def _fractional(a: float, tau: float) -> Law:
    return lambda omega: 1 + a * np.sqrt(1j * omega * tau)


def _fractional_values(a: float, tau: float) -> dict[str, float]:
    """Return the strength at 100 Hz, as candidates state it, and the exponent."""
    return {"strength": float(a * np.sqrt(2 * np.pi * 100 * tau)), "exponent": 0.5}


def _joint_offset(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
    i = _joint(rng, draft, elastic=True)
    if i is None:
        return None
    j, d = truth.joints[i], int(rng.integers(3))
    arm = np.eye(3)[d] * draft.frame.members[j.first.member].length * float(rng.choice([-1, 1]))
    return Hidden(
        "",
        Place(f"joint {j.name}, along {DIRECTIONS[d]}", joint=j.name, direction=DIRECTIONS[d]),
        (2e-3, 0.15),
        lambda frame, a: frame.with_joint(j.name, location=j.location + a * arm),
        lambda a: {"offset": a * float(arm[d])},
    )


# --------------------------------------------------------------------------------------------- members


def _factor(attribute: str, largest: float, direction: str | None = None) -> Draw:
    def draw(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
        if len(draft.frame.members) < 2:
            return None
        name, m = _member(rng, draft)
        sign = float(rng.choice([-1, 1]))
        top = largest if sign < 0 else 2 * largest
        # Candidates state the change in parts of the nominal value.
        ratio = float(getattr(truth.members[name], attribute) / getattr(m, attribute))
        return Hidden(
            "",
            replace(_whole(name), direction=direction),
            (0.01, top),
            lambda frame, a: frame.with_member(
                name, **{attribute: getattr(frame.members[name], attribute) * (1 + sign * a)}
            ),
            lambda a: {"change": sign * a * ratio},
        )

    return draw


def _preload(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
    if len(draft.frame.members) < 2:
        return None
    name, m = _member(rng, draft)
    euler = float(np.pi**2 * min(_bending(m)) / m.length**2)
    sign = float(rng.choice([-1, 1]))
    return Hidden(
        "",
        _whole(name),
        (0.02, 0.6 if sign < 0 else 30.0),
        lambda frame, a: frame.with_member(name, tension=sign * a * euler),
        lambda a: {"tension": sign * a * euler},
    )


def _crack(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
    name, m, x = _spot(rng, draft)
    d = int(rng.choice([4, 5]))
    EI, height = (_bending(m)[0], m.h) if d == 4 else (_bending(m)[1], m.b)
    return Hidden(
        "",
        replace(_on(draft, name, x), direction=DIRECTIONS[d]),
        (0.05, 300.0),
        lambda frame, a: frame.with_member(name, springs=(EndSpring(x, d, EI / height / a),)),
        lambda a: {"position": x, "compliance": a * height / EI},
    )


def _stiffness_loss(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
    name, m = _member(rng, draft)
    half = float(rng.uniform(0.04, 0.06)) * m.length
    x = float(rng.uniform(half + 0.02 * m.length, 0.98 * m.length - half))
    return Hidden(
        "",
        _on(draft, name, x),
        (0.03, 30.0),
        lambda frame, a: frame.with_member(name, stretches=(Stretch(x - half, x + half, E=1 / (1 + a)),)),
        lambda a: {"position": x},
    )


def _end_release(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
    ends: dict[tuple[float, ...], int] = {}
    for m in draft.frame.members.values():
        for p in (m.first, m.second):
            ends[tuple(np.round(p, 6))] = ends.get(tuple(np.round(p, 6)), 0) + 1
    shared = [
        (name, end)
        for name, m in draft.frame.members.items()
        for end, p in ((0.0, m.first), (m.length, m.second))
        if ends[tuple(np.round(p, 6))] > 1
    ]
    if not shared:
        return None
    name, x = shared[int(rng.integers(len(shared)))]
    m, d = draft.frame.members[name], int(rng.choice([4, 5]))
    k = 4 * _bending(m)[d - 4] / m.length
    # Where two members meet, the bending of one may be the torsion of the other.
    corner = m.place(x)
    meeting = [
        n
        for n, o in draft.frame.members.items()
        if n == name or min(np.linalg.norm(corner - p) for p in (o.first, o.second)) < 1e-6
    ]
    turns = [
        (n, DIRECTIONS[3 + i])
        for n in (meeting if len(meeting) == 2 else [name])
        for i, axis in enumerate(draft.frame.members[n].axes)
        if abs(axis @ m.axes[d - 3]) > 1 - 1e-6
    ]
    return Hidden(
        "",
        replace(
            _on(draft, name, x),
            words=f"member {name}, {'first' if x == 0 else 'second'} end",
            turns=tuple(turns),
            of_member=len(meeting) > 2,
        ),
        (0.01, 1e4),
        lambda frame, a: frame.with_member(name, springs=(EndSpring(x, d, k / a),)),
        lambda a: {"compliance": a / k},
    )


def _distributed_mass(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
    name, m = _member(rng, draft)
    part = float(rng.uniform(0.3, 0.6)) * m.length
    start = float(rng.uniform(0, m.length - part))
    line = m.mass / m.length
    return Hidden(
        "",
        replace(_on(draft, name, start + part / 2), tolerance=4 * NEAR * m.length),
        (0.01, 2.0),
        lambda frame, a: frame.with_member(name, stretches=(Stretch(start, start + part, mass=a * line),)),
        lambda a: {"mass": a * line, "position": start + part / 2, "width": part},
    )


def _fluid(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
    name, m = _member(rng, draft)
    along_z, line = bool(rng.integers(2)), m.mass / m.length
    return Hidden(
        "",
        replace(_whole(name), direction="z" if along_z else "y"),
        (0.01, 2.0),
        lambda frame, a: frame.with_member(name, fluid=(0.0, a * line) if along_z else (a * line, 0.0)),
        lambda a: {"mass": a * line},
    )


def _rigid_zone(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
    taken = {(c.member, round(c.position, 9)) for j in draft.frame.joints for c in (j.first, j.second)}
    ends = [
        (name, end)
        for name, m in draft.frame.members.items()
        for end in (0.0, m.length)
        if any(
            np.allclose(p, m.place(end))
            for other, o in draft.frame.members.items()
            if other != name
            for p in (o.first, o.second)
        )
        or any(s.at.member == name and abs(s.at.position - end) < 1e-9 for s in draft.frame.supports)
        or (name, round(end, 9)) in taken
    ]
    ends = [e for e in ends if not any(c[0] == e[0] and 0 < abs(c[1] - e[1]) < 0.3 for c in taken)]
    if not ends:
        return None
    name, x = ends[int(rng.integers(len(ends)))]
    m = draft.frame.members[name]
    first = min((abs(r.at.position - x) for r in (*draft.drives,) if r.at.member == name), default=m.length)
    cords = [abs(a.at.position - x) for a in draft.frame.attached if a.at.member == name]
    largest = min(0.25, 0.95 * min([first, *cords]) / m.length)
    if largest < 0.02:
        return None
    key = "zone1" if x == 0 else "zone2"
    return Hidden(
        "",
        replace(
            _on(draft, name, x),
            words=f"member {name}, {'first' if x == 0 else 'second'} end",
            of_member=True,
        ),
        (0.004, largest),
        lambda frame, a: frame.with_member(name, **{key: a * m.length}),
        lambda a: {"length": a * m.length},
    )


def _member_loss(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
    name, m = _member(rng, draft)
    return Hidden(
        "",
        _whole(name),
        (2e-3, 0.5),
        lambda frame, a: frame.with_member(name, stretches=(Stretch(0.0, m.length, loss=a),)),
        lambda a: {"loss_factor": a},
    )


# ---------------------------------------------------------------------------------------------- points


def _point_body(rotary: bool) -> Draw:
    def draw(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
        name, m, x = _spot(rng, draft)
        unit = m.mass * m.length**2 / 12 if rotary else m.mass
        key = "inertia" if rotary else "mass"
        return Hidden(
            "",
            _on(draft, name, x),
            (1e-4, 1.0),
            lambda frame, a: frame.with_attached(
                Attached(Cut(name, x), M=rigid_body(0.0, a * unit) if rotary else rigid_body(a * unit))
            ),
            lambda a: {key: a * unit, "position": x},
        )

    return draw


def _to_ground(damper: bool) -> Draw:
    def draw(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
        name, m, x = _end_or_joint(rng, draft)
        d = int(rng.choice([k for k in range(3) if abs(m.axes[0][k]) < 0.8]))
        k = 48 * min(_bending(m)) / m.length**3
        unit = k / _middle(draft) if damper else k

        def change(frame: TrueFrame, a: float) -> TrueFrame:
            matrix = _one(d, a * unit)
            at = Cut(name, x)
            return frame.with_attached(Attached(at, C=matrix) if damper else Attached(at, K=matrix))

        return Hidden(
            "",
            replace(_on(draft, name, x), direction=DIRECTIONS[d]),
            (1e-3, 300.0),
            change,
            lambda a: {"damping" if damper else "stiffness": a * unit, "position": x},
        )

    return draw


def _driver_mass(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
    at = draft.drives[0].at
    unit = draft.frame.members[at.member].mass
    return Hidden(
        "",
        _on(draft, at.member, at.position),
        (1e-4, 1.0),
        lambda frame, a: frame.with_attached(Attached(at, M=rigid_body(a * unit))),
        lambda a: {"mass": a * unit},
    )


def _stinger(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
    drive = draft.drives[0]
    m = draft.frame.members[drive.at.member]
    unit = 48 * min(_bending(m)) / m.length**3
    across = np.zeros((6, 6))
    across[:3, :3] = np.eye(3) - np.outer(drive.direction, drive.direction)
    return Hidden(
        "",
        _on(draft, drive.at.member, drive.at.position),
        (1e-3, 100.0),
        lambda frame, a: frame.with_attached(Attached(drive.at, K=a * unit * across)),
        lambda a: {"stiffness": a * unit},
    )


def _sensor_masses(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
    places = list(dict.fromkeys(s.at for s in draft.sensors))
    unit = sum(m.mass for m in draft.frame.members.values()) / len(places)
    return Hidden(
        "",
        Place("all sensors"),
        (1e-4, 0.5),
        lambda frame, a: frame.with_attached(*(Attached(p, M=rigid_body(a * unit)) for p in places)),
        lambda a: {"mass": a * unit},
    )


def _gyroscopic(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
    name, m, x = _end_or_joint(rng, draft)
    axis = m.axes[int(rng.integers(3))]
    unit = m.mass * m.length**2 / 12 * _middle(draft)
    C = np.zeros((6, 6))
    C[3:, 3:] = unit * np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return Hidden(
        "",
        _on(draft, name, x),
        (1e-4, 1.0),
        lambda frame, a: frame.with_attached(Attached(Cut(name, x), C=a * C)),
        lambda a: {"momentum": -a * unit},  # the moment of a rotor is dθ/dt × h, so that C = -h S(axis)
    )


# -------------------------------------------------------------------------------------------- supports


def _support(directions: range, damped: bool = False) -> Draw:
    def draw(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
        if not draft.frame.supports:
            return None
        s = draft.frame.supports[int(rng.integers(len(draft.frame.supports)))]
        d = int(rng.choice(directions))
        unit = _soft(draft, s.at.member, d)
        rigid = tuple(k != d for k in range(6))

        def change(frame: TrueFrame, a: float) -> TrueFrame:
            C = _one(d, 0.3 * unit / a / _middle(draft) if damped else 0.0)
            return frame.with_support(s.name, rigid=rigid, K=_one(d, unit / a), C=C)

        place = Place(f"support {s.name}, {DIRECTIONS[d]}", support=s.name, direction=DIRECTIONS[d])
        values = {"tau": 0.3 / _middle(draft)} if damped else {}
        return Hidden("", place, (0.1, 1e6), change, lambda a: {"stiffness": unit / a, **values})

    return draw


# ---------------------------------------------------------------------------------------------- faults


def _sensor(rng: Generator, draft: Draft) -> tuple[int, Reading]:
    i = int(rng.integers(len(draft.sensors)))
    return i, draft.sensors[i]


def _of(*readings: Reading) -> Place:
    names = tuple(r.name for r in readings)
    return Place(f"sensor {' and '.join(names)}", sensors=names)


def _gain(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
    i, sensor = _sensor(rng, draft)
    sign = float(rng.choice([-1, 1]))
    factor = np.ones(len(draft.sensors))

    def data(f: NDArray[np.float64], H: NDArray[Any], a: float) -> NDArray[Any]:
        factor[i] = 1 + sign * a
        return H * factor[:, None]

    return Hidden("", _of(sensor), (0.1, 0.4), values=lambda a: {"value": 1 + sign * a}, data=data)


def _sign(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
    i, sensor = _sensor(rng, draft)
    factor = np.where(np.arange(len(draft.sensors)) == i, -1.0, 1.0)
    return Hidden("", _of(sensor), (1.0, 1.0), data=lambda f, H, a: H * factor[:, None])


def _swap(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
    i, j = (int(k) for k in rng.choice(len(draft.sensors), 2, replace=False))
    order = np.arange(len(draft.sensors))
    order[[i, j]] = order[[j, i]]
    return Hidden("", _of(draft.sensors[i], draft.sensors[j]), (1.0, 1.0), data=lambda f, H, a: H[:, order])


def _delay(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
    i, sensor = _sensor(rng, draft)
    unit = 1 / (2 * np.pi * draft.frequency[-1])

    def data(f: NDArray[np.float64], H: NDArray[Any], a: float) -> NDArray[Any]:
        phase = np.exp(-2j * np.pi * f * a * unit)
        return np.where((np.arange(H.shape[1]) == i)[:, None], H * phase[:, None, None], H)

    return Hidden("", _of(sensor), (0.3, 1.5), values=lambda a: {"value": a * unit}, data=data)


def _moved(rng: Generator, draft: Draft, turn: bool) -> Hidden:
    i, sensor = _sensor(rng, draft)
    axes = draft.frame.members[sensor.at.member].axes
    L = draft.frame.members[sensor.at.member].length
    side = np.cross(sensor.direction, axes[int(rng.integers(3))])
    if np.linalg.norm(side) < 0.3:
        side = np.cross(sensor.direction, axes[0] + axes[1])
    side /= np.linalg.norm(side)
    back = -1.0 if sensor.at.position > L / 2 else 1.0

    def readings(sensors: Readings, a: float) -> Readings:
        if turn:
            other = replace(sensor, direction=np.cos(a) * sensor.direction + np.sin(a) * side)
        else:
            other = replace(sensor, at=Cut(sensor.at.member, sensor.at.position + back * a * L))
        return tuple(other if k == i else s for k, s in enumerate(sensors))

    bounds = (np.radians(10), np.radians(35)) if turn else (0.03, 0.1)
    return Hidden("", _of(sensor), bounds, readings=readings)


KINDS: dict[str, Kind] = {
    kind.name: kind
    for kind in (
        Kind("joint_translation", ("joint_stiffness",), _joint_stiffness(range(3))),
        Kind("joint_rotation", ("joint_stiffness",), _joint_stiffness(range(3, 6))),
        Kind("joint_coupled", ("joint_coupling",), _joint_coupled),
        Kind("joint_mass", ("joint_mass",), _joint_body(rotary=False)),
        Kind("joint_inertia", ("joint_inertia",), _joint_body(rotary=True)),
        Kind("joint_viscous", ("joint_viscous_damping",), _joint_viscous),
        Kind(
            "joint_structural",
            ("joint_structural_damping",),
            _joint_law(lambda a, tau: constant_loss(a), lambda a, tau: {"loss_factor": a}),
        ),
        Kind(
            "joint_zener",
            ("joint_zener",),
            _in_one_direction(_zener, lambda a, tau: {"ratio": a, "tau": tau}),
        ),
        Kind(
            "joint_fractional",
            ("joint_fractional",),
            _in_one_direction(_fractional, _fractional_values),
        ),
        Kind("joint_offset", ("joint_offset",), _joint_offset),
        Kind("member_stiffness", ("member_stiffness",), _factor("E", 0.5)),
        Kind("member_density", ("member_density",), _factor("rho", 0.5)),
        Kind("member_thickness", ("member_section",), _factor("h", 0.4, "z")),
        Kind("member_torsion", ("member_torsion",), _factor("torsion", 0.8)),
        Kind("preload", ("preload",), _preload),
        Kind("crack", ("crack",), _crack),
        Kind("stiffness_loss", ("stiffness_loss",), _stiffness_loss),
        Kind("end_release", ("end_release",), _end_release),
        Kind("distributed_mass", ("distributed_mass",), _distributed_mass),
        Kind("fluid_mass", ("fluid_added_mass",), _fluid),
        Kind("rigid_end", ("rigid_end_zone",), _rigid_zone),
        Kind("member_loss", ("member_damping",), _member_loss),
        Kind("point_mass", ("point_mass",), _point_body(rotary=False)),
        Kind("point_inertia", ("point_inertia",), _point_body(rotary=True)),
        Kind("ground_spring", ("ground_spring", "side_spring"), _to_ground(damper=False)),
        Kind("ground_damper", ("ground_damper",), _to_ground(damper=True)),
        Kind("driver_mass", ("driver_mass", "point_mass"), _driver_mass),
        Kind("stinger", ("stinger",), _stinger),
        Kind("sensor_masses", ("sensor_mass",), _sensor_masses),
        Kind("gyroscopic", ("rotor",), _gyroscopic),
        Kind("support_translation", ("support_flexibility",), _support(range(3))),
        Kind("support_rotation", ("support_flexibility",), _support(range(3, 6))),
        Kind(
            "support_damping",
            ("foundation_dashpot", "foundation"),
            _support(range(3, 6), damped=True),
        ),
        Kind("gain", ("sensor_gain",), _gain, fault=True),
        Kind("sign", ("sensor_sign",), _sign, fault=True),
        Kind("tilt", ("sensor_tilt",), lambda rng, draft, truth: _moved(rng, draft, turn=True), fault=True),
        Kind("swap", ("sensor_swap",), _swap, fault=True),
        Kind("delay", ("sensor_delay",), _delay, fault=True),
        Kind(
            "position",
            ("sensor_position",),
            lambda rng, draft, truth: _moved(rng, draft, turn=False),
            fault=True,
        ),
    )
}
"""Every kind that may be hidden, by name, with what a diagnosis should call it."""

EFFECTS = tuple(k for k, kind in KINDS.items() if not kind.fault)
FAULTS = tuple(k for k, kind in KINDS.items() if kind.fault)


def draw_hidden(rng: Generator, kind: str, draft: Draft, truth: TrueFrame) -> Hidden | None:
    """Return a place for a kind on a frame, or None if it has none."""
    drawn = KINDS[kind].draw(rng, draft, truth)
    return None if drawn is None else replace(drawn, kind=kind)
