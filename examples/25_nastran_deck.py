"""A Nastran deck: read, drawn in a mode, and weighed against a hand calculation."""

import tempfile
import warnings
from pathlib import Path

import numpy as np

from fem import assemble, compute_participation, solve_modes
from fem.io import read_model
from viz import render_mode

warnings.simplefilter("ignore")  # notes on cards with another meaning here; they are in model.mesh.notes
model = read_model(Path(__file__).parent / "missing-card" / "frame.bdf", units="mm-t-s")
print(*model.mesh.notes, sep="\n")

system = assemble(model)
modes = solve_modes(system, n=6)
picture = render_mode(model, modes, 2, Path(tempfile.mkdtemp()) / "mode.png")
print(f"picture in {picture}")

# Four columns and a ring of box sections, a crossbeam, a brace of round bar, and a pump of 18 kg.
column, ring = (b * h - (b - 6) * (h - 6) for b, h in ((50, 50), (40, 60)))  # mm²
volume = 4 * 800 * column + 3000 * ring + 600 * 444 + np.pi * 10**2 * np.hypot(900, 800)  # mm³
by_hand = 7.85e-6 * volume + 18.0  # kg
mass = compute_participation(system, modes).total[0]
print(f"the model weighs {mass:.3f} kg, by hand {by_hand:.3f} kg")

assert abs(mass / by_hand - 1) < 0.001
