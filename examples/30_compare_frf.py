"""Compare FRFs of a free beam with others whose difference is known: 4 % stiffer, or a wrong gain."""

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from fem import Damping, Frame, Material, MemberProperties, Mesh, Model, Section, assemble, compute_frf
from updating import compare
from viz import plot_frf, save

flat = Section.rectangle(b=0.040, h=0.010)  # m
mesh = Mesh.from_lines([[0, 0, 0], [1, 0, 0]], [[0, 1]], {"beam": [0]}).refined(counts={"beam": 40})
points = mesh.member_points("beam")[[0, 13, 27]]


def accelerance(frequency, E=70e9):
    """Compute the accelerances of the beam, hanging free, at three points for a force at the first."""
    frame = Frame(members={"beam": MemberProperties(Material("aluminium", E=E, rho=2700.0, nu=0.33), flat)})
    system = assemble(Model(mesh, (frame,), Damping.modal(0.005)))
    return compute_frf(system, frequency, [(p, "z") for p in points], [(points[0], "z")], "accelerance")


frequency = np.arange(20.0, 1000.0, 1.0)
measured = accelerance(frequency)

wrong = accelerance(frequency, E=1.04 * 70e9)
figure = plot_frf(measured, {"E 4 % high": wrong}, [(measured.outputs[0], measured.inputs[0])])
print(f"picture in {save(figure, Path(tempfile.mkdtemp()) / 'frf.png')}")

stiffer = compare(measured, wrong, bands=4)
print(f"E 4 % high:    {stiffer.total_db:.2f} dB, least FRAC {stiffer.frac.min():.3f}")
worst = np.nanmax(stiffer.error_db, axis=(1, 2))
for low, high, db in zip(stiffer.bands[:-1], stiffer.bands[1:], worst, strict=True):
    print(f"    {low:4.0f} to {high:4.0f} Hz: up to {db:.1f} dB")

# Frequencies go with √E and accelerances stay: on lines stretched by √1.04 nothing is left.
stretched = replace(accelerance(np.sqrt(1.04) * frequency, E=1.04 * 70e9), frequency=measured.frequency)
same = compare(measured, stretched)
print(f"lines stretched: {same.total_db:.1e} dB")

# FRAC is blind to a wrong gain, which the logarithmic error shows as it is.
gain = compare(measured, replace(measured, H=1.1 * measured.H))
print(f"gain 10 % high: {gain.total_db:.3f} dB, least FRAC {gain.frac.min():.6f}")

assert stiffer.frac.min() < 0.5
assert same.total_db < 1e-3
assert np.isclose(gain.total_db, 20 * np.log10(1.1))
assert np.isclose(gain.frac.min(), 1.0)
