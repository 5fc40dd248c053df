"""Faults of single channels as rivals of effects: one may stand in for the other."""

from dataclasses import replace

from updating.diagnosis.evidence.diagnosis import Searched
from updating.diagnosis.evidence.hypothesis import ScoredFit, key_of, values_of
from updating.diagnosis.evidence.readings import log_prior
from updating.diagnosis.evidence.search import BEAM_NATS, Search
from updating.inference.fit import FitProblem
from updating.quality.channel_faults import CORRECTED_KINDS, channel_faults
from updating.quality.corrections import Fault, corrected


def without_effects_of_channels(done: Searched[FitProblem]) -> Searched[FitProblem]:
    """Return a search, or the same with a fault of a channel in the place of an effect that it found.

    A tolerance keeps the error of a channel small, and an effect may be taken for the rest of it. So data
    are corrected for the errors beyond tolerance that a model without the effect has, and both are compared:
    as of the search's own readings, by their evidence and the odds against each effect and each fault.
    """
    best = done.best
    if not done.explains:
        return done
    readings = [found for e in best.effects if (found := _without(done, e.name)) is not None]
    better = max(readings, key=lambda r: r.best.score, default=None)
    if better is None or better.best.score <= best.score:
        return done
    return better


def _without(done: Searched[FitProblem], name: str) -> Searched[FitProblem] | None:
    """Return a search of data corrected for channels that are far off without an effect; None without any."""
    search, best = done.search, done.best
    rest = tuple(e for e in best.effects if e.name != name)
    h = search.known.get(key_of(rest)) or search.full(rest, values_of(rest), best)
    known = {f.name for f in done.faults}
    faults = tuple(
        replace(f, tolerance=0.0)
        for f in channel_faults(done.problem, h.fitted)
        if f.kind in CORRECTED_KINDS and f.name not in known
    )
    return _corrected(done, h, faults) if faults else None


def _corrected(
    done: Searched[FitProblem], h: ScoredFit, faults: tuple[Fault, ...]
) -> Searched[FitProblem] | None:
    """Return a search of data corrected for faults that has fitted a hypothesis, and nothing, to them.

    None where a quick fit of the hypothesis is far behind what was found.
    """
    one = done.search
    problem = one.fits.problem
    search = Search(
        replace(problem, data=corrected(problem.data, faults)),
        one.fits.form,
        one.candidates,
        one.tell,
        scanned=one.scanned,
        workers=one.workers,
        ranking=one.fits.ranking,
        beforehand=one.fits.odds.beforehand + log_prior(faults, problem.data),
        budget=one.budget,
    )
    near = ScoredFit(replace(h.fitted, channels=h.fitted.channels[:0]), h.prior)
    quick = search.fits.quickly(search.fits.free(near), near, h.effects, values_of(h.effects))
    # All lines seldom add to it what separates a beam.
    if quick.score < done.best.score - 2 * BEAM_NATS:
        return None
    search.full((), (), near if not h.effects else None)
    fitted = search.full(h.effects, values_of(h.effects), near)
    others = (replace(done, otherwise=()), *done.otherwise)
    return replace(done, search=search, best=fitted, faults=(*done.faults, *faults), otherwise=others)
