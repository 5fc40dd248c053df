"""Notes for the reader on methods and limits."""

from dovetail.report.blocks import Items, ReportSection
from dovetail.report.shown import Shown
from dovetail.result import RunResult, by_any
from updating.diagnosis.verdict import Verdict

applies = by_any


def page(result: RunResult[Verdict], shown: Shown) -> ReportSection:
    """Return notes for the reader on methods and limits."""
    study = result.study
    failures = *shown.album.failures, *shown.figures.failures
    known = [*study.model.mesh.notes, *study.measured_notes, *result.notes, *failures]
    return ReportSection("Notes", [Items(known)])
