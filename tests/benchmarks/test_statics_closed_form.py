"""Static responses against closed forms. The elements are exact in statics, so that only rounding is left."""

import numpy as np
import pytest

from fem import (
    Frame,
    InitialStrain,
    Joint,
    LineLoad,
    LoadCase,
    MemberForce,
    MemberProperties,
    Mesh,
    Model,
    Section,
    assemble,
    solve_static,
)
from tests.frames import FLAT, STEEL, beam, fix

L = 1.3
PINNED = ("x", "y", "z", "rx")
ALONG = (1.0, 2.0, -0.5)
S = np.linspace(0.0, L, 14)


def solved(model, *cases):
    """Return a solution, and what rounding in K does to it: ε |u|ᵀ|K||u| relative to the loads' work."""
    system = assemble(model)
    solution = solve_static(system, cases if cases[1:] else cases[0])
    u = system.Q.T @ solution.displacements
    terms = np.einsum("ic,ic->c", abs(u), abs(system.K) @ abs(u))
    work = np.einsum("ic,ic->c", u, system.K @ u)
    share = np.divide(terms, work, out=np.ones_like(work), where=work > 0)  # 0 where nothing moves
    return solution, 10 * 2.2e-16 * float(share.max())


def local(model, u):
    R = model.effects[0].rotations(model.mesh)[0]
    return np.concatenate([u[:, :3, 0] @ R.T, u[:, 3:, 0] @ R.T], axis=1)


def ramp(a, b, q1, q2):
    """Return q(s), and the shear force and moment at s of the load from s on (a cantilever's)."""

    def q(s):
        return np.where((s > a) & (s < b), q1 + (s - a) / (b - a) * (q2 - q1), 0.0)

    def beyond(s):
        x, w = np.polynomial.legendre.leggauss(3)  # the load is linear: exact
        lo = np.clip(s, a, b)
        t = lo[:, None] + (x + 1) / 2 * (b - lo)[:, None]
        force = q1 + (t - a) / (b - a) * (q2 - q1)
        dt = w / 2 * (b - lo)[:, None]
        return (force * dt).sum(1), (force * (t - s[:, None]) * dt).sum(1)

    return q, beyond


@pytest.mark.parametrize("n", [1, 3])
@pytest.mark.parametrize("theory", ["euler-bernoulli", "timoshenko"])
@pytest.mark.parametrize("axis", ["y", "z"])
def test_a_cantilever_under_a_partial_linear_load(axis, theory, n):
    a, b, q1, q2 = 0.31, 1.12, -200.0, 450.0
    model = beam(n, L, effects=(fix(0),), theory=theory, along=ALONG)
    k = "xyz".index(axis)
    loads = [np.eye(3)[k] * q for q in (q1, q2)]
    case = LoadCase(
        members=(LineLoad(member="beam", force1=loads[0], force2=loads[1], axes="local", start=a, stop=b),)
    )
    solution, rounding = solved(model, case)
    _, beyond = ramp(a, b, q1, q2)
    V, M = beyond(S)  # a moment that bends towards the load
    forces = solution.internal_forces("beam", S)[:, :, 0]
    sign = 1 if axis == "y" else -1  # θz = dv/dx, θy = -dw/dx
    np.testing.assert_allclose(forces[:, k], V, atol=rounding * abs(V).max())
    np.testing.assert_allclose(forces[:, {"y": 5, "z": 4}[axis]], sign * M, atol=rounding * abs(M).max())
    others = np.setdiff1d(np.arange(6), [k, {"y": 5, "z": 4}[axis]])
    assert abs(forces[:, others]).max() < rounding * abs(V).max()
    # v'' = M/EI and v' = θ + V/kGA, integrated from the wall on a fine grid of Gauss points between breaks
    EI = STEEL.E * (FLAT.Iz if axis == "y" else FLAT.Iy)
    kGA = {"y": FLAT.ky, "z": FLAT.kz}[axis] * STEEL.G * FLAT.A if theory == "timoshenko" else np.inf

    def deflection(s):
        total = 0.0
        for lo, hi in ((0, min(s, a)), (a, min(s, b)), (b, s)):
            if hi > lo:
                x, w = np.polynomial.legendre.leggauss(4)
                t = lo + (x + 1) / 2 * (hi - lo)
                shear, moment = beyond(t)
                total += (w / 2 * (hi - lo) * ((s - t) * moment / EI + shear / kGA)).sum()
        return total

    expected = np.array([deflection(s) for s in S])
    found = local(model, solution.displacements_along("beam", S))[:, k]
    np.testing.assert_allclose(found, expected, atol=rounding * abs(expected).max())


@pytest.mark.parametrize("n", [2, 4])
def test_fixed_end_moments(n):
    # clamped at both ends: a triangular load qL²/30 and qL²/20, a force Pab²/L² and Pa²b/L²
    q, P, a = 700.0, 90.0, 0.4
    model = beam(n, L, effects=(fix(0), fix(1)))
    triangle = LoadCase(
        name="triangle", members=(LineLoad(member="beam", force1=(0, 0, 0), force2=(0, 0, q)),)
    )
    force = LoadCase(name="force", members=(MemberForce(member="beam", position=a, force=(0, 0, P)),))
    solution, rounding = solved(model, triangle, force)
    found = np.array([solution.reactions[f"support{p}", "ry"] for p in (0, 1)])
    b = L - a
    expected = np.array([[q * L**2 / 30, P * a * b**2 / L**2], [-q * L**2 / 20, -P * a**2 * b / L**2]])
    np.testing.assert_allclose(found, expected, rtol=rounding + 1e-14)
    shear = np.array([solution.reactions[f"support{p}", "z"] for p in (0, 1)])
    expected = [
        [-3 * q * L / 20, -P * b**2 * (L + 2 * a) / L**3],
        [-7 * q * L / 20, -P * a**2 * (L + 2 * b) / L**3],
    ]
    np.testing.assert_allclose(shear, expected, rtol=rounding + 1e-14)
    # just before the force and just after it
    before, after = solution.internal_forces("beam", [a, a + 1e-9])[:, 2, 1]
    assert before - after == pytest.approx(P, rel=1e-8)
    # deflection under the force, P a³ b³ / (3 EI L³); of the triangle, q x²(L - x)²(L + x)... /(120 EI L)
    w = solution.displacements_along("beam", [a])[0, 2]
    assert w[1] == pytest.approx(P * a**3 * b**3 / (3 * STEEL.E * FLAT.Iy * L**3), rel=rounding)
    x = a
    exact = q * x**2 * (L - x) ** 2 * (2 * L + x) / (120 * STEEL.E * FLAT.Iy * L)
    assert w[0] == pytest.approx(exact, rel=rounding)


def test_weight_is_that_of_the_mass():
    g = np.array([1.0, -2.0, -9.81])
    model = beam(3, L, effects=(fix(0),), along=ALONG, theory="timoshenko")
    weight = STEEL.rho * FLAT.A * g
    solution, rounding = solved(
        model,
        LoadCase(name="mass", gravity=g),
        LoadCase(name="load", members=(LineLoad(member="beam", force1=weight),)),
    )
    u, F = solution.displacements, solution.internal_forces("beam", S)
    np.testing.assert_allclose(u[:, 0], u[:, 1], atol=rounding * abs(u).max())
    np.testing.assert_allclose(F[:, :, 0], F[:, :, 1], atol=rounding * abs(F).max())
    reaction = [solution.reactions["support0", d][0] for d in "xyz"]
    np.testing.assert_allclose(reaction, -weight * L, rtol=rounding)


def test_heat_bends_and_pushes():
    # α(T + z T_z): held ends feel N = -EAαT and My = -EIy α T_z; free ones go αTL and αT_z L²/2
    alpha, T, Tz = 12e-6, 40.0, 900.0
    heat = LoadCase(members=(InitialStrain.thermal("beam", alpha, T, gradient_z=Tz),))
    held, rounding = solved(beam(2, L, effects=(fix(0), fix(1)), theory="timoshenko"), heat)
    forces = held.internal_forces("beam", S)[:, :, 0]
    np.testing.assert_allclose(forces[:, 0], -STEEL.E * FLAT.A * alpha * T, rtol=1e-13)
    np.testing.assert_allclose(forces[:, 4], -STEEL.E * FLAT.Iy * alpha * Tz, rtol=1e-13)
    assert abs(held.displacements_along("beam", S)).max() < 1e-13 * alpha * T * L
    model = beam(2, L, effects=(fix(0),), theory="timoshenko")
    free, rounding = solved(model, heat)
    u = local(model, free.displacements_along("beam", S))
    np.testing.assert_allclose(u[:, 0], alpha * T * S, atol=rounding * alpha * T * L)
    # κy = dθy/dx = αT_z and θy = -dw/dx: the hot upper side bends the beam down
    np.testing.assert_allclose(u[:, 2], -alpha * Tz * S**2 / 2, atol=rounding * alpha * Tz * L**2)
    assert abs(free.line_forces).max() < rounding * STEEL.E * FLAT.A * alpha * T


def test_a_settlement_of_a_propped_beam():
    # δ at the prop of a clamped beam: 3EIδ/L³ / (1 + φ/4), φ = 12EI/(kGA L²)
    delta, EI = -0.004, STEEL.E * FLAT.Iy
    phi = 12 * EI / (FLAT.kz * STEEL.G * FLAT.A * L**2)
    model = beam(3, L, effects=(fix(0), fix(1, ("z",), "prop")), theory="timoshenko")
    solution, rounding = solved(model, LoadCase(displacements={("prop", "z"): delta}))
    force = 3 * EI * delta / L**3 / (1 + phi / 4)
    assert solution.reactions["prop", "z"][0] == pytest.approx(force, rel=rounding)
    assert solution.reactions["support0", "z"][0] == pytest.approx(-force, rel=rounding)
    assert solution.displacements[8, 0] == pytest.approx(delta, rel=1e-14)


def test_a_beam_on_a_spring():
    # a cantilever's tip on a spring k takes P k L³/(3EI) / (1 + k L³/(3EI)) of a force P there
    k, P = 2e3, 50.0
    spring = Joint(name="spring", point1=1, location=np.array([L, 0, 0]), K=np.diag([0, 0, k, 0, 0, 0]))
    solution, rounding = solved(beam(2, L, effects=(fix(0), spring)), LoadCase(points={(1, "z"): P}))
    ratio = k * L**3 / (3 * STEEL.E * FLAT.Iy)
    assert solution.springs["spring", "z"][0] == pytest.approx(-P * ratio / (1 + ratio), rel=rounding)
    total = solution.springs["spring", "z"] + solution.reactions["support0", "z"]
    assert total[0] == pytest.approx(-P, rel=rounding)
    assert set(solution.springs) == {("spring", "z")}


def test_a_fixed_portal_under_a_horizontal_load():
    # Half of P at each corner leaves the beam without axial force. The frame moves antisymmetrically: sway
    # u, corner rotation θ, the columns' stretch ±w. With EIc, h for the columns, EIb, l for the beam:
    #   corner moment from the beam    6EIb/l θ - 12EIb/l² w,
    #   vertical equilibrium           (EAc/h + 24EIb/l³) w = 12EIb/l² θ,
    # so that a column that stretches makes the beam softer by 1 - r, r = s/(1 + s), s = 24 Ib h/(Ac l³). With
    # k = (1 - r) Ib h/(Ic l) the corner's 4EIc/h θ + 6EIc/h² u + (1 - r) 6EIb/l θ = 0 and the sway's
    # 12EIc/h³ u + 6EIc/h² θ = P/2 give Kleinlogel's
    #   M_foot = P h/2 (3k + 1)/(6k + 1),   M_corner = P h/2 · 3k/(6k + 1).
    h, l, P = 0.7, 1.1, 120.0
    column, girder = Section.rectangle(0.03, 0.012), Section.rectangle(0.03, 0.02)
    mesh = Mesh.from_lines(
        [[0, 0, 0], [0, 0, h], [l, 0, h], [l, 0, 0]],
        [[0, 1], [1, 2], [3, 2]],
        {"left": [0], "girder": [1], "right": [2]},
    ).split(2)
    frame = Frame(
        members={
            name: MemberProperties(STEEL, girder if name == "girder" else column, theory="euler-bernoulli")
            for name in mesh.members
        }
    )
    model = Model(mesh, (frame, fix(0, name="foot0"), fix(3, name="foot1")))
    solution, rounding = solved(model, LoadCase(points={(1, "x"): P / 2, (2, "x"): P / 2}))
    s = 24 * girder.Iy * h / (column.A * l**3)
    k = (1 - s / (1 + s)) * girder.Iy * h / (column.Iy * l)
    foot, corner = P * h / 2 * (3 * k + 1) / (6 * k + 1), P * h / 2 * 3 * k / (6 * k + 1)
    for name in ("left", "right"):
        M = solution.internal_forces(name, [0, h])[:, 4, 0]
        np.testing.assert_allclose(abs(M), [foot, corner], rtol=rounding)
        assert M[0] * M[1] < 0
    M = solution.internal_forces("girder", [0, l])[:, 4, 0]
    np.testing.assert_allclose(abs(M), corner, rtol=rounding)
    assert solution.internal_forces("left", [0.1])[0, 0, 0] == pytest.approx(2 * corner / l, rel=rounding)
    assert solution.internal_forces("right", [0.1])[0, 0, 0] == pytest.approx(-2 * corner / l, rel=rounding)
    # and Kleinlogel's own values, of columns that do not stretch: s is the relative change of k
    k = girder.Iy * h / (column.Iy * l)
    for name, own, slope in (("foot", (3 * k + 1) / (6 * k + 1), -3), ("corner", 3 * k / (6 * k + 1), 3)):
        change = {"foot": foot, "corner": corner}[name] / (P * h / 2) - own
        assert change == pytest.approx(-slope * k * s / (6 * k + 1) ** 2, rel=2 * s)
