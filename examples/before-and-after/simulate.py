"""Print the natural frequencies of the bracket before and after: E is 2 % off, and 60 g are added later."""

from pathlib import Path

import numpy as np

from dovetail import load_study
from fem import assemble, first_modes

N = 8
"""Modes that are measured."""
NOISE = 2e-4
"""Relative standard deviation of a frequency."""


def main() -> None:
    """Print both lists for study.toml."""
    study = load_study(Path(__file__).parent / "study.toml")
    new = study.model.with_values({("frame", "E:steel"): 0.98 * 210e9})
    (mass,) = (e for e in study.candidates(kinds="point_mass") if e.name == "point_mass:arm")
    rng = np.random.default_rng(1)
    for model in (new, new.with_effect(mass.with_values(mass=0.06, position=0.30))):
        f = first_modes(assemble(model), N).frequency[:N] * (1 + NOISE * rng.standard_normal(N))
        print([float(f"{x:.6g}") for x in f])


if __name__ == "__main__":
    main()
