"""Shapes scaled to a modal mass of 1 at driving points, and their standard deviations."""

import warnings

import numpy as np

from fem.array_types import Complexes, Floats, Ints
from updating.correlation.complexity import (
    mean_phase,
    real_shapes,
)
from updating.modal.modal_fit import ModalFit, ModalScatter


def scaled(
    poles: Complexes, psi: Complexes, L: Complexes, points: tuple[tuple[int, int, int], ...]
) -> tuple[Complexes, Complexes]:
    """Return shapes and participations of the same residues, scaled to a modal mass of 1.

    A mode of mass 1 has residues φ_o φ_i / (2i Im λ): of the scale s with φ = sψ, s² ψ_d = 2i Im λ L_d at
    driving points d, in least squares.
    """
    if not points:
        s = (
            1 / psi[np.argmax(np.abs(psi), axis=0), np.arange(psi.shape[1])]
            if psi.size
            else np.ones(psi.shape[1])
        )
        return psi * s, L / s[:, None]
    s = _scale_of(poles, psi, L, points)
    phi = psi * s
    turned = np.abs(np.cos(mean_phase(phi)))
    if psi.size and (np.median(turned) < np.sqrt(0.5)):
        warnings.warn(
            "the residues of the driving points have the wrong sign in most modes. Check whether response "
            "and force point in opposite directions; if they do, the sizes of the shapes are right",
            stacklevel=4,
        )
    return phi, L / s[:, None]


def _scale_of(
    poles: Complexes, psi: Complexes, L: Complexes, points: tuple[tuple[int, int, int], ...]
) -> Complexes:
    """Return s with s² ψ_d = 2i Im λ L_d at driving points d, in least squares."""
    out, inn, sign = (np.array(p) for p in zip(*points, strict=True))
    here, there = psi[out].T, L[:, inn] * sign
    power = np.maximum((np.abs(here) ** 2).sum(axis=1), 1e-300)
    return np.sqrt(2j * poles.imag * (here.conj() * there).sum(axis=1) / power)


def shape_deviation(
    fit: ModalFit, order: Ints, points: tuple[tuple[int, int, int], ...], turned: bool
) -> tuple[Floats, Floats]:
    """Return standard deviations of the real, scaled shapes, the modes in an order.

    Linearised: differences of the scaled shape by each unknown of the mode, scale and mean phase included.

    Returns
    -------
    entries : ndarray (n_out, n_modes)
    across : ndarray (n_modes,)
        Root mean square of the deviations across the shape over that of its entries, which stays at any
        scale [-].
    """
    n_psi, scatter = len(fit.shapes), fit.scatter
    n_out = fit.participation.shape[1] if turned else n_psi
    out, relative = np.zeros((n_out, order.size)), np.zeros(order.size)
    for column, r in enumerate(order.tolist()):
        entries = np.flatnonzero(scatter.rows == r)
        n_other = 2 + 2 * entries.size
        m = n_other + 2 * n_psi
        size = float(np.abs(fit.shapes[:, r]).max()) or 1.0
        step = np.full(m, 1e-6)
        step[n_other:] *= size
        poles = np.full(m + 1, fit.poles[r])
        psi, L = (np.tile(x, (m + 1, 1)).astype(complex) for x in (fit.shapes[:, r], fit.participation[r]))
        decay = -fit.poles[r].real
        poles[1] = -decay * np.exp(step[0]) + 1j * fit.poles[r].imag
        poles[2] += 1j * decay * step[1]
        for k, i in enumerate(entries):
            for part, unit in enumerate((1.0, 1j)):
                row = 3 + 2 * k + part
                L[row, scatter.cols[i]] += unit * step[row - 1]
        rows = np.arange(n_psi)
        psi[n_other + 1 + 2 * rows, rows] += step[n_other]
        psi[n_other + 2 + 2 * rows, rows] += 1j * step[n_other]
        if turned:
            psi, L = L, psi
        largest = np.argmax(np.abs(psi[0]))
        s = _scale_of(poles, psi.T, L, points) if points else 1 / psi[:, largest]
        real = real_shapes(psi.T * s)
        real = real * np.sign((real * real[:, :1]).sum(axis=0))  # the sign of a shape is arbitrary
        J = (real[:, 1:] - real[:, :1]) / step
        among = np.concatenate([[2 * r, 2 * r + 1], *((a, a + 1) for a in 2 * len(fit.poles) + 2 * entries)])
        phi = real[:, 0]
        power = max(float(phi @ phi), 1e-300)
        across = J - np.outer(phi, phi @ J) / power
        variance, rest = (
            _variance(part, n_other, among.astype(np.int64), scatter, r) for part in (J, across)
        )
        out[:, column], relative[column] = np.sqrt(variance), np.sqrt(rest.sum() / power)
    return out, relative


def _variance(J: Floats, n_other: int, among: Ints, scatter: ModalScatter, r: int) -> Floats:
    """Return the variances (n,) of quantities with derivatives J (n, m) by the unknowns of a mode."""
    by_shape = J[:, n_other:].reshape(len(J), -1, 2)
    F = np.einsum("pob,obi->pi", by_shape, scatter.slope[r])
    F[:, among] += J[:, :n_other]
    conditional = np.einsum("pob,obc,poc->p", by_shape, scatter.conditional[r], by_shape, optimize=True)
    return conditional + np.einsum("pi,ij,pj->p", F, scatter.covariance, F, optimize=True)
