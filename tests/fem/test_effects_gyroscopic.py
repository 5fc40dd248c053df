"""Rotors make FRFs that are not reciprocal: direct solutions, the reduced engine, and what refuses them."""

import numpy as np
import pytest

from fem import FRF, Damping, FRFError, Joint, ModelError, Support, assemble, compute_frf, differentiate_frf
from fem.effects import GroundDamper, PointInertia, Rotor, SideSpring
from fem.reduction import LocalChanges, ParametricFRF, reduce_model
from tests.frames import FLAT, STEEL, beam, cross_beam, fix, portal
from updating import Measurement, Sensor, assessed_fit, build_problem
from updating.diagnosis.evidence import screen
from updating.forecast import Grid

PLACES = [(3, "y"), (7, "z"), (12, "ry"), (5, "x")]
FREQUENCY = np.linspace(20.0, 600.0, 25)


def spinning(momentum, size=0.1):
    model = cross_beam(size).with_damping(Damping.structural(0.01))
    rotor = Rotor(name="r", point=3, axis=(0.6, 0.0, 0.8), momentum=momentum)
    return model, rotor


def receptance(model, outputs, inputs, method="auto"):
    system = assemble(model, reciprocal=False)
    return compute_frf(system, FREQUENCY, outputs, inputs, "receptance", method).H


def test_turned_round_a_rotor_exchanges_forces_and_responses():
    """Zᵀ(h) = Z(-h), hence H_ij(h) = H_ji(-h) (Onsager and Casimir); to rounding of Z's solution, 1e-16 κ."""
    model, rotor = spinning(0.5)
    turns, back = (model.with_effect(rotor.with_values(momentum=h)) for h in (0.5, -0.5))
    H, G = receptance(turns, PLACES, PLACES[:2]), receptance(back, PLACES[:2], PLACES)
    np.testing.assert_allclose(H, np.swapaxes(G, 1, 2), rtol=0, atol=1e-9 * abs(H).max())
    # it does differ from the other direction's
    assert (abs(H[:, 0, 1] - H[:, 1, 0]) > 0.5 * abs(H[:, 0, 1])).mean() > 0.5


def test_direct_solutions_are_those_of_a_dense_solver():
    model, rotor = spinning(0.5)
    model = model.with_effect(rotor).with_damping(Damping.modal(0.01))
    system = assemble(model, reciprocal=False)
    K, M, C, D, Q = (X.toarray() for X in (system.K, system.M, system.C, system.D, system.Q))
    dofs = [6 * p + ("x", "y", "z", "rx", "ry", "rz").index(d) for p, d in PLACES]
    expected = []
    for omega in 2 * np.pi * FREQUENCY:
        Z = K * (1 + 0.02j) + 1j * (D + omega * C) - omega**2 * M  # a modal ratio is half a loss factor
        expected.append((Q @ np.linalg.solve(Z, Q.T.astype(complex)))[np.ix_(dofs, dofs)])
    H = receptance(model, PLACES, PLACES)
    np.testing.assert_allclose(H, expected, rtol=0, atol=1e-9 * abs(H).max())


def test_the_reduced_engine_and_its_slopes_hold_for_a_rotor():
    model, rotor = spinning(0.5)
    n = model.n_dof
    dofs = [6 * p + ("x", "y", "z", "rx", "ry", "rz").index(d) for p, d in PLACES]
    forces = np.eye(n)[:, dofs]
    reduced = reduce_model(model, forces, 600.0, margin=6, n_krylov=3).with_forces_of([rotor])
    ref = (rotor.name, "momentum")
    engine = ParametricFRF(reduced, forces, forces[:, :2], FREQUENCY, [ref], [rotor])
    zero = np.zeros(len(FREQUENCY))
    H, slopes, _ = engine.evaluate(np.array([0.5]), zero)
    assert slopes is not None
    exact = receptance(model.with_effect(rotor), PLACES, PLACES[:2])
    # The basis leaves the more the less a mode is in it: (1/6)^(2·3) of each resonance's own size.
    assert abs(H - exact).max() <= 6.0**-6 * abs(exact).max()
    step = 1e-4
    at = [engine.evaluate(np.array([0.5 + k * step]), zero, gradient=False)[0] for k in (-2, -1, 1, 2)]
    near, far = (at[2] - at[1]) / (2 * step), (at[3] - at[0]) / (4 * step)
    assert abs(slopes[0] - near).max() <= abs(far - near).max() + 1e-9 * abs(near).max()
    # The low-rank update adds what the basis lacks of the rotor's own forces; here it lacks next to nothing.
    state = LocalChanges.of(ParametricFRF(reduced, forces, forces[:, :2], FREQUENCY, []), np.zeros(0), zero)
    (updated,) = state.receptances([rotor])
    assert abs(updated - exact).max() <= 6.0**-6 * abs(exact).max()


def test_what_relies_on_symmetry_refuses_a_rotor():
    model, rotor = spinning(0.5)
    system = assemble(model.with_effect(rotor), reciprocal=False)
    with pytest.raises(FRFError, match="'reduced' needs symmetric matrices"):
        compute_frf(system, FREQUENCY, PLACES, PLACES, method="reduced")
    with pytest.raises(ModelError, match="not symmetric"):
        differentiate_frf(system, FREQUENCY, PLACES, PLACES)
    with pytest.raises(ModelError, match="not symmetric"):
        assemble(model.with_effect(rotor))


def test_new_kinds_are_proposed_where_they_can_be():
    model = portal(0.1)
    places = {e.point for e in Rotor.propose(model)}
    feet = {e.point for e in model.of_kind(Support)}
    assert places
    assert not places & feet, "a clamped foot does not turn"
    other_sides = {j.point2 for j in model.of_kind(Joint)}  # 20 mm away, and turning alike
    assert {e.point for e in GroundDamper.propose(model)} == places | other_sides
    assert not places & other_sides
    assert len(PointInertia.propose(model)) == 3
    assert len(SideSpring.propose(model)) == 6


def test_what_the_measured_directions_do_not_see_does_not_go_on():
    """A cantilever driven and measured in one plane: a spring along y or a rotor about y is unseen."""
    model = beam(8, 0.6, effects=(fix(0, name="wall"),)).with_damping(Damping.modal(0.01))
    points = model.mesh.points
    sensors = tuple(Sensor(f"s{p}", points[p], np.array([0.0, 0, 1])) for p in (1, 4, 6))
    f = np.linspace(10, 500, 60)
    rows = np.zeros((3, model.n_dof))
    for i, p in enumerate((1, 4, 6)):
        rows[i, 6 * p + 2] = 1.0
    H = compute_frf(assemble(model), f, rows, rows[:1], "receptance").H
    frf = FRF.from_arrays(f, H, "receptance", [s.name for s in sensors], [sensors[0].name])
    problem = build_problem(model, Measurement(frf, sensors, sensors[:1]), ())
    seen = SideSpring.propose(model)[1]
    unseen = SideSpring.propose(model)[0]
    assert (seen.direction, unseen.direction) == ("z", "y")
    rotor = next(e for e in Rotor.propose(model) if e.name.endswith("x"))
    about_y = next(e for e in Rotor.propose(model) if e.name.endswith("y"))
    grids = [Grid.of(problem, e) for e in (unseen, seen, about_y, rotor)]
    fitted = assessed_fit(problem)
    chosen = screen(problem, (fitted, problem.at_nominal(fitted)), grids, far=True)
    # A rotor about x turns motion in the plane out of it; one about y couples twist and turning about z only.
    assert {c.effect.name for c in chosen} == {seen.name, rotor.name}


def test_a_rotary_inertia_is_that_of_a_body_in_lumps():
    """N at a node is the node's own rotation, so that M is I on its three rotations, and nothing else."""
    model = beam(4, 1.0, section=FLAT, material=STEEL)
    (candidate,) = PointInertia.propose(model)
    at_node = candidate.with_values(position=0.5, inertia=0.2)
    (c,) = at_node.contribute(model)
    assert c.M is not None
    M = np.zeros((model.n_dof, model.n_dof))
    np.add.at(M, (c.dofs[:, :, None], c.dofs[:, None, :]), c.M)
    node = int(model.mesh.nearest_point(np.array([0.5, 0, 0]))[0])
    expected = np.zeros_like(M)
    expected[6 * node + 3 : 6 * node + 6, 6 * node + 3 : 6 * node + 6] = 0.2 * np.eye(3)
    np.testing.assert_allclose(M, expected, atol=1e-15)
