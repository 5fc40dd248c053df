"""Modes identified in the FRFs that a diagnosis compared, beside those of its models."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.file.measured_modes import MeasuredModes
from fem.analysis.modes import Modes
from updating.correlation import ModeComparison


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
                | {"damping_measured": None if modes.zeta is None else float(modes.zeta[i].real)}
                | {"damping_reported": zeta, "mac_nominal": mac_before, "mac_reported": mac_after}
            )
        return out
