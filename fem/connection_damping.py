"""Connections that are damped otherwise than members."""

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from fem.array_types import Floats
from fem.declarations import Role, Site
from fem.model import Array, Contribution, Damping, Effect, Model, Parameter, ParameterRef, power_between


@dataclass(frozen=True, slots=True, eq=False)
class MoreLoss:
    """The loss by which a ratio exceeds that of the structure: 2 (ζ_c(ω) - ζ(ω)).

    Attributes
    ----------
    frequency, ratio : ndarray (n,)
        ζ_c [Hz, -].
    damping : Damping
        Its modal ratio is ζ.
    """

    frequency: Floats
    ratio: Floats
    damping: Damping

    def __call__(self, omega: Floats) -> tuple[Array, Array]:
        """Return storage and loss (n,) [-]."""
        f = np.real(omega) / (2 * np.pi)
        more = power_between(f, self.frequency, self.ratio) - self.damping.ratio_at(f)
        return np.zeros(f.shape), 2 * more


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ConnectionDamping(Effect):
    """A modal damping ratio of joints, mounts and supports, in place of the structure's.

    Structural damping of each connection's stiffness, D(ω) = 2 (ζ_c(ω) - ζ(ω)) K, in addition to that of the
    structure's ratio ζ. No candidate, but an uncertain parameter, as the damping of the structure is.

    Attributes
    ----------
    frequency : ndarray (n,)
        Rising frequencies [Hz]; ζ_c is a power of frequency in between, constant outside.
    ratio : ndarray (n,)
        ζ_c there [-].
    but : collection of str
        Names of connections that it does not act on.
    """

    kind: ClassVar[str] = "connection_damping"
    role: ClassVar[Role] = Role.DISSIPATION
    name: str = "connection_damping"
    frequency: Floats
    ratio: Floats
    but: Collection[str] = ()

    @property
    def where(self) -> Site:
        """The connections."""
        return Site("connections")

    def parameters(self) -> tuple[Parameter, ...]:
        """Return none: a fit has a separate curve for it."""
        return ()

    def ratio_at(self, frequency: ArrayLike) -> Floats:
        """Return ζ_c at frequencies [Hz]."""
        return power_between(np.asarray(frequency, dtype=float), self.frequency, self.ratio)

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return the loss of each connection's static stiffness."""
        law = MoreLoss(self.frequency, self.ratio, model.damping)
        parts = (c for e in self._connections(model) for c in e.contribute(model))
        return tuple(Contribution(c.dofs, K, law=law) for c in parts if (K := _stiffness(c)) is not None)

    def refers_to(self, model: Model) -> tuple[ParameterRef, ...]:
        """Return the connections' parameters, and those on which they depend."""
        refs = (
            ref
            for e in self._connections(model)
            for ref in (*((e.name, p.name) for p in e.parameters()), *e.refers_to(model))
        )
        return tuple(dict.fromkeys(refs))

    def _connections(self, model: Model) -> tuple[Effect, ...]:
        return tuple(e for e in model.effects if e.connection and e.name not in self.but)


def _stiffness(c: Contribution) -> Any:
    """Return a contribution's part of K for structural damping."""
    return c.static
