"""Expansion of shapes from a few sensors, against closed forms and shapes that are known everywhere."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fem import ModelError, Modes, assemble, solve_modes
from fem.reduction import (
    expand_dynamic,
    expand_hybrid,
    expand_serep,
    expand_smooth,
    expand_static,
    reduce_guyan,
)
from tests.frames import beam, cross_beam, fix, planar, portal

PORTAL = assemble(portal(0.05))
MODES = solve_modes(PORTAL, 8)
FREE = assemble(cross_beam(0.05))


def sensor_rows(system, places):
    """Return rows (n, n_dof) of sensors at (member, position, direction) along members."""
    model = system.model
    (frame,) = (e for e in model.effects if e.kind == "frame")
    dofs, N = frame.interpolate(model.mesh, [model.mesh.locate(m, s) for m, s, _ in places])
    rows = np.zeros((len(places), model.n_dof))
    for k, (_, _, direction) in enumerate(places):
        rows[k, dofs[k]] = np.asarray(direction) / np.linalg.norm(direction) @ N[k, :3]
    return rows


SENSORS = sensor_rows(
    PORTAL,
    [
        (member, s, d)
        for member, s in (
            ("left", 0.123),
            ("left", 0.31),
            ("right", 0.222),
            ("right", 0.407),
            ("beam", 0.2),
            ("beam", 0.41),
        )
        for d in ((1, 2, 0.5), (1, -1, 2))
    ],
)


def random(*shape, seed=0):
    rng = np.random.default_rng(seed)
    return rng.standard_normal(shape)


@pytest.mark.parametrize("kind", ["real", "complex"])
@pytest.mark.parametrize("expand", [expand_serep, expand_hybrid])
def test_shapes_made_of_the_modes_come_back(expand, kind):
    c = random(8, 3) + (1j * random(8, 3, seed=1) if kind == "complex" else 0)
    true = MODES.shapes @ c
    result = expand(PORTAL, MODES, SENSORS, SENSORS @ true)
    assert np.iscomplexobj(result.shapes) == (kind == "complex")
    # rounding, larger by the condition number
    atol = 1e-14 * result.condition * np.abs(true).max() * 10
    np.testing.assert_allclose(result.shapes, true, atol=atol)
    np.testing.assert_allclose(result.amplitudes, c, atol=1e-13 * result.condition * np.abs(c).max())
    assert (result.misfit < 1e-12 * result.condition).all()


def test_noise_reaches_the_amplitudes_as_least_squares_say():
    # c - c₀ = Φ_s⁺ e, so that E‖c - c₀‖² = s² Σ σ⁻²; the mean of n draws scatters by s² √(2 Σ σ⁻⁴ / n)
    seen, n, s = SENSORS @ MODES.shapes, 4000, 1e-3
    result = expand_serep(PORTAL, MODES, SENSORS, s * random(len(SENSORS), n))
    variances = 1 / np.linalg.svd(seen, compute_uv=False) ** 2
    total = (result.amplitudes**2).sum(axis=0).mean() / s**2
    scatter = np.sqrt(2 * (variances**2).sum() / n)
    assert abs(total - variances.sum()) < 4 * scatter
    singular = np.linalg.svd(seen, compute_uv=False)
    assert result.condition == pytest.approx(singular[0] / singular[-1])


def test_hybrid_meets_every_sensor():
    measured = random(len(SENSORS), 2)
    result = expand_hybrid(PORTAL, MODES, SENSORS, measured)
    np.testing.assert_allclose(SENSORS @ result.shapes, measured, atol=1e-9)
    smooth = expand_serep(PORTAL, MODES, SENSORS, measured)
    # what the modes leave is what the statics add
    rest = expand_static(PORTAL, SENSORS, smooth.residual)
    np.testing.assert_allclose(result.shapes, smooth.shapes + rest.shapes, atol=1e-12)
    assert (smooth.misfit > 0.01).all()


def test_static_expansion_of_a_tip_deflection_is_the_cubic():
    # v = (3ξ² - ξ³)/2 of the tip's, and dv/dx = -ry
    model = beam(8, 0.7, effects=(fix(0),))
    result = expand_static(assemble(model), [(1, "z")], [1.0])
    xi = model.mesh.points[:, 0] / 0.7
    shape = result.shapes[:, 0].reshape(-1, 6)
    np.testing.assert_allclose(shape[:, 2], (3 * xi**2 - xi**3) / 2, atol=1e-9)
    np.testing.assert_allclose(shape[:, 4], -(6 * xi - 3 * xi**2) / 2 / 0.7, atol=1e-9)
    np.testing.assert_allclose(shape[:, [0, 1, 3, 5]], 0.0, atol=1e-12)


def test_static_expansion_between_nodes_goes_through_the_sensor():
    # a force at a = 0.3 L deflects v(x) = F x² (3a - x)/6EI up to a, and straight on
    model = beam(10, 1.0, effects=(fix(0),))
    system = assemble(model)
    row = sensor_rows(system, [("beam", 0.3, (0, 0, 1))])
    shape = expand_static(system, row, [1.0]).shapes[:, 0].reshape(-1, 6)[:, 2]
    x = model.mesh.points[:, 0]
    exact = np.where(x < 0.3, x**2 * (0.9 - x), 0.3**2 * (3 * x - 0.3)) / (0.3**2 * 0.6)
    np.testing.assert_allclose(shape, exact, atol=1e-9)


@pytest.mark.parametrize("system", [PORTAL, FREE], ids=["portal", "free cross"])
def test_static_expansion_from_dofs_is_guyans(system):
    keep = [(p, d) for p in (8, 12, 16, 20, 24) for d in "xyz"]
    result = expand_static(system, keep, np.eye(len(keep)))
    np.testing.assert_allclose(result.shapes, reduce_guyan(system, keep).T, atol=1e-8)
    assert result.sensors[:2] == ("8X+", "8Y+")


@pytest.mark.parametrize("system", [PORTAL, FREE], ids=["portal", "free cross"])
def test_dynamic_expansion_at_its_own_frequency_gives_the_whole_mode(system):
    modes = solve_modes(system, 11)
    wanted = slice(modes.n_rigid, modes.n_rigid + 3)
    keep = [(p, d) for p in (8, 14, 20, 26) for d in "xyz"]
    rows = [6 * p + "xyz".index(d) for p, d in keep]
    true = modes.shapes[:, wanted]
    result = expand_dynamic(system, keep, true[rows], modes.frequency[wanted])
    # ω² is exact to 1e-9, and the shape's error is that of the force that it leaves
    np.testing.assert_allclose(result.shapes, true, atol=1e-6 * np.abs(true).max())
    static = expand_static(system, keep, true[rows])
    assert np.abs(static.shapes - true).max() > 100 * np.abs(result.shapes - true).max()


def test_dynamic_expansion_at_0_hz_is_static():
    measured = random(len(SENSORS), 2)
    static = expand_static(PORTAL, SENSORS, measured)
    np.testing.assert_array_equal(expand_dynamic(PORTAL, SENSORS, measured, [0, 0]).shapes, static.shapes)


def test_smooth_expansion_misses_the_sensors_by_the_noise():
    s = 0.02 * np.abs(SENSORS @ MODES.shapes).max()
    measured = (SENSORS @ MODES.shapes)[:, :3] + s * random(len(SENSORS), 3)
    many = solve_modes(PORTAL, 40)  # more than sensors
    result = expand_smooth(PORTAL, many, SENSORS, measured, s)
    chi2 = (np.abs(result.residual / s) ** 2).sum(axis=0)
    np.testing.assert_allclose(chi2, len(SENSORS), rtol=1e-6)
    # of all shapes that miss by no more, it has the least strain energy; the true one misses by about as much
    energy = (many.omega[:, None] ** 2 * result.amplitudes**2).sum(axis=0)
    plain = expand_hybrid(PORTAL, MODES, SENSORS, measured).shapes
    K = PORTAL.Q @ PORTAL.K @ PORTAL.Q.T
    assert (energy < np.einsum("ij,ij->j", plain, K @ plain)).all()


def test_smooth_expansion_tends_to_the_static_one():
    # all modes and no noise: least strain energy that meets the sensors
    system = assemble(planar(beam(6, effects=(fix(0),))))
    every = solve_modes(system, system.n_free)
    sensors = [(p, "z") for p in (1, 3, 5)]
    measured = random(3, 2)
    result = expand_smooth(system, every, sensors, measured, 1e-6)
    static = expand_static(system, sensors, measured)
    np.testing.assert_allclose(result.shapes, static.shapes, atol=1e-4)


def test_smooth_expansion_leaves_rigid_motions_free():
    rigid = solve_modes(FREE, 12)
    keep = [(p, d) for p in (0, 2, 3, 5, 8, 20) for d in "xyz"]
    rows = [6 * p + "xyz".index(d) for p, d in keep]
    true = rigid.shapes[:, :6] @ random(6, 2)
    for noise in (1e-9, 0.1, 10.0):
        result = expand_smooth(FREE, rigid, keep, true[rows], noise)
        np.testing.assert_allclose(result.shapes, true, atol=1e-8 * np.abs(true).max())


def test_smooth_expansion_of_what_the_modes_cannot_show_is_the_best_fit():
    measured = random(len(SENSORS), 1)
    result = expand_smooth(PORTAL, MODES, SENSORS, measured, 1e-9)
    serep = expand_serep(PORTAL, MODES, SENSORS, measured)
    np.testing.assert_allclose(result.shapes, serep.shapes, atol=1e-9 * np.abs(serep.shapes).max())


@settings(max_examples=20)
@given(st.integers(0, 10**6), st.floats(0.1, 10.0))
def test_expansion_is_linear_and_does_not_depend_on_units(seed, factor):
    a, b = random(len(SENSORS), 2, seed=seed).T
    for expand in (
        lambda m: expand_static(PORTAL, SENSORS, m).shapes,
        lambda m: expand_serep(PORTAL, MODES, SENSORS, m).shapes,
        lambda m: expand_hybrid(PORTAL, MODES, SENSORS, m).shapes,
    ):
        both = expand(factor * a - 1j * b)[:, 0]
        separate = factor * expand(a)[:, 0] - 1j * expand(b)[:, 0]
        np.testing.assert_allclose(both, separate, atol=1e-8 * np.abs(both).max())


def test_fewer_sensors_than_modes_are_refused():
    with pytest.raises(ModelError, match="3 sensors cannot distinguish 8 modes; at least 8 sensors"):
        expand_serep(PORTAL, MODES, SENSORS[:3], np.zeros((3, 1)))


def test_modes_that_the_sensors_cannot_tell_apart_are_named():
    system = assemble(beam(10, effects=(fix(0),)))
    modes = solve_modes(system, 4)
    # 30 mm x 10 mm: the second mode is the first along y, at three times the first along z
    sensors = [(p, "z") for p in (1, 4, 6, 8, 9)]
    with pytest.raises(ModelError, match=r"mode 2 \(25\.07 Hz\) does not move the 5 sensors"):
        expand_serep(system, modes, sensors, np.zeros((5, 1)))
    twins = Modes(modes.frequency[[0, 2, 2]], modes.shapes[:, [0, 2, 2]])
    with pytest.raises(ModelError, match=r"cannot distinguish the modes 2 \(.*\), 3 \(.*\)"):
        expand_serep(system, twins, sensors, np.zeros((5, 1)))


def test_sensors_that_cannot_be_used_are_named():
    with pytest.raises(ModelError, match=r"supports hold sensor 0X\+"):
        expand_static(PORTAL, [(8, "x"), (0, "x")], np.zeros((2, 1)))
    with pytest.raises(ModelError, match=r"sensor 8Z\+ repeats 8Z\+"):
        expand_static(PORTAL, [(8, "z"), (9, "x"), (8, "z")], np.zeros((3, 1)))
    with pytest.raises(ModelError, match=r"6 rigid-body motions, of which 2 sensors see 2"):
        expand_static(FREE, [(0, "z"), (2, "z")], np.zeros((2, 1)))
    with pytest.raises(ModelError, match=r"12 sensors need as many rows"):
        expand_serep(PORTAL, MODES, SENSORS, np.zeros((3, 1)))
    with pytest.raises(ModelError, match="not a finite number at sensor row3"):
        expand_serep(PORTAL, MODES, SENSORS, np.where(np.arange(12) == 2, np.nan, 0.0))
    with pytest.raises(ModelError, match="1 shapes need as many frequencies"):
        expand_dynamic(PORTAL, SENSORS, np.zeros(12), [1.0, 2.0])
    with pytest.raises(ModelError, match="noise must be positive"):
        expand_smooth(PORTAL, MODES, SENSORS, np.zeros(12), 0.0)
    complex_modes = Modes(MODES.frequency, MODES.shapes * 1j)
    with pytest.raises(ModelError, match="modes are complex"):
        expand_smooth(PORTAL, complex_modes, SENSORS, np.zeros(12), 1.0)
    held = assemble(planar(beam(8, effects=(fix(0), fix(1, ("z",))))))
    f = solve_modes(held, 1).frequency[0]
    with pytest.raises(ModelError, match="natural frequency of the structure held at its sensors"):
        expand_dynamic(assemble(planar(beam(8, effects=(fix(0),)))), [(1, "z")], [1.0], [f])
