"""Connections that act elsewhere on a member: as the model has it where it was built so."""

from dataclasses import replace

import numpy as np
import pytest

from fem import Frame, Joint, MemberProperties, Mesh, Model, Section, assemble, compute_frf, solve_modes
from fem.effects import (
    Crack,
    EndRelease,
    FootShift,
    JointComplexStiffness,
    JointHole,
    PartShift,
    SupportShift,
)
from fem.reduction import LocalChanges, ParametricFRF, reduce_model
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


@pytest.mark.parametrize("amount", [0.05, -0.05])
def test_a_foot_under_two_members_shifts_along_either(amount):
    properties = MemberProperties(STEEL, FLAT)
    mesh = Mesh.from_lines(
        [[0, 0, 0], [0.3, 0, 0], [1.0, 0, 0]], [[0, 1], [1, 2]], {"left": [0], "right": [1]}
    ).refined(0.05)
    model = Model(mesh, (Frame(members={"left": properties, "right": properties}),))
    here = footed(model, point_at(model, 0.3), 0.3)
    shifts = FootShift.propose(here)
    assert [(e.name, e.lower < 0, e.upper > 0) for e in shifts] == [
        ("foot_shift:foot.left", True, False),
        ("foot_shift:foot.right", False, True),
    ]
    moved = here.with_effect(shifts[int(amount > 0)].with_values(amount=amount))
    there = footed(model, point_at(model, 0.3 + amount), 0.3 + amount)
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
        name="hole",
        joint="foot",
        side=1,
        member="beam",
        at=0.3,
        amount=0.006,
        lower=-1,
        upper=1,
        direction="y",
        across=across,
    )
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


def giving_way(*places, end=0, compliance=3e-3):
    """Return cracks at places, both ways, and releases at an end of the beam."""
    cracks = [
        Crack(
            name=f"crack {s} {d}",
            member="beam",
            position=s,
            direction=d,
            compliance=compliance,
            length=1.0,
            reference=1.0,
        )
        for s in places
        for d in ("ry", "rz")
    ]
    if end:
        cracks.append(
            EndRelease(
                name="end", member="beam", end=end, direction="ry", compliance=compliance, reference=1.0
            )
        )
    return cracks


@pytest.mark.parametrize("options", [*OPTIONS, SPRUNG])
@pytest.mark.parametrize("cuts", [((0.04,), 0), ((0.07,), 0), ((), 1), ((0.03, 0.08), 1)], ids=str)
@pytest.mark.parametrize("kind", [SupportShift, FootShift])
def test_a_place_in_an_element_that_gives_way_is_one_at_a_point_of_the_mesh_there(options, cuts, kind):
    """There the cracks are in other elements than the place, or at the ends of theirs."""
    at, (places, end) = 0.055, cuts
    coarse, loose = clamped(10, **options), giving_way(*places, end=end)
    coarse = coarse.with_effect(*loose)
    if kind is SupportShift:
        if options is SPRUNG:
            pytest.skip("it is proposed for members without springs at their ends")
        (shift,) = SupportShift.propose(coarse)
        moved = coarse.with_effect(shift.with_values(amount=at))
        finer = with_point(coarse, at)
        there = finer.without_effect("clamp").with_effect(fix(finer.mesh.n_points - 1))
    else:
        here = footed(coarse, 2, 0.1)
        (shift,) = FootShift.propose(here)
        np.testing.assert_allclose(static(here.with_effect(shift)), static(here), rtol=1e-9, atol=1e-12)
        moved = here.with_effect(shift.with_values(amount=at - 0.1))
        finer = with_point(here, at)
        joint = finer.effect("foot")
        new = replace(joint, point1=finer.mesh.n_points - 1, location=joint.location + (at - 0.1) * AXIS)
        there = finer.without_effect("foot").with_effect(new)
    expected = static(there)
    np.testing.assert_allclose(static(moved), expected, rtol=1e-6, atol=1e-8 * abs(expected).max())
    # the mass that follows springs at the ends does not follow what gives way behind them
    np.testing.assert_allclose(frequencies(moved, 4), frequencies(there, 4), rtol=3e-4)


@pytest.mark.parametrize("kind", [SupportShift, FootShift])
@pytest.mark.parametrize("tried", ["crack 0.07 ry", "shift"])
def test_a_place_and_what_gives_way_beside_it_are_one_in_reduced_models(kind, tried):
    """Whichever of the two is added to a state that has the other, and by all derivatives."""
    model = clamped(10) if kind is SupportShift else footed(clamped(10), 2, 0.1)
    (shift,) = kind.propose(model)
    shift = replace(shift, name="shift", lower=-1.0, upper=1.0)
    crack = giving_way(0.07)[0]
    amount = 0.055 if kind is SupportShift else -0.045
    values = {("crack 0.07 ry", "compliance"): 3e-3, ("shift", "amount"): amount}
    every = {"shift": shift.with_values(amount=amount / 3), crack.name: crack.with_values(compliance=1e-3)}
    f, rows = np.linspace(5.0, 200.0, 12), [(1, "z"), (6, "z")]
    ends = np.eye(model.n_dof)[:, [6 * 1 + 2, 6 * 6 + 2]]
    small = reduce_model(model, np.eye(model.n_dof)[:, np.diff(assemble(model).Q.tocsr().indptr) > 0], 400.0)
    both = ParametricFRF(small, ends, ends, f, list(values), tuple(every.values()))
    at, zeta = np.array(list(values.values())), np.zeros(len(f))
    H, slopes, _ = both.evaluate(at, zeta)
    direct = model.with_effect(*every.values()).with_values(values)
    exact = compute_frf(assemble(direct), f, rows, rows, kind="receptance").H
    assert abs(H - exact).max() <= 2e-3 * abs(exact).max()
    for k, ref in enumerate(values):
        step = 1e-4 * abs(at[k]) * np.eye(2)[k]
        up, down = (both.evaluate(at + sign * step, zeta, gradient=False)[0] for sign in (1, -1))
        rough = (up - down) / (2e-4 * abs(at[k]))
        assert abs(slopes[k] - rough).max() <= 1e-3 * abs(rough).max(), ref
    refs = [ref for ref in values if ref[0] != tried]
    one = ParametricFRF(small, ends, ends, f, refs, [e for n, e in every.items() if n != tried])
    now = every[tried].with_values(**{p: v for (n, p), v in values.items() if n == tried})
    (found,) = LocalChanges.of(one, np.array([values[ref] for ref in refs]), zeta).receptances([now])
    assert abs(found - H).max() <= 1e-3 * abs(H).max()


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
    effects = list(JointComplexStiffness.propose(model))
    assert len(effects) == 6
    for e in effects:
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
