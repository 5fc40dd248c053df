"""The uncertain parameters before and after the fit."""

import math

from dovetail.report import cells, words
from dovetail.report.blocks import Line, ReportMark, ReportSection, TableBlock, Text
from dovetail.report.shown import Shown
from dovetail.result import CONNECTIONS_POWER, DAMPING_RATIO, RunResult, UncertainValue, by_any, by_frfs
from updating.diagnosis.verdict import Verdict

applies = by_any

LEAST_ROWS = 5
"""Rows that are shown at least [-]."""


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
    replaced = [u for u in result.uncertain if not math.isfinite(u.fitted)]
    moved = [u for u in result.uncertain if math.isfinite(u.fitted) and not u.stays]
    rows = [_parameter_row(u) for u in (*moved, *replaced, *(u for u in result.uncertain if u.stays))]
    text = f"Fitted {fitted} within their prior standard deviations.{text}"
    if 0 < len(moved) < len(rows):
        text += (
            f" The first {len(moved)} of {len(rows)} moved by more than the ± of their fitted value; the "
            "change is given in prior standard deviations, which are usually larger."
        )
    table = TableBlock(head, rows, numbers=(1, 2, 3, 4), at_most=max(len(moved) + len(replaced), LEAST_ROWS))
    return ReportSection("Uncertain parameters", [Text(text), table])


def _parameter_row(u: UncertainValue) -> list[Line]:
    value, change = "replaced by the effect", "–"
    nominal, fitted, std, unit = _in_percent(u)
    if math.isfinite(u.fitted):
        value = words.with_unit(fitted, unit, math.nan if u.at_bound else std)
        if math.isfinite(u.moved):
            change = f"{round(u.moved, 1) + 0.0:+.1f}".replace("-", "−")
    flag = ReportMark("at bound", "tag bound") if u.at_bound else ""
    relative = unit == "%" and not u.nominal
    prior = cells.number(100 * u.prior_std, 2) if relative else cells.percent(u.prior_std, u.nominal)
    return [u.words, words.with_unit(nominal, unit), value, change, prior, flag]


def _in_percent(u: UncertainValue) -> tuple[float, float, float, str]:
    """Return values before and after with the deviation and the unit: damping and changes in %."""
    parameter = u.name.rpartition(".")[2].partition(":")[0]
    # Parameters of effects that are damping ratios or loss factors
    is_loss = parameter in ("zeta", "eta", "loss_factor") or u.name.startswith(DAMPING_RATIO)
    if u.unit != "-" or u.name == CONNECTIONS_POWER or (u.nominal and not is_loss):
        return u.nominal, u.fitted, u.std, u.unit
    if u.is_logarithm:
        return 100 * math.expm1(u.nominal), 100 * math.expm1(u.fitted), 100 * math.exp(u.fitted) * u.std, "%"
    return 100 * u.nominal, 100 * u.fitted, 100 * u.std, "%"
