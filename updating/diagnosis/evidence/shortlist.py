"""Which of very many candidates deserve a look on their grids, and which could stand for an effect."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from updating.diagnosis.evidence.hypothesis import Start
from updating.diagnosis.evidence.screening import Screened, looks_at
from updating.forecast.forecast import MOST_VALUES as MOST_VALUES_LISTED
from updating.forecast.forecast import Forecast
from updating.forecast.grid import Grid
from updating.forecast.look import Look
from updating.inference.fit_result import FitResult
from updating.inference.problem import Problem

N_FULL_LISTED, N_LOW_LISTED = 18, 8
"""Lines of the whole band, and of the low one, for the short list."""
MOST_PLACES = 4
"""Largest number of a candidate's places, for the short list."""


def rivals(
    problem: Problem[Any], best: FitResult, grids: Sequence[Grid], n_best: int, most: int, n_listed: int
) -> tuple[Screened, ...]:
    """Choose the candidates that come nearest to what the last effect of a fit does.

    Each takes its place while everything else stays as it was fitted with it. Of more than ``most`` only a
    short list is looked at, with the ``n_listed`` best.
    """
    without = best.without(best.effects[-1].name)
    if len(grids) > most:
        grids = [grids[i] for i in shortlist(problem, (without,), grids, n_listed)]
    # measured by its own grid, which is as coarse as those of the others
    replaced, found = Grid.of(problem, best.effects[-1]), []
    looks = looks_at(problem, without)
    least = [float(look.levels(replaced)[0].min(initial=np.inf)) for look in looks]
    # what its own grid does not show does nothing
    costs = [c if np.isfinite(c) else look.cost_now for c, look in zip(least, looks, strict=True)]
    for i, grid in enumerate(grids):
        each = (look.levels(grid)[0] - cost for look, cost in zip(looks, costs, strict=True))
        more = np.min(list(each), axis=0)
        k = int(np.argmin(more))
        # A rival is not fitted if its best point is so much less likely than that of the effect in its place
        if np.isfinite(more[k]) and more[k] < 40.0:
            found.append((float(more[k]), i, k))
    return tuple(
        Screened(grids[i].effect, (Start((grids[i].points[k],), without),))
        for _, i, k in sorted(found)[:n_best]
    )


def shortlist(
    problem: Problem[Any], bases: Sequence[FitResult], grids: Sequence[Grid], n_listed: int
) -> list[int]:
    """Return which of very many candidates deserve a look on their grids, by what a little of each would do.

    The ``n_listed`` best by each measure go on, and all that have no slope, as they release a constraint.
    """
    listed, linear = set[int](), list[int]()
    for base in bases:
        for look in Look.several(problem, base, N_FULL_LISTED, N_LOW_LISTED, MOST_VALUES_LISTED):
            linear = [i for i, grid in enumerate(grids) if look.residuals.has_slope(grid.effect)]
            seen = Forecast.of(look, [grids[i] for i in linear], n_places=MOST_PLACES)
            for each in (seen.cost, seen.low):
                least = np.full(len(linear), np.inf)
                np.minimum.at(least, seen.owner, each)
                best = np.argsort(least, kind="stable")[:n_listed]
                listed |= {linear[int(i)] for i in best if np.isfinite(least[i])}
    return sorted(listed | (set(range(len(grids))) - set(linear)))
