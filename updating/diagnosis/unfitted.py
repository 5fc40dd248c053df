"""The share of the posterior of candidates that no fit has tried: their evidence to the first order."""

from dataclasses import replace

import numpy as np

from fem.model import Effect
from updating.diagnosis.evidence.hypothesis import Hypothesis, key_of, values_of
from updating.diagnosis.evidence.mode_ranking import ModeRanking, SmallModeChange
from updating.diagnosis.evidence.search import Search
from updating.inference.belief import TWIN_NATS
from updating.inference.mode_fit import ModeProblem

MOST_FITTED = 24
"""Largest number of candidates that are fitted because they look as probable as the best hypothesis."""


def weigh_unfitted(search: Search[ModeProblem]) -> None:
    """Add every single effect that the search has not fitted, and that the data see, to the posterior.

    A search fits the candidates that may win. All others together may be as probable as the winner: where the
    data say little, "nothing" competes with many weak effects. Their evidence comes from their slopes beside
    the model without effects. Those that look like a twin of the best hypothesis are fitted after all.
    """
    looked = looked_at(search)
    for h in looked[:MOST_FITTED]:
        if h.score < search.best.score - TWIN_NATS:
            break
        try:
            search.full(h.effects, values_of(h.effects), h)
        except np.linalg.LinAlgError:  # no structure: more mass taken away than there is
            continue
    search.known.update({h.key: h for h in looked if h.key not in search.known})


def looked_at(search: Search[ModeProblem]) -> list[Hypothesis]:
    """Return hypotheses of one effect that were not fitted, to the first order, the most probable first."""
    problem, nothing = search.fits.problem, search.known[frozenset()]
    rest = [e for e in search.candidates if key_of((e,)) not in search.known]
    looked = ModeRanking().looked(problem, nothing.fitted, rest)
    return sorted((_estimated(search, nothing, e, x) for e, x in looked), key=lambda h: -h.score)


def _estimated(search: Search, nothing: Hypothesis, effect: Effect, look: SmallModeChange) -> Hypothesis:
    """Return a hypothesis with one effect, as its slopes have it."""
    before = nothing.fitted
    values = {(effect.name, name): value for name, value in look.values.items()}
    std = {(effect.name, name): value for name, value in look.std.items()}
    fitted = replace(
        before,
        effects=(effect,),
        values={**before.values, **values},
        std={**before.std, **std},
        log_evidence=before.log_evidence + look.evidence,
    )
    return Hypothesis(fitted, search.fits.odds.prior((effect,)))
