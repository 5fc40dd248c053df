"""The rounds of a search: what each candidate that was fitted leaves."""

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from dovetail.report import cells, words
from dovetail.report.blocks import Block, Details, Line, ReportMark, ReportSection, TableBlock, Text
from dovetail.report.table import Column, Table
from dovetail.result import FrfResult, by_frfs
from dovetail.spots import spot_label
from fem.model import Model
from fem.summary import counted
from updating.diagnosis.diagnosis import Diagnosis
from updating.diagnosis.findings import Ranked

if TYPE_CHECKING:
    from dovetail.report.shown import Shown
    from viz.chart import Chart

applies = by_frfs

HEADS = [
    "candidate",
    "value ± std",
    "fitted lines [dB]",
    "held-out lines [dB]",
    "similarity [-]",
]
"""Headings of a table of candidates."""
_NAMES = re.compile(r" \([^()]* … [^()]*\)")


def labels(ranked: Sequence[Ranked]) -> list[str]:
    """Return candidates in words, each of them once."""
    seen: dict[str, int] = {}
    out = []
    for r in ranked:
        label = _NAMES.sub("", words.ranked_label(r))
        seen[label] = seen.get(label, 0) + 1
        out.append(label if seen[label] == 1 else f"{label} ({seen[label]})")
    return out


def _accepted(d: Diagnosis, k: int) -> tuple[int | None, set[int]]:
    """Return the number of the candidate that a round accepted, if any, and those of its twins."""
    names = [r.name for r in d.rounds[k]]
    if k >= len(d.findings):
        return None, set()
    name, twins = d.findings[k].effect.name, {t.name for t in d.findings[k].twins}
    return names.index(name) if name in names else None, {
        n for n, other in enumerate(names) if other in twins
    }


def _before(d: Diagnosis, k: int) -> float:
    return d.steps[min(k + 1, len(d.steps) - 1)].fit_db


def caption(d: Diagnosis, k: int) -> str:
    """Return the caption of a round's figure."""
    accepted, _ = _accepted(d, k)
    outcome = "none of them" if accepted is None else labels(d.rounds[k])[accepted]
    return (
        f"Round {k + 1} of the search: error after fitting each candidate together with the uncertain "
        f"parameters; {outcome} is accepted. They are ranked by their evidence, which also counts "
        f"{'the phase and ' if d.problem.data.phase else ''}the parameters of a law."
    )


def figure(d: Diagnosis, k: int) -> "Chart | None":
    """Return the figure of a round's errors; None where there is nothing to compare."""
    from viz.search import ranking

    ranked, (accepted, twins) = d.rounds[k], _accepted(d, k)
    if len(ranked) < 2:
        return None
    names, errors = [r.name for r in ranked], [r.fit_db for r in ranked]
    more: dict[str, Any] = {"names": names, "twins": twins, "accepted": accepted}
    return ranking(labels(ranked), errors, _before(d, k), **more)


def table(ranked: Sequence[Ranked], k: int, model: Model) -> Table:
    """Return the candidates of a round."""

    def digits(values: Sequence[float]) -> str:
        return f".{words.digits_apart(values[0], values[1:]) if values else 2}f"

    fitted, held_out = [r.fit_db for r in ranked], [r.held_out_db for r in ranked]
    alike = [r.similarity for r in ranked]
    return Table.of(
        f"round {k + 1}",
        Column("candidate", [located_label(r, model) for r in ranked]),
        Column("fitted", fitted, "dB", digits(fitted)),
        Column("held-out", held_out, "dB", digits(held_out)),
        Column("similarity", alike, show=digits(alike)),
        Column("parameters", [words.parameters_text(r.parameters) for r in ranked]),
    )


def lines(d: Diagnosis, number: int) -> list[str | Table]:
    """Return the first candidates of each round, a number of them at most."""
    out: list[str | Table] = []
    for k, ranked in enumerate(d.rounds):
        if ranked:
            heading = f"round {k + 1}, {min(number, len(ranked))} of {len(ranked)} candidates"
            out += ["", heading, table(ranked, k, d.model).first(number)]
    return out


def located_label(r: Ranked, model: Model) -> str:
    """Return a candidate in words, with the numbers of its node or element."""
    return words.ranked_label(r) + spot_label(r.effect, model)


def block(known: Sequence[tuple[Ranked, str]], marked: Sequence[int], model: Model) -> TableBlock:
    """Return a table of candidates, each with a tag or an empty one."""
    values = [(r.fit_db, r.held_out_db, r.similarity) for r, _ in known]
    digits = [words.digits_apart(first, column) for first, *column in zip(*values, strict=True)]
    rows: list[list[Line]] = []
    for (r, what), numbers in zip(known, values, strict=True):
        label = (located_label(r, model), " ", ReportMark(what) if what else "")
        numbers_ = (cells.decimals(x, n) for x, n in zip(numbers, digits, strict=True))
        rows.append([label, words.parameters_text(r.parameters), *numbers_])
    return TableBlock(HEADS, rows, numbers=(2, 3, 4), marked=marked)


def page(result: FrfResult, shown: "Shown") -> ReportSection:
    """Return how the candidates did in each round; nothing where none was looked at."""
    d = result.diagnosis
    text = (
        "Each round evaluates all candidates, or a short list of very many, on a grid of their parameters. "
        "It fits the promising ones briefly, together with the uncertain parameters, and the best of these "
        "fully. The most probable hypothesis is kept if its evidence, with the prior odds against each "
        "place, is larger than that without it. The search is then repeated with it. The table has the "
        "fully fitted candidates."
    )
    tried = [k for k, ranked in enumerate(d.rounds) if ranked]  # not those in the model before the search
    blocks: list[Block] = [Text(text)] if tried else []
    for k in tried:
        body = _round(d, shown, k)
        blocks += body if k == tried[0] else [Details(f"Round {k + 1}: {_outcome(d, k)}", body)]
    return ReportSection("How the candidates did", blocks)


def _round(d: Diagnosis, shown: "Shown", k: int) -> list[Block]:
    name, ranked, finding = f"ranking-{k + 1}", d.rounds[k], d.findings[k] if k < len(d.findings) else None
    alt = f"Bars of the error that each candidate leaves in round {k + 1}; the table has the numbers."
    roles = {} if finding is None else {t.name: "twin" for t in finding.alternatives}
    if finding is not None:
        roles |= {t.name: "contains it" for t in finding.extensions} | {finding.effect.name: "accepted"}
    known = [(r, roles.get(r.name, "")) for r in ranked]
    numbers = block(known, [i for i, (_, what) in enumerate(known) if what == "accepted"], d.model)
    if len(ranked) < 2:
        return [Text(f"One candidate was fitted fully; without it {_before(d, k):.2f} dB are left."), numbers]
    title = f"Round {k + 1} in numbers: {counted(len(ranked), 'candidate')}"
    return [shown.figure(name, alt, caption(d, k), [name]), Details(title, [numbers])]


def _outcome(d: Diagnosis, k: int) -> str:
    if k < len(d.findings):
        f = d.findings[k]
        return f"{words.effect_label(f.effect.kind, f.effect.where)} is accepted"
    return "no candidate improves the model enough; the search ends"
