"""Responses over that of a reference sensor: transmissibilities of a force that was not measured."""

from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar

from updating.measurement.measurement import Sensor


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class UnmeasuredForce(Sensor):
    """A force of known place and direction and unknown size, whose responses refer to a sensor.

    FRFs to it are responses over the acceleration of that sensor, so that the spectrum of the force cancels:
    as accelerance an acceleration over an acceleration [-], as mobility [s] and as receptance [s²].

    Attributes
    ----------
    reference : Sensor
        Its reading divides the others: its gain, sign and direction count.
    """

    reference: Sensor

    per_acceleration: ClassVar[str] = "reference"

    @classmethod
    def of(cls, force: Sensor, reference: Sensor, name: str) -> "UnmeasuredForce":
        """Return a force whose responses refer to a sensor, under a name."""
        return cls(**_parts(replace(force, name=name)), reference=reference)

    def reference_sensor(self) -> Sensor:
        """Return the sensor that responses refer to."""
        return self.reference

    def as_force(self) -> Sensor:
        """Return the force with responses per unit of it."""
        return Sensor(**_parts(self))


def _parts(force: Sensor) -> dict[str, Any]:
    """Return what any force has."""
    return {f.name: getattr(force, f.name) for f in fields(Sensor)}
