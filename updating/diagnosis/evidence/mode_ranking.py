"""Which places can explain the misfit of measured modes, by the slopes of all candidates there."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from updating.diagnosis.evidence.places import Place, acting
from updating.diagnosis.evidence.ranking import RankedBlocks, Ranking
from updating.diagnosis.evidence.scan import Scanned, scanned
from updating.forecast.look import Floats, Look
from updating.inference.belief import EFFECT_ODDS
from updating.inference.fit_result import FitResult


@dataclass(frozen=True, slots=True)
class ModeRanking(Ranking):
    """Ranking by measured modes: they tell candidates apart less, and fits to them cost little."""

    breadth: int = 12
    n_listed: int = 100
    n_looked: int = 24
    most_rivals: int = 24
    n_fine: int = 40
    precise_looks: bool = False

    def scan(self, problem: Any, current: FitResult, places: Sequence[Place]) -> tuple[Scanned, ...]:
        """Return places by the misfit that the slopes of all candidates there leave.

        Those are left out that gain less evidence than the prior asks for a further change.
        """
        look = Look.of(problem, current, None, 0, 0).with_all_readings()
        effects = [(n, acting(e)) for n, place in enumerate(places) for e in place.effects]
        has_slope = look.residuals.has_slope
        effects = [(n, e) for n, e in effects if not e.amplitude_dependent and has_slope(e)]
        y = look.whitened(look.adapted(look.now[None], (), look.off))[0]
        changes = look.residuals.slopes()([e for _, e in effects])
        there = np.isfinite(changes).all(axis=1)
        slopes = look.whitened(look.adapted(np.nan_to_num(changes)))
        rows_of: dict[str, list[int]] = {}
        for row in np.flatnonzero(there).tolist():
            rows_of.setdefault(places[effects[row][0]].name, []).append(row)
        least = 1 - EFFECT_ODDS / max(0.5 * float(y @ y), 1e-300)

        def ratio(together: Sequence[Place]) -> float:
            rows = [row for p in together for row in rows_of.get(p.name, ())]
            left = _residual_ratio(y, slopes[rows]) if rows else np.inf
            return left if left < least else np.inf

        return scanned(places, ratio)

    def blocks(self, problem: Any, current: FitResult, *, far: bool) -> RankedBlocks:
        """Return what ranks nothing: modes say too little of several springs at once."""
        return lambda groups: []


def _residual_ratio(y: Floats, slopes: Floats) -> float:
    """Return the mean square of the misfit y (r,) that changes along slopes (n, r) leave, by their evidence.

    Their sizes have a common normal prior whose deviation the data choose. It is 1 less the gain in evidence
    over the largest one that any change can have, half the squares of the misfit.
    """
    D = slopes / np.maximum(np.linalg.norm(slopes, axis=1, keepdims=True), 1e-300)
    lam, U = np.linalg.eigh(D @ D.T)
    there = lam > 1e-8 * lam[-1]
    lam, z = lam[there], (U[:, there].T @ (D @ y)) / np.sqrt(lam[there])
    best = 0.0
    for s2 in np.geomspace(1.0, max(4.0, float(y @ y)), 8):
        shrunk = s2 * lam / (1 + s2 * lam)
        best = max(best, 0.5 * float((shrunk * z**2).sum()) - 0.5 * float(np.log1p(s2 * lam).sum()))
    return 1 - best / max(0.5 * float(y @ y), 1e-300)
