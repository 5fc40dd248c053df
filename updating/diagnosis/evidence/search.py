"""The search: places by the scan, then blocks and single laws there, each by its evidence."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence, Set
from contextlib import suppress
from dataclasses import InitVar, dataclass, field, fields, replace
from functools import partial
from itertools import combinations, product
from typing import Any, Generic

import numpy as np

from fem.array_types import Floats
from fem.declarations import Role
from fem.model import Effect, covers
from updating.correlation import DB_PER_NEPER
from updating.diagnosis.departures import departures
from updating.diagnosis.evidence.absence import gains_without
from updating.diagnosis.evidence.blocks import Block
from updating.diagnosis.evidence.budget import NORMAL, Budget
from updating.diagnosis.evidence.fits import (
    MOST_STEPS,
    QUICK_STEPS,
    SHORT_STEPS,
    Fits,
    P,
    around,
    with_forces,
)
from updating.diagnosis.evidence.halving import BEHIND_NATS, Candidate, Damped, HalvingTrial, halved
from updating.diagnosis.evidence.hypothesis import (
    Odds,
    ScoredFit,
    Start,
    Values,
    is_simpler,
    key_of,
    n_changes,
    near_to,
    values_of,
)
from updating.diagnosis.evidence.places import Place, place_of, places_of
from updating.diagnosis.evidence.ranking import MOST_GRIDS, RankedBlocks, Ranking
from updating.diagnosis.evidence.scan import Scanned
from updating.diagnosis.findings import labels
from updating.forecast.forecast import EffectEstimate
from updating.inference.belief import TWIN_NATS, UNKNOWN_ODDS
from updating.inference.defaults import FULL_LINES
from updating.inference.fit import FitProblem
from updating.inference.fit_result import FitResult
from updating.inference.heartbeat import Lasting
from updating.inference.parameters import Nuisance
from updating.inference.workers import ALONE, Workers

DOUBT_NATS = 15.0
"""An effect is left out in a fit unless the covariance says that the score would fall by more than this."""
LEAST_SHORT = 3
"""Number of short fits beside a hypothesis that explains the data, where the looks promise nothing."""
MOST_PROMISED = 24
"""Most candidates that are fitted because they promise to be twins of the best hypothesis."""
N_PROMISING = 4
"""Number of connections, and of other effects, that are tried from afar before all others."""
N_TOLD = 2
"""Number of places that are named while the search goes on."""
BEAM_NATS = 20.0
"""Hypotheses this much less probable than the best one with as many effects are not searched on from."""
MOST_BASES = 3
"""Number of bases at most, each with responses of the fit on the one before."""
IDLE_ROUNDS = 3
"""A search that explains too little goes no further after so many rounds whose effects do not pay: of
three that work only together the first two do not."""
CONNECTIONS = ("joint", "support", "end")
"""Kinds of places whose springs in all directions are a block."""
SPRING_UNITS = ("N/m", "N·m/rad", "rad/(N·m)")
"""Units of the parameter of a spring."""
BLOCK_SHARES = (0.2, 0.6, 1.0)
"""Blocks begin at these places of the effects' grids, from the weakest to the strongest [-]."""
AMID = (0.2, 0.4, 0.6, 0.8)
"""Starts of springs from afar, as shares of their grids from the weakest to the strongest [-]."""
Say = Callable[[str], None]


@dataclass(frozen=True, slots=True, eq=False)
class NextHypotheses:
    """Effects to add, and values to start from.

    Attributes
    ----------
    effects : tuple of Effect
    starts : sequence of Start
    worth : float
        By how much they would raise the score at most, were all linear [nats].
    is_first : bool
        Whether they are at the first place of the scan.
    """

    effects: tuple[Effect, ...]
    starts: Sequence[Start]
    worth: float
    is_first: bool


def _size(effect: Effect, values: dict[str, float]) -> float:
    """Return how far values are from the effect's absence, on the scale of its first parameter."""
    p, value = effect.parameters()[0], values[effect.parameters()[0].name]
    if np.isinf(p.absent):
        return -value
    return abs(np.log(value / p.absent)) if p.log and p.absent > 0 else abs(value - p.absent)


def _at_share(grid: Sequence[dict[str, float]], share: float) -> dict[str, float]:
    """Return the values at a share of a grid, 0 its first and 1 its last ones."""
    return grid[int(share * (len(grid) - 1))]


def _moved(one: ScoredFit, two: ScoredFit) -> bool:
    """Whether an effect's parameter is more than a deviation from where it is in another fit."""
    a, b = one.fitted, two.fitted
    names = one.key & two.key
    return any(abs(a.values[r] - b.values[r]) > b.std[r] for r in a.values if r[0] in names)


def _turns(effect: Effect) -> bool:
    """Whether an effect lets a connection give way about an axis."""
    return str(getattr(effect, "direction", "")).startswith("r")


def _is_spring(effect: Effect) -> bool:
    """Whether an effect is the stiffness of a connection in one direction, and nothing more."""
    units = [p.unit for p in effect.parameters()]
    pure = effect.role == Role.STIFFNESS and not effect.amplitude_dependent
    return pure and len(units) == 1 and units[0] in SPRING_UNITS and place_of(effect)[0] in CONNECTIONS


@dataclass(frozen=True, slots=True, eq=False)
class Maximum:
    """A maximum of the posterior and the normal approximation around it.

    Attributes
    ----------
    x : ndarray (n,)
    covariance : ndarray (n, n)
    log_evidence : float
    """

    x: Floats
    covariance: Floats
    log_evidence: float

    def distance(self, other: "Maximum") -> float:
        """Return the largest distance of unknowns, in standard deviations of the other."""
        return float(np.abs((self.x - other.x) / np.sqrt(np.diag(other.covariance))).max())


# What processes are asked for, each with what they share.


def _shortly(
    shared: tuple[Fits[P], P, int], item: tuple[tuple[Effect, ...], Sequence[Start]]
) -> list[ScoredFit]:
    (fits, quick, steps), (effects, starts) = shared, item
    return fits.shortly(quick, effects, starts, steps)


def _continued(shared: tuple[Fits[P], P, ScoredFit], item: list[ScoredFit]) -> ScoredFit:
    fits, quick, base = shared
    return fits.pruned(quick, fits.continued(quick, item), base)


def _quickly(shared: tuple[Fits[P], P, ScoredFit], item: tuple[Sequence[Effect], Values]) -> ScoredFit | None:
    (fits, quick, near), (effects, values) = shared, item
    try:
        return fits.quickly(quick, near, effects, values)
    except np.linalg.LinAlgError:  # no structure: more mass taken away than there is
        return None


def _onward(shared: tuple[Fits[P], P], item: ScoredFit) -> ScoredFit:
    fits, quick = shared
    return fits.continued(quick, [item])


def _ended(shared: tuple[Fits[P], P, ScoredFit], item: HalvingTrial) -> ScoredFit:
    (fits, problem, base), (effects, (start,)) = shared, item.candidate
    ended = fits.from_result(problem, start.near, effects, start.values, MOST_STEPS)
    return fits.pruned(problem, ended, base)


def _best_first(ways: Iterator[list[HalvingTrial]]) -> Iterator[list[HalvingTrial]]:
    """Yield the trials of each way, but last those that are far behind the best one on damped FRFs."""
    behind, least = list[HalvingTrial](), np.inf
    for trials in ways:
        least = min([least, *(t.cost for t in trials)])
        behind += [t for t in trials if t.cost > least + BEHIND_NATS]
        yield [t for t in trials if t.cost <= least + BEHIND_NATS]
    yield behind


def _again(fits: tuple[Fits], h: ScoredFit) -> ScoredFit:
    return fits[0].again(h)


def _fully(shared: tuple[Fits, bool], near: ScoredFit) -> ScoredFit:
    fits, anew = shared
    return fits.fully(near.effects, values_of(near.effects), near, anew=anew)


def _silent(text: str) -> None:
    """Say nothing."""


@dataclass(slots=True, eq=False)
class Search(Generic[P]):
    """A search and all hypotheses that it has fitted.

    Attributes
    ----------
    problem, form, ranking
        Of :class:`updating.diagnosis.evidence.fits.Fits`.
    candidates : tuple of Effect
    tell : callable
        Is told what is being decided.
    workers : Workers
        What computes independent fits.
    beforehand : float
        Logarithm of how probable the data were read rightly.
    budget : Budget
        How much is tried.
    say : callable
        Is told each score, for those who work on the search.
    seeds : tuple of ScoredFit
        Of searches on the same data beside another model: where one of them explains the data here as well,
        the search goes on from it.
    rival_score : float
        Of the best hypothesis beside other models: the search ends where nothing that it may still find is as
        probable.
    elsewhere : list of ScoredFit
        Further maxima of those in ``known``: the same effects at other positions.
    promised : dict
        By the key of a hypothesis that was not fitted, what a look promises of it.
    """

    problem: InitVar[P]
    form: InitVar[tuple[Nuisance, ...]]
    candidates: tuple[Effect, ...]
    tell: Say = _silent
    known: dict[frozenset[str], ScoredFit] = field(default_factory=dict)
    scanned: tuple[Scanned, ...] = ()
    ranking: InitVar[Ranking] = Ranking()  # noqa: RUF009 - it holds nothing
    workers: Workers = ALONE
    beforehand: InitVar[float] = 0.0
    budget: Budget = NORMAL
    say: Say = _silent
    seeds: tuple[ScoredFit, ...] = ()

    rival_score: float = -np.inf
    fits: Fits[P] = field(init=False)
    places: tuple[Place, ...] = field(init=False)
    elsewhere: list[ScoredFit] = field(default_factory=list, init=False)
    promised: dict[frozenset[str], ScoredFit] = field(default_factory=dict, init=False)
    _extended: set[frozenset[str]] = field(default_factory=set, init=False)
    _n_fits: Counter[frozenset[str]] = field(default_factory=Counter, init=False)
    # Of the problem beside them: they are asked for with every probability.
    _allowed: tuple[P, tuple[Floats, Floats]] | None = field(default=None, init=False)
    # Of one fit by one problem: it is asked for from afar and from near.
    _last_scan: tuple[P, FitResult, tuple[Scanned, ...]] | None = field(default=None, init=False)

    def __post_init__(
        self, problem: P, form: tuple[Nuisance, ...], ranking: Ranking, beforehand: float
    ) -> None:
        odds = Odds.of(self.candidates, problem.reduced.model, beforehand)
        self.fits = Fits(problem, form, odds, ranking, self.budget)
        self.places = places_of(problem, self.candidates)

    def __getstate__(self) -> tuple[None, dict[str, Any]]:
        """Return what a pickle keeps: neither listeners nor processes, which serve a running search alone."""
        running = {"tell": _silent, "say": _silent, "workers": ALONE}
        return None, {f.name: running.get(f.name, getattr(self, f.name)) for f in fields(self)}

    # the search ---------------------------------------------------------------------------------------------

    def run(self) -> ScoredFit:
        """Return the most probable hypothesis; all that were fitted fully are in ``known``."""
        for _ in self.rounds():
            pass
        return self.best

    @property
    def best(self) -> ScoredFit:
        """The most probable hypothesis so far; of it and its simpler twins that with the fewest changes."""
        top = max(self.known.values(), key=lambda h: h.score)
        fewer = [h for h in self.known.values() if is_simpler(h, top) and not self.beats(top, h)]
        return min(
            fewer, key=lambda h: (len(h.effects), sum(map(n_changes, h.effects)), -h.score), default=top
        )

    def rounds(self) -> Iterator[ScoredFit]:
        """Search with one effect more each time, and yield the most probable hypothesis so far."""
        best = self.full((), ())
        # The form of one that is far from the data is bent, and not searched on from.
        best = best if self.fits.is_far(best) else self.with_enriched_basis(best)
        self.say(f"nothing: {best.score:.1f}, level {best.fitted.level:.4f}, floor {self.fits.floor:.4f}")
        best = self._from_seeds(best)
        beam, visited, n_back, n_more = [best], {best.key}, 0, self.budget.n_rounds
        short, n_idle, last = [self.short_of(best)], 0, best.score
        while beam and n_more and self.unknown(best) >= self.rival_score:
            n_more -= 1
            better = {h.key: h for b in beam for h in self.extended(b, visited)}
            if self.known[best.key].score > best.score + TWIN_NATS:
                # What it lacks was judged by a fit that had not converged to the best maximum.
                best = self.known[best.key]
                beam, short, n_idle, last = [best], [self.short_of(best)], 0, best.score
                self.promised.clear()
                self._extended.clear()
                self.say(f"=> again {best.score:.1f}, level {best.fitted.level:.4f}: {best.name}")
                yield best
                continue
            beam = sorted(better.values(), key=lambda h: -h.score)[: self.budget.n_beam]
            beam = [h for k, h in enumerate(beam) if k == 0 or self.apart(h, beam[0])]
            n_idle = n_idle + 1 if beam and beam[0].score <= last else 0
            last = beam[0].score if beam else last
            if beam and self.beats(beam[0], best):
                if self.budget.checked:
                    beam[0] = self.swapped(beam[0])
                beam[0] = best = self.with_enriched_basis(beam[0])
                if self.suffices(best):  # what explains the data needs no other way
                    beam = beam[:1]
            elif self.suffices(best):
                break
            short += [self.short_of(h) for h in beam[:1]]
            if beam and self.is_hopeless(short, len(beam[0].effects)):
                beam, n_back = [], self.budget.most_back
            # What the library lacks is more probable than the best one: what does not pay leaves it so.
            if n_idle == IDLE_ROUNDS:
                visited |= {h.key for h in beam}
                beam, n_idle = [], 0
            # One of several missing effects may not pay for itself: on, while the unknown is more probable.
            beam = [h for h in beam if len(h.effects) < self.budget.most_effects]
            if not beam and not self.explains(best) and n_back < self.budget.most_back:
                n_back += 1
                short, last = short[:1], -np.inf
                unvisited = [
                    h
                    for h in self.known.values()
                    if h.key not in visited and len(h.effects) < self.budget.most_effects
                ]
                beam = sorted(unvisited, key=lambda h: -h.score)[:1]
            visited |= {h.key for h in beam}
            for h in beam[:1]:
                self.say(f"=> {h.score:.1f}, level {h.fitted.level:.4f}: {h.name}")
            yield best

    def so_far(self) -> str:
        """Return the best hypothesis and the error that it leaves, in words."""
        best = self.best
        what = labels(best.effects) if best.effects else "no effect found"
        return f"so far: {what}, {self.fits.problem.error_words(best.fitted)}"

    def end_early(self) -> None:
        """Let what follows take no longer than it must."""
        self.workers, self.budget = ALONE, replace(self.budget, checked=False)

    def _from_seeds(self, nothing: ScoredFit) -> ScoredFit:
        """Return the best seed if it explains the data here, or a hypothesis without effects."""
        if not self.seeds:
            return nothing
        names = key_of(self.candidates)
        for h in self.seeds:
            if h.key <= names:
                self.full(h.effects, values_of(h.effects), nothing)
        if not self.best.effects or not self.suffices(self.best):
            return nothing
        return self.with_enriched_basis(self.swapped(self.best))

    def promises(self) -> list[ScoredFit]:
        """Return what was not fitted, as probable as its forecast makes it."""
        return [p for key, p in self.promised.items() if key not in self.known]

    def promise_rest(self, base: ScoredFit) -> None:
        """Forecast every candidate that could be added to a hypothesis.

        The search has done it for those that it has tried to extend near the data.
        """
        if base.key not in self._extended:
            rest = self.compatible_with(base.effects)
            self._promise(base, self.fits.ranking.estimates(self.fits.free(base), base.fitted, rest))

    def _promise(self, base: ScoredFit, estimates: Iterable[EffectEstimate]) -> None:
        """Keep what hypotheses with one effect more are worth."""
        self._extended.add(base.key)
        for e in estimates:
            fitted = base.fitted.with_estimated(e.effect, e.values, e.std, e.log_evidence)
            h = ScoredFit(fitted, self.fits.odds.prior((*base.effects, e.effect)))
            self.promised.setdefault(h.key, h)

    def fit_promised(self) -> None:
        """Fit what was not fitted and is promised to be a twin of the best hypothesis."""
        for h in sorted(self.promises(), key=lambda h: -h.score)[:MOST_PROMISED]:
            if h.score < self.best.score - TWIN_NATS:
                break
            with suppress(np.linalg.LinAlgError):  # no structure: more mass taken away than there is
                self.full(h.effects, values_of(h.effects), h)

    def settled(self, h: ScoredFit) -> bool:
        """Whether a hypothesis has found what was missing: otherwise its uncertain parameters may be bent."""
        return self.suffices(h) and (bool(h.effects) or not self.fits.is_far(h))

    def beats(self, h: ScoredFit, best: ScoredFit) -> bool:
        """Whether a hypothesis is more probable than another one; than a simpler one, by more than a twin."""
        return h.score > best.score + (TWIN_NATS if is_simpler(best, h) else 0.0)

    def apart(self, h: ScoredFit, best: ScoredFit) -> bool:
        """Whether a hypothesis is nearly as probable as the best one, and at other places."""
        return h.score > best.score - BEAM_NATS and not h.places <= best.places

    def extended(self, base: ScoredFit, visited: Set[frozenset[str]]) -> list[ScoredFit]:
        """Return the best hypotheses that extend another one, simplified.

        Those that are simplified to one in ``visited`` stay as they are.
        """
        free, kept, far = self.fits.free(base), values_of(base.effects), self.fits.is_far(base)
        now = self.fits.quickly(free, base, base.effects, kept).score
        tried = self.tried_beside(base, free, now, far=far)
        best = {h.key: h for h in sorted(tried, key=lambda h: h.score)}
        tried = sorted(best.values(), key=lambda h: -h.score)
        final = self.budget.n_final
        least = 1 if base.effects or self.settled(base) else final
        tried = [h for k, h in enumerate(tried) if k < least or h.score > now - TWIN_NATS]
        tried = tried[: self.budget.n_full]
        for h in tried:
            self.say(f"   {h.score:9.1f} {h.fitted.level:.4f} {h.name}")
        # Few lines say less than all, but not so much less; what is far from the data may still move.
        there = bool(tried) and self.fits.is_near(tried[0])
        behind = (BEAM_NATS if k < final and not there else 2 * TWIN_NATS for k in range(len(tried)))
        near = [h for h, most in zip(tried, behind, strict=True) if h.score >= tried[0].score - most]
        fitted = [(h, self.simplified(h)) for h in self.all_full(near, anew=far)]
        if fitted:
            self._keep_behind(fitted[0][0], tried)
        return [h if less.key in visited else less for h, less in fitted if h.key not in visited]

    def tried_beside(self, base: ScoredFit, free: P, now: float, *, far: bool) -> list[ScoredFit]:
        """Return hypotheses that extend another one, fitted on few lines.

        From afar one way to the data is enough: near them looks tell what else would do.
        """
        damped = Damped.of(free, base.fitted, bent=self.fits.is_bent(base)) if far else None
        looked = damped.for_look() if damped else None
        if damped is None or looked is None:
            return self.from_near(base, free, now, far=far)
        # What explains the data with a form far from nominal may be as far as it is fitted.
        out = self.from_near(base, free, now, far=False) if self.suffices(base) else []
        ways = _best_first(self.from_afar(base, damped, looked))
        while not any(h.score > now + TWIN_NATS and self.fits.is_near(h) for h in out):
            if (trials := next(ways, None)) is None:
                break
            out += self.workers.map(_ended, (self.fits, free, base), trials)
        return out

    def _keep_behind(self, best: ScoredFit, tried: Sequence[ScoredFit]) -> None:
        """Keep what was fitted on few lines alone, as far behind the best as there."""
        few = {h.key: h for h in tried}
        for key, h in few.items():
            self.known.setdefault(key, h.at_score(best.score + h.score - few[best.key].score))

    def from_afar(self, base: ScoredFit, damped: Damped, looked: FitProblem) -> Iterator[list[HalvingTrial]]:
        """Yield candidates that damped FRFs ask for: the most promising, other effects, all connections."""
        kept, now = values_of(base.effects), base.fitted
        order = [s.places[0].parent for s in self.scan(now) if len(s.places) == 1]
        if not base.effects:
            self._keep_scan(self.scan(now))
            now = damped.problem.far_start(now)
        compatible = self.compatible_with(base.effects)
        springs = self.springs(key_of(compatible))
        first = sorted(springs, key=lambda p: order.index(p) if p in order else len(order))
        blocks = [
            ((*base.effects, *springs[p]), tuple(Start((*kept, *v), now) for v in self.amid(springs[p])))
            for p in first
        ]
        others = [e for e in compatible if not _is_spring(e)]
        self.tell(f"comparing {len(blocks)} connections and {len(others)} other effects")
        known = set[frozenset[str]]()

        def best_of(blocks: Sequence[Candidate], singles: Sequence[Candidate]) -> list[HalvingTrial]:
            trials = halved(damped, self.workers, blocks, singles)
            new = [t for t in trials if key_of(t.candidate[0]) not in known]
            known.update(key_of(t.candidate[0]) for t in new)
            return new

        # Little of an effect makes the short list, and may say nothing of much: then all are looked at.
        singles: list[Candidate] = []
        for every in (False, True) if len(others) > MOST_GRIDS else (True,):
            screened = self.fits.ranking.screened(looked, now, others, lambda e, every=every: every)
            singles = [
                ((*base.effects, s.effect), (Start((*kept, *s.starts[0].values), now),))
                for s in screened[: self.budget.n_singles]
            ]
            for n in (N_PROMISING, len(singles)):
                yield best_of(blocks[:N_PROMISING], singles[:n])
        yield best_of(blocks, singles)

    def amid(self, block: Sequence[Effect]) -> list[Values]:
        """Return starts of springs, all of them at the same share of their grids.

        Which one is near enough depends on the structure around the connection.
        """
        grids = self._grids(block)
        return [tuple(_at_share(g, share) for g in grids) for share in AMID]

    def _grids(self, effects: Sequence[Effect]) -> list[list[dict[str, float]]]:
        """Return the grids of some effects, each from the weakest to the strongest values."""
        return [sorted(e.starts(self.fits.problem.surroundings), key=partial(_size, e)) for e in effects]

    def springs(self, names: Set[str]) -> dict[str, tuple[Effect, ...]]:
        """Return the springs of each connection in all directions, of the effects with given names."""
        out: dict[str, tuple[Effect, ...]] = {}
        for p in self.places:
            springs = tuple(e for e in p.effects if _is_spring(e) and e.name in names)
            if springs:
                out[p.parent] = out.get(p.parent, ()) + springs
        return out

    def from_near(self, base: ScoredFit, free: P, now: float, *, far: bool) -> list[ScoredFit]:
        """Return candidates that a look at small changes asks for, fitted on few lines.

        ``now`` is the score of the base on these lines. If it is taken for ``far`` from the data, short fits
        do not bend the form towards what is missing; else they begin with the form as it is there.
        """
        what = f"effects in addition to {labels(base.effects)}" if base.effects else "effects"
        self.tell(f"looking at {len(self.candidates)} {what}")
        quick = self.fits.problems(base)[0] if far else free
        kept = values_of(base.effects)
        settled = self.settled(base) or (self.suffices(base) and not far)
        proposals = sorted(self.proposals(base, quick, far=far, settled=settled), key=lambda p: -p.worth)
        # Fits that begin where uncertain parameters stand for what is missing stay there.
        near = free.far_start(base.fitted) if far else None
        # Beside what explains the data all is nearly linear: fits reach what the looks promise.
        behind = TWIN_NATS if settled else 2 * TWIN_NATS
        best = now if self.suffices(base) else -np.inf
        # Near the data the looks say which effects deserve a fit, and few do; all else must follow each of
        # them. With modes more deserve one beside what explains nothing.
        few = not far and (settled or self.fits.ranking.precise_looks)
        steps = QUICK_STEPS if few else SHORT_STEPS
        short: list[tuple[list[ScoredFit], bool]] = []
        rest, more = [p for p in proposals if p.starts], 0.0
        while rest:
            n = sum(p.worth + more >= best - behind - now for p in rest[: self.budget.together])
            if settled and not n:
                n = max(0, LEAST_SHORT - len(short))
            if not n:
                break
            these, rest = rest[:n], rest[n:]
            wanted = [
                ((*base.effects, *p.effects), [Start((*kept, *s.values), near or s.near) for s in p.starts])
                for p in these
            ]
            fitted = self.workers.map(_shortly, (self.fits, quick, steps), wanted)
            done = [(f, p) for f, p in zip(fitted, these, strict=True) if f]
            short += [(f, p.is_first) for f, p in done]
            best = max([best, *(fits[0].score for fits, _ in short)])
            if not self.fits.ranking.precise_looks:  # fits so far say by how much a grid is too coarse
                more = max([more, *(f[0].score - now - p.worth for f, p in done)])
        if settled and self.fits.ranking.precise_looks:
            # A short fit says more than the forecast: what it did not reach is no promise any more.
            for fits, _ in short:
                key = fits[0].key
                self.promised[key] = fits[0].at_score(base.score + fits[0].score - now)
        short.sort(key=lambda each: -each[0][0].score)
        # A few steps say little of a strong effect, and the scan has needed none.
        promising = [
            fits[: 2 if k < self.fits.ranking.breadth // 2 else 1]
            for k, (fits, first) in enumerate(short)
            if (k < self.fits.ranking.breadth or first)
            and (k == 0 or not settled or fits[0].score > best - behind)
        ]
        return self.workers.map(_continued, (self.fits, free, base), promising)

    def simplified(self, h: ScoredFit) -> ScoredFit:
        """Return a hypothesis without the effects whose absence raises its score, one after the other.

        The last one, too, where it does nothing: the fit without effects has ended at a lesser maximum.
        """
        while h.effects:
            free = self.fits.free(h)
            gains = gains_without(free, h, [{e.name} for e in h.effects], self.fits.odds)
            least = -DOUBT_NATS if len(h.effects) > 1 else 0.0
            doubtful = [e for e, gain in zip(h.effects, gains, strict=True) if not gain < least]
            if not doubtful:
                return h
            fewer = [tuple(x for x in h.effects if x.name != e.name) for e in doubtful]
            there = [k for rest in fewer if (k := self.known.get(key_of(rest))) and self.is_full(k)]
            less = max(there, key=lambda k: k.score, default=None)
            if less is None or less.score <= h.score:
                # From here they may end elsewhere.
                now, options = self.on_few_lines(free, h, [(rest, values_of(rest)) for rest in fewer])
                best = max(options, key=lambda o: o.score, default=None)
                if best is None or best.score < now.score - TWIN_NATS:
                    return h
                less = self.full(best.effects, values_of(best.effects), best, anew=True)
            if less.score <= h.score:
                return h
            h = less
            self.say(f"   simpler: {h.score:.1f} {h.name}")
        return h

    def swapped(self, h: ScoredFit) -> ScoredFit:
        """Return the best of a hypothesis and variants in which another effect replaces one of its effects.

        Of any kind and anywhere: what is soft at one connection can stand for another one. What it contains
        begins where it is.
        What is alike at several places may differ there: each of them is tried by itself, too. All that are
        nearly as probable are fitted fully: they are its credible set. With another effect in the place of
        one, a third may not be needed any more.
        """
        result, free, anywhere = h.fitted, self.fits.free(h), not self.suffices(h)
        others: list[tuple[Sequence[Effect], Values]] = []
        for e in h.effects:
            rest = tuple(x for x in h.effects if x.name != e.name)
            compatible = self.compatible_with(rest)
            last = replace(result, effects=(*rest, e))
            elsewhere = [c for c in compatible if c.name != e.name]
            found = self.fits.ranking.rivals(free, last, elsewhere, self.budget.n_rivals)
            others += [((*rest, s.effect), (*values_of(rest), *s.starts[0].values)) for s in found]
            contained = [c for c in compatible if covers(e, c)]
            others += [((*rest, c), (*values_of(rest), e.contains[c.kind](e))) for c in contained]
            if parts := self.parts_of(e):
                others.append(((*rest, *parts), (*values_of(rest), *(values_of([e]) * len(parts)))))
        self.tell(f"fitting {len(others)} rivals of {labels(h.effects)}")
        now, rivals = self.on_few_lines(free, h, others)
        for other in rivals:
            self.say(f"   rival {other.score - now.score:+.1f} {other.name}")
        # A few steps from what is only alike are not the end; the same effects begin at several values.
        best_of = {r.key: r for r in sorted(rivals, key=lambda r: r.score)}
        near = [r for r in best_of.values() if r.score > now.score - BEAM_NATS]
        rivals = self.workers.map(_onward, (self.fits, free), near)
        # Few lines determine less than all: keep the best alone on the way, and its twins at the end.
        rivals.sort(key=lambda r: -r.score)
        fitted = self.all_full(
            [r for r in rivals[:1] if r.score > now.score]
            if anywhere
            else [r for r in rivals if r.score > now.score - TWIN_NATS]
        )
        best = max(k.score for k in (h, *fitted))
        for twin in fitted:
            if twin.score > best - TWIN_NATS:
                self.simplified(twin)
        return max((k for k in self.known.values() if k.effects), key=lambda k: k.score)

    def with_rivals_of_form(self, h: ScoredFit) -> ScoredFit:
        """Return the best of a hypothesis and those with an effect where its form is outside the usual range.

        The form and effects at its place are rivals. Each effect is looked at with that part of the form as
        drawn, and the best are fitted with all of it free.
        """
        free = self.fits.free(h)
        if not (self.budget.checked and self.fits.ranking.precise_looks):
            return h
        kept, wanted = values_of(h.effects), []
        for d in departures(free, h.fitted)[: self.budget.n_departures]:
            near = [c for c in self.compatible_with(h.effects) if near_to(c) & d.near]
            fixed = replace(free, nuisances=tuple(n for n in free.nuisances if n.refs[0][0] != d.effect.name))
            values = {ref: v for ref, v in h.fitted.values.items() if ref[0] != d.effect.name}
            now = replace(h.fitted, values=values)
            found = self.fits.ranking.screened(fixed, now, near, lambda e: False)[: self.budget.n_form_rivals]
            wanted += [((*h.effects, s.effect), [Start((*kept, *s.starts[0].values), now)]) for s in found]
        if not wanted:
            return h
        self.tell(f"fitting {len(wanted)} effects where the form is outside its usual range")
        steps = SHORT_STEPS if self.fits.is_far(h) else QUICK_STEPS
        short = self.workers.map(_shortly, (self.fits, free, steps), wanted)
        best = {each[0].key: each[0] for each in short if each}
        fitted = self.all_full(list(best.values()))
        for f in fitted:
            self.say(f"   for the form {f.score - h.score:+.1f} {f.name}")
        return max((f for f in fitted if self.beats(f, h)), key=lambda f: f.score, default=h)

    # proposals ----------------------------------------------------------------------------------------------

    def proposals(self, base: ScoredFit, quick: P, *, far: bool, settled: bool) -> list[NextHypotheses]:
        """Return effects that may be added to a hypothesis, ``settled`` where it explains the data."""
        current = base.fitted
        ranked: tuple[Scanned, ...] = ()
        # Near FRFs what small changes gain says enough of where to look.
        if far or not (base.effects or settled) or not self.fits.ranking.precise_looks:
            ranked = self.scan(current)
            self.say("scan: " + "; ".join(f"{s.name} {s.residual_ratio:.3f}" for s in ranked[:6]))
        if not base.effects:
            self._keep_scan(ranked)
        compatible = self.compatible_with(base.effects)
        singles = [s for s in ranked if len(s.places) == 1]
        now = self.fits.without_fixed(base) if far else current
        parents = list(dict.fromkeys(s.places[0].parent for s in singles))[: self.budget.n_places]
        names_at = [{e.name for p in self.places if p.parent == one for e in p.effects} for one in parents]
        there = set[str]().union(*names_at)

        def against(effect: Effect) -> float:
            return self.fits.odds.against(base.effects, (effect,))

        screened = list(
            self.fits.ranking.screened(
                quick, now, compatible, lambda e: e.name in there, against if settled else None, far=far
            )
        )
        if settled:
            screened.sort(key=lambda s: against(s.effect) - s.gain)
            if self.fits.ranking.precise_looks:
                self._promise(base, (s.estimate for s in screened if s.estimate))
        # Where something is missing parameters may be bent, nothing is linear, and all may win.
        likely = [s for s in screened if not settled or s.gain > against(s.effect)]
        chosen = likely[: self.budget.n_short * self.fits.ranking.breadth]
        for names in names_at:
            best = {s.effect.kind: s for s in reversed(likely) if s.effect.name in names}
            chosen += [s for s in best.values() if s not in chosen]
        looked = [s for s in screened if s.starts and s not in chosen]
        chosen += looked[: max(0, self.budget.n_final - len(chosen))]
        first = names_at[0] if names_at else set[str]()
        out = [
            NextHypotheses((s.effect,), s.starts, s.gain - against(s.effect), s.effect.name in first)
            for s in chosen
        ]
        return out + self.blocks(base, quick, now, ranked, key_of(compatible), far=far)

    def scan(self, current: FitResult) -> tuple[Scanned, ...]:
        """Return the places that explain what a fit leaves, the best first, once for a fit."""
        problem = self.fits.problem
        if self._last_scan is None or self._last_scan[:2] != (problem, current):
            self._last_scan = problem, current, self.fits.ranking.scan(problem, current, self.places)
        return self._last_scan[2]

    def _keep_scan(self, scanned: tuple[Scanned, ...]) -> None:
        """Keep the places that explain the misfit without effects, and say the first of them."""
        is_first, self.scanned = not self.scanned, scanned
        if scanned and is_first:
            best = " or ".join(s.name for s in scanned[:N_TOLD])
            self.tell(Lasting(f"so far: the error is explained best by changes at {best}"))

    def compatible_with(self, effects: Sequence[Effect]) -> list[Effect]:
        """Return the candidates that may be added to some effects.

        Two that release one constraint are springs side by side there, and one of them says all.
        """
        taken, names = {r for e in effects for r in e.released()}, key_of(effects)
        return [c for c in self.candidates if c.name not in names and not taken & set(c.released())]

    def parts_of(self, effect: Effect) -> list[Effect]:
        """Return the candidates that do at single places together what one does at several, if there are."""
        places, direction = near_to(effect), getattr(effect, "direction", None)
        alike = [c for c in self.candidates if c.kind == effect.kind and near_to(c) < places]
        parts = [c for c in alike if len(near_to(c)) == 1 and getattr(c, "direction", None) == direction]
        complete = len(places) == len(parts) and set[str]().union(*map(near_to, parts)) == places
        return parts if complete else []

    def blocks(
        self,
        base: ScoredFit,
        quick: P,
        now: FitResult,
        ranked: Sequence[Scanned],
        names: Set[str],
        *,
        far: bool,
    ) -> list[NextHypotheses]:
        """Return the springs of a connection in all directions, and of two connections.

        At the first places of the scan, and where their small changes together explain the residuals best. Of
        the effects with these ``names``.
        """
        springs = self.springs(names)
        order = dict.fromkeys(s.places[0].parent for s in ranked if len(s.places) == 1)
        near = [springs[parent] for parent in order if parent in springs][: self.budget.most_connections]
        both = (s.places for s in ranked if len(s.places) == 2)
        pairs = (tuple(e for p in places for e in springs.get(p.parent, ())) for places in both)
        two = [pair for pair in pairs if pair][: self.budget.n_pairs]
        ranked_blocks = self.fits.ranking.blocks(quick, now, far=far)
        alone = ranked_blocks(near or list(springs.values())[: self.budget.most_connections])
        first = [each[0].effects for each in alone[: self.budget.most_paired]]
        paired = ranked_blocks([*two, *(a + b for a, b in combinations(first, 2))])
        keys = {key_of(block) for block in (*near[: self.budget.n_places], *two)}
        chosen = [
            each
            for blocks, n in ((alone, self.budget.n_places), (paired, self.budget.n_pairs))
            for k, each in enumerate(blocks)
            if k < n or key_of(each[0].effects) in keys
        ]
        out: dict[frozenset[str], NextHypotheses] = {}
        for each in chosen:
            is_first = each[0].effects in near[:1]
            if far:
                more, wins = self.block_starts(each[0].effects, each[-1].start.near), True
            else:  # small changes say enough
                each, wins = self.paying(base, each, ranked_blocks)
                more = []
            block = each[0].effects
            if len(block) > 1 and wins:
                worth = max(b.gain for b in each) - self.fits.odds.against(base.effects, block)
                starts = [*(b.start for b in each), *more]
                out[key_of(block)] = NextHypotheses(block, starts, worth, is_first)
        return list(out.values())

    def paying(
        self, base: ScoredFit, each: tuple[Block, ...], ranked: RankedBlocks
    ) -> tuple[tuple[Block, ...], bool]:
        """Return those effects of a block that pay for their prior odds, and whether they may win together.

        By what small changes do, so near the data.
        """

        def worth(blocks: tuple[Block, ...]) -> float:
            return max(b.gain for b in blocks) - self.fits.odds.against(base.effects, blocks[0].effects)

        while len(each[0].effects) > 1:
            effects = each[0].effects
            best = max(ranked([tuple(x for x in effects if x is not e) for e in effects]), key=worth)
            if worth(best) <= worth(each):
                break
            each = best
        return each, worth(each) > 0

    def block_starts(self, block: Sequence[Effect], near: FitResult) -> list[Start]:
        """Return starts with little or much compliance of each direction, from the effects' grids.

        At one place those along and those about axes together; at several, each place's directions.
        """
        grids = self._grids(block)
        places = [place_of(e)[1] for e in block]
        names = [str(_turns(e)) for e in block] if len(set(places)) == 1 else places
        groups = [sorted(set(names)).index(name) for name in names]
        return [
            Start(tuple(_at_share(g, shares[k]) for g, k in zip(grids, groups, strict=True)), near)
            for shares in product(BLOCK_SHARES, repeat=max(groups) + 1)
        ]

    # fits ---------------------------------------------------------------------------------------------------

    def on_few_lines(
        self, quick: P, h: ScoredFit, others: Sequence[tuple[Sequence[Effect], Values]]
    ) -> tuple[ScoredFit, list[ScoredFit]]:
        """Return a hypothesis fitted on few lines and others fitted so from near it.

        Of the others those that have a structure.
        """
        wanted = [(h.effects, values_of(h.effects)), *others]
        first, *rest = self.workers.map(_quickly, (self.fits, quick, h), wanted)
        return first or h, [f for f in rest if f is not None]

    def full(
        self,
        effects: Sequence[Effect],
        values: Values,
        near: ScoredFit | None = None,
        *,
        anew: bool = False,
    ) -> ScoredFit:
        """Return a hypothesis fitted on all lines with the form free, once from the same values.

        From others, and ``anew``, it is fitted again, and the better one stays.
        """
        key = key_of(effects)
        if self._deserves_fit(key, near, anew=anew):
            self._keep(self.fits.fully(effects, values, near))
        return self.known[key]

    def all_full(self, many: Sequence[ScoredFit], *, anew: bool = False) -> list[ScoredFit]:
        """Return hypotheses that were fitted on few lines as :meth:`full` does.

        With ``anew`` also from nominal values of all but their effects.
        """
        wanted = [h for h in many if self._deserves_fit(h.key, h)]
        if wanted:
            names = dict.fromkeys(labels(h.effects) or "nothing missing" for h in wanted)
            self.tell(f"fitting on all lines: {'; '.join(names)}")
        for fitted in self.workers.map(_fully, (self.fits, anew), wanted):
            self._keep(fitted)
        return [self.known[h.key] for h in many]

    def _deserves_fit(self, key: frozenset[str], near: ScoredFit | None, *, anew: bool = False) -> bool:
        known = self.known.get(key)
        again = anew or (near is not None and known is not None and _moved(near, known))
        return (
            known is None or not self.is_full(known) or (again and self._n_fits[key] < self.budget.most_fits)
        )

    def is_full(self, h: ScoredFit) -> bool:
        """Whether a known hypothesis was fitted on all lines."""
        return not h.effects or self._n_fits[h.key] > 0

    def _keep(self, h: ScoredFit) -> None:
        known = self.known.get(h.key)
        if known is None or not self.is_full(known) or h.score > known.score:
            self.known[h.key] = h
        self._n_fits[h.key] += 1

    def with_enriched_basis(self, h: ScoredFit) -> ScoredFit:
        """Return a hypothesis on a basis with its responses at some lines, where the search's is not good.

        Effects that act on a whole member, and a form that has moved far, converge slowly on modes without
        them.
        """

        def tell(n_lines: int, error: float) -> None:
            decibels = error * DB_PER_NEPER
            self.say(f"   basis errs by {decibels:.3f} dB: with responses at {n_lines} lines")

        for _ in range(MOST_BASES):  # each fit moves the form, and its basis may err there
            problem = with_forces(self.fits.problem, h.effects, values_of(h.effects))
            good = problem.with_good_basis(h.fitted, tell)
            if good is problem:
                break
            self.fits = replace(self.fits, problem=replace(self.fits.problem, reduced=good.reduced))
            # What is bent, and has not found what was missing, would stay so.
            self.known[h.key] = h = (
                self.fits.again(h)
                if self.settled(h)
                else self.fits.fully(h.effects, values_of(h.effects), h, anew=True)
            )
        return self.with_better_damping(h)

    def with_better_damping(self, h: ScoredFit) -> ScoredFit:
        """Return a hypothesis with the more probable form of damping between resonances.

        If it is not that of the search, the search continues with it, and so do those that are nearly as
        probable.
        """
        other = self.fits.problem.with_other_damping()
        if other is None:
            return h
        fits = replace(self.fits, problem=other)
        better = fits.again(h)
        if better.score <= h.score:
            return h
        self.fits = fits
        others = (k for k in self.known.values() if k.key != h.key and self.is_full(k))
        near = [k for k in others if k.score > h.score - BEAM_NATS]
        for k in (better, *self.workers.map(_again, (fits,), near)):
            self.known[k.key] = k
        self.say(f"   the other form of damping gains {better.score - h.score:.1f}, for {1 + len(near)}")
        return better

    def polished(self, h: ScoredFit) -> ScoredFit:
        """Return a hypothesis at the best of the maxima around it, as uncertain as they are apart.

        They are looked for by quick fits; of these those that are nearly as probable are fitted fully.

        Resonances that pass each other leave several maxima of the posterior. The covariance is that of the
        mixture of their normal approximations: Σ w (C + d dᵀ), with weights w by their evidence and distances
        d from the best one.
        """
        if not h.effects or not self.budget.checked:
            return h
        starts = [(h.effects, start) for start in around(h.effects)]
        here, others = self.on_few_lines(self.fits.free(h), h, starts)
        near = [a for a in others if a.score > here.score - BEAM_NATS and _moved(a, here)]
        fits = [h, *self.workers.map(_fully, (self.fits, False), near)]
        fits.sort(key=lambda f: -f.score)
        best = fits[0].fitted
        # The scale of an unknown is that of its start: all are compared on the one of the best.
        problem, values = replace(self.fits.problem, scatter=None), values_of(best.effects)
        function = problem.function(best.effects, values, problem.lines_up_to(np.inf, FULL_LINES))
        scale = np.outer(function.units, function.units)
        apart: list[Maximum] = []
        for f in (f.fitted for f in fits):
            m = Maximum(function.point_of(f), f.covariance / scale, f.log_evidence)
            if f.log_evidence > best.log_evidence - BEAM_NATS and all(m.distance(a) > 1.0 for a in apart):
                apart.append(m)
        x = apart[0].x
        weight = np.exp([m.log_evidence - best.log_evidence for m in apart])
        each = [m.covariance + np.outer(m.x - x, m.x - x) for m in apart]
        covariance = np.tensordot(weight / weight.sum(), np.stack(each), axes=1)
        result = function.result(replace(best.solution, x=x, covariance=covariance))
        evidence = {
            k: getattr(best, k)
            for k in ("log_evidence", "levels", "misfit", "size", "channels", "channels_std")
        }
        self.known[h.key] = ScoredFit(replace(result, **evidence), h.prior)
        return self.known[h.key]

    def explains(self, best: ScoredFit) -> bool:
        """Whether a hypothesis is more probable than what the library does not have."""
        return self.unknown(best) < best.score

    def suffices(self, h: ScoredFit) -> bool:
        """Whether a hypothesis leaves no more than right models usually do: a search may end at it."""
        return self.short_of(h, usual=True) < UNKNOWN_ODDS

    def unknown(self, best: ScoredFit) -> float:
        """Return the score of an effect that the library does not have, and that explains the data."""
        return best.score + self.short_of(best) - UNKNOWN_ODDS

    def short_of(self, h: ScoredFit, *, usual: bool = False) -> float:
        """Return by how much the log likelihood would rise if a hypothesis explained the data [nats].

        It then leaves as much as a right model may, or with ``usual`` as right models usually do at most.
        """
        problem = self.fits.problem
        if self._allowed is None or self._allowed[0] is not problem:
            function = problem.residuals(n_lines=FULL_LINES)
            self._allowed = problem, (function.allowed_squares(), function.allowed_squares(usual=True))
        return float(h.fitted.gain_to(self._allowed[1][usual]))

    def is_hopeless(self, short: Sequence[float], n_effects: int) -> bool:
        """Whether rounds that each gain as much as the best one so far will not explain the data.

        Effects of one cause may work only together, so that one round does not tell.

        Parameters
        ----------
        short : sequence of float
            :meth:`short_of` of the leading hypothesis before the first round and after each [nats].
        n_effects : int
            Of the leading hypothesis.
        """
        if len(short) < 3:
            return False
        more = (self.budget.most_effects - n_effects) * max(-np.diff(short))
        return bool(short[-1] > UNKNOWN_ODDS + more)
