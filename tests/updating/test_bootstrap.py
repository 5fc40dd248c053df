"""The bootstrap of an update against closed forms: where the linearised deviations hold, and where not."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from fem.analysis.frf_solver import compute_frf
from fem.analysis.modes import solve_modes
from fem.model import Damping, ModelError
from fem.system import assemble
from tests.frames import beam, fix
from updating import Unknown, UpdateSettings, update
from updating.inference.bootstrap import BootstrapModel, refit

E, RHO = ("frame", "E:steel"), ("frame", "rho:steel")
STD = 0.002
"""Of natural frequencies, relative [-]."""


@pytest.fixture(scope="module")
def model():
    return replace(beam(4, 1.0, effects=(fix(0),)), damping=Damping.modal(0.02))


@pytest.fixture(scope="module")
def frequency(model):
    return solve_modes(assemble(model), 4).frequency


def refits(updated, n, seed=0):
    drawn = BootstrapModel.of(updated, seed)
    return np.array([refit(drawn, k) for k in range(n)])


@pytest.mark.slow
def test_a_linear_problem_has_the_closed_form(model, frequency):
    """ln f = (ln E - ln ρ)/2 + …: covariance (JᵀC⁻¹J + P⁻¹)⁻¹ with the errors common to all modes in C."""
    error, prior = 0.004, np.array([0.03, 0.01])
    updated = update(
        model, dict(zip((E, RHO), prior, strict=True)), frequency=frequency * 1.003, frequency_std=STD,
        model_error=error,
    )  # fmt: skip
    n = len(frequency)
    C = (STD**2 + error**2 / 2) * np.eye(n) + error**2 / 2
    J = np.tile([0.5, -0.5], (n, 1))
    covariance = np.linalg.inv(J.T @ np.linalg.solve(C, J) + np.diag(prior**-2.0))
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
    updated = update(
        model, [bounded], frequency=frequency * np.sqrt(1.01), frequency_std=STD, model_error=0.0
    )
    (p,) = updated.parameters
    assert not p.at_bound
    assert p.value == pytest.approx(value, rel=1e-6)
    assert p.std / p.value == pytest.approx(sigma, rel=1e-3)
    a = -near
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


def test_a_misfit_widens_both(model, frequency):
    """Errors four times as large as stated: the fit widens its deviations, and the noise of resamples."""
    off = frequency * (1 + 4 * STD * np.array([1, -1, -1, 1]))
    updated = update(model, [E], frequency=off, frequency_std=STD, model_error=0.0)
    assert updated.misfit["modes"] > 9
    N = 60
    x = np.log(refits(updated, N)[:, 0])
    (p,) = updated.parameters
    assert x.std(ddof=1) == pytest.approx(p.std / p.value, rel=3.5 / np.sqrt(2 * N))


@pytest.mark.slow
@pytest.mark.parametrize("error", [0.0, 2e-3])
def test_frfs_with_noise_and_errors_of_the_model(model, error):
    """In the linear range of E and ρ the linearised deviations hold, those of shifts and gains included."""
    lines = np.arange(5.0, 200.0, 1.0)
    places = [(1, "y"), (3, "y")]
    rows = np.zeros((2, model.n_dof))
    for row, (point, _) in zip(rows, places, strict=True):
        row[6 * point + 1] = 1.0
    H = compute_frf(assemble(model), lines, rows, rows[:1], "accelerance").H
    noise = np.random.default_rng(3).standard_normal((2, *H.shape))
    H = H * (1 + 0.02 * (noise[0] + 1j * noise[1]))
    updated = update(
        model, {E: 0.05, RHO: 0.05}, frf=H, lines=lines, outputs=places, inputs=places[:1], noise=0.02,
        model_error=error, amplitude_error=5 * error, damping=False,
    )  # fmt: skip
    N = 80
    x = np.log(refits(updated, N))
    linear = np.array([p.std / p.value for p in updated.parameters])
    np.testing.assert_allclose(x.std(axis=0, ddof=1), linear, rtol=3.5 / np.sqrt(2 * N))


def test_a_number_decides_a_resample(model, frequency):
    updated = update(model, [E], frequency=frequency, frequency_std=STD)
    drawn = BootstrapModel.of(updated, 5)
    again, other, seeded = drawn.resample(7), drawn.resample(8), BootstrapModel.of(updated, 6).resample(7)
    first = drawn.resample(7).modes
    assert first is not None
    for problem, same in ((again, True), (other, False), (seeded, False)):
        assert problem.modes is not None
        assert np.array_equal(problem.modes.frequency, first.frequency) == same


def test_failed_and_regularised_updates_are_refused(model, frequency):
    settings = UpdateSettings(regularisation="tikhonov")
    regularised = update(model, [E, RHO], frequency=frequency * 1.01, settings=settings)
    with pytest.raises(ModelError, match="is regularised"):
        BootstrapModel.of(regularised)
    short = UpdateSettings(max_iterations=1)
    ended = update(model, [E], frequency=frequency * 1.4, settings=short)
    with pytest.raises(ModelError, match="out of iterations: there is no fit to draw from"):
        BootstrapModel.of(ended)
