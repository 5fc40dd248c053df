"""Random programs in ANSYS' command language: selections, edits, parameters, conditions and loops."""

import random
import re
from collections.abc import Sequence

HEAD = """/PREP7
ET,1,188,,,3
ET,2,21
ET,3,14
MP,EX,1,2e11
MP,PRXY,1,.3
MP,DENS,1,7800
MP,EX,2,1e11
SECTYPE,1,BEAM,RECT
SECDATA,.02,.05
R,1,5
"""
MODEL = "N,1\nN,2,1\nN,3,2\nN,4,2,1\nE,1,2\nE,2,3\nE,3,4\nD,1,ALL\n"
BLOCKS = """NBLOCK,6,SOLID,9,2
(3i9,6e21.13e3)
       11        0        0 1.0000000000000E+000 3.0000000000000E+000
       12        0        0 2.0000000000000E+000 3.0000000000000E+000
N,R5.3,LOC,-1,
EBLOCK,19,SOLID,9,1
(19i8)
       1       1       1       1       0       0       0       0       2       0       9      11      12
      -1
CMBLOCK,Tip,NODE,       2
(8i10)
         2        -3
"""
SEEDS = [HEAD + MODEL, HEAD + BLOCKS + "CMSEL,S,TIP\nD,ALL,ALL\nALLSEL\n"]

_FORMS = """N,{n},{x},{x},{x} N,,{x},{x} N,{n},{x},{x},{x},{x},{x},{x} E,{n},{n} EN,{n},{n},{n}
EN,{n},{n},{n},{n} NSEL,{how},{item},,{n},{n},{n} NSEL,{how},LOC,{axis},{x},{x} NSEL,{how}
NSEL,{how},,,{name} NSLE,{how},ACTIVE ESEL,{how},{item},,{n},{n} ESEL,{how}
ESEL,{how},CENT,{axis},{x},{x} ESEL,{how},ENAME,,BEAM188 CMSEL,{how},{name} CM,{name},{kind}
CMDELE,{name} ALLSEL ALLSEL,BELOW,ELEM DOFSEL,{how},{label},{label} SELTOL,{x} CSYS,{system}
LOCAL,{system},{flag},{x},{x},{x},{x},{x},{x} CLOCAL,{system},{flag},{x},{x},{x},{x}
CS,{system},{flag},{n},{n},{n} CSDELE,{system} NROTAT,{nodes} NROTAT,{n},{n} NMODIF,{nodes},{x},,{x}
NMODIF,{n},,,,{x} NSCALE,{flag},{nodes},,,{x},{x},{x} NDELE,{nodes} NDELE,{n},{n} EDELE,{nodes}
EDELE,{n},{n},{flag} MPCHG,{flag},{nodes} EMODIF,{nodes},MAT,{flag} EMODIF,{n},{flag},{n},{n}
EMODIF,{n},-{flag},{n} D,{nodes},{label},{x} D,{nodes},ALL D,{n},{label},,,{n},{n},{label}
DDELE,{nodes},{label} DDELE,{nodes},ALL,{n} CE,{n},{x},{n},{label},{x},{n},{label},{x}
CE,HIGH,,{n},{label},{x} CE,NEXT,0,{n},{label},{x} CEDELE,{nodes} CECMOD,{n},{x}
CP,{n},{label},{n},{n} CP,NEXT,ALL,{n},{n} CP,{n},{label},ALL CP,{n},,-{n}
CPNGEN,{n},{label},{n},{n} CPDELE,{nodes},,,{how} TYPE,{flag} MAT,{flag} REAL,{flag} SECNUM,{flag}
ET,{flag},{et} KEYOPT,{flag},{flag},{flag} R,{flag},{x},{x} RMORE,{x} RMODIF,{flag},{flag},{x}
RDELE,{n} MP,{mp},{flag},{x} MPDATA,{mp},{flag},{flag},{x},{x} MPDELE,{mp},{flag}
SECTYPE,{flag},BEAM,{shape} SECDATA,{x},{x},{x} SECOFFSET,{how},{x} SECCONTROL,{x} SDELE,{n}
ETDELE,{n} ALPHAD,{x} DMPRAT,{x} F,{nodes},FX,{x} FLST,2,{n},{flag} FITEM,2,{n} FITEM,2,-{n}
D,P51X,{label} /PREP7 /SOLU FOO,{x} P{flag}={x} A({n})={x} *SET,P{flag},{x} P{flag}=
*SET,P{flag},'UX' *GET,P{flag},NODE,0,NUM,MAX *GET,P{flag},{kind},,COUNT *GET,P{flag},NODE,{n},LOC,X
*GET,P{flag},KP,,COUNT *GET,P{flag},ACTIVE,,INT *AFUN,DEG *DIM,A,ARRAY,3 *VWRITE,P1 /COM,{x}
N,{n},{x}$E,{n},{n} {name},{x}"""
_RARE = """NSLE,{how} ESLN,{how},{flag} FINISH /POST1 SOLVE /EOF LSWRITE *EXIT *CYCLE *ENDDO *ENDIF *ELSE
/UNITS,SI NUMMRG,NODE FILL,1,3 {x} ,,,"""
_CHOICES: dict[str, tuple[str, str]] = {
    "how": ("S R A U ALL NONE INVE", "STAT X"),
    "item": ("NODE ELEM TYPE MAT REAL SEC", "LOC LIVE D"),
    "axis": ("X Y Z", "W"),
    "name": ("TIP tip C1", "NO ''"),
    "kind": ("NODE ELEM LINE", ""),
    "label": ("UX UY UZ ROTX ROTZ ALL", "TEMP UU"),
    "flag": ("0 1 2 3", "-1"),
    "system": ("0 1 2 5 11 12", "4 WP"),
    "nodes": ("ALL 1 2 3 TIP", "P P51X 999 -1 ''"),
    "et": ("188 BEAM188 BEAM4 MASS21 COMBIN14", "MPC184 SHELL181 LINK180 X"),
    "mp": ("EX DENS PRXY GXY DMPR", ""),
    "shape": ("RECT CSOLID ASEC", "I MESH"),
    "n": ("1 2 3 4 1+1", "9 11 999 P1 P2 A(1) NODE(0,0,0) 0 -2 1e9 1.5 ''"),
    "x": ("0 1 -1 2. .5 1e-3 90 SQRT(2) 2**3 (1+2)*3 MOD(5,2) 1d2", "1e300 P1 P2 A(2) NX(2) 1/0 %P1% x ''"),
}
"""Fields that commands allow, and those that some of them do not."""
_FIELD = re.compile(r"{(\w+)}")


def script(rng: random.Random) -> bytes:
    """Return a program of up to forty random commands after a small model."""
    forms = _FORMS.split()
    lines = list(_block(rng, forms, rng.randrange(1, 40), 0))
    text = rng.choice((HEAD + MODEL, HEAD + MODEL + BLOCKS, HEAD)) + "\n".join(lines) + "\n"
    if rng.random() < 0.1:
        text = text[: rng.randrange(len(text))]
    return (text.lower() if rng.random() < 0.1 else text).encode()


def _block(rng: random.Random, forms: Sequence[str], count: int, depth: int) -> list[str]:
    out: list[str] = []
    for _ in range(count):
        kind = rng.random()
        inner = _block(rng, forms, rng.randrange(4), depth + 1) if kind < 0.15 and depth < 5 else None
        if inner is None:
            out.append(_filled(rng, rng.choice(_RARE.split() if rng.random() < 0.02 else forms)))
        elif kind < 0.1:
            base = rng.choice(("THEN", "", "AND,{x},LT,2,THEN"))
            out += [
                _filled(rng, f"*IF,{{x}},{rng.choice(('EQ', 'NE', 'GT', 'ABLT'))},{{x}},{base}"),
                *inner,
            ]
            out += [_filled(rng, "*ELSEIF,{x},LE,{x}"), *inner] if rng.random() < 0.3 else []
            out += ["*ELSE", *inner] if rng.random() < 0.3 else []
            out.append("*ENDIF")
        else:
            out += [_filled(rng, "*DO,P{flag},{n},{n},{flag}"), *inner, "*ENDDO"]
    return out


def _filled(rng: random.Random, form: str) -> str:
    def field(match: re.Match[str]) -> str:
        allowed, others = _CHOICES[match[1]]
        words = (others if others and rng.random() < 0.03 else allowed).split()
        return rng.choice(words).strip("'")

    return _FIELD.sub(field, form)
