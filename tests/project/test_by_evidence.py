"""Cases of other codes by evidence: truths in the terms of the library, and what becomes of a record."""

import json
import time
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.independent import by_evidence, table
from benchmarks.independent.foreign.parts import PIECES
from benchmarks.independent.foreign.structure import NAMED, STRUCTURES, read
from benchmarks.validation.calibration import read_records
from benchmarks.validation.evidence import at_truth


def candidate(kind, where, **parameters):
    """Return a candidate whose parameters are named with their units."""
    units = {"stiffness": "N·m/rad", "mass": "kg", "position": "m", "amount": "m", "compliance": "rad/(N·m)"}
    effect = SimpleNamespace(kind=kind, where=where, name=f"{kind}:{where}", across=np.array([0.0, 1.0, 0.0]))
    effect.parameters = lambda: [
        SimpleNamespace(name=n, unit=units.get(n, "-"), value=v, lower=-1e9, upper=1e9)
        for n, v in parameters.items()
    ]
    effect.with_values = lambda **values: candidate(kind, where, **parameters | values)
    effect.starts = lambda scale: (dict(parameters),)
    return effect


CANDIDATES = (
    candidate("joint_stiffness", "joint J, rx", stiffness=1.0),
    candidate("joint_stiffness", "joint J, ry", stiffness=1.0),
    candidate("joint_complex_stiffness", "joint J, rx", stiffness=1.0, loss_factor=0.0),
    candidate("joint_structural_damping", "joint J", loss_factor=0.0),
    candidate("point_mass", "member U", mass=0.0, position=0.0),
    candidate("crack", "member U, bending about local y", compliance=1e-6, position=0.0),
    candidate("stiffness_loss", "member U", severity=0.1, position=0.0),
    candidate("joint_hole", "joint J, member B, along local y", amount=0.0),
    candidate("part_shift", "joint J, member B", amount=0.0),
)


def begun(*hidden):
    """Return from where the fits of a truth begin."""
    out = []

    def at(effects, starts, near, *, anew):
        out.append(dict(zip([e.name for e in effects], starts, strict=True)))
        return SimpleNamespace(score=0.0)

    problem = SimpleNamespace(surroundings=None)
    fits = SimpleNamespace(problem=problem, fully=at)
    search = SimpleNamespace(candidates=CANDIDATES, fits=fits, known={frozenset(): None}, best=None)
    assert (at_truth(search, by_evidence.stated(hidden)) is None) == (not out)
    return out


def test_a_soft_connection_begins_in_all_its_directions():
    soft = table.HiddenConnection("J", {"rx": 100.0, "ry": 200.0})
    (start,) = begun(soft)
    assert start == {
        "joint_stiffness:joint J, rx": {"stiffness": 100.0},
        "joint_stiffness:joint J, ry": {"stiffness": 200.0},
    }
    assert begun(table.HiddenConnection("K", {"rx": 100.0})) == []


def test_a_soft_and_lossy_joint_begins_both_ways_that_the_library_has():
    lossy = table.HiddenConnection("J", {"rx": 100.0}, 0.3)
    whole, apart = begun(lossy)
    assert whole == {"joint_complex_stiffness:joint J, rx": {"stiffness": 100.0, "loss_factor": 0.3}}
    assert apart == {
        "joint_stiffness:joint J, rx": {"stiffness": 100.0},
        "joint_structural_damping:joint J": {"loss_factor": 0.3},
    }


def test_values_are_taken_in_their_unit_and_others_begin_on_the_grid():
    notch = table.Hidden(("crack", "stiffness_loss"), ("U",), 0.4, "-", 0.3, 0.04)
    crack, loss = begun(notch)
    assert crack["crack:member U, bending about local y"] == {"compliance": 1e-6, "position": 0.3}
    assert loss["stiffness_loss:member U"] == {"severity": 0.4, "position": 0.3}
    mass = table.Hidden(("point_mass",), ("U",), 0.08, "kg", 0.6, 0.04)
    assert begun(mass) == [{"point_mass:member U": {"mass": 0.08, "position": 0.6}}]


def test_moves_begin_with_their_length_along_or_across_the_member():
    hole = table.HiddenMove(("joint_hole",), "J", "B", [0.001, -0.004, 0.0])
    assert begun(hole) == [{"joint_hole:joint J, member B, along local y": {"amount": -0.004}}]
    shift = table.HiddenMove(("part_shift",), "J", "B", -0.02)
    assert begun(shift) == [{"part_shift:joint J, member B": {"amount": -0.02}}]


def test_records_go_to_a_file_that_the_calibration_reads(tmp_path):
    told = {"probability": 0.97, "place_probability": 1.0, "in_three": True, "truth": None, "loss": "-"}
    results = [
        {"record": {"case": "a", "set": "one", "evidence": told}},
        "exit code 2",
        {"verdict": "effect"},
    ]
    cells = [table.evidence_row(r) for r in results]
    assert cells[0] == ("97.0 %", "100.0 %", "yes", "-", "-")
    assert cells[1] == cells[2] == ("-",) * len(table.POSTERIOR)
    records = [table.record_of(case, r, {}) for case, r in zip("abc", results, strict=True)]
    table.write_records(records, tmp_path / "records.jsonl")
    assert [(r["case"], r.get("outcome")) for r in read_records(tmp_path)] == [
        ("a", None),
        ("b", "failed"),
        ("c", None),
    ]


def test_two_processes_give_the_table_of_one(tmp_path, monkeypatch, capsys):
    nominal = {"joints": [], "members": [], "supports": [], "sensors": []}
    for name in "abc":
        (tmp_path / "cases" / name).mkdir(parents=True)
        (tmp_path / "cases" / name / "nominal.json").write_text(json.dumps(nominal))
    none = {"type": "none", "location": "-", "magnitude": 0}
    (tmp_path / "cases" / "truth.json").write_text(json.dumps({n: {"effects": [none]} for n in "abc"}))

    def investigate(case, out, cap):
        time.sleep({"a": 0.1, "b": 0.05, "c": 0.0}[case.name])  # the first ends last
        ended = {"verdict": "nothing missing", "effects": [], "faults": [], "seconds": 1.0}
        about = table.about(case.name, {"effects": [none]}) | {"verdict": "nothing missing", "outcome": "yes"}
        more = {"error_db": [{"fit": 1.0}], "noise_floor_db": 0.3, "record": about}
        return ended | more

    monkeypatch.setattr(table, "investigate", investigate)
    told = []
    for jobs in ("1", "2"):
        out = tmp_path / jobs
        out.mkdir()
        arguments = ["--cases", str(tmp_path / "cases"), "--out", str(out), "--jobs", jobs]
        assert table.main(arguments) == 0
        told.append((capsys.readouterr().out, (out / "records.jsonl").read_text()))
    assert told[0] == told[1]
    assert "3 of 3 right" in told[0][0]
    assert "| all | 3 | 3 | 0 |" in told[0][0]


def test_faults_are_right_only_all_together():
    sign = table.HiddenFault("sensor_sign", "A1z")
    found = {"kind": "sensor_sign", "sensor": "A1z", "value": -1.0}
    assert table.faults_are([sign], [found])
    assert not table.faults_are([sign], [])
    assert not table.faults_are([], [found])


@pytest.mark.parametrize(("path", "name"), [(path, name) for path in NAMED for name in read(path)])
def test_a_named_structure_is_whole_and_in_no_other_file(path, name):
    structure = read(path)[name]
    assert [name in read(p) for p in (STRUCTURES, *NAMED)].count(True) == 1
    names = [s["name"] for s in structure.channels]
    assert len(set(names)) == len(names)
    assert set(structure.excitations) <= set(names)
    assert sorted(m for body in structure.bodies for m in body) == sorted(structure.members)
    for s in structure.channels:
        assert 0 <= s["position"] <= structure.members[s["member"]].length + 1e-9
    for c in structure.connections.values():
        points = [structure.members[m].at(s) for m, s in c.sides]
        assert all(0 <= s <= structure.members[m].length + 1e-9 for m, s in c.sides)
        assert np.ptp(points, axis=0).max() < 0.0601  # bolted on each other, or by a bracket of 60 mm


@pytest.mark.parametrize(
    ("path", "name"),
    [(p, name) for p in (STRUCTURES, *NAMED) for name, s in read(p).items() if not s.solid],
)
def test_beams_of_one_body_are_connected_at_nodes(path, name):
    """A member that crosses another one between two nodes is not welded to it."""
    structure = read(path)[name]
    marks = [*structure.sensors, *(side for c in structure.connections.values() for side in c.sides)]
    nodes = {
        m: {
            tuple(member.at(s).round(5))
            for s in (*np.linspace(0, member.length, PIECES + 1), *(at[1] for at in marks if at[0] == m))
        }
        for m, member in structure.members.items()
    }
    for body in structure.bodies:
        first, *left = body
        reached, before = set(nodes[first]), len(left) + 1
        while len(left) < before:
            before = len(left)
            for m in [m for m in left if nodes[m] & reached]:
                reached |= nodes[m]
                left.remove(m)
        assert not left


@pytest.mark.shared("data/independent-cases")
@pytest.mark.slow
def test_a_case_ends_with_its_truth_started(tmp_path):
    assert table.main(["--out", str(tmp_path), "--only", "cross-beam-joint-soft"]) == 0
    (record,) = read_records(tmp_path)
    assert record["evidence"]["truth"] is not None
    assert json.loads((tmp_path / record["case"] / "result" / "result.json").read_text())["verdict"]
