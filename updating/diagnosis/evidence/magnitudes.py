"""Ranking by amplitudes without phase: only the real part of ln H was measured."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fem.model import Effect, ParameterRef
from updating.diagnosis.evidence.blocks import Blocks
from updating.diagnosis.evidence.ranking import MOST_GRIDS, FrfRanking, RankedBlocks, sorted_blocks
from updating.diagnosis.evidence.screening import MOST_VALUES, N_LOW, N_WHOLE, Grid, Look, Screened
from updating.inference.fit import FitProblem
from updating.inference.fit_result import FitResult

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


class MagnitudeLook(Look):
    """A look at candidates whose residuals are those of ln |H|."""

    def _residuals(self, H: Sequence[Complexes]) -> Complexes:
        return np.asarray(super()._residuals(H).real, dtype=complex)

    def cost_of_little(self, grid: Grid) -> float:
        """Return the cost of the best multiple of what a little of a candidate does."""
        return self._best_of_little(grid)[0]


def _look_at(problem: FitProblem, base: FitResult, n_low: int = N_LOW) -> MagnitudeLook:
    look = MagnitudeLook.of(problem, base, N_WHOLE, n_low, MOST_VALUES)
    assert isinstance(look, MagnitudeLook)
    return look


@dataclass(frozen=True, slots=True)
class MagnitudeRanking(FrfRanking):
    """Ranking by the amplitudes of receptances."""

    def screened(
        self,
        problem: FitProblem,
        current: FitResult,
        effects: Sequence[Effect],
        listed: Callable[[Effect], bool],
    ) -> tuple[Screened, ...]:
        """Return candidates by the levels that they leave on grids of their parameters.

        Of very many, those go on that are best by what a little of each does.
        """
        looks = [_look_at(problem, base) for base in (current, problem.at_nominal(current))]
        grids = [g for e in effects if (g := Grid.of(problem, e)).points]
        if len(grids) > MOST_GRIDS:
            cost = np.array([min(look.cost_of_little(g) for look in looks) for g in grids])
            order = np.argsort(cost, kind="stable")[:MOST_GRIDS]
            chosen = set(order.tolist())
            grids = [g for i, g in enumerate(grids) if i in chosen or listed(g.effect)]
        tried = [[start for look in looks for start in look.best_starts(grid)] for grid in grids]
        costs = np.array([[cost for cost, _ in starts] for starts in tried]).reshape(len(grids), -1)
        rank = np.argsort(np.argsort(costs, axis=0, kind="stable"), axis=0)
        out = []
        for i in np.argsort(rank.min(axis=1, initial=len(grids)), kind="stable"):
            order = [k for k in np.argsort(rank[i], kind="stable") if np.isfinite(costs[i, k])]
            points = [tried[i][k][1] for k in order]
            if points:
                first = points[0]
                more = [p for p in points[1:] if p != first][:1]
                out.append(Screened(grids[i].effect, (first, *more)))
        return tuple(out)

    def blocks(self, problem: FitProblem, current: FitResult) -> RankedBlocks:
        """Return what ranks groups by what a little of them does, beside fitted and nominal parameters."""
        bases = current, problem.at_nominal(current)
        return sorted_blocks([Blocks(problem, _look_at(problem, base)) for base in bases])

    def rivals(
        self, problem: FitProblem, last: FitResult, effects: Sequence[Effect], n_best: int
    ) -> tuple[Screened, ...]:
        """Return the candidates whose change of the amplitudes comes nearest."""
        name = last.effects[-1].name
        values: dict[ParameterRef, float] = {r: v for r, v in last.values.items() if r[0] != name}
        without = replace(last, effects=last.effects[:-1], values=values)
        look, found = _look_at(problem, without, 0), []
        for i, grid in enumerate(grids := [g for e in effects if (g := Grid.of(problem, e)).points]):
            costs = look.levels(grid)[0]
            k = int(np.argmin(costs))
            if np.isfinite(costs[k]):
                found.append((float(costs[k]), i, k))
        return tuple(Screened(grids[i].effect, (grids[i].points[k],)) for _, i, k in sorted(found)[:n_best])
