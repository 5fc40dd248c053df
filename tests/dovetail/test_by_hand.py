"""Effects added by hand: by the command line, from Python, and in the study file; the list of candidates."""

import json
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import dovetail
from dovetail import main, pipeline
from dovetail.disk.output import null_keys
from dovetail.notebook.candidates import places_of
from dovetail.result import notes_of
from fem import ModelError
from fem.io import read_npz, write_npz
from tests.frames import write_study
from tests.noise import complex_normal

MASS, AT = 0.25, 0.3
"""What `write_study` hides on the arm [kg, m]."""
BY_HAND = """
[[effects]]
candidate = "point_mass:arm"
mass = 0.4
position = 0.25
"""


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return write_study(tmp_path_factory.mktemp("bent"), MASS, AT)


@pytest.fixture(scope="module")
def study(file):
    return dovetail.load_study(file)


def compared(capsys, path, *words):
    """Return what ``dovetail compare`` writes as JSON."""
    assert main(["compare", str(path), *words, "--json", "-"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert set(null_keys(found)) == found["missing"].keys()
    return found


def test_three_ways_to_add_an_effect_give_the_same_error(file, study, capsys):
    edited = file.with_name("edited.toml")
    edited.write_text(file.read_text(encoding="utf-8") + BY_HAND, encoding="utf-8")
    command = compared(capsys, file, "--add", "point_mass:arm", "--set", "mass=0.4,position=0.25")
    by_file = compared(capsys, edited)
    python = study.add("point_mass:arm", mass=0.4, position=0.25)
    for key in ("error_db", "held_out_db", "all_lines_db"):
        assert command[key] == pytest.approx(by_file[key], rel=1e-9)
    assert command["error_db"] == pytest.approx(python.error().fit_db, rel=1e-9)
    assert command["held_out_db"] == pytest.approx(python.error().held_out_db, rel=1e-9)
    assert command["all_lines_db"] == pytest.approx(python.compare().total_db, rel=1e-9)
    assert command["noise_db"] == pytest.approx(python.error().noise_db, rel=1e-9)


def test_a_stiffness_and_its_compliance_are_the_same_by_every_way_of_adding(file, study, capsys):
    soft = {"position": 0.2, "compliance": 1 / 800}
    error = study.add("crack:arm.ry", **soft).compare().total_db
    assert error != pytest.approx(study.compare().total_db, rel=1e-3)
    python = study.add("crack:arm.ry", stiffness=800, position=0.2)
    assert python.compare().total_db == pytest.approx(error, rel=1e-9)
    command = compared(capsys, file, "--add", "crack:arm.ry", "--set", "stiffness=800,position=0.2")
    assert command["all_lines_db"] == pytest.approx(error, rel=1e-9)
    edited = file.with_name("cracked.toml")
    crack = '\n[[effects]]\ncandidate = "crack:arm.ry"\nstiffness = 800\nposition = 0.2\n'
    edited.write_text(file.read_text(encoding="utf-8") + crack, encoding="utf-8")
    assert compared(capsys, edited)["all_lines_db"] == pytest.approx(error, rel=1e-9)


def test_an_infinite_stiffness_is_a_rigid_connection(study):
    rigid = study.add("crack:arm.ry", stiffness=float("inf"), position=0.2)
    assert rigid.compare().total_db == pytest.approx(study.compare().total_db, rel=1e-9)


def test_the_error_is_least_with_the_hidden_mass_at_its_place(study):
    def error(mass, position):
        return study.add("point_mass:arm", mass=mass, position=position).compare().total_db

    least = error(MASS, AT)
    assert least < 0.05 * study.compare().total_db
    for mass, position in ((1.1 * MASS, AT), (0.9 * MASS, AT), (MASS, AT + 0.01), (MASS, AT - 0.01)):
        assert error(mass, position) > 1.5 * least


def test_a_fit_of_an_added_effect_finds_the_hidden_mass(file, study, capsys):
    words = ("--add", "point_mass:arm", "--set", "mass=0.1,position=0.2", "--fitted")
    command = compared(capsys, file, *words)
    python = study.add("point_mass:arm", mass=0.1, position=0.2).fit(faults=True)
    assert command["error_db"] == pytest.approx(python.error().fit_db, rel=1e-9)
    (effect,) = command["added"]
    mass, position = effect["parameters"]
    assert (mass["value"], position["value"]) == pytest.approx((MASS, AT), rel=0.02)
    assert abs(mass["value"] - MASS) < 4 * mass["std"]
    assert python.added[0].mass == pytest.approx(mass["value"], rel=1e-9)


def test_a_saved_study_has_the_error_of_the_command(file, study, capsys):
    added = study.add("point_mass:arm", mass=0.4, position=0.25)
    added.save(file.with_name("saved.toml"))
    command = compared(capsys, file, "--add", "point_mass:arm", "--set", "mass=0.4,position=0.25")
    assert compared(capsys, file.with_name("saved.toml"))["error_db"] == pytest.approx(
        command["error_db"], rel=1e-9
    )


def test_channels_that_are_not_compared_are_named_with_the_reason(tmp_path, capsys):
    path = write_study(tmp_path)
    frf = read_npz(tmp_path / "frf.npz")
    rng, H, i = np.random.default_rng(0), frf.H.copy(), frf.outputs.index("A")
    H[:, i] *= 1 + 0.5 * complex_normal(rng, H[:, i].shape)
    write_npz(tmp_path / "frf.npz", replace(frf, H=H))
    found = compared(capsys, path)
    (said,) = found["uncompared"]
    assert re.match(r"the FRFs of sensor A are not compared: their noise is [3-6]\d %, over the limit", said)
    data = pipeline.fit_problem(dovetail.load_study(path)).data
    diagnosis = SimpleNamespace(steps=[1], problem=SimpleNamespace(data=data), notes=("another",))
    assert notes_of(diagnosis) == (said, "another")


def test_a_saved_fit_is_exported_as_that_of_a_run(file, study, capsys):
    """The file has the deviations: the mass is put at a node, and values fitted beside it stay."""
    study.add("point_mass:arm", mass=0.1, position=0.2).fit().save(file.with_name("fitted.toml"))
    saved = dovetail.load_study(file.with_name("fitted.toml"))
    assert saved.estimates["point_mass:arm.position"].std > 0
    assert saved.estimates["frame.E:steel"].before == 210e9 != saved.model.values()["frame", "E:steel"]
    wide = re.sub(r'(":arm.position" =) [^ ]+', r"\1 0.05", saved.text)
    file.with_name("fitted.toml").write_text(wide)
    cards = file.with_name("cards.bdf")
    assert main(["export", str(saved.path), "--nastran", str(cards)]) == 0
    assert re.search(r"not in this file, fitted .*E of steel", capsys.readouterr().out)
    assert "CONM2*" in cards.read_text()
    assert not re.search(r"^(GRID|CBEAM|CBAR|MAT1|PBEAM)", cards.read_text(), re.MULTILINE)


def test_the_printed_line_names_the_added_effect(file, capsys):
    words = ["--add", "point_mass:arm", "--set", "mass=0.4", "--add", "member_stiffness:post"]
    assert main(["compare", str(file), *words]) == 0
    out = capsys.readouterr().out
    added = [line.replace("\u00a0", " ") for line in out.splitlines()[-2:]]
    assert added[0] == "added: point_mass:arm (member arm at 0.200 m), mass 0.400 kg, position 0.200 m"
    assert added[1] == "added: member_stiffness:post (member post), change 0.00"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--set", "mass=1"], "it stands behind the --add"),
        (["--add", "point_mas:arm"], "did you mean 'point_mass'"),
        (["--add", "point_mass:legs"], "no candidate 'point_mass:legs'; the nearest are point_mass:"),
        (
            ["--add", "point_mass:arm", "--set", "weight=1"],
            "no parameter 'weight'; allowed are mass (0 to",
        ),
        (["--add", "point_mass:arm", "--set", "position=9"], "position = 9 m is not between 0 and 0.4 m"),
        (["--add", "point_mass:arm", "--set", "mass=heavy"], "mass is 'heavy'; a number is needed"),
        (["--add", "point_mass:arm", "--set", "mass=nan"], "a finite number is needed"),
        (["--add", "point_mass:arm", "--set", "mass"], "NAME=NUMBER is needed"),
        (
            ["--add", "crack:arm.ry", "--set", "stiffness=-1"],
            "stiffness = -1 N·m/rad is not allowed; at least ",
        ),
        (
            ["--add", "crack:arm.ry", "--set", "stiffness=800,compliance=1e-3"],
            "'crack:arm.ry': 'compliance' is 1/stiffness, which is given too; one of them is needed",
        ),
        (["--add", "point_mass:arm", "--set", "mass=1,mass=2"], "'mass' is given twice"),
        (["--add", "point_mass:arm", "--set", "mass=1", "--set", "mass=2"], "'mass' of 'point_mass:arm'"),
        (["--add", "point_mass:arm", "--add", "point_mass:arm"], "two effects have the name"),
    ],
)
def test_refusals_say_what_was_found_and_what_is_allowed(file, capsys, words, message):
    assert main(["compare", str(file), *words]) == 2
    err = capsys.readouterr().err
    assert message in err.splitlines()[-1]


def test_candidates_are_listed_with_places_and_bounds(file, study, capsys):
    assert main(["candidates", str(file), "--at", "member:arm", "--json", "-"]) == 0
    rows = json.loads(capsys.readouterr().out)["candidates"]
    assert [r["name"] for r in rows] == list(study.candidates(at="member:arm").names)
    (mass,) = [r for r in rows if r["name"] == "point_mass:arm"]
    assert mass["where"] == "member arm at 0.200 m"
    position = mass["parameters"][1]
    assert (position["name"], position["unit"], position["upper"]) == ("position", "m", pytest.approx(0.4))
    assert main(["candidates", str(file), "--kind", "member_stiffness"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines[2:]] == ["member_stiffness:post", "member_stiffness:arm"]


def test_candidates_say_what_the_environment_makes_improbable(file, capsys):
    assert main(["candidates", str(file), "--json", "-"]) == 0
    rows = json.loads(capsys.readouterr().out)["candidates"]
    assert {r["admitted"] for r in rows if r["kind"] == "fluid_added_mass"} == {0.01}
    assert {r["admitted"] for r in rows if r["kind"] == "point_mass"} == {1.0}
    assert main(["candidates", str(file)]) == 0
    air = capsys.readouterr().out.splitlines()
    assert 'environment "fluid" is not stated in [candidates]; prior odds × 0.01: fluid_added_mass' in air
    assert 'environment "rotation" is not stated in [candidates]; not proposed: rotor' in air
    text = file.read_text(encoding="utf-8")
    wet = file.parent / "wet.toml"
    stated = '[candidates]\nenvironment = ["fluid", "rotation"]\n'
    wet.write_text(text.replace("[candidates]\n", stated), encoding="utf-8")
    assert main(["candidates", str(wet)]) == 0
    listed = capsys.readouterr().out
    assert "rotor:" in listed
    assert '"fluid"' not in listed


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--at", "joint:J"], "no candidate is at 'joint:J'; "),
        (["--at", "member:ar"], "did you mean 'member:arm'?"),
        (["--kind", "mass"], "there is no kind of effect 'mass'"),
    ],
)
def test_places_and_kinds_that_are_not_there_are_refused(file, capsys, words, message):
    assert main(["candidates", str(file), *words]) == 2
    assert message in capsys.readouterr().err


def test_every_candidate_can_be_added_by_its_name(root):
    study = dovetail.load_study(root / "examples" / "cross-beam" / "study.toml", needs=("sensors",))
    for effect in study.candidates():
        assert study.add(effect.name).added[0].parameters() == effect.parameters()
        assert places_of(effect)
    found = study.candidates(at="joint:J")
    assert {"joint_stiffness:J.rx", "ground_spring:J.x", "zone_form:0"} <= {
        *found.names,
        *study.candidates().names,
    }
    assert all("joint:J" in places_of(e) for e in found)
    assert repr(found).endswith(" kinds at joint:J>")  # although effects on all joints are among them
    assert study.candidates(at=("end:U.1", "end:U.2"))["ground_spring:U.2.x"].where == "end 2 of member U, x"


def test_values_belong_to_one_effect(study):
    with pytest.raises(ModelError, match="add one effect at a time"):
        study.add("point_mass:arm", "point_mass:post", mass=1.0)


def test_an_effect_added_after_a_fit_is_fitted_as_before_it(study):
    first = study.add("point_mass:arm", mass=0.2, position=0.25).fit()
    second = study.fit().add("point_mass:arm", mass=0.2, position=0.25).fit()
    assert second.error().fit_db == pytest.approx(first.error().fit_db, rel=1e-3)
    assert second.added[0].mass == pytest.approx(first.added[0].mass, rel=1e-3)


def test_a_fit_may_set_a_wrong_sign_right_and_save_it(tmp_path):
    file = write_study(tmp_path, MASS, AT)
    frf = read_npz(tmp_path / "frf.npz")
    H = np.array(frf.H)
    H[:, frf.outputs.index("A")] *= -1
    write_npz(
        tmp_path / "frf.npz", type(frf).from_arrays(frf.frequency, H, frf.kind, frf.outputs, frf.inputs)
    )
    turned = dovetail.load_study(file).add("point_mass:arm", mass=MASS, position=AT)
    right = turned.fit(faults=True)
    assert [(f.kind, f.sensor) for f in right.faults] == [("sensor_sign", "A")]
    phase = np.abs(right.compare().log_ratio.imag)
    assert np.nanmax(phase[:, right.compare().outputs.index("A")]) < 0.1
    right.save(tmp_path / "right.toml")
    again = dovetail.load_study(tmp_path / "right.toml")
    assert again.error().fit_db == pytest.approx(right.error().fit_db, rel=1e-3)
