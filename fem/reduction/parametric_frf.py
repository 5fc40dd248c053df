"""Receptances of a reduced model as functions of parameters, with exact derivatives.

A set of parameter values costs one small symmetric eigenproblem.
"""

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.analysis.frf import References
from fem.array_types import Complexes, Floats
from fem.model import Effect, Model, Parameter, ParameterRef
from fem.recent import Unsent
from fem.reduction.frf_slopes import FrfSlopes
from fem.reduction.modal_solution import ModalSolution, lines_first, range_of, times
from fem.reduction.reduced_model import ReducedModel
from fem.reduction.scaling import scale_factors
from fem.reduction.series import with_series
from fem.reduction.terms import STEP, ReducedTerm, combined

_Forces = dict[int, Complexes]
"""Forces (m, n_in, n_freq) of parameters, by their rows."""


def _side_by_side(forces: _Forces) -> Complexes:
    return np.concatenate(list(forces.values()), axis=1)


def _add_to(forces: _Forces, i: int, force: Complexes) -> None:
    if i in forces:
        forces[i] += force
    else:
        forces[i] = force


@dataclass(frozen=True, slots=True, eq=False)
class _ScaledEffect:
    """An effect whose matrices are only multiplied by parameters of other effects, or follow them in tables.

    ``parameters`` are the rows of its parameters and their values in ``start``, the term there. That and the
    ``slopes`` by these are None if it is not linear in them. ``foreign`` are the rows of the others, their
    nominal values and which of K, M, C and D go in proportion (see :meth:`ReducedModel.scaling_of`).
    ``followed`` are the rows of those that it :meth:`ReducedModel.follows`.
    """

    effect: Effect
    parameters: tuple[tuple[int, float], ...]
    foreign: tuple[tuple[int, float, Mapping[str, int]], ...]
    followed: tuple[int, ...]
    start: ReducedTerm | None
    slopes: list[ReducedTerm] | None

    @property
    def rows(self) -> tuple[int, ...]:
        """Rows of its parameters."""
        return tuple(i for i, _ in self.parameters)

    def factors(self, values: Floats) -> dict[str, float]:
        """Return the factors of K, M, C and D."""
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
    decay : float
        σ of the complex frequencies ω - iσ at which receptances are computed [rad/s]. Laws are those at ω.
    viscous : bool
        Whether ζ is that of viscous modal damping, as of :class:`ModalSolution`.
    references : References, optional
        Outputs, behind those that are read, whose accelerations divide the responses.
    """

    def __init__(
        self,
        reduced: ReducedModel,
        outputs: Floats,
        inputs: Floats,
        frequency: Floats,
        refs: Sequence[ParameterRef],
        candidates: Sequence[Effect] = (),
        release: Sequence[tuple[str, str]] = (),
        *,
        projected: bool = False,
        decay: float = 0.0,
        viscous: bool = False,
        references: References | None = None,
    ) -> None:
        basis = reduced.basis
        self.reduced, self.viscous, self.references = reduced, viscous, references
        self.refs = tuple(refs)
        self.omega: NDArray[Any] = 2 * np.pi * np.asarray(frequency, dtype=float)
        if decay:
            self.omega = self.omega - 1j * decay
        self._frequency = np.asarray(frequency, dtype=float)
        released = {key for effect in candidates for key in effect.released()} | set(release)
        columns = [basis.n_main + i for i, key in enumerate(basis.keys) if key in released]
        self.active = np.concatenate([np.arange(basis.n_main), np.array(columns, dtype=np.int64)])
        n = len(self.active)
        self._all_active = n == basis.T.shape[1]
        ends = (outputs, inputs) if projected else (basis.T.T @ outputs, basis.T.T @ inputs)
        self.outputs, self.inputs = (X[self.active] for X in ends)
        self.outputs_on_basis = ends[0]

        effects = {e.name: e for e in (*reduced.model.effects, *candidates)}
        # What gives way is in series with all that alters its element, and so depends on other candidates.
        self.candidates = tuple(candidates)
        self._series = with_series(reduced.model, candidates)
        wanted: dict[str, list[int]] = {}
        for i, (name, _) in enumerate(self.refs):
            wanted.setdefault(name, []).append(i)
        candidate_names = {e.name for e in candidates}
        ix = np.ix_(self.active, self.active)
        self._fixed: dict[str, Any] = {key: X[ix].copy() for key, X in reduced.base_sum.items()}
        self._fixed["laws"] = [(f(np.real(self.omega)), X[ix]) for f, X in reduced.base_laws]
        self._linear: list[tuple[int, float, ReducedTerm]] = []
        self._scaled: list[_ScaledEffect] = []
        self._nonlinear: list[tuple[Effect, list[int], list[int]]] = []
        for name, effect in effects.items():
            rows = wanted.get(name, [])
            known = {p.name: p for p in effect.parameters()}
            free = [known[self.refs[i][1]] for i in rows]
            known_refs = effect.refers_to(reduced.model)
            in_series = effect.gives_way and effect.refers_to(self._series) != known_refs
            if in_series:
                known_refs = effect.refers_to(self._series)
            foreign = [i for i, ref in enumerate(self.refs) if ref in known_refs]
            linear = all(p.linear for p in free) and not foreign and not in_series
            if name in candidate_names and linear:
                self._add_fixed(reduced.value_of(effect), 1.0)
            if linear:
                for i, p in zip(rows, free, strict=True):
                    term = (
                        reduced.derivative_of(effect, p.name, p.value)
                        if name in candidate_names
                        else reduced.linear(effect, p.name, p.value)
                    )
                    self._linear.append((i, p.value, self.restrict(term)))
                continue
            if name not in candidate_names:
                self._add_fixed(reduced.base[name], -1.0)
            scaled = None if in_series else self._as_scaled(effect, rows, free, foreign)
            if scaled is None:
                self._nonlinear.append((effect, rows, foreign))
            else:
                self._scaled.append(scaled)
        self._together = self._linear_together()
        self._n = n
        self._damped: dict[bool, Floats] = {}
        # A step that is tried without derivatives is often asked for them next.
        self._last: (
            tuple[bytes, ModalSolution, Complexes, dict[str, Any], list[ReducedTerm], Complexes] | None
        )
        self._last = None
        self._anchor: tuple[Floats, dict[str, Any], list[ReducedTerm]] | None = None
        # Matrices and their slopes are asked for at the same values, one after the other.
        self._followed = Unsent(1)

    def _linear_together(self) -> list[tuple[list[int], Floats, list[ReducedTerm]]]:
        """Return the rows, nominal values and slopes of linear parameters, those at one place together.

        Their terms there are summed over few DOFs before they are spread over the basis.
        """
        groups: dict[Any, list[tuple[int, float, ReducedTerm]]] = {}
        for i, start, term in self._linear:
            alone = term.L is None or bool(term.laws)
            groups.setdefault(i if alone else (term.place, term.connection), []).append((i, start, term))
        together = (zip(*group, strict=True) for group in groups.values())
        return [(list(rows), np.array(starts), list(terms)) for rows, starts, terms in together]

    def _as_scaled(
        self, effect: Effect, rows: Sequence[int], free: Sequence[Parameter], foreign: Sequence[int]
    ) -> _ScaledEffect | None:
        """Return an effect whose matrices are only multiplied by parameters of others; None for another."""
        known, nominal = [], self.reduced.nominal
        follows = self.reduced.follows(effect) if foreign else ()
        followed = tuple(i for i in foreign if self.refs[i] in follows)
        for i in foreign:
            if i in followed:
                continue
            exponents = self.reduced.scaling_of(effect, self.refs[i])
            if exponents is None:
                return None
            known.append((i, nominal[self.refs[i]], exponents))
        parameters = tuple((i, p.value) for i, p in zip(rows, free, strict=True))
        start = slopes = None
        if all(p.linear for p in free) and not followed:
            start = self.restrict(self.reduced.value_of(effect))
            slopes = [self.restrict(self.reduced.derivative_of(effect, p.name, p.value)) for p in free]
            if not all(np.array_equal(start.dofs, s.dofs) for s in slopes):  # type: ignore[arg-type]
                start = slopes = None
        return _ScaledEffect(effect, parameters, tuple(known), followed, start, slopes)

    def damped_range(self, zeta: Floats, now: Sequence[ReducedTerm]) -> Floats | None:
        """Return an orthonormal basis (r, k) of the range of local damping and laws at any values.

        None where it depends on the values; ``now`` are the terms of :meth:`matrices` there.
        """
        connections = zeta.ndim > 1
        moving = [t for s, t in zip(self._scaled, now, strict=False) if s.start is None]
        if any(t.damps(connections) for t in (*moving, *now[len(self._scaled) :])):
            return None
        if connections in self._damped:
            return self._damped[connections]
        terms = [term for _, _, term in self._linear]
        terms += [term for s in self._scaled for term in (s.start, *(s.slopes or ())) if term is not None]
        damping = [self._fixed["C"], self._fixed["D"], *(X for _, X in self._fixed["laws"])]
        damping += [t.dense(key) for t in terms for key in "CD" if getattr(t, key) is not None]
        damping += [t.spread(X) for t in terms for _, X in t.laws]
        if connections:
            stiff = [t.dense("K") for t in terms if t.connection and t.K is not None]
            damping += [self._fixed["connections"], *stiff]
        U = range_of(damping)
        self._damped[connections] = np.zeros((self._n, 0)) if U is None else U
        return self._damped[connections]

    def restrict(self, term: ReducedTerm) -> ReducedTerm:
        """Return a term on the active coordinates, without those of constraints that hold."""
        if self._all_active:
            return term
        if term.L is not None:
            return replace(term, L=term.L[:, self.active])
        ix = np.ix_(self.active, self.active)
        K, M, C, D = (None if X is None else X[ix] for X in (term.K, term.M, term.C, term.D))
        laws = tuple((f, X[ix]) for f, X in term.laws)
        return replace(term, K=K, M=M, C=C, D=D, laws=laws)

    def _add_fixed(self, term: ReducedTerm, factor: float) -> None:
        term = self.restrict(term)
        self.add(self._fixed, term, factor)

    def add(self, total: dict[str, Any], term: ReducedTerm, factor: float) -> None:
        """Add a multiple of a term to sums of matrices; arrays in ``total`` are replaced, never changed."""
        for key in "KMCD":
            X = getattr(term, key)
            if X is None or not X.any():
                continue
            more = factor * term.spread(X)
            total[key] = total[key] + more
            if key == "K" and term.connection:
                total["connections"] = total["connections"] + more
        total["laws"] = total["laws"] + [
            (factor * f(np.real(self.omega)), term.spread(X)) for f, X in term.laws
        ]

    def _following(self, values: Floats) -> list[tuple[Effect, Model, list[int], list[int]]]:
        """Return the effects of ``_nonlinear``, and the models that they refer to, at some values."""
        out: list[tuple[Effect, Model, list[int], list[int]]]
        out = self._followed.get(values.tobytes(), lambda: self._followed_at(values))
        return out

    def _followed_at(self, values: Floats) -> list[tuple[Effect, Model, list[int], list[int]]]:
        every = {i for _, rows, others in self._nonlinear for i in (*rows, *others)}
        at = {self.refs[i]: float(values[i]) for i in every}

        def there(model: Model) -> Model:
            names = {e.name for e in model.effects}
            known = {ref: value for ref, value in at.items() if ref[0] in names}
            return model.with_values(known) if known else model

        model = series = there(self.reduced.model)
        if any(effect.gives_way for effect, _, _ in self._nonlinear):
            series = there(self._series)
        # What a model has already is asked for by those in series with it.
        known = {e.name: e for e in series.effects}
        return [
            (known.get(e.name) or self._now(e, rows, values), series if e.gives_way else model, rows, others)
            for e, rows, others in self._nonlinear
        ]

    def anchor(self, values: Floats) -> None:
        """Keep the sums of all matrices at some values: near them only the terms that differ are added.

        For sweeps of one parameter after another. The sums differ from those without it by rounding.
        """
        self._anchor = None
        values = np.array(values, dtype=float)
        self._anchor = (values, *ParametricFRF.matrices(self, values))

    def _matrices_near(
        self, values: Floats, there: Floats, sums: dict[str, Any], known: list[ReducedTerm]
    ) -> tuple[dict[str, Any], list[ReducedTerm]]:
        """Return the results of :meth:`matrices` from those ``there``, where no effect is ``_nonlinear``."""
        total, alone, moved = dict(sums), list(known), values != there
        for rows, _, terms in self._together:
            if moved[rows].any():
                self.add(total, combined(terms, values[rows] - there[rows]), 1.0)
        for k, scaled in enumerate(self._scaled):
            rows = [i for i, *_ in (*scaled.parameters, *scaled.foreign)]
            if not moved[[*rows, *scaled.followed]].any():
                continue
            alone[k] = self._term_of(scaled, values)
            for term, at, sign in ((known[k], there, -1.0), (alone[k], values, 1.0)):
                self.add(total, term.scaled(scaled.factors(at)) if scaled.foreign else term, sign)
        return total, alone

    def _beside(self, scaled: _ScaledEffect, values: Floats) -> dict[ParameterRef, float]:
        """Return the values of the parameters of others that an effect follows."""
        return {self.refs[i]: float(values[i]) for i in scaled.followed}

    def _term_of(self, scaled: _ScaledEffect, values: Floats) -> ReducedTerm:
        """Return the term of an effect before parameters of others multiply it."""
        term = scaled.start
        if term is None:
            now = self._now(scaled.effect, scaled.rows, values)
            return self.restrict(self.reduced.value_of(now, beside=self._beside(scaled, values)))
        for (i, begin), slope in zip(scaled.parameters, scaled.slopes or (), strict=False):
            term = term.plus(slope, values[i] - begin)
        return term

    def matrices(self, values: Floats) -> tuple[dict[str, Any], list[ReducedTerm]]:
        """Return the sums of all matrices; and the terms of ``_scaled``, not scaled, and ``_nonlinear``."""
        if self._anchor is not None and not self._nonlinear:
            return self._matrices_near(values, *self._anchor)
        total, alone = dict(self._fixed), []
        for rows, starts, terms in self._together:
            self.add(total, combined(terms, values[rows] - starts), 1.0)
        for scaled in self._scaled:
            term = self._term_of(scaled, values)
            self.add(total, term.scaled(scaled.factors(values)) if scaled.foreign else term, 1.0)
            alone.append(term)
        for now, model, _, _ in self._following(values):
            alone.append(self.restrict(self.reduced.value_of(now, model)))
            self.add(total, alone[-1], 1.0)
        return total, alone

    def with_mass(self, motions: Floats, mass: float) -> "ParametricFRF":
        """Return the same with a mass [kg] that moves with combinations (r + p, 3) of the basis's columns."""
        out, E = copy(self), motions[self.active]
        out._fixed = {**self._fixed, "M": self._fixed["M"] + mass * (E @ E.T)}
        out._last = out._anchor = None
        return out

    def solve(self, values: Floats, zeta: Floats) -> tuple[ModalSolution, dict[str, Any], list[ReducedTerm]]:
        """Return the state at some values, and the results of :meth:`matrices` there."""
        total, alone = self.matrices(values)
        damped = self.damped_range(zeta, alone)
        losses = self.losses(values)
        state = ModalSolution.of(self.reduced, total, self.omega, zeta, damped, losses, viscous=self.viscous)
        return state, total, alone

    def losses(self, values: Floats) -> Floats | None:
        """Return small losses X, (r, r), that are not among the matrices and add i X to Z; None without."""
        return None

    def ends(self, values: Floats) -> tuple[Floats, Floats]:
        """Return outputs (r, n_out) and inputs (r, n_in) at some values."""
        return self.outputs, self.inputs

    def slopes(self, values: Floats, alone: Sequence[ReducedTerm]) -> list[tuple[int, ReducedTerm]]:
        """Return the derivatives of the matrices; ``alone`` are the terms of :meth:`matrices` there."""
        return [*((i, term) for i, _, term in self._linear), *self.moving_slopes(values, alone)]

    def moving_slopes(self, values: Floats, alone: Sequence[ReducedTerm]) -> list[tuple[int, ReducedTerm]]:
        """Return those of the :meth:`slopes` that depend on the values."""
        slopes: list[tuple[int, ReducedTerm]] = []
        for scaled, term in zip(self._scaled, alone, strict=False):
            factors, now = scaled.factors(values), self._now(scaled.effect, scaled.rows, values)
            beside = self._beside(scaled, values)
            for k, i in enumerate(scaled.rows):
                slope = (
                    scaled.slopes[k]
                    if scaled.slopes is not None
                    else self.restrict(
                        self.reduced.derivative_of(now, self.refs[i][1], float(values[i]), beside=beside)
                    )
                )
                slopes.append((i, slope.scaled(factors) if scaled.foreign else slope))
            refs = [self.refs[i] for i in scaled.followed]
            for i, slope in zip(
                scaled.followed, self.reduced.followed_derivatives_of(now, refs), strict=True
            ):
                slopes.append((i, self.restrict(slope.scaled(factors) if scaled.foreign else slope)))
            for i, _, exponents in scaled.foreign:
                by = {key: n * factors[key] / float(values[i]) for key, n in exponents.items()}
                slopes.append((i, term.scaled(by)))
        stepped: dict[tuple[Model, int], Model] = {}
        for now, model, rows, others in self._following(values):
            for i in rows:
                term = self.reduced.derivative_of(now, self.refs[i][1], float(values[i]), model)
                slopes.append((i, self.restrict(term)))
            for i in others:
                # effects in series share what one of them is in the model with this step
                if (model, i) not in stepped:
                    stepped[model, i] = model.with_values({self.refs[i]: float(values[i]) + 1j * STEP})
            each = self.reduced.slopes_in(now, model, {self.refs[i]: stepped[model, i] for i in others})
            slopes += zip(others, map(self.restrict, each), strict=True)
        return slopes

    def _now(self, effect: Effect, rows: Sequence[int], values: Floats) -> Effect:
        return effect.with_values(**{self.refs[i][1]: float(values[i]) for i in rows})

    def evaluate(
        self, values: Floats, zeta: Floats, gradient: bool = True
    ) -> tuple[Complexes, Complexes | None, Complexes | None]:
        """Compute receptances and derivatives.

        Z = K (1 + i (η + 2ζ(ω)) + iωβ) + iD + iωC + iωα M - ω²M, with the model's η, α, β; dH = -Hₒ dZ Hᵢ.
        The stiffness of connections, a part of K, may have another ζ.

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
            state, total, alone = self.solve(values, zeta)
            Xi = state.solve(self.ends(values)[1])
            self._last = (at, state, Xi, total, alone, self.read(values, state, Xi))
        _, state, Xi, total, alone, H = self._last
        if not gradient:
            return self.referred(H), None, None
        dH, by_zeta = self._derivatives(values, zeta, state, Xi, total, alone)
        return self.referred(H), self.referred_slopes(dH, H), self.referred_slopes(by_zeta, H)

    def slopes_of(self, values: Floats, zeta: Floats, units: Floats) -> tuple[Complexes, FrfSlopes]:
        """Return the receptances, and their derivatives by the parameters and, behind them, by ζ.

        Parameters
        ----------
        values, zeta : ndarray
            As of :meth:`evaluate`.
        units : ndarray (n_par,)
            Changes of the parameters that count as 1.
        """
        H, dH, by_zeta = self.evaluate(values, zeta)
        assert dH is not None
        assert by_zeta is not None
        dH = dH * units[:, None, None, None]
        every = np.concatenate([dH, by_zeta.reshape(-1, *H.shape)]).swapaxes(1, 2).astype(np.complex64)
        nothing = np.zeros((0, *H.shape[::2]), dtype=np.complex64)
        return H, FrfSlopes(every, len(every), np.zeros(0, dtype=np.int64), nothing)

    def referred(self, H: Complexes) -> Complexes:
        """Return what is read of the receptances of all outputs: themselves without references."""
        return H if self.references is None else self.references.read(H, self.omega)

    def referred_slopes(self, dH: NDArray[Any], H: Complexes) -> NDArray[Any]:
        """Return the derivatives (…, n_freq, n_out, n_in) of what is read, by those of the receptances."""
        return dH if self.references is None else self.references.slopes(dH, H, self.omega)

    def read(self, values: Floats, state: ModalSolution, Xi: Complexes) -> Complexes:
        """Return the receptances (n_freq, n_out, n_in) of a state with the responses Xi to the inputs."""
        return np.moveaxis(times((state.V.T @ self.ends(values)[0]).T, Xi), 2, 0)

    def _derivatives(
        self,
        values: Floats,
        zeta: Floats,
        state: ModalSolution,
        Xi: Complexes,
        total: Mapping[str, Any],
        alone: Sequence[ReducedTerm],
    ) -> tuple[Complexes, Complexes]:
        """Return dH by the parameters and by ζ, from the results of :meth:`solve`."""
        n_par, connections = len(self.refs), zeta.ndim > 1
        everywhere, places = self._slope_forces(self.slopes(values, alone), state, Xi)
        everywhere[n_par] = state.by_zeta[:, None] * Xi
        if connections and state.U is not None and state.U_connections is not None:
            everywhere[n_par + 1] = 2j * times(state.U @ state.U_connections, times(state.U.T, Xi))
        moved, Ho = state.read(self.outputs, _side_by_side(everywhere), [P for P, _ in places])
        shape = (len(self.omega), self.outputs.shape[1], Xi.shape[1])
        slopes = np.zeros((n_par + (2 if connections else 1), *shape), dtype=complex)
        for i, product in zip(everywhere, np.split(moved, len(everywhere), axis=2), strict=True):
            slopes[i] -= product
        for (_, forces), h in zip(places, Ho, strict=True):
            products = h @ lines_first(_side_by_side(forces))
            for i, product in zip(forces, np.split(products, len(forces), axis=2), strict=True):
                slopes[i] -= product
        dH, by_zeta = slopes[:n_par], slopes[n_par:]
        if not connections:
            return dH, by_zeta[0]
        by_zeta[0] -= by_zeta[1]  # all but the connections are damped as members
        return dH, by_zeta

    def factors(self, state: ModalSolution) -> dict[str, NDArray[Any]]:
        """Return the factors of K, M, C and D in Z, each (n_freq,)."""
        omega = self.omega
        return {
            "K": state.stiffness,
            "connections": state.connections,
            "M": state.mass,
            "C": 1j * omega,
            "D": np.full(len(omega), 1j),
        }

    def _slope_forces(
        self, slopes: Sequence[tuple[int, ReducedTerm]], state: ModalSolution, Xi: Complexes
    ) -> tuple[_Forces, list[tuple[Floats, _Forces]]]:
        """Return dZ Hᵢ of the parameters: of those that act everywhere, in modal coordinates, and at places.

        With each place stand the motions along which its forces act, (r, m), in modal coordinates. Where
        a place has few forces and many motions it costs less to take them as forces that act everywhere.
        """
        factors, n_out, n_in = self.factors(state), self.outputs.shape[1], Xi.shape[1]
        everywhere: _Forces = {}
        groups: dict[bytes, list[tuple[int, ReducedTerm]]] = {}
        places = []
        for i, term in slopes:
            if term.L is not None:
                groups.setdefault(term.L.tobytes(), []).append((i, term))
                continue
            for factor, X in term.parts(factors, self.omega):
                _add_to(everywhere, i, factor * times(state.V.T @ X @ state.V, Xi))
        for group in groups.values():
            L: Any = group[0][1].L
            P, forces = (L @ state.V).T, {}
            ui = times(P.T, Xi)
            for i, term in group:
                for factor, X in term.parts(factors, self.omega):
                    _add_to(forces, i, factor * times(X, ui))
            n, m, damped = n_in * len(forces), P.shape[1], 0 if state.U is None else state.U.shape[1]
            if (n_out + damped) * m < n * (n_out + damped + m):
                places.append((P, forces))
                continue
            for i, force in forces.items():
                _add_to(everywhere, i, times(P, force))
        return everywhere, places
