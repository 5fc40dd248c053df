"""FRFs, modes, uncertain parameters and faults, before and after."""

import math
from dataclasses import replace

from dovetail.report import cells, words
from dovetail.report.blocks import Block, Group, Line, ReportMark, ReportSection, TableBlock, Text
from dovetail.report.drawn import FRF_ERROR
from dovetail.report.page import Markup, join, tag
from dovetail.report.sections import measured_modes
from dovetail.report.shown import TURN, Shown, choice
from dovetail.result import FrfResult, RunResult, UncertainValue, by_frfs
from updating.diagnosis.verdict import Verdict


def frfs(result: FrfResult, shown: Shown) -> ReportSection:
    """Return the FRFs: any of them where a script runs, the telling ones else."""
    known = result.diagnosis.measured
    tools = join(
        [
            choice("response", known.outputs, values=True),
            choice("force", known.inputs, values=True),
            tag("button", "←", type="button", data_step="-1", aria_label="previous FRF"),
            tag("button", "→", type="button", data_step="1", aria_label="next FRF"),
            tag("label", Markup('<input type="checkbox">'), "logarithmic frequency"),
            tag("output", aria_live="polite"),
        ]
    )
    every = shown.figures.data.get("frf", {}).get("every", 1)
    alt = f"{words.frf_parts(result.diagnosis)} of one FRF, measured and computed; the lists above choose "
    caption = (
        f"Any of the {len(known.outputs) * len(known.inputs)} FRFs: measured, with the models of each "
        "step, and with the best other candidate. A click on a name in the legend hides its curve."
    )
    caption += f" Of the lines every {every}th is drawn." if every > 1 else ""
    names = [name for name in shown.album.pictures if name.startswith("frf-") and name != "frf-error"]
    text = "Sensors and forces are corrected as in the table of faults." if result.diagnosis.faults else ""
    blocks = [
        Text(text),
        shown.figure("frf-error", FRF_ERROR.partition(";")[0] + ".", FRF_ERROR, ["frf-error"]),
        shown.figure("frf", f"{alt}response and force.", caption, names, tools=tools),
    ]
    return ReportSection("FRFs before and after", blocks)


def modes(result: RunResult[Verdict], shown: Shown) -> ReportSection:
    """Return natural frequencies, measured and before and after, and the mode shapes."""
    arrows = ""
    if result.reported is not None and result.reported.mac is not None:
        arrows = (
            "Arrows show the measured shape, scaled to the mode. Rings show where the model puts their tips."
        )
    blocks = [*measured_modes.page(result, shown), *_before_and_after(result)]
    if by_frfs(result.diagnosis) and result.diagnosis.problem.data.phase:
        arrows = (
            "Arrows show the measured motion at the line nearest to the natural frequency, in quadrature and "
            "scaled to the mode; neighbouring modes take part in it. Rings show where the model puts the "
            "arrows' tips."
        )
    return ReportSection("Natural frequencies and mode shapes", [*blocks, *shapes(shown, arrows)])


def _before_and_after(result: RunResult[Verdict]) -> list[Block]:
    """Return the modes in the band of FRFs, of the nominal and of the reported model."""
    if not by_frfs(result.diagnosis):
        return []
    rows = []
    for k, m in enumerate(result.modes, 1):
        change, mac = cells.shift(m.nominal, m.fitted), cells.decimals(m.mac, 3)
        damping = (cells.number(100 * zeta, 3) for zeta in (m.nominal_zeta, m.fitted_zeta))
        rows.append([k, cells.number(m.nominal, 5), cells.number(m.fitted, 5), change, *damping, mac])
    head = ["elastic mode", "nominal [Hz]", "fitted [Hz]", "change [%]"]
    head += ["damping nominal [%]", "damping fitted [%]", "MAC [-]"]
    what = " and found effects" if result.diagnosis.findings else ""
    grows = (
        " A frequency below zero is that of a motion that grows: members are under more compression than "
        "they bear in the model, where forces keep their direction."
        if any(f < 0 for m in result.modes for f in (m.nominal, m.fitted))
        else ""
    )
    text = (
        f"Undamped modes in the band, of the nominal model and of that with fitted parameters{what}, "
        "paired by their shapes. Damping is the fitted curve and the part of local dampers in each "
        f"mode.{grows}"
    )
    return [Text(text), TableBlock(head, rows, numbers=range(7), at_most=15)]


def shapes(shown: Shown, arrows: str = "") -> list[Block | None]:
    """Return the modes that move; still shapes, and the most changed one, where no script runs.

    ``arrows`` says what arrows and rings in the figure show.
    """
    album = shown.album
    names = [n for n in album.pictures if n.startswith("mode-") and n != "mode-changed"]
    if "modes" not in shown.figures.known:
        changed = album["mode-changed"]
        pair = Group("pair", [album[n] for n in names])
        return [replace(changed, style="small") if changed else None, pair]
    listed = [m["label"] for m in shown.figures.known["modes"].layout.meta["modes"]]
    play = tag("button", "Play", type="button", aria_pressed="false")
    caption = f"Mode shapes of the fitted model, coloured by displacement over the outline at rest. {arrows}"
    alt = "Mode shapes of the fitted model; the list above chooses one."
    tools = choice("mode", listed) + play
    return [shown.figure("modes", alt, caption.strip(), names, tools=tools, hint=TURN)]


def uncertain(result: RunResult[Verdict], shown: Shown) -> ReportSection:
    """Return the uncertain parameters before and after the fit."""
    d = result.diagnosis
    fitted = (
        "to the baseline" if d.baseline is not None else "in every step" if by_frfs(d) else "with the effects"
    )
    bound = sum(u.at_bound for u in result.uncertain)
    text = (
        f" {bound} of them end at the edge of the allowed range, four prior standard deviations from "
        "nominal: doubt the nominal value, or widen it."
        if bound
        else ""
    )
    head = ["parameter", "nominal", "fitted ± std", "change [prior std]", "prior std [%]", ""]
    table = TableBlock(head, list(map(_parameter_row, result.uncertain)), numbers=(1, 2, 3, 4), at_most=25)
    text = f"Fitted {fitted} within their prior standard deviations.{text}"
    return ReportSection("Uncertain parameters", [Text(text), table])


def _parameter_row(u: UncertainValue) -> list[Line]:
    value, change = "replaced by the effect", "–"
    if math.isfinite(u.fitted):
        value = words.with_unit(u.fitted, u.unit, math.nan if u.at_bound else u.std)
        if math.isfinite(u.moved):
            change = f"{round(u.moved, 1) + 0.0:+.1f}".replace("-", "−")
    flag = ReportMark("at bound", "tag bound") if u.at_bound else ""
    prior = cells.percent(u.prior_std, u.nominal)
    return [u.words, words.with_unit(u.nominal, u.unit), value, change, prior, flag]


def faults(result: FrfResult, shown: Shown) -> ReportSection:
    """Return the faults of the measurement and their remedies."""
    d, known = result.diagnosis, result.diagnosis.every_fault
    none = (
        "None was found: each sensor's FRFs agree with the motion that the others imply at its place, and "
        "signs and levels of the forces agree."
    )
    corrected = "The measured FRFs were corrected for those marked so." if d.faults else ""
    fitted = (
        "Errors beyond the tolerance of a channel were fitted with the model instead; the measured FRFs are "
        "as they were read."
        if d.channel_faults
        else ""
    )
    some = f"{corrected} {fitted} A gain is the factor of the reading: measured = gain × true value."
    rows = [
        [
            f.sensor,
            words.FAULT_NAMES[f.kind],
            words.fault_value(f),
            words.tolerance_text(f) or "corrected",
            words.fault_remedy(f),
        ]
        for f in known
    ]
    table = TableBlock(["sensor or force", "fault", "value", "", "remedy"], rows, numbers=(2,))
    return ReportSection("Faults of the measurement", [Text(some.strip()), table] if known else [Text(none)])
