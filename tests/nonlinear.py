"""Crossed beams with a joint that depends on amplitude, vibrating steadily: a truth apart from the program.

The motion of the joint has its first and third harmonic. What its force is in each is found by going through
a period in time; the rest of the structure is linear, on a finer mesh, and solved directly at ω and 3ω.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import root

from fem import FRF, Damping, Joint, Model, assemble, compute_frf
from tests.frames import cross_beam
from updating import Measurement, Nuisance, Sensor, place_sensors

LOSS = 0.008
PHASES = 2 * np.pi * np.arange(64) / 64


@dataclass(frozen=True)
class Rig:
    """What an analyst has: a model, measurements at several levels of force, uncertain parameters."""

    model: Model
    measurements: tuple
    nuisances: tuple


def harmonics(force, motion):
    """Return the first and third harmonic of a force whose motion has these, amplitudes of e^{iωt}."""
    wave = np.exp(1j * np.outer((1, 3), PHASES))
    x = (motion[:, None] * wave).real.sum(axis=0)
    v = (1j * np.array([1, 3])[:, None] * motion[:, None] * wave).real.sum(axis=0)
    return 2 * (force(x, v) * wave.conj()).mean(axis=1)


def steady(force, level, g, h, start):
    """Return the joint's motion in two harmonics: δ_k = F h δ_k1 - g_k f_k, from a start (2,).

    With g_3 = 0 the motion is harmonic, as the describing function takes it to be.
    """
    drive = np.array([level * h, 0.0])
    size = max(abs(level * h), 1e-300)

    def off(x):
        d = (x[:2] + 1j * x[2:]) * size
        e = (d - drive + g * harmonics(force, d)) / size
        return np.concatenate([e.real, e.imag])

    x = start / size
    found = root(off, np.concatenate([x.real, x.imag]), tol=1e-10)
    return (found.x[:2] + 1j * found.x[2:]) * size, found.success


def make_rig(force, levels, *, noise=0.01, seed=0, direction="z", top=420.0, n_lines=240, third=True):
    """Return the crossed beams with ``force(x, v)`` beside the joint's spring, in one direction.

    Without ``third`` the joint moves harmonically.
    """
    rng = np.random.default_rng(seed)
    coarse, fine = cross_beam(0.05), cross_beam(0.025)
    points = [[-0.35, 0, 0], [-0.15, 0, 0], [0.2, 0, 0], [0.38, 0, 0]]
    points += [[0, -0.37, 0.01], [0, -0.2, 0.01], [0, 0.1, 0.01], [0, 0.3, 0.01]]
    sensors = tuple(
        Sensor(f"s{i + 1}", np.array(p, dtype=float), np.array([0.0, 0, 1]), "lower" if i < 4 else "upper")
        for i, p in enumerate(points)
    )
    model, truth = (m.with_mesh(place_sensors(m.mesh, sensors)) for m in (coarse, fine))
    values = {("frame", "E:steel"): 210e9 * 1.01, ("frame", "rho:steel"): 7850 * 0.995}
    truth = truth.with_values(values).with_damping(Damping.structural(LOSS))
    system = assemble(truth)
    (joint,) = truth.of_kind(Joint)
    dofs, B = joint.relative(truth)
    b = np.zeros(truth.n_dof)
    b[dofs] = B[("x", "y", "z", "rx", "ry", "rz").index(direction)]
    rows = np.zeros((len(sensors), truth.n_dof))
    for i, s in enumerate(sensors):
        rows[i, 6 * truth.mesh.nearest_point(s.point)[0] + 2] = 1.0
    drives = sensors[:1] + sensors[5:6]
    outputs, inputs = np.vstack([rows, b]), np.vstack([rows[[0, 5]], b])
    f = np.linspace(30.0, top, n_lines)
    H = compute_frf(system, f, outputs, inputs, "receptance", "direct").H
    g3 = compute_frf(system, 3 * f, b[None], b[None], "receptance", "direct").H[:, 0, 0] * third
    measurements = []
    for k, level in enumerate(levels):
        measured = np.empty((n_lines, len(sensors), 2), dtype=complex)
        for j in range(2):
            last = np.zeros(2, dtype=complex)
            for n in range(n_lines):
                g = np.array([H[n, -1, -1], g3[n]])
                motion, good = steady(force, level, g, H[n, -1, j], last)
                if not good:
                    start = np.array([level * H[n, -1, j], 0.0])
                    motion, good = steady(force, level, g, H[n, -1, j], start)
                last = motion
                pair = harmonics(force, motion)[0]
                measured[n, :, j] = H[n, :-1, j] - H[n, :-1, -1] * pair / level
        g = rng.standard_normal((2, *measured.shape)) * noise
        measured = measured * (1 + g[0] + 1j * g[1])
        frf = FRF.from_arrays(f, measured, "receptance", [s.name for s in sensors], [d.name for d in drives])
        measurements.append(Measurement(frf, sensors, drives, float(level), f"level {k + 1}"))
    nuisances = (Nuisance("frame", "E:steel", 0.02), Nuisance("frame", "rho:steel", 0.01))
    model = replace(model, damping=Damping.modal(LOSS / 2))
    return Rig(model, tuple(measurements), nuisances)
