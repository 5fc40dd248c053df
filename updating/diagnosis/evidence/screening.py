"""Which candidates deserve a fit, by what they would do to the FRFs on grids of their parameter values."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fem.array_types import Floats
from fem.model import Effect
from updating.diagnosis.evidence.hypothesis import Start
from updating.forecast.forecast import EffectEstimate
from updating.forecast.grid import Grid
from updating.forecast.look import Look
from updating.inference.fit_result import FitResult
from updating.inference.problem import Problem

N_FULL_BAND, N_LOW, N_DAMPED = 44, 24, 24
"""Lines of the full band, of the low one, and of damped FRFs, at which candidates are evaluated."""

MOST_VALUES = 700
"""Largest number of values of FRFs that are used, in the full band and in the low one."""

OUTDONE, N_COARSE = 30.0, 6
"""Near the data a candidate is not looked at on its grid if it gains so much less than another one [nats]: as
far as all is linear, or on so many of its points."""


@dataclass(frozen=True, slots=True, eq=False)
class Screened:
    """A candidate worth a fit, and the points of its grid to start from, the most promising first.

    Attributes
    ----------
    effect : Effect
    starts : tuple of Start
    gain : float
        By how much the log likelihood of a fit on all lines would rise, at most, as far as all is linear.
    estimate : EffectEstimate or None
        What a fit would find, where all is nearly linear.
    """

    effect: Effect
    starts: tuple[Start, ...]
    gain: float = np.inf
    estimate: EffectEstimate | None = None


def screen(
    problem: Problem[Any], bases: Sequence[FitResult], grids: Sequence[Grid], *, far: bool
) -> tuple[Screened, ...]:
    """Put the candidates that the data see in the order in which they deserve a fit.

    Each is judged by three measures beside each of some fits:

    - the likelihood at each point of its grid, after a small change of the nuisance parameters,
    - the likelihood with the best multiple of what a little of it does: near the noise all is linear,
    - far from the data, the level in the low band, where a wrong modulus shifts resonances by less than their
      width.

    The measure by which a candidate does best among all others counts, and it begins where that is best.

    Parameters
    ----------
    problem : Problem
    bases : sequence of FitResult
        The model so far, with the effects already found; gains are over the first.
    grids : sequence of Grid
    """
    if not grids:
        return ()
    looks = [look for base in bases for look in looks_at(problem, base, far=far)]
    tried, gains = list[list[tuple[float, Start]]](), list[float]()
    for grid in grids:
        each = [best_starts(look, grid) for look in looks]
        tried.append([start for by_look in each for start in by_look])
        gains.append(max(_gains(looks, grid, [min(by_look[0][0], by_look[-1][0]) for by_look in each])))
    costs = np.array([[cost for cost, _ in starts] for starts in tried])
    rank = np.argsort(np.argsort(costs, axis=0, kind="stable"), axis=0)
    out = []
    for i in np.argsort(rank.min(axis=1), kind="stable"):
        if not np.isfinite(costs[i]).any():
            continue
        starts: list[Start] = []
        # Levels on the low band are no likelihoods: beside them the measures of one rank keep their order.
        for measure in np.lexsort((np.zeros(len(rank[i])) if far else costs[i], rank[i])):
            cost, start = tried[i][measure]
            if np.isfinite(cost) and not any(
                start.values == s.values and start.near is s.near for s in starts
            ):
                starts.append(start)
        out.append(Screened(grids[i].effect, tuple(starts[:2]), gains[i]))
    return tuple(out)


def screen_near(
    looks: Sequence[Look[Any, Any]], grids: Sequence[Grid], linear: Floats, least: int
) -> tuple[Screened, ...]:
    """Return the candidates that can be the best addition to a fit near the data, by their gains.

    They are looked at in the order of what they gain if all is ``linear``, at ``least`` so many; infinite are
    the gains of those that are looked at on few points of their grids first.
    """
    best, out = -np.inf, []
    for at_once in (True, False):
        for grid, gain in zip(grids, linear, strict=True):
            if np.isfinite(gain) != at_once:
                continue
            if not at_once:
                few = grid.thinned(N_COARSE)
                gain = max(_gains(looks, few, [float(look.levels(few)[0].min()) for look in looks]))
            if gain < best - OUTDONE and len(out) >= least:
                continue
            each = [min(best_starts(look, grid), key=lambda start: start[0]) for look in looks]
            gained = np.array(_gains(looks, grid, [cost for cost, _ in each]))
            if np.isfinite(gained).any():
                order = [int(k) for k in np.argsort(-gained, kind="stable") if np.isfinite(gained[k])]
                out.append(Screened(grid.effect, tuple(each[k][1] for k in order), float(gained[order[0]])))
                best = max(best, out[-1].gain)
    return tuple(sorted(out, key=lambda each: -each.gain))


def _gains(looks: Sequence[Look[Any, Any]], grid: Grid, least: Sequence[float]) -> list[float]:
    """Return by how much a candidate raises the log likelihood of the first look's fit, by each look [nats].

    ``least`` are the costs that each finds. A look that believes all readings says where to start; a fit
    gains no more by a bad reading than that costs as one.
    """
    costs = [
        look.least_stated_cost(grid) if look.all_belong and np.isfinite(cost) else cost
        for look, cost in zip(looks, least, strict=True)
    ]
    return [looks[0].cost_now - cost for cost in costs]


def best_starts(look: Look[Any, Any], grid: Grid) -> list[tuple[float, Start]]:
    """Return the best start of a candidate by each of three measures, and how good it is."""
    levels = look.levels(grid)
    best = [(float(row.min()), grid.points[int(np.argmin(row))]) for row in levels]
    best.append(look.best_of_little(grid))
    return [(cost, Start((point,), look.base)) for cost, point in best]


def look_at(problem: Problem[Any], base: FitResult, *, far: bool = False) -> Look[Any, Any]:
    """Look at candidates from where a fit is; if that is far from the data, in the low band, too."""
    return looks_at(problem, base, far=far)[0]


def looks_at(problem: Problem[Any], base: FitResult, *, far: bool = False) -> tuple[Look[Any, Any], ...]:
    """Return the same with the look that takes no reading for a bad one; see :meth:`Look.several`."""
    if problem.has_broad_resonances:  # few lines, and the full band is as good as a low one
        return Look.several(problem, base, N_DAMPED, 0, MOST_VALUES)
    return Look.several(problem, base, N_FULL_BAND, N_LOW if far else 0, MOST_VALUES)
