"""Measurements: FRFs with sensors, their estimation from time data, noise, and the plan of a test."""

from typing import TYPE_CHECKING

from fem.lazy import names_on_use

if TYPE_CHECKING:
    from updating.measurement.channel_errors import USUAL
    from updating.measurement.held_out import band_of, band_text, held_out_lines
    from updating.measurement.measurement import (
        MOTION,
        Combination,
        at_values_of,
        instruments_on,
        motions_of,
        shapes_like_motions,
        with_resting_base,
    )
    from updating.measurement.strain_gauge import SHORT
else:
    __getattr__, __dir__ = names_on_use(__name__)
