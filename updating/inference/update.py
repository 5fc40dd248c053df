"""Update a model's parameters to measured modes and FRFs, with their uncertainty.

    updated = update(model, [("frame", "E:steel")], frequency=[43.2, 118.9])
    updated = update(model, parameters, frf=H, lines=f, outputs=places, inputs=places[:1])
    print(updated.table())

Natural frequencies and shapes by their linearised sensitivities (Friswell and Mottershead, *Finite Element
Model Updating in Structural Dynamics*, 1995, ch. 8), FRFs by their logarithm, or both in one objective: the
negative log posterior of the parameters, with priors. `docs/updating.md` says how and when to doubt it.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import ndtri

from fem.analysis.frf import FRF, FRFError, FRFKind
from fem.analysis.modes import Modes
from fem.model import Model, ModelError, ParameterRef
from fem.system import System
from updating.correlation import DB_PER_NEPER
from updating.inference.determined import (
    SEEN,
    SHARE,
    blind_directions,
    blind_words,
    held,
    split_covariance,
    taking_part,
)
from updating.inference.loss import pseudo_huber, pseudo_huber_weight
from updating.inference.regularisation import (
    LCurve,
    l_curve,
    select_by_pivoting,
    select_forward,
)
from updating.inference.residuals import (
    FRFData,
    FRFResidual,
    ModeData,
    ModePairs,
    ModePoint,
    Places,
    frf_data,
    mode_data,
    mode_jacobian,
    mode_residual,
    with_ratios,
)
from updating.inference.sampling import Samples, sample
from updating.inference.unknowns import (
    WIDTH,
    Parameters,
    Scaled,
    damping_knots,
    damping_ratios,
    nuisances_of,
    scaled_unknowns,
)
from updating.measurement.measurement import Measurement, with_sensor_masses
from updating.modal.identification import IdentifiedModes

CORRELATED = 0.95
"""Pairs of parameters whose estimates are more correlated than this are named [-]."""

DETERMINED = 0.5
"""Parameters known no better than this, relative to their value, are named [-]."""

SAID = 0.9
"""Of parameters whose standard deviation stays above this part of the prior's the data say nothing [-]."""

AGAINST = 4.0
"""Parameters that end farther from their prior than this, in its standard deviations, are named [-]."""

_MOST_RELEASED = 3
"""At most so many priors are let go, one after the other."""

_WORSE = 1.5
"""A fit without a prior counts if its misfit is at most so many times that with it."""

_ROBUST = 0.5
"""Residual of an FRF at which the loss turns from quadratic to linear [nepers]."""

_LONGEST = 0.4
"""Longest step of any unknown in one iteration, in ln θ or units of its scale."""

_ENOUGH = 1e-6
"""An iteration ends when half the square of the step, in standard deviations, is below this."""

_REBASES = 6
"""So many times at most the reduced basis of the FRFs is made again at the new values."""

_EXPLAINED = 1.2
"""Below this mean square residual nothing is left to be explained by another form of damping [-]."""

_BETTER = 0.9
"""The model's own damping between resonances is taken if it lowers the misfit to this part."""

BETTER_NATS = 1.0
"""Log posterior by which another model is better than what was found [nats]."""

_MOST_SHIFTS = 40
"""At most so many natural frequencies get an error of their own."""


class Ending(Enum):
    """How an updating ended: its cause, and what to do."""

    CONVERGED = ("converged", "the last step is small beside the standard deviations", "")
    OUT_OF_ITERATIONS = (
        "out of iterations",
        "the misfit was still falling",
        "allow more iterations, or start nearer: a wrong start makes steps short",
    )
    STUCK = (
        "stuck",
        "no step along the derivatives lowers the misfit, though they say it should",
        "check whether modes change partners between steps; give shapes, a narrower band, or more starts",
    )
    NO_PARTNERS = (
        "no partners",
        "no measured mode looks like a mode of the model at the start",
        "check the outputs' points, directions and signs, or raise the number of starts",
    )
    NOT_FINITE = (
        "not finite",
        "the model has no finite response at the start",
        "give it damping, and leave out lines at 0 Hz",
    )
    NOTHING_DETERMINED = (
        "nothing determined",
        "no measured mode or line changes with any of the parameters",
        "check which modes the measured ones are (shapes, or numbers), or name other parameters",
    )
    AT_BOUNDS = (
        "at bounds",
        "every parameter has run to a bound",
        "the model lacks what the data show, or the bounds are too narrow: look for a missing effect",
    )

    @property
    def cause(self) -> str:
        """What happened."""
        return self.value[1]

    @property
    def remedy(self) -> str:
        """What to do about it; empty where nothing need be done."""
        return self.value[2]


_FAILED = (Ending.NO_PARTNERS, Ending.NOT_FINITE, Ending.NOTHING_DETERMINED, Ending.AT_BOUNDS)
"""Ends of a fit that tell nothing of the priors."""


@dataclass(frozen=True, slots=True, eq=False)
class Settings:
    """How to go about it.

    Attributes
    ----------
    stages : tuple of float
        Parts of the highest frequency up to which FRFs are fitted, one after the other; the last is 1.
    n_starts : int
        Starts; the first is the model's values, others are drawn from the priors.
    select : str
        ``"pivoting"`` or ``"forward"`` to leave out parameters that the data cannot tell apart, or empty.
    regularisation : str
        ``"tikhonov"`` to keep steps from the start small where data are weak, ``"gsvd"`` for those along an
        operator; empty for none. The weight is that at the L-curve's corner.
    operator : ndarray (p, n_unknown) or None
        L of ``"gsvd"``, on the unknowns' own scales (ln θ, or θ over its scale).
    max_iterations : int
        In each stage.
    n_lines : int
        At most so many lines are fitted, evenly spread; in the last stage four times as many.
    n_samples : int
        Steps of the sampler after the fit; 0 for none.
    contradicted : float
        A prior from which the data move a parameter by more than this, in its standard deviations, is wrong:
        the worst is let go, and all is fitted again from there, so that it does not pull at the others. Then
        the next; infinity keeps all.
    seed : int
        Of starts and samples.
    """

    stages: tuple[float, ...] = (0.25, 0.5, 1.0)
    n_starts: int = 1
    select: str = ""
    regularisation: str = ""
    operator: NDArray[np.float64] | None = None
    max_iterations: int = 30
    n_lines: int = 250
    n_samples: int = 0
    contradicted: float = 10.0
    seed: int = 0

    def __post_init__(self) -> None:
        for what, value, allowed in (
            ("selection", self.select, ("", "pivoting", "forward")),
            ("regularisation", self.regularisation, ("", "tikhonov", "gsvd")),
        ):
            if value not in allowed:
                msg = f"the {what} is '{value}'; allowed are {', '.join(a for a in allowed if a)}, or none"
                raise ValueError(msg)
        if self.regularisation == "gsvd" and self.operator is None:
            msg = "the regularisation 'gsvd' needs an operator L (p, n_unknown)"
            raise ValueError(msg)
        for what, least in (("n_starts", 1), ("max_iterations", 1), ("n_lines", 1), ("n_samples", 0)):
            if getattr(self, what) < least:
                msg = f"{what} is {getattr(self, what)}; at least {least} is needed"
                raise ValueError(msg)
        if not self.contradicted > 0:
            msg = f"a prior is contradicted at {self.contradicted} standard deviations; it must be positive"
            raise ValueError(msg)
        if not self.stages or self.stages[-1] != 1 or any(not 0 < s <= 1 for s in self.stages):
            msg = f"the stages are {self.stages}; they lie above 0 and end with 1"
            raise ValueError(msg)


@dataclass(frozen=True, slots=True)
class UpdatedParameter:
    """One unknown before and after.

    Attributes
    ----------
    name, unit : str
    refs : tuple of (effect, parameter)
        What it moves; empty for a damping ratio.
    start, lower, upper : float
        [unit]
    prior_std : float or None
        Relative for a log-normal prior, in its unit for a normal one.
    value, std : float
        [unit]; the deviation is infinite where the data say nothing, and NaN at a bound.
    log : bool
        Whether the logarithm is what is normally distributed.
    at_bound : bool
    determined : bool
        Whether the data, and not the prior, say what it is.
    from_prior : float
        How far the value is from the prior's mean, in its standard deviations; NaN without a prior [-].
    released : bool
        Whether the data contradict the prior so much that it was let go (``Settings.contradicted``).
    """

    name: str
    unit: str
    refs: tuple[ParameterRef, ...]
    start: float
    lower: float
    upper: float
    prior_std: float | None
    value: float
    std: float
    log: bool
    at_bound: bool
    determined: bool
    from_prior: float = np.nan
    released: bool = False

    def interval(self, level: float = 0.95) -> tuple[float, float]:
        """Return the interval that holds the truth with a probability; symmetric in ln θ where ``log``."""
        half = float(ndtri(0.5 + level / 2)) * self.std
        if self.log:
            factor = float(np.exp(min(half / self.value, 700.0)))  # beyond is without bounds, as floats go
            return self.value / factor, self.value * factor
        return self.value - half, self.value + half


@dataclass(frozen=True, slots=True, eq=False)
class UpdateStep:
    """One accepted step.

    Attributes
    ----------
    stage : str
        ``"modes"``, or up to which frequency FRFs were fitted.
    values : ndarray (n,)
        Of all unknowns [their units].
    cost : float
        Negative log posterior up to a constant; comparable within a stage.
    frequency_error : float
        Root mean square of the relative errors of natural frequencies; NaN without [-].
    mac : float
        Mean of the paired modes'; NaN without shapes [-].
    frf_db : float
        Root mean square of the FRFs' error in amplitude; NaN without [dB].
    lost : tuple of int
        Measured modes without a partner.
    """

    stage: str
    values: NDArray[np.float64]
    cost: float
    frequency_error: float
    mac: float
    frf_db: float
    lost: tuple[int, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Updated:
    """An updated model, how it came about, and how far to trust it.

    Attributes
    ----------
    model : Model
        With the parameters at their updated values, and the damping if that was fitted.
    parameters : tuple of UpdatedParameter
        Then damping ratios, if they were fitted.
    correlation : ndarray (n, n)
        Of the estimates [-].
    covariance : ndarray (n, n)
        Linearised, of the values [products of their units].
    path : tuple of UpdateStep
        From the start to the end.
    misfit : mapping of str to float
        Mean square residual in units of the stated variance, of ``"modes"`` and ``"frf"``; 1 if noise and
        model error are as stated, more widens the standard deviations.
    pairs : ModePairs or None
        Measured modes and their partners.
    frequency : ndarray (n,)
        Measured natural frequencies, in the order of the pairs [Hz].
    shifts : ndarray (k, 3)
        Of FRFs, what the model misses of natural frequencies though its parameters are right: frequency [Hz],
        relative shift and its standard deviation [-].
    gains : ndarray (n_out + n_in, 2)
        The same of the amplitudes of outputs, then inputs: factor and its standard deviation [-].
    left_out : tuple of (name, reason)
        Parameters that selection kept at their start.
    curve : LCurve or None
        Of the regularisation.
    samples : Samples or None
        Of the values, if asked for.
    starts : tuple of (values, cost)
        Where several starts led.
    ending : Ending
    messages : tuple of str
        What to doubt.
    """

    model: Model
    parameters: tuple[UpdatedParameter, ...]
    correlation: NDArray[np.float64]
    covariance: NDArray[np.float64]
    path: tuple[UpdateStep, ...]
    misfit: Mapping[str, float]
    pairs: ModePairs | None
    frequency: NDArray[np.float64]
    shifts: NDArray[np.float64]
    gains: NDArray[np.float64]
    left_out: tuple[tuple[str, str], ...]
    curve: LCurve | None
    samples: Samples | None
    starts: tuple[tuple[NDArray[np.float64], float], ...]
    ending: Ending
    messages: tuple[str, ...]

    @property
    def converged(self) -> bool:
        """Whether it ended as it should."""
        return self.ending is Ending.CONVERGED

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the unknowns."""
        return tuple(p.name for p in self.parameters)

    @property
    def values(self) -> NDArray[np.float64]:
        """Updated values, (n,) [their units]."""
        return np.array([p.value for p in self.parameters])

    @property
    def std(self) -> NDArray[np.float64]:
        """Standard deviations, (n,) [their units]."""
        return np.array([p.std for p in self.parameters])

    def __getitem__(self, name: str) -> UpdatedParameter:
        for p in self.parameters:
            if p.name == name:
                return p
        msg = f"nothing named '{name}' was updated; there are {', '.join(self.names)}"
        raise KeyError(msg)

    def table(self) -> str:
        """Return start, value and standard deviation of each parameter as text, then what to doubt."""
        width = max([len("parameter"), *(len(p.name) for p in self.parameters)])
        lines = [f"{'parameter':{width}}  {'start':>11}  {'value':>11}  {'std':>9}  {'change':>8}  unit"]
        for p in self.parameters:
            change = f"{100 * (p.value / p.start - 1):+.2f} %" if p.start else "-"
            mark = " (at its bound)" if p.at_bound else "" if p.determined else " (not determined)"
            mark += " (prior dropped)" if p.released else ""
            std = f"{p.std:9.2g}" if np.isfinite(p.std) else f"{'-':>9}"
            lines.append(
                f"{p.name:{width}}  {p.start:11.5g}  {p.value:11.5g}  {std}  {change:>8}  {p.unit}{mark}"
            )
        lines += [f"{name}: left at its start, as {reason}" for name, reason in self.left_out]
        return "\n".join([*lines, *self.messages])


def update(
    model: Model,
    parameters: Parameters,
    *,
    frequency: ArrayLike | None = None,
    shapes: ArrayLike | None = None,
    modes: Modes | IdentifiedModes | ModeData | None = None,
    frf: FRF | Measurement | FRFData | ArrayLike | None = None,
    lines: ArrayLike | None = None,
    outputs: Places | None = None,
    inputs: Places | None = None,
    kind: FRFKind | str = FRFKind.ACCELERANCE,
    band: tuple[float, float] | None = None,
    numbers: Sequence[int] | None = None,
    frequency_std: ArrayLike = 1e-3,
    shape_std: ArrayLike = 0.03,
    noise: ArrayLike | None = None,
    model_error: float = 1e-3,
    amplitude_error: float = 0.01,
    damping: bool | ArrayLike | None = None,
    settings: Settings | None = None,
) -> Updated:
    """Update parameters of a model to measured natural frequencies, shapes, FRFs, or all of them at once.

    Minimised is Σ_g ½ n_g F(q_g) + ½ Σ ((x - mean)/std)², with q_g the mean square residual of modes and of
    FRFs in units of the stated variance (see :mod:`updating.inference.residuals`), and F(q) = q - 1 below 1
    and ln q above: the stated variance is the least, and while a model is far off its misfit counts as error,
    so that priors hold. Levenberg-Marquardt steps with exact derivatives, within bounds.

    FRFs are fitted up to rising frequencies on a reduced basis, which is made again at the new values until
    these stay; the cost of an iteration does not depend on the mesh.

    Parameters
    ----------
    model : Model
        At the values to start from.
    parameters : sequence of (effect, parameter) or Unknown, or mapping
        What to update; a mapping gives prior standard deviations, relative for positive parameters [-] and
        in their units for others.
    frequency, shapes : array_like (n,), (n_out, n), optional
        Measured natural frequencies without rigid-body modes [Hz], and shapes at the outputs.
    modes : Modes or IdentifiedModes, optional
        Both in one; its labels pick outputs that are given by label. Identified modes bring their standard
        deviations, in place of ``frequency_std`` and ``shape_std``.
    frf : FRF, Measurement or array_like (n_freq, n_out, n_in), optional
    lines : array_like (n_freq,), optional
        Frequencies of bare FRFs [Hz].
    outputs, inputs : places, optional
        DOF numbers, (point, direction) pairs, rows of combinations, sensors, or (point, direction) by label.
    kind : FRFKind or str
        Of bare FRFs.
    band : (float, float), optional
        Lines that count [Hz].
    numbers : sequence of int, optional
        Which elastic modes of the model the frequencies belong to, counted from 0, where there are no shapes.
    frequency_std, shape_std : float or array_like (n,)
        Noise of the modes: of frequencies, and of a shape's components over its root mean square, relative
        [-].
    noise : float or array_like, optional
        Of the FRFs, relative, of real and imaginary part each; estimated unless given [-].
    model_error, amplitude_error : float
        What even the right parameters miss in natural frequencies and in amplitudes, relative [-].
    damping : bool or array_like, optional
        Whether modal damping ratios are updated too, which add to the model's other damping; an array gives
        the frequencies between which they are linear [Hz]. With FRFs it is so unless declined. Without, the
        measured modes' ratios are taken over if asked for.
    settings : Settings, optional

    Returns
    -------
    Updated
        The best point, also where the fit failed; ``ending`` and ``messages`` say so.

    Raises
    ------
    ModelError
        For unknown parameters, data that do not fit one another or the model, or nothing to fit.
    """
    settings = settings or Settings()
    if isinstance(frf, Measurement):
        model = with_sensor_masses(model, (*frf.sensors, *frf.excitations))
    of_modes = _mode_data(
        model, frequency, shapes, modes, outputs, numbers, frequency_std, shape_std, model_error
    )
    of_frf = None
    if isinstance(frf, FRFData):
        of_frf = frf
    elif frf is not None:
        of_frf = frf_data(
            model, frf, lines=lines, outputs=outputs, inputs=inputs, kind=kind, band=band, noise=noise,
            model_error=model_error, amplitude_error=amplitude_error,
        )  # fmt: skip
    if of_modes is None and of_frf is None:
        msg = "there is nothing to update to; give frequency, modes or frf"
        raise ModelError(msg)
    unknowns = scaled_unknowns(model, parameters)
    wanted = of_frf is not None if damping is None else damping is not False
    if of_frf is not None and wanted:
        given = None if isinstance(damping, bool) else damping
        knots = damping_knots(model, of_frf, given)
        unknowns = (*unknowns, *damping_ratios(model, knots))
    else:
        knots = None
    if not unknowns:
        msg = "there is no parameter to update"
        raise ModelError(msg)
    result = _released(_Problem(model, unknowns, of_modes, of_frf, knots, settings))
    if of_frf is None and wanted and of_modes is not None and of_modes.zeta is not None:
        d = model.damping
        omega = 2 * np.pi * of_modes.frequency
        other = (d.alpha / omega + d.beta * omega + d.loss_factor) / 2
        ratio = np.maximum(of_modes.zeta - other, 0.0)
        result = replace(result, model=with_ratios(result.model, of_modes.frequency, ratio))
    return result


def _mode_data(
    model: Model,
    frequency: ArrayLike | None,
    shapes: ArrayLike | None,
    modes: Modes | IdentifiedModes | ModeData | None,
    outputs: Places | None,
    numbers: Sequence[int] | None,
    frequency_std: ArrayLike,
    shape_std: ArrayLike,
    model_error: float,
) -> ModeData | None:
    if isinstance(modes, ModeData):
        return modes
    if isinstance(modes, IdentifiedModes):
        (frequency_std, shape_std), modes = modes.relative_std(), modes.modes
    if modes is None and frequency is None:
        return None
    if modes is not None and outputs is None:
        modes = replace(modes, shapes=modes.shapes[:0])
    elif shapes is not None and outputs is None:
        msg = "shapes need the places where they were measured: outputs=…"
        raise ModelError(msg)
    return mode_data(
        model, frequency, shapes, modes=modes, outputs=() if outputs is None else outputs, numbers=numbers,
        frequency_std=frequency_std, shape_std=shape_std, model_error=model_error,
    )  # fmt: skip


# ----------------------------------------------------------------------------------------------- problem


@dataclass(frozen=True, slots=True, eq=False)
class _Group:
    """Residuals of one kind: real, whitened; with the weights of the robust loss in them."""

    name: str
    r: NDArray[np.float64]
    cost: float  # Σρ/σ²
    n: int
    J: NDArray[np.float64] | None  # (n_unknown, m)

    @property
    def q(self) -> float:
        return self.cost / self.n

    @property
    def merit(self) -> float:
        q = self.q
        return 0.5 * self.n * (q - 1 if q < 1 else float(np.log(q)))

    @property
    def factor(self) -> float:
        """Derivative of the merit by half the cost."""
        return 1 / max(self.q, 1.0)


@dataclass(frozen=True, slots=True, eq=False)
class _State:
    x: NDArray[np.float64]
    merit: float
    groups: tuple[_Group, ...]
    point: ModePoint | None
    errors: tuple[float, float, float]  # frequency, MAC, dB


@dataclass(frozen=True, slots=True, eq=False)
class _Problem:
    model: Model
    unknowns: tuple[Scaled, ...]
    modes: ModeData | None
    frf: FRFData | None
    knots: NDArray[np.float64] | None
    settings: Settings
    shift_knots: NDArray[np.float64] | None = None
    n_gains: int = 0
    residual: FRFResidual | None = None
    stage: str = "modes"
    before: ModePairs | None = None
    near: System | None = None  # matrices of the last point
    fixed: tuple[tuple[int, float], ...] = ()  # unknowns that selection left out, at their start
    precision: NDArray[np.float64] | None = None  # λ² LᵀL about the start
    curve: LCurve | None = field(default=None)

    @property
    def start(self) -> NDArray[np.float64]:
        return np.array([u.start for u in self.unknowns])

    @property
    def refs(self) -> tuple[ParameterRef, ...]:
        return tuple(ref for u in self.unknowns for ref in u.refs)

    @property
    def limits(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        low, high = np.array([u.low for u in self.unknowns]), np.array([u.high for u in self.unknowns])
        for i, x in self.fixed:
            low[i] = high[i] = x
        return low, high

    @property
    def frozen(self) -> NDArray[np.bool_]:
        out = np.zeros(len(self.unknowns), dtype=bool)
        out[[i for i, _ in self.fixed]] = True
        return out

    def values(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values of ``refs``."""
        parts = [u.moved(xi) for u, xi in zip(self.unknowns, x, strict=True) if u.refs]
        return np.concatenate(parts) if parts else np.zeros(0)

    @property
    def parts(self) -> tuple[slice, slice, slice, slice]:
        """Where parameters, damping ratios, shifts and gains are among the unknowns."""
        n = sum(1 for u in self.unknowns if u.refs)
        edges = np.cumsum(
            [
                n,
                0 if self.knots is None else len(self.knots),
                0 if self.shift_knots is None else 1 + len(self.shift_knots),
                self.n_gains,
            ]
        ).tolist()
        return slice(0, n), slice(n, edges[1]), slice(edges[1], edges[2]), slice(edges[2], edges[3])

    def ratios(self, x: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Damping ratios at the knots."""
        return None if self.knots is None else np.exp(x[self.parts[1]])

    def with_nuisances(self, x: NDArray[np.float64]) -> tuple["_Problem", NDArray[np.float64]]:
        """Return the problem with the model's own errors as unknowns, and x with zeros for them."""
        if self.residual is None or self.frf is None:
            return self, x
        knots = self.residual.seen()
        if knots.size > _MOST_SHIFTS:
            knots = np.quantile(knots, np.linspace(0, 1, _MOST_SHIFTS))
        knots = np.unique(knots)
        has_shifts = self.frf.model_error > 0 and knots.size > 0
        n_places = self.frf.outputs.shape[1] + self.frf.inputs.shape[1]
        n_gains = n_places if self.frf.amplitude_error > 0 else 0
        more = nuisances_of(knots if has_shifts else knots[:0], self.frf)
        problem = replace(
            self, unknowns=(*self.unknowns, *more), shift_knots=knots if has_shifts else None, n_gains=n_gains
        )
        return problem, np.concatenate([x, np.zeros(len(more))])

    def model_at(self, x: NDArray[np.float64]) -> Model:
        model = self.model.with_values(dict(zip(self.refs, self.values(x).tolist(), strict=True)))
        ratios = self.ratios(x)
        if ratios is not None and self.knots is not None:
            model = with_ratios(model, self.knots, ratios)
        return model

    def based(self, x: NDArray[np.float64], part: float, n_lines: int, exact: bool = False) -> "_Problem":
        """Return the problem with the FRFs up to a part of the highest frequency, on a basis made at x."""
        if self.frf is None:
            return self
        top = self.frf.frequency[-1] * part
        lines = self.frf.lines(top, n_lines)
        if not lines.mask.any():
            lines = self.frf.lines(np.inf, n_lines)
        residual = FRFResidual(lines, self.model_at(x), self.refs, self.knots, self.shift_knots, exact=exact)
        return replace(self, residual=residual, stage=f"to {lines.frequency[-1]:.4g} Hz")

    def chain(self, x: NDArray[np.float64], dr: NDArray[Any]) -> NDArray[Any]:
        """Return derivatives by the updated parameters from those by ``refs``."""
        rows: list[NDArray[Any]] = []
        k = 0
        for u, xi in zip(self.unknowns, x, strict=True):
            if u.refs:
                rows.append(u.slopes(xi) @ dr[k : k + len(u.refs)])
                k += len(u.refs)
        return np.array(rows).reshape(len(rows), dr.shape[1])

    def state(self, x: NDArray[np.float64], gradient: bool, known: ModePoint | None = None) -> _State:
        """Evaluate residuals, and derivatives if asked for."""
        groups: list[_Group] = []
        point, errors = None, [np.nan, np.nan, np.nan]
        if self.modes is not None:
            model = self.model.with_values(dict(zip(self.refs, self.values(x).tolist(), strict=True)))
            point = known if known is not None else mode_residual(self.modes, model, self.before, self.near)
            J = None
            if gradient:
                J = np.zeros((len(x), point.r.size))
                J[self.parts[0]] = self.chain(x, mode_jacobian(self.modes, point, self.refs))
            groups.append(_Group("modes", point.r, float(point.r @ point.r), self.modes.n_data, J))
            ok = point.pairs.partner >= 0
            if ok.any():
                ratio = point.pairs.computed[ok] / self.modes.frequency[ok] - 1
                errors[0] = float(np.sqrt((ratio**2).mean()))
                errors[1] = float(point.pairs.mac[ok].mean())
        if self.residual is not None:
            of_shifts, of_gains = self.parts[2:]
            ratios = self.ratios(x)
            terms = self.residual.evaluate(
                self.values(x), gradient, ratios=ratios,
                shifts=None if self.shift_knots is None else x[of_shifts][0] + x[of_shifts][1:],
                gains=x[of_gains] if self.n_gains else None,
            )  # fmt: skip
            r, w = terms.r, terms.weight
            cost = float((w**2 * pseudo_huber(r, _ROBUST)).sum())
            w = w * np.sqrt(pseudo_huber_weight(r, _ROBUST))
            J = None
            if gradient and terms.by_values is not None:
                rows = [self.chain(x, terms.by_values)]
                if ratios is not None and terms.by_ratios is not None:
                    rows.append(ratios[:, None] * terms.by_ratios)
                if terms.by_shifts is not None:
                    rows += [terms.by_shifts.sum(axis=0, keepdims=True), terms.by_shifts]
                if terms.by_gains is not None:
                    rows.append(terms.by_gains)
                full = np.vstack(rows) * w
                J = np.hstack([full.real, full.imag])
            flat = np.concatenate([w * r.real, w * r.imag])
            groups.append(_Group("frf", flat, cost, self.residual.n_data, J))
            errors[2] = float(np.sqrt((r.real**2).mean()) * DB_PER_NEPER)
        return _State(
            x,
            self.prior(x) + sum(g.merit for g in groups),
            tuple(groups),
            point,
            (errors[0], errors[1], errors[2]),
        )

    def prior(self, x: NDArray[np.float64]) -> float:
        out = 0.5 * sum(
            ((xi - u.mean) / u.std) ** 2 for u, xi in zip(self.unknowns, x, strict=True) if np.isfinite(u.std)
        )
        if self.precision is not None:
            d = x - self.start
            out += 0.5 * float(d @ self.precision @ d)
        return float(out)

    def normal(self, state: _State) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return Gauss and Newton's matrix of the merit, and its gradient."""
        weight = np.array([1 / u.std**2 if np.isfinite(u.std) else 0.0 for u in self.unknowns])
        A = np.diag(weight)
        g = weight * (state.x - np.array([u.mean for u in self.unknowns]))
        if self.precision is not None:
            A = A + self.precision
            g = g + self.precision @ (state.x - self.start)
        for group in state.groups:
            assert group.J is not None
            A = A + group.factor * (group.J @ group.J.T)
            g = g + group.factor * (group.J @ group.r)
        return A, g

    def reduced(self, state: _State, stated: bool) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the linearised problem A d ≈ -r of the parameters: what else is unknown is projected out.

        Parameters
        ----------
        state : _State
        stated : bool
            Whether residuals count by the stated variance, or by the present misfit where that is larger.
        """
        factor = [1.0 if stated else np.sqrt(g.factor) for g in state.groups]
        B = np.vstack([f * g.J.T for f, g in zip(factor, state.groups, strict=True) if g.J is not None])
        r = np.concatenate([f * g.r for f, g in zip(factor, state.groups, strict=True)])
        n = self.parts[0].stop
        others = self.unknowns[n:]
        if others:
            know = np.array([1 / u.std for u in others])
            offset = know * (state.x[n:] - np.array([u.mean for u in others]))
            Q = np.linalg.qr(np.vstack([B[:, n:], np.diag(know)]))[0]
            A = np.vstack([B[:, :n], np.zeros((len(others), n))])
            r = np.concatenate([r, offset])
            return A - Q @ (Q.T @ A), r - Q @ (Q.T @ r)
        return B, r

    def step_of(self, state: _State) -> UpdateStep:
        n = self.parts[1].stop
        values = np.array([u.value_of(xi) for u, xi in zip(self.unknowns[:n], state.x[:n], strict=True)])
        lost = () if state.point is None else state.point.pairs.lost
        return UpdateStep(self.stage, values, state.merit, *state.errors, lost)


def _try(problem: _Problem, x: NDArray[np.float64]) -> _State | None:
    """Evaluate a trial; None where the model there has no modes or no finite response."""
    try:
        state = problem.state(x, False)
    except (ModelError, FRFError, np.linalg.LinAlgError):
        return None
    return state if np.isfinite(state.merit) else None


def _descend(
    problem: _Problem,
    x: NDArray[np.float64],
    enough: float,
    max_iterations: int,
    report: Callable[[UpdateStep], None],
) -> tuple[_State, Ending, _Problem]:
    """Take Levenberg-Marquardt steps within bounds until they are small beside the standard deviations."""
    low, high = problem.limits
    state = problem.state(np.clip(x, low, high), True)
    damping = 1e-5
    width = np.array([u.width for u in problem.unknowns])
    for _ in range(max_iterations):
        if state.point is not None:  # modes are followed from here; merits are compared with the same ties
            problem = replace(problem, before=state.point.pairs, near=state.point.system)
        A, g = problem.normal(state)
        pinned = ((state.x <= low) & (g > 0)) | ((state.x >= high) & (g < 0)) | problem.frozen
        free = ~pinned & (np.diag(A) > 0)
        if not free.any():
            return state, Ending.AT_BOUNDS if pinned.any() else Ending.STUCK, problem
        B = held(A[np.ix_(free, free)], width[free])
        scale = np.sqrt(np.diag(B))
        H = B / np.outer(scale, scale)
        gs = g[free] / scale
        accepted: _State | None = None
        gain = 0.0
        for attempt in range(12):
            step = np.zeros(len(state.x))
            step[free] = -np.linalg.solve(H + damping * np.eye(len(H)), gs) / scale
            if attempt == 0:
                gain = 0.5 * float(gs @ np.linalg.lstsq(H, gs, rcond=1e-12)[0])
                if gain < enough:
                    return state, Ending.CONVERGED, problem
            longest = np.abs(step).max()
            if longest > _LONGEST:
                step *= _LONGEST / longest
            trial = _try(problem, np.clip(state.x + step, low, high))
            if trial is not None and trial.merit < state.merit:
                accepted = trial
                break
            damping = min(max(damping, 1e-6) * 6, 1e8)
        if accepted is None:
            ending = Ending.CONVERGED if gain < max(100 * enough, 1e-3) else Ending.STUCK
            return state, ending, problem
        state = problem.state(accepted.x, True, accepted.point)
        damping = damping / 8 if damping > 1e-9 else 0.0
        report(problem.step_of(state))
    return state, Ending.OUT_OF_ITERATIONS, problem


def _run(problem: _Problem) -> Updated:
    settings = problem.settings
    path: list[UpdateStep] = []
    starts: list[tuple[NDArray[np.float64], float]] = []
    x = problem.start
    last = 4 * settings.n_lines
    stages = settings.stages if problem.frf is not None else (1.0,)
    try:
        first = problem.based(x, 1.0, last)
        state = first.state(x, True)
        failed = None if np.isfinite(state.merit) else Ending.NOT_FINITE
    except FRFError:
        failed, state, first = Ending.NOT_FINITE, None, problem
    if failed is None and state is not None and state.point is not None and problem.frf is None:
        failed = Ending.NO_PARTNERS if (state.point.pairs.partner < 0).all() else None
    if state is not None:
        path.append(first.step_of(state))
    if failed is not None and not (failed is Ending.NO_PARTNERS and settings.n_starts > 1):
        return _result(first, state, tuple(path), (), (), failed)
    assert state is not None
    problem, left_out = _selected(problem, first, x)
    if settings.n_starts > 1:
        x, starts = _best_start(problem, stages)
    ending, staged = Ending.CONVERGED, first
    for k, part in enumerate(stages):
        final = k == len(stages) - 1
        staged = problem.based(x, part, last if final else settings.n_lines)
        if final and problem.frf is not None:
            problem, x = staged.with_nuisances(x)
            staged = problem.based(x, part, last)
        enough = _ENOUGH if final and problem.frf is None else 1e-2
        if final and settings.regularisation:
            problem, staged = _regularised(problem, staged, x)
        state, ending, staged = _descend(staged, x, enough, settings.max_iterations, path.append)
        x = state.x
        problem = replace(problem, before=staged.before, near=staged.near)
    if problem.frf is not None:
        steps: list[UpdateStep] = []
        state, ending, staged = _rebased(problem, x, False, steps)
        if _misfit_of_frf(state) > _EXPLAINED:
            # between resonances the model's damping and the engine's differ: which of them do the data have?
            more: list[UpdateStep] = []
            own = _rebased(problem, state.x, True, more)
            if _misfit_of_frf(own[0]) < _BETTER * _misfit_of_frf(state):
                (state, ending, staged), steps = own, steps + more
        path += steps
        x = state.x
        problem = replace(problem, before=staged.before, near=staged.near)
    if settings.regularisation:
        problem, staged = _regularised(problem, staged, x)
        state, ending, staged = _descend(staged, x, _ENOUGH, settings.max_iterations, path.append)
    (state, ending, staged), said = _no_worse(problem, (state, ending, staged), path)
    done = _result(staged, state, tuple(path), tuple(starts), left_out, ending)
    return replace(done, messages=(*said, *done.messages)) if said else done


Fitted = tuple[_State, Ending, _Problem]


def _no_worse(problem: _Problem, found: Fitted, path: list[UpdateStep]) -> tuple[Fitted, tuple[str, ...]]:
    """Return a fit that is no worse than the model it began with, with or without the effects in question.

    Stages, starts and far minima may lead away from a start that was better in the whole band. Where one of
    these simple models beats what was found, the fit goes on from there.
    """
    began, names = len(path), [u.name for u in problem.unknowns]
    simple: list[tuple[str, NDArray[np.float64]]] = [("the start", _filled(problem, problem.start))]
    absent = np.array([u.absent for u in problem.unknowns])
    gone = np.isfinite(absent) & ~problem.frozen & (absent != problem.start[: len(absent)])
    if gone.any():
        what = f"the model with {', '.join(n for n, g in zip(names, gone, strict=True) if g)} absent"
        for x in (problem.start, found[0].x):
            simple.append((what, np.where(gone, absent, x)))
    said: tuple[str, ...] = ()
    for what, x in simple:
        staged = problem.based(x, 1.0, 4 * problem.settings.n_lines)
        at = _try(replace(staged, before=None, near=None), x)
        if at is None or not at.merit < found[0].merit - BETTER_NATS:
            continue
        try:
            if problem.frf is None:
                again = _descend(
                    replace(staged, before=None), x, _ENOUGH, problem.settings.max_iterations, path.append
                )
            else:
                again = _rebased(replace(problem, before=None), x, False, path)
        except (ModelError, FRFError, np.linalg.LinAlgError):
            continue
        if again[0].merit < found[0].merit:
            found = again
            said = (f"the fit ended worse than {what}, and was repeated from there",)
    if said and len(path) == began:
        said = (f"{said[0]}; no step lowered the misfit",)
    return found, said


def _filled(problem: _Problem, x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return x with zeros for the model's own errors where they are unknown too."""
    return np.concatenate([x, np.zeros(len(problem.unknowns) - len(x))])


def _rebased(
    problem: _Problem, x: NDArray[np.float64], own_damping: bool, steps: list[UpdateStep]
) -> tuple[_State, Ending, _Problem]:
    """Fit all FRFs on bases made at the new values, until these move by less than a tenth of a deviation."""
    settings = problem.settings
    count = 0
    while True:
        staged = problem.based(x, 1.0, 4 * settings.n_lines, own_damping)
        state, ending, staged = _descend(staged, x, _ENOUGH, settings.max_iterations, steps.append)
        problem = replace(problem, before=staged.before, near=staged.near)
        moved = state.x - x
        x = state.x
        count += 1
        if count == _REBASES or float(moved @ staged.normal(state)[0] @ moved) < 0.01:
            return state, ending, staged


def _misfit_of_frf(state: _State) -> float:
    return next(g.q for g in state.groups if g.name == "frf")


def _released(base: _Problem) -> Updated:
    """Run; where the data contradict a prior beyond doubt, let it go and run again from the value found.

    A wrong prior pulls at all that is correlated with its parameter, which ends wrong with it. The worst goes
    first, as it may be what moved the others.
    """
    problem, result, kept = base, _run(base), ""
    gone: dict[int, str] = {}
    for _ in range(_MOST_RELEASED):
        away = np.nan_to_num([p.from_prior for p in result.parameters])
        worst = int(np.argmax(away)) if away.size else 0
        if not away.size or not away[worst] > base.settings.contradicted:
            break
        p, u = result.parameters[worst], problem.unknowns[worst]
        begin = float(np.clip(u.x_of(p.value), u.low, u.high))
        free = replace(u, start=begin, std=np.inf, width=WIDTH)
        trial = replace(
            problem, unknowns=tuple(free if k == worst else o for k, o in enumerate(problem.unknowns))
        )
        again = _run(trial)
        if again.ending in _FAILED or sum(again.misfit.values()) > _WORSE * sum(result.misfit.values()):
            kept = (
                f"the data contradict the prior of {p.name} by {away[worst]:.0f} of its standard deviations, "
                "but the fit fails without it; the prior was kept"
            )
            break
        gone[worst] = f"{p.name} by {away[worst]:.0f}"
        problem = trial
        path = (*result.path, *(replace(s, stage=f"again {s.stage}") for s in again.path))
        result = replace(again, path=path)
    if not gone:
        return replace(result, messages=(*result.messages, kept)) if kept else result
    first = _starts_of(base)
    parameters = tuple(
        replace(
            p, start=first[k], released=k in gone,
            from_prior=abs(base.unknowns[k].x_of(p.value) - base.unknowns[k].mean) / base.unknowns[k].std
            if k in gone
            else p.from_prior,
        )
        for k, p in enumerate(result.parameters)
    )  # fmt: skip
    said = (
        f"the data contradict priors, in standard deviations: {', '.join(gone.values())}. They were dropped "
        "and the fit was repeated. If a value is impossible, the model lacks an effect there: search for it "
        "with dovetail run"
    )
    messages = (said, *([kept] if kept else []), *result.messages)
    return replace(result, parameters=parameters, messages=messages)


def _starts_of(problem: _Problem) -> list[float]:
    return [u.value_of(u.start) for u in problem.unknowns]


def _best_start(
    problem: _Problem, stages: Sequence[float]
) -> tuple[NDArray[np.float64], list[tuple[NDArray[np.float64], float]]]:
    """Run from several starts on fewer lines; return the point with the lowest merit."""
    settings = problem.settings
    random = np.random.default_rng(settings.seed)
    low, high = problem.limits
    width = np.array([min(u.width, 0.5) for u in problem.unknowns])
    compare = problem.based(problem.start, 1.0, settings.n_lines)
    A = compare.normal(compare.state(problem.start, True))[0]
    # what no data tell stays where it is
    width[taking_part(blind_directions(A, np.array([u.width for u in problem.unknowns])))] = 0.0
    low_x, high_x = np.maximum(low, problem.start - 3 * width), np.minimum(high, problem.start + 3 * width)
    found: list[tuple[NDArray[np.float64], float]] = []
    begin = [problem.start]
    begin += [
        np.clip(problem.start + width * random.standard_normal(len(width)), low_x, high_x)
        for _ in range(settings.n_starts - 1)
    ]
    for x in begin:
        try:
            for part in (*stages, 1.0, 1.0):  # a basis made far away misleads
                staged = problem.based(x, part, max(60, settings.n_lines // 3))
                x = _descend(staged, x, 0.1, settings.max_iterations, lambda step: None)[0].x
            merit = replace(compare, residual=problem.based(x, 1.0, settings.n_lines).residual).state(
                x, False
            )
            found.append((x, merit.merit))
        except (ModelError, FRFError, np.linalg.LinAlgError):
            continue
    if not found:
        return problem.start, []
    best = min(found, key=lambda one: one[1])[0]
    values = [
        (np.array([u.value_of(xi) for u, xi in zip(problem.unknowns, x, strict=True)]), merit)
        for x, merit in found
    ]
    return best, values


def _selected(
    problem: _Problem, staged: _Problem, x: NDArray[np.float64]
) -> tuple[_Problem, tuple[tuple[str, str], ...]]:
    """Hold the parameters that selection leaves out at their start; the model's own errors count as noise."""
    how = problem.settings.select
    if not how:
        return problem, ()
    staged, extended = staged.with_nuisances(x)
    staged = staged.based(extended, 1.0, problem.settings.n_lines)
    A, r = staged.reduced(staged.state(extended, True), True)
    A = A * np.array([u.width for u in problem.unknowns[: A.shape[1]]])
    names = [u.name for u in problem.unknowns[: A.shape[1]]]
    pivoting = how == "pivoting"
    chosen = select_by_pivoting(A, names) if pivoting else select_forward(A, -r, names)
    if not chosen.kept:
        return problem, ()
    fixed = tuple((one.index, problem.unknowns[one.index].start) for one in chosen.left_out)
    reasons = tuple((names[one.index], one.reason) for one in chosen.left_out)
    return replace(problem, fixed=fixed), reasons


def _regularised(problem: _Problem, staged: _Problem, x: NDArray[np.float64]) -> tuple[_Problem, _Problem]:
    """Weigh distances from the start by the λ at the L-curve's corner of the problem linearised at x."""
    state = staged.state(x, True)
    B, r = staged.reduced(state, False)
    n = B.shape[1]
    L = np.diag([1 / u.width for u in problem.unknowns[:n]])
    if problem.settings.regularisation == "gsvd":
        L = np.array(problem.settings.operator, dtype=float, ndmin=2)
    if L.shape[1] != n:
        names = ", ".join(u.name for u in problem.unknowns[:n])
        msg = f"the operator has {L.shape[1]} columns; there are {n} parameters: {names}"
        raise ModelError(msg)
    curve = l_curve(B, B @ (x - problem.start)[:n] - r, L)
    precision = np.zeros((len(x), len(x)))
    precision[:n, :n] = curve.chosen**2 * (L.T @ L)
    return replace(problem, precision=precision, curve=curve), replace(
        staged, precision=precision, curve=curve
    )


# ------------------------------------------------------------------------------------------------ result


def _result(
    problem: _Problem,
    state: _State | None,
    path: tuple[UpdateStep, ...],
    starts: tuple[tuple[NDArray[np.float64], float], ...],
    left_out: tuple[tuple[str, str], ...],
    ending: Ending,
) -> Updated:
    x = problem.start if state is None else state.x
    A = np.zeros((len(x), len(x))) if state is None else problem.normal(state)[0]
    low, high = problem.limits
    edge = 1e-9 * np.array([u.width for u in problem.unknowns])
    bound = ~problem.frozen & ((x <= low + edge) | (x >= high - edge))
    widths = np.array([u.width for u in problem.unknowns])
    all_covariance, blind = split_covariance(A, widths, problem.frozen | bound)
    lost = taking_part(blind)
    of_shifts, of_gains = problem.parts[2:]
    n = problem.parts[1].stop
    unknowns, frozen = problem.unknowns[:n], problem.frozen[:n]
    covariance = all_covariance[:n, :n]
    all_std = np.sqrt(np.maximum(np.diag(all_covariance), 0.0))
    std_x = np.where(lost, np.inf, np.where(bound, np.nan, all_std))[:n]
    slope = np.array([u.slope(xi) for u, xi in zip(unknowns, x[:n], strict=True)])
    known = (covariance.diagonal() > 0) & ~lost[:n]
    size = np.where(known, np.sqrt(np.maximum(covariance.diagonal(), 0.0)), 1.0)
    correlation = np.where(np.outer(known, known), covariance, 0.0) / np.outer(size, size)
    np.fill_diagonal(correlation, 1.0)
    done = []
    for i, u in enumerate(unknowns):
        value = u.value_of(x[i])
        relative = std_x[i] if u.log else std_x[i] * u.scale / max(abs(value), WIDTH * u.scale)
        known = std_x[i] < SAID * u.std if np.isfinite(u.std) else relative < DETERMINED
        done.append(
            UpdatedParameter(
                name=u.name,
                unit=u.unit,
                refs=u.refs,
                start=u.value_of(u.start),
                lower=u.value_of(u.low),
                upper=u.value_of(u.high),
                prior_std=u.prior_std,
                value=value,
                std=float(slope[i] * std_x[i]),
                log=u.log,
                at_bound=bool(bound[i]),
                determined=bool(known and not frozen[i]),
                from_prior=float(abs(x[i] - u.mean) / u.std) if u.refs and np.isfinite(u.std) else np.nan,
            )
        )
    misfit = {} if state is None else {g.name: g.q for g in state.groups}
    pairs = None if state is None or state.point is None else state.point.pairs
    alone = (blind**2).sum(axis=1) > 1 - SHARE
    asked = [i for i in range(len(done)) if done[i].refs and not frozen[i]]
    moved = np.abs(x - np.array([u.start for u in problem.unknowns])) > 1e-6 * widths
    if state is not None and asked and (alone & ~moved)[asked].all():
        ending = Ending.NOTHING_DETERMINED
    messages = _messages(problem, tuple(done), correlation, frozen, misfit, pairs, ending)
    if state is not None:
        names = [u.name for u in problem.unknowns]
        messages = (
            *messages,
            *blind_words(blind, names, _measured_words(problem), moved),
            *_unmoved(problem, state),
        )
    samples = None
    if problem.settings.n_samples and state is not None and ending is not Ending.NOT_FINITE:
        samples = _samples(problem, state, all_covariance, lost | bound)
    knots = np.zeros(0) if problem.shift_knots is None else problem.shift_knots
    return Updated(
        model=problem.model_at(x),
        parameters=tuple(done),
        correlation=correlation,
        covariance=covariance * np.outer(slope, slope),
        path=path,
        misfit=misfit,
        pairs=pairs,
        frequency=np.zeros(0) if problem.modes is None else problem.modes.frequency,
        shifts=_shifts(knots, x[of_shifts], all_covariance[of_shifts, of_shifts]),
        gains=np.stack([np.exp(x[of_gains]), all_std[of_gains]], axis=1),
        left_out=left_out,
        curve=problem.curve,
        samples=samples,
        starts=starts,
        ending=ending,
        messages=messages,
    )


def _shifts(
    knots: NDArray[np.float64], x: NDArray[np.float64], covariance: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return frequency, common and own shift together, and its standard deviation, (k, 3)."""
    if not knots.size:
        return np.zeros((0, 3))
    sums = np.hstack([np.ones((len(knots), 1)), np.eye(len(knots))])
    std = np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", sums, covariance, sums), 0.0))
    return np.stack([knots, sums @ x, std], axis=1)


def _messages(
    problem: _Problem,
    done: tuple[UpdatedParameter, ...],
    correlation: NDArray[np.float64],
    frozen: NDArray[np.bool_],
    misfit: Mapping[str, float],
    pairs: ModePairs | None,
    ending: Ending,
) -> tuple[str, ...]:
    out = []
    if ending is not Ending.CONVERGED:
        out.append(f"{ending.value[0]}: {ending.cause}; {ending.remedy}")
    at = [p.name for p in done if p.at_bound]
    if at:
        out.append(f"at a bound: {', '.join(at)}; they may stand in for an effect that the model lacks")
    away = [(p.name, p.from_prior) for p in done if np.isfinite(p.from_prior)]
    far = ", ".join(f"{name} by {z:.0f}" for name, z in away if z > AGAINST)
    if far:
        out.append(
            f"values far from their priors, in standard deviations: {far}. Priors that are wrong bias every "
            "correlated parameter: widen them, or look for an effect that the model lacks"
        )
    loose = [
        p.name
        for p, f in zip(done, frozen, strict=True)
        if not p.determined
        and not f
        and not p.at_bound
        and np.isfinite(p.std)
        and dict(away).get(p.name, 0.0) <= AGAINST
    ]
    if loose:
        out.append(
            f"the data do not determine {', '.join(loose)}: their values are those of the start or the prior"
        )
    pairs_of = [
        f"{done[i].name} with {done[j].name} ({correlation[i, j]:+.3f})"
        for i in range(len(done))
        for j in range(i)
        if abs(correlation[i, j]) > CORRELATED and done[i].refs and not (frozen[i] or frozen[j])
    ]
    if pairs_of:
        out.append(f"correlated, so that only a combination is well known: {'; '.join(pairs_of[:8])}")
    for name, q in misfit.items():
        if q > 2:
            what = "modes" if name == "modes" else "FRFs"
            out.append(
                f"the model misses the {what} by {np.sqrt(q):.1f} times the stated noise and model error. "
                "Standard deviations are widened by it, but the model lacks an effect or is wrong, or the "
                "start was too far off (try more starts)"
            )
    if pairs is not None and problem.modes is not None and pairs.lost:
        words = ", ".join(f"{problem.modes.frequency[i]:.4g} Hz" for i in pairs.lost)
        out.append(f"measured modes without a partner in the model: {words}")
    if problem.curve is not None and not problem.curve.distinct:
        out.append("the L-curve has no distinct corner: the regularisation weight is arbitrary")
    return tuple(out)


def _measured_words(problem: _Problem) -> str:
    """Return what was measured, in the singular."""
    parts = []
    if problem.modes is not None:
        parts.append("measured mode")
    if problem.frf is not None:
        parts.append("measured FRF")
    return " or ".join(parts)


def _unmoved(problem: _Problem, state: _State) -> list[str]:
    """Name the measured modes that no parameter moves and the model misses."""
    data, point = problem.modes, state.point
    if data is None or point is None or problem.frf is not None or state.groups[0].J is None:
        return []
    n, ok = len(data.frequency), point.pairs.partner >= 0
    width = np.array([u.width for u in problem.unknowns])[problem.parts[0]]
    J = state.groups[0].J[problem.parts[0], :n] * width[:, None]
    std = np.sqrt(np.diag(data.covariance))
    by_log = np.abs(np.linalg.solve(data.whitening(ok), J.T)).max(axis=1, initial=0.0)  # of ln f
    if data.shapes is not None:
        rest = state.groups[0].J[problem.parts[0], n:].reshape(len(width), n, -1) * width[:, None, None]
        by_log = np.maximum(by_log, std * np.abs(rest).max(axis=(0, 2), initial=0.0))
    off = np.where(ok, point.pairs.computed / data.frequency - 1, 0.0)
    still = np.flatnonzero(ok & (by_log < SEEN * std) & (np.abs(off) > 2 * std))
    if not still.size:
        return []
    some = ", ".join(f"{data.frequency[i]:.4g} Hz ({100 * off[i]:+.2g} %)" for i in still[:6])
    more = f", and {still.size - 6} more" if still.size > 6 else ""
    return [
        f"no parameter moves the modes paired with {some}{more}: check that measured and computed modes are "
        "the same ones, by giving shapes or mode numbers"
    ]


def _samples(
    problem: _Problem, state: _State, covariance: NDArray[np.float64], kept: NDArray[np.bool_]
) -> Samples:
    low, high = problem.limits
    free = ~problem.frozen & ~kept
    if not free.any():
        msg = "there is nothing to sample: the data determine none of the unknowns"
        raise ModelError(msg)
    weights = {g.name: g.factor for g in state.groups}
    problem = replace(problem, before=None if state.point is None else state.point.pairs)

    def log_probability(part: NDArray[np.float64]) -> float:
        x = state.x.copy()
        x[free] = part
        if ((x < low) | (x > high)).any():
            return -np.inf
        trial = _try(problem, x)
        if trial is None:
            return -np.inf
        return -problem.prior(x) - 0.5 * sum(weights[g.name] * g.cost for g in trial.groups)

    drawn = sample(
        log_probability, state.x[free], covariance[np.ix_(free, free)], problem.settings.n_samples,
        seed=problem.settings.seed,
    )  # fmt: skip
    x = np.tile(state.x, (len(drawn.values), 1))
    x[:, free] = drawn.values
    x = x[:, : problem.parts[1].stop]
    values = np.stack(
        [
            np.exp(column) if u.log else column * u.scale
            for u, column in zip(problem.unknowns[: x.shape[1]], x.T, strict=True)
        ],
        axis=1,
    )
    return replace(drawn, values=values)
