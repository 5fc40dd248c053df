"""Which missing effects a test could see, and which it could name: a map before any diagnosis.

A missing effect changes what is measured. What uncertain parameters, the form and errors of channels can do
of that is taken away, with their priors. The rest makes the effect likelier than nothing, and than any other
effect at its best. The map shows the least sizes at which either is enough.

The computation is linear in small changes: a fit follows resonances wherever they move, so that the rest is
small. Complex frequencies, at which resonances are broad, show how many small changes a large effect makes.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
import scipy
from numpy.typing import NDArray

from fem.model import Effect, Model, ParameterRef, covers, parameter_values
from updating.diagnosis.evidence.hypothesis import Odds, near_to
from updating.diagnosis.evidence.screening import (
    MOST_VALUES,
    N_DAMPED,
    N_FULL_BAND,
    Complexes,
    Grid,
    Look,
    SmallChange,
    distance,
)
from updating.inference.effect_priors import log_occam_factor
from updating.inference.fit import FitProblem
from updating.inference.fit_data import SYSTEMATIC_FROM
from updating.inference.fit_function import ROBUST
from updating.inference.fit_result import FitResult
from updating.inference.heartbeat import beat
from updating.least_squares.loss import pseudo_huber

POWER = 0.9
"""Probability with which an effect of a stated size is seen, or named [-]."""
SURE = 0.9
"""Posterior probability from which on it is [-]."""
KNOWN = 4.0
"""A size that is barely seen is about so many of its standard deviations."""
N_SIZES = 6
"""So many sizes of each effect up to the largest plausible one say what multiples of a little they are."""
BROAD = 0.3
"""Decay rate of FRFs for that, in parts of the band [-]."""
LITTLE, FAR = 0.1, 4.0
"""What uncertain parameters do is compared at so many prior standard deviations."""
WIDE = 0.3
"""Of those with larger standard deviations of a logarithm [-]."""
MOST_POSITIONS = 4_000
"""Of more positions of all effects together, each effect is looked at on fewer, evenly spaced: minutes."""
N_AT_ONCE = 500
"""So many effects are compared with all others at a time."""

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Say = Callable[[str, float], None]


def needed(odds: Floats) -> Floats:
    """Return the gains in log likelihood that effects must be expected to have over rivals [nats].

    Of an expected gain g the gain in data is normal about it with variance 2g. It exceeds b, the log odds of
    prior probability against the effect and those of ``SURE``, with the probability ``POWER`` if
    √(2g) = z + √(z² + 2b).

    Parameters
    ----------
    odds : ndarray
        Logarithms of the rivals' prior probabilities over the effects'.
    """
    b, z = odds + np.log(SURE / (1 - SURE)), float(scipy.special.ndtri(POWER))
    return 0.5 * (z + np.sqrt(z**2 + 2 * np.maximum(b, 0.0))) ** 2


@dataclass(frozen=True, slots=True, eq=False)
class Visible:
    """What a test shows of an effect at a position.

    Attributes
    ----------
    little : SmallChange
        Small changes by the effect.
    position : int
        Which of its positions.
    sizes, amplitudes : ndarray (n,)
        Multiples of the small size up to the largest plausible one, and as how many of the small change they
        act; both rise.
    enough : (float, float, float)
        Least amplitudes at which something must be missing, it must be at the places of this effect, and it
        must be this effect; whatever is plausible.
    nats : (float, float)
        Gains in log likelihood that are expected of the first and the last of these, over nothing and over
        the last rival.
    rival : Effect
        That, of the size at which it is seen: it imitates the effect best.
    alike : float
        Cosine of the angle between what both do [-].
    """

    little: SmallChange
    position: int
    sizes: Floats
    amplitudes: Floats
    enough: tuple[float, float, float]
    nats: tuple[float, float]
    rival: Effect
    alike: float

    @property
    def effect(self) -> Effect:
        """The effect at the position, with size zero."""
        return self._of(0.0)

    @property
    def slight(self) -> Effect:
        """A little of the effect, of amplitude 1."""
        return self._of(1.0)

    @property
    def strongest(self) -> Effect:
        """The largest plausible size."""
        return self._of(float(self.sizes[-1]))

    @property
    def seen(self) -> Effect | None:
        """The least size at which something must be missing; None where it is not plausible."""
        return self.at(self.enough[0])

    @property
    def located(self) -> Effect | None:
        """The least size at which it must be at the places of this effect."""
        return self.at(self.enough[1])

    @property
    def named(self) -> Effect | None:
        """The least size at which it must be this effect."""
        return self.at(self.enough[2])

    def at(self, amplitude: float) -> Effect | None:
        """Return the effect as large as a multiple of its small change; None if that is not plausible."""
        if not amplitude <= self.amplitudes[-1]:
            return None
        return self._of(between(amplitude, self.amplitudes, self.sizes))

    def amplitude(self, effect: Effect) -> float:
        """Return as what multiple of its small change the effect acts at another size."""
        return between(size_of(effect) / size_of(self.slight), self.sizes, self.amplitudes)

    def chances(self, amplitude: float) -> tuple[float, float]:
        """Return the probabilities with which an amplitude is seen, and named."""
        out = []
        for enough, g in zip((self.enough[0], self.enough[2]), self.nats, strict=True):
            there, barrier = (
                g * (amplitude / enough) ** 2,
                g - float(scipy.special.ndtri(POWER)) * np.sqrt(2 * g),
            )
            out.append(float(scipy.special.ndtr((there - barrier) / np.sqrt(2 * there))))
        return out[0], min(out)

    def _of(self, size: float) -> Effect:
        return self.little.grid.effect.with_values(**self.little.values(self.position, size))


def between(x: float, rising: Floats, values: Floats) -> float:
    """Return a value at x, by straight lines between logarithms; beyond the ends that of the end."""
    inside = np.clip(x, rising[0], rising[-1])
    return float(np.exp(np.interp(np.log(inside), np.log(rising), np.log(values))))


def sized(effect: Effect, value: float) -> Effect:
    """Return an effect with a value of its first parameter, or the bound next to it."""
    p = effect.parameters()[0]
    return effect.with_values(**{p.name: float(np.clip(value, p.lower, p.upper))})


def size_of(effect: Effect) -> float:
    """Return how far an effect is from none by its first parameter; a stiffness counts as flexibility."""
    p = effect.parameters()[0]
    return abs(distance(p, float(p.value)))


@dataclass(frozen=True, slots=True, eq=False)
class Visibility:
    """What a test could see and name.

    Attributes
    ----------
    problem : FitProblem
    base : FitResult
        The model without the effects.
    odds : Odds
    effects : tuple of Visible
        Each candidate at each of its positions.
    discrepancy : float or None
        Level that a right model will leave, besides noise; None for data whose residuals show it [nepers].
    """

    problem: FitProblem
    base: FitResult
    odds: Odds
    effects: tuple[Visible, ...]
    discrepancy: float | None


def visibility(
    problem: FitProblem,
    base: FitResult,
    candidates: Sequence[Effect],
    odds: Odds,
    discrepancy: float | None,
    say: Say = lambda text, done: None,
    averaged: float = 1.0,
) -> Visibility:
    """Return what a test could see and name.

    Parameters
    ----------
    problem : FitProblem
        With small deviations among its unknowns.
    base : FitResult
        The model without the effects.
    candidates : sequence of Effect
    odds : Odds
        What is believed of them beforehand.
    discrepancy : float or None
        Level that a right model will leave, besides noise; None for data whose residuals show it [nepers].
    say : callable
        Called with the current step and the fraction done.
    averaged : float
        Averages so far over those that there will be [-].
    """
    problem = replace(problem, data=problem.data.averaged(averaged))
    sight = Sight(problem, base, discrepancy, averaged=averaged)
    grids = [Grid.of(problem, effect) for effect in candidates]
    n_positions = [len(grid.slight_points()) for grid in grids]
    if sum(n_positions) > MOST_POSITIONS:
        grids = [_thinned(grid, MOST_POSITIONS // len(grids)) for grid in grids]
    littles = []
    for i, grid in enumerate(grids):
        beat()
        say("what a little of each effect does", 0.4 * i / len(grids))
        littles.append(sight.look.little(grid))
    n_looked_at = [len(little.points) for little in littles]
    owner = np.repeat(np.arange(len(candidates)), n_looked_at)
    k = np.concatenate([np.arange(n) for n in n_looked_at])
    each = [odds_against(problem, e, odds, n) for e, n in zip(candidates, n_positions, strict=True)]
    against = np.array(each)[owner]
    enough = needed(against)
    squares, vectors = sight.parts(littles)
    reach = []
    for i, (effect, little) in enumerate(zip(candidates, littles, strict=True)):
        beat()
        say("how large effects may be", 0.4 + 0.4 * i / len(candidates))
        reach += sight.reach(effect, little)
    say("what is alike", 0.8)
    most = np.array([amplitude[-1] for _, amplitude in reach])
    seen = sight.amplitudes(squares, enough)
    both = np.array([not little.grid.one_sided() for little in littles])[owner]
    rivals = _Rivals.of(vectors, candidates, owner, _followed(littles), both, most, against)
    located, named, rival, alike = rivals.separation_amplitudes(seen, enough)
    over_rival = np.where(named > (1 + 1e-6) * seen, needed(against - against[rival]), enough)
    found = []
    for i, o in enumerate(owner.tolist()):
        j = int(rival[i])
        other, at = littles[owner[j]], int(k[j])
        first = other.values(at, min(max(float(seen[j]), 1.0), float(reach[j][0][-1])))
        sizes, amplitudes = reach[i]
        found.append(
            Visible(
                little=littles[o],
                position=int(k[i]),
                sizes=sizes,
                amplitudes=amplitudes,
                enough=(seen[i], located[i], named[i]),
                nats=(enough[i], over_rival[i]),
                rival=other.grid.effect.with_values(**first),
                alike=float(alike[i]),
            )
        )
    return Visibility(problem, base, odds, tuple(found), discrepancy)


def _thinned(grid: Grid, most: int) -> Grid:
    """Return a grid with at most so many, or one, of its positions."""
    first = grid.effect.parameters()[0].name

    def position(point: dict[str, float]) -> tuple[float, ...]:
        return tuple(v for name, v in point.items() if name != first)

    every = list(dict.fromkeys(position(point) for point in grid.points))
    n = max(1, min(most, len(every)))
    kept = {every[int((k + 0.5) * len(every) / n)] for k in range(n)}
    return Grid(grid.effect, tuple(point for point in grid.points if position(point) in kept))


def odds_against(problem: FitProblem, effect: Effect, odds: Odds, n_positions: int) -> float:
    """Return the log odds against an effect of one size at one of its positions, which might be any of many.

    As if its size were known to a ``KNOWN``th of itself.
    """
    return odds.against((), (effect,)) - log_occam_factor(problem, effect, KNOWN, n_positions)


def _in_proportion(model: Model, ref: ParameterRef) -> bool:
    """Whether a parameter of a model changes its matrices in proportion."""
    return any(p.linear and not p.log for p in model.effect(ref[0]).parameters() if p.name == ref[1])


@dataclass(eq=False)
class Sight:
    """What a test would show of effects besides all that is uncertain, and what that is worth.

    Attributes
    ----------
    problem, base, discrepancy
        As of :func:`visibility`.
    n_lines, most : int
        So many lines, and values of FRFs at most, are looked at.
    averaged : float
        As of :func:`visibility`: the problem has the noise that there will be [-].
    look : Look
        On the test's own FRFs.
    broad : Look
        On FRFs with broad resonances, which nothing has to follow.
    """

    problem: FitProblem
    base: FitResult
    discrepancy: float | None
    n_lines: int = N_FULL_BAND
    most: int = MOST_VALUES
    averaged: float = 1.0
    look: Look = field(init=False)
    broad: Look = field(init=False)

    def __post_init__(self) -> None:
        problem, base = self.problem, self.base
        rate = BROAD * 2 * np.pi * float(problem.data.frequency[-1])
        soft = replace(problem, scatter=None, decay=rate)
        soft = replace(soft, data=replace(problem.data, H=soft.receptance(base)))
        self.broad = Look.of(soft, base, N_DAMPED, 0, MOST_VALUES)
        self.look = Look.of(problem, base, self.n_lines, 0, self.most, self.discrepancy, self._stretched())

    def _stretched(self) -> dict[ParameterRef, float]:
        """Return how much farther uncertain parameters reach than small changes of them say, by parameter.

        Of those that change the model otherwise than in proportion: flexibilities whose logarithms vary
        within bounds.
        """
        problem, base = self.broad.problem, self.base
        starts = [parameter_values(e) for e in base.effects]
        function = problem.function(base.effects, starts, self.broad.lines)
        x, prior, limits = function.moved_to(base), function.prior(), function.limits()
        function.anchor(x)
        out = {}
        for k, v in enumerate(function.variables):
            wide = prior.std[k] * (1.0 if v.log else v.scale) >= WIDE and np.isfinite(prior.std[k])
            if not wide or all(_in_proportion(problem.reduced.model, ref) for ref in v.refs):
                continue
            H = []
            for z in (LITTLE, -LITTLE, FAR, -FAR):
                moved = x.copy()
                moved[k] = np.clip(prior.mean[k] + z * prior.std[k], *limits[k])
                H.append(function.receptance(moved))
            change = self.broad.change_to(H)
            length = np.linalg.norm(change, axis=1)
            if length[:2].max() > 0:  # what acts across the plane of a test changes nothing
                out[v.ref] = float(length[2:].max() / length[:2].max() * LITTLE / FAR)
        return out

    @property
    def _n(self) -> int:
        return len(self.look.share)

    @cached_property
    def _level(self) -> Floats:
        """Mean squares of the residuals of each group that a right model leaves."""
        level: Floats = pseudo_huber(self.look.now, ROBUST) @ self.look.share
        noise = self.look.likelihood.noise / SYSTEMATIC_FROM**2
        if self.discrepancy is None:  # measured residuals have the noise of the averages so far
            return np.maximum(level - (1 / self.averaged - 1) * noise, self.averaged * level)
        return level + noise + self.discrepancy**2

    @cached_property
    def _learned(self) -> tuple[Floats, Floats]:
        """What the data say of combinations of uncertain parameters, (n,), and each group's part, (n, g).

        Shares of all that is known of them afterwards. With a larger misfit the data say less, and the
        evidence takes less for parameters that are free: that counts for the wrong model.
        """
        look, m = self.look, self._n
        J, known = look.slopes[:, : 2 * m] * np.sqrt(np.tile(look.weights[:m], 2)), look.slopes[:, 2 * m :]
        groups = np.tile(look.share > 0, (2, 1)).T
        information = [J[:, here] @ J[:, here].T for here in groups]
        total = np.sum(information, axis=0) + known @ known.T
        L = np.linalg.cholesky(total + 1e-9 * np.diag(total.diagonal()))
        parts = [np.linalg.solve(L, np.linalg.solve(L, A).T) for A in information]
        values, U = np.linalg.eigh(np.sum(parts, axis=0))
        return np.clip(values, 0.0, 1.0), np.stack([((B @ U) * U).sum(axis=0) for B in parts], axis=1)

    def parts(self, littles: Sequence[SmallChange]) -> tuple[Floats, Floats]:
        """Return what nothing uncertain can do of small changes, of n in all.

        Mean squares of each group of residuals and, behind these, of what is known beforehand, of shape
        (n, n_groups + 1); and vectors (n, r), whose squares are worth twice their gains.
        """
        change = np.concatenate([little.change for little in littles])
        owner = np.repeat(np.arange(len(littles)), [len(little.points) for little in littles])
        alike: dict[tuple[ParameterRef, ...], list[int]] = {}
        for i, little in enumerate(littles):
            alike.setdefault(tuple(little.grid.effect.replaces()), []).append(i)
        squares = np.empty((len(change), self.look.share.shape[1] + 1))
        vectors = np.empty((len(change), self.look.slopes.shape[1]))
        for replaced, some in alike.items():
            rows = np.flatnonzero(np.isin(owner, some))
            for first in range(0, len(rows), N_AT_ONCE):
                beat()
                k = rows[first : first + N_AT_ONCE]
                squares[k], vectors[k] = self._parts(change[k], replaced)
        return squares, vectors

    def _parts(self, change: Complexes, replaced: tuple[ParameterRef, ...]) -> tuple[Floats, Floats]:
        """Return the same for changes (n, m) by effects that replace the same parameters."""
        residual, m = self.look.adapted(change, replaced), self._n
        data, known = residual[:, :m], residual[:, m:].real
        squares = np.abs(data) ** 2 @ self.look.share
        root = np.sqrt(np.concatenate([self.look.weights[:m]] * 2 + [self.look.weights[m:]]))
        vector: Floats = np.hstack([data.real, data.imag, known]) * root
        return np.column_stack([squares, 0.5 * (known**2).sum(axis=1)]), vector

    def amplitudes(self, squares: Floats, wanted: Floats) -> Floats:
        """Return the multiples (n,) of small changes that gain what is wanted (n,); infinite if none does.

        Parameters
        ----------
        squares : ndarray (n, n_groups + 1)
            As of :meth:`parts`.
        wanted : ndarray (n,)
            [nats].
        """
        levels = self.look.likelihood
        floor, beyond = levels.cost(self._level), self._level - levels.noise
        least = levels.least + np.maximum(beyond, 0.0)
        learned, by_group = self._learned

        def gains(a: Floats) -> Floats:
            v = np.maximum(beyond + a[:, None] ** 2 * squares[:, :-1], 0.0)
            below = np.minimum(beyond + a[:, None] ** 2 * squares[:, :-1], 0.0)
            cost = 0.5 * (np.log(levels.least + v) + below / levels.least) @ levels.n
            weaker = least / (levels.least + v)
            unpaid = 0.5 * np.log(1 - learned + weaker @ by_group.T + 1e-12).sum(axis=1)
            out: Floats = cost - floor + a**2 * squares[:, -1] + unpaid
            return out

        slope = 0.5 * squares[:, :-1] @ (levels.n / least) + squares[:, -1]
        seen = slope > 0
        low = np.where(
            seen, np.sqrt(wanted / np.where(seen, slope, 1.0)), np.inf
        )  # gains are no more than linear in a²
        squares, high = np.where(seen[:, None], squares, 1.0), np.where(seen, low, 1.0)
        for _ in range(N_DOUBLED):
            high = np.where(gains(high) < wanted, 2 * high, high)
        seen &= gains(high) >= wanted  # of more parameters than data nothing is ever seen
        bottom = np.where(seen, low, 1.0)
        for _ in range(N_HALVED):
            middle = np.sqrt(bottom * high)
            short = gains(middle) < wanted
            bottom, high = np.where(short, middle, bottom), np.where(short, high, middle)
        return np.where(seen, high, np.inf)

    def reach(self, effect: Effect, little: SmallChange) -> list[tuple[Floats, Floats]]:
        """Return at each of an effect's positions multiples of its small size, and of what that does.

        Both rise.
        """
        factors = [np.geomspace(1.0, most, N_SIZES) for most in _most(little)]
        points = [little.values(k, f) for k, each in enumerate(factors) for f in each]
        change = self.broad.changes(Grid(effect, tuple(points))).reshape(len(factors), N_SIZES, -1)
        length = np.linalg.norm(change, axis=2)
        amplitude = length / np.where(length[:, :1] > 0, length[:, :1], 1.0)
        amplitude[:, 0] = 1.0
        amplitude = np.maximum.accumulate(amplitude, axis=1) * (1 + 1e-9 * np.arange(N_SIZES))
        return list(zip(factors, amplitude, strict=True))


def _most(little: SmallChange) -> list[float]:
    """Return the largest sizes that are plausible on the side of none on which the small ones are, (n,)."""
    first = little.grid.effect.parameters()[0].name
    out = []
    for point in little.points:
        p = little.grid.effect.with_values(**point).parameters()[0]
        p = p if little.absent is None else replace(p, absent=little.absent)
        small = distance(p, point[first])
        alike = (
            each for each in little.grid.points if all(each[n] == v for n, v in point.items() if n != first)
        )
        far = [d / small for each in alike if (d := distance(p, each[first])) * small > 0]
        out.append(max([*far, 1.001]))
    return out


def _followed(littles: Sequence[SmallChange]) -> Ints:
    """Return the numbers, of all littles' points, of those whose next one is only farther along a member."""
    out, n = [], 0
    for little in littles:
        first, *_ = parameters = little.grid.effect.parameters()
        along = {first.name, *(p.name for p in parameters if p.position)}
        for k, (one, two) in enumerate(pairwise(little.points)):
            if len(along) > 1 and {name for name, value in one.items() if two[name] != value} <= along:
                out.append(n + k)
        n += len(little.points)
    return np.array(out, dtype=np.int64)


N_DOUBLED, N_HALVED = 8, 20
"""Steps that enclose an amplitude, and halves of the range in which it then is."""


@dataclass(frozen=True, slots=True, eq=False)
class _Rivals:
    """All effects, a little of each, as what might stand for others.

    Attributes
    ----------
    lengths, units : ndarray (n,), (n, r)
        What each does: how much, and of length 1.
    owner : ndarray of int (n,)
        Candidate of each.
    column : ndarray of int (n + n_pairs,)
        Number of each, and of those that are followed by the same candidate at its next position. A fit may
        move a rival to between the two, where it does about what a sum of both does.
    least, most : ndarray (n,)
        Multiples that are plausible.
    against : ndarray (n,)
        Log odds against each beforehand.
    unlike, apart : ndarray of bool (n_candidates, n_candidates)
        Which are no rivals, since the second is the first or contains it, and which act at other places.
    """

    lengths: Floats
    units: Floats
    owner: Ints
    column: Ints
    least: Floats
    most: Floats
    against: Floats
    unlike: NDArray[np.bool_]
    apart: NDArray[np.bool_]

    @classmethod
    def of(
        cls,
        vectors: Floats,
        candidates: Sequence[Effect],
        owner: Ints,
        followed: Ints,
        both: NDArray[np.bool_],
        most: Floats,
        against: Floats,
    ) -> "_Rivals":
        """Tell which candidates are no rivals, and which act at other places."""
        n = len(candidates)
        unlike, apart = np.eye(n, dtype=bool), np.ones((n, n), dtype=bool)
        for j, e in enumerate(candidates):
            for i, other in enumerate(candidates) if e.contains else ():
                unlike[i, j] |= other.kind in e.contains and covers(e, other)
        members: dict[str, list[int]] = {}
        for i, e in enumerate(candidates):
            for name in near_to(e):
                members.setdefault(name, []).append(i)
        for some in members.values():
            apart[np.ix_(some, some)] = False
        lengths = np.linalg.norm(vectors, axis=1)
        units = vectors / np.where(lengths > 0, lengths, 1.0)[:, None]
        column = np.concatenate([np.arange(len(owner)), followed])
        return cls(lengths, units, owner, column, np.where(both, -most, 0.0), most, against, unlike, apart)

    def separation_amplitudes(self, seen: Floats, enough: Floats) -> tuple[Floats, Floats, Ints, Floats]:
        """Return the least amplitudes that separate effects from their rivals at their best, (n,) each.

        From all at other places, and from all; then of the last rival its number and the cosine of the angle
        between what both do.

        Parameters
        ----------
        seen, enough : ndarray (n,)
            Amplitudes at which effects are seen, and gains there [nats].
        """
        n, owner = len(self.owner), self.owner[self.column]
        elsewhere, anywhere, rival, alike = np.zeros(n), np.zeros(n), np.zeros(n, dtype=np.int64), np.zeros(n)
        for first in range(0, n, N_AT_ONCE):
            beat()
            rows = np.arange(first, min(first + N_AT_ONCE, n))
            cosine = self._cosines(rows)
            like, apart = (m[self.owner[rows]][:, owner] for m in (~self.unlike, self.apart))
            least = np.where(like, self._least(seen[rows], enough[rows], rows, cosine), 0.0)
            elsewhere[rows] = np.maximum(np.where(apart, least, 0.0).max(axis=1), seen[rows])
            anywhere[rows] = np.maximum(least.max(axis=1), seen[rows])
            last = least.argmax(axis=1)
            each, k = np.arange(len(rows)), self.column[last]
            farther = np.abs(cosine[each, np.minimum(k + 1, n - 1)]) > np.abs(cosine[each, k])
            rival[rows] = k + (farther & (last >= n))
            alike[rows] = np.abs(cosine[each, last])
        return elsewhere, anywhere, rival, alike

    def _cosines(self, rows: Ints) -> Floats:
        """Return the cosines of some effects with each other one, (n_rows, n + n_pairs).

        Between two positions of a rival it is that with its best sum of both, if both count with one sign.
        """
        single = self.units[rows] @ self.units.T
        one = self.column[len(self.owner) :]
        a, b = single[:, one], single[:, one + 1]
        c = (self.units[one] * self.units[one + 1]).sum(axis=1)
        between = (a - b * c) * (b - a * c) > 0
        square = (a**2 + b**2 - 2 * a * b * c) / np.maximum(1 - c**2, 1e-12)
        return np.hstack([single, np.where(between, np.sign(a) * np.sqrt(np.clip(square, 0.0, 1.0)), 0.0)])

    def _least(self, seen: Floats, enough: Floats, rows: Ints, cosine: Floats) -> Floats:
        """Return the least amplitudes that separate some effects from each other one, (n_rows, n).

        With x as long as what an effect does, and c what its rival does along it, x² - 2ρxc + c² must be as
        large as what is seen squared, times the gain that is needed over that which is enough. The rival has
        c = ρx, or the largest size that is plausible.
        """
        visible = np.isfinite(seen) & (self.lengths[rows] > 0)
        length = np.where(visible, self.lengths[rows], 1.0)[:, None]
        there = (np.where(visible, seen, 1.0)[:, None] * length) ** 2
        square = there * needed(self.against[rows][:, None] - self.against[self.column]) / enough[:, None]
        sine_squared = np.maximum(1 - cosine**2, 1e-12)
        free = np.sqrt(square / sine_squared)
        most = np.where(cosine > 0, *(each[self.column] for each in (self.most, self.least)))
        most *= self.lengths[self.column]
        capped = cosine * most + np.sqrt(np.maximum(square - most**2 * sine_squared, 0.0))
        x = np.where(np.abs(cosine) * free <= np.abs(most), free, capped)
        return np.where(visible[:, None], x / length, np.inf)
