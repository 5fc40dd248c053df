"""A rival explains the data in another way: a law that has the effect in it does not."""

from types import SimpleNamespace

import numpy as np
import pytest

from fem import parameter_values, sum_contributions
from fem.effects import DistributedMass, JointComplexStiffness
from fem.model import covers
from tests.frames import cross_beam, portal
from updating import Ranked, propose
from updating.diagnosis.evidence import ScoredFit, Search, Searched
from updating.inference import TWIN_NATS


class Fit:
    """The part of a fit that tells which effects it has."""

    def __init__(self, effect):
        self.effects = (effect,)


class Scored(ScoredFit):
    """A hypothesis of which only effects and score are known."""

    def __init__(self, effects, score):
        object.__setattr__(self, "scored", score)
        object.__setattr__(self, "fitted", SimpleNamespace(effects=effects))

    @property
    def score(self):
        return self.scored


def ranked(effect):
    """Return a candidate as a search ranks it, without its fit."""
    return Ranked(effect.name, effect.kind, effect.where, (), 0.1, 1.0, 1.0, 1.0, 0.0, Fit(effect))


def test_a_law_contains_the_stiffness_of_its_direction_and_of_no_other():
    every = {e.name: ranked(e) for e in propose(cross_beam())}
    soft, law = every["joint_stiffness:bolt.rx"], every["joint_complex_stiffness:bolt.rx"]
    (one,), (more,), (other,) = (r.result.effects for r in (soft, law, every["joint_stiffness:bolt.ry"]))
    assert law.extends(one)
    assert not soft.extends(more)
    assert not law.extends(more)
    assert not law.extends(other)


@pytest.mark.parametrize("model", [cross_beam(0.2), portal(0.5)], ids=["joint", "supports"])
def test_a_law_with_no_more_loss_than_the_model_is_the_effect_that_it_contains(model):
    every = propose(model, exclude=["distributed_mass"])
    pairs = [(a, b) for a in every for b in every if ranked(a).extends(b)]
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


def test_a_mass_on_a_stretch_becomes_the_point_mass_within_it_as_the_square_of_its_width():
    model = cross_beam(0.2)
    (wide, *_), every = DistributedMass.propose(model), propose(model, ["point_mass"])
    (point,) = (e for e in every if covers(wide, e))
    assert not covers(point, wide)
    off = []
    for width in (2e-3, 1e-3):
        narrow = wide.with_values(mass=0.3 / width, position=0.17, width=width)
        values = narrow.contains[point.kind](narrow)
        assert values == pytest.approx({"mass": 0.3, "position": 0.17})
        one, two = (
            sum_contributions(e.contribute(model), model.n_dof)[1].toarray()
            for e in (narrow, point.with_values(**values))
        )
        off.append(np.abs(one - two).max() / np.abs(two).max())
    assert off[1] < 1e-3
    assert off[0] / off[1] == pytest.approx(4.0, rel=0.05)


def test_of_twins_the_simpler_one_is_believed():
    """A contained kind, or fewer effects, is put first up to TWIN_NATS behind, and no farther."""
    every = {e.name: e for e in propose(cross_beam(0.2))}
    wide, point = every["distributed_mass:upper"], every["point_mass:upper"]
    other, soft = every["point_mass:lower"], every["joint_stiffness:bolt.rx"]

    def believed(*scored):
        search = object.__new__(Search)
        search.known = {h.key: h for h in (Scored(effects, score) for effects, score in scored)}
        return {e.name for e in search.best.effects}

    near, far = TWIN_NATS - 0.1, TWIN_NATS + 0.1
    assert believed(((wide,), near), ((point,), 0.0)) == {point.name}
    assert believed(((wide,), far), ((point,), 0.0)) == {wide.name}
    assert believed(((wide,), near), ((other,), 0.0)) == {wide.name}  # elsewhere
    assert believed(((wide, soft), near), ((point, soft), 0.0)) == {point.name, soft.name}
    assert believed(((wide, soft), near), ((wide,), 0.0), ((point,), 0.0)) == {point.name}
    assert believed(((point,), near), ((wide,), 0.0)) == {point.name}


def test_the_probability_of_a_place_counts_hypotheses_with_more_effects():
    """An effect cannot be more probable than the place that it is at."""
    every = {e.name: e for e in propose(portal(0.5))}
    foot, other = every["support_flexibility:foot0.rx"], every["support_flexibility:foot1.rx"]
    alone, both, else_ = Scored((foot,), 0.0), Scored((foot, other), -0.1), Scored((other,), -1.0)
    nothing = Scored((), -2.0)
    every = {h.key: h for h in (nothing, alone, both, else_)}
    search = SimpleNamespace(known=every, elsewhere=[], promises=list, unknown=lambda h: -50.0)
    done = Searched(search, alone, (), 0.0, portal(0.5))
    p = {h: done.probability(h) for h in (alone, both, else_)}
    assert done.probability_there(alone) == pytest.approx(p[alone] + p[both])
    assert done.probability_there(both) == pytest.approx(p[both])
    assert done.probability_there(nothing) == pytest.approx(done.probability(nothing))
