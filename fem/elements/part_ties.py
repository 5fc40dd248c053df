"""Ties of a part from another program to points of the frame, and checks that it fits there."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from fem.array_types import Floats, Ints
from fem.matrices import Matrices, MatricesError
from fem.mesh import Mesh
from fem.model import ModelError, lever_matrix

TIES = ("rigid", "average")

FREE_RESISTANCE = 1e-6
"""A part is free if its rigid-body motions meet less resistance than this, relative to entries one by one."""
PLAUSIBLE_DENSITY = (1e-3, 5e4)
"""Plausible masses of a part by the box around it [kg/m³]: a truss of wires, solid tungsten."""


@dataclass(frozen=True, slots=True, eq=False)
class Attachment:
    """Nodes of a part that are tied to one point of the frame.

    With r from the point to a node, u the point's displacement and θ its rotation:

    - ``"rigid"`` (as RBE2): u_node = u + θ × r for each node, and θ_node = θ where it has
      rotations. The nodes' area keeps its shape, which stiffens the part.
    - ``"average"`` (as RBE3): u and θ are the rigid-body motion nearest to the nodes' translations,
      Σ w |u_node - u - θ × r|² → minimum. The nodes may move otherwise; the part is not stiffened.

    Attributes
    ----------
    point : int
        Point of the mesh.
    nodes : tuple of int
        Nodes of the part.
    tie : str
        ``"rigid"`` or ``"average"``.
    weights : tuple of float
        w of each node for ``"average"`` [-]; all 1 unless given.
    """

    point: int
    nodes: tuple[int, ...]
    tie: str = "rigid"
    weights: tuple[float, ...] = ()

    def reach(self, matrices: Matrices, mesh: Mesh) -> float:
        """Return the largest distance of its nodes from its point [m]."""
        places = matrices.places_of(self.nodes)
        return float(np.linalg.norm(places - mesh.points[self.point], axis=1).max())

    def __post_init__(self) -> None:
        if self.tie not in TIES:
            msg = f"the tie to point {self.point} is '{self.tie}'; allowed are {', '.join(TIES)}"
            raise ModelError(msg)
        if not self.nodes or len(set(self.nodes)) != len(self.nodes):
            msg = (
                f"the tie to point {self.point} has {len(self.nodes)} nodes; one or more are expected, "
                "each once"
            )
            raise ModelError(msg)
        if self.weights and (len(self.weights) != len(self.nodes) or min(self.weights) <= 0):
            msg = (
                f"the tie to point {self.point} has {len(self.weights)} weights for {len(self.nodes)} nodes; "
                "each node needs one, positive"
            )
            raise ModelError(msg)


def check_attachments(matrices: Matrices, mesh: Mesh, attachments: Sequence[Attachment], where: str) -> None:
    """Refuse ties to points, nodes or directions that do not exist, and nodes with two ties."""
    if not attachments:
        msg = f"{where}: it is tied to no point; give attachments"
        raise ModelError(msg)
    seen: dict[int, int] = {}
    for a in attachments:
        if not 0 <= a.point < mesh.n_points:
            msg = f"{where}: point {a.point} is not in the mesh, which has points 0 to {mesh.n_points - 1}"
            raise ModelError(msg)
        for node in a.nodes:
            if node in seen:
                msg = (
                    f"{where}: node {node} is tied to the points {seen[node]} and {a.point}; a node has one "
                    "tie"
                )
                raise ModelError(msg)
            seen[node] = a.point
        try:
            rows = matrices.rows_at(a.nodes)
            matrices.places_of(a.nodes)
        except MatricesError as reason:
            msg = f"{where}: {reason}"
            raise ModelError(msg) from reason
        absent = (rows[:, :3] < 0).any(axis=1)
        if absent.any():
            k = int(np.argmax(absent))
            missing = ", ".join(axis for axis, row in zip("XYZ", rows[k], strict=False) if row < 0)
            msg = (
                f"{where}: node {a.nodes[k]} has no row for {missing}; interface nodes need three "
                "translations (is it fixed in the model of the part?)"
            )
            raise ModelError(msg)


def interface_map(
    matrices: Matrices, mesh: Mesh, attachments: Sequence[Attachment], where: str
) -> tuple[sp.csr_array, int]:
    """Return G with u_part = G (u_points, z), z the coordinates inside, and the size of u_points."""
    taken = np.zeros(matrices.n, dtype=bool)
    blocks: list[tuple[Ints, int, Floats]] = []
    n_b = 6 * len(attachments)
    n = n_b
    for k, a in enumerate(attachments):
        rows = matrices.rows_at(a.nodes)
        T = lever_matrix(matrices.places_of(a.nodes) - mesh.points[a.point]).reshape(-1, 6)
        have = rows.ravel() >= 0
        if a.tie == "average":
            have &= np.tile(np.arange(6) < 3, len(a.nodes))  # rotations of the nodes stay inside
        rows, T = rows.ravel()[have], T[have]
        taken[rows] = True
        blocks.append((rows, 6 * k, T))
        if a.tie == "rigid":
            continue
        w = np.repeat(np.asarray(a.weights or np.ones(len(a.nodes)), dtype=float), 3)
        arms = np.abs(T[:, 3:]).max()
        scale = np.array([1.0, 1.0, 1.0, *[1 / max(arms, 1e-300)] * 3])
        U, s, _ = np.linalg.svd(np.sqrt(w)[:, None] * T * scale, full_matrices=True)
        if len(rows) < 6 or s[5] < 1e-6 * s[0]:
            msg = (
                f"{where}: the {len(a.nodes)} nodes tied to point {a.point} do not say its rotation; an "
                "average needs three or more that do not lie in a line"
            )
            raise ModelError(msg)
        # u = T u_point + N α with W N = 0: the weighted average of α's motion is zero
        N = U[:, 6:] / np.sqrt(w)[:, None]
        N, _ = np.linalg.qr(N)
        blocks.append((rows, n, N))
        n += N.shape[1]
    inside = np.flatnonzero(~taken)
    i, j, data = [inside], [n + np.arange(inside.size)], [np.ones(inside.size)]
    for rows, first, B in blocks:
        i.append(np.repeat(rows, B.shape[1]))
        j.append(np.tile(first + np.arange(B.shape[1]), len(rows)))
        data.append(B.ravel())
    index = (np.concatenate(i), np.concatenate(j))
    G = sp.coo_array((np.concatenate(data), index), shape=(matrices.n, n + inside.size))
    return G.tocsr(), n_b


def inner_places(matrices: Matrices, G: sp.csr_array, n_b: int) -> Floats | None:
    """Return the places (n_z, 3) of the coordinates inside [m]; None if one has no place.

    ``G`` is that of :func:`interface_map`. A coordinate that moves several nodes has the place of one.
    """
    if not len(matrices.nodes):
        return None
    by_column = sp.csc_array(G[:, n_b:])
    order = np.argsort(matrices.nodes)
    node = matrices.node[by_column.indices[by_column.indptr[:-1]]]
    at = order[np.minimum(np.searchsorted(matrices.nodes, node, sorter=order), len(order) - 1)]
    return matrices.points[at] if (matrices.nodes[at] == node).all() else None


def check_free(matrices: Matrices, where: str) -> None:
    """Raise an error if a rigid-body motion of the part meets resistance."""
    try:
        R = matrices.rigid_motions()
    except MatricesError as reason:
        msg = f"{where}: {reason}"
        raise ModelError(msg) from reason
    R = R / np.array([1.0, 1.0, 1.0, *[max(matrices.size, 1e-300)] * 3])
    force = np.abs(matrices.K @ R).max(axis=0)
    terms = np.max(abs(matrices.K) @ np.abs(R), axis=0)
    resisted = np.divide(force, terms, out=np.zeros(6), where=terms > 0)
    if resisted.max() <= FREE_RESISTANCE:
        return
    names = ("x", "y", "z", "rx", "ry", "rz")
    energy = np.einsum("ij,ij->j", R, matrices.K @ R)
    inertia = np.einsum("ij,ij->j", R, matrices.M @ R)
    hertz = np.sqrt(np.maximum(energy, 0) / np.maximum(inertia, 1e-300)) / (2 * np.pi)
    words = [
        f"{names[k]} {resisted[k]:.1e} ({hertz[k]:.3g} Hz)"
        for k in np.flatnonzero(resisted > FREE_RESISTANCE)
    ]
    msg = (
        f"{where}: the part is not free: rigid-body motions meet forces of {'; '.join(words)} of those "
        f"that its entries give one by one, where rounding leaves less than {FREE_RESISTANCE:g}. Nodes "
        "may be at other places than those the matrices were made with; if the part is held to the ground "
        "by itself, say held=True"
    )
    raise ModelError(msg)


def check_tied(matrices: Matrices, attachments: Sequence[Attachment], where: str) -> None:
    """Raise an error if a piece of a free part is not tied, or the ties leave it free to turn."""
    order = np.argsort(matrices.node, kind="stable")
    same = np.flatnonzero(np.diff(matrices.node[order]) == 0)
    nodes = sp.coo_array((np.ones(same.size), (order[same], order[same + 1])), shape=matrices.K.shape)
    n_pieces, piece = connected_components(abs(matrices.K) + abs(matrices.M) + nodes, directed=False)
    R = matrices.rigid_motions() / np.array([1.0, 1.0, 1.0, *[max(matrices.size, 1e-300)] * 3])
    for k in range(n_pieces):
        motions, tied = np.zeros((0, 6)), []
        for a in attachments:
            rows = matrices.rows_at(a.nodes)
            rows = rows[rows >= 0]
            rows = rows[piece[rows] == k]
            tied += [str(a.point)] * bool(rows.size)
            motions = np.vstack([motions, R[rows]])
        # six motions of a piece, or three of a single node without rotations
        want = np.linalg.matrix_rank(R[piece == k], tol=1e-9)
        if np.linalg.matrix_rank(motions, tol=1e-6) < want:
            loose = np.unique(matrices.node[piece == k])
            words = (
                f"tied to point{'s' * (len(tied) > 1)} {', '.join(tied)} and free to turn"
                if tied
                else "not tied"
            )
            msg = (
                f"{where}: the part is in {n_pieces} piece{'s' * (n_pieces > 1)}, of which the one with "
                f"nodes {', '.join(str(n) for n in loose[:4])}{', …' * (loose.size > 4)} is {words}"
            )
            raise ModelError(msg)


def warn_of_units(matrices: Matrices, mesh: Mesh, attachments: Sequence[Attachment], where: str) -> None:
    """Warn of a mass, size or place that look like other units."""
    moved = np.where(matrices.direction == 1, 1.0, 0.0)
    mass = float(moved @ (matrices.M @ moved))
    size = matrices.size
    sides = np.maximum(np.ptp(matrices.points, axis=0), 1e-3 * size)
    # a line of nodes has no volume: the upper limit is that of a cube, the lower that of the box
    light, heavy = mass / max(float(np.prod(sides)), 1e-300), mass / max(size, 1e-300) ** 3
    if len(matrices.points) > 1 and (light < PLAUSIBLE_DENSITY[0] or heavy > PLAUSIBLE_DENSITY[1]):
        odd = light if light < PLAUSIBLE_DENSITY[0] else heavy
        box = " x ".join(f"{s:.3g}" for s in np.ptp(matrices.points, axis=0))
        warnings.warn(
            f"{where}: {mass:.3g} kg in a box of {box} m is {odd:.2g} kg/m³, "
            "which no part has; units='mm-t-s' and others are for files that are not in SI",
            stacklevel=3,
        )
    for a in attachments:
        middle = matrices.places_of(a.nodes).mean(axis=0)
        gap = float(np.linalg.norm(middle - mesh.points[a.point]))
        if gap > 2 * max(size, mesh.size):
            warnings.warn(
                f"{where}: point {a.point} lies {gap:.3g} m from the middle of its nodes, the part is "
                f"{size:.3g} m and the mesh {mesh.size:.3g} m large; it may be elsewhere or in other units",
                stacklevel=3,
            )
