"""Natural frequencies and mode shapes, measured, before and after."""

import math
from dataclasses import replace

from dovetail.report import cells
from dovetail.report.blocks import Block, Group, ReportSection, TableBlock, Text
from dovetail.report.page import tag
from dovetail.report.sections import measured_modes
from dovetail.report.shown import TURN, Shown, choice
from dovetail.result import RunResult, by_any, by_frfs
from updating.diagnosis.verdict import Verdict

applies = by_any


def page(result: RunResult[Verdict], shown: Shown) -> ReportSection:
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
    two = result.diagnosis.baseline is not None
    first, last = ("before", "after") if two else ("nominal", "fitted")
    head = ["elastic mode", f"{first} [Hz]", f"{last} [Hz]", "change [%]"]
    head += [f"damping {first} [%]", f"damping {last} [%]", "MAC [-]"]
    what = " and found effects" if result.diagnosis.findings else ""
    grows = (
        " A frequency below zero is that of a motion that grows: members are under more compression than "
        "they bear in the model, where forces keep their direction."
        if any(f < 0 for m in result.modes for f in (m.nominal, m.fitted))
        else ""
    )
    start = "calibrated" if two else "nominal"
    text = (
        f"Undamped modes in the band, of the {start} model and of that with fitted parameters{what}, "
        "paired by their shapes. Damping is the fitted curve and the part of local dampers in each "
        f"mode.{grows}"
    )
    return [*_states(result), Text(text), TableBlock(head, rows, numbers=range(7), at_most=15)]


def _states(result: RunResult[Verdict]) -> list[Block]:
    """Return the frequencies identified in the FRFs of two states beside those of the models."""
    if result.states is None:
        return []
    before, after = result.states
    modes = [
        (
            k,
            (before.get(m.nominal_index, math.nan), after.get(m.index, math.nan)),
            (m.nominal, m.fitted),
        )
        for k, m in enumerate(result.modes, 1)
    ]
    return [measured_modes.states_table(modes)]


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
