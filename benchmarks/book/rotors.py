"""Published rotors: Friswell, Penny, Garvey and Lees, Dynamics of Rotating Machines (2010), section 5.9.

The numbers are those that ROSS publishes for the same meshes (R. Timbó et al., J. Open Source Softw. 5,
2020): examples 3 and 4 of its user guide, and its tests of critical speeds.
"""

import numpy as np

from benchmarks.book.entry import Problem, Quantity
from fem import AddedMass, Joint, Material, Section, assemble, solve_campbell, solve_complex_modes
from fem.analysis.complex_modes import whirl
from fem.effects import Spin
from tests.frames import beam, fix

E, G = 211e9, 81.2e9
STEEL = Material("steel", E, 7810.0, nu=E / (2 * G) - 1)
SHAFT = Section.circle(0.05, nu=STEEL.nu)


def disc(mesh, x, diameter):
    """Return a disc of 70 mm on the shaft, its centre at x."""
    bore, width = 0.05, 0.07
    mass = np.pi / 4 * STEEL.rho * width * (diameter**2 - bore**2)
    squares = diameter**2 + bore**2
    across = mass * (3 * squares + 4 * width**2) / 48
    inertia = np.diag([mass * squares / 8, across, across])
    return AddedMass(name=f"disc at {x}", point=point(mesh, x), mass=mass, inertia=inertia)


def bearing(mesh, x, ky, kz):
    p = point(mesh, x)
    K = np.diag([0, ky, kz, 0, 0, 0])
    return Joint(name=f"bearing at {x}", point1=p, location=mesh.points[p], K=K)


def point(mesh, x):
    return int(np.argmin(abs(mesh.points[:, 0] - x)))


def rotor(n, discs, bearings, ky=1e6, kz=1e6):
    """Return a shaft of n elements of 0.25 m, with discs and bearings at places along it."""
    mesh = beam(n, 0.25 * n).mesh
    effects = [bearing(mesh, x, ky, kz) for x in bearings]
    effects += [disc(mesh, x, diameter) for x, diameter in discs.items()]
    effects.append(fix(0, ("x", "rx")))
    return beam(n, 0.25 * n, section=SHAFT, material=STEEL, theory="timoshenko", spin=1.0, effects=effects)


TWO_DISCS = {0.5: 0.28, 1.0: 0.35}


def at_4000(kz):
    """Return the lowest damped frequencies of bending at 4000 turns a minute [rad/s], and their whirl."""
    model = rotor(6, TWO_DISCS, (0.0, 1.5), kz=kz)
    turning = model.with_effect(Spin(name="spin", speed=4000 * 2 * np.pi / 60))
    modes = solve_complex_modes(assemble(turning, reciprocal=False), 9)
    sense = whirl(turning, modes.poles, modes.shapes)
    bending = np.flatnonzero(np.isfinite(sense))[:6]
    return modes.poles[bending].imag, sense[bending]


def critical_speeds(discs):
    """Return the lowest critical speeds of bending [rad/s]."""
    found = solve_campbell(rotor(10, discs, (0.5, 2.0)), np.linspace(0, 300, 7), 8)
    return np.array([c.speed for c in found.critical if np.isfinite(c.whirl)])[:6]


def _critical(name, title, discs, printed):
    more = {"allowance": 1e-8, "reason": "rounding of both programs"}
    return Problem(
        name=name,
        title=title,
        quantities=(Quantity(name="critical speeds", unit="rad/s", printed=printed, **more),),
        compute=lambda: [critical_speeds(discs)],
    )


PROBLEMS = (
    Problem(
        name="Friswell 5.9.1",
        title="shaft with two discs on equal bearings",
        quantities=(
            Quantity(
                name="frequencies at 4000 rpm",
                unit="rad/s",
                printed="85.389467 87.7958637 251.78460413 294.71333087 600.17936195 827.07536192",
                allowance=1e-9,
                reason="rounding of both programs",
            ),
        ),
        compute=lambda: [at_4000(1e6)[0]],
    ),
    Problem(
        name="Friswell 5.9.2",
        title="the same on bearings that differ in two directions",
        quantities=(
            Quantity(
                name="frequencies at 4000 rpm",
                unit="rad/s",
                printed="82.32547398 86.86369902 239.64228361 287.24958074 583.48782916 806.8872843",
                allowance=1e-9,
                reason="rounding of both programs",
            ),
        ),
        compute=lambda: [at_4000(0.8e6)[0]],
    ),
    _critical(
        "ROSS, discs at 1.0 and 1.5 m",
        "overhung shaft of 2.5 m",
        {1.0: 0.28, 1.5: 0.35},
        "86.10505193 86.60492546 198.93259257 207.97165539 244.95609413 250.53522782",
    ),
    _critical(
        "ROSS, discs at 1.25 and 2.5 m",
        "shaft of 2.5 m with a disc at its end",
        {1.25: 0.28, 2.5: 0.35},
        "61.52110644 63.72862198 117.49491374 118.55829416 233.83724523 236.40346235",
    ),
)
