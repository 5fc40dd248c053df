"""Data and result of a modal fit."""

from dataclasses import dataclass

import numpy as np

from fem.analysis.frf import FRF
from fem.array_types import Complexes, Floats, Ints
from updating.modal.condensed_lines import CondensedLines, condense_lines


@dataclass(frozen=True, slots=True, eq=False)
class ModalScatter:
    """Covariance of shapes: of (Re ψ_o, Im ψ_o) it is conditional_o + slope_o · covariance · slope_oᵀ.

    Attributes
    ----------
    covariance : ndarray (n, n)
        Of the unknowns besides the shapes: (ln -Re λ, Im λ / -Re λ) mode by mode, then the real and the
        imaginary part of each participation but the largest of its mode.
    rows, cols : ndarray of int (n - 2 n_modes over 2,)
        Modes and inputs of these participations.
    conditional : ndarray (n_modes, n_out, 2, 2)
        With the other unknowns known.
    slope : ndarray (n_modes, n_out, 2, n)
        Derivatives by the other unknowns.
    """

    covariance: Floats
    rows: Ints
    cols: Ints
    conditional: Floats
    slope: Floats


@dataclass(frozen=True, slots=True, eq=False)
class ModalFit:
    """Poles, participations, shapes and residuals that fit FRFs.

    Attributes
    ----------
    poles : ndarray of complex (n_modes,)
        [rad/s].
    participation : ndarray of complex (n_modes, n_in)
        The largest entry of each row is 1.
    shapes : ndarray of complex (n_out, n_modes)
        ψ, the residue of a receptance being ψ_or L_ri [m/(N s)].
    lower, upper : ndarray (n_out, n_in)
        Residuals of modes below the band [1/kg] and above it [m/N]; 0 if not asked for.
    H : ndarray of complex (n_freq, n_out, n_in)
        Synthesised FRFs [unit of the FRF].
    misfit : ndarray of complex (n_freq, n_out, n_in)
        (measured - synthesised) over the standard deviation that was assumed [-].
    covariance : ndarray (2 n_modes, 2 n_modes)
        Of (ln -Re λ, Im λ / -Re λ), mode by mode: relative to the decay [-].
    scatter : ModalScatter
        Of shapes and of all that they depend on.
    energy : ndarray (n_modes,)
        Rise of the sum of squares of ``misfit`` if the mode is left out and all the rest stays free but the
        poles [-].
    n_parameters : int
        Of one mode.
    converged : bool
    n_steps : int
    """

    poles: Complexes
    participation: Complexes
    shapes: Complexes
    lower: Floats
    upper: Floats
    H: Complexes
    misfit: Complexes
    covariance: Floats
    scatter: ModalScatter
    energy: Floats
    n_parameters: int
    converged: bool
    n_steps: int


@dataclass(frozen=True, slots=True, eq=False)
class ModalFitData:
    """FRFs with the weights of their fit.

    Attributes
    ----------
    frf : FRF
    scale : ndarray (n_out,)
        Standard deviation of each output [unit of the FRF].
    spread : ndarray (n_freq, n_in)
        Its factor at each line and input [-].
    lower, upper : bool
        Whether there are residuals of modes below and above the band.
    added_decay : float
        Addition of an exponential window to the decay of all motions: the FRFs are those at s = iω + this
        [1/s].
    """

    frf: FRF
    scale: Floats
    spread: Floats
    lower: bool = True
    upper: bool = True
    added_decay: float = 0.0

    def s(self, omega: Floats) -> Complexes:
        """Return Laplace's variable at frequencies of rad/s [1/s]."""
        return np.asarray(1j * omega + self.added_decay, dtype=complex)

    def singular(self, poles: Complexes) -> Complexes:
        """Return the complex frequencies at which terms of these poles and residuals are infinite [rad/s]."""
        at = np.concatenate([poles, poles.conj(), [0.0]])
        return np.asarray((at - self.added_decay) / 1j, dtype=complex)

    def condensed(self, poles: Complexes) -> CondensedLines:
        """Return the weighted FRFs at few nodes, for a fit of poles near given ones."""
        H = self.frf.H / self.scale[:, None]
        return condense_lines(self.frf.omega, H, self.spread, self.singular(poles))
