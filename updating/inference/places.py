"""Places of responses and forces as channels of a measurement."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from fem.analysis.selection import Selection, dof_vectors
from fem.model import Model, ModelError
from updating.measurement.measurement import Combination, Sensor

Places = Selection | Sequence[Sensor] | Mapping[str, tuple[int, str]]
"""Where responses are measured: DOF numbers, (point, direction) pairs, rows (n, n_dof), sensors, or (point,
direction) by label."""


def channels(model: Model, places: Places, names: Sequence[str] | None = None) -> tuple[Sensor, ...]:
    """Return places as sensors; ``names`` picks labelled ones, in their order.

    Raises
    ------
    ModelError
        For a label without a place, and for coordinates inside of effects, which a finer mesh has not.
    """
    labels: Sequence[str] | None = None
    given: Any = places
    if isinstance(places, Mapping):
        labels = tuple(places) if names is None else tuple(names)
        missing = [name for name in labels if name not in places]
        if missing:
            msg = f"there is no place for {', '.join(missing[:6])}; places are given for {', '.join(places)}"
            raise ModelError(msg)
        given = [places[name] for name in labels]
    sensors = [p for p in given if isinstance(p, Sensor)]
    if sensors:
        if len(sensors) != len(given):
            msg = f"{len(given) - len(sensors)} of {len(given)} places are no sensors; give one kind only"
            raise ModelError(msg)
        by_name = {s.name: s for s in sensors}
        return tuple(by_name[n] for n in names) if names and set(names) <= set(by_name) else tuple(sensors)
    columns, dof_names = dof_vectors(model, given)
    n = 6 * model.mesh.n_points
    if columns[n:].any():
        msg = f"a place is a coordinate inside of an effect; DOFs of points are 0 to {n - 1}"
        raise ModelError(msg)
    nowhere = np.zeros(3)
    return tuple(
        Combination(name, nowhere, nowhere, factors=row)
        for name, row in zip(_distinct(labels or dof_names), columns[:n].T, strict=True)
    )


def _distinct(names: Sequence[str]) -> list[str]:
    """Return names of which none is there twice."""
    return [n if n not in names[:k] else f"{n} ({k + 1})" for k, n in enumerate(names)]
