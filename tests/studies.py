"""Study files that tests write, the studies that are read from them, and their problems for fits."""

from dovetail import load_study
from dovetail.file import NEEDS
from dovetail.pipeline import fit_problem

__all__ = ["fit_problem", "study_file", "study_from"]


def study_file(folder, text):
    """Write a study's text to study.toml in a folder; return the path."""
    path = folder / "study.toml"
    path.write_text(text, encoding="utf-8")
    return path


def study_from(folder, text, needs=NEEDS):
    """Write a study's text to study.toml in a folder; return the study with the parts that it needs."""
    return load_study(study_file(folder, text), needs)
