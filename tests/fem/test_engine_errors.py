"""The reduced engine with what something else holds, and with small deviations."""

import numpy as np
import pytest
from scipy.linalg import eigh

from fem import Contribution, assemble, compute_frf, dof_vectors
from fem.effects import (
    JointStiffness,
    SupportFlexibility,
)
from fem.effects.places import frame_of
from fem.elements.frame import member_contribution
from fem.reduction import LocalChanges, ParametricFRF, reduce_model, values_of
from fem.reduction.deviations import DeviatingFRF, Deviations
from tests.fem.test_engine import ACCURACY, FREQUENCY, IN, OUT, attachments, direct, engine, misfit
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


def deviating(model, refs):
    """Return an engine with deviations of each kind, and their number that shift frequencies."""
    reduced = reduce_model(model, attachments(model), FREQUENCY[-1], n_krylov=2)
    lam, V = eigh(reduced.base_sum["K"], reduced.base_sum["M"])
    some = slice(reduced.basis.n_rigid, reduced.basis.n_rigid + 6)
    system, shapes = reduced.system, reduced.basis.T @ V[:, some]
    forces = system.Q @ (system.M @ (system.Q.T @ shapes)) * np.sqrt(lam[some])
    members = [tuple(member_contribution(frame_of(model), model, m)) for m in model.mesh.members]
    elements = tuple(tuple(Contribution(c.dofs, D=c.K) for c in parts) for parts in members)
    out, inn = dof_vectors(model, OUT)[0], dof_vectors(model, IN)[0]
    # Sums of modes, so that none stays alone.
    mix = np.random.default_rng(5).standard_normal((6, 6)) / 2
    deviations = Deviations(forces @ mix[:, :3], forces @ mix[:, 3:], elements)
    return DeviatingFRF(deviations, reduced, out, inn, FREQUENCY, refs), 3


@pytest.mark.parametrize("damper", [None, 0.3])
def test_deviations_are_matrices_that_are_added(damper):
    """Shifts are exact. Losses are so within the square of what they change."""
    C = None if damper is None else np.diag([0.0, 0, 0, damper, damper, 0])
    model, refs = cross_beam(0.1, C=C), [("frame", "E:steel"), ("bolt", "kry")]
    e, n_stiff = deviating(model, refs)
    zeta, n_losses = np.full(FREQUENCY.size, 0.01), len(e.refs) - len(refs) - n_stiff
    size = 0.02 * np.random.default_rng(8).standard_normal(n_stiff + n_losses)
    size[n_stiff:] *= 0.1
    values = np.concatenate([values_of(model, refs), size])
    total, _ = e.matrices(values)
    plain, _ = engine(model, refs).matrices(values[: len(refs)])
    assert np.abs(total["K"] - plain["K"]).max() > 0

    def response(share):
        at = np.concatenate([values[: len(refs) + n_stiff], share * size[n_stiff:]])
        loss = e.losses(at) if share else 0.0
        out = []
        for w, z in zip(e.omega, zeta, strict=True):
            K = (1 + 1j * (model.damping.loss_factor + 2 * z)) * total["K"]
            Z = K + 1j * (w * total["C"] + total["D"] + loss) - w**2 * total["M"]
            out.append(e.outputs.T @ np.linalg.solve(Z, e.inputs))
        return np.stack(out), e.evaluate(at, zeta, gradient=False)[0]

    errors = []
    for share in (0.0, 0.5, 1.0):
        exact, found = response(share)
        errors.append(abs(found - exact).max() / abs(exact).max())
    assert errors[0] < 1e-9
    assert errors[1] < 0.3 * errors[2] + 1e-9
    assert errors[2] < 0.05


def test_derivatives_by_deviations_against_finite_differences():
    model, refs = cross_beam(0.1), [("frame", "E:steel"), ("bolt", "kry")]
    e, _ = deviating(model, refs)
    zeta, n = np.full(FREQUENCY.size, 0.01), len(refs)
    values = np.concatenate([values_of(model, refs), np.zeros(len(e.refs) - n)])
    _, dH, _ = e.evaluate(values, zeta)
    steps = (-2e-4, -1e-4, 1e-4, 2e-4)
    for k in range(n, len(values)):
        H = {s: e.evaluate(values + s * (np.arange(len(values)) == k), zeta, False)[0] for s in steps}
        near, far = ((H[s] - H[-s]) / (2 * s) for s in (1e-4, 2e-4))
        bound = abs(far - near).max() + 1e-6 * abs(near).max()
        assert abs(dH[k] - near).max() <= bound < 0.01 * abs(near).max()


def test_derivatives_of_the_transpose_are_the_transpose():
    """Changes of the matrices are multiplied by the side with fewer columns, one way or the other."""
    model, refs = cross_beam(0.1), [("frame", "E:steel"), ("bolt", "kry")]
    e, _ = deviating(model, refs)
    values = np.concatenate([values_of(model, refs), np.zeros(len(e.refs) - len(refs))])
    few, many, zeta, slopes = e.inputs[:, :1], e.outputs, np.full(FREQUENCY.size, 0.01), []
    for e.outputs, e.inputs in ((many, few), (few, many)):
        e._last = None
        slopes.append(e.evaluate(values, zeta)[1])
    turned = np.swapaxes(slopes[1], 2, 3)
    np.testing.assert_allclose(turned, slopes[0], rtol=1e-4, atol=1e-5 * abs(turned).max())


def test_without_deviations_nothing_changes():
    model, refs = cross_beam(0.1), [("frame", "E:steel"), ("bolt", "kry")]
    e, _ = deviating(model, refs)
    x, zeta = values_of(model, refs), np.full(FREQUENCY.size, 0.01)
    H, dH, by_zeta = engine(model, refs).evaluate(x, zeta)
    found, slopes, by_its_zeta = e.evaluate(np.append(x, np.zeros(len(e.refs) - len(refs))), zeta)
    np.testing.assert_allclose(found, H, rtol=1e-12, atol=1e-12 * abs(H).max())
    # in single precision, 6e-8, with sums over some hundred coordinates
    np.testing.assert_allclose(slopes[: len(refs)], dH, rtol=1e-5, atol=1e-5 * abs(dH).max())
    np.testing.assert_allclose(by_its_zeta, by_zeta, rtol=1e-5, atol=1e-5 * abs(by_zeta).max())
