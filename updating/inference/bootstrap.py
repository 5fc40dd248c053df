"""Parametric bootstrap of an update: fits to what the fitted model would have been measured to be.

Each resample has the responses of the fitted model, with noise of the stated standard deviations and the
form's small deviations drawn from their priors: what the fit takes for random is random here. Where the
misfit is above the stated variance, so is the noise. A prior is a measurement too; its mean is drawn about
the fitted value. Each resample is fitted from the fitted values (Efron and Tibshirani, *An Introduction to
the Bootstrap*, 1993, sections 6.5 and 10.2).

In a linear problem the spread of these fits is the linearised covariance. Where they differ, bounds or
curvature matter.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fem.array_types import Floats
from fem.model import ModelError
from updating.inference.fitting import refit as fitted_again
from updating.inference.problem import Problem
from updating.inference.unknowns import Uncertain, Unknown
from updating.inference.updated import Ending, Updated

ENDED = (Ending.CONVERGED, Ending.AT_BOUNDS)
"""Endings of refits that count."""


@dataclass(frozen=True, slots=True, eq=False)
class BootstrapModel:
    """What is drawn from and fitted again.

    Attributes
    ----------
    updated : Updated
    problem : Problem
        That of the update, with the small deviations of its end.
    seed : int
    """

    updated: Updated
    problem: Problem[Any]
    seed: int

    @classmethod
    def of(cls, updated: Updated, seed: int = 0) -> "BootstrapModel":
        """Return the model of an update.

        Raises
        ------
        ModelError
            If the update failed or was regularised.
        """
        problem = updated.problem
        if updated.ending not in ENDED:
            msg = (
                f"the update {updated.ending.value[0]}: there is no fit to draw from; {updated.ending.remedy}"
            )
            raise ModelError(msg)
        if updated.settings.regularisation:
            msg = (
                "the update is regularised: its estimates are biased by a weight, which a bootstrap does not "
                "show; give priors in place of the regularisation"
            )
            raise ModelError(msg)
        fitted = updated.fitted
        problem = replace(problem, scatter=problem.small_deviations(fitted, fitted.size))
        return cls(updated, problem, seed)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return self.updated.names

    def resample(self, unit: int) -> Problem[Any]:
        """Return the problem with the data and priors of a resample; its number is its seed."""
        rng = np.random.default_rng([self.seed, unit])
        nuisances = self._nuisances(rng)
        drawn = self.problem.resampled(self.updated.fitted, self.updated.misfit, rng)
        return replace(drawn, nuisances=nuisances)

    def _nuisances(self, rng: np.random.Generator) -> tuple[Uncertain, ...]:
        """Return the uncertain parameters with priors about values drawn about the fitted ones."""
        problem, values = self.problem, self.updated.fitted.values
        scaled = problem.nuisance_unknowns
        out = []
        for u in scaled:
            x = float(np.clip(u.to_x(values[u.ref]), u.low, u.high))
            mean = u.to_value(x + u.std * rng.standard_normal()) if u.has_prior else None
            out.append(
                Unknown(
                    u.refs,
                    std=u.std * (1.0 if u.log else u.scale) if u.has_prior else None,
                    prior="log-normal" if u.log else "normal",
                    mean=mean,
                    start=u.to_value(x),
                    lower=u.to_value(u.low),
                    upper=u.to_value(u.high),
                    name=u.name,
                )
            )
        return tuple(out)


def refit(model: BootstrapModel, unit: int) -> Floats:
    """Return the values of all parameters fitted to a resample, (n,).

    Raises
    ------
    ModelError
        If the fit fails.
    """
    updated = model.updated
    settings, known = updated.settings, {p.name: p.value for p in updated.parameters}
    problem = model.resample(unit)
    found = fitted_again(
        problem,
        updated.fitted,
        n_lines=settings.n_lines,
        counted_as=settings.n_lines,
        max_iterations=settings.max_iterations,
        tolerance=1e-6,
    )
    if not found.solution.converged:
        msg = f"the fit ended {Ending.OUT_OF_ITERATIONS.value[0]}: {Ending.OUT_OF_ITERATIONS.cause}"
        raise ModelError(msg)
    damping = iter(found.zeta.tolist())
    return np.array(
        [found.values.get(p.refs[0], known[p.name]) if p.refs else next(damping) for p in updated.parameters]
    )
