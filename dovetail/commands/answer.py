"""The result of a command as a value, and its printing and writing."""

import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from dovetail.commands.common import Options
from dovetail.disk.output import write_json
from dovetail.file.contents import StudyContents
from dovetail.report.table import Column, Table, write_csv, write_xlsx
from fem.io.atomic import goes_to_stdout


def show_now(options: Options, printed: Sequence[str | Table]) -> None:
    """Print lines and tables as :func:`show` does; a reader that has gone, as ``head``, stops no work."""
    with suppress(OSError):
        show(options, printed)
        sys.stdout.flush()


def show(options: Options, printed: Sequence[str | Table]) -> None:
    """Print lines and tables, unless that is not wanted or standard output takes JSON."""
    json = getattr(options, "json", None)
    if not options.quiet and (json is None or not (str(json) == "-" or goes_to_stdout(json))):
        lines = (p.lines() if isinstance(p, Table) else [p] for p in printed)
        sys.stdout.write("".join(f"{line}\n" for part in lines for line in part))


@dataclass(frozen=True, slots=True, eq=False)
class Answer:
    """The result of a command.

    Attributes
    ----------
    study : StudyContents or None
        JSON has its name, notes, assumptions and warnings.
    printed : sequence of str or Table
        Lines and tables in their order.
    shown : sequence of str or Table
        Those before them that were printed as soon as they were known.
    fields : mapping
        The other values of JSON.
    nulls : mapping, optional
        Why numbers may be missing, by their key in JSON.
    full : Table, optional
        The table that is too large to print: of ``--out`` where that is CSV. In Excel it takes the place of a
        printed table with its title.
    sheets : sequence of Table
        Others for Excel.
    refusal : Exception, optional
        Raised when all is printed and written.
    finished : bool
        False if the work was ended early: the exit code is then 1.
    """

    study: StudyContents | None
    printed: Sequence[str | Table]
    fields: Mapping[str, Any] = field(default_factory=dict)
    nulls: Mapping[str, str] | None = None
    full: Table | None = None
    sheets: Sequence[Table] = ()
    refusal: Exception | None = None
    finished: bool = True
    shown: Sequence[str | Table] = ()

    def give(self, options: Options) -> None:
        """Write the files that the options ask for, and print, unless that is not wanted."""
        out = getattr(options, "out", None)
        if self.full is not None and out is not None and out.suffix.lower() == ".csv":
            write_csv(out, self.full)
        json = getattr(options, "json", None)
        write_json(json, self.as_json(), self.nulls)
        write_xlsx(getattr(options, "xlsx", None), self._tables())
        show(options, self.printed)
        if self.refusal is not None:
            raise self.refusal

    def as_json(self) -> dict[str, Any]:
        """Return what JSON has: the study's name and notes, and the fields."""
        study = self.study
        if study is None:
            return dict(self.fields)
        notes = {
            "mesh_notes": study.model.mesh.notes,
            "measured_notes": study.measured_notes,
            "assumptions": study.assumptions,
            "warnings": study.warnings,
        }
        return {
            "study": study.name,
            **self.fields,
            **{k: v for k, v in notes.items() if k not in self.fields},
        }

    def _tables(self) -> list[Table]:
        """Return all tables, large ones in the place of printed ones; without any, the lines."""
        large = {t.title: t for t in (self.full, *self.sheets) if t is not None}
        shown = [large.pop(p.title, p) for p in (*self.shown, *self.printed) if isinstance(p, Table)]
        lines = [p for p in (*self.shown, *self.printed) if isinstance(p, str)]
        return [*shown, *large.values()] or [Table.of("result", Column("result", lines))]
