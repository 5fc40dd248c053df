"""Faults of the measurement and their remedies."""

from dovetail.report import words
from dovetail.report.blocks import ReportSection, TableBlock, Text
from dovetail.report.shown import Shown
from dovetail.result import FrfResult, by_frfs

applies = by_frfs


def page(result: FrfResult, shown: Shown) -> ReportSection:
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
