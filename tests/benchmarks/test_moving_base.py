"""Transmissibilities on a heavy base against closed forms and against base excitation."""

import numpy as np
import pytest

from fem import (
    AddedMass,
    Damping,
    Joint,
    Material,
    ModelError,
    assemble,
    compute_base_frf,
    compute_frf,
    solve_modes,
)
from fem.effects.moving_base import HEAVIER, base_moved
from fem.reduction import ParametricFRF, reduce_model
from tests.frames import beam, fix, portal
from updating import BaseMotion, MeasurementError, Sensor, sensor_rows, with_moving_base
from updating.measurement import with_resting_base

X, Y, Z = np.eye(3)
LIGHT = Material("light", 1e10, 1e-6)
STIFFNESS, MASS = 4e4, 2.5
NEAR = 10 / HEAVIER / 0.01
"""Structure over base, seen through resonances with ratios of 1 %, and ten times that for rounding."""


def base_along(model, *directions):
    return tuple(BaseMotion(f"base {k}", model.mesh.points[0], d) for k, d in enumerate(directions))


def transmissibility(model, sensors, bases, f, method="direct"):
    moved = with_moving_base(model, bases)
    rows = (sensor_rows(moved, part) for part in (sensors, bases))
    return compute_frf(assemble(moved), f, *rows, "accelerance", method=method).H


def mass_on_spring(damping=None, eta=0.0, c=0.0):
    up = np.diag([0, 0, 1.0, 0, 0, 0])
    tie = Joint(name="spring", point1=0, location=np.zeros(3), K=STIFFNESS * up, C=c * up, eta=eta)
    held = fix(0, ("x", "y", "rx", "ry", "rz"))
    model = beam(1, 0.1, effects=(tie, AddedMass(name="m", point=0, mass=MASS), held), material=LIGHT)
    return model if damping is None else model.with_damping(damping)


@pytest.mark.parametrize("name", ["dashpot", "loss factor", "alpha"])
def test_one_mass(name):
    f = np.array([5.0, 19.0, 20.1317, 22.0, 60.0])
    w = 2 * np.pi * f
    model, tie = {
        "dashpot": (mass_on_spring(c=7.0), STIFFNESS + 7j * w),
        "loss factor": (mass_on_spring(eta=0.05), STIFFNESS * (1 + 0.05j) + 0 * w),
        "alpha": (mass_on_spring(Damping.rayleigh(6.0, 0)), STIFFNESS + 6j * w * MASS),
    }[name]
    absolute = Sensor("m", np.zeros(3), Z)
    relative = Sensor("r", np.zeros(3), Z, relative=True)
    T = transmissibility(model, (absolute, relative), base_along(model, Z), f)[:, :, 0]
    assert T[:, 0] == pytest.approx(tie / (tie - w**2 * MASS), rel=NEAR)
    # the relative motion is the difference of two that are nearly equal far below the resonance
    assert T[:, 1] == pytest.approx(
        w**2 * MASS / (tie - w**2 * MASS), rel=NEAR * (STIFFNESS / MASS / w[0] ** 2)
    )


def test_two_directions_of_a_frame_are_those_of_base_excitation():
    model = portal(0.2).with_damping(Damping.structural(0.02))
    sensors = tuple(
        Sensor(f"{p}{k}", model.mesh.points[p], d) for p in (3, 7, 11) for k, d in (("x", X), ("z", Z))
    )
    f = np.linspace(5.0, 150.0, 40)
    T = transmissibility(model, sensors, base_along(model, X, Z), f)
    exact = compute_base_frf(assemble(model), f, sensor_rows(model, sensors), ["x", "z"], method="direct").H
    assert np.abs(T - exact).max() < NEAR * np.abs(exact).max()


def test_modes_are_those_of_the_held_structure_and_the_motion_of_the_base():
    model = portal(0.2)
    held = solve_modes(assemble(model), n=5).frequency
    system = assemble(base_moved(model, np.stack([X, Z])))
    assert system.rigid.shape[1] == 2
    modes = solve_modes(system, n=7)
    assert modes.n_rigid == 2
    assert modes.frequency[2:7] == pytest.approx(held[:5], rel=1e-7)
    assert with_resting_base(system.model).effects == model.effects


def test_the_reduced_model_follows_parameters_and_its_slopes_are_exact():
    model = portal(0.2).with_effect(AddedMass(name="load", point=5, mass=0.7))
    model = model.with_damping(Damping.structural(0.02))
    bases, sensors = base_along(model, X), (Sensor("s", model.mesh.points[7], X),)
    moved = with_moving_base(model, bases)
    ends = [sensor_rows(moved, part).T for part in (sensors, bases)]
    f = np.array([8.0, 25.0, 60.0])
    reduced = reduce_model(moved, np.hstack(ends), f[-1], margin=4.0)
    engine = ParametricFRF(reduced, *ends, f, [("load", "mass")])
    zeta = np.zeros(3)
    H, dH, _ = engine.evaluate(np.array([1.5]), zeta)
    other = model.with_values({("load", "mass"): 1.5})
    exact = compute_base_frf(assemble(other), f, sensor_rows(model, sensors), ["x"], method="direct").H
    T = -H[:, 0, 0] * (2 * np.pi * f) ** 2
    assert exact[:, 0, 0] == pytest.approx(T, rel=1e-4)
    ahead, behind = (engine.evaluate(np.array([m]), zeta, False)[0] for m in (1.5 + 1e-4, 1.5 - 1e-4))
    assert dH[0] == pytest.approx((ahead - behind) / 2e-4, rel=1e-5)


def test_a_base_that_cannot_move_is_refused_in_plain_words():
    free = beam(3)
    with pytest.raises(MeasurementError, match="nothing holds the structure along the motion of its base"):
        with_moving_base(free, base_along(free, Z))
    model = portal(0.2)
    with pytest.raises(ModelError, match="2 directions, of which 1 are independent"):
        base_moved(model, np.stack([X, -X]))
    moved = with_moving_base(model, base_along(model, X))
    with pytest.raises(MeasurementError, match="where the model's base does not move"):
        sensor_rows(moved, base_along(model, Z))
    with pytest.raises(MeasurementError, match="rests in this model"):
        sensor_rows(model, base_along(model, X))
