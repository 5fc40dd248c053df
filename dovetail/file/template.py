"""The study that ``dovetail new`` writes."""

import re
from importlib import resources
from pathlib import Path

import numpy as np

from dovetail.file.config import load_study
from dovetail.file.uncertain import assumed_tables
from fem.analysis.frf import FRF
from fem.analysis.frf_solver import compute_frf
from fem.effects.added_mass import AddedMass
from fem.io import write_npz
from fem.system import assemble
from updating.measurement.measurement import sensor_rows


def write_template(folder: Path) -> None:
    """Write ``study.toml`` and ``frf.npz`` into a folder.

    The FRFs are those of the study's own model with a mass that the study does not know, and 1 % noise.
    """
    text = resources.files("dovetail.file").joinpath("templates/study.toml").read_text(encoding="utf-8")
    text = text.replace("{uncertain}", assumed_tables())
    file = folder / "study.toml"
    file.write_text(re.sub(r"\[\[measurements\]\]\n(?:[^\n]+\n)*", "", text), encoding="utf-8")
    study = load_study(file)
    mesh = study.model.mesh
    point, _ = mesh.nearest_point(np.array([0.1, 0.0, 0.4]))
    model = study.model.with_effect(AddedMass(name="hidden", point=point, mass=0.15))
    frequency = np.arange(5.0, 500.5, 1.0)
    H = compute_frf(
        assemble(model, reciprocal=False),
        frequency,
        sensor_rows(model, study.sensors),
        sensor_rows(model, study.excitations),
    ).H
    rng = np.random.default_rng(1)
    noise = (rng.standard_normal(H.shape) + 1j * rng.standard_normal(H.shape)) / np.sqrt(2)
    H = H * (1 + 0.01 * noise)
    names = [tuple(s.name for s in part) for part in (study.sensors, study.excitations)]
    write_npz(folder / "frf.npz", FRF.from_arrays(frequency, H, "accelerance", *names))
    file.write_text(text, encoding="utf-8")
