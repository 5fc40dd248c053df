"""The report for pyuff's authors says what their newest version does."""

import re
from pathlib import Path

import pytest

PAGE = Path(__file__).parents[2] / "docs" / "report-pyuff-58b.md"


@pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning")
def test_the_example_prints_the_table(tmp_path, monkeypatch, capsys):
    text = PAGE.read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    monkeypatch.chdir(tmp_path)
    exec(code, {})
    printed = dict(re.findall(r"^(.+): stated (\d+, there \d+)$", capsys.readouterr().out, re.MULTILINE))
    table = dict(
        (name, f"{stated}, there {there}")
        for name, stated, there in re.findall(
            r"^\| (\w[\w, ]*) \| (\d+) \| (\d+) \| \d+ \|$", text, re.MULTILINE
        )
    )
    assert len(table) == 4
    assert printed == table
