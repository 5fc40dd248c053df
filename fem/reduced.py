"""The fast engine: FRFs of a reduced model and their exact derivatives.

It is made for many parameter values and candidate effects. A model is projected once. After that nothing
depends on the size of the mesh: a set of parameter values costs one small symmetric eigenproblem, and a
candidate effect what its own few DOFs cost.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
import scipy.linalg as sla
from numpy.typing import NDArray

from fem.basis import Basis, reduced_basis
from fem.model import Contribution, Effect, Model, ParameterRef
from fem.system import assemble, sum_contributions

LOCAL_LIMIT = 60
"""Contributions that touch at most this many DOFs are kept in factored form."""

_PLACES = 16
"""Places whose responses are kept for further changes."""

_STEP = 1e-200
"""Complex step; derivatives are exact to rounding."""


@dataclass(frozen=True, slots=True, eq=False)
class _Term:
    """Matrices on the reduced coordinates, X = Lᵀ x L for X in K, M, C, D.

    L is the identity where it is None. Each of ``laws`` is a factor as a function of ω and a matrix that it
    multiplies: what an element that depends on frequency adds to its static stiffness, which is in K.
    """

    L: NDArray[np.float64] | None
    K: NDArray[Any] | None
    M: NDArray[Any] | None
    C: NDArray[Any] | None
    D: NDArray[Any] | None
    laws: tuple[tuple[Callable[[NDArray[np.float64]], NDArray[Any]], NDArray[Any]], ...] = ()

    def dense(self, key: str) -> Any:
        X = getattr(self, key)
        return 0.0 if X is None else self.spread(X)

    def spread(self, X: NDArray[Any]) -> NDArray[Any]:
        return X if self.L is None else self.L.T @ X @ self.L


def _part(X: NDArray[Any] | None, imaginary: bool) -> NDArray[Any] | None:
    if X is None:
        return None
    return np.imag(X) / _STEP if imaginary else np.real(X)


def _law_parts(
    c: Contribution, imaginary: bool
) -> list[tuple[Callable[[NDArray[np.float64]], NDArray[Any]], NDArray[Any]]]:
    """Return what a law adds to the static stiffness, or its derivative by the product rule."""
    law, K = c.law, c.K
    assert law is not None
    assert K is not None

    def change(omega: NDArray[np.float64], step: bool) -> NDArray[Any]:
        storage, loss = law(omega)
        storage = storage - law(np.zeros(1))[0][0]
        real, imag = _part(storage, step), _part(loss, step)
        return real + 1j * imag  # type: ignore[operator]

    out = [(partial(change, step=imaginary), np.real(K))]
    if imaginary and np.iscomplexobj(K):
        out.append((partial(change, step=False), np.imag(K) / _STEP))
    return out


@dataclass(frozen=True, slots=True, eq=False)
class ReducedModel:
    """A model on a reduced basis, ready for :class:`ParametricFRF`.

    Attributes
    ----------
    model : Model
        The full model, at nominal values.
    basis : Basis
    """

    model: Model
    basis: Basis
    _cache: dict[Any, Any] = field(default_factory=dict, repr=False)

    def project(self, contributions: Sequence[Contribution], imaginary: bool = False) -> _Term:
        """Project contributions; ``imaginary`` takes the complex-step derivative instead of the value."""
        dofs = np.unique(
            np.concatenate([np.zeros(0, dtype=np.int64), *(c.dofs.ravel() for c in contributions)])
        )
        T = self.basis.T
        if len(dofs) > LOCAL_LIMIT:
            n = self.model.n_dof
            parts = [tuple(_part(X, imaginary) for X in (c.static, c.M, c.C, c.D)) for c in contributions]
            static = tuple(Contribution(c.dofs, *X) for c, X in zip(contributions, parts, strict=True))
            full = sum_contributions(static, n)
            laws = [
                (factor, sum_contributions((Contribution(c.dofs, X),), n)[0])
                for c in contributions
                if c.law is not None
                for factor, X in _law_parts(c, imaginary)
            ]
            K, M, C, D = (T.T @ (X @ T) if X.nnz else None for X in full)
            return _Term(None, K, M, C, D, tuple((factor, T.T @ (X @ T)) for factor, X in laws))

        def summed(pairs: Sequence[tuple[Contribution, Any]]) -> NDArray[Any] | None:
            present = [(c, X) for c, X in pairs if X is not None]
            if not present:
                return None
            total = np.zeros((len(dofs), len(dofs)))
            for c, X in present:
                at = np.searchsorted(dofs, c.dofs)
                np.add.at(total, (at[:, :, None], at[:, None, :]), X)
            return total

        static = [(c, _part(c.static, imaginary)) for c in contributions]
        M, C, D = (summed([(c, _part(getattr(c, key), imaginary)) for c in contributions]) for key in "MCD")
        laws = [
            (factor, summed([(c, X)]))
            for c in contributions
            if c.law is not None
            for factor, X in _law_parts(c, imaginary)
        ]
        return _Term(T[dofs], summed(static), M, C, D, tuple((f, X) for f, X in laws if X is not None))

    def value_of(self, effect: Effect) -> _Term:
        """Project an effect at its present values."""
        return self.project(effect.contribute(self.model))

    def derivative_of(self, effect: Effect, parameter: str, value: float) -> _Term:
        """Project an effect's derivative with respect to a parameter, by a complex step."""
        return self.project(
            effect.with_values(**{parameter: value + 1j * _STEP}).contribute(self.model), True
        )

    def base(self) -> dict[str, _Term]:
        """Return the projection of each effect of the model at nominal values (computed once)."""
        if "base" not in self._cache:
            self._cache["base"] = {e.name: self.value_of(e) for e in self.model.effects}
        return self._cache["base"]

    def base_sum(self) -> dict[str, NDArray[np.float64]]:
        """Return the sum of all effects' matrices at nominal values (computed once)."""
        if "sum" not in self._cache:
            n = self.basis.T.shape[1]
            self._cache["sum"] = {
                key: sum((t.dense(key) for t in self.base().values()), np.zeros((n, n))) for key in "KMCD"
            }
        return self._cache["sum"]

    def base_laws(self) -> list[tuple[Callable[[NDArray[np.float64]], NDArray[Any]], NDArray[np.float64]]]:
        """Return the factors and matrices of all effects that depend on frequency (computed once)."""
        if "laws" not in self._cache:
            self._cache["laws"] = [(f, t.spread(X)) for t in self.base().values() for f, X in t.laws]
        return self._cache["laws"]

    def linear(self, effect: Effect, parameter: str, value: float) -> _Term:
        """Return the derivative with respect to a linear parameter.

        It is computed once for effects of the model.
        """
        key = (effect.name, parameter)
        if key not in self._cache:
            self._cache[key] = self.derivative_of(effect, parameter, value)
        return self._cache[key]


def reduce_model(
    model: Model,
    forces: NDArray[np.float64],
    max_frequency: float,
    *,
    margin: float = 2.0,
    n_krylov: int = 1,
    releasable: bool = True,
) -> ReducedModel:
    """Project a model on modes and attachment vectors.

    Parameters
    ----------
    model : Model
    forces : ndarray (n_dof, k)
        Where forces act or may act: excitations, sides of joints, places of candidates.
    max_frequency : float
        Highest frequency of interest [Hz].
    margin : float
        Modes are taken up to this multiple of it.
    n_krylov : int
        Attachment vectors for each force.
    releasable : bool
        Whether effects may release the model's constraints later.
    """
    system = assemble(model)
    release = tuple(c for c in model.constraints() if c.releasable) if releasable else ()
    return ReducedModel(
        model, reduced_basis(system, forces, max_frequency, margin=margin, n_krylov=n_krylov, release=release)
    )


class ParametricFRF:
    """Receptances of a reduced model as a function of parameter values.

    Parameters
    ----------
    reduced : ReducedModel
    outputs, inputs : ndarray (n_dof, n_out), (n_dof, n_in)
        Responses and forces as combinations of DOFs.
    frequency : ndarray (n_freq,)
        Frequencies [Hz].
    refs : sequence of (effect, parameter)
        The parameters that vary: of the model's effects or of the candidates.
    candidates : sequence of Effect
        Effects that are added to the model.
    release : sequence of (str, str)
        Keys of constraints that are released besides those that the candidates release.
    """

    def __init__(
        self,
        reduced: ReducedModel,
        outputs: NDArray[np.float64],
        inputs: NDArray[np.float64],
        frequency: NDArray[np.float64],
        refs: Sequence[ParameterRef],
        candidates: Sequence[Effect] = (),
        release: Sequence[tuple[str, str]] = (),
    ) -> None:
        basis = reduced.basis
        self.reduced = reduced
        self.refs = tuple(refs)
        self.omega = 2 * np.pi * np.asarray(frequency, dtype=float)
        self._frequency = np.asarray(frequency, dtype=float)
        released = {key for effect in candidates for key in effect.released()} | set(release)
        columns = [basis.n_main + i for i, key in enumerate(basis.keys) if key in released]
        self._active = np.concatenate([np.arange(basis.n_main), np.array(columns, dtype=np.int64)])
        n = len(self._active)
        self._out = (basis.T.T @ outputs)[self._active]
        self._in = (basis.T.T @ inputs)[self._active]

        effects = {e.name: e for e in (*reduced.model.effects, *candidates)}
        wanted: dict[str, list[int]] = {}
        for i, (name, _) in enumerate(self.refs):
            wanted.setdefault(name, []).append(i)
        candidate_names = {e.name for e in candidates}
        ix = np.ix_(self._active, self._active)
        self._fixed: dict[str, Any] = {key: X[ix].copy() for key, X in reduced.base_sum().items()}
        self._fixed["laws"] = [(f(self.omega), X[ix]) for f, X in reduced.base_laws()]
        self._linear: list[tuple[int, float, _Term]] = []
        self._nonlinear: list[tuple[Effect, list[int]]] = []
        for name, effect in effects.items():
            rows = wanted.get(name, [])
            known = {p.name: p for p in effect.parameters()}
            free = [known[self.refs[i][1]] for i in rows]
            linear = all(p.linear for p in free)
            if name in candidate_names and linear:
                self._add_fixed(reduced.value_of(effect), 1.0)
            if linear:
                for i, p in zip(rows, free, strict=True):
                    term = (
                        reduced.derivative_of(effect, p.name, p.value)
                        if name in candidate_names
                        else reduced.linear(effect, p.name, p.value)
                    )
                    self._linear.append((i, p.value, self._restrict(term)))
            else:
                if name not in candidate_names:
                    self._add_fixed(reduced.base()[name], -1.0)
                self._nonlinear.append((effect, rows))
        self._n = n

    def _restrict(self, term: _Term) -> _Term:
        if term.L is not None:
            return replace(term, L=term.L[:, self._active])
        ix = np.ix_(self._active, self._active)
        K, M, C, D = (None if X is None else X[ix] for X in (term.K, term.M, term.C, term.D))
        return _Term(None, K, M, C, D, tuple((f, X[ix]) for f, X in term.laws))

    def _add_fixed(self, term: _Term, factor: float) -> None:
        term = self._restrict(term)
        self._add(self._fixed, term, factor)

    def _add(self, total: dict[str, Any], term: _Term, factor: float) -> None:
        for key in "KMCD":
            if getattr(term, key) is not None:
                total[key] = total[key] + factor * term.dense(key)
        total["laws"] = total["laws"] + [(factor * f(self.omega), term.spread(X)) for f, X in term.laws]

    def _matrices(
        self, values: NDArray[np.float64], gradient: bool
    ) -> tuple[dict[str, Any], dict[int, _Term]]:
        total = dict(self._fixed)
        slopes: dict[int, _Term] = {}
        for i, start, term in self._linear:
            self._add(total, term, values[i] - start)
            slopes[i] = term
        for effect, rows in self._nonlinear:
            now = effect.with_values(**{self.refs[i][1]: float(values[i]) for i in rows})
            term = self._restrict(self.reduced.value_of(now))
            self._add(total, term, 1.0)
            if gradient:
                for i in rows:
                    slopes[i] = self._restrict(
                        self.reduced.derivative_of(now, self.refs[i][1], float(values[i]))
                    )
        return total, slopes

    def evaluate(
        self, values: NDArray[np.float64], zeta: NDArray[np.float64], gradient: bool = True
    ) -> tuple[NDArray[np.complex128], NDArray[np.complex128] | None, NDArray[np.complex128] | None]:
        """Compute receptances and derivatives.

        Z = K (1 + i (η + 2ζ(ω)) + iωβ) + iD + iωC + iωα M - ω²M, with the model's η, α, β; dH = -Hₒ dZ Hᵢ.

        Parameters
        ----------
        values : ndarray (n_par,)
            Values of the parameters ``refs``.
        zeta : ndarray (n_freq,)
            Damping ratio at each line [-].
        gradient : bool
            Whether derivatives are wanted.

        Returns
        -------
        H : ndarray (n_freq, n_out, n_in)
        dH : ndarray (n_par, n_freq, n_out, n_in) or None
        dH_dzeta : ndarray (n_freq, n_out, n_in) or None
            With respect to the damping ratio at that line.
        """
        total, slopes = self._matrices(np.asarray(values, dtype=float), gradient)
        state = _State.of(self.reduced, total, self.omega, zeta)
        Bo, Xi = state.V.T @ self._out, state.solve(self._in)
        H = np.moveaxis(_times(Bo.T, Xi), 2, 0)
        if not gradient:
            return H, None, None
        Xo, V, lam, omega = state.solve(self._out), state.V, state.lam, self.omega
        stiffness, mass = state.stiffness, state.mass
        dH = np.zeros((len(self.refs), *H.shape), dtype=complex)
        Xot = np.ascontiguousarray(Xo.transpose(2, 1, 0))
        one = np.ones_like(stiffness)
        factors = {"K": stiffness, "M": mass, "C": 1j * omega, "D": 1j * one}
        for i, term in slopes.items():
            present = [
                (getattr(term, key), factor)
                for key, factor in factors.items()
                if getattr(term, key) is not None
            ]
            present += [(X, f(omega)) for f, X in term.laws]
            if not present:
                continue
            if term.L is None:
                for X, factor in present:
                    dH[i] -= factor[:, None, None] * (Xot @ np.moveaxis(_times(V.T @ X @ V, Xi), 2, 0))
            else:
                L = term.L @ V
                uo, ui = np.moveaxis(_times(L, Xo), 2, 0), np.moveaxis(_times(L, Xi), 2, 0)
                dZ = sum(factor[:, None, None] * X for X, factor in present)
                dH[i] = -np.swapaxes(uo, 1, 2) @ (dZ @ ui)
        return H, dH, -2j * (Xot @ np.moveaxis(lam[:, None, None] * Xi, 2, 0))

    def local(self, values: NDArray[np.float64], zeta: NDArray[np.float64]) -> "LocalChanges":
        """Solve once, so that many changes at few DOFs can be tried at little cost each.

        Parameters
        ----------
        values : ndarray (n_par,)
            Values of the parameters ``refs``.
        zeta : ndarray (n_freq,)
            Damping ratio at each line [-].
        """
        total, _ = self._matrices(np.asarray(values, dtype=float), False)
        state = _State.of(self.reduced, total, self.omega, zeta)
        Xo, Xi = state.solve(self._out), state.solve(self._in)
        H = np.moveaxis(_times((state.V.T @ self._out).T, Xi), 2, 0)
        return LocalChanges(self, state, Xo, Xi, H)


@dataclass(frozen=True, slots=True, eq=False)
class LocalChanges:
    """A solved state to which effects that touch few DOFs are added by low-rank updates.

    Attributes
    ----------
    engine : ParametricFRF
    state : _State
    Xo, Xi : ndarray (r, n, n_freq)
        Responses to unit forces at outputs and inputs.
    H : ndarray (n_freq, n_out, n_in)
        Receptances without the effects.
    """

    engine: ParametricFRF
    state: "_State"
    Xo: NDArray[np.complex128]
    Xi: NDArray[np.complex128]
    H: NDArray[np.complex128]
    _places: dict[bytes, Any] = field(default_factory=dict, repr=False)

    def receptances(self, effects: Sequence[Effect]) -> list[NDArray[np.complex128] | None]:
        """Return the receptances with each of some effects added, one at a time.

        H' = H - Hₒ (I + ΔZ G)⁻¹ ΔZ Hᵢ, with G the receptance of the motions that the effect resists: six for
        a joint. Effects at the same place share Hₒ, Hᵢ and G, also in later calls. An effect that touches
        too many DOFs gives None.
        """
        out: list[NDArray[np.complex128] | None] = []
        state, omega = self.state, self.engine.omega
        factors = {"K": state.stiffness, "M": state.mass, "C": 1j * omega, "D": np.full(len(omega), 1j)}
        for effect in effects:
            term = self.engine._restrict(self.engine.reduced.value_of(effect))
            if term.L is None:
                out.append(None)
                continue
            parts = [(factors[key], X) for key in "KMCD" if (X := getattr(term, key)) is not None and X.any()]
            parts += [(f(omega), X) for f, X in term.laws if X.any()]
            if not parts:
                out.append(self.H)
                continue
            place = self._place(term.L, [X for _, X in parts])
            # (I + ΔZ G) w = ΔZ Hᵢ
            A = np.zeros(place.both.shape, dtype=complex)
            for factor, X in parts:
                A += factor * _times(place.inverse @ X @ place.inverse.T, place.both)
            n = len(A)
            A[np.arange(n), np.arange(n)] += 1
            w = np.ascontiguousarray(np.moveaxis(_solve_lines(A), 2, 0))
            out.append(self.H - place.outputs @ w)
        return out

    def _place(self, L: NDArray[np.float64], matrices: list[NDArray[np.float64]]) -> "_Place":
        """Return the responses at the motions that matrices on the rows of L act on (computed once)."""
        key = L.tobytes()
        known = self._places.get(key)
        if known is not None and all(known.holds(X) for X in matrices):
            return known
        if known is not None:
            matrices = [*matrices, known.motions @ known.motions.T]
        motions, inverse, scale = _motions(matrices)
        Lm = motions.T @ L @ self.state.V
        G = _times(Lm, self.state.solve((motions.T @ L).T))
        both = np.concatenate([G, _times(Lm, self.Xi)], axis=1)
        outputs = np.ascontiguousarray(_times(Lm, self.Xo).transpose(2, 1, 0))
        place = _Place(motions, inverse, scale, outputs, both)
        while len(self._places) >= _PLACES:
            self._places.pop(next(iter(self._places)))
        self._places[key] = place
        return place


@dataclass(frozen=True, slots=True, eq=False)
class _Place:
    """Motions at a few DOFs, and what forces along them do.

    A matrix X on the DOFs is S x Sᵀ with S = ``motions`` (m, k) and x = ``inverse`` X ``inverse``ᵀ; ``scale``
    (m,) makes metres and radians alike. ``outputs`` (n_freq, n_out, k) are Hₒ, ``both`` (k, k + n_in, n_freq)
    G and Hᵢ side by side.
    """

    motions: NDArray[np.float64]
    inverse: NDArray[np.float64]
    scale: NDArray[np.float64]
    outputs: NDArray[np.complex128]
    both: NDArray[np.complex128]

    def holds(self, X: NDArray[np.float64]) -> bool:
        """Whether a matrix acts on these motions alone."""
        P, size = self.motions @ self.inverse, np.outer(self.scale, self.scale)
        return bool(np.abs((P @ X @ P.T - X) / size).max() <= 1e-12 * np.abs(X / size).max())


def _solve_lines(A: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Solve A[:, :n] w = A[:, n:] at each line; A (n, n + m, n_freq) gives w (n, m, n_freq).

    Gauss's elimination on all lines at once, for matrices that differ from the identity by an effect. Without
    exchange of rows a pivot is small only where the structure with a part of the effect resonates; such
    lines are solved again one by one.
    """
    n, X = len(A), A.copy()
    weak = np.zeros(A.shape[2], dtype=bool)
    with np.errstate(divide="ignore", invalid="ignore"):
        for j in range(n):
            pivot = X[j, j].copy()
            weak |= ~(np.abs(pivot) > 1e-4 * np.abs(X[j:, j]).max(axis=0))
            X[j, j:] /= pivot
            X[j + 1 :, j + 1 :] -= X[j + 1 :, j, None] * X[None, j, j + 1 :]
        for j in range(n - 2, -1, -1):
            X[j, n:] -= (X[j, j + 1 : n, None] * X[j + 1 :, n:]).sum(axis=0)
    w = X[:, n:]
    if weak.any():
        some = np.moveaxis(A[:, :, weak], 2, 0)
        w[:, :, weak] = np.moveaxis(np.linalg.solve(some[:, :, :n], some[:, :, n:]), 0, 2)
    return w


def _motions(
    matrices: list[NDArray[np.float64]],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return S (m, k) and S⁺ (k, m) for symmetric matrices: a basis of all their ranges, and its inverse.

    Rows are scaled by the diagonals, so that soft directions count beside stiff ones, and rotations beside
    displacements; the scales (m,) are the third result.
    """
    diagonal = sum(np.abs(X.diagonal()) / np.abs(X.diagonal()).max() for X in matrices)
    scale = np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    scaled = [X / np.outer(scale, scale) for X in matrices]
    U, s, _ = np.linalg.svd(np.hstack([X / np.abs(X).max() for X in scaled]))
    U = U[:, s > 1e-12 * s[0]]
    return scale[:, None] * U, U.T / scale, scale


@dataclass(frozen=True, slots=True, eq=False)
class _State:
    """A solved eigenproblem and the damping at each line: applies Z(ω)⁻¹ in modal coordinates."""

    lam: NDArray[np.float64]
    V: NDArray[np.float64]
    stiffness: NDArray[np.complex128]
    mass: NDArray[np.complex128]
    inverse: NDArray[np.complex128]
    U: NDArray[np.float64] | None
    correct: NDArray[np.complex128] | None

    @classmethod
    def of(
        cls,
        reduced: ReducedModel,
        total: dict[str, Any],
        omega: NDArray[np.float64],
        zeta: NDArray[np.float64],
    ) -> "_State":
        damping = reduced.model.damping
        lam, V = sla.eigh(total["K"], total["M"], check_finite=False)
        n_rigid = reduced.basis.n_rigid
        near_zero = np.abs(lam[:n_rigid]) < 1e-6 * np.abs(lam[min(n_rigid, len(lam) - 1)])
        lam[:n_rigid] = np.where(near_zero, 0.0, lam[:n_rigid])
        stiffness = 1 + 1j * (damping.loss_factor + 2 * zeta) + 1j * omega * damping.beta
        mass: NDArray[np.complex128] = (1j * omega * damping.alpha - omega**2).astype(complex)
        # Arrays over modes, columns and lines are kept in this order: a product from the left is then one
        # GEMM.
        inverse = (1 / (lam[:, None] * stiffness + mass))[:, None, :]
        laws = total["laws"]
        U = _range([total["C"], total["D"], *(X for _, X in laws)])
        if U is None:
            return cls(lam, V, stiffness, mass, inverse, None, None)
        C, D = U.T @ total["C"] @ U, U.T @ total["D"] @ U
        Um = V.T @ U
        S = 1j * (omega[:, None, None] * C + D)
        for factor, X in laws:
            S = S + factor[:, None, None] * (U.T @ X @ U)
        G = np.moveaxis(_times(Um.T, Um[:, :, None] * inverse), 2, 0)
        correct: Any = np.linalg.solve(np.eye(U.shape[1]) + S @ G, S)
        return cls(lam, V, stiffness, mass, inverse, Um, correct)

    def solve(self, B: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return Z⁻¹ B in modal coordinates, (r, n, n_freq), for forces B (r, n) on the reduced coordinates.

        Local damping enters by Woodbury's identity, line by line.
        """
        X = (self.V.T @ B)[:, :, None] * self.inverse
        if self.U is None or self.correct is None:
            return X
        z = self.correct @ np.moveaxis(_times(self.U.T, X), 2, 0)
        return X - self.inverse * _times(self.U, np.moveaxis(z, 0, 2))


def _times(A: NDArray[np.float64], X: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Multiply a real matrix (m, r) with a complex array (r, n, n_freq) over r, by one real product."""
    flat = np.ascontiguousarray(X).reshape(len(X), -1).view(float)
    return (A @ flat).view(complex).reshape(len(A), *X.shape[1:])


def _range(matrices: list[NDArray[np.float64]]) -> NDArray[np.float64] | None:
    """Return an orthonormal basis of what local damping and laws act on, None without any."""
    sizes = [float(np.abs(X).max()) for X in matrices]
    if max(sizes) == 0:
        return None
    # All dissipate, so that the range of the sum is that of all; not of squares, which lose a soft damper
    # beside a stiff one.
    both = sum(X / s for X, s in zip(matrices, sizes, strict=True) if s > 0)
    eigenvalues, vectors = sla.eigh(both, check_finite=False)
    return vectors[:, np.abs(eigenvalues) > 1e-13 * np.abs(eigenvalues).max()]


def values_of(
    model: Model, refs: Sequence[ParameterRef], candidates: Sequence[Effect] = ()
) -> NDArray[np.float64]:
    """Return the present values of parameters of a model's effects or of candidates."""
    effects: Mapping[str, Effect] = {e.name: e for e in (*model.effects, *candidates)}
    return np.array([{p.name: p.value for p in effects[n].parameters()}[q] for n, q in refs], dtype=float)
