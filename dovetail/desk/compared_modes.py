"""Modes of a hypothesis compared with measured ones, given by the study or identified in its FRFs."""

from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from dovetail.desk.saving import model_of
from dovetail.file.measured_modes import MeasuredModes
from dovetail.modes_pipeline import as_measured, comac_of
from dovetail.pipeline import Progress
from dovetail.study import Study
from fem.analysis.frf import FRF
from fem.analysis.modes import Modes
from fem.model import Model
from updating.correlation import ModeComparison, compare_modes
from updating.diagnosis.fitted_modes import damped_modes
from updating.diagnosis.frf_modes import modes_in, with_more_sensors
from updating.live.engine import LiveModel
from updating.live.hypothesis import Hypothesis
from updating.measurement.measurement import sensor_rows
from updating.modal.identification import IdentificationError
from updating.modal.identified_modes import IdentifiedModes

BEYOND = 1.05
"""Modes up to this multiple of the highest measured frequency are computed [-]."""


@dataclass(frozen=True, slots=True, eq=False)
class ComparedModes:
    """Measured and computed modes, and which belong together.

    Attributes
    ----------
    hypothesis : Hypothesis
    model : Model
        The full model of the hypothesis.
    measured : MeasuredModes
    computed : Modes
        With a row for every DOF of the model's mesh.
    comparison : ModeComparison
    comac : ndarray (n_sensors,)
        Coordinate modal assurance criterion of each sensor over the pairs [-].
    notes : tuple of str
        Warnings of the identification.
    identified : (FRF, IdentifiedModes) or None
        What the measured modes were identified in, and the identification; None if the study has modes.
    """

    hypothesis: Hypothesis
    model: Model
    measured: MeasuredModes
    computed: Modes
    comparison: ModeComparison
    comac: NDArray[np.float64]
    notes: tuple[str, ...]
    identified: tuple[FRF, IdentifiedModes] | None = None

    @property
    def mac(self) -> NDArray[np.float64]:
        """MAC of measured with elastic computed modes, (n_measured, n_elastic) [-]."""
        return self.comparison.mac[:, self.computed.n_rigid :]

    @property
    def partner(self) -> dict[int, int]:
        """The elastic computed mode of each measured one that has a partner, both from 0."""
        return {i: j - self.computed.n_rigid for i, j in self.comparison.pairs}

    def frequencies(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the natural frequencies of measured and of elastic computed modes [Hz]."""
        return self.measured.modes.frequency, self.computed.frequency[self.computed.n_rigid :]


def compared_modes(
    study: Study, live: LiveModel, h: Hypothesis, known: ComparedModes | None, progress: Progress
) -> ComparedModes:
    """Return the modes of a hypothesis beside the measured ones.

    Parameters
    ----------
    study : Study
    live : LiveModel
    h : Hypothesis
    known : ComparedModes or None
        An earlier result: modes in the same FRFs are not identified again.
    progress : callable
        Called with a text and the fraction done; an exception from it ends the work.

    Raises
    ------
    IdentificationError
        For amplitudes without phase.
    StudyError
        If no mode is found.
    """
    if known is not None and (known.hypothesis.faults, known.hypothesis.off) == (h.faults, h.off):
        measured, notes, identified = known.measured, known.notes, known.identified
    elif study.modes is not None and study.modes.has_shapes:
        measured, notes, identified = study.modes, (), None
    else:
        progress("identifying modes in the measured FRFs", 0.05)
        measured, notes, identified = _identified(study, live, h)
    progress("computing the modes of the model", 0.9)
    model = model_of(study, live, h)
    top = BEYOND * float(measured.modes.frequency.max())
    computed = damped_modes(model, live.problem.damping, h.zeta, top)
    rows = sensor_rows(model, measured.sensors)
    comparison = compare_modes(measured.modes, computed, rows)
    known_at = comac_of(measured, computed, comparison, rows)
    return ComparedModes(h, model, measured, computed, comparison, known_at, notes, identified)


def _identified(
    study: Study, live: LiveModel, h: Hypothesis
) -> tuple[MeasuredModes, tuple[str, ...], tuple[FRF, IdentifiedModes]]:
    """Return the modes in the FRFs as a hypothesis believes them, without sensors that are left out."""
    frf = live.evaluate(h).measured
    if not frf.has_phase:
        msg = "the measured FRFs are amplitudes; modes are identified from FRFs with phase"
        raise IdentificationError(msg)
    counted = [name for name in frf.outputs if name not in h.off]
    data = live.data_of(h).measurement.with_frf(frf.select(counted))
    data = with_more_sensors(data, study.model)
    found, notes = modes_in(data, study.band, **asdict(study.shape_limits))
    return as_measured(found, data), notes, (data.frf, found)
