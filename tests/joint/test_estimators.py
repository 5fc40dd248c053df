"""The average solution and the output-error fit, on the paper's two beams with a joint of 67 parameters."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from benchmarks.joint_noise import ARMS, STEEL, full_joint, model_parts, noisy, parts, relative, truth
from fem import DIRECTIONS
from joint import (
    CoordinateSet,
    FormError,
    Interface,
    JointIdentificationError,
    SubstructureFRF,
    Uncertain,
    couple,
    fit_joint,
    full_form,
    identify_average,
    joint_impedance,
    relative_coordinates,
    relative_form,
    stack_substructures,
    with_masses,
)

FREQUENCY = np.linspace(20.0, 3200.0, 80)


@pytest.fixture(scope="module")
def square():
    return parts(FREQUENCY, None)


@pytest.fixture(scope="module")
def slim():
    return parts(FREQUENCY, 6)


@pytest.fixture(scope="module")
def form(square):
    return with_masses(relative_form(square.interface.joint, relative_coordinates(*ARMS)), ARMS)


# ---------------------------------------------------------------------------------------------------- average


@pytest.mark.parametrize("reciprocal", [True, False])
def test_full_matrices_return_from_all_lines(square, reciprocal):
    matrices = full_joint()
    H = couple(square, joint_impedance(FREQUENCY, *matrices)).H_nn
    form = full_form(square.interface.joint, reciprocal=reciprocal)
    assert len(form.names) == 4 * (78 if reciprocal else 144)
    found = identify_average(square, FREQUENCY, H, form)
    for X, Y in zip((found.K, found.M, found.C, found.D), matrices, strict=True):
        assert relative(X, Y) <= 1e-8
    assert_allclose(couple(square, found.Z(FREQUENCY)).H_nn, H, atol=1e-9 * abs(H).max())
    assert found.residual.max() < 1e-9


def test_constraints_cut_the_unknowns_and_what_data_they_need(form):
    """A massless joint between two nodes acts in six directions: six inputs are enough for it."""
    slim = parts(FREQUENCY, 6)
    massless = relative_form(slim.interface.joint, relative_coordinates(*ARMS))
    theta = truth(form)[:63]
    H = couple(slim, massless.Z(FREQUENCY, theta)).H_nn
    assert massless.basis(0.02).shape == (12, 6)
    # six inputs far from the joint see it badly; what is asked is that they see it
    found = identify_average(slim, FREQUENCY, H, massless)
    assert relative(found.K, massless.matrix("K", theta)) < 1e-8
    with pytest.raises(JointIdentificationError, match="6 internal inputs cannot determine 12"):
        identify_average(slim, FREQUENCY, H, full_form(slim.interface.joint, "K"))


def test_a_pattern_leaves_out_what_the_user_says(square):
    B = relative_coordinates(*ARMS)
    plain = relative_form(square.interface.joint, B, "K", pattern=np.eye(6))
    assert plain.names == ("K x x", "K y y", "K z z", "K rx rx", "K ry ry", "K rz rz")
    theta = np.array([3e7, 2e7, 1e7, 900.0, 800.0, 500.0])
    H = couple(square, plain.Z(FREQUENCY, theta)).H_nn
    assert_allclose(identify_average(square, FREQUENCY, H, plain).values, theta, rtol=1e-9)


def test_reduced_joint_coordinates_are_refused(square):
    """With translations only the joint's stiffness is no quadratic function of ω."""
    keep = [label for label in square.interface.joint.labels if ":r" not in label]
    at = square.interface.joint.positions(keep)
    inner = square.interface
    reduced = SubstructureFRF(
        FREQUENCY,
        Interface(CoordinateSet(tuple(keep)), inner.outputs, inner.inputs),
        square.H_aa,
        square.H_ab[:, :, at],
        square.H_ba[:, at],
        square.H_bb[:, at][:, :, at],
    )
    H = couple(square, joint_impedance(FREQUENCY, *full_joint())).H_nn
    form = full_form(reduced.interface.joint)
    with pytest.raises(JointIdentificationError, match="reduced: node U10 lacks rx ry rz, and 1 more"):
        identify_average(reduced, FREQUENCY, H, form)
    with pytest.raises(JointIdentificationError, match=r"constant matrices leave .* no function"):
        identify_average(reduced, FREQUENCY, H, form, complete=True, misfit_limit=0.02)


def test_one_line_does_not_tell_stiffness_from_mass(square):
    H = couple(square, joint_impedance(FREQUENCY, *full_joint())).H_nn
    one = SubstructureFRF(
        FREQUENCY[:1], square.interface, square.H_aa[:1], square.H_ab[:1], square.H_ba[:1], square.H_bb[:1]
    )
    with pytest.raises(JointIdentificationError, match=r"1 lines determine 156 of 312 parameters; .*U10:"):
        identify_average(one, FREQUENCY[:1], H[:1], full_form(one.interface.joint))


def test_two_springs_in_a_chain_by_hand():
    """Masses m1 … m4; the springs of 1-2 and 3-4 are the joints. H of a free mass is -1/(ω² m)."""
    frequency = np.linspace(1.0, 30.0, 25)
    omega = 2 * np.pi * frequency
    masses, springs = (1.0, 2.0, 1.5, 0.5), (4e3, 9e3)
    names = ("a", "b", "c", "d")
    pieces = []
    # each mass has a driven point of its own beside the joint, on a stiff spring of 1e5 N/m
    for name, m in zip(names, masses, strict=True):
        stiff = np.array([[1e5, -1e5], [-1e5, 1e5]])
        Z = stiff - omega[:, None, None] ** 2 * np.diag([0.1, m])
        H = np.linalg.inv(Z)
        joint, inner = CoordinateSet((f"{name}:x",)), CoordinateSet((f"{name}0:x",))
        pieces.append(
            SubstructureFRF(
                frequency,
                Interface(joint, inner, inner),
                H[:, :1, :1],
                H[:, :1, 1:],
                H[:, 1:, :1],
                H[:, 1:, 1:],
            )
        )
    whole = stack_substructures(*pieces)
    # the assembly from its own 8 × 8 dynamic stiffness, not by coupling
    Z = np.zeros((frequency.size, 8, 8))
    for k, m in enumerate(masses):
        Z[:, 2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = [[1e5, -1e5], [-1e5, 1e5]]
        Z[:, 2 * k, 2 * k] -= omega**2 * 0.1
        Z[:, 2 * k + 1, 2 * k + 1] -= omega**2 * m
    for (i, j), s in zip(((1, 3), (5, 7)), springs, strict=True):
        Z[:, [i, j], [i, j]] += s
        Z[:, [i, j], [j, i]] -= s
    H_nn = np.linalg.inv(Z)[:, ::2, ::2]
    B = np.array([[-1.0, 1, 0, 0], [0, 0, -1.0, 1]])
    form = relative_form(whole.interface.joint, B, "KC", pattern=np.eye(2), names=("x", "y"))
    found = identify_average(whole, frequency, H_nn, form, complete=True)
    assert_allclose(found.values, [*springs, 0, 0], atol=1e-6)


# ----------------------------------------------------------------------------------------------- output error


def test_noise_free_data_give_the_truth(slim, form):
    theta = truth(form)
    H = couple(slim, form.Z(FREQUENCY, theta)).H_nn
    fit = fit_joint(form, slim, FREQUENCY, H, 1.3 * theta, noise=1e-6)
    assert fit.converged
    assert relative(form.matrix("K", fit.values), form.matrix("K", theta)) < 1e-9
    assert_allclose(fit.H, H, atol=1e-9 * abs(H).max())


@pytest.mark.parametrize(("n_seeds", "allowed"), [(1, 0.75), pytest.param(6, 0.3, marks=pytest.mark.slow)])
def test_errors_are_what_the_bound_of_cramer_and_rao_says(slim, form, n_seeds, allowed):
    """Seeds of 67 parameters: normal errors of the stated deviation, correlated within a seed.

    The mean square of 402 standard normal numbers strays by √(2/402) = 7 %, and by more where they go
    together: with the correlations of these estimates n_eff is above 25 for each seed, and 30 % are 2.6
    deviations for six of them, 75 % for one.
    """
    theta = truth(form)
    exact = couple(slim, form.Z(FREQUENCY, theta)).H_nn
    errors = []
    for seed in range(n_seeds):
        measured = noisy(exact, 0.01, np.random.default_rng(seed))
        fit = fit_joint(form, slim, FREQUENCY, measured, 1.2 * theta, noise=0.01)
        n = exact.size
        assert fit.chi2 == pytest.approx(1.0, abs=4 / np.sqrt(n))  # Σ|r|² strays by √n
        errors.append((fit.values - theta) / fit.std)
        assert relative(form.matrix("K", fit.values), form.matrix("K", theta)) < 2e-4
    assert np.mean(np.array(errors) ** 2) == pytest.approx(1.0, abs=allowed)


def test_noise_is_estimated_where_it_is_not_given():
    lines = np.linspace(20.0, 3200.0, 800)
    slim = parts(lines, 6)
    form = relative_form(slim.interface.joint, relative_coordinates(*ARMS), "KD", pattern=np.eye(6))
    k = np.array([3e7, 2e7, 1e7, 900.0, 800.0, 500.0])
    theta = np.append(k, 0.02 * k)
    measured = noisy(couple(slim, form.Z(lines, theta)).H_nn, 0.01, np.random.default_rng(3))
    fit = fit_joint(form, slim, lines, measured, 1.1 * theta)
    # resonances that the lines resolve badly are taken for noise, so that chi² stays below 1
    assert 0.5 < fit.chi2 < 1.3
    assert relative(form.matrix("K", fit.values), form.matrix("K", theta)) < 1e-3


@pytest.mark.parametrize(
    ("wrong", "n_lines"),
    [(0.01, 40), *(pytest.param(wrong, 80, marks=pytest.mark.slow) for wrong in (0.001, 0.01))],
)
def test_a_wrong_modulus_of_the_parts_is_found_beside_the_joint(form, wrong, n_lines):
    """E of both parts is wrong and uncertain by 2 %: the joint stays right; without it, it does not."""
    theta = truth(form)
    lines = FREQUENCY[:: FREQUENCY.size // n_lines]
    H = couple(parts(lines, 6, STEEL.E * (1 + wrong)), form.Z(lines, theta)).H_nn
    measured = noisy(H, 0.01, np.random.default_rng(1))
    models = model_parts(lines, [Uncertain(name, "frame", "E:steel", 0.02) for name in ("U", "D")])
    fit = fit_joint(form, models, lines, measured, 1.05 * theta, noise=0.01)
    K = form.matrix("K", theta)
    assert relative(form.matrix("K", fit.values), K) < 2e-3
    assert abs((fit.part_values - STEEL.E * (1 + wrong)) / fit.part_std).max() < 4
    assert abs((fit.values - theta) / fit.std).max() < 4.5
    assert fit.chi2 < 1.1
    blind = fit_joint(form, models.at_mean, lines, measured, fit.values, noise=0.01, max_iterations=4)
    assert blind.chi2 > 2
    assert "the model lacks an effect or is wrong" in blind.message
    assert relative(form.matrix("K", blind.values), K) > 1e-3


def test_derivatives_by_the_parts_are_exact():
    models = model_parts(
        FREQUENCY, [Uncertain("U", "frame", "rho:steel", 0.02), Uncertain("D", "damping", "ratio", 0.3)]
    )
    x = np.array([0.4, -0.7])
    _, slopes = models.evaluate(x)
    for i in range(2):
        step = np.eye(2)[i] * 1e-2
        around = {s: models.evaluate(x + s * step)[0] for s in (-2, -1, 1, 2)}
        for name in ("H_aa", "H_ab", "H_ba", "H_bb"):
            H = {s: getattr(each, name) for s, each in around.items()}
            # Richardson: h⁴ is left of the error, and of rounding a hundredth of what a step of 1e-4 has
            expected = (8 * (H[1] - H[-1]) - (H[2] - H[-2])) / 12e-2
            assert abs(getattr(slopes[i], name) - expected).max() < 1e-5 * abs(expected).max()


def test_what_the_data_cannot_say_is_said(slim, form):
    """Below 300 Hz the joint is stiff beside the beams: most of its numbers leave no trace in the noise."""
    few = FREQUENCY[:8]
    low = SubstructureFRF(few, slim.interface, slim.H_aa[:8], slim.H_ab[:8], slim.H_ba[:8], slim.H_bb[:8])
    theta = truth(form)
    measured = noisy(couple(low, form.Z(few, theta)).H_nn, 0.03, np.random.default_rng(0))
    fit = fit_joint(form, low, few, measured, theta, noise=0.03)
    known = fit.identifiability
    assert not known.determined.all()
    assert "do not determine" in fit.message
    assert known.ranking()[0] == "m"
    assert known.ranking()[-1][0] in "CD"
    assert known.weakest[0][0] > known.weakest[1][0]


def test_missing_values_are_left_out(slim, form):
    theta = truth(form)
    H = couple(slim, form.Z(FREQUENCY, theta)).H_nn.copy()
    H[3:9, 4, 2] = np.nan
    fit = fit_joint(form, slim, FREQUENCY, H, 1.1 * theta, noise=1e-6)
    assert relative(form.matrix("K", fit.values), form.matrix("K", theta)) < 1e-9


@pytest.mark.parametrize("kind", ["zener", "fractional_kelvin_voigt", "fractional_zener"])
def test_rubber_is_found_with_its_law(slim, kind):
    B = relative_coordinates(*ARMS)
    form = relative_form(slim.interface.joint, B, (kind,), pattern=np.eye(6))
    own = {"ratio": 3.0, "tau": 2e-4, "alpha": 0.6}
    stiffness = dict(zip(DIRECTIONS, [2e6, 2e6, 3e6, 60.0, 70.0, 90.0], strict=True))
    theta = np.array([own.get(n.split()[-1], stiffness[n.split()[1]]) for n in form.names])
    H = couple(slim, form.Z(FREQUENCY, theta)).H_nn
    start = np.array(
        [np.nan if n.split()[-1] in own else 0.6 * v for n, v in zip(form.names, theta, strict=True)]
    )
    fit = fit_joint(form, slim, FREQUENCY, noisy(H, 1e-3, np.random.default_rng(0)), start, noise=1e-3)
    assert abs((fit.values - theta) / fit.std).max() < 4.5
    assert fit.chi2 < 1.1
    with pytest.raises(JointIdentificationError, match="not linear"):
        identify_average(slim, FREQUENCY, H, form)


def test_the_band_of_the_stiffness_is_what_its_parameters_scatter_to(slim, form):
    """The standard deviation of Z(ω) against that of draws from the parameters' covariance."""
    theta = truth(form)
    measured = noisy(couple(slim, form.Z(FREQUENCY, theta)).H_nn, 0.01, np.random.default_rng(2))
    fit = fit_joint(form, slim, FREQUENCY, measured, theta, noise=0.01)
    rng = np.random.default_rng(4)
    draws = rng.multivariate_normal(fit.values, fit.covariance, 400, method="cholesky")
    Z = np.array([form.Z(FREQUENCY[[10, 70]], d) for d in draws])
    scatter = Z.real.std(axis=0) + 1j * Z.imag.std(axis=0)
    band = fit.Z_std(FREQUENCY[[10, 70]])
    # a deviation from 400 draws strays by 1/√800 = 3.5 %
    for part in (np.real, np.imag):
        assert_allclose(part(band), part(scatter), rtol=0.2)


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"start": np.zeros(3)}, ValueError, "67 finite values are needed"),
        ({"start": np.full(67, np.nan)}, ValueError, "no finite value of K x x; only"),
        ({"start": {"m": 1.0}}, ValueError, "numbers in the order of the form's names"),
        ({"noise": -1.0}, ValueError, "noise must be positive"),
        ({"noise": np.ones(7)}, ValueError, "noise has shape .* is needed"),
        ({"stages": ()}, ValueError, "parts of the lines above 0"),
        ({"stages": (2.0,)}, ValueError, "parts of the lines above 0"),
        ({"positive": "Q"}, ValueError, "some of K, M, C, D are allowed"),
        ({"frequency": FREQUENCY[:-1]}, ValueError, "share one set of lines"),
    ],
)
def test_what_does_not_fit_is_refused(slim, form, change, error, message):
    H = slim.H_aa
    given = {"frequency": FREQUENCY, "start": truth(form), "noise": 0.01, **change}
    with pytest.raises(error, match=message):
        fit_joint(form, slim, given.pop("frequency"), H, given.pop("start"), **given)


def test_forms_that_cannot_be_are_refused(square):
    joint = square.interface.joint
    with pytest.raises(FormError, match="allowed are K, M, C, D"):
        full_form(joint, "KQ")
    with pytest.raises(FormError, match="at least one entry"):
        full_form(joint, pattern=np.zeros((12, 12)))
    with pytest.raises(FormError, match="B has shape"):
        relative_form(joint, np.ones((6, 5)))
    with pytest.raises(FormError, match="not zero, is needed"):
        full_form(joint).with_term("extra", "K", np.zeros((12, 12)))
    with pytest.raises(FormError, match="occurs twice"):
        full_form(joint).with_term("K U10:x U10:x", "K", np.eye(12))
    with pytest.raises(FormError, match="not of the form"):
        full_form(joint, "K").values_of(K=np.triu(np.ones((12, 12))))
