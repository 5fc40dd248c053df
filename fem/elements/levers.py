"""Geometric stiffness of rigid arms that hold forces at their ends."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.array_types import Floats


def lever_stiffness(arm: Floats, force: NDArray[Any]) -> NDArray[Any]:
    """Return the resistance of forces at the ends of rigid arms to rotations of the points that hold them.

    An arm d takes its end by θ × (θ × d)/2 back, to the second order; a force F of fixed direction that the
    point exerts there does the work θᵀKθ/2 with K = (F dᵀ + d Fᵀ)/2 - (F·d) I. A mass above its point makes
    it negative.

    Parameters
    ----------
    arm : ndarray (n, 3)
        From the points to the ends [m].
    force : ndarray (n, 3)
        Forces of the points on the ends [N].

    Returns
    -------
    ndarray (n, 3, 3)
        On the rotations of the points, global [N·m/rad].
    """
    outer = force[:, :, None] * arm[:, None, :]
    trace = np.einsum("bii->b", outer)
    return (outer + np.swapaxes(outer, 1, 2)) / 2 - trace[:, None, None] * np.eye(3)
