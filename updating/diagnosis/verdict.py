"""The result of every search for missing effects, whatever was measured: verdict, effects, probabilities."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fem.model import Effect, Model
from fem.summary import counted, listed, percent, summary
from updating.diagnosis.departures import Departure
from updating.diagnosis.evidence.diagnosis import UNKNOWN, Searched
from updating.diagnosis.evidence.hypothesis import ScoredFit
from updating.diagnosis.findings import EffectParameter, Finding, Ranked, Step, labels, parameters_of
from updating.diagnosis.mode_table import HALF, ModeTable
from updating.inference.fit import FitProblem
from updating.inference.fit_result import FitResult
from updating.inference.mode_fit import FREQUENCY, ModeProblem, ModeReading
from updating.quality.faults import Fault

NOTHING, EFFECT, FAULT, UNEXPLAINED = "nothing missing", "effect", "measurement fault", "unexplained"
UNFINISHED = "not finished"
CREDIBLE = 0.9
"""Probability that the explanations of a credible set have together [-]."""
NOMINAL, FITTED = "nominal model", "uncertain parameters fitted"
"""Labels of the steps before effects."""
CALIBRATED = "calibrated on the baseline"
"""Label of the first step where the model was fitted to an earlier state."""

Posterior = tuple[tuple[tuple[str, ...], float], ...]
"""Hypotheses by the names of their effects, each with its probability [-]."""


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
    is_forecast : bool
        Whether no fit has tried it: values and probability are those of its forecast.
    """

    effects: tuple[Effect, ...]
    parameters: tuple[tuple[EffectParameter, ...], ...]
    probability: float
    known: bool = True
    is_forecast: bool = False

    def __repr__(self) -> str:
        """Return effects and probability on one line."""
        return summary(self, f"{self.label}: probability {percent(self.probability)}")

    @property
    def label(self) -> str:
        """Effects and places in words."""
        if not self.known:
            return "something that the library does not have"
        return labels(self.effects) if self.effects else "nothing missing"


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


@dataclass(frozen=True, slots=True)
class Stairs:
    """The error of the model after each step of a diagnosis.

    Attributes
    ----------
    rows : tuple of (str, float, float)
        Label of each step, and its errors on the data that were fitted and on those held out, NaN for none.
    floor : float
        Error that noise and the mesh leave.
    unit : str
        Of these errors: dB of FRFs, % of natural frequencies.
    """

    rows: tuple[tuple[str, float, float], ...]
    floor: float
    unit: str


@dataclass(frozen=True, slots=True, eq=False, kw_only=True, repr=False)
class Verdict:
    """What is missing, and how sure that is.

    Attributes
    ----------
    verdict : str
        ``"nothing missing"``, ``"effect"``, ``"measurement fault"``, ``"unexplained"``, or ``"not finished"``
        of a search that was ended early: the effects are then the best so far.
    reason : str
        Why, in a sentence.
    findings : tuple of Finding
    problem : FitProblem or ModeProblem
        Data, reduced model, sensors.
    model : Model
        The full model with fitted parameters and found effects.
    searched : Searched or None
        The search that led to it.
    modes : ModeTable or None
        Measured modes beside computed ones, of a diagnosis by modes alone.
    notes : tuple of str
        What a reader should know.
    seconds : float
    explanations : tuple of Explanation
        Hypotheses, and what the library does not have, the most probable first; of those that were not
        fitted the values are to the first order.
    posterior : tuple of (tuple of str, float)
        Names of the effects of each hypothesis, and its probability, the most probable first; the last is
        that of what the library does not have, under the name ``"unknown"``.
    candidates : tuple of Effect
        All that were looked at.
    places : tuple of (str, float)
        Places by the share of the misfit that changes there leave, the best first [-].
    baseline : CalibratedFrfs, Calibrated or None
        The fit to an earlier state, where the change since then was searched for.
    faults : tuple of Fault
        Of sensors and forces; the data are corrected for them.
    channel_faults : tuple of Fault
        Errors of channels far outside their tolerances, which the fitted model has: the data are not
        corrected for them. Empty where the model does not explain the data.
    bad_readings : tuple of BadReading
        Readings of modes that more probably do not belong to the structure's model.
    next_measurements : tuple of str
        What would tell the first two explanations apart.
    steps : tuple of Step
        From the nominal model over fitted nuisances to each added effect; none of a diagnosis by modes alone.
    rounds : tuple of tuple of Ranked
        For each round of the forward selection, the candidates that were fitted, best first.
    images : tuple of Explanation
        Mirror images of the reported explanation: no natural frequency tells them from it.
    departures : tuple of Departure
        Sections and connections whose form is outside its usual range.
    """

    verdict: str
    reason: str
    findings: tuple[Finding, ...]
    problem: FitProblem | ModeProblem
    model: Model
    searched: Searched | None
    modes: ModeTable | None
    notes: tuple[str, ...]
    seconds: float
    explanations: tuple[Explanation, ...] = ()
    posterior: Posterior = ()
    candidates: tuple[Effect, ...] = ()
    places: tuple[tuple[str, float], ...] = ()
    baseline: object | None = None
    faults: tuple[Fault, ...] = ()
    channel_faults: tuple[Fault, ...] = ()
    bad_readings: tuple[BadReading, ...] = ()
    next_measurements: tuple[str, ...] = ()
    steps: tuple[Step, ...] = ()
    rounds: tuple[tuple[Ranked, ...], ...] = ()
    images: tuple[Explanation, ...] = ()
    departures: tuple[Departure, ...] = ()

    def __repr__(self) -> str:
        """Return verdict, effects, probability, and the error after each step on one line."""
        effects = f": {listed(e.name for e in self.found)}" if self.found else ""
        alone = " of exactly this" if self.found else ""
        sure = f", probability{alone} {percent(self.reported.probability)}" if self.explanations else ""
        stairs = self.stairs
        errors = " → ".join(f"{fitted:.3g}" for _, fitted, _ in stairs.rows)
        return summary(self, f"{self.verdict}{effects}{sure}; error {errors} {stairs.unit}")

    @property
    def stairs(self) -> Stairs:
        """The error after each step."""
        raise NotImplementedError

    @property
    def calibration(self) -> tuple[FitProblem | ModeProblem, FitResult, Model]:
        """The fit of the uncertain parameters, and its model; of two states, that to the first one."""
        raise NotImplementedError

    @property
    def found(self) -> tuple[Effect, ...]:
        """Effects of the verdict."""
        return tuple(f.effect for f in self.findings)

    @property
    def every_fault(self) -> tuple[Fault, ...]:
        """Faults that the data are corrected for, and those that the fitted model has."""
        return (*self.faults, *self.channel_faults)

    @property
    def reported(self) -> Explanation:
        """The explanation of the verdict: simpler ones are reported where data do not require more.

        Raises
        ------
        ValueError
            If it was no search that led to the verdict.
        """
        if not self.explanations:
            msg = "no search led to this verdict; it has no explanations with probabilities"
            raise ValueError(msg)
        if self.verdict == UNEXPLAINED:
            return next(e for e in self.explanations if not e.known)
        names = {e.name for e in self.found}
        same = [e for e in self.explanations if e.known and {x.name for x in e.effects} == names]
        return next((e for e in same if e.effects == self.found), same[0])

    @property
    def sure(self) -> bool:
        """Whether the explanation of the verdict, or an image, is more probable than all others together."""
        return self.reported.probability + sum(e.probability for e in self.images) >= HALF

    @property
    def credible(self) -> tuple[Explanation, ...]:
        """The fewest explanations that have ``CREDIBLE`` together."""
        before = np.cumsum([0.0, *(e.probability for e in self.explanations)])
        return tuple(e for e, p in zip(self.explanations, before, strict=False) if p < CREDIBLE)


def posterior_of(done: Searched) -> Posterior:
    """Return all hypotheses of a search by the names of their effects; the last is the unknown cause.

    A hypothesis that several searches have is one, with the sum of its probabilities.
    """
    out = [(done.names(h), p) for h, p in _weighed(done)]
    return (*sorted(out, key=lambda each: -each[1]), ((UNKNOWN,), done.unknown_probability))


def explanations_of(done: Searched) -> tuple[Explanation, ...]:
    """Return the hypotheses of a search and the unknown cause, the most probable first."""
    fitted = {id(h) for h in done.hypotheses}
    out = [
        Explanation(
            h.effects,
            tuple(parameters_of(e, h.fitted) for e in h.effects),
            p,
            is_forecast=id(h) not in fitted,
        )
        for h, p in _weighed(done)
    ]
    out.append(Explanation((), (), done.unknown_probability, known=False))
    return tuple(sorted(out, key=lambda e: -e.probability))


def _weighed(done: Searched) -> list[tuple[ScoredFit, float]]:
    """Return hypotheses with their probabilities: one of several searches is the same in all of them."""
    evidence = done.evidence
    every = [(h, float(np.exp(h.score - evidence))) for h in done.weighed]
    if not done.otherwise:
        return every
    known = {id(h) for way in (done, *done.otherwise) for h in way.search.known.values()}
    same: dict[tuple[str, ...], tuple[ScoredFit, float]] = {}
    for h, p in every:
        if id(h) in known:
            first, others = same.get(done.names(h), (h, 0.0))
            same[done.names(h)] = first, others + p
    return [*same.values(), *((h, p) for h, p in every if id(h) not in known)]


def verdict_of(done: Searched, faults: Sequence[Fault] = ()) -> str:
    """Return what is most probable after a search."""
    if not done.finished:
        return UNFINISHED
    if not done.explains:
        return UNEXPLAINED
    return EFFECT if done.best.effects else FAULT if faults else NOTHING


def reason_of(
    d: Verdict, done: Searched, quantity: str, unit: str, before: str, after: str, lead: str, others: str = ""
) -> str:
    """Return why a verdict is what it is.

    Parameters
    ----------
    d : Verdict
    done : Searched
        The search that led to it.
    quantity, unit : str
        The error that effects lower, in words.
    before, after, lead : str
        Its values without effects, with those of the verdict, and with the best that explain too little.
    others : str
        What the verdict leaves of other quantities, in words; for one without effects.
    """
    if d.verdict == UNFINISHED:
        first = done.search.scanned[:1] if not d.found else ()
        text = f"the search was ended early; {done.search.so_far()}"
        text += f" instead of {before} {unit}" if d.found else ""
        return "; ".join([text, *(f"changes at {s.name} would explain most of it" for s in first)])
    if d.verdict == UNEXPLAINED:
        best = done.lead.effects
        so_far = f"; best so far, not explained: {labels(best)}, {lead} {unit}" if best else ""
        return f"the {quantity} stays at {before} {unit}{others}, more than a right model leaves{so_far}"
    if d.verdict == EFFECT:
        lower = "lower" if len(d.found) > 1 else "lowers"
        return f"{labels(d.found)} {lower} the {quantity} from {before} to {after} {unit}"
    if d.verdict == FAULT:
        n = counted(len(d.every_fault), "fault")
        return (
            f"with {n} of the measurement corrected, nothing improves the model further; {quantity} "
            f"{after} {unit}"
        )
    return f"no candidate improves the fitted model, whose {quantity} is {after} {unit}{others}"
