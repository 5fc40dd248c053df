"""Strain gauges of a study: the keys of ``[[sensors]]`` with ``quantity = "strain"``."""

import numpy as np

from dovetail.file.geometry import Geometry
from dovetail.file.table import Table
from updating.measurement.strain_gauge import StrainGauge


def read_strain_gauge(t: Table, geometry: Geometry) -> StrainGauge:
    """Read a gauge along a member, as it is stated: no point of the mesh is put there.

    Parameters
    ----------
    t : Table
        With ``name``, ``offset``, and ``member`` and ``position``, or ``point`` and perhaps ``member``;
        ``sign`` and ``gain`` are as for other sensors.
    geometry : Geometry

    Raises
    ------
    StudyError
        For a key that is missing or wrong.
    """
    name, offset = t.text("name"), t.vector("offset", size=2)
    sign, gain = t.number("sign", 1.0), t.number("gain", 1.0, above=0)
    if abs(sign) != 1:
        t.refuse("sign", f"{sign:g} is not allowed; 1 or -1 is needed")
    if "point" in t:
        if "position" in t:
            t.refuse("position", "the gauge has a point; give point, or member and position")
        xyz = geometry.coordinates(t)
        member = geometry.member(t) if "member" in t else geometry.mesh.nearest_on_members(xyz)[0]
    elif "member" in t:
        xyz, member = geometry.on_member(t), geometry.member(t)
    else:
        t.refuse("", "the place of the gauge is missing: give member and position, or point")
    mesh = geometry.mesh
    k = int(np.argmin(np.linalg.norm(mesh.points[mesh.member_points(member)] - xyz, axis=1)))
    a, b = mesh.points[mesh.lines[mesh.members[member][max(k - 1, 0)]]]
    axis = sign * (b - a) / np.linalg.norm(b - a)
    return StrainGauge(name, xyz, axis, member, gain, offset=(float(offset[0]), float(offset[1])))
