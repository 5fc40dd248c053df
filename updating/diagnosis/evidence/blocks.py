"""Several springs of a connection together, by what a little of each does."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import scipy

from fem.model import Effect
from updating.diagnosis.evidence.hypothesis import Start
from updating.forecast.grid import Grid
from updating.forecast.look import Look, SmallChange
from updating.inference.problem import Problem

LEAST_MULTIPLE = 1.0
"""An effect that the data do not ask for begins at its slight point [-]."""


@dataclass(frozen=True, slots=True, eq=False)
class Block:
    """Effects that are tried together, and a start.

    Attributes
    ----------
    cost : float
        Negative log likelihood that the best multiples of their small changes leave.
    gain : float
        By how much less that is than without them.
    effects : tuple of Effect
    start : Start
        Their values there, and the fit that they are looked at from.
    """

    cost: float
    gain: float
    effects: tuple[Effect, ...]
    start: Start


@dataclass(slots=True, eq=False)
class Blocks:
    """Blocks added to one fit. The slope of each effect is computed once.

    Attributes
    ----------
    problem : Problem
    look : Look
        From where the fit is.
    """

    problem: Problem[Any]
    look: Look[Any, Any]
    _little: dict[str, SmallChange] = field(default_factory=dict, init=False)

    def of(self, group: Sequence[Effect]) -> Block:
        """Return some effects at the multiples of small changes that together explain the residuals best.

        Minimises Σ w |r + Σ_k f_k d_k|² within the bounds of each effect, with d_k what a little of it does
        and uncertain parameters adapted.
        """
        for e in group:
            if e.name not in self._little:
                self._little[e.name] = self.look.little(Grid.of(self.problem, e))
        return _block(self.look, [self._little[e.name] for e in group])


def _block(look: Look[Any, Any], parts: Sequence[SmallChange]) -> Block:
    """Return the block of some effects."""
    replaced = tuple(dict.fromkeys(ref for p in parts for ref in p.grid.effect.replaces()))
    change = np.stack([p.change[0] for p in parts])
    every = np.vstack([look.adapted(look.now[None], replaced, look.off), look.adapted(change, replaced)])
    weight = np.sqrt(look.weights)
    now, *columns = (np.concatenate([x.real, x.imag]) for x in weight * every)
    most = np.array([max(p.most[0], 1.0) for p in parts])
    least = np.where([p.grid.one_sided() for p in parts], 0.0, -most)
    A = np.stack(columns, axis=1)
    size = np.linalg.norm(A, axis=0)
    size[size == 0] = 1.0
    factors = scipy.optimize.lsq_linear(A / size, -now, (least * size, most * size)).x / size
    cost = float(look.costs((every[0] + factors @ every[1:])[None])[0])
    factors = np.where(np.abs(factors) < LEAST_MULTIPLE, LEAST_MULTIPLE, factors)
    values = tuple(p.values(0, float(f)) for p, f in zip(parts, factors, strict=True))
    return Block(cost, look.cost_now - cost, tuple(p.grid.effect for p in parts), Start(values, look.base))
