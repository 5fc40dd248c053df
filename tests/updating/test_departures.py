"""Sections and connections whose fitted form is outside its usual range, and what may be there instead."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import fem
from dovetail.report import departure_text
from dovetail.result import channels_of
from tests.frames import cross_beam
from tests.updating.test_channel_errors import bent, described, measured
from updating import Measurement, Sensor, computed_frf, diagnose
from updating.diagnosis import departed
from updating.diagnosis.departures import departures
from updating.inference import FAR_STD, FORM_CORNER, formed_problem


@pytest.fixture(scope="module")
def problem():
    sensors, forces = described()
    model = bent([*sensors, *forces])
    return formed_problem(model, measured(model, sensors, forces))[0]


def at(problem, changes, std=0.1):
    """Return the nominal result with other values of the form, by parameter, and one deviation of all."""
    nominal = problem.nominal()
    values = dict(nominal.values) | changes
    return replace(nominal, values=values, std=dict.fromkeys(values, std))


def corner(problem, parameter):
    (ref,) = (r for r in problem.nominal().values if r[0].startswith("zone_form") and r[1] == parameter)
    return ref


def test_a_drawn_form_is_usual(problem):
    assert departures(problem, problem.nominal()) == []


def test_a_corner_is_unusual_beyond_its_prior(problem):
    mean, std = FORM_CORNER["u"]
    ref, limit = corner(problem, "u"), mean + FAR_STD * std
    assert departures(problem, at(problem, {ref: 0.98 * limit})) == []
    (found,) = departures(problem, at(problem, {ref: limit + 0.1}))
    assert (found.parameter, found.where) == ("u", problem.reduced.model.effect(ref[0]).where)
    assert found.probability == pytest.approx(0.8413, abs=1e-3)  # a deviation beyond the limit
    assert {"post", "arm"} <= found.near


def test_the_farthest_comes_first(problem):
    plane, mass = corner(problem, "plane"), corner(problem, "mass")
    found = departures(problem, at(problem, {plane: -1.1, mass: 1.3}))
    assert [d.parameter for d in found] == ["mass", "plane"]


def test_around_a_joint_a_factor_of_two_is_unusual():
    model = cross_beam()
    tips = [model.mesh.points[np.argmin(model.mesh.points[:, k])] for k in (0, 1)]
    sensors = tuple(Sensor(f"s{k}", p, np.array([0, 0, 1.0])) for k, p in enumerate(tips))
    frf = computed_frf(model, sensors, sensors[:1], np.arange(20.0, 400.0, 4.0), "accelerance")
    frf = replace(frf, inputs=("hit",))
    forces = (replace(sensors[0], name="hit"),)
    problem, _ = formed_problem(model, Measurement(frf, sensors, forces))
    refs = [r for r in problem.nominal().values if r[0].startswith("zone_form") and r[1] == "u"]
    (ref,) = (r for r in refs if problem.reduced.model.effect(r[0]).where.startswith("joint"))
    assert departures(problem, at(problem, {ref: 0.69})) == []
    (found,) = departures(problem, at(problem, {ref: 0.75}))
    assert found.where.startswith("joint")


def test_effects_at_its_place_are_named_with_their_probabilities(problem):
    result = at(problem, {corner(problem, "u"): 3.0})
    near = next(e for e in fem.effects.effect_classes()["point_mass"].propose(problem.reduced.model))
    far = replace(near, name="elsewhere", member="nowhere")
    h = [
        SimpleNamespace(effects=(e,), key=frozenset([e.name]), score=s) for e, s in ((near, 2.0), (far, 3.0))
    ]
    (found,) = departed(list(zip(h, (0.2, 0.3), strict=True)), problem, result)
    assert [(e[0].name, p) for e, p in found.rivals] == [(near.name, 0.2)]
    text = departure_text(found)
    assert "stiffer" in text
    assert "outside the usual range with a probability of" in text
    assert "Possible instead: point mass" in text


def test_it_says_how_much_softer_or_heavier(problem):
    plane, mass = corner(problem, "plane"), corner(problem, "mass")
    heavy, soft = map(departure_text, departures(problem, at(problem, {plane: -np.log(3.0), mass: 1.3})))
    assert "66.7 ± 3.3\u00a0% softer in the plane of its members" in soft
    assert "mass of the connection is 130 ± 10\u00a0% higher than drawn" in heavy


def test_channels_are_named_that_are_farther_off_than_described(problem):
    errors = problem.nominal().channels.copy()
    errors[1, 0], errors[2, 3] = 0.09, 0.002
    result = replace(problem.nominal(), channels=errors, channels_std=0 * errors + 1e-3)
    (found,) = channels_of(problem.data.measurement, result)
    assert found.words == "sensor post y: gain too large by"
    assert (found.fitted, found.moved) == (0.09, pytest.approx(3.0))


def test_a_diagnosis_reports_a_corner_that_is_unlike_its_drawing():
    """The truth is a corner that is softer in its plane than others, which no point mass explains."""
    sensors, forces = described()
    model = bent([*sensors, *forces])
    formed = formed_problem(model, measured(model, sensors, forces))[0].reduced.model
    (zone,) = (e for e in formed.effects if e.kind == "zone_form")
    true = formed.with_values({(zone.name, "plane"): -1.6})
    test = Measurement(
        computed_frf(true, sensors, forces, np.arange(5.0, 400.0, 1.5), "accelerance"), sensors, forces
    )
    found = diagnose(model, [test], kinds=("point_mass",))
    assert found.verdict == "nothing missing"
    assert any(d.where == zone.where and d.parameter == "plane" and d.value < 0 for d in found.departures)
