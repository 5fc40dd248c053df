"""Modes of masses on springs that nearly massless, stiff bars connect: rounding of K exceeds ω²M."""

import numpy as np
import pytest

from fem import AddedMass, Frame, Material, MemberProperties, Mesh, Model, Section, assemble, solve_modes
from fem.effects import GroundSpring
from tests.frames import FLAT, fix

STIFF = Material("stiff", 2.1e13, 1e-6)


@pytest.mark.parametrize("pieces", [1, 4, 20, 60])
@pytest.mark.parametrize("held", [False, True])
@pytest.mark.parametrize(("mass", "k"), [(1.0, 1e2), (100.0, 1e2), (100.0, 1e4)])
@pytest.mark.parametrize("section", [FLAT, Section.rectangle(0.3, 0.3)])
def test_masses_on_springs_beneath_a_stiff_bar(pieces, held, mass, k, section):
    """Both masses move at √(k/m): the bar translates and tilts, and hardly bends."""
    mesh = Mesh.from_lines([[0, 0, 0], [3.0, 0, 0]], [[0, 1]], {"bar": [0]}).split(pieces)
    effects = [Frame(members={"bar": MemberProperties(STIFF, section)})]
    for p in (0, 1):
        effects.append(AddedMass(name=f"mass{p}", point=p, mass=mass))
        effects.append(
            GroundSpring(name=f"spring{p}", point=p, place="end", direction="z", stiffness=k, reference=k)
        )
    effects += [fix(0, ("x", "y", "rx", "rz")), fix(1, ("y",))] if held else []
    found = solve_modes(assemble(Model(mesh, tuple(effects))), n=12)
    assert found.n_rigid == (0 if held else 4)
    first = found.omega[found.n_rigid : found.n_rigid + 2]
    np.testing.assert_allclose(first, np.sqrt(k / mass), rtol=1e-6)
    assert (found.frequency >= 0).all()
