"""Studies with measured modes alone, and with two states: files, commands, results."""

import json
import re
import shutil
import tomllib
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from dovetail import StudyError, load_study, main
from dovetail.disk.output import null_keys
from dovetail.file import toml_value, with_paths
from dovetail.found import mode_found_text
from dovetail.modes_history import StateChange
from dovetail.modes_pipeline import mode_problem, targets_of
from dovetail.report import make_all, partner_shapes, probability_details, probability_text, read_outline
from fem import Modes, assemble, first_modes
from fem.io import write_npz
from tests.frames import MAST, beam
from tests.studies import study_file, study_from
from updating import ModeDiagnosis, ModeTargets, Nuisance, diagnose_modes, propose, sensor_rows
from updating.diagnosis import Explanation, ModeTable
from updating.diagnosis.findings import Finding
from updating.diagnosis.mode_diagnosis import _reason, _unexplained
from updating.diagnosis.reported_modes import reported_modes
from updating.inference.mode_fit import ModeReading
from updating.least_squares.mode_levels import ModeLevels

LINES = f"""{MAST}
[candidates]
kinds = ["point_mass"]

[fit]
model_error = 0.0
"""
NOMINAL = [8.36, 25.05, 52.35, 146.4, 156.0]
SENSORS = [(axis, s) for axis in "xy" for s in (0.3, 0.6, 0.8, 1.0)]


@pytest.fixture(autouse=True)
def _without_opengl(monkeypatch):
    """Leave pictures of the structure out: others test them, and they take long without a graphics card."""
    monkeypatch.setattr("dovetail.report.pictures.can_draw", lambda: False)


def written(folder, text):
    return study_file(folder, LINES + text)


def test_keys_of_modes_are_read(tmp_path):
    text = "[modes]\nfrequency = [30.0, 10.0, 20.0]\nfrequency_std = [3e-3, 1e-3, 2e-3]\n"
    text += "zeta = [0.03, 0.01, 0.02]\n"
    text += 'numbers = [3, 1, 2]\nplane = "xz"\nheld_out = [2]\n'
    targets = targets_of(load_study(written(tmp_path, text)).modes)
    assert targets.frequency.tolist() == [10.0, 20.0, 30.0]
    assert targets.zeta.tolist() == [0.01, 0.02, 0.03]
    assert targets.held_out.tolist() == [False, True, False]
    assert targets.plane == "xz"


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ('plane = "up"', "axes such as"),
        ("held_out = [4]", "from 1 to 3"),
        ("held_out = [1, 2, 3]", "leave at least one"),
        ("numbers = [1, 2]", "one each is needed"),
        ("zeta = [0.01]", "one each"),
        ("frequency_std = [0.1, 0.2]", "one each"),
        ('sensors = ["top"]', "no 'top'"),
        ('excitations = ["hammer"]', "no 'hammer'"),
    ],
)
def test_wrong_keys_of_modes_are_refused(tmp_path, line, words):
    with pytest.raises(StudyError, match=words):
        load_study(written(tmp_path, f"[modes]\nfrequency = [10.0, 20.0, 30.0]\n{line}\n"))


TEST = """
[[sensors]]
name = "tip x"
point = "tip"
direction = "x"

[[sensors]]
name = "tip y"
point = "tip"
direction = "y"

[[excitations]]
name = "hammer"
point = "tip"
direction = "x"

"""


@pytest.mark.parametrize(
    ("line", "sensors", "forces"),
    [
        ("", ["tip x", "tip y"], ["hammer"]),
        ('sensors = ["tip y"]', ["tip y"], ["hammer"]),
        ('sensors = ["tip x"]\nexcitations = ["hammer"]', ["tip x"], ["hammer"]),
    ],
)
def test_frequencies_belong_to_the_channels_that_modes_name_or_to_all(tmp_path, line, sensors, forces):
    study = load_study(written(tmp_path, f"{TEST}[modes]\nfrequency = [8.36, 52.3]\n{line}\n"))
    targets = targets_of(study.modes)
    assert [s.name for s in targets.sensors] == sensors
    assert [s.name for s in targets.driven] == forces
    assert not targets.has_shapes


def test_sensors_of_shapes_are_those_of_their_rows(tmp_path):
    (tmp_path / "modes.csv").write_text("frequency,a,b\n8.36,1.0,0.5\n", encoding="utf-8")
    named = TEST.replace('"tip x"', '"a"').replace('"tip y"', '"b"')
    with pytest.raises(StudyError, match="rows of the shapes"):
        load_study(written(tmp_path, f'{named}[modes]\nfile = "modes.csv"\nsensors = ["a"]\n'))


def test_a_bad_reading_and_a_prediction_are_written_everywhere(tmp_path, capsys):
    f = [8.356, 52.37, 155.4, 287.4, 475.0, 709.6]  # closed form in the weak plane, the third 6 % too high
    study = written(tmp_path, f'[modes]\nfrequency = {f}\nplane = "x"\nheld_out = [6]\n')
    assert main(["run", str(study), "--out", str(tmp_path / "out")]) == 0
    said = capsys.readouterr().out
    assert "mode 3 (155.4 Hz) does not belong to the structure's model" in said
    assert re.search(r"predicted, not fitted: 70\d(\.\d+)? ± \d", said)
    result = json.loads((tmp_path / "out" / "result.json").read_text(encoding="utf-8"))
    (bad,) = result["bad_readings"]
    assert (bad["mode"], bad["reading"]) == (3, "frequency")
    assert bad["probability"] > 0.9
    assert result["modes"][2]["bad_probability"] == pytest.approx(bad["probability"])
    last = result["modes"][5]
    # The model has rotary inertia and shear beside it: β² r² (1 + E/κG) / 2 = 0.5 %.
    shear = 17.28**2 * 0.01**2 / 12 * (1 + 2.6 / 0.85) / 2
    assert 0 < last["found_std"] < 2e-3
    assert abs(last["found_Hz"] / 709.6 - 1) < 3 * last["found_std"] + shear
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "does not belong to the model" in page
    assert "predicted: 70" in page


def test_a_study_of_frequencies_alone_is_run(tmp_path, capsys):
    study = written(tmp_path, f"[modes]\nfrequency = {NOMINAL}\nfrequency_std = 0.01\nheld_out = [5]\n")
    assert main(["run", str(study), "--out", str(tmp_path / "out")]) == 0
    assert "predicted, not fitted" in capsys.readouterr().out
    result = json.loads((tmp_path / "out" / "result.json").read_text(encoding="utf-8"))
    assert result["verdict"] == "nothing missing"
    assert sum(p["probability"] for p in result["posterior"]) == pytest.approx(1.0)
    assert [m["held_out"] for m in result["modes"]] == [False] * 4 + [True]
    assert 0 < result["frequency_error"]["found"]["held_out"] < 0.03
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "Verdict: nothing missing" in page
    rows = {row["kind"]: row for row in result["excluded"]}
    assert rows["point_mass"]["hidden_by"]
    assert all(0 < h["least_if_known"] < rows["point_mass"]["least"] for h in rows["point_mass"]["hidden_by"])
    assert "hidden most by" in page


def test_the_change_between_two_states_is_found(root, tmp_path):
    """60 g at 0.30 m of the arm, and a modulus that both states have 2 % lower than the study says."""
    folder = shutil.copytree(root / "examples" / "before-and-after", tmp_path / "study")
    text = (folder / "study.toml").read_text(encoding="utf-8")
    few = text.replace(', "support_flexibility", "crack", "member_stiffness"]', "]")
    study = study_from(folder, few)
    found = study.diagnose()
    (effect,) = found.found
    values = {p.name: p.value for p in effect.parameters()}
    assert values["mass"] == pytest.approx(0.06, rel=0.05)
    assert values["position"] == pytest.approx(0.30, abs=0.01)
    assert found.modes.errors(found.modes.fitted, False) > 0.005
    assert "0.06" in found._repr_html_()
    again = mode_found_text(study, found, folder)
    (folder / "found.toml").write_text(again, encoding="utf-8")
    problem = mode_problem(load_study(folder / "found.toml"))  # the form of both states included
    computed = problem.computed(problem.nominal()).frequency
    # calibrated once more, from priors about the found values: within the deviations of the frequencies
    assert computed == pytest.approx(found.modes.found, rel=2e-4)


def frequencies_of(study, **mass):
    """Return six natural frequencies of a study's model [Hz], with a point mass if it has values."""
    study = study.add("point_mass:mast", **mass) if mass else study
    return study.solve_modes(6).frequency[:6].tolist()


def run_again(tmp_path, capsys, text):
    """Return the result of a run, and what `compare` and `diagnose` tell of its found.toml."""
    study, out = written(tmp_path, text), tmp_path / "out"
    assert main(["run", str(study), "--out", str(out)]) == 0
    again = tmp_path / "again.json"
    assert main(["compare", str(out / "found.toml"), "--json", str(again)]) == 0
    capsys.readouterr()
    result, compared = (json.loads(f.read_text(encoding="utf-8")) for f in (out / "result.json", again))
    return result, compared, load_study(out / "found.toml")


def test_the_found_study_gives_the_reported_error(tmp_path, capsys):
    plain = load_study(written(tmp_path, ""))
    measured = frequencies_of(plain, mass=0.3, position=0.7)
    text = f"[uncertain]\nE = 0.02\n\n[modes]\nfrequency = {measured}\nfrequency_std = 1e-3\nheld_out = [6]\n"
    result, compared, found = run_again(
        tmp_path, capsys, text + "zeta = [0.004, 0.004, 0.005, 0.006, 0.006, 0.007]\n"
    )
    assert [e["name"] for e in result["effects"]] == ["point_mass:mast"]
    for key in ("fit", "held_out"):
        error = result["frequency_error"]["found"][key]
        # the basis may err by 3 % of the deviations
        assert compared["frequency_error"][key] == pytest.approx(error, abs=0.03 * 1e-3)
    by_mode = zip(result["modes"], compared["modes"], strict=True)
    assert all(b["zeta_computed"] == pytest.approx(a["zeta_found"], rel=1e-3) for a, b in by_mode)
    assert found.diagnose().verdict == "nothing missing"


def test_a_change_since_the_baseline_stays_one_in_the_found_study(tmp_path, capsys):
    plain = load_study(written(tmp_path, ""))
    before, after = (frequencies_of(plain, **mass) for mass in ({}, {"mass": 0.02, "position": 0.7}))
    text = f"[baseline]\nfrequency = {before}\nfrequency_std = 2e-4\n\n[modes]\nfrequency = {after}\n"
    result, compared, found = run_again(tmp_path, capsys, text + "frequency_std = 2e-4\n")
    assert found.changes == ("known point_mass:mast",)
    assert compared["frequency_error"]["fit"] == pytest.approx(
        result["frequency_error"]["found"]["fit"], abs=1e-6
    )
    assert found.diagnose().verdict == "nothing missing"


def test_an_effect_that_is_added_by_hand_is_fitted_to_modes(tmp_path, capsys):
    measured = frequencies_of(load_study(written(tmp_path, "")), mass=0.3, position=0.7)
    study = written(tmp_path, f"[modes]\nfrequency = {measured}\nfrequency_std = 1e-3\n")
    command = ["compare", str(study), "--add", "point_mass:mast", "--set", "position=0.68", "--json"]
    errors = []
    for more in ([], ["--fitted"]):
        assert main([*command, str(tmp_path / "c.json"), *more]) == 0
        compared = json.loads((tmp_path / "c.json").read_text(encoding="utf-8"))
        errors.append(compared["frequency_error"]["fit"])
    assert errors[1] < 1e-4 < errors[0]
    assert compared["added"][0]["parameters"][0]["value"] == pytest.approx(0.3, rel=0.01)
    assert "added: point_mass:mast" in capsys.readouterr().out


def test_a_change_without_a_baseline_is_refused(tmp_path):
    effect = '[[effects]]\ncandidate = "point_mass:mast"\nsince_baseline = true\n'
    with pytest.raises(StudyError, match=r"since_baseline: the study has no \[baseline\]") as caught:
        load_study(written(tmp_path, f"[modes]\nfrequency = {NOMINAL}\n\n{effect}"))
    assert "\n" not in str(caught.value)


def test_files_of_both_states_are_found_from_another_folder(tmp_path):
    text = '[modes]\nfile = "after.npz"\n\n[baseline]\nfile = "old/before.npz"\n'
    moved = tomllib.loads(with_paths(text, tmp_path, tmp_path / "out"))
    assert (moved["modes"]["file"], moved["baseline"]["file"]) == ("../after.npz", "../old/before.npz")


def written_shapes(folder, name='a<b>&"{x}'):
    """Write a study whose modes have shapes: a mast with a mass at 0.7 m, the last mode held out."""
    rows = "".join(
        f'\n[[sensors]]\nname = "{axis}{s}"\nmember = "mast"\nposition = {s}\ndirection = "{axis}"\n'
        for axis, s in SENSORS
    )
    plain = load_study(written(folder, rows))
    study = plain.add("point_mass:mast", mass=0.3, position=0.7)
    modes = study.solve_modes(6)
    shapes = sensor_rows(study.model, study.sensors) @ modes.shapes[:, :6]
    labels = tuple(s.name for s in study.sensors)
    write_npz(folder / "modes.npz", Modes(modes.frequency[:6], shapes, labels=labels))
    text = f"{rows}\n[study]\nname = {toml_value(name)}\n\n[uncertain]\nE = 0.02\n\n[modes]\n"
    return written(folder, text + 'file = "modes.npz"\nfrequency_std = 1e-3\nheld_out = [6]\n')


@pytest.fixture(scope="module")
def shaped(tmp_path_factory):
    """Return a run on modes with shapes, and its folder."""
    folder = tmp_path_factory.mktemp("shapes")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("dovetail.report.pictures.can_draw", lambda: False)
        return load_study(written_shapes(folder)).run(folder / "out")


def test_the_report_of_modes_answers_first_and_holds_its_figures(shaped):
    text = shaped.report.read_text(encoding="utf-8")
    figures = {"model", "staircase", "probability", "deviations", "mac", "modes"}
    assert set(re.findall(r'<figure data-figure="([^"]+)"', text)) == figures
    first = text[: text.index("<nav")]
    assert "Verdict: effect" in first
    assert "alone or with others: above 99\u00a0%" in first
    assert first.count("Probability") == 1
    assert "This effect alone: above 99\u00a0%" in text
    assert {"staircase", "model"} == set(re.findall(r'<figure data-figure="([^"]+)"', first))
    assert "could not be made" not in text
    assert "a<b>" not in text
    headings = [h for h in re.findall(r"<th[^>]*>([^<]*)", text) if h.startswith("MAC")]
    assert headings == ["MAC nominal", "MAC fitted", "MAC with the effect"]
    pictures = {p.name for p in (shaped.folder / "pictures").iterdir()}
    assert pictures == {"deviations.png", "mac.png", "staircase.png"}


def test_the_figures_of_modes_show_the_table(shaped):
    d = shaped.diagnosis
    figures = make_all(shaped)
    assert figures.failures == []
    staircase = figures.known["staircase"].data
    for k, held in enumerate((False, True)):
        errors = [100 * d.modes.errors(f, held) for f in (d.modes.nominal, d.modes.fitted, d.modes.found)]
        assert staircase[k].y == pytest.approx(errors)
    (found,) = (t for t in figures.known["deviations"].data if t.meta == {"series": "with the effect"})
    assert found.y == pytest.approx(100 * (d.modes.found / d.modes.measured - 1))
    (place,) = (t for t in figures.known["model"].data if (t.meta or {}).get("role") == "finding")
    assert place.z == pytest.approx([0.7], abs=0.02)


def test_a_diagnosis_by_modes_has_findings_a_posterior_and_a_staircase(shaped):
    d = shaped.diagnosis
    (finding,) = d.findings
    assert (finding.effect,) == d.found
    assert d.posterior[0][0] == (finding.effect.name,)
    assert d.posterior[-1][0] == ("unknown",)
    assert sum(p for _, p in d.posterior) == pytest.approx(1.0)
    labels, fitted, held_out = zip(*d.stairs.rows, strict=True)
    assert labels[:2] == ("nominal model", "uncertain parameters fitted")
    assert labels[2].endswith(" added")
    assert fitted[2] == pytest.approx(100 * d.modes.errors(d.modes.found, False))
    assert held_out[0] == pytest.approx(100 * d.modes.errors(d.modes.nominal, True))


def test_partners_in_the_full_model_are_those_of_the_fit(shaped):
    d = shaped.diagnosis
    drawn = reported_modes(d)
    assert drawn.modes.frequency[drawn.partner] == pytest.approx(d.modes.found, rel=1e-4)
    own = drawn.mac[np.arange(d.modes.measured.size), drawn.partner - drawn.modes.n_rigid]
    assert own == pytest.approx(d.modes.mac_found, abs=1e-3)
    shapes = partner_shapes(d.problem.targets, drawn)
    assert set(shapes) == set(drawn.partner)
    assert all(len(points) == len(SENSORS) for points, _ in shapes.values())


def test_the_found_study_of_shapes_is_compared_from_its_folder(shaped, tmp_path):
    told = json.loads(shaped.json.read_text(encoding="utf-8"))
    assert main(["compare", str(shaped.folder / "found.toml"), "--json", str(tmp_path / "c.json")]) == 0
    compared = json.loads((tmp_path / "c.json").read_text(encoding="utf-8"))
    for key in ("fit", "held_out"):
        # of exact data: both are next to nothing beside the standard deviation of 1e-3
        assert compared["frequency_error"][key] == pytest.approx(
            told["frequency_error"]["found"][key], abs=2e-5
        )
    assert [m["mac"] for m in compared["modes"]] == pytest.approx([m["mac_found"] for m in told["modes"]])


def test_the_report_of_modes_is_told_as_blocks(shaped):
    outline = read_outline(shaped.folder)
    assert outline.name == shaped.study.name
    assert outline.texts("sentence")
    assert "Natural frequencies and mode shapes" in [p.heading for p in outline.parts]


def test_an_unsure_change_says_so(tmp_path):
    """One symmetric pair of modes cannot say what has changed."""
    text = "[baseline]\nfrequency = [8.3, 25.0]\nfrequency_std = 1e-3\n\n"
    study = load_study(written(tmp_path, f"{text}[modes]\nfrequency = [8.2, 24.7]\nfrequency_std = 1e-3\n"))
    done = study.run(tmp_path / "out")
    page = done.report.read_text(encoding="utf-8")
    assert "fitted to the baseline" in page
    assert "What has changed" in page
    (table,) = re.findall(r"<table[^>]*>(?:(?!</table>).)*before \[Hz\].*?</table>", page, re.DOTALL)
    cells = re.findall(r"<td[^>]*>(.*?)</td>", table)
    # 8.2 / 8.3 and 24.7 / 25.0, and what the models have
    assert [cells[k : k + 4] for k in (0, 7)] == [
        ["1", "8.3000", "8.2000", "−1.20"],
        ["2", "25.000", "24.700", "−1.20"],
    ]
    first = done.diagnosis.baseline.computed.frequency
    assert [float(cells[k]) for k in (4, 11)] == pytest.approx(first, rel=1e-4)


def test_a_study_of_modes_is_compared_fitted_and_saved_from_python(tmp_path, capsys):
    """The numbers are those of the command line, and the saved study's those of the fit."""
    measured = frequencies_of(load_study(written(tmp_path, "")), mass=0.3, position=0.7)
    text = f"[modes]\nfrequency = {measured}\nfrequency_std = 1e-3\nheld_out = [6]\n"
    path = written(
        tmp_path, text.replace("frequency_std", "zeta = [0.01, 0.01, 0.01, 0.01, 0.01, 0.01]\nfrequency_std")
    )
    study = load_study(path)
    before = study.compare()
    assert main(["compare", str(path), "--json", str(tmp_path / "c.json")]) == 0
    compared = json.loads((tmp_path / "c.json").read_text(encoding="utf-8"))
    assert before.error == pytest.approx(compared["frequency_error"]["fit"])
    assert set(null_keys(compared)) == {"mac"} == compared["missing"].keys()
    better = study.add("point_mass:mast", mass=0.1, position=0.68).fit()
    assert better.model.effect("point_mass:mast").mass == pytest.approx(0.3, rel=0.01)
    assert better.model.damping.ratio_at(np.array(measured)) == pytest.approx(0.01, rel=0.05)
    after = better.compare()
    assert after.error < 1e-4 < before.error
    assert after.held_out_error < 1e-3
    assert "6 modes" in repr(after)
    assert "held out" in repr(after)
    assert after._repr_html_().count("<tr>") == 7
    better.save(tmp_path / "better.toml")
    assert load_study(tmp_path / "better.toml").compare().error == pytest.approx(after.error, abs=1e-6)
    with pytest.raises(StudyError, match=r"no \[\[measurements\]\]"):
        study.error()


def test_an_effect_added_to_a_study_with_a_baseline_is_saved_as_a_change(tmp_path):
    plain = load_study(written(tmp_path, ""))
    before, after = (frequencies_of(plain, **mass) for mass in ({}, {"mass": 0.02, "position": 0.7}))
    text = f"[baseline]\nfrequency = {before}\nfrequency_std = 2e-4\n\n[modes]\nfrequency = {after}\n"
    study = load_study(written(tmp_path, text + "frequency_std = 2e-4\n"))
    better = study.add("point_mass:mast", mass=0.01, position=0.6).fit()
    assert better.model.effect("point_mass:mast").mass == pytest.approx(0.02, rel=0.05)
    better.save(tmp_path / "better.toml")
    again = load_study(tmp_path / "better.toml")
    assert again.changes == ("known point_mass:mast",)
    assert again.compare().error == pytest.approx(better.compare().error, abs=1e-6)


def test_a_mirrored_position_is_no_other_effect_but_another_position():
    model = beam(8, theory="timoshenko")
    (effect,) = propose(model, ["point_mass"])
    f = first_modes(assemble(model.with_effect(effect.with_values(mass=0.2, position=0.3))), 5)
    targets = ModeTargets.of(f.frequency[f.n_rigid :], 1e-3)
    found = diagnose_modes(
        model, targets, (Nuisance("frame", "E:steel", 0.02),), kinds=["point_mass"], model_error=0.0
    )
    text = probability_details(found)
    shares = re.search(
        r"^This effect alone: above 99\s%; this effect alone, at this position: (\d+)\s%", text
    )
    assert shares is not None, text
    assert 40 <= int(shares[1]) <= 60


def told(verdict, reported, *explanations):
    """Return a diagnosis of two modes whose reported hypothesis has some effects, among explanations."""
    column = np.array([50.0, 120.0])
    blank = np.full(2, np.nan)
    steps = dict.fromkeys(("nominal", "fitted", "found"), column)
    unknown = dict.fromkeys(steps, blank)
    table = ModeTable(
        column, 0.01 * column, steps, unknown, blank, unknown, np.zeros(2, dtype=bool), blank, blank
    )
    one = np.ones(2)
    levels = ModeLevels(np.zeros(2, dtype=np.int64), one, one, 1e-4 * one, 1e-4 * np.ones((2, 1)), one)
    result = SimpleNamespace(values={}, std={}, effects=reported, levels=levels, misfit=1e-4 * one)
    best = SimpleNamespace(effects=reported, fitted=result)
    searched = SimpleNamespace(
        best=best,
        lead=best,
        explains=verdict != "unexplained",
        finished=True,
        probability_there=lambda h: 0.5,
        proposed_faults=(),
    )
    searched.search = SimpleNamespace(known={frozenset(): best})
    known = [Explanation(e, tuple(() for _ in e), p) for e, p in explanations]
    every = (*known, Explanation((), (), 0.01, known=False))
    found = ModeDiagnosis(
        verdict=verdict,
        reason="",
        findings=tuple(Finding(e, (), ()) for e in reported),
        explanations=every,
        posterior=tuple((tuple(x.name for x in e.effects), e.probability) for e in known),
        modes=table,
        problem=None,
        model=None,
        searched=searched,
        notes=(),
        seconds=0.0,
    )
    return replace(found, reason=_reason(found))


def test_readings_that_no_explanation_reaches_are_named_the_worst_first():
    mass = SimpleNamespace(name="m", kind="mass", where="A")
    unknown = told("unexplained", (), ((mass,), 0.5))
    fitted = SimpleNamespace(misfit=np.array([9.0, 0.5, 1.0, 4.0]))
    readings = ModeReading(0, 0), ModeReading(1, 0), ModeReading(0, 1), ModeReading(1, 2)
    problem = SimpleNamespace(
        allowed_squares=lambda: np.ones(4),
        readings=lambda: readings,
        targets=SimpleNamespace(frequency=np.array([12.5, 94.2])),
    )
    lead = SimpleNamespace(effects=(mass,), fitted=fitted)
    unknown = replace(unknown, problem=problem, searched=SimpleNamespace(lead=lead))
    (text,) = _unexplained(unknown)
    assert text.startswith("with mass at A, the frequency of mode 1 (12.5 Hz) is off by 3 times")
    assert "the shape of mode 2 (94.2 Hz) is off by 2 times" in text
    assert "damping" not in text
    assert _unexplained(replace(unknown, verdict="effect")) == ()


def test_the_probability_next_to_a_statement_is_that_of_the_statement():
    """Of twins the simpler one is reported, which may be less probable than the first explanation."""
    mass, both = (
        SimpleNamespace(name="m", kind="mass", where="A"),
        SimpleNamespace(name="k", kind="k", where="B"),
    )
    nothing = told("nothing missing", (), ((mass,), 0.39), ((), 0.26))
    assert probability_text(nothing) == "Probability among all hypotheses: 26\u00a0%"
    assert re.search(r"^Mass: A, and nothing else: 39\s%, too close to decide", probability_details(nothing))
    change = StateChange("later", "", np.zeros(2), np.zeros(2), nothing)
    assert (change.answer, change.probability) == ("nothing", 0.26)
    one = told("effect", (mass,), ((mass, both), 0.55), ((mass,), 0.40))
    assert not one.sure
    assert re.search(r"nearly as probable, 40\s%: mass at A", one.reason)
    assert "none is sure" not in one.reason
    unknown = told("unexplained", (), ((mass,), 0.5))
    assert unknown.reported.probability == 0.01
