"""Formulas of sections against finite elements of torsion and shear, where sectionproperties is installed."""

import numpy as np
import pytest

from fem import PropertyError, Section

pytest.importorskip("sectionproperties", reason="needs dovetail[sections]")

N_SIDES = 60


def ring(b, h):
    phi = np.linspace(0, 2 * np.pi, N_SIDES, endpoint=False)
    return np.column_stack([b / 2 * np.cos(phi), h / 2 * np.sin(phi)])


def errors(section, n_triangles=400):
    """Return how far J, ky and kz of the formulas lie above those of finite elements."""
    fe = Section.arbitrary(section.outlines[0], section.outlines[1:], n_triangles=n_triangles)
    assert (section.A, section.Iy, section.Iz) == pytest.approx((fe.A, fe.Iy, fe.Iz), rel=1e-9)
    return np.array([getattr(section, key) / getattr(fe, key) - 1 for key in ("J", "ky", "kz")])


def test_solid_and_thick_sections_agree():
    assert abs(errors(Section.rectangle(1, 2))).max() < 2e-4  # exact formulas: what the triangles leave
    for section, outlines in (
        (Section.ellipse(1, 2), [ring(1, 2)]),
        (Section.tube(1, 0.15), [ring(1, 1), ring(0.7, 0.7)]),
    ):
        fe = Section.arbitrary(outlines[0], outlines[1:], n_triangles=400)
        short = (
            2 * np.pi / N_SIDES
        ) ** 2  # an inscribed polygon: A short by a sixth of this, I and J by a third
        assert pytest.approx(short / 6, rel=0.01) == section.A / fe.A - 1
        assert section.Iy / fe.Iy - 1 == pytest.approx(short / 3, rel=0.01)
        assert pytest.approx(short / 3, rel=0.1) == section.J / fe.J - 1
        assert (section.ky, section.kz) == pytest.approx((fe.ky, fe.kz), rel=5e-4)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("shape", "sizes", "ratio"),
    [
        ("hollow_rectangle", {"b": 1, "h": 2}, 2),
        ("hollow_polygon", {"n": 8, "d": 1}, 2),
        ("angle_section", {"b": 1, "h": 1}, (2, 4)),  # across its axis of symmetry of second order
        ("cruciform", {"b": 1, "h": 1.5}, 2),
    ],
)
def test_thin_walls_err_by_their_thickness(shape, sizes, ratio):
    # the theory of thin walls is the limit: half the thickness, half the error, to the next order in t
    thick, thin = (errors(Section.of_shape(shape, **sizes, t=t), 1500) for t in (0.06, 0.03))
    np.testing.assert_allclose(thick[1:] / thin[1:], ratio, rtol=0.2)
    assert abs(thick[1:]).max() < 0.06
    # open: the ends and corners are counted; closed: corners are stiffer than Bredt's walls by a like measure
    assert abs(thick[0]) < (0.03 if shape.startswith("hollow") else 0.006)


@pytest.mark.slow
@pytest.mark.parametrize(
    "section",
    [
        Section.i_section(1, 2, 0.1, 0.06),
        Section.unequal_i_section(1, 0.5, 1.2, 0.1, 0.08, 0.06),
        Section.t_section(1, 1, 0.1, 0.1),
        Section.channel(0.5, 1, 0.06, 0.04),
        Section.channel(0.5, 1, 0.04, 0.06),
        Section.angle_section(1, 1, 0.1),
        Section.cruciform(1, 1.5, 0.1),
    ],
    ids=lambda s: s.label,
)
def test_open_walls(section):
    fe = Section.arbitrary(section.outlines[0], n_triangles=800)
    # the fits of junctions and corners are within 0.04 t⁴, t the thickest wall; J of so few triangles is up
    # to 0.1 % too high
    sizes = section.dimensions
    t = max(value for key, value in sizes.items() if key.startswith("t"))
    junctions = 2 if "i_" in section.shape or section.shape == "channel" else 1
    assert pytest.approx(fe.J, abs=0.04 * junctions * t**4 + 1e-3 * fe.J) == section.J
    # where walls overlap they bear more shear: of the order of t over the width
    overlap = t / min(value for key, value in sizes.items() if key[0] in "bh")
    assert -0.8 * overlap < section.ky / fe.ky - 1 < 0
    assert -0.8 * overlap < section.kz / fe.kz - 1 < 0
    np.testing.assert_allclose(section.shear_centre, fe.shear_centre, atol=0.1 * t)


def test_a_turned_polygon_has_turned_axes():
    outline = np.array([(0, 0), (1, 0), (1, 0.3), (0.3, 0.3), (0.3, 1.5), (0, 1.5)])
    c, s = np.cos(0.2), np.sin(0.2)
    one = Section.arbitrary(1e-2 * outline, n_triangles=300)
    two = Section.arbitrary(1e-2 * outline @ np.array([[c, s], [-s, c]]) + 7, n_triangles=300)
    assert two.angle - one.angle == pytest.approx(0.2, abs=1e-9)
    for key in ("J", "ky", "kz"):  # other triangles, as fine
        assert getattr(two, key) == pytest.approx(getattr(one, key), rel=2e-3)
    np.testing.assert_allclose(two.shear_centre, one.shear_centre, atol=1e-4 * 1e-2)


def test_shapely_brings_its_holes_and_nonsense_is_refused():
    shapely = pytest.importorskip("shapely")
    box, hole = [(0, 0), (2, 0), (2, 1), (0, 1)], [(0.2, 0.2), (1.8, 0.2), (1.8, 0.8), (0.2, 0.8)]
    one = Section.arbitrary(shapely.Polygon(box, [hole]), n_triangles=300)
    two = Section.arbitrary(box, [hole], n_triangles=300)
    assert pytest.approx((two.A, two.J), rel=1e-12) == (one.A, one.J)
    with pytest.raises(PropertyError, match="crosses itself"):
        Section.arbitrary([(0, 0), (2, 1), (2, 0), (0, 1.5)], n_triangles=100)
