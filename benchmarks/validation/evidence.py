"""The posterior of a search beside the hidden truth: probability of the answer, and causes of errors.

Cases of this package and those of other codes are judged alike.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, islice, product
from typing import Any

import numpy as np

from benchmarks.validation.hiding import NEAR
from fem import Effect
from updating import UNEXPLAINED, Diagnosis, ModeDiagnosis
from updating.correlation import DB_PER_NEPER
from updating.diagnosis.evidence import UNKNOWN, ScoredFit, Search, Searched

CREDIBLE = 0.9
"""Probability that the hypotheses of a credible set have together [-]."""
SURE = 0.9
"""Probability from which an answer counts as sure [-]."""
MOST_CREDIBLE = 3
"""Largest credible set that helps a reader."""
SEARCH_LOSS = 0.5
"""A truth that scores more than this above the answer has been lost by the search [nats]."""
COVERED, N_WITHIN = 2.0, 17
"""A position is covered within so many standard deviations, looked at in so many places."""
MOST_STARTS = 12
"""Largest number of combinations of candidates and values from which one way to state a truth is fitted."""
RIGHT, LOST_BY_SEARCH, LOST_BY_DATA = "-", "search loss", "information loss"
WRONG_FAULT, NOT_IN_LIBRARY = "wrong fault", "not in library"
"""Why an answer is not right. Faults are set right before the search: its scores say nothing of them."""

Start = tuple[Effect, dict[str, float]]


@dataclass(frozen=True, slots=True)
class Stated:
    """A hidden effect in the terms of the library."""

    kinds: tuple[str, ...]  # kinds of candidates that are the right answer
    is_at: Callable[[Effect], bool]  # whether a candidate with the true values is at the right place
    # from a candidate to the true values of its parameters, of those that are known
    values: Callable[[Effect], dict[str, float]]

    def starts(self, search: Search) -> list[Start]:
        """Return the candidates that are this effect, each with its true values.

        A parameter that the truth does not state has the values of the candidate's own grid.
        """
        out: list[Start] = []
        for candidate in search.candidates:
            if candidate.kind not in self.kinds:
                continue
            bounds = {p.name: (p.lower, p.upper) for p in candidate.parameters()}
            true = {
                name: float(np.clip(value, *bounds[name]))
                for name, value in self.values(candidate).items()
                if name in bounds
            }
            if self.is_at(candidate.with_values(**true)):
                grid = candidate.starts(search.fits.problem.surroundings)
                points = {tuple(sorted({**g, **true}.items())) for g in grid} or {tuple(true.items())}
                out += [(candidate, dict(values)) for values in sorted(points)]
        return out


def at_truth(search: Search, ways: Sequence[Sequence[Stated]]) -> ScoredFit | None:
    """Return the best fit that begins at the truth; None if the library does not have it.

    The library may have several ways to state it, each with one or several effects.
    """
    if not any(ways):
        return search.known.get(frozenset()) or search.full((), ())
    options = (product(*(s.starts(search) for s in way)) for way in ways)
    fits = []
    for starts in chain.from_iterable(islice(each, MOST_STARTS) for each in options):
        effects = [e for e, _ in starts]
        if len({e.name for e in effects}) < len(effects):
            continue  # one candidate cannot be two of the hidden effects
        try:
            values = tuple(values for _, values in starts)
            # all else begins at its nominal value, and where the search has it: either may end elsewhere
            fits.append(search.fits.fully(effects, values, search.best, anew=True))
        except np.linalg.LinAlgError:
            continue
    return max(fits, key=lambda h: h.score, default=None)


def loss_of(right: bool, faults_right: bool, answer: float, truth: float | None) -> str:
    """Say why an answer is not right: by the scores of the answer and of the truth [nats]."""
    if right:
        return RIGHT
    if not faults_right:
        return WRONG_FAULT
    if truth is None:
        return NOT_IN_LIBRARY
    return LOST_BY_SEARCH if truth > answer + SEARCH_LOSS else LOST_BY_DATA


def credible_set(done: Searched) -> list[tuple[ScoredFit | None, float]]:
    """Return the fewest hypotheses with ``CREDIBLE`` together; None is any effect outside the library."""
    every: list[tuple[ScoredFit | None, float]] = [(h, done.probability(h)) for h in done.hypotheses]
    every.append((None, done.unknown_probability))
    every.sort(key=lambda pair: -pair[1])
    before = np.cumsum([0.0, *(p for _, p in every[:-1])])
    return [pair for pair, total in zip(every, before, strict=True) if total < CREDIBLE]


def located(done: Searched, h: ScoredFit) -> float:
    """Return the probability that effects are within ``NEAR`` of their members' lengths from their positions.

    By the normal posterior of each.
    """
    out, std = 1.0, h.fitted.std
    for e in h.effects:
        for p in e.parameters():
            if p.position and isinstance(member := getattr(e, "member", None), str):
                tolerance = NEAR * done.model.mesh.member_length(member)
                out *= math.erf(tolerance / (math.sqrt(2) * max(std[e.name, p.name], 1e-300)))
    return out


def assess(
    done: Searched,
    diagnosis: Diagnosis | ModeDiagnosis,
    right: bool,
    faults_right: bool,
    ways: Sequence[Sequence[Stated]],
    is_right: Callable[[Sequence[Effect]], bool],
) -> dict[str, Any]:
    """Return how probable the answer was and whether the truth could have been found, as plain values.

    ``right`` says whether verdict and findings of the diagnosis are right, ``faults_right`` whether its
    faults are; ``ways`` are the hidden effects, but no faults, in each way in which the library states them.

    ``probability`` is that of the answer, positions to within the tolerance by which it is judged;
    ``place_probability`` is that of its places. ``place_right`` says whether the truth is at these places,
    None where the library does not have it. ``credible`` is the credible set, and ``in_three`` whether it has
    at most three members of which one is right. ``covered`` says whether one is right with its positions
    within ``COVERED`` of their standard deviations. ``truth`` is how much better the truth scores than the
    answer [nats], and ``loss`` its meaning.
    """
    best = done.best
    unexplained = diagnosis.verdict == UNEXPLAINED
    truth = at_truth(done.search, ways)
    members = credible_set(done)

    def fits_truth(h: ScoredFit | None) -> bool:
        return truth is None if h is None else faults_right and is_right(h.effects)

    probability = done.unknown_probability if unexplained else done.probability(best) * located(done, best)
    right_ones = [fits_truth(h) for h, _ in members]
    return {
        "verdict": diagnosis.verdict,
        "answer": best.name,
        "right": right,
        "in_three": right or (any(right_ones) and len(members) <= MOST_CREDIBLE),
        "sure_and_wrong": not (right or unexplained) and probability >= SURE,
        "probability": probability,
        "place_probability": done.probability_there(best),
        "place_right": None if truth is None else truth.places == best.places,
        "unknown": done.unknown_probability,
        "credible": [
            {"name": UNKNOWN if h is None else h.name, "probability": p, "right": r}
            for (h, p), r in zip(members, right_ones, strict=True)
        ],
        "covered": any(right_ones)
        or any(h is not None and faults_right and any(map(is_right, within(h))) for h, _ in members),
        "truth": None if truth is None else truth.score - best.score,
        "loss": loss_of(right, faults_right, best.score, None if truth is None else truth.score),
        "residual_db": decibels(best.fitted.level),
        "floor_db": decibels(diagnosis.noise_limit),
    }


def within(h: ScoredFit) -> Iterator[tuple[Effect, ...]]:
    """Yield the effects of a hypothesis, their positions up to ``COVERED`` deviations from the fits'."""
    std = h.fitted.std
    shares = np.linspace(-COVERED, COVERED, N_WITHIN)
    options = []
    for e in h.effects:
        p = next((p for p in e.parameters() if p.position), None)
        options.append(
            [e]
            if p is None
            else [
                e.with_values(**{p.name: float(np.clip(p.value + s * std[e.name, p.name], p.lower, p.upper))})
                for s in shares
            ]
        )
    return product(*options)


def decibels(level: float) -> float:
    """Return a level of amplitude and phase together in each of them [dB]."""
    return float(level * DB_PER_NEPER / np.sqrt(2))
