"""Studies: a structure, what was measured on it and what is uncertain, in one file; and the command line."""

from dovetail.file.config import Study, load_study
from dovetail.file.table import StudyError

__all__ = ["Study", "StudyError", "load_study"]
