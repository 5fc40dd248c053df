"""The map of what a test sees, as a study asks for it and as commands, notebooks and reports show it."""

import json
import re
from collections import Counter
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image

import viz.plan
from dovetail import StudyError, load_study, main, pipeline
from dovetail.plan import check_plan, plan_study
from dovetail.report import Album, Figures, Shown, join, packed, planning, sizes
from dovetail.report.page import page
from dovetail.report.sections import missing
from dovetail.result import excluded_dict
from fem import ModelError, Relevant
from tests.dovetail.test_report_live import CHROMIUM, drawn, opened
from tests.frames import MAST, STUDY, write_study
from tests.studies import study_file
from updating.plan import ChosenChannels
from viz import render_plan, style
from viz.interactive.plan import BLIND


def written(folder, more="", text=STUDY):
    return study_file(folder, text + more)


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    """Return a study in whose measured FRFs nothing is missing."""
    return write_study(tmp_path_factory.mktemp("sound"), mass=0.0)


@pytest.fixture(scope="module")
def planned(tmp_path_factory):
    return plan_study(load_study(written(tmp_path_factory.mktemp("planned"))), 0.003)


@pytest.fixture(scope="module")
def sound(file):
    """Return the study and its diagnosis."""
    study = load_study(file)
    return study, pipeline.diagnose_study(study, budget="quick")


# The study file -------------------------------------------------------------------------------------------


def test_relevant_sizes_have_defaults(tmp_path):
    assert load_study(written(tmp_path)).relevant == Relevant()


def test_relevant_sizes_are_read(tmp_path):
    text = "\n[relevant]\nconnections = 0.5\nmembers = 0.05\ncracks = 0.4\nmasses = 0.01\n"
    assert load_study(written(tmp_path, text)).relevant == Relevant(0.5, 0.05, 0.4, 0.01)


def test_a_relevant_size_that_is_not_given_is_the_usual_one(tmp_path):
    read = load_study(written(tmp_path, "\n[relevant]\nmasses = 0.1\n")).relevant
    assert read == replace(Relevant(), masses=0.1)


@pytest.mark.parametrize("key", ["connections", "members", "cracks", "masses"])
@pytest.mark.parametrize("value", ["0", "0.0", "1", "1.5", "-0.1", "'much'", "true", "inf", "nan"])
def test_a_relevant_size_beyond_a_share_is_refused_by_its_key(tmp_path, key, value):
    with pytest.raises(StudyError, match=rf"relevant.*{key}|{key}.*relevant"):
        load_study(written(tmp_path, f"\n[relevant]\n{key} = {value}\n"))


def test_an_unknown_relevant_size_is_refused_by_its_key(tmp_path):
    with pytest.raises(StudyError, match=r"relevant\.crack: unknown key; did you mean 'cracks'"):
        load_study(written(tmp_path, "\n[relevant]\ncrack = 0.3\n"))


# Study.plan -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("noise", ["1%", 1, 0.0, float("nan")])
def test_a_noise_that_is_no_share_is_refused(file, noise):
    with pytest.raises(StudyError, match=r"such as 0\.01 for 1 %"):
        load_study(file).plan(noise)


def test_a_study_without_measured_data_is_planned(planned):
    assert not planned.is_measured
    assert [s.name for s in planned.measurement.sensors] == ["P", "K", "T", "A"]
    assert {o.relevant.kind for o in planned.relevant} == {"point_mass", "member_stiffness"}


def test_a_study_with_data_is_judged_by_them_unless_noise_is_given(file):
    study = load_study(file)
    study = replace(study, relevant=replace(study.relevant, masses=0.2))
    by_data, by_plan = plan_study(study), plan_study(study, 0.003)
    assert by_data.sizes == by_plan.sizes == study.relevant
    assert (by_data.is_measured, by_plan.is_measured) == (True, False)
    # held-out channels are none that the data are judged by
    assert [s.name for s in by_data.measurement.sensors] == ["K", "T", "A"]
    np.testing.assert_array_equal(by_plan.measurement.frf.frequency, study.measurements[0].frf.frequency)


def test_a_plan_may_be_limited_to_a_kind(file):
    study = load_study(file)
    found = study.plan(noise=0.01, left_db=0.1, kinds="point_mass")
    assert {o.relevant.kind for o in found.plan.relevant} == {"point_mass"}
    with pytest.raises(ModelError, match="no kind of effect 'point_maas'; did you mean 'point_mass'"):
        study.plan(kinds=["point_maas"])


def test_sensors_are_added_and_chosen_from_python_as_by_the_command(file, tmp_path):
    study, out = load_study(file), tmp_path / "plan.json"
    how = {"noise": 0.01, "left_db": 0.1}
    added = study.plan(**how, add=1)
    words = ["--noise", "1%", "--left", "0.1", "--add", "1", "--json", str(out)]
    assert main(["plan", str(file), *words]) == 0
    (sensor,) = json.loads(out.read_text())["chosen"]["sensors"]
    assert added.chosen is not None
    assert [s.name for s in added.chosen.sensors] == [sensor["name"]]
    assert len(added.plan.measurement.sensors) == len(study.sensors) + 1
    chosen = study.plan(**how, choose=2, excitations=1).plan.measurement
    assert (len(chosen.sensors), len(chosen.excitations)) == (2, 1)
    with pytest.raises(StudyError, match="give one of them"):
        study.plan(add=1, choose=2)
    with pytest.raises(StudyError, match="choose gives the number of sensors"):
        study.plan(excitations=2)


def test_relevant_sizes_of_the_study_are_those_of_its_plan(tmp_path):
    study = load_study(written(tmp_path, "\n[relevant]\nmasses = 0.1\n"))
    plan = plan_study(study, 0.003)
    total = 7850 * 0.03 * 0.012 * 0.9
    masses = [o.relevant.mass for o in plan.relevant if o.relevant.kind == "point_mass"]
    assert masses == pytest.approx([0.1 * total] * 26)


def test_what_a_right_model_leaves_is_given_in_decibels(tmp_path):
    study = load_study(written(tmp_path))
    assert planning.plan_dict(plan_study(study, 0.003, 1.5))["left_db"] == pytest.approx(1.5)


def test_a_notebook_shows_shares_rows_and_pairs(file):
    shown = load_study(file).plan(0.003)
    assert planning.headline(shown.plan) in repr(shown)
    assert "\n" not in repr(shown)
    assert shown.coverage("seen") >= shown.coverage("located") >= shown.coverage()
    assert [row.kind for row in shown.rows] == ["point mass", "member stiffness"]
    assert shown.twins == [planning.twin_text(*pair) for pair in shown.plan.twins]
    html = shown._repr_html_()
    assert "<table" in html
    assert all(cell in html for cell in planning.table_of_kinds(shown.rows).texts()[0])


# The command ----------------------------------------------------------------------------------------------

KEYS = """
    study measured explained noise_db left_db relevant_sizes coverage kinds effects warnings mesh_notes
    measured_notes assumptions
"""


def test_the_command_prints_rows_of_kinds_and_writes_all_effects(file, tmp_path, capsys):
    out = tmp_path / "plan.json"
    assert main(["plan", str(file), "--noise", "0.003", "--json", str(out)]) == 0
    printed = capsys.readouterr().out
    data = json.loads(out.read_text(encoding="utf-8"))
    assert set(data) == set(KEYS.split())
    assert data["relevant_sizes"] == {"connections": 0.3, "members": 0.1, "cracks": 0.25, "masses": 0.02}
    assert data["coverage"].keys() == {"seen", "located", "named"}
    for share, word in zip(data["coverage"].values(), ("are seen", "located", "named"), strict=True):
        assert f"{100 * share:.0f} % {word}" in printed
    for row in data["kinds"]:
        assert re.search(rf"^{row['kind']}  .*{re.escape(row['relevant'])}  +{row['n']} ", printed, re.M)
        kind = row["kind"].replace(" ", "_")
        shown = Counter(e["shown"] for e in data["effects"] if e["kind"] == kind)
        assert row["named"] == pytest.approx(shown["named"] / row["n"])
        assert row["seen"] == pytest.approx(1 - shown["not seen"] / row["n"])
    assert sum(row["n"] for row in data["kinds"]) == len(data["effects"]) == 28
    for effect in data["effects"]:
        assert set(effect) == set(
            ["kind", "where", "relevant", "shown", "seen", "located", "named", "rival", "alike"]
        )
        if effect["kind"] == "point_mass" and effect["seen"] and effect["named"]:
            assert effect["seen"]["mass"]["unit"] == "kg"
            assert effect["seen"]["mass"]["value"] <= effect["named"]["mass"]["value"]


@pytest.mark.slow
def test_json_of_an_example_goes_to_standard_output(root, capsys):
    study = root / "examples" / "first-frame" / "study.toml"
    assert main(["plan", str(study), "--noise", "0.01", "--json", "-"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert set(data) == set(KEYS.split())
    assert not data["measured"]
    assert {"crack", "support flexibility", "support flexibility, rotation"} <= {
        r["kind"] for r in data["kinds"]
    }


def test_json_on_standard_output_is_alone(file, capsys):
    assert main(["plan", str(file), "--noise", "0.003", "--json", "-"]) == 0
    assert set(json.loads(capsys.readouterr().out)) == set(KEYS.split())


@pytest.mark.parametrize("part", ["sensors", "excitations"])
def test_a_study_without_channels_is_refused_in_one_line(tmp_path, capsys, part):
    text = MAST
    if part == "excitations":
        text += '\n[[sensors]]\npoint = "tip"\nname = "T"\ndirection = "x"\n'
    assert main(["plan", str(written(tmp_path, text=text))]) != 0
    said = capsys.readouterr()
    assert said.out == ""
    errors = [line for line in said.err.splitlines() if "warning" not in line]
    assert len(errors) == 1
    assert f"[[{part}]]" in errors[0]
    assert "--choose" in errors[0]
    assert "study.toml" in errors[0]


def test_a_check_of_measured_data_is_refused(file, capsys):
    assert main(["plan", str(file), "--check", "2"]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert "--noise" in said.err


@pytest.mark.parametrize("option", ["--noise", "--left"])
@pytest.mark.parametrize("value", ["0", "-1", "much"])
def test_numbers_that_are_not_positive_are_refused(file, capsys, option, value):
    assert main(["plan", str(file), f"{option}={value}"]) == 2
    assert option in capsys.readouterr().err


def test_checked_data_are_counted_beside_what_the_map_says(file, tmp_path, capsys, monkeypatch):
    """Diagnoses that find nothing each time, at five sizes."""
    seen = []

    def diagnose(model, measurements, *rest, progress, **how):
        progress("fitting", 0.5)
        seen.append(measurements[0].name)
        return SimpleNamespace(posterior=(((), 1.0),))

    monkeypatch.setattr("dovetail.plan.diagnose", diagnose)
    out = tmp_path / "plan.json"
    words = ["plan", str(file), "--noise", "0.003", "--check", "5", "--seed", "3", "--json", str(out)]
    assert main(words) == 0
    printed = capsys.readouterr().out
    rows = re.findall(r"^ *(\S+) +1 +(\d+) % +0 % \(0-79\) +(\d+) % +0 % \(0-79\)$", printed, re.M)
    assert [row[0] for row in rows] == ["0.5", "0.75", "1", "1.5", "2"]
    assert [int(row[1]) >= int(row[2]) for row in rows] == [True] * 5
    assert rows[2][2] == "90"
    checked = json.loads(out.read_text(encoding="utf-8"))["check"]
    assert [c["size"] for c in checked] == [0.5, 0.75, 1.0, 1.5, 2.0]
    assert all(not c["seen"] and c["probability_of_nothing"] == 1.0 for c in checked)
    assert len(set(seen)) == 5
    assert main(words) == 0
    again = json.loads(out.read_text(encoding="utf-8"))["check"]
    assert again == checked


def check_that_ends(monkeypatch, at, error):
    """Let the diagnosis of a set raise an error; those of the others find nothing."""
    calls = []

    def diagnose(model, measurements, *rest, progress, **how):
        calls.append(1)
        if len(calls) == at:
            raise error
        return SimpleNamespace(posterior=(((), 1.0),))

    monkeypatch.setattr("dovetail.plan.diagnose", diagnose)


def test_a_check_that_is_stopped_keeps_the_sets_that_are_diagnosed(file, tmp_path, capsys, monkeypatch):
    out = tmp_path / "plan.json"
    words = ["plan", str(file), "--noise", "0.003", "--check", "5", "--json", str(out)]
    check_that_ends(monkeypatch, 3, KeyboardInterrupt())
    assert main(words) == 1
    assert f"2 of 5 sets of data are diagnosed; {out} has them" in capsys.readouterr().err
    kept = json.loads(out.read_text(encoding="utf-8"))
    assert [c["size"] for c in kept["check"]] == [0.5, 0.75]
    assert len(kept["kinds"]) > 0
    check_that_ends(monkeypatch, 0, None)
    assert main(words) == 0
    assert json.loads(out.read_text(encoding="utf-8"))["check"][:2] == kept["check"]


def test_a_set_that_cannot_be_diagnosed_is_counted_apart(file, tmp_path, capsys, monkeypatch):
    out = tmp_path / "plan.json"
    check_that_ends(monkeypatch, 2, np.linalg.LinAlgError("the matrix is singular"))
    assert main(["plan", str(file), "--noise", "0.003", "--check", "3", "--json", str(out)]) == 0
    printed = capsys.readouterr().out
    assert "1 of 3 sets could not be diagnosed:" in printed
    assert re.search(r"size 0\.75: .*the matrix is singular", printed)
    assert not re.search(r"^0\.75 ", printed, re.M)
    data = json.loads(out.read_text(encoding="utf-8"))
    assert [c["size"] for c in data["check"]] == [0.5, 1.0]
    (failure,) = data["check_failures"]
    assert (failure["size"], failure["reason"]) == (0.75, "the matrix is singular")


def test_a_check_to_standard_output_writes_one_document(file, capsys, monkeypatch):
    check_that_ends(monkeypatch, 0, None)
    assert main(["plan", str(file), "--noise", "0.003", "--check", "2", "--json", "-"]) == 0
    assert len(json.loads(capsys.readouterr().out)["check"]) == 2


def test_the_interval_of_a_count_is_wilsons():
    """Of 8 of 10 it is 0.490 to 0.943 (Brown, Cai and DasGupta's example of Wilson's interval)."""
    assert planning._with_interval(8, 10) == "80 % (49-94)"


@pytest.mark.slow
def test_a_check_finds_what_the_map_says(planned, tmp_path):
    study = load_study(written(tmp_path))
    largest = [t for t in check_plan(study, planned, 5) if t.multiple == 2.0]
    assert [t.named for t in largest] == [True]


# Pictures -------------------------------------------------------------------------------------------------


def test_a_picture_marks_each_effect_of_a_row_by_what_the_test_says_of_it(planned, tmp_path, monkeypatch):
    """Not by the worst of its place: one of two effects of the arm is named, the other is not seen."""
    scenes = []

    class Kept(viz.plan.Scene):
        def save(self, path):
            scenes.append(self)
            Image.new("RGB", (4, 4)).save(path)
            return Path(path)

    monkeypatch.setattr(viz.plan, "Scene", Kept)
    some = planned.kinds["member stiffness"]
    looks = [{"named": k == 0, "located": k == 0, "seen": k == 0} for k in (0, 1)]
    two = [replace(some[0], **look) for look in looks]
    render_plan(replace(planned, relevant=(*planned.kinds["point mass"], *two)), tmp_path / "plan.png")
    masses, members = scenes
    assert len(masses.marks) == 26
    assert [m.colour for m in members.marks] == [style.BLUE, style.VERMILION]
    labels = ["named: 1 of 2", "located: 0 of 2", "seen: 0 of 2", "not seen: 1 of 2"]
    assert [line.get_label() for line in members.legend] == labels


def test_a_picture_of_many_rows_has_those_whose_effects_differ_most(planned, monkeypatch):
    """Row k has k effects that are seen beside ten that are not."""
    assert viz.plan.drawn_kinds(planned) == ("point mass", "member stiffness")
    looks = [SimpleNamespace(shown="seen"), SimpleNamespace(shown="not seen")]
    numbers = 3, 0, 5, 1, 4, 8, 2, 6
    plan = SimpleNamespace(kinds={f"row {k}": k * looks[:1] + 10 * looks[1:] for k in numbers})
    assert viz.plan.drawn_kinds(plan) == ("row 3", "row 5", "row 4", "row 8", "row 2", "row 6")
    monkeypatch.setattr("viz.plan.MOST_PANELS", 7)
    assert "row 0" not in viz.plan.drawn_kinds(plan)


def test_a_plan_of_data_that_the_model_does_not_explain_says_to_find_the_cause_first(tmp_path, capsys):
    assert main(["plan", str(write_study(tmp_path, mass=0.3))]) == 0
    printed = capsys.readouterr().out
    assert re.search(r"leaves \d\S* dB of the measured FRFs, noise .* dB: something is missing", printed)
    assert printed.index("Find it first: dovetail run") < printed.index("effects of a relevant size")


def test_a_plan_of_data_that_the_model_explains_asks_for_nothing_else(file, capsys):
    assert main(["plan", str(file)]) == 0
    assert "Find it first" not in capsys.readouterr().out


def test_a_sensor_is_added_to_those_of_the_study(tmp_path, capsys):
    study, out = written(tmp_path), tmp_path / "plan.json"
    assert main(["plan", str(study), "--noise", "0.003", "--add", "1", "--json", str(out)]) == 0
    printed = capsys.readouterr().out
    data = json.loads(out.read_text(encoding="utf-8"))["chosen"]
    assert len(data["sensors"]) == len(data["named_by_number"]) == 1
    assert data["named_by_number"][0] >= data["named_without"]
    assert ": 5 sensors, " in printed
    assert f"as they were added: {100 * data['named_without']:.0f} % without; 1: " in printed
    assert "These shares are estimates from 24 lines" in printed
    assert main(["plan", str(study), "--choose", "2", "--add", "1"]) == 2
    assert "give one of them" in capsys.readouterr().err


@pytest.mark.usefixtures("offscreen")
def test_a_picture_has_a_panel_for_each_group(file, tmp_path):
    picture = tmp_path / "plan.png"
    assert main(["plan", str(file), "--noise", "0.003", "--picture", str(picture)]) == 0
    with Image.open(picture) as image:
        assert image.format == "PNG"
        width, height = image.size
        colours = {tuple(c) for c in np.asarray(image.convert("RGB")).reshape(-1, 3)[::7]}
    assert width > height  # masses and members side by side
    assert len(colours) > 3


@pytest.mark.usefixtures("offscreen")
def test_a_picture_that_is_no_png_is_refused(file, tmp_path, capsys):
    assert main(["plan", str(file), "--noise", "0.003", "--picture", str(tmp_path / "plan.jpg")]) == 2
    assert "written as .png" in capsys.readouterr().err


def test_a_map_without_relevant_sizes_is_not_drawn(planned, tmp_path):
    with pytest.raises(ValueError, match="nothing to draw"):
        render_plan(replace(planned, relevant=()), tmp_path / "plan.png")
    assert not (tmp_path / "plan.png").exists()


# Words ----------------------------------------------------------------------------------------------------


def test_sizes_at_which_nothing_is_named_have_words(planned):
    row = planning.kind_rows(planned)[0]
    sizes = (("", row.n), ("1 kg", 3))
    rows = [replace(row, smallest=smallest, largest="", blind=blind) for smallest, blind in sizes]
    nowhere, partly = planning.table_of_kinds(rows).texts()[1]
    assert nowhere[-2:] == ("none", "")
    assert partly[-2:] == ("1 kg", "not at 3")


def test_places_where_nothing_is_seen_are_listed_once(planned):
    blind = replace(planned, relevant=tuple(replace(o, seen=False) for o in planned.relevant))
    lines = planning.blind_lines(blind)
    assert lines == ["nowhere: point mass; member stiffness"]
    first, *others = blind.relevant
    some = replace(blind, relevant=(replace(first, seen=True), *others))
    assert planning.blind_lines(some) == [
        "nowhere: member stiffness",
        "point mass: member post (12 of 13 positions); member arm (13 of 13 positions)",
    ]
    assert (
        planning.blind_lines(replace(planned, relevant=tuple(replace(o, seen=True) for o in blind.relevant)))
        == []
    )


def test_many_pairs_are_cut_short(planned, monkeypatch):
    seen = [replace(o, seen=True, named=False) for o in planned.relevant]
    plan = replace(planned, relevant=tuple(seen))
    n = len(plan.twins)
    assert n > 1
    monkeypatch.setattr(planning, "MOST_TWINS", n)
    assert len(planning.twin_lines(plan)) == n
    monkeypatch.setattr(planning, "MOST_TWINS", 1)
    assert planning.twin_lines(plan)[-1] == f"and {n - 1} more"
    monkeypatch.setattr(planning, "MOST_BLIND", 1)
    blind = replace(planned, relevant=tuple(replace(o, seen=False) for o in planned.relevant))
    first, *others = blind.relevant
    some = replace(blind, relevant=(replace(first, seen=True), *others))
    assert planning.blind_lines(some)[1] == "point mass: member post (12 of 13 positions); and 1 more of 2"


# Nothing missing ------------------------------------------------------------------------------------------


def test_a_diagnosis_in_which_nothing_is_missing_says_what_it_excludes(file, tmp_path, capsys):
    out = tmp_path / "found.json"
    words = ["diagnose", str(file), "--budget", "quick", "--processes", "1", "--json", str(out)]
    assert main(words) == 0
    printed = capsys.readouterr().out
    assert "nothing missing" in printed
    assert planning.EXCLUDED in printed
    data = json.loads(out.read_text(encoding="utf-8"))
    assert data["verdict"] == "nothing missing"
    rows = {row["kind"]: row for row in data["excluded"]}
    assert set(rows) == {"point_mass", "member_stiffness"}
    for row in rows.values():
        assert set(row) == {"kind", "unit", "n", "blind", "least", "most", "hidden_by"}
        assert row["hidden_by"]
        sizes = [row["least"], *(h["least_if_known"] for h in row["hidden_by"])]
        assert [abs(s) for s in sizes] == sorted((abs(s) for s in sizes), reverse=True)
    assert rows["point_mass"]["unit"] == "kg"
    assert rows["point_mass"]["n"] == 26
    assert 0 < rows["point_mass"]["least"] < 1.0


def test_a_hidden_effect_that_is_excluded_would_have_been_found(tmp_path, sound):
    """A mass of twice the least size that is seen anywhere is found where that is."""
    study, diagnosis = sound
    plan = pipeline.excluded(study, diagnosis)
    least = next(row["least"] for row in plan.sizes_of("seen") if row["kind"] == "point_mass")
    hidden = load_study(write_study(tmp_path, mass=2 * least.mass, at=least.position))
    found = pipeline.diagnose_study(hidden, budget="quick")
    assert found.verdict != "nothing missing"
    assert pipeline.excluded(hidden, found) is None
    assert excluded_dict(None) == {}


def test_what_is_excluded_is_judged_by_the_data_and_the_studys_sizes(sound):
    study, diagnosis = sound
    heavier = replace(study, relevant=replace(study.relevant, masses=0.5))
    plans = [pipeline.excluded(each, diagnosis) for each in (study, heavier)]
    assert all(p.is_measured for p in plans)
    masses = [next(o for o in p.relevant if o.relevant.kind == "point_mass").relevant.mass for p in plans]
    assert masses[1] == pytest.approx(25 * masses[0])
    assert plans[0].coverage("seen") < plans[1].coverage("seen")


def test_the_report_has_a_table_of_what_is_excluded(sound, tmp_path):
    study, diagnosis = sound
    plan = pipeline.excluded(study, diagnosis)
    html = join(missing._excluded(SimpleNamespace(excluded=plan), Shown(Album(tmp_path))))
    assert "<figure" not in html  # without a figure the table stands alone
    assert planning.EXCLUDED in html
    head, rows = planning.table_of_excluded(plan).texts()
    assert all(text in html for text in head)
    (row,) = (r for r in rows if r[0] == "point mass")
    assert row[1].startswith("mass ")
    assert re.sub(r"\s", " ", row[1]) in re.sub(r"\s|&nbsp;", " ", html)
    assert missing._excluded(SimpleNamespace(excluded=None), Shown(Album(tmp_path))) == []


def test_a_run_reports_the_progress_of_what_it_excludes(sound, file, tmp_path, monkeypatch):
    monkeypatch.setattr(pipeline, "diagnose_study", lambda *asked: sound[1])
    heard = []
    result = pipeline.analyse(load_study(file), tmp_path, lambda text, done: heard.append((text, done)))
    assert result.excluded is not None
    parts = [done for text, done in heard if text in {"what a little of each effect does", "what is alike"}]
    done = [d for _, d in heard]
    assert done == sorted(done)
    assert 0.9 <= parts[0] < parts[-1] < 1.0

    def ended(text, done):
        if text == "what is alike":
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        pipeline.excluded(*sound, ended)


# Figures --------------------------------------------------------------------------------------------------


def trace_of(figure, k, symbol):
    """Return the marks of one symbol of a kind."""
    own = [t for t, shown in zip(figure.data, figure.layout.meta["visible"][k], strict=True) if shown]
    return next((t for t in own if t.type == "scatter3d" and t.marker.symbol == symbol), None)


@pytest.mark.parametrize("what", ["seen", "named"])
def test_a_figure_has_the_least_size_of_each_place(planned, what):
    figure, rows = sizes(planned, what), planning.kind_rows(planned, what)
    masses = next(k for k, row in enumerate(rows) if row.kind == "point mass")
    some = planned.kinds["point mass"]
    least = {tuple(o.relevant.locations(planned.model)[0].round(6)): o.least(what) for o in some}
    marks, rings = trace_of(figure, masses, "circle"), trace_of(figure, masses, "circle-open")
    found = np.exp(marks.marker.color)
    assert len(found) + (0 if rings is None else len(rings.x)) == len(least) == 26
    for x, y, z, size, text in zip(marks.x, marks.y, marks.z, found, marks.hovertext, strict=True):
        (mass,) = (e.mass for at, e in least.items() if np.allclose(at, (x, y, z), atol=1e-5))
        assert size == pytest.approx(mass, rel=1e-5)
        assert f"{what} from mass" in text
    assert rings is None or all(f"not {what} at any plausible size" in t for t in rings.hovertext)
    bar = marks.marker.colorbar
    assert bar.title.text == f"{what} from: mass"
    assert all(text.endswith("kg") for text in bar.ticktext)
    assert marks.marker.cmin < min(bar.tickvals) < max(bar.tickvals) < marks.marker.cmax


def test_members_have_the_colour_of_their_size_or_of_none(planned):
    k = list(planned.kinds).index("member stiffness")
    blind = [replace(o, visible=replace(o.visible, enough=(np.inf,) * 3)) for o in planned.relevant]
    for plan, nowhere in ((planned, False), (replace(planned, relevant=tuple(blind)), True)):
        figure = sizes(plan, "seen")
        own = [t for t, shown in zip(figure.data, figure.layout.meta["visible"][k], strict=True) if shown]
        (solid,) = (t for t in own if t.type == "mesh3d")
        assert ({BLIND} == set(solid.facecolor)) == nowhere
        assert any("not seen" in text for text in solid.hovertext) == nowhere
        assert any(t.name == "not seen at any plausible size" for t in own) == nowhere


def test_a_place_with_a_direction_that_is_missed_is_a_diamond(planned):
    """One of two effects at a place is made invisible."""
    some = [o for o in planned.relevant if o.relevant.kind == "point_mass"]
    other = replace(some[5], visible=replace(some[5].visible, enough=(np.inf,) * 3))
    figure = sizes(replace(planned, relevant=(*some, other)), "seen")
    (text,) = trace_of(figure, 0, "diamond").hovertext
    assert "seen from mass" in text
    assert "not seen at any plausible size" in text


def test_the_list_of_a_report_chooses_the_kind_that_is_drawn(sound, tmp_path, browser):
    study, diagnosis = sound
    plan = pipeline.excluded(study, diagnosis)
    figures = Figures()
    figures.add("excluded", lambda: sizes(plan, "seen"))
    shown = Shown(Album(tmp_path), figures)
    parts = missing._excluded(SimpleNamespace(excluded=plan), shown)
    file = tmp_path / "report.html"
    file.write_text(page("excluded", *parts, shown.scripts()), encoding="utf-8")
    assert len(packed(figures.known["excluded"])) < 20_000
    data = "document.querySelector('figure[data-figure=excluded] .plot').data"
    from playwright.sync_api import sync_playwright

    with sync_playwright() as p:
        running = p.chromium.launch(executable_path=str(browser), args=list(CHROMIUM))
        for width in (1200, 400):
            with opened(running, file, width) as tab:
                box = drawn(tab, "excluded")
                for k, name in enumerate(box.locator("option").all_inner_texts()):
                    box.locator("select").select_option(name)
                    tab.wait_for_selector(f'figure[data-kind="{name}"]')
                    visible = tab.evaluate(f"{data}.map((t) => t.visible !== false)")
                    assert visible == list(figures.known["excluded"].layout.meta["visible"][k])
                    assert box.locator(".infolayer .colorbar").count() == 1
                    text = box.locator(".infolayer .colorbar").text_content()
                    assert ("kg" in text) == (name == "point mass")
        running.close()


def test_chosen_channels_are_printed_as_a_study_reads_them(planned, tmp_path):
    """What is printed stands in place of the study's own sensors and forces."""
    m = planned.measurement
    chosen = ChosenChannels(m.sensors, m.excitations, np.array([0.5]), 0.5)
    printed = "\n".join(planning.chosen_lines(chosen)).partition("\nnamed by")[0]
    first = min(STUDY.index(f"[[{table}]]") for table in ("sensors", "excitations"))
    read = load_study(written(tmp_path, printed, STUDY[:first]))
    for have, want in ((read.sensors, m.sensors), (read.excitations, m.excitations)):
        assert [s.name for s in have] == [s.name for s in want]
        for one, other in zip(have, want, strict=True):
            np.testing.assert_allclose(one.point, other.point, atol=1e-6)
            np.testing.assert_allclose(one.direction, other.direction, atol=1e-6)


def test_a_parameter_that_changes_no_frf_stays_as_uncertain_as_it_is():
    """Shear across the plane of a planar study does nothing in it."""
    example = Path(__file__).parents[2] / "examples" / "tuned-absorber" / "study.toml"
    effects = load_study(example).plan(0.01).plan.visibility.effects
    assert len(effects) > 50
    assert not np.isnan([o.enough for o in effects]).any()
