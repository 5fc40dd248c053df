"""Planar models: motions out of one plane are taken away from every point."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from fem.array_types import Bools, Floats
from fem.declarations import Role, Site
from fem.effects.spin import spinning
from fem.effects.sprung_mass import SprungMass
from fem.effects.superelement import Superelement
from fem.elements.frame import Frame
from fem.elements.layout import axes_and_arms, layout_of
from fem.model import DIRECTIONS, Constraint, Effect, Model, ModelError, Parameter

PLANES = {"xy": 2, "yz": 0, "xz": 1}
"""Planes of two global axes, and the number of the axis normal to each."""

FLAT = 1e-6
"""Part of the structure's size that points may lie off the plane [-]."""

OBLIQUE = 1e-6
"""Sine of an angle to the plane, and relative difference of constants, that count as zero [-]."""

_ONE = np.ones(1)
_ONE.flags.writeable = False


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Plane(Effect):
    """All points move in one plane: no displacement along its normal, no rotation about an axis in it.

    Attributes
    ----------
    plane : str
        ``"xy"``, ``"yz"`` or ``"xz"``.
    """

    kind: ClassVar[str] = "plane"
    role: ClassVar[Role] = Role.CONSTRAINT
    plane: str

    def __post_init__(self) -> None:
        if self.plane not in PLANES:
            msg = f"the plane is '{self.plane}'; allowed are {', '.join(PLANES)}"
            raise ModelError(msg)

    @property
    def where(self) -> Site:
        """The plane."""
        return Site(f"plane {self.plane}")

    @property
    def normal(self) -> Floats:
        """Unit vector normal to the plane, (3,)."""
        return np.eye(3)[PLANES[self.plane]]

    @property
    def inside(self) -> tuple[str, ...]:
        """Directions of motion in the plane, such as x, z and ry."""
        n = PLANES[self.plane]
        return (*(d for k, d in enumerate(DIRECTIONS[:3]) if k != n), DIRECTIONS[3 + n])

    @property
    def out(self) -> tuple[str, ...]:
        """The other directions."""
        return tuple(d for d in DIRECTIONS if d not in self.inside)

    def parameters(self) -> tuple[Parameter, ...]:
        """None."""
        return ()

    def constraints(self, model: Model) -> tuple[Constraint, ...]:
        """One for each point and direction out of the plane that no other effect holds alone.

        Raises
        ------
        ModelError
            For a model that is not planar.
        """
        for where, why in refusals(model, self.plane):
            msg = f"{where} does not fit into a model in the plane {self.plane}: {why}"
            raise ModelError(msg)
        released = {key for effect in model.effects for key in effect.released()}
        fixed = frozenset(
            int(c.dofs[0])
            for effect in model.effects
            if effect is not self
            for c in effect.constraints(model)
            if len(c.dofs) == 1 and c.key not in released
        )
        key = "plane", self.name, self.plane, fixed
        return model.mesh.kept.get(key, lambda: tuple(self._constraints(model.mesh.n_points, fixed)))

    def _constraints(self, n_points: int, fixed: frozenset[int]) -> Iterator[Constraint]:
        offsets = [(d, DIRECTIONS.index(d)) for d in self.out]
        for point in range(n_points):
            for d, k in offsets:
                dof = 6 * point + k
                if dof not in fixed:
                    yield Constraint(
                        (self.name, f"{point} {d}"), np.array([dof]), _ONE, releasable=False, everywhere=True
                    )

    def includes(self, direction: Any) -> bool:
        """Whether a direction (3,) lies in the plane."""
        d = np.asarray(direction, dtype=float)
        return bool(abs(self.normal @ d) <= OBLIQUE * np.linalg.norm(d))


def plane_of(model: Model) -> Plane | None:
    """Return the plane of a planar model, None for one in space."""
    found = model.of_kind(Plane)
    return found[0] if found else None


def refusals(model: Model, plane: str) -> Iterator[tuple[str, str]]:
    """Yield parts that a planar model cannot have, in words, each with the reason."""
    mesh, n = model.mesh, PLANES[plane]
    off = mesh.points[:, n] - mesh.points[0, n]
    far = int(np.argmax(np.abs(off)))
    if abs(off[far]) > FLAT * mesh.size:
        axis = "xyz"[n]
        yield f"point {far}", f"it lies {abs(off[far]):.4g} m off the plane of point 0, along {axis}"
    for member in spinning(model):
        yield f"member '{member}'", "a rotor whirls in two planes"
    for part in model.of_kind(Superelement):
        yield f"'{part.name}'", "a superelement moves in space, and so do its modes"
    for body in model.of_kind(SprungMass):
        for d in body.k:
            along = abs(body.axes[DIRECTIONS.index(d) % 3, n])
            if (along if d[0] != "r" else 1 - along) > OBLIQUE:
                yield f"'{body.name}'", f"it is sprung in {d}, out of the plane"
    for frame in model.of_kind(Frame):
        yield from _oblique(frame, model, np.eye(3)[n])


def _oblique(frame: Frame, model: Model, normal: Floats) -> Iterator[tuple[str, str]]:
    """Yield members whose bending in the plane would push them out of it."""
    mesh = model.mesh
    layout = layout_of(frame.members, mesh)
    rows = np.arange(mesh.n_lines)
    R = axes_and_arms(layout, mesh, rows)[0]
    oblique = np.abs(R[:, 1:] @ normal).min(axis=1) > OBLIQUE
    kind = layout.table
    unequal = np.zeros(mesh.n_lines, dtype=bool)
    for a, b in (("Iy", "Iz"), ("ky", "kz")):
        first, second = kind[a][layout.kind], kind[b][layout.kind]
        unequal |= np.abs(first - second) > OBLIQUE * np.maximum(first, second)
    wrong = oblique & unequal & (kind["bar"][layout.kind] == 0)
    for member in dict.fromkeys(mesh.member_of_line()[wrong].tolist()):
        section = frame.members[member].section.label
        yield (
            f"member '{member}'",
            f"the axes of its section '{section}' are oblique to the plane, so that it bends out of it",
        )


def in_plane(model: Model, effects: Iterable[Effect]) -> tuple[Effect, ...]:
    """Return the effects that can change motions of a planar model; all of them for a model in space."""
    plane = plane_of(model)
    if plane is None:
        return tuple(effects)
    keep = np.array([d in plane.inside for d in DIRECTIONS])
    inner = np.zeros(model.n_dof, dtype=bool)
    inner[: 6 * model.mesh.n_points] = np.tile(keep, model.mesh.n_points)
    inner[6 * model.mesh.n_points :] = True
    return tuple(e for e in effects if _acts_on(e, model, inner))


def _acts_on(effect: Effect, model: Model, dofs: Bools) -> bool:
    """Whether an effect has matrices or constraints on some of the DOFs, or none at all."""
    present = _present(effect)
    others = tuple(e for e in model.effects if e.name != effect.name)  # the model may have it already
    larger = replace(model, effects=(*others, present))
    n = 6 * model.mesh.n_points
    known = np.append(dofs[:n], np.ones(larger.n_dof - n, dtype=bool))
    parts = present.contribute(larger)
    constraints = present.constraints(larger)
    if not parts and not constraints:
        return True
    if any(known[c.dofs].any() for c in constraints):
        return True
    for part in parts:
        used = known[part.dofs]
        both = used[:, :, None] & used[:, None, :]
        if any(X is not None and np.any(np.abs(X)[both] > 0) for X in (part.K, part.M, part.C, part.D)):
            return True
    return False


def _present(effect: Effect) -> Effect:
    """Return an effect with values at which it is there."""
    values = {}
    for p in effect.parameters():
        if p.position or p.value != p.absent:
            continue
        bounds = [v for v in (p.upper, p.lower) if np.isfinite(v) and v != p.absent]
        values[p.name] = bounds[0] if bounds else p.absent + 1.0
    return effect.with_values(**values) if values else effect
