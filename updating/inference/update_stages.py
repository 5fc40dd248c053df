"""The stages of an update: rising bands, new bases, several starts, and priors that the data contradict."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fem.analysis.frf import FRFError
from fem.model import ModelError
from updating.inference.determined import blind_directions, taking_part
from updating.inference.regularisation import l_curve, select_by_pivoting, select_forward
from updating.inference.unknowns import WIDTH
from updating.inference.update_problem import UpdatePoint, UpdateProblem
from updating.inference.update_result import result_of
from updating.inference.updated import Ending, Updated, UpdateStep
from updating.least_squares.levenberg_marquardt import (
    Control,
    Stop,
    Tolerance,
    minimise,
    movable,
    promised_gain,
)

_MOST_RELEASED = 3
"""At most so many priors are let go, one after the other."""

_WORSE_RATIO = 1.5
"""A fit without a prior counts if its misfit is at most so many times that with it [-]."""

_LONGEST_STEP = 0.4
"""Longest step of any unknown in one iteration, in ln θ or units of its scale."""

_FIRST_DAMPING = 1e-5
"""Damping of the first step: derivatives are exact, so that the undamped step is nearly right [-]."""

_SMALL_GAIN = 1e-6
"""An iteration ends when half the square of the step, in standard deviations, is below this [nats]."""

_STAGE_GAIN = 1e-2
"""The same for a stage that another one follows [nats]."""

_ROUNDING_GAIN = 1e-3
"""Where no step lowers the cost, a promised gain below this is put down to rounding [nats]."""

_REBASES = 6
"""So many times at most the reduced basis of the FRFs is made again at the new values."""

BETTER_NATS = 1.0
"""Log posterior by which another model is better than the fitted one [nats]."""

_ENDINGS = {
    Stop.CONVERGED: Ending.CONVERGED,
    Stop.AT_BOUNDS: Ending.AT_BOUNDS,
    Stop.OUT_OF_ITERATIONS: Ending.OUT_OF_ITERATIONS,
}

_FAILED = (Ending.NO_PARTNERS, Ending.NOT_FINITE, Ending.NOTHING_DETERMINED, Ending.AT_BOUNDS)
"""Ends of a fit that tell nothing of the priors."""

Fitted = tuple[UpdatePoint, Ending, UpdateProblem]
"""Where a stage ended, how, and the problem with modes followed from there."""


def _descend(
    problem: UpdateProblem,
    x: NDArray[np.float64],
    enough: float,
    max_iterations: int,
    report: Callable[[UpdateStep], None],
) -> Fitted:
    """Lower the cost from x until a step promises less than ``enough`` [nats]."""
    low, high = problem.limits
    control = Control(
        reach=lambda x: np.full(len(x), _LONGEST_STEP),
        promised_gain=Tolerance(enough),
        actual_gain=Tolerance(),  # a cut or damped step may gain little far from the minimum
        max_iterations=max_iterations,
        damping=_FIRST_DAMPING,
        trusted_damping=_FIRST_DAMPING,
    )
    start = problem.state(np.clip(x, low, high), True)
    found = minimise(problem, start, (low, high), control, lambda point, _: report(problem.step_of(point)))
    last = found.linearisation
    state = last.at if last.at.x is found.point.x else problem.derived(found.point)
    ending = _ENDINGS.get(found.stop, Ending.STUCK)
    if found.stop is Stop.NO_DESCENT:
        promised = promised_gain(last, movable(state.x, last, (low, high)))
        ending = Ending.CONVERGED if promised < max(100 * enough, _ROUNDING_GAIN) else Ending.STUCK
    return state, ending, problem.following(state)


def _run(problem: UpdateProblem) -> Updated:
    settings = problem.settings
    path: list[UpdateStep] = []
    starts: list[tuple[NDArray[np.float64], float]] = []
    x = problem.start
    last = 4 * settings.n_lines
    stages = settings.stages if problem.frf is not None else (1.0,)
    try:
        first = problem.based(x, 1.0, last)
        state = first.state(x, True)
        failed = None if np.isfinite(state.cost) else Ending.NOT_FINITE
    except FRFError:
        failed, state, first = Ending.NOT_FINITE, None, problem
    if failed is None and state is not None and state.modes is not None and problem.frf is None:
        failed = Ending.NO_PARTNERS if (state.modes.pairs.partner < 0).all() else None
    if state is not None:
        path.append(first.step_of(state))
    if failed is not None and not (failed is Ending.NO_PARTNERS and settings.n_starts > 1):
        return result_of(first, state, tuple(path), (), (), failed)
    assert state is not None
    problem, left_out = _selected(problem, first, x)
    if settings.n_starts > 1:
        x, starts = _best_start(problem, stages)
    ending, staged = Ending.CONVERGED, first
    for k, part in enumerate(stages):
        final = k == len(stages) - 1
        staged = problem.based(x, part, last if final else settings.n_lines)
        if final and problem.frf is not None:
            problem, x = staged.with_nuisances(x)
            staged = problem.based(x, part, last)
        enough = _SMALL_GAIN if final and problem.frf is None else _STAGE_GAIN
        if final and settings.regularisation:
            problem, staged = _regularised(problem, staged, x)
        state, ending, staged = _descend(staged, x, enough, settings.max_iterations, path.append)
        x = state.x
        problem = replace(problem, before=staged.before, near=staged.near)
    if problem.frf is not None:
        steps: list[UpdateStep] = []
        state, ending, staged = _rebased(problem, x, False, steps)
        # Between resonances the model's damping and the engine's differ: the data decide, by all residuals.
        more: list[UpdateStep] = []
        own = _rebased(problem, state.x, True, more)
        if own[1] is Ending.CONVERGED and own[0].cost < state.cost:
            (state, ending, staged), steps = own, steps + more
        path += steps
        x = state.x
        problem = replace(problem, before=staged.before, near=staged.near)
    if settings.regularisation:
        problem, staged = _regularised(problem, staged, x)
        state, ending, staged = _descend(staged, x, _SMALL_GAIN, settings.max_iterations, path.append)
    (state, ending, staged), said = _no_worse(problem, (state, ending, staged), path)
    done = result_of(staged, state, tuple(path), tuple(starts), left_out, ending)
    return replace(done, messages=(*said, *done.messages)) if said else done


def _no_worse(
    problem: UpdateProblem, found: Fitted, path: list[UpdateStep]
) -> tuple[Fitted, tuple[str, ...]]:
    """Return a fit that is no worse than the model it began with, with or without the effects in question.

    Stages, starts and far minima may lead away from a start that was better in the whole band. Where one of
    these simple models beats the fitted one, the fit goes on from there.
    """
    began, names = len(path), [u.name for u in problem.unknowns]
    simple: list[tuple[str, NDArray[np.float64]]] = [("the start", _filled(problem, problem.start))]
    absent = np.array([u.absent for u in problem.unknowns])
    gone = np.isfinite(absent) & ~problem.frozen & (absent != problem.start[: len(absent)])
    if gone.any():
        what = f"the model with {', '.join(n for n, g in zip(names, gone, strict=True) if g)} absent"
        for x in (problem.start, found[0].x):
            simple.append((what, np.where(gone, absent, x)))
    said: tuple[str, ...] = ()
    for what, x in simple:
        staged = problem.based(x, 1.0, 4 * problem.settings.n_lines)
        at = replace(staged, before=None, near=None).tried(x)
        if at is None or not at.cost < found[0].cost - BETTER_NATS:
            continue
        try:
            if problem.frf is None:
                again = _descend(
                    replace(staged, before=None), x, _SMALL_GAIN, problem.settings.max_iterations, path.append
                )
            else:
                again = _rebased(replace(problem, before=None), x, False, path)
        except (ModelError, FRFError, np.linalg.LinAlgError):
            continue
        if again[0].cost < found[0].cost:
            found = again
            said = (f"the fit ended worse than {what}, and was repeated from there",)
    if said and len(path) == began:
        said = (f"{said[0]}; no step lowered the misfit",)
    return found, said


def _filled(problem: UpdateProblem, x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return x with zeros for the model's own errors where they are unknown too."""
    return np.concatenate([x, np.zeros(len(problem.unknowns) - len(x))])


def _rebased(
    problem: UpdateProblem, x: NDArray[np.float64], own_damping: bool, steps: list[UpdateStep]
) -> tuple[UpdatePoint, Ending, UpdateProblem]:
    """Fit all FRFs on bases made at the new values, until these move by less than a tenth of a deviation."""
    settings = problem.settings
    count = 0
    while True:
        staged = problem.based(x, 1.0, 4 * settings.n_lines, own_damping)
        state, ending, staged = _descend(staged, x, _SMALL_GAIN, settings.max_iterations, steps.append)
        problem = replace(problem, before=staged.before, near=staged.near)
        moved = state.x - x
        x = state.x
        count += 1
        if count == _REBASES or float(moved @ staged.normal(state)[0] @ moved) < 0.01:
            return state, ending, staged


def run_and_release(base: UpdateProblem) -> Updated:
    """Run; where the data contradict a prior beyond doubt, let it go and run again from the value found.

    A wrong prior pulls at all that is correlated with its parameter, which ends wrong with it. The worst goes
    first, as it may have moved the others.
    """
    problem, result, kept = base, _run(base), ""
    gone: dict[int, str] = {}
    for _ in range(_MOST_RELEASED):
        away = np.nan_to_num([p.from_prior for p in result.parameters])
        worst = int(np.argmax(away)) if away.size else 0
        if not away.size or not away[worst] > base.settings.contradicted:
            break
        p, u = result.parameters[worst], problem.unknowns[worst]
        begin = float(np.clip(u.to_x(p.value), u.low, u.high))
        free = replace(u, start=begin, std=np.inf, width=WIDTH)
        trial = replace(
            problem, unknowns=tuple(free if k == worst else o for k, o in enumerate(problem.unknowns))
        )
        again = _run(trial)
        if again.ending in _FAILED or sum(again.misfit.values()) > _WORSE_RATIO * sum(result.misfit.values()):
            kept = (
                f"the data contradict the prior of {p.name} by {away[worst]:.0f} of its standard deviations, "
                "but the fit fails without it; the prior was kept"
            )
            break
        gone[worst] = f"{p.name} by {away[worst]:.0f}"
        problem = trial
        path = (*result.path, *(replace(s, stage=f"again {s.stage}") for s in again.path))
        result = replace(again, path=path)
    if not gone:
        return replace(result, messages=(*result.messages, kept)) if kept else result
    first = _starts_of(base)
    parameters = tuple(
        replace(
            p, start=first[k], released=k in gone,
            from_prior=abs(base.unknowns[k].to_x(p.value) - base.unknowns[k].mean) / base.unknowns[k].std
            if k in gone
            else p.from_prior,
        )
        for k, p in enumerate(result.parameters)
    )  # fmt: skip
    said = (
        f"the data contradict priors, in standard deviations: {', '.join(gone.values())}. They were dropped "
        "and the fit was repeated. If a value is impossible, the model lacks an effect there: search for it "
        "with dovetail run"
    )
    messages = (said, *([kept] if kept else []), *result.messages)
    return replace(result, parameters=parameters, messages=messages)


def _starts_of(problem: UpdateProblem) -> list[float]:
    return [u.to_value(u.start) for u in problem.unknowns]


def _best_start(
    problem: UpdateProblem, stages: Sequence[float]
) -> tuple[NDArray[np.float64], list[tuple[NDArray[np.float64], float]]]:
    """Run from several starts on fewer lines; return the point with the lowest cost."""
    settings = problem.settings
    random = np.random.default_rng(settings.seed)
    low, high = problem.limits
    width = np.array([min(u.width, 0.5) for u in problem.unknowns])
    compare = problem.based(problem.start, 1.0, settings.n_lines)
    A = compare.normal(compare.state(problem.start, True))[0]
    # directions without data stay where they are
    width[taking_part(blind_directions(A, problem.widths, problem.prior_information))] = 0.0
    low_x, high_x = np.maximum(low, problem.start - 3 * width), np.minimum(high, problem.start + 3 * width)
    found: list[tuple[NDArray[np.float64], float]] = []
    begin = [problem.start]
    begin += [
        np.clip(problem.start + width * random.standard_normal(len(width)), low_x, high_x)
        for _ in range(settings.n_starts - 1)
    ]
    for x in begin:
        try:
            for part in (*stages, 1.0, 1.0):  # a basis made far away misleads
                staged = problem.based(x, part, max(60, settings.n_lines // 3))
                x = _descend(staged, x, 0.1, settings.max_iterations, lambda step: None)[0].x
            whole = replace(compare, residual=problem.based(x, 1.0, settings.n_lines).residual)
            found.append((x, whole.state(x, False).cost))
        except (ModelError, FRFError, np.linalg.LinAlgError):
            continue
    if not found:
        return problem.start, []
    best = min(found, key=lambda one: one[1])[0]
    values = [
        (np.array([u.to_value(xi) for u, xi in zip(problem.unknowns, x, strict=True)]), cost)
        for x, cost in found
    ]
    return best, values


def _selected(
    problem: UpdateProblem, staged: UpdateProblem, x: NDArray[np.float64]
) -> tuple[UpdateProblem, tuple[tuple[str, str], ...]]:
    """Hold the parameters that selection leaves out at their start; the model's own errors count as noise."""
    how = problem.settings.select
    if not how:
        return problem, ()
    staged, extended = staged.with_nuisances(x)
    staged = staged.based(extended, 1.0, problem.settings.n_lines)
    A, r = staged.reduced(staged.state(extended, True), True)
    A = A * np.array([u.width for u in problem.unknowns[: A.shape[1]]])
    names = [u.name for u in problem.unknowns[: A.shape[1]]]
    pivoting = how == "pivoting"
    chosen = select_by_pivoting(A, names) if pivoting else select_forward(A, -r, names)
    if not chosen.kept:
        return problem, ()
    fixed = tuple((one.index, problem.unknowns[one.index].start) for one in chosen.left_out)
    reasons = tuple((names[one.index], one.reason) for one in chosen.left_out)
    return replace(problem, fixed=fixed), reasons


def _regularised(
    problem: UpdateProblem, staged: UpdateProblem, x: NDArray[np.float64]
) -> tuple[UpdateProblem, UpdateProblem]:
    """Weigh distances from the start by the λ at the L-curve's corner of the problem linearised at x."""
    state = staged.state(x, True)
    B, r = staged.reduced(state, False)
    n = B.shape[1]
    L = np.diag([1 / u.width for u in problem.unknowns[:n]])
    if problem.settings.regularisation == "gsvd":
        L = np.array(problem.settings.operator, dtype=float, ndmin=2)
    if L.shape[1] != n:
        names = ", ".join(u.name for u in problem.unknowns[:n])
        msg = f"the operator has {L.shape[1]} columns; there are {n} parameters: {names}"
        raise ModelError(msg)
    curve = l_curve(B, B @ (x - problem.start)[:n] - r, L)
    precision = np.zeros((len(x), len(x)))
    precision[:n, :n] = curve.chosen**2 * (L.T @ L)
    return replace(problem, precision=precision, curve=curve), replace(
        staged, precision=precision, curve=curve
    )
