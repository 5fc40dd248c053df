"""Update a frame from its FRFs: three members' stiffness and the density, with their uncertainty.

The measurement comes from a model with a finer mesh, other stiffnesses, and 1 % of noise.
"""

import tempfile
from pathlib import Path

import numpy as np

import fem
from fem.effects import MemberStiffness
from updating import update
from viz import plot_parameters, save

names = ["left", "right", "beam"]
points = [[0, 0, 0], [0, 0, 0.5], [0.6, 0, 0], [0.6, 0, 0.5]]  # m
mesh = fem.Mesh.from_lines(points, [[0, 1], [2, 3], [1, 3]], {name: [i] for i, name in enumerate(names)})
part = fem.MemberProperties(fem.Material("steel", 210e9, 7850.0), fem.Section.rectangle(0.03, 0.01))
effects = (
    fem.Frame(members=dict.fromkeys(names, part)),
    fem.Support(name="foot 1", point=0),
    fem.Support(name="foot 2", point=2),
    *(MemberStiffness(name=f"EI of {name}", member=name, change=0.0) for name in names),
)
model = fem.Model(mesh.split(10), effects, fem.Damping.modal(0.006))

truth = {
    ("EI of left", "change"): 0.15,
    ("EI of right", "change"): -0.10,
    ("EI of beam", "change"): 0.20,
    ("frame", "rho:steel"): 7850 * 1.12,
}
real = model.with_mesh(mesh.split(30)).with_values(truth).with_damping(fem.Damping.modal(0.01))
lines = np.arange(10.0, 400.0, 1.0)  # Hz
sensors, hammer = [(1, "x"), (1, "y"), (3, "x"), (3, "y")], [(1, "x"), (1, "y")]
exact = fem.compute_frf(fem.assemble(real), lines, sensors, hammer).H
noise = np.random.default_rng(1).standard_normal((2, *exact.shape))
H = exact * (1 + 0.01 * (noise[0] + 1j * noise[1]))

priors = dict.fromkeys(truth, 0.2)
updated = update(model, priors, frf=H, lines=lines, outputs=sensors, inputs=hammer, model_error=0.0)

print(updated.table())
for step in updated.path:
    print(f"{step.stage:14} {step.errors.frf_db:7.3f} dB  {np.round(step.values[:4], 3)}")
picture = save(plot_parameters(updated), Path(tempfile.mkdtemp()) / "parameters.png")
print(f"picture in {picture}")
error = (updated.values[:4] - list(truth.values())) / updated.std[:4]
print("errors in standard deviations:", error.round(1))

assert updated.converged
assert np.abs(error).max() < 4.0
