"""Rotations from translations: virtual point, SEREP and SEMM, where the exact FRFs are known."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from benchmarks.joint_noise import beam
from fem import DIRECTIONS, assemble, compute_frf, solve_modes
from joint import (
    CoordinateSet,
    ExpansionError,
    Interface,
    coordinates_of,
    couple,
    expand_semm,
    expand_serep,
    identify_joint,
    joint_impedance,
    partition_frf,
    rigid_rows,
    stack_substructures,
    virtual_point,
)

FREQUENCY = np.linspace(30.0, 500.0, 40)
TRANSLATIONS = [(p, d) for p in (0, 4, 7, 10, 14, 20) for d in ("x", "y", "z")]
EVERY = coordinates_of([0, 4, 7, 10, 14, 20])


def dofs_of(coordinates):
    return [(int(label.split(":")[0]), label.split(":")[1]) for label in coordinates.labels]


def frf(E=210e9, coordinates=EVERY):
    at = dofs_of(coordinates)
    return compute_frf(assemble(beam((1.0, 0, 0), E)), FREQUENCY, at, at, "receptance").H


def test_a_virtual_point_recovers_a_rigid_body():
    """Nine sensors and forces around the centre of a rigid body: H_q = -(ω² M)⁻¹, exactly."""
    rng = np.random.default_rng(0)
    M = np.diag([2.0, 2.0, 2.0, 0.01, 0.02, 0.03])
    omega = 2 * np.pi * FREQUENCY
    H_q = -np.linalg.inv(M) / omega[:, None, None] ** 2
    places, e = rng.standard_normal((9, 3)) * 0.05, rng.standard_normal((9, 3))
    e /= np.linalg.norm(e, axis=1, keepdims=True)
    R = rigid_rows(places + np.array([1.0, 2.0, 3.0]), e, [1.0, 2.0, 3.0])
    # what a sensor reads: the point moves by q + θ × r
    u, theta = rng.standard_normal(3), rng.standard_normal(3)
    assert_allclose(
        R @ np.r_[u, theta], [ei @ (u + np.cross(theta, ri)) for ei, ri in zip(e, places, strict=True)]
    )
    found = virtual_point(FREQUENCY, R @ H_q @ R.T, R, R, "V")
    assert_allclose(found.H, H_q, rtol=0, atol=1e-9 * abs(H_q).max())
    assert_allclose(found.consistency, 1.0)
    assert found.outputs.labels == tuple(f"V:{d}" for d in DIRECTIONS)


def test_sensors_on_one_line_do_not_see_the_turn_about_it():
    places = np.array([[0.0, 0, 0], [0.1, 0, 0], [0.2, 0, 0]])
    R = np.vstack([rigid_rows(places, np.tile(e, (3, 1)), np.zeros(3)) for e in np.eye(3)])
    with pytest.raises(ExpansionError, match="9 sensors do not determine the motion of 'V' in rx"):
        virtual_point(FREQUENCY, np.ones((40, 9, 9)), R, R, "V")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"R_out": np.eye(4)}, r"rows of the sensors have shape \(4, 4\); \(n, 6\)"),
        ({"weight_in": np.ones(3)}, "weights of the forces have shape .*; 9 positive"),
        ({"weight_out": -np.ones(9)}, "9 positive, finite ones are needed"),
        ({"R_out": coordinates_of([1, 2]), "R_in": coordinates_of([1, 2])}, "kept on both sides"),
    ],
)
def test_a_virtual_point_of_nothing_is_refused(change, message):
    nodes = np.array([[0.02, 0, 0], [-0.01, 0.02, 0], [-0.01, -0.02, 0.01]])
    R = np.vstack([rigid_rows(nodes, np.tile(e, (3, 1)), np.zeros(3)) for e in np.eye(3)])
    given = {"frequency": [1.0], "H": np.ones((1, 9, 9)), "R_out": R, "R_in": R, "node": "V", **change}
    with pytest.raises(ExpansionError, match=message):
        virtual_point(**given)


def test_serep_gives_rotations_that_its_modes_span():
    """FRFs built from the kept modes come out exactly; torsion, which no translation sees, is not kept."""
    model = beam((1.0, 0, 0))
    modes = solve_modes(assemble(model), 14)
    every = [6 * p + DIRECTIONS.index(d) for p, d in dofs_of(EVERY)]
    measured = [6 * p + DIRECTIONS.index(d) for p, d in TRANSLATIONS]
    moves = np.abs(modes.shapes[measured]).max(axis=0) > 1e-6
    moves[: modes.n_rigid] = False  # one of these turns about the line, mixed into all of them
    shapes = modes.shapes[:, moves]
    omega = 2 * np.pi * FREQUENCY
    g = 1 / (modes.omega[moves] ** 2 * (1 + 0.01j) - omega[:, None] ** 2)
    exact = np.einsum("ir,fr,jr->fij", shapes[every], g, shapes[every])
    data = np.einsum("ir,fr,jr->fij", shapes[measured], g, shapes[measured])
    found = expand_serep(
        FREQUENCY, data, shapes[measured], shapes[measured], shapes[every], shapes[every], EVERY, EVERY
    )
    assert_allclose(found.H, exact, atol=1e-8 * abs(exact).max())
    assert_allclose(found.consistency, 1.0, rtol=1e-9)


def test_serep_names_modes_that_the_sensors_cannot_tell_apart():
    shapes = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 1.0], [0.0, 2.0, 2.0], [1.0, 0.0, 0.0]])
    with pytest.raises(ExpansionError, match="do not distinguish modes 2, 3"):
        expand_serep(
            FREQUENCY, np.ones((40, 4, 4)), shapes, shapes, shapes, shapes, *[coordinates_of([1], "xy")] * 2
        )
    with pytest.raises(ExpansionError, match="2 sensors cannot distinguish 3 modes"):
        expand_serep(
            FREQUENCY,
            np.ones((40, 2, 2)),
            shapes[:2],
            shapes[:2],
            shapes,
            shapes,
            *[coordinates_of([1], "xy")] * 2,
        )


def test_semm_is_the_measurement_where_measured_and_better_than_the_model_elsewhere():
    """The model's E is 2 % wrong: rotations mixed with exact translations come nearer the truth."""
    truth, model = frf(), frf(1.02 * 210e9)
    labels = CoordinateSet(tuple(f"{p}:{d}" for p, d in TRANSLATIONS))
    at = EVERY.positions(labels.labels)
    data = truth[:, at][:, :, at]
    found = expand_semm(FREQUENCY, data, model, EVERY, EVERY, labels, labels)
    assert_allclose(found.H[:, at][:, :, at], data, atol=1e-6 * abs(data).max())
    bend = EVERY.positions(["10:ry"])[0]
    better = np.linalg.norm(found.H[:, bend] - truth[:, bend]) / np.linalg.norm(
        model[:, bend] - truth[:, bend]
    )
    assert better < 0.1
    same = expand_semm(FREQUENCY, model[:, at][:, :, at], model, EVERY, EVERY, labels, labels)
    assert_allclose(same.H, model, atol=1e-9 * abs(model).max())


def test_a_joint_of_six_nodes_by_virtual_points():
    """Three nodes of a rigid pad on each side: their 36 coordinates become 12, and the joint comes out."""
    omega = 2 * np.pi * FREQUENCY
    rng = np.random.default_rng(3)
    pads, parts = [], []
    for side in "AB":
        # a pad of 3 nodes rigidly around the point, on a free body with 6 internal coordinates by a soft bed
        L = np.linalg.qr(rng.standard_normal((6, 6)))[0]
        K = L @ np.diag(np.geomspace(1e5, 1e7, 6)) @ L.T
        M_pad, M_in = np.diag([0.2, 0.2, 0.2, 1e-4, 1e-4, 1e-4]), np.eye(6) * 0.5
        Z = np.block([[K, -K], [-K, K]]) * (1 + 0.02j) - omega[:, None, None] ** 2 * np.block(
            [[M_pad, np.zeros((6, 6))], [np.zeros((6, 6)), M_in]]
        )
        H = np.linalg.inv(Z)
        nodes = np.array([[0.02, 0, 0], [-0.01, 0.02, 0], [-0.01, -0.02, 0.01]])
        R = np.vstack([rigid_rows(nodes, np.tile(e, (3, 1)), np.zeros(3)) for e in np.eye(3)])
        # measured: translations of the pad's nodes, and the internal coordinates
        grow = np.block([[R, np.zeros((9, 6))], [np.zeros((6, 6)), np.eye(6)]])
        measured = grow @ H @ grow.T
        inner = CoordinateSet(tuple(f"{side}i{k}:x" for k in range(6)))
        point = virtual_point(FREQUENCY, measured[:, :9, :9], R, R, side)
        across = virtual_point(FREQUENCY, measured[:, :9, 9:], R, inner, side)
        back = virtual_point(FREQUENCY, measured[:, 9:, :9], inner, R, side)
        joint = point.outputs
        assert (across.outputs, across.inputs) == (joint, inner)
        both = CoordinateSet((*joint.labels, *inner.labels))
        full = np.block([[point.H, across.H], [back.H, measured[:, 9:, 9:]]])
        parts.append(
            partition_frf(
                FREQUENCY, full, both, both, Interface(joint, inner, inner), expanded_by=point.method
            )
        )
        pads.append(R)
    whole = stack_substructures(*parts)
    assert whole.expanded_by == "virtual point"
    K = np.diag([2e6, 1e6, 3e6, 500.0, 400.0, 300.0])
    Z = joint_impedance(FREQUENCY, np.block([[K, -K], [-K, K]]), C=1e-4 * np.block([[K, -K], [-K, K]]))
    found = identify_joint(whole, FREQUENCY, couple(whole, Z).H_nn)
    good = found.regular
    assert good.mean() > 0.9
    assert_allclose(found.Z[good], Z[good], atol=1e-6 * abs(Z).max())
    assert found.expanded_by == "virtual point"
