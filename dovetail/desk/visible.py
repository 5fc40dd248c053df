"""The page's map of the effects that the test could show: where from what size, and which look alike."""

from typing import Any

from nicegui import ui

from dovetail.desk.jobs import Job
from dovetail.desk.session import Desk
from dovetail.desk.widgets import Start, button, card, choice, labelled, plot
from dovetail.report import planning
from dovetail.report.figures import sizes
from updating.plan.plan import Plan

ASK = "What could this test show?"
SHOWN = {
    "seen": "seen: something is missing",
    "located": "located: at this place",
    "named": "named: this kind of effect",
}
"""What a test shows of an effect, by the columns of the table, which break no lines."""


class PlanView:
    """The structure by the least sizes that the test shows, with kinds, twins and blind places.

    Parameters
    ----------
    desk : Desk
    search : callable
        Starts a job in the background.
    """

    def __init__(self, desk: Desk, search: Start) -> None:
        self._desk, self._search = desk, search
        self._kind, self._what = "", "named"
        with card("What the test could show"):
            with ui.element("div").classes("desk-row"):
                button(ASK, self._ask, "visibility")
                self._noise = ui.number("Noise of a planned test, %", min=0.01, max=100, format="%.4g")
                self._noise.props("dense outlined clearable").style("width: 230px")
                labelled(self._noise, "Noise of a planned test, %")
                self._noise.tooltip("Without it the measured data count, with what the model leaves of them")
            self._body = ui.element("div").classes("desk-column")
        self._drawn: Any = None
        self.refresh()

    def refresh(self) -> None:
        """Show the map that was made last, and say whether it is one of the present hypothesis."""
        desk = self._desk
        if desk.mapped is None:
            return
        h, plan = desk.mapped
        state = plan, h is desk.now.hypothesis
        if state == self._drawn:
            return
        self._drawn = state
        self._body.clear()
        with self._body:
            self._show(plan, state[1])

    def _ask(self) -> None:
        noise = self._noise.value
        share = None if noise is None else float(noise) / 100
        self._search(lambda: self._desk.plan(share), self._made)

    def _made(self, job: Job) -> None:
        self._desk.mapped = job.result
        self.refresh()

    def _show(self, plan: Plan, present: bool) -> None:
        when = "" if present else " Beside an earlier hypothesis; ask again for the present one."
        ui.label(f"{planning.title(plan)}.{when}").classes("desk-note")
        ui.label(planning.headline(plan)).classes("desk-name")
        names = list(plan.kinds)
        if not names:
            return
        self._kind = self._kind if self._kind in names else names[0]
        with ui.element("div").classes("desk-row"):
            choice("Effect", names, self._kind, lambda kind: self._draw(plan, kind=kind), width=220)
            choice("Shown", SHOWN, self._what, lambda what: self._draw(plan, what=what), width=220)
        self._figure = ui.element("div").style("width: 100%")
        self._draw(plan)
        head, cells = planning.table_of_kinds(planning.kind_rows(plan)).texts()
        rows = [dict(zip(head, row, strict=True)) for row in cells]
        columns = [
            {
                "name": h,
                "label": h,
                "field": h,
                "align": "left",
                "classes": "desk-share" if h in SHOWN else "",
            }
            for h in head
        ]
        table = ui.table(rows=rows, columns=columns).props("dense flat wrap-cells")
        labelled(table, "Kinds of effects")
        for title, lines in (
            ("Seen, but not distinguished", planning.twin_lines(plan)),
            ("Not seen in relevant size", planning.blind_lines(plan)),
        ):
            if lines:
                with ui.expansion(f"{title} ({len(lines)})").classes("desk-lines"):
                    for line in lines:
                        ui.label(line).classes("desk-note")

    def _draw(self, plan: Plan, kind: str = "", what: str = "") -> None:
        self._kind, self._what = kind or self._kind, what or self._what
        self._figure.clear()
        with self._figure:
            label = f"From what size {self._kind} is {self._what} at each place of the structure"
            plot(sizes(plan, self._what, self._kind), label)
