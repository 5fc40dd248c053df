"""Condensation: a system on a few of its DOFs, by Guyan, dynamic, IRS, SEREP or Craig-Bampton.

All are Galerkin projections u = T x with K_r = TᵀKT and so on, so that every natural frequency of the reduced
system lies above the one of the same number of the full system (Courant and Fischer).
"""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import scipy.linalg as sla
import scipy.sparse as sp

from fem.analysis.modes import MechanismError, Modes, n_negative, solve_eigenpairs
from fem.analysis.selection import Selection, dof_vectors
from fem.array_types import Complexes, Floats, Ints
from fem.linalg.solvers import Factor, SingularMatrixError, factorise
from fem.model import Law, ModelError
from fem.reduction.expansion import left_inverse
from fem.summary import fields_summary
from fem.system import System, law_change

_ROUNDING = 1e-12
"""Entries of Q below this are rounding: the DOF does not move with the coordinate."""


@dataclass(frozen=True, slots=True, eq=False)
class Reduction:
    """A system on a few coordinates x, with u = T x on all DOFs.

    Attributes
    ----------
    method : str
        ``"guyan"``, ``"dynamic"``, ``"irs"``, ``"serep"`` or ``"craig-bampton"``.
    T : ndarray (n_dof, r)
        From the reduced coordinates to all DOFs.
    K, M, C, D : ndarray (r, r)
        Reduced matrices; Rayleigh, structural and modal damping of the structure are not in C and D.
    labels : tuple of str
        Names of the coordinates: kept DOFs such as ``"3Z+"``, then ``"fixed mode 1"`` and so on.
    n_kept : int
        How many of the first coordinates are kept DOFs; the others are amplitudes of modes.
    rank : int
        Number of independent columns of T: r, or the number of modes of a SEREP with more DOFs than modes,
        whose reduced matrices are then singular.
    laws : tuple of (Law, ndarray (r, r))
        Frequency-dependent elements.
    system : System
        The full system.
    flexibility : callable or None
        b ↦ K⁺ b on the independent coordinates, for loads that rigid-body motions do not feel. None where the
        method has no static condensation, which gives it at no cost.
    """

    method: str
    T: Floats
    K: Floats
    M: Floats
    C: Floats
    D: Floats
    labels: tuple[str, ...]
    n_kept: int
    rank: int
    laws: tuple[tuple[Law, Floats], ...]
    system: System
    flexibility: Callable[[Floats], Floats] | None = field(repr=False)

    __repr__ = fields_summary

    def dynamic_stiffness(self, omega: float) -> Complexes:
        """Return Z(ω) with the structure's Rayleigh and structural damping, (r, r).

        Modal damping ratios have no matrix and are left out.

        Parameters
        ----------
        omega : float
            Angular frequency [rad/s].
        """
        damping = self.system.model.damping
        Z = (1 + 1j * (damping.loss_factor + omega * damping.beta)) * self.K + 1j * (self.D + omega * self.C)
        Z = Z + (1j * omega * damping.alpha - omega**2) * self.M
        for law, K in self.laws:
            Z = Z + law_change(law, np.array([omega]))[0] * K
        return Z

    def modes(self, n: int | None = None) -> Modes:
        """Return the reduced system's modes, on all DOFs of the mesh.

        Parameters
        ----------
        n : int, optional
            Number of modes; all unless given.
        """
        eigenvalues, vectors = self.eigenpairs()
        eigenvalues, vectors = eigenvalues[:n], vectors[:, :n]
        return Modes(np.sqrt(np.maximum(eigenvalues, 0.0)) / (2 * np.pi), self.T @ vectors)

    def eigenpairs(self) -> tuple[Floats, Floats]:
        """Return ω² (n,), rising, and M-orthonormal vectors (r, n) of the reduced matrices."""
        K, M = self.K, self.M
        V = np.eye(len(K))
        if self.rank < len(K):
            scale = 1 / np.sqrt(np.maximum(M.diagonal(), 1e-300))
            V = scale[:, None] * np.linalg.eigh(scale[:, None] * M * scale)[1][:, -self.rank :]
            K, M = V.T @ K @ V, V.T @ M @ V
        eigenvalues, vectors = _small_eigenpairs(K, M, self.system.rigid.shape[1])
        return eigenvalues, V @ vectors


def reduce_guyan(system: System, keep: Selection) -> Reduction:
    """Reduce statically: u_o = -K_oo⁻¹ K_oa u_a.

    Guyan (*AIAA J.* 3, 1965, 380) and Irons (*AIAA J.* 3, 1965, 961). Exact at ω = 0; the relative error of
    ω² grows with (ω/ω_c)², ω_c the lowest natural frequency of the structure held at its kept DOFs.

    Parameters
    ----------
    system : System
    keep : selection
        DOF numbers or (point, direction) pairs that stay.

    Raises
    ------
    ModelError
        For kept DOFs that a support holds, that are tied to others or given twice, or that leave the
        structure loose when they are held.
    UnstableError
        For a structure with a motion of negative stiffness.
    """
    part = _partition(system, keep)
    fixed = _fix(system, part)
    return _project(system, "guyan", part, _spread(part, fixed.static), fixed)


def reduce_dynamic(system: System, keep: Selection, frequency: float) -> Reduction:
    """Reduce at a frequency: u_o = -(K_oo - ω²M_oo)⁻¹ (K_oa - ω²M_oa) u_a.

    Exact at that frequency and a mode there (Leung, *Int. J. Numer. Meth. Eng.* 12, 1978, 1705); static at
    0 Hz.

    Parameters
    ----------
    system : System
    keep : selection
        DOF numbers or (point, direction) pairs that stay.
    frequency : float
        [Hz].

    Raises
    ------
    ModelError
        As :func:`reduce_guyan`, or if the frequency is one of the structure held at its kept DOFs.
    """
    part = _partition(system, keep)
    Z = sp.csc_array(system.K - (2 * np.pi * frequency) ** 2 * system.M)
    coupling = Z[part.omitted][:, part.kept].toarray()
    what = f"{frequency:g} Hz is a natural frequency of the structure held at the kept DOFs; move it"
    try:
        factor = factorise(Z[part.omitted][:, part.omitted])
    except SingularMatrixError:
        raise ModelError(what) from None
    t = -factor.solve(coupling)
    residual = Z[part.omitted][:, part.omitted] @ t + coupling
    if not np.isfinite(t).all() or np.linalg.norm(residual) > 1e-6 * np.linalg.norm(coupling):
        raise ModelError(what)
    return _project(system, "dynamic", part, _spread(part, t), None)


def reduce_irs(system: System, keep: Selection, iterations: int = 1) -> Reduction:
    """Reduce by the improved reduced system: the omitted DOFs' inertia acts as static forces.

    t ← t_s + K_oo⁻¹ (M_oa + M_oo t) M_r⁻¹ K_r, starting from Guyan's t_s. One iteration is O'Callahan's IRS
    (IMAC VII, 1989, 17-21); more tend to the exact lowest modes (Friswell, Garvey & Penny, *J. Sound Vib.*
    186, 1995, 311-323).

    Parameters
    ----------
    system : System
    keep : selection
        DOF numbers or (point, direction) pairs that stay.
    iterations : int
        At least 1.

    Raises
    ------
    ModelError
        As :func:`reduce_guyan`, for no iteration, or if kept DOFs have no mass.
    """
    if iterations < 1:
        msg = f"{iterations} iterations are asked for; IRS needs at least 1"
        raise ModelError(msg)
    part = _partition(system, keep)
    fixed = _fix(system, part)
    M_oo, M_oa = system.M[part.omitted][:, part.omitted], system.M[part.omitted][:, part.kept]
    t = fixed.static
    for _ in range(iterations):
        T = _spread(part, t)
        K, M = (T.T @ (X @ T) for X in (system.K, system.M))
        eigenvalues, y = _small_eigenpairs(K, M, system.rigid.shape[1])
        if len(eigenvalues) < len(K):
            name = part.labels[int(np.argmin(M.diagonal() / K.diagonal()))]
            msg = f"kept DOF {name} has no mass; IRS needs some at every kept DOF, so leave it out"
            raise ModelError(msg)
        slope = (y * eigenvalues) @ (y.T @ M)  # M_r⁻¹ K_r
        if fixed.factor is None:
            break
        t = fixed.static + fixed.factor.solve((M_oa + M_oo @ t) @ slope)
    return _project(system, "irs", part, _spread(part, t), fixed)


def reduce_serep(system: System, keep: Selection, n_modes: int | None = None) -> Reduction:
    """Reduce to modes seen at the kept DOFs: T = Φ Φ_a⁺.

    SEREP (O'Callahan, Avitabile & Riemer, IMAC VII, 1989, 29-37). The natural frequencies are those of
    the full system. With fewer modes than kept DOFs the reduced matrices have the rank of the modes.

    Parameters
    ----------
    system : System
    keep : selection
        DOF numbers or (point, direction) pairs that stay.
    n_modes : int, optional
        Number of lowest modes, rigid-body modes included; as many as kept DOFs unless given.

    Raises
    ------
    ModelError
        As :func:`reduce_guyan`, for more modes than kept DOFs, or modes that they cannot tell apart.
    """
    part = _partition(system, keep)
    n = len(part.kept) if n_modes is None else n_modes
    if n > len(part.kept):
        msg = f"{len(part.kept)} kept DOFs cannot distinguish {n} modes; keep more, or ask for fewer modes"
        raise ModelError(msg)
    pairs = solve_eigenpairs(system, n)
    frequency = np.sqrt(pairs.eigenvalues) / (2 * np.pi)
    inverse, _ = left_inverse(pairs.vectors[part.kept], frequency, len(part.kept))
    return _project(system, "serep", part, pairs.vectors @ inverse, None, rank=pairs.vectors.shape[1])


def reduce_craig_bampton(
    system: System, keep: Selection, n_modes: int | None = None, max_frequency: float | None = None
) -> Reduction:
    """Reduce to the kept DOFs' static responses and modes of the structure held there.

    Craig and Bampton (*AIAA J.* 6, 1968, 1313-1319).

    Parameters
    ----------
    system : System
    keep : selection
        DOF numbers or (point, direction) pairs that stay.
    n_modes : int, optional
        Number of modes of the held structure; 20 unless ``max_frequency`` is given.
    max_frequency : float, optional
        All of them up to this frequency [Hz]; twice the highest one of interest is usual.

    Raises
    ------
    ModelError
        As :func:`reduce_guyan`.
    """
    part = _partition(system, keep)
    fixed = _fix(system, part)
    T = _spread(part, fixed.static)
    if len(part.omitted) and n_modes != 0:
        pairs = solve_eigenpairs(_fixed_system(system, part.omitted), n_modes, max_frequency)
        modes = np.zeros((system.n_free, pairs.vectors.shape[1]))
        modes[part.omitted] = pairs.vectors
        T = np.hstack([T, modes])
    return _project(system, "craig-bampton", part, T, fixed)


@dataclass(frozen=True, slots=True, eq=False)
class _Partition:
    """Which independent coordinates stay and which are left out."""

    kept: Ints
    omitted: Ints
    labels: tuple[str, ...]


@dataclass(frozen=True, slots=True, eq=False)
class _Fixed:
    """The structure fixed at the kept DOFs: the factor of K_oo, None if all are kept; t_s = -K_oo⁻¹ K_oa."""

    factor: Factor | None
    static: Floats


def _partition(system: System, keep: Selection) -> _Partition:
    model = system.model
    if isinstance(keep, np.ndarray) and keep.ndim == 2:
        msg = "kept DOFs are DOF numbers or (point, direction) pairs; combinations cannot be kept"
        raise ModelError(msg)
    if not len(keep):
        msg = "a reduction needs at least one DOF to keep"
        raise ModelError(msg)
    columns, labels = dof_vectors(model, keep)
    dofs = columns.argmax(axis=0)
    Q = sp.csr_array(system.Q)
    kept = np.empty(len(dofs), dtype=np.int64)
    for i, (dof, label) in enumerate(zip(dofs.tolist(), labels, strict=True)):
        at = slice(Q.indptr[dof], Q.indptr[dof + 1])
        real = np.abs(Q.data[at]) > _ROUNDING
        column, entry = Q.indices[at][real], Q.data[at][real]
        if len(column) == 1 and abs(abs(entry[0]) - 1) < _ROUNDING:
            kept[i] = column[0]
            continue
        names = sorted({c.key[0] for c in model.constraints() if dof in c.dofs})
        by = " and ".join(f"'{name}'" for name in names)
        if not len(column) and not names:
            msg = f"DOF {label} has neither stiffness nor mass; it cannot be kept"
        elif not len(column):
            msg = f"DOF {label} is held by {by}; keep one that can move"
        else:
            msg = f"DOF {label} is tied to others by {by}; keep one that is free, or a sensor next to it"
        raise ModelError(msg)
    values, counts = np.unique(kept, return_counts=True)
    if (counts > 1).any():
        twice = labels[int(np.flatnonzero(kept == values[counts > 1][0])[0])]
        msg = f"DOF {twice} is kept twice"
        raise ModelError(msg)
    return _Partition(kept, np.setdiff1d(np.arange(system.n_free), kept), labels)


def _spread(part: _Partition, t: Floats) -> Floats:
    """Return T (n_free, a) with the identity at the kept coordinates and t at the others."""
    T = np.zeros((len(part.kept) + len(part.omitted), len(part.kept)))
    T[part.kept] = np.eye(len(part.kept))
    T[part.omitted] = t
    return T


def _fix(system: System, part: _Partition) -> _Fixed:
    loose = system.rigid.shape[1]
    if loose:
        s = np.linalg.svd(system.rigid[part.kept], compute_uv=False)
        loose -= int((s > 1e-9 * np.abs(system.rigid).max()).sum())
    if loose:
        msg = (
            f"held at its {len(part.kept)} kept DOFs, the structure still has {loose} rigid-body motion(s); "
            "keep DOFs that stop them"
        )
        raise ModelError(msg)
    K = sp.csc_array(system.K)[part.omitted]
    coupling = K[:, part.kept].toarray()
    if not len(part.omitted):
        _refuse_unstable(system, part, coupling.T @ coupling, 0)
        return _Fixed(None, coupling)
    try:
        factor = factorise(K[:, part.omitted])
    except SingularMatrixError:
        msg = "the structure held at its kept DOFs has motions without stiffness; keep DOFs that stop them"
        raise ModelError(msg) from None
    static = -factor.solve(coupling)
    _refuse_unstable(system, part, coupling.T @ static, n_negative(K[:, part.omitted], factor))
    return _Fixed(factor, static)


def _refuse_unstable(system: System, part: _Partition, change: Floats, n_omitted: int) -> None:
    """Raise an UnstableError if K has negative eigenvalues: those of K_oo and of its static condensation."""
    K = sp.csc_array(system.K)[part.kept][:, part.kept].toarray()
    scale = 1 / np.sqrt(np.maximum(K.diagonal(), 1e-300))
    K = scale[:, None] * (K + (change + change.T) / 2) * scale
    # Eigenvalues of a static condensation above minus this may be rounding, relative to the diagonal of the
    # condensed matrix [-]
    if n_omitted or np.linalg.eigvalsh(K)[0] < -1e-13:
        with suppress(MechanismError):
            solve_eigenpairs(system, 1)


def _fixed_system(system: System, omitted: Ints) -> System:
    """Return the system of the structure held at its kept DOFs."""

    def inner(X: sp.csc_array) -> sp.csc_array:
        return sp.csc_array(sp.csc_array(X)[omitted][:, omitted])

    return replace(
        system,
        K=inner(system.K),
        M=inner(system.M),
        C=inner(system.C),
        D=inner(system.D),
        Q=sp.csr_array(system.Q[:, omitted]),
        rigid=np.zeros((len(omitted), 0)),
        laws=tuple((law, inner(X)) for law, X in system.laws),
    )


def _project(
    system: System, method: str, part: _Partition, T: Floats, fixed: _Fixed | None, rank: int | None = None
) -> Reduction:
    def inner(X: Any) -> Floats:
        small = T.T @ (X @ T)
        return (small + small.T) / 2

    K, M, C, D = (inner(X) for X in (system.K, system.M, system.C, system.D))
    n_kept = len(part.kept)
    names = (*part.labels, *(f"fixed mode {k + 1}" for k in range(T.shape[1] - n_kept)))
    flexibility = None if fixed is None else _condensed_flexibility(system, part, fixed)
    laws = tuple((law, inner(X)) for law, X in system.laws)
    return Reduction(
        method, system.Q @ T, K, M, C, D, names, n_kept, rank or T.shape[1], laws, system, flexibility
    )


def _small_eigenpairs(K: Floats, M: Floats, n_rigid: int) -> tuple[Floats, Floats]:
    """Return ω² and M-orthonormal vectors of dense matrices; directions without mass have none."""
    shift = 1e-9 * float(K.diagonal().sum() / M.diagonal().sum())
    eigenvalues, vectors = np.zeros(0), np.zeros((0, 0))
    for _ in range(2):
        # K + σM is definite also for free structures, and scaled to a unit diagonal metres and radians count
        # alike.
        shifted = K + shift * M
        scale = 1 / np.sqrt(shifted.diagonal())
        nu, vectors = sla.eigh(scale[:, None] * M * scale, scale[:, None] * shifted * scale)
        nu, vectors = nu[::-1], scale[:, None] * vectors[:, ::-1]
        keep = nu > 1e-14 * nu[0]
        nu, vectors = nu[keep], vectors[:, keep] / np.sqrt(nu[keep])
        high = np.einsum("ij,ij->j", vectors, K @ vectors)
        eigenvalues = np.where(nu > 1e-8 * nu[0], 1 / nu - shift, high)
        shift = max(shift, 0.1 * float(eigenvalues[min(n_rigid, len(nu) - 1)]))
    return eigenvalues, vectors


def _condensed_flexibility(system: System, part: _Partition, fixed: _Fixed) -> Callable[[Floats], Floats]:
    """Return b ↦ K⁺ b for loads that rigid-body motions do not feel: block elimination with K_oo's factor.

    K⁻¹ = T_s K_s⁻¹ T_sᵀ + K_oo⁻¹ with Guyan's T_s and K_s, which is singular for a free structure.
    """
    T = _spread(part, fixed.static)
    K = T.T @ (system.K @ T)
    scale = 1 / np.sqrt(K.diagonal())
    K = scale[:, None] * (K + K.T) / 2 * scale
    N = np.linalg.qr(system.rigid[part.kept] / scale[:, None])[0]
    inner = sla.cho_factor(K + N @ N.T)

    def solve(b: Floats) -> Floats:
        x = T @ (scale[:, None] * sla.cho_solve(inner, scale[:, None] * (T.T @ b)))
        if fixed.factor is not None:
            x[part.omitted] += fixed.factor.solve(b[part.omitted])
        return x

    return solve
