"""A diagnosis as a user meets it: the verdict and the staircase of errors as tables."""

from dataclasses import dataclass, fields
from html import escape
from typing import Any

from dovetail.notebook.html import number, table
from dovetail.report import words
from fem.analysis.labelled import imported
from updating.correlation import DB_PER_NEPER
from updating.diagnosis import diagnose


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class StudyDiagnosis(diagnose.Diagnosis):
    """Which effects a study's model lacks; the fields are those of :class:`updating.Diagnosis`."""

    @classmethod
    def of(cls, found: diagnose.Diagnosis) -> "StudyDiagnosis":
        """Return a diagnosis with tables."""
        return cls(**{f.name: getattr(found, f.name) for f in fields(found)})

    def plot(self) -> Any:
        """Return an interactive plotly figure of the error after each step [dB], above the noise floor."""
        from viz.interactive.error import staircase_figure

        steps = [(words.step_label(s.label), s.fit_db, s.held_out_db) for s in self.steps]
        return staircase_figure(steps, self.noise_floor_db)

    def plot_ranking(self, round_: int = 1) -> Any:
        """Return an interactive plotly figure of the error with each candidate of a round [dB].

        Raises
        ------
        ValueError
            If the search had no such round.
        """
        from viz.interactive.error import ranking_figure

        if not 1 <= round_ <= len(self.rounds):
            msg = f"there is no round {round_}; the search had {len(self.rounds)}, counted from 1"
            raise ValueError(msg)
        ranked = self.rounds[round_ - 1]
        found = [r.name for r in ranked]
        finding = self.findings[round_ - 1] if round_ <= len(self.findings) else None
        accepted = found.index(finding.effect.name) if finding and finding.effect.name in found else None
        twins = {found.index(t.name) for t in finding.twins if t.name in found} if finding else set()
        before = self.steps[min(round_, len(self.steps) - 1)]
        return ranking_figure(
            [words.ranked_label(r) for r in ranked],
            [r.level * DB_PER_NEPER for r in ranked],
            before.level * DB_PER_NEPER,
            names=found,
            twins=twins,
            accepted=accepted,
        )

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

    def _repr_html_(self) -> str:
        """Return the verdict, the findings and the error after each step."""
        texts = [*map(words.finding_text, self.findings), *map(words.fault_text, self.every_fault)]
        found = table(("found",), [(text,) for text in texts]) if texts else ""
        rows = [(words.step_label(s.label), number(s.fit_db), number(s.held_out_db)) for s in self.steps]
        floor = ("noise floor", number(self.noise_floor_db), "")
        steps = table(("step", "fitted [dB]", "held out [dB]"), [*rows, floor])
        return f"<p><b>{escape(self.verdict)}</b>: {escape(self.reason)}</p>{found}{steps}"
