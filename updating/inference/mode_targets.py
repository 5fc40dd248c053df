"""Measured natural frequencies, damping and shapes as data of fits, and how computed modes meet them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from fem.array_types import Bools, Floats, Ints
from fem.summary import fields_summary
from updating.measurement.measurement import Sensor, shapes_like_motions

LIKENESS = 3.0
"""How much more the logarithm of a frequency ratio weighs than 1 - MAC where modes are matched [-]."""
FAR = 0.5
"""Logarithm of a frequency ratio beyond which modes are no partners [-]."""
LEAST_MAC = 0.2
"""Least modal assurance criterion of partners [-]."""
UNSEEN_NATS = 3.0
"""Cost of a computed mode among the measured ones that a test has not seen [nats]."""
SPREAD_BEFORE = 0.05
"""Standard deviation of the logarithm of a frequency ratio before a fit, for pairs by their order [-]."""
ALIEN_WIDTH = 0.3
"""The same of a frequency that does not belong to the model: as of another mode [-]."""

PAIRED, PASSED_OVER, LEFT_OUT = range(3)
"""Steps along two lists of modes in order: a pair, a computed mode alone, a measured one alone."""


@dataclass(frozen=True, slots=True, eq=False)
class ModeTargets:
    """Measured modes.

    Attributes
    ----------
    frequency : ndarray (n,)
        Rising, without those of rigid bodies [Hz].
    frequency_std : ndarray (n,)
        Relative standard deviations [-].
    zeta, zeta_std : ndarray (n,)
        Damping ratios and their relative standard deviations, NaN where they were not measured [-].
    shapes : ndarray (n_out, n)
        Each of length 1, real or complex; NaN at outputs at which a mode was not measured. Without shapes
        there are no rows.
    shape_std : ndarray (n,)
        Standard deviation of a component, relative to the root mean square of the shape [-].
    sensors : tuple of Sensor
        Of the rows of the shapes; without shapes those of the test.
    driven : tuple of Sensor
        Forces of the test, if they are known: modes that none of them moves were not measured.
    numbers : ndarray of int (n,) or None
        Which elastic modes of the nominal model they are, counted from 0.
    plane : str
        Axes along which the test has seen motion, such as ``"xz"``; empty for all.
    held_out : ndarray of bool (n,)
        Modes that no fit sees.
    name : str
        Where they come from.
    """

    frequency: Floats
    frequency_std: Floats
    zeta: Floats
    zeta_std: Floats
    shapes: NDArray[np.number]
    shape_std: Floats
    sensors: tuple[Sensor, ...]
    numbers: Ints | None
    plane: str
    held_out: Bools
    name: str = "modes"
    driven: tuple[Sensor, ...] = ()

    __repr__ = fields_summary

    @classmethod
    def of(
        cls,
        frequency: Floats,
        frequency_std: Floats | float,
        *,
        zeta: Floats | None = None,
        zeta_std: Floats | float = 0.1,
        shapes: NDArray[np.number] | None = None,
        shape_std: Floats | float = 0.03,
        sensors: Sequence[Sensor] = (),
        numbers: Sequence[int] | None = None,
        plane: str = "",
        held_out: Sequence[int] = (),
        name: str = "modes",
        driven: Sequence[Sensor] = (),
    ) -> "ModeTargets":
        """Return measured modes in rising order, shapes of length 1; ``held_out`` counts from 0 as given.

        Strains count as much as motions (:func:`updating.measurement.measurement.shapes_like_motions`).
        """
        f = np.asarray(frequency, dtype=float)
        n, order = len(f), np.argsort(f, kind="stable")
        each = [
            np.broadcast_to(np.asarray(s, dtype=float), (n,))[order]
            for s in (frequency_std, np.full(n, np.nan) if zeta is None else zeta, zeta_std, shape_std)
        ]
        psi = np.zeros((0, n)) if shapes is None else np.asarray(shapes)
        if len(psi) and len(sensors) == len(psi):
            psi, sensors = shapes_like_motions(psi, sensors)
        length = np.sqrt(np.nansum(np.abs(psi) ** 2, axis=0))
        psi = (psi / np.where(length > 0, length, 1.0))[:, order]
        is_held_out = np.zeros(n, dtype=bool)
        is_held_out[list(held_out)] = True
        sorted_numbers = None if numbers is None else np.asarray(numbers, dtype=np.int64)[order]
        return cls(
            frequency=f[order],
            frequency_std=each[0],
            zeta=np.where(each[1] > 0, each[1], np.nan),
            zeta_std=each[2],
            shapes=psi,
            shape_std=each[3],
            sensors=tuple(sensors),
            numbers=sorted_numbers,
            plane=plane,
            held_out=is_held_out[order],
            name=name,
            driven=tuple(driven),
        )

    def with_deviations(self, factor: float) -> "ModeTargets":
        """Return the same modes with standard deviations that are larger by a factor."""
        return replace(
            self,
            frequency_std=factor * self.frequency_std,
            zeta_std=factor * self.zeta_std,
            shape_std=factor * self.shape_std,
        )

    @property
    def n(self) -> int:
        """Number of modes."""
        return len(self.frequency)

    @property
    def has_shapes(self) -> bool:
        """Whether there are shapes."""
        return len(self.shapes) > 1

    @property
    def directed(self) -> bool:
        """Whether anything says which of the model's modes the test can have seen."""
        named = self.numbers is not None or bool(self.plane)
        return named or self.has_shapes or bool(self.sensors) or bool(self.driven)

    @property
    def arrays(self) -> tuple[NDArray[Any], ...]:
        """Numbers on which a fit depends."""
        return self.frequency, self.frequency_std, self.shapes, self.shape_std

    @property
    def has_damping(self) -> bool:
        """Whether the damping of any mode that is fitted was measured."""
        return bool(np.isfinite(self.zeta[self.fitted]).any())

    @property
    def noise_level(self) -> float:
        """Relative deviation that the noise of the frequencies of a fit leaves, root mean square [-]."""
        return float(np.sqrt((self.frequency_std[self.fitted] ** 2).mean()))

    @property
    def fitted(self) -> Ints:
        """Modes that fits see."""
        return np.flatnonzero(~self.held_out)


@dataclass(frozen=True, slots=True, eq=False)
class ComputedModes:
    """Computed partners of measured modes; NaN where there is none.

    Attributes
    ----------
    frequency : ndarray (n,)
        [Hz].
    zeta, mac : ndarray (n,)
        Damping ratio, and modal assurance criterion where there are shapes [-].
    partner : ndarray of int (n,)
        Numbers of the computed modes, those of rigid bodies included; -1 for none.
    """

    frequency: Floats
    zeta: Floats
    mac: Floats
    partner: Ints


@dataclass(frozen=True, slots=True, eq=False)
class Matched:
    """Computed modes that belong to measured ones.

    Attributes
    ----------
    partner : ndarray of int (n,)
        Computed mode of each measured one, -1 where it has none.
    mac : ndarray (n,)
        Modal assurance criterion with the partner; NaN without shapes [-].
    """

    partner: Ints
    mac: Floats


def match(
    targets: ModeTargets,
    frequency: Floats,
    shapes: NDArray[np.number],
    seen: Bools,
    spread: Floats | float = SPREAD_BEFORE,
    alien: float = 0.0,
) -> Matched:
    """Find the computed partner of each measured mode; parameters as of :func:`match_each`, of one model."""
    each = match_each(targets, frequency[None], shapes[None], seen[None], spread, alien)
    return Matched(each.partner[0], each.mac[0])


def match_each(
    targets: ModeTargets,
    frequency: Floats,
    shapes: NDArray[np.number],
    seen: Bools,
    spread: Floats | float = SPREAD_BEFORE,
    alien: float = 0.0,
) -> Matched:
    """Find the computed partner of each measured mode in each of k models, (k, n).

    With shapes so that the sum of MAC less ``LIKENESS`` |ln f ratio| is largest: modes that have crossed keep
    their partners. Without, in the order of frequencies; a computed mode between two measured ones may have
    been missed by the test, and a measured one may be none of the model's, at a cost. With numbers as they
    say: they count the modes that a test can see.

    Parameters
    ----------
    targets : ModeTargets
    frequency : ndarray (k, m)
        Of the computed modes, rising [Hz].
    shapes : ndarray (k, n_out, m)
        At the sensors.
    seen : ndarray of bool (k, m)
        Which of them a test can see.
    spread : float or ndarray (n,)
        Standard deviation of the logarithm of a frequency ratio, for pairs by their order [-].
    alien : float
        Prior probability that a measured mode is none of the model's [-].
    """
    n, k = targets.n, len(frequency)
    partner, value = np.full((k, n), -1), np.full((k, n), np.nan)
    if targets.has_shapes:
        ratio = targets.frequency[:, None] / np.maximum(frequency, 1e-300)[:, None]
        off, mac = np.abs(np.log(ratio)), mac_of(targets.shapes, shapes)
        possible = (off < FAR) & (mac >= LEAST_MAC) & seen[:, None]
        cost = np.where(possible, LIKENESS * off - mac, 1e3)
        for i in range(k):
            allowed = np.flatnonzero(seen[i])
            rows, columns = scipy.optimize.linear_sum_assignment(cost[i][:, allowed])
            columns = allowed[columns]
            ok = possible[i, rows, columns]
            partner[i, rows[ok]] = columns[ok]
        value = np.where(
            partner >= 0, np.take_along_axis(mac, np.maximum(partner, 0)[:, :, None], 2)[..., 0], value
        )
        return Matched(partner, value)
    # The modes that can be seen come first, in their order.
    allowed, n_allowed = np.argsort(~seen, axis=1, kind="stable"), seen.sum(axis=1)
    if targets.numbers is not None:
        number = np.broadcast_to(targets.numbers, (k, n))
    else:
        sorted_frequency = np.take_along_axis(frequency, allowed, axis=1)
        number = _in_order(targets, sorted_frequency, n_allowed, spread, alien)
    there = (number >= 0) & (number < n_allowed[:, None])
    of_number = np.take_along_axis(allowed, np.clip(number, 0, allowed.shape[1] - 1), axis=1)
    return Matched(np.where(there, of_number, -1), value)


def mac_of(measured: NDArray[np.number], computed: NDArray[np.number]) -> Floats:
    """Return the modal assurance criterion (..., n, m) over the outputs that each measured shape has."""
    known = ~np.isnan(measured)
    psi = np.where(known, measured, 0.0)
    cross = np.abs(psi.conj().T @ computed) ** 2
    size = (known.T.astype(float)) @ (np.abs(computed) ** 2)
    return cross / np.maximum((np.abs(psi) ** 2).sum(axis=0)[:, None] * size, 1e-300)


def _in_order(
    targets: ModeTargets, frequency: Floats, n_allowed: Ints, spread: Floats | float, alien: float
) -> Ints:
    """Return numbers of partners that rise with the measured modes, by dynamic programming; -1 for none.

    The cost is Σ ½ ρ(ln f ratio / s), and ``UNSEEN_NATS`` for each computed mode that is passed over. Where a
    measured mode may be none of the model's, a pair costs no more than that: -ln[exp(-½ ρ) + π s/b]. Of the
    frequencies (k, m) the first ``n_allowed`` of each model count.
    """
    n, models = targets.n, np.arange(len(frequency))
    n_allowed = np.minimum(n_allowed, 3 * n + 6)
    m = int(n_allowed.max(initial=0))
    s = np.broadcast_to(spread, n)[:, None]
    off = np.log(targets.frequency[:, None] / np.maximum(frequency[:, None, :m], 1e-300))
    cost = 2 * (np.sqrt(1 + (off / s) ** 2 / 2) - 1) * 2
    left_out = np.full(n, np.inf)
    if alien:
        odds = np.log(alien * s / ALIEN_WIDTH)
        cost = -np.logaddexp(-cost, odds - 0.5 * (off / ALIEN_WIDTH) ** 2)
        left_out = -odds[:, 0] + 0.5 * (FAR / ALIEN_WIDTH) ** 2
    cost = np.where(np.arange(m) < n_allowed[:, None, None], cost, np.inf)
    passed = UNSEEN_NATS * np.arange(m + 1)
    step = np.zeros((n + 1, len(models), m + 1), dtype=np.int64)
    best = np.tile(passed, (len(models), 1))
    pair = np.full(best.shape, np.inf)
    for i in range(n):
        pair[:, 1:] = best[:, :-1] + cost[:, i]
        alone = best + left_out[i]
        ending = np.minimum(pair, alone) - passed
        least = np.minimum.accumulate(ending, axis=1)
        step[i + 1] = np.where(least < ending, PASSED_OVER, np.where(pair <= alone, PAIRED, LEFT_OUT))
        best = least + passed
    out, i, j = np.full((len(models), n), -1), np.full(len(models), n), np.argmin(best, axis=1)
    while (on := (i > 0) & (j > 0)).any():
        way = np.where(on, step[i, models, j], -1)
        paired = way == PAIRED
        out[models[paired], i[paired] - 1] = j[paired] - 1
        i, j = i - (on & (way != PASSED_OVER)), j - (on & (way != LEFT_OUT))
    if not alien:
        # Too few modes for all that were measured: the lowest are the lowest.
        few = n_allowed < n
        out[few] = np.where(np.arange(n) < n_allowed[few][:, None], np.arange(n), -1)
    return out
