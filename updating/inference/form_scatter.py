"""Sizes of the small deviations of frequencies, damping and channels, as unknowns of a fit."""

from dataclasses import dataclass

import numpy as np

from fem.array_types import Floats, Ints
from fem.reduction.deviations import Deviations, EndChanges


@dataclass(frozen=True, slots=True, eq=False)
class ChannelScatter:
    """Errors of channels that data can know, in combinations that are independent beforehand.

    Attributes
    ----------
    of : ndarray of int (k,)
        Number of the channel of each, excitations behind sensors; rising.
    units : ndarray (k, 5)
        Errors of that channel for a standard deviation of each combination, as of :class:`ChannelErrors`.
    std : ndarray (5,)
        Standard deviations of these.
    """

    of: Ints
    units: Floats
    std: Floats

    def changes(self, misread: Floats, n_out: int) -> tuple[EndChanges, EndChanges]:
        """Return what the combinations change of n_out outputs, and of inputs.

        ``misread`` (r, n, 5) is what a unit of each error of each channel does on the basis's columns.
        """
        along = np.einsum("rke,ke->rk", misread[:, self.of], self.units)
        first = self.of < n_out
        inputs = EndChanges(self.of[~first] - n_out, along[:, ~first])
        return EndChanges(self.of[first], along[:, first]), inputs

    def errors(self, x: Floats, n: int) -> Floats:
        """Return the errors (n, 5) of all channels from the sizes (k,) of the combinations."""
        out = np.zeros((n, self.units.shape[1]))
        np.add.at(out, self.of, x[:, None] * self.units)
        return out

    def deviations(self, covariance: Floats, n: int) -> Floats:
        """Return the standard deviations (n, 5) of the errors of all channels.

        ``covariance`` (k, k) is that of the combinations' sizes. What data cannot know keeps its prior's.
        """
        out = np.tile(self.std**2, (n, 1))
        for channel in np.unique(self.of):
            k = np.flatnonzero(self.of == channel)
            less = np.eye(len(k)) - covariance[np.ix_(k, k)]
            out[channel] -= np.einsum("ke,kl,le->e", self.units[k], less, self.units[k])
        return np.sqrt(np.maximum(out, 0.0))

    def sizes(self, errors: Floats) -> Floats:
        """Return the sizes (k,) of the combinations in errors (n, 5) of all channels; 0 without any."""
        if not len(errors):
            return np.zeros(len(self.of))
        squares = np.where(self.std > 0, self.std, 1.0) ** 2
        return (self.units * errors[self.of] / squares).sum(axis=1)


@dataclass(frozen=True, slots=True, eq=False)
class FormScatter:
    """Deviations of modes' eigenvalues and damping ratios, and of the loss factors of members and joints.

    With s = √λ_r Mφ_r of a fitted model x s sᵀ in K shifts the eigenvalue of mode r by the share x, and
    i 2ζ_r y s sᵀ its damping ratio by the share y.

    Attributes
    ----------
    deviations : Deviations
    eigenvalue : float
        Standard deviation of the relative shift of each elastic mode's eigenvalue [-].
    losses : ndarray (m,)
        Standard deviations of the other deviations [-].
    sizes : tuple of float
        What ``eigenvalue`` may be, each as probable as the others.
    channels : ChannelScatter, optional
        Their deviations are the last.
    """

    deviations: Deviations
    eigenvalue: float
    losses: Floats
    sizes: tuple[float, ...] = ()
    channels: ChannelScatter | None = None

    @property
    def shifts(self) -> Ints:
        """Which deviations are shifts of eigenvalues."""
        return np.arange(self.deviations.stiff.shape[1])

    @property
    def std(self) -> Floats:
        """Standard deviations of all deviations, (n,)."""
        return np.concatenate(
            [np.full(len(self.shifts), self.eigenvalue), self.losses, np.ones(self.n_channels)]
        )

    @property
    def n_channels(self) -> int:
        """Number of deviations of channels."""
        return 0 if self.channels is None else len(self.channels.of)
