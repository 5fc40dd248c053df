"""Notebooks of the gallery: stored without outputs, run to their assertions, made into pages."""

import re
import subprocess
from pathlib import Path

import nbformat
import pytest

from docs.make import notebooks
from docs.make.offline import loaded_from_elsewhere
from docs.make.pages import PageError

NOTEBOOKS = sorted(Path(__file__).parents[2].glob("examples/*.ipynb"))
PLOTLY = {notebooks.PLOTLY: {"data": [{"y": [1.0], "name": "</script>"}], "layout": {"height": 320}}}


def written(folder, *cells):
    """Write a notebook with cells of code below a heading in a folder like examples; return its path."""
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_markdown_cell("# Heading\n\nText.")])
    notebook.cells += [nbformat.v4.new_code_cell(text) for text in cells]
    path = folder / "examples" / "10_x.ipynb"
    path.parent.mkdir()
    nbformat.write(notebook, path)
    return path


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebooks_are_stored_without_outputs_and_end_in_an_assertion(path):
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert [cell for cell in code if cell.outputs or cell.execution_count] == []
    assert code[-1].source.splitlines()[-1].startswith("assert ")
    assert notebook.cells[0].source.startswith("# ")


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebooks_run_and_become_pages_that_load_nothing(path, tmp_path):
    before = path.read_bytes()
    page = notebooks.page(notebooks.executed(path), path.stem)
    assert path.read_bytes() == before
    assert page.count("Plotly.newPlot") == 4
    assert re.search(r"200 N·m/rad: 1\.\d\d dB", page)
    (tmp_path / "page.html").write_text(page, encoding="utf-8")
    assert list(loaded_from_elsewhere(tmp_path)) == []


def test_a_page_has_text_code_and_outputs(tmp_path):
    path = written(tmp_path, "for k in range(3):\n    print(k, flush=True)", "1 + 1")
    page = notebooks.page(notebooks.executed(path), "10_x")
    assert page.startswith("# Heading\n\nText.\n\n```python\nfor k in range(3):")
    assert "```text\n0\n1\n2\n```" in page
    assert page.count("```text\n2\n```") == 1
    assert "<script" not in page


def test_a_cell_that_fails_ends_the_build(tmp_path):
    with pytest.raises(PageError, match=r"10_x\.ipynb: a cell ends with AssertionError: too far"):
        notebooks.executed(written(tmp_path, 'assert False, "too far"'))


def test_a_figure_is_drawn_by_the_library_beside_the_page():
    output = nbformat.v4.new_output("display_data", data=PLOTLY)
    cells = [nbformat.v4.new_markdown_cell("# T"), nbformat.v4.new_code_cell("f", outputs=[output] * 2)]
    page = notebooks.page(nbformat.v4.new_notebook(cells=cells), "10_x")
    assert re.findall(r'<div class="figure" id="(.*?)"', page) == ["figure-1", "figure-2"]
    assert page.count(f'<script src="{notebooks.SCRIPT}"></script>') == 1
    assert "height:320px" in page
    # a name cannot end the script
    assert page.count("</script>") == 3
    assert "\\u003c/script>" in page


def test_the_library_draws_the_figure(tmp_path, browser):
    output = nbformat.v4.new_output("display_data", data=PLOTLY)
    (tmp_path / notebooks.SCRIPT).write_text(notebooks.script(), encoding="utf-8")
    library = f'<!doctype html><meta charset="utf-8"><script src="{notebooks.SCRIPT}"></script>'
    (tmp_path / "page.html").write_text(library + notebooks.shown(output, "a"), encoding="utf-8")
    command = [browser, "--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={tmp_path / 'user'}"]
    command += ["--virtual-time-budget=8000", "--dump-dom", (tmp_path / "page.html").as_uri()]
    drawn = subprocess.run(command, capture_output=True, text=True, check=True, timeout=120).stdout
    assert 'class="main-svg"' in drawn


def test_the_folder_of_the_study_is_found_from_either_place(tmp_path, monkeypatch, root):
    """The notebook runs beside the study and from the root of the checkout."""
    (notebook,) = (nbformat.read(p, as_version=4) for p in NOTEBOOKS)
    first = next(cell.source for cell in notebook.cells if cell.cell_type == "code")
    for place in (root, root / "examples"):
        monkeypatch.chdir(place)
        names = {}
        exec(first, names)
        assert names["study"].name == "Cross-beam"
