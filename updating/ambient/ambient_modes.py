"""Modes identified from responses alone: the result of :mod:`updating.ambient.identification`."""

from dataclasses import dataclass

import numpy as np

from fem.analysis.modes import Modes
from fem.array_types import Complexes, Floats, Ints
from fem.summary import fields_summary
from updating.ambient.spectra import Peak, SingularSpectra
from updating.ambient.subspace import SubspacePoles


@dataclass(frozen=True, slots=True, eq=False)
class AmbientModes:
    """Modes identified from responses to unknown forces; their shapes have no scale.

    Attributes
    ----------
    modes : Modes
        Natural frequencies |λ|/2π, damping ratios, real shapes at the channels with a largest entry of 1.
    poles : ndarray of complex (n_modes,)
        λ [rad/s].
    complex_shapes : ndarray of complex (n_channels, n_modes)
        Of the scale of ``modes.shapes``, nearest to real.
    frequency_std, zeta_std : ndarray (n_modes,)
        Standard deviations [Hz, -].
    shape_std : ndarray (n_channels, n_modes)
        Standard deviations of ``modes.shapes`` for a shape of fixed length.
    covariance : ndarray (2 n_modes, 2 n_modes)
        Of (frequency, ratio), mode by mode.
    mpc, mpd : ndarray (n_modes,)
        Modal phase collinearity [-], mean phase deviation [degrees].
    spectra_mac : ndarray (n_modes,)
        MAC of the shape and the singular vector of the spectra that is most like it at this frequency [-].
    order : int
        Order of the state-space model that the record supports.
    stabilisation : SubspacePoles
        Poles of all orders.
    members : tuple of ndarray of int
        The poles of each mode, by index.
    spectra : SingularSpectra
    unexplained : tuple of Peak
        Peaks of the largest singular value without a mode, by frequency.
    duration : float
        Of the record [s].
    band : (float, float)
        [Hz].
    """

    modes: Modes
    poles: Complexes
    complex_shapes: Complexes
    frequency_std: Floats
    zeta_std: Floats
    shape_std: Floats
    covariance: Floats
    mpc: Floats
    mpd: Floats
    spectra_mac: Floats
    order: int
    stabilisation: SubspacePoles
    members: tuple[Ints, ...]
    spectra: SingularSpectra
    unexplained: tuple[Peak, ...]
    duration: float
    band: tuple[float, float]

    __repr__ = fields_summary

    def relative_std(self, least_shape: float = 0.01) -> tuple[Floats, Floats]:
        """Return standard deviations as an updating takes them, (n_modes,) each [-].

        Those of frequencies, relative, and the root mean square of those of a shape's entries over that of
        the entries.

        Parameters
        ----------
        least_shape : float
            Of the latter: places and directions of sensors are not known better [-].
        """
        return relative_std(self.modes, self.frequency_std, self.shape_std, least_shape)

    def table(self) -> str:
        """Return the modes as lines of text, then peaks that they do not explain."""
        zeta = np.zeros(0) if self.modes.zeta is None else self.modes.zeta
        lines = ["mode  frequency [Hz]        damping ratio [%]     MPC    shape ± [%]  MAC with spectra"]
        noise = self.relative_std(0.0)[1]
        for k, f in enumerate(self.modes.frequency):
            lines.append(
                f"{k + 1:4d}  {f:9.4g} ± {self.frequency_std[k]:<8.2g}  {100 * zeta[k]:8.3f} ± "
                f"{100 * self.zeta_std[k]:<8.2g}  {self.mpc[k]:.3f}  {100 * noise[k]:11.2g}  "
                f"{self.spectra_mac[k]:16.3f}"
            )
        return "\n".join([*lines, *unexplained_words(self.unexplained)])


def relative_std(
    modes: Modes, frequency_std: Floats, shape_std: Floats, least_shape: float
) -> tuple[Floats, Floats]:
    """Return relative standard deviations of frequencies and of shapes without gaps, (n_modes,) each [-]."""
    if not modes.n_modes:
        return np.zeros(0), np.zeros(0)
    size, noise = (np.sqrt(np.nanmean(x**2, axis=0)) for x in (np.real(modes.shapes), shape_std))
    return frequency_std / modes.frequency, np.maximum(noise / size, least_shape)


def unexplained_words(peaks: tuple[Peak, ...]) -> tuple[str, ...]:
    """Say which peaks no mode explains."""
    return tuple(
        f"the spectra have a peak at {p.frequency:.4g} Hz, {p.rise_db:.2g} dB high, that no mode explains: "
        "a machine of steady speed, the spectrum of the forces, or a mode for which the record is too short"
        for p in peaks
    )
