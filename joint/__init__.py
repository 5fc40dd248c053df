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
    from joint.average import AverageIdentification, identify_average
    from joint.expansion import (
        ExpandedFRF,
        ExpansionError,
        expand_semm,
        expand_serep,
        rigid_rows,
        virtual_point,
    )
    from joint.form import FormError, JointForm, full_form, relative_form, with_masses
    from joint.identification import (
        JointIdentification,
        JointIdentificationError,
        characteristic_length,
        identify_joint,
    )
    from joint.interface import (
        CoordinateSet,
        Interface,
        SubstructureFRF,
        coordinates_of,
        partition_frf,
        stack_joints,
        stack_substructures,
    )
    from joint.joint_fit import JointFit
    from joint.output_error import fit_joint
    from joint.parts import FixedParts, ModelParts, Uncertain
    from joint.physics import LawFit, StiffnessLaw, effects_of, explain_stiffness
    from joint.relative import RelativeJoint, relative_coordinates, relative_joint
    from joint.released import ReleasedParts
    from joint.substructuring import (
        Regularisation,
        RegularisationCurve,
        Substructured,
        SubstructuringError,
        couple_frf,
        decouple_frf,
        interface_problem,
        invert_substructure,
        l_curve,
    )
    from joint.synthesis import AssemblyFRF, couple, decouple, joint_impedance
    from joint.uncertainty import Identifiability
else:
    __getattr__, __dir__ = names_on_use(__name__)

__all__ = [
    "AssemblyFRF",
    "AverageIdentification",
    "CoordinateSet",
    "ExpandedFRF",
    "ExpansionError",
    "FixedParts",
    "FormError",
    "Identifiability",
    "Interface",
    "JointFit",
    "JointForm",
    "JointIdentification",
    "JointIdentificationError",
    "LawFit",
    "ModelParts",
    "Regularisation",
    "RegularisationCurve",
    "RelativeJoint",
    "ReleasedParts",
    "StiffnessLaw",
    "SubstructureFRF",
    "Substructured",
    "SubstructuringError",
    "Uncertain",
    "characteristic_length",
    "coordinates_of",
    "couple",
    "couple_frf",
    "decouple",
    "decouple_frf",
    "effects_of",
    "expand_semm",
    "expand_serep",
    "explain_stiffness",
    "fit_joint",
    "full_form",
    "identify_average",
    "identify_joint",
    "interface_problem",
    "invert_substructure",
    "joint_impedance",
    "l_curve",
    "partition_frf",
    "relative_coordinates",
    "relative_form",
    "relative_joint",
    "rigid_rows",
    "stack_joints",
    "stack_substructures",
    "virtual_point",
    "with_masses",
]
