"""Selections of DOFs: where an analysis applies forces and reads responses."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import scipy.sparse as sp

from fem.array_types import Floats
from fem.model import DIRECTIONS, Model, ModelError

Selection = Sequence[int | tuple[int, str]] | Floats
"""DOF numbers, (point, direction) pairs, or combinations of DOFs as rows of an array (n, n_dof)."""


def dof_vectors(model: Model, selection: Selection) -> tuple[Floats, tuple[str, ...]]:
    """Return a selection as columns (n_dof, n), and labels such as ``"3Z+"``.

    Raises
    ------
    ModelError
        For a point or a direction that the model does not have.
    """
    columns, labels = dof_columns(model, selection)
    return columns.toarray(), labels


def dof_columns(model: Model, selection: Selection) -> tuple[Any, tuple[str, ...]]:
    """Return the vectors of :func:`dof_vectors` as sparse columns (n_dof, n)."""
    if isinstance(selection, np.ndarray) and selection.ndim == 2:
        if selection.shape[1] != model.n_dof:
            msg = f"the selection has {selection.shape[1]} columns; the model has {model.n_dof} DOFs"
            raise ModelError(msg)
        rows = sp.csc_array(selection.T.astype(float))
        return rows, tuple(f"row{i + 1}" for i in range(len(selection)))
    dofs, labels = [], []
    for item in selection:
        if isinstance(item, tuple):
            point, direction = item
            if direction not in DIRECTIONS:
                msg = f"'{direction}' is not a direction; allowed are {', '.join(DIRECTIONS)}"
                raise ModelError(msg)
            dof = 6 * int(point) + DIRECTIONS.index(direction)
        else:
            dof = int(item)
        if not 0 <= dof < model.n_dof:
            msg = (
                f"DOF {dof} (point {dof // 6}) is not in the mesh, which has "
                f"{model.mesh.n_points} points, counted from 0"
            )
            raise ModelError(msg)
        dofs.append(dof)
        labels.append(f"{dof // 6}{('X', 'Y', 'Z', 'RX', 'RY', 'RZ')[dof % 6]}+")
    n = len(dofs)
    columns = sp.coo_array((np.ones(n), (np.array(dofs, dtype=int), np.arange(n))), shape=(model.n_dof, n))
    return columns.tocsc(), tuple(labels)
