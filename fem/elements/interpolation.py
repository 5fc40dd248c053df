"""Shape functions of elements: the motion, strains and slopes along them from the motion of their ends.

They solve the static Timoshenko equations exactly (Friedman & Kosmatka, Computers & Structures 47, 1993,
473-481); for tapered lines `fem.elements.tapered` integrates them.
"""

from dataclasses import replace
from functools import cache

import numpy as np

from fem.array_types import Floats, Ints
from fem.elements import tapered
from fem.elements.lines import COLUMNS, Lines, cross_matrices, flexible_fraction, some_lines
from fem.mesh import Mesh
from fem.model import Array

XY_DOFS = [1, 5, 7, 11]  # v and θz of both ends
XZ_DOFS = [2, 4, 8, 10]  # w and θy of both ends
XZ_SIGNS = np.array([1.0, -1.0, 1.0, -1.0])  # θy = -dw/dx


def prismatic_bending(xi: Array, L: Array, phi: Array, wanted: str) -> list[Array]:
    """Return shape functions of a prismatic beam for (v1, θ1, v2, θ2), each (…, b, 4), at places xi (…, b).

    ``wanted`` has a letter for each: v deflection, r rotation, c curvature, s slope.
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


def bending_shapes(g: Lines, xi: Array, d: str, wanted: str) -> list[Array]:
    """Return shape functions of bending in x-y (d = "y") or x-z (d = "z"), also of tapered lines.

    As :func:`prismatic_bending` has them.
    """
    out = prismatic_bending(xi, g.L, g.phi_y if d == "y" else g.phi_z, wanted)
    t = np.flatnonzero(g.tapered)
    if not t.size:
        return out
    I, shear = (g.stations[t][..., COLUMNS[key]] for key in ("Iz" if d == "y" else "Iy", f"s{d}"))
    of_tapers = tapered.bending(xi[..., t], g.L[t], I, shear, wanted)
    out = [np.array(a, dtype=np.result_type(a, b)) for a, b in zip(out, of_tapers, strict=True)]
    for a, b in zip(out, of_tapers, strict=True):
        a[..., t, :] = b
    return out


def end_share(g: Lines, xi: Array, key: str, derivative: bool = False) -> Array:
    """Return the fraction of the second end's stretch (A) or twist (J) at places xi (…, b), or its slope."""
    out = np.ones_like(xi) if derivative else xi
    t = np.flatnonzero(g.tapered if key == "A" else g.tapered & (g.bar == 0))
    if t.size:
        of_tapers = tapered.extension(xi[..., t], g.stations[t][..., COLUMNS[key]], derivative)
        out = np.array(out, dtype=np.result_type(out, of_tapers))
        out[..., t] = of_tapers
    return out


def shape_matrix(g: Lines, xi: Array) -> Array:
    """Return the local motion (…, b, 6, 12) of places xi (…, b) on the flexible parts from their ends'."""
    vy, ry = bending_shapes(g, xi, "y", "vr")
    vz, rz = bending_shapes(g, xi, "z", "vr")
    N = np.zeros((*xi.shape, 6, 12), dtype=np.result_type(vy, vz))
    N[..., 1, XY_DOFS], N[..., 5, XY_DOFS] = vy, ry
    N[..., 2, XZ_DOFS], N[..., 4, XZ_DOFS] = vz * XZ_SIGNS, -rz * XZ_SIGNS
    bar = g.bar != 0
    if bar.any():
        N[..., bar, :, :] = _bar_shapes(xi[..., bar], g.L[bar])
    for d, key in ((0, "A"), (3, "J")):
        share = end_share(g, xi, key)
        N[..., d, d], N[..., d, d + 6] = 1 - share, share
    return N


def _bar_shapes(xi: Array, L: Array) -> Array:
    """Return the motion of a bar: straight between its ends; about its axis it turns as they do."""
    N = np.zeros((*xi.shape, 6, 12), dtype=np.result_type(xi, L))
    for d in range(4):
        N[..., d, d], N[..., d, 6 + d] = 1 - xi, xi
    N[..., 4, 2], N[..., 4, 8] = 1 / L, -1 / L
    N[..., 5, 1], N[..., 5, 7] = -1 / L, 1 / L
    return N


def strain_matrix(g: Lines, xi: Array) -> Array:
    """Return the strains (…, b, 6, 12) at places xi (…, b) on the flexible parts from their ends' motion."""
    ry, cy, sy = bending_shapes(g, xi, "y", "rcs")
    rz, cz, sz = bending_shapes(g, xi, "z", "rcs")
    B = np.zeros((*xi.shape, 6, 12), dtype=np.result_type(cy, cz))
    for d, key in ((0, "A"), (3, "J")):
        stretch = end_share(g, xi, key, derivative=True) / g.L
        B[..., d, d], B[..., d, d + 6] = -stretch, stretch
    B[..., 1, XY_DOFS], B[..., 5, XY_DOFS] = sy - ry, cy
    B[..., 2, XZ_DOFS], B[..., 4, XZ_DOFS] = (sz - rz) * XZ_SIGNS, -cz * XZ_SIGNS
    return B


def slope_matrix(g: Lines, xi: Array) -> Array:
    """Return v' and w' of the axis (b, 2, 12) at places xi (b,) from the ends' motion."""
    S = np.zeros((len(g.L), 2, 12), dtype=np.result_type(g.phi_y, g.phi_z))
    (S[:, 0, XY_DOFS],) = bending_shapes(g, xi, "y", "s")
    (rise,) = bending_shapes(g, xi, "z", "s")
    S[:, 1, XZ_DOFS] = rise * XZ_SIGNS
    bar = g.bar != 0
    if bar.any():
        S[bar] = 0.0
        for row, d in ((0, 1), (1, 2)):
            S[bar, row, d], S[bar, row, 6 + d] = -1 / g.L[bar], 1 / g.L[bar]
    return S


def carried(g: Lines, mesh: Mesh, xi: Array) -> Array:
    """Return the global motion of places on the mesh's lines from the local one of the axis, (b, 6, 6)."""
    x = flexible_fraction(g, xi)
    ends = mesh.points[mesh.lines[g.rows]]
    arm = xi[:, None] * (ends[:, 1] - ends[:, 0]) - g.end[:, 0] - (x * g.L)[:, None] * g.R[:, 0]
    arm = np.where(
        np.abs(arm) < 1e-12 * g.span[:, None], 0.0, arm
    )  # rounding would load rotations without stiffness
    G = np.zeros((len(xi), 6, 6), dtype=arm.dtype)
    G[:, :3, :3] = G[:, 3:, 3:] = np.swapaxes(g.R, 1, 2)
    G[:, :3, 3:] = -cross_matrices(arm) @ G[:, 3:, 3:]
    return G


def motion_matrix(g: Lines, mesh: Mesh, xi: Array, slipped: bool = False) -> Array:
    """Return the motion of places on the mesh's lines, global axes, from the DOFs, shape (b, 6, 12).

    Ends of lines move with the node, or with the member if ``slipped``; ends with a rigid zone with the node.
    """
    x = flexible_fraction(g, xi)
    at_node = (np.imag(x) == 0) & ((np.real(x) < 1e-9) | (np.real(x) > 1 - 1e-9))
    if slipped:
        at_node &= np.where(np.real(x) < 0.5, g.zone[:, 0], g.zone[:, 1]) > 0
    T = np.where(at_node[:, None, None], g.T_nodes, g.T)
    return carried(g, mesh, xi) @ shape_matrix(g, x) @ T


def axis_displacements(g: Lines, each: Ints, xi: Floats, u: Floats) -> Floats:
    """Return the displacements of places on the axes of lines, global, shape (n, 3, n_cases) [m].

    The same as by :func:`motion_matrix`, without a matrix for each place.

    Parameters
    ----------
    g : Lines
        Different lines.
    each : ndarray of int (n,)
        Which of these each place is on.
    xi : ndarray (n,)
        Fractions of the axes.
    u : ndarray (n_dof, n_cases)
        Motions of all DOFs.
    """
    parts = some_lines(replace(g, T=np.zeros((len(g.L), 0, 0))), each)
    x = flexible_fraction(parts, xi)
    ends = np.real(g.T @ u[g.dofs])[each]
    if g.soft.size:
        at_node = (x < 1e-9) | (x > 1 - 1e-9)
        ends = np.where(at_node[:, None, None], np.real(g.T_nodes @ u[g.dofs])[each], ends)
    motion = np.real(shape_matrix(parts, x)) @ ends
    to_global = np.swapaxes(parts.R, 1, 2)
    out: Floats = to_global @ motion[:, :3]
    if g.zone.any():  # places in rigid zones are beyond the ends of the flexible part
        beyond = xi * parts.span - parts.zone[:, 0] - x * parts.L
        out += np.cross(to_global @ motion[:, 3:], (beyond[:, None] * parts.R[:, 0])[:, :, None], axis=1)
    return out


# Gauss points on the unit interval --------------------------------------------------------------------------


@cache
def gauss_points(n: int) -> tuple[Floats, Floats]:
    """Return n Gauss points of 0 … 1 and their weights, which sum to 1."""
    x, w = np.polynomial.legendre.leggauss(n)
    points, weights = (x + 1) / 2, w / 2
    points.flags.writeable = weights.flags.writeable = False  # all callers share them
    return points, weights
