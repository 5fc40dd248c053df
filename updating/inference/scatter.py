"""Errors of frame theory in the modes: small deviations that every model has, by their slopes.

No frame is the sum of its members to the last digit. Modes are off in frequency and in damping by a little,
and neighbours mix. A few effects could say so as well, and thousands of lines see it.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from fem.reduction.local_changes import LocalChanges
from updating.inference.fit import FitProblem
from updating.inference.fit_data import noise_squares
from updating.inference.fit_result import FitResult

COMMON_LINES = 40
"""Lines at which the directions are found in which random matrices of modes change FRFs."""
LEFT_OUT = 0.1
"""Changes that stay together below this share of the noise are left out [-]."""

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


@dataclass(frozen=True, slots=True, eq=False)
class Scatter:
    """Deviations that change the logarithms of FRFs in proportion.

    Attributes
    ----------
    std : ndarray (n,)
        Their standard deviations.
    group : ndarray of int (n,)
        Those of one group have a common size, which is uncertain.
    slopes_at : callable
        Gives the slopes (n, n_lines, n_out, n_in) of ln H at some lines.
    """

    std: Floats
    group: NDArray[np.int64]
    slopes_at: Callable[[NDArray[np.int64]], Complexes]
    known: dict[bytes, Complexes] = field(default_factory=dict, repr=False)

    def larger(self, factors: Sequence[float]) -> "Scatter":
        """Return the scatter with the standard deviations of each group multiplied."""
        return replace(self, std=self.std * np.asarray(factors)[self.group])

    def slopes(self, lines: NDArray[np.int64]) -> Complexes:
        """Return the slopes at some lines (computed once)."""
        key = lines.tobytes()
        if key not in self.known:
            self.known[key] = self.slopes_at(lines)
        return self.known[key]


def scatter_of(problem: FitProblem, result: FitResult, stiffness: float, damping: float) -> Scatter | None:
    """Return errors of modes' stiffness, group 0, and of their damping, group 1, at a fitted model.

    The stiffness of modes is a random matrix, with λ the eigenvalues: √(λ_r λ_s) (δ_rs + g_rs) with g
    symmetric, its elements of standard deviation ε on the diagonal and ε/√2 beside it (the first order of
    C. Soize's nonparametric model, Probabilistic Engineering Mechanics 15, 2000, 277). The damping that goes
    with the stiffness is another one.

    Parameters
    ----------
    problem : FitProblem
    result : FitResult
    stiffness, damping : float
        ε of each [-]; 0 for none.
    """
    refs, values = list(result.values), np.array(list(result.values.values()))
    highest = float(problem.data.frequency[-1])

    def changes_at(lines: NDArray[np.int64]) -> LocalChanges:
        f = problem.data.frequency[lines]
        engine = problem.engine(f, refs, result.effects)
        return LocalChanges.of(engine, values, problem.damping.ratio(f, result.zeta))

    lines = problem.lines_up_to(np.inf, COMMON_LINES)
    changes, directions = changes_at(lines), []
    for damps, size in enumerate((stiffness, damping)):
        modes = _Modes.of(changes, highest, bool(damps))
        directions.append(modes.main_directions(problem, lines, size) if size > 0 else [])
    if not any(directions):
        return None

    def slopes(lines: NDArray[np.int64]) -> Complexes:
        changes, out = changes_at(lines), []
        for damps, each in enumerate(directions):
            modes = _Modes.of(changes, highest, bool(damps), len(each[0]) if each else 0)
            out += [modes.slope(g) for g in each]
        H = changes.H
        return np.asarray(np.stack(out) / np.where(H != 0, H, np.inf), dtype=complex)

    group = np.repeat(np.arange(len(directions)), [len(each) for each in directions])
    return Scatter(np.ones(len(group)), group, slopes)


@dataclass(frozen=True, slots=True, eq=False)
class _Modes:
    """Responses of the elastic modes of a solved state.

    Attributes
    ----------
    outputs, inputs : ndarray (n, n_out, n_freq), (n, n_in, n_freq)
        To unit forces there, each mode's times √λ, at the inputs times its factor of stiffness or, of that,
        the damping, too.
    H : ndarray (n_freq, n_out, n_in)
        Receptances.
    """

    outputs: Complexes
    inputs: Complexes
    H: Complexes

    @classmethod
    def of(
        cls, changes: LocalChanges, highest: float, damps: bool = False, n: int | None = None
    ) -> "_Modes":
        """Return the first n elastic modes; those up to a frequency [Hz] and the next one unless given."""
        state, limit = changes.state, (2 * np.pi * highest) ** 2
        elastic = np.flatnonzero(state.lam > 1e-6 * limit)
        which = elastic[: int((state.lam[elastic] <= limit).sum()) + 1 if n is None else n]
        root = np.sqrt(state.lam[which])[:, None, None]
        factor = 1j * state.stiffness.imag if damps else state.stiffness
        return cls(changes.Xo[which] * root, changes.Xi[which] * root * factor, changes.H)

    def slope(self, g: Floats) -> Complexes:
        """Return the change of the receptances, (n_freq, n_out, n_in), for a little of a matrix g (n, n)."""
        moved = np.tensordot(g, self.inputs, axes=1)
        return -(np.moveaxis(self.outputs, 2, 0).transpose(0, 2, 1) @ np.moveaxis(moved, 2, 0))

    def main_directions(
        self, problem: FitProblem, lines: NDArray[np.int64], dispersion: float
    ) -> list[Floats]:
        """Return the matrices g (n, n), one standard deviation each, that change ln H by more than little.

        The principal directions of the covariance that all elements together give to ln H; what is left out
        together stays below a share of the noise.
        """
        n = len(self.outputs)
        i, j = np.triu_indices(n)
        std = np.where(i == j, dispersion, dispersion / 2**0.5)
        keep, per = problem.data.mask[lines], problem.data.weight[lines] / self.H
        rows = np.empty((len(i), int(keep.sum())), dtype=complex)
        for k, (a, b) in enumerate(zip(i, j, strict=True)):
            change = np.einsum("of,if->foi", self.outputs[a], self.inputs[b])
            if a != b:
                change += np.einsum("of,if->foi", self.outputs[b], self.inputs[a])
            rows[k] = std[k] * (-change * per)[keep]
        both = np.hstack([rows.real, rows.imag])
        size, vectors = np.linalg.eigh(both @ both.T / rows.shape[1])
        noise = np.sqrt(noise_squares(problem.data, lines).mean())
        main = np.cumsum(np.maximum(size, 0.0)) > (LEFT_OUT * noise) ** 2
        out = []
        for v in vectors[:, main].T:
            g = np.zeros((n, n))
            g[i, j] = g[j, i] = std * v
            out.append(g)
        return out
