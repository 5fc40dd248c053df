"""FRFs, modes, uncertain parameters and faults, before and after."""

import math
from collections.abc import Sequence

import numpy as np

from dovetail.mode_result import ModeRunResult
from dovetail.report import cells, words
from dovetail.report.page import Markup, join, paragraph, section, table, tag
from dovetail.report.shown import TURN, Shown
from dovetail.result import RunResult, Uncertain


def frfs(result: RunResult, shown: Shown) -> Markup:
    """Return the FRFs: any of them where a script runs, the telling ones else."""
    known = result.diagnosis.measured
    tools = join(
        [
            _choice("response", known.outputs),
            _choice("force", known.inputs),
            tag("button", "←", type="button", data_step="-1", aria_label="previous FRF"),
            tag("button", "→", type="button", data_step="1", aria_label="next FRF"),
            tag("label", Markup('<input type="checkbox">'), "logarithmic frequency"),
            tag("output", aria_live="polite"),
        ]
    )
    every = shown.figures.data.get("frf", {}).get("every", 1)
    figures = [
        shown.figure(
            "frf-error",
            "Relative error of all FRFs together over frequency.",
            "Relative error of all FRFs together over frequency; 0 dB is an error as large as the response "
            "itself.",
            ["frf-error"],
        ),
        shown.figure(
            "frf",
            f"{words.frf_parts(result.diagnosis)} of one FRF, measured and computed; the lists above choose "
            "response and force.",
            f"Any of the {len(known.outputs) * len(known.inputs)} FRFs: measured, with the models of each "
            "step, and with the best other candidate. A click on a name in the legend hides its curve."
            + (f" Of the lines every {every}th is drawn." if every > 1 else ""),
            [name for name in shown.album.pictures if name.startswith("frf-") and name != "frf-error"],
            tools=tools,
        ),
    ]
    text = "Sensors and forces are set right as in the table of faults." if result.diagnosis.faults else ""
    return section("FRFs before and after", *([paragraph(text)] if text else []), *figures)


def _choice(word: str, names: Sequence[str]) -> Markup:
    return tag("label", word, tag("select", *(tag("option", n, value=n) for n in names)))


def modes(result: RunResult, shown: Shown) -> Markup:
    """Return natural frequencies before and after, and the mode shapes."""
    rows = [
        [
            k + 1,
            cells.number(m.nominal, 5),
            cells.number(m.fitted, 5),
            cells.shift(m.nominal, m.fitted),
            cells.number(100 * m.nominal_zeta, 3),
            cells.number(100 * m.fitted_zeta, 3),
            f"{m.mac:.3f}" if math.isfinite(m.mac) else "–",
        ]
        for k, m in enumerate(result.modes)
    ]
    head = [
        "elastic mode",
        "nominal [Hz]",
        "fitted [Hz]",
        "change [%]",
        "damping nominal [%]",
        "damping fitted [%]",
        "MAC [-]",
    ]
    what = " and found effects" if result.diagnosis.findings else ""
    grows = (
        " A frequency below zero is that of a motion that grows: members are under more compression than "
        "they bear in the model, where forces keep their direction."
        if any(f < 0 for m in result.modes for f in (m.nominal, m.fitted))
        else ""
    )
    arrows = (
        "Arrows show the measured motion at the line nearest to the natural frequency, in quadrature and "
        "scaled to the mode; neighbouring modes take part in it. Rings show where the model puts the "
        "arrows' tips."
        if result.diagnosis.problem.data.phase
        else ""
    )
    return section(
        "Natural frequencies and mode shapes",
        *_measured_modes(result),
        paragraph(
            f"Undamped modes in the band, of the nominal model and of that with fitted parameters{what}, "
            "paired by their shapes. Damping is the fitted curve and the part of local dampers in each "
            f"mode.{grows}"
        ),
        table(head, rows, numbers=range(7), at_most=15),
        shapes(shown, arrows),
    )


def _measured_modes(result: RunResult) -> list[Markup]:
    """Return the measured modes beside those of each step, where the study has any beside its FRFs."""
    m = result.measured_modes
    if m is None:
        return []
    shaped = any(np.isfinite(mac).any() for mac in m.mac.values())
    head = ["measured [Hz]", "std [%]", *(f"{step} [%]" for step in m.computed)]
    head += ["MAC in the end"] if shaped else []
    last = list(m.computed)[-1]
    rows = [
        [
            f"{f:.5g}", f"{100 * m.std[k]:.2g}", *(cells.shift(f, g[k]) for g in m.computed.values()),
            *([cells.number(m.mac[last][k], 3)] if shaped else []),
            "predicted" if m.held_out[k] else "fitted",
        ]
        for k, f in enumerate(m.measured)
    ]  # fmt: skip
    errors = [
        [step, *(cells.number(100 * m.error(step, held), 2) for held in (False, True))] for step in m.computed
    ]
    return [
        table([*head, ""], rows, numbers=range(len(head)), caption="Measured modes", at_most=25),
        table(
            ["step", "fitted modes [%]", "held-out modes [%]"], errors, numbers=(1, 2),
            caption="Root mean square of ln(f computed / f measured)",
        ),
    ]  # fmt: skip


def shapes(shown: Shown, arrows: str = "") -> Markup:
    """Return the modes that move; still shapes, and the one that changes most, where no script runs.

    ``arrows`` says what arrows and rings in the figure show.
    """
    names = [n for n in shown.album.pictures if n.startswith("mode-") and n != "mode-changed"]
    if "modes" not in shown:
        pairs = tag("div", *(shown.picture(n) for n in names), class_="pair") if names else ""
        return join([shown.picture("mode-changed", "small"), pairs])
    listed = [m["label"] for m in shown.figures.known["modes"].layout.meta["modes"]]
    tools = join(
        [
            tag("label", "mode", tag("select", *(tag("option", label) for label in listed))),
            tag("button", "Play", type="button", aria_pressed="false"),
        ]
    )
    return shown.figure(
        "modes",
        "Mode shapes of the fitted model; the list above chooses one.",
        "Mode shapes of the fitted model, coloured by displacement over the outline at rest. "
        f"{arrows}".strip(),
        names,
        tools=tools,
        hint=TURN,
    )


def uncertain(result: RunResult | ModeRunResult, fitted: str = "in every step") -> Markup:
    """Return the uncertain parameters before and after the fit; ``fitted`` says to or with what."""
    rows = [[u.words, *_parameter_row(u)] for u in result.uncertain]
    bound = sum(u.at_bound for u in result.uncertain)
    text = (
        f" {bound} of them end at the edge of the allowed range, four prior standard deviations from "
        "nominal: doubt the nominal value, or widen it."
        if bound
        else ""
    )
    return section(
        "Uncertain parameters",
        paragraph(f"Fitted {fitted} within their prior standard deviations.{text}"),
        table(
            ["parameter", "nominal", "fitted ± std", "change [prior std]", "prior std [%]", ""],
            rows,
            numbers=(1, 2, 3, 4),
            at_most=25,
        ),
    )


def _parameter_row(u: Uncertain) -> list[object]:
    flag = tag("span", "at bound", class_="tag bound") if u.at_bound else ""
    if not math.isfinite(u.fitted):
        return [
            words.with_unit(u.nominal, u.unit),
            "replaced by the effect",
            "–",
            cells.percent(u.prior_std, u.nominal),
            flag,
        ]
    return [
        words.with_unit(u.nominal, u.unit),
        words.with_unit(u.fitted, u.unit, math.nan if u.at_bound else u.std),
        f"{round(u.moved, 1) + 0.0:+.1f}".replace("-", "−") if math.isfinite(u.moved) else "–",
        cells.percent(u.prior_std, u.nominal),
        flag,
    ]


def faults(result: RunResult) -> Markup:
    """Return the faults of the measurement and their remedies."""
    known = result.diagnosis.faults
    if not known:
        return section(
            "Faults of the measurement",
            paragraph(
                "None was found: each sensor's FRFs agree with the motion that the others imply at its "
                "place, and signs and levels of the forces agree."
            ),
        )
    rows = [[f.sensor, words.FAULT_NAMES[f.kind], words.fault_value(f), words.fault_remedy(f)] for f in known]
    return section(
        "Faults of the measurement",
        paragraph(
            "These sensors and forces were set right before effects were searched for. A gain is the "
            "factor of the reading: measured = gain × true value."
        ),
        table(["sensor or force", "fault", "value", "remedy"], rows, numbers=(2,)),
    )
