"""Corners of finite size beside what is searched for: taken into the model, kept if they pay, reported."""

from dataclasses import replace

import numpy as np
import pytest

import fem
from fem.effects.solid_corner import SolidCorner
from tests.frames import welded
from updating import Measurement, Sensor, build_problem, diagnose, propose
from updating.diagnosis.corners import with_corners
from updating.inference.fit_data import MODEL_ERROR, NOISE_LIMIT, TRANSVERSE, prepare, sensor_vectors
from updating.inference.parameters import Nuisance
from updating.inference.preparation import NEIGHBOURS, prepared_like, with_higher_mass
from updating.inference.unknowns import nuisance_unknowns
from updating.measurement.measurement import place_sensors

NUISANCES = (Nuisance("frame", "E:steel", 0.02), Nuisance("frame", "rho:steel", 0.005))
PLACES = [[0, 0, 0.15], [0, 0, 0.42], [0.15, 0, 0.3], [0.3, 0, 0.3], [0.35, 0.1, 0.3], [0.35, 0.25, 0.3]]


def measured(corner=None, heavier=0.0, noise=0.01):
    """Return a model of a welded frame, and what a truth of smaller elements would read."""
    sensors = tuple(
        Sensor(f"{k + 1}{d}", np.array(place), axis)
        for k, place in enumerate(PLACES)
        for d, axis in zip("xyz", np.eye(3), strict=True)
        if d in ("xy" if k < 2 else "yz" if k < 4 else "xz")
    )
    model = welded(0.06)
    model = replace(model, mesh=place_sensors(model.mesh, sensors), damping=fem.Damping.modal(0.005))
    truth = replace(model, mesh=model.mesh.split(2)).with_values(
        {("frame", "E:steel"): 1.012 * model.values()["frame", "E:steel"]}
    )
    if corner:
        (effect,) = SolidCorner.propose(truth)
        truth = truth.with_effect(effect.with_values(**corner))
    if heavier:
        effect = next(e for e in propose(truth) if e.name == "member_density:arm")
        truth = truth.with_effect(effect.with_values(change=heavier))
    drives = (sensors[2], sensors[7])
    f = np.linspace(10, 1200, 600)
    vectors = [sensor_vectors(truth, group).T for group in (sensors, drives)]
    H = fem.compute_frf(fem.assemble(truth), f, *vectors).H
    g = np.random.default_rng(3).standard_normal((2, *H.shape))
    H = H * (1 + noise * (g[0] + 1j * g[1]) / np.sqrt(2))
    frf = fem.FRF.from_arrays(f, H, "accelerance", [s.name for s in sensors], [s.name for s in drives])
    return model, Measurement(frf, sensors, drives)


@pytest.fixture(scope="module")
def both():
    """Corners 1.1 times as large as drawn, and an arm that is heavier by a tenth."""
    model, m = measured({"size": 1.1, "rigid_zone_factor": 0.6}, heavier=0.1)
    kinds = ("member_density", "member_stiffness", "point_mass", "solid_corner", "rigid_end_zone")
    return diagnose(model, [m], NUISANCES, kinds=kinds)


@pytest.mark.slow
def test_corners_are_found_beside_what_is_hidden(both):
    assert both.verdict == "effect"
    assert [f.effect.name for f in both.findings] == ["solid_corner:all", "member_density:arm"]
    corner, heavier = both.findings
    for change, truth in zip(corner.parameters, (1.1, 0.6), strict=True):
        assert abs(change.value - truth) < 3 * change.std
    assert heavier.parameters[0].value == pytest.approx(0.1, abs=0.01)
    assert len(both.rounds) >= 2
    assert both.rounds[0] == ()  # in the model before the search
    assert corner.without.level > 2 * both.steps[-1].level
    assert both.rounds[1][0].name == "member_density:arm"
    assert [s.label for s in both.steps] == [
        "nominal model",
        "uncertain parameters fitted",
        "solid corner at 2 welded corners added",
        "member density at member arm added",
    ]
    errors = [s.fit_db for s in both.steps[1:]]
    assert errors == sorted(errors, reverse=True)
    assert both.steps[-1].level < 0.05


def plain_values(fit):
    return {ref: v for ref, v in fit.values.items() if ref[0] == "frame"}


@pytest.mark.slow
def test_the_found_model_has_the_corners_and_earlier_steps_do_not(both):
    (corner,) = both.model.of_kind(SolidCorner)
    assert corner.size == both.findings[0].effect.size == both.findings[0].parameters[0].value
    model = replace(welded(0.06), mesh=both.model.mesh, damping=fem.Damping.modal(0.005))
    plain = build_problem(with_higher_mass(model), both.problem.data.measurement, NUISANCES, connections=True)
    fit = both.steps[1].result
    for mine, without in (
        (both.frf(0), plain.nominal()),
        (both.frf(1), replace(fit, values=plain_values(fit))),
    ):
        H = plain.frf(without).H
        np.testing.assert_allclose(mine.H, H, atol=2e-3 * np.abs(H).max())
    assert both.deviation(1).shape == both.frf(1).H.shape


@pytest.mark.slow
def test_corners_that_the_structure_does_not_have_are_not_found():
    model, m = measured(heavier=0.1)
    kinds = ("member_density", "point_mass", "solid_corner")
    found = diagnose(model, [m], NUISANCES, kinds=kinds)
    assert [f.effect.name for f in found.findings] == ["member_density:arm"]
    assert not found.model.of_kind(SolidCorner)
    problem = build_problem(model, m, NUISANCES, connections=True)
    assert with_corners(build_problem, model, propose(model, ("point_mass",)), problem, problem.fit()) is None


def test_what_is_known_of_corners_lies_within_their_bounds():
    (corner,) = SolidCorner.propose(welded())
    model = welded().with_effect(corner.with_values(size=1.0))
    size, factor = nuisance_unknowns(model, [Nuisance(corner.name, p.name, 0.3) for p in corner.parameters()])
    assert [size.to_value(x) for x in size.bounds()] == pytest.approx([0.0, 2.0])
    assert [factor.to_value(x) for x in factor.bounds()] == pytest.approx([0.2, 1.0])


def test_readings_that_the_motion_across_a_sensor_may_have_made_count_less():
    _, m = measured(noise=0.0)
    size = np.abs(m.frf.as_kind("receptance").H)
    across = np.zeros_like(size)
    across[:, 1] = 5 * size[:, 1]
    across[:, 2] = 30 * size[:, 2]
    plain, data = prepare(m), prepare(m, across=across)
    np.testing.assert_array_equal(data.noise, plain.noise)
    np.testing.assert_array_equal(data.weight[:, 0], plain.weight[:, 0])
    noise = plain.noise[:, 1]
    expected = MODEL_ERROR / np.sqrt(MODEL_ERROR**2 + noise**2 + (5 * TRANSVERSE) ** 2)
    seen = plain.mask[:, 1] & data.mask[:, 1]
    assert seen.any()
    np.testing.assert_allclose(data.weight[:, 1][seen], expected[seen])
    assert 30 * TRANSVERSE > NOISE_LIMIT
    assert not data.mask[:, 2].any()


def test_how_far_a_sensor_moves_across_is_the_models_motion_near_the_line(monkeypatch):
    model, m = measured(noise=0.0)
    right = build_problem(model, m, NUISANCES, model_error=0.0)
    seen = {}

    def spy(*args, across=None, **options):
        seen["across"] = across
        return prepare(*args, across=across, **options)

    monkeypatch.setattr("updating.inference.preparation.prepare", spy)
    build_problem(model, m, NUISANCES, model_error=0.0)
    assert seen["across"] is None
    problem = build_problem(model, m, NUISANCES)
    across, f = seen["across"], problem.data.frequency
    assert problem.data.mask.sum() < right.data.mask.sum()
    # sensor 1x moves along y and z as well: mean squares of accelerations over 3 % on either side
    place = [replace(m.sensors[0], direction=axis) for axis in np.eye(3)[1:]]
    drives = sensor_vectors(model, m.excitations).T
    k = 300
    near = np.abs(f / f[k] - 1) <= NEIGHBOURS
    H = fem.compute_frf(fem.assemble(model), f[near], sensor_vectors(model, place).T, drives).H
    mean = np.sqrt((np.abs(H) ** 2).sum(axis=1).mean(axis=0)) / (2 * np.pi * f[k]) ** 2
    np.testing.assert_allclose(across[k, 0], mean, rtol=0.01)


def test_channels_that_were_kept_from_a_fit_are_judged_as_its_own_are():
    model, m = measured(noise=0.0)
    for error in (0.0, 0.3):
        problem = build_problem(model, m, NUISANCES, model_error=error)
        whole = prepared_like(problem, m)
        np.testing.assert_array_equal(whole.mask, problem.data.mask)
        np.testing.assert_allclose(whole.weight, problem.data.weight, rtol=1e-12)
    compared = problem.data.mask.mean(axis=(0, 2))
    least = int(compared.argmin())
    assert compared[least] < 1  # it moves across far more than along
    outputs, inputs = m.frf.outputs, m.frf.inputs
    part = m.with_frf(m.frf.select([o for o in outputs if o != outputs[least]], inputs))
    kept = m.with_frf(m.frf.select([outputs[least]], inputs))
    fit = build_problem(model, part, NUISANCES)
    own = problem.data.mask[:, least]
    np.testing.assert_array_equal(prepared_like(fit, kept).mask[:, 0], own)
    assert prepared_like(replace(fit, model_error=0.0), kept).mask.sum() > own.sum()


def test_a_model_whose_corners_have_no_size_has_real_matrices():
    (corner,) = SolidCorner.propose(welded())
    drawn, none = (fem.assemble(m) for m in (welded(), welded().with_effect(corner.with_values(size=0.0))))
    for name in ("K", "M"):
        expected, found = getattr(drawn, name).toarray(), getattr(none, name).toarray()
        assert np.isrealobj(found)
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9 * abs(expected).max())
