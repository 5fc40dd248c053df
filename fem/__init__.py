"""Finite-element models of frames: from a mesh to modes and frequency response functions.

    Mesh ─ effects, supports → Model ─ assemble → System (K, M, C, D) ─ solve_modes → Modes
                                                                      ─ compute_frf → FRF

Every noun is frozen and every arrow a function of its arguments alone; `with_…` gives a changed copy. SI
units, frequencies in Hz, e^{+iωt}; axes and signs are in `docs/conventions.md`. Files are read and written by
`fem.io`, and the effects that a diagnosis proposes are in `fem.effects`.
"""

from fem.effects import AddedMass, Frame, Joint, MemberProperties, PointMass, Support
from fem.frf import FRF, FRFError, FRFKind, compute_frf
from fem.mesh import Location, Mesh, MeshError
from fem.model import Constraint, Contribution, Damping, Effect, Model, ModelError, Parameter
from fem.modes import Modes, solve_modes
from fem.properties import Material, PropertyError, Section
from fem.system import System, assemble

__all__ = [
    "FRF",
    "AddedMass",
    "Constraint",
    "Contribution",
    "Damping",
    "Effect",
    "FRFError",
    "FRFKind",
    "Frame",
    "Joint",
    "Location",
    "Material",
    "MemberProperties",
    "Mesh",
    "MeshError",
    "Model",
    "ModelError",
    "Modes",
    "Parameter",
    "PointMass",
    "PropertyError",
    "Section",
    "Support",
    "System",
    "assemble",
    "compute_frf",
    "solve_modes",
]
