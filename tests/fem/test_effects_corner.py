"""Corners of finite size: where their zones are, and that they do what smaller members would."""

from dataclasses import replace

import numpy as np
import pytest

from fem import Frame, Material, MemberProperties, Mesh, Model, Section, assemble, solve_modes
from fem.effects import SolidCorner
from tests.frames import STEEL, braced, fix, portal, welded

NOTHING = Material("nothing", 100 * STEEL.E, 1e-9, nu=STEEL.nu)
"""Stiff, and without mass."""
MASSLESS = replace(NOTHING, name="massless", E=STEEL.E)
HARD = replace(STEEL, name="hard", E=100 * STEEL.E)


def corner_of(model, **values):
    (effect,) = SolidCorner.propose(model)
    return effect.with_values(**values)


def frequencies(model, n=10):
    return solve_modes(assemble(model), n=n).frequency


def test_zones_have_the_depth_of_what_they_are_in_and_the_mass_of_what_ends_there():
    model = welded()
    effect = corner_of(model)
    assert effect.n_corners == 2
    assert effect.where == "2 welded corners"
    zones = {(z.member, z.start, z.towards): (z.depth, z.factor, z.overlap) for z in effect.zones}
    # the column is 20 mm wide along the beam (its h lies along x), the beam 16 mm high, the arm 20 mm wide;
    # at the second corner nothing goes through: of two ends neither has too much
    assert zones == {
        ("column", 0.3, 1): pytest.approx((0.008, 0.5, 0.0)),
        ("column", 0.3, -1): pytest.approx((0.008, 0.5, 0.0)),
        ("beam", 0.0, 1): pytest.approx((0.01, 1.0, 1.0)),
        ("beam", 0.35, -1): pytest.approx((0.01, 1.0, 0.0)),
        ("arm", 0.0, 1): pytest.approx((0.01, 1.0, 0.0)),
    }
    np.testing.assert_allclose(effect.locations(model), [[0, 0, 0.3], [0.35, 0, 0.3]], atol=1e-9)


@pytest.mark.parametrize(("size", "factor", "rigid"), [(1.0, 0.6, 0.0), (1.4, 0.5, 0.0), (1.0, 0.8, 0.004)])
def test_a_corner_does_what_stiff_and_massless_pieces_of_its_members_do(size, factor, rigid):
    """The column between 0.3 -+ half of the zone, the beam's first stretch, both ends of the other corner."""
    start = 0.01 * size  # of the beam inside of the column
    stiff, panel, end = factor * start, 0.5 * factor * 0.008 * size, factor * 0.01 * size
    up, across, along = [0, 0, 1], [1, 0, 0], [0, 1, 0]
    pieces = []  # from, to, section, material, orientation

    def piece(a, b, origin, direction, section, material, **options):
        ends = [np.array(origin) + s * np.array(direction) for s in (a, b)]
        pieces.append((*ends, MemberProperties(material, section, **options)))

    sections = [Section.rectangle(0.03, 0.02), Section.rectangle(0.02, 0.016), Section.rectangle(0.02, 0.012)]
    for a, b, material in (
        (0.0, 0.3 - panel, STEEL),
        (0.3 - panel, 0.3, HARD),
        (0.3, 0.3 + panel, HARD),
        (0.3 + panel, 0.42, STEEL),
    ):
        piece(a, b, [0, 0, 0], up, sections[0], material, orientation=(1, 0, 0))
    for a, b, material in (
        (0.0, stiff, NOTHING),
        (stiff, start, MASSLESS),
        (start, 0.35 - end, STEEL),
        (0.35 - end, 0.35, HARD),
    ):
        piece(a, b, [0, 0, 0.3], across, sections[1], material)
    for a, b, material in ((0.0, end, HARD), (end, 0.25, STEEL)):
        piece(a, b, [0.35, 0, 0.3], along, sections[2], material)
    points, where = [], {}
    for ends in pieces:
        for p in ends[:2]:
            where.setdefault(tuple(np.round(p, 9)), len(where))
    points = np.array(list(where))
    lines = [[where[tuple(np.round(p, 9))] for p in ends[:2]] for ends in pieces]
    mesh = Mesh.from_lines(points, lines, {f"p{i}": [i] for i in range(len(lines))}).refined(0.02)
    built = Model(mesh, (Frame(members={f"p{i}": p[2] for i, p in enumerate(pieces)}), fix(0, name="foot")))

    model = welded(0.02, rigid1=rigid)
    plain, solid = (
        frequencies(model),
        frequencies(model.with_effect(corner_of(model, size=size, rigid_zone_factor=factor))),
    )
    # what the elements' shapes do in pieces of their own: the rotary inertia of the zones is not taken away,
    # and a rigid zone of 4 mm, which the piece is not, is a hundredth stiffer than 100 times as stiff
    np.testing.assert_allclose(solid, frequencies(built), rtol=3e-4)
    assert (abs(solid / plain - 1) > 3e-3).sum() >= 5


def test_members_that_go_on_in_another_go_through():
    """A cross of four ends, two of them in line each: the larger goes through, and the others end in it."""
    points = [[0, 0, 0], [-0.3, 0, 0], [0.3, 0, 0], [0, -0.3, 0], [0, 0.3, 0]]
    mesh = Mesh.from_lines(points, [[1, 0], [0, 2], [3, 0], [0, 4]], {k: [i] for i, k in enumerate("abcd")})
    wide, flat = Section.rectangle(0.04, 0.04), Section.rectangle(0.02, 0.01)
    members = {m: MemberProperties(STEEL, wide if m in "ab" else flat) for m in "abcd"}
    zones = corner_of(Model(mesh, (Frame(members=members),))).zones
    assert {z.member: (z.depth, z.factor, z.overlap) for z in zones} == {
        "a": pytest.approx((0.01, 0.5, 0.0)),
        "b": pytest.approx((0.01, 0.5, 0.0)),
        "c": pytest.approx((0.02, 0.5, 1.0)),
        "d": pytest.approx((0.02, 0.5, 1.0)),
    }


def test_three_ends_at_a_corner_fill_one_block_and_a_brace_is_longer_inside():
    points = [[0, 0, 0], [0.3, 0, 0], [0, 0.3, 0], [0, 0, 0.3], [0.3, 0, 0.3]]
    square = MemberProperties(STEEL, Section.rectangle(0.02, 0.02))

    def zones_of(ends):
        mesh = Mesh.from_lines(points, [[0, e] for e in ends], {f"m{e}": [i] for i, e in enumerate(ends)})
        return corner_of(Model(mesh, (Frame(members=dict.fromkeys(mesh.members, square)),))).zones

    three = zones_of([1, 2, 3])
    assert [z.overlap for z in three] == [pytest.approx(1 / 3)] * 3
    assert [z.depth for z in three] == [pytest.approx(0.01)] * 3
    brace = next(z for z in zones_of([1, 4]) if z.member == "m4")
    assert brace.depth == pytest.approx(0.01 * np.sqrt(2))


def test_what_has_no_corner_has_no_candidate():
    assert SolidCorner.propose(portal()) == ()  # its joints are not welds
    assert SolidCorner.propose(braced()) == ()  # a bar and a mast that is hinged
    model = welded()
    (frame,) = model.of_kind(Frame)
    bare = {m: replace(p, section=replace(p.section, outlines=())) for m, p in frame.members.items()}
    assert SolidCorner.propose(Model(model.mesh, (Frame(members=bare),))) == ()
    hinged = welded(release1=("ry",))
    (left,) = SolidCorner.propose(hinged)
    assert left.n_corners == 1
    assert {z.member for z in left.zones} == {"beam", "arm"}


def test_members_that_taper_are_offset_or_curve_have_none():
    thin = Section.rectangle(0.02, 0.016)
    for change in ({"section2": Section.rectangle(0.01, 0.008)}, {"offset1": np.array([0.01, 0, 0])}):
        (left,) = SolidCorner.propose(welded(**change)) or (None,)
        assert left is None  # the beam is at both corners
    turn = [[np.cos(a), np.sin(a), 0] for a in np.linspace(0, np.pi / 2, 4)]
    mesh = Mesh.from_lines(turn, [[0, 1], [1, 2], [2, 3]], {"arc": [0, 1, 2]})
    curved = Model(mesh, (Frame(members={"arc": MemberProperties(STEEL, thin)}), fix(0, name="foot")))
    assert SolidCorner.propose(curved) == ()


def test_corners_of_no_size_begin_smoothly():
    model = welded()
    zero = corner_of(model, size=1e-200j)
    small = corner_of(model, size=1e-6)
    for k, key in enumerate(("K", "M")):
        slope = np.imag(getattr(zero.contribute(model)[k], key)) / 1e-200
        step = getattr(small.contribute(model)[k], key) / 1e-6
        assert np.abs(step).max() > 0
        np.testing.assert_allclose(slope, step, atol=1e-4 * np.abs(step).max())


def test_zones_of_neighbouring_corners_never_meet():
    """Two beams 20 mm apart on a column: zones twice as large as drawn would overlap."""
    points = [[0, 0, 0], [0, 0, 0.3], [0, 0, 0.32], [0, 0, 0.6], [0.3, 0, 0.3], [0.3, 0, 0.32]]
    lines = [[0, 1], [1, 2], [2, 3], [1, 4], [2, 5]]
    mesh = Mesh.from_lines(points, lines, {"column": [0, 1, 2], "low": [3], "high": [4]})
    deep = MemberProperties(STEEL, Section.rectangle(0.03, 0.06))
    model = Model(mesh, (Frame(members=dict.fromkeys(mesh.members, deep)), fix(0, name="foot")))
    largest = corner_of(model, size=2.0, rigid_zone_factor=1.0)
    assert sorted(z.longest for z in largest.zones if z.member == "column")[:2] == [pytest.approx(0.009)] * 2
    plain, solid = (frequencies(m, 4) for m in (model, model.with_effect(largest)))
    assert np.isfinite(solid).all()
    assert (solid > plain).all()
