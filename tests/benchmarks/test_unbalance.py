"""Unbalance: the Jeffcott rotor, an overhung disc with its gyroscopic moment, unequal bearings."""

import numpy as np
import pytest

from fem import (
    AddedMass,
    Damping,
    Joint,
    Material,
    ModelError,
    Section,
    Tabulated,
    Unbalance,
    assemble,
    compute_base_frf,
    solve_random,
    solve_unbalance,
    sum_contributions,
)
from fem.effects import Spin
from tests.frames import beam, fix

LIGHT = Material("light", 211e9, 1e-3, nu=0.3)
ROD = Section(1e-3, 2e-8, 2e-8, 4e-8, ky=0.0, kz=0.0)
EI, LENGTH, MASS, MOMENT = 211e9 * 2e-8, 0.8, 6.0, 3e-4
ENDS = (fix(0, ("x", "y", "z", "rx"), "left"), fix(1, ("y", "z"), "right"))


def dashpot(model, point, cy, cz):
    C = np.diag([0, cy, cz, 0, 0, 0])
    return Joint(name="dashpot", point1=point, location=model.mesh.points[point], C=C)


def jeffcott(cy=200.0, cz=200.0, spin=1.0):
    """Return a light shaft on rigid bearings with a disc at its middle, and the disc's point."""
    plain = beam(2, LENGTH, effects=ENDS, material=LIGHT, section=ROD, theory="timoshenko", spin=spin)
    disc = AddedMass(name="disc", point=2, mass=MASS)
    return plain.with_effect(disc, dashpot(plain, 2, cy, cz))


def test_jeffcott_rotor():
    """Amplitude (u/m) r²/√((1 - r²)² + (2ζr)²), phase behind by atan2(2ζr, 1 - r²); circles."""
    k = 48 * EI / LENGTH**3
    omega0 = np.sqrt(k / MASS)
    zeta = 200.0 / (2 * np.sqrt(k * MASS))
    r = np.array([0.0, 0.3, 0.8, 1.0, 1.3, 3.0])
    found = solve_unbalance(jeffcott(), [Unbalance(point=2, moment=MOMENT)], r * omega0, [(2, "y"), (2, "z")])
    exact = MOMENT / MASS * r**2 / (1 - r**2 + 2j * zeta * r)
    np.testing.assert_allclose(found.displacement[:, 1], exact, rtol=1e-6, atol=1e-15)
    np.testing.assert_allclose(found.displacement[:, 0], 1j * exact, rtol=1e-6, atol=1e-15)  # towards -y
    np.testing.assert_allclose(found.frequency, r * omega0 / (2 * np.pi))


def test_direction_and_sense():
    """An unbalance at 90° is a quarter of a turn ahead; turning backwards mirrors the orbit."""
    speed, rows = [100.0], [(2, "y"), (2, "z")]
    first, ahead, back = (
        solve_unbalance(
            jeffcott(spin=s), [Unbalance(point=2, moment=MOMENT, angle=a)], speed, rows
        ).displacement
        for s, a in ((1.0, 0.0), (1.0, np.pi / 2), (-1.0, 0.0))
    )
    np.testing.assert_allclose(ahead, 1j * first, rtol=1e-9)
    np.testing.assert_allclose(back, first * [-1, 1], rtol=1e-9)


def test_a_gear_turns_its_unbalance_faster():
    fast = solve_unbalance(jeffcott(spin=2.5), [Unbalance(point=2, moment=MOMENT)], [40.0], [(2, "z")])
    slow = solve_unbalance(jeffcott(), [Unbalance(point=2, moment=MOMENT)], [100.0], [(2, "z")])
    assert fast.displacement == pytest.approx(slow.displacement)
    assert (fast.ratio, fast.frequency[0]) == (2.5, slow.frequency[0])


def test_overhung_disc():
    """(K - Ω² diag(m, I_t - I_p)) (w, φ) = (u Ω², 0), K of the clamped light shaft's end."""
    transverse, polar = 0.05, 0.09
    plain = beam(4, LENGTH, effects=(fix(0),), material=LIGHT, section=ROD, theory="timoshenko", spin=1.0)
    disc = AddedMass(name="disc", point=1, mass=MASS, inertia=np.diag([polar, transverse, transverse]))
    K = EI * np.array([[12 / LENGTH**3, -6 / LENGTH**2], [-6 / LENGTH**2, 4 / LENGTH]])
    speed = np.array([20.0, 60.0, 90.0, 200.0])
    found = solve_unbalance(plain.with_effect(disc), [Unbalance(point=1, moment=MOMENT)], speed, [(1, "z")])
    exact = [
        np.linalg.solve(K - w**2 * np.diag([MASS, transverse - polar]), [MOMENT * w**2, 0])[0] for w in speed
    ]
    np.testing.assert_allclose(found.displacement[:, 0].real, exact, rtol=1e-5)
    without = [np.linalg.solve(K - w**2 * np.diag([MASS, transverse]), [MOMENT * w**2, 0])[0] for w in speed]
    assert abs(without[2] / exact[2] - 1) > 0.05, "the gyroscopic moment does not matter here"


def test_unequal_bearings_make_ellipses():
    """Without coupling each direction is an oscillator of its own."""
    model = jeffcott(cy=100.0, cz=400.0)
    k = 48 * EI / LENGTH**3
    w = np.sqrt(k / MASS)
    found = solve_unbalance(
        model, [Unbalance(point=2, moment=MOMENT)], [w], [(2, "y"), (2, "z")]
    ).displacement
    assert abs(found[0, 0]) == pytest.approx(MOMENT * w / 100.0, rel=1e-6)
    assert abs(found[0, 1]) == pytest.approx(MOMENT * w / 400.0, rel=1e-6)


def test_two_unbalances_may_balance_each_other():
    pair = [Unbalance(point=2, moment=MOMENT), Unbalance(point=2, moment=MOMENT, angle=np.pi)]
    found = solve_unbalance(jeffcott(), pair, [150.0], [(2, "z")])
    assert abs(found.displacement[0, 0]) < 1e-18


@pytest.mark.parametrize(
    ("unbalances", "message"),
    [
        ([], "there is no unbalance"),
        (
            [Unbalance(point=9, moment=1.0)],
            "the unbalance at point 9 is on no member that spins; these are: beam",
        ),
    ],
)
def test_what_is_refused(unbalances, message):
    with pytest.raises(ModelError, match=message):
        solve_unbalance(jeffcott(), unbalances, [10.0], [(2, "z")])


def turning(rpm=6000.0):
    plain = beam(
        4, LENGTH, effects=(fix(0, name="foot"),), section=Section.circle(0.02), theory="timoshenko", spin=1.0
    )
    disc = AddedMass(name="disc", point=1, mass=2.0, inertia=np.diag([0.02, 0.01, 0.01]))
    return plain.with_effect(disc, dashpot(plain, 1, 10.0, 10.0), Spin(name="spin", speed=rpm * np.pi / 30))


def test_a_base_that_moves_straight_shakes_a_turning_rotor_as_forces_do():
    """-M r a in coordinates relative to the base, solved by the dynamic stiffness with its skew part."""
    system = assemble(turning(), reciprocal=False)
    f = np.array([7.0, 15.0, 40.0])
    found = compute_base_frf(system, f, [(1, "y"), (1, "z")], ["y"], relative=True).H[:, :, 0]
    r = np.zeros(system.model.n_dof)
    r[1::6] = 1.0
    rows = np.asarray(system.Q[[7, 8]].todense())
    M = sum_contributions(system.model.contributions(), system.model.n_dof)[1]
    for line, own in zip(f, found, strict=True):
        w = 2 * np.pi * line
        u = np.linalg.solve(system.dynamic_stiffness(w).toarray(), w**2 * (system.Q.T @ (M @ r)))
        np.testing.assert_allclose(own, rows @ u, rtol=1e-6, atol=1e-9)
    assert np.abs(found[:, 1]).max() > 1e-3, "the rotor does not whirl"


def test_random_vibration_finds_the_split_frequencies():
    system = assemble(turning().with_damping(Damping.structural(0.02)), reciprocal=False)
    white = {"y": Tabulated.of([2, 80], [1.0, 1.0])}
    found = solve_random(system, [(1, "y"), (1, "z")], base=white, relative=True)
    f = np.linspace(2, 80, 2001)
    H = compute_base_frf(system, f, [(1, "y")], ["y"], relative=True).H[:, 0, 0]
    assert found.rms[0] == pytest.approx(np.sqrt(np.trapezoid(np.abs(H) ** 2, f)), rel=1e-3)
    assert found.frequency.size < 700
    assert found.rms[1] > 0.1 * found.rms[0], "no response across"
