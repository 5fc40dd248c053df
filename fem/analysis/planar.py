"""Planar models: loads and motions of the base that are out of their plane are refused."""

from collections.abc import Sequence

import numpy as np

from fem.analysis.loads import LoadCase, point_forces
from fem.array_types import Floats
from fem.effects.plane import plane_of
from fem.model import DIRECTIONS, Model, ModelError

_ROUNDING = 1e-9


def refuse_out_of_plane(model: Model, cases: Sequence[LoadCase], forces: Floats) -> None:
    """Raise a ModelError for load cases that act out of the plane of a planar model.

    Moments that gravity or an offset makes about axes in the plane are those of the plane's guides.

    Parameters
    ----------
    model : Model
    cases : sequence of LoadCase
    forces : ndarray (n_dof, n_cases)
        Of all loads [N, N·m].
    """
    plane = plane_of(model)
    if plane is None:
        return
    n = 6 * model.mesh.n_points
    at_points = forces[:n].reshape(-1, 6, len(cases))
    for k, case in enumerate(cases):
        size = np.abs(at_points[:, :3, k]).max()
        given = point_forces(model, case)[:n].reshape(-1, 6)
        for d in plane.out:
            column = DIRECTIONS.index(d)
            acting = at_points[:, column, k] if column < 3 else given[:, column]
            point = int(np.argmax(np.abs(acting)))
            if abs(acting[point]) > (_ROUNDING * size if column < 3 else 0.0):
                msg = (
                    f"load case '{case.name}' acts on point {point} in {d}, out of the model's plane "
                    f"{plane.plane}; allowed are {', '.join(plane.inside)}"
                )
                raise ModelError(msg)


def refuse_motion(model: Model, direction: str) -> None:
    """Raise a ModelError for a motion of the base out of the plane of a planar model."""
    plane = plane_of(model)
    if plane is not None and direction in plane.out:
        msg = (
            f"the base moves in {direction}, out of the model's plane {plane.plane}; allowed are "
            f"{', '.join(plane.inside)}"
        )
        raise ModelError(msg)
