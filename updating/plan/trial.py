"""Data as a planned test might give them, drawn with an effect that is missing from the model."""

from dataclasses import replace

import numpy as np

from fem.array_types import Complexes
from fem.model import Effect, parameter_values
from updating.inference.belief import DATA_PER_MODE
from updating.inference.fit import FitProblem
from updating.inference.solve import Solution
from updating.measurement.measurement import Measurement


def drawn(
    problem: FitProblem, effects: tuple[Effect, ...], discrepancy: float, rng: np.random.Generator
) -> Measurement:
    """Return data with effects, and with all that is uncertain somewhere within its priors.

    Uncertain parameters, the form, damping, errors of channels and deviations of modes are drawn, these of a
    size that is drawn, too; then what else a right model leaves, common to all FRFs, and noise.

    Parameters
    ----------
    problem : FitProblem
        With small deviations among its unknowns.
    effects : tuple of Effect
        At their values.
    discrepancy : float
        Level that a right model leaves, besides noise [nepers].
    rng : Generator
    """
    scatter = problem.scatter
    if scatter is not None and scatter.sizes:
        scatter = replace(scatter, eigenvalue=float(rng.choice(scatter.sizes)))
    problem = replace(problem, scatter=scatter, reduced=problem.reduced.with_forces_of(effects))
    data, lines = problem.data, np.arange(len(problem.data.frequency))
    function = problem.function(effects, [parameter_values(e) for e in effects], lines)
    prior = function.prior()
    x = function.start.copy()
    uncertain = np.arange(len(x)) >= len(function.variables)
    names = {e.name for e in effects}
    uncertain[: len(function.variables)] = [v.ref[0] not in names for v in function.variables]
    std = np.where(np.isfinite(prior.std), prior.std, 0.0)
    x[uncertain] = (prior.mean + std * rng.standard_normal(len(x)))[uncertain]
    x = np.clip(x, *function.limits().T)
    # what is far from nominal is not on a basis of the nominal model
    there = function.result(Solution(x, np.nan, np.nan, 0, True, np.empty((0, 0))))
    problem = problem.with_good_basis(there)
    function = problem.function(effects, [parameter_values(e) for e in effects], lines)
    H = function.receptance(x) * np.exp(_discrepancy(problem, discrepancy, rng))[:, None, None]
    parts = rng.standard_normal((2, *H.shape))
    H = H * (1 + data.noise * (parts[0] + 1j * parts[1]))
    m = data.measurement
    frf = m.frf.with_receptances(H, data.frequency)
    return replace(m, frf=frf, coherence=None, scatter=data.noise, compared=None)


def _discrepancy(problem: FitProblem, discrepancy: float, rng: np.random.Generator) -> Complexes:
    """Return what a right model leaves of ln H at all lines (n_freq,): as many numbers as fits count."""
    f = problem.data.frequency
    knots = np.linspace(f[0], f[-1], max(2, round(DATA_PER_MODE * problem.n_modes / 2)))
    real, imaginary = (np.interp(f, knots, rng.standard_normal(len(knots))) for _ in range(2))
    # between knots, the mean of two has 2/3 of their variance on average
    return discrepancy / np.sqrt(2) * np.sqrt(1.5) * (real + 1j * imaginary)
