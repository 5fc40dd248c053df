"""Cases drawn from a seed, how a diagnosis is judged, and the runner; with diagnoses made by hand."""

import json
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.validation import cases
from benchmarks.validation import run as runner
from benchmarks.validation.__main__ import main
from benchmarks.validation.calibration import Share
from benchmarks.validation.cases import CaseError, CaseSettings, _Scale, draw_case, kinds_of
from benchmarks.validation.frames import draw_draft, perturbed
from benchmarks.validation.hidden import EFFECTS, FAULTS, KINDS, SETS, draw_hidden
from benchmarks.validation.judging import judge, same_place
from benchmarks.validation.table import as_markdown
from dovetail.units import FolderError
from updating import propose
from updating.correlation import DB_PER_NEPER, log_ratio

SETTINGS = CaseSettings(3, small=True)
FAMILY = {"joint": "cross", "support": "angle", "end": "angle", "rigid": "angle"}


def heard(draft, truth, hidden):
    """Whether any sensor hears the effect: a crack in a plane that none looks at is not heard."""
    f, strong = draft.frequency[5::40], hidden.change(truth, hidden.bounds[1])
    if hidden.place.sensors:
        sensors = [s for s in draft.sensors if s.name in hidden.place.sensors]
        own = np.abs(truth.frf(f, sensors, draft.drives)).max(axis=(0, 2))
        return (own > 1e-3 * np.abs(truth.frf(f, draft.sensors, draft.drives)).max()).all()
    H = [frame.frf(f, draft.sensors, draft.drives) for frame in (truth, strong)]
    return np.abs(H[1] - H[0]).max() > 1e-3 * np.abs(H[0]).max()


@lru_cache
def frame(family, *seed):
    rng = np.random.default_rng(seed)
    draft = draw_draft(rng, family, small=True)
    return draft, perturbed(rng, draft, 0.03, 0.15, 2.0)


def draft_for(kind, seed=5):
    """Return a small frame that holds a kind, the truth, and the kind at a place."""
    for k in range(20):
        draft, truth = frame(FAMILY.get(kind.split("_")[0], "tee"), seed, k // 5)
        hidden = draw_hidden(np.random.default_rng(k), kind, draft, truth)
        if hidden is not None and heard(draft, truth, hidden):
            return draft, truth, hidden
    raise AssertionError(kind)


def case_of(kind, set_name="single"):
    index = next(i for i in range(99) if kinds_of(SETTINGS, set_name, i) == (kind,))
    return draw_case(SETTINGS, set_name, index)


def test_there_are_at_least_thirty_kinds_of_effects():
    assert len(EFFECTS) >= 30
    assert set(FAULTS) >= {"gain", "sign", "tilt", "swap", "delay", "position"}


@pytest.mark.parametrize("kind", EFFECTS)
def test_weak_effects_change_the_frfs_in_proportion_to_their_amplitude(kind):
    draft, truth, hidden = draft_for(kind)
    f = draft.frequency[5::40]
    base = truth.frf(f, draft.sensors, draft.drives)

    def change(a):
        H = hidden.change(truth, a).frf(f, draft.sensors, draft.drives)
        return (H - base) / np.abs(base).max(axis=(0, 1))

    # So weak that the second order counts for little, so strong that rounding does not.
    a = hidden.bounds[0]
    while np.abs(change(a)).max() > 1e-4:
        a /= 4
    one, two = change(a), change(2 * a)
    assert np.abs(one).max() > 1e-9
    # Twice the amplitude, twice the change, but for the second order: of the relative size of the change
    # itself, 1e-4, at resonances of some hundred.
    np.testing.assert_allclose(two, 2 * one, atol=0.03 * np.abs(two).max())


@pytest.mark.parametrize("kind", FAULTS)
def test_faults_change_the_rows_of_their_sensors_alone(kind):
    draft, truth, hidden = draft_for(kind)
    f = draft.frequency[5::40]
    a = hidden.bounds[1]
    sensors = hidden.readings(draft.sensors, a) if hidden.readings else draft.sensors
    base = truth.frf(f, draft.sensors, draft.drives)
    H = truth.frf(f, sensors, draft.drives)
    if hidden.data:
        H = hidden.data(f, H, a)
    moved = (np.abs(H - base) > 1e-9 * np.abs(base).max()).any(axis=(0, 2))
    names = [s.name for s in draft.sensors]
    assert {n for n, m in zip(names, moved, strict=True) if m} == set(hidden.place.sensors)


@pytest.mark.parametrize("kind", ["tilt", "position"])
def test_a_drawn_fault_changes_what_its_sensor_reads_by_a_tenth(kind):
    settings = replace(SETTINGS, seed=1031)  # 1 and 2 were faults that changed nothing
    indices = [i for i in range(3 * len(FAULTS)) if kinds_of(settings, "faults", i) == (kind,)]
    for i in indices:
        case = draw_case(settings, "faults", i)
        (implant,) = case.implants
        frame, f = case.draft.frame, case.draft.frequency[::20]
        wrong = implant.hidden.readings(case.draft.sensors, implant.amplitude)
        base, read = (frame.frf(f, sensors, case.draft.drives) for sensors in (case.draft.sensors, wrong))
        rows = [s.name in implant.hidden.place.sensors for s in case.draft.sensors]
        assert np.abs(np.log(read[:, rows] / base[:, rows])).max() > 0.1


def test_a_case_is_drawn_alike_every_time():
    one, again = draw_case(SETTINGS, "null", 4), draw_case(SETTINGS, "null", 4)
    np.testing.assert_array_equal(one.measurement.frf.H, again.measurement.frf.H)
    other = draw_case(replace(SETTINGS, seed=4), "null", 4)
    assert other.exact.shape != one.exact.shape or not np.array_equal(other.exact, one.exact)


def test_every_kind_comes_once_in_a_round():
    n = len(EFFECTS)
    for start in (0, n):
        assert sorted(kinds_of(SETTINGS, "single", start + i)[0] for i in range(n)) == sorted(EFFECTS)
    assert kinds_of(SETTINGS, "null", 0) == ()
    assert len(kinds_of(SETTINGS, "two", 1)) == 2


def test_hidden_effects_are_as_visible_as_wanted_and_weak_ones_ten_times_weaker(mass_case):
    low, high = SETTINGS.visible_db
    (full,), (weak,) = (draw_case(replace(SETTINGS, weaker=w), "weak", 2).implants for w in (1.0, 10.0))
    assert weak.amplitude == pytest.approx(full.amplitude / 10)
    (implant,) = mass_case[0].implants
    # The grid's step is at most 8 in amplitude; four bisections leave its sixteenth root, 1.14.
    assert low <= implant.visible_db <= 1.2 * high


def test_what_uncertain_parameters_can_do_is_not_visible():
    rng = np.random.default_rng(8)
    draft = draw_draft(rng, "cross", small=True)
    truth = perturbed(rng, draft, 0.03, 0.15, 2.0)
    scale = _Scale(draft, truth, 3e-5)

    def softer(step):
        members = {n: replace(m, E=m.E * (1 - step)) for n, m in truth.members.items()}
        return scale.visible_db(replace(truth, members=members))

    # First order is projected out, the second stays: half the step, a quarter of the change.
    # The derivative's own step h = 1e-6 adds a part h/s of that.
    assert softer(2e-4) / softer(1e-4) == pytest.approx(4, rel=0.05)
    assert softer(1e-4) < 0.01
    heavier = {"U": replace(truth.members["U"], rho=truth.members["U"].rho * 1.1), "D": truth.members["D"]}
    assert scale.visible_db(replace(truth, members=heavier)) > 0.5


def test_noise_is_of_the_size_that_the_case_states():
    case = draw_case(SETTINGS, "null", 1)
    ratio = log_ratio(case.measurement.frf.H, case.exact)
    loud = np.abs(case.exact) > 0.05 * np.abs(case.exact).max(axis=(0, 1))
    n = loud.sum()
    # Real and imaginary part of relative noise σ have σ/√2 each; its estimate scatters by 1/√(2n).
    assert np.std(ratio.real[loud]) == pytest.approx(case.noise / np.sqrt(2), rel=4 / np.sqrt(2 * n))
    assert pytest.approx(20 / np.log(10)) == DB_PER_NEPER


def test_what_cannot_be_drawn_is_refused(monkeypatch):
    monkeypatch.setattr(cases, "drawn_implants", lambda *_: None)
    with pytest.raises(CaseError, match=r"no frame of 40 shows .* \(set two, case 0\)"):
        draw_case(SETTINGS, "two", 0)


# ------------------------------------------------------------------------------------------- judging


def said(case, findings=(), verdict="effect", faults=(), rounds=(), after=0.3, searched=None):
    """Return a diagnosis as far as judging reads it."""
    step = SimpleNamespace(fit_db=after, held_out_db=after)
    return SimpleNamespace(
        model=case.model,
        findings=findings,
        verdict=verdict,
        faults=faults,
        rounds=rounds,
        steps=(step, step),
        reason="",
        discretisation_db=0.0,
        basis_db=0.0,
        seconds=1.0,
        searched=searched,
        problem=SimpleNamespace(data=SimpleNamespace(mask=np.ones(case.exact.shape, dtype=bool))),
    )


def finding(effect, twins=(), **values):
    effect = effect.with_values(**values)
    parameters = tuple(
        SimpleNamespace(name=p.name, value=p.value, std=0.01 * abs(p.value)) for p in effect.parameters()
    )
    return SimpleNamespace(effect=effect, parameters=parameters, twins=twins)


def ranked(effect, score=0.0):
    return SimpleNamespace(
        name=effect.name,
        kind=effect.kind,
        where=effect.where,
        parameters=finding(effect).parameters,
        score=score,
    )


@pytest.fixture(scope="module")
def mass_case():
    case = case_of("point_mass")
    (implant,) = case.implants
    candidates = {e.name: e for e in propose(case.model, kinds=["point_mass", "stiffness_loss"])}
    return case, implant.hidden.values(implant.amplitude), candidates


def test_two_of_one_kind_are_each_compared_with_the_nearer_truth(mass_case):
    case, true, candidates = mass_case
    (implant,) = case.implants
    hidden = replace(implant.hidden, values=lambda a: {**true, "mass": 2 * true["mass"]})
    both = replace(case, implants=(implant, replace(implant, hidden=hidden)))
    right = candidates[f"point_mass:{implant.hidden.place.member}"]
    two = [finding(right, mass=m * true["mass"], position=true["position"]) for m in (2.02, 1.01)]
    errors = [e for e in judge(both, said(both, two))["errors"] if e["parameter"] == "mass"]
    assert [e["error"] for e in errors] == pytest.approx([0.01, 0.01])
    assert [e["truth"] for e in errors] == [2 * true["mass"], true["mass"]]


def test_right_kind_at_the_right_place(mass_case):
    case, true, candidates = mass_case
    member = case.implants[0].hidden.place.member
    right = candidates[f"point_mass:{member}"]
    length = case.draft.frame.members[member].length
    record = judge(case, said(case, [finding(right, mass=true["mass"] * 1.01, position=true["position"])]))
    assert record["outcome"] == "right"
    error = next(e for e in record["errors"] if e["parameter"] == "mass")
    assert error["error"] == pytest.approx(0.01)
    assert error["covered"]
    for share, outcome in ((0.04, "right"), (0.06, "wrong")):
        at = true["position"] + np.sign(length / 2 - true["position"]) * share * length
        record = judge(case, said(case, [finding(right, mass=true["mass"], position=at)]))
        assert record["outcome"] == outcome


def test_twins_false_effects_and_other_verdicts(mass_case):
    case, true, candidates = mass_case
    member = case.implants[0].hidden.place.member
    right, loss = candidates[f"point_mass:{member}"], candidates[f"stiffness_loss:{member}"]
    twin = ranked(right.with_values(**true))
    assert judge(case, said(case, [finding(loss)]))["outcome"] == "wrong"
    assert judge(case, said(case, [finding(loss, twins=(twin,))]))["outcome"] == "twin"
    assert judge(case, said(case, [finding(loss)]))["nearest"] is None  # nothing was tried beside it
    answer = SimpleNamespace(best=SimpleNamespace(score=2.0))
    rounds = ((ranked(loss, 2.0), ranked(right, 1.0)), (ranked(right, -1.5), ranked(loss, -3.0)))
    beside = judge(case, said(case, [finding(loss)], rounds=rounds, searched=answer))
    assert beside["nearest"] == {"kind": right.kind, "where": right.where, "behind": 3.5}
    both = [finding(right, **true), finding(loss)]
    assert judge(case, said(case, both))["outcome"] == "beside"
    for verdict, outcome in (
        ("unexplained", "unexplained"),
        ("nothing missing", "not noticed"),
        ("measurement fault", "fault"),
    ):
        assert judge(case, said(case, verdict=verdict))["outcome"] == outcome


def test_withheld_kinds_are_rightly_unexplained_and_twins_must_explain(mass_case):
    case, _, candidates = mass_case
    held = replace(case, set="withheld")
    loss = next(e for e in candidates.values() if e.kind == "stiffness_loss")
    assert judge(held, said(held, verdict="unexplained"))["outcome"] == "right"
    assert judge(held, said(held, [finding(loss)], after=5.0))["outcome"] == "wrong"
    assert judge(held, said(held, [finding(loss)], after=0.1))["outcome"] == "twin"
    assert judge(held, said(held, verdict="nothing missing"))["outcome"] == "not noticed"


def test_joints_are_told_apart_by_direction():
    case = case_of("joint_rotation")
    place = case.implants[0].hidden.place
    effects = propose(case.model, kinds=["joint_stiffness"])
    outcomes = [judge(case, said(case, [finding(effect)]))["outcome"] for effect in effects]
    there = [effect.joints == (place.joint,) and effect.direction == place.direction for effect in effects]
    assert there.count(True) == 1
    assert outcomes == ["right" if is_right else "wrong" for is_right in there]


def test_a_spring_across_a_member_is_one_to_the_ground_there():
    case = case_of("ground_spring")
    (implant,) = case.implants
    true, place = implant.hidden.values(implant.amplitude), implant.hidden.place
    (member,) = set(case.draft.frame.members) & set(place.words.split())
    axes = case.draft.frame.members[member].axes
    outcomes = []
    for effect in propose(case.model, kinds=["side_spring"]):
        if effect.member == member:
            along = abs(axes["xyz".index(effect.direction)]["xyz".index(place.direction)])
            at = np.clip(true["position"], *[(p.lower, p.upper) for p in effect.parameters()][1])
            near = abs(at - true["position"]) <= place.tolerance
            outcome = judge(case, said(case, [finding(effect, stiffness=true["stiffness"], position=at)]))
            assert outcome["outcome"] == ("right" if near and along > 0.99 else "wrong")
            outcomes.append(outcome["outcome"])
    assert set(outcomes) == {"right", "wrong"}


def test_nothing_hidden():
    case = draw_case(SETTINGS, "null", 0)
    effect = propose(case.model, kinds=["point_mass"])[0]
    assert judge(case, said(case, verdict="nothing missing"))["outcome"] == "right"
    assert judge(case, said(case, [finding(effect)]))["outcome"] == "wrong"
    assert judge(case, said(case, verdict="unexplained"))["outcome"] == "unexplained"


def test_faults_are_judged_by_sensor_and_kind():
    case = case_of("gain", "faults")
    (sensor,) = case.implants[0].hidden.place.sensors
    other = next(s.name for s in case.draft.sensors if s.name != sensor)

    def outcome(*faults, verdict="measurement fault"):
        made = [SimpleNamespace(kind=k, sensor=s, value=1.0) for k, s in faults]
        return judge(case, said(case, verdict=verdict, faults=made))["outcome"]

    assert outcome(("sensor_gain", sensor)) == "right"
    assert outcome(("sensor_sign", sensor)) == "twin"
    assert outcome(("sensor_gain", other)) == "wrong"
    assert outcome(("sensor_gain", sensor), ("sensor_gain", other)) == "beside"
    assert outcome(verdict="nothing missing") == "not noticed"


# -------------------------------------------------------------------------------------------- running


def fake(settings, task):
    return {
        "case": f"{task[0]}:{task[1]}",
        "set": task[0],
        "index": task[1],
        "hidden": [],
        "outcome": "right",
        "seconds": 1.0,
        "program": "abc",
        "db": {k: 0.1 for k in ("nominal", "fitted", "after", "floor")},
    }


def test_a_run_that_was_stopped_goes_on(tmp_path, monkeypatch):
    called = []
    monkeypatch.setattr(runner, "run_case", lambda s, t: called.append(t) or fake(s, t))
    tasks = runner.plan(2, 1, ["single", "null"])
    assert tasks == (("single", 0), ("null", 0), ("single", 1))
    runner.validate(SETTINGS, tasks[:2], tmp_path)
    steps = []
    records = runner.validate(SETTINGS, tasks, tmp_path, say=lambda r, step: steps.append(step))
    assert called == list(tasks)
    assert [r["case"] for r in records] == ["single:0", "null:0", "single:1"]
    assert [(step.done, step.total) for step in steps] == [(3, 3)]
    with pytest.raises(FolderError, match=r"other settings \(seed differs\)"):
        runner.validate(replace(SETTINGS, seed=4), tasks, tmp_path)


def test_a_case_that_fails_is_recorded_and_the_rest_go_on(tmp_path, monkeypatch):
    def broken(*_, **__):
        message = "no luck"
        raise ArithmeticError(message)

    monkeypatch.setattr(runner, "diagnose", broken)
    records = runner.validate(SETTINGS, [("null", 0), ("null", 1)], tmp_path)
    assert [r["outcome"] for r in records] == ["failed", "failed"]
    assert f'File "{Path("benchmarks", "validation", "run.py")}"' in records[0]["traceback"]
    assert "| null:1 |  | nothing | failed | ArithmeticError: no luck |" in as_markdown(records, "t")


def test_intervals_are_clopper_and_pearson():
    # With no hits in n the upper limit solves (1 - p)ⁿ = 0.025.
    assert Share(0, 24).interval == pytest.approx((0.0, 1 - 0.025 ** (1 / 24)))
    assert Share(300, 300).interval == pytest.approx((0.025 ** (1 / 300), 1.0))


def test_the_table_counts_sets_and_lists_what_is_not_right():
    records = [fake(None, ("single", i)) for i in range(3)]
    records[2] |= {"outcome": "wrong", "found": [{"kind": "crack", "where": "member A"}]}
    records[1] |= {"errors": [{"error": 0.01, "covered": True}, {"error": 0.03, "covered": False}]}
    records += [fake(None, ("null", 0))]
    text = as_markdown(records, "t")
    assert "| single | 3 | 2 of 3, 66.7 % (9.4-99.2) | 0 | 0 | 0 | 1 | 0 |" in text
    assert "| null | 1 | 1 of 1, 100.0 %" in text
    assert "median error 2 %; 95 % intervals hold 1 of 2" in text
    assert "of right cases: 3 of 3" in text
    assert "| single:2 |  | nothing | wrong | crack at member A |" in text
    assert "| single:1 |" not in text


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["--sets", "single,double"], "there is no set 'double'"),
        (["--case", "double:1"], "is not a case"),
        (["--cases", "0"], "from 1 to 1000000"),
    ],
)
def test_bad_arguments_are_refused_in_a_line(arguments, word, tmp_path, capsys):
    with pytest.raises(SystemExit, match="2"):
        main(["--seed", "1", "--out", str(tmp_path / "o"), *arguments])
    assert word in capsys.readouterr().err
    assert not (tmp_path / "o").exists()


def test_the_command_writes_its_table_and_refuses_a_folder_of_another_seed(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(runner, "run_case", fake)
    rest = ["--small", "--cases", "2", "--sets", "single,null", "--out", str(tmp_path)]
    assert main(["--seed", "3", *rest]) == 0
    assert "| single | 2 | 2 of 2, 100.0 %" in capsys.readouterr().out
    assert (tmp_path / "table.md").read_text().startswith("# Validation with seed 3")
    assert main(["--seed", "4", *rest]) == 2
    assert "other settings (seed differs)" in capsys.readouterr().err


@pytest.mark.slow
def test_small_cases_from_the_command_line(tmp_path):
    """Whole diagnoses in processes of their own: every case ends, none fails."""
    arguments = ["--seed", "5", "--small", "--cases", "1", "--processes", "2", "--sets", "single,null"]
    assert main([*arguments, "--out", str(tmp_path)]) == 0
    records = [json.loads(line) for line in (tmp_path / "cases.jsonl").read_text().splitlines()[1:]]
    assert len(records) == 2
    assert not [r["traceback"] for r in records if r["outcome"] == "failed"]


def test_sets_have_their_place_in_the_seed():
    """The order of the sets is part of what a seed means."""
    order = """
        single null withheld weak two faults connection connections mixed mounting modes frequencies
        states modes-null ambient ambient-null frf-states frf-states-null frequencies-null states-null
    """
    assert list(SETS) == order.split()
    assert all(KINDS[k].found_as for k in KINDS)


def test_a_soft_corner_goes_by_either_members_name_but_one_axis():
    case = draw_case(CaseSettings(911), "weak", 1)  # an arm on a post: its bending is the post's torsion
    place = case.implants[0].hidden.place
    assert place.turns == (("post", "rx"), ("arm", "rz"))
    alike = {e.name: same_place(e, case.model, place) for e in propose(case.model, ["end_release"])}
    assert alike == {
        "end_release:post.2.rx": True,
        "end_release:post.2.ry": False,
        "end_release:post.2.rz": False,
        "end_release:arm.1.rx": False,  # askew to the post's y and z
        "end_release:arm.1.ry": False,
    }
