"""Bands from uncertain parameters: 200 frames whose steel scatters, and the spread of their frequencies."""

import tempfile
from pathlib import Path

import numpy as np

import fem
from viz import plot_bands, save

points = [[0, 0, 0], [0, 0, 1.2], [0.9, 0, 1.2], [0.9, 0, 0]]  # m
mesh = fem.Mesh.from_lines(points, [[0, 1], [1, 2], [2, 3]], {"left": [0], "beam": [1], "right": [2]})
part = fem.MemberProperties(fem.Material("steel", E=210e9, rho=7850.0), fem.Section.rectangle(0.03, 0.02))
frame = fem.Frame(members=dict.fromkeys(mesh.members, part))
supports = [fem.Support(name=f"foot {p}", point=p) for p in (0, 3)]
model = fem.Model(mesh.refined(size=0.3), (frame, *supports), fem.Damping.modal(0.01))

n, std_E, std_rho, lines = 200, 0.04, 0.02, np.linspace(5.0, 120.0, 400)
rng = np.random.default_rng(3)
E, rho = 210e9 * np.exp(std_E * rng.standard_normal(n)), 7850.0 * np.exp(std_rho * rng.standard_normal(n))
frequency, H = [], []
for values in zip(E, rho, strict=True):
    system = fem.assemble(
        model.with_values({("frame", "E:steel"): values[0], ("frame", "rho:steel"): values[1]})
    )
    modes = fem.solve_modes(system, n=6)
    frequency.append(modes.frequency)
    shape = modes.shapes[6]  # point 1 along x
    lag = (2 * np.pi) ** 2 * (
        modes.frequency**2 - lines[:, None] ** 2 + 0.02j * modes.frequency * lines[:, None]
    )
    H.append(np.abs((shape**2 / lag).sum(axis=1) * (2 * np.pi * lines) ** 2))

share = 5, 50, 95
bands = [("corner, along x", np.percentile(H, share, axis=0), None)]
figure = plot_bands(lines, bands, np.percentile(frequency, share, axis=0), "accelerance [m/s²/N]")
print(f"picture in {save(figure, Path(tempfile.mkdtemp()) / 'bands.png')}")

# Frequencies are proportional to √(E/ρ). A standard deviation from n samples is itself good to 1/√(2n).
spread, closed = np.log(frequency).std(axis=0), np.hypot(std_E, std_rho) / 2
print(f"frequencies scatter by {100 * spread[0]:.2f} %, closed form {100 * closed:.2f} %")

assert np.allclose(np.log(frequency[0] / frequency[1]), np.log(E[0] / rho[0] * rho[1] / E[1]) / 2)
assert np.abs(spread / closed - 1).max() < 3.0 / np.sqrt(2 * n)
