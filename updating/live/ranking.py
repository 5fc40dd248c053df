"""Candidates ranked by how much of the misfit each could explain alone, without a fit."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fem.model import Effect, ParameterRef, parameter_values
from fem.reduction.local_changes import LocalChanges
from updating.correlation import DB_PER_NEPER, log_ratio
from updating.diagnosis.changes import similarity_of
from updating.inference.fit import FitProblem
from updating.live.engine import LiveModel
from updating.live.fitting import Progress
from updating.live.hypothesis import Hypothesis

N_LINES = 48
"""Lines at which candidates are tried."""
BATCH = 32
"""Candidates between two reports of the progress."""
ALIKE = 0.9
"""Correlation of the changes of FRFs from which two effects count as twins [-]."""
COMPARED = 100
"""Candidates, the best first, whose changes of the FRFs are kept to be compared [-]."""


@dataclass(frozen=True, slots=True, eq=False)
class Promise:
    """A candidate at the best of its starts.

    Attributes
    ----------
    effect : Effect
        With the values of that start.
    level_db : float
        Robust residual level with it [dB].
    change : ndarray or None
        Logarithm of the FRFs over those without it, where they count; of the first ``COMPARED`` candidates.
    """

    effect: Effect
    level_db: float
    change: NDArray[np.complex128] | None = None


def rank(
    live: LiveModel, h: Hypothesis, candidates: Sequence[Effect], progress: Progress
) -> tuple[Promise, ...]:
    """Return candidates by the residual level that each leaves when added to a hypothesis, the best first.

    Each is tried at the values of its grid of starts by low-rank updates; nothing else is fitted with it.

    Parameters
    ----------
    live : LiveModel
    h : Hypothesis
    candidates : sequence of Effect
    progress : callable
        Called with a text and the fraction done; an exception from it ends the ranking.
    """
    trial = _Trial(live.problem_of(h), h)
    added = {e.name for e in h.effects}
    open_ones = [e for e in candidates if e.name not in added]
    found: list[Promise] = []
    for first in range(0, len(open_ones), BATCH):
        progress("ranking candidates", first / len(open_ones))
        found += filter(None, map(trial.best, open_ones[first : first + BATCH]))
        found.sort(key=lambda p: p.level_db)
        found[COMPARED:] = [Promise(p.effect, p.level_db) for p in found[COMPARED:]]
    return tuple(found)


def twins(promises: Sequence[Promise], name: str) -> tuple[tuple[Promise, float], ...]:
    """Return candidates that change the FRFs as another one does, with the correlation, the most alike first.

    Parameters
    ----------
    promises : sequence of Promise
    name : str
        Of the candidate to compare with; nothing is alike to one that was not ranked.
    """
    change = next((p.change for p in promises if p.effect.name == name), None)
    if change is None:
        return ()
    others = [(p, similarity_of(change, p.change)) for p in promises if p.change is not None]
    alike = [x for x in others if x[1] >= ALIKE and x[0].effect.name != name]
    return tuple(sorted(alike, key=lambda x: -x[1]))


class _Trial:
    """A hypothesis to which candidates are added one at a time."""

    def __init__(self, problem: FitProblem, h: Hypothesis) -> None:
        problem = problem.unloaded(h.result())
        self.problem, self.h = problem, h
        self.lines = problem.lines_up_to(np.inf, N_LINES)
        self.frequency = problem.data.frequency[self.lines]
        self.zeta = problem.damping.ratio(self.frequency, h.zeta)
        self._bases: dict[frozenset[ParameterRef], LocalChanges] = {}

    def best(self, effect: Effect) -> Promise | None:
        """Return a candidate at the best of its starts; None if the model has no FRFs at any."""
        starts = effect.starts(self.problem.surroundings)
        grid = [e for e in (effect.with_values(**s) for s in starts) if _finite(e)]
        if not grid:
            return None
        replaced = frozenset(effect.replaces())
        base = self._base(replaced)
        tried = self._released(effect, grid) if effect.released() else base.receptances(grid)
        ratios = [log_ratio(H, self.problem.data.H[self.lines]) for H in tried]
        mask = self.problem.data.mask[self.lines]
        levels = [self.problem.level(np.where(mask, r, complex("nan")), self.lines) for r in ratios]
        if np.isnan(levels).all():
            return None
        k = int(np.nanargmin(levels))
        change = np.nan_to_num(np.where(mask, log_ratio(tried[k], self._base(frozenset()).H), 0.0)).ravel()
        return Promise(grid[k], float(levels[k] * DB_PER_NEPER), change)

    def _base(self, replaced: frozenset[ParameterRef]) -> LocalChanges:
        """Return the solved state in which parameters that a candidate replaces are nominal."""
        if replaced not in self._bases:
            now = self.h.result()
            values = {ref: v for ref, v in now.values.items() if ref not in replaced}
            engine = self.problem.engine(self.frequency, list(values), now.effects, channels=now.channels)
            self._bases[replaced] = LocalChanges.of(engine, np.array(list(values.values())), self.zeta)
        return self._bases[replaced]

    def _released(self, effect: Effect, grid: Sequence[Effect]) -> list[NDArray[np.complex128]]:
        """Return receptances with a candidate that gives way where the model holds."""
        h, names = self.h.with_effect(effect), [p.name for p in effect.parameters()]
        refs = list(h.result().values)
        engine = self.problem.engine(self.frequency, refs, h.effects, channels=h.channels)
        out = []
        for e in grid:
            values = {**h.result().values} | {(e.name, k): parameter_values(e)[k] for k in names}
            at = np.array([values[ref] for ref in refs])
            out.append(engine.evaluate(at, self.zeta, gradient=False)[0])
        return out


def _finite(effect: Effect) -> bool:
    return bool(np.isfinite(list(parameter_values(effect).values())).all())
