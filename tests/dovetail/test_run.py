"""The whole loop on a small frame: what it finds, writes and refuses."""

import json
import re

import numpy as np
import pytest

from dovetail import OutputError, StudyError, load_study, main
from dovetail import pipeline as run
from dovetail.report import pictures
from dovetail.result import SCHEMA
from fem.effects import candidate_kinds, effect_classes
from fem.io import read_npz
from tests.frames import STUDY
from tests.studies import fit_problem
from updating import assessed_fit


@pytest.fixture(scope="module")
def study_file(bent_file):
    return bent_file


@pytest.fixture(scope="module")
def done(bent):
    return bent


def test_the_hidden_mass_is_found(done):
    d = done.diagnosis
    assert d.verdict == "effect"
    (finding,) = d.findings
    assert finding.effect.kind == "point_mass"
    values = {p.name: p.value for p in finding.parameters}
    assert values["mass"] == pytest.approx(0.25, rel=0.05)
    assert values["position"] == pytest.approx(0.3, abs=0.02)
    first, *_, last = done.held_out_channels["excitation K"]
    assert last < 0.5 * first
    first, *_, last = done.held_out_channels["sensor P"]
    assert last < 0.5 * first


def test_result_json_has_the_documented_keys(done, root):
    text = done.json.read_text(encoding="utf-8")
    assert "NaN" not in text
    assert "Infinity" not in text
    result = json.loads(text)
    assert result["schema"] == SCHEMA
    table = (root / "docs" / "result.md").read_text(encoding="utf-8").split("## Kinds")[0]
    documented = {k for row in re.findall(r"^\| (`.*?) \|", table, re.M) for k in re.findall(r"`(\w+)`", row)}
    assert set(result) <= documented
    effect = result["effects"][0]
    own = {
        "kind",
        "where",
        "name",
        "spot",
        "parameters",
        "twins",
        "rival",
        "equal_fits",
        "decisive",
        "next_measurements",
    }
    assert set(effect) == own
    spots = effect["spot"], result["ranking"][0][0]["spot"]
    for spot in spots:
        assert spot["xyz"] == pytest.approx(done.diagnosis.found[0].locations(done.diagnosis.model)[0])
    assert all(set(p) == {"name", "value", "unit", "std", "at_bound"} for p in effect["parameters"])
    assert [set(e) for e in result["error_db"]] == [{"step", "fit", "held_out", "level"}] * 3
    assert result["error_db"][-1]["fit"] < 0.2 * result["error_db"][1]["fit"]
    assert result["noise_floor_db"] == pytest.approx(
        np.hypot(result["noise_db"], result["discretisation_db"])
    )
    assert result["ranking"][0][0]["name"] == effect["name"]
    assert [c["channel"] for c in result["held_out_channels"]] == ["excitation K", "sensor P"]
    assert result["model"]["values"][f"{effect['name']}.mass"] == pytest.approx(0.25, rel=0.05)
    assert all(type(v) in (float, int) for v in result["model"]["values"].values())


def test_the_study_that_was_found_runs_and_is_better(done):
    found = load_study(done.folder / "found.toml")
    known = [e.kind for e in found.model.effects if e.name.startswith("known ") and not e.is_form]
    assert known == [done.diagnosis.findings[0].effect.kind]
    before, after = (assessed_fit(fit_problem(s)).fit_db for s in (done.study, found))
    assert after < 0.5 * before


def test_every_hypothesis_has_a_probability(done):
    result = json.loads(done.json.read_text(encoding="utf-8"))
    assert result["effects"][0]["name"] in result["posterior"][0]["effects"]
    assert sum(h["probability"] for h in result["posterior"]) == pytest.approx(1.0)
    assert result["places"]


def test_what_was_found_is_the_reported_model(done):
    problem = fit_problem(load_study(done.folder / "found.toml"))
    assert problem.nominal().fit_db == pytest.approx(done.diagnosis.steps[-1].fit_db, rel=0.02)


def test_the_docs_list_every_kind_with_its_parameters(root):
    text = (root / "docs" / "result.md").read_text(encoding="utf-8")
    rows = dict(re.findall(r"^\| `(\w+)` \| (.*?) \|", text.split("## Kinds")[1], re.M))
    assert set(candidate_kinds()) <= set(rows)
    from fem import Frame

    for kind in candidate_kinds():
        own = set(effect_classes()[kind].__dataclass_fields__)
        assert {p for p in re.findall(r"`(\w+)`", rows[kind])} <= own
    assert Frame.kind not in candidate_kinds()


def test_frfs_of_each_step_are_kept(done):
    with np.load(done.folder / "frf.npz") as arrays:
        assert arrays["H_model"].shape == (3, *arrays["H"].shape)
        assert arrays["held_out"].any()
        error = [np.abs(H / arrays["H"] - 1)[arrays["compared"]].mean() for H in arrays["H_model"]]
        assert list(arrays["inputs"]) == ["T"]
    assert error[2] < 0.2 * error[1]
    assert read_npz(done.folder / "frf.npz").outputs == ("K", "T", "A")


def test_pictures_are_files_too(done):
    names = {p.name for p in (done.folder / "pictures").iterdir()}
    assert {"staircase.png", "misfit-bands-fitted.png", "frf-1.png", "ranking-1.png"} <= names


def test_what_is_not_ours_stays(study_file, tmp_path):
    (tmp_path / "thesis.tex").write_text("years of work", encoding="utf-8")
    with pytest.raises(OutputError, match="holds files"):
        run.run(load_study(study_file), tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["thesis.tex"]


@pytest.fixture
def quick(monkeypatch, done):
    """Let runs use the diagnosis that is there already, and its places of the misfit."""
    monkeypatch.setattr(run, "locate", lambda *_: done.localisation)
    monkeypatch.setattr(
        run, "diagnose_study", lambda study, say=None, processes=1, budget="normal": done.diagnosis
    )
    monkeypatch.setattr("dovetail.report.pictures.can_draw", lambda: False)


@pytest.fixture
def undrawn(monkeypatch):
    """Let reports have no pictures: `done` has them."""
    monkeypatch.setattr(pictures, "draw_all", lambda result, folder, say: pictures.Album(folder))


@pytest.mark.usefixtures("quick", "undrawn")
def test_an_earlier_result_stays_until_the_new_one_is_whole(done, tmp_path, monkeypatch):
    out = tmp_path / "out"
    before = run.run(done.study, out).report.read_bytes()

    def fail(*_):
        raise RuntimeError("power cut")

    with monkeypatch.context() as patch:
        patch.setattr("dovetail.report.report.report_html", fail)
        with pytest.raises(RuntimeError, match="power cut"):
            run.run(done.study, out)
        with pytest.raises(RuntimeError, match="power cut"):
            run.run(done.study, tmp_path / "new")
    assert [p.name for p in tmp_path.iterdir()] == ["out"]
    assert (out / "report.html").read_bytes() == before
    run.run(done.study, out)
    assert [p.name for p in tmp_path.iterdir()] == ["out"]


def test_a_machine_that_cannot_draw_still_reports(done):
    assert not (done.folder / "pictures" / "structure.png").exists()
    assert "cannot draw off screen" in done.report.read_text(encoding="utf-8")


@pytest.mark.usefixtures("quick")
def test_a_picture_that_fails_is_named(done, tmp_path, monkeypatch):
    def fail(*_, **__):
        raise ValueError("no ink")

    monkeypatch.setattr("viz.search.staircase", fail)
    monkeypatch.setattr(pictures, "_draw_frfs", lambda *_: None)  # of no concern here, and slow to draw
    result = run.run(done.study, tmp_path / "out")
    assert "staircase.png could not be drawn (ValueError: no ink)" in result.report.read_text(
        encoding="utf-8"
    )


def test_a_study_needs_a_measurement(study_file, tmp_path):
    file = tmp_path / "study.toml"
    file.write_text(STUDY, encoding="utf-8")
    with pytest.raises(StudyError, match="measurements"):
        run.run(load_study(file), tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.usefixtures("quick", "undrawn")
def test_the_verdict_is_printed_before_anything_is_drawn(study_file, tmp_path, capsys, monkeypatch):
    printed = []

    def written(*_):
        printed.append(capsys.readouterr())

    monkeypatch.setattr(run, "write", written)
    assert main(["run", str(study_file), "--out", str(tmp_path / "out")]) == 0
    lines = printed[0].out.splitlines()
    assert lines[1] == "Member arm carries a mass at 0.300 m that the model lacks."
    assert any(line.startswith("noise floor") for line in lines)
    assert re.fullmatch(r"\d\d:\d\d writing the report\n", printed[0].err)
    assert capsys.readouterr().out.split() == [str(tmp_path / "out" / "report.html")]


@pytest.mark.usefixtures("quick", "undrawn")
def test_run_prints_verdict_errors_and_path(study_file, tmp_path, capsys):
    out, file = tmp_path / "out", tmp_path / "r.json"
    assert main(["run", str(study_file), "--out", str(out), "--json", str(file)]) == 0
    printed = capsys.readouterr()
    lines = printed.out.splitlines()
    assert lines[-1] == str(out / "report.html")
    assert lines[0] == "bent <bar>: effect"
    assert lines[1] == "Member arm carries a mass at 0.300 m that the model lacks."
    assert any(line.startswith("noise floor") for line in lines)
    assert json.loads(file.read_text(encoding="utf-8"))["schema"] == SCHEMA
    (out / ".dovetail").unlink()
    assert main(["run", str(study_file), "--out", str(out)]) == 2
    assert "choose another folder" in capsys.readouterr().err
    assert main(["run", str(study_file), "--out", str(tmp_path / "q"), "--quiet"]) == 0
    assert capsys.readouterr().out == ""


@pytest.mark.usefixtures("quick")
def test_diagnose_prints_the_ranking(study_file, capsys):
    assert main(["diagnose", str(study_file), "--number", "2"]) == 0
    out = capsys.readouterr().out
    assert "round 1, 2 of " in out
    assert "point mass: member arm" in out
    assert main(["diagnose", str(study_file), "--json", "-"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["verdict"] == "effect"
    assert {"name", "nominal", "fitted", "std"} <= set(found["uncertain"][0])
    assert found["error_db"][-1]["level"] == pytest.approx(
        found["error_db"][-1]["fit"], rel=0.9
    )  # both in dB


@pytest.mark.parametrize("fitted", [False, True])
def test_compare(study_file, capsys, fitted):
    words = ["compare", str(study_file), "--bands", "3", *(["--fitted"] if fitted else [])]
    assert main(words) == 0
    out = capsys.readouterr().out.splitlines()
    assert len(out) == 2 + 3
    assert main([*words, "--json", "-"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert len(result["bands_Hz"]) == 4
    assert {s["sensor"] for s in result["sensors"]} == set("KTA")


def test_locate(study_file, capsys, monkeypatch):
    monkeypatch.setattr("updating.diagnosis.localisation.LEAST_SHARE", 0.05)
    assert main(["locate", str(study_file)]) == 0
    out = capsys.readouterr().out
    assert "member arm" in out
    assert main(["locate", str(study_file), "--json", "-"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert {m["member"] for m in result["members"]} == {"post", "arm"}


def test_locate_shows_no_shares_that_say_nothing(study_file, capsys, monkeypatch):
    """The arm, which carries the mass, has 93 %."""
    monkeypatch.setattr("updating.diagnosis.localisation.LEAST_SHARE", 1.0)
    assert main(["locate", str(study_file)]) == 0
    out = capsys.readouterr().out
    assert "share of the misfit" not in out
    assert "does not say where the model fails" in out
