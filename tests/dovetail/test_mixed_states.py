"""Two states of which one has FRFs and the other modes: the modes are identified in the FRFs."""

import json

import numpy as np
import pytest

from dovetail import StudyError, load_study, main
from dovetail.file import has_modes_alone
from dovetail.modes_pipeline import by_modes, mode_problem
from fem import FRF, PointMass, assemble, compute_frf, first_modes
from fem.io import write_npz
from tests.frames import STUDY
from tests.noise import complex_normal
from tests.studies import study_file
from updating import sensor_rows

SEEN = [0, 2]
"""Of the first four modes, those in the plane of the sensors and the forces."""
FRFS = '\n[[{}measurements]]\nfile = "frf.npz"\n'


@pytest.fixture(scope="module")
def states(tmp_path_factory):
    """Return a folder with the FRFs of the first state, and true frequencies of both: 0.1 kg come later."""
    folder = tmp_path_factory.mktemp("states")
    text = STUDY.replace('"point_mass", "member_stiffness"', '"point_mass"').split("[fit]")[0]
    text += "[fit]\nmodel_error = 0.0\n"  # beams, so that no form has to take up the mass that comes later
    (folder / "plain.toml").write_text(text, encoding="utf-8")
    study = load_study(folder / "plain.toml", ("sensors",))
    later = study.model.with_effect(PointMass(name="hidden", member="arm", position=0.3, mass=0.1))
    lines = np.arange(4.0, 130.0, 0.25)
    rows = [sensor_rows(study.model, part) for part in (study.sensors, study.excitations)]
    H = compute_frf(assemble(study.model), lines, *rows, "accelerance").H
    rng = np.random.default_rng(3)
    H = H + 1e-3 * np.abs(H).max(axis=0) * complex_normal(rng, H.shape)
    names = [[s.name for s in part] for part in (study.sensors, study.excitations)]
    write_npz(folder / "frf.npz", FRF.from_arrays(lines, H, "accelerance", *names))
    f = [first_modes(assemble(m), 4).frequency[:4] for m in (study.model, later)]
    return folder, text, f


def written(states, more):
    folder, text, _ = states
    return study_file(folder, text + more)


def table(name, frequency):
    return f"\n[{name}]\nfrequency = {frequency.tolist()}\nfrequency_std = 2e-4\n"


def test_modes_of_a_baseline_are_identified_in_its_frfs(states):
    path = written(states, table("modes", states[2][1]) + FRFS.format("baseline."))
    study = load_study(path)
    assert has_modes_alone(study)
    both = by_modes(study)
    found, true = both.baseline.modes.frequency, states[2][0][SEEN]
    assert found == pytest.approx(true, rel=2e-4)
    assert (both.baseline.frequency_std >= 2e-4).all()  # no better than those of the other state
    assert "2 modes from" in both.measured_notes[-1]
    assert by_modes(both) is both


@pytest.mark.slow
def test_a_change_is_found_and_written_from_frfs_before_and_frequencies_after(states, capsys):
    path = written(states, table("modes", states[2][1]) + FRFS.format("baseline."))
    out = states[0] / "out"
    assert main(["run", str(path), "--out", str(out)]) == 0
    assert "were identified in its FRFs, because the other state has modes" in capsys.readouterr().out
    result = json.loads((out / "result.json").read_text(encoding="utf-8"))
    assert result["verdict"] == "effect"
    assert result["effects"][0]["name"] == "point_mass:arm"
    again = load_study(out / "found.toml")
    assert again.changes == ("known point_mass:arm",)
    problem = mode_problem(again)
    assert problem.computed(problem.nominal()).frequency == pytest.approx(
        [m["found_Hz"] for m in result["modes"]], rel=2e-4
    )


def test_a_baseline_of_modes_is_compared_with_the_modes_of_later_frfs(states):
    later = table("baseline", states[2][1][SEEN]) + f"numbers = {[n + 1 for n in SEEN]}\n"
    study = load_study(written(states, later + FRFS.format("")))
    assert has_modes_alone(study)
    problem = mode_problem(study)
    shift = np.log(states[2][0] / states[2][1])[SEEN]  # the FRFs are those without the mass
    computed = problem.computed(problem.nominal()).frequency
    assert np.log(problem.targets.frequency / computed) == pytest.approx(shift, abs=5e-4)


def test_what_is_not_used_is_said(states):
    modes, frfs = table("modes", states[2][1]), FRFS.format("")
    both = load_study(written(states, modes + frfs + table("baseline", states[2][0])))
    assert has_modes_alone(both)
    assert any(w.startswith("the FRFs of [[measurements]] are not used") for w in both.warnings)
    both = load_study(written(states, modes + frfs + FRFS.format("baseline.")))
    assert not has_modes_alone(both)
    assert any(w.startswith("[modes] are not used") for w in both.warnings)


def test_a_history_takes_a_baseline_of_frfs(states, capsys):
    later = f'\n[[states]]\nname = "later"\nfrequency = {states[2][1].tolist()}\nfrequency_std = 2e-4\n'
    path = written(states, later + FRFS.format("baseline."))
    assert main(["history", str(path), "--picture", str(states[0] / "h.png")]) == 0
    out = capsys.readouterr().out
    assert "point mass at member arm" in out
    assert (states[0] / "h.png").stat().st_size > 10_000


def test_a_baseline_of_frfs_alone_is_refused(states):
    with pytest.raises(
        StudyError, match=r"the study has no \[\[measurements\]\], \[modes\] or \[\[states\]\]"
    ):
        load_study(written(states, FRFS.format("baseline.")))
