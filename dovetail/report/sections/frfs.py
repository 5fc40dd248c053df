"""FRFs before and after."""

from dovetail.report import words
from dovetail.report.blocks import ReportSection, Text
from dovetail.report.drawn import FRF_ERROR
from dovetail.report.page import Markup, join, tag
from dovetail.report.shown import Shown, choice
from dovetail.result import FrfResult, by_frfs

applies = by_frfs


def page(result: FrfResult, shown: Shown) -> ReportSection:
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
