"""The open test: cases in words of no program, answers that are read and judged, seals, and its rivals."""

import importlib
import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import benchmarks.open_test as package
from benchmarks.independent.convert import convert
from benchmarks.open_test.__main__ import main
from benchmarks.open_test.answer import ANSWER_FORMAT, read_answer
from benchmarks.open_test.case import CaseError, neutral, nominal_of, read_modes, read_structure
from benchmarks.open_test.judge import IN_SET, PART, RIGHT, UNKNOWN, WRONG, judge
from benchmarks.open_test.kinds import is_same
from benchmarks.open_test.oracle import nats_of
from benchmarks.open_test.rivals.common import Case
from benchmarks.open_test.sets import SEALS, TRUTH, cases_of
from benchmarks.open_test.words import effects_of
from dovetail import load_study
from fem import FRF, assemble, compute_frf
from fem.io import write_uff
from updating import sensor_rows

ROOT = Path(package.__file__).parents[2]
TUBE = {"type": "tube", "d": 0.026, "t": 0.0025, "h_direction": [0, 0, 1]}
FOOT_AT, HEAD = [0.0, 0.0, 0.0], [0.0, 0.0, 0.5]
SENSORS = [
    ("P", 0.2, "x"),
    ("P", 0.5, "x"),
    ("P", 0.5, "y"),
    ("A", 0.15, "z"),
    ("A", 0.3, "y"),
    ("A", 0.3, "z"),
]
STIFF = {"kx": 2e7, "ky": 2e7, "kz": 2e7, "krx": 4e3, "kry": 4e3, "krz": 4e3}
SOFT = {"type": "connection", "location": "joint F", "magnitude": {"k": {"ry": 400.0}}}
TOLD = {"code": "closed form", "structure": "bracket", "effects": [SOFT], "test": "as described"}


def nominal(name="bracket-1"):
    """Return nominal.json of a post on an elastic foot with an arm."""
    at = {"P": lambda s: [0.0, 0.0, s], "A": lambda s: [s, 0.0, 0.5]}
    sensors, points = [], {}
    for member, s, direction in SENSORS:
        node = next((n for n, p in points.items() if p == at[member](s)), str(len(points) + 1))
        points[node] = at[member](s)
        sensors.append(
            {"name": f"{member}{node}{direction}", "direction": direction, "node": int(node), "sign": 1}
            | {"member": member, "position": s}
        )
    return {
        "case": name,
        "structure": "a post with an arm",
        "units": "SI",
        "material": {"name": "steel", "E": 2.1e11, "nu": 0.3, "rho": 7850.0},
        "points": points,
        "members": [
            {"name": "P", "end1": FOOT_AT, "end2": HEAD, "section": TUBE | {"h_direction": [1, 0, 0]}},
            {"name": "A", "end1": HEAD, "end2": [0.3, 0.0, 0.5], "section": TUBE},
        ],
        "joints": [
            {
                "name": "F", "type": "elastic, 6 uncoupled springs in global directions, loss factor 0.01",
                "member1": "P", "s1": 0.0, "member2": "ground", "s2": 0.0, "location": FOOT_AT, "k": STIFF,
            }
        ],
        "supports": "free-free",
        "sensors": sensors,
        "excitations": [{"sensor": "P2x"}, {"sensor": "A4z"}],
        "frequency": {"start": 5.0, "stop": 600.0, "lines": 600},
        "response": "accelerance, (m/s^2)/N",
        "damping_guess_modal": 0.005,
        "tolerances": "E +-2 %, rho +-2 %, joint data +-10 %, dimensions +-0.5 %",
        "files": ["frf.uff"],
        "welded": "all other connections welded (rigid), centre lines meet",
    }  # fmt: skip


@pytest.fixture(scope="module")
def cases(tmp_path_factory):
    """Return a folder with one case, whose foot turns more easily about y than stated."""
    folder = tmp_path_factory.mktemp("generated")
    made, told = folder / "bracket-1", nominal()
    made.mkdir()
    (made / "nominal.json").write_text(json.dumps(told), encoding="utf-8")
    study = folder / "study.toml"
    true = json.loads(json.dumps(told))
    true["joints"][0]["k"]["kry"] = 400.0
    true["files"] = []
    study.write_text(convert(true, made, study), encoding="utf-8")
    real = load_study(study)
    lines = np.linspace(5.0, 600.0, 600)
    rows = [sensor_rows(real.model, part) for part in (real.sensors, real.excitations)]
    H = compute_frf(assemble(real.model), lines, *rows).as_kind("accelerance").H
    rng = np.random.default_rng(5)
    H = H * (1 + 0.01 * (rng.standard_normal(H.shape) + 1j * rng.standard_normal(H.shape)))
    label = {s["name"]: f"{s['node']}{s['direction'].upper()}+" for s in told["sensors"]}
    names = [[label[s["name"]] for s in told["sensors"]], [label[e["sensor"]] for e in told["excitations"]]]
    write_uff(made / "frf.uff", FRF.from_arrays(lines, H, "accelerance", *names))
    (folder / "truth.json").write_text(json.dumps({"bracket-1": TOLD}), encoding="utf-8")
    out = tmp_path_factory.mktemp("cases")
    assert main(["take", str(folder), str(out)]) == 0
    return out


def answer(folder, *explanations, unexplained=0.0, **more):
    """Write an answer to the case; return its file."""
    told = {"format": ANSWER_FORMAT, "case": "case-001", "program": "toy", "cpu_seconds": 1.0}
    told["explanations"] = [{"probability": p, "effects": list(effects)} for p, effects in explanations]
    file = folder / "case-001.json"
    file.write_text(json.dumps(told | {"unexplained": unexplained} | more), encoding="utf-8")
    return file


FOOT = {"kind": "connection_stiffness", "place": "F", "direction": "ry"}
MASS = {"kind": "mass", "place": "A", "position": 0.3}
SPRING = {"kind": "ground_spring", "direction": "x"}


def test_a_case_says_the_same_as_what_it_was_made_of():
    told = nominal()
    back = nominal_of(neutral(told))
    assert back == told | {"units": "SI"}


def test_a_case_has_its_modes_and_no_name_of_its_structure(cases):
    structure = read_structure(cases / "case-001")
    f, zeta, shapes = read_modes(cases / "case-001")
    assert structure.connections == {"F": [("P", 0.0)]}
    assert shapes.shape == (len(SENSORS), len(f))
    assert 0.001 < np.median(zeta) < 0.02
    assert "bracket" not in (cases / "case-001" / "structure.json").read_text(encoding="utf-8")


def test_files_are_as_their_schemas_say(cases, tmp_path):
    jsonschema = pytest.importorskip("jsonschema")
    here = Path(package.__file__).parent
    for name, file in (
        ("case", cases / "case-001" / "structure.json"),
        (
            "answer",
            answer(tmp_path, (0.9, [FOOT | {"value": 400.0, "unit": "N·m/rad", "std": None}]), (0.1, [])),
        ),
    ):
        schema = json.loads((here / f"{name}.schema.json").read_text(encoding="utf-8"))
        jsonschema.validate(json.loads(file.read_text(encoding="utf-8")), schema)


@pytest.mark.parametrize(
    ("said", "complaint"),
    [
        ([(0.9, [FOOT | {"place": "G"}])], "a place is one of F"),
        ([(0.9, [FOOT | {"kind": "softness"}])], "there is no kind 'softness'"),
        ([(0.9, [MASS | {"position": 0.4}])], "0 to 0.3 m along A"),
        ([(0.9, [FOOT]), (0.2, [])], "together 1.1"),
        ([(1.2, [FOOT])], "0 to 1 is allowed"),
    ],
)
def test_an_answer_that_cannot_be_meant_is_refused_by_name(cases, tmp_path, capsys, said, complaint):
    file = answer(tmp_path, *said)
    assert main(["check", str(cases / "case-001"), str(file)]) == 2
    error = capsys.readouterr().err
    assert complaint in error
    assert str(file) in error


@pytest.mark.parametrize(
    ("said", "unexplained", "outcome", "sure_and_wrong"),
    [
        ([(0.95, [FOOT])], 0.0, RIGHT, False),
        ([(0.6, [MASS]), (0.35, [FOOT])], 0.0, IN_SET, False),
        ([(0.95, [MASS])], 0.0, WRONG, True),
        ([(0.95, [])], 0.0, WRONG, True),
        ([(0.05, [MASS])], 0.9, UNKNOWN, False),
        ([], 0.0, UNKNOWN, False),
    ],
)
def test_answers_are_judged(cases, tmp_path, said, unexplained, outcome, sure_and_wrong):
    structure = read_structure(cases / "case-001")
    truth = json.loads((cases / TRUTH).read_text(encoding="utf-8"))["case-001"]
    judged = judge(read_answer(answer(tmp_path, *said, unexplained=unexplained), structure), truth, structure)
    assert (judged.outcome, judged.sure_and_wrong) == (outcome, sure_and_wrong)


@pytest.mark.parametrize(
    ("truth", "outcome", "score"),
    [
        (
            {"effects": [], "outside": [{"what": "spring between two members"}]},
            RIGHT,
            np.log(0.9 * 0.25 + 0.1 * 0.2),
        ),
        ({"effects": []}, WRONG, np.log(0.1 * 0.2)),
        ({"effects": [FOOT]}, UNKNOWN, np.log((0.9 / 0.8 + 0.1) * 0.35 / 74)),
    ],
)
def test_unexplained_is_right_where_no_kind_describes_the_truth(cases, tmp_path, truth, outcome, score):
    structure = read_structure(cases / "case-001")
    truth = {"structure": "bracket", "test": "as described"} | truth
    judged = judge(read_answer(answer(tmp_path, unexplained=0.9), structure), truth, structure)
    assert judged.outcome == outcome
    assert judged.log_score == pytest.approx(score, abs=1e-3)


@pytest.mark.parametrize(
    ("said", "true", "same"),
    [
        ("P.2 y", "A.1 y", True),  # welded to each other
        ("P.2 y", "A.1 z", False),
        ("A.2 x", "A.1 x", True),  # along the arm
        ("A.2 y", "A.1 y", False),
        ("P.1 x", "P.2 x", False),
        (MASS | {"place": "P", "position": 0.49}, MASS | {"position": 0.01}, True),
        (MASS | {"place": "P", "position": 0.45}, MASS | {"position": 0.01}, False),
    ],
)
def test_what_acts_on_one_point_is_one_place(cases, said, true, same):
    def effect(told):
        if isinstance(told, dict):
            return told
        place, direction = told.split()
        return SPRING | {"place": place, "direction": direction}

    assert is_same(effect(said), effect(true), read_structure(cases / "case-001")) is same


def test_a_sum_that_is_one_but_for_rounding_is_read(cases, tmp_path):
    told = read_answer(answer(tmp_path, unexplained=1 + 1e-13), read_structure(cases / "case-001"))
    assert told.unexplained == 1


def test_the_oracle_finds_what_is_hidden_worth_more_than_its_odds(cases):
    truth = json.loads((cases / TRUTH).read_text(encoding="utf-8"))["case-001"]
    case = Case(cases / "case-001")
    assert nats_of(case, truth) > 50
    assert nats_of(case, truth | {"effects": []}) is None


def test_being_sure_and_wrong_costs_more_than_not_to_know(cases, tmp_path):
    structure = read_structure(cases / "case-001")
    truth = json.loads((cases / TRUTH).read_text(encoding="utf-8"))["case-001"]
    scores = [
        judge(read_answer(answer(tmp_path, *said), structure), truth, structure).log_score
        for said in ([(0.9, [FOOT])], [], [(0.999, [MASS])])
    ]
    assert scores[0] == pytest.approx(np.log(0.9), abs=1e-3)
    assert scores[0] > scores[1] > scores[2] + 4


def test_of_two_true_effects_one_alone_is_right_in_part(cases, tmp_path):
    structure = read_structure(cases / "case-001")
    truth = {"effects": [FOOT, MASS], "structure": "bracket", "test": "as described"}
    judged = judge(read_answer(answer(tmp_path, (0.95, [FOOT])), structure), truth, structure)
    assert (judged.outcome, judged.named, judged.missed, judged.false) == (PART, 1, 1, 0)


def test_what_a_real_test_has_is_neither_right_nor_wrong(cases, tmp_path):
    structure = read_structure(cases / "case-001")
    off = {"kind": "sensor", "place": "P2x"}
    told = answer(tmp_path, (0.95, [FOOT, off]))
    truth = {"effects": [FOOT], "structure": "bracket", "test": "real"}
    assert judge(read_answer(told, structure), truth, structure).outcome == RIGHT
    assert judge(read_answer(told, structure), truth | {"test": "as described"}, structure).outcome == WRONG


@pytest.mark.parametrize(
    ("name", "values", "effects"),
    [
        ("joint_stiffness:F.ry", {"stiffness": (400.0, 5.0, "N·m/rad")}, [FOOT]),
        ("point_mass:A", {"mass": (0.1, 0.01, "kg"), "position": (0.3, 0.01, "m")}, [MASS]),
        ("end_release:P.1.ry", {"compliance": (1e-4, 1e-5, "rad/(N·m)")}, [FOOT]),
        ("sensor_mass", {"mass": (0.002, 0.001, "kg")}, []),
        ("joint_coupling:F.x-ry", {"coupling": (0.3, 0.1, "-")}, None),
        ("ground_spring:F.x", {"stiffness": (1e5, 1e4, "N/m")}, [SPRING | {"place": "P.1"}]),
        ("ground_spring:F.other.x", {"stiffness": (1e5, 1e4, "N/m")}, None),
    ],
)
def test_words_of_the_program_become_those_of_the_test(cases, name, values, effects):
    told = effects_of(name, values, read_structure(cases / "case-001"))
    keys = ("kind", "place", "direction", "position")
    plain = None if told is None else [{k: e[k] for k in keys if k in e} for e in told]
    assert plain == effects


def test_truth_that_was_changed_after_it_was_sealed_is_noticed(cases, tmp_path, capsys):
    folder, kept = tmp_path / "set", tmp_path / "kept"
    shutil.copytree(cases, folder)
    assert main(["seal", str(folder), str(kept)]) == 0
    assert not (folder / TRUTH).exists()
    assert len(json.loads((folder / SEALS).read_text(encoding="utf-8"))["case-001"]) == 64
    assert main(["reveal", str(folder), str(kept)]) == 0
    truth = json.loads((kept / TRUTH).read_text(encoding="utf-8"))
    truth["case-001"]["effects"] = []
    (kept / TRUTH).write_text(json.dumps(truth), encoding="utf-8")
    assert main(["reveal", str(folder), str(kept)]) == 2
    assert "case-001" in capsys.readouterr().err


def test_a_folder_without_cases_is_said(tmp_path):
    with pytest.raises(CaseError, match="there is no folder"):
        cases_of(tmp_path)


def test_a_toy_program_enters_by_the_documented_door(cases, tmp_path, capsys):
    toy, unsure = tmp_path / "toy", tmp_path / "unsure"
    toy.mkdir()
    unsure.mkdir()
    answer(toy, (0.95, [FOOT]))
    answer(unsure)
    page = tmp_path / "page.md"
    assert main(["judge", str(cases), str(toy), str(unsure), "--page", str(page)]) == 0
    printed = capsys.readouterr().out
    assert "| toy | 1 | -0.05 | 1 of 1" in printed
    assert printed.index("| toy |") < printed.index("| unsure |")
    assert page.with_suffix(".png").stat().st_size > 10_000


def test_answers_are_judged_without_any_package_of_the_program(cases, tmp_path):
    (tmp_path / "toy").mkdir()
    answer(tmp_path / "toy")
    code = (
        "import sys\n"
        "for name in ('fem', 'updating', 'joint', 'viz', 'dovetail'): sys.modules[name] = None\n"
        "from benchmarks.open_test.__main__ import main\n"
        f"sys.exit(main(['judge', {str(cases)!r}, {str(tmp_path / 'toy')!r}]))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, cwd=ROOT)
    assert done.returncode == 0, done.stderr
    assert "| toy | 1 |" in done.stdout


@pytest.mark.parametrize(
    "name", ["modal_updating", "sparse_bayes", "constitutive_error", "forward_modal", "frf_one_by_one"]
)
def test_rivals_name_what_their_own_model_lacks(cases, name):
    case = importlib.import_module("benchmarks.open_test.rivals.common").Case(cases / "case-001")
    told = importlib.import_module(f"benchmarks.open_test.rivals.{name}").solve(case)
    named = max((e for e in told.explanations if e.effects), key=lambda e: e.probability).effects
    (foot,) = (x for x in named if {k: x.get(k) for k in FOOT} == FOOT)
    assert foot["value"] == pytest.approx(400.0, rel=0.05)


def test_cases_without_an_answer_count_as_do_not_know_and_are_said(cases, tmp_path, capsys):
    (tmp_path / "silent").mkdir()
    assert main(["judge", str(cases), str(tmp_path / "silent")]) == 0
    printed = capsys.readouterr().out
    assert "| silent | 1 | -5.35 | 0 of 1" in printed
    assert 'silent has not answered 1 cases, which count as "do not know"' in printed


def test_tuning_keeps_sharp_what_is_right_and_blunts_what_is_wrong(cases, tmp_path, capsys):
    for name, first in (("good", FOOT), ("bad", MASS)):
        (tmp_path / name).mkdir()
        answer(tmp_path / name, (0.8, [first]), (0.2, [MASS | {"place": "P"}]))
    assert main(["tune", str(cases), str(tmp_path / "good"), str(tmp_path / "bad")]) == 0
    good, bad = capsys.readouterr().out.splitlines()
    assert "with 0.1 times the temperature, 0 nats an effect and 0.02 for" in good
    assert '0.9 for "do not know"' in bad
