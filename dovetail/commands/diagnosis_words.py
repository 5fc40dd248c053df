"""Results of a diagnosis as lines of text."""

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from dovetail.report.table import Column, Table

if TYPE_CHECKING:
    from updating.diagnosis.diagnosis import Diagnosis
    from updating.diagnosis.findings import Ranked


def found_lines(d: "Diagnosis") -> list[str]:
    """Return found effects with values, twins and probability, doubts, and sensor faults, a line each."""
    from dovetail.report import words
    from dovetail.report.probable import probability_text
    from dovetail.result import uncertain_parameters

    out = []
    for k, f in enumerate(d.findings):
        out.append(f"  {words.finding_text(f)}")
        if f.alternatives:
            names = "; ".join(map(words.ranked_label, f.alternatives))
            out.append(f"    cannot be distinguished from: {names}")
        out += [f"    {words.extension_text(f, t)}" for t in f.extensions]
        if k < len(d.rounds) and (equal := words.equal_fit_text(d, f, d.rounds[k])):
            out.append(f"    {equal}")
    sure = probability_text(d)
    out += [f"  {text}" for text in (sure, words.far_text(uncertain_parameters(d))) if text]
    out += [f"  Form: {words.departure_text(f)}" for f in d.departures]
    return out + [f"  {words.fault_text(f)}" for f in d.every_fault]


def staircase(d: "Diagnosis", held_out: Mapping[str, tuple[float, ...]] | None = None) -> Table:
    """Return the errors after each step, and the noise floor."""
    from dovetail.report.words import step_label

    return Table.of(
        "steps",
        Column("error after each step", [*(step_label(s.label) for s in d.steps), "noise floor"]),
        Column("fitted", [*(s.fit_db for s in d.steps), d.noise_floor_db], "dB", ".2f"),
        Column("held-out", [*(s.held_out_db for s in d.steps), math.nan], "dB", ".2f"),
        *(Column(name, [*db, math.nan], show=".2f") for name, db in (held_out or {}).items()),
    )


def table_of_candidates(ranked: "Sequence[Ranked]", k: int) -> Table:
    """Return the candidates of a round."""
    from dovetail.report import words
    from updating.correlation import DB_PER_NEPER

    def digits(values: Sequence[float]) -> str:
        return f".{words.digits_apart(values[0], values[1:]) if values else 2}f"

    fitted, held_out = [r.fit_db for r in ranked], [r.held_out_db for r in ranked]
    alike = [r.similarity for r in ranked]
    return Table.of(
        f"round {k + 1}",
        Column("candidate", [words.ranked_label(r) for r in ranked]),
        Column(
            "level",
            [r.level for r in ranked],
            "dB",
            digits([r.level * DB_PER_NEPER for r in ranked]),
            DB_PER_NEPER,
        ),
        Column("fitted", fitted, "dB", digits(fitted)),
        Column("held-out", held_out, "dB", digits(held_out)),
        Column("similarity", alike, show=digits(alike)),
        Column("parameters", [words.parameters_text(r.parameters) for r in ranked]),
    )
