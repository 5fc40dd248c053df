"""What each of many candidates would do to the data of a fit: gain, standard deviation, likeness.

To first order in the effect and in all that varies with it. What uncertain parameters, the form, damping and
channels could do of the change by a little of an effect is taken away with their priors. The rest, v in
whitened residuals, makes the effect known to ± 1/|v|: of size a it gains ½ (a |v|)² nats over a model without
it, and of that the share 1 - cos² over one with another effect.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from fem.array_types import Bools, Ints
from fem.model import Effect, ParameterRef, parameter_values
from updating.forecast.grid import Grid, Little
from updating.forecast.look import Complexes, Floats, Look, sizes_of
from updating.forecast.sizes import Sizes
from updating.inference.fit_result import FitResult
from updating.inference.heartbeat import beat
from updating.inference.problem import Problem
from updating.inference.unknowns import effect_unknowns, prior_of

MOST_VALUES, MOST_COMPARED = 10_000, 3_000
"""Largest number of values of FRFs that are used for gains, and where changes are kept to be compared."""
ROUNDING = 1e-9
"""Changes of residuals by the largest plausible size below this are none [nepers]."""
STEP = 1e-3
"""Step of differences by a parameter, in parts of its prior deviation or of a size [-]."""
SMALL_SHARE = 0.01
"""A size is forecast by the slope at this share of it [-]."""
TOGETHER = 64
"""Number of small changes that are judged at once."""


@dataclass(frozen=True, slots=True, eq=False)
class EffectEstimate:
    """What a fit with a candidate would find, to the first order.

    Attributes
    ----------
    effect : Effect
        The candidate.
    values, std : dict
        Of its parameters; those that it was proposed with, and ∞, where the data do not see it.
    log_evidence : float
        Ln of the likelihood ratio over a model without it, averaged over sizes and places.
    """

    effect: Effect
    values: dict[str, float]
    std: dict[str, float]
    log_evidence: float


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
        Negative log posterior that the best multiple leaves of the data, infinite where the data do not see
        the largest plausible one, and that multiple.
    evidence, sharpness : ndarray (n,)
        By how much the best multiple raises the log evidence, were its size known, and 1 / standard deviation
        of the multiple at the level of error that it leaves.
    share : ndarray (n,)
        Part of the sum of the squared whitened residuals that the best multiple takes away [-].
    low : ndarray (n,)
        Level on the low band that is left.
    vectors : ndarray (n, r)
        What a model without the effect leaves of its change, where it was asked for: v, unless the effect
        replaces an uncertain parameter.
    moved : ndarray (n, n_refs)
        How far uncertain parameters move against the change there, where vectors were asked for.
    changes : ndarray (n, m)
        Changes of the weighted residuals of the full band, where they were asked for.
    """

    look: Look[Any, Any]
    littles: tuple[Little, ...]
    owner: Ints
    place: Ints
    squares: Floats
    precision: Floats
    cost: Floats
    factor: Floats
    evidence: Floats
    sharpness: Floats
    share: Floats
    low: Floats
    vectors: Floats = field(repr=False)
    moved: Floats = field(repr=False)
    changes: Complexes = field(repr=False)

    @classmethod
    def at(
        cls,
        problem: Problem[Any],
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
        look = Look.of(problem, base, None, 0, most, besides, bounded=bounded)
        grids = [Grid.of(problem, e) for e in candidates]
        return cls.of(look, grids, n_places=n_places, vectors=vectors, say=say)

    @classmethod
    def several(
        cls, problem: Problem[Any], base: FitResult, grids: Sequence[Grid], *, n_places: int = 0
    ) -> "list[Forecast]":
        """Return forecasts at a fit by each look of :meth:`Look.several`."""
        return cls._by_looks(Look.several(problem, base, None, 0, MOST_VALUES), grids, n_places)

    @classmethod
    def of(
        cls,
        look: Look[Any, Any],
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
        (out,) = cls._by_looks((look,), grids, n_places, vectors, changes, say)
        return out

    @classmethod
    def _by_looks(
        cls,
        looks: Sequence[Look[Any, Any]],
        grids: Sequence[Grid],
        n_places: int,
        vectors: bool = False,
        changes: bool = False,
        say: Callable[[float], None] = lambda done: None,
    ) -> "list[Forecast]":
        """Return forecasts by looks at one fit, which see the same changes and weight them differently."""
        littles = tuple(Little.of(grid, looks[0].base.values, n_places) for grid in grids)
        n_each = [len(little.points) for little in littles]
        every = [cls._empty(look, littles, n_each, vectors, changes) for look in looks]
        n, first = sum(n_each), every[0]
        most = np.concatenate([np.zeros(0), *(little.most for little in littles)])
        one_sided = np.repeat([grid.one_sided() for grid in grids], n_each).astype(bool)
        replaced = [tuple(grid.effect.replaces()) for grid in grids]
        full_band = looks[0].residuals.full_band
        for rows, change in first._changes():
            beat()
            say(float(rows[-1] + 1) / n if len(rows) else 1.0)
            full, low = change, change[:, :0]
            if not full_band.all():
                full, low = change[:, full_band], change[:, ~full_band]
            full[np.abs(full).max(axis=1, initial=0.0) * np.maximum(most[rows], 1.0) < ROUNDING] = 0.0
            theirs = [replaced[k] for k in first.owner[rows]]
            for out in every:
                out.low[rows] = out.look.low_levels(low, most[rows], one_sided[rows])
                if changes:
                    out.changes[rows] = full
                out._judge(rows, full, theirs, most[rows], one_sided[rows])
        return every

    @classmethod
    def _empty(
        cls,
        look: Look[Any, Any],
        littles: tuple[Little, ...],
        n_each: Sequence[int],
        vectors: bool,
        changes: bool,
    ) -> "Forecast":
        n, m = sum(n_each), len(look.share)
        return cls(
            look,
            littles,
            np.repeat(np.arange(len(littles)), n_each),
            np.concatenate([np.arange(0), *(np.arange(k) for k in n_each)]).astype(np.int64),
            np.empty((n, look.share.shape[1] + 1)),
            precision=np.empty(n),
            cost=np.empty(n),
            factor=np.empty(n),
            evidence=np.empty(n),
            sharpness=np.empty(n),
            share=np.empty(n),
            low=np.empty(n),
            vectors=np.empty((n if vectors else 0, look.slopes.shape[1])),
            moved=np.empty((n if vectors else 0, len(look.refs))),
            changes=np.empty((n if changes else 0, m), dtype=complex),
        )

    def _judge(
        self,
        rows: Ints,
        change: Complexes,
        replaced: Sequence[tuple[ParameterRef, ...]],
        most: Floats,
        one_sided: Bools,
    ) -> None:
        """Write what changes (n, m) of the residuals by effects that replace some parameters do."""
        look, m = self.look, len(self.look.share)
        every = list(dict.fromkeys(replaced))
        which = [every.index(refs) for refs in replaced]
        each = look.adapted_each(np.tile(look.now, (len(every), 1)), every, look.off)
        now, to_take = each[which], ((np.abs(each) ** 2) @ look.weights)[which]
        moved = look.adapted_each(change, replaced)
        a, square, slope = look.best_multiples(now, moved, most, one_sided)
        self.factor[rows] = a
        seen = look.sees(most[:, None] * moved, look.resolution)
        parts = look.parts(now + a[:, None] * moved)
        self.cost[rows] = np.where(seen, look.stated_costs(*parts), np.inf)
        nothing = np.maximum(
            look.log_evidence(*look.parts(each)),
            look.log_evidence(*look.parts(look.unadapted[None])),
        )
        self.evidence[rows] = look.log_evidence(*parts) - nothing[which]
        self.sharpness[rows] = look.sharpness(moved, parts[0])
        # A model without the effect varies the parameter that the effect replaces, within its prior.
        beyond, replacing = moved, np.flatnonzero([bool(refs) for refs in replaced])
        if len(replacing):
            beyond = moved.copy()
            beyond[replacing] = look.adapted(change[replacing])
        of_groups, known = np.abs(beyond[:, :m]) ** 2 @ look.share, beyond[:, m:].real
        self.squares[rows] = np.column_stack([of_groups, 0.5 * (known**2).sum(axis=1)])
        self.precision[rows] = np.sqrt(square)
        # A sum of squared residuals below this is none
        self.share[rows] = -a * (2 * slope + a * square) / np.maximum(to_take, 1e-300)
        if len(self.vectors):
            self.vectors[rows] = look.whitened(beyond)
            self.moved[rows] = look.moved(change)

    def _changes(self) -> Iterator[tuple[Ints, Complexes]]:
        """Yield rows and the changes of all residuals there, of some candidates at a time."""
        changed = self._change()
        ends = np.searchsorted(self.owner, np.arange(len(self.littles) + 1))
        first = 0
        while first < len(self.littles):
            last = max(int(np.searchsorted(ends, ends[first] + TOGETHER, "right")) - 1, first + 1)
            yield np.arange(ends[first], ends[last]), changed(self.littles[first:last])
            first = last

    def _change(self) -> Callable[[Sequence[Little]], Complexes]:
        """Return a function that gives the changes of all residuals by a little of some candidates."""
        look, slopes = self.look, self._slopes

        def change(littles: Sequence[Little]) -> Complexes:
            linear = [look.residuals.has_slope(o.grid.effect) for o in littles]
            parts = iter(slopes([o for o, is_linear in zip(littles, linear, strict=True) if is_linear]))
            each = [
                next(parts) if is_linear else look.small_changes(o)
                for o, is_linear in zip(littles, linear, strict=True)
            ]
            return np.concatenate([np.zeros((0, len(look.residuals.now)), complex), *each])

        return change

    @cached_property
    def _slopes(self) -> Callable[[Sequence[Little]], list[Complexes]]:
        return self.look.slopes_by()

    @cached_property
    def candidates(self) -> tuple[Effect, ...]:
        """The candidates."""
        return tuple(little.grid.effect for little in self.littles)

    @cached_property
    def gains(self) -> Floats:
        """Gains in log likelihood by the best multiple, (n,): -∞ of what the data do not see [nats]."""
        return self.look.stated_now - self.cost

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
        for i in np.flatnonzero(np.isfinite(self.cost) & (self.sharpness > 0)):
            sizes = self.sizes[int(self.owner[i])]
            share = sizes.log_share(int(self.place[i]), float(self.factor[i]), 1 / float(self.sharpness[i]))
            each[i] = float(self.evidence[i]) + share
        n_each = np.bincount(self.owner, minlength=len(self.littles))
        return self._over_places(np.logaddexp, each) - np.log(np.maximum(n_each, 1))

    @cached_property
    def sizes(self) -> dict[int, Sizes]:
        """Priors of the sizes of the candidates that the data see."""
        seen = np.unique(self.owner[np.isfinite(self.gains)])
        return {int(k): Sizes.of(self.look.problem, self.littles[k]) for k in seen}

    def best_place(self, k: int) -> int:
        """Return the row of the place at which the k-th candidate leaves least."""
        rows = np.flatnonzero(self.owner == k)
        return int(rows[np.argmin(self.cost[rows])])

    def estimate(self, i: int) -> tuple[dict[str, float], dict[str, float]]:
        """Return the parameter values of a candidate at its best multiple, and their deviations."""
        sizes = self.sizes[int(self.owner[i])]
        return sizes.estimate(
            int(self.place[i]), float(self.factor[i]), 1 / max(float(self.sharpness[i]), 1e-12)
        )

    def estimated(self, k: int) -> EffectEstimate:
        """Return what a fit with the k-th candidate would find."""
        effect, gain = self.candidates[k], float(self.log_evidence[k])
        if not np.isfinite(self.best_gains[k]):
            values = parameter_values(effect)
            return EffectEstimate(effect, values, dict.fromkeys(values, np.inf), gain)
        return EffectEstimate(effect, *self.estimate(self.best_place(k)), gain)

    def std(self, k: int, values: Mapping[str, float]) -> float:
        """Return the standard deviation of the first parameter of the k-th candidate at given values.

        With its other parameters free, such as its position, as in a fit with it; infinite where the data do
        not see it [unit of the parameter].
        """
        grid, absent, point = self.littles[k].grid, self.littles[k].absent, dict(values)
        name = grid.effect.parameters()[0].name
        low, high = (grid.scaled(point, 1 + s * STEP, absent)[name] for s in (-1, 1))
        precision = self._precision_at(k, point)
        return abs(high - low) / (2 * STEP) / precision if precision > 0 else np.inf

    def _precision_at(self, k: int, point: dict[str, float]) -> float:
        """Return 1 / standard deviation of multiples of a size with all parameters of the effect free."""
        look, grid, absent = self.look, self.littles[k].grid, self.littles[k].absent
        effect = grid.effect
        pairs: list[dict[str, float]] = []
        widths: list[float] = []
        for unknown in effect_unknowns((effect,), (point,))[1:]:
            name, prior = unknown.ref[1], prior_of(look.problem, effect, unknown)
            x, (lower, upper) = unknown.to_x(point[name]), unknown.bounds()
            ends = [min(max(x + s * STEP * prior.std, lower), upper) for s in (-1, 1)]
            if ends[1] > ends[0] and prior.std > 0:
                pairs += [{**point, name: unknown.to_value(end)} for end in ends]
                widths.append((ends[1] - ends[0]) / prior.std)
        one = (grid.scaled(point, SMALL_SHARE, absent),)
        if look.residuals.has_slope(effect):
            each = self._slopes([Little(grid, (*one, *pairs), absent, np.ones(len(pairs) + 1))])[0]
        else:
            each = look.small_changes(Little(grid, one, absent, np.ones(1)))
            each = np.concatenate([each, *([look.all_changes(Grid(effect, tuple(pairs)))] if pairs else [])])
        moved = each[:, look.residuals.full_band]
        # By a multiple of the size, and by a prior deviation of each of the others, of which 1 is known.
        moved[0] /= SMALL_SHARE
        moved[1:] /= np.repeat(widths, 2)[:, None]
        v, *others = look.whitened(look.adapted(moved, effect.replaces()))
        square = float(v @ v)
        if others:
            G = np.array(others[1::2]) - np.array(others[::2])
            b = G @ v
            square -= float(b @ np.linalg.solve(G @ G.T + np.eye(len(G)), b))
        return float(np.sqrt(max(square, 0.0)))

    def squares_at(self, rows: Ints, multiples: Floats) -> tuple[Floats, Floats]:
        """Return what sizes do as they are, rather than multiples of a change.

        ``squares`` of the changes solved for, (n_rows, n_groups + 1), and how many times as strongly as a
        little the sizes act on the heavily damped model, (n_rows,). Not a number where the parameters have no
        such value.
        """
        look = self.look
        m, full_band = len(look.share), look.residuals.full_band
        out, effective = np.full((len(rows), self.squares.shape[1]), np.nan), np.full(len(rows), np.nan)
        some: list[int] = []
        changes: list[Complexes] = []
        for k in np.unique(self.owner[rows]):
            little = self.littles[k]
            every, places = np.flatnonzero(self.owner[rows] == k).tolist(), self.place[rows].tolist()
            each = [(n, places[n], little.side(places[n], float(multiples[n]))) for n in every]
            each = [(n, at, a) for n, at, a in each if np.isfinite(a)]
            if each:
                beat()
                these, at = [n for n, *_ in each], [place for _, place, _ in each]
                sizes = sizes_of(little, [(place, a) for _, place, a in each])
                changes.append(look.changes_at(sizes)[:, full_band])
                effective[these] = look.heavily_damped.strengths(little, at, sizes)
                some += these
        if some:
            beyond = look.adapted(np.concatenate(changes))
            of_groups, known = np.abs(beyond[:, :m]) ** 2 @ look.share, beyond[:, m:].real
            out[some] = np.column_stack([of_groups, 0.5 * (known**2).sum(axis=1)])
        return out, effective

    def _over_places(self, together: np.ufunc, each: Floats) -> Floats:
        out = np.full(len(self.littles), -np.inf)
        together.at(out, self.owner, each)
        return out

    def effect_at(self, i: int, factor: float) -> Effect:
        """Return a candidate at one of its places and at a multiple of its little there."""
        little = self.littles[self.owner[i]]
        return little.grid.effect.with_values(**little.values(int(self.place[i]), factor))
