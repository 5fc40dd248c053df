"""Responses in time: by modes with exact steps, or by Newmark's method and that of Hilber, Hughes and Taylor.

    System, Excitation → solve_transient → TimeResponse

Motions of the base are followed in relative coordinates, M q'' + C q' + K q = -M r a(t), as are forces. In
time structural damping has no equation of motion: a mode gets the viscous ratio with the same loss in a
cycle at its frequency.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike

from fem.analysis.base_excitation import rigid_base_load
from fem.analysis.excitation import Excitation, TimeResponse
from fem.analysis.modes import solve_eigenpairs
from fem.analysis.recurrence import coupled, oscillators, twice_integrated
from fem.analysis.selection import Selection, dof_vectors
from fem.analysis.statics import factor_stiffness
from fem.array_types import Floats, Ints
from fem.linalg.solvers import Factor, SingularMatrixError, factorise
from fem.model import DIRECTIONS, ModelError
from fem.system import System

METHODS = ("modal", "newmark")


_LOST = 1e-3
"""Part of an initial motion that the modes may lack without a note, by mass [-]."""


def solve_transient(
    system: System,
    excitation: Excitation,
    outputs: Selection,
    *,
    method: str = "modal",
    n_modes: int | None = None,
    max_frequency: float | None = None,
    alpha: float = 0.0,
    initial: tuple[ArrayLike, ArrayLike] | None = None,
    relative: bool = False,
    about: ArrayLike | None = None,
    snapshots: ArrayLike = (),
) -> TimeResponse:
    """Compute responses in time.

    - ``"modal"`` steps each mode exactly for forces that are linear between the samples, and adds the static
      flexibility of the modes left out to displacements. Local dampers couple the modes, which then step
      together, exactly as well.
    - ``"newmark"`` steps all DOFs by the average acceleration (β = 1/4, γ = 1/2), which does not damp and
      lengthens periods by (ωh)²/12; with ``alpha`` below 0 by the method of Hilber, Hughes and Taylor
      (Earthq. Eng. Struct. Dyn. 5, 1977), which damps what a step cannot resolve.

    Parameters
    ----------
    system : System
        One with gyroscopic effects is taken by the modal method, if assembled with ``reciprocal=False``.
    excitation : Excitation
    outputs : selection
        DOF numbers, (point, direction) pairs, or rows of combinations (n, n_dof).
    method : str
    n_modes, max_frequency : int, float, optional
        Modes that are superposed, or that get modal damping ratios by ``"newmark"``: their number, or all up
        to a frequency [Hz]. Unless given, all up to half the sampling rate.
    alpha : float
        -1/3 to 0, of ``"newmark"``.
    initial : (array_like (n_dof,), array_like (n_dof,)), optional
        Displacements and velocities at the first sample, relative to the base; rest unless given.
    relative : bool
        Whether responses are relative to the base.
    about : array_like (3,), optional
        Point about which the base turns, the origin unless given [m].
    snapshots : array_like of int
        Samples, counted from 0, at which displacements of all DOFs are kept.

    Raises
    ------
    ModelError
        For an unknown method, elements that depend on frequency, initial motions that supports do not allow,
        and as :func:`fem.analysis.modes.solve_eigenpairs`.
    """
    if method not in METHODS:
        msg = f"the method is '{method}'; allowed are {', '.join(METHODS)}"
        raise ModelError(msg)
    if not -1 / 3 <= alpha <= 0:
        msg = f"alpha is {alpha:g}; allowed are -1/3 to 0"
        raise ModelError(msg)
    if system.laws:
        msg = "elements that depend on frequency have no equation of motion in time here; leave them out"
        raise ModelError(msg)
    problem = _problem(system, excitation, outputs, method, n_modes, max_frequency, initial, about)
    kept = np.asarray(snapshots, dtype=int)
    if method == "modal":
        q, v, a, u = _by_modes(problem, kept)
    else:
        q, v, a, u = _by_newmark(problem, alpha, kept)
    u = np.asarray(system.Q @ u)
    if not relative:
        for r, acceleration in problem.base:
            moved = *twice_integrated(acceleration, excitation.step), acceleration
            q, v, a = (x + np.outer(h, problem.rows @ r) for x, h in zip((q, v, a), moved, strict=True))
            u += np.outer(r, moved[0][kept])
    return TimeResponse(
        excitation.time,
        q,
        v,
        a,
        problem.labels,
        relative,
        method,
        problem.eigenvalues.size,
        problem.notes,
        u,
    )


@dataclass(frozen=True, slots=True, eq=False)
class _TransientProblem:
    """An excitation and what responds, on the independent coordinates."""

    system: System
    excitation: Excitation
    eigenvalues: Floats  # (n_modes,)
    phi: Floats  # (n_free, n_modes)
    F: Floats  # (n_free, k): loads, then the inertia that motions of the base leave
    p: Floats  # (n_t, k)
    L: Floats  # (n_out, n_free)
    rows: Floats  # (n_out, n_dof)
    base: tuple[tuple[Floats, Floats], ...]  # motions (n_dof,) for a unit of the base, and its acceleration
    start: tuple[Floats, Floats]  # (n_free,) each
    ratios: Floats  # (n_modes,): viscous ratios in addition to C, α and β
    labels: tuple[str, ...]
    notes: tuple[str, ...]


def _problem(
    system: System,
    excitation: Excitation,
    outputs: Selection,
    method: str,
    n_modes: int | None,
    max_frequency: float | None,
    initial: tuple[ArrayLike, ArrayLike] | None,
    about: ArrayLike | None,
) -> _TransientProblem:
    model = system.model
    rows, labels = dof_vectors(model, outputs)
    if n_modes is None and max_frequency is None:
        max_frequency = 1 / (2 * excitation.step)
    eigenvalues, phi = np.zeros(0), np.zeros((system.n_free, 0))
    damping = model.damping
    if method == "modal" or damping.ratio.any() or damping.loss_factor or system.D.nnz:
        pairs = solve_eigenpairs(system, n_modes, max_frequency)
        eigenvalues, phi = pairs.eigenvalues, pairs.vectors
    loads, histories, base = [excitation.loads], [excitation.forces], []
    for direction, acceleration in excitation.base.items():
        r, inertia = rigid_base_load(system, direction, about)
        loads.append(-inertia[:, None])
        histories.append(acceleration[:, None])
        base.append((r, acceleration))
    notes = []
    omega = np.sqrt(eigenvalues)
    ratios = damping.ratio_at(omega / (2 * np.pi)) + damping.loss_factor / 2
    if system.D.nnz:
        lost = np.einsum("ij,ij->j", phi, system.D @ phi)
        ratios = ratios + np.divide(lost, 2 * omega**2, out=np.zeros_like(lost), where=omega > 0)
    if damping.loss_factor or system.D.nnz:
        notes.append("structural damping is replaced by the viscous damping of each mode at its frequency")
    start = _start(system, initial)
    for word, x in zip(("displacement", "velocity"), start, strict=True):
        mass = float(x @ (system.M @ x))
        in_modes = float(np.square(phi.T @ (system.M @ x)).sum())
        if method == "modal" and mass - in_modes > _LOST * mass:
            notes.append(
                f"the modes leave out {100 * (1 - in_modes / mass):.2g} % of the initial {word}, by mass: "
                "take more"
            )
    return _TransientProblem(
        system,
        excitation,
        eigenvalues,
        phi,
        np.asarray(system.Q.T @ np.hstack(loads)),
        np.hstack(histories),
        np.asarray(rows.T @ system.Q),
        rows.T,
        tuple(base),
        start,
        np.where(omega > 0, ratios, 0.0),
        labels,
        tuple(notes),
    )


def _start(system: System, initial: tuple[ArrayLike, ArrayLike] | None) -> tuple[Floats, Floats]:
    """Return initial displacements and velocities on the independent coordinates."""
    if initial is None:
        return np.zeros(system.n_free), np.zeros(system.n_free)
    out = []
    for word, given in zip(("displacement", "velocity"), initial, strict=True):
        u = np.asarray(given, dtype=float)
        if u.shape != (system.model.n_dof,) or not np.isfinite(u).all():
            msg = (
                f"the initial {word} has shape {u.shape}; ({system.model.n_dof},) finite numbers are expected"
            )
            raise ModelError(msg)
        q = np.asarray(system.Q.T @ u)
        lost = np.abs(system.Q @ q - u)
        if lost.max() > 1e-6 * np.abs(u).max(initial=0.0):
            dof = int(lost.argmax())
            msg = (
                f"the initial {word} moves point {dof // 6} in {DIRECTIONS[dof % 6]}, where supports or "
                "rigid joints do not allow it"
            )
            raise ModelError(msg)
        out.append(q)
    return out[0], out[1]


# By modes ---------------------------------------------------------------------------------------------------


def _by_modes(problem: _TransientProblem, kept: Ints) -> tuple[Floats, Floats, Floats, Floats]:
    """Return motions of the outputs (n_t, n_out), and of all coordinates at the kept samples (n_free, k).

    Displacements, velocities and accelerations of the outputs; displacements of the coordinates.
    """
    system, h = problem.system, problem.excitation.step
    phi, k, damping = problem.phi, problem.eigenvalues, system.model.damping
    modal_damping = damping.alpha + damping.beta * k + 2 * problem.ratios * np.sqrt(k)
    C = np.asarray(phi.T @ (system.C @ phi)) if system.C.nnz else np.zeros((k.size, k.size))
    B = phi.T @ problem.F
    start = tuple(phi.T @ (system.M @ x) for x in problem.start)
    alone = not np.any(C - np.diag(np.diagonal(C)))
    forces = problem.p @ B.T
    if alone:
        modal_damping = modal_damping + np.diagonal(C)
        y, v = oscillators(k, modal_damping, forces, h, (start[0], start[1]))
        a = forces - v * modal_damping - y * k
    else:
        C = C + np.diag(modal_damping)
        y, v = coupled(np.diag(k), C, B, problem.p, h, (start[0], start[1]))
        a = forces - v @ C.T - y * k
    L, rest = problem.L @ phi, _static_rest(problem)
    q = y @ L.T + problem.p @ (problem.L @ rest).T
    return q, v @ L.T, a @ L.T, phi @ y[kept].T + rest @ problem.p[kept].T


def _static_rest(problem: _TransientProblem) -> Floats:
    """Return the static responses (n_free, k) to loads that the modes lack; 0 of a free structure."""
    system, phi = problem.system, problem.phi
    if system.rigid.shape[1] or not problem.F.shape[1]:
        return np.zeros_like(problem.F)
    return factor_stiffness(system).solve(problem.F - system.M @ (phi @ (phi.T @ problem.F)))


# By all DOFs ------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, eq=False)
class _Damped:
    """Viscous damping C + W Wᵀ, W that of modal ratios."""

    C: sp.csc_array
    W: Floats  # (n_free, n_modes)

    def __matmul__(self, x: Floats) -> Floats:
        return self.C @ x + self.W @ (self.W.T @ x)


@dataclass(frozen=True, slots=True, eq=False)
class _Effective:
    """Solves (S + g W Wᵀ) x = b by the factor of S (Woodbury)."""

    factor: Factor
    W: Floats
    X: Floats  # S⁻¹ W
    inner: Floats  # 1/g + Wᵀ S⁻¹ W

    @classmethod
    def of(cls, S: sp.csc_array, W: Floats, g: float) -> "_Effective":
        factor = factorise(S)
        X = factor.solve(W) if W.shape[1] else W
        return cls(factor, W, X, np.eye(W.shape[1]) / g + W.T @ X)

    def solve(self, b: Floats) -> Floats:
        x = self.factor.solve(b)
        return x - self.X @ np.linalg.solve(self.inner, self.W.T @ x) if self.W.shape[1] else x


def _first_acceleration(M: sp.csc_array, K: sp.csc_array, force: Floats, h: float) -> Floats:
    """Solve M a = f; where DOFs have no mass, with a little stiffness added to M."""
    try:
        return factorise(M).solve(force)
    except SingularMatrixError:
        # Part of K h² that joins M where the first acceleration is solved for, as some DOFs may have no mass
        # [-]
        return factorise(sp.csc_array(M + 1e-6 * h**2 * K)).solve(force)


def _by_newmark(
    problem: _TransientProblem, alpha: float, kept: Ints
) -> tuple[Floats, Floats, Floats, Floats]:
    """Return the same as :func:`_by_modes`."""
    system, h = problem.system, problem.excitation.step
    if not system.reciprocal:
        msg = "Newmark's method takes symmetric matrices here; use the modal method for gyroscopic effects"
        raise ModelError(msg)
    K, M, damping = system.K, system.M, system.model.damping
    damped = np.flatnonzero(problem.ratios > 0)
    phi, omega = problem.phi[:, damped], np.sqrt(problem.eigenvalues[damped])
    W = np.asarray(M @ phi) * np.sqrt(2 * problem.ratios[damped] * omega)
    C = _Damped(sp.csc_array(system.C + damping.alpha * M + damping.beta * K), W)
    beta, gamma, now = (1 - alpha) ** 2 / 4, 0.5 - alpha, 1 + alpha
    effective = _Effective.of(
        sp.csc_array(M + now * gamma * h * C.C + now * beta * h**2 * K), W, now * gamma * h
    )
    u, v = problem.start
    rest = problem.F @ problem.p[0] - C @ v - K @ u
    a = _first_acceleration(M, K, rest, h)
    out = np.empty((3, len(problem.p), len(problem.L)))
    out[:, 0] = np.stack([u, v, a]) @ problem.L.T
    at_kept = np.zeros((u.size, kept.size))
    at_kept[:, kept == 0] = u[:, None]
    for k in range(1, len(problem.p)):
        u_next = u + h * v + h**2 * (0.5 - beta) * a
        v_next = v + h * (1 - gamma) * a
        force = problem.F @ problem.p[k]
        b = now * (force - C @ v_next - K @ u_next) - alpha * rest
        a = effective.solve(b)
        u, v = u_next + beta * h**2 * a, v_next + gamma * h * a
        out[:, k] = np.stack([u, v, a]) @ problem.L.T
        at_kept[:, kept == k] = u[:, None]
        if alpha:
            rest = force - C @ v - K @ u
    return out[0], out[1], out[2], at_kept
