"""Strain gauges: channels that read the strain of a fibre along a member."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fem.array_types import Floats
from fem.elements.frame import Frame
from fem.elements.interpolation import strain_matrix
from fem.elements.lines import flexible_fraction
from fem.mesh import Mesh
from fem.model import Model
from updating.measurement.measurement import STRAIN, MeasurementError, Sensor, sensor_point

SHORT = 0.005
"""Length of the elements on both sides of a gauge, in lengths of its member [-]."""

STRAIGHT = 0.99
"""Least cosine of the angle between a gauge and its member's axis, which eccentric ends tilt [-]."""


@dataclass(frozen=True, slots=True, eq=False)
class StrainGauge(Sensor):
    """A gauge or fibre that reads the strain along a member's axis, at a distance from it.

    In local axes of the member, with the displacements u, v, w of its axis and the rotations θ of its
    sections,

        ε = u' - y θz' + z θy'        (θz = v', θy = -w' without shear: ε = u' - y v'' - z w'')

    It adds no mass. Its ``direction`` is along the axis; against it, as for a gauge that is wired in reverse,
    compression reads positive. Its ``gain`` may hold the sensitivity, such as 1e6 for readings in µm/m.

    Attributes
    ----------
    offset : tuple of float
        Distances (y, z) from the axis in the member's local axes [m].
    """

    offset: tuple[float, float] = (0.0, 0.0)

    quantity: ClassVar[str] = STRAIN
    directed: ClassVar[bool] = False

    def row(self, model: Model) -> Floats:
        """Return the strain as a combination of DOFs, shape (n_dof,) [1/m for translations].

        It is the mean of the member's elements that meet at the gauge. Within an element of length h the
        curvature κ is linear, and at its ends κ'' h²/12 off, so that elements beside a gauge are short
        (:meth:`placed`).

        Raises
        ------
        MeasurementError
            If the gauge is on no member of the model's frame, its direction is not along the member, or it
            is in a rigid zone.
        """
        mesh, point = model.mesh, sensor_point(model.mesh, self)
        (member,) = mesh.members_of(self.member or mesh.nearest_on_members(self.point)[0])
        frame = next((f for f in model.of_kind(Frame) if member in f.members), None)
        if frame is None:
            msg = f"strain gauge '{self.name}' is on '{member}', which is no member of the model's frame"
            raise MeasurementError(msg)
        at = mesh.lines[mesh.members[member]] == point
        there = at.any(axis=1)
        g, second = frame.lines(mesh, mesh.members[member][there]), at[there, 1]
        if g.zone[np.arange(len(second)), second.astype(int)].any():
            msg = f"strain gauge '{self.name}' is in a rigid zone of '{member}', which has no strain"
            raise MeasurementError(msg)
        along = g.R[:, 0] @ np.asarray(self.direction, dtype=float)
        if np.abs(along).min() < STRAIGHT:
            msg = (
                f"strain gauge '{self.name}' has the direction {np.asarray(self.direction).tolist()}, "
                f"{np.degrees(np.arccos(np.abs(along).min())):.3g}° off the axis of '{member}'; gauges along "
                "the axis are allowed"
            )
            raise MeasurementError(msg)
        B = np.real(strain_matrix(g, flexible_fraction(g, second.astype(float))))
        bent = (g.bar == 0)[:, None]
        fibre = B[:, 0] + bent * (self.offset[1] * B[:, 4] - self.offset[0] * B[:, 5])
        local = np.sign(along)[:, None] * fibre / len(along)
        row = np.zeros(model.n_dof)
        np.add.at(row, g.dofs, self.gain * np.real(local[:, None] @ g.T)[:, 0])
        return row

    def placed(self, mesh: Mesh, tolerance: float) -> Mesh:
        """Return a mesh with a point at the gauge, between two elements of at most ``SHORT`` of the member.

        Raises
        ------
        MeasurementError
            If it is farther from its member than the tolerance [m].
        """
        member, position = self.on_member(mesh, tolerance)
        length = mesh.member_length(member)
        for s in (position, position - SHORT * length, position + SHORT * length):
            gap = np.abs(mesh.member_positions(member) - s).min()
            # not another one next to a point that is as near: it would leave a sliver
            if 0 < s < length and gap > (0.5 * SHORT * length if s != position else 0.0):
                mesh = mesh.with_point_on(member, s)
        return mesh
