"""Explanations of the data with their values, and the probability of each hypothesis."""

from typing import TYPE_CHECKING

from dovetail.report.blocks import Block, Heading, TableBlock, Text
from dovetail.report.probable import hypotheses, most_probable, probability_details, reported
from dovetail.report.table import Column, Table
from dovetail.report.words import explanation_text
from fem.summary import percent
from updating.diagnosis.verdict import Explanation, Verdict

if TYPE_CHECKING:
    from dovetail.report.shown import Shown
    from viz.chart import Chart

MOST_PRINTED = 12
"""Explanations that are printed."""
N_RANKED = 10
"""Rows of a page's ranking before that of all others."""


def table(d: Verdict) -> Table:
    """Return the first explanations of the credible set with their values."""
    few = d.credible[:MOST_PRINTED]
    return Table.of(
        "explanations",
        Column("probability of it alone", [e.probability for e in few], show=".2f"),
        Column("explanation", [explanation_text(e, d.model) for e in few]),
    )


def lines(d: Verdict) -> list[str | Table]:
    """Return the explanations of the credible set, where there are several, and how to tell them apart."""
    if len(d.credible) < 2:
        return []
    rest = len(d.credible) - MOST_PRINTED
    more = [f"{'':11}  and {rest} more that share the rest of 90 %"] if rest > 0 else []
    return ["", table(d), *more]


def credible(d: Verdict) -> TableBlock:
    """Return the explanations of the credible set with their values for a page."""
    rows = [
        [f"{k}: {explanation_text(e, d.model)}", percent(e.probability)] for k, e in enumerate(d.credible, 1)
    ]
    caption = "The fewest explanations that have a probability of 90 % together."
    return TableBlock(
        ["explanation", "probability of exactly this"], rows, numbers=(1,), caption=caption, at_most=12
    )


def page(d: Verdict, shown: "Shown") -> list[Block]:
    """Return the probabilities of hypotheses; nothing where the search gives none."""
    known = hypotheses(d)
    if not known:
        return []
    drawn = shown.figure(
        "probability",
        "Bars of the probability of each hypothesis; the table has the numbers.",
        "Probability of each hypothesis, that exactly its effects are missing, by the data and the priors. "
        "All of them together have 100 %.",
    )
    more = [Text(f"{text}.")] if (text := probability_details(d)) else []
    return [Heading("How probable"), *more, drawn, ranking(d)]


def _how(e: Explanation) -> str:
    return "" if not e.known else "forecast" if e.is_forecast else "fitted"


def ranking(d: Verdict) -> TableBlock:
    """Return the most probable explanations, fitted or forecast, and the probability of all others."""
    first, rest = most_probable(d, N_RANKED)
    rows = [[explanation_text(e, d.model), percent(e.probability), _how(e)] for e in first]
    if rest:
        rows.append([f"{len(rest)} others, together", percent(sum(e.probability for e in rest)), ""])
    caption = "The most probable explanations; forecast are values and probabilities that no fit has tried."
    head = ["explanation", "probability of exactly this", "by"]
    return TableBlock(head, rows, numbers=(1,), caption=caption)


def figure(d: Verdict) -> "Chart | None":
    """Return the figure of the probabilities; None without any."""
    from viz.search import probability

    known = hypotheses(d)
    return probability(known, accepted=reported(d)) if known else None
