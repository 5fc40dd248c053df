"""Stiffness and mass of prismatic elements in closed form, as blocks of translations and rotations.

Most elements run straight between their points and have one section. `global_blocks` writes their global
matrices directly, without the product Tᵀ K T.
"""

import numpy as np

from fem.array_types import Floats
from fem.elements.lines import Lines, inertias
from fem.model import Array


def closed_stiffness(g: Lines) -> tuple[Array, ...]:
    """Return the stiffness of beams and bars as the factors of :func:`global_blocks`."""
    beam = (1 - g.bar) * g.E
    y, z = (beam * I / (g.L * (1 + phi)) for I, phi in ((g.Iz, g.phi_y), (g.Iy, g.phi_z)))
    axial, torsion = g.E * g.A / g.L, beam * g.J / (2 * (1 + g.nu) * g.L)
    tt = np.stack([axial, 12 * y / g.L**2, 12 * z / g.L**2])
    tr = np.stack([6 * y / g.L, 6 * z / g.L])
    rr = np.stack([torsion, (4 + g.phi_z) * z, (4 + g.phi_y) * y])
    return tt, -tt, tr, tr, rr, np.stack([-torsion, (2 - g.phi_z) * z, (2 - g.phi_y) * y])


def closed_mass(g: Lines) -> tuple[Array, ...]:
    """Return the mass of elements as the factors of :func:`global_blocks`.

    The integrals of the shape functions' products: Friedman & Kosmatka (1993), with ρA for the deflection
    and ρI for the rotation; with the terms of mass of higher order, or lumps.
    """
    m, L = g.rho * g.A * g.L, g.L
    planes = []
    for phi, I in ((g.phi_y, g.Iz), (g.phi_z, g.Iy)):
        unit = m / (210 * (1 + phi) ** 2)
        turn = g.rotary * g.rho * I / (30 * L * (1 + phi) ** 2)
        planes.append(
            np.stack(
                [
                    unit * (70 * phi**2 + 147 * phi + 78) + 36 * turn,
                    unit * (35 * phi**2 + 63 * phi + 27) - 36 * turn,
                    unit * (35 * phi**2 + 77 * phi + 44) * L / 4 - turn * (15 * phi - 3) * L,
                    -unit * (35 * phi**2 + 63 * phi + 26) * L / 4 - turn * (15 * phi - 3) * L,
                    unit * (7 * phi**2 + 14 * phi + 8) * L**2 / 4 + turn * (10 * phi**2 + 5 * phi + 4) * L**2,
                    -unit * (7 * phi**2 + 14 * phi + 6) * L**2 / 4 + turn * (5 * phi**2 - 5 * phi - 1) * L**2,
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
        blocks[4][:, lumped] = (inertias(g, 0 * L).T[[3, 4, 5]] * L / 2)[:, lumped]
    if g.higher.any():
        blocks = [block + more for block, more in zip(blocks, higher_order_mass(g), strict=True)]
    return tuple(blocks)


def higher_order_mass(g: Lines) -> tuple[Array, ...]:
    """Return the terms that mass of higher order adds, as the factors of :func:`global_blocks`.

    An element deforms as under forces at its ends; the motion that its inertia adds stores more. To the
    second order of its length the mass for that is ρA L²/12 ∫ u'² dx of stretching, ρIp L²/12 ∫ θ'² dx of
    torsion and ρA L²/12 ∫ v' γ dx of shear.
    """
    axial = g.higher * g.rho * g.A * g.L / 12
    y, z = ((1 - g.bar) * axial * phi / (1 + phi) for phi in (g.phi_y, g.phi_z))
    turn = g.higher * (1 - g.bar) * g.rho * g.Ip * g.L / 12
    tt, tr = np.stack([axial, y, z]), np.stack([y, z]) * g.L / 4
    rr = np.stack([turn, 0 * turn, 0 * turn])
    return tt, -tt, tr, tr, rr, -rr


def global_blocks(R: Floats, *factors: Array) -> Array:
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


def local_blocks(tt: Array, tt2: Array, tr: Array, tr2: Array, rr: Array, rr2: Array) -> Array:
    """Return the matrices of :func:`global_blocks` in local axes, shape (b, 12, 12)."""
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
