"""Compare forecasts of effects with fits to data that have them: python -m benchmarks.forecast [STUDY...]

Of each study, or of random frames where none is named, the test is planned again, without anything missing.
Some candidates, of each kind as many, are put into the data as large as their forecasts state for gains of
4.5 and 12.5 nats. The model is fitted with and without them, and with the most alike candidate of another
place. The data have no noise, so that gains do not scatter. Small deviations of modes have one size for
forecasts and fits. The table has a row for each kind: median and 90 % quantile of the errors at both sizes.
"""

import argparse
import json
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from itertools import chain, zip_longest
from pathlib import Path

import numpy as np

from benchmarks.hidden.cases import make_case
from dovetail import load_study
from dovetail.pipeline import fit_problem
from fem import Effect, parameter_values
from updating import FitProblem, FitResult, build_problem, propose
from updating.forecast import Forecast
from updating.inference import FULL_LINES
from updating.inference.fitting import fit
from updating.plan.planned import as_planned
from updating.plan.visibility import Rivals, amplitudes_as_solved, gain_at

DEVIATIONS = (3.0, 5.0)
"""Roots of twice the gains for which effects are sized: in standard deviations, where nothing saturates."""
LEAST_GAIN = 1.0
"""Likenesses are compared where fits gain at least this [nats]."""


@dataclass(frozen=True, slots=True)
class Compared:
    """A forecast and fits.

    Attributes
    ----------
    kind : str
    deviations : float
        Root of twice the gain for which it was sized.
    forecast, fitted : float
        Gains in log posterior [nats].
    std_ratio : float
        Standard deviation of the fit over that of the forecast [-].
    likeness, fitted_likeness : float
        Of the most alike candidate of another place: the part of the gain that it reaches, by the forecast
        and by fits, NaN where there is none [-].
    """

    kind: str
    deviations: float
    forecast: float
    fitted: float
    std_ratio: float
    likeness: float
    fitted_likeness: float


def hiding(problem: FitProblem, effect: Effect) -> FitProblem:
    """Return a problem whose data have an effect, without noise."""
    there = replace(problem, reduced=problem.reduced.with_forces_of([effect]))
    nominal = there.nominal()
    values = {(effect.name, name): value for name, value in parameter_values(effect).items()}
    H = there.receptance(replace(nominal, effects=(effect,), values={**nominal.values, **values}))
    return replace(there, data=replace(there.data, H=H))


def log_posterior(problem: FitProblem, fitted: FitResult) -> float:
    """Return the log likelihood of a fit with the prior of uncertain parameters and damping."""
    values = [parameter_values(e) for e in fitted.effects]
    prior = problem.function(fitted.effects, values, problem.lines_up_to(np.inf, FULL_LINES)).prior()
    known = np.isfinite(prior.std)
    off = (fitted.solution.x - prior.mean)[known] / prior.std[known]
    return fitted.log_likelihood - 0.5 * float(off @ off)


def compared(problem: FitProblem, forecast: Forecast, i: int) -> Iterator[Compared]:
    """Yield forecasts and fits of the i-th place of a forecast."""
    little, place, base = forecast.littles[forecast.owner[i]], int(forecast.place[i]), problem.nominal()
    effect = little.grid.effect
    first = effect.parameters()[0].name
    rival, cosine = most_alike(forecast, i)
    for n in DEVIATIONS:
        wanted = np.full(len(forecast.owner), np.inf)
        wanted[i] = 0.5 * n**2
        factor = little.side(place, float(amplitudes_as_solved(forecast, wanted, 0.0)[i]))
        if np.isnan(factor):
            return
        there = forecast.effect_at(i, factor)
        try:
            known = hiding(problem, there)
        except np.linalg.LinAlgError:  # the planned model holds what this effect releases
            print(f"  {effect.kind} at {there.where}: not put into data")
            return
        way = {"n_lines": FULL_LINES, "tolerance": 1e-4}
        without = fit(known, **way)
        start = {"x_from": replace(base, effects=()), "stages": known.stages[-1:], **way}
        right = fit(known, [effect], [parameter_values(there)], **start)
        nothing = log_posterior(known, without)
        gained = log_posterior(known, right) - nothing
        gain = gain_at(forecast, i, factor, 0.0)
        likeness = fitted_likeness = np.nan
        if rival is not None:
            other = forecast.littles[forecast.owner[rival]]
            lengths = np.linalg.norm(forecast.vectors[[i, rival]], axis=1)
            multiple = factor * cosine * lengths[0] / lengths[1]
            if gained > LEAST_GAIN and other.reaches(int(forecast.place[rival]), multiple):
                at = forecast.effect_at(rival, multiple)
                able = replace(known, reduced=known.reduced.with_forces_of([at]))
                wrong = fit(able, [other.grid.effect], [parameter_values(at)], **start)
                likeness = float(cosine**2)
                fitted_likeness = (log_posterior(known, wrong) - nothing) / gained
        ratio = right.std[effect.name, first] / forecast.std(
            int(forecast.owner[i]), parameter_values(right.effects[0])
        )
        yield Compared(effect.kind, n, gain, gained, ratio, likeness, fitted_likeness)


def most_alike(forecast: Forecast, i: int) -> tuple[int | None, float]:
    """Return the place of the rival at another place that imitates an effect best, and their cosine."""
    rivals = Rivals.of(forecast, np.zeros(len(forecast.owner)))
    column, cosine = rivals.column, rivals.cosines(np.array([i]))[0]
    elsewhere = np.array(
        [e.where != forecast.candidates[forecast.owner[i]].where for e in forecast.candidates]
    )
    fits = elsewhere[forecast.owner[column]] & ((cosine > 0) | rivals.both[column])
    if not fits.any():
        return None, 0.0
    best = int(np.argmax(np.where(fits, np.abs(cosine), -1.0)))
    return int(column[best]), float(cosine[best])


def some_of(forecast: Forecast, most: int, rng: np.random.Generator) -> list[int]:
    """Return places of a forecast that data would show: drawn kind by kind, one after the other."""
    by_kind: dict[str, list[int]] = {}
    for i in rng.permutation(len(forecast.owner)):
        effect = forecast.candidates[forecast.owner[i]]
        if forecast.precision[i] > 0 and not effect.amplitude_dependent:
            by_kind.setdefault(effect.kind, []).append(int(i))
    turns = chain.from_iterable(zip_longest(*by_kind.values()))
    return [i for i in turns if i is not None][:most]


def problems(paths: list[Path], n_cases: int) -> Iterator[tuple[str, FitProblem, tuple[Effect, ...]]]:
    """Yield names, planned tests and candidates of studies, or of random frames without one."""
    for path in paths:
        study = load_study(path)
        problem = fit_problem(study)
        yield path.parent.name, problem, propose(study.model, test=problem.data.measurement)
    for number in range(0 if paths else n_cases):
        case = make_case(number)
        problem = build_problem(case.model, case.measurement, case.nuisances)
        yield f"frame {number}", problem, propose(case.model, test=case.measurement)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("studies", nargs="*", type=Path)
    parser.add_argument("--cases", type=int, default=3, help="random frames, where no study is named")
    parser.add_argument("--each", type=int, default=24, help="candidates of each")
    parser.add_argument("--kinds", nargs="+", help="these kinds alone")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument(
        "--records", type=Path, help="file of JSON lines that is added to; the table is of all"
    )
    options = parser.parse_args()
    rng, found = np.random.default_rng(options.seed), list[Compared]()
    for name, measured, every in problems(options.studies, options.cases):
        problem = as_planned(measured, measured.nominal())
        # Forecast and fits allow shifts of the same size.
        if problem.scatter is not None:
            problem = replace(problem, scatter=replace(problem.scatter, sizes=()))
        candidates = [e for e in every if not e.is_form and e.kind in (options.kinds or {e.kind})]
        start = time.process_time()
        forecast = Forecast.at(problem, problem.nominal(), candidates, besides=0.0, vectors=True)
        seconds = time.process_time() - start
        print(f"{name}: {len(candidates)} candidates forecast in {seconds:.2f} CPU s")
        for i in some_of(forecast, options.each, rng):
            for each in compared(problem, forecast, i):
                found.append(each)
                gains = f"gain {each.fitted:6.1f} for {each.forecast:6.1f} nats  std × {each.std_ratio:.2f}"
                alike = f"likeness {each.fitted_likeness:.2f} for {each.likeness:.2f}"
                print(f"  {each.kind:28s}{each.deviations:3.0f} σ  {gains}  {alike}", flush=True)
    if options.records:
        with options.records.open("a", encoding="utf-8") as file:
            file.writelines(json.dumps(asdict(c)) + "\n" for c in found)
        lines = options.records.read_text(encoding="utf-8").splitlines()
        found = [Compared(**json.loads(line)) for line in lines]
    print(table(found))


def table(found: list[Compared]) -> str:
    """Return the errors of forecasts by kind, and how many are within 3 nats or 15 %, 20 % and 0.05."""
    head = (
        "kind",
        "n",
        "gain [nats]",
        "gains agree",
        "±, fit / forecast",
        "± agree",
        "likeness",
        "likenesses agree",
    )
    lines = [f"| {' | '.join(head)} |", "|" + "---|" * len(head)]
    kinds = dict.fromkeys(sorted(c.kind for c in found))
    for kind, some in [*((k, [c for c in found if c.kind == k]) for k in kinds), ("all", found)]:
        gains = np.array([abs(c.fitted - c.forecast) for c in some])
        near = gains < [max(3.0, 0.15 * c.forecast) for c in some]
        std = np.array([np.log(c.std_ratio) for c in some])
        alike = np.array([abs(c.fitted_likeness - c.likeness) for c in some if np.isfinite(c.likeness)])
        cells = [
            kind,
            str(len(some)),
            f"{np.median(gains):.1f}, {np.quantile(gains, 0.9):.1f}",
            f"{near.sum()}",
            f"{np.exp(np.median(std)):.2f}, × {np.exp(np.quantile(np.abs(std), 0.9)):.2f}",
            f"{(np.abs(std) < np.log(1.2)).sum()}",
            f"{np.median(alike):.2f}, {np.quantile(alike, 0.9):.2f}" if len(alike) else "-",
            f"{(alike < 0.05).sum()} of {len(alike)}",
        ]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


if __name__ == "__main__":
    main()
