"""The kinds of effects and faults that may be hidden in a truth, and what a diagnosis should call them.

`KINDS` is the table of all of them. Each kind draws a place on a frame and says how an amplitude changes
the truth; the amplitude is proportional to what the effect does as long as it is weak.
"""

from dataclasses import replace

from dovetail.validation.frames import Draft, Generator
from dovetail.validation.hidden_at_joints import AT_JOINTS
from dovetail.validation.hidden_at_points import AT_POINTS
from dovetail.validation.hidden_faults import IN_RECORDS
from dovetail.validation.hidden_in_members import IN_MEMBERS
from dovetail.validation.hiding import Hidden, Kind
from dovetail.validation.truth import TrueFrame

KINDS: dict[str, Kind] = {kind.name: kind for kind in (*AT_JOINTS, *IN_MEMBERS, *AT_POINTS, *IN_RECORDS)}
"""Every kind that may be hidden, by name, with what a diagnosis should call it."""

EFFECTS = tuple(k for k, kind in KINDS.items() if not kind.fault)
FAULTS = tuple(k for k, kind in KINDS.items() if kind.fault)


def draw_hidden(rng: Generator, kind: str, draft: Draft, truth: TrueFrame) -> Hidden | None:
    """Return a place for a kind on a frame, or None if it has none."""
    drawn = KINDS[kind].draw(rng, draft, truth)
    return None if drawn is None else replace(drawn, kind=kind)
