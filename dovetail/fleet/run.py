"""Triage of all units of a fleet on a pool of workers; a run that was stopped continues in its folder."""

import hashlib
import os
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dovetail.fleet.population import Population, PopulationError, find_population
from dovetail.fleet.triage import Fleet, Triage, triage
from dovetail.units.folder import Journal, alone_in, read_records
from dovetail.units.outcome import Outcome
from dovetail.units.pool import Pool
from dovetail.units.program import digest_of
from dovetail.units.work import WorkStep, work_through
from fem.io.atomic import replacing

JOURNAL, UNITS = "fleet.jsonl", "units"
"""File of the settings, and folder of the units' fits."""

Unit = tuple[str, int, int]


@dataclass(frozen=True, slots=True, eq=False)
class Triaged:
    """All units of a fleet.

    Attributes
    ----------
    fleet : Fleet
    files : tuple of Path
        Of the units that could be read.
    units : tuple of Triage
    population : Population
    failures : tuple of Outcome
        Units that could not be read or fitted, with reasons.
    """

    fleet: Fleet
    files: tuple[Path, ...]
    units: tuple[Triage, ...]
    population: Population
    failures: tuple[Outcome, ...]


def run_fleet(
    fleet: Fleet,
    files: Sequence[Path],
    folder: Path,
    pool: Pool,
    say: Callable[[WorkStep], None] = lambda step: None,
) -> Triaged:
    """Triage the units that a folder does not hold yet; return all with their population.

    Parameters
    ----------
    fleet : Fleet
    files : sequence of Path
        FRFs of each unit.
    folder : Path
        Made if it is not there.
    pool : Pool
    say : callable
        Told of each unit.

    Raises
    ------
    FolderError
        If the folder holds another fleet, or another run computes there.
    PopulationError
        For too few units that could be read.
    """
    units = [_unit(file) for file in files]
    settings = settings_of(fleet)
    with alone_in(folder, "fleet"):
        read_records(folder / JOURNAL, settings)
        (folder / UNITS).mkdir(exist_ok=True)
        with closing(Journal(folder / JOURNAL, settings)):
            pass
        missing = [u for u in units if not _file(folder, u).is_file()]

        def keep(outcome: Outcome) -> None:
            if not outcome.failure:
                with replacing(_file(folder, outcome.unit)) as scratch, scratch.open("wb") as out:
                    np.savez(out, **outcome.value)

        failures = work_through(pool, triage, fleet, missing, keep, say, len(units) - len(missing))
        kept = [u for u in units if _file(folder, u).is_file()]
        found = tuple(_read(_file(folder, u)) for u in kept)
    if not found:
        msg = f"no unit could be used; the first failed with: {failures[0].failure}"
        raise PopulationError(msg)
    population = find_population(
        np.stack([t.x for t in found]),
        np.stack([t.covariance for t in found]),
        fleet.problem.function((), (), fleet.lines).prior().std,
        np.stack([t.residual for t in found]),
    )
    return Triaged(fleet, tuple(Path(u[0]) for u in kept), found, population, failures)


def settings_of(fleet: Fleet) -> dict[str, str]:
    """Return the settings that a folder of results must have been started with."""
    return {"fleet": _digest(fleet)}


def _unit(file: Path) -> Unit:
    status = file.stat()
    return os.fspath(file.absolute()), status.st_size, status.st_mtime_ns


def _file(folder: Path, unit: Unit) -> Path:
    key = hashlib.sha256(repr(unit).encode()).hexdigest()[:16]
    return folder / UNITS / f"{Path(unit[0]).stem[:40]}-{key}.npz"


def _read(file: Path) -> Triage:
    with np.load(file) as a:
        words = tuple(str(w) for w in a["warnings"])
        return Triage(a["x"], a["covariance"], a["residual"], words)


def _digest(fleet: Fleet) -> str:
    """Return a short hash of all on which a unit's fit depends, besides its own file."""
    arrays = (fleet.frequency, fleet.start.solution.x, fleet.common)
    return digest_of(arrays, fleet.text, fleet.problem.reduced.system)
