"""Run cases, several at a time; write each as it ends, and go on where an earlier run stopped."""

import hashlib
import os
import time
import traceback
import warnings
from collections.abc import Callable, Sequence
from contextlib import closing
from functools import lru_cache
from pathlib import Path

import fem
import updating
from dovetail.units.folder import Journal, alone_in, read_records
from dovetail.units.outcome import Outcome
from dovetail.units.pool import Pool, ThisProcess
from dovetail.units.work import Step, work_through
from dovetail.validation.cases import Case, CaseSettings, draw_case, kinds_of
from dovetail.validation.hidden import MODAL_SETS, SETS
from dovetail.validation.judging import Record, is_known, judge, judge_evidence
from dovetail.validation.modal_cases import run_modal_case
from fem.effects import candidate_kinds
from updating.diagnosis.diagnose import diagnose

CASES_FILE = "cases.jsonl"


class ValidationError(ValueError):
    """A case that cannot be asked for."""


Task = tuple[str, int]
"""Set and index."""

Say = Callable[[Record, Step], None]
"""Called after each case with its record and how far the work is."""


@lru_cache(maxsize=1)
def program() -> str:
    """Return a short fingerprint of the code that finds effects."""
    digest = hashlib.sha256()
    for package in (fem, updating):
        for file in sorted(Path(package.__path__[0]).rglob("*.py")):
            digest.update(file.read_bytes())
    return digest.hexdigest()[:12]


def run_case(settings: CaseSettings, task: Task) -> Record:
    """Draw a case, diagnose it and judge the diagnosis; a failure is a record with its traceback."""
    from threadpoolctl import threadpool_limits

    set_name, index = task
    begun = time.perf_counter()
    said: list[warnings.WarningMessage] = []
    try:
        with threadpool_limits(1), warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            if set_name in MODAL_SETS:
                record = run_modal_case(settings, set_name, index)
            else:
                case = draw_case(settings, set_name, index)
                drawn = time.perf_counter() - begun
                record = _judged(case)
                record["drawing_seconds"] = drawn
    except Exception:
        kinds = kinds_of(settings, set_name, index)
        record = {
            "case": f"{set_name}:{index}",
            "set": set_name,
            "index": index,
            "hidden": [{"kind": k} for k in kinds],
            "known": all(is_known(k) for k in kinds),
            "outcome": "failed",
            # Records are kept with the project: where it lay when they were made says nothing.
            "traceback": traceback.format_exc().replace(f"{Path(__file__).parents[2]}{os.sep}", ""),
            "seconds": time.perf_counter() - begun,
        }
    record["warnings"] = sorted({str(w.message) for w in said})
    record["program"] = program()
    return record


def _judged(case: Case) -> Record:
    """Diagnose a case and judge the diagnosis."""
    exclude = tuple(k for k in case.exclude if k in candidate_kinds())
    begun = time.process_time()
    diagnosis = diagnose(
        case.model,
        [case.measurement],
        case.nuisances,
        exclude=exclude,
        model_error=0.0,  # the truth is made of beams
        baseline=case.baseline,
    )
    cpu = time.process_time() - begun
    record = judge(case, diagnosis) | {"cpu_seconds": cpu}
    if diagnosis.searched is not None:
        record["evidence"] = judge_evidence(case, diagnosis, diagnosis.searched, record)
    return record


def plan(cases: int, nulls: int, sets: Sequence[str]) -> tuple[Task, ...]:
    """Return all cases of some sets, taken in turn, so that an early stop has some of each.

    Raises
    ------
    ValidationError
        For a set that does not exist.
    """
    for name in sets:
        if name not in SETS:
            msg = f"there is no set '{name}'; there are {', '.join(SETS)}"
            raise ValidationError(msg)
    size = {name: nulls if name.endswith("null") else cases for name in sets}
    largest = max(size.values(), default=0)
    return tuple((name, i) for i in range(largest) for name in sets if i < size[name])


def parse_case(text: str) -> Task:
    """Read ``123`` or ``null:123``.

    Raises
    ------
    ValidationError
        If it is neither.
    """
    name, _, number = text.rpartition(":")
    name = name or "single"
    if name not in SETS or not number.isdigit():
        msg = f"'{text}' is not a case; give a number, or one of {', '.join(SETS)} with one, as null:3"
        raise ValidationError(msg)
    return name, int(number)


def validate(
    settings: CaseSettings,
    tasks: Sequence[Task],
    folder: Path,
    *,
    pool: Pool = ThisProcess(),  # noqa: B008 - frozen
    say: Say = lambda record, step: None,
) -> list[Record]:
    """Run the cases that a folder does not hold yet; return the records of all that were asked for.

    Parameters
    ----------
    settings : CaseSettings
    tasks : sequence of (str, int)
    folder : Path
        Made if it is not there; one JSON line for each case is added to its ``cases.jsonl``.
    pool : Pool
        Computes the cases.
    say : callable
        Told of each case.

    Raises
    ------
    FolderError
        If the folder holds cases of other settings, or another run computes in it.
    """
    with alone_in(folder, "validate"):
        file, known = folder / CASES_FILE, settings.as_dict()
        by_task = {(r["set"], r["index"]): r for r in read_records(file, known)}
        open_ = [t for t in tasks if t not in by_task]

        def keep(outcome: Outcome) -> None:
            record = _ended(settings, outcome) if outcome.failure else outcome.value
            journal.add(record)
            by_task[outcome.unit] = record

        with closing(Journal(file, known)) as journal:
            work_through(
                pool,
                run_case,
                settings,
                open_,
                keep,
                lambda step: say(by_task[step.outcome.unit], step),
                len(tasks) - len(open_),
            )
        return [by_task[t] for t in tasks]


def _ended(settings: CaseSettings, outcome: Outcome) -> Record:
    """Return the record of a case that gave none: its process has ended, for example."""
    name, index = outcome.unit
    kinds = kinds_of(settings, name, index)
    return {
        "case": f"{name}:{index}",
        "set": name,
        "index": index,
        "hidden": [{"kind": k} for k in kinds],
        "known": all(is_known(k) for k in kinds),
        "outcome": "failed",
        "traceback": outcome.traceback or outcome.failure,
        "seconds": 0.0,
        "warnings": [],
        "program": program(),
    }
