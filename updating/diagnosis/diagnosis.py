"""What a diagnosis tells: its verdict, what it has found, and how sure that is."""

from dataclasses import dataclass, field

import numpy as np

from fem.analysis.frf import FRF
from fem.array_types import Floats
from fem.model import Model
from fem.recent import Unsent
from updating.diagnosis.amplitude import deviation_at_level
from updating.diagnosis.carried import CalibratedFrfs
from updating.diagnosis.frf_modes import FrfModes
from updating.diagnosis.verdict import (
    Stairs,
    Verdict,
)
from updating.inference.fit import FitProblem
from updating.inference.fit_data import SYSTEMATIC_FROM
from updating.inference.fit_result import FitResult
from updating.quality.gates import Gates

DAMPED = "damping fitted"
"""Label of the second step where the model was fitted to an earlier state."""
N_CHECKED = 6
"""Lines at which the reduced basis is checked in the end."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True, repr=False)
class Diagnosis(Verdict):
    """What is missing by measured FRFs, and how sure that is.

    Attributes
    ----------
    problem : FitProblem
        Data, reduced model, sensors: what is needed to compute the FRFs of any step.
    baseline : CalibratedFrfs or None
        The fit to an earlier state, where the change since then was searched for.
    noise_db, discretisation_db, basis_db : float
        Noise of the measurement, error of the mesh, and error of the reduced basis [dB].
    limit : float
        Residual level up to which the model counts as right [nepers].
    noise_limit : float
        Residual level that noise and the mesh leave [nepers].
    gates : Gates or None
        What was checked of the measurement before effects were searched for.
    identified : FrfModes or None
        Modes in the compared FRFs, where the diagnosis needed them.
    """

    problem: FitProblem
    baseline: CalibratedFrfs | None = None
    noise_db: float
    discretisation_db: float
    basis_db: float
    limit: float
    noise_limit: float
    gates: Gates | None = None
    identified: FrfModes | None = None
    # tables, pictures and files all show the same FRFs and bands
    _computed: Unsent = field(default_factory=lambda: Unsent(limit=8), init=False)

    @property
    def stairs(self) -> Stairs:
        """Error of the FRFs after each step [dB]."""
        rows = tuple((s.label, s.fit_db, s.held_out_db) for s in self.steps)
        return Stairs(rows, self.noise_floor_db, "dB")

    @property
    def calibration(self) -> tuple[FitProblem, FitResult, Model]:
        """The fit of the uncertain parameters, and its model; of two states, that to the first one."""
        if self.baseline is not None:
            return self.baseline.problem, self.baseline.result, self.baseline.model
        return self.problem, self.steps[-1].result, self.model

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
        step = range(len(self.steps))[step]
        return self._computed.get(("frf", step), lambda: self.problem.frf(self.steps[step].result))

    def deviation(self, step: int) -> Floats | None:
        """Return the standard deviation of the ln|H| that a step predicts; None for the nominal model."""
        step = range(len(self.steps))[step]
        return self._computed.get(("deviation", step), lambda: self._deviation(step))

    def _deviation(self, step: int) -> Floats | None:
        result = self.steps[step].result
        if any(e.amplitude_dependent for e in result.effects):
            return deviation_at_level(self.problem, result)
        return self.problem.deviation(result)

    @property
    def measured(self) -> FRF:
        """The measured FRFs as they were compared: in the band, wrong signs set right."""
        return self.problem.measured
