"""Results of a diagnosis as lines of text."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

from dovetail.report.table import Table

if TYPE_CHECKING:
    from updating.diagnosis.mode_table import ModeTable
    from updating.diagnosis.verdict import Verdict


def found_lines(d: "Verdict") -> list[str]:
    """Return found effects with values, twins and probability, doubts, and sensor faults, a line each."""
    from dovetail.report import words
    from dovetail.report.probable import probability_details, probability_text
    from dovetail.result import uncertain_parameters

    out = []
    for k, f in enumerate(d.findings):
        out.append(f"  {words.finding_text(f)}")
        out += [f"    {spot}" for spot in (words.spot_text(f.effect, d.model),) if spot]
        if f.alternatives:
            names = "; ".join(map(words.ranked_label, f.alternatives))
            out.append(f"    cannot be distinguished from: {names}")
        out += [f"    {words.extension_text(f, t)}" for t in f.extensions]
        if k < len(d.rounds) and (equal := words.equal_fit_text(d, f, d.rounds[k])):
            out.append(f"    {equal}")
    out += [f"  {text}" for text in (probability_text(d),) if text]
    out += [f"    {text}" for text in (probability_details(d),) if text]
    out += [f"  {text}" for text in (words.far_text(uncertain_parameters(d)),) if text]
    out += [f"  Form: {words.departure_text(f)}" for f in d.departures]
    return out + [f"  {words.fault_text(f)}" for f in d.every_fault]


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
    from dovetail.report.sections import explanations, measured_modes, staircase

    lines: list[str | Table] = [*found_lines(d), "", staircase.table(d, held_out)]
    lines += ["", measured_modes.table(d, modes)] if modes is not None else []
    if d.modes is not None:
        lines += explanations.lines(d)
    proposals = [f"  {text}" for text in d.next_measurements]
    return lines + (["", "would distinguish the first two explanations:", *proposals] if proposals else [])
