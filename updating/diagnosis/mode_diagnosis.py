"""From a model and measured modes to the posterior over what is missing."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fem.declarations import Role
from fem.model import Effect, Model
from fem.summary import percent
from updating.diagnosis.candidates import propose, situated
from updating.diagnosis.diagnosis import EFFECT, NOTHING, UNEXPLAINED
from updating.diagnosis.elsewhere import weigh_elsewhere
from updating.diagnosis.evidence.diagnosis import UNKNOWN, Searched, search_progress, searched
from updating.diagnosis.evidence.hypothesis import Hypothesis, key_of
from updating.diagnosis.evidence.mode_ranking import ModeRanking
from updating.diagnosis.evidence.search import Search
from updating.diagnosis.findings import EffectParameter, labels, parameters_of
from updating.diagnosis.mode_separation import next_measurements
from updating.diagnosis.unfitted import weigh_unfitted
from updating.inference.defaults import EXPLAINED_LEVEL
from updating.inference.fit_result import FitResult
from updating.inference.formed import Formed, formed_mode_problem
from updating.inference.heartbeat import Progress
from updating.inference.mode_fit import (
    BAD_PRIOR,
    FREQUENCY,
    LARGEST_DISCREPANCY,
    ComputedModes,
    ModeProblem,
    ModeReading,
    n_below,
)
from updating.inference.mode_targets import ModeTargets
from updating.inference.parameters import Nuisance
from updating.inference.preparation import fitted_model
from updating.least_squares.mode_levels import ModeLevels

CREDIBLE = 0.9
"""Probability that the explanations of a credible set have together [-]."""
MOST_NAMED = 3
"""Modes that are named as missed."""
HALF = 0.5
"""An explanation that is less probable than all others together is not put first in words [-]."""


@dataclass(frozen=True, slots=True, eq=False)
class Explanation:
    """One way to explain the data.

    Attributes
    ----------
    effects : tuple of Effect
        At their fitted values; none for "nothing missing".
    parameters : tuple of tuple of EffectParameter
        Of each effect.
    probability : float
    known : bool
        False for what the library does not have.
    """

    effects: tuple[Effect, ...]
    parameters: tuple[tuple[EffectParameter, ...], ...]
    probability: float
    known: bool = True

    @property
    def label(self) -> str:
        """Effects and places in words."""
        if not self.known:
            return "something that the library does not have"
        return labels(self.effects) if self.effects else "nothing missing"


@dataclass(frozen=True, slots=True, eq=False)
class ModeTable:
    """Measured modes and their computed partners, (n,) each; NaN where there is none.

    Attributes
    ----------
    measured, std : ndarray
        Frequencies [Hz] and their relative standard deviations [-].
    nominal, fitted, found : ndarray
        Frequencies of the nominal model, of the fitted one, and of that with what was found [Hz].
    zeta, zeta_found : ndarray
        Damping ratios, measured and of the model with what was found [-].
    mac_nominal, mac_found : ndarray
        Modal assurance criteria.
    held_out : ndarray of bool
        Modes that no fit has seen: they are predicted.
    found_std : ndarray
        Relative standard deviations of ``found`` where a mode is predicted [-].
    bad : ndarray
        Probability that the frequency does not belong to the structure's model; NaN where it was held out.
    """

    measured: NDArray[np.float64]
    std: NDArray[np.float64]
    nominal: NDArray[np.float64]
    fitted: NDArray[np.float64]
    found: NDArray[np.float64]
    zeta: NDArray[np.float64]
    zeta_found: NDArray[np.float64]
    mac_nominal: NDArray[np.float64]
    mac_found: NDArray[np.float64]
    held_out: NDArray[np.bool_]
    found_std: NDArray[np.float64]
    bad: NDArray[np.float64]

    @property
    def belongs(self) -> NDArray[np.bool_]:
        """Whether each mode is more probably the model's than not."""
        return ~(self.bad >= HALF)

    def predicted_text(self, k: int) -> str:
        """Return a predicted frequency with its standard deviation."""
        return f"{self.found[k]:.5g} ± {self.found[k] * self.found_std[k]:.2g} Hz"

    def errors(self, computed: NDArray[np.float64], held_out: bool) -> float:
        """Return the root mean square of ln f ratios of modes that were fitted, or held out [-].

        Without those that do not belong.
        """
        return frequency_error(self.measured, computed, (self.held_out == held_out) & self.belongs)


def frequency_error(
    measured: NDArray[np.float64], computed: NDArray[np.float64], some: NDArray[np.bool_]
) -> float:
    """Return the root mean square of ln f ratios of some modes, NaN where none has a partner [-]."""
    some = some & np.isfinite(computed)
    if not some.any():
        return float("nan")
    return float(np.sqrt(np.mean(np.log(computed[some] / measured[some]) ** 2)))


@dataclass(frozen=True, slots=True)
class BadReading:
    """A frequency, damping ratio or shape that probably does not belong to the structure's model.

    Attributes
    ----------
    reading : ModeReading
    frequency : float
        Of the measured mode [Hz].
    probability : float
    """

    reading: ModeReading
    frequency: float
    probability: float

    @property
    def text(self) -> str:
        """A sentence without a full stop."""
        mode = f"mode {self.reading.mode + 1} ({self.frequency:.5g} Hz)"
        subject = mode if self.reading.kind == FREQUENCY else f"the {self.reading.words} of {mode}"
        return f"{subject} does not belong to the structure's model: probability {percent(self.probability)}"


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
    def missed(self) -> NDArray[np.float64]:
        """By how many standard deviations of noise it misses each frequency, NaN without a partner, (n,)."""
        t = self.problem.targets
        return np.log(self.computed.frequency / t.frequency) / t.frequency_std

    @property
    def form_share(self) -> NDArray[np.float64]:
        """Share of the residuals that is the model's error: of frequencies, damping and shapes, (3,) [-].

        By the size of the residuals, also where a study says that the form is right: what the model lacks in
        the first state, it lacks in the second one.
        """
        fit = self.fitted.levels
        assert isinstance(fit, ModeLevels)
        out = np.zeros(len(LARGEST_DISCREPANCY))
        levels = ModeLevels.up_to(
            fit.kind, fit.n, fit.size, fit.variance, LARGEST_DISCREPANCY[fit.kind], fit.bad, fit.bad_prior
        )
        out[fit.kind] = levels.discrepancy_share(self.fitted.misfit)
        return out


@dataclass(frozen=True, slots=True, eq=False)
class ModeDiagnosis:
    """What is missing by measured modes, and how sure that is.

    Attributes
    ----------
    verdict : str
        ``"nothing missing"``, ``"effect"`` or ``"unexplained"``.
    reason : str
        Why, in a sentence.
    explanations : tuple of Explanation
        All that were fitted, the most probable first.
    modes : ModeTable
    places : tuple of (str, float)
        Places by the share of the misfit that changes there leave, the best first [-].
    next_measurements : tuple of str
        What would tell the explanations of the credible set apart.
    model : Model
        With fitted parameters and found effects.
    problem : ModeProblem
    searched : Searched
    notes : tuple of str
    seconds : float
    baseline : Calibrated or None
        The fit to an earlier state, where the change since then was searched for.
    bad_readings : tuple of BadReading
        More probable than not.
    judged : Baseline or None
        What that state says of the model.
    """

    verdict: str
    reason: str
    explanations: tuple[Explanation, ...]
    modes: ModeTable
    places: tuple[tuple[str, float], ...]
    next_measurements: tuple[str, ...]
    model: Model
    problem: ModeProblem
    searched: Searched[ModeProblem]
    notes: tuple[str, ...]
    seconds: float
    baseline: Calibrated | None = None
    bad_readings: tuple[BadReading, ...] = ()
    judged: Baseline | None = None

    @property
    def final(self) -> Hypothesis:
        """The hypothesis of the verdict: that without effects where no explanation is believed."""
        return _reported(self.searched)

    @property
    def reported(self) -> Explanation:
        """The explanation of the verdict: simpler ones are reported where data do not require more."""
        if self.verdict == UNEXPLAINED:
            return next(e for e in self.explanations if not e.known)
        effects = self.final.effects
        same = [e for e in self.explanations if e.known and key_of(e.effects) == key_of(effects)]
        return next((e for e in same if e.effects == effects), same[0])

    @property
    def sure(self) -> bool:
        """Whether the explanation of the verdict is more probable than all others together."""
        return self.reported.probability >= HALF

    @property
    def credible(self) -> tuple[Explanation, ...]:
        """The fewest explanations that have ``CREDIBLE`` together."""
        before = np.cumsum([0.0, *(e.probability for e in self.explanations)])
        return tuple(e for e, p in zip(self.explanations, before, strict=False) if p < CREDIBLE)

    @property
    def noise_limit(self) -> float:
        """Relative deviation of frequencies that noise and the mesh account for [-]."""
        return self.searched.search.fits.floor

    @property
    def found(self) -> tuple[Effect, ...]:
        """Effects of the verdict."""
        return self.searched.best.effects if self.verdict == EFFECT else ()


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
    log_weights: NDArray[np.float64]
    diagnosis: ModeDiagnosis | None = None

    @property
    def weights(self) -> NDArray[np.float64]:
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


def search_modes(
    model: Model,
    targets: ModeTargets,
    nuisances: Sequence[Nuisance] = (),
    *,
    damping_std: float = 0.5,
    kinds: Sequence[str] | None = None,
    exclude: Sequence[str] = (),
    model_error: float = EXPLAINED_LEVEL,
    progress: Progress | None = None,
) -> Searched[ModeProblem]:
    """Search what a model lacks by measured modes; parameters as of :func:`diagnose_modes`."""
    start_time, say = time.perf_counter(), progress or (lambda text, done: None)
    say("reducing the model", 0.0)
    problem, made = formed_mode_problem(
        situated(model, kinds), targets, nuisances, damping_std=damping_std, model_error=model_error
    )
    problem = replace(problem, bad_prior=BAD_PRIOR)
    say("fitting the uncertain parameters", 0.05)
    candidates = candidates_for(made.model, targets, kinds, exclude)
    search = Search(problem, made.form, candidates, search_progress(say, start_time), ranking=ModeRanking())
    return searched_modes(search, made.formed, say)


def searched_modes(search: Search[ModeProblem], model: Model, say: Progress) -> Searched[ModeProblem]:
    """Return a search by modes of a model that has ended, with all that the data see in its posterior."""
    done = searched(Searched(search, search.full((), ()), (), float("nan"), model), say)
    weigh_unfitted(search)
    weigh_elsewhere(search)
    return done if search.best.score <= done.best.score else replace(done, best=search.polished(search.best))


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


def diagnose_modes(
    model: Model,
    targets: ModeTargets,
    nuisances: Sequence[Nuisance] = (),
    *,
    damping_std: float = 0.5,
    kinds: Sequence[str] | None = None,
    exclude: Sequence[str] = (),
    model_error: float = EXPLAINED_LEVEL,
    progress: Progress | None = None,
) -> ModeDiagnosis:
    """Find what a model lacks by measured natural frequencies, damping and shapes.

    The search, the priors and the posterior are those of
    :func:`updating.diagnosis.diagnose.diagnose`.

    Parameters
    ----------
    model : Model
        With a point of the mesh at every sensor.
    targets : ModeTargets
    nuisances : sequence of Nuisance
    damping_std : float
        Standard deviation of the logarithm of damping ratios [-].
    kinds, exclude : sequence of str, optional
        Kinds of candidates.
    model_error : float
        Level up to which a model of beams counts as right, as for FRFs [nepers]; 0 for a right form.
    progress : callable, optional
        Called with a text and the fraction done.
    """
    start_time = time.perf_counter()
    done = search_modes(
        model,
        targets,
        nuisances,
        damping_std=damping_std,
        kinds=kinds,
        exclude=exclude,
        model_error=model_error,
        progress=progress,
    )
    return concluded(done, start_time)


def concluded(done: Searched[ModeProblem], start_time: float) -> ModeDiagnosis:
    """Return what a search by modes has to tell; it began at a ``time.perf_counter()`` [s]."""
    search, best, problem = done.search, done.best, done.search.fits.problem
    explanations = [
        Explanation(h.effects, tuple(parameters_of(e, h.fitted) for e in h.effects), p)
        for h, p in _with_probabilities(done)
    ]
    explanations.append(Explanation((), (), done.unknown_probability, known=False))
    explanations.sort(key=lambda e: -e.probability)
    verdict = UNEXPLAINED if not done.explains else EFFECT if best.effects else NOTHING
    nothing, final = search.known[frozenset()], _reported(done)
    bad = _bad_readings(done, problem)
    table = _table(problem, nothing, final, bad)
    out = ModeDiagnosis(
        verdict=verdict,
        reason="",
        explanations=tuple(explanations),
        modes=table,
        places=tuple((s.name, s.residual_ratio) for s in search.scanned),
        next_measurements=(),
        model=fitted_model(done.model, final.fitted),
        problem=problem.with_forces_of(final.fitted),
        searched=done,
        notes=_notes(problem),
        seconds=0.0,
        bad_readings=tuple(b for b in bad if b.probability >= HALF),
    )
    return replace(
        out, reason=_reason(out), next_measurements=_next(out), seconds=time.perf_counter() - start_time
    )


def _with_probabilities(done: Searched[ModeProblem]) -> list[tuple[Hypothesis, float]]:
    """Return hypotheses with their probabilities: one of several searches is the same in all of them."""
    every = [(h, done.probability(h)) for h in done.hypotheses]
    if not done.otherwise:
        return every
    ways = [done, *done.otherwise]
    out = {h.key: (h, 0.0) for way in reversed(ways) for h in way.search.known.values()}
    alone = []
    for h, p in every:
        if any(way.search.known.get(h.key) is h for way in ways):
            best, sum_ = out[h.key]
            out[h.key] = best, sum_ + p
        else:
            alone.append((h, p))
    return [*out.values(), *alone]


def _reported(done: Searched[ModeProblem]) -> Hypothesis:
    return done.best if done.explains else done.search.known[frozenset()]


def _next(d: ModeDiagnosis) -> tuple[str, ...]:
    """Return what would tell the first two explanations of the credible set apart."""
    n = min(2, sum(e.known for e in d.credible))
    likely = sorted(d.searched.hypotheses, key=lambda h: -h.score)[:n]
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
    problem: ModeProblem, nothing: Hypothesis, final: Hypothesis, readings: Sequence[BadReading]
) -> ModeTable:
    t = problem.targets
    bad = np.full(t.n, np.nan)
    for b in readings:
        if b.reading.kind == FREQUENCY:
            bad[b.reading.mode] = b.probability
    nominal, fitted = problem.believed.computed(problem.nominal()), problem.computed(nothing.fitted)
    found = problem.computed(final.fitted)
    return ModeTable(
        measured=t.frequency,
        std=t.frequency_std,
        nominal=nominal.frequency,
        fitted=fitted.frequency,
        found=found.frequency,
        zeta=t.zeta,
        zeta_found=found.zeta,
        mac_nominal=nominal.mac,
        mac_found=found.mac,
        held_out=t.held_out,
        found_std=problem.predicted_std(final.fitted),
        bad=bad,
    )


def _reason(d: ModeDiagnosis) -> str:
    """Return why the verdict is what it is."""
    return "; ".join([_verdict_reason(d), *(b.text for b in d.bad_readings)])


def _verdict_reason(d: ModeDiagnosis) -> str:
    m, first, p = d.modes, d.explanations[0], percent(d.reported.probability)
    before, after = (f"{100 * m.errors(f, False):.2g} %" for f in (m.fitted, m.found))
    if d.verdict == UNEXPLAINED:
        lead = d.searched.lead
        so_far = f"; best so far, not explained: {labels(lead.effects)}" if lead.effects else ""
        return f"the frequencies stay {before} off, more than a right model leaves{so_far}"
    n = len(d.credible)
    many = f"; {n} explanations share {CREDIBLE:.0%}".replace("%", " %") if n > 1 else ""
    if d.verdict == NOTHING:
        return f"the fitted model's frequencies are {after} off; probability {p}{many}"
    place = percent(d.searched.probability_there(d.searched.best))
    lower = "bring" if len(d.found) > 1 else "brings"
    text = f"{labels(d.found)} {lower} the frequencies from {before} to {after}"
    if not d.sure:
        none = ", none is sure" if first.probability < HALF else ""
        which = "first" if d.reported is first else "simplest that is nearly as probable"
        shared = f"{n} explanations share {CREDIBLE:.0%}".replace("%", " %")
        return f"{shared}{none}; the {which}, {p}: {text}"
    return f"{text}; probability {p}, of the place {place}{many}"


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


__all__ = ["UNKNOWN", "ModeDiagnosis", "diagnose_modes", "search_modes"]
