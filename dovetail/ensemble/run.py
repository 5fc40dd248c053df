"""Samples and checks on a pool of workers, in a folder in which a run that was stopped continues."""

import shutil
from collections.abc import Callable, Iterable, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dovetail.ensemble.quantiles import Quantiles, quantiles
from dovetail.ensemble.samples import Checked, SampledModel, compute, counted_frfs
from dovetail.units.folder import FolderError, Journal, alone_in, read_records
from dovetail.units.outcome import Outcome
from dovetail.units.pool import Pool
from dovetail.units.program import digest_of
from dovetail.units.work import WorkStep, work_through
from fem.array_types import Bools, Floats
from fem.io.atomic import replacing

BATCH = 50
"""Samples of one unit of work [-]."""
JOURNAL, SAMPLES = "ensemble.jsonl", "samples"
"""File of the settings and checks, and folder of the samples."""


@dataclass(frozen=True, slots=True, eq=False)
class Ensemble:
    """Bands of a model with uncertain parameters.

    Attributes
    ----------
    model : SampledModel
    n : int
        Samples.
    values : ndarray (n, n_par)
        Of the uncertain parameters [SI].
    frequency : Quantiles of (3, n_modes)
        Of the elastic natural frequencies in rising order [Hz].
    levels : Quantiles of (3, n_freq, n_out, n_in)
        Of ln |H|.
    counted : ndarray of bool (n_out, n_in)
        FRFs that symmetry does not make zero.
    checks : tuple of Checked
        Errors of the reduced basis.
    failures : tuple of Outcome
        Units that failed.
    """

    model: SampledModel
    n: int
    values: Floats
    frequency: Quantiles
    levels: Quantiles
    counted: Bools
    checks: tuple[Checked, ...]
    failures: tuple[Outcome, ...]


def run_ensemble(
    model: SampledModel,
    n: int,
    n_checks: int,
    folder: Path,
    pool: Pool,
    say: Callable[[WorkStep], None] = lambda step: None,
) -> Ensemble:
    """Compute the samples and checks that a folder does not hold yet; return the bands of all.

    Parameters
    ----------
    model : SampledModel
    n : int
        Samples.
    n_checks : int
        How many of them are solved by the full model as well.
    folder : Path
        Made if it is not there.
    pool : Pool
    say : callable
        Told of each unit.

    Raises
    ------
    FolderError
        If the folder holds another ensemble, another run computes there, the disk has no room for it, or
        no sample could be computed.
    """
    settings = {"ensemble": _digest(model), "seed": model.seed}
    batches = [("samples", k, min(k + BATCH, n)) for k in range(0, n, BATCH)]
    with alone_in(folder, "ensemble"):
        known = read_records(folder / JOURNAL, settings)
        checks = {r["sample"]: Checked(**r) for r in known}
        (folder / SAMPLES).mkdir(exist_ok=True)
        units = [("check", k, k + 1) for k in range(min(n_checks, n)) if k not in checks]
        units += [u for u in batches if not _file(folder, u).is_file()]
        _require_room(folder, model, sum(last - first for kind, first, last in units if kind == "samples"))
        with closing(Journal(folder / JOURNAL, settings)) as journal:

            def keep(outcome: Outcome) -> None:
                if outcome.failure:
                    return
                if isinstance(outcome.value, Checked):
                    journal.add(asdict(outcome.value))
                    checks[outcome.value.sample] = outcome.value
                    return
                with replacing(_file(folder, outcome.unit)) as scratch, scratch.open("wb") as file:
                    np.savez(file, **outcome.value)

            done = len(batches) + min(n_checks, n) - len(units)
            failures = work_through(pool, compute, model, units, keep, say, done)
        files = [f for u in batches if (f := _file(folder, u)).is_file()]
        if not files:
            msg = f"no sample could be computed; the first failed with: {failures[0].failure}"
            raise FolderError(msg)
        kept = [checks[k] for k in sorted(checks) if k < n_checks]
        return _bands(model, files, tuple(kept), failures)


def _bands(
    model: SampledModel, files: Sequence[Path], checks: tuple[Checked, ...], failures: tuple[Outcome, ...]
) -> Ensemble:
    values, frequency = (_joined(files, lambda a, k=key: a[k]) for key in ("values", "frequency"))
    n_out, n_in = model.n_ends
    value, error = np.zeros((2, 3, len(model.frequency), n_out, n_in))
    middle = np.zeros((len(model.frequency), n_out, n_in))
    for i in range(n_out):  # one sensor at a time: all samples of all FRFs may not fit into memory
        found = quantiles(_joined(files, lambda a, i=i: a["levels"][:, :, i]))
        value[:, :, i], error[:, :, i] = found.value, found.error
        middle[:, i] = found.value[1]
    bands = Quantiles(value, error)
    return Ensemble(
        model, len(values), values, quantiles(frequency), bands, counted_frfs(middle), checks, failures
    )


def _joined(files: Iterable[Path], part: Callable[[Any], Floats]) -> Floats:
    out = []
    for file in files:
        with np.load(file) as arrays:
            out.append(part(arrays))
    return np.concatenate(out)


def _file(folder: Path, unit: tuple[str, int, int]) -> Path:
    _, first, last = unit
    return folder / SAMPLES / f"{first:07d}-{last:07d}.npz"


def _digest(model: SampledModel) -> str:
    """Return a short hash of all on which a sample depends, the program included."""
    unc, damping = model.uncertainty, model.uncertainty.damping
    arrays = [model.frequency, model.outputs, model.inputs, unc.knots, damping.frequency, damping.ratio]
    words = [unc.refs, [(u.mean, u.std) for u in unc.unknowns], unc.damping_std, model.kind]
    words += [damping.loss_factor, damping.alpha, damping.beta]
    return digest_of(arrays, words, model.reduced.system)


def _require_room(folder: Path, model: SampledModel, n: int) -> None:
    """Refuse samples for which the disk has no room.

    Raises
    ------
    FolderError
    """
    values = len(model.frequency) * int(np.prod(model.n_ends))
    need, free = 4 * n * values, shutil.disk_usage(folder).free
    if need > free:
        msg = (
            f"{folder}: {n} samples of {values} values need {need / 1e9:.3g} GB, and the disk has "
            f"{free / 1e9:.3g} GB; give a larger --step, or fewer --samples"
        )
        raise FolderError(msg)
