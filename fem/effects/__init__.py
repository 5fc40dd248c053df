"""Physical effects, one file each.

A file that defines a subclass of :class:`fem.model.Effect` with ``propose`` adds a kind of candidate to every
diagnosis; no other code has to be changed. `CONTRIBUTING.md` shows one.
"""

import importlib
import pkgutil
from functools import cache
from typing import TYPE_CHECKING

from fem.lazy import names_on_use
from fem.model import Effect

if TYPE_CHECKING:
    from fem.effects.added_mass import AddedMass, PointMass
    from fem.effects.clamp_form import ClampForm
    from fem.effects.crack import Crack, EndRelease
    from fem.effects.distributed_mass import DistributedMass, FluidAddedMass
    from fem.effects.foot_shift import FootShift
    from fem.effects.foundation import Foundation, FoundationDashpot
    from fem.effects.ground_damper import GroundDamper
    from fem.effects.ground_spring import GroundSpring
    from fem.effects.instrument_form import DriverForm, SensorForm
    from fem.effects.instruments import DriverMass, SensorMass, Stinger
    from fem.effects.joint import Joint, PointPair
    from fem.effects.joint_complex_stiffness import JointComplexStiffness
    from fem.effects.joint_coupling import JointCoupling
    from fem.effects.joint_damping import JointStructuralDamping, JointViscousDamping
    from fem.effects.joint_hole import JointHole
    from fem.effects.joint_mass import JointInertia, JointMass
    from fem.effects.joint_nonlinear import JointCubic, JointFriction, JointGap
    from fem.effects.joint_offset import JointOffset
    from fem.effects.joint_patch import JointPatch
    from fem.effects.joint_stiffness import JointStiffness
    from fem.effects.joint_viscoelastic import JointFractional, JointZener
    from fem.effects.member_change import MemberDensity, MemberStiffness
    from fem.effects.member_damping import MemberDamping
    from fem.effects.member_section import MemberSection, MemberShear, MemberTorsion
    from fem.effects.moving_base import MovingBase
    from fem.effects.part_shift import PartShift
    from fem.effects.plane import Plane
    from fem.effects.point_inertia import PointInertia
    from fem.effects.preload import Preload
    from fem.effects.prestress import Prestress
    from fem.effects.proportional_damping import MassDamping, StiffnessDamping
    from fem.effects.rigid_end_zone import RigidEndZone
    from fem.effects.rigid_link import MultiPointConstraint, RigidLink
    from fem.effects.rotor import Rotor
    from fem.effects.section_form import SectionForm
    from fem.effects.section_shear import SectionShear
    from fem.effects.shear_centre import ShearCentre
    from fem.effects.side_spring import SideSpring
    from fem.effects.solid_corner import SolidCorner
    from fem.effects.spin import Spin
    from fem.effects.sprung_mass import SprungMass
    from fem.effects.stiffness_loss import StiffnessLoss
    from fem.effects.superelement import Superelement
    from fem.effects.support import Support
    from fem.effects.support_flexibility import SupportFlexibility
    from fem.effects.support_shift import SupportShift
    from fem.effects.viscoelastic import TabulatedStiffness, Viscoelastic
    from fem.effects.zone_form import ZoneForm
    from fem.elements.frame import Frame
    from fem.elements.part_ties import Attachment
    from fem.elements.properties import MemberProperties
else:
    __getattr__, __dir__ = names_on_use(__name__)

__all__ = [
    "AddedMass",
    "Attachment",
    "ClampForm",
    "Crack",
    "DistributedMass",
    "DriverForm",
    "DriverMass",
    "EndRelease",
    "FluidAddedMass",
    "FootShift",
    "Foundation",
    "FoundationDashpot",
    "Frame",
    "GroundDamper",
    "GroundSpring",
    "Joint",
    "JointComplexStiffness",
    "JointCoupling",
    "JointCubic",
    "JointFractional",
    "JointFriction",
    "JointGap",
    "JointHole",
    "JointInertia",
    "JointMass",
    "JointOffset",
    "JointPatch",
    "JointStiffness",
    "JointStructuralDamping",
    "JointViscousDamping",
    "JointZener",
    "MassDamping",
    "MemberDamping",
    "MemberDensity",
    "MemberProperties",
    "MemberSection",
    "MemberShear",
    "MemberStiffness",
    "MemberTorsion",
    "MovingBase",
    "MultiPointConstraint",
    "PartShift",
    "Plane",
    "PointInertia",
    "PointMass",
    "PointPair",
    "Preload",
    "Prestress",
    "RigidEndZone",
    "RigidLink",
    "Rotor",
    "SectionForm",
    "SectionShear",
    "SensorForm",
    "SensorMass",
    "ShearCentre",
    "SideSpring",
    "SolidCorner",
    "Spin",
    "SprungMass",
    "StiffnessDamping",
    "StiffnessLoss",
    "Stinger",
    "Superelement",
    "Support",
    "SupportFlexibility",
    "SupportShift",
    "TabulatedStiffness",
    "Viscoelastic",
    "ZoneForm",
    "candidate_kinds",
    "effect_classes",
]


def effect_classes() -> dict[str, type[Effect]]:
    """Return every effect class by its kind, from all modules of this package."""
    return dict(_classes_in(tuple(__path__)))


@cache  # a diagnosis or a page asks thousands of times, and each look at the folders takes a millisecond
def _classes_in(folders: tuple[str, ...]) -> dict[str, type[Effect]]:
    out: dict[str, type[Effect]] = {}
    for info in pkgutil.iter_modules(folders):
        module = importlib.import_module(f"{__name__}.{info.name}")
        for cls in vars(module).values():
            local = isinstance(cls, type) and issubclass(cls, Effect) and cls.__module__ == module.__name__
            if local and "kind" in vars(cls):
                out[cls.kind] = cls
    return dict(sorted(out.items()))


def candidate_kinds() -> tuple[str, ...]:
    """Return the kinds of effect that propose candidates, for a model or for a test on it."""
    inherited = Effect.propose.__func__
    return tuple(kind for kind, cls in effect_classes().items() if cls.propose.__func__ is not inherited)
