"""The section forces of a static state, which stiffen or soften all members."""

from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any, ClassVar, Self

import numpy as np

from fem.array_types import Floats, Ints
from fem.declarations import Role, Site
from fem.effects.places import stiffness_of_sprung
from fem.elements.frame import Frame
from fem.elements.geometric_stiffness import Courses, ForceSamples, SectionForces, sample, stress_stiffness
from fem.elements.levers import lever_stiffness
from fem.elements.lines import Lines
from fem.mesh import Mesh
from fem.model import (
    Contribution,
    Effect,
    Model,
    ModelError,
    Parameter,
    ParameterRef,
    dofs_of,
)
from fem.recent import Recent

_UNITS = 8
"""Frames and meshes whose geometric stiffness at a factor of 1 is kept."""

_LINES = 4000
"""Lines whose geometric stiffness is formed at once: some 10 kB of memory each."""

_NO_LINES = np.zeros(0, dtype=np.int64)
_NO_LINES.flags.writeable = False

_EMPTY: Mapping[str, Any] = MappingProxyType({})


@dataclass(frozen=True, slots=True, eq=False)
class LeverForces:
    """Forces at the ends of rigid arms: of links, joints and bodies whose place is off their point.

    Attributes
    ----------
    points : ndarray of int (n,)
        The points that hold the arms.
    arms : ndarray (n, 3)
        From the points to the ends of the arms [m].
    forces : ndarray (n, 3)
        Forces of the points there, global [N].
    """

    points: Ints
    arms: Floats
    forces: Floats


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Prestress(Effect):
    """Section forces along members, times one load factor, with their geometric stiffness.

    See `fem.elements.geometric_stiffness` for its terms. The forces are functions of arc length, so that they
    are the same on any mesh.

    Attributes
    ----------
    tension : mapping of str to (ndarray (n,), ndarray (n,))
        Axial forces alone: for each member arc lengths from its first end [m], which do not fall, and N
        there, positive in tension and linear in between [N]. A place given twice is a jump; outside, N is
        that of the nearest.
    factor : float
        Load factor [-].
    forces : mapping of str to SectionForces
        All section forces of members, in addition.
    levers : LeverForces or None
        Forces on rigid arms off the members.
    units : Recent
        Geometric stiffness of the lines at a factor of 1, for the last frames and meshes. Copies with another
        factor share it.
    """

    kind: ClassVar[str] = "prestress"
    role: ClassVar[Role] = Role.INITIAL_STRESS
    within_members: ClassVar[bool] = True
    tension: Mapping[str, tuple[Floats, Floats]] = field(default_factory=lambda: _EMPTY)
    factor: Any = 1.0
    forces: Mapping[str, SectionForces] = field(default_factory=lambda: _EMPTY)
    levers: LeverForces | None = None
    units: Recent = field(default_factory=lambda: Recent(_UNITS), repr=False)

    def __post_init__(self) -> None:
        for member, (s, N) in self.tension.items():
            if np.ndim(s) != 1 or np.shape(s) != np.shape(N) or not np.size(s) or (np.diff(s) < 0).any():
                msg = (
                    f"prestress '{self.name}', member '{member}': {np.size(N)} forces at {np.size(s)} "
                    "places; there must be one each, at arc lengths that do not fall"
                )
                raise ModelError(msg)
        for member, (s, _) in self.tension.items():
            if not np.isfinite(s).all():
                msg = f"prestress '{self.name}', member '{member}': its places must be finite numbers [m]"
                raise ModelError(msg)
        arrays = [(member, N) for member, (_, N) in self.tension.items()]
        arrays += [(m, a) for m, f in self.forces.items() for a in (f.start, f.stop, f.values.ravel())]
        if not np.isfinite(np.concatenate([np.zeros(0), *(a for _, a in arrays)])).all():
            member = next(m for m, a in arrays if not np.isfinite(a).all())
            msg = f"prestress '{self.name}', member '{member}': its forces must be finite numbers [N]"
            raise ModelError(msg)

    @property
    def where(self) -> Site:
        """The members."""
        names = self._members()
        return Site(f"member{'s' if len(names) > 1 else ''} {', '.join(names)}")

    def _content(self) -> Hashable:
        """Return the forces as bytes: a key of all but the factor that the stiffness depends on."""
        axial = tuple(
            (m, np.asarray(s).tobytes(), np.asarray(N).tobytes()) for m, (s, N) in self.tension.items()
        )
        arrays = [a for f in self.forces.values() for a in (f.start, f.stop, f.values.ravel())]
        values = np.concatenate(arrays).tobytes() if arrays else b""
        return axial, tuple(self.forces), tuple(f.start.size for f in self.forces.values()), values

    def _members(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys((*self.tension, *self.forces)))

    def parameters(self) -> tuple[Parameter, ...]:
        """Return the load factor."""
        return (Parameter("factor", "-", self.factor, 0.0, -1e3, 1e3, linear=True),)

    def line_tension(self, model: Model, member: str) -> Floats:
        """Return the mean axial force of each line of a member at a load factor of 1, (n_lines,) [N]."""
        (frame,), mesh = model.of_kind(Frame), model.mesh
        g, samples = _sampled(self, frame, mesh, [member])
        out = np.zeros(len(g.L))
        np.add.at(out, samples.line, samples.weight * samples.forces[:, 0])
        return out / g.span

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return the geometric stiffness of the members' lines, and of forces on rigid arms."""
        (frame,) = model.of_kind(Frame)
        for member in self._members():
            if member not in model.mesh.members:
                msg = (
                    f"prestress '{self.name}' is of member '{member}'; the mesh has "
                    f"{', '.join(model.mesh.members)}"
                )
                raise ModelError(msg)
        unit = self.units.get(
            (frame, model.mesh, self._content()), lambda: _unit_stiffness(self, frame, model.mesh)
        )
        out = [Contribution(unit.dofs, self.factor * unit.K, lines=unit.lines)] if len(unit.dofs) else []
        if self.levers is not None and self.levers.points.size:
            K = np.zeros((self.levers.points.size, 6, 6))
            K[:, 3:, 3:] = lever_stiffness(self.levers.arms, self.levers.forces)
            out.append(Contribution(dofs_of(self.levers.points), self.factor * K))
        return tuple(out)

    def alters(self, model: Model, member: str, line: int | None = None) -> bool:
        """Whether the member has forces."""
        return member in self.tension or member in self.forces

    def axial(self) -> Self:
        """Return the same without shear forces, moments and forces on rigid arms."""
        only = np.array([1, 0, 0, 0, 0, 0])
        forces = {m: SectionForces(f.start, f.stop, f.values * only) for m, f in self.forces.items()}
        return replace(self, forces=forces, levers=None)

    def refers_to(self, model: Model) -> tuple[ParameterRef, ...]:
        """Return Young's moduli of members on springs."""
        refs = (ref for member in self._members() for ref in stiffness_of_sprung(model, member))
        return tuple(dict.fromkeys(refs))

    def locations(self, model: Model) -> Floats:
        """Return the middles of the members."""
        mesh = model.mesh
        return np.array([mesh.point_at(mesh.locate(m, mesh.member_length(m) / 2)) for m in self._members()])


def _unit_stiffness(effect: Prestress, frame: Frame, mesh: Mesh) -> Contribution:
    """Return the geometric stiffness of the lines at a load factor of 1."""
    out = [Contribution(np.zeros((0, 12), dtype=np.int64), np.zeros((0, 12, 12)), lines=_NO_LINES)]
    for members in _some_at_a_time(effect._members(), mesh):
        g, samples = _sampled(effect, frame, mesh, members)
        K = stress_stiffness(g, samples)
        out.append(Contribution(g.dofs, K, lines=g.rows))
    dofs, K, lines = (np.concatenate([getattr(c, key) for c in out]) for key in ("dofs", "K", "lines"))
    return Contribution(dofs, K, lines=lines)


def _sampled(
    effect: Prestress, frame: Frame, mesh: Mesh, members: Sequence[str]
) -> tuple[Lines, ForceSamples]:
    """Return the lines of members, and the section forces at points of quadrature along them."""
    rows = [mesh.members[m] for m in members]
    member = np.repeat(np.arange(len(rows)), [len(r) for r in rows])
    g = frame.lines(mesh, np.concatenate(rows))
    kinds = (
        {k: SectionForces.axial(*effect.tension[m]) for k, m in enumerate(members) if m in effect.tension},
        {k: effect.forces[m] for k, m in enumerate(members) if m in effect.forces},
    )
    s = mesh.arc_lengths()[g.rows]
    return g, ForceSamples.joined([sample(g, s, member, Courses.of(forces)) for forces in kinds if forces])


def _some_at_a_time(members: Sequence[str], mesh: Mesh) -> Iterator[list[str]]:
    """Yield members in groups of a few thousand lines."""
    group, n = [], 0
    for member in members:
        group.append(member)
        n += len(mesh.members[member])
        if n >= _LINES:
            yield group
            group, n = [], 0
    if group:
        yield group
