"""What a test could see and name, as a user meets it."""

from dataclasses import dataclass

from dovetail.notebook.html import table
from dovetail.report import planning
from fem.summary import summary
from updating.plan.choose import ChosenChannels
from updating.plan.plan import Plan


@dataclass(frozen=True, slots=True, eq=False)
class Planned:
    """Which missing effects a test could see and name.

    Attributes
    ----------
    plan : Plan
        With all effects, their least sizes and rivals.
    chosen : ChosenChannels or None
        Sensors and forces that were added or chosen, where this was asked for.
    """

    plan: Plan
    chosen: ChosenChannels | None = None

    def __repr__(self) -> str:
        """Return the shares of relevant effects that are seen and named on one line."""
        return summary(self, planning.headline(self.plan))

    def coverage(self, what: str = "named") -> float:
        """Return the share of effects of a relevant size that are ``seen``, ``located`` or ``named`` [-]."""
        return self.plan.coverage(what)

    @property
    def rows(self) -> list[planning.KindRow]:
        """A row for each kind of effect."""
        return planning.kind_rows(self.plan)

    @property
    def twins(self) -> list[str]:
        """Pairs that the test sees and does not tell apart."""
        return [planning.twin_text(*pair) for pair in self.plan.twins]

    def _repr_html_(self) -> str:
        """Return the table of kinds."""
        head, rows = planning.table_of_kinds(self.rows).texts()
        return table(head, rows, f"{planning.title(self.plan)}. {planning.headline(self.plan)}")
