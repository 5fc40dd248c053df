"""FRFs of a model at the sensors and excitations of a test."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from fem.analysis.frf import FRF, FRFKind
from fem.analysis.frf_solver import compute_frf
from fem.model import Model
from fem.system import assemble
from updating.measurement.measurement import (
    STRAIN,
    BaseMotion,
    Sensor,
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
    """Return the FRFs of a model; its base moves where an excitation is a motion of the base.

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
    outputs, inputs = (sensor_rows(model, part) for part in (sensors, excitations))
    system = assemble(model, reciprocal=False)
    f = np.asarray(frequency, dtype=float)
    H = np.array(compute_frf(system, f, outputs, inputs, FRFKind.RECEPTANCE).H)
    for rows, sensor, mass in roving_masses(sensors):
        loaded = assemble(with_mass_of(model, sensor, mass), reciprocal=False)
        H[:, rows] = compute_frf(loaded, f, outputs[rows], inputs, FRFKind.RECEPTANCE).H
    names, forces = (tuple(s.name for s in part) for part in (sensors, excitations))
    base = [s.name for s in excitations if isinstance(s, BaseMotion)]
    strain = [s.name for s in sensors if s.quantity == STRAIN]
    return FRF.from_arrays(frequency, H, FRFKind.RECEPTANCE, names, forces, base, strain).as_kind(kind)
