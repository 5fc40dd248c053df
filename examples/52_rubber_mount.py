"""A rubber mount: its stiffness and loss depend on frequency, those of a spring do not."""

import tempfile
from pathlib import Path

import numpy as np

from fem import AddedMass, Joint, Mesh, Model, Support, Viscoelastic, Zener, assemble, compute_frf
from viz import BLUE, VERMILION, look, new_figure, save

mass, k = 8.0, 2e5  # kg, N/m
law = Zener(ratio=2.0, tau=5e-3)  # three times as stiff at high frequency; most loss at 1/(2π τ √3) = 18 Hz
mesh = Mesh.of_points([[0, 0, 0], [0, 0, -0.1]])  # m: a block, and the ground below it
block = AddedMass(name="block", point=0, mass=mass)
held = Support(name="ground", point=1), Support(name="guide", point=0, fixed=("x", "y", "rx", "ry", "rz"))
between = {"point1": 0, "point2": 1, "location": np.zeros(3), "K": np.diag([0, 0, k, 0, 0, 0])}
frequency = np.linspace(1.0, 150.0, 400)


def receptance(mount):
    """Compute the receptance of the block on a mount [m/N]."""
    system = assemble(Model(mesh, (block, *held, mount)))
    return compute_frf(system, frequency, [(0, "z")], [(0, "z")], "receptance").H[:, 0, 0]


rubber = receptance(Viscoelastic(name="rubber", law=law, **between))
spring = receptance(Joint(name="spring", eta=0.1, **between))
with look():
    ax = new_figure(height=3.4).add_subplot(xlabel="frequency [Hz]", ylabel="receptance [m/N]", yscale="log")
    ax.plot(frequency, np.abs(spring), color=BLUE, label="spring with a loss factor of 0.1")
    ax.plot(frequency, np.abs(rubber), color=VERMILION, label="rubber, of the same static stiffness")
    ax.legend()
print(f"picture in {save(ax.figure, Path(tempfile.mkdtemp()) / 'mount.png')}")

# H = 1 / (k (1 + r iωτ / (1 + iωτ)) - ω² m)
s = 2j * np.pi * frequency
closed = 1 / (k * (1 + law.ratio * s * law.tau / (1 + s * law.tau)) + s**2 * mass)
low, high = (frequency[np.abs(H).argmax()] for H in (spring, rubber))
error = np.abs(rubber / closed - 1).max()
print(f"the peak moves from {low:.1f} Hz to {high:.1f} Hz; within {error:.0e} of the closed form")

assert error < 1e-6
