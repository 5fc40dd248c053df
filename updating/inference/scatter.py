"""Small deviations that every model has, by their slopes: modes off in frequency and in damping.

Beams against real structures differ mostly in frequencies. Each mode dissipates by some per cent more or less
than a smooth damping curve says. Thousands of lines see both.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

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
    """Return shifts of the modes' eigenvalues and damping ratios at a fitted model.

    With Z⁻¹ = Σ φ_r φ_rᵀ / (λ_r s + m), s = 1 + i(η + 2ζ) and m = -ω², a change of ln λ_r adds
    -(φ_r s λ_r φ_rᵀ) (λ_r s + m)⁻² to the receptances, and one of ln ζ_r the same with 2iζ for s.

    Parameters
    ----------
    problem : FitProblem
    result : FitResult
    damping : float
        Standard deviation of the logarithm of each mode's damping ratio [-].
    eigenvalue : float
        Standard deviation of the relative shift of each elastic mode's eigenvalue [-].
    """
    highest = (2 * np.pi * problem.data.frequency[-1]) ** 2
    refs, values = list(result.values), np.array(list(result.values.values()))

    def ratio_at(lines: NDArray[np.int64]) -> Floats:
        return problem.damping.ratio(problem.data.frequency[lines], result.zeta)

    def changes_at(lines: NDArray[np.int64]) -> LocalChanges:
        engine = problem.engine(problem.data.frequency[lines], refs, result.effects)
        return LocalChanges.of(engine, values, ratio_at(lines))

    n_modes = len(_shifted(changes_at(problem.lines_up_to(np.inf, 2)), highest))

    def slopes(lines: NDArray[np.int64]) -> Complexes:
        changes, zeta = changes_at(lines), np.atleast_2d(ratio_at(lines))[0]
        state, H, out = changes.state, changes.H, []
        for r in _shifted(changes, highest)[:n_modes]:
            for factor, std in ((state.stiffness, eigenvalue), (2j * zeta, damping)):
                force = factor * state.lam[r] * changes.Xi[r]
                out += [-np.einsum("of,if->foi", changes.Xo[r], force)] if std > 0 else []
        return np.asarray(np.stack(out) / np.where(H != 0, H, np.inf), dtype=complex)

    std = np.tile([s for s in (eigenvalue, damping) if s > 0], n_modes)
    return Scatter(std, slopes) if len(std) else None


def _shifted(changes: LocalChanges, highest: float) -> NDArray[np.int64]:
    """Return the elastic modes of a solved state up to an eigenvalue and the next one."""
    lam = changes.state.lam
    elastic = np.flatnonzero(lam > 1e-6 * highest)
    return elastic[: int((lam[elastic] <= highest).sum()) + 1]
