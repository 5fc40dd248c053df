"""Six structures, each with another effect: what a report states is what ``compare`` prints of its model."""

import json
from dataclasses import replace

import numpy as np
import pytest

from dovetail import load_study, main
from dovetail.desk import by_hand, live_model
from dovetail.file import pieces_of
from dovetail.found import found_text
from dovetail.pipeline import analysed
from dovetail.result import FOUND, FRFS, frf_arrays, result_dict
from fem.io import write_npz
from tests.dovetail.test_effects import JOINTED, candidates
from tests.frames import STUDY, measured_frf
from tests.studies import study_file
from updating import Fault
from updating.live import Hypothesis, fit_all

MEMBER = """[members.{name}]
from = "{start}"
to = "{stop}"
section = {{ shape = "rectangle", b = 0.03, h = 0.012 }}
elements = 6
"""
SENSOR = """[[sensors]]
member = "{member}"
position = {at}
direction = "{direction}"
name = "{name}"
"""
MATERIAL = "[materials.steel]\nE = 210e9\nrho = 7850\n[damping]\nmodal = 0.01\n"
PORTAL = (
    "[points]\na = [0, 0, 0]\nb = [0, 0, 0.5]\nc = [0.4, 0, 0.5]\nd = [0.4, 0, 0]\n"
    + "".join(MEMBER.format(name=n, start=n[0], stop=n[1]) for n in ("ab", "bc", "cd"))
    + MATERIAL
    + '[[supports]]\npoint = "a"\n[[supports]]\npoint = "d"\nfixed = "translations"\n'
    + SENSOR.format(member="ab", at=0.3, direction="x", name="A")
    + SENSOR.format(member="bc", at=0.12, direction="z", name="B")
    + SENSOR.format(member="cd", at=0.2, direction="x", name="C")
    + '[[excitations]]\nsensor = "A"\n[[excitations]]\nsensor = "B"\n'
)
MAST = (
    "[points]\nfoot = [0, 0, 0]\ntip = [0, 0, 1]\n"
    + MEMBER.format(name="mast", start="foot", stop="tip")
    + MATERIAL
    + '[[supports]]\npoint = "foot"\n'
    + SENSOR.format(member="mast", at=0.45, direction="x", name="A")
    + SENSOR.format(member="mast", at=0.75, direction="x", name="B")
    + SENSOR.format(member="mast", at=1.0, direction="x", name="C")
    + '[[excitations]]\nsensor = "C"\n'
)
TEE = (
    "[points]\nfoot = [0, 0, 0]\ntop = [0, 0, 0.6]\nleft = [-0.35, 0, 0.6]\nright = [0.25, 0, 0.6]\n"
    + "".join(
        MEMBER.format(name=n, start=a, stop=b)
        for n, a, b in (("post", "foot", "top"), ("short", "top", "right"), ("long", "top", "left"))
    )
    + MATERIAL
    + '[[supports]]\npoint = "foot"\n'
    + SENSOR.format(member="post", at=0.4, direction="x", name="A")
    + SENSOR.format(member="short", at=0.2, direction="z", name="B")
    + SENSOR.format(member="long", at=0.3, direction="z", name="C")
    + '[[excitations]]\nsensor = "C"\n'
)


def study_of(folder, text, name, values, gain):
    """Return a study, with FRFs of its model with an effect and a sensor that reads too much."""
    file = study_file(folder, text)
    study = load_study(file)
    hidden = [e.with_values(**values) for e in candidates(study) if e.name == name]
    assert len(hidden) == (name != "")
    model = study.model.with_effect(*hidden)
    frf = measured_frf(study, model, np.arange(4.0, 300.0, 2.0))
    gains = np.ones((len(study.sensors), 1))
    gains[0] = gain
    write_npz(folder / "frf.npz", replace(frf, H=gains * frf.H))
    file.write_text(text + '\n[[measurements]]\nfile = "frf.npz"\n', encoding="utf-8")
    return load_study(file), hidden


@pytest.mark.parametrize(
    ("text", "name", "values", "form", "gain"),
    [
        (JOINTED, "joint_stiffness:bolt.ry", {"stiffness": 900.0}, False, 1.0),
        (STUDY, "point_mass:arm", {"mass": 0.25, "position": 0.3}, False, 1.0),
        # a stretch within elements that are cut: with the loss known they would be cut into others
        (MAST, "stiffness_loss:mast", {"loss": 0.5, "position": 0.3}, False, 1.0),
        (PORTAL, "ground_spring:cd.2.ry", {"stiffness": 400.0}, False, 1.0),
        (TEE, "end_release:long.1.ry", {"compliance": 2e-4}, True, 1.0),
        (
            PORTAL.replace('"translations"', '"all"').replace("modal = 0.01", "modal = 0.02"),
            "",
            {},
            False,
            1.2,
        ),
    ],
    ids=["joint", "mass", "loss", "ground", "corner", "gain and damping"],
)
def test_a_report_states_what_compare_prints(tmp_path, monkeypatch, text, name, values, form, gain):
    monkeypatch.setattr("dovetail.pipeline.locate", lambda *_: None)  # half of the time, and stated elsewhere
    study, hidden = study_of(tmp_path, text, name, values, gain)
    live = live_model(study)
    h = Hypothesis.nominal(live.problem)
    for effect in hidden:
        h = h.with_effect(effect)
    h = live.with_form(h) if form else h
    if gain != 1:
        h = h.with_fault(Fault("sensor_gain", study.sensors[0].name, gain, 0.0))
    h = fit_all(live, h, lambda text, done: None)
    found = tmp_path / "out" / FOUND
    found.parent.mkdir()
    d = by_hand(study, live, replace(h, effects=(), fit=None), h, 0.0)
    result = analysed(study, d, found.parent, 0.0)
    np.savez(found.with_name(FRFS), **frf_arrays(d))
    found.write_text(found_text(result, found.parent), encoding="utf-8")
    assert main(["compare", str(found), "--quiet", "--json", str(tmp_path / "c.json")]) == 0
    printed = json.loads((tmp_path / "c.json").read_text(encoding="utf-8"))
    stated = result_dict(result)["error_db"][-1]
    assert stated["fit"] < 0.3
    assert printed["error_db"] == pytest.approx(stated["fit"], abs=0.02)
    assert printed["held_out_db"] == pytest.approx(stated["held_out"], abs=0.02)


def test_a_choice_of_values_says_in_words_what_its_pieces_may_be(tmp_path):
    for pieces in (2.5, -1, 99, [1, 2]):
        np.savez(tmp_path / "c.npz", pieces=np.array(pieces))
        with pytest.raises(ValueError, match=r"c\.npz: pieces must be a whole number from 0 to 4"):
            pieces_of(tmp_path / "c.npz")
