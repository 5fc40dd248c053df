"""Masses, springs, supports and constraints of Abaqus decks: closed forms, and free rigid motion."""

from dataclasses import replace

import numpy as np
import pytest

from fem import DIRECTIONS, assemble, solve_modes
from fem.io import Body, DeckUnits, model_of
from tests.fem.io.abaqus_decks import CLAMPED, RECT, RHO, STEEL, E, L, deck_of, frequencies, line

A, I11, I22 = 6e-4, 0.02 * 0.03**3 / 12, 0.03 * 0.02**3 / 12
BEAM = line() + STEEL + RECT
TIP = "*ELEMENT, TYPE=MASS, ELSET=TIP\n90, 11\n*MASS, ELSET=TIP\n"
STIFF = "*NODE\n1, 0\n2, 1e-3\n*ELEMENT, TYPE=B33, ELSET=BAR\n1, 1, 2\n" + STEEL + RECT
"""A bar so short that it is rigid and has no mass beside those of a test."""


def sdof(k, m):
    return np.sqrt(k / m) / (2 * np.pi)


# Masses and springs -------------------------------------------------------------------------------------


def test_tip_mass(tmp_path):
    f = frequencies(tmp_path, BEAM + TIP + "1e5\n" + CLAMPED, 1)[0]
    assert f == pytest.approx(sdof(3 * E * I22 / L**3, 1e5 + 33 / 140 * RHO * A * L), rel=1e-6)  # Rayleigh


def test_rotary_inertia_along_an_orientation(tmp_path):
    text = "*ORIENTATION, NAME=O\n0, 1, 0, -1, 0, 0\n3, 90.\n*ELEMENT, TYPE=ROTARYI, ELSET=R\n91, 11\n"
    text += "*ROTARY INERTIA, ELSET=R, ORIENTATION=O\n1., 2., 3., .1, .2, .3\n"
    body = deck_of(tmp_path, BEAM + text).bodies[0]
    # x of the axes is global y, turned by 90° about z: global -x; y is then -y
    np.testing.assert_allclose(body.inertia, [[1, 0.1, -0.2], [0.1, 2, -0.3], [-0.2, -0.3, 3]], atol=1e-15)
    assert body.mass == 0


@pytest.mark.parametrize("dof", range(1, 7))
def test_grounded_springs_and_dashpots(tmp_path, dof):
    text = f"*ELEMENT, TYPE=SPRING1, ELSET=S\n91, 2\n*SPRING, ELSET=S\n{dof}\n2000.\n"
    text += f"*ELEMENT, TYPE=DASHPOT1, ELSET=D\n92, 2\n*DASHPOT, ELSET=D\n{dof}\n30.\n"
    spring, dashpot = deck_of(tmp_path, STIFF + text).connections
    assert (spring.nodes, dashpot.nodes) == ((1, None), (1, None))
    assert np.argwhere(spring.K).tolist() == np.argwhere(dashpot.C).tolist() == [[dof - 1, dof - 1]]
    assert (spring.K.max(), dashpot.C.max()) == (2000, 30)


def test_spring_at_a_node_with_a_mass(tmp_path):
    text = STIFF + "*ELEMENT, TYPE=MASS, ELSET=M\n90, 1\n*MASS, ELSET=M\n1e3\n*BOUNDARY\n1, 1, 2\n1, 4, 6\n"
    text += "*ELEMENT, TYPE=SPRING1, ELSET=S\n91, 1\n*SPRING, ELSET=S\n3\n4e4\n"
    assert frequencies(tmp_path, text, 1)[0] == pytest.approx(sdof(4e4, 1e3), rel=1e-4)


def test_axial_spring_is_along_its_nodes(tmp_path):
    text = STIFF + "*NODE\n3, 1e-3, 3, 4\n*ELEMENT, TYPE=MASS, ELSET=M\n90, 2\n*MASS, ELSET=M\n1e3\n"
    text += "*ELEMENT, TYPE=SPRINGA, ELSET=S\n91, 2, 3\n*SPRING, ELSET=S\n\n1e5\n"
    text += "*BOUNDARY\n3, 1, 6\n1, 1\n1, 3, 6\n"  # it moves along y
    assert frequencies(tmp_path, text, 1)[0] == pytest.approx(sdof(1e5 * 0.6**2, 1e3), rel=1e-4)


def test_spring_between_nodes_has_axes(tmp_path):
    text = "*NODE\n7, 1e-3, 0, 0\n*ORIENTATION, NAME=O\n0, 1, 0, -1, 0, 0\n"
    text += "*ELEMENT, TYPE=SPRING2, ELSET=S\n91, 2, 7\n"
    text += "*SPRING, ELSET=S, ORIENTATION=O\n1, 1\n10.\n"
    text += "*RIGID BODY, REF NODE=7, NSET=N\n*NSET, NSET=N\n7, 2\n"
    deck = deck_of(tmp_path, STIFF + text)
    c = deck.connections[0]
    stiffness = c.axes.T @ c.K[:3, :3] @ c.axes
    np.testing.assert_allclose(stiffness, np.diag([0, 10, 0]), atol=1e-12)


@pytest.mark.parametrize("kind", ["BEAM", "WELD", "JOIN"])
def test_rigid_connectors(tmp_path, kind):
    text = (
        STIFF + f"*NODE\n7, 1e-3, 0, 0\n*ELEMENT, TYPE=CONN3D2, ELSET=C\n95, 2, 7\n"
        f"*CONNECTOR SECTION, ELSET=C\n{kind}\n"
    )
    link = deck_of(tmp_path, text).links[0]
    assert (link.node, link.dependents) == (1, (2,))
    assert link.directions == (DIRECTIONS[:3] if kind == "JOIN" else DIRECTIONS)


# Supports -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "fixed"),
    [
        ("ENCASTRE", "x y z rx ry rz"),
        ("PINNED", "x y z"),
        ("XSYMM", "x ry rz"),
        ("ZASYMM", "x y rz"),
        ("2", "y"),
        ("2, 4", "y z rx"),
        ("6, , 0.", "rz"),
        ("5, 7", "ry rz"),  # 7 is warping
    ],
)
def test_forms_of_boundary(tmp_path, words, fixed):
    deck = deck_of(tmp_path, BEAM + f"*NSET, NSET=END\n11\n*BOUNDARY\nEND, {words}\n")
    assert deck.supports == {10: tuple(fixed.split())}


@pytest.mark.parametrize(
    ("option", "fixed"), [("", {0: ("x", "y", "z"), 10: ("z",)}), (", OP=NEW", {10: ("z",)})]
)
def test_supports_of_the_first_step_with_frequencies(tmp_path, option, fixed):
    text = BEAM + "*BOUNDARY\n1, 1, 3\n*STEP\n*STATIC\n*END STEP\n"
    text += (
        f"*STEP\n*FREQUENCY\n2\n*BOUNDARY{option}\n11, 3\n*END STEP\n*STEP\n*FREQUENCY\n*BOUNDARY\n5, 1, 6\n"
    )
    deck = deck_of(tmp_path, text)
    assert deck.supports == fixed
    assert any("up to 2 (*FREQUENCY)" in note for note in deck.notes)


def test_supports_along_axes_of_a_transform(tmp_path):
    turned = "*NSET, NSET=END\n11\n*TRANSFORM, NSET=END\n0, 1, 0, -1, 0, 0\n*BOUNDARY\n"
    deck = deck_of(tmp_path, BEAM + turned + "END, 1\nEND, 5\n")
    assert deck.supports == {10: ("y", "rx")}
    skew = "*NSET, NSET=END\n11\n*TRANSFORM, NSET=END\n1, 1, 0, -1, 1, 0\n*BOUNDARY\n"
    assert deck_of(tmp_path, BEAM + skew + "END, 1, 2\n").supports == {10: ("x", "y")}
    deck = deck_of(tmp_path, BEAM + skew + "END, 1\nEND, 3\n")
    c = deck.connections[0]
    assert (deck.supports, c.nodes, c.rigid) == ({}, (10, None), ("x", "z"))
    np.testing.assert_allclose(c.axes[0], [np.sqrt(0.5), np.sqrt(0.5), 0])


def test_polar_transform(tmp_path):
    text = BEAM + "*NSET, NSET=END\n11\n*TRANSFORM, NSET=END, TYPE=C\n0, 0, 0, 0, 0, 1\n*BOUNDARY\nEND, 2\n"
    assert deck_of(tmp_path, text).supports == {10: ("y",)}


# Constraints --------------------------------------------------------------------------------------------

OFF = "*NODE\n20, 2, .3, .1\n21, 2.1, -.2, .4\n22, 2.2, .1, -.3\n23, 1.9, .2, .2\n"
SURFACE = "*NSET, NSET=FEET\n20, 21, 22\n*SURFACE, TYPE=NODE, NAME=S\nFEET, 1.\n23, 2.\n"
SKEW = "*ORIENTATION, NAME=O\n1, 1, 0, -1, 1, .5\n"


def residuals(deck):
    """Return Σ c u of all equations for the six rigid motions, relative to the coefficients."""
    out = []
    for equation in deck.equations:
        total = np.zeros(6)
        for node, direction, c in equation.terms:
            x, y, z = deck.points[node]
            motion = np.eye(6)
            motion[:3, 3:] = [[0, z, -y], [-z, 0, x], [y, -x, 0]]
            total += c * motion[DIRECTIONS.index(direction)]
        out.append(np.abs(total).max() / max(abs(c) for _, _, c in equation.terms))
    return np.array(out)


@pytest.mark.parametrize(
    ("text", "count"),
    [
        ("*MPC\nLINK, 20, 11\n", 1),
        (SKEW + "*KINEMATIC COUPLING, REF NODE=11, ORIENTATION=O\nFEET, 1, 2\n23, 5\n", 7),
        (SKEW + "*COUPLING, REF NODE=11, SURFACE=S, ORIENTATION=O\n*KINEMATIC\n3, 4\n", 8),
        ("*COUPLING, REF NODE=11, SURFACE=S\n*DISTRIBUTING\n", 6),
        (SKEW + "*COUPLING, REF NODE=11, SURFACE=S, ORIENTATION=O\n*DISTRIBUTING\n4, 5\n", 5),
    ],
)
def test_equations_of_rigid_regions_leave_rigid_motion_free(tmp_path, text, count):
    deck = deck_of(tmp_path, BEAM + OFF + SURFACE + text)
    assert len(deck.equations) == count
    assert residuals(deck).max() < 1e-13


def test_distributing_takes_the_weighted_mean(tmp_path):
    text = "*NODE\n20, 2, 1, 0\n21, 2, -1, 0\n22, 2, 0, 1\n23, 2, 0, -1\n" + SURFACE.replace("2.\n", "1.\n")
    deck = deck_of(tmp_path, BEAM + text + "*COUPLING, REF NODE=11, SURFACE=S\n*DISTRIBUTING\n")
    x = dict(((n, d), c) for n, d, c in deck.equations[0].terms)
    rotation = {(n, d): c for n, d, c in deck.equations[3].terms}
    assert x == pytest.approx({(10, "x"): 1, **{(k, "x"): -0.25 for k in range(11, 15)}})
    assert rotation == pytest.approx(  # θx = Σ (y w - z v) / Σ (y² + z²)
        {(10, "rx"): 1, (11, "z"): -0.25, (12, "z"): 0.25, (13, "y"): 0.25, (14, "y"): -0.25}
    )


@pytest.mark.parametrize(
    "text",
    [
        "*MPC\nBEAM, 20, 11\n",
        "*COUPLING, REF NODE=11, SURFACE=ONE\n*KINEMATIC\n*SURFACE, NAME=ONE, TYPE=NODE\n20\n",
        "*COUPLING, REF NODE=11, SURFACE=ONE\n*KINEMATIC\n1, 6\n*SURFACE, NAME=ONE, TYPE=NODE\n20\n",
        SKEW + "*KINEMATIC COUPLING, REF NODE=11, ORIENTATION=O\n20\n",
        "*RIGID BODY, REF NODE=11, NSET=ONE\n*NSET, NSET=ONE\n20\n",
        "*RIGID BODY, REF NODE=11, TIE NSET=ONE\n*NSET, NSET=ONE\n20, 11\n",
        "*ELEMENT, TYPE=CONN3D2, ELSET=C\n95, 11, 20\n*CONNECTOR SECTION, ELSET=C\nBEAM\n",
    ],
)
def test_a_mass_on_a_rigid_arm(tmp_path, text):
    """All forms of a rigid arm give the frequencies of a body with an offset centre of mass."""
    mass = "*ELEMENT, TYPE=MASS, ELSET=M\n96, 20\n*MASS, ELSET=M\n1.5\n"
    f = frequencies(tmp_path, BEAM + OFF.split("21,")[0] + text + mass + CLAMPED, 6)
    arm, m = np.array([0, 0.3, 0.1]), 1.5
    deck = deck_of(tmp_path, BEAM + CLAMPED)
    expected = solve_modes(
        assemble(model_of(replace(deck, bodies=(Body(name="m", node=10, mass=m, arm=arm),)))), 6
    )
    np.testing.assert_allclose(f, expected.frequency, rtol=1e-8)


def test_pinned_and_tied_nodes(tmp_path):
    text = BEAM + "*NODE\n20, 2, 0, 0\n21, 2, 1, 0\n*MPC\nPIN, 20, 11\nTIE, 21, 11\n"
    deck = deck_of(tmp_path, text)
    assert [(k.node, k.dependents, k.directions) for k in deck.links] == [(10, (11,), DIRECTIONS[:3])]
    assert [e.terms for e in deck.equations] == [((12, d, 1.0), (10, d, -1.0)) for d in DIRECTIONS]


def test_rigid_body_of_elements_with_pins(tmp_path):
    text = BEAM + "*NODE\n20, 3, 0, 0\n*ELSET, ELSET=LAST\n10\n*NSET, NSET=P\n11\n"
    deck = deck_of(tmp_path, text + "*RIGID BODY, REF NODE=20, ELSET=LAST, PIN NSET=P\n")
    assert [(k.dependents, k.directions) for k in deck.links] == [((9,), DIRECTIONS), ((10,), DIRECTIONS[:3])]


def test_supports_of_a_rotation_node_turn_the_reference_node(tmp_path):
    text = BEAM + "*NODE\n20, 3\n21, 3\n*NSET, NSET=P\n11\n*RIGID BODY, REF NODE=20, ROT NODE=21, NSET=P\n"
    deck = deck_of(tmp_path, text + "*BOUNDARY\n20, 2\n21, 1, 2\n")
    assert deck.supports == {11: ("y", "rx", "ry")}


def test_equations_of_sets_in_the_deck_s_units(tmp_path):
    text = (
        BEAM + "*NSET, NSET=A\n2, 3\n*NSET, NSET=B\n4, 5\n*EQUATION\n"
        "2\nA, 1, 1., B, 6, -5.\n3\n7, 1, 2.\n8, 2, 3.\n9, 3, 4\n"
    )
    deck = deck_of(tmp_path, text, DeckUnits(1e-3, 1.0, 1.0))
    assert [e.terms for e in deck.equations] == [
        ((1, "x", 1.0), (3, "rz", -0.005)),
        ((2, "x", 1.0), (4, "rz", -0.005)),
        ((6, "x", 2.0), (7, "y", 3.0), (8, "z", 4.0)),
    ]


def test_equation_at_a_transformed_node(tmp_path):
    text = (
        BEAM + "*NSET, NSET=A\n2\n*TRANSFORM, NSET=A\n3, 4, 0, -4, 3, 0\n*EQUATION\n2\n2, 1, 1., 3, 1, -1.\n"
    )
    terms = {(n, d): c for n, d, c in deck_of(tmp_path, text).equations[0].terms}
    assert terms == pytest.approx({(1, "x"): 0.6, (1, "y"): 0.8, (2, "x"): -1})
