"""Predictions of each sensor's FRFs from all the others, whatever the physics that a model lacks.

A missing effect acts on the model by forces that nobody knows, and changes the field of motion smoothly along
the structure; a fault changes one sensor's readings alone. So the field at each line is taken as that of the
model plus the response to random forces everywhere,

    u = H f + Φ q,   q_r ~ N(0, s² / ((λ_r - ω²)² + (β ω²)²)),

which are white in space, as measured by the mass: the modes near the line vary most. The readings of all
sensors but one give q and with it the field where that one sits (Gaussian regression; Rasmussen & Williams,
Gaussian Processes for Machine Learning, 2006, sections 2.2 and 5.4.2).
"""

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg as sla

from fem.array_types import Bools, Complexes, Floats, Ints
from fem.system import sum_contributions
from updating.inference.fit import FitProblem
from updating.inference.fit_result import FitResult
from updating.measurement.measurement import MOTION

_WIDTH = 0.15
"""β: modes within this fraction of ω² vary alike [-]."""


_SHARES = (0.03, 0.1, 0.3, 1.0)
"""Tried for how much of the field the model does not know [-]."""

_ERRORS = (0.01, 0.03, 0.1)
"""Tried for how exact a reading is besides its noise [-]."""


@dataclass(frozen=True, slots=True, eq=False)
class Field:
    """The model's motion at some lines, in modal coordinates, and how much of it is unknown.

    Attributes
    ----------
    lines : ndarray of int (n_lines,)
        Lines of the data.
    frequency : ndarray (n_lines,)
        [Hz].
    shapes : ndarray (n_dof, r)
        Φ, modes of the reduced model with the fitted values.
    mean : ndarray (n_lines, r, n_in)
        Modal coordinates of the model's response to the excitations.
    eigenvalues : ndarray (r,)
        λ [rad²/s²].
    loose : ndarray of bool (r,)
        Shapes of the model without its releasable constraints, which do not take part in the mean.
    respond : callable
        Takes other forces (n_dof, n) to the modal coordinates of the response, (n_lines, r, n).
    """

    lines: Ints
    frequency: Floats
    shapes: Floats
    mean: Complexes
    eigenvalues: Floats
    loose: Bools
    respond: Callable[[Floats], Complexes]

    def weight(self, rough: float, loose: float, lines: slice = slice(None)) -> Floats:
        """Return the variances of modal coordinates, up to a factor, (n_lines, r).

        (1 + rough² λ/ω²) / ((λ - ω²)² + (β ω²)²), times ``loose``² for loose shapes.
        """
        lam, square = self.eigenvalues, (2 * np.pi * self.frequency[lines, None]) ** 2
        out = (1 + rough**2 * lam / square) / ((lam - square) ** 2 + (_WIDTH * square) ** 2)
        return out * np.where(self.loose, loose**2, 1.0)

    @classmethod
    def of(cls, problem: FitProblem, result: FitResult) -> "Field":
        """Return the field of a fitted model for the problem's excitations."""
        data, model, basis = problem.data, problem.reduced.model, problem.reduced.basis
        # At most this many lines are predicted
        every = np.linspace(0, len(data.frequency) - 1, 200)
        lines = np.unique(every.round().astype(np.int64))
        f = data.frequency[lines]
        omega = 2 * np.pi * f
        released = {key for e in result.effects for key in e.released()}
        columns = [
            *range(basis.n_main),
            *(basis.n_main + i for i, k in enumerate(basis.keys) if k in released),
        ]
        names = {e.name for e in model.effects}
        fitted = model.with_values({ref: v for ref, v in result.values.items() if ref[0] in names})
        parts = tuple(c for e in (*fitted.effects, *result.effects) for c in model.parts_of(e))
        full = sum_contributions(parts, model.n_dof)
        T = basis.T[:, columns]
        K, M, C, D = (np.asarray(T.T @ (X @ T)) for X in full)
        lam, V = sla.eigh(K, M, check_finite=False)
        d = model.damping
        zeta = problem.damping.ratio(f, result.zeta)
        zeta, *connections = np.atleast_2d(zeta)
        diagonal = lam * (1 + 1j * (d.loss_factor + omega * d.beta))[:, None]
        by_zeta = np.sqrt(np.maximum(lam, 0.0)) * omega[:, None] if problem.viscous else lam
        diagonal = diagonal + 2j * zeta[:, None] * by_zeta + (1j * omega * d.alpha - omega**2)[:, None]
        shapes = T @ V
        springs = [e for e in (*fitted.effects, *result.effects) if e.connection]
        G: Any = sum_contributions(tuple(c for e in springs for c in model.parts_of(e)), model.n_dof)[0]
        Z: Any = None
        if C.any() or D.any() or (connections and G.nnz):
            C, D, G = V.T @ C @ V, V.T @ D @ V, shapes.T @ (G @ shapes)
            Z = 1j * (omega[:, None, None] * C + D)
            for ratio in connections:
                Z += 2j * (ratio - zeta)[:, None, None] * G
            r = np.arange(len(lam))
            Z[:, r, r] += diagonal
        modes, free = shapes, np.zeros(0)
        if len(columns) < basis.T.shape[1]:
            K, M = (np.asarray(basis.T.T @ (X @ basis.T)) for X in full[:2])
            free, V = sla.eigh(K, M, check_finite=False)
            shapes, lam = np.hstack([shapes, basis.T @ V]), np.concatenate([lam, free])

        def respond(forces: Floats) -> Complexes:
            force = modes.T @ forces
            if Z is None:
                mean = (force / diagonal[:, :, None]).astype(complex)
            else:
                mean = np.linalg.solve(Z, np.broadcast_to(force.astype(complex), (len(f), *force.shape)))
            loose = np.zeros((len(f), len(free), mean.shape[2]), dtype=complex)
            return np.concatenate([mean, loose], axis=1)

        loose = np.arange(len(lam)) >= len(columns)
        return cls(lines, f, shapes, respond(problem.vectors[1]), np.maximum(lam, 0.0), loose, respond)


@dataclass(frozen=True, slots=True, eq=False)
class CrossPrediction:
    """Readings of each sensor as predicted from the other sensors.

    Attributes
    ----------
    field : Field
    measured : ndarray (n_lines, n_out, n_in)
        y, receptances.
        Readings of other quantities are multiplied so that they are as large as those of motions.
    seen : ndarray of bool (n_lines, n_out, n_in)
        Values that count.
    variance : ndarray (n_lines, n_out, n_in)
        Of y minus its prediction, the noise of y included.
    prior : (float, float, float, float)
        Share of the field that the model does not know, error of readings, rough and loose parts [-].
    rows : ndarray (n_out, r)
        Readings of modal coordinates.
    inverse : ndarray (n_lines, n_in, n_out, n_out)
        S⁻¹, of the covariance of readings.
    """

    field: Field
    measured: Complexes
    seen: Bools
    variance: Floats
    prior: tuple[float, float, float, float]
    rows: Floats
    inverse: Floats
    _weight: Floats
    _scale: Floats
    _alpha: Complexes

    @property
    def predicted(self) -> Complexes:
        """Each sensor's reading from all the others', shape (n_lines, n_out, n_in)."""
        diagonal = np.einsum("lioo->lio", self.inverse)
        return self.measured - (self._alpha / diagonal).transpose(0, 2, 1)

    def without(self, sensors: tuple[int, ...]) -> tuple[Complexes, Floats]:
        """Predict some sensors from all others, (n_lines, k, n_in), and the variances, alike."""
        I = list(sensors)
        block = np.linalg.inv(self.inverse[:, :, I][:, :, :, I])
        error = np.einsum("liab,lib->lia", block, self._alpha[:, :, I])
        variance = np.einsum("liaa->lai", block).real
        return self.measured[:, I] - error.transpose(0, 2, 1), variance

    def elsewhere(self, sensor: int, rows: Floats) -> Complexes:
        """Predict motions ``rows`` (k, r) of modal coordinates from all sensors but one.

        Returns
        -------
        ndarray (k, n_lines, n_in)
        """
        column = self.inverse[:, :, :, sensor]
        alpha = self._alpha - column * (self._alpha[:, :, sensor] / column[:, :, sensor])[:, :, None]
        alpha[:, :, sensor] = 0
        return np.moveaxis(self._motion(rows, alpha, self._read_with(rows)), 1, 0)

    def everywhere(self, rows: Floats) -> tuple[Complexes, Floats]:
        """Predict motions ``rows`` (k, r) of modal coordinates from all sensors.

        Returns
        -------
        motion : ndarray (n_lines, k, n_in)
        variance : ndarray (n_lines, k, n_in)
        """
        cross = self._read_with(rows)
        # of one excitation, up to its factor
        known = ((cross[:, None] @ self.inverse) * cross[:, None]).sum(axis=-1) * self._scale[:, :, None]
        variance = ((self._weight @ (rows**2).T)[:, None] - known) * self._scale[:, :, None]
        return self._motion(rows, self._alpha, cross), np.maximum(variance, 0.0).transpose(0, 2, 1)

    def _read_with(self, rows: Floats) -> Floats:
        """Return covariances of motions and readings, (n_lines, k, n_out), of an excitation's factor 1."""
        return (rows * self._weight[:, None, :]) @ self.rows.T

    def _motion(self, rows: Floats, alpha: Complexes, cross: Floats) -> Complexes:
        scaled = alpha.transpose(0, 2, 1) * self._scale[:, None, :]
        out: Complexes = rows @ self.field.mean + cross @ scaled
        return out


def cross_predict(problem: FitProblem, field: Field) -> CrossPrediction:
    """Predict every sensor of a problem from the others.

    The share of the field that is unknown, the error of readings, and the rough and loose parts are those, of
    a few, with which the sensors predict one another best (the pseudo-likelihood of Rasmussen & Williams,
    equation 5.11, with Student's t in place of the normal density).
    """
    few = slice(None, None, max(1, len(field.lines) // 50))
    # Tried for the part of motions that violate a constraint, as a support that gives way causes [-]
    loose = (0.0, 0.3) if field.loose.any() else (0.0,)
    # Tried for the part of the forces that is white in strain, as a missing local stiffness causes [-]
    trials = list(itertools.product((0.0, 0.3), loose))
    levels = list(itertools.product(_SHARES, _ERRORS))
    chosen = max(levels, key=lambda t: _score(problem, field, (*t, 0.0, 0.0), few))
    prior = max(((*chosen, *t) for t in trials), key=lambda t: _score(problem, field, t, few))
    prior = max(((*t, *prior[2:]) for t in levels), key=lambda t: _score(problem, field, t, few))
    return _predicted(problem, field, prior, slice(None))


def rival_predictions(problem: FitProblem, X: CrossPrediction, sensor: int) -> list[CrossPrediction]:
    """Return predictions where something acts on the structure near a sensor.

    An unknown force and moments of any size, at the sensor, at the four next to it, or half way to them,
    explain the forces of a local effect there, such as a mass or a loss of stiffness.
    """
    mesh, m = problem.reduced.model.mesh, problem.data.measurement.sensors
    position = m[sensor].point
    apart = np.linalg.norm(np.array([s.point for s in m]) - position, axis=1)
    near = [m[k].point for k in np.argsort(apart) if apart[k] > 1e-6 * mesh.size][:4]
    chosen = [position, *(xyz for p in near for xyz in ((position + p) / 2, p))]
    d = np.asarray(m[sensor].direction)
    out = []
    for point in dict.fromkeys(mesh.nearest_point(xyz)[0] for xyz in chosen):
        forces = np.zeros((problem.reduced.model.n_dof, 3))
        forces[6 * point : 6 * point + 3, 0] = d
        forces[6 * point + 3 : 6 * point + 6, 1:] = np.linalg.svd(d[None])[2][1:].T
        out.append(_predicted(problem, X.field, X.prior, slice(None), forces))
    return out


def less_certain(problem: FitProblem, X: CrossPrediction, least_share: float = 0.0) -> CrossPrediction:
    """Return predictions with looser constraints, and with at least a given unknown share of the field.

    Parameters
    ----------
    problem : FitProblem
    X : CrossPrediction
    least_share : float
        Of the field, that the model does not know [-].
    """
    share, error, rough, loose = X.prior
    free = 3.0 if X.field.loose.any() else loose
    return _predicted(problem, X.field, (max(share, least_share), error, rough, free), slice(None))


def _score(
    problem: FitProblem, field: Field, prior: tuple[float, float, float, float], lines: slice
) -> float:
    X = _predicted(problem, field, prior, lines)
    z2 = np.abs(X.measured - X.predicted) ** 2 / X.variance
    power = (X.seen * np.abs(X.measured) ** 2).mean(axis=1)[:, None]
    density = np.log(np.where(power > 0, power, 1.0) / X.variance) - 3 * np.log1p(z2 / 3)
    return float(density[X.seen].mean()) if X.seen.any() else 0.0


def _predicted(
    problem: FitProblem,
    field: Field,
    prior: tuple[float, float, float, float],
    some: slice,
    forces: Floats | None = None,
) -> CrossPrediction:
    data, lines = problem.data, field.lines[some]
    share, error, rough, loose = prior
    weight = field.weight(rough, loose, some)
    rows = problem.vectors[0].T @ field.shapes
    like_motions = _like_motions(problem, field, rows)
    y, rows = data.H[lines] * like_motions[:, None], rows * like_motions[:, None]
    seen = data.mask[lines] & (y != 0)
    power = np.where(seen, np.abs(y) ** 2, 0.0)
    mean_power = power.sum(axis=1) / np.maximum(seen.sum(axis=1), 1)
    mean_power = np.where(mean_power > 0, mean_power, 1.0)
    covariance = (rows * weight[:, None, :]) @ rows.T
    unit = mean_power / np.maximum(np.einsum("loo->l", covariance) / len(rows), 1e-300)[:, None]
    delta = np.where(seen, y - rows @ field.mean[some], 0.0).transpose(0, 2, 1)
    if forces is not None:
        lam, square = field.eigenvalues, (2 * np.pi * field.frequency[some, None]) ** 2
        # β for the response to a force at a known place: damping [-]
        response = (lam - square) / ((lam - square) ** 2 + (0.02 * square) ** 2) * ~field.loose
        h = (rows * response[:, None, :]) @ (forces.T @ field.shapes).T
        h = h / np.sqrt(np.maximum((h**2).mean(axis=1), 1e-300))[:, None, :]
        covariance = (
            covariance
            + (h @ h.transpose(0, 2, 1))
            / np.maximum(share**2 * unit.max(axis=1), 1e-300)[:, None, None]
            * mean_power.max(axis=1)[:, None, None]
        )
    at = np.arange(len(rows))
    S = (share**2 * unit)[:, :, None, None] * covariance[:, None]
    noise = (error**2 + data.noise[lines] ** 2) * power + (0.3 * error) ** 2 * mean_power[:, None]
    S[:, :, at, at] += np.where(seen, noise, 1e8 * mean_power[:, None]).transpose(0, 2, 1)
    inverse = np.linalg.inv(S)
    alpha = (inverse @ delta[..., None])[..., 0]
    variance = (1 / np.einsum("lioo->lio", inverse)).transpose(0, 2, 1)
    return CrossPrediction(field, y, seen, variance, prior, rows, inverse, weight, share**2 * unit, alpha)


def _like_motions(problem: FitProblem, field: Field, rows: Floats) -> Floats:
    """Return factors that make readings of all quantities as large as motions, by the model, (n_out,).

    One of all readings of a quantity; 1 of motions, or where there are none.
    """
    quantity = np.array([s.quantity for s in problem.data.measurement.sensors])
    out = np.ones(len(quantity))
    if MOTION not in quantity or (quantity == MOTION).all():
        return out
    size = np.log(np.maximum(np.sqrt((rows**2) @ field.weight(0.0, 0.0).mean(axis=0)), 1e-300))
    for q in set(quantity) - {MOTION}:
        out[quantity == q] = np.exp(np.median(size[quantity == MOTION]) - np.median(size[quantity == q]))
    return out
