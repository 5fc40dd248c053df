"""Excitations and responses in time: forces, motions of the base, and what sensors would record."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fem.array_types import Floats
from fem.model import DIRECTIONS, Model, ModelError
from fem.summary import fields_summary


@dataclass(frozen=True, slots=True, eq=False)
class Excitation:
    """Forces and accelerations of the base at equal steps in time; linear between the samples.

    Attributes
    ----------
    time : ndarray (n_t,)
        [s].
    loads : ndarray (n_dof, k)
        Loads that are multiplied by the histories ``forces`` [N, N·m per unit of these].
    forces : ndarray (n_t, k)
        Histories of the loads.
    base : mapping of str to ndarray (n_t,)
        Accelerations of all supports as one rigid body by direction, ``"x"`` … ``"rz"`` [m/s², rad/s²].
    """

    time: Floats
    loads: Floats
    forces: Floats
    base: Mapping[str, Floats] = field(default_factory=dict)

    __repr__ = fields_summary

    @classmethod
    def of(
        cls,
        model: Model,
        time: ArrayLike,
        loads: ArrayLike | None = None,
        forces: ArrayLike | None = None,
        base: Mapping[str, ArrayLike] | None = None,
    ) -> "Excitation":
        """Check the parts of an excitation.

        Raises
        ------
        ModelError
            For shapes that do not fit, values that are not finite, steps that are not equal, or an unknown
            direction of the base.
        """
        t = np.array(time, dtype=float, ndmin=1)
        if t.ndim != 1 or t.size < 2 or not np.isfinite(t).all() or (np.diff(t) <= 0).any():
            msg = "times must be two or more finite numbers that increase [s]"
            raise ModelError(msg)
        step = np.diff(t)
        # Steps that differ by less than this part of their mean are equal: times in files are rounded [-]
        if np.ptp(step) > 1e-4 * step.mean():
            msg = (
                f"times have steps from {step.min():.6g} to {step.max():.6g} s; equal ones are needed: "
                "interpolate the excitation first"
            )
            raise ModelError(msg)
        F = np.zeros((model.n_dof, 0)) if loads is None else np.array(loads, dtype=float)
        F = F[:, None] if F.ndim == 1 else F
        p = np.zeros((t.size, 0)) if forces is None else np.array(forces, dtype=float)
        p = p[:, None] if p.ndim == 1 else p
        if F.shape != (model.n_dof, p.shape[1]) or len(p) != t.size:
            msg = (
                f"loads have shape {F.shape} and their histories {p.shape}; ({model.n_dof}, k) and "
                f"({t.size}, k) are expected"
            )
            raise ModelError(msg)
        accelerations = {}
        for direction, values in (base or {}).items():
            if direction not in DIRECTIONS:
                msg = f"the base moves in '{direction}'; allowed are {', '.join(DIRECTIONS)}"
                raise ModelError(msg)
            accelerations[direction] = np.array(values, dtype=float)
            if accelerations[direction].shape != t.shape:
                msg = (
                    f"the base's acceleration in {direction} has shape {accelerations[direction].shape}; "
                    f"({t.size},) is expected"
                )
                raise ModelError(msg)
        if not all(np.isfinite(X).all() for X in (F, p, *accelerations.values())):
            msg = "the excitation has values that are not finite numbers"
            raise ModelError(msg)
        return cls(t, F, p, accelerations)

    @property
    def step(self) -> float:
        """Step in time [s]."""
        return float(self.time[-1] - self.time[0]) / (self.time.size - 1)


@dataclass(frozen=True, slots=True, eq=False)
class TimeResponse:
    """Responses in time.

    Attributes
    ----------
    time : ndarray (n_t,)
        [s].
    displacement, velocity, acceleration : ndarray (n_t, n_out)
        [m, m/s, m/s², or rad].
    outputs : tuple of str
    relative : bool
        Whether they are relative to the base.
    method : str
        ``"modal"`` or ``"newmark"``.
    n_modes : int
        Of the modal method; of Newmark's, those that modal damping ratios were given to.
    notes : tuple of str
        What was simplified, in sentences.
    snapshots : ndarray (n_dof, k)
        Displacements of all DOFs at the samples asked for, relative to the base or not as the responses
        [m, rad].
    """

    time: Floats
    displacement: Floats
    velocity: Floats
    acceleration: Floats
    outputs: tuple[str, ...]
    relative: bool
    method: str
    n_modes: int
    notes: tuple[str, ...] = ()
    snapshots: Floats = field(default_factory=lambda: np.zeros((0, 0)))

    __repr__ = fields_summary

    def peak(self, quantity: str = "displacement") -> Any:
        """Return the largest size of each response and its time, shapes (n_out,) [unit, s]."""
        values = np.abs(getattr(self, quantity))
        rows = values.argmax(axis=0)
        return values[rows, np.arange(values.shape[1])], self.time[rows]


def interpolated(time: ArrayLike, values: ArrayLike, step: float) -> tuple[Any, Any]:
    """Return times at equal steps from the first to the last, and histories (n_t, k) interpolated there."""
    t, v = np.asarray(time, dtype=float), np.asarray(values, dtype=float)
    n = int(np.floor((t[-1] - t[0]) / step * (1 + 1e-9) + 1e-9))
    at = t[0] + step * np.arange(n + 1)
    columns: Sequence[Any] = [np.interp(at, t, column) for column in v.T]
    return at, np.array(columns).reshape(len(columns), at.size).T
