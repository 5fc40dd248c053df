"""Members that twist about their shear centre: closed forms of bending and torsion that are coupled."""

import numpy as np
import pytest
import scipy.linalg as sla

from fem import Section, assemble, first_modes, solve_static
from fem.analysis.warping import warped_modes, warping_constant
from fem.effects import ShearCentre
from tests.frames import STEEL, beam, fix

CHANNEL = Section.channel(0.06, 0.1, 0.008, 0.006)
T = Section.t_section(0.06, 0.08, 0.006, 0.006)
FORKS = (fix(0, ("x", "y", "z", "rx"), name="a"), fix(1, ("y", "z", "rx"), name="b"))
LENGTH = 2.0


def coupled(model):
    return model.with_effect(*ShearCentre.propose(model))


@pytest.mark.parametrize("section", [CHANNEL, T])
def test_modes_between_forks(section):
    """Sines in both bendings and twist: three equations for each half-wave, with mass at the centroid."""
    n = 24
    model = coupled(beam(n, LENGTH, effects=FORKS, section=section, theory="euler-bernoulli"))
    y, z = section.shear_centre
    to_centroid = np.array([[1, 0, z], [0, 1, -y], [0, 0, 1]])  # from v, w of the shear centre, and the twist
    polar = section.Ip or section.Iy + section.Iz
    M = STEEL.rho * to_centroid.T @ np.diag([section.A, section.A, polar]) @ to_centroid
    found = first_modes(assemble(model), 12).frequency[:3]
    exact = []
    for k in np.arange(1, 4) * np.pi / LENGTH:
        K = np.diag([STEEL.E * section.Iz * k**4, STEEL.E * section.Iy * k**4, STEEL.G * section.J * k**2])
        exact.extend(np.sqrt(sla.eigvalsh(K, M)) / (2 * np.pi))
    exact = np.sort(exact)[:3]
    # Twist is linear in an element of length h, which raises its frequency by (kh)²/24, bending by less.
    error = (2 * np.pi / n) ** 2 / 24
    assert (found > exact * (1 - 1e-8)).all()
    np.testing.assert_allclose(found, exact, rtol=error)


def test_a_force_at_the_centroid_of_a_channel_twists_it():
    """At the tip of a cantilever: F L³/3EI at the shear centre, and a twist F e L/GJ."""
    force, length = 100.0, 1.0
    model = coupled(
        beam(3, length, effects=(fix(0, name="wall"),), section=CHANNEL, theory="euler-bernoulli")
    )
    solution = solve_static(assemble(model), {(1, "z"): force})
    tip = solution.displacements[6:12, 0]
    y, _ = CHANNEL.shear_centre
    twist = -y * force * length / (STEEL.G * CHANNEL.J)
    bending = force * length**3 / (3 * STEEL.E * CHANNEL.Iy)
    np.testing.assert_allclose(tip[3], twist, rtol=1e-9)
    np.testing.assert_allclose(tip[2], bending - y * twist, rtol=1e-9)
    # Equilibrium about the centroid: the force has no moment about x there.
    np.testing.assert_allclose(solution.internal_forces("beam", [0.5])[0, 2, 0], force, rtol=1e-9)


def test_loads_square_to_the_shear_centres_of_a_taper_do_not_twist_it():
    """Their line is inclined: a force through it, and a moment with no part along it, bend alone."""
    force, moment, length = 100.0, 30.0, 1.0
    small = Section.channel(0.03, 0.06, 0.008, 0.006)
    plain = beam(
        4, length, effects=(fix(0, name="wall"),), section=CHANNEL, section2=small, theory="euler-bernoulli"
    )
    bending = {(1, "z"): force, (1, "ry"): moment}
    y, slope = small.shear_centre[0], (small.shear_centre[0] - CHANNEL.shear_centre[0]) / length
    load = {**bending, (1, "rx"): force * y - moment * slope}
    tip, alone = (
        solve_static(assemble(m), f).displacements[6:12, 0]
        for m, f in ((coupled(plain), load), (plain, bending))
    )
    np.testing.assert_allclose(tip, alone, rtol=0, atol=1e-9 * abs(alone).max())


def test_a_section_with_its_shear_centre_at_its_centroid_has_no_such_effect():
    assert ShearCentre.propose(beam(3, section=Section.i_section(0.1, 0.2, 0.0085, 0.0056))) == ()


def test_warping_is_named_with_the_modes_that_it_stiffens():
    """Between forks St Venant's frequency of a half-wave rises by √(1 + π²E Iw/(G J L²))."""
    section = Section.i_section(0.1, 0.2, 0.0085, 0.0056)
    model = beam(16, LENGTH, effects=FORKS, section=section)
    modes = first_modes(assemble(model), 4)
    (message,) = warped_modes(model, modes)
    k2 = np.pi**2 * STEEL.E * warping_constant(section) / (STEEL.G * section.J * LENGTH**2)
    stated = float(message.rpartition("up to ")[2].removesuffix(" %")) / 100
    assert abs(stated - (np.sqrt(1 + k2) - 1)) < 0.01
    twisting = [
        k for k in range(4) if np.abs(modes.shapes[3::6, k]).max() > 1e-3 * np.abs(modes.shapes[:, k]).max()
    ]
    assert f"mode{'' if len(twisting) == 1 else 's'} {', '.join(str(k + 1) for k in twisting)} may" in message
    assert warped_modes(beam(4, LENGTH, effects=FORKS), modes) == ()
