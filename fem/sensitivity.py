"""Derivatives of modes and FRFs with respect to the parameters of effects.

A parameter's dK, dM, dC and dD come from a complex step through its effect's element matrices, exact to
rounding, and are only ever multiplied on the DOFs that they touch. Constraints do not depend on parameters.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg as sla
from numpy.typing import ArrayLike, NDArray

from fem.analysis.frf import FRF, FRFError, FRFKind, Selection, dof_vectors
from fem.analysis.modes import Eigenpairs, Modes, solve_eigenpairs
from fem.analysis.receptance import LOCAL_DAMPING, locals_of
from fem.linalg.solvers import SingularMatrixError, factorise
from fem.model import Array, Contribution, Law, Model, ModelError, ParameterRef, parameter_values
from fem.reduction.reduced import ParametricFRF, reduce_model
from fem.system import System, refuse_unsymmetric

LOCAL_FORCES = 48
"""So many forces of parameters themselves join those at outputs and inputs in the reduced FRFs' basis."""

_STEP = 1e-200
"""Complex step; derivatives are exact to rounding."""

_EQUAL = 1e-8
"""Relative difference of ω² that is rounding: such modes count as repeated."""

_LOST = 1e-12
"""Square of the relative size below which what is new in a block is left out: soon it would be rounding.

Vectors of rounding spoil what they are added to: with 10⁻¹⁶ digits were lost that 10⁻¹² keeps.
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

    modes: NDArray[np.int64]
    eigenvalues: NDArray[np.float64]
    matrix: NDArray[np.float64]

    def frequencies_after(self, parameter: int, step: float) -> NDArray[np.float64]:
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
        What iterations left of the contribution of modes not computed to the shapes' derivatives, relative
        to the largest such contribution to any mode, in the norm of the mass: estimated, from above [-].
    """

    refs: tuple[ParameterRef, ...]
    modes: Modes
    eigenvalue: NDArray[np.float64]
    shapes: NDArray[np.float64] | None
    sets: tuple[ModeSet, ...]
    error: float

    @property
    def frequency(self) -> NDArray[np.float64]:
        """Derivatives of the natural frequencies, shape (n_par, n) [Hz per unit of the parameter].

        Rigid-body modes have none, but a derivative of ω²: here it is NaN.
        """
        f = self.modes.frequency
        return self.eigenvalue / np.where(f > 0, 8 * np.pi**2 * f, np.nan)


@dataclass(frozen=True, slots=True, eq=False)
class FRFSensitivity:
    """Frequency response functions and their derivatives.

    Attributes
    ----------
    refs : tuple of (effect, parameter)
        The parameters.
    frf : FRF
        At the present values.
    dH : ndarray of complex (n_par, n_freq, n_out, n_in)
        Derivatives of ``frf.H`` [its unit per unit of the parameter].
    """

    refs: tuple[ParameterRef, ...]
    frf: FRF
    dH: NDArray[np.complex128]


@dataclass(frozen=True, slots=True, eq=False)
class MatrixDerivative:
    """The derivative of one contribution with respect to one parameter.

    Attributes
    ----------
    dofs : ndarray of int (b, m)
        Global DOF numbers of the elements that change.
    K, M, C, D : ndarray (b, m, m) or None
        Derivatives; K that of the stiffness at ω = 0.
    law : Law or None
        Dependence on frequency at the parameter's value plus the complex step, and ``stiffness``, the complex
        (b, m, m) that it multiplies.
    """

    dofs: NDArray[np.int64]
    K: NDArray[np.float64] | None
    M: NDArray[np.float64] | None
    C: NDArray[np.float64] | None
    D: NDArray[np.float64] | None
    law: Law | None = None
    stiffness: Array | None = None

    def dynamic_stiffness(self, model: Model, omega: float) -> NDArray[np.complex128]:
        """Return dZ(ω) of the elements, (b, m, m), with the structure's Rayleigh and structural damping."""
        damping = model.damping
        factors = (
            1 + 1j * (damping.loss_factor + omega * damping.beta),
            1j * omega * damping.alpha - omega**2,
            1j * omega,
            1j,
        )
        m = self.dofs.shape[1]
        Z = np.zeros((len(self.dofs), m, m), dtype=complex)
        for factor, X in zip(factors, (self.K, self.M, self.C, self.D), strict=True):
            if X is not None:
                Z += factor * X
        if self.law is not None and self.stiffness is not None:
            storage, loss = self.law(np.array([omega]))
            storage = storage[0] - self.law(np.zeros(1))[0][0]
            change = complex(np.real(storage), np.real(loss[0]))
            slope = complex(np.imag(storage), np.imag(loss[0])) / _STEP
            Z += slope * np.real(self.stiffness) + change * np.imag(self.stiffness) / _STEP
        return Z


def differentiate_matrices(model: Model, ref: ParameterRef) -> tuple[MatrixDerivative, ...]:
    """Return the derivatives of the element matrices with respect to one parameter.

    A complex step of 10⁻²⁰⁰ through the contributions of the effect and of those that refer to it. Elements
    that do not change are left out.

    Parameters
    ----------
    model : Model
    ref : (effect, parameter)
        Names of an effect of the model and of its parameter.

    Raises
    ------
    ModelError
        For an effect or parameter that the model does not have, or a value that is not finite.
    """
    effect, value = model.effect(ref[0]), _effect_value(model, ref)
    changed = effect.with_values(**{ref[1]: value + 1j * _STEP})
    parts = list(changed.contribute(model))
    others = [e for e in model.effects if ref in e.refers_to(model)]
    if others:
        stepped = model.with_values({ref: value + 1j * _STEP})
        parts += [part for e in others for part in e.contribute(stepped)]
    out = []
    for part in parts:
        slopes = [None if X is None else np.imag(X) / _STEP for X in (part.static, part.M, part.C, part.D)]
        moving = part.law is not None
        changed = np.full(len(part.dofs), moving)
        for X in slopes:
            if X is not None:
                changed |= X.any(axis=(1, 2))
        if not changed.any():
            continue
        K, M, C, D = (None if X is None or not X.any() else X[changed] for X in slopes)
        law, stiffness = (part.law, _kept(part, changed)) if moving else (None, None)
        out.append(MatrixDerivative(part.dofs[changed], K, M, C, D, law, stiffness))
    return tuple(out)


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

    The sum runs over the modes computed, and z, what all others contribute, solves (K - λM) z = f in their
    space: the same vector as Nelson's bordered equations have (*AIAA J.* 14, 1976, 1201). It is found by
    Galerkin's method on a block-Krylov sequence of the factor of K - σM at hand, started from the outputs,
    which serves all modes and all parameters, or from f, where all DOFs are outputs. The modes being taken
    out, K - λM is definite; the sequence goes on until its error is below ``tolerance`` or rounding
    stops it.

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
    n = _whole(groups, n, complete)
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
            own = _complement(system, pairs, loads, lam[:n], True, close, tolerance)
            rest = own.vectors @ own.solve(own.vectors.T @ loads)
            errors[i] = own.error
        kinetic = np.einsum("ij,ij->j", rest, system.M @ rest).max()
        sizes[i] = np.sqrt(max(float(kinetic), 0.0)) * (abs(_effect_value(model, ref)) or 1.0)
        dshapes[i] = shapes @ factors + system.Q @ rest
    modes = Modes(np.sqrt(lam[:n]) / (2 * np.pi), shapes[:, :n], n_rigid=min(n, pairs.n_rigid))
    sets = tuple(ModeSet(g, lam[g], X) for g, X in zip(small, matrices, strict=True))
    # What is there only by rounding has no error worth reporting.
    error = float(errors[sizes >= 1e-9 * sizes.max()].max())
    return ModeSensitivity(refs, modes, slopes, dshapes, sets, error)


def differentiate_frf(
    system: System,
    frequency: ArrayLike,
    outputs: Selection,
    inputs: Selection,
    refs: Sequence[ParameterRef] | None = None,
    kind: FRFKind | str = FRFKind.ACCELERANCE,
    method: str = "reduced",
) -> FRFSensitivity:
    """Compute FRFs and their derivatives, dH = -H_o dZ H_i.

    H_o and H_i are the responses of the elements that change to forces at the outputs and at the inputs.
    ``"direct"`` factorises Z(ω) at every line and is exact to rounding. ``"reduced"`` projects once on modes
    up to 2.5 times the highest frequency and six block-Krylov vectors of each output and input
    (:class:`fem.reduction.reduced.ParametricFRF`), and of the forces of parameters that touch few DOFs, up to
    `LOCAL_FORCES` of them. Elsewhere H_o and H_i err by (1/2.5)¹² = 2e-5 of what higher modes contribute at
    the highest frequency, and, where damping is not proportional, by the loss factor of that.

    Modal damping ratios are taken as 2iζ(ω)K by ``"reduced"``, the same at resonances.

    Parameters
    ----------
    system : System
    frequency : array_like (n_freq,)
        Frequencies [Hz].
    outputs, inputs : selection
        DOF numbers, (point, direction) pairs, or rows of combinations (n, n_dof).
    refs : sequence of (effect, parameter), optional
        All parameters of the model's effects unless given.
    kind : FRFKind or str
        Receptance, mobility or accelerance.
    method : str
        ``"reduced"`` or ``"direct"``.

    Raises
    ------
    ModelError
        For parameters that the model does not have.
    FRFError
        For an unknown method, modal ratios with ``"direct"``, or a line where the receptance is infinite.
    """
    model = system.model
    refuse_unsymmetric(model)
    refs = tuple(model.values()) if refs is None else tuple(refs)
    out, out_labels = dof_vectors(model, outputs)
    inn, in_labels = dof_vectors(model, inputs)
    frequency = np.array(frequency, dtype=float, ndmin=1)
    if method == "reduced":
        H, dH = _reduced_slopes(system, frequency, out, inn, refs)
    elif method == "direct":
        H, dH = _direct_slopes(system, frequency, out, inn, refs)
    else:
        msg = f"the FRF method is '{method}'; allowed are reduced, direct"
        raise FRFError(msg)
    if not (np.isfinite(H).all() and np.isfinite(dH).all()):
        msg = "the receptance is infinite at a line: 0 Hz on a free structure, or an undamped resonance"
        raise FRFError(msg)
    frf = FRF.from_arrays(frequency, H, FRFKind.RECEPTANCE, out_labels, in_labels).as_kind(kind)
    factor = (2j * np.pi * frequency[:, None, None]) ** frf.kind.derivatives
    return FRFSensitivity(refs, frf, dH * factor)


# ------------------------------------------------------------------------------------------------- modes


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

    vectors: NDArray[np.float64]
    U: NDArray[np.float64]
    gain: NDArray[np.float64]
    error: float

    def solve(self, load: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the coordinates of the solutions on W for loads Wᵀ b, one for each mode, (w, n)."""
        return self.U @ (self.gain * (self.U.T @ load))


def _complement(
    system: System,
    pairs: Eigenpairs,
    b: NDArray[np.float64],
    lam: NDArray[np.float64],
    each: bool,
    close: float,
    tolerance: float,
) -> _Complement:
    """Build the basis for loads b (n_free, k) and all eigenvalues (n,), or ``each`` for its own load (k = n).

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
        coupling, own = W.T @ Mnew, new.T @ Mnew
        if k:
            errors.append(_left(G, coupling, own, load, shift, each))
        G, load = np.block([[G, coupling], [coupling.T, own]]), np.vstack([load, new.T @ b])
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


def _orthonormal(
    A: Array,
    V: NDArray[np.float64],
    MV: NDArray[np.float64],
    W: NDArray[np.float64],
    block: NDArray[np.float64],
) -> NDArray[np.float64]:
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


def _left(
    G: NDArray[np.float64],
    coupling: NDArray[np.float64],
    own: NDArray[np.float64],
    b: NDArray[np.float64],
    shift: NDArray[np.float64],
    each: bool,
) -> float:
    """Return the largest relative error of Galerkin's solutions z, from their residual in the next block N.

    e = (I - (λ - σ) A⁻¹M)⁻¹ N d, with the residual's coordinates d; in the norm of M that is at most ‖N d‖
    times 1/(1 - (λ - σ) g), g the largest eigenvalue of A⁻¹M there.
    """
    g, U = np.linalg.eigh(G)
    load, across = U.T @ b, coupling.T @ U
    left, size = (np.zeros((len(shift), 1 if each else b.shape[1])) for _ in range(2))
    for j, s in enumerate(shift.tolist()):
        gain = 1 / (1 - s * g)
        c = gain[:, None] * load[:, [j] if each else slice(None)]
        d = s * (across @ c)
        size[j] = np.sqrt((np.maximum(g, 0.0)[:, None] * c**2).sum(axis=0))
        left[j] = np.sqrt(np.maximum(np.einsum("ij,ij->j", d, own @ d), 0.0)) * max(np.abs(gain).max(), 1.0)
    return float((left.max(axis=0) / np.maximum(size.max(axis=0), 1e-300)).max())


def _groups(lam: NDArray[np.float64], close: float) -> list[NDArray[np.int64]]:
    """Return the modes in sets whose neighbours differ by less than a relative distance."""
    apart = np.flatnonzero(np.diff(lam) > close * lam[1:]) + 1
    return np.split(np.arange(len(lam)), apart)


def _whole(groups: list[NDArray[np.int64]], n: int, complete: bool) -> int:
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


def _projected(
    parts: Sequence[MatrixDerivative], basis: NDArray[np.float64], n: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
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


def _forces(
    parts: Sequence[MatrixDerivative], shapes: NDArray[np.float64], lam: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return -(dK - λ dM) φ on all DOFs, (n_dof, n)."""
    out = np.zeros_like(shapes)
    for part in parts:
        at = shapes[part.dofs]
        if part.K is not None:
            np.add.at(out, part.dofs, -(part.K @ at))
        if part.M is not None:
            np.add.at(out, part.dofs, lam * (part.M @ at))
    return out


def _modal_factors(
    f: NDArray[np.float64],
    PM: NDArray[np.float64],
    lam: NDArray[np.float64],
    n: int,
    groups: list[NDArray[np.int64]],
) -> NDArray[np.float64]:
    """Return c (m, n) with dφ_j = Σ φ_k c_kj + z_j."""
    gap = lam[:, None] - lam[None, :n]
    own = np.zeros(gap.shape, dtype=bool)
    for g in groups:
        own[np.ix_(g, g)] = True
    return np.where(own, -PM / 2, f / np.where(own, 1.0, gap))


def _split(lam: NDArray[np.float64], S: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the derivatives of a set's eigenvalues: the diagonal of S, its eigenvalues where they repeat."""
    out = np.empty(len(lam))
    for g in _groups(lam, _EQUAL):
        out[g] = sla.eigvalsh(S[np.ix_(g, g)]) if len(g) > 1 else S[g, g]
    return out


def _local_forces(n_dof: int, derivatives: Sequence[tuple[MatrixDerivative, ...]]) -> NDArray[np.float64]:
    """Return an orthonormal basis (n_dof, n) of the forces of parameters that touch few DOFs.

    Motions there become responses to forces of the basis, as accurate as the outputs'. Parameters come in
    until `LOCAL_FORCES` are there.
    """
    columns = np.zeros((n_dof, 0))
    for parts in derivatives:
        if sum(part.dofs.size for part in parts) > LOCAL_DAMPING:
            continue
        for part in parts:
            given = [X for X in (part.K, part.M, part.C, part.D, part.stiffness) if X is not None]
            for dofs, *matrices in zip(part.dofs, *(np.real(X) for X in given), strict=True):
                scaled = [X / max(np.abs(X).max(), 1e-300) for X in matrices]
                U, s, _ = np.linalg.svd(np.hstack(scaled))
                new = np.zeros((n_dof, int((s > 1e-12 * s[0]).sum())))
                np.add.at(new, dofs, U[:, : new.shape[1]])
                for _ in range(2):
                    new = new - columns @ (columns.T @ new)
                U, s, _ = np.linalg.svd(new, full_matrices=False)
                columns = np.hstack([columns, U[:, s > 1e-6]])
        if columns.shape[1] > LOCAL_FORCES:
            break
    return columns


def _effect_value(model: Model, ref: ParameterRef) -> float:
    """Return the present value of a parameter; raise an error if there is none that is finite."""
    name, parameter = ref
    values = parameter_values(model.effect(name))
    if parameter not in values:
        msg = f"effect '{name}' has no parameter '{parameter}'; it has {', '.join(values) or 'none'}"
        raise ModelError(msg)
    if not np.isfinite(values[parameter]):
        msg = f"parameter '{parameter}' of effect '{name}' is {values[parameter]}; give it a finite value"
        raise ModelError(msg)
    return values[parameter]


def _kept(part: Contribution, rows: NDArray[np.bool_]) -> Array:
    assert part.K is not None
    return part.K[rows]


# -------------------------------------------------------------------------------------------------- FRFs


def _direct_slopes(
    system: System,
    frequency: NDArray[np.float64],
    out: NDArray[np.float64],
    inn: NDArray[np.float64],
    refs: tuple[ParameterRef, ...],
) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    model = system.model
    if model.damping.ratio.any():
        msg = (
            "the direct method needs damping matrices; modal damping ratios have none (use method='reduced')"
        )
        raise FRFError(msg)
    parts = [differentiate_matrices(model, ref) for ref in refs]
    forces = np.asarray(system.Q.T @ np.hstack([out, inn])).astype(complex)
    n_out = out.shape[1]
    H = np.empty((len(frequency), n_out, inn.shape[1]), dtype=complex)
    dH = np.zeros((len(refs), *H.shape), dtype=complex)
    for k, omega in enumerate((2 * np.pi * frequency).tolist()):
        try:
            u = system.Q @ factorise(system.dynamic_stiffness(omega)).solve(forces)
        except SingularMatrixError:
            H[k] = np.inf
            continue
        H[k] = out.T @ u[:, n_out:]
        for i, derivative in enumerate(parts):
            for part in derivative:
                at = u[part.dofs]
                force = part.dynamic_stiffness(model, omega) @ at[:, :, n_out:]
                dH[i, k] -= np.einsum("bmo,bmi->oi", at[:, :, :n_out], force, optimize=True)
    return H, dH


def _reduced_slopes(
    system: System,
    frequency: NDArray[np.float64],
    out: NDArray[np.float64],
    inn: NDArray[np.float64],
    refs: tuple[ParameterRef, ...],
) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    model = system.model
    now = model.values()
    parts = [differentiate_matrices(model, ref) for ref in refs]
    dampers = (system.Q @ locals_of(system).U).toarray()
    forces = np.hstack([out, inn, dampers, _local_forces(model.n_dof, parts)])
    highest = max(float(frequency[-1]), 1.0)
    reduced = reduce_model(model, forces, highest, margin=2.5, n_krylov=6, releasable=False)
    engine = ParametricFRF(reduced, out, inn, frequency, refs)
    values = np.array([now[ref] for ref in refs], dtype=float)
    with np.errstate(divide="ignore", invalid="ignore"):
        H, dH, _ = engine.evaluate(values, model.damping.ratio_at(frequency))
    assert dH is not None
    return H, dH
