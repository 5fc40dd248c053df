"""Commands on loads and motions: what they print and write is what Python computes."""

import json

import numpy as np
import pytest

from dovetail import load_study, main
from dovetail.disk.output import null_keys
from dovetail.file import at_speed
from fem import (
    Excitation,
    Tabulated,
    assemble,
    compute_base_frf,
    solve_campbell,
    solve_complex_modes,
    solve_random,
    solve_spectrum,
    solve_transient,
    solve_unbalance,
)
from fem.analysis.statics import load_vectors
from fem.io import read_mesh, read_npz
from tests.studies import study_file
from updating import sensor_rows

COLUMN = """
[points]
A = [0, 0, 0]
B = [0, 0, 2]
[members.column]
from = "A"
to = "B"
section = { A = 1e-3, Iy = 1e-6, Iz = 2e-6, J = 1e-6 }
theory = "euler-bernoulli"
elements = 8
[materials.steel]
E = 200e9
rho = 7850
[[supports]]
point = "A"
[[joints]]
name = "damper"
point1 = "B"
c = { cx = 200.0 }
[[loads]]
case = "weight"
point = "B"
force = [0, 0, -1000]
[[loads]]
case = "wind"
member = "column"
force_per_length = [500, 0, 0]
[[combinations]]
name = "both"
factors = { weight = 1.35, wind = 1.5 }
[[envelopes]]
name = "design"
[[sensors]]
name = "top"
point = "B"
direction = "x"
[[excitations]]
sensor = "top"
"""


@pytest.fixture
def column(tmp_path):
    return study_file(tmp_path, COLUMN)


def with_shape(text):
    """Return the study with a round bar of 60 mm."""
    bar = text.replace("{ A = 1e-3, Iy = 1e-6, Iz = 2e-6, J = 1e-6 }", '"bar"')
    return bar + '[sections.bar]\nshape = "circle"\nd = 0.06\n'


def printed(capsys, *arguments):
    assert main([str(a) for a in arguments]) == 0
    found = json.loads(capsys.readouterr().out)
    assert set(null_keys(found)) == found.get("missing", {}).keys()
    return found


def refused(capsys, *arguments):
    assert main([str(a) for a in arguments]) == 2
    return capsys.readouterr().err


def test_static(column, capsys):
    found = printed(capsys, "static", column, "--json", "-", "--pieces", "4")
    assert list(found["cases"]) == ["weight", "wind", "both"]
    both = found["cases"]["both"]
    assert both["reactions"]["A"]["z"] == pytest.approx(1350)
    assert both["reactions"]["A"]["x"] == pytest.approx(-1.5 * 500 * 2)
    assert both["members"]["column"]["position_m"] == [0, 0.5, 1, 1.5, 2]
    bending = np.array(both["members"]["column"]["My"])
    assert np.abs(bending) == pytest.approx(1.5 * 500 * (2 - np.linspace(0, 2, 5)) ** 2 / 2, abs=1e-6)
    assert both["points"]["B"]["x"] == pytest.approx(1.5 * 500 * 2**4 / (8 * 200e9 * 1e-6))
    assert both["largest_displacement"]["place"] == "B"
    design = found["envelopes"]["design"]["members"]["column"]["N"]
    assert design["low"] == pytest.approx(-1350)
    assert design["low_case"] == "both"
    assert main(["static", str(column), "--case", "wind"]) == 0
    out = capsys.readouterr().out
    assert "wind: largest displacement 5 mm, B" in out
    assert "envelope" not in out  # of cases that were not asked for
    assert "did you mean 'wind'" in refused(capsys, "static", column, "--case", "win")


def test_forces_and_stresses_of_free_expansion_are_printed_as_0(column, tmp_path, capsys):
    text = column.read_text(encoding="utf-8").replace("B = [0, 0, 2]", "B = [0.3, 0.4, 2]")
    text = with_shape(text[: text.index("[[loads]]")])
    column.write_text(text + "[[loads]]\ntemperature = 80\nexpansion = 12e-6\n", encoding="utf-8")
    case = printed(capsys, "static", column, "--json", "-")["cases"]["load"]
    assert any(case["members"]["column"]["N"])  # as computed
    assert max(map(abs, case["members"]["column"]["N"])) < case["rounding"]["force_N"] < 1e-3
    assert main(["static", str(column), "--picture", str(tmp_path / "pictures")]) == 0
    lines = capsys.readouterr().out.splitlines()
    (held,) = (line.split()[1:] for line in lines if line.startswith("  A "))
    assert held == ["0"] * 6
    assert not [line for line in lines if line.startswith("  N ")]
    assert "  largest von Mises stress 0 MPa in column" in lines
    assert [p.name for p in (tmp_path / "pictures").glob("*.png")] == ["01-load-deflection.png"]


def test_static_stresses_and_their_envelope(column, capsys):
    column.write_text(with_shape(column.read_text(encoding="utf-8")), encoding="utf-8")
    found = printed(capsys, "static", column, "--json", "-", "--pieces", "4")
    bent = 1.5 * 500 * (2 - np.linspace(0, 2, 5)) ** 2 / 2 / (np.pi * 0.06**3 / 32)
    own = found["cases"]["both"]["members"]["column"]
    pressed = -1350 / (np.pi * 0.03**2)
    assert own["stress_high"] == pytest.approx(pressed + bent, rel=1e-6)
    assert own["stress_low"] == pytest.approx(pressed - bent, rel=1e-6)
    design = found["envelopes"]["design"]["members"]["column"]["stress"]
    assert (design["low_case"], design["low"]) == ("both", pytest.approx(pressed - bent[0], rel=1e-6))
    assert main(["static", str(column)]) == 0
    out = capsys.readouterr().out
    assert f"normal stress from {1e-6 * (pressed - bent[0]):.5g} MPa in column" in out
    # shear 1.3846 V/A in the middle of a round bar with ν = 0.3, where it is the largest
    V = 1.5 * 500 * 2 / (np.pi * 0.03**2)
    assert own["stress_shear"][0] == pytest.approx(V * 3.6 / 2.6, rel=1e-6)
    assert own["stress_shear"][-1] == pytest.approx(0, abs=1)
    assert own["stress_von_mises"][0] == pytest.approx(bent[0] - pressed, rel=1e-3)
    assert f"largest shear stress {1e-6 * V * 3.6 / 2.6:.5g} MPa in column" in out
    assert "largest von Mises stress [MPa]: column" in out
    design = found["envelopes"]["design"]["members"]["column"]
    assert design["stress_shear"]["high_case"] == "both"
    assert design["stress_von_mises"]["high"] == pytest.approx(bent[0] - pressed, rel=1e-3)
    path = column.parent / "static.vtu"
    assert main(["static", str(column), "--vtu", str(path), "--quiet"]) == 0
    assert "both, stress_von_mises" in path.read_text(encoding="latin1")


def test_stresses_that_are_not_known_are_blank_with_the_reason(column, capsys):
    own = printed(capsys, "static", column, "--json", "-")["cases"]["both"]["members"]["column"]
    assert own["stress_missing"] == "the outline of the section is not given"
    assert not {"stress_low", "stress_shear", "stress_von_mises"} & set(own)
    assert main(["static", str(column)]) == 0
    assert "MPa" not in capsys.readouterr().out
    text = column.read_text(encoding="utf-8").replace(
        "{ A = 1e-3, Iy = 1e-6, Iz = 2e-6, J = 1e-6 }", '"plate"'
    )
    plate = '[sections.plate]\nshape = "polygon"\nouter = [[0, 0], [0.1, 0], [0.05, 0.08]]\nJ = 1e-6\n'
    column.write_text(text + plate, encoding="utf-8")
    own = printed(capsys, "static", column, "--json", "-")["cases"]["both"]["members"]["column"]
    assert own["stress_missing"] == "no formula for shear and torsion of an outline"
    assert "stress_high" in own
    assert "stress_von_mises" not in own
    assert main(["static", str(column)]) == 0
    assert "not known in column: no formula" in capsys.readouterr().out


def test_static_writes_a_field(column, tmp_path, capsys):
    path = tmp_path / "static.vtu"
    assert main(["static", str(column), "--vtu", str(path), "--quiet"]) == 0
    text = path.read_text(encoding="latin1")
    assert "both, My" in text
    assert "stress_" not in text  # the section is given by its constants
    assert read_mesh(path).n_lines == load_study(column).model.mesh.n_lines
    assert "written as .vtu, .vtk or .xdmf" in refused(capsys, "static", column, "--vtu", tmp_path / "a.txt")


@pytest.mark.usefixtures("offscreen")
def test_static_and_buckling_draw(column, tmp_path):
    folder = tmp_path / "pictures"
    column.write_text(with_shape(column.read_text(encoding="utf-8")), encoding="utf-8")
    assert main(["static", str(column), "--case", "weight", "--picture", str(folder), "--quiet"]) == 0
    drawn = ("N", "deflection", "normal-stress", "von-mises-stress")
    assert sorted(p.name for p in folder.glob("*.png")) == [f"01-weight-{what}.png" for what in drawn]
    arguments = ["--case", "weight", "--number", "1", "--picture", str(folder), "--quiet"]
    assert main(["buckling", str(column), *arguments]) == 0
    assert [p.name for p in folder.glob("*.png")] == ["buckling-01.png"]


def test_buckling(column, tmp_path, capsys):
    options = ("--case", "weight", "--number", "2", "--json", "-", "--vtu", tmp_path / "b.vtu")
    found = printed(capsys, "buckling", column, *options)
    euler = np.pi**2 * 200e9 * np.array([1e-6, 2e-6]) / (4 * 2**2) / 1000
    assert found["factors"] == pytest.approx(euler, rel=1e-5)
    assert found["moves_most"] == ["column", "column"]
    assert "several load cases; give --case, one of weight, wind, both" in refused(capsys, "buckling", column)


def test_complex(column, tmp_path, capsys):
    out = tmp_path / "modes.npz"
    found = printed(capsys, "complex", column, "--number", "4", "--json", "-", "--out", out)
    direct = solve_complex_modes(assemble(load_study(column).model), 4)
    assert [m["damping_ratio"] for m in found["modes"]] == pytest.approx(direct.zeta.tolist())
    assert [m["frequency_Hz"] for m in found["modes"]] == pytest.approx(direct.frequency.tolist())
    assert found["converged"]
    assert out.exists()
    assert "not '.txt'" in refused(capsys, "complex", column, "--out", tmp_path / "a.txt")


ROTOR = """
[points]
A = [0, 0, 0]
B = [1, 0, 0]
[members.shaft]
from = "A"
to = "B"
section = { shape = "circle", d = 0.05 }
elements = 4
spin = 2.0
[materials.steel]
E = 200e9
rho = 7850
[[supports]]
point = "A"
fixed = ["x", "y", "z", "rx"]
[[supports]]
point = "B"
fixed = ["y", "z"]
[[masses]]
name = "disc"
point = { member = "shaft", position = 0.25 }
mass = 5.0
inertia = [[0.09, 0, 0], [0, 0.05, 0], [0, 0, 0.05]]
[damping]
modal = 0.0
"""


@pytest.fixture
def rotor(tmp_path):
    path = tmp_path / "rotor.toml"
    path.write_text(ROTOR, encoding="utf-8")
    return path


def test_campbell(rotor, tmp_path, capsys):
    picture, table = tmp_path / "c.png", tmp_path / "c.csv"
    options = ("--number", "4", "--order", "1", "--order", "2", "--json", "-")
    files = ("--picture", picture, "--out", table)
    found = printed(capsys, "campbell", rotor, "--speeds", "0:6000:7", *options, *files)
    speeds = np.linspace(0, 6000, 7) * 2 * np.pi / 60
    direct = solve_campbell(load_study(rotor).model, speeds, 4, [1.0, 2.0])
    assert found["speed_rpm"] == pytest.approx(np.linspace(0, 6000, 7))
    assert found["branches"][1]["damped_frequency_Hz"] == pytest.approx(direct.frequency[:, 1])
    critical = [c["speed_rpm"] for c in found["critical_speeds"]]
    assert critical == pytest.approx([c.speed * 60 / (2 * np.pi) for c in direct.critical])
    assert {c["order"] for c in found["critical_speeds"]} == {1.0, 2.0}
    assert picture.read_bytes()[:4] == b"\x89PNG"
    rows = np.loadtxt(table, delimiter=",", skiprows=1)
    assert rows[:, 1] == pytest.approx(direct.frequency[:, 0], rel=1e-8)
    assert main(["campbell", str(rotor), "--speeds", "0:6000:7", "--number", "2"]) == 0
    out = capsys.readouterr().out
    assert "critical 1/min" in out
    assert "backward" in out
    assert "members with a spin (shaft) stand still" in out
    assert "FIRST:LAST:NUMBER" in refused(capsys, "campbell", rotor, "--speeds", "0:10")
    assert "written as .csv" in refused(
        capsys, "campbell", rotor, "--speeds", "0:9:3", "--out", tmp_path / "a.txt"
    )


UNBALANCED = (
    ROTOR
    + """
[[unbalances]]
point = { member = "shaft", position = 0.25 }
moment = 2e-4
angle = 90.0
[[sensors]]
name = "disc y"
point = { member = "shaft", position = 0.25 }
direction = "y"
[[sensors]]
name = "disc z"
point = { member = "shaft", position = 0.25 }
direction = "z"
"""
)


def test_unbalance(rotor, tmp_path, capsys):
    assert "the study has no sensors" in refused(capsys, "unbalance", rotor, "--speeds", "0:9:3")
    rotor.write_text(UNBALANCED, encoding="utf-8")
    picture, table = tmp_path / "u.png", tmp_path / "u.csv"
    files = ("--picture", picture, "--out", table)
    found = printed(capsys, "unbalance", rotor, "--speeds", "0:6000:7", "--json", "-", *files)
    study = load_study(rotor)
    speeds = np.linspace(0, 6000, 7) * 2 * np.pi / 60
    rows = sensor_rows(study.model, study.sensors)
    direct = solve_unbalance(study.model, study.unbalances, speeds, rows).displacement
    assert study.unbalances[0].angle == pytest.approx(np.pi / 2)
    np.testing.assert_allclose(found["amplitude_m"], np.abs(direct), rtol=1e-9)
    np.testing.assert_allclose(np.loadtxt(table, delimiter=",", skiprows=1)[:, 3], np.abs(direct[:, 1]))
    assert picture.read_bytes()[:4] == b"\x89PNG"
    assert main(["unbalance", str(rotor), "--speeds", "0:6000:7"]) == 0
    assert "largest [µm]" in capsys.readouterr().out
    text = UNBALANCED.replace("[[unbalances]]", "[[masses]]\nname = 'x'").replace(
        "moment = 2e-4\nangle = 90.0", "mass = 1.0"
    )
    rotor.write_text(text, encoding="utf-8")
    assert "the study has no unbalance; give [[unbalances]]" in refused(
        capsys, "unbalance", rotor, "--speeds", "0:9:3"
    )


def test_a_rotor_on_a_moving_base(rotor, tmp_path, capsys):
    """FRFs at a speed of the option and of the study are the same; a spectrum refuses them."""
    text = UNBALANCED.replace("0.25", "0.1")  # a disc that tilts
    rotor.write_text(text, encoding="utf-8")
    more = ("--motion", "y", "--start", "5", "--stop", "60", "--step", "5", "--json", "-")
    asked = printed(capsys, "base", rotor, "--rpm", "3000", *more)
    still = printed(capsys, "base", rotor, *more)
    rotor.write_text(text + "[rotation]\nrpm = 3000\n", encoding="utf-8")
    stated = printed(capsys, "base", rotor, *more)
    assert asked["imaginary"] == stated["imaginary"]
    assert abs(np.array(asked["imaginary"])[:, 1]).max() > 1e-4
    assert abs(np.array(still["imaginary"])[:, 1]).max() < 1e-12
    (tmp_path / "s.csv").write_text("frequency,base y\n1,10\n100,10\n", encoding="utf-8")
    random = printed(capsys, "psd", rotor, "--psd", tmp_path / "s.csv", "--json", "-")
    assert random["rms"]["disc z"] > 0
    assert "its rotor turns at 3000 1/min" in refused(
        capsys, "spectrum", rotor, "--spectrum", tmp_path / "s.csv"
    )


def test_complex_at_a_speed(rotor, capsys):
    found = printed(capsys, "complex", rotor, "--rpm", "3000", "--number", "4", "--json", "-")
    whirling = [m["whirl_sense"] for m in found["modes"]]
    assert whirling[:2] == ["backward", "forward"]
    model = at_speed(load_study(rotor).model, 3000)
    direct = solve_complex_modes(assemble(model, reciprocal=False), 4)
    assert [m["frequency_Hz"] for m in found["modes"]] == pytest.approx(direct.frequency.tolist())
    rotor.write_text(ROTOR + "[[loads]]\ngravity = [0, 0, -9.81]\n[rotation]\nrpm = 3000\n", encoding="utf-8")
    again = printed(capsys, "complex", rotor, "--number", "4", "--json", "-")
    assert main(["static", str(rotor)]) == 0  # a load does not feel the spin
    assert again["modes"][1]["frequency_Hz"] == pytest.approx(direct.frequency[1])


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("spin = 2.0", "", "no member has a spin"),
        ("d = 0.05 }", 'd = 0.05 }\ntheory = "bar"', "member 'shaft' cannot spin: its theory is 'bar'"),
        ("0.09, 0, 0", "0.09, 0.01, 0", "the tensor must be symmetric"),
        (
            "0, 0.05, 0]",
            "0, 0.07, 0]",
            "'disc' cannot spin: its inertia is not that of a body which is round",
        ),
    ],
)
def test_a_rotor_that_cannot_be_is_refused(rotor, capsys, old, new, message):
    rotor.write_text(ROTOR.replace(old, new) + "[rotation]\nrpm = 3000\n", encoding="utf-8")
    assert message in refused(capsys, "complex", rotor)


def test_static_of_second_order(column, capsys):
    study = load_study(column)
    found = printed(capsys, "static", column, "--second-order", "--json", "-", "--pieces", "2")
    direct = study.second_order("both")[0]
    assert found["buckling_factors"]["both"] == pytest.approx(direct.factor)
    tip = found["cases"]["both"]["points"]["B"]["x"]
    assert tip == pytest.approx(direct.solution.displacements[6 + 0, 0])
    first = printed(capsys, "static", column, "--json", "-")["cases"]["both"]["points"]["B"]["x"]
    assert tip / first == pytest.approx(1 / (1 - 1 / direct.factor), rel=0.02)  # for a load near its shape
    assert main(["static", str(column), "--second-order", "--case", "both"]) == 0
    assert "second order, buckles at" in capsys.readouterr().out
    column.write_text(COLUMN.replace("weight = 1.35", "weight = 500.0"), encoding="utf-8")
    assert "'both' makes the structure buckle at 0." in refused(capsys, "static", column, "--second-order")


def test_base(column, tmp_path, capsys):
    out, picture = tmp_path / "base.npz", tmp_path / "base.png"
    lines = ["--start", "10", "--stop", "40", "--step", "10"]
    where = ["--motion", "x", "--motion", "A:x", "--relative", "--out", out, "--picture", picture]
    found = printed(capsys, "base", column, *lines, *where, "--json", "-")
    study = load_study(column)
    rows = sensor_rows(study.model, study.sensors)
    direct = compute_base_frf(assemble(study.model), [10, 20, 30, 40], rows, ["x", ("A", "x")], relative=True)
    np.testing.assert_allclose(read_npz(out).H, direct.H)
    assert np.array(found["real"]) == pytest.approx(np.real(direct.H))
    assert picture.read_bytes()[:4] == b"\x89PNG"
    assert "'w' is not a direction; allowed are x, y" in refused(capsys, "base", column, "--motion", "w")


def test_numbers_that_are_missing_have_a_reason(column, rotor, capsys):
    base = printed(capsys, "base", column, "--start", "10", "--stop", "20", "--step", "10", "--json", "-")
    assert base["file"] is None
    assert "--out" in base["missing"]["file"]
    still = printed(capsys, "complex", column, "--number", "2", "--json", "-")
    assert still["missing"] == {"whirl": "nothing that spins tilts in the mode"}
    fast = printed(capsys, "campbell", rotor, "--speeds", "0:60000:9", "--number", "3", "--json", "-")
    assert fast["missing"].keys() == {"whirl"}


def test_responses_need_sensors(column, capsys):
    text = COLUMN[: COLUMN.index("[[sensors]]")]
    column.write_text(text, encoding="utf-8")
    assert "the study has no sensors" in refused(capsys, "base", column)


def histories(path, time, **columns):
    names = [name.replace("_", " ") for name in columns]
    np.savetxt(
        path,
        np.column_stack([time, *columns.values()]),
        delimiter=",",
        header=",".join(["time [s]", *(f"{name} [SI]" for name in names)]),
        comments="",
    )


def test_transient(column, tmp_path, capsys):
    t = np.linspace(0, 0.5, 501)
    table, out, picture = tmp_path / "e.csv", tmp_path / "out.csv", tmp_path / "out.png"
    histories(table, t, top=5 * np.ones(501), wind=np.ones(501), base_x=np.sin(30 * t))
    files = ("--excitation", table, "--out", out, "--picture", picture)
    found = printed(capsys, "transient", column, *files, "--relative", "--json", "-", "--max", "2000")
    study = load_study(column)
    F = study.static("wind").model.n_dof
    top = 6 * study.model.mesh.point_names["B"]
    loads = np.zeros((F, 2))
    loads[top, 0] = 5
    loads[:, 1] = load_vectors(study.model, study.loads.cases[1])[:, 0]
    e = Excitation.of(study.model, t, loads, np.ones((501, 2)), {"x": np.sin(30 * t)})
    direct = solve_transient(assemble(study.model), e, [top], max_frequency=2000, relative=True)
    expected = pytest.approx(direct.displacement[:, 0], rel=1e-9, abs=1e-14)
    assert found["responses"]["top"]["displacement"] == expected
    written = np.loadtxt(out, delimiter=",", skiprows=1)
    assert written[:, 1] == pytest.approx(direct.displacement[:, 0], rel=1e-8, abs=1e-14)
    assert out.read_text(encoding="utf-8").startswith("time [s],top displacement [m],top velocity [m/s]")
    assert picture.read_bytes()[:4] == b"\x89PNG"


def test_a_release_swings_about_rest(column, tmp_path, capsys):
    out = tmp_path / "out.npz"
    arguments = ["--release", "wind", "--step", "1e-3", "--duration", "0.4", "--number", "48", "--out", out]
    found = printed(capsys, "transient", column, *arguments, "--json", "-")
    assert found["responses"]["top"]["displacement"][0] == pytest.approx(500 * 2**4 / (8 * 200e9 * 1e-6))
    with np.load(out) as arrays:
        assert arrays["displacement"].shape == (401, 1)
        assert arrays["displacement"].min() < 0
    assert "needs --step and --duration" in refused(capsys, "transient", column, "--release", "wind")
    assert "nothing acts" in refused(capsys, "transient", column)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("time,gust\n0,1\n1,2\n", "e.csv: nothing is called 'gust'; allowed are top, weight, wind, both"),
        ("seconds,top\n0,1\n1,2\n", "line 1: the header is 'seconds,top'; its first column has to"),
        ("time,top\n0,1\n1\n", "line 3: 1 columns are found, and the header has 2"),
        ("time,top\n0,1\n\n1,x\n", "line 4: 'x' is not a finite number"),
        ("time,top\n0,1\n0,1\n", "line 3: time 0 comes after 0; it has to increase"),
        ("time,top\n0,1\n1,1\n5,1\n", "steps from 1 to 4 s; equal ones are needed"),
        ("time,top,top\n0,1,1\n1,1,1\n", "the column 'top' is there twice"),
        ("time,top\n", "a header and at least two lines"),
    ],
)
def test_tables_that_cannot_be_meant_are_refused(column, tmp_path, capsys, text, message):
    table = tmp_path / "e.csv"
    table.write_text(text, encoding="utf-8")
    assert message in refused(capsys, "transient", column, "--excitation", table)


def test_tables_may_be_written_in_several_ways(column, tmp_path, capsys):
    table = tmp_path / "e.csv"
    every = []
    for text in (
        "time,base x\n0,0\n0.01,1.5\n0.02,0\n",
        "Time [s];Base X [m/s²]\n0;0\n0,01;1,5\n0,02;0\n",
    ):
        table.write_text(text, encoding="utf-8")
        every.append(printed(capsys, "transient", column, "--excitation", table, "--json", "-"))
    assert every[0] == every[1]
    assert every[0]["peaks"]["top"]["displacement"]["size"] > 0
    step = ("--step", "5")
    assert "is longer than the" in refused(capsys, "transient", column, "--excitation", table, *step)


def test_spectrum(column, tmp_path, capsys):
    by_period, by_frequency = tmp_path / "t.csv", tmp_path / "f.csv"
    by_period.write_text("period [s],x\n0,3\n0.01,3\n0.1,7.5\n2,1.5\n", encoding="utf-8")
    by_frequency.write_text("frequency [Hz],base x\n0.5,1.5\n10,7.5\n100,3\n", encoding="utf-8")
    picture = tmp_path / "s.png"
    found, same = (
        printed(capsys, "spectrum", column, "--spectrum", file, "--number", "3", "--json", "-", *more)
        for file, more in ((by_period, ["--picture", picture]), (by_frequency, []))
    )
    assert found == same
    study = load_study(column)
    direct = solve_spectrum(
        assemble(study.model),
        {"x": Tabulated.of([0.5, 10, 100], [1.5, 7.5, 3])},
        sensor_rows(study.model, study.sensors),
        n_modes=3,
    )
    assert found["sensors"]["top"]["displacement"] == pytest.approx(direct.displacement[0])
    assert found["reactions"]["A"]["x"] == pytest.approx(direct.base_force[0])
    assert found["members"]["column"]["My"] == pytest.approx(direct.reactions["A", "ry"])
    # the damper at the top counts in the correlation
    assert found["modes"][0]["damping_ratio"] > 0.15
    assert picture.read_bytes()[:4] == b"\x89PNG"
    by_period.write_text("period,up\n0.1,1\n1,1\n", encoding="utf-8")
    assert "'up' is no direction of the base" in refused(capsys, "spectrum", column, "--spectrum", by_period)


def test_the_spectrum_of_a_record_is_its_shock_response_spectrum(column, tmp_path, capsys):
    """A half sine of 11 ms: the largest amplification is 1.77 without damping, and 1 at high frequencies."""
    t = np.arange(0, 0.2, 1e-4)
    pulse = 50 * np.sin(np.pi * t / 0.011) * (t <= 0.011)
    record, spectrum = tmp_path / "record.csv", tmp_path / "spectrum.csv"
    np.savetxt(record, np.column_stack([t, pulse]), delimiter=",", header="time [s],base x", comments="")
    more = ("--number", "3", "--json", "-")
    found = printed(capsys, "spectrum", column, "--spectrum", record, "--zeta", "0", *more)
    own = found["spectra"]["x"]
    f, a = np.array(own["frequency_Hz"]), np.array(own["pseudo_acceleration"])
    assert a.max() / 50 == pytest.approx(1.77, abs=0.01)
    assert a[-1] / 50 == pytest.approx(1.0, abs=0.01)
    assert a[0] == pytest.approx(2 * np.pi * f[0] * 2 * 50 * 0.011 / np.pi, rel=0.01)  # ω times ∫ a dt
    np.savetxt(spectrum, np.column_stack([f, a]), delimiter=",", header="frequency,x", comments="")
    again = printed(capsys, "spectrum", column, "--spectrum", spectrum, *more)
    assert again["modes"] == found["modes"]
    damped = printed(capsys, "spectrum", column, "--spectrum", record, *more)["spectra"]["x"]
    assert max(damped["pseudo_acceleration"]) < 0.95 * a.max()


def test_psd(column, tmp_path, capsys):
    table, out, picture = tmp_path / "s.csv", tmp_path / "out.csv", tmp_path / "s.png"
    table.write_text("frequency [Hz];base x;top\n10;0.1;2\n100;1;2\n500;1;0\n", encoding="utf-8")
    arguments = ["--psd", table, "--response", "displacement", "--relative", "--out", out]
    found = printed(capsys, "psd", column, *arguments, "--picture", picture, "--json", "-")
    study = load_study(column)
    direct = solve_random(
        assemble(study.model),
        sensor_rows(study.model, study.sensors),
        loads=sensor_rows(study.model, study.excitations),
        forces=[Tabulated.of([10, 100, 500], [2, 2, 0])],
        base={"x": Tabulated.of([10, 100, 500], [0.1, 1, 1])},
        response="displacement",
        relative=True,
    )
    assert found["rms"]["top"] == pytest.approx(direct.rms[0])
    np.testing.assert_allclose(
        np.loadtxt(out, delimiter=",", skiprows=1)[:, 1], direct.density[:, 0], rtol=1e-6
    )
    assert picture.read_bytes()[:4] == b"\x89PNG"
    assert "not '.txt'" in refused(capsys, "psd", column, "--psd", table, "--out", tmp_path / "a.txt")


def test_what_symmetry_makes_zero_is_printed_as_zero(column, tmp_path, capsys):
    """A column that is driven along x does not move along y, but for rounding."""
    study = tmp_path / "two.toml"
    side = '[[sensors]]\nname = "side"\npoint = "B"\ndirection = "y"\n'
    study.write_text(COLUMN.replace("[[excitations]]", f"{side}[[excitations]]"), encoding="utf-8")
    (tmp_path / "quake.csv").write_text("time,base x\n0,0\n0.01,1\n0.02,-1\n0.5,0\n", encoding="utf-8")
    (tmp_path / "design.csv").write_text("frequency,x\n1,1\n100,2\n", encoding="utf-8")
    (tmp_path / "shaker.csv").write_text("frequency,base x\n1,1\n100,2\n", encoding="utf-8")
    for command, *options in (
        ("base", "--motion", "x", "--start", "1", "--stop", "100", "--step", "1"),
        ("transient", "--excitation", tmp_path / "quake.csv", "--step", "0.005"),
        ("spectrum", "--spectrum", tmp_path / "design.csv", "--number", "4"),
        ("psd", "--psd", tmp_path / "shaker.csv"),
    ):
        assert main([command, str(study), *map(str, options)]) == 0
        said = capsys.readouterr().out
        row = next(line.split()[1:] for line in said.splitlines() if line.startswith("side "))
        assert {cell for cell in row if cell not in ("base", "X+")} <= {"0", "-"}, (command, row)
        assert "standard deviations" not in said  # these commands do not use them
        top = next(line.split()[1:] for line in said.splitlines() if line.startswith("top "))
        assert "0" not in top, command


def test_pictures_go_to_a_folder(column, capsys):
    assert "a folder is needed, such as modes" in refused(capsys, "complex", column, "--picture", "modes.png")
