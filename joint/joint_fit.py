"""A joint fitted to measured FRFs, and how far to trust its values."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy

from fem.array_types import Bools, Complexes, Floats
from fem.summary import fields_summary
from joint._checks import frozen_copy
from joint.form import JointForm
from joint.uncertainty import OPEN_ENDS, Identifiability, root_of


@dataclass(frozen=True, slots=True, eq=False)
class JointFit:
    """Hold a joint fitted to the FRFs of an assembly.

    Attributes
    ----------
    form : JointForm
    values : (n,) array
        θ, in the order of ``form.names`` [their units].
    covariance : (n, n) array
        Of θ, with the substructures' uncertainty and the residual beyond noise in it
        (:func:`joint.uncertainty.stated_covariance`); 0 at a bound, infinite variances of parameters that
        the data do not determine at all.
    independent : (n, n) array
        The same if all residuals were independent noise.
    at_bound : (n,) array of bool
        Parameters at a bound: they have no deviation.
    open_end : tuple of str
        Of each parameter that the data do not determine, which limit fits them as well as its value does:
        ``"released"`` (none of it), ``"rigid"``, ``"either"``; else empty.
    part_names : tuple of str
    part_values, part_std : (m,) arrays
        Uncertain parameters of the substructures and their standard deviations [their units].
    frequency : (n_freq,) array
        Lines that were fitted [Hz].
    H : (n_freq, M, L) complex array
        Rebuilt receptances [m/N, …].
    residual : (n_freq, M, L) complex array
        (rebuilt - measured) / standard deviation of the noise [-].
    chi2 : float
        Mean square of the residual for each degree of freedom; 1 if model and noise are
        right.
    identifiability : Identifiability
    history : tuple of (float, float, float)
        Highest frequency of the stage [Hz], cost, and length of the step in standard deviations, one for each
        iteration.
    converged : bool
    message : str
        How it ended, with doubts about the result.
    """

    form: JointForm
    values: Floats
    covariance: Floats
    independent: Floats
    at_bound: Bools
    open_end: tuple[str, ...]
    part_names: tuple[str, ...]
    part_values: Floats
    part_std: Floats
    frequency: Floats
    H: Complexes
    residual: Complexes
    chi2: float
    identifiability: Identifiability
    history: tuple[tuple[float, float, float], ...]
    converged: bool
    message: str

    __repr__ = fields_summary

    def __post_init__(self) -> None:
        for name in (
            "values",
            "covariance",
            "independent",
            "at_bound",
            "part_values",
            "part_std",
            "frequency",
            "H",
            "residual",
        ):
            object.__setattr__(self, name, frozen_copy(getattr(self, name)))

    @property
    def std(self) -> Floats:
        """Standard deviations of θ, (n,) [its units]; NaN at a bound, infinite where nothing is known."""
        return np.where(self.at_bound, np.nan, np.sqrt(np.diag(self.covariance)))

    def interval(self, level: float = 0.95) -> Floats:
        """Return confidence intervals of θ, (n, 2): value ± a normal quantile of std; NaN at a bound.

        Parameters
        ----------
        level : float
            Probability that an interval holds the truth [-].

        Raises
        ------
        ValueError
            If the level does not lie between 0 and 1.
        """
        if not 0 < level < 1:
            msg = f"the level is {level}; a probability between 0 and 1 is needed, such as 0.95"
            raise ValueError(msg)
        half = float(scipy.special.ndtri(0.5 + level / 2)) * self.std
        return np.stack([self.values - half, self.values + half], axis=1)

    def words(self, index: int) -> str:
        """Return a parameter's value with its deviation, or why it has none."""
        value, std = self.values[index], self.std[index]
        if self.at_bound[index]:
            return f"{value:.4g}, at its bound"
        if self.identifiability.determined[index]:
            return f"{value:.4g} ± {std:.2g}"
        most = value + float(scipy.special.ndtri(0.95)) * std
        limited = self.open_end[index] == "released" and np.isfinite(most)
        below = f" below {most:.2g} (95 %)," if limited else ""
        end = OPEN_ENDS.get(self.open_end[index], "")
        return "not determined" + (f":{below} {end}" if end else "")

    def Z(self, frequency: npt.ArrayLike | None = None) -> Complexes:
        """Return the dynamic stiffness (n_freq, N, N), at the fitted lines unless others are given [Hz]."""
        return self.form.Z(self.frequency if frequency is None else frequency, self.values)

    def Z_std(self, frequency: npt.ArrayLike | None = None) -> Complexes:
        """Return standard deviations of Z's real and imaginary parts, as one complex array (n_freq, N, N)."""
        lines = self.frequency if frequency is None else np.atleast_1d(np.asarray(frequency, dtype=float))
        slopes, which = self.form.slopes(2 * np.pi * lines, self.values)
        L = root_of(self.covariance)
        flat = self.form.matrices[which].reshape(len(which), -1)  # (n, N²)
        shape = (lines.size, *self.form.matrices.shape[1:])
        out = np.zeros((2, lines.size, flat.shape[1]))
        for column in L.T:
            change = (slopes.T * column) @ flat
            out[0] += change.real**2
            out[1] += change.imag**2
        out = np.sqrt(out).reshape(2, *shape)
        return out[0] + 1j * out[1]
