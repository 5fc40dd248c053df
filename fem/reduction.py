"""Reduced bases: modes, and the static and dynamic responses to the forces that will act."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fem.model import Constraint
from fem.modes import Eigenpairs, solve_eigenpairs
from fem.system import System, particular, sum_contributions


@dataclass(frozen=True, slots=True, eq=False)
class Basis:
    """A reduced basis on all DOFs.

    Attributes
    ----------
    T : ndarray (n_dof, r + p)
        The first r columns meet all constraints and are M-orthonormal; each of the last p violates one releasable
        constraint by one unit.
    n_main : int
        r.
    keys : tuple of (str, str)
        Keys of the p releasable constraints, in order.
    n_modes : int
        How many of the first columns are modes.
    n_rigid : int
        How many of these are rigid-body modes.
    """

    T: NDArray[np.float64]
    n_main: int
    keys: tuple[tuple[str, str], ...]
    n_modes: int
    n_rigid: int


def reduced_basis(
    system: System,
    forces: NDArray[np.float64],
    max_frequency: float,
    *,
    margin: float = 2.0,
    n_krylov: int = 2,
    release: tuple[Constraint, ...] = (),
) -> Basis:
    """Build a basis for responses up to a frequency.

    Modes up to ``margin · max_frequency`` and, for each force, the first vectors of the Krylov sequence
    (K - σM)⁻¹ b, (K - σM)⁻¹ M (K - σM)⁻¹ b, …, which carry what the modes left out leave behind. A releasable
    constraint gets the static response to a unit violation (Craig & Bampton's constraint modes).

    Parameters
    ----------
    system : System
    forces : ndarray (n_dof, k)
        Directions in which forces act.
    max_frequency : float
        Highest frequency of interest [Hz].
    margin : float
        Modes are taken up to this multiple of it.
    n_krylov : int
        Vectors of the sequence for each force.
    release : tuple of Constraint
        Constraints of the model that effects may release later.
    """
    pairs = solve_eigenpairs(system, max_frequency=margin * max_frequency)
    columns = [pairs.vectors]
    load = system.Q.T @ forces
    for _ in range(n_krylov if forces.shape[1] else 0):
        response = pairs.factor.solve(np.asarray(load))
        columns.append(response / np.maximum(np.linalg.norm(response, axis=0), 1e-300))
        load = system.M @ columns[-1]
    main = system.Q @ _orthonormal(system, columns)
    released = _constraint_modes(system, pairs, release)
    T = np.hstack([main, released])
    return Basis(T, main.shape[1], tuple(c.key for c in release), pairs.vectors.shape[1], pairs.n_rigid)


def _orthonormal(system: System, columns: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Return M-orthonormal columns that span the given ones; modes come first and stay as they are."""
    V = columns[0]
    for block in columns[1:]:
        for _ in range(2):
            block = block - V @ (V.T @ (system.M @ block))
        gram = block.T @ (system.M @ block)
        scale = 1 / np.sqrt(np.maximum(np.diag(gram), 1e-300))
        eigenvalues, vectors = np.linalg.eigh(gram * np.outer(scale, scale))
        keep = eigenvalues > 1e-10 * eigenvalues[-1]
        block = block @ (scale[:, None] * vectors[:, keep] / np.sqrt(eigenvalues[keep]))
        block = block - V @ (V.T @ (system.M @ block))
        L = np.linalg.cholesky(block.T @ (system.M @ block))
        V = np.hstack([V, np.linalg.solve(L, block.T).T])
    return V


def _constraint_modes(system: System, pairs: Eigenpairs, release: tuple[Constraint, ...]) -> NDArray[np.float64]:
    if not release:
        return np.zeros((system.model.n_dof, 0))
    K, M, _, _ = sum_contributions(system.model.contributions(), system.model.n_dof)
    shifted = K - pairs.shift * M
    held = system.model.constraints()
    out = []
    for constraint in release:
        others = tuple(c for c in held if c.key != constraint.key)
        u = particular(others, constraint, system.model.n_dof)
        q = pairs.factor.solve(-np.asarray(system.Q.T @ (shifted @ u)))
        out.append(u + system.Q @ q)
    return np.column_stack(out)
