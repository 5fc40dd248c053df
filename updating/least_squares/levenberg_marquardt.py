"""One damped Gauss-Newton loop within bounds (Levenberg-Marquardt) for all nonlinear fits of the package.

Fits of effects, `update`, modal refinement and joint estimators state their cost (:class:`Objective`); the
loop takes the steps. ``scipy.optimize.least_squares`` asks for a vector of residuals and its Jacobian, and
none of these four has one that it could take:

* the error level of each group of residuals is estimated with the unknowns, so that the cost is a sum of
  logarithms of mean squares;
* Jacobians are too large to hold: matrix and gradient are summed over lines or outputs;
* in modal refinement the linear unknowns are eliminated, which has a Gauss-Newton matrix of its own;
* `update` follows modes from one accepted point to the next.

Nor has it limits of steps for each unknown, or trials that fail. It is used where it does: for the curves of
:mod:`joint.physics`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Any, Generic, Protocol, Self, TypeVar

import numpy as np
import scipy.linalg as sla

from fem.array_types import Bools, Floats

KEPT_PROMISE = 0.75, 1.33
"""Gain of a step over that of the quadratic model, between which its derivatives may serve the next step."""


class Point(Protocol):
    """A set of values of the unknowns with the cost there; it may hold whatever else was computed."""

    @property
    def x(self) -> Floats:
        """Unknowns (n,), each on a scale of its own: ln θ, or θ over a scale."""
        ...

    @property
    def cost(self) -> float:
        """Negative log posterior, up to a constant [nats]."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Linearisation:
    """Quadratic model of the cost at a point.

    Attributes
    ----------
    gradient : ndarray (n,)
    matrix : ndarray (n, n)
        Gauss-Newton's, positive semidefinite: the Hessian without the residuals' second derivatives.
    """

    gradient: Floats
    matrix: Floats

    def gain(self, step: Floats) -> float:
        """Return by how much a step lowers the model of the cost."""
        return -float(self.gradient @ step + 0.5 * step @ self.matrix @ step)

    def again(self, point: Any) -> Self | None:
        """Return the model at a point near by with the same derivatives; None where they are not kept."""
        return None

    def among(self, free: Bools) -> Floats:
        """Return the matrix of those unknowns that may move."""
        return self.matrix[np.ix_(free, free)]


P = TypeVar("P", bound=Point)
L = TypeVar("L", bound=Linearisation, covariant=True)


class Objective(Protocol[P, L]):
    """A cost as a function of unknowns."""

    def at(self, x: Floats, near: P) -> P | None:
        """Return the point at trial values; None where the model has no response.

        ``near`` is the last accepted point, from which modes are followed. The objective may shorten a step:
        x of the point is where it went.
        """
        ...

    def linearised(self, point: P) -> L:
        """Return gradient and Gauss-Newton matrix at an accepted point."""
        ...


@dataclass(frozen=True, slots=True)
class Tolerance:
    """A change of the cost that counts as nothing: the larger of both.

    Attributes
    ----------
    absolute : float
        [nats]
    relative : float
        Part of the cost [-]; for costs that are sums of squares.
    """

    absolute: float = 0.0
    relative: float = 0.0

    def of(self, cost: float) -> float:
        """Return it at a cost [nats]."""
        return max(self.absolute, self.relative * abs(cost))


@dataclass(frozen=True, slots=True, eq=False)
class Control:
    """How to iterate, and when to end.

    Attributes
    ----------
    reach : callable
        From x (n,) to the longest step of each unknown from there (n,); ``inf`` for no limit.
    promised_gain : Tolerance
        It ends where the Gauss-Newton step promises to lower the cost by less than this.
    actual_gain : Tolerance
        It ends after a step, none of whose unknowns met its limit, that lowered the cost by less than this.
    max_iterations : int
        Accepted steps.
    least_gain_ratio : float
        Actual gain over that of the quadratic model, below which a small one does not end it [-].
    max_trials : int
        Of each step, with more and more damping.
    max_evaluations : float
        Trials of all steps together.
    damping, least_damping : float
        At first, and at least: relative to the diagonal of the matrix [-].
    least_raised : float
        Least damping after a trial that fails: less changes no step but those along directions that the data
        hardly determine.
    raised_by, lowered_by : float
        Factors on the damping after a trial that fails and after one that succeeds [-].
    trusted_damping : float
        Most damping with which a small promised gain ends the iteration: more may itself make it small.
    """

    reach: Callable[[Floats], Floats]
    promised_gain: Tolerance
    actual_gain: Tolerance
    max_iterations: int
    least_gain_ratio: float = 0.0
    max_trials: int = 12
    max_evaluations: float = np.inf
    damping: float = 1e-3
    least_damping: float = 1e-12
    least_raised: float = 1e-6
    raised_by: float = 8.0
    lowered_by: float = 6.0
    trusted_damping: float = 1.0


class Stop(Enum):
    """Why the loop ended."""

    CONVERGED = "the next step would gain nothing"
    NO_DESCENT = "no step along the derivatives lowers the cost"
    AT_BOUNDS = "every unknown is at a bound, or the cost does not depend on it"
    NO_INFLUENCE = "the cost depends on none of the unknowns"
    OUT_OF_ITERATIONS = "the cost was still falling"


@dataclass(frozen=True, slots=True, eq=False)
class Minimum(Generic[P, L]):
    """Where the loop ended.

    Attributes
    ----------
    point : Point
        The best one.
    linearisation : Linearisation
        At the last point where it was needed. After a last step that gained next to nothing that is the one
        before it, which saves a Jacobian. Its derivatives may be those of a point shortly before.
    stop : Stop
    n_iterations : int
    """

    point: P
    linearisation: L
    stop: Stop
    n_iterations: int


Report = Callable[[P, float], None]
"""Called after each accepted step with the point and the step's length, each unknown over the standard
deviation that it has while all others are fixed [-]."""


def minimise(
    objective: Objective[P, L],
    start: P,
    bounds: tuple[Floats, Floats],
    control: Control,
    report: Report[P] | None = None,
) -> Minimum[P, L]:
    """Lower a cost by Levenberg-Marquardt steps within bounds.

    Damping is by the diagonal of the Gauss-Newton matrix (Marquardt, *J. SIAM* 11, 1963, 431), so that steps
    do not depend on units. Unknowns at a bound that the cost pulls beyond it are left out of a step.

    Parameters
    ----------
    objective : Objective
    start : Point
        Within the bounds.
    bounds : (ndarray (n,), ndarray (n,))
        Equal ones hold an unknown.
    control : Control
    report : callable, optional
    """
    low, high = bounds
    point, linear = start, objective.linearised(start)
    damping, n_evaluations = control.damping, 0
    iteration, kept = 1, False
    while iteration <= control.max_iterations:
        x, free = point.x, movable(point.x, linear, bounds)
        if not free.any():
            anything = (np.diag(linear.matrix) > 0).any()
            return Minimum(point, linear, Stop.AT_BOUNDS if anything else Stop.NO_INFLUENCE, iteration)
        reach = control.reach(x)
        limits = np.maximum(-reach, low - x)[free], np.minimum(reach, high - x)[free]
        system = _ScaledStep.of(linear.among(free), linear.gradient[free], limits)
        trial, step, first_damping = None, np.zeros(len(x)), damping
        for attempt in range(control.max_trials):
            step[free], promised = system.step(damping)
            trusted = attempt == 0 and damping <= control.trusted_damping
            if trusted and promised < control.promised_gain.of(point.cost):
                if kept:
                    break
                return Minimum(point, linear, Stop.CONVERGED, iteration)
            if n_evaluations >= control.max_evaluations:
                return Minimum(point, linear, Stop.OUT_OF_ITERATIONS, iteration)
            n_evaluations += 1
            trial = objective.at(np.clip(x + step, low, high), point)
            if trial is not None and np.isfinite(trial.cost) and trial.cost < point.cost:
                break
            trial = None
            # Damping beyond which steps are too short to change anything [-]
            damping = min(max(control.raised_by * damping, control.least_raised), 1e8)
        if trial is None and kept:
            # Derivatives of another point do not tell where the end is.
            linear, kept, damping = objective.linearised(point), False, first_damping
            continue
        if trial is None:
            return Minimum(point, linear, Stop.NO_DESCENT, iteration)
        gain, point, expected = point.cost - trial.cost, trial, linear.gain(trial.x - x)
        if report is not None:
            report(point, float(np.linalg.norm(step[free] * system.scale)))
        damping = max(damping / control.lowered_by, control.least_damping)
        # A step that met a limit gains little because it is short: the next may gain as much again.
        cut = (np.abs(step) >= reach).any()
        # One that gained much less than it promised has crossed a curved valley, and the floor falls on.
        crossed = gain < control.least_gain_ratio * expected
        small = gain < control.actual_gain.of(point.cost)
        if small and not cut and not crossed and not kept:
            return Minimum(point, linear, Stop.CONVERGED, iteration)
        if iteration < control.max_iterations:
            as_promised = KEPT_PROMISE[0] * expected < gain < KEPT_PROMISE[1] * expected
            again = linear.again(point) if as_promised and not small else None
            linear, kept = objective.linearised(point) if again is None else again, again is not None
        iteration += 1
    return Minimum(point, linear, Stop.OUT_OF_ITERATIONS, control.max_iterations)


def movable(x: Floats, linear: Linearisation, bounds: tuple[Floats, Floats]) -> Bools:
    """Return which unknowns a step may move: not those held at a bound, nor those without influence."""
    (low, high), g = bounds, linear.gradient
    pinned = (low >= high) | ((x <= low) & (g > 0)) | ((x >= high) & (g < 0))
    return ~pinned & (np.diag(linear.matrix) > 0)


def promised_gain(linear: Linearisation, free: Bools) -> float:
    """Return the gain that the undamped Gauss-Newton step of free unknowns promises, ½ gᵀ A⁻¹ g [nats]."""
    H, g = linear.among(free), linear.gradient[free]
    scale = _sizes(H)
    H, g = H / np.outer(scale, scale), g / scale
    return 0.5 * float(g @ np.linalg.lstsq(H, g, rcond=1e-12)[0])


@dataclass(frozen=True, slots=True, eq=False)
class _ScaledStep:
    """The normal equations with a diagonal of 1: their condition does not depend on units then."""

    H: Floats
    g: Floats
    scale: Floats
    limits: tuple[Floats, Floats]

    @classmethod
    def of(cls, matrix: Floats, gradient: Floats, limits: tuple[Floats, Floats]) -> "_ScaledStep":
        scale = _sizes(matrix)
        return cls(
            matrix / np.outer(scale, scale), gradient / scale, scale, (limits[0] * scale, limits[1] * scale)
        )

    def step(self, damping: float) -> tuple[Floats, float]:
        """Return the step within the limits, and the gain that the one without limits promises."""
        H = self.H + damping * np.eye(len(self.g))
        goal = np.asarray(-np.linalg.solve(H, self.g), dtype=float)
        return step_within(goal, H, self.limits) / self.scale, -0.5 * float(self.g @ goal)


def _sizes(matrix: Floats) -> Floats:
    """Return the roots of a diagonal, not so small that a division by them overflows."""
    return np.sqrt(np.maximum(np.diag(matrix), 1e-300))


def step_within(goal: Floats, H: Floats, limits: tuple[Floats, Floats]) -> Floats:
    """Return a step towards the minimum of ½ (p - goal)ᵀ H (p - goal) that stays within limits.

    From 0 towards the minimum up to the first limit; the unknown that has met it stays there, and the others
    go on towards their minimum under this constraint. So one with a long way to go does not hold the others
    up, as it would if the whole step were shortened, and the quadratic falls all the way.

    Parameters
    ----------
    goal : ndarray (n,)
        The minimum without limits.
    H : ndarray (n, n)
        Positive definite.
    limits : (ndarray (n,), ndarray (n,))
        Of each unknown, with 0 between them.
    """
    lower, upper = limits
    at, free, factor = np.zeros(len(goal)), goal, None
    fixed: list[int] = []
    columns = np.zeros((len(goal), 0))
    while len(fixed) < len(goal):
        move = goal - at
        move[fixed] = 0.0
        room = np.where(move > 0, upper, lower) - at
        share = np.full(len(at), np.inf)
        np.divide(room, move, out=share, where=move != 0)
        first = int(np.argmin(share))
        if not share[first] < 1:
            return goal
        at = at + share[first] * move
        at[first] = (upper if move[first] > 0 else lower)[first]
        if factor is None:
            factor = sla.lu_factor(H, check_finite=False)
        fixed.append(first)
        # Forces on what is fixed move all others: with H⁻¹ of these alone, no system is solved anew.
        columns = np.column_stack([columns, sla.lu_solve(factor, np.eye(1, len(at), first)[0])])
        goal = free + columns @ np.linalg.solve(columns[fixed], (at - free)[fixed])
        goal[fixed] = at[fixed]
    return at
