"""Linear problems that data determine badly: generalised Tikhonov regularisation, L-curve, subset selection.

Everything here works on bare arrays: A (m, n) and b (m,) of min ‖A x - b‖².
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg as sla
from numpy.typing import ArrayLike

from fem.array_types import Floats


@dataclass(frozen=True, slots=True, eq=False)
class GeneralisedSVD:
    """A = U diag(c) X⁻¹ and L = V diag(s) X⁻¹ with c² + s² = 1.

    Attributes
    ----------
    U : ndarray (m, n)
    V : ndarray (p, n)
        Orthonormal columns, zero where s = 0.
    c, s : ndarray (n,)
        c falls, and s rises; c/s are the generalised singular values.
    X : ndarray (n, n)
        Its columns are the combinations of unknowns, those that the data determine best beside L first.
    """

    U: Floats
    V: Floats
    c: Floats
    s: Floats
    X: Floats


def gsvd(A: ArrayLike, L: ArrayLike) -> GeneralisedSVD:
    """Compute the generalised singular value decomposition of a pair of matrices.

    [A; L] = Q R, and the singular value decomposition of Q's upper part gives that of the lower one, as
    Q₁ᵀQ₁ + Q₂ᵀQ₂ = 1 (Paige and Saunders, *SIAM J. Numer. Anal.* 18, 1981, 398).

    Parameters
    ----------
    A, L : array_like (m, n), (p, n)

    Raises
    ------
    ValueError
        If the matrices do not fit, or something is neither in the data nor in L.
    """
    A, L = np.array(A, dtype=float, ndmin=2), np.array(L, dtype=float, ndmin=2)
    m, n = A.shape
    if L.shape[1] != n:
        msg = f"A has {n} columns and L {L.shape[1]}; both need one for each unknown"
        raise ValueError(msg)
    both = np.vstack([A, L])
    scale = np.linalg.norm(both, axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    Q, R = np.linalg.qr(both / scale)
    values = np.linalg.svd(R, compute_uv=False)
    if len(both) < n or values[-1] < 1e-13 * values[0]:
        msg = "a combination of unknowns is neither in the data nor in the operator L; give L more rows"
        raise ValueError(msg)
    U, c, Wt = np.linalg.svd(Q[:m], full_matrices=True)
    c = np.concatenate([c, np.zeros(n - len(c))])
    U = np.hstack([U[:, : min(m, n)], np.zeros((m, max(0, n - m)))])
    W = Wt.T
    lower = Q[m:] @ W
    s = np.linalg.norm(lower, axis=0)
    V = np.divide(lower, s, out=np.zeros_like(lower), where=s > 1e-14)
    X = sla.solve_triangular(R, W) / scale[:, None]
    return GeneralisedSVD(U, V, np.clip(c, 0.0, 1.0), s, X)


@dataclass(frozen=True, slots=True, eq=False)
class LCurve:
    """Misfit against the size of the solution over the regularisation parameter.

    Attributes
    ----------
    parameter : ndarray (k,)
        λ, rising.
    misfit : ndarray (k,)
        ‖A x - b‖.
    size : ndarray (k,)
        ‖L x‖.
    curvature : ndarray (k,)
        Of ln size over ln misfit: largest at the corner.
    solutions : ndarray (k, n)
    corner : int
        Index of the λ of the largest curvature.
    distinct : bool
        Whether there is a corner to speak of: a curvature above 1 away from the ends.
    """

    parameter: Floats
    misfit: Floats
    size: Floats
    curvature: Floats
    solutions: Floats
    corner: int
    distinct: bool

    @property
    def chosen(self) -> float:
        """λ at the corner."""
        return float(self.parameter[self.corner])

    @property
    def solution(self) -> Floats:
        """The solution there, (n,)."""
        return self.solutions[self.corner]


def tikhonov(A: ArrayLike, b: ArrayLike, parameter: float, L: ArrayLike | None = None) -> Floats:
    """Solve min ‖A x - b‖² + λ² ‖L x‖²; L is the identity unless given.

    Parameters
    ----------
    A, b : array_like (m, n), (m,)
    parameter : float
        λ.
    L : array_like (p, n), optional
    """
    A = np.array(A, dtype=float, ndmin=2)
    G = gsvd(A, np.eye(A.shape[1]) if L is None else L)
    return _filtered(G, np.asarray(b, dtype=float), np.array([parameter]))[0]


def l_curve(A: ArrayLike, b: ArrayLike, L: ArrayLike | None = None, n: int = 200) -> LCurve:
    """Compute the L-curve of min ‖A x - b‖² + λ² ‖L x‖², and its corner.

    The curvature is that of (ln ‖A x - b‖, ln ‖L x‖), exact from the generalised singular values (Hansen and
    O'Leary, *SIAM J. Sci. Comput.* 14, 1993, 1487).

    Parameters
    ----------
    A, b : array_like (m, n), (m,)
    L : array_like (p, n), optional
        The identity unless given.
    n : int
        Number of λ between the smallest and the largest generalised singular value.
    """
    A, b = np.array(A, dtype=float, ndmin=2), np.asarray(b, dtype=float)
    G = gsvd(A, np.eye(A.shape[1]) if L is None else L)
    gamma = G.c[G.s > 1e-12] / G.s[G.s > 1e-12]
    if not gamma.size or gamma.max() == 0:
        msg = "the data do not depend on the unknowns that L weighs; there is nothing to regularise"
        raise ValueError(msg)
    low = max(gamma[gamma > 0].min(), 1e-10 * gamma.max())
    parameter = np.geomspace(0.1 * low, 10 * gamma.max(), n)
    x = _filtered(G, b, parameter)
    # with f = γ²/(γ² + λ²): ‖Lx‖² and ‖Ax - b‖² as functions of ln λ, and two derivatives of each
    free = G.s > 1e-12
    beta = (G.U.T @ b)[free]
    rest = float(b @ b - ((G.U.T @ b) ** 2).sum())
    g2 = (G.c[free] / G.s[free]) ** 2
    f = g2 / (g2 + parameter[:, None] ** 2)
    df = -2 * f * (1 - f)
    ddf = -2 * df * (1 - 2 * f)
    with np.errstate(divide="ignore", invalid="ignore"):
        xi = np.where(g2 > 0, beta**2 / g2, 0.0)
    size2 = (f**2 * xi).sum(axis=1)
    dsize = (2 * f * df * xi).sum(axis=1)
    ddsize = (2 * (df**2 + f * ddf) * xi).sum(axis=1)
    miss2 = ((1 - f) ** 2 * beta**2).sum(axis=1) + max(rest, 0.0)
    dmiss = (-2 * (1 - f) * df * beta**2).sum(axis=1)
    ddmiss = (2 * (df**2 - (1 - f) * ddf) * beta**2).sum(axis=1)
    tiny = 1e-300
    p1, q1 = dmiss / (2 * miss2 + tiny), dsize / (2 * size2 + tiny)
    p2 = ddmiss / (2 * miss2 + tiny) - 2 * p1**2
    q2 = ddsize / (2 * size2 + tiny) - 2 * q1**2
    curvature = (p1 * q2 - p2 * q1) / np.maximum(p1**2 + q1**2, tiny) ** 1.5
    usable = (p1**2 + q1**2) > 1e-12  # at both ends the curve does not move
    corner = int(np.argmax(np.where(usable, curvature, -np.inf)))
    distinct = bool(curvature[corner] > 1 and 0 < corner < n - 1)
    return LCurve(parameter, np.sqrt(miss2), np.sqrt(size2), curvature, x, corner, distinct)


def _filtered(G: GeneralisedSVD, b: Floats, parameter: Floats) -> Floats:
    """Return solutions (k, n) for each λ: X diag(c/(c² + λ²s²)) Uᵀ b."""
    gain = G.c / np.maximum(G.c**2 + (parameter[:, None] * G.s) ** 2, 1e-300)
    return (gain * (G.U.T @ b)) @ G.X.T


@dataclass(frozen=True, slots=True)
class LeftOut:
    """A parameter that was left out, and why.

    Attributes
    ----------
    index : int
        Of its column.
    signal : float
        Its change of the data beyond those of the kept ones, in standard deviations, for a change by its
        unit.
    reason : str
    """

    index: int
    signal: float
    reason: str


@dataclass(frozen=True, slots=True)
class Selection:
    """Parameters that the data can tell apart.

    Attributes
    ----------
    kept : tuple of int
        In the order in which they were chosen.
    left_out : tuple of LeftOut
    """

    kept: tuple[int, ...]
    left_out: tuple[LeftOut, ...]


def select_by_pivoting(A: ArrayLike, names: Sequence[str] = (), least: float = 3.0) -> Selection:
    """Choose columns one by one, always the one with the largest part that the chosen ones do not have.

    A QR decomposition with column pivoting (Golub, *Numer. Math.* 7, 1965, 206). Columns are scaled so that
    the unit is a parameter's possible error and 1 is one standard deviation of the data: |R_kk| is then how
    clearly the data see the k-th, whatever the others are.

    Parameters
    ----------
    A : array_like (m, n)
    names : sequence of str
        For the reasons.
    least : float
        Parameters with less than this are left out [standard deviations].
    """
    A = np.array(A, dtype=float, ndmin=2)
    names = tuple(names) or tuple(f"parameter {i}" for i in range(A.shape[1]))
    R, order = sla.qr(A, mode="r", pivoting=True)  # type: ignore[misc]
    diagonal = np.zeros(A.shape[1])
    k = min(A.shape)
    diagonal[:k] = np.abs(np.diag(R)[:k])
    kept = [int(j) for j, d in zip(order, diagonal, strict=True) if d >= least]
    out = []
    for j in order[len(kept) :]:
        out.append(_left_out(A, int(j), kept, names))
    return Selection(tuple(kept), tuple(out))


def select_forward(A: ArrayLike, b: ArrayLike, names: Sequence[str] = (), least: float = 3.0) -> Selection:
    """Choose columns greedily: each time the column that lowers the misfit most.

    Orthogonal least squares with the squared misfit counted in variances: a column comes in while it lowers
    that by more than ``least``² (Lallement and Piranda, *Proc. IMAC VIII*, 1990, 579). Parameters that
    explain nothing of the present misfit are left out, also where the data could see them.

    Parameters
    ----------
    A, b : array_like (m, n), (m,)
        In standard deviations of the data.
    names : sequence of str
    least : float
        [standard deviations]
    """
    A, r = np.array(A, dtype=float, ndmin=2), np.array(b, dtype=float)
    names = tuple(names) or tuple(f"parameter {i}" for i in range(A.shape[1]))
    kept: list[int] = []
    rest = A.copy()
    size = np.linalg.norm(A, axis=0)
    while len(kept) < min(A.shape):
        norm = np.linalg.norm(rest, axis=0)
        usable = norm > 1e-8 * np.maximum(size, 1e-300)
        usable[kept] = False
        gain = np.divide(rest.T @ r, norm, out=np.zeros(len(norm)), where=usable) ** 2
        j = int(np.argmax(gain))
        if gain[j] <= least**2:
            break
        q = rest[:, j] / norm[j]
        r = r - q * (q @ r)
        rest = rest - np.outer(q, q @ rest)
        kept.append(j)
    out = []
    for j in (j for j in range(A.shape[1]) if j not in kept):
        one = _left_out(A, j, kept, names)
        if one.signal >= least:
            reason = f"{names[j]} explains nothing of the misfit that the chosen ones leave"
            one = LeftOut(j, one.signal, reason)
        out.append(one)
    return Selection(tuple(kept), tuple(out))


def _left_out(A: Floats, j: int, kept: list[int], names: Sequence[str]) -> LeftOut:
    """Return why a column was left out: no visible effect, or the same effect as others."""
    column = A[:, j]
    size = float(np.linalg.norm(column))
    x = np.linalg.lstsq(A[:, kept], column, rcond=None)[0] if kept else np.zeros(0)
    signal = float(np.linalg.norm(column - A[:, kept] @ x)) if kept else size
    if size < 1.0 or not kept:
        return LeftOut(j, signal, f"{names[j]} changes the data by {size:.2g} standard deviations only")
    share = np.abs(x) * np.linalg.norm(A[:, kept], axis=0)
    like = [str(names[kept[k]]) for k in np.argsort(-share) if share[k] > 0.3 * share.max()][:3]
    reason = (
        f"{names[j]} does the same as {' with '.join(like)}, but for {signal:.2g} of its {size:.2g} standard "
        "deviations"
    )
    return LeftOut(j, signal, reason)
