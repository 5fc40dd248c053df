"""Factorisation of sparse symmetric matrices by dense blocks: the multifrontal method on a nested dissection.

A separator of few coordinates cuts the graph of the matrix into two halves, these are cut again, and so on
(George, *SIAM J. Numer. Anal.* 10, 1973, 345-363). The leaves of this tree are eliminated first, each as a
dense *front* of its coordinates and of those in separators that they touch; the elimination's Schur
complement on the separators is handed to the parent (Duff and Reid, *ACM Trans. Math. Softw.* 9, 1983,
302-325). All arithmetic is in dense kernels of BLAS and LAPACK.

Separators are found by level sets: the distances in the graph from a few points far from each other serve as
coordinates, and of the cuts at the median of each the smallest is taken. Places in space, where they are
known, are further coordinates: a plane cuts a solid block at half as many nodes as a surface of equal
distance does. All parts of one depth are cut together, so that the work is in a few operations on long
arrays.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.linalg import blas, lapack
from scipy.sparse.csgraph import shortest_path

from fem.array_types import Bools, Floats, Ints

LEAF = 96
"""Parts of at most this many coordinates are not cut further."""


COLUMN_MAJOR = 256
"""Front size from which right-hand sides are copied column by column for BLAS: twice as fast there."""


@dataclass(frozen=True, slots=True, eq=False)
class Front:
    """A dense step of the elimination.

    Attributes
    ----------
    first, last : int
        It eliminates the p coordinates first … last - 1, in this order.
    boundary : ndarray (b,)
        Coordinates eliminated later that its elimination couples, rising.
    children : tuple of (int, list of (int, int, int))
        Fronts that hand their remainder to this one, each with its boundary in runs: where a run begins and
        ends there, and where it begins in this front. No run is both of eliminated and of boundary
        coordinates.
    diagonal, edge : ndarray
        Places of the matrix's entries in the diagonal block (p, p) and in the boundary rows (b, p), flat.
    split : ndarray of bool
        Which of the matrix entries belong to the first.
    """

    first: int
    last: int
    boundary: Ints
    children: tuple[tuple[int, list[tuple[int, int, int]]], ...]
    diagonal: Ints
    edge: Ints
    split: Bools


@dataclass(frozen=True, slots=True, eq=False)
class EliminationPlan:
    """The order of elimination of a pattern of entries.

    Attributes
    ----------
    permutation : ndarray (n,)
        The coordinates in the order of elimination.
    fronts : tuple of Front
        Children before parents.
    entry, start : ndarray
        Which entries of the matrix are in the permuted lower triangle, column by column, and where its
        columns start among these.
    indptr, indices : ndarray
        The pattern, as in a `csc_array`.
    """

    permutation: Ints
    fronts: tuple[Front, ...]
    entry: Ints
    start: Ints
    indptr: NDArray[np.int32]
    indices: NDArray[np.int32]

    def fits(self, A: Any) -> bool:
        """Return whether a `csc_array` has this pattern."""
        return np.array_equal(self.indptr, A.indptr) and np.array_equal(self.indices, A.indices)


def _graph(A: Any, group: Ints) -> sp.csr_array:
    """Return the graph of groups of coordinates that the entries of A couple, without loops."""
    coo = sp.coo_array(A)
    i, j = group[coo.row], group[coo.col]
    off = i != j
    m = int(group.max()) + 1
    graph = sp.csr_array((np.ones(off.sum(), dtype=np.int8), (i[off], j[off])), shape=(m, m))
    graph.data[:] = 1
    return graph


def _landmarks(graph: Any) -> Ints:
    """Return distances in the graph from four nodes that are far from each other, shape (4, nodes)."""
    distances: list[Ints] = []
    at, nearest = 0, None
    for k in range(5):
        d = np.asarray(shortest_path(graph, method="D", unweighted=True, indices=at))
        reached = np.isfinite(d)
        d = np.where(reached, d, d[reached].max() + 2).astype(np.int64)
        if k:  # the first node is any
            distances.append(d)
        nearest = d if nearest is None or k == 1 else np.minimum(nearest, d)
        at = int(nearest.argmax())
    return np.array(distances)


def _sorted_by(domain: Ints, x: Ints) -> Ints:
    """Return the order of nodes by domain, by x within a domain, and by number where these are equal."""
    n, levels = len(x), int(x.max()) + 1
    if int(domain.max() + 1) * levels * n < 2**63:
        # to sort one array of integers is several times faster than to sort the numbers of three
        return np.sort((domain * levels + x) * n + np.arange(n)) % n
    return np.lexsort((x, domain))


def _upper_half(domain: Ints, n_domains: int, weight: Floats, x: Ints) -> Bools:
    """Return which nodes lie in the upper half of their domain along x.

    Nodes with the same x stay together where each side still gets a fifth of the weight.
    """
    order = _sorted_by(domain, x)
    w, d, x = weight[order], domain[order], x[order]
    total = np.bincount(d, w, n_domains)
    middle = np.cumsum(w) - w / 2 - (np.cumsum(total) - total)[d]
    upper = middle >= total[d] / 2  # the last of two or more always, the first never
    head = np.flatnonzero(upper & ~np.concatenate([[False], upper[:-1] & (d[1:] == d[:-1])]))
    level = np.zeros(n_domains, dtype=x.dtype)
    level[d[head]] = x[head]  # of the first node of the upper half
    best = np.full(n_domains, 0.2)
    for above in (x > level[d], x >= level[d]):
        share = np.bincount(d, w * above, n_domains) / np.maximum(total, 1e-300)
        fair = np.minimum(share, 1 - share)
        better = fair > best
        best = np.where(better, fair, best)
        upper = np.where(better[d], above, upper)
    out = np.empty(len(x), dtype=bool)
    out[order] = upper
    return out


def _dissect(graph: Any, weight: Floats, places: Ints, leaf: float) -> tuple[list[Ints], list[int]]:
    """Cut a graph in halves, these in halves, and so on, until no part weighs more than a leaf.

    Parameters
    ----------
    graph : sparse (n, n)
    weight : ndarray (n,)
        Number of coordinates in each node.
    places : ndarray (k, n)
        Distances along which to cut.
    leaf : float

    Returns
    -------
    parts : list of ndarray
        Nodes of the separators and of the leaves, each separator before its two parts.
    parent : list of int
        The separator above each; -1 for the first.
    """
    n = graph.shape[0]
    coo = graph.tocoo()
    a, b = coo.row.astype(np.int64), coo.col.astype(np.int64)
    keep = a < b
    a, b = a[keep], b[keep]
    part = np.zeros(n, dtype=np.int64)  # of each node, its final or present part
    parent = [-1]
    alive = np.arange(n)
    while alive.size:
        total = np.bincount(part[alive], weight[alive], len(parent))
        number = np.bincount(part[alive], minlength=len(parent))
        alive = alive[(total > leaf)[part[alive]] & (number > 1)[part[alive]]]
        if not alive.size:
            break
        cut = np.unique(part[alive])
        local = np.full(len(parent), -1)
        local[cut] = np.arange(len(cut))
        domain = local[part[alive]]
        inside = (part[a] == part[b]) & (local[part[a]] >= 0)
        a, b = a[inside], b[inside]
        where = np.full(n, -1)
        where[alive] = np.arange(len(alive))
        ia, ib = where[a], where[b]
        best = np.full(len(cut), np.inf)
        state = np.zeros(len(alive), dtype=np.int8)  # 0 lower, 1 upper, 2 separator
        for x in places:
            upper = _upper_half(domain, len(cut), weight[alive], x[alive])
            crossing = upper[ia] != upper[ib]
            ends = np.zeros(len(alive), dtype=bool)
            ends[ia[crossing]] = ends[ib[crossing]] = True
            for side in (upper, ~upper):
                separator = ends & side
                size = np.bincount(domain[separator], weight[alive][separator], len(cut))
                better = size < best
                best = np.where(better, size, best)
                state = np.where(better[domain], np.where(separator, 2, upper).astype(np.int8), state)
        # number the halves that are not empty
        for half in (0, 1):
            has = np.bincount(domain[state == half], minlength=len(cut)) > 0
            number = np.where(has, len(parent) + np.cumsum(has) - 1, -1)
            parent.extend(cut[has].tolist())
            at = state == half
            part[alive[at]] = number[domain[at]]
        alive = alive[state != 2]
    order = np.argsort(part, kind="stable")
    return np.split(order, np.searchsorted(part[order], np.arange(1, len(parent)))), parent


def _postorder(parent: list[int]) -> list[int]:
    """Return the parts, children before parents, each subtree in one piece."""
    children: list[list[int]] = [[] for _ in parent]
    for k, p in enumerate(parent):
        if p >= 0:
            children[p].append(k)
    out, stack = [], [0]
    while stack:
        k = stack.pop()
        out.append(k)
        stack.extend(children[k])
    return out[::-1]


def plan_elimination(A: Any, leaf: int = LEAF, places: Floats | None = None) -> EliminationPlan:
    """Order the elimination of a matrix with a symmetric pattern of entries.

    Parameters
    ----------
    A : csc_array (n, n)
        With sorted indices, each once.
    leaf : int
        Parts of at most this many coordinates are not cut further.
    places : ndarray (n, d), optional
        Where in space each coordinate acts. Matrices of solid elements then fill in much less: a cube of
        10⁵ nodes has a third of the entries and an eighth of the operations.
    """
    group = _alike(A)
    graph = _graph(A, group)
    weight = np.bincount(group)
    along = _landmarks(graph)
    if places is not None:
        along = np.vstack([_steps(places[np.unique(group, return_index=True)[1]]), along])
    parts, parent = _dissect(graph, weight.astype(float), along, leaf)
    order = _postorder(parent)
    # nodes, and from them coordinates, in the order of elimination
    nodes = np.concatenate([parts[k] for k in order])
    rank = np.empty(len(nodes), dtype=np.int64)
    rank[nodes] = np.arange(len(nodes))
    permutation = np.argsort(rank[group], kind="stable")
    first_of = np.concatenate([[0], np.cumsum(weight[nodes])])
    lower, entry = _lower(A, permutation)
    graph = graph[nodes][:, nodes]
    fronts: list[Front] = []
    edges: list[Ints] = []  # boundary of each front in nodes
    waiting: dict[int, list[int]] = {k: [] for k in order}
    node = 0
    for k in order:
        begin, node = node, node + len(parts[k])
        touched = [graph.indices[graph.indptr[begin] : graph.indptr[node]].astype(np.int64)]
        touched += [edges[c] for c in waiting[k]]
        boundary = np.unique(np.concatenate(touched))
        boundary = boundary[boundary >= node]
        edges.append(boundary)
        if boundary.size:
            waiting[parent[k]].append(len(fronts))
        rows = _spread(first_of, boundary)
        children = [(c, fronts[c].boundary) for c in waiting.pop(k)]
        fronts.append(_front(int(first_of[begin]), int(first_of[node]), rows, children, lower))
    return EliminationPlan(permutation, tuple(fronts), entry, lower.indptr, A.indptr, A.indices)


def _steps(places: Floats) -> Ints:
    """Return places (n, d) as steps along each axis, (d, n)."""
    extent = float(np.ptp(places, axis=0).max(initial=0.0))
    from_corner = places - places.min(axis=0)
    # Steps into which the largest extent of places is divided; nodes of one step count as lying in a plane
    return np.round(4096 * from_corner / max(extent, 1e-300)).astype(np.int64).T


def _alike(A: Any) -> Ints:
    """Return a group for each coordinate; those of one group are coupled with the same coordinates."""
    mark = np.random.default_rng(0).integers(0, 2**62, A.shape[0], dtype=np.uint64)
    total = np.concatenate([np.zeros(1, np.uint64), np.cumsum(mark[A.indices], dtype=np.uint64)])
    key = total[A.indptr[1:]] - total[A.indptr[:-1]]  # modulo 2⁶⁴: equal for equal sets
    _, first, group = np.unique(key, return_index=True, return_inverse=True)
    number = np.argsort(
        np.argsort(first)
    )  # neighbours in number are neighbours in space, more often than not
    return number[group.ravel()]


def _spread(start: Ints, nodes: Ints) -> Ints:
    """Return the coordinates of nodes."""
    size = start[nodes + 1] - start[nodes]
    before = np.cumsum(size) - size
    return np.repeat(start[nodes] - before, size) + np.arange(size.sum())


def _lower(A: Any, permutation: Ints) -> tuple[Any, Ints]:
    """Return the pattern of the permuted lower triangle and which of A's entries are in it."""
    coo = sp.coo_array(A)
    rank = np.empty(len(permutation), dtype=np.int64)
    rank[permutation] = np.arange(len(permutation))
    i, j = rank[coo.row], rank[coo.col]
    keep = np.flatnonzero(i >= j)
    pattern = sp.csc_array(sp.coo_array((keep, (i[keep], j[keep])), shape=A.shape))
    pattern.sort_indices()
    return pattern, pattern.data


def _front(first: int, last: int, rows: Ints, children: list[tuple[int, Ints]], lower: Any) -> Front:
    p, b = last - first, len(rows)
    begin, end = lower.indptr[first], lower.indptr[last]
    i = lower.indices[begin:end]
    j = np.repeat(np.arange(p), np.diff(lower.indptr[first : last + 1]))
    split = i < last
    diagonal = i[split] - first + j[split] * p
    edge = np.searchsorted(rows, i[~split]) + j[~split] * b
    index = np.concatenate([np.arange(first, last), rows])
    at = tuple((c, _runs(np.searchsorted(index, boundary), p)) for c, boundary in children)
    return Front(first, last, rows, at, diagonal, edge, split)


def _runs(at: Ints, p: int) -> list[tuple[int, int, int]]:
    """Return the runs of successive places: begin and end among the places, and the first place.

    A run ends where places reach p.
    """
    new = [0, *(np.flatnonzero((at[1:] - at[:-1] > 1) | (at[1:] == p)) + 1).tolist()]
    return list(zip(new, [*new[1:], len(at)], at[new].tolist(), strict=True))


@dataclass(frozen=True, slots=True, eq=False)
class FactorBlocks:
    """A factorised matrix.

    Attributes
    ----------
    plan : EliminationPlan
    diagonal : list of (ndarray (p, p), ndarray or None)
        For each front the Cholesky factor of its diagonal block and None, or its LU factors and pivots.
    edge : list of ndarray (b, p)
        Boundary rows; times L⁻ᵀ where there is a Cholesky factor.
    negative : int or None
        Number of negative eigenvalues; None if the matrix is complex.
    """

    plan: EliminationPlan
    diagonal: list[tuple[NDArray[Any], NDArray[Any] | None]]
    edge: list[NDArray[Any]]
    negative: int | None

    def solve(self, b: NDArray[Any]) -> NDArray[Any]:
        """Solve for one or many right-hand sides, shape (n,) or (n, k)."""
        dtype = self.diagonal[-1][0].dtype
        if np.iscomplexobj(b) and dtype.kind != "c":
            return self.solve(np.real(b)) + 1j * self.solve(np.imag(b))
        trsm, _, _, getrs, gemm = _kernels(dtype)
        X = np.ascontiguousarray(np.reshape(b, (len(b), -1))[self.plan.permutation], dtype=dtype)
        steps = list(zip(self.plan.fronts, self.diagonal, self.edge, strict=True))
        for front, (F, pivots), E in steps:
            x = X[front.first : front.last]
            if not x.size:
                continue
            if len(x) >= COLUMN_MAJOR:
                y = np.asfortranarray(x)
                x[:] = y = getrs(F, pivots, y)[0] if pivots is not None else trsm(1.0, F, y, lower=1)
                if E.size:
                    X[front.boundary] -= gemm(1.0, E, y)
                continue
            if pivots is None:
                trsm(1.0, F, x.T, side=1, lower=1, trans_a=1, overwrite_b=1)  # in place: x.T is a view
            else:
                x[:] = getrs(F, pivots, x)[0]
            if E.size:
                X[front.boundary] -= E @ x
        for front, (F, pivots), E in reversed(steps):
            x = X[front.first : front.last]
            if not x.size:
                continue
            if len(x) >= COLUMN_MAJOR:
                y = np.asfortranarray(x)
                if E.size:
                    below = gemm(1.0, E, np.asfortranarray(X[front.boundary]), trans_a=1)
                    y = y - (below if pivots is None else getrs(F, pivots, below)[0])
                x[:] = trsm(1.0, F, y, lower=1, trans_a=1) if pivots is None else y
                continue
            if E.size:
                y = E.T @ X[front.boundary]
                x -= y if pivots is None else getrs(F, pivots, y)[0]
            if pivots is None:
                trsm(1.0, F, x.T, side=1, lower=1, trans_a=0, overwrite_b=1)
        out = np.empty_like(X)
        out[self.plan.permutation] = X
        return out.reshape(np.shape(b))


def _kernels(dtype: np.dtype[Any]) -> tuple[Any, Any, Any, Any, Any]:
    """Return trsm, syrk, getrf, getrs and gemm."""
    if dtype.kind == "c":
        return blas.ztrsm, blas.zsyrk, lapack.zgetrf, lapack.zgetrs, blas.zgemm
    return blas.dtrsm, blas.dsyrk, lapack.dgetrf, lapack.dgetrs, blas.dgemm


def factorise_blocks(A: Any, plan: EliminationPlan) -> FactorBlocks:
    """Factorise a symmetric matrix, real or complex, with the pattern of a plan.

    A front's diagonal block gets a Cholesky factor if it is real and positive definite, and LU with partial
    pivoting otherwise. Negative eigenvalues add up over the fronts (Haynsworth, *Linear Algebra Appl.* 1,
    1968, 73-81).

    Parameters
    ----------
    A : csc_array (n, n)
    plan : EliminationPlan

    Raises
    ------
    ZeroDivisionError
        If a block is singular.
    """
    data = A.data[plan.entry]
    real = data.dtype.kind != "c"
    dtype = np.dtype(np.float64 if real else np.complex128)
    trsm, syrk, getrf, getrs, _ = _kernels(dtype)
    diagonal: list[tuple[NDArray[Any], NDArray[Any] | None]] = []
    edge: list[NDArray[Any]] = []
    rest: dict[int, NDArray[Any]] = {}
    negative = 0
    for k, front in enumerate(plan.fronts):
        F, E, S = _assembled(front, data[plan.start[front.first] : plan.start[front.last]], dtype)
        p = len(F)
        for child, runs in front.children:
            _add_remainder(rest.pop(child), runs, F, E, S)
        L, failed = lapack.dpotrf(F, lower=1, clean=0) if real and p else (F, p > 0)
        pivots = None
        if not failed:
            E = trsm(1.0, L, E, side=1, lower=1, trans_a=1, overwrite_b=1) if E.size else E
            S = syrk(-1.0, E, beta=1.0, c=S, lower=1, overwrite_c=1) if E.size else S
        else:
            F = np.tril(F) + np.tril(F, -1).T  # above the diagonal was nothing of worth
            negative += _count_negative(F) if real else 0
            L, pivots, failed = getrf(F)
            if failed:
                raise ZeroDivisionError
            S = S - E @ getrs(L, pivots, E.T)[0] if E.size else S
        diagonal.append((L, pivots))
        edge.append(E)
        if S.size:
            rest[k] = S
    return FactorBlocks(plan, diagonal, edge, negative if real else None)


def _add_remainder(
    R: NDArray[Any],
    runs: list[tuple[int, int, int]],
    F: NDArray[Any],
    E: NDArray[Any],
    S: NDArray[Any],
) -> None:
    """Add the lower triangle of a child's remainder to the block, boundary rows and remainder of its parent.

    Blocks between two runs of places are slices, which take a fraction of the time of indices.
    """
    p = len(F)
    for k, (i, j, row) in enumerate(runs):
        for a, b, column in runs[: k + 1]:
            if column >= p:
                out = S[row - p : row - p + j - i, column - p : column - p + b - a]
            elif row >= p:
                out = E[row - p : row - p + j - i, column : column + b - a]
            else:
                out = F[row : row + j - i, column : column + b - a]
            out += R[i:j, a:b]


def _assembled(
    front: Front, values: NDArray[Any], dtype: np.dtype[Any]
) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Return the diagonal block and the boundary rows with the matrix's entries, and an empty remainder."""
    p, b = front.last - front.first, len(front.boundary)
    F, E = (np.zeros((m, p), dtype, order="F") for m in (p, b))
    F.ravel(order="K")[front.diagonal] = values[front.split]
    E.ravel(order="K")[front.edge] = values[~front.split]
    return F, E, np.zeros((b, b), dtype, order="F")


def _count_negative(F: NDArray[Any]) -> int:
    """Count negative eigenvalues of a dense symmetric matrix from Bunch and Kaufman's LDLᵀ."""
    D, pivots, _ = lapack.dsytrf(F, lower=1)
    single = pivots > 0
    # a block of two on the diagonal has one eigenvalue of each sign
    return int((D.diagonal()[single] < 0).sum() + (~single).sum() // 2)
