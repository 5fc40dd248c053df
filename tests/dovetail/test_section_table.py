"""Sections by name: a table of one's own, and rolled shapes of EN 10365."""

import numpy as np
import pytest

from dovetail.file.config import read_study
from dovetail.file.paths import input_files
from dovetail.file.section_table import rolled
from dovetail.file.table import StudyError
from fem.elements.frame import Frame
from fem.sections.section import Section

STUDY = """
{top}
[points]
A = [0, 0, 0]
B = [0, 0, 2]

[members.mast]
from = "A"
to = "B"
{section}

[materials.steel]
E = 210e9
rho = 7850.0

[[supports]]
point = "A"
{more}
"""


def section(tmp_path, name=None, top="", more=""):
    own = f'section = "{name}"' if name else ""
    text = STUDY.format(top=top, section=own, more=more)
    model = read_study(text, tmp_path / "study.toml").model
    return model.of_kind(Frame)[0].members["mast"].section


@pytest.mark.parametrize(
    ("name", "A", "Iy", "Iz", "J"),
    [  # cm², cm⁴: ArcelorMittal's catalogue as the tests of metku (MIT) and others print it
        ("IPE 200", 28.5, 1943, 142, 6.98),
        ("HEA 100", 21.2, 349, 134, 5.24),
        ("HE 100 B", 26.0, 450, 167, 9.04),
    ],
)
def test_rolled_shapes_have_the_constants_of_their_tables(tmp_path, name, A, Iy, Iz, J):
    found = section(tmp_path, name)
    np.testing.assert_allclose([found.A * 1e4, found.Iy * 1e8, found.Iz * 1e8], [A, Iy, Iz], rtol=3e-3)
    assert pytest.approx(J, rel=0.06) == found.J * 1e8  # catalogues estimate it


def test_a_heavy_shape_has_the_constants_of_its_table():
    """HEM 200, mm: the same source."""
    found = Section.i_section(206.0, 220.0, 25.0, 15.0, r=18.0)
    np.testing.assert_allclose([found.A, found.Iy, found.Iz], [13128, 106.4e6, 36.51e6], rtol=5e-4)


def test_names_of_rolled_shapes_may_be_written_in_several_ways(tmp_path):
    one, *others = (section(tmp_path, name) for name in ("HEA 200", "HEA200", "HE 200 A", "hea-200"))
    assert all((other.A, other.Iy) == (one.A, one.Iy) for other in others)
    assert len(rolled()) == 66


def test_a_table_of_ones_own(tmp_path):
    (tmp_path / "own.csv").write_text(
        "# of the workshop\nname,shape,d [mm],t [mm],A [cm²],Iy [cm^4],Iz [cm4],J [cm4],remark\n"
        "pipe,tube,60,3,,,,,new\nslab,,,,12.5,40,90,25,\n",
        encoding="utf-8",
    )
    for top, more in (('sections = "own.csv"', ""), ("", '[sections]\nfile = "own.csv"')):
        pipe, slab = (section(tmp_path, name, top, more) for name in ("pipe", "slab"))
        assert pytest.approx(Section.tube(0.06, 0.003).A) == pipe.A
        assert (slab.A, slab.Iy, slab.Iz, slab.J) == pytest.approx((12.5e-4, 40e-8, 90e-8, 25e-8))
    with_own = '[sections]\nfile = "own.csv"\n[sections.rod]\nshape = "circle"\nd = 0.02'
    assert pytest.approx(np.pi * 1e-4) == section(tmp_path, "rod", more=with_own).A
    notes = read_study(
        STUDY.format(top='sections = "own.csv"', section='section = "pipe"', more=""), tmp_path / "s.toml"
    ).assumptions
    assert "own.csv: the columns remark are not used" in notes


def test_the_only_section_is_the_default(tmp_path):
    (tmp_path / "own.csv").write_text("name,shape,d\nrod,circle,0.02\n", encoding="utf-8")
    assert section(tmp_path, top='sections = "own.csv"').label


def test_the_table_is_an_input_file(tmp_path):
    (tmp_path / "own.csv").write_text("name,shape,d\nrod,circle,0.02\n", encoding="utf-8")
    study = tmp_path / "study.toml"
    study.write_text(STUDY.format(top='sections = "own.csv"', section="", more=""), encoding="utf-8")
    assert tmp_path / "own.csv" in [file.path for file in input_files(study)]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("name,shape,d [cm2]\nrod,circle,2\n", r"own\.csv, column d \[cm2\]: d is a length to the power 1"),
        (
            "name,shape,d [mm]\nrod,circle,thick\n",
            r"own\.csv, row 2, column d \[mm\]: 'thick' is not allowed",
        ),
        ("name,shape,d [mm]\nrod,circle,-2\n", r"own\.csv, row 2, column d \[mm\]: -0\.002 is not allowed"),
        ("name,shape,d [mm]\nrod,round,2\n", r"own\.csv, row 2, column shape: 'round' is not allowed"),
        ("shape,d [mm]\ncircle,2\n", r"own\.csv: there is no column name"),
        (
            "name,shape,d\nrod,circle,1\nrod,circle,2\n",
            r"own\.csv, row 3, column name: there is a section 'rod'",
        ),
        ("name,shape,d\nother,circle,1\n", "there is no section 'rod'"),
    ],
)
def test_what_is_refused(tmp_path, text, message):
    (tmp_path / "own.csv").write_text(text, encoding="utf-8")
    with pytest.raises(StudyError, match=message):
        section(tmp_path, "rod", 'sections = "own.csv"')
