"""``dovetail update`` to modes of which some are held out, that have numbers, or that move in a plane."""

import numpy as np
import pytest

from dovetail import load_study
from dovetail.update import update_study
from fem import assemble, first_modes
from tests.frames import MAST

UNCERTAIN = """
[fit]
form = false

[uncertain]
E = 0
rho = 0
[update]
to = ["frequencies"]

[[update.parameters]]
effect = "frame"
parameter = "E:steel"

"""
TRUE = 0.97
"""Modulus over that of the study."""


@pytest.fixture
def true(tmp_path):
    """Return six natural frequencies of the mast whose modulus is lower [Hz]; 1, 3 and 4 are along y."""
    path = tmp_path / "plain.toml"
    path.write_text(MAST, encoding="utf-8")
    model = load_study(path, ("sensors",)).model
    model = model.with_values({("frame", "E:steel"): TRUE * 210e9})
    return first_modes(assemble(model), 6).frequency[:6]


def updated(folder, modes):
    (folder / "study.toml").write_text(MAST + UNCERTAIN + modes, encoding="utf-8")
    result = update_study(load_study(folder / "study.toml"))
    (parameter,) = result.updated.parameters
    return parameter.value / 210e9, result


def test_modes_that_are_held_out_do_not_move_the_update(tmp_path, true):
    wrong = true.copy()
    wrong[[1, 4]] *= 1.1
    value, result = updated(tmp_path, f"[modes]\nfrequency = {wrong.tolist()}\nheld_out = [2, 5]\n")
    assert value == pytest.approx(TRUE, rel=1e-3)
    assert any("are held out; 'dovetail compare'" in note for note in result.notes)


def test_numbers_say_which_modes_were_measured(tmp_path, true):
    some = true[[2, 3, 5]]
    value, _ = updated(tmp_path, f"[modes]\nfrequency = {some.tolist()}\nnumbers = [3, 4, 6]\n")
    assert value == pytest.approx(TRUE, rel=1e-3)


@pytest.mark.parametrize("axis", ["x", "y"])
def test_a_plane_leaves_modes_across_it_out(tmp_path, true, axis):
    plain = load_study(tmp_path / "plain.toml", ("sensors",))
    found = first_modes(assemble(plain.model), 6)
    motion = np.abs(found.shapes).reshape(-1, 6, found.n_modes).max(axis=0)
    along = motion["xyz".index(axis)] > motion[1 - "xyz".index(axis)]
    value, _ = updated(tmp_path, f'[modes]\nfrequency = {true[along].tolist()}\nplane = "{axis}"\n')
    assert value == pytest.approx(TRUE, rel=1e-3)
