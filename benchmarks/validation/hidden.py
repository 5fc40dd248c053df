"""The kinds of effects and faults that may be hidden in a truth, and their names in a diagnosis.

`KINDS` is the table of all of them. Each kind draws a place on a frame and says how an amplitude changes
the truth; the effect's change is proportional to the amplitude as long as it is weak.
"""

from dataclasses import replace

from benchmarks.validation.frames import Draft, Generator
from benchmarks.validation.hidden_at_joints import AT_JOINTS
from benchmarks.validation.hidden_at_points import AT_POINTS
from benchmarks.validation.hidden_connections import CONNECTIONS, MOUNTINGS
from benchmarks.validation.hidden_faults import IN_RECORDS
from benchmarks.validation.hidden_in_members import IN_MEMBERS
from benchmarks.validation.hiding import Hidden, Kind
from benchmarks.validation.truth import TrueFrame

_SINGLE = (*AT_JOINTS, *IN_MEMBERS, *AT_POINTS)

KINDS: dict[str, Kind] = {kind.name: kind for kind in (*_SINGLE, *IN_RECORDS, *CONNECTIONS, *MOUNTINGS)}
"""Every kind that may be hidden, by name, with its name in a diagnosis."""

EFFECTS = tuple(kind.name for kind in _SINGLE)
"""Kinds of the sets with any effect. Seeds draw from them by number: further kinds have sets of their own."""
FAULTS = tuple(kind.name for kind in IN_RECORDS)

SEEN_IN_MODES = (
    "joint_translation",
    "joint_rotation",
    "joint_mass",
    "member_stiffness",
    "member_density",
    "member_thickness",
    "crack",
    "stiffness_loss",
    "end_release",
    "distributed_mass",
    "point_mass",
    "support_translation",
    "support_rotation",
)
"""Kinds that natural frequencies and shapes can show."""
MODAL_SETS = (
    "modes",
    "frequencies",
    "states",
    "modes-null",
    "ambient",
    "ambient-null",
    "frequencies-null",
    "states-null",
)
"""Sets whose data are modes, not FRFs."""

SETS: dict[str, tuple[tuple[str, ...], ...]] = {
    "single": (EFFECTS,),
    "null": (),
    "withheld": (EFFECTS,),
    "weak": (EFFECTS,),
    "two": (EFFECTS, EFFECTS),
    "faults": (FAULTS,),
    "connection": (("joint_soft", "support_soft"),),
    "connections": (("connection_soft",), ("connection_soft",)),
    "mixed": (("connection_soft",), ("point_mass",)),
    "mounting": (("joint_offset", "joint_hole", "part_shift", "foot_shift", "support_shift"),),
    "modes": (SEEN_IN_MODES,),
    "frequencies": (SEEN_IN_MODES,),
    "states": (SEEN_IN_MODES,),
    "modes-null": (),
    "ambient": (SEEN_IN_MODES,),
    "ambient-null": (),
    "frf-states": (EFFECTS,),
    "frf-states-null": (),
    "frequencies-null": (),
    "states-null": (),
}
"""Sets of cases, with the kinds that each thing in them is drawn from.

One effect; nothing; one whose kind the search may not use; one ten times weaker; two; a fault of a sensor; a
connection that gives way in two or three directions; two such; one and a mass; something that is mounted
elsewhere. Of modes: frequencies and shapes, frequencies alone, two states of one frame, and nothing, with
shapes or without; modes that are identified from the response to unknown forces, and nothing. Two states of
one frame by FRFs, with a change as weak as in "weak", and two without a change, by FRFs or by modes.
"""
FRF_STATES = ("frf-states", "frf-states-null")
"""Sets of two states that are measured by FRFs."""
WEAK_SETS = ("weak", "frf-states")
"""Sets whose effects are weaker."""


def draw_hidden(rng: Generator, kind: str, draft: Draft, truth: TrueFrame) -> Hidden | None:
    """Return a place for a kind on a frame, or None if it has none."""
    drawn = KINDS[kind].draw(rng, draft, truth)
    if drawn is None:
        return None
    return replace(drawn, kind=kind, parts=tuple(replace(p, kind=kind) for p in drawn.parts))
