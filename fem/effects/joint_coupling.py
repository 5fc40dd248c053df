"""A joint in which the motions of two directions are coupled."""

from dataclasses import dataclass
from itertools import combinations
from typing import Any, ClassVar

import numpy as np

from fem.declarations import Entry, Role, Site, StiffnessAt
from fem.effects.joint import Joint
from fem.effects.places import OnJoint
from fem.model import DIRECTIONS, Contribution, Effect, Model, Parameter, ParameterRef


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class JointCoupling(OnJoint):
    """An off-diagonal entry of a joint's stiffness: k_ij = coupling · √(k_ii k_jj).

    ΔK = coupling √(k_ii k_jj) (b_i b_jᵀ + b_j b_iᵀ), with the joint's loss factor. Within its bounds the
    joint's stiffness matrix stays positive definite. An eccentric joint couples x with ry and rz and so on:
    ``joint_offset`` is its twin there.

    Attributes
    ----------
    joint : str
        Name of a joint.
    first, second : str
        Two of its elastic directions.
    coupling : float
        k_ij / √(k_ii k_jj) beyond the model's [-].
    scale : float
        √(k_ii k_jj) of the model [N/m, N, N·m/rad].
    bounds : (float, float)
        Of the coupling [-].
    """

    kind: ClassVar[str] = "joint_coupling"
    role: ClassVar[Role] = Role.STIFFNESS
    entry: ClassVar[Entry | None] = Entry(
        quantities="`coupling` [-]",
        meaning=("an off-diagonal entry of a joint's stiffness, in multiples of √(k_ii k_jj)"),
        places="each pair of elastic directions of each joint",
    )
    first: str
    second: str
    coupling: Any
    scale: float
    bounds: tuple[float, float] = (-0.95, 0.95)

    @property
    def where(self) -> Site:
        """Joint and directions."""
        return Site(f"joint {self.joint}", detail=f"{self.first} with {self.second}")

    def parameters(self) -> tuple[Parameter, ...]:
        """Return the coupling."""
        return (Parameter("coupling", "-", self.coupling, 0.0, *self.bounds, linear=True),)

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return ΔK, and η ΔK with the joint's loss factor."""
        joint = self.of(model)
        dofs, a = self.strain(model, self.first)
        _, b = self.strain(model, self.second)
        K = self.coupling * _scale(joint, self.first, self.second) * (np.outer(a, b) + np.outer(b, a))
        return (Contribution(dofs[None], K[None], D=(joint.eta * K)[None] if joint.eta else None),)

    def refers_to(self, model: Model) -> tuple[ParameterRef, ...]:
        """Return the joint's stiffnesses in the two directions and its loss factor."""
        return tuple((self.joint, name) for name in (f"k{self.first}", f"k{self.second}", "eta"))

    def starts(self, scale: StiffnessAt) -> tuple[dict[str, float], ...]:
        """Ten values within the bounds."""
        low, high = self.bounds
        shares = (0.015, 0.06, 0.2, 0.5, 0.9)
        return tuple({"coupling": f * reach} for reach in (low, high) for f in shares)

    @classmethod
    def propose(cls, model: Model) -> tuple[Effect, ...]:
        """Each pair of elastic directions of each joint."""
        return tuple(
            cls(
                name=f"joint_coupling:{j.name}.{p}-{q}",
                joint=j.name,
                first=p,
                second=q,
                coupling=0.0,
                scale=_scale(j, p, q),
                bounds=_bounds(j, p, q),
            )
            for j in model.of_kind(Joint)
            for p, q in combinations(j.elastic, 2)
        )


def _scale(joint: Joint, first: str, second: str) -> Any:
    """Return √(k_ii k_jj), complex for derivatives [N/m, N, N·m/rad]."""
    k = np.diag(joint.K)
    return np.sqrt(k[DIRECTIONS.index(first)] * k[DIRECTIONS.index(second)])


def _bounds(joint: Joint, first: str, second: str) -> tuple[float, float]:
    """Return 0.95 of the couplings between which K + coupling · P stays positive definite."""
    index = [DIRECTIONS.index(d) for d in joint.elastic]
    size = np.sqrt(np.diag(joint.K)[index])
    K = np.real(joint.K)[np.ix_(index, index)] / np.outer(size, size)
    P = np.zeros_like(K)
    i, j = joint.elastic.index(first), joint.elastic.index(second)
    P[i, j] = P[j, i] = 1.0
    values, vectors = np.linalg.eigh(K)
    root = vectors / np.sqrt(np.maximum(values, 1e-9))
    reach = np.linalg.eigvalsh(root.T @ P @ root)
    return float(-0.95 / reach[-1]), float(-0.95 / reach[0])
