"""Abaqus decks of published benchmarks (NAFEMS FV1 to FV5), and against CalculiX where it is installed."""

import itertools
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest

from fem import assemble, solve_modes
from fem.io import model_of
from tests.fem.io.abaqus_decks import deck_of, frequencies, line

STEEL = "*MATERIAL, NAME=STEEL\n*ELASTIC\n200e9, 0.3\n*DENSITY\n8000\n"
ARMS = 5.0


def cross(n_arms, n=8):
    """Return a deck of arms from a hub, all ends pinned in the plane."""
    nodes, elements, ends = ["1, 0, 0"], [], []
    for arm in range(n_arms):
        c, s = np.cos(2 * np.pi * arm / n_arms), np.sin(2 * np.pi * arm / n_arms)
        chain = [1, *range(len(nodes) + 1, len(nodes) + 1 + n)]
        nodes += [
            f"{k}, {ARMS * j / n * c:.15g}, {ARMS * j / n * s:.15g}" for j, k in enumerate(chain[1:], 1)
        ]
        elements += list(itertools.pairwise(chain))
        ends.append(chain[-1])
    rows = [f"{k}, {a}, {b}" for k, (a, b) in enumerate(elements, 1)]
    return "\n".join(
        [
            "*NODE",
            *nodes,
            "*ELEMENT, TYPE=B23, ELSET=ARMS",
            *rows,
            "*NSET, NSET=ENDS",
            *map(str, ends),
            STEEL + "*BEAM SECTION, ELSET=ARMS, MATERIAL=STEEL, SECTION=RECT",
            ".125, .125",
            "*BOUNDARY",
            "ENDS, 1, 2",
            "",
        ]
    )


@pytest.mark.parametrize("arms", [4, 8])
def test_fv1_and_fv2_pinned_crosses(tmp_path, arms):
    # published for arms that do not stretch: the hub is fixed in the plane
    n = arms - 1
    published = [11.336, *[17.709] * n, 45.345, *[57.390] * n]
    f = frequencies(tmp_path, cross(arms) + "1, 1, 2\n", 2 * arms)
    np.testing.assert_allclose(f, published, rtol=5e-4)
    # where arms stretch, the two modes that move the hub are lower
    free = frequencies(tmp_path, cross(arms), arms)
    np.testing.assert_allclose(free[3:], published[3:arms], rtol=5e-4)
    assert (free[1:3] < 0.999 * 17.709).all()


def test_fv3_free_square_frame(tmp_path):
    corners, n = np.array([(0, 0), (10, 0), (10, 10), (0, 10), (0, 0)], dtype=float), 10
    points = [a + (b - a) * j / n for a, b in itertools.pairwise(corners) for j in range(n)]
    rows = [f"{k}, {x!r}, {y!r}" for k, (x, y) in enumerate(np.array(points).tolist(), 1)]
    bars = [f"{k}, {k}, {k % (4 * n) + 1}" for k in range(1, 4 * n + 1)]
    text = "\n".join(["*NODE", *rows, "*ELEMENT, TYPE=B23, ELSET=F", *bars, STEEL])
    text += "*BEAM SECTION, ELSET=F, MATERIAL=STEEL, SECTION=RECT\n.25, .25\n"
    f = frequencies(tmp_path, text, 8)
    np.testing.assert_allclose(f[:3], 0, atol=1e-3)
    np.testing.assert_allclose(f[3:], [3.261, 5.668, 11.136, 11.136, 12.849], rtol=2.5e-3)


def test_fv4_cantilever_with_masses_off_its_axis(tmp_path):
    text = line(20, "B33", (10.0, 0.0, 0.0)) + "*NODE\n101, 10, 2\n102, 10, -2\n" + STEEL
    text += (
        "*BEAM SECTION, ELSET=BAR, MATERIAL=STEEL, SECTION=CIRC\n.25\n*MPC\nBEAM, 101, 21\nBEAM, 102, 21\n"
    )
    text += "*ELEMENT, TYPE=MASS, ELSET=M1\n91, 101\n*ELEMENT, TYPE=MASS, ELSET=M2\n92, 102\n"
    text += "*MASS, ELSET=M1\n10000\n*MASS, ELSET=M2\n1000\n*BOUNDARY\n1, ENCASTRE\n"
    f = frequencies(tmp_path, text, 6)
    np.testing.assert_allclose(f, [1.723, 1.727, 7.413, 9.972, 18.155, 26.957], rtol=2e-3)


def test_fv5_deep_beam(tmp_path):
    text = line(40, "B31", (10.0, 0.0, 0.0)) + STEEL
    text += "*BEAM SECTION, ELSET=BAR, MATERIAL=STEEL, SECTION=RECT\n2, 2\n*BOUNDARY\n1, 1, 4\n41, 2, 3\n"
    f = frequencies(tmp_path, text, 9)
    published = [42.649, 42.649, 71.20, 125.0, 148.31, 148.31, 213.61, 284.55, 284.55]
    np.testing.assert_allclose(f[[2, 3, 6]], np.array(published)[[2, 3, 6]], rtol=2.5e-3)  # no shear
    # k of 0.87 instead of 5/6 raises the third pair by half a per cent
    np.testing.assert_allclose(f, published, rtol=6e-3)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(
    ("axis", "n1", "diagonal"),
    [
        ((1, 0, 0), (0, 1, 0), (250, 18, 12, 0.24, 4, 6)),
        ((1, 0, 0), (0, 0, 1), (250, 12, 18, 0.24, 6, 4)),
        ((0, 1, 0), (1, 0, 0), (18, 250, 12, 4, 0.24, 6)),
        ((0, 1, 0), (0, 0, 1), (12, 250, 18, 6, 0.24, 4)),
        ((0, 0, 1), (1, 0, 0), (18, 12, 250, 4, 6, 0.24)),
        ((0, 0, 1), (0, 1, 0), (12, 18, 250, 6, 4, 0.24)),
    ],
)
def test_stiffness_of_abaqus_b33(tmp_path, axis, n1, diagonal, sign):
    """Stiffness that Abaqus wrote for this element (tests of FEMBeam.jl), its inner nodes condensed."""
    x, y = (", ".join(map(str, v)) for v in (axis, [sign * c for c in n1]))
    text = f"*NODE\n1, 0, 0, 0\n2, {x}\n*ELEMENT, TYPE=B33, ELSET=E\n1, 1, 2\n"
    text += "*BEAM GENERAL SECTION, ELSET=E, DENSITY=100., SECTION=GENERAL\n2.5e-2, 1e-4, 0., 1.5e-4, 3e-5\n"
    K = assemble(model_of(deck_of(tmp_path, text + f"{y}\n1e4, 8e3\n"))).K.toarray()
    np.testing.assert_allclose(np.diag(K), diagonal * 2, rtol=1e-12)


# CalculiX -----------------------------------------------------------------------------------------------

ALUMINIUM = "*MATERIAL, NAME=AL\n*ELASTIC\n7e10, 0.\n*DENSITY\n2700\n"
"""With ν = 0, as CalculiX' clamped ends otherwise are stiffer by an element's length."""

FREQUENCY = "*STEP\n*FREQUENCY\n6\n*END STEP\n"


def chain(points, n, first=1):
    """Return nodes and B32R elements, n for each leg between points."""
    legs = [np.linspace(a, b, 2 * n + 1)[1:] for a, b in itertools.pairwise(points)]
    places = np.concatenate([[points[0]], *legs])
    rows = [f"{k}, {x!r}, {y!r}, {z!r}" for k, (x, y, z) in enumerate(places.tolist(), first)]
    bars = [f"{k}, {k}, {k + 1}, {k + 2}" for k in range(first, first + len(rows) - 2, 2)]
    return "\n".join(["*NODE", *rows, f"*ELEMENT, TYPE=B32R, ELSET=B{first}", *bars, ""])


def section(first, size, n1="0, 0, -1"):
    return f"*BEAM SECTION, ELSET=B{first}, MATERIAL=AL, SECTION=RECT\n{size}\n{n1}\n"


STRAIGHT = chain([(0.0, 0, 0), (1.0, 0, 0)], 10)
MASS = "*ELEMENT, TYPE=MASS, ELSET=M\n500, 21\n*MASS, ELSET=M\n0.7\n"
SPRINGS = (
    "*NODE\n900, 1., .5, 0.\n*ELEMENT, TYPE=SPRINGA, ELSET=SA\n600, 21, 900\n*SPRING, ELSET=SA\n\n20000.\n"
    "*ELEMENT, TYPE=SPRING1, ELSET=S1\n601, 21\n*SPRING, ELSET=S1\n3\n8000.\n"
)
FLAT, SLIM = section(1, ".02, .03"), section(1, ".01, .015")
CLAMPED = "*BOUNDARY\n1, 1, 6\n"
BESIDE = chain([(0.0, 0.2, 0), (1.0, 0.2, 0)], 10, 101)
IN_SPACE = chain([(0.0, 0, 0), (0.0, 0, 1), (0.8, 0, 1), (0.8, 0.6, 1)], 8)
BENT = chain([(0.0, 0, 0), (1.0, 0, 0), (1.0, 0.6, 0)], 8)
SKEW = "*NSET, NSET=END\n33\n*TRANSFORM, NSET=END\n1., 1., 0., -1., 1., 0.\n"
LEVER = "*EQUATION\n2\n21, 3, 1., 121, 3, -.5\n"
DECKS = {
    "cantilever": STRAIGHT + ALUMINIUM + FLAT + CLAMPED,
    "mass and springs": STRAIGHT + MASS + SPRINGS + ALUMINIUM + FLAT + CLAMPED + "900, 1, 3\n",
    "equation": STRAIGHT
    + BESIDE
    + ALUMINIUM
    + FLAT
    + section(101, ".02, .015")
    + CLAMPED
    + "101, 1, 6\n"
    + LEVER,
    "frame in space": IN_SPACE + ALUMINIUM + section(1, ".01, .015", ".3, 1, .2") + CLAMPED,
    "skew support": BENT + ALUMINIUM + SLIM + SKEW + CLAMPED + "33, 1\n",
}


def with_torsion_of_one_element(deck):
    """Return a deck whose J is that of a section which warps as y z: 4 Iy Iz / (Iy + Iz).

    CalculiX expands a bar to one quadratic solid over its section, whose warping is hardly more than that.
    """
    properties = []
    for p in deck.properties:
        s = p.section
        properties.append(replace(p, section=replace(s, J=4 * s.Iy * s.Iz / (s.Iy + s.Iz))))
    return replace(deck, properties=tuple(properties))


@pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX (ccx) is not installed")
@pytest.mark.parametrize("name", DECKS)
def test_calculix(tmp_path, name):
    deck = with_torsion_of_one_element(deck_of(tmp_path, DECKS[name] + FREQUENCY))
    subprocess.run(["ccx", "a"], cwd=tmp_path, capture_output=True, check=True)
    rows = [row.split() for row in (tmp_path / "a.dat").read_text().splitlines()]
    theirs = [float(row[3]) for row in rows if len(row) == 5 and row[0].isdigit()][:6]
    ours = solve_modes(assemble(model_of(deck)), 6).frequency
    np.testing.assert_allclose(ours[:4], theirs[:4], rtol=1e-3)
    np.testing.assert_allclose(ours, theirs, rtol=3e-3)  # B32R elements are too stiff in higher modes
