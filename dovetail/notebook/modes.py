"""Comparisons by modes as a user meets them: measured and computed frequencies as a table."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dovetail.report.printed import Printed
from dovetail.report.table import Column, Table
from fem.summary import counted, summary
from updating.diagnosis.mode_table import frequency_error
from updating.inference.fit_result import FitResult
from updating.inference.mode_fit import ModeProblem

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class StudyModeComparison(Printed):
    """How far a study's modes are from the measured ones, (n,) each; NaN where there is none.

    Attributes
    ----------
    name, label : str
        The study's, and its model's: ``"nominal"``, ``"fitted"`` or ``"with …"``.
    measured, std : ndarray
        Frequencies [Hz], and their relative standard deviations [-].
    computed : ndarray
        Frequencies of the model [Hz].
    zeta, zeta_computed : ndarray
        Damping ratios [-].
    mac : ndarray
        Modal assurance criteria, where there are shapes [-].
    held_out : ndarray of bool
        Modes that no fit sees.
    noise_level : float
        Standard deviation of the measured frequencies [-].
    """

    name: str
    label: str
    measured: NDArray[np.float64]
    std: NDArray[np.float64]
    computed: NDArray[np.float64]
    zeta: NDArray[np.float64]
    zeta_computed: NDArray[np.float64]
    mac: NDArray[np.float64]
    held_out: NDArray[np.bool_]
    noise_level: float

    @classmethod
    def of(
        cls, problem: ModeProblem, result: FitResult, name: str = "", label: str = "model"
    ) -> "StudyModeComparison":
        """Compare a fit of a problem, or its nominal model, with the measured modes."""
        t, computed = problem.targets, problem.computed(result)
        return cls(
            name,
            label,
            t.frequency,
            t.frequency_std,
            computed.frequency,
            t.zeta,
            computed.zeta,
            computed.mac,
            t.held_out,
            t.noise_level,
        )

    @property
    def error(self) -> float:
        """Root mean square of ln(computed / measured) frequency of the modes that a fit sees [-]."""
        return frequency_error(self.measured, self.computed, ~self.held_out)

    @property
    def held_out_error(self) -> float:
        """The same of the modes that are held out from fits, NaN without any [-]."""
        return frequency_error(self.measured, self.computed, self.held_out)

    @property
    def table(self) -> Table:
        """Measured and computed modes."""
        file = ("file",)
        return Table.of(
            "modes",
            Column("measured", self.measured, "Hz"),
            Column("computed", self.computed, "Hz"),
            Column("off by", self.computed / self.measured - 1, "%", "+.3f", 100),
            Column("std", self.std, "%", ".2g", 100),
            Column("MAC", self.mac, show=".3f"),
            Column("measured zeta", self.zeta, "%", scale=100, places=file),
            Column("computed zeta", self.zeta_computed, "%", scale=100, places=file),
            Column("held out", self.held_out, places=file),
            Column("", ["predicted, not fitted" * bool(one) for one in self.held_out], places=("text",)),
        )

    def printed(self) -> list[str | Table]:
        """Return the errors, and a table of the modes, as ``dovetail compare`` prints them."""
        held_out = self.held_out_error
        predicted = f", {100 * held_out:.2g} % of those held out" if np.isfinite(held_out) else ""
        error = f"error of the natural frequencies {100 * self.error:.2g} %"
        if not np.isfinite(self.error):
            error = "no measured mode has a partner in the model"
        return [
            f"{self.name}, {self.label}: {error}{predicted}; standard deviation of the measurement "
            f"{100 * self.noise_level:.2g} %",
            self.table,
        ]

    def still(self) -> "Figure":
        """Return a matplotlib figure of how far the frequencies are off, mode by mode [%]."""
        from viz.frequencies import deviations
        from viz.still import draw

        title = f"{self.name}, {self.label}: natural frequencies"
        return draw(deviations(self.measured, self.std, {self.label: self.computed}, self.held_out, title))

    def rows(self) -> list[dict[str, Any]]:
        """Return the columns in plain types, mode by mode."""
        columns = {
            "measured_Hz": self.measured,
            "std": self.std,
            "computed_Hz": self.computed,
            "zeta": self.zeta,
            "zeta_computed": self.zeta_computed,
            "mac": self.mac,
            "held_out": self.held_out,
        }
        return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]

    def __repr__(self) -> str:
        """Return the errors on one line."""
        held_out = f", {100 * self.held_out_error:.2g} % held out" if self.held_out.any() else ""
        n = counted(len(self.measured), "mode")
        return summary(self, f"{self.name}, {self.label}: {n}, {100 * self.error:.2g} % off{held_out}")
