"""ANSYS commands change a state: selections, edits, coordinate systems, parameters, load steps."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fem import MeshError, MeshWarning, assemble, solve_modes
from fem.io import FrameDeck, model_of, read_deck, read_mesh
from fem.io.ansys_deck import read_deck as read_commands

TABLES = """\
/PREP7
ET,1,4
MP,EX,1,2e11
MP,PRXY,1,.25
MP,DENS,1,7800
MP,EX,2,1e11
MP,PRXY,2,.25
MP,DENS,2,7800
R,1,1e-3,4e-7,1e-7,.1,.2,0.
RMORE,0.,2e-7
"""
NODES = "N,1,0,0,0\nN,2,1,0,0\nN,3,2,0,0\n"
ELEMENTS = "TYPE,1\nMAT,1\nREAL,1\nE,1,2\nE,2,3\n"
BEAM = TABLES + NODES + ELEMENTS + "D,1,ALL,0\n"
PAIR = BEAM + "N,4,0,1,0\nN,5,1,1,0\nN,6,2,1,0\nE,4,5\nE,5,6\nD,4,ALL\n"
FREE = (7.087, 14.172, 44.753)
"""Frequencies of the cantilever [Hz]."""
PROPPED = (14.172, 31.347, 89.395)
"""And with UZ of its tip fixed."""


def deck(tmp_path: Path, text: str) -> FrameDeck:
    path = tmp_path / "a.cdb"
    path.write_text(text)
    return read_deck(path)


def frequencies(tmp_path: Path, text: str, n: int = 3) -> np.ndarray:
    return solve_modes(assemble(model_of(deck(tmp_path, text))), n).frequency


def notes(tmp_path: Path, text: str) -> str:
    return " | ".join(deck(tmp_path, text).notes)


COMPONENT = "CMBLOCK,_Tip,NODE,       1\n(8i10)\n         3\n"
SELECTIONS = {
    "number": "NSEL,S,NODE,,3\nD,ALL,UZ,0\nNSEL,ALL\n",
    "range": "NSEL,S,NODE,,3,9,2\nD,ALL,UZ\n",
    "place": "NSEL,S,LOC,X,2\nD,ALL,UZ\n",
    "place within its tolerance": "NSEL,S,LOC,X,2.005\nD,ALL,UZ\n",
    "range of places": "nsel,s,loc,x,1.5,2.5\nd,all,uz\n",
    "reselected": "NSEL,S,NODE,,2,3\nNSEL,R,LOC,X,2\nD,ALL,UZ\n",
    "added": "NSEL,NONE\nNSEL,A,NODE,,3\nD,ALL,UZ\n",
    "unselected": "NSEL,U,LOC,X,0,1\nD,ALL,UZ\n",
    "inverted": "NSEL,S,LOC,X,0,1\nNSEL,INVE\nD,ALL,UZ\n",
    "absolute values": "NSCALE,,ALL,,,-1\nNSEL,S,LOC,X,1.5,2.5,,1\nD,ALL,UZ\n",
    "component": COMPONENT + "cmsel,s,_TIP\nd,all,uz,0\nnsel,all\n",
    "component in D": COMPONENT + "D,_tip,UZ\n",
    "component in NSEL": COMPONENT + "NSEL,S,,,_TIP\nD,ALL,UZ\n",
    "component of CM": "NSEL,S,NODE,,3\nCM,END,NODE\nALLSEL\nCMSEL,S,END\nD,ALL,UZ\nALLSEL\n",
    "nodes of elements": "ESEL,S,ELEM,,2\nNSLE\nNSEL,R,LOC,X,1.5,3\nD,ALL,UZ\n",
    "elements of nodes": "NSEL,S,NODE,,3\nESLN\nALLSEL,BELOW,ELEM\nNSEL,U,NODE,,2\nD,ALL,UZ\n",
    "elements of all their nodes": "NSEL,S,NODE,,2,3\nESLN,S,1\nNSLE\nNSEL,U,NODE,,2\nD,ALL,UZ\n",
    "elements of a material": "EMODIF,2,MAT,2\nESEL,S,MAT,,2\nEMODIF,ALL,MAT,1\nNSLE\nNSEL,U,,,2\nD,ALL,UZ\n",
    "all but a component": COMPONENT + "CMSEL,U,_TIP\nNSEL,INVE\nD,ALL,UZ\n",
    "range of D in the selection": "NSEL,S,NODE,,3\nD,2,UZ,,,3\n",
    "picked": "FLST,2,1,1,ORDE,1\nFITEM,2,3\nD,P51X,UZ\n",
    "cylindrical": "CSYS,1\nNSEL,S,LOC,X,2\nCSYS,0\nD,ALL,UZ\n",
    "deselected before": "NSEL,S,NODE,,1\nNSEL,A,NODE,,3\nNSEL,U,NODE,,1\nD,ALL,UZ\n",
    "degrees of freedom": "DOFSEL,S,UZ\nD,3,ALL\nDOFSEL,ALL\n",
    "released": "D,3,ALL\nDDELE,3,ALL\nD,3,UZ\n",
    "released among the selected": "D,ALL,UZ\nNSEL,S,NODE,,2\nDDELE,ALL,UZ\n",
}


@pytest.mark.parametrize("commands", SELECTIONS.values(), ids=SELECTIONS)
def test_supports_are_those_of_the_selection(tmp_path: Path, commands: str):
    np.testing.assert_allclose(frequencies(tmp_path, BEAM + commands), PROPPED, atol=1e-3)


GRID = {n: (n % 4, n // 4 % 3, n // 12) for n in range(24)}
"""Places of nodes 1 to 24, less one."""
STEPS = st.one_of(
    st.tuples(
        st.just("LOC"), st.sampled_from("SRAU"), st.sampled_from("XYZ"), st.integers(0, 3), st.integers(0, 3)
    ),
    st.tuples(st.just("NODE"), st.sampled_from("SRAU"), st.just(""), st.integers(1, 24), st.integers(1, 24)),
    st.just(("INVE",)),
)


@settings(max_examples=60, deadline=None)
@given(steps=st.lists(STEPS, max_size=6))
def test_selections_are_sets(tmp_path_factory, steps):
    """Selecting, reselecting, adding and unselecting are operations of sets."""
    selected, text = set(GRID), "".join(f"N,{n + 1},{x},{y},{z}\n" for n, (x, y, z) in GRID.items())
    for item, *fields in steps:
        if item == "INVE":
            selected, text = set(GRID) - selected, f"{text}NSEL,INVE\n"
            continue
        how, axis, low, high = fields
        text += f"NSEL,{how},{item},{axis},{low},{high}\n"
        value = {n: GRID[n]["XYZ".index(axis)] if axis else n + 1 for n in GRID}
        found = {n for n, v in value.items() if low <= v <= high}
        selected = {"S": found, "R": selected & found, "A": selected | found, "U": selected - found}[how]
    path = tmp_path_factory.mktemp("deck") / "a.cdb"
    path.write_text(text + "D,ALL,UX\n")
    assert {n - 1 for n, _ in read_commands(path).supports} == selected


SCALED = np.array(FREE) / 4
NO_CHANGE = {
    "an element is deleted": BEAM.replace("D,1", "E,1,3\nEDELE,3\nD,1"),
    "selected elements are deleted": BEAM.replace("D,1", "E,1,3\nESEL,S,ELEM,,3\nEDELE,ALL\nALLSEL\nD,1"),
    "a support is deleted": BEAM + "D,3,UZ,0\nDDELE,3,UZ\n",
    "supports of a range are deleted": BEAM + "D,2,UZ,,,3\nDDELE,2,ALL,3\n",
    "a coupled set is deleted": BEAM + "CP,1,UZ,1,3\nCPDELE,1\n",
    "all equations are deleted": BEAM + "CE,1,0,3,UZ,1\nCEDELE,ALL\n",
    "a node of nothing is deleted": BEAM + "N,9,5\nD,9,ALL\nCP,1,UZ,3,9\nNDELE,9\n",
    "a node of an element stays": BEAM + "NDELE,2\n",
    "commands after the file's end": BEAM + "/EOF\nD,3,ALL\n",
    "a clamp by place": TABLES + NODES + ELEMENTS + "NSEL,S,LOC,X,0\nD,ALL,ALL\nNSEL,ALL\n",
    "a false condition": BEAM + "*IF,0,EQ,1,THEN\nD,3,ALL,0\n*ENDIF\n",
    "a false condition of nothing": BEAM + "*IF,_NO,EQ,1\nD,3,ALL,0\n*ELSE\n*ENDIF\n",
    "a second load step": BEAM + "FINISH\n/SOLU\nSOLVE\nD,3,ALL,0\nSOLVE\n",
    "after FINISH": BEAM + "FINISH\nD,3,ALL\n",
    "in POST1": BEAM + "FINISH\n/POST1\nD,3,ALL\n",
    "an old material": BEAM.replace("MAT,1", "MAT,2") + "MPCHG,1,ALL\n",
    "a modified element": BEAM.replace("MAT,1", "MAT,2") + "EMODIF,ALL,MAT,1\n",
    "modified nodes": BEAM.replace("E,2,3", "E,2,1") + "EMODIF,2,-2,3\n",
    "a modified place": BEAM.replace("N,3,2", "N,3,7") + "NMODIF,3,2\n",
    "a scaled pattern": BEAM.replace("N,2,1", "N,2,2").replace("N,3,2", "N,3,4")
    + "NSCALE,0,ALL,,,.5,.5,.5\n",
    "an element defined anew": BEAM + "MAT,2\nEN,2,1,2\nMAT,1\nEN,2,2,3\n",
}


@pytest.mark.parametrize("text", NO_CHANGE.values(), ids=NO_CHANGE)
def test_edits_leave_the_cantilever(tmp_path: Path, text: str):
    np.testing.assert_allclose(frequencies(tmp_path, text), FREE, atol=1e-3)


EDITS = {
    "materials": ("MPCHG,2,ALL\n", np.array(FREE) / 2**0.5),
    "materials of the selected": ("ESEL,S,ELEM,,2\nMPCHG,2,ALL\nESEL,ALL\n", (6.915, 13.827, 37.281)),
    "one material": ("EMODIF,2,MAT,2\n", (6.915, 13.827, 37.281)),
    "lengths": ("NSCALE,0,ALL,,,2,2,2\n", SCALED),
    "lengths of the selected": ("NSEL,S,LOC,X,1,2\nNSCALE,0,ALL,,,2\nNSEL,ALL\n", SCALED),
    "a roller at 30°": ("LOCAL,11,0,0,0,0,30\nNROTAT,3\nCSYS,0\nD,3,UX,0\n", (7.087, 44.753, 62.389)),
    "a roller along θ": ("CSYS,5\nNROTAT,ALL\nCSYS,0\nD,3,UY\n", PROPPED),
    "a copy": ("NSCALE,10,3,,,1.5\nE,3,13\n", None),
}


@pytest.mark.parametrize(("commands", "expected"), EDITS.values(), ids=EDITS)
def test_edits_change_the_cantilever(tmp_path: Path, commands: str, expected):
    if expected is None:
        assert deck(tmp_path, BEAM + commands).points[-1].tolist() == [3, 0, 0]
    else:
        np.testing.assert_allclose(frequencies(tmp_path, BEAM + commands), expected, rtol=5e-3)


SYSTEMS = {
    "LOCAL": ("LOCAL,11,0,1,0,0,90\nN,2,.5\nN,3,1\n", [[1, 0.5, 0], [1, 1, 0]]),
    "LOCAL, cylindrical": ("LOCAL,12,1,0,0,0\nN,2,1,90\nN,3,2,90,1\n", [[0, 1, 0], [0, 2, 1]]),
    "CSYS,1": ("CSYS,1\nN,2,1,90\nN,3,2,180\n", [[0, 1, 0], [-2, 0, 0]]),
    "CSYS,2": ("CSYS,2\nN,2,1,90,0\nN,3,2,0,90\n", [[0, 1, 0], [0, 0, 2]]),
    "CSYS,5": ("CSYS,5\nN,2,1,0,3\nN,3,1,90,0\n", [[1, 3, 0], [0, 0, -1]]),
    "CLOCAL": ("LOCAL,11,0,1,0,0,90\nCLOCAL,12,0,1,0,0\nN,2,1\nN,3,0,1\n", [[1, 2, 0], [0, 1, 0]]),
    "CS": ("N,7,0,0,1\nN,8,0,1,1\nN,9,-1,0,1\nCS,11,0,7,8,9\nN,2,1\nN,3,0,1\n", [[0, 1, 1], [-1, 0, 1]]),
    "back to 0": ("LOCAL,11,0,1,0,0,90\nCSYS,0\nN,2,.5\nCSYS,11\nN,3,1\n", [[0.5, 0, 0], [1, 1, 0]]),
}


@pytest.mark.parametrize(("commands", "expected"), SYSTEMS.values(), ids=SYSTEMS)
def test_nodes_are_in_the_active_system(tmp_path: Path, commands: str, expected):
    text = TABLES + "N,1\n" + commands + "CSYS,0\n" + ELEMENTS + "D,1,ALL\n"
    made = deck(tmp_path, text)
    np.testing.assert_allclose(made.points[np.isin(made.nodes, (2, 3))], expected, atol=1e-12)


EQUATIONS = {
    "CE on one number": ("CE,1,0,3,UZ,1,6,UZ,-1,2,UZ,.3\nCE,1,0,5,UZ,.2\n", (7.087, 14.172, 14.172, 31.951)),
    "CE,HIGH": ("CE,1,0,3,UZ,1,6,UZ,-1,2,UZ,.3\nCE,HIGH,0,5,UZ,.2\n", (7.087, 14.172, 14.172, 31.951)),
    "a removed term": (
        "CE,4,0,3,UZ,1,6,UZ,-1,2,UZ,.3\nCE,4,,-2,UZ,0\n",
        (7.087, 14.172, 14.172, 31.347),
    ),
    "CP on one number": ("CP,1,UZ,3,6\nCP,1,UZ,2,5\n", (14.172, 14.172, 17.043, 89.395)),
    "CP without a label": ("CP,1,UZ,3,6\nCP,1,,2,5\n", (14.172, 14.172, 17.043, 89.395)),
    "CP of the selected": ("NSEL,S,LOC,X,1,2\nCP,1,UZ,ALL\nNSEL,ALL\n", (14.172, 14.172, 17.043, 89.395)),
    "CPNGEN": ("CPNGEN,1,UZ,2,3\nCPNGEN,1,UZ,5,6\n", (14.172, 14.172, 17.043, 89.395)),
    "CP without a node": ("CP,1,UZ,3,6,2\nCP,1,UZ,-2\n", (7.087, 14.172, 14.172, 31.347)),
}


@pytest.mark.parametrize(("commands", "expected"), EQUATIONS.values(), ids=EQUATIONS)
def test_equations_of_one_number_are_one(tmp_path: Path, commands: str, expected):
    np.testing.assert_allclose(frequencies(tmp_path, PAIR + commands, 4), expected, rtol=1e-4)


def test_all_labels_of_a_coupled_set_tie_two_nodes(tmp_path: Path):
    """A second beam from 3 on, tied at a node at the same place, is a longer beam."""
    text = TABLES + "N,1\nN,2,1\nN,3,1\nN,4,2\nTYPE,1\nE,1,2\nE,3,4\nD,1,ALL\nCP,,ALL,2,3\n"
    np.testing.assert_allclose(frequencies(tmp_path, text), FREE, atol=1e-3)


SCRIPT = """\
FINISH $ /CLEAR,START
L=2 $ N_E=2
*SET,DIAM,'UZ'
*DO,I,1,N_E+1
  N,I,(I-1)*L/N_E
*ENDDO
*DO,I,1,9
  *IF,I,GT,N_E,EXIT
  *IF,MOD(I,2),EQ,0,AND,I,LT,5,THEN
    E,I,I+1
  *ELSEIF,I,EQ,77
    D,ALL,ALL
  *ELSE
    EN,I,I,I+1
  *ENDIF
*ENDDO
D,1,ALL
*GET,LAST,NODE,0,NUM,MAX
*IF,NX(LAST),EQ,SQRT(4),THEN
*IF,LAST,NE,3,THEN
*DO,K,1,2
D,ALL,ALL
*ENDDO
*ELSE,
D,NODE(L,0,0),DIAM
*ENDIF
*ENDIF
"""


def test_a_script_with_parameters_loops_and_conditions(tmp_path: Path):
    text = SCRIPT.replace("L=2", TABLES + "L=2", 1)
    np.testing.assert_allclose(frequencies(tmp_path, text), PROPPED, atol=1e-3)


WORKBENCH = """\
/batch
*get,_wallstrt,active,,time,wall
*DIM,_wb_ProjectScratch_dir,string,248
_wb_ProjectScratch_dir(1) = 'C:\\Temp\\'
/com,--- Data in consistent units. $ D,ALL,ALL
/units,MKS
/wb,file,start
/prep7
SHPP,OFF,,NOWARN
etcon,set
nblock,3,,3
(1i9,3e20.9e3)
        1    0.000000000E+000    0.000000000E+000    0.000000000E+000
        2    1.000000000E+000    0.000000000E+000    0.000000000E+000
        3    2.000000000E+000    0.000000000E+000    0.000000000E+000
-1
et,1,4
r,1,1e-3,4e-7,1e-7,.1,.2,0.
rmore,0.,2e-7
eblock,10,,,2
(15i9)
        1        1        1        1        0        1        2
        2        1        1        1        0        2        3
-1
Temperature = 'TEMP'
MPTEMP,1,7.88860905221012e-31
MPDATA,DENS,1,1,7800,
MP,EX,1,2e11,
MP,PRXY,1,.25,
MP,UVID,1,7
CMBLOCK,FIXEDSU,NODE,        1
(8i10)
         1
CMBLOCK,_DISPNODEZ,NODE,        2
(8i10)
         3        -3
cmsel,s,FIXEDSU
d,all,all
nsel,all
*DIM,_loadvari40z,TABLE,2,1,1,TIME,
_loadvari40z(1,1,1) = 0.
cmsel,s,_DISPNODEZ
d,all,uz,%_loadvari40z%
nsel,all
finish
/solu
antype,2
modopt,lanb,6
*get,ANSINTER_,active,,int
*if,ANSINTER_,ne,0,then
/eof
*endif
solve
fini
/post1
*get,n,active,0,set,nset
*do,i,1,n
*enddo
"""
"""What Workbench writes for a clamp at one node and a displacement at another."""


def test_an_input_file_of_workbench(tmp_path: Path):
    np.testing.assert_allclose(frequencies(tmp_path, WORKBENCH), PROPPED, atol=1e-3)
    found = notes(tmp_path, WORKBENCH)
    assert "D of node 3 moves it by a table; it is fixed here" in found
    assert "not read" not in found


def test_a_mesh_names_commands_that_are_not_read(tmp_path: Path):
    (tmp_path / "a.cdb").write_text(BEAM + "FOO,1\n")
    with pytest.warns(MeshWarning, match=r"commands that are not read: FOO \(line 20\)"):
        read_mesh(tmp_path / "a.cdb")


NOTES = [
    ("FOO,1\nFOO,2\nBAR\n", "commands that are not read: FOO (2, first at line 20), BAR (line 22)"),
    ("/COM,a\nC*** text\n/TITLE,b\nNLIST\nEPLOT\nOUTRES,ALL\nAUTOTS,ON\n", ""),
    ("F,3,FY,1\nF,2,FY,1\n", "loads are left out: F (2, first at line 20)"),
    (
        "SOLVE\nD,3,UZ\nMPCHG,2,1\n",
        "line 20: SOLVE is the first solution; left out after it: D (line 21), MPCHG",
    ),
    ("FINISH\nD,3,UZ\n", "commands that are not read: D after FINISH (line 21)"),
    ("D,3,UX,.1\n", "line 20: D of node 3 moves it by 0.1; it is fixed here"),
    ("D,ALL,UX,%tab%\n", "line 20: D of node 1 and 2 more moves it by a table; it is fixed here"),
    ("D,9,UX\n", "line 20: D of node 9, which is not defined"),
    ("NSEL,S,NODE,,7\nD,ALL,UX\n", "line 21: D fixes nothing: no node is selected"),
    ("D,3,TEMP,20\n", "commands that are not read: D of TEMP (line 20)"),
    ("ESEL,S,ELEM,,1\nSOLVE\n", "line 21: SOLVE takes the selected elements: 1 others are left out"),
    ("NSEL,S,NODE,,1\nSOLVE\n", "line 21: SOLVE while nodes of its elements are not selected"),
    ("MPTEMP,1,0\n*GET,n,ACTIVE,,INT\n*IF,n,NE,0,THEN\n/EOF\n*ENDIF\n", ""),
]


@pytest.mark.parametrize(("commands", "words"), NOTES, ids=[w[:40] or "nothing" for _, w in NOTES])
def test_commands_that_are_not_applied_are_named(tmp_path: Path, commands: str, words: str):
    found = notes(tmp_path, BEAM + commands)
    assert words in found
    assert words or not found


REFUSED = [
    ("FILL,1,3", "FILL generates or changes parts of the model"),
    ("ENDRELEASE,,-1,ROTY", "ENDRELEASE generates or changes parts"),
    ("ENDR,,-1,ROTY", "ENDR generates or changes parts"),
    ("EKILL,2", "EKILL takes elements out of the solution"),
    ("ETCHG,TTS", "ETCHG generates"),
    ("NSEL,S,D,UX", "NSEL by 'D' is not read; NODE and LOC are"),
    ("NSEL,X,NODE,,1", "NSEL has the type 'X'"),
    ("NSEL,S,NODE,,P51Y", "NSEL, field 4: 'P51Y' is not a whole number"),
    ("ESEL,S,STRA,,1", "ESEL by 'STRA' is not read"),
    ("CMSEL,S,NO", "CMSEL selects the component 'NO', which is not defined"),
    ("NSLL,S", "NSLL selects by a solid model"),
    ("CSYS,4", "CSYS activates the working plane"),
    ("CSYS,11\nN,9,1", "CSYS is in the coordinate system 11, which is not defined"),
    ("CSYS,1\nN,9,1,0,0,30", "N turns a node while a local coordinate system is active"),
    ("LOCAL,11,3", "LOCAL of type 3 is not read"),
    ("D,P,UX", "D, field 1: 'P' is not a whole number"),
    ("D,3,UZZ", "D has the label 'UZZ', which is none of UX"),
    ("D,3,UX,1+LOAD", "D, field 3: '1+LOAD' is not a number; LOAD has no value"),
    ("*GET,A,KP,0,COUNT\nN,A", "'A' is not a number; the value of A is not known here: *GET of KP, 0, COUNT"),
    ("*GET,A,KP,0,COUNT\n*IF,A,EQ,1,THEN", "*IF cannot be decided: 'A' is not a number"),
    ("N,9,1/0", "N, field 2: '1/0' has no value"),
    ("N,9,SQRT(-1)", "N, field 2: 'SQRT(-1)' has no value"),
    ("*IF,1,EQ,1,THEN", "line 20: *IF has no *ENDIF"),
    ("*IF,1,EQ,2,THEN", "line 20: *IF has no *ENDIF"),
    ("*DO,I,1,3", "line 20: *DO has no *ENDDO"),
    ("*DO,I,1,2,0\n*ENDDO", "*DO has the increment 0"),
    ("*ENDIF", "*ENDIF has no *IF before it"),
    ("*ENDDO", "*ENDDO has no *DO before it"),
    ("*IF,1,EQ,1,:there", "*IF jumps to :THERE"),
    ("*USE,a.mac", "*USE changes the order of commands"),
    ("/INPUT,b,mac", "/INPUT reads another file"),
    ("/CLEAR", "/CLEAR deletes the model"),
    ("CE,1,0,3,UX,1,3,UX,1", "CE repeats node 3, UX in equation 1"),
    ("MPCHG,2,9", "MPCHG refers to element 9, which is not defined"),
    ("CP,1,,2,3", "CP needs one of UX"),
    ("D,3,,0", "D has no label; one of UX"),
    (
        "*DIM,A,,3\nA(2)=1\n*VFILL,A(1),RAMP,1,1\nN,9,A(2)",
        "the value of A is not known here: *VFILL gives it",
    ),
    ("*DIM,A,,3\n*VREAD,A(1),f,txt\n(F8.0)\n*IF,A(1),EQ,0,THEN\n*ENDIF", "*IF cannot be decided: 'A(1)'"),
]


@pytest.mark.parametrize(("commands", "words"), REFUSED, ids=[c[:25] for c, _ in REFUSED])
def test_what_cannot_be_applied_is_refused_by_name(tmp_path: Path, commands: str, words: str):
    with pytest.raises(MeshError) as caught:
        deck(tmp_path, BEAM + commands + "\n")
    message = str(caught.value)
    assert message.startswith("a.cdb: line 2")
    assert words in message, message
    assert "\n" not in message


def test_names_count_by_their_first_four_letters(tmp_path: Path):
    """KEYO and SECTYPES are KEYOPT and SECTYPE; E, EN and ENDR are three commands."""
    text = TABLES.replace("/PREP7", "/PREP").replace("RMORE", "RMOR") + NODES + ELEMENTS + "D,1,ALL\n"
    np.testing.assert_allclose(frequencies(tmp_path, text), FREE, atol=1e-3)


def test_endless_loops_are_refused(tmp_path: Path, monkeypatch):
    monkeypatch.setattr("fem.io.ansys_script.MOST_LOOPED", 1000)
    with pytest.raises(MeshError, match=r"line 2\d: \*DO loops read more than 1000 lines"):
        deck(tmp_path, BEAM + "*DO,I,1,1e9\n*DO,J,1,2\n*ENDDO\n*ENDDO\n")
