"""What holds for every frame: symmetry, orthogonality, and no part played by orientation or numbering."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from fem import (
    Constraint,
    Damping,
    Frame,
    Joint,
    Location,
    MemberProperties,
    Mesh,
    Model,
    Section,
    assemble,
    compute_frf,
    lever_matrix,
    solve_modes,
)
from fem.system import null_space
from joint import Interface, coordinates_of, couple, joint_impedance, partition_frf, stack_substructures
from tests.frames import FLAT, STEEL
from tests.random_frames import random_frame

modest = settings(max_examples=25, derandomize=True, deadline=None)
seeds = st.integers(0, 2**31)


def any_frame(seed, split=2, **turned):
    """Return a clamped frame of five members with offsets and a spring."""
    return random_frame(seed, split=split, offset=0.02, spring=True, **turned)


def rotation_of(seed):
    Q, _ = np.linalg.qr(np.random.default_rng(seed).standard_normal((3, 3)))
    return Q * np.sign(np.linalg.det(Q))


def frequencies(model, n=12):
    return solve_modes(assemble(model), n).frequency


@modest
@given(seeds, seeds)
def test_frequencies_do_not_depend_on_orientation(seed, turn):
    still = any_frame(seed)
    turned = any_frame(seed, rotation=rotation_of(turn))
    # rounding: 1e-16 of the highest ω² (1e12 of the lowest, with axial and torsional modes of short elements)
    np.testing.assert_allclose(frequencies(turned), frequencies(still), rtol=1e-7)


@modest
@given(seeds, st.permutations(range(5)), st.lists(st.booleans(), min_size=5, max_size=5))
def test_frequencies_do_not_depend_on_numbering_or_direction(seed, order, flip):
    plain = any_frame(seed)
    other = any_frame(seed, order=order, flip=flip)
    np.testing.assert_allclose(frequencies(other), frequencies(plain), rtol=1e-7)


@modest
@given(seeds)
def test_modes_are_orthonormal(seed):
    S = assemble(any_frame(seed))
    modes = solve_modes(S, 15)
    phi = S.Q.T @ modes.shapes
    np.testing.assert_allclose(phi.T @ (S.M @ phi), np.eye(15), atol=1e-8)
    stiffness = phi.T @ (S.K @ phi) / modes.omega[-1] ** 2
    np.testing.assert_allclose(stiffness, np.diag((modes.omega / modes.omega[-1]) ** 2), atol=1e-8)
    np.testing.assert_allclose(S.Q @ phi, modes.shapes, atol=1e-12 * abs(phi).max())


@modest
@given(seeds, st.sampled_from(["reduced", "direct"]))
def test_frfs_are_reciprocal(seed, method):
    model = any_frame(seed)
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
    coarse = any_frame(seed, split=1)
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
    mesh = any_frame(seed).mesh
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
    model = any_frame(seed, split=1)
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
    S = assemble(any_frame(seed))
    for X in (S.K, S.M):
        dense = X.toarray()
        assert abs(dense - dense.T).max() <= 1e-14 * abs(dense).max()
        scale = 1 / np.sqrt(dense.diagonal())
        assert np.linalg.eigvalsh(dense * np.outer(scale, scale)).min() > -1e-12


def options_of(rng, loop):
    """Return what a member may be beside a plain beam; only one that closes a loop may be loose at an end."""
    if loop:
        # without offsets, about which the points inside it could turn
        bar = {"theory": "bar", "pretension": 5e3, "offset1": np.zeros(3), "offset2": np.zeros(3)}
        choices = [
            {"release1": ("ry", "rz")},
            {"release1": ("rx",), "release2": ("ry", "rz")},
            {"release2": ("x", "y")},
            bar,
            {**bar, "mass": "lumped"},
        ]
    else:
        choices = [
            {"mass": "lumped"},
            {"section2": Section.rectangle(0.05, 0.02), "section": FLAT},
            {"section2": Section.circle(0.03), "section": Section.circle(0.02), "mass": "lumped"},
            {"spring1": {"ry": 2e3, "rz": 5e3}},
            {"spring1": {"x": 1e7}, "spring2": {"rx": 400.0, "z": 1e6}},
            {"pretension": 2e3},
        ]
    return choices[rng.integers(len(choices))]


def with_options(model, seed, flip=None):
    """Return a frame of :func:`any_frame` whose members have releases, springs, tapers and the like."""
    rng = np.random.default_rng(seed)
    (frame,) = model.of_kind(Frame)
    members = {}
    for i, (name, p) in enumerate(frame.members.items()):
        more = options_of(rng, loop=i == len(frame.members) - 1)
        if flip is not None and flip[i]:  # the other way round: what is at end 1 is at end 2
            ends = {"release1": "release2", "spring1": "spring2", "section": "section2"}
            ends |= {b: a for a, b in ends.items()}
            more = {ends.get(key, key): value for key, value in more.items()}
        members[name] = replace(p, **more)
    return Model(model.mesh, (replace(frame, members=members), *model.effects[1:]), model.damping)


def response(model, force, frequency=37.0):
    """Return the displacements under forces (n_dof,) or (n_dof, n), with a little structural damping."""
    S = assemble(model.with_damping(Damping.structural(0.05)))
    Z = S.dynamic_stiffness(2 * np.pi * frequency).toarray()
    scale = 1 / np.sqrt(abs(Z.diagonal()))
    scaled = np.linalg.solve(Z * np.outer(scale, scale), np.diag(scale) @ S.Q.T @ force)
    return S.Q @ np.diag(scale) @ scaled


few = settings(max_examples=10, derandomize=True, deadline=None)


@few
@given(seeds, seeds)
def test_turning_a_model_turns_its_responses_and_nothing_else(seed, turn):
    R = rotation_of(turn)
    still, turned = (with_options(any_frame(seed, rotation=r), seed) for r in (None, R))
    np.testing.assert_allclose(frequencies(turned), frequencies(still), rtol=1e-7)
    force = np.random.default_rng(turn).standard_normal((still.mesh.n_points, 2, 3))
    for f in (0.0, 37.0):
        u = response(still, force.ravel(), f).reshape(-1, 2, 3) @ R.T
        v = response(turned, (force @ R.T).ravel(), f).reshape(-1, 2, 3)
        # rounding: 1e-16 of the condition, the stiffest over the softest motion, 1e8 after scaling
        np.testing.assert_allclose(v, u, atol=1e-7 * abs(u).max())


@few
@given(seeds, st.permutations(range(5)), st.lists(st.booleans(), min_size=5, max_size=5))
def test_numbering_and_direction_of_lines_change_no_response(seed, order, flip):
    plain = any_frame(seed)
    other, new = any_frame(seed, order=order, flip=flip), np.array(order)
    plain, other = with_options(plain, seed), with_options(other, seed, flip)
    np.testing.assert_allclose(frequencies(other), frequencies(plain), rtol=1e-7)
    force, moved = np.zeros((plain.mesh.n_points, 6)), np.zeros((plain.mesh.n_points, 6))
    force[:5] = np.random.default_rng(seed).standard_normal((5, 6))
    moved[new] = force[:5]
    u, v = response(plain, force.ravel()).reshape(-1, 6), response(other, moved.ravel()).reshape(-1, 6)
    np.testing.assert_allclose(v[new], u[:5], atol=1e-7 * abs(u[:5]).max())


@modest
@given(seeds, st.integers(1, 3))
def test_elements_conserve_mass_and_let_rigid_motions_be(seed, split):
    model = with_options(any_frame(seed, split=split), seed)
    (frame,), mesh = model.of_kind(Frame), model.mesh
    motions = np.vstack([lever_matrix(p) for p in mesh.points])
    for name, rows in mesh.members.items():
        (part,) = frame.contribution_of(model, rows)
        u = motions[part.dofs]
        for i in range(len(rows)):
            assert abs(part.K[i] @ u[i]).max() <= 1e-13 * abs(part.K[i]).max()
        total = (np.swapaxes(u, 1, 2) @ part.M @ u).sum(axis=0)[:3, :3]
        p = frame.members[name]
        x, weight = np.polynomial.legendre.leggauss(3)  # A is quadratic along a taper
        area = weight @ [Section.between(p.section, p.section2 or p.section, s).A for s in (x + 1) / 2] / 2
        ends = mesh.points[mesh.member_points(name)[[0, -1]]] + [p.offset1, p.offset2]
        mass = p.material.rho * area * np.linalg.norm(ends[1] - ends[0])
        np.testing.assert_allclose(total, mass * np.eye(3), atol=1e-12 * mass)


@modest
@given(seeds)
def test_members_with_options_have_symmetric_matrices_and_reciprocal_frfs(seed):
    model = with_options(any_frame(seed), seed).with_damping(Damping.structural(0.02))
    S = assemble(model)
    for X in (S.K, S.M, S.D):
        assert abs(X - X.T).max() <= 1e-14 * max(abs(X).max(), 1e-300)
    at = [(1, "x"), (3, "rz"), (4, "y"), (2, "z")]
    H = compute_frf(S, [11.0, 47.0], at, at, method="direct").H
    level = np.sqrt(abs(np.einsum("fii,fjj->fij", H, H)))
    assert (abs(H - np.swapaxes(H, 1, 2)) < 1e-7 * level).all()


def receptances(model, points, frequency):
    """Return receptances (n_freq, 6 n, 6 n) of points."""
    dofs = (6 * np.array(points)[:, None] + np.arange(6)).ravel()
    unit = np.eye(model.n_dof)[:, dofs]
    return np.array([response(model, unit, f)[dofs] for f in frequency])


@few
@given(seeds, seeds)
def test_frames_coupled_by_their_frfs_are_those_assembled_with_the_joint(first, second):
    models = [with_options(any_frame(seed, split=1), seed) for seed in (first, second)]
    rng = np.random.default_rng(first)
    shift = np.array([0.0, 0.0, 3.0])
    frequency, n = np.array([5.0, 90.0]), 5
    K = rng.standard_normal((6, 6))
    ends = models[0].mesh.points[1], models[1].mesh.points[3] + shift
    middle = (ends[0] + ends[1]) / 2
    joint = Joint(name="bolt", point1=1, point2=n + 3, location=middle, K=1e5 * K @ K.T, eta=0.03)

    # one model of both
    meshes = [m.mesh for m in models]
    points = np.vstack([meshes[0].points, meshes[1].points + shift])
    sets = {f"a{k}": v for k, v in meshes[0].members.items()}
    sets |= {f"b{k}": v + meshes[0].n_lines for k, v in meshes[1].members.items()}
    mesh = Mesh.from_lines(points, np.vstack([meshes[0].lines, meshes[1].lines + n]), sets)
    assert np.array_equal(mesh.lines[meshes[0].n_lines :], meshes[1].lines + n)
    members, others = {}, []
    for x, m, start, by in zip("ab", models, (0, n), (0 * shift, shift), strict=True):
        frame, spring, foot = m.effects
        members |= {f"{x}{k}": p for k, p in frame.members.items()}
        location = spring.location + by
        others.append(replace(spring, name=f"{x}s", point1=spring.point1 + start, location=location))
        others.append(replace(foot, name=f"{x}f", point=foot.point + start))
    whole = Model(mesh, (Frame(members=members), *others, joint))
    expected = receptances(whole, [2, 1, n + 4, n + 3], frequency)

    parts = []
    for x, m, (inner, end) in zip("ab", models, ((2, 1), (4, 3)), strict=True):
        own = coordinates_of([f"{x}{inner}", f"{x}{end}"])
        inside = coordinates_of([f"{x}{inner}"])
        interface = Interface(coordinates_of([f"{x}{end}"]), inside, inside)
        parts.append(partition_frf(frequency, receptances(m, [inner, end], frequency), own, own, interface))
    (bolt,) = joint.contribute(whole)
    both = stack_substructures(*parts)
    # the whole's damping of 5 % is the bolt's as well
    Z_j = joint_impedance(frequency, bolt.K[0], D=bolt.D[0] + 0.05 * bolt.K[0])
    H = couple(both, Z_j)
    inner = [*range(6), *range(12, 18)]
    bolted = [*range(6, 12), *range(18, 24)]
    for block, rows, columns in ((H.H_nn, inner, inner), (H.H_jj, bolted, bolted), (H.H_nj, inner, bolted)):
        found = expected[np.ix_([0, 1], rows, columns)]
        own = abs(np.einsum("fii->fi", expected))
        scale = np.sqrt(own[:, rows, None] * own[:, None, columns])
        assert (abs(block - found) <= 1e-7 * scale).all()
