"""Factorisations behind one small interface."""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.linalg import splu
from threadpoolctl import ThreadpoolController

from fem.array_types import Floats
from fem.linalg.multifrontal import EliminationPlan, factorise_blocks, plan_elimination

SUPERLU_BELOW_EQUATIONS = 1000
"""Matrices of fewer equations are left to SuperLU."""

BACKENDS = ("superlu", "multifrontal", "pardiso")

SLEPC = "slepc"
"""Value of ``DOVETAIL_SOLVER`` by which :mod:`fem.linalg.processes` computes modes, but no factors."""


class SolverError(ValueError):
    """A solver that is not there."""


class SingularMatrixError(ValueError):
    """A matrix without an inverse."""


@dataclass(frozen=True, slots=True)
class Factor:
    """A factorised square matrix.

    Attributes
    ----------
    solve : callable
        Solves for one or many right-hand sides, shape (n,) or (n, k). A block of eight or more costs several
        times less for each than one at a time: the factor is read from memory once for all.
    count_negative : callable
        Returns the number of negative eigenvalues of a real symmetric matrix (Sylvester's law of inertia);
        raises a `ValueError` if the matrix is complex, or if the factorisation did not keep to the diagonal.
    backend : str
        Which of `BACKENDS` made it.
    plan : EliminationPlan or None
        The order of elimination, for other matrices with the same pattern of entries.
    matrix : sparse (n, n), optional
        The matrix: another process factorises it again, as factors are not sent.
    """

    solve: Callable[[NDArray[Any]], NDArray[Any]]
    count_negative: Callable[[], int]
    backend: str
    plan: EliminationPlan | None = None
    matrix: Any = None

    def __reduce__(self) -> tuple[Any, ...]:
        return factorise, (self.matrix, None, self.backend)


@cache
def _pools() -> ThreadpoolController:
    return ThreadpoolController()


@contextmanager
def one_thread() -> Iterator[None]:
    """Keep BLAS to one thread within a with-block, or within a function that this decorates.

    The blocks of frames are so small that threads wait for each other rather than work: on two cores a
    diagnosis took two to five times the processor time, and with other work beside it up to ten times as
    long. The caller gets its number back.
    """
    with _pools().limit(limits=1, user_api="blas"):
        yield


def factorise(
    A: Any, like: Factor | None = None, backend: str | None = None, places: Floats | None = None
) -> Factor:
    """Factorise a sparse symmetric matrix, real or complex.

    Below `SUPERLU_BELOW_EQUATIONS` equations, SuperLU with minimum degree on A + Aᵀ and no pivoting off the
    diagonal; else the multifrontal method of :mod:`fem.linalg.multifrontal`, which pivots within dense
    blocks. PARDISO, of the extra ``dovetail[accelerate]``, is used on request; complex matrices go to the
    multifrontal method all the same, because its wrapper takes real ones only.

    Parameters
    ----------
    A : sparse (n, n)
        Symmetric.
    like : Factor, optional
        Of a matrix with the same pattern of entries, whose order of elimination is used again.
    backend : str, optional
        One of `BACKENDS`, whatever the size; otherwise the one that the environment variable
        ``DOVETAIL_SOLVER`` names, if it is set.
    places : ndarray (n, d), optional
        Where in space each equation acts: the multifrontal method then finds a better order of elimination
        for solid elements.

    Raises
    ------
    SingularMatrixError
        If the matrix is singular.
    SolverError
        If there is no such backend.
    ImportError
        If PARDISO is asked for and not installed.
    """
    if not A.shape[0]:
        msg = "there are no equations: every point of the mesh is held; divide the members"
        raise SingularMatrixError(msg)
    chosen = backend or os.environ.get("DOVETAIL_SOLVER") or None
    if chosen in (None, SLEPC):
        chosen = "superlu" if A.shape[0] < SUPERLU_BELOW_EQUATIONS else "multifrontal"
    if chosen == "superlu":
        return _superlu(A)
    if chosen == "multifrontal" or (chosen == "pardiso" and np.iscomplexobj(A.data)):
        return _multifrontal(A, like, places)
    if chosen == "pardiso":
        return _pardiso(A)
    msg = f"there is no solver {chosen!r}; there are {', '.join(BACKENDS)}, and for modes {SLEPC}"
    raise SolverError(msg)


def _singular(A: Any) -> SingularMatrixError:
    return SingularMatrixError(f"the matrix of {A.shape[0]} equations is singular")


def _superlu(A: Any) -> Factor:
    try:
        lu = splu(
            sp.csc_matrix(A),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
    except RuntimeError as error:
        raise _singular(A) from error

    def count_negative() -> int:
        pivots = lu.U.diagonal()
        if np.iscomplexobj(pivots):
            raise _no_signs()
        if not np.array_equal(lu.perm_r, lu.perm_c):
            msg = "SuperLU left the diagonal for a pivot; the signs of its pivots do not count eigenvalues"
            raise ValueError(msg)
        return int((pivots < 0).sum())

    return Factor(lu.solve, count_negative, "superlu", matrix=A)


def _multifrontal(A: Any, like: Factor | None, places: Floats | None) -> Factor:
    A = sp.csc_array(A)
    if not A.has_canonical_format:
        A = A.copy()
        A.sum_duplicates()
    plan = like.plan if like is not None else None
    if plan is None or not plan.fits(A):
        plan = plan_elimination(A, places=places)
    try:
        blocks = factorise_blocks(A, plan)
    except ZeroDivisionError as error:
        raise _singular(A) from error

    def count_negative() -> int:
        if blocks.negative is None:
            raise _no_signs()
        return blocks.negative

    return Factor(blocks.solve, count_negative, "multifrontal", plan, A)


@cache
def _find_mkl(solver: Any) -> None:
    """Keep MKL's path where PyPardiso looks first.

    It otherwise searches all folders of the environment for each solver, which takes 0.3 s.
    """
    os.environ.setdefault("PYPARDISO_MKL_RT", solver().libmkl._name)


def _pardiso(A: Any) -> Factor:
    try:
        from pypardiso import PyPardisoSolver  # pyright: ignore[reportMissingImports]
        from pypardiso.pardiso_wrapper import PyPardisoError  # pyright: ignore[reportMissingImports]
    except ImportError as error:
        msg = "PARDISO is not installed; install it with: python -m pip install pypardiso (x86 machines only)"
        raise ImportError(msg) from error
    _find_mkl(PyPardisoSolver)
    upper = sp.csr_matrix(sp.triu(A, format="csr"))
    upper.sort_indices()
    solver = PyPardisoSolver(mtype=-2)  # real, symmetric, indefinite: pivots of 1 and 2 rows
    try:
        solver.factorize(upper)
    except (PyPardisoError, ValueError) as error:
        raise _singular(A) from error

    def solve(b: NDArray[Any]) -> NDArray[Any]:
        if np.iscomplexobj(b):
            return solve(np.real(b)) + 1j * solve(np.imag(b))
        return solver.solve(upper, np.asfortranarray(b, dtype=float)).reshape(b.shape)

    return Factor(solve, lambda: int(solver.get_iparm(23)), "pardiso", matrix=A)


def _no_signs() -> ValueError:
    return ValueError("eigenvalues of a complex matrix have no signs to count; count those of a real one")
