"""Natural frequencies, damping and shapes of a reduced model as functions of parameters, with derivatives."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Protocol

import numpy as np
import scipy.linalg as sla
from numpy.typing import NDArray

from fem.array_types import Bools, Complexes, Floats, Ints
from fem.model import Effect, ParameterRef
from fem.recent import Recent
from fem.reduction.parametric_frf import ParametricFRF
from fem.reduction.reduced_model import Lacking, ReducedModel
from fem.reduction.terms import ReducedTerm

STACKED = ("K", "M", "C", "D", "connections")
"""Matrices of a :class:`ModeStack`."""


def frequency_of(eigenvalue: Any) -> Any:
    """Return natural frequencies by eigenvalues ω², 0 where these are negative [Hz]."""
    return np.sqrt(np.maximum(eigenvalue, 0.0)) / (2 * np.pi)


@dataclass(frozen=True, slots=True, eq=False)
class Pairs:
    """Undamped modes of a reduced model.

    Attributes
    ----------
    eigenvalues : ndarray (r,)
        ω² [rad²/s²].
    vectors : ndarray (r, r)
    shapes : ndarray (n_out, r)
        At the outputs.
    n_rigid : int
        Number of them that move as a rigid body.
    """

    eigenvalues: Floats
    vectors: Floats
    shapes: Floats
    n_rigid: int

    @property
    def frequency(self) -> Floats:
        """Natural frequencies, 0 for rigid bodies and what is unstable [Hz]."""
        return frequency_of(self.eigenvalues)


@dataclass(frozen=True, slots=True, eq=False)
class DampedMode:
    """One mode with damping: A x = λ M x with λ = ω² (1 + 2iζ).

    Attributes
    ----------
    eigenvalue : complex
        λ [rad²/s²].
    vector : ndarray (r,)
        x, with xᵀ M x = 1; real where damping is followed to the first order.
    """

    eigenvalue: complex
    vector: NDArray[Any]

    @property
    def frequency(self) -> float:
        """Natural frequency [Hz]."""
        return float(np.sqrt(max(self.eigenvalue.real, 1e-300)) / (2 * np.pi))

    @property
    def zeta(self) -> float:
        """Damping ratio [-]."""
        return float(self.eigenvalue.imag / (2 * max(self.eigenvalue.real, 1e-300)))


def n_rigid_of(eigenvalues: Floats, most: int) -> Ints:
    """Return how many of the lowest of ``most`` eigenvalues (..., r) are those of rigid bodies.

    There are fewer where something holds the structure.
    """
    first_elastic = np.abs(eigenvalues[..., min(most, eigenvalues.shape[-1] - 1)])
    is_rigid = np.abs(eigenvalues[..., :most]) < 1e-6 * first_elastic[..., None]
    return np.asarray(is_rigid.sum(axis=-1), dtype=np.int64)


def with_strong_damping(
    A: Complexes, S: Floats, eigenvalues: Floats, modes: Ints
) -> tuple[Complexes, Complexes]:
    """Return eigenvalues (c,) and vectors (c, r) of A, each near an undamped mode.

    The local losses may hold a connection as a stiffness does: the start is the mode of their real part that
    is most like the undamped one.

    Parameters
    ----------
    A : ndarray (c, r, r)
        Without what is proportional to mass, in the coordinates of the undamped modes.
    S : ndarray (c, r, r)
        The imaginary part of the local dynamic stiffness there.
    eigenvalues : ndarray (c, r)
        Of the undamped modes.
    modes : ndarray of int (c,)
        Which of these.
    """
    n, each = np.arange(eigenvalues.shape[1]), np.arange(len(modes))
    stiff = (S + S.transpose(0, 2, 1)) / 2
    stiff[:, n, n] += eigenvalues
    moved, W = np.linalg.eigh(stiff)
    apart = np.log(np.maximum(moved, 1e-9) / eigenvalues[each, modes][:, None])
    like = np.abs(W[each, modes]) - np.abs(apart)
    y: NDArray[Any] = W[each, :, np.argmax(like, axis=1)].astype(complex)

    def quotient(y: NDArray[Any]) -> NDArray[Any]:
        return (y * (A @ y[:, :, None])[:, :, 0]).sum(axis=1) / (y**2).sum(axis=1)

    # Rayleigh quotient iterations for a mode with more; they converge cubically
    for _ in range(3):
        shifted = A.copy()
        shifted[:, n, n] -= quotient(y)[:, None]
        try:
            y = np.linalg.solve(shifted, y[:, :, None])[:, :, 0]
        except np.linalg.LinAlgError:  # an eigenvalue to the last digit
            shifted[:, n, n] += 1e-12 * np.abs(quotient(y))[:, None]
            y = np.linalg.solve(shifted, y[:, :, None])[:, :, 0]
        y = y / np.sqrt((y**2).sum(axis=1, keepdims=True))
    return quotient(y), y


class ModesBesides(Protocol):
    """Matrices on the columns of a basis as functions of parameters."""

    def term(self, values: Floats) -> ReducedTerm:
        """Return the matrices at values (n_par,)."""
        ...

    def slopes(self, values: Floats) -> list[tuple[int, ReducedTerm]]:
        """Return their derivatives by parameters, with these."""
        ...


class ParametricModes:
    """Modes of a reduced model at some values of parameters.

    What depends on frequency is taken at a frequency of each mode that is asked for: the measured one.

    Parameters
    ----------
    reduced : ReducedModel
    outputs : ndarray (r + p, n_out)
        Responses as combinations of the basis's columns.
    frequency : ndarray (n,)
        Of the modes that are asked for [Hz].
    refs, candidates, release
        As of :class:`fem.reduction.parametric_frf.ParametricFRF`.
    besides : ModesBesides, optional
        Matrices on the basis's columns besides those of the model.
    """

    def __init__(
        self,
        reduced: ReducedModel,
        outputs: Floats,
        frequency: Floats,
        refs: Sequence[ParameterRef] = (),
        candidates: Sequence[Effect] = (),
        release: Sequence[tuple[str, str]] = (),
        besides: ModesBesides | None = None,
    ) -> None:
        self._besides = besides
        self.engine = ParametricFRF(
            reduced, outputs, outputs[:, :0], frequency, refs, candidates, release, projected=True
        )
        # Modes and slopes are asked for one after the other, by fits that weight readings differently too.
        self._last = Recent(1)
        self._terms = Recent(1)

    def at(self, values: Floats, zeta: Floats) -> "ModesAt":
        """Return the modes at some values.

        Parameters
        ----------
        values : ndarray (n_par,)
        zeta : ndarray (n,) or (2, n)
            Damping ratio at each frequency, and that of connections if it is another [-].
        """
        values = np.asarray(values, dtype=float)
        key = values.tobytes(), zeta.tobytes()
        out: ModesAt = self._last.get(key, lambda: self._at(values, np.atleast_2d(zeta)))
        return out

    def _at(self, values: Floats, zeta: Floats) -> "ModesAt":
        engine = self.engine
        total, alone = engine.matrices(values)
        self._terms.put(values.tobytes(), alone)
        columns = np.eye(engine.reduced.basis.T.shape[1])[:, engine.active]
        at = ModesAt(engine.reduced, engine.omega, zeta, total, engine.outputs, columns)
        return at if self._besides is None else at.with_term(self._besides.term(values))

    def slopes(self, values: Floats) -> list[tuple[int, ReducedTerm]]:
        """Return the derivatives of the matrices by parameters, with these."""
        values = np.asarray(values, dtype=float)
        alone = self._terms.get(values.tobytes(), lambda: self.engine.matrices(values)[1])
        more = [] if self._besides is None else self._besides.slopes(values)
        return [*self.engine.slopes(values, alone), *((i, self.engine.restrict(term)) for i, term in more)]


class ModesAt:
    """Modes of a reduced model's matrices; see :class:`ParametricModes`.

    Parameters
    ----------
    reduced : ReducedModel
    omega : ndarray (n,)
        Angular frequencies of the modes that are asked for [rad/s].
    zeta : ndarray (1 or 2, n)
    total : dict
        The sums of all terms: K, M, C, D, ``connections`` and ``laws``, on r coordinates.
    outputs : ndarray (r, n_out)
    columns : ndarray (r_basis, r)
        The coordinates as combinations of the basis's columns.
    """

    def __init__(
        self,
        reduced: ReducedModel,
        omega: Floats,
        zeta: Floats,
        total: dict[str, Any],
        outputs: Floats,
        columns: Floats,
    ) -> None:
        self.reduced, self.omega, self.outputs, self.columns = reduced, omega, outputs, columns
        self._total, self._zeta, d = total, zeta, reduced.model.damping
        self._members = 1 + 1j * (d.loss_factor + 2 * zeta[0]) + 1j * omega * d.beta
        self._connections = self._members + (2j * (zeta[1] - zeta[0]) if len(zeta) > 1 else 0.0)
        self._mass: Any = 1j * omega * d.alpha
        self._known: dict[int, Pairs] = {}

    @property
    def mass(self) -> Floats:
        """The mass matrix (r, r)."""
        return self._total["M"]

    def on(self, W: Floats) -> "ModesAt":
        """Return the modes within the range of some vectors (r, m)."""
        total: dict[str, Any] = {key: W.T @ X @ W for key, X in self._total.items() if key != "laws"}
        total["laws"] = [(f, W.T @ X @ W) for f, X in self._total["laws"]]
        return ModesAt(self.reduced, self.omega, self._zeta, total, W.T @ self.outputs, self.columns @ W)

    def with_lacking(self, shapes: Lacking, stiffer: float, heavier: float) -> "ModesAt":
        """Return the modes with shapes that the basis lacks as more coordinates.

        Their columns stand behind the basis's. The structure may be ``stiffer`` and ``heavier`` there than
        nominal, by factors. Sensors do not move with them: responses to forces at sensors are in the basis.
        """
        n, k = len(shapes.coupling_M), len(shapes.M)
        P = self.columns[:n].T

        def block(X: Floats, coupling: Any, corner: Any) -> Floats:
            return np.block([[X, coupling], [coupling.T, corner]])

        nothing = np.zeros((P.shape[0], k)), np.zeros((k, k))
        total: dict[str, Any] = {X: block(self._total[X], *nothing) for X in ("C", "D", "connections")}
        total["K"] = block(self._total["K"], stiffer * P @ shapes.coupling_K, stiffer * shapes.K)
        total["M"] = block(self._total["M"], heavier * P @ shapes.coupling_M, heavier * shapes.M)
        total["laws"] = [(f, block(X, *nothing)) for f, X in self._total["laws"]]
        outputs = np.vstack([self.outputs, np.zeros((k, self.outputs.shape[1]))])
        columns = sla.block_diag(self.columns, np.eye(k))
        return ModesAt(self.reduced, self.omega, self._zeta, total, outputs, columns)

    def with_term(self, term: ReducedTerm) -> "ModesAt":
        """Return the modes with a term, on the basis's columns, added to the matrices."""
        P = self.columns if term.L is None else term.L @ self.columns
        total = dict(self._total)
        for key in "KMCD":
            X = getattr(term, key)
            if X is not None and X.any():
                more = P.T @ X @ P
                total[key] = total[key] + more
                if key == "K" and term.connection:
                    total["connections"] = total["connections"] + more
        total["laws"] = [*total["laws"], *((f(self.omega), P.T @ X @ P) for f, X in term.laws)]
        return ModesAt(self.reduced, self.omega, self._zeta, total, self.outputs, self.columns)

    def with_each(self, terms: Sequence[ReducedTerm]) -> "ModeStack":
        """Return the modes with each of some terms of one place, which have as many laws."""
        P = self.columns if terms[0].L is None else terms[0].L @ self.columns
        stack = self._repeated(len(terms))
        for key in "KMCD":
            for k, term in enumerate(terms):
                X = getattr(term, key)
                if X is not None and X.any():
                    more = P.T @ X @ P
                    stack.total[key][k] += more
                    if key == "K" and term.connection:
                        stack.total["connections"][k] += more
        laws = list(stack.laws)
        for each in zip(*(term.laws for term in terms), strict=True):
            matrices = np.stack([P.T @ X @ P for _, X in each])
            laws.append((np.stack([factor(self.omega) for factor, _ in each]), matrices))
        return replace(stack, laws=tuple(laws))

    def _repeated(self, n: int) -> "ModeStack":
        """Return n times the same modes."""
        n_basis = self.reduced.basis.T.shape[1]

        def times(X: NDArray[Any]) -> NDArray[Any]:
            return np.repeat(X[None], n, axis=0)

        return ModeStack(
            self.reduced,
            self.omega,
            (self._members, self._connections, np.broadcast_to(self._mass, self.omega.shape)),
            {key: times(self._total[key]) for key in STACKED},
            tuple((times(f), times(X)) for f, X in self._total["laws"]),
            times(self.outputs),
            times(self.columns[:n_basis]),
        )

    @cached_property
    def _alone(self) -> "ModeStack":
        return self._repeated(1)

    def pairs(self, i: int) -> Pairs:
        """Return all undamped modes, with what depends on frequency at that of the mode asked for."""
        key = i if self._total["laws"] else 0
        if key not in self._known:
            one = self._alone.at_frequency(key)
            if not one.is_structure[0]:
                msg = "the mass matrix is not positive definite"
                raise np.linalg.LinAlgError(msg)
            self._known[key] = Pairs(one.eigenvalues[0], one.vectors[0], one.shapes[0], int(one.n_rigid[0]))
        return self._known[key]

    def damped(self, partner: Ints) -> list[DampedMode | None]:
        """Return modes of :meth:`pairs` with their damping, one at each frequency.

        Parameters
        ----------
        partner : ndarray of int (n,)
            Their numbers, -1 for none.
        """
        if not (partner >= 0).any():
            return [None] * len(partner)
        (lam,), (x,) = self._alone.damped(partner[None])
        each = zip(partner.tolist(), lam.tolist(), x, strict=True)
        return [None if k < 0 else DampedMode(value, vector) for k, value, vector in each]

    def slopes(
        self, modes: Sequence[tuple[int, int, DampedMode]], terms: Sequence[tuple[int, ReducedTerm]], n: int
    ) -> tuple[Complexes, list[Complexes]]:
        """Return dλ (n, n_modes), and for each mode dφ at the outputs (n, n_out), by n changes of matrices.

        (dA - λ dM) x projected on x, and on all other modes over λ - λ_k; what normalises x is left out, as
        a shape has no scale (Fox and Kapoor, *AIAA J.* 6, 1968, 2426).

        Parameters
        ----------
        modes : sequence of (int, int, DampedMode)
            Frequency, mode and what :meth:`damped` gave.
        terms : sequence of (int, ReducedTerm)
            Changes with their numbers, on these coordinates.
        n : int
        """
        omega = self.omega
        at = [i for i, _, _ in modes]
        factors = {
            "K": self._members,
            "connections": self._connections,
            "C": 1j * omega,
            "D": np.full(len(omega), 1j),
            "M": np.zeros(len(omega), dtype=complex),
        }
        for i, _, mode in modes:
            factors["M"][i] = -mode.eigenvalue
        x = np.stack([mode.vector for _, _, mode in modes], axis=1)
        mixing = self._mixing(modes)
        by = np.zeros((n, len(modes)), dtype=complex)
        shapes = np.zeros((len(modes), n, self.outputs.shape[1]), dtype=complex)
        places: dict[Any, tuple[Floats | None, list[tuple[int, NDArray[Any], NDArray[Any]]]]] = {}
        for p, term in terms:
            key = id(term.L) if term.L is None or term.dofs is None else term.dofs.tobytes()
            _, parts = places.setdefault(key, (term.L, []))
            parts += [(p, factor, X) for factor, X in term.parts(factors, omega)]
        for L, parts in places.values():
            if not parts:
                continue
            u = x if L is None else L @ x
            # one product each for large matrices: to stack them would cost more
            each = np.array([X @ u for *_, X in parts]) if L is None else np.array([X for *_, X in parts]) @ u
            each = each * np.array([factor for _, factor, _ in parts])[:, None, at]
            order = np.argsort([p for p, _, _ in parts], kind="stable")
            rows, first = np.unique([parts[k][0] for k in order], return_index=True)
            forces: Complexes = np.add.reduceat(each[order], first, axis=0)
            by[rows] += (u * forces).sum(axis=1)
            if not self.outputs.shape[1]:
                continue
            moved = (mixing if L is None else mixing @ L.T).transpose(0, 2, 1)
            of_mode: Complexes = np.ascontiguousarray(forces.transpose(2, 0, 1))
            shapes[:, rows] += of_mode.real @ moved + 1j * (of_mode.imag @ moved)
        return by, list(shapes)

    def _mixing(self, modes: Sequence[tuple[int, int, DampedMode]]) -> Floats:
        """Return what unit forces on the coordinates add to the shapes of modes at the outputs.

        By the other modes alone, (n_modes, n_out, r).
        """
        out = np.empty((len(modes), *self.outputs.shape[::-1]))
        for c, (i, k, _) in enumerate(modes):
            pairs = self.pairs(i)
            lam = pairs.eigenvalues
            # Eigenvalues nearer than this, relatively, have derivatives of their shapes as if this far apart
            # [-]
            apart, near = lam[k] - lam, (1e-4 * lam[k]) ** 2
            weight = apart / (apart**2 + near)
            weight[k] = 0.0
            out[c] = (pairs.shapes * weight) @ pairs.vectors.T
        return out

    def by_zeta(self, i: int, mode: DampedMode) -> Complexes:
        """Return dλ by the damping ratio at a frequency, and by that of connections, (1,) or (2,)."""
        x = mode.vector
        every = 2j * complex(x @ self._total["K"] @ x)
        if len(self._zeta) == 1:
            return np.array([every])
        by_connections = 2j * complex(x @ self._total["connections"] @ x)
        return np.array([every - by_connections, by_connections])


@dataclass(eq=False)
class ModeStack:
    """Modes of n sets of matrices on r coordinates each.

    One call of LAPACK for all costs a third of one for each, and everything behind it a tenth. What depends
    on frequency is taken at the first one that is asked for, except by :meth:`damped` and :meth:`rows`.

    Attributes
    ----------
    reduced : ReducedModel
    omega : ndarray (n_modes,)
        Angular frequencies of the modes that are asked for [rad/s].
    damping : tuple of ndarray (n_modes,)
        Factors of the members' and the connections' stiffness, and of the mass matrix.
    total : dict
        K, M, C, D and ``connections``, (n, r, r).
    laws : tuple of (ndarray (n, n_modes), ndarray (n, r, r))
        What depends on frequency: factors at each, and matrices.
    outputs : ndarray (n, r, n_out)
    columns : ndarray (n, r_basis, r)
        The coordinates as combinations of the basis's columns.
    """

    reduced: ReducedModel
    omega: Floats
    damping: tuple[Complexes, Complexes, Complexes]
    total: dict[str, Floats]
    laws: tuple[tuple[Complexes, Floats], ...]
    outputs: Floats
    columns: Floats

    @classmethod
    def joined(cls, stacks: "Sequence[ModeStack]") -> "ModeStack":
        """Return stacks on as many coordinates and with as many laws, of one model and damping, as one."""
        first = stacks[0]
        total = {key: np.concatenate([s.total[key] for s in stacks]) for key in STACKED}
        laws = tuple(
            (np.concatenate([f for f, _ in each]), np.concatenate([X for _, X in each]))
            for each in zip(*(s.laws for s in stacks), strict=True)
        )
        outputs, columns = (np.concatenate([getattr(s, k) for s in stacks]) for k in ("outputs", "columns"))
        return cls(first.reduced, first.omega, first.damping, total, laws, outputs, columns)

    @property
    def size(self) -> tuple[int, int, int]:
        """Numbers of sets, of their coordinates and of laws."""
        return *self.columns.shape[::2], len(self.laws)

    def _stiffness_of_laws(self, i: int) -> Floats:
        return np.sum([f[:, i].real[:, None, None] * X for f, X in self.laws], axis=0)

    def at_frequency(self, i: int) -> "ModeStack":
        """Return the stack with what depends on frequency at that of one mode alone."""
        if not self.laws or not i:
            return self
        if i not in self._at_others:
            laws = tuple((f[:, [i]], X) for f, X in self.laws)
            self._at_others[i] = replace(self, laws=laws)
        return self._at_others[i]

    @cached_property
    def _at_others(self) -> "dict[int, ModeStack]":
        return {}

    @cached_property
    def _solved(self) -> tuple[Floats, Floats, Bools]:
        K, M, inverse = self.total["K"], self.total["M"], np.zeros_like(self.total["M"])
        if self.laws:
            K = K + self._stiffness_of_laws(0)
        there = np.asarray(np.isfinite(K + M).all(axis=(1, 2)))
        if len(M) == 1 and there.all():  # fits have more digits
            with suppress(np.linalg.LinAlgError):
                lam, V = sla.eigh(K[0], M[0], check_finite=False)
                return lam[None], V[None], there
        try:
            inverse[there] = np.linalg.inv(np.linalg.cholesky(M[there]))
        except np.linalg.LinAlgError:
            for n in np.flatnonzero(there):
                try:
                    inverse[n] = np.linalg.inv(np.linalg.cholesky(M[n]))
                except np.linalg.LinAlgError:
                    there[n] = False
        A = np.zeros_like(K)
        A[there] = inverse[there] @ K[there] @ inverse[there].transpose(0, 2, 1)
        lam, Y = np.linalg.eigh(A)
        return lam, inverse.transpose(0, 2, 1) @ Y, there

    @property
    def eigenvalues(self) -> Floats:
        """ω² of the undamped modes, (n, r) [rad²/s²]."""
        return self._solved[0]

    @property
    def vectors(self) -> Floats:
        """Vectors of the undamped modes, (n, r, r)."""
        return self._solved[1]

    @property
    def is_structure(self) -> Bools:
        """Whether there is a structure: none where more mass is taken away than there is, (n,)."""
        return self._solved[2]

    @property
    def n_rigid(self) -> Ints:
        """Number of modes that move as a rigid body, (n,)."""
        return n_rigid_of(self.eigenvalues, self.reduced.basis.n_rigid)

    @cached_property
    def shapes(self) -> Floats:
        """Undamped modes at the outputs, (n, n_out, r)."""
        return self.outputs.transpose(0, 2, 1) @ self.vectors

    def rows(self, a: Ints, i: Ints) -> tuple[Floats, Ints, Floats]:
        """Return eigenvalues, ``n_rigid`` and shapes of all modes of sets a at the frequencies of modes i."""
        if not self.laws:
            return self.eigenvalues[a], self.n_rigid[a], self.shapes[a]
        each = [self.at_frequency(k) for k in i.tolist()]
        pairs = list(zip(each, a.tolist(), strict=True))
        lam, rigid, shapes = (
            [getattr(s, key)[n] for s, n in pairs] for key in ("eigenvalues", "n_rigid", "shapes")
        )
        return np.stack(lam), np.array(rigid), np.stack(shapes)

    def damped(self, partner: Ints) -> tuple[Complexes, NDArray[Any]]:
        """Return the eigenvalues (n, n_modes) and vectors (n, n_modes, r) of modes with their damping.

        NaN and 0 where there is none.

        Parameters
        ----------
        partner : ndarray of int (n, n_modes)
            Their numbers, -1 for none.
        """
        modes = np.arange(partner.shape[1])
        if not self.laws:
            return self._damped(partner, modes)
        each = [self.at_frequency(i)._damped(partner[:, [i]], modes[[i]]) for i in modes.tolist()]
        return np.hstack([lam for lam, _ in each]), np.concatenate([x for _, x in each], axis=1)

    def _damped(self, partner: Ints, modes: Ints) -> tuple[Complexes, NDArray[Any]]:
        members, connections, mass = (factor[modes] for factor in self.damping)
        there, k = partner >= 0, np.maximum(partner, 0)
        x = np.take_along_axis(self.vectors, k[:, None], axis=2)
        lam = np.take_along_axis(self.eigenvalues, k, axis=1)

        def of(X: Floats) -> Floats:
            return (x * (X @ x)).sum(axis=1)

        first = members * lam + mass
        if (connections != members).any():
            first = first + (connections - members) * of(self.total["connections"])
        out = np.where(there[:, None], x, 0.0).transpose(0, 2, 1)
        if self.laws or any(self.total[key].any() for key in "CD"):
            resisting = self.omega[modes] * of(self.total["C"]) + of(self.total["D"])
            # Laws include losses: their stiffness is not damped as members are.
            for f, X in self.laws:
                s = of(X)
                resisting, first = resisting + f[:, :1].imag * s, first + (1 - members) * f[:, :1].real * s
            first = first + 1j * resisting
            # Local damping of a mode up to this part of its eigenvalue is followed to the first order [-]
            a, i = np.nonzero(there & (np.abs(resisting) > 0.01 * np.maximum(lam, 1e-300)))
            if len(a):
                values, moved = self._followed(a, modes[i], k[a, i])
                out = out.astype(complex)
                first[a, i], out[a, i] = values, moved
        return np.where(there, first, np.nan), out

    def _followed(self, a: Ints, i: Ints, k: Ints) -> tuple[Complexes, Complexes]:
        """Return modes k of sets a with strong local damping at frequencies i."""
        members, connections, mass = (factor[i] for factor in self.damping)
        some, row = np.unique(a, return_inverse=True)
        V = self.vectors[some]

        def modal(X: Floats) -> Floats:
            return (V.transpose(0, 2, 1) @ X[some] @ V)[row]

        S = self.omega[i][:, None, None] * modal(self.total["C"]) + modal(self.total["D"])
        A = (connections - members)[:, None, None] * modal(self.total["connections"])
        for f, X in self.laws:
            S = S + f[a, 0].imag[:, None, None] * modal(X)
            A = A + ((1 - members) * f[a, 0].real)[:, None, None] * modal(X)
        A = A + 1j * S
        n = np.arange(V.shape[2])
        A[:, n, n] += members[:, None] * self.eigenvalues[a]
        values, y = with_strong_damping(A, S, self.eigenvalues[a], k)
        return values + mass, (V[row] @ y[:, :, None])[:, :, 0]
