"""Read ``[[loads]]``, ``[[combinations]]``, ``[[envelopes]]`` and ``[[initial]]`` of a study file."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from dovetail.file.geometry import Geometry
from dovetail.file.table import StudyTable, suggest
from fem.analysis.combinations import combine_loads
from fem.analysis.initial import deflected, moving_as_one
from fem.analysis.loads import InitialStrain, Key, LineLoad, LoadCase, MemberLoad
from fem.array_types import Floats
from fem.effects.joint import Joint
from fem.effects.support import Support
from fem.model import DIRECTIONS, Effect, Model, ModelError
from fem.system import System

# Read ``[[initial]]``: motions of points and members at the first sample of a response in time --------------


@dataclass(frozen=True, slots=True, eq=False)
class InitialMotion:
    """A motion of a point, or of members as one rigid body, at the first sample.

    Attributes
    ----------
    point : int or None
        None for members.
    members : tuple of str
    displacement : mapping of str to float
        Of the point by direction: it is held there until the first sample [m, rad].
    velocity : mapping of str to float
        By direction [m/s, rad/s].
    about : ndarray (3,)
        Point about which members turn [m].
    """

    point: int | None = None
    members: tuple[str, ...] = ()
    displacement: Mapping[str, float] = field(default_factory=dict)
    velocity: Mapping[str, float] = field(default_factory=dict)
    about: Floats = field(default_factory=lambda: np.zeros(3))


def read_initial(top: StudyTable, geometry: Geometry) -> tuple[InitialMotion, ...]:
    """Read the initial motions of a study."""
    out = []
    for t in top.tables("initial"):
        displacement, velocity = _by_direction(t, "displacement"), _by_direction(t, "velocity")
        if not (displacement or velocity):
            text = "give displacement, velocity or both, such as velocity = { x = 1.5 }"
            t.refuse_without("velocity", text, {"x": 1.5})
        if "point" in t:
            point = geometry.point(t)
            out.append(InitialMotion(point=point, displacement=displacement, velocity=velocity))
        else:
            members = geometry.members(t, default=tuple(geometry.mesh.members))
            if displacement:
                t.refuse("displacement", "it is that of a point, which is held there and let go; give point")
            about = t.vector("about", np.zeros(3))
            out.append(InitialMotion(members=members, velocity=velocity, about=about))
        t.finish()
    return tuple(out)


def start_of(system: System, motions: tuple[InitialMotion, ...]) -> tuple[Floats, Floats] | None:
    """Return the displacements and velocities of all DOFs at the first sample, None where it is at rest.

    Later motions of a point and direction replace former ones.

    Raises
    ------
    ModelError
        For motions that supports do not allow.
    """
    if not motions:
        return None
    mesh = system.model.mesh
    names = {point: f"'{name}'" for name, point in mesh.point_names.items()}
    displaced: dict[tuple[int, str], float] = {}
    velocity = np.zeros(system.model.n_dof)
    for each in motions:
        v = np.array([each.velocity.get(d, 0.0) for d in DIRECTIONS])
        if each.point is None:
            points = np.unique(np.concatenate([mesh.lines[mesh.members[m]].ravel() for m in each.members]))
            moved = moving_as_one(system, points, v, each.about)
            velocity[moved != 0] = moved[moved != 0]
            continue
        for direction in (*each.displacement, *each.velocity):
            dof = 6 * each.point + DIRECTIONS.index(direction)
            if not abs(system.Q[[dof]]).sum():
                place = names.get(each.point, f"the point at {mesh.points[each.point]} m")
                msg = f"{place} has an initial motion in {direction}, in which it is held"
                raise ModelError(msg)
        displaced |= {(each.point, d): u for d, u in each.displacement.items()}
        for direction, speed in each.velocity.items():
            velocity[6 * each.point + DIRECTIONS.index(direction)] = speed
    return deflected(system, displaced), velocity


def _by_direction(t: StudyTable, key: str) -> dict[str, float]:
    """Return values by direction, such as ``{ x = 0.01 }``."""
    inner = t.table(key)
    units = ("m", "rad") if key == "displacement" else ("m/s", "rad/s")
    values = {d: inner.number(d, None, unit=units[d[0] == "r"]) for d in DIRECTIONS}
    inner.finish()
    return {d: v for d, v in values.items() if v is not None}


# ------------------------------------------------------------------------------------------------------------


KINDS = ("point", "force_per_length", "temperature", "strain", "gravity", "settlement")
"""Keys that say what kind of load an entry is; each has exactly one."""


@dataclass(frozen=True, slots=True, eq=False)
class Loads:
    """The loads of a study.

    Attributes
    ----------
    cases : tuple of LoadCase
        In the order in which the study names them.
    combinations : mapping of str to mapping of str to float
        Factors of load cases by the name of the combination.
    envelopes : mapping of str to tuple of str
        Names of load cases and combinations by the name of the envelope.
    initial : tuple of InitialMotion
        Motions at the first sample of responses in time.
    """

    cases: tuple[LoadCase, ...] = ()
    combinations: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    envelopes: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    initial: tuple[InitialMotion, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all load cases, then of all combinations."""
        return (*(c.name for c in self.cases), *self.combinations)

    def all_cases(self, model: Model) -> tuple[LoadCase, ...]:
        """Return all load cases, and the combinations as load cases."""
        combined = (combine_loads(model, self.cases, f, name) for name, f in self.combinations.items())
        return (*self.cases, *combined)


def read_loads(top: StudyTable, geometry: Geometry, holders: Sequence[Effect]) -> Loads:
    """Read the load cases, combinations, envelopes and initial motions of a study.

    Parameters
    ----------
    top : Table
    geometry : Geometry
        The mesh gets points where forces act.
    holders : sequence of Effect
        Supports and joints, whose held directions may be moved.
    """
    cases: dict[str, LoadCase] = {}
    for t in top.tables("loads"):
        name = t.text("case", "load")
        cases[name] = _with_load(t, cases.get(name, LoadCase(name=name)), geometry, holders)
        t.finish()
    combinations = _combinations(top, tuple(cases))
    return Loads(
        tuple(cases.values()),
        combinations,
        _envelopes(top, (*cases, *combinations)),
        read_initial(top, geometry),
    )


def _with_load(t: StudyTable, case: LoadCase, geometry: Geometry, holders: Sequence[Effect]) -> LoadCase:
    """Return a case with one more entry of ``[[loads]]``."""
    given = [key for key in KINDS if key in t]
    if len(given) != 1:
        found = f"{' and '.join(given)} are given" if given else "none is given"
        text = f"an entry is one load, which one of {', '.join(KINDS)} names; {found}"
        t.refuse("", text) if given else t.refuse_without("point", text)
    kind = given[0]
    if kind == "point":
        return replace(case, points=_sum(case.points, _point(t, geometry)))
    if kind == "gravity":
        return replace(case, gravity=np.asarray(case.gravity) + t.vector("gravity", unit="m/s²"))
    if kind == "settlement":
        return replace(case, displacements=_sum(case.displacements, _settlement(t, holders)))
    more = _line_loads(t, geometry) if kind == "force_per_length" else _strains(t, geometry, kind)
    return replace(case, members=(*case.members, *more))


def _sum(known: Any, more: Mapping[Any, float]) -> dict[Any, float]:
    """Return the sums of the values of two mappings."""
    return {**known, **{key: known.get(key, 0.0) + value for key, value in more.items()}}


def _point(t: StudyTable, geometry: Geometry) -> dict[tuple[int, str], float]:
    """Read a force and a moment at a place."""
    if "force" not in t and "moment" not in t:
        text = "a load at a point needs force [N], moment [N·m] or both, three components each"
        t.refuse_without("force", text, [1.0, 0.0, 0.0])
    point = geometry.point(t)
    both = [*t.vector("force", np.zeros(3), unit="N"), *t.vector("moment", np.zeros(3), unit="N·m")]
    return {(point, d): float(value) for d, value in zip(DIRECTIONS, both, strict=True) if value}


def _settlement(t: StudyTable, holders: Sequence[Effect]) -> dict[Key, float]:
    """Read prescribed motions of a support or of a joint's rigid directions."""
    fixed = {
        e.name: tuple(e.fixed if isinstance(e, Support) else e.rigid)
        for e in holders
        if isinstance(e, Support | Joint)
    }
    name = t.text("support")
    if name not in fixed:
        t.refuse("support", f"there is no support or joint '{name}'; {suggest(name, fixed)}")
    inner, out = t.table("settlement"), dict[Key, float]()
    for direction in DIRECTIONS:
        value = inner.number(direction, None, unit="rad" if direction[0] == "r" else "m")
        if value is None:
            continue
        if direction not in fixed[name]:
            words = ", ".join(fixed[name]) or "no direction"
            inner.refuse(direction, f"'{name}' does not hold {direction}; it holds {words}")
        out[name, direction] = value
    inner.finish()
    if not inner.values:
        t.refuse("settlement", "no direction is moved; give such as { z = -0.002 } [m, rad]")
    return out


def _line_loads(t: StudyTable, geometry: Geometry) -> list[MemberLoad]:
    """Read a load along members: constant, or linear between two places."""
    first = t.vector("force_per_length", unit="N/m")
    last = t.vector("force_per_length2", None, unit="N/m")
    axes = t.text("axes", "global", ("global", "local"))
    members = geometry.members(t)
    if len(members) > 1 and ("start" in t or "stop" in t):
        t.refuse("start" if "start" in t.values else "stop", "it is a place on one member; name one member")
    out: list[MemberLoad] = []
    for member in members:
        start = geometry.position(t, "start", member) if "start" in t else 0.0
        stop = geometry.position(t, "stop", member) if "stop" in t else geometry.mesh.member_length(member)
        if start >= stop:
            t.refuse("stop", f"{stop:g} m does not lie behind the start at {start:g} m")
        out.append(LineLoad(member=member, force1=first, force2=last, axes=axes, start=start, stop=stop))
    return out


def _strains(t: StudyTable, geometry: Geometry, kind: str) -> list[MemberLoad]:
    """Read a change of temperature, or an initial strain."""
    members = geometry.members(t, tuple(geometry.mesh.members) if kind == "temperature" else None)
    if kind == "strain":
        return [InitialStrain(member=m, axial=t.number("strain", unit="-")) for m in members]
    expansion = t.number("expansion", above=0, unit="1/K")
    change = t.number("temperature", unit="K")
    gradients = [t.number(f"gradient_{d}", 0.0, unit="K/m") for d in "yz"]
    return [InitialStrain.thermal(m, expansion, change, *gradients) for m in members]


def _combinations(top: StudyTable, cases: tuple[str, ...]) -> dict[str, dict[str, float]]:
    """Read ``[[combinations]]``."""
    out: dict[str, dict[str, float]] = {}
    for t in top.tables("combinations"):
        name = t.text("name")
        if name in cases or name in out:
            t.refuse("name", f"a load case or combination '{name}' is there already; names must differ")
        inner = t.table("factors")
        if not inner.values:
            t.refuse("factors", "no load case is named; give such as { dead = 1.35, wind = 1.5 }")
        for case in inner.values:
            if case not in cases:
                inner.refuse(case, f"there is no load case '{case}'; {suggest(case, cases)}")
        out[name] = {case: inner.number(case) for case in inner.values}
        t.finish()
    return out


def _envelopes(top: StudyTable, names: tuple[str, ...]) -> dict[str, tuple[str, ...]]:
    """Read ``[[envelopes]]``."""
    out: dict[str, tuple[str, ...]] = {}
    for t in top.tables("envelopes"):
        name = t.text("name", f"envelope{len(out) + 1}")
        if name in out:
            t.refuse("name", f"two envelopes have the name '{name}'; names must differ")
        of = t.texts("of", names)
        for case in of:
            if case not in names:
                t.refuse("of", f"there is no load case or combination '{case}'; {suggest(case, names)}")
        if not of:
            t.refuse("", "the study has no loads for an envelope; give [[loads]]")
        out[name] = of
        t.finish()
    return out
