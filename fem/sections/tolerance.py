"""How well the constants of a section are known by a tolerance of its dimensions."""

import numpy as np

from fem.declarations import SectionTolerance
from fem.materials import PropertyError
from fem.sections.section import SHAPES, Section

STEP = 1e-6
"""Step of the derivatives by a dimension, in parts of it [-]."""
CONSTANTS = ("A", "Iy", "Iz", "J")
"""Constants of a section that its dimensions decide."""


def constants_std(tolerance: SectionTolerance, section: Section) -> dict[str, float]:
    """Return the relative standard deviations of a section's constants that a tolerance states [-].

    Errors of dimensions are independent, and small.

    Raises
    ------
    PropertyError
        If sizes are stated of a section that has no dimensions.
    """
    if tolerance.size is None:
        return dict(tolerance.shares)
    if not section.shape:
        msg = "the section is given by its constants; a tolerance of sizes needs a shape with dimensions"
        raise PropertyError(msg)
    squares = dict.fromkeys(CONSTANTS, 0.0)
    for key in (key for key in SHAPES[section.shape] if key != "n"):
        value = section.dimensions[key]
        changed = Section.of_shape(section.shape, **{**section.dimensions, key: value * (1 + STEP)})
        for name in CONSTANTS:
            slope = np.log(getattr(changed, name) / getattr(section, name)) / (value * STEP)
            squares[name] += float(slope * tolerance.size) ** 2
    return {name: float(np.sqrt(square)) for name, square in squares.items()} | dict(tolerance.shares)
