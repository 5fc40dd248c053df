"""Matrices of a structure with the degrees of freedom that they act on, whatever program they come from."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike

from fem.array_types import Floats, Ints
from fem.model import lever_matrix
from fem.summary import fields_summary

AXES = ("X", "Y", "Z", "RX", "RY", "RZ")
"""Directions 1 to 6 in a label such as ``"12Z+"``."""

UNITS: Mapping[str, tuple[float, float, float]] = {
    "SI": (1.0, 1.0, 1.0),
    "mm-t-s": (1e-3, 1e3, 1.0),
    "mm-kg-ms": (1e-3, 1.0, 1e-3),
    "mm-kg-s": (1e-3, 1.0, 1.0),
    "in-lbf-s": (0.0254, 0.45359237 * 9.80665 / 0.0254, 1.0),
    "ft-lbf-s": (0.3048, 0.45359237 * 9.80665 / 0.3048, 1.0),
}
"""Length [m], mass [kg] and time [s] of one unit of consistent systems: mm-t-s has N and MPa, mm-kg-ms kN and
GPa, in-lbf-s the mass lbf s²/in."""


class MatricesError(ValueError):
    """Matrices that cannot be those of a structure; the message gives the value found."""


def consistent_units(units: str | Sequence[float]) -> tuple[float, float, float]:
    """Return one unit of length, mass and time of a system [m, kg, s].

    Parameters
    ----------
    units : str or (length, mass, time)
        One of ``UNITS``, such as ``"mm-t-s"``, or the three units in m, kg and s.

    Raises
    ------
    MatricesError
        For a name that is not known, or units that are not three positive numbers.
    """
    if isinstance(units, str):
        if units not in UNITS:
            msg = f"the units are '{units}'; allowed are {', '.join(UNITS)}, or (length, mass, time) in SI"
            raise MatricesError(msg)
        return UNITS[units]
    try:
        sizes = [float(v) for v in units]
    except (TypeError, ValueError):
        sizes = []
    if len(sizes) != 3:
        msg = f"the units are {units}; a name, or length, mass and time in m, kg and s are needed"
        raise MatricesError(msg)
    length, mass, time = sizes
    if not (np.isfinite(sizes).all() and min(sizes) > 0):
        msg = f"the units are {length:g} m, {mass:g} kg, {time:g} s; all three must be positive"
        raise MatricesError(msg)
    return length, mass, time


@dataclass(frozen=True, slots=True, eq=False)
class Matrices:
    """Symmetric K, M and, where there is damping, C and D; Z = K + iD + iωC - ω²M.

    Attributes
    ----------
    K, M : sparse (n, n)
        Stiffness [N/m …] and mass [kg …].
    C, D : sparse (n, n) or None
        Viscous [N·s/m …] and structural damping [N/m …].
    node : ndarray of int (n,)
        Node of each row; -1 for a coordinate that is no motion of one node.
    direction : ndarray of int (n,)
        1 to 6 for X Y Z RX RY RZ in global axes; 0 for a coordinate that is no motion of one node.
    nodes : ndarray of int (n_nodes,)
        Numbers of the nodes whose places are known.
    points : ndarray (n_nodes, 3)
        Their coordinates [m].
    Q : sparse (n_dof, n) or None
        From the coordinates to all degrees of freedom, where constraints were eliminated.
    """

    K: sp.csr_array
    M: sp.csr_array
    C: sp.csr_array | None
    D: sp.csr_array | None
    node: Ints
    direction: Ints
    nodes: Ints
    points: Floats
    Q: sp.csr_array | None = None

    __repr__ = fields_summary

    @classmethod
    def from_arrays(
        cls,
        K: Any,
        M: Any,
        node: ArrayLike,
        direction: ArrayLike,
        nodes: ArrayLike = (),
        points: ArrayLike = (),
        C: Any = None,
        D: Any = None,
        Q: Any = None,
    ) -> "Matrices":
        """Check matrices, dense or sparse, and put them together; see the attributes.

        Raises
        ------
        MatricesError
            For shapes that do not fit, entries that are not finite, a matrix that is not symmetric, or a
            degree of freedom that comes twice.
        """
        node, direction = (np.array(v, dtype=np.int64, ndmin=1) for v in (node, direction))
        numbers, places = np.array(nodes, dtype=np.int64, ndmin=1), np.array(points, dtype=float)
        places = places.reshape(-1, 3) if places.size % 3 == 0 else places
        n = node.size
        if direction.shape != (n,) or not ((direction >= 0) & (direction <= 6)).all():
            msg = f"{direction.size} directions for {n} nodes; each is 1 to 6 (X Y Z RX RY RZ), or 0 for none"
            raise MatricesError(msg)
        if places.shape != (numbers.size, 3):
            msg = f"the points have shape {places.shape} for {numbers.size} nodes; (n_nodes, 3) is expected"
            raise MatricesError(msg)
        if np.unique(numbers).size != numbers.size:
            twice = numbers[np.flatnonzero(np.bincount(np.unique(numbers, return_inverse=True)[1]) > 1)]
            msg = f"node {np.sort(twice)[0]} has two places"
            raise MatricesError(msg)
        real = direction > 0
        pairs, count = np.unique(np.column_stack([node, direction])[real], axis=0, return_counts=True)
        if (count > 1).any():
            p, d = pairs[int(np.argmax(count > 1))]
            msg = f"the degree of freedom {label(int(p), int(d))} comes twice; each belongs to one row"
            raise MatricesError(msg)
        found = {
            name: None if X is None else _symmetric(X, name, n)
            for name, X in (("K", K), ("M", M), ("C", C), ("D", D))
        }
        if found["K"] is None or found["M"] is None:
            msg = f"{'K' if found['K'] is None else 'M'} is missing; both K and M are needed"
            raise MatricesError(msg)
        if Q is not None and Q.shape[1] != n:
            msg = f"Q has shape {Q.shape}; (n_dof, {n}) is expected"
            raise MatricesError(msg)
        for array in (node, direction, numbers, places):
            array.flags.writeable = False
        basis = None if Q is None else sp.csr_array(Q)
        return cls(found["K"], found["M"], found["C"], found["D"], node, direction, numbers, places, basis)

    @property
    def n(self) -> int:
        """Number of rows."""
        return self.node.size

    @property
    def labels(self) -> tuple[str, ...]:
        """Labels of the rows: ``"12Z+"``, or ``"q7"`` where row 7 is no motion of one node."""
        return tuple(
            label(p, d) if d else f"q{k}"
            for k, (p, d) in enumerate(zip(self.node.tolist(), self.direction.tolist(), strict=True))
        )

    @property
    def size(self) -> float:
        """Largest extent of the places along an axis [m]."""
        return float(np.ptp(self.points, axis=0).max()) if len(self.points) else 0.0

    def place_of(self, node: int) -> Floats:
        """Return the coordinates of a node, shape (3,) [m].

        Raises
        ------
        MatricesError
            If its place is not known.
        """
        at = np.flatnonzero(self.nodes == node)
        if not at.size:
            msg = f"the place of node {node} is not known; {_some(self.nodes, 'places are known of nodes')}"
            raise MatricesError(msg)
        return self.points[at[0]]

    def rows_of(self, node: int) -> Ints:
        """Return the rows of a node's directions 1 to 6, -1 where it has none, shape (6,).

        Raises
        ------
        MatricesError
            If the matrices have no row of the node.
        """
        rows = np.full(6, -1)
        at = np.flatnonzero((self.node == node) & (self.direction > 0))
        if not at.size:
            known = np.unique(self.node[self.direction > 0])
            msg = f"the matrices have no row of node {node}; {_some(known, 'they have nodes')}"
            raise MatricesError(msg)
        rows[self.direction[at] - 1] = at
        return rows

    def rows_at(self, nodes: Sequence[int]) -> Ints:
        """Return the rows of nodes' directions 1 to 6, as :meth:`rows_of` for each, shape (k, 6)."""
        wanted = np.asarray(nodes, dtype=np.int64)
        at = np.flatnonzero(np.isin(self.node, wanted) & (self.direction > 0))
        order = np.argsort(wanted)
        rows = np.full((wanted.size, 6), -1)
        rows[order[np.searchsorted(wanted, self.node[at], sorter=order)], self.direction[at] - 1] = at
        lost = (rows < 0).all(axis=1)
        if lost.any():
            self.rows_of(int(wanted[lost][0]))  # raises an error that lists the nodes with rows
        return rows

    def places_of(self, nodes: Sequence[int]) -> Floats:
        """Return the coordinates of nodes, as :meth:`place_of` for each, shape (k, 3) [m]."""
        wanted = np.asarray(nodes, dtype=np.int64)
        known = np.flatnonzero(np.isin(self.nodes, wanted))
        known = known[np.argsort(self.nodes[known])]
        at = np.searchsorted(self.nodes[known], wanted)
        lost = at == len(known)
        lost[~lost] = self.nodes[known][at[~lost]] != wanted[~lost]
        if lost.any():
            self.place_of(int(wanted[lost][0]))  # raises an error that lists the nodes with places
        return self.points[known[at]]

    def rigid_motions(self, about: ArrayLike | None = None) -> Floats:
        """Return the six rigid-body motions of the rows, shape (n, 6) [m and rad per m and rad].

        Rotations are about a point, the mean of the nodes' places unless given. Coordinates that are no
        motion of one node are taken through Q. Without Q they are amplitudes of modes with the nodes fixed,
        which are zero in a rigid-body motion; that K costs it no energy then shows whether they are.

        Raises
        ------
        MatricesError
            If the place of a node is not known.
        """
        if self.Q is not None:
            of_nodes = np.zeros((self.Q.shape[0], 6))
            centre = self.points.mean(axis=0) if about is None else np.asarray(about, dtype=float)
            of_nodes[: 6 * len(self.points)] = lever_matrix(self.points - centre).reshape(-1, 6)
            return np.asarray(self.Q.T @ of_nodes)
        order = np.argsort(self.nodes)
        at = np.searchsorted(self.nodes, self.node, sorter=order)
        at = order[np.minimum(at, max(order.size - 1, 0))] if order.size else np.zeros(self.n, int)
        moves = self.direction > 0
        lost = moves & (self.nodes[at] != self.node if order.size else True)
        if lost.any():
            self.place_of(int(self.node[lost][0]))  # says so
        centre = self.points.mean(axis=0) if about is None else np.asarray(about, dtype=float)
        levers = lever_matrix(self.points - centre)
        motions = np.zeros((self.n, 6))
        motions[moves] = levers[at[moves], self.direction[moves] - 1]
        return motions

    def scaled(self, units: str | tuple[float, float, float]) -> "Matrices":
        """Return them in SI units, taking them as being in other units.

        With one unit of length L [m], of mass m [kg] and of time T [s], and S = 1/L for translations and 1
        for rotations: K → (m L²/T²) S K S, M → m L² S M S, C → (m L²/T) S C S.

        Parameters
        ----------
        units : str or (length, mass, time)
            One of ``UNITS``, such as ``"mm-t-s"``, or the three units in m, kg and s.

        Raises
        ------
        MatricesError
            For a name that is not known, or units that are not positive.
        """
        length, mass, time = consistent_units(units)
        if (length, mass, time) == (1.0, 1.0, 1.0):
            return self
        if (self.direction == 0).any() and self.Q is not None:
            msg = "coordinates that are no motion of a node have no unit to convert"
            raise MatricesError(msg)
        # an amplitude of a mode is a number: only its energies have units
        S = sp.diags_array(np.where((self.direction > 0) & (self.direction <= 3), 1 / length, 1.0))
        energy = mass * length**2
        factors = {"K": energy / time**2, "M": energy, "C": energy / time, "D": energy / time**2}
        return replace(
            self, **self._each(lambda key, X: factors[key] * (S @ X @ S)), points=length * self.points
        )

    def placed(self, rotation: ArrayLike | None = None, shift: ArrayLike = (0.0, 0.0, 0.0)) -> "Matrices":
        """Return the same part turned and then moved: x' = R x + shift.

        Parameters
        ----------
        rotation : array_like (3, 3), optional
            R, proper and orthogonal; none unless given.
        shift : array_like (3,)
            [m].

        Raises
        ------
        MatricesError
            If R is no rotation, or a node has some but not all of its three directions.
        """
        R = np.eye(3) if rotation is None else np.asarray(rotation, dtype=float)
        if R.shape != (3, 3) or abs(R @ R.T - np.eye(3)).max() > 1e-9 or np.linalg.det(R) < 0:
            msg = f"the rotation is {R.tolist()}; a proper orthogonal matrix (3, 3) is expected"
            raise MatricesError(msg)
        moved = self.points @ R.T + np.asarray(shift, dtype=float)
        moved.flags.writeable = False
        if rotation is None:
            return replace(self, points=moved)
        return replace(self.turned(dict.fromkeys(np.unique(self.node).tolist(), R)), points=moved, Q=None)

    def turned(self, rotations: Mapping[int, Floats]) -> "Matrices":
        """Return them in coordinates u' = R u of some nodes, which have R (3, 3) by their numbers.

        Raises
        ------
        MatricesError
            If one of these nodes has some but not all of its three directions.
        """
        rows, cols, data = [], [], []
        row_of = {(int(p), int(d)): k for k, (p, d) in enumerate(zip(self.node, self.direction, strict=True))}
        for (p, d), k in row_of.items():
            R = rotations.get(p) if d else None
            if R is None:
                continue
            first = 1 if d <= 3 else 4
            for j in range(3):
                at = row_of.get((p, first + j))
                if at is None:
                    msg = (
                        f"node {p} has {AXES[d - 1]} but not {AXES[first - 1 + j]}; to turn a part, every "
                        "node needs all three"
                    )
                    raise MatricesError(msg)
                rows.append(at)
                cols.append(k)
                data.append(R[j, d - first])
        kept = np.setdiff1d(np.arange(self.n), cols)
        index = np.r_[np.array(rows, dtype=int), kept], np.r_[np.array(cols, dtype=int), kept]
        T = sp.coo_array((np.r_[data, np.ones(kept.size)], index), shape=(self.n, self.n)).tocsr()
        return replace(self, **self._each(lambda _, X: T @ X @ T.T))

    def _each(self, change: Any) -> dict[str, sp.csr_array | None]:
        return {
            key: None if getattr(self, key) is None else sp.csr_array(change(key, getattr(self, key)))
            for key in "KMCD"
        }


def label(node: int, direction: int) -> str:
    """Return the label of a degree of freedom, ``"12Z+"`` for node 12 and direction 3."""
    return f"{node}{AXES[direction - 1]}+"


def _symmetric(X: Any, name: str, n: int) -> sp.csr_array:
    try:
        A = sp.csr_array(X if sp.issparse(X) else np.asarray(X))
    except (TypeError, ValueError) as reason:
        msg = f"{name} is no matrix: {reason}"
        raise MatricesError(msg) from reason
    if A.shape != (n, n):
        msg = f"{name} has shape {A.shape}; ({n}, {n}) is expected for {n} degrees of freedom"
        raise MatricesError(msg)
    if np.iscomplexobj(A.data):
        msg = f"{name} is complex; real K, M, C and D are expected, with structural damping in D"
        raise MatricesError(msg)
    A = A.astype(float)
    if not np.isfinite(A.data).all():
        msg = f"{name} has {int((~np.isfinite(A.data)).sum())} entries that are not finite numbers"
        raise MatricesError(msg)
    gap, largest = abs(A - A.T), float(abs(A).max()) if A.nnz else 0.0
    worst = float(gap.max()) if gap.nnz else 0.0
    # Relative size of A - Aᵀ up to which a matrix counts as symmetric: files keep 8 digits or more
    if worst > 1e-8 * largest:
        i, j = np.unravel_index(int(gap.argmax()), A.shape)
        msg = (
            f"{name} is not symmetric: the entries ({i}, {j}) and ({j}, {i}) differ by {worst:.3g}, its "
            f"largest entry is {largest:.3g}"
        )
        raise MatricesError(msg)
    return A if worst == 0 else sp.csr_array((A + A.T) / 2)


def _some(numbers: Ints, words: str) -> str:
    if not numbers.size:
        return f"{words}: none"
    shown = ", ".join(str(v) for v in numbers[:8])
    return f"{words} {shown}{f', … ({numbers.size} in all)' if numbers.size > 8 else ''}"
