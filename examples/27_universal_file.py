"""A universal file: the geometry and the modes of a test, written, read again and laid over the model."""

import tempfile
from pathlib import Path

import numpy as np

import fem
from fem.io import read_uff, write_uff
from updating import mac, match_geometry
from viz import plot_geometry_match, save

points = [[0, 0, 0], [0, 0, 1.2], [0.9, 0, 1.2], [0.9, 0, 0]]  # m
mesh = fem.Mesh.from_lines(points, [[0, 1], [1, 2], [2, 3]], {"left": [0], "beam": [1], "right": [2]})
part = fem.MemberProperties(fem.Material("steel", E=210e9, rho=7850.0), fem.Section.rectangle(0.03, 0.02))
frame = fem.Frame(members=dict.fromkeys(mesh.members, part))
supports = [fem.Support(name=f"foot {p}", point=p) for p in (0, 3)]
model = fem.Model(mesh.refined(size=0.15), (frame, *supports))
modes = fem.solve_modes(fem.assemble(model), n=6)

folder = Path(tempfile.mkdtemp())
write_uff(folder / "test.uff", modes=modes, mesh=model.mesh)
file = read_uff(folder / "test.uff")
again = file.one_set_of_modes()

test = file.points
match = match_geometry(test.coordinates, model.mesh.points, tolerance=0.01, axes="same")
names = [f"{n}" for n in test.labels]
picture = save(
    plot_geometry_match(model.mesh, match, names, "Points of the file on the model"), folder / "geometry.png"
)
print(f"picture in {picture}")
same = np.diag(mac(again.shapes, modes.shapes))
print(f"{len(names)} points and {len(same)} modes read; least MAC with what was written {same.min():.9f}")

assert match.rms < 1e-6
assert abs(same.min() - 1) < 1e-9
