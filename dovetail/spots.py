"""Places of effects by the numbers of the mesh: nodes, element, coordinates, and the global axis."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fem.array_types import Floats
from fem.lengths import coordinates_text, rough_length
from fem.mesh import FileNumbers, Mesh
from fem.model import Effect, Model


@dataclass(frozen=True, slots=True, eq=False)
class MeshSpot:
    """Where an effect at one place is.

    Attributes
    ----------
    xyz : ndarray (3,)
        Coordinates [m].
    node : int or None
        Number of the nearest node in the mesh's file.
    distance : float
        From that node [m].
    element : int or None
        Number of the element there, of a place between its nodes.
    between : tuple of int
        These nodes.
    names : tuple of str
        The point of the model there by its name, and ends of members of supports and joints.
    axis : ndarray (3,) or None
        Global axis of a turning effect.
    """

    xyz: Floats
    node: int | None
    distance: float
    element: int | None
    between: tuple[int, ...]
    names: tuple[str, ...]
    axis: Floats | None

    @property
    def short(self) -> str:
        """The numbers alone, such as ``node 14`` or ``element 87, nodes 31 to 32``; empty without any."""
        if self.element is not None:
            first, second = self.between
            return f"element {self.element}, nodes {first} to {second}"
        if self.node is None:
            return ""
        return f"node {self.node}" if not self.distance else f"near node {self.node}"

    @property
    def text(self) -> str:
        """All in words, such as ``in element 87, nodes 31 to 32 (node 31 is 12 mm away), (0, 0, 0.4) m``."""
        parts, numbers = [*self.names], self.short
        if self.distance and self.node is not None:
            away = f"{rough_length(self.distance)} away"
            numbers += f" ({away})" if self.element is None else f" (node {self.node} is {away})"
        if numbers and numbers not in self.names:
            parts.insert(1 if self.names else 0, numbers)
        head = "in" if not self.names and self.element is not None else "at"
        parts.append(coordinates_text(self.xyz))
        text = f"{head} {', '.join(parts)}".replace("at near ", "near ")
        return text if self.axis is None else f"{text}, about global {axis_text(self.axis).lstrip('+−')}"

    def fields(self) -> dict[str, Any]:
        """Return all as plain values, coordinates and distance in metres."""
        return {
            "xyz": self.xyz.tolist(),
            "node": self.node,
            "node_distance": self.distance if self.node is not None else None,
            "element": self.element,
            "between_nodes": list(self.between),
            "axis": None if self.axis is None else self.axis.tolist(),
        }


def spot_of(effect: Effect, model: Model) -> MeshSpot | None:
    """Return the spot of an effect at one place; None of one at several places or none."""
    from fem.effects.giving_way import turning_axis  # what needs no report loads no kinds of effects

    points, mesh = effect.locations(model), model.mesh
    if len(points) != 1:
        return None
    (xyz,) = points
    reach = 1e-6 * float(np.ptp(mesh.points, axis=0).max())
    near = {n: float(np.linalg.norm(mesh.points[k] - xyz)) for n, k in mesh.point_names.items()}
    name = min(near, key=near.__getitem__, default="")
    named = [name] if name and near[name] <= reach else []
    # of a support or joint, whose name may be a number; others have their member in their words
    ends = [] if "member" in effect.where else _ends_at(mesh, xyz, reach)
    axis = turning_axis(effect, model)
    axis = None if axis is None else np.asarray(axis, dtype=float)
    return MeshSpot(
        np.asarray(xyz, dtype=float), *_numbers_at(mesh.numbers, xyz, reach), (*named, *ends), axis
    )


def _numbers_at(
    numbers: FileNumbers | None, xyz: Floats, reach: float
) -> tuple[int | None, float, int | None, tuple[int, ...]]:
    """Return the nearest node, its distance, and the element and its nodes where no node is."""
    if numbers is None or not len(numbers.nodes):
        return None, 0.0, None, ()
    node, distance = numbers.nearest_node(xyz)
    if distance <= reach:
        return node, 0.0, None, ()
    element = numbers.element_at(xyz, 1e3 * reach)  # positions are written to a millimetre
    return (node, distance, None, ()) if element is None else (node, distance, *element)


def spot_text(effect: Effect, model: Model) -> str:
    """Return the spot of an effect in words; empty of an effect at several places or none."""
    spot = spot_of(effect, model)
    return "" if spot is None else spot.text


def spot_label(effect: Effect | None, model: Model) -> str:
    """Return the numbers of an effect's spot in brackets behind a label; empty without any."""
    spot = None if effect is None else spot_of(effect, model)
    return f" [{spot.short}]" if spot is not None and spot.short else ""


def _ends_at(mesh: Mesh, place: Floats, reach: float) -> list[str]:
    """Return the ends of members at a place, such as ``end 1 of member leg``; none of more than two."""
    out = []
    for member in mesh.members:
        points = mesh.points[mesh.member_points(member)[[0, -1]]]
        at = np.flatnonzero(np.linalg.norm(points - place, axis=1) <= reach)
        out += [f"end {k + 1} of member {member}" for k in at]
    return out if len(out) <= 2 else []


def axis_text(t: ArrayLike) -> str:
    """Return a direction in words: an axis, or its components."""
    t = np.asarray(t, dtype=float)
    k = int(np.argmax(np.abs(t)))
    # Component of a direction from which on it is called by the name of its axis [-]
    if abs(t[k]) > 0.999:
        return f"{'+' if t[k] > 0 else '−'}{'xyz'[k]}"
    return "(" + ", ".join(f"{c:.2f}" for c in t) + ")"
