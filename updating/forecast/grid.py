"""Candidates on grids of their parameter values."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from fem.array_types import Floats
from fem.model import Effect, Parameter, ParameterRef
from fem.reduction.reduced_model import ReducedModel

WEAKER = 0.1
"""A little of a candidate is this share of the weakest of its points [-]."""


@dataclass(eq=False)
class Grid:
    """A candidate on a grid of its parameter values, projected when it is needed.

    Attributes
    ----------
    effect : Effect
    points : tuple of dict
        Parameter values.
    """

    effect: Effect
    points: tuple[dict[str, float], ...]
    # The terms of all points, on the last reduced model that they were asked for.
    _terms: tuple = field(default=(), init=False, repr=False)
    _reduced: ReducedModel | None = field(default=None, init=False, repr=False)
    # By the values of a point: its sizes and directions ask for them several times.
    _parameters: dict[tuple[tuple[str, float], ...], tuple[Parameter, ...]] = field(
        default_factory=dict, init=False, repr=False
    )

    @classmethod
    def of(cls, problem: Any, effect: Effect) -> "Grid":
        """Return the grid that the effect asks for."""
        return cls(effect, tuple(effect.starts(problem.surroundings)))

    def slight_points(self, absent: float | None = None) -> tuple[tuple[dict[str, float], float], ...]:
        """Return points of near absence, one for each direction from there to points of the grid.

        They show what a little of it does. With each stands by how much it can be multiplied before it is
        beyond the strongest point. ``absent`` is the first parameter's value there, if not its own.
        """
        first = self.effect.parameters()[0].name
        alike: dict[tuple, list[dict[str, float]]] = {}
        for point in self.points:
            alike.setdefault(self.direction(point, absent), []).append(point)
        slight = []
        for points in alike.values():
            p = self.first_parameter(points[0], absent)
            strength = np.abs([distance(p, point[first]) for point in points])
            strength[strength <= 1e-9 * strength.max()] = np.inf  # the model's own value is no weak effect
            weakest, most = int(np.argmin(strength)), float(strength[np.isfinite(strength)].max(initial=0.0))
            slight.append((self.scaled(points[weakest], WEAKER, absent), most / strength[weakest] / WEAKER))
        return tuple(slight)

    def direction(self, point: dict[str, float], absent: float | None = None) -> tuple[float, ...]:
        """Return what points have in common that differ by their size alone."""
        first, *others = self.amplitudes(point, absent)
        size = distance(first, point[first.name])
        ratios = {p.name: distance(p, point[p.name]) / size if size else np.inf for p in others}
        return tuple(float(f"{ratios.get(n, v):.9g}") for n, v in point.items() if n != first.name)

    def thinned(self, n: int) -> "Grid":
        """Return the candidate on about n of its points, of all sizes and places."""
        some = np.unique(np.linspace(0, len(self.points) - 1, n).round().astype(int))
        return Grid(self.effect, tuple(self.points[i] for i in some))

    def terms(self, problem: Any) -> tuple:
        """Return what the effect adds to the reduced matrices at each point (computed once)."""
        if self._reduced is not problem.reduced:
            self._reduced = problem.reduced
            effects = (self.effect.with_values(**p) for p in self.points)
            self._terms = tuple(map(problem.reduced.value_of, effects))
        return self._terms

    def first_parameter(self, point: dict[str, float], absent: float | None = None) -> Parameter:
        """Return the first parameter at a point, with the value at which the effect is absent."""
        p = self.parameters(point)[0]
        return p if absent is None else replace(p, absent=absent)

    def parameters(self, point: dict[str, float]) -> tuple[Parameter, ...]:
        """Return the parameters at a point."""
        known = tuple(point.items())
        if known not in self._parameters:
            self._parameters[known] = self.effect.with_values(**point).parameters()
        return self._parameters[known]

    def amplitudes(self, point: dict[str, float], absent: float | None = None) -> tuple[Parameter, ...]:
        """Return the parameters at a point that together are the size of the effect.

        The first, and those that change the model even where the first is absent, such as the loss factor of
        a joint's stiffness. A position or a width says nothing without the first.
        """
        first = self.first_parameter(point, absent)
        if not self._others:
            return (first,)
        return first, *(p for p in self.parameters(point) if p.name in self._others)

    @cached_property
    def _others(self) -> frozenset[str]:
        """Names of the parameters besides the first that have a value at which they change nothing."""
        first, *rest = self.effect.parameters()
        # A rigid connection leaves nothing on which its loss factor could act.
        if np.isinf(first.absent) or all(p.position for p in rest):
            return frozenset()
        each = (p for point in self.points for p in self.parameters(point)[1:])
        return frozenset(p.name for p in each if p.value != p.absent)

    def scaled(self, point: dict[str, float], factor: float, absent: float | None = None) -> dict[str, float]:
        """Return a point at a multiple of its distance from where the effect changes nothing.

        Of a stiffness that is infinite where it is absent, the flexibility is scaled. The result lies within
        the parameters' bounds.
        """
        for p in self.amplitudes(point, absent):
            point = _scaled(p, point, factor)
        return point

    def one_sided(self) -> bool:
        """Whether the effect can lie on one side only of where it changes nothing."""
        p = self.effect.parameters()[0]
        if np.isinf(p.absent) or p.lower >= p.absent or p.upper <= p.absent:
            return True
        others = (p for point in self.points[:1] for p in self.amplitudes(point)[1:])
        return any(not p.lower <= 2 * p.absent - p.value <= p.upper for p in others)


@dataclass(frozen=True, slots=True, eq=False)
class Little:
    """A little of a candidate at each of its places.

    Attributes
    ----------
    grid : Grid
    points : tuple of dict
        Parameter values.
    absent : float or None
        The first parameter's value where the candidate is absent, if not its own.
    most : ndarray (n_points,)
        Multiples up to which it stays on its grid.
    """

    grid: Grid
    points: tuple[dict[str, float], ...]
    absent: float | None
    most: Floats

    @classmethod
    def of(cls, grid: Grid, values: Mapping[ParameterRef, float], n_places: int = 0) -> "Little":
        """Return a little of a candidate beside parameters of a model.

        An effect that replaces an uncertain parameter does nothing at that parameter's value. Of more than
        ``n_places`` places, unless that is 0, evenly spaced ones count.
        """
        absent = next((float(values[ref]) for ref in grid.effect.replaces() if ref in values), None)
        slight = grid.slight_points(absent)
        step = max(1, -(-len(slight) // n_places)) if n_places else 1
        slight = slight[(step - 1) // 2 :: step]
        return cls(grid, tuple(point for point, _ in slight), absent, np.array([most for _, most in slight]))

    def values(self, k: int, factor: float) -> dict[str, float]:
        """Return the parameter values at a multiple of the k-th place's little."""
        return self.grid.scaled(self.points[k], factor, self.absent)

    def reaches(self, k: int, factor: float) -> bool:
        """Whether that multiple is within the bounds of the parameters."""
        point, there = self.points[k], self.values(k, factor)
        each = self.grid.amplitudes(point, self.absent)
        return all(
            abs(distance(p, there[p.name])) >= (1 - 1e-6) * abs(factor * distance(p, point[p.name]))
            for p in each
        )

    def side(self, k: int, factor: float) -> float:
        """Return a multiple, or its negative where only that lies within the bounds; NaN for neither."""
        both = (factor,) if self.grid.one_sided() else (factor, -factor)
        return next((f for f in both if np.isfinite(f) and self.reaches(k, f)), np.nan)


def _scaled(p: Parameter, point: dict[str, float], factor: float) -> dict[str, float]:
    """Return what :meth:`Grid.scaled` does, with one parameter."""
    if np.isinf(p.absent):
        value = point[p.name] / max(factor, 1e-12)
    elif p.log and p.absent > 0:
        # far beyond any bound it would overflow
        value = p.absent * np.exp(np.clip(factor * np.log(point[p.name] / p.absent), -300.0, 300.0))
    else:
        value = p.absent + factor * (point[p.name] - p.absent)
    return {**point, p.name: float(min(max(value, p.lower), p.upper))}


def distance(p: Parameter, value: float) -> float:
    """Return how far a value of a parameter is from where the effect is absent, with its sign."""
    if np.isinf(p.absent):
        return 1 / value
    return float(np.log(value / p.absent)) if p.log and p.absent > 0 else value - p.absent
