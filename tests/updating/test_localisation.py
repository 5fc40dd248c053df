"""The places where a model fails: all small changes solved for, or one for each place by the first order."""

from pathlib import Path

import pytest

from dovetail import load_study
from dovetail.pipeline import fit_problem
from updating.diagnosis import localisation
from updating.diagnosis.localisation import locate

STUDY = Path(__file__).parents[2] / "examples" / "cross-beam" / "study.toml"


def test_of_many_changes_the_first_order_chooses_those_that_are_solved_for(monkeypatch):
    monkeypatch.setattr(localisation, "N_LINES", 20)
    problem = fit_problem(load_study(STUDY))
    every = locate(problem, problem.nominal())
    monkeypatch.setattr(localisation, "MOST_SOLVED", len(list(localisation._changes(problem))) // 4)
    few = locate(problem, problem.nominal())
    assert every.places[0][0] == few.places[0][0] == "joint J"  # where the stiffness is missing
    best, chosen = dict(every.places), dict(few.places)
    assert set(chosen) == set(best)
    assert chosen["joint J"] == pytest.approx(best["joint J"], rel=1e-6)
    for place, share in chosen.items():  # each is one of those that were solved for before
        assert share <= best[place] * (1 + 1e-9)
    for member, share in few.members.items():
        assert 0 < share <= every.members[member] * (1 + 1e-9)
