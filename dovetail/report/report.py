"""The report: one HTML file with everything in it, for an engineer who has not seen the study before."""

from pathlib import Path

from dovetail.report.answer import answer, how_sure
from dovetail.report.blocks import Report
from dovetail.report.compared import check_first, compared, gates
from dovetail.report.figures import Figures, make_all
from dovetail.report.misfit import misfit
from dovetail.report.missing import missing, search
from dovetail.report.page import report_page
from dovetail.report.pictures import Album
from dovetail.report.responses import faults, frfs, modes, uncertain
from dovetail.report.shown import Shown
from dovetail.report.small_print import about, assumptions, notes
from dovetail.result import RunResult
from fem.io.atomic import replacing


def write_report(result: RunResult, album: Album, path: Path) -> None:
    """Write the report with its interactive figures atomically."""
    figures = make_all(result)
    with replacing(path) as scratch:
        scratch.write_text(report_html(result, album, figures), encoding="utf-8")


def report_html(result: RunResult, album: Album, figures: Figures | None = None) -> str:
    """Return the report as one HTML page that loads nothing else; without figures it has pictures alone."""
    shown = Shown(album, figures or Figures())
    return report_page(report(result, shown), shown.scripts())


def report(result: RunResult, shown: Shown) -> Report:
    """Return the report as blocks."""
    sections = [
        check_first(result),
        how_sure(result),
        compared(result),
        gates(result),
        misfit(result, shown),
        missing(result, shown),
        search(result, shown),
        frfs(result, shown),
        modes(result, shown),
        uncertain(result, "to the baseline" if result.diagnosis.baseline is not None else "in every step"),
        faults(result),
        notes(result, shown),
        assumptions(result),
        about(result),
    ]
    return Report(result.study.name, result.diagnosis.verdict, answer(result, shown), sections)
