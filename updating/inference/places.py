"""Places of responses and forces as combinations of DOFs."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from fem.analysis.selection import Selection, dof_vectors
from fem.model import Model, ModelError
from updating.inference.fit_data import sensor_vectors
from updating.measurement.measurement import Sensor

Places = Selection | Sequence[Sensor] | Mapping[str, tuple[int, str]]
"""Where responses are measured: DOF numbers, (point, direction) pairs, rows (n, n_dof), sensors, or (point,
direction) by label."""


def place_vectors(
    model: Model, places: Places, names: Sequence[str] | None = None
) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    """Return places as columns (n_dof, n) and their labels; ``names`` picks labelled ones, in their order.

    Raises
    ------
    ModelError
        For a label without a place.
    """
    if isinstance(places, Mapping):
        names = tuple(places) if names is None else tuple(names)
        missing = [name for name in names if name not in places]
        if missing:
            msg = f"there is no place for {', '.join(missing[:6])}; places are given for {', '.join(places)}"
            raise ModelError(msg)
        return dof_vectors(model, [places[name] for name in names])[0], names
    sensors = [p for p in places if isinstance(p, Sensor)]
    if sensors:
        if len(sensors) != len(places):
            msg = f"{len(places) - len(sensors)} of {len(places)} places are no sensors; give one kind only"
            raise ModelError(msg)
        by_name = {s.name: s for s in sensors}
        if names is not None and set(names) <= set(by_name):
            sensors = [by_name[name] for name in names]
        return sensor_vectors(model, sensors), tuple(s.name for s in sensors)
    return dof_vectors(model, places)  # type: ignore[arg-type]
