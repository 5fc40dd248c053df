"""What effects do to the FRFs, and how alike that is."""

import numpy as np

from fem.array_types import Complexes
from updating.correlation import log_ratio
from updating.inference.fit import FitProblem
from updating.inference.fit_result import FitResult


def change_of(problem: FitProblem, fit: FitResult, base: FitResult) -> Complexes:
    """Return the logarithms of a fit's FRFs over those of another, at some lines, one after the other."""
    lines = problem.lines_up_to(np.inf, 60)
    ratio = log_ratio(problem.receptance(fit, lines), problem.receptance(base, lines))
    return np.nan_to_num(np.where(problem.data.mask[lines], ratio, 0.0)).ravel()


def similarity_of(a: Complexes, b: Complexes) -> float:
    """Return the correlation of two changes, 0 to 1."""
    norm = float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(abs(np.vdot(a, b).real) / norm) if norm > 0 else 0.0
