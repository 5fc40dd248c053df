"""Fit a physical joint to the assembly's FRFs, with the substructures' uncertainty: maximum likelihood."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from fem.array_types import Bools, Floats
from joint._checks import as_frequency, as_lines, check_same_lines
from joint.form import JointForm
from joint.identification import JointIdentificationError
from joint.interface import SubstructureFRF
from joint.joint_fit import (
    LIKELY,
    Identifiability,
    JointFit,
    correlation_of,
    stated_covariance,
    weakest_combinations,
)
from joint.likelihood import Likelihood, LikelihoodPoint, checked_prior, noise_of
from joint.parts import FixedParts, Parts
from updating.least_squares.levenberg_marquardt import Control, Linearisation, Stop, Tolerance, minimise

SCAN = tuple(10.0 ** (k / 6) for k in range(-18, 19) if k)
"""Factors by which stiffnesses are tried far from the data [-]."""

RIGID = 1e4
"""Factor by which a stiffness that is rigid beside its present value exceeds that [-]."""

FAR_START_MISFIT = 10.0
"""Mean square of the residuals over the noise beyond which a start is far from the data [-]."""


def fit_joint(
    form: JointForm,
    substructures: SubstructureFRF | Parts,
    frequency: npt.ArrayLike,
    H_nn: npt.ArrayLike,
    start: npt.ArrayLike,
    *,
    noise: npt.ArrayLike | None = None,
    stages: Sequence[float] = (0.25, 0.5, 1.0),
    max_iterations: int = 30,
    tolerance: float = 1e-6,
    determined: float = 0.5,
    positive: bool | str = False,
    prior: tuple[npt.ArrayLike, npt.ArrayLike] | None = None,
    part_start: npt.ArrayLike | None = None,
) -> JointFit:
    """Fit a joint's parameters to the receptances of the assembly by maximum likelihood: output error.

    minimise  Σ |H_nn(θ, x) - measured|² / σ² + ½ Σ x²  over θ and x

    with H_nn by (12) of Soleimanian, Tizfahm & Sadeghi (2011), σ² = E|noise|² of circular complex noise (so
    that the first sum carries a factor of 1), and x the substructures' uncertain parameters in units of their
    prior standard deviations. Derivatives are exact:

    dH_nn = -H_nj dZ_j H_jn                              by the joint
    dH_nn = [I, -H_nj Z_j] dH [I; -Z_j H_jn]             by the substructures

    Gauss-Newton steps with Levenberg-Marquardt damping run over a low band first and then over ever wider
    ones, as a start that is a resonance's width off misleads in the whole band. Far from the data,
    stiffnesses are first tried over six decades, the most helpful first, and the steps minimise robust
    residuals of ln H, in which a resonance in the wrong place counts no more than one that lacks, with
    stiffness, mass and damping on the matrices' diagonals positive. The covariance is the inverse of Fisher's
    information (Cramér and Rao's bound), multiplied by chi² where that is above 1, as long as the residual is
    white. The part that neighbouring lines share is an error of the model, which widens the covariance
    (:func:`joint.joint_fit.stated_covariance`).

    Parameters
    ----------
    form : JointForm
        Form of the joint.
    substructures : SubstructureFRF or Parts
        Known substructures, or models with uncertain parameters (`ModelParts`).
    frequency : (n_freq,) array_like
        Lines of the assembly [Hz], those of the substructures.
    H_nn : (n_freq, M, L) array_like
        Measured receptances x/f at the internal coordinates; NaN where there is none.
    start : (n,) array_like
        θ from which to start, that of `identify_average` for example; NaN starts a viscoelastic law's own
        parameter at usual values, of which the best is taken.
    noise : array_like, optional
        Standard deviation σ: a number is relative to each |H|; an array that broadcasts to H_nn is absolute
        [unit of H]. Estimated from the lines' roughness unless given.
    stages : sequence of float
        Parts of the lines, from the lowest, that each stage takes; the last is 1.
    max_iterations : int
        For each stage.
    tolerance : float
        A stage ends when a step, in standard deviations of the estimate, is shorter than this times 1000 or
        the cost falls by less than this part of itself.
    determined : float
        A parameter counts as determined if its standard deviation is below this part of its value [-].
    positive : bool or str
        Whether parameters whose matrices are positive semidefinite stay positive to the end; ``"K"`` keeps
        stiffnesses so and leaves the others. They are then biased where noise hides them.
    prior : ((n,) array_like, (n,) array_like), optional
        Prior of θ: mean and standard deviation, that of the logarithm for parameters that stay
        positive; infinite where nothing is. A wide one keeps a parameter that the data do not determine from
        drifting away.
    part_start : (m,) array_like, optional
        x from which to start, in prior standard deviations from the models' values [-]; 0 unless given.

    Returns
    -------
    JointFit
        The best point found, also where the iterations ran out; ``converged`` and ``message`` say so.

    Raises
    ------
    ValueError
        If shapes or lines do not fit, the noise is not positive, the start is not finite, or a stage or kind
        is none.
    JointIdentificationError
        If the form's coordinates are not those of the substructures, there are fewer data than parameters,
        or a parameter has no influence on any FRF (it is named).
    """
    parts: Parts = FixedParts(substructures) if isinstance(substructures, SubstructureFRF) else substructures
    mean = parts.at_mean
    lines = as_frequency(frequency)
    check_same_lines(lines, mean.frequency, "H_nn", "the substructures")
    interface = mean.interface
    if form.coordinates.labels != interface.joint.labels:
        msg = (
            "the form's coordinates are not the joint coordinates of the substructures, or not in their order"
        )
        raise JointIdentificationError(msg)
    given = np.asarray(H_nn, dtype=complex)
    seen = np.isfinite(given)
    measured = as_lines(
        np.where(seen, given, 0.0), "H_nn", lines, interface.outputs.labels, interface.inputs.labels
    )
    weight = np.where(seen, 1 / noise_of(measured, noise, measured), 0.0)
    begin = form.starts(start, lines)
    n, m = len(form.names), len(parts.names)
    if not np.isfinite(begin[0]).all():
        name = form.names[int(np.argmin(np.isfinite(begin[0])))]
        msg = f"start has no finite value of {name}; only a viscoelastic law's own parameters may be NaN"
        raise ValueError(msg)
    if 2 * int(seen.sum()) < n:
        msg = f"{int(seen.sum())} complex values cannot determine {n} parameters"
        raise JointIdentificationError(msg)
    x = np.zeros(m) if part_start is None else np.asarray(part_start, dtype=float)
    if x.shape != (m,) or not np.isfinite(x).all():
        msg = f"part_start has shape {x.shape}; ({m},) finite values are needed"
        raise ValueError(msg)
    problem = Likelihood(form, parts, lines, measured, weight)
    signed = form.positive | (form.semidefinite & (begin[0] > 0))
    if isinstance(positive, str):
        if missing := sorted(set(positive) - set("KMCD")):
            msg = f"positive names '{missing[0]}'; True, False, or some of K, M, C, D are allowed"
            raise ValueError(msg)
        kinds = np.array([term.kind in positive for term in form.terms for _ in term.parameters])
        kept = form.positive | (signed & kinds)
    else:
        kept = signed if positive else form.positive
    problem = replace(problem, positive=kept, prior=checked_prior(prior, kept, n))
    history: list[tuple[float, float, float]] = []
    if not len(stages) or not all(0 < part <= 1 for part in stages):
        msg = f"stages are {tuple(stages)}; parts of the lines above 0, up to 1, are needed"
        raise ValueError(msg)
    counts = [max(1, min(lines.size, round(part * lines.size))) for part in stages]
    tried = []
    for theta in begin:
        first = problem.state(theta, x, lines.size, False)
        points = [first]
        if len(begin) > 1 or first.cost > FAR_START_MISFIT * seen.sum():
            rough = replace(problem, positive=signed).rough(first, lines.size)
            points.append(_approach(rough, first, counts, history, max_iterations))
            if problem.at(points[-1]).cost > FAR_START_MISFIT * seen.sum():
                points.append(
                    _approach(rough, _scan(rough, rough.at(first)), counts, history, max_iterations)
                )
        tried.append(min((problem.at(p) for p in points), key=lambda s: s.cost))
    state, converged = min(tried, key=lambda s: s.cost), False
    if state.cost < FAR_START_MISFIT * seen.sum():
        counts = counts[-1:]  # near enough for the full band
    for count in (*counts, lines.size):
        state = problem.state(state.theta, state.x, count)
        state, converged = _descend(problem, state, history, max_iterations, tolerance)
        if count == lines.size and (noise is None or np.ndim(noise) == 0):
            # noise relative to measured values makes large ones count too little: so take the rebuilt ones
            weight = np.where(seen, 1 / noise_of(measured, noise, state.H), 0.0)
            problem = replace(problem, weight=weight)
    state = problem.state(state.theta, state.x, lines.size)
    return _result(problem, state, tuple(history), converged, determined)


def _approach(
    rough: Likelihood,
    state: LikelihoodPoint,
    counts: list[int],
    history: list[tuple[float, float, float]],
    max_iterations: int,
) -> LikelihoodPoint:
    """Return where robust steps over ever wider bands end."""
    for count in counts:
        problem = rough.rough(state, count)
        at = problem.state(state.theta, state.x, count)
        state, _ = _descend(problem, at, history, max_iterations, 1e-3)
    return state


def _scan(problem: Likelihood, state: LikelihoodPoint) -> LikelihoodPoint:
    """Return the best of points where one stiffness, then another, is up to three decades off."""
    kinds = [term.kind for term in problem.form.terms for _ in term.parameters]
    first = {name for term in problem.form.terms for name, _ in term.parameters[:1]}
    scanned = [
        i
        for i, name in enumerate(problem.form.names)
        if problem.positive[i] and name in first and kinds[i] not in ("M", "C", "D")
    ]
    for _ in range(3):
        # the most helpful first: another may only imitate it
        points = []
        for i in scanned:
            unit = np.arange(len(state.theta)) == i
            points += [np.where(unit, factor * state.theta, state.theta) for factor in SCAN]
        best = min(
            (problem.state(p, state.x, state.count, False) for p in points),
            key=lambda s: s.cost,
            default=state,
        )
        if best.cost > 0.95 * state.cost:
            break
        state = best
    return problem.state(state.theta, state.x, state.count)


@dataclass(frozen=True, slots=True, eq=False)
class _ScaledPoint:
    """A point with its unknowns on their own scales: ln θ of positive parameters, and θ and x of others."""

    x: Floats
    at: LikelihoodPoint

    @property
    def cost(self) -> float:
        return self.at.cost


@dataclass(frozen=True, slots=True, eq=False)
class _Band:
    """The likelihood over the first lines, as a function of unknowns on their own scales."""

    likelihood: Likelihood
    count: int
    n: int
    log: Bools

    def scaled(self, state: LikelihoodPoint) -> _ScaledPoint:
        return _ScaledPoint(self.to_scale(state.point), state)

    def to_scale(self, values: Floats) -> Floats:
        with np.errstate(divide="ignore"):  # a bound of 0 is one of -∞
            return np.where(self.log, np.log(np.where(self.log, np.maximum(values, 0.0), 1.0)), values)

    def at(self, x: Floats, near: _ScaledPoint) -> _ScaledPoint:
        # A value that runs to 0 is stopped by itself: its steps meet the limit for ever, and gain nothing.
        # Longest step of the logarithm of a positive parameter in one iteration
        longest = np.where(self.log, 1.5, np.inf)
        x = near.x + np.clip(x - near.x, -longest, longest)
        point = np.where(self.log, np.exp(np.where(self.log, x, 0.0)), x)
        # Derivatives come with the cost: most trials are accepted, and they share the solved lines.
        return _ScaledPoint(x, self.likelihood.state(point[: self.n], point[self.n :], self.count))

    def linearised(self, point: _ScaledPoint) -> Linearisation:
        slope = np.where(self.log, point.at.point, 1.0)  # dθ = θ d ln θ
        return Linearisation(2 * point.at.g * slope, 2 * point.at.A * np.outer(slope, slope))


def _descend(
    problem: Likelihood,
    state: LikelihoodPoint,
    history: list[tuple[float, float, float]],
    max_iterations: int,
    tolerance: float,
) -> tuple[LikelihoodPoint, bool]:
    """Lower the cost until nothing is gained; return the point and whether it converged.

    Matrix and gradient are summed over lines, as the Jacobian of all would not fit into memory:
    ``scipy.optimize.least_squares`` would need it whole.
    """
    log = np.append(problem.positive, np.zeros(len(state.x), dtype=bool))
    band = _Band(problem, state.count, len(state.theta), log)
    parts = np.full(len(state.x), 8.0)
    low, high = (np.append(b, side * parts) for b, side in zip(problem.form.bounds, (-1, 1), strict=True))
    top = float(problem.lines[state.count - 1])
    reach = np.full(len(log), np.inf)
    found = minimise(
        band,
        band.scaled(state),
        (band.to_scale(low), band.to_scale(high)),
        Control(
            reach=lambda x: reach,
            promised_gain=Tolerance(tolerance**2, tolerance**2),
            actual_gain=Tolerance(tolerance, tolerance),
            max_iterations=max_iterations,
            least_gain_ratio=0.1,  # the logarithms of small stiffnesses make curved valleys
            max_trials=40,
            least_damping=1e-14,  # never 0: two parameters may do the same
            least_raised=1e-9,
            raised_by=6.0,
            lowered_by=8.0,
        ),
        lambda point, length: history.append((top, point.cost, length)),
    )
    return found.point.at, found.stop is not Stop.OUT_OF_ITERATIONS


def _result(
    problem: Likelihood,
    state: LikelihoodPoint,
    history: tuple[tuple[float, float, float], ...],
    converged: bool,
    determined: float,
) -> JointFit:
    form, parts = problem.form, problem.parts
    n, m = len(state.theta), len(state.x)
    dead = [form.names[i] for i in range(n) if not state.A[i, i] > 0]
    if dead:
        msg = (
            f"{', '.join(dead[:6])} has no influence on any FRF; leave it out of the form or add coordinates"
        )
        raise JointIdentificationError(msg)
    state, at_bound = _at_zero(problem, state)
    residual = problem.weight * (state.H - problem.measured)
    count = int((problem.weight > 0).sum())
    chi2 = float((np.abs(residual) ** 2).sum() / max(count - n / 2, 1))
    low, high = form.bounds
    at_bound |= (state.theta <= low) | (state.theta >= high)

    def information(first: int, end: int) -> tuple[Floats, Floats]:
        part = problem.of_lines(state.theta, state.x, first, end)
        return part.A, part.g

    fixed = np.append(at_bound, np.zeros(m, dtype=bool))
    independent, covariance = stated_covariance(
        state.A, fixed, residual, _relative_noise(problem), chi2, state.H, information
    )
    std = np.where(fixed, np.nan, np.sqrt(np.diag(covariance)))
    names = (*form.names, *parts.names)
    value = np.concatenate([state.theta, np.ones(m)])
    relative = np.divide(std, np.abs(value), out=np.full(n + m, np.inf), where=(value != 0) & ~fixed)
    weakest = weakest_combinations(covariance[:n, :n], state.theta, form.names)
    known = Identifiability(names, std, relative, relative < determined, correlation_of(covariance), weakest)
    some = ~fixed & np.isfinite(np.diag(covariance))
    wider = np.sqrt(np.divide(np.diag(covariance), np.diag(independent), out=np.ones(n + m), where=some))
    open_end = tuple(
        "" if known.determined[i] or at_bound[i] else _open_end(problem, state, i, float(wider[i]))
        for i in range(n)
    )
    physical = parts.physical(state.x)
    ahead = parts.physical(state.x + 1e-6)
    return JointFit(
        form=form,
        values=state.theta,
        covariance=covariance[:n, :n],
        independent=independent[:n, :n],
        at_bound=at_bound,
        open_end=open_end,
        part_names=parts.names,
        part_values=physical,
        part_std=std[n:] * (ahead - physical) / 1e-6 if m else np.zeros(0),
        frequency=problem.lines,
        H=state.H,
        residual=residual,
        chi2=chi2,
        identifiability=known,
        history=history,
        converged=converged,
        message=_message(form, known, at_bound, chi2, converged),
    )


def _message(form: JointForm, known: Identifiability, at_bound: Bools, chi2: float, converged: bool) -> str:
    """Return a sentence on the end of a fit, with doubts about its result."""
    message = "converged" if converged else "not converged: the iterations ran out at the best point so far"
    if chi2 > 2:
        message += (
            f"; the residual is {np.sqrt(chi2):.1f} times the noise: the model lacks an effect or is wrong"
        )
    flags = zip(form.names, known.determined, at_bound, strict=False)
    loose = [name for name, ok, bound in flags if not ok and not bound]
    if loose:
        message += f"; the data do not determine {', '.join(loose[:8])}{' …' if len(loose) > 8 else ''}"
    if at_bound.any():
        at = [name for name, bound in zip(form.names, at_bound, strict=True) if bound]
        message += f"; at a bound: {', '.join(at)}"
    return message


def _relative_noise(problem: Likelihood) -> Floats:
    """Return the noise of the data over the deviation that was allowed, at most 1, (n_freq, M, L)."""
    with np.errstate(invalid="ignore"):  # where there is no value, and no weight
        relative = problem.weight * noise_of(problem.measured, None, problem.measured)
    return np.where(problem.weight > 0, np.minimum(np.nan_to_num(relative, nan=1.0), 1.0), 0.0)


def _at_zero(problem: Likelihood, state: LikelihoodPoint) -> tuple[LikelihoodPoint, Bools]:
    """Put positive parameters that have run towards zero there; return the point and which they are.

    A factor never reaches zero, and its logarithm runs on for ever. A parameter that fits no worse at zero is
    put there.
    """
    n = len(state.theta)
    with np.errstate(divide="ignore"):
        std = 1 / np.sqrt(2 * np.maximum(np.diag(state.A)[:n], 0.0))
    of_law = np.array([len(term.parameters) > 1 for term in problem.form.terms for _ in term.parameters])
    near = problem.positive & ~of_law & (state.theta < 0.1 * std) & (state.g[:n] >= 0)
    if not near.any():
        return state, near
    there = problem.state(np.where(near, 0.0, state.theta), state.x, state.count)
    if there.cost <= state.cost + 0.01:
        return there, near
    return state, np.zeros(n, dtype=bool)


def _open_end(problem: Likelihood, state: LikelihoodPoint, i: int, wider: float) -> str:
    """Return which limit of a stiffness, mass or damping fits as well as its value, all else as it is."""
    if not problem.form.semidefinite[i]:
        return ""
    fits = []
    plain = replace(problem, prior=None)
    here = plain.at(state).cost
    for word, factor in (("released", 0.0), ("rigid", RIGID)):
        theta = state.theta.copy()
        theta[i] *= factor
        there = plain.state(theta, state.x, state.count, False).cost
        if np.isfinite(there) and (there - here) / wider**2 <= LIKELY:
            fits.append(word)
    return "either" if len(fits) == 2 else "".join(fits)
