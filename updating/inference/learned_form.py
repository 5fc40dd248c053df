"""What fits to frames that lack nothing teach of the form: mean and spread of each kind of its parameters.

What data say of the parameters, whatever was believed of them, follows from a fit's covariance. The mean and
the standard deviation of a kind are unknowns of all frames together (a hierarchical model: Gelman et al.,
Bayesian Data Analysis, 3rd ed., ch. 5). Few frames change little of what is usual, many replace it.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import minimize

from fem.array_types import Floats
from updating.inference.fit_result import FitResult
from updating.inference.form import FORMS, place_of
from updating.inference.parameters import Nuisance
from updating.inference.problem import Problem

Kind = tuple[str, str]
"""Where in a frame, and which parameter: ``("corner", "u")``."""
Priors = Mapping[Kind, tuple[float, float]]
"""Mean and standard deviation of kinds of parameters [unit of the parameter]."""
COMMON = 0.5
"""Part of the usual variance that all frames have in common; by the rest they differ [-]."""
WIDTH = 0.7
"""Standard deviation of the logarithm of how much they differ [-]."""
AROUND = np.linspace(-3.0, 3.0, 13)
"""Distances from the most probable mean and spread that are summed over, in standard deviations [-]."""
STEP = 0.02
"""Step of second differences, in standard deviations before any frame [-]."""


@dataclass(frozen=True, slots=True, eq=False)
class FormData:
    """What the data of a frame say of n parameters of its form.

    Attributes
    ----------
    kinds : tuple of Kind
        Of each parameter.
    usual : ndarray (2, n)
        Means and standard deviations of what was believed [unit of the parameter].
    precision : ndarray (n, n)
        Of the data alone.
    pull : ndarray (n,)
        The precision times the values that the data alone would have.
    """

    kinds: tuple[Kind, ...]
    usual: Floats
    precision: Floats
    pull: Floats

    @classmethod
    def of(cls, problem: Problem[Any], fitted: FitResult) -> "FormData":
        """Return what a fit without effects says; of what it has not varied, nothing."""
        refs, model = list(fitted.values), problem.reduced.model
        form = [
            (refs.index(n.refs[0]), n, effect)
            for n in problem.nuisances
            if isinstance(n, Nuisance) and n.refs[0] in refs
            if isinstance(effect := model.effect(n.effect), FORMS)
        ]
        rows = [i for i, _, _ in form]
        C = fitted.covariance[np.ix_(rows, rows)]
        x = np.array([fitted.values[refs[i]] for i in rows])
        mean, std = usual = np.array([(n.mean or 0.0, n.std) for _, n, _ in form]).reshape(-1, 2).T
        size, V = np.linalg.eigh(np.linalg.inv(C) - np.diag(std**-2.0))
        pull = np.linalg.solve(C, x) - mean / std**2
        kinds = tuple((place_of(effect), n.parameter) for _, n, effect in form)
        return cls(kinds, usual, V * np.maximum(size, 0.0) @ V.T, pull)

    def log_evidence(self, priors: Priors) -> float:
        """Return the logarithm of the evidence with other means and spreads, up to a constant."""
        own = [priors.get(kind, tuple(now)) for kind, now in zip(self.kinds, self.usual.T, strict=True)]
        mean, std = np.array(own).reshape(-1, 2).T
        A, b = self.precision + np.diag(std**-2.0), self.pull + mean / std**2
        log_det = np.linalg.slogdet(A)[1] + 2 * np.log(std).sum()
        return 0.5 * float(b @ np.linalg.solve(A, b) - log_det - ((mean / std) ** 2).sum())


def usual(frames: Iterable[FormData]) -> dict[Kind, tuple[float, float]]:
    """Return what was believed of each kind that some frames have; of several beliefs the last."""
    return {k: (float(m), float(s)) for f in frames for k, (m, s) in zip(f.kinds, f.usual.T, strict=True)}


def learned(
    frames: Sequence[FormData], kinds: Iterable[Kind] | None = None
) -> dict[Kind, tuple[float, float]]:
    """Return mean and standard deviation of each kind in a frame that is to come.

    They are those of the parameter's distribution summed over all means and spreads that these frames leave
    possible, the other kinds at their most probable.

    Parameters
    ----------
    frames : sequence of FormData
        Without anything missing.
    kinds : iterable of Kind, optional
        Others stay as usual; all unless given.
    """
    now = usual(frames)
    chosen = [kind for kind in now if kinds is None or kind in kinds]
    centre, spread = np.array([now[kind] for kind in chosen]).reshape(-1, 2).T

    def priors(z: Floats) -> dict[Kind, tuple[float, float]]:
        # Before any frame, the sum over both has the usual mean and variance.
        mean = centre + np.sqrt(COMMON) * spread * z[0]
        std = np.sqrt(1 - COMMON) * spread * np.exp(WIDTH * (z[1] - WIDTH))
        return {k: (float(m), float(s)) for k, m, s in zip(chosen, mean, std, strict=True)}

    def cost(z: Floats) -> float:
        own = priors(z.reshape(2, -1))
        return 0.5 * float(z @ z) - sum(f.log_evidence(own) for f in frames)

    if not chosen:
        return {}
    found = minimize(cost, np.zeros(2 * len(chosen)), method="L-BFGS-B")
    best = found.x.reshape(2, -1)

    def near(i: int, of_mean: float, of_spread: float) -> tuple[float, tuple[float, float]]:
        """Return the cost, and mean and spread, of a kind at distances from its most probable."""
        z = best.copy()
        z[:, i] += of_mean, of_spread
        return cost(z.ravel()), priors(z)[chosen[i]]

    out = {}
    for i, kind in enumerate(chosen):
        wide = [
            STEP / np.sqrt(max(near(i, *off)[0] + near(i, *-off)[0] - 2 * found.fun, STEP**2))
            for off in STEP * np.eye(2)
        ]
        each = [near(i, wide[0] * a, wide[1] * b) for a in AROUND for b in AROUND]
        costs, pairs = zip(*each, strict=True)
        weight = np.exp(min(costs) - np.array(costs))
        mean, std = np.array(pairs).T
        average = float(weight @ mean / weight.sum())
        square = float(weight @ (std**2 + (mean - average) ** 2) / weight.sum())
        out[kind] = (average, float(np.sqrt(square)))
    return out
