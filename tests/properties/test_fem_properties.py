"""What holds for every frame: symmetry, orthogonality, and no part played by orientation or numbering."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from fem.effects.frame import Frame, MemberProperties
from fem.effects.joint import Joint
from fem.effects.support import Support
from fem.frf import compute_frf
from fem.mesh import Location, Mesh
from fem.model import DIRECTIONS, Constraint, Damping, Model, lever_matrix
from fem.modes import solve_modes
from fem.properties import Section
from fem.system import assemble, null_space
from tests.frames import FLAT, STEEL

modest = settings(max_examples=25, derandomize=True, deadline=None)
seeds = st.integers(0, 2**31)


def random_frame(seed, *, rotation=None, order=None, flip=None, n_points=5, split=2):
    """Return a connected frame with random points, sections and offsets, a support and a spring."""
    rng = np.random.default_rng(seed)
    points = rng.uniform(-0.5, 0.5, (n_points, 3))
    points[:, 0] += np.arange(n_points)  # apart from one another
    lines = np.array([[rng.integers(i), i] for i in range(1, n_points)] + [[0, n_points - 1]])
    up = rng.standard_normal((len(lines), 3))
    kinds = [FLAT, Section.circle(0.02), Section.tube(0.03, 0.002)]
    sections = [kinds[k] for k in rng.integers(0, 3, len(lines))]
    theory = [("timoshenko", "euler-bernoulli")[k] for k in rng.integers(0, 2, len(lines))]
    offsets = 0.02 * rng.standard_normal((len(lines), 2, 3))
    K = rng.standard_normal((6, 6))
    K = 1e4 * K @ K.T
    R = np.eye(3) if rotation is None else rotation
    rotate = np.kron(np.eye(2), R)
    new = np.arange(n_points) if order is None else np.asarray(order)  # new[i] is the new number of point i
    moved = np.empty_like(points)
    moved[new] = points @ R.T
    rows = new[lines]
    turn = np.zeros(len(lines), dtype=bool) if flip is None else np.asarray(flip)
    rows[turn] = rows[turn][:, ::-1]
    mesh = Mesh.from_lines(moved, rows, {f"m{i}": [i] for i in range(len(lines))})
    members = {}
    for i in range(len(lines)):
        ends = offsets[i] @ R.T
        members[f"m{i}"] = MemberProperties(
            STEEL,
            sections[i],
            orientation=R @ up[i],
            theory=theory[i],
            offset1=ends[int(turn[i])],
            offset2=ends[1 - int(turn[i])],
        )
    spring = Joint(name="spring", point1=int(new[2]), location=moved[new[2]], K=rotate @ K @ rotate.T)
    support = Support(name="foot", point=int(new[0]), fixed=DIRECTIONS)
    frame = Frame(members=members)
    return Model(mesh.split(split), (frame, spring, support)), new


def rotation_of(seed):
    Q, _ = np.linalg.qr(np.random.default_rng(seed).standard_normal((3, 3)))
    return Q * np.sign(np.linalg.det(Q))


def frequencies(model, n=12):
    return solve_modes(assemble(model), n).frequency


@modest
@given(seeds, seeds)
def test_frequencies_do_not_depend_on_orientation(seed, turn):
    still, _ = random_frame(seed)
    turned, _ = random_frame(seed, rotation=rotation_of(turn))
    # rounding: 1e-16 of the highest ω² (1e12 of the lowest, with axial and torsional modes of short elements)
    np.testing.assert_allclose(frequencies(turned), frequencies(still), rtol=1e-7)


@modest
@given(seeds, st.permutations(range(5)), st.lists(st.booleans(), min_size=5, max_size=5))
def test_frequencies_do_not_depend_on_numbering_or_direction(seed, order, flip):
    plain, _ = random_frame(seed)
    other, _ = random_frame(seed, order=order, flip=flip)
    np.testing.assert_allclose(frequencies(other), frequencies(plain), rtol=1e-7)


@modest
@given(seeds)
def test_modes_are_orthonormal(seed):
    S = assemble(random_frame(seed)[0])
    modes = solve_modes(S, 15)
    phi = S.Q.T @ modes.shapes
    np.testing.assert_allclose(phi.T @ (S.M @ phi), np.eye(15), atol=1e-8)
    stiffness = phi.T @ (S.K @ phi) / modes.omega[-1] ** 2
    np.testing.assert_allclose(stiffness, np.diag((modes.omega / modes.omega[-1]) ** 2), atol=1e-8)
    np.testing.assert_allclose(S.Q @ phi, modes.shapes, atol=1e-12 * abs(phi).max())


@modest
@given(seeds, st.sampled_from(["reduced", "direct"]))
def test_frfs_are_reciprocal(seed, method):
    model, _ = random_frame(seed)
    S = assemble(model.with_damping(Damping(alpha=2.0, beta=1e-6, loss_factor=0.01)))
    f = np.linspace(1.0, frequencies(model, 4)[-1], 7)
    at = [(1, "x"), (3, "rz"), (4, "y"), (2, "z"), (7, "z")]
    H = compute_frf(S, f, at, at, method=method).H
    level = np.sqrt(abs(np.einsum("fii,fjj->fij", H, H)))
    assert (abs(H - np.swapaxes(H, 1, 2)) < 1e-7 * level).all()
    # and passive: force does no negative work, Im H(receptance) of a driving point ≤ 0
    receptance = compute_frf(S, f, at, at, kind="receptance", method=method).H
    worst = np.linalg.eigvalsh((receptance - np.conj(np.swapaxes(receptance, 1, 2))) / 2j).max(axis=1)
    assert (worst < 1e-6 * abs(receptance).max(axis=(1, 2))).all()


@modest
@given(seeds, st.integers(2, 3))
def test_refined_meshes_keep_points_and_lower_frequencies(seed, factor):
    # Euler-Bernoulli shapes nest: a finer mesh can move as the coarser one does, and better. Rayleigh-Ritz.
    coarse, _ = random_frame(seed, split=1)
    members = {
        k: MemberProperties(STEEL, p.section, p.orientation, theory="euler-bernoulli")
        for k, p in coarse.effects[0].members.items()
    }
    coarse = Model(coarse.mesh, (Frame(members=members), *coarse.effects[1:]))
    fine = coarse.with_mesh(coarse.mesh.split(factor))
    np.testing.assert_array_equal(fine.mesh.points[: coarse.mesh.n_points], coarse.mesh.points)
    finer = fine.with_mesh(fine.mesh.split(2))
    f = [frequencies(m, 10) for m in (coarse, fine, finer)]
    assert (f[1] <= f[0] * (1 + 1e-8)).all()
    assert (f[2] <= f[1] * (1 + 1e-8)).all()


@modest
@given(seeds, st.lists(st.floats(0.0, 1.0), min_size=1, max_size=4), st.integers(1, 4))
def test_splitting_keeps_members_and_places(seed, places, n):
    mesh = random_frame(seed)[0].mesh
    name = list(mesh.members)[seed % len(mesh.members)]
    length = mesh.member_length(name)
    at = [mesh.point_at(mesh.locate(name, x * length)) for x in places]
    split = mesh.split(n)
    for x in places:
        split = split.with_point_on(name, x * length, name=f"p{x}")
    assert split.member_length(name) == pytest.approx(length, rel=1e-12)
    assert sum(split.lengths()) == pytest.approx(sum(mesh.lengths()), rel=1e-12)
    np.testing.assert_array_equal(split.points[: mesh.n_points], mesh.points)
    rows = np.concatenate(list(split.members.values()))
    assert sorted(rows) == list(range(split.n_lines))
    chain = split.lines[split.members[name]]
    assert (chain[1:, 0] == chain[:-1, 1]).all()
    for x, place in zip(places, at, strict=True):
        # a point nearer than 1e-6 of the length is used as it is
        found = split.points[split.point_names[f"p{x}"]]
        assert np.linalg.norm(found - place) <= 1.01e-6 * length
        member, position, distance = split.nearest_on_members(place)
        assert distance <= 1e-12
        if 1e-5 < x < 1 - 1e-5:
            assert member == name
            assert position == pytest.approx(x * length, abs=1e-9)


@modest
@given(seeds, st.floats(0.0, 1.0), st.floats(0.0, 0.4), st.floats(0.0, 0.4))
def test_interpolation_reproduces_rigid_motions(seed, x, first, second):
    model, _ = random_frame(seed, split=1)
    frame = model.effects[0]
    members = {
        k: MemberProperties(
            STEEL, p.section, p.orientation, p.offset1, p.offset2, first * 0.4, second * 0.4, p.theory
        )
        for k, p in frame.members.items()
    }
    frame = Frame(members=members)
    line = seed % model.mesh.n_lines
    dofs, N = frame.interpolate(model.mesh, [Location(line, x)])
    motions = np.vstack([lever_matrix(p) for p in model.mesh.points])
    place = model.mesh.point_at(Location(line, x))
    np.testing.assert_allclose(N[0] @ motions[dofs[0]], lever_matrix(place), atol=1e-12)
    # and its slope is that of the interpolation
    length, step = model.mesh.lengths()[line], 1e-6
    assume(step < x < 1 - step)
    inside = (0.41 * first / length + 0.05, 1 - 0.41 * second / length - 0.05)
    assume(inside[0] < x < inside[1])
    ahead, behind = (frame.interpolate(model.mesh, [Location(line, x + s)])[1] for s in (step, -step))
    slope = frame.interpolate_slope(model.mesh, [Location(line, x)])
    np.testing.assert_allclose(slope, (ahead - behind) / (2 * step * length), atol=1e-6 * abs(slope).max())


@modest
@given(seeds, st.integers(1, 12))
def test_null_space_is_orthonormal_and_meets_the_constraints(seed, n):
    rng = np.random.default_rng(seed)
    constraints = []
    for i in range(n):
        dofs = rng.choice(30, size=rng.integers(1, 8), replace=False)
        scale = 10.0 ** rng.integers(-3, 4)
        constraints.append(Constraint(("c", str(i)), dofs, scale * rng.uniform(0.5, 2.0, len(dofs))))
    constraints += constraints[:2]  # said twice
    Q = null_space(tuple(constraints), 30).toarray()
    B = np.zeros((len(constraints), 30))
    for row, c in zip(B, constraints, strict=True):
        row[c.dofs] = c.coefficients
    np.testing.assert_allclose(Q.T @ Q, np.eye(Q.shape[1]), atol=1e-13)
    assert (abs(B @ Q).max(axis=1, initial=0) < 1e-12 * abs(B).max(axis=1)).all()
    rank = np.linalg.matrix_rank(B / np.linalg.norm(B, axis=1, keepdims=True))
    assert Q.shape[1] == 30 - rank


@modest
@given(seeds)
def test_strain_energy_and_mass_are_positive(seed):
    S = assemble(random_frame(seed)[0])
    for X in (S.K, S.M):
        dense = X.toarray()
        assert abs(dense - dense.T).max() <= 1e-14 * abs(dense).max()
        scale = 1 / np.sqrt(dense.diagonal())
        assert np.linalg.eigvalsh(dense * np.outer(scale, scale)).min() > -1e-12
