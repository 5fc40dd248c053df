"""Modes identified in the FRFs of a measurement, as a study's measured modes."""

import warnings
from dataclasses import asdict, replace

from dovetail.file.measured_modes import MeasuredModes, ShapeLimits
from dovetail.file.table import StudyError
from updating.measurement.measurement import Measurement, at_one_place, shapes_like_motions
from updating.modal.identification import identify_modes
from updating.modal.identified_modes import IdentifiedModes


def modes_in(
    data: Measurement, band: tuple[float, float] | None, limits: ShapeLimits
) -> tuple[IdentifiedModes, tuple[str, ...]]:
    """Return the modes in a measurement's FRFs, and the warnings of the identification.

    Parameters
    ----------
    data : Measurement
    band : (float, float) or None
        Lowest and highest frequency; all unless given [Hz].
    limits : ShapeLimits
        How complex shapes may be.

    Raises
    ------
    IdentificationError
        For data that do not allow it.
    """
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        found = identify_modes(data.frf, band=band, driving=_driving(data), **asdict(limits))
    return found, tuple(dict.fromkeys(str(w.message) for w in caught))


def as_measured(found: IdentifiedModes, data: Measurement) -> MeasuredModes:
    """Return identified modes as measured ones, with their standard deviations.

    Raises
    ------
    StudyError
        If there is none.
    """
    if not found.modes.n_modes:
        msg = (
            f"no mode could be identified from the FRFs of {data.name}; give [modes], or "
            'set to = "frf" in [update]'
        )
        raise StudyError(msg)
    f_std, shape_std = found.relative_std()
    shapes, sensors = shapes_like_motions(found.modes.shapes, data.sensors)
    modes = replace(found.modes, shapes=shapes)
    return MeasuredModes(modes, sensors, f_std, shape_std, f"FRFs of {data.name}")


def _driving(m: Measurement) -> list[tuple[str, str]] | None:
    """Return responses and forces at one place and in one direction; None where labels may tell."""
    pairs = [
        (s.name, e.name)
        for s in m.sensors
        for e in m.excitations
        if at_one_place(s, e, 1e-9) > 0 and s.direction @ e.direction > 1 - 1e-9
    ]
    return pairs or None
