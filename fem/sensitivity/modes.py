"""Derivatives of natural frequencies and mode shapes.

The derivatives of the matrices are only ever multiplied on the DOFs that they touch.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg as sla

from fem.analysis.modes import Eigenpairs, Modes, solve_eigenpairs
from fem.analysis.selection import Selection, dof_vectors
from fem.array_types import Floats, Ints
from fem.model import Array, ModelError, ParameterRef
from fem.sensitivity.matrices import MatrixDerivative, differentiate_matrices, finite_value
from fem.summary import fields_summary
from fem.system import System

_EQUAL = 1e-8
"""Relative difference of ω² that is rounding: such modes count as repeated."""

_LOST = 1e-12
"""Square of the relative size below which new directions of a block are left out: soon they are rounding.

Vectors of rounding spoil the sums: with 10⁻¹⁶ digits were lost that 10⁻¹² keeps.
"""

_PATIENCE = 8
"""Blocks of a Krylov sequence after which an error that has not been halved is left as it is: rounding."""


@dataclass(frozen=True, slots=True, eq=False)
class ModeSet:
    """Modes so close that only the space that they span has derivatives worth having.

    Attributes
    ----------
    modes : ndarray of int (s,)
        Their numbers, counted from 0.
    eigenvalues : ndarray (s,)
        Their ω² [rad²/s²].
    matrix : ndarray (n_par, s, s)
        S = Φᵀ dK Φ - ½ (Λ Φᵀ dM Φ + Φᵀ dM Φ Λ), the derivative of ΦᵀKΦ on the M-orthonormal basis Φ.
    """

    modes: Ints
    eigenvalues: Floats
    matrix: Floats

    def frequencies_after(self, parameter: int, step: float) -> Floats:
        """Return the set's frequencies after a step of one parameter, rising, shape (s,) [Hz].

        Those of Λ + step · S: the error is of the order of step², however close the modes are.

        Parameters
        ----------
        parameter : int
            Which of the parameters.
        step : float
            Change of its value.
        """
        after = np.linalg.eigvalsh(np.diag(self.eigenvalues) + step * self.matrix[parameter])
        return np.sqrt(np.maximum(after, 0.0)) / (2 * np.pi)


@dataclass(frozen=True, slots=True, eq=False)
class ModeSensitivity:
    """Derivatives of modes with respect to parameters.

    Attributes
    ----------
    refs : tuple of (effect, parameter)
        The parameters.
    modes : Modes
        The modes that were differentiated; within a set, derivatives refer to this basis.
    eigenvalue : ndarray (n_par, n)
        Derivatives of ω² [rad²/s² per unit of the parameter]. Where modes are repeated, those of the
        frequencies into which the parameter splits them, rising.
    shapes : ndarray (n_par, n_out, n) or None
        Derivatives of the mass-normalised shapes at the outputs.
    sets : tuple of ModeSet
        Sets of two and more close or repeated modes. Their shapes' derivatives are those of a basis of the
        space that turns as little as possible: Φᵀ M dΦ = -½ Φᵀ dM Φ. They stay finite.
    error : float
        Residual of the iterations for the contribution of modes not computed to the shapes' derivatives,
        relative to the largest such contribution to any mode, in the norm of the mass: estimated, from
        above [-].
    """

    refs: tuple[ParameterRef, ...]
    modes: Modes
    eigenvalue: Floats
    shapes: Floats | None
    sets: tuple[ModeSet, ...]
    error: float

    __repr__ = fields_summary

    @property
    def frequency(self) -> Floats:
        """Derivatives of the natural frequencies, shape (n_par, n) [Hz per unit of the parameter].

        Rigid-body modes have none, but a derivative of ω²: here it is NaN.
        """
        f = self.modes.frequency
        return self.eigenvalue / np.where(f > 0, 8 * np.pi**2 * f, np.nan)


def differentiate_modes(
    system: System,
    refs: Sequence[ParameterRef] | None = None,
    n: int = 20,
    *,
    outputs: Selection | str | None = None,
    pairs: Eigenpairs | None = None,
    close: float = 1e-6,
    tolerance: float = 1e-8,
) -> ModeSensitivity:
    """Compute derivatives of natural frequencies and mode shapes.

    With f = -(dK - λ dM) φ and λ = ω² (Fox and Kapoor, *AIAA J.* 6, 1968, 2426):

        dλ = -φᵀf,      dφ = -½ (φᵀ dM φ) φ + Σ φ_k φ_kᵀf / (λ_k - λ) + z

    The sum runs over the modes computed, and z, the contribution of all others, solves (K - λM) z = f in
    their space: the same vector as Nelson's bordered equations have (*AIAA J.* 14, 1976, 1201). It is found
    by Galerkin's method on a block-Krylov sequence of the factor of K - σM at hand, started from the outputs,
    which serves all modes and all parameters, or from f, where all DOFs are outputs. The modes being taken
    out, K - λM is definite; the sequence goes on until its error is below ``tolerance`` or rounding stops it.

    Modes whose ω² differ by less than ``close`` form a set, of which the space's derivative is given (see
    :class:`ModeSensitivity`). Derivatives of the individual shapes of repeated modes need second derivatives
    of K and M (Dailey, *AIAA J.* 27, 1989, 486) and are not given; the frequencies' are: the eigenvalues of S
    (Lancaster, *Numer. Math.* 6, 1964, 377).

    Parameters
    ----------
    system : System
    refs : sequence of (effect, parameter), optional
        All parameters of the model's effects unless given.
    n : int
        Number of modes, rigid-body modes included; those that form a set with the last of them are added.
    outputs : selection or "all", optional
        Where derivatives of the shapes are wanted: DOF numbers, (point, direction) pairs, rows of
        combinations, or all DOFs, for which each parameter costs as much as several solutions of the modes.
        None leaves shapes out.
    pairs : Eigenpairs, optional
        Modes already computed by :func:`fem.analysis.modes.solve_eigenpairs`, a few more than ``n``.
    close : float
        Relative difference of ω² below which modes form a set [-].
    tolerance : float
        Error at which iterations end [-].

    Raises
    ------
    ModelError
        For parameters that the model does not have, fewer modes in ``pairs`` than asked for, or a set of
        modes of which the last of ``pairs`` are only a part.
    UnstableError
        For a structure with a motion of negative stiffness.
    """
    model = system.model
    refs = tuple(model.values()) if refs is None else tuple(refs)
    wanted = min(n + max(6, n // 4), system.n_free)
    complete = False
    if pairs is None:
        pairs = solve_eigenpairs(system, wanted)
        complete = len(pairs.eigenvalues) < wanted  # the others would be those of directions without mass
    complete = complete or len(pairs.eigenvalues) == system.n_free
    if n < 1 or n > len(pairs.eigenvalues) - (not complete):
        msg = (
            f"derivatives of {n} modes are asked for and {len(pairs.eigenvalues)} modes are there; "
            "at least one more is needed, to see whether the last is repeated"
        )
        raise ModelError(msg)
    if isinstance(outputs, str) and outputs != "all":
        msg = f"the outputs are '{outputs}'; allowed are all, DOF numbers, (point, direction) pairs or rows"
        raise ModelError(msg)
    lam = pairs.eigenvalues
    groups = _groups(lam, max(close, _EQUAL))
    n = _complete_sets(groups, n, complete)
    groups = [g for g in groups if g[0] < n]
    shapes = system.Q @ pairs.vectors
    everywhere = isinstance(outputs, str)
    basis_at, basis, bo = shapes, None, None
    errors, sizes = np.zeros(max(len(refs), 1)), np.ones(max(len(refs), 1))
    if outputs is not None and not everywhere:
        bo = dof_vectors(model, outputs)[0]
        basis = _complement(system, pairs, np.asarray(system.Q.T @ bo), lam[:n], False, close, tolerance)
        basis_at = np.hstack([shapes, system.Q @ basis.vectors])
        errors[:] = basis.error
    at_outputs = None if bo is None else bo.T @ basis_at
    slopes = np.zeros((len(refs), n))
    dshapes = None
    if outputs is not None:
        dshapes = np.zeros((len(refs), model.n_dof if bo is None else bo.shape[1], n))
    small = [g for g in groups if len(g) > 1]
    matrices = [np.zeros((len(refs), len(g), len(g))) for g in small]
    for i, ref in enumerate(refs):
        parts = differentiate_matrices(model, ref)
        PK, PM = _projected(parts, basis_at, n)
        S = PK[:n] - (lam[:n, None] + lam[None, :n]) / 2 * PM[:n]
        f = lam[:n] * PM - PK
        factors = _modal_factors(f[: len(lam)], PM[: len(lam)], lam, n, groups)
        for g in groups:
            slopes[i, g] = _split(lam[g], S[np.ix_(g, g)])
        for matrix, g in zip(matrices, small, strict=True):
            matrix[i] = S[np.ix_(g, g)]
        if dshapes is None:
            continue
        if at_outputs is not None and basis is not None:
            dshapes[i] = at_outputs @ np.vstack([factors, basis.solve(f[len(lam) :])])
            continue
        loads = np.asarray(system.Q.T @ _forces(parts, shapes[:, :n], lam[:n]))
        rest = np.zeros((system.n_free, n))
        if loads.any():
            complement = _complement(system, pairs, loads, lam[:n], True, close, tolerance)
            rest = complement.vectors @ complement.solve(complement.vectors.T @ loads)
            errors[i] = complement.error
        kinetic = np.einsum("ij,ij->j", rest, system.M @ rest).max()
        sizes[i] = np.sqrt(max(float(kinetic), 0.0)) * (abs(finite_value(model, ref)) or 1.0)
        dshapes[i] = shapes @ factors + system.Q @ rest
    modes = Modes(np.sqrt(lam[:n]) / (2 * np.pi), shapes[:, :n], n_rigid=min(n, pairs.n_rigid))
    sets = tuple(ModeSet(g, lam[g], X) for g, X in zip(small, matrices, strict=True))
    # Contributions by rounding alone have no error worth reporting.
    error = float(errors[sizes >= 1e-9 * sizes.max()].max())
    return ModeSensitivity(refs, modes, slopes, dshapes, sets, error)


@dataclass(frozen=True, slots=True, eq=False)
class _Complement:
    """Galerkin's solutions z_j of (K - λ_j M) z = b in the space of the modes that were not computed.

    Attributes
    ----------
    vectors : ndarray (n_free, w)
        Basis W.
    U, gain : ndarray (w, w), (w, n)
        z_j = W U (gain_j · Uᵀ Wᵀ b_j).
    error : float
    """

    vectors: Floats
    U: Floats
    gain: Floats
    error: float

    def solve(self, load: Floats) -> Floats:
        """Return the coordinates of the solutions on W for loads Wᵀ b, one for each mode, (w, n)."""
        return self.U @ (self.gain * (self.U.T @ load))


def _complement(
    system: System, pairs: Eigenpairs, b: Floats, lam: Floats, each: bool, close: float, tolerance: float
) -> _Complement:
    """Build the basis for loads b (n_free, k) and all eigenvalues (n,), or each load with one (k = n).

    Blocks of (K - σM)⁻¹b, (K - σM)⁻¹M(K - σM)⁻¹b, … without the modes, orthonormal in K - σM =: A. There
    K - λM is I - (λ - σ)G with G = WᵀMW, and the residual of Galerkin's solution lies in the next block
    alone: its size is known before that block is used.
    """
    V, sigma, M = pairs.vectors, pairs.shift, system.M
    MV = np.asarray(M @ V)
    A = system.K - sigma * M
    start = np.linalg.norm(b, axis=0)
    block = pairs.factor.solve(b / np.where(start > 0, start, 1.0))
    space, k = np.empty((8 * b.shape[1], system.n_free)), 0  # its rows are the vectors
    G, load = np.zeros((0, 0)), np.zeros((0, b.shape[1]))
    shift = lam - sigma
    errors: list[float] = []
    while True:
        W = space[:k].T
        new = _orthonormal(A, V, MV, W, block)
        if not new.shape[1]:
            errors.append(np.sqrt(_LOST) * (errors[-1] if errors else float(k > 0)))
            break
        Mnew = np.asarray(M @ new)
        coupling, gram = W.T @ Mnew, new.T @ Mnew
        if k:
            errors.append(_residual_error(G, coupling, gram, load, shift, each))
        G, load = np.block([[G, coupling], [coupling.T, gram]]), np.vstack([load, new.T @ b])
        if k + new.shape[1] > len(space):
            space = np.concatenate([space, np.empty_like(space)])
        space[k : k + new.shape[1]] = new.T
        k += new.shape[1]
        stuck = len(errors) > _PATIENCE and min(errors[-_PATIENCE:]) > min(errors[:-_PATIENCE]) / 2
        if (errors and errors[-1] <= tolerance) or stuck:
            break
        block = pairs.factor.solve(Mnew)
    g, U = np.linalg.eigh((G + G.T) / 2)
    if g.size and (1 - shift[-1] * g[-1]) < 2 * close:
        msg = (
            f"modes beyond the {V.shape[1]} computed ones are as low as the last of the {len(lam)} asked for"
            "; compute more"
        )
        raise ModelError(msg)
    return _Complement(space[:k].T, U, 1 / (1 - shift * g[:, None]), errors[-1])


def _orthonormal(A: Array, V: Floats, MV: Floats, W: Floats, block: Floats) -> Floats:
    """Return the new directions of a block, A-orthonormal and A-orthogonal to V and W."""
    before = np.sqrt(np.maximum(np.einsum("ij,ij->j", block, A @ block), 0.0))
    block = np.asfortranarray(block[:, before > 0] / before[before > 0])
    for _ in range(2):
        block -= V @ (MV.T @ block)
        block -= W @ (W.T @ (A @ block))
        size, vectors = np.linalg.eigh(block.T @ (A @ block))
        keep = size > _LOST * max(1.0, size.max(initial=0.0))
        block = np.asfortranarray(block @ (vectors[:, keep] / np.sqrt(size[keep])))
        if not block.shape[1]:
            break
    return block


def _residual_error(G: Floats, coupling: Floats, gram: Floats, b: Floats, shift: Floats, each: bool) -> float:
    """Return the largest relative error of Galerkin's solutions z, from their residual in the next block N.

    e = (I - (λ - σ) A⁻¹M)⁻¹ N d, with the residual's coordinates d; in the norm of M that is at most ‖N d‖
    times 1/(1 - (λ - σ) g), g the largest eigenvalue of A⁻¹M there.
    """
    g, U = np.linalg.eigh(G)
    load, across = U.T @ b, coupling.T @ U
    error, size = (np.zeros((len(shift), 1 if each else b.shape[1])) for _ in range(2))
    for j, s in enumerate(shift.tolist()):
        gain = 1 / (1 - s * g)
        c = gain[:, None] * load[:, [j] if each else slice(None)]
        d = s * (across @ c)
        size[j] = np.sqrt((np.maximum(g, 0.0)[:, None] * c**2).sum(axis=0))
        error[j] = np.sqrt(np.maximum(np.einsum("ij,ij->j", d, gram @ d), 0.0)) * max(np.abs(gain).max(), 1.0)
    return float((error.max(axis=0) / np.maximum(size.max(axis=0), 1e-300)).max())


def _groups(lam: Floats, close: float) -> list[Ints]:
    """Return the modes in sets whose neighbours differ by less than a relative distance."""
    apart = np.flatnonzero(np.diff(lam) > close * lam[1:]) + 1
    return np.split(np.arange(len(lam)), apart)


def _complete_sets(groups: list[Ints], n: int, complete: bool) -> int:
    """Return the number of modes with which the set of the n-th ends.

    Raise an error if modes that were not computed may belong to it.
    """
    (last,) = (g for g in groups if g[0] < n <= g[-1] + 1)
    if last[-1] == groups[-1][-1] and len(last) > 1 and not complete:
        msg = (
            f"mode {n} belongs to a set of repeated modes, {last[0] + 1} to {last[-1] + 1} and perhaps "
            f"more; compute more modes, or ask for {last[0]}"
        )
        raise ModelError(msg)
    return int(last[-1]) + 1


def _projected(parts: Sequence[MatrixDerivative], basis: Floats, n: int) -> tuple[Floats, Floats]:
    """Return Tᵀ dK Φ and Tᵀ dM Φ, (t, n), Φ the first n columns of T (n_dof, t)."""
    out = np.zeros((2, basis.shape[1], n))
    for part in parts:
        if part.K is None and part.M is None:
            continue
        at = basis[part.dofs]
        flat = at.reshape(-1, basis.shape[1])
        for total, X in zip(out, (part.K, part.M), strict=True):
            if X is not None:
                total += flat.T @ (X @ at[:, :, :n]).reshape(-1, n)
    return out[0], out[1]


def _forces(parts: Sequence[MatrixDerivative], shapes: Floats, lam: Floats) -> Floats:
    """Return -(dK - λ dM) φ on all DOFs, (n_dof, n)."""
    out = np.zeros_like(shapes)
    for part in parts:
        at = shapes[part.dofs]
        if part.K is not None:
            np.add.at(out, part.dofs, -(part.K @ at))
        if part.M is not None:
            np.add.at(out, part.dofs, lam * (part.M @ at))
    return out


def _modal_factors(f: Floats, PM: Floats, lam: Floats, n: int, groups: list[Ints]) -> Floats:
    """Return c (m, n) with dφ_j = Σ φ_k c_kj + z_j."""
    gap = lam[:, None] - lam[None, :n]
    same_group = np.zeros(gap.shape, dtype=bool)
    for g in groups:
        same_group[np.ix_(g, g)] = True
    return np.where(same_group, -PM / 2, f / np.where(same_group, 1.0, gap))


def _split(lam: Floats, S: Floats) -> Floats:
    """Return the derivatives of a set's eigenvalues: the diagonal of S, its eigenvalues where they repeat."""
    out = np.empty(len(lam))
    for g in _groups(lam, _EQUAL):
        out[g] = sla.eigvalsh(S[np.ix_(g, g)]) if len(g) > 1 else S[g, g]
    return out
