"""Constants of sections against textbook formulas, and against integrals over their outlines."""

import numpy as np
import pytest

from fem.properties import PropertyError, Section
from fem.sections import SHAPES


def polygon(outline):
    """Return A, ∫z² and ∫y² of a polygon by Green's theorem."""
    (y, z), (y2, z2) = outline.T, np.roll(outline, -1, axis=0).T
    cross = y * z2 - y2 * z
    moments = [(cross * (a**2 + a * b + b**2)).sum() / 12 for a, b in ((z, z2), (y, y2))]
    return np.array([cross.sum() / 2, *moments])


@pytest.mark.parametrize(
    "section",
    [
        Section.rectangle(0.05, 0.1),
        Section.hollow_rectangle(0.08, 0.12, 0.004),
        Section.i_section(0.1, 0.2, 0.012, 0.007),
    ],
    ids=lambda s: s.label,
)
def test_area_and_second_moments_are_those_of_the_outline(section):
    outer, *holes = (polygon(o) * np.sign(polygon(o)[0]) for o in section.outlines)
    np.testing.assert_allclose([section.A, section.Iy, section.Iz], outer - sum(holes), rtol=1e-12)


def test_solid_rectangle():
    s = Section.rectangle(b=0.05, h=0.1)
    assert s.Iy == pytest.approx(0.05 * 0.1**3 / 12)
    assert s.Iz == pytest.approx(0.1 * 0.05**3 / 12)
    assert s.ky == s.kz == pytest.approx(5 / 6)
    # Timoshenko & Goodier, art. 109: J = k1 a³ b, the table's k1 has three or four digits
    for ratio, k1, half_digit in ((1, 0.1406, 5e-5), (2, 0.229, 5e-4), (3, 0.263, 5e-4), (10, 0.312, 5e-4)):
        assert Section.rectangle(1, ratio).J / ratio == pytest.approx(k1, abs=half_digit)
        assert Section.rectangle(ratio, 1).J == Section.rectangle(1, ratio).J
    # long strip: b t³/3 (1 - 0.630 t/b)
    assert pytest.approx(50 / 3 * (1 - 0.630 / 50), rel=0.0005 / 50) == Section.rectangle(1, 50).J


def test_circle_and_tube():
    s, t = Section.circle(0.05), Section.tube(0.05, 0.003)
    assert pytest.approx(np.pi * 0.05**2 / 4) == s.A
    assert s.Iy == s.Iz == pytest.approx(np.pi * 0.05**4 / 64)
    assert pytest.approx(np.pi * 0.05**4 / 32) == s.J
    assert pytest.approx(np.pi * (0.05 - 0.003) * 0.003) == t.A  # the centre line times the wall, exactly
    assert t.Iy == pytest.approx(np.pi * (0.05**4 - 0.044**4) / 64)
    assert pytest.approx(2 * t.Iy) == t.J


def test_thin_walls():
    b, h, t = 0.08, 0.12, 0.004
    s = Section.hollow_rectangle(b, h, t)
    area, perimeter = (b - t) * (h - t), 2 * (b - t + h - t)
    assert pytest.approx(4 * area**2 * t / perimeter) == s.J  # Bredt
    assert s.kz * s.A == pytest.approx(2 * t * (h - t))
    assert s.ky * s.A == pytest.approx(2 * t * (b - t))
    i = Section.i_section(0.1, 0.2, 0.012, 0.007)
    assert pytest.approx((2 * 0.1 * 0.012**3 + (0.2 - 0.012) * 0.007**3) / 3) == i.J
    assert i.kz * i.A == pytest.approx((0.2 - 2 * 0.012) * 0.007)


@pytest.mark.parametrize(
    ("make", "word"),
    [
        (lambda: Section.rectangle(0, 0.1), "b is 0"),
        (lambda: Section.tube(0.05, 0.03), "fills the diameter"),
        (lambda: Section.hollow_rectangle(0.1, 0.05, 0.025), "t must be below half"),
        (lambda: Section.i_section(0.1, 0.02, 0.012, 0.007), "do not fit"),
        (lambda: Section(A=1e-4, Iy=-1e-9, Iz=1e-9, J=1e-9), "Iy is -1e-09"),
    ],
)
def test_impossible_sections_are_named(make, word):
    with pytest.raises(PropertyError, match=word):
        make()


ENDS = {
    "rectangle": ({"b": 0.05, "h": 0.1}, {"b": 0.03, "h": 0.04}),
    "hollow_rectangle": ({"b": 0.08, "h": 0.12, "t": 0.004}, {"b": 0.05, "h": 0.06, "t": 0.003}),
    "circle": ({"d": 0.05}, {"d": 0.02}),
    "tube": ({"d": 0.05, "t": 0.003}, {"d": 0.2, "t": 0.01}),
    "i_section": (
        {"b": 0.1, "h": 0.2, "tf": 0.012, "tw": 0.007},
        {"b": 0.1, "h": 0.1, "tf": 0.012, "tw": 0.006},
    ),
}
CONSTANTS = ("A", "Iy", "Iz", "J", "ky", "kz", "Ip")


def constants(section):
    return np.array([getattr(section, key) for key in CONSTANTS])


@pytest.mark.parametrize("shape", SHAPES)
def test_between_two_ends_of_a_shape_the_dimensions_are_linear(shape):
    one, two = ENDS[shape]
    first, second = Section.of_shape(shape, **one), Section.of_shape(shape, **two)
    for fraction in (0.0, 0.3, 1.0):
        expected = Section.of_shape(
            shape, **{key: (1 - fraction) * one[key] + fraction * two[key] for key in one}
        )
        found = Section.between(first, second, fraction)
        np.testing.assert_allclose(constants(found), constants(expected), rtol=1e-14)
        for a, b in zip(found.outlines, expected.outlines, strict=True):
            np.testing.assert_allclose(a, b, atol=1e-15)
        assert found.shape == shape
        # the same from the other end
        np.testing.assert_allclose(
            constants(Section.between(second, first, 1 - fraction)), constants(found), rtol=1e-13
        )


def test_between_constants_is_exact_for_scaled_ends():
    # a section scaled by s has A s² and I s⁴; a linear s is what the roots interpolate
    one = Section(A=1e-4, Iy=2e-9, Iz=1e-9, J=5e-10, ky=0.8, kz=0.6)
    two = Section(A=9e-4, Iy=162e-9, Iz=81e-9, J=405e-10, ky=0.8, kz=0.6)
    s = 1 + 2 * 0.25
    found = Section.between(one, two, 0.25)
    expected = Section(A=1e-4 * s**2, Iy=2e-9 * s**4, Iz=1e-9 * s**4, J=5e-10 * s**4, ky=0.8, kz=0.6)
    np.testing.assert_allclose(constants(found), constants(expected), rtol=1e-14)
    assert Section.between(one, two, 0) is one
    assert Section.between(one, two, 1) is two


def test_between_says_what_has_no_middle():
    box, tube = Section.hollow_rectangle(0.08, 0.12, 0.004), Section.tube(0.05, 0.003)
    plain = Section(A=1e-4, Iy=2e-9, Iz=1e-9, J=5e-10)
    with pytest.raises(PropertyError, match="shape 'hollow_rectangle' and a section of shape 'tube'"):
        Section.between(box, tube, 0.5)
    with pytest.raises(PropertyError, match=r"given by its constants: .* same shape"):
        Section.between(tube, plain, 0.5)
    with pytest.raises(PropertyError, match=r"is 1\.5; it must lie between 0 and 1"):
        Section.between(tube, tube, 1.5)
    with pytest.raises(PropertyError, match="no shape 'tub'; there are rectangle"):
        Section.of_shape("tub", d=1.0)
