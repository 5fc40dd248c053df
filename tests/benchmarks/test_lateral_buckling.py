"""Lateral and torsional buckling against closed forms and published frames.

Elements have cubic deflections and a linear twist a, whose slope misses h²/12 ∫ a''² of ∫ a'². A sine
of wave number k has its torsional energy too large by (kh)²/12. As the critical moment is the root of the
product of both stiffnesses, it is too high by (kh)²/24.
"""

import numpy as np
import pytest
import scipy.linalg as sla
from scipy.optimize import brentq

from fem import (
    DIRECTIONS,
    AddedMass,
    Frame,
    Joint,
    LineLoad,
    LoadCase,
    Material,
    MemberProperties,
    Mesh,
    Model,
    RigidLink,
    Section,
    solve_buckling,
)
from tests.frames import STEEL, beam, fix

STRIP = Section.rectangle(0.002, 0.06)
"""Deep and thin: bent about y beforehand, it buckles sideways."""
ROD = Section.circle(0.01)
EI, GJ, ROD_EI = STEEL.E * STRIP.Iz, STEEL.G * STRIP.J, STEEL.E * ROD.Iy
ROOT = np.sqrt(EI * GJ)
L = 1.0
FORKS = (fix(0, ("x", "y", "z", "rx")), fix(1, ("y", "z", "rx")))
BENT = {(0, "ry"): 1.0, (1, "ry"): -1.0}
UNIFORM = LoadCase(members=(LineLoad(member="beam", force1=(0, 0, -1.0)),))
MIDDLE = {(2, "z"): -1.0}


def lowest(model, loads, sign="positive"):
    return solve_buckling(model, loads, 1, sign=sign).factors[0]


def clamped(n, section=STRIP, **more):
    return beam(n, L, effects=(fix(0),), section=section, **more)


def forked(n):
    return beam(n, L, effects=FORKS, section=STRIP)


def forked_with_middle(n):
    mesh = beam(1, L).mesh.with_point_on("beam", L / 2).split([n // 2, n // 2])
    return Model(
        mesh, (Frame(members={"beam": MemberProperties(STEEL, STRIP, theory="euler-bernoulli")}), *FORKS)
    )


@pytest.mark.parametrize("n", [4, 8, 16])
def test_uniform_bending(n):
    # Timoshenko and Gere, Theory of Elastic Stability, 2nd ed. 1961, eq. 6-11: M = π/L √(EIz GJ)
    error = lowest(forked(n), BENT) / (np.pi * ROOT / L) - 1
    assert error == pytest.approx((np.pi / n) ** 2 / 24, rel=0.5 * (np.pi / n) ** 2)


@pytest.mark.parametrize(
    ("model", "load", "coefficient"),
    [
        # Timoshenko and Gere, ch. 6: factors of √(EIz GJ)/L², of the whole load
        pytest.param(clamped, {(1, "z"): -1.0}, 4.0126, id="cantilever, force at the end"),
        pytest.param(clamped, UNIFORM, 12.85, id="cantilever, uniform load"),
        pytest.param(forked_with_middle, MIDDLE, 16.94, id="forks, force in the middle"),
        pytest.param(forked, UNIFORM, 28.32, id="forks, uniform load"),
    ],
)
def test_deep_strips(model, load, coefficient):
    coarse, fine = (lowest(model(n), load) * L**2 / ROOT / coefficient - 1 for n in (10, 20))
    assert 0 < fine < 0.01
    # the printed coefficients have four digits
    assert coarse / fine == pytest.approx(4, rel=0.25)
    assert (4 * fine - coarse) / 3 == pytest.approx(0, abs=1e-3)


def ritz(push=0.0, height=0.0):
    """Return the factor of a force P = 1 across and a part of it along a clamped strip, by polynomials.

    ∫ EI v''² + GJ a'² dx + λ (∫ N (v'² + r² a'²) + 2 M a v'' dx - P·height a(L)²), M = -(L - x).
    """
    n = 12
    x, w = np.polynomial.legendre.leggauss(2 * n)
    x, w = (x + 1) / 2 * L, w / 2 * L
    v1 = np.array([k * x ** (k - 1) for k in range(2, n)])
    v2 = np.array([k * (k - 1) * x ** (k - 2) for k in range(2, n)])
    a = np.array([x**k for k in range(1, n)])
    a1 = np.array([k * x ** (k - 1) for k in range(1, n)])
    radius = (STRIP.Iy + STRIP.Iz) / STRIP.A
    tip = np.array([L**k for k in range(1, n)])
    cross = (v2 * w * (x - L)) @ a.T
    stiffness = sla.block_diag(EI * (v2 * w) @ v2.T, GJ * (a1 * w) @ a1.T)
    of_twist = -push * radius * (a1 * w) @ a1.T - height * np.outer(tip, tip)
    geometric = sla.block_diag(-push * (v1 * w) @ v1.T, of_twist)
    geometric[: n - 2, n - 2 :], geometric[n - 2 :, : n - 2] = cross, cross.T
    return 1 / sla.eigvalsh(-geometric, stiffness)[-1]


def test_a_deep_cantilever_with_an_axial_part():
    push = 0.05
    exact = ritz(push)
    assert ritz() == pytest.approx(4.0126 * ROOT / L**2, rel=1e-5)
    load = {(1, "z"): -1.0, (1, "x"): -push}
    coarse, fine = (lowest(clamped(m), load) / exact - 1 for m in (8, 16))
    assert 0 < fine < 0.002
    assert coarse / fine == pytest.approx(4, rel=0.05)
    # the axial part alone would need ten times that
    assert np.pi**2 / 4 * EI / (push * L**2) > 7 * exact


# ------------------------------------------------------------------------------------------------- torque


def test_torque_on_a_clamped_rod():
    # Greenhill's 2 · 4.4934 EI/L: the end holds its direction, and the kind of the moment does not matter
    held = beam(16, L, effects=(fix(0), fix(1, ("y", "z", "ry", "rz"))), section=ROD)
    found = solve_buckling(held, {(1, "rx"): 1.0}, 2, sign="both").factors
    root = 2 * 4.493409457909064
    np.testing.assert_allclose(np.sort(found) * L / ROD_EI, [-root, root], rtol=(root / 16) ** 4 / 500)


def test_a_moment_at_a_free_end_is_semitangential():
    # Ziegler, Principles of Structural Stability, 1968, ch. 5: π EI/L semitangential
    found = solve_buckling(clamped(16, ROD), {(1, "rx"): 1.0}, 2, sign="both").factors
    np.testing.assert_allclose(abs(found), np.pi * ROD_EI / L, rtol=1e-5)


def test_two_forces_on_a_rigid_bar_are_a_quasitangential_moment():
    # the same with forces that keep their direction: π/2 EI/L
    n = 16
    points = [[i / n, 0, 0] for i in range(n + 1)] + [[1, 0.1, 0], [1, -0.1, 0]]
    mesh = Mesh.from_lines(points, [[i, i + 1] for i in range(n)], {"beam": list(range(n))})
    frame = Frame(members={"beam": MemberProperties(STEEL, ROD, theory="euler-bernoulli")})
    bar = RigidLink(name="bar", point=n, dependents=(n + 1, n + 2))
    model = Model(mesh, (frame, fix(0), bar))
    found = solve_buckling(model, {(n + 1, "z"): 5.0, (n + 2, "z"): -5.0}, 2, sign="both").factors
    np.testing.assert_allclose(abs(found), np.pi / 2 * ROD_EI / L, rtol=1e-5)


def test_a_torsion_free_of_warping_gives_way_under_thrust():
    # Timoshenko and Gere, eq. 5-37: P = GJ A/(Iy + Iz) for a cruciform, whatever the length; any twist is a
    # shape, and the linear twist of an element has it exactly
    cross = Section(A=4e-4, Iy=2e-6, Iz=2e-6, J=2e-10)
    model = beam(5, L, effects=FORKS, section=cross)
    exact = STEEL.G * cross.J * cross.A / (cross.Iy + cross.Iz)
    assert lowest(model, {(1, "x"): -1.0}) == pytest.approx(exact, rel=1e-9)


# ------------------------------------------------------------------------------------------ weight and arms


@pytest.mark.parametrize("n", [1, 2, 4])
def test_a_column_under_its_own_weight(n):
    # Timoshenko and Gere, art. 2.12: qL = 7.837 EI/L², N linear within the elements; the cubics' error is of
    # order h⁴, while the mean of N in one element would be wrong by 37 %
    q = LoadCase(members=(LineLoad(member="beam", force1=(0, 0, -1.0)),))
    error = lowest(clamped(n, ROD, along=(0, 0, 1)), q) / (7.83734744 * ROD_EI / L**3) - 1
    assert 0 < error < min(0.01, 0.06 / n**4)
    # gravity is the same load
    weight = lowest(clamped(n, ROD, along=(0, 0, 1)), LoadCase(gravity=(0, 0, -1.0))) * STEEL.rho * ROD.A
    assert weight / (7.83734744 * ROD_EI / L**3) - 1 == pytest.approx(error, rel=1e-6)


H = 0.3


def rigid_head(kind):
    """Return a column of 1 m with a rigid head of 0.3 m, and the load on top of it."""
    properties = {"theory": "euler-bernoulli"} | ({"rigid2": H} if kind == "zone" else {})
    p = MemberProperties(STEEL, ROD, **properties)
    top = L + H if kind == "zone" else L
    points = [[0, 0, 0], [0, 0, top], [0, 0, L + H]][: 2 if kind in ("zone", "mass") else 3]
    mesh = Mesh.from_lines(points, [[0, 1]], {"beam": [0]})
    mesh = mesh.split(8) if kind != "zone" else mesh.with_point_on("beam", 0.7).split([8, 1])
    parts, load = (), {(1, "z"): -1.0}
    if kind == "link":
        parts, load = (RigidLink(name="head", point=1, dependents=(2,)),), {(2, "z"): -1.0}
    if kind in ("joint at the top", "joint in the middle"):
        place = np.array([0, 0, L + (H if kind.endswith("top") else H / 2)])
        parts = (Joint(name="head", point1=1, point2=2, location=place, rigid=DIRECTIONS),)
        load = {(2, "z"): -1.0}
    if kind == "elastic joint":
        K = np.diag([1e12, 1e12, 1e12, 1e9, 1e9, 1e9])
        parts = (Joint(name="head", point1=1, point2=2, location=np.array([0, 0, L]), K=K),)
        load = {(2, "z"): -1.0}
    if kind == "mass":
        parts = (AddedMass(name="head", point=1, mass=1.0, arm=np.array([0, 0, H])),)
        p = MemberProperties(Material("light", STEEL.E, 1e-9), ROD, **properties)
        load = LoadCase(gravity=(0, 0, -1.0))
    return Model(mesh, (Frame(members={"beam": p}), fix(0), *parts)), load


@pytest.mark.parametrize(
    "kind", ["zone", "link", "joint at the top", "joint in the middle", "elastic joint", "mass"]
)
def test_a_rigid_head_lowers_the_load(kind):
    # EI v'' = P (δ - v) below, straight above: tan(kL) = 1/(kH), k² = P/EI; without the arm π/2
    k = brentq(lambda k: np.cos(k * L) - H * k * np.sin(k * L), 0.5, np.pi / 2)
    found = lowest(*rigid_head(kind))
    assert found == pytest.approx(k**2 * ROD_EI, rel=1e-4)


@pytest.mark.parametrize("height", [0.01, -0.01])
@pytest.mark.parametrize("how", ["link", "offset"])
def test_the_height_of_a_load(height, how):
    def model(a):
        n = 24
        if how == "offset":
            down = np.array([0, 0, -a])
            return clamped(n, offset1=down, offset2=down), {(1, "z"): -1.0}
        points = [[i / n, 0, 0] for i in range(n + 1)] + [[1, 0, a]]
        mesh = Mesh.from_lines(points, [[i, i + 1] for i in range(n)], {"beam": list(range(n))})
        frame = Frame(members={"beam": MemberProperties(STEEL, STRIP, theory="euler-bernoulli")})
        link = RigidLink(name="arm", point=n, dependents=(n + 1,))
        return Model(mesh, (frame, fix(0), link)), {(n + 1, "z"): -1.0}

    found, exact = (f / ritz() - 1 for f in (lowest(*model(height)), ritz(height=height)))
    # Timoshenko and Gere, art. 6.3: less by about a/L √(EIz/GJ) for a force a above the axis
    assert exact == pytest.approx(-height / L * np.sqrt(EI / GJ), rel=0.06)
    assert found == pytest.approx(exact, rel=0.002, abs=0.0006)


# ------------------------------------------------------------------------------------------------- frames

ALUMINIUM = Material("aluminium", 71240e6, 2700.0, nu=0.31)
THIN, DEEP, LEG = 0.6e-3, 30e-3, 0.24
PLATE = Section(A=THIN * DEEP, Iy=DEEP * THIN**3 / 12, Iz=THIN * DEEP**3 / 12, J=DEEP * THIN**3 / 3)


def right_angle(n, first, second=()):
    mesh = Mesh.from_lines(
        [[0, 0, 0], [LEG, 0, 0], [LEG, -LEG, 0]], [[0, 1], [1, 2]], {"leg": [0], "arm": [1]}
    )
    p = MemberProperties(ALUMINIUM, PLATE, theory="euler-bernoulli")
    ends = (fix(0, first), *((fix(2, second),) if second else ()))
    return Model(mesh.split(n), (Frame(members=dict.fromkeys(("leg", "arm"), p)), *ends))


def right_angle_factor(n, force):
    return lowest(right_angle(n, DIRECTIONS), {(2, "x"): force})


@pytest.mark.parametrize(("force", "published"), [(-1.0, 0.680), (1.0, 1.088)])
def test_right_angle_cantilever(force, published):
    # Argyris, Balmer, Doltsinis et al., Comput. Methods Appl. Mech. Eng. 17/18 (1979) 1-106, fig. 21; it is
    # Code_Aster's SSLL105 (V3.01.105), with its constants: legs of 240 mm, 0.6 by 30 mm, E = 71240 N/mm²,
    # clamped, and a force along the first leg at the end of the second, towards the clamp or away from it
    coarse, fine = (right_angle_factor(n, force) for n in (8, 16))
    assert fine == pytest.approx(published, rel=1e-3)
    limit = (4 * fine - coarse) / 3
    assert limit == pytest.approx(published, rel=1.5e-3)
    assert (coarse - limit) / (fine - limit) == pytest.approx(4, rel=1e-6)  # by definition of the limit
    assert coarse - fine == pytest.approx(4 * (fine - right_angle_factor(32, force)), rel=0.1)


def test_right_angle_frame_under_moments_at_its_ends():
    # Argyris et al. 1979; Yang and Kuo 1994, ch. 6: whatever the angle of the corner M = π/L √(EI GJ) = 622.2
    # N·mm for both signs, L of one leg, if moments at the corner are semitangential
    exact = np.pi / LEG * np.sqrt(ALUMINIUM.E * PLATE.Iy * ALUMINIUM.G * PLATE.J)
    assert exact == pytest.approx(0.6222, abs=5e-5)
    model = right_angle(16, ("x", "y", "z", "rx", "ry"), ("y", "z", "rx", "ry"))
    found = solve_buckling(model, {(0, "rz"): 1.0, (2, "rz"): -1.0}, 2, sign="both").factors
    np.testing.assert_allclose(np.sort(found), [-exact, exact], rtol=0.002)


def arch_factors(number):
    """Return the lowest load factors of a quarter of a circle under moments at its ends.

    Code_Aster's SSLL404 (V3.01.404), after Timoshenko and Gere, art. 7.10: a narrow section, of radius R,
    M = (B + C)/2R ± √(((B - C)/2R)² + BC (nπ/α)²/R²), B = EI and C = GJ, α the angle. It prints moments of
    the opposite sign. The benchmark book compares them.
    """
    R, n = 0.3, 36
    material = Material("a", 7e10, 2700.0, nu=0.3)
    section = Section(A=3e-5, Iy=0.015 * 0.002**3 / 12, Iz=0.002 * 0.015**3 / 12, J=0.015 * 0.002**3 / 3)
    t = np.linspace(0, np.pi / 2, n + 1)
    points = R * np.stack([np.cos(t), np.sin(t), 0 * t], axis=1)
    mesh = Mesh.from_lines(points, [[i, i + 1] for i in range(n)], {"arch": list(range(n))})
    p = MemberProperties(material, section, theory="euler-bernoulli")
    model = Model(mesh, (Frame(members={"arch": p}), fix(0, ("x", "y", "z", "ry")), fix(n, ("y", "z", "rx"))))
    return solve_buckling(model, {(0, "rz"): 1.0, (n, "rz"): -1.0}, number, sign="both").factors
