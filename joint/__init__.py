"""Joints between substructures, by frequency based substructuring.

Receptance H(ω) = x/f, dynamic stiffness Z(ω) = f/x, e^{+iωt}; SI units, frequencies in Hz; FRF arrays are
(n_freq, n_out, n_in). Joint coordinates are `b` on the uncoupled substructures and `j` on the assembly, the
other, internal ones are `a` and `n`.

    substructures    `partition_frf`, `stack_substructures`       H_aa H_ab H_ba H_bb
    rotations        `virtual_point`, `expand_serep`, `expand_semm`
    joint            `joint_impedance`, `relative_joint`          Z_j = K - ω² M + iω C + i D
    synthesis        `couple`, `decouple`                         H, Z_j  →  H_nn H_nj H_jn H_jj
    identification   `identify_joint`                             H, H_nn →  Z_j, line by line
                     `identify_average` with a `JointForm`        H, H_nn →  K, M, C, D from all lines
                     `fit_joint`                                  the same from noisy data, with uncertainty
    physics          `explain_stiffness`, `effects_of`            Z_j(ω)  →  laws, and effects of a model
    labelled FRFs    `couple_frf`, `decouple_frf`, `invert_substructure` (LM-FBS)
    regularisation   `Regularisation`, `interface_problem`, `l_curve`

The equations are derived, with their sources, in `docs/theory-joint.md`.
"""

from typing import TYPE_CHECKING

from fem.lazy import names_on_use

if TYPE_CHECKING:
    from joint.average import AverageIdentification as AverageIdentification
    from joint.average import identify_average as identify_average
    from joint.expansion import ExpandedFRF as ExpandedFRF
    from joint.expansion import ExpansionError as ExpansionError
    from joint.expansion import expand_semm as expand_semm
    from joint.expansion import expand_serep as expand_serep
    from joint.expansion import rigid_rows as rigid_rows
    from joint.expansion import virtual_point as virtual_point
    from joint.form import FormError as FormError
    from joint.form import JointForm as JointForm
    from joint.form import full_form as full_form
    from joint.form import relative_form as relative_form
    from joint.form import with_masses as with_masses
    from joint.identification import JointIdentification as JointIdentification
    from joint.identification import JointIdentificationError as JointIdentificationError
    from joint.identification import characteristic_length as characteristic_length
    from joint.identification import identify_joint as identify_joint
    from joint.interface import CoordinateSet as CoordinateSet
    from joint.interface import Interface as Interface
    from joint.interface import SubstructureFRF as SubstructureFRF
    from joint.interface import coordinates_of as coordinates_of
    from joint.interface import partition_frf as partition_frf
    from joint.interface import stack_joints as stack_joints
    from joint.interface import stack_substructures as stack_substructures
    from joint.joint_fit import Identifiability as Identifiability
    from joint.joint_fit import JointFit as JointFit
    from joint.output_error import fit_joint as fit_joint
    from joint.parts import FixedParts as FixedParts
    from joint.parts import ModelParts as ModelParts
    from joint.parts import ReleasedParts as ReleasedParts
    from joint.parts import Uncertain as Uncertain
    from joint.physics import LawFit as LawFit
    from joint.physics import StiffnessLaw as StiffnessLaw
    from joint.physics import effects_of as effects_of
    from joint.physics import explain_stiffness as explain_stiffness
    from joint.relative import RelativeJoint as RelativeJoint
    from joint.relative import relative_coordinates as relative_coordinates
    from joint.relative import relative_joint as relative_joint
    from joint.substructuring import AssemblyFRF as AssemblyFRF
    from joint.substructuring import Regularisation as Regularisation
    from joint.substructuring import RegularisationCurve as RegularisationCurve
    from joint.substructuring import Substructured as Substructured
    from joint.substructuring import SubstructuringError as SubstructuringError
    from joint.substructuring import couple as couple
    from joint.substructuring import couple_frf as couple_frf
    from joint.substructuring import decouple as decouple
    from joint.substructuring import decouple_frf as decouple_frf
    from joint.substructuring import interface_problem as interface_problem
    from joint.substructuring import invert_substructure as invert_substructure
    from joint.substructuring import joint_impedance as joint_impedance
    from joint.substructuring import l_curve as l_curve
else:
    __getattr__, __dir__ = names_on_use(__name__)
