"""The scan: places that can explain a misfit come first, whatever is there."""

import pytest

from benchmarks.hidden.cases import make_case
from fem import PointMass
from updating import build_problem, propose
from updating.diagnosis.evidence import Scan, place_of, places_of


@pytest.fixture(scope="module")
def heavier():
    case = make_case(0)  # a member is heavier
    return case, build_problem(case.model, case.measurement, case.nuisances)


def test_places_hold_all_candidates_and_each_once(heavier):
    case, problem = heavier
    candidates = propose(case.model, test=case.measurement)
    places = places_of(problem, candidates)
    assert len({p.name for p in places}) == len(places)
    held = {e.name for p in places for e in p.effects}
    assert held == {e.name for e in candidates}


def test_an_effect_along_a_member_has_places_of_its_own_on_it(heavier):
    case, problem = heavier
    member = next(iter(case.model.mesh.members))
    (mass,) = (e for e in PointMass.propose(case.model) if e.member == member)
    assert place_of(mass) == ("member", f"member {member}")
    places = places_of(problem, [mass])
    assert {p.parent for p in places} == {f"member {member}"}
    assert len(places) > 5


def test_the_member_that_is_heavier_leaves_less_than_others(heavier):
    """Free forces on it explain what is missing; those at a joint or on another member do not."""
    case, problem = heavier
    candidates = propose(case.model, test=case.measurement)
    ranked = Scan.of(problem, problem.nominal()).run(places_of(problem, candidates))
    parents = list(dict.fromkeys(s.places[0].parent for s in ranked if len(s.places) == 1))
    assert all(s.residual_ratio >= 0 for s in ranked)
    assert f"member {case.hidden.member}" in parents[:3]
