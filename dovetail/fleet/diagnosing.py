"""Full diagnoses of the units that are most probably outliers, with the population's parameters as priors."""

import hashlib
import time
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from dovetail.file.contents import Study
from dovetail.fleet.population import Population
from dovetail.fleet.run import JOURNAL, Triaged, settings_of
from dovetail.fleet.triage import Fleet
from dovetail.pipeline import diagnose_study
from dovetail.units.folder import Journal, Record, alone_in, read_records
from dovetail.units.outcome import Outcome
from dovetail.units.pool import Pool
from dovetail.units.work import Step, work_through
from updating.inference.parameters import Nuisance


@dataclass(frozen=True, slots=True, eq=False)
class Priors:
    """The fleet with the mean and scatter of its population.

    Attributes
    ----------
    fleet : Fleet
    values : mapping of (effect, parameter) to float
        Means of the uncertain parameters.
    nuisances : tuple of Nuisance
        With the scatter over the units.
    """

    fleet: Fleet
    values: dict[tuple[str, str], float]
    nuisances: tuple[Nuisance, ...]

    @classmethod
    def of(cls, triaged: Triaged) -> "Priors":
        """Return the priors of one more unit of a population: its scatter, and the error of its mean."""
        p: Population = triaged.population
        problem = triaged.fleet.problem
        regular = float((1 - p.probability).sum())
        values, nuisances = {}, []
        prior = problem.function((), (), problem.lines_up_to(np.inf, 2))
        for k, v in enumerate(prior.variables):
            # What the units' data do not determine stays as the study has it.
            unknown = (1 - float(p.determined[k])) * v.std**2
            std = float(np.sqrt(p.scatter[k, k] * (1 + 1 / regular) + max(unknown, 0.0)))
            value = v.to_value(float(p.mean[k]))
            values[v.ref] = value
            nuisances.append(Nuisance(*v.ref, std if v.log else std * v.scale / (abs(value) or 1.0)))
        return cls(triaged.fleet, values, tuple(nuisances))

    def study_of(self, file: Path) -> Study:
        """Return the study of a unit, at the population's mean and with its scatter."""
        study = self.fleet.study_of(file)
        known = study.model.values()
        values = {ref: value for ref, value in self.values.items() if ref in known}
        own = tuple(n for n in self.nuisances if (n.effect, n.parameter) in known)
        return replace(study, model=study.model.with_values(values), nuisances=own)


def diagnose_unit(priors: Priors, file: str) -> Record:
    """Diagnose a unit; return its verdict, findings and faults."""
    from dovetail.report import words

    begun = time.process_time()
    d = diagnose_study(priors.study_of(Path(file)))
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
        "faults": [words.fault_text(f) for f in d.faults],
        "cpu_seconds": time.process_time() - begun,
    }


def diagnose_outliers(
    triaged: Triaged, n: int, folder: Path, pool: Pool, say: Callable[[Step], None] = lambda step: None
) -> tuple[dict[Path, Record], tuple[Outcome, ...]]:
    """Diagnose the units with the highest odds of being outliers.

    Parameters
    ----------
    triaged : Triaged
    n : int
        At most so many; a unit that is more probably regular is not diagnosed.
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
    priors, settings = Priors.of(triaged), settings_of(triaged.fleet)
    key = _digest(p)
    with alone_in(folder, "fleet"):
        records = [r for r in read_records(folder / JOURNAL, settings) if r.get("population") == key]
        done: dict[str, Record] = {r["file"]: r for r in records}
        units = [f for f in wanted if f not in done]
        with closing(Journal(folder / JOURNAL, settings)) as journal:

            def keep(outcome: Outcome) -> None:
                if not outcome.failure:
                    done[outcome.unit] = {**outcome.value, "population": key}
                    journal.add(done[outcome.unit])

            failures = work_through(
                pool, diagnose_unit, priors, units, keep, say, len(wanted) - len(units)
            )  # fmt: skip
    return {Path(f): done[f] for f in wanted if f in done}, failures


def _digest(p: Population) -> str:
    digest = hashlib.sha256()
    for array in (p.mean, p.scatter):
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()[:16]


def cause_text(record: Record) -> str:
    """Return what a diagnosis found, in a line."""
    found: Sequence[Any] = [*(f["text"] for f in record["findings"]), *record["faults"]]
    return "; ".join(found) or record["verdict"]
