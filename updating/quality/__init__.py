"""Checks of a measurement before any physics is fitted to it."""

from typing import TYPE_CHECKING

from fem.lazy import names_on_use

if TYPE_CHECKING:
    from updating.quality.corrections import (
        combined,
        corrected,
        mirrored,
        mirrored_fault,
        set_right,
        uncorrected,
    )
    from updating.quality.cross_prediction import Field, cross_predict
    from updating.quality.fault_hypotheses import valued
    from updating.quality.gates import reciprocity_check, with_last_faults
    from updating.quality.phase import LEAST_RINGING, driven_points, misphased, phase_evidence
    from updating.quality.sensor_faults import best_azimuth
    from updating.quality.signs import log_odds, reversed_channels
else:
    __getattr__, __dir__ = names_on_use(__name__)
