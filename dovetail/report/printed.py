"""Results of Python that print as the command line prints them."""

from collections.abc import Sequence
from html import escape

from dovetail.report.html_table import table
from dovetail.report.table import Table


class Printed:
    """A result with the lines and tables that its command prints."""

    __slots__ = ()

    def printed(self) -> Sequence[str | Table]:
        """Return lines and tables in their order."""
        raise NotImplementedError

    def __str__(self) -> str:
        """Return the lines, as the command prints them."""
        parts = (p.lines() if isinstance(p, Table) else [p] for p in self.printed())
        return "\n".join(line for part in parts for line in part)

    def _repr_html_(self) -> str:
        """Return lines as paragraphs, and tables."""
        return "".join(
            table(*p.texts()) if isinstance(p, Table) else f"<p>{escape(p)}</p>" for p in self.printed() if p
        )
