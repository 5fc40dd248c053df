"""The table of seeds adds up, and runs of the command become rows of it."""

import csv
import json
from collections import Counter

import pytest

from benchmarks.validation.summary import OUTCOMES, SEEDS, main, rows_of

COUNTS = [outcome.replace(" ", "_") for outcome in OUTCOMES]


def rows():
    with SEEDS.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_outcomes_add_up_to_the_cases():
    for row in rows():
        assert sum(int(row[name]) for name in COUNTS) == int(row["cases"]), row
        assert int(row["covered"]) <= int(row["parameters"])


def test_each_set_of_a_seed_has_one_row():
    found = Counter((row["seed"], row["set"]) for row in rows())
    assert set(found.values()) == {1}


def test_a_run_becomes_a_row(tmp_path, capsys):
    common = {"set": "single", "seconds": 2.0, "program": "abc"}
    errors = [{"error": e, "covered": c} for e, c in ((0.01, True), (0.03, False), (0.02, True))]
    records = [
        {**common, "outcome": "right", "first": True, "in_three": True, "errors": errors},
        {**common, "outcome": "twin", "seconds": 4.0, "program": "def"},
        {**common, "outcome": "not noticed", "seconds": 9.0},
    ]
    lines = [{"settings": {"seed": 7}}, *records]
    (tmp_path / "cases.jsonl").write_text("\n".join(map(json.dumps, lines)), encoding="utf-8")
    (row,) = rows_of(tmp_path)
    assert (row["right"], row["twin"], row["not_noticed"], row["first_or_twin"]) == (1, 1, 1, 2)
    assert (row["parameters"], row["covered"]) == (3, 2)
    assert float(row["median_error"]) == pytest.approx(0.02)
    assert float(row["median_seconds"]) == 4.0
    assert row["programs"] == "abc def"
    assert list(row) == list(rows()[0])
    main([str(tmp_path)])
    assert capsys.readouterr().out.startswith("7,single,3,1,1,")
