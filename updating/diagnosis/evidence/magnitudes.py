"""Ranking by amplitudes without phase: only the real part of ln H was measured."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fem.model import Effect, ParameterRef
from updating.diagnosis.evidence.blocks import Blocks
from updating.diagnosis.evidence.hypothesis import Start
from updating.diagnosis.evidence.ranking import (
    LEAST_GRIDS,
    MOST_GRIDS,
    FrfRanking,
    MayWin,
    RankedBlocks,
    sorted_blocks,
)
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


def _screened(looks: Sequence[MagnitudeLook], grid: Grid, now: float) -> Screened | None:
    """Return a candidate with its two best starts on the whole band; None if the data do not see it."""
    of_looks = [look.best_starts(grid) for look in looks]
    every = [start for first, *_, last in of_looks for start in (first, last)]  # not those by the low band
    tried = sorted((s for s in every if np.isfinite(s[0])), key=lambda s: s[0])
    if not tried:
        return None
    starts = list({repr(start.values): start for _, start in reversed(tried)}.values())[::-1]
    return Screened(grid.effect, tuple(starts[:2]), now - tried[0][0])


@dataclass(frozen=True, slots=True)
class MagnitudeRanking(FrfRanking):
    """Ranking by the amplitudes of receptances."""

    def screened(
        self,
        problem: FitProblem,
        current: FitResult,
        effects: Sequence[Effect],
        listed: Callable[[Effect], bool],
        may_win: MayWin | None = None,
    ) -> tuple[Screened, ...]:
        """Return candidates by the likelihood that they reach on grids of their parameters.

        Those go on that may win by what a little of each does; far from the data the best of very many.
        """
        looks = [_look_at(problem, base) for base in (current, problem.at_nominal(current))]
        now, grids = looks[0].cost_now, [g for e in effects if (g := Grid.of(problem, e)).points]
        if may_win is not None or len(grids) > MOST_GRIDS:
            gain = [max(now - look.cost_of_little(g) for look in looks) for g in grids]
            gain = np.where([bool(g.effect.released()) for g in grids], np.inf, gain)
            order = np.argsort(-gain, kind="stable")
            least = MOST_GRIDS if may_win is None else LEAST_GRIDS
            wins = (lambda e, _: listed(e)) if may_win is None else may_win
            ranked = [(grids[i], float(gain[i])) for i in order]
            grids = [g for n, (g, most) in enumerate(ranked) if n < least or wins(g.effect, most)]
        found = [s for g in grids if (s := _screened(looks, g, now)) is not None]
        return tuple(sorted(found, key=lambda s: -s.gain))

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
        best = sorted(found)[:n_best]
        starts = ((grids[i].effect, Start((grids[i].points[k],), without)) for _, i, k in best)
        return tuple(Screened(effect, (start,)) for effect, start in starts)
