"""How probable it is that something is missing: stated in a study."""

import numpy as np
import pytest

from dovetail import StudyError, load_study
from fem.declarations import PriorBelief
from tests.dovetail.test_form_tolerances import STUDY
from updating import propose
from updating.diagnosis.evidence import Odds


def read(folder, text):
    path = folder / "study.toml"
    path.write_text(f"{STUDY}\n{text}", encoding="utf-8")
    return load_study(path).model


def share_of_one_more(model):
    """Return the prior probability of all single effects together, over that of none."""
    candidates = propose(model, ["point_mass", "member_density", "crack"])
    odds = Odds.of(candidates, model)
    return candidates, np.exp([odds.prior((e,)) - odds.prior(()) for e in candidates])


def test_single_effects_have_the_stated_probability_together(tmp_path):
    _, usual = share_of_one_more(read(tmp_path, ""))
    assert usual.sum() == pytest.approx(1.0)
    _, stated = share_of_one_more(read(tmp_path, "[candidates]\nmissing = 0.75\n"))
    assert stated.sum() == pytest.approx(3.0)


def test_further_changes_are_as_improbable_as_ever(tmp_path):
    for text in ("", "[candidates]\nmissing = 0.9\n"):
        model = read(tmp_path, text)
        mass, density, *_ = propose(model, ["point_mass", "member_density"])
        odds = Odds.of((mass, density), model)
        more = odds.prior((mass, density)) - odds.prior((mass,))
        assert more < -np.log(10.0)
        spread = next(e for e in propose(model, ["distributed_mass"]))  # a mass and a width
        assert odds.prior((spread,)) < odds.prior(()) + np.log(9.0) - np.log(10.0) + 1e-9


def test_kinds_with_a_weight_take_from_others_at_their_place(tmp_path):
    model = read(tmp_path, "[candidates.weights]\npoint_mass = 4\n")
    assert model.belief == PriorBelief(None, {"point_mass": 4.0})
    candidates, share = share_of_one_more(model)
    assert share.sum() == pytest.approx(1.0)
    by_kind = {e.kind: p for e, p in zip(candidates, share, strict=True)}
    assert by_kind["point_mass"] == pytest.approx(4 * by_kind["member_density"])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[candidates]\nmissing = 1.5\n", "missing: 1.5 is not allowed; a probability between 0 and 1"),
        ("[candidates]\nmissing = 0\n", "missing: 0 is not allowed"),
        ("[candidates.weights]\npoint_mas = 2\n", "point_mas: there is no such kind of effect.*point_mass"),
        ("[candidates.weights]\ncrack = 0\n", "crack: 0 is not allowed"),
    ],
)
def test_wrong_beliefs_are_refused(tmp_path, text, words):
    with pytest.raises(StudyError, match=words):
        read(tmp_path, text)
