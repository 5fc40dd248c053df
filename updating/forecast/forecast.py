"""What each of many candidates would do to the data of a fit: gain, standard deviation, likeness.

To first order in the effect and in all that varies beside it. The change of the receptances by a little of an
effect is -Hₒ ΔZ Hᵢ, from the responses at all DOFs and the effect's own few element matrices, so that no
candidate is projected. What uncertain parameters, the form, damping and channels could do of it is taken away
with their priors. The rest, v in whitened residuals, makes the effect known to ± 1/|v|: of size a it gains
½ (a |v|)² nats over a model without it, and of that the share 1 - cos² over one with another effect.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from fem.model import Effect, ParameterRef
from fem.reduction.local_changes import Fields
from updating.forecast.grid import Grid, Little
from updating.forecast.look import Complexes, Floats, Look
from updating.forecast.sizes import Sizes
from updating.inference.fit import FitProblem
from updating.inference.fit_result import FitResult
from updating.inference.fitting import FULL_LINES
from updating.inference.heartbeat import beat

MOST_VALUES, MOST_COMPARED = 10_000, 3_000
"""Largest number of values of FRFs that are used for gains, and where changes are kept to be compared."""
MOST_RESPONSES = 20_000_000
"""Largest number of responses of all DOFs, to sensors and forces at all lines, that are kept."""
LEAST_LINES = 12
"""Lines that are kept of them in any case."""
ROUNDING = 1e-9
"""Changes of residuals by the largest plausible size below this are none [nepers]."""
LEAST_SQUARE = 1e-300
"""A sum of squared residuals below this is none."""
TOGETHER = 200
"""Number of small changes that are judged at once."""

Ints = NDArray[np.int64]


@dataclass(eq=False)
class Forecast:
    """What a little of each of some candidates does, at each of its places, n in all.

    Attributes
    ----------
    look : Look
        At the fit.
    littles : tuple of Little
        Of the candidates.
    owner, place : ndarray of int (n,)
        Candidate of each, and which of its places.
    squares : ndarray (n, n_groups + 1)
        Mean squares of what nothing uncertain can do of each group's residuals and, behind these, half the
        squares of what is known beforehand.
    precision : ndarray (n,)
        1 / standard deviation of the multiple: |v|.
    cost, factor : ndarray (n,)
        Negative log posterior that the best multiple leaves of the data, infinite where it is invisible, and
        that multiple.
    share : ndarray (n,)
        Part of the sum of the squared whitened residuals that the best multiple takes away [-].
    low : ndarray (n,)
        Level on the low band that is left.
    vectors : ndarray (n, r)
        v, where it was asked for.
    changes : ndarray (n, m)
        Changes of the weighted residuals of the full band, where they were asked for.
    """

    look: Look
    littles: tuple[Little, ...]
    owner: Ints
    place: Ints
    squares: Floats
    precision: Floats
    cost: Floats
    factor: Floats
    share: Floats
    low: Floats
    vectors: Floats = field(repr=False)
    changes: Complexes = field(repr=False)

    @classmethod
    def at(
        cls,
        problem: FitProblem,
        base: FitResult,
        candidates: Sequence[Effect],
        *,
        besides: float | None = None,
        bounded: bool = True,
        n_places: int = 0,
        vectors: bool = False,
        say: Callable[[float], None] = lambda done: None,
    ) -> "Forecast":
        """Return what candidates would do at a fit; parameters as of :meth:`of` and of :meth:`Look.of`."""
        most = MOST_COMPARED if vectors else MOST_VALUES
        look = Look.of(problem, base, n_lines(problem), 0, most, besides, bounded=bounded)
        grids = [Grid.of(problem, e) for e in candidates]
        return cls.of(look, grids, n_places=n_places, vectors=vectors, say=say)

    @classmethod
    def of(
        cls,
        look: Look,
        grids: Sequence[Grid],
        *,
        n_places: int = 0,
        vectors: bool = False,
        changes: bool = False,
        say: Callable[[float], None] = lambda done: None,
    ) -> "Forecast":
        """Return what a little of each candidate does beyond all that may vary.

        Parameters
        ----------
        look : Look
        grids : sequence of Grid
        n_places : int
            Of more places of a candidate evenly spaced ones count; 0 for all.
        vectors, changes : bool
            Whether these will be asked for.
        say : callable
            Called with the fraction done.
        """
        littles = tuple(Little.of(grid, look.base.values, n_places) for grid in grids)
        n_each = [len(little.points) for little in littles]
        n, m = sum(n_each), len(look.share)
        out = cls(
            look,
            littles,
            np.repeat(np.arange(len(grids)), n_each),
            np.concatenate([np.arange(0), *(np.arange(k) for k in n_each)]).astype(np.int64),
            np.empty((n, look.share.shape[1] + 1)),
            precision=np.empty(n),
            cost=np.empty(n),
            factor=np.empty(n),
            share=np.empty(n),
            low=np.empty(n),
            vectors=np.empty((n if vectors else 0, look.slopes.shape[1])),
            changes=np.empty((n if changes else 0, m), dtype=complex),
        )
        most = np.concatenate([np.zeros(0), *(little.most for little in littles)])
        one_sided = np.repeat([grid.one_sided() for grid in grids], n_each).astype(bool)
        replaced = [tuple(grid.effect.replaces()) for grid in grids]
        for rows, change in out._changes():
            beat()
            say(float(rows[-1] + 1) / n if len(rows) else 1.0)
            full, low = change[:, look.full_band], change[:, ~look.full_band]
            full[np.abs(full).max(axis=1, initial=0.0) * np.maximum(most[rows], 1.0) < ROUNDING] = 0.0
            out.low[rows] = look.low_levels(low, most[rows], one_sided[rows])
            if changes:
                out.changes[rows] = full
            groups: dict[tuple[ParameterRef, ...], list[int]] = {}
            for k, i in enumerate(rows):
                groups.setdefault(replaced[out.owner[i]], []).append(k)
            for without, some in groups.items():
                i = rows[some]
                out._judge(i, full[some], without, most[i], one_sided[i])
        return out

    def _judge(
        self,
        rows: Ints,
        change: Complexes,
        replaced: tuple[ParameterRef, ...],
        most: Floats,
        one_sided: NDArray[np.bool_],
    ) -> None:
        """Write what changes (n, m) of the residuals by effects that replace the same parameters do."""
        look, m = self.look, len(self.look.share)
        now = look.adapted(look.now[None], replaced, look.off)[0]
        moved = look.adapted(change, replaced)
        self.cost[rows], self.factor[rows] = look.best_multiples(now, moved, most, one_sided)
        of_groups, known = np.abs(moved[:, :m]) ** 2 @ look.share, moved[:, m:].real
        self.squares[rows] = np.column_stack([of_groups, 0.5 * (known**2).sum(axis=1)])
        v, y = look.whitened(moved), look.whitened(now[None])[0]
        square, a = (v**2).sum(axis=1), self.factor[rows]
        self.precision[rows] = np.sqrt(square)
        self.share[rows] = -a * (2 * (v @ y) + a * square) / max(float(y @ y), LEAST_SQUARE)
        if len(self.vectors):
            self.vectors[rows] = v

    def _changes(self) -> Iterator[tuple[Ints, Complexes]]:
        """Yield rows and the changes of all residuals there, of some candidates at a time."""
        changed = self._change(self.look.fields())
        ends = np.searchsorted(self.owner, np.arange(len(self.littles) + 1))
        first = 0
        while first < len(self.littles):
            last = max(int(np.searchsorted(ends, ends[first] + TOGETHER, "right")) - 1, first + 1)
            none = np.zeros((0, len(self.look.at)), complex)
            yield (
                np.arange(ends[first], ends[last]),
                np.concatenate([none, *map(changed, self.littles[first:last])]),
            )
            first = last

    def _change(self, fields: Fields) -> Callable[[Little], Complexes]:
        """Return a function that gives the changes of all residuals by a little of a candidate.

        What releases a constraint, or replaces a parameter that is uncertain, has no small element matrices.
        """
        look, model = self.look, self.look.problem.reduced.model

        def change(little: Little) -> Complexes:
            effect = little.grid.effect
            if effect.released() or little.absent is not None:
                return look.small_changes(little)
            slopes = [
                fields.slope(model.parts_of(effect.with_values(**point)), effect.connection)
                for point in little.points
            ]
            return look.first_order(np.stack(slopes)) if slopes else np.zeros((0, len(look.at)), complex)

        return change

    @property
    def candidates(self) -> tuple[Effect, ...]:
        """The candidates."""
        return tuple(little.grid.effect for little in self.littles)

    @cached_property
    def gains(self) -> Floats:
        """Gains in log likelihood by the best multiple, (n,): -∞ of what the data do not see [nats]."""
        return self.look.cost_now - self.cost

    @cached_property
    def best_gains(self) -> Floats:
        """The largest gain of each candidate over its places, (n_candidates,) [nats]."""
        return self._over_places(np.maximum, self.gains)

    @property
    def best_shares(self) -> Floats:
        """The largest share of each candidate over its places, (n_candidates,) [-]."""
        return np.maximum(self._over_places(np.maximum, self.share), 0.0)

    @cached_property
    def log_evidence(self) -> Floats:
        """Ln of the likelihood ratio over nothing, averaged over sizes and places, (n_candidates,).

        Of what the data do not see it is 0: its probability is that beforehand.
        """
        each = np.zeros(len(self.owner))
        for i in np.flatnonzero(np.isfinite(self.gains) & (self.precision > 0)):
            sizes = self._sizes[int(self.owner[i])]
            share = sizes.log_share(int(self.place[i]), float(self.factor[i]), 1 / float(self.precision[i]))
            each[i] = max(float(self.gains[i]), 0.0) + share
        n_each = np.bincount(self.owner, minlength=len(self.littles))
        return self._over_places(np.logaddexp, each) - np.log(np.maximum(n_each, 1))

    @cached_property
    def _sizes(self) -> dict[int, Sizes]:
        seen = np.unique(self.owner[np.isfinite(self.gains)])
        return {int(k): Sizes.of(self.look.problem, self.littles[k]) for k in seen}

    def _over_places(self, together: np.ufunc, each: Floats) -> Floats:
        out = np.full(len(self.littles), -np.inf)
        together.at(out, self.owner, each)
        return out

    def effect_at(self, i: int, factor: float) -> Effect:
        """Return a candidate at one of its places and at a multiple of its little there."""
        little = self.littles[self.owner[i]]
        return little.grid.effect.with_values(**little.values(int(self.place[i]), factor))


def n_lines(problem: FitProblem) -> int:
    """Return at how many lines the responses of all DOFs are kept."""
    frf = problem.data.measurement.frf
    responses = problem.reduced.model.n_dof * (len(frf.outputs) + len(frf.inputs))
    return min(FULL_LINES, max(MOST_RESPONSES // responses, LEAST_LINES))
