"""Joints whose stiffness in one direction differs from the model's.

They are softer or stiffer than the model has them, or flexible where the model has them rigid.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from fem.array_types import Floats
from fem.declarations import Entry, Marker, Relevant, Role, Site, StiffnessAt
from fem.effects.joint import Joint, joint_unit
from fem.model import DIRECTIONS, Contribution, Effect, Model, Parameter, ParameterRef


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class JointStiffness(Effect):
    """The stiffness in one direction of a joint, or of several alike, in place of the model's.

    Attributes
    ----------
    joints : tuple of str
        Names of joints of the model.
    direction : str
        One of x, y, z, rx, ry, rz.
    stiffness : float
        The new stiffness of each [N/m or N·m/rad].
    assumed : float
        The model's; ``inf`` where they are rigid [N/m or N·m/rad].
    known : tuple of str
        Effects of this kind that the model has for these joints: the last of them gives the assumed
        stiffness.
    bounds : (float, float)
        Of the stiffness [N/m or N·m/rad].
    """

    kind: ClassVar[str] = "joint_stiffness"
    role: ClassVar[Role] = Role.STIFFNESS
    marker: ClassVar[Marker | None] = Marker("diamond", "purple")
    statement: ClassVar[str] = "{thing} {are} {stiffer} {direction} than in the model"
    entry: ClassVar[Entry | None] = Entry(
        quantities="`stiffness` [N/m or N·m/rad]",
        meaning=(
            "a joint's stiffness in one direction, in place of the model's; also where the model is rigid"
        ),
        places="each direction of each joint, and of all that are alike",
    )
    connection: ClassVar[bool] = True
    joints: tuple[str, ...]
    direction: str
    stiffness: Any
    assumed: float
    known: tuple[str, ...] = ()
    bounds: tuple[float, float] = (1e-6, 1e18)

    @property
    def where(self) -> Site:
        """Joints and direction."""
        return Site(
            f"joint{'s' if len(self.joints) > 1 else ''} {', '.join(self.joints)}", detail=self.direction
        )

    def parameters(self) -> tuple[Parameter, ...]:
        """Return the stiffness."""
        unit = joint_unit(self.direction)
        words = self._share if np.isfinite(self.assumed) else None
        k = self.stiffness, self.assumed, *self.bounds
        return (Parameter("stiffness", unit, *k, log=True, linear=True, in_words=words),)

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return (k - k_assumed) b bᵀ (1 + iη) with each joint's loss factor."""
        out = []
        for name in self.joints:
            joint = model.effect(name)
            assert isinstance(joint, Joint)
            dofs, B = joint.relative(model)
            b = B[DIRECTIONS.index(self.direction)]
            k, d = self._changes(joint)
            unit = np.outer(b, b)[None]
            out.append(Contribution(dofs[None], k * unit, D=None if d is None else d * unit))
        return tuple(out)

    def _changes(self, joint: Joint) -> tuple[Any, Any]:
        """Return the changes of a joint's stiffness and of its structural damping, None for no damping."""
        k = self.stiffness - (self.assumed if np.isfinite(self.assumed) else 0.0)
        return k, joint.eta * k if joint.eta else None

    def released(self) -> tuple[tuple[str, str], ...]:
        """Return the joints' constraints in this direction, where they are rigid."""
        return () if np.isfinite(self.assumed) else tuple((name, self.direction) for name in self.joints)

    def replaces(self) -> tuple[tuple[str, str], ...]:
        """Return the joints' stiffnesses in this direction, or those of effects known for them."""
        if self.known:
            return tuple((name, "stiffness") for name in self.known)
        return (
            tuple((name, f"k{self.direction}") for name in self.joints) if np.isfinite(self.assumed) else ()
        )

    def refers_to(self, model: Model) -> tuple[ParameterRef, ...]:
        """Return the joints' loss factors."""
        return tuple((name, "eta") for name in self.joints)

    def starts(self, scale: StiffnessAt) -> tuple[dict[str, float], ...]:
        """Return values from three decades softer to two stiffer than assumed.

        For rigid joints the values lie around the stiffness of their surroundings.
        """
        if np.isfinite(self.assumed):
            return tuple({"stiffness": float(f * self.assumed)} for f in np.geomspace(1e-3, 1e2, 26))
        k = float(np.median([scale(key) for key in self.released()]))
        return tuple({"stiffness": float(f * k)} for f in np.geomspace(1e-3, 1e3, 31))

    def _share(self, stiffness: float) -> str:
        return f"{stiffness / self.assumed:.3g} of the model's"

    def relevant(self, sizes: Relevant, mass: float, scale: StiffnessAt) -> float | None:
        """Return the stiffness of a joint that lacks a relevant share of it."""
        return (
            (1 - sizes.connections) * self.assumed
            if np.isfinite(self.assumed)
            else sizes.softness(float(np.median([scale(key) for key in self.released()])))
        )

    @classmethod
    def propose(cls, model: Model) -> tuple[Effect, ...]:
        """Return each elastic or rigid direction of each joint, and of all joints where they are alike."""
        out: list[Effect] = []
        for i, d in enumerate(DIRECTIONS):
            assumed = {j.name: np.inf if d in j.rigid else float(j.K[i, i]) for j in model.of_kind(Joint)}
            assumed = {name: k for name, k in assumed.items() if k > 0}
            known = [e for e in model.of_kind(cls) if e.direction == d]
            assumed |= {name: float(np.real(e.stiffness)) for e in known for name in e.joints}
            groups = [(name,) for name in assumed]
            if len(groups) > 1 and len(set(assumed.values())) == 1:
                groups.append(tuple(assumed))
            for group in groups:
                k = assumed[group[0]]
                bounds = (1e-4 * k, 1e4 * k) if np.isfinite(k) else (1e-6, 1e18)
                start = k if np.isfinite(k) else 1e6
                name = f"joint_stiffness:{'+'.join(group)}.{d}"
                known_names = tuple(e.name for e in known if set(e.joints) & set(group))
                out.append(
                    cls(
                        name=name,
                        joints=group,
                        direction=d,
                        stiffness=start,
                        assumed=k,
                        known=known_names,
                        bounds=bounds,
                    )
                )
        return tuple(out)

    def locations(self, model: Model) -> Floats:
        """Return the joints."""
        return np.vstack([model.effect(name).locations(model) for name in self.joints])
