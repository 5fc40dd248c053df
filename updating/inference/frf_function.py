"""Weighted residuals of measured FRFs as a function of the unknowns of a fit."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from fem.array_types import Bools, Complexes, Floats, Ints
from fem.reduction.deviations import Deviations
from fem.reduction.frf_slopes import FrfSlopes
from fem.reduction.parametric_frf import ParametricFRF
from fem.reduction.set_ups import SetUpsFRF
from updating.correlation import DB_PER_NEPER, log_ratio
from updating.inference.belief import DISCREPANCY_MAX, DISCREPANCY_USUAL
from updating.inference.fit_data import noise_squares
from updating.inference.fit_function import Errors, FitFunction
from updating.inference.fit_result import FitResult
from updating.inference.frf_inputs import FrfInputs
from updating.inference.heartbeat import beat
from updating.inference.solve import Solution
from updating.inference.unknowns import values_at
from updating.least_squares.costs import Costs

# Derivatives of weighted log ratios of FRFs, whose normal equations have the form of an arrow ---------------


@dataclass(frozen=True, slots=True, eq=False)
class FrfJacobian:
    """Derivatives of w ln(H / measured) by variables, damping and small deviations.

    Errors of a sensor change the residuals of that sensor alone: half of the unknowns have diagonal blocks in
    the normal equations. Products are of single precision, as the derivatives are, and their sums over
    sensors of double precision.

    Attributes
    ----------
    slopes : FrfSlopes
        dH by the refs of the variables, by deviations and by ζ, each in units of its unknown.
    first_refs : ndarray of int (n_variables,)
        Number of the first of the refs of each variable.
    n_refs : int
        Number of refs of variables.
    by_damping : ndarray (n_zeta, n_damping, n_freq)
        Slopes of ζ by the unknowns of the damping curve.
    per : ndarray (n_freq, n_out, n_in)
        w / H; 0 where a value does not count.
    keep : ndarray of bool (n_freq, n_out, n_in)
        Values that are residuals.
    phase : bool
        Whether residuals have imaginary parts.
    """

    slopes: FrfSlopes
    first_refs: Ints
    n_refs: int
    by_damping: NDArray[np.float32]
    per: Complexes
    keep: Bools
    phase: bool = True
    most_used: ClassVar[int] = 3

    @property
    def _counts(self) -> tuple[int, int, int, int]:
        """Numbers of variables, unknowns of damping, deviations before errors of sensors, and these."""
        n_variables, n_damping = len(self.first_refs), self.by_damping.shape[1]
        return n_variables, n_damping, self.slopes.first - self.n_refs, len(self.slopes.of)

    @property
    def rows(self) -> tuple[Ints, Ints]:
        """Numbers of the unknowns that change any residual, and of errors of sensors."""
        n_variables, n_damping, n_before, n_single = self._counts
        n_deviations = len(self.slopes.common) - self.n_refs - len(self.by_damping) + n_single
        first = n_variables + n_damping + n_before
        every = np.arange(n_variables + n_damping + n_deviations)
        return np.delete(every, slice(first, first + n_single)), every[first : first + n_single]

    def products(self, r: Complexes, weight: Floats, member: Ints | None = None) -> tuple[Floats, Floats]:
        """Return the sums of :meth:`updating.least_squares.costs.Jacobian.products`.

        Groups are of whole lines that follow one another.
        """
        root = np.sqrt(weight)
        common, single = self._weighted(root)
        weighted = np.zeros(self.keep.shape, dtype=np.complex64)
        weighted[self.keep] = root * r
        residuals = np.ascontiguousarray(weighted.swapaxes(0, 1))
        line = np.broadcast_to(np.arange(len(self.keep))[:, None, None], self.keep.shape)[self.keep]
        ends = [0, len(self.keep)]
        if member is not None:
            ends = [0, *(line[np.flatnonzero(np.diff(member)) + 1]).tolist(), len(self.keep)]
        parts = [
            self._products(common[:, :, a:b], single[:, a:b], residuals[:, a:b]) for a, b in pairwise(ends)
        ]
        g, A = (np.array(each) for each in zip(*parts, strict=True))
        return g, A

    def _products(
        self, common: NDArray[np.complex64], single: NDArray[np.complex64], r: NDArray[np.complex64]
    ) -> tuple[Floats, Floats]:
        """Return Σ J r and Σ J Jᵀ of weighted derivatives and residuals at some lines."""
        n, m = len(common), len(single)
        g, A = np.zeros(n + m), np.zeros((n + m, n + m))
        of = n + np.searchsorted(self.slopes.of, np.arange(len(r) + 1))
        for k, (first, last) in enumerate(pairwise(of)):
            J, S, q = _real(common[:, k]), _real(single[first - n : last - n]), _real(r[None, k])[0]
            g[:n] += J @ q
            A[:n, :n] += J @ J.T
            g[first:last], A[:n, first:last], A[first:last, first:last] = S @ q, J @ S.T, S @ S.T
        A[n:, :n] = A[:n, n:].T
        order = np.argsort(np.concatenate(self.rows))
        return g[order], A[np.ix_(order, order)]

    def _weighted(self, root: Floats | float) -> tuple[NDArray[np.complex64], NDArray[np.complex64]]:
        """Return derivatives of residuals times their factors (m,).

        By unknowns that change any residual, (n, n_out, n_freq, n_in), and by errors of sensors, (k, n_freq,
        n_in).
        """
        factor = np.zeros(self.keep.shape)
        factor[self.keep] = root
        per = np.ascontiguousarray((self.per * factor).astype(np.complex64).swapaxes(0, 1))
        dH, n_zeta = self.slopes.common, len(self.by_damping)
        n_variables, n_damping, *_ = self._counts
        n = n_variables + n_damping
        out = np.empty((n + len(dH) - self.n_refs - n_zeta, *dH.shape[1:]), dtype=np.complex64)
        if n_variables < self.n_refs:
            np.multiply(
                np.add.reduceat(dH[: self.n_refs], self.first_refs, axis=0), per, out=out[:n_variables]
            )
        else:
            np.multiply(dH[: self.n_refs], per, out=out[:n_variables])
        for k in range(n_damping):
            by = self.by_damping[:, k, None, :, None]
            np.multiply((by * dH[len(dH) - n_zeta :]).sum(axis=0), per, out=out[n_variables + k])
        np.multiply(dH[self.n_refs : len(dH) - n_zeta], per, out=out[n:])
        single = self.slopes.single * per[self.slopes.of]
        if not self.phase:
            out.imag, single.imag = 0.0, 0.0
        return out, single

    def dense(self) -> Complexes:
        """Return all derivatives, (n, m)."""
        common, single = self._weighted(1.0)
        (every, own), of = self.rows, self.slopes.of
        out = np.zeros((len(every) + len(own), int(self.keep.sum())), dtype=complex)
        out[every] = common.swapaxes(1, 2)[:, self.keep]
        output = np.nonzero(self.keep)[1]
        for row, k, J in zip(own, of, single, strict=True):
            out[row, output == k] = J[self.keep[:, k]]
        return out


def _real(X: NDArray[np.complex64]) -> NDArray[np.float32]:
    """Return complex arrays (n, ...) as rows of their real and imaginary parts, (n, m)."""
    return X.reshape(len(X), math.prod(X.shape[1:])).view(np.float32)


# ------------------------------------------------------------------------------------------------------------


@dataclass(eq=False)
class FrfFunction(FitFunction[FrfInputs]):
    """Weighted ln(computed / measured) of FRFs at some lines, as a function of all that varies."""

    # The end of a fit is asked for again.
    _end: tuple[bytes, Complexes, FrfJacobian] | None = field(default=None, init=False, repr=False)

    @property
    def keep(self) -> Bools:
        """Which values count, (n_lines, n_out, n_in)."""
        return self.problem.data.mask[self.lines]

    # The engine is made at the first evaluation: many functions are made for their bounds and priors alone.

    @cached_property
    def _engine(self) -> ParametricFRF | SetUpsFRF:
        frequency, refs = self.problem.data.frequency[self.lines], self.refs
        none = np.zeros((self.problem.reduced.model.n_dof, 0))
        deviations = Deviations(none, none) if self.scatter is None else self.scatter.deviations
        if self.scatter is not None and self.scatter.channels is not None:
            n_out = len(self.problem.data.measurement.sensors)
            outputs, inputs = self.scatter.channels.changes(self.problem.misread, n_out)
            deviations = replace(deviations, outputs=outputs, inputs=inputs)
        engine = self.problem.engine(frequency, refs, self.effects, deviations=deviations)
        return self.problem.in_set_ups(engine)

    @cached_property
    def _damping(self) -> tuple[Floats, Floats]:
        """Hat functions and offset of the damping curve at the lines."""
        curve, frequency = self.problem.damping, self.problem.data.frequency[self.lines]
        return curve.hats(frequency), curve.offset(frequency)

    @cached_property
    def _measured(self) -> Complexes:
        """Measured receptances at the lines, 1 where they do not count, so that their logarithm exists."""
        measured = self.problem.data.H[self.lines]
        return np.where(self.keep & (measured != 0), measured, 1.0)

    def __call__(self, x: Floats, gradient: bool) -> tuple[Complexes, Complexes | None]:
        """Return the weighted ln(computed / measured), (m,), and its Jacobian, (n, m), if asked."""
        if gradient:
            r, jacobian = self.linearised(x)
            return r, jacobian.dense()
        if self._end is not None and self._end[0] == x.tobytes():
            return self._end[1], None
        beat()
        return self._residuals(self._engine.evaluate(*self._point(x), gradient=False)[0]), None

    def linearised(self, x: Floats) -> tuple[Complexes, FrfJacobian]:
        """Return the residuals, (m,), and their Jacobian."""
        at = x.tobytes()
        if self._end is None or self._end[0] != at:
            beat()
            self._end = at, *self._derived(x)
        return self._end[1:]

    def _derived(self, x: Floats) -> tuple[Complexes, FrfJacobian]:
        (parameters, *_), (hats, _), (values, zeta) = self._parts, self._damping, self._point(x)
        slopes = [v.slopes(xi) for v, xi in zip(self.variables, x[parameters], strict=True)]
        H, dH = self._engine.slopes_of(values, zeta, np.concatenate([*slopes, self._scatter_std]))
        weight = self.problem.data.weight[self.lines]
        by_damping = np.moveaxis(zeta[..., None] * hats, -1, -2).astype(np.float32)
        return self._residuals(H), FrfJacobian(
            dH,
            np.cumsum([0, *map(len, slopes)], dtype=np.int64)[:-1],
            len(values) - len(self._scatter_std),
            by_damping.reshape(-1, *by_damping.shape[-2:]),
            np.where(H != 0, weight / np.where(H != 0, H, 1.0), 0.0),
            self.keep,
            self.problem.data.phase,
        )

    def _residuals(self, H: Complexes) -> Complexes:
        """Return the weighted ln(computed / measured) of receptances, (m,)."""
        r = self.problem.data.weight[self.lines] * log_ratio(H, self._measured)
        return self.problem.data.seen(np.nan_to_num(r, nan=0.0)[self.keep])

    def _point(self, x: Floats) -> tuple[Floats, Floats]:
        """Return the values of all parameters and deviations, and the damping ratio at each line."""
        (parameters, damping, scatter), (hats, offset) = self._parts, self._damping
        values = values_at(self.variables, x[parameters])
        return np.append(values, self._scatter_std * x[scatter]), np.exp(hats @ x[damping] + offset)

    def receptance(self, x: Floats) -> Complexes:
        """Return the receptances at the lines as the sensors read them, (n_lines, n_out, n_in)."""
        return self._engine.evaluate(*self._point(x), gradient=False)[0]

    def anchor(self, x: Floats) -> None:
        """Prepare :meth:`receptance` for many x that differ from this one in few variables."""
        own, _, scatter = self._parts
        self._engine.anchor(np.append(values_at(self.variables, x[own]), self._scatter_std * x[scatter]))

    @property
    def groups(self) -> Ints:
        """Band of each residual, each with its own level of error, (m,)."""
        return np.broadcast_to(self.problem.band_of(self.lines)[:, None, None], self.keep.shape)[self.keep]

    @property
    def of_modes(self) -> Bools:
        """Which groups are those of modes, (n_groups,): none."""
        return np.zeros(len(np.unique(self.groups)), dtype=bool)

    def noise(self) -> Floats:
        """Return the mean squares of the residuals of each group that are put down to noise, (n_groups,)."""
        return self.mean_by_group(noise_squares(self.problem.data, self.lines))

    def allowed_squares(self, *, usual: bool = False) -> Floats:
        """Return the mean squares that a right model may leave beyond noise, or usually does, by group."""
        share = DISCREPANCY_USUAL if usual else DISCREPANCY_MAX
        square = (share * self.problem.model_error) ** 2 + self.problem.mesh_level**2
        return np.full(len(np.unique(self.groups)), square)

    def errors(self, x: Floats) -> Errors:
        """Return how far computed FRFs are from the measured ones."""
        # A model has no such deviations, but channels have.
        n = len(x) - (0 if self.scatter is None else self.scatter.n_channels)
        rows = np.arange(len(x))
        x = np.where((rows < self._parts[2].start) | (rows >= n), x, 0.0)
        r, weight = self(x, False)[0], self.problem.data.weight[self.lines][self.keep]
        known = weight > 0
        return Errors(frf_db=float(np.sqrt(((r.real[known] / weight[known]) ** 2).mean()) * DB_PER_NEPER))

    def levels(self, stage: float = np.inf, counted_as: int = 0) -> Costs:
        """Return how probable error levels are: noise, and in addition the error of beams and of the mesh.

        Parameters
        ----------
        stage : float
            The lines reach up to this frequency [Hz].
        counted_as : int
            Number of lines of the full band that they represent, at most all; their own number unless given.
        """
        problem = self.problem
        sizes = np.unique(self.groups, return_counts=True)[1].astype(float)
        if counted_as:
            sizes *= len(problem.lines_up_to(stage, counted_as)) / len(self.lines)
        return problem.likelihood(problem.n_independent(stage) * sizes / sizes.sum(), sizes, self.noise())

    def words_of(self, stage: float) -> str:
        """Return up to which frequency the fit goes."""
        return f"to {self.problem.data.frequency[self.lines[-1]]:.4g} Hz"

    def result(self, solution: Solution) -> FitResult:
        """Return a solution as values, with the errors of the channels; errors are not assessed."""
        out = super().result(solution)
        if self.scatter is None or self.scatter.channels is None:
            return out
        known, n = self.scatter.channels, len(solution.x) - self.scatter.n_channels
        n_ends, covariance = self.problem.misread.shape[1], out.solution.covariance
        return replace(
            out,
            channels=known.errors(solution.x[n:], n_ends),
            channels_std=known.deviations(covariance[n:, n:], n_ends),
        )
