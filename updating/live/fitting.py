"""Fits of a hypothesis that say how far they are and can be ended."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from fem.array_types import Complexes, Floats
from fem.model import Effect, parameter_values
from updating.diagnosis.begin import begin_fitted
from updating.diagnosis.findings import label
from updating.inference.fit import FitProblem
from updating.inference.fit_result import FitResult
from updating.inference.fitting import QUICK_LINES, fit, fit_given, refit, scattered
from updating.inference.frf_function import FrfFunction
from updating.inference.frf_jacobian import FrfJacobian
from updating.inference.solve import Solution
from updating.live.engine import LiveModel
from updating.live.hypothesis import Hypothesis

Progress = Callable[[str, float], None]
"""Called with a text and the fraction done; an error that it raises ends the fit."""
STEPS = 20
"""Evaluations that a stage of a fit takes for its share of the progress [-]."""


class Watch:
    """Counts the stages of fits, and tells how far they are.

    Parameters
    ----------
    progress : callable
        Called with a text and the fraction done; an exception from it ends the fit.
    text : str
    stages : int
        Stages to be expected.
    """

    def __init__(self, progress: Progress, text: str, stages: int) -> None:
        self._progress, self._text, self._total = progress, text, max(stages, 1)
        self._stage, self._step = 0, 0

    def stage(self) -> None:
        """Begin another stage."""
        self._stage, self._step = self._stage + 1, 0

    def step(self) -> None:
        """Tell of one more evaluation."""
        self._step += 1
        within = 1 - np.exp(-self._step / STEPS)
        self._progress(self._text, min((self._stage - 1 + within) / max(self._total, self._stage), 0.99))


@dataclass(eq=False)
class _WatchedFunction(FrfFunction):
    """Residuals that report each evaluation, with some unknowns fixed."""

    watch: Watch | None = None
    free: frozenset[str] | None = None
    _begun: Floats | None = None

    def __call__(self, x: Floats, gradient: bool) -> tuple[Complexes, Complexes | None]:
        if self.watch is not None and not gradient:
            self.watch.step()
        return super().__call__(x, gradient)

    def linearised(self, x: Floats) -> tuple[Complexes, FrfJacobian]:
        if self.watch is not None:
            self.watch.step()
        return super().linearised(x)

    def minimise(self, x: Floats, stage: float, max_iterations: int, **more: Any) -> Solution:
        if self.watch is not None:
            self.watch.stage()
        limits = super().limits()
        self._begun = np.clip(x, limits[:, 0], limits[:, 1])
        return super().minimise(x, stage, max_iterations, **more)

    def limits(self) -> Floats:
        limits = super().limits()
        if self.free is None or self._begun is None:
            return limits
        added = {e.name for e in self.effects}
        names = [v.ref[0] if v.ref[0] in added else "" for v in self.variables]
        fixed = np.array([name not in self.free for name in names + [""] * (len(limits) - len(names))])
        limits[fixed] = self._begun[fixed, None]
        return limits


def fit_uncertain(live: LiveModel, h: Hypothesis, progress: Progress) -> Hypothesis:
    """Fit the uncertain parameters and the damping; added effects keep their values.

    Without effects it is the fit of `dovetail compare --fitted`, which also sets sensors right that are
    plainly at fault.
    """
    problem = live.problem_of(h)
    if not h.effects:
        watch = Watch(progress, "fitting uncertain parameters", len(problem.stages) + 8)
        _, result, faults = begin_fitted(_watched(problem, watch), choose_damping=False)
        return _learnt(live, replace(h, faults=(*h.faults, *faults)).at(result))
    watch = Watch(progress, "fitting uncertain parameters", 2)
    watched = _watched(problem, watch, frozenset({""}))
    return _learnt(live, h.at(watched.assessed(_better(watched, h))))


def fit_effect(live: LiveModel, h: Hypothesis, name: str, progress: Progress) -> Hypothesis:
    """Fit the parameters of one added effect, from their values and from its starts; all else is fixed."""
    problem, effect = live.problem_of(h), h.effect(name)
    starts = [parameter_values(effect), *effect.starts(problem.surroundings)]
    watch = Watch(progress, f"fitting {label(effect)}", len(starts) + 1)
    watched = _watched(problem, watch, frozenset({name}))
    now = h.result()
    last = watched.stages[-1:]
    fits = [
        fit(watched, h.effects, _starts(h, effect, start), stages=last, n_lines=QUICK_LINES, x_from=now)
        for start in starts
    ]
    return _learnt(live, h.at(watched.assessed(refit(watched, max(fits, key=lambda r: r.log_evidence)))))


def fit_all(live: LiveModel, h: Hypothesis, progress: Progress) -> Hypothesis:
    """Fit the added effects, the uncertain parameters and the damping: from their values, and from starts."""
    if not h.effects:
        return fit_uncertain(live, h, progress)
    problem = live.problem_of(h)
    n_starts = sum(len(e.starts(problem.surroundings)) for e in h.effects)
    watch = Watch(progress, "fitting all", 2 + n_starts + len(problem.stages))
    every = _watched(problem, watch)
    here, anew = _better(every, h), fit_given(every, h.effects, choose_damping=False)[1]
    return _learnt(live, h.at(every.assessed(max(here, anew, key=lambda r: r.log_evidence))))


def _learnt(live: LiveModel, h: Hypothesis) -> Hypothesis:
    """Return a fitted hypothesis, whose responses the basis has."""
    live.learn(h)
    return h


def _better(problem: FitProblem, h: Hypothesis) -> FitResult:
    """Return the better of a fit from where the values are and one from nominal uncertain parameters."""
    starts = [parameter_values(e) for e in h.effects]
    last = problem.stages[-1:]
    here = fit(problem, h.effects, starts, stages=last, x_from=h.result())
    anew = fit(problem, h.effects, starts, stages=last)
    return scattered(problem, max(here, anew, key=lambda r: r.log_evidence))


def _starts(h: Hypothesis, effect: Effect, start: dict[str, float]) -> list[dict[str, float]]:
    return [start if e is effect else parameter_values(e) for e in h.effects]


def _watched(problem: FitProblem, watch: Watch, free: frozenset[str] | None = None) -> FitProblem:
    """Return a problem whose fits report their progress.

    ``free`` holds the names of the effects that vary, and ``""`` for uncertain parameters and damping; None
    lets all vary.
    """
    return replace(problem, make_function=partial(_WatchedFunction, watch=watch, free=free))
