"""What a fit begins with: the damping of members and connections, stages, the basis, and errors."""

from dataclasses import replace

import numpy as np

import fem
from benchmarks.hidden.cases import make_case
from benchmarks.validation.cases import CaseSettings, draw_case
from fem import ConnectionDamping
from updating import assessed_fit, build_problem, propose
from updating.forecast import Grid
from updating.inference import preparation


def test_joints_that_are_damped_otherwise_than_members_leave_no_more_than_noise():
    case = draw_case(CaseSettings(911), "null", 1)  # members 0.3 to 2.5 % over the band, the joint 0.4 %
    alike = build_problem(case.model, case.measurement, case.nuisances)
    assert assessed_fit(alike).level > 2 * alike.data.noise_level
    problem = build_problem(case.model, case.measurement, case.nuisances, connections=True)
    fit = assessed_fit(problem)
    assert fit.level < 1.2 * problem.data.noise_level
    _, joint = problem.damping.ratio(problem.damping.knots, fit.zeta)
    np.testing.assert_allclose(np.exp(np.log(joint).mean()), 0.004, rtol=0.15)


def test_a_joint_that_damps_many_times_more_is_not_let_off():
    case = draw_case(CaseSettings(1409), "single", 40)  # a loss factor of 0.116, members' ratio 0.4 to 1.4 %
    problem = build_problem(case.model, case.measurement, case.nuisances, connections=True)
    fit = assessed_fit(problem)
    assert fit.level > 1.2 * problem.data.noise_level
    right = next(e for e in propose(case.model, ["joint_structural_damping"]))
    start = [Grid.of(problem, right).points[0]]
    assert assessed_fit(problem, [right], start).level < 0.85 * fit.level


def test_the_error_of_the_basis_is_small_where_connections_are_damped_otherwise():
    case = make_case(0, "cross", "nothing")
    problem = build_problem(case.model, case.measurement, case.nuisances, connections=True)
    nominal = problem.nominal()
    fit = replace(nominal, zeta=np.concatenate([nominal.zeta[:-2], [20.0, 1.0]]))
    changed = np.abs(problem.receptance(fit) / problem.receptance(nominal))
    assert np.abs(20 * np.log10(changed)).max() > 1.0  # the joint's damping is seen
    assert preparation.basis_error(problem, fit, 30) < 0.01
    assert (
        preparation.basis_error(problem, fit, 30) < 2 * preparation.basis_error(problem, nominal, 30) + 1e-3
    )


def test_the_damping_curve_has_a_knot_for_every_two_modes():
    case = draw_case(CaseSettings(911), "null", 3)  # nine modes
    problem = build_problem(case.model, case.measurement, case.nuisances)
    assert (problem.n_modes, len(problem.damping.knots)) == (9, 4)


def test_damping_that_is_a_power_of_frequency_leaves_no_logarithm_of_zero():
    """Fitted studies have such damping: without modal ratios, that of connections gave a warning."""
    case = make_case(0, "cross", "nothing")
    ratios = fem.Damping.modal([0.01, 0.02], [10.0, 100.0], powers=True)
    more = ConnectionDamping(frequency=np.array([10.0, 100.0]), ratio=np.array([0.03, 0.05]))
    model = case.model.with_damping(ratios).with_effect(more)
    assert build_problem(model, case.measurement, ()).data.mask.any()
    assert not ratios.without_modal().ratio_at([1.0, 50.0]).any()
