"""Masses of rigid end zones, and of layers on them: bodies that move with their nodes."""

from collections.abc import Iterator

import numpy as np

from fem.array_types import Floats
from fem.elements.interpolation import gauss_points
from fem.elements.layout import Layout, constants_at
from fem.elements.lines import Lines, SectionChange, cross_matrices
from fem.model import Array


def zone_masses(layout: Layout, g: Lines, k: int, change: SectionChange) -> Array:
    """Return the masses (b, 6, 6) of the rigid zones at ends k at their nodes, global."""
    zone = g.zone[:, k]
    arm = g.end[:, k] - ((0.5 - k) * zone)[:, None] * g.R[:, 0]
    A, Iy, Iz, Ip = zone_sections(layout, g, k, change)
    across = A * zone**2 / 12
    local = np.stack([A, A, A, Ip, Iy + across, Iz + across], axis=1)
    return masses_at_arms(g.R, arm, (g.rho * zone)[:, None] * local)


def zone_sections(layout: Layout, g: Lines, k: int, change: SectionChange) -> Array:
    """Return A, Iy, Iz and Ip of the rigid zones at ends k, shape (4, b); under a taper the means."""
    of = np.stack([g.A, g.Iy, g.Iz, g.Ip])
    t = np.flatnonzero(g.tapered)
    if t.size:
        x, weight = gauss_points(3)  # A is quadratic in tapers
        at = x * g.zone[t, k, None] / g.span[t, None]
        means = (weight @ constants_at(layout, g.rows[t], at if k == 0 else 1 - at)[..., :4]).T
        factor = np.array([change.A, change.Iy, change.Iz, change.Ip])[:, None]
        of = of.astype(np.result_type(of, factor))
        of[:, t] = factor * means
    return of


def masses_in_rigid_zones(g: Lines, first: Array, last: Array, per_length: Array) -> Iterator[Array]:
    """Yield the masses (b, 6, 6), at both nodes, of a layer on rigid zones between two places [m]."""
    across = np.array([0, 0, 0, 0, per_length[2], per_length[1]])
    for k, (begin, end) in enumerate(((0 * g.span, g.zone[:, 0]), (g.span - g.zone[:, 1], g.span))):
        a = np.where(np.real(first) > begin, first, begin)
        b = np.where(np.real(last) < end, last, end)
        length = np.where(np.real(b) > np.real(a), b - a, 0.0)
        flexible = end if k == 0 else begin  # g.end goes from the node to here
        arm = g.end[:, k] + (0.5 * (a + b) - flexible)[:, None] * g.R[:, 0]
        yield masses_at_arms(g.R, arm, length[:, None] * per_length + (length**3 / 12)[:, None] * across)


def masses_at_arms(R: Floats, arm: Array, body: Array) -> Array:
    """Return masses (b, 6, 6) at nodes of bodies (b, 6) in axes R, at arms (b, 3) from the nodes."""
    G = np.zeros((len(arm), 6, 6), dtype=arm.dtype)
    G[:, :3, :3] = G[:, 3:, 3:] = R
    G[:, :3, 3:] = -R @ cross_matrices(arm)
    out: Array = np.swapaxes(G, 1, 2) @ (body[:, :, None] * G)
    return out
