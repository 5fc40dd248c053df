"""What the search needs of a kind of data besides fits: which places and candidates deserve one."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fem.model import Effect
from updating.diagnosis.evidence.blocks import Block, Blocks
from updating.diagnosis.evidence.places import Place
from updating.diagnosis.evidence.scan import Scan, Scanned
from updating.diagnosis.evidence.screening import (
    N_COARSE,
    Screened,
    look_at,
    looks_at,
    screen,
    screen_near,
)
from updating.diagnosis.evidence.shortlist import MOST_PLACES, rivals, shortlist
from updating.forecast.forecast import EffectEstimate, Forecast
from updating.forecast.grid import Grid
from updating.forecast.look import Floats
from updating.inference.fit_result import FitResult
from updating.inference.form_scatter import FormScatter

N_LOOKED = 3
"""Number of the best candidates by linear changes that are looked at on their grids in any case."""

MOST_GRIDS = 100
"""Number of candidates above which a first-order estimate makes a short list."""

Against = Callable[[Effect], float]
"""Prior odds against an effect, as a logarithm: what it must gain."""
RankedBlocks = Callable[[Sequence[tuple[Effect, ...]]], list[tuple[Block, ...]]]


def sorted_blocks(blocks_by_fit: Sequence[Blocks]) -> RankedBlocks:
    """Return a function that sorts groups of effects by their blocks, each added to some fits."""

    def ranked(groups: Sequence[tuple[Effect, ...]]) -> list[tuple[Block, ...]]:
        both = [tuple(b.of(group) for b in blocks_by_fit) for group in groups]
        return sorted(both, key=lambda blocks: min(b.cost for b in blocks))

    return ranked


@dataclass(frozen=True, slots=True)
class Ranking:
    """How candidates are ranked before any fit; the defaults are those for FRFs.

    Attributes
    ----------
    breadth : int
        Number of single effects that get a short fit, and of hypotheses whose fits are continued.
    n_listed, n_looked : int
        Number of candidates that are looked at on their grids in any case: of the best by each measure where
        there are many, and near the data.
    most_rivals : int
        Of more candidates in the place of an effect a short list is looked at.
    form_share : float
        Share of the form's small deviations that the data still have: less than 1 where an earlier state has
        taken out what is common to both [-].
    n_fine : int
        Number of candidates that are looked at on all points of their grids, the best by a look at few of
        them; 0 for all.
    precise_looks : bool
        Whether a look at small changes near the data tells what a fit would gain.
    """

    breadth: int = 8
    n_listed: int = 20
    n_looked: int = N_LOOKED
    most_rivals: int = 400
    form_share: float = 1.0
    n_fine: int = 0
    precise_looks: bool = True

    def scan(self, problem: Any, current: FitResult, places: Sequence[Place]) -> tuple[Scanned, ...]:
        """Return places, and pairs of connections, by the part of the misfit that free forces there leave."""
        return Scan.of(problem, current).run(places)

    def screened(
        self,
        problem: Any,
        current: FitResult,
        effects: Sequence[Effect],
        listed: Callable[[Effect], bool],
        against: Against | None = None,
        *,
        far: bool = False,
    ) -> tuple[Screened, ...]:
        """Return candidates with starts by the likelihood that they reach on grids, the most promising first.

        Some are ``listed`` in any case. Beside what explains the data all is linear: those deserve a look
        that can gain more than what is ``against`` them, and the others have no starts. Of a fit that is
        ``far`` from the data the low band is looked at, too.
        """
        grids = [g for e in effects if (g := Grid.of(problem, e)).points]
        if against is not None:
            forecasts = Forecast.several(problem, current, grids, n_places=MOST_PLACES)
            odds = np.array([against(g.effect) for g in grids])
            return screened_near(problem, current, forecasts, odds, self.n_looked)
        nominal = problem.at_nominal(current)
        unbent = problem.has_broad_resonances or nominal.values == current.values
        bases = (current,) if unbent else (current, nominal)
        if len(grids) > MOST_GRIDS:
            chosen = shortlist(problem, bases, grids, self.n_listed)
            grids = [g for i, g in enumerate(grids) if i in chosen or listed(g.effect)]
        if not self.n_fine:
            return screen(problem, bases, grids, far=far)
        coarse = screen(problem, bases, [g.thinned(N_COARSE) for g in grids], far=far)
        first = {s.effect.name for s in coarse[: self.n_fine]}
        fine = screen(problem, bases, [g for g in grids if g.effect.name in first], far=far)
        return (*fine, *(s for s in coarse if s.effect.name not in first))

    def estimates(self, problem: Any, current: FitResult, effects: Sequence[Effect]) -> list[EffectEstimate]:
        """Return what fits with one of some effects more would find, of all that have a grid."""
        grids = [g for e in effects if (g := Grid.of(problem, e)).points]
        return likeliest(Forecast.several(problem, current, grids, n_places=MOST_PLACES))

    def blocks(self, problem: Any, current: FitResult, *, far: bool) -> RankedBlocks:
        """Return what puts groups of effects with starts in order, the most promising first.

        By their slopes; of a fit that is ``far`` from the data at nominal parameters, too.
        """
        bases = (current, problem.at_nominal(current)) if far else (current,)
        return sorted_blocks([Blocks(problem, look_at(problem, base)) for base in bases])

    def rivals(
        self, problem: Any, last: FitResult, effects: Sequence[Effect], n_best: int
    ) -> tuple[Screened, ...]:
        """Return the candidates that come nearest to what the last effect of a fit does."""
        grids = [g for e in effects if (g := Grid.of(problem, e)).points]
        return rivals(problem, last, grids, n_best, self.most_rivals, min(self.n_listed, self.most_rivals))

    def scatter(self, problem: Any, result: FitResult, size: float | None = None) -> FormScatter | None:
        """Return small deviations that the form has besides its parameters.

        ``size`` is that of the shifts of eigenvalues; the middle of what it may be unless given.
        """
        return problem.small_deviations(result, size, self.form_share)


def likeliest(forecasts: Sequence[Forecast]) -> list[EffectEstimate]:
    """Return of each candidate the estimate that makes it the most probable, of forecasts by several looks.

    Forecasts that do not see a candidate count only if none does.
    """
    seen = np.array([np.isfinite(f.best_gains) for f in forecasts])
    evidence = np.where(seen, [f.log_evidence for f in forecasts], -np.inf)
    return [forecasts[i].estimated(k) for k, i in enumerate(np.argmax(evidence, axis=0))]


def screened_near(
    problem: Any, current: FitResult, forecasts: Sequence[Forecast], against: Floats, least: int = N_LOOKED
) -> tuple[Screened, ...]:
    """Return all candidates: those that may win as their grids have them, the others by the forecast.

    Parameters
    ----------
    problem : Problem
    current : FitResult
        A fit near the data.
    forecasts : sequence of Forecast
        At the fit, by one look or several: as of :meth:`Forecast.several`.
    against : ndarray (n_candidates,)
        What each candidate must gain [nats].
    least : int
        Number of the best that are looked at in any case.
    """
    grids = [little.grid for little in forecasts[0].littles]
    linear = np.max([f.best_gains for f in forecasts], axis=0)
    estimates = likeliest(forecasts)
    # What has no slope is no small change: a look decides.
    has_slope = forecasts[0].look.residuals.has_slope
    gains = np.where([has_slope(g.effect) for g in grids], linear, np.inf)
    promised = gains - against
    order = [int(i) for i in np.argsort(-promised, kind="stable")]
    deserves = promised > 0.0
    deserves[[i for i in order if np.isfinite(promised[i])][:least]] = True
    kept = [i for i in order if deserves[i]]
    looked = screen_near(looks_at(problem, current), [grids[i] for i in kept], gains[kept], least)
    number = {g.effect.name: i for i, g in enumerate(grids)}
    out = []
    for s in looked:
        i = number.pop(s.effect.name)
        more = s.gain - max(float(linear[i]), 0.0)
        e = estimates[i]
        out.append(replace(s, estimate=replace(e, log_evidence=e.log_evidence + more)))
    return (*out, *(Screened(grids[i].effect, (), float(linear[i]), estimates[i]) for i in number.values()))
