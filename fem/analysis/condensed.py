"""FRFs on the few coordinates that are left when runs of equal elements are condensed, line by line.

A member of n equal elements has at each frequency a dynamic stiffness of its two ends. It comes from joining
one element with its like, the two with theirs, and so on: log₂ n eliminations of one point, whatever the
mesh. Nothing is left out, so that the FRFs are those of the full model with any number of modes in the band.
Members whose elements differ keep their points.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from fem.analysis.frf import FRFKind
from fem.analysis.frf_solver import MARGIN, reduced_frf
from fem.analysis.selection import Selection, dof_columns
from fem.array_types import Bools, Floats, Ints
from fem.linalg.multifrontal import plan_elimination
from fem.linalg.solvers import SingularMatrixError, factorise
from fem.model import Contribution, Model
from fem.system import System, law_change, sum_contributions

_EQUAL = 1e-9
"""Difference of entries of two elements, relative to their diagonals, that is rounding [-]."""
_DENSE = 100
"""Up to so many coordinates lines are solved together, as dense matrices."""
_CHUNK = 2_000_000
"""Complex numbers that one array over lines holds at most."""
_SECONDS_PER_OPERATION = 1.5e-10
"""Of a complex multiplication with addition, three to the elimination of p coordinates by p³ of them."""
_SECONDS_PER_FRONT = 5e-5
_SECONDS_PER_JOIN = 5e-6
_SECONDS_PER_MODE = 2e-6
"""Of each mode and each coordinate of the system [s]: 1.7 to 2.3 in lattices of 300 to 3000 coordinates."""
_TURNED = np.r_[6:12, 0:6]

Array = NDArray[Any]


@dataclass(frozen=True, slots=True, eq=False)
class Condensed:
    """A system of which runs of equal elements are known by one element each.

    Attributes
    ----------
    system : System
    kept : ndarray of int (n_kept,)
        Independent coordinates that remain.
    Q : sparse (n_dof, n_kept)
        From these to all DOFs; zero at the DOFs that are condensed.
    rest : tuple of sparse (n_kept, n_kept)
        K, M, C and D of all elements that are in no run.
    kind : ndarray of int (n_runs,)
        Number of each run among those that differ in their elements or in how many they have.
    count : ndarray of int (n_kinds,)
        Elements of a run of each kind.
    elements : ndarray (4, n_kinds, 12, 12)
        K, M, C and D of one element of each kind.
    dofs : ndarray of int (n_runs, 12)
        DOFs of the two ends of each run.
    bending : ndarray (n_chains, 2)
        Phases of bending waves along each chain of elements in its two planes, over √ω [√s].
    """

    system: System
    kept: Ints
    Q: Any
    rest: tuple[Any, ...]
    kind: Ints
    count: Ints
    elements: Array
    dofs: Ints
    bending: Floats

    def receptance(self, frequency: Floats, outputs: Array, inputs: Array) -> Array:
        """Return receptances (n_freq, n_out, n_in) at some frequencies [Hz].

        A modal damping ratio ζ counts as a loss factor 2ζ of all stiffness at each line: the same at
        resonances, for it has no matrix. Lines at which the matrix is singular are infinite.

        Parameters
        ----------
        frequency : ndarray (n_freq,)
        outputs, inputs : sparse (n_dof, n)
            Columns, zero at the DOFs that are condensed.
        """
        b, c = (np.asarray((self.Q.T @ X).toarray()) for X in (inputs, outputs))
        H = np.empty((len(frequency), c.shape[1], b.shape[1]), dtype=complex)
        if len(self.kept) <= _DENSE:
            solve, entries = self._dense, len(self.kept) ** 2
        else:
            pattern = _Pattern.of(self)
            solve, entries = partial(self._sparse, pattern), len(pattern.row)
        step = max(1, _CHUNK // max(144 * len(self.count), entries, 1))
        for start in range(0, len(frequency), step):
            lines = slice(start, start + step)
            H[lines] = solve(self._factors(frequency[lines]), b, c)
        return H

    @property
    def seconds_per_line(self) -> float:
        """Return about how long a line takes on one core [s]; only its ratio to other such times counts."""
        joints = 4 * _SECONDS_PER_JOIN * float(np.log2(np.maximum(self.count, 2)).sum())
        n = len(self.kept)
        if n <= _DENSE:
            return joints + _SECONDS_PER_FRONT + _SECONDS_PER_OPERATION * n**3
        (Z,) = _Pattern.of(self).matrices(*self._factors(np.ones(1)), self.elements[:1])
        plan = plan_elimination(Z)
        pivots = np.array([front.last - front.first for front in plan.fronts], dtype=float)
        edge = np.array([len(front.boundary) for front in plan.fronts], dtype=float)
        operations = pivots**3 + 3 * pivots**2 * edge + 3 * pivots * edge**2
        return joints + _SECONDS_PER_FRONT * len(pivots) + _SECONDS_PER_OPERATION * float(operations.sum())

    def least_modes(self, frequency: float) -> int:
        """Return about the least number of modes that may lie below a frequency [Hz].

        It is that of the bending modes of chains between clamped ends, at kL = (n + ½)π: to fix points raises
        natural frequencies. A chain with a corner may have one fewer.
        """
        waves = self.bending * np.sqrt(2 * np.pi * frequency) / np.pi
        return int(np.floor(np.maximum(waves - 0.5, 0.0)).sum())

    def _factors(self, frequency: Floats) -> tuple[Array, Array]:
        """Return ω, and the factors of K, M, C and D in Z, (n_freq,) and (n_freq, 4)."""
        damping, omega = self.system.model.damping, 2 * np.pi * frequency
        loss = damping.loss_factor + omega * damping.beta + 2 * damping.ratio_at(frequency)
        factors = [1 + 1j * loss, 1j * omega * damping.alpha - omega**2, 1j * omega, np.full(len(omega), 1j)]
        return omega, np.stack(factors, axis=1)

    def _runs(self, factors: Array) -> Array:
        """Return the dynamic stiffness of the ends of a run of each kind, (n_freq, n_kinds, 12, 12)."""
        Z = np.einsum("fk,krij->frij", factors, self.elements)
        for n in np.unique(self.count):
            of = self.count == n
            Z[:, of] = _repeated(Z[:, of], int(n))
        return Z

    def _dense(self, lines: tuple[Array, Array], b: Array, c: Array) -> Array:
        omega, factors = lines
        Q, n = self.Q.toarray(), len(self.kept)
        Z = np.einsum("fk,kij->fij", factors, np.stack([X.toarray() for X in self.rest]))
        for law, K in self.system.laws:
            Z += law_change(law, omega)[:, None, None] * K[self.kept][:, self.kept].toarray()
        runs = self._runs(factors)
        for kind, dofs in zip(self.kind, self.dofs, strict=True):
            at = np.flatnonzero(Q[dofs].any(axis=0))
            ends = Q[np.ix_(dofs, at)]
            Z[:, at[:, None], at] += ends.T @ runs[:, kind] @ ends
        try:
            return c.T @ np.linalg.solve(Z, np.broadcast_to(b, (len(omega), n, b.shape[1])))
        except np.linalg.LinAlgError:  # at one of the lines
            return np.stack([self._one(sp.csc_array(each), b, c) for each in Z])

    def _sparse(self, pattern: "_Pattern", lines: tuple[Array, Array], b: Array, c: Array) -> Array:
        matrices = pattern.matrices(*lines, self._runs(lines[1]))
        return np.stack([self._one(Z, b, c) for Z in matrices])

    def _one(self, Z: Any, b: Array, c: Array) -> Array:
        backend = None if self.system.reciprocal else "superlu"  # the one that does not rely on symmetry
        try:
            return c.T @ factorise(Z, backend=backend).solve(b.astype(complex))
        except SingularMatrixError:
            return np.full((c.shape[1], b.shape[1]), np.inf)


@dataclass(frozen=True, slots=True, eq=False)
class _Pattern:
    """Entries of Z on the kept coordinates, column by column, as sums of those of its parts.

    Attributes
    ----------
    n : int
        Number of coordinates.
    row, column : ndarray of int (n_entries,)
    rest : sparse (n_entries, 4)
        Entries of K, M, C and D of all elements that are in no run.
    laws : tuple of (Law, sparse (n_entries, 1))
        Entries of the stiffness that each law multiplies.
    runs : sparse (n_entries, 144 n_kinds)
        From the entries of runs of each kind.
    """

    n: int
    row: Ints
    column: Ints
    rest: Any
    laws: tuple[Any, ...]
    runs: Any

    @classmethod
    def of(cls, condensed: Condensed) -> "_Pattern":
        """Return the entries of a condensed system."""
        n, kept = len(condensed.kept), condensed.kept
        laws = [(law, K[kept][:, kept]) for law, K in condensed.system.laws]
        row, column, source, weight = _run_entries(condensed)
        given = [sp.coo_array(X) for X in (*condensed.rest, *(K for _, K in laws))]
        keys = [np.int64(n) * X.col + X.row for X in given]
        entries = np.unique(np.concatenate([n * column + row, *keys]))

        def placed(key: Array, source: Array, values: Array, width: int) -> Any:
            at = np.searchsorted(entries, key), source
            return sp.csr_array(sp.coo_array((values, at), shape=(len(entries), width)))

        values = [X.data for X in given]
        part = [np.full(len(key), k) for k, key in enumerate(keys)]
        rest = placed(*(np.concatenate(each[:4]) for each in (keys, part, values)), width=4)
        by_law = tuple(
            (law, placed(key, np.zeros(len(key), dtype=np.int64), X, width=1))
            for (law, _), key, X in zip(laws, keys[4:], values[4:], strict=True)
        )
        runs = placed(n * column + row, source, weight, width=144 * len(condensed.count))
        return cls(n, entries % n, entries // n, rest, by_law, runs)

    def matrices(self, omega: Array, factors: Array, runs: Array) -> Iterator[Any]:
        """Yield Z at each line, sparse (n, n), all with one pattern."""
        values = self.rest @ factors.T + self.runs @ runs.reshape(len(omega), -1).T
        for law, K in self.laws:
            values = values + K @ law_change(law, omega)[None]
        there = values.any(axis=1)  # frames along the axes of coordinates have many zeros
        start = np.searchsorted(self.column[there], np.arange(self.n + 1))
        row = self.row[there]
        for each in values[there].T:
            yield sp.csc_array((each, row, start), shape=(self.n, self.n))


def _run_entries(condensed: Condensed) -> tuple[Array, Array, Array, Array]:
    """Return row, column, number among the entries of all kinds, and weight of each entry of the runs."""
    dofs = condensed.dofs
    ends = sp.coo_array(condensed.Q.tocsr()[dofs.ravel()].tocsr())
    order = np.argsort(ends.row, kind="stable")
    place, to, q = ends.row[order], ends.col[order].astype(np.int64), ends.data[order]
    run, local = np.divmod(place.astype(np.int64), 12)
    size = np.bincount(run, minlength=len(dofs))
    # each entry of Q meets all those of its run
    first = np.repeat(np.arange(len(run)), size[run])
    begins = np.cumsum(size[run]) - size[run]
    second = (np.cumsum(size) - size)[run[first]] + np.arange(len(first)) - begins[first]
    source = 144 * condensed.kind[run[first]] + 12 * local[first] + local[second]
    return to[first], to[second], source, q[first] * q[second]


def condense(system: System, *places: Array) -> Condensed:
    """Find the runs of equal elements in a system that nothing but their ends ties to the rest.

    Parameters
    ----------
    system : System
    places : sparse (n_dof, n)
        Forces and responses, whose points are kept.
    """
    model = system.model
    lines, matrices, others = _on_lines(model)
    free = _free_points(system, others, places)
    chains = list(_chains(model.mesh.lines[lines], free))
    runs = [run for chain in chains for run in _equal_parts(chain, matrices)]
    phases = _bending(*matrices[:2])
    bending = np.array([phases[chain.elements].sum(axis=0) for chain in chains]).reshape(-1, 2)
    in_runs = np.concatenate([np.zeros(0, dtype=np.int64), *(run.elements for run in runs)])
    alone = np.setdiff1d(np.arange(len(lines)), in_runs)
    dofs = _dofs_of(model.mesh.lines[lines])
    rest = (*others, Contribution(dofs[alone], *(X[alone] for X in matrices)))
    inner = np.concatenate([np.zeros(0, dtype=np.int64), *(run.points[1:-1] for run in runs)])
    remaining = np.ones(model.n_dof, dtype=bool)
    remaining[(6 * inner[:, None] + np.arange(6)).ravel()] = False
    Q = sp.csc_array(sp.diags_array(remaining.astype(float)) @ system.Q)
    kept = np.flatnonzero(np.diff(system.Q[remaining].tocsc().indptr))
    Q = sp.csr_array(Q[:, kept])
    without = tuple(replace(c, law=None, K=c.static) for c in rest)
    summed = tuple(sp.csr_array(Q.T @ X @ Q) for X in sum_contributions(without, model.n_dof))
    elements = np.zeros((4, len(runs), 12, 12), dtype=matrices.dtype)
    for k, run in enumerate(runs):
        elements[:, k] = _as_passed(matrices[:, run.elements[0]], bool(run.turned[0]))
    ends = np.array([[run.points[0], run.points[-1]] for run in runs], dtype=np.int64).reshape(-1, 2)
    count = np.array([len(run.elements) for run in runs], dtype=np.int64)
    first, kind = _kinds(elements, count)
    return Condensed(system, kept, Q, summed, kind, count[first], elements[:, first], _dofs_of(ends), bending)


def frf_function(
    system: System,
    frequency: Floats,
    outputs: Selection,
    inputs: Selection,
    kind: FRFKind = FRFKind.ACCELERANCE,
    tolerance: float = 1e-3,
) -> Callable[[Floats], Array]:
    """Return a function of frequencies [Hz] that computes FRFs (n_freq, n_out, n_in).

    By the modes, or line by line with runs of equal elements condensed: whichever should take less time for
    the lines given. Line by line, a modal ratio counts as a loss factor, and FRFs of an undamped model may
    be infinite.

    Parameters
    ----------
    system : System
    frequency : ndarray (n_freq,)
        Lines for which the choice is made [Hz].
    outputs, inputs : selection
        As for :func:`fem.analysis.frf_solver.compute_frf`.
    kind : FRFKind
    tolerance : float
        Error to be met by modes, relative to the peak of each FRF [-].
    """
    (out, _), (inn, _) = (dof_columns(system.model, each) for each in (outputs, inputs))
    condensed, highest = condense(system, out, inn), float(frequency.max())

    def by_lines(f: Floats) -> Array:
        H = condensed.receptance(f, out, inn)
        return H * ((2j * np.pi * f) ** kind.derivatives)[:, None, None]

    if not system.reciprocal:
        return by_lines
    by_modes_seconds = _SECONDS_PER_MODE * system.n_free * condensed.least_modes(MARGIN * highest)
    if len(frequency) * condensed.seconds_per_line <= by_modes_seconds:
        return by_lines
    by_modes = reduced_frf(system, frequency, outputs, inputs, kind, tolerance=tolerance)
    return lambda f: by_modes(f) if f.max() <= highest else by_lines(f)


def _bending(K: Array, M: Array) -> Array:
    """Return kh/√ω of elements (n, 12, 12) in their two planes, kh the phase of a bending wave, (n, 2) [√s].

    An end of an Euler-Bernoulli element that moves across it has the stiffness 12 EI/h³ and the mass
    156/420 ρAh, and (kh)⁴ = ω² ρAh⁴/EI. Bars and cables, which do not bend, have 0.
    """
    values = np.linalg.eigvalsh(K[:, :3, :3])
    stiffness = values[:, :2]
    mass = np.trace(M[:, :3, :3], axis1=1, axis2=2)[:, None] / 3
    moves = (stiffness > _EQUAL * values[:, 2:]) & np.any(K[:, 3:6, 3:6] != 0, axis=(1, 2))[:, None]
    ratio = np.divide(
        12 * 420 / 156 * np.maximum(mass, 0.0), stiffness, out=np.zeros(moves.shape), where=moves
    )
    return ratio**0.25


@dataclass(frozen=True, slots=True, eq=False)
class _Chain:
    """Elements that follow one another: their rows, which are passed backwards, and the points between."""

    elements: Ints
    turned: Bools
    points: Ints


def _dofs_of(ends: Ints) -> Ints:
    return (6 * ends[:, :, None] + np.arange(6)).reshape(-1, 12)


def _on_lines(model: Model) -> tuple[Ints, Array, tuple[Contribution, ...]]:
    """Return lines with elements on them, K, M, C and D of each (4, n, 12, 12), and all other elements."""
    parts = model.contributions()
    on_lines = [
        c for c in parts if c.lines is not None and c.law is None and len(np.unique(c.lines)) == len(c.lines)
    ]
    others = tuple(c for c in parts if not any(c is each for each in on_lines))
    lines = np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *(c.lines for c in on_lines)]))  # type: ignore[list-item]
    matrices = np.zeros((4, len(lines), 12, 12))
    for c in on_lines:
        at = np.searchsorted(lines, c.lines)  # type: ignore[arg-type]
        for total, X in zip(matrices, (c.K, c.M, c.C, c.D), strict=True):
            if X is not None:
                total[at] += X
    return lines, matrices, others


def _free_points(system: System, others: tuple[Contribution, ...], places: tuple[Array, ...]) -> Bools:
    """Return at which points of the mesh nothing but elements on lines acts."""
    n = system.model.mesh.n_points
    Q = system.Q.tocsr()
    alone = np.diff(system.Q.tocsc().indptr) == 1
    free = np.zeros(Q.shape[0], dtype=bool)
    single = np.flatnonzero(np.diff(Q.indptr) == 1)
    free[single] = alone[Q.indices[Q.indptr[single]]]
    free[np.diff(Q.indptr) == 0] = True  # rotations of cables, or fixed
    for c in system.model.constraints():
        if not c.everywhere:
            free[c.dofs] = False
    for part in others:
        free[part.dofs.ravel()] = False
    for X in places:
        free[sp.csc_array(X).indices] = False
    return np.asarray(free[: 6 * n].reshape(-1, 6).all(axis=1))


def _chains(ends: Ints, free: Bools) -> Iterator[_Chain]:
    """Yield all lines as chains that continue at free points where just two of them meet."""
    at: dict[int, list[int]] = {}
    for k, (a, b) in enumerate(ends.tolist()):
        at.setdefault(a, []).append(k)
        at.setdefault(b, []).append(k)
    through = {p for p, lines in at.items() if free[p] and len(lines) == 2}
    remaining = dict.fromkeys(range(len(ends)))
    first = [k for p, lines in at.items() if p not in through for k in lines]
    for start in (*first, *remaining):  # lines that remain in the end are rings, which may begin anywhere
        if start not in remaining:
            continue
        a, b = ends[start].tolist()
        point, k = (b if a in through and b not in through else a), start
        elements, turned, points = [], [], [point]
        while k in remaining:
            del remaining[k]
            backwards = ends[k, 0] != point
            point = int(ends[k, 0] if backwards else ends[k, 1])
            elements.append(k)
            turned.append(backwards)
            points.append(point)
            if point not in through:
                break
            one, two = at[point]
            k = two if one == k else one
        yield _Chain(np.array(elements), np.array(turned), np.array(points))


def _equal_parts(chain: _Chain, matrices: Array) -> Iterator[_Chain]:
    """Yield the parts of a chain that have two or more equal elements."""
    X = np.stack(
        [_as_passed(matrices[:, k], bool(t)) for k, t in zip(chain.elements, chain.turned, strict=True)]
    )
    # Bending may be many times softer than tension: each entry is compared with those on its diagonals.
    size = np.sqrt(np.abs(np.diagonal(X, axis1=2, axis2=3)).max(axis=0))
    allowed = _EQUAL * size[:, :, None] * size[:, None, :]
    differs = np.any(np.abs(np.diff(X, axis=0)) > allowed, axis=(1, 2, 3))
    edges = np.r_[0, np.flatnonzero(differs) + 1, len(X)]
    for a, b in pairwise(edges.tolist()):
        if b - a > 1:
            yield _Chain(chain.elements[a:b], chain.turned[a:b], chain.points[a : b + 1])


def _kinds(elements: Array, count: Array) -> tuple[Ints, Ints]:
    """Return the first run of each kind, and the kind of each: parallel members alike have one.

    Entries count as equal that round to the same digits. Two that differ by rounding alone and fall to two
    sides of a limit make two kinds of one, which costs time and nothing else.
    """
    n = len(count)
    X = elements.transpose(1, 0, 2, 3)
    size = np.sqrt(np.abs(np.diagonal(X, axis1=2, axis2=3)))
    scale = size[..., :, None] * size[..., None, :]
    relative = np.divide(X, scale, out=np.zeros(X.shape), where=scale > 0)
    logarithm = np.log(size, out=np.zeros(size.shape), where=size > 0)
    rounded = [np.rint(each / _EQUAL).astype(np.int64).reshape(n, -1) for each in (relative, logarithm) if n]
    exact = np.where(scale > 0, 0.0, X).view(np.int64).reshape(n, 576)  # a gyroscopic C has no diagonal
    keys = np.concatenate([count[:, None], exact, *rounded], axis=1)
    _, first, kind = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    return first, kind.reshape(-1)


def _as_passed(X: Array, turned: bool) -> Array:
    """Return element matrices (4, 12, 12) with the end first at which the chain enters."""
    return X[:, _TURNED[:, None], _TURNED] if turned else X


def _repeated(Z: Array, n: int) -> Array:
    """Return the dynamic stiffness (…, 12, 12) of n equal elements in a row."""
    out, power = None, Z
    while n:
        if n & 1:
            out = power if out is None else _joined(out, power)
        n >>= 1
        power = _joined(power, power) if n else power
    return Z if out is None else out


def _joined(A: Array, B: Array) -> Array:
    """Return the dynamic stiffness of two in a row without the point between them."""
    middle = A[..., 6:, 6:] + B[..., :6, :6]
    to_middle = np.concatenate([A[..., 6:, :6], B[..., :6, 6:]], axis=-1)
    idle = np.all(middle == 0, axis=-1)[..., None]  # rotations of cables
    X = np.linalg.solve(middle + idle * np.eye(6), to_middle)
    out = np.zeros(np.broadcast_shapes(A.shape, B.shape), dtype=complex)
    out[..., :6, :6], out[..., 6:, 6:] = A[..., :6, :6], B[..., 6:, 6:]
    out[..., :6, :] -= A[..., :6, 6:] @ X
    out[..., 6:, :] -= B[..., 6:, :6] @ X
    return out
