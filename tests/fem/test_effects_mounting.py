"""Connections that act elsewhere on a member: as the model has it where it was built so."""

from dataclasses import replace

import numpy as np
import pytest

from fem import assemble, solve_modes
from fem.effects.foot_shift import FootShift
from fem.effects.joint import Joint
from fem.effects.joint_complex_stiffness import JointComplexStiffness
from fem.effects.joint_hole import JointHole
from fem.effects.part_shift import PartShift
from fem.effects.support_shift import SupportShift
from tests.frames import FLAT, STEEL, beam, cross_beam, fix

K = np.diag([2e6, 3e6, 4e6, 500.0, 700.0, 900.0])


def frequencies(model, n=9):
    return solve_modes(assemble(model), n=n).frequency


def footed(model, point, at):
    return model.with_effect(Joint(name="foot", point1=point, location=np.array([at, 0.0, -0.01]), K=K))


def point_at(model, s):
    return int(np.argmin(np.abs(model.mesh.points[:, 0] - s)))


def test_a_foot_that_is_shifted_is_one_at_another_point():
    model = beam(10)
    here = footed(model, point_at(model, 0.3), 0.3)
    (shift,) = FootShift.propose(here)
    moved = here.with_effect(shift.with_values(amount=0.1))
    there = footed(model, point_at(model, 0.4), 0.4)
    np.testing.assert_allclose(frequencies(moved), frequencies(there), rtol=1e-6)


def test_a_part_that_is_not_shifted_and_a_hole_on_the_line_change_nothing():
    model = cross_beam()
    before = frequencies(model, 12)
    found = JointHole.propose(model) + PartShift.propose(model)
    assert {type(e) for e in found} == {JointHole, PartShift}
    for e in found:
        after = frequencies(model.with_effect(e), 12)
        np.testing.assert_allclose(after[6:], before[6:], rtol=1e-9)


def test_a_hole_on_the_side_of_a_foot_is_a_lever_to_it():
    model = beam(10)
    point = point_at(model, 0.3)
    here = footed(model, point, 0.3)
    across = np.array([0.0, 1.0, 0.0])
    hole = JointHole(
        name="hole", joint="foot", side=1, member="beam", at=0.3, amount=0.006, lower=-1, upper=1,
        scale=0.01, direction="y", across=across,
    )  # fmt: skip
    joint = here.effect("foot")
    there = model.with_effect(replace(joint, location=joint.location + 0.006 * across))
    np.testing.assert_allclose(frequencies(here.with_effect(hole)), frequencies(there), rtol=1e-6)


def test_a_clamp_further_along_leaves_two_cantilevers():
    """f = (1.8751)² / (2π L²) √(E I / ρ A) of the longer part."""
    model = beam(20).with_effect(fix(0, name="clamp"))
    (shift,) = SupportShift.propose(model)
    free = replace(model, effects=tuple(e for e in model.effects if e.name != "clamp"))
    (c,) = replace(shift, amount=0.1).contribute(model)
    system = assemble(free)
    Ks, M = system.K.toarray(), system.M.toarray()
    Ks[np.ix_(c.dofs[0], c.dofs[0])] += c.K[0]
    lam = np.sort(np.real(np.linalg.eigvals(np.linalg.solve(M, Ks))))
    first = np.sqrt(lam[0]) / (2 * np.pi)
    L = 1.0 - 0.1
    exact = 1.87510407**2 / (2 * np.pi * L**2) * np.sqrt(STEEL.E * FLAT.Iy / (STEEL.rho * FLAT.A))
    assert first == pytest.approx(exact, rel=3e-3)


def test_a_connection_as_the_model_has_it_changes_nothing_and_its_loss_is_of_its_own_direction():
    model = footed(beam(10), 3, 0.2)
    for e in JointComplexStiffness.propose(model):
        (c,) = e.contribute(model)
        assert c.K is not None
        assert c.D is not None
        assert np.abs(c.K).max() == 0
        assert np.abs(c.D).max() == 0
        (lossy,) = e.with_values(loss_factor=0.3).contribute(model)
        (softer,) = e.with_values(stiffness=2 * e.assumed).contribute(model)
        assert lossy.D is not None
        assert softer.K is not None
        np.testing.assert_allclose(lossy.D, 0.3 * softer.K)
