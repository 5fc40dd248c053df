"""Campbell diagrams: modes of a rotor over its speed, and its critical speeds.

    Model with members that spin ─ speeds → solve_campbell → Campbell

Only the skew matrix grows with the speed. Modes at one speed are followed to the next by the inner product in
which different modes of one speed are orthogonal, yᵀ(K̂ - s_j s_k M)x.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import scipy
import scipy.sparse as sp
from numpy.typing import ArrayLike

from fem.analysis.complex_modes import ComplexModes, solve_complex_modes, whirl
from fem.analysis.modes import Eigenpairs, solve_eigenpairs
from fem.array_types import Bools, Complexes, Floats, Ints
from fem.effects.spin import Spin, refuse_speeds, spinning
from fem.linalg.solvers import one_thread
from fem.model import Model, ModelError
from fem.summary import fields_summary
from fem.system import System, assemble, sum_contributions

_TOLERANCE = 1e-9
"""Relative error of a critical speed at which its iteration ends."""

_ROUNDS = 40
_SPIN = "spin"


class CriticalSpeed(NamedTuple):
    """A speed at which an excitation of some order meets a damped natural frequency.

    Attributes
    ----------
    speed : float
        [rad/s].
    order : float
        Of the excitation: its frequency over the speed [-].
    branch : int
        Column of the Campbell diagram.
    pole : complex
        There [rad/s].
    whirl : float
        1 forward in circles, -1 backward in circles [-].
    """

    speed: float
    order: float
    branch: int
    pole: complex
    whirl: float

    @property
    def zeta(self) -> float:
        """Damping ratio [-]."""
        return -self.pole.real / abs(self.pole)


@dataclass(frozen=True, slots=True, eq=False)
class Campbell:
    """Oscillating modes over speed, one column for each branch, those that are slowest at first first.

    Attributes
    ----------
    speeds : ndarray (n_speeds,)
        Of a member with spin 1 [rad/s].
    poles : ndarray of complex (n_speeds, n_branches)
        s; NaN where a branch is not among the computed modes, or does not oscillate [rad/s].
    whirl : ndarray (n_speeds, n_branches)
        See :func:`fem.analysis.complex_modes.whirl`; at speed 0 in the sense that the speeds above it take.
    likeness : ndarray (n_speeds - 1, n_branches)
        Likeness of a branch's shapes at a speed and the next: 1 of equal ones, 0 of orthogonal ones [-].
    critical : tuple of CriticalSpeed
        Rising.
    critical_shapes : ndarray of complex (n_dof, n_critical)
        Shapes of the modes that are met.
    converged : bool
        Whether all modes are.
    """

    speeds: Floats
    poles: Complexes
    whirl: Floats
    likeness: Floats
    critical: tuple[CriticalSpeed, ...]
    critical_shapes: Complexes
    converged: bool

    __repr__ = fields_summary

    @property
    def n_branches(self) -> int:
        """Number of branches."""
        return self.poles.shape[1]

    @property
    def frequency(self) -> Floats:
        """Damped natural frequencies Im s/2π, shape (n_speeds, n_branches) [Hz]."""
        return np.imag(self.poles) / (2 * np.pi)

    @property
    def zeta(self) -> Floats:
        """Damping ratios -Re s/|s|, shape (n_speeds, n_branches) [-]."""
        return -np.real(self.poles) / np.abs(self.poles)

    @property
    def unstable(self) -> Bools:
        """Whether a mode grows at each speed, shape (n_speeds,); negative ratios below 1e-9 are rounding."""
        return np.asarray((np.nan_to_num(self.zeta) < -1e-9).any(axis=1))

    def turning(self, branch: int) -> float:
        """Return the mean whirl of a branch [-]; NaN where no axis turns."""
        known = self.whirl[:, branch]
        known = known[np.isfinite(known)]
        return float(known.mean()) if known.size else np.nan


@dataclass(frozen=True, slots=True, eq=False)
class _Modes:
    """The oscillating modes of one speed on the independent coordinates."""

    s: Complexes
    x: Complexes
    y: Complexes
    b: Complexes  # modal B
    whirl: Floats
    converged: bool

    def likeness(self, other: "_Modes", K: Any, M: Any) -> Floats:
        """Return the likeness of these modes (rows) and another speed's (columns)."""
        product = self.y.T @ (K @ other.x) - np.outer(self.s, other.s) * (self.y.T @ (M @ other.x))
        return np.abs(product) / np.sqrt(np.outer(np.abs(self.b), np.abs(other.b)))


_Crossing = tuple[CriticalSpeed, Complexes]
"""A critical speed, and the shape of its mode on the independent coordinates."""


class _Shaft:
    """The matrices of a model at any speed, and its modes there."""

    def __init__(self, model: Model, n: int) -> None:
        at_rest = model.without_effect(*(e.name for e in model.of_kind(Spin)))
        self.model = at_rest.with_effect(Spin(name=_SPIN, speed=1.0))
        self.base = assemble(at_rest, reciprocal=False)
        full = sum_contributions(self.model.effect(_SPIN).contribute(self.model), at_rest.n_dof)[2]
        self.G = sp.csc_array(self.base.Q.T @ full @ self.base.Q)
        damping = at_rest.damping
        lossy = self.base.D + damping.loss_factor * self.base.K
        self.K = self.base.K + 1j * lossy if lossy.nnz else self.base.K
        self.n = n
        self.pairs: Eigenpairs = solve_eigenpairs(
            self.base, min(self.base.n_free, self.base.rigid.shape[1] + n + max(10, n // 2))
        )

    def system(self, speed: float) -> System:
        model = self.model.with_values({(_SPIN, "speed"): speed})
        return replace(self.base, C=sp.csc_array(self.base.C + speed * self.G), model=model)

    def modes(self, speed: float) -> _Modes:
        system = self.system(speed)
        found: ComplexModes = solve_complex_modes(system, self.n, pairs=self.pairs)
        keep = np.flatnonzero(np.imag(found.poles) > 0)
        Qt = self.base.Q.T
        x, y = (np.asarray(Qt @ X[:, keep]) for X in (found.shapes, found.left))
        unit = system.model if speed else self.model  # the sense at rest is that of a slow spin
        turning = whirl(unit, found.poles[keep], found.shapes[:, keep])
        return _Modes(found.poles[keep], x, y, found.modal_b[keep], turning, found.converged)


@one_thread()
def solve_campbell(
    model: Model,
    speeds: ArrayLike,
    n: int = 8,
    orders: Sequence[float] = (1.0,),
    progress: Callable[[int, int], None] | None = None,
) -> Campbell:
    """Compute modes over speed, follow them, and find where orders of the speed meet them.

    Parameters
    ----------
    model : Model
        With members that have a ``spin``; the speeds replace its `Spin`.
    speeds : array_like (n_speeds,)
        Rising, from 0 or more, of a member with spin 1 [rad/s].
    n : int
        Number of modes: branches that are among the n slowest oscillating ones at some speed are returned.
    orders : sequence of float
        Of excitations: 1 for unbalance [-].
    progress : callable, optional
        Called with the number of speeds done and of all.

    Returns
    -------
    Campbell
        Critical speeds are found between the given speeds: two within one interval on one branch are missed.

    Raises
    ------
    ModelError
        If nothing spins, and for speeds or orders that cannot be.
    """
    speeds = np.array(speeds, dtype=float, ndmin=1)
    _check(model, speeds, n, orders)
    shaft = _Shaft(model, n + max(4, n // 2))
    each = []
    for k, speed in enumerate(speeds):
        each.append(shaft.modes(float(speed)))
        if progress is not None:
            progress(k + 1, speeds.size)
    columns, likeness = _followed(each, shaft)
    seen = (columns >= 0) & (columns < n)  # modes of one speed are sorted
    keep = np.flatnonzero(seen.any(axis=0))
    columns, likeness = columns[:, keep], likeness[:, keep]
    poles = np.full(columns.shape, np.nan, dtype=complex)
    turning = np.full(columns.shape, np.nan)
    for k, modes in enumerate(each):
        have = np.flatnonzero(columns[k] >= 0)
        poles[k, have], turning[k, have] = modes.s[columns[k, have]], modes.whirl[columns[k, have]]
    if speeds[0] == 0 and speeds.size > 1:
        turning[0] = turning[1]  # at rest the plane of equal modes is arbitrary
    critical = []
    for branch in range(columns.shape[1]):
        for order in orders:
            critical += _crossings(shaft, speeds, each, columns[:, branch], branch, float(order))
    critical.sort(key=lambda found: found[0])
    shapes = np.array([x for _, x in critical]).reshape(-1, shaft.base.n_free).T
    return Campbell(
        speeds,
        poles,
        turning,
        likeness,
        tuple(speed for speed, _ in critical),
        np.asarray(shaft.base.Q @ shapes),
        all(modes.converged for modes in each),
    )


def _check(model: Model, speeds: Floats, n: int, orders: Sequence[float]) -> None:
    """Refuse models without a spin, and speeds and orders that cannot be."""
    if not spinning(model):
        msg = "no member spins: give members a spin, their speed relative to that of the rotation"
        raise ModelError(msg)
    if not (np.isfinite(speeds).all() and speeds.size and speeds[0] >= 0 and (np.diff(speeds) > 0).all()):
        msg = "the speeds must be finite, at least 0, and rise"
        raise ModelError(msg)
    refuse_speeds(speeds)
    if n < 1:
        msg = f"{n} modes are asked for; at least 1 is needed"
        raise ModelError(msg)
    for order in orders:
        if not 0 < order < np.inf:
            msg = f"an order is {order:g}; it must be positive: the excitation's frequency over the speed"
            raise ModelError(msg)


def _followed(each: Sequence[_Modes], shaft: _Shaft) -> tuple[Ints, Floats]:
    """Return the mode of each speed on each branch, -1 for none, and the likeness from speed to speed.

    Pairs of modes are chosen together, for the largest sum of likenesses. Modes left over end or begin a
    branch.
    """
    n = len(each)
    branches = [np.concatenate([[k], np.full(n - 1, -1)]) for k in range(each[0].s.size)]
    found: list[Floats] = [np.full(max(n - 1, 0), np.nan) for _ in branches]
    for i in range(1, n):
        alike = each[i - 1].likeness(each[i], shaft.K, shaft.base.M)
        pairs = {int(a): int(b) for a, b in zip(*scipy.optimize.linear_sum_assignment(-alike), strict=True)}
        taken = set()
        for column, values in zip(branches, found, strict=True):
            last = int(column[i - 1])
            if last >= 0 and last in pairs:
                column[i] = pairs[last]
                values[i - 1] = min(alike[last, pairs[last]], 1.0)
                taken.add(pairs[last])
        for k in sorted(set(range(each[i].s.size)) - taken):
            column = np.full(n, -1)
            column[i] = k
            branches.append(column)
            found.append(np.full(n - 1, np.nan))
    columns = np.column_stack(branches) if branches else np.zeros((n, 0), dtype=np.int64)
    return columns, np.column_stack(found) if found else np.zeros((n - 1, 0))


def _crossings(
    shaft: _Shaft, speeds: Floats, each: Sequence[_Modes], column: Ints, branch: int, order: float
) -> list[_Crossing]:
    """Return where an order meets one branch, between the speeds at which its sign changes."""
    out = []
    for i in range(1, speeds.size):
        if column[i - 1] < 0 or column[i] < 0:
            continue
        ends = [(float(speeds[k]), each[k], int(column[k])) for k in (i - 1, i)]
        above = [float(modes.s[k].imag) - order * speed for speed, modes, k in ends]
        if above[0] > 0 >= above[1] or above[0] < 0 <= above[1]:
            out.append(_refined(shaft, ends, above, branch, order))
    return out


def _refined(
    shaft: _Shaft,
    ends: list[tuple[float, _Modes, int]],
    above: list[float],
    branch: int,
    order: float,
) -> _Crossing:
    """Return the speed between two others at which an order meets a mode, by regula falsi (Illinois)."""
    (low, _, _), (high, start, mine) = ends  # of the lower speed, if it is 0, shapes may be any of a plane
    first, second = above
    speed, here, k = high, start, mine
    for _ in range(_ROUNDS):
        speed = low + (high - low) * first / (first - second)
        here = shaft.modes(speed)
        k = int(start.likeness(here, shaft.K, shaft.base.M)[mine].argmax())
        value = float(here.s[k].imag) - order * speed
        if abs(value) <= _TOLERANCE * order * speed:
            break
        if value * second < 0:
            low, first = high, second
        else:
            first /= 2
        high, second = speed, value
        if abs(high - low) <= _TOLERANCE * speed:
            break
    return CriticalSpeed(speed, order, branch, complex(here.s[k]), float(here.whirl[k])), here.x[:, k]
