"""Keywords of Abaqus and CalculiX for frame models: those that are read, refused or left out."""

from typing import Final

from fem.io.abaqus_keywords import TIES
from fem.io.deck import words

BEAMS: Final = words("B31 B31R B31H B31OS B31OSH B32 B32R B32H B32OS B32OSH B21 B21H B22 B22H PIPE31 PIPE31H")
BEAMS_2: Final = words("PIPE32 PIPE32H PIPE21 PIPE21H PIPE22 PIPE22H")
SLENDER: Final = words("B33 B33H B23 B23H")
TRUSSES: Final = words("T3D2 T3D2H T3D3 T3D3H T2D2 T2D2H T2D3 T2D3H")
LINES: Final = BEAMS | BEAMS_2 | SLENDER | TRUSSES
PLANAR: Final = words("B21 B21H B22 B22H B23 B23H PIPE21 PIPE21H PIPE22 PIPE22H T2D2 T2D2H T2D3 T2D3H")
CALCULIX: Final = words("B31R B32R")
"""Element types that CalculiX alone has."""

POINTS: Final = {
    "MASS": 1,
    "ROTARYI": 1,
    "SPRING1": 1,
    "SPRING2": 2,
    "SPRINGA": 2,
    "DASHPOT1": 1,
    "DASHPOT2": 2,
    "DASHPOTA": 2,
    "CONN3D2": 2,
}
"""Element types that are no lines, and their numbers of nodes."""

SUBS: Final[dict[str, frozenset[str]]] = {
    **dict.fromkeys(("ELASTIC", "DENSITY", "DAMPING"), words("MATERIAL")),
    **dict.fromkeys(("KINEMATIC", "DISTRIBUTING"), words("COUPLING")),
    **dict.fromkeys(
        ("TRANSVERSESHEARSTIFFNESS", "CENTROID", "SHEARCENTER", "BEAMSECTIONOFFSET"),
        words("BEAMSECTION BEAMGENERALSECTION"),
    ),
}
"""Keywords that belong to one before them, and those."""

HANDLED: Final = words(
    """BEAMSECTION BEAMGENERALSECTION SOLIDSECTION MATERIAL MASS ROTARYINERTIA SPRING DASHPOT
    CONNECTORSECTION MPC EQUATION COUPLING KINEMATICCOUPLING RIGIDBODY BOUNDARY TRANSFORM ORIENTATION RELEASE
    NONSTRUCTURALMASS SURFACE GLOBALDAMPING"""
)

PROCEDURES: Final = words(
    """FREQUENCY COMPLEXFREQUENCY STEADYSTATEDYNAMICS MODALDYNAMIC RANDOMRESPONSE RESPONSESPECTRUM"""
)
"""Linear dynamic procedures: the supports of the first step with one of them are read."""

NOT_A_FRAME: Final[dict[str, str]] = {
    **dict.fromkeys(
        (*TIES, "CONTACTINCLUSIONS"),
        "connects parts in a way that is not read; write *MPC, *COUPLING, *RIGID BODY or *EQUATION",
    ),
    "FRAMESECTION": "is the section of frame elements; write beam elements with *BEAM SECTION",
    "NORMAL": "turns sections by normals at their nodes; give n1 on the second line of *BEAM SECTION",
    "MODELCHANGE": "removes or adds elements in a step; delete those that are not there",
    "MATRIXINPUT": "adds matrices of another model, which are not read",
    "MATRIXASSEMBLE": "adds matrices of another model, which are not read",
    "SUBSTRUCTUREPROPERTY": "adds a substructure, which is not read",
    "USERELEMENT": "defines elements of the user, which are not read",
    "REBAR": "adds bars of reinforcement, which are not read",
    "MASSADJUST": "changes masses; give those that result",
    "BEAMFLUIDINERTIA": "adds the mass of a fluid; give *NONSTRUCTURAL MASS",
    "FOUNDATION": "adds an elastic foundation, which is not read; give it in the study file",
}
"""Keywords that are refused, because a model without them would have other frequencies."""

LEFT_OUT: Final[dict[str, str]] = {
    "BEAMADDEDINERTIA": "its mass is missing in the model",
    "INITIALCONDITIONS": "stresses and their geometric stiffness are missing in the model",
    "MODALDAMPING": "give the damping in the study file",
    "COMPOSITEMODALDAMPING": "give the damping in the study file",
    "BASEMOTION": "give the excitation in the study file",
    "CONNECTORBEHAVIOR": "connectors are read where they are rigid",
    "FIXEDMASSSCALING": "masses are those of the materials",
    "VARIABLEMASSSCALING": "masses are those of the materials",
    "DADDEDMASS": "its mass is missing in the model",
}
"""Keywords that are named in a note with what the model lacks without them."""
