"""The axial forces of a static state, which stiffen or soften the bending of all members."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from fem.effects.frame import Frame
from fem.model import Contribution, Effect, Model, ModelError, Parameter


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Prestress(Effect):
    """Axial forces along members, times one load factor; geometric stiffness ∫ N (v'² + w'²) dx.

    Each element has the mean of N over it, so that the force is the same on any mesh.

    Attributes
    ----------
    tension : mapping of str to (ndarray (n,), ndarray (n,))
        For each member arc lengths from its first end [m], which do not fall, and N there, positive in
        tension and linear in between [N]. A place given twice is a jump; outside, N is that of the nearest.
    factor : float
        Load factor [-].
    """

    kind: ClassVar[str] = "prestress"
    tension: Mapping[str, tuple[NDArray[np.float64], NDArray[np.float64]]]
    factor: Any = 1.0

    def __post_init__(self) -> None:
        for member, (s, N) in self.tension.items():
            if np.ndim(s) != 1 or np.shape(s) != np.shape(N) or not np.size(s) or (np.diff(s) < 0).any():
                msg = (
                    f"prestress '{self.name}', member '{member}': {np.size(N)} forces at {np.size(s)} "
                    "places; there must be one each, at arc lengths that do not fall"
                )
                raise ModelError(msg)
            if not (np.isfinite(s).all() and np.isfinite(N).all()):
                msg = f"prestress '{self.name}', member '{member}': its forces must be finite numbers [N]"
                raise ModelError(msg)

    @property
    def where(self) -> str:
        """The members."""
        return f"member{'s' if len(self.tension) > 1 else ''} {', '.join(self.tension)}"

    def parameters(self) -> tuple[Parameter, ...]:
        """Return the load factor."""
        return (Parameter("factor", "-", self.factor, 0.0, -1e3, 1e3, linear=True),)

    def line_tension(self, model: Model, member: str) -> NDArray[np.float64]:
        """Return the mean axial force of each line of a member at a load factor of 1, (n_lines,) [N]."""
        s, N = self.tension[member]
        at = model.mesh.member_positions(member)
        return np.diff(_integral(s, N, at)) / np.diff(at)

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return the geometric stiffness of each member, in the order of ``tension``."""
        (frame,) = model.of_kind(Frame)
        out = []
        for member in self.tension:
            if member not in model.mesh.members:
                msg = (
                    f"prestress '{self.name}' is of member '{member}'; the mesh has "
                    f"{', '.join(model.mesh.members)}"
                )
                raise ModelError(msg)
            unit = frame.geometric_stiffness(model, member, 1.0)
            N = self.factor * self.line_tension(model, member)
            out.append(Contribution(unit.dofs, N[:, None, None] * unit.K))
        return tuple(out)

    def locations(self, model: Model) -> NDArray[np.float64]:
        """Return the middles of the members."""
        mesh = model.mesh
        return np.array([mesh.point_at(mesh.locate(m, mesh.member_length(m) / 2)) for m in self.tension])


def _integral(s: NDArray[np.float64], N: NDArray[np.float64], at: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return ∫ N ds from s[0] to places, N linear in between, shape (n,)."""
    whole = np.concatenate([[0.0], np.cumsum(np.diff(s) * (N[:-1] + N[1:]) / 2)])
    if s.size == 1:
        return N[0] * (at - s[0])
    k = np.clip(np.searchsorted(s, at, side="right") - 1, 0, s.size - 2)
    x, h = np.clip(at, s[0], s[-1]) - s[k], s[k + 1] - s[k]
    slope = np.divide(N[k + 1] - N[k], h, out=np.zeros_like(x), where=h > 0)
    inside = whole[k] + np.where(h > 0, (N[k] + slope * x / 2) * x, 0.0)
    outside = N[0] * np.minimum(at - s[0], 0.0) + N[-1] * np.maximum(at - s[-1], 0.0)
    return inside + outside
