"""Responses of rotors to unbalance, over speed.

    Model with members that spin ─ unbalances, speeds → solve_unbalance → UnbalanceResponse

A mass m at a distance e from the axis turns with its member at Ω = ratio times the speed, and exerts the
force m e Ω² outwards. Of the direction e₁ at rest and e₂ = a × e₁, a the axis of positive rotation, this is
the real part of m e Ω² (e₁ - i e₂) e^{iΩt}.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike

from fem.analysis.frf_solver import compute_frf
from fem.analysis.selection import Selection, dof_vectors
from fem.array_types import Complexes, Floats
from fem.effects.spin import Spin, refuse_speeds, spinning
from fem.elements.frame import Frame
from fem.model import Model, ModelError
from fem.summary import fields_summary
from fem.system import System, assemble, sum_contributions

_SPIN = "spin"
_ROUNDING = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class Unbalance:
    """A mass off the axis of a member that spins.

    Attributes
    ----------
    point : int
        Point of the mesh on the member.
    moment : float
        Mass times its distance from the axis [kg·m].
    angle : float
        Of its direction at rest, about the axis from the member's first to its second end, from the direction
        of the section's height (local z) towards -y [rad].
    """

    point: int
    moment: float
    angle: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class UnbalanceResponse:
    """Responses to unbalance.

    Attributes
    ----------
    speed : ndarray (n,)
        Of members with spin 1 [rad/s].
    ratio : float
        Frequency of the unbalance over the speed [-].
    outputs : tuple of str
    displacement : ndarray (n, n_out), complex
        u with Re u e^{iΩt} [m, rad].
    """

    speed: Floats
    ratio: float
    outputs: tuple[str, ...]
    displacement: Complexes

    __repr__ = fields_summary

    @property
    def frequency(self) -> Floats:
        """Frequency of the response at each speed [Hz]."""
        return np.abs(self.ratio * self.speed) / (2 * np.pi)


def solve_unbalance(
    model: Model,
    unbalances: Sequence[Unbalance],
    speed: ArrayLike,
    outputs: Selection,
    progress: Callable[[int, int], None] | None = None,
) -> UnbalanceResponse:
    """Compute the steady responses of a rotor to its unbalance at several speeds.

    Modal damping ratios count as loss factors, as in :func:`fem.analysis.frf_solver.compute_frf`.

    Parameters
    ----------
    model : Model
        Any `Spin` of it is replaced.
    unbalances : sequence of Unbalance
        On members of one speed.
    speed : array_like (n,)
        Speeds of members with spin 1 [rad/s].
    outputs : selection
        DOF numbers, (point, direction) pairs, or rows of combinations (n, n_dof).
    progress : callable, optional
        Called with the number of speeds that are done, and of all.

    Raises
    ------
    ModelError
        If there is no unbalance, one is on no member that spins, or several speeds would act at once.
    """
    speed = np.array(speed, dtype=float, ndmin=1)
    refuse_speeds(speed)
    rest = model.without_effect(*(e.name for e in model.of_kind(Spin)))
    ratio, cosine, sine = _forces(rest, unbalances)
    still = assemble(rest)
    turning = rest.with_effect(Spin(name=_SPIN, speed=1.0))
    skew = sum_contributions(turning.effect(_SPIN).contribute(turning), rest.n_dof)[2]
    G = sp.csc_array(still.Q.T @ skew @ still.Q)
    columns, labels = dof_vectors(rest, outputs)
    forces = np.stack([cosine, sine])
    u = np.zeros((speed.size, columns.shape[1]), dtype=complex)
    for k, rate in enumerate(speed):
        omega = abs(ratio * rate)
        if omega > 0:
            system = _at(still, turning, G, rate)
            found = compute_frf(
                system, [omega / (2 * np.pi)], columns.T, forces, "receptance", method="direct"
            ).H[0]
            u[k] = omega**2 * (found[:, 0] - 1j * np.sign(ratio * rate) * found[:, 1])
        if progress is not None:
            progress(k + 1, speed.size)
    return UnbalanceResponse(speed, ratio, labels, u)


def _at(still: System, turning: Model, G: sp.csc_array, speed: float) -> System:
    """Return the system at a speed."""
    spin = Spin(name=_SPIN, speed=speed)
    model = turning.without_effect(_SPIN).with_effect(spin)
    return replace(still, C=sp.csc_array(still.C + speed * G), model=model)


def _forces(model: Model, unbalances: Sequence[Unbalance]) -> tuple[float, Floats, Floats]:
    """Return the ratio of the unbalances' speed, and forces at Ω = 1 along e₁ and e₂, both (n_dof,)."""
    if not unbalances:
        msg = "there is no unbalance; give at least one"
        raise ModelError(msg)
    members = spinning(model)
    ratios: dict[int, float] = {}
    cosine, sine = np.zeros(model.n_dof), np.zeros(model.n_dof)
    for one in unbalances:
        on = [m for m in members if one.point in model.mesh.member_points(m)]
        if not on:
            known = ", ".join(members) or "none"
            msg = f"the unbalance at point {one.point} is on no member that spins; these are: {known}"
            raise ModelError(msg)
        ratios[one.point] = members[on[0]]
        (frame,) = model.of_kind(Frame)
        axis, y, z = frame.lines(model.mesh, model.mesh.members[on[0]][:1]).R[0]
        first = np.cos(one.angle) * z - np.sin(one.angle) * y
        second = np.cross(axis, first)
        at = slice(6 * one.point, 6 * one.point + 3)
        cosine[at] += one.moment * first
        sine[at] += one.moment * second
    different = sorted(set(ratios.values()))
    if max(different) - min(different) > _ROUNDING * max(map(abs, different)):
        words = ", ".join(f"{r:g}" for r in different)
        msg = f"unbalances are on members with spins of {words}, so at several frequencies; take one spin"
        raise ModelError(msg)
    return different[0], cosine, sine
