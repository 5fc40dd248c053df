"""Connections that give way in several directions at once."""

from benchmarks.validation.frames import Draft, Generator
from benchmarks.validation.hidden_at_joints import soft_joint
from benchmarks.validation.hidden_at_points import soft_support
from benchmarks.validation.hiding import Draw, Hidden, Kind, Place
from benchmarks.validation.truth import TrueFrame, TrueJoint

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
