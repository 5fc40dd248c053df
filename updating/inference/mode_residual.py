"""Residuals of natural frequencies and shapes, in standard deviations, with exact derivatives."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from fem.analysis.modes import Eigenpairs, solve_eigenpairs
from fem.model import Model, ParameterRef
from fem.sensitivity.modes import differentiate_modes
from fem.system import System, assemble, reassemble
from updating.correlation import mac
from updating.inference.mode_data import ModeData

LEAST_MAC = 0.5
"""Measured modes whose best partner has less have lost it [-]."""


FAR = 0.5
"""Modes farther apart than this in ln f are no partners [-]."""


@dataclass(frozen=True, slots=True, eq=False)
class ModePairs:
    """Measured modes and their partners.

    Attributes
    ----------
    partner : ndarray of int (n,)
        Computed mode of each measured one, rigid-body modes counted; -1 where it was lost.
    computed : ndarray (n,)
        Frequencies of the partners, NaN where lost [Hz].
    mac : ndarray (n,)
        Modal assurance criterion with the partner, or with the space of close modes it is in; NaN without
        shapes [-].
    spaces : tuple of tuple of int
        Sets of close computed modes that partners belong to.
    shapes : ndarray (n_dof, n_modes)
        All computed shapes, to follow them.
    """

    partner: NDArray[np.int64]
    computed: NDArray[np.float64]
    mac: NDArray[np.float64]
    spaces: tuple[tuple[int, ...], ...]
    shapes: NDArray[np.float64]

    @property
    def lost(self) -> tuple[int, ...]:
        """Measured modes without a partner, counted from 0."""
        return tuple(int(i) for i in np.flatnonzero(self.partner < 0))


@dataclass(frozen=True, slots=True, eq=False)
class ModePoint:
    """Modes at one set of parameter values, paired with the measured ones.

    Attributes
    ----------
    r : ndarray (m,)
        Residuals.
    pairs : ModePairs
    system : System
    eigenpairs : Eigenpairs
    """

    r: NDArray[np.float64]
    pairs: ModePairs
    system: System
    eigenpairs: Eigenpairs


def mode_residual(
    data: ModeData, model: Model, before: ModePairs | None = None, near: System | None = None
) -> ModePoint:
    """Compute modes, find the partners of the measured ones, and compare.

    Frequencies have W ln(f_computed / f_measured), W whitening their noise and the model's errors, half of
    whose variance is common to all. A shape ψ of length 1 has (1 - ΦΦ⁺) ψ √n_out/σ, with Φ the
    shape of its partner or those of the close modes that the partner is one of: the part of ψ outside
    their space, whose square is 1 - MAC for a single one. Nothing depends on how shapes are scaled, or on
    which basis of a space came out. Outputs at which a mode was not measured have no part in its sum and its
    n_out.

    Partners are chosen so that the sum of MAC less |ln f ratio| is largest, with a little more for the mode
    that a partner has become since ``before``. A mode without any partner counts with the largest residual
    that a paired one may have, so that losing one never pays.

    Parameters
    ----------
    data : ModeData
    model : Model
    before : ModePairs, optional
        Pairs at the last point.
    near : System, optional
        Matrices of a model that differs in some values: equal parts are not formed again.
    """
    system = assemble(model) if near is None else reassemble(near, model)
    top = float(data.frequency[-1]) * np.exp(FAR / 2)
    pairs = solve_eigenpairs(system, max_frequency=top)
    least = len(data.frequency) if data.numbers is None else int(data.numbers.max()) + 1
    n_highest = pairs.n_rigid + least + 6
    if len(pairs.eigenvalues) < n_highest:
        pairs = solve_eigenpairs(system, n_highest)
    shapes = np.asarray(system.Q @ pairs.vectors)
    f = np.sqrt(pairs.eigenvalues) / (2 * np.pi)
    n_rigid = pairs.n_rigid
    if data.shapes is None:
        found = _by_order(data, f, shapes, n_rigid, before, system)
    else:
        found = _by_shape(data, f, shapes, n_rigid, before, system)
    ok = found.partner >= 0
    with np.errstate(invalid="ignore"):
        log_f = np.where(ok, np.log(found.computed / data.frequency), FAR)
    parts = [data.whitening(ok) @ log_f]
    if data.shapes is not None:
        at = data.rows.T @ shapes
        known = np.isfinite(data.shapes)
        for i in range(len(data.frequency)):
            n_out = known[:, i].sum()
            if ok[i]:
                e = _beside(at[:, _space(found, i)], data.shapes[:, i])
            else:
                e = np.where(known[:, i], np.sqrt((1 - LEAST_MAC) / n_out), 0.0)
            parts.append(e * np.sqrt(n_out) / data.shape_std[i])
    return ModePoint(np.concatenate(parts), found, system, pairs)


def _space(pairs: ModePairs, i: int) -> list[int]:
    partner = int(pairs.partner[i])
    return next((list(s) for s in pairs.spaces if partner in s), [partner])


def _beside(Phi: NDArray[np.float64], psi: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the part of ψ outside the space of Φ, over the outputs that ψ has; 0 at others."""
    known = np.isfinite(psi)
    out = np.zeros(len(psi))
    out[known] = psi[known] - Phi[known] @ np.linalg.lstsq(Phi[known], psi[known], rcond=1e-9)[0]
    return out


def _sets(f: NDArray[np.float64], n_rigid: int, close: float) -> list[list[int]]:
    """Return elastic modes in sets whose neighbours are closer than a relative distance."""
    sets: list[list[int]] = []
    for k in range(n_rigid, len(f)):
        if sets and f[k] - f[sets[-1][-1]] < close * f[k]:
            sets[-1].append(k)
        else:
            sets.append([k])
    return sets


def _by_order(
    data: ModeData,
    f: NDArray[np.float64],
    shapes: NDArray[np.float64],
    n_rigid: int,
    before: ModePairs | None,
    system: System,
) -> ModePairs:
    n = len(data.frequency)
    nothing = np.full(n, np.nan)
    if data.numbers is None:
        partner = np.arange(n) + n_rigid
    elif before is None:
        partner = data.numbers + n_rigid
    else:  # those that look like the last partners, in the product of the mass matrix
        follow = _followed(before.shapes[:, np.maximum(before.partner, 0)], shapes, system)
        follow[:, :n_rigid] = 0.0
        partner = linear_sum_assignment(-follow)[1].astype(np.int64)
    gone = partner >= len(f)
    partner = np.where(gone, -1, partner)
    computed = np.where(gone, np.nan, f[np.maximum(partner, 0)])
    spaces = tuple(tuple(s) for s in _sets(f, n_rigid, data.close) if len(s) > 1 and set(s) & set(partner))
    return ModePairs(partner, computed, nothing, spaces, shapes)


def _followed(old: NDArray[np.float64], new: NDArray[np.float64], system: System) -> NDArray[np.float64]:
    """Return (φ_oldᵀ M φ_new)², near 1 where a mode has become the other."""
    return np.square((system.Q.T @ old).T @ (system.M @ (system.Q.T @ new)))


def _by_shape(
    data: ModeData,
    f: NDArray[np.float64],
    shapes: NDArray[np.float64],
    n_rigid: int,
    before: ModePairs | None,
    system: System,
) -> ModePairs:
    assert data.shapes is not None
    at = data.rows.T @ shapes
    n = len(data.frequency)
    sets = _sets(f, n_rigid, data.close)
    likeness = mac(data.shapes, at)
    inside = np.zeros((n, len(f)))
    for s in sets:
        for i in range(n):
            e = _beside(at[:, s], data.shapes[:, i]) if len(s) > 1 else None
            inside[i, s] = likeness[i, s] if e is None else 1 - e @ e
    distance = np.abs(np.log(data.frequency[:, None] / np.maximum(f, 1e-300)))
    score = inside - distance + 1e-3 * likeness
    if before is not None:
        follow = _followed(before.shapes[:, np.maximum(before.partner, 0)], shapes, system)
        score = score + 0.1 * np.where((before.partner >= 0)[:, None], follow, 0.0)
    allowed = (inside >= LEAST_MAC) & (distance < FAR)
    allowed[:, :n_rigid] = False
    partner = np.full(n, -1)
    rows, columns = linear_sum_assignment(-np.where(allowed, score, -10.0))
    for i, j in zip(rows, columns, strict=True):
        if allowed[i, j]:
            partner[i] = j
    for s in sets:  # within a space modes follow the order of the frequencies
        mine = np.flatnonzero(np.isin(partner, s))
        partner[mine] = np.sort(partner[mine])
    ok = partner >= 0
    return ModePairs(
        partner,
        np.where(ok, f[np.maximum(partner, 0)], np.nan),
        np.where(ok, inside[np.arange(n), np.maximum(partner, 0)], likeness.max(axis=1, initial=0.0)),
        tuple(tuple(s) for s in sets if len(s) > 1 and set(s) & set(partner[ok])),
        shapes,
    )


def mode_jacobian(data: ModeData, point: ModePoint, refs: Sequence[ParameterRef]) -> NDArray[np.float64]:
    """Return the derivatives of the residuals of :func:`mode_residual`, shape (n_ref, m).

    d ln f = dω²/(2ω²). With P = ΦΦ⁺ the shape's is -(1 - P) dΦ Φ⁺ψ - Φ⁺ᵀ dΦᵀ (1 - P) ψ (Golub and Pereyra,
    *SIAM J. Numer. Anal.* 10, 1973, 413, (4.12)).
    """
    pairs, eigen = point.pairs, point.eigenpairs
    used = [k for i in range(len(pairs.partner)) if pairs.partner[i] >= 0 for k in _space(pairs, i)]
    J = np.zeros((len(refs), point.r.size))
    if not used or not refs:
        return J
    n = max(used) + 1
    if n >= len(eigen.eigenvalues):
        eigen = solve_eigenpairs(point.system, min(n + max(6, n // 4), point.system.n_free))
    outputs = None if data.shapes is None else data.rows.T
    given = eigen if n < len(eigen.eigenvalues) else None
    s = differentiate_modes(
        point.system, refs, n, outputs=outputs, pairs=given, close=2 * data.close, tolerance=1e-6
    )
    n_modes = len(pairs.partner)
    for i in range(n_modes):
        k = int(pairs.partner[i])
        if k < 0:
            continue
        J[:, i] = s.eigenvalue[:, k] / (2 * (2 * np.pi * pairs.computed[i]) ** 2)
        if data.shapes is None or s.shapes is None:
            continue
        columns = _space(pairs, i)
        known = np.flatnonzero(np.isfinite(data.shapes[:, i]))
        Phi = (data.rows.T @ s.modes.shapes[:, columns])[known]
        plus = np.linalg.pinv(Phi, rcond=1e-9)
        psi = data.shapes[known, i]
        e = psi - Phi @ (plus @ psi)
        at = n_modes + i * len(data.shapes) + known
        for p in range(len(refs)):
            d = s.shapes[p][np.ix_(known, np.array(columns))]
            moved = d @ (plus @ psi)
            de = -(moved - Phi @ (plus @ moved)) - plus.T @ (d.T @ e)
            J[p, at] = de * np.sqrt(len(known)) / data.shape_std[i]
    J[:, :n_modes] = J[:, :n_modes] @ data.whitening(pairs.partner >= 0).T
    return J
