"""Faults of the measurement that may be hidden in its records."""

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.validation.frames import Draft, Generator
from benchmarks.validation.hiding import Hidden, Kind, Place, Readings
from benchmarks.validation.truth import Cut, Reading, TrueFrame


def _sensor(rng: Generator, draft: Draft) -> tuple[int, Reading]:
    i = int(rng.integers(len(draft.sensors)))
    return i, draft.sensors[i]


def _of(*readings: Reading) -> Place:
    names = tuple(r.name for r in readings)
    return Place(f"sensor {' and '.join(names)}", sensors=names)


def _gain(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
    i, sensor = _sensor(rng, draft)
    sign = float(rng.choice([-1, 1]))
    factor = np.ones(len(draft.sensors))

    def data(f: NDArray[np.float64], H: NDArray[Any], a: float) -> NDArray[Any]:
        factor[i] = 1 + sign * a
        return H * factor[:, None]

    return Hidden(_of(sensor), (0.1, 0.4), values=lambda a: {"value": 1 + sign * a}, data=data)


def _sign(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
    i, sensor = _sensor(rng, draft)
    factor = np.where(np.arange(len(draft.sensors)) == i, -1.0, 1.0)
    return Hidden(_of(sensor), (1.0, 1.0), data=lambda f, H, a: H * factor[:, None])


def _swap(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
    i, j = (int(k) for k in rng.choice(len(draft.sensors), 2, replace=False))
    order = np.arange(len(draft.sensors))
    order[[i, j]] = order[[j, i]]
    return Hidden(_of(draft.sensors[i], draft.sensors[j]), (1.0, 1.0), data=lambda f, H, a: H[:, order])


def _delay(rng: Generator, draft: Draft, truth: TrueFrame) -> Hidden | None:
    i, sensor = _sensor(rng, draft)
    unit = 1 / (2 * np.pi * draft.frequency[-1])

    def data(f: NDArray[np.float64], H: NDArray[Any], a: float) -> NDArray[Any]:
        phase = np.exp(-2j * np.pi * f * a * unit)
        return np.where((np.arange(H.shape[1]) == i)[:, None], H * phase[:, None, None], H)

    return Hidden(_of(sensor), (0.3, 1.5), values=lambda a: {"value": a * unit}, data=data)


def _moved(rng: Generator, draft: Draft, truth: TrueFrame, turn: bool) -> Hidden:
    i, sensor = _sensor(rng, draft)
    axes = draft.frame.members[sensor.at.member].axes
    L = draft.frame.members[sensor.at.member].length
    side = np.cross(sensor.direction, axes[int(rng.integers(3))])
    if np.linalg.norm(side) < 0.3:
        side = np.cross(sensor.direction, axes[0] + axes[1])
    side /= np.linalg.norm(side)
    back = -1.0 if sensor.at.position > L / 2 else 1.0

    def readings(sensors: Readings, a: float) -> Readings:
        if turn:
            other = replace(sensor, direction=np.cos(a) * sensor.direction + np.sin(a) * side)
        else:
            other = replace(sensor, at=Cut(sensor.at.member, sensor.at.position + back * a * L))
        return tuple(other if k == i else s for k, s in enumerate(sensors))

    bounds = (np.radians(10), np.radians(35)) if turn else (0.03, 0.1)
    return Hidden(_of(sensor), bounds, readings=readings)


IN_RECORDS = (
    Kind("gain", ("sensor_gain",), _gain, fault=True),
    Kind("sign", ("sensor_sign",), _sign, fault=True),
    Kind("tilt", ("sensor_tilt",), partial(_moved, turn=True), fault=True),
    Kind("swap", ("sensor_swap",), _swap, fault=True),
    Kind("delay", ("sensor_delay",), _delay, fault=True),
    Kind("position", ("sensor_position",), partial(_moved, turn=False), fault=True),
)
"""Faults of sensors."""
