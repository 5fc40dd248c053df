"""A diagnosis from modes as a user meets it: explanations and modes as tables."""

from dataclasses import dataclass, fields
from html import escape

from dovetail.notebook.html import number, table
from dovetail.report.words import explanation_text
from updating.diagnosis import mode_diagnosis


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ModeDiagnosis(mode_diagnosis.ModeDiagnosis):
    """What a study's model lacks by its measured modes."""

    @classmethod
    def of(cls, found: mode_diagnosis.ModeDiagnosis) -> "ModeDiagnosis":
        """Return a diagnosis with tables."""
        return cls(**{f.name: getattr(found, f.name) for f in fields(found)})

    def __repr__(self) -> str:
        """Return verdict and reason on one line."""
        return f"<ModeDiagnosis {self.verdict}: {self.reason}>"

    def _repr_html_(self) -> str:
        """Return the verdict, the credible set, and measured beside computed frequencies."""
        credible = [(explanation_text(e), f"{e.probability:.2f}") for e in self.credible]
        m = self.modes
        columns = (m.measured, m.nominal, m.fitted, m.found, m.mac_found)
        rows = [[number(x) for x in row] for row in zip(*columns, strict=True)]
        head = ("measured [Hz]", "nominal [Hz]", "fitted [Hz]", "found [Hz]", "MAC")
        return (
            f"<p><b>{escape(self.verdict)}</b>: {escape(self.reason)}</p>"
            f"{table(('explanation', 'probability'), credible)}{table(head, rows)}"
        )
