"""The table of validation seeds adds up."""

import csv
from collections import Counter

from tests.conftest import ROOT

OUTCOMES = ["right", "twin", "beside", "part", "wrong", "unexplained", "not_noticed", "fault", "failed"]


def rows():
    with (ROOT / "benchmarks" / "validation" / "seeds.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_outcomes_add_up_to_the_cases():
    for row in rows():
        assert sum(int(row[name]) for name in OUTCOMES) == int(row["cases"]), row
        assert int(row["covered"]) <= int(row["parameters"])


def test_each_set_of_a_seed_has_one_row():
    found = Counter((row["seed"], row["set"]) for row in rows())
    assert set(found.values()) == {1}
