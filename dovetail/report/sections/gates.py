"""The checks of the measurement before the search."""

from dovetail.report.blocks import ReportSection, TableBlock, Text
from dovetail.report.shown import Shown
from dovetail.result import FrfResult, by_frfs

applies = by_frfs


def page(result: FrfResult, shown: Shown) -> ReportSection:
    """Return the tests of the measurement before the search; nothing without any."""
    known = result.diagnosis.gates
    rows = (
        [[c.name, c.outcome, f"{c.found[:1].upper()}{c.found[1:]}."] for c in known.checks] if known else []
    )
    text = (
        "Made before the search for effects. What fails is corrected, counted as noise, or reported as a "
        "warning with the verdict."
    )
    blocks = [Text(text), TableBlock(["check", "outcome", "finding"], rows)] if known else []
    return ReportSection("Checks of the measurement", blocks)
