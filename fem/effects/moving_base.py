"""A base that moves with all supports and grounds on it: a shaker table."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from fem.array_types import Floats
from fem.declarations import Internal, Marker, Role, Site
from fem.effects.proportional_damping import MassDamping
from fem.ground import MovingGround
from fem.model import Contribution, Effect, Model, ModelError, Parameter

HEAVIER = 1e8
"""Mass of a base over that of the structure: it moves natural frequencies by 5e-9 at most [-]."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MovingBase(Effect):
    """A very heavy body that carries all supports and grounds, and is free along some directions.

    A force ``mass`` along a direction gives it the acceleration 1: FRFs to that force are those to the base's
    acceleration, with the relative error of the structure's mass over that of the base (the method of the
    large mass; Clough & Penzien, Dynamics of Structures, chapter 26, derive the exact one).

    Attributes
    ----------
    directions : ndarray (k, 3)
        Unit vectors along which it moves, none a combination of others.
    mass : float
        [kg].
    """

    kind: ClassVar[str] = "moving_base"
    role: ClassVar[Role] = Role.MASS
    marker: ClassVar[Marker | None] = Marker("triangle", "support")
    directions: Floats
    mass: float

    def __post_init__(self) -> None:
        rank = np.linalg.matrix_rank(np.atleast_2d(self.directions), tol=1e-6)
        if rank < len(self.directions):
            msg = (
                f"'{self.name}' moves along {len(self.directions)} directions, of which {rank} are "
                "independent; a direction that is a combination of others is no further motion"
            )
            raise ModelError(msg)

    @property
    def where(self) -> Site:
        """The base."""
        return Site("the base")

    @property
    def internal(self) -> Internal:
        """One coordinate for each direction, along which it moves all grounds."""
        return Internal(len(self.directions), ground=self.directions)

    def parameters(self) -> tuple[Parameter, ...]:
        """None."""
        return ()

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return its mass along the directions."""
        M = self.mass * np.eye(len(self.directions))
        return (Contribution(model.internal_dofs(self.name)[None], M=M[None]),)


def base_moved(model: Model, directions: Floats) -> Model:
    """Return a model whose supports and grounds move along some directions (k, 3) with a heavy base.

    Rayleigh's αM then resists the motion relative to the base, as modal damping does.

    Raises
    ------
    ModelError
        If nothing holds the structure, a direction is not independent of others, or the model has no mass.
    """
    directions = np.atleast_2d(np.asarray(directions, dtype=float))
    n, mass = 6 * model.mesh.n_points, 0.0
    still = MovingGround(np.arange(len(directions)), directions, n)
    for part in model.contributions():
        if part.M is not None:
            r = still.motions(part.dofs)
            mass += float(np.einsum("bik,bij,bjk->k", r, part.M, r).max())
    constrained = any(still.constrained(c) is not c for c in model.constraints() if not c.everywhere)
    if not constrained and all(still.resisted(part) is part for part in model.contributions()):
        msg = (
            "nothing holds the structure along the motion of its base; a base that moves needs supports, or "
            "joints and springs to the ground"
        )
        raise ModelError(msg)
    moved = model.with_effect(MovingBase(name="moving base", directions=directions, mass=HEAVIER * mass))
    if not model.damping.alpha:
        return moved
    rayleigh = MassDamping(name="mass damping of moving base", alpha=model.damping.alpha)
    return moved.with_damping(replace(model.damping, alpha=0.0)).with_effect(rayleigh)
