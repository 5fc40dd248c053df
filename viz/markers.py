"""Shapes and colours of the markers that effects name."""

import numpy as np

from fem.array_types import Floats
from fem.model import DIRECTIONS, Effect, Model
from viz import style

SHAPES = {
    "circle": "o",
    "cross": "X",
    "diamond": "D",
    "dot": ".",
    "hexagon": "h",
    "hexagon_flat": "H",
    "octagon": "8",
    "plus": "P",
    "square": "s",
    "star": "*",
    "thin_diamond": "d",
    "triangle": "^",
    "triangle_down": "v",
}
"""Matplotlib's letters of the shapes that effects name."""

COLOURS = {
    "green": style.GREEN,
    "joint": style.JOINT,
    "orange": style.ORANGE,
    "purple": style.PURPLE,
    "sky": style.SKY,
    "support": style.SUPPORT,
    "vermilion": style.VERMILION,
}
"""The colours that effects name."""

OTHER_MARKERS = ("p", "*", "<", ">", "d", "8")
"""Shapes of kinds that name none, in turn."""


def support_axes(effect: Effect, model: Model) -> Floats | None:
    """Return the axes (3, 3) of a rigid support as rows in global components; None of any other effect.

    A rigid support holds one point to the ground and adds nothing to K, M, C or D. Axes along which it does
    not hold the point are turned as little as the others allow.
    """
    held = [c for c in effect.constraints(model) if c.key[1] in DIRECTIONS and not c.everywhere]
    added = (
        (X for c in effect.contribute(model) for X in (c.K, c.M, c.C, c.D) if X is not None) if held else ()
    )
    if len({int(dof) // 6 for c in held for dof in c.dofs}) != 1 or any(np.any(X) for X in added):
        return None
    R = np.full((3, 3), np.nan)
    for c in held:
        i = DIRECTIONS.index(c.key[1])
        along = c.dofs % 6 // 3 == i // 3
        R[i % 3] = 0.0
        R[i % 3, c.dofs[along] % 3] = c.coefficients[along]
    known = R[~np.isnan(R[:, 0])]
    free = np.flatnonzero(np.isnan(R[:, 0]))
    across = np.eye(3)[free] - np.eye(3)[free] @ known.T @ known
    U, _, V = np.linalg.svd(across, full_matrices=False)
    R[free] = U @ V
    return R
