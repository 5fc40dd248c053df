"""Updates with parameters that the data do not determine, bad starts, and lines that count."""

from dataclasses import replace

import numpy as np
import pytest

import fem
from fem.effects import GroundSpring, SupportFlexibility
from tests.frames import beam, fix
from tests.updating.test_update import RHO, E, frequencies_of, frfs_of, noisy, textbook
from updating import Ending, Measurement, Sensor, Unknown, UpdateSettings, build_problem, frf_data

# -------------------------------------------------------------------- what is not determined, and bad starts


def sprung(**stiffness):
    """Return a clamped beam with springs at its free end: those along x and about it move no bending mode."""
    springs = tuple(
        GroundSpring(name=f"k{d}", place="end", point=1, direction=d, stiffness=k, reference=1e4)
        for d, k in stiffness.items()
    )
    return beam(10, section=fem.Section.rectangle(0.02, 0.03), effects=(fix(0), *springs))


def stiffness_of(*names):
    return [(f"k{name}", "stiffness") for name in names]


def test_what_no_mode_changes_with_keeps_its_start_and_the_rest_is_found():
    model = sprung(x=3e4, y=3e3, z=2e3, rx=10.0)
    f = frequencies_of(model.with_values({("kz", "stiffness"): 3e3}), n=6)[[1, 3, 5]]
    result = textbook(model, stiffness_of("z", "x", "rx"), frequency=f, numbers=[1, 3, 5])
    assert result.ending is Ending.CONVERGED, result.messages
    assert result["kz stiffness"].value == pytest.approx(3e3, rel=1e-4)
    assert result["kz stiffness"].determined
    for name, start in (("kx stiffness", 3e4), ("krx stiffness", 10.0)):
        assert result[name].value == pytest.approx(start, rel=1e-9)
        assert np.isinf(result[name].std)
        assert not result[name].determined
    said = "the data do not determine kx stiffness, krx stiffness: no measured mode changes with them"
    assert any(m.startswith(said) for m in result.messages), result.messages
    np.testing.assert_allclose(result.correlation, np.eye(3), atol=1e-9)


@pytest.mark.parametrize("how", [{}, {"select": "pivoting"}, {"regularisation": "tikhonov"}, {"n_starts": 3}])
def test_a_list_of_modes_that_nothing_moves_is_named(how):
    """The measured modes bend across z, and only stiffness along x is updated."""
    model = sprung(x=3e4, z=2e3)
    f = frequencies_of(model, n=6)[[1, 3, 5]] * [1.03, 1.0, 1.0]
    result = textbook(
        model, stiffness_of("x"), frequency=f, numbers=[1, 3, 5], settings=UpdateSettings(**how)
    )
    assert result.ending is Ending.NOTHING_DETERMINED
    assert result.values[0] == pytest.approx(3e4, rel=1e-9)
    assert any(
        m.startswith(f"no parameter moves the modes paired with {f[0]:.4g} Hz (-2.9 %):")
        for m in result.messages
    )
    assert f"{f[1]:.4g} Hz" not in " ".join(result.messages)


def test_parameters_that_do_the_same_are_named_together():
    """Frequencies of a clamped beam have E/rho alone, for which any steps used to solve a singular matrix."""
    model = beam(10, effects=(fix(0),))
    f = 1.01 * frequencies_of(model, n=4)
    result = textbook(model, [E, RHO], frequency=f, settings=UpdateSettings(max_iterations=100))
    assert result.ending is Ending.CONVERGED
    assert result.values[0] / result.values[1] == pytest.approx(1.01**2 * 210e9 / 7850, rel=1e-6)
    # the nearest to the start of all that have this ratio: half the change each
    assert result.values[0] / 210e9 == pytest.approx(1.01, rel=1e-3)
    assert np.isinf(result.std).all()
    said = "the data do not determine frame E:steel and frame rho:steel one by one, only a combination"
    assert any(m.startswith(said) for m in result.messages), result.messages


def test_a_value_at_its_bound_has_no_deviation():
    model = beam(10, effects=(fix(0),))
    f = frequencies_of(model, n=4)
    result = textbook(model, [Unknown((E,), upper=215e9), Unknown((RHO,), std=0.01)], frequency=1.05 * f)
    got = result["frame E:steel"]
    assert got.at_bound
    assert np.isnan(got.std)
    assert np.isnan(got.interval()).all()
    assert np.isfinite(result["frame rho:steel"].std)
    assert not result.covariance[0].any()
    row = next(line for line in result.table().splitlines() if line.startswith("frame E:steel"))
    assert "nan" not in row


@pytest.mark.parametrize("start", [1e2, 1e4])
def test_a_soft_start_ends_no_worse_than_the_rigid_model(start):
    """Frequencies of a clamped beam: from a hinge the first mode becomes one that rigid-body motion was.

    The fit ended at 2.6e4 N·m/rad and 138 times the stated noise, though the rigid clamp fits exactly.
    """
    rigid = beam(10, effects=(fix(0),), section=fem.Section.rectangle(0.02, 0.03))
    soft = SupportFlexibility(name="clamp", supports=("support0",), direction="ry", stiffness=start)
    f = frequencies_of(rigid, n=6)
    result = textbook(rigid.with_effect(soft), [("clamp", "stiffness")], frequency=f)
    assert result.misfit["modes"] < 1e-3
    assert result.values[0] > 1e9
    got = frequencies_of(result.model, n=6)
    np.testing.assert_allclose(got, f, rtol=1e-5)


def test_no_fit_ends_worse_than_it_began():
    """Whatever the starts are, with the lines of one low stage only: the start is the best there is."""
    model = beam(10, effects=(fix(0),)).with_damping(fem.Damping.modal(0.01))
    lines, places = np.arange(5.0, 500.0, 2.0), [(1, "z"), (5, "z")]
    H = noisy(frfs_of(model, places, places[:1], lines).H, 0.01)
    data = {"frf": H, "lines": lines, "outputs": places, "inputs": places[:1], "noise": 0.01}
    for seed in range(3):
        settings = UpdateSettings(n_starts=2, seed=seed, max_iterations=3)
        result = textbook(model, [Unknown((E,), lower=50e9, upper=800e9)], settings=settings, **data)
        assert result.path[-1].cost <= result.path[0].cost + 1.0
        assert result["frame E:steel"].value == pytest.approx(210e9, rel=1e-3)


# --------------------------------------------------------------------------------------- lines that count


def coherent(seed=0):
    """Return a beam, and a measurement whose upper half the force hardly excites: its coherence says so.

    The error is smooth over lines, as leakage is, so that lines by themselves do not show it.
    """
    model = beam(10, effects=(fix(0),), section=fem.Section.rectangle(0.03, 0.01))
    model = model.with_damping(fem.Damping.modal(0.01))
    z = np.array([0.0, 0, 1])
    sensors = tuple(Sensor(f"S{i}", model.mesh.points[i], z) for i in (1, 4, 7))
    lines, n = np.arange(4.0, 400.0, 1.0), 20
    H = frfs_of(model, [(i, "z") for i in (1, 4, 7)], [(1, "z")], lines).H
    level = np.where(lines < 200.0, 0.01, 0.6)[:, None, None]
    rng = np.random.default_rng(seed)
    e = rng.standard_normal((2, 21, *H.shape[1:]))
    e = np.apply_along_axis(lambda v: np.interp(lines, np.linspace(0, 400, 21), v), 1, e)
    white = rng.standard_normal((2, *H.shape))
    e = np.where(level > 0.1, e, white)
    frf = fem.FRF.from_arrays(
        lines, H * (1 + level * (e[0] + 1j * e[1])), "accelerance", [s.name for s in sensors], ["S1"]
    )
    coherence = 1 / (1 + 2 * n * np.broadcast_to(level, H.shape) ** 2)
    return model, Measurement(frf, sensors, sensors[:1], coherence=coherence, averages=n)


def test_lines_that_a_comparison_leaves_out_do_not_count_in_an_update():
    """Every parameter is right, and yet values that are no more than noise used to count."""
    model, measurement = coherent()
    data = build_problem(model, measurement, ()).data
    assert not data.mask[data.frequency > 200].any()
    assert data.mask[data.frequency < 200].mean() > 0.8
    result = textbook(model, {E: 0.05}, frf=measurement)
    assert result.ending is Ending.CONVERGED
    assert result.misfit["frf"] < 2
    assert result["frame E:steel"].value == pytest.approx(210e9, rel=2e-3)
    assert not any("the model misses the" in m for m in result.messages)


def test_noise_that_is_given_masks_as_known_noise_does():
    model, measurement = coherent()
    bare = replace(measurement, coherence=None, averages=None)
    noise = np.asarray(measurement.noise)

    def masked(frf, **more):
        return build_problem(model, frf_data(model, frf, **more), ()).data

    given = masked(bare, noise=noise)
    np.testing.assert_array_equal(given.mask, masked(measurement).mask)
    places = [(i, "z") for i in (1, 4, 7)]
    by_places = masked(measurement.frf, outputs=places, inputs=places[:1], noise=noise)
    # without sensors nothing is known of what they read of motion square to them; otherwise it is the same
    assert not by_places.mask[by_places.frequency > 200].any()
