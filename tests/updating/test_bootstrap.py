"""The bootstrap of an update against closed forms: where the linearised deviations hold, and where not."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from fem import Damping, ModelError, assemble, compute_frf, solve_modes
from tests.frames import beam, fix, on_fine_mesh
from tests.updating.test_update import textbook
from updating import BootstrapModel, Unknown, UpdateSettings, refit, update

E, RHO = ("frame", "E:steel"), ("frame", "rho:steel")
STD = 0.002
"""Of natural frequencies, relative [-]."""


@pytest.fixture(scope="module")
def model():
    return replace(beam(12, 1.0, effects=(fix(0),)), damping=Damping.structural(0.04))


@pytest.fixture(scope="module")
def frequency(model):
    return solve_modes(assemble(on_fine_mesh(model)), 4).frequency


def refits(updated, n, seed=0):
    drawn = BootstrapModel.of(updated, seed)
    return np.array([refit(drawn, k) for k in range(n)])


@pytest.mark.slow
def test_a_linear_problem_has_the_closed_form(model, frequency):
    """ln f = (ln E - ln ρ)/2 + …: covariance (JᵀJ/σ² + P⁻¹)⁻¹."""
    prior = np.array([0.03, 0.01])
    priors = dict(zip((E, RHO), prior, strict=True))
    updated = textbook(model, priors, frequency=frequency * 1.003, frequency_std=STD)
    n = len(frequency)
    J = np.tile([0.5, -0.5], (n, 1))
    covariance = np.linalg.inv(J.T @ J / STD**2 + np.diag(prior**-2.0))
    std = np.sqrt(np.diag(covariance))
    N = 250
    x = np.log(refits(updated, N))
    np.testing.assert_allclose(x.std(axis=0, ddof=1), std, rtol=3.5 / np.sqrt(2 * N))
    fitted = np.log([p.value for p in updated.parameters])
    assert (abs(x.mean(axis=0) - fitted) < 3.5 * std / np.sqrt(N)).all()
    r = covariance[0, 1] / std.prod()
    assert np.corrcoef(x.T)[0, 1] == pytest.approx(r, abs=3.5 * (1 - r**2) / np.sqrt(N))
    linear = [p.std / p.value for p in updated.parameters]
    np.testing.assert_allclose(linear, std, rtol=1e-3)


@pytest.mark.slow
def test_a_parameter_near_its_bound(model, frequency):
    """x = max(bound, x̂ + σ z): a censored normal, of which the linearised deviation σ knows nothing."""
    sigma = 2 * STD / np.sqrt(len(frequency))  # of ln E
    near = 0.3
    value = 210e9 * 1.01
    bounded = Unknown((E,), start=value, lower=value * np.exp(-near * sigma))
    updated = textbook(model, [bounded], frequency=frequency * np.sqrt(1.01), frequency_std=STD)
    (p,) = updated.parameters
    assert not p.at_bound
    assert p.value == pytest.approx(value, rel=1e-5)
    assert p.std / p.value == pytest.approx(sigma, rel=1e-3)
    a = np.log(bounded.lower / p.value) / sigma  # near, but for what the mesh leaves
    mean = a * norm.cdf(a) + norm.pdf(a)
    square = a**2 * norm.cdf(a) + norm.sf(a) + a * norm.pdf(a)
    std = np.sqrt(square - mean**2)
    N = 300
    z = np.log(refits(updated, N)[:, 0] / p.value) / sigma
    share = norm.cdf(a)
    assert (z < a + 1e-6).mean() == pytest.approx(share, abs=3.5 * np.sqrt(share * (1 - share) / N))
    assert z.mean() == pytest.approx(mean, abs=3.5 * std / np.sqrt(N))
    assert z.std(ddof=1) == pytest.approx(std, rel=0.15)
    assert std < 0.75  # the linearised one is 1


@pytest.mark.slow
@pytest.mark.parametrize("error", [0.0, 0.3])
def test_frfs_with_noise_and_the_form_of_the_model(model, error):
    """In the linear range of E and ρ the linearised deviations hold, those by the form included."""
    lines = np.arange(5.0, 200.0, 1.0)
    places = [(3, "y"), (9, "y")]
    rows = np.zeros((2, model.n_dof))
    for row, (point, _) in zip(rows, places, strict=True):
        row[6 * point + 1] = 1.0
    H = compute_frf(assemble(model), lines, rows, rows[:1], "accelerance").H
    noise = np.random.default_rng(3).standard_normal((2, *H.shape))
    H = H * (1 + 0.02 * (noise[0] + 1j * noise[1]))
    updated = update(
        model,
        {E: 0.05, RHO: 0.05},
        frf=H,
        lines=lines,
        outputs=places,
        inputs=places[:1],
        noise=0.02,
        model_error=error,
        damping_std=0.0,
    )
    N = 80
    x = np.log(refits(updated, N))
    linear = np.array([p.std / p.value for p in updated.parameters])
    # Fits take noise for 1.25 times as large as it is seen to be.
    ratio = x.std(axis=0, ddof=1) / linear
    assert (ratio > (0.8 if error == 0 else 0.5) * (1 - 3.5 / np.sqrt(2 * N))).all()
    assert (ratio < 1 + 3.5 / np.sqrt(2 * N)).all()


def test_a_number_decides_a_resample(model, frequency):
    updated = textbook(model, [E], frequency=frequency, frequency_std=STD)
    drawn = BootstrapModel.of(updated, 5)
    again, other, seeded = drawn.resample(7), drawn.resample(8), BootstrapModel.of(updated, 6).resample(7)
    first = drawn.resample(7).targets
    for problem, same in ((again, True), (other, False), (seeded, False)):
        assert np.array_equal(problem.targets.frequency, first.frequency) == same


def test_failed_and_regularised_updates_are_refused(model, frequency):
    settings = UpdateSettings(regularisation="tikhonov")
    regularised = textbook(model, [E, RHO], frequency=frequency * 1.01, settings=settings)
    with pytest.raises(ModelError, match="is regularised"):
        BootstrapModel.of(regularised)
    short = UpdateSettings(max_iterations=1)
    ended = textbook(model, [E], frequency=frequency * 1.4, settings=short)
    with pytest.raises(ModelError, match="out of iterations: there is no fit to draw from"):
        BootstrapModel.of(ended)
