"""Studies: a structure, what was measured on it and what is uncertain, in one file; and the command line."""

from study.config import Study, load_study
from study.table import StudyError

__all__ = ["Study", "StudyError", "load_study"]
