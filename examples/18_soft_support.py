"""A soft support: a cantilever whose foot turns, from hinged to clamped."""

import tempfile
from pathlib import Path

import numpy as np
from numpy import cos, cosh, sin, sinh
from scipy.optimize import brentq

from fem import Frame, Material, MemberProperties, Mesh, Model, Section, Support, assemble, solve_modes
from fem.effects import SupportFlexibility
from viz import VERMILION, look, new_figure, save

steel, flat, length = Material("steel", E=210e9, rho=7850.0), Section.rectangle(b=0.040, h=0.010), 0.5  # m
mesh = Mesh.from_lines([[0, 0, 0], [length, 0, 0]], [[0, 1]], {"beam": [0]}).refined(counts={"beam": 10})
beam = Frame(members={"beam": MemberProperties(steel, flat, theory="euler-bernoulli")})
clamped = Model(mesh, (beam, Support(name="foot", point=0)))


def first(stiffness):
    """Compute the first frequency with a rotational stiffness of the foot [Hz]."""
    soft = SupportFlexibility(name="soft", supports=("foot",), direction="ry", stiffness=stiffness)
    return solve_modes(assemble(clamped.with_effect(soft)), n=1).frequency[0]


def characteristic(z, kappa):
    """Return 0 at z = βL of a beam on a rotational spring of κ E I / L."""
    return kappa * (1 + cos(z) * cosh(z)) - z * (sin(z) * cosh(z) - cos(z) * sinh(z))


fixity = np.linspace(0.02, 0.98, 49)  # 1 / (1 + 3/κ): 0 hinged, 1 clamped
kappa = 3 * fixity / (1 - fixity)
roots = np.array([brentq(characteristic, 0.1, 1.9, args=(k,)) for k in kappa])
closed = roots**2 * np.sqrt(steel.E * flat.Iy / (steel.rho * flat.A)) / length**2 / (2 * np.pi)
computed = np.array([first(k * steel.E * flat.Iy / length) for k in kappa[::6]])

with look():
    ax = new_figure(height=3.2).add_subplot(xlabel="fixity of the foot [-]", ylabel="first frequency [Hz]")
    ax.plot(fixity, closed, label="closed form")
    ax.plot(fixity[::6], computed, "o", color=VERMILION, label="model")
    ax.legend()
print(f"picture in {save(ax.figure, Path(tempfile.mkdtemp()) / 'fixity.png')}")
print(f"at a fixity of {fixity[24]:.1f}: {computed[4]:.3f} Hz, closed form {closed[24]:.3f} Hz")

assert np.allclose(computed, closed[::6], rtol=1e-5)
