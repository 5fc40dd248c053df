"""Constants that decide what is believed: how much data say, what may vary, when an effect is named."""

from collections.abc import Mapping

import numpy as np

from fem.declarations import Environment

DATA_PER_MODE = 4.0
"""Number of independent data of each mode of the band: frequency, damping and a few of the shape [-]."""
FORM_SECTION = {"A": 0.01, "Iy": 0.02, "Iz": 0.02, "J": 0.05, "shear": 0.5}
"""Standard deviations of mass, bending and torsional stiffness, and shear flexibility of members that are
alike, relative [-]."""
FORM_CORNER = {"u": (0.1, 0.25), "plane": (0.12, 0.2), "mass": (-0.2, 0.22), "inertia": (0.8, 1.1)}
"""Means and standard deviations of the inside of a corner: of the logarithm of its stiffness, of that of
bending in its plane besides, of its mass, relative, and of its rotary inertia in parts of ∫ m s² ds along its
members [-]. The means are half-way between centre lines and blocks of solids."""
FORM_JOINT = {"u": (0.0, 1.0), "plane": (0.0, 0.4), "mass": (0.0, 0.4), "inertia": (0.0, 0.4)}
"""The same of what lies inside of a joint [-]."""
FORM_CLAMP = {"u": (-0.3, 0.5)}
"""Of the logarithm of the stiffness at a clamped end [-]."""
LIGHT = 0.05
"""Largest standard deviation of what an instrument of a test adds, in parts of a typical member's mass or
bending stiffness [-]: instruments are chosen not to disturb."""
STATED_MASS = 0.2
"""Standard deviation of the stated masses of sensors, relative [-]."""
FORM_DAMPING = 0.1
"""Relative standard deviation of each mode's damping ratio and of each member's loss factor [-]. That of
joints is as uncertain as the study's damping."""
FORM_MODES = 0.0005, 0.008
"""Least and largest standard deviation of the relative shift of each mode's eigenvalue that frame theory
leaves: of any order between them, as the data say [-]."""
MISSING = 0.5
"""Prior probability that something is missing [-]. A user who asks has a reason; where data say little, it
stays near one half."""
EFFECT_ODDS = np.log(10.0)
"""Logarithm of the prior odds against each further change after the first. Each parameter of an effect counts
as one change, but for its position."""
UNSTATED: Mapping[Environment, float] = {
    Environment.FLUID: 0.01,
    Environment.ELASTOMER: 0.1,
    Environment.ROTATION: 0.0,
}
"""Probability that a structure is in a situation which its study does not state [-]. A washer or a layer of
glue is easily overlooked, water is not, and nobody tests a running machine unaware."""
UNKNOWN_ODDS = np.log(1e4)
"""Prior odds, as a logarithm, against what is missing being nothing that the library has."""
TWIN_NATS = 3.0
"""Hypotheses within so much of the best one's score are its twins."""
FAR_STD = 2.5
"""Prior standard deviations beyond which the value of an uncertain parameter is implausible [-]."""
RARE = 0.01
"""Hypotheses that are less probable are not named [-]."""
DISCREPANCY_MAX = 0.5
"""Level that a right model of beams may leave beyond noise, in parts of the study's ``model_error`` [-]."""
DISCREPANCY_MIN = 0.05
"""Level that beams leave of any structure in any case, in parts of the study's ``model_error`` [-]."""
