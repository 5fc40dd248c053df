"""The search for laws of joints that depend on amplitude, by their evidence at several levels of force.

Effects that were found at one level, nothing, and each of these with a law beside them are fitted to all
levels together. The most probable of them is the answer.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fem.analysis.harmonic_balance import Receptances, solve_steady
from fem.array_types import Ints
from fem.effects.joint_nonlinear import AmplitudeDependent
from fem.model import parameter_values
from fem.reduction.parametric_frf import ParametricFRF
from updating.correlation import log_ratio
from updating.diagnosis.amplitude import at_force_levels
from updating.diagnosis.evidence.diagnosis import Searched
from updating.diagnosis.evidence.hypothesis import ScoredFit, Start, values_of
from updating.diagnosis.evidence.search import Search
from updating.inference.fit import FitProblem
from updating.inference.fit_data import FitData
from updating.inference.fit_function import ROBUST
from updating.inference.fit_result import FitResult
from updating.least_squares.costs import pseudo_huber

N_STARTS = 2
"""Points of a law's grid from which it is fitted."""
LARGE_MOTION = 0.9
"""Share of lines and forces at which a joint moves less than the amplitude of its law [-]."""


def with_laws(
    done: Searched[FitProblem], levels: tuple[FitData, ...], laws: Sequence[AmplitudeDependent]
) -> Searched[FitProblem]:
    """Return a search that compares the findings, alone and with amplitude laws, at several levels of force.

    Parameters
    ----------
    done : Searched
        At the first level.
    levels : tuple of FitData
        Of :func:`updating.diagnosis.amplitude.force_levels`.
    laws : sequence of AmplitudeDependent
        Candidates.
    """
    one = done.search
    at_first = one.fits.problem
    problem = at_force_levels(at_first, levels)
    candidates = (*one.candidates, *laws)
    search = Search(
        problem,
        one.fits.form,
        candidates,
        one.tell,
        scanned=one.scanned,
        workers=one.workers,
        budget=one.budget,
    )
    first = one.known[frozenset()]
    nothing = search.full((), (), first)
    bases = [nothing]
    if done.best.effects:
        bases.append(search.full(done.best.effects, values_of(done.best.effects), done.best))
    for base in bases:
        _add_laws(search, base, at_first, levels, laws)
    best = search.simplified(max(search.known.values(), key=lambda h: h.score))
    return replace(done, search=search, best=search.polished(best), otherwise=())


def _add_laws(
    search: Search[FitProblem],
    base: ScoredFit,
    problem: FitProblem,
    levels: Sequence[FitData],
    laws: Sequence[AmplitudeDependent],
) -> None:
    """Fit the most promising laws in addition to a hypothesis."""
    quick, free = search.fits.problems(base)
    fits = []
    for starts in _looked_at(problem, levels, base.fitted, laws):
        effects, values = (*base.effects, starts[0]), values_of(base.effects)
        points = [Start((*values, parameter_values(s)), base.fitted) for s in starts]
        short = search.fits.shortly(quick, effects, points)
        if short:
            fits.append(search.fits.continued(free, short[:2]))
    fits.sort(key=lambda h: -h.score)
    for h in fits[: search.budget.n_final]:
        search.full(h.effects, values_of(h.effects), h)


def _looked_at(
    problem: FitProblem, levels: Sequence[FitData], current: FitResult, laws: Sequence[AmplitudeDependent]
) -> list[list[AmplitudeDependent]]:
    """Return the most promising laws by their residual level on a grid of values, each at its best points."""
    # Lines at which they are looked at
    lines = problem.lines_up_to(np.inf, 60)
    looked: list[tuple[float, list[AmplitudeDependent]]] = []
    nearby: dict[tuple[str, str], Receptances] = {}
    for law in laws:
        key = (law.joint, law.direction)
        if key not in nearby:
            nearby[key] = _at_joint(problem, current, law, lines)
        part = nearby[key]
        top = max(d.measurement.force_level or 0.0 for d in levels)
        amplitude = float(np.quantile(np.abs(part.h), LARGE_MOTION)) * top
        if amplitude <= 0:  # nothing moves the joint in this direction
            continue
        scaled = replace(law, amplitude=amplitude)
        points = [scaled.with_values(**p) for p in scaled.starts(problem.surroundings)]
        seen = [_level(levels, e, part, lines) for e in points]
        best = np.argsort(seen, kind="stable")[:N_STARTS]
        looked.append((seen[best[0]], [points[k] for k in best]))
    looked.sort(key=lambda pair: pair[0])
    # Laws that are fitted, at most
    return [starts for _, starts in looked[:4]]


def _at_joint(problem: FitProblem, current: FitResult, law: AmplitudeDependent, lines: Ints) -> Receptances:
    """Return the receptances of sensors and of a joint's motion, without its law."""
    f, refs = problem.data.frequency[lines], list(current.values)
    engine = ParametricFRF(
        problem.reduced, *problem.vectors_with(law), f, refs, current.effects, viscous=problem.viscous
    )
    values, zeta = np.array(list(current.values.values())), problem.damping.ratio(f, current.zeta)
    return Receptances.of(engine.evaluate(values, zeta, gradient=False)[0])


def _level(levels: Sequence[FitData], law: AmplitudeDependent, part: Receptances, lines: Ints) -> float:
    """Return the robust residual level over all levels of force with a law [nepers]."""
    squares = []
    for data in levels:
        keep = data.mask[lines]
        measured = np.where(keep, data.H[lines], 0.0)
        H = solve_steady(law, data.measurement.force_level, part, measured).H
        r = np.abs((data.weight[lines] * log_ratio(H, np.where(measured != 0, measured, 1.0)))[keep])
        squares.append(float(np.nanmean(pseudo_huber(r, ROBUST))))
    return float(np.sqrt(np.mean(squares)))


def at_its_amplitude(problem: FitProblem, result: FitResult) -> FitResult:
    """Return a fit whose law is stated for the amplitude that most lines of the data stay below."""
    law = next((e for e in result.effects if isinstance(e, AmplitudeDependent)), None)
    if law is None:
        return result
    amplitude = problem.steady(result, np.arange(len(problem.data.frequency))).amplitude
    moving = amplitude[amplitude > 0]
    if not moving.size:
        return result
    stated = replace(law, amplitude=float(np.quantile(moving, LARGE_MOTION)))
    return replace(result, effects=tuple(stated if e is law else e for e in result.effects))
