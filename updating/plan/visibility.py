"""Which missing effects a test could see, and which it could name: a map before any diagnosis.

A missing effect changes what is measured. What uncertain parameters, the form and errors of channels can do
of that is taken away, with their priors. The rest makes the effect likelier than nothing, and than any other
effect at its best. The map shows the least sizes at which either is enough.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from fem.model import Effect, Model, ParameterRef, parameter_values
from updating.diagnosis.evidence.hypothesis import Odds, near_to
from updating.diagnosis.evidence.screening import MOST_VALUES, N_WHOLE, Complexes, Grid, Little, Look
from updating.inference.effect_priors import prior_of
from updating.inference.fit import FitProblem
from updating.inference.fit_function import ROBUST
from updating.inference.fit_result import FitResult
from updating.inference.heartbeat import beat
from updating.inference.unknowns import effect_unknowns
from updating.least_squares.loss import pseudo_huber

POWER = 0.9
"""Probability with which an effect of a stated size is seen, or named [-]."""
SURE = 0.9
"""Posterior probability from which on it is [-]."""
KNOWN = 4.0
"""A size that is barely seen is about so many of its standard deviations."""
N_STEPS = 6
"""Evaluations by which a size is found where changes are not in proportion to it."""
WITHIN = 0.03
"""Relative accuracy of sizes at which that ends [-]."""
SHORT = 0.1
"""Share of a gain that may be missing then [-]."""
FARTHEST = 25.0
"""One step changes a size by this factor at most [-]."""
N_RIVALS = 12
"""So many closest rivals are compared with an effect at all sizes."""
BENT = (-4.0, -2.0, 2.0, 4.0)
"""Prior standard deviations by which uncertain parameters bend further than small changes of them say."""
WIDE = 0.3
"""Those with a larger standard deviation do [-]."""
N_CONFIRMED, N_MATCHES, BESIDE = 2, 3, 0.15
"""So many rivals of those are then followed to the size that is most alike, in so many steps, between sizes that
are this share smaller and larger."""
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
    b, z = odds + np.log(SURE / (1 - SURE)), float(norm.ppf(POWER))
    return 0.5 * (z + np.sqrt(z**2 + 2 * np.maximum(b, 0.0))) ** 2


@dataclass(frozen=True, slots=True, eq=False)
class Visible:
    """The least sizes at which an effect at a position is seen and named; None where no plausible one is.

    Attributes
    ----------
    effect : Effect
        As it is not, at the position.
    seen : Effect or None
        Something must be missing.
    located : Effect or None
        It must be at the places of this effect.
    named : Effect or None
        It must be this effect.
    strongest : Effect
        The largest plausible size.
    rival : Effect
        What it is told from last, as it imitates the effect best: another effect, or a part of the form that
        is far from its drawing.
    alike : float
        Cosine of the angle between what both do [-].
    nats : (float, float)
        Expected gains in log likelihood where it is seen over nothing, and where it is named over that rival.
    """

    effect: Effect
    seen: Effect | None
    located: Effect | None
    named: Effect | None
    strongest: Effect
    rival: Effect
    alike: float
    nats: tuple[float, float]


@dataclass(frozen=True, slots=True, eq=False)
class Visibility:
    """What a test could see and name.

    Attributes
    ----------
    problem : FitProblem
    effects : tuple of Visible
        Each candidate at each of its positions.
    left : float
        Level that a right model leaves, besides noise [nepers].
    """

    problem: FitProblem
    effects: tuple[Visible, ...]
    left: float


def visibility(
    problem: FitProblem,
    base: FitResult,
    candidates: Sequence[Effect],
    odds: Odds,
    left: float,
    say: Say = lambda text, done: None,
    follow: Callable[[Effect], bool] = lambda effect: True,
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
    left : float
        Level that a right model leaves, besides the base's residuals [nepers].
    say : callable
        Is told what is being done and how far it is.
    follow : callable
        Tells of which candidates the rivals are followed to the sizes that are most alike; of others they are
        compared as large as they are seen.
    """
    sight = Sight(problem, base, left)
    small = Sizes.small(sight, candidates, say)
    n_positions = np.bincount(small.owner, minlength=len(candidates))
    against = [odds.against((), (e,)) + _dilution(problem, e) for e in candidates]
    against = (np.array(against) + np.log(np.maximum(n_positions, 1)))[small.owner]
    enough = needed(against)
    bent = _Rivals.bent(sight, against)
    every = np.tile(np.arange(len(bent.units)), (len(enough), 1))

    def told(rivals: _Rivals, close: Ints, now: Sizes) -> Floats:
        least = rivals.needed(now, close[now.rows]).max(axis=1, initial=0.0)
        return now.gain / np.maximum(least, enough[now.rows])

    seen, is_seen = small.grown(
        partial(told, bent, every), lambda part: say("what is seen", 0.3 + 0.2 * part)
    )
    say("what is alike", 0.5)
    rivals = bent.and_effects(seen, candidates)
    everywhere, elsewhere = rivals.closest(seen)
    matched = np.array([follow(e) for e in candidates])[seen.owner]
    last = everywhere[:, 0].copy(), np.zeros(len(enough))

    def told_exactly(close: Ints, now: Sizes) -> Floats:
        ratio = told(rivals, close, now)
        some = np.flatnonzero(matched[now.rows] & (ratio >= 1 - SHORT))
        if some.size:
            least, rival, alike = rivals.followed(seen, now.some(some), close[now.rows[some]])
            last[0][now.rows[some]], last[1][now.rows[some]] = rival, alike
            ratio[some] = np.minimum(ratio[some], now.gain[some] / np.maximum(least, enough[now.rows[some]]))
        return ratio

    located, is_located = seen.grown(
        partial(told_exactly, elsewhere), lambda part: say("what is located", 0.55 + 0.2 * part)
    )
    named, is_named = located.grown(
        partial(told_exactly, everywhere), lambda part: say("what is named", 0.75 + 0.25 * part)
    )
    # what is named is located, and what is located is seen
    located, is_located = located.or_sooner(is_located, named, is_named)
    seen, is_seen = seen.or_sooner(is_seen, located, is_located)
    least = rivals.needed(named, everywhere)
    rival = np.where(matched, last[0], np.take_along_axis(everywhere, least.argmax(axis=1)[:, None], 1)[:, 0])
    alike = np.where(matched, last[1], rivals.alike(named, rival[:, None])[:, 0])
    found = []
    for i, j in enumerate(rival):
        at = [
            each.effect(i, each.factor[i]) if good[i] else None
            for each, good in ((seen, is_seen), (located, is_located), (named, is_named))
        ]
        nats = float(enough[i]), float(needed(against[i] - rivals.odds[j]))
        found.append(
            Visible(
                seen.effect(i, 0.0), *at, seen.effect(i, seen.most[i]), rivals.effects[j], float(alike[i]),
                nats,
            )
        )  # fmt: skip
    return Visibility(problem, tuple(found), left)


def _dilution(problem: FitProblem, effect: Effect) -> float:
    """Return how much less probable an effect is since its size might have been any of many [nats].

    As if it were known to a ``KNOWN``th of itself.
    """
    values = {p.name: p.value for p in effect.parameters()}
    first = effect.name, effect.parameters()[0].name
    variables = effect_unknowns((effect,), (values,))
    wide = next((prior_of(problem, effect, v).range for v in variables if v.ref == first), 0.0)
    return float(np.log(max(wide, 1.0) * KNOWN / np.sqrt(2 * np.pi)))


def _in_proportion(model: Model, ref: ParameterRef) -> bool:
    """Whether a parameter of a model changes its matrices in proportion."""
    return any(p.linear and not p.log for p in model.effect(ref[0]).parameters() if p.name == ref[1])


@dataclass(eq=False)
class Sight:
    """What a test would show of effects beside all that is uncertain, and what that is worth.

    Attributes
    ----------
    problem, base, left
        As of :func:`visibility`.
    """

    problem: FitProblem
    base: FitResult
    left: float
    look: Look = field(init=False)

    def __post_init__(self) -> None:
        self.look = Look.of(self.problem, self.base, N_WHOLE, 0, MOST_VALUES, self.left)

    @property
    def _n(self) -> int:
        return len(self.look.share)

    @cached_property
    def _level(self) -> Floats:
        """Mean squares of the residuals of each group that a right model leaves."""
        level: Floats = pseudo_huber(self.look.now, ROBUST) @ self.look.share + self.left**2
        return level

    @cached_property
    def _root(self) -> Floats:
        """Square roots of what each part of a change is worth, real and imaginary ones side by side."""
        data, known = self.look.weights[: self._n], self.look.weights[self._n :]
        return np.sqrt(np.concatenate([data, data, known]))

    def changes(self, effect: Effect, points: Sequence[dict[str, float]]) -> Complexes:
        """Return what nothing uncertain can do of an effect at some values, (n, m + n_all)."""
        beat()
        return self.adapted(self.look.changes(Grid(effect, tuple(points))), effect)

    def adapted(self, change: Complexes, effect: Effect) -> Complexes:
        """Return what nothing uncertain can do of changes (n, m), (n, m + n_all)."""
        return self.look.adapted(change, effect.replaces())

    def gains(self, change: Complexes) -> Floats:
        """Return how much likelier a model with such changes (n, m + n_all) is where they are true [nats]."""
        v = pseudo_huber(change[:, : self._n], ROBUST) @ self.look.share
        cost = self.look.likelihood.cost
        known = 0.5 * (change[:, self._n :].real ** 2).sum(axis=1)
        return np.array([cost(self._level + each) for each in v]) - cost(self._level) + known

    def bent(self) -> tuple[list[Effect], Floats, Floats]:
        """Return uncertain parameters far from where they are: effects, what they do (n, r), and how far (n,).

        Far in prior standard deviations. Of those that change the model otherwise than in proportion:
        flexibilities whose logarithms vary.
        """
        problem, base = self.problem, self.base
        function = problem.function(
            base.effects, [parameter_values(e) for e in base.effects], self.look.lines
        )
        x, prior, limits = function.moved_to(base), function.prior(), function.limits()
        effects, H, far = [], [], []
        for k, v in enumerate(function.variables):
            if not np.isfinite(prior.std[k]) or prior.std[k] * (1.0 if v.log else v.scale) < WIDE:
                continue
            if all(_in_proportion(problem.reduced.model, ref) for ref in v.refs):
                continue
            for z in BENT:
                moved = x.copy()
                moved[k] = np.clip(prior.mean[k] + z * prior.std[k], *limits[k])
                if moved[k] != x[k]:
                    own = zip(v.refs, v.moved(moved[k]), strict=True)
                    (name, parameter), value = next(own)
                    effects.append(problem.reduced.model.effect(name).with_values(**{parameter: value}))
                    H.append(function.receptance(moved))
                    far.append(abs(moved[k] - prior.mean[k]) / prior.std[k])
        if not H:
            return [], np.zeros((0, len(self._root))), np.zeros(0)
        return effects, self.flat(self.look.adapted(self.look.change_to(H))), np.array(far)

    def flat(self, change: Complexes) -> Floats:
        """Return changes as vectors (n, r), whose squares are twice their gains where these are small."""
        data, known = change[:, : self._n], change[:, self._n :].real
        out: Floats = np.hstack([data.real, data.imag, known]) * self._root
        return out


@dataclass(frozen=True, eq=False)
class Sizes:
    """Effects at positions and sizes, these as multiples of small ones.

    Attributes
    ----------
    sight : Sight
    littles : list of Little
        Of each candidate.
    rows : ndarray of int (n,)
        Numbers of the effects at their positions.
    owner, k : ndarray of int (n,)
        Candidate of each, and which of its positions.
    factor, gain : ndarray (n,)
        Size, and what it gains [nats].
    vector : ndarray (n, r)
        What it does.
    """

    sight: Sight
    littles: list[Little]
    rows: Ints
    owner: Ints
    k: Ints
    factor: Floats
    gain: Floats
    vector: Floats

    @classmethod
    def small(cls, sight: Sight, effects: Sequence[Effect], say: Say) -> "Sizes":
        """Return small sizes of all effects at all positions of their grids."""
        littles, gains, vectors = [], [], []
        for i, effect in enumerate(effects):
            beat()
            say("what a little of each effect does", 0.3 * i / len(effects))
            littles.append(sight.look.little(Grid.of(sight.problem, effect)))
            change = sight.adapted(littles[-1].change, effect)
            gains.append(sight.gains(change))
            vectors.append(sight.flat(change))
        n = [len(g) for g in gains]
        owner = np.repeat(np.arange(len(n)), n)
        k = np.concatenate([np.arange(each) for each in n])
        rows = np.arange(len(k))
        return cls(
            sight, littles, rows, owner, k, np.ones(len(k)), np.concatenate(gains), np.vstack(vectors)
        )  # fmt: skip

    @cached_property
    def most(self) -> Floats:
        """Largest sizes that are plausible."""
        return np.array([self.littles[o].most[k] for o, k in zip(self.owner, self.k, strict=True)])

    def values(self, i: int, factor: float) -> dict[str, float]:
        """Return the parameter values of an effect at a size."""
        return self.littles[self.owner[i]].values(int(self.k[i]), factor)

    def effect(self, i: int, factor: float) -> Effect:
        """Return an effect at a size."""
        return self.littles[self.owner[i]].grid.effect.with_values(**self.values(i, factor))

    def some(self, which: NDArray[np.bool_] | Ints) -> "Sizes":
        """Return some of these."""
        own = {
            name: getattr(self, name)[which] for name in ("rows", "owner", "k", "factor", "gain", "vector")
        }
        return replace(self, **own)

    def at(self, factor: Floats) -> "Sizes":
        """Return the same effects at other sizes."""
        gain, vector = np.empty(len(factor)), np.empty_like(self.vector)
        for o in np.unique(self.owner):
            own = np.flatnonzero(self.owner == o)
            points = [self.values(i, factor[i]) for i in own]
            change = self.sight.changes(self.littles[o].grid.effect, points)
            gain[own], vector[own] = self.sight.gains(change), self.sight.flat(change)
        return replace(self, factor=factor, gain=gain, vector=vector)

    def grown(
        self, ratio: Callable[["Sizes"], Floats], say: Callable[[float], None]
    ) -> "tuple[Sizes, NDArray[np.bool_]]":
        """Return the least sizes that gain enough, or the largest ones, and which gain enough.

        Small gains grow with the square of a size, others by the power that the last two sizes had.

        Parameters
        ----------
        ratio : callable
            Returns what sizes gain over what is enough, (n,) [-].
        say : callable
            Is told the part done.
        """
        most, power = np.log(self.most), np.full(len(self.rows), 2.0)
        reached = np.log(np.maximum(ratio(self), 1e-300))
        now, size = self, np.log(self.factor)
        low, high = np.full(len(size), -np.inf), np.full(len(size), np.inf)
        enough = self
        for step in range(N_STEPS):
            say(step / N_STEPS)
            is_enough = reached >= np.log(1 - SHORT)
            high = np.where(is_enough, np.minimum(high, size), high)
            low = np.where(is_enough, low, np.maximum(low, size))
            after = np.clip(size - np.clip(reached / power, -np.log(FARTHEST), np.log(FARTHEST)), None, most)
            # between what is enough and what is not
            beyond = (after <= low) | (after >= high)
            after = np.where(beyond & np.isfinite(low + high), (low + high) / 2, after)
            open_ = np.flatnonzero((np.abs(after - size) > WITHIN) & ~(np.abs(reached) < SHORT))
            if not open_.size:
                break
            then = now.some(open_).at(np.exp(after[open_]))
            found = np.log(np.maximum(ratio(then), 1e-300))
            power[open_] = np.clip((found - reached[open_]) / (after - size)[open_], 0.5, 4.0)
            reached[open_], size[open_] = found, after[open_]
            now = now.with_(open_, then)
            better = open_[(found >= np.log(1 - SHORT)) & (after[open_] < high[open_])]
            enough = enough.with_(better, now.some(better))
        is_enough = np.isfinite(np.where(reached >= np.log(1 - SHORT), size, high))
        return enough.with_(np.flatnonzero(~is_enough), now.some(~is_enough)), is_enough

    def or_sooner(
        self, good: NDArray[np.bool_], other: "Sizes", other_good: NDArray[np.bool_]
    ) -> "tuple[Sizes, NDArray[np.bool_]]":
        """Return the smaller ones of these and other sizes that are enough, and which are."""
        sooner = np.flatnonzero(other_good & (~good | (other.factor < self.factor)))
        return self.with_(sooner, other.some(sooner)), good | other_good

    def with_(self, which: Ints, then: "Sizes") -> "Sizes":
        """Return these with some at other sizes."""
        own = {name: getattr(self, name).copy() for name in ("factor", "gain", "vector")}
        for name, values in own.items():
            values[which] = getattr(then, name)
        return replace(self, **own)


@dataclass(frozen=True, slots=True, eq=False)
class _Rivals:
    """What might stand for effects: uncertain parameters far off, and all effects where they are seen.

    Attributes
    ----------
    effects : tuple of Effect
    units : ndarray (n, r)
        What each does, of length 1.
    shortest, longest : ndarray (n,)
        Multiples of that which are plausible.
    odds : ndarray (n,)
        Log odds against each beforehand.
    against : ndarray (n_effects,)
        Those against the effects that are told from them.
    owner : ndarray of int (n,)
        Candidate of each, -1 for none.
    unlike, apart : ndarray of bool (n_candidates, n_candidates)
        Which are no rivals, since the second is the first or contains it, and which act at other places.
    """

    effects: tuple[Effect, ...]
    units: Floats
    shortest: Floats
    longest: Floats
    odds: Floats
    against: Floats
    owner: Ints
    unlike: NDArray[np.bool_]
    apart: NDArray[np.bool_]

    @classmethod
    def bent(cls, sight: Sight, against: Floats) -> "_Rivals":
        """Return what uncertain parameters can do far from where they are, which is nothing missing."""
        effects, vectors, far = sight.bent()
        length = np.hypot(np.linalg.norm(vectors, axis=1), far)
        units, none = vectors / length[:, None], np.zeros((0, 0), dtype=bool)
        owner = np.full(len(far), -1)
        zero = np.zeros(len(far))
        return cls(tuple(effects), units, zero, length, zero, against, owner, none, none)

    def and_effects(self, seen: Sizes, candidates: Sequence[Effect]) -> "_Rivals":
        """Return these with effects as large as they are seen."""
        n = len(candidates)
        # the last row and column stand for what is no effect
        unlike, apart = np.eye(n + 1, dtype=bool), np.ones((n + 1, n + 1), dtype=bool)
        unlike[n, n] = False
        for j, e in enumerate(candidates):
            for i, other in enumerate(candidates) if e.contains else ():
                unlike[i, j] |= other.kind in e.contains and e.covers(other)
        members: dict[str, list[int]] = {}
        for i, e in enumerate(candidates):
            for name in near_to(e):
                members.setdefault(name, []).append(i)
        for some in members.values():
            apart[np.ix_(some, some)] = False
        length = np.linalg.norm(seen.vector, axis=1)
        units = seen.vector / np.where(length > 0, length, 1.0)[:, None]
        longest = length * seen.most / seen.factor
        both = np.array([not little.grid.one_sided() for little in seen.littles])[seen.owner]
        return _Rivals(
            (*self.effects, *(seen.effect(i, seen.factor[i]) for i in range(len(length)))),
            np.vstack([self.units, units]),
            np.concatenate([self.shortest, np.where(both, -longest, 0.0)]),
            np.concatenate([self.longest, longest]),
            np.concatenate([self.odds, self.against]),
            self.against,
            np.concatenate([self.owner, seen.owner]),
            unlike,
            apart,
        )

    def closest(self, these: Sizes) -> tuple[Ints, Ints]:
        """Return the rivals (n, k) that are told from effects last, anywhere and at other places."""
        many = min(N_RIVALS, len(self.owner))
        out = np.empty((2, len(these.rows), many), dtype=np.int64)
        every = np.arange(len(self.owner))
        for first in range(0, len(these.rows), N_AT_ONCE):
            beat()
            rows = np.arange(first, min(first + N_AT_ONCE, len(these.rows)))
            some = these.some(rows)
            least = self._needed(some, some.vector @ self.units.T, every[None])
            apart = self.apart[some.owner][:, self.owner]
            for k, each in enumerate((least, np.where(apart, least, 0.0))):
                out[k, rows] = np.argpartition(-each, many - 1, axis=1)[:, :many]
        return out[0], out[1]

    def needed(self, these: Sizes, close: Ints) -> Floats:
        """Return the gains over nothing at which effects are told from some rivals each, (n, k) [nats]."""
        return self._needed(these, self._along(these, close), close)

    def alike(self, these: Sizes, close: Ints) -> Floats:
        """Return the cosine of the angle between what effects and some rivals each do, (n, k)."""
        length = np.linalg.norm(these.vector, axis=1)
        return np.abs(self._along(these, close)) / np.where(length > 0, length, 1.0)[:, None]

    def followed(self, seen: Sizes, these: Sizes, close: Ints) -> tuple[Floats, Ints, Floats]:
        """Return the same of the closest ``N_CONFIRMED`` at their best sizes: the largest, whose, how alike."""
        order = np.argsort(-self.needed(these, close), axis=1)[:, :N_CONFIRMED]
        j = np.take_along_axis(close, order, axis=1)
        left = np.ones(j.shape)
        n_bent = len(self.units) - len(seen.rows)
        row, column = np.nonzero(j >= n_bent)
        if row.size:
            left[row, column] = _best_match(seen.some(j[row, column] - n_bent), these.some(row))
        linear = 1 - self.alike(these, j) ** 2
        left = np.clip(np.minimum(left, np.where(j < n_bent, linear, 1.0)), 1e-12, 1.0)
        least = needed(self.against[these.rows][:, None] - self.odds[j]) / left
        least = np.where(self.unlike[these.owner[:, None], self.owner[j]], 0.0, least)
        k = least.argmax(axis=1)[:, None]
        each = (np.take_along_axis(a, k, 1)[:, 0] for a in (least, j, np.sqrt(1 - left)))
        return tuple(each)  # type: ignore[return-value]

    def _along(self, these: Sizes, close: Ints) -> Floats:
        return np.stack([(these.vector * self.units[j]).sum(axis=1) for j in close.T], axis=1)

    def _needed(self, these: Sizes, along: Floats, close: Ints) -> Floats:
        """Return the same by what effects do along what rivals do.

        Rivals have the best multiple of that which is plausible.
        """
        best = np.clip(along, self.shortest[close], self.longest[close])
        square = (these.vector**2).sum(axis=1)[:, None]
        left = np.clip(1 - (2 * along - best) * best / np.where(square > 0, square, 1.0), 1e-12, 1.0)
        least: Floats = needed(self.against[these.rows][:, None] - self.odds[close]) / left
        if not len(self.unlike):
            return least
        return np.where(self.unlike[these.owner[:, None], self.owner[close]], 0.0, least)


def _best_match(rivals: Sizes, these: Sizes) -> Floats:
    """Return the share of what effects do that rivals leave at their best sizes, (n,).

    A rival is tried where it gains as much, at a size below and one above. Between them what it does is
    taken to change in proportion; where another size seems better, it is tried there.
    """
    size = np.log(rivals.factor) + 0.5 * np.log(these.gain / np.maximum(rivals.gain, 1e-300))
    most, square = np.log(rivals.most), np.maximum((these.vector**2).sum(axis=1), 1e-300)
    best = np.ones(len(size))
    open_ = np.arange(len(size))
    for _ in range(N_MATCHES):
        middle = np.minimum(size[open_], most[open_] - BESIDE)
        some = rivals.some(open_)
        low, high = (some.at(np.exp(middle + step)).vector for step in (-BESIDE, BESIDE))
        wanted, span = these.vector[open_] - low, high - low
        part = (wanted * span).sum(axis=1) / np.maximum((span**2).sum(axis=1), 1e-300)
        near = np.clip(part, -0.5, 1.5)
        left = ((wanted - near[:, None] * span) ** 2).sum(axis=1) / square[open_]
        best[open_] = np.minimum(best[open_], left)
        size[open_] = middle + np.clip((2 * part - 1) * BESIDE, -1.0, 1.0)
        open_ = open_[np.abs(part - 0.5) > 1.0]
        if not open_.size:
            break
    return best
