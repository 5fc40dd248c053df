"""``[[effects]]`` of a study file: candidate effects that are known to be there, with their values."""

from collections.abc import Sequence
from dataclasses import replace
from difflib import get_close_matches
from typing import Any

import numpy as np

from dovetail.file.table import LEAST, Table, suggest
from dovetail.file.toml import toml_table
from fem.effects import candidate_kinds, effect_classes
from fem.effects.joint import Spread
from fem.effects.joint_nonlinear import AmplitudeDependent
from fem.model import Effect, Instruments, Model, Parameter
from updating.measurement.measurement import Sensor, sensor_point


def read_effects(top: Table, model: Model, sensors: Sequence[Sensor], excitations: Sequence[Sensor]) -> Model:
    """Return a model with ``[[effects]]``: each the name of a candidate for it, and values of its parameters.

    A value that is not given stays what the candidate begins with. The effect is called "known" and the
    candidate's name, so that a search may propose the candidate again. Candidates after joints' patches are
    those of a model with these, the others of one without what is known.
    """
    out: list[Effect] = []
    names = {e.name for e in model.effects}
    for t in top.tables("effects"):
        name = t.text("candidate")
        kind = name.partition(":")[0]
        if kind not in candidate_kinds():
            t.refuse("candidate", f"there is no kind of effect '{kind}'; {suggest(kind, candidate_kinds())}")
        by_name = {e.name: e for e in candidates_of(kind, model, sensors, excitations)}
        if name not in by_name:
            near = get_close_matches(name, by_name, 3, 0.3) or list(by_name)[:3]
            among = f"; the nearest are {', '.join(near)}" if near else ", nor another of this kind"
            t.refuse("candidate", f"the model has no candidate '{name}'{among}")
        effect = by_name[name]
        values = {p.name: t.number(p.name, p.value) for p in effect.parameters()}
        for p in effect.parameters():
            if p.name in t.values:
                _within(t, p.name, values[p.name], p)
        if isinstance(effect, AmplitudeDependent):
            effect = replace(
                effect, amplitude=t.number("amplitude", effect.amplitude, above=0, unit="m or rad")
            )
        own = t.text("name", f"known {name}")
        if own in names:
            t.refuse("name", f"the model has two effects '{own}'; names must differ")
        names.add(own)
        t.finish()
        effect = replace(effect.with_values(**values), name=own)
        if isinstance(effect, Spread):
            model = effect.added_to(model)
        else:
            out.append(effect)
    for effect in out:
        model = effect.added_to(model)
    return model


def read_values(top: Table, model: Model) -> Model:
    """Return a model with ``[values.EFFECT]``: values of parameters that no other table has a place for."""
    for name, t in top.table("values").named():
        known = {e.name: e for e in model.effects}
        if name not in known:
            t.refuse("", f"the model has no effect '{name}'; {suggest(name, known)}")
        parameters = {p.name: p for p in known[name].parameters()}
        values = {}
        for key in t.values:
            if key not in parameters:
                t.refuse(key, f"effect '{name}' has no such parameter; {suggest(key, parameters)}")
            values[key] = _within(t, key, t.number(key), parameters[key])
        model = model.with_values({(name, key): value for key, value in values.items()})
    return model


def _within(t: Table, key: str, value: float, p: Parameter) -> float:
    """Return a value; refuse one beyond its parameter's bounds."""
    if not p.lower <= value <= p.upper:
        unit = "" if p.unit == "-" else f" {p.unit}"
        t.refuse(key, f"{value:g}{unit} is not between {p.lower:g} and {p.upper:g}{unit}")
    return value


def candidates_of(
    kind: str, model: Model, sensors: Sequence[Sensor], excitations: Sequence[Sensor]
) -> tuple[Effect, ...]:
    """Return the candidates of a kind for a model and what was measured on it."""
    return effect_classes()[kind].propose_for_test(model, _instruments(model, sensors, excitations))


def effect_table(effect: Effect, candidate: str, name: str = "") -> str:
    """Return the ``[[effects]]`` entry that stands for an effect that a search has found.

    Parameters
    ----------
    effect : Effect
        With its values.
    candidate : str
        Name of the candidate that it was.
    name : str
        Its own name, where it is not "known" and the candidate's.
    """
    values: dict[str, Any] = {"candidate": candidate} | ({"name": name} if name else {})
    values |= {p.name: _written(float(p.value)) for p in effect.parameters()}
    if isinstance(effect, AmplitudeDependent):
        values["amplitude"] = float(effect.amplitude)
    return toml_table("[[effects]]", values)


def _instruments(model: Model, sensors: Sequence[Sensor], excitations: Sequence[Sensor]) -> Instruments:
    points = [
        np.array([sensor_point(model.mesh, s) for s in g], dtype=np.int64) for g in (sensors, excitations)
    ]
    axes = [np.array([s.direction for s in g], dtype=float).reshape(-1, 3) for g in (sensors, excitations)]
    return Instruments(points[0], axes[0], points[1], axes[1])


def _written(value: float) -> float:
    """Return a value as a study file may hold it: no quantity is as small as rounding leaves of zero."""
    return 0.0 if abs(value) < LEAST else value
