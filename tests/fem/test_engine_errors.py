"""The reduced engine with what something else holds, and with errors of modes."""

import numpy as np
import pytest

from fem.analysis.frf_solver import compute_frf
from fem.analysis.selection import dof_vectors
from fem.effects import (
    JointStiffness,
    SupportFlexibility,
)
from fem.reduction.local_changes import LocalChanges
from fem.reduction.modal_responses import ModalResponses
from fem.reduction.modal_solution import ModeErrors
from fem.reduction.parametric_frf import ParametricFRF
from fem.reduction.reduced_model import reduce_model, values_of
from fem.system import assemble
from tests.fem.test_engine import ACCURACY, FREQUENCY, attachments, direct, engine, misfit
from tests.frames import cross_beam, fix, portal


def test_releasing_what_something_else_holds_changes_nothing():
    model = portal(0.2).with_effect(fix(0, ("ry", "z"), name="also"))
    effect = SupportFlexibility(name="c", supports=("foot0",), direction="ry", stiffness=1e3)
    e = engine(model, [("c", "stiffness")], [effect])
    H, _, _ = e.evaluate(np.array([1e3]), np.zeros(FREQUENCY.size), gradient=False)
    assert misfit(H, direct(model)) < ACCURACY
    assert misfit(direct(model.with_effect(effect)), direct(model)) < 1e-9


@pytest.mark.parametrize("kind", ["support", "joint"])
def test_a_violated_constraint_is_what_a_small_compliance_adds(kind):
    """With compliance c in a constraint H grows by c v vᵀ, v the responses to a unit violation."""
    model = portal()
    if kind == "support":
        effect = SupportFlexibility(name="c", supports=("foot0",), direction="ry", stiffness=1e6)
    else:
        effect = JointStiffness(name="c", joints=("corner0",), direction="ry", stiffness=1e6, assumed=np.inf)
    places = [(1, "x"), (4, "ry"), (5, "x"), (8, "x")]
    out, _ = dof_vectors(model, places)
    reduced = reduce_model(model, np.hstack([attachments(model), out]), FREQUENCY[-1], n_krylov=2)
    e = ParametricFRF(reduced, out, out, FREQUENCY, [])
    keys, v = LocalChanges.of(e, np.zeros(0), np.zeros(FREQUENCY.size)).violations()
    assert v.shape == (len(keys), len(places), len(FREQUENCY))
    (row,) = (keys.index(key) for key in effect.released())

    def compliant(stiffness):
        system = assemble(model.with_effect(effect.with_values(stiffness=stiffness)))
        return compute_frf(system, FREQUENCY, places, places, kind="receptance", method="direct").H

    rigid = compute_frf(assemble(model), FREQUENCY, places, places, kind="receptance", method="direct").H
    loss = 1 + 1j * model.damping.loss_factor  # which the spring has as well
    near, far = (k * loss * (compliant(k) - rigid) for k in (1e7, 5e6))
    product = np.einsum("of,if->foi", v[row], v[row])
    # A compliance c adds v vᵀ c / (1 + g c). The steps err by g c and 2 g c, so that they differ by g c, and
    # Richardson's rule leaves 2 (g c)².
    size = abs(near).max(axis=0)
    second, error = abs(near - far).max(axis=0) / size, abs(product - (2 * near - far)).max(axis=0) / size
    assert second.max() < 0.02
    assert (error <= 2 * second**2 + ACCURACY).all()


@pytest.mark.parametrize("damper", [None, 0.3])
def test_derivatives_by_errors_of_modes_against_finite_differences(damper):
    C = None if damper is None else np.diag([0.0, 0, 0, damper, damper, 0])
    model = cross_beam(0.1, C=C)
    refs = [("frame", "E:steel"), ("bolt", "kry")]
    e = engine(model, refs)
    x, zeta = values_of(model, refs), np.full(FREQUENCY.size, 0.01)
    g = np.random.default_rng(5)
    n, first = 4, e.reduced.basis.n_rigid
    delta, kappa = 0.02 * g.standard_normal(n), 0.3 * g.standard_normal(n)

    def at(delta, kappa, zeta=zeta):
        return ModalResponses.of(e, x, zeta, ModeErrors(first, delta, kappa))

    by_delta, by_kappa = at(delta, kappa).error_slopes()
    for k in range(n):
        for gradient, function in (
            (by_delta[k], lambda s, k=k: at(delta + s * np.eye(n)[k], kappa).H),
            (by_kappa[k], lambda s, k=k: at(delta, kappa + s * np.eye(n)[k]).H),
        ):
            near, far = ((function(s) - function(-s)) / (2 * s) for s in (1e-4, 2e-4))
            bound = abs(far - near).max() + 1e-10 * abs(function(0.0)).max() / 1e-4
            assert abs(gradient - near).max() <= bound
            assert bound < 0.01 * abs(gradient).max()
    _, by_zeta = at(delta, kappa).slopes()
    near, far = (
        (at(delta, kappa, zeta + s).H - at(delta, kappa, zeta - s).H) / (2 * s) for s in (1e-5, 2e-5)
    )
    bound = abs(far - near).max() + 1e-10 * abs(at(delta, kappa).H).max() / 1e-5
    assert abs(by_zeta - near).max() <= bound < 0.01 * abs(by_zeta).max()


def test_without_errors_of_modes_nothing_changes():
    model = cross_beam(0.1)
    refs = [("frame", "E:steel"), ("bolt", "kry")]
    e = engine(model, refs)
    x, zeta = values_of(model, refs), np.full(FREQUENCY.size, 0.01)
    H, dH, dzeta = e.evaluate(x, zeta)
    found = ModalResponses.of(e, x, zeta, ModeErrors(e.reduced.basis.n_rigid, np.zeros(3), np.zeros(3)))
    by_x, by_zeta = found.slopes()
    np.testing.assert_allclose(found.H, H, rtol=1e-12, atol=1e-12 * abs(H).max())
    np.testing.assert_allclose(by_x, dH, rtol=1e-9, atol=1e-9 * abs(dH).max())
    np.testing.assert_allclose(by_zeta, dzeta, rtol=1e-9, atol=1e-9 * abs(dzeta).max())
