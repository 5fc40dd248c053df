"""Fits of a reduced model to measured modes: what varies is what varies in fits to FRFs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from fem.analysis.modes import n_unstable, solve_eigenpairs
from fem.array_types import Bools, Complexes, Floats, Ints
from fem.model import Effect, ParameterRef, parameter_values
from fem.reduction.parametric_modes import DampedMode, ModesAt, ModeStack, ParametricModes, frequency_of
from fem.reduction.reduced_model import ReducedModel
from fem.reduction.terms import ReducedTerm
from fem.system import assemble
from updating.inference.bases import BASIS_SHARE
from updating.inference.belief import DISCREPANCY_MAX, FORM_DAMPING
from updating.inference.calibrated_errors import CalibratedErrors
from updating.inference.carried_modes import CarriedModes
from updating.inference.defaults import BASIS_LINES, EXPLAINED_LEVEL
from updating.inference.fit_data import sensor_vectors
from updating.inference.fit_function import Errors, FitFunction, propagated
from updating.inference.fit_result import FitResult, fitted_model
from updating.inference.mode_changes import ModeChanges
from updating.inference.mode_targets import (
    ALIEN_WIDTH,
    FAR,
    LEAST_MAC,
    SPREAD_BEFORE,
    ComputedModes,
    Matched,
    ModeTargets,
    match,
    match_each,
)
from updating.inference.problem import Problem
from updating.inference.solve import Solution
from updating.inference.unknowns import by_unknowns, values_at
from updating.inference.visible_modes import visible_modes
from updating.least_squares.mode_levels import ModeLevels

FREQUENCY, DAMPING, SHAPE = 0, 1, 2
"""Kinds of residuals: ln f, ln ζ, and components of shapes in parts of their root mean square."""
LARGEST_DISCREPANCY = np.array([0.01, 0.6, 0.1])
"""Largest plausible size of what the model leaves of each, for the default ``model_error`` [-]."""
LEAST_DISCREPANCY = np.array([0.0, FORM_DAMPING, 0.0])
"""The least. No theory of frames says how single modes are damped, however right it is: joints dissipate
otherwise from mode to mode, and after each assembly (Segalman et al., *Handbook on Dynamics of Jointed
Structures*, SAND2009-4164)."""

BAD_PRIOR = 0.015
"""Prior probability that a frequency, damping ratio or shape does not belong to the structure's model [-]."""
BAD_STD = np.array([ALIEN_WIDTH, 1.0, 1.0])
"""Standard deviations of ln f, ln ζ and components of a shape that do not belong, as of another mode [-]."""
DOUBT = 0.01
"""Probability from which on a reading may be a bad one [-]."""
HIGHEST = 1.2
"""Modes up to this multiple of the highest measured frequency join the basis of a fit [-]."""

Partners = list[tuple[int, int, DampedMode] | None]
"""Measured mode, computed mode and that with its damping, None for one without a partner."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ModeProblem(Problem[ModeTargets]):
    """Everything that a fit to modes needs but the candidates.

    What frame theory leaves of frequencies and shapes grows in proportion to the model's error.

    Attributes
    ----------
    calibrated : CalibratedErrors or None
        Errors of what was fitted to another state: they vary in every fit, behind damping.
    carried : CarriedModes or None
        What the model misses of another state's modes, and of these as far as they are the same.
    bad_prior : float
        Probability that a reading does not belong to the structure's model, whatever that is [-].
    mass : float
        Of the structure; NaN where modes that hardly move the sensors count as seen [kg].
    """

    calibrated: CalibratedErrors | None = None
    carried: CarriedModes | None = None
    bad_prior: float = 0.0
    mass: float = np.nan

    @property
    def targets(self) -> ModeTargets:
        """The measured modes."""
        return self.data

    @property
    def measured_words(self) -> str:
        """The kind of data, in the singular."""
        return "measured mode"

    def error_words(self, result: FitResult) -> str:
        """Return the error of a fit in words, in the unit of the report."""
        return f"error of the natural frequencies {100 * result.level:.2g} %"

    @property
    def measured_modes(self) -> ModeTargets:
        """The measured modes."""
        return self.data

    @property
    def stages(self) -> Floats:
        """Factors by which the data are taken for less accurate one fit after the other, the last 1.

        A precise test allows no step on which the modes of two neighbours change places: fits begin with
        deviations that are no smaller than those of the model.
        """
        # Relative deviation of frequencies that a fair model has before a fit [-]
        return np.array([np.hypot(1.0, 0.01 / self.targets.noise_level), 1.0])

    def at_stage(self, factor: float) -> ModeProblem:
        """Return the problem with deviations that are larger by a factor.

        All readings belong there: far from the data any may seem bad, and a bad one moves nothing.
        """
        return self if factor == 1 else replace(self.believed, data=self.data.with_deviations(factor))

    @property
    def believed(self) -> ModeProblem:
        """The problem with every reading believed, for models that may be far from the data."""
        return replace(self, bad_prior=0.0) if self.bad_prior else self

    @property
    def spread(self) -> Floats:
        """Standard deviation of ln f by which modes find their partners in order, (n,) [-].

        That of the fit, where a reading may be a bad one; else that of models before it.
        """
        if not self.bad_prior:
            return np.full(self.targets.n, SPREAD_BEFORE)
        return np.sqrt(self.targets.frequency_std**2 + self.discrepancy[FREQUENCY] ** 2 + self.mesh_level**2)

    @property
    def log_density(self) -> float:
        """Logarithm of the density that deviations give the residuals [nats].

        By so much log likelihoods differ between two problems of the same modes, up to a constant.
        """
        return self.function((), (), self.targets.fitted).log_density

    @property
    def discrepancy(self) -> Floats:
        """Largest plausible size of what the form leaves of frequencies, damping and shapes, (3,) [-]."""
        share = np.full(len(LARGEST_DISCREPANCY), self.model_error / EXPLAINED_LEVEL)
        share[DAMPING] = 1.0
        return LARGEST_DISCREPANCY * share

    def lines_up_to(self, frequency: float, n_lines: int) -> Ints:
        """Return the modes that are fitted, all of them: there are few."""
        return self.targets.fitted

    def parametric(
        self,
        modes: Ints,
        refs: Sequence[ParameterRef] = (),
        effects: Sequence[Effect] = (),
        release: Sequence[tuple[str, str]] = (),
    ) -> ParametricModes:
        """Return the model's modes as a function of parameters, for some of the measured ones."""
        f, carried = self.targets.frequency[modes], self.carried and self.carried.terms(self.reduced, refs)
        return ParametricModes(self.reduced, self.outputs(), f, refs, effects, release, carried)

    def outputs(self) -> Floats:
        """Return the motions of the sensors by the basis's columns, (r, n_out); none without shapes."""
        sensors = self.targets.sensors
        out = self.reduced.projected(sensors, partial(sensor_vectors, self.reduced.model, sensors))[1]
        if not self.targets.has_shapes:
            return out[:, :0]
        return out if self.carried is None else out + self.carried.outputs(self.reduced)

    def seen(self, at: ModesAt) -> Bools:
        """Return which computed modes the test could have measured."""
        pairs, n_basis = at.pairs(0), self.reduced.basis.T.shape[1]
        vectors = at.columns[:n_basis] @ pairs.vectors
        one = pairs.eigenvalues[None], np.array([pairs.n_rigid]), vectors[None]
        return visible_modes(self.reduced, self.targets, self.mass, *one)[0]

    def function(
        self, effects: Sequence[Effect], starts: Sequence[dict[str, float]], lines: Ints
    ) -> ModeFunction:
        """Return the residuals of some measured modes as a function of all that varies."""
        out = ModeFunction(self, tuple(effects), *self.unknowns(effects, starts), lines)
        if self.calibrated is None:
            return out
        return out.with_scatter(self.calibrated.without({ref for e in effects for ref in e.replaces()}))

    def residuals(
        self,
        effects: Sequence[Effect] = (),
        starts: Sequence[dict[str, float]] = (),
        stage: float | None = None,
        n_lines: int | None = None,
    ) -> ModeFunction:
        """Return the residuals of all modes, whose deviations are larger by the factor of a stage."""
        return self.at_stage(1.0 if stage is None else stage).function(effects, starts, self.data.fitted)

    def changes_at(self, base: FitResult, n_full: int | None, n_low: int, most: int) -> ModeChanges:
        """Return what effects added to a fitted model do to its modes, all of those that are fitted."""
        return ModeChanges.of(self, base)

    def surroundings(self, key: tuple[str, str]) -> float:
        """Return the median impedance of the structure to motion along a released constraint [N/m, N·m/rad].

        Over the band of the measured modes.
        """
        f = self.targets.frequency
        return self.reduced.impedance(key, (2 * np.pi * np.linspace(f[0], f[-1], 30)) ** 2)

    def at_places_of(self, result: FitResult) -> Self | None:
        """Return the problem on a basis with the forces of effects at the places to which a fit moved them.

        Frequencies know a place by the stiffness there alone, which is too high where the basis lacks them.
        None where that hardly changes the likelihood.
        """
        there = self.with_forces_of(result)
        function = there.function(result.effects, start_of(result.effects), self.data.fitted)
        change = result.log_likelihood_at(function.misfit(function.point_of(result))) - result.log_likelihood
        # A basis of the places of effects is as good where the likelihood on it differs by less [nats]
        return None if abs(change) < 0.1 else there

    def better_basis(
        self, result: FitResult, n_lines: int = BASIS_LINES[0]
    ) -> tuple[float, ReducedModel] | None:
        """Return the relative error of frequencies by the basis [-], and one with modes of a fitted model.

        None where the error is small against the noise, or the model is unstable.
        """
        model = fitted_model(self.reduced.model, result)
        top = HIGHEST * float(self.data.frequency[-1])
        try:
            system = assemble(model, reciprocal=False)
            # Unstable beyond the basis: its shapes would make fits unstable, too. Far below zero lies one
            # eigenvalue, beside which all others look alike: to compute them would take minutes.
            if n_unstable(system):
                return None
            pairs = solve_eigenpairs(system, max_frequency=top, unstable=True)
            f = np.sqrt(np.maximum(pairs.eigenvalues[pairs.n_rigid :], 0.0)) / (2 * np.pi)
            if (f <= 0).any():
                return None
            refs = list(result.values)
            alone = replace(self, carried=None)
            at = alone.parametric(self.data.fitted, refs, result.effects).at(
                np.array([result.values[r] for r in refs]),
                self.damping.ratio(self.data.frequency[self.data.fitted], result.zeta),
            )
            reduced = at.pairs(0)
            g = reduced.frequency[reduced.n_rigid :]
            n = min(len(f), len(g))
            error = float(np.abs(np.log(g[:n] / f[:n])).max(initial=0.0))
            if error <= BASIS_SHARE * self.data.noise_level:
                return None
            return error, self.reduced.with_shapes(np.asarray(system.Q @ pairs.vectors))
        except (np.linalg.LinAlgError, ValueError):
            return None

    def resampled(self, result: FitResult, misfit: Mapping[str, float], rng: np.random.Generator) -> Self:
        """Return the problem with modes of a fitted model with errors; modes that it lacks stay."""
        targets, scale = self.data, float(np.sqrt(max(misfit.get("modes", 1.0), 1.0)))
        every = np.arange(targets.n)
        function = self.function((), (), every)
        at = function.modes_at(function.moved_to(result))
        partner = matched_modes(self, at, every).partner
        f, zeta, shapes = targets.frequency.copy(), targets.zeta.copy(), targets.shapes.copy()
        for i, mode in enumerate(at.damped(partner)):
            if mode is None:
                continue
            a, b = rng.standard_normal(2)
            f[i] = mode.frequency * np.exp(scale * targets.frequency_std[i] * a)
            zeta[i] = mode.zeta * np.exp(scale * targets.zeta_std[i] * b) if np.isfinite(zeta[i]) else np.nan
            if not targets.has_shapes:
                continue
            known = np.isfinite(shapes[:, i])
            phi = (at.outputs.T @ mode.vector)[known]
            psi = shapes[known, i]
            psi = phi * (phi.conj() @ psi) / (phi.conj() @ phi)
            error = rng.standard_normal(known.sum())
            if np.iscomplexobj(shapes):
                error = error + 1j * rng.standard_normal(known.sum())
            else:
                psi = psi.real
            size = np.linalg.norm(psi)
            psi = psi + scale * size * targets.shape_std[i] / np.sqrt(known.sum()) * error
            shapes[known, i] = psi / np.linalg.norm(psi)
        if not targets.has_shapes and targets.numbers is None:
            f = np.sort(f)  # a tester counts modes by frequency
        return replace(self, data=replace(targets, frequency=f, zeta=zeta, shapes=shapes))

    def computed_modes(self, result: FitResult) -> ComputedModes:
        """Return the modes of a fitted model that belong to the measured ones, those held out too."""
        return self.computed(result)

    def computed(self, result: FitResult) -> ComputedModes:
        """Return the modes of a fitted model that belong to the measured ones, those held out too."""
        every, refs = np.arange(self.targets.n), list(result.values)
        there = self.with_forces_of(result)
        parametric = there.parametric(every, refs, result.effects)
        zeta = self.damping.ratio(self.targets.frequency, result.zeta)
        at = parametric.at(np.array([result.values[r] for r in refs]), zeta)
        fitted = self.targets.fitted
        matched, everything = (matched_modes(there, at, modes) for modes in (fitted, every))
        partner, mac = everything.partner.copy(), everything.mac.copy()
        partner[fitted], mac[fitted] = matched.partner, matched.mac
        modes = at.damped(partner)
        f = np.array([np.nan if m is None else m.frequency for m in modes])
        return ComputedModes(f, np.array([np.nan if m is None else m.zeta for m in modes]), mac, partner)

    def predicted_std(self, result: FitResult) -> Floats:
        """Return relative standard deviations of the frequencies that a fitted model predicts, (n,) [-].

        Of modes held out: by the covariance of all that was fitted, what the form leaves of the fitted
        frequencies, and the mesh. NaN for fitted modes and those without a partner.
        """
        t, levels, every = self.targets, result.levels, np.arange(self.targets.n)
        if not (t.held_out.any() and isinstance(levels, ModeLevels)):
            return np.full(t.n, np.nan)
        # A mode finds its partner among all of them, in their order.
        alone = self.with_forces_of(result)
        function = alone.function(result.effects, start_of(result.effects), every)
        x = function.point_of(result)
        predicted = t.held_out & (matched_modes(alone, function.modes_at(x), every).partner >= 0)
        weight = np.hypot(t.frequency_std, self.mesh_level)
        fitted = propagated(function, x, function.units, result.covariance)[: t.n] * weight / weight.min()
        discrepancy = levels.discrepancy_square(result.misfit)[levels.kind == FREQUENCY].max(initial=0.0)
        return np.where(predicted, np.sqrt(fitted**2 + discrepancy + self.mesh_level**2), np.nan)

    def readings(self) -> tuple[ModeReading, ...]:
        """Return the readings that fits see, in the order of the groups of residuals."""
        groups = np.unique(self.function((), (), self.targets.fitted).groups)
        return tuple(ModeReading(int(g % self.targets.n), int(g // self.targets.n)) for g in groups)


@dataclass(frozen=True, slots=True)
class ModeReading:
    """The frequency, damping ratio or shape of a measured mode; modes count from 0."""

    mode: int
    kind: int

    @property
    def words(self) -> str:
        """The kind in words."""
        return ("frequency", "damping ratio", "shape")[self.kind]


def matched_modes(problem: ModeProblem, at: ModesAt, modes: Ints) -> Matched:
    """Return the computed partners of some measured modes.

    A fit that believes every reading may leave one without a partner, too: in its place all modes above it
    would have the wrong ones.
    """
    some, pairs = _some_of(problem.targets, modes), at.pairs(0)
    return match(some, pairs.frequency, pairs.shapes, problem.seen(at), problem.spread[modes], BAD_PRIOR)


def _some_of(targets: ModeTargets, modes: Ints) -> ModeTargets:
    """Return the frequencies, shapes and numbers of some measured modes."""
    return replace(
        targets,
        frequency=targets.frequency[modes],
        shapes=targets.shapes[:, modes],
        numbers=None if targets.numbers is None else targets.numbers[modes],
    )


def _partners_in(problem: ModeProblem, stack: ModeStack, modes: Ints) -> Ints:
    """Return the computed partners of some measured modes in each of several models, (k, n)."""
    vectors, lam = stack.columns @ stack.vectors, stack.eigenvalues
    seen = visible_modes(problem.reduced, problem.targets, problem.mass, lam, stack.n_rigid, vectors)
    some, spread = _some_of(problem.targets, modes), problem.spread[modes]
    return match_each(some, frequency_of(lam), stack.shapes, seen, spread, BAD_PRIOR).partner


def n_below(problem: ModeProblem) -> int:
    """Return how many modes of the nominal model the test can have seen in the range of the measured ones."""
    function = problem.function((), (), problem.targets.fitted)
    at = function.modes_at(function.start)
    return int((problem.seen(at) & (at.pairs(0).frequency <= problem.targets.frequency[-1])).sum())


@dataclass(frozen=True, slots=True, eq=False)
class ShapeResiduals:
    """Residuals of shapes, s (1 - P) W ψ with P the projection on W φ.

    W = (1 + B Bᵀ)^-½ with the columns m_k φ_k of B over other modes k: the model's error of stiffness mixes
    neighbours, the more the nearer they are, m_k ~ ε / 2|ln f ratio|. With BᵀB = V diag(x) Vᵀ and F = B V
    it is 1 - F diag(1 / (√(1 + x) (1 + √(1 + x)))) Fᵀ. At outputs without a measured value all is 0.

    Attributes
    ----------
    a, b : ndarray (n, n_out)
        W φ and W ψ.
    F, less : ndarray (n, n_out, k), (n, k)
        F, and the factors of its directions.
    scale : ndarray (n,)
        s.
    residuals : ndarray (n, n_out)
    """

    a: NDArray[Any]
    b: NDArray[Any]
    F: Floats
    less: Floats
    scale: Floats
    residuals: NDArray[Any]

    @classmethod
    def of(cls, phi: NDArray[Any], psi: NDArray[Any], B: Floats, scale: Floats) -> ShapeResiduals:
        """Return the residuals of measured shapes psi against computed ones phi, (n, n_out)."""
        x, V = np.linalg.eigh(B.transpose(0, 2, 1) @ B)
        root = np.sqrt(1 + np.maximum(x, 0.0))
        bare = cls(phi, psi, B @ V, 1 / (root * (1 + root)), scale, psi)
        a, b = bare._mixed(np.stack([phi, psi], axis=1)).transpose(1, 0, 2)
        e = b - a * (_dot(a, b) / _dot(a, a))[:, None]
        return replace(bare, a=a, b=b, residuals=e * scale[:, None])

    def _mixed(self, d: NDArray[Any]) -> NDArray[Any]:
        """Return W d for d (n, ..., n_out)."""
        return d - ((d @ self.F) * self.less[:, None]) @ self.F.transpose(0, 2, 1)

    def slopes(self, moved: Complexes) -> NDArray[Any]:
        """Return what changes (n, n_changes, n_out) of φ do to the residuals.

        Golub and Pereyra, *SIAM J. Numer. Anal.* 10, 1973, (4.12).
        """
        a, b = self.a, self.b
        d = self._mixed(moved if np.iscomplexobj(b) else np.real(moved))
        size = _dot(a, a)[:, None, None]
        c = (_dot(a, b)[:, None] / size[:, 0])[:, None]
        e, a = (b - a * c[:, 0])[:, None], a[:, None]
        first = c * (d - a * ((d * a.conj()).sum(axis=2, keepdims=True) / size))
        second = a * ((d.conj() * e).sum(axis=2, keepdims=True) / size)
        return -(first + second) * self.scale[:, None, None]


def _dot(a: NDArray[Any], b: NDArray[Any]) -> NDArray[Any]:
    """Return aᴴ b of each row."""
    return (a.conj() * b).sum(axis=-1)


@dataclass(eq=False)
class ModeFunction(FitFunction[ModeProblem]):
    """Residuals of measured modes as a function of all that varies; ``lines`` are the modes.

    ln f and ln ζ, computed over measured, and (1 - P) ψ √n of each shape ψ of length 1, with P the
    projection on the computed one: nothing depends on how shapes are scaled. Each is weighted by the least
    deviation of its group over its own.
    """

    # A step that is tried without derivatives is often asked for them next.
    _last: tuple[bytes, ModesAt, Complexes, Partners, Complexes | None] | None = field(
        default=None, init=False, repr=False
    )

    @property
    def _data(self) -> ModeTargets:
        return self.problem.targets

    @cached_property
    def _deviation(self) -> list[Floats]:
        """Standard deviations of frequencies, damping ratios and shapes, of the modes that have them."""
        t, modes = self._data, self.lines
        frequency = np.hypot(t.frequency_std[modes], self.problem.mesh_level)
        return [
            frequency,
            t.zeta_std[modes[self._damped]],
            t.shape_std[modes] if t.has_shapes else np.zeros(0),
        ]

    @cached_property
    def _known(self) -> Bools:
        """Outputs at which each mode was measured, (n_modes, n_out)."""
        t = self._data
        return ~np.isnan(t.shapes[:, self.lines]).T if t.has_shapes else np.zeros((len(self.lines), 0), bool)

    @cached_property
    def _sizes(self) -> list[int]:
        return [len(self._deviation[0]), len(self._deviation[1]), int(self._known.sum())]

    @property
    def kinds(self) -> Ints:
        """Kind of each residual: of a frequency, a damping ratio or a shape, (m,)."""
        return np.repeat([FREQUENCY, DAMPING, SHAPE], self._sizes)

    @property
    def groups(self) -> Ints:
        """Reading that each residual belongs to: kind times the number of modes, and the mode, (m,)."""
        return self.kinds * self._data.n + self.mode_of

    @property
    def of_modes(self) -> Bools:
        """Which groups are those of modes, (n_groups,): all."""
        return np.ones(len(np.unique(self.groups)), dtype=bool)

    def words_of(self, stage: float) -> str:
        """Return by how much larger deviations a stage of the fit takes."""
        return "modes" if stage <= 1 else f"modes, {stage:.2g} times their deviations"

    def changes_of_modes(self, x: Floats, steps: Floats) -> Floats:
        """Return each mode's largest change by steps of single unknowns, in deviations, (n_modes,) [-]."""
        _, J = self(x, True)
        assert J is not None
        change = np.abs(J * steps[:, None]).max(axis=0, initial=0.0) / self.least_deviations
        out = np.zeros(self._data.n)
        np.maximum.at(out, self.mode_of, change)
        return out

    def noise(self) -> Floats:
        """Return the mean squares of the residuals of each group that noise leaves, (n_groups,)."""
        return self.levels().noise

    def levels(self, stage: float = np.inf, counted_as: int = 0) -> ModeLevels:
        """Return how probable error levels are: noise as stated, and a discrepancy."""
        complex_ = np.iscomplexobj(self._data.shapes)
        groups, size = np.unique(self.groups, return_counts=True)
        kind, size = groups // self._data.n, size.astype(float)
        n = np.where(kind == SHAPE, (size - 1) * (2 if complex_ else 1), size)
        parts = np.array([1.0, 1.0, 2.0 if complex_ else 1.0])
        least = np.array([d.min() if len(d) else 1.0 for d in self._deviation])
        bad = BAD_STD[kind] * least[kind] / np.concatenate(self._deviation)
        return ModeLevels.up_to(
            kind,
            n,
            size,
            (least**2 / parts)[kind],
            self.problem.discrepancy[kind],
            bad**2 / parts[kind],
            self.problem.bad_prior,
            LEAST_DISCREPANCY[kind],
        )

    def minimise(self, x: Floats, stage: float, max_iterations: int, **how: Any) -> Solution:
        """Find the x of greatest posterior probability from a start.

        A reading that seems bad at the start pulls no more. So all are believed first, and where one seems
        bad then, the better of the maxima near there and near the start is taken.
        """
        solve = super().minimise
        if not self.problem.bad_prior:
            return solve(x, stage, max_iterations, **how)
        believing = replace(self, problem=self.problem.believed)
        believing._parametric = self._parametric  # of the same model
        found = solve(believing.minimise(x, stage, max_iterations, **how).x, stage, max_iterations, **how)
        if self.levels().is_bad(self.misfit(found.x)).max() < DOUBT:
            return found
        # From the start it goes on only if a second step like the first would make it the better one.
        start, first = solve(x, stage, 0, **how), solve(x, stage, 1, **how)
        if 2 * first.cost - start.cost > found.cost:
            return found
        return min(found, solve(first.x, stage, max_iterations, **how), key=lambda s: s.cost)

    def allowed_squares(self, *, usual: bool = False) -> Floats:
        """Return the mean squares that a right model may leave beyond noise, by group."""
        levels = self.levels()
        discrepancy = (DISCREPANCY_MAX * self.problem.discrepancy[levels.kind]) ** 2 * levels.n / levels.size
        # By how much more than stated the variance of noise may be [-]
        return (1.25**2 - 1) * levels.noise + discrepancy

    def errors(self, x: Floats) -> Errors:
        """Return how far computed modes are from the measured ones."""
        at, f = self.modes_at(x), self._data.frequency[self.lines]
        matched = matched_modes(self.problem, at, self.lines)
        ok = matched.partner >= 0
        if not ok.any():
            return Errors(lost=tuple(self.lines.tolist()))
        ratio = at.pairs(0).frequency[matched.partner[ok]] / f[ok] - 1
        mac = float(matched.mac[ok].mean())
        lost = tuple(self.lines[~ok].tolist())
        return Errors(float(np.sqrt((ratio**2).mean())), mac, lost=lost)

    @cached_property
    def _parametric(self) -> ParametricModes:
        return self.problem.parametric(self.lines, self._all_refs, self.effects)

    def __call__(self, x: Floats, gradient: bool) -> tuple[Complexes, Complexes | None]:
        """Return the weighted residuals, (m,), and their Jacobian, (n, m), if asked."""
        key = x.tobytes()
        if self._last is None or self._last[0] != key:
            at = self.modes_at(x)
            self._last = (key, at, *self.residuals(at), None)
        _, at, r, found, J = self._last
        if gradient and J is None:
            J = self._jacobian(x, at, found)
            self._last = (key, at, r, found, J)
        return r, J if gradient else None

    def _jacobian(self, x: Floats, at: ModesAt, found: Partners) -> Complexes:
        """Return the derivatives (n, m) of the residuals by x."""
        n, curve = len(self.variables), self.problem.damping
        J = np.zeros((len(x), sum(self._sizes)), dtype=complex)
        by_refs = self.slopes(at, found, self._parametric.slopes(self._values(x)), len(self._all_refs))
        J[:n] = by_unknowns(self.variables, x[:n], by_refs[: len(self.refs)])
        if self._errors is not None:
            behind = self._parts[2]
            J[behind] = self._errors.slopes(x[behind]).T @ by_refs[len(self.refs) :]
        f = self._data.frequency[self.lines]
        m = n + len(curve.start)
        hats, zeta = curve.hats(f), np.exp(curve.hats(f) @ x[n:m] + curve.offset(f))
        J[n:m] = self._by_damping(at, found, np.atleast_2d(zeta), hats.reshape(-1, *hats.shape[-2:]))
        return J

    @property
    def _errors(self) -> CalibratedErrors | None:
        return self.scatter if isinstance(self.scatter, CalibratedErrors) else None

    @property
    def _all_refs(self) -> list[ParameterRef]:
        """Parameters that the variables move, and those that were fitted to another state behind them."""
        return self.refs if self._errors is None else [*self.refs, *self._errors.refs]

    def point_of(self, result: FitResult) -> Floats:
        """Return x of a result that has the same unknowns, errors of calibrated parameters among them."""
        x = super().point_of(result)
        x[self._parts[2]] = result.scatter
        return x

    def _values(self, x: Floats) -> Floats:
        values = values_at(self.variables, x[: len(self.variables)])
        return values if self._errors is None else np.append(values, self._errors.at(x[self._parts[2]]))

    def modes_at(self, x: Floats, release: Sequence[tuple[str, str]] = ()) -> ModesAt:
        """Return the modes at some unknowns, without some constraints if asked."""
        f, curve, n = self._data.frequency[self.lines], self.problem.damping, len(self.variables)
        zeta = np.exp(curve.hats(f) @ x[n : n + len(curve.start)] + curve.offset(f))
        parametric = self._parametric
        if release:
            parametric = self.problem.parametric(self.lines, self._all_refs, self.effects, release)
        return parametric.at(self._values(x), zeta)

    def residuals(self, at: ModesAt) -> tuple[Complexes, Partners]:
        """Return the weighted residuals (m,) of computed modes, and which of them are the partners."""
        partner = matched_modes(self.problem, at, self.lines).partner
        found: Partners = [
            None if m is None else (i, int(partner[i]), m) for i, m in enumerate(at.damped(partner))
        ]
        lam = np.array([np.nan if m is None else m[2].eigenvalue for m in found], dtype=complex)
        shaped = self._shapes_met(found, at) if self._data.has_shapes else None
        return self._residuals(lam[None], shaped)[0], found

    def residuals_in(self, stack: ModeStack) -> Complexes:
        """Return the weighted residuals of k models, (k, m); NaN where there is no structure."""
        partner = _partners_in(self.problem, stack, self.lines)
        lam, x = stack.damped(partner)
        shaped = None
        if self._data.has_shapes:
            a, i = np.nonzero(partner >= 0)
            phi = (x[a, i][:, None] @ stack.outputs[a])[:, 0]
            shaped = self._shape_residuals(partner.shape, (a, i), partner[a, i], phi, *stack.rows(a, i))
        return np.where(stack.is_structure[:, None], self._residuals(lam, shaped), np.nan)

    def _residuals(self, eigenvalues: Complexes, shaped: ShapeResiduals | None) -> Complexes:
        """Return the weighted residuals of k models by partners' eigenvalues (k, n_modes), NaN for none."""
        t, modes = self._data, self.lines
        f_std, zeta_std, _ = self._deviation
        there = np.isfinite(eigenvalues)
        real = np.maximum(np.where(there, eigenvalues.real, 1.0), 1e-300)
        zeta = np.maximum(np.where(there, eigenvalues.imag, 0.0) / (2 * real), 1e-9)
        off = np.where(there, np.log(np.sqrt(real) / (2 * np.pi) / t.frequency[modes]), FAR)
        off_zeta = np.where(there, np.log(zeta) - np.log(t.zeta[modes]), FAR)
        parts: list[NDArray[Any]] = [
            off * (f_std.min() / f_std),
            off_zeta[:, self._damped] * (zeta_std.min(initial=np.inf) / zeta_std),
        ]
        if shaped is not None:
            parts.append(shaped.residuals.reshape(len(eigenvalues), *self._known.shape)[:, self._known])
        return np.concatenate(parts, axis=1).astype(complex)

    @cached_property
    def _damped(self) -> Ints:
        """Modes whose damping was measured, by their place among the lines."""
        return np.flatnonzero(np.isfinite(self._data.zeta[self.lines]))

    @cached_property
    def _measured(self) -> NDArray[Any]:
        """Measured shapes (n, n_out), 0 where they are not known."""
        return np.where(self._known, self._data.shapes[:, self.lines].T, 0.0)

    def _shapes_met(self, found: Partners, at: ModesAt) -> ShapeResiduals:
        """Return the residuals of the shapes of the partners, one row for each measured mode."""
        some = [m for m in found if m is not None]
        i, k = np.array([m[:2] for m in some], dtype=np.int64).reshape(-1, 2).T
        pairs = [at.pairs(int(c)) for c in i]
        if not pairs:
            one = at.pairs(0)
            nothing = np.zeros((0, self._known.shape[1])), np.zeros((0, len(one.eigenvalues)))
            return self._shape_residuals(
                (1, len(found)), (i, i), k, *nothing, i, np.zeros((0, *one.shapes.shape))
            )
        phi = np.stack([m.vector for _, _, m in some]) @ at.outputs
        lam, shapes = (np.stack([getattr(p, key) for p in pairs]) for key in ("eigenvalues", "shapes"))
        n_rigid = np.array([p.n_rigid for p in pairs])
        return self._shape_residuals((1, len(found)), (np.zeros_like(i), i), k, phi, lam, n_rigid, shapes)

    def _shape_residuals(
        self,
        size: tuple[int, ...],
        rows: tuple[Ints, Ints],
        partner: Ints,
        phi: NDArray[Any],
        eigenvalues: Floats,
        n_rigid: Ints,
        shapes: Floats,
    ) -> ShapeResiduals:
        """Return the residuals of the shapes of k models, one row for each measured mode of each.

        Parameters
        ----------
        size : (int, int)
            k, and the number of measured modes.
        rows : tuple of ndarray (p,)
            The model and the measured mode of each of p pairs.
        partner : ndarray of int (p,)
            The computed mode.
        phi : ndarray (p, n_out)
            Its shape.
        eigenvalues, n_rigid, shapes : ndarray (p, r), (p,), (p, n_out, r)
            Of all computed modes.
        """
        known, std, i = self._known, self._deviation[SHAPE], rows[1]
        if np.iscomplexobj(phi) and not np.iscomplexobj(self._data.shapes):
            phi = np.real(phi * np.exp(-0.5j * np.angle((phi**2).sum(axis=1, keepdims=True))))
        phi = np.where(known[i], phi, 0.0)
        each, lam = np.arange(len(i)), eigenvalues
        share = self.problem.model_error / EXPLAINED_LEVEL
        # Relative errors of stiffness by which neighbouring modes mix: for the default ``model_error``, and
        # for a model that is right but for its mesh [-]
        least = float(np.hypot(0.003 * share, 1e-4)) * np.abs(lam[each, partner])[:, None]
        m = least / np.maximum(np.abs(lam - lam[each, partner][:, None]), least)
        m[each, partner] = 0.0
        m[np.arange(lam.shape[1]) < n_rigid[:, None]] = 0.0
        m[m <= 0.1 * std[i][:, None]] = 0.0
        near = np.argsort(-m, axis=1)[:, : int((m > 0).sum(axis=1).max(initial=0))]
        # A component of ψ, of length 1, has the deviation std/√n; the mixed shapes are as large as φ.
        length = np.linalg.norm(phi, axis=1) * (std / np.sqrt(known.sum(axis=1)))[i]
        m = np.take_along_axis(m, near, axis=1) / length[:, None]
        mixed = np.take_along_axis(shapes, near[:, None], axis=2) * m[:, None]
        B = np.zeros((*size, known.shape[1], near.shape[1]))
        B[rows] = np.where(known[i][:, :, None], mixed, 0.0)
        psi = np.tile(self._measured, (size[0], 1))
        every = np.array(
            np.broadcast_to(self._measured, (*size, known.shape[1])), dtype=np.result_type(psi, phi)
        )
        every[rows] = phi
        lost = np.ones(size, dtype=bool)
        lost[rows] = False
        scale = np.tile(np.sqrt(known.sum(axis=1)) * std.min() / std, size[0])
        out = ShapeResiduals.of(every.reshape(psi.shape), psi, B.reshape(len(psi), *B.shape[2:]), scale)
        away = np.sqrt(1 - LEAST_MAC) * np.tile(std.min() / std, size[0])
        return replace(out, residuals=np.where(lost.reshape(-1, 1), away[:, None], out.residuals))

    def slopes(
        self,
        at: ModesAt,
        found: Partners,
        terms: Sequence[tuple[int, ReducedTerm]],
        n: int,
        more: Callable[[DampedMode], NDArray[Any]] | None = None,
    ) -> Complexes:
        """Return what n changes of the matrices do to the residuals, to the first order, (n, m).

        ``more`` are their motions of the sensors in a mode, (n, n_out), that other modes do not hold.
        """
        J = np.zeros((n, sum(self._sizes)), dtype=complex)
        pairs = [m for m in found if m is not None]
        if not pairs or not n:
            return J
        by, shapes = at.slopes(pairs, terms, n)
        for c, mode in enumerate(pairs):
            self._of_eigenvalue(J, mode, by[:, c])
        if self._data.has_shapes:
            moved = np.zeros((len(self.lines), n, self._known.shape[1]), dtype=complex)
            for (i, _, mode), shape in zip(pairs, shapes, strict=True):
                moved[i] = shape if more is None else shape + more(mode)
            shaped = self._shapes_met(found, at)
            by_shape = shaped.slopes(np.where(self._known[:, None], moved, 0.0))
            by_shape[[i for i, m in enumerate(found) if m is None]] = 0.0
            J[:, sum(self._sizes[:SHAPE]) :] = by_shape.transpose(1, 0, 2)[:, self._known]
        return J

    def _of_eigenvalue(self, J: Complexes, mode: tuple[int, int, DampedMode], d: Complexes) -> None:
        """Write into J what changes d (n,) of an eigenvalue do to ln f and ln ζ."""
        i, lam = mode[0], mode[2].eigenvalue
        f_std, zeta_std, _ = self._deviation
        J[:, i] = d.real / (2 * lam.real) * (f_std.min() / f_std[i])
        if i in self._damped and lam.imag > 0:
            k = int(np.searchsorted(self._damped, i))
            weight = zeta_std.min() / zeta_std[k]
            J[:, self._sizes[0] + k] = (d.imag / lam.imag - d.real / lam.real) * weight

    def _by_damping(self, at: ModesAt, found: Partners, zeta: Floats, hats: Floats) -> Complexes:
        """Return the derivatives of the residuals by the logarithms of the damping curve's unknowns."""
        J = np.zeros((hats.shape[-1], sum(self._sizes)), dtype=complex)
        for mode in found:
            if mode is not None:
                slopes = at.by_zeta(mode[0], mode[2]) * zeta[:, mode[0]]
                self._of_eigenvalue(J, mode, slopes @ hats[:, mode[0]])
        return J

    @property
    def least_deviations(self) -> Floats:
        """Standard deviation of each residual without a discrepancy: the least of its group, (m,)."""
        return np.repeat([d.min() if len(d) else 1.0 for d in self._deviation], self._sizes)

    @property
    def log_density(self) -> float:
        """Logarithm of the density that weights give the residuals, up to a constant."""
        out = sum(float(np.log(d.min() / d).sum()) for d in self._deviation[: DAMPING + 1] if len(d))
        if self._data.has_shapes:
            d, n = self._deviation[SHAPE], self._known.sum(axis=1)
            out += float((n * np.log(d.min() / d)).sum())
        return out

    @property
    def mode_of(self) -> Ints:
        """Which of the measured modes each residual belongs to, (m,)."""
        return np.concatenate(
            [self.lines, self.lines[self._damped], np.repeat(self.lines, self._known.sum(axis=1))]
        )

    def result(self, solution: Solution) -> FitResult:
        """Return a solution as values with standard deviations.

        The level is that of the frequencies which seem to be the model's [-]: one that is not, says nothing
        of how near the model is to the data.
        """
        out = super().result(solution)
        if (errors := self._errors) is not None:
            at, n, known = self._parts[2], len(out.covariance), solution.covariance
            every = known * np.outer(self.units, self.units) if known.size else np.full((n, n), np.nan)
            slopes = errors.slopes(solution.x[at])
            std = (
                np.sqrt(np.einsum("ik,kl,il->i", slopes, every[at, at], slopes))
                if known.size
                else np.full(len(slopes), np.nan)
            )
            now = dict(zip(errors.refs, errors.at(solution.x[at]).tolist(), strict=True))
            std = dict(zip(errors.refs, std.tolist(), strict=True))
            out = replace(out, values={**out.values, **now}, std={**out.std, **std}, covariance=every)
        levels, v = self.levels(), self.misfit(solution.x)
        belong = (levels.kind == FREQUENCY) * np.maximum(1 - levels.is_bad(v), 0.0)
        return replace(out, level=float(np.sqrt(belong @ v / max(belong.sum(), 1e-12))))


def start_of(effects: Sequence[Effect]) -> list[dict[str, float]]:
    """Return the values of effects to start from."""
    return [parameter_values(e) for e in effects]
