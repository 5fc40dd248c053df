"""Beams and rods against closed forms, with the discretisation error that theory predicts."""

import numpy as np
import pytest

from fem import (
    DIRECTIONS,
    AddedMass,
    Damping,
    Frame,
    Joint,
    Material,
    MemberProperties,
    Mesh,
    Model,
    Section,
    assemble,
    compute_frf,
    lever_matrix,
    solve_modes,
)
from fem.effects import Preload
from tests.frames import FLAT, STEEL, beam, fix, planar

PINNED = ("x", "y", "z")
ROOTS = {  # cosh β cos β = 1, -1; tan β = tanh β
    "free-free": ([4.730040745, 7.853204624, 10.995607838, 14.137165491], ()),
    "cantilever": ([1.875104069, 4.694091133, 7.854757438, 10.995540735], (fix(0),)),
    "clamped-pinned": (
        [3.926602312, 7.068582746, 10.210176123, 13.351768778],
        (fix(0), fix(1, PINNED)),
    ),
}
LIGHT = Material("light", 1e10, 1e-6)
"""Gives points of a mesh their lines, and no mass to speak of."""


def elastic(model, n=40):
    modes = solve_modes(assemble(model), n)
    return modes.frequency[modes.n_rigid :]


def nearest(found, exact):
    return found[np.argmin(abs(found - exact))]


@pytest.mark.parametrize("along", [(1, 0, 0), (1, 2, -0.5)])
@pytest.mark.parametrize("name", ROOTS)
def test_euler_bernoulli_frequencies_are_too_high_by_the_predicted_error(name, along):
    # Cubic elements with consistent mass: f_h = f (1 + (βh)⁴/1440 + O((βh)⁶)), from the dispersion relation.
    roots, supports = ROOTS[name]
    n, length = 12, 1.3
    found = elastic(beam(n, length, effects=supports, along=along))
    for inertia in (FLAT.Iy, FLAT.Iz):
        for root in roots:
            exact = root**2 / (2 * np.pi * length**2) * np.sqrt(STEEL.E * inertia / (STEEL.rho * FLAT.A))
            error, predicted = nearest(found, exact) / exact - 1, (root / n) ** 4 / 1440
            # the next term is of relative size (βh)²; 1e-9 is twice the roots' last digit
            assert abs(error - predicted) < 0.15 * (root / n) ** 2 * predicted + 1e-9


def test_euler_bernoulli_error_falls_by_sixteen_when_elements_are_halved():
    exact = 4.694091133**2 / (2 * np.pi) * np.sqrt(STEEL.E * FLAT.Iy / (STEEL.rho * FLAT.A))
    coarse, fine = (nearest(elastic(beam(n, effects=(fix(0),)), 8), exact) / exact - 1 for n in (6, 12))
    # the two next terms differ by (βh)² (1 - 1/4), times a number below 0.15
    assert coarse / fine == pytest.approx(16, rel=0.15 * (4.694 / 6) ** 2 * 0.75)


@pytest.mark.parametrize("kind", ["axial", "torsion"])
def test_rods_have_the_error_of_linear_shape_functions(kind):
    # f_h = f (1 + (kh)²/24 + O((kh)⁴)); fixed-free, k L = (m - ½) π
    n, length = 20, 1.7
    keep, speed = ("x",), np.sqrt(STEEL.E / STEEL.rho)
    if kind == "torsion":
        keep, speed = ("rx",), np.sqrt(STEEL.G * FLAT.J / (STEEL.rho * (FLAT.Iy + FLAT.Iz)))
    found = elastic(planar(beam(n, length, effects=(fix(0),)), keep), 5)
    for m, f in enumerate(found, start=1):
        kL = (m - 0.5) * np.pi
        predicted = (kL / n) ** 2 / 24
        error = f / (kL * speed / (2 * np.pi * length)) - 1
        assert abs(error - predicted) < 0.1 * (kL / n) ** 2 * predicted + 1e-9


def timoshenko_pinned(m, length, material, section):
    """Return both frequencies of a pinned beam with m half waves, from the quadratic in ω² [Hz]."""
    k = m * np.pi / length
    E, rho, A, second = material.E, material.rho, section.A, section.Iy
    shear = section.kz * material.G * A
    a = rho**2 * A * second
    b = -(rho * A * (E * second * k**2 + shear) + rho * second * shear * k**2)
    c = shear * k**2 * E * second * k**2
    return np.sort(np.sqrt(np.roots([a, b, c]).real)) / (2 * np.pi)


def test_timoshenko_beam_reaches_both_spectra():
    length, section = 1.0, Section.rectangle(0.1, 0.2)
    first = [timoshenko_pinned(m, length, STEEL, section)[0] for m in (1, 2, 3, 4)]
    second = [timoshenko_pinned(m, length, STEEL, section)[1] for m in (1, 2)]
    # shear alone, with no half wave at all
    shear = np.sqrt(section.kz * STEEL.G * section.A / (STEEL.rho * section.Iy)) / (2 * np.pi)
    exact = np.array([*first, shear, *second])
    errors = []
    for n in (40, 80):
        ends = (fix(0, PINNED), fix(1, PINNED))
        model = planar(beam(n, length, effects=ends, section=section, theory="timoshenko"))
        found = elastic(model, 25)
        errors.append(np.array([nearest(found, f) for f in exact]) / exact - 1)
    coarse, fine = errors
    # The shear strain is constant in an element: too stiff, of second order. Half the size has a quarter of
    # the error; extrapolated, the fourth order is left: bending's, and the second squared. 1e-8: rounding.
    kh = np.array([1, 2, 3, 4, 0, 1, 2]) * np.pi / 40
    assert (fine > 0).all()
    np.testing.assert_allclose(coarse / fine, 4, rtol=0.01)
    assert (abs(4 * fine - coarse) / 3 < kh**4 / 1440 + 5 * fine**2 + 1e-8).all()


@pytest.mark.parametrize("n", [10, 20, 40])
def test_mass_of_higher_order_takes_off_what_shear_errs_by(n):
    # The rest, of rotary inertia where shear counts: a fifth as deep as long, it is 3 % of that.
    length, section = 1.0, Section.rectangle(0.1, 0.2)
    exact = np.array([timoshenko_pinned(m, length, STEEL, section)[0] for m in (1, 2, 3)])

    def errors(mass):
        ends = (fix(0, PINNED), fix(1, PINNED))
        model = planar(beam(n, length, effects=ends, section=section, theory="timoshenko", mass=mass))
        found = elastic(model, 20)
        return np.array([nearest(found, f) for f in exact]) / exact - 1

    assert (abs(errors("higher-order")) < errors("consistent") / 20).all()


def test_tip_deflection_of_a_cantilever_includes_shear():
    length = 0.3
    model = beam(3, length, effects=(fix(0),), theory="timoshenko", along=(1, -1, 0.3))
    S = assemble(model)
    axes = model.effects[0].rotations(model.mesh)[0]
    for row, inertia, k in ((2, FLAT.Iy, FLAT.kz), (1, FLAT.Iz, FLAT.ky)):
        force = np.zeros(model.n_dof)
        force[6:9] = axes[row]
        u = S.Q @ np.linalg.solve(S.K.toarray(), S.Q.T @ force)
        expected = length**3 / (3 * STEEL.E * inertia) + length / (k * STEEL.G * FLAT.A)
        assert force @ u == pytest.approx(expected, rel=1e-9)  # exact in statics: rounding only
        low = compute_frf(S, [0.0], force[None], force[None], kind="receptance").H[0, 0, 0]
        assert low == pytest.approx(expected, rel=1e-8)


def test_tension_and_buckling_of_a_pinned_beam():
    ends = (fix(0, PINNED), fix(1, ("y", "z")))
    n, length = 10, 1.0
    EI, m = STEEL.E * FLAT.Iy, STEEL.rho * FLAT.A
    euler = np.pi**2 * EI / length**2

    def squares(tension, count):
        pull = Preload(name="pull", member="beam", tension=tension, buckling=euler)
        return (2 * np.pi * elastic(planar(beam(n, length, effects=(*ends, pull))), count)) ** 2

    k = np.pi * np.arange(1, 4) / length
    for tension in (5 * euler, -0.5 * euler):
        exact = k**4 * EI / m + k**2 * tension / m
        # From above; the bending part of ω² errs by (kh)⁴/720, the tension's, of the same shapes, by no more.
        parts = k**4 * EI / m + k**2 * abs(tension) / m
        error = squares(tension, 3) / exact - 1
        assert (error > -1e-9).all()
        assert (error < 1.3 * (k * length / n) ** 4 / 720 * parts / exact).all()
    # ω² is linear in N but for that error; where it vanishes is Euler's load, too high by (πh/L)⁴/720
    (a,), (b,) = squares(-0.9 * euler, 1), squares(-0.95 * euler, 1)
    critical = 0.95 * euler + b / (a - b) * 0.05 * euler
    assert critical / euler - 1 == pytest.approx((np.pi / n) ** 4 / 720, rel=0.1)


def test_mass_and_inertia_of_a_free_body():
    length = 0.9
    along = np.array([1.0, 2.0, -0.5]) / np.linalg.norm([1.0, 2.0, -0.5])
    offset, arm = np.array([0.02, -0.03, 0.05]), np.array([0.1, 0.2, -0.15])
    blob = AddedMass(name="blob", point=1, mass=0.7, inertia=np.diag([1e-3, 2e-3, 4e-3]), arm=arm)
    zones = {"rigid1": 0.1, "rigid2": 0.05, "offset1": offset, "offset2": offset}
    model = beam(3, length, effects=(blob,), along=along, theory="timoshenko", **zones)
    S = assemble(model)
    motions = S.Q.T @ np.vstack([lever_matrix(p) for p in model.mesh.points])
    found = motions.T @ (S.M @ motions)
    R = model.effects[0].rotations(model.mesh)[0]
    m = STEEL.rho * FLAT.A * length
    # a prism: the section's rotary inertia along the whole length, and m L²/12 across
    local = m / FLAT.A * np.diag([FLAT.Iy + FLAT.Iz, FLAT.Iy, FLAT.Iz])
    local += m * length**2 / 12 * np.diag([0, 1, 1])
    expected = np.zeros((6, 6))
    for mass, centre, inertia in (
        (m, along * length / 2 + offset, R.T @ local @ R),
        (0.7, along * length + arm, blob.inertia),
    ):
        G = np.zeros((6, 6))
        G[:3, :3], G[3:, 3:] = mass * np.eye(3), inertia
        expected += lever_matrix(centre).T @ G @ lever_matrix(centre)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * m)


def test_unequal_offsets_turn_the_axis():
    # Offsets that differ make a longer, inclined beam: its mass, and no strain in a rigid motion.
    model = beam(4, 0.5, theory="timoshenko", offset1=np.zeros(3), offset2=np.array([0, 0.02, 0.05]))
    S = assemble(model)
    motions = S.Q.T @ np.vstack([lever_matrix(p) for p in model.mesh.points])
    assert abs(S.K @ motions).max() < 1e-13 * abs(S.K).max()
    mass = STEEL.rho * FLAT.A * np.linalg.norm([0.5, 0.02, 0.05])
    np.testing.assert_allclose((motions.T @ (S.M @ motions))[:3, :3], mass * np.eye(3), atol=1e-12 * mass)


def test_mass_line_of_a_free_body():
    # Far below the first elastic mode a free body's accelerance is a rigid one's, but for (f/f1)².
    S = assemble(beam(8, 0.5, theory="timoshenko"))
    f1 = elastic(S.model, 7)[0]
    H = compute_frf(S, [f1 / 1000], [(0, "z"), (1, "z")], [(0, "z")]).H[0, :, 0].real
    m, half = STEEL.rho * FLAT.A * 0.5, 0.25
    J = m * 0.5**2 / 12 + m * FLAT.Iy / FLAT.A
    expected = np.array([1 / m + half**2 / J, 1 / m - half**2 / J])
    # elastic modes add -(f/fr)² φr(0)²/m, |φ| ≤ 2, and Σ (f1/fr)² < 1.2
    np.testing.assert_allclose(H, expected, rtol=0, atol=1.2 * 4e-6 / m)


def cantilever_receptance(frequency, x, zeta=0.0, eta=0.0, n_modes=60):
    """Return the modal sum for an Euler-Bernoulli cantilever of 1 m, force at the tip, response at x."""
    m, EI = STEEL.rho * FLAT.A, STEEL.E * FLAT.Iy
    first = [1.875104068711961, 4.694091132974175, 7.854757438237613]
    omega = 2 * np.pi * np.asarray(frequency)

    def shape(x, b):
        # cosh bx - cos bx - s (sinh bx - sin bx), s = (cosh b + cos b)/(sinh b + sin b), all times e^{-b}
        e, e2 = np.exp(-b), np.exp(-2 * b)
        den = 1 - e2 + 2 * e * np.sin(b)
        s = (1 + e2 + 2 * e * np.cos(b)) / den
        one_less = (2 * e * np.sin(b) - 2 * e2 - 2 * e * np.cos(b)) / den  # 1 - s
        hyper = 0.5 * (np.exp(b * x) * one_less + np.exp(-b * x) * (1 + s))
        return hyper - np.cos(b * x) + s * np.sin(b * x)

    H = np.zeros(omega.shape, dtype=complex)
    for b in [*first, *((np.arange(4, n_modes + 1) - 0.5) * np.pi)]:
        wr = b**2 * np.sqrt(EI / m)
        value = shape(x, b) * shape(1.0, b) / m
        H += value / (wr**2 * (1 + 1j * eta) - omega**2 + 2j * zeta * wr * omega)
    return H


@pytest.mark.parametrize("damping", ["modal", "structural"])
def test_damped_cantilever_against_its_modal_series(damping):
    n = 20
    model = planar(beam(n, effects=(fix(0),)))
    model = model.with_damping(Damping.modal(0.01) if damping == "modal" else Damping.structural(0.02))
    f = np.linspace(2.0, 150.0, 149)
    places = [(1, "z"), (1 + n // 2, "z")]
    np.testing.assert_allclose(model.mesh.points[1 + n // 2], [0.5, 0, 0], atol=1e-15)
    H = compute_frf(assemble(model), f, places, [(1, "z")], kind="receptance").H[:, :, 0]
    keys = {"zeta": 0.01} if damping == "modal" else {"eta": 0.02}
    for column, x in ((0, 1.0), (1, 0.5)):
        exact = cantilever_receptance(f, x, **keys)
        # At a resonance a relative error e of ω is 2e/(2ζ) of the peak; e = (βh)⁴/1440 at the third mode.
        limit = 2 * (7.855 / n) ** 4 / 1440 / 0.02 + 1e-6
        assert abs(H[:, column] - exact).max() < limit * abs(exact).max()


def spring_mass(k, m, c=0.0, eta=0.0):
    """Return a mass on one spring in z; the mesh's one line has no mass to speak of."""
    spring = Joint(
        name="spring",
        point1=0,
        location=np.zeros(3),
        K=np.diag([0, 0, k, 0, 0, 0]),
        C=np.diag([0, 0, c, 0, 0, 0]),
        eta=eta,
    )
    held = fix(0, ("x", "y", "rx", "ry", "rz"))
    return beam(1, 0.1, effects=(spring, AddedMass(name="m", point=0, mass=m), held), material=LIGHT)


@pytest.mark.parametrize("method", ["reduced", "direct"])
def test_one_degree_of_freedom_with_every_damping(method):
    k, m = 4e4, 2.5
    f = np.array([0.0, 5.0, 20.0, 20.1317, 40.0])
    w = 2 * np.pi * f
    cases = [
        (spring_mass(k, m, c=7.0), k - w**2 * m + 1j * w * 7.0),
        (spring_mass(k, m, eta=0.05), k * (1 + 0.05j) - w**2 * m),
        (spring_mass(k, m).with_damping(Damping.structural(0.03)), k * (1 + 0.03j) - w**2 * m),
        (
            spring_mass(k, m).with_damping(Damping.rayleigh(2.0, 1e-5)),
            k - w**2 * m + 1j * w * (2.0 * m + 1e-5 * k),
        ),
    ]
    if method == "reduced":
        modal = spring_mass(k, m).with_damping(Damping.modal(0.02))
        cases.append((modal, k - w**2 * m + 0.04j * w * np.sqrt(k * m)))
    for model, Z in cases:
        H = compute_frf(assemble(model), f, [(0, "z")], [(0, "z")], kind="receptance", method=method).H
        # the line weighs 3e-11 kg, 1e-11 of m; at resonance that is divided by the loss factor
        np.testing.assert_allclose(H[:, 0, 0], 1 / Z, rtol=5e-9)


def test_direct_method_refuses_modal_ratios():
    model = spring_mass(4e4, 2.5).with_damping(Damping.modal(0.02))
    with pytest.raises(ValueError, match="modal damping ratios have none"):
        compute_frf(assemble(model), [1.0], [(0, "z")], [(0, "z")], method="direct")


def test_receptance_mobility_accelerance_are_derivatives():
    S = assemble(spring_mass(4e4, 2.5, c=7.0))
    f = np.array([3.0, 17.0])
    rec, mob, acc = (
        compute_frf(S, f, [(0, "z")], [(0, "z")], kind=kind).H[:, 0, 0]
        for kind in ("receptance", "mobility", "accelerance")
    )
    iw = 2j * np.pi * f
    np.testing.assert_allclose(mob, iw * rec, rtol=1e-14)
    np.testing.assert_allclose(acc, iw**2 * rec, rtol=1e-14)


def test_modes_report_the_damping_of_the_model():
    for damping, expected in (
        (Damping.modal([0.01, 0.02], [0.0, 1000.0]), lambda f: 0.01 + 0.01 * np.minimum(f, 1000) / 1000),
        (Damping.rayleigh(3.0, 1e-6), lambda f: 3.0 / (4 * np.pi * f) + 1e-6 * np.pi * f),
        (Damping.structural(0.04), lambda f: 0.02 + 0 * f),
    ):
        modes = solve_modes(assemble(beam(4, effects=(fix(0),)).with_damping(damping)), 6)
        np.testing.assert_allclose(modes.zeta, expected(modes.frequency), rtol=1e-12)


def test_two_masses_on_springs():
    # ground - k1 - m1 - k2 - m2; rotations are held, so that the lever arms of half a metre carry no motion
    k1, k2, m1, m2 = 3e4, 2e4, 2.0, 1.0
    points = [[0, 0, 0], [0.1, 0, 0], [0, 1, 0], [0.1, 1, 0]]
    mesh = Mesh.from_lines(points, [[0, 1], [2, 3]], {"a": [0], "b": [1]})
    light = MemberProperties(LIGHT, FLAT, theory="euler-bernoulli")
    only_z = tuple(d for d in DIRECTIONS if d != "z")
    effects = (
        Frame(members={"a": light, "b": light}),
        fix(0, only_z),
        fix(2, only_z),
        AddedMass(name="m1", point=0, mass=m1),
        AddedMass(name="m2", point=2, mass=m2),
        Joint(name="k1", point1=0, location=np.zeros(3), K=np.diag([0, 0, k1, 0, 0, 0])),
        Joint(name="k2", point1=0, point2=2, location=np.array([0, 0.5, 0]), K=np.diag([0, 0, k2, 0, 0, 0])),
    )
    found = solve_modes(assemble(Model(mesh, effects)), 2).omega ** 2
    K, M = np.array([[k1 + k2, -k2], [-k2, k2]]), np.diag([m1, m2])
    np.testing.assert_allclose(found, np.sort(np.linalg.eigvals(np.linalg.solve(M, K)).real), rtol=1e-9)


def test_mass_without_inertia_on_a_joint():
    # A tuned mass: a point of its own, no line, no rotary inertia. Above the ground its frequency is √(k/m).
    mesh = Mesh.from_lines([[0, 0, 0], [0.1, 0, 0], [0, 0, 0.1]], [[0, 1]], {"a": [0]})
    frame = Frame(members={"a": MemberProperties(LIGHT, FLAT)})
    k, m = 2e3, 0.4
    tie = Joint(name="tie", point1=2, point2=0, location=np.array([0, 0, 0.1]), K=k * np.eye(6))
    model = Model(mesh, (frame, fix(0), tie, AddedMass(name="m", point=2, mass=m)))
    found = solve_modes(assemble(model), 3).omega ** 2
    np.testing.assert_allclose(found, [k / m] * 3, rtol=1e-9)


def test_rigid_joint_with_lever_arms_equals_one_piece():
    # A beam cut in two and joined rigidly at a place off its axis is the beam in one piece, whatever the arm.
    points = [[0, 0, 0], [0.4, 0, 0], [0.4, 0, 0], [1.0, 0, 0]]
    mesh = Mesh.from_lines(points, [[0, 1], [2, 3]], {"a": [0], "b": [1]}).refined(counts={"a": 4, "b": 6})
    p = MemberProperties(STEEL, FLAT)
    joint = Joint(name="weld", point1=1, point2=2, location=np.array([0.3, 0.2, -0.1]), rigid=DIRECTIONS)
    cut = solve_modes(assemble(Model(mesh, (Frame(members={"a": p, "b": p}), joint))), 20)
    whole = solve_modes(assemble(beam(10, theory="timoshenko")), 20)
    assert cut.n_rigid == whole.n_rigid == 6
    np.testing.assert_allclose(cut.frequency[6:], whole.frequency[6:], rtol=1e-8)
