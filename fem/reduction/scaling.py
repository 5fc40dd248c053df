"""Effects whose matrices are proportional to parameters of other effects.

The stiffness of a change of a member is in proportion to E of the frame. Such matrices are projected once and
multiplied afterwards.
"""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.model import Effect, Model, Parameter, ParameterRef


def scale_factors(changes: Iterable[tuple[float, Mapping[str, int]]]) -> dict[str, float]:
    """Return the factors of K, M, C and D of an effect when parameters of others change by factors.

    Each factor comes with the exponents of the matrices (:meth:`ReducedModel.scaling_of`).
    """
    out = dict.fromkeys("KMCD", 1.0)
    for factor, exponents in changes:
        for key, n in exponents.items():
            out[key] *= factor if n else 1.0
    return out


def scaling_exponents(effect: Effect, model: Model, ref: ParameterRef) -> Mapping[str, int] | None:
    """Return which of an effect's matrices are in proportion to a parameter of another effect.

    They are compared at one other value of it. None if one is neither in proportion nor independent.
    """
    value = model.values().get(ref, 0.0)
    if not value:
        return None
    ordinary = effect.with_values(**{p.name: _ordinary(p) for p in effect.parameters()})
    times = 1.7
    now, then = (tuple(ordinary.contribute(model.with_values({ref: f * value}))) for f in (1.0, times))
    if len(now) != len(then) or any(c.law is not None for c in (*now, *then)):
        return None
    out: dict[str, int] = {}
    for key in "KMCD":
        pairs: list[tuple[Any, Any]] = [
            (getattr(a, key), getattr(b, key)) for a, b in zip(now, then, strict=True)
        ]
        pairs = [(a, b) for a, b in pairs if a is not None or b is not None]
        if any(a is None or b is None or a.shape != b.shape for a, b in pairs):
            return None
        alike = [n for n in (0, 1) if all(_alike(times**n * a, b) for a, b in pairs)]
        if not alike:
            return None
        out[key] = alike[0]
    return out


def _alike(a: NDArray[Any], b: NDArray[Any]) -> bool:
    # some are small differences of large matrices: of their digits few are left, but one is enough here
    return bool(np.abs(a - b).max(initial=0.0) <= 1e-6 * np.abs(b).max(initial=0.0))


def _ordinary(p: Parameter) -> float:
    """Return a value of a parameter at which its effect is there."""
    if p.value != p.absent and np.isfinite(p.value) and p.value:
        return float(p.value)
    low, high = (float(x) if np.isfinite(x) else None for x in (p.lower, p.upper))
    if low is None or high is None:
        return (low if low is not None else float(p.value)) + 1.0
    return low + 0.37 * (high - low)
