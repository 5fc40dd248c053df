"""Responses per unit acceleration of a reference output, in place of unit force at the input.

A force f of unknown amplitude moves output o by H_of and a reference output r by H_rf. Their ratio is free of
the force:

    T = H_of / (s² H_rf),   dT = (dH_of - T s² dH_rf) / (s² H_rf),   s = iω
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.array_types import Complexes, Ints


@dataclass(frozen=True, slots=True, eq=False)
class References:
    """Which outputs the responses to each input refer to; they follow the ``n`` outputs that are read.

    Attributes
    ----------
    n : int
        Number of outputs that are read.
    rows : ndarray of int (n_in,)
        Output whose acceleration divides the responses to each input; -1 where the input is a known force.
    """

    n: int
    rows: Ints

    def behind(self, n: int) -> "References":
        """Return the same references behind another number of outputs."""
        return References(n, np.where(self.rows >= 0, self.rows - self.n + n, -1))

    def read(self, H: Complexes, omega: NDArray[Any]) -> Complexes:
        """Return what is read, (n_freq, n, n_in), of the receptances of all outputs."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return H[:, : self.n] / self._accelerations(H, omega)[:, None]

    def slopes(self, dH: NDArray[Any], H: Complexes, omega: NDArray[Any]) -> NDArray[Any]:
        """Return the derivatives of what is read, (…, n_freq, n, n_in), by those of all receptances H."""
        over = self._accelerations(H, omega)
        with np.errstate(divide="ignore", invalid="ignore"):
            relative = self._at_references(dH) / np.where(self.rows >= 0, self._at_references(H), 1.0)
            relative = np.where(self.rows >= 0, relative, 0.0)
            return dH[..., : self.n, :] / over[:, None] - self.read(H, omega) * relative[..., None, :]

    def _at_references(self, H: NDArray[Any]) -> NDArray[Any]:
        """Return the receptance of each input's reference, (…, n_freq, n_in)."""
        return H[..., self.rows, np.arange(len(self.rows))]

    def _accelerations(self, H: Complexes, omega: NDArray[Any]) -> Complexes:
        """Return the acceleration of each input's reference for unit force, (n_freq, n_in); 1 without one."""
        a = -(np.asarray(omega)[:, None] ** 2) * self._at_references(H)
        return np.where(self.rows >= 0, a, 1.0)
