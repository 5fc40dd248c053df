"""Which places can explain the misfit of a fitted model, whatever is there.

With forces free at a place, H_measured - H_fitted = A(ω) T(ω) B(ω)ᵀ with A the responses of the sensors to
motions or forces there: the direct solution of joint identification, line by line, used as a localiser.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from fem.array_types import Complexes, Floats
from fem.model import parameter_values
from fem.reduction.local_changes import LocalChanges
from updating.diagnosis.evidence.places import Place, Reach
from updating.inference.fit import FitProblem
from updating.inference.fit_result import FitResult

SCAN_LINES = 24
"""Lines at which places are looked at."""
N_PAIRED = 8
"""Number of the best connections of which pairs are made."""
LEVEL = 0.05
"""Misfit in parts of the receptances up to which nothing is gained [-]."""


@dataclass(frozen=True, slots=True, eq=False)
class Scanned:
    """A place, or several together.

    Attributes
    ----------
    places : tuple of Place
    residual_ratio : float
        Mean square of the misfit with the place, over that without the place, each by its degrees of
        freedom [-].
    """

    places: tuple[Place, ...]
    residual_ratio: float

    @property
    def name(self) -> str:
        """Names of the places."""
        return " and ".join(p.name for p in self.places)


def scanned(places: Sequence[Place], ratio: Callable[[Sequence[Place]], float]) -> tuple[Scanned, ...]:
    """Return places and the pairs of the best connections that explain more than each of the two, best first.

    Parameters
    ----------
    places : sequence of Place
    ratio : callable
        Gives the residual ratio of one place or of two together; infinite for what is left out.
    """
    singles = sorted((Scanned((p,), ratio((p,))) for p in places), key=lambda s: s.residual_ratio)
    singles = [s for s in singles if np.isfinite(s.residual_ratio)]
    connections = [
        s for s in singles if s.places[0].kind in ("joint", "support", "end") and "," not in s.name
    ]
    pairs = []
    for one, two in combinations(connections[:N_PAIRED], 2):
        together = *one.places, *two.places
        both = Scanned(together, ratio(together))
        # A pair counts where it leaves less than this part of what the better of the two leaves [-]
        if both.residual_ratio < 0.9 * one.residual_ratio:
            pairs.append(both)
    return tuple(sorted([*singles, *pairs], key=lambda s: s.residual_ratio))


@dataclass(frozen=True, slots=True, eq=False)
class Scan:
    """The misfit of a fitted model at some lines, ready for places.

    ``X`` (n_freq, n_in, n_out, 1 + n) holds the weighted misfit and, behind it, what uncertain parameters
    do to it, in units of their prior deviations; ``weight`` (n_freq, n_in, n_out). Of amplitudes only the
    part along the computed receptances is known: ``turn`` (n_freq, n_in, n_out) turns these to the real axis.
    """

    problem: FitProblem
    X: Complexes
    total: Floats
    weight: Floats
    reach: Reach
    turn: Complexes | None = None

    @classmethod
    def of(cls, problem: FitProblem, current: FitResult, n_lines: int = SCAN_LINES) -> "Scan":
        """Prepare the misfit of a fit."""
        problem = problem.unloaded(current)
        lines, data = problem.lines_up_to(np.inf, n_lines), problem.data
        starts = [parameter_values(e) for e in current.effects]
        function = problem.function(current.effects, starts, lines)
        f, refs, measured = data.frequency[lines], list(current.values), data.H[lines]
        values, zeta = np.array([current.values[r] for r in refs]), problem.damping.ratio(f, current.zeta)
        changes = LocalChanges.of(
            problem.engine(f, refs, current.effects, channels=current.channels), values, zeta
        )
        H, keep = changes.H, function.keep
        along = H / np.where(H != 0, np.abs(H), 1.0)
        measured = measured if data.phase else measured * along
        _, J = function(function.point_of(current), True)
        assert J is not None
        slopes = np.zeros((len(J), *keep.shape), dtype=complex)
        slopes[:, keep] = J * (H / np.where(keep, data.weight[lines], 1.0))[keep]
        std = function.prior().std
        weight = np.where(keep, 2 / np.maximum(np.abs(measured) + np.abs(H), 1e-300), 0.0)
        every = np.concatenate([(measured - H)[None], slopes * std[:, None, None, None]]) * weight
        every = every if data.phase else (every * along.conj()).real
        X: Complexes = np.ascontiguousarray(every.transpose(1, 3, 2, 0)).astype(complex)
        return cls(
            problem,
            X,
            _products(X),
            np.ascontiguousarray(weight.transpose(0, 2, 1)),
            Reach(problem.reduced.model, changes),
            None if data.phase else np.ascontiguousarray(along.conj().transpose(0, 2, 1)),
        )

    def run(self, places: Sequence[Place]) -> tuple[Scanned, ...]:
        """Return all places and the pairs of the best connections, the best first."""
        shapes = dict(zip((p.name for p in places), map(self._seen, self.reach.of(places)), strict=True))
        none = self._mean_square(None)

        def ratio(together: Sequence[Place]) -> float:
            A = np.concatenate([shapes[p.name] for p in together], axis=3)
            most = A.shape[2] - 1 if len(together) == 1 else A.shape[2] // 2
            return self._mean_square(A) / none if A.size and A.shape[3] <= most else np.inf

        return scanned(places, ratio)

    def _seen(self, A: Complexes) -> Complexes:
        """Return what forces do to what was measured: of amplitudes two columns for each complex force."""
        if self.turn is None or not A.size:
            return A
        A = A * self.turn[..., None]
        return np.concatenate([A.real, -A.imag], axis=3).astype(complex)

    def _mean_square(self, A: Complexes | None) -> float:
        """Return the mean square of the residual with free forces along A, by its degrees of freedom."""
        X, total = self.X, self.total
        n = float((self.weight > 0).sum())
        if A is not None:
            A = A * self.weight[..., None]
            size = np.sqrt((np.abs(A) ** 2).sum(axis=2, keepdims=True))
            Q, _ = np.linalg.qr(A / np.maximum(size, 1e-300))
            P = np.swapaxes(Q.conj(), 2, 3) @ X
            total = total - _products(P)
            n = max(n - A.shape[3] * A.shape[0] * A.shape[1], 0.25 * n)
        b, N = total[0, 1:], total[1:, 1:]
        residual = total[0, 0]
        for _ in range(3):  # the residual level sets the weight of the priors
            level = max(residual / n, LEVEL**2)
            p = np.linalg.solve(N / level + np.eye(len(N)), b / level)
            residual = float(total[0, 0] - 2 * p @ b + p @ N @ p)
        return max(residual, 1e-12) / max(n, 1.0)


def _products(X: Complexes) -> Floats:
    """Return the real parts of the inner products of the columns of X (…, n), (n, n)."""
    flat = X.reshape(-1, X.shape[-1])
    both = np.concatenate([flat.real, flat.imag])
    out: Floats = both.T @ both
    return out
