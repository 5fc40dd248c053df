"""Which computed mode is which measured one: by shape and frequency together, close modes as subspaces."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from fem.analysis.modes import Modes
from fem.array_types import Floats, Ints
from fem.summary import fields_summary
from updating.correlation.shape_correlation import mac, orthonormal_basis, principal_angles, subspace_mac

UNSEEN = 1e-9
"""Computed shapes below this part of the largest one at the sensors are rounding: their modes are unseen."""


@dataclass(frozen=True, slots=True, eq=False)
class ModePair:
    """Measured modes and the computed ones that they are: one of each, or sets of close modes.

    Attributes
    ----------
    measured, computed : tuple of int
        Numbers of the modes, from 0, by rising frequency; as many of the one as of the other.
    subspace : tuple of int
        Computed modes whose combinations the measured shapes are: ``computed``, or a set of close modes with
        it.
    frequency_measured, frequency_computed : ndarray (n,)
        Natural frequencies [Hz].
    mac : float
        MAC; for a set the least cos² of the principal angles between the spaces [-].
    angles : ndarray (n,)
        Principal angles [rad]; where the measured shapes of a set have different gaps, the angle of each with
        the computed space.
    """

    measured: tuple[int, ...]
    computed: tuple[int, ...]
    subspace: tuple[int, ...]
    frequency_measured: Floats
    frequency_computed: Floats
    mac: float
    angles: Floats

    @property
    def frequency_error(self) -> Floats:
        """Computed over measured natural frequency, less one, shape (n,) [-]."""
        return self.frequency_computed / self.frequency_measured - 1


@dataclass(frozen=True, slots=True, eq=False)
class ModeComparison:
    """How far computed modes are from measured ones.

    Attributes
    ----------
    mac : ndarray (n_measured, n_computed)
        0 to 1.
    pairs : tuple of (int, int)
        Measured and computed modes that belong together, best MAC first, each mode once. Within a set of
        close modes they are paired by rising frequency.
    frequency_error : ndarray (n_pairs,)
        Computed over measured natural frequency, less one [-].
    groups : tuple of ModePair
        The same pairs by rising measured frequency, close modes as one.
    frequency_measured, frequency_computed : ndarray
        Natural frequencies of all modes [Hz].
    unpaired_measured : mapping of int to str
        Measured modes without a partner, and why.
    unpaired_computed : mapping of int to str
        Computed modes without a partner, rigid-body modes left out, and why.
    """

    mac: Floats
    pairs: tuple[tuple[int, int], ...]
    frequency_error: Floats
    groups: tuple[ModePair, ...]
    frequency_measured: Floats
    frequency_computed: Floats
    unpaired_measured: dict[int, str]
    unpaired_computed: dict[int, str]

    __repr__ = fields_summary

    def table(self) -> str:
        """Return pairs, frequencies, their errors and MAC as lines of text, modes counted from 1."""
        lines = [f"{'measured':>20}  {'computed':>20}  {'error':>8}  {'MAC':>6}"]
        for g in self.groups:
            for k, (i, j) in enumerate(zip(g.measured, g.computed, strict=True)):
                x, a = g.frequency_measured[k], g.frequency_computed[k]
                note = f"{g.mac:6.3f}" if len(g.subspace) == 1 else f"{g.mac:6.3f}  close modes"
                lines.append(
                    f"{i + 1:>5} {x:>11.4g} Hz  {j + 1:>5} {a:>11.4g} Hz  "
                    f"{100 * (a / x - 1):>+6.2f} %  {note}"
                )
        for i, why in self.unpaired_measured.items():
            lines.append(f"{i + 1:>5} {self.frequency_measured[i]:>11.4g} Hz  {'-':>20}  {why}")
        for j, why in self.unpaired_computed.items():
            lines.append(f"{'-':>20}  {j + 1:>5} {self.frequency_computed[j]:>11.4g} Hz  {why}")
        return "\n".join(lines)


def compare_modes(
    measured: Modes,
    computed: Modes,
    rows: ArrayLike,
    least_mac: float = 0.5,
    frequency_spread: float | None = 0.3,
    close: float = 0.01,
) -> ModeComparison:
    """Pair measured with computed modes by shape and frequency, and compare natural frequencies.

    Parameters
    ----------
    measured : Modes
        Shapes (n, n_measured) at the sensors; NaN where a mode was not measured, which that mode leaves out.
    computed : Modes
        Shapes (n_dof, n_computed) at all DOFs; rigid-body modes are left out of the pairs.
    rows : array_like (n, n_dof)
        Sensors as combinations of DOFs.
    least_mac, frequency_spread, close
        As for :func:`pair_modes`.

    Raises
    ------
    ValueError
        If the shapes do not fit the sensors.
    """
    rows = np.asarray(rows, dtype=float)
    if rows.ndim != 2 or rows.shape != (measured.shapes.shape[0], computed.shapes.shape[0]):
        msg = (
            f"rows have shape {rows.shape}; {measured.shapes.shape[0]} measured and "
            f"{computed.shapes.shape[0]} computed DOFs need (n_measured, n_computed) of these"
        )
        raise ValueError(msg)
    return pair_modes(
        measured.frequency,
        measured.shapes,
        computed.frequency,
        rows @ computed.shapes,
        least_mac,
        frequency_spread,
        close,
        computed.n_rigid,
    )


def pair_modes(
    frequency_x: ArrayLike,
    phi_x: ArrayLike,
    frequency_a: ArrayLike,
    phi_a: ArrayLike,
    least_mac: float = 0.5,
    frequency_spread: float | None = 0.3,
    close: float = 0.01,
    n_rigid: int = 0,
) -> ModeComparison:
    """Pair modes so that the sum of MAC · exp(-½ (ln(f_a/f_x) / s)²) over the pairs is greatest.

    The assignment is optimal (Jonker and Volgenant's algorithm), not one best pair after another. Computed
    modes whose neighbours in frequency are nearer than ``close`` are a set: a measured shape is compared with
    its space (:func:`updating.correlation.shape_correlation.subspace_mac`), since close modes mix with any
    small change, and a set takes at most as many measured modes as it has dimensions. Measured shapes that
    repeat one another within a set are not paired twice.

    Sensors too few for the modes make wrong pairs look good: see the autoMAC of ``phi_a`` first.

    Parameters
    ----------
    frequency_x, frequency_a : array_like (n_measured,), (n_computed,)
        Natural frequencies [Hz]; rising for the computed ones.
    phi_x, phi_a : array_like (n_dof, n_measured), (n_dof, n_computed)
        Shapes at the same DOFs, real or complex; NaN where a measured mode has no value.
    least_mac : float
        Pairs below this MAC are not made [-].
    frequency_spread : float or None
        s: how far frequencies may differ, as a natural logarithm [-]; None pairs by shape alone.
    close : float
        Relative distance of close modes [-]; 0 for equal frequencies only, negative for none.
    n_rigid : int
        Number of first computed modes that are left out.

    Raises
    ------
    ValueError
        If numbers of DOFs or modes do not fit, or a frequency that is used is not positive.
    """
    fx, fa = (np.atleast_1d(np.asarray(f, dtype=float)) for f in (frequency_x, frequency_a))
    x, a = (np.atleast_2d(np.asarray(p).T).T for p in (phi_x, phi_a))
    _check(fx, x, fa, a, n_rigid)
    values = mac(x, a)
    size = np.linalg.norm(a, axis=0)
    seen = size > UNSEEN * size[n_rigid:].max(initial=0.0)
    usable = np.flatnonzero(seen & (np.arange(fa.size) >= n_rigid))
    sets = _close_sets(fa, usable, close)
    alike = np.zeros(values.shape)
    for members in sets:
        alike[:, members] = (
            values[:, members] if len(members) == 1 else subspace_mac(x, a[:, members])[:, None]
        )
    score = np.where(alike >= least_mac, alike, 0.0)
    if frequency_spread is not None and usable.size:
        distance = np.log(fa[usable][None] / fx[:, None]) / frequency_spread
        # far apart is unlikely, not impossible: the least weight keeps a pair above none
        score[:, usable] *= np.maximum(np.exp(-0.5 * distance**2), 1e-6)
    of = {i: j for i, j in zip(*scipy.optimize.linear_sum_assignment(-score), strict=True) if score[i, j] > 0}
    why_not: dict[int, str] = {}
    groups = []
    for members in sets:
        mine = [int(i) for i in of if of[i] in members]
        mine = _independent(x, mine, score, of, why_not) if len(mine) > 1 else mine
        if mine:
            groups.append(_pair(fx, x, fa, a, mine, [int(of[i]) for i in mine], members))
    groups.sort(key=lambda g: float(g.frequency_measured[0]))
    singles = sorted(
        ((g.mac, i, j) for g in groups for i, j in zip(g.measured, g.computed, strict=True)),
        key=lambda s: -s[0],
    )
    pairs = tuple((i, j) for _, i, j in singles)
    error = np.array([fa[j] / fx[i] - 1 for i, j in pairs])
    taken_x, taken_a = {i for i, _ in pairs}, {j for _, j in pairs}
    for i in range(fx.size):
        if i not in taken_x and i not in why_not:
            why_not[i] = _why(alike[i], fa, least_mac)
    without = {
        j: _why(alike[:, j], fx, least_mac) if seen[j] else "the sensors do not see it"
        for j in range(n_rigid, fa.size)
        if j not in taken_a
    }
    return ModeComparison(values, pairs, error, tuple(groups), fx, fa, dict(sorted(why_not.items())), without)


def _check(fx: Floats, x: NDArray[Any], fa: Floats, a: NDArray[Any], n_rigid: int) -> None:
    for word, f, p in (("measured", fx, x), ("computed", fa, a)):
        if f.ndim != 1 or p.shape[1] != f.size:
            msg = f"{f.size} {word} frequencies are given for {p.shape[1]} shapes"
            raise ValueError(msg)
    for word, f in (("measured", fx), ("computed", fa[n_rigid:])):
        if not (f > 0).all():
            k = int(np.flatnonzero(~(f > 0))[0])
            msg = (
                f"{word} mode {k} (of the elastic ones, counted from 0) has {f[k]:g} Hz; frequencies must be "
                "positive, rigid-body modes are left out by n_rigid"
            )
            raise ValueError(msg)


def _close_sets(f: Floats, usable: Ints, close: float) -> list[list[int]]:
    sets: list[list[int]] = []
    for j in usable[np.argsort(f[usable], kind="stable")].tolist():
        if sets and f[j] / f[sets[-1][-1]] - 1 <= close:
            sets[-1].append(j)
        else:
            sets.append([j])
    return sets


def _independent(
    x: NDArray[Any], mine: list[int], score: Floats, of: dict[int, int], why_not: dict[int, str]
) -> list[int]:
    """Return the measured modes of a set without those that repeat better ones."""
    kept: list[int] = []
    for i in sorted(mine, key=lambda i: -score[i, of[i]]):
        shared = ~np.isnan(x[:, [i, *kept]]).any(axis=1)
        comparable = shared.all() or shared.sum() > len(kept)  # on fewer DOFs any shape is in the space
        # Measured shapes within sin² of this of the space of others say the same again
        if kept and comparable and 1 - subspace_mac(x[:, [i]], x[:, kept])[0] < 0.1:
            best = max(kept, key=lambda k: mac(x[:, i], x[:, k])[0, 0])
            why_not[i] = f"repeats measured mode {best + 1}"
        else:
            kept.append(i)
    return kept


def _pair(
    fx: Floats,
    x: NDArray[Any],
    fa: Floats,
    a: NDArray[Any],
    mine: list[int],
    theirs: list[int],
    members: list[int],
) -> ModePair:
    mine = sorted(mine, key=lambda i: fx[i])
    theirs = sorted(theirs, key=lambda j: fa[j])
    angles = _angles(x[:, mine], a[:, members])
    return ModePair(
        tuple(mine),
        tuple(theirs),
        tuple(members),
        fx[mine],
        fa[theirs],
        float(np.cos(angles[-1]) ** 2),
        angles,
    )


def _angles(x: NDArray[Any], a: NDArray[Any]) -> Floats:
    """Return the angles between measured shapes and computed ones, rising, one for each measured shape."""
    known = np.logical_not(np.isnan(x))
    rows = known.all(axis=1)
    if (known == known.all(axis=1, keepdims=True)).all():
        return principal_angles(orthonormal_basis(x[rows]), a[rows])
    return np.sort(np.arccos(np.sqrt(subspace_mac(x, a))))


def _why(alike: Floats, f: Floats, least_mac: float) -> str:
    if not alike.size:
        return "there is no mode on the other side"
    k = int(np.argmax(alike))
    if alike[k] < least_mac:
        return f"no MAC above {alike[k]:.2f} (mode {k + 1}, {f[k]:.4g} Hz); {least_mac:g} is needed"
    return f"most like mode {k + 1} ({f[k]:.4g} Hz, MAC {alike[k]:.2f}), which has a better partner"


def track_modes(sets: Sequence[Modes], mass: Any = None, least: float = 0.5) -> Ints:
    """Follow modes through sets of them that change step by step, as over a parameter or along an updating.

    From set to set, modes are assigned so that the sum of their likeness is largest: (φᵀMφ')², which
    is 1 for a mode that has not changed, or MAC without a mass matrix. Modes whose frequencies cross keep
    their places so; where two veer, the place follows the shape, which it shares while they mix: take small
    steps there. Rigid-body modes are left out.

    Parameters
    ----------
    sets : sequence of Modes
        With the same rows of shapes.
    mass : array_like or sparse (n_dof, n_dof), optional
        M on these rows [kg, kg m²].
    least : float
        Modes that are less alike from one set to the next are lost [-].

    Returns
    -------
    ndarray of int (n_sets, n_modes)
        Column k follows elastic mode k of the first set: its number in each set, rigid-body modes counted, or
        -1 from where it was lost.

    Raises
    ------
    ValueError
        If there is no set, or rows differ.
    """
    if not sets or any(m.shapes.shape[0] != sets[0].shapes.shape[0] for m in sets):
        msg = f"the sets have {[m.shapes.shape[0] for m in sets]} rows of shapes; one set or more, all alike"
        raise ValueError(msg)
    first = np.arange(sets[0].n_rigid, sets[0].n_modes)
    out = np.full((len(sets), first.size), -1, dtype=np.int64)
    out[0] = first
    for step, (old, new) in enumerate(pairwise(sets), start=1):
        kept = np.flatnonzero(out[step - 1] >= 0)
        a, b = old.shapes[:, out[step - 1, kept]], new.shapes[:, new.n_rigid :]
        if not kept.size or not b.shape[1]:
            break
        if mass is None:
            alike = mac(a, b)
        else:
            sizes = [np.sqrt(np.abs(np.einsum("ij,ij->j", x.conj(), mass @ x))) for x in (a, b)]
            alike = np.abs(a.conj().T @ (mass @ b)) ** 2 / np.outer(sizes[0] ** 2, sizes[1] ** 2)
        rows, columns = scipy.optimize.linear_sum_assignment(-alike)
        for i, j in zip(rows, columns, strict=True):
            if alike[i, j] >= least:
                out[step, kept[i]] = j + new.n_rigid
    return out
