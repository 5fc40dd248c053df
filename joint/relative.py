"""Massless joints between two nodes, described by how the nodes move against each other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fem.array_types import Floats
from joint._checks import as_square, frozen_copy


@dataclass(frozen=True, slots=True, eq=False)
class RelativeJoint:
    """Hold the matrices of a massless joint between two nodes.

    Attributes
    ----------
    K, C, D : (12, 12) arrays
        Stiffness, viscous and structural damping at x y z rx ry rz of node 1, then of node 2. SI units.
    B : (6, 12) array
        Relative coordinates q = B x, see `relative_coordinates`.
    """

    K: Floats
    C: Floats
    D: Floats
    B: Floats

    def __post_init__(self) -> None:
        for name in ("K", "C", "D", "B"):
            object.__setattr__(self, name, frozen_copy(getattr(self, name)))


def relative_coordinates(
    lever_1: npt.ArrayLike = (0.0, 0.0, 0.0),
    lever_2: npt.ArrayLike = (0.0, 0.0, 0.0),
    axes: npt.ArrayLike | None = None,
) -> Floats:
    """Return B, which gives the motion of node 2's side of a joint against node 1's.

    q = B x = Q [ u₂ + θ₂ × r₂ - (u₁ + θ₁ × r₁) ;  θ₂ - θ₁ ]

    Rigid-body kinematics with small rotations: r is the rigid arm from the node to the joint point, Q turns
    global axes into those of the joint. A common rigid motion of both nodes gives q = 0 provided that both
    arms end in the same point, that is node 1 + r₁ = node 2 + r₂.

    Parameters
    ----------
    lever_1, lever_2 : (3,) array_like
        Arms from node 1 and from node 2 to the joint point, global axes [m].
    axes : (3, 3) array_like, optional
        Rows are the joint's axes in global components, orthonormal; global axes if None.

    Returns
    -------
    (6, 12) array
        Columns x y z rx ry rz of node 1, then of node 2; rows relative translations [m] and rotations [rad].

    Raises
    ------
    ValueError
        If an arm is not three finite numbers or the axes are not orthonormal.
    """
    Q = np.eye(3) if axes is None else as_square(axes, "axes", 3)
    if not np.allclose(Q @ Q.T, np.eye(3), rtol=0, atol=1e-9):
        msg = "axes are not orthonormal; the rows must be unit vectors at right angles to 1e-9"
        raise ValueError(msg)
    B = np.zeros((6, 12))
    for name, lever, sign, start in (("lever_1", lever_1, -1.0, 0), ("lever_2", lever_2, 1.0, 6)):
        arm = np.asarray(lever, dtype=float)
        if arm.shape != (3,) or not np.isfinite(arm).all():
            msg = f"{name} is {lever!r}; three finite components in m are needed"
            raise ValueError(msg)
        B[:3, start : start + 3] = sign * Q
        B[:3, start + 3 : start + 6] = sign * Q @ np.cross(np.eye(3), arm).T
        B[3:, start + 3 : start + 6] = sign * Q
    return B


def relative_joint(
    K: npt.ArrayLike,
    C: npt.ArrayLike | None = None,
    D: npt.ArrayLike | None = None,
    *,
    lever_1: npt.ArrayLike = (0.0, 0.0, 0.0),
    lever_2: npt.ArrayLike = (0.0, 0.0, 0.0),
    axes: npt.ArrayLike | None = None,
) -> RelativeJoint:
    """Return a massless joint between two nodes from its 6×6 matrices in relative coordinates.

    Z₁₂ₓ₁₂ = Bᵀ z₆ₓ₆ B,  z = K + iω C + i D

    The joint's work is that of its relative motion, q = B x, and so its forces are Bᵀ z q (virtual work).

    Parameters
    ----------
    K, C, D : (6, 6) array_like
        Stiffness [N/m, N m/rad], viscous damping [N s/m, N m s/rad] and structural damping [N/m, N m/rad]
        at the joint point, in the joint's axes. None means zero.
    lever_1, lever_2, axes
        See `relative_coordinates`.

    Returns
    -------
    RelativeJoint
        12×12 matrices for `joint_impedance`, and B, whose transpose is a `basis` for `identify_joint`.

    Raises
    ------
    ValueError
        If a matrix is not 6×6 and finite, or `relative_coordinates` refuses the axes.
    """
    B = relative_coordinates(lever_1, lever_2, axes)
    wide = [B.T @ as_square(matrix, name, 6) @ B for matrix, name in ((K, "K"), (C, "C"), (D, "D"))]
    return RelativeJoint(*wide, B=B)
