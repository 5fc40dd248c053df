"""What a test could see and name, as a user meets it."""

from dataclasses import dataclass
from pathlib import Path

from dovetail.report import planning
from dovetail.report.printed import Printed
from dovetail.report.table import Table
from fem.summary import summary
from updating.plan.choose import ChosenChannels
from updating.plan.plan import Plan


@dataclass(frozen=True, slots=True, eq=False)
class Planned(Printed):
    """Which missing effects a test could see and name.

    Attributes
    ----------
    plan : Plan
        With all effects, their least sizes and rivals.
    chosen : ChosenChannels or None
        Sensors and forces that were added or chosen, where this was asked for.
    name, path : str, Path
        The study's, and its file.
    """

    plan: Plan
    chosen: ChosenChannels | None = None
    name: str = ""
    path: Path = Path("study.toml")

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

    @property
    def kinds(self) -> Table:
        """The table of kinds."""
        return planning.table_of_kinds(self.rows)

    def printed(self) -> list[str | Table]:
        """Return the lines and tables of ``dovetail plan``."""
        plan, chosen = self.plan, self.chosen
        out: list[str | Table] = list(planning.chosen_lines(chosen)) if chosen else []
        out += [f"{self.name}: {planning.title(plan)}", *planning.missing_first(plan, self.path)]
        out += [planning.headline(plan), "", self.kinds]
        for title, some in (
            ("seen, but not distinguished:", planning.twin_lines(plan)),
            ("not seen in relevant size:", planning.blind_lines(plan)),
        ):
            out += ["", title, *(f"  {line}" for line in some)] if some else []
        if not chosen and not plan.is_measured:
            out += ["", "--add 1 says where one more sensor would name most"]
        return out
