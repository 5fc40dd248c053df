"""The page's modes: natural frequencies and MAC, and shapes that move, measured beside computed."""

from base64 import b64encode
from collections.abc import Sequence
from typing import Any

from nicegui import json, run, ui

from dovetail.desk.compared_modes import ComparedModes
from dovetail.desk.figures import MODE_HEAD, comac_rows, mode_rows, shapes_figure, shapes_title
from dovetail.desk.jobs import Job
from dovetail.desk.session import Desk
from dovetail.desk.views import frequency_bars
from dovetail.desk.widgets import Start, button, card, labelled, plot, show
from viz.frequencies import mac_map
from viz.interactive import live
from viz.modal import plot_stabilisation
from viz.style import figure_png

HIGHEST_MATRIX = 460
"""Most height of the MAC matrix [pixel]."""
SHOW = """
<q-td :props="props"><q-btn flat dense size="sm" icon="play_arrow" :disable="props.row.partner === null"
  :aria-label="'Show mode ' + props.row.mode" @click="$parent.$emit('show', props.row)" /></q-td>
"""
PLAY = """(async ({id, shown, args, asked}) => {
  const ready = () => {
    const gd = getHtmlElement(id);
    return gd?._fullLayout?.meta?.shown === shown && gd._transitionData?._frames?.length;
  };
  for (let k = 0; k < 600 && !ready(); k++) await new Promise((later) => setTimeout(later, 50));
  const still = matchMedia('(prefers-reduced-motion: reduce)').matches;
  if (ready() && (asked || !still)) runMethod(id, 'run_plot_method', ['animate', ...args]);
})"""
"""Plays the frames of a figure as soon as it has them, unless the user prefers pictures that rest."""


class ModePanel:
    """Measured and computed modes of the present hypothesis, on demand.

    Parameters
    ----------
    desk : Desk
    search : callable
        Starts a job in the background.
    """

    def __init__(self, desk: Desk, search: Start) -> None:
        self._desk, self._search = desk, search
        self._drawn: Any = None
        self._shape: ui.plotly | None = None
        self._bars: ui.plotly | None = None
        self._menus: dict[str, Any] = {}
        self._shown = 0
        with card("Modes"):
            with ui.element("div").classes("desk-row"):
                button("Compare modes", self._compare, "graphic_eq")
                hint = "Identifies the measured modes in the FRFs, unless the study has them"
                ui.label(hint).classes("desk-note")
            self._body = ui.element("div").classes("desk-column")
        self.refresh()

    def refresh(self) -> None:
        """Show the last comparison, and whether it is one of the present hypothesis."""
        desk, found = self._desk, self._desk.compared_modes
        if found is None or (found, found.hypothesis is desk.now.hypothesis) == self._drawn:
            return
        self._drawn = found, found.hypothesis is desk.now.hypothesis
        self._body.clear()
        self._shape = None
        with self._body:
            self._show(found, self._drawn[1])

    def _compare(self) -> None:
        self._search(self._desk.compare_modes, self._take)

    def _take(self, job: Job) -> None:
        self._desk.compared_modes = job.result
        self.refresh()

    def _show(self, found: ComparedModes, present: bool) -> None:
        n, m = found.mac.shape
        words = f"{len(found.partner)} of {n} measured modes have a partner among {m} computed ones."
        when = "" if present else " They are those of an earlier hypothesis; compare again."
        ui.label(words + when).classes("desk-note")
        for note in found.notes:
            ui.label(note).classes("desk-note")
        table = _table(mode_rows(found), MODE_HEAD, {"name": "show", "label": "", "field": "mode"})
        table.add_slot("body-cell-show", SHOW)
        table.on("show", lambda e: self._choose(int(e.args["mode"]) - 1, int(e.args["partner"])))
        labelled(table, "Natural frequencies, measured and computed")
        measured, computed = ([f"{f:.4g}" for f in each] for each in found.frequencies())
        matrix = live.draw(mac_map(found.mac, measured, computed))
        height = min(matrix.layout.height or HIGHEST_MATRIX, HIGHEST_MATRIX)
        matrix.update_layout(height=height)
        made = plot(matrix, "MAC of measured with computed modes; click a cell")
        made.on("plotly_click", lambda e: self._choose(*(round(e.args["points"][0][k]) for k in "yx")))
        if rows := comac_rows(found):
            with ui.expansion("CoMAC of each sensor").classes("desk-lines"):
                note = "Similarity of measured and computed motions over all pairs; the lowest first."
                ui.label(note).classes("desk-note")
                labelled(_table(rows, ("sensor", "CoMAC")), "CoMAC of each sensor")
        if found.identified is not None:
            with ui.expansion("Stabilisation diagram").classes("desk-lines") as diagram:
                diagram.on_value_change(lambda e: self._stabilisation(found, diagram) if e.value else None)
        self._box = ui.element("div").style("width: 100%").classes("desk-column")

    async def _stabilisation(self, found: ComparedModes, diagram: ui.expansion) -> None:
        """Draw the poles of all orders when the diagram is first opened."""
        if found.identified is None or diagram.default_slot.children:
            return
        measured, identified = found.identified
        drawn = await run.io_bound(lambda: figure_png(plot_stabilisation(measured, identified)))
        if drawn is None:  # the desk is closing
            return
        with diagram:
            made = ui.image(f"data:image/png;base64,{b64encode(drawn).decode()}")
            labelled(made, "Mode indicators, and below them the poles of all orders of the model")

    async def _choose(self, i: int, j: int) -> None:
        """Show a measured mode and an elastic computed one, both counted from 0."""
        found = self._desk.compared_modes
        assert found is not None
        figure = await run.io_bound(shapes_figure, found, i, j)
        bars = await run.io_bound(frequency_bars, self._desk, found, j)
        if figure is None or bars is None:  # the desk is closing
            return
        menus, self._shown = figure.layout.updatemenus, self._shown + 1
        choose, stop = (menus[k].buttons[0].args for k in (0, 1))
        self._menus = {"play": choose, "stop": stop}
        figure.update_layout(meta={"shown": self._shown})
        figure.layout.updatemenus = ()  # buttons below play it, which keys can press
        words = f"Shapes of measured mode {i + 1} and computed mode {j + 1}"
        changes = f"Change of the frequency of computed mode {j + 1} by each parameter"
        if self._shape is None or self._bars is None:
            with self._box:
                self._title = ui.label().classes("desk-name").props("role=status")
                self._shape = plot(figure, words)
                with ui.element("div").classes("desk-row"):
                    button("Play", lambda: self._play("play"), "play_arrow", label="Play the shapes")
                    button("Stop", lambda: self._play("stop"), "stop", label="Stop the shapes")
                self._bars = plot(bars, changes)
        else:
            for part, drawn, text in ((self._shape, figure, words), (self._bars, bars, changes)):
                show(part, drawn)
                labelled(part, text)
        self._title.set_text(shapes_title(found, i, j))
        self._play("play", asked=False)

    def _play(self, which: str, *, asked: bool = True) -> None:
        assert self._shape is not None
        call = {"id": self._shape.id, "shown": self._shown, "args": self._menus[which], "asked": asked}
        self._shape.client.run_javascript(f"{PLAY}({json.dumps(call)})")


def _table(rows: list[dict[str, Any]], head: Sequence[str], *more: dict[str, Any]) -> ui.table:
    """Return a table of all rows at once, with columns by the keys of ``head`` and ``more`` of them."""
    columns = [{"name": name, "label": name, "field": name, "align": "right"} for name in head]
    made = ui.table(rows=rows, columns=[*columns, *more])
    return made.props("dense flat hide-pagination :rows-per-page-options=[0]").classes("desk-list desk-modes")
