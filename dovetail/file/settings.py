"""Read the settings of analyses: ``[fit]``, ``[form]``, ``[relevant]``, ``[frequency]``, ``[candidates]``."""

import tomllib
from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path

import numpy as np

from dovetail.file.lines import key_lines
from dovetail.file.table import Source, StudyTable, suggest
from fem.declarations import Environment, PriorBelief, Relevant, SectionTolerance
from fem.effects import candidate_kinds
from fem.effects.places import frame_of
from fem.model import Model
from fem.sections.tolerance import constants_std
from updating.inference.defaults import EXPLAINED_LEVEL
from updating.inference.form import USUAL_FORM

DEFAULT_FREQUENCY = 1000.0
"""Highest frequency of interest where neither a measurement nor the study gives one [Hz]."""

MOST_LINES = 1_000_000
"""Largest number of frequency lines; a larger one is taken for a mistake."""

SHARES = {"mass": ("A",), "bending": ("Iy", "Iz"), "torsion": ("J",), "shear": ("shear",)}
"""Keys of ``[form]``, and the constants of a section whose relative deviation they state."""
MOST_SHARE = 0.5
"""Largest relative standard deviation of these [-]."""

N_BANDS, N_MAP_BANDS = 6, 8
"""Equal bands in which FRFs are compared: in tables, unless the caller says otherwise, and in pictures."""


def read_model_error(fit: StudyTable) -> float:
    """Return the level that beams may leave [nepers]; 0 where the study states that the form is right."""
    stated = fit.number("model_error", None, least=0.0, unit="neper")
    if fit.flag("form", True):
        return EXPLAINED_LEVEL if stated is None else stated
    if stated:
        fit.refuse("form", f"it is false, but model_error is {stated:g}: beams may then err")
    return 0.0


def with_stated_form(top: StudyTable, model: Model, folder: Path, *, form: bool) -> Model:
    """Return a model with what ``[form]`` states, if its ``form`` varies; files are in a folder.

    How well sections are known, of all members and of some, and what was learned from other frames.
    """
    t = top.table("form")
    if t.values and not form:
        t.refuse("", "[fit] says that sections are as drawn: nothing of them is uncertain")
    file = t.text("file", None)
    if file is not None:
        with t.at("file"):
            model = model.with_belief(replace(model.belief, form=_read_learned(folder / file)))
    parts = t.tables("parts")
    out = [_tolerance(t, model), *(_tolerance(part, model, part.texts("members")) for part in parts)]
    return model.with_tolerances(*(t for t in out if t.size is not None or t.shares))


def _read_learned(path: Path) -> dict[str, dict[str, tuple[float, float]]]:
    """Read what was learned of the form: means and standard deviations by place and parameter."""
    text = path.read_text(encoding="utf-8")
    try:
        values = tomllib.loads(text)
    except tomllib.TOMLDecodeError as reason:
        msg = f"{path.name}: {reason}"
        raise ValueError(msg) from None
    top = StudyTable(Source(path.name, key_lines(text)), (), values)
    out: dict[str, dict[str, tuple[float, float]]] = {}
    for place, known in USUAL_FORM.items():
        t = top.table(place)
        pairs = {key: t.vector(key, None, size=2, unit="-") for key in known}
        t.finish()
        out[place] = {
            key: (float(pair[0]), float(pair[1])) for key, pair in pairs.items() if pair is not None
        }
        for key, (_, std) in out[place].items():
            if std <= 0:
                t.refuse(key, f"{std:g} is not allowed as a standard deviation; a positive number is needed")
    top.finish()
    return out


def _tolerance(t: StudyTable, model: Model, members: Sequence[str] = ()) -> SectionTolerance:
    """Read how well the sections of some members are known; of all, where none are named."""
    names = list(model.mesh.members)
    for name in members:
        if name not in names:
            t.refuse("members", f"there is no member '{name}'; {suggest(name, names)}")
    size = t.number("size", None, least=0.0, unit="m")
    stated: dict[str, float] = {}
    for word, keys in SHARES.items():
        share = t.number(word, None, least=0.0, unit="-")
        if share is not None and share > MOST_SHARE:
            t.refuse(word, f"{share:g} is not allowed; a standard deviation up to {MOST_SHARE:g} is [-]")
        stated |= {} if share is None else dict.fromkeys(keys, share)
    t.finish()
    tolerance = SectionTolerance(tuple(members), size, stated)
    frame = frame_of(model)
    for name in members or names if size is not None else ():
        with t.at("size"):
            std = constants_std(tolerance, frame.members[name].section)
        key, share = max(std.items(), key=lambda each: each[1])
        if share > MOST_SHARE:
            t.refuse(
                "size",
                f"{size:g} m makes {key} of member '{name}' uncertain by {100 * share:.0f} %; at most "
                f"{100 * MOST_SHARE:.0f} % are allowed",
            )
    return tolerance


def read_relevant(top: StudyTable) -> Relevant:
    """Read ``[relevant]``: sizes of effects that a planned test is to show."""
    t, usual = top.table("relevant"), Relevant()
    shares = {f.name: t.number(f.name, getattr(usual, f.name), above=0.0, unit="-") for f in fields(usual)}
    for name, share in shares.items():
        if share >= 1:
            t.refuse(name, f"{share:g} is not allowed; a share between 0 and 1 is needed")
    t.finish()
    return Relevant(**shares)


def read_frequency(top: StudyTable, highest: float | None, notes: list[str]) -> tuple[np.ndarray, float]:
    """Read ``[frequency]``: the lines and the highest frequency of interest [Hz].

    ``highest`` is the highest frequency of the measurements, None without any [Hz].
    """
    t = top.table("frequency")
    stop = t.number("stop", None, above=0, unit="Hz")
    start, step = t.number("start", None, least=0, unit="Hz"), t.number("step", None, above=0, unit="Hz")
    t.finish()
    if stop is None:
        if highest is None:
            notes.append(
                "neither a measurement nor a frequency range is given: the mesh is made "
                f"for {DEFAULT_FREQUENCY:g} Hz"
            )
        stop = highest or DEFAULT_FREQUENCY
    if start is not None and start >= stop:
        t.refuse("start", f"{start:g} Hz is not below stop, {stop:g} Hz")
    step = step or stop / 1000
    start = step if start is None else start
    if (stop - start) / step > MOST_LINES:
        t.refuse(
            "step", f"{(stop - start) / step:.3g} lines of {step:g} Hz are too many; at most {MOST_LINES}"
        )
    n = int(np.floor((stop - start) / step + 1e-9)) + 1
    return start + step * np.arange(n), max(stop, highest or 0.0)


def read_candidates(
    top: StudyTable,
) -> tuple[tuple[str, ...] | None, tuple[str, ...], list[Environment], PriorBelief]:
    """Read ``[candidates]``: kinds of effects to try, None for all, kinds to exclude, and what is believed.

    The last are the environment, and how probable missing effects are.
    """
    t = top.table("candidates")
    kinds, exclude, environment = t.texts("kinds", None), t.texts("exclude", ()), t.texts("environment", ())
    missing, weighed = t.number("missing", None, above=0.0, unit="-"), t.table("weights")
    weights = {kind: weighed.number(kind, above=0.0, unit="-") for kind in weighed.values}
    t.finish()
    known = candidate_kinds() if kinds or exclude or weights else ()  # which imports every kind
    for key, words in (("kinds", kinds or ()), ("exclude", exclude)):
        for word in words:
            if word not in known:
                t.refuse(key, f"there is no kind of effect '{word}'; {suggest(word, known)}")
    for word in weights:
        if word not in known:
            weighed.refuse(word, f"there is no such kind of effect; {suggest(word, known)}")
    for word in environment:
        if word not in set(Environment):
            t.refuse("environment", f"there is no environment '{word}'; {suggest(word, list(Environment))}")
    if missing is not None and missing >= 1:
        t.refuse("missing", f"{missing:g} is not allowed; a probability between 0 and 1 is needed")
    return kinds, exclude, [Environment(word) for word in environment], PriorBelief(missing, weights)
