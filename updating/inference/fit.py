"""Fits of a reduced model to measured FRFs: nuisance parameters, the damping curve and candidate effects."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from fem.analysis.frf import FRF
from fem.analysis.harmonic_balance import Receptances, Steady, solve_steady
from fem.effects.joint_nonlinear import AmplitudeDependent
from fem.model import Effect, ParameterRef, dofs_of, parameter_values
from fem.reduction.deviations import Deviations
from fem.reduction.parametric_frf import ParametricFRF
from fem.reduction.reduced_model import ReducedModel
from fem.reduction.set_ups import SetUp, SetUpsFRF
from fem.summary import counted, span, summary
from updating.correlation import DB_PER_NEPER, log_ratio
from updating.inference.bases import with_responses
from updating.inference.belief import DATA_PER_MODE, DISCREPANCY_MIN
from updating.inference.damped import DampedFrfs, continuation_of
from updating.inference.defaults import BASIS_LINES
from updating.inference.fit_data import FitData, sensor_vectors
from updating.inference.fit_function import ROBUST, FitFunction, propagated
from updating.inference.fit_result import FitResult
from updating.inference.frf_function import FrfFunction
from updating.inference.joint_fit import mode_problem_of, with_modes
from updating.inference.mode_fit import ComputedModes
from updating.inference.mode_targets import ModeTargets
from updating.inference.problem import Problem
from updating.inference.responses import LINEAR, LinearResponses
from updating.inference.scatter import FormScatter, form_scatter
from updating.inference.unknowns import nuisance_unknowns
from updating.least_squares.levels import Levels
from updating.least_squares.loss import pseudo_huber
from updating.measurement.channel_errors import N_ERRORS
from updating.measurement.measurement import Measurement, sensor_point


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class FitProblem(Problem[FitData]):
    """Everything that a fit to FRFs needs but the candidates.

    Attributes
    ----------
    bands : ndarray
        Upper ends of the bands of the frequency continuation, rising; the last is the whole band [Hz].
    n_modes : int
        Elastic modes in the band.
    n_lines : int
        At most this many lines are fitted.
    modes : ModeTargets or None
        Measured modes that the search by evidence fits beside the FRFs.
    decay : float
        σ of the complex frequencies ω - iσ at which the data are (:func:`updating.inference.damped.damped`)
        [rad/s].
    viscous : bool
        Whether damping ratios are those of viscous modal damping between resonances, rather than of a loss
        factor.
    pieces : int
        Into how many each element of the model was cut for the data; 0 where that was not asked.
    responses : LinearResponses
        How the receptances that are compared with the data follow from the model.
    make_function : callable
        Makes the residuals, of the arguments of :class:`updating.inference.frf_function.FrfFunction`.
    """

    bands: NDArray[np.float64] = field(default_factory=lambda: np.array([np.inf]))
    n_modes: int = 10
    n_lines: int = 160
    modes: ModeTargets | None = None
    decay: float = 0.0
    viscous: bool = False
    pieces: int = 0
    responses: LinearResponses = LINEAR
    make_function: Callable[..., FrfFunction] = FrfFunction

    def __repr__(self) -> str:
        """Return the data, the unknowns and the size of the basis on one line."""
        data, vary = self.data.measurement, counted(len(self.nuisances), "uncertain parameter")
        band = span(self.data.frequency, "Hz")
        ends = f"{counted(len(data.sensors), 'sensor')}, {counted(len(data.excitations), 'excitation')}"
        size = f"{counted(self.n_modes, 'mode')} in {band}"
        return summary(self, f"{vary}, {size}, at most {counted(self.n_lines, 'line')} fitted; {ends}")

    @property
    def stages(self) -> NDArray[np.float64]:
        """Upper ends of the bands [Hz]."""
        return self.bands

    @property
    def vectors(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Sensors and excitations as combinations of DOFs."""
        outputs, inputs, *_ = self.ends
        return outputs, inputs

    @property
    def misread(self) -> NDArray[np.float64]:
        """Changes of the readings of sensors and excitations by errors, on the basis's columns, (r, n, 5).

        Computed once.
        """
        m = self.data.measurement
        channels = (*m.sensors, *m.excitations)
        model = self.reduced.model

        def made() -> NDArray[np.float64]:
            return np.hstack([c.misread(model) for c in channels])

        on_basis = self.reduced.projected(("misread", channels), made)[1]
        return on_basis.reshape(len(on_basis), len(channels), N_ERRORS)

    @property
    def ends(self) -> tuple[NDArray[np.float64], ...]:
        """Sensors and excitations as combinations of DOFs, and of the basis's columns (computed once)."""
        ends = (tuple(each) for each in (self.data.measurement.sensors, self.data.measurement.excitations))
        vectors = (
            self.reduced.projected(each, partial(sensor_vectors, self.reduced.model, each)) for each in ends
        )
        (outputs, on_outputs), (inputs, on_inputs) = vectors
        return outputs, inputs, on_outputs, on_inputs

    def engine(
        self,
        frequency: NDArray[np.float64],
        refs: Sequence[ParameterRef] = (),
        effects: Sequence[Effect] = (),
        release: Sequence[tuple[str, str]] = (),
        deviations: Deviations | None = None,
        channels: NDArray[np.float64] | None = None,
    ) -> ParametricFRF:
        """Return the sensors' receptances as a function of parameters.

        Parameters
        ----------
        frequency : ndarray (n_freq,)
            Frequencies [Hz].
        refs : sequence of (effect, parameter)
            The parameters that vary.
        effects : sequence of Effect
            Candidates that are added to the model.
        release : sequence of (str, str)
            Keys of constraints that are released besides those that the candidates release.
        deviations : Deviations, optional
            Their sizes stand behind the parameters.
        channels : ndarray (n_sensors + n_excitations, 5), optional
            Errors of the channels; none unless given.
        """
        return self.responses.engine(self, frequency, refs, effects, release, deviations, channels)

    def in_set_ups(self, engine: ParametricFRF) -> ParametricFRF | SetUpsFRF:
        """Return an engine whose responses have the masses of roving sensors, each that at its own place."""
        masses = self.data.measurement.roving_masses
        if not masses:
            return engine
        basis, mesh = self.reduced.basis, self.reduced.model.mesh
        places = [dofs_of([sensor_point(mesh, s)])[0, :3] for _, s, _ in masses]
        return SetUpsFRF(
            engine,
            [SetUp(rows, basis.T[at].T, mass) for (rows, _, mass), at in zip(masses, places, strict=True)],
        )

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

    def lines_up_to(self, frequency: float, n_lines: int) -> NDArray[np.int64]:
        """Return at most ``n_lines`` evenly spaced lines, not held out, up to a frequency."""
        lines = np.flatnonzero((self.data.frequency <= frequency) & ~self.data.held_out)
        if len(lines) <= n_lines:
            return lines
        return lines[np.unique(np.linspace(0, len(lines) - 1, n_lines).round().astype(int))]

    def band_of(self, lines: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return which of up to four bands with equally many modes each line is in.

        Each has an error level of its own.
        """
        knots = self.damping.knots
        edges = np.quantile(knots, [0.25, 0.5, 0.75]) if len(knots) > 4 else np.zeros(0)
        return np.searchsorted(edges, self.data.frequency[lines])

    def n_independent(self, stage: float = np.inf) -> float:
        """Return the number of independent data of a discrepancy at the lines up to a frequency."""
        return DATA_PER_MODE * max(3.0, self.n_modes * min(1.0, stage / self.data.frequency[-1]))

    def likelihood(
        self, n: NDArray[np.float64], size: NDArray[np.float64], noise: NDArray[np.float64]
    ) -> Levels:
        """Return how probable error levels are of groups of residuals, each (n_groups,).

        Parameters
        ----------
        n : ndarray
            For how many independent data a discrepancy stands.
        size : ndarray
            Number of residuals.
        noise : ndarray
            Their mean square that is put down to noise [nepers²].
        """
        least = (DISCREPANCY_MIN * self.model_error) ** 2 + self.mesh_level**2
        return Levels(n, noise * n / (self.data.n_parts * size) + least, noise)

    def function(
        self, effects: Sequence[Effect], starts: Sequence[dict[str, float]], lines: NDArray[np.int64]
    ) -> FrfFunction:
        """Return the residuals at some lines as a function of all that varies."""
        function = self.make_function(self, tuple(effects), *self.unknowns(effects, starts), lines)
        return function.with_scatter(self.scatter)

    def residuals(
        self,
        effects: Sequence[Effect] = (),
        starts: Sequence[dict[str, float]] = (),
        stage: float | None = None,
        n_lines: int | None = None,
    ) -> FitFunction[Any]:
        """Return the residuals of lines, and of measured modes, up to a frequency [Hz]."""
        top = np.inf if stage is None else stage
        function = self.function(effects, starts, self.lines_up_to(top, n_lines or self.n_lines))
        return with_modes(self, function, top)

    def surroundings(self, key: tuple[str, str], n_lines: int = 30) -> float:
        """Return the median impedance of the structure to motion along a released constraint.

        It is the magnitude of force over displacement, at lines over the whole band [N/m, N·m/rad].
        """
        omega2 = (2 * np.pi * self.data.frequency[self.lines_up_to(np.inf, n_lines)]) ** 2
        return self.reduced.impedance(key, omega2)

    def receptance(self, result: FitResult, lines: NDArray[np.int64] | None = None) -> NDArray[np.complex128]:
        """Return the fitted model's receptances as the sensors read them, at some or all lines."""
        lines = np.arange(len(self.data.frequency)) if lines is None else lines
        return self.responses.receptance(self, result, lines)

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
        """Return the model as it was given, unfitted, with its errors."""
        bare = Problem.nominal(self)
        return self.assessed(replace(bare, channels=self.data.measurement.channel_errors))

    @property
    def measured_words(self) -> str:
        """The kind of data, in the singular."""
        return "measured FRF" if self.modes is None else "measured mode or measured FRF"

    @property
    def measured_modes(self) -> ModeTargets | None:
        """Measured modes that are fitted beside the FRFs."""
        return self.modes

    def computed_modes(self, result: FitResult) -> ComputedModes | None:
        """Return the partners of the measured modes in a fitted model."""
        mode_problem = mode_problem_of(self)
        return None if mode_problem is None else mode_problem.computed(result)

    def small_deviations(
        self, result: FitResult, size: float | None = None, share: float = 1.0
    ) -> FormScatter | None:
        """Return the small deviations that the form has besides its parameters, at a fitted model."""
        return form_scatter(self, result, size, share)

    def damped_frfs(self) -> DampedFrfs | None:
        """Return the FRFs at complex frequencies, where fits converge from far away."""
        continuation = continuation_of(self)
        return None if continuation is None else DampedFrfs(self, continuation)

    def with_other_damping(self) -> Self:
        """Return the problem with the other form of damping between resonances."""
        return replace(self, viscous=not self.viscous)

    def better_basis(
        self, result: FitResult, n_lines: int = BASIS_LINES[0]
    ) -> tuple[float, ReducedModel] | None:
        """Return the error of the basis [nepers], and one with responses of a fitted model at some lines."""
        return with_responses(self, result, n_lines)

    def with_seen_noise(self, result: FitResult) -> Self:
        """Return the problem with its noise reduced to what residuals of neighbouring lines differ by.

        A model's residuals are smooth over frequency but near resonances, so that their second differences
        hold the noise, and no less.
        """
        data = self.data
        ratio = data.seen(log_ratio(self.receptance(result), np.where(data.mask, data.H, 1.0)))
        r = data.weight * np.nan_to_num(ratio)
        there = data.mask[:-2] & data.mask[1:-1] & data.mask[2:]
        if not there.any():
            return self
        seen = pseudo_huber((r[:-2] - 2 * r[1:-1] + r[2:])[there] / np.sqrt(6), ROBUST).mean()
        square = (data.weight * data.noise) ** 2
        stated = data.n_parts * ((square[:-2] + 4 * square[1:-1] + square[2:])[there] / 6).mean()
        scale = min(1.0, float(seen / stated))
        return replace(self, data=replace(data, noise=data.noise * np.sqrt(scale)))

    def resampled(self, result: FitResult, misfit: Mapping[str, float], rng: np.random.Generator) -> Self:
        """Return the problem with FRFs of a fitted model with noise and other small deviations."""
        mode_problem = mode_problem_of(self)
        modes = None if mode_problem is None else mode_problem.resampled(result, misfit, rng).data
        data, scale = self.data, np.sqrt(max(misfit.get("frf", 1.0), 1.0))
        function = self.function((), (), np.arange(len(data.frequency)))
        x = function.moved_to(result)
        if self.scatter is not None:
            x[-len(self.scatter.std) :] = rng.standard_normal(len(self.scatter.std))
        H, kept = data.H.copy(), data.mask & (data.weight > 0)
        ratio = function(x, False)[0] / data.weight[data.mask]
        ratio = ratio[data.weight[data.mask] > 0]
        real, imaginary = rng.standard_normal((2, int(kept.sum())))
        noise = scale * data.noise[kept] * (real + 1j * imaginary)
        if not data.phase:  # amplitudes alone: noise of the logarithm
            H[kept] = H[kept] * np.exp(ratio + noise.real)
        else:
            H[kept] = H[kept] * np.exp(ratio) + abs(H[kept]) * noise
        return replace(self, data=replace(data, H=H), modes=modes)

    def test_of(self, result: FitResult) -> Measurement:
        """Return the test with the form of damping and the errors of channels that a fit has found."""
        described = replace(self.data.measurement, viscous=self.viscous)
        return described.with_channel_errors(result.channels)

    def strain(self, result: FitResult) -> float:
        """Return the largest distance of an uncertain parameter or channel from nominal.

        In prior standard deviations [-].
        """
        std = self.data.measurement.errors.std
        z = result.channels / np.where(std > 0, std, 1.0)
        return float(np.abs([*self.strains(result).values(), *z.ravel()]).max(initial=0.0))

    def far_start(self, result: FitResult) -> FitResult:
        """Return a result with all that is uncertain but damping at its nominal value."""
        return replace(self.at_nominal(result), scatter=np.zeros(0)).as_described()

    def strains(self, result: FitResult) -> dict[ParameterRef, float]:
        """Return how far nuisance parameters lie from their nominal values, in prior standard deviations."""
        variables = nuisance_unknowns(self.reduced.model, self.nuisances)
        known = ((v, v.to_x(result.values[v.ref])) for v in variables if v.ref in result.values)
        return {v.ref: (x - v.mean) / v.std for v, x in known if v.has_prior}

    def assessed(self, result: FitResult, H: NDArray[np.complex128] | None = None) -> FitResult:
        """Return a result with its errors on fitted and on held-out lines.

        ``H`` are its receptances, where they are known, (n_freq, n_out, n_in).
        """
        held_out, lines = self.data.held_out, np.arange(len(self.data.held_out))
        ratio = self._log_ratio(self.receptance(result) if H is None else H, lines)
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
        return self._log_ratio(self.receptance(result, lines), lines)

    def _log_ratio(self, H: NDArray[np.complex128], lines: NDArray[np.int64]) -> NDArray[np.complex128]:
        ratio = log_ratio(H, self.data.H[lines])
        return np.where(self.data.mask[lines], self.data.seen(ratio), complex("nan"))

    def frf(self, result: FitResult) -> FRF:
        """Return the fitted model's FRFs in the kind of the measurement."""
        return self.as_measured(self.receptance(result))

    @property
    def measured(self) -> FRF:
        """The measured FRFs as they were compared: in the band, wrong signs set right."""
        return self.as_measured(self.data.H)

    def as_measured(self, H: NDArray[np.complex128]) -> FRF:
        """Return receptances as FRFs in the kind of the measurement."""
        m = self.data.measurement.frf
        frf = FRF.from_arrays(m.frequency, H, "receptance", m.outputs, m.inputs, m.base, m.strain)
        frf = frf.as_kind(m.kind)
        return frf if self.data.phase else replace(frf, H=np.abs(frf.H).astype(complex))


def _rms(error: NDArray[np.float64]) -> float:
    x = error[np.isfinite(error)]
    return float(np.sqrt((x**2).mean()) * DB_PER_NEPER) if x.size else float("nan")
