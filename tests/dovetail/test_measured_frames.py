"""Studies of measured frames: their nominal models against closed forms, and what held-out modes say."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import eigh

from dovetail import load_study
from dovetail.modes_pipeline import diagnose_study_modes
from fem import assemble, solve_modes


def chain(stiffness, mass):
    """Return the natural frequencies of masses on springs, the first of which is held [Hz]."""
    after = np.append(stiffness[1:], 0.0)
    K = np.diag(stiffness + after) - np.diag(stiffness[1:], 1) - np.diag(stiffness[1:], -1)
    return np.sqrt(eigh(K, np.diag(mass), eigvals_only=True)) / (2 * np.pi)


FOUR = chain(np.full(4, 10 * 4.4482216 / 0.0254), np.full(4, 12.060 * 0.45359237))
STOREYS = "1155 1092 1073 1028 1028 990 963 938 876 840 824 788 712 660 619 562 491 363"
EIGHTEEN = chain(
    1e5 * np.array(STOREYS.split(), dtype=float),
    1e3 / 9.8 * np.array([208] * 11 + [206] * 6 + [202]),
)


@pytest.mark.parametrize(("name", "frequency"), [("four-storeys", FOUR), ("eighteen-storeys", EIGHTEEN)])
def test_storeys_whose_floors_do_not_turn_are_masses_on_springs(root, name, frequency):
    study = load_study(root / "examples" / name / "study.toml")
    modes = solve_modes(assemble(study.model), n=4)
    np.testing.assert_allclose(modes.frequency[:3], frequency[:3], rtol=1e-3)
    assert study.modes is not None
    assert study.modes.modes.n_modes >= 3


@pytest.mark.slow
def test_two_modes_leave_the_storey_open_and_four_name_it(root):
    """As docs/measured-frames.md says of the four storeys."""
    study = load_study(root / "examples" / "four-storeys" / "study.toml")
    open_ = diagnose_study_modes(study)
    assert not open_.sure
    assert open_.explanations[0].label == "member stiffness at member storey1"
    m = open_.modes
    assert m.errors(m.found, True) > m.errors(m.nominal, True)
    assert study.modes is not None
    named = diagnose_study_modes(replace(study, modes=replace(study.modes, held_out=())))
    assert named.sure
    (effect,) = named.found
    assert effect.where == "member storey4"
    assert effect.parameters()[0].value == pytest.approx(0.747, abs=0.03)
