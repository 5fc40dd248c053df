"""How often hypotheses are as true as they are probable, of cases whose truth is known."""

import numpy as np
import pytest

from benchmarks.independent import table
from benchmarks.independent.reliability import Judged, as_markdown, is_part, is_shown, shares

SOFT = table.HiddenConnection("J", {"rx": 100.0, "ry": 200.0})
MASS = table.Hidden(("point_mass",), ("U",), 0.08, "kg")


def said(*effects):
    found = [{"kind": k, "where": w, "parameters": [], "twins": []} for k, w in effects]
    return {"verdict": "effect" if found else "nothing missing", "effects": found, "faults": []}


@pytest.mark.parametrize(
    ("effects", "part"),
    [
        ((), True),
        ((("joint_stiffness", "joint J, rx"),), True),
        ((("joint_stiffness", "joint J, rx"), ("joint_stiffness", "joint J, ry")), False),
        ((("joint_stiffness", "joint K, rx"),), False),
    ],
)
def test_a_hypothesis_that_lacks_some_of_what_is_hidden_is_a_part(effects, part):
    assert is_part([SOFT], said(*effects), corners=False) == part


def test_nothing_is_no_part_of_nothing():
    assert not is_part([], said(), corners=False)
    assert is_part([MASS], said(), corners=False)


def test_an_effect_is_shown_if_its_fit_is_more_probable_than_one_without_it():
    """The answer has 50 %, nothing 5 %: a fit with the truth may score ln 10 less than the answer."""
    assert is_shown(-2.2, 0.5, [0.05])
    assert not is_shown(-2.4, 0.5, [0.05])
    assert not is_shown(-0.1, 0.9, [0.9])  # the answer is nothing
    assert is_shown(-50.0, 0.9, [])


def test_hypotheses_count_in_the_bin_of_their_probability():
    case = Judged("a", True, np.array([0.75, 0.2, 0.0499, 0.0001]), np.array([False, False, False, True]))
    sure = Judged("b", True, np.array([1.0]), np.array([True]))
    counts = [(s.hits, s.cases) for s in shares([case, sure])]
    assert counts[7] == (0, 1)
    assert counts[2] == (0, 1)
    assert counts[0] == (0, 1)  # less than 0.1 % is not counted
    assert counts[9] == (1, 1)
    assert case.log_score == pytest.approx(np.log(1e-4))
    hidden = Judged("c", False, np.array([0.9, 0.1]), np.array([False, True]))
    text = as_markdown([case, sure, hidden])
    assert "effect not shown (1 cases)" in text
    assert "| mean log score | -4.61 |  | -2.30 |  |" in text
