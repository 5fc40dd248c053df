"""The posterior over what a model lacks, from measured FRFs."""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Generic, Unpack

import numpy as np

from fem.linalg.solvers import one_thread
from fem.model import Effect, Model
from updating.diagnosis.begin import calibrated
from updating.diagnosis.candidates import propose, released_together, situated
from updating.diagnosis.evidence.budget import NORMAL, Budget
from updating.diagnosis.evidence.fits import P
from updating.diagnosis.evidence.hypothesis import ScoredFit
from updating.diagnosis.evidence.ranking import Ranking
from updating.diagnosis.evidence.readings import as_read, doubtful, log_prior
from updating.diagnosis.evidence.search import Search
from updating.inference.belief import TWIN_NATS
from updating.inference.fit import FitProblem
from updating.inference.fit_result import FitResult
from updating.inference.fitting import FULL_LINES, fit
from updating.inference.formed import Formed, formed_problem
from updating.inference.heartbeat import EndEarlyError, Lasting, Progress, ending_early
from updating.inference.mode_targets import ModeTargets
from updating.inference.parameters import Nuisance
from updating.inference.preparation import ProblemOptions
from updating.inference.workers import ALONE, Workers
from updating.measurement.measurement import Measurement
from updating.quality.faults import Fault

FIRST_ANSWER = (
    "a first answer: effects at one place at most; no faults of the measurement were looked for, and no "
    "rivals fitted"
)
AS_LONG = 6.0
"""Usual duration of a search, in durations of its beginning [-]."""
UNKNOWN = "unknown"
"""Name of what the library does not have, in the posterior."""
AS_READ = "not "
"""Stands before the name of a fault that a hypothesis does not correct and the reported one does."""


@dataclass(frozen=True, slots=True, eq=False)
class Searched(Generic[P]):
    """A search and its best hypothesis so far.

    Attributes
    ----------
    search : Search
    best : ScoredFit
    faults : tuple of Fault
        Set right before the search.
    mesh_db : float
        Error of the mesh [dB].
    model : Model
        With the form's effects.
    notes : tuple of str
        What a reader should know of the mesh.
    otherwise : tuple of Searched
        Searches on the same data that take something else for granted: other faults of the measurement, or
        another model of an earlier state.
    finished : bool
        False if it was ended early.
    """

    search: Search[P]
    best: ScoredFit
    faults: tuple[Fault, ...]
    mesh_db: float
    model: Model
    notes: tuple[str, ...] = ()
    otherwise: "tuple[Searched[P], ...]" = ()
    finished: bool = True

    @property
    def problem(self: "Searched[FitProblem]") -> FitProblem:
        """The problem of the first level of force."""
        p = self.search.fits.problem
        return p.responses.at_first_level(p)

    @property
    def n_levels(self: "Searched[FitProblem]") -> int:
        """Number of levels of force whose data the hypotheses were fitted to."""
        return self.search.fits.problem.responses.n_levels

    @property
    def explains(self) -> bool:
        """Whether the best hypothesis is more probable than what the library does not have."""
        return self.search.explains(self.best)

    @property
    def unknown(self) -> float:
        """Score of what the library does not have."""
        return self.search.unknown(self.best)

    @property
    def lead(self) -> ScoredFit:
        """The best hypothesis, or the best with effects where it has none and cannot explain the data."""
        if self.best.effects or self.explains or not self.finished:
            return self.best
        some = [h for h in self.search.known.values() if h.effects]
        return max(some, key=lambda h: h.score, default=self.best)

    def answered(self) -> "Searched[P]":
        """Return the search with its best hypothesis with effects where that is the better answer.

        The search prefers the simpler of two, the answer the more probable: "nothing missing" is no simpler
        twin. Nor is it the answer where each of many effects is little less probable than it, and all
        together are far more.
        """
        with_effects = [h for h in self.search.known.values() if h.effects]
        if not self.finished or self.best.effects or not with_effects or not self.explains:
            return self
        first = max(with_effects, key=lambda h: h.score)
        some = np.logaddexp.reduce([h.score for h in self.weighed if h.effects])
        if first.score <= self.best.score and some <= self.best.score + TWIN_NATS:
            return self
        return replace(self, best=first)

    @property
    def evidence(self) -> float:
        """Logarithm of the sum over all hypotheses."""
        scores = [k.score for k in self.weighed]
        return float(np.logaddexp.reduce(np.array([*scores, self.unknown])))

    @property
    def hypotheses(self) -> list[ScoredFit]:
        """All that were fitted fully, at further positions and by other readings of the data, too."""
        fitted = [*self.search.known.values(), *self.search.elsewhere]
        return fitted + [h for other in self.otherwise for h in other.hypotheses]

    @property
    def weighed(self) -> list[ScoredFit]:
        """All that share the probability: those that were not fitted, too."""
        mine = [*self.search.known.values(), *self.search.elsewhere, *self.search.promises()]
        return mine + [h for other in self.otherwise for h in other.weighed]

    @property
    def proposed_faults(self) -> tuple[Fault, ...]:
        """Faults set right in either reading."""
        return (*self.faults, *(f for other in self.otherwise for f in other.faults))

    def names(self, h: ScoredFit) -> tuple[str, ...]:
        """Return the names of a hypothesis's effects, and of its faults where others are set right here.

        Of a fault that is set right here alone, the name follows ``AS_READ``.
        """
        other = next((o for o in self.otherwise if h in o.weighed), self)
        here, there = ({f.name for f in way.faults} for way in (self, other))
        return tuple(sorted([*h.key, *(there - here), *(f"{AS_READ}{name}" for name in here - there)]))

    def probability(self, h: ScoredFit) -> float:
        """Return the posterior probability of a hypothesis."""
        return float(np.exp(h.score - self.evidence))

    @property
    def unknown_probability(self) -> float:
        """Posterior probability of what the library does not have."""
        return float(np.exp(self.unknown - self.evidence))

    def probability_there(self, h: ScoredFit) -> float:
        """Return the probability that something is missing at all places of a hypothesis, alone or not.

        Of a hypothesis without effects, that nothing is missing.
        """
        there = (k for k in self.weighed if (h.places <= k.places if h.places else not k.places))
        return sum(map(self.probability, there))


@one_thread()
def prepare_search(
    model: Model,
    measurement: Measurement,
    nuisances: Sequence[Nuisance] = (),
    *,
    kinds: Sequence[str] | None = None,
    exclude: Sequence[str] = (),
    **settings: Unpack[ProblemOptions],
) -> tuple[FitProblem, Formed, tuple[Effect, ...]]:
    """Return the problem of a search, its model with the form's effects, and its candidates.

    Parameters as of :func:`updating.diagnosis.diagnose.diagnose`.
    """
    problem, formed = formed_problem(situated(model, kinds), measurement, nuisances, **settings)
    return problem, formed, candidates_for_test(formed.model, measurement, kinds, exclude)


@one_thread()
def search_of_problem(
    as_measured: FitProblem,
    formed: Formed,
    candidates: tuple[Effect, ...],
    *,
    modes: ModeTargets | None = None,
    ranking: Ranking | None = None,
    progress: Progress,
    crew: Workers = ALONE,
    budget: Budget = NORMAL,
) -> Searched[FitProblem]:
    """Return a search of a problem that knows the model without effects, with faults set right.

    Where some faults are doubtful, ``otherwise`` has a second search, of the data with those uncorrected.
    """
    start_time = time.perf_counter()
    lines: dict[str, Any] = {"n_lines": budget.n_lines, "counted_as": FULL_LINES}
    read = as_measured.data
    right, result, faults = calibrated(as_measured, n_lines=budget.n_lines, checked=budget.checked)
    right = replace(right, modes=modes)
    notes = () if budget.checked else (FIRST_ANSWER,)
    if formed.n_cut > 1:
        notes += (
            f"each element was cut into {formed.n_cut}: the mesh's error was {formed.uncut_db:.2g} dB, not "
            f"small beside the noise of {read.noise_db:.2g} dB",
        )
    if modes is not None:
        notes += (f"{len(modes.fitted)} measured modes ({modes.name}) were fitted together with the FRFs",)

    def reading(problem: FitProblem, near: FitResult, faults: tuple[Fault, ...]) -> Searched[FitProblem]:
        search = Search(
            problem,
            formed.form,
            candidates,
            search_progress(progress, start_time),
            workers=crew,
            ranking=ranking or Ranking(),
            beforehand=log_prior(doubtful(faults), read),
            budget=budget,
        )
        first = fit(problem, stages=problem.stages[-1:], x_from=near, **lines)
        nothing = search.fits.scattered(problem, ScoredFit(first, search.fits.odds.prior(())))
        search.known[frozenset()] = nothing
        return Searched(search, nothing, faults, formed.mesh_db, formed.formed, notes)

    found = reading(right, result, faults)
    if not doubtful(faults):
        return found
    sure = tuple(f for f in faults if f not in doubtful(faults))
    other = replace(right, data=as_read(read, right.data, sure))
    return replace(found, otherwise=(reading(other, result, sure),))


def searched(initial: Searched[P], progress: Progress) -> Searched[P]:
    """Return a search that has ended: of two readings of the data, the one with the best hypothesis.

    Each of the two adds effects once; then the one that explains the data better continues. It ends where
    nothing that it may still find is as probable as what the other has.

    If the progress ends it early, it has what is known so far.
    """
    ways = [initial, *initial.otherwise]
    try:
        with ending_early():
            _go_on(ways, progress)
            progress("refining", 0.9)
            best, *others = _most_probable_first(ways)
            search = best.search
            best = replace(best, best=search.polished(search.with_rivals_of_form(search.best)))
            if best.explains:
                search.promise_rest(best.best)
                best = search_promised(best)
    except EndEarlyError:
        for way in ways:
            way.search.end_early()
        best, *others = _most_probable_first(ways)
        best = replace(best, best=best.search.best, finished=False)
    best = replace(best, otherwise=tuple(replace(other, otherwise=()) for other in others))
    return best.answered()


def _most_probable_first(ways: Sequence[Searched[P]]) -> list[Searched[P]]:
    """Return readings of the data in the order of their best hypotheses.

    If the library explains none of them, they come in the order of what each leaves: a misfit that counts as
    noise says little of a fault, which was found by what the channels say of one another.
    """
    out = sorted(ways, key=lambda way: -way.search.best.score)
    if out[0].search.explains(out[0].search.best):
        return out
    return sorted(ways, key=lambda way: way.search.short_of(way.search.best))


def search_promised(done: Searched[P]) -> Searched[P]:
    """Return a search that has fitted what promised to be as probable as its best hypothesis.

    A promise of small changes is kept by a fit, or it is none.
    """
    search = done.search
    search.fit_promised()
    return done if search.best.score <= done.best.score else replace(done, best=search.polished(search.best))


def _go_on(ways: Sequence[Searched[P]], progress: Progress) -> None:
    """Let searches add effects, one at a time, and say what is known so far."""
    said = ""

    def tell() -> None:
        nonlocal said
        text = max((way.search for way in ways), key=lambda search: search.best.score).so_far()
        if text != said:
            said = text
            progress(Lasting(text), 0.1)

    def is_beaten(search: Search[P]) -> bool:
        """Whether nothing that a search may still find is as probable as what another one has."""
        elsewhere = [way.search.best.score for way in ways if way.search is not search]
        return any(score > search.unknown(search.best) for score in elsewhere)

    tell()
    going = []
    for way in ways:
        # Where one reading of the data explains them, the next ones begin only if they may do better.
        if any(search.fits.is_near(search.best) for search, _ in going) and is_beaten(way.search):
            continue
        going.append((way.search, way.search.rounds()))
        next(going[-1][1], None)
        tell()
    while going:
        search, rounds = max(going, key=lambda each: each[0].best.score)
        if is_beaten(search) or next(rounds, None) is None:
            going = [each for each in going if each[0] is not search]
        tell()


def candidates_for_test(
    model: Model, measurement: Measurement, kinds: Sequence[str] | None, exclude: Sequence[str]
) -> tuple[Effect, ...]:
    """Return all candidates except those that the form represents."""
    found = propose(model, kinds, exclude, measurement)
    return released_together([e for e in found if not e.is_form])


def search_progress(say: Progress, start_time: float) -> Callable[[str], None]:
    """Return a function that reports a search's texts and its progress, judged by how long its start took.

    Parameters
    ----------
    say : callable
    start_time : float
        ``time.perf_counter()`` when that began [s].
    """
    first = 0.0

    def tell(text: str) -> None:
        nonlocal first
        now = time.perf_counter()
        first = first or now
        expected = AS_LONG * max(first - start_time, 0.1)
        say(text, 0.9 - 0.8 * math.exp((first - now) / expected))

    return tell
