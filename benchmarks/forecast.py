"""Compare forecasts of effects with fits to data that have them: python -m benchmarks.forecast [STUDY...]

Of each study, or of random frames where none is named, the test is planned again, without anything missing.
Some candidates, of each kind as many, are put into the data at 3 and 5 of the standard deviations that their
forecasts state, and the model is fitted with and without them, and with the most alike candidate of another
place. The data have no noise, so that gains do not scatter.
"""

import argparse
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
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
from updating.plan.visibility import expected_gains

DEVIATIONS = (3.0, 5.0)
"""Sizes of the effects, in standard deviations."""


@dataclass(frozen=True, slots=True)
class Compared:
    """A forecast and fits.

    Attributes
    ----------
    kind : str
    deviations : float
        Size of the effect, in its forecast standard deviations.
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
    return replace(problem, data=replace(problem.data, H=H))


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
    v = forecast.vectors
    size = np.linalg.norm(v, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        cosine = np.nan_to_num(v @ v[i] / (size * size[i]))
    elsewhere = np.array([e.where != effect.where for e in forecast.candidates])[forecast.owner]
    rival = int(np.argmax(np.where(elsewhere, np.abs(cosine), -1.0)))
    for n in DEVIATIONS:
        factor = little.side(place, n / float(forecast.precision[i]))
        if np.isnan(factor):
            return
        there = forecast.effect_at(i, factor)
        known = hiding(problem, there)
        way = {"n_lines": FULL_LINES, "tolerance": 1e-4}
        without = fit(known, **way)
        start = {"x_from": replace(base, effects=()), "stages": known.stages[-1:], **way}
        right = fit(known, [effect], [parameter_values(there)], **start)
        nothing = log_posterior(known, without)
        gained = log_posterior(known, right) - nothing
        gain = float(expected_gains(forecast, np.full(len(forecast.owner), abs(factor)), 0.0)[i])
        slope = abs(little.points[place][first]) / float(forecast.precision[i])
        likeness = fitted_likeness = np.nan
        if elsewhere.any():
            other = forecast.littles[forecast.owner[rival]]
            multiple = n * cosine[rival] * np.sign(factor) / float(forecast.precision[rival])
            if other.reaches(int(forecast.place[rival]), multiple) and not (
                multiple < 0 and other.grid.one_sided()
            ):
                at = forecast.effect_at(rival, multiple)
                wrong = fit(known, [other.grid.effect], [parameter_values(at)], **start)
                likeness = float(cosine[rival] ** 2)
                fitted_likeness = (log_posterior(known, wrong) - nothing) / gained
        yield Compared(
            effect.kind, n, gain, gained, right.std[effect.name, first] / slope, likeness, fitted_likeness
        )


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
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    rng, found = np.random.default_rng(options.seed), list[Compared]()
    for name, measured, every in problems(options.studies, options.cases):
        problem = as_planned(measured, measured.nominal())
        candidates = [e for e in every if not e.is_form]
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
    for n in DEVIATIONS:
        if some := [c for c in found if c.deviations == n]:
            print(f"{n:.0f} σ, {len(some)} effects: {summary(some)}")


def summary(some: list[Compared]) -> str:
    """Return how many gains, standard deviations and likenesses agree."""
    gains = sum(abs(c.fitted - c.forecast) < max(3.0, 0.15 * c.forecast) for c in some)
    stds = sum(abs(np.log(c.std_ratio)) < np.log(1.2) for c in some)
    alike = [abs(c.fitted_likeness - c.likeness) < 0.05 for c in some if np.isfinite(c.likeness)]
    ratio = ", ".join(
        f"{np.quantile([c.fitted / c.forecast for c in some], q):.2f}" for q in (0.25, 0.5, 0.75)
    )
    return (
        f"{gains} gains within 3 nats or 15 %, quartiles of the ratio {ratio}; {stds} standard deviations "
        f"within 20 %; {sum(alike)} of {len(alike)} likenesses within 0.05"
    )


if __name__ == "__main__":
    main()
