"""Results for other programs: a study's model, or what was found of it, as a deck."""

import math
import tomllib
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.file.contents import SourceDeck, StudyContents
from dovetail.file.estimates import estimate_key
from dovetail.file.table import StudyError
from dovetail.report import words
from dovetail.result import parameter_in_words, program_version
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
from fem.lengths import rough_length
from fem.model import Model, ParameterRef
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
    study: StudyContents, *, whole: bool, fitted: bool = False
) -> tuple[ModelDeck, tuple[str, ...]]:
    """Return a study's model as a deck, or the cards for what was found, and sentences on what they are.

    Cards for what was found leave out fitted values within a standard deviation of the nominal ones.

    Raises
    ------
    StudyError
        If cards for what was found are asked for, and the study has no effects and no fitted values.
    """
    if whole:
        found = _effects(study, whole=True)[0]
        lines = (f"model of {_head(study)}", *_lines(found))
        return _titled(deck_of(study.model, study.name), found), lines
    nodes = study.model.mesh.points if not fitted else None
    one = exported(study, fitted=fitted, nodes=nodes)
    if not one.found and one.model is one.before:
        values = ", and no fitted values in [estimates]" if fitted else ""
        more = "" if fitted else "--fitted exports fitted values, "
        raise StudyError(_no_effects(study, one, f"{values}; {more}--whole exports the model"))
    deck = changed_deck(deck_of(one.model, study.name), deck_of(one.before, study.name))
    deck = _titled(deck, one.found)
    return replace(deck, notes=(*one.notes, *deck.notes)), one.lines


def exported_edit(
    study: StudyContents, source: SourceDeck, *, fitted: bool = False
) -> tuple[DeckEdit, Exported]:
    """Return the cards that make a study's source deck the study's model, and that model.

    They are for the effects, without the test's instruments; with ``fitted`` also for fitted values farther
    than their standard deviation from the nominal ones, and for the form outside its usual range.

    Raises
    ------
    StudyError
        If the model is that of the deck, or has no effects where these alone are asked for.
    MeshError
        If the deck cannot be read.
    SourceError
        If cards cannot keep its numbers.
    """
    nodes = model_of(read_deck(source.file, source.units)).mesh.points if not fitted else None
    one = exported(study, fitted=fitted, nodes=nodes)
    if not fitted and not one.found:
        remedy = (
            "; dovetail run writes them into found.toml, and --fitted exports fitted values and other changes"
        )
        raise StudyError(_no_effects(study, one, remedy))
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
    study: StudyContents, *, fitted: bool = False, nodes: NDArray[np.float64] | None = None
) -> Exported:
    """Return the model to export, and the same without what was found.

    Unless ``fitted``, all uncertain parameters, and the form, are as before they were fitted, and effects
    are at the nearest of the deck's ``nodes`` (n, 3) [m] that is within the standard deviation of their
    position: no element need then be divided.
    """
    found, usual, std = _effects(study)
    values = _fitted(study, found)
    placed = {} if nodes is None else _at_nodes(study.model, std, nodes)
    head = _head(study)
    out = {
        e.name: "it belongs to the test, not to the structure"
        if isinstance(e, OF_THE_TEST)
        else "uncertain form; --fitted exports what of it the report names"
        if not fitted
        else "form within its usual range"
        for e in study.model.effects
        if isinstance(e, OF_THE_TEST)
        or (e.is_form and (not fitted or len(usual.get(e.name, {})) == len(e.parameters())))
    }
    left = {(name, p): absent for name, of in usual.items() if name not in out for p, absent in of.items()}
    model = study.model.without_effect(*out).with_values(left)
    # a part has its model in the other program: change that, rather than add thousands of entries to it
    parts = {e.name for e in model.effects if e.reduced_part}
    sure = {ref: each for ref, each in values.items() if each.sure and fitted}
    moved = {ref: each for ref, each in sure.items() if ref[0] not in parts}
    model = model.with_values({ref: each.nominal for ref, each in values.items() if ref not in moved})
    before = model.without_effect(*(name for name in found if name not in out)).with_values(
        {ref: each.nominal for ref, each in moved.items()}
    )
    found = {name: text for name, text in found.items() if name not in out}
    model = model.with_values({ref: s for ref, s in placed.items() if ref[0] not in out})
    named = {e.name: words.effect_label(e.kind, e.where) for e in study.model.effects}
    notes = [
        f"{named[ref[0]]}: at the nearest node, {rough_length(abs(s - study.model.values()[ref]))} away, "
        "within the standard deviation of its position"
        for ref, s in placed.items()
    ]
    notes += [
        f"not in this file, {why}: {'; '.join(named[name] for name, other in out.items() if other == why)}"
        for why in dict.fromkeys(out.values())
    ]
    notes += [
        f"not in this file, change the part's own model: {each.text}"
        for ref, each in sure.items()
        if ref not in moved
    ]
    if others := [each.text for each in values.values() if each.sure and not fitted]:
        notes.append(f"not in this file, fitted values; --fitted exports them: {'; '.join(others)}")
    near = "fitted within a standard deviation of the value before"
    unsure = [ref for ref, each in values.items() if not each.sure]
    for why, refs in ((near, unsure), ("form within its usual range", left)):
        if refs:
            notes.append(f"not in this file, {why}: {'; '.join(in_words(study.model, ref) for ref in refs)}")
    lines = (f"found by {head}", *_lines(found), *(each.text for each in moved.values()))
    return Exported(model, before if found or moved else model, found, lines, tuple(notes))


def in_words(model: Model, ref: ParameterRef) -> str:
    """Return a parameter of a model's effect in words."""
    unit = next(p.unit for p in model.effect(ref[0]).parameters() if p.name == ref[1])
    return parameter_in_words(model, ".".join(ref), unit)


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


def _lines(found: Mapping[str, str]) -> list[str]:
    return [f"{name}: {text}" for name, text in found.items()]


def _titled(deck: ModelDeck, found: Mapping[str, str]) -> ModelDeck:
    """Return a deck whose cards are commented with the values of the effects that they are of."""

    def named(item: Any) -> Any:
        texts = [text for name, text in found.items() if name in item.name.split(" with ")]
        return replace(item, name=": ".join([item.name, *texts]))

    keys = ("bodies", "connections", "links", "equations", "matrices")
    return replace(deck, **{key: tuple(named(item) for item in getattr(deck, key)) for key in keys})


def _effects(
    study: StudyContents, *, whole: bool = False
) -> tuple[dict[str, str], dict[str, dict[str, float]], dict[ParameterRef, float]]:
    """Return the values of a study's [[effects]] and [fitted_form] in words by name, with ± of [estimates].

    The second value has by name the parameters of forms that are within their usual range, so that no
    report names them, each with its value of no effect; the words leave them out. ``whole`` leaves nothing
    out. The third has the standard deviations, NaN where the study has none.
    """
    out: dict[str, str] = {}
    usual: dict[str, dict[str, float]] = {}
    stds: dict[ParameterRef, float] = {}
    tree = tomllib.loads(study.text)
    added = [(t.get("name", f"known {t['candidate']}"), t["candidate"]) for t in tree.get("effects", [])]
    for name, candidate in (*added, *((f"known {form}", form) for form in tree.get("fitted_form", {}))):
        effect = study.model.effect(name)
        known = [(p, study.estimates.get(estimate_key(candidate, p.name))) for p in effect.parameters()]
        stds |= {(name, p.name): math.nan if e is None else e.std for p, e in known}
        usual[name] = {
            p.name: p.absent
            for p, e in known
            if effect.is_form and not whole and e is not None and not e.outside
        }
        values = [
            words.parameter_text(
                EffectParameter(p.name, p.value, p.unit, stds[name, p.name], scale=scale_of(p)), p
            )
            for p, _ in known
            if p.name not in usual[name]
        ]
        out[name] = f"{effect.where}: {', '.join(values)}"
    return out, usual, stds


def _fitted(study: StudyContents, added: Collection[str]) -> dict[ParameterRef, Fitted]:
    """Return the parameters that fits have changed, but for those of effects that were added."""
    out = {}
    for effect in (e for e in study.model.effects if e.name not in added and not e.is_form):
        for p in effect.parameters():
            e = study.estimates.get(estimate_key(effect.name, p.name))
            if e is None or math.isnan(e.before) or e.before == p.value:
                continue
            text = words.with_unit(p.value, p.unit, e.std)
            before = words.with_unit(e.before, p.unit)
            text = f"{in_words(study.model, (effect.name, p.name))} {text} instead of {before}"
            out[effect.name, p.name] = Fitted(e.before, text, not abs(p.value - e.before) <= e.std)
    return out
