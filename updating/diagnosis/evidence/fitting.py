"""Fits with proper priors, and how probable the data are by them."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fem.model import Effect
from updating.correlation import log_ratio
from updating.diagnosis.evidence.marginal import Quadratic, by_size, log_evidence
from updating.diagnosis.evidence.priors import DATA_PER_MODE, FORM_LEAST, EffectPrior, prior_of
from updating.inference.fit import FitProblem
from updating.inference.fit_data import noise_squares
from updating.inference.fit_function import LEVEL_FLOOR, ROBUST, FitFunction, widened
from updating.inference.fit_result import FitResult
from updating.inference.joint_fit import JointFunction, JointLevels, with_modes
from updating.inference.mode_fit import ModeFunction, ModeProblem
from updating.inference.solve import TOLERANCE, Prior, Solution
from updating.least_squares.levels import Levels
from updating.least_squares.loss import pseudo_huber
from updating.least_squares.mode_levels import ModeLevels

Floats = NDArray[np.float64]

FULL_LINES = 100
"""Lines of full fits."""


@dataclass(frozen=True, slots=True, eq=False)
class Fitted:
    """A model at its most probable unknowns.

    Attributes
    ----------
    result : FitResult
        Values of parameters, damping and effects; its errors are not assessed.
    log_evidence : float
        ln p(data | model), up to a constant that all models on the same lines share.
    levels : Levels
        How probable error levels are.
    misfit : ndarray (n_groups,)
        Robust mean square of the residuals of each group [nepers²].
    size : float, optional
        Most probable size of the shifts of modes' eigenvalues, if they may be of several [-].
    covariance : ndarray (n, n), optional
        Of the normal approximation that the evidence is taken from, of all unknowns.
    """

    result: FitResult
    log_evidence: float
    levels: Levels | ModeLevels | JointLevels
    misfit: Floats
    size: float | None = None
    covariance: Floats | None = None

    @property
    def log_likelihood(self) -> float:
        """Ln p(data | values), up to the constant of the evidence."""
        return -self.levels.cost(self.misfit)

    def gain_to(self, discrepancy: float) -> float:
        """Return by how much the log likelihood would rise with no more than a level beside the noise.

        Parameters
        ----------
        discrepancy : float
            [nepers]
        """
        return self.gain_of(self.levels.noise + discrepancy**2)

    def gain_of(self, misfit: Floats) -> float:
        """Return by how much the log likelihood would rise with mean squares no larger than given."""
        return self.levels.cost(self.misfit) - self.levels.cost(np.minimum(self.misfit, misfit))

    @property
    def effects(self) -> tuple[Effect, ...]:
        """The effects at their fitted values."""
        return self.result.effects

    @property
    def level(self) -> float:
        """Robust residual level, amplitude and phase [nepers]."""
        return self.result.level


def n_data(problem: FitProblem, stage: float = np.inf) -> float:
    """Return for how many independent data a discrepancy at the lines up to a frequency stands."""
    return DATA_PER_MODE * max(3.0, problem.n_modes * min(1.0, stage / problem.data.frequency[-1]))


def levels_of(
    function: FitFunction, stage: float = np.inf, n_lines: int = 0
) -> Levels | ModeLevels | JointLevels:
    """Return how probable error levels are: noise, and what beams and the mesh leave beside it.

    The function's lines may stand for those of a fit with ``n_lines``.
    """
    if isinstance(function, ModeFunction):
        return function.mode_levels()
    if isinstance(function, JointFunction):
        frf, modes = function.both
        return JointLevels(_of_frf(frf, stage, n_lines), modes.mode_levels())
    return _of_frf(function, stage, n_lines)


def _of_frf(function: FitFunction, stage: float, n_lines: int) -> Levels:
    problem = function.problem
    sizes = np.unique(function.groups, return_counts=True)[1]
    if n_lines:
        sizes = sizes * (len(problem.lines_up_to(stage, n_lines)) / len(function.lines))
    noise = function.mean_by_group(noise_squares(problem.data, function.lines))
    n = n_data(problem, stage) * sizes / sizes.sum()
    least = (FORM_LEAST * problem.model_error) ** 2 + problem.mesh_level**2
    return Levels(n, noise * n / (problem.data.n_parts * sizes) + least, noise)


def priors_of(function: FitFunction) -> Prior:
    """Return what is known beforehand of everything that varies, effects too."""
    prior = function.prior()
    mean, std = prior.mean.copy(), prior.std.copy()
    for k, own in _of_effects(function).items():
        mean[k], std[k] = own.mean, own.std
    return Prior(mean, std)


def prior_at(function: FitFunction, x: Floats) -> tuple[Floats, Floats]:
    """Return how far unknowns are from their priors' means, and the deviations of normal priors there."""
    prior, n = priors_of(function), min(len(x), len(function.start))
    off, std = x[:n] - prior.mean[:n], prior.std[:n].copy()
    for k, own in _of_effects(function).items():
        if own.range:
            off[k], std[k] = 0.0, own.width_at(float(x[k]))
    return off, std


def _of_effects(function: FitFunction) -> dict[int, EffectPrior]:
    """Return what is known beforehand of the effects' unknowns, by their rows."""
    by_name = {e.name: e for e in function.effects}
    return {
        k: prior_of(function.problem, by_name[v.ref[0]], v)
        for k, v in enumerate(function.variables)
        if not v.has_prior
    }


def fit(
    problem: FitProblem | ModeProblem,
    effects: Sequence[Effect] = (),
    starts: Sequence[dict[str, float]] = (),
    *,
    stages: Iterable[float] | None = None,
    n_lines: int | None = None,
    counted_as: int = 0,
    max_iterations: int = 14,
    x_from: FitResult | None = None,
    tolerance: float = TOLERANCE,
) -> Fitted:
    """Find the most probable unknowns of a model with effects, band by band.

    Modes are all fitted at once, first with larger deviations than they have.

    Parameters
    ----------
    problem : FitProblem or ModeProblem
    effects : sequence of Effect
    starts : sequence of dict
        For each of them the parameter values to start from.
    stages : iterable of float, optional
        Upper ends of the bands, the last the whole [Hz]; of modes factors of their deviations, the last 1.
    n_lines : int, optional
    counted_as : int
        The lines count as so many: the evidence is then that of a fit to these.
    max_iterations : int
        In each band.
    x_from : FitResult, optional
        Start uncertain parameters and damping there rather than at the nominal values.
    tolerance : float
        The end of a band's fit is where a step gains less than this [nats].
    """
    x: Floats | None = None
    function = solution = None
    for stage in stages if stages is not None else problem.stages:
        own = problem.at_stage(stage) if isinstance(problem, ModeProblem) else problem
        lines = own.lines_up_to(stage, n_lines or own.n_lines)
        function = with_modes(own, own.function(effects, starts, lines), stage)
        if x is None:
            x = function.start if x_from is None else function.moved_to(x_from)
        solution = function.minimise(
            x,
            stage,
            max_iterations,
            prior=priors_of(function),
            levels=levels_of(function, stage, counted_as),
            tolerance=tolerance,
        )
        x = solution.x
    assert function is not None
    assert solution is not None
    return _assessed(function, solution, counted_as)


def _assessed(function: FitFunction, solution: Solution, counted_as: int) -> Fitted:
    """Return a solution with its log evidence and the covariance of its unknowns."""
    x = solution.x
    r, J = function(x, True)
    assert J is not None
    problem, scatter = function.problem, function.scatter
    member = np.unique(function.groups, return_inverse=True)[1]
    levels = levels_of(function, n_lines=counted_as)
    off, std = prior_at(function, x)
    near = Quadratic.of(r, J, member, ROBUST, levels)
    v, worth, size = near.v, levels.weight(near.v), None
    normal = near.normal(worth, std)
    if scatter is None or not scatter.sizes:
        evidence = log_evidence(-levels.cost(v), off, std, normal)
    else:
        rows = len(x) - len(scatter.std) + scatter.shifts
        factors = np.array(scatter.sizes) / scatter.eigenvalue
        each = by_size(near, off, std, rows, factors)
        evidence = float(np.logaddexp.reduce(each) - np.log(len(each)))
        size = scatter.sizes[int(np.argmax(each))]
    if not problem.form_right and not isinstance(levels, ModeLevels):
        # Stated deviations: what is left beyond noise is common to many lines, and stands for fewer data.
        apart = levels.n / (LEVEL_FLOOR**2 + v) / widened(levels.noise, 1.0, v)
        if isinstance(levels, JointLevels):  # modes stand for themselves
            n = len(levels.modes.n)
            apart[-n:] = worth[-n:]
        worth = apart
    covariance = np.linalg.inv(near.normal(worth, std))
    result = function.result(replace(solution, covariance=covariance))
    own: Floats = np.asarray(np.linalg.inv(normal), dtype=float)
    return Fitted(result, evidence, levels, v, size, own)


def with_seen_noise(problem: FitProblem, result: FitResult) -> FitProblem:
    """Return a problem with its noise reduced to what residuals of neighbouring lines differ by.

    A model's residuals are smooth over frequency but near resonances, so that their second differences hold
    the noise, and no less.
    """
    data = problem.data
    ratio = data.seen(log_ratio(problem.receptance(result), np.where(data.mask, data.H, 1.0)))
    r = data.weight * np.nan_to_num(ratio)
    there = data.mask[:-2] & data.mask[1:-1] & data.mask[2:]
    if not there.any():
        return problem
    seen = pseudo_huber((r[:-2] - 2 * r[1:-1] + r[2:])[there] / np.sqrt(6), ROBUST).mean()
    square = (data.weight * data.noise) ** 2
    stated = data.n_parts * ((square[:-2] + 4 * square[1:-1] + square[2:])[there] / 6).mean()
    scale = min(1.0, float(seen / stated))
    return replace(problem, data=replace(data, noise=data.noise * np.sqrt(scale)))
