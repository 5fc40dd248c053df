"""The share of the posterior of candidates that no fit has tried: their evidence to the first order."""

from dataclasses import replace

import numpy as np

from fem.model import Effect
from updating.diagnosis.evidence.hypothesis import Hypothesis, key_of, values_of
from updating.diagnosis.evidence.search import Search
from updating.forecast.forecast import Forecast
from updating.forecast.grid import Grid
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
    """Return hypotheses of one effect that were not fitted, to the first order, the most probable first.

    Of those that the data see.
    """
    problem, nothing = search.fits.problem, search.known[frozenset()]
    rest = [e for e in search.candidates if key_of((e,)) not in search.known]
    grids = [g for e in rest if (g := Grid.of(problem, e)).points]
    forecasts, out = Forecast.several(problem, nothing.fitted, grids), []
    for k, grid in enumerate(grids):
        forecast = max(
            forecasts, key=lambda f: f.log_evidence[k] if np.isfinite(f.best_gains[k]) else -np.inf
        )
        if np.isfinite(forecast.best_gains[k]):
            out.append(_estimated(search, nothing, grid.effect, forecast, k))
    return sorted(out, key=lambda h: -h.score)


def _estimated(search: Search, nothing: Hypothesis, effect: Effect, forecast: Forecast, k: int) -> Hypothesis:
    """Return a hypothesis with one effect, the k-th of a forecast."""
    before, (values, std) = nothing.fitted, forecast.estimate(forecast.best_place(k))
    fitted = replace(
        before,
        effects=(effect.with_values(**values),),
        values={**before.values, **{(effect.name, name): value for name, value in values.items()}},
        std={**before.std, **{(effect.name, name): value for name, value in std.items()}},
        log_evidence=before.log_evidence + float(forecast.log_evidence[k]),
    )
    return Hypothesis(fitted, search.fits.odds.prior((effect,)))
