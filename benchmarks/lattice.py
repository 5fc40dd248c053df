"""The cubic lattice that several benchmarks and tests share."""

import numpy as np

from fem import Damping, Frame, Material, MemberProperties, Mesh, Model, Section, Support


def lattice(n: int) -> Model:
    """Return a cube of n³ points 1 m apart, one element for each member, its lowest points clamped."""
    index = np.arange(n**3).reshape(n, n, n)
    lines = []
    for axis in range(3):
        a = np.moveaxis(index, axis, 0)
        lines.append(np.stack([a[:-1], a[1:]], axis=-1).reshape(-1, 2))
    points = np.argwhere(index >= 0).astype(float)
    mesh = Mesh.from_lines(points, np.concatenate(lines))
    steel = MemberProperties(Material("steel", 210e9, 7850.0), Section.rectangle(0.03, 0.01))
    feet = [Support(name=f"s{i}", point=int(i)) for i in np.flatnonzero(points[:, 2] == 0)]
    return Model(mesh, (Frame(members=dict.fromkeys(mesh.members, steel)), *feet), Damping.structural(0.01))
