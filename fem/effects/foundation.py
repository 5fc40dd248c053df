"""Flexible supports with damping: soil, rubber mounts, bolted feet."""

from dataclasses import dataclass
from itertools import product
from typing import Any, ClassVar, Self

import numpy as np

from fem.declarations import Contains, Entry, Marker, Role, StiffnessAt
from fem.effects.joint import joint_unit
from fem.effects.places import OnSupports
from fem.effects.support_flexibility import SupportFlexibility
from fem.model import Contribution, Effect, Model, Parameter


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Foundation(OnSupports):
    contains: ClassVar[Contains] = {"support_flexibility": lambda e: {"stiffness": e.stiffness}}

    def _stiffness(self) -> Parameter:
        unit = joint_unit(self.direction)
        return Parameter("stiffness", unit, self.stiffness, np.inf, 1e-6, 1e18, log=True)

    def _grid(self, scale: StiffnessAt, losses: list[dict[str, float]]) -> tuple[dict[str, float], ...]:
        k = float(np.median([scale(key) for key in self.released()]))
        return tuple(
            {"stiffness": float(f * k), **loss} for f, loss in product(np.geomspace(1e-2, 1e2, 11), losses)
        )

    @classmethod
    def _each(cls, model: Model, **values: float) -> tuple[Self, ...]:
        return tuple(
            cls(
                name=f"{cls.kind}:{'+'.join(e.supports)}.{e.direction}",
                supports=e.supports,
                direction=e.direction,
                stiffness=1e6,
                **values,
            )
            for e in SupportFlexibility.propose(model)
        )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Foundation(_Foundation):
    """A spring with a loss factor, k (1 + iη), in a direction in which supports are rigid in the model.

    Its loss factor is at least 3 %; without any it is ``support_flexibility``, which is its twin while the
    foundation's part of the strain energy is small.

    Attributes
    ----------
    loss_factor : float
        η [-].
    """

    kind: ClassVar[str] = "foundation"
    role: ClassVar[Role] = Role.STIFFNESS | Role.DISSIPATION
    marker: ClassVar[Marker | None] = Marker("triangle_down", "vermilion")
    entry: ClassVar[Entry | None] = Entry(
        quantities="`stiffness` [N/m or N·m/rad], `loss_factor` [-]",
        meaning="a support that is flexible and damped in a direction in which it is rigid in the model",
        places="each fixed direction of each support, and of all alike",
    )
    loss_factor: Any

    def parameters(self) -> tuple[Parameter, ...]:
        """Return stiffness and loss factor."""
        return (self._stiffness(), Parameter("loss_factor", "-", self.loss_factor, 0.0, 0.03, 2.0))

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return k and η k."""
        dofs, K = self.springs(model)
        return (Contribution(dofs, K, D=self.loss_factor * K),)

    def starts(self, scale: StiffnessAt) -> tuple[dict[str, float], ...]:
        """Four decades around the stiffness of the structure, losses of 10 and 50 %."""
        return self._grid(scale, [{"loss_factor": 0.1}, {"loss_factor": 0.5}])

    @classmethod
    def propose(cls, model: Model) -> tuple[Effect, ...]:
        """Each fixed direction of each support, and of all supports alike."""
        return cls._each(model, loss_factor=0.1)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class FoundationDashpot(_Foundation):
    """A spring and a dashpot side by side, k (1 + iωτ), in a direction in which supports are rigid.

    Soil that radiates waves (Richart, Hall & Woods, Vibrations of Soils and Foundations, ch. 7). Over a
    narrow band ``foundation`` is its twin.

    Attributes
    ----------
    tau : float
        τ, the dashpot's constant over k [s].
    """

    kind: ClassVar[str] = "foundation_dashpot"
    role: ClassVar[Role] = Role.STIFFNESS | Role.DISSIPATION
    marker: ClassVar[Marker | None] = Marker("triangle_down", "purple")
    entry: ClassVar[Entry | None] = Entry(
        quantities="`stiffness` [N/m or N·m/rad], `tau` [s]",
        meaning="the same with a dashpot of `tau` times the stiffness",
        places="each fixed direction of each support, and of all alike",
    )
    tau: Any

    def parameters(self) -> tuple[Parameter, ...]:
        """Return stiffness and time constant."""
        return (self._stiffness(), Parameter("tau", "s", self.tau, self.tau, 1e-6, 10.0, log=True))

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return k and τ k."""
        dofs, K = self.springs(model)
        return (Contribution(dofs, K, C=self.tau * K),)

    def starts(self, scale: StiffnessAt) -> tuple[dict[str, float], ...]:
        """Four decades around the stiffness of the structure, and of the time constant."""
        return self._grid(scale, [{"tau": t} for t in (1e-5, 1e-4, 1e-3, 1e-2)])

    @classmethod
    def propose(cls, model: Model) -> tuple[Effect, ...]:
        """Each fixed direction of each support, and of all supports alike."""
        return cls._each(model, tau=1e-3)
