"""Measured modes beside FRFs: the table of a run, and what it predicts of those held out."""

import json

import numpy as np
import pytest

from dovetail import load_study, main
from fem import PointMass, assemble, first_modes
from tests.frames import write_study

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    """Return the folder of a study with a hidden mass, FRFs and six modes of which two are held out."""
    folder = tmp_path_factory.mktemp("beside")
    path = write_study(folder, mass=0.25, at=0.3)
    study = load_study(path)
    hidden = PointMass(name="hidden", member="arm", position=0.3, mass=0.25)
    true = first_modes(assemble(study.model.with_effect(hidden)), 6).frequency[:6]
    modes = f"\n[modes]\nfrequency = {true.tolist()}\nfrequency_std = 1e-3\nheld_out = [4, 6]\n"
    text = path.read_text(encoding="utf-8").replace('"point_mass", "member_stiffness"', '"point_mass"')
    path.write_text(text + modes, encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("dovetail.report.pictures.can_draw", lambda: False)
        assert main(["run", str(path), "--out", str(folder / "out"), "--quiet"]) == 0
    return folder, true


def test_a_run_tells_modes_that_were_fitted_from_those_it_predicted(ran):
    folder, true = ran
    result = json.loads((folder / "out" / "result.json").read_text(encoding="utf-8"))
    beside = result["measured_modes"]
    assert [m["measured_Hz"] for m in beside["modes"]] == pytest.approx(true.tolist())
    assert [m["held_out"] for m in beside["modes"]] == [False, False, False, True, False, True]
    first, *_, last = beside["error"]
    nominal = load_study(folder / "study.toml").solve_modes(6).frequency[:6]
    assert [m["computed_Hz"][first] for m in beside["modes"]] == pytest.approx(nominal.tolist(), rel=1e-3)
    off = np.log(nominal / true)
    held = np.isin(np.arange(6), [3, 5])
    assert beside["error"][first]["held_out"] == pytest.approx(np.sqrt((off[held] ** 2).mean()), rel=1e-2)
    assert beside["error"][first]["fit"] == pytest.approx(np.sqrt((off[~held] ** 2).mean()), rel=1e-2)
    assert beside["error"][last]["held_out"] < 0.1 * beside["error"][first]["held_out"]


def test_the_report_has_their_table_and_their_errors(ran):
    page = (ran[0] / "out" / "report.html").read_text(encoding="utf-8")
    assert "Measured modes" in page
    assert page.count("<td>predicted</td>") == 2
    assert page.count("<td>fitted</td>") == 4
    assert "held-out modes [%]" in page


def test_a_diagnosis_prints_them(ran, capsys):
    study = ran[0] / "study.toml"
    assert main(["diagnose", str(study), "--json", str(ran[0] / "d.json")]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert sum(line.endswith("predicted, not fitted") for line in lines) == 2
    told = json.loads((ran[0] / "d.json").read_text(encoding="utf-8"))
    assert len(told["measured_modes"]["modes"]) == 6
