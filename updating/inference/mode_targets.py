"""Measured natural frequencies, damping and shapes as data of fits, and how computed modes meet them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

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

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


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
    numbers: NDArray[np.int64] | None
    plane: str
    held_out: NDArray[np.bool_]
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
    def fitted(self) -> NDArray[np.int64]:
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
    partner: NDArray[np.int64]


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

    partner: NDArray[np.int64]
    mac: Floats


def match(
    targets: ModeTargets,
    frequency: Floats,
    shapes: NDArray[np.number],
    seen: NDArray[np.bool_],
    spread: Floats | float = SPREAD_BEFORE,
    alien: float = 0.0,
) -> Matched:
    """Find the computed partner of each measured mode.

    With shapes so that the sum of MAC less ``LIKENESS`` |ln f ratio| is largest: modes that have crossed keep
    their partners. Without, in the order of frequencies; a computed mode between two measured ones may have
    been missed by the test, and a measured one may be none of the model's, at a cost. With numbers as they
    say: they count the modes that a test can see.

    Parameters
    ----------
    targets : ModeTargets
    frequency : ndarray (m,)
        Of the computed modes, rising [Hz].
    shapes : ndarray (n_out, m)
        At the sensors.
    seen : ndarray of bool (m,)
        Which of them a test can see.
    spread : float or ndarray (n,)
        Standard deviation of the logarithm of a frequency ratio, for pairs by their order [-].
    alien : float
        Prior probability that a measured mode is none of the model's [-].
    """
    n, nothing = targets.n, np.full(targets.n, np.nan)
    allowed = np.flatnonzero(seen)
    if targets.has_shapes:
        mac = mac_of(targets.shapes, shapes[:, allowed])
        off = np.abs(np.log(targets.frequency[:, None] / np.maximum(frequency[allowed], 1e-300)))
        possible = (off < FAR) & (mac >= LEAST_MAC)
        rows, columns = scipy.optimize.linear_sum_assignment(np.where(possible, LIKENESS * off - mac, 1e3))
        partner = np.full(n, -1)
        ok = possible[rows, columns]
        partner[rows[ok]] = allowed[columns[ok]]
        value = nothing.copy()
        value[rows[ok]] = mac[rows[ok], columns[ok]]
        return Matched(partner, value)
    if targets.numbers is not None:
        partner = np.where(targets.numbers < len(allowed), targets.numbers, -1)
        return Matched(np.where(partner >= 0, allowed[np.minimum(partner, len(allowed) - 1)], -1), nothing)
    return Matched(_in_order(targets, frequency, allowed, spread, alien), nothing)


def mac_of(measured: NDArray[np.number], computed: NDArray[np.number]) -> Floats:
    """Return the modal assurance criterion (n, m) over the outputs that each measured shape has."""
    known = ~np.isnan(measured)
    psi = np.where(known, measured, 0.0)
    cross = np.abs(psi.conj().T @ computed) ** 2
    size = (known.T.astype(float)) @ (np.abs(computed) ** 2)
    return cross / np.maximum((np.abs(psi) ** 2).sum(axis=0)[:, None] * size, 1e-300)


def _in_order(
    targets: ModeTargets,
    frequency: Floats,
    allowed: NDArray[np.int64],
    spread: Floats | float,
    alien: float,
) -> NDArray[np.int64]:
    """Return partners that rise with the measured modes, by dynamic programming; -1 for none.

    The cost is Σ ½ ρ(ln f ratio / s), and ``UNSEEN_NATS`` for each computed mode that is passed over. Where a
    measured mode may be none of the model's, a pair costs no more than that: -ln[exp(-½ ρ) + π s/b].
    """
    n, m = targets.n, min(len(allowed), 3 * targets.n + 6)
    if m < n and not alien:
        return np.concatenate([allowed, np.full(n - m, -1)])[:n]
    s = np.broadcast_to(spread, n)[:, None]
    off = np.log(targets.frequency[:, None] / np.maximum(frequency[allowed[:m]], 1e-300))
    cost = 2 * (np.sqrt(1 + (off / s) ** 2 / 2) - 1) * 2
    left_out = np.full(n, np.inf)
    if alien:
        odds = np.log(alien * s / ALIEN_WIDTH)
        cost = -np.logaddexp(-cost, odds - 0.5 * (off / ALIEN_WIDTH) ** 2)
        left_out = -odds[:, 0] + 0.5 * (FAR / ALIEN_WIDTH) ** 2
    passed = UNSEEN_NATS * np.arange(m + 1)
    step = np.zeros((n + 1, m + 1), dtype=np.int64)
    best = passed
    for i in range(n):
        pair, alone = np.append(np.inf, best[:-1] + cost[i]), best + left_out[i]
        ending = np.minimum(pair, alone) - passed
        least = np.minimum.accumulate(ending)
        step[i + 1] = np.where(least < ending, PASSED_OVER, np.where(pair <= alone, PAIRED, LEFT_OUT))
        best = least + passed
    out, i, j = np.full(n, -1), n, int(np.argmin(best))
    while i > 0 and j > 0:
        way = step[i, j]
        if way == PAIRED:
            out[i - 1] = allowed[j - 1]
        i, j = i - (way != PASSED_OVER), j - (way != LEFT_OUT)
    return out
