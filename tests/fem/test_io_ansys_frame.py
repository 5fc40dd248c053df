"""Archives of ANSYS: formats, axes, sections, masses, springs, constraints, and what is refused."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fem import MeshError, MeshWarning, assemble, solve_modes
from fem.io import Body, FrameDeck, model_of, read_deck, read_mesh
from fem.io.ansys_deck import read_deck as read_commands

STEEL = "MP,EX,1,2.1E11\nMP,DENS,1,7850\nMP,PRXY,1,0.3\n"
E, RHO = 2.1e11, 7850.0


def deck(tmp_path: Path, text: str, units="SI") -> FrameDeck:
    path = tmp_path / "a.cdb"
    path.write_text(text)
    return read_deck(path, units)


def frequencies(frame: FrameDeck, n: int) -> np.ndarray:
    return solve_modes(assemble(model_of(frame)), n).frequency


def cantilever(section: str, n: int = 8, length: float = 2.0, more: str = "", third: str = "") -> str:
    nodes = "".join(f"N,{k + 1},{k * length / n!r}\n" for k in range(n + 1))
    bars = "".join(f"EN,{k + 1},{k + 1},{k + 2}{third}\n" for k in range(n))
    return f"ET,1,188,,,3\n{STEEL}{section}{nodes}{more}{bars}D,1,ALL\n"


def bending(I: float, A: float, length: float = 2.0) -> float:
    return 1.8751040687**2 / (2 * np.pi * length**2) * np.sqrt(E * I / (RHO * A))


BLOCKED = """/COM,ANSYS RELEASE 19.5
/PREP7
/NOPR
/UNITS,SI
*IF,_CDRDOFF,EQ,1,THEN
NUMOFF,NODE, 3
*ENDIF
*SET,TEMPERATURE,'TEMP '
ETBLOCK,        1,        1
(2i9,19a9)
        1      188        0        0        3
       -1
NBLOCK,6,SOLID,         3,         3
(3i9,6e21.13e3)
        1        0        0
        2        0        0 1.0000000000000E+000
        3        0        0 2.0000000000000E+000
N,R5.3,LOC,       -1,
EBLOCK,19,SOLID,         2,         2
(19i8)
       1       1       1       3       0       0       0       0       2       0       1       1       2
       1       1       1       3       0       0       0       0       2       0       2       2       3
       -1
CMBLOCK,BEAM,ELEM,       2  ! a component
(8i10)
         1        -2
SECTYPE,       3,BEAM,RECT,plate   ,       0
SECOFFSET,CENT
SECDATA,0.02,0.05,2,2
MPTEMP,R5.0, 1, 1,  0.00000000    ,
MPDATA,R5.0, 1,EX  ,       1, 1, 2.100000000E+11,
MPDATA,R5.0, 1,NUXY,       1, 1, 0.300000000    ,
MPDATA,R5.0, 1,DENS,       1, 1,  7850.00000    ,
D,       1,UX  ,  0.000000000    ,  0.000000000
D,       1,UY  ,  0.000000000    ,  0.000000000
D,       1,UZ  ,  0.000000000    ,  0.000000000
D,       1,ROTX,  0.000000000    ,  0.000000000
D,       1,ROTY,  0.000000000    ,  0.000000000
D,       1,ROTZ,  0.000000000    ,  0.000000000
BETAD,  1.0E-5
FINISH
"""
UNBLOCKED = """/PREP7
ET,1,BEAM188
KEYOPT,1,3,3
N,R5.3,LOC,1,0,0,0.0,0.0,0.0
N,R5.3,LOC,2,0,0,1.0,0.0,0.0
N,R5.3,LOC,3,0,0,2.0,0.0,0.0
N,R5.3,LOC,-1
EN,R5.5,ATTR,2,1,1,1,3,0,1,0,0,0
EN,R5.5,NODE,1,2
EN,R5.5,ATTR,2,1,1,1,3,0,2,0,0,0
EN,R5.5,NODE,2,3
SECT,3,BEAM,RECT
SECD,0.02,0.05
MP,EX,1,2.1E11
MP,DENS,1,7850
MP,PRXY,1,0.3
D,1,ALL
BETAD,1E-5
"""


# Formats ----------------------------------------------------------------------------------------------------


def test_blocked_and_unblocked_archives_are_the_same(tmp_path: Path):
    a, b = deck(tmp_path, BLOCKED), deck(tmp_path, UNBLOCKED)
    assert a.properties[0].name == "BEAM"
    assert b.properties[0].name == "section 3"
    assert a.damping is not None
    assert a.damping.beta == 1e-5
    np.testing.assert_array_equal(a.points, b.points)
    np.testing.assert_allclose(frequencies(a, 4), frequencies(b, 4), rtol=1e-12)
    assert a.supports == b.supports == {0: ("x", "y", "z", "rx", "ry", "rz")}


@pytest.mark.parametrize("form", ["(3i8,6e16.9)", "(3i9,6e20.13)", "(1i7,2i9,6e21.13)", "(3i9,6e21.13e3)"])
def test_nodes_are_cut_as_the_format_says(tmp_path: Path, form: str):
    counts = [(int(c), int(w)) for c, w in (p.split("i") for p in form[1:-1].split(",")[:-1])]
    width, digits = (int(v) for v in form.split("6e")[1].rstrip(")").split("e")[0].split("."))
    whole = [w for c, w in counts for _ in range(c)]
    numbers = "".join(f"{v:{w}d}" for v, w in zip((12, 0, 0), whole, strict=True))
    reals = "".join(f"{v:{width}.{digits - 3}E}" for v in (-1.25, 2.5e-3, -7.0))
    path = tmp_path / "a.cdb"
    path.write_text(f"NBLOCK,6,SOLID,12,1\n{form}\n{numbers}{reals}\nN,R5.3,LOC,-1,\n")
    assert read_commands(path).nodes == {12: [-1.25, 2.5e-3, -7.0, 0.0, 0.0, 0.0]}


def test_real_constants_of_blocks_and_commands(tmp_path: Path):
    path = tmp_path / "a.cdb"
    path.write_text(
        "RLBLOCK,       1,       2,       9,       7\n(2i8,6g16.9)\n(7g16.9)\n"
        "       2       9  1.00000000     0.566900000E-07  3.0             4.0             5.0            "
        " 6.0\n  7.0             8.0             9.0\n"
        "R,3,1,2,3,4,5,6\nRMORE,7,8\nRMODIF,3,2,20\n"
    )
    reals = read_commands(path).reals
    assert reals[2] == {1: 1.0, 2: 5.669e-8, 3: 3.0, 4: 4.0, 5: 5.0, 6: 6.0, 7: 7.0, 8: 8.0, 9: 9.0}
    assert reals[3] == {1: 1.0, 2: 20.0, 3: 3.0, 4: 4.0, 5: 5.0, 6: 6.0, 7: 7.0, 8: 8.0}


def test_a_mesh_has_components_as_sets(tmp_path: Path):
    path = tmp_path / "a.cdb"
    path.write_text(BLOCKED + "CMBLOCK,TIP,NODE,       1\n(8i10)\n         3\n")
    mesh = read_mesh(path)
    assert list(mesh.members) == ["BEAM"]
    assert mesh.n_lines == 2
    assert dict(mesh.point_names) == {"TIP": 2}


# Axes and sections ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("end", "z"),
    [
        ((1, 0, 0), (0, 0, 1)),
        ((-1, 0, 0), (0, 0, 1)),
        ((0, 2, 0), (0, 0, 1)),
        ((0, 0, 1), (-1, 0, 0)),  # y is global Y, and z = x × y
        ((1, 0, 1), (-(0.5**0.5), 0, 0.5**0.5)),
    ],
)
def test_default_orientation(tmp_path: Path, end, z):
    x, y, w = end
    text = f"ET,1,188\n{STEEL}SECT,1,BEAM,RECT\nSECD,1,2\nN,1\nN,2,{x},{y},{w}\nEN,1,1,2\nD,1,ALL\n"
    np.testing.assert_allclose(deck(tmp_path, text).bars.height, [z], atol=1e-15)


def test_height_is_towards_the_orientation_node(tmp_path: Path):
    """RECT 0.02 x 0.05: the height of 0.05 is along y here, so that bending in x-y is the stiffer one."""
    text = cantilever("SECT,1,BEAM,RECT\nSECD,0.02,0.05\n", more="N,99,0,3\n", third=",99")
    made = deck(tmp_path, text)
    np.testing.assert_array_equal(made.bars.height, [[0, 1, 0]] * 8)
    modes = solve_modes(assemble(model_of(made)), 2)
    weak, stiff = bending(0.05 * 0.02**3 / 12, 1e-3), bending(0.02 * 0.05**3 / 12, 1e-3)
    np.testing.assert_allclose(modes.frequency, [weak, stiff], rtol=2e-3)  # shear: 1.4 (h/L)² at most
    tip = np.abs(modes.shapes[-6:-3])  # the softer one moves along z
    assert tip[2, 0] > 100 * tip[1, 0]
    assert tip[1, 1] > 100 * tip[2, 1]


# I, A by hand: strips about the neutral axis
T_Z = (0.1 * 0.01 * 0.005 + 0.09 * 0.01 * 0.055) / (0.1 * 0.01 + 0.09 * 0.01)
T_I = 0.1 * 0.01**3 / 12 + 0.001 * (T_Z - 0.005) ** 2 + 0.01 * 0.09**3 / 12 + 9e-4 * (0.055 - T_Z) ** 2
SECTIONS = [
    ("CSOLID", "0.02", np.pi * 4e-4, np.pi * 0.02**4 / 4, np.pi * 0.02**4 / 4),
    ("CTUBE", "0.04,0.05", np.pi * 9e-4, *[np.pi * (0.05**4 - 0.04**4) / 4] * 2),
    (
        "I",
        "0.1,0.1,0.2,0.01,0.01,0.006",
        2e-3 + 0.18 * 0.006,
        (0.1 * 0.2**3 - 0.094 * 0.18**3) / 12,
        (0.02 * 0.1**3 + 0.18 * 0.006**3) / 12,
    ),
    ("T", "0.1,0.1,0.01,0.01", 1.9e-3, T_I, (0.01 * 0.1**3 + 0.09 * 0.01**3) / 12),
    (
        "HREC",
        "0.1,0.2,0.01,0.01,0.01,0.01",
        0.02 - 0.08 * 0.18,
        (0.1 * 0.2**3 - 0.08 * 0.18**3) / 12,
        (0.2 * 0.1**3 - 0.18 * 0.08**3) / 12,
    ),
    (
        "HREC",
        "0.1,0.2,0.01,0.01,0.02,0.02",
        0.02 - 0.08 * 0.16,
        (0.1 * 0.2**3 - 0.08 * 0.16**3) / 12,
        (0.2 * 0.1**3 - 0.16 * 0.08**3) / 12,
    ),
    ("CHAN", "0.1,0.1,0.2,0.01,0.01,0.006", 2e-3 + 0.18 * 0.006, (0.1 * 0.2**3 - 0.094 * 0.18**3) / 12, None),
    ("ASEC", "2e-3,3e-6,0,1e-6,0,5e-7", 2e-3, 3e-6, 1e-6),
]


@pytest.mark.parametrize(
    ("shape", "data", "A", "Iy", "Iz"), SECTIONS, ids=[f"{s[0]} {s[1]}" for s in SECTIONS]
)
def test_sections(tmp_path: Path, shape: str, data: str, A: float, Iy: float, Iz: float | None):
    section = deck(tmp_path, cantilever(f"SECT,1,BEAM,{shape}\nSECD,{data}\n")).properties[0].section
    assert pytest.approx(A, rel=1e-12) == section.A
    assert section.Iy == pytest.approx(Iy, rel=1e-12)
    assert Iz is None or section.Iz == pytest.approx(Iz, rel=1e-12)


def test_unlike_walls_equal_the_shapes_when_they_are_alike(tmp_path: Path):
    """A channel whose flanges differ by 1e-9 is made by another way than one of equal flanges."""
    pair = []
    for b in ("0.1", "0.100000000001"):
        text = cantilever(f"SECT,1,BEAM,CHAN\nSECD,0.1,{b},0.2,0.01,0.01,0.006\n")
        pair.append(deck(tmp_path, text).properties[0].section)
    for key, close in (("A", 1e-9), ("Iy", 1e-9), ("Iz", 1e-9), ("kz", 1e-6), ("J", 0.05)):
        assert getattr(pair[1], key) == pytest.approx(getattr(pair[0], key), rel=close)


@pytest.mark.parametrize(
    ("shape", "offset", "expected"),
    [
        ("RECT\nSECD,0.02,0.05", "USER,0.01,-0.02", (-0.01, 0.02)),
        ("RECT\nSECD,0.02,0.05", "CENT", (0, 0)),
        ("I\nSECD,0.1,0.1,0.2,0.01,0.01,0.006", "ORIGIN", (0, 0.1)),
        ("T\nSECD,0.1,0.1,0.01,0.01", "ORIGIN", (0, T_Z)),
        ("HREC\nSECD,0.1,0.2,0.01,0.01,0.01,0.01", "USER,0.1,0", (-0.05, 0.1)),
        # the published eccentricity of VM14's column, in inches: its load is at the back of the web
        ("CHAN\nSECD,2.26,2.26,8,0.39,0.39,0.22", "USER,0,4", (0.6465, 0)),
    ],
)
def test_section_offsets(tmp_path: Path, shape: str, offset: str, expected):
    made = deck(tmp_path, cantilever(f"SECT,1,BEAM,{shape}\nSECO,{offset}\n", n=1))
    np.testing.assert_allclose(
        made.bars.offsets[0, :, 1:], [expected] * 2, atol=6e-5 if shape[0] == "C" else 1e-14
    )


def test_flange_of_a_tee_is_at_minus_z(tmp_path: Path):
    """VM10: the flange is the bottom, with the stress 300 of 300 and 700 psi, at 6 of 20 in."""
    section = deck(tmp_path, cantilever("SECT,1,BEAM,T\nSECD,9,20,4,1.5\n")).properties[0].section
    c, s = np.cos(section.angle), np.sin(section.angle)
    z = section.outlines[0] @ np.array([s, c])
    assert z.min() == pytest.approx(-6)
    assert z.max() == pytest.approx(14)


def test_shear_stiffness_and_mass_of_seccontrol(tmp_path: Path):
    G = E / 2.6
    text = cantilever(f"SECT,1,BEAM,RECT\nSECD,0.02,0.05\nSECCONTROL,{0.5 * G * 1e-3!r},,2e20,3.5\n")
    bar = deck(tmp_path, text).properties[0]
    assert bar.section.kz == pytest.approx(0.5)
    assert bar.section.ky == 0.0
    assert bar.mass_per_length == 3.5


def test_tapers_are_cut_by_their_stations(tmp_path: Path):
    taper = "SECT,1,BEAM,RECT\nSECD,0.02,0.06\nSECT,2,BEAM,RECT\nSECD,0.02,0.02\n"
    taper += "SECT,3,TAPER\nSECD,1,0,0,0\nSECD,2,2,0,0\nSECNUM,3\n"
    made = deck(tmp_path, cantilever(taper, n=4))
    heights = [(p.section.dimensions["h"], p.section2.dimensions["h"]) for p in made.properties if p.section2]
    np.testing.assert_allclose(heights, [(0.06, 0.05), (0.05, 0.04), (0.04, 0.03), (0.03, 0.02)])


# Real constants, links, springs, masses ---------------------------------------------------------------------


def test_beam4_by_real_constants(tmp_path: Path):
    """IZZ bends in x-y; with THETA = 90° that is the plane x-z."""
    reals = "R,1,1e-3,4e-8,1e-8,.02,.05,90\nRMORE,,3e-8,1.2,1.5,,2.5\n"
    text = f"ET,1,BEAM4\n{STEEL}{reals}N,1\nN,2,1\nEN,1,1,2\nD,1,ALL\n"
    made = deck(tmp_path, text)
    bar = made.properties[0]
    assert (bar.section.Iz, bar.section.Iy, bar.section.J) == (4e-8, 1e-8, 3e-8)
    assert (bar.section.ky, bar.section.kz) == (1 / 1.2, 1 / 1.5)
    assert bar.mass_per_length == 2.5
    np.testing.assert_allclose(made.bars.height, [[0, -1, 0]], atol=1e-15)


def test_beam3_is_held_in_its_plane(tmp_path: Path):
    text = f"ET,1,3\n{STEEL}R,1,1e-3,4e-8,.05\n" + "".join(f"N,{k + 1},{k / 4!r}\n" for k in range(9))
    text += "".join(f"EN,{k + 1},{k + 1},{k + 2}\n" for k in range(8)) + "D,1,ALL\n"
    made = deck(tmp_path, text)
    assert made.supports[8] == ("z", "rx", "ry")
    np.testing.assert_allclose(frequencies(made, 1), bending(4e-8, 1e-3), rtol=1e-3)


def test_hinge_of_beam44(tmp_path: Path):
    text = f"ET,1,44\nKEYOPT,1,8,11\n{STEEL}R,1,1e-3,4e-8,1e-8,,,3e-8\nN,1\nN,2,1\nEN,1,1,2\nD,1,ALL\n"
    np.testing.assert_array_equal(deck(tmp_path, text).bars.stiffness[0, 1, 3:], [np.inf, 0, 0])


def test_a_link_is_a_spring(tmp_path: Path):
    """Two collinear links and a mass between them: f = √(2 E A / L / m) / 2π."""
    text = f"ET,1,LINK180\n{STEEL}MP,DENS,1,1e-3\nR,1,1e-4\nN,1\nN,2,1\nN,3,2\nEN,1,1,2\nEN,2,2,3\n"
    text += "ET,2,21,,,2\nR,2,50\nTYPE,2\nREAL,2\nEN,3,2\nD,1,ALL\nD,3,ALL\nD,2,UY,,,,,UZ\n"
    made = deck(tmp_path, text)
    assert made.properties[0].theory == "bar"
    assert made.supports[1] == ("y", "z", "rx", "ry", "rz")
    np.testing.assert_allclose(frequencies(made, 1), np.sqrt(2 * E * 1e-4 / 50) / (2 * np.pi), rtol=1e-8)


FRAME = cantilever("SECT,1,BEAM,RECT\nSECD,0.02,0.05\n", n=2)


def test_springs_and_masses_in_the_units_of_the_deck(tmp_path: Path):
    more = "ET,2,14,,5\nR,2,2000,3\nN,20,2000\nTYPE,2\nREAL,2\nEN,20,3,20\nD,20,ALL\n"
    more += "ET,3,21\nR,3,.004,.004,.004,1,2,3\nTYPE,3\nREAL,3\nEN,21,3\n"
    made = deck(tmp_path, cantilever("SECT,1,BEAM,RECT\nSECD,20,50\n", n=2, length=2000) + more, "mm-t-s")
    spring, body = made.connections[0], made.bodies[0]
    assert spring.K[4, 4] == pytest.approx(2.0)
    assert spring.C[4, 4] == pytest.approx(3e-3)
    assert body.mass == 4.0
    np.testing.assert_allclose(np.diag(body.inertia), [1e-3, 2e-3, 3e-3])  # t·mm² → kg·m²


def test_spring_along_its_line(tmp_path: Path):
    made = deck(tmp_path, FRAME + "ET,2,14\nR,2,7\nN,20,3,1\nTYPE,2\nREAL,2\nEN,20,3,20\nD,20,ALL\n")
    spring = made.connections[0]
    np.testing.assert_allclose(spring.axes[0], [0.5**0.5, 0.5**0.5, 0])
    assert spring.K[0, 0] == 7
    assert np.count_nonzero(spring.K) == 1


# Supports and constraints -----------------------------------------------------------------------------------


def test_skew_supports(tmp_path: Path):
    """A roller at 30°: the node may move along its rotated x only."""
    text = FRAME.replace("N,3,2.0", "N,3,2.0,0,0,30") + "D,3,UY\n"
    made = deck(tmp_path, text)
    skew = made.connections[0]
    assert skew.nodes == (2, None)
    assert skew.rigid == ("y",)
    np.testing.assert_allclose(skew.axes[1], [-0.5, 0.75**0.5, 0])


def test_right_angles_are_supports(tmp_path: Path):
    made = deck(tmp_path, FRAME.replace("N,3,2.0", "N,3,2.0,0,0,90") + "D,3,UY\n")
    assert made.supports[2] == ("x",)
    assert not made.connections


def test_equations_of_blocked_archives(tmp_path: Path):
    more = "CE,R5.0,DEFI,       2,       1,  0.00000000\n"
    more += "CE,R5.0,NODE,       3,UY  ,  1.00000000    ,       2,ROTZ, -500.000000\nCP,2,ROTX,2,3\n"
    made = deck(tmp_path, cantilever("SECT,1,BEAM,RECT\nSECD,20,50\n", n=2, length=2000) + more, "mm-t-s")
    assert made.equations[0].terms == ((2, "y", 1.0), (1, "rz", -0.5))  # the arm is in metres
    assert made.equations[1].terms == ((1, "rx", 1.0), (2, "rx", -1.0))


def test_equations_are_in_axes_of_their_nodes(tmp_path: Path):
    made = deck(tmp_path, FRAME.replace("N,3,2.0", "N,3,2.0,0,0,90") + "CE,1,0,3,UX,1,2,UY,-2\n")
    assert [(n, d) for n, d, _ in made.equations[0].terms] == [(2, "y"), (1, "y")]
    np.testing.assert_allclose([c for *_, c in made.equations[0].terms], [1, -2])


def test_rigid_beams_are_one_body(tmp_path: Path):
    more = "ET,2,184,1\nN,21,2,0.5\nN,22,2,1\nTYPE,2\nEN,21,3,21\nEN,22,21,22\n"
    more += "ET,3,21,,,2\nR,3,5\nTYPE,3\nREAL,3\nEN,23,22\n"
    made = deck(tmp_path, FRAME + more)
    (link,) = made.links
    assert link.node == 2
    assert sorted(link.dependents) == [3, 4]
    arm = np.array([0.0, 1.0, 0.0])
    by_hand = replace(deck(tmp_path, FRAME), bodies=(Body(name="mass", node=2, mass=5.0, arm=arm),))
    np.testing.assert_allclose(frequencies(made, 4), frequencies(by_hand, 4), rtol=1e-9)


def test_global_damping(tmp_path: Path):
    made = deck(tmp_path, FRAME + "ALPHAD,0.4\nBETAD,2e-5\nDMPRAT,0.01\nDMPSTR,0.02\n")
    d = made.damping
    assert d is not None
    assert (d.alpha, d.beta, d.ratio[0], d.loss_factor) == (0.4, 2e-5, 0.01, 0.02)


# What is refused --------------------------------------------------------------------------------------------

SECOND = next(row for row in BLOCKED.splitlines(keepends=True) if row.endswith("       2       2       3\n"))
BAD = [
    (FRAME.replace("SECT,1", "SECT,7"), "line 10: element 1 has the section 1, which no SECTYPE defines"),
    (FRAME.replace("MP,EX,1", "MP,EX,4"), "line 10: element 1: its material 1 has no EX"),
    (FRAME.replace("ET,1,188", "ET,1,999"), "no beams, pipes or links"),
    (FRAME.replace("ET,1,188", "ET,5,188"), "element 1 has the type 1, which no ET defines"),
    (FRAME.replace("N,3,2.0\n", ""), "element 2 refers to node 3, which is not defined"),
    (FRAME.replace("SECD,0.02,0.05", "SECD,0.02"), "SECDATA of RECT needs 2 numbers, found 1"),
    (FRAME.replace("RECT", "MESH"), "BEAM,MESH with 2 data is not read"),
    (FRAME.replace("2.1E11", "YOUNG"), "MP, field 3: 'YOUNG' is not a number"),
    (FRAME + "FILL,1,3\n", "FILL generates or changes parts of the model"),
    (FRAME + "/UNITS,MPA\n", "the units given are"),
    (FRAME + "ET,2,181\nTYPE,2\nEN,9,1,2,3\n", "element 9 of type 181 shares nodes with the frame"),
    (FRAME + "ET,2,184,6\nTYPE,2\nEN,9,1,2\n", "MPC184 with KEYOPT(1) = 6 is not read"),
    (FRAME + "ET,2,21\nTYPE,2\nEN,9,3\nREAL,8\n", "MASS21 has the masses|real constants 1, which no R"),
    (FRAME + "ET,2,21\nR,1,5\nTYPE,2\nEN,9,3\n", "those of free directions must be equal"),
    (FRAME + "CE,1,0,44,UX,1,2,UX,-1\n", "CE 1 refers to node 44, which is not defined"),
    (FRAME + "CE,1,0,3,TEMP,1,2,UX,-1\n", "the label 'TEMP' is none of UX"),
    (BLOCKED.replace(",         3\n(3i9", ",         4\n(3i9"), "NBLOCK states 4 rows, and has 3"),
    (BLOCKED[: BLOCKED.index(SECOND)], "EBLOCK has no end: the file ends after 1 of its rows"),
    (BLOCKED.replace("(19i8)\n", ""), "EBLOCK needs a format such as (19i9)"),
    (BLOCKED.replace(SECOND, SECOND[:-9] + "\n"), "EBLOCK ends within an element: 1 of its nodes"),
    (BLOCKED.replace("         1        -2\n", ""), "CMBLOCK ends after 0 rows of 1 at 'SECTYPE"),
]


@pytest.mark.parametrize(("text", "words"), BAD, ids=[words[:50] for _, words in BAD])
def test_bad_archives_say_file_line_and_command(tmp_path: Path, text: str, words: str):
    with pytest.raises(MeshError) as caught:
        deck(tmp_path, text)
    message = str(caught.value)
    assert message.startswith("a.cdb: line ")
    assert "\n" not in message
    assert any(w in message for w in words.split("|")), message


def test_shells_apart_are_named(tmp_path: Path):
    more = "ET,2,181\nTYPE,2\nN,31,9\nN,32,9,1\nN,33,9,1,1\nEN,9,31,32,33\nF,3,FY,10\n"
    notes = " ".join(deck(tmp_path, FRAME + more).notes)
    assert "1 elements of type 181 left out" in notes
    assert "loads are left out: F" in notes


def test_a_mesh_names_elements_that_are_no_lines(tmp_path: Path):
    path = tmp_path / "a.cdb"
    path.write_text(FRAME + "ET,2,181\nTYPE,2\nEN,9,1,2,3\n")
    with pytest.warns(MeshWarning, match="1 elements of type 181 left out"):
        assert list(read_mesh(path).members) == ["section 1"]


def test_a_second_definition_takes_the_place_of_the_first(tmp_path):
    frame = deck(
        tmp_path,
        f"ET,1,188\n{STEEL}SECTYPE,1,BEAM,RECT\nSECDATA,0.02,0.03\n"
        "N,1,0,0,0\nN,2,1,0,0\nN,3,2,0,0\nN,4,3,0,0\nEN,1,1,2\nEN,2,2,3\nEN,3,3,4\nD,1,ALL,0\nD,3,ALL,0\n"
        "CE,1,0,2,UX,1,3,UX,-1\nMPDATA,EX,1,1,1.9E11\nMP,EX,2,1E11\nMP,PRXY,2,0.3\nMP,DENS,2,2700\n"
        "MAT,2\nEN,2,2,3\nEDELE,3\nDDELE,1,ROTY\nDDELE,3,ALL\nCEDELE,1\n",
    )
    assert frame.bars.numbers.tolist() == [1, 2]
    assert [p.material.E for p in frame.properties] == [1.9e11, 1e11]
    assert {n: fixed for n, fixed in frame.supports.items() if fixed} == {0: ("x", "y", "z", "rx", "rz")}
    assert not frame.equations
