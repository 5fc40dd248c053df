"""Modes in the FRFs of a measurement, and in those that a diagnosis compared."""

import warnings
from dataclasses import dataclass
from typing import Any

from fem.model import Model
from updating.inference.fit import FitProblem
from updating.measurement.measurement import Measurement, at_one_place, references_of
from updating.modal.identification import IdentificationError, identify_modes
from updating.modal.identified_modes import IdentifiedModes


@dataclass(frozen=True, slots=True, eq=False)
class FrfModes:
    """Modes identified in FRFs, and the measurement whose sensors their shapes have."""

    found: IdentifiedModes
    measurement: Measurement


def identified_in(problem: FitProblem, **limits: Any) -> FrfModes | None:
    """Return the modes in the FRFs that a problem compares, as they were corrected for faults.

    None where the FRFs lack phase, or the poles of the structure as those over a reference sensor do, or no
    mode stands out.

    Parameters
    ----------
    problem : FitProblem
    **limits : float
        How complex shapes may be, as for :func:`updating.modal.identification.identify_modes`.
    """
    frf = problem.measured
    data = with_more_sensors(problem.data.measurement.with_frf(frf), problem.reduced.model)
    if not frf.has_phase or not data.has_structure_poles:
        return None
    try:
        found, _ = modes_in(data, **limits)
    except IdentificationError:
        return None
    return FrfModes(found, data)


def with_more_sensors(data: Measurement, model: Model) -> Measurement:
    """Return a measurement whose shapes are of the side with more places, by reciprocity.

    The FRFs of a roving hammer are the motions of its places for a force at the sensor.
    """
    turn = data.moving_forces and data.has_transpose and all(e.reciprocal for e in model.effects)
    return data.transposed() if turn else data


def modes_in(
    data: Measurement, band: tuple[float, float] | None = None, **limits: Any
) -> tuple[IdentifiedModes, tuple[str, ...]]:
    """Return the modes in a measurement's FRFs, and the warnings of the identification.

    Parameters
    ----------
    data : Measurement
    band : (float, float), optional
        Lowest and highest frequency; all unless given [Hz].
    **limits : float
        How complex shapes may be, as for :func:`updating.modal.identification.identify_modes`.

    Raises
    ------
    IdentificationError
        For data that do not allow it.
    """
    if not data.has_structure_poles:
        refer = ", ".join(s.name for s in references_of(data.excitations))
        msg = (
            f"the FRFs of {data.name} refer to {refer}: their peaks are where that does not move, not the "
            "natural frequencies; FRFs per force, or to a moving base, have modes"
        )
        raise IdentificationError(msg)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        found = identify_modes(data.frf, band=band, driving=_driving(data), **limits)
    return found, tuple(dict.fromkeys(str(w.message) for w in caught))


def _driving(m: Measurement) -> list[tuple[str, str]] | None:
    """Return responses and forces at one place and in one direction; None where labels may tell."""
    pairs = [
        (s.name, e.name)
        for s in m.sensors
        for e in m.excitations
        if at_one_place(s, e, 1e-9) > 0 and s.direction @ e.direction > 1 - 1e-9
    ]
    return pairs or None
