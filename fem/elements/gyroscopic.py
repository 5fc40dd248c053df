"""Gyroscopic matrices of elements that spin about their axes."""

import numpy as np

from fem.elements.interpolation import shape_matrix
from fem.elements.layout import Layout
from fem.elements.lines import NO_CHANGE, Lines, inertias, n_gauss, some_lines
from fem.elements.matrices import lumped_masses, to_global
from fem.elements.quadrature import gauss_points
from fem.elements.rigid_zones import zone_sections
from fem.model import Array


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
