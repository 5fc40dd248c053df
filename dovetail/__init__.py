"""Dovetail: a frame model compared with measurements, and the physical effect that it lacks.

    load_study(path) → Study ─ frf, modes, compare, diagnose, candidates, add, fit, save, run

:class:`Study` is the facade. Behind it are the packages `fem` (models and their analyses), `updating`
(measurements, fits, diagnosis), `joint` (identification and synthesis of joints) and `viz` (pictures). The
command line does the same: ``dovetail run study.toml``, or ``main(["run", "study.toml"])``.
"""

from typing import TYPE_CHECKING

from fem.lazy import names_on_use

if TYPE_CHECKING:
    from dovetail.cli import main
    from dovetail.disk.output import OutputError
    from dovetail.file.table import StudyError
    from dovetail.study import Study, load_study
else:
    __getattr__, __dir__ = names_on_use(__name__)

__all__ = ["OutputError", "Study", "StudyError", "load_study", "main"]
