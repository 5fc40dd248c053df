"""What the covariance of a fit says of the evidence without some of its effects."""

from collections.abc import Collection, Sequence
from typing import Any

import numpy as np

from fem.array_types import Floats
from fem.model import Effect
from updating.diagnosis.evidence.hypothesis import Odds, ScoredFit, values_of
from updating.inference.fit_function import FitFunction
from updating.inference.problem import Problem


def gains_without(
    problem: Problem[Any], h: ScoredFit, groups: Sequence[Collection[str]], odds: Odds
) -> Floats:
    """Return by how much the score of a hypothesis would rise without each of some groups of its effects.

    Near a converged optimum x with the covariance C, ln p(data) without the unknowns o changes by
    -½ dᵀ C_oo⁻¹ d - ½ ln det C_oo - ln p(x_o), d the way to where they do nothing and p their prior at the
    optimum: the ratio of Savage and Dickey (Dickey, *Ann. Math. Stat.* 42, 1971, 204).

    Parameters
    ----------
    problem : Problem
    h : ScoredFit
        Fitted.
    groups : sequence of collection of str
        Names of effects.
    odds : Odds
    """
    effects = h.effects
    function = problem.residuals(effects, values_of(effects))
    x, C = h.fitted.solution.x, h.fitted.solution.covariance
    if len(x) < len(function.variables):
        return np.full(len(groups), np.nan)
    off, std = function.prior_at(x)
    by_name = {e.name: e for e in effects}
    out = np.full(len(groups), -np.inf)
    for k, names in enumerate(groups):
        every = [i for i, v in enumerate(function.variables) if v.ref[0] in names]
        # an effect's first parameter is its size
        first = {e.name: e.parameters()[0].name for e in effects if e.name in names}
        rows = [i for i in every if function.variables[i].ref[1] == first[function.variables[i].ref[0]]]
        way = np.array([_way(function, by_name, i, float(x[i])) for i in rows])
        known = -0.5 * (off / std)[every] ** 2 - np.log(std[every])
        sized, of_group = C[np.ix_(rows, rows)], C[np.ix_(every, every)]
        evidence = (
            -0.5 * way @ np.linalg.solve(sized, way) - 0.5 * np.linalg.slogdet(of_group)[1] - known.sum()
        )
        rest = [e for e in effects if e.name not in names]
        out[k] = evidence + odds.prior(rest) - odds.prior(effects)
    return out


def _way(function: FitFunction, by_name: dict[str, Effect], i: int, x: float) -> float:
    """Return how far an unknown would go until its effect hardly does anything.

    On a logarithmic scale that is at the value which it replaces, or else at the weakest of its grid.
    """
    v = function.variables[i]
    effect = by_name[v.ref[0]]
    p = effect.parameters()[0]
    if not v.log:
        return v.to_x(p.absent) - x
    nominal = function.problem.reduced.nominal
    usual = [nominal[ref] for ref in effect.replaces() if ref in nominal]
    if not usual and np.isfinite(p.absent) and p.absent > 0:
        usual = [p.absent]
    if usual:
        return v.to_x(usual[0]) - x
    grid = [v.to_x(point[p.name]) for point in effect.starts(function.problem.surroundings)]
    return (max(grid) if np.isinf(p.absent) else min(grid)) - x


def left_out(problem: Problem[Any], h: ScoredFit, names: Sequence[str], odds: Odds) -> set[str]:
    """Return which effects, one after the other and not all, would raise a score by their absence."""
    removed: set[str] = set()
    best = 0.0
    while len(removed) + 1 < len(names):
        options = [removed | {name} for name in names if name not in removed]
        gains = gains_without(problem, h, options, odds)
        if not gains.max() > best:
            break
        best, removed = float(gains.max()), options[int(np.argmax(gains))]
    return removed
