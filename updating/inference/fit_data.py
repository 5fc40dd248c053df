"""Measured receptances prepared for fits: which values count, with which noise and weight."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.analysis.frf import FRF, References
from fem.array_types import Bools, Complexes, Floats, Ints
from fem.model import Model
from fem.summary import fields_summary
from updating.correlation import DB_PER_NEPER
from updating.measurement.held_out import lines_held_out
from updating.measurement.measurement import (
    Measurement,
    MeasurementError,
    Sensor,
    outputs_of,
    sensor_rows,
)
from updating.measurement.noise import amplitude_noise, relative_noise

SYSTEMATIC_FROM = 1.25
"""Residuals up to this multiple of the noise are put down to it [-]."""


NOISE_LIMIT = 0.2
"""Lines with more relative noise than this are not compared [-]."""


TRANSVERSE = 0.01
"""Share of the motion square to a sensor that its reading may hold, where the model's form is not said to be
right [-]: accelerometers hear one to three per cent of it, and nobody mounts them straighter."""


MODEL_ERROR = 0.05
"""Relative accuracy that is asked of a model where the measurement is better than that [-]."""


def sensor_vectors(model: Model, sensors: Sequence[Sensor]) -> Floats:
    """Return sensors as combinations of DOFs, shape (n_dof, n).

    Raises
    ------
    MeasurementError
        If the mesh has no point where a sensor sits (see
        :func:`updating.measurement.measurement.place_sensors`).
    """
    return np.ascontiguousarray(sensor_rows(model, sensors).T)


def ends_of(
    model: Model, sensors: Sequence[Sensor], excitations: Sequence[Sensor]
) -> tuple[Floats, Floats, References | None]:
    """Return all outputs and inputs as combinations of DOFs, (n_dof, n), and what the outputs refer to.

    Behind the sensors stand those that the excitations refer to.

    Raises
    ------
    MeasurementError
        As :func:`sensor_vectors`.
    """
    every, references = outputs_of(sensors, excitations)
    return sensor_vectors(model, every), sensor_vectors(model, excitations), references


@dataclass(frozen=True, slots=True, eq=False)
class FitData:
    """Measured receptances, prepared for fits.

    Attributes
    ----------
    measurement : Measurement
    frequency : ndarray (n_freq,)
        All lines that count [Hz].
    H : ndarray (n_freq, n_out, n_in)
        Receptances.
    mask : ndarray of bool (n_freq, n_out, n_in)
        Values that count: not those of FRFs that are zero by symmetry, nor those with noise above
        ``NOISE_LIMIT``, nor those that are exactly 0, which nothing was measured at, nor those of sensors
        that may have read as much of transverse motion.
    weight : ndarray (n_freq, n_out, n_in)
        Weight of each residual, 1 where noise and that are small beside ``MODEL_ERROR``.
    noise : ndarray (n_freq, n_out, n_in)
        Relative noise of the amplitude [-].
    held_out : ndarray of bool (n_freq,)
        Lines that no fit sees.
    """

    measurement: Measurement
    frequency: Floats
    H: Complexes
    mask: Bools
    weight: Floats
    noise: Floats
    held_out: Bools

    __repr__ = fields_summary

    @property
    def uncertain(self) -> Floats:
        """Relative uncertainty of each reading: noise, and motion transverse to the sensor [-]."""
        weight = np.where(self.mask & (self.weight > 0), self.weight, 1.0)
        return np.maximum(MODEL_ERROR * np.sqrt(np.maximum(weight**-2 - 1, 0.0)), self.noise)

    def averaged(self, share: float) -> "FitData":
        """Return data with less noise, as of more averages; the same values count.

        Parameters
        ----------
        share : float
            Averages so far over those that there will be [-].
        """
        square = self.uncertain**2 - (1 - share) * self.noise**2
        weight = MODEL_ERROR / np.sqrt(MODEL_ERROR**2 + square) * self.mask
        return replace(self, weight=weight, noise=np.sqrt(share) * self.noise)

    @property
    def phase(self) -> bool:
        """Whether the receptances have phases; without, they are amplitudes."""
        return self.measurement.phase

    @property
    def arrays(self) -> tuple[NDArray[Any], ...]:
        """Numbers on which a fit depends."""
        return self.frequency, self.H, self.mask, self.noise

    @property
    def has_damping(self) -> bool:
        """Whether fits see damping: resonances always show it."""
        return True

    @property
    def n_parts(self) -> int:
        """Parts of ln H that were measured: its real part, ln |H|, and with a phase its imaginary part."""
        return 2 if self.phase else 1

    def seen(self, logarithm: NDArray[Any]) -> NDArray[Any]:
        """Return the part of ratios or changes of ln H that was measured: of amplitudes the real part."""
        return logarithm if self.phase else np.real(logarithm) + 0j

    @property
    def uncompared(self) -> tuple[str, ...]:
        """A sentence on each channel of which no value counts, with the reason."""
        sides = (("sensor", self.measurement.frf.outputs, 1), ("excitation", self.measurement.frf.inputs, 2))
        out = []
        for word, names, axis in sides:
            for k in np.flatnonzero(~np.moveaxis(self.mask, axis, 0).any(axis=(1, 2))):
                noise, uncertain = (float(np.median(x.take(k, axis))) for x in (self.noise, self.uncertain))
                limit, source = f"over the limit of {100 * NOISE_LIMIT:.0f} %", self.measurement.noise_source
                if noise >= NOISE_LIMIT:
                    why = f"their noise is {100 * noise:.0f} %, {limit} (from {source})"
                elif uncertain >= NOISE_LIMIT:
                    why = f"motion across it may be {100 * uncertain:.0f} % of its readings, {limit}"
                else:
                    why = "they are 0, or small compared with the others"
                out.append(f"the FRFs of {word} {names[k]} are not compared: {why}")
        return tuple(out)

    @property
    def noise_db(self) -> float:
        """Root mean square of the noise of the FRFs that count [dB]."""
        return float(np.sqrt((self.noise[self.mask] ** 2).mean()) * DB_PER_NEPER)

    @property
    def noise_level(self) -> float:
        """Residual level that noise alone leaves, amplitude and phase [nepers]."""
        return float(np.sqrt((self.n_parts * (self.weight * self.noise)[self.mask] ** 2).mean()))


def prepare(
    measurement: Measurement,
    computed: Complexes | None = None,
    band: tuple[float, float] | None = None,
    across: Floats | None = None,
) -> FitData:
    """Prepare measured FRFs for fits.

    The measurement's held-out bands are held out, or without any every fourth block of lines. An FRF is left
    out if its level, computed and measured, lies more than 60 dB (measured: 50 dB) under the median level of
    all of its quantity, or if it is noise at most lines, or no more there than ``TRANSVERSE`` of the motion
    across its sensor. A mask of the measurement takes precedence.

    Parameters
    ----------
    measurement : Measurement
    computed : ndarray (n_freq, n_out, n_in), optional
        Receptances of the nominal model at the measurement's lines in the band.
    band : (float, float), optional
        Frequencies that count [Hz].
    across : ndarray (n_freq, n_out, n_in), optional
        How far each sensor's place moves square to it, as receptances, where that may be in the readings.

    Raises
    ------
    MeasurementError
        If all FRFs are zero, or if a held-out band has no line or all bands have every line.
    """
    frf = measurement.frf.select(band=band) if band else measurement.frf
    if frf.frequency[0] == 0:
        frf = frf.select(lines=np.arange(1, frf.n_freq))
    H = frf.as_kind("receptance").H
    if not measurement.phase:
        H = np.abs(H).astype(complex)
    level = np.sqrt((np.abs(frf.H) ** 2).mean(axis=0))
    if not level.any():
        msg = f"all FRFs of '{measurement.name}' are zero"
        raise MeasurementError(msg)
    kept = measurement.with_frf(frf)
    noise = _noise_of(kept)
    uncertain = noise
    if across is not None:
        with np.errstate(divide="ignore", invalid="ignore"):
            uncertain = np.hypot(noise, np.nan_to_num(TRANSVERSE * across / np.abs(H), nan=0.0, posinf=10.0))
    mask = counted_values(frf, uncertain, computed)
    if kept.compared is not None:
        mask = np.where(np.isfinite(kept.compared), kept.compared > 0, mask) & (H != 0)
    weight = MODEL_ERROR / np.sqrt(MODEL_ERROR**2 + uncertain**2) * mask
    return FitData(kept, frf.frequency, H, mask, weight, noise, lines_held_out(kept, frf.frequency))


def counted_values(frf: FRF, uncertain: Floats, computed: Complexes | None = None) -> Bools:
    """Return which values of measured FRFs count, (n_freq, n_out, n_in): in comparisons, fits and updates.

    Parameters
    ----------
    frf : FRF
        As measured.
    uncertain : ndarray (n_freq, n_out, n_in)
        Relative uncertainty of each reading [-].
    computed : ndarray (n_freq, n_out, n_in), optional
        Receptances of the nominal model, of which those that symmetry makes zero are told.
    """
    level = np.sqrt((np.abs(frf.H) ** 2).mean(axis=0))
    calculated = None
    if computed is not None:
        powers = np.where(frf.is_strain[:, None], 1.0, (2 * np.pi * frf.frequency[:, None, None]) ** 2)
        calculated = np.sqrt((np.abs(computed * powers) ** 2).mean(axis=0))
    mask = np.zeros(level.shape, dtype=bool)
    for alike in (frf.is_strain, ~frf.is_strain):  # levels of one quantity can be compared
        if level[alike].any():
            mask[alike] = level[alike] > 10 ** (-50 / 20) * np.median(level[alike][level[alike] > 0])
        if calculated is not None and alike.any():
            mask[alike] &= calculated[alike] > 10 ** (-60 / 20) * np.median(calculated[alike])
    mask = mask & (uncertain < NOISE_LIMIT) & (frf.H != 0)
    # FRFs that are more than noise at no more than this share of the lines are not compared at any [-]
    return mask & (mask.mean(axis=0) > 0.2)


def _noise_of(measurement: Measurement) -> Floats:
    """Return the relative noise that is known from coherence or repeats, or else that of the data.

    Known values are kept between a millionth and 10, and infinite ones, as where H is 0, become 10, so that
    weights and ratios stay finite.
    """
    estimate = relative_noise if measurement.phase else amplitude_noise
    noise, known = estimate(measurement.frf.H), measurement.noise
    if known is not None:
        noise = np.where(np.isnan(known), noise, known)
    return np.clip(noise, 1e-6, 10.0) if known is not None else np.where(np.isfinite(noise), noise, 10.0)


def noise_squares(data: FitData, lines: Ints) -> Floats:
    """Return how much of the squares of the weighted residuals at some lines is put down to noise, (m,)."""
    square = data.n_parts * (SYSTEMATIC_FROM * data.weight[lines] * data.noise[lines]) ** 2
    return square[data.mask[lines]]
