"""Connections that give way in several directions at once, or act elsewhere than stated."""

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.validation.frames import Draft, Generator
from benchmarks.validation.hidden_at_joints import soft_joint
from benchmarks.validation.hidden_at_points import soft_support
from benchmarks.validation.hiding import Draw, Hidden, Kind, Place
from benchmarks.validation.truth import Cut, Member, TrueFrame, TrueJoint

NEAREST, FURTHEST = 2e-3, 0.14
"""Least and largest shift along a member, in parts of its length [-]."""
HOLE_NEAREST, HOLE_FURTHEST = 0.02, 1.5
"""Least and largest distance of a hole from the centre line, in parts of √A of the section [-]."""
ROOM = 0.95
"""A shift takes at most this part of the way to the member's end [-]."""


def _some_side(rng: Generator, truth: TrueFrame, feet: bool) -> tuple[TrueJoint, int] | None:
    """Return an elastic joint drawn at random, of two parts or a foot, and one of its sides."""
    able = [j for j in truth.joints if not j.rigid[0] and (j.second is None) == feet]
    if not able:
        return None
    j = able[int(rng.integers(len(able)))]
    return j, int(rng.integers(len(j.cuts)))


def _levers(j: TrueJoint, side: int, more: NDArray[np.float64]) -> Any:
    """Return a joint's levers with one of them longer."""
    return tuple(lever + more if k == side else lever for k, lever in enumerate(j.levers))


def _joint_hole(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
    found = _some_side(rng, truth, feet=False)
    if found is None:
        return None
    j, side = found
    name = j.cuts[side].member
    m, d = draft.frame.members[name], int(rng.integers(1, 3))
    unit = float(np.sqrt(m.b * m.h)) * float(rng.choice([-1, 1]))

    def change(frame: TrueFrame, a: float) -> TrueFrame:
        return frame.with_joint(j.name, levers=_levers(j, side, a * unit * m.axes[d]))

    local = "xyz"[d]
    place = Place(f"joint {j.name}, hole of {name} along local {local}", name, joint=j.name, direction=local)
    return Hidden(place, (HOLE_NEAREST, HOLE_FURTHEST), change, lambda a: {"amount": a * unit})


def _way(rng: Generator, m: Member, position: float) -> tuple[float, tuple[float, float]] | None:
    """Return a sign and bounds, in parts of the member's length, of a shift that stays on the member."""
    room = {1.0: 1 - position / m.length, -1.0: position / m.length}
    ways = [sign for sign, free in room.items() if ROOM * free > 10 * NEAREST]
    if not ways:
        return None
    sign = float(rng.choice(ways))
    return sign, (NEAREST, min(FURTHEST, ROOM * room[sign]))


def _shifted_side(rng: Generator, draft: Draft, truth: TrueFrame, feet: bool) -> Hidden | None:
    """Return a side of a joint that acts elsewhere on its member, which moves with all that is on it."""
    found = _some_side(rng, truth, feet)
    if found is None:
        return None
    j, side = found
    at = j.cuts[side]
    m = draft.frame.members[at.member]
    way = _way(rng, m, at.position)
    if way is None:
        return None
    sign, bounds = way

    def change(frame: TrueFrame, a: float) -> TrueFrame:
        step = a * sign * m.length
        moved = Cut(at.member, at.position + step)
        cuts = {"first" if side == 0 else "second": moved}
        return frame.with_joint(j.name, levers=_levers(j, side, step * m.axes[0]), **cuts)

    place = Place(f"joint {j.name}, member {at.member} shifted", at.member, joint=j.name)
    return Hidden(place, bounds, change, lambda a: {"amount": a * sign * m.length})


def _support_shift(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
    if not truth.supports:
        return None
    s = truth.supports[int(rng.integers(len(truth.supports)))]
    m = draft.frame.members[s.at.member]
    way = _way(rng, m, s.at.position)
    if way is None:
        return None
    sign, bounds = way

    def change(frame: TrueFrame, a: float) -> TrueFrame:
        return frame.with_support(s.name, at=Cut(s.at.member, s.at.position + a * sign * m.length))

    place = Place(f"support {s.name} on member {s.at.member}", s.at.member, support=s.name)
    return Hidden(place, bounds, change, lambda a: {"amount": a * sign * m.length})


MOUNTINGS = (
    Kind("joint_hole", ("joint_hole",), _joint_hole),
    Kind("part_shift", ("part_shift",), partial(_shifted_side, feet=False)),
    Kind("foot_shift", ("foot_shift",), partial(_shifted_side, feet=True), elastic_feet=True),
    Kind("support_shift", ("support_shift",), _support_shift),
)
"""Kinds of things that are elsewhere, beside the joint's offset."""


ROTATIONS_ALONE = 0.75
"""Share of soft connections that give way about axes only, as bolted and clamped ones do [-]."""


def _directions(rng: Generator) -> list[int]:
    """Return two or three directions, of the rotations alone or of all six."""
    pool = range(3, 6) if rng.random() < ROTATIONS_ALONE else range(6)
    return sorted(int(d) for d in rng.choice(list(pool), int(rng.integers(2, 4)), replace=False))


def _soft(joints: bool, supports: bool) -> Draw:
    def draw(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
        pool = [*(truth.joints if joints else ()), *(truth.supports if supports else ())]
        if not pool:
            return None
        c = pool[int(rng.integers(len(pool)))]
        directions = _directions(rng)
        if isinstance(c, TrueJoint):
            place = Place(f"joint {c.name}", joint=c.name)
            parts = tuple(soft_joint(draft, c, d) for d in directions)
        else:
            place = Place(f"support {c.name}", support=c.name)
            parts = tuple(soft_support(draft, c, d) for d in directions)
        return Hidden(place, parts[0].bounds, parts=parts)

    return draw


CONNECTIONS = (
    Kind("joint_soft", ("joint_stiffness",), _soft(joints=True, supports=False)),
    Kind("support_soft", ("support_flexibility",), _soft(joints=False, supports=True)),
    Kind("connection_soft", ("joint_stiffness", "support_flexibility"), _soft(joints=True, supports=True)),
)
"""Kinds of connections that give way in two or three directions."""
