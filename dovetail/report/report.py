"""The report: one HTML file with everything in it, for an engineer who has not seen the study before."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from dovetail.report.answer import answer, how_sure
from dovetail.report.blocks import Report, ReportSection
from dovetail.report.compared import check_first, compared, gates
from dovetail.report.drawings import Album, Figures
from dovetail.report.figures import make_all
from dovetail.report.misfit import misfit
from dovetail.report.missing import measure_next, missing, places, poor_baseline
from dovetail.report.page import report_page
from dovetail.report.responses import faults, frfs, modes, uncertain
from dovetail.report.sections import rounds
from dovetail.report.shown import Shown
from dovetail.report.small_print import about, assumptions, notes
from dovetail.result import RunResult, by_frfs, by_modes_alone
from fem.io.atomic import replacing
from updating.diagnosis.verdict import Verdict


def _always(d: Verdict) -> bool:
    return True


SECTIONS: tuple[tuple[Callable[[Verdict], bool], Callable[[RunResult[Any], Shown], ReportSection]], ...] = (
    (_always, check_first),
    (by_modes_alone, poor_baseline),
    (_always, how_sure),
    (_always, compared),
    (by_frfs, gates),
    (by_frfs, misfit),
    (_always, missing),
    (by_frfs, rounds.page),
    (by_frfs, frfs),
    (_always, modes),
    (_always, uncertain),
    (by_modes_alone, places),
    (_always, measure_next),
    (by_frfs, faults),
    (_always, notes),
    (_always, assumptions),
    (_always, about),
)
"""Sections in their order, each with what tells whether it applies; an empty one is left out."""


def write_report(result: RunResult[Verdict], album: Album, path: Path) -> None:
    """Write the report with its interactive figures atomically."""
    figures = make_all(result)
    with replacing(path) as scratch:
        scratch.write_text(report_html(result, album, figures), encoding="utf-8")


def report_html(result: RunResult[Verdict], album: Album, figures: Figures | None = None) -> str:
    """Return the report as one HTML page that loads nothing else; without figures it has pictures alone."""
    shown = Shown(album, figures or Figures())
    return report_page(report(result, shown), shown.scripts())


def report(result: RunResult[Verdict], shown: Shown) -> Report:
    """Return the report as blocks."""
    sections = [make(result, shown) for applies, make in SECTIONS if applies(result.diagnosis)]
    return Report(result.study.name, result.diagnosis.verdict, answer(result, shown), sections)
