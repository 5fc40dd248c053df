"""Combinations of load cases, and envelopes of responses over cases."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fem.analysis.loads import (
    InitialStrain,
    Key,
    LineLoad,
    LoadCase,
    MemberForce,
    MemberLoad,
    as_cases,
    point_forces,
)
from fem.array_types import Floats, Ints
from fem.model import Model, ModelError
from fem.summary import fields_summary


@dataclass(frozen=True, slots=True, eq=False)
class Envelope:
    """The least and the largest of values over load cases, and the cases that give them.

    Attributes
    ----------
    low, high : ndarray
        Of the shape of the values without their last axis, which is that of the cases.
    low_case, high_case : ndarray of int
        Columns of the cases; the first of several that are equal.
    """

    low: Floats
    high: Floats
    low_case: Ints
    high_case: Ints

    __repr__ = fields_summary


def combine_loads(
    model: Model, cases: Sequence[LoadCase], factors: Mapping[str, float], name: str
) -> LoadCase:
    """Return the load case Σ factor · case.

    Parameters
    ----------
    model : Model
    cases : sequence of LoadCase
    factors : mapping of str to float
        By the name of the load case; cases that are not named are left out.
    name : str
        Of the combination.

    Raises
    ------
    ModelError
        For a case that is not there or a factor that is not finite.
    """
    known = {c.name: c for c in as_cases(model, list(cases))}
    points = np.zeros(model.n_dof)
    members: list[MemberLoad] = []
    gravity = np.zeros(3)
    displacements: dict[Key, float] = {}
    for case, factor in factors.items():
        if case not in known:
            msg = f"combination '{name}' has the load case '{case}'; there are {', '.join(known)}"
            raise ModelError(msg)
        if not np.isfinite(factor):
            msg = f"combination '{name}': the factor of load case '{case}' is {factor}"
            raise ModelError(msg)
        load = known[case]
        points += factor * point_forces(model, load)
        members += [_scaled(m, factor) for m in load.members]
        gravity += factor * np.asarray(load.gravity, dtype=float)
        for key, value in load.displacements.items():
            displacements[key] = displacements.get(key, 0.0) + factor * value
    return LoadCase(
        name=name, points=points, members=tuple(members), gravity=gravity, displacements=displacements
    )


def _scaled(load: MemberLoad, factor: float) -> MemberLoad:
    """Return a load on a member times a factor."""
    if isinstance(load, InitialStrain):
        return replace(
            load,
            axial=factor * load.axial,
            curvature_y=factor * load.curvature_y,
            curvature_z=factor * load.curvature_z,
        )
    if isinstance(load, MemberForce):
        return replace(load, force=factor * np.asarray(load.force, dtype=float))
    assert isinstance(load, LineLoad)
    last = load.force2
    return replace(
        load,
        force1=factor * np.asarray(load.force1, dtype=float),
        force2=None if last is None else factor * np.asarray(last, dtype=float),
    )


def envelope(values: Floats) -> Envelope:
    """Return the envelope of values whose last axis is that of the load cases."""
    return Envelope(values.min(axis=-1), values.max(axis=-1), values.argmin(axis=-1), values.argmax(axis=-1))
