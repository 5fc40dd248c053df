"""Shear, torsional and equivalent stresses of sections against closed forms of textbooks."""

import numpy as np
import pytest

from fem import MemberProperties, Section, section_stresses
from fem.sections.stress_points import missing_formula, stress_points
from tests.frames import STEEL

FORCES = ("N", "Vy", "Vz", "T", "My", "Mz")


def stresses(section, nu=0.3, **forces):
    """Return points (n, 2) and σx, τxy, τxz (n, 3) under some section forces."""
    found = stress_points(section, nu)
    assert found is not None
    return found.points, found.per_force @ [forces.get(name, 0.0) for name in FORCES]


def largest(section, nu=0.3, **forces):
    """Return the largest shear stress."""
    return float(np.linalg.norm(stresses(section, nu, **forces)[1][:, 1:], axis=1).max())


def at(section, y, z, nu=0.3, **forces):
    """Return the stresses at a point of the section."""
    points, found = stresses(section, nu, **forces)
    here = np.flatnonzero(np.linalg.norm(points - [y, z], axis=1) < 1e-9)
    assert here.size
    return found[here[0]]


def test_round_bars():
    """Timoshenko & Goodier, art. 121: V/A (3 + 2ν)/(2 (1 + ν)) in the middle; torsion 16 T/(π d³)."""
    d, nu, V = 0.05, 0.3, 2e3
    A = np.pi * d**2 / 4
    bar = Section.circle(d)
    assert at(bar, 0, 0, nu, Vz=V)[2] == pytest.approx(V / A * (3 + 2 * nu) / (2 * (1 + nu)), rel=1e-12)
    assert at(bar, d / 2, 0, nu, Vz=V)[2] == pytest.approx(V / A * (1 + 2 * nu) / (1 + nu), rel=1e-12)
    assert at(bar, 0, 0, 0.5, Vz=V)[2] == pytest.approx(4 / 3 * V / A, rel=1e-12)  # VQ/It
    assert largest(bar, T=10.0) == pytest.approx(16 * 10.0 / (np.pi * d**3), rel=1e-12)


def test_tubes():
    """Thin: 2 V/A and T/(2 A t); thick, at ν = 1/2: V Q/(I t) on average across the wall; T r/J."""
    d, t, V = 0.1, 0.0005, 1e3
    thin = Section.tube(d, t)
    assert largest(thin, Vy=V) == pytest.approx(2 * V / thin.A, rel=2 * t / d)
    enclosed = np.pi * (d - t) ** 2 / 4
    assert largest(thin, T=50.0) == pytest.approx(50.0 / (2 * enclosed * t), rel=2 * t / d)
    R, r = 0.05, 0.03
    thick = Section.tube(2 * R, R - r)
    own = [at(thick, rho, 0, 0.5, Vz=V)[2] for rho in (r, (R + r) / 2, R)]
    average = (own[0] + 4 * own[1] + own[2]) / 6  # Simpson; of the exact stress
    Q = 2 / 3 * (R**3 - r**3)
    assert average == pytest.approx(V * Q / (thick.Iy * 2 * (R - r)), rel=2e-3)
    assert largest(thick, T=50.0) == pytest.approx(50.0 * R / (np.pi * (R**4 - r**4) / 2), rel=1e-12)


@pytest.mark.parametrize(("ratio", "k"), [(1, 4.808), (1.5, 4.329), (2, 4.065), (4, 3.546), (10, 3.195)])
def test_torsion_of_rectangles(ratio, k):
    """T/(k₂ b t²), k₂ = 1/k: Timoshenko & Goodier, art. 109, table of rectangular bars (0.208 … 0.313)."""
    t = 0.02
    table = {1: 0.208, 1.5: 0.231, 2: 0.246, 4: 0.282, 10: 0.313}
    assert 1 / k == pytest.approx(table[ratio], rel=3e-3)
    for b, h in ((t, ratio * t), (ratio * t, t)):
        points, found = stresses(Section.rectangle(b, h), T=7.0)
        size = np.linalg.norm(found[:, 1:], axis=1)
        assert size.max() == pytest.approx(7.0 / (table[ratio] * ratio * t**3), rel=3e-3)
        where = points[size.argmax()]
        assert min(abs(where)) == 0  # in the middle of a long side
        assert size[(abs(points) > 0.999 * np.array([b, h]) / 2).all(axis=1)].max() < 2e-3 * size.max()


def test_shear_of_rectangles():
    """3 V/(2 A) at ν = 0; with ν the edges carry more: Timoshenko & Goodier, art. 124."""
    b, h, V, nu = 0.04, 0.06, 3e3, 0.25
    A = b * h
    bar = Section.rectangle(b, h)
    assert largest(bar, 0.0, Vz=V) == pytest.approx(1.5 * V / A, rel=1e-12)
    a, c, n = h / 2, b / 2, np.arange(1, 40)
    series = 2 / 3 - 4 / np.pi**2 * (1 / (n**2 * np.cosh(n * np.pi * a / c))).sum()
    more = nu / (1 + nu) * (c / a) ** 2 * series
    assert at(bar, c, 0, nu, Vz=V)[2] == pytest.approx(1.5 * V / A * (1 + more), rel=1e-12)
    # their table has the factor for ν = 1/4: 1.126 for a square, 1.396 for width : depth = 2 : 1
    for ratio, factor in ((1, 1.126), (2, 1.396), (4, 1.988)):
        wide = Section.rectangle(ratio * h, h)
        assert at(wide, ratio * h / 2, 0, 0.25, Vz=V)[2] == pytest.approx(1.5 * V / wide.A * factor, rel=2e-3)


def test_ellipses():
    """Torsion 2 T/(π a b²) at the ends of the short axis; shear as a circle where it is one."""
    b, h = 0.04, 0.07
    section = Section.ellipse(b, h)
    assert largest(section, T=5.0) == pytest.approx(2 * 5.0 / (np.pi * (h / 2) * (b / 2) ** 2), rel=1e-12)
    same = [largest(s, Vz=1.0) for s in (Section.ellipse(0.05, 0.05), Section.circle(0.05))]
    assert same[0] == pytest.approx(same[1], rel=1e-12)


def test_i_sections():
    """V Q/(I t) in the web and the flanges along centre lines, T t/J at the faces."""
    b, h, tf, tw, V = 0.1, 0.2, 0.01, 0.006, 1e4
    section = Section.i_section(b, h, tf, tw)
    hm = h - tf
    I = tw * hm**3 / 12 + 2 * b * tf * hm**2 / 4
    web = V / (I * tw) * (b * tf * hm / 2 + tw * hm**2 / 8)
    assert largest(section, Vz=V) == pytest.approx(web, rel=1e-12)
    points, found = stresses(section, Vz=V)
    flange = abs(found[abs(points[:, 1]) > hm / 2 - tf / 4][:, 1]).max()
    assert flange == pytest.approx(V / I * hm / 2 * b / 2, rel=1e-12)
    assert largest(section, T=20.0) == pytest.approx(20.0 * tf / section.J, rel=1e-12)


def test_channels_twist_under_forces_at_the_centroid():
    """A force at the shear centre does not twist; at the centroid it does, with its arm (Megson)."""
    section = Section.channel(0.06, 0.12, 0.008, 0.005)
    arm = section.shear_centre[0]
    hm, bm, V = 0.112, 0.0575, 1e3
    I = 0.005 * hm**3 / 12 + 2 * bm * 0.008 * hm**2 / 4
    web = V / (I * 0.005) * (bm * 0.008 * hm / 2 + 0.005 * hm**2 / 8)
    assert largest(section, Vz=V, T=V * arm) == pytest.approx(web, rel=1e-12)
    twisted = V * abs(arm) * 0.008 / section.J
    assert largest(section, Vz=V) > twisted > 3 * web


@pytest.mark.parametrize("r", [0.0, 0.012])
def test_hollow_rectangles(r):
    """Torsion T/Wt with Wt = It/(t + K/t) after EN 10210-2, which is 2 A t (Bredt) for thin walls."""
    b, h, t, T = 0.08, 0.12, 0.005, 900.0
    section = Section.hollow_rectangle(b, h, t, r)
    middle = max(r - t / 2, 0.0)
    A = (b - t) * (h - t) - (4 - np.pi) * middle**2
    p = 2 * (b + h - 2 * t) - 2 * (4 - np.pi) * middle
    modulus = section.J / (t + 2 * A / p)
    assert largest(section, T=T) == pytest.approx(T / modulus, rel=2e-3)
    thin = Section.hollow_rectangle(b, h, t / 100)
    A = (b - t / 100) * (h - t / 100)
    assert largest(thin, T=T) == pytest.approx(T / (2 * A * t / 100), rel=2e-3)


def test_shear_flow_of_a_box():
    """In the middle of a web V Q/(2 I t), which half of the flanges flow into."""
    b, h, t, V = 0.08, 0.12, 0.002, 5e3
    bm, hm = b - t, h - t
    I = 2 * (t * hm**3 / 12 + bm * t * hm**2 / 4)
    web = V / (2 * I * t) * (bm * t * hm / 2 + 2 * t * hm**2 / 8)
    assert largest(Section.hollow_rectangle(b, h, t), Vz=V) == pytest.approx(web, rel=1e-12)


@pytest.mark.parametrize(
    "section",
    [
        Section.circle(0.05),
        Section.tube(0.05, 0.008),
        Section.ellipse(0.03, 0.05),
        Section.rectangle(0.03, 0.05),
        Section.i_section(0.1, 0.2, 0.01, 0.006, 0.01),
        Section.unequal_i_section(0.05, 0.1, 0.2, 0.01, 0.008, 0.006),
        Section.t_section(0.1, 0.1, 0.01, 0.006),
        Section.channel(0.06, 0.12, 0.008, 0.005),
        Section.angle_section(0.08, 0.12, 0.01),
        Section.cruciform(0.1, 0.1, 0.01),
        Section.hollow_rectangle(0.08, 0.12, 0.005, 0.01),
        Section.hollow_ellipse(0.08, 0.12, 0.004),
        Section.hollow_polygon(6, 0.1, 0.004),
    ],
    ids=lambda s: s.shape,
)
def test_von_mises_of_a_section_is_not_below_its_parts(section):
    forces = np.array([[3e3], [400.0], [-700.0], [20.0], [60.0], [-40.0]])[None]
    found = section_stresses(MemberProperties(STEEL, section), np.zeros(1), forces)
    assert found is not None
    assert found.shear is not None
    assert found.von_mises is not None
    assert not found.missing
    normal = max(abs(found.low.item()), abs(found.high.item()))
    sheared = np.sqrt(3) * found.shear.item()
    assert max(normal, sheared) * (1 - 1e-12) <= found.von_mises.item()
    assert found.von_mises.item() <= np.hypot(normal, sheared) * (1 + 1e-12)
    # of a tension and a torque alone, √(σ² + 3τ²) with the torque's largest
    alone = np.array([[3e3], [0], [0], [20.0], [0], [0]])[None]
    found = section_stresses(MemberProperties(STEEL, section), np.zeros(1), alone)
    assert found is not None
    assert found.von_mises is not None
    expected = np.hypot(3e3 / section.A, np.sqrt(3) * largest(section, T=20.0))
    assert found.von_mises.item() == pytest.approx(expected, rel=1e-12)


def test_outlines_have_no_formula_and_say_so():
    plate = Section.polygon([(0, 0), (0.1, 0), (0.05, 0.08)], J=1e-7)
    assert stress_points(plate, 0.3) is None
    found = section_stresses(MemberProperties(STEEL, plate), np.zeros(1), np.ones((1, 6, 1)))
    assert found is not None
    assert found.shear is None
    assert found.von_mises is None
    assert found.missing == "no formula for shear and torsion of an outline"
    assert (
        missing_formula(Section(A=1e-3, Iy=1e-6, Iz=2e-6, J=1e-6))
        == "the outline of the section is not given"
    )


def test_tapers_have_the_stresses_of_each_place():
    first, last = Section.circle(0.04), Section.circle(0.06)
    forces = np.tile(np.array([0, 0, 0, 9.0, 0, 0])[:, None], (3, 1, 1))
    bar = MemberProperties(STEEL, first, section2=last)
    found = section_stresses(bar, np.array([0.0, 0.5, 1.0]), forces)
    assert found is not None
    assert found.shear is not None
    expected = [16 * 9.0 / (np.pi * d**3) for d in (0.04, 0.05, 0.06)]
    np.testing.assert_allclose(found.shear[:, 0], expected, rtol=1e-12)
