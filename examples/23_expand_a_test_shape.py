"""Expand a measured shape from seven accelerometers to the whole frame (SEREP)."""

import tempfile
from pathlib import Path

import numpy as np

import fem
from fem.reduction import expand_serep
from updating import mac
from viz import render_mode

points = [[0, 0, 0], [0, 0, 1.2], [0.9, 0, 1.2], [0.9, 0, 0]]  # m
mesh = fem.Mesh.from_lines(points, [[0, 1], [1, 2], [2, 3]], {"left": [0], "beam": [1], "right": [2]})
part = fem.MemberProperties(fem.Material("steel", E=210e9, rho=7850.0), fem.Section.rectangle(0.1, 0.02))
frame = fem.Frame(members=dict.fromkeys(mesh.members, part))
model = fem.Model(
    mesh.refined(size=0.1), (frame, fem.Support(name="a", point=0), fem.Support(name="b", point=3))
)
system = fem.assemble(model)
modes = fem.solve_modes(system, n=4)

# The test sees another frame, with a motor, at seven sensors, with 2 % of noise.
real = model.with_effect(fem.AddedMass(name="motor", point=1, mass=2.0))
truth = fem.solve_modes(fem.assemble(real), n=4).shapes[:, 3]
places = np.array(
    [[0, 0, 0.6], [0, 0, 1.2], [0, 0, 1.2], [0.3, 0, 1.2], [0.6, 0, 1.2], [0.9, 0, 1.2], [0.9, 0, 0.6]]
)
sensors = [(model.mesh.nearest_point(p)[0], d) for p, d in zip(places, "xxyzzyx", strict=True)]
rows = np.array([6 * p + "xyz".index(d) for p, d in sensors])
noise = 0.02 * np.abs(truth[rows]).max() * np.random.default_rng(1).standard_normal(7)
measured = truth[rows] + noise

expanded = expand_serep(system, modes, sensors, measured[:, None])
shown, vectors = fem.Modes(modes.frequency[3:4], expanded.shapes), np.zeros((7, 3))
vectors[np.arange(7), rows % 6] = measured
title = "A shape from seven sensors, on the whole frame"
picture = render_mode(model, shown, 0, Path(tempfile.mkdtemp()) / "shape.png", (places, vectors), title)
print(f"picture in {picture}")

moves = np.arange(model.n_dof) % 6 < 3  # m, not rad
agreement = mac(expanded.shapes[moves], truth[moves, None])[0, 0]
print(f"MAC of the expanded and the true shape, at all points of the frame: {agreement:.4f}")

assert agreement > 0.99
