"""Parts from other programs in a frame: against whole frames, and against CalculiX on solid parts."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from fem import (
    Attachment,
    Damping,
    Frame,
    Matrices,
    MemberProperties,
    Mesh,
    Model,
    ModelError,
    Superelement,
    assemble,
    compute_frf,
    dof_vectors,
    dofs_of,
    lever_matrix,
    solve_modes,
)
from fem.io import MatricesError, matrices_of, read_matrices
from fem.reduction import ParametricFRF, reduce_model
from tests.frames import FLAT, STEEL, fix, with_part

DATA = Path(__file__).parents[1] / "data" / "bracket"
CALCULIX = json.loads((DATA / "calculix.json").read_text())
END, TOP = (tuple(CALCULIX["nodes"][name]) for name in ("END", "TOP"))
GAP = 1e-3 * CALCULIX["gap_mm"]
BRACKET = read_matrices(DATA / "bracket.npz")
JOINT, FAR, OTHER = [0.08 + GAP / 2, 0.015, 0.01], [0.01, 0.015, 0.08], [0.15 + GAP, 0.015, 0.08]
PLATE = Mesh.from_lines([JOINT, FAR, OTHER], [[0, 1], [1, 2]])
"""Points for the brackets; its lines are no members."""


def line(first, second, n):
    """Return a mesh and frame of one beam along x."""
    mesh = Mesh.from_lines([[first, 0, 0], [second, 0, 0]], [[0, 1]], {"beam": [0]}).split(n)
    return mesh, Frame(members={"beam": MemberProperties(STEEL, FLAT)})


def free(mesh, *effects):
    return Model(mesh, effects)


def joined(**options):
    """Return a beam of 1 m of which 0.6 m are a superelement, and the same beam as a whole."""
    mesh, frame = line(0.0, 0.4, 8)
    part = matrices_of(assemble(free(*line(0.4, 1.0, 12))))
    se = Superelement.from_matrices("part", part, mesh, [Attachment(1, (0,))], **options)
    whole = Mesh.from_lines([[0, 0, 0], [0.4, 0, 0], [1, 0, 0]], [[0, 1], [1, 2]], {"beam": [0, 1]}).split(
        [8, 12]
    )
    return free(mesh, frame, se), free(whole, frame), se


def printed(name):
    """Return CalculiX's frequencies and half a unit of the last of the seven digits that it prints."""
    f = np.array(CALCULIX["frequency_Hz"][name])
    return f, 0.5 * 10 ** (np.floor(np.log10(np.maximum(f, 1e-300))) - 6)


def held(tie, **options):
    """Return a bracket held by its top and another turned by 180° about z, their ends tied to a point."""
    turned = BRACKET.placed([[-1, 0, 0], [0, -1, 0], [0, 0, 1]], [0.16 + GAP, 0.03, 0])
    ties = (
        [Attachment(0, END, tie), Attachment(1, TOP, "rigid")],
        [Attachment(0, END, tie), Attachment(2, TOP, "average")],
    )
    left = Superelement.from_matrices("left", BRACKET, PLATE, ties[0], **options)
    right = Superelement.from_matrices("right", turned, PLATE, ties[1], **options)
    return left, right, fix(1)


# Against the whole ------------------------------------------------------------------------------------------


def test_a_part_with_all_its_modes_is_the_part_itself():
    model, whole, se = joined()
    assert se.n_internal == 72
    assert se.limit == np.inf
    assert model.n_dof == 6 * 9 + 72
    found, expected = solve_modes(assemble(model), n=20), solve_modes(assemble(whole), n=20)
    assert found.n_rigid == 6
    # both solve the same equations; rounding is 1e-16 times the highest over the first elastic ω², some 1e6
    np.testing.assert_allclose(found.frequency[6:], expected.frequency[6:], rtol=1e-9)
    assert not se.frequency_error(model, found.frequency, found.shapes).any()


def check_predicted(found, expected, high, *parts, slack=1e-10):
    """Check errors against first order.

    They lie between λ uᵀGu/2 (all that was left out far away) and that over 1 - λ/λ_limit (all of it at the
    limit). Second order changes that by the share of the modes left out in the motion, which is
    2 · error · λ/(λ_limit - λ) at most.
    """
    error = found / expected - 1
    ratio = (found / min(p.limit for p in parts)) ** 2
    second = 2 * high * ratio / (1 - ratio)
    assert (error <= high * (1 + second) + slack).all()
    assert (error >= high * (1 - ratio) * (1 - second) - slack).all()


@pytest.mark.parametrize("options", [{"n_modes": 12}, {"max_frequency": 3000.0}])
def test_modes_left_out_cost_what_is_predicted(options):
    model, whole, se = joined(**options)
    assert 0 < se.n_internal < 20
    found, expected = solve_modes(assemble(model), n=14), solve_modes(assemble(whole), n=14)
    error = found.frequency[6:] / expected.frequency[6:] - 1
    high = se.frequency_error(model, found.frequency, found.shapes)[6:]
    check_predicted(found.frequency[6:], expected.frequency[6:], high, se)
    assert error.max() > 1e-5, "nothing was left out"


def test_residual_modes_leave_an_error_of_the_sixth_power():
    """The frequency error of the static response to inertia is that of the third moment, not of the first."""
    model, whole, se = joined(max_frequency=1200.0, residual=True)
    assert se.order == 3
    found, expected = solve_modes(assemble(model), n=14), solve_modes(assemble(whole), n=14)
    high = se.frequency_error(model, found.frequency, found.shapes)[6:]
    plain, _, _ = joined(max_frequency=1200.0)
    coarse = solve_modes(assemble(plain), n=14).frequency[6:] / expected.frequency[6:] - 1
    error = found.frequency[6:] / expected.frequency[6:] - 1
    assert error.max() < 0.01 * coarse.max()
    # an estimate: responses of the residual modes come on top; rounding is some 1e-8
    seen = high > 1e-7
    assert seen.sum() >= 3
    assert ((error[seen] > 0.5 * high[seen]) & (error[seen] < 2 * high[seen])).all()


def test_statics_stay_exact_whatever_is_left_out():
    mesh, _ = line(0.0, 0.4, 4)
    part = matrices_of(assemble(free(*line(0.4, 1.0, 6))))
    se = Superelement.from_matrices("part", part, mesh, [Attachment(1, (0,))], n_modes=0)
    # static stiffness of a free part tied at one point is nothing, its mass that of the rigid body
    assert abs(se.K).max() <= 1e-9 * abs(part.K).max()
    mass = 7850 * FLAT.A * 0.6
    np.testing.assert_allclose(se.M[:3, :3], mass * np.eye(3), atol=1e-12 * mass)
    np.testing.assert_allclose(se.M[1, 5], mass * 0.3, rtol=1e-12)
    np.testing.assert_allclose(se.M[5, 5], mass * 0.6**2 / 3 + 7850 * FLAT.Iz * 0.6, rtol=1e-12)


def test_a_held_part_must_be_said_to_be_held():
    mesh, frame = line(0.0, 0.4, 8)
    other = Model(*(lambda m, f: (m, (f, fix(1))))(*line(0.4, 1.0, 12)))
    part = matrices_of(assemble(other))
    with pytest.raises(ModelError, match=r"the part is not free: .*x .* Hz.*say held=True"):
        Superelement.from_matrices("part", part, mesh, [Attachment(1, (0,))])
    se = Superelement.from_matrices("part", part, mesh, [Attachment(1, (0,))], held=True)
    points = [[0, 0, 0], [0.4, 0, 0], [1, 0, 0]]
    whole = Mesh.from_lines(points, [[0, 1], [1, 2]], {"beam": [0, 1]}).split([8, 12])
    found = solve_modes(assemble(free(mesh, frame, se)), n=8)
    assert found.n_rigid == 0
    expected = solve_modes(assemble(Model(whole, (frame, fix(2)))), n=8)
    np.testing.assert_allclose(found.frequency, expected.frequency, rtol=1e-9)


def test_several_points_and_a_damped_part():
    """A beam in the middle of which a damped part sits, by both ends; the FRFs are those of the whole."""
    points = [[0, 0, 0], [0.3, 0, 0], [0.7, 0, 0], [1, 0, 0]]
    mesh = Mesh.from_lines(points, [[0, 1], [2, 3]], {"a": [0], "b": [1]}).split(4)
    frame = Frame(members={m: MemberProperties(STEEL, FLAT) for m in mesh.members})
    part = matrices_of(assemble(Model(*(lambda m, f: (m, (f,)))(*line(0.3, 0.7, 6)))))
    part = replace(part, C=2e-6 * part.K, D=0.01 * part.K)
    se = Superelement.from_matrices("mid", part, mesh, [Attachment(1, (0,)), Attachment(2, (1,))], eta=0.02)
    model = Model(mesh, (frame, se, fix(0)))
    whole = Mesh.from_lines(points, [[0, 1], [2, 3], [1, 2]], {"a": [0], "b": [1], "m": [2]}).split([4, 4, 6])
    soft = replace(STEEL, name="mid", loss_factor=0.03)
    frame = Frame(members={m: MemberProperties(soft if m == "m" else STEEL, FLAT) for m in "abm"})
    reference = Model(whole, (frame, fix(0)))
    lines = np.array([7.0, 31.0, 180.0])
    H = compute_frf(
        assemble(model), lines, [(3, "z")], [(3, "z"), (1, "ry")], "receptance", method="direct"
    ).H
    for k, f in enumerate(lines):
        system = assemble(reference)
        parts = [c for c in frame.contribution_of(reference, whole.members["m"])]
        Z = system.dynamic_stiffness(2 * np.pi * f).toarray()
        viscous = np.zeros((reference.n_dof, reference.n_dof))
        for c in parts:
            np.add.at(viscous, (c.dofs[:, :, None], c.dofs[:, None, :]), 2e-6 * c.K)
        Q = system.Q.toarray()
        Z = Z + 2j * np.pi * f * Q.T @ viscous @ Q
        b = np.zeros((reference.n_dof, 2))
        b[[20, 10], [0, 1]] = 1.0
        expected = (Q @ np.linalg.solve(Z, Q.T @ b))[20]
        np.testing.assert_allclose(H[k, 0], expected, rtol=1e-8)
    reduced = compute_frf(assemble(model), lines, [(3, "z")], [(3, "z"), (1, "ry")], "receptance").H
    np.testing.assert_allclose(reduced, H, rtol=1e-4)


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=8, deadline=None)
def test_frequencies_do_not_depend_on_where_the_part_is(seed):
    rng = np.random.default_rng(seed)
    R, shift = Rotation.random(random_state=rng.integers(2**31)).as_matrix(), rng.standard_normal(3)
    part = BRACKET.placed(R, shift)
    mesh = Mesh.from_lines(np.array([JOINT, FAR]) @ R.T + shift, [[0, 1]])
    ties = [Attachment(0, END, "rigid"), Attachment(1, TOP, "average")]
    se = Superelement.from_matrices("a", part, mesh, ties, n_modes=10)
    found = solve_modes(assemble(free(mesh, se)), n=14)
    start = Mesh.from_lines([JOINT, FAR], [[0, 1]])
    same = Superelement.from_matrices("a", BRACKET, start, ties, n_modes=10)
    expected = solve_modes(assemble(free(start, same)), n=14)
    assert found.n_rigid == expected.n_rigid == 6
    np.testing.assert_allclose(found.frequency[6:], expected.frequency[6:], rtol=1e-8)


# Against CalculiX -------------------------------------------------------------------------------------------


def test_a_free_bracket_has_calculix_own_frequencies():
    """Averaged faces stiffen nothing, so that the part is as it was."""
    mesh = Mesh.from_lines([JOINT, FAR], [[0, 1]])
    se = Superelement.from_matrices(
        "a", BRACKET, mesh, [Attachment(0, END, "average"), Attachment(1, TOP, "average")]
    )
    found = solve_modes(assemble(free(mesh, se)), n=26)
    assert found.n_rigid == 6
    # rigid-body modes at some 1e-3 Hz, not 0, cost CalculiX digits: 5e-7, by asking for more or fewer modes
    np.testing.assert_allclose(found.frequency[6:], printed("free")[0][6:], rtol=5e-7)


def test_a_held_bracket_has_calculix_own_frequencies():
    mesh = Mesh.from_lines([JOINT, FAR], [[0, 1]])
    se = Superelement.from_matrices("a", BRACKET, mesh, [Attachment(0, END), Attachment(1, TOP)])
    found = solve_modes(assemble(free(mesh, se, fix(1))), n=26)
    expected, digit = printed("held_rigid")
    assert (abs(found.frequency - expected) <= 1.01 * digit).all()


@pytest.mark.parametrize("tie", ["rigid", "average"])
def test_two_bolted_brackets_have_calculix_own_frequencies(tie):
    found = solve_modes(assemble(free(PLATE, *held(tie))), n=26)
    expected, digit = printed(f"bolted_{tie}")
    assert (abs(found.frequency - expected) <= 1.01 * digit).all()


@pytest.mark.parametrize("tie", ["rigid", "average"])
def test_two_reduced_brackets_miss_calculix_by_what_is_predicted(tie):
    model = free(PLATE, *held(tie, n_modes=30))
    found = solve_modes(assemble(model), n=20)
    expected, digit = (v[:20] for v in printed(f"bolted_{tie}"))
    parts = model.of_kind(Superelement)
    high = sum(p.frequency_error(model, found.frequency, found.shapes) for p in parts)
    check_predicted(found.frequency, expected, high, *parts, slack=1.01 * digit / expected)


def test_a_frame_on_a_bracket_misses_what_is_predicted():
    """A steel mast on the bracket's top, its end face held; modes left out against all modes."""
    mesh = Mesh.from_lines([JOINT, FAR, [0.01, 0.015, 0.58]], [[1, 2]], {"mast": [0]}).refined(0.05)
    frame = Frame(members={"mast": MemberProperties(STEEL, FLAT)})

    def model(**options):
        se = Superelement.from_matrices(
            "foot", BRACKET, mesh, [Attachment(0, END), Attachment(1, TOP)], **options
        )
        return Model(mesh, (frame, se, fix(0)))

    full, small = model(), model(max_frequency=20e3)
    (se,) = small.of_kind(Superelement)
    assert se.n_internal < 10
    found, expected = (solve_modes(assemble(m), n=8) for m in (small, full))
    check_predicted(
        found.frequency, expected.frequency, se.frequency_error(small, found.frequency, found.shapes), se
    )


def test_rows_and_places_of_several_nodes():
    nodes = BRACKET.nodes[[5, 0, 17]].tolist()
    np.testing.assert_array_equal(BRACKET.rows_at(nodes), [BRACKET.rows_of(n) for n in nodes])
    np.testing.assert_array_equal(BRACKET.places_of(nodes), [BRACKET.place_of(n) for n in nodes])
    with pytest.raises(MatricesError, match="the matrices have no row of node 0"):
        BRACKET.rows_at([nodes[0], 0])
    for lost in (0, 10**9):
        with pytest.raises(MatricesError, match=f"the place of node {lost} is not known"):
            BRACKET.places_of([nodes[0], lost])


def test_inner_motion_is_recovered():
    model, whole, se = joined()
    found, expected = solve_modes(assemble(model), n=9), solve_modes(assemble(whole), n=9)
    inner = se.motion(model, found.shapes)
    tip = inner[se.part.rows_of(1)][:, 6:]
    reference = expected.shapes[dofs_of(2)][:, 6:]
    np.testing.assert_allclose(abs(tip), abs(reference), rtol=1e-6, atol=1e-6 * abs(reference).max())


# Parameters -------------------------------------------------------------------------------------------------


def test_derivatives_by_the_parameters_are_exact():
    model, _, se = joined(n_modes=6)
    se = se.with_values(stiffness=0.2, mass=-0.1, eta=0.03)
    (at,) = se.contribute(model)
    for name, expected in (
        ("stiffness", (se.K, 0 * se.K, 0.03 * se.K)),
        ("mass", (0 * se.M, se.M, 0 * se.M)),
        ("eta", (0 * se.K, 0 * se.K, 1.2 * se.K)),
    ):
        (moved,) = se.with_values(**{name: getattr(se, name) + 1e-200j}).contribute(model)
        for X, dX in zip((moved.K, moved.M, moved.D), expected, strict=True):
            np.testing.assert_allclose(np.imag(X[0]) / 1e-200, dX, rtol=1e-14, atol=0)
    assert [p.name for p in se.parameters()] == ["stiffness", "mass", "eta"]
    assert at.dofs.shape == (1, 12)
    model = model.with_values({("part", "stiffness"): 0.44, ("part", "mass"): 0.0})
    assert model.effect("part").stiffness == 0.44


def test_a_stiffer_part_scales_its_frequencies():
    mesh = Mesh.from_lines([JOINT, FAR], [[0, 1]])
    ties = [Attachment(0, END, "average"), Attachment(1, TOP, "average")]
    se = Superelement.from_matrices("a", BRACKET, mesh, ties, n_modes=5)
    base = solve_modes(assemble(free(mesh, se)), n=9).frequency[6:]
    other = se.with_values(stiffness=0.44, mass=-0.36)
    np.testing.assert_allclose(
        solve_modes(assemble(free(mesh, other)), n=9).frequency[6:], base * 1.5, rtol=1e-10
    )


@pytest.mark.parametrize("values", [(0.0, 0.0, 0.01), (0.3, -0.1, 0.03), (-0.5, 1.0, 0.0)])
def test_the_engine_of_fits_follows_the_parameters(values):
    """Against direct solves; the tie point's forces are in its basis, 5e-5 is its accuracy there."""
    model = with_part().with_damping(Damping.structural(0.004))
    refs = [("part", name) for name in ("stiffness", "mass", "eta")]
    frequency, at = np.arange(5.0, 600.0, 15.0), [(1, "z"), (3, "y")]
    out = dof_vectors(model, at)[0]
    forces = np.hstack([out, np.eye(model.n_dof)[:, :12]])
    engine = ParametricFRF(reduce_model(model, forces, 600.0, n_krylov=2), out, out, frequency, refs)
    H, _, _ = engine.evaluate(np.array(values), np.zeros(frequency.size), gradient=False)
    changed = assemble(model.with_values(dict(zip(refs, values, strict=True))))
    exact = compute_frf(changed, frequency, at, at, "receptance", method="direct").H
    assert (abs(H - exact) <= 5e-5 * np.sqrt((abs(exact) ** 2).mean(axis=0))).all()


# What a part may be -----------------------------------------------------------------------------------------


def tie(part, ties=None, mesh=PLATE, **options):
    ties = ties or [Attachment(0, END), Attachment(1, TOP)]
    return Superelement.from_matrices("part", part, mesh, ties, **options)


def rigid_faces_diagonal(mesh):
    """Return the diagonal of K for the points' motions with everything but the two faces held."""
    out = []
    for point, nodes in ((0, END), (1, TOP)):
        rows = np.concatenate([BRACKET.rows_of(node)[:3] for node in nodes])
        T = np.vstack([lever_matrix(BRACKET.place_of(n) - mesh.points[point])[:3] for n in nodes])
        out.append(np.einsum("ij,ij->j", T, BRACKET.K[rows][:, rows] @ T))
    return np.concatenate(out)


def test_few_digits_in_the_file_leave_the_part_free():
    scale = 10.0 ** (np.floor(np.log10(np.maximum(abs(BRACKET.K.data), 1e-300))) - 7)
    K = BRACKET.K.copy()
    K.data = np.round(K.data / scale) * scale  # eight digits
    part = Matrices.from_arrays(K, BRACKET.M, BRACKET.node, BRACKET.direction, BRACKET.nodes, BRACKET.points)
    mesh = Mesh.from_lines([JOINT, FAR], [[0, 1]])
    model = free(mesh, tie(part, mesh=mesh))
    found, exact = (
        solve_modes(assemble(model), n=10),
        solve_modes(assemble(free(mesh, tie(BRACKET, mesh=mesh))), n=10),
    )
    assert found.n_rigid == 6
    (se,) = model.of_kind(Superelement)
    w, u = se.motion(model, found.shapes)[:, 6:], found.shapes[dofs_of(se.points).ravel()][:, 6:]
    # what is left of rigid-body motions is removed: dK sees a mode without its rigid part at the points
    centre = mesh.points.mean(axis=0)
    R = np.vstack([lever_matrix(p - centre) for p in mesh.points])
    weight = np.sqrt(rigid_faces_diagonal(mesh))[:, None]
    alpha = np.linalg.lstsq(weight * R, weight * u, rcond=None)[0]
    rigid = part.rigid_motions(about=centre) @ alpha
    w, u = w - rigid, u - R @ alpha
    inner = w - se.recovery[:, :12] @ u
    dK = part.K - BRACKET.K
    # Rayleigh's quotient: a change of K changes ω² of a mode w by wᵀ dK w, and f relatively by half of it
    # over ω². The rigid part costs nothing at the points, but the inside follows it by the statics of K.
    change = np.einsum("ik,ik->k", w, dK @ w) + 2 * np.einsum("ik,ik->k", inner, dK @ rigid)
    change = change / (2 * (2 * np.pi * found.frequency[6:]) ** 2)
    np.testing.assert_allclose(found.frequency[6:] / exact.frequency[6:] - 1, change, rtol=1e-2)


def test_places_that_are_not_the_matrices_own_are_noticed():
    part = replace(BRACKET, points=BRACKET.points * [1, 1, 1.05])
    with pytest.raises(ModelError, match=r"the part is not free: .*rx .*Hz"):
        tie(part)


def test_units_that_look_wrong_are_noticed():
    in_mm = BRACKET.scaled((1e3, 1e-3, 1.0))  # the file as it was, in mm, t and s, taken for SI
    mesh = Mesh.from_lines(np.array([JOINT, FAR]) * 1e3, [[0, 1]])
    with pytest.warns(UserWarning, match=r"kg/m³, which no part has; units='mm-t-s'"):
        tie(in_mm, mesh=mesh)
    far = Mesh.from_lines(np.array([JOINT, FAR]) + 9.0, [[0, 1]])
    with pytest.warns(UserWarning, match=r"point 0 lies 15.6 m from the middle of its nodes"):
        tie(BRACKET, [Attachment(0, END)], mesh=far)


@pytest.mark.parametrize(
    ("ties", "message"),
    [
        ([Attachment(0, (1, 2, 999))], "no row of node 999; they have nodes 1, 2, 3"),
        ([Attachment(9, END)], "point 9 is not in the mesh, which has points 0 to 2"),
        ([Attachment(0, END), Attachment(1, END[:3])], f"node {END[0]} is tied to the points 0 and 1"),
        (
            [Attachment(0, END[:2], "average"), Attachment(1, TOP)],
            "2 nodes tied to point 0 do not say its rotation",
        ),
        ([Attachment(0, END[:1])], "in 1 piece, of which .* is tied to point 0 and free to turn"),
        ([Attachment(0, END[:2])], "is tied to point 0 and free to turn"),
    ],
)
def test_interfaces_that_do_not_fit_are_refused(ties, message):
    with pytest.raises(ModelError, match=message):
        tie(BRACKET, ties)


def test_ties_are_checked():
    with pytest.raises(ModelError, match="the tie to point 0 is 'glue'; allowed are rigid, average"):
        Attachment(0, (1,), "glue")
    with pytest.raises(ModelError, match="2 nodes; one or more are expected, each once"):
        Attachment(0, (1, 1))
    with pytest.raises(ModelError, match="1 weights for 2 nodes"):
        Attachment(0, (1, 2), "average", (1.0,))


def test_a_node_without_a_direction_is_no_interface():
    keep = ~((BRACKET.node == END[0]) & (BRACKET.direction == 2))
    part = Matrices.from_arrays(
        BRACKET.K[keep][:, keep],
        BRACKET.M[keep][:, keep],
        BRACKET.node[keep],
        BRACKET.direction[keep],
        BRACKET.nodes,
        BRACKET.points,
    )
    with pytest.raises(ModelError, match=f"node {END[0]} has no row for Y; .*is it fixed"):
        tie(part)


def test_indefinite_matrices_are_refused():
    M = BRACKET.M.copy()
    M.data = -M.data
    with (
        pytest.raises(ModelError, match="M is not positive semidefinite"),
        pytest.warns(UserWarning, match="kg/m³"),
    ):
        tie(replace(BRACKET, M=M))
    K = BRACKET.K.copy()
    K.data = -K.data
    with pytest.raises(ModelError, match="K is not that of a part"):
        tie(replace(BRACKET, K=K))


def test_a_large_part_must_say_how_many_modes():
    K, M = (np.kron(np.eye(2), X.toarray()) for X in (BRACKET.K, BRACKET.M))
    node = np.concatenate([BRACKET.node, BRACKET.node + 1000])
    part = Matrices.from_arrays(
        K,
        M,
        node,
        np.tile(BRACKET.direction, 2),
        np.concatenate([BRACKET.nodes, BRACKET.nodes + 1000]),
        np.vstack([BRACKET.points, BRACKET.points]),
    )
    with pytest.raises(
        ModelError, match="in 2 pieces, of which the one with nodes 1001, 1002, 1003, 1004, … is not tied"
    ):
        tie(part, n_modes=5)
    # tied in both pieces: the sparse path, which must find the modes of both twins
    ties = [Attachment(p, (*nodes, *(n + 1000 for n in nodes))) for p, nodes in ((0, END), (1, TOP))]
    with pytest.raises(ModelError, match="720 coordinates inside; say how many modes"):
        tie(part, ties)
    both, one = tie(part, ties, n_modes=20), tie(BRACKET, n_modes=10)
    np.testing.assert_allclose(both.fixed_frequency, np.repeat(one.fixed_frequency, 2), rtol=1e-9)
    assert both.limit >= one.limit * (1 - 1e-9)


# Deviations of its modes ------------------------------------------------------------------------------------


def test_deviations_change_the_frequencies_with_fixed_points_and_nothing_else():
    part = Superelement.from_matrices(
        "part", BRACKET, PLATE, [Attachment(0, END), Attachment(1, TOP)], n_modes=6, residual=False
    )
    part = replace(part, n_uncertain=3)
    model = Model(PLATE, (part, fix(0), fix(1), fix(2)))
    before = solve_modes(assemble(model), n=6).frequency
    np.testing.assert_allclose(before, part.fixed_frequency, rtol=1e-9)
    changed = model.with_values({("part", "mode1"): 0.21, ("part", "mode3"): -0.19})
    expected = before * np.sqrt([1.21, 1.0, 0.81, 1.0, 1.0, 1.0])
    np.testing.assert_allclose(solve_modes(assemble(changed), n=6).frequency, np.sort(expected), rtol=1e-9)
    n_b = 6 * len(part.points)
    (one,), (other,) = (m.parts_of(m.effect("part")) for m in (model, changed))
    np.testing.assert_array_equal(one.K[0, :n_b], other.K[0, :n_b])  # statics
    again = changed.with_values({("part", "mode3"): 0.0})
    assert again.values()["part", "mode1"] == 0.21  # others stay


def test_deviations_are_linear_together_with_the_stiffness():
    part = replace(
        Superelement.from_matrices("part", BRACKET, PLATE, [Attachment(0, END)], n_modes=4), n_uncertain=4
    )
    model = Model(PLATE, (part,))

    def K(**values):
        changed = model.with_values({("part", name): v for name, v in values.items()})
        return changed.parts_of(changed.effect("part"))[0].K[0]

    both = K(stiffness=0.3, mode2=0.1) - K()
    np.testing.assert_allclose(both, K(stiffness=0.3) + K(mode2=0.1) - 2 * K(), atol=1e-9 * np.abs(K()).max())
    np.testing.assert_allclose(np.imag(K(mode2=1e-30j)) * 1e30, (K(mode2=0.1) - K()) / 0.1, atol=1e-3)


def test_static_responses_are_no_modes_that_deviate():
    options = {"max_frequency": 9000.0}
    plain, more = (
        Superelement.from_matrices("part", BRACKET, PLATE, [Attachment(0, END)], residual=r, **options)
        for r in (False, True)
    )
    assert more.n_internal > plain.n_internal
    assert plain.n_modes_below(1e9) == more.n_modes_below(1e9) == plain.n_internal
    assert plain.n_modes_below(plain.fixed_frequency[0] + 1) == 1
