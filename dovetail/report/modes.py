"""The report of a diagnosis from modes: verdict, explanations, and measured beside computed modes."""

import numpy as np

from dovetail.mode_result import ModeRunResult
from dovetail.report.answer import CLASS
from dovetail.report.page import Markup, bullets, page, paragraph, section, table, tag
from dovetail.report.words import explanation_text
from updating.diagnosis.mode_diagnosis import ModeTable


def report_html(done: ModeRunResult) -> str:
    """Return the report as one HTML page that loads nothing else."""
    d, study = done.diagnosis, done.study
    box = tag(
        "div",
        tag("p", f"Verdict: {d.verdict}", class_="kind"),
        tag("p", f"{d.reason[:1].upper()}{d.reason[1:]}.", class_="sentence"),
        class_=f"verdict {CLASS.get(d.verdict, 'unexplained')}",
    )
    more = [tag("p", study.description)] if study.description else []
    head = tag("header", tag("h1", study.name), *more, box)
    parts = [_explanations(done), _modes(d.modes), _places(done), _next(done), _notes(done)]
    return page(f"{study.name}: {d.verdict}", head, tag("main", *parts, id="body"))


def _explanations(done: ModeRunResult) -> Markup:
    rows = [[explanation_text(e), f"{e.probability:.2f}"] for e in done.diagnosis.credible]
    return section(
        "What may be missing",
        paragraph("The fewest explanations that have a probability of 90 % together."),
        table(["explanation", "probability"], rows, numbers=[1]),
    )


def _modes(m: ModeTable) -> Markup:
    rows = []
    for k, f in enumerate(m.measured):
        off = [
            f"{100 * (g[k] / f - 1):+.2f}" if np.isfinite(g[k]) else "-"
            for g in (m.nominal, m.fitted, m.found)
        ]
        mac = [f"{x[k]:.3f}" if np.isfinite(x[k]) else "-" for x in (m.mac_nominal, m.mac_found)]
        zeta = [f"{100 * x[k]:.2f}" if np.isfinite(x[k]) else "-" for x in (m.zeta, m.zeta_found)]
        role = "predicted" if m.held_out[k] else "fitted"
        rows.append([f"{f:.5g}", f"{100 * m.std[k]:.2g}", *off, *mac, *zeta, role])
    head = [
        "measured [Hz]", "std [%]", "nominal [%]", "parameters fitted [%]", "with what was found [%]",
        "MAC nominal", "MAC found", "damping measured [%]", "damping found [%]", "",
    ]  # fmt: skip
    seen, held = (
        ", ".join(
            f"{name} {100 * m.errors(f, held):.2g} %"
            for name, f in (("nominal", m.nominal), ("fitted", m.fitted), ("found", m.found))
        )
        for held in (False, True)
    )
    text = f"Errors of frequencies, root mean square: {seen}."
    if m.held_out.any():
        text += f" Of the modes that no fit has seen: {held}."
    return section("Modes", paragraph(text), table(head, rows, numbers=range(9)))


def _places(done: ModeRunResult) -> Markup:
    rows = [[name, f"{left:.2f}"] for name, left in done.diagnosis.places[:20]]
    if not rows:
        return Markup()
    return section(
        "Where",
        paragraph("The share of the misfit that changes at a place leave; small is likely."),
        table(["place", "misfit left"], rows, numbers=[1], at_most=8),
    )


def _next(done: ModeRunResult) -> Markup:
    proposals = done.diagnosis.next_measurements
    if not proposals:
        return Markup()
    return section(
        "What to measure next", paragraph("To tell the first two explanations apart:"), bullets(proposals)
    )


def _notes(done: ModeRunResult) -> Markup:
    notes = [*done.diagnosis.notes, *done.study.warnings, *done.study.assumptions, *done.study.measured_notes]
    return section("Notes", bullets(notes)) if notes else Markup()
