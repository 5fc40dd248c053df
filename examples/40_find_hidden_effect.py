"""Hide an effect, measure, forget the effect, find it: a bolted corner that gives way, without any file.

The truth has a finer mesh, 1 % of noise, and a modulus, density and damping that the model does not know.
"""

import tempfile
from pathlib import Path

import numpy as np

import fem
from updating import EFFECT, Measurement, Nuisance, Sensor, diagnose, place_sensors, propose
from viz import render_model

flat = fem.Section.rectangle(b=0.040, h=0.010)  # m
corner, every = np.array([0.0, 0.0, 0.6]), ("x", "y", "z", "rx", "ry", "rz")
# The post ends where the arm begins, at two points of one place that a joint ties together.
ends = [[0, 0, 0], corner, corner, [0.5, 0, 0.6]]
mesh = fem.Mesh.from_lines(ends, [[0, 1], [2, 3]], {"post": [0], "arm": [1]})


def effects(E, rho):
    """Return two members of one steel, a foot that is held, and a joint that is taken to be rigid."""
    part = fem.MemberProperties(fem.Material("steel", E=E, rho=rho), flat)
    bolts = fem.Joint(name="corner", point1=1, point2=2, location=corner, rigid=every)
    return fem.Frame(members={"post": part, "arm": part}), fem.Support(name="foot", point=0), bolts


x, _, z = np.eye(3)
post = [Sensor(f"P{i}", height * z, x) for i, height in enumerate((0.15, 0.30, 0.45), 1)]
arm = [Sensor(f"A{i}", corner + reach * x, z) for i, reach in enumerate((0.15, 0.35, 0.50), 1)]
sensors, drives = (*post, *arm), (post[1], arm[2])
mesh = place_sensors(mesh, sensors).refined(size=0.02)
model = fem.Model(mesh, effects(E=210e9, rho=7850.0), fem.Damping.modal(0.01))

# Candidates are effects like any other: hide the one that releases the corner about y, at 2000 N·m/rad.
hidden = next(e for e in propose(model, ["joint_stiffness"]) if e.where == "joint corner, ry")
hidden = hidden.with_values(stiffness=2000.0)
truth = fem.Model(mesh.split(2), (*effects(E=206e9, rho=7890.0), hidden), fem.Damping.modal(0.007))
places = [(mesh.nearest_point(s.point)[0], "x" if s.name[0] == "P" else "z") for s in sensors]
exact = fem.compute_frf(fem.assemble(truth), np.arange(4.0, 800.0, 2.0), places, places[1::4])
random = np.random.default_rng(1).standard_normal((2, *exact.H.shape))
noisy = exact.H * (1 + 0.01 * (random[0] + 1j * random[1]))
names = [s.name for s in sensors]
frf = fem.FRF.from_arrays(exact.frequency, noisy, exact.kind, names, names[1::4])

uncertain = [Nuisance("frame", "E:steel", 0.02), Nuisance("frame", "rho:steel", 0.01)]
found = diagnose(model, [Measurement(frf, sensors, drives)], uncertain)
print(f"{found.verdict}: {found.reason} ({found.seconds:.0f} s)")
print(*(f"{step.fit_db:6.2f} dB  {step.label}" for step in found.steps), sep="\n")
(finding,) = found.findings
(stiffness,) = finding.parameters
label = f"{finding.effect.where}: {stiffness.value:.0f} ± {stiffness.std:.0f} {stiffness.unit}"
render_model(model, Path(tempfile.mkdtemp()) / "found.png", sensors, drives, [(corner, label)])
print(f"{label}, hidden 2000")

assert found.verdict == EFFECT
assert (finding.effect.kind, finding.effect.where) == ("joint_stiffness", "joint corner, ry")
assert abs(stiffness.value / 2000.0 - 1) < 0.03
