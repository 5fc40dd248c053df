"""From a model and measured FRFs to the posterior over what is missing."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import numpy as np

from fem.model import Effect, Model
from fem.reduction.reduced_model import ReducedModel
from updating.correlation.frf_correlation import DB_PER_NEPER
from updating.diagnosis.diagnose import EFFECT, FAULT, FITTED, NOTHING, UNEXPLAINED, Diagnosis, propose
from updating.diagnosis.evidence.fitting import fit, with_seen_noise
from updating.diagnosis.evidence.form import form_of
from updating.diagnosis.evidence.priors import TWIN_NATS
from updating.diagnosis.evidence.search import FULL_LINES, Hypothesis, Search, values_of
from updating.diagnosis.findings import Finding, Ranked, Step, labels, parameters_of, step_added, step_of
from updating.diagnosis.search import Progress, change_of, similarity_of
from updating.diagnosis.separation import Decisive, next_measurements, what_decides
from updating.inference.fit import EXPLAINED_LEVEL, FitProblem
from updating.inference.fit_result import FitResult
from updating.inference.mode_targets import ModeTargets
from updating.inference.parameters import Nuisance
from updating.inference.preparation import (
    N_FIT_LINES,
    basis_error,
    build_fine,
    build_problem,
    fitted_model,
    with_higher_mass,
)
from updating.measurement.measurement import Measurement
from updating.quality.faults import Fault, find_faults, settle_faults
from updating.quality.gates import check_gates, with_last_faults

UNKNOWN = "unknown"
"""Name of what the library does not have, in the posterior."""
MOST_SEPARATED = 3
"""At most so many twins get proposals of measurements that would separate them."""
N_CHECKED = 6
"""Lines at which the reduced basis is checked in the end."""


@dataclass(frozen=True, slots=True, eq=False)
class Searched:
    """A search that has ended.

    Attributes
    ----------
    search : Search
    best : Hypothesis
    faults : tuple of Fault
        Set right before the search.
    mesh_db : float
        Error of the mesh [dB].
    model : Model
        With the form's effects.
    """

    search: Search
    best: Hypothesis
    faults: tuple[Fault, ...]
    mesh_db: float
    model: Model

    @property
    def problem(self) -> FitProblem:
        """The problem of a search by FRFs."""
        assert isinstance(self.search.problem, FitProblem)
        return self.search.problem

    @property
    def unknown(self) -> float:
        """Score of what the library does not have."""
        return self.search.unknown(self.best)

    @property
    def lead(self) -> Hypothesis:
        """The best hypothesis, or the best with effects where it has none and cannot explain the data."""
        if self.best.effects or self.unknown < self.best.score:
            return self.best
        some = [h for h in self.search.known.values() if h.effects]
        return max(some, key=lambda h: h.score, default=self.best)

    @property
    def evidence(self) -> float:
        """Logarithm of the sum over all hypotheses."""
        scores = [k.score for k in self.search.known.values()]
        return float(np.logaddexp.reduce(np.array([*scores, self.unknown])))

    def probability(self, h: Hypothesis) -> float:
        """Return the posterior probability of a hypothesis."""
        return float(np.exp(h.score - self.evidence))

    @property
    def unknown_probability(self) -> float:
        """Posterior probability of what the library does not have."""
        return float(np.exp(self.unknown - self.evidence))

    def probability_there(self, h: Hypothesis) -> float:
        """Return the probability that what is missing is at the places of a hypothesis."""
        return sum(self.probability(k) for k in self.search.known.values() if k.places == h.places)


def search_by_evidence(
    model: Model,
    measurement: Measurement,
    nuisances: Sequence[Nuisance] = (),
    *,
    damping_std: float = 0.5,
    band: tuple[float, float] | None = None,
    kinds: Sequence[str] | None = None,
    exclude: Sequence[str] = (),
    n_lines: int = N_FIT_LINES,
    model_error: float = EXPLAINED_LEVEL,
    modes: ModeTargets | None = None,
    progress: Progress | None = None,
) -> Searched:
    """Search what a model lacks; parameters as of :func:`updating.diagnosis.diagnose.diagnose`.

    Measured ``modes`` are fitted beside the FRFs.
    """
    say = progress or (lambda text, done: None)
    build = partial(
        build_problem, measurement=measurement, damping_std=damping_std, band=band, n_lines=n_lines,
        connections=True, model_error=model_error,
    )  # fmt: skip
    say("reducing the model", 0.0)
    plain = partial(build, nuisances=nuisances)
    problem, model, _, left, _ = build_fine(plain, with_higher_mass(model), model_error)
    form, own = form_of(model) if model_error > 0 else ((), ())
    formed = model
    for effect in form:
        formed = formed.with_effect(effect)
    every = (*problem.nuisances, *own)
    whole = replace(problem, reduced=build(formed, nuisances=every).reduced, nuisances=every)
    say("fitting the uncertain parameters", 0.05)
    null = fit(whole, n_lines=FULL_LINES)
    whole, _, faults = find_faults(whole, whole.assessed(null.result))
    whole = replace(with_seen_noise(whole, null.result), modes=modes)
    candidates = _candidates(model, measurement, kinds, exclude)
    search = Search(whole, own, candidates, left[1], partial(_told, say))
    best = search.run()
    say("refining", 0.9)
    return Searched(search, search.polished(best), faults, left[0], formed)


def _candidates(
    model: Model, measurement: Measurement, kinds: Sequence[str] | None, exclude: Sequence[str]
) -> tuple[Effect, ...]:
    """Return all candidates but those that the form stands for."""
    return tuple(e for e in propose(model, kinds, exclude, measurement) if not e.is_form)


def _told(say: Progress, text: str) -> None:
    say(text, 0.5)


def diagnose_by_evidence(
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
    n_simulated: int = 0,
    modes: ModeTargets | None = None,
    progress: Progress | None = None,
) -> Diagnosis:
    """Find what a model lacks by the evidence for it: by FRFs, and by measured modes beside them.

    Parameters are those of :func:`updating.diagnosis.diagnose.diagnose`.

    ``n_simulated`` is of no effect: what chance does is in the evidence.
    """
    begun, say = time.perf_counter(), progress or (lambda text, done: None)
    done = search_by_evidence(
        model, measurements[0], nuisances, damping_std=damping_std, band=band, kinds=kinds,
        exclude=exclude, n_lines=n_lines, model_error=model_error, modes=modes, progress=say,
    )  # fmt: skip
    say("checking", 0.95)
    search, best = done.search, done.best
    nothing = search.known[frozenset()]
    null = done.problem.assessed(nothing.fitted.result)
    gates = check_gates(done.problem, null, measurements[1:], done.mesh_db, done.faults)
    believed = done.unknown < best.score
    chain = _chain(done, done.lead)
    reduced = done.problem.reduced.with_forces_of(done.lead.effects)
    problem = replace(done.problem, reduced=reduced)
    steps = [
        step_of("nominal model", problem.nominal()),
        step_of(FITTED, problem.assessed(nothing.fitted.result)),
    ]
    for before, h in pairwise(chain):
        new = [e for e in h.effects if e.name not in before.key]
        steps.append(step_added(new, problem.assessed(h.fitted.result)))
    problem, steps, faults = _with_last_faults(problem, steps, done.faults, believed)
    findings, rounds = _findings(done, problem, chain, steps)
    verdict, reason = _verdict(done, believed, faults)
    if not believed:
        findings, steps = [], steps[:2]
    current = steps[-1].result
    notes = list(gates.notes)
    if modes is not None:
        notes.append(f"{len(modes.fitted)} measured modes ({modes.name}) were fitted beside the FRFs")
    if not gates.linear:
        verdict = UNEXPLAINED if verdict in (NOTHING, FAULT) else verdict
    floor = float(np.hypot(problem.data.noise_level, done.mesh_db / DB_PER_NEPER))
    posterior = [
        (tuple(sorted(h.key)), done.probability(h))
        for h in sorted(search.known.values(), key=lambda h: -h.score)
    ]
    posterior.append(((UNKNOWN,), done.unknown_probability))
    return Diagnosis(
        verdict, reason, tuple(findings), faults, tuple(steps), tuple(rounds), problem.data.noise_db,
        done.mesh_db, basis_error(problem, current, N_CHECKED), max(model_error, floor), floor, problem,
        fitted_model(done.model, current), tuple(notes), time.perf_counter() - begun,
        with_last_faults(gates, done.faults, faults), search.candidates,
        searched=done, posterior=tuple(posterior), places=tuple((s.name, s.left) for s in search.scanned),
    )  # fmt: skip


def _chain(done: Searched, best: Hypothesis) -> list[Hypothesis]:
    """Return hypotheses from nothing to the best one with one effect more each, the most telling first."""
    search, chain = done.search, [best]
    while chain[0].effects:
        h, rest = chain[0], []
        for e in h.effects:
            fewer = tuple(x for x in h.effects if x.name != e.name)
            rest.append(search.full(fewer, values_of(fewer), h.fitted, h))
        chain.insert(0, max(rest, key=lambda r: r.score))
    return chain


def _with_last_faults(
    problem: FitProblem, steps: list[Step], faults: tuple[Fault, ...], believed: bool
) -> tuple[FitProblem, list[Step], tuple[Fault, ...]]:
    """Look for faults once more where the physics is right, and withdraw those that it has explained."""
    current = steps[-1].result
    if believed:
        problem, current, late = find_faults(problem, current)
        faults = (*faults, *late)
    if faults:
        problem, current, faults = settle_faults(problem, current, faults)
        before = [step_of(s.label, problem.assessed(replace(s.result, level=np.nan))) for s in steps[:-1]]
        steps = [*before, step_of(steps[-1].label, current)]
    return problem, steps, faults


def _findings(
    done: Searched, problem: FitProblem, chain: Sequence[Hypothesis], steps: Sequence[Step]
) -> tuple[list[Finding], list[tuple[Ranked, ...]]]:
    """Return a finding for each effect with its twins, and the ranking of what could stand in its place."""
    findings, rounds = [], []
    last, best = steps[-1].result, chain[-1]
    for before, h, step in zip(chain, chain[1:], steps[2:], strict=False):
        (effect,) = (e for e in h.effects if e.name not in before.key)
        shift = change_of(problem, step.result, steps[1].result)
        ranked = [_ranked(problem, effect, step.result, 1.0)]
        others = [k for k in done.search.known.values() if before.key < k.key and len(k.key) == len(h.key)]
        for other in sorted(others, key=lambda k: -k.score):
            if other.key == h.key:
                continue
            mine = replace(problem, reduced=_with_forces(done, other.effects))
            result = mine.assessed(other.fitted.result)
            (else_,) = (e for e in other.effects if e.name not in before.key)
            alike = similarity_of(shift, change_of(mine, result, steps[1].result))
            ranked.append(_ranked(mine, else_, result, alike))
        rounds.append(tuple(ranked))
        twins = _twins(done, best, effect)
        final = next(e for e in last.effects if e.name == effect.name)
        known = {r.name: r for r in ranked}
        rival = next((r for r in ranked[1:] if r.name not in twins), None)
        same = tuple(known[t] for t in twins if t in known)
        against = rival or (same[0] if same else None)
        decisive: tuple[Decisive, ...] = ()
        if against is not None:
            both = replace(problem, reduced=_with_forces(done, [*h.effects, *against.result.effects]))
            decisive = what_decides(both, step.result, against.result)
        proposals = tuple(
            next_measurements(
                replace(problem, reduced=_with_forces(done, [*h.effects, *t.result.effects])),
                step.result, t.result,
            )
            for t in same[:MOST_SEPARATED]
        )  # fmt: skip
        findings.append(Finding(final, parameters_of(final, last), same, rival, decisive, proposals))
    return findings, rounds


def _with_forces(done: Searched, effects: Sequence[Effect]) -> ReducedModel:
    """Return the reduced model with the responses to the forces of effects, each once."""
    return done.problem.reduced.with_forces_of(list({e.name: e for e in effects}.values()))


def _twins(done: Searched, best: Hypothesis, effect: Effect) -> list[str]:
    """Return the names of the effects that could stand in the place of one of the best hypothesis."""
    rest = best.key - {effect.name}
    out = []
    for k in sorted(done.search.known.values(), key=lambda k: -k.score):
        other = len(k.key) == len(best.key) and rest < k.key and k.key != best.key
        if other and k.score > best.score - TWIN_NATS:
            out += list(k.key - rest)
    return out


def _ranked(problem: FitProblem, effect: Effect, result: FitResult, similarity: float) -> Ranked:
    return Ranked(
        effect.name, effect.kind, effect.where, parameters_of(effect, result), result.level, result.fit_db,
        result.held_out_db, similarity, True, np.nan, result,
    )  # fmt: skip


def _verdict(done: Searched, believed: bool, faults: Sequence[Fault]) -> tuple[str, str]:
    """Return the verdict and why."""
    search, best = done.search, done.best
    nothing = search.known[frozenset()]
    before, level = (f"{h.fitted.level * DB_PER_NEPER:.2g}" for h in (nothing, best))
    share = f"{done.probability_there(best):.0%}".replace("%", " %")
    names = labels(best.effects)
    if not believed:
        lead, left = done.lead, f"{done.lead.fitted.level * DB_PER_NEPER:.2g}"
        so_far = f"; best so far, not explained: {labels(lead.effects)}, {left} dB" if lead.effects else ""
        return UNEXPLAINED, (
            f"the residual level stays at {before} dB, more than a right model leaves{so_far}"
        )
    if best.effects:
        lower = "lower" if len(best.effects) > 1 else "lowers"
        return (
            EFFECT,
            f"{names} {lower} the residual level from {before} to {level} dB; probability of the place "
            f"{share}",
        )
    if faults:
        return FAULT, (
            f"with {len(faults)} fault(s) of the measurement set right nothing improves the model further; "
            f"residual level {level} dB; probability {share}"
        )
    return NOTHING, (
        f"no candidate improves the fitted model, whose residual level is {level} dB; probability {share}"
    )
