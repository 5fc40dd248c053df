"""Errors of channels: gains, directions and places that are not as a test's description says."""

from dataclasses import replace

import numpy as np
import pytest

import fem
from tests.noise import complex_normal
from updating import ChannelErrors, Measurement, Sensor, computed_frf, place_sensors
from updating.inference import channel_scatter, fit_given, formed_problem
from updating.least_squares.costs import DenseJacobian

LINES = np.arange(5.0, 400.0, 1.5)
STEEL = fem.Material("steel", 210e9, 7850.0)
ROOT, CORNER, TIP = (0.0, 0.0, 0.0), (0.0, 0.0, 0.5), (0.4, 0.0, 0.5)


def bent(channels):
    """Return a clamped L of two members with points at channels."""
    mesh = fem.Mesh.from_lines([ROOT, CORNER, TIP], [[0, 1], [1, 2]], {"post": [0], "arm": [1]}).split(8)
    part = fem.MemberProperties(STEEL, fem.Section.rectangle(0.03, 0.01))
    mesh = place_sensors(mesh, tuple(channels))
    effects = (fem.Frame(members={"post": part, "arm": part}), fem.Support(name="root", point=0))
    return fem.Model(mesh, effects, fem.Damping(loss_factor=0.01))


def sensor(name, point, direction):
    d = np.array(direction, dtype=float)
    return Sensor(name, np.array(point, dtype=float), d / np.linalg.norm(d))


def described():
    """Return the channels of a test as it describes them."""
    sensors = (
        sensor("post x", (0, 0, 0.3), (1, 0, 0)),
        sensor("post y", (0, 0, 0.3), (0, 1, 0)),
        sensor("arm z", (0.25, 0, 0.5), (0, 0, 1)),
        sensor("arm y", (0.25, 0, 0.5), (0, 1, 0)),
        sensor("tip y", TIP, (0, 1, 0)),
        sensor("tip z", TIP, (0, 0, 1)),
    )
    return sensors, (sensor("hit", (0.3, 0, 0.5), (0, 1, 1)),)


def measured(model, sensors, forces):
    frf = computed_frf(model, sensors, forces, LINES, "accelerance")
    return Measurement(frf, sensors, forces)


@pytest.mark.parametrize("error", range(5))
def test_what_is_misread_is_the_difference_of_readings_of_rigid_motions(error):
    """A rigid motion u(p) = v + ω × p, φ = ω is read as d·u(p) by any channel at any place."""
    sensors, forces = described()
    model, said = bent([*sensors, *forces]), sensors[2]
    v, turn = np.random.default_rng(3).standard_normal((2, 3))
    motion = np.hstack([v + np.cross(turn, model.mesh.points), np.tile(turn, (model.mesh.n_points, 1))])
    size = np.zeros(5)
    size[error] = 1e-5
    axes = said.axes_across
    d = said.direction + size[1:3] @ axes
    place = said.point + size[3:5] @ axes
    true = (1 + size[0]) * d @ (v + np.cross(turn, place))
    own = said.direction @ (v + np.cross(turn, said.point))
    change = size @ said.misread(model).T[:, : motion.size] @ motion.ravel()
    assert change == pytest.approx(true - own, rel=1e-4, abs=1e-12)


def test_derivatives_of_channel_errors_are_differences():
    sensors, forces = described()
    model = bent([*sensors, *forces])
    problem, _ = formed_problem(model, measured(model, sensors, forces))
    function = problem.function((), (), problem.lines_up_to(np.inf, 30))
    x = function.start.copy()
    n = function.scatter.n_channels
    x[-n:] += 0.3 * np.random.default_rng(1).standard_normal(n)
    J = function(x, True)[1]
    for k in range(len(x) - n, len(x)):
        step = np.zeros(len(x))
        step[k] = 1e-4
        slope = (function(x + step, False)[0] - function(x - step, False)[0]) / 2e-4
        assert np.abs(slope - J[k]).max() < 1e-3 * np.abs(slope).max()


@pytest.mark.parametrize("phase", [True, False])
@pytest.mark.parametrize("n_forces", [1, 2])
def test_normal_equations_by_sensor_are_those_of_the_dense_jacobian(phase, n_forces):
    sensors, (force,) = described()
    forces = (force, sensor("tap", TIP, (0, 1, 0)))[:n_forces]
    model = bent([*sensors, *forces])
    problem, _ = formed_problem(model, replace(measured(model, sensors, forces), phase=phase))
    function = problem.function((), (), problem.lines_up_to(np.inf, 60))
    assert function.scatter.n_channels > 10
    rng = np.random.default_rng(1)
    r, jacobian = function.linearised(function.start + 0.1 * rng.standard_normal(len(function.start)))
    for groups in (None, np.nonzero(function.keep)[0] // 25):
        weight = rng.uniform(0.5, 2.0, len(r))
        g, A = jacobian.products(r, weight, groups)
        dense_g, dense_A = DenseJacobian(jacobian.dense()).products(r, weight, groups)
        size = np.sqrt(np.maximum(dense_A.sum(axis=0).diagonal(), 1e-12))
        assert np.abs((A - dense_A) / np.outer(size, size)).max() < 3e-6
        assert np.abs((g - dense_g) / size).max() < 3e-6 * np.linalg.norm(r)


def test_a_fit_finds_a_turned_sensor_and_a_wrong_gain():
    """The FRFs are those of channels that are turned, shifted and too sensitive."""
    sensors, forces = described()
    model = bent([*sensors, *forces])
    turned = replace(sensors[0], direction=np.array([np.cos(0.06), np.sin(0.06), 0.0]))
    loud = replace(sensors[5], gain=1.05)
    true = measured(model, (turned, *sensors[1:5], loud), forces)
    rng = np.random.default_rng(2)
    noise = 0.003 * complex_normal(rng, true.frf.H.shape)
    test = Measurement(replace(true.frf, H=true.frf.H * (1 + noise)), sensors, forces)
    problem, _ = formed_problem(model, test)
    _, result = fit_given(problem)
    errors, std = result.channels, result.channels_std
    turn = errors[0, 1:3] @ sensors[0].axes_across
    assert turn[1] == pytest.approx(0.06, abs=0.006)
    assert abs(errors[5, 0] - 0.05) < 2 * std[5, 0] < 0.05
    assert (std <= 1.0001 * problem.data.measurement.errors.std).all()
    plain = fit_given(replace(problem, scatter=None))[1]
    assert problem.assessed(result).fit_db < 0.3 * problem.assessed(plain.as_described()).fit_db


def test_exact_channels_have_no_errors():
    sensors, forces = described()
    model = bent([*sensors, *forces])
    test = replace(measured(model, sensors, forces), errors=ChannelErrors(0.0, 0.0, 0.0))
    problem, _ = formed_problem(model, test)
    assert channel_scatter(problem).n_channels == 0


def test_known_errors_are_part_of_the_nominal_model():
    sensors, forces = described()
    model = bent([*sensors, *forces])
    test = measured(model, sensors, forces)
    problem, _ = formed_problem(model, test)
    errors = np.zeros((7, 5))
    errors[2, 0] = 0.1
    known, _ = formed_problem(model, test.with_channel_errors(errors))
    ratio = known.receptance(known.nominal()) / problem.receptance(problem.nominal())
    assert ratio[:, 2] == pytest.approx(1.1)
    assert ratio[:, [0, 1, 3, 4, 5]] == pytest.approx(1.0)
