"""A beam on an elastic foundation: springs along its length raise the low frequencies most."""

import tempfile
from pathlib import Path

import numpy as np

from fem import Frame, Joint, Material, MemberProperties, Mesh, Model, Section, Support, assemble, solve_modes
from viz import BLUE, VERMILION, look, new_figure, save

steel, strip, length = Material("steel", E=210e9, rho=7850.0), Section.rectangle(b=0.300, h=0.020), 3.0  # m
n = 32
mesh = Mesh.from_lines([[0, 0, 0], [length, 0, 0]], [[0, 1]], {"strip": [0]}).refined(counts={"strip": n})
ends = [Support(name=f"end {p}", point=p, fixed=("x", "y", "z", "rx", "rz")[p:]) for p in (0, 1)]
frame = Frame(members={"strip": MemberProperties(steel, strip, theory="euler-bernoulli")})


def frequencies(bedding):
    """Compute the first three frequencies on springs at each point, for a bedding in N/m of each metre."""
    K = np.diag([0, 0, bedding * length / n, 0, 0, 0])
    inner = mesh.member_points("strip")[1:-1].tolist()
    bed = [Joint(name=f"bed {p}", point1=p, location=mesh.points[p], K=K) for p in inner]
    return solve_modes(assemble(Model(mesh, (frame, *ends, *bed))), n=3).frequency


# ω² = (nπ/L)⁴ E I / ρA + k / ρA: the foundation adds the same to the square of every frequency.
bedding, mass, order = 1.2e6, steel.rho * strip.A, np.arange(1, 4)  # N/m², kg/m
closed = np.sqrt((order * np.pi / length) ** 4 * steel.E * strip.Iy / mass + bedding / mass) / (2 * np.pi)
free, bedded = frequencies(0.0), frequencies(bedding)

with look():
    ax = new_figure(height=3.2).add_subplot(xlabel="half waves", ylabel="frequency [Hz]", xticks=order)
    ax.bar(order - 0.2, free, 0.36, color=BLUE, alpha=0.6, label="without foundation")
    ax.bar(order + 0.2, bedded, 0.36, color=VERMILION, alpha=0.7, label="on the foundation")
    ax.hlines(closed, order + 0.02, order + 0.38, color="k", label="closed form")
    ax.legend()
print(f"picture in {save(ax.figure, Path(tempfile.mkdtemp()) / 'foundation.png')}")
print(
    f"mode 1: {free[0]:.2f} Hz without springs, {bedded[0]:.2f} Hz with them, closed form {closed[0]:.2f} Hz"
)

assert np.allclose(bedded, closed, rtol=1e-5)
