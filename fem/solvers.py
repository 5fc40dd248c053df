"""Factorisations behind one small interface."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.linalg import splu


class SingularMatrixError(ValueError):
    """A matrix without an inverse."""


@dataclass(frozen=True, slots=True)
class Factor:
    """A factorised square matrix.

    Attributes
    ----------
    solve : callable
        Solves for one or many right-hand sides, shape (n,) or (n, k).
    """

    solve: Callable[[NDArray[Any]], NDArray[Any]]


def factorise(A: Any) -> Factor:
    """Factorise a sparse symmetric matrix, real or complex.

    SuperLU with minimum degree on A + Aᵀ and no pivoting off the diagonal: for frames two to three times
    faster than SciPy's defaults.

    Raises
    ------
    SingularMatrixError
        If the matrix is singular.
    """
    try:
        lu = splu(
            sp.csc_matrix(A),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
    except RuntimeError as error:
        msg = f"the matrix of {A.shape[0]} equations is singular"
        raise SingularMatrixError(msg) from error
    return Factor(lu.solve)
