"""How much of the forces of a static response is rounding.

A frame that is free to expand holds no force under heat: the difference of K u and the fixed-end forces is
rounding. It follows from the size of both, the number of operations, and the influence of nodal forces on
section forces and reactions.
"""

from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import LinearOperator, onenormest

from fem.analysis.line_loads import line_dofs
from fem.analysis.section_forces import LineEquilibrium, line_stiffness
from fem.array_types import Floats, Ints
from fem.linalg.solvers import Factor
from fem.system import System, full_matrices

_OPERATIONS = 36
"""Operations by which an entry of a line's stiffness comes from E, the section and both nodes.

Twelve of its formula, twelve of the local axes, and six of each turn from local to global axes.
"""
_SIGNS = 8
"""Sets of signs: the standard deviation of their mean is half of it where one displacement decides."""


def force_rounding(system: System, factor: Factor | None, equilibrium: LineEquilibrium, u: Floats) -> Floats:
    """Return a bound of the rounding in section forces and reactions, shape (2, n_cases) [N, N·m].

    With m operations for each entry of K u and unit roundoff ε, refined displacements solve a system whose
    right-hand side is wrong by g = m ε (Σ |K_line| |u| + |f_fixed|) at most (Higham, Accuracy and Stability
    of Numerical Algorithms, 2nd ed., chapter 12). A force B f of nodal forces f is then wrong by |B| g. Its
    largest value is the 1-norm of (B diag g)ᵀ; Hager's estimate of it takes a few solutions.

    Parameters
    ----------
    system : System
    factor : Factor or None
        Of the system's stiffness; None where every point is fixed.
    equilibrium : LineEquilibrium
    u : ndarray (n_dof, n_cases)
        [m, rad].
    """
    dofs, on_lines = line_dofs(system.model), line_stiffness(system.model)
    K = sp.csr_array(full_matrices(system.model)["K"])
    lines, nodes = residual_rounding(K, on_lines, dofs, equilibrium, u)
    ends = lines.reshape(-1, 2, 2, 3, u.shape[1])
    ends[:, :, 1] += equilibrium.loads.axes.span[:, None, None, None] * ends[:, :, 0]  # moments at a cut
    fixed = np.setdiff1d(np.arange(len(u)), sp.csr_array(system.Q).nonzero()[0])
    direct = np.stack([ends[:, :, k].max(axis=(0, 1, 2), initial=0.0) for k in (0, 1)])
    for k in (0, 1):
        chosen = fixed[fixed % 6 // 3 == k]
        direct[k] = np.maximum(direct[k], nodes[chosen].max(axis=0, initial=0.0))
    if factor is not None:
        direct += _influence(system, factor, K, on_lines, dofs, nodes)
    return np.sqrt(3) * direct  # in any direction


def residual_rounding(
    K: Any, on_lines: Floats, dofs: Ints, equilibrium: LineEquilibrium, u: Floats
) -> tuple[Floats, Floats]:
    """Return bounds of the rounding in forces on lines and in those out of balance on all DOFs.

    The bound g of :func:`force_rounding`, for the stiffness K of all DOFs and that of lines
    (n_lines, 12, 12).

    Returns
    -------
    lines : ndarray (n_lines, 12, n_cases)
        [N, N·m].
    nodes : ndarray (n_dof, n_cases)
        [N, N·m].
    """
    K = sp.csr_array(K)
    unit = (_OPERATIONS + int(np.diff(K.indptr).max(initial=0))) * np.finfo(float).eps / 2
    lines = unit * (abs(on_lines) @ abs(u)[dofs] + abs(equilibrium.fixed))
    nodes = unit * (abs(K) @ abs(u))
    np.add.at(nodes, dofs, lines)
    return lines, nodes


def energy_rounding(system: System, factor: Factor, nodes: Floats) -> float:
    """Return the size √(eᵀ K e) of displacements e that rounding of nodal forces within ±g makes [√J].

    The root mean square over independent signs, tr(G A⁻¹ K A⁻¹ G)^½ with G = diag(Qᵀ g), from a few of them
    (Hutchinson, Communications in Statistics 18, 1989, 1059-1076). Signs of the worst case would give a size
    larger by up to the square root of the number of coordinates, which rounding does not reach.

    Parameters
    ----------
    system : System
        Its stiffness is K, which measures the displacements.
    factor : Factor
        Of the stiffness A that resists the forces.
    nodes : ndarray (n_dof,)
        g [N, N·m].
    """
    g = (abs(system.Q).T @ nodes)[:, None]
    signs = np.random.default_rng(0).choice([-1.0, 1.0], (len(g), _SIGNS))
    e = factor.solve(g * signs)
    return float(np.sqrt((e * (system.K @ e)).sum() / _SIGNS))


def beyond_rounding(forces: Floats, rounding: Floats) -> Floats:
    """Return section forces (..., 6, n_cases), 0 where they are not above the bound (2, n_cases)."""
    return np.where(abs(forces) > np.repeat(rounding, 3, axis=0), forces, 0.0)


def _influence(system: System, factor: Factor, K: Any, on_lines: Floats, dofs: Ints, nodes: Floats) -> Floats:
    """Return the largest force and moment, (2, n_cases), of nodal forces up to ``nodes`` (n_dof, n_cases).

    One estimate serves all cases: that of the largest nodal forces of the cases relative to their size.
    """
    n = len(nodes)
    kind = np.arange(n) % 6 // 3
    kind[6 * system.model.mesh.n_points :] = 0
    size = np.where(kind[:, None], nodes / system.model.mesh.size, nodes).max(axis=0)
    shape = (nodes / np.where(size > 0, size, 1.0)).max(axis=1)[:, None]
    row = np.repeat(np.arange(dofs.size).reshape(dofs.shape)[:, :, None], 12, axis=2)
    column = np.repeat(dofs[:, None, :], 12, axis=1)
    forces = sp.csr_array((on_lines.ravel(), (row.ravel(), column.ravel())), shape=(dofs.size, n))
    constrained = np.unique(np.concatenate([c.dofs for c in system.model.constraints()] or [np.arange(0)]))
    outputs = sp.vstack([forces, K[constrained]], format="csr")
    kinds = np.concatenate([dofs.ravel() % 6 // 3, kind[constrained]])
    found = []
    for k in (0, 1):
        some = outputs[kinds == k]
        order = max(n, some.shape[0])

        def apply(f: Floats, some: Any = some, order: int = order) -> Floats:
            q = factor.solve(system.Q.T @ (shape * f.reshape(order, -1)[:n]))
            return _padded(some @ (system.Q @ q), order)

        def transposed(y: Floats, some: Any = some, order: int = order) -> Floats:
            q = factor.solve(system.Q.T @ (some.T @ y.reshape(order, -1)[: some.shape[0]]))
            return _padded(shape * (system.Q @ q), order)

        influence = LinearOperator(
            (order, order), matvec=transposed, matmat=transposed, rmatvec=apply, rmatmat=apply, dtype=float
        )
        found.append(onenormest(influence, t=1))  # of one column, without random ones
    return np.multiply.outer(found, size)


def _padded(x: Floats, order: int) -> Floats:
    """Return rows with rows of zeros up to an order: the estimate is of square matrices."""
    return np.pad(x, ((0, order - len(x)), (0, 0)))
