"""Updating of models to modes and FRFs whose truth is known."""

from functools import partial

import numpy as np
import pytest
from scipy.stats import binom, norm

import fem
from fem import ModelError
from fem.effects import MemberStiffness
from tests.frames import STEEL, beam, fix, on_fine_mesh, planar, portal
from tests.noise import complex_normal
from updating import (
    Ending,
    Measurement,
    MissingExtraError,
    Sensor,
    Unknown,
    UpdateSettings,
    build_problem,
    frf_data,
    mode_data,
    update,
)
from updating.inference import sample

textbook = partial(update, model_error=0.0)
"""Parameters alone vary, and nothing but noise and the mesh may be left."""

E, RHO = ("frame", "E:steel"), ("frame", "rho:steel")
CHANGES = [("dE left", "change"), ("dE right", "change"), ("dE beam", "change")]


def frame():
    """Return a portal whose members' moduli are parameters, and places to measure at."""
    model = portal(0.1)
    changes = [MemberStiffness(name=f"dE {m}", member=m, change=0.0) for m in model.mesh.members]
    places = [(p, d) for p in range(4, model.mesh.n_points, 2) for d in "xyz"]
    return model.with_effect(*changes), places


def rows_of(places):
    return [6 * p + "xyz".index(d) for p, d in places]


def modes_of(model, places, n=8):
    modes = fem.solve_modes(fem.assemble(on_fine_mesh(model)), n=n)
    return modes.frequency, modes.shapes[rows_of(places)]


def frequencies_of(model, n):
    return fem.solve_modes(fem.assemble(on_fine_mesh(model)), n=n).frequency


def frfs_of(model, places, drives, lines):
    return fem.compute_frf(fem.assemble(on_fine_mesh(model)), lines, places, drives, tolerance=1e-8)


def noisy(H, level, seed=0):
    a, b = np.random.default_rng(seed).standard_normal((2, *H.shape))
    return H * (1 + level * (a + 1j * b))


def test_shapes_at_one_output_or_with_infinite_values_are_refused():
    model, places = frame()
    f, shapes = modes_of(model, places, 3)
    shapes[1, 2] = np.inf
    with pytest.raises(ModelError, match=rf"shape at {f[2]:.6g} Hz is infinite at output 1"):
        mode_data(model, f, shapes, outputs=places)
    shapes[1:, 2] = np.nan
    with pytest.raises(ModelError, match=rf"shape at {f[2]:.6g} Hz has values at 1 of {len(places)} outputs"):
        mode_data(model, f, shapes, outputs=places)


def crossing(ratio):
    """Return a cantilever whose first modes in both planes cross where the height is the width."""
    section = fem.Section.rectangle(0.02 * ratio, 0.02)
    return beam(10, section=section, effects=(fix(0),))


def test_modes_without_a_partner_are_said():
    model, places = frame()
    f, shapes = modes_of(model, places, 6)
    strange = np.random.default_rng(0).standard_normal((len(places), 1))
    result = textbook(
        model, {E: 0.05}, frequency=[*f, 1.3 * f[2]], shapes=np.hstack([shapes, strange]), outputs=places
    )
    lost = 1.3 * f[2]
    order = np.sort([*f, lost])
    assert order[result.modes.partner < 0] == pytest.approx([lost])
    assert any("without a partner" in m and f"{lost:.4g} Hz" in m for m in result.messages)
    assert result["frame E:steel"].value == pytest.approx(210e9, rel=1e-6)


# ---------------------------------------------------------------------------------------------- update


def test_one_modulus_has_the_posterior_of_the_closed_form():
    # f goes with √E: n frequencies of relative deviation σ say ln E within 2σ/√n, and the prior joins
    model = beam(10, effects=(fix(0),))
    f = frequencies_of(model, n=6)
    factor = np.exp(0.01 * np.random.default_rng(2).standard_normal(6))
    result = textbook(model, {E: 0.05}, frequency=f * factor, frequency_std=0.01)
    data = 6 / (2 * 0.01) ** 2
    precision = data + 1 / 0.05**2
    mean = data * 2 * np.log(factor).mean() / precision
    got = result["frame E:steel"]
    assert np.log(got.value / 210e9) == pytest.approx(mean, abs=2e-3 * precision**-0.5)
    assert got.std / got.value == pytest.approx(precision**-0.5, rel=1e-3)
    low, high = got.interval(0.95)
    assert np.log(high / low) == pytest.approx(2 * norm.ppf(0.975) * got.std / got.value)


def test_frequencies_alone_leave_stiffness_over_mass():
    model = beam(10, effects=(fix(0),))
    f = frequencies_of(model, n=6)
    result = textbook(model, [E, RHO], frequency=1.02 * f)
    assert any("do not determine" in m for m in result.messages)
    known = textbook(model, {E: 0.05, RHO: 1e-4}, frequency=1.02 * f)
    assert known["frame E:steel"].value == pytest.approx(210e9 * 1.02**2, rel=1e-3)
    both = textbook(model, {E: 0.05, RHO: 0.05}, frequency=1.02 * f)
    assert any("frame rho:steel with frame E:steel (+1.000" in m for m in both.messages)


def test_shapes_and_frequencies_give_three_members_back():
    model, places = frame()
    truth = {CHANGES[0]: 0.15, CHANGES[1]: 0.08, CHANGES[2]: -0.12}
    f, shapes = modes_of(model.with_values(truth), places)
    result = textbook(model, CHANGES, frequency=f, shapes=shapes, outputs=places)
    assert result.ending is Ending.CONVERGED
    np.testing.assert_allclose(result.values, list(truth.values()), atol=1e-5)
    assert len(result.path) >= 3
    assert result.path[-1].errors.frequency < 1e-6 < result.path[0].errors.frequency
    assert result.model.values()[CHANGES[2]] == pytest.approx(-0.12, abs=1e-5)


def test_deviations_from_noisy_modes_hold_as_often_as_they_say():
    model, places = frame()
    truth = np.array([0.1, -0.05, 0.08])
    f, shapes = modes_of(model.with_values(dict(zip(CHANGES, truth, strict=True))), places, 6)
    size = np.linalg.norm(shapes, axis=0) / np.sqrt(len(places))
    half, inside, n = norm.ppf(0.95), 0, 12
    for seed in range(n):
        rng = np.random.default_rng(seed)
        result = textbook(
            model, CHANGES,
            frequency=f * np.exp(5e-3 * rng.standard_normal(6)),
            shapes=shapes + 0.02 * size * rng.standard_normal(shapes.shape),
            outputs=places, frequency_std=5e-3, shape_std=0.02,
        )  # fmt: skip
        L = np.linalg.cholesky(result.covariance)
        inside += int((np.abs(np.linalg.solve(L, result.values - truth)) < half).sum())
    low, high = binom.ppf([1e-3, 1 - 1e-3], 3 * n, 0.9)
    assert low <= inside <= high, inside


def test_modes_by_number_keep_their_number():
    part = Unknown((("frame", "E:steel"),), name="E")
    model = crossing(0.94)
    measured = frequencies_of(model, n=2)
    result = textbook(model, [part], frequency=1.01 * measured[1:], numbers=[1])
    assert result.modes.partner.tolist() == [1]
    assert result["E"].value == pytest.approx(210e9 * 1.01**2, rel=1e-6)


def test_a_measurement_brings_its_sensors_along():
    model = beam(10, effects=(fix(0),), section=fem.Section.rectangle(0.03, 0.01))
    model = model.with_damping(fem.Damping.modal(0.01))
    z = np.array([0.0, 0, 1])
    sensors = tuple(Sensor(f"S{i}", model.mesh.points[i], z) for i in (1, 4, 7))
    lines = np.arange(4.0, 200.0, 1.0)
    real = model.with_values({E: 195e9})
    frf = frfs_of(real, [(i, "z") for i in (1, 4, 7)], [(1, "z")], lines)
    H = frf.H * (1 + 0.01 * complex_normal(np.random.default_rng(4), frf.H.shape))
    named = fem.FRF.from_arrays(lines, H, frf.kind, [s.name for s in sensors], ["S1"])
    result = textbook(model, {E: 0.1}, frf=Measurement(named, sensors, sensors[:1]), noise=0.01)
    low, high = result["frame E:steel"].interval()
    assert low < 195e9 < high
    assert result["frame E:steel"].value == pytest.approx(195e9, rel=3e-3)


def test_frfs_and_modes_together_from_bare_arrays():
    model, places = frame()
    truth = model.with_values({CHANGES[0]: 0.15, CHANGES[2]: -0.12, RHO: 7850 * 1.04})
    lines = np.arange(10.0, 400.0, 1.0)
    outputs, drives = places[::3], [places[0], places[7]]
    H = noisy(frfs_of(truth, outputs, drives, lines).H, 0.01)
    f = frequencies_of(truth, n=6)
    result = textbook(
        model, [*CHANGES, RHO], frequency=f, frf=H, lines=lines, outputs=outputs, inputs=drives,
        noise=0.01, frequency_std=1e-3, settings=UpdateSettings(n_lines=400),
    )  # fmt: skip
    assert result.ending is Ending.CONVERGED, result.messages
    error = (result.values[:4] - [0.15, 0.0, -0.12, 7850 * 1.04]) / result.std[:4]
    assert np.abs(error).max() < norm.ppf(1 - 0.5e-3 / 4)
    assert (result.std[:4] < [2e-3, 2e-3, 2e-3, 15]).all()
    assert result.misfit["frf"] == pytest.approx(1, abs=5 / np.sqrt(2 * H.size))


def test_damping_of_another_form_between_resonances_moves_little():
    """Fits take a modal ratio as 2iζ(ω)K, which is the same at resonances alone."""
    model = beam(8, effects=(fix(0),)).with_damping(fem.Damping.modal(0.01))
    lines, places = np.arange(5.0, 200.0, 1.0), [(1, "z"), (5, "z")]
    H = frfs_of(model.with_values({E: 208e9}), places, places[:1], lines).H
    data = {"frf": H[:, :, 0], "lines": lines, "outputs": places, "inputs": places[:1]}
    result = textbook(model, [E], **data)
    assert result.ending is Ending.CONVERGED
    assert result["frame E:steel"].value == pytest.approx(208e9, rel=1e-3)


def test_a_group_moves_by_one_factor():
    heavy = fem.Material("heavy", 70e9, 2700.0)
    one = fem.MemberProperties(STEEL, fem.Section.rectangle(0.03, 0.01))
    other = fem.MemberProperties(heavy, fem.Section.rectangle(0.03, 0.01))
    mesh = fem.Mesh.from_lines([[0, 0, 0], [0.5, 0, 0], [1, 0, 0]], [[0, 1], [1, 2]], {"a": [0], "b": [1]})
    model = fem.Model(mesh.split(5), (fem.Frame(members={"a": one, "b": other}), fix(0)))
    f = frequencies_of(model, n=6)
    both = Unknown((E, ("frame", "E:heavy")), name="all moduli")
    result = textbook(model, [both], frequency=1.01 * f)
    values = result.model.values()
    assert values[E] / 210e9 == pytest.approx(1.01**2, rel=1e-6)
    assert values[("frame", "E:heavy")] / 70e9 == pytest.approx(1.01**2, rel=1e-6)
    assert result.names == ("all moduli",)


def test_bounds_hold_and_are_said():
    model = beam(10, effects=(fix(0),))
    f = frequencies_of(model, n=4)
    narrow = Unknown((E,), upper=215e9)
    result = textbook(model, [narrow], frequency=1.05 * f)
    got = result["frame E:steel"]
    assert got.value == pytest.approx(215e9)
    assert got.at_bound
    assert result.ending is Ending.AT_BOUNDS
    assert any("at a bound: frame E:steel" in m for m in result.messages)
    assert "at its bound" in result.table()


def test_lines_of_zeros_are_left_out_of_what_is_fitted():
    """They have no estimated noise, and count as little as a symmetry's zeros."""
    model = beam(8, effects=(fix(0),)).with_damping(fem.Damping.modal(0.01))
    lines, places = np.arange(5.0, 200.0, 1.0), [(1, "z"), (5, "z")]
    H = noisy(frfs_of(model, places, places[:1], lines).H, 0.01)
    H[20:60] = 0.0
    measurement = frf_data(model, H, lines=lines, outputs=places, inputs=places[:1])
    data = build_problem(model, measurement, ()).data
    assert not data.mask[20:60].any()
    assert data.mask[60:].all()


def test_a_member_that_is_far_off_is_found_and_a_wrong_prior_of_it_said():
    """One member is 60 % softer: a prior of 2 % is believed before the 40 data that the model then misses."""
    model, places = frame()
    truth = {**dict(zip(CHANGES, (0.02, -0.6, -0.01), strict=True)), RHO: 7850.0}
    lines, outputs, drives = np.arange(10.0, 400.0, 1.0), places[::3], [places[0], places[7]]
    H = noisy(frfs_of(model.with_values(truth), outputs, drives, lines).H, 0.01)
    data = {"frf": H, "lines": lines, "outputs": outputs, "inputs": drives, "noise": 0.01, "damping_std": 0.0}
    priors = dict(zip(truth, (0.05, 0.02, 0.05, 0.01), strict=True))
    free = textbook(model, priors | {CHANGES[1]: None}, **data)
    assert free.ending is Ending.CONVERGED
    assert np.abs((free.values - list(truth.values())) / free.std).max() < 3
    assert free.misfit["frf"] < 1.1
    kept = textbook(model, priors, **data)
    assert any("the data are not explained" in m and "frf by" in m for m in kept.messages)


def test_selection_says_what_it_leaves_out():
    model = planar(beam(10, effects=(fix(0),)))
    f = frequencies_of(model, n=5)
    result = textbook(model, [E, RHO], frequency=1.02 * f, settings=UpdateSettings(select="pivoting"))
    ((name, reason),) = result.left_out
    assert name in ("frame E:steel", "frame rho:steel")
    assert "does the same as" in reason
    assert result.ending is Ending.CONVERGED
    ratio = result["frame E:steel"].value / result["frame rho:steel"].value
    assert ratio == pytest.approx(1.02**2 * 210e9 / 7850, rel=1e-6)
    forward = textbook(model, [E, RHO], frequency=1.02 * f, settings=UpdateSettings(select="forward"))
    assert len(forward.left_out) == 1


def test_regularisation_bounds_what_the_data_do_not_say():
    # eight equal parts of a cantilever, four frequencies: without regularisation there is no answer
    n = 8
    points = np.array([[i / n, 0, 0] for i in range(n + 1)])
    lines = [[i, i + 1] for i in range(n)]
    mesh = fem.Mesh.from_lines(points, lines, {f"m{i}": [i] for i in range(n)})
    part = fem.MemberProperties(STEEL, fem.Section.rectangle(0.03, 0.01))
    changes = [MemberStiffness(name=f"d{i}", member=f"m{i}", change=0.0) for i in range(n)]
    model = planar(
        fem.Model(mesh, (fem.Frame(members={f"m{i}": part for i in range(n)}), fix(0), *changes)),
    )
    refs = [(f"d{i}", "change") for i in range(n)]
    smooth = 0.1 * np.linspace(-1, 1, n)
    f = fem.solve_modes(fem.assemble(model.with_values(dict(zip(refs, smooth, strict=True)))), n=4).frequency
    f = f * (1 + 1e-4 * np.random.default_rng(0).standard_normal(4))
    second = np.diff(np.eye(n), 2, axis=0)
    kwargs = {"frequency": f, "frequency_std": 1e-4, "model_error": 0.0}
    tikhonov = textbook(model, refs, **kwargs, settings=UpdateSettings(regularisation="tikhonov"))
    smoothed = textbook(
        model,
        refs,
        **kwargs,
        settings=UpdateSettings(regularisation="gsvd", operator=np.vstack([second, np.eye(n)[:2] * 1e-3])),
    )
    assert smoothed.curve is not None
    for result in (tikhonov, smoothed):
        assert np.abs(result.values - smooth).max() < 0.1


def test_several_starts_find_what_one_misses():
    model = beam(10, effects=(fix(0),))
    f = frequencies_of(model, n=4)
    result = textbook(model, {E: 0.3}, frequency=1.2 * f, settings=UpdateSettings(n_starts=3))
    assert len(result.starts) == 3
    assert max(evidence for _, evidence in result.starts) <= result.fitted.log_evidence + 0.5


def test_measured_ratios_are_taken_over_with_modes():
    """Four readings of 0.1, each mode with a scatter of 0.1 besides, against a prior of 0.5 in ln ζ.

    Of the distance from the prior's 0.01, up to ln 1.65, a share of 0.02 / 0.25 remains where each of the two
    knots has one reading to itself, and half of that where it has two: at most 6 %.
    """
    model = beam(10, effects=(fix(0),))
    modes = fem.solve_modes(
        fem.assemble(model.with_damping(fem.Damping.modal([0.01, 0.02], [1.0, 1000.0], powers=True))), n=4
    )
    result = textbook(model, {E: 0.05}, modes=modes)
    np.testing.assert_allclose(result.model.damping.ratio_at(modes.frequency), modes.zeta, rtol=0.06)


def test_samples_repeat_a_normal_density():
    pytest.importorskip("emcee")
    covariance = np.array([[4.0, 1.5], [1.5, 1.0]])
    inverse, mean = np.linalg.inv(covariance), np.array([3.0, -1.0])
    drawn = sample(lambda x: -0.5 * (x - mean) @ inverse @ (x - mean), mean, covariance, 3000, seed=4)
    n = drawn.n_independent
    std = np.sqrt(np.diag(covariance))
    # standard errors of a mean, of a deviation and of a correlation from n independent draws
    assert (np.abs(drawn.values.mean(axis=0) - mean) < 4 * std / np.sqrt(n)).all()
    assert (np.abs(drawn.values.std(axis=0) / std - 1) < 4 / np.sqrt(2 * n)).all()
    assert abs(np.corrcoef(drawn.values.T)[0, 1] - 0.75) < 4 * (1 - 0.75**2) / np.sqrt(n)


def test_an_updating_brings_samples_when_asked():
    pytest.importorskip("emcee")
    model = beam(4, effects=(fix(0),))
    f = frequencies_of(model, n=3)
    result = textbook(model, {E: 0.05}, frequency=f, settings=UpdateSettings(n_samples=50, seed=4))
    assert result.samples is not None
    assert result.samples.values.shape == (4 * 40, 1)
    got = result["frame E:steel"]
    assert abs(np.median(result.samples.values) - got.value) < 2 * got.std


def test_without_emcee_the_message_names_it(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "emcee", None)
    model = beam(6, effects=(fix(0),))
    f = frequencies_of(model, n=4)
    with pytest.raises(MissingExtraError, match="pip install emcee"):
        textbook(model, {E: 0.05}, frequency=f, settings=UpdateSettings(n_samples=10))


# -------------------------------------------------------------------------------------------- failures


def test_no_partner_at_all_ends_with_the_reason():
    model, places = frame()
    f, shapes = modes_of(model, places, 3)
    strange = np.random.default_rng(0).standard_normal(shapes.shape)
    result = textbook(model, {E: 0.05}, frequency=f, shapes=strange, outputs=places)
    assert result.ending is Ending.NO_PARTNERS
    assert result.values[0] == 210e9
    assert any("check the outputs" in m for m in result.messages)


def test_too_few_iterations_give_the_best_point():
    model = beam(10, effects=(fix(0),))
    f = frequencies_of(model, n=4)
    result = textbook(model, [E], frequency=1.15 * f, settings=UpdateSettings(max_iterations=1))
    assert result.ending is Ending.OUT_OF_ITERATIONS
    assert result.path[-1].cost < result.path[0].cost
    assert "allow more iterations" in result.messages[0]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({}, "nothing to update to"),
        ({"frequency": [0.0, 3.0]}, "all positive"),
        ({"frequency": [3.0], "shapes": np.ones((2, 2)), "outputs": [(1, "z"), (2, "z")]}, r"need \(2, 1\)"),
        ({"frequency": [3.0], "shapes": np.ones((2, 1))}, "outputs="),
        ({"frequency": [3.0], "numbers": [0, 1]}, "2 numbers of modes"),
        ({"frequency": [9.0, 3.0]}, "do not rise; without shapes"),
        (
            {"frf": np.ones((3, 1)), "lines": [1, 2, 3], "outputs": [6], "inputs": [6], "noise": [1, 2]},
            "shape",
        ),
        ({"frf": np.ones(3)}, "lines="),
        ({"frf": np.ones(3), "lines": [1.0, 2.0, 3.0]}, "outputs=…, inputs=…"),
    ],
)
def test_data_that_do_not_fit_are_refused(arguments, message):
    with pytest.raises(fem.ModelError, match=message):
        textbook(beam(4, effects=(fix(0),)), [E], **arguments)


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ([], "no parameter to update"),
        ([("frame", "G")], "has no parameter 'G'"),
        ([E, E], "updated twice"),
        ([Unknown((E, RHO))], "different kinds"),
        ([Unknown((E,), std=-1.0)], "must be positive"),
        ([Unknown((E,), prior="flat")], "allowed are normal, log-normal"),
        ([Unknown((E,), start=1.0)], "must lie between"),
    ],
)
def test_parameters_that_make_no_sense_are_refused(parameters, message):
    with pytest.raises(fem.ModelError, match=message):
        textbook(beam(4, effects=(fix(0),)), parameters, frequency=[10.0])


def test_settings_are_checked():
    with pytest.raises(ValueError, match="allowed are tikhonov, gsvd"):
        UpdateSettings(regularisation="ridge")
    with pytest.raises(ValueError, match="needs an operator"):
        UpdateSettings(regularisation="gsvd")
    with pytest.raises(ValueError, match="n_starts is 0; at least 1 is needed"):
        UpdateSettings(n_starts=0)


# ------------------------------------------------------------------------------------- several things at once


def test_regularised_frfs_keep_what_the_data_say():
    model, places = frame()
    truth = {CHANGES[0]: 0.1, CHANGES[2]: -0.12}
    lines, outputs, drives = np.arange(10.0, 400.0, 1.0), places[::3], [places[0], places[7]]
    H = noisy(frfs_of(model.with_values(truth), outputs, drives, lines).H, 0.01)
    settings = UpdateSettings(regularisation="tikhonov", n_lines=300)
    data = {"frf": H, "lines": lines, "outputs": outputs, "inputs": drives, "noise": 0.01}
    result = textbook(model, list(truth), **data, settings=settings)
    np.testing.assert_allclose(result.values[:2], list(truth.values()), atol=0.01)


def test_parameters_that_are_left_out_are_not_regularised():
    model = planar(beam(10, effects=(fix(0),)))
    how = UpdateSettings(select="pivoting", regularisation="tikhonov")
    result = textbook(model, [E, RHO], frequency=1.02 * frequencies_of(model, n=5), settings=how)
    assert len(result.left_out) == 1
    assert np.isfinite(result.values).all()


def test_a_loss_factor_stays_in_the_model():
    model = beam(10, effects=(fix(0),)).with_damping(fem.Damping.structural(0.02))
    lines, places = np.arange(5.0, 200.0, 1.0), [(1, "z"), (5, "z")]
    H = noisy(frfs_of(model, places, places[:1], lines).H, 0.01)
    result = textbook(model, [E], frf=H, lines=lines, outputs=places, inputs=places[:1], noise=0.01)
    again = frfs_of(result.model, places, places[:1], lines).H
    assert np.abs(np.log(np.abs(again / H))).std() < 0.02


def test_what_cannot_be_is_refused():
    model = beam(4, effects=(fix(0),))
    for arguments, words in (
        ({"damping_std": -1.0}, "damping_std is -1.0"),
        ({"model_error": np.nan}, "model_error is nan"),
        ({"numbers": [-1]}, "count from 0"),
    ):
        with pytest.raises(ModelError, match=words):
            update(model, [E], frequency=[10.0], **arguments)
