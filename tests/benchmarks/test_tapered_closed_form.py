"""Tapered beams against closed forms, and against the differential equations integrated step by step.

Of a wedge or a cone that ends at the fraction c = d₂/d₁ of its height, A ~ ξⁿ and I ~ ξⁿ⁺² with ξ = 1 at the
clamped and c at the free end, n = 1 and 2. The modes are ξ^(-n/2) times Bessel functions of order n and of
2κ√ξ, κ⁴ = ρA ω²ℓ⁴/EI at ξ = 1 and ℓ = L/(1 - c): Cranch & Adler, J. Appl. Mech. 23 (1956) 103-108.
"""

import numpy as np
import pytest
from scipy import special
from scipy.optimize import brentq

from dovetail.file import refine
from fem import (
    Frame,
    InitialStrain,
    LineLoad,
    LoadCase,
    MemberForce,
    MemberProperties,
    Mesh,
    Model,
    Section,
    assemble,
    solve_modes,
    solve_static,
)
from fem.elements.stretches import stiffness_of_stretch
from tests.frames import STEEL, beam, fix, planar

L, D = 0.5, 0.02
CLOSED_TOLERANCE = 1e-3
"""What is said of the default mesh, as relative error of a frequency in its range."""


def cone(ratio):
    return Section.circle(D), Section.circle(ratio * D)


def wedge(ratio):
    return Section.rectangle(0.03, D), Section.rectangle(0.03, ratio * D)


def pyramid(ratio):
    return Section.rectangle(0.03, D), Section.rectangle(0.03 * ratio, ratio * D)


def narrowed(ratio):
    return Section.rectangle(0.03, D), Section.rectangle(0.03 * ratio, D)


def tube(ratio):
    return Section.tube(D, 0.002), Section.tube(max(ratio, 0.25) * D, 0.002)


SHAPES = {f.__name__: f for f in (cone, wedge, pyramid, narrowed, tube)}
BESSEL = {"cone": 2, "wedge": 1, "pyramid": 2}


def bessel_frequencies(n, ratio, first, number):
    """Return the lowest frequencies of the truncated wedge (n = 1) or cone (n = 2) [Hz]."""

    def columns(order, x, signs):
        f = (special.jv, special.yv, special.iv, special.kv)
        return np.array([s * g(order, x) for g, s in zip(f, signs, strict=True)])

    def determinant(kappa):
        tip, root = 2 * kappa * np.sqrt(ratio), 2 * kappa
        rows = np.array(
            [
                columns(n, root, (1, 1, 1, 1)),
                columns(n + 1, root, (-1, -1, 1, -1)),
                columns(n + 2, tip, (1, 1, 1, 1)),
                columns(n + 1, tip, (1, 1, 1, -1)),
            ]
        )
        return np.linalg.det(rows / np.abs(rows).max(axis=0))

    length = L / (1 - ratio)
    grid = np.arange(0.3, 14, 0.01) / (1 - ratio)
    values = [determinant(k) for k in grid]
    kappa = [
        brentq(determinant, a, b, xtol=1e-14)
        for a, b, u, v in zip(grid[:-1], grid[1:], values[:-1], values[1:], strict=True)
        if u * v < 0
    ][:number]
    omega = np.array(kappa) ** 2 / length**2 * np.sqrt(STEEL.E * first.Iy / (STEEL.rho * first.A))
    return omega / (2 * np.pi)


def shooting_frequencies(first, second, top, shear=True, steps=400):
    """Return the frequencies up to a top of a clamped beam, from its four differential equations.

    Those of Timoshenko's theory, or of Euler's, by Runge and Kutta's method of fourth order for many
    frequencies at once. The ends of the intervals in which the determinant changes its sign are drawn nearer.
    """
    half = np.linspace(0, 1, 2 * steps + 1)  # with the middles of the steps
    sections = [Section.between(first, second, float(x)) for x in half]
    A, I, k = (np.array([getattr(s, key) for s in sections]) for key in ("A", "Iy", "kz"))
    EI, kGA = STEEL.E * I, k * STEEL.G * A

    def determinant(f):
        omega2 = (2 * np.pi * f[:, None]) ** 2

        def slope(i, y):
            w, turn, V, M = np.moveaxis(y, 1, 0)
            gamma, rotary = (V / kGA[i], STEEL.rho * I[i] * omega2) if shear else (0 * V, 0.0)
            return np.stack(
                [turn + gamma, M / EI[i], -STEEL.rho * A[i] * omega2 * w, -V - rotary * turn], axis=1
            )

        y, h = np.zeros((len(f), 4, 2)), L / steps
        y[:, 2, 0], y[:, 3, 1] = EI[0] / L**2, EI[0] / L
        for n in range(steps):
            a = slope(2 * n, y)
            b = slope(2 * n + 1, y + h / 2 * a)
            c = slope(2 * n + 1, y + h / 2 * b)
            d = slope(2 * n + 2, y + h * c)
            y = y + h / 6 * (a + 2 * b + 2 * c + d)
        return np.linalg.det(y[:, 2:] / np.array([[EI[0] / L**2], [EI[0] / L]]))

    def changes(lo, hi, n):
        f = np.concatenate([np.linspace(a, b, n + 1)[: n + 1] for a, b in zip(lo, hi, strict=True)])
        value = determinant(f).reshape(len(lo), n + 1)
        row, at = np.nonzero(value[:, :-1] * value[:, 1:] < 0)
        f = f.reshape(len(lo), n + 1)
        return f[row, at], f[row, at + 1]

    lo, hi = changes([top / 400], [top], 200)
    for _ in range(4):
        lo, hi = changes(lo, hi, 30)
    return (lo + hi) / 2


def cantilever(ends, n, theory="euler-bernoulli", **more):
    first, second = ends
    return beam(n, L, effects=(fix(0),), section=first, section2=second, theory=theory, **more)


def bending_frequencies(model, number):
    return solve_modes(assemble(planar(model)), n=number).frequency


def default_mesh(ends, top, theory="timoshenko"):
    """Return the model of a study that gives no element size."""
    model = cantilever(ends, 1, theory)
    mesh, _ = refine(model.mesh, dict(model.of_kind(Frame)[0].members), top, None, {})
    return model.with_mesh(mesh)


@pytest.mark.parametrize("ratio", [0.8, 0.5, 0.3, 0.1])
@pytest.mark.parametrize("shape", BESSEL)
def test_modes_of_truncated_wedges_and_cones(shape, ratio):
    ends = SHAPES[shape](ratio)
    exact = bessel_frequencies(BESSEL[shape], ratio, ends[0], 4)
    fine = bending_frequencies(cantilever(ends, 60), 4)
    np.testing.assert_allclose(fine, exact, rtol=2e-5)
    for k in (1, 4):
        model = default_mesh(ends, exact[k - 1], "euler-bernoulli")
        got = bending_frequencies(model, k)
        np.testing.assert_allclose(got, exact[:k], rtol=CLOSED_TOLERANCE)
        assert (got >= exact[:k] * (1 - 1e-9)).all()  # compatible shapes: upper bounds


@pytest.mark.parametrize("ratio", [0.8, 0.3])
def test_the_error_falls_with_the_fourth_power_of_the_element_size(ratio):
    exact = bessel_frequencies(2, ratio, cone(ratio)[0], 2)
    errors = np.array([bending_frequencies(cantilever(cone(ratio), n), 2) / exact - 1 for n in (8, 16)])
    np.testing.assert_allclose(np.log2(errors[0] / errors[1]), 4, atol=0.35)


@pytest.mark.parametrize("ratio", [0.8, 0.5, 0.3, 0.1])
@pytest.mark.parametrize("shape", SHAPES)
def test_modes_of_tapered_timoshenko_beams_with_the_default_mesh(shape, ratio):
    ends = SHAPES[shape](ratio)
    reference = shooting_frequencies(*ends, 1500.0)
    assert reference.size >= 2
    got = bending_frequencies(default_mesh(ends, 1500.0), reference.size)
    np.testing.assert_allclose(got, reference, rtol=CLOSED_TOLERANCE)


def test_the_step_by_step_reference_is_the_closed_form():
    for shape, ratio in (("cone", 0.3), ("wedge", 0.5)):
        ends = SHAPES[shape](ratio)
        exact = bessel_frequencies(BESSEL[shape], ratio, ends[0], 3)
        got = shooting_frequencies(*ends, 1.02 * exact[-1], shear=False)
        np.testing.assert_allclose(got, exact, rtol=1e-6)


@pytest.mark.parametrize("ratio", [0.8, 0.5, 0.3, 0.1])
@pytest.mark.parametrize("n", [1, 4])
def test_tip_deflection_of_a_cone(n, ratio):
    # F L³/(3 E I₁) times d₁/d₂; one element of 10 to 1 is integrated to three digits
    model = cantilever(cone(ratio), n)
    found = solve_static(assemble(model), {(1, "z"): 1.0})
    exact = L**3 / (3 * STEEL.E * cone(ratio)[0].Iy) / ratio
    assert found.displacements[8, 0] == pytest.approx(exact, rel=1e-3 if ratio < 0.2 and n == 1 else 1e-7)


@pytest.mark.parametrize("n", [1, 3])
def test_tip_deflection_of_a_wedge_with_shear(n):
    ratio, b = 0.4, 0.03
    first, second = wedge(ratio)
    found = solve_static(assemble(cantilever((first, second), n, "timoshenko")), {(1, "z"): 1.0})
    # with h = h₂ (1 + a s), s from the tip: 12/(E b h₂³) ∫ s²/(1 + a s)³ ds + ∫ ds/(k G b h)
    h2, a = ratio * D, (1 / ratio - 1) / L
    q = 1 + a * L
    bend = 12 / (STEEL.E * b * h2**3) * (np.log(q) + 2 / q - 1 / (2 * q**2) - 1.5) / a**3
    shear = np.log(q) / a / (5 / 6 * STEEL.G * b * h2)
    assert found.displacements[8, 0] == pytest.approx(bend + shear, rel=1e-7)


def test_own_weight_and_line_loads_on_one_tapered_element():
    ratio, g = 0.5, 9.81
    ends = cone(ratio)
    weigh, load = (
        LoadCase(gravity=(0, 0, -g)),
        LoadCase(members=(LineLoad(member="beam", force1=(0, 0, -7.0)),)),
    )
    one, many = (solve_static(assemble(cantilever(ends, n)), [weigh, load]) for n in (1, 40))
    np.testing.assert_allclose(one.displacements[6:12], many.displacements[6:12], rtol=2e-5, atol=1e-18)
    # the weight beyond x is ρ g π/12 ∫ d² …: a frustum
    x = 0.3 * L
    d1, d2 = D * (1 - (1 - ratio) * 0.3), ratio * D
    frustum = np.pi / 12 * (L - x) * (d1**2 + d1 * d2 + d2**2)
    V = one.internal_forces("beam", [x])[0, 2]
    assert V[0] == pytest.approx(-STEEL.rho * g * frustum, rel=1e-3)
    assert V[1] == pytest.approx(-7.0 * (L - x), rel=1e-12)
    for s in (0.2, 0.35):
        np.testing.assert_allclose(
            one.displacements_along("beam", [s])[0, 2], many.displacements_along("beam", [s])[0, 2], rtol=1e-4
        )


def test_a_force_within_a_tapered_element_and_heat_that_is_hindered():
    ends = wedge(0.5)
    force = LoadCase(name="f", members=(MemberForce(member="beam", position=0.2, force=(0, 0, 3.0)),))
    heat = LoadCase(name="h", members=(InitialStrain(member="beam", axial=1e-4, curvature_y=0.01),))
    clamped = [
        beam(n, L, effects=(fix(0), fix(1)), section=ends[0], section2=ends[1], theory="timoshenko")
        for n in (1, 25)
    ]
    one, many = (solve_static(assemble(m), [force, heat]) for m in clamped)
    places = [0.1, 0.3, 0.45]
    np.testing.assert_allclose(
        one.internal_forces("beam", places), many.internal_forces("beam", places), rtol=1e-6, atol=1e-6
    )
    # E ε / mean(1/A)
    ratio = 0.5
    mean = np.log(1 / ratio) / (1 - ratio) / ends[0].A
    N = one.internal_forces("beam", places)[:, 0, 1]
    np.testing.assert_allclose(N, -STEEL.E * 1e-4 / mean, rtol=1e-8)
    np.testing.assert_allclose(
        one.displacements_along("beam", places),
        many.displacements_along("beam", places),
        rtol=1e-5,
        atol=1e-15,
    )


def test_a_taper_with_a_rigid_zone_an_offset_and_lumps_keeps_its_mass():
    ends = cone(0.4)
    whole = STEEL.rho * np.pi / 12 * L * D**2 * (1 + 0.4 + 0.16)
    for mass in ("consistent", "lumped", "higher-order"):
        model = cantilever(ends, 3, "timoshenko", rigid1=0.04, mass=mass, offset1=np.array([0, 0.0, 0]))
        total = sum(
            (
                np.tile([1.0, 0, 0, 0, 0, 0], c.dofs.shape[1] // 6)
                @ c.M
                @ np.tile([1.0, 0, 0, 0, 0, 0], c.dofs.shape[1] // 6)
            ).sum()
            for c in model.contributions()
            if c.M is not None
        )
        assert total == pytest.approx(whole, rel=1e-5)


def test_cutting_and_stretching_a_tapered_element_is_exact():
    (frame,) = (model := cantilever(cone(0.5), 1)).of_kind(Frame)
    (whole,) = frame.contribution_of(model, [0])
    parts = [stiffness_of_stretch(frame, model, "beam", a, b).K for a, b in ((0, 0.2), (0.2, L))]
    np.testing.assert_allclose(sum(parts), whole.K, atol=1e-6 * abs(whole.K).max())


def test_one_member_of_a_mesh_tapers_and_another_does_not():
    points, lines = [[0, 0, 0], [0, 0, L], [0.3, 0, L]], [[0, 1], [1, 2]]
    mesh = Mesh.from_lines(points, lines, {"a": [0], "b": [1]}).split(3)
    first, second = cone(0.5)
    plain = MemberProperties(STEEL, second)
    both = Model(
        mesh, (Frame(members={"a": MemberProperties(STEEL, first, section2=second), "b": plain}), fix(0))
    )
    alone = Model(mesh, (Frame(members={"a": plain, "b": plain}), fix(0)))
    rows = mesh.members["b"]
    for X in "KM":
        a, b = (getattr(m.of_kind(Frame)[0].contribution_of(m, rows)[0], X) for m in (both, alone))
        np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-12 * abs(b).max())
