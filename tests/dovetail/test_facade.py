"""The facade: load, compare, diagnose, add, fit, save."""

import shutil
from pathlib import Path

import numpy as np
import pytest

import dovetail
from dovetail import OutputError
from dovetail.update import update_study
from fem import ModelError

EXAMPLES = Path(__file__).parents[2] / "examples"
FIRST = EXAMPLES / "first-frame" / "study.toml"
SOFT = "support_flexibility:left foot.ry"
"""What its simulated test has and its model lacks."""


@pytest.fixture(scope="module")
def study():
    return dovetail.load_study(FIRST)


@pytest.fixture(scope="module")
def with_effect(study):
    """The hidden effect, a foot that is soft about y, added by hand and fitted."""
    (effect,) = [e for e in study.candidates(["support_flexibility"]) if e.name == SOFT]
    added = study.add(effect)
    return added, added.fit()


def test_the_error_falls_when_the_missing_effect_is_added_and_fitted(study, with_effect):
    added, fitted = with_effect
    assert fitted.compare().total_db < 0.25 * study.fit().compare().total_db
    assert [e.name for e in fitted.added] == [e.name for e in added.added]
    assert study.added == ()


def test_a_saved_study_is_the_fitted_one(tmp_path, with_effect):
    _, fitted = with_effect
    fitted.save(tmp_path / "better.toml")
    again = dovetail.load_study(tmp_path / "better.toml")
    assert again.compare().total_db == pytest.approx(fitted.compare().total_db, abs=5e-4)  # dB


def test_a_second_fit_starts_where_the_first_did(with_effect):
    _, fitted = with_effect
    once, twice = fitted.model.values(), fitted.fit().model.values()
    # those near 0 are relative changes with deviations of a per cent and more: within 0.005 of these
    assert {k: twice[k] for k in once} == pytest.approx(once, rel=1e-3, abs=5e-5)


def test_frfs_are_those_of_the_measurement_unless_others_are_asked_for(study):
    measured = study.measurements[0].frf
    computed = study.frf(measured.frequency[5:8])
    assert computed.kind == measured.kind
    assert computed.outputs == tuple(s.name for s in study.sensors)
    receptance = study.frf([50.0, 60.0], "receptance")
    omega = 2 * np.pi * receptance.frequency
    accelerance = study.frf([50.0, 60.0], "accelerance")
    np.testing.assert_allclose(accelerance.H, -(omega[:, None, None] ** 2) * receptance.H, rtol=1e-9)


def test_an_effect_cannot_be_added_twice(with_effect):
    added, _ = with_effect
    with pytest.raises(ModelError, match="support_flexibility"):
        added.add(*added.added)


def test_a_study_is_never_saved_over_what_it_reads(study):
    with pytest.raises(OutputError, match=r"study\.toml"):
        study.save(FIRST)


def test_printing_a_study_takes_one_line(study):
    assert len(repr(study)) < 200
    assert study.name in repr(study)


def test_the_form_may_be_said_to_be_right(tmp_path):
    """It is textbook updating then: the same as a model error of 0, and named in what is printed."""
    text = (EXAMPLES / "first-frame" / "study.toml").read_text(encoding="utf-8")
    for name in ("frame.msh", "test.uff"):
        shutil.copy(EXAMPLES / "first-frame" / name, tmp_path / name)

    def study(fit):
        (tmp_path / "study.toml").write_text(f"{text}\n[fit]\n{fit}\n", encoding="utf-8")
        return dovetail.load_study(tmp_path / "study.toml")

    drawn = study("form = false")
    assert drawn.model_error == 0
    assert any("taken as drawn" in note for note in drawn.measured_notes)
    assert study("form = true").model_error > 0
    with pytest.raises(dovetail.StudyError, match="beams may then err"):
        study("form = false\nmodel_error = 0.2")
    free, held = (study(f"form = {form}").add(SOFT, stiffness=2e4).fit() for form in ("true", "false"))
    assert not any(e.is_form for e in held.model.effects)
    assert held.fitted.std["frame", "E:steel"] < 0.5 * free.fitted.std["frame", "E:steel"]


@pytest.mark.slow
def test_a_diagnosis_a_fit_and_an_update_give_one_answer(tmp_path):
    """Values within a tenth of a standard deviation; equal deviations to 10 %.

    The noise is read from the fit before: a diagnosis's lacks the effect, an update's has it.
    """
    folder = Path(shutil.copytree(EXAMPLES / "first-frame", tmp_path / "first-frame"))
    study = dovetail.load_study(folder / "study.toml")
    found = study.diagnose()
    last = found.steps[-1].result
    again = study.add(*found.findings).fit().fitted
    (finding,) = found.findings
    asked = f'\n[[update.parameters]]\neffect = "{finding.effect.name}"\nstart = 1e4\n'
    (folder / "update.toml").write_text(study.text + asked, encoding="utf-8")
    updated = update_study(dovetail.load_study(folder / "update.toml")).updated.fitted
    ours = {(effect.removeprefix("known "), p): v for (effect, p), v in updated.values.items()}
    std = {(effect.removeprefix("known "), p): v for (effect, p), v in updated.std.items()}
    assert ours.keys() == again.values.keys()
    for ref, value in last.values.items():
        for values, deviations in ((again.values, again.std), (ours, std)):
            assert values[ref] == pytest.approx(value, abs=0.1 * last.std[ref])
            assert deviations[ref] == pytest.approx(last.std[ref], rel=0.1)


@pytest.mark.parametrize("kind", [dovetail.StudyError, OSError])
def test_a_file_that_is_missing_is_named_as_on_the_command_line(tmp_path, capsys, kind):
    path = tmp_path / "nix.toml"
    assert dovetail.main(["check", str(path)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    with pytest.raises(kind) as caught:
        dovetail.load_study(path)
    assert line == f"dovetail: {caught.value}"
