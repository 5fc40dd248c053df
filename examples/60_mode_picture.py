"""Draw a mode of a clamped I-beam without a screen, with the shape that a test might have given."""

import tempfile
from pathlib import Path

import numpy as np

from fem import Frame, Material, MemberProperties, Mesh, Model, Section, Support, assemble, solve_modes
from viz import render_mode

steel = Material("steel", E=210e9, rho=7850.0)
profile = Section.i_section(b=0.100, h=0.096, tf=0.008, tw=0.005)  # m
length = 4.0
mesh = Mesh.from_lines([[0, 0, 0], [length, 0, 0]], [[0, 1]], {"beam": [0]}).refined(counts={"beam": 24})
beam = Frame(members={"beam": MemberProperties(steel, profile, theory="euler-bernoulli")})
ends = mesh.member_points("beam")[[0, -1]]
supports = tuple(Support(name=f"end {p}", point=int(p)) for p in ends)
model = Model(mesh, (beam, *supports))
modes = solve_modes(assemble(model), n=10)

# The weaker way, along y; βL = 7.8532 is the second root of cosh(βL) cos(βL) = 1.
omega = (7.853204624 / length) ** 2 * np.sqrt(steel.E * profile.Iz / (steel.rho * profile.A))
index = int(np.abs(modes.frequency - omega / (2 * np.pi)).argmin())

# Arrows where seven accelerometers along y were; a measured shape has a scale and a sign of its own.
places = mesh.points[mesh.member_points("beam")[3:-1:3]]
x = places[:, 0]
measured = np.column_stack([0 * x, -3.0 * np.sin(2 * np.pi * x / length), 0 * x])
picture = render_mode(model, modes, index, Path(tempfile.mkdtemp()) / "mode.png", (places, measured))
print(f"picture in {picture}")
print(f"mode {index + 1}: {modes.frequency[index]:.3f} Hz, closed form {omega / (2 * np.pi):.3f} Hz")

assert abs(modes.frequency[index] / (omega / (2 * np.pi)) - 1) < 1e-5
assert picture.stat().st_size > 20_000
