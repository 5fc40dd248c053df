"""Receptances of a test in set-ups: each has a mass at another place, as a roving accelerometer does."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from fem.array_types import Complexes, Floats, Ints
from fem.reduction.frf_slopes import FrfSlopes
from fem.reduction.parametric_frf import ParametricFRF


@dataclass(frozen=True, slots=True, eq=False)
class SetUp:
    """A mass that is on the structure while some responses are measured.

    Attributes
    ----------
    rows : ndarray of int (k,)
        The responses.
    motions : ndarray (r + p, 3)
        The translations of its place as combinations of the basis's columns.
    mass : float
        [kg].
    """

    rows: Ints
    motions: Floats
    mass: float


class SetUpsFRF:
    """Receptances as a function of parameter values, each response with the mass of its set-up.

    Z of a set-up is Z - ω² m E Eᵀ, with the translations E of its place: solved on the basis, which has the
    response to a force at each sensor.

    Parameters
    ----------
    engine : ParametricFRF
        Without the masses. Responses in no set-up are those of it.
    set_ups : sequence of SetUp
    """

    def __init__(self, engine: ParametricFRF, set_ups: Sequence[SetUp]) -> None:
        self.engine = engine
        self._loaded = [(s.rows, engine.with_mass(s.motions, s.mass)) for s in set_ups]

    def evaluate(
        self, values: Floats, zeta: Floats, gradient: Literal[False] = False
    ) -> tuple[Complexes, None, None]:
        """Compute receptances, as of :meth:`ParametricFRF.evaluate`; derivatives by :meth:`slopes_of`."""
        H = np.array(self.engine.evaluate(values, zeta, gradient=False)[0])
        for rows, engine in self._loaded:
            H[:, rows] = engine.evaluate(values, zeta, gradient=False)[0][:, rows]
        return H, None, None

    def slopes_of(self, values: Floats, zeta: Floats, units: Floats) -> tuple[Complexes, FrfSlopes]:
        """Return receptances and derivatives, as of :meth:`ParametricFRF.slopes_of`."""
        H, slopes = self.engine.slopes_of(values, zeta, units)
        H = np.array(H)
        for rows, engine in self._loaded:
            part, theirs = engine.slopes_of(values, zeta, units)
            H[:, rows], slopes = part[:, rows], slopes.with_outputs(rows, theirs)
        return H, slopes

    def anchor(self, values: Floats) -> None:
        """Keep the sums of all matrices at some values, as :meth:`ParametricFRF.anchor`."""
        for engine in (self.engine, *(e for _, e in self._loaded)):
            engine.anchor(values)
