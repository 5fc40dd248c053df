"""The places where a model fails: all small changes solved for, or one for each place by the first order."""

from pathlib import Path

import numpy as np
import pytest

from dovetail import load_study
from dovetail.pipeline import fit_problem
from updating import locate
from updating.diagnosis import localisation

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


def shares(members, places):
    blank = np.zeros(0)
    return localisation.Localisation((), (), blank, blank, blank, blank, members, places, {}, "")


def test_shares_near_zero_do_not_say_where():
    assert not shares({"beam": 0.006}, (("support foot", 0.013),)).says_where
    assert not shares({}, ()).says_where
    assert shares({"beam": 0.006}, (("joint bolt", 0.4),)).says_where


def test_a_large_effect_that_no_small_change_explains_is_told(monkeypatch):
    monkeypatch.setattr(localisation, "N_LINES", 20)
    monkeypatch.setattr(localisation, "LEAST_SHARE", 1.0)
    problem = fit_problem(load_study(STUDY))
    where = locate(problem, problem.nominal())
    assert not where.says_where
    assert where.note == localisation.NOWHERE
