"""Comparisons and diagnoses by modes as a user meets them: explanations and modes as tables."""

from dataclasses import dataclass, fields
from html import escape
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.notebook.html import number, table
from dovetail.report.words import explanation_text
from fem.summary import counted, summary
from updating.diagnosis import mode_diagnosis
from updating.inference.fit_result import FitResult
from updating.inference.mode_fit import ModeProblem


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class StudyModeDiagnosis(mode_diagnosis.ModeDiagnosis):
    """What a study's model lacks by its measured modes."""

    @classmethod
    def of(cls, found: mode_diagnosis.ModeDiagnosis) -> "StudyModeDiagnosis":
        """Return a diagnosis with tables."""
        return cls(**{f.name: getattr(found, f.name) for f in fields(found)})

    def __repr__(self) -> str:
        """Return verdict and reason on one line."""
        return f"<ModeDiagnosis {self.verdict}: {self.reason}>"

    def _repr_html_(self) -> str:
        """Return the verdict, the credible set, and measured and computed frequencies."""
        credible = [(explanation_text(e), f"{e.probability:.2f}") for e in self.credible]
        m = self.modes
        columns = (m.measured, m.nominal, m.fitted, m.found, m.mac_found)
        rows = [[number(x) for x in row] for row in zip(*columns, strict=True)]
        head = ("measured [Hz]", "nominal [Hz]", "fitted [Hz]", "found [Hz]", "MAC")
        return (
            f"<p><b>{escape(self.verdict)}</b>: {escape(self.reason)}</p>"
            f"{table(('explanation', 'probability'), credible)}{table(head, rows)}"
        )


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class StudyModeComparison:
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
        )

    @property
    def error(self) -> float:
        """Root mean square of ln(computed / measured) frequency of the modes that a fit sees [-]."""
        return mode_diagnosis.frequency_error(self.measured, self.computed, ~self.held_out)

    @property
    def held_out_error(self) -> float:
        """The same of the modes that are held out from fits, NaN without any [-]."""
        return mode_diagnosis.frequency_error(self.measured, self.computed, self.held_out)

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

    def _repr_html_(self) -> str:
        """Return measured and computed frequencies."""
        off = 100 * (self.computed / self.measured - 1)
        columns = (self.measured, self.computed, off, 100 * self.std, self.mac)
        rows = [[number(x) for x in row] for row in zip(*columns, strict=True)]
        head = ("measured [Hz]", "computed [Hz]", "off by [%]", "std [%]", "MAC")
        return table(head, rows, f"{self.name}, {self.label}")
