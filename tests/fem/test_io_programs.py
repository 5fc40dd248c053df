"""The text of a deck decides the program that it is for."""

import warnings
from pathlib import Path

import numpy as np
import pytest
import scipy.io

from dovetail import main
from fem import MeshError
from fem.io import read_matrices, read_mesh, read_model
from fem.io.programs import program_of
from tests.fem.test_io_ansys_commands import BEAM

NASTRAN = """\
BEGIN BULK
GRID,1,,0.,0.,0.
GRID,2,,2.,0.,0.
CBAR,1,7,1,2,0.,0.,1.
PBAR,7,1,1.-3,1.-7,4.-7,2.-7
MAT1,1,2.+11,,.25,7800.
SPC1,1,123456,1
ENDDATA
"""
ABAQUS = """\
*HEADING
*NODE
1, 0., 0.
2, 2., 0.
*ELEMENT, TYPE=B33, ELSET=ALL
1, 1, 2
*BEAM SECTION, SECTION=RECT, ELSET=ALL, MATERIAL=STEEL
.02, .05
0., 0., -1.
*MATERIAL, NAME=STEEL
*ELASTIC
2e11, .25
*DENSITY
7800.
*BOUNDARY
1, 1, 6
"""
TEXTS = {"ANSYS": BEAM, "Nastran": NASTRAN, "Abaqus": ABAQUS}
SUFFIXES = (".mac", ".dat", ".inp", ".txt", ".bdf", ".cdb", ".nas", ".fem", ".ans", "")


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("program", TEXTS)
def test_a_deck_is_read_under_every_suffix(tmp_path: Path, program: str, suffix: str):
    path = tmp_path / f"deck{suffix}"
    path.write_text(TEXTS[program])
    assert program_of(path) == program
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        assert read_model(path).mesh.lengths().sum() == pytest.approx(2)
        assert read_mesh(path).lengths().sum() == pytest.approx(2)


FIRST_LINES = {
    "ANSYS": [
        "! SOL 103",
        "*SET,a,1",
        "*DIM,a,ARRAY,2",
        "nblock,3,,9",
        "/COM, BEGIN BULK",
        "EN,1,1,2",
        "/batch",
    ],
    "Nastran": ["$ /PREP7\nSOL 103", "CEND", "GRID*   4        ", "grid    1               1.0", "SOL,103"],
    "Abaqus": ["** SOL 103\n*Node", "*Static", "*include, input=a.inp", "*END PART", "*ELEMENT, TYPE=B31"],
    None: ["1 2 3", "", "some words, and numbers 1,2", "solid a\nfacet normal 0 0 1"],
}


@pytest.mark.parametrize(("program", "text"), [(p, t) for p, texts in FIRST_LINES.items() for t in texts])
def test_the_first_line_of_one_program_decides(tmp_path: Path, program: str | None, text: str):
    path = tmp_path / "deck.txt"
    path.write_text(f"{text}\n" if text[:1] != "!" else f"{text}\nET,1,188\n")
    path.write_text(path.read_text().replace("GRID*   4        \n", "GRID*   4              0.\n"))
    assert program_of(path) == program


@pytest.mark.parametrize("read", [read_model, read_mesh])
def test_an_unknown_text_names_the_three_programs(tmp_path: Path, read):
    path = tmp_path / "frame.txt"
    path.write_text("one two three\n")
    with pytest.raises(MeshError) as caught:
        read(path)
    for word in ("frame.txt", "Nastran", "BEGIN BULK", "Abaqus", "*NODE", "ANSYS", "/PREP7", "'.txt'"):
        assert word in str(caught.value)


def test_a_study_of_a_script(tmp_path: Path, capsys):
    (tmp_path / "beam.mac").write_text(BEAM)
    study = tmp_path / "s"
    assert main(["new", str(study), "--from", str(tmp_path / "beam.mac")]) == 0
    assert main(["modes", str(study / "study.toml")]) == 0
    assert "7.0870" in capsys.readouterr().out


def test_places_of_a_part_in_an_ansys_deck(tmp_path: Path):
    K, M = np.eye(12), np.eye(12)
    dofs = [(n, d) for n in (1, 2) for d in range(1, 7)]
    scipy.io.savemat(tmp_path / "part.mat", {"K": K, "M": M, "dofs": np.array(dofs)})
    (tmp_path / "part.dat").write_text(BEAM)
    part = read_matrices(tmp_path / "part.mat", deck=tmp_path / "part.dat")
    np.testing.assert_array_equal(part.points, [[0, 0, 0], [1, 0, 0]])
