"""Sums of element matrices, their change with parameters, and meshes made without loops."""

import numpy as np
import pytest

from fem import (
    AddedMass,
    Damping,
    Frame,
    Joint,
    Material,
    MemberProperties,
    Mesh,
    Model,
    ModelError,
    PointMass,
    Section,
    assemble,
    reassemble,
)
from fem.effects import MemberStiffness
from fem.elements.closed_form import closed_stiffness, global_blocks
from fem.elements.matrices import local_stiffness
from tests.frames import FLAT, STEEL, fix, mounted

ALLOY = Material("alloy", 70e9, 2700.0, loss_factor=0.02)


def everything(seed=0, **springs):
    """Return a frame with all sorts of members, two of them side by side, held at three points."""
    rng = np.random.default_rng(seed)
    points = rng.standard_normal((8, 3)) + 3 * np.arange(8)[:, None]
    lines = [[i, i + 1] for i in range(7)] + [[0, 3], [2, 5], [2, 5], [7, 4]]
    mesh = Mesh.from_lines(points, lines, {f"m{i}": [i] for i in range(len(lines))}).split(
        [2, 2, 2, 2, 1, 2, 2, 1, 1, 1, 1]
    )
    kinds = [
        MemberProperties(STEEL, FLAT),
        MemberProperties(ALLOY, FLAT, theory="euler-bernoulli", mass="lumped"),
        MemberProperties(STEEL, FLAT, offset1=np.array([0, 0.1, 0.2]), rigid2=0.1),
        MemberProperties(
            ALLOY, FLAT, section2=Section.rectangle(0.05, 0.02), orientation=np.array([1, 2, 0])
        ),
        MemberProperties(STEEL, FLAT, theory="bar", pretension=2e4),
        MemberProperties(STEEL, FLAT, release1=("ry",), **springs),
    ]
    members = {name: kinds[i % len(kinds)] for i, name in enumerate(mesh.members)}
    if not springs:
        members = {name: kinds[0] if p.release1 else p for name, p in members.items()}
    effects = (
        Frame(members=members),
        Joint(name="spring", point1=3, point2=6, location=points[3], K=np.diag([1e5] * 6), C=np.eye(6)),
        AddedMass(name="lump", point=2, mass=3.0),
        PointMass(name="clamp-on", member="m1", position=1.0, mass=0.4, span=(0, 1), scale=1.0),
        MemberStiffness(name="softer", member="m3", change=-0.1),
        fix(0),
        fix(4, ("x", "ry")),
        fix(7),
    )
    return Model(mesh, effects)


def by_entries(model):
    """Return K, M, C and D on all DOFs, entry by entry."""
    out = np.zeros((4, model.n_dof, model.n_dof))
    for part in model.contributions():
        for k, X in enumerate((part.static, part.M, part.C, part.D)):
            if X is not None:
                np.add.at(out[k], (part.dofs[:, :, None], part.dofs[:, None, :]), X)
    return out


@pytest.mark.parametrize("model", [everything(spring2={"z": 3e5}), everything(), mounted()])
def test_blocks_and_entries_have_the_same_sums(model):
    S = assemble(model)
    Q = S.Q.toarray()
    for X, Y in zip((S.K, S.M, S.C, S.D), by_entries(model), strict=True):
        np.testing.assert_allclose(X.toarray(), Q.T @ Y @ Q, rtol=0, atol=1e-15 * abs(Y).max() * 10)
        assert X.data.all(), "keeps entries that are zero"
        assert X.has_sorted_indices


def test_batches_are_the_contributions(monkeypatch):
    model = everything(spring2={"z": 3e5})
    whole = by_entries(model)
    monkeypatch.setattr("fem.elements.frame.BATCH", 3)
    np.testing.assert_array_equal(by_entries(model), whole)
    (frame,) = model.of_kind(Frame)
    assert len(list(frame.contribute(model))) > 6
    S = assemble(model)
    np.testing.assert_allclose(
        S.K.toarray(), S.Q.T @ whole[0] @ S.Q, rtol=0, atol=1e-14 * abs(whole[0]).max()
    )


def test_constraints_on_single_dofs_among_others():
    model = everything()
    tied = Joint(name="pin", point1=1, point2=2, location=model.mesh.points[1], rigid=("x", "y"))
    held = model.with_effect(tied, fix(1, ("x",), "held"))  # shares a DOF with the pin
    Q = assemble(held).Q.toarray()
    np.testing.assert_allclose(Q.T @ Q, np.eye(Q.shape[1]), atol=1e-14)
    for c in held.constraints():
        assert abs(c.coefficients @ Q[c.dofs]).max() < 1e-14 * abs(c.coefficients).max()
    assert Q.shape[1] == held.n_dof - len(held.constraints())


CHANGES = {
    "one modulus": lambda m: m.with_values({("frame", "E:steel"): 190e9}),
    "one density": lambda m: m.with_values({("frame", "rho:alloy"): 2900.0}),
    "all moduli alike": lambda m: m.with_values({("frame", "E:steel"): 231e9, ("frame", "E:alloy"): 77e9}),
    "all by themselves": lambda m: m.with_values(
        {("frame", "E:steel"): 231e9, ("frame", "rho:alloy"): 2900.0, ("lump", "mass"): 1.0}
    ),
    "a spring": lambda m: m.with_values({("spring", "kx"): 3e7}),
    "a spring less": lambda m: m.without_effect("spring"),
    "a mass more": lambda m: m.with_effect(AddedMass(name="more", point=5, mass=2.0)),
    "a member": lambda m: m.with_values({("softer", "change"): 0.3}),
    "damping": lambda m: m.with_damping(Damping.structural(0.01)),
    "a support less": lambda m: m.without_effect("support4"),
    "a mesh": lambda m: m.with_mesh(m.mesh.split(2)),
}


@pytest.mark.parametrize("springs", [{}, {"spring2": {"z": 3e5}}])
@pytest.mark.parametrize("name", CHANGES)
def test_reassembled_systems_are_those_assembled_anew(name, springs):
    model = everything(**springs)
    changed = CHANGES[name](model)
    before, expected = assemble(model), assemble(changed)
    found = reassemble(before, changed)
    assert found.model is changed
    np.testing.assert_array_equal(found.Q.toarray(), expected.Q.toarray())
    np.testing.assert_allclose(found.rigid, expected.rigid, atol=1e-12)
    for key in "KMCD":
        X, Y = getattr(found, key).toarray(), getattr(expected, key).toarray()
        # rounding of what was and of what is: no entry of either is larger than this
        assert abs(X - Y).max() <= 1e-14 * max(abs(Y).max(), abs(getattr(before, key)).max())


def test_reassembly_leaves_alone_what_does_not_change():
    model = everything()
    S = assemble(model)
    assert reassemble(S, CHANGES["one modulus"](model)).C is S.C
    for name in ("a spring less", "one modulus", "all moduli alike"):
        assert reassemble(S, CHANGES[name](model)).M is S.M
    assert reassemble(S, CHANGES["a mass more"](model)).K is S.K
    assert reassemble(S, CHANGES["damping"](model)).K is S.K


def test_reassembly_refuses_values_that_are_no_numbers():
    model = everything()
    with pytest.raises(ModelError, match="matrix K of the model has entries that are not finite"):
        reassemble(assemble(model), model.with_values({("spring", "kx"): np.nan}))


def test_thousands_of_members_and_supports_cost_no_loop_over_each():
    # A tower of 400 storeys: what is summed is the mass of its lines, and its feet are held.
    n = 400
    corner = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=float)
    points = np.column_stack([np.tile(corner, (n, 1)), np.repeat(np.arange(n), 4)])
    here = np.arange(4 * n).reshape(-1, 4)
    lines = np.concatenate(
        [
            np.stack(p, -1).reshape(-1, 2)
            for p in (
                (here, np.roll(here, -1, 1)),
                (here[:-1], here[1:]),
                (here[:-1], np.roll(here, -1, 1)[1:]),
            )
        ]
    )
    mesh = Mesh.from_lines(points, lines)
    assert len(mesh.members) == len(mesh.groups["frame"]) == len(lines)
    p = MemberProperties(STEEL, FLAT)
    held = [fix(int(i), ("x", "y")) for i in range(4, 4 * n, 2)]
    model = Model(mesh, (Frame(members=dict.fromkeys(mesh.members, p)), *(fix(i) for i in range(4)), *held))
    S = assemble(model)
    assert S.n_free == 24 * n - 24 - 2 * len(held)
    # and its mass is that of its lines
    whole = assemble(model.without_effect(*(e.name for e in model.effects[1:])))
    assert whole.rigid.shape[1] == 6
    up = np.tile([0, 0, 1.0, 0, 0, 0], 4 * n)
    length = np.linalg.norm(np.diff(points[lines], axis=1)[:, 0], axis=1)
    assert up @ (whole.M @ up) == pytest.approx(STEEL.rho * FLAT.A * length.sum(), rel=1e-12)


@pytest.mark.parametrize("closed", [False, True])
def test_long_chains_keep_their_order_and_direction(closed):
    n = 5000
    rng = np.random.default_rng(2)
    angle = 2 * np.pi * np.arange(n) / (n if closed else 2 * n)
    name = rng.permutation(n)
    points = np.empty((n, 3))
    points[name] = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    lines = np.column_stack([name, np.roll(name, -1)])[: n if closed else n - 1]
    lines = lines[rng.permutation(len(lines))]
    back = rng.random(len(lines)) < 0.3
    lines[back] = lines[back][:, ::-1]
    mesh = Mesh.from_lines(points, lines, {"ring": np.arange(len(lines))})
    chain = mesh.lines[mesh.members["ring"]]
    assert (chain[1:, 0] == chain[:-1, 1]).all()
    assert (chain[0, 0] == chain[-1, 1]) == closed
    # most lines keep the direction that they were given in
    assert (mesh.lines == lines).all(axis=1).mean() > 0.5
    fractions = mesh.arc_fractions()[mesh.members["ring"]]
    np.testing.assert_allclose(fractions[:, 1], np.arange(1, len(lines) + 1) / len(lines), rtol=1e-9)
    np.testing.assert_array_equal(fractions[1:, 0], fractions[:-1, 1])


def test_local_stiffness_is_that_along_the_global_axes():
    model = everything()
    (frame,) = model.of_kind(Frame)
    prismatic = np.setdiff1d(np.arange(model.mesh.n_lines), frame.tapered_lines(model.mesh))
    lines = frame.lines(model.mesh, prismatic)
    along = np.broadcast_to(np.eye(3), (len(prismatic), 3, 3))
    K = local_stiffness(lines)
    np.testing.assert_array_equal(K, global_blocks(along, *closed_stiffness(lines)))
    assert np.linalg.matrix_rank(K[0], tol=1e-9 * np.abs(K[0]).max()) == 6
