"""Base motion against closed forms: one and two masses, a cantilever, a large mass."""

import numpy as np
import pytest

from fem import (
    AddedMass,
    Damping,
    FRFError,
    Joint,
    Material,
    ModelError,
    Viscoelastic,
    Zener,
    assemble,
    compute_base_frf,
    compute_frf,
    lever_matrix,
)
from fem.effects import Plane
from tests.frames import FLAT, STEEL, beam, fix, mounted, planar, portal

LIGHT = Material("light", 1e10, 1e-6)
K, M = 4e4, 2.5
F = np.array([0.0, 5.0, 19.0, 20.1317, 22.0, 60.0])
W = 2 * np.pi * F


def mass_on(*elements, damping=None):
    held = fix(0, ("x", "y", "rx", "ry", "rz"))
    model = beam(1, 0.1, effects=(*elements, AddedMass(name="m", point=0, mass=M), held), material=LIGHT)
    return model if damping is None else model.with_damping(damping)


def spring(name="spring", k=K, c=0.0, eta=0.0):
    up = np.diag([0, 0, 1.0, 0, 0, 0])
    return Joint(name=name, point1=0, location=np.zeros(3), K=k * up, C=c * up, eta=eta)


RUBBER = Viscoelastic(
    name="rubber", point1=0, location=np.zeros(3), K=np.diag([0, 0, K, 0, 0, 0.0]), law=Zener(2.0, 3e-3)
)
LAW = (lambda storage, loss: storage + 1j * loss)(*Zener(2.0, 3e-3)(W))
CASES = {  # name: model, what ties the mass to the base
    "dashpot": (mass_on(spring(c=7.0)), K + 7j * W),
    "loss factor": (mass_on(spring(eta=0.05)), K * (1 + 0.05j) + 0 * W),
    "structural": (mass_on(spring(), damping=Damping.structural(0.03)), K * (1 + 0.03j) + 0 * W),
    "beta": (mass_on(spring(), damping=Damping.rayleigh(0, 1e-4)), K * (1 + 1e-4j * W)),
    "alpha": (mass_on(spring(), damping=Damping.rayleigh(6.0, 0)), K + 6j * W * M),
    "modal": (mass_on(spring(), damping=Damping.modal(0.02)), K + 2j * 0.02 * np.sqrt(K * M) * W),
    "law": (mass_on(RUBBER), K * LAW),
}


@pytest.mark.parametrize(
    ("name", "method"),
    [(name, m) for name in CASES for m in ("reduced", "direct") if (name, m) != ("modal", "direct")],
)
def test_one_mass_with_every_damping(name, method):
    model, tie = CASES[name]
    args = (assemble(model), F, [(0, "z")], ["z"])
    T = compute_base_frf(*args, method=method)
    assert T.inputs == ("base Z+",)
    assert T.outputs == ("0Z+",)
    # the light line has 3e-13 of the mass; at resonance 1/(2ζ) times that
    np.testing.assert_allclose(T.H[:, 0, 0], tie / (tie - W**2 * M), rtol=1e-8)
    between = compute_base_frf(*args, method=method, relative=True)
    np.testing.assert_allclose(between.H[:, 0, 0], W**2 * M / (tie - W**2 * M), rtol=1e-8)


def test_mass_damping_may_resist_absolute_motion():
    model = CASES["alpha"][0]
    T = compute_base_frf(assemble(model), F, [(0, "z")], ["z"], mass_damping="absolute").H[:, 0, 0]
    np.testing.assert_allclose(T, K / (K + 6j * W * M - W**2 * M), rtol=1e-8)
    with pytest.raises(FRFError, match="mass_damping is 'none'"):
        compute_base_frf(assemble(model), F, [(0, "z")], ["z"], mass_damping="none")


def test_two_grounds_move_apart():
    one, two = spring("one", 3e4, 5.0), spring("two", 1e4, 20.0)
    system = assemble(mass_on(one, two))
    T = compute_base_frf(system, F, [(0, "z")], [("one", "z"), ("two", "z"), "z"], method="direct")
    assert T.inputs == ("one Z+", "two Z+", "base Z+")
    Z = 4e4 + 25j * W - W**2 * M
    np.testing.assert_allclose(T.H[:, 0, 0], (3e4 + 5j * W) / Z, rtol=1e-8)
    np.testing.assert_allclose(T.H[:, 0, 1], (1e4 + 20j * W) / Z, rtol=1e-8)
    np.testing.assert_allclose(T.H[:, 0, 2], (4e4 + 25j * W) / Z, rtol=1e-8)


@pytest.mark.parametrize("eta", [0.02, 0.1])
def test_a_cantilever_on_a_shaken_base(eta):
    # tip over base = (cos βL + cosh βL)/(1 + cos βL cosh βL), β⁴ = ρA ω²/(EI (1 + iη))
    n = 20
    model = planar(beam(n, effects=(fix(0),))).with_damping(Damping.structural(eta))
    f = np.linspace(1.0, 160.0, 160)
    T = compute_base_frf(assemble(model), f, [(1, "z")], ["z"], tolerance=1e-8).H[:, 0, 0]
    beta = (STEEL.rho * FLAT.A * (2 * np.pi * f) ** 2 / (STEEL.E * FLAT.Iy * (1 + 1j * eta))) ** 0.25
    exact = (np.cos(beta) + np.cosh(beta)) / (1 + np.cos(beta) * np.cosh(beta))
    # β_h = β (1 - (βh)⁴/2880) has the frequencies of the elements: the error is that change times |β dT/dβ|
    step = 1e-6
    near = beta * (1 - step)
    slope = (exact - (np.cos(near) + np.cosh(near)) / (1 + np.cos(near) * np.cosh(near))) / step
    predicted = -slope * (beta / n) ** 4 / 2880
    found = T - exact
    assert abs(found - predicted).max() < 0.1 * abs(predicted).max() + 1e-7 * abs(exact).max()


def test_a_large_mass_gives_the_same_but_for_its_size():
    # A force on a mass M0 at the base moves it by F/(M0 + m(ω)), m the apparent mass of the structure: the
    # ratio of two responses is the transmissibility for any M0, and M0 times a response errs by 1/(1 + m/M0).
    f = np.linspace(3.0, 120.0, 40)
    damping = Damping.structural(0.05)
    held = planar(beam(12, effects=(fix(0),))).with_damping(damping)
    T = compute_base_frf(assemble(held), f, [(1, "z")], ["z"], method="direct").H[:, 0, 0]
    heavy = 1e3 * STEEL.rho * FLAT.A
    big = AddedMass(name="big", point=0, mass=heavy)
    free = planar(beam(12, effects=(fix(0, ("x", "y", "rx", "ry", "rz")), big)), ("z", "ry"))
    free = free.with_damping(damping)
    H = compute_frf(assemble(free), f, [(0, "z"), (1, "z")], [(0, "z")], method="direct").H[:, :, 0]
    np.testing.assert_allclose(H[:, 1] / H[:, 0], T, rtol=1e-9)
    apparent = 1 / H[:, 0] - heavy
    np.testing.assert_allclose(heavy * H[:, 1] / T - 1, 1 / (1 + apparent / heavy) - 1, rtol=1e-6)
    assert 1e-4 < abs(apparent / heavy).max() < 0.1


def test_feet_that_move_alike_are_a_base():
    system = assemble(portal(0.1))
    f = np.linspace(0.0, 400.0, 41)
    out = [(4, "x"), (5, "z"), (1, "ry")]
    base = compute_base_frf(system, f, out, ["x", "z"], tolerance=1e-8)
    feet = compute_base_frf(
        system, f, out, [(f"foot{i}", d) for d in ("x", "z") for i in (0, 1)], tolerance=1e-8
    )
    total = feet.H[:, :, 0::2] + feet.H[:, :, 1::2]
    np.testing.assert_allclose(base.H, total, atol=1e-6 * abs(base.H).max())
    np.testing.assert_allclose(base.H[0], [[1, 0], [0, 1], [0, 0]], atol=1e-9)
    direct = compute_base_frf(system, f[1:], out, ["x", ("foot1", "z")], method="direct").H
    np.testing.assert_allclose(base.H[1:, :, 0], direct[:, :, 0], atol=1e-6 * abs(base.H).max())
    np.testing.assert_allclose(feet.H[1:, :, 3], direct[:, :, 1], atol=1e-6 * abs(feet.H).max())


def test_a_base_turns_about_a_point():
    # at rest the structure follows: u = θ × (p - place)
    model = portal(0.25)
    place = np.array([0.3, 0.2, -0.1])
    out = [(5, d) for d in ("x", "y", "z", "rx", "ry", "rz")]
    T = compute_base_frf(assemble(model), [0.0], out, ["rx", "ry", "rz"], about=place).H[0]
    np.testing.assert_allclose(T, lever_matrix(model.mesh.points[5] - place)[:, 3:], atol=1e-12)
    rates = compute_base_frf(assemble(model), [7.0], out, ["ry"], about=place, kind="accelerance").H[0]
    slow = compute_base_frf(assemble(model), [7.0], out, ["ry"], about=place).H[0]
    np.testing.assert_allclose(rates, -((14 * np.pi) ** 2) * slow, rtol=1e-12)


def test_a_damper_between_moving_feet_acts():
    # a dashpot from the ground at rest to a mass that the base carries on a spring
    still = spring("still", 0.0, 30.0)
    system = assemble(mass_on(spring(), still))
    T = compute_base_frf(system, F, [(0, "z")], [("spring", "z"), ("still", "z")]).H[:, 0]
    Z = K + 30j * W - W**2 * M
    np.testing.assert_allclose(T, np.column_stack([K + 0j * W, 30j * W]) / Z[:, None], rtol=1e-8, atol=1e-9)


def test_motions_of_nothing_are_refused():
    system = assemble(portal(0.25))
    for motion, message in (
        ("up", "the base moves in 'up'"),
        (("foot9", "z"), r"'foot9' in z is nothing that holds .*; there are \w+ in x y z"),
    ):
        with pytest.raises(ModelError, match=message):
            compute_base_frf(system, [1.0], [(4, "x")], [motion])
    with pytest.raises(FRFError, match="no motion"):
        compute_base_frf(system, [1.0], [(4, "x")], [])
    with pytest.raises(ModelError, match="there are"):
        compute_base_frf(assemble(mounted()), [1.0], [(4, "x")], [("rubber", "z")])


@pytest.mark.parametrize("more", [(), (Plane(name="plane", plane="xz"),)])
def test_no_motion_of_the_base_reaches_a_free_structure(more):
    model = beam(2, effects=more)
    with pytest.raises(ModelError, match="nothing holds the structure to the ground"):
        compute_base_frf(assemble(model), [1.0], [(0, "z")], ["z"])
    spring = Joint(name="spring", point1=0, location=np.zeros(3), K=1e4 * np.eye(6))
    held = beam(2, effects=(spring, *more))
    assert np.abs(compute_base_frf(assemble(held), [1.0], [(0, "z")], ["z"]).H).min() > 0.5
