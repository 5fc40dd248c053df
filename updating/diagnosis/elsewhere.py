"""Further positions along members at which an effect explains measured modes as well."""

import numpy as np

from fem.array_types import Floats
from fem.model import Effect
from updating.diagnosis.evidence.hypothesis import ScoredFit, values_of
from updating.diagnosis.evidence.search import Search
from updating.forecast.grid import Grid
from updating.forecast.look import Look
from updating.inference.belief import TWIN_NATS
from updating.inference.mode_fit import ModeProblem

MOST_POSITIONS = 4
"""Largest number of further positions from which an effect is fitted."""


def weigh_elsewhere(search: Search[ModeProblem]) -> None:
    """Add further maxima along members to the posterior: the same effects at other positions.

    A mass or a crack at either of two mirrored places gives a symmetric structure the same frequencies. Fits
    that began near one of them do not see the other one. Hypotheses nearly as probable as the best one are
    looked at.
    """
    least = search.best.score - TWIN_NATS
    for h in [k for k in search.known.values() if k.score > least]:
        maxima = [h]
        for found in _elsewhere(search, h, least):
            if all(_apart(found, m) for m in maxima):
                maxima.append(found)
        first, *others = sorted(maxima, key=lambda m: -m.score)
        search.known[h.key] = first
        search.elsewhere += others


def _elsewhere(search: Search[ModeProblem], h: ScoredFit, least: float) -> list[ScoredFit]:
    """Return fits that begin at other positions, of those that are as probable as asked for."""
    out = []
    free = search.fits.free(h)
    for effect in h.effects:
        for values in _other_positions(search, h, effect):
            start = tuple(
                values if e.name == effect.name else v
                for e, v in zip(h.effects, values_of(h.effects), strict=True)
            )
            try:
                quick = search.fits.quickly(free, h, h.effects, start)
                if quick.score < least - TWIN_NATS:
                    continue
                found = search.fits.fully(quick.effects, values_of(quick.effects), quick)
            except np.linalg.LinAlgError:  # no structure: more mass taken away than there is
                continue
            if found.score > least:
                out.append(found)
    return out


def _other_positions(search: Search[ModeProblem], h: ScoredFit, effect: Effect) -> list[dict[str, float]]:
    """Return the points of an effect's grid that leave the least misfit, each at another place of its member.

    Beside all else as it was fitted with the effect; not at the places around the fitted one.
    """
    position = next((p for p in effect.parameters() if p.position), None)
    problem = search.fits.problem
    if position is None:
        return []
    grid = Grid.of(problem, effect)
    look = Look.of(problem, h.fitted.without(effect.name), None, 0, 0).with_all_readings()
    misfit = look.levels(grid)[0]
    at = np.array([point[position.name] for point in grid.points])
    places = np.unique(at)
    best = [min(np.flatnonzero(at == place), key=lambda k: misfit[k]) for place in places]
    others = [
        k for k, n in enumerate(best) if np.isfinite(misfit[n]) and not _between(places, k, position.value)
    ]
    others.sort(key=lambda k: misfit[best[k]])
    return [grid.points[best[k]] for k in others[:MOST_POSITIONS]]


def _between(places: Floats, k: int, position: float) -> bool:
    """Whether a position lies between the neighbours of a place."""
    return bool(places[max(k - 1, 0)] <= position <= places[min(k + 1, len(places) - 1)])


def _apart(one: ScoredFit, two: ScoredFit) -> bool:
    """Whether the positions of an effect in two fits differ by more than both deviations."""
    a, b = one.fitted, two.fitted
    return any(
        abs(a.values[e.name, p.name] - b.values[e.name, p.name])
        > max(a.std[e.name, p.name], b.std[e.name, p.name])
        for e in one.effects
        for p in e.parameters()
        if p.position
    )
