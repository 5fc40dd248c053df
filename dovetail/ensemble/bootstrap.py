"""The bootstrap of an update on a pool of workers, in a folder in which a run that was stopped continues."""

from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dovetail.ensemble.quantiles import PROBABILITIES, Quantiles, quantiles
from dovetail.units.folder import FolderError, Journal, alone_in, read_records
from dovetail.units.outcome import Outcome
from dovetail.units.pool import Pool
from dovetail.units.program import digest_of
from dovetail.units.work import WorkStep, work_through
from fem.array_types import Floats
from fem.system import assemble
from updating.inference.bootstrap import BootstrapModel, refit
from updating.inference.updated import Updated

JOURNAL = "bootstrap.jsonl"
"""File of the settings and refits."""

LEAST = 10
"""Refits below which there are no standard deviations [-]."""


@dataclass(frozen=True, slots=True, eq=False)
class Bootstrap:
    """Fits of resamples, with the fit of the measurement.

    Attributes
    ----------
    updated : Updated
    asked : int
        Resamples.
    values : ndarray (n, n_par)
        Of all parameters, of each refit that ended well [units].
    failures : tuple of Outcome
        Refits that failed.
    """

    updated: Updated
    asked: int
    values: Floats
    failures: tuple[Outcome, ...]

    @property
    def n(self) -> int:
        """Number of refits that count."""
        return len(self.values)

    @property
    def std(self) -> Floats:
        """Standard deviations of the refits, (n_par,)."""
        return self.values.std(axis=0, ddof=1)

    @property
    def std_error(self) -> Floats:
        """Standard errors of these, from the fourth moment, (n_par,)."""
        square = (self.values - self.values.mean(axis=0)) ** 2
        spread = np.sqrt(np.maximum((square**2).mean(axis=0) - square.mean(axis=0) ** 2, 0.0) / self.n)
        return spread / (2 * np.maximum(self.std, 1e-300))

    @property
    def bias(self) -> Floats:
        """Mean of the refits less the fitted value, (n_par,)."""
        return self.values.mean(axis=0) - np.array([p.value for p in self.updated.parameters])

    @property
    def bias_error(self) -> Floats:
        """Standard errors of the bias, (n_par,)."""
        return self.std / np.sqrt(self.n)

    @property
    def quantiles(self) -> Quantiles:
        """Quantiles of the refits, (3, n_par)."""
        return quantiles(self.values)

    @property
    def at_bound(self) -> Floats:
        """Share of the refits at a bound, (n_par,)."""
        low, high = (np.array([getattr(p, k) for p in self.updated.parameters]) for k in ("lower", "upper"))
        # Values closer to a bound than this, relatively, are at it [-]
        edge = 1e-6 * np.abs(np.array([p.value for p in self.updated.parameters]))
        return ((self.values <= low + edge) | (self.values >= high - edge)).mean(axis=0)

    @property
    def correlation(self) -> Floats:
        """Correlations of the refits, (n_par, n_par)."""
        moved = self.std > 0
        out = np.eye(len(moved))
        if moved.sum() > 1:
            out[np.ix_(moved, moved)] = np.corrcoef(self.values[:, moved], rowvar=False)
        return out


def run_bootstrap(
    updated: Updated,
    n: int,
    seed: int,
    folder: Path,
    pool: Pool,
    say: Callable[[WorkStep], None] = lambda step: None,
) -> Bootstrap:
    """Fit the resamples that a folder does not hold yet; return all.

    Parameters
    ----------
    updated : Updated
    n : int
        Resamples.
    seed : int
    folder : Path
        Made if it is not there.
    pool : Pool
    say : callable
        Told of each unit.

    Raises
    ------
    ModelError
        If the update failed or was regularised.
    FolderError
        If the folder holds the bootstrap of another update, another run computes there, or fewer than
        `LEAST` refits ended well.
    """
    model = BootstrapModel.of(updated, seed)
    settings = {"bootstrap": _digest(model), "seed": seed}
    with alone_in(folder, "bootstrap"):
        known = {r["refit"]: np.array(r["values"]) for r in read_records(folder / JOURNAL, settings)}
        with closing(Journal(folder / JOURNAL, settings)) as journal:

            def keep(outcome: Outcome) -> None:
                if not outcome.failure:
                    known[outcome.unit] = outcome.value
                    journal.add({"refit": outcome.unit, "values": outcome.value})

            units = [k for k in range(n) if k not in known]
            failures = work_through(pool, refit, model, units, keep, say, n - len(units))
    values = [known[k] for k in range(n) if k in known]
    if len(values) < min(n, LEAST):
        reason = f"; the first failed with: {failures[0].failure}" if failures else ""
        msg = f"{len(values)} of {n} refits ended well, too few for standard deviations{reason}"
        raise FolderError(msg)
    return Bootstrap(updated, n, np.array(values), failures)


def _digest(model: BootstrapModel) -> str:
    """Return a short hash of all on which a refit depends, the program included."""
    problem, updated = model.problem, model.updated
    measured = dict.fromkeys([problem.measured_modes, problem.data])
    arrays: list[Any] = [updated.values, updated.fitted.solution.x]
    arrays += [a for data in measured if data is not None for a in data.arrays]
    words: list[Any] = [(p.name, p.lower, p.upper, p.prior_std) for p in updated.parameters]
    words += [updated.left_out, sorted(updated.misfit.items()), problem.model_error]
    words += [updated.settings.max_iterations, updated.settings.n_lines]
    return digest_of(arrays, words, assemble(updated.model))


def as_dict(found: Bootstrap) -> dict[str, Any]:
    """Return the bootstrap for JSON, with the linearised standard deviations and correlations."""
    q, updated = found.quantiles, found.updated
    columns = {
        "std": found.std,
        "std_error": found.std_error,
        "bias": found.bias,
        "bias_error": found.bias_error,
        "quantiles": q.value.T,
        "quantile_errors": q.error.T,
        "at_bound": found.at_bound,
    }
    return {
        "resamples": found.asked,
        "refits": found.n,
        "probabilities": PROBABILITIES,
        "parameters": [
            {
                "name": p.name,
                "unit": p.unit,
                "value": p.value,
                "linearised_std": p.std,
                **{key: column[k] for key, column in columns.items()},
            }
            for k, p in enumerate(updated.parameters)
        ],
        "correlation": found.correlation,
        "linearised_correlation": updated.correlation,
        "failures": [{"refit": o.unit, "reason": o.failure} for o in found.failures],
    }


NAMED_RATIO = 1.25
"""Standard deviations that differ by more than this factor, and by more than their errors, are named [-]."""


def lines_of(found: Bootstrap) -> list[str]:
    """Return the table and sentences that the command prints."""
    q, parameters = found.quantiles.value, found.updated.parameters
    width = max(len(p.name) for p in parameters)
    out = [
        f"bootstrap: {found.n} refits of {found.asked} resamples",
        f"  {'':{width}}        value  linearised    bootstrap        bias  (error)         5 %      median"
        "        95 %",
    ]
    columns = zip(parameters, found.std, found.bias, found.bias_error, q.T, strict=True)
    for p, std, bias, error, (low, middle, high) in columns:
        linear = f"{p.std:12.4g}" if np.isfinite(p.std) else f"{'-':>12}"
        out.append(
            f"  {p.name:{width}} {p.value:12.5g}{linear} {std:12.4g}{bias:12.3g}{error:9.2g}"
            f"{low:12.5g}{middle:12.5g}{high:12.5g}  {p.unit}"
        )
    return out + sentences(found)


def sentences(found: Bootstrap) -> list[str]:
    """Return where the bootstrap differs from the linearised standard deviations, and failed refits."""
    parameters, out = found.updated.parameters, []
    for p, std, error in zip(parameters, found.std, found.std_error, strict=True):
        if np.isfinite(p.std) and std > 0:
            ratio = std / p.std
            if abs(std - p.std) > 3 * error and not 1 / NAMED_RATIO < ratio < NAMED_RATIO:
                out.append(
                    f"{p.name}: the bootstrap's standard deviation is {ratio:.2f} times the linearised one"
                )
    for p, bias, error in zip(parameters, found.bias, found.bias_error, strict=True):
        if abs(bias) > 3 * error and abs(bias) > 0.25 * error * np.sqrt(found.n):
            out.append(f"{p.name}: the fit is biased by {bias:.3g} {p.unit}, over a quarter of its deviation")
    bound = [f"{p.name} {100 * s:.0f} %" for p, s in zip(parameters, found.at_bound, strict=True) if s > 0]
    if bound:
        out.append(f"refits at a bound: {', '.join(bound)}")
    if found.failures:
        out.append(f"{len(found.failures)} refits failed, and the same command tries again:")
        out += [f"  {o.unit}: {o.failure}" for o in found.failures[:20]]
    return out
