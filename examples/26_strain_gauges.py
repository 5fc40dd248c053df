"""Strain gauges along a cantilever: strains per force, at rest and at resonance."""

import tempfile
from pathlib import Path

import numpy as np

import fem
from updating import StrainGauge, place_sensors
from viz import BLUE, VERMILION, look, new_figure, save

steel = fem.Material("steel", E=210e9, rho=7850.0)
flat = fem.Section.rectangle(b=0.040, h=0.010)  # m
length = 0.8
places = np.linspace(0.05, 0.75, 15)
# On the upper face: 5 mm above the axis, along local z.
gauges = tuple(
    StrainGauge(f"S{k}", np.array([x, 0, 0]), np.array([1.0, 0, 0]), member="beam", offset=(0.0, 0.005))
    for k, x in enumerate(places, 1)
)
mesh = fem.Mesh.from_lines([[0, 0, 0], [length, 0, 0]], [[0, 1]], {"beam": [0]}).refined(counts={"beam": 16})
mesh = place_sensors(mesh, gauges)
beam = fem.Frame(members={"beam": fem.MemberProperties(steel, flat)})
model = fem.Model(mesh, (beam, fem.Support(name="wall", point=0)), fem.Damping.modal(0.01))
system = fem.assemble(model)

second = next(m for m in fem.solve_modes(system, n=4).frequency[1:] if m < 200)
rows = np.array([gauge.row(model) for gauge in gauges])
strain = fem.compute_frf(system, [0.0, second], rows, [(1, "z")], "receptance").H[:, :, 0]  # 1/N

# A static force at the tip: ε = -F (L - x) z / E I.
closed = -(length - places) * 0.005 / (steel.E * flat.Iy)
with look():
    ax = new_figure(height=3.2).add_subplot(xlabel="position [m]", ylabel="strain per force [µm/m per N]")
    ax.plot(places, 1e6 * closed, color=BLUE, label="static, closed form")
    ax.plot(places, 1e6 * strain[0].real, "o", color=BLUE, label="static, gauges")
    ax.plot(places, 1e6 * np.abs(strain[1]), "o-", color=VERMILION, label=f"amplitude at {second:.1f} Hz")
    ax.legend()
print(f"picture in {save(ax.figure, Path(tempfile.mkdtemp()) / 'strain.png')}")
print(f"gauge S1 reads {1e6 * strain[0, 0].real:.4f} µm/m per N, closed form {1e6 * closed[0]:.4f}")

assert np.allclose(strain[0], closed, rtol=1e-4)
