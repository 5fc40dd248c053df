"""Lines: geometry and properties of some elements in arrays, from the layout, moduli and section changes.

The matrices and shape functions of elements are functions of `Lines`, so that all elements of a batch are
formed at once. `form_lines` leaves end connections rigid; `fem.elements.connections` adds them.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from fem.array_types import Bools, Floats, Ints
from fem.elements import tapered
from fem.elements.layout import CONSTANTS, ByMember, Layout, axes_and_arms, constants_at
from fem.mesh import Mesh
from fem.model import Array, dofs_of

COLUMNS = {key: i for i, key in enumerate(("A", "Iy", "Iz", "Ip", "J", "sy", "sz"))}
"""Columns of `Lines.stations`; sy and sz are shear flexibilities 1/(kGA) for E = 1."""


@dataclass(frozen=True, slots=True, eq=False)
class Lines:
    """Geometry and properties of some lines, in arrays with one row per line."""

    rows: Ints
    dofs: Ints  # (b, 12)
    T: Array  # (b, 12, 12): local displacements of the flexible part's ends from global DOFs
    soft: Ints  # lines with elastic or released end connections: their ends slip
    slip: Array  # (n_soft, 12, 12): slips of the ends, local, from global DOFs; already taken from T
    ends: Floats  # (n_soft, 12): stiffness of the connections, 0 where rigid
    fixed: Bools  # (n_soft, 12): rigid directions
    R: Floats  # (b, 3, 3)
    end: Floats  # (b, 2, 3): from the nodes to the ends of the flexible part
    zone: Floats  # (b, 2): lengths of the rigid zones
    span: Floats  # length of the axis between the nodes' offsets
    L: Floats  # flexible length
    A: Floats
    Iy: Floats
    Iz: Floats
    Ip: Floats
    J: Floats
    ky: Floats
    kz: Floats
    nu: Floats
    eta: Floats
    rotary: Floats  # 1 with rotary inertia of bending
    bar: Floats  # 1 for bars
    higher: Floats  # 1 for mass of higher order
    lumped: Floats  # 1 for lumped mass
    turning: Floats  # 0 for mass without rotary inertia of bending
    tension: Floats
    phi_y: Floats  # shear parameter for bending in x-y
    phi_z: Floats
    tapered: Bools
    stations: Array  # (b, N_STATIONS, 7), or (b, 0, 7) without tapers: columns as in COLUMNS
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
    """Factors of sections' constants; they may be complex, for derivatives.

    Attributes
    ----------
    A, Iy, Iz, Ip, J : float
        Of the area and the second moments [-].
    shear : float
        Of the shear flexibility 1/(k G A), in addition to that of A [-].
    rotary : float
        Of the rotary inertia of bending, in addition to those of Iy and Iz [-].
    timoshenko : bool
        Whether ``shear`` and ``rotary`` refer to the values of Timoshenko's theory, also in members of the
        Euler-Bernoulli theory.
    """

    A: Any = 1.0
    Iy: Any = 1.0
    Iz: Any = 1.0
    Ip: Any = 1.0
    J: Any = 1.0
    shear: Any = 1.0
    rotary: Any = 1.0
    timoshenko: bool = False


NO_CHANGE = SectionChange()


def form_lines(
    layout: Layout,
    mesh: Mesh,
    rows: Ints,
    values: Mapping[str, Any],
    shear_factors: Array | None = None,
    *,
    maps: bool = True,
    change: SectionChange = NO_CHANGE,
) -> Lines:
    """Return geometry and properties of some lines, with rigid end connections.

    Parameters
    ----------
    layout : Layout
    mesh : Mesh
    rows : ndarray of int (b,)
        The lines.
    values : mapping of str to number
        Moduli ``"E:<material>"`` and densities ``"rho:<material>"`` that replace those of the materials.
    shear_factors : ndarray (2, b) or None
        Factors of the shear flexibility along y and z [-].
    maps : bool
        Whether to form the maps T, which only elements without a closed form need.
    change : SectionChange
        Factors of the sections' constants.
    """
    R, end, span, L = axes_and_arms(layout, mesh, rows)
    kind = layout.kind[rows]
    table = _constants_of(layout, kind, shear_factors, change)
    E, rho = _moduli(layout, kind, values)
    b = len(rows)
    factors = np.ones((2, b)) if shear_factors is None else shear_factors
    return Lines(
        rows=rows,
        dofs=dofs_of(mesh.lines[rows]).reshape(b, 12),
        T=_end_maps(R, end) if maps else np.zeros((b, 0, 0)),
        soft=np.zeros(0, dtype=np.int64),
        slip=np.zeros((0, 12, 12)),
        ends=np.zeros((0, 12)),
        fixed=np.zeros((0, 12), dtype=bool),
        R=R,
        end=end,
        zone=layout.zone[rows],
        span=span,
        L=L,
        **table,
        phi_y=_shear_parameter(table, "Iz", "ky", L, change.shear),
        phi_z=_shear_parameter(table, "Iy", "kz", L, change.shear),
        tapered=layout.taper[rows] >= 0,
        stations=_stations(layout, rows, span, change, factors),
        E=E,
        rho=rho,
    )


def _constants_of(
    layout: Layout, kind: Ints, shear_factors: Array | None, change: SectionChange
) -> dict[str, Array]:
    """Return the table's rows of lines, with changed sections."""
    unused = ("up", "angle", "k_full_y", "k_full_z")
    table: dict[str, Array] = {key: values[kind] for key, values in layout.table.items() if key not in unused}
    if change is not NO_CHANGE:
        table = {key: getattr(change, key, 1.0) * values for key, values in table.items()}
        if change.timoshenko:
            beam = 1 - table["bar"]
            table |= {f"k{d}": layout.table[f"k_full_{d}"][kind] * beam for d in "yz"}
            table["rotary"] = change.rotary * beam
    if shear_factors is not None:
        y, z = shear_factors
        table |= {"ky": table["ky"] / y, "kz": table["kz"] / z}
    return table


def _moduli(layout: Layout, kind: Ints, values: Mapping[str, Any]) -> tuple[Array, Array]:
    """Return Young's modulus and density of lines; G follows E."""
    kinds, each = np.unique(kind, return_inverse=True)
    made_of = [layout.materials[k] for k in kinds]
    E, rho = (
        np.array([values.get(f"{key}:{m.name}", getattr(m, key)) for m in made_of])[each]
        for key in ("E", "rho")
    )
    return E, rho


def _end_maps(R: Floats, end: Floats) -> Floats:
    """Return the local motion of ends at arms (b, 2, 3) from their nodes, from global DOFs: (b, 12, 12)."""
    T = np.zeros((len(R), 12, 12))
    for k in range(2):
        o = 6 * k
        T[:, o : o + 3, o : o + 3] = R
        T[:, o + 3 : o + 6, o + 3 : o + 6] = R
        T[:, o : o + 3, o + 3 : o + 6] = -R @ cross_matrices(end[:, k])
    return T


def _shear_parameter(table: Mapping[str, Array], I: str, k: str, L: Array, factor: Any) -> Array:
    """Return φ = 12 EI/(k GA L²) of prismatic lines, 0 where k is."""
    above = factor * 24 * (1 + table["nu"]) * table[I]
    below = table[k] * table["A"] * L**2
    out = np.zeros(L.shape, dtype=np.result_type(above, below))
    return np.divide(above, below, out=out, where=np.real(table[k]) > 0)


def _stations(layout: Layout, rows: Ints, span: Floats, change: SectionChange, shear: Array) -> Array:
    """Return the constants along the flexible parts of tapered lines, shape (b, N_STATIONS, 7); 1 for others.

    ``shear`` are factors of the shear flexibility along y and z, (2, b). Empty, (b, 0, 7), without tapers.
    """
    some = np.flatnonzero(layout.taper[rows] >= 0)
    if not some.size:
        return np.zeros((len(rows), 0, len(COLUMNS)))
    lines, kind = rows[some], layout.kind[rows[some]]
    zone = layout.zone[lines] / span[some, None]
    first, last = zone[:, :1], 1 - zone[:, 1:]
    at = constants_at(layout, lines, first + tapered.STATIONS * (last - first))
    sizes = at[..., :5] * np.array([getattr(change, key) for key in CONSTANTS[:5]])
    sheared = 1 - layout.table["bar"] if change.timoshenko else layout.table["rotary"]
    k = at[..., 5:] * sheared[kind, None, None]
    flexibility = change.shear * 2 * (1 + layout.table["nu"][kind, None, None]) * shear.T[some, None, :]
    flexibility = flexibility * (k > 0) / (np.where(k > 0, k, 1.0) * sizes[..., :1])
    out = np.ones((len(rows), *at.shape[1:]), dtype=np.result_type(sizes, flexibility))
    out[some] = np.concatenate([sizes, flexibility], axis=-1)
    return out


def shear_factors(shear: Mapping[str, tuple[Any, Any]], mesh: Mesh) -> Array:
    """Return the factors of shear flexibility along y and z of all lines, shape (2, n_lines)."""
    return ByMember.of(shear).on(mesh, _shear_factors)


def _shear_factors(shear: Mapping[str, tuple[Any, Any]], mesh: Mesh) -> Array:
    each = [np.asarray(pair) for pair in shear.values()]
    out = np.ones((2, mesh.n_lines), dtype=np.result_type(float, *each))
    for member, pair in zip(shear, each, strict=True):
        out[:, mesh.members[member]] = pair[:, None]
    return out


def some_lines(g: Lines, rows: Ints) -> Lines:
    """Return some of the lines, with rigid end connections."""
    skip = ("soft", "slip", "ends", "fixed")
    keep = {key: getattr(g, key)[rows] for key in Lines.__slots__ if key not in skip}
    return Lines(**keep, soft=g.soft[:0], slip=g.slip[:0], ends=g.ends[:0], fixed=g.fixed[:0])


def n_gauss(g: Lines, n: int) -> int:
    """Return the number of Gauss points that integrate products of shapes: n without tapers."""
    return tapered.N_STATIONS if g.tapered.any() else n


def flexible_fraction(g: Lines, xi: Array) -> Array:
    """Return the fraction of the flexible part at a fraction of the line; rigid zones are at 0 and 1.

    The imaginary part of a complex step passes through.
    """
    x = (xi * g.span - g.zone[:, 0]) / g.L
    return np.where(np.real(x) < 0, 0.0, np.where(np.real(x) > 1, 1.0, x))


def constants_along(g: Lines, xi: Any) -> dict[str, Array]:
    """Return A, Iy, Iz, Ip, J and k A along y and z at places xi (…, b), each of its shape."""
    shape = np.shape(xi)
    out = {key: np.broadcast_to(getattr(g, key), shape) for key in CONSTANTS[:5]}
    out |= {f"kA{d}": np.broadcast_to(getattr(g, f"k{d}") * g.A, shape) for d in "yz"}
    t = np.flatnonzero(g.tapered)
    if t.size:
        here = (tapered.weights_at(xi[..., t])[..., None, :] @ g.stations[t])[..., 0, :]
        for key, value in out.items():
            new = np.array(value, dtype=np.result_type(value, here))
            if key.startswith("kA"):
                s, G = here[..., COLUMNS[f"s{key[2]}"]], 2 * (1 + g.nu[t])
                new[..., t] = np.divide(G, s, out=np.zeros_like(s), where=s != 0)
            else:
                new[..., t] = here[..., COLUMNS[key]]
            out[key] = new
    return out


def rigidities(g: Lines, xi: Array) -> Array:
    """Return EA, ky GA, kz GA, GJ, EIy and EIz at places xi (…, b), shape (…, b, 6); bars have EA alone."""
    G, beam, at = g.E / (2 * (1 + g.nu)), 1 - g.bar, constants_along(g, xi)
    bent = (G * at["kAy"], G * at["kAz"], G * at["J"], g.E * at["Iy"], g.E * at["Iz"])
    return np.stack([g.E * at["A"], *(beam * q for q in bent)], axis=-1)


def inertias(g: Lines, xi: Array) -> Array:
    """Return mass and rotary inertia per length at places xi (…, b), shape (…, b, 6)."""
    at = constants_along(g, xi)
    rotary = g.turning * g.rotary
    turning = ((1 - g.bar) * at["Ip"], rotary * at["Iy"], rotary * at["Iz"])
    return g.rho[:, None] * np.stack([at["A"], at["A"], at["A"], *turning], axis=-1)


def cross_matrices(v: Floats) -> Floats:
    """Return the matrices of cross products, S w = v × w, of vectors (b, 3), also complex ones: (b, 3, 3)."""
    S = np.zeros((len(v), 3, 3), dtype=v.dtype)
    S[:, 0, 1], S[:, 0, 2], S[:, 1, 2] = -v[:, 2], v[:, 1], -v[:, 0]
    return S - np.swapaxes(S, 1, 2)
