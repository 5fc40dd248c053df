"""A model projected on a few vectors, and the projection of effects on them.

A model is projected once, for many parameter values and candidate effects. After that nothing depends on the
size of the mesh.
"""

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np
import scipy.linalg as sla
from numpy.typing import NDArray

from fem.analysis.basis import Basis, reduced_basis, without_modes
from fem.array_types import Floats, Ints
from fem.model import Contribution, Effect, FollowsOthers, Model, ParameterRef, parameter_values
from fem.recent import Recent, Unsent
from fem.reduction.scaling import scaling_exponents
from fem.reduction.sums import Sums
from fem.reduction.terms import STEP, ReducedTerm, acting, law_parts, motions_of, real_or_slope, static_part
from fem.summary import fields_summary
from fem.system import System, assemble, sum_contributions
from fem.tabulated import TabulatedEffect

LOCAL_LIMIT, LOCAL_SHARE = 60, 0.25
"""Contributions that touch at most this many DOFs, or as many as this share of the basis's vectors, are kept
in factored form; forces for a basis are taken from the former."""

RESIDUAL_LIMIT = 20_000
"""Models with at most this many DOFs get the residual flexibility at the places of candidates."""


_PAIRS = 8
"""Sets of elements whose sums over pairs of DOFs are kept."""

_MODELS = 4
"""Models with other values that are kept."""

_VECTORS, _ROWS = 8, 400
"""Sets of sensors whose projections are kept."""


_SHAPES = 256
"""Sets of forces for which the shapes that the basis lacks are kept."""

_LACKING = 1e-8
"""Less than this part of a static response is in the basis but for rounding [-]."""

_ALL = slice(None)
_NONE: Mapping[ParameterRef, float] = MappingProxyType({})
_UNITS, _LOCAL = 64, 10_000
"""Effects whose matrices are kept: of those that act on much of the model, and of those on few DOFs."""


@dataclass(slots=True, eq=False)
class FullModelResults:
    """Results of the full model that do not depend on the basis: reduced models on extended bases share them.

    Attributes
    ----------
    exponents : dict
        By effect and foreign parameter: see :meth:`ReducedModel.scaling_of`.
    matrices : dict
        By effect and parameter: the sums of its K, M, C and D, or their derivatives, sparse.
    flexibility : dict
        By DOFs and motions: flexibility to forces there, without the modes of the basis.
    sums : dict
        By effect: tables of those whose matrices are sums over their parameters.
    local : Unsent
        Of effects on few DOFs, by all their fields but one or none: their terms without L.
    """

    exponents: dict[tuple[str, ParameterRef], Mapping[str, int] | None] = field(default_factory=dict)
    matrices: dict[tuple[str, str], Any] = field(default_factory=dict)
    flexibility: dict[tuple[bytes, bytes], Floats] = field(default_factory=dict)
    sums: dict[str, Sums] = field(default_factory=dict)
    local: Unsent = field(default_factory=lambda: Unsent(_LOCAL))


@dataclass(frozen=True, slots=True, eq=False)
class Lacking:
    """Shapes u (n_dof, k) that a basis T lacks: static responses to forces, with Tᵀ(K - σM)u = 0.

    Attributes
    ----------
    motion : ndarray (m, k)
        u at the DOFs where the forces act.
    K, M : ndarray (k, k)
        uᵀKu and uᵀMu.
    coupling_K, coupling_M : ndarray (r, k)
        TᵀKu and TᵀMu of the basis's vectors without those that open constraints.
    """

    motion: Floats
    K: Floats
    M: Floats
    coupling_K: Floats
    coupling_M: Floats


@dataclass(eq=False)
class ReducedModel:
    """A model on a reduced basis, ready for :class:`~fem.reduction.parametric_frf.ParametricFRF`.

    It is an engine, not a value: projections that it has made once are kept as long as it lives. The model
    and the basis never change.

    Attributes
    ----------
    model : Model
        The full model, at nominal values.
    basis : Basis
    system : System
        The model's matrices.
    full : FullModelResults
    """

    model: Model
    basis: Basis
    system: System
    full: FullModelResults = field(default_factory=FullModelResults, repr=False)
    # Of effects of the model, by their names: their projections ("") and those of their derivatives by linear
    # parameters.
    _terms: dict[tuple[str, str], ReducedTerm] = field(default_factory=dict, init=False, repr=False)
    # Of effects of the model that are sums over their parameters: the fixed matrices of these.
    _summed: dict[str, Floats] = field(default_factory=dict, init=False, repr=False)
    # Of effects that act on much of the model, by all their fields: projected matrices; by all but one: those
    # for a unit of that one.
    _units: Unsent = field(default_factory=lambda: Unsent(_UNITS), init=False, repr=False)
    # Of vectors on all DOFs, by keys of the caller.
    _projected: Recent = field(default_factory=lambda: Recent(_VECTORS), init=False, repr=False)
    # Of forces, by DOFs and motions.
    _lacking: Recent = field(default_factory=lambda: Recent(_SHAPES), init=False, repr=False)
    # The basis at DOFs, by these.
    _dofs: Recent = field(default_factory=lambda: Recent(_ROWS), init=False, repr=False)
    # Of sets of elements, by their DOFs.
    _pairs: Recent = field(default_factory=lambda: Recent(_PAIRS), init=False, repr=False)
    # Of effects and values: models.
    _models: Unsent = field(default_factory=lambda: Unsent(_MODELS), init=False, repr=False)
    # Effects whose responses the basis has, at their values: twice extended, it would keep what once fell
    # below the accuracy of the first time, and two ways to the same basis would differ.
    _held: frozenset[Hashable] = field(default=frozenset(), init=False, repr=False)

    __repr__ = fields_summary

    @cached_property
    def nominal(self) -> dict[ParameterRef, float]:
        """Values of all parameters of the model."""
        return self.model.values()

    def projected(self, key: Hashable, make: Callable[[], Floats]) -> tuple[Floats, Floats]:
        """Return vectors on all DOFs and their products with the basis, (n_dof, n) and (r + p, n).

        Every fit, screening and forecast on this model reads the same sensors.

        Parameters
        ----------
        key : hashable
            Stands for the vectors: equal keys mean equal vectors. The tuple of sensors, for example.
        make : callable
            Gives the vectors where they are not known yet.
        """

        def both() -> tuple[Floats, Floats]:
            vectors = make()
            return vectors, self.basis.T.T @ vectors

        return self._projected.get(key, both)

    def with_forces_of(self, effects: Sequence[Effect]) -> "ReducedModel":
        """Return the model with the responses to an effect's forces in its basis, where it touches few DOFs.

        Modes and the responses to other forces are smooth where a crack bends or a short piece is stiffer.
        """
        columns, held = [], set(self._held)
        for effect in effects:
            key = effect.kind, effect.name, *parameter_values(effect).items()
            if key in held:
                continue
            held.add(key)
            term = self.value_of(effect)
            matrices = [X for key in "KMCD" if (X := getattr(term, key)) is not None and X.any()]
            matrices += [X for _, X in term.laws if X.any()]
            if term.dofs is None or len(term.dofs) > LOCAL_LIMIT or not matrices:
                continue
            motions, _, _ = motions_of(matrices)
            block = np.zeros((self.model.n_dof, motions.shape[1]))
            block[term.dofs] = motions
            columns.append(block)
        if not columns:
            return self
        out = self._on(self.basis.extended(self.system, np.hstack(columns)))
        if out is not self:
            out._held = frozenset(held)
        return out

    def _on(self, basis: Basis) -> "ReducedModel":
        if basis is self.basis:
            return self
        out = ReducedModel(self.model, basis, self.system, self.full)
        grown = {at: out._grown(term, self.basis, *at) for at, term in self._terms.items()}
        out._terms.update({at: term for at, term in grown.items() if term is not None})
        for name, matrices in self._summed.items():
            pairs = zip(matrices, self.full.sums[name].full, strict=True)
            out._summed[name] = np.stack([out._larger(X, full, self.basis) for X, full in pairs])
        out._held = self._held
        return out

    def _grown(self, term: ReducedTerm, before: Basis, name: str, parameter: str) -> ReducedTerm | None:
        """Return the term of an effect of the model, or its slope, from that on the basis which was extended.

        Only the part of the new vectors is projected. None for one with laws that act on many DOFs, which is
        projected again where it is needed.
        """
        if term.L is not None:
            return replace(term, L=self.basis.T[term.dofs])
        if term.laws:
            return None
        known = self.full.matrices
        if (name, parameter) not in known:
            effect = self.model.effect(name)
            step = {p.name: p.value + 1j * STEP for p in effect.parameters() if p.name == parameter}
            static = [static_part(c, bool(step)) for c in self.model.parts_of(effect.with_values(**step))]
            known[name, parameter] = sum_contributions(tuple(static), self.model.n_dof)
        present = (term.K, term.M, term.C, term.D)
        K, M, C, D = (
            None if X is None else self._larger(X, full, before)
            for X, full in zip(present, known[name, parameter], strict=True)
        )
        return replace(term, K=K, M=M, C=C, D=D)

    def _larger(self, X: NDArray[Any], full: Any, before: Basis) -> NDArray[Any]:
        """Return a projected matrix from that on the basis which was extended, and the full one."""
        T, old, new = self.basis.T, before.n_main, self.basis.n_main
        fresh, kept = T[:, old:new], np.concatenate([np.arange(old), np.arange(new, T.shape[1])])
        out = np.empty((T.shape[1],) * 2)
        out[np.ix_(kept, kept)] = X
        out[:, old:new] = T.T @ (full @ fresh)
        out[old:new] = (full.T @ fresh).T @ T
        return out

    def with_shapes(self, shapes: Floats, share: float = 0.0) -> "ReducedModel":
        """Return the model with more shapes (n_dof, n) in its basis, such as responses at frequencies.

        Directions that are less than a ``share`` of them are left out.
        """
        return self._on(self.basis.with_shapes(self.system, shapes, share))

    def residual_flexibility(self, dofs: Ints, motions: Floats) -> Floats | None:
        """Return the static flexibility that the basis lacks to motions (m, k) of some DOFs, (k, k).

        R = Sᵀ [Q (K - σM)⁻¹ Qᵀ - T (Tᵀ(K - σM)T)⁻¹ Tᵀ] S with the basis's shift, S the motions. None for
        models with more than ``RESIDUAL_LIMIT`` DOFs, for which it would cost too much.
        """
        if self.model.n_dof > RESIDUAL_LIMIT:
            return None
        # DOFs of one element
        b, few = self.basis, len(dofs) <= 12
        # All of an element's is solved for at once: it serves every effect there.
        key, known = (dofs.tobytes(), b"" if few else motions.tobytes()), self.full.flexibility
        if key not in known:
            forces = np.asarray(self.system.Q.T.tocsc()[:, dofs] @ (np.eye(len(dofs)) if few else motions))
            forces = without_modes(self.system, b.V[:, : b.n_modes], forces)
            known[key] = forces.T @ b.factor.solve(forces)
        # Modes are left out on both sides: their part is not lacking, and its rounding may exceed the rest.
        T = motions.T @ b.T[dofs, b.n_modes : b.n_main]
        full = motions.T @ known[key] @ motions if few else known[key]
        return full - T @ self._static_flexibility @ T.T

    def lacking(self, dofs: Ints, motions: Floats) -> Lacking | None:
        """Return the static responses to forces by motions (m, k) of some DOFs that the basis lacks.

        Where something gives way, they say more than their flexibility alone: what moves then has mass. None
        where the basis lacks nothing, and for models with more than ``RESIDUAL_LIMIT`` DOFs.
        """
        if self.model.n_dof > RESIDUAL_LIMIT:
            return None
        return self._lacking.get((dofs.tobytes(), motions.tobytes()), lambda: self._lacks(dofs, motions))

    def _lacks(self, dofs: Ints, motions: Floats) -> Lacking | None:
        b, system = self.basis, self.system
        force = np.asarray(system.Q.T.tocsc()[:, dofs] @ motions)
        force = without_modes(system, b.V[:, : b.n_modes], force)
        u = np.asarray(b.factor.solve(force))
        scale = 1 / np.sqrt(np.maximum(np.einsum("ij,ij->j", force, u), 1e-300))
        others = b.V[:, b.n_modes : b.n_main]
        u = u - others @ (self._static_flexibility @ (others.T @ force))
        R = force.T @ u * np.outer(scale, scale)
        lam, vectors = np.linalg.eigh((R + R.T) / 2)
        vectors, lam = vectors[:, lam > _LACKING], lam[lam > _LACKING]
        if not len(lam):
            return None
        u = u @ (scale[:, None] * vectors / np.sqrt(lam))
        Mu = np.asarray(system.M @ u)
        M, coupling = u.T @ Mu, b.V[:, : b.n_main].T @ Mu
        motion = np.asarray(system.Q.tocsr()[dofs] @ u)
        return Lacking(motion, np.eye(len(lam)) + b.shift * M, M, b.shift * coupling, coupling)

    @cached_property
    def _static_flexibility(self) -> Floats:
        """(K - σM)⁻¹ of the basis's vectors other than modes and constraints."""
        others, total = slice(self.basis.n_modes, self.basis.n_main), self.base_sum
        inverse: Any = np.linalg.inv((total["K"] - self.basis.shift * total["M"])[others, others])
        return inverse

    def project(self, contributions: Sequence[Contribution], imaginary: bool = False) -> ReducedTerm:
        """Project contributions; ``imaginary`` takes the complex-step derivative instead of the value."""
        if (alike := self._alike(contributions, imaginary)) is not None:
            return alike
        if imaginary:  # where a stretch ends matters at its ends alone; real contributions do not change
            changing = [
                acting(c)
                for c in contributions
                if c.law is not None
                or any(X is not None and np.iscomplexobj(X) for X in (c.K, c.M, c.C, c.D))
            ]
            contributions = changing if changing else contributions[:1]
        dofs = np.unique(
            np.concatenate([np.zeros(0, dtype=np.int64), *(c.dofs.ravel() for c in contributions)])
        )
        T = self.basis.T
        if len(dofs) > max(LOCAL_LIMIT, LOCAL_SHARE * T.shape[1]):
            # Derivatives of elements with so many DOFs together are projected one by one, which needs no
            # sparse matrix. Values are not: their large parts cancel better in a sum.
            few = sum(c.dofs.size for c in contributions) <= 2000
            if imaginary and few and not any(c.law for c in contributions):
                static = [static_part(c, imaginary) for c in contributions]
                K, M, C, D = (_congruent(T, static, key) for key in "KMCD")
                return ReducedTerm(None, K, M, C, D)
            n, T = len(dofs), T[dofs]
            renumbered = [replace(c, dofs=np.searchsorted(dofs, c.dofs)) for c in contributions]
            full = sum_contributions(tuple(static_part(c, imaginary) for c in renumbered), n)
            laws = [
                (factor, sum_contributions((Contribution(c.dofs, X),), n)[0])
                for c in renumbered
                if c.law is not None
                for factor, X in law_parts(c, imaginary)
            ]
            K, M, C, D = (T.T @ (X @ T) if X.nnz else None for X in full)
            return ReducedTerm(None, K, M, C, D, tuple((factor, T.T @ (X @ T)) for factor, X in laws))

        def summed(pairs: Sequence[tuple[Contribution, Any]]) -> NDArray[Any] | None:
            present = [(c, X) for c, X in pairs if X is not None]
            if not present:
                return None
            total = np.zeros((len(dofs), len(dofs)))
            for c, X in present:
                at = np.searchsorted(dofs, c.dofs)
                np.add.at(total, (at[:, :, None], at[:, None, :]), X)
            return total

        static = [static_part(c, imaginary) for c in contributions]
        K, M, C, D = (summed([(c, getattr(c, key)) for c in static]) for key in "KMCD")
        laws = [
            (factor, summed([(c, X)]))
            for c in contributions
            if c.law is not None
            for factor, X in law_parts(c, imaginary)
        ]
        laws = tuple((f, X) for f, X in laws if X is not None)
        return ReducedTerm(self._rows(dofs), K, M, C, D, laws, dofs)

    def _alike(self, contributions: Sequence[Contribution], imaginary: bool) -> ReducedTerm | None:
        """Project elements that have one symmetric matrix, Σ x_ij Σ_e T_eiᵀ T_ej; None for others.

        The inner sums are computed once for all matrices: one costs the same on any mesh. It is less than by
        way of the elements where there are as many of them as vectors.
        """
        if (
            len(contributions) != 1
            # Elements with one common matrix are projected by sums over their pairs of DOFs on bases of at
            # most so many vectors
            or not len(contributions[0].dofs) >= self.basis.T.shape[1] <= 256
        ):
            return None
        (c,) = contributions
        matrices = [X for X in (c.K, c.M, c.C, c.D) if X is not None]
        if c.law is not None or not all(X.strides[0] == 0 and (X[0] == X[0].T).all() for X in matrices):
            return None
        pairs = self._pairs.get(c.dofs.tobytes(), lambda: _sums_over_pairs(self.basis.T, c.dofs))
        first, second = np.triu_indices(c.dofs.shape[1])

        def total(X: NDArray[Any] | None) -> NDArray[Any] | None:
            part: Any = None if X is None else real_or_slope(X[0], imaginary)
            return None if part is None else np.tensordot(part[first, second], pairs, axes=1)

        K, M, C, D = map(total, (c.K, c.M, c.C, c.D))
        return ReducedTerm(None, K, M, C, D)

    def value_of(
        self, effect: Effect, model: Model | None = None, beside: Mapping[ParameterRef, float] = _NONE
    ) -> ReducedTerm:
        """Project an effect at its present values, on the nominal model or on one with other values.

        ``beside`` are values of parameters that :meth:`follows`.
        """
        if model is None and (table := self._table_of(effect)) is not None:
            matrices = table.matrices(parameter_values(effect), self._beside(table, beside))
            return self._tabulated(table, *matrices)
        if model is None and (sums := self._sums_of(effect)) is not None:
            return self._sum(effect, sums.factors(parameter_values(effect)))
        if model is not None:
            return self._of(effect, model.parts_of(effect))
        if (unit := self._unit(effect)) is not None:
            return unit[0].times(unit[1])
        return self._kept(_content(effect), lambda: self._of(effect, self.model.parts_of(effect)))

    def _kept(self, key: Hashable, make: Callable[[], ReducedTerm]) -> ReducedTerm:
        """Return a projection that is made once, unless its key is None; of few DOFs more are kept."""
        if key is None:
            return make()
        known: ReducedTerm | None = self._units.find(key)
        if known is not None:
            return self._units.put(key, known)
        if (known := self.full.local.find(key)) is not None and known.dofs is not None:
            self.full.local.put(key, known)
            return replace(known, L=self._rows(known.dofs))
        term = make()
        if term.L is None:
            return self._units.put(key, term)
        # The matrices of few DOFs do not depend on the basis: extended bases share them.
        self.full.local.put(key, replace(term, L=None))
        return term

    def follows(self, effect: Effect) -> tuple[ParameterRef, ...]:
        """Return the parameters of other effects with which the tables of an effect change."""
        table = self._table_of(effect)
        return () if table is None else tuple(ref for ref, *_ in table.follows)

    def _beside(
        self, table: TabulatedEffect, values: Mapping[ParameterRef, float]
    ) -> dict[ParameterRef, float]:
        nominal = self.nominal
        return {ref: values.get(ref, nominal[ref]) for ref, *_ in table.follows}

    def _tabulated(self, table: TabulatedEffect, K: Any, M: Any, D: Any) -> ReducedTerm:
        return ReducedTerm(self._rows(table.dofs), K, M, None, D, (), table.dofs)

    def _table_of(self, effect: Effect) -> TabulatedEffect | None:
        """Return the tables of an effect that has some and touches few DOFs."""
        table = effect.tabulated(self.model) if self.model.ground is None else None
        few = table is not None and len(table.dofs) <= max(LOCAL_LIMIT, LOCAL_SHARE * self.basis.T.shape[1])
        return table if few else None

    def _sums_of(self, effect: Effect) -> Sums | None:
        """Return the tables of an effect of the model that is a sum over its parameters (made once)."""
        if not effect.separable or self.model.ground is not None:
            return None
        if effect.name not in self.full.sums:
            self.full.sums[effect.name] = Sums.of(effect, self.model)
        return self.full.sums[effect.name]

    def _sum(self, effect: Effect, factors: Floats, which: slice = _ALL) -> ReducedTerm:
        """Return the sum of some of an effect's fixed matrices multiplied by factors."""
        sums, T = self.full.sums[effect.name], self.basis.T
        if effect.name not in self._summed:
            self._summed[effect.name] = np.stack([T.T @ (X @ T) for X in sums.full])
        matrices, keys = self._summed[effect.name][which], sums.keys[which]
        by_key = np.where(keys == np.array(list("KMD"))[:, None], factors, 0.0)
        K, M, D = (by_key @ matrices.reshape(len(keys), -1)).reshape(3, *matrices.shape[1:])
        return ReducedTerm(None, K, M, None, D if "D" in keys else None)

    def _rows(self, dofs: Ints) -> Floats:
        """Return the basis at some DOFs."""
        rows: Floats = self._dofs.get(dofs.tobytes(), lambda: self.basis.T[dofs])
        return rows

    def _unit(self, effect: Effect) -> tuple[ReducedTerm, float] | None:
        """Return the slope of an effect by a parameter that but multiplies it, and that parameter's value.

        It is computed once for all values of that parameter, and kept for the last values of all others.
        None if there is no such parameter.
        """
        p, *rest = effect.parameters() or (None,)
        if p is None or not p.linear or p.absent != 0 or any(q.linear for q in rest):
            return None
        if (key := _content(effect, p.name)) is None:
            return None
        unit = self._kept(key, lambda: self._slope_of(effect, p.name, p.value, self.model))
        return None if unit.laws else (unit, p.value)

    def derivative_of(
        self,
        effect: Effect,
        parameter: str,
        value: float,
        model: Model | None = None,
        beside: Mapping[ParameterRef, float] = _NONE,
    ) -> ReducedTerm:
        """Project an effect's derivative with respect to one of its parameters, by a complex step."""
        if model is None and (table := self._table_of(effect)) is not None:
            values = parameter_values(effect) | {parameter: value}
            return self._tabulated(table, *table.slopes(values, self._beside(table, beside), parameter))
        if model is None and (sums := self._sums_of(effect)) is not None:
            return self._sum(effect, *sums.slopes(parameter, value))
        unit = None if model or effect.parameters()[0].name != parameter else self._unit(effect)
        return unit[0] if unit else self._slope_of(effect, parameter, value, model or self.model)

    def _slope_of(self, effect: Effect, parameter: str, value: float, model: Model) -> ReducedTerm:
        step = {parameter: value + 1j * STEP}
        return self._of(effect, model.parts_of(effect.with_values(**step)), True)

    def slopes_in(
        self, effect: Effect, model: Model, stepped: Mapping[ParameterRef, Model]
    ) -> list[ReducedTerm]:
        """Project derivatives by parameters of others, each with a complex step in a model."""
        if isinstance(effect, FollowsOthers):
            steps = effect.steps_by_others(model, stepped)
        else:
            steps = [tuple(effect.contribute(there)) for there in stepped.values()]
        return [self._of(effect, model.resisted(each), True) for each in steps]

    def with_values(self, model: Model, values: Mapping[ParameterRef, float]) -> Model:
        """Return a model of the same effects, or of more, with values that differ from its present ones.

        The last ones are kept: effects know what they have computed for a model.
        """

        def there() -> Model:
            known = self.nominal if model is self.model else model.values()
            return model.with_values({ref: v for ref, v in values.items() if v != known.get(ref, v)})

        out: Model = self._models.get((model.effects, *values.items()), there)
        return out

    def followed_derivatives_of(self, effect: Effect, refs: Sequence[ParameterRef]) -> list[ReducedTerm]:
        """Project an effect's derivatives with respect to parameters that it :meth:`follows`."""
        table = self._table_of(effect)
        if table is None or not refs:
            return []
        each = table.slopes_by_others(parameter_values(effect), refs)
        return [self._tabulated(table, K, None, D) for K, D in each]

    def scaling_of(self, effect: Effect, ref: ParameterRef) -> Mapping[str, int] | None:
        """Return which of an effect's matrices are proportional to a foreign parameter (computed once).

        1 for those of K, M, C and D that are in proportion to it, as the stiffness of a change of a member is
        to E, and 0 for those that do not depend on it; None if one does otherwise.
        """
        key, known = (effect.name, ref), self.full.exponents
        if key not in known:
            known[key] = scaling_exponents(effect, self.model, ref)
        return known[key]

    def _of(
        self, effect: Effect, contributions: Sequence[Contribution], imaginary: bool = False
    ) -> ReducedTerm:
        return replace(self.project(contributions, imaginary), connection=effect.connection)

    @cached_property
    def base(self) -> dict[str, ReducedTerm]:
        """The projection of each effect of the model at nominal values."""
        for e in self.model.effects:
            if (e.name, "") not in self._terms:
                self._terms[e.name, ""] = self.value_of(e)
        return {e.name: self._terms[e.name, ""] for e in self.model.effects}

    @cached_property
    def base_sum(self) -> dict[str, Floats]:
        """The sums of all effects' matrices at nominal values.

        ``connections`` is the part of K that belongs to connections.
        """
        zero, terms = np.zeros((self.basis.T.shape[1],) * 2), self.base.values()
        total = {key: sum((t.dense(key) for t in terms), zero) for key in "KMCD"}
        total["connections"] = sum((t.dense("K") for t in terms if t.connection), zero)
        return total

    @cached_property
    def main_modes(self) -> tuple[Floats, Floats]:
        """λ and shapes of the nominal model with all its constraints, on the basis."""
        total, m = self.base_sum, self.basis.n_main
        return sla.eigh(total["K"][:m, :m], total["M"][:m, :m])

    def impedance(self, key: tuple[str, str], omega2: Floats) -> float:
        """Return the median of force over displacement along a released constraint, for some ω².

        In [N/m, N·m/rad].
        """
        basis, total = self.basis, self.base_sum
        lam, V = self.main_modes
        m = basis.n_main
        column = m + basis.keys.index(key)
        # What is left of Z at the constraint once all other coordinates have followed.
        k, mass = (total[x][:, column] for x in "KM")
        coupling = (V.T @ k[:m]) * (1 + 0.02j) - omega2[:, None] * (V.T @ mass[:m])
        others = lam * (1 + 0.02j) - omega2[:, None]
        Z = k[column] * (1 + 0.02j) - omega2 * mass[column] - (coupling**2 / others).sum(axis=1)
        return float(1 / np.median(1 / np.abs(Z)))

    @cached_property
    def base_laws(self) -> list[tuple[Callable[[Floats], NDArray[Any]], Floats]]:
        """The factors and matrices of all effects that depend on frequency."""
        return [(f, t.spread(X)) for t in self.base.values() for f, X in t.laws]

    def linear(self, effect: Effect, parameter: str, value: float) -> ReducedTerm:
        """Return the derivative of an effect of the model with respect to a linear parameter, made once."""
        key = effect.name, parameter
        if key not in self._terms:
            self._terms[key] = self.derivative_of(effect, parameter, value)
        return self._terms[key]


def _content(effect: Effect, but: str = "") -> Hashable:
    """Return what an effect is but for one of its parameters; None where an array is among its fields."""
    key = (type(effect), but, *(getattr(effect, f.name) for f in fields(effect) if f.name != but))
    try:
        hash(key)
    except TypeError:
        return None
    return key


def _congruent(T: Floats, parts: Sequence[Contribution], key: str) -> Floats | None:
    """Return Σ Tᵀ X T of one matrix of contributions with few elements, by these; None where none has it."""
    out: Floats | None = None
    for c in parts:
        if (X := getattr(c, key)) is not None and X.any():
            rows = T[c.dofs]
            part = rows.reshape(-1, T.shape[1]).T @ (X @ rows).reshape(-1, T.shape[1])
            out = part if out is None else out + part
    return out


def _sums_over_pairs(T: Floats, rows: Ints) -> Floats:
    """Return Σ_e T_eiᵀ T_ej, and its transpose with it where i ≠ j, for each pair i ≤ j of elements' DOFs.

    ``rows`` (n_elements, m) are the DOFs of the elements; the result is (m (m + 1)/2, r + p, r + p).
    """
    m = rows.shape[1]
    each = [np.ascontiguousarray(T[rows[:, i]]) for i in range(m)]
    out = np.empty((m * (m + 1) // 2, *2 * T.shape[1:]))
    for n, (i, j) in enumerate(zip(*np.triu_indices(m), strict=True)):
        out[n] = each[i].T @ each[j]
        if i != j:
            out[n] += out[n].T.copy()
    return out


def reduce_model(
    model: Model,
    forces: Floats,
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


def values_of(model: Model, refs: Sequence[ParameterRef], candidates: Sequence[Effect] = ()) -> Floats:
    """Return the present values of parameters of a model's effects or of candidates."""
    effects: Mapping[str, Effect] = {e.name: e for e in (*model.effects, *candidates)}
    return np.array([parameter_values(effects[n])[q] for n, q in refs], dtype=float)
