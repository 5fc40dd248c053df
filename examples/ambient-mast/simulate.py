"""Write wind.npz: eight minutes of the street light in the wind, with E 1.5 % low and a sign on the arm."""

from pathlib import Path

import numpy as np
from scipy.signal import lfilter

from dovetail import load_study
from fem import assemble, solve_modes
from updating import sensor_rows

RATE, DURATION = 50.0, 480.0
"""Samples a second, and length of the record [Hz, s]."""
ZETA, NOISE = 0.01, 0.02
"""Damping ratio of every mode, and noise of a channel over its root mean square [-]."""


def main() -> None:
    """Write the accelerations under random forces at the sensors as 16-bit counts."""
    folder = Path(__file__).parent
    study = load_study(folder / "study.toml", ("sensors",))
    (sign,) = (e for e in study.candidates(kinds="point_mass") if e.name == "point_mass:arm")
    model = study.model.with_values({("frame", "E:steel"): 0.985 * 210e9})
    model = model.with_effect(sign.with_values(mass=12.0, position=2.6))
    modes = solve_modes(assemble(model), max_frequency=RATE / 2)
    phi = np.asarray(sensor_rows(model, study.sensors) @ modes.shapes)
    rng = np.random.default_rng(4)
    n, still = int(RATE * DURATION), int(RATE * 60)
    forces = rng.standard_normal((n + still, len(phi)))
    y = sum(np.outer(acceleration(forces @ phi[:, k], f), phi[:, k]) for k, f in enumerate(modes.frequency))
    y = np.asarray(y)[still:]
    y += NOISE * y.std(axis=0) * rng.standard_normal(y.shape)
    counts = np.round(y * (32000 / np.abs(y).max())).astype(np.int16)
    np.savez_compressed(
        folder / "wind.npz", fs=np.array(RATE), channels=np.array([s.name for s in study.sensors]), acc=counts
    )


def acceleration(force: np.ndarray, frequency: float) -> np.ndarray:
    """Return the modal acceleration under a force that is constant over each sample."""
    omega, step = 2 * np.pi * frequency, 1 / RATE
    omega_d = omega * np.sqrt(1 - ZETA**2)
    e, c, s = np.exp(-ZETA * omega * step), np.cos(omega_d * step), np.sin(omega_d * step)
    # step response of the acceleration, e^{-ζωt} (cos ω_d t - ζω/ω_d sin ω_d t), differenced over a sample
    rise = [1.0, -e * (c + ZETA * omega / omega_d * s)]
    return np.asarray(lfilter(np.convolve(rise, [1, -1]), [1, -2 * e * c, e * e], force))


if __name__ == "__main__":
    main()
