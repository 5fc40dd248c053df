"""The report's interactive figures: data, what a browser does with them, and the same story elsewhere."""

import json
import re
import sys
import time
import zlib
from base64 import b64decode
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest
from plotly.offline import get_plotlyjs

from dovetail import load_study, main
from dovetail.report import (
    Album,
    OutlinePicture,
    TableBlock,
    blocks,
    compared_models,
    drawings,
    figures,
    pair_errors,
    probable,
    quadrature_shapes,
    read_outline,
    report_html,
    report_page,
    words,
)
from fem import FRF
from tests.dovetail.test_modes_alone import written_shapes
from tests.frames import beam
from updating import FAULT, Fault
from updating.correlation import rms_db
from updating.diagnosis import modes_of
from updating.diagnosis.verdict import Explanation
from viz import displacement_at, frf, ranking
from viz.curves import frf_curves
from viz.interactive import draw, model, solids
from viz.interactive.theme import CONFIG

NASTY = "a<b>&\"'{x}%{y}$z$"
CHROMIUM = (
    "--no-sandbox",
    "--disable-gpu",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
)


@pytest.fixture(scope="module")
def found(bent):
    return bent


@pytest.fixture(scope="module")
def live(found):
    return figures.make_all(found)


@pytest.fixture(scope="module")
def folder(bent):
    """Return the folder with the report, whose structure is drawn by no picture."""
    return bent.folder


# ------------------------------------------------------------------------------------------------------- data


def unpacked(store):
    """Return the arrays of a store by series and quantity, (n_out, n_in, n_freq), as the page reads them."""
    steps = np.frombuffer(zlib.decompress(b64decode(store["data"])), dtype="<i2").astype(np.int64)
    shape = (-1, len(store["outputs"]), len(store["inputs"]), len(store["frequency"]))
    whole = np.cumsum(steps.reshape(shape), axis=3)
    whole = (whole + 2**15) % 2**16 - 2**15
    return {
        (b["series"], b["quantity"]): np.where(values == store["gap"], np.nan, values * b["step"])
        for b, values in zip(store["blocks"], whole, strict=True)
    }


def test_all_frfs_are_in_the_page_to_a_hundredth_of_a_decibel(found, live):
    store = live.data["frf"]
    known = unpacked(store)
    d = found.diagnosis
    mask = np.moveaxis(d.problem.data.mask, 0, 2)
    every = "measured" if mask.all() else "measured, not compared"
    sources = {every: d.measured, **compared_models(found).frfs}
    assert store["every"] == 1
    np.testing.assert_array_equal(np.isfinite(known["measured", "magnitude"]), mask)
    for label, source in sources.items():
        H = np.moveaxis(source.as_kind(d.measured.kind).H, 0, 2)
        assert known[label, "magnitude"] == pytest.approx(20 * np.log10(np.abs(H)), abs=0.0051)
        assert known[label, "phase"] == pytest.approx(np.rad2deg(np.angle(H)), abs=0.0051)
    assert [s for s, q in known if q == "spread"] == ["with the effect"]
    for label, step in zip(compared_models(found).frfs, compared_models(found).steps, strict=True):
        told = np.array(store["errors"][label], dtype=float)
        assert told == pytest.approx(pair_errors(found, step), abs=0.0051, nan_ok=True)


def test_the_error_of_a_pair_is_that_of_a_comparison(found):
    c = found.comparisons[-1]
    assert pair_errors(found, -1)[1, 0] == pytest.approx(rms_db(c.log_ratio[:, 1, 0]))


def test_values_that_are_missing_or_jump_are_kept():
    H = np.array([1e-6, 0, 1e6, -1e-3, 1e3j, 0])[:, None, None]
    known = frf_curves(FRF.from_arrays(np.arange(1.0, 7), H))
    coherence = np.linspace(0, 1, 6)[:, None, None]
    store = figures.frf_store(known, coherence, {"nominal": np.array([[np.nan]])})
    read = unpacked(store)
    magnitude, phase = (read["measured", q].ravel() for q in ("magnitude", "phase"))
    assert magnitude == pytest.approx([-120, np.nan, 120, -60, 60, np.nan], nan_ok=True)
    assert phase == pytest.approx([0, np.nan, 0, 180, 90, np.nan], nan_ok=True)
    assert read["measured", "coherence"].ravel() == pytest.approx(coherence.ravel(), abs=1e-4)
    assert store["errors"] == {"nominal": [[None]]}


def test_of_very_many_lines_every_second_is_kept(monkeypatch):
    known = frf_curves(FRF.from_arrays(np.arange(1.0, 101), 1j * np.arange(1.0, 101)))
    monkeypatch.setattr(figures, "MOST_VALUES", 150)
    store = figures.frf_store(known)
    assert (store["every"], len(store["frequency"])) == (2, 50)
    read = unpacked(store)["measured", "magnitude"].ravel()
    assert read == pytest.approx(20 * np.log10(np.arange(1.0, 101, 2)), abs=0.0051)


def test_every_figure_is_made(live):
    assert live.failures == []
    names = "model staircase map-fitted map-final misfit frf frf-error modes mac probability"
    rankings = {name for name in live.known if name.startswith("ranking-")}  # one a round
    assert "ranking-1" in rankings
    assert set(live.known) - rankings == set(names.split())


def test_figures_show_the_diagnosis(found, live):
    d = found.diagnosis
    assert list(live.known["staircase"].data[0].y) == [s.fit_db for s in d.steps]
    heat = live.known["map-final"].data[0]
    assert np.asarray(heat.z) == pytest.approx(found.comparisons[-1].by_band(), rel=1e-6, nan_ok=True)
    shown = next(t for t in live.known["model"].data if (t.meta or {}).get("role") == "finding")
    (finding,) = d.findings
    place = finding.effect.locations(found.study.model)[0]
    assert (shown.x[0], shown.y[0], shown.z[0]) == pytest.approx(tuple(place), abs=1e-6)
    assert list(shown.customdata) == [finding.effect.where]
    accepted = next(t for t in live.known["ranking-1"].data if t.name == "accepted")
    assert list(accepted.customdata) == [finding.effect.name]
    assert accepted.x[0] + accepted.base[0] == pytest.approx(d.rounds[0][0].fit_db)


def test_a_fault_is_marked_at_its_sensor(found):
    d = found.diagnosis
    faults = (Fault("sensor_gain", "A", 1.2, 0.03),)
    less = replace(d, verdict=FAULT, findings=(), faults=faults, steps=d.steps[:2])
    made = figures.make_all(replace(found, diagnosis=less, comparisons=found.comparisons[:2]))
    assert made.failures == []
    assert "map-final" not in made.known
    shown = next(t for t in made.known["model"].data if (t.meta or {}).get("role") == "fault")
    sensor = next(s for s in d.problem.data.measurement.sensors if s.name == "A")
    assert (shown.x[0], shown.y[0], shown.z[0]) == pytest.approx(tuple(sensor.point), abs=1e-6)
    assert made.known["model"].layout.scene.annotations[-1].text == "<b>A: gain 1.20</b>"
    assert [t["label"] for t in made.known["modes"].layout.meta["modes"]]


def test_measured_shapes_are_those_of_the_modes(found):
    """FRFs of the model itself, at its resonances, have the shapes of its modes."""
    d = found.diagnosis
    _, _, fitted = modes_of(d)
    shapes = quadrature_shapes(found.diagnosis, fitted)
    assert set(shapes) == set(range(fitted.n_rigid, fitted.n_modes))
    along = np.array([s.direction for s in d.problem.data.measurement.sensors])
    seen = 0
    for k, (points, vectors) in shapes.items():
        computed = displacement_at(d.model, fitted.shapes[:, k], points)
        one, two = (np.einsum("ij,ij->i", v, along) for v in (vectors, computed))
        if np.abs(two).max() < 1e-9 * np.abs(fitted.shapes[:, k]).max():  # out of the plane of the sensors
            continue
        seen += 1
        assert (one @ two) ** 2 / (one @ one) / (two @ two) > 0.99
    assert seen >= 2


def test_a_figure_that_cannot_be_made_is_named():
    out = drawings.Figures()
    out.add("model", lambda: 1 / 0)
    assert out.known == {}
    assert "The figure model could not be made (ZeroDivisionError" in out.failures[0]


def test_probabilities_are_told_where_the_search_gives_them(found, tmp_path):
    by_hand = replace(found, diagnosis=replace(found.diagnosis, posterior=()))
    assert probable.probability_text(by_hand.diagnosis) == ""
    assert "How probable" not in report_html(by_hand, Album(tmp_path), figures.make_all(by_hand))
    (finding,) = found.diagnosis.findings
    posterior = (((finding.effect.name,), 0.93), ((), 0.05), (("unknown",), 0.02))
    told = (
        Explanation((finding.effect,), (finding.parameters,), 0.93),
        Explanation((), (), 0.05),
        Explanation((), (), 0.02, known=False),
    )
    sure = replace(found, diagnosis=replace(found.diagnosis, posterior=posterior, explanations=told))
    page = report_html(sure, Album(tmp_path), figures.make_all(sure))
    head, rest = page.split("<main", 1)
    assert "Probability of this effect, alone or with others: 93\u00a0%" in head
    assert "This effect alone: 93\u00a0%" in rest
    assert re.search(r"nothing missing</th><td[^>]*>5\u00a0%", rest)
    assert "something that the library does not have" in rest
    reported, others = figures.make_all(sure).known["probability"].data
    assert [*reported.x, *others.x] == [0.93, 0.05, 0.02]


def test_names_cannot_end_a_script():
    text = drawings.as_json({"name": "</script><script>alert(1)</script>"})
    assert "<" not in text
    assert json.loads(text)["name"].startswith("</script>")


def test_the_page_holds_everything_once_and_is_small(folder):
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert len(page.encode()) < 10e6
    assert page.count("plotly.js v") == 1
    assert not re.search(r'<(?:script|link|img|iframe)[^>]*\s(?:src|href)="(?!data:)', page)


# ---------------------------------------------------------------------------------------------------- browser


@pytest.fixture(scope="module")
def chromium(browser):
    """Return Chromium, running for all tests of this file."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        running = playwright.chromium.launch(executable_path=str(browser), args=list(CHROMIUM))
        yield running
        running.close()


@contextmanager
def opened(chromium, file, width=1280, height=900, **more):
    """Open a page; complain about requests and errors when it is closed."""
    context = chromium.new_context(viewport={"width": width, "height": height}, **more)
    page, complaints = context.new_page(), []
    page.on("console", lambda m: complaints.append(m.text) if m.type == "error" else None)
    page.on("pageerror", lambda e: complaints.append(str(e)))
    page.on("request", lambda r: complaints.append(r.url) if r.url.startswith(("http", "ws")) else None)
    page.set_default_timeout(120_000)
    page.goto(file.as_uri())
    yield page
    assert complaints == []
    context.close()


def drawn(page, name):
    """Scroll to a figure; return it once it is drawn."""
    box = page.locator(f'figure[data-figure="{name}"]')
    box.scroll_into_view_if_needed()
    page.wait_for_selector(f'figure[data-figure="{name}"][data-ready]')
    return box


def legend_below_the_bar(page, name):
    """Return whether the legend of a figure begins below its tool bar."""
    box = f"document.querySelector('figure[data-figure=\"{name}\"] PART').getBoundingClientRect()"
    legend, bar = (page.evaluate(box.replace("PART", part)) for part in (".legend .bg", ".modebar"))
    return legend["height"] > 0 and legend["top"] >= bar["bottom"]


def wait_until(page, condition, timeout=120.0):
    """Wait until an expression is true; `wait_for_function` evaluates in the page, which forbids that."""
    end = time.monotonic() + timeout
    while not page.evaluate(condition):
        assert time.monotonic() < end, f"not true after {timeout:g} s: {condition}"
        page.wait_for_timeout(50)


EYE = "document.querySelector('figure[data-figure=model] .plot')._fullLayout.scene.camera.eye"
SHOWN = """() => Array.from(document.querySelector('figure[data-figure=frf] .plot').data
  .find((t) => t.meta && t.meta.series === 'measured' && t.meta.quantity === 'magnitude').y)"""


def test_the_structure_turns_and_frfs_are_picked(folder, found, chromium):
    measured = found.diagnosis.measured
    with opened(chromium, folder / "report.html") as page:
        plot = drawn(page, "model").locator(".plot")
        before = page.evaluate(EYE)
        box = plot.bounding_box()
        x, y = box["x"] + box["width"] / 2, box["y"] + 0.7 * box["height"]
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x + 120, y, steps=4)
        page.mouse.up()
        wait_until(page, f"Math.abs({EYE}.x - {before['x']}) > 0.1")
        turned = page.evaluate(EYE)
        assert legend_below_the_bar(page, "model")
        plot.focus()
        page.keyboard.press("ArrowLeft")
        # near the x-axis a turn leaves x as it was
        wait_until(page, f"Math.hypot({EYE}.x - {turned['x']}, {EYE}.y - {turned['y']}) > 0.01")

        assert page.get_by_role("button", name="Share chart").count() == 0  # it would send the data away
        figure = drawn(page, "frf")
        response, force = figure.locator("select").all()
        for output, input_ in ((o, measured.inputs[0]) for o in measured.outputs[:2]):
            response.select_option(output)
            force.select_option(input_)
            page.wait_for_selector(f'figure[data-figure="frf"][data-pair="{output}/{input_}"]')
            H = measured.select([output], [input_]).H[:, 0, 0]
            assert page.evaluate(SHOWN) == pytest.approx(20 * np.log10(np.abs(H)), abs=0.0051)
        assert figure.locator("output").inner_text().startswith("error: nominal ")
        figure.locator('button[data-step="1"]').click()
        pair = "document.querySelector('figure[data-figure=frf]').dataset.pair"
        wait_until(page, f"!{pair}.startsWith({json.dumps(measured.outputs[1] + '/')})")


def test_a_click_in_the_structure_names_the_frf_that_it_shows(folder, found, chromium):
    measured = found.diagnosis.measured
    with opened(chromium, folder / "report.html") as page:
        figure = drawn(page, "model")
        click = {"points": [{"data": {"meta": {"role": "sensor"}}, "customdata": measured.outputs[-1]}]}
        plot = figure.locator(".plot")
        plot.evaluate("(plot, e) => plot.emit('plotly_click', e)", click)
        shown = f"{measured.outputs[-1]} / {measured.inputs[0]}"
        assert figure.get_by_role("status").inner_text() == f"Shown below: FRF {shown}"
        page.wait_for_selector(f'figure[data-figure="frf"][data-pair="{shown.replace(" / ", "/")}"]')
        figure.get_by_role("link", name=f"FRF {shown}").click()
        top = "document.querySelector('figure[data-figure=frf]').getBoundingClientRect().top"
        wait_until(page, f"Math.abs({top}) < innerHeight / 2")


def test_frequencies_of_frfs_can_be_logarithmic(folder, found, chromium):
    f = found.diagnosis.measured.frequency
    axis = "(plot) => [plot._fullLayout.xaxis.type, ...plot._fullLayout.xaxis.range]"
    with opened(chromium, folder / "report.html") as page:
        figure = drawn(page, "frf")
        plot, box = figure.locator(".plot"), figure.get_by_label("logarithmic frequency")
        box.check()
        kind, *ends = plot.evaluate(axis)
        assert kind == "log"
        assert ends == pytest.approx(np.log10([f[f > 0][0], f[-1]]), abs=1e-6)
        figure.locator('button[data-step="1"]').click()
        assert plot.evaluate(axis)[0] == "log"  # another FRF keeps it
        box.uncheck()
        assert plot.evaluate(axis) == ["linear", pytest.approx(f[0]), pytest.approx(f[-1])]


def test_joints_are_coloured_by_their_share(found):
    known = found.localisation
    # shares that say where: those of the fixture are below what is drawn
    where = replace(known, places=tuple((name, 5 * share) for name, share in known.places))
    assert where.says_where
    figure = figures.make_all(replace(found, localisation=where)).known["misfit"]
    (marks,) = (t for t in figure.data if (t.meta or {}).get("role") == "joint")
    shares = dict(where.places)
    assert marks.customdata[0] == where.places[0][0]
    assert {shares[name] for name in marks.customdata} <= set(shares.values())
    np.testing.assert_allclose(marks.marker.color, [100 * shares[n] for n in marks.customdata], rtol=1e-6)
    members = next(t for t in figure.data if (t.meta or {}).get("role") == "member")
    largest = 100 * max(*shares.values(), *where.members.values())
    assert members.cmax == marks.marker.cmax == pytest.approx(largest)
    point = np.array([marks.x[0], marks.y[0], marks.z[0]])
    assert np.linalg.norm(where.points[marks.customdata[0]] - point, axis=1).min() < 1e-6


def test_a_click_on_the_map_shows_the_sensor(folder, found, chromium):
    sensors = found.comparisons[0].outputs
    with opened(chromium, folder / "report.html") as page:
        area = drawn(page, "map-fitted").locator(".nsewdrag")
        row = len(sensors) - 1
        place = {"x": 12, "y": area.bounding_box()["height"] * (row + 0.5) / len(sensors)}
        area.hover(position=place)
        page.wait_for_selector('figure[data-figure="map-fitted"] .hovertext', state="attached")
        area.click(position=place)
        page.wait_for_selector(f'figure[data-figure="frf"][data-pair^="{sensors[row]}/"]')


def test_a_report_of_modes_fits_a_narrow_page(chromium, tmp_path, monkeypatch):
    monkeypatch.setattr("dovetail.report.pictures.can_draw", lambda: False)
    done = load_study(written_shapes(tmp_path)).run(tmp_path / "out")
    with opened(chromium, done.report, width=400) as page:
        for name in ("staircase", "model", "probability", "deviations", "mac", "modes"):
            drawn(page, name)
        assert page.evaluate("document.documentElement.scrollWidth") <= 400


@pytest.mark.slow
def test_any_mode_moves(folder, live, chromium):
    told = live.known["modes"].layout.meta["modes"]
    top = "Math.max(...document.querySelector('figure[data-figure=modes] .plot').data[1].z)"
    with opened(chromium, folder / "report.html") as page:
        figure = drawn(page, "modes")
        listed = figure.locator("option").all_inner_texts()
        assert listed == [m["label"] for m in told]
        rest = np.asarray(live.known["modes"].data[1].z, dtype=float)
        for k in (0, len(told) - 1):
            figure.locator("select").select_option(index=k)
            page.wait_for_selector(f'figure[data-figure="modes"][data-mode="{k}"]')
            moved = rest + told[k]["step"] * np.asarray(told[k]["surface"]).reshape(-1, 3)[:, 2]
            wait_until(page, f"Math.abs({top} - {moved.max()}) < 1e-6")
        figure.locator(".tools button").click()
        wait_until(page, f"Math.abs({top} - {moved.max()}) > 1e-5")
        assert figure.locator(".tools button").get_attribute("aria-pressed") == "true"


@pytest.mark.slow
def test_a_narrow_page_does_not_scroll_sideways(folder, live, chromium):
    with opened(chromium, folder / "report.html", 400, 800, color_scheme="dark") as page:
        for name in ("staircase", "model", "map-fitted", "ranking-1", "frf-error", "frf", "modes"):
            drawn(page, name)
        for name in ("staircase", "model", "ranking-1", "frf-error", "frf", "modes"):
            assert legend_below_the_bar(page, name), name
        assert page.evaluate("document.documentElement.scrollWidth") == 400
        plot = "document.querySelector('figure[data-figure=frf] .plot')"
        colour = page.evaluate(f"{plot}.data.find(t => t.name === 'measured').line.color")
        assert colour == "#e6edf3"  # measured FRFs are light on a dark page
        ink, paper = page.evaluate(
            "(() => { const s = getComputedStyle(document.documentElement);"
            "return [s.color, s.backgroundColor]; })()"
        )
        assert (ink, paper) == ("rgb(230, 237, 243)", "rgb(13, 17, 23)")


def test_without_scripts_and_on_paper_there_are_still_pictures(folder, chromium):
    with opened(chromium, folder / "report.html", java_script_enabled=False) as page:
        assert page.get_by_text("Verdict: effect").is_visible()
        stills = page.locator('figure[data-figure="staircase"] img, figure[data-figure="frf"] img')
        assert stills.count() >= 2
        assert all(image.is_visible() for image in stills.all())
        assert not page.locator('figure[data-figure="staircase"] .plot').is_visible()
    with opened(chromium, folder / "report.html") as page:
        figure = drawn(page, "staircase")
        assert not figure.locator("img").is_visible()
        page.emulate_media(media="print")
        assert figure.locator("img").is_visible()
        assert not figure.locator(".plot").is_visible()


def test_names_with_tags_stay_text_in_a_browser(chromium, tmp_path):
    place = solids.MarkedPlace(np.array([0.3, 0, 0]), "place", NASTY)
    one = FRF.from_arrays(np.arange(1.0, 9), np.arange(1.0, 9), "mobility", [NASTY], ["f"])
    made = (
        model.model_figure(beam(2), places=[place]),
        draw(ranking([NASTY, "other"], [1.0, 2.0], 3.0)),
        draw(frf(one, {f"with {NASTY}": one})),
    )
    parts = [m.to_html(full_html=False, include_plotlyjs=False, config=CONFIG) for m in made]
    file = tmp_path / "names.html"
    file.write_text(f"<script>{get_plotlyjs()}</script>{''.join(parts)}", encoding="utf-8")
    with opened(chromium, file) as page:
        every = "Array.from(document.querySelectorAll('svg text')).map((t) => t.textContent)"
        for wanted in (NASTY, f"with {NASTY}", f"{NASTY} / f"):
            wait_until(page, f"{every}.includes({json.dumps(wanted)})")


# ------------------------------------------------------------------------------------------ Word, PowerPoint


def test_the_outline_tells_the_page(folder, found):
    outline = read_outline(folder)
    assert outline.name == "bent <bar>"
    assert outline.texts("kind") == ("Verdict: effect",)
    assert outline.texts("sentence") == (words.headline(found.diagnosis),)
    headings = [p.heading for p in outline.parts if p.level == 1]
    assert headings[:4] == ["How sure", "Compared data", "Checks of the measurement", "Where it fails"]
    steps = next(b for b in outline.blocks() if isinstance(b, TableBlock) and b.head[0] == "step")
    assert [row[1] for row in steps.rows] == [f"{s.fit_db:.2f}" for s in found.diagnosis.steps]
    assert 1 in steps.numbers
    pictures = [b for b in outline.blocks() if isinstance(b, OutlinePicture)]
    assert pictures[0].content == (folder / "pictures" / "staircase.png").read_bytes()
    assert all(p.caption for p in pictures)
    assert not any("show" in item.split() for b in outline.blocks() for item in getattr(b, "items", ()))


def test_pictures_come_from_the_page_where_the_files_are_gone(folder, tmp_path):
    (tmp_path / "report.html").write_bytes((folder / "report.html").read_bytes())
    pictures = [b for b in read_outline(tmp_path).blocks() if isinstance(b, OutlinePicture)]
    assert len(pictures) == len([b for b in read_outline(folder).blocks() if isinstance(b, OutlinePicture)])
    assert all(p.content.startswith(b"\x89PNG") for p in pictures)


def test_word_tells_the_same_story(folder, found, tmp_path, capsys):
    docx = pytest.importorskip("docx")
    file = tmp_path / "report.docx"
    assert main(["report", str(folder), "--docx", str(file)]) == 0
    printed = capsys.readouterr().out
    assert re.fullmatch(rf"Word document of bent <bar>: {file} \(\d+ sections, \d+ pictures?\)\n", printed)
    document = docx.Document(str(file))
    texts = [p.text for p in document.paragraphs]
    assert texts[0] == "bent <bar>"
    assert words.headline(found.diagnosis) in texts
    headings = [p.text for p in document.paragraphs if p.style.name.startswith("Heading")]
    assert "Missing effects" in headings
    cells = [[c.text for c in row.cells] for row in document.tables[0].rows]
    assert cells[0][0] == "step"
    assert cells[-1][1] == f"{found.diagnosis.steps[-1].fit_db:.2f}"
    outline = read_outline(folder)
    assert len(document.inline_shapes) == sum(isinstance(b, OutlinePicture) for b in outline.blocks())
    assert document.inline_shapes[0]._inline.docPr.get("descr").startswith("Error after each step")
    assert document.core_properties.title == "bent <bar>"


def test_slides_tell_it_shorter(folder, found, tmp_path):
    pptx = pytest.importorskip("pptx")
    file = tmp_path / "report.pptx"
    assert main(["report", str(folder), "--pptx", str(file), "--quiet"]) == 0
    show = pptx.Presentation(str(file))
    first = "\n".join(s.text_frame.text for s in show.slides[0].shapes if s.has_text_frame)
    assert words.headline(found.diagnosis) in first
    assert "mass 0.2" in first
    titles = [s.shapes.title.text_frame.text for s in show.slides]
    assert "FRFs before and after" in titles
    assert not any(title.startswith("Assumptions") for title in titles)
    for slide in show.slides:
        for shape in slide.shapes:
            assert shape.left >= 0
            assert shape.left + shape.width <= show.slide_width
    pictures = [s for slide in show.slides for s in slide.shapes if s.shape_type == 13]
    assert len(pictures) >= 4
    assert all(p.top + p.height <= show.slide_height for p in pictures)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((), "nothing to write; give --docx FILE, --pptx FILE or both"),
        (("--docx", "missing/report.docx"), "there is no folder"),
    ],
)
def test_a_report_that_cannot_be_written_is_refused(folder, arguments, said, capsys):
    assert main(["report", str(folder), *arguments]) == 2
    assert said in capsys.readouterr().err


def test_a_folder_without_a_report_is_refused(tmp_path, capsys):
    assert main(["report", str(tmp_path), "--docx", str(tmp_path / "a.docx")]) == 2
    assert "has no report.html; give a folder that 'dovetail run" in capsys.readouterr().err


def test_a_page_without_an_outline_is_refused_with_what_to_do(folder, tmp_path, capsys):
    page = (folder / "report.html").read_text(encoding="utf-8")
    older = re.sub(r"<template.*?</template>", "", page)
    assert len(older) < len(page)
    (tmp_path / "report.html").write_text(older, encoding="utf-8")
    assert main(["report", str(tmp_path), "--docx", str(tmp_path / "a.docx")]) == 2
    assert "has no outline for other programs; write it again" in capsys.readouterr().err


def test_blocks_without_content_are_shown_nowhere():
    empty = blocks.ReportSection("Notes", [blocks.Items(()), blocks.Details("more", [blocks.Text("")]), None])
    report = blocks.Report("a", "nothing", [blocks.Text("first <b>", "kind")], [empty])
    text = report_page(report)
    assert "Notes" not in text
    assert '<p class="kind">first &lt;b&gt;</p>' in text


@pytest.mark.parametrize(("option", "package"), [("--docx", "python-docx"), ("--pptx", "python-pptx")])
def test_a_missing_library_is_named_with_its_command(folder, tmp_path, option, package, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, option.strip("-"), None)
    assert main(["report", str(folder), option, str(tmp_path / "out")]) == 2
    message = capsys.readouterr().err
    assert message.count("\n") == 1
    assert f"{package} is not installed; install it with: python -m pip install {package}" in message
    assert not (tmp_path / "out").exists()
