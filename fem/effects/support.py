"""Rigid supports."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fem.declarations import SUPPORT_MARKER, Marker, Role, Site
from fem.effects.places import AtPoint
from fem.model import DIRECTIONS, Constraint, Model, Parameter

_ONE = np.ones(1)
_ONE.flags.writeable = False


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Support(AtPoint):
    """A point that is fixed in some directions.

    Attributes
    ----------
    fixed : tuple of str
        Directions that are fixed, of x, y, z, rx, ry, rz (global).
    """

    kind: ClassVar[str] = "support"
    role: ClassVar[Role] = Role.CONSTRAINT
    marker: ClassVar[Marker | None] = SUPPORT_MARKER
    fixed: tuple[str, ...] = DIRECTIONS

    @property
    def where(self) -> Site:
        """The support's name."""
        return Site(f"support {self.name}")

    def parameters(self) -> tuple[Parameter, ...]:
        """None: a rigid support has nothing to estimate; support flexibility is another effect."""
        return ()

    def constraints(self, model: Model) -> tuple[Constraint, ...]:
        """One for each fixed direction."""
        dofs = 6 * self.point + np.array([DIRECTIONS.index(d) for d in self.fixed], dtype=np.int64)
        return tuple(Constraint((self.name, d), dofs[i : i + 1], _ONE) for i, d in enumerate(self.fixed))
