"""Studies of two states with FRFs of both: file, commands, results."""

import tomllib
from dataclasses import replace

import numpy as np
import pytest

from dovetail import StudyError, load_study
from dovetail.file import with_paths
from dovetail.found import found_text
from dovetail.pipeline import analyse
from dovetail.report import TableBlock, headline
from dovetail.report.sections import modes
from dovetail.result import frf_arrays
from fem import PointMass
from fem.io import read_frf, write_npz
from tests.frames import write_study
from tests.noise import complex_normal

COMMON = PointMass(name="common", member="post", position=0.31, mass=0.04)
"""In both states: the model does not have it."""
MEASURED = '\n[[measurements]]\nfile = "frf.npz"\n'
BASELINE = '\n[[baseline.measurements]]\nfile = "before.npz"\n'


def two_states(folder, mass, more=""):
    """Write a study of two states, whose difference is a mass on the arm; return its path."""
    write_study(folder, 0, others=(COMMON,))
    (folder / "frf.npz").rename(folder / "before.npz")
    path = write_study(folder, mass, others=(COMMON,))
    frf = read_frf(folder / "frf.npz")
    rng = np.random.default_rng(8)  # the noise of write_study is the same in both
    noise = 0.003 * complex_normal(rng, frf.H.shape)
    write_npz(folder / "frf.npz", replace(frf, H=frf.H * (1 + noise)))
    text = path.read_text(encoding="utf-8").replace(', "member_stiffness"]', "]")
    path.write_text(text + BASELINE + more, encoding="utf-8")
    return path


def test_a_change_hidden_by_a_common_error_is_found_and_written(tmp_path):
    """4 g on the arm, beside 40 g on the post that are in both states and in no model."""
    path, out = two_states(tmp_path, 0.004), tmp_path / "out"
    out.mkdir()
    study = load_study(path)
    result = analyse(study, out, lambda text, done: None)
    d = result.diagnosis
    assert headline(d).startswith(
        "Change since the baseline (before.npz → frf.npz): member arm carries a mass"
    )
    assert result.states is not None
    before, after = result.states
    measured = {m.index: (before[m.nominal_index], after[m.index]) for m in result.modes if m.index in after}
    assert len(measured) >= 3
    for m in result.modes:  # as far as a mass of 4 g moves each mode, whatever the model has wrong in both
        if m.index in measured:
            one, two = measured[m.index]
            assert two / one - 1 == pytest.approx(m.fitted / m.nominal - 1, abs=1e-3)
    (table,) = (b for b in modes._before_and_after(result) if isinstance(b, TableBlock) and "mode" in b.head)
    assert table.head[1:3] == ["before [Hz]", "after [Hz]"]
    assert [f.effect.name for f in d.findings] == ["point_mass:arm"]
    values = {p.name: p.value for p in d.findings[0].parameters}
    assert values["mass"] == pytest.approx(0.004, rel=0.1)
    assert [s.label for s in d.steps[:2]] == ["calibrated on the baseline", "damping fitted"]
    assert d.steps[-1].held_out_db < 0.5 * d.steps[0].held_out_db
    first, *_, last = result.held_out_channels["excitation K"]
    assert last < 0.8 * first
    np.savez(out / "frf.npz", **frf_arrays(d))  # what was compared, as found.toml says
    (out / "found.toml").write_text(found_text(result, out), encoding="utf-8")
    found = load_study(out / "found.toml")
    assert found.changes == ("known point_mass:arm",)
    assert found.error().fit_db == pytest.approx(d.steps[-1].fit_db, rel=0.1)


def test_the_baseline_is_cut_to_the_band_of_the_later_state(tmp_path):
    path = two_states(tmp_path, 0)
    write_npz(tmp_path / "frf.npz", read_frf(tmp_path / "frf.npz").select(band=(20.0, 300.0)))
    study = load_study(path)
    assert study.baseline_frfs.frf.frequency[[0, -1]].tolist() == [20.0, 300.0]
    assert study.baseline is None
    assert study.has_baseline


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (MEASURED, "", r"baseline.measurements: the study has no \[\[measurements\]\], \[modes\] or"),
        (BASELINE, BASELINE + "noise = 1\n", r"baseline.measurements\[1\].noise: unknown key"),
        (BASELINE, BASELINE + "[baseline]\nfrequency = [1.0]\n", "baseline"),
    ],
)
def test_wrong_baselines_are_refused(tmp_path, old, new, words):
    path = two_states(tmp_path, 0)
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(StudyError, match=words):
        load_study(path)


def test_files_of_both_states_are_found_from_another_folder(tmp_path):
    text = '[[measurements]]\nfile = "after.npz"\n\n[[baseline.measurements]]\nfile = "old/before.npz"\n'
    moved = tomllib.loads(with_paths(text, tmp_path, tmp_path / "out"))
    assert moved["measurements"][0]["file"] == "../after.npz"
    assert moved["baseline"]["measurements"][0]["file"] == "../old/before.npz"
