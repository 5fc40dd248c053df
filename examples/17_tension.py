"""Tension raises a beam's frequencies, and compression lowers them to zero."""

import tempfile
from pathlib import Path

import numpy as np

from fem import Frame, Material, MemberProperties, Mesh, Model, Section, Support, assemble, solve_modes
from viz import BLUE, VERMILION, look, new_figure, save

steel, flat, length = Material("steel", E=210e9, rho=7850.0), Section.rectangle(b=0.040, h=0.005), 1.2  # m
mesh = Mesh.from_lines([[0, 0, 0], [length, 0, 0]], [[0, 1]], {"beam": [0]}).refined(counts={"beam": 24})
ends = [Support(name=f"end {p}", point=p, fixed=("x", "y", "z", "rx", "rz")[p:]) for p in (0, 1)]
euler = np.pi**2 * steel.E * flat.Iy / length**2  # N


def frequencies(force):
    """Compute the first two frequencies under an axial force [Hz]."""
    beam = MemberProperties(steel, flat, theory="euler-bernoulli", pretension=force)
    return solve_modes(assemble(Model(mesh, (Frame(members={"beam": beam}), *ends))), n=2).frequency


# f = n² π/2 √(E I / ρ A L⁴) √(1 + N / n² N_Euler)
order = np.array([1, 2])
ratio = np.linspace(-0.98, 3.0, 200)
unloaded = order**2 * np.pi / 2 * np.sqrt(steel.E * flat.Iy / (steel.rho * flat.A * length**4))
closed = unloaded * np.sqrt(1 + ratio[:, None] / order**2)
computed = np.array([frequencies(r * euler) for r in ratio[::22]])

with look():
    ax = new_figure(height=3.2).add_subplot(xlabel="axial force / Euler's load [-]", ylabel="frequency [Hz]")
    for k, colour in enumerate((BLUE, VERMILION)):
        ax.plot(ratio, closed[:, k], color=colour, label=f"bending {k + 1}, closed form")
        ax.plot(ratio[::22], computed[:, k], "o", color=colour, markersize=4, label="model")
    ax.legend(ncols=2, loc="upper center", bbox_to_anchor=(0.5, 0.72))
print(f"picture in {save(ax.figure, Path(tempfile.mkdtemp()) / 'frequencies.png')}")
error = np.abs(computed / closed[::22] - 1).max()
print(f"from {computed[0, 0]:.2f} to {computed[-1, 0]:.2f} Hz, within {error:.0e} of the closed form")

assert error < 1e-4
