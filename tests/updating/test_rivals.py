"""A rival explains the data in another way: a law that has the effect in it does not."""

import numpy as np
import pytest

from fem.effects.joint_complex_stiffness import JointComplexStiffness
from fem.model import parameter_values
from fem.system import sum_contributions
from tests.frames import cross_beam, portal
from updating.diagnosis.candidates import propose
from updating.diagnosis.findings import Ranked


class Fit:
    """The part of a fit that tells which effects it has."""

    def __init__(self, effect):
        self.effects = (effect,)


def ranked(effect):
    """Return a candidate as a search ranks it, without its fit."""
    return Ranked(effect.name, effect.kind, effect.where, (), 0.1, 1.0, 1.0, 1.0, 0.0, Fit(effect))


def test_a_law_contains_the_stiffness_of_its_direction_and_of_no_other():
    every = {e.name: ranked(e) for e in propose(cross_beam())}
    soft, law = every["joint_stiffness:bolt.rx"], every["joint_complex_stiffness:bolt.rx"]
    assert law.contains(soft)
    assert not soft.contains(law)
    assert not law.contains(law)
    assert not law.contains(every["joint_stiffness:bolt.ry"])


@pytest.mark.parametrize("model", [cross_beam(0.2), portal(0.5)], ids=["joint", "supports"])
def test_a_law_with_no_more_loss_than_the_model_is_the_effect_that_it_contains(model):
    every = propose(model)
    pairs = [(a, b) for a in every for b in every if ranked(a).contains(ranked(b))]
    assert pairs
    for law, effect in pairs:
        values = parameter_values(effect)
        loss = {name: 0.0 for name in parameter_values(law) if name not in values}
        if isinstance(law, JointComplexStiffness):
            loss = {"loss_factor": law.assumed_loss}
        stiffness = {"stiffness": 0.3 * values["stiffness"]}
        one, two = (
            sum_contributions(e.with_values(**v).contribute(model), model.n_dof)
            for e, v in ((law, stiffness | loss), (effect, stiffness))
        )
        for a, b in zip(one, two, strict=True):
            assert abs(a - b).max() <= 1e-12 * max(abs(b).max(), 1e-300)
        assert np.abs(two[0]).max() > 0
