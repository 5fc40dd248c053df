"""How a stiffness depends on frequency: viscoelastic laws, and tables.

Each gives storage and loss of (storage + i loss) K as real functions of ω and of its parameters, so that
derivatives by complex steps pass through both. Zener's and the fractional laws are 1 at ω = 0, so that K is
the static stiffness; a Maxwell element and a spring-pot are 0 there.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fem.array_types import Floats
from fem.model import Array, ModelError


@dataclass(frozen=True, slots=True)
class Zener:
    """Standard linear solid: a spring parallel to a spring and a dashpot in series.

    1 + r iωτ / (1 + iωτ) [Lakes, Viscoelastic Materials, Cambridge 2009, sec. 2.6]. The loss factor is
    highest, r / (2 √(1 + r)), at ω = 1 / (τ √(1 + r)).

    Attributes
    ----------
    ratio : float
        r, stiffness that is added at high frequency over the static one [-].
    tau : float
        τ, relaxation time [s].
    """

    ratio: Any
    tau: Any

    def __call__(self, omega: Floats) -> tuple[Array, Array]:
        """Return storage and loss (n,) [-]."""
        x = omega * self.tau
        return 1 + self.ratio * x**2 / (1 + x**2), self.ratio * x / (1 + x**2)


@dataclass(frozen=True, slots=True)
class Maxwell:
    """A spring and a dashpot in series: iωτ / (1 + iωτ), 0 at ω = 0 and 1 at high frequency.

    In parallel with a spring it makes :class:`Zener`.

    Attributes
    ----------
    tau : float
        τ, relaxation time [s].
    """

    tau: Any

    def __call__(self, omega: Floats) -> tuple[Array, Array]:
        """Return storage and loss (n,) [-]."""
        x = omega * self.tau
        return x**2 / (1 + x**2), x / (1 + x**2)


@dataclass(frozen=True, slots=True)
class SpringPot:
    """Between a spring (α = 0) and a dashpot (α = 1): (iωτ)^α, whose loss factor is tan(πα/2) everywhere.

    In parallel with a spring it makes :class:`FractionalKelvinVoigt`.

    Attributes
    ----------
    tau : float
        τ [s].
    alpha : float
        α, between 0 and 1 [-].
    """

    tau: Any
    alpha: Any

    def __call__(self, omega: Floats) -> tuple[Array, Array]:
        """Return storage and loss (n,) [-]."""
        return _power(omega, self.tau, self.alpha)


@dataclass(frozen=True, slots=True)
class FractionalKelvinVoigt:
    """A spring parallel to a spring-pot: 1 + (iωτ)^α [Bagley & Torvik, J. Rheology 27, 1983].

    α = 1 is Kelvin and Voigt's dashpot, α towards 0 a constant loss factor.

    Attributes
    ----------
    tau : float
        τ [s].
    alpha : float
        α, between 0 and 1 [-].
    """

    tau: Any
    alpha: Any

    def __call__(self, omega: Floats) -> tuple[Array, Array]:
        """Return storage and loss (n,) [-]."""
        c, s = _power(omega, self.tau, self.alpha)
        return 1 + c, s


@dataclass(frozen=True, slots=True)
class FractionalZener:
    """1 + r (iωτ)^α / (1 + (iωτ)^α) [Pritz, J. Sound and Vibration 195, 1996]; α = 1 is :class:`Zener`.

    Attributes
    ----------
    ratio : float
        r, stiffness that is added at high frequency over the static one [-].
    tau : float
        τ [s].
    alpha : float
        α, between 0 and 1 [-].
    """

    ratio: Any
    tau: Any
    alpha: Any

    def __call__(self, omega: Floats) -> tuple[Array, Array]:
        """Return storage and loss (n,) [-]."""
        c, s = _power(omega, self.tau, self.alpha)
        below = (1 + c) ** 2 + s**2
        return 1 + self.ratio * (c + c**2 + s**2) / below, self.ratio * s / below


@dataclass(frozen=True, slots=True, eq=False)
class TabulatedLaw:
    """Storage and loss at frequencies, linear in between and constant outside.

    Attributes
    ----------
    frequency : ndarray (n,)
        Increasing frequencies [Hz].
    storage, loss : ndarray (n,)
        Real and imaginary part [N/m, N·m/rad, or - where it multiplies a stiffness].
    """

    frequency: Floats
    storage: Array
    loss: Array

    @classmethod
    def of(cls, frequency: ArrayLike, stiffness: ArrayLike) -> "TabulatedLaw":
        """Build a table from complex stiffnesses (n,) at frequencies (n,) [Hz], checking them.

        Raises
        ------
        ModelError
            For shapes that differ, values that are not finite, or frequencies that do not increase.
        """
        f, k = np.array(frequency, dtype=float, ndmin=1), np.array(stiffness, dtype=complex, ndmin=1)
        check_table(f, k.reshape(len(k), -1), "the table")
        return cls(f, np.real(k).copy(), np.imag(k).copy())

    def __call__(self, omega: Floats) -> tuple[Array, Array]:
        """Return storage and loss (n,)."""
        f = np.asarray(omega) / (2 * np.pi)
        return np.interp(f, self.frequency, self.storage), np.interp(f, self.frequency, self.loss)


def check_table(frequency: Floats, values: NDArray[Any], what: str) -> None:
    """Raise a ModelError unless frequencies (n,) increase from 0 or above and values (n, m) are finite."""
    if frequency.ndim != 1 or len(frequency) != len(values) or not frequency.size:
        msg = f"{what} has {len(values)} stiffnesses for {frequency.size} frequencies; one each is expected"
        raise ModelError(msg)
    if not np.isfinite(frequency).all() or frequency[0] < 0 or (np.diff(frequency) <= 0).any():
        msg = f"the frequencies of {what} must be finite, not negative, and increase [Hz]"
        raise ModelError(msg)
    bad = np.flatnonzero(~np.isfinite(values).all(axis=1))
    if bad.size:
        msg = f"{what} has a stiffness that is not a finite number at {frequency[bad[0]]:g} Hz"
        raise ModelError(msg)


def _power(omega: Floats, tau: Any, alpha: Any) -> tuple[Array, Array]:
    """Return real and imaginary part of (iωτ)^α; 0 at ω = 0."""
    moving = omega > 0
    size = np.where(moving, np.where(moving, omega * tau, 1.0) ** alpha, 0.0)
    return size * np.cos(np.pi * alpha / 2), size * np.sin(np.pi * alpha / 2)
