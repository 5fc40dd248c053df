"""Many units of one structure: bands of a model that scatters, and the unit of a fleet unlike the others.

The commands are those of the command line; the measured units are simulated.
"""

import json
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from dovetail import load_study, main
from fem import FRF
from fem.effects import SprungMass
from fem.io import write_npz

path = Path(__file__).parent / "tuned-absorber" / "study.toml"
folder = Path(tempfile.mkdtemp())
study, rng = load_study(path), np.random.default_rng(7)


def run(command, picture, *options):
    """Run a command of dovetail into a folder with a picture, and return its numbers."""
    out, file = folder / command, folder / f"{command}.json"
    assert main([command, str(path), *map(str, options), "--out", str(out), "--json", str(file)]) == 0
    print(f"picture in {out / picture}")
    return json.loads(file.read_text(encoding="utf-8"))


# One model with 200 draws of its uncertain parameters: bands of frequencies and FRFs.
run("ensemble", "bands.png", "--samples", 200, "--start", 0.3, "--stop", 1.2, "--step", 0.01)

# Twenty masts whose steel scatters by 1 %. The absorber of number 11 is tuned 3 % too low.
frequency, files = np.arange(0.3, 1.2, 0.005), []
top = study.model.mesh.point_names["top"]
low = SprungMass.tuned("absorber", top, 46.0, 0.97 * 0.579, 0.127, ("x",))
for k in range(20):
    model = study.model.without_effect("absorber").with_effect(low) if k == 11 else study.model
    model = model.with_values({("frame", "E:steel"): 210e9 * np.exp(0.01 * rng.normal())})
    H = replace(study, model=model).frf(frequency).H
    H = H * (1 + 0.01 * (rng.normal(size=H.shape) + 1j * rng.normal(size=H.shape)))
    files.append(folder / f"mast-{k:02d}.npz")
    write_npz(files[-1], FRF.from_arrays(frequency, H, "accelerance", ("top",), ("top",)))
first, second = run("fleet", "fleet.png", *files)["units"][:2]
print(f"{Path(first['file']).name} is an outlier with probability {first['probability']:.3f}")

assert Path(first["file"]) == files[11]
assert second["probability"] < 0.1
assert first["probability"] > 0.9
