"""Compare forecasts of effects with fits to data that have them: python -m benchmarks.forecast [--cases N]

Of each case a planned test is made, without anything missing. One candidate of each kind is put into the data
at 3 and 5 of the standard deviations that its forecast states, and the model is fitted with and without it.
The data have no noise, so that gains do not scatter; larger effects would then gain more than beside noise.
"""

import argparse
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.hidden.cases import make_case
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
    """

    kind: str
    deviations: float
    forecast: float
    fitted: float
    std_ratio: float


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


def compared(problem: FitProblem, effect: Effect) -> Iterator[Compared]:
    """Yield forecasts and fits of an effect at the middle one of its places."""
    base = problem.nominal()
    forecast = Forecast.at(problem, base, [effect], besides=0.0)
    i = len(forecast.owner) // 2
    if not forecast.precision[i] > 0:
        return
    first = effect.parameters()[0].name
    little, place = forecast.littles[0], int(forecast.place[i])
    for n in DEVIATIONS:
        factor = little.side(place, n / float(forecast.precision[i]))
        if np.isnan(factor):
            return
        there = forecast.effect_at(i, factor)
        known = hiding(problem, there)
        way = {"n_lines": FULL_LINES, "tolerance": 1e-4}
        without = fit(known, **way)
        start = replace(base, effects=())
        right = fit(known, [effect], [parameter_values(there)], x_from=start, stages=known.stages[-1:], **way)
        gain = float(expected_gains(forecast, np.full(len(forecast.owner), abs(factor)), 0.0)[i])
        slope = abs(little.points[place][first]) / float(forecast.precision[i])
        yield Compared(
            effect.kind,
            n,
            gain,
            log_posterior(known, right) - log_posterior(known, without),
            right.std[effect.name, first] / slope,
        )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=3)
    found: list[Compared] = []
    for number in range(parser.parse_args().cases):
        case = make_case(number)
        problem = build_problem(case.model, case.measurement, case.nuisances)
        problem = as_planned(problem, problem.nominal())
        candidates = [e for e in propose(case.model, test=case.measurement) if not e.is_form]
        start = time.process_time()
        Forecast.at(problem, problem.nominal(), candidates, besides=0.0, vectors=True)
        seconds = time.process_time() - start
        print(f"case {number}: {len(candidates)} candidates forecast in {seconds:.2f} CPU s")
        for effect in {e.kind: e for e in reversed(candidates) if not e.amplitude_dependent}.values():
            for each in compared(problem, effect):
                found.append(each)
                gains = f"gain {each.fitted:6.1f} for {each.forecast:6.1f} nats"
                print(
                    f"  {each.kind:28s}{each.deviations:3.0f} σ  {gains}  std × {each.std_ratio:.2f}",
                    flush=True,
                )
    for n in DEVIATIONS:
        some = [c for c in found if c.deviations == n]
        if some:
            close = [abs(c.fitted - c.forecast) < max(3.0, 0.15 * c.forecast) for c in some]
            ratio = np.quantile([c.fitted / c.forecast for c in some], [0.25, 0.5, 0.75])
            print(
                f"{n:.0f} σ: {sum(close)} of {len(some)} gains within 3 nats or 15 %; quartiles of the ratio "
                + ", ".join(f"{q:.2f}" for q in ratio)
            )


if __name__ == "__main__":
    main()
