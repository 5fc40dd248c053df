"""The probability model: what measured FRFs are, given a model and what frame theory has wrong."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.model import Effect, parameter_values
from fem.reduction.modal_responses import ModalResponses
from fem.reduction.modal_solution import ModeErrors
from fem.reduction.parametric_frf import ParametricFRF
from updating.correlation import log_ratio
from updating.diagnosis.evidence.marginal import LowRank, log_evidence, scale_from
from updating.diagnosis.evidence.priors import prior_of
from updating.inference.fit import FitProblem
from updating.inference.fit_function import FitFunction, by_unknowns
from updating.inference.fit_result import FitResult
from updating.least_squares.levenberg_marquardt import step_within

EIGENVALUE_SCALE = 0.01
"""Width of the half-normal prior of ε, by which eigenvalues of modes are off [-]: beams are within 1 %."""
DAMPING_SCALE = 0.3
"""The same of the logarithms of the modes' damping ratios [-]."""
SHAPE_SCALE = 0.05
"""The same of the modes' shapes at the sensors, in parts of what the mode does there [-]."""
EIGENVALUE_FLOOR, DAMPING_FLOOR, SHAPE_FLOOR = 0.003, 0.2, 0.015
"""The least of the three scales [-]: better than this frame theory is of no structure, so that what brings
errors of modes below it is no evidence."""
NOISE_TAIL = 6.0
"""Degrees of freedom of Student's distribution of the noise: its estimate may be off at some lines [-]."""
MODES_BEYOND = 1.3
"""Modes up to this multiple of the highest frequency may be off."""
MOST_VALUES = 6000
"""At most so many values of FRFs are looked at."""

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


@dataclass(frozen=True, slots=True, eq=False)
class Scales:
    """Standard deviations of the modes' errors: of ln λ, of ln ζ, and of shapes in parts of them [-]."""

    eigenvalue: float = 0.003
    damping: float = 0.1
    shape: float = 0.03


@dataclass(frozen=True, slots=True, eq=False)
class Fitted:
    """A model at its most probable unknowns.

    Attributes
    ----------
    result : FitResult
        Values of parameters, damping and effects, with standard deviations.
    errors : ModeErrors
    scales : Scales
    log_likelihood, log_evidence : float
    chi2 : float
        Mean square of what is left over the noise, 1 where the noise is all [-].
    """

    result: FitResult
    errors: ModeErrors
    scales: Scales
    log_likelihood: float
    log_evidence: float
    chi2: float
    left_db: float
    converged: bool


@dataclass(frozen=True, slots=True, eq=False)
class _Point:
    """Residuals over their noise at some unknowns, with derivatives and the shapes of errors.

    r (n_out, m), J (n_out, m, n), G (n_out, m, k); m are lines times excitations.
    """

    r: Complexes
    J: Complexes | None
    G: Complexes


@dataclass(eq=False)
class Posterior:
    """The posterior density of everything that varies in a fit, at some lines.

    The unknowns z are those of the fit's function (parameters, damping curve), then δ and κ of the modes.
    """

    problem: FitProblem
    function: FitFunction
    modes: slice
    noise: Floats

    @classmethod
    def of(
        cls,
        problem: FitProblem,
        effects: Sequence[Effect] = (),
        lines: NDArray[np.int64] | None = None,
        starts: Sequence[dict[str, float]] | None = None,
    ) -> "Posterior":
        """Return the posterior for effects added to the model."""
        starts = [parameter_values(e) for e in effects] if starts is None else starts
        lines = lines_for(problem) if lines is None else lines
        function = problem.function(effects, starts, lines)
        data = problem.data
        std = np.where(data.mask[lines], data.noise[lines], 1.0)
        weight = np.where(data.mask[lines], data.weight[lines], 1.0)
        # The weight holds what readings may have of motion square to them, in parts of MODEL_ERROR.
        across = np.maximum((0.05 / np.maximum(weight, 1e-9)) ** 2 - 0.05**2 - std**2, 0.0)
        noise = np.sqrt(std**2 + across + FLOOR**2)
        first = problem.reduced.basis.n_rigid
        lam = problem.reduced.main_modes[0]
        highest = (2 * np.pi * MODES_BEYOND * problem.data.frequency[-1]) ** 2
        last = max(first + 1, int(np.searchsorted(lam, highest)))
        return cls(problem, function, slice(first, last), noise)

    @property
    def n_modes(self) -> int:
        """How many modes may be off."""
        return self.modes.stop - self.modes.start

    @cached_property
    def priors(self) -> tuple[Floats, Floats]:
        """Mean and standard deviation of the unknowns of the fit's function."""
        prior = self.function.prior()
        mean, std = prior.mean.copy(), prior.std.copy()
        for k, v in enumerate(self.function.variables):
            if not v.has_prior:
                effect = next(e for e in self.function.effects if e.name == v.ref[0])
                mean[k], std[k] = prior_of(self.problem, effect, v)
        return mean, std

    def point(self, z: Floats, gradient: bool = True) -> _Point:
        """Return residuals and derivatives at some unknowns."""
        _, _, safe, keep = self._engine
        H, slopes, parts = self.responses(z, gradient)
        r = np.where(keep, log_ratio(H, safe), 0.0) / self.noise
        per = np.where(keep & (H != 0), 1 / (np.where(H != 0, H, 1.0) * self.noise), 0.0)
        J = None if slopes is None else _by_sensor(slopes * per)
        return _Point(_by_sensor(r[None])[:, :, 0], J, _by_sensor(parts * per))

    def responses(self, z: Floats, gradient: bool = True) -> tuple[Complexes, Complexes | None, Complexes]:
        """Return the receptances at some unknowns, their derivatives, and the part that each mode has.

        The last of the parts is that of all modes whose errors are not looked at.
        """
        fun, n_par = self.function, len(self.function.variables)
        n_x = len(z) - 2 * self.n_modes
        engine, hats, _, _ = self._engine
        values = np.array([v.to_value(xi) for v, xi in zip(fun.variables, z[:n_par], strict=True)])
        zeta = np.exp(hats @ z[n_par:n_x])
        at = ModalResponses.of(engine, values, zeta, self.errors(z))
        H, parts = at.H, at.parts()
        parts = np.concatenate([parts, (H - parts.sum(axis=0))[None]])
        if not gradient:
            return H, None, parts
        dH, by_zeta = at.slopes()
        slopes = np.reshape([v.slope(z[k]) * dH[k] for k, v in enumerate(fun.variables)], (n_par, *H.shape))
        curve = by_unknowns(zeta, hats, by_zeta)
        return H, np.concatenate([slopes, curve, *at.error_slopes()]), parts

    def errors(self, z: Floats) -> ModeErrors:
        """Return the modes' errors among the unknowns."""
        n = self.n_modes
        return ModeErrors(self.modes.start, z[len(z) - 2 * n : len(z) - n], z[len(z) - n :])

    @cached_property
    def _engine(self) -> tuple[ParametricFRF, Floats, Complexes, NDArray[np.bool_]]:
        """The engine, hat functions of damping, measured values (1 where they do not count), which count."""
        p, fun = self.problem, self.function
        f, measured, keep = p.data.frequency[fun.lines], p.data.H[fun.lines], fun.keep
        engine = p.engine(f, [v.ref for v in fun.variables], fun.effects)
        return engine, p.damping.hats(f), np.where(keep, measured, 1.0), keep

    def all_priors(self, scales: Scales) -> tuple[Floats, Floats]:
        """Return mean and standard deviation of all unknowns."""
        mean, std = self.priors
        n = self.n_modes
        both = np.concatenate([np.full(n, scales.eigenvalue), np.full(n, scales.damping)])
        return np.concatenate([mean, np.zeros(2 * n)]), np.concatenate([std, both])

    def limits(self) -> Floats:
        """Return the bounds of all unknowns, (n, 2)."""
        return np.vstack(
            [self.function.limits(), np.repeat([[-0.5, 0.5], [-2.0, 2.0]], self.n_modes, axis=0)]
        )

    def fit(self, x: Floats, scales: Scales = Scales(), *, max_iterations: int = 12) -> Fitted:
        """Find the most probable unknowns and scales from a start of the function's unknowns."""
        z = np.concatenate([x, np.zeros(2 * self.n_modes)]) if len(x) == len(self.function.start) else x
        lo, hi = self.limits().T
        z = np.clip(z, lo, hi)
        point, damping, converged, old = self.point(z), 1e-3, False, -np.inf
        assert point.J is not None
        weights = _first_weights(point, scales)
        for iteration in range(max_iterations):
            mean, std = self.all_priors(scales)
            low = _low_rank(point, weights, scales)
            value, g, A = _normal(point, weights, low, z - mean, std)
            moved = None
            for _ in range(5):
                H = A + np.diag(damping * np.diag(A))
                step: Any = -np.linalg.solve(H, g)
                step = step_within(step, H, g, (np.maximum(lo - z, -0.7), np.minimum(hi - z, 0.7)))
                trial = np.clip(z + step, lo, hi)
                try:
                    new = self.point(trial)
                except np.linalg.LinAlgError:
                    damping = min(10 * damping, 1e6)
                    continue
                # Compared with the same weights and shapes, as otherwise the covariance moves along.
                after = _value(new, weights, low, trial - mean, std)
                if np.isfinite(after) and after < value + 1e-9:
                    moved = trial, new
                    break
                damping = min(10 * damping, 1e6)
            if moved is not None:
                (z, point), damping = moved, max(damping / 10, 1e-7)
            low = _low_rank(point, weights, scales)
            weights = _weights(point, weights, low)
            low = _low_rank(point, weights, scales)
            scales = self._rescaled(z, point, weights, low, scales)
            now = self._evidence(z, point, weights, scales)
            if iteration > 2 and abs(now[1] - old) < 0.5:
                converged = True
                break
            old = now[1]
        log_likelihood, evidence, chi2, A = self._evidence(z, point, weights, scales)
        result = self._result(z, A, point)
        left = float(
            np.sqrt((np.real(point.r * _by_sensor(self.noise[None])[:, :, 0])[self._kept()] ** 2).mean())
        )
        return Fitted(
            result, self.errors(z), scales, log_likelihood, evidence, chi2, left * 8.685889638, converged
        )

    def _kept(self) -> NDArray[np.bool_]:
        return _by_sensor(self.function.keep[None].astype(float))[:, :, 0] > 0

    def _rescaled(self, z: Floats, point: _Point, weights: Floats, low: LowRank, scales: Scales) -> Scales:
        """Return the scales after a step towards the most probable ones."""
        _, std = self.all_priors(scales)
        _, _, A = _normal(point, weights, low, np.zeros(len(z)), std)
        variance = np.diag(np.linalg.inv(A))
        n, errors = self.n_modes, self.errors(z)
        out = []
        for values, s, var, typical in (
            (errors.eigenvalue, scales.eigenvalue, variance[-2 * n : -n], EIGENVALUE_SCALE),
            (errors.damping, scales.damping, variance[-n:], DAMPING_SCALE),
        ):
            out.append(scale_from(float(values @ values), n - float(var.sum()) / s**2, s, typical))
        root = np.sqrt(weights)
        amounts = scales.shape * low.amounts((root * point.r)[:, :, None])
        squares = float((np.abs(amounts) ** 2).sum())
        shape = scale_from(squares, 2 * low.certain(), scales.shape, SHAPE_SCALE)
        return Scales(max(out[0], EIGENVALUE_FLOOR), max(out[1], DAMPING_FLOOR), max(shape, SHAPE_FLOOR))

    def _evidence(
        self, z: Floats, point: _Point, weights: Floats, scales: Scales
    ) -> tuple[float, float, float, Floats]:
        mean, std = self.all_priors(scales)
        low = _low_rank(point, weights, scales)
        value, _, A = _normal(point, weights, low, z - mean, std)
        quadratic = value - 0.5 * float((((z - mean) / std) ** 2).sum())
        kept = self._kept()
        w, nu = weights[kept], NOISE_TAIL
        log_likelihood = -quadratic - low.log_det + float((np.log(w) - nu / 2 * (w - 1 - np.log(w))).sum())
        of_scales = -0.5 * (
            (scales.eigenvalue / EIGENVALUE_SCALE) ** 2
            + (scales.damping / DAMPING_SCALE) ** 2
            + (scales.shape / SHAPE_SCALE) ** 2
        )
        left = _left(point, weights, low)
        chi2 = float((np.abs(left[kept]) ** 2).mean() / 2)
        return log_likelihood, log_evidence(log_likelihood, z - mean, std, A) + of_scales, chi2, A

    def _result(self, z: Floats, A: Floats, point: _Point) -> FitResult:
        from updating.inference.solve import Solution

        n = len(self.function.start)
        covariance: Any = np.linalg.inv(A)[:n, :n]
        return self.function.result(Solution(z[:n], 0.0, 0.0, covariance, 0, True))


FLOOR = 0.003
"""Noise that is left in any case, of the mesh and the basis [-]."""


def _low_rank(point: _Point, weights: Floats, scales: Scales) -> LowRank:
    return LowRank.of(np.sqrt(weights)[:, :, None] * point.G, scales.shape)


def _left(point: _Point, weights: Floats, low: LowRank) -> Complexes:
    """Return residuals without the most probable errors of shapes, over the nominal noise."""
    amounts = low.s * low.amounts((np.sqrt(weights) * point.r)[:, :, None])
    return point.r - (point.G @ amounts)[:, :, 0]


def _first_weights(point: _Point, scales: Scales) -> Floats:
    size = np.abs(point.r) ** 2 / (1 + scales.shape**2 * (np.abs(point.G) ** 2).sum(axis=2))
    return (2 + NOISE_TAIL) / (NOISE_TAIL + size)


def _weights(point: _Point, before: Floats, low: LowRank) -> Floats:
    """Return the expected precision of each value's noise over the nominal one, (n_out, m)."""
    size = np.abs(_left(point, before, low)) ** 2 + 2 * low.variance() / before
    return (2 + NOISE_TAIL) / (NOISE_TAIL + size)


def _value(point: _Point, weights: Floats, low: LowRank, off: Floats, std: Floats) -> float:
    r = (np.sqrt(weights) * point.r)[:, :, None]
    return 0.5 * float(np.real((r.conj() * low.solved(r)).sum())) + 0.5 * float(((off / std) ** 2).sum())


def _normal(
    point: _Point, weights: Floats, low: LowRank, off: Floats, std: Floats
) -> tuple[float, Floats, Floats]:
    """Return ½ rᴴ C⁻¹ r + ½ Σ (off/std)², its gradient and Gauss and Newton's second derivatives."""
    assert point.J is not None
    root = np.sqrt(weights)[:, :, None]
    r, J = root * point.r[:, :, None], root * point.J
    Cr = low.solved(r)
    JH = J.conj().transpose(0, 2, 1)
    GJ = low.amounts(J)
    A = np.real((JH @ J).sum(axis=0))
    A = A - np.real((low.s * (JH @ low.G) @ GJ).sum(axis=0))
    g = np.real((JH @ Cr).sum(axis=0))[:, 0] + off / std**2
    value = 0.5 * float(np.real((r.conj() * Cr).sum())) + 0.5 * float(((off / std) ** 2).sum())
    return value, g, (A + A.T) / 2 + np.diag(1 / std**2)


def _by_sensor(X: NDArray[Any]) -> NDArray[Any]:
    """Return (n, n_freq, n_out, n_in) as (n_out, n_freq n_in, n)."""
    n, f, o, i = X.shape
    return np.ascontiguousarray(X.transpose(2, 1, 3, 0)).reshape(o, f * i, n)


def lines_for(problem: FitProblem, most: int = MOST_VALUES) -> NDArray[np.int64]:
    """Return the lines that are compared: all alike, not those that are held out."""
    _, n_out, n_in = problem.data.H.shape
    return problem.lines_up_to(np.inf, max(60, min(problem.n_lines, most // (n_out * n_in))))
