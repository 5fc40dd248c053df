"""FRFs of a model at the sensors and excitations of a test."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from fem.analysis.frf import FRF, FRFKind
from fem.analysis.frf_solver import compute_frf
from fem.array_types import Complexes, Ints
from fem.model import Model
from fem.system import assemble
from updating.measurement.measurement import (
    STRAIN,
    Sensor,
    outputs_of,
    roving_masses,
    sensor_rows,
    with_mass_of,
    with_moving_base,
)


def computed_frf(
    model: Model,
    sensors: Sequence[Sensor],
    excitations: Sequence[Sensor],
    frequency: ArrayLike,
    kind: FRFKind | str,
) -> FRF:
    """Return the FRFs of a model as the excitations say: its base may move, or responses refer to a sensor.

    Of a strain gauge they are strains, whatever the kind. The mass of a roving sensor is on the structure for
    its own responses alone.

    Parameters
    ----------
    model : Model
    sensors, excitations : sequence of Sensor
    frequency : array_like (n_freq,)
        [Hz].
    kind : FRFKind or str
        Of the sensors that read a motion.

    Raises
    ------
    MeasurementError
        As :func:`updating.measurement.measurement.sensor_rows` and
        :func:`updating.measurement.measurement.with_moving_base`.
    """
    model = with_moving_base(model, excitations)
    every, references = outputs_of(sensors, excitations)
    outputs, inputs = (sensor_rows(model, part) for part in (every, excitations))
    f = np.asarray(frequency, dtype=float)

    def receptances(model: Model, rows: Ints) -> Complexes:
        system = assemble(model, reciprocal=False)
        at = np.append(rows, np.arange(len(sensors), len(every)))
        H = np.array(compute_frf(system, f, outputs[at], inputs, FRFKind.RECEPTANCE).H)
        return H if references is None else references.behind(len(rows)).read(H, 2 * np.pi * f)

    H = receptances(model, np.arange(len(sensors)))
    for rows, sensor, mass in roving_masses(sensors):
        H[:, rows] = receptances(with_mass_of(model, sensor, mass), rows)
    names, forces = (tuple(s.name for s in part) for part in (sensors, excitations))
    base = [e.name for e in excitations if e.per_acceleration]
    strain = [s.name for s in sensors if s.quantity == STRAIN]
    return FRF.from_arrays(frequency, H, FRFKind.RECEPTANCE, names, forces, base, strain).as_kind(kind)
