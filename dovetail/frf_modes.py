"""Modes identified in the FRFs that a diagnosis compared, beside those of its models."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.file.contents import StudyContents
from dovetail.file.measured_modes import MeasuredModes
from dovetail.file.table import StudyError
from dovetail.modes_pipeline import as_measured, modes_in, with_more_sensors
from fem.analysis.modes import Modes
from updating.correlation import ModeComparison, comac, compare_modes
from updating.diagnosis.diagnosis import Diagnosis
from updating.measurement.measurement import sensor_rows, with_resting_base
from updating.modal.identification import IdentificationError


@dataclass(frozen=True, slots=True, eq=False)
class ModesInFrfs:
    """Modes in measured FRFs, and their partners in the nominal and in the reported model.

    Attributes
    ----------
    measured : MeasuredModes
    computed : Modes
        Of the reported model.
    comparisons : mapping of str to ModeComparison
        ``"nominal"`` and ``"reported"``.
    comac : ndarray (n_sensors,)
        Coordinate modal assurance criterion of each sensor over the pairs of the reported model [-].
    """

    measured: MeasuredModes
    computed: Modes
    comparisons: Mapping[str, ModeComparison]
    comac: NDArray[np.float64]

    @property
    def mac(self) -> NDArray[np.float64]:
        """MAC of measured with elastic computed modes of the reported model, (n_measured, n_elastic) [-]."""
        return self.comparisons["reported"].mac[:, self.computed.n_rigid :]

    def partners(self, model: str) -> dict[int, tuple[int, float, float]]:
        """Return number, frequency [Hz] and MAC of each measured mode's partner in one of the models."""
        c = self.comparisons[model]
        return {i: (j, float(c.frequency_computed[j]), float(c.mac[i, j])) for i, j in c.pairs}

    def rows(self) -> list[dict[str, Any]]:
        """Return a mapping for each measured mode, with None where it has no partner."""
        modes, nominal, reported = self.measured.modes, *map(self.partners, ("nominal", "reported"))
        nowhere = None, None, None
        out = []
        for i, f in enumerate(modes.frequency):
            (_, before, mac_before), (j, after, mac_after) = (p.get(i, nowhere) for p in (nominal, reported))
            zeta = None if j is None or self.computed.zeta is None else float(self.computed.zeta[j])
            out.append(
                {"measured_Hz": float(f), "nominal_Hz": before, "reported_Hz": after}
                | {"damping_measured": None if modes.zeta is None else float(np.real(modes.zeta[i]))}
                | {"damping_reported": zeta, "mac_nominal": mac_before, "mac_reported": mac_after}
            )
        return out


def modes_in_frfs(study: StudyContents, d: Diagnosis, nominal: Modes, reported: Modes) -> ModesInFrfs | None:
    """Identify modes in the measured FRFs and pair them with computed ones.

    None where the study has measured modes, or where the FRFs do not allow it: amplitudes without phase, or
    no mode that stands out.

    Parameters
    ----------
    study : StudyContents
    d : Diagnosis
    nominal, reported : Modes
        Of the nominal and of the reported model, with a row for every DOF.
    """
    frf = d.measured
    if d.problem.modes is not None or not frf.has_phase:
        return None
    try:
        data = with_more_sensors(d.problem.data.measurement.with_frf(frf), study.model)
        found, _ = modes_in(data, study.band, study.shape_limits)
        measured = as_measured(found, data)
    except (IdentificationError, StudyError):
        return None
    rows = sensor_rows(d.model, measured.sensors)
    before = sensor_rows(with_resting_base(d.problem.reduced.model), measured.sensors)
    pairs = {
        "nominal": compare_modes(measured.modes, nominal, before),
        "reported": compare_modes(measured.modes, reported, rows),
    }
    same = np.array(pairs["reported"].pairs, dtype=np.int64).reshape(-1, 2)
    known = np.full(len(rows), np.nan)
    if len(same) > 1:  # of one pair all values are 1
        known = comac(measured.modes.shapes[:, same[:, 0]], rows @ reported.shapes[:, same[:, 1]])
    return ModesInFrfs(measured, reported, pairs, known)
