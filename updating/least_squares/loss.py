"""The robust loss of residuals: pseudo-Huber, and the weights that make least squares follow it."""

from typing import Any

import numpy as np

from fem.array_types import Complexes, Floats

Residuals = Floats | Complexes


def pseudo_huber(r: Residuals, turn: float) -> Floats:
    """Return ρ = 2c² (√(1 + |r|²/c²) - 1), the loss of each residual, of the shape of r.

    |r|² for |r| ≪ c, and 2c|r| for |r| ≫ c (Charbonnier, Blanc-Féraud, Aubert and Barlaud, *IEEE Trans. Image
    Process.* 6, 1997, 298): a resonance in the wrong place leaves residuals of several nepers at a few lines,
    and their squares would outweigh all others.

    Parameters
    ----------
    r : ndarray
        Residuals, real or complex.
    turn : float
        c, where the loss turns from quadratic to linear [unit of r].
    """
    return 2 * turn**2 * (_root(r, turn) - 1)


def pseudo_huber_weight(r: Residuals, turn: float) -> Floats:
    """Return dρ/d|r|² = 1/√(1 + |r|²/c²), the weight of |r|² in iteratively reweighted least squares [-]."""
    return 1 / _root(r, turn)


def _root(r: Residuals, turn: float) -> Any:
    return np.sqrt(1 + np.abs(r) ** 2 / turn**2)
