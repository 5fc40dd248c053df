"""Fits with proper priors, and how probable the data are by them."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fem.model import Effect
from updating.diagnosis.evidence.marginal import log_evidence
from updating.diagnosis.evidence.priors import DATA_PER_MODE, EffectPrior, prior_of
from updating.inference.fit import FitProblem
from updating.inference.fit_data import SYSTEMATIC_SHARE, noise_squares
from updating.inference.fit_function import LEVEL_FLOOR, ROBUST, FitFunction
from updating.inference.fit_result import FitResult
from updating.inference.solve import Prior, Solution, inflation
from updating.least_squares.loss import pseudo_huber, pseudo_huber_weight

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Fitted:
    """A model at its most probable unknowns.

    Attributes
    ----------
    result : FitResult
        Values of parameters, damping and effects; its errors are not assessed.
    log_evidence : float
        ln p(data | model), up to a constant that all models on the same lines share.
    log_likelihood : float
        ln p(data | values), up to that constant.
    """

    result: FitResult
    log_evidence: float
    log_likelihood: float

    @property
    def effects(self) -> tuple[Effect, ...]:
        """The effects at their fitted values."""
        return self.result.effects

    @property
    def level(self) -> float:
        """Robust residual level, amplitude and phase [nepers]."""
        return self.result.level


def n_data(problem: FitProblem, stage: float = np.inf) -> float:
    """Return how many independent data the lines up to a frequency stand for."""
    return DATA_PER_MODE * max(3.0, problem.n_modes * min(1.0, stage / problem.data.frequency[-1]))


def priors_of(function: FitFunction) -> Prior:
    """Return what is known beforehand of everything that varies, effects too."""
    prior = function.prior()
    mean, std = prior.mean.copy(), prior.std.copy()
    for k, own in _of_effects(function).items():
        mean[k], std[k] = own.mean, own.std
    return Prior(mean, std)


def _of_effects(function: FitFunction) -> dict[int, EffectPrior]:
    """Return what is known beforehand of the effects' unknowns, by their rows."""
    by_name = {e.name: e for e in function.effects}
    return {
        k: prior_of(function.problem, by_name[v.ref[0]], v)
        for k, v in enumerate(function.variables)
        if not v.has_prior
    }


def fit(
    problem: FitProblem,
    effects: Sequence[Effect] = (),
    starts: Sequence[dict[str, float]] = (),
    *,
    stages: Iterable[float] | None = None,
    n_lines: int | None = None,
    max_iterations: int = 14,
    x_from: FitResult | None = None,
) -> Fitted:
    """Find the most probable unknowns of a model with effects, band by band.

    Parameters
    ----------
    problem : FitProblem
    effects : sequence of Effect
    starts : sequence of dict
        For each of them the parameter values to start from.
    stages : iterable of float, optional
        Upper ends of the bands, the last the whole [Hz].
    n_lines : int, optional
    max_iterations : int
        In each band.
    x_from : FitResult, optional
        Start uncertain parameters and damping there rather than at the nominal values.
    """
    x: Floats | None = None
    function = solution = None
    for stage in stages if stages is not None else problem.stages:
        lines = problem.lines_up_to(stage, n_lines or problem.n_lines)
        function = problem.function(effects, starts, lines)
        if x is None:
            x = function.start if x_from is None else function.moved_to(x_from)
        solution = function.minimise(
            x, stage, max_iterations, prior=priors_of(function), n_independent=n_data(problem, stage)
        )
        x = solution.x
    assert function is not None
    assert solution is not None
    evidence, likelihood, covariance = _assessed(function, solution)
    result = function.result(replace(solution, covariance=covariance))
    return Fitted(result, evidence, likelihood)


def _assessed(function: FitFunction, solution: Solution) -> tuple[float, float, Floats]:
    """Return log evidence and log likelihood at a solution, and the covariance of its unknowns."""
    x, prior = solution.x, priors_of(function)
    r, J = function(x, True)
    assert J is not None
    groups = np.unique(function.groups, return_inverse=True)[1]
    size = np.bincount(groups)
    level = LEVEL_FLOOR**2 + np.bincount(groups, pseudo_huber(r, ROBUST)) / size
    n = n_data(function.problem)
    likelihood = -0.5 * n * float(size @ np.log(level)) / len(r)
    w = (n / len(r) / level)[groups] * pseudo_huber_weight(r, ROBUST)
    off, std = x - prior.mean, prior.std.copy()
    for k, own in _of_effects(function).items():
        if own.range:
            off[k], std[k] = 0.0, own.width_at(float(x[k]))
    A = np.real((J.conj() * w) @ J.T) + np.diag(std**-2.0)
    # Stated deviations: what is left beyond noise is common to many lines, and stands for fewer data.
    noise = np.bincount(groups, noise_squares(function.problem.data, function.lines)) / size
    wider = inflation(level - LEVEL_FLOOR**2, noise, LEVEL_FLOOR, SYSTEMATIC_SHARE)[groups]
    B = np.real((J.conj() * (w / wider)) @ J.T) + np.diag(std**-2.0)
    return log_evidence(likelihood, off, std, A), likelihood, np.linalg.inv(B)
