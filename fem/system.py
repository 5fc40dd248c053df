"""Assembly: from a model to K, M, C and D on the independent coordinates."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from fem.model import Constraint, Contribution, Model, ModelError


@dataclass(frozen=True, slots=True, eq=False)
class System:
    """Matrices of a model: Z(ω) = K + iD + iωC - ω²M on coordinates q with u = Q q.

    Attributes
    ----------
    K, M, C, D : sparse (n_free, n_free)
        Stiffness [N/m …], mass [kg …], viscous damping, structural damping of local effects.
    Q : sparse (n_dof, n_free)
        From the independent coordinates to all DOFs; orthonormal columns.
    model : Model
        Where they come from; its ``damping`` is that of the whole structure and not in C and D.
    """

    K: sp.csc_array
    M: sp.csc_array
    C: sp.csc_array
    D: sp.csc_array
    Q: sp.csr_array
    model: Model

    @property
    def n_free(self) -> int:
        """Number of independent coordinates."""
        return self.K.shape[0]


def assemble(model: Model) -> System:
    """Assemble a model's matrices and apply its constraints.

    Constraints Σ c u = 0 are applied exactly: for each set of constraints that share DOFs an orthonormal basis of their null space
    becomes columns of Q.

    Raises
    ------
    ModelError
        If a matrix is not finite, or constraints leave no motion at all.
    """
    full = sum_contributions(model.contributions(), model.n_dof)
    for name, X in zip("KMCD", full, strict=True):
        if not np.isfinite(X.data).all():
            msg = f"the matrix {name} of the model has entries that are not finite numbers"
            raise ModelError(msg)
    Q = null_space(model.constraints(), model.n_dof)
    if Q.shape[1] == 0:
        msg = "the supports and rigid joints leave no motion at all; the model has nothing to compute"
        raise ModelError(msg)
    K, M, C, D = (sp.csc_array(Q.T @ X @ Q) for X in full)
    return System(K, M, C, D, Q, model)


def sum_contributions(contributions: tuple[Contribution, ...], n_dof: int) -> list[Any]:
    """Return sparse K, M, C and D (n_dof, n_dof) from batches of element matrices."""
    out = []
    for key in "KMCD":
        rows, cols, data = [], [], []
        for part in contributions:
            X = getattr(part, key)
            if X is None:
                continue
            m = part.dofs.shape[1]
            rows.append(np.repeat(part.dofs, m, axis=1).ravel())
            cols.append(np.tile(part.dofs, (1, m)).ravel())
            data.append(X.ravel())
        if not data:
            out.append(sp.csr_array((n_dof, n_dof)))
            continue
        index = (np.concatenate(rows), np.concatenate(cols))
        out.append(sp.coo_array((np.concatenate(data), index), shape=(n_dof, n_dof)).tocsr())
    return out


def null_space(constraints: tuple[Constraint, ...], n_dof: int) -> sp.csr_array:
    """Return an orthonormal basis Q (n_dof, n_free) of the motions that meet all constraints."""
    taken = np.zeros(n_dof, dtype=bool)
    rows, cols, data = [], [], []
    for group in _groups(constraints):
        dofs = np.unique(np.concatenate([c.dofs for c in group]))
        taken[dofs] = True
        if len(dofs) == 1:
            continue
        N = _null(_rows(group, dofs))
        for j in range(N.shape[1]):
            rows.append(dofs)
            cols.append(np.full(len(dofs), len(cols)))
            data.append(N[:, j])
    free = np.flatnonzero(~taken)
    n_groups = len(cols)
    rows.append(free)
    cols.append(n_groups + np.arange(len(free)))
    data.append(np.ones(len(free)))
    Q = sp.coo_array(
        (np.concatenate(data), (np.concatenate(rows), np.concatenate(cols))), shape=(n_dof, n_groups + len(free))
    ).tocsr()
    return Q[:, np.argsort(_leading(Q))]


def particular(constraints: tuple[Constraint, ...], released: Constraint, n_dof: int) -> NDArray[np.float64]:
    """Return a motion, shape (n_dof,), that violates one constraint by one unit and meets all others."""
    u = np.zeros(n_dof)
    for group in _groups((*constraints, released)):
        if released not in group:
            continue
        dofs = np.unique(np.concatenate([c.dofs for c in group]))
        rhs = np.array([float(c is released) for c in group])
        B = _rows(group, dofs)
        u[dofs] = np.linalg.lstsq(B, rhs, rcond=None)[0]
    return u


def _groups(constraints: tuple[Constraint, ...]) -> list[tuple[Constraint, ...]]:
    """Return the constraints in sets that share no DOF."""
    if not constraints:
        return []
    n = len(constraints)
    rows = np.concatenate([np.full(len(c.dofs), i) for i, c in enumerate(constraints)])
    dofs, column = np.unique(np.concatenate([c.dofs for c in constraints]), return_inverse=True)
    graph = sp.coo_array((np.ones(len(rows)), (rows, n + column)), shape=(n + len(dofs),) * 2)
    label = connected_components(graph, directed=False)[1][:n]
    return [tuple(constraints[i] for i in np.flatnonzero(label == k)) for k in np.unique(label)]


def _rows(group: tuple[Constraint, ...], dofs: NDArray[np.int64]) -> NDArray[np.float64]:
    B = np.zeros((len(group), len(dofs)))
    for i, c in enumerate(group):
        np.add.at(B[i], np.searchsorted(dofs, c.dofs), c.coefficients)
    return B


def _null(B: NDArray[np.float64]) -> NDArray[np.float64]:
    _, s, Vt = np.linalg.svd(B / np.linalg.norm(B, axis=1, keepdims=True))
    rank = int((s > 1e-10).sum())
    return Vt[rank:].T


def _leading(Q: Any) -> NDArray[np.int64]:
    """Return the first DOF that each column moves: keeps the bandwidth small."""
    first = np.full(Q.shape[1], Q.shape[0])
    coo = Q.tocoo()
    np.minimum.at(first, coo.col, coo.row)
    return first
