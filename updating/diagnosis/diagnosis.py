"""What a diagnosis tells: its verdict, what it has found, and how sure that is."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fem.analysis.frf import FRF
from fem.model import Effect, Model
from fem.summary import listed, summary
from updating.diagnosis.amplitude import deviation_at_level
from updating.diagnosis.carried import CalibratedFrfs
from updating.diagnosis.departures import Departure
from updating.diagnosis.evidence.diagnosis import Searched
from updating.diagnosis.findings import Finding, Ranked, Step
from updating.inference.fit import FitProblem
from updating.inference.fit_data import SYSTEMATIC_FROM
from updating.quality.faults import Fault
from updating.quality.gates import Gates

NOTHING, EFFECT, FAULT, UNEXPLAINED = "nothing missing", "effect", "measurement fault", "unexplained"
FITTED = "uncertain parameters fitted"
"""Label of the step before effects."""
CALIBRATED, DAMPED = "calibrated on the baseline", "damping fitted"
"""Labels of the first two steps where the model was fitted to an earlier state."""
N_CHECKED = 6
"""Lines at which the reduced basis is checked in the end."""


@dataclass(frozen=True, slots=True, eq=False)
class Diagnosis:
    """What is missing, and how sure that is.

    Attributes
    ----------
    verdict : str
        ``"nothing missing"``, ``"effect"``, ``"measurement fault"`` or ``"unexplained"``.
    reason : str
        Why, in a sentence.
    findings : tuple of Finding
    faults : tuple of Fault
    steps : tuple of Step
        From the nominal model over fitted nuisances to each added effect.
    rounds : tuple of tuple of Ranked
        For each round of the forward selection, the candidates that were fitted, best first.
    noise_db, discretisation_db, basis_db : float
        Noise of the measurement, error of the mesh, and error of the reduced basis [dB].
    limit : float
        Residual level up to which the model counts as right [nepers].
    noise_limit : float
        Residual level that noise and the mesh leave [nepers].
    problem : FitProblem
        Data, reduced model, sensors: what is needed to compute the FRFs of any step.
    model : Model
        The full model with fitted parameters and found effects.
    notes : tuple of str
        What a reader should know.
    seconds : float
    gates : Gates or None
        What was checked of the measurement before effects were searched for.
    candidates : tuple of Effect
        All that were looked at.
    posterior : tuple of (tuple of str, float)
        Names of the effects of each hypothesis, and its probability, the most probable first; the last is
        that of what the library does not have, under the name ``"unknown"``.
    places : tuple of (str, float)
        Places by the share of the misfit that free forces there leave, the best first [-].
    searched : Searched or None
        The search that led to it.
    baseline : CalibratedFrfs or None
        The fit to an earlier state, where the change since then was searched for.
    departures : tuple of Departure
        Sections and connections whose form is outside its usual range.
    channel_faults : tuple of Fault
        Errors of channels far outside their tolerances, which the fitted model has: the data are not
        corrected for them. Empty where the model does not explain the data.
    """

    verdict: str
    reason: str
    findings: tuple[Finding, ...]
    faults: tuple[Fault, ...]
    steps: tuple[Step, ...]
    rounds: tuple[tuple[Ranked, ...], ...]
    noise_db: float
    discretisation_db: float
    basis_db: float
    limit: float
    noise_limit: float
    problem: FitProblem
    model: Model
    notes: tuple[str, ...]
    seconds: float
    gates: Gates | None = None
    candidates: tuple[Effect, ...] = ()
    posterior: tuple[tuple[tuple[str, ...], float], ...] = ()
    places: tuple[tuple[str, float], ...] = ()
    searched: Searched[FitProblem] | None = None
    baseline: CalibratedFrfs | None = None
    departures: tuple[Departure, ...] = ()
    channel_faults: tuple[Fault, ...] = ()

    def __repr__(self) -> str:
        """Return verdict, reason and staircase of the error on one line."""
        steps = " → ".join(f"{s.fit_db:.2f}" for s in self.steps)
        found = listed(f.effect.name for f in self.findings)
        return summary(self, f"{self.verdict}: {self.reason}; found: {found}; error {steps} dB")

    @property
    def every_fault(self) -> tuple[Fault, ...]:
        """Faults that the data are corrected for, and those that the fitted model has."""
        return (*self.faults, *self.channel_faults)

    @property
    def more_than_noise(self) -> bool:
        """Whether the residual exceeds noise and the mesh's error: the form of beams, or weak effects.

        By the margin of fits, as noise is not known exactly.
        """
        return self.steps[-1].level > SYSTEMATIC_FROM * self.noise_limit

    @property
    def noise_floor_db(self) -> float:
        """Noise and the model's discretisation error together [dB]."""
        return float(np.hypot(self.noise_db, self.discretisation_db))

    def frf(self, step: int) -> FRF:
        """Return the FRFs of a step in the kind of the measurement."""
        return self.problem.frf(self.steps[step].result)

    def deviation(self, step: int) -> NDArray[np.float64] | None:
        """Return the standard deviation of the ln|H| that a step predicts; None for the nominal model."""
        result = self.steps[step].result
        if any(e.amplitude_dependent for e in result.effects):
            return deviation_at_level(self.problem, result)
        return self.problem.deviation(result)

    @property
    def measured(self) -> FRF:
        """The measured FRFs as they were compared: in the band, wrong signs set right."""
        return self.problem.measured
