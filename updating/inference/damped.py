"""FRFs at complex frequencies ω - iσ, where resonances are broad: fits there converge from far away.

Resonances that pass each other by more than their width leave many minima of a misfit. In full waveform
inversion that is called cycle skipping, and is cured by decaying waves, from strong to no decay (Shin & Cha,
*Geophys. J. Int.* 173, 2008, 922; 177, 2009, 1067).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Generic

import numpy as np
from numpy.typing import NDArray

from fem.array_types import Complexes, Floats
from fem.reduction.modal_solution import times
from updating.inference.frf_inputs import F, FrfInputs
from updating.modal.poles import channel_sizes, poles_of_order

LEAST_INSIDE = 0.85
"""Share of Poisson's kernel that measured lines must cover [-]."""
LEAST_LINES = 4
"""With fewer such lines there is nothing to fit."""
HIGHEST_ORDER, LINES_PER_ORDER = 120, 4
"""Order of the rational function, and how many lines it needs for each at least."""


@dataclass(frozen=True, slots=True, eq=False)
class Continuation:
    """Receptances on and below the real axis, where those of a stable structure are analytic.

    H(ω - iσ) = R(ω - iσ) + 1/π ∫ (H - R)(ω') σ / ((ω - ω')² + σ²) dω', Poisson's integral. As a sum over the
    lines, with the sum of its weights for π, it errs where resonances are narrower than these are apart, and
    beyond the band. Therefore a rational function R with their poles, analytic there too, is taken out before
    and added again at the complex frequencies.

    Attributes
    ----------
    frequency : ndarray (n_freq,)
        [Hz].
    rest : ndarray (n_freq, n_out, n_in)
        H - R; NaN where H is not known.
    poles : ndarray (n,)
        With positive imaginary parts [rad/s].
    factors : ndarray (2 n + 3, n_out, n_in)
        Of the terms of R.
    """

    frequency: Floats
    rest: Complexes
    poles: Complexes
    factors: Floats

    @classmethod
    def of(cls, frequency: Floats, H: Complexes) -> Continuation:
        """Find the rational function of FRFs by polyreference least squares."""
        s, known = 2j * np.pi * frequency, np.isfinite(H).all(axis=(1, 2))
        order = min(HIGHEST_ORDER, int(known.sum()) // LINES_PER_ORDER)
        if order < 2 or not H[known].any():
            return cls(frequency, H, np.zeros(0, dtype=complex), np.zeros((3, *H.shape[1:])))
        f, there = frequency[known], H[known]
        # The transpose has the same poles. A denominator over many forces has many more roots, at a cost
        # that rises with their third power.
        few = there if there.shape[2] <= there.shape[1] else np.swapaxes(there, 1, 2)
        size, _ = channel_sizes(few)
        poles = poles_of_order(f, few, order, size)
        flat = there.reshape(len(f), -1)
        sizes = np.maximum(np.sqrt((np.abs(flat) ** 2).mean(axis=0)), 1e-300)
        # Lines at which FRFs are smaller than this share of their sizes count no more for the rational
        # function
        weight = 1 / np.maximum((np.abs(flat) / sizes).mean(axis=1), 1e-3)[:, None]
        terms, wanted = weight * _terms(s[known], s[-1].imag, poles), weight * flat / sizes
        scale = np.linalg.norm(terms, axis=0)
        A, b = (np.vstack([X.real, X.imag]) for X in (terms / scale, wanted))
        factors = (np.linalg.lstsq(A, b, rcond=1e-10)[0] / scale[:, None] * sizes).reshape(-1, *H.shape[1:])
        R = np.tensordot(_terms(s, s[-1].imag, poles), factors, axes=1)
        return cls(frequency, H - R, poles, factors)

    def at(self, sigma: float) -> tuple[Complexes, Floats]:
        """Return FRFs at a decay rate σ/2π [Hz], and the share of the kernel that known lines cover.

        Both (n_freq, n_out, n_in).
        """
        f = self.frequency
        steps = np.diff(f)
        # next to a gap a line represents its own cell alone, so that the gap counts as not covered
        cells = np.minimum(np.append(steps[:1], steps), np.append(steps, steps[-1:]))
        kernel = cells * sigma / (np.pi * ((f[:, None] - f) ** 2 + sigma**2))
        there = np.isfinite(self.rest)
        inside = np.tensordot(kernel, there.astype(float), axes=1)
        rest = times(kernel, np.where(there, self.rest, 0.0))
        terms = _terms(2 * np.pi * (1j * f + sigma), 2 * np.pi * f[-1], self.poles)
        H: Complexes = rest / np.maximum(inside, LEAST_INSIDE / 2) + np.tensordot(terms, self.factors, axes=1)
        return H, inside


def _terms(s: NDArray[Any], top: float, poles: Complexes) -> Complexes:
    """Return 1/(s - λ) ± 1/(s - λ*) of each pole, and what modes beyond the band add, (n_freq, 2 n + 3)."""
    one, two = top / (s[:, None] - poles), top / (s[:, None] - poles.conj())
    beyond = (s[:, None] / top) ** np.array([-2, 0, 2])
    return np.hstack([one + two, 1j * (one - two), beyond]).astype(complex)


def continuation_of(problem: FrfInputs) -> Continuation | None:
    """Return the measured FRFs on and below the real axis; None of amplitudes and of several levels.

    None, too, of responses over that of a sensor: a zero of its FRF may lie below the axis, where they are
    infinite.
    """
    data = problem.data
    analytic = data.phase and data.measurement.has_structure_poles
    if len(data.frequency) < 2 or not analytic or problem.responses.n_levels > 1:
        return None
    return Continuation.of(data.frequency, data.H)


def damped(problem: F, share: float, continuation: Continuation | None = None) -> F | None:
    """Return a problem at a decay rate, or None where its lines do not allow one.

    Parameters
    ----------
    problem : FrfInputs
    share : float
        σ in parts of the band [-].
    continuation : Continuation, optional
        That of the measured FRFs, where it is known.
    """
    data, f = problem.data, problem.data.frequency
    if share == 0:
        return problem
    continuation = continuation or continuation_of(problem)
    if continuation is None:
        return None
    sigma = share * float(f[-1] - f[0])
    H, inside = continuation.at(sigma)
    mask = data.mask & (inside > LEAST_INSIDE)
    held_out = data.held_out | ~mask.any(axis=(1, 2))
    if (~held_out).sum() < LEAST_LINES:
        return None
    damped_data = replace(data, H=H, mask=mask, held_out=held_out)
    return replace(problem, data=damped_data, decay=2 * np.pi * sigma, modes=None)


@dataclass(frozen=True, slots=True, eq=False)
class DampedFrfs(Generic[F]):
    """The FRFs of a problem on and below the real axis.

    Attributes
    ----------
    problem : FrfInputs
    continuation : Continuation
    """

    problem: F
    continuation: Continuation

    def at(self, share: float) -> F | None:
        """Return the problem at a decay rate in parts of the band [-], None where its lines allow none."""
        return damped(self.problem, share, self.continuation)
