"""Derivatives of receptances in single precision: by what changes all, and by what one output reads."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fem.array_types import Ints


@dataclass(frozen=True, slots=True, eq=False)
class FrfSlopes:
    """Derivatives of receptances by n + k quantities.

    Attributes
    ----------
    common : ndarray (n, n_out, n_freq, n_in)
        By those that change any receptance.
    first : int
        Number of the first of the k others among all; they follow one another.
    of : ndarray of int (k,)
        The output whose reading each of the others changes; rising.
    single : ndarray (k, n_freq, n_in)
        The derivatives at these outputs.
    """

    common: NDArray[np.complex64]
    first: int
    of: Ints
    single: NDArray[np.complex64]

    def dense(self) -> NDArray[np.complex64]:
        """Return all derivatives, (n + k, n_freq, n_out, n_in)."""
        k, first = len(self.of), self.first
        out = np.zeros((len(self.common) + k, *self.common.shape[1:]), dtype=np.complex64)
        out[:first], out[first + k :] = self.common[:first], self.common[first:]
        out[first + np.arange(k), self.of] = self.single
        return out.swapaxes(1, 2)

    def with_outputs(self, rows: Ints, other: "FrfSlopes") -> "FrfSlopes":
        """Return the derivatives with those of some outputs from others by the same quantities."""
        common, single = self.common.copy(), self.single.copy()
        theirs = np.isin(self.of, rows)
        common[:, rows], single[theirs] = other.common[:, rows], other.single[theirs]
        return FrfSlopes(common, self.first, self.of, single)
