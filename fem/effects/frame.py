"""The frame itself: two-node, 12-DOF beams along the members of a mesh."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from functools import lru_cache
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fem.mesh import Location, Mesh
from fem.model import Array, Contribution, Effect, Model, ModelError, Parameter, dofs_of, lever_matrix
from fem.properties import Material, Section

THEORIES = ("timoshenko", "euler-bernoulli")


@dataclass(frozen=True, slots=True, eq=False)
class MemberProperties:
    """What a member is made of and how it lies.

    Attributes
    ----------
    material : Material
    section : Section
    orientation : ndarray (3,) or None
        A vector that, with the member's axis, spans the plane of the section's height (local z). Global Z,
        or global X for members within 1° of vertical, unless given.
    offset1, offset2 : ndarray (3,)
        From the mesh's line to the member's axis at the first and second end, global, linear in between [m].
    rigid1, rigid2 : float
        Lengths of the rigid end zones [m]; they have the member's mass.
    theory : str
        ``"timoshenko"`` (shear and rotary inertia) or ``"euler-bernoulli"`` (neither).
    """

    material: Material
    section: Section
    orientation: NDArray[np.float64] | None = None
    offset1: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    offset2: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    rigid1: float = 0.0
    rigid2: float = 0.0
    theory: str = "timoshenko"

    def __post_init__(self) -> None:
        if self.theory not in THEORIES:
            msg = f"the beam theory is '{self.theory}'; allowed are {', '.join(THEORIES)}"
            raise ModelError(msg)
        if self.rigid1 < 0 or self.rigid2 < 0:
            msg = f"rigid end zones are {self.rigid1:g} and {self.rigid2:g} m; they cannot be negative"
            raise ModelError(msg)


@dataclass(frozen=True, slots=True, eq=False)
class _Lines:
    """Per-line geometry and properties of some lines, in arrays with one row per line."""

    rows: NDArray[np.int64]
    dofs: NDArray[np.int64]  # (b, 12)
    T: NDArray[np.float64]  # (b, 12, 12): local end displacements from global DOFs
    R: NDArray[np.float64]  # (b, 3, 3)
    end: NDArray[np.float64]  # (b, 2, 3): from the nodes to the ends of the flexible part
    span: NDArray[np.float64]  # length of the axis between the nodes' offsets
    skip: NDArray[np.float64]  # length of the rigid zone at the first end
    L: NDArray[np.float64]  # flexible length
    A: NDArray[np.float64]
    Iy: NDArray[np.float64]
    Iz: NDArray[np.float64]
    Ip: NDArray[np.float64]
    J: NDArray[np.float64]
    ky: NDArray[np.float64]
    kz: NDArray[np.float64]
    nu: NDArray[np.float64]
    rotary: NDArray[np.float64]
    phi_y: NDArray[np.float64]  # shear parameter for bending in x-y
    phi_z: NDArray[np.float64]
    E: Array
    rho: Array
    eta: Array


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Frame(Effect):
    """Beams along members: Timoshenko (or Euler-Bernoulli) with consistent mass.

    Shape functions that solve the static Timoshenko equations exactly, so that stiffness does not lock:
    Friedman & Kosmatka, Computers & Structures 47 (1993) 473-481.

    Attributes
    ----------
    members : mapping of str to MemberProperties
        For every member of the mesh.
    values : mapping of str to number
        Young's moduli ``"E:<material>"`` [Pa] and densities ``"rho:<material>"`` [kg/m³] that replace
        those of the materials; G follows E at constant ν.
    """

    kind: ClassVar[str] = "frame"
    name: str = "frame"
    members: Mapping[str, MemberProperties]
    values: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        by_name: dict[str, Material] = {}
        for properties in self.members.values():
            known = by_name.setdefault(properties.material.name, properties.material)
            if known != properties.material:
                msg = f"two different materials have the name '{known.name}'; names must differ"
                raise ModelError(msg)

    @property
    def materials(self) -> dict[str, Material]:
        """The materials by name."""
        return {p.material.name: p.material for p in self.members.values()}

    @property
    def where(self) -> str:
        """All members."""
        return "all members"

    def parameters(self) -> tuple[Parameter, ...]:
        """Young's modulus and density of each material."""
        out = []
        for name, m in self.materials.items():
            E, rho = self.values.get(f"E:{name}", m.E), self.values.get(f"rho:{name}", m.rho)
            out.append(Parameter(f"E:{name}", "Pa", E, m.E, 0.5 * m.E, 2 * m.E, log=True, linear=True))
            out.append(
                Parameter(f"rho:{name}", "kg/m³", rho, m.rho, 0.5 * m.rho, 2 * m.rho, log=True, linear=True)
            )
        return tuple(out)

    def with_values(self, **values: Any) -> Self:
        """Return a frame with other moduli or densities."""
        return replace(self, values={**self.values, **values})

    def rotations(self, mesh: Mesh) -> NDArray[np.float64]:
        """Return the local axes of each line as rows, shape (n_lines, 3, 3)."""
        R = np.zeros((mesh.n_lines, 3, 3))
        for name, rows in mesh.members.items():
            R[rows] = self._axis(mesh, name)[1]
        return R

    def _axis(
        self, mesh: Mesh, member: str
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Return where a member's axis runs.

        That is the offsets of its points (n + 1, 3) [m], and the local axes (n, 3, 3) and lengths (n,) [m] of
        its lines' axes.
        """
        p, chain = self._of(member), mesh.members[member]
        s = mesh.member_positions(member)
        at = p.offset1 + (s / s[-1])[:, None] * (p.offset2 - p.offset1)
        # Offsets that change along the member turn its axis against the line.
        t = mesh.points[mesh.lines[chain, 1]] - mesh.points[mesh.lines[chain, 0]] + np.diff(at, axis=0)
        return at, local_axes(t, p.orientation, member), np.linalg.norm(t, axis=1)

    def _of(self, member: str) -> MemberProperties:
        try:
            return self.members[member]
        except KeyError:
            msg = (
                f"member '{member}' of the mesh has no material and section; given are "
                f"{', '.join(self.members)}"
            )
            raise ModelError(msg) from None

    def _lines(self, mesh: Mesh, rows: ArrayLike) -> _Lines:
        whole = _all_lines(self, mesh)
        rows = np.asarray(rows, dtype=np.int64)
        return _Lines(**{f.name: getattr(whole, f.name)[rows] for f in fields(_Lines)})

    def _build_lines(self, mesh: Mesh) -> _Lines:
        rows = np.arange(mesh.n_lines)
        n = mesh.n_lines
        R = np.zeros((n, 3, 3))
        end, span, skip = np.zeros((n, 2, 3)), np.ones(n), np.zeros(n)
        names = ("A", "Iy", "Iz", "Ip", "J", "ky", "kz")
        columns = {key: np.ones(n) for key in (*names, "nu", "rotary")}
        E, rho, eta = (
            np.zeros(n, dtype=np.result_type(float, *map(type, self.values.values()))) for _ in range(3)
        )
        for member, chain in mesh.members.items():
            p = self._of(member)
            at, R[chain], span[chain] = self._axis(mesh, member)
            end[chain, 0], end[chain, 1] = at[:-1], at[1:]
            room = span.copy()
            for k, zone, line in ((0, p.rigid1, chain[0]), (1, p.rigid2, chain[-1])):
                room[line] -= zone
                if room[line] <= 0.001 * span[line]:
                    msg = (
                        f"member '{member}': the rigid end zone of {zone:g} m does not fit into the element "
                        f"at that end ({span[line]:g} m); use larger elements"
                    )
                    raise ModelError(msg)
                end[line, k] += (1 - 2 * k) * zone * R[line, 0]
            skip[chain[0]] = p.rigid1
            for key in names:
                columns[key][chain] = getattr(p.section, key)
            timoshenko = p.theory == "timoshenko"
            columns["nu"][chain] = p.material.nu
            columns["rotary"][chain] = float(timoshenko)
            if not timoshenko:
                columns["ky"][chain] = columns["kz"][chain] = 0.0
            E[chain] = self.values.get(f"E:{p.material.name}", p.material.E)
            rho[chain] = self.values.get(f"rho:{p.material.name}", p.material.rho)
            eta[chain] = p.material.loss_factor
        c, line = columns, mesh.lines
        axis = mesh.points[line[:, 1]] + end[:, 1] - mesh.points[line[:, 0]] - end[:, 0]
        L = np.einsum("bi,bi->b", axis, R[:, 0])
        T = np.zeros((len(rows), 12, 12))
        for k in range(2):
            o = 6 * k
            T[:, o : o + 3, o : o + 3] = R
            T[:, o + 3 : o + 6, o + 3 : o + 6] = R
            T[:, o : o + 3, o + 3 : o + 6] = -R @ _skew(end[:, k])
        EG = 2 * (1 + c["nu"])

        def shear(I: Array, k: Array) -> Array:
            return np.divide(12 * EG * I, k * c["A"] * L**2, out=np.zeros_like(L), where=k > 0)

        return _Lines(
            rows=rows, dofs=dofs_of(line).reshape(len(rows), 12), T=T, R=R, end=end, span=span, skip=skip,
            L=L, **c, phi_y=shear(c["Iz"], c["ky"]), phi_z=shear(c["Iy"], c["kz"]), E=E, rho=rho, eta=eta,
        )  # fmt: skip

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return stiffness, mass and the materials' structural damping of all members."""
        return self.contribution_of(model, np.arange(model.mesh.n_lines))

    def contribution_of(self, model: Model, rows: ArrayLike) -> tuple[Contribution, ...]:
        """Return stiffness, mass and structural damping of some lines of the mesh."""
        g = self._lines(model.mesh, rows)
        K: Array = np.zeros((len(g.L), 12, 12))
        M: Array = np.zeros((len(g.L), 12, 12))
        for xi, weight in zip(*_gauss(4), strict=True):
            at = np.full(len(g.L), xi)
            B, N = _strain(g, at), _shape(g, at)
            K = K + np.einsum("bki,bk,bkj->bij", B, weight * g.L[:, None] * _rigidity(g), B, optimize=True)
            M = M + np.einsum("bki,bk,bkj->bij", N, weight * g.L[:, None] * _inertia(g), N, optimize=True)
        K, M = _to_global(K, g.T), _to_global(M, g.T)
        D = g.eta[:, None, None] * K if np.any(g.eta != 0) else None
        return (Contribution(g.dofs, K, M, None, D), *self._rigid_zone_masses(model.mesh, rows))

    def _rigid_zone_masses(self, mesh: Mesh, rows: ArrayLike) -> tuple[Contribution, ...]:
        wanted = {int(r) for r in np.asarray(rows)}
        dofs, masses = [], []
        for member, chain in mesh.members.items():
            p = self._of(member)
            for zone, line, k in ((p.rigid1, chain[0], 0), (p.rigid2, chain[-1], 1)):
                if zone == 0 or int(line) not in wanted:
                    continue
                R = self._axis(mesh, member)[1][-k]
                rho = self.values.get(f"rho:{p.material.name}", p.material.rho)
                s, A = p.section, p.section.A
                arm = (p.offset1, p.offset2)[k] + (0.5 - k) * zone * R[0]
                local = np.diag([A, A, A, s.Ip, s.Iy + A * zone**2 / 12, s.Iz + A * zone**2 / 12])
                G = np.kron(np.eye(2), R) @ lever_matrix(arm)
                dofs.append(dofs_of(mesh.lines[line, k]))
                masses.append(rho * zone * (G.T @ local @ G))
        return (Contribution(np.array(dofs), M=np.array(masses)),) if dofs else ()

    def interpolate(self, mesh: Mesh, locations: list[Location]) -> tuple[NDArray[np.int64], Array]:
        """Return the displacements and rotations at places along lines as functions of the DOFs.

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
        mesh = model.mesh
        s = mesh.member_positions(member)
        first: Any = start if np.real(start) > 0 else 0.0
        last: Any = stop if np.real(stop) < s[-1] else float(s[-1])
        touched = np.flatnonzero((s[1:] > np.real(first)) & (s[:-1] < np.real(last)))
        g = self._lines(mesh, mesh.members[member][touched])
        h = s[touched + 1] - s[touched]
        lo = np.array([(first - s[k]) if np.real(first) > s[k] else 0.0 for k in touched]) / h
        hi = (
            np.array([(last - s[k]) if np.real(last) < s[k + 1] else h[i] for i, k in enumerate(touched)]) / h
        )
        lo, hi = _flexible(g, lo), _flexible(g, hi)
        K: Array = np.zeros((len(g.L), 12, 12))
        for x, weight in zip(*_gauss(3), strict=True):
            B = _strain(g, lo + x * (hi - lo))
            scale = (weight * (hi - lo) * g.L)[:, None] * _rigidity(g) * np.asarray(factors)
            K = K + np.einsum("bki,bk,bkj->bij", B, scale, B, optimize=True)
        K = _to_global(K, g.T)
        return Contribution(g.dofs, K, D=g.eta[:, None, None] * K if np.any(g.eta != 0) else None)

    def geometric_stiffness(self, model: Model, member: str, tension: Any) -> Contribution:
        """Return the geometric stiffness of a member under a constant tension N: ∫ N (v'² + w'²) dx."""
        unit = _unit_tension(self, model, member)
        return Contribution(unit.dofs, tension * unit.K)


@lru_cache(maxsize=32)
def nominal(frame: Frame) -> Frame:
    """Return a frame with the moduli and densities of its materials, whatever has been fitted since.

    Relative changes refer to it, so that they mean the same before, in and after a fit.
    """
    return replace(frame, values={}) if frame.values else frame


@lru_cache(maxsize=8)
def _all_lines(frame: Frame, mesh: Mesh) -> _Lines:
    """Return the geometry and properties of all lines, kept for the last few frames and meshes."""
    return frame._build_lines(mesh)


@lru_cache(maxsize=256)
def member_contribution(frame: Frame, model: Model, member: str) -> tuple[Contribution, ...]:
    """Return one member's stiffness, mass and structural damping, kept for the last few hundred members."""
    return frame.contribution_of(model, model.mesh.members[member])


@lru_cache(maxsize=256)
def _unit_tension(frame: Frame, model: Model, member: str) -> Contribution:
    g = frame._lines(model.mesh, model.mesh.members[member])
    K: Array = np.zeros((len(g.L), 12, 12))
    for xi, weight in zip(*_gauss(4), strict=True):
        S = _slope(g, np.full(len(g.L), xi))
        K = K + weight * np.einsum("bki,b,bkj->bij", S, g.L, S, optimize=True)
    return Contribution(g.dofs, _to_global(K, g.T))


def local_axes(t: NDArray[np.float64], orientation: ArrayLike | None, member: str) -> NDArray[np.float64]:
    """Return local axes as rows for line directions ``t`` (b, 3), shape (b, 3, 3).

    Raises
    ------
    ModelError
        If the orientation is parallel to the member.
    """
    x = t / np.linalg.norm(t, axis=1, keepdims=True)
    if orientation is None:
        up = np.where(np.abs(x[:, 2:]) > np.cos(np.deg2rad(1.0)), [[1.0, 0.0, 0.0]], [[0.0, 0.0, 1.0]])
    else:
        up = np.broadcast_to(np.asarray(orientation, dtype=float), x.shape)
    z = up - np.einsum("bi,bi->b", up, x)[:, None] * x
    norm = np.linalg.norm(z, axis=1, keepdims=True)
    if (norm < 1e-6 * np.linalg.norm(up, axis=1, keepdims=True)).any():
        msg = f"member '{member}': its orientation {np.asarray(orientation).tolist()} is parallel to its axis"
        raise ModelError(msg)
    z = z / norm
    return np.stack([x, np.cross(z, x), z], axis=1)


def _skew(v: NDArray[np.float64]) -> NDArray[np.float64]:
    S = np.zeros((len(v), 3, 3), dtype=v.dtype)
    S[:, 0, 1], S[:, 0, 2], S[:, 1, 2] = -v[:, 2], v[:, 1], -v[:, 0]
    return S - np.swapaxes(S, 1, 2)


def _gauss(n: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    x, w = np.polynomial.legendre.leggauss(n)
    return (x + 1) / 2, w / 2


def _rigidity(g: _Lines) -> Array:
    G = g.E / (2 * (1 + g.nu))
    return np.stack([g.E * g.A, g.ky * G * g.A, g.kz * G * g.A, G * g.J, g.E * g.Iy, g.E * g.Iz], axis=1)


def _inertia(g: _Lines) -> Array:
    return g.rho[:, None] * np.stack([g.A, g.A, g.A, g.Ip, g.rotary * g.Iy, g.rotary * g.Iz], axis=1)


def _to_global(matrix: Array, T: Array) -> Array:
    return np.swapaxes(T, 1, 2) @ matrix @ T


def _plane(xi: Array, L: Array, phi: Array) -> tuple[Array, Array, Array, Array]:
    """Return deflection, rotation, curvature and slope for (v1, θ1, v2, θ2), each (b, 4)."""
    d = 1 / (1 + phi)
    v = [2 * xi**3 - 3 * xi**2 - phi * xi + 1 + phi, L * (xi**3 - (2 + phi / 2) * xi**2 + (1 + phi / 2) * xi),
         -2 * xi**3 + 3 * xi**2 + phi * xi, L * (xi**3 - (1 - phi / 2) * xi**2 - phi / 2 * xi)]  # fmt: skip
    r = [
        6 * (xi**2 - xi) / L,
        3 * xi**2 - (4 + phi) * xi + 1 + phi,
        -6 * (xi**2 - xi) / L,
        3 * xi**2 - (2 - phi) * xi,
    ]
    c = [(12 * xi - 6) / L**2, (6 * xi - 4 - phi) / L, (6 - 12 * xi) / L**2, (6 * xi - 2 + phi) / L]
    s = [(6 * xi**2 - 6 * xi - phi) / L, 3 * xi**2 - (4 + phi) * xi + 1 + phi / 2,
         (-6 * xi**2 + 6 * xi + phi) / L, 3 * xi**2 - (2 - phi) * xi - phi / 2]  # fmt: skip
    v, r, c, s = (np.stack([d * q for q in group], axis=1) for group in (v, r, c, s))
    return v, r, c, s


def _flexible(g: _Lines, xi: Array) -> Array:
    """Return the fraction of the flexible part at a fraction of the line; rigid zones are at 0 and 1.

    The imaginary part of a complex step passes through.
    """
    x = (xi * g.span - g.skip) / g.L
    return np.where(np.real(x) < 0, 0.0, np.where(np.real(x) > 1, 1.0, x))


def _motion(g: _Lines, mesh: Mesh, xi: Array) -> Array:
    """Return the motion of places on the mesh's lines, global axes, from the DOFs, shape (b, 6, 12)."""
    x = _flexible(g, xi)
    G = np.zeros((len(xi), 6, 6))
    G[:, :3, :3] = G[:, 3:, 3:] = np.swapaxes(g.R, 1, 2)
    N = G @ _shape(g, x) @ g.T
    ends = mesh.points[mesh.lines[g.rows]]
    arm = xi[:, None] * (ends[:, 1] - ends[:, 0]) - g.end[:, 0] - (x * g.L)[:, None] * g.R[:, 0]
    N[:, :3] = N[:, :3] - _skew(arm) @ N[:, 3:]
    return N


_Y = [1, 5, 7, 11]  # v and θz of both ends
_Z = [2, 4, 8, 10]  # w and θy of both ends
_SIGN = np.array([1.0, -1.0, 1.0, -1.0])  # θy = -dw/dx


def _shape(g: _Lines, xi: Array) -> Array:
    vy, ry, _, _ = _plane(xi, g.L, g.phi_y)
    vz, rz, _, _ = _plane(xi, g.L, g.phi_z)
    N = np.zeros((len(g.L), 6, 12), dtype=vy.dtype)
    N[:, 0, 0] = N[:, 3, 3] = 1 - xi
    N[:, 0, 6] = N[:, 3, 9] = xi
    N[:, 1, _Y], N[:, 5, _Y] = vy, ry
    N[:, 2, _Z], N[:, 4, _Z] = vz * _SIGN, -rz * _SIGN
    return N


def _strain(g: _Lines, xi: Array) -> Array:
    _, ry, cy, sy = _plane(xi, g.L, g.phi_y)
    _, rz, cz, sz = _plane(xi, g.L, g.phi_z)
    B = np.zeros((len(g.L), 6, 12), dtype=cy.dtype)
    B[:, 0, 0] = B[:, 3, 3] = -1 / g.L
    B[:, 0, 6] = B[:, 3, 9] = 1 / g.L
    B[:, 1, _Y], B[:, 5, _Y] = sy - ry, cy
    B[:, 2, _Z], B[:, 4, _Z] = (sz - rz) * _SIGN, -cz * _SIGN
    return B


def _slope(g: _Lines, xi: Array) -> Array:
    S = np.zeros((len(g.L), 2, 12))
    S[:, 0, _Y] = _plane(xi, g.L, g.phi_y)[3]
    S[:, 1, _Z] = _plane(xi, g.L, g.phi_z)[3] * _SIGN
    return S
