"""Parts that effects share: their joints, members, supports and points, welded and free ends of members."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np

from fem.array_types import Floats, Ints
from fem.declarations import Site, Yardstick
from fem.effects.added_mass import AddedMass
from fem.effects.joint import Joint, PointPair
from fem.effects.section_shear import SectionShear
from fem.effects.superelement import Superelement
from fem.elements.frame import Frame
from fem.model import DIRECTIONS, Array, Effect, Model, ModelError, ParameterRef, dofs_of


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class OnJoint(Effect):
    """An effect at a joint of the model.

    Attributes
    ----------
    joint : str
        Name of the joint.
    """

    connection: ClassVar[bool] = True
    joint: str

    @property
    def where(self) -> Site:
        """The joint."""
        return Site(f"joint {self.joint}")

    def of(self, model: Model) -> Joint:
        """Return the joint.

        Raises
        ------
        ModelError
            If the model has none of the name.
        """
        joint = model.effect(self.joint)
        if not isinstance(joint, Joint):
            msg = f"{self.kind} '{self.name}' is of joint '{self.joint}', which is a {joint.kind}"
            raise ModelError(msg)
        return joint

    def strain(self, model: Model, direction: str) -> tuple[Ints, Floats]:
        """Return the DOFs of the joint's points, and b with bᵀu its relative motion in a direction."""
        dofs, B = self.of(model).relative(model)
        return dofs, B[DIRECTIONS.index(direction)]

    def locations(self, model: Model) -> Floats:
        """Return the joint's place."""
        return self.of(model).locations(model)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class InDirection(OnJoint):
    """An effect in one direction of a joint.

    Attributes
    ----------
    direction : str
        One of the joint's directions.
    """

    direction: str

    @property
    def where(self) -> Site:
        """Joint and direction."""
        return Site(f"joint {self.joint}", detail=self.direction)

    @classmethod
    def of_elastic(cls, model: Model, **values: float) -> tuple[Self, ...]:
        """Return one for each elastic direction of each joint, whose stiffness is its ``reference``."""
        return tuple(
            cls(
                name=f"{cls.kind}:{j.name}.{d}",
                joint=j.name,
                direction=d,
                reference=float(j.K[i, i]),  # pyright: ignore[reportCallIssue]
                **values,
            )
            for j in model.of_kind(Joint)
            for i, d in enumerate(DIRECTIONS)
            if d in j.elastic
        )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class OnSupports(Effect):
    """A spring in place of a direction in which supports are rigid in the model, alike at each.

    Attributes
    ----------
    supports : tuple of str
        Names of supports that hold the direction.
    direction : str
        One of x, y, z, rx, ry, rz.
    stiffness : float
        Of each [N/m or N·m/rad]; absent is infinite.
    """

    connection: ClassVar[bool] = True
    supports: tuple[str, ...]
    direction: str
    stiffness: Any

    @property
    def where(self) -> Site:
        """Supports and direction."""
        names = ", ".join(self.supports)
        return Site(f"support{'s' if len(self.supports) > 1 else ''} {names}", detail=self.direction)

    def springs(self, model: Model) -> tuple[Ints, Array]:
        """Return the DOF (n, 1) and the stiffness (n, 1, 1) of each support."""
        points = [model.effect(name).point for name in self.supports]  # type: ignore[attr-defined]
        dofs = dofs_of(points)[:, [DIRECTIONS.index(self.direction)]]
        return dofs, np.full((len(points), 1, 1), self.stiffness)

    def released(self) -> tuple[tuple[str, str], ...]:
        """Return the supports' constraints in this direction."""
        return tuple((name, self.direction) for name in self.supports)

    def doubts(self, structure: Yardstick) -> Iterator[tuple[str, str]]:
        """Yield an absurd stiffness."""
        yield from odd_stiffness(self, structure)

    def locations(self, model: Model) -> Floats:
        """Return the supports."""
        return np.vstack([model.effect(name).locations(model) for name in self.supports])


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class AtPoint(Effect):
    """An effect at one point of the mesh.

    Attributes
    ----------
    point : int
        Point of the mesh.
    """

    point: int

    def locations(self, model: Model) -> Floats:
        """Return the point."""
        return model.mesh.points[[self.point]]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class OnPoint(AtPoint):
    """An effect on one point of the mesh in one global direction.

    Attributes
    ----------
    place : str
        Name of the place.
    direction : str
        One of x, y, z, rx, ry, rz.
    """

    place: str
    direction: str

    @property
    def where(self) -> Site:
        """Place and direction."""
        return Site(self.place, detail=self.direction)

    @property
    def dof(self) -> Ints:
        """Number of the one DOF, shape (1, 1)."""
        return dofs_of(self.point)[[DIRECTIONS.index(self.direction)]][None]


def odd_stiffness(effect: Effect, structure: Yardstick) -> Iterator[tuple[str, str]]:
    """Yield the stiffnesses of an effect that are absurd compared with those of the structure."""
    for p in effect.parameters():
        k = float(np.real(p.value))
        if p.unit in ("N/m", "N·m/rad") and 0 < k < np.inf:
            direction = "x" if p.unit == "N/m" else "rx"
            if text := structure.odd_stiffness(direction, k):
                yield p.name, f"{effect.kind} '{effect.name}': {p.name} is {text}"


def parameters_of(effect: Effect) -> tuple[ParameterRef, ...]:
    """Return the parameters of an effect, each with its name."""
    return tuple((effect.name, p.name) for p in effect.parameters())


def material_of(model: Model, member: str, *quantities: str) -> tuple[ParameterRef, ...]:
    """Return the parameters of a member's material: Young's modulus ``"E"``, density ``"rho"``."""
    frame = frame_of(model)
    material = frame.members[member].material.name
    return tuple((frame.name, f"{q}:{material}") for q in quantities)


def elements_of(model: Model, member: str, *quantities: str) -> tuple[ParameterRef, ...]:
    """Return the parameters of a member's elements: of its material, and uncertain shear coefficients."""
    shear = (ref for effect in model.of_kind(SectionShear) for ref in effect.of_member(member))
    return (*shear, *material_of(model, member, *quantities))


def stiffness_of_sprung(model: Model, member: str) -> tuple[ParameterRef, ...]:
    """Return Young's modulus of a member with ends on springs: it says how much of a motion these take."""
    return material_of(model, member, "E") if is_sprung(model, member) else ()


def is_sprung(model: Model, member: str) -> bool:
    """Whether an end of a member is on springs: its stiffness is then not in proportion to moduli."""
    k = frame_of(model).members[member].end_stiffness
    return bool(((k > 0) & np.isfinite(k)).any())


def frame_of(model: Model) -> Frame:
    """Return the model's frame."""
    (frame,) = model.of_kind(Frame)
    return frame


def sheared_frame(model: Model) -> Frame:
    """Return the model's frame with the shear coefficients that it has where these are uncertain.

    An effect that takes part of an element's stiffness must refer to the actual element.
    """
    frame, shear = frame_of(model), model.of_kind(SectionShear)
    return shear[0].applied_to(frame) if shear else frame


def member_mass(model: Model, member: str) -> float:
    """Return ρ A L of a member, with the section of its first end [kg]."""
    p = frame_of(model).members[member]
    return p.material.rho * p.section.A * model.mesh.member_length(member)


def members_mass(model: Model) -> float:
    """Return the mass of all members [kg]."""
    return sum(member_mass(model, m) for m in model.mesh.members)


def typical_mass(model: Model) -> float:
    """Return the median of the members' masses, or of the parts' where there are no members [kg]."""
    if not model.mesh.members:
        return float(np.median([part.weight for part in model.of_kind(Superelement)] or [1.0]))
    return float(np.median([member_mass(model, m) for m in model.mesh.members]))


def typical_length(model: Model) -> float:
    """Return the median of the members' lengths, or the size where there are no members [m]."""
    if not model.mesh.members:
        return model.mesh.size
    return float(np.median([model.mesh.member_length(m) for m in model.mesh.members]))


def bending_stiffness(model: Model, member: str, direction: str) -> float:
    """Return E I of a member for bending about local y or z (``ry``, ``rz``), G J for ``rx`` [N·m²]."""
    p = frame_of(model).members[member]
    rigidity = {
        "rx": p.section.J / (2 * (1 + p.material.nu)),
        "ry": p.section.Iy,
        "rz": p.section.Iz,
    }
    return p.material.E * rigidity[direction]


def framed_members(model: Model) -> tuple[str, ...]:
    """Return the members; none where the model has no frame."""
    return tuple(model.mesh.members) if model.of_kind(Frame) else ()


def bending_members(model: Model) -> tuple[str, ...]:
    """Return the members but bars; none where the model has no frame."""
    return tuple(m for m in framed_members(model) if not is_bar(model, m))


def is_bar(model: Model, member: str) -> bool:
    """Whether a member has axial stiffness alone."""
    return frame_of(model).members[member].theory == "bar"


def section_extent(model: Model, member: str, axes: Floats, towards: Floats) -> float:
    """Return how far a section reaches from its axis in a direction, square to the axis or made so [m].

    Without an outline that of a rectangle with its second moments, of half sides √(3 I / A).
    """
    section = frame_of(model).members[member].section
    side = axes[1:] @ towards
    side = side / np.linalg.norm(side)
    if section.outlines:
        return float(np.abs(section.outlines[0] @ side).max())
    half = np.sqrt(3 * np.array([section.Iz, section.Iy]) / section.A)
    return float(np.abs(side) @ half)


def reaches(model: Model, member: str, line: int | None, start: float, reach: float) -> bool:
    """Whether a stretch of a member that reaches up or down from a place [m] is on a line; any if None."""
    if line is None:
        return True
    row = int(np.flatnonzero(model.mesh.members[member] == line)[0])
    first, last = model.mesh.member_positions(member)[row : row + 2]
    return bool(min(start, start + reach) < last and max(start, start + reach) > first)


PARALLEL = np.cos(np.radians(5))
"""Cosine of the angle up to which two axes count as one [-]."""


def member_ends(model: Model) -> Iterator[tuple[str, int, int]]:
    """Yield member, end (1 or 2) and point for both ends of every member."""
    for member in model.mesh.members:
        points = model.mesh.member_points(member)
        yield member, 1, int(points[0])
        yield member, 2, int(points[-1])


def n_lines_at(model: Model) -> Ints:
    """Return how many lines meet at each point, shape (n_points,)."""
    return np.bincount(model.mesh.lines.ravel(), minlength=model.mesh.n_points)


def fixed_directions(model: Model) -> dict[int, set[str]]:
    """Return the directions in which each point is fixed by a constraint on it alone."""
    out: dict[int, set[str]] = {}
    for c in model.constraints():
        if len(c.dofs) == 1 and c.dofs[0] < 6 * model.mesh.n_points:
            out.setdefault(int(c.dofs[0]) // 6, set()).add(DIRECTIONS[int(c.dofs[0]) % 6])
    return out


def connected_points(model: Model) -> set[int]:
    """Return the points at which joints, supports, links, masses or reduced parts act."""
    n = 6 * model.mesh.n_points
    dofs: list[Any] = [c.dofs for c in model.constraints() if not c.everywhere]
    for effect in model.effects:
        if isinstance(effect, PointPair | AddedMass | Superelement):
            dofs += [c.dofs.ravel() for c in effect.contribute(model)]
    every = np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *dofs]))
    return set((every[every < n] // 6).tolist())


def welded_ends(model: Model) -> tuple[tuple[str, int, tuple[str, ...]], ...]:
    """Return where members other than bars are welded to others: member, end, and local axes of turning.

    Where two ends meet and nothing else is, it does not matter which of them gives way about an axis that
    both have: the first is taken.
    """
    count, others, axes = n_lines_at(model), connected_points(model), frame_of(model).rotations(model.mesh)
    first: dict[int, Floats] = {}
    out = []
    for member, end, point in member_ends(model):
        if count[point] < 2 or is_bar(model, member):
            continue
        R = axes[model.mesh.members[member][0 if end == 1 else -1]]
        known = first.get(point, np.zeros((0, 3))) if count[point] == 2 and point not in others else R[:0]
        new = ~(np.abs(R @ known.T) > PARALLEL).any(axis=1)
        out.append((member, end, tuple(d for d, yes in zip(DIRECTIONS[3:], new, strict=True) if yes)))
        first.setdefault(point, R)
    return tuple(out)


def typical_stiffness(model: Model, direction: str) -> float:
    """Return the median over members of 3 E I / L³, or 3 E I / L for rotations [N/m, N·m/rad].

    Where there are no members, the median of the parts' stiffness at one of their points.
    """
    if not model.mesh.members:
        stiffness = [part.point_stiffness(direction) for part in model.of_kind(Superelement)]
        return float(np.median([k for k in stiffness if k > 0] or [1.0]))
    power = 3 if direction in DIRECTIONS[:3] else 1
    each = [
        3 * min(bending_stiffness(model, m, d) for d in ("ry", "rz")) / model.mesh.member_length(m) ** power
        for m in model.mesh.members
    ]
    return float(np.median(each))


def fastening_places(model: Model) -> Iterator[tuple[int, str, str]]:
    """Yield point, words and label of each member's end and each joint that is not at one, once."""
    seen: set[int] = set()
    for member, end, point in member_ends(model):
        if point not in seen:
            seen.add(point)
            yield point, f"end {end} of member {member}", f"{member}.{end}"
    connected = connected_points(model)
    for pair in model.of_kind(PointPair):
        if pair.point1 not in seen and pair.point1 in connected:
            seen.add(pair.point1)
            yield pair.point1, f"joint {pair.name}", pair.name
    for pair in model.of_kind(PointPair):
        if pair.point2 is not None and pair.point2 not in seen and pair.point2 in connected:
            seen.add(pair.point2)
            yield pair.point2, f"joint {pair.name} on its second side", f"{pair.name}.other"
