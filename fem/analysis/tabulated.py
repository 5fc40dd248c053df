"""Spectra given by points: straight lines between them where both axes are logarithmic."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fem.array_types import Floats
from fem.model import ModelError
from fem.summary import fields_summary


@dataclass(frozen=True, slots=True, eq=False)
class Tabulated:
    """Values over frequency.

    Attributes
    ----------
    frequency : ndarray (n,)
        Rising, above 0 [Hz].
    values : ndarray (n,)
        Not negative.
    """

    frequency: Floats
    values: Floats

    __repr__ = fields_summary

    @classmethod
    def of(cls, frequency: ArrayLike, values: ArrayLike) -> "Tabulated":
        """Check frequencies and values.

        Raises
        ------
        ModelError
            For shapes that do not fit, frequencies that do not rise above 0, or values that are negative or
            not finite.
        """
        f, v = np.array(frequency, dtype=float, ndmin=1), np.array(values, dtype=float, ndmin=1)
        if f.shape != v.shape or f.ndim != 1 or not f.size:
            msg = f"a spectrum's frequencies have shape {f.shape} and its values {v.shape}; they must agree"
            raise ModelError(msg)
        if not np.isfinite(f).all() or f[0] <= 0 or (np.diff(f) <= 0).any():
            msg = f"the frequencies of a spectrum must rise, above 0 Hz; the first is {f[0]:g} Hz"
            raise ModelError(msg)
        if not np.isfinite(v).all() or (v < 0).any():
            k = int(np.flatnonzero(~np.isfinite(v) | (v < 0))[0])
            msg = f"the spectrum is {v[k]:g} at {f[k]:g} Hz; it must be finite and not negative"
            raise ModelError(msg)
        return cls(f, v)

    def at(self, frequency: ArrayLike) -> Floats:
        """Return values at frequencies, those of the ends outside; linear where an end of a piece is 0."""
        f = np.asarray(frequency, dtype=float)
        x = np.clip(f, self.frequency[0], self.frequency[-1])
        k = np.clip(np.searchsorted(self.frequency, x) - 1, 0, max(self.frequency.size - 2, 0))
        if self.frequency.size == 1:
            return np.full(f.shape, self.values[0])
        f0, f1, v0, v1 = self.frequency[k], self.frequency[k + 1], self.values[k], self.values[k + 1]
        both = (v0 > 0) & (v1 > 0)
        share = np.log(x / f0) / np.log(f1 / f0)
        powers = np.where(both, v0, 1.0) * np.where(both, v1 / np.where(both, v0, 1.0), 1.0) ** share
        return np.where(both, powers, v0 + (x - f0) / (f1 - f0) * (v1 - v0))

    def within(self, frequency: ArrayLike) -> Floats:
        """Return values at frequencies, 0 outside the given ones."""
        f = np.asarray(frequency, dtype=float)
        slack = 1e-12 * self.frequency[-1]
        inside = (f >= self.frequency[0] - slack) & (f <= self.frequency[-1] + slack)
        return np.where(inside, self.at(f), 0.0)
