"""Tables of Abaqus' and CalculiX' keywords that are read, refused, named or harmless.

Keywords are without blanks and hyphens (``*PRE-TENSION SECTION``), parameters without blanks. A keyword that
is in no table is counted by name in a note; a parameter of a keyword that is read, but is not in its list, is
an error.
"""

import re
from typing import Final

from fem.io.deck import words

_SET = "GENERATE INSTANCE INTERNAL UNSORTED INPUT"
_READ: Final = {
    "NODE": "NSET SYSTEM INPUT",
    "ELEMENT": "TYPE ELSET INPUT",
    "NSET": f"NSET ELSET {_SET}",
    "ELSET": f"ELSET {_SET}",
    "SYSTEM": "",
    "NGEN": "NSET LINE SYSTEM",
    "NFILL": "NSET BIAS",
    "NCOPY": "CHANGENUMBER OLDSET NEWSET SHIFT REFLECT MULTIPLE",
    "ELGEN": "ELSET ALLNODES",
    "ELCOPY": "ELEMENTSHIFT OLDSET SHIFTNODES NEWSET REFLECT",
    "PART": "NAME",
    "ENDPART": "",
    "ASSEMBLY": "NAME",
    "ENDASSEMBLY": "",
    "INSTANCE": "NAME PART",
    "ENDINSTANCE": "",
    "INCLUDE": "INPUT",
}
READ: Final[dict[str, frozenset[str]]] = {key: words(options) for key, options in _READ.items()}
"""Keywords that are applied, with the parameters that are."""

REFUSED: Final[dict[str, str]] = {
    "NMAP": "moves nodes to another coordinate system",
    "IMPERFECTION": "moves nodes by the results of another analysis",
    "IMPORT": "takes the mesh from another analysis",
    "IMPORTELSET": "takes sets from another analysis",
    "IMPORTNSET": "takes sets from another analysis",
    "PARAMETERSHAPEVARIATION": "moves nodes",
    "SYMMETRICMODELGENERATION": "makes nodes and elements of another analysis",
    "SUBSTRUCTUREPATH": "makes nodes and elements of a substructure",
    "MAPNODES": "moves nodes",
}
"""Keywords that make or move nodes in a way that is not read."""

_CONNECTION = "tie the places with [[rigid_links]], [[joints]] or [[constraints]] in the study file"
_OFFSET = "give the members offset1 and offset2 in the study file"

TIES: Final = words(
    """TIE DISTRIBUTINGCOUPLING EMBEDDEDELEMENT SHELLTOSOLIDCOUPLING FASTENER CYCLICSYMMETRYMODEL
    MULTIPOINTCONSTRAINT NETWORKMPC CONTACTPAIR CONTACT PRETENSIONSECTION"""
)
"""Keywords that connect parts, and are read neither with a mesh nor with a frame."""

NAMED: Final[dict[str, str]] = {
    "RELEASE": "give the members release1 or release2 in the study file",
    "CENTROID": _OFFSET,
    "SHEARCENTER": _OFFSET,
    "TRANSFORM": "it turns the directions of loads and results; positions stay",
    "BOUNDARY": "give [[supports]] in the study file",
    "BASEMOTION": "give [[excitations]] in the study file",
    "MODELCHANGE": "elements that a step removes are read",
    "NONSTRUCTURALMASS": "give [[masses]] in the study file",
    **dict.fromkeys(TIES | words("MPC EQUATION COUPLING KINEMATICCOUPLING RIGIDBODY"), _CONNECTION),
}
"""Keywords that are left out, each with its remedy; a note counts them."""

SECTIONS: Final = words("BEAMSECTION BEAMGENERALSECTION FRAMESECTION")
"""Keywords whose section, orientation and material come from the study file. A note says where they move the
axis off the nodes."""

BLANK_LINES: Final = words("BEAMSECTION BEAMGENERALSECTION")
"""Keywords of which a blank data line stands for the default, and is not passed over."""

CENTRED: Final = words("RECT BOX CIRC PIPE THICKPIPE ELLIPTICAL HEX GENERAL MESHED")
"""Sections whose centroid is at the node."""

HARMLESS: Final = words(
    """
    ACOUSTICFLOWVELOCITY ACOUSTICMEDIUM ACTIVATEELEMENTS AMPLITUDE ANISOTROPICHYPERELASTIC ANNEAL
    AXIALFORCE AXIALSTRESS BEAMADDEDINERTIA BEAMFLUIDINERTIA BRITTLECRACKING BUCKLE CAPACITY CFILM CFLOW
    CFLUX CHANGEFRICTION CHANGEMATERIAL CHANGESOLIDSECTION CHANGESURFACEBEHAVIOR CLEARANCE CLOAD
    COHESIVEBEHAVIOR COHESIVESECTION COMBINATORIALRULE COMPLEXFREQUENCY COMPOSITEDAMPING
    COMPOSITEMODALDAMPING CONCRETE CONDUCTIVITY CONNECTORBEHAVIOR CONNECTORCONSTITUTIVEREFERENCE
    CONNECTORDAMPING CONNECTORELASTICITY CONNECTORFRICTION CONNECTORLOCK CONNECTORMOTION
    CONNECTORPLASTICITY CONNECTORSECTION CONNECTORSTOP CONTACTCONTROLS CONTACTDAMPING CONTACTFILE
    CONTACTFORMULATION CONTACTINCLUSIONS CONTACTINITIALIZATION CONTACTINITIALIZATIONASSIGNMENT
    CONTACTINITIALIZATIONDATA CONTACTINTERFERENCE CONTACTOUTPUT CONTACTPRINT CONTACTPROPERTYASSIGNMENT
    CONTACTSTABILIZATION CONTROLS CORRELATION COUPLEDTEMPERATUREDISPLACEMENT CRADIATE CREEP
    DAMAGEEVOLUTION DAMAGEINITIATION DAMAGESTABILIZATION DAMPING DAMPINGCONTROLS DASHPOT
    DEFORMATIONPLASTICITY DENSITY DEPVAR DESIGNRESPONSE DESIGNVARIABLES DFLOW DFLUX DIAGNOSTICS
    DIRECTCYCLIC DISPLAYBODY DISTRIBUTING DISTRIBUTION DISTRIBUTIONTABLE DLOAD DRAGCHAIN DRUCKERPRAGER
    DSA DSFLUX DSLOAD DYNAMIC ELASTIC ELECTRICALCONDUCTIVITY ELECTROMAGNETICS ELEMENTMATRIXOUTPUT
    ELEMENTOUTPUT ELEMENTRESPONSE ELFILE ELPRINT ELSETPRINT ENDLOADCASE ENDSTEP ENERGYFILE ENERGYOUTPUT
    ENERGYPRINT EXPANSION EXTREMEELEMENTVALUE EXTREMENODEVALUE EXTREMEVALUE FACEPRINT FIELD FIELDOUTPUT
    FILEFORMAT FILEOUTPUT FILM FILMPROPERTY FILTER FLUIDCONSTANTS FLUIDSECTION FREQUENCY FRICTION GAP
    GAPCONDUCTANCE GAPHEATGENERATION GASKETSECTION GEOSTATIC GREEN HEADING HEATTRANSFER HISTORYOUTPUT
    HOURGLASSSTIFFNESS HYPERELASTIC HYPERFOAM INCIDENTWAVE INELASTICHEATFRACTION INERTIARELIEF
    INITIALCONDITIONS INITIALSTRAININCREASE INTEGRATEDOUTPUT INTEGRATEDOUTPUTSECTION JOINT
    JOINTELASTICITY KINEMATIC LATENTHEAT LOADCASE MAGNETICPERMEABILITY MASS MASSADJUST MASSFLOW
    MASSFLOWRATE MASSSCALING MATERIAL MATRIXASSEMBLE MATRIXGENERATE MATRIXINPUT MATRIXOUTPUT
    MEMBRANESECTION MODALDAMPING MODALDYNAMIC MODALFILE MODALOUTPUT MODALPRINT MODELSUBSPACE MOHRCOULOMB
    MONITOR MULLINSEFFECT NOANALYSIS NOCOMPRESSION NODALENERGYRATE NODALTHICKNESS NODEFILE NODEOUTPUT
    NODEPRINT NODERESPONSE NORMAL NOTENSION OBJECTIVE ORIENTATION OUTPUT PARAMETER PARAMETERDEPENDENCE
    PERMEABILITY PERMEANCE PHYSICALCONSTANTS PLASTIC PLASTICAXIAL PLASTICM1 PLASTICM2 PLASTICTORQUE
    POISSON PREPRINT PRESSUREPENETRATION PRESTRESSHOLD PSDDEFINITION RADIATE RADIATIONVIEWFACTOR
    RANDOMRESPONSE RATEDEPENDENT REBAR REBARLAYER REFINEMESH REFLECTION RESPONSESPECTRUM RESTART
    RETAINEDNODALDOFS RIGIDSURFACE ROBUSTDESIGN ROTARYINERTIA SECTIONCONTROLS SECTIONFILE SECTIONORIGIN
    SECTIONPOINTS SECTIONPRINT SELECTCYCLICSYMMETRYMODES SELECTEIGENMODES SENSITIVITY SFILM SFLOW
    SHELLGENERALSECTION SHELLSECTION SOLIDSECTION SOLUBILITY SPECIFICGASCONSTANT SPECIFICHEAT SPECTRUM
    SPRING SRADIATE STATIC STEADYSTATEDYNAMICS STEADYSTATETRANSPORT STEP STRINGER SUBMODEL
    SUBSTRUCTUREGENERATE SURFACE SURFACEBEHAVIOR SURFACEINTERACTION SURFACEPROPERTYASSIGNMENT
    SURFACESECTION SURFACESMOOTHING TEMPERATURE THERMALEXPANSION TIMEPOINTS TORQUE TORQUEPRINT TRACER
    TRANSFORMF TRANSVERSESHEAR TRANSVERSESHEARSTIFFNESS UNCOUPLEDTEMPERATUREDISPLACEMENT
    USERDEFINEDFIELD USERMATERIAL USEROUTPUTVARIABLES VALUESATINFINITY VARIABLEMASSSCALING VIEWFACTOR
    VISCO VISCOELASTIC VISCOSITY VISCOUS WAVE WIND
    """
)
"""Materials, properties, loads, steps and output: the study file gives those that are needed."""

_TWO_NODES = re.compile(r"(B2[13]|B3[13]|T[23]D2|PIPE[23]1|FRAME[23]D|ELBOW31|BEAM|TRUSS)(OS)?[HRTEBC]{0,2}")
_THREE_NODES = re.compile(r"(B[23]2|T[23]D3|PIPE[23]2|ELBOW32)(OS)?[HRTEBC]{0,2}")
_NO_ORIENTATION = re.compile(r"T[23]D|TRUSS")


def nodes_of(kind: str) -> tuple[int, int]:
    """Return the number of nodes of a line's element type, 0 for other types, and of those that may follow.

    A further node of a beam gives the orientation of its section.
    """
    count = 3 if _THREE_NODES.fullmatch(kind) else 2 if _TWO_NODES.fullmatch(kind) else 0
    return count, 0 if _NO_ORIENTATION.match(kind) else 1


# Keywords of Abaqus and CalculiX for frame models: those that are read, refused or left out -----------------


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
