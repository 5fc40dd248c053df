"""Places within elements where something acts: their motion, flexibility and the mass that follows it.

An element with a node at the place, condensed statically, moves there as its shape functions do less the
flexibility times the force that it passes on.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from fem.array_types import Ints
from fem.elements.connections import with_rigid_ends
from fem.elements.cut import Slip, slips
from fem.elements.frame import Frame
from fem.elements.interpolation import carried, gauss_points, shape_matrix
from fem.elements.lines import Lines, flexible_fraction, inertias, n_gauss, some_lines
from fem.elements.matrices import local_stiffness
from fem.elements.stretches import end_flexibility
from fem.mesh import Mesh
from fem.model import Array, Contribution, dofs_of

RIGIDITY = 1e7
"""A clamp gives way so many times less than the end of the element that it holds [-]."""


@dataclass(frozen=True, slots=True, eq=False)
class InnerPlace:
    """A place of a member, in global axes.

    The place moves by N u - F p under the force and moment p that it passes on, u the motion of the nodes.

    Attributes
    ----------
    dofs : ndarray of int (m,)
        DOFs of the element's nodes.
    N : ndarray (6, m)
        Motion of the place.
    F : ndarray (6, 6)
        Flexibility of the place with the nodes fixed; 0 at a node.
    end : ndarray (6, 6)
        Flexibility of the element's free end in each direction alone, which sets a scale.
    eta : float
        Loss factor of the element [-].
    cross : ndarray (m, 6)
        ∫ Nᵀ μ W dx with the motion W p of the element by p, μ the mass per length.
    square : ndarray (6, 6)
        ∫ Wᵀ μ W dx.
    """

    dofs: Ints
    N: Array
    F: Array
    end: Array
    eta: float
    cross: Array
    square: Array

    def mass(self, p: Array) -> Array:
        """Return the change of the mass (n, n) by forces, rows p (6, n); the element's DOFs come first."""
        M = energy(self.square, p)
        across = self.cross @ p
        M[: len(across)] -= across  # both, so that the block of the element's DOFs is symmetric
        M[:, : len(across)] -= across.T
        return M

    def connect(self, lever: Array, dofs: Ints, rows: Array, K: Array, C: Array, D: Array) -> Contribution:
        """Return a connection that acts at the place.

        Parameters
        ----------
        lever : ndarray (6, 6)
            Motion of the connection's side from that of the place.
        dofs : ndarray of int (n,)
            DOFs of the other side.
        rows : ndarray (6, n)
            Its motion, with the sign that it has in the relative motion.
        K, C, D : ndarray (6, 6)
            Stiffness, viscous and structural damping.
        """
        a, F = np.hstack([lever @ self.N, rows]), lever @ self.F @ lever.T
        force = np.linalg.solve(np.eye(6) + K @ F, K @ a)
        strain = a - F @ force
        return Contribution(
            np.concatenate([self.dofs, dofs])[None],
            _batch(energy(K, strain) + energy(F, force)),
            _batch(self.mass(lever.T @ force)),
            _batch(energy(C, strain)),
            _batch(energy(D, strain) + self.eta * energy(F, force)),
        )

    def clamp(self) -> Contribution:
        """Return the contribution of a clamp there, 1/``RIGIDITY`` as flexible as the element's end."""
        force = np.linalg.solve(self.F + self.end / RIGIDITY, self.N)
        K = energy(self.F + self.end / RIGIDITY, force)
        return Contribution(self.dofs[None], _batch(K), _batch(self.mass(force)), None, _batch(self.eta * K))


def energy(X: Array, rows: Array) -> Array:
    """Return rowsᵀ X rows, symmetric also in its rounding."""
    out = rows.T @ X @ rows
    return 0.5 * (out + out.T)


def _batch(X: Array) -> Array | None:
    """Return a batch of one matrix, None if it is 0."""
    return X[None] if np.any(X) else None


def node_place(point: int) -> InnerPlace:
    """Return a point of the mesh as a place."""
    zero = np.zeros((6, 6))
    return InnerPlace(dofs_of(point), np.eye(6), zero, zero, 0.0, zero, zero)


def inner_place(
    frame: Frame, mesh: Mesh, member: str, position: Any, cuts: Sequence[Slip] = ()
) -> InnerPlace:
    """Return the place at an arc length of a member.

    With F₁ and F₂ the flexibilities of the element's parts before and beyond the place, both for forces at
    the element's second end, the place with both ends fixed has F₁ (F₁ + F₂)⁻¹ F₂: the parts share the force
    as springs side by side. This holds for tapers, and at nodes, where one part vanishes. Springs at the
    element's ends give way besides. Terms of mass of higher order stay as they are.

    Parameters
    ----------
    frame : Frame
    mesh : Mesh
    member : str
    position : float
        Arc length [m]; complex for derivatives.
    cuts : sequence of (str, float, str, float)
        Of its element, where this gives way: see :func:`fem.elements.cut.slips`.
    """
    real = float(np.real(position))
    at = mesh.locate(member, real)
    g = frame.kept.get(("place", mesh, at.line), lambda: frame.lines(mesh, [at.line]))
    xi = np.array(
        [at.xi + (1j * np.imag(position) / mesh.lengths()[at.line] if np.iscomplexobj(position) else 0)]
    )
    (x,) = flexible_fraction(g, xi)
    dofs, N = frame.shapes_at(mesh, member, position)
    (G,) = carried(g, mesh, xi)
    W = _by_force(g, x, np.array([x]))[0]
    ends = _slips(g, x)
    first, weight = gauss_points(n_gauss(g, 4))
    at_cuts, *slip = slips(frame, mesh, at.line, cuts) if cuts else (np.zeros(0),)
    breaks = sorted([0.0, x, 1.0, *at_cuts], key=np.real)
    s = np.concatenate([a + (b - a) * first for a, b in pairwise(breaks)])
    weights = np.concatenate([(b - a) * weight for a, b in pairwise(breaks)])
    shapes = shape_matrix(some_lines(g, np.zeros(len(s), dtype=np.int64)), s)
    moved = _by_force(g, x, s) + shapes @ ends
    mass = (weights * g.L[0] * (1 - g.lumped[0]))[:, None] * inertias(g, s[:, None])[:, 0]
    spread = np.swapaxes(moved, 1, 2) * mass[:, None, :]
    local = shape_matrix(g, np.array([x]))[0]
    (free,) = end_flexibility(g, np.zeros(1), np.ones(1))
    turned = np.kron(np.eye(2), g.R[0])
    F, cross = W + local @ ends, g.T[0].T @ (spread @ shapes).sum(axis=0).T
    WW = (spread @ moved).sum(axis=0)
    if cuts and (0 < np.real(x) < 1 or not g.soft.size):  # a place at a node of springs is the node
        M, rigid, S, Q = slip
        # less the slips of the ends in their connections by the motion of the nodes
        M = M - _slip_by(g, local_stiffness(with_rigid_ends(g))[0]) @ M
        jump = _jumps(at_cuts, M, rigid, np.array([x]), local[None])[0]
        jumps = _jumps(at_cuts, M, rigid, s, shapes)
        N, F = N + G @ jump @ S @ Q.T, F + jump @ S @ jump.T
        more = jumps @ S @ jump.T
        heavy, light, slow = (np.swapaxes(X, 1, 2) * mass[:, None, :] for X in (jumps, shapes, more))
        cross = cross + g.T[0].T @ (light @ more).sum(axis=0) + Q @ S @ (heavy @ (moved + more)).sum(axis=0)
        both = (spread @ more).sum(axis=0)
        WW = WW + both + both.T + (slow @ more).sum(axis=0)
    return InnerPlace(
        dofs, N, G @ F @ G.T, turned.T @ np.diag(np.diag(free)) @ turned, g.eta[0], cross @ G.T, G @ WW @ G.T
    )


def _jumps(at: Array, M: Array, rigid: Array, s: Array, shapes: Array) -> Array:
    """Return the local motion (n, 6, n_cuts) of places s of a line by unit slips of its cuts, nodes fixed."""
    beyond = (np.real(s)[:, None] > np.real(at)) | (np.real(s)[:, None] >= 1)
    along = s[:, None, None]
    return beyond[:, None, :] * ((1 - along) * rigid[:6] + along * rigid[6:]) - shapes @ M


def _by_force(g: Lines, x: Any, s: Array) -> Array:
    """Return the local motion (n, 6, 6) at places s (n,) by forces at x, with both ends of a line fixed."""
    n = len(s)
    line, some = some_lines(g, np.zeros(1, dtype=np.int64)), some_lines(g, np.zeros(n, dtype=np.int64))
    zero, one = np.zeros(1), np.ones(1)
    before, beyond = (end_flexibility(line, *part)[0] for part in ((zero, [x] * one), ([x] * one, one)))
    nearer = np.real(s) <= np.real(x)
    parts = end_flexibility(some, np.where(nearer, 0.0, s), np.where(nearer, s, 1.0))
    shared = np.linalg.solve(before + beyond, np.stack([beyond, before])) @ _from_end(g, np.array([x]))[0].T
    bar = np.where(np.arange(6) > 0, 1 - g.bar[0], 1.0)  # a bar passes on nothing but tension
    return bar[:, None] * (_from_end(g, s) @ parts @ shared[np.where(nearer, 0, 1)]) * bar


def _from_end(g: Lines, s: Array) -> Array:
    """Return the motion (n, 6, 6) of places s (n,) that move as one body with the second end of a line."""
    out = np.zeros((len(s), 6, 6), dtype=s.dtype)
    out[:] = np.eye(6)
    arm = (1 - s) * g.L[0]
    out[:, 1, 5], out[:, 2, 4] = -arm, arm
    return out


def _slips(g: Lines, x: Any) -> Array:
    """Return the local motion (12, 6) of a line's ends by forces at x, where connections let them slip."""
    local = shape_matrix(g, np.array([x]))[0]
    if 0 < np.real(x) < 1:
        return _slip_by(g, local.T)
    return np.zeros((12, 6), dtype=local.dtype)


def _slip_by(g: Lines, force: Array) -> Array:
    """Return the slips (12, n) of a line's ends in their connections by forces on the ends."""
    out = np.zeros_like(force)
    if g.soft.size:
        slip = ~g.fixed[0]
        K = local_stiffness(with_rigid_ends(g))[0][np.ix_(slip, slip)] + np.diag(g.ends[0][slip])
        out[slip] = np.linalg.solve(K, force[slip])
    return out
