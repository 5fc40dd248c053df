"""Complex modes of systems with dampers and rotors: (K̂ + sĈ + s²M) x = 0, time dependence e^{st}.

K̂ = K (1 + iη) + iD with the structure's loss factor η, Ĉ = C + αM + βK + the modal ratios' matrix, C with the
skew matrices of rotors. The problem is projected on a basis of real modes, solved there, and its residual in
the full system, multiplied by the inverse of the shifted stiffness, extends the basis until every residual is
small (Davidson's method). Elements that depend on frequency have their stiffness at each mode's damped
frequency.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import scipy.linalg as sla
import scipy.sparse as sp
from numpy.typing import ArrayLike, NDArray
from scipy.sparse.csgraph import connected_components

from fem.analysis.frf import FRF, FRFError, FRFKind
from fem.analysis.modes import Eigenpairs, Modes, rigid_body_motions, solve_eigenpairs
from fem.analysis.receptance import locals_of
from fem.analysis.selection import Selection, dof_vectors
from fem.array_types import Bools, Complexes, Floats
from fem.declarations import Role
from fem.linalg.solvers import Factor, factorise, one_thread
from fem.model import Law, Model, ModelError
from fem.summary import fields_summary
from fem.system import System, law_change

# Roots and vectors of small dense quadratic problems (K + sC + s²M) x = 0 -----------------------------------


Laws = Sequence[tuple[Law, Floats]]


class Root(NamedTuple):
    """A root with (K + sC + s²M) x = 0 and yᵀ(K + sC + s²M) = 0.

    ``left`` is ``right`` itself where all matrices are symmetric.
    """

    s: complex
    right: Complexes
    left: Complexes


class QuadraticPencil(NamedTuple):
    """Matrices (m, m) of a problem, with frequency-dependent elements at rest and their laws."""

    K: NDArray[Any]
    C: NDArray[Any]
    M: NDArray[Any]
    laws: Laws
    symmetric: bool


def all_roots(problem: QuadraticPencil, omega: float = 0.0) -> list[Root]:
    """Return all finite roots, with laws at one frequency [rad/s], the slowest first.

    With s = σ + 1/μ, σ > 0 no root: (μ²P₀ + μP₁ + M) x = 0, P₀ = K + σC + σ²M, P₁ = C + 2σM. μ = 0 are the
    infinite roots of directions without mass. K should be about the unit matrix.
    """
    K, C, M, laws, symmetric = problem
    for law, X in laws:
        K = K + law_change(law, np.array([omega]))[0] * X
    m = len(K)
    size = float(np.trace(M)) / m
    shift = 0.3 / np.sqrt(max(size, 1e-300))  # K is about 1, and M about 1/ω²
    P0, P1 = K + shift * C + shift**2 * M, C + 2 * shift * M
    top = -np.linalg.solve(P0, np.hstack([P1, M / shift]))
    # companion matrix of shift·μ, so that both halves of the vectors are of one size
    A = np.block([[top[:, :m] * shift, top[:, m:] * shift**3], [np.eye(m), np.zeros((m, m))]])
    if symmetric:
        mu, vectors = np.linalg.eig(A)
        rows = vectors
    else:
        # wᴴA = μwᴴ: the first half of w is P₀ᵀ times the left vector
        mu, other, vectors = sla.eig(A, left=True, right=True)
        rows = np.linalg.solve(P0.T, other[:m].conj())
    finite = np.flatnonzero(np.abs(mu) > 1e-13 * np.abs(mu).max())
    s = (shift + shift / mu[finite]).astype(complex)
    s.imag[np.abs(s.imag) < 1e-8 * np.abs(s) + 1e-10 * shift] = 0.0  # real but for rounding
    X = _unit(vectors[:m, finite])
    Y = X if symmetric else _unit(rows[:, finite])
    order = np.argsort(np.abs(s), kind="stable")
    return [Root(complex(s[k]), X[:, k], X[:, k] if symmetric else Y[:, k]) for k in order]


def _unit(X: NDArray[Any]) -> Complexes:
    return X.astype(complex) / np.linalg.norm(X, axis=0)


def with_laws(problem: QuadraticPencil, root: Root) -> Root:
    """Iterate a root until the laws are those of its damped frequency."""
    M = problem.M
    for _ in range(60):
        above = [r for r in all_roots(problem, abs(root.s.imag)) if r.s.imag >= 0]
        # the same mode: most alike by mass, not farther than it must be
        X = np.column_stack([r.right for r in above])
        like = np.abs(X.conj().T @ (M @ root.right)) ** 2
        like /= np.maximum(np.real(np.einsum("ij,ij->j", X.conj(), M @ X)), 1e-300)
        far = np.abs(np.array([r.s for r in above]) - root.s) / abs(root.s)
        best = above[int(np.argmax(like / (1 + far)))]
        done = abs(best.s - root.s) < 1e-12 * abs(root.s)
        root = best
        if done:
            break
    return root


def different(roots: Sequence[Root], M: NDArray[Any]) -> list[Root]:
    """Return roots without those that came twice."""
    out: list[Root] = []
    for root in roots:
        mass = np.sqrt(np.real(np.vdot(root.right, M @ root.right)))
        twice = any(
            # Relative distance below which two roots with equal vectors are one
            abs(root.s - known.s) < 1e-9 * abs(root.s)
            and abs(np.vdot(root.right, M @ known.right))
            > 0.99 * mass * np.sqrt(np.real(np.vdot(known.right, M @ known.right)))
            for known in out
        )
        if not twice:
            out.append(root)
    return out


# Whirl of rotors: in which sense, and how round, the axes of rotors turn in a mode --------------------------


AT_REST = 1e-12
"""Part of a mode's energy below which its gyroscopic work is rounding: no rotor's axis turns [-]."""

PLANAR = 1e-6
"""Size of the whirl below which its sense is rounding [-]."""


def whirl(model: Model, poles: Complexes, shapes: Complexes) -> Floats:
    """Return the whirl of modes: 1 forward in circles, 0 in a plane, -1 backward in circles.

    The rotations of a rotor's axis describe an ellipse. Its circularity, positive in the sense of the spin,
    is averaged with the weight of the angular momentum: xᴴ(iG)x / xᴴ|G|x, G the skew matrix and |G| its
    absolute value element by element. Frequencies of forward modes grow with the momenta.

    Parameters
    ----------
    model : Model
    poles : ndarray of complex (n,)
        s, with Im s ≥ 0 [rad/s].
    shapes : ndarray of complex (n_dof, n)
        With the modal A of :class:`fem.analysis.complex_modes.ComplexModes`.

    Returns
    -------
    ndarray (n,)
        NaN of modes that tilt no rotor's axis, and of models without rotors.
    """
    n = shapes.shape[1]
    work, most = np.zeros(n), np.zeros(n)
    for effect in model.effects:
        if Role.GYROSCOPIC not in effect.role:
            continue
        for c in effect.contribute(model):
            if c.C is None:
                continue
            values, vectors = np.linalg.eigh(0.5j * (c.C - np.swapaxes(c.C, 1, 2)))
            size = np.abs(np.einsum("bji,bjn->bin", vectors.conj(), shapes[c.dofs])) ** 2
            work += np.einsum("bi,bin->n", values, size)
            most += np.einsum("bi,bin->n", np.abs(values), size)
    turns = most > AT_REST * np.abs(poles)  # modal A of 2i Im s: an energy of about |s|²
    return np.divide(work, most, out=np.full(n, np.nan), where=turns)


def whirl_name(value: float) -> str:
    """Return ``"forward"``, ``"backward"`` or ``"planar"``; an empty string of NaN."""
    if np.isnan(value):
        return ""
    if abs(value) < PLANAR:
        return "planar"
    return "forward" if value > 0 else "backward"


# ------------------------------------------------------------------------------------------------------------


DENSE_LIMIT = 120
"""Systems of at most this many coordinates are solved as they are, unless an element has a law."""

TOLERANCE = 1e-8
"""Residual of a pole, relative to its own equation; the error of s is of its square."""


_EQUAL = 1e-7
"""Relative distance below which poles count as equal."""


@dataclass(frozen=True, slots=True, eq=False)
class ComplexModes:
    """Poles and complex shapes, the slowest first; rigid-body modes apart.

    Shapes have modal A = yᵀ(2sM + Ĉ)x = 2i Im(s), so that those of light or proportional damping are the real
    ones with φᵀMφ = 1; overdamped ones, whose poles are real, have |modal A| = 2|s| and are real where K̂ is.
    Poles at 0, of a body that drifts in dampers, have xᵀMx = 1. Left shapes y are x itself where matrices are
    symmetric. With rotors yᵀ(K̂ + sĈ + s²M) = 0 and yᴴMy = xᴴMx: without damping y is the conjugate of x.

    Attributes
    ----------
    poles : ndarray of complex (n_modes,)
        s, with Im s ≥ 0 [rad/s].
    shapes : ndarray of complex (n_dof, n_modes)
        x [1/√kg, rad/(m √kg)].
    left : ndarray of complex (n_dof, n_modes)
        y; the same array as ``shapes`` where matrices are symmetric.
    modal_a : ndarray of complex (n_modes,)
        yᵀ(2sM + Ĉ)x [rad/s].
    residual : ndarray (n_modes,)
        ‖Z(s)x‖ in the norm of (K + |s|²M)⁻¹, relative to ‖x‖ in that of K + |s|²M [-].
    partners : ndarray of complex (n_partners,)
        Poles with Im s < 0: the conjugates where K̂ is real [rad/s].
    partner_shapes, partner_left : ndarray of complex (n_dof, n_partners)
    partner_a : ndarray of complex (n_partners,)
    rigid : ndarray (n_dof, n_rigid)
        Rigid-body motions that nothing resists or damps, φᵀMφ = I; s = 0 twice, which has no modal A.
    converged : bool
        Whether all residuals are below `TOLERANCE`, or rounding of the terms of their equations, which
        may be 1e-6.
    model : Model
    """

    poles: Complexes
    shapes: Complexes
    left: Complexes
    modal_a: Complexes
    residual: Floats
    partners: Complexes
    partner_shapes: Complexes
    partner_left: Complexes
    partner_a: Complexes
    rigid: Floats
    converged: bool
    model: Model

    __repr__ = fields_summary

    @property
    def n_modes(self) -> int:
        """Number of modes, without rigid-body ones."""
        return self.poles.size

    @property
    def modal_b(self) -> Complexes:
        """Modal B = -s · modal A, shape (n_modes,) [rad²/s²]."""
        return -self.poles * self.modal_a

    @property
    def frequency(self) -> Floats:
        """|s|/2π, shape (n_modes,) [Hz]."""
        return np.abs(self.poles) / (2 * np.pi)

    @property
    def damped_frequency(self) -> Floats:
        """Im s/2π, shape (n_modes,); 0 for overdamped modes [Hz]."""
        return np.imag(self.poles) / (2 * np.pi)

    @property
    def zeta(self) -> Floats:
        """Damping ratio -Re s/|s|, shape (n_modes,) [-]."""
        return -np.real(self.poles) / np.maximum(np.abs(self.poles), 1e-300)

    @property
    def overdamped(self) -> Bools:
        """Whether a pole is real, so that its mode creeps and does not oscillate, shape (n_modes,)."""
        return np.imag(self.poles) == 0

    def as_modes(self) -> Modes:
        """Return rigid-body and oscillating modes for pictures, MAC and files."""
        keep = ~self.overdamped
        shapes = np.hstack([self.rigid.astype(complex), self.shapes[:, keep]])
        none = np.zeros(self.rigid.shape[1])
        return Modes(
            np.concatenate([none, self.frequency[keep]]),
            shapes,
            np.concatenate([none, self.zeta[keep]]),
            n_rigid=self.rigid.shape[1],
        )

    def frf(
        self,
        frequency: ArrayLike,
        outputs: Selection,
        inputs: Selection,
        kind: FRFKind | str = FRFKind.ACCELERANCE,
    ) -> FRF:
        """Superpose the modes: H = Σ x yᵀ / (a (iω - s)) of poles and partners, -φφᵀ/ω² of rigid ones.

        It lacks the modes that were not asked for.

        Raises
        ------
        FRFError
            For elements that depend on frequency, whose modes do not superpose, and 0 Hz of a free structure.
        """
        if any(c.law is not None for c in self.model.contributions()):
            msg = "modes of elements that depend on frequency do not superpose; use compute_frf"
            raise FRFError(msg)
        lines = np.array(frequency, dtype=float, ndmin=1)
        out, out_labels = dof_vectors(self.model, outputs)
        inn, in_labels = dof_vectors(self.model, inputs)
        omega = 2 * np.pi * lines[:, None]
        if self.rigid.shape[1] and (lines == 0).any():
            msg = "the receptance is infinite at 0 Hz: nothing holds the structure"
            raise FRFError(msg)
        H = np.zeros((lines.size, out.shape[1], inn.shape[1]), dtype=complex)
        for poles, x, y, a in (
            (self.poles, self.shapes, self.left, self.modal_a),
            (self.partners, self.partner_shapes, self.partner_left, self.partner_a),
        ):
            H += np.einsum(
                "or,fr,ri->foi", out.T @ x, 1 / (a * (1j * omega - poles)), y.T @ inn, optimize=True
            )
        if self.rigid.shape[1]:
            H += -((out.T @ self.rigid) @ (self.rigid.T @ inn)) / omega[:, :, None] ** 2
        return FRF.from_arrays(lines, H, FRFKind.RECEPTANCE, out_labels, in_labels).as_kind(kind)


class _Residual(NamedTuple):
    """Residual of the eigenvalue equation for a pole and its vector."""

    correction: Complexes  # G⁻¹ Z(s) x
    size: float  # relative to the vector
    rounding: float  # the size that rounding of the terms makes

    @property
    def converged(self) -> bool:
        """Whether no more can be reached, and the pole is right to a part in a million."""
        # Residuals up to this multiple of the rounding of their own terms count as converged [-]
        # Residuals above this do not count as converged, even if they are rounding [-]
        return self.size <= max(TOLERANCE, min(16.0 * self.rounding, 1e-6))


@dataclass(frozen=True, slots=True, eq=False)
class _QuadraticProblem:
    """The quadratic problem on the independent coordinates, and the norms of its residuals."""

    system: System
    K: Any
    C: Any
    ratios: Floats  # (n_free, k): modal ratios add ratios ratiosᵀ to C
    factor: Factor  # of G = K - σM
    G: Any
    pairs: Eigenpairs
    rigid: Floats  # (n_free, n_rigid), M-orthonormal
    real: bool
    shift: float  # σ < 0 [rad²/s²]

    @property
    def scale(self) -> float:
        """Circular frequency of the first elastic mode [rad/s]."""
        return np.sqrt(10 * abs(self.shift))

    def stiffness(self, s: complex) -> Any:
        """Return K̂ with laws at the damped frequency of s."""
        K = self.K
        for law, X in self.system.laws:
            K = K + law_change(law, np.array([abs(np.imag(s))]))[0] * X
        return K

    def damped(self, X: NDArray[Any], *, left: bool = False) -> NDArray[Any]:
        """Return Ĉ X, or Ĉᵀ X for left shapes."""
        return (self.C.T if left else self.C) @ X + self.ratios @ (self.ratios.T @ X)

    def residual(self, s: complex, x: Complexes, *, left: bool = False) -> "_Residual":
        """Return what is left of Z(s) x, or of Z(s)ᵀ x.

        In the norms of K + |s|²M some undamped mode has |ω² + s²|/(ω² + |s|²) within the residual where
        nothing damps. In those of K - σM a fast mode could never do so: there, rounding of |s|²M x
        counts by its part in the slowest mode.
        """
        system, K = self.system, self.stiffness(s)
        force, damping, inertia = K @ x, s * self.damped(x, left=left), s**2 * (system.M @ x)
        z = force + damping + inertia
        z = z - (system.M @ self.rigid) @ (self.rigid.T @ z)
        energy = np.real(np.vdot(x, self.G @ x) + (abs(s) ** 2 + self.shift) * np.vdot(x, system.M @ x))
        # an entry of each product is rounded by half a unit, at least
        terms = abs(K) @ abs(x) + abs(damping) + abs(s) ** 2 * (abs(system.M) @ abs(x))
        signs = np.random.default_rng(0).choice([-1.0, 1.0], len(x))
        rounded = np.finfo(float).eps * terms * signs
        rounded = rounded - (system.M @ self.rigid) @ (self.rigid.T @ rounded)
        columns = np.column_stack([np.real(z), np.imag(z), rounded])
        w = self.factor.solve(columns)
        size = self._size(columns, w, s) / np.sqrt(max(float(energy), 1e-300))
        return _Residual(w[:, 0] + 1j * w[:, 1], float(np.hypot(size[0], size[1])), float(size[2]))

    def _size(self, z: Floats, w: Floats, s: complex) -> Floats:
        """Return the sizes of forces in the norm of (K + |s|²M)⁻¹, with w = G⁻¹ z, shape (k,).

        Known modes have that norm in closed form. It is at most the norm of G⁻¹, which serves the rest.
        """
        elastic = slice(self.pairs.n_rigid, None)
        lam, X = self.pairs.eigenvalues[elastic], self.pairs.vectors[:, elastic]
        part = X.T @ z
        rest = z - self.system.M @ (X @ part)
        outside = np.einsum("ij,ij->j", rest, w - X @ (part / (lam - self.shift)[:, None]))
        inside = (part**2 / (lam + abs(s) ** 2)[:, None]).sum(axis=0)
        return np.sqrt(np.maximum(outside, 0.0) + inside)

    def modal_a(self, root: Root) -> complex:
        s, x, y = root
        return complex(y @ (2 * s * (self.system.M @ x) + self.damped(x)))


@one_thread()
def solve_complex_modes(system: System, n: int = 20, *, pairs: Eigenpairs | None = None) -> ComplexModes:
    """Compute the n modes of smallest |s| with all damping of a model.

    Parameters
    ----------
    system : System
    n : int
        Number of modes besides rigid-body ones; overdamped ones count.
    pairs : Eigenpairs, optional
        Undamped modes of the system, of which the basis is made, where they are known.

    Returns
    -------
    ComplexModes
        With residuals, and whether they are below 1e-8.

    Raises
    ------
    ModelError
        For n below 1, and for mechanisms.
    UnstableError
        For a structure with a motion of negative stiffness.
    """
    if n < 1:
        msg = f"{n} modes are asked for; at least 1 is needed"
        raise ModelError(msg)
    all_rigid = system.rigid.shape[1]
    if pairs is None:
        pairs = solve_eigenpairs(system, min(system.n_free, all_rigid + n + max(10, n // 2)))
    problem = _problem(system, pairs)
    V = _start(problem, pairs)
    while True:
        upper, lower = _projected(problem, V, n)
        found, new, worst = [], [], []
        for root in (*upper, *lower):
            full, missing = _lifted(problem, V, root)
            found.append(full)
            worst.append(max(missing, key=lambda left: left.size))
            new += [part(r.correction) for r in missing if not r.converged for part in (np.real, np.imag)]
        if not new or V.shape[1] >= system.n_free - problem.rigid.shape[1]:
            break
        grown = _grown(problem, V, np.column_stack(new))
        if grown.shape[1] == V.shape[1] or V.shape[1] > 30 * (n + 10):
            break
        V = grown
    return _result(problem, found, worst, len(upper))


def _lifted(problem: _QuadraticProblem, V: Floats, root: Root) -> tuple[Root, list[_Residual]]:
    """Return a root with its vectors in the full system, and the residuals of these."""
    x = V @ root.right
    missing = [problem.residual(root.s, x)]
    if problem.system.reciprocal:
        return Root(root.s, x, x), missing
    y = V @ root.left
    return Root(root.s, x, y), [*missing, problem.residual(root.s, y, left=True)]


def _problem(system: System, pairs: Eigenpairs) -> _QuadraticProblem:
    damping = system.model.damping
    D = system.D + damping.loss_factor * system.K
    K = system.K + 1j * D if D.nnz and abs(D).max() > 0 else system.K
    C = sp.csc_array(system.C + damping.alpha * system.M + damping.beta * system.K)
    omega = np.sqrt(pairs.eigenvalues)
    zeta = damping.ratio_at(omega / (2 * np.pi))
    # 2ζω on each real mode: C gains MΦ diag(2ζω) ΦᵀM
    ratios = np.zeros((system.n_free, 0))
    if zeta.any():
        ratios = np.asarray(system.M @ pairs.vectors) * np.sqrt(2 * zeta * omega)
    shift = -0.1 * float(pairs.eigenvalues[pairs.n_rigid]) if len(omega) > pairs.n_rigid else pairs.shift
    shift = min(shift, -1e-8 * abs(pairs.shift))
    G = sp.csc_array(system.K - shift * system.M)
    rigid = rigid_body_motions(system)
    if rigid.shape[1]:
        # a rigid motion that a damper resists is a mode like others
        resisted = np.asarray(abs(C - damping.beta * system.K) @ abs(rigid))
        force = np.abs(C @ rigid - damping.beta * (system.K @ rigid))
        slack = 1e-9 * np.maximum(resisted.max(), 1e-300)
        if (force > slack).any():
            _, sv, Vt = np.linalg.svd(np.asarray(C @ rigid), full_matrices=True)
            rank = int((sv > 1e-9 * sv.max()).sum())
            rigid = rigid @ Vt[rank:].T
    real = not np.iscomplexobj(K) and not system.laws
    return _QuadraticProblem(system, K, C, ratios, factorise(G), G, pairs, rigid, real, shift)


def _start(problem: _QuadraticProblem, pairs: Eigenpairs) -> Floats:
    """Return real modes and the responses to the forces of local dampers, or everything of a small system.

    Without these responses a mode that creeps in one damper would hide behind faster ones of the basis.
    """
    n = problem.system.n_free
    empty = np.zeros((n, 0))
    if n <= DENSE_LIMIT and not problem.system.laws:
        return _grown(problem, empty, np.eye(n) / np.sqrt(problem.G.diagonal()))
    V = _grown(problem, empty, pairs.vectors)
    forces = locals_of(problem.system, reciprocal=False).U.toarray()
    for _ in range(2):
        if forces.shape[1]:
            response = problem.factor.solve(forces)
            V = _grown(problem, V, response)
            forces = np.asarray(problem.system.M @ response)
    return V


def _grown(problem: _QuadraticProblem, V: Floats, new: Floats) -> Floats:
    """Return V with new vectors, G-orthonormal and M-orthogonal to rigid-body modes."""
    M, G, R = problem.system.M, problem.G, problem.rigid

    def size(X: Floats) -> Floats:
        return np.sqrt(np.maximum(np.einsum("ij,ij->j", X, G @ X), 0.0))

    for _ in range(2):
        new = new / np.maximum(size(new), 1e-300)
        new = new - R @ (R.T @ (M @ new))
        new = new - V @ (V.T @ (G @ new))
    kept = size(new) > 1e-12
    new = new[:, kept] / size(new[:, kept])
    # the second round starts from unit vectors: what loses half of its square there was rounding in V
    for least in (1e-12, 0.5):
        values, vectors = np.linalg.eigh(new.T @ (G @ new))
        keep = values > least
        new = new @ (vectors[:, keep] / np.sqrt(values[keep]))
        new = new - V @ (V.T @ (G @ new))
    return np.hstack([V, new])


def _projected(problem: _QuadraticProblem, V: Floats, n: int) -> tuple[list[Root], list[Root]]:
    """Return the n slowest roots on a basis with Im s ≥ 0, and their partners below."""
    M, K, C = V.T @ (problem.system.M @ V), V.T @ (problem.K @ V), V.T @ problem.damped(V)
    laws = [(law, V.T @ (X @ V)) for law, X in problem.system.laws]
    small = QuadraticPencil(K, C, M, laws, problem.system.reciprocal)
    roots = all_roots(small)
    upper, lower = ([r for r in roots if (r.s.imag >= 0) == above] for above in (True, False))
    if laws:
        # more than n, as laws may change the order
        refined = [with_laws(small, root) for root in upper[: n + max(4, n // 2)]]
        return sorted(different(refined, M), key=lambda root: abs(root.s))[:n], []
    if problem.real:
        lower = []
    elif len(upper) > n:
        lower = [r for r in lower if abs(r.s) <= 1.01 * abs(upper[n - 1].s)]
    return upper[:n], lower


def _separated(problem: _QuadraticProblem, roots: list[Root]) -> list[Root]:
    """Return roots whose vectors are orthogonal in modal A also where poles are equal.

    With A_jk = y_jᵀ (2sM + Ĉ) x_k of a set of equal poles, X A^(-1/2) has the unit matrix if all is
    symmetric; otherwise Y A^(-T) has it.
    """
    s = np.array([root.s for root in roots])
    if not s.size:
        return []
    near = np.abs(s[:, None] - s) < _EQUAL * np.maximum(np.abs(s), problem.scale)[:, None]
    n_sets, label = connected_components(sp.csr_array(near), directed=False)
    out = list(roots)
    for k in range(n_sets):
        members = np.flatnonzero(label == k)
        if members.size == 1:
            continue
        X, Y = (np.column_stack([roots[i][part] for i in members]) for part in (1, 2))
        A = Y.T @ (2 * s[members].mean() * (problem.system.M @ X) + problem.damped(X))
        if problem.system.reciprocal:
            values, T = np.linalg.eig((A + A.T) / 2)
            X = Y = X @ (T @ np.diag(1 / np.sqrt(values.astype(complex))) @ np.linalg.inv(T))
        else:
            Y = np.linalg.solve(A, Y.T).T
        for i, x, y in zip(members, X.T, Y.T, strict=True):
            out[i] = Root(roots[i].s, x, x if problem.system.reciprocal else y)
    return out


def _scaled(problem: _QuadraticProblem, root: Root) -> tuple[Root, complex]:
    """Return a root whose vectors have the modal A of `ComplexModes`, and that modal A."""
    M, (s, x, y) = problem.system.M, root
    symmetric = problem.system.reciprocal
    mass = x @ (M @ x) if symmetric else np.real(np.vdot(x, M @ x))
    if not symmetric:
        y = y * np.sqrt(mass / np.real(np.vdot(y, M @ y)))
    a = problem.modal_a(Root(s, x, y))
    wanted: complex = complex(2j * s.imag if s.imag else 2 * abs(s) * (1.0 if np.real(a) >= 0 else -1.0))
    if abs(wanted) < 1e-9 * abs(a) / abs(mass):
        wanted = complex(a / mass)  # it drifts: s = 0
    largest = x[np.argmax(np.abs(x))]
    if symmetric:
        x = np.sqrt(wanted / a + 0j) * x
        x = -x if np.real(x[np.argmax(np.abs(x))]) < 0 else x
        return Root(s, x, x), wanted
    turn = np.sqrt(abs(wanted / a)) * np.conj(largest) / abs(largest)
    return Root(s, turn * x, wanted / a / turn * y), wanted


def _result(
    problem: _QuadraticProblem, found: list[Root], residuals: list[_Residual], n_upper: int
) -> ComplexModes:
    Q = problem.system.Q

    def scaled(roots: list[Root]) -> tuple[Any, Any, Any, Any]:
        each = [_scaled(problem, root) for root in _separated(problem, roots)]
        none = np.zeros((Q.shape[1], 0), dtype=complex)
        x, y = (np.asarray(Q @ np.column_stack([none, *(r[part] for r, _ in each)])) for part in (1, 2))
        poles, modal = (
            np.array(values, dtype=complex) for values in ([r.s for r, _ in each], [a for _, a in each])
        )
        return poles, x, x if problem.system.reciprocal else y, modal

    upper = poles, shapes, left, modal = scaled(found[:n_upper])
    if problem.real or problem.system.laws:
        below = poles.imag > 0
        partners = tuple(np.conj(X[..., below]) for X in upper)
    else:
        partners = scaled(found[n_upper:])
    return ComplexModes(
        poles=poles,
        shapes=shapes,
        left=left,
        modal_a=modal,
        residual=np.array([r.size for r in residuals[:n_upper]]),
        partners=partners[0],
        partner_shapes=partners[1],
        partner_left=partners[2],
        partner_a=partners[3],
        rigid=np.asarray(Q @ problem.rigid),
        converged=all(r.converged for r in residuals),
        model=problem.system.model,
    )
