"""A sample on the reduced basis, and by the full model, from which the error of the basis is known."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from fem.analysis.frf import FRFKind
from fem.analysis.frf_solver import compute_frf
from fem.analysis.modes import first_modes, solve_modes
from fem.array_types import Bools, Complexes, Floats
from fem.linalg.solvers import factorise
from fem.model import Damping, Model, ParameterRef
from fem.reduction.modal_solution import ModalSolution
from fem.reduction.parametric_frf import ParametricFRF
from fem.reduction.reduced_model import ReducedModel, reduce_model
from fem.system import assemble
from updating.correlation import DB_PER_NEPER
from updating.inference.fit_data import ends_of
from updating.inference.parameters import Nuisance
from updating.inference.preparation import MODE_MARGIN, elastic_frequencies, forces_at
from updating.inference.unknowns import ScaledUnknown, nuisance_unknowns
from updating.measurement.measurement import Sensor, with_instruments

# Shapes that a basis lacks where uncertain parameters are far from their nominal values ---------------------


REACH = 2.0
"""Change of each parameter either way, one at a time, in standard deviations [-]."""
ABOVE = 1.25
"""Modes up to this multiple of the highest frequency must lie in the basis [-]."""
SHARE_OUTSIDE = 1e-3
"""Root of the share of a shape's energy that may lie outside; a mode's frequency errs by half the square
[-]."""


def enriched(
    reduced: ReducedModel,
    unknowns: tuple[ScaledUnknown, ...],
    highest: float,
    forces: NDArray[np.float64],
) -> ReducedModel:
    """Return a model with modes and static responses in its basis for each parameter moved either way.

    The parts outside the basis are compressed by their singular values in the energy norm (proper orthogonal
    decomposition); those below ``SHARE_OUTSIDE`` are dropped. A common modulus or density adds nothing.

    Parameters
    ----------
    reduced : ReducedModel
    unknowns : tuple of ScaledUnknown
    highest : float
        Highest frequency of interest [Hz].
    forces : ndarray (n_dof, k)
        Those of whose responses the basis was made.
    """
    loads, shift = np.asarray(reduced.system.Q.T @ forces), reduced.basis.shift
    system, V = reduced.system, reduced.basis.V
    outside = []
    for unknown in unknowns:
        for x in (unknown.mean - REACH * unknown.std, unknown.mean + REACH * unknown.std):
            value = unknown.to_value(float(np.clip(x, unknown.low, unknown.high)))
            model = reduced.model.with_values({unknown.ref: value})
            moved = assemble(model, reciprocal=False)
            modes = solve_modes(moved, max_frequency=ABOVE * highest)
            shapes = np.asarray(system.Q.T @ modes.shapes[:, modes.n_rigid :])
            static = factorise(moved.K - shift * moved.M).solve(loads)
            both = np.hstack([shapes, static])
            energy = np.einsum("ij,ij->j", both, system.K @ both - shift * (system.M @ both))
            both = both[:, energy > 0] / np.sqrt(energy[energy > 0])
            for _ in range(2):
                both = both - V @ (V.T @ (system.M @ both))
            outside.append(both)
    more = _principal(np.hstack(outside), system.K - shift * system.M) if outside else np.zeros((len(V), 0))
    return reduced.with_shapes(np.asarray(system.Q @ more)) if more.shape[1] else reduced


def _principal(shapes: NDArray[np.float64], K: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return combinations of shapes along which they hold more than ``SHARE_OUTSIDE`` of a mode's energy."""
    if not shapes.shape[1]:
        return shapes
    G = shapes.T @ (K @ shapes)
    energies, vectors = np.linalg.eigh((G + G.T) / 2)
    return shapes @ vectors[:, energies > SHARE_OUTSIDE**2]


# Random values of a study's uncertain parameters and damping, each sample from a seed of its own ------------


@dataclass(frozen=True, slots=True)
class Draw:
    """One sample.

    Attributes
    ----------
    values : ndarray (n_par,)
        Of the uncertain parameters [SI].
    ratio : ndarray (n_knots,)
        Factors of the modal damping ratio at the knots [-].
    others : tuple of float
        Factors of the loss factor, of alpha and of beta [-].
    """

    values: Floats
    ratio: Floats
    others: tuple[float, float, float]


@dataclass(frozen=True, slots=True, eq=False)
class Uncertainty:
    """Independent priors of parameters and of the damping, as fits take them.

    Positive quantities are log-normal, others normal within the bounds of the parameter. Each factor of the
    damping is log-normal.

    Attributes
    ----------
    unknowns : tuple of ScaledUnknown
    knots : ndarray (n,)
        Frequencies at which the modal damping ratio varies by itself [Hz].
    damping : Damping
        Nominal, of the whole structure.
    damping_std : float
        Standard deviation of the logarithm of each factor of the damping [-].
    """

    unknowns: tuple[ScaledUnknown, ...]
    knots: Floats
    damping: Damping
    damping_std: float

    @classmethod
    def of(
        cls, model: Model, nuisances: Sequence[Nuisance], damping_std: float, modes: Floats
    ) -> "Uncertainty":
        """Return the uncertainty of a model.

        Parameters
        ----------
        model : Model
        nuisances : sequence of Nuisance
        damping_std : float
        modes : ndarray (n_modes,)
            Elastic natural frequencies within the band [Hz].

        Raises
        ------
        ModelError
            For a parameter that the model does not have, or that changes a constraint.
        """
        # Frequencies at which the damping ratio varies by itself, at most, as in a fit [-]
        n = int(np.clip(len(modes) // 2, 1, 8))
        knots = np.unique(np.quantile(modes, np.linspace(0, 1, n))) if len(modes) else np.ones(1)
        return cls(nuisance_unknowns(model, nuisances), knots, model.damping, damping_std)

    @property
    def refs(self) -> tuple[ParameterRef, ...]:
        """The parameters that vary."""
        return tuple(u.ref for u in self.unknowns)

    def draw(self, seed: int, k: int) -> Draw:
        """Return sample k of a seed; it depends on nothing else."""
        u = np.random.default_rng((seed, k)).random(len(self.unknowns) + len(self.knots) + 3)
        n = len(self.unknowns)
        values = np.array([_within(v, p) for v, p in zip(self.unknowns, u[:n], strict=True)])
        factors = np.exp(self.damping_std * scipy.special.ndtri(u[n:]))
        loss, alpha, beta = (float(f) for f in factors[-3:])
        return Draw(values, factors[:-3], (loss, alpha, beta))

    def ratio(self, draw: Draw, frequency: Floats) -> Floats:
        """Return the modal damping ratio of a sample at frequencies [Hz]."""
        at, knots = np.log(np.maximum(frequency, 1e-9 * self.knots[0])), np.log(self.knots)
        return self.damping.ratio_at(frequency) * np.exp(np.interp(at, knots, np.log(draw.ratio)))

    def of_structure(self, draw: Draw, frequency: Floats) -> Damping:
        """Return the damping of a sample, with the modal ratio exact at some rising frequencies [Hz]."""
        loss, alpha, beta = draw.others
        d = self.damping
        return replace(
            Damping.modal(self.ratio(draw, frequency), frequency),
            loss_factor=loss * d.loss_factor,
            alpha=alpha * d.alpha,
            beta=beta * d.beta,
        )


def _within(unknown: ScaledUnknown, u: float) -> float:
    """Return the value of an unknown at a probability, of a normal x within the bounds of the parameter."""
    if unknown.log:
        return unknown.to_value(unknown.mean + unknown.std * float(scipy.special.ndtri(u)))
    low, high = ((x - unknown.mean) / unknown.std for x in (unknown.low, unknown.high))
    share = scipy.special.ndtr(low) + u * (scipy.special.ndtr(high) - scipy.special.ndtr(low))
    return unknown.to_value(unknown.mean + unknown.std * float(scipy.special.ndtri(share)))


# ------------------------------------------------------------------------------------------------------------


SILENT = 60 / DB_PER_NEPER
"""An FRF this far below the median level is zero by symmetry, as in a comparison [neper]."""


LEAST = 1e-300
"""Amplitudes of FRFs that are zero, for their logarithm."""


@dataclass(frozen=True, slots=True, eq=False)
class SampledModel:
    """A model on a reduced basis, with its uncertainty: a sample costs one small eigenproblem.

    Attributes
    ----------
    uncertainty : Uncertainty
    seed : int
    engine : ParametricFRF
        At the lines.
    outputs, inputs : ndarray (n_dof, n_out), (n_dof, n_in)
        Sensors, behind them those that responses refer to, and excitations; no columns for natural
        frequencies alone.
    kind : FRFKind
    n_modes : int
        Elastic natural frequencies that are kept.
    """

    uncertainty: Uncertainty
    seed: int
    engine: ParametricFRF
    outputs: Floats
    inputs: Floats
    kind: FRFKind
    n_modes: int

    @classmethod
    def of(
        cls,
        model: Model,
        nuisances: Sequence[Nuisance],
        damping_std: float,
        frequency: Floats,
        sensors: Sequence[Sensor],
        excitations: Sequence[Sensor],
        kind: FRFKind,
        seed: int,
    ) -> "SampledModel":
        """Project a model on its modes and on responses to forces at sensors, excitations and joints.

        Parameters
        ----------
        model : Model
            With a point of the mesh at every sensor.
        nuisances : sequence of Nuisance
        damping_std : float
            Standard deviation of the logarithm of the damping [-].
        frequency : ndarray (n_freq,)
            Lines [Hz], above 0.
        sensors, excitations : sequence of Sensor
        kind : FRFKind
        seed : int
        """
        model, ends = with_instruments(model, sensors, excitations), (*sensors, *excitations)
        highest = float(frequency[-1])
        forces = forces_at(model, ends)
        reduced = reduce_model(model, forces, highest, margin=MODE_MARGIN, releasable=False)
        modes = elastic_frequencies(reduced, highest)
        uncertainty = Uncertainty.of(model, nuisances, damping_std, modes[modes > 0])
        reduced = enriched(reduced, uncertainty.unknowns, highest, forces)
        outputs, inputs, references = ends_of(model, sensors, excitations)
        engine = ParametricFRF(reduced, outputs, inputs, frequency, uncertainty.refs, references=references)
        return cls(uncertainty, seed, engine, outputs, inputs, kind, max(len(modes), 1))

    @property
    def reduced(self) -> ReducedModel:
        """The model on the basis."""
        return self.engine.reduced

    @property
    def n_ends(self) -> tuple[int, int]:
        """Number of responses that are read, and of excitations."""
        references = self.engine.references
        return references.n if references else self.outputs.shape[1], self.inputs.shape[1]

    @property
    def frequency(self) -> Floats:
        """Lines [Hz]."""
        return self.engine.omega / (2 * np.pi)

    def frequencies_and_levels(self, draw: Draw) -> tuple[Floats, Floats]:
        """Return natural frequencies (n_modes,) [Hz], and ln |H| (n_freq, n_out, n_in).

        The global damping is that of the full model: 2iζ_r ω_r ω in each mode.
        """
        engine, unc = self.engine, self.uncertainty
        total, alone = engine.matrices(draw.values)
        d, omega = unc.damping, engine.omega
        loss, alpha, beta = draw.others
        zeta = ((loss - 1) * d.loss_factor + (beta - 1) * d.beta * omega) / 2

        def ratio(f: Floats) -> Floats:
            omega_r = np.maximum(2 * np.pi * f, 1e-9)
            return unc.ratio(draw, f) + (alpha - 1) * d.alpha / (2 * omega_r)

        damped = engine.damped_range(zeta, alone)
        state = ModalSolution.of(self.reduced, total, omega, zeta, damped, modal=ratio)
        first = self.reduced.basis.n_rigid
        lam = np.sort(state.lam)[first : first + self.n_modes]
        frequency = np.sign(lam) * np.sqrt(np.abs(lam)) / (2 * np.pi)
        shape = (len(omega), *self.n_ends)
        if 0 in shape:
            return frequency, np.zeros(shape)
        H = engine.referred(engine.read(draw.values, state, state.solve(engine.inputs)))
        return frequency, self._levels(H)

    def full(self, draw: Draw) -> tuple[Floats, Floats]:
        """Return the same by the full model, without a reduced basis of ours."""
        unc = self.uncertainty
        model = self.reduced.model.with_values(dict(zip(unc.refs, map(float, draw.values), strict=True)))
        modes = first_modes(assemble(model, reciprocal=False), self.n_modes)
        elastic = modes.frequency[modes.n_rigid : modes.n_rigid + self.n_modes]
        at = np.unique(np.concatenate([np.maximum(elastic, 1e-6), self.frequency]))
        system = assemble(model.with_damping(unc.of_structure(draw, at)), reciprocal=False)
        if 0 in self.n_ends:
            return elastic, np.zeros((len(self.frequency), *self.n_ends))
        ends = self.outputs.T, self.inputs.T
        # Error that full solutions may have, relative to the peak of each FRF [-]
        H = compute_frf(system, self.frequency, *ends, FRFKind.RECEPTANCE, tolerance=1e-8).H
        return elastic, self._levels(self.engine.referred(H))

    def _levels(self, H: Complexes) -> Floats:
        """Return ln of the magnitudes of receptances in the model's kind."""
        levels = np.log(np.maximum(np.abs(H), LEAST))
        return levels + self.kind.derivatives * np.log(self.engine.omega)[:, None, None]


@dataclass(frozen=True, slots=True)
class Checked:
    """The error of the reduced basis in one sample.

    Attributes
    ----------
    sample : int
    frequency : float
        Largest relative error of the natural frequencies [-].
    level : float
        Root mean square error of ln |H| [neper]; 0 without FRFs.
    of_peak : float
        Largest error of an amplitude, relative to the peak of its FRF [-].
    """

    sample: int
    frequency: float
    level: float
    of_peak: float


def compute(shared: SampledModel, unit: tuple[str, int, int]) -> Any:
    """Compute the samples from one number up to another; or one by the full model for its error.

    Parameters
    ----------
    shared : SampledModel
    unit : (str, int, int)
        ``("samples", first, last + 1)`` or ``("check", k, k + 1)``.

    Returns
    -------
    dict of ndarray
        ``values`` (n, n_par), ``frequency`` (n, n_modes) and ``levels`` (n, n_freq, n_out, n_in).
    Checked
        Of a check.
    """
    kind, first, last = unit
    if kind == "check":
        return check(shared, first)
    draws = [shared.uncertainty.draw(shared.seed, k) for k in range(first, last)]
    found = [shared.frequencies_and_levels(d) for d in draws]
    return {
        "values": np.array([d.values for d in draws]).reshape(len(draws), -1),
        "frequency": np.array([f for f, _ in found]),
        "levels": np.array([levels for _, levels in found], dtype=np.float32),
    }


def counted_frfs(levels: Floats) -> Bools:
    """Return which FRFs symmetry does not make zero, (n_out, n_in), by ln |H| (n_freq, n_out, n_in)."""
    mean = levels.mean(axis=0)
    return mean > np.median(mean) - SILENT if mean.size else np.zeros(mean.shape, dtype=bool)


def check(shared: SampledModel, k: int) -> Checked:
    """Return the error of the reduced basis in sample k, by a solution of the full model."""
    draw = shared.uncertainty.draw(shared.seed, k)
    frequency, levels = shared.frequencies_and_levels(draw)
    true_frequency, true_levels = shared.full(draw)
    known = counted_frfs(true_levels)
    off = (levels - true_levels)[:, known]
    peak = true_levels.max(axis=0)[known] if known.any() else np.zeros(0)
    of_peak = np.abs(np.exp(levels[:, known] - peak) - np.exp(true_levels[:, known] - peak))
    n = min(len(frequency), len(true_frequency))
    return Checked(
        k,
        float(np.abs(frequency[:n] / true_frequency[:n] - 1).max()),
        float(np.sqrt((off**2).mean())) if off.size else 0.0,
        float(of_peak.max(initial=0.0)),
    )
