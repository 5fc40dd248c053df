"""From a model and measured FRFs to what is missing."""

import time
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np

from fem.effects.joint_nonlinear import AmplitudeDependent
from fem.linalg.solvers import one_thread
from fem.model import Effect, Model
from updating.correlation import DB_PER_NEPER
from updating.diagnosis.amplitude import force_levels
from updating.diagnosis.candidates import propose, situated
from updating.diagnosis.carried import Between, CalibratedFrfs
from updating.diagnosis.changes import change_of, similarity_of
from updating.diagnosis.departures import departed
from updating.diagnosis.diagnosis import DAMPED, N_CHECKED, Diagnosis
from updating.diagnosis.evidence.budget import NORMAL, Budget
from updating.diagnosis.evidence.channel_rivals import without_effects_of_channels
from updating.diagnosis.evidence.diagnosis import (
    Searched,
    candidates_for_test,
    prepare_search,
    search_of_problem,
    searched,
)
from updating.diagnosis.evidence.hypothesis import ScoredFit, values_of
from updating.diagnosis.evidence.readings import log_prior
from updating.diagnosis.findings import Finding, Ranked, Step, parameters_of, step_added, step_of
from updating.diagnosis.fitted_modes import damped_modes
from updating.diagnosis.foreign_modes import foreign_modes, note_of
from updating.diagnosis.frf_modes import identified_in
from updating.diagnosis.frf_states import ONE_STRUCTURE, changed_frf_problem, search_change
from updating.diagnosis.laws import at_its_amplitude, with_laws
from updating.diagnosis.separation import Decisive, next_measurements, what_decides
from updating.diagnosis.verdict import (
    CALIBRATED,
    FAULT,
    FITTED,
    NOTHING,
    UNEXPLAINED,
    explanations_of,
    posterior_of,
    reason_of,
    verdict_of,
)
from updating.inference.belief import TWIN_NATS
from updating.inference.defaults import EXPLAINED_LEVEL
from updating.inference.fit import FitProblem
from updating.inference.fit_result import FitResult
from updating.inference.heartbeat import Progress, beating
from updating.inference.mode_targets import ModeTargets
from updating.inference.parameters import Nuisance
from updating.inference.preparation import N_FIT_LINES, ProblemOptions, basis_error, fitted_model
from updating.inference.workers import workers
from updating.measurement.measurement import Measurement
from updating.quality.channel_faults import CORRECTED_KINDS, channel_faults
from updating.quality.corrections import corrected
from updating.quality.faults import Fault, find_faults, settle_faults
from updating.quality.gates import Gates, check_gates, with_last_faults

MOST_SEPARATED = 3
"""Largest number of twins with proposals of measurements that would separate them."""
BEYOND_BAND = 1.2
"""Modes of the model up to this multiple of the band's end may be measured ones [-]."""
BASIS_LIMIT_DB = 0.5
"""Error of the reduced basis from which the notes warn of it [dB]."""


@one_thread()
def diagnose(
    model: Model,
    measurements: Sequence[Measurement],
    nuisances: Sequence[Nuisance] = (),
    *,
    damping_std: float = 0.5,
    band: tuple[float, float] | None = None,
    kinds: Sequence[str] | None = None,
    exclude: Sequence[str] = (),
    n_lines: int = N_FIT_LINES,
    model_error: float = EXPLAINED_LEVEL,
    modes: ModeTargets | None = None,
    baseline: Measurement | CalibratedFrfs | None = None,
    changes: Sequence[Effect] = (),
    between: Between = ONE_STRUCTURE,
    progress: Progress | None = None,
    processes: int = 1,
    budget: Budget = NORMAL,
) -> Diagnosis:
    """Find the physical effects that a model lacks, by the evidence for them.

    With a ``baseline``, measured in an earlier state, it finds those that have come since.

    Uncertain parameters are fitted, and sensors with a wrong sign or gain are set right. Then hypotheses,
    that is models with some effects more, are fitted, and the most probable one is named.

    Parameters
    ----------
    model : Model
        With a point of the mesh at every sensor (:func:`updating.measurement.measurement.place_sensors`).
    measurements : sequence of Measurement
        The first is searched. Where others, at other force levels, are not in proportion to it, laws of
        joints that depend on amplitude are compared with what was found, on all levels together.
    nuisances : sequence of Nuisance
        What is known only roughly.
    damping_std : float
        Standard deviation of the logarithm of the damping ratio [-].
    band : (float, float), optional
        Frequencies that count [Hz].
    kinds : sequence of str, optional
        Kinds of candidates; all unless given.
    exclude : sequence of str
        Kinds to leave out.
    n_lines : int
        At most this many lines are fitted.
    model_error : float
        Residual level up to which a model counts as right, because beams are not the structure itself
        [nepers]; 0 if nothing but noise and the mesh may be left.
    modes : ModeTargets, optional
        Measured modes that are fitted beside the FRFs; not with a baseline.
    baseline : Measurement or CalibratedFrfs, optional
        FRFs of an earlier state, on which the model is calibrated, or that calibration.
    changes : sequence of Effect
        Effects that are known to have come since then; the model has none of them.
    between : Between
        What differs between the two states besides effects.
    progress : callable, optional
        Called with a text and the fraction done.
    processes : int
        Number of parallel processes; the result is the same. With more than one, a script must guard
        its own work by ``if __name__ == "__main__":``, as :mod:`multiprocessing` demands.
    budget : Budget
        How much is tried.
    """
    started = time.perf_counter()
    settings: ProblemOptions = {
        "damping_std": damping_std,
        "band": band,
        "n_lines": n_lines,
        "model_error": model_error,
    }
    measured, first = measurements[0], None
    with workers(processes) as crew, beating(progress or (lambda text, done: None)) as say:
        run: dict[str, Any] = {"progress": say, "crew": crew, "budget": budget}
        if baseline is None:
            say("reducing the model", 0.0)
            prepared = prepare_search(model, measured, nuisances, kinds=kinds, exclude=exclude, **settings)
            say("fitting the uncertain parameters", 0.05)
            initial = search_of_problem(*prepared, modes=modes, **run)
        else:
            say("calibrating on the first state", 0.0)
            first, changed, problem = changed_frf_problem(
                situated(model, kinds),
                baseline,
                measured,
                nuisances,
                changes=changes,
                between=between,
                **settings,
            )
            say("comparing the second state", 0.1)
            candidates = candidates_for_test(changed, measured, kinds, exclude)
            initial = search_change(first, changed, problem, candidates, between=between, **run)
            measurements = measurements[:1]
        found = _diagnosed(initial, model, measurements, kinds, exclude, model_error, say)
    return replace(_since(found, first), seconds=time.perf_counter() - started)


def _since(found: Diagnosis, first: CalibratedFrfs | None) -> Diagnosis:
    """Return a diagnosis of a second state with its first one, whose faults both have."""
    if first is None:
        return found
    one, two, *rest = found.steps
    steps = (replace(one, label=CALIBRATED), replace(two, label=DAMPED), *rest)
    before = channel_faults(first.problem, first.result)
    return replace(
        found,
        steps=steps,
        faults=(*first.faults, *found.faults),
        channel_faults=(*before, *found.channel_faults),
        baseline=first,
    )


def _diagnosed(
    initial: Searched[FitProblem],
    model: Model,
    measurements: Sequence[Measurement],
    kinds: Sequence[str] | None,
    exclude: Sequence[str],
    model_error: float,
    say: Progress,
) -> Diagnosis:
    """Continue a search with amplitude laws and return its diagnosis."""
    first = initial.problem
    gates = check_gates(
        first, first.assessed(initial.best.fitted), measurements[1:], initial.mesh_db, initial.faults
    )
    levels = () if gates.linear else force_levels(first, measurements, initial.faults)
    every = propose(model, kinds, exclude, measurements[0], levels=bool(levels))
    laws = [e for e in every if isinstance(e, AmplitudeDependent)]
    done = with_laws(initial, levels, laws) if laws else initial
    if not done.explains or not done.best.effects:
        done = searched(initial, say)
        if not done.finished:
            return _concluded(done, gates, model_error, stated=bool(levels))
        if levels and done.faults != initial.faults:
            levels = force_levels(done.problem, measurements, done.faults)
        done = without_effects_of_channels(done)
        done = with_laws(done, levels, laws) if laws else done
    say("checking", 0.95)
    return _concluded(done, gates, model_error, stated=bool(levels))


def _concluded(done: Searched[FitProblem], gates: Gates, model_error: float, *, stated: bool) -> Diagnosis:
    """Return what a search says; ``stated`` tells whether there are levels of force."""
    search, lead, nothing = done.search, done.lead, done.search.known[frozenset()]
    chain = _chain(done, lead)
    problem = done.problem.with_forces_of(lead.fitted)
    steps = [
        step_of("nominal model", problem.nominal()),
        step_of(FITTED, problem.assessed(nothing.fitted)),
    ]
    for before, h in pairwise(chain):
        new = [e for e in h.effects if e.name not in before.key]
        steps.append(step_added(new, problem.assessed(at_its_amplitude(problem, h.fitted))))
    problem, steps, faults = _with_last_faults(problem, steps, done)
    findings, rounds = _findings(done, problem, chain, steps)
    if rivals := _rivals(done, problem, chain[-1], steps[-1].result):
        rounds.append(rivals)
    if done.finished and not done.explains:
        findings, steps = [], steps[:2]
    current = steps[-1].result
    of_channels = channel_faults(problem, current) if done.explains else ()
    floor = float(np.hypot(problem.data.noise_level, done.mesh_db / DB_PER_NEPER))
    basis_db = basis_error(problem, current, N_CHECKED)
    out = Diagnosis(
        verdict=verdict_of(done, (*faults, *of_channels)),
        reason="",
        findings=tuple(findings),
        faults=faults,
        steps=tuple(steps),
        rounds=tuple(rounds),
        noise_db=problem.data.noise_db,
        discretisation_db=done.mesh_db,
        basis_db=basis_db,
        limit=max(model_error, floor),
        noise_limit=floor,
        problem=problem,
        model=fitted_model(done.model, current),
        notes=_notes(done, gates, basis_db, stated=stated),
        seconds=0.0,
        gates=with_last_faults(gates, done.proposed_faults, faults),
        candidates=search.candidates,
        searched=done,
        modes=None,
        places=tuple((s.name, s.residual_ratio) for s in search.scanned),
        explanations=explanations_of(done),
        posterior=posterior_of(done),
        departures=departed([(h, done.probability(h)) for h in done.hypotheses], problem, current),
        channel_faults=of_channels,
    )
    verdict, reason = _verdict(out, done, gates)
    if verdict == UNEXPLAINED:
        up_to = BEYOND_BAND * float(problem.data.frequency[-1])
        measured = identified_in(problem)
        modes = damped_modes(out.model, problem.damping, current.zeta, up_to)
        foreign = foreign_modes(problem, modes, measured)
        out = replace(
            out, identified=measured, notes=(*out.notes, note_of(foreign)) if foreign else out.notes
        )
    return replace(out, verdict=verdict, reason=reason)


def _notes(done: Searched[FitProblem], gates: Gates, basis_db: float, *, stated: bool) -> tuple[str, ...]:
    """Return what a reader should know of the mesh, the gates and the basis."""
    notes = [*done.notes, *gates.notes]
    if not gates.linear and not stated:
        notes.append(
            "what depends on amplitude is searched for only where each measurement states its force_level, "
            "and two differ"
        )
    if basis_db > BASIS_LIMIT_DB:
        notes.append(
            f"the reduced basis differs from the full model by {basis_db:.2g} dB at the checked lines: "
            "read weak findings with care"
        )
    return tuple(notes)


def _chain(done: Searched[FitProblem], best: ScoredFit) -> list[ScoredFit]:
    """Return hypotheses from nothing to the best one with one effect more each, the most telling first."""
    search, chain = done.search, [best]
    while chain[0].effects:
        h = chain[0]
        fewer = [tuple(x for x in h.effects if x.name != e.name) for e in h.effects]
        if len(fewer) > 1:  # few lines tell which
            _, rest = search.on_few_lines(search.fits.free(h), h, [(f, values_of(f)) for f in fewer])
            fewer = [max(rest, key=lambda r: r.score).effects]
        chain.insert(0, search.full(fewer[0], values_of(fewer[0]), h))
    return chain


def _with_last_faults(
    problem: FitProblem, steps: list[Step], done: Searched[FitProblem]
) -> tuple[FitProblem, list[Step], tuple[Fault, ...]]:
    """Look for faults once more where the physics is right, and withdraw those that it has explained.

    Sensors cannot be compared by what a law of a joint makes of the motion: there faults stay as they are.
    """
    current, faults = steps[-1].result, done.faults
    if any(e.amplitude_dependent for e in current.effects):
        return problem, steps, faults
    if done.explains and done.search.budget.checked:
        problem, current, late = find_faults(problem, current)
        known = {f.name for f in (*faults, *late)}
        of_channels = [f for f in channel_faults(problem, current) if f.kind in CORRECTED_KINDS]
        more = [replace(f, tolerance=0.0) for f in of_channels if f.name not in known]
        problem = replace(problem, data=corrected(problem.data, more))
        faults = (*faults, *late, *more)
    if faults:
        problem, current, faults = settle_faults(problem, current, faults, partial(_score, done))
        before = [step_of(s.label, problem.assessed(replace(s.result, level=np.nan))) for s in steps[:-1]]
        steps = [*before, step_of(steps[-1].label, current)]
    return problem, steps, faults


def _score(done: Searched[FitProblem], problem: FitProblem, faults: Sequence[Fault]) -> float:
    """Return how probable the effects that were found are with faults, by data corrected for these."""
    h, fits = done.lead, done.search.fits
    on = replace(fits, problem=replace(fits.problem, data=problem.data))
    again = on.fully(h.effects, values_of(h.effects), h)
    return again.fitted.log_evidence + log_prior(faults, problem.data)


def _findings(
    done: Searched[FitProblem], problem: FitProblem, chain: Sequence[ScoredFit], steps: Sequence[Step]
) -> tuple[list[Finding], list[tuple[Ranked, ...]]]:
    """Return a finding for each effect with its twins, and the ranking of what could stand in its place."""
    findings, rounds = [], []
    last, best = steps[-1].result, chain[-1]
    for before, h, step in zip(chain, chain[1:], steps[2:], strict=False):
        (effect,) = (e for e in h.effects if e.name not in before.key)
        shift = change_of(problem, step.result, steps[1].result)
        ranked, as_good = [_ranked(effect, step.result, 1.0, h.score)], list[Ranked]()
        for other in _with_one_more(done, before):
            if other.key == h.key:
                continue
            result = problem.assessed(other.fitted)
            (else_,) = (e for e in other.effects if e.name not in before.key)
            alike = similarity_of(shift, change_of(problem, result, steps[1].result))
            ranked.append(_ranked(else_, result, alike, other.score))
            if h.fitted.log_likelihood - other.fitted.log_likelihood < TWIN_NATS:
                as_good.append(ranked[-1])
        rounds.append(tuple(ranked))
        twins = _twins(done, best, effect)
        final = next(e for e in last.effects if e.name == effect.name)
        known = {r.name: r for r in ranked}
        others = (r for r in ranked[1:] if r.name not in twins and not r.extends(effect))
        rival = next(others, None)
        same = sorted((known[t] for t in twins if t in known), key=lambda t: t.extends(effect))
        alternatives = [t for t in same if not t.extends(effect)]
        against = rival or next(iter(alternatives), None)
        decisive: tuple[Decisive, ...] = ()
        if against is not None and done.search.budget.checked:
            decisive = what_decides(problem, step.result, against.result)
        proposals = tuple(
            next_measurements(problem, step.result, t.result)
            for t in alternatives[:MOST_SEPARATED]
            if not any(e.amplitude_dependent for e in (*h.effects, *t.result.effects))
        )
        equal = tuple(r for r in as_good if r.name not in twins and not r.extends(effect))
        findings.append(
            Finding(final, parameters_of(final, last), tuple(same), rival, decisive, proposals, equal)
        )
    return findings, rounds


def _with_one_more(done: Searched[FitProblem], base: ScoredFit) -> list[ScoredFit]:
    """Return the hypotheses with one effect more than another, the most probable first."""
    more = [k for k in done.search.known.values() if base.key < k.key and len(k.key) == len(base.key) + 1]
    return sorted(more, key=lambda k: -k.score)


def _rivals(
    done: Searched[FitProblem], problem: FitProblem, best: ScoredFit, before: FitResult
) -> tuple[Ranked, ...]:
    """Return the ranking of further effects that were tried with the best hypothesis and lower its score."""
    ranked, shift = [], None
    for other in _with_one_more(done, best):
        result = problem.assessed(other.fitted)
        (more,) = (e for e in other.effects if e.name not in best.key)
        change = change_of(problem, result, before)
        shift = change if shift is None else shift
        ranked.append(_ranked(more, result, similarity_of(shift, change), other.score))
    return tuple(ranked)


def _twins(done: Searched[FitProblem], best: ScoredFit, effect: Effect) -> list[str]:
    """Return the names of the effects that could stand in the place of one of the best hypothesis."""
    rest = best.key - {effect.name}
    out = []
    for k in sorted(done.search.known.values(), key=lambda k: -k.score):
        other = len(k.key) == len(best.key) and rest < k.key and k.key != best.key
        if other and k.score > best.score - TWIN_NATS:
            out += list(k.key - rest)
    return out


def _ranked(effect: Effect, result: FitResult, similarity: float, score: float) -> Ranked:
    return Ranked(
        name=effect.name,
        kind=effect.kind,
        where=effect.where,
        parameters=parameters_of(effect, result),
        level=result.level,
        fit_db=result.fit_db,
        held_out_db=result.held_out_db,
        similarity=similarity,
        score=score,
        result=result,
    )


def _verdict(d: Diagnosis, done: Searched[FitProblem], gates: Gates) -> tuple[str, str]:
    """Return the verdict, which a structure that is not linear may change, and why."""
    lead = d.problem.assessed(done.lead.fitted).fit_db if d.verdict == UNEXPLAINED else d.steps[-1].fit_db
    errors = (f"{db:.2f}" for db in (d.steps[min(1, len(d.steps) - 1)].fit_db, d.steps[-1].fit_db, lead))
    verdict, reason = d.verdict, reason_of(d, done, "error", "dB", *errors)
    if done.n_levels > 1:
        reason += f"; {done.n_levels} force levels were fitted together"
    if not gates.linear and not any(e.amplitude_dependent for e in done.best.effects):
        reason += "; the FRFs change with the level of force, and nothing that was tried explains it"
        verdict = UNEXPLAINED if verdict in (NOTHING, FAULT) else verdict
    return verdict, reason
