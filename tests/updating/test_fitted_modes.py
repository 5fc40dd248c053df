"""Damping of a fitted model's modes: members' and connections' curves and what dampers take."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.linalg as sla

from dovetail import result
from dovetail.report import mode_heading
from fem import Damping, Joint, assemble
from fem.effects import JointStiffness
from fem.system import connection_stiffness
from tests.frames import cross_beam
from updating import DampingCurve
from updating.diagnosis import FittedModePair, damped_modes, most_changed

CURVE = DampingCurve(np.array([40.0, 1200.0]), np.array([0.003, 0.003]), 0.5, connections=True)


def soft(factor):
    """Return the cross-beam without loss and with its joint a ``factor`` as stiff about y."""
    effect = JointStiffness(name="c", joints=("bolt",), direction="ry", stiffness=factor * 3e3, assumed=3e3)
    return cross_beam(0.1, eta=0.0).with_damping(Damping()).with_effect(effect)


@pytest.mark.parametrize("factor", [0.05, 1.0, 20.0])
@pytest.mark.parametrize("ratio", [0.2, 1.0, 4.0])
def test_damping_of_modes_is_that_of_complex_eigenvalues(factor, ratio):
    model = soft(factor)
    modes = damped_modes(model, CURVE, np.array([0.003, 0.003, ratio, 1.0]), 1500.0)
    # λ of K + 2i (ζ_m K + (ζ_c - ζ_m) K_c), where all of the joint's stiffness has the ratio ζ_c
    other = model.effect("bolt")
    assert isinstance(other, Joint)
    system = assemble(model)
    lossy = assemble(model.without_effect("bolt").with_effect(replace(other, eta=1.0)))
    K = system.K.toarray() * (1 + 0.006j) + 2j * 0.003 * (ratio - 1) * lossy.D.toarray()
    lam = np.sort_complex(sla.eigvals(K, system.M.toarray()))
    lam = lam[modes.n_rigid : modes.n_modes]
    elastic = slice(modes.n_rigid, None)
    np.testing.assert_allclose(modes.zeta[elastic], lam.imag / lam.real / 2, rtol=1e-3)
    assert (modes.zeta[elastic] > 0).all()


def test_the_stiffness_of_connections_is_that_which_is_left_without_members():
    model = soft(0.1)
    system = assemble(model)
    alone = assemble(model.without_effect("bolt", "c"))
    difference = system.K - alone.K
    np.testing.assert_allclose(
        connection_stiffness(system).toarray(), difference.toarray(), atol=1e-9 * abs(system.K).max()
    )


def test_a_curve_without_connections_is_the_members_row_of_one_with_them():
    f = np.geomspace(20.0, 3000.0, 40)
    alike = replace(CURVE, connections=False)
    unknowns = np.array([0.002, 0.008, 0.5, np.exp(-0.4)])
    members, own = CURVE.ratio(f, unknowns)
    np.testing.assert_allclose(members, alike.ratio(f, unknowns[:2]))
    middle = np.sqrt(40.0 * 1200.0)
    np.testing.assert_allclose(own, 0.5 * 0.004 * (f / middle) ** -0.4)
    np.testing.assert_array_equal(CURVE.start, [0.003, 0.003, 1, 1])
    assert CURVE.limits.shape == (4, 2)
    assert (CURVE.limits[:, 0] < np.log(CURVE.start)).all()
    assert (np.log(CURVE.start) < CURVE.limits[:, 1]).all()


def test_the_result_tells_the_damping_of_connections_where_there_are_any():
    unknowns = np.array([0.002, 0.008, 0.5, np.exp(-0.4)])
    told = result._damping(CURVE, unknowns)
    np.testing.assert_allclose(told["ratio"], [0.002, 0.008])
    middle = np.sqrt(40.0 * 1200.0)
    np.testing.assert_allclose(told["connections_ratio"], 0.5 * 0.004 * (CURVE.knots / middle) ** -0.4)
    assert "connections_ratio" not in result._damping(replace(CURVE, connections=False), unknowns[:2])

    fit = SimpleNamespace(values={}, std={}, zeta=unknowns, covariance=np.diag([0.01, 0.01, 0.04, 0.09]))
    problem = SimpleNamespace(nuisance_unknowns=(), damping=CURVE, reduced=SimpleNamespace(model=None))
    problem.test_of, problem.data = (lambda fit: None), SimpleNamespace(has_damping=True)

    def rows(model):
        d = SimpleNamespace(calibration=(problem, fit, model))
        return result.uncertain_parameters(d)  # type: ignore[arg-type]

    *knots, level, power = rows(soft(1.0))
    assert [k.name for k in knots] == ["damping ratio at 40 Hz", "damping ratio at 1200 Hz"]
    assert (level.name, power.name) == (result.CONNECTIONS_LEVEL, result.CONNECTIONS_POWER)
    half = 0.5 * (np.exp(0.2) - np.exp(-0.2)) / 2  # of the interval's width
    assert (level.nominal, level.fitted, level.std) == pytest.approx((1.0, 0.5, half))
    assert (power.nominal, power.fitted, power.std) == pytest.approx((0.0, -0.4, 0.3))
    assert len(rows(cross_beam().without_effect("bolt"))) == 2


def test_a_mode_that_grows_is_none_that_changed_most():
    def pair(k, nominal, fitted):
        return FittedModePair(k, k, nominal, fitted, 0.01, 0.01, 0.99)

    assert most_changed((pair(0, 23.0, -16.0), pair(1, 40.0, 41.0), pair(2, 60.0, 60.1))).index == 1
    assert mode_heading(7, 6, -16.0, 0.0) == "Elastic mode 2: -16 Hz, a motion that grows"
    assert mode_heading(7, 6, 16.0, 0.01) == "Elastic mode 2: 16 Hz, damping 1 %"
