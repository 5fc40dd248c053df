"""Effects that may be hidden in members."""

from dataclasses import replace

import numpy as np

from benchmarks.validation.frames import Draft, Generator
from benchmarks.validation.hiding import (
    NEAR,
    Draw,
    Hidden,
    Kind,
    bending_stiffnesses,
    entire_member,
    on_member,
    some_member,
    some_place,
)
from benchmarks.validation.truth import EndSpring, Stretch, TrueFrame
from fem import DIRECTIONS


def _factor(attribute: str, largest: float, direction: str | None = None) -> Draw:
    def draw(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
        if len(draft.frame.members) < 2:
            return None
        name, m = some_member(rng, draft)
        sign = float(rng.choice([-1, 1]))
        top = largest if sign < 0 else 2 * largest
        # Candidates state the change in parts of the nominal value.
        ratio = float(getattr(truth.members[name], attribute) / getattr(m, attribute))
        return Hidden(
            replace(entire_member(name), direction=direction),
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
    name, m = some_member(rng, draft)
    euler = float(np.pi**2 * min(bending_stiffnesses(m)) / m.length**2)
    sign = float(rng.choice([-1, 1]))
    return Hidden(
        entire_member(name),
        (0.02, 0.6 if sign < 0 else 30.0),
        lambda frame, a: frame.with_member(name, tension=sign * a * euler),
        lambda a: {"tension": sign * a * euler},
    )


def _crack(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
    name, m, x = some_place(rng, draft)
    d = int(rng.choice([4, 5]))
    EI, height = (bending_stiffnesses(m)[0], m.h) if d == 4 else (bending_stiffnesses(m)[1], m.b)
    return Hidden(
        replace(on_member(draft, name, x), direction=DIRECTIONS[d]),
        (0.05, 300.0),
        lambda frame, a: frame.with_member(name, springs=(EndSpring(x, d, EI / height / a),)),
        lambda a: {"position": x, "compliance": a * height / EI},
    )


def _stiffness_loss(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
    name, m = some_member(rng, draft)
    half = float(rng.uniform(0.04, 0.06)) * m.length
    x = float(rng.uniform(half + 0.02 * m.length, 0.98 * m.length - half))
    return Hidden(
        on_member(draft, name, x),
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
    k = 4 * bending_stiffnesses(m)[d - 4] / m.length
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
        replace(
            on_member(draft, name, x),
            words=f"member {name}, {'first' if x == 0 else 'second'} end",
            turns=tuple(turns),
            of_member=len(meeting) > 2,
        ),
        (0.01, 1e4),
        lambda frame, a: frame.with_member(name, springs=(EndSpring(x, d, k / a),)),
        lambda a: {"compliance": a / k},
    )


def _distributed_mass(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
    name, m = some_member(rng, draft)
    part = float(rng.uniform(0.3, 0.6)) * m.length
    start = float(rng.uniform(0, m.length - part))
    line = m.mass / m.length
    return Hidden(
        replace(on_member(draft, name, start + part / 2), tolerance=4 * NEAR * m.length),
        (0.01, 2.0),
        lambda frame, a: frame.with_member(name, stretches=(Stretch(start, start + part, mass=a * line),)),
        lambda a: {"mass": a * line, "position": start + part / 2, "width": part},
    )


def _fluid(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
    name, m = some_member(rng, draft)
    along_z, line = bool(rng.integers(2)), m.mass / m.length
    return Hidden(
        replace(entire_member(name), direction="z" if along_z else "y"),
        (0.01, 2.0),
        lambda frame, a: frame.with_member(name, fluid=(0.0, a * line) if along_z else (a * line, 0.0)),
        lambda a: {"mass": a * line},
    )


def _rigid_zone(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
    taken = {(c.member, round(c.position, 9)) for j in draft.frame.joints for c in j.cuts}
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
        replace(
            on_member(draft, name, x),
            words=f"member {name}, {'first' if x == 0 else 'second'} end",
            of_member=True,
        ),
        (0.004, largest),
        lambda frame, a: frame.with_member(name, **{key: a * m.length}),
        lambda a: {"length": a * m.length},
    )


def _member_loss(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
    name, m = some_member(rng, draft)
    return Hidden(
        entire_member(name),
        (2e-3, 0.5),
        lambda frame, a: frame.with_member(name, stretches=(Stretch(0.0, m.length, loss=a),)),
        lambda a: {"loss_factor": a},
    )


IN_MEMBERS = (
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
)
"""Kinds in members."""
