"""A diagnosis as a user meets it: the verdict and the staircase of errors as tables."""

from dataclasses import dataclass, fields
from html import escape
from typing import Any

from dovetail.notebook.html import number, table
from dovetail.report import words
from fem.analysis.labelled import imported
from updating.diagnosis import diagnose


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Diagnosis(diagnose.Diagnosis):
    """Which effects a study's model lacks; the fields are those of :class:`updating.Diagnosis`."""

    @classmethod
    def of(cls, found: diagnose.Diagnosis) -> "Diagnosis":
        """Return a diagnosis with tables."""
        return cls(**{f.name: getattr(found, f.name) for f in fields(found)})

    def to_frame(self) -> Any:
        """Return a ``pandas.DataFrame`` with a row for each candidate of each round, errors in dB.

        Raises
        ------
        ImportError
            If pandas is not installed.
        """
        rows = [
            {"round": k + 1, "candidate": r.name, "where": r.where, "fit_db": r.fit_db}
            | {"held_out_db": r.held_out_db, "similarity": r.similarity, "refined": r.refined}
            for k, ranked in enumerate(self.rounds)
            for r in ranked
        ]
        columns = ["round", "candidate", "where", "fit_db", "held_out_db", "similarity", "refined"]
        return imported("pandas").DataFrame(rows, columns=columns)

    def _repr_html_(self) -> str:
        """Return the verdict, the findings and the error after each step."""
        found = table(("found",), [(words.finding_text(f),) for f in self.findings]) if self.findings else ""
        rows = [(words.step_label(s.label), number(s.fit_db), number(s.held_out_db)) for s in self.steps]
        floor = ("noise floor", number(self.noise_floor_db), "")
        steps = table(("step", "fitted [dB]", "held out [dB]"), [*rows, floor])
        return f"<p><b>{escape(self.verdict)}</b>: {escape(self.reason)}</p>{found}{steps}"
