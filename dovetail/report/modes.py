"""The report of a run on modes: that of FRFs, with natural frequencies and shapes in their place."""

import math
from pathlib import Path

import numpy as np

from dovetail.mode_result import ModeRunResult, mode_steps
from dovetail.report import cells, words
from dovetail.report.answer import first_screen, verdict_box
from dovetail.report.blocks import Facts, Items, Plot, Report, ReportSection, TableBlock, Text
from dovetail.report.compared import check_first, model_size
from dovetail.report.confidence import mode_confidence
from dovetail.report.mode_drawn import (
    DEVIATIONS,
    MAC,
    STAIRCASE,
    digits_of,
    hypotheses_by_modes,
    make_mode_figures,
    staircase_alt,
    step_errors,
)
from dovetail.report.page import report_page
from dovetail.report.pictures import Album
from dovetail.report.probable import probability_text
from dovetail.report.responses import shapes, uncertain
from dovetail.report.shown import TURN, Shown
from dovetail.report.small_print import MODULES_OF_MODES, about_modes, assumptions, notes
from fem.io.atomic import replacing
from fem.summary import percent
from updating.diagnosis.mode_diagnosis import ModeTable
from updating.diagnosis.reported_modes import ReportedModes

CORRECTED = (
    "Measured frequencies are those of the second state without what the calibrated model leaves on the "
    "baseline."
)


def write_report(result: ModeRunResult, drawn: ReportedModes, album: Album, path: Path) -> None:
    """Write the report with its interactive figures atomically."""
    shown = Shown(album, make_mode_figures(result, drawn))
    with replacing(path) as scratch:
        scratch.write_text(report_page(mode_report(result, shown), shown.scripts()), encoding="utf-8")


def mode_report(result: ModeRunResult, shown: Shown) -> Report:
    """Return the report on modes as blocks."""
    d = result.diagnosis
    sections = [
        check_first(result),
        _baseline(result),
        _how_sure(result),
        _compared(result),
        _explanations(result, shown),
        _modes(result, shown),
        uncertain(result, "to the baseline" if d.baseline is not None else "with the effects"),
        _places(result),
        _next(result),
        notes(result, shown),
        assumptions(result, MODULES_OF_MODES),
        about_modes(result),
    ]
    headline, values, doubts = (
        words.mode_headline(result),
        words.mode_values(d),
        [words.far_text(result.uncertain)],
    )
    box = verdict_box(d.verdict, headline, values, probability_text(d), d.reason, doubts)
    staircase = shown.figure("staircase", staircase_alt(d), STAIRCASE, ["staircase"])
    first = first_screen(result.study, box, staircase, _structure(result, shown))
    return Report(result.study.name, d.verdict, first, sections)


def _structure(result: ModeRunResult, shown: Shown) -> Plot:
    d = result.diagnosis
    found = ", ".join(words.effect_label(e.kind, e.where) for e in d.found)
    alt = "The structure" + (f"; marked: {found}" if found else "")
    caption = "The model with sections" + ("; rings mark what was found" if found else "")
    if len(d.credible) > 1:
        caption += "; diamonds mark the places of other explanations"
    return shown.figure("model", f"{alt}.", f"{caption}.", ["structure"], hint=TURN)


def _baseline(result: ModeRunResult) -> ReportSection:
    """Return what the first of two states says of the model, where that does not stand."""
    judged = result.diagnosis.judged
    if judged is None or judged.diagnosis is None:
        return ReportSection("", ())
    off = judged.first.missed
    modes = [
        [f"{k + 1}", f"{f:.5g}", f"{off[k]:+.1f}" if math.isfinite(off[k]) else "–"]
        for k, f in enumerate(judged.first.problem.targets.frequency)
    ]
    causes = [[words.explanation_text(c), percent(c.probability)] for c in judged.causes]
    text = (
        "The calibrated model does not explain the first state. Something may be missing in both states. "
        "The change was searched for with each of these causes in the model, and probabilities are sums "
        "over them."
    )
    caption = (
        "Frequencies of the calibrated model less the measured ones of the first state, in standard "
        "deviations of the measurement"
    )
    blocks = [
        Text(text),
        TableBlock(["missing in both states", "probability"], causes, numbers=(1,)),
        TableBlock(["mode", "measured [Hz]", "missed by [σ]"], modes, numbers=(0, 1, 2), caption=caption),
    ]
    return ReportSection("The baseline is poor", blocks)


def _how_sure(result: ModeRunResult) -> ReportSection:
    d, digits = result.diagnosis, digits_of(result.diagnosis)
    head = ["step", "fitted modes [%]", *(["held-out modes [%]"] if d.modes.held_out.any() else [])]
    rows = [
        [label, *(f"{e:.{digits}f}" if e is not None and math.isfinite(e) else "–" for e in errors)]
        for label, *errors in step_errors(d)
    ]
    text = (
        "Errors are root mean squares of ln(f computed / f measured). Hypotheses are ranked by their "
        "evidence; held-out modes do not count."
    )
    table = TableBlock(head, [row[: len(head)] for row in rows], numbers=(1, 2))
    return ReportSection("How sure", [Items(mode_confidence(result)), table, Text(text)])


def _compared(result: ModeRunResult) -> ReportSection:
    study = result.study
    rows = []
    for name, m in (("modes", study.modes), ("baseline", study.baseline)):
        if m is None:
            continue
        f, std, zeta = m.modes.frequency, 100 * m.frequency_std, m.modes.zeta
        spread = f"{std.min():.2g}" + (f" to {std.max():.2g}" if np.ptp(std) else "")
        damped = "yes" if zeta is not None and np.isfinite(zeta).any() else "no"
        sensors, held_out = len(m.sensors) if m.has_shapes else "–", ", ".join(map(str, m.held_out)) or "–"
        rows.append([name, m.name, len(f), f"{f[0]:.4g} to {f[-1]:.4g}", spread, damped, sensors, held_out])
    head = ["state", "data", "modes", "band [Hz]", "std of frequencies [%]", "damping", "sensors of shapes"]
    plane = study.modes.plane if study.modes else ""
    seen = [("motion that the test has seen", f"along {', '.join(plane)}")] if plane else []
    if study.modes is not None and not study.modes.has_shapes:
        by = (("sensors of the test", study.modes.sensors), ("forces of the test", study.modes.driven))
        seen += [(name, ", ".join(s.name for s in part)) for name, part in by if part]
    table = TableBlock([*head, "held out"], rows, numbers=(2, 6), caption="Measured modes")
    return ReportSection("Compared data", [table, Facts([*seen, ("model", model_size(study.model.mesh))])])


def _explanations(result: ModeRunResult, shown: Shown) -> ReportSection:
    d = result.diagnosis
    rows = [
        [f"{k}: {words.explanation_text(e)}", percent(e.probability)] for k, e in enumerate(d.credible, 1)
    ]
    figure = shown.figure(
        "probability",
        "Bars of the probability of each explanation; the table has the numbers.",
        "Probability of each explanation by the data and the priors, all of them together 100 %.",
    )
    text = (
        "Standard deviations are linearised and hold if the explanation is the right one; the uncertain "
        "parameters vary with it."
    )
    caption = "The fewest explanations that have a probability of 90 % together."
    table = TableBlock(["explanation", "probability"], rows, numbers=(1,), caption=caption, at_most=12)
    blocks = [figure if len(hypotheses_by_modes(d)) > 1 else None, table, Text(text)]
    return ReportSection("What has changed" if d.baseline is not None else "What may be missing", blocks)


def _modes(result: ModeRunResult, shown: Shown) -> ReportSection:
    m, steps = result.diagnosis.modes, mode_steps(result.diagnosis)
    damped, shaped = np.isfinite(m.zeta).any(), np.isfinite(m.mac_found).any()
    head = ["measured [Hz]", "std [%]", *(f"{label} [%]" for label in steps)]
    head += ["damping measured [%]", "damping computed [%]"] if damped else []
    head += ["MAC nominal", "MAC reported"] if shaped else []
    rows = []
    for k, f in enumerate(m.measured):
        row = [f"{f:.5g}", f"{100 * m.std[k]:.2g}", *(cells.shift(f, g[k]) for g in steps.values())]
        row += [cells.number(100 * x[k], 3) for x in (m.zeta, m.zeta_found)] if damped else []
        row += [cells.decimals(x[k], 3) for x in (m.mac_nominal, m.mac_found)] if shaped else []
        rows.append([*row, _role(m, k)])
    sensors = (
        "Arrows show the measured shape, scaled to the mode. Rings show where the model puts their tips."
        if shaped
        else ""
    )
    predicted = " Shaded modes were predicted, not fitted." if m.held_out.any() else ""
    alt = "Deviations of computed from measured natural frequencies, mode by mode; the table has the numbers."
    mac = shown.figure("mac", "Modal assurance criteria as a map.", MAC, ["mac"]) if shaped else None
    blocks = [
        Text(CORRECTED if result.diagnosis.baseline else ""),
        shown.figure("deviations", alt, DEVIATIONS + predicted, ["deviations"]),
        TableBlock([*head, ""], rows, numbers=range(len(head)), at_most=25),
        mac,
        *shapes(shown, sensors),
    ]
    return ReportSection("Natural frequencies and mode shapes", blocks)


def _role(m: ModeTable, k: int) -> str:
    """Return what a mode was to the diagnosis."""
    if not m.belongs[k]:
        return f"does not belong to the model: {percent(m.bad[k])}"
    if not m.held_out[k]:
        return "fitted"
    return f"predicted: {m.predicted_text(k)}" if math.isfinite(m.found_std[k]) else "predicted"


def _places(result: ModeRunResult) -> ReportSection:
    rows = [[words.place(name), f"{share:.2f}"] for name, share in result.diagnosis.places[:20]]
    text = Text("Share of the misfit that changes at a place leave: the smaller, the more likely.")
    table = TableBlock(["place", "remaining misfit [-]"], rows, numbers=(1,), at_most=8)
    return ReportSection("Where", [text, table] if rows else ())


def _next(result: ModeRunResult) -> ReportSection:
    proposals = result.diagnosis.next_measurements
    lead = "To distinguish the first two explanations:" if proposals else ""
    return ReportSection("What to measure next", [Text(lead), Items(proposals)])
