"""Fits of hypotheses: short and quick ones on few lines, full ones."""

from collections.abc import Callable, Iterable, Sequence, Set
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations
from typing import Any, Generic, TypeVar

import numpy as np

from fem.analysis.modes import n_unstable
from fem.model import Effect
from fem.system import assemble
from updating.diagnosis.evidence.absence import left_out
from updating.diagnosis.evidence.budget import NORMAL, Budget
from updating.diagnosis.evidence.hypothesis import Odds, ScoredFit, Start, Values, values_of
from updating.diagnosis.evidence.ranking import Ranking
from updating.inference.belief import FAR_STD
from updating.inference.fit_result import FitResult, fitted_model
from updating.inference.fitting import FULL_LINES, QUICK_LINES, QUICK_NATS, fit, scattered
from updating.inference.parameters import Nuisance
from updating.inference.problem import Problem
from updating.inference.solve import TOLERANCE

SHORT_STEPS, QUICK_STEPS, MOST_STEPS = 2, 6, 16
"""Steps of first, short fits in each band, of those that go on from them, and of those that must converge."""
FAR = 3.0
"""Multiple of the floor from which on uncertain parameters may be bent, so that fits begin from nominal ones,
too [-]."""
N_STARTS = 3
"""Number of starts that are kept after short fits of the lowest band."""
P = TypeVar("P", bound=Problem[Any])
Fit = TypeVar("Fit")


@dataclass(frozen=True, slots=True, eq=False)
class Fits(Generic[P]):
    """Fits to one set of data, each by itself: several processes may share them.

    Attributes
    ----------
    problem : Problem
        With the form among the uncertain parameters.
    form : tuple of Nuisance
        Those of them that are the form's.
    odds : Odds
    ranking : Ranking
    budget : Budget
    """

    problem: P
    form: tuple[Nuisance, ...]
    odds: Odds
    ranking: Ranking
    budget: Budget = NORMAL

    @property
    def floor(self) -> float:
        """Level that noise and the mesh leave [nepers]."""
        return float(np.hypot(self.problem.data.noise_level, self.problem.mesh_level))

    @property
    def form_names(self) -> set[str]:
        """Names of the effects that are the form."""
        return {n.effect for n in self.form}

    def is_far(self, h: ScoredFit) -> bool:
        """Whether a hypothesis is so far from the data that uncertain parameters may be bent, or they are."""
        return h.fitted.level > FAR * self.floor or self.is_bent(h)

    def is_near(self, h: ScoredFit) -> bool:
        """Whether a hypothesis explains the data with uncertain parameters that are plausible.

        Of many of them the largest may be far from nominal.
        """
        return h.fitted.level <= FAR * self.floor and self.problem.strain_of_one(h.fitted) <= FAR_STD

    def is_bent(self, h: ScoredFit) -> bool:
        """Whether uncertain parameters of a model without effects are implausibly far from nominal."""
        return not h.effects and self.problem.strain(h.fitted) > FAR_STD

    def problems(self, base: ScoredFit) -> tuple[P, P]:
        """Return the problems of short fits, and of fits continued from them, that extend a hypothesis.

        Short ones have a nominal form where that is far from the data: in a few steps it would only bend
        towards whatever is missing.
        """
        free = self.free(base)
        if not self.is_far(base):
            return free, free
        nuisances = tuple(n for n in self.problem.nuisances if n.refs[0][0] not in self.fixed(base))
        quick = replace(self.problem, nuisances=nuisances)
        return replace(quick, scatter=self.ranking.scatter(quick, self.without_fixed(base))), free

    def free(self, base: ScoredFit) -> P:
        """Return the problem of fits that extend a hypothesis, with its form free."""
        return replace(self.problem, scatter=self.ranking.scatter(self.problem, base.fitted))

    def fixed(self, base: ScoredFit) -> set[str]:
        """Return the names of effects that do not vary in short fits that extend a hypothesis."""
        return self.form_names if self.is_far(base) else set()

    def without_fixed(self, base: ScoredFit) -> FitResult:
        """Return the result of a hypothesis without what does not vary in short fits that extend it."""
        result, fixed = base.fitted, self.fixed(base)
        return replace(result, values={r: v for r, v in result.values.items() if r[0] not in fixed})

    def shortly(
        self, quick: P, effects: Sequence[Effect], starts: Sequence[Start], steps: int = SHORT_STEPS
    ) -> list[ScoredFit]:
        """Return a hypothesis after a few steps from each of some starts, the best first.

        None where no start has a structure. Of many starts those go on that do best in the lowest band.
        """
        few: dict[str, Any] = {"n_lines": QUICK_LINES, "counted_as": FULL_LINES}
        few |= {"max_iterations": steps, "stages": quick.stages[-1:], "tolerance": QUICK_NATS}
        if len(starts) > N_STARTS:
            # Several springs far from their values move resonances past each other: band by band.
            few["stages"] = quick.stages
            tried = possible(partial(self._in_lowest_band, quick, effects, start) for start in starts)
            starts = [start for _, start in sorted(tried, key=lambda each: -each[0])[:N_STARTS]]
        fits = possible(
            partial(self._fit, with_forces(quick, effects, s.values), effects, s.values, x_from=s.near, **few)
            for s in starts
        )
        return sorted(fits, key=lambda h: -h.fitted.log_evidence)

    def _in_lowest_band(self, quick: P, effects: Sequence[Effect], start: Start) -> tuple[float, Start]:
        # Lines of fits in the lowest band, which has few modes
        how: dict[str, Any] = {"stages": quick.stages[:1], "n_lines": 16, "max_iterations": 3}
        return self._fit(quick, effects, start.values, **how).fitted.log_likelihood, start

    def continued(self, quick: P, hypotheses: Sequence[ScoredFit]) -> ScoredFit:
        """Return the best of hypotheses with the same effects that are fitted on from where they are."""
        fits = [self.quickly(quick, h, h.effects, values_of(h.effects)) for h in hypotheses]
        return max(fits, key=lambda h: h.score)

    def pruned(self, quick: P, h: ScoredFit, base: ScoredFit) -> ScoredFit:
        """Return a hypothesis without those of several new effects whose absence raises its score.

        On few lines; one of them stays. The covariance tells which, and a fit confirms it. Where it does not,
        each is left out in a fit, and two at a time that soften one thing: each of them alone may be needed
        only because of the other.
        """
        while len(h.effects) > len(base.effects) + 1:
            new = [e.name for e in h.effects if e.name not in base.key]
            harmful = left_out(quick, h, new, self.odds)
            options = self._without(quick, h, [harmful] if harmful else [])
            if not any(o.score > h.score for o in options):
                options = self._without(quick, h, [{name} for name in new])
            if not any(o.score > h.score for o in options) and len(new) > 2:
                at = {e.name: e.where.thing for e in h.effects}
                options = self._without(quick, h, [{a, b} for a, b in combinations(new, 2) if at[a] == at[b]])
            best = max(options, key=lambda o: o.score, default=h)
            if best.score <= h.score:
                break
            h = best
        return h

    def _without(self, quick: P, h: ScoredFit, groups: Sequence[Set[str]]) -> list[ScoredFit]:
        """Return fits without some effects, from near where all are."""
        rests = [tuple(e for e in h.effects if e.name not in names) for names in groups]
        return possible(partial(self.quickly, quick, h, rest, values_of(rest)) for rest in rests)

    def quickly(self, quick: P, near: ScoredFit, effects: Sequence[Effect], values: Values) -> ScoredFit:
        """Return a hypothesis fitted on few lines from near another one.

        The lines count as those of a full fit.
        """
        return self.from_result(quick, near.fitted, effects, values)

    def from_result(
        self,
        quick: P,
        near: FitResult,
        effects: Sequence[Effect],
        values: Values,
        steps: int = QUICK_STEPS,
    ) -> ScoredFit:
        """Return a hypothesis as :meth:`quickly`, from near a result."""
        problem = with_forces(quick, effects, values)
        way: dict[str, Any] = {"stages": problem.stages[-1:], "x_from": near}
        way |= {"max_iterations": steps, "n_lines": QUICK_LINES, "counted_as": FULL_LINES}
        way |= {"tolerance": QUICK_NATS}
        return self._fit(problem, effects, values, **way)

    def fully(
        self,
        effects: Sequence[Effect],
        values: Values,
        near: ScoredFit | None = None,
        *,
        anew: bool = False,
    ) -> ScoredFit:
        """Return a hypothesis fitted on all lines with the form free, from some values.

        Everything else begins where it is near there, or else at its nominal value, band by band. With
        ``anew`` the better of both is fitted on: near there it may have bent before the effects were right.
        """
        problem = with_forces(self.problem, effects, values)
        last = problem.stages[-1:]
        ways: list[dict[str, Any]] = [{}] if near is None or anew else []
        if near is not None:
            ways.append({"stages": last, "x_from": near.fitted})
        # The fit with small deviations goes on from here, and moves all by more than a last step.
        fits = [self._where_it_is(problem, effects, values, tolerance=QUICK_NATS, **way) for way in ways]
        best = max(fits, key=lambda h: h.fitted.log_evidence)
        ended = self.scattered(problem, best)
        if ended.fitted is best.fitted:
            ended = self._where_it_is(
                problem, best.effects, values_of(best.effects), stages=last, x_from=best.fitted
            )
        return ended if self._is_structure(ended) else replace(ended, prior=-np.inf)

    def _is_structure(self, h: ScoredFit) -> bool:
        """Whether the full model has no motion of negative stiffness: on the basis none may be seen.

        What effects take away adds up, where a form takes away from the same stretch.
        """
        if not h.effects:
            return True
        system = assemble(fitted_model(self.problem.reduced.model, h.fitted), reciprocal=False)
        return not n_unstable(system)

    def _where_it_is(
        self,
        problem: P,
        effects: Sequence[Effect],
        values: Values,
        *,
        tolerance: float = TOLERANCE,
        **way: Any,
    ) -> ScoredFit:
        """Return a fit, on a basis for the places to which it moves effects."""
        how: dict[str, Any] = {"tolerance": tolerance, **self._all_lines}
        h = self._fit(problem, effects, values, **how, **way)
        if not any(p.position for e in h.effects for p in e.parameters()):
            return h
        # A fit begins again at most so often on the basis of the places that it has found
        for _ in range(5):
            there = problem.at_places_of(h.fitted)
            if there is None:
                break
            problem = there
            again: dict[str, Any] = {"stages": problem.stages[-1:], "x_from": h.fitted}
            h = self._fit(problem, h.effects, values_of(h.effects), **how, **again)
        return h

    def scattered(self, problem: P, h: ScoredFit) -> ScoredFit:
        """Return a hypothesis fitted on with the small deviations of its form, of the modes it has there."""
        how = {"n_passes": self.budget.n_passes, "n_lines": self.budget.n_lines}
        return replace(h, fitted=scattered(problem, h.fitted, self.ranking.scatter, **how))

    def again(self, h: ScoredFit) -> ScoredFit:
        """Return a full fit continued from a hypothesis and its deviations, on an enlarged basis."""
        values = values_of(h.effects)
        problem = with_forces(self.problem, h.effects, values)
        scatter = self.ranking.scatter(problem, h.fitted, h.fitted.size)
        if scatter is None:
            return self.fully(h.effects, values, h)
        way = {"stages": problem.stages[-1:], "x_from": h.fitted, **self._all_lines}
        return self._fit(replace(problem, scatter=scatter), h.effects, values, **way)

    @property
    def _all_lines(self) -> dict[str, Any]:
        """Lines of full fits, and as how many they count."""
        return {"n_lines": self.budget.n_lines, "counted_as": FULL_LINES}

    def _fit(self, problem: P, effects: Sequence[Effect], values: Values, **how: Any) -> ScoredFit:
        return ScoredFit(fit(problem, effects, values, **how), self.odds.prior(effects))


def with_forces(problem: P, effects: Sequence[Effect], values: Values) -> P:
    """Return a problem whose basis has the responses to forces of effects at some values."""
    there = [e.with_values(**v) for e, v in zip(effects, values, strict=True)]
    return replace(problem, reduced=problem.reduced.with_forces_of(there))


def possible(fits: Iterable[Callable[[], Fit]]) -> list[Fit]:
    """Return the fits whose start has a structure: others take away more mass than there is."""
    out = []
    for each in fits:
        with suppress(np.linalg.LinAlgError):
            out.append(each())
    return out


def around(effects: Sequence[Effect], first: int = 0) -> list[Values]:
    """Return starts at the effects' values but for one positive parameter, a factor off."""
    values = values_of(effects)
    starts: list[Values] = []
    for k, e in list(enumerate(effects))[first:]:
        for p in e.parameters():
            # Factors of a found positive parameter at which other maxima are looked for
            for factor in (0.6, 1.6) if p.log else ():
                moved = {p.name: float(np.clip(factor * p.value, p.lower, p.upper))}
                starts.append((*values[:k], values[k] | moved, *values[k + 1 :]))
    return starts
