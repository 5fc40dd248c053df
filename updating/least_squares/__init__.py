"""Nonlinear least squares: one loop for all fits, and the robust loss of residuals."""

from typing import TYPE_CHECKING

from fem.lazy import names_on_use

if TYPE_CHECKING:
    from updating.least_squares.costs import Levels, pseudo_huber, pseudo_huber_weight
    from updating.least_squares.levenberg_marquardt import (
        Control,
        Linearisation,
        Stop,
        Tolerance,
        minimise,
        step_within,
    )
    from updating.least_squares.mode_levels import ModeLevels
else:
    __getattr__, __dir__ = names_on_use(__name__)
