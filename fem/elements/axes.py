"""Local axes of members: x along the axis, z towards the orientation, y completing them."""

import numpy as np
from numpy.typing import ArrayLike

from fem.array_types import Bools, Floats
from fem.model import ModelError


def local_axes(t: Floats, orientation: ArrayLike | None, member: str) -> Floats:
    """Return local axes as rows for line directions ``t`` (b, 3), shape (b, 3, 3).

    Raises
    ------
    ModelError
        If the orientation is parallel to the member.
    """
    up = np.full(3, np.nan) if orientation is None else np.asarray(orientation, dtype=float)
    if is_parallel(t, up).any():
        raise ModelError(parallel_message(member, up))
    return axes_of(t, np.broadcast_to(up, t.shape))


def is_parallel(t: Floats, up: Floats) -> Bools:
    """Return which directions t (…, 3) are parallel to orientations (…, 3); nan, the default, is not."""
    sizes = np.linalg.norm(t, axis=-1) * np.linalg.norm(up, axis=-1)
    return np.linalg.norm(np.cross(t, up), axis=-1) < 1e-6 * sizes


def parallel_message(member: str, orientation: Floats) -> str:
    """Return the message on an orientation along a member."""
    return f"member '{member}': its orientation {orientation.tolist()} is parallel to its axis"


def axes_of(t: Floats, up: Floats) -> Floats:
    """Return local axes as rows, (b, 3, 3), for directions t and orientations (b, 3), nan for the default."""
    x = t / np.linalg.norm(t, axis=1, keepdims=True)
    # within 1° of vertical, global Z gives no plane: X does
    usual = np.where(np.abs(x[:, 2:]) > np.cos(np.deg2rad(1.0)), [[1.0, 0.0, 0.0]], [[0.0, 0.0, 1.0]])
    up = np.where(np.isnan(up), usual, up)
    z = up - np.einsum("bi,bi->b", up, x)[:, None] * x
    z = z / np.linalg.norm(z, axis=1, keepdims=True)
    return np.stack([x, np.cross(z, x), z], axis=1)


def turned(R: Floats, angle: Floats) -> Floats:
    """Return local axes (b, 3, 3) turned about x by angles (b,) [rad], to the sections' principal axes."""
    if not angle.any():
        return R
    c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
    return np.stack([R[:, 0], c * R[:, 1] + s * R[:, 2], c * R[:, 2] - s * R[:, 1]], axis=1)
