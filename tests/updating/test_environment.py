"""Kinds of effect that need a situation which the structure is not in."""

import numpy as np
import pytest

from fem import Environment, assemble, first_modes
from fem.effects import Plane, Spin, candidate_kinds, effect_classes
from tests.frames import cross_beam, portal
from tests.updating.test_evidence_modes import E, cantilever
from updating import ModeTargets, diagnose_modes, propose
from updating.diagnosis import admitted, situated, unstated
from updating.diagnosis.evidence import Odds, near_to, place_of
from updating.inference import MISSING, UNSTATED


def kinds_of(*args, **more):
    return {e.kind for e in propose(*args, **more)}


def test_every_environment_has_a_probability_and_a_kind_that_needs_it():
    assert set(UNSTATED) == set(Environment)
    assert all(0 <= p < 1 for p in UNSTATED.values())
    needed = {effect_classes()[kind].environment for kind in candidate_kinds()}
    assert needed == {None, *Environment}
    assert set(unstated(cross_beam())) == set(Environment)
    assert not unstated(cross_beam().in_environment(*Environment))


def test_a_rotor_is_proposed_only_where_something_turns():
    model = cross_beam()
    assert "rotor" not in kinds_of(model)
    assert "rotor" in kinds_of(model.in_environment(Environment.ROTATION))
    assert "rotor" in kinds_of(model.with_effect(Spin(name="shaft", speed=100.0)))
    assert kinds_of(model, ["rotor"]) == {"rotor"}
    assert kinds_of(model) | {"rotor"} == kinds_of(model.in_environment(*Environment))


def test_who_names_a_kind_states_what_it_needs():
    model = cross_beam()
    (fluid, *_) = propose(model, ["fluid_added_mass"])
    assert admitted(fluid, model) == UNSTATED[Environment.FLUID]
    assert admitted(fluid, situated(model, ["fluid_added_mass"])) == 1.0
    assert admitted(fluid, situated(model, ["point_mass"])) < 1.0
    assert situated(model, None).environment == frozenset()


def test_a_kind_costs_the_odds_of_its_environment_and_does_not_crowd_its_place():
    """Of n candidates at a member two are of a fluid: in air they count as a hundredth of one each."""
    model = cross_beam()
    every = [e for e in propose(model) if place_of(e) == ("member", "member upper")]
    fluid = [e for e in every if e.kind == "fluid_added_mass"]
    (mass,) = (e for e in every if e.kind == "point_mass")
    assert len(fluid) == 2
    dry = Odds.of(every, model)
    wet = Odds.of(every, model.in_environment(Environment.FLUID))
    assert wet.prior(fluid[:1]) == wet.prior((mass,)) == pytest.approx(-np.log(len(every)))
    assert dry.prior((mass,)) == pytest.approx(-np.log(len(every) - 2 + 2 * 0.01))
    assert dry.prior(fluid[:1]) - dry.prior((mass,)) == pytest.approx(np.log(0.01))


@pytest.mark.parametrize("stated", [(), (Environment.FLUID,)])
def test_a_cantilever_with_low_frequencies_is_in_water_only_where_the_study_says_so(stated):
    """All five bending frequencies 9 % low: the section is thinner, or a fluid moves with it."""
    model = cantilever()
    flat = model.with_effect(Plane(name="plane", plane="xz"))
    exact = first_modes(assemble(flat), 5).frequency[:5]
    targets = ModeTargets.of(0.91 * exact, 3e-3, plane="xz")
    exclude = [k for k in candidate_kinds() if k not in ("fluid_added_mass", "member_section", "point_mass")]
    found = diagnose_modes(model.in_environment(*stated), targets, (E,), exclude=exclude)
    first = found.explanations[0]
    kinds = [e.kind for e in first.effects]
    assert kinds == (["fluid_added_mass"] if stated else ["member_section"])


def test_all_candidates_together_are_as_probable_as_none():
    """Kinds of places, places of a kind, and candidates of a place are equally probable."""
    model = portal()
    kinds = ["point_mass", "member_stiffness", "support_flexibility"]
    every = [e for e in propose(model, kinds) if len(near_to(e)) == 1]
    assert {place_of(e)[0] for e in every} == {"member", "support"}
    odds = Odds.of(every, model)
    assert sum(np.exp(odds.prior((e,))) for e in every) == pytest.approx(MISSING / (1 - MISSING))
