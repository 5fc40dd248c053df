"""Rigid supports."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from fem.model import DIRECTIONS, Constraint, Effect, Model, Parameter

_ONE = np.ones(1)
_ONE.flags.writeable = False


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Support(Effect):
    """A point held in some directions.

    Attributes
    ----------
    point : int
        Point of the mesh.
    fixed : tuple of str
        Directions that are held, of x, y, z, rx, ry, rz (global).
    """

    kind: ClassVar[str] = "support"
    point: int
    fixed: tuple[str, ...] = DIRECTIONS

    @property
    def where(self) -> str:
        """The support's name."""
        return f"support {self.name}"

    def parameters(self) -> tuple[Parameter, ...]:
        """None: a rigid support has nothing to estimate; support flexibility is an effect of its own."""
        return ()

    def constraints(self, model: Model) -> tuple[Constraint, ...]:
        """One for each held direction."""
        dofs = 6 * self.point + np.array([DIRECTIONS.index(d) for d in self.fixed], dtype=np.int64)
        return tuple(Constraint((self.name, d), dofs[i : i + 1], _ONE) for i, d in enumerate(self.fixed))

    def locations(self, model: Model) -> NDArray[np.float64]:
        """Return the point."""
        return model.mesh.points[[self.point]]
