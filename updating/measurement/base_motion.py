"""Motions of the base as excitations: what a shaker table does."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fem.array_types import Floats
from fem.effects.moving_base import MovingBase
from fem.model import Model
from updating.measurement.measurement import MeasurementError, Sensor


@dataclass(frozen=True, slots=True, eq=False)
class BaseMotion(Sensor):
    """The acceleration of the base as an excitation: of all supports and grounds as one rigid body.

    FRFs to it are transmissibilities. As accelerance a response is an acceleration for the base's
    acceleration [-], as mobility a velocity [s] and as receptance a displacement [s²]. Its point is where
    pictures mark it.
    """

    directed: ClassVar[bool] = False
    signal_unit: ClassVar[str] = "m/s^2"
    per_acceleration: ClassVar[str] = "base"
    moves_base: ClassVar[bool] = True

    def row(self, model: Model) -> Floats:
        """Return the force on the base that gives it the acceleration 1 along ``direction``, (n_dof,).

        Raises
        ------
        MeasurementError
            If the base rests in the model, or does not move along the direction.
        """
        row, along, ground = np.zeros(model.n_dof), np.asarray(self.direction, dtype=float), model.ground
        if ground is None:
            msg = f"'{self.name}' is a motion of the base, which rests in this model; see with_moving_base"
            raise MeasurementError(msg)
        amount = ground.translated(along)
        if np.abs(amount @ ground.directions - along).max() > 1e-6:
            msg = f"'{self.name}' moves the base along {along.tolist()}, where the model's base does not move"
            raise MeasurementError(msg)
        (base,) = model.of_kind(MovingBase)
        row[ground.dofs] = self.gain * base.mass * amount
        return row
