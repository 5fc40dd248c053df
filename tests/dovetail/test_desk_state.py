"""The desk's state without a page: history, journal, jobs, saving."""

import asyncio
import errno
import json
import signal
import subprocess
import sys
import threading
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from docs.images.desk import with_two
from dovetail import OutputError, StudyError, load_study, main
from dovetail.desk import (
    MOST_STATES,
    VIEWS,
    Chosen,
    Desk,
    DeskState,
    History,
    Job,
    JournalError,
    Newest,
    Stair,
    figures,
    frequency_bars,
    journal_of,
    read_journal,
    save_study,
    write_journal,
)
from dovetail.file import MeasuredModes
from dovetail.plan import plan_study
from dovetail.report import planning
from fem import Modes
from tests.frames import write_study
from tests.studies import cross_beam_below_1600_hz, fit_problem
from updating import Fault, MeasurementError, assessed_fit, sensor_rows
from updating.diagnosis import damped_modes
from updating.live import Hypothesis, LiveModel

TURNING, MASS = "joint_stiffness:J.rx", "point_mass:U"


@pytest.fixture
def supposed(live, candidates):
    h = Hypothesis.nominal(live.problem).with_effect(candidates[TURNING]).with_effect(candidates[MASS])
    h = h.with_value(TURNING, "stiffness", 200.0).with_value(MASS, "mass", 0.05)
    h = h.with_value(MASS, "position", 0.123).with_fault(Fault("sensor_gain", "D3z", 1.1, 0.0))
    return h.with_fault(Fault("sensor_sign", "U3z", -1.0, 0.0)).switched("U5z").held("sensor U7z")


def test_everything_can_be_undone_and_done_again(live, supposed):
    start = DeskState("open", Hypothesis.nominal(live.problem), (Stair("nominal model", 6.0, 7.0),))
    history = History((start,)).then(start.moved("add", supposed))
    history = history.then(history.now.kept())
    assert history.undone().undone().now is start
    assert history.undone().undone().undone().now is start
    assert history.undone().redone().now is history.now
    assert (history.undoes, history.undone().redoes) == (history.now.label, history.now.label)
    other = history.undone().then(start)
    assert other.redoes == ""  # what was undone is gone
    assert len(other.states) == 3


def test_two_hypotheses_are_exchanged_and_dropped(live, supposed):
    nominal = Hypothesis.nominal(live.problem)
    state = DeskState("open", nominal, ()).kept().moved("add", supposed)
    assert (state.hypothesis, state.other) == (supposed, nominal)
    assert (state.swapped().hypothesis, state.swapped().other) == (nominal, supposed)
    assert state.alone().other is None
    assert state.alone().swapped().hypothesis is supposed


def test_the_history_has_an_end(live):
    state = DeskState("open", Hypothesis.nominal(live.problem), ())
    history = History((state,))
    for _ in range(MOST_STATES + 5):
        history = history.then(state)
    assert len(history.states) == MOST_STATES
    assert history.at == MOST_STATES - 1


def test_a_journal_brings_the_desk_back(tmp_path, live, candidates, supposed):
    start = DeskState("open <b>\"'", Hypothesis.nominal(live.problem), (Stair("nominal model", 6.0, 7.0),))
    history = History((start,)).then(start.moved("add", supposed)).then(start.kept()).undone()
    write_journal(tmp_path / "j", history, "text")
    back = read_journal(tmp_path / "j", "text", candidates)
    assert (back.at, [s.label for s in back.states]) == (1, [s.label for s in history.states])
    assert back.states[0].stairs == start.stairs
    one, two = live.evaluate(back.now.hypothesis), live.evaluate(supposed)
    np.testing.assert_array_equal(one.frf.H, two.frf.H)
    np.testing.assert_array_equal(one.mask, two.mask)
    assert back.now.hypothesis.faults == supposed.faults
    assert back.states[2].other is not None


def test_a_journal_of_another_study_is_refused(tmp_path, live, candidates):
    path = journal_of(tmp_path / "a.toml")
    assert path == tmp_path / ".a.desk.json"
    write_journal(path, History((DeskState("open", Hypothesis.nominal(live.problem), ()),)), "text")
    with pytest.raises(JournalError, match="the study has changed"):
        read_journal(path, "other text", candidates)
    for text in ("", "{}", "[1]", json.dumps({"schema": "dovetail-desk/1", "study": 1})):
        path.write_text(text)
        with pytest.raises(JournalError):
            read_journal(path, "text", candidates)


def damaged(h, change):
    """Return a hypothesis that a journal may hold after damage to its file."""
    return {
        "kind": replace(h, faults=(Fault("steel", "U3z", 1.0, 0.0),)),
        "value": replace(h, faults=(Fault("sensor_gain", "U3z", np.nan, 0.0),)),
        "missing": replace(h, values=dict(list(h.values.items())[1:])),
        "other": replace(h, values={**h.values, ("frame", "E:gold"): 1.0}),
        "zeta": replace(h, zeta=h.zeta[1:]),
    }[change]


@pytest.mark.parametrize("change", ["kind", "value", "missing", "other", "zeta"])
@pytest.mark.parametrize("at", [0, 1])
def test_a_journal_with_parameters_of_no_model_is_set_aside(tmp_path, study, live, supposed, change, at):
    first = DeskState("open", Hypothesis.nominal(live.problem), ())
    desk = Desk(study, live, History((first,)), tmp_path / "j.json")
    states = [first, first.moved("add", supposed)]
    states[1 - at] = states[1 - at].moved("add", damaged(states[1 - at].hypothesis, change))
    write_journal(tmp_path / "j.json", History(tuple(states), at), study.text)
    desk._go_on()
    assert desk.now is first
    assert "it is kept as j.old.json" in desk.notes[-1]
    assert (tmp_path / "j.old.json").is_file()


@pytest.mark.parametrize("name", [TURNING, MASS])
def test_compare_prints_the_error_of_a_saved_study(tmp_path, study, live, supposed, name):
    h = supposed if name == MASS else Hypothesis.nominal(live.problem).with_effect(supposed.effect(name))
    save_study(study, live, h, tmp_path / "found.toml")
    assert main(["compare", str(tmp_path / "found.toml"), "--quiet", "--json", str(tmp_path / "c.json")]) == 0
    printed = json.loads((tmp_path / "c.json").read_text())
    shown = live.evaluate(h)
    # the bases of the two differ, as one knows the effect beforehand: 1e-4 of the error
    assert printed["error_db"] == pytest.approx(shown.result.fit_db, rel=2e-4)
    assert printed["held_out_db"] == pytest.approx(shown.result.held_out_db, rel=2e-4)
    assert printed["all_lines_db"] == pytest.approx(shown.comparison.total_db, rel=2e-4)
    assert printed["noise_db"] == pytest.approx(shown.noise_db, rel=1e-9)


def test_saving_spares_what_the_study_reads(study, live):
    with pytest.raises(OutputError, match="the study itself"):
        save_study(study, live, Hypothesis.nominal(live.problem), study.path)


def test_a_job_tells_its_progress_and_ends_when_asked():
    begun, go_on = threading.Event(), threading.Event()

    def work(progress):
        progress("half", 0.5)
        begun.set()
        go_on.wait(10)
        progress("more", 0.6)
        return "done"

    job = Job("work", work).start()
    assert begun.wait(10)
    assert (job.text, job.fraction, job.done) == ("half", 0.5, False)
    assert job.remaining is None or job.remaining < 10
    assert not job.ending
    job.cancel()
    assert job.ending
    go_on.set()
    assert job.wait(10)
    assert job.cancelled
    assert job.result is None
    whole = Job("work", lambda progress: "done").start()
    assert whole.wait(10)
    assert (whole.result, whole.error) == ("done", None)


@pytest.mark.slow
@pytest.mark.parametrize("noise", [None, 0.01])
def test_a_map_ends_within_two_seconds_when_asked(root, noise):
    desk = Desk.open(root / "examples" / "first-frame" / "study.toml")
    job = desk.plan(noise)
    while job.fraction < 0.12:
        assert not job.wait(0.05)
    job.cancel()
    assert job.wait(2.0)
    assert job.cancelled
    assert job.result is None


def test_the_map_is_that_of_the_command_for_the_hypothesis(tmp_path):
    """Nothing changed: that of the study. With an effect at hand: that of the study when it is saved."""
    study = load_study(write_study(tmp_path, mass=0.25))
    desk, maps = Desk.open(study.path), []
    for noise in (0.003, None):
        job = desk.plan(noise)
        assert job.wait(60)
        maps.append(job.result[1])
        assert planning.kind_rows(maps[-1]) == planning.kind_rows(plan_study(study, noise))
    assert [plan.is_measured for plan in maps] == [False, True]
    desk.add("point_mass:arm", mass=0.25, position=0.3)
    job = desk.plan()
    assert job.wait(60)
    h, plan = job.result
    assert h is desk.now.hypothesis
    saved = load_study(save_study(study, desk.live, h, tmp_path / "saved.toml"))
    assert planning.kind_rows(plan) == planning.kind_rows(plan_study(saved))
    masses = [each.sizes_of("seen")[0]["least"].mass for each in (maps[1], plan)]
    assert masses[1] < 0.7 * masses[0]  # the residuals are hardly more than noise with the mass


def test_an_error_of_a_job_is_kept():
    job = Job("work", lambda progress: 1 / 0).start()
    assert job.wait(10)
    assert isinstance(job.error, ZeroDivisionError)
    assert not job.cancelled


def test_of_many_values_the_newest_wins():
    done = []

    async def work(value):
        await asyncio.sleep(0.01)
        done.append(value)

    async def drag():
        newest = Newest(work)
        for value in range(5):
            newest.put(value)
            await asyncio.sleep(0)
        await newest.settled()
        newest.put(9)
        await newest.settled()

    asyncio.run(drag())
    assert done == [0, 4, 9]


# The desk without a page ------------------------------------------------------------------------------------


@pytest.fixture
def desk(study, live):
    start = Hypothesis.nominal(live.problem)
    first = DeskState("open the study", start, (Stair.of("nominal model", live.evaluate(start)),))
    return Desk(study, live, History((first,)))


def test_the_loop_by_hand(desk):
    nominal = desk.shown.result.fit_db
    job = desk.fit_uncertain()
    assert job.wait(60)
    desk.take_fit(job)
    fitted = desk.shown.result.fit_db
    desk.add(TURNING)
    moved = desk.preview(TURNING, "stiffness", 200.0).result.fit_db
    assert moved < fitted < nominal
    assert desk.now.hypothesis.effect(TURNING).stiffness == pytest.approx(2980.0)  # a preview is no state
    desk.set_value(TURNING, "stiffness", 200.0)
    job = desk.fit_uncertain()
    assert job.wait(60)
    desk.take_fit(job)
    assert desk.shown.result.fit_db < 1.0
    assert [s.fit_db for s in desk.now.stairs] == pytest.approx([nominal, fitted, desk.shown.result.fit_db])
    for _ in range(4):
        desk.undo()
    assert (desk.shown.result.fit_db, desk.history.undoes) == (nominal, "")
    desk.redo()
    # The basis has learnt the joint: it changes what was there by less than a thousandth of a decibel.
    assert desk.shown.result.fit_db == pytest.approx(fitted, abs=1e-3)


def test_sensors_and_hypotheses_are_states_too(desk):
    desk.switch("D3z")
    desk.turn("U1z")
    desk.set_gain("U2z", 1.2)
    h = desk.now.hypothesis
    assert (h.off, {(f.kind, f.value) for f in h.faults}) == (
        {"D3z"},
        {("sensor_sign", -1.0), ("sensor_gain", 1.2)},
    )
    desk.set_gain("U2z", 1.0)
    desk.turn("U1z")
    desk.switch("D3z")
    assert (desk.now.hypothesis.off, desk.now.hypothesis.faults) == (frozenset(), ())
    desk.keep()
    desk.add(MASS, mass=0.1)
    assert desk.second().result.fit_db == desk.nominal.result.fit_db
    assert desk.second() is desk.second()
    desk.swap()
    assert desk.now.hypothesis.effects == ()
    desk.drop()
    assert desk.second() is None


def test_actions_name_effects_in_the_words_of_the_page(desk):
    other = desk.candidates[TURNING]
    desk.add(MASS, mass=0.1)
    desk.set_value(MASS, "position", 0.1)
    desk.replace(MASS, other)
    desk.remove(TURNING)
    assert [s.label for s in desk.history.states[1:]] == [
        "add point mass: member U at 0.400 m",
        "position of point mass: member U at 0.100 m",
        "joint stiffness: joint J, about x in place of point mass: member U at 0.100 m",
        "remove joint stiffness: joint J, about x",
    ]


def test_a_value_that_changes_nothing_and_a_gain_that_is_none_make_no_state(desk):
    desk.add(MASS, mass=0.1)
    bounds = {p.name: p.upper for p in desk.now.hypothesis.effect(MASS).parameters()}
    desk.set_value(MASS, "position", 2 * bounds["position"])  # beyond its bound, which is taken
    there = desk.history
    assert desk.now.hypothesis.effect(MASS).position == bounds["position"]
    desk.set_value(MASS, "position", 3 * bounds["position"])
    for gain in (0.0, -1.2, float("nan")):
        with pytest.raises(ValueError, match="must be above 0"):
            desk.set_gain("U2z", gain)
    assert desk.history is there


def test_a_channel_is_held_out_and_one_stays(desk, tmp_path):
    before = desk.shown.result.fit_db
    desk.hold_out("sensor D3z")
    assert desk.shown.held_out is not None
    assert desk.shown.result.fit_db != before
    assert desk.now.label == "hold out sensor D3z"
    assert load_study(desk.save(tmp_path / "held.toml")).held_out_sensors == ("D3z",)
    desk.hold_out("excitation D3z")  # a sensor and an excitation of one name
    with pytest.raises(StudyError, match="every measured excitation"):
        desk.hold_out("excitation U1z")
    desk.undo()
    desk.hold_out("sensor D3z")
    assert desk.now.label == "fit sensor D3z"
    assert desk.shown.result.fit_db == before


def test_a_band_is_held_out_and_written(desk, tmp_path):
    before = desk.shown.result
    desk.hold_out("band 100-250 Hz")
    shown = desk.shown.result
    assert (shown.fit_db, shown.held_out_db) != (before.fit_db, before.held_out_db)
    assert [(s.x0, s.x1) for s in figures.frf(desk, ("U1z", "U1z"), 400).layout.shapes] == [
        pytest.approx((100.0, 250.0), abs=desk.shown.frf.frequency[1] - desk.shown.frf.frequency[0])
    ]
    path = desk.save(tmp_path / "held.toml")
    assert load_study(path).held_out_bands == ((100.0, 250.0),)
    assert main(["compare", str(path), "--quiet", "--json", str(tmp_path / "c.json")]) == 0
    printed = json.loads((tmp_path / "c.json").read_text())
    assert printed["error_db"] == pytest.approx(shown.fit_db, rel=1e-9)
    assert printed["held_out_db"] == pytest.approx(shown.held_out_db, rel=1e-9)
    for band, said in (("band 0-5000 Hz", "every line"), ("band 5000-6000 Hz", "no line lies in")):
        with pytest.raises(MeasurementError, match=said):
            desk.hold_out(band)
    desk.hold_out("band 100-250 Hz")
    assert desk.now.label == "fit band 100-250 Hz"
    assert desk.shown.result.held_out_db == before.held_out_db


@pytest.mark.parametrize("name", VIEWS)
def test_a_view_that_follows_a_slider_is_the_one_that_is_drawn_after_it(desk, name):
    view, chosen = VIEWS[name], Chosen(("U3z", "D3z"), True, (60.0, 90.0))
    desk.add(MASS, mass=0.1)
    before = view.draw(desk, chosen)
    frames, traces = view.moved(before, desk.preview(MASS, "mass", 0.2), chosen)
    after = view.draw(desk, chosen)
    assert len(traces) == {"Amplitude and phase": 2, "CMIF": 2, "Sensitivity": 0}.get(name, 1)
    for k, trace in enumerate(after.data):
        moved = frames[traces.index(k)] if k in traces else {}
        was = before.data[k]
        for key in ("x", "y"):
            drawn, shown = (np.asarray(v, dtype=float) for v in (trace[key], moved.get(key, was[key])))
            if name != "Sensitivity":
                np.testing.assert_allclose(shown, drawn, atol=0.051 if name != "FRAC" else 1e-4)
    if name == "Nyquist":
        assert [t.x.size for t in after.data] == [16, 16, 16]  # lines of the band, 2 Hz apart
    scale = after.layout.xaxis.type
    assert (scale == "log") == view.over_frequency


def test_views_leave_out_what_amplitudes_do_not_tell():
    assert {n for n, v in VIEWS.items() if not v.needs_phase} == {"Amplitude and phase", "Sensitivity"}


def as_if_measured(desk, modes):
    """Return computed modes as measured ones at the sensors, with a frequency that is 2 % higher."""
    sensors = desk.live.problem.data.measurement.sensors
    shapes = sensor_rows(desk.study.model, sensors) @ modes.shapes[:, modes.n_rigid :]
    f, zeta = 1.02 * modes.frequency[modes.n_rigid :], modes.zeta[modes.n_rigid :]
    n = np.ones(len(f))
    names = tuple(s.name for s in sensors)
    return MeasuredModes(Modes(f, -3.0 * shapes, zeta, labels=names), sensors, 1e-3 * n, 0.01 * n, "test")


def test_modes_of_the_model_itself_have_a_mac_of_one(desk):
    h = desk.now.hypothesis
    modes = damped_modes(desk.study.model, desk.live.problem.damping, h.zeta, 300.0)
    desk.study = replace(desk.study, modes=as_if_measured(desk, modes))
    job = desk.compare_modes()
    assert job.wait(60)
    found = desk.compared_modes = job.result
    assert found.hypothesis is h
    elastic = modes.n_modes - modes.n_rigid
    seen = [k for k in range(elastic) if np.linalg.norm(found.measured.modes.shapes[:, k]) > 1e-3]
    assert len(seen) >= 4
    for k in seen:
        assert found.mac[k, k] == pytest.approx(1.0, abs=1e-9)
        row = figures.mode_rows(found)[k]
        if found.partner.get(k) == k:
            assert (row["mode"], row["Δf [%]"], row["MAC"], row["partner"]) == (k + 1, "-1.96", "1.000", k)
    assert found.identified is None
    assert {row["sensor"] for row in figures.comac_rows(found)} == {s.name for s in found.measured.sensors}
    assert {row["CoMAC"] for row in figures.comac_rows(found)} == {"1.000"}
    figure = figures.shapes_figure(found, seen[0], seen[0])
    assert len(figure.frames) == 7
    tips = [t for t in figure.data if t.meta and t.meta.get("moves") in ("measured", "computed")]
    measured, computed = (np.array([t.x, t.y, t.z]).T.reshape(-1, 3, 3)[:, 1] for t in tips)
    np.testing.assert_allclose(measured, computed, atol=1e-6)  # scaled to the mode, and alike
    (bars,) = frequency_bars(desk, found, seen[0]).data
    assert list(bars.x) == sorted(bars.x, reverse=True)
    assert any("frame.rho:steel: -0.25 %" in text for text in bars.hovertext)  # half of 0.5 %, all mass moves
    desk.add(MASS, mass=0.1)
    again = desk.compare_modes()
    assert again.wait(60)
    assert again.result.measured is found.measured  # not identified again
    assert again.result.frequencies()[1][0] < found.frequencies()[1][0]


def test_a_click_finds_its_spot(desk):
    joint = desk.spots["joint J"]
    assert "joint J on its second side (as a point)" in joint.places
    assert desk.spot_of(TURNING) == desk.spot_of("J") == "joint J"
    assert desk.spot_of("U") == "member U"
    assert desk.spot_of("nothing") == ""
    assert desk.spot_near(np.add(joint.point, [0.0, 0.005, 0.0])) == "joint J"
    assert desk.spot_near([0.0, 0.0, 5.0]) == ""
    every = [n for s in desk.spots.values() for names in s.places.values() for n in names]
    assert sorted(every) == sorted(desk.candidates)


def test_candidates_that_act_at_several_points_have_no_mark(desk):
    """Their middle is beside the structure, such as that of the section of both beams."""
    (marks,) = (t.customdata for t in figures.model(desk, "", 400.0).data if t.name == "candidates")
    assert {"joint J", "member U", "member D"} <= {*marks}
    between = "section of member U, D"
    assert between in desk.spots.keys() - {*marks}
    assert desk.study.model.mesh.nearest_on_members(desk.spots[between].point)[2] > 0.02


def test_a_click_means_the_nearest_mark():
    def mark(name, off, depth, x=0.0):
        return {"name": name, "off": off, "depth": depth, "point": [x, 0.0, 0.0]}

    beam = {"name": "U", "point": [0.0, 0.0, 0.0], "depth": 0.5}
    joint, above, beyond = mark("joint J", 3.0, 0.51), mark("D3z", 6.9, 0.4), mark("U1z", 2.0, 0.9, 5.0)
    assert figures.nearest_mark([above, joint, beyond], beam, 0.1) is joint  # one is farther, one hidden
    front = mark("U5z", 5.0, 0.3)
    assert figures.nearest_mark([joint, front], beam, 0.1) is front  # over each other: the foremost
    assert figures.nearest_mark([joint, front], beam, 0.1, {"joint J"}) is joint  # but the joint wins
    aside = {**joint, "off": 9.0}
    assert figures.nearest_mark([aside, front], beam, 0.1, {"joint J"}) is front  # the click is not on it
    assert figures.nearest_mark([mark("far", 40.0, 0.1)], beam, 0.1) is None


def test_a_full_disk_is_told_and_the_desk_goes_on(desk, tmp_path, monkeypatch):
    desk._journal = tmp_path / "journal.json"
    desk.add(MASS, mass=0.1)
    before = desk._journal.read_bytes()

    def full(*_, **__):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "write_text", full)
    desk.add(TURNING)
    assert [e.name for e in desk.now.hypothesis.effects] == [MASS, TURNING]
    assert "No space left on device" in desk.notes[-1]
    assert desk._journal.read_bytes() == before
    with pytest.raises(OSError, match="No space left"):
        desk.save(tmp_path / "saved.toml")
    assert [p.name for p in tmp_path.iterdir() if p.suffix in (".json", ".toml")] == ["journal.json"]


KILLED = """
import os, signal, sys
from pathlib import Path
from dovetail.desk.session import Desk

def killed(path, text, **more):
    with path.open("w", encoding="utf-8") as file:
        file.write(text[: len(text) // 2])
        file.flush()
        os.kill(os.getpid(), signal.SIGKILL)

desk = Desk.open(Path(sys.argv[1]))
desk.add("point_mass:U", mass=0.1)
Path.write_text = killed
desk.switch("D3z")
"""


def test_a_desk_killed_while_it_saves_opens_one_state_earlier(tmp_path):
    here = cross_beam_below_1600_hz(tmp_path)
    done = subprocess.run([sys.executable, "-c", KILLED, str(here)], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (-signal.SIGKILL, "")
    assert Desk.open(here).history.undoes == "add point mass: member U at 0.400 m"


def test_the_staircase_and_jobs_name_effects_in_words(desk):
    desk.add(TURNING, stiffness=200.0)
    job = desk.fit_this(TURNING)
    assert job.wait(60)
    assert (job.title, job.text) == (
        "Fit joint stiffness: joint J, about x",
        "fitting joint stiffness at joint J, rx",
    )
    desk.take_fit(job)
    assert desk.now.stairs[-1].label == "joint stiffness: joint J, about x, fitted"
    shown = figures.staircase(desk).layout.xaxis.ticktext[-1].replace("<br>", " ")
    assert shown == desk.now.stairs[-1].label


def test_a_cancelled_job_gives_nothing():
    begun, go_on = threading.Event(), threading.Event()

    def work(progress):
        begun.set()
        go_on.wait(10)
        return "done"

    job = Job("work", work).start()
    assert begun.wait(10)
    job.cancel()
    go_on.set()
    assert job.wait(10)
    assert (job.cancelled, job.result) == (True, None)


def test_a_diagnosis_is_taken_over(desk):
    found = desk.candidates[TURNING].with_values(stiffness=190.0)
    h = desk.now.hypothesis
    values = {("frame", "E:steel"): 2.1e11}
    last = SimpleNamespace(values=values, zeta=h.zeta * 1.1, channels=h.channels)
    desk.diagnosis = SimpleNamespace(
        findings=[SimpleNamespace(effect=found), SimpleNamespace(effect=SimpleNamespace(name="patch"))],
        faults=(Fault("sensor_sign", "U1z", -1.0, 0.0),),
        steps=[SimpleNamespace(result=last)],
    )
    desk.add(MASS, mass=0.1)  # in place of what was tried by hand
    assert desk.take_over() == ("patch",)
    h = desk.now.hypothesis
    assert [e.name for e in h.effects] == [TURNING]
    assert h.effect(TURNING).stiffness == pytest.approx(190.0)
    assert h.values["frame", "E:steel"] == 2.1e11
    assert [f.sensor for f in h.faults] == ["U1z"]
    np.testing.assert_array_equal(h.zeta, last.zeta)


def test_taking_over_brings_the_error_of_the_diagnosis(desk, tmp_path):
    problem = desk.live.formed  # a diagnosis fits the form of the frame, too
    fit = assessed_fit(
        problem, [desk.candidates[TURNING]], [{"stiffness": 200.0}], stages=problem.stages[-1:], n_lines=40,
        max_iterations=4,
    )  # fmt: skip
    form = [abs(v) for (name, _), v in fit.values.items() if name in {e.name for e in desk.live.form}]
    assert max(form) > 1e-3
    desk.diagnosis = SimpleNamespace(
        findings=[SimpleNamespace(effect=fit.effects[0])], faults=(), steps=[SimpleNamespace(result=fit)]
    )
    assert desk.take_over() == ()
    shown, own = desk.shown.result, desk.live.formed.assessed(fit)  # on the basis that has its responses
    assert (shown.fit_db, shown.held_out_db) == pytest.approx((own.fit_db, own.held_out_db), rel=1e-4)
    assert shown.fit_db == pytest.approx(fit.fit_db, abs=0.03)
    assert desk.now.stairs[-1].fit_db == shown.fit_db
    path = desk.save(tmp_path / "taken.toml")
    assert main(["compare", str(path), "--quiet", "--json", str(tmp_path / "c.json")]) == 0
    # The desk's basis has the modes of nominal sections: where shear gives way otherwise, it errs by 0.01 dB.
    assert json.loads((tmp_path / "c.json").read_text())["error_db"] == pytest.approx(shown.fit_db, abs=0.015)
    write_journal(tmp_path / "j.json", desk.history, "text")
    again = read_journal(tmp_path / "j.json", "text", desk.candidates).now.hypothesis
    assert desk.live.evaluate(again).result.fit_db == shown.fit_db
    desk.vary_form(on=False)
    assert desk.shown.result.fit_db > shown.fit_db + 0.01
    desk.undo()
    assert desk.shown.result.fit_db == shown.fit_db


def test_a_desk_that_was_killed_opens_where_it_was(tmp_path):
    here = cross_beam_below_1600_hz(tmp_path)
    one = Desk.open(here)
    one.add(MASS, mass=0.1)
    one.switch("D3z")
    one.undo()
    again = Desk.open(here)
    assert again.shown.result.fit_db == one.shown.result.fit_db
    assert (again.history.undoes, again.history.redoes) == (
        "add point mass: member U at 0.400 m",
        "leave out sensor D3z",
    )
    here.write_text(here.read_text(encoding="utf-8") + "\n# changed\n", encoding="utf-8")
    fresh = Desk.open(here)
    assert fresh.history.undoes == ""
    assert "the study has changed" in fresh.notes[0]
    assert (tmp_path / ".study.desk.old.json").exists()


@pytest.mark.slow
def test_two_hidden_effects_are_found_by_hand(study):
    """The case of docs/desk.md."""
    study = with_two(study)
    live = LiveModel(fit_problem(study))
    start = Hypothesis.nominal(live.problem)
    desk = Desk(study, live, History((DeskState("open the study", start, ()),)))
    errors = [desk.shown.result.fit_db]

    def fitted(job):
        assert job.wait(200)
        desk.take_fit(job)

    for action in (
        lambda: fitted(desk.fit_uncertain()),
        lambda: desk.add(TURNING, stiffness=400.0),
        lambda: desk.add(MASS, mass=0.05, position=0.6),
        lambda: desk.set_value(MASS, "mass", 0.1),
        lambda: fitted(desk.fit_all()),
    ):
        action()
        errors.append(desk.shown.result.fit_db)
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] < 2 * desk.shown.noise_db
    found = desk.now.hypothesis
    assert found.effect(TURNING).stiffness == pytest.approx(400.0, rel=0.03)
    assert found.effect(MASS).mass == pytest.approx(0.12, rel=0.03)
    assert found.effect(MASS).position == pytest.approx(0.62, abs=0.005)
