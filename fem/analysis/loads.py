"""Static loads: forces at points and on members, initial strains, gravity, and prescribed motions."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fem.array_types import Floats
from fem.model import DIRECTIONS, Model, ModelError
from fem.summary import fields_summary

Key = tuple[str, str]
"""Key of a constraint: the effect's name and a direction."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LineLoad:
    """A force per length on a member's axis, constant or linear between two places.

    Attributes
    ----------
    member : str
    force1 : ndarray (3,)
        At ``start`` [N/m of the axis].
    force2 : ndarray (3,) or None
        At ``stop``; as ``force1`` unless given.
    axes : str
        ``"global"`` or ``"local"``: the axes of the components.
    start, stop : float
        Arc lengths from the member's first end [m]; all of the member unless given.
    """

    member: str
    force1: ArrayLike
    force2: ArrayLike | None = None
    axes: str = "global"
    start: float = 0.0
    stop: float | None = None

    __repr__ = fields_summary


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MemberForce:
    """A force on a member's axis at an arc length from its first end.

    Attributes
    ----------
    member : str
    position : float
        Arc length [m].
    force : ndarray (3,)
        [N].
    axes : str
        ``"global"`` or ``"local"``.
    """

    member: str
    position: float
    force: ArrayLike
    axes: str = "global"

    __repr__ = fields_summary


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class InitialStrain:
    """A strain of a member that is free to deform: of heat, shrinkage, or a bar made too short.

    Attributes
    ----------
    member : str
    axial : float
        Elongation [-]; -P/EA pulls a member between rigid ends with P.
    curvature_y, curvature_z : float
        Derivatives of the rotations about local y and z by x [1/m].
    """

    member: str
    axial: float = 0.0
    curvature_y: float = 0.0
    curvature_z: float = 0.0

    @classmethod
    def thermal(
        cls, member: str, expansion: float, change: float, gradient_y: float = 0.0, gradient_z: float = 0.0
    ) -> "InitialStrain":
        """Return the strain of a change of temperature, α (T + y T_y + z T_z).

        Parameters
        ----------
        member : str
        expansion : float
            Coefficient of thermal expansion α [1/K].
        change : float
            T on the axis [K].
        gradient_y, gradient_z : float
            T_y and T_z, along the local axes [K/m].
        """
        return cls(
            member=member,
            axial=expansion * change,
            curvature_y=expansion * gradient_z,
            curvature_z=-expansion * gradient_y,
        )


MemberLoad = LineLoad | MemberForce | InitialStrain
PointLoads = ArrayLike | Mapping[tuple[int, str], float]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LoadCase:
    """Loads that act together.

    Attributes
    ----------
    name : str
    points : array_like (n_dof,) or mapping of (int, str) to float
        Forces and moments at points, global: on all DOFs, or such as ``{(3, "z"): -100.0}`` [N, N·m].
    members : tuple of LineLoad, MemberForce and InitialStrain
        Loads on members.
    gravity : ndarray (3,)
        Acceleration of gravity, which acts on all mass, such as (0, 0, -9.81) [m/s²].
    displacements : mapping of (str, str) to float
        Prescribed motions of constraints by their key, such as ``{("foot", "z"): -0.002}``: of a support in a
        direction, or of the first side of a joint relative to its second in a rigid direction [m, rad].
    """

    name: str = "load"
    points: PointLoads = field(default_factory=dict)
    members: tuple[MemberLoad, ...] = ()
    gravity: ArrayLike = (0.0, 0.0, 0.0)
    displacements: Mapping[Key, float] = field(default_factory=dict)

    __repr__ = fields_summary


def as_cases(model: Model, loads: Any) -> tuple[LoadCase, ...]:
    """Return load cases from all forms in which `solve_static` takes loads."""
    if loads is None:
        msg = "there are no loads; give a LoadCase, forces (n_dof,), or a mapping such as {(3, 'z'): -100.0}"
        raise ModelError(msg)
    if isinstance(loads, LoadCase):
        return (loads,)
    if isinstance(loads, Mapping):
        return (LoadCase(points=loads),)
    if isinstance(loads, Sequence) and any(isinstance(c, LoadCase) for c in loads):
        if not all(isinstance(c, LoadCase) for c in loads):
            msg = "load cases and other loads are mixed; give one LoadCase for each case"
            raise ModelError(msg)
        names = [c.name for c in loads]
        if len(set(names)) == len(names):
            return tuple(loads)
        if set(names) == {"load"}:
            return tuple(replace(c, name=f"load{k + 1}") for k, c in enumerate(loads))
        twice = next(n for n in names if names.count(n) > 1)
        msg = f"two load cases have the name '{twice}'; names must differ"
        raise ModelError(msg)
    f = np.asarray(loads, dtype=float)
    if f.ndim not in (1, 2) or f.shape[0] != model.n_dof:
        msg = f"the loads have shape {f.shape}; ({model.n_dof},) or ({model.n_dof}, n_cases) is expected"
        raise ModelError(msg)
    if f.ndim == 1:
        return (LoadCase(points=f),)
    return tuple(LoadCase(name=f"load{k + 1}", points=f[:, k]) for k in range(f.shape[1]))


def point_forces(model: Model, case: LoadCase) -> Floats:
    """Return the forces and moments of a load case at points, shape (n_dof,)."""
    f = np.zeros(model.n_dof)
    if isinstance(case.points, Mapping):
        for (point, direction), value in case.points.items():
            if not 0 <= point < model.mesh.n_points:
                msg = (
                    f"load case '{case.name}' has a load at point {point}, but the mesh has "
                    f"{model.mesh.n_points} points, counted from 0"
                )
                raise ModelError(msg)
            if direction not in DIRECTIONS:
                msg = (
                    f"load case '{case.name}': '{direction}' at point {point} is not a direction; allowed "
                    f"are {', '.join(DIRECTIONS)}"
                )
                raise ModelError(msg)
            f[6 * point + DIRECTIONS.index(direction)] += value
    else:
        f = np.array(case.points, dtype=float)
        if f.shape != (model.n_dof,):
            msg = f"load case '{case.name}': the forces have shape {f.shape}; ({model.n_dof},) is expected"
            raise ModelError(msg)
    if not np.isfinite(f).all():
        dof = int(np.flatnonzero(~np.isfinite(f))[0])
        msg = f"load case '{case.name}': the load on point {dof // 6} {DIRECTIONS[dof % 6]} is {f[dof]}"
        raise ModelError(msg)
    return f


def checked_vector(value: ArrayLike, name: str) -> Floats:
    """Return three finite components, or raise an error that names them."""
    v = np.asarray(value, dtype=float)
    if v.shape != (3,) or not np.isfinite(v).all():
        msg = f"the {name} is {np.asarray(value).tolist()}; three finite components are expected"
        raise ModelError(msg)
    return v
