"""The result of an update from where its fit ended: deviations, messages and samples."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fem.model import ModelError
from updating.inference.determined import SEEN, SHARE, blind_words, split_covariance, taking_part
from updating.inference.mode_residual import ModePairs
from updating.inference.sampling import Samples, sample
from updating.inference.unknowns import WIDTH
from updating.inference.update_problem import UpdatePoint, UpdateProblem
from updating.inference.updated import Ending, Updated, UpdatedParameter, UpdateStep

NAMED_CORRELATION = 0.95
"""Pairs of parameters whose estimates are more correlated than this are named [-]."""

DETERMINED_STD = 0.5
"""Parameters known no better than this, relative to their value, are named [-]."""

PRIOR_SHARE = 0.9
"""Of parameters whose standard deviation stays above this part of the prior's the data say nothing [-]."""

STATED_SHARE = 0.5
"""Parameters whose deviation without a stated error is below this part of that with it are named [-]."""

NAMED_DEVIATIONS = 4.0
"""Parameters that end farther from their prior than this, in its standard deviations, are named [-]."""


def result_of(
    problem: UpdateProblem,
    state: UpdatePoint | None,
    path: tuple[UpdateStep, ...],
    starts: tuple[tuple[NDArray[np.float64], float], ...],
    left_out: tuple[tuple[str, str], ...],
    ending: Ending,
) -> Updated:
    """Return the result at a point, with standard deviations and all that is to be said of it."""
    x = problem.start if state is None else state.x
    A = np.zeros((len(x), len(x))) if state is None else problem.normal(state)[0]
    low, high = problem.limits
    widths = problem.widths
    bound = ~problem.frozen & ((x <= low + 1e-9 * widths) | (x >= high - 1e-9 * widths))
    all_covariance, blind = split_covariance(A, widths, problem.prior_information, problem.frozen | bound)
    lost = taking_part(blind)
    of_shifts, of_gains = problem.parts[2:]
    n = problem.parts[1].stop
    unknowns, frozen = problem.unknowns[:n], problem.frozen[:n]
    covariance = all_covariance[:n, :n]
    all_std = np.sqrt(np.maximum(np.diag(all_covariance), 0.0))
    std_x = np.where(lost, np.inf, np.where(bound, np.nan, all_std))[:n]
    slope = np.array([u.slope(xi) for u, xi in zip(unknowns, x[:n], strict=True)])
    known = (covariance.diagonal() > 0) & ~lost[:n]
    size = np.where(known, np.sqrt(np.maximum(covariance.diagonal(), 0.0)), 1.0)
    correlation = np.where(np.outer(known, known), covariance, 0.0) / np.outer(size, size)
    np.fill_diagonal(correlation, 1.0)
    done = []
    for i, u in enumerate(unknowns):
        value = u.to_value(x[i])
        relative = std_x[i] if u.log else std_x[i] * u.scale / max(abs(value), WIDTH * u.scale)
        known = std_x[i] < PRIOR_SHARE * u.std if np.isfinite(u.std) else relative < DETERMINED_STD
        done.append(
            UpdatedParameter(
                name=u.name,
                unit=u.unit,
                refs=u.refs,
                start=u.to_value(u.start),
                lower=u.to_value(u.low),
                upper=u.to_value(u.high),
                prior_std=u.prior_std,
                value=value,
                std=float(slope[i] * std_x[i]),
                log=u.log,
                at_bound=bool(bound[i]),
                determined=bool(known and not frozen[i]),
                from_prior=float(abs(x[i] - u.mean) / u.std) if u.refs and np.isfinite(u.std) else np.nan,
            )
        )
    misfit = {} if state is None else {g.name: g.q for g in state.groups}
    pairs = None if state is None or state.modes is None else state.modes.pairs
    alone = (blind**2).sum(axis=1) > 1 - SHARE
    asked = [i for i in range(len(done)) if done[i].refs and not frozen[i]]
    moved = np.abs(x - np.array([u.start for u in problem.unknowns])) > 1e-6 * widths
    if state is not None and asked and (alone & ~moved)[asked].all():
        ending = Ending.NOTHING_DETERMINED
    messages = _messages(problem, tuple(done), correlation, frozen, misfit, pairs, ending)
    if state is not None:
        names = [u.name for u in problem.unknowns]
        messages = (
            *messages,
            *blind_words(blind, names, _measured_words(problem), moved),
            *_unmoved(problem, state),
            *_stated_error_words(problem, state, A, problem.frozen | bound, all_std),
        )
    samples = None
    if problem.settings.n_samples and state is not None and ending is not Ending.NOT_FINITE:
        samples = _samples(problem, state, all_covariance, lost | bound)
    knots = np.zeros(0) if problem.shift_knots is None else problem.shift_knots
    return Updated(
        model=problem.model_at(x),
        parameters=tuple(done),
        correlation=correlation,
        covariance=covariance * np.outer(slope, slope),
        path=path,
        misfit=misfit,
        pairs=pairs,
        frequency=np.zeros(0) if problem.modes is None else problem.modes.frequency,
        shifts=_shifts(knots, x[of_shifts], all_covariance[of_shifts, of_shifts]),
        gains=np.stack([np.exp(x[of_gains]), all_std[of_gains]], axis=1),
        left_out=left_out,
        curve=problem.curve,
        samples=samples,
        starts=starts,
        ending=ending,
        messages=messages,
    )


def _shifts(
    knots: NDArray[np.float64], x: NDArray[np.float64], covariance: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return frequency, common and own shift together, and its standard deviation, (k, 3)."""
    if not knots.size:
        return np.zeros((0, 3))
    sums = np.hstack([np.ones((len(knots), 1)), np.eye(len(knots))])
    std = np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", sums, covariance, sums), 0.0))
    return np.stack([knots, sums @ x, std], axis=1)


def _messages(
    problem: UpdateProblem,
    done: tuple[UpdatedParameter, ...],
    correlation: NDArray[np.float64],
    frozen: NDArray[np.bool_],
    misfit: Mapping[str, float],
    pairs: ModePairs | None,
    ending: Ending,
) -> tuple[str, ...]:
    out = []
    if ending is not Ending.CONVERGED:
        out.append(f"{ending.value[0]}: {ending.cause}; {ending.remedy}")
    at = [p.name for p in done if p.at_bound]
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
        for p, f in zip(done, frozen, strict=True)
        if not p.determined
        and not f
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
        if abs(correlation[i, j]) > NAMED_CORRELATION and done[i].refs and not (frozen[i] or frozen[j])
    ]
    if pairs_of:
        out.append(f"correlated, so that only a combination is well known: {'; '.join(pairs_of[:8])}")
    for name, q in misfit.items():
        if q > 2:
            what = "modes" if name == "modes" else "FRFs"
            out.append(
                f"the model misses the {what} by {np.sqrt(q):.1f} times the stated noise and model error. "
                "Standard deviations are widened by it, but the model lacks an effect or is wrong, or the "
                "start was too far off (try more starts)"
            )
    if pairs is not None and problem.modes is not None and pairs.lost:
        words = ", ".join(f"{problem.modes.frequency[i]:.4g} Hz" for i in pairs.lost)
        out.append(f"measured modes without a partner in the model: {words}")
    if problem.curve is not None and not problem.curve.distinct:
        out.append("the L-curve has no distinct corner: the regularisation weight is arbitrary")
    return tuple(out)


def _measured_words(problem: UpdateProblem) -> str:
    """Return the kind of data, in the singular."""
    parts = []
    if problem.modes is not None:
        parts.append("measured mode")
    if problem.frf is not None:
        parts.append("measured FRF")
    return " or ".join(parts)


def _unmoved(problem: UpdateProblem, state: UpdatePoint) -> list[str]:
    """Name the measured modes that no parameter moves and the model misses."""
    data, point = problem.modes, state.modes
    if data is None or point is None or problem.frf is not None or state.groups[0].J is None:
        return []
    n, ok = len(data.frequency), point.pairs.partner >= 0
    width = np.array([u.width for u in problem.unknowns])[problem.parts[0]]
    J = state.groups[0].J[problem.parts[0], :n] * width[:, None]
    std = np.sqrt(np.diag(data.covariance))
    by_log = np.abs(np.linalg.solve(data.whitening(ok), J.T)).max(axis=1, initial=0.0)  # of ln f
    if data.shapes is not None:
        rest = state.groups[0].J[problem.parts[0], n:].reshape(len(width), n, -1) * width[:, None, None]
        by_log = np.maximum(by_log, std * np.abs(rest).max(axis=(0, 2), initial=0.0))
    off = np.where(ok, point.pairs.computed / data.frequency - 1, 0.0)
    still = np.flatnonzero(ok & (by_log < SEEN * std) & (np.abs(off) > 2 * std))
    if not still.size:
        return []
    some = ", ".join(f"{data.frequency[i]:.4g} Hz ({100 * off[i]:+.2g} %)" for i in still[:6])
    more = f", and {still.size - 6} more" if still.size > 6 else ""
    return [
        f"no parameter moves the modes paired with {some}{more}: check that measured and computed modes are "
        "the same ones, by giving shapes or mode numbers"
    ]


def _stated_error_words(
    problem: UpdateProblem,
    state: UpdatePoint,
    A: NDArray[np.float64],
    fixed: NDArray[np.bool_],
    std: NDArray[np.float64],
) -> list[str]:
    """Name the parameters whose variance is mostly that of the stated errors of frequencies or amplitudes."""
    if problem.frf is None:
        return []
    out = []
    _, _, of_shifts, of_gains = problem.parts
    for name, error, part in (
        ("model_error", problem.frf.model_error, of_shifts),
        ("amplitude_error", problem.frf.amplitude_error, of_gains),
    ):
        without = fixed.copy()
        without[part] = True
        covariance, _ = split_covariance(A, problem.widths, problem.prior_information, without)
        exact = np.sqrt(covariance.diagonal())
        some = [
            f"{u.name} ({s * slope:.2g}; {e * slope:.2g} if it were 0)"
            for u, s, e, slope in (
                (u, std[i], exact[i], u.slope(state.x[i])) for i, u in enumerate(problem.unknowns) if u.refs
            )
            if 0 < e < STATED_SHARE * s
        ]
        if some:
            out.append(
                f"the stated {name} of {100 * error:.3g} % makes most of the standard deviation of "
                f"{', '.join(some)}: state it as well as it is known"
            )
    return out


def _samples(
    problem: UpdateProblem, state: UpdatePoint, covariance: NDArray[np.float64], kept: NDArray[np.bool_]
) -> Samples:
    low, high = problem.limits
    free = ~problem.frozen & ~kept
    if not free.any():
        msg = "there is nothing to sample: the data determine none of the unknowns"
        raise ModelError(msg)
    weights = {g.name: g.factor for g in state.groups}
    problem = replace(problem, before=None if state.modes is None else state.modes.pairs)

    def log_probability(part: NDArray[np.float64]) -> float:
        x = state.x.copy()
        x[free] = part
        if ((x < low) | (x > high)).any():
            return -np.inf
        trial = problem.tried(x)
        if trial is None:
            return -np.inf
        return -problem.prior(x) - 0.5 * sum(weights[g.name] * g.square for g in trial.groups)

    drawn = sample(
        log_probability, state.x[free], covariance[np.ix_(free, free)], problem.settings.n_samples,
        seed=problem.settings.seed,
    )  # fmt: skip
    x = np.tile(state.x, (len(drawn.values), 1))
    x[:, free] = drawn.values
    x = x[:, : problem.parts[1].stop]
    values = np.stack(
        [
            np.exp(column) if u.log else column * u.scale
            for u, column in zip(problem.unknowns[: x.shape[1]], x.T, strict=True)
        ],
        axis=1,
    )
    return replace(drawn, values=values)
