"""The report: one HTML file with everything in it, for an engineer who has not seen the study before."""

from pathlib import Path
from typing import Any

from dovetail.report.answer import answer
from dovetail.report.blocks import Report
from dovetail.report.drawings import Album, Figures
from dovetail.report.figures import make_all
from dovetail.report.page import report_page
from dovetail.report.sections import (
    about,
    assumptions,
    check_first,
    compared,
    faults,
    frfs,
    gates,
    how_sure,
    measure_next,
    misfit,
    missing,
    modes,
    notes,
    places,
    poor_baseline,
    rounds,
    uncertain,
)
from dovetail.report.shown import Shown
from dovetail.result import RunResult
from fem.io.atomic import replacing
from updating.diagnosis.verdict import Verdict

SECTIONS = (
    check_first,
    poor_baseline,
    how_sure,
    compared,
    gates,
    misfit,
    missing,
    rounds,
    frfs,
    modes,
    uncertain,
    places,
    measure_next,
    faults,
    notes,
    assumptions,
    about,
)
"""Sections in their order: each tells whether it applies to a verdict; an empty one is left out."""


def write_report(result: RunResult[Verdict], album: Album, path: Path) -> None:
    """Write the report with its interactive figures atomically."""
    figures = make_all(result)
    with replacing(path) as scratch:
        scratch.write_text(report_html(result, album, figures), encoding="utf-8")


def report_html(result: RunResult[Verdict], album: Album, figures: Figures | None = None) -> str:
    """Return the report as one HTML page that loads nothing else; without figures it has pictures alone."""
    shown = Shown(album, figures or Figures())
    return report_page(report(result, shown), shown.scripts())


def report(result: RunResult[Any], shown: Shown) -> Report:
    """Return the report as blocks."""
    sections = [section.page(result, shown) for section in SECTIONS if section.applies(result.diagnosis)]
    return Report(result.study.name, result.diagnosis.verdict, answer(result, shown), sections)
