"""Frame models of Abaqus decks: each family of keywords against a closed form."""

import numpy as np
import pytest

from fem import DIRECTIONS, MeshError
from fem.io import DeckUnits
from tests.fem.io.abaqus_decks import CLAMPED, RECT, RHO, STEEL, E, L, cantilever, deck_of, frequencies, line

A, I11, I22 = 6e-4, 0.02 * 0.03**3 / 12, 0.03 * 0.02**3 / 12
FIRST_MESH_ERROR = (1.8751 / 10) ** 4 / 1440  # of ten cubic elements

Z = "0, 0, -1"


# Bars and sections --------------------------------------------------------------------------------------


def test_a_is_along_1_and_b_along_2(tmp_path):
    f = frequencies(tmp_path, line() + STEEL + RECT + CLAMPED, 2)
    np.testing.assert_allclose(f, [cantilever(0, I22, A), cantilever(0, I11, A)], rtol=2 * FIRST_MESH_ERROR)
    deck = deck_of(tmp_path, line() + STEEL + RECT + CLAMPED)
    np.testing.assert_allclose(deck.bars.height, np.tile([0, 1, 0], (10, 1)), atol=1e-15)  # n2 = x × -z


@pytest.mark.parametrize(
    ("end", "n1", "n2"),
    [
        ((0, 0, 2), "1, 0, 0", (0, 1, 0)),
        ((0, 2, 0), Z, (-1, 0, 0)),
        ((0, 2, 0), None, (-1, 0, 0)),
        ((2, 0, 0), "5, 1, 1", (0, -np.sqrt(0.5), np.sqrt(0.5))),  # n1 need not be normal to the axis
    ],
)
def test_section_axes(tmp_path, end, n1, n2):
    text = line(1, end=end) + STEEL + RECT.replace("0, 0, -1\n", f"{n1}\n" if n1 else "")
    np.testing.assert_allclose(deck_of(tmp_path, text).bars.height, [n2], atol=1e-15)


def test_a_further_node_gives_n1(tmp_path):
    text = "*NODE\n1, 0, 0, 0\n2, 1, 0, 0\n9, 0, 3, 0\n*ELEMENT, TYPE=B31, ELSET=BAR\n1, 1, 2, 9\n"
    np.testing.assert_allclose(deck_of(tmp_path, text + STEEL + RECT).bars.height, [[0, 0, 1]])


def shape_of(folder, kind, dimensions, keyword=""):
    text = f"*BEAM SECTION, ELSET=BAR, MATERIAL=STEEL, SECTION={kind}\n{dimensions}\n0, 0, -1\n{keyword}"
    deck = deck_of(folder, line(1) + STEEL + text)
    section = deck.properties[0].section
    y, z = deck.bars.height[0] @ np.array([[0, 0], [0, 1], [-1, 0]]), deck.bars.height[0]
    assert abs(z[1]) == 1  # along n2 = global y, or against it
    offset = deck.bars.offsets[0, 0]
    return section, np.array([-offset[2], offset[1]]), y


def second_moments(rectangles):
    """Return A, I11, I12, I22 about the centroid, and the centroid, of rectangles (x1, x2, width, height)."""
    r = np.array(rectangles, dtype=float)
    area = r[:, 2] * r[:, 3]
    place = r[:, :2]
    centre = area @ place / area.sum()
    d = place - centre
    own = area / 12 * r[:, 3] ** 2, area / 12 * r[:, 2] ** 2
    return (
        area.sum(),
        (own[0] + area * d[:, 1] ** 2).sum(),
        (area * d[:, 0] * d[:, 1]).sum(),
        (own[1] + area * d[:, 0] ** 2).sum(),
        centre,
    )


def about_1_2(section):
    """Return I11, I12 and I22 of a section by its principal ones."""
    c, s = np.cos(section.angle), np.sin(section.angle)
    Iy, Iz = section.Iy, section.Iz
    return Iy * c * c + Iz * s * s, (Iz - Iy) * s * c, Iy * s * s + Iz * c * c


EQUAL_I = ".05, .1, .06, .06, .01, .01, .004"
UNEQUAL_I = "0., .1, .08, .05, .01, .006, .004"
SHAPES = [  # rectangles about the node: centres along 1 and 2, width along 1, height along 2
    ("RECT", ".02, .03", [(0, 0, 0.02, 0.03)]),
    ("RECTANGULAR", ".02, .03", [(0, 0, 0.02, 0.03)]),
    ("BOX", ".06, .1, .002, .003, .002, .003", [(0, 0, 0.06, 0.1), (0, 0, 0.056, -0.094)]),
    ("BOX", ".06, .1, .002, .003, .004, .005", [(0, 0, 0.06, 0.1), (0.001, 0.001, 0.054, -0.092)]),
    ("I", EQUAL_I, [(0, k, 0.06, 0.01) for k in (-0.045, 0.045)] + [(0, 0, 0.004, 0.08)]),
    ("I", UNEQUAL_I, [(0, 0.005, 0.08, 0.01), (0, 0.097, 0.05, 0.006), (0, 0.052, 0.004, 0.084)]),
    ("I", ".02, .1, 0, .05, 0, .006, .004", [(0, 0.077, 0.05, 0.006), (0, 0.027, 0.004, 0.094)]),
    ("I", ".02, .1, .05, 0, .006, 0, .004", [(0, -0.017, 0.05, 0.006), (0, 0.033, 0.004, 0.094)]),
    ("L", ".05, .08, .006, .004", [(0.023, 0, 0.05, 0.006), (0, 0.04, 0.004, 0.074)]),
]


@pytest.mark.parametrize(("kind", "dimensions", "rectangles"), SHAPES)
def test_shapes_by_rectangles(tmp_path, kind, dimensions, rectangles):
    section, offset, _ = shape_of(tmp_path, kind, dimensions)
    area, i11, i12, i22, centre = second_moments(rectangles)
    np.testing.assert_allclose([section.A, *about_1_2(section)], [area, i11, i12, i22], rtol=1e-9, atol=1e-18)
    np.testing.assert_allclose(offset, centre, atol=1e-12)


def test_other_shapes(tmp_path):
    circle, _, _ = shape_of(tmp_path, "CIRC", ".01")
    assert pytest.approx(np.pi * 1e-4) == circle.A
    for kind in ("PIPE", "THICK PIPE"):
        tube, _, _ = shape_of(tmp_path, kind, ".02, .003")
        assert pytest.approx(np.pi * (0.02**2 - 0.017**2)) == tube.A
    hexagon, _, _ = shape_of(tmp_path, "HEX", ".02, .0001")
    assert pytest.approx(6 * 0.02 * 1e-4, rel=0.005) == hexagon.A  # sides as long as the radius, thin
    trapezoid, offset, _ = shape_of(tmp_path, "TRAPEZOID", ".04, .03, .02, .01")
    assert pytest.approx(9e-4) == trapezoid.A
    np.testing.assert_allclose(offset, [0, 0.03 * (0.04 + 2 * 0.02) / (3 * 0.06) - 0.01], atol=1e-15)
    a, b, h = 0.04, 0.02, 0.03
    assert trapezoid.Iy == pytest.approx(h**3 * (a * a + 4 * a * b + b * b) / (36 * (a + b)))


def test_arbitrary_is_the_box_of_thin_walls(tmp_path):
    segments = "4, -.03, -.05, .03, -.05, .0002\n.03, .05, .0002\n-.03, .05, .0002\n-.03, -.05, .0002"
    found, offset, _ = shape_of(tmp_path, "ARBITRARY", segments)
    box, _, _ = shape_of(tmp_path, "BOX", ".0602, .1002, .0002, .0002, .0002, .0002")
    for key in ("A", "Iy", "Iz", "J"):
        assert getattr(found, key) == pytest.approx(getattr(box, key), rel=0.01), key
    assert (found.ky, found.kz) == pytest.approx((box.ky, box.kz), rel=0.1)  # another formula, with ν
    np.testing.assert_allclose(offset, 0, atol=1e-15)


def test_arbitrary_open_section_has_its_centroid_off_the_node(tmp_path):
    found, offset, _ = shape_of(tmp_path, "ARBITRARY", "2, .05, 0, 0, 0, .001\n0, .08, .001")
    area, i11, i12, i22, centre = second_moments([(0.025, 0, 0.05, 1e-3), (0, 0.04, 1e-3, 0.08)])
    np.testing.assert_allclose([found.A, *about_1_2(found)], [area, i11, i12, i22], rtol=1e-3)
    np.testing.assert_allclose(offset, centre, atol=1e-12)
    assert pytest.approx(0.13 * 1e-9 / 3) == found.J


GENERAL = "*BEAM GENERAL SECTION, SECTION=GENERAL, ELSET=BAR, DENSITY=7800.\n"


def test_general_section_with_i12_is_a_turned_rectangle(tmp_path):
    turn = 0.4
    c, s = float(np.cos(turn)), float(np.sin(turn))
    i11, i22, i12 = I11 * c * c + I22 * s * s, I11 * s * s + I22 * c * c, (I11 - I22) * s * c
    text = GENERAL + f"{A}, {i11!r}, {i12!r}, {i22!r}, 1e-8\n0, 0, -1\n{E}, {E / 2.6}\n"
    f = frequencies(tmp_path, line() + text + CLAMPED, 2)
    np.testing.assert_allclose(f, [cantilever(0, I22, A), cantilever(0, I11, A)], rtol=2 * FIRST_MESH_ERROR)


def test_general_section_keeps_g_beyond_poissons_ratio(tmp_path):
    J, G = 1e-8, E / 10  # ν would be 4
    text = GENERAL + f"{A}, {I11}, 0, {I22}, {J}\n{Z}\n{E}, {G}\n"
    deck = deck_of(tmp_path, line(kind="B31") + text)
    prop = deck.properties[0]
    assert pytest.approx(G * J) == prop.material.G * prop.section.J
    assert prop.material.G * prop.section.ky * A == pytest.approx(G * A)  # Abaqus: k = 1


def test_transverse_shear_stiffness_and_centroid(tmp_path):
    text = GENERAL + f"{A}, {I11}, 0, {I22}, 1e-8\n{Z}\n{E}, {E / 2.6}\n"
    text += "*TRANSVERSE SHEAR STIFFNESS\n2e7, 1e7, .25\n*CENTROID\n.01, .02\n"
    deck = deck_of(tmp_path, line(1, "B31") + text)
    section, G = deck.properties[0].section, E / 2.6
    np.testing.assert_allclose([section.kz * G * A, section.ky * G * A], [2e7, 1e7])
    np.testing.assert_allclose(deck.bars.offsets[0], [[0, 0.02, -0.01]] * 2, atol=1e-15)


def test_offsets_of_calculix(tmp_path):
    text = RECT.replace("RECT\n", "RECT, OFFSET1=0.5, OFFSET2=-1\n")
    deck = deck_of(tmp_path, line(1, "B31") + STEEL + text)
    # ccx 2.20 expands these to z of 0 to 0.02 and y of 0.015 to 0.045
    np.testing.assert_allclose(deck.bars.offsets[0], [[0, 0.03, 0.01]] * 2, atol=1e-15)


def test_calculix_circle_is_given_by_its_diameter(tmp_path):
    text = line(2, "B31").replace("*ELEMENT", "*NODE\n7, 0, 0, 1\n8, 0, 0, 2\n*ELEMENT", 1)
    text += "*ELEMENT, TYPE=B32R, ELSET=BAR\n9, 1, 7, 8\n" + STEEL
    text += "*BEAM SECTION, ELSET=BAR, MATERIAL=STEEL, SECTION=CIRC\n.02\n0, 1, 0\n"
    assert pytest.approx(np.pi * 1e-4) == deck_of(tmp_path, text).properties[0].section.A


def test_theories_and_elements_of_three_nodes(tmp_path):
    text = "*NODE\n1, 0\n2, 1\n3, 2\n4, 3\n*ELEMENT, TYPE=B32, ELSET=BAR\n5, 1, 2, 3\n"
    text += "*ELEMENT, TYPE=B33, ELSET=BAR\n6, 3, 4\n" + STEEL + RECT + "*RELEASE\n5, S2, M1\n"
    deck = deck_of(tmp_path, text)
    assert deck.bars.numbers.tolist() == [5, 5, 6]
    assert [deck.properties[k].theory for k in deck.bars.properties] == ["timoshenko"] * 2 + [
        "euler-bernoulli"
    ]
    assert [p.name for p in deck.properties] == ["BAR", "BAR 2"]
    assert np.argwhere(deck.bars.stiffness == 0).tolist() == [[1, 1, 4]]  # S2 is the end of the second bar


def test_released_ends_are_hinges(tmp_path):
    text = line() + STEEL + RECT + "*BOUNDARY\n1, 1, 6\n11, 1, 6\n*RELEASE\n1, S1, M1-M2\n10, S2, M1-M2\n"
    expected = np.pi / (2 * L**2) * np.sqrt(E * np.array([I22, I11]) / (RHO * A))
    np.testing.assert_allclose(frequencies(tmp_path, text, 2), expected, rtol=(np.pi / 10) ** 4 / 1000)


def test_planar_elements_move_in_their_plane(tmp_path):
    text = line(kind="B23") + STEEL + RECT + "*BOUNDARY\n1, 1, 2\n11, 2\n"
    f = frequencies(tmp_path, text, 2)
    expected = np.pi / (2 * L**2) * np.array([1, 4]) * np.sqrt(E * I11 / (RHO * A))  # b is in the plane
    np.testing.assert_allclose(f, expected, rtol=1.1 * (2 * np.pi / 10) ** 4 / 1440)


def test_generated_elements_have_their_type(tmp_path):
    text = "*NODE\n1, 0\n11, 2\n*NGEN\n1, 11\n*ELEMENT, TYPE=B33\n1, 1, 2\n*ELGEN, ELSET=BAR\n1, 10\n"
    f = frequencies(tmp_path, text + STEEL + RECT + CLAMPED, 1)
    assert f[0] == pytest.approx(cantilever(0, I22, A), rel=2 * FIRST_MESH_ERROR)


def test_trusses(tmp_path):
    text = "*NODE\n1, 0, 0, 0\n2, 2, 0, 0\n*ELEMENT, TYPE=T3D2, ELSET=BAR\n1, 1, 2\n" + STEEL
    text += "*SOLID SECTION, ELSET=BAR, MATERIAL=STEEL\n1e-4\n"
    text += "*ELEMENT, TYPE=MASS, ELSET=M\n2, 2\n*MASS, ELSET=M\n50\n"
    text += "*BOUNDARY\n1, PINNED\n2, 2, 3\n"
    stiffness, mass = E * 1e-4 / L, 50 + RHO * 1e-4 * L / 3  # a third of a linear element's mass
    assert frequencies(tmp_path, text, 1)[0] == pytest.approx(
        np.sqrt(stiffness / mass) / (2 * np.pi), rel=1e-6
    )


@pytest.mark.parametrize(
    ("units", "factor"),
    [
        ("TOTAL MASS\n7.0", 7 / (RHO * A * L)),
        ("MASS PER LENGTH\n3.5", 3.5 / (RHO * A)),
        ("MASS PER VOLUME\n1000", 1000 / RHO),
    ],
)
def test_non_structural_mass(tmp_path, units, factor):
    text = line() + STEEL + RECT + CLAMPED + f"*NONSTRUCTURAL MASS, ELSET=BAR, UNITS={units}\n"
    expected = cantilever(0, I22, A) / np.sqrt(1 + factor)
    assert frequencies(tmp_path, text, 1)[0] == pytest.approx(expected, rel=1e-5)


def test_materials_have_damping(tmp_path):
    text = STEEL + "*DAMPING, ALPHA=2., BETA=1e-4, STRUCTURAL=.02\n"
    deck = deck_of(tmp_path, line() + text + RECT, DeckUnits(1e-3, 1e3, 1e-3))
    assert deck.damping is not None
    assert (deck.damping.alpha, deck.damping.beta) == pytest.approx((2000, 1e-7))
    assert deck.properties[0].material.loss_factor == 0.02


def test_units(tmp_path):
    steel = "*MATERIAL, NAME=STEEL\n*ELASTIC\n2.1e5, 0.3\n*DENSITY\n7.8e-9\n"
    text = line(end=(2000.0, 0.0, 0.0)) + steel + RECT.replace("0.02, 0.03", "20, 30")
    text += "*ELEMENT, TYPE=MASS, ELSET=M\n90, 11\n*MASS, ELSET=M\n1e-3\n" + CLAMPED
    other = line() + STEEL + RECT + "*ELEMENT, TYPE=MASS, ELSET=M\n90, 11\n*MASS, ELSET=M\n1.\n" + CLAMPED
    f = frequencies(tmp_path, text, 4, DeckUnits(1e-3, 1e3, 1.0))
    np.testing.assert_allclose(f, frequencies(tmp_path, other, 4), rtol=1e-9)


PART = (
    f"*PART, NAME=P\n{line()}{RECT}*ELEMENT, TYPE=MASS, ELSET=TIP\n90, 11\n*MASS, ELSET=TIP\n1.\n*END PART\n"
)


def test_instances(tmp_path):
    text = PART + "*ASSEMBLY, NAME=A\n*INSTANCE, NAME=ONE, PART=P\n*END INSTANCE\n"
    text += "*INSTANCE, NAME=TWO, PART=P\n0, 0, 5\n0, 0, 5, 0, 1, 5, 90.\n*END INSTANCE\n"
    text += (
        "*NSET, NSET=FOOT, INSTANCE=ONE\n1\n*END ASSEMBLY\n" + STEEL + "*BOUNDARY\nFOOT, 1, 6\nTWO.1, 1, 6\n"
    )
    deck = deck_of(tmp_path, text)
    np.testing.assert_allclose(deck.bars.height[[0, 10]], [[0, 1, 0], [0, 1, 0]], atol=1e-15)
    np.testing.assert_allclose(deck.points[-1], [0, 0, 3], atol=1e-15)
    assert len(deck.properties) == 1
    assert sorted(deck.supports) == [0, 11]
    one = frequencies(
        tmp_path,
        line() + STEEL + RECT + "*ELEMENT, TYPE=MASS, ELSET=T\n90, 11\n*MASS, ELSET=T\n1.\n" + CLAMPED,
    )
    np.testing.assert_allclose(frequencies(tmp_path, text, 8), np.repeat(one, 2), rtol=1e-8)


CAE = f"""*Heading
** Job name: a Model name: Model-1
*Preprint, echo=NO, model=NO, history=NO, contact=NO
*Part, name=Part-1
*Node
      1,           0.,           0.,           0.
      2,           1.,           0.,           0.
      3,           2.,           0.,           0.
*Element, type=B31
1, 1, 2
2, 2, 3
*Nset, nset=_PickedSet2, internal, generate
 1,  3,  1
*Elset, elset=_PickedSet2, internal, generate
 1,  2,  1
** Section: Section-1  Profile: Profile-1
*Beam Section, elset=_PickedSet2, material=Material-1, temperature=GRADIENTS, section=RECT
0.02, 0.03
0.,0.,-1.
*End Part
*Assembly, name=Assembly
*Instance, name=Part-1-1, part=Part-1
*End Instance
*Nset, nset=Set-1, instance=Part-1-1
 1,
*Nset, nset=_PickedSet8_CNS_, internal, instance=Part-1-1
 3,
*Element, type=MASS, elset=Set-2_Inertia-1_
1, Part-1-1.3
*End Assembly
*Material, name=Material-1
*Density
{RHO},
*Elastic
{E}, 0.3
*Boundary
Set-1, ENCASTRE
*Step, name=Step-1, nlgeom=NO, perturbation
*Frequency, eigensolver=Lanczos, sim=NO, acoustic coupling=on, normalization=mass
10, , , , ,
*Restart, write, frequency=0
*Output, field, variable=PRESELECT
*End Step
"""


def test_a_deck_of_the_preprocessor(tmp_path):
    mass = "*Mass, elset=Set-2_Inertia-1_\n1e5,\n"
    text = CAE.replace(
        "*End Assembly",
        f"{mass}*Element, type=Spring1, elset=S\n2, Part-1-1.3\n"
        "*Spring, elset=S\n3\n1e6\n*Nset, nset=N, elset=S\n*End Assembly",
    )
    deck = deck_of(tmp_path, text.replace("*Step", "*Boundary\nN, 2, 2\n*Step"))
    assert deck.supports == {0: DIRECTIONS, 2: ("y",)}
    assert ([b.node for b in deck.bodies], [c.nodes for c in deck.connections]) == ([2], [(2, None)])
    assert len(deck.nodes) == 3
    f = frequencies(tmp_path, text, 1)[0]
    assert f == pytest.approx(
        np.sqrt(3 * E * I11 / L**3 / 1e5) / (2 * np.pi), rel=2e-3
    )  # along y, shear left out
    with pytest.raises(MeshError, match=r"a.inp: \*ELEMENT refers to the node PART-1-1.33"):
        deck_of(tmp_path, text.replace("2, Part-1-1.3", "2, Part-1-1.33"))


def test_included_files(tmp_path):
    (tmp_path / "mesh.txt").write_text(line())
    (tmp_path / "rest.txt").write_text(STEEL + RECT)
    text = "*INCLUDE, INPUT=mesh.txt\n*INCLUDE, INPUT=rest.txt\n" + CLAMPED
    f = frequencies(tmp_path, text, 1)
    assert f[0] == pytest.approx(cantilever(0, I22, A), rel=2 * FIRST_MESH_ERROR)


def test_notes_name_keyword_and_line(tmp_path):
    text = line(kind="B31") + STEEL + RECT + "*INITIAL CONDITIONS, TYPE=STRESS\nBAR, 1\n*GIRAFFE\n"
    text += CLAMPED + "*STEP\n*MODAL DAMPING\n1, 2, .1\n"
    notes = deck_of(tmp_path, text).notes
    for words in (
        "*INITIAL CONDITIONS (line 32)",
        "*GIRAFFE (line 34)",
        "*MODAL DAMPING",
        "Abaqus takes 0.85",
    ):
        assert any(words in note for note in notes), (words, notes)
