"""Shafts that spin: the gyroscopic effect of members and of the bodies on them."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from fem.array_types import Floats
from fem.declarations import Environment, Role, Site
from fem.effects.added_mass import AddedMass
from fem.elements.frame import Frame
from fem.elements.interpolation import gauss_points, shape_matrix
from fem.elements.layout import Layout, layout_of
from fem.elements.lines import NO_CHANGE, Lines, inertias, n_gauss, some_lines
from fem.elements.matrices import lumped_masses, to_global
from fem.elements.properties import MemberProperties
from fem.elements.rigid_zones import zone_sections
from fem.mesh import Mesh
from fem.model import Array, Contribution, Effect, Model, ModelError, Parameter, ParameterRef, dofs_of, skew

FASTEST = 1e9
"""Speed above which an input is a slip [rad/s]: the fastest machines reach 1e5."""
_ROUNDING = 1e-6
"""Relative difference below which second moments are equal and directions parallel [-]."""


def refuse_speeds(speed: Any) -> None:
    """Refuse speeds that no shaft has.

    Parameters
    ----------
    speed : float or ndarray
        [rad/s].

    Raises
    ------
    ModelError
        For a speed that is not finite, or beyond ``FASTEST``.
    """
    wrong = np.ravel(speed)[~(np.abs(np.ravel(speed)) <= FASTEST)]
    if wrong.size:
        msg = (
            f"a speed is {wrong[0]:.4g} rad/s ({wrong[0] * (30 / np.pi):.4g} turns a minute); shafts turn at "
            f"up to {FASTEST:g} rad/s in either sense"
        )
        raise ModelError(msg)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Spin(Effect):
    """The gyroscopic matrices of all members with a ``spin``, and of the bodies on them.

    A member turns about its axis, from its first to its second end, at its ``spin`` times the speed. Bodies
    (`AddedMass`) at points of such members turn with them unless their ``spins`` is False. Mass and rotary
    inertia are those of the members and bodies.

    The axes are those at rest, so that C is constant. Sections and bodies that are not round would give
    matrices that vary with time; they are refused, as is a member without rotary inertia.

    Attributes
    ----------
    speed : float
        Of a member with spin 1 [rad/s].
    """

    kind: ClassVar[str] = "spin"
    role: ClassVar[Role] = Role.GYROSCOPIC
    environment: ClassVar[Environment | None] = Environment.ROTATION
    reciprocal: ClassVar[bool] = False
    speed: Any

    def __post_init__(self) -> None:
        refuse_speeds(self.speed)

    @property
    def where(self) -> Site:
        """The shafts."""
        return Site("the members that spin")

    def parameters(self) -> tuple[Parameter, ...]:
        """Return the speed."""
        return (Parameter("speed", "rad/s", self.speed, 0.0, -1e6, 1e6, linear=True),)

    def refers_to(self, model: Model) -> tuple[ParameterRef, ...]:
        """Return the densities of the members, and moduli: shear and sprung ends shape how sections turn."""
        return tuple(
            (e.name, p.name)
            for e in model.of_kind(Frame)
            for p in e.parameters()
            if p.name.startswith(("rho:", "E:"))
        )

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return C, skew, of elements and bodies.

        Raises
        ------
        ModelError
            For a member or body that cannot spin.
        """
        for where, why in refusals(model):
            msg = f"{where} cannot spin: {why}"
            raise ModelError(msg)
        (frame,) = model.of_kind(Frame)
        mesh, spins = model.mesh, spinning(model)
        layout = layout_of(frame.members, mesh)
        out = []
        for member, ratio in spins.items():
            g = frame.lines(mesh, mesh.members[member])
            out.append(Contribution(g.dofs, C=ratio * self.speed * unit_gyroscopic(g, layout)))
        for body, member in bodies(model):
            axis = _axes(mesh, member)[0]
            momentum = spins[member] * self.speed * (axis @ body.inertia @ axis)
            out.append(Contribution(dofs_of([body.point])[:, 3:], C=(-momentum * skew(axis))[None]))
        return tuple(out)

    def locations(self, model: Model) -> Floats:
        """Return the middles of the lines that spin."""
        mesh = model.mesh
        lines = np.concatenate([mesh.lines[mesh.members[m]] for m in spinning(model)])
        return mesh.points[lines].mean(axis=1)


def spinning(model: Model) -> dict[str, float]:
    """Return the members that spin, and the ratio of their speed to that of the rotation."""
    return {
        name: p.spin
        for frame in model.of_kind(Frame)
        for name, p in frame.members.items()
        if p.spin and name in model.mesh.members
    }


def bodies(model: Model) -> Iterator[tuple[AddedMass, str]]:
    """Yield the bodies that spin, each with the member with which it does."""
    mesh = model.mesh
    of_point = {int(p): m for m in spinning(model) for p in np.unique(mesh.lines[mesh.members[m]])}
    for body in model.of_kind(AddedMass):
        if body.spins and np.any(body.inertia) and body.point in of_point:
            yield body, of_point[body.point]


def refusals(model: Model) -> Iterator[tuple[str, str]]:
    """Yield members and bodies that cannot spin, in words, each with the reason."""
    for frame in model.of_kind(Frame):
        for member in spinning(model):
            for why in _of_member(frame.members[member], _axes(model.mesh, member)):
                yield f"member '{member}'", why
    for body, member in bodies(model):
        for why in _of_body(body, _axes(model.mesh, member)[0], member):
            yield f"'{body.name}'", why


def _axes(mesh: Mesh, member: str) -> Floats:
    """Return the unit vectors along a member's lines, shape (n, 3)."""
    ends = mesh.points[mesh.lines[mesh.members[member]]]
    along = ends[:, 1] - ends[:, 0]
    return along / np.linalg.norm(along, axis=1)[:, None]


def _of_member(p: MemberProperties, axes: Floats) -> Iterator[str]:
    if p.theory != "timoshenko":
        yield (
            f"its theory is '{p.theory}', without rotary inertia, which is as large as the gyroscopic "
            "effect; take 'timoshenko' (without shear deformation: a section with ky and kz of 0)"
        )
    for section in (p.section, *([] if p.section2 is None else [p.section2])):
        if abs(section.Iy - section.Iz) > _ROUNDING * max(section.Iy, section.Iz):
            yield (
                f"its section '{section.label}' has Iy = {section.Iy:.4g} and Iz = {section.Iz:.4g} m⁴; a "
                "shaft that is not round has a stiffness that turns with it, and no constant matrices"
            )
    if (np.linalg.norm(axes - axes[0], axis=1) > _ROUNDING).any():
        yield "it is not straight, and has no one axis; divide it into straight members"


def _of_body(body: AddedMass, axis: Floats, member: str) -> Iterator[str]:
    rest = "or give spins = false to a body that the shaft does not turn"
    inertia = np.asarray(body.inertia)
    polar = float(axis @ inertia @ axis)
    across = np.eye(3) - np.outer(axis, axis)
    mean = float(np.trace(across @ inertia)) / 2
    round_one = polar * np.outer(axis, axis) + mean * across
    if np.abs(inertia - round_one).max() > _ROUNDING * np.abs(inertia).max():
        yield f"its inertia is not that of a body which is round about the axis of '{member}'; {rest}"
    if np.linalg.norm(across @ body.arm) > _ROUNDING * max(float(np.linalg.norm(body.arm)), 1e-300):
        yield f"its centre lies off the axis of '{member}'; {rest}"


# Gyroscopic matrices of elements that spin about their axes -------------------------------------------------


def unit_gyroscopic(g: Lines, layout: Layout) -> Array:
    """Return C of elements that spin with 1 rad/s about their axes, global, shape (b, 12, 12).

    A slice of polar inertia ρ Ip dx resists the rate of turn dθ/dt of its axis e with dθ/dt × ρ Ip e dx, so
    that C = ∫ ρ Ip (n_yᵀ n_z - n_zᵀ n_y) dx with the rotations n of the section about the local y and z
    (Nelson, J. Mech. Des. 102, 1980, 793-803). Lumped members have it at their ends, as their inertia.
    """
    C: Array = np.zeros((len(g.L), 12, 12))
    for xi, weight in zip(*gauss_points(n_gauss(g, 4)), strict=True):
        at = np.full(len(g.L), xi)
        N, scale = shape_matrix(g, at), weight * g.L * inertias(g, at)[:, 3]
        C = C + scale[:, None, None] * _turned(N[:, 4], N[:, 5])
    C = to_global(C, g.T)
    lumped = g.lumped != 0
    if lumped.any():
        some, T = some_lines(g, np.flatnonzero(lumped)), g.T_nodes[lumped]
        polar, ends = lumped_masses(some), np.eye(12)
        G = sum(polar[:, k + 3, None, None] * _turned(ends[k + 4][None], ends[k + 5][None]) for k in (0, 6))
        C[lumped] = np.swapaxes(T, 1, 2) @ G @ T
    for k in (0, 1):
        zone = np.flatnonzero(g.zone[:, k])
        if zone.size:
            some = some_lines(g, zone)
            polar = some.rho * some.zone[:, k] * zone_sections(layout, some, k, NO_CHANGE)[3]
            turn = slice(3 + 6 * k, 6 + 6 * k)
            C[zone, turn, turn] += polar[:, None, None] * _turned(some.R[:, 1], some.R[:, 2])
    return C


def _turned(y: Array, z: Array) -> Array:
    """Return yᵀz - zᵀy of rows (b, m), shape (b, m, m)."""
    outer = y[:, :, None] * z[:, None, :]
    out: Array = outer - np.swapaxes(outer, 1, 2)
    return out
