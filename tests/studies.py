"""Study files that tests write, the studies that are read from them, and their problems for fits."""

import shutil
from pathlib import Path

from dovetail import load_study
from dovetail.file import NEEDS
from dovetail.pipeline import fit_problem

__all__ = ["fit_problem", "study_file", "study_from"]

CROSS_BEAM = Path(__file__).parents[1] / "examples" / "cross-beam"


def study_file(folder, text):
    """Write a study's text to study.toml in a folder; return the path."""
    path = folder / "study.toml"
    path.write_text(text, encoding="utf-8")
    return path


def study_from(folder, text, needs=NEEDS):
    """Write a study's text to study.toml in a folder; return the study with the parts that it needs."""
    return load_study(study_file(folder, text), needs)


def cross_beam(folder, more=""):
    """Copy the study of the cross-beam to a folder, with more at its end; return the path."""
    for file in CROSS_BEAM.iterdir():
        if not file.name.startswith("."):
            shutil.copy(file, folder)
    return study_file(folder, (CROSS_BEAM / "study.toml").read_text(encoding="utf-8") + more)


def cross_beam_below_1600_hz(folder):
    """Copy the study with half of its band, whose fits take two thirds of the time."""
    return cross_beam(folder, "\n[fit]\nband = [2, 1600]\n")
