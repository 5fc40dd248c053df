"""Weighted residuals of measured FRFs as a function of the unknowns of a fit."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from fem.array_types import Bools, Complexes, Floats, Ints
from fem.reduction.deviations import Deviations
from fem.reduction.parametric_frf import ParametricFRF
from fem.reduction.set_ups import SetUpsFRF
from updating.correlation import DB_PER_NEPER, log_ratio
from updating.inference.belief import DISCREPANCY_MAX, DISCREPANCY_USUAL
from updating.inference.fit_data import noise_squares
from updating.inference.fit_function import Errors, FitFunction
from updating.inference.fit_result import FitResult
from updating.inference.frf_inputs import FrfInputs
from updating.inference.frf_jacobian import FrfJacobian
from updating.inference.heartbeat import beat
from updating.inference.solve import Solution
from updating.inference.unknowns import values_at
from updating.least_squares.costs import Costs


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

    def allowed_squares(self) -> Floats:
        """Return the mean squares that a right model may leave beyond noise, of each group."""
        return self._beyond_noise(DISCREPANCY_MAX)

    def usual_squares(self) -> Floats:
        """Return the mean squares that right models usually leave beyond noise at most, of each group."""
        return self._beyond_noise(DISCREPANCY_USUAL)

    def _beyond_noise(self, share: float) -> Floats:
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
