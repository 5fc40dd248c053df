"""Abaqus decks that give no frame model: the error names file, line and keyword."""

import contextlib
import random

import pytest

from fem import MeshError
from fem.io import model_of
from tests.fem.io.abaqus_decks import CLAMPED, RECT, STEEL, deck_of, line

BEAM = line(2, "B31") + STEEL + RECT  # 7 + 5 + 3 lines; what follows begins with line 16
NODE = "*NODE\n9, 0, 0, 1\n"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (BEAM + "*ELEMENT, TYPE=B31\n9, 1, 3\n", "line 17: *ELEMENT 9 of type B31 has no *BEAM SECTION"),
        (BEAM + "*ELEMENT, TYPE=T3D2\n9, 1, 3\n", "line 17: *ELEMENT 9 of type T3D2 has no *SOLID SECTION"),
        (line(2, "T3D2") + STEEL + RECT, "line 13: *BEAM SECTION is given for the element 1 of type T3D2"),
        (line(2, "B31") + RECT, "line 8: *BEAM SECTION refers to the material STEEL, which the file does no"),
        (
            line(2, "B31") + STEEL.replace("*ELASTIC", "*PLASTIC") + RECT,
            "line 8: *MATERIAL STEEL has no *ELAS",
        ),
        (
            line(2, "B31") + STEEL.replace("7800.0", "-1.") + RECT,
            "*BEAM SECTION: material 'STEEL': rho is -1.",
        ),
        (line(2, "B31") + STEEL.replace("7800.0", "heavy") + RECT, "line 12: *DENSITY takes a density, but"),
        (line(2, "B31") + STEEL.replace("*ELASTIC", "*ELASTIC, TYPE=ORTHO") + RECT, "line 9: *ELASTIC of ST"),
        (
            line(2, "B31") + STEEL.replace(", 0.3", ", x") + RECT,
            "line 10: *ELASTIC takes Young's modulus and",
        ),
        (line(2, "B31") + STEEL + STEEL + RECT, "line 13: *MATERIAL STEEL comes a second time"),
        (BEAM + RECT, "line 16: *BEAM SECTION gives element 1 another section than *BEAM SECTION at a.inp"),
        (BEAM.replace("0.02, 0.03", "0.02"), "line 14: *BEAM SECTION has 1 numbers on this line; 2 are expe"),
        (BEAM.replace("0.02, 0.03", "0.02, 0.03, 0.4"), "line 14: *BEAM SECTION has 3 numbers"),
        (BEAM.replace("0.02, 0.03", "0.02, -0.03"), "line 14: *BEAM SECTION: rectangle"),
        (BEAM.replace("0, 0, -1", "1, 0, 0"), "line 13: *BEAM SECTION: n1 is along element 1"),
        (BEAM.replace("0, 0, -1", "0, 0, 0"), "line 15: *BEAM SECTION has the direction n1 = 0, 0, 0"),
        (BEAM.replace("RECT", "ELBOW"), "line 13: *BEAM SECTION has SECTION=ELBOW, which is not read"),
        (BEAM.replace("RECT", "RECT, NODAL THICKNESS"), "line 13: *BEAM SECTION has the parameter NODALTHIC"),
        (BEAM.replace("ELSET=BAR, MAT", "ELSET=BEAM, MAT"), "line 13: *BEAM SECTION refers to the element s"),
        (BEAM + "*BOUNDARY\nFOOT, 1, 3\n", "line 17: *BOUNDARY refers to the node set FOOT, which the file"),
        (BEAM + "*BOUNDARY\n1, 0, 3\n", "line 17: *BOUNDARY has the degrees of freedom 0 to 3"),
        (BEAM + "*BOUNDARY\n1, FIXED\n", "line 17: *BOUNDARY has FIXED after the nodes"),
        (BEAM + "*BOUNDARY\n1\n", "line 17: *BOUNDARY has nothing after the nodes"),
        (BEAM + "*BOUNDARY, USER\n1, 1, 3\n", "line 16: *BOUNDARY has the parameter USER"),
        (BEAM + "*ELEMENT, TYPE=MASS, ELSET=M\n9, 1\n", "line 17: *ELEMENT 9 of type MASS has no *MASS"),
        (BEAM + "*ELEMENT, TYPE=SPRING1, ELSET=M\n9, 1\n", "line 17: *ELEMENT 9 of type SPRING1 has no *SPR"),
        (BEAM + "*ELEMENT, TYPE=MASS, ELSET=M\n9, 1\n*MASS, ELSET=M\n-1\n", "line 18: *MASS is -1 kg"),
        (BEAM + "*ELEMENT, TYPE=MASS, ELSET=M\n9, 1\n*MASS, ELSET=M\n", "line 18: *MASS has 0 data line(s)"),
        (
            BEAM + NODE + "*ELEMENT, TYPE=SPRING2, ELSET=M\n9, 1, 9\n*SPRING, ELSET=M\n1, 1\n5.\n",
            "line 20: *SPRING: element 9 acts along a direction across which its nodes are 1 m apart",
        ),
        (BEAM + "*ELEMENT, TYPE=SPRING2, ELSET=M\n9, 1, 2\n*SPRING, ELSET=M\n1, 2\n5.\n", "line 18: *SPRING"),
        (BEAM + "*ELEMENT, TYPE=SPRING1, ELSET=M\n9, 1\n*SPRING, ELSET=M, NONLINEAR\n1\n5.\n", "parameter N"),
        (BEAM + "*ELEMENT, TYPE=C3D8\n9, 1, 2, 3, 1, 2, 3, 1, 2\n", "line 16: *ELEMENT has the type C3D8"),
        (BEAM + "*MPC\nREVOLUTE, 1, 2, 3\n", "line 17: *MPC REVOLUTE with 3 nodes is not read"),
        (BEAM + "*EQUATION\n2\n1, 1, 1.\n", "line 17: *EQUATION of 2 terms has 3 cells after it"),
        (BEAM + "*EQUATION\n2\n1, 1, 1., 99, 1, 1.\n", "line 17: *EQUATION refers to the node 99"),
        (BEAM + "*COUPLING, REF NODE=1, SURFACE=S\n*KINEMATIC\n", "line 16: *COUPLING refers to the surface"),
        (BEAM + "*CENTROID\n0, 1\n*RELEASE\n*CENTROID\n0, 1\n", "line 19: *CENTROID follows none of BEAM"),
        (BEAM + "*CENTROID\n0, 1\n*CENTROID\n0, 1\n", "line 18: *CENTROID comes a second time"),
        (BEAM + "*RIGID BODY, REF NODE=1\n", "line 16: *RIGID BODY has no nodes"),
        (BEAM + "*RELEASE\n1, S3, M1\n", "line 17: *RELEASE takes an element, S1 or S2"),
        (BEAM + "*TIE, NAME=T\nA, B\n", "line 16: *TIE connects parts in a way that is not read"),
        (BEAM + "*NORMAL, TYPE=ELEMENT\n1, 1, 0, 0, 1\n", "line 16: *NORMAL turns sections by normals"),
        (BEAM.replace("1, 0.0, 0.0, 0.0\n", "1, 0., 0., 0., 0., 1., 0.\n"), "line 2: *NODE gives a normal"),
        (BEAM + "*ELEMENT, TYPE=B21, ELSET=BAR\n9, 1, 2\n", "*ELEMENT of type B31 is in space, those of"),
        (
            BEAM + "*ELEMENT, TYPE=ROTARYI, ELSET=R\n9, 1\n*ROTARY INERTIA, ELSET=R\n1, 1, 1, 2, 0, 0\n",
            "line 18: *ROTARY INERTIA has a negative principal moment of inertia",
        ),
        (
            BEAM + "*ELEMENT, TYPE=ROTARYI, ELSET=R\n9, 1\n*ROTARY INERTIA, ELSET=R, ORIENTATION=O\n1\n",
            "line 18: *ROTARY INERTIA refers to the orientation O",
        ),
        ("*NODE\n1, 0\n" + STEEL + RECT, "a.inp: the deck has no elements"),
        (BEAM + "*PRE-TENSION SECTION, ELEMENT=1, NODE=3\n", "line 16: *PRE-TENSION SECTION connects parts"),
        (BEAM + "*FOUNDATION\nBAR, F1, 1e5\n", "line 16: *FOUNDATION adds an elastic foundation"),
        (
            BEAM.replace("BEAM SECT", "BEAM GENERAL SECT").replace(", MATERIAL=STEEL", ", DENSITY=-1")
            + "2e11, 8e10\n",
            "line 13: *BEAM GENERAL SECTION: material 'BAR': rho is -1.0",
        ),
    ],
)
def test_one_line_names_file_line_and_keyword(tmp_path, text, words):
    with pytest.raises(MeshError) as found:
        deck_of(tmp_path, text)
    message = str(found.value)
    assert words in message, message
    assert message.startswith("a.inp")
    assert "\n" not in message


def test_a_deck_without_sections_is_a_mesh(tmp_path):
    solids = "*NODE\n5, 0, 1, 1\n*ELEMENT, TYPE=C3D4\n9, 1, 2, 3, 5\n*SOLID SECTION, ELSET=E\n"
    deck = deck_of(tmp_path, line(2, "B31") + solids)
    assert (deck.bars.ends.tolist(), deck.properties) == ([[0, 1], [1, 2]], ())
    with pytest.raises(MeshError, match=r"a\.inp: it has bars without sections"):
        model_of(deck)


ALL = (
    BEAM
    + CLAMPED
    + "*NODE\n9, 2, 0, 1\n10, 2, 1, 0\n*NSET, NSET=N\n9, 10\n*SURFACE, NAME=S, TYPE=NODE\nN, 1.\n"
    "*ORIENTATION, NAME=O\n1, 0, 0, 0, 1, 0\n3, 20.\n*TRANSFORM, NSET=N\n1, 1, 0, -1, 1, 0\n"
    "*COUPLING, REF NODE=3, SURFACE=S, ORIENTATION=O\n*KINEMATIC\n1, 2\n"
    "*ELEMENT, TYPE=MASS, ELSET=M\n20, 9\n*MASS, ELSET=M\n2.\n"
    "*ELEMENT, TYPE=ROTARYI, ELSET=R\n21, 3\n"
    "*ROTARY INERTIA, ELSET=R, ORIENTATION=O\n1., 1., 1., 0., 0., 0.\n"
    "*ELEMENT, TYPE=SPRINGA, ELSET=A\n22, 2, 9\n*SPRING, ELSET=A\n\n10.\n"
    "*ELEMENT, TYPE=DASHPOT1, ELSET=D\n23, 3\n*DASHPOT, ELSET=D\n1\n10.\n"
    "*MPC\nBEAM, 9, 2\n*EQUATION\n2\n2, 1, 1., 10, 2, -1.\n*RIGID BODY, REF NODE=3, NSET=N\n"
    "*RELEASE\n1, S2, M1-M2\n"
    "*NONSTRUCTURAL MASS, ELSET=BAR, UNITS=TOTAL MASS\n3.\n"
    "*STEP\n*FREQUENCY\n4\n*BOUNDARY, OP=NEW\n1, 1, 6\n*END STEP\n"
)


SPOILT = ("", "x", "-1", "0", "1e400", "nan", "99", "1.5", "*", "1, 2")


def test_a_spoilt_cell_never_ends_in_another_error(tmp_path):
    rng = random.Random(1)
    deck_of(tmp_path, ALL)
    taken = 0
    for _ in range(400):
        lines = ALL.split("\n")
        row = rng.randrange(len(lines))
        cells = lines[row].split(",")
        cells[rng.randrange(len(cells))] = rng.choice(
            ["", "x", "-1", "0", "1e400", "nan", "99", "1.5", "*", "1, 2"]
        )
        lines[row] = ",".join(cells)
        with contextlib.suppress(MeshError):
            model_of(deck_of(tmp_path, "\n".join(lines)))
            taken += 1
    assert 50 < taken < 200
