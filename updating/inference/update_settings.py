"""How an update goes about its fit."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, eq=False)
class UpdateSettings:
    """How to go about it.

    Attributes
    ----------
    stages : tuple of float
        Parts of the highest frequency up to which FRFs are fitted, one after the other; the last is 1.
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
        In each stage.
    n_lines : int
        At most so many lines are fitted, evenly spread; in the last stage four times as many.
    n_samples : int
        Steps of the sampler after the fit; 0 for none.
    contradicted : float
        A prior from which the data move a parameter by more than this, in its standard deviations, is wrong:
        the worst is let go, and all is fitted again from there, so that it does not pull at the others. Then
        the next; infinity keeps all.
    seed : int
        Of starts and samples.
    """

    stages: tuple[float, ...] = (0.25, 0.5, 1.0)
    n_starts: int = 1
    select: str = ""
    regularisation: str = ""
    operator: NDArray[np.float64] | None = None
    max_iterations: int = 30
    n_lines: int = 250
    n_samples: int = 0
    contradicted: float = 10.0
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
        if not self.contradicted > 0:
            msg = f"a prior is contradicted at {self.contradicted} standard deviations; it must be positive"
            raise ValueError(msg)
        if not self.stages or self.stages[-1] != 1 or any(not 0 < s <= 1 for s in self.stages):
            msg = f"the stages are {self.stages}; they lie above 0 and end with 1"
            raise ValueError(msg)
