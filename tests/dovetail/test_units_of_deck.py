"""``dovetail new`` names the units of a deck that its materials or the test's geometry look like."""

import re

import numpy as np
import pytest

from dovetail import main
from dovetail.report import words
from fem import FRF
from fem.declarations import Site
from fem.io import Points, write_uff
from fem.lengths import coordinates_text, metres_afterwards, show_lengths
from tests.frames import STUDY

PLACES = np.array([[0, 0, 0], [1000, 0, 0], [1000, 700, 0], [0, 700, 400]], dtype=float)


def deck(E, rho):
    """Return a deck of three bars, whose longest is 1 m in mm."""
    grids = "".join(f"GRID,{k},,{','.join(f'{v:.1f}' for v in xyz)}\n" for k, xyz in enumerate(PLACES, 1))
    bars = "".join(f"CBAR,{k},1,{k},{k + 1},0.,0.,1.\n" for k in (1, 2, 3))
    return f"{grids}{bars}PBARL,1,1,,BAR\n+,20.,30.\nMAT1,1,{E},,.3,{rho}\nSPC1,1,123456,1\n".replace(
        "..", "."
    )


@pytest.mark.parametrize(
    ("E", "rho", "asked", "likely"),
    [
        ("210000.", "7.85-9", "SI", "mm-t-s"),
        ("70000.", "2.7-9", "SI", "mm-t-s"),
        ("210000.", "", "SI", "mm-t-s"),
        ("210.", "7.85-6", "SI", "mm-kg-ms"),
        ("2.1+8", "7.85-6", "SI", "mm-kg-s"),
        ("30.+6", "7.35-4", "SI", "in-lbf-s"),
        ("2.1+11", "7850.", "mm-t-s", "SI"),
        ("2.1+11", "7850.", "SI", ""),
        ("2.1+11", "", "SI", ""),
        ("210000.", "7.85-9", "mm-t-s", ""),
        ("1.+16", "", "SI", ""),
        ("2.1+11", "7.8", "SI", ""),
    ],
)
def test_a_note_names_the_units_that_make_usual_materials(tmp_path, capsys, E, rho, asked, likely):
    (tmp_path / "a.bdf").write_text(deck(E, rho))
    assert main(["new", str(tmp_path / "s"), "--units", asked, "--from", str(tmp_path / "a.bdf")]) == 0
    notes = [line for line in capsys.readouterr().out.splitlines() if "looks like a deck in" in line]
    assert len(notes) == bool(likely)
    assert all(f"give --units {likely}, which makes E of MAT1 1" in line for line in notes)


@pytest.mark.parametrize(
    ("E", "rho", "words"),
    [
        ("210000.", "7.85-9", "dovetail: a.bdf looks like a deck in mm-t-s: give --units mm-t-s"),
        (
            "2.1+11",
            "7850.",
            "the structure is 1000 times as large as the test (1000 m and 1 m): if it",
        ),
    ],
)
def test_a_test_that_fits_nowhere_names_the_units_of_the_deck(tmp_path, capsys, E, rho, words):
    (tmp_path / "a.bdf").write_text(deck(E, rho))
    f = np.arange(1.0, 9.0)
    frf = FRF.from_arrays(f, np.ones((8, 3, 1)) * (1 + 1j), "accelerance", ["2X+", "3Y+", "4Z+"], ["4Z+"])
    write_uff(tmp_path / "t.uff", frf, geometry=Points(np.arange(1, 5), PLACES * 1e-3))
    assert main(["new", str(tmp_path / "s"), "--from", str(tmp_path / "a.bdf"), str(tmp_path / "t.uff")]) == 2
    error = capsys.readouterr().err
    assert words in error
    assert error.count("\n") == 1


def test_places_have_the_unit_of_the_deck(tmp_path, capsys):
    """And metres again once the command has ended."""
    text = STUDY + '\n[source]\nfile = "frame.bdf"\nunits = "mm-t-s"\n'
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    assert main(["candidates", str(tmp_path / "study.toml"), "--kind", "point_mass", "--kind", "crack"]) == 0
    places = re.findall(r"member arm at (\S+ \w+)", capsys.readouterr().out)
    assert set(places) == {"200 mm"}
    assert Site("member arm", 0.2) == "member arm at 0.200 m"


@pytest.mark.parametrize(
    ("size", "along", "at", "value"),
    [
        (1.0, "0.600 m", "(0.45, 0, −0.8) m", "0.600 ± 0.020 m"),
        (1e-3, "600 mm", "(450, 0, −800) mm", "600 ± 20 mm"),
        (0.0254, "23.6 in", "(17.72, 0, −31.5) in", "23.62 ± 0.79 in"),
        (1.2, "0.600 m", "(0.45, 0, −0.8) m", "0.600 ± 0.020 m"),
    ],
)
def test_lengths_are_as_exact_in_each_unit(size, along, at, value):
    with metres_afterwards():
        show_lengths(size)
        assert Site("member arm", 0.6).at == along
        assert coordinates_text([0.45, -1e-12, -0.8]) == at
        assert words.with_unit(0.6, "m", 0.02).replace("\u00a0", " ") == value
