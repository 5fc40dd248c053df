"""Modes of several set-ups with common sensors, merged to shapes at all sensors.

Each set-up is identified by itself, then shapes are joined (post-separate-estimation re-scaling, PoSER). The
scales of the parts follow from the sensors that several set-ups share, all at once: no set-up comes first
(S. K. Au, *Mech. Syst. Signal Process.* 25, 2011, 163).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy.linalg import eigh

from fem.analysis.modes import Modes
from fem.array_types import Bools, Complexes, Floats
from fem.summary import fields_summary
from updating.ambient.ambient_modes import AmbientModes, relative_std, unexplained_words
from updating.ambient.clusters import CONFIDENCE
from updating.ambient.record import AmbientError

HEAD = "mode  frequency [Hz]        damping ratio [%]     set-ups  scatter  shape ± [%]  MAC"
Members = dict[int, int]
"""The mode of each set-up that has one, by the number of the set-up."""


@dataclass(frozen=True, slots=True, eq=False)
class MergedModes:
    """Modes of several set-ups; their shapes have no scale.

    Attributes
    ----------
    modes : Modes
        Means of natural frequencies and damping ratios over the set-ups, weighted by their variances, and
        real shapes at all channels with a largest entry of 1. NaN at channels whose set-ups have not found
        the mode.
    frequency_std, zeta_std : ndarray (n_modes,)
        Standard deviations of the means, larger where set-ups scatter by more than they state [Hz, -].
    shape_std : ndarray (n_channels, n_modes)
        Standard deviations of ``modes.shapes`` for a shape of fixed length.
    agreement : ndarray (n_modes,)
        Least MAC of a set-up's shape with the merged one at the sensors that several set-ups share; NaN
        where there are fewer than two of these, or one set-up [-].
    scatter : ndarray (n_modes,)
        Root mean square of the frequencies' deviations from their mean over the set-ups, in standard
        deviations; NaN with one set-up [-].
    members : tuple of dict
        For each mode its number in each set-up that has it.
    set_ups : tuple of AmbientModes
    """

    modes: Modes
    frequency_std: Floats
    zeta_std: Floats
    shape_std: Floats
    agreement: Floats
    scatter: Floats
    members: tuple[Members, ...]
    set_ups: tuple[AmbientModes, ...]

    __repr__ = fields_summary

    @property
    def duration(self) -> float:
        """Length of all records together [s]."""
        return sum(s.duration for s in self.set_ups)

    def relative_std(self, least_shape: float = 0.01) -> tuple[Floats, Floats]:
        """Return standard deviations as those of :class:`AmbientModes`."""
        return relative_std(self.modes, self.frequency_std, self.shape_std, least_shape)

    @property
    def unexplained(self) -> tuple[str, ...]:
        """Peaks that no mode explains, in words, by set-up."""
        each = enumerate(self.set_ups, 1)
        return tuple(f"set-up {k}: {text}" for k, s in each for text in unexplained_words(s.unexplained))

    def table(self) -> str:
        """Return the modes as lines of text, then peaks that they do not explain."""
        zeta = np.zeros(0) if self.modes.zeta is None else self.modes.zeta
        noise = self.relative_std(0.0)[1]
        lines = [HEAD]
        for k, f in enumerate(self.modes.frequency):
            lines.append(
                f"{k + 1:4d}  {f:9.4g} ± {self.frequency_std[k]:<8.2g}  {100 * zeta[k]:8.3f} ± "
                f"{100 * self.zeta_std[k]:<8.2g}  {len(self.members[k]):7d}  "
                f"{_or_dash(self.scatter[k], 7, 2)}  "
                f"{100 * noise[k]:11.2g}  {_or_dash(self.agreement[k], 5, 3)}"
            )
        return "\n".join([*lines, *self.unexplained])


def _or_dash(value: float, width: int, digits: int) -> str:
    return f"{value:{width}.{digits}f}" if np.isfinite(value) else "-".rjust(width)


@dataclass(frozen=True, slots=True, eq=False)
class _SetUpParts:
    """One mode's shapes in the set-ups that have it, each of length 1 at the shared channels.

    ``values`` and ``std`` are (n_channels, n_parts), NaN and 0 at channels that a set-up does not have.
    """

    values: Complexes
    std: Floats
    shared: Bools

    @classmethod
    def of(
        cls, set_ups: Sequence[AmbientModes], members: Members, channels: Sequence[str], shared: Sequence[str]
    ) -> "_SetUpParts":
        at = np.isin(channels, list(shared))
        values = np.full((len(channels), len(members)), np.nan, dtype=complex)
        std = np.zeros(values.shape)
        for column, (s, mode) in enumerate(members.items()):
            rows = [list(channels).index(name) for name in set_ups[s].modes.labels]
            values[rows, column] = set_ups[s].complex_shapes[:, mode]
            std[rows, column] = set_ups[s].shape_std[:, mode]
        length = np.sqrt(np.nansum(np.abs(values[at]) ** 2, axis=0)) if len(members) > 1 else np.ones(1)
        return cls((values / length).astype(complex), std / length, at)

    @property
    def _weights(self) -> Floats:
        """Inverse of the parts' variances at the shared channels, with a sum of 1, (n_parts,)."""
        if self.values.shape[1] == 1:
            return np.ones(1)
        known = ~np.isnan(self.values[self.shared])
        variance = (self.std[self.shared] ** 2).sum(axis=0) / np.maximum(known.sum(axis=0), 1)
        weight = 1 / np.maximum(variance, 1e-12)
        return weight / weight.sum()

    def _mean(self, factors: Complexes) -> Complexes:
        """Return the weighted mean of the parts times factors, NaN where no part is."""
        known = ~np.isnan(self.values)
        total = known @ self._weights
        scaled = np.where(known, self.values * factors * self._weights, 0.0)
        return np.where(total > 0, scaled.sum(axis=1) / np.maximum(total, 1e-300), np.nan)

    def factors(self) -> Complexes:
        """Return the factors of the parts that make them agree best at the shared channels.

        Least squares weighted by the parts' variances, with a fixed mean square of the whole: the lowest
        eigenvector of the quadratic form that is left with the best shape for any factors.
        """
        n = self.values.shape[1]
        if n == 1:
            return np.ones(1, dtype=complex)
        known, weight = ~np.isnan(self.values[self.shared]), self._weights
        x = np.where(known, self.values[self.shared], 0.0)
        size = np.diag(weight * (np.abs(x) ** 2).sum(axis=0))
        best = np.array([self._mean(one)[self.shared] for one in np.eye(n, dtype=complex)]).T
        total = known @ weight
        form = size - np.nan_to_num(best).conj().T @ (np.nan_to_num(best) * total[:, None])
        _, vectors = eigh(form, size, subset_by_index=[0, 0])
        return vectors[:, 0] / np.abs(vectors[:, 0]).max()

    def joined(self) -> Floats:
        """Return the shape at all channels, of length 1, NaN where no part is."""
        mean = self._mean(self.factors())
        turned = np.real(mean * np.exp(-0.5j * np.angle(np.nansum(mean**2))))
        return turned / np.sqrt(np.nansum(turned**2))

    def spread(self) -> Floats:
        """Return the standard deviations of the joined shape, to the first order, (n_channels,)."""
        shape, out = self.joined(), np.zeros(len(self.values))
        for k, s in np.argwhere(self.std > 0):
            moved = self.values.copy()
            moved[k, s] += self.std[k, s]
            other = _SetUpParts(moved, self.std, self.shared).joined()
            other = other * np.sign(np.nansum(other * shape))
            out += np.nan_to_num(other - shape) ** 2
        return np.sqrt(out)


def merge_set_ups(set_ups: Sequence[AmbientModes]) -> MergedModes:
    """Merge the modes of set-ups that share sensors.

    Modes of two set-ups are one if their half-power bands meet, chance included. Of several assignments the
    one counts whose shapes are most alike at the shared sensors.

    Parameters
    ----------
    set_ups : sequence of AmbientModes
        Channels of one name are one sensor, in one unit.

    Raises
    ------
    AmbientError
        If a set-up shares no sensor with the others.
    """
    channels = tuple(dict.fromkeys(name for s in set_ups for name in s.modes.labels))
    count = [sum(name in s.modes.labels for s in set_ups) for name in channels]
    shared = [name for name, n in zip(channels, count, strict=True) if n > 1]
    groups = _grouped(set_ups, channels, shared)
    columns = [_values(set_ups, g) for g in groups]
    order = np.argsort([c[0] for c in columns], kind="stable")
    groups, columns = [groups[k] for k in order], [columns[k] for k in order]
    frequency, frequency_std, zeta, zeta_std, scatter = np.array(columns).reshape(-1, 5).T
    parts = [_SetUpParts.of(set_ups, g, channels, shared) for g in groups]
    shapes = np.array([p.joined() for p in parts]).reshape(-1, len(channels)).T
    spread = np.array([p.spread() for p in parts]).reshape(-1, len(channels)).T
    largest = np.array([c[np.nanargmax(np.abs(c))] for c in shapes.T])
    agreement = np.array([_agreement(p, s) for p, s in zip(parts, shapes.T, strict=True)])
    modes = Modes(frequency, shapes / largest, zeta, channels)
    std = spread / np.abs(largest)
    return MergedModes(
        modes=modes,
        frequency_std=frequency_std,
        zeta_std=zeta_std,
        shape_std=np.where(np.isnan(shapes), np.nan, std),
        agreement=agreement,
        scatter=scatter,
        members=tuple(groups),
        set_ups=tuple(set_ups),
    )


def _grouped(
    set_ups: Sequence[AmbientModes], channels: Sequence[str], shared: Sequence[str]
) -> list[Members]:
    """Return which modes of the set-ups are one, set-up by set-up, from the first along shared sensors on."""
    groups: list[Members] = [{0: k} for k in range(set_ups[0].modes.n_modes)]
    seen, remaining = set(set_ups[0].modes.labels), list(range(1, len(set_ups)))
    while remaining:
        s = max(remaining, key=lambda k: len(seen & set(set_ups[k].modes.labels)))
        modes = set_ups[s].modes
        if not seen & set(modes.labels):
            msg = (
                f"set-up {s + 1} ({', '.join(modes.labels)}) shares no sensor with the others; a reference "
                "sensor has to stay where it is"
            )
            raise AmbientError(msg)
        every = range(modes.n_modes)
        cost = np.array([[_unlike(set_ups, g, s, k, channels, shared) for k in every] for g in groups])
        rows, columns = scipy.optimize.linear_sum_assignment(cost) if cost.size else ((), ())
        taken = set()
        for row, k in zip(rows, columns, strict=True):
            if cost[row, k] < IMPOSSIBLE_COST:
                groups[row][s] = int(k)
                taken.add(int(k))
        groups += [{s: k} for k in every if k not in taken]
        seen |= set(modes.labels)
        remaining.remove(s)
    return groups


IMPOSSIBLE_COST = 1e3
"""Cost of an assignment that is not possible."""


def _unlike(
    set_ups: Sequence[AmbientModes],
    group: Members,
    s: int,
    k: int,
    channels: Sequence[str],
    shared: Sequence[str],
) -> float:
    """Return how unlike a set-up's mode is to a group: 1 - MAC and the distance of frequencies over reach."""
    f, f_std, zeta, _, _ = _values(set_ups, group)
    g, g_std, g_zeta, _, _ = _values(set_ups, {s: k})
    reach = zeta * f + g_zeta * g + CONFIDENCE * np.hypot(f_std, g_std)
    if abs(f - g) > reach:
        return IMPOSSIBLE_COST
    one, two = (_SetUpParts.of(set_ups, each, channels, shared).joined() for each in (group, {s: k}))
    common = ~(np.isnan(one) | np.isnan(two))
    return 1 - _mac(one, two) + abs(f - g) / reach if common.any() else IMPOSSIBLE_COST


def _values(set_ups: Sequence[AmbientModes], members: Members) -> tuple[float, float, float, float, float]:
    """Return means and deviations of frequency and damping ratio, and the scatter of frequencies."""
    chosen = [(set_ups[s], k) for s, k in members.items()]
    f, f_std, scatter = _mean([(s.modes.frequency[k], s.frequency_std[k]) for s, k in chosen])
    zeta = [(0.0 if s.modes.zeta is None else s.modes.zeta[k], s.zeta_std[k]) for s, k in chosen]
    return f, f_std, *_mean(zeta)[:2], scatter


def _mean(values: Sequence[tuple[float, float]]) -> tuple[float, float, float]:
    """Return the mean weighted by variances, its standard deviation, and the scatter in deviations.

    Where values scatter by more than they state, the deviation is larger in the same ratio.
    """
    x, std = np.array(values).T
    weight = 1 / np.maximum(std, 1e-300) ** 2
    mean = float(weight @ x / weight.sum())
    if len(x) < 2:
        return mean, float(std[0]), np.nan
    scatter = float(np.sqrt(weight @ (x - mean) ** 2 / (len(x) - 1)))
    return mean, float(max(1.0, scatter) / np.sqrt(weight.sum())), scatter


def _agreement(parts: _SetUpParts, shape: Floats) -> float:
    macs = [_mac(shape[parts.shared], column[parts.shared]) for column in parts.values.T]
    two = [(~np.isnan(column[parts.shared])).sum() > 1 for column in parts.values.T]
    return min(macs) if len(macs) > 1 and all(two) else np.nan


def _mac(one: NDArray[np.number], two: NDArray[np.number]) -> float:
    """Return the MAC at the channels that both have: 1 with one of these, 0 with none."""
    known = ~(np.isnan(one) | np.isnan(two))
    a, b = one[known], two[known]
    size = float((np.abs(a) ** 2).sum() * (np.abs(b) ** 2).sum())
    return float(np.abs(a.conj() @ b) ** 2 / size) if size > 0 else 0.0
