"""Update a model's parameters to measured modes and FRFs, with their uncertainty.

    updated = update(model, [("frame", "E:steel")], frequency=[43.2, 118.9])
    updated = update(model, parameters, frf=H, lines=f, outputs=places, inputs=places[:1])
    print(updated.table())

An update is the most probable model with nothing added (:mod:`updating.inference.fitting`): the likelihood,
the form of the frame and the deviations are those of every fit and diagnosis. `docs/updating.md` says how and
when to doubt it.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from fem.analysis.frf import FRF, FRFKind
from fem.analysis.modes import Modes
from fem.array_types import Floats
from fem.linalg.solvers import one_thread
from fem.model import Model, ModelError
from updating.inference.arrays import Places, frf_data, mode_data
from updating.inference.defaults import EXPLAINED_LEVEL
from updating.inference.determined import blind_directions, taking_part
from updating.inference.fit_function import FitFunction
from updating.inference.fit_result import FitResult
from updating.inference.fitting import (
    QUICK_LINES,
    QUICK_NATS,
    far_fit,
    fit,
    fit_given,
    null_fit,
    with_evidence,
    with_form_of_damping,
)
from updating.inference.form import with_form
from updating.inference.formed import formed_mode_problem, formed_problem
from updating.inference.linearised import stated_quadratic, whitened
from updating.inference.mode_targets import ModeTargets
from updating.inference.problem import Problem
from updating.inference.regularisation import LCurve, l_curve, select_by_pivoting, select_forward
from updating.inference.solve import Report, Solution
from updating.inference.unknowns import (
    Parameters,
    ScaledUnknown,
    Unknown,
    checked_unknowns,
    nuisance_unknowns,
)
from updating.inference.update_result import Ended, result_of, rows_of, values_of
from updating.inference.update_settings import UpdateSettings
from updating.inference.updated import Updated, UpdateStep
from updating.measurement.measurement import Measurement, with_resting_base
from updating.modal.identified_modes import IdentifiedModes


@one_thread()
def update(
    model: Model,
    parameters: Parameters,
    *,
    frequency: ArrayLike | None = None,
    shapes: ArrayLike | None = None,
    modes: Modes | IdentifiedModes | ModeTargets | None = None,
    frf: FRF | Measurement | ArrayLike | None = None,
    lines: ArrayLike | None = None,
    outputs: Places | None = None,
    inputs: Places | None = None,
    kind: FRFKind | str = FRFKind.ACCELERANCE,
    band: tuple[float, float] | None = None,
    numbers: Sequence[int] | None = None,
    frequency_std: ArrayLike = 1e-3,
    shape_std: ArrayLike = 0.03,
    noise: ArrayLike | None = None,
    damping_std: float = 0.5,
    model_error: float = EXPLAINED_LEVEL,
    settings: UpdateSettings | None = None,
) -> Updated:
    """Update parameters of a model to measured natural frequencies, shapes, FRFs, or all of them at once.

    The form of the frame varies with them unless ``model_error`` is 0, which is textbook updating: the
    parameters alone, and noise as stated. Damping is fitted in any case.

    Parameters
    ----------
    model : Model
        At the values to start from.
    parameters : sequence of (effect, parameter) or Unknown, or mapping
        Parameters to update; a mapping gives prior standard deviations, relative for positive parameters [-]
        and in their units for others.
    frequency, shapes : array_like (n,), (n_out, n), optional
        Measured natural frequencies without rigid-body modes [Hz], and shapes at the outputs.
    modes : Modes or IdentifiedModes, optional
        Both in one, with damping ratios; labels pick outputs that are given by label. Identified modes bring
        their standard deviations, in place of ``frequency_std`` and ``shape_std``.
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
    damping_std : float
        Standard deviation of the logarithm of the damping ratio; 0 keeps the model's [-].
    model_error : float
        Residual level up to which a model counts as right, because beams are not the structure itself; 0 if
        nothing but noise and the mesh may be left [nepers].
    settings : UpdateSettings, optional

    Returns
    -------
    Updated
        The best point, also where the fit failed; ``ending`` and ``messages`` say so.

    Raises
    ------
    ModelError
        For unknown parameters, data that do not fit one another or the model, or nothing to fit.
    MeasurementError
        For FRFs of too few lines, or of which no value can be compared.
    """
    settings, unknowns = settings or UpdateSettings(), checked_unknowns(model, parameters)
    for what, value in (("damping_std", damping_std), ("model_error", model_error)):
        if not (np.isfinite(value) and value >= 0):
            msg = f"{what} is {value}; it must be finite and not negative"
            raise ModelError(msg)
    targets = _targets(model, frequency, shapes, modes, outputs, numbers, frequency_std, shape_std)
    if targets is None and frf is None:
        msg = "there is nothing to update to; give frequency, modes or frf"
        raise ModelError(msg)
    if not unknowns:
        msg = "there is no parameter to update"
        raise ModelError(msg)
    how = {"damping_std": damping_std, "model_error": model_error}
    if frf is None:
        assert targets is not None
        problem, _ = formed_mode_problem(model, targets, unknowns, **how)
    else:
        data = frf_data(model, frf, lines=lines, outputs=outputs, inputs=inputs, kind=kind, noise=noise)
        problem, _ = formed_problem(model, data, unknowns, band=band, n_lines=settings.n_lines, **how)
        problem = replace(problem, modes=targets)
    done = update_fitted(problem, with_form(model, model_error), unknowns, settings)
    return replace(done, model=with_resting_base(done.model))


def _targets(
    model: Model,
    frequency: ArrayLike | None,
    shapes: ArrayLike | None,
    modes: Modes | IdentifiedModes | ModeTargets | None,
    outputs: Places | None,
    numbers: Sequence[int] | None,
    frequency_std: ArrayLike,
    shape_std: ArrayLike,
) -> ModeTargets | None:
    if isinstance(modes, ModeTargets) or (modes is None and frequency is None):
        return modes
    more = {}
    if isinstance(modes, IdentifiedModes):
        more["zeta_std"] = modes.zeta_std / np.asarray(modes.modes.zeta)
        (frequency_std, shape_std), modes = modes.relative_std(), modes.modes
    if modes is not None and outputs is None:
        modes = replace(modes, shapes=modes.shapes[:0])
    elif shapes is not None and outputs is None:
        msg = "shapes need the places where they were measured: outputs=…"
        raise ModelError(msg)
    return mode_data(
        model,
        frequency,
        shapes,
        modes=modes,
        outputs=() if outputs is None else outputs,
        numbers=numbers,
        frequency_std=frequency_std,
        shape_std=shape_std,
        **more,
    )


# How an update finds the most probable model: which parameters, and from where ------------------------------


P = TypeVar("P", bound=Problem[Any])

_REACH = 3.0
"""Largest distance of further starts, in possible errors of each unknown [-]."""
_WIDEST = 0.5
"""They are drawn with no more than this error [-]."""


def update_fitted(
    problem: Problem[Any], model: Model, unknowns: Sequence[Unknown], settings: UpdateSettings
) -> Updated:
    """Return the most probable model, of whose uncertain parameters some were asked for.

    Parameters
    ----------
    problem : Problem
    model : Model
        The full model that results are values of.
    unknowns : sequence of Unknown
        Uncertain parameters of the problem.
    settings : UpdateSettings
    """
    asked = nuisance_unknowns(problem.reduced.model, unknowns)
    how: dict[str, Any] = {"n_lines": settings.n_lines, "counted_as": settings.n_lines}
    near: list[FitResult] = []
    if problem.with_other_damping() is not None:
        # A first fit tells the form of damping, and the noise.
        problem, first = with_form_of_damping(problem, null_fit(problem, **how), **how)
        problem, near = problem.with_seen_noise(first), [first]
    # Fits end when a step gains less: half the square of its length in standard deviations [nats]
    how |= {"max_iterations": settings.max_iterations, "tolerance": 1e-5}
    problem, left_out = _selected(problem, asked, settings)
    better, starts = _starts(problem, asked, settings, how)
    path: list[UpdateStep] = []

    def watch(function: FitFunction, stage: float) -> Report:
        word = function.words_of(stage)
        return lambda x, cost: path.append(
            UpdateStep(word, values_of(asked, function, x), cost, function.errors(x))
        )

    first = problem.residuals(n_lines=settings.n_lines)
    watch(first, 1.0)(first.start, _cost(first, first.start, settings))
    if path[0].errors.is_empty:
        still = Solution(first.start, path[0].cost, np.nan, 0, True)
        ended = _at_end(problem, with_evidence(first, still, settings.n_lines), settings)
    else:
        ended = _at_end(*fit_given(problem, (), [*near, *better], **how, watch=watch), settings)
        if path[0].cost < _cost(ended.function, ended.x, settings) - QUICK_NATS:
            # Bands may lead away from a start that was better.
            again = fit_given(problem, (), [problem.nominal()], **how, watch=watch)
            ended = _at_end(*again, settings)
    if settings.regularisation:
        ended = _regularised(ended, asked, settings)
    watch(ended.function, 1.0)(ended.x, _cost(ended.function, ended.x, settings))
    return result_of(ended, model, asked, tuple(path), starts, left_out, settings)


def _at_end(problem: Problem[Any], result: FitResult, settings: UpdateSettings) -> Ended:
    """Return where a fit ended, with the function of all lines there."""
    small = replace(problem, scatter=problem.small_deviations(result, result.size))
    function = small.residuals(n_lines=settings.n_lines)
    levels, x = function.levels(counted_as=settings.n_lines), function.moved_to(result)
    return Ended(problem, function, levels, result, x, None, None)


def _cost(function: FitFunction, x: Floats, settings: UpdateSettings) -> float:
    levels = function.levels(counted_as=settings.n_lines)
    return levels.cost(function.misfit(x)) + function.prior().cost(x)


def _moved(problem: P, asked: Sequence[ScaledUnknown], x: Floats) -> P:
    """Return a problem whose fits begin elsewhere."""
    start = {u.refs: u.to_value(xi) for u, xi in zip(asked, x.tolist(), strict=True)}
    nuisances = tuple(
        replace(n, start=start[n.refs]) if isinstance(n, Unknown) and n.refs in start else n
        for n in problem.nuisances
    )
    return replace(problem, nuisances=nuisances)


def _starts(
    problem: Problem[Any],
    asked: Sequence[ScaledUnknown],
    settings: UpdateSettings,
    how: dict[str, Any],
) -> tuple[list[FitResult], tuple[tuple[Floats, float], ...]]:
    """Return the best fit from other starts if it beats the first's, and where all led.

    They are drawn from the priors, and lie on the way to the model without the effects in question.
    """
    first, absent = (np.array([getattr(u, key) for u in asked]) for key in ("start", "absent"))
    removable = np.isfinite(absent) & (absent != first)
    if settings.n_starts == 1 and not removable.any():
        return [], ()
    width = _open_widths(problem, asked)
    removable &= width > 0
    way = np.where(removable, absent - first, 0.0)
    # Parts of the way to the model without an effect at which fits start, too [-]
    elsewhere = [first + part * way for part in (0.25, 0.5, 1.0) if removable.any()]
    low, high = (np.array([getattr(u, key) for u in asked]) for key in ("low", "high"))
    low, high = np.maximum(low, first - _REACH * width), np.minimum(high, first + _REACH * width)
    random = np.random.default_rng(settings.seed)
    for _ in range(settings.n_starts - 1):
        elsewhere.append(np.clip(first + width * random.standard_normal(len(width)), low, high))
    quick: dict[str, Any] = how | {"n_lines": min(QUICK_LINES, settings.n_lines)}
    fits = []
    for x in [first, *elsewhere]:
        moved = _moved(problem, asked, x)
        try:
            fits.append(fit(moved, **quick, x_from=far_fit(moved)))
        except np.linalg.LinAlgError:  # no structure there
            continue
    order = sorted(fits[1:], key=lambda r: -r.log_evidence)
    better = [r for r in order[:1] if r.log_evidence > fits[0].log_evidence + QUICK_NATS]
    function = problem.residuals(n_lines=settings.n_lines)
    led = tuple((values_of(asked, function, function.moved_to(r)), r.log_evidence) for r in fits)
    return better, led if settings.n_starts > 1 else ()


def _open_widths(problem: Problem[Any], asked: Sequence[ScaledUnknown]) -> Floats:
    """Return how widely starts are drawn, (n,): 0 of what no data change with, and of what was left out."""
    function = problem.residuals(n_lines=UpdateSettings().n_lines)
    A, _ = whitened(function, function.levels(), function.start, rows_of(function, asked))
    varied = [u for u in asked if u.refs in {v.refs for v in function.variables}]
    widths, weights = np.array([u.width for u in varied]), np.array([u.std**-2.0 for u in varied])
    blind = blind_directions(A.T @ A, widths, weights)
    width = {
        u.refs: min(u.width, _WIDEST) for u, lost in zip(varied, taking_part(blind), strict=True) if not lost
    }
    return np.array([width.get(u.refs, 0.0) for u in asked])


def _selected(
    problem: P, asked: Sequence[ScaledUnknown], settings: UpdateSettings
) -> tuple[P, tuple[tuple[str, str], ...]]:
    """Hold the parameters that selection leaves out at their start; all else counts as noise."""
    if not settings.select:
        return problem, ()
    function = problem.residuals(n_lines=settings.n_lines)
    levels = function.levels(counted_as=settings.n_lines)
    A, r = whitened(function, levels, function.start, rows_of(function, asked))
    A, names = A * np.array([u.width for u in asked]), [u.name for u in asked]
    pivoting = settings.select == "pivoting"
    chosen = select_by_pivoting(A, names) if pivoting else select_forward(A, -r, names)
    if not chosen.kept:
        return problem, ()
    dropped = {asked[one.index].refs for one in chosen.left_out}
    kept = tuple(n for n in problem.nuisances if n.refs not in dropped)
    return replace(problem, nuisances=kept), tuple((names[one.index], one.reason) for one in chosen.left_out)


def _regularised(ended: Ended, asked: Sequence[ScaledUnknown], settings: UpdateSettings) -> Ended:
    """Weigh distances from the start by the λ at the corner of the L-curve of the linearised problem.

    Residuals count by the stated noise. Without a distinct corner, as where data can be met exactly, it is
    the largest λ that leaves no more than noise (Morozov, *Soviet Math. Dokl.* 7, 1966, 414).
    """
    function, levels, known = ended.function, ended.levels, {v.refs for v in ended.function.variables}
    kept = [u for u in asked if u.refs in known]
    rows, names = rows_of(function, kept), ", ".join(u.name for u in kept)
    L = np.diag([1 / u.width for u in kept])
    if settings.regularisation == "gsvd":
        L = np.array(settings.operator, dtype=float, ndmin=2)
    if L.shape[1] != len(rows):
        msg = f"the operator has {L.shape[1]} columns; there are {len(rows)} parameters: {names}"
        raise ModelError(msg)
    x, start = ended.x, ended.x.copy()
    start[rows] = function.start[rows]
    B, r = whitened(function, levels, x, rows)
    curve = _without_corner(l_curve(B, B @ (x - start)[rows] - r, L), int(B.any(axis=1).sum()))
    precision = np.zeros((len(x), len(x)))
    precision[np.ix_(rows, rows)] = curve.chosen**2 * (L.T @ L)
    low, high = function.limits().T
    # So often the problem of a regularisation is linearised
    for _ in range(3):
        slope, normal = stated_quadratic(function, levels, x)
        step = np.linalg.solve(normal + precision, slope + precision @ (x - start))
        x = np.clip(x - step, low, high)
    return replace(ended, x=x, precision=precision, curve=curve)


def _without_corner(curve: LCurve, n_data: int) -> LCurve:
    """Return an L-curve whose λ is the largest with a mean square residual of 1 if it has no corner."""
    fair = np.flatnonzero(curve.misfit**2 <= n_data)
    return curve if curve.distinct or not fair.size else replace(curve, corner=int(fair[-1]))
