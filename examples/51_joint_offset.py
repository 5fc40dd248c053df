"""A mount off the centre of mass: its offset couples translation and tilt."""

import tempfile
from pathlib import Path

import numpy as np

from fem import AddedMass, Joint, Mesh, Model, Support, assemble, solve_modes
from viz import BLUE, VERMILION, look, new_figure, save

mass, inertia, k, k_tilt = 12.0, 0.15, 4e5, 6e3  # kg, kg·m², N/m, N·m/rad
mesh = Mesh.of_points([[0, 0, 0], [0, 0, -0.3]])  # m: a block, and the ground below it
block = AddedMass(name="block", point=0, mass=mass, inertia=inertia * np.eye(3))
held = Support(name="ground", point=1), Support(name="plane", point=0, fixed=("y", "z", "rx", "rz"))


def frequencies(offset):
    """Compute the frequencies of the block on a mount at a distance above its centre [Hz]."""
    K = np.diag([k, 0, 0, 0, k_tilt, 0])
    mount = Joint(name="mount", point1=0, point2=1, location=np.array([0, 0, offset]), K=K)
    return solve_modes(assemble(Model(mesh, (block, *held, mount))), n=2).frequency


# The mount resists x + e θ: K = [[k, k e], [k e, k_tilt + k e²]], M = diag(m, J).
offset = np.linspace(-0.12, 0.12, 121)
scale = 1 / np.sqrt([mass, inertia])
stiffness = [np.array([[k, k * e], [k * e, k_tilt + k * e**2]]) * np.outer(scale, scale) for e in offset]
closed = np.sqrt(np.linalg.eigvalsh(stiffness)) / (2 * np.pi)
computed = np.array([frequencies(e) for e in offset[::12]])

with look():
    ax = new_figure(height=3.2).add_subplot(xlabel="offset of the mount [mm]", ylabel="frequency [Hz]")
    ax.plot(1e3 * offset, closed, color=BLUE, label=["closed form", "_"])
    ax.plot(1e3 * offset[::12], computed, "o", color=VERMILION, label=["model", "_"])
    ax.legend()
print(f"picture in {save(ax.figure, Path(tempfile.mkdtemp()) / 'offset.png')}")
low, high = 100 * (computed[-1] / computed[5] - 1)
print(f"an offset of 120 mm changes the frequencies by {low:.1f} % and {high:.1f} %")

assert np.allclose(computed, closed[::12], rtol=1e-9)
