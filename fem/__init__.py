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
    from fem.analysis.base_excitation import compute_base_frf as compute_base_frf
    from fem.analysis.buckling import BucklingModes as BucklingModes
    from fem.analysis.buckling import solve_buckling as solve_buckling
    from fem.analysis.campbell import Campbell as Campbell
    from fem.analysis.campbell import solve_campbell as solve_campbell
    from fem.analysis.combinations import Envelope as Envelope
    from fem.analysis.combinations import envelope as envelope
    from fem.analysis.complex_modes import ComplexModes as ComplexModes
    from fem.analysis.complex_modes import solve_complex_modes as solve_complex_modes
    from fem.analysis.excitation import Excitation as Excitation
    from fem.analysis.excitation import TimeResponse as TimeResponse
    from fem.analysis.frf import FRF as FRF
    from fem.analysis.frf import Accuracy as Accuracy
    from fem.analysis.frf import FRFError as FRFError
    from fem.analysis.frf import FRFKind as FRFKind
    from fem.analysis.frf_solver import compute_frf as compute_frf
    from fem.analysis.frf_solver import frf_blocks as frf_blocks
    from fem.analysis.harmonic_balance import Steady as Steady
    from fem.analysis.harmonic_balance import solve_steady as solve_steady
    from fem.analysis.initial_stress import prestressed as prestressed
    from fem.analysis.loads import InitialStrain as InitialStrain
    from fem.analysis.loads import LineLoad as LineLoad
    from fem.analysis.loads import LoadCase as LoadCase
    from fem.analysis.loads import MemberForce as MemberForce
    from fem.analysis.modes import MechanismError as MechanismError
    from fem.analysis.modes import Modes as Modes
    from fem.analysis.modes import UnstableError as UnstableError
    from fem.analysis.modes import first_modes as first_modes
    from fem.analysis.modes import solve_modes as solve_modes
    from fem.analysis.one_sided import OneSided as OneSided
    from fem.analysis.one_sided import solve_one_sided as solve_one_sided
    from fem.analysis.participation import Energies as Energies
    from fem.analysis.participation import Participation as Participation
    from fem.analysis.participation import compute_energies as compute_energies
    from fem.analysis.participation import compute_participation as compute_participation
    from fem.analysis.random_vibration import RandomResponse as RandomResponse
    from fem.analysis.random_vibration import solve_random as solve_random
    from fem.analysis.response_spectrum import SpectrumResponse as SpectrumResponse
    from fem.analysis.response_spectrum import solve_spectrum as solve_spectrum
    from fem.analysis.second_order import SecondOrder as SecondOrder
    from fem.analysis.second_order import solve_second_order as solve_second_order
    from fem.analysis.selection import dof_vectors as dof_vectors
    from fem.analysis.shock_spectrum import pseudo_acceleration_spectrum as pseudo_acceleration_spectrum
    from fem.analysis.shock_spectrum import shock_response_spectrum as shock_response_spectrum
    from fem.analysis.static_cases import StaticCases as StaticCases
    from fem.analysis.statics import StaticSolution as StaticSolution
    from fem.analysis.statics import solve_static as solve_static
    from fem.analysis.stations import SectionStresses as SectionStresses
    from fem.analysis.stations import section_stresses as section_stresses
    from fem.analysis.tabulated import Tabulated as Tabulated
    from fem.analysis.transient import solve_transient as solve_transient
    from fem.analysis.unbalance import Unbalance as Unbalance
    from fem.analysis.unbalance import UnbalanceResponse as UnbalanceResponse
    from fem.analysis.unbalance import solve_unbalance as solve_unbalance
    from fem.checks import Defect as Defect
    from fem.checks import check_mesh as check_mesh
    from fem.checks import check_model as check_model
    from fem.connection_damping import ConnectionDamping as ConnectionDamping
    from fem.declarations import Entry as Entry
    from fem.declarations import Environment as Environment
    from fem.declarations import Marker as Marker
    from fem.declarations import Relevant as Relevant
    from fem.declarations import Role as Role
    from fem.effects import AddedMass as AddedMass
    from fem.effects import Attachment as Attachment
    from fem.effects import Frame as Frame
    from fem.effects import Joint as Joint
    from fem.effects import MemberProperties as MemberProperties
    from fem.effects import MultiPointConstraint as MultiPointConstraint
    from fem.effects import PointMass as PointMass
    from fem.effects import RigidLink as RigidLink
    from fem.effects import Superelement as Superelement
    from fem.effects import Support as Support
    from fem.effects import TabulatedStiffness as TabulatedStiffness
    from fem.effects import Viscoelastic as Viscoelastic
    from fem.laws import FractionalKelvinVoigt as FractionalKelvinVoigt
    from fem.laws import FractionalZener as FractionalZener
    from fem.laws import Maxwell as Maxwell
    from fem.laws import SpringPot as SpringPot
    from fem.laws import TabulatedLaw as TabulatedLaw
    from fem.laws import Zener as Zener
    from fem.linalg.solvers import SingularMatrixError as SingularMatrixError
    from fem.linalg.solvers import SolverError as SolverError
    from fem.materials import Material as Material
    from fem.materials import PropertyError as PropertyError
    from fem.matrices import Matrices as Matrices
    from fem.mesh import Location as Location
    from fem.mesh import Mesh as Mesh
    from fem.mesh import MeshError as MeshError
    from fem.mesh import MeshWarning as MeshWarning
    from fem.model import DIRECTIONS as DIRECTIONS
    from fem.model import Constraint as Constraint
    from fem.model import Contribution as Contribution
    from fem.model import Damping as Damping
    from fem.model import Effect as Effect
    from fem.model import Model as Model
    from fem.model import ModelError as ModelError
    from fem.model import Parameter as Parameter
    from fem.model import dofs_of as dofs_of
    from fem.model import lever_matrix as lever_matrix
    from fem.model import parameter_values as parameter_values
    from fem.reduction.condensation import Reduction as Reduction
    from fem.reduction.expansion import Expansion as Expansion
    from fem.sections.section import Section as Section
    from fem.sensitivity.frf import FRFSensitivity as FRFSensitivity
    from fem.sensitivity.frf import differentiate_frf as differentiate_frf
    from fem.sensitivity.modes import ModeSensitivity as ModeSensitivity
    from fem.sensitivity.modes import differentiate_modes as differentiate_modes
    from fem.system import System as System
    from fem.system import assemble as assemble
    from fem.system import reassemble as reassemble
    from fem.system import sum_contributions as sum_contributions
else:
    __getattr__, __dir__ = names_on_use(__name__)
