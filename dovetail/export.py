"""Results for other programs: a study's model, or what was found of it, as a deck."""

import json
import math
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.file.contents import SourceDeck, StudyContents
from dovetail.file.table import StudyError
from dovetail.report import words
from dovetail.result import program_version
from fem.analysis.modes import first_modes
from fem.effects.instrument_form import DriverForm, SensorForm
from fem.effects.instruments import DriverMass, SensorMass, Stinger
from fem.io import programs
from fem.io.abaqus_changes import abaqus_changes
from fem.io.abaqus_write import abaqus_text
from fem.io.ansys_changes import ansys_changes
from fem.io.ansys_write import ansys_text
from fem.io.deck_changes import changed_deck
from fem.io.deck_nodes import with_nodes
from fem.io.deck_units import DeckUnits
from fem.io.frame_model import model_of, read_deck
from fem.io.frame_of_model import ModelDeck, deck_of, with_places
from fem.io.nastran_changes import nastran_changes
from fem.io.nastran_write import nastran_text
from fem.io.source_changes import DeckEdit
from fem.lengths import shown_length
from fem.model import Model, ParameterRef, parameter_values
from fem.system import assemble
from updating.diagnosis.evidence.places import place_of
from updating.diagnosis.findings import EffectParameter, scale_of

WRITERS: Mapping[str, Callable[..., str]] = {
    "nastran": nastran_text,
    "abaqus": abaqus_text,
    "ansys": ansys_text,
}
CHANGES: Mapping[str, Callable[[ModelDeck, Path, DeckUnits], DeckEdit]] = {
    "nastran": nastran_changes,
    "abaqus": abaqus_changes,
    "ansys": ansys_changes,
}
"""Writers of cards that change a deck."""
RESULT = "result.json"
OF_THE_TEST = (SensorForm, DriverForm, SensorMass, DriverMass, Stinger)
"""Effects of instruments, which the structure does not have."""


@dataclass(frozen=True, slots=True)
class Fitted:
    """An uncertain parameter with another value than before.

    Attributes
    ----------
    nominal : float
        The value before.
    text : str
        Both in words.
    sure : bool
        Whether they differ by more than the standard deviation.
    """

    nominal: float
    text: str
    sure: bool


@dataclass(frozen=True, slots=True, eq=False)
class Exported:
    """What of a study is exported.

    Attributes
    ----------
    model, before : Model
        The structure without the test's instruments, and the same without what was found.
    found : mapping of str to str
        Values of effects in words by name.
    lines, notes : tuple of str
        Sentences on what was found, and on what is left out.
    """

    model: Model
    before: Model
    found: Mapping[str, str]
    lines: tuple[str, ...]
    notes: tuple[str, ...]


def exported_deck(
    study: StudyContents, *, whole: bool, effects_only: bool = False
) -> tuple[ModelDeck, tuple[str, ...]]:
    """Return a study's model as a deck, or the cards for what was found, and sentences on what they are.

    Cards for what was found leave out fitted values within a standard deviation of the nominal ones.

    Raises
    ------
    StudyError
        If cards for what was found are asked for, and the study has no effects and no fitted values.
    """
    if whole:
        found = _effects(study, _result(study), whole=True)[0]
        lines = (f"model of {_head(study)}", *_lines(found))
        return _titled(deck_of(study.model, study.name), found), lines
    one = exported(study, effects_only=effects_only)
    if not one.found and one.model is one.before:
        values = "" if effects_only else f", and no {RESULT} with fitted values is next to it"
        raise StudyError(_no_effects(study, one, f"{values}; --whole exports the model"))
    deck = changed_deck(deck_of(one.model, study.name), deck_of(one.before, study.name))
    deck = _titled(deck, one.found)
    return replace(deck, notes=(*one.notes, *deck.notes)), one.lines


def exported_edit(
    study: StudyContents, source: SourceDeck, *, effects_only: bool = False
) -> tuple[DeckEdit, Exported]:
    """Return the cards that make a study's source deck the study's model, and that model.

    Fitted values within a standard deviation of the nominal ones are left out, as are the test's instruments;
    with ``effects_only`` all fitted values are.

    Raises
    ------
    StudyError
        If the model is that of the deck, or has no effects where these alone are asked for.
    MeshError
        If the deck cannot be read.
    SourceError
        If cards cannot keep its numbers.
    """
    nodes = model_of(read_deck(source.file, source.units)).mesh.points if effects_only else None
    one = exported(study, effects_only=effects_only, nodes=nodes)
    if effects_only and not one.found:
        raise StudyError(_no_effects(study, one, "; dovetail run writes them into found.toml"))
    deck = _titled(deck_of(one.model, study.name), one.found)
    edit = CHANGES[program_of(source.file)](deck, source.file, DeckUnits.of(source.units))
    if not edit.lines and not edit.notes:
        msg = f"{study.path}: its model is that of {source.file.name}: there is nothing to export"
        raise StudyError(msg)
    return replace(edit, notes=[*one.notes, *deck.notes, *edit.notes]), one


def differences(deck: Path, source: SourceDeck, model: Model) -> tuple[float, float]:
    """Return the largest relative differences of a deck's first frequencies from those of a model [-].

    The first is to the model, with nodes where members carry masses or crack. The second is to the model as
    a deck has it, where the node behind a released end moves freely; it is infinite if no end is released.

    Raises
    ------
    MeshError
        If the deck cannot be read.
    """
    whole = deck_of(model)
    as_deck = model_of(with_nodes(whole, arms=None))
    # Modes by which a merged deck is compared with its model
    one, *others = (
        first_modes(assemble(m, reciprocal=False), 10).frequency
        for m in (model_of(read_deck(deck, source.units)), with_places(model)[0], as_deck)
    )
    out = []
    for other in others:
        n = min(len(one), len(other))
        moving = other[:n] > 1e-3 * other[:n].max(initial=0.0)  # rigid motions have no frequency to compare
        out.append(float(np.abs(one[:n][moving] / other[:n][moving] - 1).max(initial=0.0)))
    return out[0], out[1] if np.isfinite(whole.bars.stiffness).any() else math.inf


def program_of(deck: Path) -> str:
    """Return the program of a deck, empty for other files."""
    return (programs.program_of(deck) or "").lower()


def _no_effects(study: StudyContents, one: Exported, remedy: str) -> str:
    """Return why a study has no effects to export: it has none, or no card is for them."""
    if "effects" in tomllib.loads(study.text):
        return f"{study.path}: no card is for its [[effects]]: {'; '.join(one.notes)}"
    return f"{study.path}: it has no [[effects]]{remedy}"


def _head(study: StudyContents) -> str:
    return f"{study.path.name}, study {study.name}; dovetail {program_version()}"


def exported(
    study: StudyContents, *, effects_only: bool = False, nodes: NDArray[np.float64] | None = None
) -> Exported:
    """Return the model to export, and the same without what was found.

    With ``effects_only`` all uncertain parameters, and the form, are as before they were fitted, and effects
    are at the nearest of the deck's ``nodes`` (n, 3) [m] that is within the standard deviation of their
    position: no element need then be divided.
    """
    result = _result(study)
    (found, zero, std), nominal = _effects(study, result), _nominal(study.model, result)
    placed = {} if nodes is None else _at_nodes(study.model, std, nodes)
    head = _head(study)
    out = {
        e.name: "it belongs to the test, not to the structure"
        if isinstance(e, OF_THE_TEST)
        else "uncertain form"
        if effects_only
        else "uncertain form that is zero within its standard deviation"
        for e in study.model.effects
        if isinstance(e, OF_THE_TEST)
        or (e.is_form and (effects_only or len(zero.get(e.name, {})) == len(e.parameters())))
    }
    left = {(name, p): absent for name, of in zero.items() if name not in out for p, absent in of.items()}
    model = study.model.without_effect(*out).with_values(left)
    fitted = {ref: each for ref, each in nominal.items() if ref[0] not in found}
    # a part has its model in the other program: change that, rather than add thousands of entries to it
    parts = {e.name for e in model.effects if e.reduced_part}
    sure = {ref: each for ref, each in fitted.items() if each.sure and not effects_only}
    moved = {ref: each for ref, each in sure.items() if ref[0] not in parts}
    model = model.with_values({ref: each.nominal for ref, each in fitted.items() if ref not in moved})
    before = model.without_effect(*(name for name in found if name not in out)).with_values(
        {ref: each.nominal for ref, each in moved.items()}
    )
    found = {name: text for name, text in found.items() if name not in out}
    model = model.with_values({ref: s for ref, s in placed.items() if ref[0] not in out})
    notes = [
        f"{ref[0]}: at the nearest node, {_apart(study.model, ref, s)} away, within the standard deviation "
        "of its position"
        for ref, s in placed.items()
    ]
    notes += [
        f"not in this file, {why}: {', '.join(name for name, other in out.items() if other == why)}"
        for why in dict.fromkeys(out.values())
    ]
    notes += [
        f"not in this file, change the part's own model: {ref[0]}: {each.text}"
        for ref, each in sure.items()
        if ref not in moved
    ]
    if unsure := [*(ref for ref in fitted if ref not in sure), *left]:
        names = ", ".join(f"{e} {p}" for e, p in unsure)
        why = (
            "as before the fit" if effects_only else "fitted within a standard deviation of the value before"
        )
        notes.append(f"not in this file, {why}: {names}")
    lines = (f"found by {head}", *_lines(found), *(f"{ref[0]}: {each.text}" for ref, each in moved.items()))
    return Exported(model, before if found or moved else model, found, lines, tuple(notes))


def _at_nodes(
    model: Model, std: Mapping[ParameterRef, float], nodes: NDArray[np.float64]
) -> dict[ParameterRef, float]:
    """Return positions along members of nodes that are nearer than positions of effects are known [m]."""
    out = {}
    for name in dict.fromkeys(effect for effect, _ in std):
        effect = model.effect(name)
        for p in (p for p in effect.parameters() if p.position):
            here = effect.locations(model)[0]
            near = nodes[np.argmin(np.linalg.norm(nodes - here, axis=1))]
            member, s, off = model.mesh.nearest_on_members(near)
            same = member == place_of(effect)[1].removeprefix("member ") and off <= 1e-6 * model.mesh.size
            if same and 0 < abs(s - p.value) <= std[name, p.name]:
                out[name, p.name] = s
    return out


def _apart(model: Model, ref: ParameterRef, position: float) -> str:
    value, unit = shown_length(abs(position - model.values()[ref]))
    return f"{value:.2g} {unit}"


def _lines(found: Mapping[str, str]) -> list[str]:
    return [f"{name}: {text}" for name, text in found.items()]


def _titled(deck: ModelDeck, found: Mapping[str, str]) -> ModelDeck:
    """Return a deck whose cards are commented with the values of the effects that they are of."""

    def named(item: Any) -> Any:
        texts = [text for name, text in found.items() if name in item.name.split(" with ")]
        return replace(item, name=": ".join([item.name, *texts]))

    keys = ("bodies", "connections", "links", "equations", "matrices")
    return replace(deck, **{key: tuple(named(item) for item in getattr(deck, key)) for key in keys})


def _result(study: StudyContents) -> dict[str, Any]:
    """Return the result in a study's folder, empty without one."""
    path = study.path.parent / RESULT
    try:
        found = json.loads(path.read_text("utf-8")) if path.is_file() else {}
    except ValueError as reason:
        msg = f"{path}: it is no result of dovetail run ({reason})"
        raise StudyError(msg) from reason
    return found if isinstance(found, dict) else {}


def _effects(
    study: StudyContents, result: Mapping[str, Any], *, whole: bool = False
) -> tuple[dict[str, str], dict[str, dict[str, float]], dict[ParameterRef, float]]:
    """Return the values of a study's [[effects]] and [fitted_form] in words by name, with ± of a result.

    The second value has by name the parameters of forms that are zero within a standard deviation, each with
    its value of no effect; the words leave them out. ``whole`` leaves nothing out. The third has the standard
    deviations, NaN where the result has none.
    """
    std = {
        (e["name"], p["name"]): p["std"]
        for e in result.get("effects", [])
        for p in e["parameters"]
        if p["std"]
    }
    std |= {tuple(u["name"].rsplit(".", 1)): u["std"] for u in result.get("uncertain", []) if u["std"]}
    out: dict[str, str] = {}
    zero: dict[str, dict[str, float]] = {}
    stds: dict[ParameterRef, float] = {}
    tree = tomllib.loads(study.text)
    added = [(t.get("name", f"known {t['candidate']}"), t["candidate"]) for t in tree.get("effects", [])]
    for name, candidate in (*added, *((f"known {form}", form) for form in tree.get("fitted_form", {}))):
        effect = study.model.effect(name)
        known = [(p, std.get((candidate, p.name), math.nan)) for p in effect.parameters()]
        stds |= {(name, p.name): error for p, error in known}
        zero[name] = {
            p.name: p.absent
            for p, error in known
            if effect.is_form and not whole and abs(p.value - p.absent) <= error
        }
        values = [
            words.parameter_text(EffectParameter(p.name, p.value, p.unit, error, scale=scale_of(p)), p)
            for p, error in known
            if p.name not in zero[name]
        ]
        out[name] = f"{effect.where}: {', '.join(values)}"
    return out, zero, stds


def _nominal(model: Model, result: Mapping[str, Any]) -> dict[ParameterRef, Fitted]:
    """Return the parameters that a run has fitted."""
    refs = {f"{effect}.{parameter}": (effect, parameter) for effect, parameter in model.values()}
    out = {}
    for u in result.get("uncertain", []):
        ref = refs.get(u["name"])
        # not fitted: an effect that was found replaces it
        if ref is None or u["nominal"] is None or u["fitted"] in (None, u["nominal"]):
            continue
        value = parameter_values(model.effect(ref[0]))[ref[1]]
        std = math.nan if u["std"] is None else u["std"]
        text = words.with_unit(value, u["unit"], std)
        text = f"{ref[1]} {text} instead of {words.with_unit(u['nominal'], u['unit'])}"
        out[ref] = Fitted(u["nominal"], text, not abs(value - u["nominal"]) <= std)
    return out
