"""A crack lowers a frequency: a simply supported beam with an open crack at its middle."""

import tempfile
from pathlib import Path

import numpy as np
from scipy.optimize import brentq

from fem import Frame, Material, MemberProperties, Mesh, Model, Section, Support, assemble, solve_modes
from updating import propose
from viz import VERMILION, look, new_figure, save

steel, flat, length = Material("steel", E=210e9, rho=7850.0), Section.rectangle(b=0.030, h=0.020), 0.6  # m
mesh = Mesh.from_lines([[0, 0, 0], [length, 0, 0]], [[0, 1]], {"beam": [0]}).refined(counts={"beam": 9})
beam = Frame(members={"beam": MemberProperties(steel, flat, theory="euler-bernoulli")})
ends = [Support(name=f"end {p}", point=p, fixed=("x", "y", "z", "rx", "rz")[p:]) for p in (0, 1)]
model = Model(mesh, (beam, *ends))
crack = next(e for e in propose(model, ["crack"]) if e.direction == "ry")  # at the middle unless moved


def first(compliance):
    """Compute the first frequency with a crack [Hz]."""
    cracked = model.with_effect(crack.with_values(compliance=compliance))
    return solve_modes(assemble(cracked), n=1).frequency[0]


# The compliance c by depth is that of Ostachowicz and Krawczuk (J. Sound Vib. 150, 1991). With
# Γ = c E I / L and z = βL/2, modes that are symmetric about the crack fulfil Γ z (tan z - tanh z) = 2.
depth = np.linspace(0.02, 0.5, 25)
compliance = np.array([crack.compliance_of(share) for share in depth])
gamma = compliance * steel.E * flat.Iy / length
roots = [brentq(lambda z, G=G: G * z * (np.tan(z) - np.tanh(z)) - 2, 0.1, np.pi / 2 - 1e-12) for G in gamma]
closed = (2 * np.array(roots) / np.pi) ** 2
computed = np.array([first(c) for c in compliance[::4]]) / first(0.0)

with look():
    figure = new_figure(height=3.2)
    ax = figure.add_subplot(xlabel="crack depth [% of height]", ylabel="frequency / intact [-]")
    ax.plot(100 * depth, closed, label="closed form")
    ax.plot(100 * depth[::4], computed, "o", color=VERMILION, label="model")
    ax.legend()
print(f"picture in {save(figure, Path(tempfile.mkdtemp()) / 'frequency.png')}")
print(f"half the height cut: {100 * computed[-1]:.2f} % of the frequency, {100 * closed[-1]:.2f} % by hand")

assert np.allclose(computed, closed[::4], rtol=1e-4)
