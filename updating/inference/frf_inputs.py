"""What a fit to FRFs is of, and the FRFs as a function of what may vary."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Self, TypeVar

import numpy as np

from fem.analysis.frf import References
from fem.analysis.harmonic_balance import Receptances, Steady, solve_steady
from fem.array_types import Complexes, Floats, Ints
from fem.effects.joint_nonlinear import AmplitudeDependent
from fem.model import Effect, ParameterRef, dofs_of
from fem.reduction.deviations import DeviatingFRF, Deviations
from fem.reduction.parametric_frf import ParametricFRF
from fem.reduction.set_ups import SetUp, SetUpsFRF
from fem.summary import counted, span, summary
from updating.inference.belief import DATA_PER_MODE, DISCREPANCY_MIN
from updating.inference.fit_data import FitData, sensor_vectors
from updating.inference.fit_inputs import FitInputs
from updating.inference.fit_result import FitResult
from updating.inference.mode_targets import ModeTargets
from updating.least_squares.costs import Levels
from updating.measurement.channel_errors import N_ERRORS
from updating.measurement.measurement import (
    Measurement,
    MeasurementError,
    outputs_of,
    sensor_point,
)

F = TypeVar("F", bound="FrfInputs")


@dataclass(frozen=True, slots=True)
class LinearResponses:
    """How receptances follow from a linear model: they are the same at any level of force."""

    @property
    def n_levels(self) -> int:
        """Number of levels of force that the data are of."""
        return 1

    def at_first_level(self, problem: F) -> F:
        """Return the problem with the data of the first level of force alone."""
        return problem

    def engine(
        self,
        problem: FrfInputs,
        frequency: Floats,
        refs: Sequence[ParameterRef],
        effects: Sequence[Effect],
        release: Sequence[tuple[str, str]],
        deviations: Deviations | None,
        channels: Floats | None,
    ) -> ParametricFRF:
        """Return receptances as a function of parameters, which are those of :meth:`FrfInputs.engine`."""
        *_, outputs, inputs = problem.ends
        if channels is not None and channels.any():
            moved = np.einsum("rne,ne->rn", problem.misread, channels)
            outputs, inputs = outputs + moved[:, : outputs.shape[1]], inputs + moved[:, outputs.shape[1] :]
        references, _, on_references = problem.references
        outputs = np.hstack([outputs, on_references])
        make = ParametricFRF if deviations is None else partial(DeviatingFRF, deviations)
        return make(
            problem.reduced,
            outputs,
            inputs,
            frequency,
            refs,
            effects,
            release,
            projected=True,
            decay=problem.decay,
            viscous=problem.viscous,
            references=references,
        )

    def receptance(self, problem: FrfInputs, result: FitResult, lines: Ints) -> Complexes:
        """Return the receptances of a fitted model at some lines, (n_lines, n_out, n_in).

        With an effect that depends on amplitude they are those at the data's level of force.
        """
        if any(e.amplitude_dependent for e in result.effects):
            return problem.steady(result, lines).H
        f = problem.data.frequency[lines]
        refs = list(result.values)
        there = problem.with_forces_of(result)
        engine = there.engine(f, refs, result.effects, channels=result.channels)
        zeta = problem.damping.ratio(f, result.zeta)
        at = np.array([result.values[r] for r in refs])
        H, _, _ = problem.in_set_ups(engine).evaluate(at, zeta, gradient=False)
        return H


LINEAR = LinearResponses()


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class FrfInputs(FitInputs[FitData]):
    """Measured FRFs, a reduced model and what may vary.

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
    """

    bands: Floats = field(default_factory=lambda: np.array([np.inf]))
    n_modes: int = 10
    n_lines: int = 160
    modes: ModeTargets | None = None
    decay: float = 0.0
    viscous: bool = False
    pieces: int = 0
    responses: LinearResponses = LINEAR

    def __repr__(self) -> str:
        """Return the data, the unknowns and the size of the basis on one line."""
        data, vary = self.data.measurement, counted(len(self.nuisances), "uncertain parameter")
        band = span(self.data.frequency, "Hz")
        ends = f"{counted(len(data.sensors), 'sensor')}, {counted(len(data.excitations), 'excitation')}"
        size = f"{counted(self.n_modes, 'mode')} in {band}"
        return summary(self, f"{vary}, {size}, at most {counted(self.n_lines, 'line')} fitted; {ends}")

    @property
    def vectors(self) -> tuple[Floats, Floats]:
        """Sensors and excitations as combinations of DOFs."""
        outputs, inputs, *_ = self.ends
        return outputs, inputs

    @property
    def misread(self) -> Floats:
        """Changes of the readings of sensors and excitations by errors, on the basis's columns, (r, n, 5).

        Computed once.
        """
        m = self.data.measurement
        channels = (*m.sensors, *m.excitations)
        model = self.reduced.model

        def made() -> Floats:
            return np.hstack([c.misread(model) for c in channels])

        on_basis = self.reduced.projected(("misread", channels), made)[1]
        return on_basis.reshape(len(on_basis), len(channels), N_ERRORS)

    @property
    def ends(self) -> tuple[Floats, ...]:
        """Sensors and excitations as combinations of DOFs, and of the basis's columns (computed once)."""
        ends = (tuple(each) for each in (self.data.measurement.sensors, self.data.measurement.excitations))
        vectors = (
            self.reduced.projected(each, partial(sensor_vectors, self.reduced.model, each)) for each in ends
        )
        (outputs, on_outputs), (inputs, on_inputs) = vectors
        return outputs, inputs, on_outputs, on_inputs

    @property
    def references(self) -> tuple[References | None, Floats, Floats]:
        """What responses refer to, and these sensors as combinations of DOFs and of the basis's columns.

        Without references the arrays, (n_dof, k) and (r + p, k), have no columns.
        """
        m = self.data.measurement
        every, references = outputs_of(m.sensors, m.excitations)
        behind = every[len(m.sensors) :]
        make = partial(sensor_vectors, self.reduced.model, behind)
        return references, *self.reduced.projected(behind, make)

    def engine(
        self,
        frequency: Floats,
        refs: Sequence[ParameterRef] = (),
        effects: Sequence[Effect] = (),
        release: Sequence[tuple[str, str]] = (),
        deviations: Deviations | None = None,
        channels: Floats | None = None,
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

    def unloaded(self, result: FitResult) -> Self:
        """Return a problem without masses of roving sensors, its data freed of them by a fitted model.

        For rankings and checks, which take all responses to be of one structure.
        """
        m = self.data.measurement
        if not m.roving_masses:
            return self
        sensors = tuple(replace(s, mass=0.0) if s.roving else s for s in m.sensors)
        return self._as_of(replace(m, sensors=sensors), result)

    def as_forces(self, result: FitResult) -> Self:
        """Return a problem whose data are per unit force, with references that move as in a fitted model.

        For checks of channels against one another, which take responses to be linear in forces.
        """
        m = self.data.measurement
        if m.has_structure_poles:
            return self
        excitations = tuple(e.as_force() for e in m.excitations)
        base = tuple(e.name for e in excitations if e.per_acceleration)
        return self._as_of(replace(m, excitations=excitations, frf=replace(m.frf, base=base)), result)

    def _as_of(self, measurement: Measurement, result: FitResult) -> Self:
        """Return the problem of another test, with the data that it would have by a fitted model."""
        other = replace(self, data=replace(self.data, measurement=measurement))
        known = self.receptance(result)
        ratio = other.receptance(result) / np.where(known != 0, known, 1.0)
        return replace(other, data=replace(other.data, H=self.data.H * ratio))

    def lines_up_to(self, frequency: float, n_lines: int) -> Ints:
        """Return at most ``n_lines`` evenly spaced lines, not held out, up to a frequency."""
        lines = np.flatnonzero((self.data.frequency <= frequency) & ~self.data.held_out)
        if len(lines) <= n_lines:
            return lines
        return lines[np.unique(np.linspace(0, len(lines) - 1, n_lines).round().astype(int))]

    def band_of(self, lines: Ints) -> Ints:
        """Return which of up to four bands with equally many modes each line is in.

        Each has an error level of its own.
        """
        knots = self.damping.knots
        edges = np.quantile(knots, [0.25, 0.5, 0.75]) if len(knots) > 4 else np.zeros(0)
        return np.searchsorted(edges, self.data.frequency[lines])

    def n_independent(self, stage: float = np.inf) -> float:
        """Return the number of independent data of a discrepancy at the lines up to a frequency."""
        return DATA_PER_MODE * max(3.0, self.n_modes * min(1.0, stage / self.data.frequency[-1]))

    def likelihood(self, n: Floats, size: Floats, noise: Floats) -> Levels:
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

    def surroundings(self, key: tuple[str, str], n_lines: int = 30) -> float:
        """Return the median impedance of the structure to motion along a released constraint.

        It is the magnitude of force over displacement, at lines over the whole band [N/m, N·m/rad].
        """
        omega2 = (2 * np.pi * self.data.frequency[self.lines_up_to(np.inf, n_lines)]) ** 2
        return self.reduced.impedance(key, omega2)

    def receptance(self, result: FitResult, lines: Ints | None = None) -> Complexes:
        """Return the fitted model's receptances as the sensors read them, at some or all lines."""
        lines = np.arange(len(self.data.frequency)) if lines is None else lines
        return self.responses.receptance(self, result, lines)

    def vectors_with(self, element: AmplitudeDependent) -> tuple[Floats, Floats]:
        """Return sensors and excitations, each with the motion that an element acts on as the last."""
        b = np.zeros((self.reduced.model.n_dof, 1))
        dofs, row = element.strain(self.reduced.model, element.direction)
        b[dofs, 0] = row
        outputs, inputs = self.vectors
        return np.hstack([outputs, b]), np.hstack([inputs, b])

    def steady(self, result: FitResult, lines: Ints) -> Steady:
        """Return the steady vibration at the data's level of force with one effect that depends on amplitude.

        Without a level the effect keeps the amplitude that it has.
        """
        (element,) = (e for e in result.effects if isinstance(e, AmplitudeDependent))
        if self.references[0] is not None:
            msg = (
                f"'{element.name}' depends on amplitude, which follows from the force; the FRFs of "
                f"'{self.data.measurement.name}' refer to a sensor, and their force is unknown"
            )
            raise MeasurementError(msg)
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
