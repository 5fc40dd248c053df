"""Sensitivity-based updating of all members and connections to modes, regularised; the largest changes count.

Stiffness and mass of each member and the stiffness of each connection vary together. Tikhonov's weight at the
corner of the L-curve damps the steps. As many of the largest changes as BIC asks for are the answer.
"""

import numpy as np

from benchmarks.open_test.rivals.common import Updating
from updating import l_curve

SOURCE = (
    "Friswell and Mottershead, Finite Element Model Updating in Structural Dynamics, 1995; Mottershead, Link "
    "and Friswell, Mech. Syst. Signal Process. 25, 2011; Hansen and O'Leary, SIAM J. Sci. Comput. 14, 1993"
)
KINDS = {"member_stiffness", "member_density", "joint_stiffness", "support_flexibility"}
MOST = 3
TEMPERATURE, UNKNOWN, PENALTY = 300.0, 0.9, 6.0
"""Chosen on the practice set."""


def solve(case):
    """Return up to three of the largest changes of an updated model."""
    model = Updating(case, case.options(KINDS))
    usual = np.array([o.usual for o in model.options])

    def regularised(A, b):
        curve = l_curve(A * usual, b)
        return usual * curve.solutions[curve.corner]

    changes = model.fit(regularised)[0]
    order = np.argsort(-np.abs(changes / usual))[:MOST]
    return case.said(model.largest(order, changes), TEMPERATURE, UNKNOWN, PENALTY)
