"""``[[effects]]`` of a study file: candidate effects that are known to be there, with their values."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from dovetail.file.table import StudyTable, no_candidate, suggest
from dovetail.file.toml import rounded, rounded_or_zero, toml_table
from fem.effects import candidate_kinds, effect_classes
from fem.effects.joint import Spread
from fem.effects.joint_nonlinear import AmplitudeDependent
from fem.model import Effect, Instruments, Model, ModelError, Parameter, inverse
from updating.measurement.measurement import Sensor, directed_of, sensor_point


def read_effects(
    top: StudyTable, model: Model, sensors: Sequence[Sensor], excitations: Sequence[Sensor]
) -> Model:
    """Return a model with ``[[effects]]``: each the name of a candidate for it, and values of its parameters.

    The tables of ``[fitted_form]``, the form of sections and connections, have that name as theirs.

    A value that is not given stays the candidate's initial one. The effect is called "known" and the
    candidate's name, so that a search may propose the candidate again. Candidates after joints' patches are
    those of a model with these, the others of one without the known effects. Those that have come since the
    baseline are candidates of a model with all others.
    """
    out: list[Effect] = []
    names = {e.name for e in model.effects}
    forms = [(t, name, f"known {name}", False) for name, t in top.table("fitted_form").named()]
    listed = top.tables("effects")
    named = [(t, t.text("candidate"), _name_of(t), _is_change(top, t)) for t in listed]
    for t, name, effect_name, change in sorted([*forms, *named], key=lambda entry: entry[-1]):
        if change:
            model, out = _with_all(model, out), []
        with t.at("candidate" if "candidate" in t.values else ""):
            effect = candidate_named(name, model, sensors, excitations)
        values = _values_in(t, effect)
        if isinstance(effect, AmplitudeDependent):
            effect = replace(
                effect, amplitude=t.number("amplitude", effect.amplitude, above=0, unit="m or rad")
            )
        if effect_name in names:
            t.refuse("name", f"the model has two effects '{effect_name}'; names must differ")
        names.add(effect_name)
        t.finish()
        effect = replace(effect.with_values(**values), name=effect_name)
        if isinstance(effect, Spread):
            model = effect.added_to(model)
        else:
            out.append(effect)
    return _with_all(model, out)


def _with_all(model: Model, effects: Sequence[Effect]) -> Model:
    for effect in effects:
        model = effect.added_to(model)
    return model


def _name_of(t: StudyTable) -> str:
    return t.text("name", f"known {t.text('candidate')}")


def _is_change(top: StudyTable, t: StudyTable) -> bool:
    """Whether an effect has come since the baseline."""
    change = t.flag("since_baseline", False)
    if change and "baseline" not in top.values:
        t.refuse("since_baseline", "the study has no [baseline], the state before the effect")
    return change


def read_changes(top: StudyTable) -> tuple[str, ...]:
    """Return the names of the known effects that have come since the baseline."""
    return tuple(_name_of(t) for t in top.tables("effects") if t.flag("since_baseline", False))


def known_candidates(top: StudyTable) -> tuple[Any, ...]:
    """Return what ``[[effects]]`` names as candidates, before the model that they are for is made."""
    listed = top.values.get("effects", [])
    tables = listed if isinstance(listed, list) else []
    return tuple(t.get("candidate") for t in tables if isinstance(t, dict))


def read_values(top: StudyTable, model: Model) -> Model:
    """Return a model with ``[values.EFFECT]``: values of parameters that no other table has a place for."""
    for name, t in top.table("values").named():
        known = {e.name: e for e in model.effects}
        if name not in known:
            t.refuse("", f"the model has no effect '{name}'; {suggest(name, known)}")
        forms = _forms(known[name])
        for key in t.values:
            if key not in forms:
                t.refuse(key, f"effect '{name}' has no such parameter; {suggest(key, forms)}")
        values = _values_in(t, known[name])
        model = model.with_values({(name, key): value for key, value in values.items()})
    return model


def _forms(effect: Effect) -> dict[str, tuple[Parameter, Parameter]]:
    """Return the names under which an effect takes values: a parameter's form of that name, and itself."""
    own = effect.parameters()
    known = {p.name: (p, p) for p in own}
    return {r.name: (r, p) for p in own if (r := p.reciprocal) is not None} | known


def _values_in(t: StudyTable, effect: Effect) -> dict[str, float]:
    """Return the values of a table by the names of an effect's parameters."""
    values: dict[str, float] = {}
    for key, (form, p) in _forms(effect).items():
        if key in t:
            with t.at(key):
                values[p.name] = _own_value(form, p, t.number(key, infinite=form is not p), values)
    return values


def _own_value(
    form: Parameter, p: Parameter, value: float, others: Mapping[str, float], *, named: bool = False
) -> float:
    """Return a parameter's value from that of one of its forms, within its bounds and given once.

    Errors name the form if ``named``; a study file names it by its place.
    """
    if p.name in others:
        msg = f"'{form.name}' is 1/{_other_form(form, p)}, which is given too; one of them is needed"
        raise ModelError(msg)
    if not form.lower <= value <= form.upper:
        unit = "" if form.unit == "-" else f" {form.unit}"
        found = f"{f'{form.name} = ' if named else ''}{value:g}{unit}"
        if np.isinf(form.upper):
            msg = f"{found} is not allowed; at least {form.lower:.3g}{unit} is needed"
        else:
            msg = f"{found} is not between {form.lower:g} and {form.upper:g}{unit}"
        raise ModelError(msg)
    return value if form is p else inverse(value)


def _other_form(form: Parameter, p: Parameter) -> str:
    return p.name if form is not p or p.reciprocal is None else p.reciprocal.name


def candidate_named(
    name: str, model: Model, sensors: Sequence[Sensor], excitations: Sequence[Sensor]
) -> Effect:
    """Return the candidate with a name, such as ``"point_mass:beam"``, at the values that it begins with.

    Raises
    ------
    ModelError
        If the model has no such candidate; the message names the nearest.
    """
    kind = name.partition(":")[0]
    if kind not in candidate_kinds():
        msg = f"there is no kind of effect '{kind}'; {suggest(kind, candidate_kinds())}"
        raise ModelError(msg)
    by_name = {e.name: e for e in candidates_of(kind, model, sensors, excitations)}
    if name not in by_name:
        raise ModelError(no_candidate(name, list(by_name)))
    return by_name[name]


def with_given_values(effect: Effect, values: Mapping[str, float]) -> Effect:
    """Return an effect with values for some of its parameters, by name.

    A stiffness may be given as ``compliance``, and the other way round. An effect that depends on amplitude
    takes ``amplitude`` [m or rad], too.

    Raises
    ------
    ModelError
        If it has no such parameter, or a value is no number or is beyond the bounds.
    """
    forms, own = _forms(effect), {}
    new = dict(values)
    if isinstance(effect, AmplitudeDependent) and "amplitude" in new:
        amplitude = _finite(effect, "amplitude", new.pop("amplitude"))
        if amplitude <= 0:
            msg = f"'{effect.name}': amplitude is {amplitude:g}; it must be above 0"
            raise ModelError(msg)
        effect = replace(effect, amplitude=amplitude)
    for key, value in new.items():
        if key not in forms:
            msg = f"'{effect.name}' has no parameter '{key}'; {_allowed(form for form, _ in forms.values())}"
            raise ModelError(msg)
        form, p = forms[key]
        number = _finite(effect, key, value, form.upper if form is not p else np.nan)
        try:
            own[p.name] = _own_value(form, p, number, own, named=True)
        except ModelError as reason:
            msg = f"'{effect.name}': {reason}"
            raise ModelError(msg) from reason
    return effect.with_values(**own) if own else effect


def _finite(effect: Effect, key: str, value: Any, most: float = np.nan) -> float:
    """Return a value as a number that is finite, or the most, which may be that of a rigid connection."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = np.nan
    if not np.isfinite(number) and number != most:
        msg = f"'{effect.name}': {key} is '{value}'; a finite number is needed"
        raise ModelError(msg)
    return number


def _allowed(parameters: Iterable[Parameter]) -> str:
    """Return parameters with their bounds and units in words."""
    listed = [
        f"{p.name} ({f'at least {p.lower:g}' if np.isinf(p.upper) else f'{p.lower:g} to {p.upper:g}'}"
        f"{'' if p.unit == '-' else f' {p.unit}'})"
        for p in parameters
    ]
    return f"allowed are {', '.join(listed) or 'none'}"


def candidates_of(
    kind: str, model: Model, sensors: Sequence[Sensor], excitations: Sequence[Sensor]
) -> tuple[Effect, ...]:
    """Return the candidates of a kind for a model and its instruments."""
    return effect_classes()[kind].propose(model.with_instruments(_instruments(model, sensors, excitations)))


def effect_table(effect: Effect, candidate: str, name: str = "", *, since_baseline: bool = False) -> str:
    """Return the ``[[effects]]`` entry of an effect that a search has found.

    Parameters
    ----------
    effect : Effect
        With its values.
    candidate : str
        Name of the candidate that it was.
    name : str
        Its own name, where it is not "known" and the candidate's.
    since_baseline : bool
        Whether the first of two states does not have it.
    """
    values: dict[str, Any] = {"candidate": candidate} | ({"name": name} if name else {})
    values |= {"since_baseline": True} if since_baseline else {}
    values |= written_values(effect)
    if isinstance(effect, AmplitudeDependent):
        values["amplitude"] = float(effect.amplitude)
    return toml_table("[[effects]]", rounded(values))


def _instruments(model: Model, sensors: Sequence[Sensor], excitations: Sequence[Sensor]) -> Instruments:
    points = [
        np.array([sensor_point(model.mesh, s) for s in g], dtype=np.int64)
        for g in (directed_of(sensors), excitations)
    ]
    axes = [
        np.array([s.direction for s in g], dtype=float).reshape(-1, 3)
        for g in (directed_of(sensors), excitations)
    ]
    return Instruments(points[0], axes[0], points[1], axes[1])


def written_values(effect: Effect) -> dict[str, float]:
    """Return an effect's values as a study file holds them: 0 for what rounding leaves of zero.

    Rounding is relative to 1 in a number without unit, and else to the largest value of the effect in the
    same unit.
    """
    sizes = {"-": 1.0}
    for p in effect.parameters():
        sizes[p.unit] = max(sizes.get(p.unit, 0.0), abs(float(p.value)))
    return {p.name: rounded_or_zero(float(p.value), sizes[p.unit]) for p in effect.parameters()}
