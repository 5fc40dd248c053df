"""Pages of docs/: their outputs, pictures and tables, links of the site, nothing from a network."""

import re
import runpy
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageDraw, ImageFilter

from docs.make import gallery, offline, pages
from docs.make.__main__ import refresh
from docs.make.agreement import agrees
from docs.make.pictures import alike
from docs.make.stored import NO_STORE
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
        ("docs/index.md", "```console examples/x\n$ a\nb\n```\n", "```console\n$ a\nb\n```\n"),
    ],
)
def test_links_lead_to_pages_of_the_site(page, link, expected):
    assert pages.for_site(link, ROOT / page, ROOT, ["10_x"]) == expected


def generated(text, root=ROOT):
    return pages.generate(text, "page.md", root)


def test_outputs_and_pictures_are_put_into_the_page_once():
    text = "```console examples/first-frame\n$ dovetail modes study.toml\n```\n\n"
    text += "<!-- file examples/first-frame/study.toml 2 [mesh] -->\n\nText.\n"
    first = generated(text)
    assert "$ dovetail modes study.toml\nFirst frame: 39 elements" in first.text
    assert '-->\n\n```toml\n[mesh]\nfile = "frame.msh"' in first.text
    assert first.text.endswith("```\n\n<!-- end -->\n\nText.\n")
    assert generated(first.text).text == first.text


def test_a_mark_takes_no_text_of_the_page_below_it():
    mark = "<!-- file Makefile 1 PYTHON -->\n\n"
    text = f"{mark}Text.\n\n{mark}old\n\n<!-- end -->\n"
    assert generated(text).text.count("Text.") == 1
    assert "old" not in generated(text).text


def test_a_picture_is_beside_the_pages(tmp_path):
    folder = tmp_path / "examples" / "x"
    folder.mkdir(parents=True)
    code = "from PIL import Image\nImage.new('RGB', (2800, 1400), 'red').save('a.png')\n"
    (folder / "draw.py").write_text(code)
    text = "```console examples/x\n$ python draw.py\n```\n\n<!-- picture examples/x/{}.png A red one -->\n"
    page = generated(text.format("a"), tmp_path)
    assert "\n![A red one](images/page/a.png)\n" in page.text
    picture = Image.open(BytesIO(page.pictures["images/page/a.png"]))
    assert picture.size == (1400, 700)
    assert not (folder / "a.png").exists()
    with pytest.raises(pages.PageError, match=r"no command has written examples/x/b\.png"):
        generated(text.format("b"), tmp_path)


def test_a_command_that_fails_ends_the_build():
    with pytest.raises(pages.PageError, match="exit code 2"):
        generated("```console docs\n$ dovetail modes absent.toml\n```\n")


@pytest.mark.parametrize(
    ("old", "new", "same"),
    [
        ("mode 1  10.9060 Hz", "mode 1  10.9062 Hz", True),
        ("mode 1  10.9060 Hz", "mode 1  11.2060 Hz", False),
        ("mode 1 10.90 Hz", "mode 1    10.90 Hz", True),
        ("probability 91 %", "probability 92 %", True),
        ("probability 91 %", "probability 95 %", False),
        ("stiffness 1.3 ± 4.8", "stiffness 1.4 ± 4.8", True),
        ("change −0.215", "change 0.215", False),
        ("7 sensors", "8 sensors", False),
        ("columns.1 1X+ 0020d6e1bd48", "columns.1 1X+ 0020d6e1bd48", True),
        ("columns.100", "columns.101", False),
        ("17.25 to 1e+03", "17.26 to 1e+03", True),
        ("left foot", "right foot", False),
        ("Dovetail 0.2.0, in 31 s", "Dovetail 0.3.1, in 52.5 s", True),
    ],
)
def test_outputs_agree_within_what_processors_differ_by(old, new, same):
    assert agrees(old, new) is same


def test_pictures_agree_if_only_edges_differ():
    def drawn(x, blur=0.0):
        picture = Image.new("RGB", (400, 300), "white")
        ImageDraw.Draw(picture).line([(20, 20), (x, 280)], "black", 6)
        written = BytesIO()
        picture.filter(ImageFilter.GaussianBlur(blur)).save(written, "png")
        return written.getvalue()

    assert alike(drawn(380), drawn(380, blur=1.0))
    assert not alike(drawn(380), drawn(200))


def test_a_page_is_written_where_it_shows_something_else(tmp_path):
    """A number within the tolerance stays, so that another machine changes nothing."""
    (tmp_path / "docs").mkdir()
    (tmp_path / "n.txt").write_text("a 3.001\n")
    page = tmp_path / "docs" / "page.md"
    text = "<!-- file n.txt -->\n\n```text\na {}\n```\n\n<!-- end -->\n"
    for stands, wanted in (("3.000", "3.000"), ("2.000", "3.001")):
        page.write_text(text.format(stands))
        found = refresh(page, tmp_path, NO_STORE, check=True)
        assert page.read_text() == text.format(stands)
        assert any("3.001" in line for line in found) is (stands != wanted)
        refresh(page, tmp_path, NO_STORE)
        assert page.read_text() == text.format(wanted)


def test_a_picture_that_no_mark_has_goes(tmp_path):
    old = tmp_path / "docs" / "images" / "page" / "old.png"
    old.parent.mkdir(parents=True)
    old.touch()
    page = tmp_path / "docs" / "page.md"
    page.write_text("Text.\n")
    assert "no mark" in refresh(page, tmp_path, NO_STORE, check=True)[0]
    assert old.exists()
    refresh(page, tmp_path, NO_STORE)
    assert not old.exists()


def committed():
    """Yield the name, the text and the generated parts of each page that has some."""
    for path in sorted((ROOT / "docs").glob("*.md")):
        text = path.read_text(encoding="utf-8")
        if found := list(pages.GENERATED.finditer(text)):
            yield path, found


def test_every_page_shows_its_outputs_and_pictures():
    """The build compares them with what the commands print; here is only that nothing is empty."""
    shown = set()
    for path, found in committed():
        for match in found:
            assert len(match[0].strip().splitlines()) > 3, f"{path.name}: run make docs for {match[0]}"
        places = re.findall(r"!\[.*?\]\((images/\S+/\S+)\)", path.read_text("utf-8"))
        shown |= {ROOT / "docs" / place for place in places}
    assert shown == set(ROOT.glob("docs/images/*/*.png"))
    assert sum(p.stat().st_size for p in shown) < 4e6


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


def test_the_tutorial_finds_the_hidden_effect():
    page = TUTORIAL.read_text(encoding="utf-8")
    assert "Support left foot is flexible about y" in page
    value, std = map(float, re.findall(r"stiffness\s([\d.]+)\s±\s([\d.]+)\skN·m/rad", page)[0])
    assert abs(value - 20.0) < 2 * std < 2.0


def test_the_benchmark_book_has_a_table_of_each_source():
    from benchmarks.book.shelf import SOURCES

    text = (ROOT / "docs" / "benchmark-book.md").read_text(encoding="utf-8")
    assert sorted(m[2] for m in pages.MARK.finditer(text)) == sorted([*SOURCES, "summary"])


def test_a_table_of_the_book_states_reference_result_and_deviation():
    page = generated("<!-- book textbooks -->\n").text
    rows = [row for row in page.splitlines() if row.startswith("| ")]
    logan = next(row for row in rows if "Logan" in row)
    # Which of the three reactions is the worst depends on rounding: two are opposite, the third is 30 kip.
    assert re.search(r"\| -?(11\.6877 \| -?11\.687|30 \| 30\.0)", logan)
    assert "all digits" in logan
    kassimali = next(row for row in rows if "Kassimali" in row)
    assert "<del>" in kassimali
    assert "three-moment equation is exact" in kassimali
