"""Effects of joints, each against a closed form."""

from dataclasses import replace

import numpy as np

from fem import FractionalKelvinVoigt, Joint, Model, Viscoelastic, Zener, assemble, compute_frf, solve_modes
from fem.effects import JointCoupling, JointFractional, JointOffset, JointZener
from tests.fem.test_effects_library import sums
from tests.frames import FLAT, cross_beam, portal
from updating import propose

# -------------------------------------------------------------------------------------------------- joints


def test_a_moved_joint_is_a_joint_elsewhere():
    model = cross_beam(0.2, C=np.diag([1.0, 2, 3, 4, 5, 6]))
    (joint,) = model.of_kind(Joint)
    turned = replace(
        joint, axes=np.array([[0.6, 0.8, 0], [-0.8, 0.6, 0], [0, 0, 1]]), M=np.diag([1, 1, 1, 0.1, 0.2, 0.3])
    )
    model = Model(model.mesh, (model.effects[0], turned))
    for d, row in zip("xyz", turned.axes, strict=True):
        effect = JointOffset(name="o", joint="bolt", direction=d, offset=0.03, reach=0.01)
        moved = replace(turned, location=turned.location + 0.03 * row)
        for X, a, b in zip(sums(model, effect), sums(model, turned), sums(model, moved), strict=True):
            assert abs(X - (b - a)).max() <= 1e-12 * max(abs(b).max(), 1e-300)


def test_a_joint_is_looked_for_many_sections_away():
    """A slender member's joint that sits a seventh of the member's length off is six sections away."""
    model = cross_beam(0.2)
    section = float(np.sqrt(FLAT.A))
    effects = propose(model, ["joint_offset"])
    assert len(effects) == 3
    for effect in effects:
        (offset,) = effect.parameters()
        assert -offset.lower == offset.upper >= 8 * section
        assert {np.sign(start["offset"]) for start in effect.starts(lambda ref: 1.0)} == {-1, 1}


def test_a_coupled_joint_stays_positive_within_its_bounds_and_not_far_beyond():
    base = cross_beam(0.2)
    (joint,) = base.of_kind(Joint)
    K = joint.K.copy()
    K[0, 4] = K[4, 0] = 0.5 * np.sqrt(K[0, 0] * K[4, 4])
    model = Model(base.mesh, (base.effects[0], replace(joint, K=K)))
    effects = list(JointCoupling.propose(model))
    assert len(effects) == 15  # pairs of the six directions
    for effect in effects:
        for bound in effect.bounds:
            for factor, positive in ((1.0, True), (1.06, False)):
                whole = sums(model, model.effects[1], effect.with_values(coupling=factor * bound))[0]
                values = np.linalg.eigvalsh(whole[np.ix_(range(6, 12), range(6, 12))])
                assert (values.min() > 0) == positive, effect.name


def test_viscoelastic_joints_are_viscoelastic_elements():
    model = cross_beam(0.2)
    (joint,) = model.of_kind(Joint)
    frequency = np.array([10.0, 80.0, 300.0])
    tau = 1 / (2 * np.pi * 100)
    pairs = (
        (
            JointZener(name="e", joint="bolt", direction="rx", assumed=3e3, ratio=2.0, tau=1e-3),
            Zener(2.0, 1e-3),
        ),
        (
            JointFractional(name="e", joint="bolt", direction="rx", assumed=3e3, strength=0.7, exponent=0.4),
            FractionalKelvinVoigt(tau * 0.7 ** (1 / 0.4), 0.4),
        ),
    )
    for effect, law in pairs:
        element = Viscoelastic(
            name="v",
            point1=joint.point1,
            point2=joint.point2,
            location=joint.location,
            K=np.diag([0, 0, 0, 3e3, 0, 0]),
            law=law,
        )
        bare = replace(joint, K=np.diag([*np.diag(joint.K)[:3], 0, *np.diag(joint.K)[4:]]), eta=0.0)
        whole = replace(joint, eta=0.0)
        others = (model.effects[0],)
        rows = [(2, "z"), (5, "rx")]
        H = [
            compute_frf(assemble(Model(model.mesh, (*others, *e))), frequency, rows, rows, method="direct").H
            for e in ((whole, effect), (bare, element))
        ]
        np.testing.assert_allclose(H[0], H[1], rtol=1e-9)


def test_a_rigid_joint_may_become_viscoelastic():
    model = portal(0.2)
    (effect,) = (e for e in JointZener.propose(model) if e.name == "joint_zener:corner0.ry")
    assert [p.name for p in effect.parameters()] == ["stiffness", "ratio", "tau"]
    assert effect.released() == (("corner0", "ry"),)
    soft = model.with_effect(effect.with_values(stiffness=5e3, ratio=2.0, tau=1e-3))
    assert solve_modes(assemble(soft), n=1).frequency[0] < solve_modes(assemble(model), n=1).frequency[0]
