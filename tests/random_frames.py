"""Random frames of four members with five wrong parameters, and FRFs of the truth on a finer mesh."""

from dataclasses import dataclass

import numpy as np

import fem
from fem.effects import MemberStiffness

NOISE, RATIO = 0.01, 0.01
RHO = ("frame", "rho:steel")


@dataclass(frozen=True, eq=False)
class RandomFrame:
    """A frame as it is thought to be, what it is, and a measurement of that."""

    model: fem.Model
    refs: list
    truth: np.ndarray
    frf: fem.FRF
    outputs: list
    inputs: list
    mesh_error: float
    """Largest relative error of a natural frequency in the band by the mesh, as predicted [-]."""


def random_frame(seed, elements=12, n_lines=300, modal=False):
    """Return a clamped chain of three members with a fourth one on it, in space.

    Its damping is that of a loss factor, which is the engine of fits' own form between resonances, or modal.
    """
    rng = np.random.default_rng(seed)
    steps = np.eye(3)[[2, 0, 1, 2]] * rng.uniform(0.4, 0.7, (4, 1)) + 0.08 * rng.standard_normal((4, 3))
    points = [np.zeros(3), steps[0], steps[0] + steps[1], steps[0] + steps[1] + steps[2]]
    points.append(points[2] + steps[3])
    lines = [[0, 1], [1, 2], [2, 3], [2, 4]]
    names = [f"m{i}" for i in range(4)]
    mesh = fem.Mesh.from_lines(points, lines, {n: [i] for i, n in enumerate(names)})
    width, height = rng.uniform(0.02, 0.03, 2)
    part = fem.MemberProperties(
        fem.Material("steel", 210e9, 7850.0), fem.Section.rectangle(width, height), theory="euler-bernoulli"
    )
    effects = (
        fem.Frame(members=dict.fromkeys(names, part)),
        fem.Support(name="foot", point=0),
        *(MemberStiffness(name=f"d{i}", member=n, change=0.0) for i, n in enumerate(names)),
    )
    model = fem.Model(mesh.split(elements), effects, fem.Damping.modal(0.7 * RATIO))
    refs = [*((f"d{i}", "change") for i in range(4)), RHO]
    wrong = rng.uniform(0.1, 0.2, 5) * rng.choice([-1, 1], 5)
    truth = np.append(wrong[:4], 7850 * (1 + wrong[4]))
    real = model.with_mesh(mesh.split(2 * elements)).with_values(dict(zip(refs, truth, strict=True)))
    real = real.with_damping(fem.Damping.modal(RATIO) if modal else fem.Damping.structural(2 * RATIO))
    system = fem.assemble(real)
    frequency = fem.solve_modes(system, n=8).frequency
    lines = np.linspace(0.5 * frequency[0], 1.05 * frequency[6], n_lines)
    # corners keep their numbers when the mesh is split
    outputs = [(p, d) for p in (1, 2, 3, 4) for d in "xyz"]
    inputs = [(3, "x"), (4, "y")]
    H = fem.compute_frf(system, lines, outputs, inputs, tolerance=1e-7).H
    a, b = rng.standard_normal((2, *H.shape))
    frf = fem.FRF.from_arrays(lines, H * (1 + NOISE * (a + 1j * b)))
    omega, length = 2 * np.pi * lines[-1], max(np.linalg.norm(steps, axis=1)) / elements
    inertia = min(width, height) ** 2 / 12
    bending = omega**2 * 7850 * 1.2 / (210e9 * 0.8 * inertia) * length**4 / 1440
    torsion = omega**2 * 7850 * 1.2 / (80e9 * 0.8 * 0.5) * length**2 / 24
    return RandomFrame(model, refs, truth, frf, outputs, inputs, bending + torsion)
