"""Diagnoses as a user meets them: the verdict and the staircase of errors as tables."""

import os
from dataclasses import dataclass, field, fields
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

from dovetail.report import words
from dovetail.report.found_lines import found_lines
from dovetail.report.html_table import table
from dovetail.report.sections import explanations, measured_modes, rounds, staircase
from fem.analysis.frf import imported
from updating.diagnosis import diagnose, mode_diagnosis
from updating.diagnosis.verdict import Verdict

if TYPE_CHECKING:
    from dovetail.pipeline import Progress
    from dovetail.result import RunResult

StudyVerdict: TypeAlias = "StudyDiagnosis | StudyModeDiagnosis"
V = TypeVar("V", bound=Verdict)


class Tables:
    """What all diagnoses of a study have: tables and a figure, the study with what was found, a report."""

    __slots__ = ()

    @classmethod
    def of(cls: type[V], found: Verdict, study: Any) -> V:  # pyright: ignore[reportGeneralTypeIssues]
        """Return a diagnosis of a study with tables."""
        values: dict[str, Any] = {f.name: getattr(found, f.name) for f in fields(found) if f.init}
        values["diagnosed"] = study
        return cls(**values)

    @property
    def study(self: "StudyVerdict") -> Any:  # pyright: ignore[reportGeneralTypeIssues]
        """The study with what was found: fitted values, effects, and corrected faults of the measurement."""
        return self.diagnosed.with_found(self)

    def report(
        self: "StudyVerdict",  # pyright: ignore[reportGeneralTypeIssues]
        out: str | os.PathLike[str],
        progress: "Progress | None" = None,
    ) -> "RunResult[Any]":
        """Write the report of this diagnosis into a folder, as :meth:`dovetail.Study.run` does.

        Parameters
        ----------
        out : path
            Folder that is new, empty, or of an earlier run.
        progress : callable, optional
            Called with a text and the fraction done.

        Raises
        ------
        OutputError
            If ``out`` holds something else.
        """
        from dovetail.pipeline import report

        return report(self.diagnosed, self, Path(out), progress)

    def plot(self: Verdict) -> Any:  # pyright: ignore[reportGeneralTypeIssues]
        """Return an interactive plotly figure of the error after each step, above the noise floor."""
        from viz.interactive.live import draw

        return draw(staircase.figure(self))

    def __str__(self: Verdict) -> str:  # pyright: ignore[reportGeneralTypeIssues]
        """Return the verdict and what was found, with values and probabilities."""
        return "\n".join([f"{self.verdict}: {self.reason}", *found_lines(self)])

    def _repr_html_(self: Verdict) -> str:  # pyright: ignore[reportGeneralTypeIssues]
        """Return the verdict, what was found, the error after each step, and measured modes."""
        texts = [*map(words.finding_text, self.findings), *map(words.fault_text, self.every_fault)]
        found = table(("found",), [(text,) for text in texts]) if texts else ""
        tables = [staircase.table(self)]
        if self.modes is not None:
            tables += [explanations.table(self), measured_modes.table(self, self.modes)]
        shown = "".join(table(*t.texts()) for t in tables)
        return f"<p><b>{escape(self.verdict)}</b>: {escape(self.reason)}</p>{found}{shown}"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class StudyModeDiagnosis(Tables, mode_diagnosis.ModeDiagnosis):
    """Which effects a study's model lacks by its measured modes.

    Attributes
    ----------
    diagnosed : Study
    """

    diagnosed: Any = field(kw_only=True)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class StudyDiagnosis(Tables, diagnose.Diagnosis):
    """Which effects a study's model lacks; the fields are those of :class:`updating.Diagnosis`.

    Attributes
    ----------
    diagnosed : Study
    """

    diagnosed: Any = field(kw_only=True)

    def plot_ranking(self, round_: int = 1) -> Any:
        """Return an interactive plotly figure of the error with each candidate of a round [dB].

        Raises
        ------
        ValueError
            If the search had no such round.
        """
        if not 1 <= round_ <= len(self.rounds):
            msg = f"there is no round {round_}; the search had {len(self.rounds)}, counted from 1"
            raise ValueError(msg)
        from viz.interactive.live import draw

        figure = rounds.figure(self, round_ - 1)
        return figure and draw(figure)

    def to_frame(self) -> Any:
        """Return a ``pandas.DataFrame`` with a row for each candidate of each round, errors in dB.

        Raises
        ------
        ImportError
            If pandas is not installed.
        """
        rows = [
            {"round": k + 1, "candidate": r.name, "where": r.where, "fit_db": r.fit_db}
            | {"held_out_db": r.held_out_db, "similarity": r.similarity, "score": r.score}
            for k, ranked in enumerate(self.rounds)
            for r in ranked
        ]
        columns = ["round", "candidate", "where", "fit_db", "held_out_db", "similarity", "score"]
        return imported("pandas").DataFrame(rows, columns=columns)
