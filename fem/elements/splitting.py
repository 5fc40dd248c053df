"""Models with finer meshes: elements that are divided between the rigid zones at members' ends."""

import numpy as np
from numpy.typing import ArrayLike

from fem.elements.frame import Frame
from fem.elements.layout import axis_vectors, layout_of
from fem.model import Model


def split(model: Model, pieces: ArrayLike) -> Model:
    """Return a model in which the flexible part of line i is divided into ``pieces[i]`` equal parts.

    A rigid zone stays in the first or last of them, so that it fits however fine the mesh becomes. Existing
    points keep their indices.

    Parameters
    ----------
    model : Model
    pieces : int or ndarray of int (n_lines,)

    Raises
    ------
    MeshError
        If the mesh would have too many lines, or a line fewer than 1 piece.
    """
    frame = next(iter(model.of_kind(Frame)), None)
    if frame is None:
        return model.with_mesh(model.mesh.split(pieces))
    layout = layout_of(frame.members, model.mesh)
    if not layout.zone.any():
        return model.with_mesh(model.mesh.split(pieces))
    span = np.linalg.norm(axis_vectors(layout, model.mesh, np.arange(model.mesh.n_lines)), axis=1)
    return model.with_mesh(model.mesh.split(pieces, layout.zone / span[:, None]))
