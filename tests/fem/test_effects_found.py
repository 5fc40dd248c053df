"""Effects hidden in simulated FRFs on a finer mesh, with noise and wrong moduli, are found."""

import numpy as np
import pytest

from benchmarks.hidden.cases import make_case
from fem import (
    FRF,
    Damping,
    Frame,
    Material,
    MemberProperties,
    Mesh,
    Model,
    Section,
    Support,
    assemble,
    compute_frf,
    parameter_values,
)
from fem.effects import SupportFlexibility
from tests.noise import complex_normal
from updating import EFFECT, Measurement, Nuisance, Sensor, diagnose
from updating.diagnosis import BASIS_LIMIT_DB


@pytest.mark.parametrize(
    ("kind", "seed", "rivals"),
    [
        pytest.param("joint_fractional", 4, ("joint_stiffness",), marks=pytest.mark.slow),
        pytest.param("joint_offset", 3, ("joint_mass", "point_mass"), marks=pytest.mark.slow),
    ],
)
def test_an_effect_of_a_joint_is_found_beside_its_rivals(kind, seed, rivals):
    case = make_case(seed, "cross", kind)
    found = diagnose(case.model, [case.measurement], case.nuisances, kinds=[kind, *rivals], n_lines=60)
    assert found.verdict == EFFECT
    first = found.findings[0]
    assert first.effect.name == case.hidden.name
    assert found.basis_db < BASIS_LIMIT_DB
    truth = parameter_values(case.hidden)
    for p in first.parameters:
        assert p.value == pytest.approx(truth[p.name], rel=0.1, abs=5 * p.std)


@pytest.mark.parametrize("model_error", [0.0, 0.3])
def test_a_support_that_is_loose_is_found_though_its_stiffness_may_be_anything(model_error):
    steel, bar = Material("steel", 210e9, 7850.0), Section.rectangle(0.02, 0.01)
    mesh = Mesh.from_lines([[0, 0, 0], [1, 0, 0]], [[0, 1]], {"beam": [0]}).split(16)
    frame = Frame(members={"beam": MemberProperties(steel, bar)})
    model = Model(mesh, (frame, Support(name="foot", point=0)), Damping.modal(0.01))
    points = mesh.member_points("beam")[[6, 16]]
    sensors = tuple(
        Sensor(name=f"s{p}", point=mesh.points[p], direction=np.array([0, 0, 1.0])) for p in points
    )
    loose = SupportFlexibility(name="loose", supports=("foot",), direction="ry", stiffness=0.1)
    f, at = np.linspace(2.0, 400.0, 400), [(int(p), "z") for p in points]
    true = model.with_mesh(mesh.split(4)).with_effect(loose)
    H = compute_frf(assemble(true), f, at, at[1:], kind="accelerance").H
    rng = np.random.default_rng(3)
    H = H * (1 + 0.02 * complex_normal(rng, H.shape))
    names = [s.name for s in sensors]
    measured = Measurement(FRF.from_arrays(f, H, "accelerance", names, names[1:]), sensors, sensors[1:])
    found = diagnose(
        model,
        [measured],
        (Nuisance("frame", "E:steel", 0.02),),
        kinds=["support_flexibility"],
        model_error=model_error,
    )
    assert found.verdict == EFFECT
    (finding,) = found.findings
    assert (finding.effect.kind, finding.effect.direction) == ("support_flexibility", "ry")
    (stiffness,) = finding.parameters
    assert stiffness.std > stiffness.value / 3  # the FRFs no longer change with it
