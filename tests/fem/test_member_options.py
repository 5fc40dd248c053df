"""Releases, springs at ends, tapers, bars, pretensions and masses of members."""

from dataclasses import replace

import numpy as np
import pytest

from dovetail import load_study
from fem import (
    DIRECTIONS,
    Frame,
    Location,
    MemberProperties,
    Mesh,
    Model,
    ModelError,
    PropertyError,
    Section,
    assemble,
    dofs_of,
    lever_matrix,
    solve_modes,
)
from fem.effects import Preload
from fem.elements.connections import end_slips
from fem.elements.splitting import split
from fem.system import rigid_motions
from tests.frames import FLAT, STEEL, beam, braced, fix, frequencies, planar, welded
from updating import ModeTargets
from updating.inference import fine_enough

PINNED = ("x", "y", "z")
EI, MASS = STEEL.E * FLAT.Iy, STEEL.rho * FLAT.A


def hertz(betaL, length=1.0, inertia=FLAT.Iy):
    return betaL**2 / (2 * np.pi * length**2) * np.sqrt(STEEL.E * inertia / MASS)


def deflection(model, force):
    """Return the static displacements under forces (n_dof,)."""
    S = assemble(model)
    return S.Q @ np.linalg.solve(S.K.toarray(), S.Q.T @ force)


def unit(model, point, direction):
    force = np.zeros(model.n_dof)
    force[6 * point + DIRECTIONS.index(direction)] = 1.0
    return force


# ---------------------------------------------------------------------------------- releases and end springs


HINGED = [
    ({"release1": ("ry", "rz")}, (fix(0, (*PINNED, "rx")), fix(1))),
    (
        {"release1": ("ry", "rz"), "release2": ("rx", "ry", "rz")},
        (fix(0, (*PINNED, "rx")), fix(1, PINNED)),
    ),
    ({"release2": ("ry",)}, (fix(0), fix(1, (*PINNED, "rx", "rz")))),
]


@pytest.mark.parametrize("theory", ["euler-bernoulli", "timoshenko"])
@pytest.mark.parametrize(("releases", "supports"), HINGED)
def test_releases_between_clamps_are_hinged_supports_in_statics(releases, supports, theory):
    released = beam(5, theory=theory, effects=(fix(0), fix(1)), **releases)
    pinned = beam(5, theory=theory, effects=supports)
    force = np.zeros(released.n_dof)
    force[12:] = np.random.default_rng(1).standard_normal(force.size - 12)
    u, expected = deflection(released, force)[12:], deflection(pinned, force)[12:]
    np.testing.assert_allclose(u, expected, atol=1e-12 * abs(expected).max())
    # and the same in any direction of space
    turned = beam(5, theory=theory, effects=(fix(0), fix(1)), along=(0.3, -1, 0.5), **releases)
    np.testing.assert_allclose(frequencies(turned, 12), frequencies(released, 12), rtol=1e-8)


@pytest.mark.parametrize(("releases", "supports"), HINGED[::2])
def test_a_released_rotation_follows_statically_with_an_error_of_seventh_order(releases, supports):
    # A support's hinge turns with a freedom of its own, the release's as in statics. The moment that inertia
    # leaves at the hinge, ρA ω² θ h³, does work m² h/EI ~ h⁷: 128 times less at half the size.
    gaps = []
    for n in (8, 16):
        released = frequencies(planar(beam(n, effects=(fix(0), fix(1)), **releases)), 2)
        gaps.append(released / frequencies(planar(beam(n, effects=supports)), 2) - 1)
    assert (np.array(gaps) > 0).all()
    np.testing.assert_allclose(gaps[0] / gaps[1], 128, rtol=0.3 * (7.07 / 8) ** 2)


@pytest.mark.parametrize(
    ("releases", "roots"),
    [
        ({"release1": ("ry", "rz")}, [3.926602312, 7.068582746, 10.210176123]),
        ({"release1": ("ry", "rz"), "release2": ("ry", "rz")}, np.pi * np.arange(1, 4)),
    ],
)
def test_released_beams_have_the_frequencies_of_the_closed_form(releases, roots):
    n = 12
    found = frequencies(planar(beam(n, effects=(fix(0), fix(1)), **releases)), 3)
    for f, root in zip(found, roots, strict=True):
        predicted = (root / n) ** 4 / 1440  # the hinged element keeps the cubic shapes
        assert abs(f / hertz(root) - 1 - predicted) < 0.15 * (root / n) ** 2 * predicted + 1e-9


@pytest.mark.parametrize("theory", ["euler-bernoulli", "timoshenko"])
def test_propped_cantilever_in_statics(theory):
    # Clamped at 0, a hinge at its other end on a clamp; a load in the middle: 7 F L³ / 768 EI without shear.
    length, n = 0.6, 4
    model = beam(n, length, effects=(fix(0), fix(1)), theory=theory, release2=("ry",))
    middle = int(np.flatnonzero(np.isclose(model.mesh.points[:, 0], length / 2))[0])
    found = deflection(model, unit(model, middle, "z"))[6 * middle + 2]
    # force method: the prop's force X = δ_10 / δ_11, with shear flexibility s of a unit length
    s = 0.0 if theory == "euler-bernoulli" else 1 / (FLAT.kz * STEEL.G * FLAT.A)
    own = (length / 2) ** 3 / (3 * EI) + s * length / 2
    coupled = 5 * length**3 / (48 * EI) + s * length / 2
    prop = length**3 / (3 * EI) + s * length
    assert found == pytest.approx(own - coupled**2 / prop, rel=1e-10)


def test_end_springs_in_statics_and_their_limits():
    # Cantilever of one element on a rotational spring: δ = F L³/3EI + F L²/k
    length, k = 0.5, 3e3
    model = beam(1, length, effects=(fix(0),), spring1={"ry": k})
    found = deflection(model, unit(model, 1, "z"))[8]
    assert found == pytest.approx(length**3 / (3 * EI) + length**2 / k, rel=1e-12)
    for d, extra in (("z", 1 / k), ("x", None)):
        model = beam(3, length, effects=(fix(0),), spring1={d: k})
        u = deflection(model, unit(model, 1, d))[6 + DIRECTIONS.index(d)]
        own = length / (STEEL.E * FLAT.A) if extra is None else length**3 / (3 * EI)
        assert u == pytest.approx(own + 1 / k, rel=1e-10)
    held = (fix(0), fix(1))

    def modes(**more):
        return frequencies(planar(beam(4, effects=held, **more)), 4)

    rigid, hinged = modes(), modes(release1=("ry",))
    # ω² is rational in k: what is missing falls as 1/k, and as k towards the hinge
    hard = [modes(spring1={"ry": k}) / rigid - 1 for k in (1e8, 1e9)]
    np.testing.assert_allclose(hard[0] / hard[1], 10, rtol=1e-3)
    soft = [modes(spring1={"ry": k}) / hinged - 1 for k in (1e-1, 1e-2)]
    np.testing.assert_allclose(soft[0] / soft[1], 10, rtol=1e-3)
    np.testing.assert_array_equal(modes(spring1={"ry": 0.0}), hinged)
    np.testing.assert_array_equal(modes(spring1={"ry": np.inf}), rigid)


def test_slips_by_stiffness_and_by_compliance_agree_with_monforton_and_wu():
    rng = np.random.default_rng(0)
    A = rng.standard_normal((3, 12, 12))
    K = A @ np.swapaxes(A, 1, 2)
    k = np.full((3, 12), np.inf)
    k[:, [4, 11]] = 7.0, 30.0
    rigid = np.isinf(k)
    by_k = end_slips(K, np.where(rigid, 1.0, k), np.where(rigid, 0.0, 1.0))
    by_c = end_slips(K, np.ones((3, 12)), np.where(rigid, 0.0, 1 / k))
    np.testing.assert_allclose(by_k, by_c, atol=1e-12 * abs(by_c).max())
    # one direction: ΔK = -c/(1 + c k) K e eᵀ K
    c = np.zeros((3, 12))
    c[:, 4] = 0.2
    lost = K @ end_slips(K, np.ones((3, 12)), c)
    expected = (0.2 / (1 + 0.2 * K[:, 4, 4]))[:, None, None] * K[:, :, [4]] @ K[:, [4], :]
    np.testing.assert_allclose(lost, expected, atol=1e-13 * abs(K).max())
    # a compliance of zero is rigid, and its derivative is -K e eᵀ K
    c[:, 4] = 0.0
    rate = np.imag(K @ end_slips(K, np.ones((3, 12)), c + 1e-200j * (np.arange(12) == 4))) / 1e-200
    np.testing.assert_allclose(rate, K[:, :, [4]] @ K[:, [4], :], atol=1e-13 * abs(K).max() ** 2)


def test_a_hinge_sits_at_the_end_of_the_flexible_part():
    # A rigid zone of a at the clamp and a hinge behind it: a pinned-pinned beam of the rest.
    a, length, n = 0.1, 1.1, 11
    model = beam(n, length, effects=(fix(0), fix(1)), rigid1=a, release1=("ry", "rz"), release2=("ry", "rz"))
    with pytest.raises(ModelError, match="does not fit"):
        frequencies(planar(model), 1)
    points = [[0, 0, 0], [0.2, 0, 0], [length, 0, 0]]
    mesh = Mesh.from_lines(points, [[0, 1], [1, 2]], {"beam": [0, 1]}).split([1, 9])
    model = Model(mesh, (model.effects[0], fix(0), fix(2)))
    found = frequencies(planar(model), 2)
    np.testing.assert_allclose(found, hertz(np.pi * np.arange(1, 3)), rtol=1.3 * (2 * np.pi / 10) ** 4 / 1440)


def test_places_inside_move_with_the_element_and_its_ends_with_the_nodes():
    model = beam(1, 2.0, release1=("ry",), theory="euler-bernoulli")
    frame = model.effects[0]
    u = np.zeros(12)
    u[[2, 4]] = (
        0.3,
        -0.7,
    )  # the node turns, the hinged end does not follow: it is a propped cantilever's shape
    places = [Location(0, x) for x in (0.0, 0.25, 1.0)]
    w = (frame.interpolate(model.mesh, places)[1] @ u)[:, [2, 4]]
    np.testing.assert_allclose(w[0], [0.3, -0.7], atol=1e-15)
    x = 0.25
    np.testing.assert_allclose(w[1, 0], 0.3 * (1 - 1.5 * x + 0.5 * x**3), atol=1e-14)
    np.testing.assert_allclose(w[1, 1], 0.3 * (1.5 - 1.5 * x**2) / 2, atol=1e-14)
    np.testing.assert_allclose(w[2], 0, atol=1e-15)


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (
            {"release1": ("rx",), "release2": ("rx",)},
            "rx at end 1, rx at end 2 released, nothing holds the member's tor",
        ),
        ({"release1": ("x",), "spring2": {"x": 0.0}}, "nothing holds the member's stretching"),
        ({"release1": ("ry", "z"), "release2": ("ry",)}, "nothing holds the member's bending in x-z"),
        ({"release1": ("y",), "release2": ("y",)}, "nothing holds the member's bending in x-y"),
        ({"release1": ("w",)}, "end 1 is released in 'w'; allowed are x, y, z, rx, ry, rz"),
        ({"release2": ("ry",), "spring2": {"ry": 3.0}}, "end 2 has both a release and a spring in ry"),
        ({"spring2": {"ry": -3.0}}, "the spring of end 2 in ry is -3.0; it must be at least 0"),
        ({"theory": "bar", "release2": ("ry",)}, "a bar has no moments to release"),
        ({"mass": "diagonal"}, "the mass is 'diagonal'; allowed are consistent, higher-order, lumped"),
        ({"pretension": np.nan}, "the pretension is nan"),
    ],
)
def test_member_options_that_cannot_be_are_refused(more, words):
    with pytest.raises(ModelError, match=words):
        MemberProperties(STEEL, FLAT, **more)


# ----------------------------------------------------------------------------------------------- lumped mass


@pytest.mark.parametrize("inertia", ["Iy", "Iz"])
def test_lumped_mass_lowers_bending_frequencies_as_much_as_consistent_mass_raises_them(inertia):
    # Rotations condensed, (ω h²)² = 12 (1 - c)²/(2 + c) EI/ρA with c = cos βh: f (1 - (βh)⁴/1440 - …)
    n = 12
    found = frequencies(beam(n, effects=(fix(0, (*PINNED, "rx")), fix(1, PINNED)), mass="lumped"), 24)
    for root in np.pi * np.arange(1, 4):
        exact = hertz(root, inertia=getattr(FLAT, inertia))
        c = np.cos(root / n)
        discrete = np.sqrt(12 / (2 + c)) * (1 - c) * (n / root) ** 2
        assert found[np.argmin(abs(found / exact - 1))] / exact == pytest.approx(discrete, rel=1e-9)
        # the next term of the series is smaller by (βh)², times a number near 0.24
        assert discrete - 1 == pytest.approx(-((root / n) ** 4) / 1440, rel=0.4 * (root / n) ** 2)


def test_lumped_mass_of_rods():
    # ω h/c = 2 sin(kh/2) instead of kh: -(kh)²/24
    n, length = 20, 1.7
    found = frequencies(planar(beam(n, length, effects=(fix(0),), mass="lumped"), ("x",)), 5)
    k = (np.arange(1, 6) - 0.5) * np.pi / length
    h = length / n
    speed = np.sqrt(STEEL.E / STEEL.rho)
    np.testing.assert_allclose(found, 2 / h * np.sin(k * h / 2) * speed / (2 * np.pi), rtol=1e-10)
    found = frequencies(planar(beam(n, length, effects=(fix(0),), mass="lumped"), ("rx",)), 5)
    speed = np.sqrt(STEEL.G * FLAT.J / (STEEL.rho * FLAT.Ip))
    np.testing.assert_allclose(found, 2 / h * np.sin(k * h / 2) * speed / (2 * np.pi), rtol=1e-10)


def test_lumped_mass_is_diagonal_and_whole():
    model = beam(4, 0.8, mass="lumped", theory="timoshenko")
    M = assemble(model).M.toarray()
    assert not (M - np.diag(M.diagonal())).any()
    np.testing.assert_allclose(M.diagonal()[0::6].sum(), MASS * 0.8, rtol=1e-14)
    np.testing.assert_allclose(M.diagonal()[4::6].sum(), STEEL.rho * FLAT.Iy * 0.8, rtol=1e-14)


def test_lumped_mass_of_slender_bars_leaves_the_rotary_inertia_of_bending_out():
    M, plain = (
        assemble(beam(4, 0.8, mass=mass, theory="timoshenko")).M.diagonal()
        for mass in ("lumped-slender", "lumped")
    )
    np.testing.assert_array_equal(M[[0, 1, 2, 3]], plain[[0, 1, 2, 3]])
    assert (plain[[4, 5]] > 0).all()
    assert not M[[4, 5]].any()


# -------------------------------------------------------------------------------------- mass of higher order


def test_mass_of_higher_order_of_rods():
    # the mean of consistent mass and lumps, (ω h/c)² = 12 (1 - cos kh)/(5 + cos kh): -(kh)⁴/480
    n, length = 20, 1.7
    kh = (np.arange(1, 6) - 0.5) * np.pi / n
    discrete = np.sqrt(12 * (1 - np.cos(kh)) / (5 + np.cos(kh))) / kh
    np.testing.assert_allclose(discrete - 1, -(kh**4) / 480, rtol=0.03)
    shear = STEEL.G * FLAT.J / FLAT.Ip
    for direction, modulus in (("x", STEEL.E), ("rx", shear)):
        rod = planar(beam(n, length, effects=(fix(0),), mass="higher-order"), (direction,))
        exact = kh * n / length * np.sqrt(modulus / STEEL.rho) / (2 * np.pi)
        np.testing.assert_allclose(frequencies(rod, 5), exact * discrete, rtol=1e-10)


def test_mass_of_higher_order_leaves_bending_without_shear_as_it_is():
    ends = (fix(0, (*PINNED, "rx")), fix(1, PINNED))
    one, other = (
        assemble(beam(6, effects=ends, theory="euler-bernoulli", mass=mass)).M.toarray()
        for mass in ("consistent", "higher-order")
    )
    along = [k for k in range(len(one)) if abs(one[k] - other[k]).max() > 0]
    assert len(along) == 6 + 5  # of seven points stretching of all but one end, torsion of all but one
    bending = [k for k in range(len(one)) if k not in along]
    np.testing.assert_array_equal(one[np.ix_(bending, along)], 0)


def test_mass_of_higher_order_takes_the_place_of_consistent_mass_alone():
    model = braced()
    (frame,) = model.of_kind(Frame)
    assert {p.mass for p in frame.members.values()} == {"lumped", "consistent"}
    higher = frame.with_mass_of_higher_order()
    for name, p in frame.members.items():
        assert higher.members[name].mass == ("lumped" if p.mass == "lumped" else "higher-order")
    assert higher.with_mass_of_higher_order() is higher


def test_mass_of_higher_order_of_a_welded_frame():
    def lowest(splits, mass):
        model = welded(0.06)
        (frame,) = model.of_kind(Frame)
        if mass == "higher-order":
            model = replace(model, effects=(frame.with_mass_of_higher_order(), *model.effects[1:]))
        assert {p.mass for p in model.of_kind(Frame)[0].members.values()} == {mass}
        return frequencies(replace(model, mesh=model.mesh.split(splits)), 12)

    fine = (4 * lowest(16, "consistent") - lowest(8, "consistent")) / 3  # of which the square is off
    consistent, higher = lowest(1, "consistent") / fine - 1, lowest(1, "higher-order") / fine - 1
    much = consistent > 1e-5
    assert much.sum() > 4
    assert np.median(abs(higher[much]) / consistent[much]) < 1 / 3  # the rest is bending's own
    assert (abs(higher[much]) < 0.5 * consistent[much]).all()


@pytest.mark.parametrize("theory", ["euler-bernoulli", "timoshenko", "bar"])
def test_mass_of_higher_order_moves_as_a_rigid_body_as_it_should_and_is_positive(theory):
    for depth in (0.002, 0.05, 1.0):  # from slender elements to nothing but shear
        section = Section.rectangle(0.7 * depth, depth)
        made = {}
        for mass in ("consistent", "higher-order"):
            model = beam(2, 0.3, section=section, theory=theory, mass=mass, along=(1, -1, 0.3))
            made[mass] = M = np.zeros((model.n_dof, model.n_dof))
            for c in model.contributions():
                for dofs, m in zip(c.dofs, c.M, strict=True):
                    M[np.ix_(dofs, dofs)] += m
        rigid = rigid_motions(model)
        np.testing.assert_allclose(
            rigid.T @ made["higher-order"] @ rigid,
            rigid.T @ made["consistent"] @ rigid,
            rtol=1e-9,
            atol=1e-12,
        )
        has_mass = np.flatnonzero(made["consistent"].any(axis=0))
        consistent, higher = (made[m][np.ix_(has_mass, has_mass)] for m in ("consistent", "higher-order"))
        scale = 1 / np.sqrt(consistent.diagonal())
        least = [np.linalg.eigvalsh(scale[:, None] * M * scale).min() for M in (consistent, higher)]
        assert min(least) > 0


@pytest.mark.parametrize(
    ("n", "more"),
    [(2, {"theory": "timoshenko"}), (1, {"theory": "bar"}), (2, {"section2": Section.rectangle(0.1, 0.08)})],
)
def test_mass_of_higher_order_of_a_member_whose_offsets_are_nearly_none(n, more):
    # what is not in line with its points is integrated, and the rest is in closed form
    section = Section.rectangle(0.12, 0.1)
    member = {"along": (1, -1, 0.3), "section": section, "mass": "higher-order", **more}
    M = []
    for offset in (0.0, 1e-13):
        model = beam(n, 0.3, offset1=np.array([0, offset, 0]), **member)
        (one, *_) = model.of_kind(Frame)[0].contribute(model)
        M.append(one.M)
    np.testing.assert_allclose(M[0], M[1], rtol=1e-9, atol=1e-11 * abs(M[0]).max())


# ---------------------------------------------------------------------------------------------------- tapers


def tip_flexibility(n, first, second, length=1.0, direction="z"):
    model = beam(n, length, effects=(fix(1),), section=first, section2=second)
    return deflection(model, unit(model, 0, direction))[DIRECTIONS.index(direction)]


def test_tapered_cantilever_in_bending():
    # Width b, height h (1 + x/L) from a free tip: u = ∫ x²/EI dx, 1/I = c (1 + x/L)^-3, c = 12/(b h³)
    b, h = 0.02, 0.01
    first, second = Section.rectangle(b, h), Section.rectangle(b, 2 * h)
    c = 12 / (STEEL.E * b * h**3)
    exact = c * (np.log(2) - 2 * (1 - 1 / 2) + (1 - 1 / 4) / 2)
    for n in (1, 2, 5):  # the elements integrate the taper
        assert tip_flexibility(n, first, second) == pytest.approx(exact, rel=1e-11)


def test_conical_bar_in_tension_and_its_axial_modes():
    # EA = EA₁ (1 + x)²: u = F L/(2 EA₁); modes u = w/(1 + x) with w'' + k² w = 0: clamped at 0, free at 1
    first, second = Section.circle(0.02), Section.circle(0.04)
    area = STEEL.E * first.A
    for n in (1, 2, 5):
        assert tip_flexibility(n, first, second, direction="x") == pytest.approx(1 / (2 * area), rel=1e-11)
    # free end: w' = w/(1 + x) → tan k = 2 k
    k = 1.1655611852072113
    assert np.tan(k) == pytest.approx(2 * k, rel=1e-12)
    exact = k * np.sqrt(STEEL.E / STEEL.rho) / (2 * np.pi)
    errors = [
        frequencies(planar(beam(n, effects=(fix(0),), section=first, section2=second), ("x",)), 1)[0] / exact
        - 1
        for n in (10, 20, 40)
    ]
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.02)
    assert errors[1] / errors[2] == pytest.approx(4, rel=0.005)
    assert abs((4 * errors[2] - errors[1]) / 3) < errors[2] ** 2 * 10


def test_a_taper_to_another_shape_is_refused():
    with pytest.raises(PropertyError, match="same shape"):
        MemberProperties(STEEL, Section.circle(0.02), section2=Section.rectangle(0.02, 0.02))


def test_a_taper_between_equal_sections_is_no_taper():
    straight, tapered = (beam(5, effects=(fix(0),), **more) for more in ({}, {"section2": FLAT}))
    np.testing.assert_allclose(frequencies(straight, 8), frequencies(tapered, 8), rtol=1e-10)


# ------------------------------------------------------------------------------------------- bars and cables


def truss(points, lines, effects, pieces=1, **more):
    mesh = Mesh.from_lines(points, lines, {f"b{i}": [i] for i in range(len(lines))}).split(pieces)
    properties = MemberProperties(STEEL, FLAT, theory="bar", **more)
    return Model(mesh, (Frame(members=dict.fromkeys(mesh.members, properties)), *effects))


def test_two_bars_carry_a_load_as_in_the_closed_form():
    # Two bars at ±α to the vertical under a vertical load: u = F L / (2 EA cos²α); rotations are left out.
    a, h = 0.4, 0.3
    points = [[-a, 0, h], [a, 0, h], [0, 0, 0]]
    model = truss(points, [[0, 2], [1, 2]], (fix(0, PINNED), fix(1, PINNED), fix(2, ("y",))))
    S = assemble(model)
    assert S.n_free == 2
    length = np.hypot(a, h)
    u = deflection(model, unit(model, 2, "z"))
    assert u[14] == pytest.approx(length / (2 * STEEL.E * FLAT.A * (h / length) ** 2), rel=1e-12)
    # consistent mass: m L/3 of each bar at the joint, in every direction
    k = 2 * STEEL.E * FLAT.A / length * np.array([a, h]) ** 2 / length**2
    expected = np.sqrt(k / (2 * MASS * length / 3)) / (2 * np.pi)
    np.testing.assert_allclose(frequencies(model, 2), np.sort(expected), rtol=1e-12)


def test_a_free_truss_has_six_rigid_motions():
    points = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    lines = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]]
    modes = solve_modes(assemble(truss(points, lines, ())), 12)
    assert modes.n_rigid == 6
    assert modes.frequency[6] > 100


def test_a_bar_in_pieces_off_its_line_is_refused():
    model = beam(3, theory="bar", offset1=np.array([0, 0.1, 0]), pretension=1e3)
    with pytest.raises(ModelError, match="bar 'beam' has an offset and 3 elements"):
        assemble(model)


def test_a_bar_in_pieces_is_a_mechanism_and_named():
    model = truss([[0, 0, 0], [1, 0, 0]], [[0, 1]], (fix(0, PINNED), fix(1, PINNED)), pieces=3)
    with pytest.raises(ModelError, match=r"mechanism: 4 motion.* most free: point 2 y"):
        solve_modes(assemble(model), 6)


@pytest.mark.parametrize("mass", ["consistent", "lumped"])
def test_string(mass):
    # ω = (mπ/L)√(N/ρA) but for ±(kh)²/24: (ωh/c)² = 2 (1 - cos kh), by (2 + cos kh)/3 with consistent mass
    n, length, tension = 16, 2.0, 5e3
    ends = (fix(0, PINNED), fix(1, PINNED))
    model = truss([[0, 0, 0], [length, 0, 0]], [[0, 1]], ends, n, pretension=tension, mass=mass)
    found = frequencies(model, 10)
    kh = np.repeat(np.arange(1, 6) * np.pi / n, 2)  # both planes
    square = 2 * (1 - np.cos(kh)) / (1.0 if mass == "lumped" else (2 + np.cos(kh)) / 3)
    np.testing.assert_allclose(found, np.sqrt(square * tension / MASS) * n / length / (2 * np.pi), rtol=1e-9)


@pytest.mark.parametrize("more", [{}, {"theory": "bar"}, {"release1": ("ry",), "mass": "lumped"}])
def test_a_stretched_member_has_the_preload_of_its_effect(more):
    ends = (fix(0, PINNED), fix(1, ("y", "z", "rx")))
    pull = Preload(name="pull", member="beam", tension=4e3, buckling=1e3)
    own = assemble(beam(6, effects=ends, pretension=4e3, **more))
    other = assemble(beam(6, effects=(*ends, pull), **more))
    np.testing.assert_allclose(own.K.toarray(), other.K.toarray(), rtol=0, atol=1e-16 * abs(own.K).max())


# ---------------------------------------------------------------------------------------- what holds for all


OPTIONS = {
    "hinges": {"release1": ("ry", "rz"), "release2": ("rx", "ry")},
    "slider": {"release1": ("x",), "release2": ("z",)},
    "springs": {"spring1": {"ry": 500.0, "x": 1e6}, "spring2": {"z": 1e5, "rx": 50.0}},
    "both": {
        "release1": ("rz",),
        "spring1": {"ry": 500.0},
        "offset1": np.array([0, 0.01, 0.02]),
        "rigid1": 0.05,
    },
    "lumped": {"mass": "lumped", "offset2": np.array([0.0, 0.02, 0.01])},
    "taper": {"section2": Section.rectangle(0.05, 0.02)},
    "bar": {"theory": "bar"},
    "bar off": {"theory": "bar", "offset1": np.array([0, 0.03, 0.01])},
}


@pytest.mark.parametrize("theory", ["euler-bernoulli", "timoshenko"])
@pytest.mark.parametrize("name", OPTIONS)
def test_options_keep_rigid_motions_free_and_mass_whole(name, theory):
    more = {"theory": theory, **OPTIONS[name]}
    model = beam(1 if name == "bar off" else 4, 0.8, along=(1, 2, -0.5), **more)
    motions = np.vstack([lever_matrix(p) for p in model.mesh.points])
    total = np.zeros((6, 6))
    for part in model.contributions():
        if part.K is not None:
            assert abs(part.K - np.swapaxes(part.K, 1, 2)).max() <= 1e-14 * abs(part.K).max()
            assert abs(part.K @ motions[part.dofs]).max() <= 1e-13 * abs(part.K).max()
        u = motions[part.dofs]
        total += (np.swapaxes(u, 1, 2) @ part.M @ u).sum(axis=0)
    R = model.effects[0].rotations(model.mesh)
    assert R.shape == (model.mesh.n_lines, 3, 3)
    frame, t = model.effects[0], np.diff(model.mesh.points[[0, 1]], axis=0)[0]
    p = frame.members["beam"]
    axis = np.linalg.norm(t + p.offset2 - p.offset1)
    area = FLAT.A
    if name == "taper":  # a product of two linear functions
        area *= 1 + (5 / 3 - 1) / 2 + (2 - 1) / 2 + (5 / 3 - 1) * (2 - 1) / 3
    np.testing.assert_allclose(total[:3, :3], STEEL.rho * area * axis * np.eye(3), atol=1e-13 * total[0, 0])


@pytest.mark.parametrize("name", ["hinges", "springs", "both", "taper", "lumped"])
def test_derivatives_by_modulus_and_density_are_complex_steps(name):
    model = beam(3, 0.8, along=(1, 2, -0.5), theory="timoshenko", pretension=2e3, **OPTIONS[name])
    frame = model.effects[0]

    def K_and_M(**values):
        out = np.zeros((2, model.n_dof, model.n_dof), dtype=complex)
        for part in frame.with_values(**values).contribute(model):
            at = part.dofs[:, :, None], part.dofs[:, None, :]
            for k, X in enumerate((part.K, part.M)):
                if X is not None:
                    np.add.at(out[k], at, X)
        return out

    for key, value in (("E:steel", STEEL.E), ("rho:steel", STEEL.rho)):
        exact = K_and_M(**{key: value + 1e-200j}).imag / 1e-200
        d = [
            (K_and_M(**{key: value * (1 + s)}) - K_and_M(**{key: value * (1 - s)})).real / (2 * s * value)
            for s in (1e-4, 2e-4)
        ]
        for k in range(2):
            bound = abs(d[1] - d[0])[k].max() + 1e-12 * abs(K_and_M()[k]).max() / (1e-4 * value)
            assert abs(exact - d[0])[k].max() <= bound
    linear = {p.name: p.linear for p in frame.parameters()}
    assert linear["E:steel"] == (name not in ("springs", "both"))


def test_dofs_of_released_members_stay_those_of_their_points():
    model = beam(2, release1=("ry",))
    (part,) = model.effects[0].contribute(model)
    np.testing.assert_array_equal(part.dofs[0], dofs_of([0, 2]).ravel())


def test_study_files_give_members_their_options(tmp_path):
    file = tmp_path / "study.toml"
    file.write_text(
        """
[points]
A = [0, 0, 0]
B = [1, 0, 0]
C = [1, 0, 1]
[members.mast]
from = "A"
to = "B"
section2 = "thick"
mass = "lumped"
release1 = "rx ry"
spring2 = { ry = 2e4, z = 1e6 }
[members.guy]
from = "A"
to = "C"
theory = "bar"
pretension = 3e3
elements = 4
[members.strut]
from = "B"
to = "C"
theory = "bar"
[defaults]
section = "thin"
[materials.steel]
E = 210e9
rho = 7850
[sections.thin]
shape = "circle"
d = 0.02
[sections.thick]
shape = "circle"
d = 0.03
[[supports]]
point = "A"
""",
        encoding="utf-8",
    )
    model = load_study(file).model
    mast, guy, strut = (model.effects[0].members[name] for name in ("mast", "guy", "strut"))
    assert pytest.approx(np.pi * 0.03**2 / 4) == mast.section2.A
    assert (mast.mass, guy.mass) == ("lumped", "consistent")
    assert (mast.release1, mast.release2) == (("rx", "ry"), ())
    assert (mast.spring1, mast.spring2) == ({}, {"ry": 2e4, "z": 1e6})
    assert (guy.theory, guy.pretension, strut.pretension) == ("bar", 3e3, 0.0)
    assert [len(model.mesh.members[name]) for name in ("guy", "strut")] == [4, 1]


@pytest.mark.parametrize("along", [(1, 0, 0), (-1, 2, 0.5)])
@pytest.mark.parametrize("n", [1, 3])
def test_elements_are_divided_beside_rigid_zones(n, along):
    zones = {"rigid1": 0.2, "rigid2": 0.13, "offset1": np.array([0, 0.01, 0.02])}
    model = beam(n, 1.0, effects=(fix(0),), along=along, theory="timoshenko", **zones)
    coarse, fine = (frequencies(split(model, k), 3) for k in (16, 64))
    np.testing.assert_allclose(coarse, fine, rtol=2e-5)
    finer, _ = fine_enough(model, ModeTargets.of(fine, 1e-4))
    assert finer.mesh.n_lines > n
    np.testing.assert_allclose(frequencies(finer, 3), fine, rtol=1e-3)
