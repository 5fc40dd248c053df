"""Preparation of a diagnosis: a reduced model, the data to compare it with, and the accuracy of both."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypedDict

import numpy as np

from fem.analysis.frf import FRF
from fem.array_types import Complexes, Floats, Ints
from fem.connection_damping import ConnectionDamping
from fem.effects.joint import PointPair
from fem.effects.with_frame import WithFrame
from fem.elements.frame import Frame
from fem.elements.splitting import split
from fem.linalg.solvers import one_thread
from fem.model import Damping, Model
from fem.reduction.parametric_frf import ParametricFRF
from fem.reduction.reduced_model import ReducedModel, reduce_model, values_of
from updating.correlation import DB_PER_NEPER, log_ratio, rms_db
from updating.inference.bases import direct_responses
from updating.inference.defaults import EXPLAINED_LEVEL, MOST_SPLITS
from updating.inference.fit import FitProblem
from updating.inference.fit_data import NOISE_LIMIT, FitData, ends_of, prepare, sensor_vectors
from updating.inference.fit_result import FitResult, fitted_model
from updating.inference.parameters import DampingCurve
from updating.inference.unknowns import Uncertain
from updating.measurement.measurement import (
    Measurement,
    MeasurementError,
    Sensor,
    directed_of,
    outputs_of,
    usable_lines,
    with_instruments,
)

MODE_MARGIN = 2.5
"""The reduced basis holds the modes up to this multiple of the highest frequency."""
MESH_SHARE = 0.03
"""Elements are cut where the level that the mesh leaves is more than this share of the noise's."""
NOMINAL_RATIO = 5e-3
"""Damping ratio of a model that has none [-]."""
LEAST_DAMPING_STD = 1e-6
"""Least standard deviation of the logarithm of damping, which is held with 0 [-]."""
LEAST_RATIO = 1e-5
"""Least nominal damping ratio, of which a fit can take a multiple [-]."""
NEIGHBOURS = 0.03
"""Lines within this share of a frequency say how far the structure moves there."""
N_FIT_LINES = 160
"""At most this many lines are fitted."""


class FitOptions(TypedDict, total=False):
    """Damping, band and lines of a problem, as of :func:`build_problem`."""

    damping_std: float
    band: tuple[float, float] | None
    n_lines: int


class ProblemOptions(FitOptions, total=False):
    """The same, with the model's error."""

    model_error: float


def attachment_forces(model: Model, measurement: Measurement) -> Floats:
    """Return where forces act or may act: excitations, sensors and the sides of joints, shape (n_dof, k)."""
    every, _ = outputs_of(measurement.sensors, measurement.excitations)
    return forces_at(model, (*measurement.excitations, *every))


def forces_at(model: Model, sensors: Sequence[Sensor]) -> Floats:
    """Return forces at sensors, excitations and the sides of joints, shape (n_dof, k)."""
    # Sensors count too: where a response is mostly local stretching, modes alone converge slowly.
    columns = [sensor_vectors(model, sensors)]
    for element in model.of_kind(PointPair):
        dofs, B = element.relative(model)
        elastic = [d not in element.rigid_directions for d in ("x", "y", "z", "rx", "ry", "rz")]
        block = np.zeros((model.n_dof, 6))
        block[dofs] = B.T
        columns.append(block[:, elastic])
    return np.hstack(columns)


def elastic_frequencies(reduced: ReducedModel, up_to: float) -> Floats:
    """Return the reduced model's elastic natural frequencies up to a frequency [Hz]."""
    lam = reduced.main_modes[0][reduced.basis.n_rigid :]
    f = np.sqrt(np.maximum(lam, 0.0)) / (2 * np.pi)
    return f[f <= up_to]


def with_higher_mass(model: Model) -> Model:
    """Return a model whose members' consistent mass is of higher order.

    Weak effects are otherwise found that only take up the mesh's error.
    """
    effects = (
        e.with_mass_of_higher_order() if isinstance(e, Frame | WithFrame) else e for e in model.effects
    )
    return replace(model, effects=tuple(effects))


@one_thread()
def build_problem(
    model: Model,
    measurement: Measurement,
    nuisances: Sequence[Uncertain],
    *,
    damping_std: float = 0.5,
    band: tuple[float, float] | None = None,
    n_lines: int = N_FIT_LINES,
    connections: bool = False,
    model_error: float = EXPLAINED_LEVEL,
) -> FitProblem:
    """Reduce a model and prepare the data for fits.

    Parameters
    ----------
    model : Model
        With a point of the mesh at every sensor. Its modal damping ratios become the nominal damping curve
        (0.5 % where there are none).
    measurement : Measurement
    nuisances : sequence of Nuisance or Unknown
    damping_std : float
        Standard deviation of the logarithm of the damping ratio [-].
    band : (float, float), optional
        Frequencies that count [Hz].
    n_lines : int
        At most this many lines are fitted.
    connections : bool
        Whether connections may be damped otherwise than members.
    model_error : float
        Residual level up to which a model counts as right, because beams are not the structure itself
        [nepers]; 0 if nothing but noise and the mesh may be left, and readings have nothing of motion
        transverse to their sensors.

    Raises
    ------
    MeasurementError
        If there are fewer than ``LEAST_LINES`` lines, or no value of the FRFs is left to compare.
    """
    model = with_instruments(model, measurement.sensors, measurement.excitations)
    other = next(iter(model.of_kind(ConnectionDamping)), None) if connections else None
    model = model.without_effect(other.name) if other else model  # the curve has it
    frf = usable_lines(measurement, band)
    highest = float(frf.frequency[-1])
    reduced, curve, modes = _reduced(model, measurement, frf, damping_std, connections, other)
    k = len(modes)
    low = modes[4] * 1.1 if k > 8 else highest
    middle = modes[k // 2] if k > 14 else highest
    stages = np.unique(np.minimum([low, middle, highest], highest))
    data = _prepared(reduced, curve, measurement, band, model_error)
    counted = data.frequency[data.mask.any(axis=(1, 2)) & ~data.held_out]
    if not counted.size:
        msg = (
            f"no FRF of '{measurement.name}' can be compared: every value is 0, small compared with the "
            f"others, or uncertain by more than {100 * NOISE_LIMIT:.0f} % (from {measurement.noise_source})"
        )
        raise MeasurementError(msg)
    stages = stages[stages >= counted[0]]
    return FitProblem(
        reduced=reduced,
        data=data,
        nuisances=tuple(nuisances),
        damping=curve,
        bands=stages,
        n_modes=max(k, 1),
        n_lines=n_lines,
        model_error=model_error,
        viscous=measurement.viscous,
    )


def _reduced(
    model: Model,
    measurement: Measurement,
    frf: FRF,
    damping_std: float,
    connections: bool,
    other: ConnectionDamping | None,
) -> tuple[ReducedModel, DampingCurve, Floats]:
    """Return a reduced model without modal damping, the curve of that, and its modes in the band [Hz]."""
    highest = float(frf.frequency[-1])
    undamped = model.with_damping(model.damping.without_modal())
    reduced = reduce_model(undamped, attachment_forces(model, measurement), highest, margin=MODE_MARGIN)
    modes = elastic_frequencies(reduced, highest)
    # A suspension's modes below the band have no lines: they are neither knots nor stages.
    modes = modes[modes >= frf.frequency[0]]
    n_knots = int(np.clip(len(modes) // 2, 1, 8))
    knots = (
        np.unique(np.quantile(modes, np.linspace(0, 1, n_knots))) if len(modes) else np.array([highest / 2])
    )
    nominal = nominal_ratio(model, knots, other, connections)
    curve = DampingCurve(
        knots,
        np.atleast_2d(nominal(knots))[0],
        max(damping_std, LEAST_DAMPING_STD),
        connections,
        nominal if np.ptp(model.damping.ratio) or other else None,
    )
    return reduced, curve, modes


@dataclass(frozen=True, slots=True, eq=False)
class NominalRatio:
    """The nominal damping ratio over frequency, with that of connections if they have their own.

    Attributes
    ----------
    damping : Damping
    least : float
        Least ratio of members [-].
    others : ConnectionDamping or None
    connections : bool
        Whether connections have a ratio of their own.
    """

    damping: Damping
    least: float
    others: ConnectionDamping | None
    connections: bool

    def __call__(self, frequency: Floats) -> Floats:
        """Return ζ at frequencies [Hz], (n_freq,), or with connections that and theirs, (2, n_freq)."""
        members = np.maximum(self.damping.ratio_at(frequency), self.least)
        if not self.connections:
            return members
        ratio = self.others.ratio_at(frequency) if self.others else None
        return np.stack([members, members if ratio is None else np.maximum(ratio, LEAST_RATIO)])


def nominal_ratio(
    model: Model, knots: Floats, other: ConnectionDamping | None, connections: bool
) -> NominalRatio:
    """Return the nominal damping ratio of a model, ``NOMINAL_RATIO`` where it has no damping."""
    d = model.damping
    given = d.alpha or d.beta or d.loss_factor or d.ratio_at(knots).any()
    return NominalRatio(d, LEAST_RATIO if given else NOMINAL_RATIO, other, connections)


def prepared_like(
    problem: FitProblem, measurement: Measurement, band: tuple[float, float] | None = None
) -> FitData:
    """Prepare other channels, such as held-out ones, as those of a problem were.

    By its own model's results; beside corners that came later than its data these have their nominal size.

    Parameters
    ----------
    problem : FitProblem
    measurement : Measurement
        With a point of the problem's mesh at every sensor and excitation.
    band : (float, float), optional
        Frequencies that count [Hz].

    Raises
    ------
    MeasurementError
        If all FRFs are zero.
    """
    return _prepared(problem.reduced, problem.damping, measurement, band, problem.model_error)


def _prepared(
    reduced: ReducedModel,
    curve: DampingCurve,
    measurement: Measurement,
    band: tuple[float, float] | None,
    model_error: float,
) -> FitData:
    """Prepare FRFs by a model's FRFs and, if it may err, its motion across the sensors."""
    f = measurement.frf.select(band=band).frequency if band else measurement.frf.frequency
    f, n = f[f > 0], len(measurement.sensors)
    square = [
        replace(s, direction=d)
        for s in directed_of(measurement.sensors)
        for d in np.linalg.svd([s.direction])[2][1:]
    ]
    sensors = (*measurement.sensors, *(() if model_error == 0 else square))
    outputs, inputs, references = ends_of(reduced.model, sensors, measurement.excitations)
    engine = ParametricFRF(
        reduced, outputs, inputs, f, (), viscous=measurement.viscous, references=references
    )
    values, zeta = values_of(reduced.model, ()), curve.ratio(f, curve.start)
    nominal, moved = np.split(engine.evaluate(values, zeta, gradient=False)[0], [n], axis=1)
    if not moved.size:
        return prepare(measurement, nominal, band)
    across = np.zeros(nominal.shape)
    across[:, [s.directed for s in measurement.sensors]] = _across(f, moved)
    return prepare(measurement, nominal, band, across=across)


def _across(frequency: Floats, H: Complexes) -> Floats:
    """Return how far places move square to their sensors, (n_freq, n_out, n_in), by two receptances of each.

    The root mean square over neighbouring lines, as the model's resonances are not where they were measured.
    """
    squares = (2 * np.pi * frequency[:, None, None]) ** 2
    moved = (np.abs(squares[..., None] * H.reshape(len(frequency), -1, 2, H.shape[2])) ** 2).sum(axis=2)
    total = np.concatenate([np.zeros_like(moved[:1]), moved.cumsum(axis=0)])
    first = np.searchsorted(frequency, (1 - NEIGHBOURS) * frequency)
    last = np.searchsorted(frequency, (1 + NEIGHBOURS) * frequency, side="right")
    mean = (total[last] - total[first]) / (last - first)[:, None, None]
    return np.sqrt(np.maximum(mean, 0.0)) / squares


def discretisation_error(problem: FitProblem) -> tuple[float, float]:
    """Estimate the error of the mesh by halving every element: root mean square [dB], and level [nepers].

    The error falls at least with the square of their size, so that the difference is 3/4 of the error.
    """
    lines = problem.lines_up_to(np.inf, 200)
    nominal = problem.nominal().as_described()
    problem = problem.unloaded(nominal)
    finer = finer_receptances(problem, nominal, lines)
    ratio: Any = log_ratio(problem.receptance(nominal, lines), finer) * 4 / 3
    ratio = np.where(problem.data.mask[lines], ratio, complex("nan"))
    return rms_db(ratio), problem.level(ratio, lines)


def build_fine(
    build: Callable[[Model], FitProblem], model: Model, model_error: float
) -> tuple[FitProblem, Model, int, tuple[float, float], float]:
    """Return the problem of a model whose elements are short enough for the data.

    Those of a measurement that an earlier fit has chosen values of are cut as that fit did: what it has found
    may need others, and its error would not come back.

    Parameters
    ----------
    build : callable
        Makes the problem of a model.
    model : Model
    model_error : float
        Residual level up to which a model counts as right [nepers].

    Returns
    -------
    FitProblem, Model
        With each element cut.
    int
        Number of pieces of each element.
    (float, float)
        Error of the mesh: root mean square [dB] and level [nepers].
    float
        Root mean square before elements were cut [dB].
    """
    problem = build(model)
    error = before = discretisation_error(problem)
    # Residual level below which finer elements gain nothing [nepers]
    n = problem.data.measurement.pieces or splits(error[1], max(problem.data.noise_level, model_error, 0.01))
    if n > 1:
        model = split(model, n)
        problem = build(model)
        error = discretisation_error(problem)
    return replace(problem, pieces=n), model, n, error, before[0]


def finer_receptances(problem: FitProblem, result: FitResult, lines: Ints) -> Complexes:
    """Return the sensors' FRFs of a fitted model with every element halved, (n_lines, n_out, n_in)."""
    model, m = fitted_model(problem.reduced.model, result), problem.data.measurement
    model = split(model, 2)
    f, highest = problem.data.frequency[lines], float(problem.data.frequency[-1])
    forces = attachment_forces(model, m)
    reduced = reduce_model(model, forces, highest, margin=MODE_MARGIN, releasable=False)
    outputs, inputs, references = ends_of(model, m.sensors, m.excitations)
    engine = ParametricFRF(reduced, outputs, inputs, f, (), viscous=problem.viscous, references=references)
    return engine.evaluate(np.zeros(0), problem.damping.ratio(f, result.zeta), gradient=False)[0]


def splits(mesh_level: float, noise_level: float) -> int:
    """Return into how many to cut each element, so that the mesh's error is small against the noise."""
    too_large = mesh_level / (MESH_SHARE * noise_level)
    return min(MOST_SPLITS, int(np.ceil(too_large**0.5))) if too_large > 1 else 1


def basis_error(problem: FitProblem, result: FitResult, n_lines: int) -> float:
    """Check the reduced basis against direct solutions of the full model with the fitted parameters [dB].

    Effects that depend on amplitude are left out of both.
    """
    return direct_responses(problem, result, n_lines)[0] * DB_PER_NEPER
