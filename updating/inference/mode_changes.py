"""What effects do to the residuals of measured modes, by the modal basis of the fitted model.

A change of the matrices moves an eigenvalue by φᵀ(dK - λ dM)φ and mixes the shapes of other modes into its
own: all from the modal basis, so that a candidate costs the same on any mesh.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.model import Effect, parameter_values
from fem.reduction.parametric_modes import DampedMode, ModesAt, ModeStack
from fem.reduction.terms import ReducedTerm, motions_of
from updating.inference.fit_result import FitResult
from updating.inference.problem import Complexes, Floats, ResidualChanges

VISIBLE = 0.1
"""Changes of the data below this are not seen: what was measured does not have them [standard deviations]."""
HIGHEST = 4.0
"""Modes up to this multiple of the highest measured frequency make the space of changes on grids."""

Key = tuple[tuple[str, str], ...]


@dataclass(eq=False)
class ModeChanges(ResidualChanges):
    """Changes of the residuals of modes, however these are weighted."""

    problem: Any
    function: Any

    @classmethod
    def of(cls, problem: Any, base: FitResult) -> ModeChanges:
        """Return the changes at a fit; unknowns that it lacks, as an effect took their place, are nominal."""
        values = [parameter_values(e) for e in base.effects]
        function = problem.function(base.effects, values, problem.targets.fitted)
        every = np.arange(len(function.groups))
        return cls(base, function, function.moved_to(base), every, np.ones(len(every), dtype=bool), problem)

    @cached_property
    def modes(self) -> ModesAt:
        """The modes of the fit."""
        return self.function.modes_at(self.x)

    @cached_property
    def found(self) -> tuple[Complexes, Any]:
        """Residuals of the fit, and its partners of the measured modes."""
        return self.function.residuals(self.modes)

    @cached_property
    def now(self) -> Complexes:
        """The weighted residuals of the fit, (m,)."""
        return self.found[0]

    @cached_property
    def resolution(self) -> Floats:
        """Changes of the residuals below these are not seen, (m,) [-]."""
        return VISIBLE * self.function.least_deviations

    def heavily_damped(self) -> ModeChanges:
        """Return the changes as they are: those of modes do not depend on how sharp their resonances are."""
        return self

    def has_slope(self, effect: Effect) -> bool:
        """Whether a little of an effect is known by the forces on what it changes.

        Of a constraint that gives way a little the inertia on it tells; not of one that holds elsewhere.
        """
        return not effect.released() or bool(np.isinf(effect.parameters()[0].absent))

    @property
    def has_cheap_slopes(self) -> bool:
        """Return True: they need the modal basis alone."""
        return True

    def slopes(self) -> Callable[[Sequence[Effect]], Complexes]:
        """Return a function that gives the changes by small effects to the first order, (n, m)."""
        return self._slopes

    def _slopes(self, effects: Sequence[Effect]) -> Complexes:
        out = np.zeros((len(effects), len(self.now)), dtype=complex)
        base, partners = self.modes, self.found[1]
        free = [n for n, e in enumerate(effects) if not e.released()]
        terms = [self._restricted(self.problem.reduced.value_of(effects[n])) for n in free]
        out[free] = self.function.slopes(base, partners, list(enumerate(terms)), len(free))
        constrained = [n for n, e in enumerate(effects) if e.released()]
        each = [self._opened(effects[n]) for n in constrained]
        out[constrained] = self.function.slopes(
            base,
            partners,
            [(k, o.term) for k, o in enumerate(each)],
            len(constrained),
            lambda mode: np.stack([o.moved(mode) for o in each]),
        )
        return out

    def by_terms(self, released: Sequence[tuple[str, str]], terms: Sequence[ReducedTerm]) -> Complexes:
        """Return the changes by terms added to the matrices, (n, m); NaN where there is no structure."""
        out = np.full((len(terms), len(self.now)), np.nan, dtype=complex)
        places = dict[Any, list[int]]()
        for n, term in enumerate(terms):
            places.setdefault((term.place, _forces_alike(term)), []).append(n)
        stacks = dict[tuple[int, ...], list[tuple[list[int], ModeStack]]]()
        for some in places.values():
            here = [terms[n] for n in some]
            try:
                at, here = self._with_lacking(self.around(tuple(released), here[0]), here)
                stack = at.with_each(here)
            except (np.linalg.LinAlgError, ValueError):  # no structure
                continue
            stacks.setdefault(stack.size[1:], []).append((some, stack))
        for alike in stacks.values():
            together = ModeStack.joined([stack for _, stack in alike])
            try:
                out[[n for some, _ in alike for n in some]] = self.function.residuals_in(together)
            except np.linalg.LinAlgError:  # of one of them
                for some, stack in alike:
                    with suppress(np.linalg.LinAlgError):
                        out[some] = self.function.residuals_in(stack)
        return out - self.now

    def _restricted(self, term: ReducedTerm) -> ReducedTerm:
        P = self.modes.columns
        if term.L is not None:
            return replace(term, L=term.L @ P)
        each = {key: None if (X := getattr(term, key)) is None else P.T @ X @ P for key in "KMCD"}
        return replace(term, **each, laws=tuple((f, P.T @ X @ P) for f, X in term.laws))

    def _opened(self, effect: Effect) -> Opened:
        """Return what a connection does that gives way a little."""
        basis, reduced = self.problem.reduced.basis, self.problem.reduced
        columns = [basis.n_main + basis.keys.index(key) for key in effect.released()]
        term = reduced.value_of(effect)
        stiff: Any = term.dense("K")
        for factor, X in term.laws:
            stiff = stiff + abs(complex(np.median(factor(self.modes.omega)))) * term.spread(X)
        k = stiff[np.ix_(columns, columns)] if np.ndim(stiff) else np.eye(len(columns)) * 1e30
        forces = [(self.modes.columns.T @ reduced.base_sum[key][:, columns]).T for key in "KM"]
        compliance: Any = np.linalg.pinv(k)
        return Opened(compliance, forces[0], forces[1], self.problem.outputs()[columns])

    def around(self, released: Key, term: ReducedTerm) -> ModesAt:
        """Return the modes without some constraints, in the space of the lower modes and of a term's forces.

        Those of a connection that becomes soft are no sum of the modes of a stiff one.
        """
        at, V = self._lower(tuple(released))
        if released or (forces := self._forces(term)) is None:
            return at.on(V)
        vectors, lam = self.modes.pairs(0).vectors, self.modes.pairs(0).eigenvalues
        high = lam > (2 * np.pi * self._top) ** 2
        still = vectors[:, high] @ ((vectors[:, high].T @ forces) / lam[high, None])
        return at.on(np.hstack([V, _independent_columns(still)]))

    def _with_lacking(self, at: ModesAt, terms: Sequence[ReducedTerm]) -> tuple[ModesAt, list[ReducedTerm]]:
        """Return modes and terms of one place on a basis that has the responses to their forces as well.

        What a hinge lets turn has mass: with the flexibility alone it would turn too late.
        """
        first, stiff = terms[0], [t.K for t in terms if t.K is not None and t.K.any()]
        if first.L is None or first.dofs is None or not stiff or first.laws:
            return at, list(terms)
        lacking = self.problem.reduced.lacking(first.dofs, motions_of(stiff)[0])
        if lacking is None:
            return at, list(terms)
        wider = np.hstack([first.L, lacking.motion])
        larger = at.with_lacking(lacking, first.stiffer, self._heavier)
        return larger, [replace(term, L=wider) for term in terms]

    @cached_property
    def _heavier(self) -> float:
        """The ratio of the mass to the nominal one."""
        P = self.modes.columns
        nominal = np.einsum("ik,ij,jk->", P, self.problem.reduced.base_sum["M"], P, optimize=True)
        return float(np.trace(self.modes.mass) / nominal)

    @cached_property
    def _top(self) -> float:
        return HIGHEST * float(self.problem.targets.frequency[-1])

    def _lower(self, released: Key) -> tuple[ModesAt, Floats]:
        """Return the model without some constraints, its lower modes with them and what opens each."""
        if released not in self._spaces:
            at, pairs = self.modes, self.modes.pairs(0)
            V = pairs.vectors[:, pairs.frequency <= self._top]
            if released:
                at = self.function.modes_at(self.x, released)
                lower = at.columns.T @ (self.modes.columns @ V)
                more = [int(np.flatnonzero(at.columns[self._column(k)])[0]) for k in released]
                V = np.hstack([lower, np.eye(len(lower))[:, more]])
            self._spaces[released] = at, V
        return self._spaces[released]

    def _forces(self, term: ReducedTerm) -> Floats | None:
        """Return a term's forces on the reduced coordinates (r, k); None where it acts on much."""
        if term.L is None:
            return None
        parts = [X for X in (term.K, term.M, *(X for _, X in term.laws)) if X is not None and X.any()]
        U = _independent_columns(np.hstack([np.zeros((len(term.L), 0)), *parts]))
        # Effects with more independent forces act on whole members; the modal basis represents them
        return (term.L @ self.modes.columns).T @ U if 0 < U.shape[1] <= 6 else None

    @cached_property
    def _spaces(self) -> dict[Key, tuple[ModesAt, Floats]]:
        return {}

    def _column(self, key: tuple[str, str]) -> int:
        basis = self.problem.reduced.basis
        return basis.n_main + basis.keys.index(key)


@dataclass(frozen=True, slots=True, eq=False)
class Opened:
    """A constraint that gives way a little under the forces on it, f = (K_cu - ω² M_cu) x by motions x.

    What opens the constraint is in static equilibrium elsewhere, so that nearly all of f is inertia.

    Attributes
    ----------
    compliance : ndarray (c, c)
    stiffness, mass : ndarray (c, r)
        K_cu and M_cu.
    outputs : ndarray (c, n_out)
        Motion of the sensors where the constraint opens.
    """

    compliance: Floats
    stiffness: Floats
    mass: Floats
    outputs: Floats

    @property
    def term(self) -> ReducedTerm:
        """The change of the dynamic stiffness, -fᵀ k⁻¹ f, in powers of -ω²."""
        powers = np.diag([1.0, 0.0]), np.array([[0.0, 1.0], [1.0, 0.0]]), np.diag([0.0, 1.0])
        laws = tuple((partial(_power, n), np.kron(which, -self.compliance)) for n, which in enumerate(powers))
        return ReducedTerm(np.vstack([self.stiffness, self.mass]), None, None, None, None, laws)

    def moved(self, mode: DampedMode) -> NDArray[Any]:
        """Return the motion of the sensors by the opening in a mode, (n_out,)."""
        force = self.stiffness @ mode.vector - mode.eigenvalue.real * (self.mass @ mode.vector)
        return -(self.compliance @ force) @ self.outputs


def _forces_alike(term: ReducedTerm) -> tuple[bytes, ...]:
    """Return a key that terms on the same coordinates have in common if they are multiples of each other.

    A mass at two places of one element acts on the same DOFs with other forces.
    """
    every = (term.K, term.M, term.C, term.D, *(X for _, X in term.laws))
    largest = [0.0 if X is None else float(np.abs(X).max(initial=0.0)) for X in every]
    return tuple(
        (np.round(X / size, 6) + 0.0).tobytes() if X is not None and size > 0 else b""
        for X, size in zip(every, largest, strict=True)
    )


def _power(n: int, omega: Floats) -> Floats:
    return (-(omega**2)) ** n


def _independent_columns(A: Floats) -> Floats:
    """Return an orthonormal basis of the columns of a matrix, each of which counts as much."""
    size = np.linalg.norm(A, axis=0)
    U, s, _ = np.linalg.svd(A[:, size > 0] / size[size > 0], full_matrices=False)
    # Forces that differ by less are one [-]
    return U[:, s > 1e-6 * s.max(initial=0.0)]
