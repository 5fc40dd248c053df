"""Identify the modes of a measured frame without a choice by hand, and damp a model with them.

Three aluminium floors on four legs, measured at the University of Southampton: accelerances of the floors
along one direction. Three modes are those of the plane; two small ones lie outside it and are found as well.
"""

import tempfile
from pathlib import Path

import numpy as np

from fem.io import read_frf
from updating import damping_matrix, identify_modes
from viz import plot_stabilisation, plot_synthesis, save

measured = read_frf(Path(__file__).parent / "southampton-frame" / "accelerance_3x3.uff")
found = identify_modes(measured, band=(2.0, 60.0))  # Hz

print(found.table())
print(*found.choices, sep="\n")
for candidate in found.candidates:
    if not candidate.accepted:
        print(f"left out: {candidate.frequency:.2f} Hz, {candidate.reason}")

out = Path(tempfile.mkdtemp())
diagram = save(plot_stabilisation(measured, found), out / "stabilisation.png")
picture = save(plot_synthesis(measured, found), out / "synthesis.png")
print(diagram, picture, sep="\n")

# the damping of a model, from the ratios: model.with_damping(found.damping()), or a matrix for three floors
plane = slice(0, 3)
shapes, frequency, zeta = found.modes.shapes[:, plane], found.modes.frequency[plane], found.modes.zeta[plane]
M = np.linalg.inv(shapes @ shapes.T)  # kg: three modes of unit mass on three floors leave no choice
C = damping_matrix(M, shapes, frequency, zeta)
print(f"masses of the floors {np.diag(M).round(2)} kg; each was weighed with 5.2 kg, without its legs")

assert np.allclose(shapes.T @ C @ shapes, np.diag(4 * np.pi * zeta * frequency), atol=1e-9)
assert np.abs(frequency - [6.50, 17.47, 26.50]).max() < 1 / 32  # the spacing of the lines
