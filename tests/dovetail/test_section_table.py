"""Sections by name: a table of one's own, and rolled shapes of EN 10365."""

import numpy as np
import pytest

from dovetail import StudyError
from dovetail.file import input_files, read_study, rolled
from fem import Frame, Section
from tests.studies import study_file

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


AISC = """\
Type,EDI_Std_Nomenclature,AISC_Manual_Label,T_F,W,A,d,Ht,OD,bf,B,b,tw,tf,t,tnom,tdes,x,y,Ix,Iy,J,\
AISC_Manual_Label,A,Ix
W,W8X24,W8X24,F,24,7.08,7.93,–,–,6.5,–,–,0.245,0.4,–,–,–,–,–,82.7,18.3,0.346,W200X35.9,4570,34.4
C,C10X20,C10X20,F,20,5.87,10,–,–,2.74,–,–,0.379,0.436,–,–,–,0.606,–,78.9,2.8,0.368,C250X30,3790,32.8
L,L8X6X1,L8X6X1,F,44.2,13.1,6,–,–,–,–,8,–,–,1,–,–,1.65,2.65,80.9,38.8,4.34,L203X152X25.4,8450,33.7
HSS,HSS24X12X5/8,HSS24X12X5/8,F,144,39.6,–,24,–,–,12,10.3,–,–,–,0.625,0.581,–,–,2940,1000,2430,a,1,1
HSS,HSS10X.5,HSS10X.500,F,50.8,13.9,–,–,10,–,–,–,–,–,–,0.5,0.465,–,–,159,159,317,b,1,1
2L,2L8X8X1,2L8X8X1,F,102,30.2,8,–,–,–,–,8,–,–,1,–,–,–,2.36,178,322,–,c,1,1
"""


@pytest.mark.parametrize(
    ("name", "A", "Iy", "Iz", "J"),
    [
        ("W8x24", 7.08, 82.7, 18.3, 0.346),
        ("HSS24X12X5/8", 39.6, 2940, 1000, 2430),
        ("HSS10X.500", 13.9, 159, 159, 317),
    ],
)
def test_the_database_of_aisc(tmp_path, name, A, Iy, Iz, J):
    """Rows as AISC's manual prints them."""
    (tmp_path / "aisc.csv").write_text(AISC, encoding="utf-8")
    found = section(tmp_path, name, 'sections = "aisc.csv"')
    inch = 0.0254
    assert (found.A / inch**2, found.Iy / inch**4) == pytest.approx((A, Iy))
    assert (found.Iz / inch**4, found.J / inch**4) == pytest.approx((Iz, J))
    assert found.outlines
    assert found.ky > 0


def test_channels_and_angles_of_aisc(tmp_path):
    (tmp_path / "aisc.csv").write_text(AISC, encoding="utf-8")
    inch = 0.0254
    channel = section(tmp_path, "C10X20", 'sections = "aisc.csv"')
    # AISC: x + eo; its flanges are thicker at the web than at the tips, ours of one thickness
    assert -channel.shear_centre[0] / inch == pytest.approx(0.606 + 0.636, rel=0.06)
    angle = section(tmp_path, "L8X6X1", 'sections = "aisc.csv"')
    assert angle.A / inch**2 == pytest.approx(13.1)
    # the sum of both moments does not depend on the axes
    assert (angle.Iy + angle.Iz) / inch**4 == pytest.approx(80.9 + 38.8, rel=0.01)
    with pytest.raises(StudyError, match="no section '2L8X8X1'"):
        section(tmp_path, "2L8X8X1", 'sections = "aisc.csv"')


@pytest.mark.parametrize(
    ("section", "expected"),
    [
        ("'pipe'", Section.tube(0.05, 0.002, nu=0.4)),
        ("{ shape = 'tube', d = 0.05, t = 0.002 }", Section.tube(0.05, 0.002, nu=0.4)),
        ("{ shape = 'tube', d = 0.05, t = 0.002, nu = 0.1 }", Section.tube(0.05, 0.002, nu=0.1)),
        ("'IPE 200'", Section.i_section(0.1, 0.2, 0.0085, 0.0056, 0.012, nu=0.4)),
    ],
)
def test_a_sections_nu_is_its_materials_unless_it_states_one(tmp_path, section, expected):
    text = STUDY.format(top="", section=f"section = {section}\nmaterial = 'lead'", more="")
    text += """
[sections.pipe]
shape = "tube"
d = 0.05
t = 0.002

[materials.lead]
E = 16e9
rho = 11340.0
nu = 0.4
"""
    found = read_study(text, tmp_path / "study.toml").model.of_kind(Frame)[0].members["mast"].section
    assert (found.ky, found.kz) == pytest.approx((expected.ky, expected.kz), rel=1e-12)


def test_two_members_of_one_section_have_the_nu_of_their_materials(tmp_path):
    text = (
        STUDY.format(top="", section="section = 'pipe'\nmaterial = 'lead'", more="")
        .replace(
            "[members.mast]",
            "[members.top]\nfrom = 'B'\nto = 'C'\nsection = 'pipe'\nmaterial = 'steel'\n\n[members.mast]",
        )
        .replace("B = [0, 0, 2]", "B = [0, 0, 2]\nC = [0, 0, 3]")
    )
    text += "[sections.pipe]\nshape = 'tube'\nd = 0.05\nt = 0.002\n"
    text += "[materials.lead]\nE = 16e9\nrho = 11340.0\nnu = 0.4\n"
    members = read_study(text, tmp_path / "study.toml").model.of_kind(Frame)[0].members
    expected = {"mast": Section.tube(0.05, 0.002, nu=0.4).ky, "top": Section.tube(0.05, 0.002, nu=0.3).ky}
    assert {k: p.section.ky for k, p in members.items()} == pytest.approx(expected, rel=1e-12)


def test_a_section_that_no_member_has_is_read_for_its_errors(tmp_path):
    more = "[sections.pipe]\nshape = 'tube'\nd = -0.05\nt = 0.002\n"
    with pytest.raises(StudyError, match=r"sections.pipe.d: -0.05 is not allowed"):
        section(tmp_path, "IPE 200", more=more)


def test_the_only_section_is_the_default(tmp_path):
    (tmp_path / "own.csv").write_text("name,shape,d\nrod,circle,0.02\n", encoding="utf-8")
    assert section(tmp_path, top='sections = "own.csv"').label


def test_the_table_is_an_input_file(tmp_path):
    (tmp_path / "own.csv").write_text("name,shape,d\nrod,circle,0.02\n", encoding="utf-8")
    study = study_file(tmp_path, STUDY.format(top='sections = "own.csv"', section="", more=""))
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
        ("name,A,Ix,Iy,J\nrod,1,1,1,1\n", "bending along the height has Iy, which tables with Ix"),
    ],
)
def test_what_is_refused(tmp_path, text, message):
    (tmp_path / "own.csv").write_text(text, encoding="utf-8")
    with pytest.raises(StudyError, match=message):
        section(tmp_path, "rod", 'sections = "own.csv"')
