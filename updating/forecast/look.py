"""What candidates would do to the data of a fit: exact in the effect, first order in all that varies with it.

Nothing is refitted here. Each candidate's grid is projected on the reduced basis once; after that a point of
the grid costs what its few DOFs cost. Kinds of data differ in their changes of residuals alone, see
:mod:`updating.inference.problem`.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Generic, TypeVar

import numpy as np

from fem.array_types import Bools, Complexes, Floats
from fem.model import ParameterRef
from fem.recent import Recent
from fem.reduction.scaling import scale_factors
from fem.reduction.series import negative, terms_in_series
from fem.reduction.terms import ReducedTerm
from updating.forecast.grid import WEAKER, Grid, Little
from updating.forecast.information import SMALL, learned
from updating.inference.fit_data import SYSTEMATIC_FROM
from updating.inference.fit_function import ROBUST
from updating.inference.fit_result import FitResult
from updating.inference.fitting import FULL_LINES
from updating.inference.heartbeat import beat
from updating.inference.mode_fit import DOUBT
from updating.inference.problem import Problem, ResidualChanges
from updating.least_squares.costs import pseudo_huber, pseudo_huber_weight

RELEASED = 0.01
"""A constraint counts as released, and hardly giving way, at this share of a size [-]."""
EXPLAINED_TOGETHER = 16
"""Number of candidates whose grids are adapted to at once."""
KEPT_LENGTHS = 100
"""Number of candidates of which the lengths of a little are kept: their sizes are solved for in turns."""


P = TypeVar("P", bound=Problem[Any])
C = TypeVar("C", bound=ResidualChanges)


def candidate_terms(problem: Any, base: FitResult, grid: Grid) -> tuple[ReducedTerm, ...]:
    """Return what the effect adds at the points, on members and joints as a fit has them.

    A hinge takes away all the stiffness that its member has there: of one that is by 1 % stiffer than
    nominal 1 % would be left, which is much of a short element's. A parameter that the effect replaces is
    back at its nominal value, of which the effect is a change.
    """
    reduced, effect = problem.reduced, grid.effect
    nominal = reduced.nominal
    points = [effect.with_values(**p) for p in grid.points]
    if (series := terms_in_series(reduced, points, base.effects, base.values)) is not None:
        moduli = [r for r in effect.refers_to(reduced.model) if r[1].startswith("E:") and r in base.values]
        stiffer = float(np.prod([base.values[ref] / nominal[ref] for ref in moduli]))
        return tuple(replace(term, stiffer=stiffer) for term in series)
    ratio = {
        ref: base.values[ref] / nominal[ref]
        for ref in effect.refers_to(reduced.model)
        if nominal.get(ref) and base.values.get(ref, nominal[ref]) != nominal[ref]
    }
    replaced = {ref: base.values[ref] for ref in effect.replaces() if ref in base.values}
    if back := [ref for ref, value in replaced.items() if value != nominal.get(ref, value)]:
        model = reduced.model.with_values({ref: base.values[ref] for ref in ratio})
        fitted, owners = model.with_values(replaced), dict.fromkeys(name for name, _ in back)
        same = [c for name in owners for c in model.parts_of(model.effect(name))]
        same += [negative(c) for name in owners for c in fitted.parts_of(fitted.effect(name))]
        each = (reduced.project([*model.parts_of(e), *same]) for e in points)
        return tuple(replace(term, connection=effect.connection) for term in each)
    if not ratio:
        return grid.terms(problem)
    stiffer = float(np.prod([f for (_, name), f in ratio.items() if name.startswith("E:")]))
    changes = []
    for ref, f in ratio.items():
        if (exponents := reduced.scaling_of(effect, ref)) is None:
            break
        changes.append((f, exponents))
    if len(changes) == len(ratio):
        factors = scale_factors(changes)
        terms = [t.scaled(factors) for t in grid.terms(problem)]
    else:
        model = reduced.model.with_values({ref: base.values[ref] for ref in ratio})
        terms = [reduced.value_of(effect.with_values(**p), model) for p in grid.points]
    return tuple(replace(t, stiffer=stiffer) for t in terms)


def sizes_of(little: Little, sizes: Sequence[tuple[int, float]]) -> Grid:
    """Return multiples of a little at places; of what releases a constraint, hardly any of it as well."""
    points = [little.values(k, a) for k, a in sizes]
    if little.grid.effect.released():
        # A share of the size is no good: 1 % of a foot that is nearly free gives way, too.
        points += [little.values(k, float(np.clip(a, -1, 1)) * RELEASED) for k, a in sizes]
    return Grid(little.grid.effect, tuple(points))


@dataclass(frozen=True, slots=True, eq=False)
class SmallChange(Little):
    """What a little of each place of a candidate does.

    Attributes
    ----------
    change : ndarray (n_points, m)
        Of the weighted residuals; 0 where it cannot be or is not seen.
    """

    change: Complexes


@dataclass(eq=False)
class Look(Generic[P, C]):
    """A fitted model with all but the candidates fixed, m residuals, and what adapts to their changes.

    Prior knowledge counts as more residuals behind those of the data.

    Attributes
    ----------
    problem : Problem
    residuals : ResidualChanges
        What effects do to the residuals of this kind of data.
    share : ndarray (m, n_groups)
        Takes the mean over the residuals of each group.
    likelihood : Costs
        That of a full fit, by mean squares of the groups.
    squares, to_come : ndarray (n_groups,)
        Robust mean squares of the groups at the fit, and those that data which are still to come will add.
    robust : ndarray (m,)
        What each residual counts in its group.
    refs : tuple of ParameterRef
    slopes : ndarray (n, 2 m + n_all)
        Of all residuals by the nuisance parameters ``refs``, by damping, and by small deviations; real and
        imaginary parts stand side by side.
    prior_of : tuple of ParameterRef
        Nuisance parameters, those at a bound too.
    off : ndarray (n_all,)
        How far each unknown is from its prior mean, in deviations.
    all_belong : bool
        Whether changes are weighted as if no reading were a bad one: those that seem so may be what is
        missing.
    """

    problem: P
    residuals: C
    share: Floats
    likelihood: Any
    squares: Floats
    to_come: Floats
    robust: Floats
    refs: tuple[ParameterRef, ...]
    slopes: Floats
    prior_of: tuple[ParameterRef, ...]
    off: Floats
    all_belong: bool = False
    # Looks at one fit that weight readings differently share the changes of a grid, and of a little of it.
    _last: Recent = field(default_factory=lambda: Recent(2), repr=False)
    _last_little: Recent = field(default_factory=lambda: Recent(1), repr=False)
    _last_terms: Recent = field(default_factory=lambda: Recent(1), repr=False)
    _lengths: Recent = field(default_factory=lambda: Recent(KEPT_LENGTHS), repr=False)

    @classmethod
    def of(
        cls,
        problem: Problem[Any],
        base: FitResult,
        n_full: int | None,
        n_low: int,
        most: int,
        besides: float | None = None,
        *,
        bounded: bool = True,
    ) -> "Look[Any, Any]":
        """Look from where the base is; ``n_full``, ``n_low``, ``most`` as of :meth:`Problem.changes_at`.

        Data that are still to come will leave noise and ``besides`` [nepers]. Unless ``bounded`` uncertain
        parameters vary that are at a bound as well: with other data they would not be.
        """
        residuals = problem.changes_at(base, n_full, n_low, most)
        function, x, some = residuals.function, residuals.x, residuals.some
        r, J = function(x, True)
        assert J is not None
        r, J = r[some], J[:, some]
        group = np.unique(function.groups, return_inverse=True)[1][some]
        share = np.eye(group.max(initial=0) + 1)[group]
        share /= np.maximum(share.sum(axis=0), 1.0)
        likelihood = function.levels(counted_as=FULL_LINES)
        more = 0.0 if besides is None else 1 / SYSTEMATIC_FROM**2
        prior = function.prior()
        known = np.where(np.isfinite(prior.std), 1 / prior.std, 0.0)
        # What is at its bound moves no farther.
        low_bound, high_bound = function.limits().T
        # A parameter this near its bound, in its standard deviations, is at it [-]
        near = 0.01 * np.where(np.isfinite(prior.std), prior.std, 0.0)
        free = (x > low_bound + near) & (x < high_bound - near)
        free |= not bounded
        return Look(
            problem=problem,
            residuals=residuals,
            share=share,
            likelihood=likelihood,
            squares=pseudo_huber(r, ROBUST) @ share,
            to_come=more * likelihood.noise + (besides or 0.0) ** 2,
            robust=pseudo_huber_weight(r, ROBUST),
            refs=tuple(v.ref for v, is_free in zip(function.variables, free, strict=False) if is_free),
            slopes=np.hstack([J.real, J.imag, np.diag(known)])[free],
            prior_of=tuple(v.ref for v in function.variables),
            off=known * np.where(known > 0, x - prior.mean, 0.0),
        )

    @classmethod
    def several(
        cls, problem: Problem[Any], base: FitResult, n_full: int | None, n_low: int, most: int
    ) -> "tuple[Look[Any, Any], ...]":
        """Return a look and, where any reading seems to be a bad one, the same as if none were."""
        look = cls.of(problem, base, n_full, n_low, most)
        return (look, look.with_all_readings()) if look.is_doubtful else (look,)

    @property
    def level(self) -> Floats:
        """Mean squares of the groups by which residuals are weighted, (n_groups,)."""
        return self.squares + self.to_come

    @property
    def is_doubtful(self) -> bool:
        """Whether any reading seems to be a bad one."""
        return bool((self.likelihood.is_bad(self.level) > DOUBT).any())

    def with_all_readings(self) -> "Look[P, C]":
        """Return the look with changes weighted as if no reading were a bad one."""
        return replace(self, all_belong=True)

    @property
    def base(self) -> FitResult:
        """The fit."""
        return self.residuals.base

    @property
    def _weighing(self) -> Any:
        return self.likelihood.believed if self.all_belong else self.likelihood

    @cached_property
    def trust(self) -> Floats:
        """What each real residual counts by the likelihood, (2 m + n_all,)."""
        weight = self.robust * (self.share @ self._weighing.weight(self.level))
        return np.concatenate([weight, weight, np.ones(len(self.off))])

    def levels(self, grid: Grid) -> Floats:
        """Return the cost on the full band with nuisances adapted, and the level on the low band.

        Shape (2, n_points); one row if the low band has no lines. Infinite where there is no structure, and
        everywhere if the data see none of the points.
        """
        change = self._changes(grid)
        possible = _finite_rows(change)
        change = np.where(possible[:, None], change, 0.0)
        r, full = self.residuals.now + change, self.residuals.full_band
        every = [self.costs(self.adapted(r[:, full], grid.effect.replaces(), self.off))]
        every += [] if full.all() else [level(r[:, ~full])]
        levels = np.where(possible, np.stack(every), np.inf)
        seen = self.sees(change, self.residuals.resolution).any()
        return levels if seen else np.full_like(levels, np.inf)

    def least_stated_cost(self, grid: Grid) -> float:
        """Return the least cost on the full band of a candidate's points where any reading may be a bad one.

        Nuisances adapt as this look weights readings. Infinite where there is no structure at any point.
        """
        change = self._changes(grid)
        r = (self.residuals.now + change[_finite_rows(change)])[:, self.residuals.full_band]
        adapted = self.adapted(r, grid.effect.replaces(), self.off)
        return float(self.stated_costs(*self.parts(adapted)).min(initial=np.inf))

    def explained(self, grids: Sequence[Grid]) -> Floats:
        """Return the parts of the squared whitened residuals that candidates take away at best, (n,) [-].

        Of a candidate that leaves more everywhere it is negative.
        """
        out = np.empty(len(grids))
        for first in range(0, len(grids), EXPLAINED_TOGETHER):
            some = grids[first : first + EXPLAINED_TOGETHER]
            changes = [self._changes(grid)[:, self.residuals.full_band] for grid in some]
            replaced = [tuple(grid.effect.replaces()) for grid in some]
            # behind all points of the grids the residuals as they are, beside what each of them replaces
            each = np.concatenate([*changes, np.zeros((len(some), len(self.share)), dtype=complex)])
            possible = _finite_rows(each)
            beside = [refs for refs, change in zip(replaced, changes, strict=True) for _ in change] + replaced
            rest = self.adapted_each(self.now + np.where(possible[:, None], each, 0.0), beside, self.off)
            left = np.where(possible, np.abs(rest) ** 2 @ self.weights, np.inf)
            *of_points, now = np.split(left, np.cumsum([len(change) for change in changes]))
            least = np.array([points.min(initial=np.inf) for points in of_points])
            out[first : first + len(some)] = np.where(now > 0, 1 - least / np.where(now > 0, now, 1.0), 0.0)
        return out

    def best_of_little(self, grid: Grid) -> tuple[float, dict[str, float]]:
        """Return the cost of the best multiple of what a little of a candidate does, and its values there.

        Infinite where that is not seen.
        """
        little, replaced = self.little(grid), grid.effect.replaces()
        now = self.adapted(self.now[None], replaced, self.off)[0]
        change = self.adapted(little.change, replaced)
        factors, *_ = self.best_multiples(now, change, little.most, grid.one_sided())
        moved = factors[:, None] * change
        costs = np.where(self.sees(moved, self.resolution), self.costs(now + moved), np.inf)
        k = int(np.argmin(costs))
        return float(costs[k]), little.values(k, float(factors[k]))

    def best_multiples(
        self, now: Complexes, change: Complexes, most: Floats, one_sided: bool | Bools
    ) -> tuple[Floats, Floats, Floats]:
        """Return the best multiples of adapted changes, (n,), within ± ``most`` or from 0 to it.

        And the squares of the whitened changes, (n,), and their products with the residuals, (n,).
        """
        return _best_multiples(now, change, most, one_sided, self.weights)

    def sees(self, change: Complexes, resolution: Floats) -> Bools:
        """Return which changes (n, m or more) any residual sees, (n,)."""
        return np.asarray((np.abs(change[:, : len(resolution)]) >= resolution).any(axis=1), dtype=np.bool_)

    @cached_property
    def resolution(self) -> Floats:
        """Changes of the residuals of the full band below these are not seen, (m,)."""
        return self.residuals.resolution[self.residuals.full_band]

    def little(self, grid: Grid) -> SmallChange:
        """Return the slopes of the residuals of the full band by a candidate."""
        return self._last_little.get(grid, lambda: self._little(grid))

    def _little(self, grid: Grid) -> SmallChange:
        little = Little.of(grid, self.base.values)
        change = self.small_changes(little)[:, self.residuals.full_band]
        return SmallChange(grid, little.points, little.absent, little.most, change)

    def small_changes(self, little: Little) -> Complexes:
        """Return the changes of all residuals by a little of a candidate, (n_points, m).

        Of what releases a constraint, the slope: a basis that holds the constraint and one that lets it give
        way hardly differ by more than a little flexibility does.
        """
        effect = little.grid.effect
        if self.residuals.has_cheap_slopes and self.residuals.has_slope(effect):
            return self.slopes_by()([little])[0]
        if not effect.released():
            return self.all_changes(Grid(effect, little.points))
        weaker = tuple(little.values(k, WEAKER) for k in range(len(little.points)))
        strong, weak = np.split(self.all_changes(Grid(effect, little.points + weaker)), 2)
        return (strong - weak) / (1 - WEAKER)

    def changes_at(self, sizes: Grid) -> Complexes:
        """Return the changes of all residuals by sizes of :func:`sizes_of`, (n, m).

        Of what releases a constraint, without what letting go alone does: see :meth:`small_changes`.
        """
        changes = self.all_changes(sizes)
        if not sizes.effect.released():
            return changes
        there, released = np.split(changes, 2)
        return there - released

    def strengths(self, little: Little, places: Sequence[int], sizes: Grid) -> Floats:
        """Return how many times as large as those of a little at places the changes by sizes are, (n,)."""
        small = self._lengths.get(little, lambda: np.linalg.norm(self._first_order(little), axis=1))[places]
        return np.linalg.norm(self.changes_at(sizes), axis=1) / np.where(small > 0, small, np.inf)

    def _first_order(self, little: Little) -> Complexes:
        linear = self.residuals.has_slope(little.grid.effect)
        return self._kept_slopes([little])[0] if linear else self.small_changes(little)

    @cached_property
    def _kept_slopes(self) -> Callable[[Sequence[Little]], list[Complexes]]:
        return self.slopes_by()

    @cached_property
    def heavily_damped(self) -> "Look[P, C]":
        """The model in which resonances do not stand out: its changes tell how strongly effects act."""
        return replace(self, residuals=self.residuals.heavily_damped(), _last=Recent(2))

    def slopes_by(self) -> Callable[[Sequence[Little]], list[Complexes]]:
        """Return a function that gives the changes by a little of candidates to the first order.

        Of each candidate (n_points, m). An effect that replaces an uncertain parameter changes the model by
        what it does beyond its own value there: at any other value it shifts sharp resonances by more than
        their width, however little that may be.
        """
        slopes = self.residuals.slopes()

        def of(littles: Sequence[Little]) -> list[Complexes]:
            replacing = [o for o in littles if o.absent is not None]
            points = [(o, p) for o in littles for p in o.points]
            points += [(o, o.values(k, 0.0)) for o in replacing for k in range(len(o.points))]
            every = np.nan_to_num(slopes([o.grid.effect.with_values(**p) for o, p in points]))
            n_each = [len(o.points) for o in (*littles, *replacing)]
            parts = np.split(every, np.cumsum(n_each)[:-1]) if n_each else []
            out, there = parts[: len(littles)], iter(parts[len(littles) :])
            return [a if o.absent is None else a - next(there) for o, a in zip(littles, out, strict=True)]

        return of

    def changes(self, grid: Grid) -> Complexes:
        """Return a candidate's changes of the full band's residuals, (n_points, m); 0 where impossible."""
        return self.all_changes(grid)[:, self.residuals.full_band]

    def all_changes(self, grid: Grid) -> Complexes:
        """Return a candidate's changes of all residuals, (n_points, m); 0 where impossible."""
        change = self._changes(grid)
        return np.where(_finite_rows(change)[:, None], change, 0.0)

    def _changes(self, grid: Grid) -> Complexes:
        """Return a candidate's changes of all residuals, (n_points, m); NaN where impossible."""
        return self._last.get(grid, lambda: self._solved_for(grid))

    def _solved_for(self, grid: Grid) -> Complexes:
        beat()
        terms = self._last_terms.get(grid, lambda: candidate_terms(self.problem, self.base, grid))
        return self.residuals.by_terms(grid.effect.released(), terms)

    def costs(self, r: Complexes) -> Floats:
        """Return the negative log posterior of residuals (n, m + n_all), (n,)."""
        return self.cost_of(*self.parts(r))

    def cost_of(self, v: Floats, known: Floats) -> Floats:
        """Return the negative log posterior of the :meth:`parts` of residuals, (n,)."""
        return self._weighing.costs(v) + known

    def stated_costs(self, v: Floats, known: Floats) -> Floats:
        """Return the same by the stated likelihood, in which any reading may be a bad one, (n,)."""
        return self.likelihood.costs(v) + known

    @cached_property
    def unadapted(self) -> Complexes:
        """Residuals and deviations from the priors before anything adapts, (m + n_all,)."""
        return np.append(self.now, self.off).astype(complex)

    @cached_property
    def stated_now(self) -> float:
        """The same without a candidate: what adapts by other weights than those of the fit need not."""
        each = np.stack([self.adapted(self.now[None], (), self.off)[0], self.unadapted])
        return float(self.stated_costs(*self.parts(each)).min())

    def parts(self, r: Complexes) -> tuple[Floats, Floats]:
        """Return mean squares of the groups (n, n_groups), and half the sum of the priors' squares (n,)."""
        m = len(self.share)
        return pseudo_huber(r[:, :m], ROBUST) @ self.share, 0.5 * (r[:, m:].real ** 2).sum(axis=1)

    def log_evidence(self, v: Floats, known: Floats) -> Floats:
        """Return the log evidence, up to a constant, of the :meth:`parts` of adapted residuals, (n,) [nats].

        Of the stated likelihood. What adapts is known as well as the level of error allows.
        """
        learned, by_group = self.learned
        ratio = self.likelihood.weight(v + self.to_come) / self.likelihood.weight(self.level)
        paid = 0.5 * np.log(1 - learned + ratio @ by_group.T + 1e-12).sum(axis=1)
        return -self.likelihood.costs(v) - known - paid

    def sharpness(self, change: Complexes, v: Floats) -> Floats:
        """Return 1 / standard deviation of the multiples of adapted changes (n, m + n_all), (n,).

        At the level of error of mean squares (n, n_groups).
        """
        m, worth = len(self.share), self.likelihood.weight(v + self.to_come)
        squares = (np.abs(change[:, :m]) ** 2 * self.robust) @ self.share
        return np.sqrt((worth * squares).sum(axis=1) + (change[:, m:].real ** 2).sum(axis=1))

    @cached_property
    def learned(self) -> tuple[Floats, Floats]:
        """What the data say of nuisance parameters, (n,) and (n, n_groups): see :func:`learned`."""
        m = len(self.share)
        worth = self.likelihood.weight(self.level)
        root = np.sqrt(np.tile(self.robust * (self.share @ worth), 2))
        J, known = self.slopes[:, : 2 * m] * root, self.slopes[:, 2 * m :]
        groups = np.tile(self.share > 0, (2, 1)).T
        return learned(np.array([J[:, here] @ J[:, here].T for here in groups]), known @ known.T)

    @property
    def weights(self) -> Floats:
        """What each residual counts, (m + n_all,)."""
        return self.trust[len(self.share) :]

    def whitened(self, r: Complexes) -> Floats:
        """Return residuals (n, m + n_all) as real ones of unit variance, (n, 2 m + n_all)."""
        m = len(self.share)
        root = np.sqrt(np.concatenate([self.weights[:m], self.weights]))
        return np.hstack([r[:, :m].real, r[:, :m].imag, r[:, m:].real]) * root

    def low_levels(self, change: Complexes, most: Floats, one_sided: Bools) -> Floats:
        """Return the levels on the low band with the best multiples of n changes (n, m) of it, (n,)."""
        low_band = ~self.residuals.full_band
        low = self.residuals.now[low_band]
        if not low.size:
            return np.full(len(change), np.inf)
        factors, *_ = _best_multiples(low, change, most, one_sided, pseudo_huber_weight(low, ROBUST))
        moved = factors[:, None] * change
        return np.where(self.sees(moved, self.residuals.resolution[low_band]), level(low + moved), np.inf)

    @property
    def now(self) -> Complexes:
        """The weighted residuals of the full band without a candidate."""
        return self.residuals.now[self.residuals.full_band]

    @cached_property
    def cost_now(self) -> float:
        """The negative log posterior without a candidate."""
        return float(self.costs(self.adapted(self.now[None], (), self.off))[0])

    def adapted(
        self, r: Complexes, replaced: Sequence[ParameterRef] = (), off: Floats | None = None
    ) -> Complexes:
        """Return residuals (n, m) without what a small change of the nuisance parameters explains.

        Behind them stand those of prior knowledge, (n, m + n_all), which begin at ``off`` or, for changes of
        residuals, at 0. Parameters that an effect replaces stay as they are, and nothing is known of them.
        """
        return self.adapted_each(r, [tuple(replaced)] * len(r), off)

    def adapted_each(
        self, r: Complexes, replaced: Sequence[tuple[ParameterRef, ...]], off: Floats | None = None
    ) -> Complexes:
        """Return :meth:`adapted` of residuals (n, m) with effects that replace different parameters."""
        known = np.zeros((len(r), len(self.off))) if off is None else np.tile(off, (len(r), 1))
        alike: dict[tuple[ParameterRef, ...], list[int]] = {}
        for k, refs in enumerate(replaced):
            alike.setdefault(refs, []).append(k)
        for refs, rows in alike.items():
            known[np.ix_(rows, [k for k, ref in enumerate(self.prior_of) if ref in refs])] = 0.0
        m, moved = r.shape[1], self._moved(r, known, alike)
        out = np.empty((len(r), m + known.shape[1]), dtype=complex)
        np.subtract(r, (moved @ self._pairs).view(complex), out=out[:, :m])
        out[:, m:] = known - moved @ self.slopes[:, 2 * m :]
        return out

    def _moved(
        self, r: Complexes, known: Floats, alike: Mapping[tuple[ParameterRef, ...], Sequence[int]]
    ) -> Floats:
        """Return how far nuisance parameters move against residuals (n, m), (n, n_nuisances).

        And against those of prior knowledge (n, n_all), beside parameters that stay, with the rows beside
        which they do.
        """
        C, back, by_prior = self._nuisances
        moved: Floats = np.ascontiguousarray(r).view(float) @ back.T + known @ by_prior.T
        for refs, rows in alike.items():
            if fixed := [k for k, ref in enumerate(self.refs) if ref in refs]:
                by_fixed = np.linalg.solve(C[np.ix_(fixed, fixed)], C[fixed])
                moved[rows] -= moved[np.ix_(rows, fixed)] @ by_fixed
        return moved

    def moved(self, change: Complexes) -> Floats:
        """Return how far the nuisance parameters ``refs`` move against changes of residuals, (n, n_refs)."""
        known = np.zeros((len(change), len(self.off)))
        return self._moved(change, known, {})[:, : len(self.refs)]

    def hidden_by(
        self, lengths: Floats, moved: Floats, sizes: Floats, most: int = 2
    ) -> list[tuple[ParameterRef, int, float]]:
        """Return the nuisance parameters that hide most of a kind of effect, that which hides most first.

        With each comes the place at which the least size is seen if it and those before it are known exactly,
        and by what factor less that is than what is seen there now. If an unknown j that would move by x_j
        stays, the square of what is left rises by x_j² / C_jj, with the covariance C of all that moves.

        Parameters
        ----------
        lengths, moved : ndarray (n,), (n, n_refs)
            Lengths of whitened changes at n places beyond what may vary, and :meth:`moved` of the changes.
        sizes : ndarray (n,)
            Least sizes that are seen, finite.
        """
        n = len(self.refs)
        C, square = self._nuisances[0][:n, :n], (lengths**2)[:, None]
        least = SMALL * C.diagonal()
        fixed, out = list[int](), list[tuple[ParameterRef, int, float]]()
        for _ in range(min(most, n) if len(sizes) else 0):
            by_fixed = np.linalg.solve(C[np.ix_(fixed, fixed)], C[fixed])
            x = moved - moved[:, fixed] @ by_fixed
            known = np.linalg.solve(C[np.ix_(fixed, fixed)], moved[:, fixed].T)
            left = square + (known.T * moved[:, fixed]).sum(axis=1)[:, None]
            rise = x**2 / np.maximum(C.diagonal() - (C[:, fixed] * by_fixed.T).sum(axis=1), least)
            factors = np.sqrt((left + rise) / square)
            after = sizes[:, None] / factors
            after[:, fixed] = np.inf
            place, j = np.unravel_index(int(np.argmin(after)), after.shape)
            fixed.append(int(j))
            out.append((self.refs[j], int(place), float(factors[place, j])))
        return out

    @cached_property
    def _pairs(self) -> Floats:
        """Slopes of the data's residuals, (n, 2 m), with each imaginary part behind its real one."""
        m = len(self.share)
        return (self.slopes[:, :m] + 1j * self.slopes[:, m : 2 * m]).view(float)

    @cached_property
    def _nuisances(self) -> tuple[Floats, Floats, Floats]:
        """Return the covariance C of nuisance parameters, and what takes residuals to their change.

        Those of the data, as of ``_pairs``, and those of prior knowledge.
        """
        m = len(self.share)
        weighted = self._pairs * np.repeat(self.trust[:m], 2)
        A = weighted @ self._pairs.T + self.slopes[:, 2 * m :] @ self.slopes[:, 2 * m :].T
        # each in its own unit: what is known a million times less well than another one counts as well
        size = np.sqrt(np.where(A.diagonal() > 0, A.diagonal(), 1.0))
        A = A / np.outer(size, size) + SMALL * np.eye(len(size))
        C = np.asarray(np.linalg.inv(A), dtype=float) / np.outer(size, size)
        return C, C @ weighted, C @ self.slopes[:, 2 * m :]


def _best_multiples(
    now: Complexes, change: Complexes, most: Floats, one_sided: bool | Bools, weight: Floats
) -> tuple[Floats, Floats, Floats]:
    """Return the best multiples (n,) of changes (n, m) of residuals (m,) or (n, m).

    Within ± ``most`` (n,), or from 0 to it where they are one-sided. Then the weighted squares of the
    changes, and their products with the residuals, (n,) each.
    """
    both = np.repeat(weight, 2)  # of real and imaginary parts
    parts = np.ascontiguousarray(change).view(float)
    size = (parts**2) @ both
    slope = (parts * np.ascontiguousarray(now).view(float)) @ both
    least = np.where(one_sided, 0.0, -most)
    return np.clip(-slope / np.where(size > 0, size, 1.0), least, most), size, slope


def _finite_rows(change: Complexes) -> Bools:
    return np.asarray(np.isfinite(change).all(axis=1), dtype=np.bool_)


def level(r: Complexes) -> Floats:
    """Return the robust level of residuals (n, m) [nepers]."""
    return np.sqrt(pseudo_huber(r, ROBUST).mean(axis=1))
