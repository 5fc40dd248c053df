"""Frame models of Nastran decks: each family of cards against a closed form, and bad decks by line."""

import math

import numpy as np
import pytest

from fem import MeshError, assemble, solve_modes
from fem.io import DeckUnits, model_of
from fem.io.nastran_frame import read_nastran_frame

E, NU, L, A, I1, I2, J, M = 2e11, 0.25, 2.0, 4e-4, 3e-8, 1e-8, 2e-8, 50.0
G = E / (2 * (1 + NU))
GRIDS = "GRID,1,,0.,0.,0.\nGRID,2,,2.,0.,0.\n"
STEEL = "MAT1,1,2.+11,,.25\n"
BAR = "CBAR,10,5,1,2,0.,1.,0.\n"
PBAR = "PBAR,5,1,4.-4,3.-8,1.-8,2.-8\n"
MASS = "CONM2,20,2,,50.\n"
INERT = "CONM2,20,2,,50.\n,.4,,.4,,,.4\n"
CLAMP = "SPC1,1,123456,1\n"
CANTILEVER = GRIDS + STEEL + PBAR + CLAMP


def deck_of(folder, text, units=None):
    path = folder / "a.bdf"
    path.write_text(text)
    return read_nastran_frame(path, units or DeckUnits())


def frequencies(folder, text, n=6, units=None):
    return solve_modes(assemble(model_of(deck_of(folder, text, units))), n).frequency


def hertz(k, m):
    return math.sqrt(k / m) / (2 * math.pi)


def stiffnesses(folder, text, n=3, mass=M):
    """Return stiffnesses of a body without inertia at the tip, from the lowest one on."""
    return np.sort((2 * math.pi * frequencies(folder, text, n)) ** 2 * mass)


# Bars ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "bar",
    [
        BAR,
        "BAROR,,5,,,0.,1.,0.\nCBAR,10,,1,2\n",
        "CBAR,10,5,1,2,3\nGRID,3,,1.,7.,0.\n",
        "CBAR,10,5,1,2,1.,1.,0.,BGG\n",
        # cylindrical motions at GA: r, θ, z are x, y, z there
        "CORD2C,7,,0.,-1.,0.,0.,-1.,1.\n,0.,0.,0.\nCBAR,10,5,9,2,1.,0.,0.\nGRID,9,,0.,0.,0.,7\nSPC1,1,123456,9\n",
    ],
)
def test_plane_1_bends_along_the_orientation(tmp_path, bar):
    """I1 bends along y, I2 along z: 3EI/L³ each, for a mass at the tip; EA/L along the bar."""
    deck = deck_of(tmp_path, CANTILEVER + bar + MASS)
    modes = solve_modes(assemble(model_of(deck)), 3)
    expected = [hertz(k, M) for k in (3 * E * I2 / L**3, 3 * E * I1 / L**3, E * A / L)]
    np.testing.assert_allclose(modes.frequency, expected, rtol=1e-6)
    tip = 6 * int(np.argmax(model_of(deck).mesh.points[:, 0]))
    assert abs(modes.shapes[tip + 1, 1]) > 1e3 * abs(modes.shapes[tip + 2, 1])


def test_shear_factors_of_pbar_and_their_default(tmp_path):
    """1/k = L³/3EI + L/(K G A); blank factors leave shear out."""
    text = CANTILEVER.replace(PBAR, "PBAR,5,1,4.-4,3.-8,1.-8,2.-8\n,\n,1.-3,2.-3\n") + BAR + MASS
    k = [1 / (L**3 / (3 * E * I) + L / (K * G * A)) for I, K in ((I2, 2e-3), (I1, 1e-3))]
    np.testing.assert_allclose(stiffnesses(tmp_path, text, 2), k, rtol=1e-6)


def test_product_of_inertia_turns_the_principal_axes(tmp_path):
    """The stiffness across the bar is 3E/L³ [[I1, I12], [I12, I2]] in Nastran's y and z."""
    I12 = 1.2e-8
    text = CANTILEVER.replace(PBAR, "PBAR,5,1,4.-4,3.-8,1.-8,2.-8\n,\n,,,1.2-8\n") + BAR + MASS
    model = model_of(deck_of(tmp_path, text))
    modes = solve_modes(assemble(model), 2)
    tip = 6 * int(np.argmax(model.mesh.points[:, 0]))
    values, vectors = np.linalg.eigh(3 * E / L**3 * np.array([[I1, I12], [I12, I2]]))
    np.testing.assert_allclose(modes.frequency, [hertz(k, M) for k in values], rtol=1e-6)
    shape = modes.shapes[tip + 1 : tip + 3, 0]
    assert abs(shape @ vectors[:, 0]) == pytest.approx(np.linalg.norm(shape), rel=1e-6)


def test_pin_flags_are_those_of_nastrans_axes(tmp_path):
    """Flag 6 at B frees the rotation of plane 1: 3EI1/L³ where the other plane has 12EI2/L³."""
    text = CANTILEVER + "CBAR,10,5,1,2,0.,1.,0.\n,,6\nSPC1,1,456,2\n" + MASS
    np.testing.assert_allclose(
        stiffnesses(tmp_path, text, 2), sorted([3 * E * I1 / L**3, 12 * E * I2 / L**3]), rtol=1e-6
    )


def test_pins_beyond_a_mechanism_do_nothing_more(tmp_path):
    """Both ends with 456 are a rod, as in Nastran, which passes over pins without stiffness."""
    text = CANTILEVER + "CBAR,10,5,1,2,0.,1.,0.\n,456,456\nSPC1,1,23456,2\n" + MASS
    np.testing.assert_allclose(stiffnesses(tmp_path, text, 1), [E * A / L], rtol=1e-6)


def test_offsets_are_rigid_arms_in_displacement_systems(tmp_path):
    """A bar with offsets is one between points that RBE2 ties to the nodes; B's offset is in system 7."""
    offset = CANTILEVER.replace("GRID,2,,2.,0.,0.", "GRID,2,,2.,0.,0.,7")
    offset += "CORD2R,7,,0.,0.,0.,0.,0.,1.\n,0.,1.,0.\nCBAR,10,5,1,2,0.,1.,0.\n,,,.1,.2,.3,.2,.1,.3\n" + INERT
    tied = CANTILEVER + "GRID,3,,.1,.2,.3\nGRID,4,,1.9,.2,.3\nCBAR,10,5,3,4,0.,1.,0.\n"
    tied += "RBE2,1,1,123456,3\nRBE2,2,2,123456,4\n" + INERT
    np.testing.assert_allclose(frequencies(tmp_path, offset), frequencies(tmp_path, tied), rtol=1e-6)


def test_offset_in_axes_of_the_bar(tmp_path):
    along_z = "CBAR,10,5,1,2,0.,1.,0.,{}\n,,,0.,0.,.2,0.,0.,.2\n"
    texts = [CANTILEVER + along_z.format(flag) + INERT for flag in ("GOO", "GGG")]
    np.testing.assert_allclose(*(frequencies(tmp_path, text) for text in texts), rtol=1e-9)


def test_lumped_mass_has_no_inertia_of_torsion_in_cbar(tmp_path):
    """Half of ρAL at the tip, and no more; with COUPMASS a Euler beam of one element: 3.53 √(EI/m L⁴)."""
    rho, line = 7800.0, CANTILEVER.replace("MAT1,1,2.+11,,.25", "MAT1,1,2.+11,,.25,7800.") + BAR
    f = frequencies(tmp_path, line, 3)
    half = rho * A * L / 2
    expected = [hertz(k, half) for k in (3 * E * I2 / L**3, 3 * E * I1 / L**3, E * A / L)]
    np.testing.assert_allclose(f, expected, rtol=1e-6)
    coupled = frequencies(tmp_path, line + "PARAM,COUPMASS,1\n", 1)[0]
    exact = 3.5160 / (2 * math.pi) * math.sqrt(E * I2 / (rho * A * L**4))
    assert 0 < coupled / exact - 1 < 0.006  # one cubic element: 0.48 %


def test_non_structural_mass_and_wtmass(tmp_path):
    text = CANTILEVER.replace("2.-8\n", "2.-8,30.\n").replace(",,.25", ",,.25,7800.") + BAR
    text += "PARAM,WTMASS,.5\n"
    half = 0.5 * (7800 * A + 30) * L / 2
    assert frequencies(tmp_path, text, 1)[0] == pytest.approx(hertz(3 * E * I2 / L**3, half), rel=1e-6)


def test_a_shear_modulus_of_its_own_decides_torsion(tmp_path):
    """GJ/L and K G A with G = 3e11 and E = 2e11, which no Poisson's ratio gives."""
    text = CANTILEVER.replace(STEEL, "MAT1,1,2.+11,3.+11,.3\n") + BAR + INERT
    assert hertz(3e11 * J / L, 0.4) == pytest.approx(frequencies(tmp_path, text)[2], rel=1e-6)


def test_units(tmp_path):
    """A deck in millimetres, tonnes and seconds is the same model."""
    text = "GRID,1,,0.,0.,0.\nGRID,2,,2000.,0.,0.\nMAT1,1,2.+5,,.25,7.8-9\nPBAR,5,1,400.,3.+4,1.+4,2.+4\n"
    text += BAR + CLAMP + "CONM2,20,2,,.05,0.,10.\n,.4+3,,.4+3,,,.4+3\nCELAS2,30,7.,2,3\nCELAS2,31,9.+6,2,5\n"
    si = CANTILEVER.replace(",,.25", ",,.25,7800.") + BAR
    si += "CONM2,20,2,,50.,0.,.01\n,.4,,.4,,,.4\nCELAS2,30,7.+3,2,3\nCELAS2,31,9.+3,2,5\n"
    mm = frequencies(tmp_path, text, units=DeckUnits(1e-3, 1e3, 1.0))
    np.testing.assert_allclose(mm, frequencies(tmp_path, si), rtol=1e-9)


@pytest.mark.parametrize("n", [5, 300])
def test_bars_without_density(tmp_path, n):
    """Massless bars and one body: the modes are those of the body, of dense and of sparse solvers."""
    grids = "".join(f"GRID,{k + 1},,{k * L / n:.12g},0.,0.\n" for k in range(n + 1))
    bars = "".join(f"CBAR,{k},5,{k},{k + 1},0.,1.,0.\n" for k in range(1, n + 1))
    text = grids + STEEL + PBAR + CLAMP + bars + f"CONM2,{n + 9},{n + 1},,50.\n"
    expected = [hertz(k, M) for k in (3 * E * I2 / L**3, 3 * E * I1 / L**3, E * A / L)]
    np.testing.assert_allclose(frequencies(tmp_path, text, 3), expected, rtol=1e-5)


def test_a_deck_in_a_plane_without_area_and_torsion(tmp_path):
    """PBAR with I1 alone, its other motions fixed by GRDSET; a note says that zeros are replaced."""
    text = CANTILEVER.replace(PBAR, "PBAR,5,1,,3.-8\n") + "GRDSET,,,,,,,1345\n" + BAR + MASS
    assert stiffnesses(tmp_path, text, 1)[0] == pytest.approx(3 * E * I1 / L**3, rel=1e-6)
    assert any("A and I2 and J are zero" in note for note in deck_of(tmp_path, text).notes)


# Beams and rods -------------------------------------------------------------------------------------------


def test_cbeam_has_shear_by_default_and_inertia_of_torsion(tmp_path):
    text = CANTILEVER.replace(PBAR, "PBEAM,5,1,4.-4,3.-8,1.-8,,2.-8\n").replace(",,.25", ",,.25,7800.")
    f = frequencies(tmp_path, text + BAR.replace("CBAR", "CBEAM"), 6)
    k = 1 / (L**3 / (3 * E * I2) + L / (G * A))
    assert f[0] == pytest.approx(hertz(k, 7800 * A * L / 2), rel=1e-6)
    twist = hertz(G * J / L, 7800 * (I1 + I2) * L / 2)
    assert np.abs(f / twist - 1).min() < 1e-6


def test_tapered_pbeam(tmp_path):
    """A cone, d falling to half: the flexibility of its tip is ∫ (L - x)² / E I(x) dx."""
    ends = "PBEAM,5,1,4.-4,3.-8,3.-8,,6.-8\n,\n,NO,1.,1.-4,{0},{0},,{1}\n,0.,0.\n".format("1.875-9", "3.75-9")
    text = CANTILEVER.replace(PBAR, ends) + BAR.replace("CBAR", "CBEAM") + MASS
    d1, d2 = 1.0, 0.5  # relative diameters: A as d², I as d⁴
    x = np.linspace(0, L, 20001)
    d = d1 + (d2 - d1) * x / L
    flexibility = np.trapezoid((L - x) ** 2 / (E * I1 * d**4), x)
    np.testing.assert_allclose(stiffnesses(tmp_path, text, 1), [1 / flexibility], rtol=1e-6)


def test_centroid_beside_the_shear_centre_is_an_offset(tmp_path):
    bend = "PBEAM,5,1,4.-4,3.-8,1.-8,,2.-8\n,\n,0.,0.\n,,,,,.1,.2\n"
    text = CANTILEVER.replace(PBAR, bend) + BAR.replace("CBAR", "CBEAM") + INERT
    deck = deck_of(tmp_path, text)
    np.testing.assert_allclose(deck.bars.offsets[0], [[0, 0.1, 0.2]] * 2, atol=1e-15)
    assert any("shear centre" in note for note in deck.notes)


@pytest.mark.parametrize(
    ("cards", "stiffness"),
    [
        ("CROD,11,6,2,3\nPROD,6,1,4.-4\n", E * 4e-4 / 1.5),
        ("CONROD,11,2,3,1,4.-4\n", E * 4e-4 / 1.5),
        ("CTUBE,11,6,2,3\nPTUBE,6,1,.05,.002\n", E * math.pi * 0.048 * 0.002 / 1.5),
    ],
)
def test_rods(tmp_path, cards, stiffness):
    text = (
        CANTILEVER + BAR + cards + "GRID,3,,2.,1.5,0.,,1456\nCONM2,21,3,,50.\nSPC1,1,123456,2\nSPC1,1,3,3\n"
    )
    assert frequencies(tmp_path, text, 1)[0] == pytest.approx(hertz(stiffness, M), rel=1e-6)


def test_torsion_of_a_rod_between_beams(tmp_path):
    """Two shafts of half of J each, one of them a rod, twist as one."""
    text = CANTILEVER.replace("3.-8,1.-8,2.-8", "3.-8,1.-8,1.-8") + BAR + INERT
    text += "CROD,11,6,1,2\nPROD,6,1,4.-4,1.-8\n"
    assert np.abs(frequencies(tmp_path, text) / hertz(G * J / L, 0.4) - 1).min() < 1e-6


@pytest.mark.parametrize(
    ("shape", "dimensions", "constants"),
    [
        ("BAR", ".03,.05", (0.03 * 0.05, 0.03 * 0.05**3 / 12, 0.05 * 0.03**3 / 12)),
        ("ROD", ".02", (math.pi * 0.02**2, math.pi * 0.02**4 / 4, math.pi * 0.02**4 / 4)),
        ("TUBE", ".02,.015", (math.pi * (0.02**2 - 0.015**2), *[math.pi * (0.02**4 - 0.015**4) / 4] * 2)),
        (
            "BOX",
            ".06,.1,.004,.003",
            (
                0.06 * 0.1 - 0.054 * 0.092,
                (0.06 * 0.1**3 - 0.054 * 0.092**3) / 12,
                (0.1 * 0.06**3 - 0.092 * 0.054**3) / 12,
            ),
        ),
        (
            "I",
            ".1,.06,.06,.004,.005,.005",
            (
                2 * 0.06 * 0.005 + 0.09 * 0.004,
                (0.06 * 0.1**3 - 0.056 * 0.09**3) / 12,
                (2 * 0.005 * 0.06**3 + 0.09 * 0.004**3) / 12,
            ),
        ),
        (
            "H",
            ".05,.01,.08,.004",
            (
                0.01 * 0.08 + 0.05 * 0.004,
                (0.01 * 0.08**3 + 0.05 * 0.004**3) / 12,
                (0.08 * 0.06**3 - 0.076 * 0.05**3) / 12,
            ),
        ),
        (
            "CROSS",
            ".05,.004,.08,.006",
            (
                0.004 * 0.08 + 0.05 * 0.006,
                (0.004 * 0.08**3 + 0.05 * 0.006**3) / 12,
                (0.006 * 0.054**3 + 0.074 * 0.004**3) / 12,
            ),
        ),
    ],
)
def test_shapes(tmp_path, shape, dimensions, constants):
    text = CANTILEVER.replace(PBAR, f"PBARL,5,1,,{shape}\n,{dimensions}\n") + BAR + MASS
    section = deck_of(tmp_path, text).properties[0].section
    swapped = round(section.angle / (math.pi / 2)) % 2
    Iy, Iz = (section.Iz, section.Iy) if swapped else (section.Iy, section.Iz)
    np.testing.assert_allclose((section.A, Iy, Iz), constants, rtol=1e-9)


# Bodies and connections -----------------------------------------------------------------------------------


def test_products_of_inertia_and_offset_of_conm2(tmp_path):
    """I21 is ∫ xy dm, an entry -I21 of the tensor; the offset is in system CID."""
    text = (
        CANTILEVER
        + BAR
        + "CORD2R,7,,0.,0.,0.,0.,0.,1.\n,0.,1.,0.\nCONM2,20,2,7,9.,.1,.2,.3\n,4.,.5,5.,.6,.7,6.\n"
    )
    body = deck_of(tmp_path, text).bodies[0]
    np.testing.assert_allclose(body.arm, [-0.2, 0.1, 0.3], atol=1e-15)
    # system 7: x along global y, y along global -x
    np.testing.assert_allclose(body.inertia, [[5, 0.5, 0.7], [0.5, 4, -0.6], [0.7, -0.6, 6]], atol=1e-14)


def test_conm1_of_a_rigid_body(tmp_path):
    m, arm, inertia = 9.0, np.array([0.1, 0.2, 0.3]), np.diag([4.0, 5.0, 6.0])
    S = np.array([[0, -arm[2], arm[1]], [arm[2], 0, -arm[0]], [-arm[1], arm[0], 0]])
    full = np.block([[m * np.eye(3), -m * S], [m * S, inertia - m * S @ S]])
    values = [f"{v:.9g}" for v in full[np.tril_indices(6)]]
    lines = ["CONM1,20,2,," + ",".join(values[:5]), *("," + ",".join(values[k : k + 8]) for k in (5, 13))]
    body = deck_of(tmp_path, CANTILEVER + BAR + "\n".join(lines) + "\n").bodies[0]
    np.testing.assert_allclose(body.arm, arm, rtol=1e-7)
    np.testing.assert_allclose(body.inertia, inertia, rtol=1e-6, atol=1e-7)


ON_SPRINGS = CANTILEVER + BAR + "GRID,3,,2.,0.,.5\nCONM2,21,3,,50.\n,.4,,.5,,,.6\nSPC1,1,123456,2\n"


@pytest.mark.parametrize(
    ("cards", "expected"),
    [
        ("CELAS2,30,7.+3,2,3,3,3\nSPC1,1,12456,3\n", [hertz(7e3, M)]),
        ("CELAS1,30,8,3,3\nPELAS,8,7.+3\nSPC1,1,12456,3\n", [hertz(7e3, M)]),
        (
            "CBUSH,30,8,2,3,,,,0\n,1.\nPBUSH,8,K,1.+3,2.+3,3.+3,40.,50.,60.\n",
            [hertz(1e3, M), hertz(2e3, M), hertz(3e3, M), hertz(40, 0.4), hertz(50, 0.5), hertz(60, 0.6)],
        ),
        # along the line: x is global z, y global x
        (
            "CBUSH,30,8,2,3,1.,0.,0.\n,1.\nPBUSH,8,K,1.+3,2.+3,3.+3,40.,50.,60.\n",
            [hertz(2e3, M), hertz(3e3, M), hertz(1e3, M), hertz(50, 0.4), hertz(60, 0.5), hertz(40, 0.6)],
        ),
        ("CBUSH,30,8,3,,,,,0\nPBUSH,8,K,1.+3\nSPC1,1,23456,3\n", [hertz(1e3, M)]),
        ("CBUSH1D,30,8,2,3\nPBUSH1D,8,7.+3\nSPC1,1,12456,3\n", [hertz(7e3, M)]),
    ],
)
def test_springs(tmp_path, cards, expected):
    found = frequencies(tmp_path, ON_SPRINGS + cards, len(expected))
    np.testing.assert_allclose(found, sorted(expected), rtol=1e-6)


def test_dashpots(tmp_path):
    cards = "CDAMP2,31,9.,2,3,3,3\nCVISC,32,7,2,3\nPVISC,7,5.,6.\nCELAS2,30,7.+3,2,3,3,3,.02\n"
    deck = deck_of(tmp_path, ON_SPRINGS + cards + "SPC1,1,12456,3\n")
    by_name = {c.name: c for c in deck.connections}
    assert by_name["CDAMP2 31"].C[2, 2] == 9.0
    assert np.diag(by_name["CVISC 32"].C).tolist() == [5, 0, 0, 6, 0, 0]
    np.testing.assert_allclose(by_name["CVISC 32"].axes[0], [0, 0, 1])
    assert by_name["CELAS2 30"].D[2, 2] == pytest.approx(140)


# Rigid elements and supports ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "tie",
    [
        "RBE2,40,2,123456,3\n",
        "RBAR,40,2,3,123456\n",
        "RBAR,40,3,2,,123456\n",
        "".join(
            f"MPC,4,3,{c},-1.,2,{c},1.\n{more}"
            for c, more in ((1, ",,2,5,.5\n"), (2, ",,2,4,-.5\n"), (3, ""), (4, ""), (5, ""), (6, ""))
        ),
    ],
)
def test_a_body_on_a_rigid_arm(tmp_path, tie):
    text = CANTILEVER + BAR
    arm = text + "CONM2,20,2,,50.,0.,0.,.5\n,.4,,.4,,,.4\n"
    tied = text + "GRID,3,,2.,0.,.5\nCONM2,20,3,,50.\n,.4,,.4,,,.4\n" + tie
    np.testing.assert_allclose(frequencies(tmp_path, tied), frequencies(tmp_path, arm), rtol=1e-6)


def test_rbe2_in_some_directions_of_a_turned_system(tmp_path):
    """A dependent grid point whose x is global y follows in that direction alone."""
    text = CANTILEVER + BAR + "GRID,3,,2.,0.,0.,7\nCORD2R,7,,0.,0.,0.,0.,0.,1.\n,0.,1.,0.\nCONM2,21,3,,50.\n"
    text += "RBE2,40,2,1,3\nSPC1,1,23456,3\n"
    assert frequencies(tmp_path, text, 1)[0] == pytest.approx(hertz(3 * E * I1 / L**3, M), rel=1e-6)


def test_rbe3_distributes_as_a_weighted_mean(tmp_path):
    """At the weighted centroid x = (3·2 + 3 + 4) / 5 of points on a line, z is the weighted mean."""
    text = CANTILEVER + BAR + "GRID,3,,3.,0.,0.\nGRID,4,,2.6,0.,0.\nGRID,5,,4.,0.,0.\n"
    text += "CBAR,11,5,2,3,0.,1.,0.\nCBAR,12,5,3,5,0.,1.,0.\nRBE3,40,,4,3,3.,3,2,\n,1.,3,3,5\n"
    equation = deck_of(tmp_path, text + "CONM2,20,4,,50.\n").equations[0]
    terms = {(row, d): c for row, d, c in equation.terms}
    assert terms == pytest.approx({(3, "z"): 1.0, (1, "z"): -0.6, (2, "z"): -0.2, (4, "z"): -0.2})


def test_rbe3_of_six_components_fits_rigid_motions(tmp_path):
    """A rigid motion of the independent points moves the reference point with them, also about skew axes."""
    grids = (
        "GRID,3,,2.,1.,0.\nGRID,4,,2.,0.,1.\nGRID,5,,2.3,.2,.4,7\nCORD2C,7,,0.,0.,0.,0.,1.,1.\n,1.,0.,0.\n"
    )
    bars = "CBAR,11,5,2,3,1.,0.,0.\nCBAR,12,5,2,4,1.,0.,0.\n"
    deck = deck_of(tmp_path, CANTILEVER + BAR + grids + bars + "RBE3,40,,5,123456,1.,123,2,3,\n,4\n")
    u, theta = np.array([0.3, -0.2, 0.5]), np.array([0.1, 0.4, -0.3])
    motion = {}
    for row, point in enumerate(deck.points):
        moved = np.append(u + np.cross(theta, point), theta)
        motion |= {(row, d): v for d, v in zip(("x", "y", "z", "rx", "ry", "rz"), moved, strict=True)}
    assert len(deck.equations) == 6
    for equation in deck.equations:
        assert sum(c * motion[row, d] for row, d, c in equation.terms) == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize(
    ("control", "cards", "fixed"),
    [
        ("", "SPC1,1,123456,1\n", {0: 6}),
        ("SPC = 2\n", "SPC1,1,123456,1\nSPC,2,1,123,,2,3\n", {0: 3, 1: 1}),
        ("SPC = 9\n", "SPCADD,9,1,2\nSPC1,1,123456,1\nSPC1,2,3,2\nSPC1,3,2,2\n", {0: 6, 1: 1}),
        ("SUBCASE 1\nSPC = 2\n", "SPC1,2,12,1,THRU,2\n", {0: 2, 1: 2}),
        ("SPC = 1\n", "SPC1,1,12346,1\nGRDSET,,,,,,,5\n", {0: 6, 1: 1}),
    ],
)
def test_selected_supports(tmp_path, control, cards, fixed):
    head = f"SOL 103\nCEND\n{control}BEGIN BULK\n" if control else ""
    supports = deck_of(tmp_path, head + GRIDS + STEEL + PBAR + BAR + MASS + cards).supports
    assert {row: len(d) for row, d in supports.items()} == fixed


def test_a_skew_support(tmp_path):
    """A roller whose normal is turned by 30° from z: the free motion keeps both planes coupled."""
    c, s = math.cos(math.pi / 6), 0.5
    system = f"CORD2R,7,,0.,0.,0.,0.,{-s},{c:.9f}\n,1.,0.,0.\n"
    text = CANTILEVER.replace("GRID,2,,2.,0.,0.", "GRID,2,,2.,0.,0.,7") + system + BAR + MASS + "SPC1,1,3,2\n"
    along = np.array([c, s])  # y and z of the free direction
    k = 3 * E / L**3 * along @ np.diag([I1, I2]) @ along
    # the rotations at the tip are free, so that the roller's force bends both planes independently
    assert stiffnesses(tmp_path, text, 1)[0] == pytest.approx(k, rel=1e-6)


def test_damping(tmp_path):
    head = "CEND\nSDAMPING = 3\nBEGIN BULK\n"
    text = CANTILEVER + BAR + MASS + "PARAM,G,.04\nTABDMP1,3,CRIT\n,0.,.01,100.,.03,ENDT\n"
    damping = deck_of(tmp_path, head.replace("SDAMPING", "SPC = 1\nSDAMPING") + text).damping
    assert damping is not None
    assert damping.loss_factor == 0.04
    assert (damping.frequency.tolist(), damping.ratio.tolist()) == ([0, 100], [0.01, 0.03])


# Bad decks ------------------------------------------------------------------------------------------------

GOOD = CANTILEVER + BAR + MASS


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (GOOD.replace("CBAR,10,5", "CBAR,10,6"), r"a\.bdf: line 6: CBAR 10 .* has no PBAR or PBARL 6"),
        (GOOD.replace("PBAR,5,1", "PBAR,5,2"), r"line 4: PBAR 5 refers to material 2.*no MAT1 2"),
        (GOOD.replace("1,2,0.,1.,0.", "1,8,0.,1.,0."), r"line 6: CBAR 10 refers to grid point 8"),
        (GOOD.replace("GRID,2,,2.", "GRID,2,,0."), "line 6: CBAR 10 has no length"),
        (GOOD.replace("0.,1.,0.\n", "1.,0.,0.\n"), "line 6: CBAR 10 has its orientation vector along"),
        (GOOD.replace(",0.,1.,0.\n", "\n"), "line 6: CBAR 10 has no orientation"),
        (GOOD.replace(PBAR, "PBARL,5,1,,HEXAGON\n,1.\n"), "line 4: PBARL 5 has the shape 'HEXAGON'"),
        (GOOD.replace(PBAR, "PBARL,5,1,,BOX\n,1.,1.\n"), "line 4: PBARL 5 .* 4 dimensions; DIM3 is blank"),
        (GOOD.replace(PBAR, "PBARL,5,1,,TUBE\n,1.,2.\n"), "line 4: PBARL 5 cannot be used"),
        (GOOD.replace("4.-4", "4.x4"), "line 4: PBAR 5 has '4.X4' in its field 4; a number is needed"),
        (GOOD.replace("4.-4,3.-8,1.-8", "0.,0.,0."), "line 4: PBAR 5 has the area 0"),
        (GOOD.replace("4.-4", "-4.-4"), "line 4: PBAR 5 has the area"),
        (GOOD.replace("2.+11,,.25", ",,.25"), r"line 3: MAT1 1 has E = 0 and G = 0"),
        (GOOD + "RBE2,40,2,123456,2\n", "line 8: RBE2 40 joins grid point 2 with itself"),
        (GOOD + "RBAR,40,1,2,123\n", "line 8: RBAR 40 .* six independent components"),
        (GOOD + "RBE3,40,,2,123456,1.,123,1\n", "line 8: RBE3 40 does not determine its component"),
        (GOOD + "SPC1,2,123,2\n", "line 5: SPC1 1 is in one of the sets 1, 2, and there is no case control"),
        ("CEND\nSPC=7\nBEGIN BULK\n" + GOOD, "line 8: SPC1 1 .*SPC = 7, which the file lacks"),
        ("CEND\nSUBCASE 1\nSPC=1\nSUBCASE 2\nSPC=2\nBEGIN BULK\n" + GOOD, "a.bdf: the subcases select"),
        (GOOD + "SPC1,1,129,2\n", "line 8: SPC1 1 has '129' in its field 3; some of the components 1 to 6"),
        (GOOD + "CQUAD4,50,1,1,2,3,4\n", "line 8: CQUAD4 50 has no place in a frame model.*1 CQUAD4"),
        (GOOD + "CELAS2,50,7.,1,1,2,2\n", "line 8: CELAS2 50 couples different directions"),
        (GOOD + "CBUSH,50,8,1,2,,,,0\n", "line 8: CBUSH 50 .* no PBUSH 8"),
        (GOOD + "CONM2,21,2,,-5.\n", "line 8: CONM2 21 has the mass -5"),
        (GOOD + "CMASS2,21,5.,2,1\n", "line 8: CMASS2 21 is a mass in some directions only"),
        (GOOD + "PBAR,5,1,5.-4,3.-8,1.-8,2.-8\n", "line 8: PBAR 5 is already defined.* line 4"),
        (GOOD.replace(PBAR, PBAR + ",\n,,,1.2-8\n").replace(BAR, BAR + ",,6\n"), "a pin in one plane"),
    ],
)
def test_bad_decks_are_refused_by_file_line_and_card(tmp_path, text, words):
    with pytest.raises(MeshError, match=words) as reason:
        deck_of(tmp_path, text)
    assert "\n" not in str(reason.value)


def test_notes_say_what_is_left_out(tmp_path):
    text = GOOD + "NSM1,1,PBAR,3.,5\nASET1,1,2\nFOO,1\nSPC,1,2,1,.5\n"
    notes = " | ".join(deck_of(tmp_path, text).notes)
    for words in (
        "NSM1 1 at a.bdf: line 8: its non-structural mass",
        "ASET1",
        "FOO",
        "enforced motion",
        "lumped mass",
    ):
        assert words in notes
