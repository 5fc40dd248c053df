"""What a fit to FRFs is of: the data, a reduced model, what may vary, and the FRFs as a function of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import NDArray

from fem.model import Effect, ParameterRef, dofs_of
from fem.reduction.deviations import DeviatingFRF, Deviations
from fem.reduction.parametric_frf import ParametricFRF
from fem.reduction.reduced_model import ReducedModel
from fem.reduction.set_ups import SetUp, SetUpsFRF
from updating.inference.belief import DATA_PER_MODE, DISCREPANCY_MIN
from updating.inference.defaults import EXPLAINED_LEVEL
from updating.inference.fit_data import FitData, sensor_vectors
from updating.inference.form_scatter import FormScatter
from updating.inference.mode_targets import ModeTargets
from updating.inference.parameters import DampingCurve
from updating.inference.unknowns import Uncertain
from updating.least_squares.levels import Levels
from updating.measurement.channel_errors import N_ERRORS
from updating.measurement.measurement import sensor_point


@dataclass(frozen=True, slots=True, eq=False)
class FitInputs:
    """Everything that a fit needs but the candidates: data, a reduced model, and what may vary.

    Attributes
    ----------
    reduced : ReducedModel
    data : FitData
    nuisances : tuple of Nuisance or Unknown
    damping : DampingCurve
    stages : ndarray
        Upper ends of the bands of the frequency continuation, rising; the last is the whole band [Hz].
    n_modes : int
        Elastic modes in the band.
    n_lines : int
        At most this many lines are fitted.
    model_error : float
        Residual level up to which a model counts as right, because beams are not the structure itself
        [nepers]; 0 if nothing but noise and the mesh may be left.
    scatter : FormScatter, optional
        Small deviations that are uncertain in every fit.
    mesh_level : float
        Residual level that the elements leave of exact members [nepers].
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
    """

    reduced: ReducedModel
    data: FitData
    nuisances: tuple[Uncertain, ...]
    damping: DampingCurve
    stages: NDArray[np.float64] = field(default_factory=lambda: np.array([np.inf]))
    n_modes: int = 10
    n_lines: int = 160
    model_error: float = EXPLAINED_LEVEL
    scatter: FormScatter | None = None
    mesh_level: float = 0.0
    modes: ModeTargets | None = None
    decay: float = 0.0
    viscous: bool = False
    pieces: int = 0

    @property
    def form_right(self) -> bool:
        """Whether the residual may only be noise and the mesh's error."""
        return self.model_error == 0

    @property
    def vectors(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Sensors and excitations as combinations of DOFs."""
        outputs, inputs, *_ = self._ends
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
    def _ends(self) -> tuple[NDArray[np.float64], ...]:
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
        *_, outputs, inputs = self._ends
        if channels is not None and channels.any():
            moved = np.einsum("rne,ne->rn", self.misread, channels)
            outputs, inputs = outputs + moved[:, : outputs.shape[1]], inputs + moved[:, outputs.shape[1] :]
        make = ParametricFRF if deviations is None else partial(DeviatingFRF, deviations)
        return make(
            self.reduced,
            outputs,
            inputs,
            frequency,
            refs,
            effects,
            release,
            projected=True,
            decay=self.decay,
            viscous=self.viscous,
        )

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

    def surroundings(self, key: tuple[str, str], n_lines: int = 30) -> float:
        """Return the median impedance of the structure to motion along a released constraint.

        It is the magnitude of force over displacement, at lines over the whole band [N/m, N·m/rad].
        """
        omega2 = (2 * np.pi * self.data.frequency[self.lines_up_to(np.inf, n_lines)]) ** 2
        return self.reduced.impedance(key, omega2)
