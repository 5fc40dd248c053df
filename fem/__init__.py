"""Finite-element models of frames: from a mesh to modes, frequency responses and static states.

    Mesh ─ effects, supports → Model ─ assemble → System (K, M, C, D) ─ solve_modes → Modes
                                                                      ─ compute_frf → FRF
                                                                      ─ solve_static → StaticSolution

Every noun is frozen and every arrow a function of its arguments alone; `with_…` gives a changed copy. SI
units, frequencies in Hz, e^{+iωt}; axes and signs are in `docs/conventions.md`. Files are read and written by
`fem.io`, and the effects that a diagnosis proposes are in `fem.effects`.

    properties            Material, Section, MemberProperties, Frame, Support, Joint, AddedMass, RigidLink,
                          MultiPointConstraint, Viscoelastic, TabulatedStiffness, Superelement, Damping
    static                solve_static, solve_second_order, prestressed, solve_buckling
    modes                 solve_modes, solve_complex_modes, solve_campbell, compute_participation,
                          compute_energies
    frequency responses   compute_frf, frf_blocks, compute_base_frf
    responses in time     Excitation, solve_transient, shock_response_spectrum, solve_spectrum, solve_random
    rotors, nonlinear     solve_unbalance; solve_one_sided, solve_steady
    derivatives           differentiate_modes, differentiate_frf
    laws of mounts        Zener, Maxwell, SpringPot, FractionalZener, FractionalKelvinVoigt, TabulatedLaw
    an effect             Effect, Contribution, Parameter, Entry, Role, … (`CONTRIBUTING.md` shows one)
    fewer coordinates     `fem.reduction`: condensation (Guyan, dynamic, IRS, SEREP, Craig-Bampton),
                          expansion, and the reduced model with exact derivatives
    checks                check_mesh, check_model
"""

from typing import TYPE_CHECKING

from fem.lazy import names_on_use

if TYPE_CHECKING:
    from fem.analysis.base_excitation import compute_base_frf
    from fem.analysis.buckling import BucklingModes, solve_buckling
    from fem.analysis.campbell import Campbell, solve_campbell
    from fem.analysis.combinations import Envelope, envelope
    from fem.analysis.complex_modes import ComplexModes, solve_complex_modes
    from fem.analysis.excitation import Excitation, TimeResponse
    from fem.analysis.frf import FRF, Accuracy, FRFError, FRFKind
    from fem.analysis.frf_solver import compute_frf, frf_blocks
    from fem.analysis.harmonic_balance import Steady, solve_steady
    from fem.analysis.initial_stress import prestressed
    from fem.analysis.loads import (
        InitialStrain,
        LineLoad,
        LoadCase,
        MemberForce,
    )
    from fem.analysis.modes import MechanismError, Modes, UnstableError, first_modes, solve_modes
    from fem.analysis.one_sided import OneSided, solve_one_sided
    from fem.analysis.participation import Energies, Participation, compute_energies, compute_participation
    from fem.analysis.random_vibration import RandomResponse, solve_random
    from fem.analysis.response_spectrum import SpectrumResponse, solve_spectrum
    from fem.analysis.second_order import SecondOrder, solve_second_order
    from fem.analysis.section_stress import SectionStresses, section_stresses
    from fem.analysis.selection import dof_vectors
    from fem.analysis.shock_spectrum import pseudo_acceleration_spectrum, shock_response_spectrum
    from fem.analysis.static_cases import StaticCases
    from fem.analysis.statics import StaticSolution, solve_static
    from fem.analysis.tabulated import Tabulated
    from fem.analysis.transient import solve_transient
    from fem.analysis.unbalance import Unbalance, UnbalanceResponse, solve_unbalance
    from fem.checks import Defect, check_mesh, check_model
    from fem.connection_damping import ConnectionDamping
    from fem.declarations import Entry, Environment, Marker, Relevant, Role
    from fem.effects import (
        AddedMass,
        Attachment,
        Frame,
        Joint,
        MemberProperties,
        MultiPointConstraint,
        PointMass,
        RigidLink,
        Superelement,
        Support,
        TabulatedStiffness,
        Viscoelastic,
    )
    from fem.laws import FractionalKelvinVoigt, FractionalZener, Maxwell, SpringPot, TabulatedLaw, Zener
    from fem.linalg.solvers import SingularMatrixError, SolverError
    from fem.materials import Material, PropertyError
    from fem.matrices import Matrices
    from fem.mesh import Location, Mesh, MeshError, MeshWarning
    from fem.model import (
        DIRECTIONS,
        Constraint,
        Contribution,
        Damping,
        Effect,
        Model,
        ModelError,
        Parameter,
        dofs_of,
        lever_matrix,
        parameter_values,
    )
    from fem.reduction.condensation import Reduction
    from fem.reduction.expansion import Expansion
    from fem.sections.section import Section
    from fem.sensitivity.frf import FRFSensitivity, differentiate_frf
    from fem.sensitivity.modes import ModeSensitivity, differentiate_modes
    from fem.system import System, assemble, reassemble, sum_contributions
else:
    __getattr__, __dir__ = names_on_use(__name__)

__all__ = [
    "DIRECTIONS",
    "FRF",
    "Accuracy",
    "AddedMass",
    "Attachment",
    "BucklingModes",
    "Campbell",
    "ComplexModes",
    "ConnectionDamping",
    "Constraint",
    "Contribution",
    "Damping",
    "Defect",
    "Effect",
    "Energies",
    "Entry",
    "Envelope",
    "Environment",
    "Excitation",
    "Expansion",
    "FRFError",
    "FRFKind",
    "FRFSensitivity",
    "FractionalKelvinVoigt",
    "FractionalZener",
    "Frame",
    "InitialStrain",
    "Joint",
    "LineLoad",
    "LoadCase",
    "Location",
    "Marker",
    "Material",
    "Matrices",
    "Maxwell",
    "MechanismError",
    "MemberForce",
    "MemberProperties",
    "Mesh",
    "MeshError",
    "MeshWarning",
    "ModeSensitivity",
    "Model",
    "ModelError",
    "Modes",
    "MultiPointConstraint",
    "OneSided",
    "Parameter",
    "Participation",
    "PointMass",
    "PropertyError",
    "RandomResponse",
    "Reduction",
    "Relevant",
    "RigidLink",
    "Role",
    "SecondOrder",
    "Section",
    "SectionStresses",
    "SingularMatrixError",
    "SolverError",
    "SpectrumResponse",
    "SpringPot",
    "StaticCases",
    "StaticSolution",
    "Steady",
    "Superelement",
    "Support",
    "System",
    "Tabulated",
    "TabulatedLaw",
    "TabulatedStiffness",
    "TimeResponse",
    "Unbalance",
    "UnbalanceResponse",
    "UnstableError",
    "Viscoelastic",
    "Zener",
    "assemble",
    "check_mesh",
    "check_model",
    "compute_base_frf",
    "compute_energies",
    "compute_frf",
    "compute_participation",
    "differentiate_frf",
    "differentiate_modes",
    "dof_vectors",
    "dofs_of",
    "envelope",
    "first_modes",
    "frf_blocks",
    "lever_matrix",
    "parameter_values",
    "prestressed",
    "pseudo_acceleration_spectrum",
    "reassemble",
    "section_stresses",
    "shock_response_spectrum",
    "solve_buckling",
    "solve_campbell",
    "solve_complex_modes",
    "solve_modes",
    "solve_one_sided",
    "solve_random",
    "solve_second_order",
    "solve_spectrum",
    "solve_static",
    "solve_steady",
    "solve_transient",
    "solve_unbalance",
    "sum_contributions",
]
