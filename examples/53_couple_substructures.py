"""Couple two substructures by their FRFs: the result is the FRF of the assembled model."""

import tempfile
from pathlib import Path

import numpy as np

import fem
from joint import couple_frf
from viz import BLUE, VERMILION, look, new_figure, save

steel = fem.Material("steel", E=210e9, rho=7850.0)
flat = fem.MemberProperties(steel, fem.Section.rectangle(b=0.040, h=0.010))  # m
frequency = np.arange(5.0, 600.0, 2.0)


def receptance(start, end, outputs):
    """Compute receptances of a beam along x, clamped if it starts at 0, at named places."""
    mesh = fem.Mesh.from_lines([[start, 0, 0], [end, 0, 0]], [[0, 1]], {"beam": [0]}).refined(size=0.05)
    wall = (fem.Support(name="wall", point=0),) if start == 0 else ()
    model = fem.Model(mesh, (fem.Frame(members={"beam": flat}), *wall), fem.Damping(loss_factor=0.02))
    dofs = [(mesh.nearest_point([x, 0, 0])[0], d) for x, d in outputs.values()]
    H = fem.compute_frf(fem.assemble(model), frequency, dofs, dofs, "receptance", "direct").H
    return fem.FRF.from_arrays(frequency, H, "receptance", list(outputs), list(outputs))


left = receptance(0.0, 0.4, {"L:z": (0.4, "z"), "L:ry": (0.4, "ry")})
right = receptance(0.4, 1.0, {"R:z": (0.4, "z"), "R:ry": (0.4, "ry"), "tip:z": (1.0, "z")})
coupled = couple_frf([left, right], [("L:z", "R:z"), ("L:ry", "R:ry")]).frf.select(["tip:z"], ["tip:z"])
whole = receptance(0.0, 1.0, {"tip:z": (1.0, "z")})

with look():
    ax = new_figure(height=3.4).add_subplot(xlabel="frequency [Hz]", ylabel="receptance [m/N]", yscale="log")
    ax.plot(frequency, np.abs(whole.H[:, 0, 0]), color=BLUE, linewidth=3, alpha=0.4, label="assembled model")
    ax.plot(frequency, np.abs(coupled.H[:, 0, 0]), "--", color=VERMILION, label="coupled from two parts")
    ax.legend()
print(f"picture in {save(ax.figure, Path(tempfile.mkdtemp()) / 'coupled.png')}")
error = np.abs(coupled.H / whole.H - 1).max()
print(f"coupled and assembled FRFs differ by {error:.1e}")

assert error < 1e-6
