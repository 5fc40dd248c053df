"""Errors of frame theory in the modes: small deviations that every model has, by their slopes.

No frame is the sum of its members to the last digit. Modes are off in frequency and in damping by a little,
and neighbours mix. A few effects could say so as well, and thousands of lines see it.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.model import Contribution
from fem.reduction.local_changes import LocalChanges
from updating.inference.fit import FitProblem
from updating.inference.fit_data import noise_squares
from updating.inference.fit_result import FitResult

COMMON_LINES = 20
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


def scatter_of(
    problem: FitProblem, result: FitResult, modes: Sequence[float], connections: Sequence[float]
) -> Scatter | None:
    """Return errors of the stiffness and damping of modes and of connections, at a fitted model.

    The stiffness of modes is a random matrix, with λ the eigenvalues: √(λ_r λ_s) (δ_rs + g_rs) with g
    symmetric, its elements of standard deviation ε on the diagonal and ε/√2 beside it (the first order of
    C. Soize's nonparametric model, Probabilistic Engineering Mechanics 15, 2000, 277). The damping that goes
    with the stiffness is another one. The stiffness L Lᵀ of each joint and elastic support is L (I + g) Lᵀ,
    with couplings of its directions.

    Parameters
    ----------
    problem : FitProblem
    result : FitResult
    modes, connections : float, float
        ε of stiffness and of damping [-]; 0 for none.
    """
    refs, values = list(result.values), np.array(list(result.values.values()))
    highest = float(problem.data.frequency[-1])

    def changes_at(lines: NDArray[np.int64]) -> LocalChanges:
        f = problem.data.frequency[lines]
        engine = problem.engine(f, refs, result.effects)
        return LocalChanges.of(engine, values, problem.damping.ratio(f, result.zeta))

    lines = problem.lines_up_to(np.inf, COMMON_LINES)
    first = changes_at(lines)
    at_first = _Modes.of(first, highest)
    main = at_first.main_directions(problem, lines, modes)
    joints = _joints_of(problem, result) if max(connections) > 0 else []
    mixed = []
    if joints:
        keep, per = problem.data.mask[lines], problem.data.weight[lines] / first.H
        rows = _joint_slopes(first, joints) * per
        for size, factor in zip(connections, at_first.of_connections, strict=True):
            least = LEFT_OUT * _noise(problem, lines)
            mixed.append(size * _principal(size * (rows * factor)[:, keep], least) if size > 0 else [])
    n = sum(map(len, (*main, *mixed)))
    if not n:
        return None

    def slopes(lines: NDArray[np.int64]) -> Complexes:
        changes = changes_at(lines)
        modes = _Modes.of(changes, highest, len(at_first.outputs))
        out = [modes.slope(g) * modes.factors[k] for k, each in enumerate(main) for g in each]
        rows = _joint_slopes(changes, joints) if joints else np.zeros(0)
        for each, factor in zip(mixed, modes.of_connections, strict=False):
            out += [np.tensordot(v, rows, axes=1) * factor for v in each]
        return np.asarray(np.stack(out) / np.where(modes.H != 0, modes.H, np.inf), dtype=complex)

    return Scatter(np.ones(n), slopes)


@dataclass(frozen=True, slots=True, eq=False)
class _Modes:
    """Responses of the elastic modes of a solved state.

    Attributes
    ----------
    outputs, inputs : ndarray (n, n_out, n_freq), (n, n_in, n_freq)
        To unit forces there, each mode's times √λ.
    factors, of_connections : tuple of ndarray (n_freq, 1, 1)
        Of stiffness and of the damping that goes with it; of connections in parts of their stiffness.
    H : ndarray (n_freq, n_out, n_in)
        Receptances.
    """

    outputs: Complexes
    inputs: Complexes
    factors: tuple[NDArray[Any], NDArray[Any]]
    of_connections: tuple[NDArray[Any], NDArray[Any]]
    H: Complexes

    @classmethod
    def of(cls, changes: LocalChanges, highest: float, n: int | None = None) -> "_Modes":
        """Return the first n elastic modes; those up to a frequency [Hz] and the next one unless given."""
        state, limit = changes.state, (2 * np.pi * highest) ** 2
        elastic = np.flatnonzero(state.lam > 1e-6 * limit)
        which = elastic[: int((state.lam[elastic] <= limit).sum()) + 1 if n is None else n]
        root = np.sqrt(state.lam[which])[:, None, None]
        factor = state.stiffness[:, None, None]
        own = state.connections[:, None, None]
        parts = (factor, 1j * factor.imag), (np.ones_like(own), 1j * own.imag / own)
        return cls(changes.Xo[which] * root, changes.Xi[which] * root, *parts, changes.H)

    def slope(self, g: Floats) -> Complexes:
        """Return the change of the receptances, (n_freq, n_out, n_in), for forces g (n, n) per motion."""
        moved = np.tensordot(g, self.inputs, axes=1)
        return -(self.outputs.transpose(2, 1, 0) @ moved.transpose(2, 0, 1))

    def main_directions(
        self, problem: FitProblem, lines: NDArray[np.int64], sizes: Sequence[float]
    ) -> tuple[list[Floats], ...]:
        """Return matrices g (n, n), one standard deviation each, that change ln H by more than little.

        They are the principal directions of the covariance that all elements together give to ln H, for
        stiffness and for damping; what is left out stays together below a share of the noise.
        """
        n = len(self.outputs)
        i, j = np.triu_indices(n)
        std = np.where(i == j, 1.0, 2**-0.5)
        keep, per = problem.data.mask[lines], problem.data.weight[lines] / self.H
        A, B = self.outputs.transpose(2, 1, 0), self.inputs.transpose(2, 1, 0)
        rows: Complexes = np.empty((len(i), int(keep.sum())), dtype=complex)
        for k, (a, b) in enumerate(zip(i, j, strict=True)):
            change = A[:, :, None, a] * B[:, None, :, b]
            if a != b:
                change = change + A[:, :, None, b] * B[:, None, :, a]
            rows[k] = std[k] * (change * per)[keep]
        least, out = LEFT_OUT * _noise(problem, lines), []
        for factor, size in zip(self.factors, sizes, strict=True):
            matrices = []
            changes = size * rows * np.broadcast_to(factor, keep.shape)[keep]
            for v in _principal(changes, least) if size > 0 else ():
                g = np.zeros((n, n))
                g[i, j] = g[j, i] = size * std * v
                matrices.append(g)
            out.append(matrices)
        return tuple(out)


def _principal(rows: Complexes, least: float) -> Floats:
    """Return the principal directions (k, n) of n changes (n, m); all others together stay below a level."""
    both = np.hstack([rows.real, rows.imag])
    size, vectors = np.linalg.eigh(both @ both.T / rows.shape[1])
    return vectors[:, np.cumsum(np.maximum(size, 0.0)) > least**2].T


def _noise(problem: FitProblem, lines: NDArray[np.int64]) -> float:
    return float(np.sqrt(noise_squares(problem.data, lines).mean()))


def _joints_of(problem: FitProblem, result: FitResult) -> list[tuple[NDArray[np.int64], Floats]]:
    """Return the DOFs (m,) and a factor L (m, k) of the stiffness of each elastic connection at a fit."""
    model = problem.reduced.model
    own = {e.name for e in model.effects}
    model = model.with_values({ref: v for ref, v in result.values.items() if ref[0] in own})
    total: dict[bytes, tuple[NDArray[np.int64], Floats]] = {}
    for effect in (*model.effects, *result.effects):
        if not effect.connection:
            continue
        for c in effect.contribute(model):
            for dofs, K in zip(c.dofs, c.static if c.static is not None else (), strict=False):
                key = dofs.tobytes()
                total[key] = (dofs, K + total[key][1] if key in total else np.array(K, dtype=float))
    out = []
    for dofs, K in total.values():
        size, vectors = np.linalg.eigh(K)
        there = size > 1e-12 * size.max()
        if there.any():
            out.append((dofs, vectors[:, there] * np.sqrt(size[there])))
    return out


def _joint_slopes(changes: LocalChanges, joints: Sequence[tuple[NDArray[np.int64], Floats]]) -> Complexes:
    """Return the changes of the receptances by the elements of g of each connection, as many as there are."""
    fields, out = changes.fields(), []
    for dofs, L in joints:
        for a in range(L.shape[1]):
            for b in range(a, L.shape[1]):
                K = np.outer(L[:, a], L[:, b])
                K = K if a == b else (K + K.T) / 2**0.5
                out.append(fields.slope([Contribution(dofs[None], K=K[None])], connection=True))
    return np.stack(out)
