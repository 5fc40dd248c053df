"""Pages of the site: links, output of commands, tables, and nothing loaded from a network; the tutorial."""

import re
import runpy
from pathlib import Path

import numpy as np
import pytest

from docs.make import gallery, offline, pages
from dovetail import load_study
from fem.io import read_frf

ROOT = Path(__file__).parents[2]
FRAME = ROOT / "examples" / "first-frame"
TUTORIAL = ROOT / "docs" / "first-frame.md"


@pytest.mark.parametrize(
    ("page", "link", "expected"),
    [
        ("docs/index.md", "[a](files.md#units)", "[a](files.md#units)"),
        ("docs/index.md", "[a](../CONTRIBUTING.md)", "[a](contributing.md)"),
        ("docs/index.md", "[a](../examples/10_x.py)", "[a](gallery/10_x.md)"),
        ("docs/index.md", "[a](../examples)", "[a](gallery/index.md)"),
        ("docs/index.md", "[`t`](../tests/t.md)", "`t`"),
        ("docs/index.md", "[the study](../examples/y/study.toml)", "the study"),
        ("docs/index.md", "[a](https://a.org)", "[a](https://a.org)"),
        ("docs/index.md", "![a](images/demo.png)", "![a](images/demo.png)"),
        ("docs/reference/fem.md", "[a](../files.md)", "[a](../files.md)"),
        ("CONTRIBUTING.md", "[a](docs/result.md)", "[a](result.md)"),
    ],
)
def test_links_lead_to_pages_of_the_site(page, link, expected):
    assert pages.with_site_links(link, ROOT / page, ROOT, ["10_x"]) == expected


def test_commands_run_beside_the_page(tmp_path):
    text = "```console examples/first-frame\n$ dovetail new begun\n```\n\n"
    text += "<!-- picture examples/first-frame/{} X -->\n"
    written = text.format("begun/study.toml")
    page = pages.expand(written, tmp_path / "page.md", ROOT)
    assert "$ dovetail new begun\nbegun/study.toml is written" in page
    assert page.endswith("![X](page/study.toml)\n")
    assert not (FRAME / "begun").exists()
    other = text.replace("new begun", "--version").format("other.png")
    with pytest.raises(pages.PageError, match="no command has written"):
        pages.expand(other, tmp_path / "other.md", ROOT)


def test_a_command_that_fails_ends_the_build(tmp_path):
    with pytest.raises(pages.PageError, match="exit code 2"):
        pages.expand("```console docs\n$ dovetail modes absent.toml\n```\n", tmp_path / "page.md", ROOT)


def test_a_table_has_a_row_for_each_line(tmp_path):
    (tmp_path / "x.csv").write_text("a_b,c\n1,2\n", encoding="utf-8")
    assert pages.table(tmp_path / "x.csv") == "| a b | c |\n| --- | --- |\n| 1 | 2 |"


def test_a_script_that_fails_ends_the_build(tmp_path):
    (tmp_path / "bad.py").write_text('"""Bad."""\nassert 1 == 2\n', encoding="utf-8")
    with pytest.raises(pages.PageError, match=r"bad\.py: exit code 1"):
        gallery.run(tmp_path / "bad.py", tmp_path)


def test_an_example_has_its_output_and_pictures(tmp_path):
    code = (
        '"""Draw.\n\nMore."""\nimport tempfile\nopen(tempfile.mkdtemp() + "/a.png", "w").close()\nprint(7)\n'
    )
    (tmp_path / "10_draw.py").write_text(code, encoding="utf-8")
    page = gallery.page(gallery.run(tmp_path / "10_draw.py", tmp_path))
    assert page.startswith("# Draw\n\nMore.\n\n![a](10_draw-a.png)\n\n```text\n7\n```\n")
    assert (tmp_path / "10_draw-a.png").exists()


def test_the_index_of_the_gallery_has_a_card_with_picture_title_and_number():
    example = gallery.Example("16_x", "A crack: how deep", "", "", "path\n90 %", ("16_x-a.png",))
    notebook = gallery.Example("45_y", "By hand", "", "", "", ())
    text = gallery.index([notebook, example])
    assert "## Update" not in text
    frames, compare = text.split("## Compare and find")
    assert frames.index("16_x-a.png") < frames.index("**[A crack](16_x.md)**") < frames.index("`90 %`")
    assert "-   **[By hand](45_y.md)**\n" in compare


def test_every_example_is_below_one_heading_of_the_gallery():
    listed = [n for numbers in gallery.GROUPS.values() for n in numbers]
    assert len(listed) == len(set(listed))
    assert {int(p.name[:2]) for p in gallery.sources(ROOT / "examples")} <= set(listed)


@pytest.mark.parametrize(
    ("text", "n"),
    [
        ('<script src="https://x.org/a.js"></script>', 1),
        ('<link rel="stylesheet" href="//x.org/a.css">', 1),
        ("<style>@import url(https://x.org/a.css)</style>", 1),
        ('<img src="a.png"><script src="../a.js"></script>', 0),
        ('<a href="https://x.org">x</a><link rel="canonical" href="https://x.org">', 0),
    ],
)
def test_sources_from_elsewhere_are_seen(tmp_path, text, n):
    (tmp_path / "a.html").write_text(text, encoding="utf-8")
    assert len(list(offline.loaded_from_elsewhere(tmp_path))) == n


def test_every_page_is_in_the_navigation():
    listed = set(re.findall(r"([\w/-]+\.md)\b", (ROOT / "mkdocs.yml").read_text(encoding="utf-8")))
    scripts = [*ROOT.glob("examples/[0-9]*.py"), *ROOT.glob("examples/[0-9]*.ipynb")]
    examples = {f"gallery/{path.stem}.md" for path in scripts}
    assert listed == set(pages.sources(ROOT).values()) | examples | {"gallery/index.md"}


def test_the_tutorial_begins_with_the_error_that_it_states():
    (stated,) = re.findall(r"misses the measured\s+FRFs by (\d+) dB", TUTORIAL.read_text(encoding="utf-8"))
    assert load_study(FRAME / "study.toml").compare().total_db == pytest.approx(float(stated), abs=0.5)


def test_the_tutorial_has_the_measurement_that_its_script_simulates(tmp_path):
    (tmp_path / "frame.msh").write_bytes((FRAME / "frame.msh").read_bytes())
    (tmp_path / "simulate.py").write_bytes((FRAME / "simulate.py").read_bytes())
    runpy.run_path(str(tmp_path / "simulate.py"), run_name="__main__")
    ours, theirs = read_frf(tmp_path / "test.uff"), read_frf(FRAME / "test.uff")
    # single precision; FRFs that are 0 by symmetry are rounding
    np.testing.assert_allclose(ours.H, theirs.H, rtol=1e-5, atol=1e-12 * np.abs(theirs.H).max())


@pytest.mark.slow
def test_the_tutorial_finds_the_hidden_effect(tmp_path, offscreen):
    page = pages.expand(TUTORIAL.read_text(encoding="utf-8"), tmp_path / "first-frame.md", ROOT)
    assert "Support left foot is flexible about y" in page
    value, std = map(float, re.findall(r"stiffness\s([\d.]+)\s±\s([\d.]+)\skN·m/rad", page)[0])
    assert abs(value - 20.0) < 2 * std
    assert std < 0.5
    assert len(list((tmp_path / "first-frame").glob("*.png"))) == 5


def test_the_benchmark_book_has_a_table_of_each_source():
    from benchmarks.book.shelf import SOURCES

    text = (ROOT / "docs" / "benchmark-book.md").read_text(encoding="utf-8")
    assert sorted(pages.BOOK.findall(text)) == sorted([*SOURCES, "summary"])


def test_a_table_of_the_book_states_reference_result_and_deviation(tmp_path):
    page = pages.expand("<!-- book textbooks -->\n", tmp_path / "page.md", ROOT)
    rows = [row for row in page.splitlines() if row.startswith("| ")]
    logan = next(row for row in rows if "Logan" in row)
    # Which of the three reactions is the worst depends on rounding: two are opposite, the third is 30 kip.
    assert re.search(r"\| -?(11\.6877 \| -?11\.687|30 \| 30\.0)", logan)
    assert "all digits" in logan
    kassimali = next(row for row in rows if "Kassimali" in row)
    assert "<del>" in kassimali
    assert "three-moment equation is exact" in kassimali
