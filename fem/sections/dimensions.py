"""Checks of a shape's dimensions, and the names under which a section keeps them."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from fem.lengths import shown_length
from fem.materials import PropertyError

SOLID = ("rectangle", "circle", "ellipse")
"""Shapes without walls: their shear coefficients are not estimates."""

LABELS = {
    "i_section": "I",
    "unequal_i_section": "I",
    "t_section": "T",
    "angle_section": "angle",
}
"""Labels of shapes that differ from their names."""


def shape_fields(shape: str, **dimensions: float) -> dict[str, Any]:
    """Return a section's label, shape and dimensions, which `Section.between` forms it from again."""
    label = shape_label(shape, dimensions, lambda size: (size, "m"))
    return {"label": label, "shape": shape, "dimensions": dimensions, "estimated_k": shape not in SOLID}


def shape_label(
    shape: str, dimensions: Mapping[str, float], shown: Callable[[float], tuple[float, str]] = shown_length
) -> str:
    """Return the name of a shape with its dimensions [m], by default in the unit that texts have."""
    sizes = [shown(value) for key, value in dimensions.items() if key not in ("r", "nu", "n")]
    label = f"{LABELS.get(shape, shape.replace('_', ' '))} {' x '.join(f'{size:g}' for size, _ in sizes)}"
    label = f"{label} {sizes[0][1]}"
    if "n" in dimensions:
        label = f"{label}, {dimensions['n']} sides"
    if dimensions.get("r"):
        radius, unit = shown(dimensions["r"])
        label = f"{label}, r {radius:g} {unit}"
    return label


def check_positive(shape: str, **sizes: float) -> None:
    """Refuse dimensions that are not positive."""
    for key, value in sizes.items():
        if not (np.isfinite(value) and value > 0):
            msg = f"{shape}: {key} is {value}; it must be positive [m]"
            raise PropertyError(msg)


def check_radius(shape: str, r: float, most: float) -> None:
    """Refuse a corner radius that does not fit."""
    if not 0 <= r <= most:
        msg = f"{shape}: the radius r is {r}; it must lie between 0 and {most:g} m"
        raise PropertyError(msg)


def checked_ratio(shape: str, nu: float) -> float:
    """Return Poisson's ratio if a material can have it."""
    if not -1 < nu <= 0.5:
        msg = f"{shape}: nu is {nu}; Poisson's ratio is above -1 and at most 0.5"
        raise PropertyError(msg)
    return nu
