"""Modes of the model that a diagnosis from modes reports, compared with the measured ones."""

from dataclasses import dataclass, replace

import numpy as np

from fem.analysis.modes import Modes
from fem.array_types import Floats, Ints
from updating.diagnosis.fitted_modes import damped_modes
from updating.diagnosis.mode_diagnosis import ModeDiagnosis
from updating.inference.mode_targets import mac_of
from updating.measurement.measurement import sensor_rows

BEYOND = 1.05
"""Modes up to this multiple of the highest frequency, measured or of a partner, are computed [-]."""


@dataclass(frozen=True, slots=True, eq=False)
class ReportedModes:
    """Modes of the reported model, with a row for every DOF of its mesh.

    Attributes
    ----------
    modes : Modes
        Without damping ratios where none was measured.
    partner : ndarray of int (n,)
        The mode of each measured one; -1 for none.
    mac : ndarray (n, n_elastic) or None
        Modal assurance criteria of measured shapes with those of elastic modes; None without shapes.
    """

    modes: Modes
    partner: Ints
    mac: Floats | None


def reported_modes(d: ModeDiagnosis) -> ReportedModes:
    """Compute the modes of the reported model in the band of the measured ones."""
    t, result = d.problem.targets, d.final.fitted
    computed = d.problem.computed(result)
    top = BEYOND * float(np.nanmax([t.frequency[-1], *computed.frequency]))
    modes = damped_modes(d.model, d.problem.damping, result.zeta, top)
    if not np.isfinite(t.zeta).any():
        modes = replace(modes, zeta=None)
    partner = np.where(computed.partner < modes.n_modes, computed.partner, -1)
    if not t.has_shapes:
        return ReportedModes(modes, partner, None)
    elastic = modes.shapes[:, modes.n_rigid :]
    return ReportedModes(modes, partner, mac_of(t.shapes, sensor_rows(d.model, t.sensors) @ elastic))
