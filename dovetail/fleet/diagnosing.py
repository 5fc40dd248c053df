"""Full diagnoses of the units that are most probably outliers: of their change from the typical unit."""

import time
from collections.abc import Callable, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

from dovetail.fleet.run import JOURNAL, Triaged, settings_of
from dovetail.fleet.typical import TypicalUnit
from dovetail.units.folder import Journal, Record, alone_in, read_records
from dovetail.units.outcome import Outcome
from dovetail.units.pool import Pool
from dovetail.units.program import digest_of
from dovetail.units.work import WorkStep, work_through


def diagnose_unit(typical: TypicalUnit, file: str) -> Record:
    """Diagnose a unit; return its verdict, findings and faults."""
    from dovetail.report import words

    start_time = time.process_time()
    d = typical.diagnosis_of(Path(file))
    return {
        "file": file,
        "verdict": d.verdict,
        "reason": d.reason,
        "findings": [
            {
                "name": f.effect.name,
                "kind": f.effect.kind,
                "text": words.finding_text(f),
                "twins": [{"name": t.name, "kind": t.kind} for t in f.twins],
            }
            for f in d.findings
        ],
        "faults": [words.fault_text(f) for f in d.every_fault],
        "cpu_seconds": time.process_time() - start_time,
    }


def diagnose_outliers(
    triaged: Triaged, n: int, folder: Path, pool: Pool, say: Callable[[WorkStep], None] = lambda step: None
) -> tuple[dict[Path, Record], tuple[Outcome, ...]]:
    """Diagnose the units with the highest odds of being outliers.

    Parameters
    ----------
    triaged : Triaged
    n : int
        Largest number; a unit that is more probably regular is not diagnosed.
    folder : Path
        Diagnoses with the same population are kept there.
    pool : Pool
    say : callable
        Told of each unit.

    Returns
    -------
    dict of Path to record
    tuple of Outcome
        Diagnoses that failed.
    """
    p = triaged.population
    wanted = [str(triaged.files[k]) for k in p.order[:n] if p.odds[k] > 0]
    settings = settings_of(triaged.fleet)
    key = digest_of((p.mean, p.scatter))
    with alone_in(folder, "fleet"):
        records = [r for r in read_records(folder / JOURNAL, settings) if r.get("population") == key]
        done: dict[str, Record] = {r["file"]: r for r in records}
        units = [f for f in wanted if f not in done]
        with closing(Journal(folder / JOURNAL, settings)) as journal:

            def keep(outcome: Outcome) -> None:
                if not outcome.failure:
                    done[outcome.unit] = {**outcome.value, "population": key}
                    journal.add(done[outcome.unit])

            failures: tuple[Outcome, ...] = ()
            if units:
                typical = TypicalUnit.of(triaged)
                failures = work_through(
                    pool, diagnose_unit, typical, units, keep, say, len(wanted) - len(units)
                )
    return {Path(f): done[f] for f in wanted if f in done}, failures


def cause_text(record: Record) -> str:
    """Return what a diagnosis found, in a line."""
    found: Sequence[Any] = [*(f["text"] for f in record["findings"]), *record["faults"]]
    return "; ".join(found) or record["verdict"]
