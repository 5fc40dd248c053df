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

import numpy as np
from numpy.typing import NDArray

from fem.model import ModelError
from updating.inference.fit import FitProblem
from updating.inference.fit_data import FitData
from updating.inference.fitting import refit as fitted_again
from updating.inference.joint_fit import mode_problem_of
from updating.inference.mode_fit import ModeProblem, matched_modes
from updating.inference.mode_targets import ModeTargets
from updating.inference.scatter import form_scatter
from updating.inference.unknowns import Uncertain, Unknown, nuisance_unknowns
from updating.inference.updated import Ending, Updated

Floats = NDArray[np.float64]

ENDED = (Ending.CONVERGED, Ending.AT_BOUNDS)
"""Endings of refits that count."""


@dataclass(frozen=True, slots=True, eq=False)
class BootstrapModel:
    """What is drawn from and fitted again.

    Attributes
    ----------
    updated : Updated
    problem : FitProblem or ModeProblem
        That of the update, with the small deviations of its end.
    seed : int
    """

    updated: Updated
    problem: FitProblem | ModeProblem
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
        problem = replace(problem, scatter=form_scatter(problem, fitted, fitted.size))
        return cls(updated, problem, seed)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return self.updated.names

    def resample(self, unit: int) -> FitProblem | ModeProblem:
        """Return the problem with the data and priors of a resample; its number is its seed."""
        rng = np.random.default_rng([self.seed, unit])
        nuisances = self._nuisances(rng)
        problem = self.problem
        if isinstance(problem, ModeProblem):
            return replace(problem, nuisances=nuisances, targets=self._modes(problem, rng))
        mode_problem = mode_problem_of(problem)
        modes = None if mode_problem is None else self._modes(mode_problem, rng)
        return replace(problem, nuisances=nuisances, data=self._frf(problem, rng), modes=modes)

    def _nuisances(self, rng: np.random.Generator) -> tuple[Uncertain, ...]:
        """Return the uncertain parameters with priors about values drawn about the fitted ones."""
        problem, values = self.problem, self.updated.fitted.values
        scaled = nuisance_unknowns(problem.reduced.model, problem.nuisances)
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

    def _scale(self, kind: str) -> float:
        return float(np.sqrt(max(self.updated.misfit.get(kind, 1.0), 1.0)))

    def _modes(self, problem: ModeProblem, rng: np.random.Generator) -> ModeTargets:
        """Return modes of the fitted model with errors; those that the model lacks stay as they are."""
        targets, scale = problem.targets, self._scale("modes")
        every = np.arange(targets.n)
        function = problem.function((), (), every)
        at = function.modes_at(function.moved_to(self.updated.fitted))
        partner = matched_modes(problem, at, every).partner
        f, zeta, shapes = targets.frequency.copy(), targets.zeta.copy(), targets.shapes.copy()
        for i, mode in enumerate(at.damped(partner)):
            if mode is None:
                continue
            a, b = rng.standard_normal(2)
            f[i] = mode.frequency * np.exp(scale * targets.frequency_std[i] * a)
            zeta[i] = mode.zeta * np.exp(scale * targets.zeta_std[i] * b) if np.isfinite(zeta[i]) else np.nan
            if not targets.has_shapes:
                continue
            known = np.isfinite(shapes[:, i])
            phi = (at.outputs.T @ mode.vector)[known]
            psi = shapes[known, i]
            psi = phi * (phi.conj() @ psi) / (phi.conj() @ phi)
            error = rng.standard_normal(known.sum())
            if np.iscomplexobj(shapes):
                error = error + 1j * rng.standard_normal(known.sum())
            else:
                psi = psi.real
            size = np.linalg.norm(psi)
            psi = psi + scale * size * targets.shape_std[i] / np.sqrt(known.sum()) * error
            shapes[known, i] = psi / np.linalg.norm(psi)
        if not targets.has_shapes and targets.numbers is None:
            f = np.sort(f)  # a tester counts modes by frequency
        return replace(targets, frequency=f, zeta=zeta, shapes=shapes)

    def _frf(self, problem: FitProblem, rng: np.random.Generator) -> FitData:
        """Return FRFs of the fitted model with noise and other small deviations."""
        data = problem.data
        function = problem.function((), (), np.arange(len(data.frequency)))
        x = function.moved_to(self.updated.fitted)
        if problem.scatter is not None:
            x[-len(problem.scatter.std) :] = rng.standard_normal(len(problem.scatter.std))
        H, kept = data.H.copy(), data.mask & (data.weight > 0)
        ratio = function(x, False)[0] / data.weight[data.mask]
        ratio = ratio[data.weight[data.mask] > 0]
        real, imaginary = rng.standard_normal((2, int(kept.sum())))
        noise = self._scale("frf") * data.noise[kept] * (real + 1j * imaginary)
        if not data.phase:  # amplitudes alone: noise of the logarithm
            H[kept] = H[kept] * np.exp(ratio + noise.real)
        else:
            H[kept] = H[kept] * np.exp(ratio) + abs(H[kept]) * noise
        return replace(data, H=H)


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
