"""The frame as an effect: two-node, 12-DOF beams and bars along the members of a mesh.

`Frame` joins the modules of this room: the layout of the lines, their geometry and properties at the current
moduli (`Frame.lines`), and the matrices of these. Parts of members are in `fem.elements.stretches`,
`fem.elements.cut` and `fem.elements.inner_place`.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from fem.array_types import Bools, Floats, Ints
from fem.declarations import Role, Site
from fem.elements.closed_form import closed_mass, closed_stiffness, global_blocks
from fem.elements.connections import connect_ends, with_rigid_ends
from fem.elements.interpolation import axis_displacements, motion_matrix
from fem.elements.layout import ByMember, alike, axes_and_arms, layout_of
from fem.elements.lines import (
    NO_CHANGE,
    Lines,
    SectionChange,
    constants_along,
    flexible_fraction,
    form_lines,
    shear_factors,
)
from fem.elements.matrices import global_mass, local_stiffness, to_global, unit_tension_stiffness
from fem.elements.properties import MemberProperties
from fem.elements.rigid_zones import zone_masses
from fem.materials import Material
from fem.mesh import Location, Mesh
from fem.model import Array, Contribution, Effect, Model, ModelError, Parameter, dofs_of
from fem.recent import Recent

BATCH = 2048
"""Elements that are formed at a time, so that their arrays stay within some megabytes."""
_KEPT = 1024
"""Number of matrices and shapes of members and lines that a frame keeps."""


@dataclass(frozen=True, slots=True, eq=False)
class FrameChange:
    """Change of a frame's matrices by new moduli and densities: factors, or differences of some lines.

    Attributes
    ----------
    scale : mapping of str to float
        Factors of K, D and M.
    constant : tuple of Contribution
        Pretensions, which the factor of K does not scale.
    batches : iterator of Contribution
        Contributions to add.
    """

    scale: Mapping[str, float]
    constant: tuple[Contribution, ...]
    batches: Iterator[Contribution]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Frame(Effect):
    """Beams and bars along members: Timoshenko with consistent mass unless their properties say otherwise.

    The shape functions solve the static Timoshenko equations exactly, so that stiffness does not lock
    (`fem.elements.interpolation`).

    Attributes
    ----------
    members : mapping of str to MemberProperties
        For every member of the mesh. Members that share one object are treated together.
    values : mapping of str to number
        Young's moduli ``"E:<material>"`` [Pa] and densities ``"rho:<material>"`` [kg/m³] that replace
        those of the materials; G follows E at constant ν.
    shear : mapping of str to (number, number)
        Factors of members' shear flexibility 1/(k G A) along y and z [-].
    kept : Recent
        Matrices and shapes of single members and lines, which effects on them ask for many times. Frames with
        other values have others.
    """

    kind: ClassVar[str] = "frame"
    role: ClassVar[Role] = Role.STIFFNESS | Role.MASS | Role.DISSIPATION
    within_members: ClassVar[bool] = True
    name: str = "frame"
    members: Mapping[str, MemberProperties]
    values: Mapping[str, Any] = field(default_factory=dict)
    shear: Mapping[str, tuple[Any, Any]] = field(default_factory=dict)
    kept: Recent = field(default_factory=lambda: Recent(_KEPT), init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "members", ByMember.of(self.members))
        object.__setattr__(self, "shear", ByMember.of(self.shear))
        by_name: dict[str, Material] = {}
        for properties in self._different():
            known = by_name.setdefault(properties.material.name, properties.material)
            if known != properties.material:
                msg = f"two different materials have the name '{known.name}'; names must differ"
                raise ModelError(msg)

    def _different(self) -> list[MemberProperties]:
        return list(dict.fromkeys(self.members.values()))

    @property
    def materials(self) -> dict[str, Material]:
        """The materials by name."""
        return {p.material.name: p.material for p in self._different()}

    @property
    def where(self) -> Site:
        """All members."""
        return Site("all members")

    @property
    def has_tapers(self) -> bool:
        """Whether a member's section changes along it."""
        return any(p.section2 is not None for p in self._different())

    def tapered_lines(self, mesh: Mesh) -> list[int]:
        """Return the lines whose section changes along them."""
        return np.flatnonzero(layout_of(self.members, mesh).taper >= 0).tolist()

    def parameters(self) -> tuple[Parameter, ...]:
        """Young's modulus and density of each material.

        K is not affine in the modulus of members whose ends are on springs.
        """
        sprung = {
            p.material.name
            for p in self._different()
            if any(0 < k < np.inf for k in (*p.spring1.values(), *p.spring2.values()))
        }
        out = []
        for name, m in self.materials.items():
            E, rho = self.values.get(f"E:{name}", m.E), self.values.get(f"rho:{name}", m.rho)
            affine = name not in sprung
            out.append(Parameter(f"E:{name}", "Pa", E, m.E, 0.5 * m.E, 2 * m.E, log=True, linear=affine))
            out.append(
                Parameter(f"rho:{name}", "kg/m³", rho, m.rho, 0.5 * m.rho, 2 * m.rho, log=True, linear=affine)
            )
        return tuple(out)

    def with_values(self, **values: Any) -> Self:
        """Return a frame with other moduli or densities."""
        return replace(self, values={**self.values, **values})

    def with_mass_of_higher_order(self) -> Self:
        """Return a frame with mass of higher order in place of consistent mass; itself if there is none."""
        if all(p.mass != "consistent" for p in self._different()):
            return self
        new = {p: replace(p, mass="higher-order") if p.mass == "consistent" else p for p in self._different()}
        return replace(self, members={name: new[p] for name, p in self.members.items()})

    def rotations(self, mesh: Mesh, lines: ArrayLike | None = None) -> Floats:
        """Return the local axes of some or all lines of the mesh as rows, shape (n_lines, 3, 3)."""
        rows = np.arange(mesh.n_lines) if lines is None else np.asarray(lines, dtype=np.int64)
        if not rows.size:
            return np.zeros((0, 3, 3))
        return axes_and_arms(layout_of(self.members, mesh), mesh, rows)[0]

    def alike(self, mesh: Mesh, member: str) -> bool:
        """Return whether all elements of a member have the same matrices (`fem.elements.layout.alike`)."""
        return alike(self.members, mesh, member)

    def lines(
        self, mesh: Mesh, rows: ArrayLike, maps: bool = True, change: SectionChange = NO_CHANGE
    ) -> Lines:
        """Return geometry and properties of some lines, and unless ``maps`` is false their maps T."""
        layout, rows = layout_of(self.members, mesh), np.asarray(rows, dtype=np.int64)
        factors = shear_factors(self.shear, mesh)[:, rows] if self.shear else None
        rigid = form_lines(layout, mesh, rows, self.values, factors, maps=maps, change=change)
        return connect_ends(rigid, layout) if maps else rigid

    def contribute(self, model: Model) -> Iterator[Contribution]:
        """Yield stiffness, mass and the materials' structural damping of members, and pretensions.

        In parts of a few thousand elements.
        """
        if not model.mesh.n_lines:  # a structure of reduced parts
            return
        yield from self._batches_of(model.mesh, np.arange(model.mesh.n_lines))
        yield from self._pretensions(model.mesh)

    def change_to(self, other: "Frame", mesh: Mesh) -> FrameChange | None:
        """Return the change of matrices that takes this frame to another one with other values.

        None if more than values differ, or springs at ends make K depend on moduli in another way.
        """
        if self.members is not other.members or self.name != other.name:
            return None
        layout = layout_of(self.members, mesh)
        used = np.bincount(layout.kind, minlength=len(layout.materials)) > 0
        old, new = (
            np.array(
                [
                    [f.values.get(f"{q}:{m.name}", getattr(m, q)) for m in layout.materials]
                    for q in ("E", "rho")
                ]
            )
            for f in (self, other)
        )
        ratio = new[:, used] / old[:, used]
        E, rho = ratio[:, 0]
        if not (layout.soft >= 0).any() and (ratio == ratio[:, :1]).all():
            return FrameChange({"K": E, "D": E, "M": rho}, tuple(self._pretensions(mesh)), iter(()))
        if (layout.soft >= 0).any():
            return None
        differs = (new != old).any(axis=0)
        # a frame with the differences as its values has the differences of the matrices
        rest = {
            f"{q}:{m.name}": new[i, k] - old[i, k]
            for k, m in enumerate(layout.materials)
            for i, q in enumerate(("E", "rho"))
        }
        rows = np.flatnonzero(differs[layout.kind])
        return FrameChange({}, (), replace(self, values=rest)._batches_of(mesh, rows))

    def _batches_of(self, mesh: Mesh, rows: Ints) -> Iterator[Contribution]:
        for i in range(0, len(rows), BATCH):
            yield self._elements(mesh, rows[i : i + BATCH])
        yield from self._rigid_zone_masses(mesh, rows)

    def contribution_of(
        self, model: Model, rows: ArrayLike, change: SectionChange = NO_CHANGE
    ) -> tuple[Contribution, ...]:
        """Return stiffness, mass and structural damping of some lines of the mesh, without pretensions.

        ``change`` gives them with other sections.
        """
        rows = np.asarray(rows, dtype=np.int64)
        parts = [self._elements(model.mesh, rows[i : i + BATCH], change) for i in range(0, len(rows), BATCH)]
        if len(parts) == 1:
            return (parts[0], *self._rigid_zone_masses(model.mesh, rows, change))
        damped = any(part.D is not None for part in parts)
        D = [np.zeros_like(part.K) if part.D is None else part.D for part in parts] if damped else None
        joined = Contribution(
            *(np.concatenate([getattr(part, key) for part in parts]) for key in ("dofs", "K", "M")),
            D=None if D is None else np.concatenate(D),
            lines=rows,
        )
        return (joined, *self._rigid_zone_masses(model.mesh, rows, change))

    def _elements(self, mesh: Mesh, rows: Ints, change: SectionChange = NO_CHANGE) -> Contribution:
        """Return the elements of lines: plain ones in closed form, others by quadrature."""
        plain = layout_of(self.members, mesh).plain[rows]
        if plain.any() and not plain.all():
            parts = [(part, self._elements(mesh, rows[part], change)) for part in (plain, ~plain)]
            return _merged(mesh, rows, parts)
        g = self.lines(mesh, rows, maps=not plain.all(), change=change)
        if plain.all():
            K, M = global_blocks(g.R, *closed_stiffness(g)), global_blocks(g.R, *closed_mass(g))
        else:
            K, M = to_global(local_stiffness(g), g.T), global_mass(g)
        D = g.eta[:, None, None] * K if np.any(g.eta != 0) else None
        if g.soft.size:  # after D: springs of connections have no loss factor
            K[g.soft] += np.swapaxes(g.slip, 1, 2) @ (g.ends[:, :, None] * g.slip)
        return Contribution(g.dofs, K, M, None, D, lines=rows)

    def _pretensions(self, mesh: Mesh) -> Iterator[Contribution]:
        layout = layout_of(self.members, mesh)
        rows = np.flatnonzero(layout.table["tension"][layout.kind] != 0)
        for i in range(0, len(rows), BATCH):
            g = self.lines(mesh, rows[i : i + BATCH])
            yield Contribution(g.dofs, g.tension[:, None, None] * unit_tension_stiffness(g), lines=g.rows)

    def _rigid_zone_masses(
        self, mesh: Mesh, rows: Ints, change: SectionChange = NO_CHANGE
    ) -> tuple[Contribution, ...]:
        layout = layout_of(self.members, mesh)
        if not layout.zone.any():
            return ()
        dofs, masses = [], []
        for k in range(2):
            g = self.lines(mesh, rows[layout.zone[rows, k] > 0], change=change)
            dofs.append(g.dofs[:, 6 * k : 6 * k + 6])
            masses.append(zone_masses(layout, g, k, change))
        if not any(len(part) for part in dofs):
            return ()
        return (Contribution(np.concatenate(dofs), M=np.concatenate(masses)),)

    def interpolate(self, mesh: Mesh, locations: list[Location]) -> tuple[Ints, Array]:
        """Return the displacements and rotations at places along lines as functions of the DOFs.

        At the very ends of a member, beyond a release, and in its rigid zones they are the node's.

        Returns
        -------
        dofs : ndarray of int (n, 12)
            Global DOF numbers.
        N : ndarray (n, 6, 12)
            u(place) = N u[dofs]; global axes, at the line of the mesh.
        """
        return self.motions_at(mesh, [at.line for at in locations], np.array([at.xi for at in locations]))

    def motions_at(
        self, mesh: Mesh, lines: ArrayLike, xi: Array, slipped: bool = False
    ) -> tuple[Ints, Array]:
        """Return the same as :meth:`interpolate` at fractions (n,) of lines (n,).

        If ``slipped``, the ends of members move as the members do, behind their releases and springs.
        """
        g = self.lines(mesh, lines)
        return g.dofs, motion_matrix(g, mesh, xi, slipped)

    def axis_displacements(self, mesh: Mesh, lines: Ints, xi: Floats, u: Floats) -> Floats:
        """Return the displacements of places on the lines' axes, global, shape (n, 3, n_cases) [m].

        Parameters
        ----------
        mesh : Mesh
        lines, xi : ndarray (n,)
            Lines, and fractions of their axes.
        u : ndarray (n_dof, n_cases)
            Motions of all DOFs.
        """
        rows, each = np.unique(lines, return_inverse=True)
        return axis_displacements(self.lines(mesh, rows), each, xi, u)

    def interpolate_slope(self, mesh: Mesh, locations: list[Location]) -> Array:
        """Return the derivative of :meth:`interpolate`'s N by arc length, shape (n, 6, 12) [1/m]."""
        g = self.lines(mesh, [at.line for at in locations])
        # complex step: no cancellation, so the step may be tiny and the derivative is exact
        step = 1j * 1e-200 / mesh.lengths()[g.rows]
        return np.imag(motion_matrix(g, mesh, np.array([at.xi for at in locations]) + step)) / 1e-200

    def shapes_at(self, mesh: Mesh, member: str, position: Any) -> tuple[Ints, Array]:
        """Return :meth:`interpolate`'s DOFs (12,) and N (6, 12) at an arc length of a member [m].

        It may carry a complex step.
        """
        real = float(np.real(position))
        dofs, N = self.kept.get(("shapes", mesh, member, real), lambda: _shapes(self, mesh, member, real))
        if np.iscomplexobj(position):
            slope = self.interpolate_slope(mesh, [mesh.locate(member, real)])[0]
            return dofs, N + 1j * np.imag(position) * slope
        return dofs, N

    def rigidity(self, mesh: Mesh, locations: list[Location]) -> Array:
        """Return EA, ky GA, kz GA, GJ, EIy and EIz at places along lines, (n, 6); 0 without shear strain."""
        g = self.lines(mesh, [at.line for at in locations], maps=False)
        at = constants_along(g, flexible_fraction(g, np.array([at.xi for at in locations])))
        G = g.E / (2 * (1 + g.nu))
        by_key = {"A": g.E, "kAy": G, "kAz": G, "J": G, "Iy": g.E, "Iz": g.E}
        return np.stack([modulus * at[key] for key, modulus in by_key.items()], axis=-1)

    def forces_of_strains(self, mesh: Mesh, lines: ArrayLike, strain: Floats) -> Array:
        """Return the nodal forces that do the work of lines' initial strains, global, (n, 12, n_cases).

        f = ∫ Bᵀ D ε₀ dx = K u₀ with the motion u₀ of a free line under the strain.

        Parameters
        ----------
        mesh : Mesh
        lines : array_like of int (n,)
        strain : ndarray (n, 6, n_cases)
            Elongation, twist and curvatures at x, rx, ry and rz, constant along each line [-, 1/m].
        """
        g = self.lines(mesh, lines)
        u = np.zeros((len(g.L), 12, strain.shape[2]))
        L = g.L[:, None]
        for d in (0, 3, 4, 5):
            u[:, 6 + d] = strain[:, d] * L
        u[:, 7], u[:, 8] = strain[:, 5] * L**2 / 2, -strain[:, 4] * L**2 / 2
        out: Array = np.swapaxes(g.T, 1, 2) @ (local_stiffness(with_rigid_ends(g)) @ u)
        return out

    def mass_per_length(self, member: str) -> Any:
        """Return ρ A with the current density and the section of the first end [kg/m]."""
        p = self.members[member]
        return self.values.get(f"rho:{p.material.name}", p.material.rho) * p.section.A

    def geometric_stiffness(self, model: Model, member: str, tension: Any) -> Contribution:
        """Return the geometric stiffness of a member under a constant tension N.

        ∫ N (v'² + w'² + (Iy + Iz)/A a'²) dx with the twist a, along all of the axis: rigid zones turn with
        their nodes.
        """
        mesh = model.mesh
        unit = self.kept.get(("unit tension", mesh, member), lambda: _unit_tension(self, mesh, member))
        return Contribution(unit.dofs, tension * unit.K)


def _merged(mesh: Mesh, rows: Ints, parts: list[tuple[Bools, Contribution]]) -> Contribution:
    """Return the elements of lines from those of parts of the lines, which masks select."""
    merged: dict[str, Array | None] = {"D": None}
    for key in "KMD" if any(c.D is not None for _, c in parts) else "KM":
        found = [(part, getattr(c, key)) for part, c in parts if getattr(c, key) is not None]
        X = np.zeros((len(rows), 12, 12), dtype=np.result_type(*(Y for _, Y in found)))
        for part, Y in found:
            X[part] = Y
        merged[key] = X
    dofs = dofs_of(mesh.lines[rows]).reshape(len(rows), 12)
    return Contribution(dofs, merged["K"], merged["M"], None, merged["D"], lines=rows)


def nominal(frame: Frame) -> Frame:
    """Return a frame with the moduli and densities of its materials instead of fitted ones.

    Relative changes refer to it, so that they mean the same before, during and after a fit.
    """
    return frame.kept.get("nominal", lambda: replace(frame, values={})) if frame.values else frame


def member_contribution(frame: Frame, model: Model, member: str) -> tuple[Contribution, ...]:
    """Return one member's stiffness, mass and structural damping.

    Nominal frames keep them; those of fitted values change each step.
    """
    mesh = model.mesh

    def make() -> tuple[Contribution, ...]:
        return frame.contribution_of(model, mesh.members[member])

    return make() if frame.values else frame.kept.get(("contribution", mesh, member), make)


def changes_between(old: tuple[Contribution, ...], new: tuple[Contribution, ...]) -> tuple[Contribution, ...]:
    """Return the changes of K, M and D from contributions to others of the same elements."""

    def minus(a: Array | None, b: Array | None) -> Array | None:
        if a is None or b is None:
            return None
        change = a - b  # symmetric but for the rounding of the parts that cancel
        return (change + np.swapaxes(change, 1, 2)) / 2

    return tuple(
        Contribution(c.dofs, minus(c.K, o.K), minus(c.M, o.M), D=minus(c.D, o.D))
        for c, o in zip(new, old, strict=True)
    )


def _unit_tension(frame: Frame, mesh: Mesh, member: str) -> Contribution:
    g = frame.lines(mesh, mesh.members[member])
    return Contribution(g.dofs, unit_tension_stiffness(g))


def _shapes(frame: Frame, mesh: Mesh, member: str, position: float) -> tuple[Ints, Array]:
    (dofs,), (N,) = frame.interpolate(mesh, [mesh.locate(member, position)])
    dofs.flags.writeable = N.flags.writeable = False
    return dofs, N
