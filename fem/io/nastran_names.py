"""Tables of Nastran's bulk data cards that are read, refused, named or harmless.

A card that is in no table is counted by name.
"""

from typing import Final

from fem.io.deck import words

LINES: Final = ("CBAR", "CBEAM", "CBEND", "CBEAM3", "CROD", "CTUBE", "CONROD", "PLOTEL")
"""Cards that are read as lines."""

SYSTEMS: Final = ("CORD1R", "CORD1C", "CORD1S", "CORD2R", "CORD2C", "CORD2S")
DEFAULTS: Final = ("GRDSET", "BAROR", "BEAMOR")
READ: Final = frozenset({"GRID", *DEFAULTS, *SYSTEMS, *LINES})
"""Cards that are applied."""

REFUSED: Final[dict[str, str]] = {
    "CORD3G": "a coordinate system",
    "CORD3R": "a coordinate system",
    "CORD3RX": "a coordinate system",
    "CORD1RX": "a coordinate system",
    "CORD2RX": "a coordinate system",
    "GMCORD": "a coordinate system",
    "GMCURV": "geometry that elements follow",
    "SEBULK": "superelements in parts of their own",
    "SELOC": "a superelement's place",
    "SEMPLN": "a mirrored superelement",
    "SECONCT": "connections of superelements",
}

_CONNECTION = "tie the places with [[rigid_links]], [[joints]] or [[constraints]] in the study file"
_SUPPORT = "give [[supports]] in the study file"

NAMED: Final[dict[str, str]] = {
    **dict.fromkeys(
        (
            "RBE1",
            "RBE2",
            "RBE3",
            "RBAR",
            "RBAR1",
            "RROD",
            "RTRPLT",
            "RJOINT",
            "RSPLINE",
            "RSSCON",
            "MPC",
            "MPCADD",
        ),
        _CONNECTION,
    ),
    **dict.fromkeys(("SPC", "SPC1", "SPCADD", "SPCD", "SPCR", "SUPORT", "SUPORT1"), _SUPPORT),
    **dict.fromkeys(
        ("CONM1", "CONM2", "CMASS1", "CMASS2", "CMASS3", "CMASS4"), "give [[masses]] in the study file"
    ),
    **dict.fromkeys(
        (
            "CBUSH",
            "CBUSH1D",
            "CBUSH2D",
            "CELAS1",
            "CELAS2",
            "CELAS3",
            "CELAS4",
            "CDAMP1",
            "CDAMP2",
            "CDAMP3",
            "CDAMP4",
            "CDAMP5",
            "CVISC",
            "CGAP",
            "CFAST",
            "CWELD",
            "CSEAM",
            "GENEL",
        ),
        "give [[joints]] in the study file",
    ),
}
"""Cards that are left out, each with its remedy."""

HARMLESS: Final = words(
    """
    ACCEL ACCEL1 ACMODL ACSRCE AEFACT AELINK AELIST AEPARM AERO AEROS AESTAT AESURF ASET ASET1 BCONP
    BCPROP BCTABLE BLSEG BSET BSET1 BSURF BSURFS CAERO1 CSET CSET1 CSSCHD DAREA DCONADD DCONSTR DDVAL
    DEFORM DELAY DEQATN DESVAR DLINK DLOAD DMI DMIG DMIJ DMIK DOPTPRM DPHASE DRESP1 DRESP2 DRESP3
    DSCREEN DTABLE DTI DVCREL1 DVCREL2 DVGRID DVMREL1 DVMREL2 DVPREL1 DVPREL2 DYNRED EIGB EIGC EIGP EIGR
    EIGRL ESE FLFACT FLUTTER FORCE FORCE1 FORCE2 FREQ FREQ1 FREQ2 FREQ3 FREQ4 FREQ5 GRAV GUST LOAD LSEQ
    MAT1 MAT10 MAT11 MAT2 MAT3 MAT4 MAT5 MAT8 MAT9 MATG MATHP MATS1 MATT1 MATT2 MATT8 MATT9 MDLPRM
    MKAERO1 MKAERO2 MOMENT MOMENT1 MOMENT2 NLPARM NLPCI NOLIN1 NSM NSM1 NSMADD NSML NSML1 OMIT OMIT1
    PAABSF PACABS PAERO1 PARAM PBAR PBARL PBCOMP PBEAM PBEAM3 PBEAML PBEND PBMSECT PBRSECT PBUSH PBUSH1D
    PBUSHT PCOMP PCOMPG PCONEAX PDAMP PDAMP5 PDAMPT PELAS PELAST PFAST PGAP PLOAD PLOAD1 PLOAD2 PLOAD4
    PLPLANE PLSOLID PMASS PROD PSHEAR PSHELL PSOLID PTUBE PVISC PWELD QBDY1 QBDY2 QBDY3 QHBDY QSET QSET1
    QVOL RANDPS RANDT1 RFORCE RLOAD1 RLOAD2 SEQGP SET1 SET2 SET3 SPLINE1 SPLINE2 SPLINE4 SPLINE5 SWLDPRM
    TABDMP1 TABLE3D TABLED1 TABLED2 TABLED3 TABLED4 TABLEM1 TABLEM2 TABLEM3 TABLEM4 TABLES1 TABLEST
    TABRND1 TABRNDG TEMP TEMPD TEMPP1 TEMPRB TIC TLOAD1 TLOAD2 TRIM TSTEP TSTEPNL USET USET1
    """
)
"""Materials, properties, loads, sets for results and controls of an analysis: the study file gives those
that are needed."""
