"""Measurements: FRFs with the sensors and excitations that they belong to."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fem.effects.added_mass import AddedMass
from fem.frf import FRF
from fem.mesh import Mesh
from fem.model import Instruments, Model


class MeasurementError(ValueError):
    """Measured data that do not fit the sensors, the units or one another."""


@dataclass(frozen=True, slots=True, eq=False)
class Sensor:
    """A translational sensor or exciter at a place on the structure.

    Attributes
    ----------
    name : str
        Label in the FRFs, such as ``"U1z"``.
    point : ndarray (3,)
        Coordinates [m].
    direction : ndarray (3,)
        Unit vector of its positive reading, the sign included.
    member : str or None
        Member that it sits on; None for the nearest.
    gain : float
        Its reading over what it should read [-].
    mass : float
        Mass that it adds to the structure, which :func:`with_sensor_masses` puts into a model [kg]. Of a
        triaxial sensor one channel has it.
    """

    name: str
    point: NDArray[np.float64]
    direction: NDArray[np.float64]
    member: str | None = None
    gain: float = 1.0
    mass: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Measurement:
    """Measured FRFs with their sensors and excitations.

    Attributes
    ----------
    frf : FRF
        Its ``outputs`` are the names of ``sensors`` and its ``inputs`` those of ``excitations``, in order.
    sensors, excitations : tuple of Sensor
        Where the rows and columns of the FRFs are on the structure.
    force_level : float or None
        Amplitude of the exciting force, to tell levels apart [N].
    name : str
        File or label for reports.
    """

    frf: FRF
    sensors: tuple[Sensor, ...]
    excitations: tuple[Sensor, ...]
    force_level: float | None = None
    name: str = "measured"

    def __post_init__(self) -> None:
        for word, have, want in (
            ("responses", self.frf.outputs, self.sensors),
            ("forces", self.frf.inputs, self.excitations),
        ):
            if have != tuple(s.name for s in want):
                msg = (
                    f"the FRF's {word} are {', '.join(have)}, the sensors' names "
                    f"{', '.join(s.name for s in want)}"
                )
                raise MeasurementError(msg)

    def with_frf(self, frf: FRF) -> "Measurement":
        """Return a measurement with other data of the same or fewer sensors and excitations."""
        by_out = {s.name: s for s in self.sensors}
        by_in = {s.name: s for s in self.excitations}
        return replace(
            self,
            frf=frf,
            sensors=tuple(by_out[n] for n in frf.outputs),
            excitations=tuple(by_in[n] for n in frf.inputs),
        )


def place_sensors(mesh: Mesh, sensors: tuple[Sensor, ...], tolerance: float | None = None) -> Mesh:
    """Return a mesh with a point at every sensor, by splitting lines; existing points keep their indices.

    Parameters
    ----------
    mesh : Mesh
    sensors : tuple of Sensor
    tolerance : float, optional
        Largest distance of a sensor from the member's axis [m]; 2 % of the mesh's size unless given.

    Raises
    ------
    MeasurementError
        If a sensor is farther from every member.
    """
    tolerance = 0.02 * mesh.size if tolerance is None else tolerance
    for sensor in sensors:
        _, distance = mesh.nearest_point(sensor.point)
        if distance <= 1e-6 * mesh.size:
            continue
        member, position, distance = mesh.nearest_on_members(sensor.point)
        if distance > tolerance:
            msg = (
                f"sensor '{sensor.name}' at {sensor.point.tolist()} m is {distance:.3g} m from the nearest "
                f"member '{member}'; at most {tolerance:.3g} m is allowed"
            )
            raise MeasurementError(msg)
        mesh = mesh.with_point_on(member, position)
    return mesh


def with_sensor_masses(model: Model, sensors: Sequence[Sensor]) -> Model:
    """Return a model with the masses of sensors, as point masses where they sit.

    A sensor is known by its name: one that also measures where a force acts, or whose mass the model has
    already, is added once.

    Parameters
    ----------
    model : Model
        With a point of the mesh at every sensor.
    sensors : sequence of Sensor

    Raises
    ------
    MeasurementError
        If a mass is negative or not finite, or the mesh has no point where the sensor sits.
    """
    known = {e.name for e in model.effects}
    masses: dict[str, AddedMass] = {}
    for s in sensors:
        name = f"mass of sensor {s.name}"
        if not (np.isfinite(s.mass) and s.mass >= 0):
            msg = f"sensor '{s.name}' has the mass {s.mass} kg; it must be finite and not negative"
            raise MeasurementError(msg)
        if s.mass > 0 and name not in known:
            masses[name] = AddedMass(name=name, point=sensor_point(model.mesh, s), mass=s.mass)
    return replace(model, effects=(*model.effects, *masses.values())) if masses else model


def sensor_point(mesh: Mesh, sensor: Sensor) -> int:
    """Return the point of a mesh where a sensor sits: the nearest one, of its member if it has one.

    Raises
    ------
    MeasurementError
        If it is farther than 2 % of the mesh's size (see :func:`place_sensors`).
    """
    if sensor.member is None:
        point, distance = mesh.nearest_point(sensor.point)
    else:
        own = mesh.member_points(sensor.member)
        away = np.linalg.norm(mesh.points[own] - sensor.point, axis=1)
        point, distance = int(own[np.argmin(away)]), float(away.min())
    if distance > 0.021 * mesh.size:
        msg = f"sensor '{sensor.name}' is {distance:.3g} m from the nearest point of the mesh"
        raise MeasurementError(msg)
    return point


def instruments_on(mesh: Mesh, measurement: Measurement) -> Instruments:
    """Return where a measurement's sensors and excitations are, as points of a mesh."""

    def places(group: tuple[Sensor, ...]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        points = np.array([sensor_point(mesh, s) for s in group], dtype=np.int64)
        return points, np.array([s.direction for s in group], dtype=float).reshape(-1, 3)

    return Instruments(*places(measurement.sensors), *places(measurement.excitations))
