"""Frequencies of the ANSYS verification manual, from archives of the same models.

The manual's targets are closed forms of textbooks. What remains is the theory (shear and rotary inertia,
which some leave out) and their three to five digits. The rod and the pipe have 100 elements here, and 11 and
12 in the manual: linear elements err by (k h)² / 24 in frequency.
"""

from pathlib import Path

import numpy as np
import pytest

from fem import assemble, solve_modes
from fem.io import model_of, read_deck

# lbf, in, s; lbf, ft, s
INCH, FOOT = (0.0254, 175.126835, 1.0), (0.3048, 14.593903, 1.0)

SPECTATOR = """
ET,9,188
SECTYPE,9,BEAM,CSOLID
SECDATA,0.1
MP,EX,9,1E7
MP,NUXY,9,0.3
MP,DENS,9,1E-3
N,901,0,0,50
N,902,1,0,50
TYPE,9
MAT,9
SECNUM,9
EN,901,901,902
D,901,ALL
D,902,ALL
"""
"""A bar held at both ends, for models without one: a frame needs a member."""

SPRING_AND_MASS = """
ET,1,COMBIN14,,,2
ET,2,MASS21,,,4
R,1,48
R,2,.006477
N,1
N,2,,1
TYPE,1
REAL,1
EN,1,1,2
TYPE,2
REAL,2
EN,2,2
D,1,ALL
D,2,UX
"""
DISK = """
ET,1,COMBIN14,,,1
ET,2,MASS21,,,3
R,1,4.8
R,2,1,.30312
N,1
N,2,,,-1
TYPE,1
REAL,1
EN,1,1,2
TYPE,2
REAL,2
EN,2,2
D,1,ALL
D,2,UX,,,,,UY
"""
MOTOR = """
ET,1,BEAM188
SECTYPE,1,BEAM,CSOLID
SECDATA,0.1875,20
ET,2,MASS21
R,2,,,,31E-3
MP,EX,1,31.2E6
MP,PRXY,1,0.3
N,1
N,2,8
EN,1,1,2
TYPE,2
REAL,2
EN,2,2
D,1,ALL
D,2,UX,,,,,UY,UZ,ROTY,ROTZ
"""
TWO_MASSES = """
ET,1,COMBIN14,,,2
ET,2,MASS21,,,4
R,1,200
R,2,800
R,3,.5
R,4,1
N,1
N,2,0.3333333333
N,3,0.6666666667
N,4,1
TYPE,1
REAL,1
EN,1,1,2
EN,2,3,4
REAL,2
EN,3,2,3
TYPE,2
REAL,3
EN,4,2
REAL,4
EN,5,3
D,1,UY,,,4
D,1,UX,,,4,3
"""
CAR = """
ET,1,BEAM188
KEYOPT,1,3,3
ET,2,COMBIN14,,,2
ET,3,MASS21,,,3
R,1,2400
R,2,100,1600
R,3,2600
SECT,2,BEAM,RECT
SECD,1,1
MP,EX,1,4E9
MP,PRXY,1,0.3
N,1
N,2,,1
N,3,4.5,1
N,4,10,1
N,5,10
TYPE,2
REAL,1
EN,1,1,2
REAL,3
EN,2,4,5
TYPE,1
SECN,2
EN,3,2,3
EN,4,3,4
TYPE,3
REAL,2
EN,5,3
D,1,UX,,,5,4,UY
D,3,UX
D,2,UZ,,,4,1,ROTY,ROTX
"""


def line_of(n: int, step: tuple[float, float, float], mid: bool = False) -> str:
    """Return nodes on a line and elements between them, of three nodes each with ``mid``."""
    last = 2 * n if mid else n
    nodes = "".join(f"N,{k + 1},{','.join(repr(k * s) for s in step)}\n" for k in range(last + 1))
    if mid:
        return nodes + "".join(f"EN,{k + 1},{2 * k + 1},{2 * k + 3},{2 * k + 2}\n" for k in range(n))
    return nodes + "".join(f"EN,{k + 1},{k + 1},{k + 2}\n" for k in range(n))


def simple_beam(section: str, material: str, length: float, n: int) -> str:
    """Return a simply supported beam of BEAM189 in a plane."""
    return f"""
ET,1,BEAM189
{material}SECTYPE,1,BEAM,ASEC
SECDATA,{section}
{line_of(n, (length / (2 * n), 0.0, 0.0), mid=True)}
D,ALL,UZ,,,,,ROTY,ROTX
D,1,UX,,,,,UY
D,{2 * n + 1},UY
"""


DEEP = f"""
ET,1,BEAM188
KEYOPT,1,3,3
MP,EX,1,200E9
MP,NUXY,1,0.3
MP,DENS,1,8000
SECT,1,BEAM,RECT
SECD,2,2
{line_of(10, (1.0, 0.0, 0.0))}
D,1,UX,0,0,,,UY,UZ,ROTX
D,11,UY,0,0,,,UZ
"""
ROD = f"""
ET,1,BEAM188
SECT,1,BEAM,ASEC
SECD,1,1,,1,,1
MP,EX,1,3E7
MP,PRXY,1,0.3
MP,DENS,1,73E-5
{line_of(100, (8.0, 0.0, 0.0))}
D,ALL,UY,,,,,ROTZ,UZ,ROTY,ROTX
"""


def drill_pipe(types: str, section: str) -> str:
    """Return the drill pipe with its collar: a tube of 5000 ft and a rotary inertia."""
    return f"""
{types}ET,2,MASS21
R,2,,,,,,29.3
MP,EX,1,4.4928E9
MP,DENS,1,15.2174
MP,NUXY,1,.3
{section}{line_of(100, (0.0, 0.0, -50.0))}
TYPE,2
REAL,2
EN,101,101
D,1,UX,,,101,,UY,UZ,ROTX,ROTY
D,1,ROTZ
"""


STEEL = "MP,EX,1,30E6\nMP,DENS,1,728E-6\nMP,GXY,1,11538461.5\n"
STEEL70 = "MP,EX,1,30E6\nMP,DENS,1,73E-5\nMP,PRXY,1,0.3\n"
OLD_PIPE = drill_pipe("ET,1,PIPE16\n", "R,1,0.375,0.02791666667\n")
NEW_PIPE = drill_pipe("ET,1,PIPE288,,,2,2\n", "SECTYPE,1,PIPE\nSECDATA,0.375,0.02791666667\n")

VM70 = simple_beam("273.9726,333.3333333,,333.3333333,,1e-6", STEEL70, 240.0, 8)

# name, archive, units, published frequencies [Hz], which modes, deviation found, allowed [-]
CASES = [
    ("VM45", SPRING_AND_MASS + SPECTATOR, INCH, [13.701], [0], 1e-4),
    ("VM47", DISK + SPECTATOR, INCH, [0.63333], [0], 1e-4),
    ("VM48", MOTOR, INCH, [48.781], [0], 1e-4),
    ("VM50", simple_beam("4,1.3333333,,1.3333333,,1e-6", STEEL, 80.0, 4), INCH, [28.766], [0], 1.2e-3),
    ("VM52", CAR, FOOT, [1.0981, 1.4406], [0, 1], 1e-3),
    ("VM57, PIPE16", OLD_PIPE, FOOT, [0.3833, 1.260], [0, 1], 5e-4),
    ("VM57, PIPE288", NEW_PIPE, FOOT, [0.3833, 1.260], [0, 1], 5e-4),
    ("VM61", ROD, INCH, [126.70, 253.40], [1, 2], 5e-4),
    ("VM70", VM70, INCH, [6.0979], [0], 1e-3),
    ("VM89", TWO_MASSES + SPECTATOR, INCH, [2.5814, 8.3263], [0, 1], 1e-4),
    ("VM19", DEEP, "SI", [42.65], [0], 5e-3),
]


@pytest.mark.parametrize(
    ("name", "text", "units", "published", "modes", "allowed"), CASES, ids=[c[0] for c in CASES]
)
def test_frequencies_of_the_verification_manual(tmp_path: Path, name, text, units, published, modes, allowed):
    path = tmp_path / "model.cdb"
    path.write_text(text)
    model = model_of(read_deck(path, units))
    found = solve_modes(assemble(model), max(modes) + 1).frequency[modes]
    deviation = found / published - 1
    assert np.abs(deviation).max() < allowed
