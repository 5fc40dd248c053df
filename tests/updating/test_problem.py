"""What the fits and the search ask of any kind of data, answered by each."""

from dataclasses import replace

import numpy as np
import pytest

from dovetail import load_study
from dovetail.pipeline import fit_problem
from fem import assemble, first_modes
from tests.frames import write_study
from updating import ModeTargets, build_mode_problem
from updating.diagnosis.amplitude import at_force_levels
from updating.inference.fit import FitProblem, as_of_one
from updating.inference.fitting import far_fit, fit, with_form_of_damping
from updating.inference.problem import Problem

KINDS = ("FRFs", "force levels", "modes", "FRFs and modes")


@pytest.fixture(scope="module")
def problems(tmp_path_factory):
    study = load_study(write_study(tmp_path_factory.mktemp("problem"), 0.0))
    frfs = fit_problem(study)
    found = first_modes(assemble(study.model), 5)
    f = found.frequency[found.n_rigid :][:5]
    modes = ModeTargets.of(1.002 * f, 1e-3, zeta=np.full(5, 0.01))
    by_modes = build_mode_problem(study.model, modes, study.nuisances)
    levels = at_force_levels(frfs, (frfs.data, frfs.data))
    return dict(zip(KINDS, (frfs, levels, by_modes, replace(frfs, modes=modes)), strict=True))


@pytest.fixture(params=KINDS)
def problem(request, problems) -> Problem:
    return problems[request.param]


def test_the_last_stage_has_the_residuals_of_all_data_in_the_band(problem):
    whole, last = problem.residuals(n_lines=20), problem.residuals(stage=problem.stages[-1], n_lines=20)
    np.testing.assert_array_equal(whole(whole.start, False)[0], last(last.start, False)[0])


def test_each_group_of_residuals_has_its_noise_and_is_of_modes_or_not(problem):
    function = problem.residuals(n_lines=20)
    groups = np.unique(function.groups)
    shapes = {x.shape for x in (groups, function.noise(), function.allowed_squares(), function.of_modes)}
    assert shapes == {groups.shape}
    usual, allowed = (function.allowed_squares(usual=each) for each in (True, False))
    of_modes = function.of_modes
    np.testing.assert_array_equal(usual[of_modes], allowed[of_modes])
    assert (usual[~of_modes] < allowed[~of_modes]).all()
    assert function.of_modes.any() == (problem.measured_modes is not None)
    assert len(function.groups) == len(function(function.start, False)[0])


def test_measured_modes_have_partners_and_other_data_have_none(problem):
    modes = problem.computed_modes(problem.nominal())
    assert (modes is None) == (problem.measured_modes is None)
    if modes is not None:
        assert modes.frequency == pytest.approx(problem.measured_modes.frequency, rel=0.01)


def test_a_fit_of_the_nominal_model_is_drawn_again_by_the_number_of_its_seed(problem):
    fitted = fit(problem, n_lines=20)
    one, same, other = (problem.resampled(fitted, {}, np.random.default_rng(k)) for k in (1, 1, 2))
    of = [p.residuals(n_lines=20) for p in (one, same, other)]
    r, again, different = (function(function.start, False)[0] for function in of)
    np.testing.assert_array_equal(r, again)
    assert not np.allclose(r, different)


def test_only_linear_frfs_have_values_at_complex_frequencies(problems):
    assert {kind for kind, p in problems.items() if p.damped_frfs() is not None} == {"FRFs", "FRFs and modes"}
    assert far_fit(problems["modes"]) is None
    assert far_fit(problems["force levels"]) is None


def test_modes_have_one_form_of_damping(problems):
    by_modes = problems["modes"]
    fitted = fit(by_modes)
    assert with_form_of_damping(by_modes, fitted) == (by_modes, fitted)
    assert by_modes.with_seen_noise(fitted) is by_modes
    assert by_modes.test_of(fitted) is None


def test_only_fits_of_frfs_bend_uncertain_parameters(problems):
    frfs, by_modes = problems["FRFs"], problems["modes"]
    values = {ref: 1.5 * v for ref, v in frfs.nominal().values.items()}
    assert frfs.strain(replace(frfs.nominal(), values=values)) > 5
    assert frfs.far_start(replace(frfs.nominal(), values=values)).values == frfs.nominal().values
    assert by_modes.strain(replace(by_modes.nominal(), values=values)) == 0
    assert by_modes.far_start(by_modes.nominal()) is None


def test_the_largest_of_many_deviations_is_judged_by_their_number(problems):
    assert as_of_one(2.5, 1) == pytest.approx(2.5)
    # P(|z| > 3.37) = 7.5e-4, of 119 values 8.6 %, which of one alone is beyond 1.72
    assert as_of_one(3.37, 119) == pytest.approx(1.72, abs=0.01)
    assert as_of_one(0.0, 0) == 0
    frfs = problems["FRFs"]
    bent = replace(frfs.nominal(), values={ref: 1.05 * v for ref, v in frfs.nominal().values.items()})
    assert 0 < frfs.strain_of_one(bent) < frfs.strain(bent)


def test_a_copy_of_any_problem_keeps_what_makes_it_its_kind(problem):
    copy = replace(problem, mesh_level=0.01)
    assert type(copy) is type(problem)
    assert (copy.damped_frfs() is None) == (problem.damped_frfs() is None)
    assert copy.residuals(n_lines=20).start == pytest.approx(problem.residuals(n_lines=20).start)


def test_the_error_is_in_words_in_the_unit_of_the_report(problem):
    nominal = problem.nominal()
    if isinstance(problem, FitProblem):
        assert problem.error_words(nominal) == f"error {nominal.fit_db:.2f} dB"
    else:
        assert problem.error_words(nominal).endswith(" %")
