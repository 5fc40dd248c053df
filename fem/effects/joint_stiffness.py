"""A joint softer or stiffer in one direction than the model has it, or flexible where the model has it rigid."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from fem.effects.joint import Joint, joint_unit, relative_rows
from fem.model import DIRECTIONS, Contribution, Effect, Model, Parameter


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class JointStiffness(Effect):
    """The stiffness of a joint in one direction, in place of the model's.

    Attributes
    ----------
    joint : str
        Name of a joint of the model.
    direction : str
        One of x, y, z, rx, ry, rz.
    stiffness : float
        The new stiffness [N/m or N·m/rad].
    assumed : float
        The model's; ``inf`` where it is rigid [N/m or N·m/rad].
    """

    kind: ClassVar[str] = "joint_stiffness"
    joint: str
    direction: str
    stiffness: Any
    assumed: float
    bounds: tuple[float, float] = (1e-6, 1e18)

    @property
    def where(self) -> str:
        """Joint and direction."""
        return f"joint {self.joint}, {self.direction}"

    def parameters(self) -> tuple[Parameter, ...]:
        """The stiffness."""
        return (
            Parameter("stiffness", joint_unit(self.direction), self.stiffness, self.assumed, *self.bounds, log=True, linear=True),
        )

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return (k - k_assumed) b bᵀ (1 + iη) with the joint's own loss factor."""
        joint = model.effect(self.joint)
        assert isinstance(joint, Joint)
        dofs, B = relative_rows(model, joint.point1, joint.point2, joint.location)
        b = B[DIRECTIONS.index(self.direction)]
        change = self.stiffness - (self.assumed if np.isfinite(self.assumed) else 0.0)
        K = change * np.outer(b, b)
        return (Contribution(dofs[None], K[None], D=(joint.eta * K)[None] if joint.eta else None),)

    def released(self) -> tuple[tuple[str, str], ...]:
        """The joint's constraint in this direction, where it is rigid."""
        return () if np.isfinite(self.assumed) else ((self.joint, self.direction),)

    def replaces(self) -> tuple[tuple[str, str], ...]:
        """The joint's own stiffness in this direction."""
        return ((self.joint, f"k{self.direction}"),) if np.isfinite(self.assumed) else ()

    def starts(self, scale: Callable[[tuple[str, str]], float]) -> tuple[dict[str, float], ...]:
        """Three decades softer to two stiffer than assumed; for a rigid joint around the stiffness of its surroundings."""
        if np.isfinite(self.assumed):
            return tuple({"stiffness": float(f * self.assumed)} for f in np.geomspace(1e-3, 1e2, 26))
        k = scale((self.joint, self.direction))
        return tuple({"stiffness": float(f * k)} for f in np.geomspace(1e-3, 1e3, 31))

    @classmethod
    def propose(cls, model: Model) -> tuple[Effect, ...]:
        """Each direction of each joint that is elastic or rigid."""
        out = []
        for joint in model.of_kind(Joint):
            for i, d in enumerate(DIRECTIONS):
                if d in joint.rigid:
                    out.append(cls(name=f"joint_stiffness:{joint.name}.{d}", joint=joint.name, direction=d, stiffness=1e6, assumed=np.inf))
                elif joint.K[i, i] > 0:
                    k = float(joint.K[i, i])
                    out.append(
                        cls(name=f"joint_stiffness:{joint.name}.{d}", joint=joint.name, direction=d, stiffness=k, assumed=k, bounds=(1e-4 * k, 1e4 * k))
                    )
        return tuple(out)

    def locations(self, model: Model) -> NDArray[np.float64]:
        """The joint."""
        return model.effect(self.joint).locations(model)
