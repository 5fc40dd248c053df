"""Steady vibration of a linear structure with one element whose stiffness depends on the amplitude.

The element acts on one relative motion δ of the structure. With the describing function k(a) of its force,
a the amplitude of δ, the fundamental of the response to a force of amplitude F is that of a linear structure
with k(a) at δ (Worden & Tomlinson, Nonlinearity in Structural Dynamics, 2001, ch. 3): from the receptances
without the element,

    H' = H - c q h,   q = k/(1 + k g),   a = F |h/(1 + k(a) g)|,

with h those of δ to the forces, c those of the responses to a pair of forces at δ, g that of δ to it.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from fem.array_types import Complexes, Floats

_GRID = np.geomspace(1e-4, 1e4, 97)
"""Amplitudes at which a solution is looked for, in multiples of that without the element."""


class Describing(Protocol):
    """An element with a describing function."""

    @property
    def amplitude(self) -> float:
        """The amplitude that it has where no level of force is given [m or rad]."""
        ...

    def stiffness_at(self, amplitude: Floats) -> Complexes:
        """Return k at amplitudes of any shape [N/m or N·m/rad]."""
        ...

    def slopes_at(self, amplitude: Floats) -> tuple[Complexes, Mapping[str, Complexes]]:
        """Return dk/da, and dk by each parameter, at amplitudes of any shape."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Receptances:
    """Receptances of the structure without the element.

    Attributes
    ----------
    H : ndarray (n_freq, n_out, n_in)
        Of the responses to the forces.
    c : ndarray (n_freq, n_out)
        Of the responses to a pair of forces at δ.
    h : ndarray (n_freq, n_in)
        Of δ to the forces.
    g : ndarray (n_freq,)
        Of δ to the pair.
    """

    H: Complexes
    c: Complexes
    h: Complexes
    g: Complexes

    @classmethod
    def of(cls, block: Complexes) -> "Receptances":
        """Take (…, n_freq, n_out + 1, n_in + 1) apart, with δ as the last response and the last force."""
        return cls(block[..., :-1, :-1], block[..., :-1, -1], block[..., -1, :-1], block[..., -1, -1])


@dataclass(frozen=True, slots=True, eq=False)
class Steady:
    """A steady vibration.

    Attributes
    ----------
    H : ndarray (n_freq, n_out, n_in)
        Receptances at the level of force.
    amplitude : ndarray (n_freq, n_in)
        a; 0 where friction holds [m or rad].
    """

    H: Complexes
    amplitude: Floats
    _part: Receptances
    _element: Describing
    _q: Complexes

    def slopes(self, changes: Complexes, names: tuple[str, ...]) -> tuple[Complexes, Complexes]:
        """Return derivatives of H by parameters of the structure and by those of the element.

        ln a = ln F + Re(ln h - ln(1 + kg)), differentiated implicitly, gives da, and with it dk and dq.

        Parameters
        ----------
        changes : ndarray (n, n_freq, n_out + 1, n_in + 1)
            Derivatives of the receptances without the element.
        names : tuple of str
            Parameters of the element.

        Returns
        -------
        ndarray (n, n_freq, n_out, n_in), (len(names), n_freq, n_out, n_in)
        """
        part, q, d = self._part, self._q, Receptances.of(changes)
        moves = self.amplitude > 0
        a = np.where(moves, self.amplitude, 1.0)
        k = np.where(moves, self._element.stiffness_at(a), 0.0)
        by_a, by_parameter = self._element.slopes_at(a)
        D = 1 + k * part.g[:, None]
        relative = by_a * a * part.g[:, None] / D  # d ln(1 + kg) by ln a
        against = 1 + relative.real
        h = np.where(part.h != 0, part.h, 1.0)
        ln_a = (d.h / h - k * d.g[..., None] / D).real / against
        dk = np.where(moves, by_a * a * ln_a, 0.0)
        dq = dk / D**2 - q**2 * d.g[..., None]
        by_structure = (
            d.H
            - d.c[..., None] * (q * part.h)[:, None, :]
            - part.c[:, :, None] * (q * d.h + dq * part.h)[..., None, :]
        )
        by_element = np.empty((len(names), *self.H.shape), dtype=complex)
        for i, name in enumerate(names):
            direct = by_parameter[name]
            ln_a = -(direct * part.g[:, None] / D).real / against
            dk = np.where(moves, direct + by_a * a * ln_a, 0.0)
            by_element[i] = -part.c[:, :, None] * (dk / D**2 * part.h)[:, None, :]
        return by_structure, by_element


def _with_turns(grid: Floats, excess: Callable[[Floats], Floats]) -> tuple[Floats, Floats]:
    """Return amplitudes, with those where the excess turns nearest to crossing zero, and the excess there.

    Two solutions near a fold may lie between two amplitudes at which it has the same sign.

    Parameters
    ----------
    grid : ndarray (n, n_freq, n_in)
        Rising.
    excess : callable

    Returns
    -------
    amplitudes, excess : ndarray (n + 2, n_freq, n_in)
        The amplitudes rise.
    """
    at, turns = excess(grid), []
    for sign in (1.0, -1.0):  # it dips towards 0 from above, or rises towards it from below
        e = sign * at
        turning = (e[1:-1] > 0) & (e[1:-1] <= e[:-2]) & (e[1:-1] <= e[2:])
        i = np.argmin(np.where(turning, e[1:-1], np.inf), axis=0)[None]
        low, high = (np.take_along_axis(grid, i + k, axis=0)[0] for k in (0, 2))
        for _ in range(24):
            third = np.cbrt(high / low)
            left, right = low * third, high / third
            nearer = sign * excess(left) < sign * excess(right)
            low, high = np.where(nearer, low, left), np.where(nearer, right, high)
        turns.append(np.sqrt(low * high))
    every = np.concatenate([grid, turns])
    order = np.argsort(every, axis=0)
    both = every, np.concatenate([at, excess(np.array(turns))])
    amplitudes, values = (np.take_along_axis(each, order, axis=0) for each in both)
    return amplitudes, values


def solve_steady(
    element: Describing, force: float | None, part: Receptances, measured: Complexes | None = None
) -> Steady:
    """Solve for the steady vibration at a level of force.

    Where there are several solutions, near a resonance that leans over, the lowest and highest are stable.
    The one whose receptances are nearer to measured ones is taken, without them the highest.

    Parameters
    ----------
    element : Describing
    force : float or None
        F, amplitude of each of the forces, which act one at a time [N]. None for an element that keeps the
        amplitude that it has.
    part : Receptances
    measured : ndarray (n_freq, n_out, n_in), optional
        Receptances; zeros do not count.
    """
    if force is None:
        a = np.full(part.h.shape, float(element.amplitude))
        k = element.stiffness_at(a)
        q = k / (1 + k * part.g[:, None])
        return Steady(part.H - part.c[:, :, None] * (q * part.h)[:, None, :], a, part, element, q)
    # Least amplitude, for forces that do not move the element: one whose square is not 0 [m or rad]
    free = np.maximum(force * np.abs(part.h), 1e-100)

    def excess(a: Floats) -> Floats:
        """Return a |1 + k(a) g| - F |h| over F |h|, for a (…, n_freq, n_in)."""
        return a * np.abs(1 + element.stiffness_at(a) * part.g[:, None]) / free - 1

    grid, values = _with_turns(_GRID[:, None, None] * free, excess)
    above = values > 0
    rises = ~above[:-1] & above[1:]  # between these the excess crosses zero from below: stable
    some = rises.any(axis=0)
    first = np.argmax(rises, axis=0)
    last = len(rises) - 1 - np.argmax(rises[::-1], axis=0)
    found = []
    for at in (last, first):
        low = np.take_along_axis(grid, at[None], axis=0)[0]
        high = np.take_along_axis(grid, at[None] + 1, axis=0)[0]
        for _ in range(40):
            middle = np.sqrt(low * high)
            beyond = excess(middle) > 0
            low, high = np.where(beyond, low, middle), np.where(beyond, middle, high)
        a = np.where(some, np.sqrt(low * high), 0.0)
        k = element.stiffness_at(np.where(some, a, 1.0))
        # Without a solution friction holds: k is infinite, and q is 1/g.
        q = np.where(some, k / (1 + k * part.g[:, None]), 1 / part.g[:, None])
        found.append((part.H - part.c[:, :, None] * (q * part.h)[:, None, :], a, q))
        if measured is None or (first == last).all():
            break
    (H, a, q), (H2, a2, q2) = found[0], found[-1]
    if len(found) > 1 and measured is not None:
        seen = measured != 0
        safe = np.where(seen, measured, 1.0)
        off, off2 = (np.where(seen, np.abs(np.log(np.abs(X / safe))), 0.0).sum(axis=1) for X in (H, H2))
        lower = off2 < off
        H = np.where(lower[:, None, :], H2, H)
        a, q = np.where(lower, a2, a), np.where(lower, q2, q)
    return Steady(H, a, part, element, q)
