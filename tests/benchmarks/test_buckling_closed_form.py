"""Load factors against closed forms, with the discretisation error that theory predicts.

Cubic elements interpolate an exact buckling shape v with the energy EI h⁴/720 ∫ v''''² dx too much (the part
of v'' that is no linear function of x is v''''/2 times Legendre's second polynomial). In a uniform column
v'''' = -k² v'' and EI ∫ v''² = P ∫ v'², so that P is too high by (kh)⁴/720, k² = P/EI, whatever the ends.
"""

import numpy as np
import pytest
from scipy.optimize import brentq

from fem import (
    Frame,
    LoadCase,
    MemberProperties,
    Mesh,
    Model,
    ModelError,
    Section,
    assemble,
    prestressed,
    solve_buckling,
    solve_modes,
    solve_static,
)
from fem.analysis.modes import DENSE_LIMIT
from tests.frames import FLAT, STEEL, beam, chain, fix
from tests.frames import planar as held_in_plane


def planar(model):
    return held_in_plane(model, ("x", "z", "ry"))


L = 1.1
EI = STEEL.E * FLAT.Iy
PUSH = {(1, "x"): -1.0}
SQUARE = Section.rectangle(0.02, 0.02)
ENDS = {
    "pinned-pinned": ((fix(0, ("x", "y", "z", "rx")), fix(1, ("y", "z"))), [np.pi, 2 * np.pi]),
    "clamped-free": ((fix(0),), [np.pi / 2, 3 * np.pi / 2]),
    "clamped-clamped": ((fix(0), fix(1, ("y", "z", "rx", "ry", "rz"))), [2 * np.pi, 8.986818915818128]),
    "clamped-pinned": ((fix(0), fix(1, ("y", "z"))), [4.493409457909064, 7.725251836937707]),
}


@pytest.mark.parametrize("name", ENDS)
@pytest.mark.parametrize("n", [8, 16])
def test_euler_columns(name, n):
    ends, roots = ENDS[name]
    found = solve_buckling(planar(beam(n, L, effects=ends)), PUSH, 2).factors
    for factor, root in zip(found, roots, strict=True):
        error = factor / (root**2 * EI / L**2) - 1
        predicted = (root / n) ** 4 / 720
        assert error == pytest.approx(predicted, rel=0.15 * (root / n) ** 2, abs=1e-9)


@pytest.mark.parametrize("n", [10, 120])
def test_equal_factors_are_found_as_often_as_they_come(n):
    # a square column buckles in both planes alike: pairs, dense and sparse
    model = beam(n, L, effects=(fix(0),), section=SQUARE, along=(0, 0, 1), theory="euler-bernoulli")
    system = assemble(model)
    assert (system.n_free > DENSE_LIMIT) == (n == 120)
    modes = solve_buckling(system, {(1, "z"): -1.0}, 5)
    root = np.pi / 2 * np.array([1, 1, 3, 3, 5])
    exact = root**2 * STEEL.E * SQUARE.Iy / L**2
    # rounding: ε |K| against the lowest values of K, as h⁻⁴ in docs/theory-fem.md
    error, next_term = modes.factors / exact - 1, 0.15 * (root.max() / n) ** 2
    np.testing.assert_allclose(error, (root / n) ** 4 / 720, rtol=next_term, atol=1e-16 * n**4)
    K = system.Q.T @ modes.shapes
    gram = K.T @ (system.K @ K)
    scale = np.sqrt(np.diag(gram))
    np.testing.assert_allclose(gram / np.outer(scale, scale), np.eye(5), atol=1e-7)
    assert abs(modes.shapes.reshape(-1, 6, 5)[:, :3]).max(axis=(0, 1)) == pytest.approx(np.ones(5))


def test_a_shear_soft_column_buckles_at_engessers_load():
    # K_G = ∫ N v'² with the whole slope v', shear included: Engesser, P = P_E / (1 + P_E/(kGA)). Haringx'
    # load, with the tension square to the section, is higher by about (P_E/(kGA))². The shear strain is
    # constant in an element, so that the error is of order h²: extrapolated from two meshes, of order h⁴.
    deep = Section.rectangle(0.03, 0.2)
    ends = ENDS["pinned-pinned"][0]
    euler, shear = np.pi**2 * STEEL.E * deep.Iy / L**2, deep.kz * STEEL.G * deep.A
    exact = euler / (1 + euler / shear)
    columns = [planar(beam(n, L, effects=ends, section=deep, theory="timoshenko")) for n in (16, 32)]
    coarse, fine = (solve_buckling(model, PUSH, 1).factors[0] / exact - 1 for model in columns)
    assert fine > 0
    assert coarse / fine == pytest.approx(4, rel=0.01)
    assert abs(4 * fine - coarse) / 3 < (np.pi / 16) ** 4 / 720 + 5 * fine**2
    haringx = shear / 2 * (np.sqrt(1 + 4 * euler / shear) - 1)
    assert haringx / exact - 1 > 1e3 * abs(4 * fine - coarse) / 3


@pytest.mark.parametrize("share", [0.5, 0.4])
def test_a_column_with_a_support_in_between(share):
    # Two pinned spans: the moments EI/l u² tan u/(tan u - u) that turn the support, u = kl, add up to nothing
    n = 10
    mesh = beam(1, L).mesh.with_point_on("beam", share * L).split([n, n])
    frame = Frame(members={"beam": MemberProperties(STEEL, FLAT, theory="euler-bernoulli")})
    model = planar(Model(mesh, (frame, *ENDS["pinned-pinned"][0], fix(2, ("z",), "middle"))))

    def resistance(k):
        return sum(k**2 * s * np.tan(k * s) / (np.tan(k * s) - k * s) for s in (share * L, (1 - share) * L))

    # the longer span buckles beyond its own load, and below that of clamping at the support
    span = max(share, 1 - share) * L
    k = np.pi / span if share == 0.5 else brentq(resistance, np.pi / span, 4.4934 / span, xtol=1e-14)
    found = solve_buckling(model, PUSH, 1).factors[0]
    # EI h⁴/720 ∫ v''''², h that of each span: between those of the two
    error = found / (k**2 * EI) - 1
    low, high = (((k * s * L) / n) ** 4 / 720 for s in (min(share, 1 - share), max(share, 1 - share)))
    assert 0.98 * low < error < 1.02 * high


@pytest.mark.parametrize("feet", ["clamped", "pinned"])
def test_a_portal_sways(feet):
    # Timoshenko and Gere, Theory of Elastic Stability, art. 2.4: columns h with a beam l that turns their
    # heads back with 6EIb/l, tan(kh)/kh = -1/(6κ) clamped and kh tan(kh) = 6κ pinned, κ = Ib h/(Ic l); 7.38
    # EI/h² and 1.82 EI/h² for κ = 1. Columns that stretch make the beam softer by 1 - r, see
    # test_a_fixed_portal….
    h = l = 1.0
    n = 10
    mesh = Mesh.from_lines(
        [[0, 0, 0], [0, 0, h], [l, 0, h], [l, 0, 0]],
        [[0, 1], [1, 2], [3, 2]],
        {"left": [0], "beam": [1], "right": [2]},
    ).split(n)
    p = MemberProperties(STEEL, Section.rectangle(0.02, 0.01), theory="euler-bernoulli")
    held = ("x", "y", "z", "rx", "rz") if feet == "pinned" else ("x", "y", "z", "rx", "ry", "rz")
    model = planar(Model(mesh, (Frame(members=dict.fromkeys(mesh.members, p)), fix(0, held), fix(3, held))))
    s = 24 * p.section.Iy * h / (p.section.A * l**3)
    kappa = 1 - s / (1 + s)
    equation, start, rough = {
        "clamped": (lambda x: np.sin(x) * 6 * kappa + x * np.cos(x), (2, 3), 7.38),
        "pinned": (lambda x: x * np.sin(x) - 6 * kappa * np.cos(x), (1, 1.5), 1.82),
    }[feet]
    root = brentq(equation, *start, xtol=1e-14)
    EIc = STEEL.E * p.section.Iy
    assert root**2 == pytest.approx(rough, abs=0.006)
    found = solve_buckling(model, {(1, "z"): -1.0, (2, "z"): -1.0}, 1).factors[0]
    # The beam has no axial force: its cubics are exact, and EI ∫ v''² of the columns is less than P ∫ v'².
    error, predicted = found / (root**2 * EIc / h**2) - 1, (root / n) ** 4 / 720
    assert 0.3 * predicted < error < 1.02 * predicted


def test_frequencies_vanish_at_the_load_factor():
    model = planar(beam(8, L, effects=ENDS["pinned-pinned"][0]))
    modes = solve_buckling(model, {(1, "x"): -40.0}, 1)
    critical = modes.factors[0]
    squares = [
        solve_modes(assemble(modes.loaded(f * critical)), 1).frequency[0] ** 2 for f in (0, 0.5, 0.999)
    ]
    # ω² falls linearly with the load, the shape being a sine at each
    np.testing.assert_allclose(
        squares, squares[0] * np.array([1, 0.5, 0.001]), rtol=1e-4, atol=1e-5 * squares[0]
    )


@pytest.mark.parametrize("pull", [0.5, 20.0])
def test_a_pinned_beam_tuned_by_its_tension(pull):
    # ω² = (k⁴EI + k²N)/ρA, k = jπ/L, N from statics on three elements. The cubics miss e with
    # e'' = v''''/2 (x² - h²/12) in each element: EI ∫ e''² = EI k⁸ h⁴/720 ∫ v², N ∫ e'² = N k⁸ h⁶/30240 ∫ v².
    euler = np.pi**2 * EI / L**2
    N, n = pull * euler, 16
    coarse = planar(beam(3, L, effects=ENDS["pinned-pinned"][0]))
    solution = solve_static(assemble(coarse), {(1, "x"): N})
    fine = planar(beam(n, L, effects=ENDS["pinned-pinned"][0]))
    modes = solve_modes(assemble(prestressed(fine, solution)), 3)
    k, h, m = np.pi / L * np.arange(1, 4), L / n, STEEL.rho * FLAT.A
    exact = k**4 * EI + k**2 * N
    error = modes.omega**2 * m / exact - 1
    predicted = k**8 * (EI * h**4 / 720 + N * h**6 / 30240) / exact
    np.testing.assert_allclose(error, predicted, rtol=0.3 * (k[-1] * h) ** 2, atol=1e-10)


def test_both_signs():
    # a column that is pulled buckles under the opposite load only
    model = chain(1, 12, (fix(0), fix(1, ("y", "z", "rx", "ry", "rz"))))
    pushed = solve_buckling(model, PUSH, 3)
    pulled = solve_buckling(model, {(1, "x"): 1.0}, 3, sign="negative")
    np.testing.assert_allclose(pulled.factors, -pushed.factors, rtol=1e-9)
    assert solve_buckling(model, {(1, "x"): 1.0}, 3).factors.size == 0
    # a force in the middle of a clamped beam pushes one half and pulls the other: λ and -λ
    model = beam(12, L, effects=(fix(0), fix(1)))
    middle = int(model.mesh.nearest_point([L / 2, 0, 0])[0])
    both = solve_buckling(model, {(middle, "x"): 1.0}, 4, sign="both").factors
    np.testing.assert_allclose(both[[0, 2]], -both[[1, 3]], rtol=1e-8)


def test_what_cannot_buckle_is_refused():
    model = beam(4, L, effects=(fix(0),))
    cases = [LoadCase(name="bend", points={(1, "z"): 1.0}), LoadCase(name="push", points=PUSH)]
    solution = solve_static(assemble(model), cases)
    assert solve_buckling(model, solution, 1, case="push").factors[0] == pytest.approx(
        solve_buckling(model, PUSH, 1).factors[0], rel=1e-9
    )
    flat = planar(model)
    bend = solve_static(assemble(flat), {(1, "ry"): 1.0})
    with pytest.raises(ModelError, match="no member a section force that works on a motion it can make"):
        solve_buckling(flat, bend)
    with pytest.raises(ModelError, match="the sign is 'up'"):
        solve_buckling(model, PUSH, sign="up")
    with pytest.raises(ModelError, match="0 load factors"):
        solve_buckling(model, PUSH, 0)
    with pytest.raises(ModelError, match="nothing holds"):
        solve_buckling(beam(4), PUSH)
