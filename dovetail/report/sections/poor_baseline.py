"""The first of two states, where the calibrated model does not explain it."""

import math

from dovetail.report import words
from dovetail.report.blocks import ReportSection, TableBlock, Text
from dovetail.report.shown import Shown
from dovetail.result import RunResult, by_modes_alone
from fem.summary import percent
from updating.diagnosis.mode_diagnosis import ModeDiagnosis

applies = by_modes_alone


def page(result: RunResult[ModeDiagnosis], shown: Shown) -> ReportSection:
    """Return what the first of two states says of the model, where that does not explain it."""
    judged = result.diagnosis.judged
    if judged is None or judged.diagnosis is None:
        return ReportSection("", ())
    off = judged.first.missed
    modes = [
        [f"{k + 1}", f"{f:.5g}", f"{off[k]:+.1f}" if math.isfinite(off[k]) else "–"]
        for k, f in enumerate(judged.first.problem.targets.frequency)
    ]
    causes = [
        [words.explanation_text(c, result.diagnosis.model), percent(c.probability)] for c in judged.causes
    ]
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
