"""A joint fitted to measured FRFs, and how far to trust its values."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt
import scipy

from fem.array_types import Bools, Complexes, Floats, Ints
from fem.summary import fields_summary
from joint._checks import frozen_copy
from joint.form import JointForm

# Uncertainty of fitted parameters of a joint: deviations, bounds, and undetermined parameters ---------------


Information = Callable[[int, int], tuple[Floats, Floats]]
"""Gauss-Newton matrix and gradient that the lines from one up to another bring, without priors."""


NOISE_MARGIN = 2.0
"""Factor by which the square of noise, as estimated from lines, may be wrong [-]."""


LIKELY = 1.92
"""Fall of the log likelihood within which 95 % of one parameter's estimates lie [nats]."""

OPEN_ENDS = {
    "released": "cannot be distinguished from zero",
    "rigid": "cannot be distinguished from rigid",
    "either": "any value from zero to rigid fits",
}
"""Note on a parameter for which a limit fits the data as well as its value."""


@dataclass(frozen=True, slots=True, eq=False)
class Identifiability:
    """Uncertainty of the parameters.

    Attributes
    ----------
    names : tuple of str
        Joint parameters, then those of the substructures.
    std : (n,) array
        Standard deviation of each [its unit]; ``inf`` where the data say nothing, NaN at a bound.
    relative : (n,) array
        Standard deviation over the value's size [-].
    determined : (n,) array of bool
        Whether the value is known to better than ``limit`` of itself, and lies at no bound.
    correlation : (n, n) array
        Of the estimates [-].
    weakest : tuple of (float, str)
        Combinations of parameters that the data determine worst: relative standard deviation and words.
    """

    names: tuple[str, ...]
    std: Floats
    relative: Floats
    determined: Bools
    correlation: Floats
    weakest: tuple[tuple[float, str], ...]

    __repr__ = fields_summary

    def ranking(self) -> tuple[str, ...]:
        """Return the names, the best determined first."""
        return tuple(self.names[i] for i in np.argsort(self.relative, kind="stable"))


def inverse_information(A: Floats, fixed: Bools) -> Floats:
    """Return the covariance (2 A)⁻¹ of parameters that are not fixed, (n, n).

    The information of real unknowns in circular complex noise of variance σ² is 2 Re JᴴJ / σ². Variances are
    infinite for parameters in a direction without information, and 0 for fixed ones.
    """
    out = np.zeros(A.shape)
    lost = ~fixed & ~(np.diag(A) > 0)
    use = np.flatnonzero(~fixed & ~lost)
    if use.size:
        scale = np.sqrt(2 * np.diag(A)[use])
        values, vectors = np.linalg.eigh(2 * A[np.ix_(use, use)] / np.outer(scale, scale))
        # Eigenvalue of the scaled information, over the largest, up to which its direction is not determined
        # [-]
        weak = values < 1e-13 * values[-1]
        inverse = (vectors / np.where(weak, np.inf, values)) @ vectors.T
        out[np.ix_(use, use)] = inverse / np.outer(scale, scale)
        lost[use[(np.abs(vectors[:, weak]) > 1e-4).any(axis=1)]] = True
    out[lost, lost] = np.inf
    return out


def model_share(residual: Complexes, noise: Floats) -> float:
    """Return the part of the residual's square that is an error of the model [-].

    Two signs of it, of which the stronger counts: the part that neighbouring lines share, which white noise
    does not, and the excess over `NOISE_MARGIN` times the square of the data's own noise, in that tenth of
    the values where this noise is least and an error of the model shows best.

    Parameters
    ----------
    residual : (n_freq, M, L) complex array
        Over the standard deviation allowed; 0 where there is no value.
    noise : (n_freq, M, L) array
        The data's own noise over the same.
    """
    square = float((np.abs(residual) ** 2).sum())
    use = residual != 0
    if len(residual) < 3 or not square > 0:
        return 0.0
    together = float((residual[:-1].conj() * residual[1:]).real.sum()) / square - 2 / np.sqrt(use.sum())
    quiet = use & (noise <= np.quantile(noise[use], 0.1))
    beyond = 1 - NOISE_MARGIN * float((noise[quiet] ** 2).sum() / (np.abs(residual[quiet]) ** 2).sum())
    return float(np.clip(max(together, beyond), 0.0, 1.0))


def peak_count(H: Complexes) -> int:
    """Return how many modes FRFs (n_freq, M, L) show: peaks of their mean square over ω, 1 at least."""
    size = np.abs(H) ** 2
    mean = size.mean(axis=0)
    level = np.divide(size, mean, out=np.zeros_like(size), where=mean > 0).sum(axis=(1, 2))
    inside = level[1:-1]
    return max(1, int(((inside > level[:-2]) & (inside >= level[2:])).sum()))


def jackknife(A: Floats, information: Information, edges: Ints, free: Bools) -> Floats:
    """Return the covariance of the moves of estimates as groups of lines are left out in turn, (n, n).

    One Gauss-Newton step for each group: (A - A_m)⁻¹ g_m. Efron, *The Jackknife, the Bootstrap and Other
    Resampling Plans*, 1982, ch. 3; for groups that depend within themselves: Cameron, Gelbach and Miller,
    *Rev. Econ. Stat.* 90 (2008) 414-427.

    Parameters
    ----------
    A : (n, n) array
        Gauss-Newton matrix of all lines and priors.
    information : callable
    edges : (n_groups + 1,) array of int
        First line of each group, and the end.
    free : (n,) array of bool
        Unknown parameters; rows and columns of the rest are 0.
    """
    use = np.flatnonzero(free)
    scale = np.sqrt(np.diag(A)[use])
    moves = np.zeros((len(edges) - 1, len(A)))
    for k, (first, end) in enumerate(pairwise(edges)):
        of_group, g = information(int(first), int(end))
        rest = (A - of_group)[np.ix_(use, use)] / np.outer(scale, scale)
        moves[k, use] = np.linalg.lstsq(rest, g[use] / scale, rcond=1e-10)[0] / scale
    moves -= moves.mean(axis=0)
    return (len(moves) - 1) / len(moves) * (moves.T @ moves)


def stated_covariance(
    A: Floats,
    fixed: Bools,
    residual: Complexes,
    noise: Floats,
    chi2: float,
    H: Complexes,
    information: Information,
) -> tuple[Floats, Floats]:
    """Return the covariance with all residuals independent, and with model error beyond noise, (n, n) each.

    White residuals scatter as noise does: (2A)⁻¹ max(χ², 1). A part b is an error of the model
    (`model_share`). It moves estimates in two ways: by the part that differs from mode to mode, which leaving
    out lines shows (`jackknife`), and by the part common to all modes, which nothing in the data shows. For
    the latter the same square of the residual acts on one real number for each mode, its natural frequency:

        C = (1 - b) (2A)⁻¹ max(χ², 1) + b [C_jackknife + (2A)⁻¹ χ² 2n/n_modes]

    with n complex values.

    Parameters
    ----------
    A : (n, n) array
        Gauss-Newton matrix.
    fixed : (n,) array of bool
        Parameters at a bound.
    residual : (n_freq, M, L) complex array
        Over the standard deviation of the noise; 0 where there is no value.
    noise : (n_freq, M, L) array
        The data's own noise over the same.
    chi2 : float
        Its mean square for each degree of freedom [-].
    H : (n_freq, M, L) complex array
        Rebuilt FRFs, whose peaks are counted.
    information : callable
    """
    plain = inverse_information(A, fixed)
    independent = plain * max(chi2, 1.0)
    b = model_share(residual, noise)
    known = ~fixed & np.isfinite(np.diag(plain))
    if not b or not known.any():
        return independent, independent
    n_modes = peak_count(H)
    # Groups of lines that are left out one after the other, at least
    groups = min(max(n_modes, 8), len(residual))
    edges = np.linspace(0, len(residual), groups + 1).round().astype(np.int64)
    count = int((residual != 0).sum())
    moved = jackknife(A, information, edges, known)
    alike = plain * chi2 * max(1.0, 2 * count / n_modes)
    return independent, (1 - b) * independent + b * (moved + alike)


def root_of(covariance: Floats) -> Floats:
    """Return L with L Lᵀ the covariance of parameters with a finite variance, (n, n)."""
    known = np.isfinite(np.diag(covariance))
    C = np.where(np.outer(known, known), covariance, 0.0)
    scale = np.sqrt(np.where(np.diag(C) > 0, np.diag(C), 1.0))
    values, vectors = np.linalg.eigh(C / np.outer(scale, scale))
    return scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))


def correlation_of(covariance: Floats) -> Floats:
    """Return the correlation of estimates, (n, n): none of fixed or undetermined ones."""
    variance = np.diag(covariance)
    known = np.isfinite(variance) & (variance > 0)
    std = np.sqrt(np.where(known, variance, 1.0))
    out = np.where(np.outer(known, known), covariance, 0.0) / np.outer(std, std)
    np.fill_diagonal(out, 1.0)
    return out


def weakest_combinations(
    covariance: Floats, theta: Floats, names: tuple[str, ...]
) -> tuple[tuple[float, str], ...]:
    """Return the three combinations of parameters, each relative to its own size, that are known worst."""
    variance = np.diag(covariance)
    known = np.flatnonzero(np.isfinite(variance) & (variance > 0))
    lost = [(float("inf"), f"+1.0 {names[i]}") for i in np.flatnonzero(~np.isfinite(variance))]
    # a value next to zero is known to no part of itself: any large number says so
    size = np.maximum(np.abs(theta), 1e-6 * np.sqrt(np.where(np.isfinite(variance), variance, 0.0)))[known]
    values, vectors = np.linalg.eigh(covariance[np.ix_(known, known)] / np.outer(size, size))
    out = []
    for k in range(len(values) - 1, max(len(values) - 4, -1), -1):
        v = vectors[:, k] / vectors[np.argmax(np.abs(vectors[:, k])), k]
        lead = [i for i in np.argsort(-np.abs(v)) if abs(v[i]) > 0.3][:4]
        words = " ".join(f"{v[i]:+.1f} {names[known[i]]}" for i in lead)
        out.append((float(np.sqrt(max(values[k], 0.0))), words))
    return (*lost, *out)[:3]


# ------------------------------------------------------------------------------------------------------------


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
        (:func:`joint.joint_fit.stated_covariance`); 0 at a bound, infinite variances of parameters that
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
