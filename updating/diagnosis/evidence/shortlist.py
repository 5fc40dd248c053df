"""Which of very many candidates deserve a look: by what a little of each would do, none projected."""

from collections.abc import Sequence

import numpy as np

from updating.diagnosis.evidence.hypothesis import Start
from updating.diagnosis.evidence.screening import (
    MOST_VALUES,
    N_FULL_BAND,
    Complexes,
    Floats,
    Grid,
    Look,
    Screened,
)
from updating.inference.fit import FitProblem
from updating.inference.fit_result import FitResult
from updating.inference.fitting import FULL_LINES
from updating.inference.heartbeat import beat

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
MOST_VALUES_LISTED = 10_000
"""Largest number of values of FRFs that are used for the short list."""
_TOGETHER = 100
"""Number of candidates of the list that are judged at once."""


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
    looks = [Look.of(problem, base, N_FULL_LISTED, N_LOW_LISTED, MOST_VALUES_LISTED) for base in bases]
    levels = _proportional_levels(looks, grids)
    listed = {i for i, grid in enumerate(grids) if grid.effect.released()}
    for row in levels:
        best = np.argsort(row, kind="stable")[:N_LISTED]
        listed |= {int(i) for i in best if np.isfinite(row[i])}
    return sorted(listed)


def linear_gains(problem: FitProblem, current: FitResult, grids: Sequence[Grid]) -> Floats:
    """Return by how much candidates would raise the log likelihood of a fit if FRFs changed in proportion.

    Shape (n_grids,), on all lines of a full fit; near the noise all is linear. Infinite for those that
    release a constraint, which have no small change, and minus infinity for those that the data do not see.
    """
    look = Look.of(problem, current, FULL_LINES, 0, MOST_VALUES_LISTED)
    gains = look.cost_now - _proportional_levels([look], grids)[0]
    return np.where([bool(grid.effect.released()) for grid in grids], np.inf, gains)


def _proportional_levels(looks: Sequence[Look], grids: Sequence[Grid]) -> Floats:
    """Return the levels that the best strength of each candidate would leave if FRFs changed in proportion.

    Shape (2 n_looks, n_grids): for each look the cost on the whole band without what nuisance parameters
    explain, and the level on the low band. The change is taken from the responses at all DOFs and the
    candidate's element matrices, so that none is projected.
    """
    responses = [look.fields() for look in looks]
    levels = np.full((2 * len(looks), len(grids)), np.inf)
    model = looks[0].problem.reduced.model
    for first in range(0, len(grids), _TOGETHER):
        owner: list[int] = []
        most: list[float] = []
        slopes: list[list[Complexes]] = [[] for _ in looks]
        for i in range(first, min(first + _TOGETHER, len(grids))):
            beat()
            effect = grids[i].effect
            points = () if effect.released() else grids[i].slight_points()
            step = max(1, -(-len(points) // MOST_PLACES))
            for point, factor in points[(step - 1) // 2 :: step]:
                contributions = model.parts_of(effect.with_values(**point))
                owner.append(i)
                most.append(factor)
                for mine, every in zip(slopes, responses, strict=True):
                    mine.append(every.slope(contributions, effect.connection))
        one_sided = np.array([grids[i].one_sided() for i in owner], dtype=bool)
        replaced = [tuple(grids[i].effect.replaces()) for i in owner]
        for b, look in enumerate(looks if owner else ()):
            two = look.linear(np.stack(slopes[b]), np.array(most), one_sided, replaced)
            for i, each in zip(owner, two.T, strict=True):
                levels[2 * b : 2 * b + 2, i] = np.minimum(levels[2 * b : 2 * b + 2, i], each)
    return levels
