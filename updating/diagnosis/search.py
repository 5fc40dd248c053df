"""The search for missing effects: rounds in which candidates are looked at, fitted and accepted or not."""

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.effects.places import material_of
from fem.model import Effect, Model, ParameterRef, parameter_values
from updating.correlation import DB_PER_NEPER, log_ratio
from updating.diagnosis.acceptance import (
    ACCEPT_BESIDE,
    ACCEPT_GAIN,
    ACCEPT_HELD_OUT,
    ACCEPT_LEVEL,
    STRAINED,
    Factors,
    Limits,
    Rule,
    damps,
    dissipates,
    ends_in_noise,
    falls,
    fitted_score,
    gains,
    is_firm,
    is_loss_factor,
    known_already,
    makes_complex,
    score,
    stands_out,
    takes_energy,
    weak_factors,
    whole_level,
    within_tolerance,
)
from updating.diagnosis.findings import (
    Finding,
    Ranked,
    Step,
    at_values_of,
    label,
    parameters_of,
    step_added,
    step_of,
)
from updating.diagnosis.screening import N_BEST, N_BEST_DEEP, Grid, Screened, rivals, screen
from updating.diagnosis.separation import Decisive, Proposal, next_measurements, what_decides
from updating.inference.fit import ITERATIONS, FitProblem
from updating.inference.fit_function import LEVEL_FLOOR
from updating.inference.fit_result import FitResult
from updating.inference.preparation import basis_error, fitted_model

RIGHT_MARGIN, BELIEVED_MARGIN = 1.25, 1.15
"""A model counts as right up to the first multiple of the level that noise and the mesh leave; where the
caller says that its form is right, effects are believed up to the second: right ones leave no more. There the
root mean square of the error counts in the same way, as the level forgives lines that no effect reaches."""
FLOOR_MARGIN = 2.5
"""Up to this multiple of it, little enough is left for a search of weak effects."""
MOST_LEFT = 0.25
"""Where beams may err, effects that leave more than a right model are believed if they bring the level's
square below this share."""
TWIN_SHARE = 0.9
"""A candidate that takes more than this share of what the best does off the score, without k, is a twin."""
LEAST_REFINED = 3
"""So many are fitted fully at least."""
N_RIVALS = 4
"""So many candidates at the place of an accepted one are fitted from where its fit ended."""
SAME_PLACE = 0.1
"""Places no farther apart than this share of the structure's size count as one there."""
SAME_MEMBER = 0.5
"""Nor may they be farther apart than this share of the longest member's length."""
N_WEAK_FIT_LINES = 480
"""So many where weak effects are looked for: few lines see a narrow resonance or its absence."""
N_FINE = 2
"""So many of the best candidates are fitted in fine stages as long as much is unexplained; where more of the
candidates are tried because nothing explains the data, all that are fitted fully."""
N_PLACES, APART = 4, 0.05
"""Where nothing explains the data, what has a position is fitted from so many places, at least this share of
its range apart."""
PROMISING = 1.1
"""Where less is left than beams may leave, candidates are fitted if one of them is likely to lower the level
by this factor."""
QUICK_LINES, QUICK_ITERATIONS = 50, 6
"""Lines of a quick fit, and its iterations in each band, where the model is not settled."""
QUICK_REACH = 3.0
"""Candidates whose first one ends above so many times the best have no second, but for those that came first
by a measure."""
N_STRONGER, STRONGER = 6, 3.0
"""Where beams may err and the model is settled, so many of the best are fitted from an effect that is so many
times stronger as well: resonances that it must move past others stay before them."""
MOST_REFINED = 6
"""At most this many candidates are fitted fully in a round."""
N_ASSESSED = 240
"""Lines on which the errors of a quick fit are assessed."""
MAX_EFFECTS = 3
"""At most this many effects are added."""
MOST_SEPARATED = 3
"""For so many twins the next measurement is worked out."""
N_BRANCHES = 3
"""So many other candidates of the first round are searched on from before what is left is unexplained."""
OTHERWISE = 0.7
"""Those whose similarity to each other is below this."""
AS_GOOD_ALONE = 1.2
"""One effect is preferred to several if its level is no more than this factor above theirs."""
AS_GOOD = 3.0
"""Optima whose negative log posterior is no more than this above the best count as possible values."""
BASIS_SHARE = 0.03
"""Error of the reduced basis, in parts of the residual level, above which the found model's modes join it."""
BASIS_REACH = (1.2, 2.0)
"""They are taken up to these multiples of the highest frequency, one after the other if need be."""
BASIS_LINES = 12
"""Lines at which that error is checked."""
Progress = Callable[[str, float], None]
"""Called with what is being done and the fraction done, 0 to 1."""


@dataclass(frozen=True, slots=True)
class Floor:
    """What noise and the mesh leave, and how much more a model or effects may leave.

    Attributes
    ----------
    level : float
        Residual level that noise and the mesh leave [nepers].
    db : float
        Root mean square of the amplitude's error that they leave [dB].
    model_error : float
        Level that the form of the model may leave; 0 where that is right [nepers].
    """

    level: float
    db: float
    model_error: float

    @property
    def noise(self) -> float:
        """Level up to which noise and the mesh account for what is left [nepers]."""
        return RIGHT_MARGIN * self.level

    @property
    def limit(self) -> float:
        """Level up to which a model counts as right [nepers]."""
        return max(self.noise, self.model_error)

    @property
    def limits(self) -> Limits:
        """The limits of a search."""
        settled = FLOOR_MARGIN * self.level
        if self.model_error == 0:
            return Limits(settled, settled)
        return Limits(max(settled, self.model_error), noise=self.noise)

    def believed(self, null: FitResult) -> float:
        """Return the level up to which effects are believed [nepers]; ``null`` is the model without them."""
        if self.model_error == 0:
            return BELIEVED_MARGIN * self.level
        return max(self.limit, MOST_LEFT**0.5 * null.level)

    def believes(self, fit: FitResult, null: FitResult) -> bool:
        """Whether the effects of a fit are believed; ``null`` is the model without them."""
        all_lines = self.model_error > 0 or fit.audible_db <= BELIEVED_MARGIN * self.db
        return all_lines and fit.level <= self.believed(null)


@dataclass(frozen=True, slots=True, eq=False)
class Search:
    """How far the search for effects has come.

    ``checked`` is the fit that was last compared with direct solutions, and the error of its basis [dB].
    """

    problem: FitProblem
    findings: tuple[Finding, ...]
    rounds: tuple[tuple[Ranked, ...], ...]
    steps: tuple[Step, ...]
    current: FitResult
    checked: tuple[FitResult, float] | None = None

    def basis_error(self, n_lines: int) -> float:
        """Return the error of the basis with what was found [dB], at so many lines unless it is known."""
        fit, error = self.checked or (None, 0.0)
        return error if fit is self.current else basis_error(self.problem, self.current, n_lines)

    def without(self, name: str) -> "Search":
        """Return the search with an effect and its round taken away, and the others fitted without it."""
        less = self.problem.fit_without(self.current, name)
        kept = [k for k, f in enumerate(self.findings) if f.effect.name != name]
        findings = at_values_of(less, [self.findings[k] for k in kept])
        last = step_added(less.effects, less) if kept else step_of(self.steps[1].label, less)
        steps = (*self.steps[: 2 if kept else 1], last)
        return Search(self.problem, tuple(findings), tuple(self.rounds[k] for k in kept), steps, less)

    def explains(self, floor: Floor, null: FitResult) -> bool:
        """Whether no more is left than a right model leaves, or than effects that were found may leave."""
        return floor.believes(self.current, null) if self.findings else self.current.level <= floor.limit

    @property
    def depends_on_amplitude(self) -> bool:
        """Whether an effect was found that does."""
        return any(f.effect.amplitude_dependent for f in self.findings)


def search_effects(begin: Search, candidates: Sequence[Effect], floor: Floor, say: Progress) -> Search:
    """Search for effects.

    Once more among more of the candidates for one effect that does alone what several do together, or before
    what is left is called unexplained; then also from other first effects.
    """
    null, full = begin.current, floor.limits
    grids = {e.name: Grid.of(begin.problem, e) for e in candidates}
    first = _Round(begin.problem, begin.current, settled=False, grids=tuple(grids.values()))
    search = _forward(begin, candidates, grids, full, N_BEST, say, round_=first)
    later = between(say, 0.53, 1.0)
    more_than_noise = search.current.level > min(floor.noise, floor.believed(null))
    if len(search.findings) > 2 or (len(search.findings) > 1 and more_than_noise):
        search = _exchanged(search, candidates, full, between(say, 0.5, 0.53))
    if len(search.findings) > 1 or not search.explains(floor, null):
        strict = full._replace(settled=floor.limit)
        alone = _forward(begin, candidates, grids, strict, N_BEST_DEEP, later, 1, first)
        if alone.findings and _as_good(alone, search):
            search = alone
        if not search.explains(floor, null) and any(alone.rounds[:1]):
            search = _branched(begin, search, alone.rounds[0], candidates, floor, later)
    if floor.model_error == 0 and not search.findings and search.current.level <= floor.limit:
        search = _strained(search, candidates)
    ended = _on_own_basis(search)
    # One effect alone was judged by what it is; of several one may have stood for an error of the basis.
    if ended.current is search.current or len(ended.findings) == 1:
        return ended
    return _with_idle_dropped(ended, full)


def _strained(search: Search, candidates: Sequence[Effect]) -> Search:
    """Call it an effect where a fit is right with an uncertain parameter that has left its tolerance.

    The one that is farthest off, if a candidate takes its place, and the posterior gains as much by that as
    such a strain costs.
    """
    problem, current = search.problem, search.current
    strains = problem.strains(current)
    places = {
        ref: e for e in candidates if len(e.parameters()) == len(e.replaces()) == 1 for ref in e.replaces()
    }
    far = {ref: abs(s) for ref, s in strains.items() if abs(s) > STRAINED and ref in places}
    if not far:
        return search
    ref = max(far, key=lambda r: far[r])
    (p,) = places[ref].parameters()
    effect = places[ref].with_values(**{p.name: current.values[ref]})
    mine = _attached(problem, [effect])
    fit = _polish(
        mine, mine.fit([effect], [parameter_values(effect)], stages=[mine.stages[-1]], x_from=current)
    )
    if current.solution.cost - fit.solution.cost < 0.5 * STRAINED**2:
        return search
    (effect,) = fit.effects
    entry = replace(Rule(mine, 0.0, True, current).ranked(fit, 1.0, True), asked=current.level)
    finding = Finding(effect, parameters_of(effect, fit), (), strain=strains[ref])
    steps = (*search.steps, step_added([effect], fit))
    return Search(mine, (finding,), ((entry,), *search.rounds), steps, fit)


def _exchanged(search: Search, candidates: Sequence[Effect], limits: Limits, say: Progress) -> Search:
    """Take away each of several effects but the last, search on beside the others, and keep the best end.

    The first was chosen while the others were missing, and may have stood for some of them.
    """
    best, grids = search, {e.name: Grid.of(search.problem, e) for e in candidates}
    for i in range(len(search.findings) - 1):
        begin = search.without(search.findings[i].effect.name)
        again = _forward(begin, candidates, grids, limits, N_BEST, say, most=len(search.findings))
        best = _better(again, best)
    return best


def _branched(
    begin: Search,
    search: Search,
    ranked: tuple[Ranked, ...],
    candidates: Sequence[Effect],
    floor: Floor,
    say: Progress,
) -> Search:
    """Search on from candidates of a first round, and keep the best end.

    From the first of what was found, beside more of the candidates; then from others: of two effects neither
    need come first while both are missing. A third is looked for beside the best two alone. No other is tried
    once one explains the data as a right model does.
    """
    limits, null = floor.limits, begin.current
    ended, names = search, [f.effect.name for f in search.findings]
    ways = [
        (r, _attached(begin.problem, r.result.effects), N_BEST_DEEP) for r in ranked if r.name in names[:1]
    ]
    ways += [(r, problem, N_BEST) for r, problem in _others(begin, ranked, names)]
    for other, problem, n_best in ways:
        best = _polish(problem, other.result)
        order = (other, *(r for r in ranked if r is not other))
        (effect,) = best.effects
        finding = Finding(effect, parameters_of(effect, best), *_explained(problem, order, begin.current))
        steps = (*begin.steps, step_added([effect], best))
        branch = Search(problem, (finding,), (order,), steps, best)
        end = _forward(branch, candidates, {}, limits, n_best, say, most=2)
        ended = _better(end, ended)
        if ended.current.level <= floor.limit and floor.believes(ended.current, null):
            break
    may_go_on = ended is not search and len(ended.findings) == 2
    return _forward(ended, candidates, {}, limits, N_BEST, say) if may_go_on else ended


def _others(
    begin: Search, ranked: tuple[Ranked, ...], tried: Collection[str]
) -> list[tuple[Ranked, FitProblem]]:
    """Return candidates of a first round to search on from, ``N_BRANCHES`` of those that were not tried.

    The first of them, though it may be a twin that had to stand back, and the best, though it may not pay
    alone; then those that do something else to the FRFs than any before. Each with the problem on its basis.
    """
    refined = [r for r in ranked if r.refined] or ranked
    best = min(refined, key=lambda r: score(begin.problem, r.result))
    first = next((r for r in ranked if r.name not in tried), best)
    out: list[tuple[Ranked, FitProblem]] = []
    before: list[NDArray[np.complex128]] = []
    for r in sorted(ranked, key=lambda r: (r.name not in tried, r not in (first, best))):
        if len(out) == N_BRANCHES:
            break
        problem = _attached(begin.problem, r.result.effects)
        mine = change_of(problem, r.result, begin.current)
        if r.name in tried:
            before.append(mine)
        elif r in (first, best) or all(similarity_of(mine, other) < OTHERWISE for other in before):
            out.append((r, problem))
            before.append(mine)
    return out


def _better(one: Search, other: Search) -> Search:
    """Return that of two searches whose effects have the lower score, the other if they are equal."""
    first, second = _on_as_many_lines(one, other)
    mine, others = (score(s.problem, s.current, len(s.findings)) for s in (first, second))
    return one if mine < others else other


def _as_good(alone: Search, several: Search) -> bool:
    """Whether one effect is preferred to several: it leaves little more, and is not much less likely."""
    first, second = _on_as_many_lines(alone, several)
    if first.current.solution.cost > second.current.solution.cost + ACCEPT_GAIN:
        return False
    return first.current.level < AS_GOOD_ALONE * second.current.level


def _on_as_many_lines(*searches: Search) -> list[Search]:
    """Return searches fitted to as many lines as that with the most: their posteriors may be compared."""
    most = max(s.problem.n_lines for s in searches)
    out = []
    for s in searches:
        if s.problem.n_lines < most:
            problem = replace(s.problem, n_lines=most)
            s = replace(s, problem=problem, current=problem.refit(s.current))
        out.append(s)
    return out


def _on_own_basis(search: Search) -> Search:
    """Fit what was found once more on a basis with its own modes, if that of the search is not good enough.

    The search's basis has the nominal model's modes and the responses to forces at the effects' places. Where
    an effect changes a whole member, they converge slowly to the modes with it. The noise of thousands of
    values averages out in a parameter, and an error of the basis does not: it must be much smaller.
    """
    begun = search
    for reach in BASIS_REACH if search.findings else ():
        problem, current, error = search.problem, search.current, search.basis_error(BASIS_LINES)
        search = replace(search, checked=(current, error))
        if error <= BASIS_SHARE * max(current.level, LEVEL_FLOOR) * DB_PER_NEPER / np.sqrt(2):
            break
        up_to = reach * float(problem.data.frequency[-1])
        reduced = problem.reduced.with_modes_of(fitted_model(problem.reduced.model, current), up_to)
        problem = _attached(replace(problem, reduced=reduced), current.effects)
        search = replace(search, problem=problem, current=_polish(problem, current))
    if search.current is begun.current:
        return search
    findings = tuple(at_values_of(search.current, search.findings))
    steps = (*search.steps[:-1], step_of(search.steps[-1].label, search.current))
    return replace(search, findings=findings, steps=steps)


def _forward(
    begin: Search,
    candidates: Sequence[Effect],
    grids: Mapping[str, Grid],
    limits: Limits,
    n_best: int,
    say: Progress,
    most: int = MAX_EFFECTS,
    round_: "_Round | None" = None,
    promise: float = PROMISING,
) -> Search:
    """Add effects while they pay, and drop those that the others have made idle.

    ``grids`` are those of the candidates on the problem to begin with. The ``n_best`` best candidates by each
    measure are fitted, and ``most`` effects added. ``round_`` is one that may have begun where this begins.
    ``promise`` is the factor by which the level must be likely to fall below ``problem.beams_leave``.
    """
    problem, current = begin.problem, begin.current
    findings, rounds, steps = list(begin.findings), list(begin.rounds), list(begin.steps)
    while len(findings) < most:
        taken = {f.effect.name for f in findings}
        open_ = [
            e for e in candidates if e.name not in taken and not (set(e.released()) & _released(findings))
        ]
        part = _part(say, len(rounds))
        grids = grids or {e.name: Grid.of(problem, e) for e in open_}
        settled = current.level < limits.settled
        if settled and limits.weak and problem.n_lines < N_WEAK_FIT_LINES:
            problem = replace(problem, n_lines=N_WEAK_FIT_LINES)
            current = problem.refit(current)
            findings = at_values_of(current, findings)
            steps[-1] = step_of(steps[-1].label, current)
        rule = Rule(problem, limits.settled, settled, current, limits.noise)
        if round_ is None or not round_.is_from(problem, current, settled):
            round_ = _Round(problem, current, settled, tuple(grids[e.name] for e in open_))
        ranked, best = round_.run(rule, n_best, part, promise)
        if best is None:
            break
        rounds.append(ranked)
        # The candidate's fit may have found better nuisance parameters; the model without it
        # deserves them too.
        again = problem.refit(current, _believed(best))
        if again.solution.cost < current.solution.cost - 0.1:
            current = again
            steps[-1] = step_of(steps[-1].label, current)
        rule = replace(rule, before=current)
        if not rule.pays(best):
            break
        say(f"checking {label(best.effects[-1])}", (len(rounds) + 0.9) / (len(rounds) + 2))
        attached = _attached(problem, best.effects)
        best = _polish(attached, best)
        if attached is not problem:
            problem = _attached(attached, best.effects)
            if problem is not attached:  # the position has moved: once more where it is now
                best = _polish(problem, best)
            grids = {e.name: Grid.of(problem, e) for e in open_}
        reduced = problem.reduced
        problem, rounds[-1], best = _against_rivals(problem, rule, ranked, best, open_, grids)
        grids = grids if problem.reduced is reduced else {}
        explained = _explained(problem, rounds[-1], current)
        last = best.effects[-1]
        findings = [*at_values_of(best, findings), Finding(last, parameters_of(last, best), *explained)]
        current = best
        steps.append(step_added([last], best))
    return _with_idle_dropped(Search(problem, tuple(findings), tuple(rounds), tuple(steps), current), limits)


def best_addition(
    begin: Search, candidates: Sequence[Effect], grids: Mapping[str, Grid], limits: Limits
) -> tuple[FitResult, FitResult]:
    """Return a fit without and with the best of all candidates beside its effects, whether or not it pays."""
    most = len(begin.findings) + 1
    begin = replace(begin, rounds=begin.rounds[: most - 1])
    search = _forward(begin, candidates, grids, limits, N_BEST, lambda text, done: None, most, promise=0.0)
    last = search.rounds[most - 1] if len(search.rounds) >= most else ()
    if len(search.findings) == most:
        return begin.current, search.current
    fits = [r.result for r in last if r.refined]
    return search.current, min(fits, key=whole_level, default=search.current)


def _part(say: Progress, n: int) -> Progress:
    """Return progress of round n as a part of the whole, whose length is not known before."""
    return lambda text, done: say(text, (n + done) / (n + 2))


def between(say: Progress, start: float, end: float) -> Progress:
    """Return progress of a part of the whole, from one fraction to another."""
    return lambda text, done: say(text, start + (end - start) * done)


def _released(findings: Sequence[Finding]) -> set[tuple[str, str]]:
    return {key for f in findings for key in f.effect.released()}


@dataclass(slots=True, eq=False)
class _Round:
    """One round: every candidate is looked at, the promising are fitted quickly, the best of them fully.

    Nothing is fitted twice: run again for more of the candidates, a round fits only those.

    Attributes
    ----------
    problem : FitProblem
    before : FitResult
        The model so far.
    settled : bool
        Whether it is right but for noise.
    grids : tuple of Grid
        The candidates.
    """

    problem: FitProblem
    before: FitResult
    settled: bool
    grids: tuple[Grid, ...]
    _looked: tuple[Screened, ...] | None = None
    _on: dict[str, FitProblem] = field(default_factory=dict)
    _quick: dict[str, list[FitResult]] = field(default_factory=dict)
    _final: dict[str, FitResult] = field(default_factory=dict)
    _stronger: set[str] = field(default_factory=set)
    _fine: set[str] = field(default_factory=set)
    _elsewhere: set[str] = field(default_factory=set)

    def is_from(self, problem: FitProblem, before: FitResult, settled: bool) -> bool:
        """Whether the round begins there."""
        return self.problem is problem and self.before is before and self.settled == settled

    def run(
        self, rule: Rule, n_best: int, say: Progress, promise: float = PROMISING
    ) -> tuple[tuple[Ranked, ...], FitResult | None]:
        """Return the candidates that were fitted, best first, and the best fit.

        The ``n_best`` best by each measure are fitted, none where less is left than beams may leave and none
        is likely to lower the level by the factor ``promise``. The best of those that pay comes before a
        better one that does not: it may have found its gain where the lines of the fit are, and nowhere else.
        """
        problem, current = self.problem, self.before
        if self._looked is None:
            self._looked = screen(
                problem,
                current,
                self.grids,
                self.settled,
                between(say, 0.0, 0.3),
                weak_only=problem.form_right,
                also=self._goes_on,
            )
        chosen = [option for option in self._looked if option.rank < n_best]
        if current.level < problem.beams_leave and all(option.promise < promise for option in chosen):
            chosen = []
        if not chosen:
            return (), None
        self._fit_quickly(chosen, say)

        def quick_score(name: str) -> float:
            return fitted_score(problem, self._quick[name][0])

        names = sorted((o.effect.name for o in chosen), key=quick_score)
        if self.settled and not problem.form_right:
            for i, name in enumerate(names[:N_STRONGER]):
                say(f"screening {label(self._quick[name][0].effects[-1])}", 0.5 + 0.1 * i / N_STRONGER)
                self._fit_stronger(name)
            names.sort(key=quick_score)
        near = [n for n in names if self._is_near(n, names[0])]
        # What is known already can only take the place of what is not.
        names.sort(key=lambda n: self.settled and known_already(problem, self._quick[n][0], n))
        finalists = names[: int(np.clip(len(near), LEAST_REFINED, MOST_REFINED))]
        if self.settled:
            # What damps stands behind all that do nothing, by its margin, or behind what bends to what beams
            # leave: its best is tried as well, and what may do the same within its tolerance.
            last = {n: self._quick[n][0].effects[-1] for n in names}
            damping = [n for n in names if problem.form_right and damps(problem, last[n])]
            for loose in (damping[:1], [n for n in names if self._goes_on(last[n])][:1]):
                finalists += [n for n in loose if n not in finalists]
        for i, name in enumerate(finalists):
            say(f"fitting {label(self._quick[name][0].effects[-1])}", 0.6 + 0.4 * i / len(finalists))
            self._fit_fully(name)
        final = {n: self._final[n] for n in names if n in self._final}
        order = sorted(final, key=lambda n: score(problem, final[n]))
        if not self.settled and final[order[0]].level > rule.limit:
            deep = n_best > N_BEST
            for name in order if deep else order[:N_FINE]:
                say(f"fitting {label(final[name].effects[-1])} in fine stages", 1.0)
                final[name] = self._fit_finely(name)
                if deep:
                    final[name] = self._fit_elsewhere(name)
            order.sort(key=lambda n: score(problem, final[n]))
        short = {n: self._on[n].assessed(self._quick[n][0], N_ASSESSED) for n in names if n not in final}
        if self.settled and problem.form_right:
            # Short fits were ordered by the lines of the fit: what the others put first is tried as well.
            first = self._on[order[0]].assessed(final[order[0]], N_ASSESSED)
            for name in [n for n in short if score(problem, short[n]) < score(problem, first)]:
                self._fit_fully(name)
                final[name] = self._final[name]
            order = sorted(final, key=lambda n: score(problem, final[n]))
        best_name = next((n for n in order if self._pays(rule, final, order, n)), order[0])
        best = final[best_name]
        shift = change_of(self._on[best_name], best, current)
        ranked = []
        for name in names:
            fit = final[name] if name in final else short[name]
            similarity = similarity_of(shift, change_of(self._on[name], fit, current))
            ranked.append(rule.ranked(fit, similarity, name in final))
        return _in_order(problem, ranked, best_name), best

    def _is_near(self, name: str, best: str) -> bool:
        """Whether a candidate is fitted quickly nearly as well as the best, and may be better in the end."""
        mine, first, now = self._quick[name][0], self._quick[best][0], self.before.solution.cost
        if not self.settled:
            return mine.level < 1.8 * first.level
        twin = now - mine.solution.cost > TWIN_SHARE * (now - first.solution.cost)
        return self.problem.form_right and twin

    def _pays(self, rule: Rule, final: Mapping[str, FitResult], order: Sequence[str], name: str) -> bool:
        """Whether a candidate pays, ``order`` being that of the scores.

        Where the form is right and members' damping within its tolerance explains the data better than all
        else that damps or makes modes complex, none of that is missing.
        """
        if not self.problem.form_right:
            return rule.pays(final[name], best=name == order[0])
        alike = [n for n in order if makes_complex(self.problem, final[n].effects[-1])]
        if name in alike and rule.tolerates(final[alike[0]]):
            return False
        return rule.pays(final[name], best=name in alike[:1])

    def _goes_on(self, effect: Effect) -> bool:
        """Whether the best such candidate is fitted whatever stands before it, where the model is settled."""
        return is_loss_factor(effect) if self.problem.form_right else dissipates(self.problem, effect)

    @property
    def _begun(self) -> list[dict[str, float]]:
        return [parameter_values(e) for e in self.before.effects]

    @property
    def _two_stages(self) -> NDArray[np.float64]:
        return np.unique([self.problem.stages[0], self.problem.stages[-1]])

    def _fit_quickly(self, chosen: Sequence[Screened], say: Progress) -> None:
        """Fit from one start, and those that do well then from others; the best come first.

        While the model is settled fits start from its parameters; before, they start from the nominal ones
        as well, because parameters that were fitted without an effect are off.
        """
        problem, current, settled = self.problem, self.before, self.settled
        lines = problem.n_lines if settled else QUICK_LINES
        # What is little is ranked by how little it gains, and six iterations may end before that.
        iterations = ITERATIONS if settled else QUICK_ITERATIONS
        quick = {"n_lines": lines, "max_iterations": iterations, "assess": False}
        stages, from_current = self._two_stages, {"stages": problem.stages[-1:], "x_from": current}
        for i, option in enumerate(chosen):
            name, effects = option.effect.name, [*current.effects, option.effect]
            if name in self._quick:
                continue
            say(f"screening {label(option.effect)}", 0.3 + 0.2 * i / len(chosen))
            places = [option.effect.with_values(**start) for start in option.starts]
            self._on[name] = replace(problem, reduced=problem.reduced.with_forces_of(places))
            begin: dict[str, Any] = from_current if settled else {"stages": stages}
            first = option.starts if settled else option.starts[:1]
            fits = [self._on[name].fit(effects, [*self._begun, s], **begin, **quick) for s in first]
            self._quick[name] = sorted(fits, key=lambda f: f.solution.cost)
        if settled:
            return
        reach = QUICK_REACH * min(self._quick[o.effect.name][0].level for o in chosen)
        for option in chosen:
            name, effects = option.effect.name, [*current.effects, option.effect]
            poor = option.rank > 0 and self._quick[name][0].level > reach
            if len(self._quick[name]) > 1 or poor:
                continue
            say(f"screening {label(option.effect)}", 0.5)
            for k, start in enumerate(option.starts):
                begin = {"stages": stages} if k else from_current
                fit = self._on[name].fit(effects, [*self._begun, start], **begin, **quick)
                self._quick[name].append(fit)
            self._quick[name].sort(key=lambda f: f.solution.cost)

    def _grid(self, name: str) -> Grid:
        return next(g for g in self.grids if g.effect.name == name)

    def _fit_stronger(self, name: str) -> None:
        """Fit once more from an effect that is stronger than where the short fit has ended."""
        fit = self._quick[name][0]
        if name in self._stronger:
            return
        self._stronger.add(name)
        now = parameter_values(fit.effects[-1])
        start = self._grid(name).scaled(now, STRONGER)
        if start == now:
            return
        last = {"stages": self.problem.stages[-1:], "x_from": self.before, "assess": False}
        self._quick[name].append(self._on[name].fit(fit.effects, [*self._begun, start], **last))
        self._quick[name].sort(key=lambda f: f.solution.cost)

    def _fit_fully(self, name: str) -> None:
        if name in self._final:
            return
        quickly = self._quick[name][0]
        effect, effects = quickly.effects[-1], [*self.before.effects, quickly.effects[-1]]
        starts = [*self._begun, parameter_values(effect)]
        along = self._grid(name).along(starts[-1]) if self.problem.form_right else ()
        mine = self._on[name] = _attached(self.problem, [effect, *(effect.with_values(**p) for p in along)])
        options = [mine.fit(effects, starts, stages=[mine.stages[-1]], x_from=quickly, assess=False)]
        if not self.settled:
            options.append(mine.fit(effects, starts, assess=False))
        begin = {"stages": [mine.stages[-1]], "x_from": self.before, "assess": False}
        options += [mine.fit(effects, [*self._begun, point], **begin) for point in along]
        self._final[name] = mine.assessed(min(options, key=lambda r: r.solution.cost))

    def _fit_finely(self, name: str) -> FitResult:
        if name not in self._fine:
            self._fine.add(name)
            last = self._final[name].effects[-1]
            starts = [*self._begun, parameter_values(self._quick[name][0].effects[-1])]
            stages = self.problem.fine_stages
            fine = self._on[name].fit([*self.before.effects, last], starts, stages=stages)
            best = min(self._final[name], fine, key=lambda r: r.solution.cost)
            even = self._on[name].refit(best, self._on[name].with_even_damping(best))
            self._final[name] = min(best, even, key=lambda r: r.solution.cost)
        return self._final[name]

    def _fit_elsewhere(self, name: str) -> FitResult:
        """Fit what has a position from all over the member: fits do not move it past a node of the modes.

        Quickly from each point of its grid; then fully from where the best end, in either kind of stages, and
        from there with the uncertain parameters as they are and each strength of the grid.
        """
        problem, begun = self.problem, self._begun
        grid = self._grid(name)
        position = grid.position
        if position is None or name in self._elsewhere:
            return self._final[name]
        self._elsewhere.add(name)
        quick = {"n_lines": QUICK_LINES, "max_iterations": QUICK_ITERATIONS, "assess": False}
        ends = []
        for point in grid.points:
            effects = [*self.before.effects, grid.effect.with_values(**point)]
            mine = replace(problem, reduced=problem.reduced.with_forces_of(effects[-1:]))
            ends.append(mine.fit(effects, [*begun, point], stages=self._two_stages, **quick))
        ends.sort(key=lambda r: r.solution.cost)
        first = grid.effect.parameters()[0].name
        strengths = sorted({point[first] for point in grid.points})
        apart, taken = APART * (position.upper - position.lower), list[float]()
        for end in ends:
            at = end.values[name, "position"]
            if len(taken) == N_PLACES or any(abs(at - other) < apart for other in taken):
                continue
            taken.append(at)
            mine = _attached(problem, end.effects[-1:])
            starts = [*begun, parameter_values(end.effects[-1])]
            # The basis of the place that it came from underrates it elsewhere: its strength is open again.
            anew = ([*begun, {**starts[-1], first: value}] for value in strengths)
            fits = [mine.fit(end.effects, s, stages=mine.stages, x_from=end, assess=False) for s in anew]
            fit = min(mine.fit_anew(end.effects, starts), *fits, key=lambda r: r.solution.cost)
            if fit.solution.cost < self._final[name].solution.cost:
                self._on[name], self._final[name] = mine, mine.assessed(fit)
        return self._final[name]


def _against_rivals(
    problem: FitProblem,
    rule: Rule,
    ranked: tuple[Ranked, ...],
    best: FitResult,
    candidates: Sequence[Effect],
    grids: Mapping[str, Grid],
) -> tuple[FitProblem, tuple[Ranked, ...], FitResult]:
    """Let others take the turn of an accepted candidate, at its place or its opposite, and keep the best.

    Those at its place are fitted from where its fit ended: without an effect, or with the nominal ones, the
    uncertain parameters are off, and what acts much alike, such as a crack beside a support and the support's
    own flexibility, then comes out in an order of chance.
    """
    model, winner = problem.reduced.model, best.effects[-1]
    longest = max(model.mesh.member_length(m) for m in model.mesh.members)
    reach = min(SAME_PLACE * model.mesh.size, SAME_MEMBER * longest)
    others, places = (grids[e.name] for e in candidates if e.name != winner.name), winner.locations(model)
    near = [part for grid in others if (part := grid.near(model, places, reach, longest))]
    shift = change_of(problem, best, rule.before)
    entries = {r.name: r for r in ranked}
    entries[winner.name] = rule.ranked(best, 1.0, True)
    chosen_problem, chosen = problem, best
    from_best: dict[str, Any] = {"stages": [problem.stages[-1]], "x_from": best}

    def options() -> Iterator[tuple[Screened, dict[str, Any]]]:
        yield from ((option, from_best) for option in rivals(problem, best, near, N_RIVALS))
        # Of the best so far; the uncertain parameter of both then has another value than where a fit ended.
        yield from ((option, {}) for option in _opposites(model, chosen.effects[-1], candidates))

    for option, begin in options():
        mine = _attached(problem, [*best.effects, option.effect.with_values(**option.starts[0])])
        effects = [*best.effects[:-1], option.effect]
        starts = [*map(parameter_values, best.effects[:-1]), option.starts[0]]
        fit = mine.fit(effects, starts, **begin)
        name = option.effect.name
        known = entries.get(name)
        if known is None or not known.refined or score(problem, fit) < score(problem, known.result):
            entries[name] = rule.ranked(fit, similarity_of(shift, change_of(mine, fit, rule.before)), True)
        if score(problem, fit) < score(problem, chosen) and rule.pays(fit):
            chosen_problem, chosen = mine, fit
    likelier = _of_fewest_places(problem, rule, entries.values(), chosen, candidates)
    if likelier is not chosen:
        chosen_problem, chosen = _attached(problem, likelier.effects[-1:]), likelier
    if chosen is not best:
        chosen = _polish(chosen_problem, chosen)
        entries[chosen.effects[-1].name] = rule.ranked(chosen, 1.0, True)
    return chosen_problem, _in_order(problem, entries.values(), chosen.effects[-1].name), chosen


def _opposites(model: Model, effect: Effect, candidates: Sequence[Effect]) -> tuple[Screened, ...]:
    """Return the opposite change of the only other member of an effect's material, if there is one alone.

    Of two members that the first is softer, and that the second is stiffer and their material softer, are
    the same; how far the material's modulus is then from its nominal value tells them apart.
    """
    change, *more = effect.parameters()
    if change.name != "change" or more or getattr(effect, "member", None) not in model.mesh.members:
        return ()

    def material(other: Any) -> tuple[ParameterRef, ...]:
        return material_of(model, other.member, "E")

    others = [e for e in candidates if e.kind == effect.kind and e.name != effect.name]
    rest = [e for e in others if material(e) == material(effect)]
    opposite = {"change": float(np.clip(-change.value, change.lower, change.upper))}
    return tuple(Screened(e, (opposite,)) for e in rest) if len(rest) == 1 else ()


def _of_fewest_places(
    problem: FitProblem, rule: Rule, ranked: Iterable[Ranked], best: FitResult, candidates: Sequence[Effect]
) -> FitResult:
    """Return the fit of the likeliest candidate with as many parameters as the best, if all kinds are.

    Of a kind with n candidates each is then so by one in n, and (log n) / c joins its score as its parameters
    do: a force along a bar may be held by the instrument there, or by a spring to the ground at any place of
    it, which do the same.
    """
    c = problem.noise_counted
    n_places = Counter(effect.kind for effect in candidates)
    size = len(best.effects[-1].parameters())
    others = [r.result for r in ranked if r.refined and len(r.parameters) == size and rule.pays(r.result)]
    return min(
        (best, *others), key=lambda fit: score(problem, fit) + np.log(n_places[fit.effects[-1].kind]) / c
    )


def _in_order(problem: FitProblem, ranked: Iterable[Ranked], best: str) -> tuple[Ranked, ...]:
    """Return candidates with the named one first, those fitted fully before the others, then by score."""
    return tuple(sorted(ranked, key=lambda r: (not r.refined, r.name != best, score(problem, r.result))))


def _believed(fit: FitResult) -> FitResult:
    """Return a fit whose last effect's value stands for the parameter that it replaced."""
    last = fit.effects[-1]
    replaced, own = last.replaces(), last.parameters()
    if len(replaced) != 1 or len(own) != 1:
        return fit
    return replace(fit, values={**fit.values, replaced[0]: own[0].value})


def _with_idle_dropped(search: Search, limits: Limits) -> Search:
    """Return a search without the effects that are idle beside the others, their rounds behind the rest."""
    findings, current = _without_idle(search.problem, list(search.findings), search.current, limits)
    if len(findings) == len(search.findings):
        return search
    left = {f.effect.name for f in findings}
    kept = [k for k, f in enumerate(search.findings) if f.effect.name in left]
    order = *kept, *(k for k in range(len(search.rounds)) if k not in kept)
    last = [step_added((f.effect for f in findings), current)] if findings else []
    return Search(
        search.problem,
        tuple(findings),
        tuple(search.rounds[k] for k in order),
        (*search.steps[:2], *last),
        current,
    )


def _without_idle(
    problem: FitProblem, findings: list[Finding], current: FitResult, limits: Limits
) -> tuple[list[Finding], FitResult]:
    """Drop effects without which the fit is nearly as good, or that may as well be absent.

    One at a time: first what is within tolerance, then that without which the score is best, so that of two
    that do much the same one stays. Those that may be absent go where the model is settled, and weak effects
    stay where they count.
    """

    def tolerated(name: str) -> bool:
        known = known_already(problem, current, name)
        return known or (len(findings) > 1 and within_tolerance(problem, current, name))

    def is_idle(effect: Effect, less: FitResult) -> bool:
        rest = len(findings) > 1
        settled = less.level <= limits.settled
        if settled and takes_energy(problem, less, current, effect):
            return False
        beside = rest and settled and not problem.form_right and not is_firm(current, effect)
        usual = Factors(ACCEPT_BESIDE if beside else ACCEPT_LEVEL, ACCEPT_HELD_OUT)
        weak = current.level < limits.weak
        factors = weak_factors(problem, effect, beside=rest) if weak else usual
        certain = current.level >= limits.settled or stands_out(problem, less, current, effect.name)
        if certain and not rest and gains(problem, less, current):
            return False
        if certain and ends_in_noise(problem, less, current, effect, limits.noise):
            return False
        return not certain or not falls(less, current, factors, problem.form_right)

    while findings:
        n_left = len(findings) - 1
        first = [k for k, f in enumerate(findings) if tolerated(f.effect.name)]
        tried = first or range(len(findings))
        without = {k: problem.fit_without(current, findings[k].effect.name) for k in tried}
        idle = first or [k for k, less in without.items() if is_idle(findings[k].effect, less)]
        if not idle:
            break
        least = min(idle, key=lambda k: score(problem, without[k], n_left))
        current = without[least]
        findings = at_values_of(current, findings[:least] + findings[least + 1 :])
    return findings, current


def _attached(problem: FitProblem, effects: Sequence[Effect]) -> FitProblem:
    """Return the problem with the forces of effects in its basis, for a position also on either side of it.

    The modes alone make what is local, such as a crack, look weaker than it is.
    """
    model = problem.reduced.model
    reach = float(model.mesh.lengths().max())
    near = list(effects)
    for effect in effects:
        for p in effect.parameters():
            if p.name == "position":
                places = np.clip(p.value + np.array([-reach, reach]), p.lower, p.upper)
                near += [effect.with_values(position=float(s)) for s in places]
    reduced = problem.reduced.with_forces_of(near)
    return problem if reduced is problem.reduced else replace(problem, reduced=reduced)


def _polish(problem: FitProblem, best: FitResult) -> FitResult:
    """Fit again from starts around the best, with another value of its first parameter or of a law or width.

    Such as a width that reaches beyond a member's end, where the FRFs do not change with it. Optima that are
    as good widen the first parameter's standard deviation.
    """
    *have, last = best.effects
    first, *others = last.parameters()
    tried = [problem.refit(best, assess=False)]
    near = [(first, f) for f in (0.6, 0.8, 1.25, 1.7)]
    near += [(p, f) for p in others if p.name != "position" for f in (0.6, 1.7)]
    for p, factor in near:
        value = float(np.clip(factor * p.value, p.lower, p.upper))
        starts = [*map(parameter_values, have), {**parameter_values(last), p.name: value}]
        tried.append(
            problem.fit(best.effects, starts, stages=[problem.stages[-1]], x_from=best, assess=False)
        )
    tried.sort(key=lambda r: r.solution.cost)
    winner = tried[0]
    ref = (last.name, first.name)
    good = [r for r in tried if r.solution.cost < winner.solution.cost + AS_GOOD]
    spread = max(abs(r.values[ref] - winner.values[ref]) for r in good)
    return problem.assessed(replace(winner, std={**winner.std, ref: max(winner.std[ref], spread)}))


def change_of(problem: FitProblem, fit: FitResult, base: FitResult) -> NDArray[np.complex128]:
    """Return the logarithms of a fit's FRFs over those of another, at some lines, one after the other."""
    lines = problem.lines_up_to(np.inf, 60)
    ratio = log_ratio(problem.receptance(fit, lines), problem.receptance(base, lines))
    return np.nan_to_num(np.where(problem.data.mask[lines], ratio, 0.0)).ravel()


def similarity_of(a: NDArray[np.complex128], b: NDArray[np.complex128]) -> float:
    """Return the correlation of two changes, 0 to 1."""
    norm = float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(abs(np.vdot(a, b).real) / norm) if norm > 0 else 0.0


def _explained(
    problem: FitProblem, ranked: Sequence[Ranked], current: FitResult
) -> tuple[tuple[Ranked, ...], Ranked | None, tuple[Decisive, ...], tuple[tuple[Proposal, ...], ...]]:
    """Return the twins of the best candidate, its rival, what decides, and what would separate the twins."""
    best, before = ranked[0], score(problem, current, 0)
    gain = before - score(problem, best.result, 0)
    refined = [r for r in ranked[1:] if r.refined]
    twins = tuple(r for r in refined if before - score(problem, r.result, 0) > TWIN_SHARE * gain)
    rival = next((r for r in refined if r not in twins), None)
    against = rival or (twins[0] if twins else None)
    decisive = what_decides(problem, best.result, against.result) if against else ()
    proposals = tuple(next_measurements(problem, best.result, t.result) for t in twins[:MOST_SEPARATED])
    return twins, rival, decisive, proposals
