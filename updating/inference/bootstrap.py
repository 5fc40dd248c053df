"""Parametric bootstrap of an update: fits to what the fitted model would have been measured to be.

Each resample has the responses of the fitted model, with noise of the stated standard deviations and errors
of the model drawn from their priors: what the fit takes for random is random here. Where the misfit is above
the stated variance, so is the noise, as in the linearised deviations. A prior is a measurement too; its mean
is drawn about the fitted value. Each resample is fitted from the fitted values (Efron and Tibshirani, *An
Introduction to the Bootstrap*, 1993, sections 6.5 and 10.2).

In a linear problem the spread of these fits is the linearised covariance. Where they differ, bounds or
curvature matter.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fem.model import ModelError
from updating.inference.frf_data import FRFData
from updating.inference.mode_data import ModeData
from updating.inference.mode_residual import mode_residual
from updating.inference.unknowns import WIDTH
from updating.inference.update_problem import UpdateProblem
from updating.inference.update_stages import run_and_release
from updating.inference.updated import Ending, Updated

Floats = NDArray[np.float64]

ENDED = (Ending.CONVERGED, Ending.AT_BOUNDS)
"""Endings of refits that count."""


@dataclass(frozen=True, slots=True, eq=False)
class BootstrapModel:
    """What is drawn from and fitted again.

    Attributes
    ----------
    problem : UpdateProblem
        That of the update, which starts at the fitted values.
    x : ndarray (n,)
        Fitted values of the unknowns, on their scales.
    misfit : mapping of str to float
        Mean square residual of modes and FRFs in units of the stated variance [-].
    seed : int
    """

    problem: UpdateProblem
    x: Floats
    misfit: dict[str, float]
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
        if problem is None or updated.ending not in ENDED:
            msg = (
                f"the update {updated.ending.value[0]}: there is no fit to draw from; {updated.ending.remedy}"
            )
            raise ModelError(msg)
        if problem.settings.regularisation:
            msg = (
                "the update is regularised: its estimates are biased by a weight, which a bootstrap does not "
                "show; give priors in place of the regularisation"
            )
            raise ModelError(msg)
        x = np.array([u.to_x(p.value) for u, p in zip(problem.unknowns, updated.parameters, strict=True)])
        x = np.clip(x, *problem.limits)
        unknowns = tuple(
            replace(u, start=float(xi), std=np.inf, width=WIDTH)
            if p.released
            else replace(u, start=float(xi))
            for u, p, xi in zip(problem.unknowns, updated.parameters, x, strict=True)
        )
        gone = {name for name, _ in updated.left_out}
        settings = replace(problem.settings, select="", n_starts=1, n_samples=0, contradicted=np.inf)
        fixed = tuple((i, float(x[i])) for i, u in enumerate(unknowns) if u.name in gone)
        problem = replace(problem, unknowns=unknowns, settings=settings, fixed=fixed)
        return cls(problem, x, dict(updated.misfit), seed)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the unknowns."""
        return tuple(u.name for u in self.problem.unknowns)

    def resample(self, unit: int) -> UpdateProblem:
        """Return the problem with the data and priors of a resample; its number is its seed."""
        rng = np.random.default_rng([self.seed, unit])
        problem = self.problem
        unknowns = tuple(
            replace(u, mean=float(x + u.std * rng.standard_normal())) if u.has_prior else u
            for u, x in zip(problem.unknowns, self.x, strict=True)
        )
        modes = None if problem.modes is None else self._modes(problem.modes, rng)
        frf = None if problem.frf is None else self._frf(problem.frf, rng)
        return replace(problem, unknowns=unknowns, modes=modes, frf=frf)

    def _scale(self, kind: str) -> float:
        return float(np.sqrt(max(self.misfit.get(kind, 1.0), 1.0)))

    def _modes(self, data: ModeData, rng: np.random.Generator) -> ModeData:
        """Return modes of the fitted model with errors; those that the model lacks stay as they are."""
        point, scale = mode_residual(data, self.problem.model_at(self.x)), self._scale("modes")
        found = np.flatnonzero(point.pairs.partner >= 0)
        frequency = data.frequency.copy()
        root = np.linalg.cholesky(data.covariance[np.ix_(found, found)])
        error = scale * root @ rng.standard_normal(found.size)
        frequency[found] = point.pairs.computed[found] * np.exp(error)
        if data.shapes is None:
            # a tester counts modes by frequency
            return replace(data, frequency=frequency if data.numbers is not None else np.sort(frequency))
        shapes = data.shapes.copy()
        at = data.rows.T @ point.pairs.shapes
        for i in found:
            known = np.isfinite(shapes[:, i])
            partner = int(point.pairs.partner[i])
            space = next((list(s) for s in point.pairs.spaces if partner in s), [partner])
            own = at[known][:, space]
            psi = own @ np.linalg.lstsq(own, shapes[known, i], rcond=1e-9)[0]
            psi /= np.linalg.norm(psi)
            noise = scale * data.shape_std[i] / np.sqrt(known.sum()) * rng.standard_normal(known.sum())
            shapes[known, i] = (psi + noise) / np.linalg.norm(psi + noise)
        return replace(data, frequency=frequency, shapes=shapes)

    def _frf(self, data: FRFData, rng: np.random.Generator) -> FRFData:
        """Return FRFs of the fitted model with noise, shifts of its modes and gains."""
        n_lines = 4 * self.problem.settings.n_lines
        data = data.lines(np.inf, n_lines)
        staged, x = replace(self.problem, frf=data).based(self.x, 1.0, n_lines).with_nuisances(self.x)
        n = len(self.x)
        x[n:] = [u.std * rng.standard_normal() for u in staged.unknowns[n:]]
        residual = staged.based(x, 1.0, n_lines).residual
        assert residual is not None
        of_shifts, of_gains = staged.parts[2:]
        terms = residual.evaluate(
            staged.values(x),
            False,
            ratios=staged.ratios(x),
            shifts=None if staged.shift_knots is None else x[of_shifts][0] + x[of_shifts][1:],
            gains=x[of_gains] if staged.n_gains else None,
        )
        H, kept = data.H.copy(), data.mask
        real, imaginary = rng.standard_normal((2, int(kept.sum())))
        noise = self._scale("frf") * data.noise[kept] * (real + 1j * imaginary)
        if not data.phase:  # amplitudes alone: noise of the logarithm
            H[kept] = data.H[kept] * np.exp(terms.r + noise.real)
        else:
            H[kept] = data.H[kept] * np.exp(terms.r) + abs(data.H[kept]) * noise
        return replace(data, H=H)


def refit(model: BootstrapModel, unit: int) -> Floats:
    """Return the values of all unknowns fitted to a resample, (n,).

    Raises
    ------
    ModelError
        If the fit fails.
    """
    found = run_and_release(model.resample(unit))
    if found.ending not in ENDED:
        msg = f"the fit ended {found.ending.value[0]}: {found.ending.cause}"
        raise ModelError(msg)
    return np.array([p.value for p in found.parameters])
