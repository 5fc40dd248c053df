"""Modes identified from FRFs: the result of :func:`updating.modal.identification.identify_modes`."""

from dataclasses import dataclass

import numpy as np

from fem.analysis.frf import FRF
from fem.analysis.modes import Modes
from fem.array_types import Complexes, Floats
from fem.model import Damping
from fem.summary import fields_summary
from updating.modal.peaks import Candidate, UnexplainedPeak, peak_words
from updating.modal.poles import (
    IdentificationError,
    Stabilisation,
)


@dataclass(frozen=True, slots=True, eq=False)
class IdentifiedModes:
    """Modes identified from FRFs.

    Attributes
    ----------
    modes : Modes
        Natural frequencies |λ|/2π, damping ratios, real shapes at the outputs, whose labels are the rows'
        [1/√kg if ``scaled``, else with a largest entry of 1].
    poles : ndarray of complex (n_modes,)
        λ [rad/s].
    participation : ndarray of complex (n_modes, n_in)
        With ``complex_shapes`` φ, the residue of a receptance being φ_o participation_i.
    complex_shapes : ndarray of complex (n_out, n_modes)
        Of the scale of ``modes.shapes``.
    frequency_std, zeta_std : ndarray (n_modes,)
        Standard deviations [Hz, -].
    shape_std : ndarray (n_out, n_modes)
        Standard deviations of ``modes.shapes`` [as they].
    across_std : ndarray (n_modes,)
        Root mean square of the deviations across each shape over that of its entries [-]. They do not
        contain that of the scale, which is large at driving points that hardly move.
    covariance : ndarray (2 n_modes, 2 n_modes)
        Of (frequency, ratio), mode by mode.
    mpc, mpd, mcf : ndarray (n_modes,)
        Modal phase collinearity [-], mean phase deviation [degrees], modal complexity factor [-].
    scaled : bool
        Whether the shapes have a modal mass of 1.
    driving : tuple of (str, str)
        Outputs and inputs at the same place and direction, from which the scale is.
    lower, upper : ndarray (n_out, n_in)
        Residuals: the receptance gains -lower/ω² + upper [1/kg, m/N].
    synthesised : FRF
        Of these modes and the residuals, on the lines and of the kind of the data.
    error : ndarray (n_out, n_in)
        Root of Σ |H_synthesised - H|² / Σ |H|² over the lines [-].
    noise : ndarray (n_freq, n_out, n_in)
        Standard deviation of the real and of the imaginary parts that the fit assumed [unit of the FRF].
    stabilisation : Stabilisation
        Poles of all orders.
    candidates : tuple of Candidate
        All that were tried, by frequency.
    choices : tuple of str
        Choices made on the way, in order.
    unexplained : tuple of UnexplainedPeak
        Peaks of the data that the modes do not explain, the highest first, with the reason.
    """

    modes: Modes
    poles: Complexes
    participation: Complexes
    complex_shapes: Complexes
    frequency_std: Floats
    zeta_std: Floats
    shape_std: Floats
    across_std: Floats
    covariance: Floats
    mpc: Floats
    mpd: Floats
    mcf: Floats
    scaled: bool
    driving: tuple[tuple[str, str], ...]
    lower: Floats
    upper: Floats
    synthesised: FRF
    error: Floats
    noise: Floats
    stabilisation: Stabilisation
    candidates: tuple[Candidate, ...]
    choices: tuple[str, ...]
    unexplained: tuple[UnexplainedPeak, ...] = ()

    __repr__ = fields_summary

    @property
    def residues(self) -> Complexes:
        """Residues of the receptances at the poles, shape (n_modes, n_out, n_in) [m/(N s)]."""
        return self.complex_shapes.T[:, :, None] * self.participation[:, None, :]

    def relative_std(self, least_shape: float = 0.01) -> tuple[Floats, Floats]:
        """Return standard deviations as an updating takes them, (n_modes,) each [-].

        Those of frequencies, relative, and those across the shapes: an updating compares shapes at any scale.

        Parameters
        ----------
        least_shape : float
            Of the latter: places and directions of sensors are not known better [-].
        """
        return self.frequency_std / self.modes.frequency, np.maximum(self.across_std, least_shape)

    def damping(self) -> Damping:
        """Return the damping ratios as those of a model, over frequency."""
        zeta = self.modes.zeta
        if zeta is None or not zeta.size:
            msg = "there is no mode to take a damping ratio from"
            raise IdentificationError(msg)
        return Damping.modal(zeta, self.modes.frequency)

    def table(self) -> str:
        """Return the modes as lines of text, then peaks that they do not explain."""
        zeta = np.zeros(0) if self.modes.zeta is None else self.modes.zeta
        lines = ["mode  frequency [Hz]        damping ratio [%]     MPC    MPD [deg]"]
        for k, f in enumerate(self.modes.frequency):
            lines.append(
                f"{k + 1:4d}  {f:9.3f} ± {self.frequency_std[k]:<8.2g}  {100 * zeta[k]:8.4f} ± "
                f"{100 * self.zeta_std[k]:<8.2g}  {self.mpc[k]:.4f}  {self.mpd[k]:6.2f}"
            )
        return "\n".join([*lines, *peak_words(self.unexplained)])
