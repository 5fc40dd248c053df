"""The frame itself: two-node, 12-DOF beams and bars along the members of a mesh."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fem.elements import tapered
from fem.mesh import Location, Mesh
from fem.model import (
    DIRECTIONS,
    Array,
    Contribution,
    Effect,
    Model,
    ModelError,
    Parameter,
    dofs_of,
    lever_stiffness,
)
from fem.properties import Material, Section

THEORIES = ("timoshenko", "euler-bernoulli", "bar")
MASSES = ("consistent", "higher-order", "lumped")
_BATCH = 2048
"""Elements that are formed at a time: what they need stays within some megabytes."""
_MANY_LINES = 100_000
"""Axes and lengths of all lines are kept for meshes of at most so many."""
_ALIKE = 1e-10
"""Relative difference of lengths and axes up to which elements count as alike: coordinates are rounded."""


@dataclass(frozen=True, slots=True, eq=False)
class MemberProperties:
    """What a member is made of, how it lies, and how it holds to its ends.

    Attributes
    ----------
    material : Material
    section : Section
        Of the whole member, or at its first end.
    orientation : ndarray (3,) or None
        A vector that, with the member's axis, spans the plane of the section's height (local z). Global Z,
        or global X for members within 1° of vertical, unless given.
    offset1, offset2 : ndarray (3,)
        From the mesh's line to the member's axis at the first and second end, global, linear in between [m].
    rigid1, rigid2 : float
        Lengths of the rigid end zones [m]; they have the member's mass.
    theory : str
        ``"timoshenko"`` (shear and rotary inertia), ``"euler-bernoulli"`` (neither) or ``"bar"`` (axial
        stiffness alone, mass in all translations). A cable is a bar of several elements with a pretension;
        it does not sag.
    section2 : Section or None
        At the second end of a tapered member. The elements integrate the taper (`fem.elements.tapered`), so
        that errors fall with the element size as those of prismatic members do.
    mass : str
        ``"consistent"`` (of the shape functions); ``"higher-order"``, which adds what the shape functions
        leave out of the motion within an element, as far as it stretches, twists and shears, so that most of
        the mesh's error is gone; or ``"lumped"``: at each node half of an element's mass, of its rotary
        inertia about x and, with the Timoshenko theory, of that of bending. No inertia m L² comes with it:
        without one, bending frequencies err by order h⁴ instead of h².
    release1, release2 : tuple of str
        Local directions (x y z rx ry rz) in which the first and second end is free: hinges and sliders.
    spring1, spring2 : mapping of str to float
        Stiffness of the connection of the first and second end in local directions: rigid unless given;
        0 is a release [N/m, N·m/rad].
    pretension : float
        Axial force of the state about which the member vibrates, positive in tension [N].
    """

    material: Material
    section: Section
    orientation: NDArray[np.float64] | None = None
    offset1: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    offset2: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    rigid1: float = 0.0
    rigid2: float = 0.0
    theory: str = "timoshenko"
    section2: Section | None = None
    mass: str = "consistent"
    release1: tuple[str, ...] = ()
    release2: tuple[str, ...] = ()
    spring1: Mapping[str, float] = field(default_factory=dict)
    spring2: Mapping[str, float] = field(default_factory=dict)
    pretension: float = 0.0

    def __post_init__(self) -> None:
        for what, value, allowed in (("beam theory", self.theory, THEORIES), ("mass", self.mass, MASSES)):
            if value not in allowed:
                msg = f"the {what} is '{value}'; allowed are {', '.join(allowed)}"
                raise ModelError(msg)
        if self.rigid1 < 0 or self.rigid2 < 0:
            msg = f"rigid end zones are {self.rigid1:g} and {self.rigid2:g} m; they cannot be negative"
            raise ModelError(msg)
        if not np.isfinite(self.pretension):
            msg = f"the pretension is {self.pretension}; it must be a finite number [N]"
            raise ModelError(msg)
        if self.section2 is not None:
            Section.between(self.section, self.section2, 0.5)
        _check_ends(self)

    @property
    def end_stiffness(self) -> NDArray[np.float64]:
        """Stiffness of the connections of both ends in local directions, inf where rigid, shape (12,)."""
        k = np.full(12, np.inf)
        for end, (free, springs) in enumerate(((self.release1, self.spring1), (self.release2, self.spring2))):
            for d, value in ({**dict.fromkeys(free, 0.0), **springs}).items():
                k[6 * end + DIRECTIONS.index(d)] = value
        return k


_HELD = {
    "stretching": (("x",), 1),
    "torsion": (("rx",), 1),
    "bending in x-z": (("z", "ry"), 2),
    "bending in x-y": (("y", "rz"), 2),
}
"""Local directions that share a strain energy, and how many rigid motions it has."""


def _check_ends(p: MemberProperties) -> None:
    """Refuse directions that do not exist, are said twice, or leave the member loose."""
    for end, (free, springs) in enumerate(((p.release1, p.spring1), (p.release2, p.spring2)), start=1):
        for d in (*free, *springs):
            if d not in DIRECTIONS:
                msg = f"end {end} is released in '{d}'; allowed are {', '.join(DIRECTIONS)} (local axes)"
                raise ModelError(msg)
            if d in free and d in springs:
                msg = f"end {end} has both a release and a spring in {d}; give one of them"
                raise ModelError(msg)
        for d, k in springs.items():
            if not k >= 0:
                msg = f"the spring of end {end} in {d} is {k}; it must be at least 0 (inf is rigid)"
                raise ModelError(msg)
    if p.theory == "bar" and (p.release1 or p.release2 or p.spring1 or p.spring2):
        msg = "a bar has no moments to release, and nothing but its axial stiffness; leave its releases out"
        raise ModelError(msg)
    k = p.end_stiffness
    for what, (directions, n) in _HELD.items():
        free = [
            f"{d} at end {e + 1}" for e in (0, 1) for d in directions if k[6 * e + DIRECTIONS.index(d)] == 0
        ]
        both = len([w for w in free if w.startswith(f"{directions[0]} ")]) == 2
        if len(free) > n or both:
            msg = f"with {', '.join(free)} released, nothing holds the member's {what}; release fewer"
            raise ModelError(msg)


_CONSTANTS = ("A", "Iy", "Iz", "Ip", "J", "ky", "kz")
_ALONG = {key: i for i, key in enumerate(("A", "Iy", "Iz", "Ip", "J", "sy", "sz"))}
"""Columns of what changes along tapered lines; s are shear flexibilities 1/(kGA) for E = 1."""


@dataclass(frozen=True, slots=True, eq=False)
class _Layout:
    """What every line of a mesh is made of: a row of a table of kinds, and where it begins and ends."""

    kind: NDArray[np.int64]  # (n_lines,) row of the table
    table: dict[str, NDArray[np.float64]]  # (n_kinds, ...)
    materials: tuple[Material, ...]  # of each kind
    offset: NDArray[np.float64]  # (n_lines, 2, 3): from the nodes to the ends of the axis
    zone: NDArray[np.float64]  # (n_lines, 2): lengths of the rigid zones
    soft: NDArray[np.int64]  # (n_lines,): row of ends, -1 for rigid connections
    ends: NDArray[np.float64]  # (n_soft, 12): stiffness of the connections
    plain: NDArray[np.bool_]  # (n_lines,): prismatic, point to point, no rigid zones, no ends that slip
    taper: NDArray[np.int64]  # (n_lines,): row of knots, -1 for prismatic lines
    knots: NDArray[np.float64]  # (n_tapers, N_KNOTS, 7): constants along members
    along: NDArray[np.float64]  # (n_lines, 2): where lines with a taper begin and end along their members


@dataclass(frozen=True, slots=True, eq=False)
class _Lines:
    """Geometry and properties of some lines, in arrays with one row per line."""

    rows: NDArray[np.int64]
    dofs: NDArray[np.int64]  # (b, 12)
    T: Array  # (b, 12, 12): local displacements of the flexible part's ends from global DOFs
    soft: NDArray[np.int64]  # lines whose ends slip
    slip: Array  # (n_soft, 12, 12): what the ends slip, local, from global DOFs; taken from T
    ends: NDArray[np.float64]  # (n_soft, 12): stiffness of what slips, 0 where nothing does
    held: NDArray[np.bool_]  # (n_soft, 12): what does not slip
    R: NDArray[np.float64]  # (b, 3, 3)
    end: NDArray[np.float64]  # (b, 2, 3): from the nodes to the ends of the flexible part
    zone: NDArray[np.float64]  # (b, 2): lengths of the rigid zones
    span: NDArray[np.float64]  # length of the axis between the nodes' offsets
    L: NDArray[np.float64]  # flexible length
    A: NDArray[np.float64]
    Iy: NDArray[np.float64]
    Iz: NDArray[np.float64]
    Ip: NDArray[np.float64]
    J: NDArray[np.float64]
    ky: NDArray[np.float64]
    kz: NDArray[np.float64]
    nu: NDArray[np.float64]
    eta: NDArray[np.float64]
    rotary: NDArray[np.float64]  # 1 with rotary inertia of bending
    bar: NDArray[np.float64]  # 1 for bars
    higher: NDArray[np.float64]  # 1 for mass of higher order
    lumped: NDArray[np.float64]  # 1 for lumped mass
    tension: NDArray[np.float64]
    phi_y: NDArray[np.float64]  # shear parameter for bending in x-y
    phi_z: NDArray[np.float64]
    tapered: NDArray[np.bool_]
    stations: Array  # (b, N_STATIONS, 7), or (b, 0, 7) without tapers: columns as _ALONG
    E: Array
    rho: Array

    @property
    def T_nodes(self) -> Array:
        """As T, before the ends slip, shape (b, 12, 12)."""
        if not self.soft.size:
            return self.T
        T = self.T.copy()
        T[self.soft] += self.slip
        return T


@dataclass(frozen=True, slots=True)
class SectionChange:
    """Factors of sections' constants; complex ones are carried for derivatives.

    Attributes
    ----------
    A, Iy, Iz, Ip, J : float
        Of the area and the second moments [-].
    shear : float
        Of the shear flexibility 1/(k G A), beside that of A [-].
    rotary : float
        Of the rotary inertia of bending, beside those of Iy and Iz [-].
    timoshenko : bool
        Whether ``shear`` and ``rotary`` refer to what the sections have by Timoshenko's theory, also in
        members of the Euler-Bernoulli theory.
    """

    A: Any = 1.0
    Iy: Any = 1.0
    Iz: Any = 1.0
    Ip: Any = 1.0
    J: Any = 1.0
    shear: Any = 1.0
    rotary: Any = 1.0
    timoshenko: bool = False


_NO_CHANGE = SectionChange()


@dataclass(frozen=True, slots=True, eq=False)
class FrameChange:
    """What new moduli and densities make of a frame's matrices: factors, or the differences of some lines.

    Attributes
    ----------
    scale : mapping of str to float
        Factors of K, D and M.
    constant : tuple of Contribution
        Pretensions, which the factor of K does not concern.
    batches : iterator of Contribution
        What is to be added beside.
    """

    scale: Mapping[str, float]
    constant: tuple[Contribution, ...]
    batches: Iterator[Contribution]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Frame(Effect):
    """Beams and bars along members: Timoshenko (or Euler-Bernoulli) with consistent mass unless they say.

    Shape functions that solve the static Timoshenko equations exactly, so that stiffness does not lock:
    Friedman & Kosmatka, Computers & Structures 47 (1993) 473-481.

    Attributes
    ----------
    members : mapping of str to MemberProperties
        For every member of the mesh. Members that share one object are treated together.
    values : mapping of str to number
        Young's moduli ``"E:<material>"`` [Pa] and densities ``"rho:<material>"`` [kg/m³] that replace
        those of the materials; G follows E at constant ν.
    shear : mapping of str to (number, number)
        Factors of members' shear flexibility 1/(k G A) along y and z [-].
    """

    kind: ClassVar[str] = "frame"
    name: str = "frame"
    members: Mapping[str, MemberProperties]
    values: Mapping[str, Any] = field(default_factory=dict)
    shear: Mapping[str, tuple[Any, Any]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        by_name: dict[str, Material] = {}
        for properties in self._different():
            known = by_name.setdefault(properties.material.name, properties.material)
            if known != properties.material:
                msg = f"two different materials have the name '{known.name}'; names must differ"
                raise ModelError(msg)

    def _different(self) -> list[MemberProperties]:
        return list({id(p): p for p in self.members.values()}.values())

    @property
    def materials(self) -> dict[str, Material]:
        """The materials by name."""
        return {p.material.name: p.material for p in self._different()}

    @property
    def where(self) -> str:
        """All members."""
        return "all members"

    @property
    def has_tapers(self) -> bool:
        """Whether a member's section changes along it."""
        return any(p.section2 is not None for p in self._different())

    def tapered_lines(self, mesh: Mesh) -> list[int]:
        """Return the lines whose section changes along them."""
        return np.flatnonzero(_layout(self, mesh).taper >= 0).tolist()

    def parameters(self) -> tuple[Parameter, ...]:
        """Young's modulus and density of each material.

        K is not affine in the modulus of members on springs of their own.
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
        """Return a frame whose members have mass of higher order where it was consistent; itself without."""
        if all(p.mass != "consistent" for p in self._different()):
            return self
        new = {
            id(p): replace(p, mass="higher-order") if p.mass == "consistent" else p for p in self._different()
        }
        return replace(self, members={name: new[id(p)] for name, p in self.members.items()})

    def rotations(self, mesh: Mesh, lines: ArrayLike | None = None) -> NDArray[np.float64]:
        """Return the local axes of some or all lines of the mesh as rows, shape (n_lines, 3, 3)."""
        rows = np.arange(mesh.n_lines) if lines is None else np.asarray(lines, dtype=np.int64)
        return _place(_layout(self, mesh), mesh, rows)[0]

    def alike(self, mesh: Mesh, member: str) -> bool:
        """Whether all elements of a member have the same matrices: equally long, in one line, no offsets."""
        return _alike(_Same(self.members), mesh, member)

    def _lines(
        self, mesh: Mesh, rows: ArrayLike, maps: bool = True, change: SectionChange = _NO_CHANGE
    ) -> _Lines:
        """Return geometry and properties of some lines, and if asked for their maps T."""
        layout, rows = _layout(self, mesh), np.asarray(rows, dtype=np.int64)
        R, end, span, L = _place(layout, mesh, rows)
        kind = layout.kind[rows]
        tapers = layout.taper[rows] >= 0
        unused = ("up", "angle", "k_full_y", "k_full_z")
        table = {key: values[kind] for key, values in layout.table.items() if key not in unused}
        if change is not _NO_CHANGE:
            table = {key: getattr(change, key, 1.0) * values for key, values in table.items()}
            if change.timoshenko:
                beam = 1 - table["bar"]
                table |= {f"k{d}": layout.table[f"k_full_{d}"][kind] * beam for d in "yz"}
                table["rotary"] = change.rotary * beam
        factors = _shear_factors(self, mesh)[:, rows] if self.shear else np.ones((2, len(rows)))
        if self.shear:
            y, z = factors
            table |= {"ky": table["ky"] / y, "kz": table["kz"] / z}
        kinds, each = np.unique(kind, return_inverse=True)
        made_of = [layout.materials[k] for k in kinds]
        E, rho = (
            np.array([self.values.get(f"{key}:{m.name}", getattr(m, key)) for m in made_of])[each]
            for key in ("E", "rho")
        )

        def shear(I: Array, k: Array) -> Array:
            factor = change.shear * 24 * (1 + table["nu"]) * I
            below = k * table["A"] * L**2
            out = np.zeros(L.shape, dtype=np.result_type(factor, below))
            return np.divide(factor, below, out=out, where=np.real(k) > 0)

        T = np.zeros((len(rows), 12, 12) if maps else (len(rows), 0, 0))
        for k in range(2 if maps else 0):
            o = 6 * k
            T[:, o : o + 3, o : o + 3] = R
            T[:, o + 3 : o + 6, o + 3 : o + 6] = R
            T[:, o : o + 3, o + 3 : o + 6] = -R @ _skew(end[:, k])
        soft = np.flatnonzero(layout.soft[rows] >= 0) if maps else np.zeros(0, dtype=np.int64)
        stiff = _Lines(
            rows=rows, dofs=dofs_of(mesh.lines[rows]).reshape(len(rows), 12), T=T, soft=soft[:0],
            slip=np.zeros((0, 12, 12)), ends=np.zeros((0, 12)),
            held=np.zeros((0, 12), dtype=bool), R=R, end=end, zone=layout.zone[rows],
            span=span, L=L, **table, phi_y=shear(table["Iz"], table["ky"]),
            phi_z=shear(table["Iy"], table["kz"]), tapered=tapers,
            stations=_stations(layout, rows, span, change, factors), E=E, rho=rho,
        )  # fmt: skip
        if not soft.size:
            return stiff
        ends = layout.ends[layout.soft[rows[soft]]]
        rigid = np.isinf(ends)
        K = _stiffness(_some(stiff, soft))
        slip = end_slips(K, np.where(rigid, 1.0, ends), np.where(rigid, 0.0, 1.0)) @ T[soft]
        T = T.astype(slip.dtype)
        T[soft] -= slip
        return replace(stiff, T=T, soft=soft, slip=slip, ends=np.where(rigid, 0.0, ends), held=rigid)

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return stiffness, mass and the materials' structural damping of all members, and pretensions."""
        rows = np.arange(model.mesh.n_lines)
        return (*self.contribution_of(model, rows), *self._pretensions(model.mesh))

    def batches(self, model: Model) -> Iterator[Contribution]:
        """Return the same in parts of a few thousand elements."""
        yield from self._batches_of(model.mesh, np.arange(model.mesh.n_lines))
        yield from self._pretensions(model.mesh)

    def change_to(self, other: "Frame", mesh: Mesh) -> FrameChange | None:
        """Return the change of matrices that takes this frame to another one with other values.

        None if more than values differ, or springs at ends make K depend on moduli in another way.
        """
        if self.members is not other.members or self.name != other.name:
            return None
        layout = _layout(self, mesh)
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
        rest = {
            f"{q}:{m.name}": new[i, k] - old[i, k]
            for k, m in enumerate(layout.materials)
            for i, q in enumerate(("E", "rho"))
        }
        rows = np.flatnonzero(differs[layout.kind])
        return FrameChange({}, (), replace(self, values=rest)._batches_of(mesh, rows))

    def _batches_of(self, mesh: Mesh, rows: NDArray[np.int64]) -> Iterator[Contribution]:
        for i in range(0, len(rows), _BATCH):
            yield self._elements(mesh, rows[i : i + _BATCH])
        yield from self._rigid_zone_masses(mesh, rows)

    def contribution_of(
        self, model: Model, rows: ArrayLike, change: SectionChange = _NO_CHANGE
    ) -> tuple[Contribution, ...]:
        """Return stiffness, mass and structural damping of some lines of the mesh, without pretensions.

        ``change`` gives them with other sections.
        """
        rows = np.asarray(rows, dtype=np.int64)
        parts = [
            self._elements(model.mesh, rows[i : i + _BATCH], change) for i in range(0, len(rows), _BATCH)
        ]
        if len(parts) == 1:
            return (parts[0], *self._rigid_zone_masses(model.mesh, rows, change))
        damped = any(part.D is not None for part in parts)
        D = [np.zeros_like(part.K) if part.D is None else part.D for part in parts] if damped else None
        whole = Contribution(
            *(np.concatenate([getattr(part, key) for part in parts]) for key in ("dofs", "K", "M")),
            D=None if D is None else np.concatenate(D),
            lines=rows,
        )
        return (whole, *self._rigid_zone_masses(model.mesh, rows, change))

    def _elements(
        self, mesh: Mesh, rows: NDArray[np.int64], change: SectionChange = _NO_CHANGE
    ) -> Contribution:
        """Return the elements of lines: plain ones in closed form, others by quadrature."""
        layout = _layout(self, mesh)
        plain = layout.plain[rows]
        dofs = dofs_of(mesh.lines[rows]).reshape(len(rows), 12)
        if plain.all():
            g = self._lines(mesh, rows, maps=False, change=change)
            K, M = _spread(g.R, *_plain_stiffness(g)), _spread(g.R, *_plain_mass(g))
            D = g.eta[:, None, None] * K if np.any(g.eta != 0) else None
            return Contribution(dofs, K, M, None, D, lines=rows)
        if plain.any():
            parts = [(part, self._elements(mesh, rows[part], change)) for part in (plain, ~plain)]
            merged: dict[str, Array | None] = {"D": None}
            for key in "KMD" if any(c.D is not None for _, c in parts) else "KM":
                found = [(part, getattr(c, key)) for part, c in parts if getattr(c, key) is not None]
                X = np.zeros((len(rows), 12, 12), dtype=np.result_type(*(Y for _, Y in found)))
                for part, Y in found:
                    X[part] = Y
                merged[key] = X
            return Contribution(dofs, merged["K"], merged["M"], None, merged["D"], lines=rows)
        g = self._lines(mesh, rows, change=change)
        K, M = _to_global(_stiffness(g), g.T), _mass(g)
        D = g.eta[:, None, None] * K if np.any(g.eta != 0) else None
        if g.soft.size:
            K[g.soft] += np.swapaxes(g.slip, 1, 2) @ (g.ends[:, :, None] * g.slip)
        return Contribution(dofs, K, M, None, D, lines=rows)

    def _pretensions(self, mesh: Mesh) -> Iterator[Contribution]:
        layout = _layout(self, mesh)
        rows = np.flatnonzero(layout.table["tension"][layout.kind] != 0)
        for i in range(0, len(rows), _BATCH):
            g = self._lines(mesh, rows[i : i + _BATCH])
            yield Contribution(g.dofs, g.tension[:, None, None] * _tension(g), lines=g.rows)

    def _rigid_zone_masses(
        self, mesh: Mesh, rows: NDArray[np.int64], change: SectionChange = _NO_CHANGE
    ) -> tuple[Contribution, ...]:
        layout = _layout(self, mesh)
        if not layout.zone.any():
            return ()
        dofs, masses = [], []
        for k in range(2):
            g = self._lines(mesh, rows[layout.zone[rows, k] > 0], change=change)
            zone = g.zone[:, k]
            arm = g.end[:, k] - ((0.5 - k) * zone)[:, None] * g.R[:, 0]
            A, Iy, Iz, Ip = _zone_section(layout, g, k, change)
            across = A * zone**2 / 12
            local = np.stack([A, A, A, Ip, Iy + across, Iz + across], axis=1)
            dofs.append(g.dofs[:, 6 * k : 6 * k + 6])
            masses.append(_at_arm(g.R, arm, (g.rho * zone)[:, None] * local))
        if not any(len(part) for part in dofs):
            return ()
        return (Contribution(np.concatenate(dofs), M=np.concatenate(masses)),)

    def interpolate(self, mesh: Mesh, locations: list[Location]) -> tuple[NDArray[np.int64], Array]:
        """Return the displacements and rotations at places along lines as functions of the DOFs.

        At the very ends of a member, and in its rigid zones, they are those of the node: beyond a release.

        Returns
        -------
        dofs : ndarray of int (n, 12)
            Global DOF numbers.
        N : ndarray (n, 6, 12)
            u(place) = N u[dofs]; global axes, at the line of the mesh.
        """
        g = self._lines(mesh, [at.line for at in locations])
        return g.dofs, _motion(g, mesh, np.array([at.xi for at in locations]))

    def interpolate_slope(self, mesh: Mesh, locations: list[Location]) -> Array:
        """Return the derivative of :meth:`interpolate`'s N by arc length, shape (n, 6, 12) [1/m]."""
        g = self._lines(mesh, [at.line for at in locations])
        step = 1j * 1e-200 / mesh.lengths()[g.rows]
        return np.imag(_motion(g, mesh, np.array([at.xi for at in locations]) + step)) / 1e-200

    def rigidity(self, mesh: Mesh, locations: list[Location]) -> Array:
        """Return EA, ky GA, kz GA, GJ, EIy and EIz at places along lines, (n, 6); 0 without shear strain."""
        g = self._lines(mesh, [at.line for at in locations], maps=False)
        at = _constants_along(g, _flexible(g, np.array([at.xi for at in locations])))
        G = g.E / (2 * (1 + g.nu))
        by_key = {"A": g.E, "kAy": G, "kAz": G, "J": G, "Iy": g.E, "Iz": g.E}
        return np.stack([modulus * at[key] for key, modulus in by_key.items()], axis=-1)

    def forces_of_strains(self, mesh: Mesh, lines: ArrayLike, strain: NDArray[np.float64]) -> Array:
        """Return the nodal forces that strains of lines do work by, global, shape (n, 12, n_cases).

        f = ∫ Bᵀ D ε₀ dx = K u₀ with the motion u₀ of a line that takes the strain freely.

        Parameters
        ----------
        mesh : Mesh
        lines : array_like of int (n,)
        strain : ndarray (n, 6, n_cases)
            Elongation, twist and curvatures at x, rx, ry and rz, constant along each line [-, 1/m].
        """
        g = self._lines(mesh, lines)
        u = np.zeros((len(g.L), 12, strain.shape[2]))
        L = g.L[:, None]
        for d in (0, 3, 4, 5):
            u[:, 6 + d] = strain[:, d] * L
        u[:, 7], u[:, 8] = strain[:, 5] * L**2 / 2, -strain[:, 4] * L**2 / 2
        out: Array = np.swapaxes(g.T, 1, 2) @ (_stiffness(_unslipped(g)) @ u)
        return out

    def shapes_at(self, mesh: Mesh, member: str, position: Any) -> tuple[NDArray[np.int64], Array]:
        """Return :meth:`interpolate`'s DOFs (12,) and N (6, 12) at an arc length of a member [m].

        It may carry a complex step.
        """
        real = float(np.real(position))
        dofs, N = _shapes(self, mesh, member, real)
        if np.iscomplexobj(position):
            slope = self.interpolate_slope(mesh, [mesh.locate(member, real)])[0]
            return dofs, N + 1j * np.imag(position) * slope
        return dofs, N

    def strain_energy_matrix(
        self, model: Model, member: str, start: Array, stop: Array, factors: ArrayLike = (1, 1, 1, 1, 1, 1)
    ) -> Contribution:
        """Return stiffness and structural damping of the part of a member between two arc lengths.

        Complex ends give derivatives with respect to them (complex step).

        Parameters
        ----------
        model : Model
        member : str
        start, stop : float
            Arc lengths [m]; cut to the member.
        factors : array_like (6,)
            Weights of the axial, shear y, shear z, torsion, bending y and bending z parts [-].
        """
        g, lo, hi = self._stretch(model.mesh, member, start, stop)
        x, weight = (each[:, None] for each in _gauss(_points(g, 3)))
        at = lo + x * (hi - lo)
        B = _strain(g, at)
        scale = (weight * (hi - lo) * g.L)[..., None] * _rigidity(g, at) * np.asarray(factors)
        K = _to_global((np.swapaxes(B, -1, -2) @ (scale[..., None] * B)).sum(axis=0), g.T)
        return Contribution(g.dofs, K, D=g.eta[:, None, None] * K if np.any(g.eta != 0) else None)

    def _stretch(self, mesh: Mesh, member: str, start: Any, stop: Any) -> tuple[_Lines, Array, Array]:
        """Return the lines of a member between two arc lengths, and where on their flexible parts it is."""
        lines, lo, hi = self._fractions(mesh, member, start, stop)
        g = self._lines(mesh, lines)
        return g, _flexible(g, lo), _flexible(g, hi)

    def _fractions_of(
        self, mesh: Mesh, stretches: Sequence[tuple[str, Any, Any]]
    ) -> tuple[NDArray[np.int64], Array, Array, NDArray[np.int64]]:
        """Return the same for several stretches, one after the other, and which of them each belongs to."""
        lines, lo, hi = zip(*(self._fractions(mesh, *each) for each in stretches), strict=True)
        which = np.repeat(np.arange(len(stretches)), [len(part) for part in lines])
        return np.concatenate(lines), np.concatenate(lo), np.concatenate(hi), which

    def _fractions(
        self, mesh: Mesh, member: str, start: Any, stop: Any
    ) -> tuple[NDArray[np.int64], Array, Array]:
        """Return the lines of a member between two arc lengths, and the fractions of them between these."""
        s = mesh.member_positions(member)
        first: Any = start if np.real(start) > 0 else 0.0
        last: Any = stop if np.real(stop) < s[-1] else float(s[-1])
        touched = np.flatnonzero((s[1:] > np.real(first)) & (s[:-1] < np.real(last)))
        h = s[touched + 1] - s[touched]
        lo = np.array([(first - s[k]) if np.real(first) >= s[k] else 0.0 for k in touched]) / h
        hi = (
            np.array([(last - s[k]) if np.real(last) <= s[k + 1] else h[i] for i, k in enumerate(touched)])
            / h
        )
        return mesh.members[member][touched], lo, hi

    def mass_matrix(
        self, model: Model, member: str, start: Any, stop: Any, weights: ArrayLike
    ) -> Contribution:
        """Return the mass of a layer on a member between two arc lengths, as :meth:`strain_energy_matrix`.

        M = ∫ Nᵀ diag(weights) N dx, N the motion of the member's axis in local axes, in rigid zones that of
        the node's body.

        Parameters
        ----------
        model : Model
        member : str
        start, stop : float
            Arc lengths [m]; cut to the member. Complex ones give derivatives (complex step).
        weights : array_like (6,)
            Mass and rotary inertia per length in local x y z rx ry rz [kg/m, kg·m].
        """
        return self.masses(model, [(member, start, stop, 1.0)], weights)

    def masses(
        self, model: Model, stretches: Sequence[tuple[str, Any, Any, Any]], weights: ArrayLike
    ) -> Contribution:
        """Return the same for several stretches at once: member, both arc lengths, and a factor of each."""
        lines, first, last, which = self._fractions_of(model.mesh, [s[:3] for s in stretches])
        factor = np.array([s[3] for s in stretches])[which]
        g, per_length = self._lines(model.mesh, lines), np.asarray(weights, dtype=float)
        a, b = _flexible(g, first), _flexible(g, last)
        x, weight = (each[:, None] for each in _gauss(_points(g, 4)))
        N = _shape(g, a + x * (b - a))
        scale = (weight * (b - a) * g.L)[..., None] * per_length
        M = _to_global((np.swapaxes(N, -1, -2) @ (scale[..., None] * N)).sum(axis=0), g.T)
        if g.zone.any():
            for k, part in enumerate(_in_rigid_zones(g, first * g.span, last * g.span, per_length)):
                M[:, 6 * k : 6 * k + 6, 6 * k : 6 * k + 6] += part
        return Contribution(g.dofs, M=factor[:, None, None] * M)

    def cut(self, model: Model, member: str, position: Any, direction: str, compliance: Any) -> Contribution:
        """Return how K, M and D change where a member gives way at a place, in one direction.

        The two sides of the cut slip by the compliance c times the force that is passed. With m the motion
        of the element's second end that a unit slip lets it have, and K of the element between its points,

            ΔK = -c K m mᵀ K / (1 + c mᵀ K m),

        which is exact: the element's flexibility grows by c times the square of the force at the cut
        (Przemieniecki, Theory of Matrix Structural Analysis, ch. 8). At a member's end it is what a spring of
        1/c makes. The element's shapes N get the kink ψ = r - N m of a unit slip, r the rigid motion of what
        lies beyond, so that with a = c / (1 + c mᵀ K m), μ the mass per length and q = K m

            ΔM = a (b qᵀ + q bᵀ) + a² β q qᵀ,   b = ∫ Nᵀ μ ψ dx,   β = ∫ ψᵀ μ ψ dx.

        Without that the mass follows the nodes, and frequencies err with the cube of the element's part of
        the member. Lumps stay with the nodes.

        Parameters
        ----------
        model : Model
        member : str
        position : float
            Arc length [m]; complex for derivatives.
        direction : str
            x y z rx ry rz, local.
        compliance : float
            c [m/N or rad/(N·m)].
        """
        mesh = model.mesh
        at = mesh.locate(member, float(np.real(position)))
        g, K0, whole = _uncut(self, mesh, at.line)
        xi = at.xi + (1j * np.imag(position) / mesh.lengths()[at.line] if np.iscomplexobj(position) else 0.0)
        x = _flexible(g, np.atleast_1d(xi))[0]
        i = DIRECTIONS.index(direction)
        m = np.zeros(12, dtype=np.result_type(x))
        m[6 + i] = 1.0
        arm = (1 - x) * g.L[0]
        if direction == "ry":
            m[8] = -arm
        if direction == "rz":
            m[7] = arm
        q = K0 @ m
        slip = compliance / (1 + compliance * (m @ q))
        K = _to_global((-slip * np.outer(q, q))[None], g.T_nodes)
        M = None
        if not g.lumped[0]:
            rigid = m.copy()
            rigid[i] = 1.0
            if direction == "ry":
                rigid[2] = x * g.L[0]
            if direction == "rz":
                rigid[1] = -x * g.L[0]
            beyond = whole * (1.0 - x) if x in (0.0, 1.0) else _from_nodes(g, _local_mass(g, x))[0]
            b = beyond @ rigid - whole @ m
            beta = rigid @ beyond @ rigid - 2 * (m @ beyond @ rigid) + m @ whole @ m
            bent = slip * np.outer(b, q)
            M = _to_global((bent + bent.T + slip**2 * beta * np.outer(q, q))[None], g.T_nodes)
        return Contribution(g.dofs, K, M, D=g.eta[:, None, None] * K if np.any(g.eta != 0) else None)

    def stiffened(
        self, model: Model, zones: Sequence[tuple[str, float, Any, int]], flexibility: float
    ) -> Contribution:
        """Return what K and D gain where stretches of members are stiffer.

        Of the elements' flexibility F = ∫ bᵀ f b dx, b the section forces of unit forces at the second end,
        the stretches keep a part: exact for any length, also within an element. M stays.

        Parameters
        ----------
        model : Model
        zones : sequence of (str, float, float, int)
            Member, arc length at which the stretch begins, its length [m], and 1 or -1 for up or down the
            member. A length may be complex, for derivatives. Stretches must not overlap.
        flexibility : float
            Part of its flexibility that a stretch keeps [-].
        """
        stretches, lost = [], []
        for member, start, length, towards in zones:
            reach = begun(length, 1e-9 * model.mesh.member_length(member))
            ends = (start, start + reach) if towards > 0 else (start - reach, start)
            stretches.append((member, *ends))
            lost.append((1 - flexibility) * (length / reach))
        lines, lo, hi, which = self._fractions_of(model.mesh, stretches)
        touched, each = np.unique(lines, return_inverse=True)
        g = self._lines(model.mesh, touched)
        parts = _some(g, each)
        less = np.array(lost)[which, None, None] * _flexibility(
            parts, _flexible(parts, lo), _flexible(parts, hi)
        )
        F = _flexibility(g, np.zeros(len(g.L)), np.ones(len(g.L))).astype(less.dtype)
        before = _with_ends(g, _from_flexibility(g, F))
        np.subtract.at(F, each, less)
        K = _to_global(_with_ends(g, _from_flexibility(g, F)) - before, g.T_nodes)
        return Contribution(g.dofs, K, D=g.eta[:, None, None] * K if np.any(g.eta != 0) else None)

    def mass_per_length(self, member: str) -> Any:
        """Return ρ A with the density as it is now and the section of the first end [kg/m]."""
        p = self.members[member]
        return self.values.get(f"rho:{p.material.name}", p.material.rho) * p.section.A

    def geometric_stiffness(self, model: Model, member: str, tension: Any) -> Contribution:
        """Return the geometric stiffness of a member under a constant tension N.

        ∫ N (v'² + w'² + (Iy + Iz)/A a'²) dx with the twist a, along the whole axis: rigid zones turn with
        their nodes.
        """
        unit = _unit_tension(self, model, member)
        return Contribution(unit.dofs, tension * unit.K)


def end_slips(K: Array, hold: Array, give: Array) -> Array:
    """Return how much the ends of an element slip in their connections, δ = G u, as G (b, n, n).

    The connection's force is that of the element, K (u - δ). With u at the node and u - δ at the element's
    end, each direction obeys hold δ = give K (u - δ), so that (hold + give K) δ = give K u. The element keeps
    its shape functions at u - δ = (1 - G) u, and KG is what its stiffness loses. For one direction e and
    the compliance c this is c K e eᵀK / (1 + c eᵀK e): Monforton & Wu, J. Struct. Div. ASCE 89 (1963) 13-42.

    Parameters
    ----------
    K : ndarray (b, n, n)
        Stiffness of the elements without connections.
    hold, give : ndarray (b, n)
        Spring of stiffness k: k and 1. Spring of compliance c: 1 and c. Rigid: 1 and 0. Free: 0 and 1.
    """
    inner = give[:, :, None] * K * (give != 0)[:, None, :]
    index = np.arange(K.shape[1])
    inner[:, index, index] += hold
    return np.linalg.solve(inner, give[:, :, None] * K)


def begun(length: Any, least: float) -> Any:
    """Return a length, or where it is less a least one with its imaginary part.

    What grows with a length that is 0 has a derivative all the same: that of what begins.
    """
    if np.real(length) > least:
        return length
    return least + 1j * length.imag if np.iscomplexobj(length) else least


@lru_cache(maxsize=32)
def nominal(frame: Frame) -> Frame:
    """Return a frame with the moduli and densities of its materials, whatever has been fitted since.

    Relative changes refer to it, so that they mean the same before, in and after a fit.
    """
    return replace(frame, values={}) if frame.values else frame


class _Same:
    """An object that equals itself alone, and can be a key."""

    def __init__(self, held: Any) -> None:
        self.held = held

    def __hash__(self) -> int:
        return id(self.held)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Same) and other.held is self.held


def _layout(frame: Frame, mesh: Mesh) -> _Layout:
    """Return what each line is made of, whatever the values of moduli and densities."""
    return _layout_of(_Same(frame.members), mesh)


@lru_cache(maxsize=8)
def _layout_of(members: _Same, mesh: Mesh) -> _Layout:
    """Return the same, kept for the last few frames and meshes."""
    made_of: Mapping[str, MemberProperties] = members.held
    names = list(mesh.members)
    try:
        of_member = [made_of[name] for name in names]
    except KeyError:
        missing = next(name for name in names if name not in made_of)
        msg = f"member '{missing}' of the mesh has no material and section; given are {', '.join(made_of)}"
        raise ModelError(msg) from None
    different = list({id(p): p for p in of_member}.values())
    number = {id(p): i for i, p in enumerate(different)}
    owner = np.array([number[id(p)] for p in of_member])
    chains, member = mesh.chains()
    made = np.empty(mesh.n_lines, dtype=np.int64)
    made[chains] = owner[member]

    uneven = [p.section2 is not None or not np.array_equal(p.offset1, p.offset2) for p in different]
    along = mesh.arc_fractions() if any(uneven) else np.zeros((mesh.n_lines, 2))
    kind, kinds = _kinds(different, made, along)
    offset = np.zeros((1, 2, 3))
    if any(p.offset1.any() or p.offset2.any() for p in different):
        first, second = (
            np.array([getattr(p, key) for p in different])[made] for key in ("offset1", "offset2")
        )
        offset = first[:, None] + along[:, :, None] * (second - first)[:, None]
    zone, soft, ends = _end_lines(different, owner, mesh)
    taper, knots = _tapers(different, made)
    plain = (soft < 0) & (taper < 0)
    for part in (offset, zone):
        plain &= ~part.any(axis=tuple(range(1, part.ndim)))
    layout = _Layout(
        kind,
        {
            **{key: np.array([getattr(s, key) for _, s in kinds]) for key in (*_CONSTANTS, "angle")},
            "nu": np.array([p.material.nu for p, _ in kinds]),
            "eta": np.array([p.material.loss_factor for p, _ in kinds]),
            "rotary": np.array([float(p.theory == "timoshenko") for p, _ in kinds]),
            "bar": np.array([float(p.theory == "bar") for p, _ in kinds]),
            "higher": np.array([float(p.mass == "higher-order") for p, _ in kinds]),
            "lumped": np.array([float(p.mass == "lumped") for p, _ in kinds]),
            "tension": np.array([p.pretension for p, _ in kinds]),
            "up": np.array(
                [np.full(3, np.nan) if p.orientation is None else p.orientation for p, _ in kinds]
            ),
        },
        tuple(p.material for p, _ in kinds),
        np.broadcast_to(offset, (mesh.n_lines, 2, 3)),
        np.broadcast_to(zone, (mesh.n_lines, 2)),
        soft,
        ends,
        plain,
        taper,
        knots,
        along,
    )
    for d in ("y", "z"):
        layout.table[f"k_full_{d}"] = layout.table[f"k{d}"].copy()
        layout.table[f"k{d}"][layout.table["rotary"] == 0] = 0.0
    _check_layout(layout, mesh)
    return layout


def _kinds(
    different: list[MemberProperties], made: NDArray[np.int64], along: NDArray[np.float64]
) -> tuple[NDArray[np.int64], list[tuple[MemberProperties, Section]]]:
    """Return the row of each line in a list of properties with sections, and the list."""
    kinds = [(p, p.section) for p in different]
    kind = made.copy()
    for i, p in enumerate(different):
        if p.section2 is None:
            continue
        rows = np.flatnonzero(made == i)
        middle, which = np.unique(along[rows].mean(axis=1), return_inverse=True)
        kind[rows] = len(kinds) + which
        kinds += [(p, Section.between(p.section, p.section2, float(x))) for x in middle]
    return kind, kinds


def _tapers(
    different: list[MemberProperties], made: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the row of each line in a table of tapers, -1 for none, and constants at the tapers' knots."""
    row, knots = np.full(len(made), -1), []
    for i, p in enumerate(different):
        if p.section2 is not None:
            row[made == i] = len(knots)
            sections = [Section.between(p.section, p.section2, float(x)) for x in tapered.KNOTS]
            knots.append([[getattr(s, key) for key in _CONSTANTS] for s in sections])
    return row, np.array(knots).reshape(-1, tapered.N_KNOTS, len(_CONSTANTS))


def _constants_at(layout: _Layout, rows: NDArray[np.int64], x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the constants of tapered lines at fractions x (b, q) of them, shape (b, q, 7)."""
    first, last = layout.along[rows].T[:, :, None]
    return tapered.between_knots(first + x * (last - first)) @ layout.knots[layout.taper[rows]]


def _stations(
    layout: _Layout,
    rows: NDArray[np.int64],
    span: NDArray[np.float64],
    change: SectionChange,
    shear: Array,
) -> Array:
    """Return what changes along the flexible parts of lines, shape (b, N_STATIONS, 7); 1 where nothing does.

    ``shear`` are factors of the shear flexibility along y and z, (2, b). Empty, (b, 0, 7), without tapers.
    """
    some = np.flatnonzero(layout.taper[rows] >= 0)
    if not some.size:
        return np.zeros((len(rows), 0, len(_ALONG)))
    lines, kind = rows[some], layout.kind[rows[some]]
    zone = layout.zone[lines] / span[some, None]
    first, last = zone[:, :1], 1 - zone[:, 1:]
    at = _constants_at(layout, lines, first + tapered.STATIONS * (last - first))
    sizes = at[..., :5] * np.array([getattr(change, key) for key in _CONSTANTS[:5]])
    sheared = 1 - layout.table["bar"] if change.timoshenko else layout.table["rotary"]
    k = at[..., 5:] * sheared[kind, None, None]
    flexibility = change.shear * 2 * (1 + layout.table["nu"][kind, None, None]) * shear.T[some, None, :]
    flexibility = flexibility * (k > 0) / (np.where(k > 0, k, 1.0) * sizes[..., :1])
    out = np.ones((len(rows), *at.shape[1:]), dtype=np.result_type(sizes, flexibility))
    out[some] = np.concatenate([sizes, flexibility], axis=-1)
    return out


def _zone_section(layout: _Layout, g: _Lines, k: int, change: SectionChange) -> Array:
    """Return A, Iy, Iz and Ip of the rigid zones at ends k, shape (4, b); under a taper their means."""
    of = np.stack([g.A, g.Iy, g.Iz, g.Ip])
    t = np.flatnonzero(g.tapered)
    if t.size:
        x, weight = _gauss(3)  # A is quadratic in tapers
        at = x * g.zone[t, k, None] / g.span[t, None]
        own = (weight @ _constants_at(layout, g.rows[t], at if k == 0 else 1 - at)[..., :4]).T
        factor = np.array([change.A, change.Iy, change.Iz, change.Ip])[:, None]
        of = of.astype(np.result_type(of, factor))
        of[:, t] = factor * own
    return of


def _end_lines(
    different: list[MemberProperties], owner: NDArray[np.int64], mesh: Mesh
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64]]:
    """Return the rigid zones (n_lines, 2), and rows and stiffness of the connections of members' ends."""
    n = mesh.n_lines
    chains, member = mesh.chains()
    at = np.searchsorted(member, np.arange(len(owner) + 1))
    edge = chains[at[:-1]], chains[at[1:] - 1]  # first and last line of each member
    zone, soft = np.zeros((1, 2)), np.full(n, -1)
    zones = np.array([[p.rigid1, p.rigid2] for p in different])
    if zones.any():
        zone = np.zeros((n, 2))
        for k in range(2):
            zone[edge[k], k] = zones[owner, k]
    springs = np.array([p.end_stiffness for p in different])
    ends = np.zeros((0, 12))
    if np.isfinite(springs).any():
        lines = np.unique(
            np.concatenate(
                [edge[k][np.isfinite(springs[owner, 6 * k : 6 * k + 6]).any(axis=1)] for k in range(2)]
            )
        )
        soft[lines] = np.arange(len(lines))
        ends = np.full((len(lines), 12), np.inf)
        for k in range(2):
            mine = soft[edge[k]] >= 0
            part = slice(6 * k, 6 * k + 6)
            ends[soft[edge[k][mine]], part] = springs[owner[mine], part]
    return zone, soft, ends


def _check_layout(layout: _Layout, mesh: Mesh) -> None:
    """Refuse orientations along a member and rigid zones that do not fit."""

    def name(row: int) -> str:
        return str(mesh.member_of_line()[row])

    rows = np.flatnonzero(np.isfinite(layout.table["up"][layout.kind, 0]))
    if rows.size:
        t = _along(layout, mesh, rows)
        up = layout.table["up"][layout.kind[rows]]
        parallel = _is_parallel(t, up)
        if parallel.any():
            i = int(np.flatnonzero(parallel)[0])
            raise ModelError(_parallel(name(int(rows[i])), up[i]))
    bars = np.flatnonzero((layout.table["bar"][layout.kind] != 0) & layout.offset.any(axis=(1, 2)))
    if bars.size:
        chains, member = mesh.chains()
        of, count = np.empty(mesh.n_lines, dtype=np.int64), np.bincount(member)
        of[chains] = member
        loose = bars[count[of[bars]] > 1]
        if loose.size:
            msg = (
                f"bar '{name(int(loose[0]))}' has an offset and {count[of[loose[0]]]} elements; nothing "
                "keeps the points between them from turning about its axis: give it one element, or no "
                "offset"
            )
            raise ModelError(msg)
    rows = np.flatnonzero(layout.zone.any(axis=1))
    if not rows.size:
        return
    zone, span = layout.zone[rows], np.linalg.norm(_along(layout, mesh, rows), axis=1)
    for k, room in ((0, span - zone[:, 0]), (1, span - zone.sum(axis=1))):
        bad = np.flatnonzero((zone[:, k] > 0) & (room <= 0.001 * span))
        if bad.size:
            i = int(bad[0])
            msg = (
                f"member '{name(int(rows[i]))}': the rigid end zone of {zone[i, k]:g} m does not fit into "
                f"the element at that end ({span[i]:g} m); use larger elements"
            )
            raise ModelError(msg)


def _along(layout: _Layout, mesh: Mesh, rows: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the vectors along the axes of lines, shape (b, 3) [m]; offsets that change turn them."""
    line = mesh.lines[rows]
    return mesh.points[line[:, 1]] - mesh.points[line[:, 0]] + layout.offset[rows, 1] - layout.offset[rows, 0]


def _place(
    layout: _Layout, mesh: Mesh, rows: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return local axes, arms to the flexible part's ends, length of the axis and of the flexible part.

    Of meshes of usual size they are kept for all lines.
    """
    if mesh.n_lines > _MANY_LINES:
        return _places_of(layout, mesh, rows)
    axes, arms, span, L = _kept_places(layout, mesh)
    return axes[rows], arms[rows], span[rows], L[rows]


@lru_cache(maxsize=8)
def _kept_places(
    layout: _Layout, mesh: Mesh
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    return _places_of(layout, mesh, np.arange(mesh.n_lines))


def _places_of(
    layout: _Layout, mesh: Mesh, rows: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    t = _along(layout, mesh, rows)
    kind = layout.kind[rows]
    R = _turned(_axes(t, layout.table["up"][kind]), layout.table["angle"][kind])
    span = np.linalg.norm(t, axis=1)
    zone = layout.zone[rows]
    end = layout.offset[rows] + (zone * [1.0, -1.0])[:, :, None] * R[:, None, 0]
    return R, end, span, span - zone.sum(axis=1)


def member_contribution(frame: Frame, model: Model, member: str) -> tuple[Contribution, ...]:
    """Return one member's stiffness, mass and structural damping.

    Those of nominal frames are kept for the last thousand members; other values are asked for once.
    """
    return (_contribution if frame.values else _kept_contribution)(frame, model, member)


def _contribution(frame: Frame, model: Model, member: str) -> tuple[Contribution, ...]:
    return frame.contribution_of(model, model.mesh.members[member])


_kept_contribution = lru_cache(maxsize=1024)(_contribution)


@lru_cache(maxsize=1024)
def _unit_tension(frame: Frame, model: Model, member: str) -> Contribution:
    g = frame._lines(model.mesh, model.mesh.members[member])
    return Contribution(g.dofs, _tension(g))


@lru_cache(maxsize=1024)
def _alike(members: _Same, mesh: Mesh, member: str) -> bool:
    layout, rows = _layout_of(members, mesh), mesh.members[member]
    R, _, _, L = _place(layout, mesh, rows)
    same = layout.plain[rows].all() and (layout.kind[rows] == layout.kind[rows[0]]).all()
    return bool(same and np.ptp(L) <= _ALIKE * L[0] and np.abs(R - R[0]).max() <= _ALIKE)


@lru_cache(maxsize=8)
def _shear_factors(frame: Frame, mesh: Mesh) -> Array:
    """Return the factors of shear flexibility along y and z of all lines, shape (2, n_lines)."""
    each = [np.asarray(pair) for pair in frame.shear.values()]
    out = np.ones((2, mesh.n_lines), dtype=np.result_type(float, *each))
    for member, pair in zip(frame.shear, each, strict=True):
        out[:, mesh.members[member]] = pair[:, None]
    return out


@lru_cache(maxsize=16)  # cuts of one line are asked for together, in all directions
def _uncut(frame: Frame, mesh: Mesh, line: int) -> tuple[_Lines, Array, Array]:
    """Return a line of the mesh and its local stiffness and mass (12, 12) from node to node."""
    g = frame._lines(mesh, [line])
    K, M = _with_ends(g, _stiffness(_unslipped(g)))[0], _from_nodes(g, _local_mass(g))[0]
    for shared in (g.dofs, g.T, K, M):
        shared.flags.writeable = False
    return g, K, M


def local_axes(t: NDArray[np.float64], orientation: ArrayLike | None, member: str) -> NDArray[np.float64]:
    """Return local axes as rows for line directions ``t`` (b, 3), shape (b, 3, 3).

    Raises
    ------
    ModelError
        If the orientation is parallel to the member.
    """
    up = np.full(3, np.nan) if orientation is None else np.asarray(orientation, dtype=float)
    if (
        np.linalg.norm(np.cross(t, up), axis=1) < 1e-6 * np.linalg.norm(up) * np.linalg.norm(t, axis=1)
    ).any():
        raise ModelError(_parallel(member, up))
    return _axes(t, np.broadcast_to(up, t.shape))


def _is_parallel(t: NDArray[np.float64], up: NDArray[np.float64]) -> NDArray[np.bool_]:
    sizes = np.linalg.norm(t, axis=-1) * np.linalg.norm(up, axis=-1)
    return np.linalg.norm(np.cross(t, up), axis=-1) < 1e-6 * sizes


def _parallel(member: str, orientation: NDArray[np.float64]) -> str:
    return f"member '{member}': its orientation {orientation.tolist()} is parallel to its axis"


def _axes(t: NDArray[np.float64], up: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return local axes as rows, shape (b, 3, 3), for directions t and orientations (b, 3), nan: default."""
    x = t / np.linalg.norm(t, axis=1, keepdims=True)
    usual = np.where(np.abs(x[:, 2:]) > np.cos(np.deg2rad(1.0)), [[1.0, 0.0, 0.0]], [[0.0, 0.0, 1.0]])
    up = np.where(np.isnan(up), usual, up)
    z = up - np.einsum("bi,bi->b", up, x)[:, None] * x
    z = z / np.linalg.norm(z, axis=1, keepdims=True)
    return np.stack([x, np.cross(z, x), z], axis=1)


def _turned(R: NDArray[np.float64], angle: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return local axes (b, 3, 3) turned about x, by angles (b,) [rad], to the sections' principal axes."""
    if not angle.any():
        return R
    c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
    return np.stack([R[:, 0], c * R[:, 1] + s * R[:, 2], c * R[:, 2] - s * R[:, 1]], axis=1)


def _skew(v: NDArray[np.float64]) -> NDArray[np.float64]:
    S = np.zeros((len(v), 3, 3), dtype=v.dtype)
    S[:, 0, 1], S[:, 0, 2], S[:, 1, 2] = -v[:, 2], v[:, 1], -v[:, 0]
    return S - np.swapaxes(S, 1, 2)


def _gauss(n: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    x, w = np.polynomial.legendre.leggauss(n)
    return (x + 1) / 2, w / 2


def _some(g: _Lines, rows: NDArray[np.int64]) -> _Lines:
    """Return some of the lines, with ends that do not slip."""
    skip = ("soft", "slip", "ends", "held")
    keep = {key: getattr(g, key)[rows] for key in _Lines.__slots__ if key not in skip}
    return _Lines(**keep, soft=g.soft[:0], slip=g.slip[:0], ends=g.ends[:0], held=g.held[:0])


def _points(g: _Lines, n: int) -> int:
    """Return how many Gauss points integrate products of shapes, n without tapers."""
    return tapered.N_STATIONS if g.tapered.any() else n


def _constants_along(g: _Lines, xi: Any) -> dict[str, Array]:
    """Return A, Iy, Iz, Ip, J and k A along y and z at places xi (…, b), each of its shape."""
    shape = np.shape(xi)
    out = {key: np.broadcast_to(getattr(g, key), shape) for key in _CONSTANTS[:5]}
    out |= {f"kA{d}": np.broadcast_to(getattr(g, f"k{d}") * g.A, shape) for d in "yz"}
    t = np.flatnonzero(g.tapered)
    if t.size:
        here = (tapered.weights_at(xi[..., t])[..., None, :] @ g.stations[t])[..., 0, :]
        for key, value in out.items():
            new = np.array(value, dtype=np.result_type(value, here))
            if key.startswith("kA"):
                s, G = here[..., _ALONG[f"s{key[2]}"]], 2 * (1 + g.nu[t])
                new[..., t] = np.divide(G, s, out=np.zeros_like(s), where=s != 0)
            else:
                new[..., t] = here[..., _ALONG[key]]
            out[key] = new
    return out


def _rigidity(g: _Lines, xi: Array) -> Array:
    """Return EA, ky GA, kz GA, GJ, EIy and EIz at places xi (…, b), shape (…, b, 6); bars have EA alone."""
    G, beam, at = g.E / (2 * (1 + g.nu)), 1 - g.bar, _constants_along(g, xi)
    bent = (G * at["kAy"], G * at["kAz"], G * at["J"], g.E * at["Iy"], g.E * at["Iz"])
    return np.stack([g.E * at["A"], *(beam * q for q in bent)], axis=-1)


def _in_rigid_zones(g: _Lines, first: Array, last: Array, per_length: Array) -> Iterator[Array]:
    """Yield the masses (b, 6, 6) at both nodes of what lies in rigid zones between two places [m]."""
    across = np.array([0, 0, 0, 0, per_length[2], per_length[1]])
    for k, (begin, end) in enumerate(((0 * g.span, g.zone[:, 0]), (g.span - g.zone[:, 1], g.span))):
        a = np.where(np.real(first) > begin, first, begin)
        b = np.where(np.real(last) < end, last, end)
        length = np.where(np.real(b) > np.real(a), b - a, 0.0)
        flexible = end if k == 0 else begin  # g.end goes from the node to here
        arm = g.end[:, k] + (0.5 * (a + b) - flexible)[:, None] * g.R[:, 0]
        yield _at_arm(g.R, arm, length[:, None] * per_length + (length**3 / 12)[:, None] * across)


def _at_arm(R: NDArray[np.float64], arm: Array, body: Array) -> Array:
    """Return masses (b, 6, 6) at nodes of bodies at arms (b, 3) from them, of masses (b, 6) in axes R."""
    G = np.zeros((len(arm), 6, 6), dtype=arm.dtype)
    G[:, :3, :3] = G[:, 3:, 3:] = R
    G[:, :3, 3:] = -R @ _skew(arm)
    out: Array = np.swapaxes(G, 1, 2) @ (body[:, :, None] * G)
    return out


def _inertia(g: _Lines, xi: Array) -> Array:
    """Return mass and rotary inertia per length at places xi (…, b), shape (…, b, 6)."""
    at = _constants_along(g, xi)
    turning = ((1 - g.bar) * at["Ip"], g.rotary * at["Iy"], g.rotary * at["Iz"])
    return g.rho[:, None] * np.stack([at["A"], at["A"], at["A"], *turning], axis=-1)


def _stiffness(g: _Lines) -> Array:
    """Return ∫ Bᵀ diag(EA, …) B dx of the flexible parts, local, shape (b, 12, 12)."""
    K = _local(*_plain_stiffness(g))
    t = np.flatnonzero(g.tapered)
    if t.size:
        some = _some(g, t)
        own = np.zeros((t.size, 12, 12), dtype=np.result_type(K, some.stations))
        beam = 1 - some.bar
        stretch = some.L * (tapered.WEIGHTS / some.stations[..., _ALONG["A"]]).sum(axis=1)
        twist = some.L * (tapered.WEIGHTS / some.stations[..., _ALONG["J"]]).sum(axis=1)
        for d, k in ((0, 1 / stretch), (3, beam / (2 * (1 + some.nu) * twist))):
            own[:, d, d] = own[:, d + 6, d + 6] = k
            own[:, d, d + 6] = own[:, d + 6, d] = -k
        for dofs, I, shear, sign in ((_Y, "Iz", "sy", 1.0), (_Z, "Iy", "sz", _SIGN)):
            of = (some.stations[..., _ALONG[key]] for key in (I, shear))
            bent = tapered.bending_stiffness(some.L, *of) * np.multiply.outer(sign, sign)
            own[:, np.array(dofs)[:, None], dofs] = beam[:, None, None] * bent
        K = K.astype(own.dtype)
        K[t] = some.E[:, None, None] * own
    return K


def _local(tt: Array, tt2: Array, tr: Array, tr2: Array, rr: Array, rr2: Array) -> Array:
    """Return what :func:`_spread` does on the local axes, shape (b, 12, 12)."""
    K = np.zeros((tt.shape[1], 12, 12), dtype=np.result_type(tt, tr, rr))
    for i in range(3):
        K[:, i, i] = K[:, 6 + i, 6 + i] = tt[i]
        K[:, i, 6 + i] = K[:, 6 + i, i] = tt2[i]
        K[:, 3 + i, 3 + i] = K[:, 9 + i, 9 + i] = rr[i]
        K[:, 3 + i, 9 + i] = K[:, 9 + i, 3 + i] = rr2[i]
    for (p, q), first, second in ((tr, (0, 3), (6, 9)), (tr2, (0, 9), (6, 3))):
        for (r, c), sign in ((first, 1), (second, -1)):
            K[:, r + 1, c + 2] = K[:, c + 2, r + 1] = sign * p
            K[:, r + 2, c + 1] = K[:, c + 1, r + 2] = -sign * q
    return K


def _unslipped(g: _Lines) -> _Lines:
    """Return the lines as if their ends did not slip."""
    return _some(g, np.arange(len(g.L)))


def _with_ends(g: _Lines, K: Array) -> Array:
    """Return local stiffnesses K (b, 12, 12) with the ends' connections in series: from node to node."""
    if not g.soft.size:
        return K
    K = K.copy()
    K[g.soft] -= K[g.soft] @ _slips(g, K[g.soft])
    return K


def _slips(g: _Lines, K: Array) -> Array:
    """Return :func:`end_slips` of the lines whose ends slip, from their stiffness without connections."""
    return end_slips(K, np.where(g.held, 1.0, g.ends), np.where(g.held, 0.0, 1.0))


def _flexibility(g: _Lines, lo: Array, hi: Array) -> Array:
    """Return the motion of the second ends by unit forces there, from the flexibility between two places.

    Local, with the first ends held; places are fractions of the flexible parts. Shape (b, 6, 6).
    """
    arm1, arm2 = g.L * (1 - lo), g.L * (1 - hi)
    one, first, second = arm1 - arm2, (arm1**2 - arm2**2) / 2, (arm1**3 - arm2**3) / 3
    F: Array = np.zeros((len(g.L), 6, 6), dtype=np.result_type(one, g.E, g.A, g.J, g.phi_y, g.phi_z))
    F[:, 0, 0] = one / (g.E * g.A)
    F[:, 3, 3] = one * 2 * (1 + g.nu) / (g.E * g.J)
    for v, r, I, phi, sign in ((1, 5, g.Iz, g.phi_y, 1.0), (2, 4, g.Iy, g.phi_z, -1.0)):
        EI = g.E * I
        F[:, v, v] = (second + phi * g.L**2 / 12 * one) / EI
        F[:, v, r] = F[:, r, v] = sign * first / EI
        F[:, r, r] = one / EI
    t = np.flatnonzero(g.tapered)
    if not t.size:
        return F
    lo, hi, some = lo[t], hi[t], _some(g, t)
    of = {key: some.stations[..., k] for key, k in _ALONG.items()}
    ds = (tapered.weights_at(hi, 1) - tapered.weights_at(lo, 1)) * some.L[:, None]
    own = np.zeros((t.size, 6, 6), dtype=np.result_type(F, ds, of["A"]))
    own[:, 0, 0] = (ds / of["A"]).sum(axis=1)
    own[:, 3, 3] = 2 * (1 + some.nu) * (ds / of["J"]).sum(axis=1)
    for v, r, I, shear, sign in ((1, 5, "Iz", "sy", 1.0), (2, 4, "Iy", "sz", -1.0)):
        bent = tapered.end_flexibility(some.L, of[I], of[shear], lo, hi)
        own[:, v, v], own[:, r, r] = bent[:, 0, 0], bent[:, 1, 1]
        own[:, v, r] = own[:, r, v] = sign * bent[:, 0, 1]
    F = F.astype(own.dtype)
    F[t] = own / some.E[:, None, None]
    return F


def _from_flexibility(g: _Lines, F: Array) -> Array:
    """Return the local stiffness (b, 12, 12) of elements from the flexibility of their second ends."""
    E = np.zeros((len(g.L), 6, 12))  # motion of the second end beside that of the first as a rigid body
    E[:, :, 6:] = np.eye(6)
    E[:, :, :6] = -np.eye(6)
    E[:, 1, 5], E[:, 2, 4] = -g.L, g.L
    return np.swapaxes(E, 1, 2) @ np.linalg.inv(F) @ E


def _local_mass(g: _Lines, start: Any = 0.0) -> Array:
    """Return ∫ Nᵀ ρ diag(A, …) N dx from a fraction on, with what mass of higher order adds: (b, 12, 12).

    Of the latter the same part as of the length.
    """
    if g.tapered.any() and not g.tapered.all():
        parts = [np.flatnonzero(which) for which in (g.tapered, ~g.tapered)]
        whole = np.concatenate([_local_mass(_some(g, rows), start) for rows in parts])
        out: Array = whole[np.argsort(np.concatenate(parts))]
        return out
    M: Array = np.zeros((len(g.L), 12, 12))
    for xi, weight in zip(*_gauss(_points(g, 4)), strict=True):
        at = np.full(len(g.L), start + (1 - start) * xi)
        N, scale = _shape(g, at), weight * (1 - start) * g.L[:, None] * _inertia(g, at)
        M = M + np.swapaxes(N, 1, 2) @ (scale[:, :, None] * N)
    return M + (1 - start) * _local(*_higher(g)) if g.higher.any() else M


def _from_nodes(g: _Lines, M: Array) -> Array:
    """Return the local mass of a line for motions of its nodes; its shapes follow its own ends."""
    if not g.soft.size:
        return M
    return _to_global(M, np.eye(12) - _slips(g, _stiffness(_unslipped(g))))


def _mass(g: _Lines) -> Array:
    """Return :func:`_local_mass` or lumps: global, (b, 12, 12)."""
    lumped = g.lumped != 0
    M = _to_global(_local_mass(g), g.T)
    if lumped.any():
        some, T = _some(g, np.flatnonzero(lumped)), g.T_nodes[lumped]
        M[lumped] = np.swapaxes(T, 1, 2) @ (_lumps(some)[:, :, None] * T)
    return M


def _lumps(g: _Lines) -> Array:
    """Return masses and inertias at both ends (b, 12): half of the line's each, or by lever under a taper."""
    x, weight = (each[:, None] for each in _gauss(_points(g, 1)))
    per_length = _inertia(g, np.broadcast_to(x, (len(x), len(g.L))))
    shares = [((part * weight)[..., None] * per_length).sum(axis=0) for part in (1 - x, x)]
    return g.L[:, None] * np.concatenate(shares, axis=1)


def _tension(g: _Lines) -> Array:
    """Return ∫ v'² + w'² + (Iy + Iz)/A a'² dx of the whole axis, a the twist, global, shape (b, 12, 12)."""
    K: Array = np.zeros((len(g.L), 12, 12))
    for xi, weight in zip(*_gauss(_points(g, 3)), strict=True):
        S = _slope(g, np.full(len(g.L), xi))
        K = K + np.swapaxes(S, 1, 2) @ ((weight * g.L)[:, None, None] * S)
    twist = (1 - g.bar) * (g.Iy + g.Iz) / (g.A * g.L)
    K[:, 3, 3] += twist
    K[:, 9, 9] += twist
    K[:, 3, 9] -= twist
    K[:, 9, 3] -= twist
    K = _to_global(K, g.T)
    for k, sign in ((0, -1.0), (1, 1.0)):  # rigid zones and offsets turn with their nodes
        turn = slice(3 + 6 * k, 6 + 6 * k)
        K[:, turn, turn] += lever_stiffness(sign * g.end[:, k], g.R[:, 0])
    return K


def _plain_stiffness(g: _Lines) -> tuple[Array, ...]:
    """Return the factors of :func:`_spread` of a beam's or bar's stiffness."""
    beam = (1 - g.bar) * g.E
    y, z = (beam * I / (g.L * (1 + phi)) for I, phi in ((g.Iz, g.phi_y), (g.Iy, g.phi_z)))
    axial, torsion = g.E * g.A / g.L, beam * g.J / (2 * (1 + g.nu) * g.L)
    tt = np.stack([axial, 12 * y / g.L**2, 12 * z / g.L**2])
    tr = np.stack([6 * y / g.L, 6 * z / g.L])
    rr = np.stack([torsion, (4 + g.phi_z) * z, (4 + g.phi_y) * y])
    return tt, -tt, tr, tr, rr, np.stack([-torsion, (2 - g.phi_z) * z, (2 - g.phi_y) * y])


def _plain_mass(g: _Lines) -> tuple[Array, ...]:
    """Return the factors of :func:`_spread` of an element's mass.

    The integrals of the shape functions' products: Friedman & Kosmatka (1993), with ρA for the deflection
    and ρI for the rotation; with what mass of higher order adds, or lumps.
    """
    m, L = g.rho * g.A * g.L, g.L
    planes = []
    for phi, I in ((g.phi_y, g.Iz), (g.phi_z, g.Iy)):
        own = m / (210 * (1 + phi) ** 2)
        turn = g.rotary * g.rho * I / (30 * L * (1 + phi) ** 2)
        planes.append(
            np.stack(
                [
                    own * (70 * phi**2 + 147 * phi + 78) + 36 * turn,
                    own * (35 * phi**2 + 63 * phi + 27) - 36 * turn,
                    own * (35 * phi**2 + 77 * phi + 44) * L / 4 - turn * (15 * phi - 3) * L,
                    -own * (35 * phi**2 + 63 * phi + 26) * L / 4 - turn * (15 * phi - 3) * L,
                    own * (7 * phi**2 + 14 * phi + 8) * L**2 / 4 + turn * (10 * phi**2 + 5 * phi + 4) * L**2,
                    -own * (7 * phi**2 + 14 * phi + 6) * L**2 / 4 + turn * (5 * phi**2 - 5 * phi - 1) * L**2,
                ]
            )
        )
    y, z = planes
    spin = (1 - g.bar) * g.rho * g.Ip * L
    blocks = [
        np.stack([m / 3, y[0], z[0]]),
        np.stack([m / 6, y[1], z[1]]),
        np.stack([y[2], z[2]]),
        np.stack([y[3], z[3]]),
        np.stack([spin / 3, z[4], y[4]]),
        np.stack([spin / 6, z[5], y[5]]),
    ]
    bar, lumped = g.bar != 0, g.lumped != 0
    for mass, kind in (((m / 3, m / 6), bar), ((m / 2, 0 * m), lumped)):
        if kind.any():
            for block, value in zip(blocks, (*mass, 0 * m, 0 * m, 0 * m, 0 * m), strict=True):
                block[:, kind] = value[kind]
    if lumped.any():
        blocks[4][:, lumped] = (_inertia(g, 0 * L).T[[3, 4, 5]] * L / 2)[:, lumped]
    if g.higher.any():
        blocks = [block + more for block, more in zip(blocks, _higher(g), strict=True)]
    return tuple(blocks)


def _higher(g: _Lines) -> tuple[Array, ...]:
    """Return the factors of :func:`_spread` of what mass of higher order adds.

    An element deforms as under forces at its ends; the motion that its own inertia adds stores more. To the
    second order of its length the mass for that is ρA L²/12 ∫ u'² dx of stretching, ρIp L²/12 ∫ θ'² dx of
    torsion and ρA L²/12 ∫ v' γ dx of shear.
    """
    axial = g.higher * g.rho * g.A * g.L / 12
    y, z = ((1 - g.bar) * axial * phi / (1 + phi) for phi in (g.phi_y, g.phi_z))
    turn = g.higher * (1 - g.bar) * g.rho * g.Ip * g.L / 12
    tt, tr = np.stack([axial, y, z]), np.stack([y, z]) * g.L / 4
    rr = np.stack([turn, 0 * turn, 0 * turn])
    return tt, -tt, tr, tr, rr, -rr


def _spread(R: NDArray[np.float64], *factors: Array) -> Array:
    """Return the global matrices (b, 12, 12) of elements that run straight between their points.

    Parameters
    ----------
    R : ndarray (b, 3, 3)
        Local axes x, y, z as rows.
    factors : ndarray (3, b) or (2, b)
        Translations with translations of the same and of the other end, as factors of xxᵀ, yyᵀ, zzᵀ; with
        rotations of either, as factors of yzᵀ and -zyᵀ; rotations with rotations. Of the second end and of
        its translations with rotations of the first, the middle ones have the other sign.
    """
    tt, tt2, tr, tr2, rr, rr2 = factors
    x, y, z = np.ascontiguousarray(R.transpose(1, 2, 0))
    out = np.empty((12, 12, len(R)), dtype=np.result_type(*factors))
    for i in range(3):
        for j in range(i, 3):
            square = x[i] * x[j], y[i] * y[j], z[i] * z[j]
            for (a, p, q), places in (
                (tt, ((0, 0), (6, 6))),
                (tt2, ((0, 6), (6, 0))),
                (rr, ((3, 3), (9, 9))),
                (rr2, ((3, 9), (9, 3))),
            ):
                value = a * square[0] + p * square[1] + q * square[2]
                for r, c in places:
                    out[r + i, c + j] = out[r + j, c + i] = value
        for j in range(3):
            yz, zy = y[i] * z[j], z[i] * y[j]
            for (p, q), first, second in ((tr, (0, 3), (6, 9)), (tr2, (0, 9), (6, 3))):
                value = p * yz - q * zy
                for (r, c), v in ((first, value), (second, -value)):
                    out[r + i, c + j] = out[c + j, r + i] = v
    return np.ascontiguousarray(out.reshape(144, -1).T).reshape(-1, 12, 12)


def _to_global(matrix: Array, T: Array) -> Array:
    return np.swapaxes(T, 1, 2) @ matrix @ T


def _plane(xi: Array, L: Array, phi: Array, wanted: str) -> list[Array]:
    """Return what is wanted of v, r, c and s, each (…, b, 4), at places xi (…, b).

    Deflection, rotation, curvature and slope for (v1, θ1, v2, θ2).
    """

    def of(which: str) -> list[Array]:
        if which == "v":
            return [
                2 * xi**3 - 3 * xi**2 - phi * xi + 1 + phi,
                L * (xi**3 - (2 + phi / 2) * xi**2 + (1 + phi / 2) * xi),
                -2 * xi**3 + 3 * xi**2 + phi * xi,
                L * (xi**3 - (1 - phi / 2) * xi**2 - phi / 2 * xi),
            ]
        if which == "r":
            turn = 6 * (xi**2 - xi) / L
            return [turn, 3 * xi**2 - (4 + phi) * xi + 1 + phi, -turn, 3 * xi**2 - (2 - phi) * xi]
        if which == "c":
            bend = (12 * xi - 6) / L**2
            return [bend, (6 * xi - 4 - phi) / L, -bend, (6 * xi - 2 + phi) / L]
        rise = (6 * xi**2 - 6 * xi - phi) / L
        return [rise, 3 * xi**2 - (4 + phi) * xi + 1 + phi / 2, -rise, 3 * xi**2 - (2 - phi) * xi - phi / 2]

    d = (1 / (1 + phi))[:, None]
    return [d * np.stack(of(which), axis=-1) for which in wanted]


def _bending(g: _Lines, xi: Array, d: str, wanted: str) -> list[Array]:
    """Return :func:`_plane` for bending in x-y (d = "y") or x-z (d = "z"), with the sections' taper."""
    out = _plane(xi, g.L, g.phi_y if d == "y" else g.phi_z, wanted)
    t = np.flatnonzero(g.tapered)
    if not t.size:
        return out
    I, shear = (g.stations[t][..., _ALONG[key]] for key in ("Iz" if d == "y" else "Iy", f"s{d}"))
    own = tapered.bending(xi[..., t], g.L[t], I, shear, wanted)
    out = [np.array(a, dtype=np.result_type(a, b)) for a, b in zip(out, own, strict=True)]
    for a, b in zip(out, own, strict=True):
        a[..., t, :] = b
    return out


def _share(g: _Lines, xi: Array, key: str, derivative: bool = False) -> Array:
    """Return the part of the second end's stretch (A) or twist (J) at places xi (…, b), or its slope."""
    out = np.ones_like(xi) if derivative else xi
    t = np.flatnonzero(g.tapered if key == "A" else g.tapered & (g.bar == 0))
    if t.size:
        own = tapered.extension(xi[..., t], g.stations[t][..., _ALONG[key]], derivative)
        out = np.array(out, dtype=np.result_type(out, own))
        out[..., t] = own
    return out


def _flexible(g: _Lines, xi: Array) -> Array:
    """Return the fraction of the flexible part at a fraction of the line; rigid zones are at 0 and 1.

    The imaginary part of a complex step passes through.
    """
    x = (xi * g.span - g.zone[:, 0]) / g.L
    return np.where(np.real(x) < 0, 0.0, np.where(np.real(x) > 1, 1.0, x))


@lru_cache(maxsize=2)  # a fit asks for the derivative where it has just asked for the value
def _shapes(frame: Frame, mesh: Mesh, member: str, position: float) -> tuple[NDArray[np.int64], Array]:
    (dofs,), (N,) = frame.interpolate(mesh, [mesh.locate(member, position)])
    dofs.flags.writeable = N.flags.writeable = False
    return dofs, N


def _motion(g: _Lines, mesh: Mesh, xi: Array) -> Array:
    """Return the motion of places on the mesh's lines, global axes, from the DOFs, shape (b, 6, 12)."""
    x = _flexible(g, xi)
    G = np.zeros((len(xi), 6, 6))
    G[:, :3, :3] = G[:, 3:, 3:] = np.swapaxes(g.R, 1, 2)
    at_node = (np.imag(x) == 0) & ((np.real(x) < 1e-9) | (np.real(x) > 1 - 1e-9))
    T = np.where(at_node[:, None, None], g.T_nodes, g.T)
    N = G @ _shape(g, x) @ T
    ends = mesh.points[mesh.lines[g.rows]]
    arm = xi[:, None] * (ends[:, 1] - ends[:, 0]) - g.end[:, 0] - (x * g.L)[:, None] * g.R[:, 0]
    arm = np.where(np.abs(arm) < 1e-12 * g.span[:, None], 0.0, arm)  # rounding would load idle rotations
    N[:, :3] = N[:, :3] - _skew(arm) @ N[:, 3:]
    return N


_Y = [1, 5, 7, 11]  # v and θz of both ends
_Z = [2, 4, 8, 10]  # w and θy of both ends
_SIGN = np.array([1.0, -1.0, 1.0, -1.0])  # θy = -dw/dx


def _shape(g: _Lines, xi: Array) -> Array:
    """Return the local motion (…, b, 6, 12) of places xi (…, b) on the flexible parts from their ends'."""
    vy, ry = _bending(g, xi, "y", "vr")
    vz, rz = _bending(g, xi, "z", "vr")
    N = np.zeros((*xi.shape, 6, 12), dtype=np.result_type(vy, vz))
    N[..., 1, _Y], N[..., 5, _Y] = vy, ry
    N[..., 2, _Z], N[..., 4, _Z] = vz * _SIGN, -rz * _SIGN
    bar = g.bar != 0
    if bar.any():
        N[..., bar, :, :] = _bar_shape(xi[..., bar], g.L[bar])
    for d, key in ((0, "A"), (3, "J")):
        share = _share(g, xi, key)
        N[..., d, d], N[..., d, d + 6] = 1 - share, share
    return N


def _bar_shape(xi: Array, L: Array) -> Array:
    """Return the motion of a bar: straight between its ends; about its own axis it turns as they do."""
    N = np.zeros((*xi.shape, 6, 12), dtype=np.result_type(xi, L))
    for d in range(4):
        N[..., d, d], N[..., d, 6 + d] = 1 - xi, xi
    N[..., 4, 2], N[..., 4, 8] = 1 / L, -1 / L
    N[..., 5, 1], N[..., 5, 7] = -1 / L, 1 / L
    return N


def _strain(g: _Lines, xi: Array) -> Array:
    """Return the strains (…, b, 6, 12) at places xi (…, b) on the flexible parts from their ends' motion."""
    ry, cy, sy = _bending(g, xi, "y", "rcs")
    rz, cz, sz = _bending(g, xi, "z", "rcs")
    B = np.zeros((*xi.shape, 6, 12), dtype=np.result_type(cy, cz))
    for d, key in ((0, "A"), (3, "J")):
        stretch = _share(g, xi, key, derivative=True) / g.L
        B[..., d, d], B[..., d, d + 6] = -stretch, stretch
    B[..., 1, _Y], B[..., 5, _Y] = sy - ry, cy
    B[..., 2, _Z], B[..., 4, _Z] = (sz - rz) * _SIGN, -cz * _SIGN
    return B


def _slope(g: _Lines, xi: Array) -> Array:
    S = np.zeros((len(g.L), 2, 12), dtype=np.result_type(g.phi_y, g.phi_z))
    (S[:, 0, _Y],) = _bending(g, xi, "y", "s")
    (rise,) = _bending(g, xi, "z", "s")
    S[:, 1, _Z] = rise * _SIGN
    bar = g.bar != 0
    if bar.any():
        S[bar] = 0.0
        for row, d in ((0, 1), (1, 2)):
            S[bar, row, d], S[bar, row, 6 + d] = -1 / g.L[bar], 1 / g.L[bar]
    return S
