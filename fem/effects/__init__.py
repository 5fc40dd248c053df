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
    from fem.effects.joint import Joint, PointPair
    from fem.effects.joint_damping import JointStructuralDamping, JointViscousDamping
    from fem.effects.joint_stiffness import JointStiffness
    from fem.effects.member_change import MemberDensity, MemberStiffness
    from fem.effects.preload import Preload
    from fem.effects.prestress import Prestress
    from fem.effects.rigid_link import MultiPointConstraint, RigidLink
    from fem.effects.stiffness_loss import StiffnessLoss
    from fem.effects.superelement import Superelement
    from fem.effects.support import Support
    from fem.effects.support_flexibility import SupportFlexibility
    from fem.effects.viscoelastic import TabulatedStiffness, Viscoelastic
    from fem.elements.frame import Frame
    from fem.elements.part_ties import Attachment
    from fem.elements.properties import MemberProperties
else:
    __getattr__, __dir__ = names_on_use(__name__)

__all__ = [
    "AddedMass",
    "Attachment",
    "Frame",
    "Joint",
    "JointStiffness",
    "JointStructuralDamping",
    "JointViscousDamping",
    "MemberDensity",
    "MemberProperties",
    "MemberStiffness",
    "MultiPointConstraint",
    "PointMass",
    "PointPair",
    "Preload",
    "Prestress",
    "RigidLink",
    "StiffnessLoss",
    "Superelement",
    "Support",
    "SupportFlexibility",
    "TabulatedStiffness",
    "Viscoelastic",
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
