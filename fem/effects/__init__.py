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
    from fem.effects.added_mass import AddedMass as AddedMass
    from fem.effects.added_mass import PointMass as PointMass
    from fem.effects.clamp_form import ClampForm as ClampForm
    from fem.effects.crack import Crack as Crack
    from fem.effects.crack import EndRelease as EndRelease
    from fem.effects.distributed_mass import DistributedMass as DistributedMass
    from fem.effects.distributed_mass import FluidAddedMass as FluidAddedMass
    from fem.effects.foot_shift import FootShift as FootShift
    from fem.effects.foundation import Foundation as Foundation
    from fem.effects.foundation import FoundationDashpot as FoundationDashpot
    from fem.effects.ground_damper import GroundDamper as GroundDamper
    from fem.effects.ground_spring import GroundSpring as GroundSpring
    from fem.effects.instrument_form import DriverForm as DriverForm
    from fem.effects.instrument_form import SensorForm as SensorForm
    from fem.effects.instruments import DriverMass as DriverMass
    from fem.effects.instruments import SensorMass as SensorMass
    from fem.effects.instruments import Stinger as Stinger
    from fem.effects.joint import Joint as Joint
    from fem.effects.joint import PointPair as PointPair
    from fem.effects.joint_complex_stiffness import JointComplexStiffness as JointComplexStiffness
    from fem.effects.joint_coupling import JointCoupling as JointCoupling
    from fem.effects.joint_damping import JointStructuralDamping as JointStructuralDamping
    from fem.effects.joint_damping import JointViscousDamping as JointViscousDamping
    from fem.effects.joint_hole import JointHole as JointHole
    from fem.effects.joint_mass import JointInertia as JointInertia
    from fem.effects.joint_mass import JointMass as JointMass
    from fem.effects.joint_nonlinear import JointCubic as JointCubic
    from fem.effects.joint_nonlinear import JointFriction as JointFriction
    from fem.effects.joint_nonlinear import JointGap as JointGap
    from fem.effects.joint_offset import JointOffset as JointOffset
    from fem.effects.joint_patch import JointPatch as JointPatch
    from fem.effects.joint_stiffness import JointStiffness as JointStiffness
    from fem.effects.joint_viscoelastic import JointFractional as JointFractional
    from fem.effects.joint_viscoelastic import JointZener as JointZener
    from fem.effects.member_change import MemberDensity as MemberDensity
    from fem.effects.member_change import MemberStiffness as MemberStiffness
    from fem.effects.member_damping import MemberDamping as MemberDamping
    from fem.effects.member_section import MemberSection as MemberSection
    from fem.effects.member_section import MemberShear as MemberShear
    from fem.effects.member_section import MemberTorsion as MemberTorsion
    from fem.effects.moving_base import MovingBase as MovingBase
    from fem.effects.part_shift import PartShift as PartShift
    from fem.effects.plane import Plane as Plane
    from fem.effects.point_inertia import PointInertia as PointInertia
    from fem.effects.preload import Preload as Preload
    from fem.effects.prestress import Prestress as Prestress
    from fem.effects.proportional_damping import MassDamping as MassDamping
    from fem.effects.proportional_damping import StiffnessDamping as StiffnessDamping
    from fem.effects.rigid_end_zone import RigidEndZone as RigidEndZone
    from fem.effects.rigid_link import MultiPointConstraint as MultiPointConstraint
    from fem.effects.rigid_link import RigidLink as RigidLink
    from fem.effects.rotor import Rotor as Rotor
    from fem.effects.section_form import SectionForm as SectionForm
    from fem.effects.section_shear import SectionShear as SectionShear
    from fem.effects.shear_centre import ShearCentre as ShearCentre
    from fem.effects.side_spring import SideSpring as SideSpring
    from fem.effects.solid_corner import SolidCorner as SolidCorner
    from fem.effects.spin import Spin as Spin
    from fem.effects.sprung_mass import SprungMass as SprungMass
    from fem.effects.stiffness_loss import StiffnessLoss as StiffnessLoss
    from fem.effects.superelement import Superelement as Superelement
    from fem.effects.support import Support as Support
    from fem.effects.support_flexibility import SupportFlexibility as SupportFlexibility
    from fem.effects.support_shift import SupportShift as SupportShift
    from fem.effects.viscoelastic import TabulatedStiffness as TabulatedStiffness
    from fem.effects.viscoelastic import Viscoelastic as Viscoelastic
    from fem.effects.zone_form import ZoneForm as ZoneForm
    from fem.elements.frame import Frame as Frame
    from fem.elements.part_ties import Attachment as Attachment
    from fem.elements.properties import MemberProperties as MemberProperties
else:
    __getattr__, __dir__ = names_on_use(__name__)


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
