"""Small deviations that every model has, by their slopes: damping of members, and modes off in frequency.

Members of one material dissipate by some per cent more or less than each other, which a damping curve over
frequency cannot say. Beams against real structures differ mostly in frequencies. Thousands of lines see both.
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


def scatter_of(problem: FitProblem, result: FitResult, damping: float, eigenvalue: float) -> Scatter | None:
    """Return loss factors of members beside the damping curve and shifts of modes, at a fitted model.

    Parameters
    ----------
    problem : FitProblem
    result : FitResult
    damping : float
        Standard deviation of each loss factor in parts of the median loss factor 2ζ [-].
    eigenvalue : float
        Standard deviation of the relative shift of each elastic mode's eigenvalue [-].
    """
    model = problem.reduced.model
    members = list(model.mesh.members) if model.of_kind(Frame) else []
    members = members if len(members) > 1 else []
    every = np.atleast_2d(problem.damping.ratio(problem.data.frequency, result.zeta))[0]
    highest = (2 * np.pi * problem.data.frequency[-1]) ** 2
    refs, values = list(result.values), np.array(list(result.values.values()))

    def changes_at(lines: NDArray[np.int64]) -> LocalChanges:
        f = problem.data.frequency[lines]
        engine = problem.engine(f, refs, result.effects)
        return LocalChanges.of(engine, values, problem.damping.ratio(f, result.zeta))

    few = problem.lines_up_to(np.inf, 2)
    n_modes = len(_shifted(changes_at(few), highest)) if eigenvalue > 0 else 0

    def slopes(lines: NDArray[np.int64]) -> Complexes:
        changes = changes_at(lines)
        fields, state, out = changes.fields(), changes.state, []
        for m in members:
            parts = member_contribution(frame_of(model), model, m)
            out.append(fields.slope([Contribution(c.dofs, D=c.K) for c in parts if c.K is not None]))
        for r in _shifted(changes, highest) if n_modes else ():
            force = state.stiffness * state.lam[r] * changes.Xi[r]
            out.append(-np.einsum("of,if->foi", changes.Xo[r], force))
        H = changes.H
        return np.asarray(np.stack(out) / np.where(H != 0, H, np.inf), dtype=complex)

    loss = np.full(len(members), damping * 2 * float(np.median(every)))
    std = np.concatenate([loss, np.full(n_modes, eigenvalue)])
    return Scatter(std, slopes) if len(std) else None


def _shifted(changes: LocalChanges, highest: float) -> NDArray[np.int64]:
    """Return the elastic modes of a solved state up to an eigenvalue and the next one."""
    lam = changes.state.lam
    elastic = np.flatnonzero(lam > 1e-6 * highest)
    return elastic[: int((lam[elastic] <= highest).sum()) + 1]
