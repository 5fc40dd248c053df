"""The fast engine: FRFs of a reduced model and their exact derivatives.

It is made for many parameter values and candidate effects. A model is projected once. After that nothing
depends on the size of the mesh: a set of parameter values costs one small symmetric eigenproblem, and a
candidate effect what its own few DOFs cost.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import lru_cache, partial
from typing import Any

import numpy as np
import scipy.linalg as sla
from numpy.typing import NDArray

from fem.analysis.basis import Basis, reduced_basis, without_modes
from fem.analysis.modes import solve_eigenpairs
from fem.model import Contribution, Effect, Model, Parameter, ParameterRef, parameter_values
from fem.system import System, assemble, sum_contributions

LOCAL_LIMIT, LOCAL_SHARE = 60, 0.25
"""Contributions that touch at most this many DOFs, or as many as this share of the basis's vectors, are kept
in factored form; forces for a basis are taken from the former."""

RESIDUAL_LIMIT = 20_000
"""Models with at most this many DOFs get the residual flexibility at the places of candidates."""

_ELEMENT = 12
"""DOFs of one element."""

_MANY = 12
"""Of more motions than this at a place, those are kept that forces at inputs and outputs bring about."""

_ALIKE = 256
"""On bases of at most so many vectors, what pairs of DOFs of elements with one matrix make of it is kept."""

_ENERGY = 1e-9
"""Motions with less than this share of the strongest one's energy are left out."""

_PLACES = 16
"""Places whose responses are kept for further changes."""

_UNITS = 64
"""Effects whose matrices for a unit of their parameter are kept."""

_FEW = 8
"""Where local damping acts on this many times more motions than are asked for, these alone are solved for."""

_STEP = 1e-200
"""Complex step; derivatives are exact to rounding."""


@dataclass(frozen=True, slots=True, eq=False)
class _Term:
    """Matrices on the reduced coordinates, X = Lᵀ x L for X in K, M, C, D.

    L is the identity where it is None. Each of ``laws`` is a factor as a function of ω and a matrix that it
    multiplies: what an element that depends on frequency adds to its static stiffness, which is in K.
    ``dofs`` are those that the rows of L stand for. K is damped as connections are if ``connection``.
    ``stiffer`` is by what factor the member there is stiffer than nominal.
    """

    L: NDArray[np.float64] | None
    K: NDArray[Any] | None
    M: NDArray[Any] | None
    C: NDArray[Any] | None
    D: NDArray[Any] | None
    laws: tuple[tuple[Callable[[NDArray[np.float64]], NDArray[Any]], NDArray[Any]], ...] = ()
    dofs: NDArray[np.int64] | None = None
    connection: bool = False
    stiffer: float = 1.0

    @property
    def place(self) -> tuple[bytes, float]:
        """What terms at the same place share, that are in factored form."""
        return (b"" if self.L is None else self.L.tobytes()), self.stiffer

    def times(self, factor: float) -> "_Term":
        """Return all matrices multiplied by a factor."""
        K, M, C, D = (None if X is None else factor * X for X in (self.K, self.M, self.C, self.D))
        return replace(self, K=K, M=M, C=C, D=D, laws=tuple((f, factor * X) for f, X in self.laws))

    def scaled(self, factors: Mapping[str, float]) -> "_Term":
        """Return K, M, C and D each multiplied by a factor of its own, laws as they are."""
        parts = {key: None if (X := getattr(self, key)) is None else f * X for key, f in factors.items()}
        return replace(self, **parts)

    def plus(self, other: "_Term", factor: float) -> "_Term":
        """Return the sum with a multiple of a term on the same coordinates, both without laws."""

        def total(key: str) -> NDArray[Any] | None:
            X, Y = getattr(self, key), getattr(other, key)
            return X if Y is None else factor * Y if X is None else X + factor * Y

        return replace(self, **{key: total(key) for key in "KMCD"})

    def damps(self, connections: bool) -> bool:
        """Whether it adds local damping, or to connections where these are damped otherwise than members."""
        damped = self.C is not None or self.D is not None or bool(self.laws)
        return damped or (connections and self.connection)

    def dense(self, key: str) -> Any:
        X = getattr(self, key)
        return 0.0 if X is None else self.spread(X)

    def spread(self, X: NDArray[Any]) -> NDArray[Any]:
        return X if self.L is None else self.L.T @ X @ self.L

    def parts(
        self, factors: dict[str, NDArray[Any]], omega: NDArray[np.float64]
    ) -> list[tuple[NDArray[Any], NDArray[Any]]]:
        """Return all that is not zero as pairs of a factor at each line and a matrix."""
        stiffness = factors["connections" if self.connection else "K"]
        known = ((stiffness, self.K), *((factors[key], getattr(self, key)) for key in "MCD"))
        present = [(factor, X) for factor, X in known if X is not None and X.any()]
        return present + [(f(omega), X) for f, X in self.laws if X.any()]


_Forces = dict[int, NDArray[np.complex128]]
"""Forces (m, n_in, n_freq) of parameters, by their rows."""


def _beside(forces: _Forces) -> NDArray[np.complex128]:
    return np.concatenate(list(forces.values()), axis=1)


def _add_to(forces: _Forces, i: int, force: NDArray[np.complex128]) -> None:
    if i in forces:
        forces[i] += force
    else:
        forces[i] = force


def _combined(terms: Sequence[_Term], factors: NDArray[np.float64]) -> _Term:
    """Return the sum of terms on the same coordinates, each multiplied by a factor."""
    first, *others = terms
    out = first.times(float(factors[0]))
    for term, factor in zip(others, factors[1:], strict=True):
        out = out.plus(term, float(factor))
    return out


def _part(X: NDArray[Any] | None, imaginary: bool) -> NDArray[Any] | None:
    if X is None:
        return None
    return np.imag(X) / _STEP if imaginary else np.real(X)


def _static(c: Contribution, imaginary: bool) -> Contribution:
    """Return a contribution's static stiffness, M, C and D, or their derivatives by a complex step."""
    return Contribution(c.dofs, *(_part(X, imaginary) for X in (c.static, c.M, c.C, c.D)))


def _acting(c: Contribution) -> Contribution:
    """Return a contribution without the elements whose matrices do not change with a complex step."""
    matrices = [X for X in (c.K, c.M, c.C, c.D) if X is not None]
    if c.law is not None or not matrices:
        return c
    acts = np.any([np.imag(X).any(axis=(1, 2)) for X in matrices], axis=0)
    if acts.all() or not acts.any():
        return c
    return Contribution(c.dofs[acts], *(None if X is None else X[acts] for X in (c.K, c.M, c.C, c.D)))


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
    system : System
        The model's matrices.
    remembered : dict
        What others have computed from the two and keep with them.
    """

    model: Model
    basis: Basis
    system: System
    _cache: dict[Any, Any] = field(default_factory=lambda: {"base": {}, "linear": {}, "unit": {}}, repr=False)
    # What does not depend on the basis is shared with the models on others.
    _scalings: dict[Any, Any] = field(default_factory=dict, repr=False)
    _sparse: dict[Any, Any] = field(default_factory=dict, repr=False)
    remembered: dict[Any, Any] = field(default_factory=dict, repr=False)

    def with_forces_of(self, effects: Sequence[Effect]) -> "ReducedModel":
        """Return the model with the responses to an effect's forces in its basis, where it touches few DOFs.

        Modes and the responses to other forces are smooth where a crack bends or a short piece is stiffer.
        """
        columns = []
        for effect in effects:
            term = self.value_of(effect)
            matrices = [X for key in "KMCD" if (X := getattr(term, key)) is not None and X.any()]
            matrices += [X for _, X in term.laws if X.any()]
            if term.dofs is None or len(term.dofs) > LOCAL_LIMIT or not matrices:
                continue
            motions, _, _ = _motions(matrices)
            block = np.zeros((self.model.n_dof, motions.shape[1]))
            block[term.dofs] = motions
            columns.append(block)
        if not columns:
            return self
        return self._on(self.basis.extended(self.system, np.hstack(columns)))

    def _on(self, basis: Basis) -> "ReducedModel":
        if basis is self.basis:
            return self
        out = ReducedModel(self.model, basis, self.system, _scalings=self._scalings, _sparse=self._sparse)
        for key in ("base", "linear"):
            known = {at: out._grown(term, self.basis, *at) for at, term in self._cache[key].items()}
            out._cache[key] = {at: term for at, term in known.items() if term is not None}
        return out

    def _grown(self, term: _Term, before: Basis, name: str, parameter: str) -> _Term | None:
        """Return the term of an effect of the model, or its slope, from that on the basis which was extended.

        Only what the new vectors add is projected. None for one with laws that act on many DOFs, which is
        projected again where it is needed.
        """
        if term.L is not None:
            return replace(term, L=self.basis.T[term.dofs])
        if term.laws:
            return None
        if (name, parameter) not in self._sparse:
            effect = self.model.effect(name)
            step = {p.name: p.value + 1j * _STEP for p in effect.parameters() if p.name == parameter}
            static = [_static(c, bool(step)) for c in effect.with_values(**step).contribute(self.model)]
            self._sparse[name, parameter] = sum_contributions(tuple(static), self.model.n_dof)
        T, old, new = self.basis.T, before.n_main, self.basis.n_main
        fresh, kept = T[:, old:new], np.concatenate([np.arange(old), np.arange(new, T.shape[1])])

        def larger(X: NDArray[Any] | None, full: Any) -> NDArray[Any] | None:
            if X is None:
                return None
            out = np.empty((T.shape[1],) * 2)
            out[np.ix_(kept, kept)] = X
            out[:, old:new] = T.T @ (full @ fresh)
            out[old:new] = (full.T @ fresh).T @ T
            return out

        K, M, C, D = map(larger, (term.K, term.M, term.C, term.D), self._sparse[name, parameter])
        return replace(term, K=K, M=M, C=C, D=D)

    def with_modes_of(self, model: Model, max_frequency: float) -> "ReducedModel":
        """Return the model with the modes of another one in its basis: with effects and values as found.

        Modes of the model without an effect that acts on a whole member converge slowly to those with it.

        Parameters
        ----------
        model : Model
            On the same mesh, without internal coordinates of its own.
        max_frequency : float
            Modes are taken up to there [Hz].
        """
        system = assemble(model, reciprocal=False)
        pairs = solve_eigenpairs(system, max_frequency=max_frequency, unstable=True)
        shapes = np.asarray(system.Q @ pairs.vectors)
        return self._on(self.basis.with_shapes(self.system, shapes))

    def residual_flexibility(
        self, dofs: NDArray[np.int64], motions: NDArray[np.float64]
    ) -> NDArray[np.float64] | None:
        """Return the static flexibility that the basis lacks to motions (m, k) of some DOFs, (k, k).

        R = Sᵀ [Q (K - σM)⁻¹ Qᵀ - T (Tᵀ(K - σM)T)⁻¹ Tᵀ] S with the basis's own shift, S the motions. None for
        models with more than ``RESIDUAL_LIMIT`` DOFs, for which it would cost too much.
        """
        if self.model.n_dof > RESIDUAL_LIMIT:
            return None
        b, few = self.basis, len(dofs) <= _ELEMENT
        # All of an element's is solved for at once: it serves every effect there.
        key = ("flexibility", dofs.tobytes(), b"" if few else motions.tobytes())
        if key not in self._sparse:
            forces = np.asarray(self.system.Q.T.tocsc()[:, dofs] @ (np.eye(len(dofs)) if few else motions))
            forces = without_modes(self.system, b.V[:, : b.n_modes], forces)
            self._sparse[key] = forces.T @ b.factor.solve(forces)
        others = slice(b.n_modes, b.n_main)  # what the modes do is not lacking, and may be far more
        if "static" not in self._cache:
            total = self.base_sum()
            self._cache["static"] = np.linalg.inv((total["K"] - b.shift * total["M"])[others, others])
        T = motions.T @ b.T[dofs, others]
        full = motions.T @ self._sparse[key] @ motions if few else self._sparse[key]
        return full - T @ self._cache["static"] @ T.T

    def project(self, contributions: Sequence[Contribution], imaginary: bool = False) -> _Term:
        """Project contributions; ``imaginary`` takes the complex-step derivative instead of the value."""
        if (alike := self._alike(contributions, imaginary)) is not None:
            return alike
        if imaginary:  # where a stretch ends matters at its ends alone
            contributions = [_acting(c) for c in contributions]
        dofs = np.unique(
            np.concatenate([np.zeros(0, dtype=np.int64), *(c.dofs.ravel() for c in contributions)])
        )
        T = self.basis.T
        if len(dofs) > max(LOCAL_LIMIT, LOCAL_SHARE * T.shape[1]):
            n, T = len(dofs), T[dofs]
            own = [replace(c, dofs=np.searchsorted(dofs, c.dofs)) for c in contributions]
            full = sum_contributions(tuple(_static(c, imaginary) for c in own), n)
            laws = [
                (factor, sum_contributions((Contribution(c.dofs, X),), n)[0])
                for c in own
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

        static = [_static(c, imaginary) for c in contributions]
        K, M, C, D = (summed([(c, getattr(c, key)) for c in static]) for key in "KMCD")
        laws = [
            (factor, summed([(c, X)]))
            for c in contributions
            if c.law is not None
            for factor, X in _law_parts(c, imaginary)
        ]
        laws = tuple((f, X) for f, X in laws if X is not None)
        return _Term(T[dofs], K, M, C, D, laws, dofs)

    def _alike(self, contributions: Sequence[Contribution], imaginary: bool) -> _Term | None:
        """Project elements that have one symmetric matrix, Σ x_ij Σ_e T_eiᵀ T_ej; None for others.

        The inner sums are computed once for all matrices: one costs the same on any mesh. It is less than by
        way of the elements where there are as many of them as vectors.
        """
        if len(contributions) != 1 or not len(contributions[0].dofs) >= self.basis.T.shape[1] <= _ALIKE:
            return None
        (c,) = contributions
        matrices = [X for X in (c.K, c.M, c.C, c.D) if X is not None]
        if c.law is not None or not all(X.strides[0] == 0 and (X[0] == X[0].T).all() for X in matrices):
            return None
        m = c.dofs.shape[1]
        pairs, (first, second) = _pairs(self.basis, c.dofs.tobytes(), m), np.triu_indices(m)

        def total(X: NDArray[Any] | None) -> NDArray[Any] | None:
            part: Any = None if X is None else _part(X[0], imaginary)
            return None if part is None else np.tensordot(part[first, second], pairs, axes=1)

        K, M, C, D = map(total, (c.K, c.M, c.C, c.D))
        return _Term(None, K, M, C, D)

    def value_of(self, effect: Effect, model: Model | None = None) -> _Term:
        """Project an effect at its present values, on the nominal model or on one with other values."""
        unit = None if model else self._unit(effect)
        return unit[0].times(unit[1]) if unit else self._of(effect, effect.contribute(model or self.model))

    def _unit(self, effect: Effect) -> tuple[_Term, float] | None:
        """Return the slope of an effect by a parameter that but multiplies it, and that parameter's value.

        It is computed once for all values of that parameter, and kept for the last ``_UNITS`` of all others.
        None if there is no such parameter.
        """
        p, *rest = effect.parameters() or (None,)
        if p is None or not p.linear or p.absent != 0 or any(q.linear for q in rest):
            return None
        key = (type(effect), *(getattr(effect, f.name) for f in fields(effect) if f.name != p.name))
        units = self._cache["unit"]
        try:
            known = units.get(key)
        except TypeError:  # an array among its fields
            return None
        if known is None:
            while len(units) >= _UNITS:
                units.pop(next(iter(units)))
            known = units[key] = self._slope_of(effect, p.name, p.value, self.model)
        return None if known.laws else (known, p.value)

    def derivative_of(
        self, effect: Effect, parameter: str, value: float, model: Model | None = None
    ) -> _Term:
        """Project an effect's derivative with respect to a parameter of its own, by a complex step."""
        unit = None if model or effect.parameters()[0].name != parameter else self._unit(effect)
        return unit[0] if unit else self._slope_of(effect, parameter, value, model or self.model)

    def _slope_of(self, effect: Effect, parameter: str, value: float, model: Model) -> _Term:
        step = {parameter: value + 1j * _STEP}
        return self._of(effect, effect.with_values(**step).contribute(model), True)

    def foreign_derivative_of(self, effect: Effect, ref: ParameterRef, value: float, model: Model) -> _Term:
        """Project an effect's derivative with respect to a parameter of an effect that it refers to."""
        return self._of(effect, effect.contribute(model.with_values({ref: value + 1j * _STEP})), True)

    def scaling_of(self, effect: Effect, ref: ParameterRef) -> Mapping[str, int] | None:
        """Return which of an effect's matrices a parameter of another effect but multiplies (computed once).

        1 for those of K, M, C and D that are in proportion to it, as the stiffness of a change of a member is
        to E, and 0 for those that do not depend on it; None if one does otherwise.
        """
        key = (effect.name, ref)
        if key not in self._scalings:
            self._scalings[key] = _scaling(effect, self.model, ref)
        return self._scalings[key]

    def _of(self, effect: Effect, contributions: Sequence[Contribution], imaginary: bool = False) -> _Term:
        return replace(self.project(contributions, imaginary), connection=effect.connection)

    def base(self) -> dict[str, _Term]:
        """Return the projection of each effect of the model at nominal values (computed once)."""
        known = self._cache["base"]
        for e in self.model.effects:
            if (e.name, "") not in known:
                known[e.name, ""] = self.value_of(e)
        return {name: term for (name, _), term in known.items()}

    def base_sum(self) -> dict[str, NDArray[np.float64]]:
        """Return the sum of all effects' matrices at nominal values (computed once).

        ``connections`` is the part of K that belongs to connections.
        """
        if "sum" not in self._cache:
            zero, terms = np.zeros((self.basis.T.shape[1],) * 2), self.base().values()
            known = {key: sum((t.dense(key) for t in terms), zero) for key in "KMCD"}
            known["connections"] = sum((t.dense("K") for t in terms if t.connection), zero)
            self._cache["sum"] = known
        return self._cache["sum"]

    def main_modes(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return λ and shapes of the nominal model with all its constraints, on the basis (computed once)."""
        if "modes" not in self._cache:
            total, m = self.base_sum(), self.basis.n_main
            self._cache["modes"] = sla.eigh(total["K"][:m, :m], total["M"][:m, :m])
        return self._cache["modes"]

    def base_laws(self) -> list[tuple[Callable[[NDArray[np.float64]], NDArray[Any]], NDArray[np.float64]]]:
        """Return the factors and matrices of all effects that depend on frequency (computed once)."""
        if "laws" not in self._cache:
            self._cache["laws"] = [(f, t.spread(X)) for t in self.base().values() for f, X in t.laws]
        return self._cache["laws"]

    def linear(self, effect: Effect, parameter: str, value: float) -> _Term:
        """Return the derivative with respect to a linear parameter.

        It is computed once for effects of the model.
        """
        known, key = self._cache["linear"], (effect.name, parameter)
        if key not in known:
            known[key] = self.derivative_of(effect, parameter, value)
        return known[key]


@lru_cache(maxsize=8)
def _pairs(basis: Basis, dofs: bytes, n_dofs: int) -> NDArray[np.float64]:
    """Return Σ_e T_eiᵀ T_ej, and its transpose with it where i ≠ j, for each pair i ≤ j of elements' DOFs.

    Shape (n_dofs (n_dofs + 1)/2, r + p, r + p).
    """
    T, rows = basis.T, np.frombuffer(dofs, dtype=np.int64).reshape(-1, n_dofs)
    each = [np.ascontiguousarray(T[rows[:, i]]) for i in range(n_dofs)]
    out = np.empty((n_dofs * (n_dofs + 1) // 2, *2 * T.shape[1:]))
    for n, (i, j) in enumerate(zip(*np.triu_indices(n_dofs), strict=True)):
        out[n] = each[i].T @ each[j]
        if i != j:
            out[n] += out[n].T.copy()
    return out


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
    system = assemble(model, reciprocal=False)
    release = tuple(c for c in model.constraints() if c.releasable) if releasable else ()
    basis = reduced_basis(system, forces, max_frequency, margin=margin, n_krylov=n_krylov, release=release)
    return ReducedModel(model, basis, system)


@dataclass(frozen=True, slots=True, eq=False)
class _Scaled:
    """An effect whose matrices parameters of other effects but multiply.

    ``own`` are the rows of its own parameters and their values in ``start``, the term there. That and the
    ``slopes`` by these are None if it is not linear in them. ``foreign`` are the rows of the others, their
    nominal values and which of K, M, C and D go in proportion (see :meth:`ReducedModel.scaling_of`).
    """

    effect: Effect
    own: tuple[tuple[int, float], ...]
    foreign: tuple[tuple[int, float, Mapping[str, int]], ...]
    start: _Term | None
    slopes: list[_Term] | None

    @property
    def rows(self) -> tuple[int, ...]:
        """Rows of its own parameters."""
        return tuple(i for i, _ in self.own)

    def factors(self, values: NDArray[np.float64]) -> dict[str, float]:
        """Return what K, M, C and D are multiplied by."""
        return scale_factors(
            (float(values[i]) / nominal, exponents) for i, nominal, exponents in self.foreign
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
    projected : bool
        Whether outputs and inputs are combinations of the basis's columns already, (r + p, n).
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
        *,
        projected: bool = False,
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
        ends = (outputs, inputs) if projected else (basis.T.T @ outputs, basis.T.T @ inputs)
        self._out, self._in = (X[self._active] for X in ends)
        self._ends_out = ends[0]

        effects = {e.name: e for e in (*reduced.model.effects, *candidates)}
        wanted: dict[str, list[int]] = {}
        for i, (name, _) in enumerate(self.refs):
            wanted.setdefault(name, []).append(i)
        candidate_names = {e.name for e in candidates}
        ix = np.ix_(self._active, self._active)
        self._fixed: dict[str, Any] = {key: X[ix].copy() for key, X in reduced.base_sum().items()}
        self._fixed["laws"] = [(f(self.omega), X[ix]) for f, X in reduced.base_laws()]
        self._linear: list[tuple[int, float, _Term]] = []
        self._scaled: list[_Scaled] = []
        self._nonlinear: list[tuple[Effect, list[int], list[int]]] = []
        for name, effect in effects.items():
            rows = wanted.get(name, [])
            known = {p.name: p for p in effect.parameters()}
            free = [known[self.refs[i][1]] for i in rows]
            known_refs = effect.refers_to(reduced.model)
            foreign = [i for i, ref in enumerate(self.refs) if ref in known_refs]
            linear = all(p.linear for p in free) and not foreign
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
                continue
            if name not in candidate_names:
                self._add_fixed(reduced.base()[name], -1.0)
            scaled = self._as_scaled(effect, rows, free, foreign)
            if scaled is None:
                self._nonlinear.append((effect, rows, foreign))
            else:
                self._scaled.append(scaled)
        self._together = self._linear_together()
        self._n = n
        self._damped: dict[bool, NDArray[np.float64]] = {}
        # A step that is tried without derivatives is often asked for them next.
        self._last: tuple[bytes, _State, NDArray[np.complex128], list[_Term]] | None = None

    def _linear_together(self) -> list[tuple[list[int], NDArray[np.float64], list[_Term]]]:
        """Return the rows, nominal values and slopes of linear parameters, those at one place together.

        What they add there is summed over few DOFs before it is spread over the basis.
        """
        groups: dict[Any, list[tuple[int, float, _Term]]] = {}
        for i, start, term in self._linear:
            alone = term.L is None or bool(term.laws)
            groups.setdefault(i if alone else (term.place, term.connection), []).append((i, start, term))
        together = (zip(*group, strict=True) for group in groups.values())
        return [(list(rows), np.array(starts), list(terms)) for rows, starts, terms in together]

    def _as_scaled(
        self, effect: Effect, rows: Sequence[int], free: Sequence[Parameter], foreign: Sequence[int]
    ) -> "_Scaled | None":
        """Return an effect whose matrices parameters of others but multiply; None if they do otherwise."""
        known, nominal = [], self.reduced.model.values()
        for i in foreign:
            exponents = self.reduced.scaling_of(effect, self.refs[i])
            if exponents is None:
                return None
            known.append((i, nominal[self.refs[i]], exponents))
        own = tuple((i, p.value) for i, p in zip(rows, free, strict=True))
        start = slopes = None
        if all(p.linear for p in free):
            start = self._restrict(self.reduced.value_of(effect))
            slopes = [self._restrict(self.reduced.derivative_of(effect, p.name, p.value)) for p in free]
            if not all(np.array_equal(start.dofs, s.dofs) for s in slopes):  # type: ignore[arg-type]
                start = slopes = None
        return _Scaled(effect, own, tuple(known), start, slopes)

    def _damped_range(self, zeta: NDArray[np.float64], now: Sequence[_Term]) -> NDArray[np.float64] | None:
        """Return an orthonormal basis (r, k) of what local damping and laws act on at any values.

        None where it depends on the values; ``now`` is what :meth:`_matrices` gave there.
        """
        own = zeta.ndim > 1
        moving = [t for s, t in zip(self._scaled, now, strict=False) if s.start is None]
        if any(t.damps(own) for t in (*moving, *now[len(self._scaled) :])):
            return None
        if own in self._damped:
            return self._damped[own]
        terms = [term for _, _, term in self._linear]
        terms += [term for s in self._scaled for term in (s.start, *(s.slopes or ())) if term is not None]
        damping = [self._fixed["C"], self._fixed["D"], *(X for _, X in self._fixed["laws"])]
        damping += [t.dense(key) for t in terms for key in "CD" if getattr(t, key) is not None]
        damping += [t.spread(X) for t in terms for _, X in t.laws]
        if own:
            stiff = [t.dense("K") for t in terms if t.connection and t.K is not None]
            damping += [self._fixed["connections"], *stiff]
        U = _range(damping)
        self._damped[own] = np.zeros((self._n, 0)) if U is None else U
        return self._damped[own]

    def _restrict(self, term: _Term) -> _Term:
        if term.L is not None:
            return replace(term, L=term.L[:, self._active])
        ix = np.ix_(self._active, self._active)
        K, M, C, D = (None if X is None else X[ix] for X in (term.K, term.M, term.C, term.D))
        laws = tuple((f, X[ix]) for f, X in term.laws)
        return replace(term, K=K, M=M, C=C, D=D, laws=laws)

    def _add_fixed(self, term: _Term, factor: float) -> None:
        term = self._restrict(term)
        self._add(self._fixed, term, factor)

    def _add(self, total: dict[str, Any], term: _Term, factor: float) -> None:
        for key in "KMCD":
            X = getattr(term, key)
            if X is None or not X.any():
                continue
            more = factor * term.spread(X)
            total[key] = total[key] + more
            if key == "K" and term.connection:
                total["connections"] = total["connections"] + more
        total["laws"] = total["laws"] + [(factor * f(self.omega), term.spread(X)) for f, X in term.laws]

    def _following(
        self, values: NDArray[np.float64]
    ) -> tuple[Model, list[tuple[Effect, list[int], list[int]]]]:
        """Return the model with what the effects of ``_nonlinear`` refer to, and these as they are now."""
        foreign = {i for _, _, others in self._nonlinear for i in others}
        model = self.reduced.model
        if foreign:
            model = model.with_values({self.refs[i]: float(values[i]) for i in foreign})
        return model, [(self._now(e, rows, values), rows, others) for e, rows, others in self._nonlinear]

    def _matrices(self, values: NDArray[np.float64]) -> tuple[dict[str, Any], list[_Term]]:
        """Return the sums of all matrices; and the terms of ``_scaled``, not scaled, and ``_nonlinear``."""
        total, alone = dict(self._fixed), []
        for rows, starts, terms in self._together:
            self._add(total, _combined(terms, values[rows] - starts), 1.0)
        for scaled in self._scaled:
            term = scaled.start
            if term is None:
                term = self._restrict(self.reduced.value_of(self._now(scaled.effect, scaled.rows, values)))
            for (i, begin), slope in zip(scaled.own, scaled.slopes or (), strict=False):
                term = term.plus(slope, values[i] - begin)
            self._add(total, term.scaled(scaled.factors(values)), 1.0)
            alone.append(term)
        model, following = self._following(values)
        for now, _, _ in following:
            alone.append(self._restrict(self.reduced.value_of(now, model)))
            self._add(total, alone[-1], 1.0)
        return total, alone

    def _state(
        self, values: NDArray[np.float64], zeta: NDArray[np.float64], errors: "ModeErrors | None" = None
    ) -> tuple["_State", dict[str, Any], list[_Term]]:
        """Return the state at some values, and what :meth:`_matrices` gives there."""
        total, alone = self._matrices(values)
        damped = self._damped_range(zeta, alone)
        return _State.of(self.reduced, total, self.omega, zeta, damped, errors), total, alone

    def _slopes(self, values: NDArray[np.float64], alone: Sequence[_Term]) -> list[tuple[int, _Term]]:
        """Return the derivatives of the matrices; ``alone`` is what :meth:`_matrices` gave there."""
        slopes = [(i, term) for i, _, term in self._linear]
        for scaled, term in zip(self._scaled, alone, strict=False):
            factors, now = scaled.factors(values), self._now(scaled.effect, scaled.rows, values)
            for k, i in enumerate(scaled.rows):
                slope = scaled.slopes[k] if scaled.slopes is not None else self._restrict(
                    self.reduced.derivative_of(now, self.refs[i][1], float(values[i]))
                )  # fmt: skip
                slopes.append((i, slope.scaled(factors)))
            for i, _, exponents in scaled.foreign:
                by = {key: n * factors[key] / float(values[i]) for key, n in exponents.items()}
                slopes.append((i, term.scaled(by)))
        model, following = self._following(values)
        for now, rows, others in following:
            for i in rows:
                term = self.reduced.derivative_of(now, self.refs[i][1], float(values[i]), model)
                slopes.append((i, self._restrict(term)))
            for i in others:
                term = self.reduced.foreign_derivative_of(now, self.refs[i], float(values[i]), model)
                slopes.append((i, self._restrict(term)))
        return slopes

    def _now(self, effect: Effect, rows: Sequence[int], values: NDArray[np.float64]) -> Effect:
        return effect.with_values(**{self.refs[i][1]: float(values[i]) for i in rows})

    def evaluate(
        self, values: NDArray[np.float64], zeta: NDArray[np.float64], gradient: bool = True
    ) -> tuple[NDArray[np.complex128], NDArray[np.complex128] | None, NDArray[np.complex128] | None]:
        """Compute receptances and derivatives.

        Z = K (1 + i (η + 2ζ(ω)) + iωβ) + iD + iωC + iωα M - ω²M, with the model's η, α, β; dH = -Hₒ dZ Hᵢ.
        The stiffness of connections, a part of K, may have a ζ of its own.

        Parameters
        ----------
        values : ndarray (n_par,)
            Values of the parameters ``refs``.
        zeta : ndarray (n_freq,) or (2, n_freq)
            Damping ratio at each line, and that of connections if it is another [-].
        gradient : bool
            Whether derivatives are wanted.

        Returns
        -------
        H : ndarray (n_freq, n_out, n_in)
        dH : ndarray (n_par, n_freq, n_out, n_in) or None
        dH_dzeta : ndarray (n_freq, n_out, n_in) or (2, n_freq, n_out, n_in) or None
            With respect to the damping ratio at that line.
        """
        values = np.asarray(values, dtype=float)
        at = values.tobytes() + zeta.tobytes()
        if self._last is None or self._last[0] != at:
            state, _, alone = self._state(values, zeta)
            self._last = (at, state, state.solve(self._in), alone)
        _, state, Xi, alone = self._last
        H = np.moveaxis(_times((state.V.T @ self._out).T, Xi), 2, 0)
        if not gradient:
            return H, None, None
        return H, *self._derivatives(values, zeta, state, Xi, alone, state.lam)

    def _derivatives(
        self,
        values: NDArray[np.float64],
        zeta: NDArray[np.float64],
        state: "_State",
        Xi: NDArray[np.complex128],
        alone: Sequence[_Term],
        damped: NDArray[np.float64],
    ) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """Return dH by the parameters and by ζ; ``damped`` (r,) is dZ/d(2iζ) of each mode."""
        n_par, connections = len(self.refs), zeta.ndim > 1
        whole, places = self._slope_forces(self._slopes(values, alone), state, Xi)
        whole[n_par] = 2j * damped[:, None, None] * Xi
        if connections and state.U is not None and state.own is not None:
            whole[n_par + 1] = 2j * _times(state.U @ state.own, _times(state.U.T, Xi))
        moved, Ho = state.read(self._out, _beside(whole), [P for P, _ in places])
        shape = (len(self.omega), self._out.shape[1], Xi.shape[1])
        slopes = np.zeros((n_par + (2 if connections else 1), *shape), dtype=complex)
        for i, product in zip(whole, np.split(moved, len(whole), axis=2), strict=True):
            slopes[i] -= product
        for (_, forces), h in zip(places, Ho, strict=True):
            products = h @ _lines_first(_beside(forces))
            for i, product in zip(forces, np.split(products, len(forces), axis=2), strict=True):
                slopes[i] -= product
        dH, by_zeta = slopes[:n_par], slopes[n_par:]
        if not connections:
            return dH, by_zeta[0]
        by_zeta[0] -= by_zeta[1]  # all but the connections are damped as members
        return dH, by_zeta

    def _factors(self, state: "_State") -> dict[str, NDArray[Any]]:
        """Return what K, M, C and D are multiplied by in Z, each (n_freq,)."""
        omega = self.omega
        return {
            "K": state.stiffness, "connections": state.connections, "M": state.mass, "C": 1j * omega,
            "D": np.full(len(omega), 1j),
        }  # fmt: skip

    def _slope_forces(
        self, slopes: Sequence[tuple[int, _Term]], state: "_State", Xi: NDArray[np.complex128]
    ) -> tuple[_Forces, list[tuple[NDArray[np.float64], _Forces]]]:
        """Return dZ Hᵢ of the parameters: of those that act everywhere, in modal coordinates, and at places.

        With each place stand the motions along which its forces act, (r, m), in modal coordinates. Where
        a place has few forces and many motions it costs less to take them as forces that act everywhere.
        """
        factors, n_out, n_in = self._factors(state), self._out.shape[1], Xi.shape[1]
        whole: _Forces = {}
        groups: dict[bytes, list[tuple[int, _Term]]] = {}
        places = []
        for i, term in slopes:
            if term.L is not None:
                groups.setdefault(term.L.tobytes(), []).append((i, term))
                continue
            for factor, X in term.parts(factors, self.omega):
                _add_to(whole, i, factor * _times(state.V.T @ X @ state.V, Xi))
        for group in groups.values():
            L: Any = group[0][1].L
            P, forces = (L @ state.V).T, {}
            ui = _times(P.T, Xi)
            for i, term in group:
                for factor, X in term.parts(factors, self.omega):
                    _add_to(forces, i, factor * _times(X, ui))
            n, m, damped = n_in * len(forces), P.shape[1], 0 if state.U is None else state.U.shape[1]
            if (n_out + damped) * m < n * (n_out + damped + m):
                places.append((P, forces))
                continue
            for i, force in forces.items():
                _add_to(whole, i, _times(P, force))
        return whole, places

    def modal(
        self, values: NDArray[np.float64], zeta: NDArray[np.float64], errors: "ModeErrors"
    ) -> "ModalResponses":
        """Solve with errors of the modes: what each of them has in every receptance, and derivatives.

        Parameters
        ----------
        values : ndarray (n_par,)
            Values of the parameters ``refs``.
        zeta : ndarray (n_freq,) or (2, n_freq)
            Damping ratio at each line, and that of connections if it is another [-].
        errors : ModeErrors
        """
        values = np.asarray(values, dtype=float)
        state, _, alone = self._state(values, zeta, errors)
        Xi, Xo = state.solve(self._in), state.solve(self._out, transposed=True)
        return ModalResponses(self, values, zeta, state, alone, Xo, Xi, errors)

    def local(self, values: NDArray[np.float64], zeta: NDArray[np.float64]) -> "LocalChanges":
        """Solve once, so that many changes at few DOFs can be tried at little cost each.

        Parameters
        ----------
        values : ndarray (n_par,)
            Values of the parameters ``refs``.
        zeta : ndarray (n_freq,) or (2, n_freq)
            Damping ratio at each line, and that of connections if it is another [-].
        """
        state, total, terms = self._state(np.asarray(values, dtype=float), zeta)
        damped = self._damped_range(zeta, terms)
        Xo, Xi = state.solve(self._out, transposed=True), state.solve(self._in)
        H = np.moveaxis(_times((state.V.T @ self._out).T, Xi), 2, 0)
        return LocalChanges(self, state, Xo, Xi, H, total, zeta, damped)


@dataclass(frozen=True, slots=True, eq=False)
class ModeErrors:
    """What frame theory has wrong of single modes, as λ e^δ and 2ζ e^κ.

    Attributes
    ----------
    first : int
        How many modes come before the first of them, those of a rigid body.
    eigenvalue, damping : ndarray (n,)
        δ and κ of the modes from there on, in rising order of their frequencies [-].
    """

    first: int
    eigenvalue: NDArray[np.float64]
    damping: NDArray[np.float64]

    def factor(self, n: int) -> NDArray[np.float64]:
        """Return by what the eigenvalues of all n modes are multiplied."""
        return self._of_all(n, self.eigenvalue)

    def damping_factor(self, n: int) -> NDArray[np.float64]:
        """Return by what the damping ratios of all n modes are multiplied."""
        return self._of_all(n, self.damping)

    def _of_all(self, n: int, each: NDArray[np.float64]) -> NDArray[np.float64]:
        out = np.ones(n)
        out[self.first : self.first + len(each)] = np.exp(each[: n - self.first])
        return out


@dataclass(frozen=True, slots=True, eq=False)
class ModalResponses:
    """A solved state with errors of modes.

    Attributes
    ----------
    Xo, Xi : ndarray (r, n, n_freq)
        Responses to unit forces at outputs and inputs, in modal coordinates.
    """

    engine: ParametricFRF
    values: NDArray[np.float64]
    zeta: NDArray[np.float64]
    state: "_State"
    alone: list[_Term]
    Xo: NDArray[np.complex128]
    Xi: NDArray[np.complex128]
    errors: ModeErrors

    @property
    def shapes(self) -> NDArray[np.float64]:
        """Shapes of the modes at the outputs, (r, n_out)."""
        return self.state.V.T @ self.engine._out

    @property
    def H(self) -> NDArray[np.complex128]:
        """Receptances (n_freq, n_out, n_in)."""
        return np.moveaxis(_times(self.shapes.T, self.Xi), 2, 0)

    def parts(self) -> NDArray[np.complex128]:
        """Return the part of each mode with an error in the receptances, (n, n_freq, n_out, n_in)."""
        own = self._own
        return np.einsum("ro,rif->rfoi", self.shapes[own], self.Xi[own])

    def slopes(self) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """Return dH by the parameters, (n_par, …), and by ζ at each line, as :meth:`ParametricFRF.evaluate`.

        That the modes' shapes follow the parameters is left out of what the errors add: it is as small beside
        the derivative as the errors are beside 1.
        """
        damped = self.state.lam * self.errors.damping_factor(len(self.state.lam))
        return self.engine._derivatives(self.values, self.zeta, self.state, self.Xi, self.alone, damped)

    def error_slopes(self) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """Return dH by δ and by κ, each (n, n_freq, n_out, n_in)."""
        own, state = self._own, self.state
        lam, ratio = state.lam[own, None], np.atleast_2d(self.zeta)[0]
        factor = self.errors.damping_factor(len(state.lam))[own, None]
        loss = 2j * ratio * factor
        stiffness = state.stiffness - 2j * ratio + loss
        product = np.einsum("rof,rif->rfoi", self.Xo[own], self.Xi[own])
        by = [(-lam * X)[:, :, None, None] * product for X in (stiffness, loss)]
        return by[0], by[1]

    @property
    def _own(self) -> slice:
        first = self.errors.first
        return slice(first, first + len(self.errors.eigenvalue))


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
    total : dict
        Reduced matrices without the effects.
    zeta : ndarray (n_freq,) or (2, n_freq)
        Damping ratio at each line, and that of connections if it is another [-].
    damped : ndarray (r, k) or None
        What local damping acts on, if that is known beforehand.
    """

    engine: ParametricFRF
    state: "_State"
    Xo: NDArray[np.complex128]
    Xi: NDArray[np.complex128]
    H: NDArray[np.complex128]
    total: dict[str, Any]
    zeta: NDArray[np.float64]
    damped: NDArray[np.float64] | None
    _places: dict[Any, Any] = field(default_factory=dict, repr=False)

    def fields(self) -> "Fields":
        """Return the responses at all DOFs of the full model: slopes are had from them without projecting."""
        modes = self.engine.reduced.basis.T[:, self.engine._active] @ self.state.V
        factors = self.engine._factors(self.state)
        return Fields(_times(modes, self.Xo), _times(modes, self.Xi), self.engine.omega, factors)

    def violations(self) -> tuple[list[tuple[str, str]], NDArray[np.complex128]]:
        """Return the keys of the constraints that hold, and the outputs' responses to unit violations.

        Shape (n_constraints, n_out, n_freq): the response to the motion that a constraint prescribes, beside
        nominal stiffness and mass; only their ratio matters for its shape.
        """
        engine, basis = self.engine, self.engine.reduced.basis
        active = engine._active
        columns = [n for n in range(basis.n_main, basis.T.shape[1]) if n not in active]
        keys = [basis.keys[n - basis.n_main] for n in columns]
        total, factors = engine.reduced.base_sum(), engine._factors(self.state)
        moved = engine._ends_out[columns]
        out = np.broadcast_to(moved[:, :, None], (*moved.shape, len(engine.omega))).astype(complex)
        for key in "KM":
            rows = self.state.V.T @ total[key][active][:, columns]
            out = out - factors[key] * _times(rows.T, self.Xo)
        return keys, out

    def receptances(self, effects: Sequence[Effect]) -> list[NDArray[np.complex128]]:
        """Return the receptances with each of some effects added, one at a time.

        H' = H - Hₒ (I + ΔZ G)⁻¹ ΔZ Hᵢ, with G the receptance of the motions that the effect resists: six for
        a joint. For an effect that touches too many DOFs the eigenproblem is solved anew.
        """
        return self.with_terms([self.engine.reduced.value_of(effect) for effect in effects])

    def with_terms(self, terms: Sequence[_Term]) -> list[NDArray[np.complex128]]:
        """Return the same for effects that are projected already.

        Terms at the same place share Hₒ, Hᵢ and G, also in later calls, and are solved for together. A term
        that takes away more mass than there is has no receptances: they are NaN.
        """
        out = [self.H] * len(terms)
        factors = self.engine._factors(self.state)
        groups: dict[Any, list[tuple[int, list[tuple[NDArray[Any], NDArray[Any]]]]]] = {}
        rows: dict[Any, _Term] = {}
        for i, whole in enumerate(terms):
            term = self.engine._restrict(whole)
            parts = term.parts(factors, self.engine.omega)
            if not parts:
                continue
            if term.L is None:
                try:
                    out[i] = self._anew(term)
                except np.linalg.LinAlgError:  # the mass matrix is not positive definite
                    out[i] = np.full_like(self.H, np.nan)
                continue
            key = term.place
            rows[key] = term
            groups.setdefault(key, []).append((i, parts))
        for key, group in groups.items():
            place = self._place(rows[key], [X for _, parts in group for _, X in parts])
            # (I + ΔZ G) w = ΔZ Hᵢ, for all terms of the group as if they were more lines
            k, wide, n_freq = place.both.shape
            A = np.zeros((k, wide, len(group), n_freq), dtype=complex)
            for g, (_, parts) in enumerate(group):
                for factor, X in parts:
                    A[:, :, g] += factor * _times(place.inverse @ X @ place.inverse.T, place.both)
            A[np.arange(k), np.arange(k)] += 1
            w = _solve_lines(A.reshape(k, wide, -1)).reshape(k, wide - k, len(group), n_freq)
            n_in = wide - k
            w = np.ascontiguousarray(w.transpose(3, 0, 2, 1)).reshape(n_freq, k, -1)
            change = (place.outputs @ w).reshape(n_freq, -1, len(group), n_in)
            for g, (i, _) in enumerate(group):
                out[i] = self.H - change[:, :, g]
        return out

    def _anew(self, term: _Term) -> NDArray[np.complex128]:
        engine, total = self.engine, dict(self.total)
        engine._add(total, term, 1.0)
        damped = None if term.damps(self.zeta.ndim > 1) else self.damped
        state = _State.of(engine.reduced, total, engine.omega, self.zeta, damped)
        return np.moveaxis(_times((state.V.T @ engine._out).T, state.solve(engine._in)), 2, 0)

    def _place(self, term: _Term, matrices: list[NDArray[np.float64]]) -> "_Place":
        """Return the responses at the motions that a term's matrices act on (computed once).

        The flexibility of the structure that the basis lacks is added there.
        """
        L, dofs = term.L, term.dofs
        assert L is not None
        assert dofs is not None
        key = term.place
        known = self._places.get(key)
        if known is not None and all(known.holds(X) for X in matrices):
            return known
        if known is not None:
            matrices = [*matrices, known.motions @ known.motions.T]
        motions, inverse, scale = _motions(matrices)
        if motions.shape[1] > _MANY:
            motions, inverse = self._brought_about(L, motions, inverse, matrices)
        Lm = motions.T @ L @ self.state.V
        G = _times(Lm, self.state.solve((motions.T @ L).T))
        R = self.engine.reduced.residual_flexibility(dofs, motions)
        if R is not None:
            G = G + R[:, :, None] / (term.stiffer * self.state.stiffness)
        both = np.concatenate([G, _times(Lm, self.Xi)], axis=1)
        outputs = np.ascontiguousarray(_times(Lm, self.Xo).transpose(2, 1, 0))
        place = _Place(motions, inverse, scale, outputs, both)
        while len(self._places) >= _PLACES:
            self._places.pop(next(iter(self._places)))
        self._places[key] = place
        return place

    def _brought_about(
        self,
        L: NDArray[np.float64],
        motions: NDArray[np.float64],
        inverse: NDArray[np.float64],
        matrices: list[NDArray[np.float64]],
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return fewer motions: of a stretch of a beam its bending as a whole, not that of each element.

        With X the sum of the matrices, each scaled to 1, and U the responses at the place to the forces at
        inputs and outputs, X is replaced by X U (Uᵀ X U)⁻¹ Uᵀ X.
        """
        small = [inverse @ X @ inverse.T for X in matrices]
        values, vectors = np.linalg.eigh(sum(np.sign(np.trace(x)) * x / np.abs(x).max() for x in small))
        C = vectors * np.sqrt(np.maximum(np.abs(values), 1e-12 * np.abs(values).max()))
        LV = motions.T @ L @ self.state.V
        responses = np.concatenate([_times(LV, self.Xi), _times(LV, self.Xo)], axis=1)
        strain = C.T @ responses.reshape(len(LV), -1).view(float)
        energy, directions = np.linalg.eigh(strain @ strain.T)
        P = directions[:, energy > _ENERGY * energy[-1]]
        onto: Any = np.linalg.solve(C, inverse)
        return motions @ C @ P, P.T @ onto


@dataclass(frozen=True, slots=True, eq=False)
class Fields:
    """Responses at all DOFs to unit forces at outputs and inputs.

    Attributes
    ----------
    outputs, inputs : ndarray (n_dof, n_out, n_freq), (n_dof, n_in, n_freq)
    omega : ndarray (n_freq,)
        Angular frequencies [rad/s].
    factors : dict
        What K, that of connections, M, C and D are multiplied by in Z, each (n_freq,).
    """

    outputs: NDArray[np.complex128]
    inputs: NDArray[np.complex128]
    omega: NDArray[np.float64]
    factors: dict[str, NDArray[Any]]

    def slope(
        self, contributions: Sequence[Contribution], connection: bool = False
    ) -> NDArray[np.complex128]:
        """Return -Hₒ ΔZ Hᵢ of element matrices ΔZ, the change of the receptances for a little of them.

        Their stiffness is damped as that of a connection is, or as that of members.
        """
        keys = ("connections" if connection else "K", *"MCD")
        n_freq, n_out, n_in = len(self.omega), self.outputs.shape[1], self.inputs.shape[1]
        out = np.zeros((n_freq, n_out, n_in), dtype=np.complex128)
        for c in contributions:
            moved = self.inputs[c.dofs]
            b, m = c.dofs.shape
            matrices = zip(keys, (c.static, c.M, c.C, c.D), strict=True)
            parts: list[tuple[Any, Any]] = [(self.factors[key], X) for key, X in matrices]
            if c.law is not None:
                parts += _law_parts(c, imaginary=False)
            force = np.zeros_like(moved)
            for factor, X in parts:
                if X is None or not X.any():
                    continue
                value: Any = factor(self.omega) if callable(factor) else factor
                force += value * (X @ moved.reshape(b, m, -1)).reshape(moved.shape)
            left = self.outputs[c.dofs].reshape(b * m, n_out, n_freq).transpose(2, 1, 0)
            out -= left @ force.reshape(b * m, n_in, n_freq).transpose(2, 0, 1)
        return out


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
    diagonals = [np.abs(X.diagonal()) for X in matrices]
    diagonal = sum((d / d.max() for d in diagonals if d.any()), np.zeros(len(matrices[0])))
    # What is this small is rounding: a row whose scale it were would be nothing but that.
    scale = np.sqrt(np.where(diagonal > 1e-26, diagonal, 1.0))
    scaled = [X / np.outer(scale, scale) for X in matrices]
    U, s, _ = np.linalg.svd(np.hstack([X / np.abs(X).max() for X in scaled]), full_matrices=False)
    U = U[:, s > 1e-12 * s[0]]
    U = np.where(np.abs(U) > 1e-13, U, 0.0)
    return scale[:, None] * U, U.T / scale, scale


@dataclass(frozen=True, slots=True, eq=False)
class _State:
    """A solved eigenproblem and the damping at each line: applies Z(ω)⁻¹ in modal coordinates.

    ``resisting`` (n_freq, k, k) are S, the forces of local damping and laws against the motions ``U``, and
    ``yielding`` I + S G with G the response to such forces.
    """

    lam: NDArray[np.float64]
    V: NDArray[np.float64]
    stiffness: NDArray[np.complex128]
    connections: NDArray[np.complex128]
    mass: NDArray[np.complex128]
    inverse: NDArray[np.complex128]
    U: NDArray[np.float64] | None
    resisting: NDArray[np.complex128]
    yielding: NDArray[np.complex128]
    own: NDArray[np.float64] | None = None
    _made: dict[str, NDArray[Any]] = field(default_factory=dict, repr=False)

    @classmethod
    def of(
        cls,
        reduced: ReducedModel,
        total: dict[str, Any],
        omega: NDArray[np.float64],
        zeta: NDArray[np.float64],
        damped: NDArray[np.float64] | None,
        errors: "ModeErrors | None" = None,
    ) -> "_State":
        damping = reduced.model.damping
        zeta, *others = np.atleast_2d(zeta)
        lam, V = sla.eigh(total["K"], total["M"], check_finite=False)
        n_rigid = reduced.basis.n_rigid
        near_zero = np.abs(lam[:n_rigid]) < 1e-6 * np.abs(lam[min(n_rigid, len(lam) - 1)])
        lam[:n_rigid] = np.where(near_zero, 0.0, lam[:n_rigid])
        stiffness = 1 + 1j * (damping.loss_factor + 2 * zeta) + 1j * omega * damping.beta
        mass: NDArray[np.complex128] = (1j * omega * damping.alpha - omega**2).astype(complex)
        # Arrays over modes, columns and lines are kept in this order: a product from the left is then one
        # GEMM.
        if errors is None:
            inverse = (1 / (lam[:, None] * stiffness + mass))[:, None, :]
        else:
            lam = lam * errors.factor(len(lam))
            more = (errors.damping_factor(len(lam)) - 1)[:, None] * 2j * zeta
            inverse = (1 / (lam[:, None] * (stiffness + more) + mass))[:, None, :]
        laws, connections = total["laws"], stiffness
        if others and total["connections"].any():
            more = 2j * (others[0] - zeta)
            laws, connections = [*laws, (more, total["connections"])], stiffness + more
        U = _range([total["C"], total["D"], *(X for _, X in laws)]) if damped is None else damped
        if U is None or not U.shape[1]:
            nothing = np.zeros((len(omega), 0, 0), dtype=complex)
            return cls(lam, V, stiffness, connections, mass, inverse, None, nothing, nothing)
        C, D = U.T @ total["C"] @ U, U.T @ total["D"] @ U
        Um, own = V.T @ U, U.T @ total["connections"] @ U if others else None
        S = 1j * (omega[:, None, None] * C + D)
        for factor, X in laws:
            S = S + factor[:, None, None] * (U.T @ X @ U)
        # G = Umᵀ diag(1/...) Um is symmetric: one product gives its upper half at all lines.
        i, j = np.triu_indices(U.shape[1])
        half, where = _times((Um[:, i] * Um[:, j]).T, inverse)[:, 0].T, np.empty(2 * [U.shape[1]], dtype=int)
        where[i, j] = where[j, i] = np.arange(len(i))
        G = half[:, where]
        return cls(lam, V, stiffness, connections, mass, inverse, Um, S, np.eye(U.shape[1]) + S @ G, own)

    @property
    def correct(self) -> NDArray[Any]:
        """(I + S G)⁻¹ S at each line (computed once)."""
        if "correct" not in self._made:
            self._made["correct"] = np.linalg.solve(self.yielding, self.resisting)
        return self._made["correct"]

    def resisted(self, motions: NDArray[np.complex128]) -> NDArray[Any]:
        """Return the forces (n_freq, k, n) of what damps locally, from the motions without it."""
        if _FEW * motions.shape[2] < motions.shape[1] and "correct" not in self._made:
            return np.linalg.solve(self.yielding, self.resisting @ motions)
        return self.correct @ motions

    def read(
        self, B: NDArray[np.float64], F: NDArray[np.complex128], places: Sequence[NDArray[np.float64]]
    ) -> tuple[NDArray[np.complex128], list[NDArray[np.complex128]]]:
        """Return Bᵀ Z⁻¹ F and, for the motions P of each of some places, Bᵀ Z⁻¹ P, each (n_freq, n, m).

        B is (r, n); F (r, m, n_freq) and P (r, m) are in modal coordinates. All coordinates' responses are
        never formed, as what is read of them is less.
        """
        R, X = self.V.T @ B, F * self.inverse
        if self.U is None:
            return _lines_first(_times(R.T, X)), [self._undamped(R, P) for P in places]
        U, n = self.U, R.shape[1]
        resisted = self._undamped(R, U) @ self.correct
        moved = _lines_first(_times(np.hstack([R, U]).T, X))
        at = [self._undamped(R, P) - resisted @ self._undamped(U, P) for P in places]
        return moved[:, :n] - resisted @ moved[:, n:], at

    def _undamped(self, A: NDArray[np.float64], B: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return Aᵀ Z⁻¹ B without local damping, (n_freq, n, m); A (r, n), B (r, m) in modal coordinates."""
        each = (A[:, :, None] * B[:, None, :]).reshape(len(A), -1)
        return _lines_first(_times(each.T, self.inverse).reshape(A.shape[1], B.shape[1], -1))

    def solve(self, B: NDArray[np.float64], *, transposed: bool = False) -> NDArray[np.complex128]:
        """Return Z⁻¹ B or Z⁻ᵀ B in modal coordinates, (r, n, n_freq), for forces B (r, n).

        Local damping enters by Woodbury's identity, line by line; only it can make Z unsymmetric.
        """
        forces = self.V.T @ B
        if self.U is None:
            return forces[:, :, None] * self.inverse
        k, n = self.U.shape[1], forces.shape[1]
        each = (self.U[:, :, None] * forces[:, None, :]).reshape(len(forces), k * n)
        undamped = _lines_first(_times(each.T, self.inverse).reshape(k, n, -1))
        by = np.swapaxes(self.correct, 1, 2) @ undamped if transposed else self.resisted(undamped)
        resisted = _times(self.U, np.moveaxis(by, 0, 2))
        np.subtract(forces[:, :, None], resisted, out=resisted)
        resisted *= self.inverse
        return resisted


def _times(A: NDArray[np.float64], X: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Multiply a real matrix (m, r) with a complex array (r, n, n_freq) over r, by one real product."""
    flat = np.ascontiguousarray(X).reshape(len(X), -1).view(float)
    return (A @ flat).view(complex).reshape(len(A), *X.shape[1:])


def _lines_first(X: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return a copy of an array over lines (n, m, n_freq) as one matrix for each line, (n_freq, n, m)."""
    return np.ascontiguousarray(np.moveaxis(X, 2, 0))


def _range(matrices: list[NDArray[np.float64]]) -> NDArray[np.float64] | None:
    """Return an orthonormal basis of what local damping and laws act on, None without any."""
    sizes = [float(np.abs(X).max()) for X in matrices]
    if max(sizes) == 0:
        return None
    # Not of squares, which lose a soft damper beside a stiff one: what dissipates is semidefinite, so that
    # the range of the sum is that of all. Gyroscopic forces are skew, and squared; there are few.
    both = np.zeros_like(matrices[0])
    for X, size in zip(matrices, sizes, strict=True):
        if size > 0:
            skew = (X - X.T) / (2 * size)
            both += (X + X.T) / (2 * size) + (skew @ skew.T if skew.any() else 0.0)
    eigenvalues, vectors = sla.eigh(both, check_finite=False)
    return vectors[:, np.abs(eigenvalues) > 1e-13 * np.abs(eigenvalues).max()]


def scale_factors(changes: Iterable[tuple[float, Mapping[str, int]]]) -> dict[str, float]:
    """Return what K, M, C and D of an effect are multiplied by if parameters of others change by factors.

    With each factor stands which of the matrices go in proportion (:meth:`ReducedModel.scaling_of`).
    """
    out = dict.fromkeys("KMCD", 1.0)
    for factor, exponents in changes:
        for key, n in exponents.items():
            out[key] *= factor if n else 1.0
    return out


def _scaling(effect: Effect, model: Model, ref: ParameterRef) -> Mapping[str, int] | None:
    """Return which of an effect's matrices are in proportion to a parameter of another effect.

    They are compared at one other value of it. None if one is neither in proportion nor independent.
    """
    value = model.values().get(ref, 0.0)
    if not value:
        return None
    ordinary = effect.with_values(**{p.name: _ordinary(p) for p in effect.parameters()})
    times = 1.7
    now, then = (ordinary.contribute(model.with_values({ref: f * value})) for f in (1.0, times))
    if len(now) != len(then) or any(c.law is not None for c in (*now, *then)):
        return None
    out: dict[str, int] = {}
    for key in "KMCD":
        pairs: list[tuple[Any, Any]] = [
            (getattr(a, key), getattr(b, key)) for a, b in zip(now, then, strict=True)
        ]
        pairs = [(a, b) for a, b in pairs if a is not None or b is not None]
        if any(a is None or b is None or a.shape != b.shape for a, b in pairs):
            return None
        alike = [n for n in (0, 1) if all(_alike(times**n * a, b) for a, b in pairs)]
        if not alike:
            return None
        out[key] = alike[0]
    return out


def _alike(a: NDArray[Any], b: NDArray[Any]) -> bool:
    return bool(np.abs(a - b).max(initial=0.0) <= 1e-12 * np.abs(b).max(initial=0.0))


def _ordinary(p: Parameter) -> float:
    """Return a value of a parameter at which its effect is there."""
    if p.value != p.absent and np.isfinite(p.value) and p.value:
        return float(p.value)
    low, high = (float(x) if np.isfinite(x) else None for x in (p.lower, p.upper))
    if low is None or high is None:
        return (low if low is not None else float(p.value)) + 1.0
    return low + 0.37 * (high - low)


def values_of(
    model: Model, refs: Sequence[ParameterRef], candidates: Sequence[Effect] = ()
) -> NDArray[np.float64]:
    """Return the present values of parameters of a model's effects or of candidates."""
    effects: Mapping[str, Effect] = {e.name: e for e in (*model.effects, *candidates)}
    return np.array([parameter_values(effects[n])[q] for n, q in refs], dtype=float)
