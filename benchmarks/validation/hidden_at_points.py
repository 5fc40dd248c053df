"""Effects that may be hidden at points: bodies, springs to the ground, instruments, supports."""

from dataclasses import replace

import numpy as np

from benchmarks.validation.frames import Draft, Generator
from benchmarks.validation.hiding import (
    Draw,
    Hidden,
    Kind,
    Place,
    bending_stiffnesses,
    felt_stiffness,
    middle_of_band,
    on_member,
    one_entry,
    some_body,
    some_fastening,
    some_place,
)
from benchmarks.validation.truth import Attached, Cut, TrueFrame, TrueSupport, rigid_body
from fem import DIRECTIONS


def _point_body(rotary: bool) -> Draw:
    def draw(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
        name, m, x = some_place(rng, draft)
        body, unit = some_body(m, rotary)
        return Hidden(
            on_member(draft, name, x),
            (1e-4, 1.0),
            lambda frame, a: frame.with_attached(Attached(Cut(name, x), M=a * body)),
            lambda a: {"inertia" if rotary else "mass": a * unit, "position": x},
        )

    return draw


def _to_ground(damper: bool) -> Draw:
    def draw(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
        name, m, x = some_fastening(rng, draft)
        d = int(rng.choice([k for k in range(3) if abs(m.axes[0][k]) < 0.8]))
        k = 48 * min(bending_stiffnesses(m)) / m.length**3
        unit = k / middle_of_band(draft) if damper else k

        def change(frame: TrueFrame, a: float) -> TrueFrame:
            matrix = one_entry(d, a * unit)
            at = Cut(name, x)
            return frame.with_attached(Attached(at, C=matrix) if damper else Attached(at, K=matrix))

        return Hidden(
            replace(on_member(draft, name, x), direction=DIRECTIONS[d]),
            (1e-3, 300.0),
            change,
            lambda a: {"damping" if damper else "stiffness": a * unit, "position": x},
        )

    return draw


def _driver_mass(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
    at = draft.drives[0].at
    unit = draft.frame.members[at.member].mass
    return Hidden(
        on_member(draft, at.member, at.position),
        (1e-4, 1.0),
        lambda frame, a: frame.with_attached(Attached(at, M=rigid_body(a * unit))),
        lambda a: {"mass": a * unit},
    )


def _stinger(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
    drive = draft.drives[0]
    m = draft.frame.members[drive.at.member]
    unit = 48 * min(bending_stiffnesses(m)) / m.length**3
    across = np.zeros((6, 6))
    across[:3, :3] = np.eye(3) - np.outer(drive.direction, drive.direction)
    return Hidden(
        on_member(draft, drive.at.member, drive.at.position),
        (1e-3, 100.0),
        lambda frame, a: frame.with_attached(Attached(drive.at, K=a * unit * across)),
        lambda a: {"stiffness": a * unit},
    )


def _sensor_masses(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
    places = list(dict.fromkeys(s.at for s in draft.sensors))
    unit = sum(m.mass for m in draft.frame.members.values()) / len(places)
    return Hidden(
        Place("all sensors"),
        (1e-4, 0.5),
        lambda frame, a: frame.with_attached(*(Attached(p, M=rigid_body(a * unit)) for p in places)),
        lambda a: {"mass": a * unit},
    )


def _gyroscopic(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
    name, m, x = some_fastening(rng, draft)
    axis = m.axes[int(rng.integers(3))]
    unit = m.mass * m.length**2 / 12 * middle_of_band(draft)
    C = np.zeros((6, 6))
    C[3:, 3:] = unit * np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return Hidden(
        on_member(draft, name, x),
        (1e-4, 1.0),
        lambda frame, a: frame.with_attached(Attached(Cut(name, x), C=a * C)),
        lambda a: {"momentum": -a * unit},  # the moment of a rotor is dθ/dt × h, so that C = -h S(axis)
    )


def _support(directions: range, damped: bool = False) -> Draw:
    def draw(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
        if not draft.frame.supports:
            return None
        s = draft.frame.supports[int(rng.integers(len(draft.frame.supports)))]
        d = int(rng.choice(directions))
        return soft_support(draft, s, d, damped)

    return draw


def soft_support(draft: Draft, s: TrueSupport, d: int, damped: bool = False) -> Hidden:
    """Return a support that gives way in a direction, beside those in which it does already."""
    unit = felt_stiffness(draft, s.at.member, d)

    def change(frame: TrueFrame, a: float) -> TrueFrame:
        support = next(x for x in frame.supports if x.name == s.name)
        C = one_entry(d, 0.3 * unit / a / middle_of_band(draft) if damped else 0.0)
        rigid = tuple(r and k != d for k, r in enumerate(support.rigid))
        return frame.with_support(s.name, rigid=rigid, K=support.K + one_entry(d, unit / a), C=support.C + C)

    place = Place(f"support {s.name}, {DIRECTIONS[d]}", support=s.name, direction=DIRECTIONS[d])
    values = {"tau": 0.3 / middle_of_band(draft)} if damped else {}
    return Hidden(place, (0.1, 1e6), change, lambda a: {"stiffness": unit / a, **values})


AT_POINTS = (
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
    Kind("support_damping", ("foundation_dashpot", "foundation"), _support(range(3, 6), damped=True)),
)
"""Kinds at points and supports."""
