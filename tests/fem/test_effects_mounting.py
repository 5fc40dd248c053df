"""Connections that act elsewhere on a member: as the model has it where it was built so."""

from dataclasses import replace

import numpy as np
import pytest

from fem import assemble, solve_modes
from fem.analysis.frf_solver import compute_frf
from fem.effects.foot_shift import FootShift
from fem.effects.joint import Joint
from fem.effects.joint_complex_stiffness import JointComplexStiffness
from fem.effects.joint_hole import JointHole
from fem.effects.part_shift import PartShift
from fem.effects.support_shift import SupportShift
from fem.sections.section import Section
from tests.frames import FLAT, STEEL, beam, cross_beam, fix

K = np.diag([2e6, 3e6, 4e6, 500.0, 700.0, 900.0])


def frequencies(model, n=9):
    return solve_modes(assemble(model), n=n).frequency


def footed(model, point, at):
    return model.with_effect(Joint(name="foot", point1=point, location=np.array([at, 0.0, -0.01]), K=K))


AXIS = np.array([1.0, 0.0, 0.0])
OPTIONS = [
    {},
    {"theory": "timoshenko", "offset1": np.array([0, 0, 0.02]), "offset2": np.array([0, 0.01, 0.02])},
    {"theory": "timoshenko", "section2": Section.rectangle(0.02, 0.012)},
]
"""Plain, on an axis beside the line of the mesh, tapered."""
SPRUNG = {"spring1": {"ry": 2e3, "y": 1e6}}
INSIDE = [0.003, 0.061, 0.137]
"""Places within the first and the second of ten elements [m]."""


def clamped(n, **options):
    return beam(n, effects=(fix(0, name="clamp"),), **options)


def with_point(model, at):
    return model.with_mesh(model.mesh.with_point_on("beam", at))


def static(model):
    """Return the flexibility at the free end."""
    system, ends = assemble(model), [(1, d) for d in ("x", "y", "z", "rx", "ry", "rz")]
    return compute_frf(system, [1e-3], ends, ends, kind="receptance", method="direct").H[0].real


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
        direction="y", across=across,
    )  # fmt: skip
    joint = here.effect("foot")
    there = model.with_effect(replace(joint, location=joint.location + 0.006 * across))
    np.testing.assert_allclose(frequencies(here.with_effect(hole)), frequencies(there), rtol=1e-6)


def test_a_clamp_further_along_leaves_two_cantilevers():
    """f = (1.8751)² / (2π L²) √(E I / ρ A) of the longer part."""
    model = clamped(20)
    (shift,) = SupportShift.propose(model)
    moved = model.with_effect(shift.with_values(amount=0.0813))
    L = 1.0 - 0.0813
    exact = 1.87510407**2 / (2 * np.pi * L**2) * np.sqrt(STEEL.E * FLAT.Iy / (STEEL.rho * FLAT.A))
    assert frequencies(moved, 1)[0] == pytest.approx(exact, rel=2e-6)


@pytest.mark.parametrize("options", OPTIONS)
@pytest.mark.parametrize("at", INSIDE)
def test_a_clamp_within_an_element_is_one_at_a_point_of_the_mesh_there(options, at):
    model = clamped(10, **options)
    (shift,) = SupportShift.propose(model)
    moved = model.with_effect(shift.with_values(amount=at))
    finer = with_point(model, at)
    there = finer.without_effect("clamp").with_effect(fix(finer.mesh.n_points - 1))
    np.testing.assert_allclose(frequencies(moved), frequencies(there), rtol=2e-6)


@pytest.mark.parametrize("options", [*OPTIONS, SPRUNG])
@pytest.mark.parametrize("at", INSIDE)
def test_a_foot_within_an_element_is_one_at_a_point_of_the_mesh_there(options, at):
    """Statics are exact; the mass differs by the condensed point's own motion."""
    model = footed(clamped(10, **options), 2, 0.1)
    (shift,) = FootShift.propose(model)
    moved = model.with_effect(shift.with_values(amount=at - 0.1))
    finer = with_point(model, at)
    joint = finer.effect("foot")
    new = replace(joint, point1=finer.mesh.n_points - 1, location=joint.location + (at - 0.1) * AXIS)
    there = finer.without_effect("foot").with_effect(new)
    np.testing.assert_allclose(static(moved), static(there), rtol=1e-7, atol=1e-9 * abs(static(there)).max())
    np.testing.assert_allclose(frequencies(moved, 4), frequencies(there, 4), rtol=1e-4)


@pytest.mark.parametrize("node", [0.1, 0.2])
@pytest.mark.parametrize("kind", [SupportShift, FootShift])
def test_what_moves_across_a_point_of_the_mesh_does_so_smoothly(kind, node):
    """The change of the flexibility by the shift is the same on both sides."""
    model = clamped(10) if kind is SupportShift else footed(clamped(10), 4, 0.3)
    (shift,) = kind.propose(model)

    def at(s):
        start = 0.0 if kind is SupportShift else 0.3
        return static(model.with_effect(replace(shift, amount=s - start)))

    h = 1e-5
    before, here, beyond = at(node - h), at(node), at(node + h)
    size = abs(beyond - before).max()
    assert abs(beyond - 2 * here + before).max() < 1e-3 * size
    assert size > 1e-5 * abs(here).max()


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
