"""A portal on a moving base: transmissibility, an accelerogram, a response spectrum, and random vibration.

The study and its CSV files are those of the page *Loads and time*. The commands run here from Python.
"""

import json
import tempfile
from pathlib import Path

import numpy as np

from dovetail import main

portal = Path(__file__).parent / "loaded-portal"
folder = Path(tempfile.mkdtemp())


def run(command, *options, picture=True):
    """Run a command of dovetail with a picture, and return its numbers."""
    file, drawn = folder / f"{command}.json", ["--picture", str(folder / f"{command}.png")] * picture
    print(f"$ dovetail {command} study.toml {' '.join(Path(option).name for option in options)}")
    arguments = [command, str(portal / "study.toml"), *options, *drawn, "--quiet", "--json", str(file)]
    assert main(arguments) == 0
    return json.loads(file.read_text(encoding="utf-8"))


damped = run("complex", "--number", "3", picture=False)["modes"]
print("damped frequencies", *(f"{mode['damped_frequency_Hz']:.3f}" for mode in damped), "Hz")

base = run("base", "--motion", "x", "--start", "0.1", "--stop", "30", "--step", "0.1")
gain = np.hypot(base["real"], base["imaginary"])[:, :, 0]
for sensor, column in zip(base["sensors"], gain.T, strict=True):
    print(f"{sensor}: largest gain {column.max():.1f} at {base['frequency_Hz'][column.argmax()]:.1f} Hz")

run("transient", "--excitation", str(portal / "quake.csv"), "--relative")
run("spectrum", "--spectrum", str(portal / "design.csv"), "--number", "6")
random = run("psd", "--psd", str(portal / "shaker.csv"))
for sensor, rms in random["rms"].items():
    print(f"{sensor}: {rms:.3f} m/s² root mean square")

# A base that moves slowly takes the sensors in its direction along: the gain is 1 at low frequency.
along = [gain[0, k] for k, name in enumerate(base["sensors"]) if gain[0, k] > 0.5]
print(f"gain at {base['frequency_Hz'][0]:g} Hz: {along[0]:.6f}")

assert along[0] > 1.0  # towards the resonance
assert abs(along[0] - 1) < 1e-3
