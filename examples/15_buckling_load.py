"""A column buckles: Euler's load, and the shape in which it gives way."""

import tempfile
from pathlib import Path

import numpy as np

from fem import Frame, Material, MemberProperties, Mesh, Model, Modes, Section, Support, solve_buckling
from viz import render_mode

steel = Material("steel", E=210e9, rho=7850.0)
tube = Section.tube(d=0.0603, t=0.004)  # m
height = 3.0
mesh = Mesh.from_lines([[0, 0, 0], [0, 0, height]], [[0, 1]], {"column": [0]}).refined(counts={"column": 16})
column = Frame(members={"column": MemberProperties(steel, tube, theory="euler-bernoulli")})
supports = Support(name="foot", point=0), Support(name="top", point=1, fixed=("x", "y"))
model = Model(mesh, (column, *supports))

found = solve_buckling(model, {(1, "z"): -1000.0}, n=2)
load = 1000.0 * found.factors[0]

shape = Modes(np.zeros(2), found.shapes)
title = f"Column, clamped and pinned, buckles at {load / 1e3:.1f} kN"
picture = render_mode(model, shape, 0, Path(tempfile.mkdtemp()) / "shape.png", title=title)
print(f"picture in {picture}")

# Clamped at one end and pinned at the other: the first root of tan z = z.
euler = 4.493409458**2 * steel.E * tube.Iy / height**2
print(f"buckling load {load / 1e3:.3f} kN, Euler {euler / 1e3:.3f} kN")

assert abs(load / euler - 1) < 1e-4
