"""FRFs at complex frequencies ω - iσ, where resonances are broad: fits there converge from far away.

Resonances that pass each other by more than their width leave many minima of a misfit. In full waveform
inversion that is called cycle skipping, and is cured by decaying waves, from strong to no decay (Shin & Cha,
*Geophys. J. Int.* 173, 2008, 922; 177, 2009, 1067).
"""

from dataclasses import replace

import numpy as np

from updating.inference.fit import FitProblem

LEAST_INSIDE = 0.85
"""Share of Poisson's kernel that measured lines must cover [-]."""
LEAST_LINES = 4
"""With fewer such lines there is nothing to fit."""


def damped(problem: FitProblem, share: float) -> FitProblem | None:
    """Return a problem at a decay rate, or None where its lines do not allow one.

    H(ω - iσ) = 1/π ∫ H(ω') σ / ((ω - ω')² + σ²) dω', Poisson's integral, as a sum over the lines with the
    sum of its weights for π. The receptance of a stable structure is analytic below the real axis of ω.
    Amplitudes without phases have no such continuation.

    Parameters
    ----------
    problem : FitProblem
    share : float
        σ in parts of the band [-].
    """
    data, f = problem.data, problem.data.frequency
    if share == 0:
        return problem
    if len(f) < 2 or not data.phase:
        return None
    sigma = share * float(f[-1] - f[0])
    steps = np.diff(f)
    # beside a gap a line stands for its own cell alone, so that the gap counts as not covered
    cells = np.minimum(np.append(steps[:1], steps), np.append(steps, steps[-1:]))
    kernel = cells * sigma / (np.pi * ((f[:, None] - f) ** 2 + sigma**2))
    there = np.isfinite(data.H)
    inside = np.tensordot(kernel, there.astype(float), axes=1)
    H = np.tensordot(kernel, np.where(there, data.H, 0.0), axes=1) / np.maximum(inside, LEAST_INSIDE / 2)
    mask = data.mask & (inside > LEAST_INSIDE)
    held_out = data.held_out | ~mask.any(axis=(1, 2))
    if (~held_out).sum() < LEAST_LINES:
        return None
    own = replace(data, H=H, mask=mask, held_out=held_out)
    return replace(problem, data=own, decay=2 * np.pi * sigma, modes=None)
