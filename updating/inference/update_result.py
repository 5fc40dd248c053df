"""The result of an update from where its fit ended: deviations, messages and samples."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fem.array_types import Bools, Floats, Ints
from fem.model import Model, ModelError
from updating.inference.belief import UNKNOWN_ODDS
from updating.inference.determined import SEEN, SHARE, blind_words, taking_part
from updating.inference.fit_data import SYSTEMATIC_FROM
from updating.inference.fit_function import FitFunction
from updating.inference.fit_result import FitResult, fitted_model
from updating.inference.fitted_damping import with_fitted_damping
from updating.inference.linearised import covariance_of, marginal_density, widths_of
from updating.inference.mode_fit import ComputedModes
from updating.inference.problem import Problem
from updating.inference.regularisation import LCurve
from updating.inference.sampling import Samples, sample
from updating.inference.unknowns import WIDTH, ScaledUnknown
from updating.inference.update_settings import UpdateSettings
from updating.inference.updated import Ending, Updated, UpdatedParameter, UpdateStep
from updating.least_squares.costs import Costs

PRIOR_SHARE = 0.9
"""Of parameters whose standard deviation stays above this part of the prior's the data say nothing [-]."""

NAMED_DEVIATIONS = 4.0
"""Parameters that end farther from their prior than this, in its standard deviations, are named [-]."""


KNOWN_DAMPING = 1e-3
"""Damping that is known better than this beforehand is no parameter of an update [-]."""


@dataclass(frozen=True, slots=True, eq=False)
class Ended:
    """Where the fit of an update ended.

    Attributes
    ----------
    problem : Problem
        With the basis of the end, and the parameters that selection kept.
    function : FitFunction
        Of all lines.
    levels : Costs
    result : FitResult
        The most probable unknowns.
    x : ndarray (n,)
        They, as the function has them, or those of the regularised problem.
    precision : ndarray (n, n) or None
        Weight of the regularisation.
    curve : LCurve or None
    """

    problem: Problem[Any]
    function: FitFunction
    levels: Costs
    result: FitResult
    x: Floats
    precision: Floats | None
    curve: LCurve | None


def rows_of(function: FitFunction, asked: Sequence[ScaledUnknown]) -> Ints:
    """Return where unknowns are among those of a function, as far as it has them."""
    known = {v.refs: k for k, v in enumerate(function.variables)}
    return np.array([known[u.refs] for u in asked if u.refs in known], dtype=np.int64)


def _damping_rows(function: FitFunction) -> Ints:
    """Return where the ratios at the knots of the damping curve are, if they are unknown."""
    curve, n = function.problem.damping, len(function.variables)
    known = curve.std < KNOWN_DAMPING or not function.problem.data.has_damping
    return n + np.arange(0 if known else len(curve.knots))


def values_of(asked: Sequence[ScaledUnknown], function: FitFunction, x: Floats) -> Floats:
    """Return the values of parameters and of damping ratios, as a result has them."""
    known = {v.refs: v.to_value(xi) for v, xi in zip(function.variables, x, strict=False)}
    values = [known.get(u.refs, u.to_value(u.start)) for u in asked]
    return np.concatenate([values, np.exp(x[_damping_rows(function)])])


def result_of(
    ended: Ended,
    model: Model,
    asked: Sequence[ScaledUnknown],
    path: tuple[UpdateStep, ...],
    starts: tuple[tuple[Floats, float], ...],
    left_out: tuple[tuple[str, str], ...],
    settings: UpdateSettings,
) -> Updated:
    """Return the result at the end of a fit, with standard deviations and messages."""
    function, x, problem = ended.function, ended.x, ended.problem
    result = ended.result
    if ended.precision is not None:
        result = replace(function.result(replace(result.solution, x=x)), levels=ended.levels)
    low, high = function.limits().T
    widths = widths_of(function)
    bound = (x <= low + 1e-9 * widths) | (x >= high - 1e-9 * widths)
    every, blind = _covariance(ended, bound)
    rows, damped = rows_of(function, asked), _damping_rows(function)
    names = [u.name for u in asked if u.refs in {v.refs for v in function.variables}]
    names += [f"damping at {f:.4g} Hz" for f in problem.damping.knots[: len(damped)]]
    use = np.concatenate([rows, damped])
    lost = taking_part(blind)
    std = np.where(lost, np.inf, np.where(bound, np.nan, np.sqrt(np.maximum(np.diag(every), 0.0))))
    done = _parameters(ended, asked, {name for name, _ in left_out}, std, bound)
    covariance, slope = _full_covariance(every, use, asked, function, x, lost)
    size = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    known = size > 0
    correlation = np.where(np.outer(known, known), covariance, 0.0) / np.outer(
        *[np.where(known, size, 1.0)] * 2
    )
    np.fill_diagonal(correlation, 1.0)
    moved = np.abs(x - function.start) > 1e-6 * widths
    modes = problem.computed_modes(result)
    alone = (blind[rows] ** 2).sum(axis=1) > 1 - SHARE
    ending = Ending.CONVERGED if result.solution.converged else Ending.OUT_OF_ITERATIONS
    if bound[rows].all() and rows.size:
        ending = Ending.AT_BOUNDS
    if rows.size and (alone & ~moved[rows]).all():
        ending = Ending.NOTHING_DETERMINED
    if path[-1].errors.is_empty:
        ending = Ending.NO_PARTNERS
    messages = (
        *_messages(ended, result, done, correlation, modes, ending),
        *blind_words(blind[use], names, problem.measured_words, moved[use]),
        *_unmoved(ended, rows, modes),
        *_moved_besides(ended, rows),
    )
    samples = None
    if settings.n_samples:
        samples = _samples(ended, asked, every, lost | bound, settings)
    end = fitted_model(model, result)
    if problem.data.has_damping and problem.damping.std >= KNOWN_DAMPING:
        end = with_fitted_damping(problem, result, end)
    return Updated(
        model=end,
        parameters=done,
        correlation=correlation,
        covariance=covariance * np.outer(slope, slope),
        path=path,
        misfit=_misfit(ended),
        modes=modes,
        left_out=left_out,
        curve=ended.curve,
        samples=samples,
        starts=starts,
        ending=ending,
        messages=messages,
        problem=problem,
        fitted=result,
        settings=settings,
    )


def _covariance(ended: Ended, bound: Bools) -> tuple[Floats, Floats]:
    """Return the covariance (n, n) of all unknowns, and the directions that the data do not determine."""
    function, scatter = ended.function, ended.function.scatter
    _, std = function.prior_at(ended.x)
    if scatter is not None and ended.result.size:
        rows = len(ended.x) - len(scatter.std) + scatter.shifts
        std[rows] *= ended.result.size / scatter.eigenvalue
    covariance, blind = covariance_of(function, ended.levels, ended.x, std, ended.precision, bound)
    mixture = ended.result.solution.covariance
    if mixture.shape == covariance.shape and not (blind.size or bound.any() or ended.precision is not None):
        covariance = mixture
    return covariance, blind


def _full_covariance(
    every: Floats, use: Ints, asked: Sequence[ScaledUnknown], function: FitFunction, x: Floats, lost: Bools
) -> tuple[Floats, Floats]:
    """Return the covariance of the parameters of a result on their scales, and the slopes of their values."""
    there = [u.refs in {v.refs for v in function.variables} for u in asked]
    n_damped = len(use) - sum(there)
    at = np.flatnonzero([*there, *[True] * n_damped])
    covariance, slope = np.zeros((len(there) + n_damped,) * 2), np.ones(len(there) + n_damped)
    some = use[~lost[use]]
    covariance[np.ix_(at[~lost[use]], at[~lost[use]])] = every[np.ix_(some, some)]
    n = len(function.variables)
    slope[at] = [function.variables[k].slope(x[k]) if k < n else np.exp(x[k]) for k in use]
    return covariance, slope


def _parameters(
    ended: Ended, asked: Sequence[ScaledUnknown], left_out: set[str], std: Floats, bound: Bools
) -> tuple[UpdatedParameter, ...]:
    function, x, curve = ended.function, ended.x, ended.problem.damping
    row = {v.refs: k for k, v in enumerate(function.variables)}
    out = []
    for u in asked:
        k = row.get(u.refs)
        if k is None:
            xi, deviation, at_bound = u.start, 0.0 if u.name in left_out else np.nan, False
        else:
            xi, deviation, at_bound = float(x[k]), float(std[k]), bool(bound[k])
        value = u.to_value(xi)
        relative = deviation if u.log else deviation * u.scale / max(abs(value), WIDTH * u.scale)
        # Parameters known no better than this, relative to their value, are named [-]
        known = deviation < PRIOR_SHARE * u.std if u.has_prior else relative < 0.5
        out.append(
            UpdatedParameter(
                name=u.name,
                unit=u.unit,
                refs=u.refs,
                start=u.to_value(u.start),
                lower=u.to_value(u.low),
                upper=u.to_value(u.high),
                prior_std=u.prior_std,
                value=value,
                std=float(u.slope(xi) * deviation),
                log=u.log,
                at_bound=at_bound,
                determined=bool(known and u.name not in left_out),
                from_prior=float(abs(xi - u.mean) / u.std) if u.has_prior else np.nan,
            )
        )
    for f, start, (low, high), k in zip(
        curve.knots.tolist(),
        curve.nominal.tolist(),
        np.exp(curve.limits).tolist(),
        _damping_rows(function),
        strict=False,
    ):
        value = float(np.exp(x[k]))
        out.append(
            UpdatedParameter(
                name=f"damping at {f:.4g} Hz",
                unit="-",
                refs=(),
                start=start,
                lower=low,
                upper=high,
                prior_std=curve.std,
                value=value,
                std=float(value * std[k]),
                log=True,
                at_bound=bool(bound[k]),
                determined=bool(std[k] < PRIOR_SHARE * curve.std),
            )
        )
    return tuple(out)


def _misfit(ended: Ended) -> dict[str, float]:
    """Return the mean squares of the residuals in units of the stated noise, of modes and FRFs [-]."""
    function, v, noise = ended.function, ended.function.misfit(ended.x), ended.function.noise()
    size = np.unique(function.groups, return_counts=True)[1]
    modal = function.of_modes
    noise = np.where(modal, noise, noise / SYSTEMATIC_FROM**2)
    parts = (("modes", modal), ("frf", ~modal))
    each = size * v / noise
    return {name: float(each[rows].sum() / size[rows].sum()) for name, rows in parts if rows.any()}


def _messages(
    ended: Ended,
    result: FitResult,
    done: tuple[UpdatedParameter, ...],
    correlation: Floats,
    modes: ComputedModes | None,
    ending: Ending,
) -> tuple[str, ...]:
    out = []
    if ending is not Ending.CONVERGED:
        out.append(f"{ending.value[0]}: {ending.cause}; {ending.remedy}")
    at = [p.name for p in done if p.at_bound and p.refs]
    if at:
        out.append(f"at a bound: {', '.join(at)}; they may stand in for an effect that the model lacks")
    away = [(p.name, p.from_prior) for p in done if np.isfinite(p.from_prior)]
    far = ", ".join(f"{name} by {z:.0f}" for name, z in away if z > NAMED_DEVIATIONS)
    if far:
        out.append(
            f"values far from their priors, in standard deviations: {far}. Priors that are wrong bias every "
            "correlated parameter: widen them, or look for an effect that the model lacks"
        )
    loose = [
        p.name
        for p in done
        if not p.determined
        and p.std > 0
        and not p.at_bound
        and np.isfinite(p.std)
        and dict(away).get(p.name, 0.0) <= NAMED_DEVIATIONS
    ]
    if loose:
        out.append(
            f"the data do not determine {', '.join(loose)}: their values are those of the start or the prior"
        )
    pairs_of = [
        f"{done[i].name} with {done[j].name} ({correlation[i, j]:+.3f})"
        for i in range(len(done))
        for j in range(i)
        # Pairs of parameters whose estimates are more correlated than this are named [-]
        if abs(correlation[i, j]) > 0.95 and done[i].refs
    ]
    if pairs_of:
        out.append(f"correlated, so that only a combination is well known: {'; '.join(pairs_of[:8])}")
    fit = replace(result, levels=ended.levels, misfit=ended.function.misfit(ended.x))
    if fit.gain_to(ended.function.allowed_squares()) > UNKNOWN_ODDS:
        worst = ", ".join(f"{name} by {np.sqrt(q):.1f}" for name, q in _misfit(ended).items())
        out.append(
            f"the data are not explained: root mean square residuals, over the stated noise, of {worst}. The "
            "model lacks an effect or is wrong, or the start was too far off (try more starts)"
        )
    measured = ended.problem.measured_modes
    if modes is not None and measured is not None:
        f = measured.frequency
        words = ", ".join(f"{f[i]:.4g} Hz" for i in np.flatnonzero(modes.partner < 0))
        if words:
            out.append(f"measured modes without a partner in the model: {words}")
    if ended.curve is not None and not ended.curve.distinct:
        out.append(
            "the L-curve has no distinct corner: the weight of the regularisation is the largest that leaves "
            "no more than noise"
        )
    return tuple(out)


def _unmoved(ended: Ended, rows: Ints, modes: ComputedModes | None) -> list[str]:
    """Name the measured modes that no parameter moves and the model misses."""
    function, measured = ended.function, ended.problem.measured_modes
    steps = np.zeros(len(ended.x))
    steps[rows] = widths_of(function)[rows]
    change = function.changes_of_modes(ended.x, steps)
    if not change.size or modes is None or measured is None:
        return []
    seen, f, std = change > SEEN, measured.frequency, measured.frequency_std
    off = np.where(modes.partner >= 0, modes.frequency / f - 1, 0.0)
    still = np.flatnonzero(~seen & (np.abs(off) > 2 * std))
    if not still.size:
        return []
    some = ", ".join(f"{f[i]:.4g} Hz ({100 * off[i]:+.2g} %)" for i in still[:6])
    more = f", and {still.size - 6} more" if still.size > 6 else ""
    return [
        f"no parameter moves the modes paired with {some}{more}: check that measured and computed modes are "
        "the same ones, by giving shapes or mode numbers"
    ]


def _moved_besides(ended: Ended, rows: Ints) -> list[str]:
    """Name what varied with the parameters and went far from where it is known to be."""
    function, n = ended.function, len(ended.function.variables)
    prior = function.prior()
    z = ((ended.x - prior.mean) / prior.std)[:n]
    # What varies besides and is further from nominal, in prior standard deviations, is named [-]
    far = [k for k in np.setdiff1d(np.arange(n), rows).tolist() if abs(z[k]) > 2.5]
    if not far:
        return []
    words = ", ".join(f"{' '.join(function.variables[k].ref)} by {z[k]:+.1f}" for k in far)
    return [
        "the form varied with the parameters, and these went far from nominal, in prior standard deviations: "
        f"{words}. They may stand for an effect that the model lacks"
    ]


def _samples(
    ended: Ended, asked: Sequence[ScaledUnknown], covariance: Floats, kept: Bools, settings: UpdateSettings
) -> Samples:
    function = ended.function
    rows = np.concatenate([rows_of(function, asked), _damping_rows(function)])
    free = rows[~kept[rows]]
    if not free.size:
        msg = "there is nothing to sample: the data determine none of the unknowns"
        raise ModelError(msg)
    low, high = function.limits()[free].T
    density = marginal_density(function, ended.levels, ended.x, free, function.prior())

    def log_probability(part: Floats) -> float:
        inside = (part >= low).all() and (part <= high).all()
        try:
            return density(part) if inside else -np.inf
        except np.linalg.LinAlgError:  # no structure there
            return -np.inf

    drawn = sample(
        log_probability, ended.x[free], covariance[np.ix_(free, free)], settings.n_samples, seed=settings.seed
    )
    x = np.tile(ended.x, (len(drawn.values), 1))
    x[:, free] = drawn.values
    return replace(drawn, values=np.array([values_of(asked, function, row) for row in x]))
