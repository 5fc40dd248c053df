"""A fan: critical speeds by the Campbell diagram, and its response to unbalance beside them.

The study is `examples/fan`, an overhung wheel on bearings that are softer upright than sideways.
"""

import json
import tempfile
from pathlib import Path

import numpy as np

from dovetail import main

study = Path(__file__).parent / "fan" / "study.toml"
folder = Path(tempfile.mkdtemp())


def run(command, *options):
    """Run a command of dovetail with a picture, and return its numbers."""
    file, picture = folder / f"{command}.json", folder / f"{command}.png"
    print(f"$ dovetail {command} study.toml {' '.join(options)}")
    arguments = [command, str(study), *options, "--quiet", "--picture", str(picture), "--json", str(file)]
    assert main(arguments) == 0
    return json.loads(file.read_text(encoding="utf-8"))


campbell = run("campbell", "--speeds", "0:4000:21", "--number", "6")
critical = [c for c in campbell["critical_speeds"] if c["order"] == 1]
for c in critical:
    print(f"critical at {c['speed_rpm']:.1f} 1/min, {c['whirl_sense'] or 'no tilt'}")

unbalance = run("unbalance", "--speeds", "0:4000:401")
rpm, amplitude = np.array(unbalance["speed_rpm"]), np.array(unbalance["amplitude_m"])
for sensor, column in zip(unbalance["sensors"], amplitude.T, strict=True):
    print(f"{sensor}: {1e6 * column.max():.1f} µm at {rpm[column.argmax()]:.0f} 1/min")

# The wheel moves most near a critical speed; far above all, its centre of mass stays where it is, and the
# shaft's centre moves by the eccentricity of 5 µm.
nearest = min(abs(c["speed_rpm"] - rpm[amplitude[:, 0].argmax()]) for c in critical)
print(f"the largest response is {nearest:.1f} 1/min from a critical speed")

assert nearest < 10.0
assert abs(amplitude[-1, 0] / (1e-4 / 19.6) - 1) < 0.2
