"""Work on many units that do not need one another: cases, samples, tested structures."""

from typing import TYPE_CHECKING

from fem.lazy import names_on_use

if TYPE_CHECKING:
    from dovetail.units.folder import (
        LOCK_FILE,
        FolderError,
        Journal,
        Record,
        alone_in,
        json_lines,
        read_records,
    )
    from dovetail.units.outcome import PROCESS_ENDED, Outcome, PoolError, outcome_of
    from dovetail.units.pool import Pool, ThisProcess, pool_of
    from dovetail.units.program import fingerprint
    from dovetail.units.work import WorkStep, duration, work_through
else:
    __getattr__, __dir__ = names_on_use(__name__)
