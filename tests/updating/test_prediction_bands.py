"""What the deviations of all that was fitted allow of the FRFs, and how it and the error are drawn."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.hidden.cases import make_case
from updating import assessed_fit, build_problem, propose
from updating.inference import FULL_LINES, ROBUST
from updating.least_squares import pseudo_huber
from viz import draw, error_curves, frf_errors, plot_frf

STEP = 2e-5


@pytest.fixture(scope="module")
def fitted():
    case = make_case(5)
    problem = build_problem(case.model, case.measurement, case.nuisances)
    return problem, assessed_fit(problem)


def test_bands_are_the_covariance_by_central_differences(fitted):
    """Over h = 2e-5 of ln θ they miss by (h/ζ)²/6, 5e-6, and by rounding: 1e-11 at antiresonances over h,
    times deviations of up to 0.4.
    """
    problem, fit = fitted
    lines = np.arange(0, len(problem.data.frequency), 17)
    variables = problem.function((), (), lines).variables
    columns = []
    for v in variables:
        x = v.to_x(fit.values[v.ref])
        both = [replace(fit, values={**fit.values, v.ref: v.to_value(x + s)}) for s in (STEP, -STEP)]
        columns.append(both)
    for k in range(len(fit.zeta)):
        turn = np.exp(STEP * np.eye(len(fit.zeta))[k])
        columns.append([replace(fit, zeta=fit.zeta * turn), replace(fit, zeta=fit.zeta / turn)])
    size = [[np.log(np.abs(problem.receptance(r, lines))) for r in both] for both in columns]
    J = np.array([(ahead - behind) / (2 * STEP) for ahead, behind in size])
    expected = np.sqrt(np.einsum("ifop,ij,jfop->fop", J, fit.covariance, J))
    found = problem.deviation(fit, lines)
    assert found is not None
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=3e-7)
    assert problem.deviation(problem.nominal()) is None


def test_bands_do_not_depend_on_where_a_fit_began(fitted):
    """Its starts set the unit of a parameter that may be negative; the iterations end 0.5 % of σ² apart."""
    problem, _ = fitted
    effect = next(e for e in propose(problem.reduced.model, ["member_density"]) if e.where == "member B")
    p = effect.parameters()[0]
    near, far = (assessed_fit(problem, [effect], [{p.name: start}]) for start in (0.3, 0.01))
    ref = (effect.name, p.name)
    assert near.values[ref] == pytest.approx(far.values[ref], abs=0.1 * near.std[ref])
    for fit in (near, far):
        k = list(fit.values).index(ref)
        assert np.sqrt(fit.covariance[k, k]) == pytest.approx(fit.std[ref], rel=1e-9)
    lines = np.arange(0, len(problem.data.frequency), 17)
    np.testing.assert_allclose(problem.deviation(near, lines), problem.deviation(far, lines), rtol=0.05)


def test_deviations_are_those_of_the_posterior(fitted):
    """One standard deviation along any direction of the covariance raises the cost by a half."""
    problem, fit = fitted
    function = problem.function((), (), problem.lines_up_to(np.inf, problem.n_lines))
    levels, prior = function.levels(counted_as=FULL_LINES), function.prior()

    def cost(x):
        misfit = function.mean_by_group(pseudo_huber(function(x, False)[0], ROBUST))
        return levels.cost(misfit) + 0.5 * (((x - prior.mean) / prior.std) ** 2).sum()

    x, C = fit.solution.x, fit.solution.covariance
    size, directions = np.linalg.eigh(C)
    for s, d in zip(np.sqrt(size), directions.T, strict=True):
        rise = (cost(x + s * d) + cost(x - s * d)) / 2 - cost(x)
        assert rise == pytest.approx(0.5, rel=0.1)


def test_bands_are_drawn_also_where_next_to_nothing_is_known(fitted):
    """±1.96 σ in the logarithm; a σ of a thousand nepers has no number, and is drawn beyond the axes."""
    problem, fit = fitted
    model, pair = problem.frf(fit), (problem.measured.outputs[0], problem.measured.inputs[0])
    sigma = np.full(model.H.shape, 0.1)
    sigma[-1] = 1e3
    figure = plot_frf(problem.measured, {"fitted": model}, [pair], deviations={"fitted": sigma})
    top = figure.axes[0]
    (band,) = (c for c in top.collections if c.get_label() == "fitted, 95 %")
    y = band.get_paths()[0].vertices[:, 1]
    size = np.abs(model.select([pair[0]], [pair[1]]).H[0, 0, 0])
    assert np.isfinite(y).all()
    for expected in (size * np.exp(0.196), size * np.exp(-0.196)):
        assert np.abs(y / expected - 1).min() < 1e-12
    assert top.get_ylim()[1] < 1e4 * np.abs(problem.measured.H).max()


def test_an_error_has_no_curve_where_nothing_was_measured(fitted):
    problem, fit = fitted
    H = np.array(problem.measured.H)
    H[:40] = 0.0
    measured, model = replace(problem.measured, H=H), problem.frf(fit)
    errors, floor = frf_errors(measured, {"fitted": model}, floor=0.01 * np.abs(H))
    figure = draw(error_curves(measured.frequency, errors, floor=floor))
    (curve,) = (c for c in figure.axes[0].lines if c.get_label() == "fitted")
    y = np.asarray(curve.get_ydata())
    assert np.isnan(y[:40]).all()
    off, size = (np.sum(np.abs(x[40:]) ** 2, axis=(1, 2)) for x in (model.H - H, H))
    np.testing.assert_allclose(y[40:], 10 * np.log10(off / size), rtol=1e-9)
