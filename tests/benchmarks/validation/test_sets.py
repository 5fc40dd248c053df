"""Sets of connections, mixtures and mountings: their cases, and their truth against the elements' effects."""

from dataclasses import replace

import numpy as np
import pytest

import fem
from benchmarks.validation.cases import EACH_DB, CaseSettings, Implant, _Scale, draw_case, kinds_of
from benchmarks.validation.frames import Draft, build_model, draw_draft, on_elastic_feet
from benchmarks.validation.hidden import EFFECTS, KINDS, SETS, draw_hidden
from benchmarks.validation.truth import Cut, Member, Reading, TrueFrame, TrueJoint, TrueSupport
from fem import assemble
from tests.frames import rows_at
from updating import propose

SETTINGS = CaseSettings(3, small=True)
E, NU, RHO = 207e9, 0.3, 7850.0
F = np.array([2.0, 3.0])
"""A tenth of the first resonance: elements are exact in statics, ω² adds 1 % of their small error [Hz]."""


def post_with_arm():
    """Return a clamped post that carries an arm on an elastic joint beside it, and two sensors of each."""
    post = Member(np.zeros(3), np.array([0.0, 0.0, 0.5]), 0.03, 0.012, E, NU, RHO, 0.0)
    arm = Member(np.array([-0.1, 0.015, 0.4]), np.array([0.3, 0.015, 0.4]), 0.025, 0.01, E, NU, RHO, 0.0)
    K = np.diag([3e6, 2e6, 4e6, 900.0, 700.0, 1100.0])
    at = Cut("post", 0.4), Cut("arm", 0.1)
    joint = TrueJoint("J1", *at, np.array([0.0, 0.008, 0.4]), K, (False,) * 6)
    frame = TrueFrame({"post": post, "arm": arm}, (joint,), (TrueSupport("S1", Cut("post", 0.0)),))
    sensors = tuple(
        Reading(f"{m}{d}", Cut(m, s), np.eye(3)["xyz".index(d)])
        for m, s, d in (("post", 0.45, "x"), ("post", 0.45, "y"), ("arm", 0.35, "y"), ("arm", 0.35, "z"))
    )
    return Draft("own", frame, dict.fromkeys(frame.members, "steel"), sensors, sensors[1:], F, 0)


def computed(draft, model):
    """Return receptances of elements."""
    parts = [rows_at(model, draft.frame, group) for group in (draft.sensors, draft.drives)]
    return fem.compute_frf(assemble(model), F, *parts, "receptance", method="direct").H


def model_of(draft, frame=None):
    model = build_model(frame or draft.frame, draft.materials, draft.sensors, 120)
    return model.with_damping(fem.Damping.structural(0.0))


def far(H, other):
    return float(np.abs(H - other).max() / np.abs(other).max())


def found_for(place, candidates):
    """Return the candidate at a place."""
    (effect,) = (
        c
        for c in candidates
        if getattr(c, "joint", None) == place.joint
        and getattr(c, "support", None) == place.support
        and getattr(c, "direction", None) == place.direction
        and getattr(c, "member", None) == place.member
    )
    return effect


def mounted(draft, kind):
    """Yield the changed truth, the model and the model with the effect for some draws of a kind."""
    model = model_of(draft)
    candidates = propose(model, kinds=[kind])
    for k in range(6):
        hidden = draw_hidden(np.random.default_rng(k), kind, draft, draft.frame)
        effect = found_for(hidden.place, candidates)
        a = float(np.sqrt(np.prod(hidden.bounds)))
        with_effect = model.with_effect(effect.with_values(**hidden.values(a)))
        yield hidden.change(draft.frame, a), model, with_effect


@pytest.mark.parametrize("kind", ["joint_offset", "joint_hole", "part_shift", "foot_shift", "support_shift"])
def test_the_truth_of_a_mounting_is_that_of_the_elements_effect(kind):
    draft = post_with_arm()
    if kind == "foot_shift":
        draft = replace(draft, frame=on_elastic_feet(np.random.default_rng(1), draft.frame))
    before = draft.frame.frf(F, draft.sensors, draft.drives)
    for truth, model, with_effect in mounted(draft, kind):
        H = truth.frf(F, draft.sensors, draft.drives)
        assert far(computed(draft, model), before) < 1e-6
        assert far(computed(draft, with_effect), H) < 1e-6
        assert far(H, before) > 1e-4  # it is no comparison of nothing with nothing


def test_a_soft_connection_has_directions_at_one_place_that_each_show_beside_the_others():
    for index in range(2):
        case = draw_case(SETTINGS, "connection", index)
        assert 2 <= len(case.implants) <= 3
        places = {(i.hidden.place.joint, i.hidden.place.support) for i in case.implants}
        assert len(places) == 1
        assert len({i.hidden.place.direction for i in case.implants}) == len(case.implants)
        low, _ = SETTINGS.visible_db
        assert all(i.visible_db >= low for i in case.implants)


def test_a_direction_that_another_hides_is_not_drawn():
    draft = draw_draft(np.random.default_rng(2), "tee", small=True)
    scale = _Scale(draft, draft.frame, 3e-5, 40)
    hidden = draw_hidden(np.random.default_rng(1), "support_soft", draft, draft.frame)
    one, other = (Implant(p, 10.0, 0.0) for p in hidden.parts[:2])
    assert scale.added_change(one, [other]) > EACH_DB
    gone = replace(one, amplitude=0.1 * one.hidden.bounds[0])
    assert scale.added_change(gone, [other]) < scale.added_change(one, [other])


@pytest.mark.slow
def test_pairs_are_at_two_places_and_mixtures_have_a_mass():
    pair = draw_case(SETTINGS, "connections", 1)
    assert len({(i.hidden.place.joint, i.hidden.place.support) for i in pair.implants}) == 2
    mixed = draw_case(SETTINGS, "mixed", 0)
    kinds = [i.hidden.kind for i in mixed.implants]
    assert kinds.count("point_mass") == 1
    assert len(kinds) >= 3


def test_soft_directions_of_one_support_add_up():
    draft = post_with_arm()
    hidden = draw_hidden(np.random.default_rng(1), "support_soft", draft, draft.frame)
    truth = draft.frame
    for part in hidden.parts:
        truth = part.change(truth, 5.0)
    (support,) = truth.supports
    free = ["xyz".find(p.place.direction[-1]) + 3 * p.place.direction.startswith("r") for p in hidden.parts]
    assert [d for d in range(6) if not support.rigid[d]] == sorted(free)
    k = [p.values(5.0)["stiffness"] for p in hidden.parts]
    np.testing.assert_allclose(np.diag(support.K)[free], k)


def test_mountings_come_in_turn_and_feet_stand_on_elastic_frames():
    (pool,) = SETS["mounting"]
    assert sorted(kinds_of(SETTINGS, "mounting", i)[0] for i in range(len(pool))) == sorted(pool)
    index = next(i for i in range(len(pool)) if kinds_of(SETTINGS, "mounting", i) == ("foot_shift",))
    case = draw_case(SETTINGS, "mounting", index)
    assert not case.draft.frame.supports
    feet = [j for j in case.draft.frame.joints if j.second is None]
    assert case.implants[0].hidden.place.joint in [j.name for j in feet]
    named = {n.effect for n in case.nuisances}
    assert {j.name for j in feet} <= named
    assert not set(EFFECTS) & {k for k, kind in KINDS.items() if kind.elastic_feet}


@pytest.mark.slow
def test_two_states_by_frfs_differ_by_the_hidden_effect_alone():
    settings = replace(CaseSettings(31, small=True), noise=(1e-9, 2e-9), noise_floor=1e-12)
    case, same = (draw_case(settings, name, 1) for name in ("frf-states", "frf-states-null"))
    assert case.baseline is not None
    assert same.baseline is not None
    f, draft = case.draft.frequency, case.draft
    change = np.abs(case.measurement.frf.H / case.baseline.frf.H - 1)
    assert np.median(change) > 1e-6
    weak = replace(settings, weaker=10 * settings.weaker)
    weaker = draw_case(weak, "frf-states", 1)
    less = np.abs(weaker.measurement.frf.H / weaker.baseline.frf.H - 1)
    assert np.median(less) == pytest.approx(np.median(change) / 10, rel=0.3)
    first = np.abs(same.baseline.frf.H)
    noise = 2e-9 * first + 1e-12 * first.max(axis=(0, 1))  # of either state; none of 10⁴ values exceeds 6 σ
    assert (np.abs(same.measurement.frf.H - same.baseline.frf.H) < 6 * np.sqrt(2) * noise).all()
    assert case.measurement.frf.inputs == case.baseline.frf.inputs == tuple(d.name for d in draft.drives)
    assert np.array_equal(case.baseline.frf.frequency, f)
