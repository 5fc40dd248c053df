"""Joints between substructures, by frequency based substructuring.

Receptance H(ω) = x/f, dynamic stiffness Z(ω) = f/x, e^{+iωt}; SI units, frequencies in Hz; FRF arrays are
(n_freq, n_out, n_in). Joint coordinates are `b` on the uncoupled substructures and `j` on the assembly, the
other, internal ones are `a` and `n`.

    substructures    `partition_frf`, `stack_substructures`       H_aa H_ab H_ba H_bb
    joint            `joint_impedance`, `relative_joint`          Z_j = K - ω² M + iω C + i D
    synthesis        `couple`, `decouple`                         H, Z_j  →  H_nn H_nj H_jn H_jj
    identification   `identify_joint`                             H, H_nn →  Z_j, with its condition

The equations are derived, with their sources, in `docs/theory-joint.md`.
"""

from joint.identification import (
    IdentificationError,
    JointIdentification,
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
from joint.relative import RelativeJoint, relative_coordinates, relative_joint
from joint.synthesis import AssemblyFRF, couple, decouple, joint_impedance

__all__ = [
    "AssemblyFRF",
    "CoordinateSet",
    "IdentificationError",
    "Interface",
    "JointIdentification",
    "RelativeJoint",
    "SubstructureFRF",
    "characteristic_length",
    "coordinates_of",
    "couple",
    "decouple",
    "identify_joint",
    "joint_impedance",
    "partition_frf",
    "relative_coordinates",
    "relative_joint",
    "stack_joints",
    "stack_substructures",
]
