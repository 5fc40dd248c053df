"""Fits of a reduced model to measured FRFs: nuisance parameters, the damping curve and candidate effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fem.analysis.frf import FRF
from fem.analysis.harmonic_balance import Receptances, Steady, solve_steady
from fem.effects.joint_nonlinear import AmplitudeDependent
from fem.model import Effect, ParameterRef, parameter_values
from fem.reduction.parametric_frf import ParametricFRF
from fem.summary import counted, span, summary
from updating.correlation import DB_PER_NEPER, log_ratio
from updating.inference.fit_function import ROBUST, FitFunction, propagated
from updating.inference.fit_inputs import FitInputs
from updating.inference.fit_result import FitResult
from updating.inference.solve import Solution
from updating.inference.unknowns import effect_unknowns, nuisance_unknowns
from updating.least_squares.loss import pseudo_huber


@dataclass(frozen=True, slots=True, eq=False)
class FitProblem(FitInputs):
    """A fit of all that may vary and of candidates: its residuals, the fitted FRFs and their errors."""

    def __repr__(self) -> str:
        """Return the data, the unknowns and the size of the basis on one line."""
        data, vary = self.data.measurement, counted(len(self.nuisances), "uncertain parameter")
        band = span(self.data.frequency, "Hz")
        ends = f"{counted(len(data.sensors), 'sensor')}, {counted(len(data.excitations), 'excitation')}"
        size = f"{counted(self.n_modes, 'mode')} in {band}"
        return summary(self, f"{vary}, {size}, at most {counted(self.n_lines, 'line')} fitted; {ends}")

    def unloaded(self, result: FitResult) -> FitProblem:
        """Return a problem without masses of roving sensors, its data freed of them by a fitted model.

        For rankings and checks, which take all responses to be of one structure.
        """
        m = self.data.measurement
        if not m.roving_masses:
            return self
        sensors = tuple(replace(s, mass=0.0) if s.roving else s for s in m.sensors)
        free = replace(self, data=replace(self.data, measurement=replace(m, sensors=sensors)))
        loaded = self.receptance(result)
        ratio = free.receptance(result) / np.where(loaded != 0, loaded, 1.0)
        return replace(free, data=replace(free.data, H=self.data.H * ratio))

    def function(
        self, effects: Sequence[Effect], starts: Sequence[dict[str, float]], lines: NDArray[np.int64]
    ) -> FitFunction:
        """Return the residuals at some lines as a function of all that varies.

        Parameters
        ----------
        effects : sequence of Effect
            Candidates to add to the model.
        starts : sequence of dict
            For each of them the parameter values to start from.
        lines : ndarray of int
        """
        fixed = {ref for e in effects for ref in e.replaces()}
        varying = [n for n in self.nuisances if not fixed.intersection(n.refs)]
        nuisance = nuisance_unknowns(self.reduced.model, varying)
        variables = (*nuisance, *effect_unknowns(effects, starts))
        start = np.concatenate([[v.start for v in variables], np.log(self.damping.start)])
        return FitFunction(self, tuple(effects), variables, start, lines).with_scatter(self.scatter)

    def with_forces_of(self, result: FitResult) -> FitProblem:
        """Return the problem on a basis with the responses to the forces of a fit's effects.

        On a basis without them the same fit has other FRFs: modes and other responses hardly bend where a
        crack or a released end does.
        """
        reduced = self.reduced.with_forces_of(result.effects)
        return self if reduced is self.reduced else replace(self, reduced=reduced)

    def receptance(self, result: FitResult, lines: NDArray[np.int64] | None = None) -> NDArray[np.complex128]:
        """Return the fitted model's receptances as the sensors read them, at some or all lines."""
        lines = np.arange(len(self.data.frequency)) if lines is None else lines
        if any(e.amplitude_dependent for e in result.effects):
            return self.steady(result, lines).H
        f = self.data.frequency[lines]
        refs = list(result.values)
        there = self.with_forces_of(result)
        engine = there.engine(f, refs, result.effects, channels=result.channels)
        zeta = self.damping.ratio(f, result.zeta)
        at = np.array([result.values[r] for r in refs])
        H, _, _ = self.in_set_ups(engine).evaluate(at, zeta, gradient=False)
        return H

    def vectors_with(self, element: AmplitudeDependent) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return sensors and excitations, each with the motion that an element acts on as the last."""
        b = np.zeros((self.reduced.model.n_dof, 1))
        dofs, row = element.strain(self.reduced.model, element.direction)
        b[dofs, 0] = row
        outputs, inputs = self.vectors
        return np.hstack([outputs, b]), np.hstack([inputs, b])

    def steady(self, result: FitResult, lines: NDArray[np.int64]) -> Steady:
        """Return the steady vibration at the data's level of force with one effect that depends on amplitude.

        Without a level the effect keeps the amplitude that it has.
        """
        (element,) = (e for e in result.effects if isinstance(e, AmplitudeDependent))
        linear = [e for e in result.effects if e is not element]
        there = self.with_forces_of(result)
        refs = [ref for ref in result.values if ref[0] != element.name]
        f = self.data.frequency[lines]
        ends = self.vectors_with(element)
        engine = ParametricFRF(there.reduced, *ends, f, refs, linear, viscous=self.viscous)
        zeta = self.damping.ratio(f, result.zeta)
        block, _, _ = engine.evaluate(np.array([result.values[r] for r in refs]), zeta, gradient=False)
        measured = np.where(self.data.mask[lines], self.data.H[lines], 0.0)
        force = self.data.measurement.force_level
        return solve_steady(element, force, Receptances.of(block), measured)

    def deviation(
        self, result: FitResult, lines: NDArray[np.int64] | None = None
    ) -> NDArray[np.float64] | None:
        """Return the standard deviation of the ln|H| that a fit predicts, (n_lines, n_out, n_in) [-].

        √(gᵀ C g) with C the covariance of all that was fitted and g the derivatives of ln|H| (first order;
        Seber & Wild, Nonlinear Regression, 1989, section 5.1). None for a result that was not fitted, such as
        the nominal model, and for one with an effect that depends on amplitude.
        """
        if any(e.amplitude_dependent for e in result.effects):
            return None
        lines = np.arange(len(self.data.frequency)) if lines is None else lines
        every = replace(self.data, mask=np.ones_like(self.data.mask), weight=np.ones_like(self.data.weight))
        starts = [parameter_values(e) for e in result.effects]
        there = replace(self.with_forces_of(result), data=every, scatter=None)
        function = there.function(result.effects, starts, lines)
        x = function.moved_to(result)
        if len(result.covariance) != len(x):
            return None
        return propagated(function, x, function.units, result.covariance).reshape(function.keep.shape)

    def nominal(self) -> FitResult:
        """Return the model as it was given, unfitted."""
        n = len(self.nuisances)
        variables = nuisance_unknowns(self.reduced.model, self.nuisances)
        empty = Solution(np.zeros(n), np.nan, np.nan, 0, True, np.zeros((n, n)))
        values = {
            ref: value
            for v in variables
            for ref, value in zip(v.refs, v.moved(v.start).tolist(), strict=True)
        }
        zero = dict.fromkeys(values, 0.0)
        known = self.data.measurement.channel_errors
        bare = FitResult(empty, values, zero, self.damping.start, (), np.nan, np.nan, np.nan, channels=known)
        return self.assessed(bare)

    def with_even_damping(self, result: FitResult) -> FitResult:
        """Return a result whose damping ratios are a power of frequency, by medians of slopes and of levels.

        A fit may leave a part of the band with ratios far from its neighbours', where they cost little: of
        eight knots two may be anything. Theil and Sen's line through ln ζ over ln f at the knots (Sen, *J.
        Am. Stat. Assoc.* 63, 1968, 1379).
        """
        n = len(self.damping.knots)
        f, zeta = np.log(self.damping.knots), np.log(result.zeta[:n])
        i, j = np.triu_indices(n, 1)
        slope = float(np.median((zeta[j] - zeta[i]) / (f[j] - f[i]))) if n > 1 else 0.0
        even = slope * f + np.median(zeta - slope * f)
        lo, hi = self.damping.limits[:n].T
        return replace(result, zeta=np.concatenate([np.exp(np.clip(even, lo, hi)), result.zeta[n:]]))

    def strains(self, result: FitResult) -> dict[ParameterRef, float]:
        """Return how far nuisance parameters lie from their nominal values, in prior standard deviations."""
        variables = nuisance_unknowns(self.reduced.model, self.nuisances)
        known = ((v, v.to_x(result.values[v.ref])) for v in variables if v.ref in result.values)
        return {v.ref: (x - v.mean) / v.std for v, x in known if v.has_prior}

    def at_nominal(self, result: FitResult) -> FitResult:
        """Return a result with the nuisance parameters of the model back at their nominal values.

        Damping stays.
        """
        names, nominal = {e.name for e in self.reduced.model.effects}, self.reduced.model.values()
        values = {r: nominal[r] if r[0] in names else v for r, v in result.values.items()}
        return replace(result, values=values)

    def assessed(self, result: FitResult) -> FitResult:
        """Return a result with its errors on fitted and on held-out lines."""
        held_out, ratio = self.data.held_out, self.log_ratio(result)
        lines = np.arange(len(held_out))
        return replace(
            result,
            fit_db=_rms(ratio.real[~held_out]),
            held_out_db=_rms(ratio.real[held_out]),
            level=self.level(ratio[~held_out], lines[~held_out]) if np.isnan(result.level) else result.level,
            held_out_level=self.level(ratio[held_out], lines[held_out]),
            unseen=self._unseen(ratio[held_out], lines[held_out]),
        )

    def _unseen(self, ratio: NDArray[np.complex128], lines: NDArray[np.int64]) -> float:
        """Return the negative log likelihood of lines that no fit has seen, as that of the others is."""
        r = (self.data.weight[lines] * ratio)[self.data.mask[lines]]
        if not r.size:
            return 0.0
        function = self.function((), (), lines)
        return function.levels().cost(function.mean_by_group(pseudo_huber(r, ROBUST)))

    def level(self, ratio: NDArray[np.complex128], lines: NDArray[np.int64] | NDArray[np.bool_]) -> float:
        """Return the robust residual level of log ratios at some lines, amplitude and phase [nepers].

        NaN if none of them counts.
        """
        r = np.abs(self.data.weight[lines] * ratio)
        if np.isnan(r).all():
            return float("nan")
        return float(np.sqrt(np.nanmean(pseudo_huber(r, ROBUST))))

    def log_ratio(self, result: FitResult, lines: NDArray[np.int64] | None = None) -> NDArray[np.complex128]:
        """Return ln(computed / measured) at some or all lines, NaN where masked."""
        lines = np.arange(len(self.data.frequency)) if lines is None else lines
        ratio = log_ratio(self.receptance(result, lines), self.data.H[lines])
        return np.where(self.data.mask[lines], self.data.seen(ratio), complex("nan"))

    def frf(self, result: FitResult) -> FRF:
        """Return the fitted model's FRFs in the kind of the measurement."""
        return self._as_measured(self.receptance(result))

    @property
    def measured(self) -> FRF:
        """The measured FRFs as they were compared: in the band, wrong signs set right."""
        return self._as_measured(self.data.H)

    def _as_measured(self, H: NDArray[np.complex128]) -> FRF:
        m = self.data.measurement.frf
        frf = FRF.from_arrays(m.frequency, H, "receptance", m.outputs, m.inputs, m.base, m.strain)
        frf = frf.as_kind(m.kind)
        return frf if self.data.phase else replace(frf, H=np.abs(frf.H).astype(complex))


def _rms(error: NDArray[np.float64]) -> float:
    x = error[np.isfinite(error)]
    return float(np.sqrt((x**2).mean()) * DB_PER_NEPER) if x.size else float("nan")
