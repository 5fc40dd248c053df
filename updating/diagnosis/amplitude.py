"""What changes with amplitude: one nonlinear joint fitted to the FRFs of several force levels together.

The rest of the structure is linear. For each candidate the reduced model gives the receptances at the joint,
and harmonic balance (:mod:`fem.analysis.harmonic_balance`) what the joint makes of them at each level of
force.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.analysis.harmonic_balance import Receptances, solve_steady
from fem.effects.joint_nonlinear import AmplitudeDependent
from fem.model import Effect, parameter_values
from fem.reduction.parametric_frf import ParametricFRF
from updating.correlation import log_ratio
from updating.inference.fit import FitProblem
from updating.inference.fit_data import FitData, noise_squares
from updating.inference.fit_function import LEVEL_FLOOR, ROBUST, by_unknowns, propagated, widened
from updating.inference.fit_result import FitResult
from updating.inference.solve import Prior, Solution, solve_robust
from updating.inference.unknowns import effect_unknowns
from updating.least_squares.levels import Levels
from updating.least_squares.loss import pseudo_huber
from updating.measurement.measurement import Measurement
from updating.quality.faults import Fault
from updating.quality.gates import at_level

N_BEST = 4
"""Candidates that are fitted fully, at most."""
N_GRID_LINES = 60
"""Lines at which candidates are looked at."""
N_STARTS = 2
"""Points of a candidate's grid from which it is fitted."""

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


@dataclass(frozen=True, slots=True)
class AmplitudeFit:
    """A fit of one nonlinear joint to all force levels.

    Attributes
    ----------
    effect : AmplitudeDependent
        With its values, at the amplitude that nine tenths of lines and forces of the first level stay below.
    result : FitResult
        Errors are those of the first level.
    level, held_out_level : float
        Robust residual levels over all force levels, on lines fitted and held out [nepers].
    """

    effect: AmplitudeDependent
    result: FitResult
    level: float
    held_out_level: float


def force_levels(
    problem: FitProblem, measurements: Sequence[Measurement], faults: Sequence[Fault] = ()
) -> tuple[FitData, ...]:
    """Return the data at the problem's lines of all measurements that state their force, if two differ.

    Those of other lines or channels, and those without a value that counts, are left out.

    Parameters
    ----------
    problem : FitProblem
        Of the first measurement.
    measurements : sequence of Measurement
        The first is the problem's.
    faults : sequence of Fault
        What has been set right in the problem's data.
    """
    data = [problem.data, *(at_level(problem, m, faults) for m in measurements[1:])]
    levels = tuple(d for d in data if d is not None and d.measurement.force_level and d.mask.any())
    different = len({d.measurement.force_level for d in levels}) > 1
    return levels if different and levels[0] is problem.data else ()


def split(effects: Sequence[Effect]) -> tuple[list[Effect], list[AmplitudeDependent]]:
    """Return linear effects, and those that depend on amplitude."""
    return (
        [e for e in effects if not isinstance(e, AmplitudeDependent)],
        [e for e in effects if isinstance(e, AmplitudeDependent)],
    )


@dataclass(eq=False)
class _AtJoint:
    """The linear rest of the structure, with the relative motion of a joint as last response and last force.

    x are nuisance parameters and those of linear effects, and ln ζ at the knots.
    """

    problem: FitProblem
    effects: tuple[Effect, ...]
    element: AmplitudeDependent
    lines: NDArray[np.int64]
    _engine: ParametricFRF | None = field(default=None, init=False, repr=False)

    def block(
        self, values: Floats, refs: Sequence[tuple[str, str]], zeta: Floats, gradient: bool
    ) -> tuple[Complexes, Complexes | None, Complexes | None]:
        """Return receptances (n_freq, n_out + 1, n_in + 1) and derivatives by values and damping."""
        p = self.problem
        if self._engine is None or self._engine.refs != tuple(refs):
            f = p.data.frequency[self.lines]
            both = p.vectors_with(self.element)
            self._engine = ParametricFRF(p.reduced, *both, f, refs, self.effects)
        return self._engine.evaluate(values, self.ratio(zeta), gradient)

    def ratio(self, zeta: Floats) -> Floats:
        return np.exp(self.hats @ np.log(zeta) + self._offset)

    @cached_property
    def hats(self) -> Floats:
        return self.problem.damping.hats(self.problem.data.frequency[self.lines])

    @cached_property
    def _offset(self) -> Floats:
        return self.problem.damping.offset(self.problem.data.frequency[self.lines])


@dataclass(frozen=True, slots=True, eq=False)
class _Function:
    """Residuals at all force levels: x is that of the linear rest, then the joint's own parameters."""

    at: _AtJoint
    levels: tuple[FitData, ...]
    rest: Any
    own: tuple[Any, ...]

    @property
    def start(self) -> Floats:
        values = parameter_values(self.at.element)
        return np.concatenate([self.rest.start, [v.to_x(values[v.ref[1]]) for v in self.own]])

    @property
    def units(self) -> Floats:
        return np.array([*self.rest.units, *(v.size for v in self.own)])

    @property
    def order(self) -> NDArray[np.int64]:
        """Places in x of the values of a result, those of the joint after the others', and of damping."""
        n_par, n_own, n = len(self.rest.variables), len(self.own), len(self.start)
        return np.r_[:n_par, n - n_own : n, n_par : n - n_own]

    def element(self, x: Floats) -> AmplitudeDependent:
        x_own = x[len(self.rest.start) :]
        return self.at.element.with_values(
            **{v.ref[1]: v.to_value(xi) for v, xi in zip(self.own, x_own, strict=True)}
        )

    def __call__(self, x: Floats, gradient: bool) -> tuple[Complexes, Complexes | None]:
        at, p = self.at, self.at.problem
        variables = self.rest.variables
        n_par, n_damping = len(variables), len(p.damping.start)
        values = np.array([v.to_value(xi) for v, xi in zip(variables, x[:n_par], strict=True)])
        zeta = np.exp(x[n_par : n_par + n_damping])
        block, slopes, by_zeta = at.block(values, [v.ref for v in variables], zeta, gradient)
        element, part = self.element(x), Receptances.of(block)
        names = tuple(v.ref[1] for v in self.own)
        changes = np.zeros((0, *block.shape), dtype=complex)
        if gradient:
            assert slopes is not None
            assert by_zeta is not None
            by_x = [v.slope(xi) * s for v, xi, s in zip(variables, x[:n_par], slopes, strict=True)]
            by_x += [*by_unknowns(at.ratio(zeta), at.hats, by_zeta)]
            changes = np.array(by_x).reshape(len(by_x), *block.shape)
        residuals, jacobians = [], []
        for data in self.levels:
            keep, weight = data.mask[at.lines], data.weight[at.lines]
            measured = np.where(keep, data.H[at.lines], 0.0)
            force = data.measurement.force_level
            assert force is not None
            steady = solve_steady(element, force, part, measured)
            safe = np.where(keep & (measured != 0), measured, 1.0)
            residuals.append(np.nan_to_num(weight * log_ratio(steady.H, safe), nan=0.0)[keep])
            if gradient:
                by_rest, by_own = steady.slopes(changes, names)
                scale = [v.slope(xi) for v, xi in zip(self.own, x[n_par + n_damping :], strict=True)]
                every = np.concatenate([by_rest, np.array(scale)[:, None, None, None] * by_own])
                per = np.where(steady.H != 0, weight / np.where(steady.H != 0, steady.H, 1.0), 0.0)
                jacobians.append((every * per)[:, keep])
        r = np.concatenate(residuals)
        return r, np.concatenate(jacobians, axis=1) if gradient else None

    def groups(self) -> NDArray[np.int64]:
        band = self.at.problem.band_of(self.at.lines)[:, None, None]
        return np.concatenate(
            [np.broadcast_to(band, d.mask[self.at.lines].shape)[d.mask[self.at.lines]] for d in self.levels]
        )


def _function(
    problem: FitProblem,
    levels: tuple[FitData, ...],
    linear: Sequence[Effect],
    element: AmplitudeDependent,
    lines: NDArray[np.int64],
) -> _Function:
    starts = [parameter_values(e) for e in linear]
    rest = problem.function(linear, starts, lines)
    own = effect_unknowns([element], [parameter_values(element)])
    return _Function(_AtJoint(problem, tuple(linear), element, lines), levels, rest, own)


def _fitted(
    problem: FitProblem,
    levels: tuple[FitData, ...],
    linear: Sequence[Effect],
    element: AmplitudeDependent,
    x_from: FitResult | None,
    stages: Sequence[float],
    max_iterations: int = 20,
) -> AmplitudeFit:
    """Fit a nonlinear joint with the linear rest, over rising bands."""
    every = [
        _function(problem, levels, linear, element, problem.lines_up_to(stage, problem.n_lines))
        for stage in stages
    ]
    f = every[-1]
    begin = f.rest.start if x_from is None else f.rest.moved_to(x_from)
    x = np.concatenate([begin, f.start[len(begin) :]])
    solution = Solution(x, np.nan, np.nan, np.zeros((len(x), len(x))), 0, False)
    for f, stage in zip(every, stages, strict=True):
        prior, n_own = f.rest.prior(), len(f.own)
        limits = np.vstack([f.rest.limits(), [v.bounds() for v in f.own]])
        _, member, sizes = np.unique(f.groups(), return_inverse=True, return_counts=True)
        noise = np.concatenate([noise_squares(d, f.at.lines) for d in f.levels])
        solution = solve_robust(
            f,
            x,
            Prior(np.append(prior.mean, np.zeros(n_own)), np.append(prior.std, np.full(n_own, np.inf))),
            (limits[:, 0], limits[:, 1]),
            levels=Levels.above_floor(problem.n_independent(stage), LEVEL_FLOOR, sizes),
            widened=partial(widened, np.bincount(member, noise) / sizes, problem.noise_counted),
            groups=member,
            robust=ROBUST,
            max_iterations=max_iterations,
            relative=np.array([*f.rest.relative, *(not v.log for v in f.own)]),
        )
        x = solution.x
    n_rest = len(f.rest.start)
    rest = f.rest.result(replace(solution, x=x[:n_rest], covariance=solution.covariance[:n_rest, :n_rest]))
    deviation = np.sqrt(np.maximum(np.diag(solution.covariance)[n_rest:], 0.0))
    values, std = dict(rest.values), dict(rest.std)
    for v, xi, s in zip(f.own, x[n_rest:], deviation, strict=True):
        values[v.ref], std[v.ref] = v.to_value(xi), v.deviation(xi, float(s))
    found = f.element(x)
    result = replace(
        rest, solution=solution, values=values, std=std, effects=(*rest.effects, found), level=np.nan,
        covariance=(solution.covariance * np.outer(f.units, f.units))[np.ix_(f.order, f.order)],
    )  # fmt: skip
    amplitude = problem.steady(result, np.arange(len(problem.data.frequency))).amplitude
    moving = amplitude[amplitude > 0]
    if moving.size:
        found = replace(found, amplitude=float(np.quantile(moving, 0.9)))
    result = replace(result, effects=(*rest.effects, found))
    return AmplitudeFit(found, problem.assessed(result), *combined_levels(problem, levels, result))


def combined_levels(problem: FitProblem, levels: Sequence[FitData], result: FitResult) -> tuple[float, float]:
    """Return the robust residual levels over all force levels, on lines fitted and held out [nepers]."""
    squares: list[list[float]] = [[], []]
    for data in levels:
        here = replace(problem, data=data)
        ratio, held = here.log_ratio(result), data.held_out
        for part, lines in zip(squares, (~held, held), strict=True):
            part.append(here.level(ratio[lines], lines) ** 2)
    fitted, held_out = (float(np.sqrt(np.mean(part))) for part in squares)
    return fitted, held_out


def deviation_at_level(problem: FitProblem, result: FitResult) -> NDArray[np.float64]:
    """Return the standard deviation of the ln|H| that a fit predicts at the force level of the data.

    √(gᵀ C g) as :meth:`updating.inference.fit.FitProblem.deviation`, with the derivatives of the steady
    vibration: of first order, and wide where it is about to jump.

    Parameters
    ----------
    problem : FitProblem
    result : FitResult
        Of :func:`search_amplitude`, with one effect that depends on amplitude.

    Returns
    -------
    ndarray (n_freq, n_out, n_in)
        [-]
    """
    data = problem.data
    every = replace(
        data,
        H=np.where(data.mask, data.H, 0.0),
        mask=np.ones_like(data.mask),
        weight=np.ones_like(data.weight),
    )
    linear, (element,) = split(result.effects)
    function = _function(problem, (every,), linear, element, np.arange(len(data.frequency)))
    rest = function.rest.moved_to(result)
    x = np.concatenate([rest, function.start[len(rest) :]])
    as_in_x = np.argsort(function.order)
    covariance = result.covariance[np.ix_(as_in_x, as_in_x)]
    return propagated(function, x, function.units, covariance).reshape(every.mask.shape)


def search_amplitude(
    problem: FitProblem,
    levels: tuple[FitData, ...],
    current: FitResult,
    candidates: Sequence[AmplitudeDependent],
    say: Callable[[str, float], None],
) -> tuple[AmplitudeFit, ...]:
    """Look at every candidate on a grid of its values, and fit the best to all force levels; best first.

    Parameters
    ----------
    problem : FitProblem
    levels : tuple of FitData
        Of :func:`force_levels`.
    current : FitResult
        The model so far, whose linear effects are fitted again with the candidate.
    candidates : sequence of AmplitudeDependent
    say : callable
        Called with a text and the fraction done.
    """
    linear = list(current.effects)
    lines = problem.lines_up_to(np.inf, N_GRID_LINES)
    refs = list(current.values)
    values = np.array([current.values[r] for r in refs])
    looked: list[tuple[float, AmplitudeDependent]] = []
    nearby: dict[tuple[str, str], tuple[Receptances, float]] = {}
    for i, candidate in enumerate(candidates):
        say(f"looking at {candidate.name}", 0.4 * i / len(candidates))
        key = (candidate.joint, candidate.direction)
        if key not in nearby:
            at = _AtJoint(problem, tuple(linear), candidate, lines)
            part = Receptances.of(at.block(values, refs, current.zeta, False)[0])
            top = max(d.measurement.force_level or 0.0 for d in levels)
            nearby[key] = part, float(np.quantile(np.abs(part.h), 0.9)) * top
        part, amplitude = nearby[key]
        if amplitude <= 0:  # nothing moves the joint in this direction
            continue
        scaled = replace(candidate, amplitude=amplitude)
        points = scaled.starts(problem.surroundings)
        tried = [scaled.with_values(**p) for p in points]
        seen = sorted(((_seen_level(levels, e, part, lines), k) for k, e in enumerate(tried)))
        looked += [(level, tried[k]) for level, k in seen[:N_STARTS]]
    looked.sort(key=lambda pair: pair[0])
    names = list(dict.fromkeys(e.name for _, e in looked))[:N_BEST]
    out = []
    for i, name in enumerate(names):
        say(f"fitting {name}", 0.4 + 0.6 * i / len(names))
        last = [problem.stages[-1]]
        fits = []
        for _, start in looked:
            if start.name == name:
                fits.append(_fitted(problem, levels, linear, start, current, last))
                fits.append(_fitted(problem, levels, linear, start, None, problem.stages.tolist()))
        out.append(min(fits, key=lambda fit: fit.level))
    return tuple(sorted(out, key=lambda fit: fit.level))


def _seen_level(
    levels: Sequence[FitData], element: AmplitudeDependent, part: Receptances, lines: NDArray[np.int64]
) -> float:
    squares = []
    for data in levels:
        keep = data.mask[lines]
        measured = np.where(keep, data.H[lines], 0.0)
        H = solve_steady(element, data.measurement.force_level or 1.0, part, measured).H
        r = np.abs((data.weight[lines] * log_ratio(H, np.where(measured != 0, measured, 1.0)))[keep])
        squares.append(float(np.nanmean(pseudo_huber(r, ROBUST))))
    return float(np.sqrt(np.mean(squares)))
