"""Errors of a test's channels, of their gain, direction and place, and what its instruments add."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from fem.array_types import Floats

GAIN, DIRECTION, POSITION = slice(0, 1), slice(1, 3), slice(3, 5)
"""Errors of a channel: of its gain [-], turns towards two axes across it [rad], shifts along these [m]."""
N_ERRORS = 5


@dataclass(frozen=True, slots=True)
class ChannelErrors:
    """Standard deviations of what a test's description says of each sensor and excitation.

    Masses and stingers are no more than a small part of the members' (`updating.inference.form`).

    Attributes
    ----------
    position : float
        Of its place, along each axis across its direction [m].
    direction : float
        Of its direction, towards each axis across it [rad].
    gain : float
        Of its sensitivity, relative [-].
    sensor_mass, driver_mass : float
        Of the mass at each place of sensors where none is stated, and of each exciter's fittings [kg].
    stinger : float
        Of the stiffness of each exciter's stinger across the force [N/m].
    sensors, excitations : mapping of str to tuple of float
        Errors (gain, two turns, two shifts) of those of which they are known from an earlier fit, by name.
    """

    position: float = 0.002
    direction: float = float(np.radians(2.0))
    gain: float = 0.03
    sensor_mass: float = 0.005
    driver_mass: float = 0.010
    stinger: float = 2000.0
    sensors: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    excitations: Mapping[str, tuple[float, ...]] = field(default_factory=dict)

    @property
    def std(self) -> Floats:
        """Standard deviations of the errors of one channel, (5,)."""
        return np.array([self.gain, *2 * [self.direction], *2 * [self.position]])


USUAL = ChannelErrors()
"""Errors of channels of a test of which nothing else is said."""
