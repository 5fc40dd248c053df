"""A quick look at every candidate: what it would do to the FRFs on a grid of its parameter values.

Nothing is refitted here. Each candidate's grid is projected on the reduced basis once; after that a point of
the grid costs what its few DOFs cost.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.model import Effect
from fem.reduced import LocalChanges, ParametricFRF
from updating.fit import LEVEL_FLOOR, ROBUST, FitProblem, FitResult

N_WHOLE, N_LOW = 44, 24
"""Lines of the whole band, and of the low one, at which candidates are looked at."""

VISIBLE = 1e-3
"""Candidates that change the compared FRFs by less than this at every point of their grids are left out: the
directions measured do not see them [nepers]."""

N_BEST = 5
"""So many of the best by each of the measures go on."""

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


@dataclass(frozen=True, slots=True, eq=False)
class Grid:
    """A candidate on a grid of its parameter values.

    Attributes
    ----------
    effect : Effect
    points : tuple of dict
        Parameter values.
    terms : tuple
        What the effect adds to the reduced matrices at each point.
    """

    effect: Effect
    points: tuple[dict[str, float], ...]
    terms: tuple

    @classmethod
    def of(cls, problem: FitProblem, effect: Effect) -> "Grid":
        """Project a candidate at all points of its grid."""
        points = tuple(effect.starts(problem.surroundings))
        reduced = problem.reduced
        return cls(effect, points, tuple(reduced.value_of(effect.with_values(**p)) for p in points))


@dataclass(frozen=True, slots=True, eq=False)
class Screened:
    """A candidate that goes on, and the points of its grid to start from, the most promising first.

    Attributes
    ----------
    effect : Effect
    starts : tuple of dict
    """

    effect: Effect
    starts: tuple[dict[str, float], ...]


def screen(
    problem: FitProblem,
    current: FitResult,
    grids: Sequence[Grid],
    settled: bool,
    say: Callable[[str, float], None],
) -> tuple[Screened, ...]:
    """Choose the candidates that deserve a fit.

    Each point of each grid is judged by six residual levels: with the nuisance parameters as they are fitted
    now and with their nominal values, in each case on the whole band, on the low band (where a wrong modulus
    shifts resonances by less than their width), and on the whole band after the part has been taken off that
    a small change of the nuisance parameters explains (which is what finds weak effects). The best by each
    measure go on.

    Parameters
    ----------
    problem : FitProblem
    current : FitResult
        The model so far, with the effects already found.
    grids : sequence of Grid
    settled : bool
        Whether the model is right but for noise; then its parameters are believed, and the nominal ones are
        not looked at.
    say : callable
        Called with a text and the fraction done.
    """
    bases = (current,) if settled else (current, problem.at_nominal(current))
    n = 3 * len(bases)
    levels = [np.full((n, len(g.points)), np.inf) for g in grids]
    for b, base in enumerate(bases):
        look = _Look.of(problem, base)
        for i, grid in enumerate(grids):
            say(f"looking at {grid.effect.name}", (b + i / len(grids)) / len(bases))
            levels[i][3 * b : 3 * b + 3] = look.levels(grid)
    best = np.array([each.min(axis=1) for each in levels]).reshape(len(grids), n)
    rank = np.argsort(np.argsort(best, axis=0), axis=0)
    out = []
    for i in np.argsort(rank.min(axis=1), kind="stable"):
        if rank[i].min() >= N_BEST:
            break
        if not np.isfinite(best[i]).any():
            continue
        points: list[int] = []
        for measure in np.argsort(rank[i], kind="stable"):
            k = int(np.argmin(levels[i][measure]))
            if k not in points:
                points.append(k)
        out.append(
            Screened(grids[i].effect, tuple(grids[i].points[k] for k in points[: 1 if settled else 2]))
        )
    return tuple(out)


@dataclass(frozen=True, slots=True, eq=False)
class _Look:
    """A model with all but the candidates fixed, at a few lines.

    ``slopes`` (n, m) and ``back`` (n, m) hold the weighted slopes of the nuisance parameters, and what takes
    a residual to their change; real and imaginary parts stand side by side.
    """

    problem: FitProblem
    base: FitResult
    lines: NDArray[np.int64]
    n_whole: int
    slopes: Floats
    back: Floats
    _solved: dict[tuple[tuple[str, str], ...], LocalChanges]

    @classmethod
    def of(cls, problem: FitProblem, base: FitResult) -> "_Look":
        whole = problem.lines_up_to(np.inf, N_WHOLE)
        low = problem.lines_up_to(problem.stages[0], N_LOW)
        function = problem.function(base.effects, [_values(e) for e in base.effects], whole)
        x = function.moved_to(base)
        r, J = function(x, True)
        assert J is not None
        robust = 1 / np.sqrt(1 + np.abs(r) ** 2 / ROBUST**2)
        misfit = float((2 * ROBUST**2 * (1 / robust - 1)).mean())
        weight = robust * function.n_independent() / len(r) / (LEVEL_FLOOR**2 + misfit)
        prior = function.prior()
        known = np.where(np.isfinite(prior.std), 1 / prior.std**2, 0.0)
        slopes = np.hstack([J.real, J.imag])
        weighted = slopes * np.concatenate([weight, weight])
        A = weighted @ slopes.T + np.diag(known)
        A[np.diag_indices_from(A)] += 1e-9 * np.abs(A.diagonal()).max()
        back: Any = np.linalg.solve(A, weighted)
        return cls(problem, base, np.concatenate([whole, low]), len(whole), slopes, back, {})

    def levels(self, grid: Grid) -> Floats:
        """Return the level on the whole band, on the low one, and with nuisances adapted, (3, n_points)."""
        data, lines = self.problem.data, self.lines
        H = np.stack(self._local(grid.effect.released()).with_terms(grid.terms)) * self.base.gains[:, None]
        keep = data.mask[lines] & (data.H[lines] != 0)
        with np.errstate(divide="ignore", invalid="ignore"):
            r: Any = data.weight[lines] * np.log(H / np.where(keep, data.H[lines], 1.0))
        r = np.where(np.isfinite(r), r, 0.0)[:, keep]
        before = np.where(keep, self._local(()).H * self.base.gains[:, None], 1.0)
        if np.abs(H / before - 1)[:, keep].max(initial=0.0) < VISIBLE:
            return np.full((3, len(r)), np.inf)
        whole = np.broadcast_to((np.arange(len(lines)) < self.n_whole)[:, None, None], keep.shape)[keep]
        first = r[:, whole]
        flat = np.hstack([first.real, first.imag])
        left = flat - (flat @ self.back.T) @ self.slopes
        half = left.shape[1] // 2
        return np.stack([_level(first), _level(r[:, ~whole]), _level(left[:, :half] + 1j * left[:, half:])])

    def _local(self, released: tuple[tuple[str, str], ...]) -> LocalChanges:
        """Return the model solved at the lines, without the constraints that an effect releases."""
        if released not in self._solved:
            p, base = self.problem, self.base
            f, refs = p.data.frequency[self.lines], list(base.values)
            engine = ParametricFRF(p.reduced, *p.vectors, f, refs, base.effects, release=released)
            zeta = np.exp(p.damping.hats(f) @ np.log(base.zeta))
            self._solved[released] = engine.local(np.array([base.values[r] for r in refs]), zeta)
        return self._solved[released]


def _values(effect: Effect) -> dict[str, float]:
    return {p.name: p.value for p in effect.parameters()}


def _level(r: Complexes) -> Floats:
    """Return the robust level of residuals (n, m) [nepers]."""
    return np.sqrt((2 * ROBUST**2 * (np.sqrt(1 + np.abs(r) ** 2 / ROBUST**2) - 1)).mean(axis=1))
