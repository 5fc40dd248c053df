"""What several programs' decks can lack has one answer in all readers, and blank lines are defaults."""

import tomllib

import numpy as np
import pytest

from dovetail import main
from fem import MeshError, assemble, solve_modes
from fem.io import model_of, read_deck
from tests.fem.io.abaqus_decks import RHO, STEEL, line

NASTRAN = (
    "GRID,1,,0.,0.,0.\nGRID,2,,2.,0.,0.\nCBAR,1,1,1,2,0.,1.,0.\nPBAR,1,1,1.-4,1.-8,1.-8,1.-8\n"
    "MAT1,1,2.+11,,.3,7850.\nCONM2,9,2,,50.\nSPC1,1,123456,1\n"
)
ANSYS = "/PREP7\nET,1,4\nMP,EX,1,2e11\nMP,PRXY,1,.3\nR,1,1e-4,1e-8,1e-8,.1,.1\nN,1\nN,2,2\nE,1,2\nD,1,ALL\n"
ABAQUS = line(1, "B33") + STEEL + "*BEAM SECTION, ELSET=BAR, MATERIAL=STEEL, SECTION=RECT\n.01, .01\n"


def read(folder, name, text):
    (folder / name).write_text(text)
    return read_deck(folder / name)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.bdf", NASTRAN.replace(",7850.", "")),
        ("a.bdf", NASTRAN.replace(",7850.", ",0.")),
        ("a.inp", ABAQUS.replace(f"*DENSITY\n{RHO}\n", "")),
        ("a.inp", ABAQUS.replace(f"{RHO}", "0.")),
        (
            "a.inp",
            line(1, "B33")
            + "*BEAM GENERAL SECTION, ELSET=BAR, SECTION=RECT\n.01, .01\n0, 0, -1\n2e11, 8e10\n",
        ),
        ("a.cdb", ANSYS),
        ("a.cdb", ANSYS.replace("R,1", "MP,DENS,1,0\nR,1")),
    ],
)
def test_a_material_without_density_gets_the_same_negligible_one(tmp_path, name, text, capsys):
    deck = read(tmp_path, name, text)
    assert deck.properties[0].material.rho == pytest.approx(2e11 / 1e24)
    assert sum("a negligible one is taken" in note and "no density" in note for note in deck.notes) == 1
    assert main(["new", str(tmp_path / "s"), "--from", str(tmp_path / name)]) == 0
    assert main(["check", str(tmp_path / "s" / "study.toml")]) == 0
    lines = [line for line in capsys.readouterr().out.splitlines() if "rho = " in line]
    assert len(lines) == 1
    assert "a deck without a density is read with such a negligible one" in lines[0]


@pytest.mark.parametrize(
    ("name", "text"),
    [("a.bdf", NASTRAN.replace(",7850.", ",-7.")), ("a.inp", ABAQUS.replace(f"{RHO}", "-7."))],
)
def test_a_negative_density_is_refused(tmp_path, name, text):
    with pytest.raises(MeshError, match="rho is -7"):
        read(tmp_path, name, text)


def test_abaqus_has_no_lateral_contraction_without_poissons_ratio(tmp_path):
    deck = read(tmp_path, "a.inp", ABAQUS.replace(", 0.3", ""))
    assert deck.properties[0].material.nu == 0
    assert any("no Poisson's ratio; 0 is taken" in note for note in deck.notes)


@pytest.mark.parametrize("include", ["INCLUDE 'alter.v9'", "include alter.v9", "INCLUDE 'al\nter.v9'"])
@pytest.mark.parametrize("there", [False, True])
def test_files_before_cend_are_left_out(tmp_path, include, there):
    if there:
        (tmp_path / "alter.v9").write_text("COMPILE SEMODES $\nBEGIN $\nENDDATA\n")
    deck = read(tmp_path, "a.bdf", f"SOL 103\n{include}\nCEND\nBEGIN BULK\n{NASTRAN}ENDDATA\n")
    assert len(deck.bars.numbers) == 1
    assert any("INCLUDE alter.v9 (a.bdf: line 2) is left out: files before CEND" in n for n in deck.notes)


def test_files_of_case_control_and_bulk_data_must_be_there(tmp_path):
    for text in ("CEND\nINCLUDE 'a.v9'\nBEGIN BULK\n" + NASTRAN, "INCLUDE 'a.v9'\n" + NASTRAN):
        with pytest.raises(MeshError, match=r"the included file a\.v9 cannot be read"):
            read(tmp_path, "a.bdf", text)


@pytest.mark.parametrize("points", ["1001,THRU,1009", "1001,1002,1003,1004,1005", "1001"])
def test_scalar_points_of_a_reduction_carry_nothing(tmp_path, points):
    reduced = f"SPOINT,{points}\nQSET1,0,{points}\nASET1,123456,2\n"
    plain, with_points = (
        solve_modes(assemble(model_of(read(tmp_path, "a.bdf", NASTRAN + more))), 4).frequency
        for more in ("", reduced)
    )
    np.testing.assert_array_equal(plain, with_points)
    notes = read(tmp_path, "a.bdf", NASTRAN + reduced).notes
    assert any("SPOINT 1001 at a.bdf: line 8: scalar points that no card" in note for note in notes)


@pytest.mark.parametrize("card", ["CELAS2,7,1.+3,1001,0,2,1", "MPC,1,2,1,1.,1001,1,-1.", "CMASS2,7,5.,1001"])
def test_a_card_that_needs_a_scalar_point_is_refused(tmp_path, card):
    with pytest.raises(MeshError, match=r"refers to the scalar point 1001 of SPOINT at a\.bdf: line 8"):
        read(tmp_path, "a.bdf", f"{NASTRAN}SPOINT,1001,THRU,1009\n{card}\n")


GENERAL = "*BEAM GENERAL SECTION, ELSET=BAR, SECTION=RECT, DENSITY=7800.\n.02, .03\n"


@pytest.mark.parametrize(
    ("section", "expected"),
    [
        (GENERAL + "\n2.1e11, 8e10\n", None),
        (GENERAL + "  ,  ,\n2.1e11, 8e10\n", None),
        (GENERAL + "** n1\n\n2.1e11, 8e10\n\n", None),
        (GENERAL + "0, 1, 0\n2.1e11, 8e10\n", [0, 1, 0]),
        (GENERAL + "0, 1, 0\n\n2.1e11, 8e10\n", [0, 1, 0]),
        (GENERAL.replace("BEAM GENERAL", "BEAM") + "\n", None),
        (GENERAL.replace("BEAM GENERAL", "BEAM") + "\n3, 3\n", None),
        (GENERAL.replace("BEAM GENERAL", "BEAM") + "\n0., 1., 0.\n", [0, 1, 0]),
        (GENERAL.replace("BEAM GENERAL", "BEAM") + "0., 1., 0.\n3, 3\n", [0, 1, 0]),
    ],
)
def test_a_blank_line_stands_for_the_default_direction_n1(tmp_path, section, expected):
    """b = 0.03 is along n2 and a = 0.02 along n1, which is (0, 0, -1) unless given."""
    section = section.replace("*BEAM SECTION, ", "*BEAM SECTION, MATERIAL=STEEL, ")
    deck = read(tmp_path, "a.inp", line(2, "B33") + STEEL + section)
    assert deck.properties[0].material.E == 2.1e11
    assert pytest.approx(0.02 * 0.03) == deck.properties[0].section.A
    assert abs(deck.bars.height[0] @ [0, 1, 0]) == (1.0 if expected is None else 0.0)


@pytest.mark.parametrize("E", [1e-40, 0.07, 7e4, 99999.9, 1e5, 2.1e11, 1e20, 1e21, 1.23e22, 1e40])
def test_a_study_has_any_modulus_exactly(tmp_path, E):
    (tmp_path / "a.bdf").write_text(NASTRAN.replace("2.+11", f"{E:.7G}"))
    assert main(["new", str(tmp_path / "s"), "--from", str(tmp_path / "a.bdf")]) == 0
    study = tomllib.loads((tmp_path / "s" / "study.toml").read_text())
    assert study["materials"]["MAT1 1"]["E"] == E
