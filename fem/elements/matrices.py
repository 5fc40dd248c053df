"""Matrices of elements by quadrature: stiffness, mass, lumps, and the stiffness of a unit tension.

They hold for tapers, offsets and rigid zones; `fem.elements.closed_form` has the prismatic cases.
"""

from typing import Any

import numpy as np

from fem.elements import tapered
from fem.elements.closed_form import closed_stiffness, higher_order_mass, local_blocks
from fem.elements.interpolation import XY_DOFS, XZ_DOFS, XZ_SIGNS, gauss_points, shape_matrix, slope_matrix
from fem.elements.levers import lever_stiffness
from fem.elements.lines import COLUMNS, Lines, inertias, n_gauss, some_lines
from fem.model import Array


def to_global(matrix: Array, T: Array) -> Array:
    """Return Tᵀ X T of matrices (b, 12, 12)."""
    return np.swapaxes(T, 1, 2) @ matrix @ T


def local_stiffness(g: Lines) -> Array:
    """Return ∫ Bᵀ diag(EA, …) B dx of the flexible parts, local, shape (b, 12, 12)."""
    K = local_blocks(*closed_stiffness(g))
    t = np.flatnonzero(g.tapered)
    if t.size:
        some = some_lines(g, t)
        K_tapers = np.zeros((t.size, 12, 12), dtype=np.result_type(K, some.stations))
        beam = 1 - some.bar
        stretch = some.L * (tapered.WEIGHTS / some.stations[..., COLUMNS["A"]]).sum(axis=1)
        twist = some.L * (tapered.WEIGHTS / some.stations[..., COLUMNS["J"]]).sum(axis=1)
        for d, k in ((0, 1 / stretch), (3, beam / (2 * (1 + some.nu) * twist))):
            K_tapers[:, d, d] = K_tapers[:, d + 6, d + 6] = k
            K_tapers[:, d, d + 6] = K_tapers[:, d + 6, d] = -k
        for dofs, I, shear, sign in ((XY_DOFS, "Iz", "sy", 1.0), (XZ_DOFS, "Iy", "sz", XZ_SIGNS)):
            of = (some.stations[..., COLUMNS[key]] for key in (I, shear))
            bent = tapered.bending_stiffness(some.L, *of) * np.multiply.outer(sign, sign)
            K_tapers[:, np.array(dofs)[:, None], dofs] = beam[:, None, None] * bent
        K = K.astype(K_tapers.dtype)
        K[t] = some.E[:, None, None] * K_tapers
    return K


def local_mass(g: Lines, start: Any = 0.0) -> Array:
    """Return ∫ Nᵀ ρ diag(A, …) N dx from the fraction ``start`` of the length on, shape (b, 12, 12).

    Terms of mass of higher order are added in proportion to the length.
    """
    if g.tapered.any() and not g.tapered.all():
        parts = [np.flatnonzero(which) for which in (g.tapered, ~g.tapered)]
        joined = np.concatenate([local_mass(some_lines(g, rows), start) for rows in parts])
        out: Array = joined[np.argsort(np.concatenate(parts))]
        return out
    M: Array = np.zeros((len(g.L), 12, 12))
    points, weights = gauss_points(n_gauss(g, 4))
    # Of few lines, as a cut asks for, all points at once; of many they would need memory.
    # Lines whose mass is integrated at all points at once
    n_parts = 1 if len(g.L) <= 64 else len(points)
    for x, weight in zip(np.array_split(points, n_parts), np.array_split(weights, n_parts), strict=True):
        at = np.broadcast_to((start + (1 - start) * x)[:, None], (len(x), len(g.L)))
        N, scale = shape_matrix(g, at), weight[:, None, None] * (1 - start) * g.L[:, None] * inertias(g, at)
        M = M + (np.swapaxes(N, -1, -2) @ (scale[..., None] * N)).sum(axis=0)
    return M + (1 - start) * local_blocks(*higher_order_mass(g)) if g.higher.any() else M


def global_mass(g: Lines) -> Array:
    """Return the consistent, higher-order or lumped mass, global, (b, 12, 12)."""
    lumped = g.lumped != 0
    M = to_global(local_mass(g), g.T)
    if lumped.any():
        some, T = some_lines(g, np.flatnonzero(lumped)), g.T_nodes[lumped]
        M[lumped] = np.swapaxes(T, 1, 2) @ (lumped_masses(some)[:, :, None] * T)
    return M


def lumped_masses(g: Lines) -> Array:
    """Return masses and inertias at both ends (b, 12): halves of the line's, of tapers by lever."""
    x, weight = (each[:, None] for each in gauss_points(n_gauss(g, 1)))
    per_length = inertias(g, np.broadcast_to(x, (len(x), len(g.L))))
    shares = [((part * weight)[..., None] * per_length).sum(axis=0) for part in (1 - x, x)]
    return g.L[:, None] * np.concatenate(shares, axis=1)


def unit_tension_stiffness(g: Lines) -> Array:
    """Return ∫ v'² + w'² + (Iy + Iz)/A a'² dx of the axis, a the twist, global, shape (b, 12, 12)."""
    K: Array = np.zeros((len(g.L), 12, 12))
    for xi, weight in zip(*gauss_points(n_gauss(g, 3)), strict=True):
        S = slope_matrix(g, np.full(len(g.L), xi))
        K = K + np.swapaxes(S, 1, 2) @ ((weight * g.L)[:, None, None] * S)
    twist = (1 - g.bar) * (g.Iy + g.Iz) / (g.A * g.L)
    K[:, 3, 3] += twist
    K[:, 9, 9] += twist
    K[:, 3, 9] -= twist
    K[:, 9, 3] -= twist
    K = to_global(K, g.T)
    for k, sign in ((0, -1.0), (1, 1.0)):  # rigid zones and offsets turn with their nodes
        turn = slice(3 + 6 * k, 6 + 6 * k)
        K[:, turn, turn] += lever_stiffness(sign * g.end[:, k], g.R[:, 0])
    return K
