"""Run cases, several at a time; write each as it ends, and go on where an earlier run stopped."""

import hashlib
import json
import os
import time
import traceback
import warnings
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing, contextmanager
from functools import lru_cache
from pathlib import Path
from typing import Any, TextIO

import numpy as np

import fem
import updating
from dovetail.disk.locks import Lock, holder
from dovetail.validation.cases import Case, CaseSettings, draw_case, kinds_of
from dovetail.validation.hidden import MODAL_SETS, SETS
from dovetail.validation.judging import Record, is_known, judge, judge_evidence
from dovetail.validation.modal_cases import run_modal_case
from fem.effects import candidate_kinds
from fem.io.atomic import WriteError, replacing
from updating.diagnosis.diagnose import diagnose
from updating.inference.workers import process_pool

CASES_FILE = "cases.jsonl"
LOCK_FILE = ".lock"
"""File by which a run keeps others out of its folder, for as long as it lives."""


class ValidationError(ValueError):
    """A file of cases that belongs to another run, or a case that cannot be asked for."""


Task = tuple[str, int]
"""Set and index."""

Say = Callable[[Record, int, int, float], None]
"""Called after each case with its record, the number done, the number of all, and the seconds to go."""


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


def read_records(file: Path, settings: CaseSettings) -> list[Record]:
    """Return the cases of a file, and cut off a line that was not written to its end.

    Raises
    ------
    ValidationError
        If the file belongs to other settings.
    """
    if not file.exists():
        return []
    text = file.read_text(encoding="utf-8")
    whole = text[: text.rfind("\n") + 1]
    if whole != text:
        with replacing(file) as scratch:
            scratch.write_text(whole, encoding="utf-8")
    try:
        lines = [json.loads(line) for line in whole.splitlines()]
    except json.JSONDecodeError as reason:
        msg = f"{file}: line {reason.lineno} is not JSON ({reason.msg}); it is not a file of this command"
        raise ValidationError(msg) from None
    if not lines:
        return []
    have, want = lines[0].get("settings"), settings.as_dict()
    if have != want:
        known = have if isinstance(have, dict) else {}
        different = sorted(k for k in {*known, *want} if known.get(k) != want.get(k))
        msg = (
            f"{file} was begun with other settings ({', '.join(different)} differ"
            f"{'' if len(different) > 1 else 's'}); choose another folder"
        )
        raise ValidationError(msg)
    return lines[1:]


def validate(
    settings: CaseSettings,
    tasks: Sequence[Task],
    folder: Path,
    *,
    processes: int = 1,
    say: Say = lambda record, done, total, left: None,
) -> list[Record]:
    """Run the cases that a folder does not hold yet; return the records of all that were asked for.

    Parameters
    ----------
    settings : CaseSettings
    tasks : sequence of (str, int)
    folder : Path
        Made if it is not there; one JSON line for each case is added to its ``cases.jsonl``.
    processes : int
    say : callable
        Told of each case.

    Raises
    ------
    ValidationError
        If the folder holds cases of other settings, or another run computes in it.
    """
    with _alone_in(folder):
        return _validate(settings, tasks, folder, processes, say)


@contextmanager
def _alone_in(folder: Path) -> Iterator[None]:
    """Keep other runs out of a folder; its lock goes with the process, whichever way that ends."""
    folder.mkdir(parents=True, exist_ok=True)
    lock = Lock.take(folder / LOCK_FILE)
    if lock is None:
        who = holder(folder / LOCK_FILE)
        msg = f"{folder}: another validate computes here ({who}); wait for it, or choose another folder"
        raise ValidationError(msg)
    try:
        yield
    finally:
        lock.release()


def _validate(
    settings: CaseSettings, tasks: Sequence[Task], folder: Path, processes: int, say: Say
) -> list[Record]:
    """Run and record the cases that are missing, in a folder that no other run uses."""
    file = folder / CASES_FILE
    by_task = {(r["set"], r["index"]): r for r in read_records(file, settings)}
    open_ = [t for t in tasks if t not in by_task]
    begun, done = time.perf_counter(), len(tasks) - len(open_)
    with file.open("a", encoding="utf-8") as out, closing(_records(settings, open_, processes)) as records:
        if not by_task and file.stat().st_size == 0:
            _add(file, out, {"settings": settings.as_dict()})
        for n, record in enumerate(records, start=1):
            _add(file, out, _plain(record))
            by_task[record["set"], record["index"]] = record
            left = (time.perf_counter() - begun) / n * (len(open_) - n)
            say(record, done + n, len(tasks), left)
    return [by_task[t] for t in tasks]


def _add(file: Path, out: TextIO, record: Record) -> None:
    """Add a line to the file of cases."""
    try:
        out.write(json.dumps(record, ensure_ascii=False) + "\n")
        out.flush()
    except OSError as reason:  # the next run cuts off the part of the line that was written
        raise WriteError(reason, file, False) from reason


def _records(settings: CaseSettings, tasks: Sequence[Task], processes: int) -> Generator[Record]:
    if processes <= 1:
        for task in tasks:
            yield run_case(settings, task)
        return
    waiting = list(tasks)
    while waiting:
        running: dict[Future[Record], Task] = {}
        try:
            with process_pool(processes) as pool:
                while waiting or running:
                    while waiting and len(running) < processes:
                        task = waiting.pop(0)
                        running[pool.submit(run_case, settings, task)] = task
                    for future in wait(running, return_when=FIRST_COMPLETED).done:
                        record = future.result()
                        del running[future]
                        yield record
        except BrokenProcessPool:
            for task in running.values():  # one of these ended its process: each alone, to see which
                yield _alone(settings, task)


def _alone(settings: CaseSettings, task: Task) -> Record:
    try:
        with process_pool(1) as pool:
            return pool.submit(run_case, settings, task).result()
    except BrokenProcessPool:
        return {
            "case": f"{task[0]}:{task[1]}",
            "set": task[0],
            "index": task[1],
            "hidden": [{"kind": k} for k in kinds_of(settings, *task)],
            "known": all(is_known(k) for k in kinds_of(settings, *task)),
            "outcome": "failed",
            "traceback": "the process ended: out of memory, or stopped from outside",
            "seconds": 0.0,
            "warnings": [],
            "program": program(),
        }


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {k: _plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value
