"""End connections: elements whose ends slip in releases and springs, condensed out of their matrices."""

from dataclasses import replace

import numpy as np

from fem.elements.layout import Layout
from fem.elements.lines import Lines, some_lines
from fem.elements.matrices import local_stiffness, to_global
from fem.model import Array


def end_slips(K: Array, hold: Array, give: Array) -> Array:
    """Return G (b, n, n) of the slips δ = G u of an element's ends in their connections.

    The connection's force is that of the element, K (u - δ). With u at the node and u - δ at the element's
    end, each direction obeys hold δ = give K (u - δ), so that (hold + give K) δ = give K u. The element keeps
    its shape functions at u - δ = (1 - G) u, and its stiffness loses K G. For one direction e and
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


def connect_ends(rigid: Lines, layout: Layout) -> Lines:
    """Return lines with the slips of their end connections, from lines with rigid ones."""
    soft = np.flatnonzero(layout.soft[rigid.rows] >= 0)
    if not soft.size:
        return rigid
    ends = layout.ends[layout.soft[rigid.rows[soft]]]
    fixed = np.isinf(ends)
    K = local_stiffness(some_lines(rigid, soft))
    slip = end_slips(K, np.where(fixed, 1.0, ends), np.where(fixed, 0.0, 1.0)) @ rigid.T[soft]
    T = rigid.T.astype(slip.dtype)
    T[soft] -= slip
    return replace(rigid, T=T, soft=soft, slip=slip, ends=np.where(fixed, 0.0, ends), fixed=fixed)


def moved_by_loads(g: Lines, stretched: Array, force: Array) -> Array:
    """Return the motion of the ends of one line behind their connections, under loads while its nodes rest.

    The ends u obey hold u = -give r in each direction, with the forces r = K u - f of the connections on the
    element. The forces f that do the work of the loads follow from them and from the motion w of an end
    relative to the other: f = K w - r, as rigid-body motions of the element meet no resistance. Hence
    (hold + give K) u = give (K w - r).

    Parameters
    ----------
    g : Lines
        One line, with connections.
    stretched : ndarray (12, n_cases)
        w, local [m, rad].
    force : ndarray (12, n_cases)
        r, local [N, N·m].

    Returns
    -------
    ndarray (12, n_cases)
        Local [m, rad].
    """
    K = np.real(local_stiffness(with_rigid_ends(g))[0])
    hold, give = np.where(g.fixed[0], 1.0, g.ends[0]), np.where(g.fixed[0], 0.0, 1.0)
    out: Array = np.linalg.solve(np.diag(hold) + give[:, None] * K, give[:, None] * (K @ stretched - force))
    return out


def with_rigid_ends(g: Lines) -> Lines:
    """Return the lines with rigid end connections."""
    return some_lines(g, np.arange(len(g.L)))


def with_connections(g: Lines, K: Array) -> Array:
    """Return local stiffnesses K (b, 12, 12) with the ends' connections in series: from node to node."""
    if not g.soft.size:
        return K
    K = K.copy()
    K[g.soft] -= K[g.soft] @ line_slips(g, K[g.soft])
    return K


def line_slips(g: Lines, K: Array) -> Array:
    """Return :func:`end_slips` of the lines with connections, from their stiffness K without."""
    return end_slips(K, np.where(g.fixed, 1.0, g.ends), np.where(g.fixed, 0.0, 1.0))


def mass_from_nodes(g: Lines, M: Array) -> Array:
    """Return the local mass for motions of the nodes from that for motions of the lines' ends."""
    if not g.soft.size:
        return M
    return to_global(M, np.eye(12) - line_slips(g, local_stiffness(with_rigid_ends(g))))
