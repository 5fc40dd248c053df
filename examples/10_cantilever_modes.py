"""Natural frequencies of a cantilever: the closed form, and the predicted error of the elements."""

import tempfile
from pathlib import Path

import numpy as np

from fem import Frame, Material, MemberProperties, Mesh, Model, Section, Support, assemble, solve_modes
from viz import GREY, VERMILION, look, new_figure, save

steel = Material("steel", E=210e9, rho=7850.0)
bar = Section.rectangle(b=0.030, h=0.012)  # m
length, n = 0.8, 10

mesh = Mesh.from_lines([[0, 0, 0], [length, 0, 0]], [[0, 1]], {"bar": [0]}).refined(counts={"bar": n})
beam = Frame(members={"bar": MemberProperties(steel, bar, theory="euler-bernoulli")})
model = Model(mesh, (beam, Support(name="wall", point=0)))
modes = solve_modes(assemble(model), n=8)

# Roots of cosh(βL) cos(βL) = -1; bending about the weaker axis y, then about z.
beta = np.array([1.8751040687, 4.6940911330, 7.8547574382]) / length
omega = np.outer(beta**2, np.sqrt(steel.E * np.array([bar.Iy, bar.Iz]) / (steel.rho * bar.A)))
closed_form = omega / (2 * np.pi)
computed = np.array([np.abs(modes.frequency[:, None] - f).argmin(axis=0) for f in closed_form.T]).T
error = modes.frequency[computed] / closed_form - 1

# Cubic elements of length h with consistent mass are too stiff by (βh)⁴/1440, to leading order.
predicted = np.tile((beta * length / n) ** 4 / 1440, (2, 1)).T
with look():
    ax = new_figure(height=3.2).add_subplot(xlabel="elements in a wave, 2π/βh", ylabel="error [-]")
    per_wave = 2 * np.pi * n / (beta * length)
    ax.loglog(per_wave, predicted[:, 0], color=GREY, label="predicted, (βh)⁴/1440")
    ax.loglog(per_wave, error, "o", color=VERMILION, label=["computed", "_"])
    ax.legend()
print(f"picture in {save(ax.figure, Path(tempfile.mkdtemp()) / 'error.png')}")
for row, f, e, p in zip(("1st", "2nd", "3rd"), closed_form, error, predicted, strict=True):
    print(f"{row} bending: {f[0]:8.3f} and {f[1]:8.3f} Hz, error {e[0]:.2e}, predicted {p[0]:.2e}")

assert np.allclose(error[1:], predicted[1:], rtol=0.05)
assert np.abs(error[0]).max() < 1e-6
