"""Bounds of the errors of a reduced system's natural frequencies, without the full system's modes."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.linalg as sla
import scipy.sparse as sp

from fem.analysis.modes import rigid_body_motions
from fem.array_types import Floats
from fem.linalg.solvers import factorise
from fem.model import ModelError
from fem.reduction.condensation import Reduction
from fem.system import System


@dataclass(frozen=True, slots=True, eq=False)
class FrequencyErrors:
    """Errors of the natural frequencies of a reduced system, without the full system's modes.

    Attributes
    ----------
    frequency : ndarray (n,)
        Elastic natural frequencies of the reduced system in the band [Hz].
    lower, upper : ndarray (n,)
        The full system's frequency of the same number lies between these [Hz]. ``upper`` is always a bound;
        ``lower`` is one if ``counted``, and else provided that the reduced system misses no mode below
        ``separation``.
    separation : float
        A frequency above the band that separates modes [Hz].
    counted : bool
        Whether the full system's modes below ``separation`` were counted.
    n_missed : int
        How many more of them the full system has than the reduced one; 0 if not counted. Where modes are
        missed, modes of the same number are not the same motion, and ``lower`` is 0.
    """

    frequency: Floats
    lower: Floats
    upper: Floats
    separation: float
    counted: bool
    n_missed: int

    @property
    def least(self) -> Floats:
        """Relative errors are at least this, shape (n,) [-]."""
        return np.maximum(self.frequency / self.upper - 1, 0.0)

    @property
    def most(self) -> Floats:
        """Relative errors are at most this, shape (n,) [-]."""
        with np.errstate(divide="ignore"):
            return np.maximum(self.frequency / self.lower - 1, 0.0)


def frequency_errors(reduction: Reduction, max_frequency: float, *, count: bool = True) -> FrequencyErrors:
    """Bound the errors of a reduced system's natural frequencies.

    One step of inverse iteration on the reduced modes X, Y = K⁺ M X, gives Rayleigh-Ritz upper bounds and
    Lehmann's lower bounds (Parlett, *The Symmetric Eigenvalue Problem*, 1998, ch. 10 and 11; for one mode
    the latter are Temple's and Kato's), which hold for close and repeated modes as well. K⁺ is at hand from
    the static condensation. The lower ones need the number of modes below a frequency that separates them:
    Sylvester's inertia of one more factorisation.

    Bounds are those of exact arithmetic: errors below 10⁻⁹ are rounding.

    Parameters
    ----------
    reduction : Reduction
    max_frequency : float
        Upper end of the band [Hz].
    count : bool
        Whether to count the full system's modes. Without it ``lower`` is an estimate, at half the cost.

    Raises
    ------
    ModelError
        If the reduced system has no elastic mode in the band.
    """
    system = reduction.system
    theta, y = reduction.eigenpairs()
    R = rigid_body_motions(system)
    n_rigid = R.shape[1]
    n = int((theta[n_rigid:] <= (2 * np.pi * max_frequency) ** 2).sum())
    if not n:
        msg = f"the reduced system has no elastic mode up to {max_frequency:g} Hz"
        raise ModelError(msg)
    wanted = theta[n_rigid : n_rigid + n]
    X = np.asarray(system.Q.T @ (reduction.T @ y[:, : n_rigid + n + max(4, n // 2)]))
    X = X - R @ (R.T @ (system.M @ X))
    mass = np.einsum("ij,ij->j", X, system.M @ X)
    X = _ritz_vectors(system, X[:, mass > 1e-12 * mass.max()])
    MX = system.M @ X
    MX = MX - system.M @ (R @ (R.T @ MX))
    solve = reduction.flexibility
    if solve is None:
        solve = _elastic_flexibility(system, float(theta[n_rigid]), MX.shape[1])
    Y = solve(MX)
    Y = Y - R @ (R.T @ (system.M @ Y))
    MY = system.M @ Y
    # <x, y> = xᵀKy, in which A = K⁺M is symmetric, with eigenvalues ν = 1/λ
    A0, A1, A2, A3 = X.T @ (system.K @ X), X.T @ MX, MX.T @ Y, Y.T @ MY
    upper = _ritz_values(A2, A3)
    n_below, separation, missed = n, 0.0, 0
    for n_below, separation in _separations(upper, n):
        missed = _count_below(system, separation) - n_rigid - n_below if count else 0
        if missed <= 0:
            break
    missed = max(missed, 0)
    lower = np.zeros(n)
    if not missed:
        low = _lehmann(A0, A1, A2, 1 / separation, n_below)
        lower = np.minimum(low[:n], upper[:n]) if len(low) >= n else lower
    to_hz = 1 / (2 * np.pi)
    return FrequencyErrors(
        np.sqrt(wanted) * to_hz,
        np.sqrt(np.maximum(lower, 0.0)) * to_hz,
        np.sqrt(upper[:n]) * to_hz,
        float(np.sqrt(separation) * to_hz),
        count,
        missed,
    )


def _elastic_flexibility(system: System, first: float, n: int) -> Callable[[Floats], Floats]:
    """Return b ↦ K⁺ b from a factor of K + σM, for a reduction that has no static condensation.

    σ is 10⁻³ of the first elastic ω², so that three corrections x ← x + (K + σM)⁻¹ (b - Kx) leave 10⁻¹².
    """
    factor = factorise(system.K + 1e-3 * first * system.M)
    R = rigid_body_motions(system)

    def solve(b: Floats) -> Floats:
        x = factor.solve(b)
        for _ in range(4):
            x = x - R @ (R.T @ (system.M @ x))
            x = x + factor.solve(b - system.K @ x)
        return x

    return solve


def _ritz_vectors(system: System, X: Floats) -> Floats:
    """Return Ritz vectors of the span of X, K-orthogonal and of K-norm 1."""
    K = X.T @ (system.K @ X)
    scale = 1 / np.sqrt(K.diagonal())
    values, vectors = np.linalg.eigh(scale[:, None] * K * scale)
    keep = values > 1e-12 * values[-1]
    return X @ (scale[:, None] * vectors[:, keep] / np.sqrt(values[keep]))


def _ritz_values(K: Floats, M: Floats) -> Floats:
    """Return rising eigenvalues of K y = λ M y, by the flipped problem, which keeps the low ones' digits."""
    scale = 1 / np.sqrt(K.diagonal())
    nu = sla.eigh(scale[:, None] * M * scale, scale[:, None] * K * scale, eigvals_only=True)[::-1]
    return 1 / nu[nu > 0]


def _separations(eigenvalues: Floats, n: int) -> list[tuple[int, float]]:
    """Return places between the modes: how many values lie below, and an ω².

    The first is the middle of the widest gap above the first n values, the second that of the gap just above
    them, for a reduced system that misses modes only beyond.
    """
    above = eigenvalues[n - 1 :]
    if len(above) == 1:
        return [(n, 1.05 * float(above[0])), (n, (1 + 1e-4) * float(above[0]))]
    middle = np.sqrt(above[1:] * above[:-1])
    widest = int(np.argmax(above[1:] / above[:-1]))
    return [(n + i, float(middle[i])) for i in dict.fromkeys((widest, 0))]


def _lehmann(A0: Floats, A1: Floats, A2: Floats, a: float, n: int) -> Floats:
    """Return lower bounds of the n lowest ω², given that n of them lie below 1/a.

    The Ritz values μ of (A - a)⁻¹ on the trial space (A - a) X lie below its eigenvalues 1/(ν - a), so that
    ν ≤ a + 1/μ for as many as are positive, the largest μ for the smallest ν above a.
    """
    right = A2 - 2 * a * A1 + a**2 * A0
    mu = sla.eigh(A1 - a * A0, (right + right.T) / 2, eigvals_only=True)
    mu = mu[mu > 0]
    out = np.zeros(n)
    count = min(n, len(mu))
    # mu rises: the largest belongs to the highest mode below 1/a
    out[n - count :] = 1 / (a + 1 / mu[len(mu) - count :])
    return out


def _count_below(system: System, value: float) -> int:
    """Return the number of eigenvalues ω² below a value: negative ones of K - value M (Sylvester)."""
    for attempt in range(4):
        try:
            shifted = system.K - value * (1 + 1e-6 * attempt) * system.M
            return factorise(sp.csc_array(shifted)).count_negative()
        except ValueError:  # singular, or pivots were needed
            continue
    msg = "the modes cannot be counted: every factorisation near the separating frequency needed pivots"
    raise ModelError(msg)
