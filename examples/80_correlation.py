"""Plan a test of a frame, match its geometry, and find a sensor with a wrong gain from the measured modes."""

import tempfile
from pathlib import Path

import numpy as np

from fem import Frame, Material, MemberProperties, Mesh, Model, Modes, Section, Support, assemble, solve_modes
from updating import match_geometry, plan_pretest
from updating.correlation import comac, compare_modes, ecomac, eliminate_coordinates
from viz import plot_coordinates, plot_mode_pairs, save

steel = Material("steel", E=210e9, rho=7850.0)
points = [[0, 0, 0], [0, 0, 1.0], [0.7, 0, 1.0], [0.7, 0.4, 1.0]]  # m: a post, an arm and a stub
mesh = Mesh.from_lines(points, [[0, 1], [1, 2], [2, 3]], {"post": [0], "arm": [1], "stub": [2]}).refined(
    size=0.1
)
bar = MemberProperties(steel, Section.rectangle(0.03, 0.02))
foot, _ = mesh.nearest_point([0, 0, 0])
model = Model(mesh, (Frame(members=dict.fromkeys(mesh.members, bar)), Support(name="foot", point=foot)))
modes = solve_modes(assemble(model), n=6)

# Before the test: twelve sensors and one exciter for six modes, and what they cannot see.
plan = plan_pretest(model, modes, n_sensors=12)
print(plan.summary())

# The test's points come in millimetres and in axes of its own.
turn = np.array([[0, 0, 1.0], [1, 0, 0], [0, 1, 0]])
places = np.unique(np.vstack([[s.point for s in plan.sensors], points[:1], points[3:]]), axis=0)
match = match_geometry(1e3 * places @ turn.T + 250.0, mesh.points, tolerance=0.01, unit="mm")
print(match.describe())

# After it: modes 1 % lower, in another order, with noise, and one sensor that reads half of what it should.
rows = np.eye(model.n_dof)[
    [6 * p + "xyz".index(d) for p, d in (plan.candidates[k] for k in plan.sensor_rows)]
]
rng = np.random.default_rng(1)
order, bad = [1, 0, 2, 3, 4, 5], 4
shapes = (rows @ modes.shapes)[:, order] * [1.0, -2.0, 0.5, 1.0, -1.0, 3.0]
shapes = shapes * (1 + 0.02 * rng.standard_normal(shapes.shape))
shapes[bad] *= 0.5
found = compare_modes(Modes(0.99 * modes.frequency[order], shapes), modes, rows)
print(found.table())

i, j = (list(k) for k in zip(*found.pairs, strict=True))
x, a = shapes[:, i], (rows @ modes.shapes)[:, j]
names = [s.name for s in plan.sensors]
folder = Path(tempfile.mkdtemp())
save(plot_coordinates({"CoMAC": comac(x, a), "ECoMAC": ecomac(x, a)}, names), folder / "coordinates.png")
save(plot_mode_pairs(found), folder / "pairs.png")
worst = eliminate_coordinates(x, a).order[0]
print(f"MAC gains most without {names[worst]}; pictures in {folder}")

assert worst == bad
assert match.rms < 1e-9
assert np.allclose(found.frequency_error, 1 / 0.99 - 1, rtol=1e-6)
