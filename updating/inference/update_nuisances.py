"""Further unknowns of an update: damping ratios, and errors that any model has."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fem.model import Model, ModelError
from updating.inference.frf_data import FRFData
from updating.inference.frf_residual import FRFResidual
from updating.inference.mode_data import COMMON
from updating.inference.unknowns import ScaledUnknown

_KNOTS = 20
"""Most damping ratios that are fitted unless knots are given."""


def damping_knots(model: Model, data: FRFData, given: ArrayLike | None) -> NDArray[np.float64]:
    """Return the frequencies between which damping is linear: given ones, or those of the modes seen [Hz]."""
    if given is not None:
        knots = np.array(given, dtype=float, ndmin=1)
        if not (np.isfinite(knots).all() and (np.diff(knots) > 0).all() and knots.size):
            msg = f"the damping's frequencies are {knots.tolist()}; they must rise [Hz]"
            raise ModelError(msg)
        return knots
    f = FRFResidual(data.lines(np.inf, 20), model, (), margin=1.5).seen()
    if f.size < 2:
        return np.array([float(np.sqrt(data.frequency[0] * data.frequency[-1]))])
    return np.unique(f if f.size <= _KNOTS else np.quantile(f, np.linspace(0, 1, _KNOTS)))


def nuisances_of(knots: NDArray[np.float64], data: FRFData) -> list[ScaledUnknown]:
    """Return errors of the model with the right parameters: shifts of frequencies, and gains.

    Part of the shifts' variance is common to all: models tend to be too stiff, or too soft, throughout.
    """
    shifts, gains = [], []
    if knots.size:
        common, own = data.model_error * np.sqrt(COMMON), data.model_error * np.sqrt(1 - COMMON)
        shifts = [("shift of all", common), *((f"shift at {f:.4g} Hz", own) for f in knots.tolist())]
    if data.amplitude_error > 0:
        names = [f"gain of output {i}" for i in range(data.outputs.shape[1])]
        names += [f"gain of input {i}" for i in range(data.inputs.shape[1])]
        gains = [(name, data.amplitude_error) for name in names]
    return [
        ScaledUnknown(name, "-", (), np.zeros(0), 0.0, False, 1.0, 0.0, -8 * std, 8 * std, 0.0, std, std, std)
        for name, std in (*shifts, *gains)
    ]


def damping_ratios(model: Model, knots: NDArray[np.float64]) -> list[ScaledUnknown]:
    """Return modal damping ratios as unknowns, which start at the model's; ln ζ is known within 1.5."""
    d = model.damping
    omega = 2 * np.pi * knots
    other = (d.alpha / omega + d.beta * omega + d.loss_factor) / 2
    ratio = d.ratio_at(knots)
    start = np.where(ratio > 0, ratio, np.where(other > 0, 0.1 * other, 0.005))
    return [
        ScaledUnknown(
            f"damping at {f:.4g} Hz", "-", (), np.zeros(0), z, True, 1.0, float(np.log(z)),
            float(np.log(1e-6)), float(np.log(0.5)), float(np.log(z)), 1.5, 1.5, 1.5,
        )
        for f, z in zip(knots.tolist(), start.tolist(), strict=True)
    ]  # fmt: skip
