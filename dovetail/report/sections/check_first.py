"""Probable faults of the study, before all else."""

from dovetail.report.blocks import Items, ReportSection
from dovetail.report.shown import Shown
from dovetail.result import RunResult, by_any
from updating.diagnosis.verdict import Verdict

applies = by_any


def page(result: RunResult[Verdict], shown: Shown) -> ReportSection:
    """Return the probable faults of the study; nothing without any."""
    return ReportSection("Check first", [Items(result.study.warnings)])
