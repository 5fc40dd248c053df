"""Two modes in one peak: the complex mode indicator function (CMIF) of a mast of nearly equal axes."""

import tempfile
from pathlib import Path

import numpy as np

import fem
from viz import BLUE, GREY, VERMILION, look, new_figure, save

steel = fem.Material("steel", E=210e9, rho=7850.0)
mesh = fem.Mesh.from_lines([[0, 0, 0], [0, 0, 2.0]], [[0, 1]], {"mast": [0]}).refined(counts={"mast": 10})
mast = fem.MemberProperties(steel, fem.Section.hollow_rectangle(b=0.0500, h=0.0506, t=0.003))
effects = fem.Frame(members={"mast": mast}), fem.Support(name="foot", point=0)
system = fem.assemble(fem.Model(mesh, effects, fem.Damping.modal(0.01)))
close = fem.solve_modes(system, n=2).frequency

# Sensors and hammer are turned by 40° against the axes of the section: each FRF shows both modes.
turn, directions = np.radians(40), np.zeros((2, 6 * mesh.n_points))
directions[:, 6:8] = [[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]
frequency = np.arange(13.0, 15.0, 0.001)
H = fem.compute_frf(system, frequency, directions, directions).H

cmif = np.linalg.svd(H, compute_uv=False) ** 2


def peaks(curve):
    """Return the frequencies of the local maxima [Hz]."""
    return frequency[1:-1][(curve[1:-1] > curve[:-2]) & (curve[1:-1] > curve[2:])]


one, found = peaks(np.abs(H[:, 0, 0])), peaks(cmif[:, 0])
with look():
    ax = new_figure(height=3.4).add_subplot(xlabel="frequency [Hz]", ylabel="(m/s²/N)²", yscale="log")
    ax.plot(frequency, np.abs(H[:, 0, 0]) ** 2, color=GREY, linestyle="--", label="one FRF")
    for k, colour in enumerate((VERMILION, BLUE)):
        ax.plot(frequency, cmif[:, k], color=colour, label=f"CMIF {k + 1}")
        ax.axvline(close[k], color=GREY, linestyle=":", label="_")
    ax.legend()
print(f"picture in {save(ax.figure, Path(tempfile.mkdtemp()) / 'cmif.png')}")
print(f"{len(one)} peak in an FRF, {len(found)} in the CMIF: {found} Hz, modes at {close.round(3)} Hz")

assert len(one) == 1
assert np.abs(found - close).max() < 0.01
