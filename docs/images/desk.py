"""Take the pictures of docs/desk.md: python -m docs.images.desk [demo] [two] [views].

They show the demo, and a walk through its beams with two hidden effects, in Chromium.
"""

import shutil
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image
from playwright.sync_api import Page, sync_playwright

from dovetail import load_study
from dovetail.study import Study
from fem.analysis.frf import FRF
from fem.io import read_uff, write_uff

if TYPE_CHECKING:
    from tests.dovetail.test_desk_page import Tab

HERE = Path(__file__).parent
EXAMPLE = HERE.parents[1] / "examples" / "cross-beam"
TURNING, MASS = "joint_stiffness:J.rx", "point_mass:U"
TRUTH = {TURNING: {"stiffness": 400.0}, MASS: {"mass": 0.12, "position": 0.62}}
"""Effects that the study does not know."""


def measured_with_two(study: Study) -> FRF:
    """Return the FRFs of a study with the two effects, and 1 % noise."""
    for name, values in TRUTH.items():
        study = study.add(name, **values)
    frf, rng = study.frf(), np.random.default_rng(1)
    noise = 0.01 * (rng.standard_normal(frf.H.shape) + 1j * rng.standard_normal(frf.H.shape)) / np.sqrt(2)
    return FRF.from_arrays(frf.frequency, frf.H * (1 + noise), frf.kind, frf.outputs, frf.inputs)


def with_two(study: Study) -> Study:
    """Return a study that measured the two effects and does not know them."""
    first = study.measurements[0]
    return replace(study, measurements=(first.with_frf(measured_with_two(study)),))


def write_study(folder: Path) -> Path:
    """Write the example with such a measurement into a folder; return the study file."""
    for file in EXAMPLE.iterdir():
        if not file.name.startswith("."):
            shutil.copy(file, folder)
    path = folder / "study.toml"
    points, frf = read_uff(folder / "frf.uff").points, measured_with_two(load_study(path))
    nodes = {name: {"U": 0, "D": 10}[name[0]] + int(name[1]) for name in frf.outputs}
    write_uff(folder / "two.uff", frf, dofs={k: f"{n}Z+" for k, n in nodes.items()}, geometry=points)
    text = path.read_text(encoding="utf-8").replace('name = "Cross-beam"', 'name = "Two hidden effects"')
    path.write_text(text.replace('file = "frf.uff"', 'file = "two.uff"'), encoding="utf-8")
    return path


def take(page: Page, name: str, *, top: bool = True, part: str | None = None) -> None:
    """Take a picture of what the window shows, or of one part of the page, with few colours."""
    if top:
        page.evaluate("window.scrollTo(0, 0)")
    page.get_by_role("button", name="Cancel: ").first.wait_for(state="hidden")  # no job runs
    page.wait_for_timeout(2500)  # notices have gone, and figures are drawn
    path = HERE / f"{name}.png"
    (page if part is None else page.get_by_role("region", name=part, exact=True)).screenshot(path=path)
    Image.open(path).convert("RGB").quantize(255, dither=Image.Dither.NONE).save(path, optimize=True)


@contextmanager
def opened(study: Path) -> Iterator["Tab"]:
    """Open a study on a desk in Chromium, and print faults of page and server in the end."""
    from tests.conftest import CHROMIUM
    from tests.dovetail.test_desk_page import FLAGS, Server, Tab

    with sync_playwright() as p:
        server = Server(study)
        chromium = p.chromium.launch(executable_path=CHROMIUM, args=list(FLAGS))
        try:
            tab = Tab(chromium, server.address, patience=300_000)
            yield tab
            print(*tab.faults, sep="\n")
        finally:
            chromium.close()
            print(server.close())


def demo(folder: Path) -> None:
    """Take the picture of the demo with its joint stiffness at 197 N·m/rad."""
    shutil.copytree(EXAMPLE, folder, dirs_exist_ok=True, ignore=shutil.ignore_patterns(".*"))
    with opened(folder / "study.toml") as tab:
        page = tab.page
        page.set_viewport_size({"width": 1280, "height": 1180})
        tab.press("Fit uncertain parameters")
        fitted = tab.until(0, tab.error() - 0.2)
        page.get_by_role("combobox", name="Place", exact=True).click()
        page.get_by_role("option", name="joint J", exact=True).click()
        tab.press(f"Add {TURNING}")
        field = page.get_by_label(f"stiffness of {TURNING}, N·m/rad", exact=True)
        field.fill("197")
        field.press("Tab")
        tab.until(0, fitted - 0.5)
        page.get_by_label(f"evidence for {TURNING}").click()
        tab.press(f"Weigh {TURNING}")
        page.get_by_text("lines that no fit has seen", exact=False).wait_for()
        take(page, "desk")


def views(folder: Path) -> None:
    """Take the pictures of views and modes of the demo."""
    shutil.copytree(EXAMPLE, folder, dirs_exist_ok=True, ignore=shutil.ignore_patterns(".*"))
    with opened(folder / "study.toml") as tab:
        page = tab.page
        page.set_viewport_size({"width": 1280, "height": 1180})

        def view(name: str) -> None:
            page.get_by_role("combobox", name="View", exact=True).click()
            page.get_by_role("option", name=name, exact=True).click()

        view("Sensitivity")
        take(page, "desk-sensitivity", part="FRFs")
        view("CMIF")
        page.get_by_label("Logarithmic frequency").click()
        take(page, "desk-cmif", part="FRFs")
        page.emulate_media(reduced_motion="reduce")  # the shapes rest at their largest deflection
        tab.press("Compare modes")
        tab.press("Show mode 3")
        page.get_by_text("Measured mode 3, ").wait_for()
        page.locator(".desk-head").evaluate("(e) => { e.style.position = 'static'; }")
        take(page, "desk-modes", part="Modes")


def two(folder: Path) -> None:
    """Walk through the case of two effects, and take pictures on the way."""
    with opened(write_study(folder)) as tab:
        page = tab.page

        def added(spot: str, name: str) -> None:
            page.get_by_role("combobox", name="Place", exact=True).click()
            page.get_by_role("option", name=spot, exact=True).click()
            tab.press(f"Add {name}")
            page.get_by_role("group", name=name, exact=True).wait_for()

        def typed(parameter: str, value: str) -> None:
            before = tab.error()
            field = page.get_by_label(parameter, exact=False)
            field.fill(value)
            field.press("Tab")
            page.wait_for_function(
                "(was) => !document.querySelector('[data-figure=\"error, lines of the fit\"]')"
                ".textContent.startsWith(was)",
                arg=f"{before:.2f}",
            )

        def told(action: str) -> None:
            print(f"{action:50s}{tab.error():6.2f} dB", flush=True)

        told("open")
        tab.press("Fit uncertain parameters")
        tab.until(0, tab.error() - 0.2)
        told("fit uncertain parameters")
        page.get_by_text("Gain of each candidate", exact=False).wait_for()
        take(page, "desk-two-1")
        added("joint J", TURNING)
        typed(f"stiffness of {TURNING}, N·m/rad", "399")
        page.wait_for_timeout(1500)
        told("joint stiffness, 399 N·m/rad")
        added("member U", MASS)
        typed(f"position of {MASS}, m", "0.6")
        told("point mass, position 0.6 m")
        typed(f"mass of {MASS}, kg", "0.1")
        told("mass 0.1 kg")
        take(page, "desk-two-2")
        tab.press("Fit all")
        tab.until(0, 1)
        told("fit all")
        take(page, "desk-two-3")
        page.set_viewport_size({"width": 400, "height": 860})
        take(page, "desk-two-narrow-1")
        page.get_by_role("region", name="Added effects").scroll_into_view_if_needed()
        page.locator('section[aria-label="Added effects"]').evaluate("(e) => e.scrollIntoView()")
        take(page, "desk-two-narrow-2", top=False)


def main(chosen: list[str]) -> None:
    """Take the pictures that are asked for."""
    for word, walk in {"demo": demo, "two": two, "views": views}.items():
        if word in chosen:
            with tempfile.TemporaryDirectory() as folder:
                walk(Path(folder))


if __name__ == "__main__":
    main(sys.argv[1:] or ["demo", "two", "views"])
