"""Damping that scatters among members: small deviations that every model has, by their slopes.

Members of one material dissipate by some per cent more or less than each other. A damping curve over
frequency cannot say so, and thousands of lines see it.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fem.effects.places import frame_of
from fem.elements.frame import Frame, member_contribution
from fem.model import Contribution
from fem.reduction.local_changes import LocalChanges
from updating.inference.fit import FitProblem
from updating.inference.fit_result import FitResult

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


@dataclass(frozen=True, slots=True, eq=False)
class Scatter:
    """Deviations that change the logarithms of FRFs in proportion.

    Attributes
    ----------
    std : ndarray (n,)
        Their standard deviations.
    slopes_at : callable
        Gives the slopes (n, n_lines, n_out, n_in) of ln H at some lines.
    """

    std: Floats
    slopes_at: Callable[[NDArray[np.int64]], Complexes]
    _known: dict[bytes, Complexes] = field(default_factory=dict, repr=False)

    def slopes(self, lines: NDArray[np.int64]) -> Complexes:
        """Return the slopes at some lines (computed once)."""
        key = lines.tobytes()
        if key not in self._known:
            self._known[key] = self.slopes_at(lines)
        return self._known[key]


def damping_scatter(problem: FitProblem, result: FitResult, share: float) -> Scatter | None:
    """Return loss factors of members beside the damping curve, at a fitted model; None for one member.

    Parameters
    ----------
    problem : FitProblem
    result : FitResult
    share : float
        Standard deviation of each in parts of the median loss factor 2ζ [-].
    """
    model = problem.reduced.model
    members = list(model.mesh.members) if model.of_kind(Frame) else []
    if len(members) < 2:
        return None
    every = np.atleast_2d(problem.damping.ratio(problem.data.frequency, result.zeta))[0]

    def slopes(lines: NDArray[np.int64]) -> Complexes:
        f, refs = problem.data.frequency[lines], list(result.values)
        engine, values = problem.engine(f, refs, result.effects), np.array(list(result.values.values()))
        changes = LocalChanges.of(engine, values, problem.damping.ratio(f, result.zeta))
        fields, out = changes.fields(), []
        for m in members:
            parts = member_contribution(frame_of(model), model, m)
            out.append(fields.slope([Contribution(c.dofs, D=c.K) for c in parts if c.K is not None]))
        H = changes.H
        return np.asarray(np.stack(out) / np.where(H != 0, H, np.inf), dtype=complex)

    return Scatter(np.full(len(members), share * 2 * float(np.median(every))), slopes)
