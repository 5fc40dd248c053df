"""Effects that hold a frame, for a model whose moduli are others than that frame's."""

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from fem.model import Effect, Model, parameter_values

STEP = 1e-30
"""Step of derivatives, imaginary."""
ITERATIONS = 6
"""Steps of Gauss and Newton: each takes about the square of the relative change of the moduli off."""
Kind = TypeVar("Kind", bound=Effect)


def as_before(effect: Effect, new: Kind, model: Model) -> Kind:
    """Return an effect with the values at which it adds most nearly the matrices of another one.

    Parameters
    ----------
    effect : Effect
    new : Effect
        Of the same kind and place, that contributes to the same DOFs.
    model : Model
    """
    wanted, names = _added(effect, model), [p.name for p in new.parameters()]
    values = parameter_values(effect)
    for _ in range(ITERATIONS):
        now = new.with_values(**values)
        slopes = [
            np.imag(_added(new.with_values(**values | {n: values[n] + 1j * STEP}), model)) / STEP
            for n in names
        ]
        A, r = np.stack(slopes, axis=1), wanted - _added(now, model)
        size = np.linalg.norm(A, axis=0)
        size[size == 0] = 1.0
        steps = np.linalg.lstsq(A / size, r)[0] / size
        for p, step in zip(now.parameters(), steps, strict=True):
            values[p.name] = float(np.clip(values[p.name] + step, p.lower, p.upper))
    return new.with_values(**values)


def _added(effect: Effect, model: Model) -> NDArray[np.complex128] | NDArray[np.float64]:
    """Return the entries of K and M that an effect adds."""
    parts = effect.contribute(model)
    return np.concatenate([X.ravel() for c in parts for X in (c.K, c.M) if X is not None])
