"""The effect in CONTRIBUTING.md is one file in fem/effects: it keeps the contract and is found."""

import re
import sys
from types import SimpleNamespace

import numpy as np
import pytest

import fem.effects
from docs.make.effects import list_of_kinds, table_of_parameters
from dovetail.report import words
from fem import (
    FRF,
    Damping,
    Frame,
    Material,
    MemberProperties,
    Mesh,
    Model,
    Role,
    Section,
    Support,
    assemble,
    compute_frf,
)
from updating import EFFECT, Measurement, Nuisance, Sensor, diagnose, propose
from viz.markers import COLOURS, SHAPES

STEP = 1e-200


@pytest.fixture(scope="module")
def kind(root, tmp_path_factory):
    """Put the text's effect where an effect belongs."""
    text = (root / "CONTRIBUTING.md").read_text(encoding="utf-8")
    name = re.search(r"`fem/effects/(\w+)\.py`:\n", text)[1]
    (code,) = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    folder = tmp_path_factory.mktemp("effects")
    (folder / f"{name}.py").write_text(code, encoding="utf-8")
    fem.effects.__path__.append(str(folder))
    yield name
    fem.effects.__path__.remove(str(folder))
    del sys.modules[f"fem.effects.{name}"]


@pytest.fixture(scope="module")
def model():
    mesh = Mesh.from_lines([[0, 0, 0], [0.8, 0, 0]], [[0, 1]], {"beam": [0]}).refined(counts={"beam": 16})
    steel = MemberProperties(Material("steel", E=210e9, rho=7850.0), Section.rectangle(b=0.04, h=0.01))
    return Model(mesh, (Frame(members={"beam": steel}), Support(name="wall", point=0)), Damping.modal(0.01))


def test_it_proposes_candidates(kind, model):
    assert kind in fem.effects.candidate_kinds()
    candidates = propose(model, [kind])
    assert [e.where for e in candidates] == ["point 0", "point 1"]
    assert len({e.name for e in candidates}) == len(candidates)


def test_it_has_a_role_a_sentence_a_marker_and_a_row(kind, model):
    effect = propose(model, [kind])[1]
    assert effect.role is Role.MASS
    finding = SimpleNamespace(
        effect=effect, parameters=[SimpleNamespace(name="inertia", value=1e-4)], alternatives=()
    )
    assert words.sentence([finding]) == "Point 1 carries a rotary inertia that the model lacks."
    assert effect.marker.shape in SHAPES
    assert effect.marker.colour in COLOURS
    row = f"| `{kind}` | `inertia` [kg·m²] | a rotary inertia at a member's end |"
    assert row in table_of_parameters().splitlines()
    assert f"`{kind}`" in list_of_kinds()


def test_absent_means_no_change(kind, model):
    without = assemble(model)
    for effect in propose(model, [kind]):
        absent = effect.with_values(**{p.name: p.absent for p in effect.parameters()})
        system = assemble(model.with_effect(absent))
        assert abs(system.K - without.K).max() == 0
        assert abs(system.M - without.M).max() == 0


def test_matrices_are_symmetric_and_derivatives_exact(kind, model):
    for effect in propose(model, [kind]):
        for point in effect.starts(lambda key: 1e6):
            for p in effect.parameters():
                assert p.lower <= point[p.name] <= p.upper
                (here,) = effect.with_values(**point).contribute(model)
                (there,) = effect.with_values(**{p.name: 2 * point[p.name]}).contribute(model)
                (step,) = effect.with_values(**{p.name: point[p.name] + 1j * STEP}).contribute(model)
                assert np.array_equal(here.M, np.swapaxes(here.M, 1, 2))
                assert np.imag(step.M) / STEP * point[p.name] == pytest.approx(there.M - here.M)


def test_it_is_found_where_it_was_hidden(kind, model):
    """1e-4 kg·m² at the free end of a cantilever; 1 % noise, and a modulus that the model does not know."""
    points = model.mesh.member_points("beam")[[5, 8, 11, 16]]
    up = np.array([0.0, 0, 1])
    sensors = tuple(Sensor(f"s{p}", model.mesh.points[p], up) for p in points)
    hidden = next(e for e in propose(model, [kind]) if e.where == "point 1").with_values(inertia=1e-4)
    truth = (
        model.with_mesh(model.mesh.split(2)).with_values({("frame", "E:steel"): 207e9}).with_effect(hidden)
    )
    dofs = [(p, "z") for p in points]
    exact = compute_frf(assemble(truth), np.arange(3.0, 900.0, 3.0), dofs, dofs[-1:])
    random = np.random.default_rng(2).standard_normal((2, *exact.H.shape))
    H = exact.H * (1 + 0.01 * (random[0] + 1j * random[1]))
    frf = FRF.from_arrays(exact.frequency, H, exact.kind, [s.name for s in sensors], [sensors[-1].name])
    measurement = Measurement(frf, sensors, sensors[-1:])
    found = diagnose(
        model,
        [measurement],
        [Nuisance("frame", "E:steel", 0.02)],
        kinds=[kind, "point_mass", "stiffness_loss"],
    )
    assert found.verdict == EFFECT
    (finding,) = found.findings
    assert finding.effect.name == hidden.name
    assert finding.parameters[0].value == pytest.approx(1e-4, rel=0.05)
