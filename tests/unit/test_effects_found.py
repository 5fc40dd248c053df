"""Effects hidden in simulated FRFs on a finer mesh, with noise and wrong moduli, are found."""

import pytest

from fem.model import parameter_values
from tests.hidden.cases import make_case
from updating import EFFECT, diagnose
from updating.diagnosis import BASIS_LIMIT_DB


@pytest.mark.parametrize(
    ("kind", "seed", "rivals"),
    [
        ("joint_fractional", 4, ("joint_stiffness",)),
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
