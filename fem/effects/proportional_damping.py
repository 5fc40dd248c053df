"""Damping models of all of the structure: in proportion to mass, or to stiffness.

Every fit has a damping ratio that varies with frequency, which both of these are twins of; so they are not
proposed. They are here for models.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

from fem.array_types import Floats
from fem.declarations import Role, Site, StiffnessAt
from fem.model import Contribution, Effect, Model, Parameter


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Proportional(Effect):
    @property
    def where(self) -> Site:
        """All of it."""
        return Site("the whole structure")

    def _others(self, model: Model) -> list[Contribution]:
        """Return the contributions of all other effects of the model but a base that carries it."""
        others = (e for e in model.effects if not (isinstance(e, _Proportional) or len(e.internal.ground)))
        return [c for e in others for c in e.contribute(model)]

    def locations(self, model: Model) -> Floats:
        """Return the middle of the mesh's first line."""
        return model.mesh.points[model.mesh.lines[0]].mean(axis=0)[None]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MassDamping(_Proportional):
    """C = alpha M with the mass of all other effects: a modal ratio of alpha/(2ω), falling with frequency.

    Attributes
    ----------
    alpha : float
        [1/s].
    """

    kind: ClassVar[str] = "mass_damping"
    role: ClassVar[Role] = Role.DISSIPATION
    alpha: Any

    def parameters(self) -> tuple[Parameter, ...]:
        """Return alpha."""
        return (Parameter("alpha", "1/s", self.alpha, 0.0, 0.0, 1e4, linear=True),)

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return alpha M."""
        return tuple(Contribution(c.dofs, C=self.alpha * c.M) for c in self._others(model) if c.M is not None)

    def starts(self, scale: StiffnessAt) -> tuple[dict[str, float], ...]:
        """From 0.1 to 100 per second."""
        return tuple({"alpha": a} for a in (0.1, 1.0, 10.0, 100.0))


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class StiffnessDamping(_Proportional):
    """C = beta K with the static stiffness of all other effects: a modal ratio of βω/2, rising with ω.

    Attributes
    ----------
    beta : float
        [s].
    """

    kind: ClassVar[str] = "stiffness_damping"
    role: ClassVar[Role] = Role.DISSIPATION
    beta: Any

    def parameters(self) -> tuple[Parameter, ...]:
        """Return beta."""
        return (Parameter("beta", "s", self.beta, 0.0, 0.0, 1.0, linear=True),)

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return beta K."""
        return tuple(
            Contribution(c.dofs, C=self.beta * c.static) for c in self._others(model) if c.static is not None
        )

    def starts(self, scale: StiffnessAt) -> tuple[dict[str, float], ...]:
        """From 10⁻⁷ to 10⁻⁴ s."""
        return tuple({"beta": b} for b in (1e-7, 1e-6, 1e-5, 1e-4))
