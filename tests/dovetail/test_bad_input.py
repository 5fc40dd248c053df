"""Bad input ends in one clear line on stderr and exit code 2, and nothing is half-written."""

import re

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from dovetail import StudyError, load_study, main
from fem import FRF, Mesh
from fem.io import read_frf, write_csv, write_npz, write_uff
from tests.studies import study_file

GOOD = """\
[materials.steel]
E = 210e9
rho = 7850

[points]
A = [0, 0, 0]
B = [1, 0, 0]

[members.bar]
from = "A"
to = "B"
section = { shape = "rectangle", b = 0.03, h = 0.01 }

[[supports]]
point = "A"

[[sensors]]
name = "tip"
point = "B"
direction = "z"

[[excitations]]
sensor = "tip"
"""
FILE = '\n[[measurements]]\nfile = "m.npz"\n'


def fails(tmp_path, capsys, text, *words, command=("compare",)):
    """Run a command on a study that must be refused; return what it says."""
    path = study_file(tmp_path, text)
    before = sorted(tmp_path.iterdir())
    out = tmp_path / "out.npz"
    extra = ["--out", str(out)] if command[0] == "frf" else []
    code = main([command[0], str(path), *command[1:], *extra])
    printed = capsys.readouterr()
    assert code == 2, printed.err
    assert printed.out == ""
    assert printed.err.startswith("dovetail: ")
    assert printed.err.count("\n") == 1
    for word in words:
        assert word in printed.err
    assert sorted(tmp_path.iterdir()) == before
    return printed.err


def test_the_good_one_is_good(tmp_path, capsys):
    (tmp_path / "study.toml").write_text(GOOD, encoding="utf-8")
    assert main(["modes", str(tmp_path / "study.toml")]) == 0
    assert "frequency" in capsys.readouterr().out


def test_part_that_a_command_does_not_need_names_the_unknown_key(tmp_path, capsys):
    path = study_file(tmp_path, GOOD.replace('direction = "z"', 'axis = "z"'))
    assert main(["modes", str(path)]) == 0
    assert "'direction' is missing; is it the unknown key 'axis'?" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            "rho = 7850",
            "rho = 7850\nrho2 = 1",
            ["line 4, materials.steel.rho2", "unknown key", "did you mean 'rho'?"],
        ),
        (
            "[materials.steel]",
            "[material.steel]",
            ["line 1, material:", "unknown key", "did you mean 'materials'?"],
        ),
        (
            "b = 0.03",
            "b = -0.03",
            ["line 12, members.bar.section.b: -0.03 is not allowed; a positive number [m]"],
        ),
        ("b = 0.03", 'b = "3 cm"', ["line 12, members.bar.section.b", "a positive number [m]"]),
        ("b = 0.03", "b = nan", ["line 12, members.bar.section.b: nan"]),
        ("b = 0.03", "b = true", ["line 12, members.bar.section.b: True"]),
        ("b = 0.03, ", "", ["line 12, members.bar.section: 'b' is missing"]),
        ('"rectangle"', '"rectangel"', ["members.bar.section.shape", "did you mean 'rectangle'?"]),
        ('"rectangle"', '"tube"', ["members.bar.section: 'd' is missing"]),
        ("E = 210e9", "EE = 210e9", ["materials.steel: 'E' is missing; is it the unknown key 'EE'?"]),
        (
            "rho = 7850",
            "density = 7850",
            [
                "line 1, materials.steel: 'rho' is missing; is it the unknown key 'density'?",
                "E, loss_factor, nu",
            ],
        ),
        (
            "E = 210e9\nrho",
            "young = 210e9\ndensity",
            ["'E' is missing; 'young' and 'density' are unknown keys; allowed are E, loss_factor, nu, rho"],
        ),
        (
            'sensor = "tip"',
            'Sensor = "tip"',
            ["excitations[1]: 'sensor' is missing", "unknown key 'Sensor'?"],
        ),
        ("b = 0.03", "B = 0.03", ["section: 'b' is missing; is it the unknown key 'B'?"]),
        (
            "section = {",
            "sectoin = {",
            ["members.bar: member 'bar' has no section", "is it the unknown key 'sectoin'?"],
        ),
        (
            "[members.bar]",
            "[defaults]\nmaterail = 'steel'\n[materials.other]\nE = 1e9\nrho = 1e3\n[members.bar]",
            ["defaults: member 'bar' has no material", "is it the unknown key 'materail'?"],
        ),
        (
            "[members.bar]",
            "[mesh]\nFile = 'a.inp'\n[members.bar]",
            ["mesh: 'file' is missing; is it the unknown key 'File'?"],
        ),
        ("b = 0.03", "width = 0.03", ["section: 'b' is missing; is it the unknown key 'width'?"]),
        ("shape =", "form =", ["neither a shape", "is it the unknown key 'form'?"]),
        ('to = "B"', 'end = "B"', ["members.bar: 'to' is missing; is it the unknown key 'end'?"]),
        ('point = "A"', 'node = "A"', ["supports[1]: 'point' is missing; is it the unknown key 'node'?"]),
        (
            'direction = "z"',
            'axis = "z"',
            ["sensors[1]: 'direction' is missing; is it the unknown key 'axis'?"],
        ),
        (
            'point = "B"\ndirection',
            'place = "B"\ndirection',
            ["sensors[1]: a place is missing", "is it the unknown key 'place'?"],
        ),
        ("section = {", "#", ["line 9, members.bar", "'bar' has no section"]),
        ("E = 210e9", "E = 0", ["line 2, materials.steel.E: 0 is not allowed"]),
        ("E = 210e9", "E = 210e9\nnu = 0.7", ["line 1, materials.steel", "nu is 0.7"]),
        ("E = 210e9", "E = 210 GPa", ["study.toml", "line 2"]),
        (
            "[materials.steel]",
            "[materials.lead]\nE = 1e9\nrho = 1e4\n[materials.steel]",
            ["'bar' has no material"],
        ),
        (
            "section = {",
            'material = "stel"\nsection = {',
            ["line 12, members.bar.material", "no material 'stel'"],
        ),
        ('to = "B"', 'to = "Q"', ["line 11, members.bar.to: there is no point 'Q'", "allowed are A, B"]),
        ('to = "B"', "to = [1, 0]", ["line 11, members.bar.to: [1, 0] is not allowed; 3 numbers [m]"]),
        ('to = "B"', "to = [0, 0, 0]", ["line 9, members.bar: the member has no length"]),
        (
            "b = 0.03",
            "b = 1e-9",
            ["line 12, members.bar.section: ", "the mesh", "at most 30000", "member 'bar' asks", "J = "],
        ),
        ('point = "A"', 'point = "A"\nfixed = 3', ["line 16, supports[1].fixed: 3 is not allowed"]),
        ('direction = "z"', "direction = {a = 1}", ["sensors[1].direction: {'a': 1} is not allowed"]),
        ("B = [1, 0, 0]", "B = [1, 0, inf]", ["line 7, points.B"]),
        (
            'to = "B"',
            'to = "B"\norientation = "x"',
            ["line 12, members.bar.orientation", "parallel to its axis"],
        ),
        (
            'to = "B"',
            'to = "B"\norientation = "w"',
            ["line 12, members.bar.orientation", "'w' is not a direction"],
        ),
        (
            'to = "B"',
            'to = "B"\nrigid1 = 0.6\nrigid2 = 0.6',
            ["members.bar: the rigid end zones", "1.2 m long together"],
        ),
        ('to = "B"', 'to = "B"\nelements = 0', ["line 12, members.bar.elements: 0", "at least 1"]),
        (
            'to = "B"',
            'to = "B"\nmass = "diagonal"',
            ["line 12, members.bar.mass", "consistent, higher-order, lumped"],
        ),
        ('to = "B"', 'to = "B"\nrelease1 = "w"', ["line 12, members.bar.release1", "'w' is not a direction"]),
        (
            'to = "B"',
            'to = "B"\nrelease1 = "rx"\nrelease2 = ["rx", "ry"]',
            ["members.bar: with rx at end 1, rx at end 2 released, nothing holds the member's torsion"],
        ),
        ('to = "B"', 'to = "B"\nspring2 = { kry = 3 }', ["members.bar.spring2.kry: unknown key", "ry"]),
        (
            'to = "B"',
            'to = "B"\nspring2 = { ry = -3 }',
            ["members.bar.spring2.ry: -3", "at least 0 [N·m/rad]"],
        ),
        ('to = "B"', 'to = "B"\nsection2 = "none"', ["members.bar.section2: there is no section 'none'"]),
        ('to = "B"', 'to = "B"\ntheory = "bernoulli"', ["members.bar.theory", "euler-bernoulli"]),
        (
            '[[supports]]\npoint = "A"',
            '[[supports]]\npoint = "Z"',
            ["line 15, supports[1].point: there is no point 'Z'"],
        ),
        (
            '[[supports]]\npoint = "A"',
            "[[supports]]\npoint = [0, 1, 0]",
            ["supports[1].point", "not on the structure"],
        ),
        (
            'point = "A"',
            'point = "A"\nfixed = "x q"',
            ["line 16, supports[1].fixed", "'q' is not a direction"],
        ),
        ('point = "A"', 'point = "A"\n[[supports]]\npoint = "A"', ["two effects have the name 'A'"]),
        ("[[supports]]", "[supports]", ["supports: an array of tables is needed: write [[supports]]"]),
        (
            'point = "B"',
            "point = [1, 0, 0.5]",
            ["line 17, sensors[1]", "sensor 'tip'", "from the nearest member"],
        ),
        (
            'point = "B"',
            'point = {member = "bar", position = 1.2}',
            ["sensors[1].point.position", "beyond the end"],
        ),
        (
            'point = "B"',
            'point = {member = "baz", position = 1}',
            ["sensors[1].point.member", "did you mean 'bar'?"],
        ),
        ('point = "B"', "node = 7", ["sensors[1].node: there is no node 7"]),
        ('point = "B"', "", ["sensors[1]: a place is missing"]),
        ('direction = "z"', "direction = [0, 0, 0]", ["sensors[1].direction"]),
        ('direction = "z"', 'direction = "z"\nsign = 2', ["sensors[1].sign: 2"]),
        (
            "[[excitations]]",
            '[[sensors]]\nname = "tip"\npoint = "A"\ndirection = "z"\n[[excitations]]',
            ["two sensors have the name 'tip'"],
        ),
        (
            'sensor = "tip"',
            'sensor = "top"',
            ["excitations[1].sensor: there is no sensor 'top'", "did you mean 'tip'?"],
        ),
    ],
)
def test_study(tmp_path, capsys, old, new, words):
    assert old in GOOD
    fails(tmp_path, capsys, GOOD.replace(old, new, 1), *words)


@pytest.mark.parametrize(
    ("extra", "words"),
    [
        ("[mesh]\nelement_size = 0", ["mesh.element_size: 0 is not allowed"]),
        ('[mesh]\nfile = "none.msh"', ["both define the geometry"]),
        ("[mesh]\nscale = 0.001", ["mesh.scale", "belongs to a mesh file"]),
        ("[damping]\nmodal = 2.0", ["damping.modal", "between 0 and 1"]),
        ("[damping]\nmodal = {frequency = [1, 2], ratio = [0.1]}", ["damping.modal"]),
        ("[uncertain]\nE = -1", ["uncertain.E: -1"]),
        ("[uncertain]\nEE = 1", ["uncertain.EE: unknown key"]),
        ("[uncertain.materials.lead]\nE = 1", ["uncertain.materials.lead: unknown key"]),
        ("[uncertain.joint.J]\nkx = 1", ["uncertain.joint.J: unknown key"]),
        ("[fit]\nband = [100, 10]", ["fit.band", "two rising frequencies"]),
        ('[fit]\nheld_out = ["x"]', ["fit.held_out", "no excitation or sensor 'x'"]),
        ("[fit]\nbootstrap = 19", ["fit.bootstrap", "unknown key", "allowed are"]),
        ("[fit]\nevidence = true", ["fit.evidence", "unknown key"]),
        ("[fit]\nmodel_error = -1", ["fit.model_error", "-1"]),
        ('[fit]\nheld_out = ["sensor x"]', ["fit.held_out", "no sensor 'x'"]),
        ('[fit]\nheld_out = ["band 120 Hz"]', ["fit.held_out", "written as 'band 120-180 Hz'"]),
        ('[fit]\nheld_out = ["band 180-120 Hz"]', ["fit.held_out", "ends above its beginning"]),
        ("[frequency]\nstart = 100\nstop = 10", ["frequency.start", "not below"]),
        ('[[masses]]\npoint = "B"', ["masses[1]: 'mass' is missing"]),
        (
            '[[masses]]\npoint = "B"\nmass = 1\ninertia = [[1, 0, 0], [0, 1, 0], [0, 0, -1]]',
            ["masses[1].inertia"],
        ),
        ('[[joints]]\npoint1 = "A"\npoint2 = "B"', ["joints[1]: joint 'joint1' does nothing"]),
        ('[[joints]]\npoint1 = "A"\npoint2 = "A"\nrigid = "all"', ["joints[1]", "same point"]),
        ('[[joints]]\npoint1 = "B"\nk = {kxx = 1}', ["joints[1].k.kxx: unknown key"]),
        ('[[joints]]\npoint1 = "B"\nK = [[1, 2], [3, 4]]', ["joints[1].K", "6 rows of 6 numbers"]),
        ('[[joints]]\npoint1 = "B"\nname = "frame"\nrigid = "x"', ["two effects have the name 'frame'"]),
        ('[candidates]\nexclude = ["point_mas"]', ["candidates.exclude", "did you mean 'point_mass'?"]),
        ('[candidates]\nenvironment = ["liquid"]', ["candidates.environment", "fluid, rotation, elastomer"]),
        ("[candidates]\nkinds = [1]", ["candidates.kinds", "a list of texts"]),
        ("[study]\nname = 3", ["study.name: 3 is not allowed; a text"]),
        ("study = 3", ["supports"]),
    ],
)
def test_study_with_more(tmp_path, capsys, extra, words):
    if extra == "study = 3":  # a key of the last table, not of the file
        words = ["excitations[1].study: unknown key"]
    fails(tmp_path, capsys, GOOD + "\n" + extra + "\n", *words)


def test_syntax_and_encoding(tmp_path, capsys):
    fails(tmp_path, capsys, GOOD + "\nx = = 1\n", "study.toml", "line 25")
    path = tmp_path / "latin.toml"
    path.write_bytes(GOOD.encode() + b"# \xe9\n")
    assert main(["modes", str(path)]) == 2
    assert "not UTF-8" in capsys.readouterr().err


def test_missing_files(tmp_path, capsys):
    path = tmp_path / "none.toml"
    assert main(["modes", str(path)]) == 2
    assert capsys.readouterr().err == f"dovetail: {path}: no such file in '{tmp_path}'\n"
    (tmp_path / "study.toml").touch()
    (tmp_path / "hammer.csv").touch()
    with pytest.raises(StudyError, match=r"studi.toml: no such file in '.*'; did you mean 'study.toml'\?"):
        load_study(tmp_path / "studi.toml")
    with pytest.raises(FileNotFoundError, match=r"hamer.csv: no such file .*; did you mean 'hammer.csv'\?"):
        read_frf(tmp_path / "hamer.csv")
    fails(tmp_path, capsys, GOOD + FILE, "measurements[1].file: there is no file", "m.npz")
    fails(tmp_path, capsys, '[mesh]\nfile = "frame.msh"\n', "line 2, mesh.file: there is no file")
    fails(tmp_path, capsys, "# nothing\n", "there is no structure")


def test_study_is_planned_before_its_measured_files_exist(tmp_path, capsys):
    path = study_file(tmp_path, GOOD + FILE)
    study = load_study(path)
    assert study.solve_modes(2).n_modes == 2
    planned = study.plan(kinds="point_mass")
    without_file = load_study(study_file(tmp_path, GOOD))
    assert planned.coverage() == without_file.plan(kinds="point_mass").coverage() > 0
    study_file(tmp_path, GOOD + FILE)
    for needs_data in (study.compare, study.fit, study.diagnose):
        with pytest.raises(StudyError, match=r"no measured data yet .*measurements\[1\].*'m.npz'.*; "):
            needs_data()
    assert main(["plan", str(path)]) == 0
    assert "left out, until the measured data exist: study.toml, line" in capsys.readouterr().err
    assert main(["compare", str(path)]) == 2
    assert capsys.readouterr().err.startswith("dovetail: study.toml, line")
    (tmp_path / "m.npz").write_text("nothing that can be read")
    with pytest.raises(StudyError, match=r"m\.npz"):
        load_study(path)


def test_sensors_at_nodes_of_a_measured_file_wait_for_it(tmp_path):
    at_nodes = '[[sensors]]\nnode = 7\nname = "seven"\ndirection = "z"\n[[excitations]]\nsensor = "seven"\n'
    structure = GOOD[: GOOD.index("[[sensors]]")]
    file = '[[measurements]]\nfile = "test.uff"\n'
    study = load_study(study_file(tmp_path, structure + at_nodes + file))
    assert not study.sensors
    with pytest.raises(StudyError, match=r"\[\[sensors\]\] \(.*no node 7"):
        study.frf()
    assert len(study.plan(choose=2, excitations=1, kinds="point_mass").chosen.sensors) == 2
    with pytest.raises(StudyError, match="no node 7 in the measured files"):
        load_study(study_file(tmp_path, structure + at_nodes))


def test_mechanisms(tmp_path, capsys):
    two = GOOD + '[members.apart]\nfrom = [0, 5, 0]\nto = [1, 5, 0]\nsection = {shape = "circle", d = 0.01}\n'
    fails(tmp_path, capsys, two, "2 parts that nothing connects", "apart", command=("modes",))
    hinge = GOOD.replace('point = "A"', 'point = "A"\nfixed = "x y z rx rz"')
    assert "mechanism" in fails(
        tmp_path,
        capsys,
        hinge.replace("B = [1, 0, 0]", "B = [1, 0, 0]\nC = [1, 0, 0]\nD = [2, 0, 0]")
        + '[members.b2]\nfrom = "C"\nto = "D"\nsection = {shape = "circle", d = 0.01}\n'
        + '[[joints]]\npoint1 = "B"\npoint2 = "C"\nrigid = "x y z rx rz"\n',
        command=("modes",),
    )


# Measurements -------------------------------------------------------------------------------------------


@pytest.fixture
def measured(tmp_path, capsys):
    """Write the FRFs of the good study to m.npz and return them."""
    (tmp_path / "study.toml").write_text(GOOD + "[damping]\nmodal = 0.01\n", encoding="utf-8")
    assert main(["frf", str(tmp_path / "study.toml"), "--out", str(tmp_path / "m.npz"), "--step", "2"]) == 0
    capsys.readouterr()
    from fem.io import read_npz

    return read_npz(tmp_path / "m.npz")


def with_values(frf, H=None, **changes):
    H = frf.H if H is None else H
    names = {"outputs": frf.outputs, "inputs": frf.inputs, "kind": frf.kind} | changes
    return FRF(frf.frequency, H, names["kind"], tuple(names["outputs"]), tuple(names["inputs"]))


def warned(tmp_path, capsys, text, command="compare"):
    """Run a command on a study that is read; return its warnings."""
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    assert main([command, str(tmp_path / "study.toml")]) == 0
    said = capsys.readouterr().err.splitlines()
    return [x.removeprefix("dovetail: ") for x in said if x.startswith("dovetail: warning: ")]


def test_zeros_are_no_measurement(tmp_path, capsys, measured):
    write_npz(tmp_path / "m.npz", with_values(measured, 0 * measured.H))
    fails(tmp_path, capsys, GOOD + FILE, "all its FRFs are zero")


@pytest.mark.parametrize(
    ("factor", "words"),
    [
        (1 / 9.80665, ["0.102 times", "in g/N", "scale = 9.80665", "9.81 times too light and soft"]),
        (0.34, ["0.34 times", "in g/lbf", "2.94 times too light and soft", "joints and damping"]),
        (1e3, ["in mm where m", "scale = 0.001", "1e+03 times too heavy and stiff"]),
        (1e-3, ["a thousand times too small", "scale = 1000"]),
        (18.0, ["18 times the model's", "their unit is wrong, or the model"]),
    ],
)
def test_another_order_of_magnitude_is_a_warning(tmp_path, capsys, measured, factor, words):
    """Data or model: both are named with the size of the fault, and the command goes on."""
    write_npz(tmp_path / "m.npz", with_values(measured, factor * measured.H))
    (text,) = warned(tmp_path, capsys, GOOD + FILE)
    for word in (*words, "check_units = false"):
        assert word in text


@pytest.mark.parametrize("kind", ["receptance", "mobility"])
def test_another_kind(tmp_path, capsys, measured, kind):
    write_npz(tmp_path / "m.npz", with_values(measured, kind=kind))
    fails(tmp_path, capsys, GOOD + FILE, f"{kind}", 'give kind = "accelerance"')


def test_remedies_help(tmp_path, capsys, measured):
    write_npz(tmp_path / "m.npz", with_values(measured, measured.H / 9.80665))
    for remedy in ("scale = 9.80665", "check_units = false"):
        assert warned(tmp_path, capsys, GOOD + FILE + remedy + "\n") == []


def test_not_a_number(tmp_path, capsys, measured):
    H = measured.H.copy()
    H[3] = np.nan
    with (tmp_path / "m.npz").open("wb") as file:
        np.savez(file, frequency=measured.frequency, H=H, kind="accelerance", outputs=["tip"], inputs=["tip"])
    fails(tmp_path, capsys, GOOD + FILE, "measurements[1].file", "not finite", "'tip'")


def test_universal_files(tmp_path, capsys, measured):
    text = GOOD + FILE.replace("npz", "uff").replace("[[sensors]]", "")
    mesh = Mesh.from_lines([[0, 0, 0], [1, 0, 0]], [[0, 1]])
    write_uff(tmp_path / "m.uff", mesh=mesh)
    fails(tmp_path, capsys, text, "measurements[1].file", "no FRFs that can be used")
    write_uff(tmp_path / "m.uff", measured, mesh=mesh, dofs={"tip": "2Z+"})
    fails(tmp_path, capsys, text, "none of its responses (2Z+) belongs to a sensor")
    whole = (tmp_path / "m.uff").read_bytes()
    (tmp_path / "m.uff").write_bytes(whole[: len(whole) - 900])
    fails(tmp_path, capsys, text, "measurements[1].file", "m.uff")
    (tmp_path / "m.uff").write_text("hello\n", encoding="utf-8")
    fails(tmp_path, capsys, text, "no dataset found")


def test_csv_without_its_kind(tmp_path, capsys, measured):
    write_csv(tmp_path / "m.csv", measured)
    body = (tmp_path / "m.csv").read_text(encoding="utf-8").split("\n", 1)[1]
    (tmp_path / "m.csv").write_text(body, encoding="utf-8")
    fails(
        tmp_path,
        capsys,
        GOOD + FILE.replace("npz", "csv"),
        "measurements[1].file",
        "does not say the kind",
        "accelerance",
    )


@pytest.mark.parametrize(
    ("extra", "words"),
    [
        ('kind = "inertance"', ["measurements[1].kind: 'inertance'", "accelerance"]),
        ("band = [2000, 3000]", ["measurements[1].band", "no line lies in the band"]),
        ("force_level = -1", ["measurements[1].force_level: -1"]),
        ("scale = 0", ["measurements[1].scale"]),
        ('outputs = ["a", "b"]', ["measurements[1].outputs: 2 labels are given for the 1 outputs"]),
        (
            '[[sensors]]\nname = "mid"\npoint = [0.5, 0, 0]\ndirection = "z"',
            ["sensors[2]: sensor 'mid' has no channel", "tip"],
        ),
        (
            '[[sensors]]\nname = "mid"\npoint = [0.5, 0, 0]\ndirection = "z"\nlabel = "tip"',
            ["both channel tip"],
        ),
    ],
)
def test_measurement_keys(tmp_path, capsys, measured, extra, words):
    fails(tmp_path, capsys, GOOD + FILE + extra + "\n", *words)


def test_commands_that_need_more(tmp_path, capsys, measured):
    fails(tmp_path, capsys, GOOD.split("[[sensors]]")[0], "no [[sensors]]", command=("frf",))
    fails(tmp_path, capsys, GOOD, "the first frequency", command=("frf", "--start", "500", "--stop", "20"))
    joint = GOOD + '[[joints]]\nname = "J"\npoint1 = "B"\nk = {kz = 1000}\n'
    asked = ("identify-joint", "--joint", "J", "--directions", "z")
    fails(tmp_path, capsys, joint, "no [[measurements]]", command=asked)
    fails(
        tmp_path,
        capsys,
        joint + FILE,
        "no joint 'K'",
        command=("identify-joint", "--joint", "K", "--directions", "z"),
    )
    fails(
        tmp_path,
        capsys,
        joint + FILE,
        "'w' is not a direction",
        command=("identify-joint", "--joint", "J", "--directions", "w"),
    )


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["mode"],
        ["modes"],
        ["modes", "x.toml", "--number", "0"],
        ["modes", "x.toml", "--max", "nan"],
        ["frf", "x.toml"],
        ["modes", "x", "--what"],
    ],
)
def test_arguments(arguments, capsys):
    assert main(arguments) == 2
    assert "usage: dovetail" in capsys.readouterr().err


ODD_WORDS = '0 -1 1e300 1e-300 nan -inf "" "x" [] [1] {} true "all" 1979-05-27'
ODD = (
    *ODD_WORDS.split(),
    "[nan, 0, 0]",
    "{a = 1}",
    "[[1, 2], [3]]",
    '{ member = "bar", position = "end" }',
)
VALUES = [m.span(1) for m in re.finditer(r"= (.+)$", GOOD, re.MULTILINE)]


@given(st.sampled_from(VALUES), st.sampled_from(ODD))
@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_no_value_is_a_fault_of_the_program(tmp_path, capsys, place, value):
    (tmp_path / "odd.toml").write_text(GOOD[: place[0]] + value + GOOD[place[1] :], encoding="utf-8")
    code = main(["modes", str(tmp_path / "odd.toml")])
    said = capsys.readouterr().err
    assert code in (0, 2), said
    errors = [line for line in said.splitlines() if not line.startswith("dovetail: warning: ")]
    assert len(errors) == (code == 2)


def test_what_only_rounding_moves_tells_no_unit(tmp_path, capsys, measured):
    """Two sensors across the plane in which a bar is shaken: the model says 1e-16 of what was measured."""
    across = "".join(
        f'\n[[sensors]]\nname = "{name}"\npoint = {place}\ndirection = "y"\n'
        for name, place in (("y1", '"B"'), ("y2", "[0.5, 0, 0]"))
    )
    noise = 1e-4 * np.abs(measured.H)
    H = np.concatenate([measured.H, noise, noise], axis=1)
    write_npz(tmp_path / "m.npz", with_values(measured, H, outputs=("tip", "y1", "y2")))
    assert warned(tmp_path, capsys, GOOD + across + FILE) == []
    write_npz(tmp_path / "m.npz", with_values(measured, 1e3 * H, outputs=("tip", "y1", "y2")))
    (text,) = warned(tmp_path, capsys, GOOD + across + FILE)
    assert "in mm where m" in text
    assert "scale = 0.001" in text


def test_control_characters_of_names_are_shown_and_not_obeyed(tmp_path, capsys):
    file = tmp_path / "s.toml"
    file.write_text('[points]\na = [0, 0, 0]\n[members.m]\nfrom = "a"\nto = "\\u001b[2J\\frac"\n')
    assert main(["check", str(file)]) == 2
    assert r"there is no point '\x1b[2J\x0crac'" in capsys.readouterr().err
