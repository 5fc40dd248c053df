"""Error levels, noise, scatter of damping and the reduced basis, on which evidence rests."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.linalg import eigh

from benchmarks.hidden.cases import make_case
from dovetail import load_study
from dovetail.pipeline import fit_problem
from fem.effects import MemberDamping
from fem.reduction import LocalChanges
from tests.frames import write_study
from tests.noise import complex_normal
from updating import assessed_fit, build_problem
from updating.diagnosis.evidence import Ranking, Search, Start
from updating.inference import FORM_DAMPING, FORM_MODES, direct_responses, scatter_of
from updating.least_squares import Levels

NOISE = 0.02
"""Standard deviation of ln|H| and of the phase [-, rad]."""


@pytest.fixture(scope="module")
def problem(tmp_path_factory):
    return fit_problem(load_study(write_study(tmp_path_factory.mktemp("likelihood"), 0.0)))


@pytest.fixture(scope="module")
def fitted(problem):
    return assessed_fit(problem)


# ----------------------------------------------------------------------------------------- error levels


def exact(n, size, noise):
    """Return the levels of a model whose form is right: c is the noise of a block's mean."""
    n, size, noise = (np.array([float(x)]) for x in (n, size, noise))
    return Levels(n, noise * n / size, noise)


def test_below_the_noise_all_data_count():
    """N v / 2σ², the likelihood of N independent normal variables."""
    levels, v = exact(40, 8000, 0.02), np.array([0.015])
    at_noise = levels.cost(levels.noise)
    assert levels.cost(v) - at_noise == pytest.approx(8000 / 2 * (0.015 - 0.02) / 0.02)


def test_a_discrepancy_counts_by_the_means_of_its_blocks():
    """The mean of N/n residuals has the variance σ² n/N, and with the discrepancy σ² n/N + τ²."""
    levels, tau2 = exact(40, 8000, 0.02), 0.3
    more = levels.cost(levels.noise + tau2) - levels.cost(levels.noise)
    mean = 0.02 * 40 / 8000
    assert more == pytest.approx(40 / 2 * np.log((mean + tau2) / mean))


@pytest.mark.parametrize("v", [0.004, 0.0199, 0.0201, 0.5])
def test_the_weight_is_twice_the_slope_of_the_cost(v):
    levels, h = exact(40, 8000, 0.02), 1e-7
    slope = (levels.cost(np.array([v + h])) - levels.cost(np.array([v - h]))) / (2 * h)
    assert levels.weight(np.array([v]))[0] == pytest.approx(2 * slope, rel=1e-4)


# ------------------------------------------------------------------------------------------------ noise


@pytest.mark.parametrize(("stated", "believed"), [(3.0, 1.0), (0.5, 0.5)])
def test_noise_is_reduced_to_that_of_neighbouring_residuals(problem, fitted, stated, believed):
    """Never raised: near resonances residuals of a wrong model differ as noise does."""
    H, rng = problem.receptance(fitted), np.random.default_rng(8)
    H = H * np.exp(NOISE * complex_normal(rng, H.shape))
    data = replace(problem.data, H=H, noise=np.full(H.shape, stated * NOISE))
    found = replace(problem, data=data).with_seen_noise(fitted).data
    np.testing.assert_allclose(found.noise, believed * NOISE, rtol=0.1)


# ---------------------------------------------------------------------------------------------- scatter


def deviated(problem, fitted, scatter, sizes, lines):
    """Return receptances of a fitted model with deviations."""
    f, refs = problem.data.frequency[lines], list(fitted.values)
    engine = problem.engine(f, refs, deviations=scatter.deviations)
    values = np.append([fitted.values[r] for r in refs], sizes)
    return engine.evaluate(values, problem.damping.ratio(f, fitted.zeta), gradient=False)[0]


def damping_ratio(problem, fitted, frequency):
    """Return that of members."""
    return np.atleast_2d(problem.damping.ratio(np.atleast_1d(frequency), fitted.zeta))[0]


def change_by(problem, fitted, scatter, number, lines, size=1e-6):
    """Return the change of the logarithm of the receptances for a little of one deviation, per its size."""
    sizes = size * (np.arange(len(scatter.std)) == number)
    H = [deviated(problem, fitted, scatter, each, lines) for each in (0 * sizes, sizes)]
    return np.log(H[1] / H[0]) / size


def test_members_loss_factors_deviate(problem, fitted):
    lines, members = problem.lines_up_to(np.inf, 20), list(problem.reduced.model.mesh.members)
    scatter = scatter_of(problem, fitted, 0.1, 0.0)
    refs, frequency = list(fitted.values), problem.data.frequency[lines]
    values, zeta = np.array([fitted.values[r] for r in refs]), problem.damping.ratio(frequency, fitted.zeta)
    first = len(scatter.std) - len(members)
    for number, member in enumerate(members, first):
        H = []
        for loss in (0.0, 1e-6):
            effect = MemberDamping(name="more", member=member, loss_factor=loss)
            H.append(problem.engine(frequency, refs, (effect,)).evaluate(values, zeta, gradient=False)[0])
        expected, found = np.log(H[1] / H[0]) / 1e-6, change_by(problem, fitted, scatter, number, lines)
        np.testing.assert_allclose(found, expected, atol=5e-3 * np.abs(expected).max())  # E is fitted
    ratio = damping_ratio(problem, fitted, problem.data.frequency)
    np.testing.assert_allclose(scatter.std[first:], 0.1 * 2 * np.median(ratio))


def test_joints_loss_factors_deviate():
    case = make_case(3, "cross", "nothing")
    problem = build_problem(case.model, case.measurement, case.nuisances)
    nominal, lines = problem.nominal(), problem.lines_up_to(np.inf, 20)
    scatter = scatter_of(problem, nominal, 0.1, 0.0)
    (joint,) = (e for e in problem.reduced.model.effects if e.connection)
    frequency, own = problem.data.frequency[lines], (joint.name, "eta")
    zeta, values = problem.damping.ratio(frequency, nominal.zeta), {**nominal.values, own: joint.eta}
    engine = problem.engine(frequency, list(values))
    H = [
        engine.evaluate(np.array([*nominal.values.values(), joint.eta + more]), zeta, gradient=False)[0]
        for more in (0.0, 1e-6)
    ]
    expected, last = np.log(H[1] / H[0]) / 1e-6, len(scatter.std) - 1
    found = change_by(problem, nominal, scatter, last, lines)
    np.testing.assert_allclose(found, expected, atol=1e-3 * np.abs(expected).max())
    ratio = np.median(damping_ratio(problem, nominal, problem.data.frequency))
    assert scatter.std[last] == pytest.approx(problem.damping.std * (joint.eta + 2 * ratio))


def receptances(problem, fitted, lines, change, loss):
    """Return receptances of the reduced model with its stiffness changed by a part of its own loss."""
    f, refs = problem.data.frequency[lines], list(fitted.values)
    values, zeta = np.array([fitted.values[r] for r in refs]), problem.damping.ratio(f, fitted.zeta)
    engine = problem.engine(f, refs)
    total = LocalChanges.of(engine, values, zeta).total
    K, M, joints = (total[key] for key in ("K", "M", "connections"))
    out = []
    for w, z, of_joints in zip(2 * np.pi * f, *np.atleast_2d(zeta)[[0, -1]], strict=True):
        Z = (1 + 2j * z) * (K - joints) + (1 + 2j * of_joints) * joints - w**2 * M
        out.append(engine.outputs.T @ np.linalg.solve(Z + loss(z) * change(K, M), engine.inputs))
    return np.stack(out)


@pytest.mark.parametrize("kind", ["eigenvalues", "damping ratios"])
def test_deviations_of_modes_are_those_of_single_modes(problem, fitted, kind):
    """K + δ λ (Mφ)(Mφ)ᵀ shifts one eigenvalue by the share δ; its loss alone shifts the damping ratio.

    By more than a peak is wide, where no slope is enough.
    """
    lines, limit = problem.lines_up_to(np.inf, 12), (2 * np.pi * problem.data.frequency[-1]) ** 2
    every = damping_ratio(problem, fitted, problem.data.frequency)
    if kind == "eigenvalues":
        scatter, share, loss = (
            scatter_of(problem, fitted, 0.0, 0.002),
            5 * np.median(every),
            lambda z: 1 + 2j * z,
        )
        n_modes = len(scatter.std)
    else:
        scatter, share, loss = scatter_of(problem, fitted, 0.1, 0.0), 0.3, lambda z: 2j
        n_modes = len(scatter.std) - len(problem.reduced.model.mesh.members)

    def shifted(mode, K, M):
        lam, V = eigh(K, M)
        at = np.flatnonzero(lam > 1e-6 * limit)[mode]
        own = damping_ratio(problem, fitted, np.sqrt(lam[at]) / (2 * np.pi)) if kind != "eigenvalues" else 1.0
        return share * own * lam[at] * np.outer(M @ V[:, at], M @ V[:, at])

    assert n_modes > 3
    np.testing.assert_array_equal(scatter.std[:n_modes], scatter.std[0])
    for mode in range(n_modes):
        exact = receptances(problem, fitted, lines, partial(shifted, mode), loss)
        found = deviated(problem, fitted, scatter, share * (np.arange(len(scatter.std)) == mode), lines)
        np.testing.assert_allclose(found / exact, 1.0, atol=1e-6)


def test_eigenvalues_are_uncertain_where_the_form_is_not_right(problem, fitted):
    exact, real = (Ranking().scatter(replace(problem, model_error=e), fitted) for e in (0.0, 0.3))
    n = len(exact.std) - len(problem.reduced.model.mesh.members)
    np.testing.assert_array_equal(exact.std[:n], FORM_DAMPING)
    np.testing.assert_array_equal(real.std, [*[real.eigenvalue] * n, *exact.std, *[1.0] * real.n_channels])
    np.testing.assert_allclose((real.sizes[0], real.sizes[-1]), FORM_MODES)
    assert real.eigenvalue in real.sizes


@pytest.mark.parametrize("size", [0.0, 0.004])
def test_the_size_of_the_modes_errors_is_inferred(problem, fitted, size):
    """Receptances whose eigenvalues are off by a known size, and noise: the size is found, to a step."""
    every, rng = np.arange(len(problem.data.frequency)), np.random.default_rng(11)
    scatter = scatter_of(problem, fitted, 0.0, 1.0)
    noise = NOISE * (rng.standard_normal((2, *problem.data.H.shape)).T @ [1, 1j]).T
    shifts = size * rng.permutation(np.resize([1.0, -1.0], len(scatter.std)))
    H = deviated(problem, fitted, scatter, shifts, every) * np.exp(noise)
    data = replace(problem.data, H=H, noise=np.full(H.shape, NOISE))
    search = Search(replace(problem, data=data, model_error=0.3), (), (), 0.0)
    found = search.fits.fully((), ()).fitted.size
    if size:
        assert size / 2 <= found <= 2 * size
    else:
        assert found == FORM_MODES[0]


def test_a_fit_with_scatter_moves_it_and_keeps_the_values_it_reports(problem, fitted):
    lines = problem.lines_up_to(np.inf, 20)
    scatter = scatter_of(problem, fitted, 0.1, 0.0)
    plain = problem.function((), (), lines)
    function = plain.with_scatter(scatter)
    assert len(function.start) == len(plain.start) + len(scatter.std)
    x = function.moved_to(fitted)
    own, step = slice(len(plain.start), None), np.zeros_like(x)
    step[own] = np.random.default_rng(4).standard_normal(len(scatter.std))
    moved, there = function(x + step, False)[0], function(x, False)[0]
    weight, keep = problem.data.weight[lines], function.keep
    changed = deviated(problem, fitted, scatter, step[own] * scatter.std, lines)
    changed = changed / deviated(problem, fitted, scatter, 0 * scatter.std, lines)
    assert np.abs(changed[keep] - 1).max() > 0.05
    np.testing.assert_allclose(moved - there, weight[keep] * np.log(changed[keep]), atol=1e-9)
    J, h = function(x + step, True)[1], 1e-6
    for k in range(own.start, len(x), 5):
        more, less = (function(x + step + s * h * (np.arange(len(x)) == k), False)[0] for s in (1, -1))
        numeric = (more - less) / (2 * h)  # what losses do between modes is known to first order
        np.testing.assert_allclose(J[k], numeric, atol=0.02 * np.abs(numeric).max())
    np.testing.assert_array_equal(function.moved_to(fitted)[: len(plain.start)], plain.moved_to(fitted))


# -------------------------------------------------------------------------------------- basis and search


def test_responses_of_a_fit_make_the_basis_exact_at_their_lines(problem, fitted):
    (softer, *_) = fitted.values
    result = replace(fitted, values={**fitted.values, softer: 0.2 * fitted.values[softer]})
    before, responses = direct_responses(problem, result, 8)
    richer = replace(problem, reduced=problem.reduced.with_shapes(responses))
    after, _ = direct_responses(richer, result, 8)
    assert before > 1e-5
    assert after < 1e-3 * before


def test_an_effect_without_a_structure_gets_no_fit(problem, fitted, monkeypatch):
    def singular(*_, **__):
        raise np.linalg.LinAlgError

    search = Search(problem, (), problem.reduced.model.of_kind(MemberDamping), 0.0)
    nothing = search.full((), ())
    monkeypatch.setattr("updating.diagnosis.evidence.fits.fit", singular)
    assert search.fits.shortly(problem, (), [Start((), nothing.fitted)]) == []
