"""Published rotors: Friswell, Penny, Garvey and Lees, Dynamics of Rotating Machines (2010), section 5.9.

The numbers are those that ROSS publishes for the same meshes (R. Timbó et al., J. Open Source Softw. 5,
2020): examples 3 and 4 of its user guide, and its tests of critical speeds.
"""

import numpy as np
import pytest

from fem.analysis.campbell import solve_campbell
from fem.analysis.complex_modes import solve_complex_modes
from fem.analysis.whirl import whirl
from fem.effects.added_mass import AddedMass
from fem.effects.joint import Joint
from fem.effects.spin import Spin
from fem.materials import Material
from fem.sections.section import Section
from fem.system import assemble
from tests.frames import beam, fix

E, G = 211e9, 81.2e9
STEEL = Material("steel", E, 7810.0, nu=E / (2 * G) - 1)
SHAFT = Section.circle(0.05, nu=STEEL.nu)


def disc(mesh, x, diameter):
    """Return a disc of 70 mm on the shaft, its centre at x."""
    bore, width = 0.05, 0.07
    mass = np.pi / 4 * STEEL.rho * width * (diameter**2 - bore**2)
    squares = diameter**2 + bore**2
    across = mass * (3 * squares + 4 * width**2) / 48
    inertia = np.diag([mass * squares / 8, across, across])
    return AddedMass(name=f"disc at {x}", point=point(mesh, x), mass=mass, inertia=inertia)


def bearing(mesh, x, ky, kz):
    p = point(mesh, x)
    K = np.diag([0, ky, kz, 0, 0, 0])
    return Joint(name=f"bearing at {x}", point1=p, location=mesh.points[p], K=K)


def point(mesh, x):
    return int(np.argmin(abs(mesh.points[:, 0] - x)))


def rotor(n, discs, bearings, ky=1e6, kz=1e6):
    """Return a shaft of n elements of 0.25 m, with discs and bearings at places along it."""
    mesh = beam(n, 0.25 * n).mesh
    effects = [bearing(mesh, x, ky, kz) for x in bearings]
    effects += [disc(mesh, x, diameter) for x, diameter in discs.items()]
    effects.append(fix(0, ("x", "rx")))
    return beam(n, 0.25 * n, section=SHAFT, material=STEEL, theory="timoshenko", spin=1.0, effects=effects)


TWO_DISCS = {0.5: 0.28, 1.0: 0.35}


@pytest.mark.parametrize(
    ("kz", "published", "senses"),
    [
        (1e6, [85.389467, 87.7958637, 251.78460413, 294.71333087, 600.17936195, 827.07536192], "BFBFBF"),
        (0.8e6, [82.32547398, 86.86369902, 239.64228361, 287.24958074, 583.48782916, 806.8872843], "BFBFBF"),
    ],
)
def test_two_discs_at_4000_turns_a_minute(kz, published, senses):
    model = rotor(6, TWO_DISCS, (0.0, 1.5), kz=kz)
    turning = model.with_effect(Spin(name="spin", speed=4000 * 2 * np.pi / 60))
    modes = solve_complex_modes(assemble(turning, reciprocal=False), 9)
    sense = whirl(turning, modes.poles, modes.shapes)
    bending = np.flatnonzero(np.isfinite(sense))[:6]
    np.testing.assert_allclose(modes.poles[bending].imag, published, rtol=1e-8)  # all printed digits
    assert "".join("F" if w > 0 else "B" for w in sense[bending]) == senses
    if kz == 1e6:
        np.testing.assert_allclose(abs(sense[bending]), 1.0, atol=1e-9)


@pytest.mark.parametrize(
    ("discs", "published"),
    [
        (
            {1.0: 0.28, 1.5: 0.35},
            [86.10505193, 86.60492546, 198.93259257, 207.97165539, 244.95609413, 250.53522782],
        ),
        (
            {1.25: 0.28, 2.5: 0.35},
            [61.52110644, 63.72862198, 117.49491374, 118.55829416, 233.83724523, 236.40346235],
        ),
    ],
)
def test_critical_speeds(discs, published):
    model = rotor(10, discs, (0.5, 2.0))
    found = solve_campbell(model, np.linspace(0, 300, 7), 8)
    assert found.converged
    speeds = np.array([c.speed for c in found.critical if np.isfinite(c.whirl)])[:6]
    # the published ones end an iteration at 5e-3 of the speed
    np.testing.assert_allclose(speeds, published, rtol=2e-4)
    for c in found.critical:
        assert c.pole.imag == pytest.approx(c.speed, rel=1e-8)


def test_branches_keep_their_whirl_where_they_cross():
    """Of equal bearings forward and backward modes cross; 8 speeds are as good as 57 to follow them."""
    model = rotor(6, TWO_DISCS, (0.0, 1.5))
    fine, coarse = (solve_campbell(model, np.linspace(0, 2000, n), 8) for n in (57, 8))
    assert (np.diff(fine.frequency, axis=1) < 0).any(), "none cross"
    for k in range(8):
        known = fine.whirl[1:, k][np.isfinite(fine.whirl[1:, k])]
        assert known.size == 0 or (np.sign(known) == np.sign(known[0])).all()
    assert fine.likeness[1:, :8].min() > 0.9
    np.testing.assert_allclose(fine.frequency[8::8, :8], coarse.frequency[1:, :8], rtol=1e-9)
