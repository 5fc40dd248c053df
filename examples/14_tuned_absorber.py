"""A tuned absorber on a mast: Den Hartog's tuning, and how much it takes from the resonance.

The study is planar, and its section is a rolled shape by name.
"""

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from dovetail import load_study
from fem import assemble, solve_complex_modes
from fem.effects import SprungMass
from viz import plot_frf, save

study = load_study(Path(__file__).parent / "tuned-absorber" / "study.toml")
alone = replace(study, model=study.model.without_effect("absorber"))
mode = alone.solve_modes(1)
top = study.model.mesh.point_names["top"]
modal_mass = 1 / mode.shapes[6 * top, 0] ** 2  # of a mode that moves the top by 1
print(f"without: {mode.frequency[0]:.4f} Hz, modal mass {modal_mass:.1f} kg")

# Den Hartog, Mechanical Vibrations: the two fixed points are equally high, and the response is flat there.
mass = 0.05 * modal_mass
ratio = mass / modal_mass
frequency = mode.frequency[0] / (1 + ratio)
zeta = np.sqrt(3 * ratio / (8 * (1 + ratio) ** 3))
print(f"absorber: {mass:.2f} kg, {frequency:.4f} Hz, damping ratio {zeta:.4f}")
tuned = SprungMass.tuned("absorber", top, mass, frequency, zeta, ("x",))
best = replace(study, model=alone.model.with_effect(tuned))
poles = solve_complex_modes(assemble(best.model), 2)
print("with: damping ratios", *(f"{z:.4f}" for z in poles.zeta))

found = {name: s.frf(kind="receptance") for name, s in (("without", alone), ("with", best))}
for name, frf in found.items():
    picture = save(
        plot_frf(frf, title=f"top of the mast, {name}", label="computed"),
        Path(tempfile.mkdtemp()) / f"{name}.png",
    )
    print(f"picture in {picture}")

# The highest response is √(1 + 2/μ) times the static one of the mode.
static = 1 / (modal_mass * (2 * np.pi * mode.frequency[0]) ** 2)
highest = np.abs(found["with"].H).max() / static
closed = np.sqrt(1 + 2 / ratio)
print(f"highest response {highest:.2f} times the static one, closed form {closed:.2f}")

assert abs(highest / closed - 1) < 0.03  # the closed form has no damping of the mast
assert np.abs(found["without"].H).max() / static > 100.0
