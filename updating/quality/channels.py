"""Sensors and forces that a model says nothing to: at rest, across all motion, or doubled."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from fem.array_types import Complexes, Floats
from fem.checks import Defect
from fem.lengths import coordinates_text
from fem.linalg.solvers import factorise
from fem.model import Model
from fem.system import System, assemble
from updating.measurement.measurement import Measurement, Sensor, sensor_point, sensor_rows

SAME = 1e-9
"""Motion in parts of the largest, and deviation of a cosine from 1, up to which they are rounding [-]."""
AGREE = 0.1
"""Difference of the FRFs of two sensors in parts of them up to which their places are the same [-]."""


def check_channels(
    model: Model,
    sensors: Sequence[Sensor],
    excitations: Sequence[Sensor],
    frequency: Floats,
    measurements: Sequence[Measurement] = (),
) -> tuple[Defect, ...]:
    """Find sensors and forces that a test gains nothing from, or that are not where they are said to be.

    A sensor that reads, or a force that drives, only what supports hold; a sensor that none of the forces
    moves; two that read or drive the same motion; two with the same data, which was stored twice.

    Parameters
    ----------
    model : Model
        With points where sensors and excitations are.
    sensors, excitations : sequence of Sensor
    frequency : ndarray (n,)
        Lines of the test [Hz].
    measurements : sequence of Measurement
        Two sensors of one place are no mistake if their data agree.

    Raises
    ------
    MeasurementError
        As :func:`updating.measurement.measurement.sensor_rows`.
    """
    system = assemble(model, reciprocal=False)
    read, read_rows, found = _moving(system, sensors, "sensor", "reads")
    driven, driven_rows, more = _moving(system, excitations, "excitation", "drives")
    found = [*found, *_doubled(model, read, read_rows, "sensors", measurements), *more]
    found += _doubled(model, driven, driven_rows, "excitations", ())
    if read and driven and not any(e.moves_base for e in excitations):
        # Any line tells what never moves; a model may rest at one place on one line, but not to rounding
        f = float(np.median(frequency)) if len(frequency) else 1.0
        Z = system.dynamic_stiffness(2 * np.pi * f)
        H = np.abs(read_rows @ factorise(Z).solve(driven_rows.T)).max(axis=1)
        for s in (s for s, h in zip(read, H, strict=True) if h <= SAME * H.max()):
            text = (
                f"sensor '{s.name}' is across all motion: none of the forces moves the model at "
                f"{_where(s)} along its direction; look at that, and at the directions of the forces"
            )
            found.append(_defect(model, text, s))
    return (*found, *_stored_twice(model, measurements))


def _moving(
    system: System, some: Sequence[Sensor], word: str, verb: str
) -> tuple[list[Sensor], Floats, list[Defect]]:
    """Return channels that move with the model, their rows of its coordinates (n, n_free), and the others."""
    model, some = system.model, [s for s in some if not s.moves_base]
    rows = np.asarray((system.Q.T @ sensor_rows(model, some).T).T)
    moves = np.linalg.norm(rows, axis=1) > SAME
    still = [
        _defect(
            model,
            f"{word} '{s.name}' {verb} no motion: the model holds {_where(s)} along its direction; look at "
            "its place, its direction and the supports",
            s,
        )
        for s, moved in zip(some, moves, strict=True)
        if not moved
    ]
    return [s for s, moved in zip(some, moves, strict=True) if moved], rows[moves], still


def _doubled(
    model: Model, some: Sequence[Sensor], rows: Floats, words: str, measurements: Sequence[Measurement]
) -> list[Defect]:
    """Return pairs that read or drive one motion, unless their measured FRFs agree."""
    unit, out = rows / np.linalg.norm(rows, axis=1)[:, None], []
    cosine = unit @ unit.T
    for i, j in np.argwhere(np.triu(np.abs(cosine), 1) > 1 - SAME).tolist():
        a, b, sense = some[i], some[j], float(np.sign(cosine[i, j]))
        difference = _difference(a, b, sense, measurements)
        if difference <= AGREE:
            continue
        text = f"{words} '{a.name}' and '{b.name}' have one place and direction, {_where(a)}"
        text += ", with opposite signs" * (sense < 0)
        why = ": one of them says nothing new, or is elsewhere"
        if np.isfinite(difference):
            percent = f"{100 * difference:.0f} %"
            why = f", and their FRFs differ by {percent}: one is elsewhere, or along another axis"
        out.append(_defect(model, text + why, a, b))
    return out


def _where(s: Sensor) -> str:
    return coordinates_text(s.point) + f" on the sprung mass '{s.body}'" * bool(s.body)


def _defect(model: Model, text: str, *some: Sensor) -> Defect:
    return Defect("channel", text, np.unique([sensor_point(model.mesh, s) for s in some]))


def _columns(a: Sensor, b: Sensor, measurements: Sequence[Measurement]) -> list[tuple[Complexes, Complexes]]:
    """Return the FRFs of two sensors in the measurements that have both."""
    names = [[s.name for s in m.sensors] for m in measurements]
    return [
        (m.frf.H[:, n.index(a.name)], m.frf.H[:, n.index(b.name)])
        for m, n in zip(measurements, names, strict=True)
        if a.name in n and b.name in n
    ]


def _difference(a: Sensor, b: Sensor, sense: float, measurements: Sequence[Measurement]) -> float:
    """Return by how much the FRFs of two sensors differ, in parts of them; NaN without any."""
    pairs = _columns(a, b, measurements)
    if not pairs:
        return np.nan
    x, y = (np.concatenate([np.ravel(pair[k]) for pair in pairs]) for k in (0, 1))
    good = np.isfinite(x) & np.isfinite(y)
    x, y = x[good] / a.gain, sense * y[good] / b.gain
    return float(np.linalg.norm(x - y) / max(np.linalg.norm(x), np.linalg.norm(y), 1e-300))


def _stored_twice(model: Model, measurements: Sequence[Measurement]) -> list[Defect]:
    """Return sensors whose data are the same to rounding, which noise never is."""
    out = []
    for m in measurements:
        for a, b in combinations(m.sensors, 2):
            ((x, y),) = _columns(a, b, [m])
            if np.any(x) and np.allclose(x, y, rtol=1e-6, atol=0.0):
                text = f"sensors '{a.name}' and '{b.name}' have the same measured FRFs: one was stored twice"
                out.append(_defect(model, text, a, b))
    return out
