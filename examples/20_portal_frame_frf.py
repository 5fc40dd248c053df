"""A portal frame from a mesh file: an FRF, its plot, and the sway stiffness against a hand calculation."""

import tempfile
from pathlib import Path

import numpy as np

from fem import Damping, Frame, Material, MemberProperties, Model, Section, Support, assemble, compute_frf
from fem.io import read_mesh
from viz import plot_frf, save

# Physical groups of the Gmsh file name the members; the two "columns" become columns.1 and columns.2.
mesh = read_mesh(Path(__file__).parent / "portal-frame.msh")
steel = Material("steel", E=210e9, rho=7850.0)
column, beam = Section.tube(d=0.042, t=0.003), Section.hollow_rectangle(b=0.030, h=0.050, t=0.003)  # m

members = {name: MemberProperties(steel, column) for name in mesh.members_of("columns")}
members["beam"] = MemberProperties(steel, beam)
feet = [int(p) for p in np.flatnonzero(mesh.points[:, 2] == 0)]
supports = tuple(Support(name=f"foot {p}", point=p) for p in feet)
model = Model(mesh.refined(size=0.1), (Frame(members=members), *supports), Damping.modal(0.01))
system = assemble(model)

corner, _ = mesh.nearest_point([0.0, 0.0, 1.5])
frequency = np.arange(0.0, 400.0, 0.5)
receptance = compute_frf(system, frequency, [(corner, "x")], [(corner, "x")], "receptance")
folder = Path(tempfile.mkdtemp())
picture = save(
    plot_frf(receptance.select(band=(1, 400)), title="Portal frame, sway", label="computed"),
    folder / "frf.png",
)
print(f"FRF in {picture}")

# Slope-deflection method: clamped portal, height H, width W, members that bend but do not stretch or shear:
# k = 24 E Ic / H³ · (6 γ + 1) / (6 γ + 4), with γ = (Ib / W) / (Ic / H).
H, W = 1.5, 1.0
gamma = (beam.Iy / W) / (column.Iy / H)
k = 24 * steel.E * column.Iy / H**3 * (6 * gamma + 1) / (6 * gamma + 4)
computed = 1 / receptance.H[0, 0, 0].real
print(f"sway stiffness {computed / 1e3:.2f} N/mm, by hand {k / 1e3:.2f} N/mm")

assert picture.stat().st_size > 10_000
assert -0.01 < computed / k - 1 < 0  # softer, by what the members stretch and shear
