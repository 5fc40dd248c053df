"""Places by the misfit that changes there leave."""

from dovetail.report import words
from dovetail.report.blocks import ReportSection, TableBlock, Text
from dovetail.report.shown import Shown
from dovetail.result import RunResult, by_modes_alone
from updating.diagnosis.verdict import Verdict

applies = by_modes_alone


def page(result: RunResult[Verdict], shown: Shown) -> ReportSection:
    """Return the places by the misfit that changes there leave."""
    rows = [[words.place(name), f"{share:.2f}"] for name, share in result.diagnosis.places[:20]]
    text = Text("Share of the misfit that changes at a place leave: the smaller, the more likely.")
    table = TableBlock(["place", "remaining misfit [-]"], rows, numbers=(1,), at_most=8)
    return ReportSection("Where", [text, table] if rows else ())
