"""The measurement that would distinguish the first two explanations."""

from dovetail.report.blocks import Items, ReportSection, Text
from dovetail.report.shown import Shown
from dovetail.result import RunResult, by_any
from updating.diagnosis.verdict import Verdict

applies = by_any


def page(result: RunResult[Verdict], shown: Shown) -> ReportSection:
    """Return what would tell the first two explanations apart; nothing without any."""
    proposals = result.diagnosis.next_measurements
    lead = "To distinguish the first two explanations:" if proposals else ""
    return ReportSection("What to measure next", [Text(lead), Items(proposals)])
