"""What candidates would do to measured FRFs: exact in the effect, first order in all that varies beside it.

Nothing is refitted here. Each candidate's grid is projected on the reduced basis once; after that a point of
the grid costs what its few DOFs cost.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.model import ParameterRef, parameter_values
from fem.reduction.local_changes import Fields, LocalChanges
from fem.reduction.scaling import scale_factors
from fem.reduction.series import terms_in_series
from fem.reduction.terms import ReducedTerm
from updating.correlation import complex_log
from updating.forecast.grid import WEAKER, Grid, Little
from updating.inference.fit import FitProblem
from updating.inference.fit_data import SYSTEMATIC_FROM
from updating.inference.fit_function import ROBUST
from updating.inference.fit_result import FitResult
from updating.inference.fitting import FULL_LINES
from updating.inference.heartbeat import beat
from updating.least_squares.levels import Levels
from updating.least_squares.loss import pseudo_huber, pseudo_huber_weight

NEAR_BOUND = 0.01
"""A parameter this near its bound, in its standard deviations, is at it [-]."""

VISIBLE = 1e-3
"""Candidates that change the compared FRFs by less than this at every point of their grids are left out: the
directions measured do not see them [nepers]."""

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


def candidate_terms(problem: Any, base: FitResult, grid: Grid) -> tuple[ReducedTerm, ...]:
    """Return what the effect adds at the points, on members and joints as a fit has them.

    A hinge takes away all the stiffness that its member has there: of one that is by 1 % stiffer than
    nominal 1 % would be left, which is much of a short element's.
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
class Look:
    """A model with all but the candidates fixed, at a few lines.

    Of many FRFs not every value is looked at. ``at`` are the flat positions of those that are, in an array
    (n_lines, n_out, n_in), ``measured`` and ``weight`` what belongs to each, and ``full_band`` tells
    which of them stand for the whole band. Prior knowledge counts as more residuals behind these: ``off``
    (n_all,) is how far each nuisance parameter is from its prior mean, in deviations. ``slopes``
    (n, 2 m + n_all) are the slopes of all residuals by the nuisance parameters ``refs`` and by damping, and
    ``trust`` (2 m + n_all,) what each counts by the likelihood; real and imaginary parts stand side by side.
    ``share`` (m, n_groups) takes the mean over the values of each group, whose ``likelihood`` is that of a
    full fit.
    """

    problem: FitProblem
    base: FitResult
    lines: NDArray[np.int64]
    at: NDArray[np.int64]
    measured: Complexes
    weight: Floats
    full_band: NDArray[np.bool_]
    refs: tuple[ParameterRef, ...]
    slopes: Floats
    trust: Floats
    off: Floats
    prior_of: tuple[ParameterRef, ...]
    share: Floats
    likelihood: Levels
    # By the constraints that an effect releases, and by the nuisance parameters that it replaces.
    _solved: dict[tuple[tuple[str, str], ...], LocalChanges] = field(
        default_factory=dict, init=False, repr=False
    )
    _projections: dict[tuple[ParameterRef, ...], Floats] = field(default_factory=dict, init=False, repr=False)

    @classmethod
    def of(
        cls,
        problem: FitProblem,
        base: FitResult,
        n_full: int,
        n_low: int,
        most: int,
        besides: float | None = None,
        *,
        bounded: bool = True,
    ) -> "Look":
        """Look from where the base is.

        Data that are still to come will leave noise and ``besides`` [nepers]. Unless ``bounded`` uncertain
        parameters vary that are at a bound as well: with other data they would not be.
        """
        problem = problem.unloaded(base)
        full = problem.lines_up_to(np.inf, n_full)
        low = problem.lines_up_to(problem.stages[0], n_low)
        function = problem.function(base.effects, [parameter_values(e) for e in base.effects], full)
        x = function.moved_to(base)
        r, J = function(x, True)
        assert J is not None
        some = _some(len(r), most)
        r, J = r[some], J[:, some]
        group = np.unique(function.groups, return_inverse=True)[1][some]
        share = np.eye(group.max(initial=0) + 1)[group]
        share /= np.maximum(share.sum(axis=0), 1.0)
        likelihood = function.levels(counted_as=FULL_LINES)
        assert isinstance(likelihood, Levels)
        to_come = 0.0 if besides is None else likelihood.noise / SYSTEMATIC_FROM**2 + besides**2
        worth = likelihood.weight(pseudo_huber(r, ROBUST) @ share + to_come)
        weight = pseudo_huber_weight(r, ROBUST) * (share @ worth)
        prior = function.prior()
        known = np.where(np.isfinite(prior.std), 1 / prior.std, 0.0)
        off = known * np.where(known > 0, x - prior.mean, 0.0)
        slopes = np.hstack([J.real, J.imag, np.diag(known)])
        trust = np.concatenate([weight, weight, np.ones(len(x))])
        # What is at its bound moves no farther.
        low_bound, high_bound = function.limits().T
        near = NEAR_BOUND * np.where(np.isfinite(prior.std), prior.std, 0.0)
        free = (x > low_bound + near) & (x < high_bound - near)
        free |= not bounded
        slopes = slopes[free]
        prior_of = tuple(v.ref for v in function.variables)
        refs = tuple(v.ref for v, is_free in zip(function.variables, free, strict=False) if is_free)

        data, lines = problem.data, np.concatenate([full, low])
        n_first = int(np.prod(data.mask[full].shape))
        flat = np.flatnonzero(data.mask[lines])
        low_at = flat[flat >= n_first]
        at = np.concatenate([flat[flat < n_first][some], low_at[_some(len(low_at), most)]])
        measured, w = data.H[lines].ravel()[at], data.weight[lines].ravel()[at]
        return cls(
            problem=problem,
            base=base,
            lines=lines,
            at=at,
            measured=measured,
            weight=w,
            full_band=at < n_first,
            refs=refs,
            slopes=slopes,
            trust=trust,
            off=off,
            prior_of=prior_of,
            share=share,
            likelihood=likelihood,
        )

    def levels(self, grid: Grid) -> Floats:
        """Return the cost on the full band with nuisances adapted, and the level on the low band.

        Shape (2, n_points); one row if the low band has no lines.
        """
        r, possible = self._at(grid)
        first, low = r[:, self.full_band], r[:, ~self.full_band]
        every = [self.costs(self.adapted(first, grid.effect.replaces(), self.off))]
        every += [level(low)] if low.size else []
        levels = np.where(possible, np.stack(every), np.inf)
        return levels if np.abs(r - self._now).max(initial=0.0) >= VISIBLE else np.full_like(levels, np.inf)

    def explained(self, grid: Grid) -> float:
        """Return the part of the squared whitened residuals that a candidate takes away at best [-].

        Of a candidate that leaves more everywhere it is negative.
        """
        r, possible = self._at(grid)
        replaced, weight = grid.effect.replaces(), self.weights
        rest = self.adapted(r[:, self.full_band], replaced, self.off)
        left = np.where(possible, np.abs(rest) ** 2 @ weight, np.inf)
        now = float(np.abs(self.adapted(self.now[None], replaced, self.off)[0]) ** 2 @ weight)
        return 1 - float(left.min(initial=np.inf)) / now if now > 0 else 0.0

    def best_of_little(self, grid: Grid) -> tuple[float, dict[str, float]]:
        """Return the cost of the best multiple of what a little of a candidate does, and its values there."""
        little, replaced = self.little(grid), grid.effect.replaces()
        now = self.adapted(self.now[None], replaced, self.off)[0]
        change = self.adapted(little.change, replaced)
        costs, factors = self.best_multiples(now, change, little.most, grid.one_sided())
        k = int(np.argmin(costs))
        return float(costs[k]), little.values(k, float(factors[k]))

    def best_multiples(
        self, now: Complexes, change: Complexes, most: Floats, one_sided: bool | NDArray[np.bool_]
    ) -> tuple[Floats, Floats]:
        """Return the costs that the best multiples of adapted changes leave, and these, (n,)."""
        return _best_multiples(now, change, most, one_sided, self.weights, self.costs, len(self.share))

    def little(self, grid: Grid) -> SmallChange:
        """Return the slopes of the residuals of the full band by a candidate."""
        little = Little.of(grid, self.base.values)
        change = self.small_changes(little)[:, self.full_band]
        return SmallChange(grid, little.points, little.absent, little.most, change)

    def small_changes(self, little: Little) -> Complexes:
        """Return the changes of all residuals by a little of a candidate, (n_points, m).

        Of what releases a constraint, the slope: a basis that holds the constraint and one that lets it give
        way hardly differ by more than a little flexibility does.
        """
        effect = little.grid.effect
        if not effect.released():
            return self.all_changes(Grid(effect, little.points))
        weaker = tuple(little.values(k, WEAKER) for k in range(len(little.points)))
        strong, weak = np.split(self.all_changes(Grid(effect, little.points + weaker)), 2)
        return (strong - weak) / (1 - WEAKER)

    def changes(self, grid: Grid) -> Complexes:
        """Return a candidate's changes of the full band's residuals, (n_points, m); 0 where impossible."""
        return self.all_changes(grid)[:, self.full_band]

    def all_changes(self, grid: Grid) -> Complexes:
        """Return a candidate's changes of all residuals, (n_points, m); 0 where impossible."""
        r, possible = self._at(grid)
        return np.where(possible[:, None], r - self._now, 0.0)

    def _at(self, grid: Grid) -> tuple[Complexes, NDArray[np.bool_]]:
        """Return the residuals of a candidate at its points, and which of them can be."""
        beat()
        terms = candidate_terms(self.problem, self.base, grid)
        return self._possible(self._local(grid.effect.released()).with_terms(terms))

    def costs(self, r: Complexes) -> Floats:
        """Return the negative log posterior of residuals (n, m + n_all), (n,)."""
        m = len(self.share)
        v = pseudo_huber(r[:, :m], ROBUST) @ self.share
        known = 0.5 * (r[:, m:].real ** 2).sum(axis=1)
        return np.array([self.likelihood.cost(each) for each in v]) + known

    @property
    def weights(self) -> Floats:
        """What each residual counts, (m + n_all,)."""
        return self.trust[len(self.share) :]

    def fields(self) -> Fields:
        """Return the responses at all DOFs at the lines."""
        return self._local(()).fields()

    def first_order(self, slopes: Complexes) -> Complexes:
        """Return the changes of all residuals by those of the receptances, (n, m), to the first order.

        Parameters
        ----------
        slopes : ndarray (n, n_lines, n_out, n_in)
        """
        H = self._local(()).H.ravel()[self.at]
        with np.errstate(divide="ignore", invalid="ignore"):
            d = self.problem.data.seen(self.weight * slopes.reshape(len(slopes), -1)[:, self.at] / H)
        return np.where(np.isfinite(d), d, 0.0)

    def whitened(self, r: Complexes) -> Floats:
        """Return residuals (n, m + n_all) as real ones of unit variance, (n, 2 m + n_all)."""
        m = len(self.share)
        root = np.sqrt(np.concatenate([self.weights[:m], self.weights]))
        return np.hstack([r[:, :m].real, r[:, :m].imag, r[:, m:].real]) * root

    def low_levels(self, change: Complexes, most: Floats, one_sided: NDArray[np.bool_]) -> Floats:
        """Return the levels on the low band with the best multiples of n changes (n, m) of it, (n,)."""
        low = self._now[~self.full_band]
        if not low.size:
            return np.full(len(change), np.inf)
        return _best_multiples(low, change, most, one_sided, pseudo_huber_weight(low, ROBUST), level)[0]

    @property
    def now(self) -> Complexes:
        """The weighted residuals of the full band without a candidate."""
        return self._now[self.full_band]

    @cached_property
    def cost_now(self) -> float:
        """The negative log posterior without a candidate."""
        return float(self.costs(self.adapted(self.now[None], (), self.off))[0])

    @cached_property
    def _now(self) -> Complexes:
        """The weighted residuals (m,) of the model without a candidate."""
        return self._residuals([self._local(()).H])[0]

    def _possible(self, H: Sequence[Complexes]) -> tuple[Complexes, NDArray[np.bool_]]:
        """Return residuals, those of now for what cannot be, and what can: its receptances are finite."""
        possible = np.array([bool(np.isfinite(each).all()) for each in H])
        return np.where(possible[:, None], self._residuals(H), self._now), possible

    def _residuals(self, H: Sequence[Complexes]) -> Complexes:
        """Return the weighted residuals (n, m) of n receptances (n_lines, n_out, n_in)."""
        computed = np.stack([each.ravel()[self.at] for each in H])
        with np.errstate(divide="ignore", invalid="ignore"):
            r: Any = self.weight * self.problem.data.seen(complex_log(computed / self.measured))
        return np.where(np.isfinite(r), r, 0.0)

    def adapted(
        self, r: Complexes, replaced: Sequence[ParameterRef] = (), off: Floats | None = None
    ) -> Complexes:
        """Return residuals (n, m) without what a small change of the nuisance parameters explains.

        Behind them stand those of prior knowledge, (n, m + n_all), which begin at ``off`` or, for changes of
        residuals, at 0. Parameters that an effect replaces stay as they are, and nothing is known of them.
        """
        back = self._back(tuple(ref for ref in replaced if ref in self.prior_of))
        known = np.zeros((len(r), len(self.off))) if off is None else np.tile(off, (len(r), 1))
        known[:, [k for k, ref in enumerate(self.prior_of) if ref in replaced]] = 0.0
        flat = np.hstack([r.real, r.imag, known])
        rest, m = flat - (flat @ back.T) @ self.slopes, r.shape[1]
        return np.hstack([rest[:, :m] + 1j * rest[:, m : 2 * m], rest[:, 2 * m :]]).astype(complex)

    @cached_property
    def _nuisances(self) -> tuple[Floats, Floats]:
        """Return the covariance of nuisance parameters, and what takes a residual to their change."""
        weighted = self.slopes * self.trust
        A = weighted @ self.slopes.T
        A[np.diag_indices_from(A)] += 1e-9 * np.abs(A.diagonal()).max()
        C: Floats = np.asarray(np.linalg.inv(A), dtype=float)
        return C, C @ weighted

    def _back(self, without: tuple[ParameterRef, ...]) -> Floats:
        """Return what takes a residual to the change of nuisance parameters, some of which stay."""
        if without not in self._projections:
            C, back = self._nuisances
            fixed = [k for k, ref in enumerate(self.refs) if ref in without]
            if fixed:
                back = back - C[:, fixed] @ np.linalg.solve(C[np.ix_(fixed, fixed)], back[fixed])
                back[fixed] = 0.0
            self._projections[without] = back
        return self._projections[without]

    def _local(self, released: tuple[tuple[str, str], ...]) -> LocalChanges:
        """Return the model solved at the lines, without the constraints that an effect releases."""
        if released not in self._solved:
            p, base = self.problem, self.base
            f, refs = p.data.frequency[self.lines], list(base.values)
            engine = p.engine(f, refs, base.effects, released, channels=base.channels)
            zeta = p.damping.ratio(f, base.zeta)
            self._solved[released] = LocalChanges.of(engine, np.array([base.values[r] for r in refs]), zeta)
        return self._solved[released]


def _best_multiples(
    now: Complexes,
    change: Complexes,
    most: Floats,
    one_sided: bool | NDArray[np.bool_],
    weight: Floats,
    cost: Callable[[Complexes], Floats],
    n_data: int | None = None,
) -> tuple[Floats, Floats]:
    """Return the costs (n,) that the best multiples of changes (n, m) of residuals (m,) leave, and these.

    Within ± ``most`` (n,), or from 0 to it where they are one-sided; the cost is infinite where the change
    of the first ``n_data`` is invisible.
    """
    size = (weight * np.abs(change) ** 2).sum(axis=1)
    slope = (weight * (change.conj() * now).real).sum(axis=1)
    least = np.where(one_sided, 0.0, -most)
    factor = np.clip(-slope / np.where(size > 0, size, 1.0), least, most)
    moved = factor[:, None] * change
    visible = np.abs(moved[:, :n_data]).max(axis=1, initial=0.0) >= VISIBLE
    return np.where(visible, cost(now + moved), np.inf), factor


def _some(n: int, most: int) -> NDArray[np.int64]:
    """Return at most ``most`` of n positions, scattered: a fixed step might miss channels entirely."""
    return np.sort(np.random.default_rng(0).permutation(n)[:most])


def level(r: Complexes) -> Floats:
    """Return the robust level of residuals (n, m) [nepers]."""
    return np.sqrt(pseudo_huber(r, ROBUST).mean(axis=1))
