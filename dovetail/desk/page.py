"""The desk's page: header, model, FRFs, errors and hypothesis; nothing is decided here."""

import asyncio
import math
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from nicegui import background_tasks, json, run, ui
from nicegui.events import GenericEventArguments

from dovetail.desk import figures
from dovetail.desk.candidates import CandidateList
from dovetail.desk.effects import EffectList, Move
from dovetail.desk.frf_panel import FrfPanel
from dovetail.desk.help import Help
from dovetail.desk.jobs import Job, Newest
from dovetail.desk.modes import ModePanel
from dovetail.desk.sensors import SensorList
from dovetail.desk.session import RANKED_UNASKED, SAME_SPOT, Desk
from dovetail.desk.visible import PlanView
from dovetail.desk.widgets import FOLLOW, JobBar, Keys, Numbers, button, card, is_dark, plot, show
from dovetail.report.words import fault_text
from updating.live.engine import Evaluation

STYLE = Path(__file__).with_name("style.css")
LONGEST = 5.0
"""A figure that takes longer to be drawn is not waited for [s]."""
IN_SIGHT = """((box) => box.bottom > 0 && box.top < innerHeight && {call}.then(
  () => new Promise((painted) => requestAnimationFrame(() => setTimeout(painted)))))({box})"""
"""Calls a method of a figure that is in sight; ends when the browser has painted it."""
DAY = {"primary": "#0068a3", "positive": "#1a7f37", "negative": "#b3001b", "warning": "#f2c037"}
NIGHT = {**DAY, "primary": "#56b4e9", "dark_page": "#161b22", "dark": "#0d1117"}
"""Colours of controls and notices, which text on them and beside them can be read with (WCAG AA)."""
NUMBERS = {
    "fit": "error, lines of the fit",
    "held": "held-out lines",
    "all": "all lines",
    "noise": "noise floor",
    "left": "error beyond the noise",
    "apart": "held-out channels",
}
ROLES = ("sensor", "excitation")
"""Marks of the model that choose the FRF shown."""
PRESSED = "(e) => { e.currentTarget.pressedAt = [e.clientX, e.clientY]; }"
TURN = """(e) => {
  const scene = e.currentTarget._fullLayout?.scene, zoom = {'+': 1 / 1.15, '-': 1.15}[e.key] ?? 1;
  const turn = {ArrowLeft: -0.15, ArrowRight: 0.15}[e.key] ?? 0;
  const tilt = {ArrowUp: 0.1, ArrowDown: -0.1}[e.key] ?? 0;
  if (!scene || (zoom === 1 && !turn && !tilt)) return;
  e.preventDefault();
  const camera = scene._scene.getCamera(), {x, y, z} = camera.eye, far = Math.hypot(x, y, z) * zoom;
  const azimuth = Math.atan2(y, x) + turn;
  const height = Math.max(-1.5, Math.min(1.5, Math.atan2(z, Math.hypot(x, y)) + tilt));
  camera.eye = {x: far * Math.cos(height) * Math.cos(azimuth), y: far * Math.cos(height) * Math.sin(azimuth),
    z: far * Math.sin(height)};
  runMethod(%d, 'run_plot_method', ['relayout', {'scene.camera': camera}]);
}"""
"""Arrow keys turn the model, + and - zoom it."""
CLICKED = """(e) => {
  const gd = document.querySelector('[aria-label^="The model"]'), scene = gd._fullLayout.scene._scene;
  const camera = scene.glplot.cameraParams;
  const box = gd.querySelector('.gl-container canvas').getBoundingClientRect();
  const times = (m, v) => [0, 1, 2, 3].map((i) => [0, 1, 2, 3].reduce((s, j) => s + m[i + 4 * j] * v[j], 0));
  const seen = (point) => {
    let v = [...point.map((x, i) => x * scene.dataScale[i]), 1];
    for (const m of [camera.model, camera.view, camera.projection]) v = times(m, v);
    const [x, y, depth] = v.map((c) => c / v[3]);
    return [box.x + box.width * (1 + x) / 2, box.y + box.height * (1 - y) / 2, depth];
  };
  const marks = [], p = e.points[0], [x, y] = gd.pressedAt;
  for (const t of gd._fullData) {
    if (t.type !== 'scatter3d' || t.visible !== true || !t.customdata) continue;
    t.customdata.forEach((name, k) => {
      const point = [t.x[k], t.y[k], t.z[k]], [px, py, depth] = seen(point);
      marks.push({name, role: t.meta.role, point, depth, off: Math.hypot(px - x, py - y)});
    });
  }
  const point = [p.x, p.y, p.z], name = [p.customdata].flat()[0] ?? '';
  emit({marks, touched: {name, point, depth: seen(point)[2]}});
}"""
"""Sends the marks of the model with their distances on the screen from a click [pixel] and their depths."""
MODEL_HEIGHT = 400
"""[pixel]."""


class Page:
    """One browser tab with the desk in it.

    Parameters
    ----------
    desk : Desk
    """

    def __init__(self, desk: Desk) -> None:
        self.desk = desk
        self._newest: Newest[Move] = Newest(self._moved)
        self._left: Move | None = None
        self._seen = desk.history
        self._map_due = 0.0
        self._client = ui.context.client

    # Layout -------------------------------------------------------------------------------------------------

    def build(self) -> None:
        """Lay the page out."""
        desk = self.desk
        ui.add_css(STYLE)
        ui.add_head_html(FOLLOW)
        dark = is_dark(self._client)
        ui.dark_mode(dark)
        ui.colors(**(NIGHT if dark else DAY))
        self.help = Help()
        self._header()
        with ui.element("main").classes("desk-grid"):
            with ui.element("div").classes("desk-column"):
                self._model_card()
                self.candidates = CandidateList(desk, self.act, self._rank, self._show_model)
                self._staircase_card()
                self.modes = ModePanel(desk, self.searches.start)
            with ui.element("div").classes("desk-column"):
                self.frfs = FrfPanel(desk, self.act)
                self.effects = EffectList(
                    desk,
                    self.act,
                    fit=self._start_fit,
                    search=self.searches.start,
                    move=self._newest.put,
                    release=self._release,
                )
                self._map_card()
                self.sensors = SensorList(desk, self.act)
                self.plan_view = PlanView(desk, self.searches.start)
        # Seconds between two looks at running jobs [s]
        ui.timer(0.2, self._look_at_jobs)
        Keys({"undo": self._undo, "redo": self._redo, "save": self._save_dialog})
        self._tell_notes()
        self._show_numbers(self.desk.shown)
        self.refresh_buttons()

    def _tell_notes(self) -> None:
        for note in self.desk.notes:
            ui.notify(note, multi_line=True)
        self.desk.notes.clear()

    def _header(self) -> None:
        with ui.element("header").classes("desk-head column"):
            with ui.element("div").classes("desk-row"):
                ui.label(self.desk.study.name).classes("desk-title").props('role="heading" aria-level="1"')
                ui.space()
                self.undo = button("Undo", self._undo, "undo", hint="Ctrl+Z")
                self.redo = button("Redo", self._redo, "redo", hint="Ctrl+Y")
                button("Fit uncertain parameters", lambda: self._start_fit(self.desk.fit_uncertain), "tune")
                button("Fit all", lambda: self._start_fit(self.desk.fit_all), "auto_fix_high")
                button("Diagnose", self._diagnose, "troubleshoot")
                button("Save study", self._save_dialog, "save", hint="Ctrl+S")
                button("Export report", self._report_dialog, "description")
                button("Help", self.help.open, "help_outline")
            with ui.element("div").classes("desk-row desk-errors"):
                self._numbers = Numbers(NUMBERS, _texts(self.desk.shown))
                ui.space()
                with ui.element("div").classes("desk-row").style("width: auto"):
                    button("Keep for comparison", lambda: self.act(self.desk.keep), "content_copy")
                    self.swap = button("Exchange", lambda: self.act(self.desk.swap), "swap_horiz")
                    self.drop = button("Drop second", lambda: self.act(self.desk.drop), "close")
            self.fits, self.searches = (JobBar(word, self.keep_moved) for word in ("Fit", "Search"))

    def _model_card(self) -> None:
        with card("Model"):
            figure = figures.model(self.desk, "", MODEL_HEIGHT)
            self.model = plot(
                figure, "The model with sensors coloured by their error; click a place to list its candidates"
            )
            self.model.props("role=application tabindex=0").on("keydown", js_handler=TURN % self.model.id)
            self.model.on("mousedown", js_handler=PRESSED)
            self.model.on("plotly_click", self._clicked_model, js_handler=CLICKED)

    def _map_card(self) -> None:
        with card("Error by sensor and band"):
            self.map = plot(
                figures.error_map(self.desk), "Error of each sensor in each band; click a cell for its FRF"
            )
            self.map.on("plotly_click", self._clicked_map)

    def _staircase_card(self) -> None:
        with card("Staircase"):
            self.stairs = plot(figures.staircase(self.desk), "Error after each step, and the noise floor")

    # Changes with a slider ----------------------------------------------------------------------------------

    def _release(self, move: Move) -> None:
        """Keep the value that a slider was left at, unless it is moved again at once."""
        self._left = move
        background_tasks.create(self._keep_later(move))

    async def _keep_later(self, move: Move) -> None:
        # A slider that rests so long is let go of: its value becomes a state [s]
        await asyncio.sleep(0.35)
        if self._left is move:
            await self._newest.settled()
            self.keep_moved()
            with self._client:
                if self.effects.refits:
                    self._start_fit(self.desk.fit_uncertain)

    def keep_moved(self) -> None:
        """Make the value that a slider was left at a state, if that has not been done yet."""
        move, self._left = self._left, None
        if move is None or all(e.name != move[0] for e in self.desk.now.hypothesis.effects):
            return
        self.desk.set_value(*move)
        self.effects.moved_by_hand(self.desk.now.hypothesis.effects)
        with self._client:
            self.refresh()

    async def _moved(self, move: Move) -> None:
        shown = await run.io_bound(self.desk.preview, *move)
        if shown is not None:
            await self._follow(shown)

    async def _follow(self, shown: Evaluation) -> None:
        """Show an evaluation, and wait until the browser has drawn it: no more is sent than it can draw.

        Figures that are scrolled out of sight are drawn when the slider rests.
        """
        self._show_numbers(shown)
        frames, traces = self.frfs.moved(shown)
        if traces:  # a frame without a redraw draws its curves alone: axes and other curves stay
            now = {"data": frames, "traces": traces}
            await self._draw(self.frfs.plot, "animate", now, figures.AT_ONCE)
        if time.monotonic() > self._map_due:
            begun = time.monotonic()
            await self._draw(self.map, "restyle", figures.moved_map(shown), [0])
            # Share of the time that the error map takes while a slider moves: its cells take longer than
            # curves [-]
            self._map_due = time.monotonic() + (1 / 0.25 - 1) * (time.monotonic() - begun)

    async def _draw(self, plot: ui.plotly, method: str, *args: Any) -> None:
        """Call a method of a figure, if it is in sight, and wait until it is painted."""
        arguments = json.dumps([method, *args])
        call = f"runMethod({plot.id}, 'run_plot_method', {arguments})"
        box = f"getHtmlElement({plot.id}).getBoundingClientRect()"
        with suppress(TimeoutError):  # a tab that has gone draws nothing
            await self._client.run_javascript(IN_SIGHT.format(call=call, box=box), timeout=LONGEST)

    def _show_numbers(self, shown: Evaluation) -> None:
        second = self.desk.second()
        was = {} if second is None else {k: f"second {v}" for k, v in _texts(second).items()}
        self._numbers.show(_texts(shown), was)

    # Changes after an action --------------------------------------------------------------------------------

    def refresh(self) -> None:
        """Show the present state."""
        desk = self.desk
        self._seen = desk.history
        self.frfs.refresh()
        show(self.map, figures.error_map(desk))
        show(self.stairs, figures.staircase(desk))
        self._show_model()
        self._show_numbers(desk.shown)
        self.effects.refresh()
        self.sensors.refresh()
        self.candidates.refresh()
        self.plan_view.refresh()
        self.modes.refresh()
        self.refresh_buttons()
        self._tell_notes()

    def refresh_buttons(self) -> None:
        """Enable the buttons of possible actions only."""
        history, state = self.desk.history, self.desk.now
        for one, label, word in ((self.undo, history.undoes, "Undo"), (self.redo, history.redoes, "Redo")):
            one.set_enabled(bool(label))
            one.props["aria-label"] = f"{word}: {label}" if label else word
            one.update()
        self.swap.set_visibility(state.other is not None)
        self.drop.set_visibility(state.other is not None)

    def act(self, work: Callable[[], None]) -> None:
        """Do something that gives a new state, and show it; an error is told."""
        try:
            self.keep_moved()
            work()
        except (ValueError, OSError) as reason:
            words = f"{reason.filename}: {reason.strerror}" if isinstance(reason, OSError) else str(reason)
            ui.notify(words, type="negative", multi_line=True)
            return
        self.refresh()

    def _undo(self) -> None:
        self.act(self.desk.undo)

    def _redo(self) -> None:
        self.act(self.desk.redo)

    def _clicked_map(self, e: GenericEventArguments) -> None:
        self.frfs.open("sensor", e.args["points"][0]["customdata"][0])

    def _clicked_model(self, e: GenericEventArguments) -> None:
        touched, reach = e.args["touched"], 2 * SAME_SPOT * self.desk.study.model.mesh.size
        mark = figures.nearest_mark(e.args["marks"], touched, reach, self.desk.joints)
        role, name = (mark["role"], mark["name"]) if mark else ("", touched["name"])
        if role in ROLES:
            self.frfs.open(role, name)
        else:
            near = self.desk.spot_near(mark["point"] if mark else touched["point"])
            self.candidates.choose(near or self.desk.spot_of(str(name)))

    def _show_model(self) -> None:
        show(self.model, figures.model(self.desk, self.candidates.spot, MODEL_HEIGHT))

    # Jobs ---------------------------------------------------------------------------------------------------

    def _start_fit(self, begin: Callable[[], Job]) -> None:
        self.fits.start(begin, self._fitted)

    def _look_at_jobs(self) -> None:
        if self._seen is not self.desk.history:  # another tab has acted
            self.refresh()
        self.fits.look()
        self.searches.look()

    def _fitted(self, job: Job) -> None:
        faults = self.desk.now.hypothesis.faults
        self.act(lambda: self.desk.take_fit(job))
        for fault in self.desk.now.hypothesis.faults:
            if fault not in faults:
                ui.notify(f"corrected: {fault_text(fault)}", multi_line=True)
        few = len(self.desk.candidates) <= RANKED_UNASKED
        if few and not self.searches.busy and not self.desk.now.hypothesis.effects:
            self._rank()

    def _rank(self) -> None:
        self.searches.start(self.desk.rank, self._ranked)

    def _ranked(self, job: Job) -> None:
        self.desk.ranking = job.result
        self.candidates.refresh()
        for effect in self.desk.now.hypothesis.effects:
            self.effects.show_evidence(effect.name)

    def _diagnose(self) -> None:
        self.searches.start(self.desk.diagnose, self._diagnosed)

    def _diagnosed(self, job: Job) -> None:
        self.desk.diagnosis = job.result
        self.candidates.refresh()

    # Files and reports --------------------------------------------------------------------------------------

    def _save_dialog(self) -> None:
        path = self.desk.study.path
        _ask("Save study", "File", path.with_name(f"{path.stem}-desk.toml"), self._save)

    def _save(self, path: Path) -> None:
        self.act(lambda: ui.notify(f"Saved {self.desk.save(path)}", type="positive", multi_line=True))

    def _report_dialog(self) -> None:
        path = self.desk.study.path
        _ask("Export report", "Folder", path.with_name(f"{path.stem}-report"), self._report)

    def _report(self, folder: Path) -> None:
        self.searches.start(
            lambda: self.desk.report(folder),
            lambda job: ui.notify(f"Wrote {job.result}", type="positive", multi_line=True),
        )


def _ask(title: str, word: str, path: Path, take: Callable[[Path], None]) -> None:
    """Ask for a path in a dialog."""

    def write() -> None:
        if not (path := (field.value or "").strip()):
            ui.notify(f"{word}: a path is needed", type="warning")
            return
        dialog.close()
        take(Path(path))

    with ui.dialog() as dialog, ui.card().style("min-width: min(560px, 90vw)"):
        ui.label(title).classes("desk-title")
        field = ui.input(word, value=str(path)).props("outlined dense autofocus").style("width: 100%")
        with ui.element("div").classes("desk-row"):
            ui.space()
            ui.button("Cancel", on_click=dialog.close).props("flat no-caps")
            ui.button("Write", on_click=write).props("flat no-caps")
    dialog.on("hide", dialog.delete)
    dialog.open()


def _texts(shown: Evaluation) -> dict[str, str]:
    r = shown.result
    apart = math.nan if shown.held_out is None else shown.held_out.total_db
    values = (r.fit_db, r.held_out_db, shown.comparison.total_db, shown.noise_db, shown.left_db, apart)
    known = zip(NUMBERS, values, strict=True)
    return {key: f"{value:.2f} dB" if math.isfinite(value) else "none" for key, value in known}
