"""From a model and measured modes to the posterior over what is missing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fem.array_types import Floats
from fem.declarations import Role
from fem.model import Effect, Model
from fem.summary import percent
from updating.diagnosis.candidates import propose
from updating.diagnosis.elsewhere import weigh_elsewhere
from updating.diagnosis.evidence.diagnosis import Searched, search_promised, searched
from updating.diagnosis.evidence.hypothesis import ScoredFit
from updating.diagnosis.evidence.search import Search
from updating.diagnosis.findings import Finding, labels, parameters_of
from updating.diagnosis.images import images_of
from updating.diagnosis.mode_separation import next_measurements
from updating.diagnosis.mode_table import HALF, ModeTable
from updating.diagnosis.verdict import (
    CALIBRATED,
    CREDIBLE,
    EFFECT,
    FITTED,
    NOMINAL,
    UNEXPLAINED,
    UNFINISHED,
    BadReading,
    Explanation,
    Stairs,
    Verdict,
    explanations_of,
    posterior_of,
    reason_of,
    verdict_of,
)
from updating.inference.fit_result import FitResult
from updating.inference.formed import Formed
from updating.inference.heartbeat import EndEarlyError, Progress, ending_early
from updating.inference.mode_fit import (
    DAMPING,
    FREQUENCY,
    LARGEST_DISCREPANCY,
    LEAST_DISCREPANCY,
    SHAPE,
    ComputedModes,
    ModeProblem,
    n_below,
)
from updating.inference.mode_targets import ModeTargets
from updating.inference.preparation import fitted_model
from updating.least_squares.mode_levels import MEAN_SQUARE, ModeLevels

QUANTITIES = {
    FREQUENCY: "natural frequencies",
    DAMPING: "damping ratios",
    SHAPE: "mode shapes, √(1 − MAC)",
}
MOST_NAMED = 3
"""Modes that are named as missed."""


@dataclass(frozen=True, slots=True, eq=False)
class Calibrated:
    """A model that was fitted to the modes of one state.

    Attributes
    ----------
    model : Model
        With fitted values, form included.
    problem : ModeProblem
        Of this state.
    fitted : FitResult
    computed : ComputedModes
        The model's partners of the measured modes.
    made : Formed
        The model before the fit, and its form.
    """

    model: Model
    problem: ModeProblem
    fitted: FitResult
    computed: ComputedModes
    made: Formed

    @property
    def missed(self) -> Floats:
        """By how many standard deviations of noise it misses each frequency, NaN without a partner, (n,)."""
        t = self.problem.targets
        return np.log(self.computed.frequency / t.frequency) / t.frequency_std

    @property
    def form_share(self) -> Floats:
        """Share of each residual that is the model's error: of frequencies, damping and shapes, (3, n) [-].

        By the size of the residuals, also where a study says that the form is right: what the model lacks in
        the first state, it lacks in the second one. 0 where nothing was measured.
        """
        return self._by_reading(self._levels.discrepancy_share(self.fitted.misfit))

    @property
    def carried_share(self) -> Floats:
        """The share that another state has, too: a bad reading says nothing of it, (3, n) [-]."""
        return self.form_share * (1 - self.bad)

    @property
    def form_error(self) -> Floats:
        """Standard deviation of the model's error of frequencies, damping and shapes, (3,) [-].

        As the residuals show it; of what was not measured at all as it may be.
        """
        squares = self._by_reading(self._levels.discrepancy_square(self.fitted.misfit)).max(axis=1)
        prior = MEAN_SQUARE * self.problem.discrepancy**2
        return np.sqrt(np.where(np.isin(np.arange(len(prior)), self._levels.kind), squares, prior))

    @property
    def bad(self) -> Floats:
        """Probability that readings of frequencies, damping and shapes do not belong, (3, n); 1 of none."""
        return 1 - self._by_reading(1 - self._levels.is_bad(self.fitted.misfit))

    @property
    def _levels(self) -> ModeLevels:
        fit = self.fitted.levels
        assert isinstance(fit, ModeLevels)
        least, largest = LEAST_DISCREPANCY[fit.kind], LARGEST_DISCREPANCY[fit.kind]
        known = fit.kind, fit.n, fit.size, fit.variance, largest, fit.bad, fit.bad_prior
        return ModeLevels.up_to(*known, least=least)

    def _by_reading(self, of_groups: Floats) -> Floats:
        out = np.zeros((len(LARGEST_DISCREPANCY), self.problem.targets.n))
        for reading, value in zip(self.problem.readings(), of_groups, strict=True):
            out[reading.kind, reading.mode] = value
        return out


@dataclass(frozen=True, slots=True, eq=False, kw_only=True, repr=False)
class ModeDiagnosis(Verdict):
    """What is missing by measured modes, and how sure that is.

    Attributes
    ----------
    problem : ModeProblem
    searched : Searched
    modes : ModeTable
    baseline : Calibrated or None
        The fit to an earlier state, where the change since then was searched for.
    judged : Baseline or None
        What that state says of the model.
    """

    problem: ModeProblem
    searched: Searched[ModeProblem]
    modes: ModeTable
    baseline: Calibrated | None = None
    judged: Baseline | None = None

    @property
    def stairs(self) -> Stairs:
        """Error of the natural frequencies after each step [%]."""
        m = self.modes
        steps = {NOMINAL: m.nominal, FITTED: m.fitted} if self.baseline is None else {CALIBRATED: m.fitted}
        if self.found:
            steps[f"{labels(self.found)} added"] = m.found
        rows = [(label, 100 * m.errors(f, False), 100 * m.errors(f, True)) for label, f in steps.items()]
        return Stairs(tuple(rows), 100 * self.noise_limit, "%")

    @property
    def calibration(self) -> tuple[ModeProblem, FitResult, Model]:
        """The fit of the uncertain parameters, and its model; of two states, that to the first one."""
        if self.baseline is not None:
            return self.baseline.problem, self.baseline.fitted, self.baseline.model
        return self.problem, self.final.fitted, self.model

    @property
    def final(self) -> ScoredFit:
        """The hypothesis of the verdict: that without effects where no explanation is believed."""
        return _reported(self.searched)

    @property
    def noise_limit(self) -> float:
        """Relative deviation of frequencies that noise and the mesh account for [-]."""
        return self.searched.search.fits.floor


@dataclass(frozen=True, slots=True, eq=False)
class Baseline:
    """What the first state says of the model.

    Attributes
    ----------
    first : Calibrated
        The model that was fitted to it, without further effects.
    bases : tuple of Calibrated
        Models that the change is looked for beside, the most probable first.
    log_weights : ndarray (n_bases,)
        Logarithms of their probabilities, up to a constant.
    diagnosis : ModeDiagnosis or None
        Of what is missing in both states; None where the calibrated model stands.
    """

    first: Calibrated
    bases: tuple[Calibrated, ...]
    log_weights: Floats
    diagnosis: ModeDiagnosis | None = None

    @property
    def weights(self) -> Floats:
        """Probabilities of the bases, of them together 1, (n_bases,)."""
        return np.exp(self.log_weights - np.logaddexp.reduce(self.log_weights))

    @property
    def causes(self) -> tuple[Explanation, ...]:
        """Effects that both states may lack; the change is searched with each."""
        d = self.diagnosis
        nothing = d is None or d.searched.search.known[frozenset()].score > d.searched.unknown
        return tuple(
            Explanation(e, tuple(parameters_of(x, b.fitted) for x in e), float(w), bool(e) or nothing)
            for b, w in zip(self.bases, self.weights, strict=True)
            for e in (b.fitted.effects,)
        )

    @property
    def texts(self) -> tuple[str, ...]:
        """By how much the calibrated model misses the first state, and what that is put down to."""
        if self.diagnosis is None:
            return ()
        off = self.first.missed
        worst = [int(k) for k in np.argsort(-np.nan_to_num(np.abs(off)))[:MOST_NAMED] if np.isfinite(off[k])]
        modes = ", ".join(f"mode {k + 1} by {abs(off[k]):.2g} σ" for k in worst)
        shares = "; ".join(f"{percent(c.probability)} {c.label}" for c in self.causes)
        return (
            f"the baseline is poor: the calibrated model misses it in {modes}, and something may be missing "
            "in both states",
            f"the change was searched for together with each cause that both states may have: {shares}",
        )


def searched_modes(search: Search[ModeProblem], model: Model, say: Progress) -> Searched[ModeProblem]:
    """Return a search by modes of a model that has ended, with all that the data see in its posterior."""
    done = searched(Searched(search, search.full((), ()), (), float("nan"), model), say)
    if not done.finished:
        return done
    try:
        with ending_early():
            search.promise_rest(search.known[frozenset()])
            search.fit_promised()
            weigh_elsewhere(search)
            return search_promised(done).answered()
    except EndEarlyError:
        search.end_early()
        return replace(done, best=search.best, finished=False)


def candidates_for(
    model: Model, targets: ModeTargets, kinds: Sequence[str] | None, exclude: Sequence[str]
) -> tuple[Effect, ...]:
    """Return the candidates that measured modes can speak of.

    Not the form's, nor what depends on amplitude; and without damping ratios nothing that dissipates, unless
    its kind is asked for: it would stand for the stiffness that comes with it.
    """
    every = [e for e in propose(model, kinds, exclude) if not (e.is_form or e.amplitude_dependent)]
    if kinds is None and not np.isfinite(targets.zeta).any():
        every = [e for e in every if Role.DISSIPATION not in e.role]
    return tuple(every)


def concluded(done: Searched[ModeProblem]) -> ModeDiagnosis:
    """Return what a search by modes has to tell."""
    search, best, problem = done.search, done.best, done.search.fits.problem
    verdict = verdict_of(done)
    nothing, final = search.known[frozenset()], _reported(done)
    found = best.effects if verdict in (EFFECT, UNFINISHED) else ()
    bad, every = _bad_readings(done, problem), explanations_of(done)
    images = images_of(done, final) if found else ()
    out = ModeDiagnosis(
        verdict=verdict,
        reason="",
        findings=tuple(Finding(e, parameters_of(e, final.fitted), ()) for e in found),
        explanations=every,
        images=tuple(x for x in every if any(x.effects is h.effects for h in images)),
        posterior=posterior_of(done),
        candidates=search.candidates,
        modes=_table(problem, nothing, final, bad),
        places=tuple((s.name, s.residual_ratio) for s in search.scanned),
        model=fitted_model(done.model, final.fitted),
        problem=problem.with_forces_of(final.fitted),
        searched=done,
        notes=_notes(problem),
        seconds=0.0,
        bad_readings=tuple(b for b in bad if b.probability >= HALF),
    )
    reason = "; ".join([_reason(out), *_unexplained(out)])
    return replace(out, reason=reason, next_measurements=_next(out) if done.finished else ())


def _reported(done: Searched[ModeProblem]) -> ScoredFit:
    return done.best if done.explains or not done.finished else done.search.known[frozenset()]


def _next(d: ModeDiagnosis) -> tuple[str, ...]:
    """Return what would tell the answer from its image, or the first two of the credible set apart."""
    n = min(2, sum(e.known for e in d.credible))
    likely = sorted(d.searched.weighed, key=lambda h: -h.score)[:n]
    if d.images:
        likely = [h for x in (d.reported, d.images[0]) for h in d.searched.weighed if h.effects is x.effects]
    models = [fitted_model(d.searched.model, h.fitted) for h in likely]
    t = d.problem.targets
    return next_measurements(d.searched.model, models, t.n, float(t.frequency[-1]))


def _bad_readings(done: Searched[ModeProblem], problem: ModeProblem) -> list[BadReading]:
    """Return how probable it is over all hypotheses that each reading does not belong.

    What the library does not have may explain any reading.
    """
    readings = problem.readings()
    total = np.zeros(len(readings))
    for h in done.hypotheses:
        levels = h.fitted.levels
        assert isinstance(levels, ModeLevels)
        total += done.probability(h) * levels.is_bad(h.fitted.misfit)
    f = problem.targets.frequency
    return [BadReading(r, float(f[r.mode]), float(p)) for r, p in zip(readings, total, strict=True)]


def _table(
    problem: ModeProblem, nothing: ScoredFit, final: ScoredFit, readings: Sequence[BadReading]
) -> ModeTable:
    t = problem.targets
    bad = np.full(t.n, np.nan)
    for b in readings:
        if b.reading.kind == FREQUENCY:
            bad[b.reading.mode] = b.probability
    nominal, fitted = problem.believed.computed(problem.nominal()), problem.computed(nothing.fitted)
    found = problem.computed(final.fitted)
    steps = {"nominal": nominal, "fitted": fitted, "found": found}
    return replace(ModeTable.of(t, steps), found_std=problem.predicted_std(final.fitted), bad=bad)


def _reason(d: ModeDiagnosis) -> str:
    """Return why the verdict is what it is."""
    kind = _deciding(d)
    before, after = (f"{100 * d.modes.error_of(kind, step):.2g}" for step in (1, -1))
    others = [
        f"{100 * error:.2g} % of the {QUANTITIES[other]}"
        for other in QUANTITIES
        if other != kind and np.isfinite(error := d.modes.error_of(other, -1))
    ]
    text = reason_of(
        d,
        d.searched,
        f"error of the {QUANTITIES[kind]}{',' if kind == SHAPE else ''}",
        "%",
        before,
        after,
        _lead_error(d),
        f" ({', '.join(others)})" * bool(others),
    )
    if d.images:
        labelled = " or ".join(labels(e.effects) for e in d.images)
        image = "mirror image" if len(d.images) == 1 else "mirror images"
        text += f", as does its {image}, {labelled}: these data cannot tell which is there"
    n = len([e for e in d.credible if e not in d.images])
    shared = f"{len(d.credible)} explanations share {CREDIBLE:.0%}".replace("%", " %")
    if d.verdict == EFFECT and not d.sure:
        none = ", none is sure" if d.explanations[0].probability < HALF else ""
        which = "first" if d.reported is d.explanations[0] else "simplest that is nearly as probable"
        text = f"{shared}{none}; the {which}, {percent(d.reported.probability)}: {text}"
    elif n > 1 and d.verdict not in (UNEXPLAINED, UNFINISHED):
        text = f"{text}; {shared}"
    return "; ".join([text, *(b.text for b in d.bad_readings)])


def _deciding(d: ModeDiagnosis) -> int:
    """Return the kind of reading by which effects raise the likelihood most; frequencies without effects."""
    before, after = d.searched.search.known[frozenset()].fitted, d.final.fitted
    levels = after.levels
    if not d.found:
        return FREQUENCY
    assert isinstance(levels, ModeLevels)
    # The likelihood is a product over the kinds, of which the rest stays as it was without effects.
    costs = {
        k: levels.cost(np.where(levels.kind == k, after.misfit, before.misfit))
        for k in np.unique(levels.kind)
    }
    return min(costs, key=lambda k: costs[k])


def _unexplained(d: ModeDiagnosis) -> tuple[str, ...]:
    """Return which readings the best explanation leaves, where it explains too little."""
    if d.verdict != UNEXPLAINED:
        return ()
    problem, lead, f = d.problem, d.searched.lead, d.problem.targets.frequency
    beyond = np.sqrt(lead.fitted.misfit / problem.allowed_squares())
    readings = problem.readings()
    worst = [k for k in np.argsort(-beyond)[:MOST_NAMED] if beyond[k] > 1]
    if not worst:
        return ()
    each = [
        f"the {readings[k].words} of mode {readings[k].mode + 1} ({f[readings[k].mode]:.5g} Hz) "
        f"is off by {beyond[k]:.2g} times the error that a right model may leave"
        for k in worst
    ]
    what = f"with {labels(lead.effects)}" if lead.effects else "without effects"
    return (f"{what}, {', and '.join(each)}",)


def _lead_error(d: ModeDiagnosis) -> str:
    """Return the error of the best explanation that explains too little; empty without effects."""
    lead, m = d.searched.lead, d.modes
    if d.verdict != UNEXPLAINED or not lead.effects:
        return ""
    return f"{100 * m.errors(d.problem.computed(lead.fitted).frequency, False):.2g}"


def _notes(problem: ModeProblem) -> tuple[str, ...]:
    t, out = problem.targets, []
    n = n_below(problem)
    if not t.directed and n > t.n:
        out.append(
            f"the {t.n} frequencies are paired in order with some of the model's {n} modes in their range: "
            "torsional, axial and other modes that the test has not seen may be among the partners. Sensors "
            "and forces of the test, its plane, or the numbers of the modes exclude them"
        )
    if not t.has_shapes:
        out.append(
            f"{len(t.fitted)} natural frequencies without shapes hardly locate an effect: read the "
            "explanations as a set"
        )
    if not np.isfinite(t.zeta).any():
        out.append("no damping ratios are given: the data do not determine damping")
    return tuple(out)
