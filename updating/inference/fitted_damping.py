"""The damping of a fitted model, for the model and for study files."""

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from fem.array_types import Floats
from fem.connection_damping import ConnectionDamping
from fem.model import Damping, Model
from updating.inference.fit_result import FitResult
from updating.inference.problem import Problem

Connections = tuple[Floats, Floats] | None
"""Frequencies [Hz] and ratios of connections that are damped otherwise than the structure."""
DENSE = 64
"""Frequencies between two of a nominal curve that is no power of frequency, at which it is written [-]."""


def fitted_damping(problem: Problem[Any], result: FitResult, model: Model) -> tuple[Damping, Connections]:
    """Return the fitted damping, and frequencies and ratios of connections where there are any.

    Both are powers of frequency between the frequencies where they are given.
    """
    curve, zeta = problem.damping, result.zeta
    f = problem.data.frequency
    nominal = model.damping
    breaks = [curve.knots, f[[0, -1]]]
    if np.ptp(nominal.ratio):
        given = nominal.frequency[nominal.frequency > 0]
        breaks.append(given)
        if not nominal.powers and given.size > 1:
            breaks += [np.geomspace(a, b, DENSE) for a, b in pairwise(given)]
    breaks += [np.asarray(e.frequency) for e in model.of_kind(ConnectionDamping)]
    at: Any = np.unique(np.concatenate(breaks))
    at = at[(at >= f[0]) & (at <= f[-1])]
    members, *others = np.atleast_2d(curve.ratio(at, zeta))
    connected = others and any(e.connection for e in model.effects)
    return Damping.modal(members, at, powers=True), (at, others[0]) if connected else None


def with_fitted_damping(problem: Problem[Any], result: FitResult, model: Model) -> Model:
    """Return a fitted model with its damping, and that of connections where they have their own."""
    ratios, connections = fitted_damping(problem, result, model)
    damping = replace(model.damping, frequency=ratios.frequency, ratio=ratios.ratio, powers=ratios.powers)
    model = model.with_damping(damping)
    if connections is None:
        return model
    known = [e.name for e in model.of_kind(ConnectionDamping)]
    effect = ConnectionDamping(frequency=connections[0], ratio=connections[1])
    return model.without_effect(*known).with_effect(effect)
