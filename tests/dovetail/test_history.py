"""``dovetail history``: states after a baseline, and what has changed in each."""

import json
import shutil

import numpy as np
import pytest

from dovetail import load_study, main
from dovetail.modes_history import diagnose_history, shifts
from fem import AddedMass, assemble, first_modes
from tests.frames import MAST
from tests.studies import study_file
from updating import ModeTargets
from viz import plot_history


@pytest.fixture
def study(root, tmp_path):
    return shutil.copytree(root / "examples" / "before-and-after", tmp_path / "s") / "study.toml"


def with_states(study, *tables):
    text = study.read_text(encoding="utf-8")
    study.write_text(text + "".join(f"\n[[states]]\n{t}\n" for t in tables), encoding="utf-8")
    return study


def test_states_are_read_in_their_order_with_their_names(study):
    with_states(
        study, 'name = "spring"\nfrequency = [19.5, 29.4]', "frequency = [19.0]\nfrequency_std = 0.01"
    )
    states = load_study(study).states
    assert [s.name for s in states] == ["spring", "state 2"]
    assert states[0].modes.modes.frequency.tolist() == [19.5, 29.4]
    assert states[1].modes.frequency_std.tolist() == [0.01]


def test_shifts_are_of_the_baselines_modes_and_variances_add():
    before = ModeTargets.of(np.array([10.0, 20.0, 30.0]), 3e-4)
    after = ModeTargets.of(np.array([9.9, 30.3]), 4e-4)
    shift, std = shifts(before, after)
    np.testing.assert_allclose(shift, [np.log(0.99), np.nan, np.log(1.01)])
    np.testing.assert_allclose(std, [5e-4, np.nan, 5e-4])


def test_the_picture_has_a_row_for_each_change_and_a_place_for_each_state():
    changes = [
        [],
        [("point mass, member arm", 0.9)],
        [("point mass, member arm", 0.4), ("crack, member mast", 0.4)],
    ]
    shift = np.array([[0.0, 0.0], [-0.01, -0.02], [-0.01, np.nan]])
    figure = plot_history(["a", "b", "c"], [10.0, 20.0], shift, np.full((3, 2), 1e-3), changes)
    low = figure.axes[1]
    assert [t.get_text() for t in low.get_yticklabels()] == ["point mass, member arm", "crack, member mast"]
    assert [t.get_text() for t in low.get_xticklabels()] == ["baseline", "a", "b", "c"]
    filled = [line.get_markerfacecolor() != "none" for line in low.get_lines()]
    assert filled == [True, False, False]


@pytest.mark.parametrize(
    ("tables", "words"),
    [
        ((), "it has no [[states]]; a history needs a baseline and later states"),
        (("name = 'x'",), "states[1]: give either file, with frequencies and shapes, or frequency"),
        (("frequency = [1.0]\nfile = 'a.npz'",), "states[1]: give either file"),
        (("file = 'none.npz'",), "states[1].file: there is no file"),
        (("frequency = [1.0]\nwhen = 3",), "states[1].when: unknown key"),
        (("frequency = [1.0]\nsince = 'May'",), "states[1].since: there is no earlier state 'May'"),
        (("name = 'a'\nfrequency = [1.0]",) * 2, "states[2].name: two states have the name 'a'"),
    ],
)
def test_histories_that_cannot_be_made_are_refused(study, capsys, tables, words):
    with_states(study, *tables)
    assert main(["history", str(study)]) == 2
    assert words in capsys.readouterr().err


def test_a_study_without_a_baseline_has_no_history(root, capsys):
    assert main(["history", str(root / "examples" / "three-storeys" / "study.toml")]) == 2
    assert "it has no [baseline]; a history needs" in capsys.readouterr().err


def in_a_row(folder, *states):
    """Return a mast and its history, with masses at tip and middle, each state since the one before."""
    rng = np.random.default_rng(1)
    lines = f"""{MAST}
[candidates]
kinds = ["point_mass"]

[fit]
model_error = 0.0
"""
    true = load_study(study_file(folder, lines)).model
    points = [int(np.argmin(np.abs(true.mesh.points[:, 2] - z))) for z in (1.0, 0.5)]

    def state(*masses):
        more = (AddedMass(name=f"m{p}", point=p, mass=m) for p, m in zip(points, masses, strict=True) if m)
        f = first_modes(assemble(true.with_effect(*more)), 8).frequency[:8]
        return f"frequency = {(f * (1 + 2e-4 * rng.standard_normal(8))).tolist()}\nfrequency_std = 0.0002\n"

    text, since = f"{lines}\n[baseline]\n{state(0, 0)}", ""
    for name, masses in zip(("spring", "summer", "autumn"), states, strict=True):
        text += f'\n[[states]]\nname = "{name}"\n{state(*masses)}' + f'since = "{since}"\n' * bool(since)
        since = name
    return true, diagnose_history(load_study(study_file(folder, text)), lambda text, done: None)


def test_of_states_in_a_row_each_change_is_told_once_when_it_came(tmp_path):
    """Compared with the baseline the last state would have two."""
    true, history = in_a_row(tmp_path, (0.1, 0), (0.1, 0), (0.1, 0.1))
    spring, summer, autumn = history.states
    (tip,), (middle,) = spring.diagnosis.found, autumn.diagnosis.found
    assert (tip.mass, middle.mass) == (pytest.approx(0.1, rel=0.05), pytest.approx(0.1, rel=0.05))
    assert [np.ravel(m.locations(true))[2] for m in (tip, middle)] == pytest.approx([1.0, 0.5], abs=0.02)
    assert summer.answer == "nothing"
    assert [e.mass for e in autumn.has] == [tip.mass, middle.mass]
    assert "compared with" in str(history.printed()[-1])


def test_what_grows_from_state_to_state_is_told_by_how_much(tmp_path):
    _, history = in_a_row(tmp_path, (0.1, 0), (0.16, 0), (0.16, 0))
    spring, summer, autumn = history.states
    (first,), (more,) = spring.diagnosis.found, summer.diagnosis.found
    assert first.name == more.name
    assert (first.mass, more.mass) == (pytest.approx(0.1, rel=0.05), pytest.approx(0.06, rel=0.1))
    assert autumn.answer == "nothing"


@pytest.mark.slow
def test_the_state_with_the_mass_is_found_and_the_one_without_is_not(study, capsys):
    text = study.read_text(encoding="utf-8")
    first, second = (
        text[text.index(table) :].split("frequency = ")[1].splitlines()[0]
        for table in ("[baseline]", "[modes]")
    )
    with_states(
        study,
        f'name = "spring"\nfrequency = {first}\nfrequency_std = 0.0002',
        f'name = "autumn"\nfrequency = {second}\nfrequency_std = 0.0002',
    )
    picture, result = study.parent / "p.png", study.parent / "r.json"
    assert main(["history", str(study), "--picture", str(picture), "--json", str(result)]) == 0
    spring, autumn = json.loads(result.read_text(encoding="utf-8"))["states"]
    assert spring["answer"] == "nothing"
    assert autumn["answer"].startswith("point mass at member arm at 0.299 m")
    assert np.allclose(spring["shift"], 0)
    assert picture.stat().st_size > 10_000
    assert "autumn" in capsys.readouterr().out
