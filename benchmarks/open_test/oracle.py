"""What true effects of a case explain beyond their odds, by fits of Dovetail that start at them."""

from dataclasses import replace
from itertools import product

import numpy as np

from benchmarks.open_test.kinds import is_same
from benchmarks.open_test.words import effects_of
from benchmarks.validation.evidence import MOST_STARTS
from updating import diagnose
from updating.diagnosis.evidence.budget import QUICK
from updating.diagnosis.evidence.hypothesis import values_of

NULL_FIT = replace(QUICK, n_rounds=0)
"""Fits the uncertain parameters and corrects sensors, and searches for nothing."""


def nats_of(case, truth):
    """Return by how much a fit with the true effects scores above one that lacks one of them [nats].

    The least of all: what the least visible effect gains beyond its odds, which the scores have.

    Parameters
    ----------
    case : Case
        Of `benchmarks.open_test.rivals.common`.
    truth : dict
        Of this case, in the words of the test.

    Returns
    -------
    float or None
        [nats]; None where nothing is missing, or nothing that the library has.
    """
    true = [t for t in truth["effects"] if t["kind"] != "sensor"]
    if not true or truth.get("outside"):
        return None
    study = case.study
    search = diagnose(study.model, study.measurements, study.nuisances, budget=NULL_FIT).searched.search
    fits = [h for starts in _starts(true, search, case.structure) if (h := _fitted(search, starts))]
    if not fits:
        return None
    best = max(fits, key=lambda h: h.score)
    now = list(zip(best.effects, values_of(best.effects), strict=True))
    fewer = [_fitted(search, now[:k] + now[k + 1 :]) for k in range(len(now))]
    return float(best.score - max(h.score for h in fewer if h))


def _fitted(search, starts):
    """Return the fit that begins at values of effects; None of effects that no structure has."""
    if not starts:
        return search.known[frozenset()]
    try:
        return search.fits.fully([e for e, _ in starts], tuple(values for _, values in starts))
    except np.linalg.LinAlgError:
        return None


def _starts(true, search, structure):
    """Return sets of candidates that state all true effects, with the true values, the best stated first."""
    stated = []
    for candidate in search.candidates:
        for values, n_free in _values(candidate, true, search, structure):
            covered = _covered(true, _words(candidate, values, structure), structure)
            if covered:
                stated.append((covered, n_free, (candidate, values)))
    ways = _ways(frozenset(range(len(true))), stated)
    return [starts for _, starts in sorted(ways, key=lambda way: way[0])[:MOST_STARTS]]


def _ways(left, stated):
    """Yield sets of candidates that state each effect once, with what the truth does not say of them."""
    if not left:
        yield (0, 0), ()
        return
    for covered, n_free, start in stated:
        if min(left) in covered <= left:
            for (n, more_free), more in _ways(left - covered, stated):
                yield (n + 1, n_free + more_free), (start, *more)


def _words(candidate, values, structure):
    units = {p.name: p.unit for p in candidate.parameters()}
    return effects_of(candidate.name, {k: (v, 0.0, units[k]) for k, v in values.items()}, structure) or []


def _covered(true, said, structure):
    """Return which true effects are said; none where anything else is said."""
    out = set()
    for effect in said:
        same = (k for k, t in enumerate(true) if k not in out and is_same(effect, t, structure))
        match = next(same, None)
        if match is None:
            return frozenset()
        out.add(match)
    return frozenset(out)


def _values(candidate, true, search, structure):
    """Return starts of a candidate, and how many of its values the truth does not state.

    These are from the candidate's own grid, the others as the truth states them in the same unit. Starts
    with more of the former than the others are left out.
    """
    parameters, out = candidate.parameters(), []
    for start in candidate.starts(search.fits.problem.surroundings) or ({},):
        said = [w["place"] for w in _words(candidate, start, structure)]
        at_place = [[t for t in true if t["place"] == place] or [{}] for place in said]
        for chosen in product(*at_place):
            known = {
                p.name: float(np.clip(value, p.lower, p.upper))
                for t in chosen
                for p in parameters
                if (value := _true_value(p, t)) is not None
            }
            values = {**start, **known}, len(parameters) - len(known)
            if values not in out:
                out.append(values)
    fewest = min(n_free for _, n_free in out)
    return [each for each in out if each[1] == fewest]


def _true_value(parameter, true):
    if parameter.position:
        return true.get("position")
    value = true.get("value") if parameter.unit == true.get("unit") else None
    return value if np.isscalar(value) else None  # of several directions a truth states one value each
