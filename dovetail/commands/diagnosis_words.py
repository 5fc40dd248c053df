"""Results of a diagnosis as lines of text."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

from dovetail.report.table import Table

if TYPE_CHECKING:
    from updating.diagnosis.mode_table import ModeTable
    from updating.diagnosis.verdict import Verdict


def diagnosis_lines(
    d: "Verdict", modes: "ModeTable | None", held_out: "Mapping[str, tuple[float, ...]] | None" = None
) -> "list[str | Table]":
    """Return what a diagnosis has found, with its errors, measured modes, and explanations.

    Parameters
    ----------
    d : Verdict
    modes : ModeTable or None
        Measured modes beside those of each step.
    held_out : mapping of str to tuple of float, optional
        Errors of channels that no fit has seen, by step [dB].
    """
    from dovetail.report.found_lines import found_lines
    from dovetail.report.sections import explanations, measured_modes, staircase

    lines: list[str | Table] = [*found_lines(d), "", staircase.table(d, held_out)]
    lines += ["", measured_modes.table(d, modes)] if modes is not None else []
    if d.modes is not None:
        lines += explanations.lines(d)
    proposals = [f"  {text}" for text in d.next_measurements]
    return lines + (["", "would distinguish the first two explanations:", *proposals] if proposals else [])
