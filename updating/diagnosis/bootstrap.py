"""What chance and the mesh alone would do: a parametric bootstrap of the verdict.

Measurements are simulated by the fitted model without the effect in question, on a mesh twice as fine and
with the noise of the measurement, and searched alike (Efron & Tibshirani, An Introduction to the Bootstrap,
1993, ch. 16).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fem.model import Effect
from updating.diagnosis.acceptance import Limits, whole_level
from updating.diagnosis.findings import Finding
from updating.diagnosis.screening import Grid
from updating.diagnosis.search import Progress, Search, best_addition
from updating.inference.fit import FitProblem
from updating.inference.fit_data import FitData
from updating.inference.fit_result import FitResult
from updating.inference.preparation import finer_receptances


@dataclass(frozen=True, slots=True, eq=False)
class Bootstrap:
    """What simulated measurements without an effect gave.

    Attributes
    ----------
    effect : str
        Name of the effect in question, that which the data need least; empty where none was found.
    gain : float
        Factor by which it lowers the residual level over all lines [-]; NaN without one.
    gains : tuple of float
        The same factor of the best of all candidates, in each simulated measurement [-].
    levels : tuple of float
        Residual level of the fit without it, in each [nepers].
    """

    effect: str
    gain: float
    gains: tuple[float, ...]
    levels: tuple[float, ...]

    @property
    def as_much(self) -> int:
        """In how many simulated measurements the best candidate gained as much."""
        return sum(g >= self.gain for g in self.gains)

    @property
    def chance(self) -> float:
        """Probability that the best candidate gains as much where there is no effect, at most [-].

        (1 + k) / (1 + n) with k of n simulated measurements in which it did (Davison & Hinkley, Bootstrap
        Methods and their Application, 1997, eq. 4.11).
        """
        return (1 + self.as_much) / (1 + len(self.gains))

    @property
    def believed(self) -> bool:
        """Whether no simulated measurement gave as much."""
        return not self.as_much


def simulated(problem: FitProblem, result: FitResult, n: int, seed: int = 0) -> list[FitData]:
    """Return data that the sensors would have given if a fitted model were right.

    Its receptances on a mesh of half the element size, times 1 + ε with normal ε of the measurement's
    relative noise in its real and its imaginary part.

    Parameters
    ----------
    problem : FitProblem
    result : FitResult
    n : int
        How many.
    seed : int
    """
    data = problem.data
    right = finer_receptances(problem, result, np.arange(len(data.frequency)))
    rng = np.random.default_rng(seed)
    out = []
    for _ in range(n):
        scatter = rng.normal(size=(*right.shape, 2)) @ np.array([1, 1j])
        out.append(replace(data, H=right * (1 + np.where(data.mask, data.noise, 0.0) * scatter)))
    return out


def bootstrap(
    search: Search, candidates: Sequence[Effect], limits: Limits, n: int, say: Progress
) -> tuple[Search, tuple[Bootstrap, ...]]:
    """Try effects that were found against chance, that which the data need least first.

    One that does not gain more than the best candidate does in any simulated measurement without it is
    dropped, and the next one tried. Where nothing was found the fitted model itself is simulated. An effect
    that is believed because of a strained parameter is not on trial.

    Parameters
    ----------
    search : Search
        How it ended; no effect in it depends on amplitude.
    candidates : sequence of Effect
    limits : Limits
    n : int
        Measurements to simulate.
    say : callable
        Called with what is being done and the fraction done.

    Returns
    -------
    search : Search
        Without the effects that are no more than chance.
    tried : tuple of Bootstrap
        In their order.
    """
    tried: list[Bootstrap] = []
    while True:
        on_trial = _on_trial(search)
        without = {f.effect.name: search.without(f.effect.name) for f in on_trial}
        least = min(on_trial, key=lambda f: _gain(without[f.effect.name], search), default=None)
        name = least.effect.name if least else ""
        less = without.get(name, search)
        gains, levels = _by_chance(less, candidates, limits, n, say)
        tried.append(Bootstrap(name, _gain(less, search) if name else np.nan, gains, levels))
        if not name or tried[-1].believed:
            return search, tuple(tried)
        search = less
        if not _on_trial(search):  # it is what has just been simulated
            return search, (*tried, Bootstrap("", np.nan, gains, levels))


def _on_trial(search: Search) -> list[Finding]:
    return [f for f in search.findings if not f.strain]


def _gain(less: Search, search: Search) -> float:
    return whole_level(less.current) / whole_level(search.current)


def _by_chance(
    null: Search, candidates: Sequence[Effect], limits: Limits, n: int, say: Progress
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return what the best candidate gains beside a fit, and that fit's level, in simulated measurements."""
    grids = {e.name: Grid.of(null.problem, e) for e in candidates}
    gains, levels = [], []
    for k, data in enumerate(simulated(null.problem, null.current, n)):
        say(f"simulating measurement {k + 1} of {n}", k / n)
        problem = replace(null.problem, data=data)
        begin = replace(null, problem=problem, current=problem.refit(null.current))
        before, after = best_addition(begin, candidates, grids, limits)
        gains.append(whole_level(before) / whole_level(after))
        levels.append(begin.current.level)
    return tuple(gains), tuple(levels)
