"""Reduce a frame to two of its points: Guyan and Craig-Bampton against the full model."""

import tempfile
from pathlib import Path

import numpy as np

import fem
from fem.reduction import reduce_craig_bampton, reduce_guyan
from viz import BLUE, GREY, VERMILION, look, new_figure, save

points = [[0, 0, 0], [0, 0, 1.2], [0.9, 0, 1.2], [0.9, 0, 0]]  # m
mesh = fem.Mesh.from_lines(points, [[0, 1], [1, 2], [2, 3]], {"left": [0], "beam": [1], "right": [2]})
part = fem.MemberProperties(fem.Material("steel", E=210e9, rho=7850.0), fem.Section.rectangle(0.03, 0.02))
frame = fem.Frame(members=dict.fromkeys(mesh.members, part))
model = fem.Model(
    mesh.refined(size=0.1), (frame, fem.Support(name="a", point=0), fem.Support(name="b", point=3))
)

system = fem.assemble(model)
n = 16
full = fem.solve_modes(system, n=n).frequency
corners = [(p, d) for p in (1, 2) for d in ("x", "y", "z", "rx", "ry", "rz")]
reductions = {
    "Guyan": reduce_guyan(system, corners),
    "Craig-Bampton, 6 fixed modes": reduce_craig_bampton(system, corners, n_modes=6),
    "Craig-Bampton, 18 fixed modes": reduce_craig_bampton(system, corners, n_modes=18),
}

with look():
    ax = new_figure(height=3.4).add_subplot(xlabel="mode", ylabel="frequency / full - 1 [-]", yscale="log")
    errors = {}
    for (name, reduced), colour in zip(reductions.items(), (GREY, BLUE, VERMILION), strict=True):
        frequency = reduced.modes(n).frequency
        errors[name] = frequency / full[: len(frequency)] - 1
        ax.plot(np.arange(1, len(frequency) + 1), errors[name], "o-", markersize=4, color=colour, label=name)
    ax.legend()
print(f"picture in {save(ax.figure, Path(tempfile.mkdtemp()) / 'errors.png')}")
best = errors["Craig-Bampton, 18 fixed modes"]
print(f"30 coordinates of {system.n_free} give {n} frequencies within {100 * best.max():.3f} %")

# Rayleigh: a reduced model is a constrained one, so that none of its frequencies is too low.
assert min(e.min() for e in errors.values()) > -1e-9
assert best.max() < 0.01
