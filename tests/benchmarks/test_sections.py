"""Constants of sections against textbook formulas, and against integrals over their outlines."""

import numpy as np
import pytest

from fem.properties import PropertyError, Section


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
