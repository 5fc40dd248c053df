"""A small mass lowers the modes that move at its place: a mass that is shifted along a beam."""

import tempfile
from pathlib import Path

import numpy as np

import fem
from viz import BLUE, GREEN, VERMILION, look, new_figure, save

steel, flat, length = fem.Material("steel", E=210e9, rho=7850.0), fem.Section.rectangle(0.05, 0.005), 1.0  # m
mesh = fem.Mesh.from_lines([[0, 0, 0], [length, 0, 0]], [[0, 1]], {"beam": [0]}).refined(counts={"beam": 20})
ends = [fem.Support(name=f"end {p}", point=p, fixed=("x", "y", "z", "rx", "rz")[p:]) for p in (0, 1)]
beam = fem.MemberProperties(steel, flat, theory="euler-bernoulli")
model = fem.Model(mesh, (fem.Frame(members={"beam": beam}), *ends))
share = 0.01  # of the beam's mass


def frequencies(*positions):
    """Compute the first three frequencies with masses along the beam [Hz]."""
    mass = share * steel.rho * flat.A * length  # kg
    masses = [fem.PointMass(name=f"{x}", member="beam", position=x, mass=mass) for x in positions]
    return fem.solve_modes(fem.assemble(model.with_effect(*masses)), n=3).frequency


def rayleigh(position):
    """Return the change of the frequencies: the kinetic energy grows by 2 m/M sin²(nπx/L)."""
    return 1 / np.sqrt(1 + 2 * share * np.sin(np.pi * np.outer(position, [1, 2, 3]) / length) ** 2) - 1


place = np.linspace(0.05, 0.95, 19)
change = np.array([frequencies(x) for x in place]) / frequencies() - 1

with look():
    figure, x = new_figure(height=3.4), np.linspace(0.0, length, 200)
    ax = figure.add_subplot(xlabel="position of the mass [m]", ylabel="change [%]", ylim=(-1.1, 0.35))
    for k, colour in enumerate((BLUE, VERMILION, GREEN)):
        ax.plot(place, 100 * change[:, k], "o", color=colour, markersize=4, label=f"mode {k + 1}")
        ax.plot(x, 100 * rayleigh(x)[:, k], color=colour, label="Rayleigh")
    ax.legend(ncols=3, loc="upper center")
print(f"picture in {save(figure, Path(tempfile.mkdtemp()) / 'change.png')}")
low, closed = 100 * change[9, 0], 100 * rayleigh(0.5)[0, 0]
print(f"1 % of mass at the middle changes mode 1 by {low:.3f} %, Rayleigh {closed:.3f} %")

assert np.abs(change - rayleigh(place)).max() < 3 * share**2
