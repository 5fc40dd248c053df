"""Exact steps in time of linear oscillators under forces that are linear between the samples.

Within a step the force is p(t) = p₀ + (p₁ - p₀) t/h, for which the state follows in closed form (Nigam and
Jennings, Bull. Seism. Soc. Am. 59, 1969): x₁ = A x₀ + B₀ p₀ + B₁ p₁. The coefficients are those of the
exponential of the state matrix with p and its slope as further states, so that rigid-body motion and
overdamped modes need no other forms.
"""

import numpy as np
from scipy.linalg import expm

from fem.array_types import Floats


def oscillators(
    eigenvalues: Floats, damping: Floats, forces: Floats, step: float, start: tuple[Floats, Floats]
) -> tuple[Floats, Floats]:
    """Return displacements and velocities of oscillators y'' + c y' + ω² y = p, shapes (n_t, n).

    Parameters
    ----------
    eigenvalues, damping : ndarray (n,)
        ω² [1/s²] and c [1/s].
    forces : ndarray (n_t, n)
        p at the samples.
    step : float
        [s].
    start : (ndarray (n,), ndarray (n,))
        Displacements and velocities at the first sample.
    """
    n = eigenvalues.size
    scale = np.maximum(np.sqrt(np.abs(eigenvalues)), 1 / step)  # of displacements, so that A's norm is ωh
    S = np.zeros((n, 4, 4))
    S[:, 0, 1] = scale
    S[:, 1, 0], S[:, 1, 1], S[:, 1, 2] = -eigenvalues / scale, -damping, 1.0
    S[:, 2, 3] = 1 / step
    E = expm(S * step)
    A, B1 = E[:, :2, :2], E[:, :2, 3]
    B0 = E[:, :2, 2] - B1
    inputs = B0 * forces[:-1, :, None] + B1 * forces[1:, :, None]
    y, v = np.empty((2, len(forces), n))
    y[0], v[0] = scale * start[0], start[1]
    a00, a01, a10, a11 = (np.ascontiguousarray(A[:, i, j]) for i in (0, 1) for j in (0, 1))
    gy, gv = np.ascontiguousarray(inputs[..., 0]), np.ascontiguousarray(inputs[..., 1])
    for k in range(len(forces) - 1):
        y[k + 1] = a00 * y[k] + a01 * v[k] + gy[k]
        v[k + 1] = a10 * y[k] + a11 * v[k] + gv[k]
    return y / scale, v


def coupled(
    K: Floats, C: Floats, B: Floats, forces: Floats, step: float, start: tuple[Floats, Floats]
) -> tuple[Floats, Floats]:
    """Return displacements and velocities of y'' + C y' + K y = B p, shapes (n_t, n).

    Parameters
    ----------
    K, C : ndarray (n, n)
        C need not be symmetric.
    B : ndarray (n, k)
    forces : ndarray (n_t, k)
        p at the samples.
    step : float
        [s].
    start : (ndarray (n,), ndarray (n,))
        Displacements and velocities at the first sample.
    """
    n, k = B.shape
    scale = np.maximum(np.sqrt(np.abs(np.diagonal(K))), 1 / step)
    S = np.zeros((2 * n + 2 * k, 2 * n + 2 * k))
    S[:n, n : 2 * n] = np.diag(scale)
    S[n : 2 * n, :n], S[n : 2 * n, n : 2 * n] = -K / scale, -C
    S[n : 2 * n, 2 * n : 2 * n + k] = B
    S[2 * n : 2 * n + k, 2 * n + k :] = np.eye(k) / step
    E = expm(S * step)
    A, B1 = E[: 2 * n, : 2 * n], E[: 2 * n, 2 * n + k :]
    B0 = E[: 2 * n, 2 * n : 2 * n + k] - B1
    inputs = forces[:-1] @ B0.T + forces[1:] @ B1.T
    x = np.empty((len(forces), 2 * n))
    x[0] = np.concatenate([scale * start[0], start[1]])
    for j in range(len(forces) - 1):
        x[j + 1] = A @ x[j] + inputs[j]
    return x[:, :n] / scale, x[:, n:]


def twice_integrated(acceleration: Floats, step: float) -> tuple[Floats, Floats]:
    """Return displacement and velocity, from rest, of an acceleration (n_t,) linear between samples."""
    rest = np.zeros(1)
    y, v = oscillators(rest, rest, acceleration[:, None], step, (rest, rest))
    return y[:, 0], v[:, 0]
