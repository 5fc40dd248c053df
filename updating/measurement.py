"""Measurements: FRFs with the sensors and excitations that they belong to."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fem.frf import FRF
from fem.mesh import Mesh


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
        What its reading is multiplied by [-].
    mass : float
        Mass that it adds [kg].
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
