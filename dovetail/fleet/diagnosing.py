"""Full diagnoses of the units that are most probably outliers: of their change from the typical unit."""

import time
import warnings
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from dovetail.file.contents import StudyContents, without_held_out
from dovetail.fleet.population import GAUSSIAN, Population
from dovetail.fleet.run import JOURNAL, Triaged, settings_of
from dovetail.fleet.triage import PILOT, WIDER, Fleet
from dovetail.pipeline import fit_settings
from dovetail.units.folder import Journal, Record, alone_in, read_records
from dovetail.units.outcome import Outcome
from dovetail.units.pool import Pool
from dovetail.units.program import digest_of
from dovetail.units.work import WorkStep, work_through
from updating.diagnosis.carried import CHANGED, Between, CalibratedFrfs
from updating.diagnosis.diagnose import diagnose
from updating.diagnosis.diagnosis import Diagnosis
from updating.diagnosis.frf_states import calibrate_frfs
from updating.inference.belief import DISCREPANCY_MAX
from updating.inference.fit_result import FitResult
from updating.inference.parameters import Nuisance
from updating.measurement.measurement import Measurement

# The typical unit of a population, as the first of two states: outliers are diagnosed as changes from it


MEDIAN_ERROR = float(np.sqrt(np.pi / 2))
"""Standard error of the median of n normal values, times √n, over their standard deviation [-]."""


@dataclass(frozen=True, slots=True, eq=False)
class TypicalUnit:
    """A model that is calibrated on the typical unit, and what regular units differ from it by.

    Attributes
    ----------
    fleet : Fleet
    calibrated : CalibratedFrfs
    between : Between
        Scatter of the parameters and of damping; ``form_share`` is such that a right model may leave the rest
        that regular units have beyond noise.
    """

    fleet: Fleet
    calibrated: CalibratedFrfs
    between: Between

    @classmethod
    def of(cls, triaged: Triaged) -> "TypicalUnit":
        """Calibrate the study's model on the typical unit of a population."""
        fleet, p = triaged.fleet, triaged.population
        study = fleet.study_of(triaged.files[int(p.order[-1])])
        mean = _at_mean(fleet, p)
        model = study.model.with_values({r: v for r, v in mean.values.items() if r in study.model.values()})
        calibrated = calibrate_frfs(
            model, typical_measurement(triaged), study.nuisances, **fit_settings(study)
        )
        return cls(fleet, calibrated, between_units(triaged, study))

    def diagnosis_of(self, file: Path) -> Diagnosis:
        """Find the effects by which a unit differs from the typical one beyond the usual scatter."""
        study = self.fleet.study_of(file)
        return diagnose(
            study.model,
            [without_held_out(study, study.measurements[0])],
            kinds=study.kinds,
            exclude=study.exclude,
            baseline=self.calibrated,
            between=self.between,
            **fit_settings(study),
        )


def typical_measurement(triaged: Triaged) -> Measurement:
    """Return the FRFs of the typical unit: those of the mean parameters, less the median error of the model.

    The median is of ln(computed / measured) of the least probable outliers, each at its own parameters, so
    that the scatter of resonances does not blur it.
    """
    fleet, p = triaged.fleet, triaged.population
    files = [triaged.files[int(k)] for k in p.order[::-1][:PILOT]]
    rests = [fleet.rest_of(fleet.study_of(file)) for file in files]
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "All-NaN", RuntimeWarning)
        parts = np.stack([[r.real, r.imag] for r in rests])
        median = np.nanmedian(parts, axis=0)
        spread = GAUSSIAN * np.nanmedian(np.abs(parts - median), axis=(0, 1))
    known = np.isfinite(median).all(axis=0)
    common = np.where(known, median[0] + 1j * median[1], 0.0)
    data = fleet.problem.data
    H, frf = fleet.problem.receptance(_at_mean(fleet, p)) * np.exp(-common), data.measurement.frf
    return replace(
        data.measurement,
        frf=frf.with_receptances(H, data.frequency),
        name="typical unit",
        coherence=None,
        averages=None,
        scatter=np.where(known, MEDIAN_ERROR * spread / len(rests) ** 0.5, np.nan),
        compared=np.where(known, np.nan, 0.0),
    )


def _at_mean(fleet: Fleet, p: Population) -> FitResult:
    """Return the fleet's fit at the population's mean parameters and damping."""
    variables = fleet.variables
    values = {v.ref: v.to_value(float(p.mean[k])) for k, v in enumerate(variables)}
    return replace(fleet.start, values=values, zeta=np.exp(p.mean[len(variables) :]))


def between_units(triaged: Triaged, study: StudyContents) -> Between:
    """Return what one more unit of a population differs from its mean by."""
    fleet, p, variables = triaged.fleet, triaged.population, triaged.fleet.variables
    one_more = 1 + 1 / float((1 - p.probability).sum())  # its own scatter, and the error of the mean
    variance = np.diag(p.scatter) * one_more
    nuisances = []
    for k, v in enumerate(variables):
        # What the units' data do not determine stays as the study has it.
        std = float(np.sqrt(variance[k] + (1 - float(p.determined[k])) * (v.std / WIDER) ** 2))
        value = v.to_value(float(p.mean[k]))
        nuisances.append(Nuisance(*v.ref, std if v.log else std * v.scale / (abs(value) or 1.0)))
    known = p.determined[len(variables) :]
    damping = study.damping_std
    if known.sum() > 0:
        damping = float(np.sqrt(variance[len(variables) :].sum() / known.sum()))
    return Between(tuple(nuisances), damping, _form_share(fleet, p, study.model_error))


def _form_share(fleet: Fleet, p: Population, model_error: float) -> float:
    """Return the share of the form's error that units do not have in common.

    ``DISCREPANCY_MAX`` · ``model_error`` of it is the level that regular units leave beyond noise; an effect
    has ``CHANGED`` in any case.
    """
    if model_error == 0:
        return CHANGED
    data, lines = fleet.problem.data, fleet.lines
    beyond = 2 * data.weight[lines] ** 2 * (p.spread**2 - data.noise[lines] ** 2)
    level = float(np.sqrt(max(np.nanmean(np.where(data.mask[lines], beyond, np.nan)), 0.0)))
    return float(min(1.0, np.hypot(CHANGED, level / (DISCREPANCY_MAX * model_error))))


# ------------------------------------------------------------------------------------------------------------


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
