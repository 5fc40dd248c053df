"""Condense the lines of FRFs for a fit of modes, without loss.

Away from its pole a modal term is a polynomial of the frequency to rounding: on a segment of lines it is
Σ_j E_kj f(ω_j), with its values at n Chebyshev nodes ω_j and Lagrange's interpolation E. With E/σ = Q R,

    Σ_k |y_k - f(ω_k)|² / σ_k² = ‖Qᵀ(y/σ) - R f(nodes)‖² + ‖y/σ‖² - ‖Qᵀ(y/σ)‖²

holds for every choice of modes. Qᵀ(y/σ) is a sufficient statistic: n values say as much about the modes as
all lines of the segment, and nothing is averaged or left out. The last two terms do not depend on the modes.
They stay in the sum of squares, so that standard deviations and degrees of freedom are those of all lines.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev

from fem.array_types import Complexes, Floats, Ints

N_NODES = 20
"""Nodes of a segment; a segment of no more lines keeps them as they are."""


@dataclass(frozen=True, slots=True, eq=False)
class CondensedLines:
    """Weighted FRFs at few nodes in place of all lines.

    Attributes
    ----------
    omega : ndarray (n_nodes,)
        Single lines, then the nodes of one segment after another [rad/s].
    weight : ndarray (n_in, n_single)
        Factors of values at single lines [-].
    triangles : ndarray (n_in, n_segments, N_NODES, N_NODES)
        R: factors of values at the nodes of a segment [-].
    target : ndarray (2 n_in n_nodes, n_out)
        Weighted FRFs in the layout of :meth:`columns` [-].
    residual : float
        Sum of squares of the weighted FRFs that ``target`` has not, which no mode can change [-].
    n_values : int
        Real numbers that the FRFs have at all lines.
    segments : ndarray (n_segments, 2)
        Lowest and highest frequency [rad/s].
    """

    omega: Floats
    weight: Floats
    triangles: Floats
    target: Floats
    residual: float
    n_values: int
    segments: Floats

    def columns(self, values: Complexes, i: int) -> Floats:
        """Return weighted values (n_nodes, n) of input i: real above imaginary parts, (2 n_nodes, n)."""
        n_single = self.weight.shape[1]
        out = np.empty((2, *values.shape))
        for k, v in enumerate((values.real, values.imag)):
            out[k, :n_single] = v[:n_single] * self.weight[i][:, None]
            nodes = v[n_single:].reshape(len(self.segments), N_NODES, v.shape[1])
            out[k, n_single:] = (self.triangles[i] @ nodes).reshape(len(v) - n_single, v.shape[1])
        return out.reshape(2 * len(values), values.shape[1])

    def holds(self, poles: Complexes) -> bool:
        """Return whether terms with poles at these frequencies, of rad/s, are still interpolated exactly."""
        # Least parameter ρ of the ellipse through a pole about a segment's ends: the error of interpolation
        # falls as ρ^-N_NODES, which is 3e-10 [-]
        return bool((_ellipse(self.segments, poles) >= 3.0).all())


def condense_lines(omega: Floats, H: Complexes, spread: Floats, poles: Complexes) -> CondensedLines:
    """Condense FRFs for a fit of terms with poles near given ones.

    Parameters
    ----------
    omega : ndarray (n_freq,)
        Lines, rising [rad/s].
    H : ndarray of complex (n_freq, n_out, n_in)
        FRFs over the standard deviation of each output [-].
    spread : ndarray (n_freq, n_in)
        Standard deviation of each line and input, which multiplies the outputs' [-].
    poles : ndarray of complex (n,)
        Frequencies at which the terms are infinite [rad/s].
    """
    bounds, single = _layout(omega, poles)
    n_freq, n_out, n_in = H.shape
    nodes = np.cos(np.pi * (np.arange(N_NODES) + 0.5) / N_NODES)
    ends = np.stack([omega[bounds[:, 0]], omega[bounds[:, 1] - 1]], axis=1)
    centre, half = ends.mean(axis=1), np.diff(ends, axis=1)[:, 0] / 2
    to_values = np.linalg.inv(chebyshev.chebvander(nodes, N_NODES - 1))
    triangles = np.empty((n_in, len(bounds), N_NODES, N_NODES))
    target = np.empty((n_in, 2, single.size + len(bounds) * N_NODES, n_out))
    kept = target[:, :, single.size :].reshape(n_in, 2, len(bounds), N_NODES, n_out)
    count = bounds[:, 1] - bounds[:, 0]
    residual = 0.0
    for i in range(n_in):
        y = H[:, :, i] / spread[:, i, None]
        target[i, 0, : single.size], target[i, 1, : single.size] = y[single].real, y[single].imag
        for n in np.unique(count):
            alike = np.flatnonzero(count == n)
            rows = bounds[alike, :1] + np.arange(n)
            t = (omega[rows] - centre[alike, None]) / half[alike, None]
            E = chebyshev.chebvander(t, N_NODES - 1) @ to_values
            Q, triangles[i, alike] = np.linalg.qr(E / spread[rows, i, None])
            for part, values in enumerate((y[rows].real, y[rows].imag)):
                kept[i, part, alike] = inside = Q.mT @ values
                residual += float(((values - Q @ inside) ** 2).sum())
    target[:, :, single.size :] = kept.reshape(n_in, 2, -1, n_out)
    at = np.concatenate([omega[single], (centre[:, None] + half[:, None] * nodes).ravel()])
    return CondensedLines(
        at,
        (1 / spread[single]).T,
        triangles,
        target.reshape(-1, n_out),
        residual,
        2 * n_freq * n_out * n_in,
        ends,
    )


def _layout(omega: Floats, poles: Complexes) -> tuple[Ints, Ints]:
    """Return first line and end of each segment, (n_segments, 2), and the lines that stay single.

    The band is halved until each part lies far enough from all poles or has no more lines than nodes.
    """
    parts, segments, single = np.array([[0, omega.size]]), [np.zeros((0, 2), dtype=np.int64)], []
    while parts.size:
        few = parts[:, 1] - parts[:, 0] <= N_NODES
        single += [np.arange(first, end) for first, end in parts[few]]
        parts = parts[~few]
        ends = np.stack([omega[parts[:, 0]], omega[parts[:, 1] - 1]], axis=1)
        # Least parameter ρ of the ellipses when segments are laid out, so that poles have room to move [-]
        far = (_ellipse(ends, poles) >= 4.0).all(axis=1)
        segments.append(parts[far])
        parts = parts[~far]
        middle = parts.sum(axis=1) // 2
        parts = np.concatenate(
            [np.stack([parts[:, 0], middle], axis=1), np.stack([middle, parts[:, 1]], axis=1)]
        )
    lines = np.sort(np.concatenate(single)) if single else np.zeros(0, dtype=np.int64)
    return np.concatenate(segments), lines


def _ellipse(segments: Floats, poles: Complexes) -> Floats:
    """Return the parameters ρ of the ellipses with foci at a segment's ends through poles, (n, n_poles).

    Interpolation at n Chebyshev nodes errs by a multiple of ρ⁻ⁿ (Trefethen, *Approximation Theory and
    Approximation Practice*, 2013, theorem 8.2).
    """
    half = np.diff(segments, axis=1) / 2
    z = (poles - segments.mean(axis=1)[:, None]) / half
    return np.abs(z + np.sqrt(z - 1) * np.sqrt(z + 1))
