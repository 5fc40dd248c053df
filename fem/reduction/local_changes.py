"""Changes at few DOFs of a solved state, by low-rank updates.

The cost of a candidate effect depends on its few DOFs only.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.array_types import Complexes, Floats
from fem.model import Contribution, Effect, ParameterRef
from fem.recent import Recent
from fem.reduction.modal_solution import ModalSolution, times
from fem.reduction.parametric_frf import ParametricFRF
from fem.reduction.series import terms_in_series
from fem.reduction.terms import ReducedTerm, law_parts, motions_of

_PLACES = 16
"""Places whose responses are kept for further changes."""


@dataclass(frozen=True, slots=True, eq=False)
class _Place:
    """Motions at a few DOFs, and responses to forces along them.

    A matrix X on the DOFs is S x Sᵀ with S = ``motions`` (m, k) and x = ``inverse`` X ``inverse``ᵀ; ``scale``
    (m,) makes metres and radians alike. ``outputs`` (n_freq, n_out, k) are Hₒ, ``both`` (k, k + n_in, n_freq)
    G and Hᵢ side by side.
    """

    motions: Floats
    inverse: Floats
    scale: Floats
    outputs: Complexes
    both: Complexes

    def holds(self, X: Floats) -> bool:
        """Whether a matrix acts on these motions alone."""
        P, size = self.motions @ self.inverse, np.outer(self.scale, self.scale)
        return bool(np.abs((P @ X @ P.T - X) / size).max() <= 1e-12 * np.abs(X / size).max())


@dataclass(frozen=True, slots=True, eq=False)
class Fields:
    """Responses at all DOFs to unit forces at outputs and inputs.

    Attributes
    ----------
    outputs, inputs : ndarray (n_dof, n_out, n_freq), (n_dof, n_in, n_freq)
    omega : ndarray (n_freq,)
        Angular frequencies [rad/s].
    factors : dict
        Factors of K, of that of connections, of M, C and D in Z, each (n_freq,).
    read : callable
        Takes slopes of the receptances of all outputs to those of what is read of them.
    """

    outputs: Complexes
    inputs: Complexes
    omega: NDArray[Any]
    factors: dict[str, NDArray[Any]]
    read: Callable[[Complexes], Complexes]

    def slope(self, contributions: Sequence[Contribution], connection: bool = False) -> Complexes:
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
                parts += law_parts(c, imaginary=False)
            force = np.zeros_like(moved)
            for factor, X in parts:
                if X is None or not X.any():
                    continue
                value: Any = factor(np.real(self.omega)) if callable(factor) else factor
                force += value * (X @ moved.reshape(b, m, -1)).reshape(moved.shape)
            outward = self.outputs[c.dofs].reshape(b * m, n_out, n_freq).transpose(2, 1, 0)
            out -= outward @ force.reshape(b * m, n_in, n_freq).transpose(2, 0, 1)
        return self.read(out)


@dataclass(slots=True, eq=False)
class LocalChanges:
    """A solved state to which effects that touch few DOFs are added by low-rank updates.

    Attributes
    ----------
    engine : ParametricFRF
    state : ModalSolution
    Xo, Xi : ndarray (r, n, n_freq)
        Responses to unit forces at outputs and inputs.
    every : ndarray (n_freq, n_all, n_in)
        Receptances of all outputs without the effects, references included.
    total : dict
        Reduced matrices without the effects.
    zeta : ndarray (n_freq,) or (2, n_freq)
        Damping ratio at each line, and that of connections if it is another [-].
    damped : ndarray (r, k) or None
        Basis of the motions that local damping acts on, if known beforehand.
    values : mapping of (effect, parameter) to float
        Of the engine's parameters.
    """

    engine: ParametricFRF
    state: ModalSolution
    Xo: Complexes
    Xi: Complexes
    every: Complexes
    total: dict[str, Any]
    zeta: Floats
    damped: Floats | None
    values: Mapping[ParameterRef, float] = field(default_factory=dict)
    # By the place of a term: changes are tried in series at one place, also in later calls.
    _places: Recent = field(default_factory=lambda: Recent(_PLACES), init=False, repr=False)

    @classmethod
    def of(cls, engine: ParametricFRF, values: Floats, zeta: Floats) -> "LocalChanges":
        """Solve once, so that many changes at few DOFs can be tried at little cost each.

        Parameters
        ----------
        engine : ParametricFRF
        values : ndarray (n_par,)
            Values of the engine's parameters.
        zeta : ndarray (n_freq,) or (2, n_freq)
            Damping ratio at each line, and that of connections if it is another [-].
        """
        state, total, terms = engine.solve(np.asarray(values, dtype=float), zeta)
        damped = engine.damped_range(zeta, terms)
        Xo, Xi = state.solve(engine.outputs, transposed=True), state.solve(engine.inputs)
        H = np.moveaxis(times((state.V.T @ engine.outputs).T, Xi), 2, 0)
        at = dict(zip(engine.refs, map(float, values), strict=True))
        return cls(engine, state, Xo, Xi, H, total, zeta, damped, at)

    @property
    def H(self) -> Complexes:
        """What is read without the effects, (n_freq, n_out, n_in)."""
        return self.engine.referred(self.every)

    def slopes_read(self, slopes: Complexes) -> Complexes:
        """Return the slopes (…, n_freq, n_out, n_in) of what is read by those of all receptances."""
        return self.engine.referred_slopes(slopes, self.every)

    def fields(self) -> Fields:
        """Return the responses at all DOFs of the full model: slopes are had from them without projecting."""
        modes = self.engine.reduced.basis.T[:, self.engine.active] @ self.state.V
        factors = self.engine.factors(self.state)
        moved = times(modes, self.Xo), times(modes, self.Xi)
        return Fields(*moved, self.engine.omega, factors, self.slopes_read)

    def violations(self) -> tuple[list[tuple[str, str]], Complexes]:
        """Return the keys of the constraints that hold, and the outputs' responses to unit violations.

        Shape (n_constraints, n_out, n_freq): the response to the motion that a constraint prescribes, with
        nominal stiffness and mass; only their ratio matters for its shape.
        """
        engine, basis = self.engine, self.engine.reduced.basis
        active = engine.active
        columns = [n for n in range(basis.n_main, basis.T.shape[1]) if n not in active]
        keys = [basis.keys[n - basis.n_main] for n in columns]
        total, factors = engine.reduced.base_sum, engine.factors(self.state)
        moved = engine.outputs_on_basis[columns]
        out = np.broadcast_to(moved[:, :, None], (*moved.shape, len(engine.omega))).astype(complex)
        for key in "KM":
            rows = self.state.V.T @ total[key][active][:, columns]
            out = out - factors[key] * times(rows.T, self.Xo)
        return keys, out

    def receptances(self, effects: Sequence[Effect]) -> list[Complexes]:
        """Return the receptances with each of some effects added, one at a time.

        H' = H - Hₒ (I + ΔZ G)⁻¹ ΔZ Hᵢ, with G the receptance of the motions that the effect resists: six for
        a joint. For an effect that touches too many DOFs the eigenproblem is solved anew.
        """
        return self.with_terms([self._term(effect) for effect in effects])

    def _term(self, effect: Effect) -> ReducedTerm:
        """Return what an effect adds to the state."""
        engine = self.engine
        in_series = terms_in_series(engine.reduced, [effect], engine.candidates, self.values)
        return engine.reduced.value_of(effect) if in_series is None else in_series[0]

    def with_terms(self, terms: Sequence[ReducedTerm]) -> list[Complexes]:
        """Return the same for effects that are projected already.

        Terms at the same place share Hₒ, Hᵢ and G, also in later calls, and are solved for together. A term
        that takes away more mass than there is has no receptances: they are NaN.
        """
        out = [self.every] * len(terms)
        factors = self.engine.factors(self.state)
        groups: dict[Any, list[tuple[int, list[tuple[NDArray[Any], NDArray[Any]]]]]] = {}
        rows: dict[Any, ReducedTerm] = {}
        for i, full in enumerate(terms):
            term = self.engine.restrict(full)
            parts = term.parts(factors, self.engine.omega)
            if not parts:
                continue
            if term.L is None:
                try:
                    out[i] = self._anew(term)
                except np.linalg.LinAlgError:  # the mass matrix is not positive definite
                    out[i] = np.full_like(self.every, np.nan)
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
                    A[:, :, g] += factor * times(place.inverse @ X @ place.inverse.T, place.both)
            A[np.arange(k), np.arange(k)] += 1
            w = _solve_lines(A.reshape(k, wide, -1)).reshape(k, wide - k, len(group), n_freq)
            n_in = wide - k
            w = np.ascontiguousarray(w.transpose(3, 0, 2, 1)).reshape(n_freq, k, -1)
            change = (place.outputs @ w).reshape(n_freq, -1, len(group), n_in)
            for g, (i, _) in enumerate(group):
                out[i] = self.every - change[:, :, g]
        return [self.engine.referred(H) for H in out]

    def _anew(self, term: ReducedTerm) -> Complexes:
        engine, total = self.engine, dict(self.total)
        engine.add(total, term, 1.0)
        damped = None if term.damps(self.zeta.ndim > 1) else self.damped
        state = ModalSolution.of(
            engine.reduced, total, engine.omega, self.zeta, damped, viscous=engine.viscous
        )
        return np.moveaxis(times((state.V.T @ engine.outputs).T, state.solve(engine.inputs)), 2, 0)

    def _place(self, term: ReducedTerm, matrices: list[Floats]) -> _Place:
        """Return the responses at the motions that a term's matrices act on (computed once).

        The flexibility of the structure that the basis lacks is added there.
        """
        L, dofs = term.L, term.dofs
        assert L is not None
        assert dofs is not None
        key = term.place
        known = self._places.find(key)
        if known is not None and all(known.holds(X) for X in matrices):
            return known
        if known is not None:
            matrices = [*matrices, known.motions @ known.motions.T]
        motions, inverse, scale = motions_of(matrices)
        # Of more motions than this at a place, those are kept that forces at inputs and outputs bring about
        if motions.shape[1] > 12:
            motions, inverse = self._brought_about(L, motions, inverse, matrices)
        Lm = motions.T @ L @ self.state.V
        G = times(Lm, self.state.solve((motions.T @ L).T))
        R = self.engine.reduced.residual_flexibility(dofs, motions)
        if R is not None:
            G = G + R[:, :, None] / (term.stiffer * self.state.stiffness)
        both = np.concatenate([G, times(Lm, self.Xi)], axis=1)
        outputs = np.ascontiguousarray(times(Lm, self.Xo).transpose(2, 1, 0))
        return self._places.put(key, _Place(motions, inverse, scale, outputs, both))

    def _brought_about(
        self, L: Floats, motions: Floats, inverse: Floats, matrices: list[Floats]
    ) -> tuple[Floats, Floats]:
        """Return fewer motions: of a stretch of a beam its bending as one beam, not that of each element.

        With X the sum of the matrices, each scaled to 1, and U the responses at the place to the forces at
        inputs and outputs, X is replaced by X U (Uᵀ X U)⁻¹ Uᵀ X.
        """
        small = [inverse @ X @ inverse.T for X in matrices]
        values, vectors = np.linalg.eigh(sum(np.sign(np.trace(x)) * x / np.abs(x).max() for x in small))
        C = vectors * np.sqrt(np.maximum(np.abs(values), 1e-12 * np.abs(values).max()))
        LV = motions.T @ L @ self.state.V
        responses = np.concatenate([times(LV, self.Xi), times(LV, self.Xo)], axis=1)
        strain = C.T @ responses.reshape(len(LV), -1).view(float)
        energy, directions = np.linalg.eigh(strain @ strain.T)
        # Motions with less than this share of the strongest one's energy are left out
        P = directions[:, energy > 1e-9 * energy[-1]]
        onto: Any = np.linalg.solve(C, inverse)
        return motions @ C @ P, P.T @ onto


def _solve_lines(A: Complexes) -> Complexes:
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
