"""Directions of Abaqus' and CalculiX' decks: *ORIENTATION, and *TRANSFORM of nodes."""

from dataclasses import dataclass, field

import numpy as np

from fem.array_types import Floats
from fem.io.abaqus_assembly import Instance
from fem.io.abaqus_content import Content, Placed, check, lines_of, numbers_of
from fem.io.abaqus_deck import AbaqusBlock, fault
from fem.io.abaqus_generate import rotation
from fem.io.frame_deck import axes_along, parallel


@dataclass(slots=True)
class AbaqusSystems:
    """Axes by name, and those of nodes; axes are unit vectors in rows.

    Attributes
    ----------
    nodal : dict of int to ndarray (3, 3)
        Rows of nodes whose degrees of freedom are along other axes than the global ones.
    """

    content: Content
    nodal: dict[int, Floats] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for placed, instance in self.content.model_data("TRANSFORM"):
            block = placed.block
            check(block, "NSET", "TYPE")
            label = block.option("NSET", "NSET=")
            rows = self.content.rows("NSET", label, instance.name, f"{block.place}: *{block.name}")
            kind, (a, b) = block.options.get("TYPE", "R").upper()[:1], self._points(block)
            a, b = instance.turn @ a, instance.turn @ b
            if kind == "C":
                a, b = a + instance.shift, b + instance.shift
            for row in rows:
                axes = self._axes(block, kind, a, b, self.content.points[row])
                self.nodal.pop(row, None)
                if not np.allclose(axes, np.eye(3), rtol=0, atol=1e-12):
                    self.nodal[row] = axes

    def _points(self, block: AbaqusBlock) -> tuple[Floats, Floats]:
        rows = lines_of(block)
        if not rows:
            raise fault(block, "has no data line; two points are expected")
        values = numbers_of(block, *rows[0], 4, 9, "the points a and b")
        given = np.array([*values, 0.0, 0.0][:6]).reshape(2, 3)
        return given[0], given[1]

    def _axes(self, block: AbaqusBlock, kind: str, a: Floats, b: Floats, at: Floats) -> Floats:
        if kind == "R":
            return axes_of(block, a, b)
        if kind != "C":
            raise fault(block, f"is of type {kind}; R and C are read")
        z = (b - a) * 1.0
        scale = self.content.units.length
        radial = at - a * scale
        z = z / np.linalg.norm(z) if z.any() else z
        radial = radial - (radial @ z) * z
        if not np.linalg.norm(radial) > 1e-9 * self.content.size:
            raise fault(block, "of type C: a node is on its axis, or a and b are one point")
        radial = radial / np.linalg.norm(radial)
        return np.array([radial, np.cross(z, radial), z])

    def axes(self, row: int) -> Floats:
        """Return the axes of a node's degrees of freedom."""
        return self.nodal.get(row, np.eye(3))

    def orientation(self, placed: Placed, instance: Instance) -> Floats:
        """Return the axes that a block's ORIENTATION names, the global ones without it."""
        block = placed.block
        name = block.options.get("ORIENTATION", "")
        if not name:
            return np.eye(3)
        for other in self.content.placed:
            if other.keyword == "ORIENTATION" and other.block.options.get("NAME") == name:
                same = other.part is placed.part
                return _orientation(other.block) @ (instance.turn.T if same else np.eye(3))
        raise fault(block, f"refers to the orientation {name[:60]}, which the file does not have")


def _orientation(block: AbaqusBlock) -> Floats:
    check(block, "NAME", "SYSTEM", "DEFINITION")
    kind = block.options.get("SYSTEM", "RECTANGULAR").upper()
    definition = block.options.get("DEFINITION", "COORDINATES").upper()
    if kind not in ("R", "RECTANGULAR") or definition != "COORDINATES":
        raise fault(block, f"is {kind} by {definition}; RECTANGULAR by COORDINATES is read")
    rows = lines_of(block)
    if not rows:
        raise fault(block, "has no data line; two points are expected")
    values = np.array([*numbers_of(block, *rows[0], 4, 9, "the points a, b and c"), *[0.0] * 5][:9])
    a, b, c = values.reshape(3, 3)
    axes = axes_of(block, a - c, b - c)
    if len(rows) > 1:
        axis, angle = [*numbers_of(block, *rows[1], 1, 2, "an axis and an angle"), 0.0][:2]
        if angle:
            if axis not in (1, 2, 3):
                raise fault(block, f"turns about the axis {axis:g}; 1, 2 and 3 are allowed", rows[1][0])
            axes = axes @ rotation(axes[int(axis) - 1], np.deg2rad(angle)).T
    return axes


def axes_of(block: AbaqusBlock, a: Floats, b: Floats) -> Floats:
    """Return axes with x along a, and b in the plane of x and y."""
    if parallel(a, b):
        raise fault(block, "defines no axes: its points are on one line with the origin")
    return axes_along(a, b)
