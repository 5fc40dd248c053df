"""Sensors and excitations from a table in a file; errors name row and column."""

import numpy as np
import pytest

from dovetail import StudyError, main
from dovetail.file import input_files, with_paths
from tests.frames import MAST
from tests.studies import study_from

MODEL = f"""\
{MAST}
[frequency]
stop = 60.0
"""


def load(folder, table, excitations='[[excitations]]\nsensor = "b"\n', text=None):
    (folder / "sensors.csv").write_text(table, encoding="utf-8")
    return study_from(
        folder, text or f'sensors = "sensors.csv"\n{MODEL}{excitations}', ("sensors", "measurements")
    )


def test_a_table_says_what_the_tables_of_the_study_say(tmp_path):
    study = load(
        tmp_path,
        "name,x,y,z,direction,gain,mass,label,comment\n"
        "a,0,0,0.5,-x,1.1,0.02,1X+,bolted\n# not yet glued\nb,0,0,1,y,,,2Y+,\n",
    )
    a, b = study.sensors
    assert (a.name, a.gain, a.mass, b.gain, b.mass) == ("a", 1.1, 0.02, 1.0, 0.0)
    np.testing.assert_allclose(a.point, [0, 0, 0.5])
    np.testing.assert_allclose(a.direction, [-1, 0, 0])
    assert study.labels["outputs"] == {"a": "1X+", "b": "2Y+"}
    assert [e.name for e in study.excitations] == ["b"]
    assert any("the column comment is not used" in text for text in study.assumptions)


def test_units_decimal_commas_and_several_directions(tmp_path):
    study = load(
        tmp_path,
        "Name;x [mm];y [mm];z [mm];Directions;mass\nA;0;0;500,5;xyz;0,01\nb;0;0;1000;Y-;\n",
    )
    assert [s.name for s in study.sensors] == ["Ax", "Ay", "Az", "b"]
    np.testing.assert_allclose(study.sensors[0].point, [0, 0, 0.5005])
    np.testing.assert_allclose(study.sensors[3].direction, [0, -1, 0])
    assert [s.mass for s in study.sensors] == [0.01, 0, 0, 0]  # one body with three channels


def test_places_by_name_and_by_member_and_directions_by_components(tmp_path):
    study = load(
        tmp_path, "name\tpoint\tmember\tposition\tdx\tdy\tdz\na\t\tmast\t0.25\t3\t4\t0\nb\ttip\t\t\t0\t0\t1\n"
    )
    np.testing.assert_allclose(study.sensors[0].point, [0, 0, 0.25])
    np.testing.assert_allclose(study.sensors[0].direction, [0.6, 0.8, 0])
    np.testing.assert_allclose(study.sensors[1].point, [0, 0, 1])


def test_a_file_beside_tables_and_excitations_in_a_file(tmp_path):
    (tmp_path / "hammer.csv").write_text("name,point,direction\nhit,tip,-y\n", encoding="utf-8")
    more = '[[sensors]]\nfile = "sensors.csv"\n[[sensors]]\nname = "c"\npoint = "tip"\ndirection = "x"\n'
    study = load(
        tmp_path, "name,point,direction\nb,tip,y\n", text=f'excitations = "hammer.csv"\n{MODEL}{more}'
    )
    assert [s.name for s in study.sensors] == ["b", "c"]
    assert [e.name for e in study.excitations] == ["hit"]
    files = {f.path.name: f.what for f in input_files(tmp_path / "study.toml")}
    assert files["sensors.csv"] == "the table of sensors of study.toml"
    assert "hammer.csv" in files
    moved = with_paths((tmp_path / "study.toml").read_text(encoding="utf-8"), tmp_path, tmp_path / "out")
    assert '"../sensors.csv"' in moved
    assert '"../hammer.csv"' in moved


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ("name,x,y,z,direction\na,0,0,half,x\n", r"row 2, column z: 'half' is not allowed; a number"),
        ("name,x,y,z,direction\na,0,0,nan,x\n", r"row 2, column z: 'nan' is not allowed"),
        ("name,x,y,z,direction\na,0,,0.5,x\n", r"row 2, column y: it is empty, and x is not"),
        ("name,x [mm],y [mm],z [mm],direction\na,0,0,,x\n", r"row 2, column z \[mm\]: it is empty"),
        ("name,x,y,z,direction\nb,0,0,1,x\na,0,0,0.5,up\n", r"row 3, column direction: 'up' is not allowed"),
        (
            "name,x,y,z,direction\nb,0,0,1,x\nb,0,0,0.5,x\n",
            r"row 3, column name: two sensors have the name 'b'",
        ),
        ("name,x,y,z,direction\na,0,0,0.5,x,9\n", r"row 2: it has 6 cells, the heading has 5"),
        ("name,x,y,z,direction\na,5,0,0.5,x\n", r"row 2.*sensor 'a' .* from the nearest member"),
        ("name,x,y,z\na,0,0,0.5\n", r"row 2: 'direction' is missing"),
        ("name,x,z,direction\na,0,0.5,x\n", r"sensors\.csv: it has the column x and no column y"),
        ("name,x [furlong],y,z,direction\na,0,0,0.5,x\n", r"column x \[furlong\]: the unit 'furlong'.*mm"),
        ("name,point,direction,gain\na,tip,x,-1\n", r"row 2, column gain: -1.0 is not allowed; a positive"),
        ("name,point,direction\na,top,x\n", r"row 2, column point: .*'top'"),
        ("name,node,direction\na,1.5,x\n", r"row 2, column node: '1.5' is not allowed; a whole number"),
        ("name,node,direction\na,7,x\n", r"row 2, column node: there is no node 7"),
        (
            "name,point,direction,label\na,tip,xy,1X+\n",
            r"row 2, column label: one label does not fit several",
        ),
        (
            "name,point,direction,Direction\na,tip,x,y\n",
            r"column Direction: the column direction has the same meaning",
        ),
        (
            "name,point,direction,conjugate\na,tip,x,maybe\n",
            r"row 2, column conjugate: 'maybe' is not allowed",
        ),
        ("nom,ou\na,tip\n", r"no heading is known \(nom, ou\); allowed are gain"),
        ("name,point,direction\n", r"a heading and a row for each sensor"),
        ("\0\0", "it is no text"),
    ],
)
def test_errors_name_row_and_column(tmp_path, table, words):
    with pytest.raises(StudyError, match=words):
        load(tmp_path, table)


def test_a_heading_that_is_misspelt_is_said(tmp_path):
    study = load(tmp_path, "name,point,direction,gian\nb,tip,x,1.2\n")
    assert any("the column gian is not used; did you mean 'gain'?" in text for text in study.assumptions)


@pytest.mark.parametrize("heading", ["x_mm,y_mm,z_mm", "X-Koord,Y-Koord,Z-Koord"])
def test_headings_of_coordinates_that_are_not_known_are_one_error(tmp_path, heading):
    with pytest.raises(
        StudyError, match=rf"sensors\.csv: no column gives places, and {heading.replace(',', ', ')} are"
    ):
        load(tmp_path, f"name,{heading},direction\na,0,0,500,x\nb,0,0,1000,x\n")


def test_no_file_and_more_keys_are_refused(tmp_path):
    with pytest.raises(StudyError, match=r"sensors\[1\]\.file: there is no file"):
        load(tmp_path, "", text=f'sensors = "none.csv"\n{MODEL}')
    with pytest.raises(StudyError, match=r"unknown key"):
        load(tmp_path, "", text=f'{MODEL}[[sensors]]\nfile = "sensors.csv"\ngain = 2.0\n')


THREE = "a,0,0,0.2,x\nb,0,0,0.6,x\nc,0,0,1,x\n"


def of_three(folder, heading, rows=THREE):
    return load(folder, f"name,{heading},direction\n{rows}").warnings


@pytest.mark.parametrize(
    ("heading", "rows", "words"),
    [
        ("x [mm],y [mm],z [mm]", THREE, ["within 0.8 mm", "look like m, and the heading says mm", "x [m]"]),
        (
            "x [ft],y [ft],z [ft]",
            "a,0,0,0.001,x\nb,0,0,0.002,y\nc,0,0,0.0031,x\n",
            ["the 3 sensors", "look at their unit"],
        ),
        ("x,y,z", "a,0,0,0.5,x\nb,0,0,0.5005,x\nc,0,0,0.501,x\n", ["within 1 mm", "the motion of one place"]),
    ],
)
def test_sensors_in_a_tiny_part_of_the_structure_are_suspicious(tmp_path, heading, rows, words):
    (warning,) = of_three(tmp_path, heading, rows)
    assert warning.startswith("sensors.csv, row 2: ")
    for word in words:
        assert word in warning


@pytest.mark.parametrize(
    ("heading", "rows", "words"),
    [
        (
            "x [in],y [in],z [in]",
            "a,0,0,0.2,x\nb,0,0,0.6,x\nc,1,0,1,x\n",
            ["look like m, and the heading says in", "x [m]"],
        ),
        ("x [in],y [in],z [in]", THREE, ["look like m, and the heading says in"]),
        (
            "x [mm],y [mm],z [mm]",
            "a,30,0,39.37,x\nb,39.37,0,39.37,x\nc,35,0,39.37,x\n",
            ["times 25.4 they are on it: the numbers look like in", "x [in]"],
        ),
    ],
)
def test_a_wrong_unit_of_sensors_close_to_the_structure_is_one_sentence(tmp_path, heading, rows, words):
    """An arm of 1 m is on the mast of 1 m."""
    bar = 'section = {shape = "rectangle", b = 0.02, h = 0.02}'
    more = f'end = [1, 0, 1]\n[members.arm]\nfrom = "tip"\nto = "end"\n{bar}\n'
    arm = MODEL.replace("[members.", f"{more}[members.", 1)
    text = f'sensors = "sensors.csv"\n{arm}[[excitations]]\nsensor = "b"\n'
    try:
        (sentence,) = load(tmp_path, f"name,{heading},direction\n{rows}", text=text).warnings
    except StudyError as reason:
        sentence = str(reason)
    for word in words:
        assert word in sentence


def test_sensors_around_a_joint_and_in_three_directions_are_plausible(tmp_path):
    assert of_three(tmp_path, "x,y,z", "a,0,0,0.49,x\nb,0,0,0.5,x\nc,0,0,0.52,x\n") == ()
    assert of_three(tmp_path, "x,y,z", "b,0,0,1,x\nb2,0,0,1,y\nb3,0,0,1,z\n") == ()


@pytest.mark.parametrize("heading", ["x,y,z", "x [m],y [m],z [m]"])
def test_coordinates_in_mm_without_their_unit_are_one_error(tmp_path, heading):
    with pytest.raises(
        StudyError, match=r"row 2, column x.*the 3 sensors.*times 0.001.*write the heading as x \[mm\]"
    ):
        of_three(tmp_path, heading, "a,0,0,200,x\nb,0,0,600,x\nc,0,0,1000,x\n")


def test_frfs_of_sensors_beside_a_clamp_do_not_blame_their_unit(tmp_path):
    text = f'sensors = "sensors.csv"\n{MODEL}[[excitations]]\nname = "f"\npoint = "tip"\ndirection = "x"\n'
    right = f"name,x,y,z,direction\n{THREE}"
    load(tmp_path, right, text=text)
    assert main(["frf", str(tmp_path / "study.toml"), "--out", str(tmp_path / "m.npz")]) == 0
    wrong = right.replace("x,y,z", "x [mm],y [mm],z [mm]")
    warnings = load(tmp_path, wrong, text=f'{text}[[measurements]]\nfile = "m.npz"\n').warnings
    (of_frfs,) = [w for w in warnings if "FRFs" in w]
    assert "hardly moves at its sensors" in of_frfs
    assert "their unit" not in of_frfs
