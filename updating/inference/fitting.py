"""The most probable model: everything that is uncertain, and given effects, fitted to the data."""

from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from fem.array_types import Floats, Ints
from fem.linalg.solvers import one_thread
from fem.model import Effect, parameter_values
from updating.inference.defaults import BASIS_LINES, FULL_LINES
from updating.inference.fit import FitProblem
from updating.inference.fit_function import FitFunction
from updating.inference.fit_result import FitResult
from updating.inference.form_scatter import FormScatter
from updating.inference.marginal import by_size, log_evidence, mixed
from updating.inference.problem import Problem
from updating.inference.solve import TOLERANCE, Report, Solution
from updating.least_squares.costs import Costs

P = TypeVar("P", bound=Problem[Any])
FULL: dict[str, Any] = {"n_lines": FULL_LINES}
QUICK_LINES = 40
"""Lines of quick fits."""
QUICK_NATS = 0.1
"""They end when a step gains less."""
ITERATIONS = 14
"""Largest number of iterations in each band of a fit."""
N_PASSES = 3
"""So often small deviations are fitted again at most, where another size than the next one is best."""
FLAT = 1e3
"""Standard deviation of an unknown without a prior, for the evidence [-]."""
COMPARED: dict[str, Any] = {"n_lines": QUICK_LINES, "tolerance": QUICK_NATS}
"""Settings of fits that are only compared."""
Watch = Callable[[FitFunction, float], Report]
"""Gives what is called after each step, for a function of lines up to a frequency [Hz]."""


@one_thread()
def fit(
    problem: Problem[Any],
    effects: Sequence[Effect] = (),
    starts: Sequence[dict[str, float]] = (),
    *,
    stages: Iterable[float] | None = None,
    n_lines: int | None = None,
    counted_as: int = FULL_LINES,
    max_iterations: int = ITERATIONS,
    x_from: FitResult | None = None,
    tolerance: float = TOLERANCE,
    watch: Watch | None = None,
) -> FitResult:
    """Find the most probable unknowns of a model with effects, band by band; its errors are not assessed.

    Modes are all fitted at once, first with larger deviations than they have.

    Parameters
    ----------
    problem : Problem
    effects : sequence of Effect
    starts : sequence of dict
        For each of them the parameter values to start from.
    stages : iterable of float, optional
        Upper ends of the bands, the last the whole [Hz]; of modes factors of their deviations, the last 1.
    n_lines : int, optional
    counted_as : int
        Number of lines of the evidence, as if that many had been fitted. 0 for those of the fit.
    max_iterations : int
        In each band.
    x_from : FitResult, optional
        Start uncertain parameters and damping there rather than at the nominal values.
    tolerance : float
        The end of a band's fit is where a step gains less than this [nats].
    watch : callable, optional
    """
    x: Floats | None = None
    function = solution = None
    for stage in stages if stages is not None else problem.stages:
        function = problem.residuals(effects, starts, stage, n_lines)
        if x is None:
            x = function.start if x_from is None else function.moved_to(x_from)
        report = None if watch is None else watch(function, stage)
        solution = function.minimise(
            x, stage, max_iterations, counted_as=counted_as, tolerance=tolerance, report=report
        )
        x = solution.x
    assert function is not None
    assert solution is not None
    return with_evidence(function, solution, counted_as)


def assessed_fit(problem: FitProblem, *effects: Any, **how: Any) -> FitResult:
    """Return a :func:`fit` with its errors on fitted and on held-out lines."""
    return problem.assessed(fit(problem, *effects, **how))


def null_fit(problem: Problem[Any], *, n_lines: int = FULL_LINES, counted_as: int = FULL_LINES) -> FitResult:
    """Return the fit of everything that is uncertain, to nothing added.

    From where a fit band by band ends, with its damping and with one that is even over frequency, and from
    where one to damped FRFs does, which converges from far away. Few lines tell which is best.
    """
    banded, far = fit(problem, counted_as=0, **COMPARED), far_fit(problem)
    ways = [banded, problem.with_even_damping(banded), *([far] if far else [])]
    last: dict[str, Any] = {"stages": problem.stages[-1:], "counted_as": counted_as}
    best = max((fit(problem, x_from=near, **last, **COMPARED) for near in ways), key=lambda r: r.log_evidence)
    return fit(problem, x_from=best, n_lines=n_lines, **last)


def far_fit(problem: Problem[Any]) -> FitResult | None:
    """Return a quick fit to less and less damped FRFs; None where they cannot be damped."""
    frfs, near = problem.damped_frfs(), None
    if frfs is None:
        return None
    # Decay rates of FRFs to which fits far from the data begin, in parts of the band [-]
    for share in (0.04, 0.015, 0.004):
        damped_problem = frfs.at(share)
        if damped_problem is not None:
            stages = damped_problem.stages[-1:]
            near = fit(damped_problem, stages=stages, counted_as=0, x_from=near, **COMPARED)
    return near


def refit(problem: Problem[Any], result: FitResult, **how: Any) -> FitResult:
    """Fit the effects of a result again, from its values, on the full band at once.

    A part of the band would not determine all, such as the extent of a mass.

    Parameters
    ----------
    problem : Problem
    result : FitResult
        Its effects are fitted, from their values; all else begins where it is there.
    **how
        As of :func:`fit`.
    """
    starts = [parameter_values(e) for e in result.effects]
    return fit(problem, result.effects, starts, stages=problem.stages[-1:], x_from=result, **how)


def scattered(
    problem: Problem[Any],
    result: FitResult,
    scatter: Callable[..., FormScatter | None] = lambda problem, *at: problem.small_deviations(*at),
    *,
    n_passes: int = N_PASSES,
    **how: Any,
) -> FitResult:
    """Return a fit continued with small deviations of the form, of the modes that it has.

    They begin with a size in the middle: a large one does instead of an effect.

    Parameters
    ----------
    problem : Problem
    result : FitResult
    scatter : callable
        Returns the deviations at a result, of a size.
    n_passes : int
    **how
        As of :func:`fit`.
    """
    how = FULL | how
    size = None
    for _ in range(n_passes):
        small = scatter(problem, result, size)
        if small is None:
            break
        result = refit(replace(problem, scatter=small), result, **how)
        size = result.size
        if size is None or 0.4 < size / small.eigenvalue < 2.5:
            break
    return result


@one_thread()
def fit_given(
    problem: P,
    effects: Sequence[Effect] = (),
    others: Sequence[FitResult] = (),
    *,
    choose_damping: bool = True,
    **how: Any,
) -> tuple[P, FitResult]:
    """Return the most probable model with given effects, from their values and from their own starts.

    The posterior has several maxima, for instance of a joint between free and rigid. Quick fits rank the
    starts. The problem is returned on the basis of the fit: with its responses, where it erred without.

    Parameters
    ----------
    problem : Problem
        With the form among what is uncertain, if it may vary.
    effects : sequence of Effect
        With the values to start from first.
    others : sequence of FitResult
        Points from which fits without effects begin, too.
    choose_damping : bool
        Whether the form of damping between resonances is the more probable one, rather than the problem's.
    **how
        As of :func:`fit`.
    """
    how = FULL | how
    problem = replace(problem, reduced=problem.reduced.with_forces_of(effects))
    given = [parameter_values(e) for e in effects]
    fits = [fit(problem, effects, given, **how), *(refit(problem, r, **how) for r in others)]
    starts: list[tuple[list[dict[str, float]], FitResult | None]] = [
        ([*given[:k], s, *given[k + 1 :]], None)
        for k, e in enumerate(effects)
        for s in e.starts(problem.surroundings)
    ]
    # Steps of quick fits from several starts, and how many of the best go on: twice, then to all lines
    for steps, kept in ((2, 6), (6, 2)) if starts else ():
        tried = []
        for values, near in starts:
            with suppress(np.linalg.LinAlgError):  # no structure: more mass taken away than there is
                way: dict[str, Any] = {"stages": problem.stages[-1:], "max_iterations": steps, "x_from": near}
                tried.append(fit(problem, effects, values, **way, **COMPARED))
        tried.sort(key=lambda r: -r.log_evidence)
        starts = [([parameter_values(e) for e in r.effects], r) for r in tried[:kept]]
    fits += [refit(problem, near, **how) for _, near in starts if near is not None]
    result = scattered(problem, max(fits, key=lambda r: r.log_evidence), **how)
    for n_better in BASIS_LINES:
        better = problem.better_basis(result, n_better)
        if better is None:
            break
        problem = replace(problem, reduced=better[1])
        now = [parameter_values(e) for e in result.effects]
        # What was bent on the former basis would stay so: from nominal uncertain parameters, too.
        fits = [fit(problem, effects, now, **how), refit(problem, result, **how)]
        result = scattered(problem, max(fits, key=lambda r: r.log_evidence), **how)
    return with_form_of_damping(problem, result, **how) if choose_damping else (problem, result)


def with_form_of_damping(problem: P, result: FitResult, **how: Any) -> tuple[P, FitResult]:
    """Return a fit with the more probable form of damping between resonances, and its problem."""
    other = problem.with_other_damping()
    if other is None:
        return problem, result
    small = replace(other, scatter=other.small_deviations(result, result.size))
    again = refit(small, result, **how)
    return (other, again) if again.log_evidence > result.log_evidence else (problem, result)


def with_evidence(function: FitFunction, solution: Solution, counted_as: int = 0) -> FitResult:
    """Return a solution with its log evidence and covariance, by Laplace's approximation."""
    x, scatter, levels = solution.x, function.scatter, function.levels(counted_as=counted_as)
    (off, std), near = _proper_prior(function, x), function.quadratic(x, levels)
    v, size = near.v, None
    if scatter is None or not scatter.sizes:
        normal = near.normal(levels.weight(v), std)
        evidence, covariance = (
            log_evidence(-levels.cost(v), off, std, normal, near.n_apart),
            np.linalg.inv(normal),
        )
    else:
        rows = len(x) - len(scatter.std) + scatter.shifts
        factors = np.array(scatter.sizes) / scatter.eigenvalue
        each = by_size(near, off, std, rows, factors)
        evidence, change, covariance = mixed(each)
        size = scatter.sizes[int(np.argmax([s.log_evidence for s in each]))]
        mean = np.clip(x + change, *function.limits().T)
        if _density(function, levels, mean, rows, factors) > _density(function, levels, x, rows, factors):
            x = mean
    result = function.result(replace(solution, x=x, covariance=covariance))
    return replace(result, log_evidence=evidence, levels=levels, misfit=v, size=size)


def _proper_prior(function: FitFunction, x: Floats) -> tuple[Floats, Floats]:
    """Return how far x is from the priors' means, and their deviations, ``FLAT`` for none, (n,) each."""
    off, std = function.prior_at(x)
    return np.where(np.isfinite(std), off, 0.0), np.minimum(std, FLAT)


def _density(function: FitFunction, levels: Costs, x: Floats, rows: Ints, factors: Floats) -> float:
    """Return the logarithm of the posterior density at x over all sizes of some priors, up to a constant.

    The density is 0, and its logarithm -inf, where there is no structure.
    """
    off, std = _proper_prior(function, x)
    stds = np.tile(std, (len(factors), 1))
    stds[:, rows] *= factors[:, None]
    prior = -0.5 * ((off / stds) ** 2).sum(axis=1) - np.log(stds).sum(axis=1)
    try:
        misfit = function.misfit(x)
    except np.linalg.LinAlgError:  # more mass taken away than there is
        return -np.inf
    return float(np.logaddexp.reduce(prior)) - levels.cost(misfit)
