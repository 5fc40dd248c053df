"""What the search needs of a kind of data besides fits: which places and candidates deserve one."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from fem.model import Effect
from updating.diagnosis.evidence.blocks import Block, Blocks
from updating.diagnosis.evidence.places import Place
from updating.diagnosis.evidence.scan import Scan, Scanned
from updating.diagnosis.evidence.screening import LEAST_GRIDS, Screened, look_at, screen, screen_near
from updating.diagnosis.evidence.shortlist import MOST_PLACES, rivals, shortlist
from updating.forecast.forecast import Forecast
from updating.forecast.grid import Grid
from updating.forecast.look import Floats
from updating.inference.fit import FitProblem
from updating.inference.fit_result import FitResult
from updating.inference.fitting import FULL_LINES
from updating.inference.form_scatter import FormScatter
from updating.inference.scatter import form_scatter

MOST_GRIDS = 100
"""Number of candidates above which a first-order estimate makes a short list."""

Against = Callable[[Effect], float]
"""Prior odds against an effect, as a logarithm: what it must gain."""
RankedBlocks = Callable[[Sequence[tuple[Effect, ...]]], list[tuple[Block, ...]]]


class Ranking(Protocol):
    """How candidates are ranked before any fit, by one kind of data."""

    @property
    def breadth(self) -> int:
        """Number of single effects that get a short fit, and of hypotheses whose fits are continued."""
        ...

    @property
    def precise_looks(self) -> bool:
        """Whether a look at small changes near the data tells what a fit would gain."""
        ...

    def scan(self, problem: Any, current: FitResult, places: Sequence[Place]) -> tuple[Scanned, ...]:
        """Return places, and pairs of connections, by the share of the misfit that they cannot explain."""
        ...

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
        """Return candidates with starts, the most promising first.

        Some are ``listed`` in any case. Beside what explains the data all is linear: those deserve a look
        that can gain more than what is ``against`` them, and the others have no starts. Of a fit that is
        ``far`` from the data the low band is looked at, too.
        """
        ...

    def blocks(self, problem: Any, current: FitResult, *, far: bool) -> RankedBlocks:
        """Return what puts groups of effects with starts in order, the most promising first.

        Of a fit that is ``far`` from the data its uncertain parameters may be bent.
        """
        ...

    def rivals(
        self, problem: Any, last: FitResult, effects: Sequence[Effect], n_best: int
    ) -> tuple[Screened, ...]:
        """Return the candidates that come nearest to what the last effect of a fit does."""
        ...

    def log_evidence(self, problem: Any, current: FitResult, effects: Sequence[Effect]) -> Floats | None:
        """Return ln of likelihood ratios over a fit, averaged over sizes and places, (n_effects,).

        None where those that were not fitted are weighed otherwise.
        """
        ...

    def scatter(self, problem: Any, result: FitResult, size: float | None = None) -> FormScatter | None:
        """Return small deviations that the form has besides its parameters.

        ``size`` is that of the shifts of eigenvalues; the middle of what it may be unless given.
        """
        ...

    def allowed_squares(self, problem: Any) -> Any:
        """Return the mean squares that a right model may leave beyond noise, of all groups or of each."""
        ...


def sorted_blocks(blocks_by_fit: Sequence[Blocks]) -> RankedBlocks:
    """Return a function that sorts groups of effects by their blocks, each added to some fits."""

    def ranked(groups: Sequence[tuple[Effect, ...]]) -> list[tuple[Block, ...]]:
        both = [tuple(b.of(group) for b in blocks_by_fit) for group in groups]
        return sorted(both, key=lambda blocks: min(b.cost for b in blocks))

    return ranked


@dataclass(frozen=True, slots=True)
class FrfRanking:
    """Ranking by receptances.

    Attributes
    ----------
    breadth : int
    form_share : float
        Share of the form's small deviations that the data still have: less than 1 where an earlier state has
        taken out what is common to both [-].
    """

    breadth: int = 8
    form_share: float = 1.0
    precise_looks: bool = True

    def scan(self, problem: FitProblem, current: FitResult, places: Sequence[Place]) -> tuple[Scanned, ...]:
        """Return places by the share of the misfit that free forces there leave."""
        return Scan.of(problem, current).run(places)

    def screened(
        self,
        problem: FitProblem,
        current: FitResult,
        effects: Sequence[Effect],
        listed: Callable[[Effect], bool],
        against: Against | None = None,
        *,
        far: bool = False,
    ) -> tuple[Screened, ...]:
        """Return candidates by the likelihood that they reach on grids of their parameters."""
        if against is not None:
            forecast = Forecast.at(problem, current, effects, n_places=MOST_PLACES)
            return screened_near(problem, current, forecast, np.array([against(e) for e in effects]))
        grids = [Grid.of(problem, e) for e in effects]
        # Damped FRFs bend nothing.
        bases = (current,) if problem.decay else (current, problem.at_nominal(current))
        if len(grids) > MOST_GRIDS:
            chosen = shortlist(problem, bases, grids)
            grids = [g for i, g in enumerate(grids) if i in chosen or listed(g.effect)]
        return screen(problem, bases, grids, far=far)

    def log_evidence(self, problem: FitProblem, current: FitResult, effects: Sequence[Effect]) -> Floats:
        """Return the same by the forecast at the fit."""
        return Forecast.at(problem, current, effects, n_places=MOST_PLACES).log_evidence

    def blocks(self, problem: FitProblem, current: FitResult, *, far: bool) -> RankedBlocks:
        """Return a function that ranks groups by their slopes, at fitted and at nominal parameters."""
        bases = (current, problem.at_nominal(current)) if far else (current,)
        return sorted_blocks([Blocks(problem, look_at(problem, base)) for base in bases])

    def rivals(
        self, problem: FitProblem, last: FitResult, effects: Sequence[Effect], n_best: int
    ) -> tuple[Screened, ...]:
        """Return the candidates whose change of the receptances comes nearest."""
        return rivals(problem, last, [Grid.of(problem, e) for e in effects], n_best)

    def scatter(
        self, problem: FitProblem, result: FitResult, size: float | None = None
    ) -> FormScatter | None:
        """Return scatter of the modes' damping, and of their eigenvalues where the form is not right."""
        return form_scatter(problem, result, size, self.form_share)

    def allowed_squares(self, problem: FitProblem) -> Any:
        """Return the mean squares that a right model may leave beyond noise, of each group."""
        return problem.residuals(n_lines=FULL_LINES).allowed_squares()


def screened_near(
    problem: FitProblem, current: FitResult, forecast: Forecast, against: Floats
) -> tuple[Screened, ...]:
    """Return all candidates: those that may win as their grids have them, the others by the forecast.

    Parameters
    ----------
    problem : FitProblem
    current : FitResult
        A fit near the data, at which the forecast is.
    forecast : Forecast
    against : ndarray (n_candidates,)
        What each candidate must gain [nats].
    """
    effects, grids = forecast.candidates, [little.grid for little in forecast.littles]
    linear, evidence = forecast.best_gains, forecast.log_evidence
    # What releases a constraint is no small change: a look decides.
    gains = np.where([bool(e.released()) for e in effects], np.inf, linear)
    promised = gains - against
    order = [int(i) for i in np.argsort(-promised, kind="stable")]
    deserves = promised > 0.0
    deserves[[i for i in order if np.isfinite(promised[i])][:LEAST_GRIDS]] = True
    kept = [i for i in order if deserves[i]]
    looked = screen_near(problem, current, [grids[i] for i in kept], gains[kept])
    number = {e.name: i for i, e in enumerate(effects)}
    out = []
    for s in looked:
        i = number.pop(s.effect.name)
        more = s.gain - max(float(linear[i]), 0.0)
        out.append(replace(s, log_evidence=float(evidence[i]) + more))
    return (
        *out,
        *(Screened(effects[i], (), float(linear[i]), float(evidence[i])) for i in number.values()),
    )
