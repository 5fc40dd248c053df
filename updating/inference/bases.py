"""Better reduced bases: with responses or modes of a fitted model, where its fit's own basis errs."""

import numpy as np

from fem.analysis.modes import n_unstable, solve_eigenpairs
from fem.reduction.reduced_model import ReducedModel
from fem.system import assemble
from updating.inference.fit import FitProblem
from updating.inference.fit_result import FitResult
from updating.inference.mode_fit import ModeProblem
from updating.inference.preparation import direct_responses, fitted_model

BASIS_SHARE, BASIS_LINES = 0.03, (16, 24)
"""Share of the level that a basis may err by, and at how many lines responses join it, once and again."""
LEAST_SHAPE = 1e-4
"""What a basis lacks of responses in directions smaller than this share of them does not join it [-]."""
N_BASES = 2
"""Number of further fits of a calibration, each with its own modes in the basis."""
HIGHEST = 1.2
"""Modes up to this multiple of the highest measured frequency join the basis of a fit to modes [-]."""


def better_basis(
    problem: FitProblem | ModeProblem, result: FitResult, n_lines: int = BASIS_LINES[0]
) -> tuple[float, ReducedModel] | None:
    """Return the error of the basis and a better one; None where the error is small against the level.

    With responses of the fitted model at some lines, whose error is in nepers, or with its modes, whose error
    is relative.
    """
    if isinstance(problem, ModeProblem):
        return _with_modes(problem, result)
    error, responses = direct_responses(problem, result, n_lines)
    if error <= BASIS_SHARE * result.level / np.sqrt(2):
        return None
    return error, problem.reduced.with_shapes(responses, LEAST_SHAPE)


def _with_modes(problem: ModeProblem, result: FitResult) -> tuple[float, ReducedModel] | None:
    model = fitted_model(problem.reduced.model, result)
    top = HIGHEST * float(problem.targets.frequency[-1])
    try:
        system = assemble(model, reciprocal=False)
        # Unstable beyond the basis: its shapes would make fits unstable, too. Far below zero lies one
        # eigenvalue, beside which all others look alike: to compute them would take minutes.
        if n_unstable(system):
            return None
        pairs = solve_eigenpairs(system, max_frequency=top, unstable=True)
        f = np.sqrt(np.maximum(pairs.eigenvalues[pairs.n_rigid :], 0.0)) / (2 * np.pi)
        if (f <= 0).any():
            return None
        refs = list(result.values)
        at = problem.parametric(problem.targets.fitted, refs, result.effects).at(
            np.array([result.values[r] for r in refs]),
            problem.damping.ratio(problem.targets.frequency[problem.targets.fitted], result.zeta),
        )
        reduced = at.pairs(0)
        g = reduced.frequency[reduced.n_rigid :]
        n = min(len(f), len(g))
        error = float(np.abs(np.log(g[:n] / f[:n])).max(initial=0.0))
        if error <= BASIS_SHARE * problem.data.noise_level:
            return None
        return error, problem.reduced.with_shapes(np.asarray(system.Q @ pairs.vectors))
    except (np.linalg.LinAlgError, ValueError):
        return None
