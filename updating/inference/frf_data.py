"""Measured receptances placed on a model for an update."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fem.analysis.frf import FRF, FRFKind
from fem.model import Model, ModelError
from fem.reduction.parametric_frf import ParametricFRF
from fem.reduction.reduced_model import reduce_model
from updating.inference.fit import EXPLAINED_LEVEL
from updating.inference.fit_data import counted_values, sensor_vectors
from updating.inference.places import Places, place_vectors
from updating.inference.preparation import counted_data
from updating.measurement.measurement import Measurement
from updating.measurement.noise import relative_noise


@dataclass(frozen=True, slots=True, eq=False)
class FRFData:
    """Measured receptances on a model.

    Attributes
    ----------
    frequency : ndarray (n_freq,)
        Lines [Hz].
    H : ndarray of complex (n_freq, n_out, n_in)
        Receptances; 1 where masked.
    mask : ndarray of bool (n_freq, n_out, n_in)
        Values that count.
    noise : ndarray (n_freq, n_out, n_in)
        Standard deviation of ln|H|, and of the phase [-].
    outputs, inputs : ndarray (n_dof, n_out), (n_dof, n_in)
        Places as combinations of DOFs.
    model_error : float
        Relative standard deviation with which even the right parameters meet a natural frequency [-].
    amplitude_error : float
        The same of an amplitude, calibration included [-].
    phase : bool
        Whether the receptances have phases; without, they are amplitudes, and residuals those of ln|H|.
    """

    frequency: NDArray[np.float64]
    H: NDArray[np.complex128]
    mask: NDArray[np.bool_]
    noise: NDArray[np.float64]
    outputs: NDArray[np.float64]
    inputs: NDArray[np.float64]
    model_error: float
    amplitude_error: float
    phase: bool = True

    @property
    def n_parts(self) -> int:
        """Parts of ln H that were measured: its real part, ln|H|, and with a phase its imaginary part."""
        return 2 if self.phase else 1

    def seen(self, logarithm: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Return the part of ln H, or of its changes, that was measured: of amplitudes the real part."""
        return logarithm if self.phase else logarithm.real.astype(complex)

    def lines(self, highest: float, n: int) -> "FRFData":
        """Return at most n evenly spread lines up to a frequency."""
        which = np.flatnonzero(self.frequency <= highest * (1 + 1e-9))
        if len(which) > n:
            which = which[np.unique(np.linspace(0, len(which) - 1, n).round().astype(int))]
        return replace(
            self,
            frequency=self.frequency[which],
            H=self.H[which],
            mask=self.mask[which],
            noise=self.noise[which],
        )


def frf_data(
    model: Model,
    frf: FRF | Measurement | ArrayLike,
    *,
    lines: ArrayLike | None = None,
    outputs: Places | None = None,
    inputs: Places | None = None,
    kind: FRFKind | str = FRFKind.ACCELERANCE,
    band: tuple[float, float] | None = None,
    noise: ArrayLike | None = None,
    model_error: float = 1e-3,
    amplitude_error: float = 0.01,
    form_error: float = EXPLAINED_LEVEL,
) -> FRFData:
    """Check measured FRFs and place them on a model.

    The values that count are those of every comparison: not those of FRFs that symmetry makes zero, nor those
    that noise hides (:func:`updating.inference.fit_data.counted_values`).

    Parameters
    ----------
    model : Model
    frf : FRF, Measurement or array_like (n_freq, n_out, n_in)
        A measurement brings its sensors along. NaN is where nothing was measured, in bare arrays.
    lines : array_like (n_freq,)
        Frequencies of a bare array [Hz].
    outputs, inputs : places
    kind : FRFKind or str
        Of a bare array.
    band : (float, float), optional
        Lines that count [Hz].
    noise : float or array_like, optional
        Relative standard deviation of the real and of the imaginary part, one number or one that broadcasts
        to the array; that of the measurement, or else estimated from the roughness of the lines, unless given
        [-].
    form_error : float
        Residual level up to which a model counts as right, because beams are not the structure itself: 0 if
        readings have nothing of motion transverse to their sensors. For measurements only [nepers].
    model_error, amplitude_error : float
        Error with the right parameters: of natural frequencies, and of amplitudes with their calibration,
        relative [-].

    Raises
    ------
    ModelError
        If places are missing or do not fit, or nothing is left.
    """
    if isinstance(frf, Measurement) and outputs is None and inputs is None:
        measurement = frf
        if noise is not None:
            measurement = replace(frf, scatter=_level_of(noise, frf.frf.H.shape))
        lines_in_band(frf.frf, band)
        data = counted_data(model, measurement, band, form_error)
        rows, columns = (sensor_vectors(model, s) for s in (frf.sensors, frf.excitations))
        # blocks that the program holds out are for the search; an update fits them
        kept = ~data.held_out if frf.held_out else slice(None)
        counted = _counted(
            data.frequency[kept], data.H[kept], data.mask[kept], data.uncertain[kept], rows, columns,
            model_error, amplitude_error,
        )  # fmt: skip
        return replace(counted, phase=frf.phase)
    if isinstance(frf, Measurement):
        outputs = frf.sensors if outputs is None else outputs
        inputs = frf.excitations if inputs is None else inputs
        noise = frf.noise if noise is None else noise
        frf = frf.frf
    labelled = isinstance(frf, FRF)
    if not isinstance(frf, FRF):
        if lines is None:
            msg = "bare FRFs need their lines [Hz]: lines=…"
            raise ModelError(msg)
        H = np.array(frf, dtype=complex)
        frf = FRF.from_arrays(lines, np.where(np.isfinite(H), H, 0.0), kind)
        seen = np.isfinite(H).reshape(frf.H.shape)
        if noise is not None and H.ndim < 3 and np.shape(noise) == H.shape:
            noise = np.reshape(noise, frf.H.shape)
    else:
        seen = np.ones(frf.H.shape, dtype=bool)
    if outputs is None or inputs is None:
        msg = "FRFs need the places of their responses and forces: outputs=…, inputs=…"
        raise ModelError(msg)
    rows, _ = place_vectors(model, outputs, frf.outputs if labelled else None)
    columns, _ = place_vectors(model, inputs, frf.inputs if labelled else None)
    if frf.H.shape[1:] != (rows.shape[1], columns.shape[1]):
        msg = (
            f"the FRFs have shape {frf.H.shape}, but {rows.shape[1]} outputs and {columns.shape[1]} inputs "
            "have places"
        )
        raise ModelError(msg)
    level = relative_noise(frf.H) if noise is None else _level_of(noise, frf.H.shape)
    keep = lines_in_band(frf, band)
    frf, seen, level = frf.select(lines=keep), seen[keep], level[keep]
    level = np.where(np.isnan(level), relative_noise(frf.H), level)
    if not (level >= 0).all():
        msg = "the noise must not be negative: the relative standard deviation [-]"
        raise ModelError(msg)
    computed = _computed(model, rows, columns, frf.frequency)
    mask = seen & counted_values(frf, level, computed)
    H = frf.as_kind("receptance").H
    return _counted(frf.frequency, H, mask, level, rows, columns, model_error, amplitude_error)


def lines_in_band(frf: FRF, band: tuple[float, float] | None) -> NDArray[np.bool_]:
    """Return which lines lie above 0 Hz and in a band.

    Raises
    ------
    ModelError
        If none does.
    """
    low, high = band if band is not None else (0.0, np.inf)
    keep = (frf.frequency > 0) & (frf.frequency >= low) & (frf.frequency <= high)
    if not keep.any():
        msg = f"no line lies in the band; the data cover {frf.frequency[0]:g} to {frf.frequency[-1]:g} Hz"
        raise ModelError(msg)
    return keep


def _level_of(noise: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.float64]:
    given = np.asarray(noise, dtype=float)
    try:
        level = np.broadcast_to(given, shape)
    except ValueError:
        msg = f"the noise has shape {given.shape}; a number or that of the FRFs, {shape}, is needed"
        raise ModelError(msg) from None
    if np.isinf(level).any() or (level < 0).any():
        msg = "the noise must be finite and not negative: the relative standard deviation [-]"
        raise ModelError(msg)
    return level


def _computed(
    model: Model, rows: NDArray[np.float64], columns: NDArray[np.float64], frequency: NDArray[np.float64]
) -> NDArray[np.complex128]:
    """Return receptances of the model as it is: of the size that tells which are zero by symmetry."""
    reduced = reduce_model(model, np.hstack([rows, columns]), float(frequency[-1]), releasable=False)
    engine = ParametricFRF(reduced, rows, columns, frequency, ())
    return engine.evaluate(np.zeros(0), model.damping.ratio_at(frequency), False)[0]


def _counted(
    frequency: NDArray[np.float64],
    H: NDArray[np.complex128],
    mask: NDArray[np.bool_],
    noise: NDArray[np.float64],
    rows: NDArray[np.float64],
    columns: NDArray[np.float64],
    model_error: float,
    amplitude_error: float,
) -> FRFData:
    if not mask.any():
        msg = "no FRF value is left: all are zero or nothing but noise"
        raise ModelError(msg)
    return FRFData(
        frequency, np.where(mask, H, 1.0), mask, np.maximum(np.where(mask, noise, 1.0), 1e-6), rows, columns,
        model_error, amplitude_error,
    )  # fmt: skip
