"""Time from opening a report in Chromium to its first figure, and its size: cross-beam, 400 members, others.

The clock shows how long a reader waits on a machine that does nothing else. The page's own work is counted in
CPU seconds of its main thread, which other programs do not lengthen.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.report_opens [beams] [tower] [FOLDER ...]
"""

import sys
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks.diagnosis import STUDY
from benchmarks.written_tower import write_tower
from dovetail import load_study
from dovetail.desk import live_model, write_desk_report
from dovetail.file.config import StudyContents
from updating.live import Hypothesis

if TYPE_CHECKING:
    from playwright.sync_api import Browser

DRAWN = "document.querySelectorAll('figure[data-ready]').length"
HEAD = (
    f"{'report':20s}{'width':>6s}{'MB':>6s}{'load':>8s}{'first':>8s}{'CPU':>8s}   "
    "[s]: load event, first figure, main thread until then"
)


def written(study: StudyContents, folder: Path) -> Path:
    """Write the report of a study's nominal model, with its uncertain parameters fitted; return it."""
    live = live_model(study)
    return write_desk_report(study, live, Hypothesis.nominal(live.problem), folder, lambda text, done: None)


def line(chromium: "Browser", name: str, report: Path, width: int) -> None:
    """Print how long a report takes to open in a window of a width."""
    # the page's policy forbids the evaluation by which Playwright waits
    context = chromium.new_context(viewport={"width": width, "height": 900}, bypass_csp=True)
    page = context.new_page()
    page.set_default_timeout(300_000)
    meter = context.new_cdp_session(page)
    meter.send("Performance.enable", {"timeDomain": "threadTicks"})
    start = time.perf_counter()
    page.goto(report.resolve().as_uri())
    loaded = time.perf_counter() - start
    page.wait_for_function(f"{DRAWN} > 0")
    first = time.perf_counter() - start
    metrics = meter.send("Performance.getMetrics")["metrics"]
    cpu = next(m["value"] for m in metrics if m["name"] == "TaskDuration")
    size = report.stat().st_size / 1e6
    print(f"{name:20s}{width:6d}{size:6.1f}{loaded:8.2f}{first:8.2f}{cpu:8.2f}", flush=True)
    context.close()


def main(chosen: list[str]) -> None:
    """Print the table for what is asked for."""
    from playwright.sync_api import sync_playwright

    from tests.conftest import CHROMIUM
    from tests.dovetail.test_desk_page import FLAGS

    with tempfile.TemporaryDirectory() as folder, sync_playwright() as p:
        reports = {}
        for word in chosen:
            if word == "beams":
                reports[word] = written(load_study(STUDY), Path(folder) / "beams")
            elif word == "tower":
                reports[word] = written(load_study(write_tower(Path(folder))), Path(folder) / "tower")
            else:
                reports[Path(word).name] = Path(word) / "report.html"
        chromium = p.chromium.launch(executable_path=CHROMIUM, args=list(FLAGS))
        print(HEAD)
        for name, report in reports.items():
            for width in (1280, 1280, 400):
                line(chromium, name, report, width)
        chromium.close()


if __name__ == "__main__":
    main(sys.argv[1:] or ["beams", "tower"])
