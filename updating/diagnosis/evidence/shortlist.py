"""Which of very many candidates deserve a look on their grids, and which could stand for an effect."""

from collections.abc import Sequence

import numpy as np

from updating.diagnosis.evidence.hypothesis import Start
from updating.diagnosis.evidence.screening import MOST_VALUES, N_FULL_BAND, Screened
from updating.forecast.forecast import MOST_VALUES as MOST_VALUES_LISTED
from updating.forecast.forecast import Forecast
from updating.forecast.grid import Grid
from updating.forecast.look import Look
from updating.inference.fit import FitProblem
from updating.inference.fit_result import FitResult

MOST_RIVALS = 400
"""Of more candidates at the place of an effect only a short list is looked at."""
HOPELESS = 40.0
"""A rival is not fitted if its best point is so much less likely than that of the effect in its place."""
N_LISTED = 20
"""Number of the best candidates by each measure on the short list."""
N_FULL_LISTED, N_LOW_LISTED = 18, 8
"""Lines of the whole band, and of the low one, for the short list."""
MOST_PLACES = 4
"""Largest number of a candidate's places, for the short list."""


def rivals(problem: FitProblem, best: FitResult, grids: Sequence[Grid], n_best: int) -> tuple[Screened, ...]:
    """Choose the candidates that come nearest to what the last effect of a fit does.

    Each takes its place while everything else stays as it was fitted with it. Of very many only a short list
    is looked at.
    """
    without = best.without(best.effects[-1].name)
    if len(grids) > MOST_RIVALS:
        grids = [grids[i] for i in shortlist(problem, (without,), grids)]
    look = Look.of(problem, without, N_FULL_BAND, 0, MOST_VALUES)
    found = []
    # measured by its own grid, which is as coarse as those of the others
    replaced_cost = look.levels(Grid.of(problem, best.effects[-1]))[0].min(initial=np.inf)
    highest = float(replaced_cost) + HOPELESS
    for i, grid in enumerate(grids):
        costs = look.levels(grid)[0]
        k = int(np.argmin(costs))
        if np.isfinite(costs[k]) and costs[k] < highest:
            found.append((float(costs[k]), i, k))
    return tuple(
        Screened(grids[i].effect, (Start((grids[i].points[k],), without),))
        for _, i, k in sorted(found)[:n_best]
    )


def shortlist(problem: FitProblem, bases: Sequence[FitResult], grids: Sequence[Grid]) -> list[int]:
    """Return which of very many candidates deserve a look on their grids, by what a little of each would do.

    The ``N_LISTED`` best by each measure go on, and all that release a constraint.
    """
    listed = {i for i, grid in enumerate(grids) if grid.effect.released()}
    held = [i for i in range(len(grids)) if i not in listed]
    for base in bases:
        look = Look.of(problem, base, N_FULL_LISTED, N_LOW_LISTED, MOST_VALUES_LISTED)
        seen = Forecast.of(look, [grids[i] for i in held], n_places=MOST_PLACES)
        for each in (seen.cost, seen.low):
            least = np.full(len(held), np.inf)
            np.minimum.at(least, seen.owner, each)
            best = np.argsort(least, kind="stable")[:N_LISTED]
            listed |= {held[int(i)] for i in best if np.isfinite(least[i])}
    return sorted(listed)
