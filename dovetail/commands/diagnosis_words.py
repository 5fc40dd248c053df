"""Results of a diagnosis as lines of text."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from updating.diagnosis.diagnosis import Diagnosis


from dovetail.commands.tables import cell, width_of


def found_lines(d: "Diagnosis") -> list[str]:
    """Return found effects with values, twins and probability, doubts, and sensor faults, a line each."""
    from dovetail.report import words
    from dovetail.report.probable import probability_text
    from dovetail.result import uncertain_parameters

    out = []
    for f in d.findings:
        out.append(f"  {words.finding_text(f)}")
        if f.twins:
            out.append(f"    cannot be told from: {'; '.join(words.ranked_label(t) for t in f.twins)}")
    sure = probability_text(d)
    out += [f"  {text}" for text in (sure, words.far_text(uncertain_parameters(d))) if text]
    out += [f"  Form: {words.departure_text(f)}" for f in d.departures]
    return out + [f"  {words.fault_text(f)}" for f in d.faults]


def staircase(d: "Diagnosis", held_out: Mapping[str, tuple[float, ...]] | None = None) -> list[str]:
    """Return the table of errors after each step."""
    from dovetail.report.words import step_label

    held_out = held_out or {}
    width = width_of([step_label(s.label) for s in d.steps])
    names = "".join(f"  {n:>16}" for n in held_out)
    rows = [
        f"{step_label(s.label):{width}}  {s.fit_db:9.2f}  {cell(s.held_out_db, 11)}"
        + "".join(f"  {cell(db[k], 16)}" for db in held_out.values())
        for k, s in enumerate(d.steps)
    ]
    floor = f"{'noise floor':{width}}  {d.noise_floor_db:9.2f}"
    return [f"{'error after each step':{width}}  fitted dB  held-out dB{names}", *rows, floor]
