"""Take a known part out of a measured assembly: decoupling gives the FRF of the rest back."""

import tempfile
from pathlib import Path

import numpy as np

import fem
from joint import decouple_frf
from viz import BLUE, GREY, VERMILION, look, new_figure, save

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


assembly = receptance(0.0, 1.0, {"A:z": (0.4, "z"), "A:ry": (0.4, "ry")})
part = receptance(0.4, 1.0, {"P:z": (0.4, "z"), "P:ry": (0.4, "ry")})
rest = decouple_frf(assembly, part, [("A:z", "P:z"), ("A:ry", "P:ry")]).frf
alone = receptance(0.0, 0.4, {"A:z": (0.4, "z"), "A:ry": (0.4, "ry")})

with look():
    ax = new_figure(height=3.4).add_subplot(xlabel="frequency [Hz]", ylabel="receptance [m/N]", yscale="log")
    ax.plot(frequency, np.abs(assembly.H[:, 0, 0]), color=GREY, linewidth=0.9, label="assembly, 1 m")
    ax.plot(
        frequency, np.abs(alone.H[:, 0, 0]), color=BLUE, linewidth=3, alpha=0.4, label="inner 0.4 m alone"
    )
    ax.plot(frequency, np.abs(rest.H[:, 0, 0]), "--", color=VERMILION, label="decoupled")
    ax.legend()
print(f"picture in {save(ax.figure, Path(tempfile.mkdtemp()) / 'decoupled.png')}")
error = np.abs(rest.H / alone.H - 1).max()
print(f"decoupled FRFs and those of the rest alone differ by {error:.1e}")

assert error < 1e-5
