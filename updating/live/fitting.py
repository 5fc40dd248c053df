"""Fits of a hypothesis that say how far they are and can be ended."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from fem.array_types import Complexes, Floats
from fem.model import Effect, ParameterRef, parameter_values
from updating.correlation import Comparison
from updating.diagnosis.begin import begin_fitted
from updating.diagnosis.findings import label, parameters_of
from updating.inference.fit import FitProblem
from updating.inference.fit_result import FitResult
from updating.inference.fitting import QUICK_LINES, fit, fit_given, refit, scattered
from updating.inference.frf_function import FrfFunction, FrfJacobian
from updating.inference.solve import Solution
from updating.live.engine import Evaluation, LiveModel
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


# Evidence for and against an added effect -------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class WeighedChannel:
    """A sensor in a band, and its error with and without an effect.

    Attributes
    ----------
    sensor : str
    band : (float, float)
        [Hz].
    without, present : float
        Error [dB].
    """

    sensor: str
    band: tuple[float, float]
    without: float
    present: float


@dataclass(frozen=True, slots=True, eq=False)
class Weighed:
    """Evidence for and against an added effect.

    Attributes
    ----------
    name : str
        The effect's.
    without, present : Evaluation
        Hypotheses without and with it, both fitted if ``refitted``.
    refitted : bool
        Whether all that is left was fitted again without it; otherwise it keeps its values.
    better, worse : tuple of WeighedChannel
        Where the effect lowers the error most, and where it raises it most.
    at_bound : tuple of str
        Parameters of the effect that are at a bound.
    strained : tuple of (ParameterRef, float)
        Uncertain parameters more than two standard deviations off, with how many.
    """

    name: str
    without: Evaluation
    present: Evaluation
    refitted: bool
    better: tuple[WeighedChannel, ...]
    worse: tuple[WeighedChannel, ...]
    at_bound: tuple[str, ...]
    strained: tuple[tuple[ParameterRef, float], ...]

    @property
    def unseen_gain(self) -> float:
        """By how much the effect makes lines more likely that no fit has seen [nats]."""
        return self.without.result.unseen - self.present.result.unseen


N_CHANNELS = 2
"""Largest number of sensors in a band that are named on each side."""


def weigh(live: LiveModel, h: Hypothesis, name: str, progress: Progress | None = None) -> Weighed:
    """Return the evidence for and against an added effect.

    Parameters
    ----------
    live : LiveModel
    h : Hypothesis
    name : str
        Of the effect.
    progress : callable, optional
        If given, the model without the effect is fitted again, and its progress is told to this.
    """
    effect, less = h.effect(name), h.without_effect(name)
    if progress is not None:
        less = fit_all(live, less, progress)
    without, present = live.evaluate(less), live.evaluate(h)
    channels = sorted(_channels(without.comparison, present.comparison), key=lambda c: c.present - c.without)
    better = tuple(c for c in channels[:N_CHANNELS] if c.present < c.without)
    worse = tuple(c for c in channels[: -N_CHANNELS - 1 : -1] if c.present > c.without)
    bounds = tuple(p.name for p in parameters_of(effect, present.result) if p.at_bound)
    strains = live.problem.strains(present.result)
    # Standard deviations of its prior from which an uncertain parameter speaks against a hypothesis [-]
    strained = tuple((ref, s) for ref, s in strains.items() if abs(s) > 2.0)
    return Weighed(name, without, present, progress is not None, better, worse, bounds, strained)


def _channels(without: Comparison, present: Comparison) -> list[WeighedChannel]:
    before, now, edges = without.by_band(), present.by_band(), present.bands
    return [
        WeighedChannel(name, (float(edges[b]), float(edges[b + 1])), float(before[i, b]), float(now[i, b]))
        for i, name in enumerate(present.outputs)
        for b in range(before.shape[1])
        if np.isfinite(before[i, b]) and np.isfinite(now[i, b])
    ]
