"""Which candidates deserve a fit, by what they would do to the FRFs on grids of their parameter values."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fem.model import Effect
from updating.diagnosis.evidence.hypothesis import Start
from updating.forecast.grid import Grid
from updating.forecast.look import Look
from updating.inference.fit import FitProblem
from updating.inference.fit_result import FitResult

N_FULL_BAND, N_LOW, N_DAMPED = 44, 24, 24
"""Lines of the full band, of the low one, and of damped FRFs, at which candidates are evaluated."""

MOST_VALUES = 700
"""Largest number of values of FRFs that are used, in the full band and in the low one."""

LEAST_GRIDS = 3
"""Number of the best by linear changes that are evaluated in any case."""

OUTDONE, N_COARSE = 30.0, 6
"""Near the data a candidate is not looked at on its grid if it gains so much less than another one [nats]: as
far as all is linear, or on so many of its points."""

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Screened:
    """A candidate worth a fit, and the points of its grid to start from, the most promising first.

    Attributes
    ----------
    effect : Effect
    starts : tuple of Start
    gain : float
        By how much the log likelihood of a fit on all lines would rise, at most, as far as all is linear.
    log_evidence : float
        By how much its average over all sizes and places would.
    """

    effect: Effect
    starts: tuple[Start, ...]
    gain: float = np.inf
    log_evidence: float = 0.0


def screen(
    problem: FitProblem, bases: Sequence[FitResult], grids: Sequence[Grid], *, far: bool
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
    problem : FitProblem
    bases : sequence of FitResult
        The model so far, with the effects already found; gains are over the first.
    grids : sequence of Grid
    """
    if not grids:
        return ()
    looks = [look_at(problem, base, far=far) for base in bases]
    each = [[best_starts(look, grid) for look in looks] for grid in grids]
    tried = [[start for by_look in of_grid for start in by_look] for of_grid in each]
    now = looks[0].cost_now
    gains = [
        now - min(cost for by_look in of_grid for cost, _ in (by_look[0], by_look[-1])) for of_grid in each
    ]
    costs = np.array([[cost for cost, _ in starts] for starts in tried])
    rank = np.argsort(np.argsort(costs, axis=0, kind="stable"), axis=0)
    out = []
    for i in np.argsort(rank.min(axis=1), kind="stable"):
        if not np.isfinite(costs[i]).any():
            continue
        starts: list[Start] = []
        for measure in np.argsort(rank[i], kind="stable"):
            cost, start = tried[i][measure]
            if np.isfinite(cost) and not any(
                start.values == s.values and start.near is s.near for s in starts
            ):
                starts.append(start)
        out.append(Screened(grids[i].effect, tuple(starts[:2]), gains[i]))
    return tuple(out)


def screen_near(
    problem: FitProblem, current: FitResult, grids: Sequence[Grid], linear: Floats
) -> tuple[Screened, ...]:
    """Return the candidates that can be the best addition to a fit near the data, by their gains.

    They are looked at in the order of what they gain if all is ``linear``; infinite are the gains of those
    that are looked at on few points of their grids first.
    """
    look = Look.of(problem, current, N_FULL_BAND, 0, MOST_VALUES)
    best, out = -np.inf, []
    for at_once in (True, False):
        for grid, gain in zip(grids, linear, strict=True):
            if np.isfinite(gain) != at_once:
                continue
            if not at_once:
                few = Grid(grid.effect, grid.points[:: max(1, len(grid.points) // N_COARSE)])
                gain = look.cost_now - float(look.levels(few)[0].min())
            if gain < best - OUTDONE and len(out) >= LEAST_GRIDS:
                continue
            cost, start = min(best_starts(look, grid), key=lambda each: each[0])
            if np.isfinite(cost):
                out.append(Screened(grid.effect, (start,), look.cost_now - cost))
                best = max(best, out[-1].gain)
    return tuple(sorted(out, key=lambda each: -each.gain))


def best_starts(look: Look, grid: Grid) -> list[tuple[float, Start]]:
    """Return the best start of a candidate by each of three measures, and how good it is."""
    levels = look.levels(grid)
    best = [(float(row.min()), grid.points[int(np.argmin(row))]) for row in levels]
    best.append(look.best_of_little(grid))
    return [(cost, Start((point,), look.base)) for cost, point in best]


def look_at(problem: FitProblem, base: FitResult, *, far: bool = False) -> Look:
    """Look at candidates from where a fit is; if that is far from the data, in the low band, too."""
    if problem.decay:  # broad resonances: few lines, and the full band is as good as a low one
        return Look.of(problem, base, N_DAMPED, 0, MOST_VALUES)
    return Look.of(problem, base, N_FULL_BAND, N_LOW if far else 0, MOST_VALUES)
