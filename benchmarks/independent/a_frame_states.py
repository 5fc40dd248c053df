"""Make two states of an A-frame by OpenSees: python -m benchmarks.independent.a_frame_states FOLDER

`frf.uff` and `nominal.json` are those of the first state. Files of later states are named after the change.
Both states share errors of the model: stiffness and density of some members, feet that give way, and lumps
of welds. A study of two states names frf.uff under `[[baseline.measurements]]`. Runs under the peers'
interpreter.
"""

import sys
from pathlib import Path

import numpy as np

from benchmarks.independent.a_frames import Hidden, accelerances, nominal_of
from benchmarks.independent.casefiles import with_noise, write_files

SENSORS = [
    ("L1a", 1.0), ("L2a", 1.0), ("L3a", 0.5), ("L3a", 1.0), ("L4a", 1.0), ("L1b", 0.5), ("L1b", 1.0),
    ("L2b", 1.0), ("L3b", 1.0), ("R1_12", 0.5),
]  # fmt: skip
EXCITATIONS = ("8x", "5y")
FREQUENCY = np.arange(5.0, 300.25, 0.5)
SEED = 77
MODULUS = {"R1_12": 1.05, "R2_23": 0.94, "L1a": 0.97, "L3b": 1.03}
DENSITY = {"R1_34": 1.06}
FEET = {("110", "ry"): 4e4, ("120", "rx"): 6e4, ("130", "ry"): 5e4, ("140", "rx"): 4e4}
WELDS = (("L1a", 1.0, 0.02), ("L2a", 1.0, 0.03), ("L3b", 1.0, 0.025))
STATES = {
    "frf": {},
    "again": {},
    "mass": {"masses": (*WELDS, ("L1b", 0.5, 0.012))},
    "foot": {"feet": FEET | {("140", "ry"): 8e4}},
}
"""What each state has besides the common errors; the same structure is measured again, too."""


def write(folder):
    """Write all states."""
    rng = np.random.default_rng(SEED)
    nominal = nominal_of("a-frame-states", rng, SENSORS, EXCITATIONS, FREQUENCY)
    common = {"modulus": MODULUS, "density": DENSITY, "feet": FEET, "masses": WELDS}
    for name, change in STATES.items():
        H = accelerances(Hidden(**(common | change)), nominal["sensors"], EXCITATIONS, FREQUENCY)
        write_files(folder, nominal, FREQUENCY, with_noise(H, rng), f"{name}.uff")


if __name__ == "__main__":
    write(Path(sys.argv[1]))
