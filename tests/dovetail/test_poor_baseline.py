"""A study of two states whose model lacks something in both: what is written and said of it."""

import json

import numpy as np
import pytest

from dovetail import load_study, main
from fem import PointMass, assemble, first_modes

N_MODES, NOISE = 6, 2e-4
STUDY = """
[study]
name = "beam"
[mesh]
plane = "xz"
element_size = 0.02 # the truth is of the same mesh
[points]
a = [0.0, 0.0, 0.0]
b = [0.7, 0.0, 0.0]
c = [1.1, 0.0, 0.0]
[members]
field = { from = "a", to = "b" }
overhang = { from = "b", to = "c" }
[materials.steel]
E = 210e9
rho = 7850.0
[sections.bar]
shape = "rectangle"
b = 0.04
h = 0.015
[[supports]]
name = "a"
point = "a"
fixed = ["x", "z"]
[[supports]]
name = "b"
point = "b"
fixed = ["z"]
[uncertain]
E = 0.03
[fit]
form = false
[candidates]
kinds = ["point_mass", "ground_spring"]
"""


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    """Return the folder of a run: foot a is held about y in both states, and 0.1 kg come later."""
    folder, rng = tmp_path_factory.mktemp("poor"), np.random.default_rng(1)
    path = folder / "study.toml"
    path.write_text(
        STUDY + f"[modes]\nfrequency = {list(range(10, 16))}\nfrequency_std = {NOISE}\n", encoding="utf-8"
    )
    study = load_study(path)
    held = next(e for e in study.candidates(["ground_spring"]) if e.name == "ground_spring:field.1.ry")
    before = study.model.with_effect(held.with_values(stiffness=2000.0))
    after = before.with_effect(PointMass(name="later", member="overhang", position=0.25, mass=0.1))
    tables = []
    for name, model in (("baseline", before), ("modes", after)):
        f = first_modes(assemble(model), N_MODES).frequency[:N_MODES]
        f = f * (1 + NOISE * rng.standard_normal(N_MODES))
        tables.append(f"[{name}]\nfrequency = {f.tolist()}\nfrequency_std = {NOISE}\n")
    path.write_text(STUDY + "".join(tables), encoding="utf-8")
    assert main(["run", str(path), "--out", str(folder / "out")]) == 0
    return folder / "out"


@pytest.mark.slow
def test_the_change_is_found_beside_the_cause_and_both_are_written(out):
    result = json.loads((out / "result.json").read_text(encoding="utf-8"))
    assert [e["name"] for e in result["effects"]] == ["point_mass:overhang"]
    baseline = result["baseline"]
    assert baseline["stands"] is False
    assert max(abs(m["missed_std"]) for m in baseline["modes"]) > 10
    assert sum(c["probability"] for c in baseline["causes"]) == pytest.approx(1)
    (cause,) = baseline["causes"][0]["effects"]
    assert cause["name"] == "common ground_spring:field.1.ry"
    assert cause["parameters"][0]["value"] == pytest.approx(2000, rel=0.1)
    assert any(n.startswith("the baseline is poor") for n in result["notes"])
    report = (out / "report.html").read_text(encoding="utf-8")
    assert "The baseline is poor" in report
    assert "missed by [σ]" in report


@pytest.mark.slow
def test_the_cause_is_an_effect_of_both_states_in_what_was_found(out):
    study = load_study(out / "found.toml")
    assert {e.name for e in study.model.effects} >= {"known ground_spring:field.1.ry"}
    assert study.changes == ("known point_mass:overhang",)
