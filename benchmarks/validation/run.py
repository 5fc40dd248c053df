"""Run cases, several at a time; write each as it ends, and go on where an earlier run stopped."""

import time
import warnings
from collections.abc import Callable, Sequence
from contextlib import closing
from pathlib import Path

from benchmarks.validation.cases import Case, CaseSettings, draw_case, kinds_of
from benchmarks.validation.hidden import MODAL_SETS
from benchmarks.validation.judging import Record, judge, judge_evidence
from benchmarks.validation.modal_cases import run_modal_case
from dovetail.units import (
    Journal,
    Outcome,
    Pool,
    ThisProcess,
    WorkStep,
    alone_in,
    fingerprint,
    read_records,
    work_through,
)
from updating import diagnose

CASES_FILE = "cases.jsonl"

Task = tuple[str, int]
"""Set and index."""


def run_case(settings: CaseSettings, task: Task) -> Record:
    """Draw a case, diagnose it and judge the diagnosis."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        if task[0] in MODAL_SETS:
            record = run_modal_case(settings, *task)
        else:
            start = time.perf_counter()
            case = draw_case(settings, *task)
            drawn = time.perf_counter() - start
            record = _judged(case) | {"drawing_seconds": drawn}
    messages = sorted({str(w.message) for w in caught})
    return record | {"warnings": messages, "program": fingerprint()}


def _judged(case: Case) -> Record:
    """Diagnose a case and judge the diagnosis."""
    start = time.process_time()
    diagnosis = diagnose(
        case.model,
        [case.measurement],
        case.nuisances,
        exclude=case.exclude,
        model_error=0.0,  # the truth is made of beams
        baseline=case.baseline,
    )
    cpu = time.process_time() - start
    record = judge(case, diagnosis) | {"cpu_seconds": cpu}
    if diagnosis.searched is not None:
        record["evidence"] = judge_evidence(case, diagnosis, diagnosis.searched, record)
    return record


def record_of(settings: CaseSettings, outcome: Outcome) -> Record:
    """Return the record of a case; one that raised an error, or ended its process, has failed."""
    if not outcome.failure:
        return outcome.value
    name, index = outcome.unit
    return {
        "case": f"{name}:{index}",
        "set": name,
        "index": index,
        "hidden": [{"kind": k} for k in kinds_of(settings, name, index)],
        "outcome": "failed",
        "traceback": outcome.traceback or outcome.failure,
        "seconds": 0.0,
        "program": fingerprint(),
    }


def plan(cases: int, nulls: int, sets: Sequence[str]) -> tuple[Task, ...]:
    """Return all cases of some sets, taken in turn, so that an early stop has some of each."""
    size = {name: nulls if name.endswith("null") else cases for name in sets}
    return tuple((name, i) for i in range(max(size.values())) for name in sets if i < size[name])


def validate(
    settings: CaseSettings,
    tasks: Sequence[Task],
    folder: Path,
    *,
    pool: Pool = ThisProcess(),  # noqa: B008 - frozen
    say: Callable[[Record, WorkStep], None] = lambda record, step: None,
) -> list[Record]:
    """Run the cases that a folder does not hold yet; return the records of all that were asked for.

    A line of JSON for each case is added to the folder's ``cases.jsonl``; ``say`` is called after each.

    Raises
    ------
    FolderError
        If the folder holds cases of other settings, or another run computes in it.
    """
    with alone_in(folder, "validation"):
        file, known = folder / CASES_FILE, settings.as_dict()
        by_task = {(r["set"], r["index"]): r for r in read_records(file, known)}
        missing = [t for t in tasks if t not in by_task]

        def keep(outcome: Outcome) -> None:
            by_task[outcome.unit] = record_of(settings, outcome)
            journal.add(by_task[outcome.unit])

        def ended(step: WorkStep) -> None:
            say(by_task[step.outcome.unit], step)

        with closing(Journal(file, known)) as journal:
            work_through(pool, run_case, settings, missing, keep, ended, len(tasks) - len(missing))
        return [by_task[t] for t in tasks]
