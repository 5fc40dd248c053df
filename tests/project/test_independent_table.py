"""The table of independent cases: how it judges, and that the program ends on every case."""

import json
import sys

import pytest

from benchmarks.independent import table
from benchmarks.independent.summary import summarise

NOMINAL = {
    "joints": [{"name": "J", "member1": "U", "member2": "D"}],
    "members": [{"name": "U", "end1": [0, 0, 0], "end2": [0.8, 0, 0]}],
    "supports": [{"point": 7, "fixed": "all six"}, {"point": 8, "fixed": "all six"}],
    "sensors": [{"name": "U7z", "member": "U", "position": 0.6}],
}
SOFT = {
    "type": "joint_rotational_flexibility",
    "location": "lap joint U-D",
    "direction": "rx",
    "magnitude": {"krx_Nm_rad": 200.0},
}
MASS = {"type": "lumped_mass", "location": "U7 (x=0.6 on U)", "magnitude": {"kg": 0.08}}
BASES = {
    "type": "foundation_rotational_flexibility",
    "location": "all four",
    "direction": "ry",
    "magnitude": {"kry_Nm_rad": 6e3},
}
NOTCH = {
    "type": "named",
    "kind": ["crack", "stiffness_loss"],
    "place": ["U"],
    "value": 1e-5,
    "unit": "rad/(N·m)",
    "position": 0.3,
    "length": 0.8,
    "location": "U",
    "magnitude": 1e-5,
}
SIGN = {"type": "sensor_fault", "location": "D6z", "magnitude": {"factor": -1}}
NONE = {"type": "none", "location": "-", "magnitude": 0}


def effect(kind, where, twins=(), **values):
    parameters = [{"name": k, "value": v, "unit": "", "std": 0.1} for k, v in values.items()]
    return {"kind": kind, "where": where, "parameters": parameters, "twins": list(twins)}


def result(verdict, *effects, faults=()):
    return {"verdict": verdict, "effects": list(effects), "faults": list(faults)}


SOFT_FOUND = effect("joint_stiffness", "joint J, rx", stiffness=190.0)
MASS_FOUND = effect("point_mass", "member U at 0.610 m", mass=0.08, position=0.61)
MASS_ELSEWHERE = effect("point_mass", "member U at 0.500 m", mass=0.08, position=0.5)
CRACK = effect("crack", "member U at 0.310 m, bending about local y", compliance=1e-5, position=0.31)
OTHER = effect("member_density", "member U", twins=[SOFT_FOUND], change=0.1)
D6Z = {"kind": "sensor_sign", "sensor": "D6z", "value": -1.0, "std": 0.0}
U4Z = {"kind": "sensor_gain", "sensor": "U4z", "value": 1.2, "std": 0.01}


@pytest.mark.parametrize(
    ("truth", "found", "verdict"),
    [
        (SOFT, result("effect", SOFT_FOUND), table.YES),
        (SOFT, result("effect", effect("joint_stiffness", "joint J, ry", stiffness=190.0)), table.NO),
        (SOFT, result("effect", SOFT_FOUND, MASS_FOUND), table.PARTLY),
        (SOFT, result("effect", OTHER), table.TWIN),
        (SOFT, result("unexplained"), table.NO),
        (SOFT, result("effect", SOFT_FOUND, faults=[D6Z]), table.NO),
        (MASS, result("effect", MASS_FOUND), table.YES),
        (MASS, result("effect", MASS_ELSEWHERE), table.NO),
        (BASES, result("effect", effect("support_flexibility", "supports 7, 8, ry")), table.YES),
        (NOTCH, result("effect", effect("stiffness_loss", "member U at 0.310 m", position=0.31)), table.YES),
        (NOTCH, result("effect", CRACK), table.YES),
        (NOTCH, result("effect", MASS_ELSEWHERE), table.NO),
        (BASES, result("effect", effect("support_flexibility", "support 7, ry")), table.NO),
        (SIGN, result("measurement fault", faults=[D6Z]), table.YES),
        (SIGN, result("measurement fault", faults=[D6Z, U4Z]), table.NO),
        (NONE, result("nothing missing"), table.YES),
        (NONE, result("unexplained"), table.NO),
        (NONE, result("effect", SOFT_FOUND), table.NO),
    ],
)
def test_only_kind_and_place_without_more_are_right(truth, found, verdict):
    assert table.judge(*table.hidden_effects({"effects": [truth]}, NOMINAL), found) == verdict


def test_solid_corners_are_right_beside_what_is_hidden():
    corner = effect("solid_corner", "8 welded corners", size=1.0)
    solids, beams = {"code": "CalculiX 2.20"}, {"code": "OpenSees 3.7.1"}
    assert table.has_solid_corners(solids, {"joints": "all connections welded"})
    assert not table.has_solid_corners(beams, {"joints": "all connections welded"})
    assert not table.has_solid_corners(solids, NOMINAL)

    def judged(truth, found, corners):
        return table.judge(*table.hidden_effects({"effects": [truth]}, NOMINAL), found, corners)

    both = result("effect", corner, MASS_FOUND)
    assert [judged(MASS, both, corners) for corners in (True, False)] == [table.YES, table.PARTLY]
    alone = result("effect", corner)
    assert [judged(NONE, alone, corners) for corners in (True, False)] == [table.YES, table.NO]
    assert judged(MASS, alone, True) == table.NO
    assert judged(NONE, result("effect", corner, SOFT_FOUND), True) == table.NO
    assert judged(NONE, result("nothing missing"), True) == table.YES


TWO_AXES = {"type": "connection", "location": "joint J", "magnitude": {"k": {"rx": 200.0, "ry": 90.0}}}
LOSS = {"type": "connection", "location": "joint J", "magnitude": {"k": {"rx": 200.0}, "loss_factor": 0.3}}
FOOT = {"type": "connection", "location": "support F1", "magnitude": {"k": {"rz": 9e3}}}
RX, RY, RZ = (effect("joint_stiffness", f"joint J, {d}", stiffness=1.0) for d in ("rx", "ry", "rz"))
BLOCK = effect("connection", "joint J, rx ry rz", krx=200.0, kry=90.0, krz=3e3)
DAMPED = effect("joint_structural_damping", "joint J", loss_factor=0.3)
ELSEWHERE = effect("joint_stiffness", "joint J2, ry", stiffness=1.0)


@pytest.mark.parametrize(
    ("truth", "found", "verdict"),
    [
        (TWO_AXES, [RX, RY], table.YES),
        (TWO_AXES, [BLOCK], table.YES),
        (TWO_AXES, [RX], table.NO),
        (TWO_AXES, [RX, ELSEWHERE], table.NO),
        (TWO_AXES, [RX, RY, RZ], table.PARTLY),
        (TWO_AXES, [RX, RY, MASS_FOUND], table.PARTLY),
        (TWO_AXES, [effect("point_mass", "member U", twins=[BLOCK])], table.TWIN),
        (LOSS, [RX, DAMPED], table.YES),
        (LOSS, [effect("connection", "joint J, rx", krx=200.0, loss=0.3)], table.YES),
        (LOSS, [RX], table.NO),
        (FOOT, [effect("support_flexibility", "support F1, rz", stiffness=9e3)], table.YES),
        (FOOT, [effect("support_flexibility", "supports F1, F2, rz", stiffness=9e3)], table.NO),
    ],
)
def test_a_connection_is_right_with_all_its_directions_however_they_are_told(truth, found, verdict):
    assert (
        table.judge(*table.hidden_effects({"effects": [truth]}, NOMINAL), result("effect", *found)) == verdict
    )


def test_two_connections_are_told_apart():
    truth = table.hidden_effects({"effects": [TWO_AXES, FOOT]}, NOMINAL)
    foot = effect("support_flexibility", "support F1, rz", stiffness=9e3)
    assert table.judge(*truth, result("effect", RX, foot, RY)) == table.YES
    assert table.judge(*truth, result("effect", RX, RY)) == table.NO


@pytest.mark.parametrize(("kind", "found"), [(k, f) for k, several in table.MOVED.items() for f in several])
def test_a_point_of_action_elsewhere_is_right_by_kind_and_place(kind, found):
    moved = {"type": kind, "location": "joint J", "member": "D", "magnitude": {"along_m": 0.02}}
    truth = table.hidden_effects({"effects": [moved]}, NOMINAL)
    assert table.judge(*truth, result("effect", effect(found, "joint J, D", along=0.02))) == table.YES
    assert table.judge(*truth, result("effect", effect(found, "joint K, E", along=0.02))) == table.NO
    assert (
        table.judge(*truth, result("effect", effect("joint_offset", "joint J, x", offset=0.02))) == table.NO
    )


def test_an_unknown_truth_is_an_error():
    with pytest.raises(ValueError, match="'gap' at joint J is not understood"):
        table.hidden_effects({"effects": [{"type": "gap", "location": "joint J", "magnitude": 1}]}, NOMINAL)


GAP = {"type": "gap", "location": "joint J", "magnitude": 1}
ENDED = {"error_db": [{"fit": 3.0}, {"fit": 0.5}], "noise_floor_db": 0.3, "seconds": 2.0}


def row(folder, result, truth):
    """Return the line of a case whose nominal.json is `NOMINAL`, by its columns."""
    (folder / "nominal.json").write_text(json.dumps(NOMINAL), encoding="utf-8")
    return dict(zip(table.HEAD, table.row(folder, result, truth), strict=True))


@pytest.mark.parametrize(
    ("truth", "told"),
    [
        ({"effects": [GAP]}, "gap at joint J"),
        (
            {"effects": [GAP, SIGN, {"prose": "a loose bolt"}]},
            "gap at joint J; sensor_fault at D6z; a loose bolt",
        ),
        (
            {"effects": [{**SOFT, "location": "lap joint X-Y"}]},
            "joint_rotational_flexibility at lap joint X-Y",
        ),
        ({"effects": "see the notes"}, "see the notes"),
        ({}, "effects are not stated"),
        (None, "not in truth.json"),
    ],
)
def test_what_is_not_understood_is_shown_and_not_judged(tmp_path, truth, told):
    shown = row(tmp_path, result("effect", SOFT_FOUND) | ENDED, truth)
    assert (shown["hidden"], shown["right"]) == (told, table.NOT_JUDGED)
    assert (shown["verdict"], shown["error [dB]"]) == ("effect", "3.00 → 0.50")
    assert "joint_stiffness joint J, rx" in shown["found"]


def test_a_run_that_failed_is_wrong_whatever_the_truth_is(tmp_path):
    for truth in (None, {"effects": [GAP]}, {"effects": [SOFT]}):
        shown = row(tmp_path, "exit code 2", truth)
        assert (shown["verdict"], shown["found"], shown["right"]) == ("failed", "exit code 2", table.NO)


def test_only_what_was_judged_is_counted(tmp_path):
    found = result("effect", SOFT_FOUND) | ENDED
    rows = [tuple(row(tmp_path, found, t).values()) for t in ({"effects": [SOFT]}, {"effects": [MASS]})]
    assert table.count(rows) == "1 of 2 right"
    rows += [tuple(row(tmp_path, found, t).values()) for t in ({"effects": [GAP]}, None)]
    assert table.count(rows) == "1 of 2 right; 2 not judged"


@pytest.mark.shared("data/independent-cases")
def test_every_truth_is_understood():
    truth = json.loads((table.CASES / "truth.json").read_text(encoding="utf-8"))
    for name, case in truth.items():
        nominal = json.loads((table.CASES / name / "nominal.json").read_text(encoding="utf-8"))
        effects, faults = table.hidden_effects(case, nominal)
        assert bool(effects or faults) != name.endswith("nothing-missing")


@pytest.mark.long
@pytest.mark.shared("data/independent-cases")
def test_the_program_ends_on_every_case_and_raises_no_false_alarm(tmp_path, capsys):
    """How many are right is for the table to say; an effect where nothing is hidden is a fault."""
    assert table.main(["--out", str(tmp_path)]) == 0
    printed = capsys.readouterr().out.splitlines()
    rows = [line.split("|")[1:-1] for line in printed if line.startswith("| ")]
    cells = [[cell.strip() for cell in r] for r in rows[1:]]
    assert len(cells) == 11
    clean = [(verdict, right) for _, hidden, verdict, _, right, *_ in cells if hidden == "nothing"]
    assert all(right == "yes" or verdict == "unexplained" for verdict, right in clean)


REAL = {
    "masses_kg": {"U at 0.6 m": 0.004},
    "stingers_N_per_m": {"U7z": 1000.0},
    "drivers_kg": {"U7z": 0.01},
    "gains": {"U7z": 1.03},
    "turns_rad": {"U7z": [0.04, 0.03, 0.0]},
}
PLACES = NOMINAL | {"sensors": [{"name": "U7z", "node": 7, "member": "U", "position": 0.6}]}
STINGER = effect("stinger", "excitation at 7, across it", stiffness=900.0)
OTHER_STINGER = effect("stinger", "excitation at 8, across it", stiffness=900.0)
SENSORS = effect("sensor_mass", "the 5 places of sensors", mass=0.005)
DRIVER = effect("driver_mass", "excitation at 7", mass=0.01)


def faulty(kind, value):
    return {"kind": kind, "sensor": "U7z", "value": value, "std": 0.01}


@pytest.mark.parametrize(
    ("truth", "found", "verdict"),
    [
        (NONE, result("effect", STINGER, SENSORS, DRIVER), table.YES),
        (NONE, result("effect", OTHER_STINGER), table.NO),
        (NONE, result("measurement fault", faults=[faulty("sensor_gain", 1.04)]), table.YES),
        (NONE, result("measurement fault", faults=[faulty("sensor_gain", 1.2)]), table.NO),
        (NONE, result("measurement fault", faults=[faulty("sensor_gain", 0.97)]), table.NO),
        (NONE, result("measurement fault", faults=[faulty("sensor_tilt", 0.06)]), table.YES),
        (NONE, result("measurement fault", faults=[faulty("sensor_position", 0.06)]), table.NO),
        (NONE, result("nothing missing"), table.YES),
        (MASS, result("effect", MASS_FOUND, SENSORS), table.YES),
        (MASS, result("effect", SENSORS), table.NO),
        (SIGN, result("effect", STINGER, faults=[D6Z]), table.YES),
        (SIGN, result("effect", STINGER), table.NO),
    ],
)
def test_what_a_test_that_is_not_as_described_has_itself_is_neither_asked_for_nor_wrong(
    truth, found, verdict
):
    case = {"effects": [truth], "instruments": REAL, "code": "OpenSees"}
    assert table.judge_case(case, PLACES, found) == verdict
    if found["verdict"] != "nothing missing" and verdict == table.YES:
        assert table.judge_case(case | {"instruments": {}}, PLACES, found) != table.YES


def evidence(right, in_three, probability, credible):
    shares = [{"name": "a", "probability": 0.9, "right": credible}]
    return {
        "verdict": "effect",
        "right": right,
        "in_three": in_three,
        "sure_and_wrong": not right,
        "probability": probability,
        "place_probability": probability,
        "place_right": right,
        "credible": shares,
        "loss": "-",
    }


def test_the_summary_counts_outcomes_alarms_and_bins(tmp_path):
    about = [
        table.about(k, {"effects": [t]} | more)
        for k, t, more in (
            ("right", MASS, {}),
            ("near", MASS, {"test": "real"}),
            ("alarm", NONE, {}),
            ("late", SOFT, {}),
        )
    ]
    records = [
        about[0] | {"verdict": "effect", "outcome": table.YES, "evidence": evidence(True, True, 0.97, True)},
        about[1] | {"verdict": "effect", "outcome": table.NO, "evidence": evidence(False, True, 0.4, True)},
        about[2]
        | {"verdict": "effect", "outcome": table.NO, "evidence": evidence(False, False, 0.96, False)},
        table.record_of("late", f"{table.NOT_ENDED} in 9 s", {"effects": [SOFT]}),
    ]
    records[0]["cpu_seconds"], records[1]["cpu_seconds"] = 10.0, 30.0
    text = summarise(records, tmp_path)
    assert text == (tmp_path / "summary.md").read_text(encoding="utf-8")
    assert (tmp_path / "reliability.png").read_bytes()[1:4] == b"PNG"
    told = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    every = {g["name"]: g for g in told["groups"]}
    outcomes = ("right", "right in a credible set of three", "wrong", "not ended", "cases")
    assert [every["all"][o] for o in outcomes] == [1, 1, 1, 1, 4]
    assert every["all"]["sure_and_wrong"] == {"hits": 2, "cases": 4}
    assert every["all"]["false_alarms"] == {"hits": 1, "cases": 1}
    assert every["all"]["coverage"] == {"hits": 2, "cases": 3}
    assert every["all"]["cpu_median_s"] == 20.0
    assert every["test real"]["cases"] == every["hidden: nothing"]["cases"] == 1
    bins = {b["stated"]: (b["right"], b["cases"]) for b in told["reliability"]}
    assert bins["0-50 %"] == (0, 1)
    assert bins["95-99 %"] == (1, 2)


def test_a_diagnosis_that_uses_its_time_has_not_ended(tmp_path, monkeypatch):
    case = tmp_path / "case"
    case.mkdir()
    (case / "nominal.json").write_text("{}", encoding="utf-8")
    (tmp_path / "study.toml").write_text("", encoding="utf-8")
    busy = "import resource; resource.setrlimit(resource.RLIMIT_CPU, (1, 9))\nwhile True: pass"
    run = table.subprocess.run
    monkeypatch.setattr(table, "convert", lambda *_: "")
    command = [sys.executable, "-c", busy]
    monkeypatch.setattr(table.subprocess, "run", lambda _, **more: run(command, **more))
    assert table.investigate(case, tmp_path, 1) == f"{table.NOT_ENDED} in 1 s"
