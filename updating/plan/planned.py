"""A test that has not been made yet, as data that its model would give."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from fem.analysis.frf import FRFKind
from fem.model import Model
from updating.inference.belief import DISCREPANCY_MIN
from updating.inference.fit import FitProblem
from updating.inference.fit_result import FitResult
from updating.inference.scatter import FormScatter, form_scatter
from updating.measurement.channel_errors import USUAL, ChannelErrors
from updating.measurement.computed import computed_frf
from updating.measurement.measurement import Measurement, Sensor

USUAL_NOISE = 0.01
"""Noise of a planned test, in parts of the root mean square of the FRFs of a force [-]."""


def planned_measurement(
    model: Model,
    sensors: Sequence[Sensor],
    excitations: Sequence[Sensor],
    frequency: ArrayLike,
    noise: float = USUAL_NOISE,
    kind: FRFKind | str = FRFKind.ACCELERANCE,
    errors: ChannelErrors = USUAL,
) -> Measurement:
    """Return the FRFs of a model as a measurement whose noise is known and was not drawn.

    Parameters
    ----------
    model : Model
    sensors, excitations : sequence of Sensor
    frequency : array_like (n_freq,)
        [Hz].
    noise : float
        Root mean square of the complex noise, the same at all sensors of a quantity, in parts of that of
        their FRFs of a force [-].
    kind : FRFKind or str
    errors : ChannelErrors

    Raises
    ------
    MeasurementError
        As :func:`updating.measurement.computed.computed_frf`.
    """
    frf = computed_frf(model, sensors, excitations, frequency, kind)
    size = np.abs(frf.H)
    rms = np.zeros(size.shape[1:])
    for alike in (frf.is_strain, ~frf.is_strain):
        if alike.any():
            rms[alike] = np.sqrt((size[:, alike] ** 2).mean(axis=(0, 1)))
    with np.errstate(divide="ignore", invalid="ignore"):
        scatter = np.where(size > 0, noise / np.sqrt(2) * rms / size, 0.0)
    # The ratio of a reference to itself is 1 by definition.
    refer = [e.reference_sensor() for e in excitations]
    itself = np.array([[r is not None and r.name == s.name for r in refer] for s in sensors], dtype=bool)
    compared = np.where(np.broadcast_to(itself, frf.H.shape), 0.0, np.nan) if itself.any() else None
    return Measurement(
        frf,
        tuple(sensors),
        tuple(excitations),
        name="planned",
        scatter=scatter,
        compared=compared,
        errors=errors,
    )


def planned_like(measurement: Measurement, model: Model) -> Measurement:
    """Return the planned test of another model, with the same channels, lines and noise."""
    m = measurement
    assert m.scatter is not None
    frf = computed_frf(model, m.sensors, m.excitations, m.frf.frequency, m.frf.kind)
    noise, size = m.scatter * np.abs(m.frf.H), np.abs(frf.H)
    with np.errstate(divide="ignore", invalid="ignore"):
        scatter = np.where(size > 0, noise / size, 0.0)
    return replace(m, frf=frf, scatter=scatter)


def as_planned(problem: FitProblem, base: FitResult) -> FitProblem:
    """Return a problem whose data are what a model gives, with small deviations of a structure yet unseen.

    The fits' own model, whose mesh and damping differ a little from those of the study. Deviations of
    eigenvalues are of a size that is exceeded with no more than a probability of 0.2.
    """
    problem = replace(problem, data=replace(problem.data, H=problem.receptance(base)))
    return replace(problem, scatter=with_likely_shifts(form_scatter(problem, base)))


def with_likely_shifts(scatter: FormScatter | None) -> FormScatter | None:
    """Return small deviations whose shifts of eigenvalues are exceeded with a probability of 0.2 at most.

    A fit without an effect that is missing takes larger ones than a right model has.
    """
    if scatter is None or not scatter.sizes:
        return scatter
    return replace(scatter, eigenvalue=float(np.quantile(scatter.sizes, 0.8, method="lower")))


def usual_discrepancy(model_error: float) -> float:
    """Return the level that a right model of beams usually leaves besides noise [nepers].

    The least that fits allow (:mod:`updating.inference.belief`). Beside the small deviations that fits have
    among their unknowns no more was left: in 20 of 21 structures of other codes nothing beyond the noise, in
    one 0.14 dB. Of measured structures an earlier test says more.
    """
    return DISCREPANCY_MIN * model_error
