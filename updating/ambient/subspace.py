"""Poles and shapes from correlations by stochastic subspaces of rising order, with their deviations.

Correlations ─ decompose → Subspaces ─ fit_orders → SubspacePoles: poles and shapes of every order, and how
                                                    each block's correlations move them
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import hadamard

from fem.array_types import Complexes, Floats, Ints
from fem.summary import fields_summary

# Correlations of responses that were measured together, of the whole record and block by block --------------


@dataclass(frozen=True, slots=True, eq=False)
class Correlations:
    """Correlations R_i = E[y(t + i) y_ref(t)ᵀ] of the lags i = 1, 2 and so on.

    Attributes
    ----------
    mean : ndarray (n_lags, n_channels, n_references)
        Of the whole record [product of the channels' units].
    of_block : ndarray (n_blocks, n_lags, n_channels, n_references)
        Of its consecutive blocks; their mean is ``mean``.
    """

    mean: Floats
    of_block: Floats

    __repr__ = fields_summary


def block_correlations(y: Floats, n_lags: int, n_blocks: int, references: list[int]) -> Correlations:
    """Return the correlations of a record and of each of its blocks.

    A block's products y(t + i) y_ref(t) begin in the block and may end in the next one, so that no product
    is lost at its edges and the mean over blocks is the correlation of the record.

    Parameters
    ----------
    y : ndarray (n_samples, n_channels)
        Without mean.
    n_lags, n_blocks : int
    references : list of int
        Channels that every response is correlated with.
    """
    length = (len(y) - n_lags) // n_blocks
    used = n_blocks * length
    past = y[:used, references].reshape(n_blocks, length, -1)
    out = np.empty((n_blocks, n_lags, y.shape[1], len(references)))
    for i in range(n_lags):
        future = y[i + 1 : i + 1 + used].reshape(n_blocks, length, -1)
        out[:, i] = future.transpose(0, 2, 1) @ past / length
    return Correlations(out.mean(axis=0), out)


# ------------------------------------------------------------------------------------------------------------


MATHEMATICAL_DAMPING = 0.2
"""Poles with a larger damping ratio are taken for mathematical ones [-]."""


@dataclass(frozen=True, slots=True, eq=False)
class SubspacePoles:
    """Poles of models of rising order.

    Attributes
    ----------
    order : ndarray of int (n,)
        Order of the state-space model that the pole belongs to.
    poles : ndarray of complex (n,)
        λ of continuous time with Im λ > 0, sorted by order [rad/s].
    shapes : ndarray of complex (n, n_channels)
        Of length 1, turned to the phase at which they are nearest to real.
    pole_deviation : ndarray of complex (n, n_blocks)
        Change of the pole to first order if the record's correlations were those of a block [rad/s].
    shape_deviation : ndarray (n, n_blocks, n_channels)
        The same of the real part of the shape.
    orders : ndarray of int (n_orders,)
        All orders that were computed.
    """

    order: Ints
    poles: Complexes
    shapes: Complexes
    pole_deviation: Complexes
    shape_deviation: Floats
    orders: Ints

    __repr__ = fields_summary

    @property
    def frequency(self) -> Floats:
        """|λ| / 2π, shape (n,) [Hz]."""
        return np.abs(self.poles) / (2 * np.pi)

    @property
    def zeta(self) -> Floats:
        """Damping ratios -Re λ / |λ|, shape (n,) [-]."""
        return -self.poles.real / np.abs(self.poles)


@dataclass(frozen=True, slots=True, eq=False)
class Subspaces:
    """Singular vectors H = U S Vᵀ of the block Hankel matrix of R_{i+j-1}, and what every order needs.

    Attributes
    ----------
    U : ndarray (n_rows, n_rows)
    s : ndarray (rank,)
        Singular values, falling.
    order : int
        Number of singular values that stand out of the noise: the order of the state-space model that the
        record supports.
    left, right : ndarray (n_blocks, n_rows, n) and (n_blocks, n, rank)
        Uᵀ ΔH V of each block: its leading columns, and its leading rows, as many as the highest order.
    forward, backward : ndarray (n, n_rows) and (n_rows, n)
        U↑ᵀU↓, where ↑ and ↓ leave out the last and the first block row: leading rows and leading columns.
    last : ndarray (n_channels, n_rows)
        Last block row of U; U↑ᵀU↑ = I - lastᵀ last.
    highest : int
        Highest order.
    """

    U: Floats
    s: Floats
    order: int
    left: Floats
    right: Floats
    forward: Floats
    backward: Floats
    last: Floats
    highest: int

    __repr__ = fields_summary


def decompose(correlations: Correlations, n_rows: int) -> Subspaces:
    """Decompose the block Hankel matrix of a record's correlations, and find the order that it supports.

    Differences of blocks have the covariance of the error of H, without its signal: sums of all blocks with
    signs, half of them negative, are samples of that error. A singular value stands out if it is above the
    largest singular value of such samples, of the space that the singular vectors before it leave (median of
    the samples). Higher orders only fit the noise.

    Parameters
    ----------
    correlations : Correlations
        Of lags 1 to 2 ``n_rows``; the number of blocks is a power of two.
    n_rows : int
        Block columns of H, and its block rows less one.
    """
    H, r = _hankel(correlations.mean, n_rows), correlations.mean.shape[1]
    U, s, Vt = np.linalg.svd(H, full_matrices=True)
    V = Vt[: len(s)].T
    order = _order(correlations, n_rows, U[:, : len(s)], s, V)
    # Orders above that of the record in which its poles are sought again, at least; else half as many
    highest = min(order + max(8, 2 * (order // 4)), len(s) - len(s) % 2 - 2)
    order = min(order, highest)
    left, right = [], []
    for R in correlations.of_block:
        dH = _hankel(R, n_rows) - H
        left.append(U.T @ (dH @ V[:, :highest]))
        right.append((U[:, :highest].T @ dH) @ V)
    up, down = U[:-r], U[r:]
    forward, backward = up[:, :highest].T @ down, up.T @ down[:, :highest]
    return Subspaces(U, s, order, np.array(left), np.array(right), forward, backward, U[-r:], highest)


def _order(c: Correlations, n_rows: int, U: Floats, s: Floats, V: Floats) -> int:
    """Return the even number of singular values that are above the noise of the space that they leave."""
    n_blocks = len(c.of_block)
    # Samples of the error of the correlations, from which its size is
    signs = hadamard(n_blocks).astype(float)[1 : 1 + min(8, n_blocks - 1)]
    samples: list[Floats] = [np.einsum("b,blor->lor", g / n_blocks, c.of_block) for g in signs]
    errors = [U.T @ _hankel(R, n_rows) @ V for R in samples]
    for n in range(2, len(s) - 2, 2):
        if s[n] < np.median([_norm(E[n:, n:]) for E in errors]):
            return n
    return len(s) - 2


def _norm(A: Floats) -> float:
    """Return the largest singular value, from a fixed start: equal data give equal results."""
    x = np.ones(A.shape[1])
    # Steps of the power iteration for a largest singular value, which then errs by a few per cent at most
    for _ in range(30):
        x = A.T @ (A @ x)
        x /= max(float(np.linalg.norm(x)), 1e-300)
    return float(np.linalg.norm(A @ x))


def fit_orders(d: Subspaces, sample_rate: float) -> SubspacePoles:
    """Identify state-space models of all even orders, with first-order deviations of their poles and shapes.

    H is O Γ with the observability matrix O = [C; CA; CA²; …]; its leading left singular vectors are O in
    some coordinates, and A follows from O↓ = O↑ A by least squares (covariance-driven stochastic subspace
    identification: Peeters and De Roeck, *Mech. Syst. Signal Process.* 13, 1999, 855).

    Deviations: the correlations of a block give ΔH. A change of the singular vectors within the space that
    they span is one of coordinates and moves no pole. To first order they gain from the other space

        u_jᵀ Δu_i = (s_i u_jᵀ ΔH v_i + s_j v_jᵀ ΔHᵀ u_i) / (s_i² - s_j²),

    A gains ΔA = O↑⁺ (ΔO↓ - ΔO↑ A) + (O↑ᵀO↑)⁻¹ ΔO↑ᵀ (O↓ - O↑ A), and with A φ = μ φ, χᴴ A = μ χᴴ, χᴴφ = 1 the
    eigenvalue Δμ = χᴴ ΔA φ and the eigenvector Δφ = Σ_l φ_l χ_lᴴ ΔA φ / (μ - μ_l) (Reynders, Pintelon and
    De Roeck, *ibid.* 22, 2008, 948; for all orders at once Döhler and Mevel, *ibid.* 38, 2013, 346).

    Parameters
    ----------
    d : Subspaces
    sample_rate : float
        [Hz].
    """
    orders = np.arange(2, d.highest + 1, 2)
    parts = [_of_order(d, int(n), sample_rate) for n in orders]
    order = np.concatenate([np.full(len(p[0]), n) for n, p in zip(orders, parts, strict=True)])
    poles, shapes, of_pole, of_shape = (np.concatenate([p[k] for p in parts]) for k in range(4))
    return SubspacePoles(order, poles, shapes, of_pole, of_shape.real, orders)


def _hankel(R: Floats, n_rows: int) -> Floats:
    """Return the block Hankel matrix, n_rows + 1 by n_rows blocks, of R (n_lags, n_out, n_in)."""
    i = np.arange(n_rows + 1)[:, None] + np.arange(n_rows)[None, :]
    return R[i].transpose(0, 2, 1, 3).reshape((n_rows + 1) * R.shape[1], n_rows * R.shape[2])


def _of_order(d: Subspaces, n: int, sample_rate: float) -> tuple[Complexes, Complexes, Complexes, Complexes]:
    """Return poles, shapes and their deviations of one order."""
    last = d.last[:, :n]
    G: Floats = np.asarray(np.linalg.inv(np.eye(n) - last.T @ last), dtype=float)
    values, vectors = np.linalg.eig(G @ d.forward[:n, :n])
    mu: Complexes = values.astype(complex)
    phi: Complexes = vectors.astype(complex)
    with np.errstate(divide="ignore"):
        poles = sample_rate * np.asarray(np.log(mu), dtype=complex)
    keep = np.flatnonzero(
        (mu.imag > 0) & (poles.real < 0) & (-poles.real < MATHEMATICAL_DAMPING * np.abs(poles))
    )
    keep = keep[np.argsort(np.abs(poles[keep]))]
    chi: Complexes = np.asarray(np.linalg.inv(phi), dtype=complex)
    K = _rotation(d, n)
    found = [_deviation(d, n, int(k), mu, phi, chi, G, K) for k in keep]
    r, n_blocks = len(d.last), len(d.left)
    shapes = np.array([f[0] for f in found]).reshape(-1, r)
    of_mu = np.array([f[1] for f in found]).reshape(-1, n_blocks)
    of_shape = np.array([f[2] for f in found]).reshape(-1, n_blocks, r)
    kept: Complexes = poles[keep].astype(complex)
    return kept, shapes, sample_rate * of_mu / mu[keep, None], of_shape


def _rotation(d: Subspaces, n: int) -> Floats:
    """Return U_⊥ᵀ ΔU of each block, (n_blocks, complement, n)."""
    s, of_rank = d.s, len(d.s)
    size = np.zeros(len(d.U))
    size[:of_rank] = s
    gap = s[:n] ** 2 - size[n:, None] ** 2
    other = np.zeros_like(d.left[:, n:, :n])
    other[:, : of_rank - n] = d.right[:, :n, n:].transpose(0, 2, 1)
    return (s[:n] * d.left[:, n:, :n] + size[n:, None] * other) / gap


def _deviation(
    d: Subspaces, n: int, k: int, mu: Complexes, phi: Complexes, chi: Complexes, G: Floats, K: Floats
) -> tuple[Complexes, Complexes, Complexes]:
    """Return the shape of an eigenvector, and the deviations of its eigenvalue and shape in each block."""
    up = -d.last.T @ d.last[:, :n]  # U↑ᵀO↑ away from the diagonal
    p, value = phi[:, k], mu[k]
    Kp = K @ p
    first = (d.forward[:n, n:] - value * up[n:].T) @ Kp.T
    residual = (d.backward[n:, :n] - value * up[n:]) @ p
    dA = G @ (first + (residual @ K).T)  # ΔA φ, a column for each block
    share = chi @ dA
    apart = value - mu
    apart[k] = np.inf
    moved = phi @ (share / apart[:, None])
    C = d.U[: len(d.last)]
    psi = C[:, :n] @ p
    moved = C[:, n:] @ Kp.T + C[:, :n] @ moved
    # length 1, and turned so that ψᵀψ is positive
    size, turn = np.linalg.norm(psi), np.exp(-0.5j * np.angle(psi @ psi))
    unit = psi * turn / size
    moved = moved.T * turn / size
    angle = (moved @ unit / (unit @ unit)).imag
    length = (moved @ unit.conj()).real
    return unit, share[k], moved - np.outer(1j * angle + length, unit)
