"""Sizes of effects that are called relevant, and how their trade says them."""

import numpy as np
import pytest

from fem import Relevant, assemble, parameter_values, solve_modes
from fem.effects import Crack, EndRelease, JointStiffness
from tests.frames import FLAT, STEEL, beam, braced, cross_beam, fix, mounted, portal, welded
from updating import propose

SIZES = Relevant(connections=0.3, members=0.1, cracks=0.25, masses=0.02)
TOTAL = 12.0
"""Mass of the structure [kg]."""


def surroundings(key):
    return 3e4


def of_kind(model, kind):
    return propose(model, [kind])[0]


def in_words(effect):
    (size, *_) = effect.parameters()
    return size.in_words(size.value) if size.in_words else ""


def relevant(effect, sizes=SIZES):
    return effect.relevant(sizes, TOTAL, surroundings)


def crack(direction="ry"):
    return next(c for c in Crack.propose(beam(4)) if c.direction == direction)


# Cracks ---------------------------------------------------------------------------------------------------


def test_a_crack_of_a_quarter_of_the_depth_has_the_compliance_of_ostachowicz_and_krawczuk():
    """c = 6π h / (E I) f(0.25), f = x² (0.6384 - 1.035 x + 3.7201 x² - 5.1773 x³ + 7.553 x⁴ …) = 0.034638."""
    c = 6 * np.pi * 0.01 / (210e9 * 0.03 * 0.01**3 / 12) * 0.034638
    assert c == pytest.approx(1.2436e-5, rel=1e-4)
    assert crack("ry").compliance_of(0.25) == pytest.approx(c, rel=1e-3)
    assert relevant(crack("ry")) == pytest.approx(c, rel=1e-3)


def test_a_crack_across_the_flat_is_that_of_its_other_depth():
    """In the plane of the 30 mm the depth is three times, and the section 9 times as stiff."""
    assert crack("rz").compliance_of(0.25) / crack("ry").compliance_of(0.25) == pytest.approx(3 / 9)


@pytest.mark.parametrize("share", [0.05, 0.1, 0.2, 0.3, 0.4])
def test_a_crack_gives_way_as_its_energy_is_released(share):
    """c = 72π / (E b h²) ∫ x F(x)² dx, with F of an edge crack in bending (Tada, Paris and Irwin).

    At half the depth Ostachowicz and Krawczuk's polynomial is 7 % below it.
    """
    x = np.linspace(0.0, share, 2001)
    F = 1.122 - 1.40 * x + 7.33 * x**2 - 13.08 * x**3 + 14.0 * x**4
    c = 72 * np.pi / (STEEL.E * 0.03 * 0.01**2) * np.trapezoid(x * F**2, x)
    assert crack("ry").compliance_of(share) == pytest.approx(c, rel=0.04)


@pytest.mark.parametrize("share", [0.0, 0.1, 0.25, 0.55])
def test_a_crack_is_said_by_its_depth(share):
    cut = crack()
    deep = cut.with_values(compliance=cut.compliance_of(share))
    assert in_words(deep) == f"a cut of {100 * share:.0f} % of the depth"


def test_a_crack_deeper_than_the_formula_is_said_to_be():
    cut = crack()
    assert in_words(cut.with_values(compliance=2 * cut.compliance_of(0.6))) == (
        "a cut of more than 60 % of the depth"
    )


def test_a_relevant_crack_lowers_the_frequencies_of_a_beam():
    model = beam(16, effects=(fix(0),))
    cut = crack("ry").with_values(compliance=relevant(crack("ry")), position=0.1)
    before, after = (solve_modes(assemble(m), n=1).frequency[0] for m in (model, model.with_effect(cut)))
    assert 0.98 * before < after < before


# Connections ----------------------------------------------------------------------------------------------


def test_a_flexible_joint_lacks_a_share_of_its_stiffness():
    softer = next(e for e in JointStiffness.propose(cross_beam()) if e.direction == "ry")
    assert softer.assumed == 3e3
    k = relevant(softer)
    assert k == pytest.approx(0.7 * 3e3)
    assert in_words(softer.with_values(stiffness=k)) == "0.7 of the model's"


def test_a_rigid_joint_has_a_share_of_the_flexibility():
    rigid = next(e for e in JointStiffness.propose(portal()) if np.isinf(e.assumed))
    k = relevant(rigid)
    assert (1 / k) / (1 / k + 1 / surroundings(None)) == pytest.approx(0.3)
    assert in_words(rigid.with_values(stiffness=k)) == ""


def test_a_support_has_a_share_of_the_flexibility():
    k = relevant(of_kind(portal(), "support_flexibility"))
    assert (1 / k) / (1 / k + 1 / surroundings(None)) == pytest.approx(0.3)


def test_a_welded_end_has_a_share_of_what_its_member_turns_by():
    """A member that is pinned at its far end turns by L / (3 E I) under a moment."""
    end = next(e for e in EndRelease.propose(welded()) if e.direction == "ry" and e.member == "beam")
    turns = 0.35 / (3 * STEEL.E * 0.02 * 0.016**3 / 12)
    c = relevant(end)
    assert c / (c + turns) == pytest.approx(0.3)


# Members and masses ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["member_stiffness", "member_density", "member_section"])
def test_a_member_has_less_by_a_share(kind):
    assert relevant(of_kind(portal(), kind)) == -0.1


@pytest.mark.parametrize("kind", ["point_mass", "joint_mass"])
def test_a_mass_is_a_share_of_the_structures(kind):
    assert relevant(of_kind(portal(), kind)) == pytest.approx(0.02 * TOTAL)


def test_a_stretch_loses_the_stiffness_of_a_section_cut_by_the_crack():
    """I ~ h³: a quarter off the depth leaves 0.75³."""
    assert relevant(of_kind(portal(), "stiffness_loss")) == pytest.approx(1 - 0.75**3)


def test_a_tension_is_a_share_of_the_buckling_load():
    tie = of_kind(portal(), "preload")
    length = portal().mesh.member_length(tie.member)
    euler = np.pi**2 * STEEL.E * min(FLAT.Iy, FLAT.Iz) / length**2
    assert relevant(tie) == pytest.approx(0.1 * euler)


@pytest.mark.parametrize("model", [portal, cross_beam, braced, mounted, welded])
def test_every_relevant_size_is_within_bounds_and_not_absent(model):
    larger = Relevant(connections=0.5, members=0.2, cracks=0.4, masses=0.05)
    sized = 0
    for effect in propose(model()):
        value, more = relevant(effect), relevant(effect, larger)
        if value is None:
            assert more is None
            continue
        sized += 1
        p = effect.parameters()[0]
        assert p.lower <= value <= p.upper, effect.name
        assert value != p.absent, effect.name
        changed = effect.with_values(**{p.name: value})
        assert parameter_values(changed)[p.name] == pytest.approx(value)
        distances = [abs(1 / v) if np.isinf(p.absent) else abs(v - p.absent) for v in (value, more)]
        assert distances[0] < distances[1], effect.name
    assert sized > 5


def test_sizes_are_said_otherwise_only_where_that_is_another_than_the_parameter():
    said = {e.kind for e in propose(cross_beam()) if e.parameters()[0].in_words}
    assert said == {"crack", "joint_stiffness", "joint_complex_stiffness"}
