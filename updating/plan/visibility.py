"""Which missing effects a test could see, and which it could name: a map before any diagnosis.

By the forecast of each candidate (:mod:`updating.forecast.forecast`), at the nominal model with data that
the test will give, or at a fit to data that it has given. An effect is seen where it is likelier than
nothing, and named where it is likelier than any other effect at its best. The map shows the least sizes of
both.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
import scipy

from fem.array_types import Bools, Floats, Ints
from fem.model import Effect, ParameterRef, covers, parameter_values
from updating.diagnosis.evidence.hypothesis import Odds, near_to
from updating.forecast.forecast import Forecast
from updating.forecast.grid import Little, distance
from updating.forecast.information import ExpectedGains, Information
from updating.inference.fit_data import SYSTEMATIC_FROM
from updating.inference.fit_function import ROBUST
from updating.inference.fit_result import FitResult
from updating.inference.heartbeat import beat
from updating.inference.problem import Problem
from updating.inference.unknowns import log_occam_factor
from updating.least_squares.costs import pseudo_huber

POWER = 0.9
"""Probability with which an effect of a stated size is seen, or named [-]."""
SURE = 0.9
"""Posterior probability from which on it is [-]."""
KNOWN = 4.0
"""A size that is barely seen is about so many of its standard deviations."""
MOST_POSITIONS = 4_000
"""Of more positions of all effects together, each effect is looked at on fewer, evenly spaced: minutes."""
LEAST_SINE_SQUARE = 1e-9
"""Effects whose changes have a smaller angle between them are the same at any size."""
N_WITHIN, SHORTER = 5, 0.7
"""A size beyond the bounds of a parameter is tried so often as a shorter one, by about this factor [-]."""
N_LARGER, NEARLY = 6, 0.7
"""A size that gains less than this part of what is wanted is doubled this many times at most [-]."""
LEAST_GAIN = 1e-3
"""Gains below this are none [nats]."""
N_AT_ONCE = 500
"""So many effects are compared with all others at a time."""
SOLVED_TOGETHER = 32
"""Sizes of so many candidates are solved for at a time."""

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
    little : Little
        A little of the effect.
    position : int
        Which of its positions.
    enough : (float, float, float)
        Least multiples of a little at which something must be missing, it must be at the places of this
        effect, and it must be this effect; whatever is plausible.
    nats : (float, float)
        Gains in log likelihood that are expected of the first and the last of these, over nothing and over
        the last rival.
    rival : Effect
        That, of about the size at which it is seen: it imitates the effect best.
    alike : float
        Cosine of the angle between what both do [-].
    length : float
        Of a little of it in whitened residuals, beyond all that may vary.
    moved : ndarray (n_refs,)
        How far uncertain parameters move against a little of it, as of :meth:`Look.moved`.
    """

    little: Little
    position: int
    enough: tuple[float, float, float]
    nats: tuple[float, float]
    rival: Effect
    alike: float
    length: float
    moved: Floats

    @property
    def effect(self) -> Effect:
        """The effect at the position, with size zero."""
        return self._of(0.0)

    @property
    def slight(self) -> Effect:
        """A little of the effect, of amplitude 1."""
        return self._of(1.0)

    @property
    def least(self) -> float:
        """The size, from none, at which something must be missing, plausible or not."""
        return self.enough[0] * size_of(self.slight)

    @property
    def seen(self) -> Effect | None:
        """The least size at which something must be missing; None where there is none."""
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
        """Return the effect as large as a multiple of its little; None if its parameter has no such value."""
        there = self.little.side(self.position, amplitude)
        return None if np.isnan(there) else self._of(there)

    def is_plausible(self, amplitude: float) -> bool:
        """Whether candidates are tried up to that size."""
        return bool(amplitude <= self.little.most[self.position])

    def amplitude(self, effect: Effect) -> float:
        """Return as what multiple of its little the effect acts at another size."""
        return size_of(effect) / size_of(self.slight)

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


def sized(effect: Effect, value: float) -> Effect:
    """Return an effect with a value of its first parameter, or the bound next to it."""
    p = effect.parameters()[0]
    return effect.with_values(**{p.name: float(np.clip(value, p.lower, p.upper))})


def size_of(effect: Effect) -> float:
    """Return how far an effect is from none by its first parameter; a stiffness counts as flexibility."""
    p = effect.parameters()[0]
    return abs(distance(p, float(p.value)))


@dataclass(frozen=True, eq=False)
class Visibility:
    """What a test could see and name.

    Attributes
    ----------
    problem : Problem
    base : FitResult
        The model without the effects.
    odds : Odds
    discrepancy : float or None
        Level that a right model will leave, besides noise; None for data whose residuals show it [nepers].
    averaged : float
        Averages so far over those that there will be [-].
    forecast : Forecast
        What a little of each candidate does at each of its positions.
    against : ndarray (n,)
        Log odds against each beforehand.
    """

    problem: Any
    base: FitResult
    odds: Odds
    discrepancy: float | None
    averaged: float
    forecast: Forecast
    against: Floats

    @cached_property
    def effects(self) -> tuple[Visible, ...]:
        """Each candidate at each of its positions."""
        return self.at(np.arange(len(self.against)))

    def at(self, rows: Ints) -> tuple[Visible, ...]:
        """Return some candidates at positions, by their numbers; all are their rivals."""
        forecast, against = self.forecast, self.against
        if not len(rows):
            return ()
        owner, littles, wanted = forecast.owner, forecast.littles, needed(against)
        seen = amplitudes_as_solved(forecast, wanted, self.discrepancy, self.averaged, rows)
        most = np.concatenate([little.most for little in littles])
        slight = np.clip(least_amplitudes(forecast, wanted, self.discrepancy, self.averaged), 1.0, most)
        located, named, rival, alike = self._rivals.separation_amplitudes(rows, seen, wanted[rows])
        over_rival = np.where(named > (1 + 1e-6) * seen, needed(against[rows] - against[rival]), wanted[rows])
        located, named = (self._as_solved(rows, each, seen) for each in (located, named))
        named = np.maximum(located, named)  # both are solved for roughly
        return tuple(
            Visible(
                little=littles[owner[i]],
                position=int(forecast.place[i]),
                enough=(seen[n], located[n], named[n]),
                nats=(float(wanted[i]), float(over_rival[n])),
                rival=forecast.effect_at(j, float(slight[j])),
                alike=float(alike[n]),
                length=float(self._rivals.lengths[i]),
                moved=forecast.moved[i],
            )
            for n, (i, j) in enumerate(zip(rows.tolist(), rival.tolist(), strict=True))
        )

    def _as_solved(self, rows: Ints, least: Floats, seen: Floats) -> Floats:
        """Return amplitudes that gain as much more than what is seen as the ``least`` do of small effects.

        A release that is nearly free does hardly more where it is freer: it and its rival both saturate.
        """
        forecast, out, wanted = self.forecast, least.copy(), needed(self.against)
        more = np.isfinite(least) & (least > (1 + 1e-6) * seen)
        which, goal = rows[more], np.full(len(wanted), np.inf)
        as_seen = least_amplitudes(forecast, wanted, self.discrepancy, self.averaged)[which]
        squares = forecast.squares[which]
        expected = _expected(forecast, self.discrepancy, self.averaged)
        goal[which] = expected.gains(least[more] / seen[more] * as_seen, squares[:, :-1], squares[:, -1])
        out[more] = amplitudes_as_solved(forecast, goal, self.discrepancy, self.averaged, which)
        return np.maximum(out, seen)

    def slight(self, effect: Effect) -> Effect:
        """Return a little of an effect at one of its positions, of whatever size it is given."""
        little = next(o for o in self.forecast.littles if o.grid.effect.name == effect.name)
        names = [p.name for p in effect.parameters()[1:]]
        there = parameter_values(effect)
        off = [sum(abs(there[name] - point[name]) for name in names) for point in little.points]
        return effect.with_values(**little.points[int(np.argmin(off))])

    @cached_property
    def _rivals(self) -> "Rivals":
        return Rivals.of(self.forecast, self.against)

    def hidden_by(self, some: Sequence[Visible]) -> list[tuple[ParameterRef, Visible, float]]:
        """Return the uncertain parameters that hide most of a kind of effect, by :meth:`Look.hidden_by`.

        With each comes the place at which that kind is then seen best, and the least multiple there.
        """
        some = [x for x in some if np.isfinite(x.least) and x.length > 0]
        lengths, sizes = (np.array([getattr(x, key) for x in some]) for key in ("length", "least"))
        moved = np.array([x.moved for x in some])
        found = self.forecast.look.hidden_by(lengths, moved, sizes)
        return [(ref, x := some[k], x.enough[0] / factor) for ref, k, factor in found]


def visibility(
    problem: Problem[Any],
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
    problem : Problem
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
    if averaged != 1:
        problem = replace(problem, data=problem.data.averaged(averaged))
    forecast = Forecast.at(
        problem,
        base,
        candidates,
        besides=discrepancy,
        bounded=False,
        n_places=max(1, MOST_POSITIONS // max(len(candidates), 1)),
        vectors=True,
        say=lambda done: say("what a little of each effect does", 0.7 * done),
    )
    n_places = np.bincount(forecast.owner, minlength=len(candidates))
    each = [odds_against(problem, e, odds, int(n)) for e, n in zip(candidates, n_places, strict=True)]
    say("what is alike", 0.8)
    return Visibility(problem, base, odds, discrepancy, averaged, forecast, np.array(each)[forecast.owner])


def odds_against(problem: Problem[Any], effect: Effect, odds: Odds, n_positions: int) -> float:
    """Return the log odds against an effect of one size at one of its positions, which might be any of many.

    As if its size were known to a ``KNOWN``th of itself.
    """
    return odds.against((), (effect,)) - log_occam_factor(problem, effect, KNOWN, n_positions)


def level_left(forecast: Forecast, discrepancy: float | None, averaged: float = 1.0) -> Floats:
    """Return the mean squares of the residuals of each group that a right model leaves, (n_groups,)."""
    look = forecast.look
    level: Floats = pseudo_huber(look.now, ROBUST) @ look.share
    noise = look.likelihood.noise / SYSTEMATIC_FROM**2
    if discrepancy is None:  # measured residuals have the noise of the averages so far
        return np.maximum(level - (1 / averaged - 1) * noise, averaged * level)
    return level + noise + discrepancy**2


def _expected(forecast: Forecast, discrepancy: float | None, averaged: float) -> ExpectedGains:
    """Return the gains that are to be expected of what a forecast has looked at."""
    look, m = forecast.look, len(forecast.look.share)
    J, known = look.slopes[:, : 2 * m] * np.sqrt(np.tile(look.weights[:m], 2)), look.slopes[:, 2 * m :]
    groups = np.tile(look.share > 0, (2, 1)).T
    information = Information.of([J[:, here] for here in groups], len(J), 0)
    level = level_left(forecast, discrepancy, averaged)
    return ExpectedGains(look.likelihood, level, *information.learned(known @ known.T))


def gain_at(forecast: Forecast, i: int, factor: float, discrepancy: float | None) -> float:
    """Return the expected gain of a multiple at the i-th place, by which sizes are stated [nats]."""
    solved = forecast.squares_at(np.array([i]), np.array([factor]))
    return float(_gains(_expected(forecast, discrepancy, 1.0), forecast.squares[[i]], *solved)[0])


def least_amplitudes(
    forecast: Forecast, wanted: Floats, discrepancy: float | None, averaged: float = 1.0
) -> Floats:
    """Return the multiples (n,) of a little that gain what is wanted (n,) [nats]; infinite if none does."""
    squares = forecast.squares
    return _expected(forecast, discrepancy, averaged).multiples(squares[:, :-1], squares[:, -1], wanted)


def amplitudes_as_solved(
    forecast: Forecast,
    wanted: Floats,
    discrepancy: float | None,
    averaged: float = 1.0,
    rows: Ints | None = None,
) -> Floats:
    """Return :func:`least_amplitudes` by gains of sizes as they are, rather than of multiples of a change.

    A spring far stiffer than what it acts on holds it, and stiffer ones do no more; a loss of nearly all
    stiffness does more. A size that the parameters cannot have is not solved for. Of all places, or of those
    in ``rows``.
    """
    rows = np.arange(len(wanted)) if rows is None else rows
    expected, out = _expected(forecast, discrepancy, averaged), np.empty(len(rows))
    # The sizes of few candidates after those of others: what is known of a place serves all of them.
    owners = np.unique(forecast.owner[rows])
    for first in range(0, len(owners), SOLVED_TOGETHER):
        some = np.isin(forecast.owner[rows], owners[first : first + SOLVED_TOGETHER])
        out[some] = _as_solved(forecast, expected, rows[some], wanted[rows[some]])
    return out


def _as_solved(forecast: Forecast, expected: ExpectedGains, which: Ints, wanted: Floats) -> Floats:
    squares = forecast.squares[which]
    least = expected.multiples(squares[:, :-1], squares[:, -1], wanted)

    def gains(rows: Ints, size: Floats) -> Floats:
        solved, effective = forecast.squares_at(which[rows], size)
        return np.maximum(_gains(expected, squares[rows], solved, effective), LEAST_GAIN)

    low = least.copy()
    gained = np.full(len(least), np.nan)
    outside = np.flatnonzero(np.isfinite(least))
    for _ in range(N_WITHIN):  # what grows more than linearly may suffice where its parameter ends
        gained[outside] = gains(outside, low[outside])
        outside = outside[np.isnan(gained[outside])]
        low[outside] *= SHORTER
    ratio = wanted / gained  # not a number of what is not solved for
    out = np.where(ratio > 0, low * np.sqrt(ratio), least)
    # Between two sizes the gain is as a power of the size.
    more = np.flatnonzero(ratio < NEARLY)
    power = np.log(gained[more] / (now := gains(more, out[more]))) / np.log(low[more] / out[more])
    out[more] *= (wanted[more] / now) ** (1 / np.maximum(power, 1.0))
    less, before = np.flatnonzero(ratio > 1 / NEARLY), gained.copy()
    out[less] = np.inf
    for _ in range(N_LARGER):
        step = np.full(len(less), 2.0)
        now = gains(less, step * low[less])
        for _ in range(N_WITHIN):  # up to where the parameter ends
            beyond = np.flatnonzero(np.isnan(now))
            step[beyond] = np.sqrt(step[beyond])
            now[beyond] = gains(less[beyond], step[beyond] * low[less[beyond]])
        enough = now >= wanted[less]
        done = less[enough]
        part = np.log(wanted[done] / before[done]) / np.log(now[enough] / before[done])
        out[done] = low[done] * step[enough] ** part
        short = now < wanted[less]
        less, now, step = less[short], now[short], step[short]
        low[less], before[less] = step * low[less], now
    return out


def _gains(expected: ExpectedGains, squares: Floats, solved: Floats, effective: Floats) -> Floats:
    """Return expected gains (n,): of the effective multiples of a change, but at most twice those solved for.

    Where unknowns follow to the first order they follow too well: fits gained once to twice as much. Not a
    number of what is not solved for.
    """
    out, known = np.full(len(effective), np.nan), np.isfinite(effective)
    some, solved, squares = effective[known], solved[known], squares[known]
    as_solved = expected.gains(np.ones(len(some)), solved[:, :-1], solved[:, -1])
    out[known] = np.minimum(expected.gains(some, squares[:, :-1], squares[:, -1]), 2 * as_solved)
    return out


def _followed(littles: Sequence[Little]) -> Ints:
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


@dataclass(frozen=True, slots=True, eq=False)
class Rivals:
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
    both : ndarray of bool (n,)
        Whether each may have either sign.
    against : ndarray (n,)
        Log odds against each beforehand.
    unlike, apart : ndarray of bool (n_candidates, n_candidates)
        Which are no rivals, since the second is the first or contains it, and which act at other places.
    """

    lengths: Floats
    units: Floats
    owner: Ints
    column: Ints
    both: Bools
    against: Floats
    unlike: Bools
    apart: Bools

    @classmethod
    def of(cls, forecast: Forecast, against: Floats) -> "Rivals":
        """Tell which candidates are no rivals, and which act at other places."""
        candidates, owner, vectors = forecast.candidates, forecast.owner, forecast.vectors
        both = np.array([not o.grid.one_sided() for o in forecast.littles], dtype=bool)[owner]
        followed = _followed(forecast.littles)
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
        return cls(lengths, units, owner, column, both, against, unlike, apart)

    def separation_amplitudes(
        self, which: Ints, seen: Floats, enough: Floats
    ) -> tuple[Floats, Floats, Ints, Floats]:
        """Return the least amplitudes that separate effects from their rivals at their best, (n,) each.

        From all at other places, and from all; then of the last rival its number and the cosine of the angle
        between what both do.

        Parameters
        ----------
        which : ndarray of int (n,)
            Numbers of the effects.
        seen, enough : ndarray (n,)
            Amplitudes at which they are seen, and gains there [nats].
        """
        n, owner, last_row = len(which), self.owner[self.column], len(self.owner) - 1
        elsewhere, anywhere, rival, alike = np.zeros(n), np.zeros(n), np.zeros(n, dtype=np.int64), np.zeros(n)
        for first in range(0, n, N_AT_ONCE):
            beat()
            here = slice(first, first + N_AT_ONCE)
            rows = which[here]
            cosine = self.cosines(rows)
            like, apart = (m[self.owner[rows]][:, owner] for m in (~self.unlike, self.apart))
            least = np.where(like, self._least(seen[here], enough[here], rows, cosine), 0.0)
            elsewhere[here] = np.maximum(np.where(apart, least, 0.0).max(axis=1), seen[here])
            anywhere[here] = np.maximum(least.max(axis=1), seen[here])
            last = least.argmax(axis=1)
            each, k = np.arange(len(rows)), self.column[last]
            farther = np.abs(cosine[each, np.minimum(k + 1, last_row)]) > np.abs(cosine[each, k])
            rival[here] = k + (farther & (last > last_row))
            alike[here] = np.abs(cosine[each, last])
        return elsewhere, anywhere, rival, alike

    def cosines(self, rows: Ints) -> Floats:
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

        With x as long as what an effect does, and c = ρx what its rival does along it, x² (1 - ρ²) must be as
        large as what is seen squared, times the gain that is needed over that which is enough. A rival of the
        wrong sign does nothing along it.
        """
        visible = np.isfinite(seen) & (self.lengths[rows] > 0)
        length = np.where(visible, self.lengths[rows], 1.0)[:, None]
        there = (np.where(visible, seen, 1.0)[:, None] * length) ** 2
        square = there * needed(self.against[rows][:, None] - self.against[self.column]) / enough[:, None]
        rho = np.where((cosine > 0) | self.both[self.column], cosine, 0.0)
        x = np.sqrt(square / np.maximum(1 - rho**2, LEAST_SINE_SQUARE))
        return np.where(
            visible[:, None], np.where(rho**2 > 1 - LEAST_SINE_SQUARE, np.inf, x) / length, np.inf
        )
