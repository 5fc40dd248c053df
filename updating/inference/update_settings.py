"""Settings of an update's fit."""

from dataclasses import dataclass

from fem.array_types import Floats
from updating.inference.defaults import FULL_LINES


@dataclass(frozen=True, slots=True, eq=False)
class UpdateSettings:
    """How to go about it.

    Attributes
    ----------
    n_starts : int
        Starts; the first is the model's values, others are drawn from the priors.
    select : str
        ``"pivoting"`` or ``"forward"`` to leave out parameters that the data cannot tell apart, or empty.
    regularisation : str
        ``"tikhonov"`` to keep steps from the start small where data are weak, ``"gsvd"`` for those along an
        operator; empty for none. The weight is that at the L-curve's corner.
    operator : ndarray (p, n_unknown) or None
        L of ``"gsvd"``, on the unknowns' own scales (ln θ, or θ over its scale).
    max_iterations : int
        In each band of a fit.
    n_lines : int
        Largest number of fitted lines, evenly spread over the band.
    n_samples : int
        Steps of the sampler after the fit; 0 for none.
    seed : int
        Of starts and samples.
    """

    n_starts: int = 1
    select: str = ""
    regularisation: str = ""
    operator: Floats | None = None
    max_iterations: int = 30
    n_lines: int = FULL_LINES
    n_samples: int = 0
    seed: int = 0

    def __post_init__(self) -> None:
        for what, value, allowed in (
            ("selection", self.select, ("", "pivoting", "forward")),
            ("regularisation", self.regularisation, ("", "tikhonov", "gsvd")),
        ):
            if value not in allowed:
                msg = f"the {what} is '{value}'; allowed are {', '.join(a for a in allowed if a)}, or none"
                raise ValueError(msg)
        if self.regularisation == "gsvd" and self.operator is None:
            msg = "the regularisation 'gsvd' needs an operator L (p, n_unknown)"
            raise ValueError(msg)
        for what, least in (("n_starts", 1), ("max_iterations", 1), ("n_lines", 1), ("n_samples", 0)):
            if getattr(self, what) < least:
                msg = f"{what} is {getattr(self, what)}; at least {least} is needed"
                raise ValueError(msg)
