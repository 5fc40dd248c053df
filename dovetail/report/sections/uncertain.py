"""The uncertain parameters before and after the fit."""

import math

from dovetail.report import cells, words
from dovetail.report.blocks import Line, ReportMark, ReportSection, TableBlock, Text
from dovetail.report.shown import Shown
from dovetail.result import RunResult, UncertainValue, by_any, by_frfs
from updating.diagnosis.verdict import Verdict

applies = by_any


def page(result: RunResult[Verdict], shown: Shown) -> ReportSection:
    """Return the uncertain parameters before and after the fit."""
    d = result.diagnosis
    fitted = (
        "to the baseline" if d.baseline is not None else "in every step" if by_frfs(d) else "with the effects"
    )
    bound = sum(u.at_bound for u in result.uncertain)
    text = (
        f" {bound} of them end at the edge of the allowed range, four prior standard deviations from "
        "nominal: doubt the nominal value, or widen it."
        if bound
        else ""
    )
    head = ["parameter", "nominal", "fitted ± std", "change [prior std]", "prior std [%]", ""]
    table = TableBlock(head, list(map(_parameter_row, result.uncertain)), numbers=(1, 2, 3, 4), at_most=25)
    text = f"Fitted {fitted} within their prior standard deviations.{text}"
    return ReportSection("Uncertain parameters", [Text(text), table])


def _parameter_row(u: UncertainValue) -> list[Line]:
    value, change = "replaced by the effect", "–"
    if math.isfinite(u.fitted):
        value = words.with_unit(u.fitted, u.unit, math.nan if u.at_bound else u.std)
        if math.isfinite(u.moved):
            change = f"{round(u.moved, 1) + 0.0:+.1f}".replace("-", "−")
    flag = ReportMark("at bound", "tag bound") if u.at_bound else ""
    prior = cells.percent(u.prior_std, u.nominal)
    return [u.words, words.with_unit(u.nominal, u.unit), value, change, prior, flag]
