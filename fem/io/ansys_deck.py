"""ANSYS files, archives (``.cdb``) and scripts alike: their commands are carried out one after the other.

What changes a model in a way that is not read is refused by name; every other unknown command is noted.
"""

from collections.abc import Callable
from pathlib import Path

from fem.io import ansys_blocks, ansys_commands, ansys_selection
from fem.io.ansys_content import AnsysDeck
from fem.io.ansys_script import Command, key_of
from fem.io.ansys_state import ELEM, NODE, AnsysState
from fem.io.deck import Files, counted, words

Handler = Callable[[AnsysState, Command], None]

MODEL: dict[str, Handler] = {
    key_of(name): handler
    for names, handler in (
        ("N", ansys_commands.node),
        ("NMODIF", ansys_commands.nmodif),
        ("NROTAT", ansys_commands.nrotat),
        ("NSCALE", ansys_commands.nscale),
        ("NDELE", ansys_commands.ndele),
        ("E EN", ansys_commands.element),
        ("EDELE", ansys_commands.edele),
        ("EMODIF", ansys_commands.emodif),
        ("MPCHG", ansys_commands.mpchg),
        ("ET", ansys_commands.et),
        ("KEYOPT", ansys_commands.keyopt),
        ("R", ansys_commands.r),
        ("RMORE", ansys_commands.rmore),
        ("RMODIF", ansys_commands.rmodif),
        ("MP", ansys_commands.mp),
        ("MPDATA", ansys_commands.mpdata),
        ("MPDELE", ansys_commands.mpdele),
        ("ETDELE RDELE SDELETE", ansys_commands.delete_tables),
        ("SECTYPE", ansys_commands.sectype),
        ("SECDATA SECOFFSET SECCONTROL", ansys_commands.of_section),
        ("ALPHAD BETAD DMPRAT DMPSTR", ansys_commands.damping),
        ("D", ansys_commands.d),
        ("DDELE", ansys_commands.ddele),
        ("CE", ansys_commands.ce),
        ("CECMOD", ansys_commands.cecmod),
        ("CP", ansys_commands.cp),
        ("CPNGEN", ansys_commands.cpngen),
        ("CEDELE CPDELE", ansys_commands.cedele),
        ("NBLOCK", ansys_blocks.nblock),
        ("EBLOCK", ansys_blocks.eblock),
        ("RLBLOCK", ansys_blocks.rlblock),
        ("ETBLOCK", ansys_blocks.etblock),
    )
    for name in names.split()
}
"""Commands that change a model: those of PREP7 and SOLUTION."""

ANYWHERE: dict[str, Handler] = {
    key_of(name): handler
    for names, handler in (
        ("TYPE MAT REAL SECNUM", ansys_commands.attribute),
        ("CSYS", ansys_commands.csys),
        ("LOCAL", ansys_commands.local),
        ("CLOCAL", ansys_commands.clocal),
        ("CS", ansys_commands.cs),
        ("CSDELE", ansys_commands.csdele),
        ("NSEL", ansys_selection.nsel),
        ("ESEL", ansys_selection.esel),
        ("NSLE", ansys_selection.nsle),
        ("ESLN", ansys_selection.esln),
        ("ALLSEL", ansys_selection.allsel),
        ("CMSEL", ansys_selection.cmsel),
        ("CM", ansys_selection.cm),
        ("CMDELE", ansys_selection.cmdele),
        ("CMBLOCK", ansys_blocks.cmblock),
        ("DOFSEL", ansys_selection.dofsel),
        ("SELTOL", ansys_selection.seltol),
        ("FLST", ansys_selection.flst),
        ("FITEM", ansys_selection.fitem),
        ("*GET", ansys_commands.get),
        ("*ASK /INQUIRE", ansys_commands.forget),
        ("/UNITS", ansys_commands.units),
    )
    for name in names.split()
}

_GENERATES = (
    "generates or changes parts of the model; solve or save it in ANSYS, and write it with CDWRITE,DB"
)
_REASONS = {
    """FILL NGEN NSYM NORA NANG NKPT TRANSFER MOVE CENTER NUMMRG NUMCMP NUMSTR EGEN ESYM EMORE ENGEN
    EINTF ESURF EORIENT ENSYM ENORM ETCHG ENDRELEASE KMESH LMESH AMESH VMESH PSMESH MPCOPY CPCYC
    CPMERGE CECYC CESGEN CYCLIC""": _GENERATES,
    "DSYM DK DL DA DTRAN SBCTRAN CERIG RBE3 CEINTF CPINTF CPLGEN CPSGEN": (
        "becomes supports or equations of nodes only in ANSYS; write the file with CDWRITE,DB after that"
    ),
    "EKILL": "takes elements out of the solution; delete them (EDELE)",
    "NSLK NSLL NSLA NSLV ESLL ESLA ESLV": (
        "selects by a solid model, which is not read; select by numbers or places"
    ),
    "CSKP CSWPLA": "defines a coordinate system by a solid model or the working plane; use LOCAL",
    "CMMOD CMEDIT CMGRP": "changes or groups components; select them one by one, and name them with CM",
    "SE": "reads a superelement; read its matrices as a part of a study",
    "CDREAD NREAD EREAD MPREAD SECREAD LSREAD RESUME PARRES /INPUT *ULIB": (
        "reads another file; write all into one"
    ),
    "*USE *CREATE *REPEAT *GO *DOWHILE": "changes the order of commands; write the model with CDWRITE,DB",
}
REFUSED = {key_of(name): reason for names, reason in _REASONS.items() for name in names.split()}

NAMED = {
    "MDAMP": "the damping ratios of single modes are left out",
    "INISTATE": "the initial stress is left out, and its stiffness with it",
    "ISTRESS": "the initial stress is left out, and its stiffness with it",
    "PSTRES": "stress stiffening is left out: the model vibrates about the unloaded state",
    "SSTIF": "stress stiffening is left out: the model vibrates about the unloaded state",
    "OMEGA": "rotation is left out: no gyroscopic or spin softening effects",
    "CMOMEGA": "rotation is left out: no gyroscopic or spin softening effects",
    "CORIOLIS": "gyroscopic effects are left out",
    "LUMPM": "masses are consistent here",
    "M": "master degrees of freedom are left out: all of them are solved",
    "TB": "material tables are left out: materials are those of MP and MPDATA",
}
LOADS = words(
    "F FK SF SFE SFL SFA SFBEAM SFEBEAM SFGRAD BF BFE BFK BFL ACEL CMACEL DOMEGA INRES LDREAD SLOAD"
)
_NAMED_KEYS = {key_of(name): name for name in (*NAMED, *LOADS)}

_NO_CHANGE = frozenset(
    key_of(name)
    for name in words(
        """SAVE STAT HELP ADAMS ANTYPE MODOPT MXPAND EXPASS NUMEXP EXPSOL HROPT HARFRQ HROUT HREXP
        TRNOPT TINTP TIMINT TIME DELTIM NSUBST AUTOTS KBC OUTRES OUTPR EQSLV PCGOPT BCSOPTION DSPOPTION
        RESCONTROL NROPT NEQIT NCNV CNVTOL PRED LNSRCH NLGEOM ARCLEN CUTCONTROL ERESX OPNCONTROL
        MONITOR SNOPTION MSAVE FREQ SPOPT SVTYP SV RIGID SUBOPT QRDOPT ROCK SEOPT SEEXP TOTAL THOPT
        LVSCALE IRLF TREF TUNIF BFUNIF TOFFST UNIMAT ESYS DMPOPTION DMPEXT EMATWRITE ASSIGN DDOPTION FSSECT
        CNCHECK CECHECK CHECK MCHECK SHPP ETCON DOF EXTOPT MPTEMP MPTGEN MPTRES TBDATA TBPT TBTEMP CDOPT
        CDWRITE CEWRITE CPWRITE EWRITE NWRITE MPWRITE PARSAV LSDELE LSCLEAR FDELE SFDELE SFEDELE BFDELE
        BFEDELE MDELE ICDELE IC FCUM SFCUM BFCUM EALIVE KSEL LSEL ASEL VSEL KSLL LSLA LSLK ASLL VSLA
        NLIST ELIST DLIST FLIST SFLIST BFLIST CELIST CPLIST ETLIST RLIST MPLIST SLIST CSLIST CMLIST KLIST
        LLIST ALIST VLIST NPLOT EPLOT KPLOT LPLOT APLOT VPLOT GPLOT CMPLOT SECPLOT IMMED PLNSOL
        PRNSOL PLDISP PRRSOL PLESOL PRESOL ETABLE PLETAB PRETAB SET NSORT XMLO NOORDER WSORT WAVES WPSTYLE
        WPLANE WPCSYS WPOFFS WPROTA WPAVE CAMPBELL *DIM *DEL *STATUS *CFOPEN *CFCLOS *CFWRITE *MWRITE
        *VEDIT *ABBR DSYS NDIST"""
    )
) | {""}
"""Commands that do not change the model: options of the solution, lists, plots, files that are written."""
_WRITES = frozenset(key_of(name) for name in ("*VWRITE", "*MSG"))
_BEFORE_FORMAT = _WRITES | {key_of("*VREAD")}
"""Star commands whose next line is a format."""
_ENDS = frozenset(key_of(name) for name in ("SOLVE", "LSSOLVE", "LSWRITE", "/EOF", "/EXIT"))


def read_deck(path: Path) -> AnsysDeck:
    """Return the model that the commands of a file make, as its first solution finds it.

    Raises
    ------
    MeshError
        With file, line and command if a command cannot be read, a block is cut, or a command changes the
        model in a way that is not read.
    """
    state = AnsysState.of(path.name, Files(path).first().text)
    for command in state.script.commands():
        if command.key in _ENDS:
            _end(state, command)
        else:
            _run(state, command)
    state.script.finish()
    _notes(state.deck)
    return state.deck


def _run(state: AnsysState, c: Command) -> None:
    """Carry out a command."""
    handler = MODEL.get(c.key) or ANYWHERE.get(c.key)
    outside = state.processor not in ("PREP7", "SOLU")
    if outside and (c.key in MODEL or (c.key in REFUSED and c.key[0] not in "*/")):
        state.ignore(f"{c.name.upper()} after {state.processor}", c.line)
    elif c.key in REFUSED:
        c.refuse(REFUSED[c.key])
    elif handler is not None:
        try:
            handler(state, c)
        except IndexError:
            text = ",".join((c.name, *c.fields))
            c.refuse(f"has too few fields: {text[:60]}")
    elif c.key == "FINI":
        state.processor = "FINISH"
    elif c.key == "NUMO" and (state.deck.nodes or state.deck.elements or state.deck.types):
        c.refuse(_GENERATES)
    elif c.key == "/CLEA" and state.deck.nodes:
        c.refuse("deletes the model that the commands before it make; write one model into a file")
    elif c.key in _NAMED_KEYS:
        if c.key not in _WITH_SWITCH or _is_on(c):
            state.ignore(_NAMED_KEYS[c.key], c.line)
    elif c.key[:1] == "/":
        if c.key in ("/PREP", "/SOLU") or c.key[:4] in ("/POS", "/AUX", "/OPT", "/MAP"):
            state.processor = {"/PREP": "PREP7", "/SOLU": "SOLU"}.get(c.key, c.name.upper())
    elif c.key not in _NO_CHANGE and c.key not in _WRITES and c.key != "NUMO":
        if c.key[0] == "*":
            ansys_commands.forget(state, c)  # *VREAD and *VFILL fill arrays
        state.ignore(c.name.upper()[:30], c.line)
    if c.key in _BEFORE_FORMAT:
        state.script.at += 1


_WITH_SWITCH = frozenset(key_of(name) for name in ("OMEGA", "LUMPM", "PSTRES", "SSTIF", "CORIOLIS"))


def _is_on(c: Command) -> bool:
    return any(f.upper() not in ("", "0", "OFF") and f.strip("0.+-E ") for f in c.fields[:3])


def _end(state: AnsysState, c: Command) -> None:
    """End at the first solution: it takes what is selected; commands after it are left out by name."""
    deck, name = state.deck, c.name.upper()
    if c.key[0] != "/":
        left_out = state.hidden[ELEM] & set(deck.elements)
        for number in left_out:
            del deck.elements[number]
        if left_out:
            deck.notes.append(
                f"line {c.line}: {name} takes the selected elements: {len(left_out)} others are left out"
            )
        if state.hidden[NODE] & {n for e in deck.elements.values() for n in e.nodes}:
            deck.notes.append(
                f"line {c.line}: {name} while nodes of its elements are not selected, which ANSYS refuses; "
                "they are in the model here"
            )
    later: dict[str, list[int]] = {}
    for after in state.script.rest():
        if after.key in MODEL or after.key in REFUSED:
            later.setdefault(after.name.upper(), []).append(after.line)
    if later:
        ends = "ends the file" if c.key[0] == "/" else "is the first solution"
        deck.notes.append(f"line {c.line}: {name} {ends}; left out after it: {counted(later, 'line ')}")


def _notes(deck: AnsysDeck) -> None:
    """Add sentences on the commands that were not applied and may matter."""
    known = {*NAMED, *LOADS}
    for name, lines in deck.ignored.items():
        if name in NAMED:
            deck.notes.append(f"{len(lines)} {name}: {NAMED[name]}")
    loads = {n: lines for n, lines in deck.ignored.items() if n in LOADS}
    others = {n: lines for n, lines in deck.ignored.items() if n not in known}
    if loads:
        deck.notes.append(f"loads are left out: {counted(loads, 'line ')}")
    if others:
        deck.notes.append(f"commands that are not read: {counted(others, 'line ')}")
