"""Strain gauges on a cantilever against closed forms: tip loads, and curvatures of Euler-Bernoulli modes."""

import numpy as np
import pytest
from scipy.optimize import brentq

from fem import Frame, MemberProperties, Mesh, Model, Section, assemble, solve_modes
from tests.frames import FLAT, STEEL, beam, fix
from updating import MeasurementError, StrainGauge, place_sensors, sensor_rows
from updating.measurement import SHORT

L, OFFSET = 1.2, (0.011, 0.004)
THIN = Section.rectangle(0.03, 1e-4)  # rotary inertia changes curvatures by some (h/L)²


def gauge(x, offset=OFFSET, direction=(1.0, 0.0, 0.0), **more):
    return StrainGauge("g", np.array([x, 0, 0]), np.array(direction), "beam", offset=offset, **more)


def cantilever(n, x=0.3, section=FLAT, theory="euler-bernoulli"):
    model = beam(n, L, section=section, theory=theory, effects=(fix(0),))
    mesh = place_sensors(model.mesh, (gauge(x),))
    return type(model)(mesh, model.effects)


def local_axes(model):
    (frame,) = [e for e in model.effects if hasattr(e, "rotations")]
    return frame.rotations(model.mesh)[0]


@pytest.mark.parametrize("theory", ["euler-bernoulli", "timoshenko"])
@pytest.mark.parametrize("x", [0.0, 0.3, 0.77])
def test_strains_under_a_tip_load_are_those_of_the_closed_form(theory, x):
    model = cantilever(3, x, theory=theory)
    system, axes, (y, z) = assemble(model), local_axes(model), OFFSET
    tip = model.mesh.nearest_point([L, 0, 0])[0]
    force = np.array([300.0, -20.0, 35.0])
    f = np.zeros(model.n_dof)
    f[6 * tip : 6 * tip + 3] = force
    u = system.Q @ np.linalg.solve(np.asarray(system.K.todense()), system.Q.T @ f)
    N, Fy, Fz = axes @ force  # along the local axes
    E, s = STEEL.E, FLAT
    exact = N / (E * s.A) - y * Fy * (L - x) / (E * s.Iz) - z * Fz * (L - x) / (E * s.Iy)
    for sign in (1.0, -1.0):
        reading = gauge(x, direction=(sign, 0, 0), gain=1e6).row(model) @ u
        assert reading == pytest.approx(sign * 1e6 * exact, rel=1e-7)


def test_strains_of_a_bent_frame_are_those_of_statics():
    """A skew cantilever with a bent arm is determinate: its section forces follow from the load alone."""
    points = np.array([[0.0, 0, 0], [0.4, 0.5, 0.6], [0.9, 0.3, 0.7]])
    mesh = Mesh.from_lines(points, [[0, 1], [1, 2]], {"post": [0], "arm": [1]})
    frame = Frame(members=dict.fromkeys(mesh.members, MemberProperties(STEEL, FLAT)))
    place, offset = points[0] + 0.35 * (points[1] - points[0]), (-0.013, 0.005)
    axis = (points[1] - points[0]) / np.linalg.norm(points[1] - points[0])
    one = StrainGauge("g", place, axis, "post", offset=offset)
    model = Model(place_sensors(mesh, (one,)), (frame, fix(0)))
    system, force = assemble(model), np.array([40.0, -70.0, 25.0])
    f = np.zeros(model.n_dof)
    f[12:15] = force
    u = system.Q @ np.linalg.solve(np.asarray(system.K.todense()), system.Q.T @ f)
    R = frame.rotations(model.mesh)[0]
    N, (_, My, Mz) = R[0] @ force, R @ np.cross(points[2] - place, force)
    exact = (
        N / (STEEL.E * FLAT.A) + offset[1] * My / (STEEL.E * FLAT.Iy) - offset[0] * Mz / (STEEL.E * FLAT.Iz)
    )
    assert one.row(model) @ u == pytest.approx(exact, rel=1e-8)


def mode(n):
    """Return the root, and deflection and curvature of a clamped-free mode over x/L."""
    b = brentq(lambda b: np.cos(b) + 1 / np.cosh(b), (n - 0.5) * np.pi - 0.4, (n - 0.5) * np.pi + 0.4)
    s = (np.sinh(b) - np.sin(b)) / (np.cosh(b) + np.cos(b))

    def w(x):
        return np.cosh(b * x) - np.cos(b * x) - s * (np.sinh(b * x) - np.sin(b * x))

    def bent(x):
        return b**2 / L**2 * (np.cosh(b * x) + np.cos(b * x) - s * (np.sinh(b * x) + np.sin(b * x)))

    return b, w, bent


@pytest.mark.parametrize("short", [True, False])
@pytest.mark.parametrize("n", [1, 2, 3, 4])
def test_strains_of_modes_err_as_the_elements_beside_the_gauge(n, short):
    x, elements, (b, w, bent) = 0.3, 12, mode(n)
    model = cantilever(elements, x, THIN) if short else beam(elements, L, section=THIN, effects=(fix(0),))
    h = SHORT * L if short else L / elements  # without the short elements the gauge is at a node as well
    modes, axes = solve_modes(assemble(model), n=12), local_axes(model)
    tip = model.mesh.nearest_point([L, 0, 0])[0]
    along = np.abs(axes[2] @ modes.shapes[6 * tip : 6 * tip + 3]) > 1e-3 * np.abs(modes.shapes).max(axis=0)
    shape = modes.shapes[:, np.flatnonzero(along)[n - 1]]
    reading = gauge(x, (0.0, 1.0)).row(model) @ shape / (axes[2] @ shape[6 * tip : 6 * tip + 3])
    exact = -bent(x / L) / w(1.0)
    # within an element the curvature is linear: at its ends κ'' h²/12 too low, κ'' = (b/L)⁴ w
    predicted = (b / L) ** 4 * w(x / L) / w(1.0) * h**2 / 12
    of_field = abs(exact) * (b / elements) ** 4 / 100  # the error of the mesh's motion, of higher order
    assert abs(reading - exact - predicted) < 0.1 * abs(predicted) + of_field


def test_gauges_split_a_member_once_and_leave_no_slivers():
    mesh = beam(4, L).mesh
    one = place_sensors(mesh, (gauge(0.31),))
    assert one.n_points == mesh.n_points + 3
    assert place_sensors(one, (gauge(0.31, (0.0, -0.004)), gauge(0.31))).n_points == one.n_points
    assert place_sensors(mesh, (gauge(L / 4),)).n_points == mesh.n_points + 2
    assert place_sensors(mesh, (gauge(0.0),)).n_points == mesh.n_points + 1
    assert place_sensors(one, (gauge(0.31 + 0.4 * SHORT * L),)).lengths().min() > 0.3 * SHORT * L


def test_gauges_that_read_no_strain_are_refused():
    model = cantilever(4)
    for other, words in (
        (gauge(0.3, direction=(0.0, 0.0, 1.0)), "90° off the axis of 'beam'"),
        (
            StrainGauge("g", np.array([0.3, 0.2, 0]), np.array([1.0, 0, 0]), "beam"),
            "is 0.2 m from the nearest",
        ),
    ):
        with pytest.raises(MeasurementError, match=words):
            sensor_rows(model, [other])
    with pytest.raises(MeasurementError, match=r"is 0\.2 m from the member 'beam'; at most"):
        place_sensors(
            Mesh.from_lines([[0, 0, 0], [L, 0, 0]], [[0, 1]], {"beam": [0]}),
            (StrainGauge("g", np.array([0.3, 0.2, 0]), np.array([1.0, 0, 0]), "beam"),),
        )
