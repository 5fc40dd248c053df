"""Where the model fails: by sensor, by band, by place."""

import numpy as np

from dovetail.report import cells, words
from dovetail.report.blocks import Block, Details, Heading, Plot, ReportSection, TableBlock, Text
from dovetail.report.drawn import LEAST_SHARE
from dovetail.report.shown import TURN, Shown
from dovetail.result import FrfResult, by_frfs, least_frac

applies = by_frfs


def page(result: FrfResult, shown: Shown) -> ReportSection:
    """Return the error by sensor and by band, and places where a change would help."""
    text = (
        "The model with fitted uncertain parameters, before any effect is added. A complete model is "
        "equally good everywhere; a missing effect shows near it, or in the modes that strain it."
    )
    what = "sensors coloured by their error"
    if result.localisation is not None and result.localisation.says_where:
        what += "; members, joints and supports by the share of it that a change there would explain"
    alt, caption = f"The structure, {what}.", f"{what.capitalize()}."
    after = [shown.album["misfit-final"], _map(shown, "final", "with the found effects")]
    blocks = [
        Text(text),
        shown.figure("misfit", alt, caption, ["misfit-fitted"], hint=TURN),
        _map(shown, "fitted", "once the uncertain parameters are fitted"),
        *_shares(result),
        Details("The same with the found effects", after),
        Details("Error of each sensor", [_sensor_errors(result)]),
    ]
    return ReportSection("Where it fails", blocks)


def _map(shown: Shown, name: str, what: str) -> Plot:
    return shown.figure(
        f"map-{name}",
        f"Map of the error of each sensor in each band, {what}; the table of sensors below has the numbers.",
        f"Error of each sensor in each band, {what}. A click on a cell shows the sensor's FRFs below.",
        [f"misfit-bands-{name}"],
    )


def _shares(result: FrfResult) -> list[Block]:
    where = result.localisation
    if where is None:
        return []
    shares = [*((f"member {m}", s) for m, s in where.members.items()), *where.places]
    shares = sorted((each for each in shares if each[1] >= LEAST_SHARE), key=lambda t: -t[1])
    rows = [[words.place(name), f"{100 * s:.0f}"] for name, s in shares]
    table = TableBlock(["place", "share of the misfit [%]"], rows, numbers=(1,), at_most=8)
    shown = [table] if where.says_where else []
    return [Heading("Where a change would help"), *shown, Text(where.note)]


def _sensor_errors(result: FrfResult) -> TableBlock:
    first, last = result.comparisons[0], result.comparisons[-1]
    middle = result.comparisons[min(1, len(result.comparisons) - 1)]
    columns = [c.by_sensor() for c in (first, middle, last)]
    frac = least_frac(last)
    order = np.argsort(-np.nan_to_num(columns[1]), kind="stable")
    rows = [
        [first.outputs[i], *(cells.decimals(float(c[i])) for c in columns), cells.number(float(frac[i]), 3)]
        for i in order
    ]
    head = ["sensor", "nominal [dB]", "fitted [dB]", "final [dB]", "lowest final FRAC [-]"]
    return TableBlock(head, rows, numbers=(1, 2, 3, 4))
