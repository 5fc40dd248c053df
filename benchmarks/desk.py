"""Time from a slider's move to new FRFs, errors and figures: the cross-beam, and a tower of 400 members.

Run it with one thread:

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.desk [beams] [tower] [browser] [hour[=MOVES]]
"""

import os
import shutil
import sys
import tempfile
import time
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import numpy as np
from nicegui import json

from benchmarks.diagnosis import STUDY, tower
from dovetail import load_study
from dovetail.desk import curve_changes, moved_map
from dovetail.pipeline import fit_problem
from fem import Effect
from updating import Nuisance, propose
from updating.diagnosis.begin import begin
from updating.live import Hypothesis, LiveModel

MOVES = 100
HOUR = 20_000
"""Moves of an hour of dragging, one in 180 ms [-]."""


def line(name: str, live: LiveModel, effect: Effect, parameter: str, low: float, high: float) -> None:
    """Print how long moves of one parameter take: errors alone, and with what goes to the page."""
    h = Hypothesis.nominal(live.problem).with_effect(effect)
    shown = live.evaluate(h)
    pair = (shown.frf.outputs[0], shown.frf.inputs[0])

    def errors(value: float) -> None:
        live.evaluate(h.with_value(effect.name, parameter, value))

    def page(value: float) -> None:
        now = live.evaluate(h.with_value(effect.name, parameter, value))
        json.dumps([curve_changes(now, pair), moved_map(now)])

    n, m = live.problem.data.H.shape[0], live.problem.reduced.basis.T.shape[1]
    one, two = (_times(work, np.linspace(low, high, MOVES)) for work in (errors, page))
    print(f"{name:12s}{effect.name + ' ' + parameter:36s}{n:7d}{m:7d}{one[0]:9.1f}{two[0]:9.1f}{two[1]:9.1f}")


def _times(work: Callable[[float], None], values: np.ndarray) -> tuple[float, float]:
    """Return the median and the 95th percentile of a move [ms]."""
    spent = []
    for value in values:
        start = time.perf_counter()
        work(float(value))
        spent.append(1e3 * (time.perf_counter() - start))
    return float(np.median(spent)), float(np.percentile(spent, 95))


def hour(live: LiveModel, effect: Effect, moves: int = HOUR) -> None:
    """Print how much memory an hour of dragging adds, for a parameter that needs a new engine each time."""
    h = Hypothesis.nominal(live.problem).with_effect(effect).with_value(effect.name, "mass", 0.05)
    positions = 0.1 + 0.6 * np.random.default_rng(0).random(moves)
    tracemalloc.start()  # before the engines that are kept, so that others in their place add nothing
    for x in positions[:20]:
        live.evaluate(h.with_value(effect.name, "position", float(x)))
    before = tracemalloc.get_traced_memory()[0]
    print(f"{0:7d} moves: {_resident():.0f} MB resident", flush=True)
    for k, x in enumerate(positions, 1):
        live.evaluate(h.with_value(effect.name, "position", float(x)))
        if k in (moves // 10, moves // 2, moves):
            added = (tracemalloc.get_traced_memory()[0] - before) / 1e6
            print(f"{k:7d} moves: {added:+.2f} MB, {_resident():.0f} MB resident", flush=True)
    tracemalloc.stop()


def _resident(process: int | str = "self") -> float:
    """Return the resident memory of a process [MB]."""
    pages = Path(f"/proc/{process}/statm").read_text(encoding="ascii").split()[1]
    return 1e-6 * int(pages) * os.sysconf("SC_PAGE_SIZE")


def browser() -> None:
    """Print the time from a slider's event in Chromium to the redrawn FRF, with the whole page around it."""
    from playwright.sync_api import sync_playwright

    from tests.conftest import CHROMIUM
    from tests.dovetail.test_desk_page import FLAGS, MOVED, TURNING, Server, Tab

    with tempfile.TemporaryDirectory() as folder, sync_playwright() as p:
        shutil.copytree(STUDY.parent, folder, dirs_exist_ok=True, ignore=shutil.ignore_patterns(".*"))
        server = Server(Path(folder) / STUDY.name)
        chromium = p.chromium.launch(executable_path=CHROMIUM, args=list(FLAGS))
        try:
            tab = Tab(chromium, server.address, patience=300_000)
            tab.page.get_by_role("combobox", name="Place", exact=True).click()
            tab.page.get_by_role("option", name="joint J", exact=True).click()
            tab.press(f"Add {TURNING}")
            slider = tab.page.get_by_role("slider", name=f"stiffness of {TURNING}")
            meter = tab.page.context.new_cdp_session(tab.page)
            meter.send("Performance.enable", {"timeDomain": "threadTicks"})

            def worked() -> float:
                """Return the time that the page's main thread has worked, without waiting [ms]."""
                metrics = meter.send("Performance.getMetrics")["metrics"]
                return 1e3 * next(m["value"] for m in metrics if m["name"] == "TaskDuration")

            tab.page.wait_for_timeout(2000)
            positions, start = np.linspace(2.0, 3.4, 40), worked()
            spent = [slider.evaluate(MOVED, float(x)) for x in positions]
            page, (half, most) = (worked() - start) / len(positions), np.percentile(spent, [50, 95])
            print(f"cross-beam in Chromium: {half:.0f} ms, 95 %: {most:.0f} ms; work of the page {page:.0f}")
        finally:
            chromium.close()
            server.close()


def main(chosen: list[str]) -> None:
    """Print the tables that are asked for."""
    print(f"{'':12s}{'parameter':36s}{'lines':>7s}{'basis':>7s}{'errors':>9s}{'page':>9s}{'95 %':>9s}  [ms]")
    study = load_study(Path(STUDY))
    live, known = LiveModel(fit_problem(study)), {e.name: e for e in study.candidates()}
    if "beams" in chosen:
        line("cross-beam", live, known["joint_stiffness:J.rx"], "stiffness", 100.0, 3000.0)
        line("cross-beam", live, known["point_mass:U"], "mass", 0.01, 1.0)
        line("cross-beam", live, known["point_mass:U"], "position", 0.1, 0.7)
    if "tower" in chosen:
        uncertain = Nuisance("frame", "E:steel", 0.02), Nuisance("frame", "rho:steel", 0.01)
        model, measurement = tower()
        candidates = {e.name: e for e in propose(model, ["stiffness_loss"], test=measurement)}
        high = LiveModel(begin(model, measurement, uncertain))
        for parameter, ends in (("loss", (0.1, 0.9)), ("position", (0.2, 0.8))):
            line("tower", high, candidates["stiffness_loss:leg4b"], parameter, *ends)
    if "browser" in chosen:
        browser()
    for word in chosen:
        name, _, moves = word.partition("=")
        if name == "hour":
            hour(live, known["point_mass:U"], int(moves or HOUR))


if __name__ == "__main__":
    main(sys.argv[1:] or ["beams", "tower"])
