"""Errors of a test's channels: of their gain, their direction and their place."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

GAIN, DIRECTION, POSITION = slice(0, 1), slice(1, 3), slice(3, 5)
"""Errors of a channel: of its gain [-], turns towards two axes across it [rad], shifts along these [m]."""
N_ERRORS = 5


@dataclass(frozen=True, slots=True)
class ChannelErrors:
    """Standard deviations of what a test's description says of each sensor and excitation.

    Attributes
    ----------
    position : float
        Of its place, along each axis across its direction [m].
    direction : float
        Of its direction, towards each axis across it [rad].
    gain : float
        Of its sensitivity, relative [-].
    """

    position: float = 0.002
    direction: float = float(np.radians(2.0))
    gain: float = 0.03

    @property
    def std(self) -> NDArray[np.float64]:
        """Standard deviations of the errors of one channel, (5,)."""
        return np.array([self.gain, *2 * [self.direction], *2 * [self.position]])


USUAL = ChannelErrors()
"""Errors of channels of a test of which nothing else is said."""
