"""A frame of two members with a few sensors, and FRFs of it with a mass that its study does not know."""

import numpy as np

from dovetail import load_study
from fem.analysis.frf import FRF
from fem.analysis.frf_solver import compute_frf
from fem.effects.added_mass import PointMass
from fem.io import write_npz
from fem.system import assemble
from updating.measurement.measurement import sensor_rows

STUDY = """
[study]
name = "bent <bar>"
description = "Two members & a hidden mass"

[points]
foot = [0, 0, 0]
knee = [0, 0, 0.5]
tip = [0.4, 0, 0.5]

[members.post]
from = "foot"
to = "knee"
material = "steel"
section = { shape = "rectangle", b = 0.03, h = 0.012 }
elements = 6

[members.arm]
from = "knee"
to = "tip"
material = "steel"
section = { shape = "rectangle", b = 0.03, h = 0.012 }
elements = 6

[materials.steel]
E = 210e9
rho = 7850
nu = 0.3

[[supports]]
point = "foot"

[damping]
modal = 0.01

[[sensors]]
member = "post"
position = 0.25
name = "P"
direction = "x"

[[sensors]]
point = "knee"
name = "K"
direction = "x"

[[sensors]]
point = "tip"
name = "T"
direction = "z"

[[sensors]]
member = "arm"
position = 0.2
name = "A"
direction = "z"

[[excitations]]
sensor = "T"

[[excitations]]
sensor = "K"

[candidates]
kinds = ["point_mass", "member_stiffness"]

[fit]
held_out = ["K", "sensor P"]
"""

MEASURED = """
[[measurements]]
file = "frf.npz"
"""


def write_study(folder, mass=0.25, at=0.3):
    """Write the study and FRFs of it with a mass that it does not know."""
    file = folder / "study.toml"
    file.write_text(STUDY, encoding="utf-8")
    study = load_study(file)
    hidden = PointMass(name="hidden", member="arm", position=at, mass=mass)
    model = study.model.with_effect(hidden) if mass else study.model
    frequency = np.arange(4.0, 400.0, 2.0)
    rows = [sensor_rows(study.model, part) for part in (study.sensors, study.excitations)]
    H = compute_frf(assemble(model), frequency, *rows).H
    rng = np.random.default_rng(3)
    H = H * (1 + 0.003 * (rng.standard_normal(H.shape) + 1j * rng.standard_normal(H.shape)))
    names = [[s.name for s in part] for part in (study.sensors, study.excitations)]
    write_npz(folder / "frf.npz", FRF.from_arrays(frequency, H, "accelerance", *names))
    file.write_text(STUDY + MEASURED, encoding="utf-8")
    return file
