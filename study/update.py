"""Modes and updated values of a study: identify, update, and write what came out into its text."""

import re
import tomllib
import warnings
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from fem.model import Model, ParameterRef
from fem.modes import solve_modes
from fem.system import assemble
from study.config import Study, read_study
from study.effects import effect_table
from study.lines import key_lines
from study.measured import sensor_rows
from study.measured_modes import MeasuredModes, ShapeLimits
from study.paths import with_paths
from study.run import measured, without_held_out
from study.table import StudyError, suggest
from updating.measurement import Measurement
from updating.modal_identification import IdentifiedModes, identify_modes
from updating.pairing import ModeComparison, compare_modes
from updating.residuals import frf_data, mode_data
from updating.update import Updated, update

SAME = 1e-9
"""Values of a written study differ by no more than this from those of the update, relatively [-]."""


@dataclass(frozen=True, slots=True, eq=False)
class StudyUpdate:
    """An updating of a study's model.

    Attributes
    ----------
    study : Study
    updated : Updated
    to : tuple of str
        What it was updated to.
    modes : MeasuredModes or None
        The measured modes, given or identified.
    identified : IdentifiedModes or None
        From the FRFs, where modes were needed and not given.
    measurement : Measurement or None
        The FRFs that were used, without what is held out.
    before, after : ModeComparison or None
        Measured modes beside those of the model at the start and at the end.
    notes : tuple of str
        What is to be said beside the update's own messages.
    """

    study: Study
    updated: Updated
    to: tuple[str, ...]
    modes: MeasuredModes | None
    identified: IdentifiedModes | None
    measurement: Measurement | None
    before: ModeComparison | None
    after: ModeComparison | None
    notes: tuple[str, ...]


def identify_study(
    study: Study,
    measurement: str | None = None,
    band: tuple[float, float] | None = None,
    limits: ShapeLimits | None = None,
) -> tuple[IdentifiedModes, Measurement, tuple[str, ...]]:
    """Identify the modes of a study's measurement.

    Parameters
    ----------
    study : Study
    measurement : str, optional
        Its name; the first unless given.
    band : (float, float), optional
        That of the study unless given [Hz].
    limits : ShapeLimits, optional
        That of the study unless given.

    Returns
    -------
    IdentifiedModes, Measurement, tuple of str
        The last are the warnings of the identification.

    Raises
    ------
    StudyError
        For a study without a measurement, or without one of that name.
    IdentificationError
        For data that do not allow it.
    """
    by_name = {m.name: m for m in measured(study)}
    if measurement is not None and measurement not in by_name:
        msg = f"{study.path}: there is no measurement '{measurement}'; {suggest(measurement, by_name)}"
        raise StudyError(msg)
    data = study.measurements[0] if measurement is None else by_name[measurement]
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        found = identify_modes(
            data.frf, band=band or study.band, driving=_driving(data),
            **asdict(limits or study.shape_limits),
        )  # fmt: skip
    return found, data, tuple(dict.fromkeys(str(w.message) for w in caught))


def _driving(m: Measurement) -> list[tuple[str, str]] | None:
    """Return responses and forces at one place and in one direction; None where labels may tell."""
    pairs = [
        (s.name, e.name)
        for s in m.sensors
        for e in m.excitations
        if np.allclose(s.point, e.point, rtol=0, atol=1e-9) and s.direction @ e.direction > 1 - 1e-9
    ]
    return pairs or None


def update_study(study: Study) -> StudyUpdate:
    """Update a study's model to what its ``[update]`` says, or to what was measured.

    Modes go before where the study gives them, FRFs where it does not.

    Raises
    ------
    StudyError
        If nothing was measured, or nothing is uncertain.
    """
    plan = study.plan
    if study.modes is None and not study.measurements:
        msg = f"{study.path}: it has neither [[measurements]] nor [modes]; there is nothing to update to"
        raise StudyError(msg)
    if not plan.unknowns:
        msg = (
            f"{study.path}: nothing is uncertain in [uncertain]; say what to update in [[update.parameters]]"
        )
        raise StudyError(msg)
    given = study.modes
    usual = "frf" if given is None else "modes" if given.sensors else "frequencies"
    to = plan.to or (usual,)
    identified, notes = None, []
    modes = given
    if given is None and ("modes" in to or "frequencies" in to):
        identified, data, said = identify_study(study)
        notes += said
        modes = _as_measured(identified, data)
    of_frf = _fitted(study) if "frf" in to else None
    model, of_modes = study.model.with_effect(*plan.effects), None
    if modes is not None and ("modes" in to or "frequencies" in to):
        shaped = "modes" in to
        of_modes = mode_data(
            model, modes=modes.modes if shaped else replace(modes.modes, shapes=modes.modes.shapes[:0]),
            outputs=modes.sensors if shaped else (), frequency_std=modes.frequency_std,
            shape_std=modes.shape_std, model_error=plan.model_error,
        )  # fmt: skip
    data = None
    if of_frf is not None:
        data = frf_data(
            model, of_frf, band=study.band, model_error=plan.model_error,
            amplitude_error=plan.amplitude_error, form_error=study.model_error,
        )  # fmt: skip
    updated = update(
        model, plan.unknowns, modes=of_modes, frf=data, damping=plan.damping and data is not None,
        settings=plan.settings,
    )  # fmt: skip
    before = after = None
    if modes is not None and modes.sensors:
        before, after = (_compared(modes, m) for m in (model, updated.model))
    return StudyUpdate(study, updated, to, modes, identified, of_frf, before, after, tuple(notes))


def _as_measured(found: IdentifiedModes, data: Measurement) -> MeasuredModes:
    if not found.modes.n_modes:
        msg = f"no mode was found in the FRFs of {data.name}; give [modes], or update to 'frf'"
        raise StudyError(msg)
    return MeasuredModes(found.modes, data.sensors, *found.relative_std(), f"FRFs of {data.name}")


def _fitted(study: Study) -> Measurement:
    """Return the first measurement without what is held out."""
    return without_held_out(study, measured(study)[0])


def _compared(modes: MeasuredModes, model: Model) -> ModeComparison:
    top = 1.3 * float(modes.modes.frequency[-1])
    computed = solve_modes(assemble(model), max_frequency=top)
    return compare_modes(modes.modes, computed, sensor_rows(model, modes.sensors))


# The study with other values --------------------------------------------------------------------------------


def updated_text(study: Study, updated: Updated, folder: Path) -> tuple[str, tuple[str, ...]]:
    """Return the text of a study with updated values, to be written into a folder.

    Values are put where the study has them; comments and order stay. The text is read again, and what it
    does not give the model is named.

    Parameters
    ----------
    study : Study
    updated : Updated
    folder : Path
        Where the text will lie: the files that it names are given from there.

    Returns
    -------
    str
        The text.
    tuple of str
        What of the update the text does not say.
    """
    lines = study.text.splitlines()
    places = key_lines(study.text)
    have = updated.model.values()
    values = {ref: float(f"{have[ref]:.10g}") for p in updated.parameters for ref in p.refs}
    tree = tomllib.loads(study.text)
    for ref, value in values.items():
        for path in _paths(ref, study, tree):
            row = places.get(path)
            if row is not None:
                lines[row - 1] = _with_number(lines[row - 1], str(path[-1]), value)
    ratios = [p for p in updated.parameters if not p.refs]
    if ratios:
        d = updated.model.damping
        text = f"modal = {{ frequency = [{_numbers(d.frequency)}], ratio = [{_numbers(d.ratio)}] }}"
        row = places.get(("damping", "modal"), places.get(("damping", "file")))
        if row is not None:
            lines[row - 1] = text  # a table over several lines makes this unreadable, which is said
        elif "damping" in tree:
            lines.insert(places["damping",], text)
        else:
            lines += ["", "[damping]", text]
    text = _with_effects("\n".join(lines) + "\n", study, updated.model, values)
    unsaid = tuple(_left_unsaid(text, study, updated, values, bool(ratios)))
    return with_paths(text, study.path.parent, folder), unsaid


def _paths(ref: ParameterRef, study: Study, tree: dict[str, Any]) -> list[tuple[str | int, ...]]:
    """Return where the study may say a parameter."""
    effect, name = ref
    if effect == "frame" and ":" in name:
        key, material = name.split(":", 1)
        return [("materials", material, key)]
    out: list[tuple[str | int, ...]] = []
    for kind in ("joints", "masses", "viscoelastic"):
        for i, one in enumerate(tree.get(kind, [])):
            own = one.get("name", f"{kind[:-1]}{i + 1}" if kind != "masses" else None)
            if own is None:
                point = one.get("point")
                own = f"mass at {point}" if isinstance(point, str) else f"mass{i + 1}"
            if own == effect:
                out += [(kind, i, name), (kind, i, "k", name), (kind, i, "c", name)]
    for i, one in enumerate(tree.get("effects", [])):
        if effect == one.get("name", f"known {one.get('candidate', '')}"):
            out.append(("effects", i, name))
    for i, one in enumerate(tree.get("sensors", [])):
        if name == "mass" and effect == f"mass of sensor {one.get('name', '')}":
            out.append(("sensors", i, "mass"))
    return out


def _with_effects(text: str, study: Study, model: Model, values: dict[ParameterRef, float]) -> str:
    """Return a text with the values of ``[[effects]]`` that it leaves at their default, and new effects."""
    for i, one in enumerate(tomllib.loads(text).get("effects", [])):
        own = one.get("name", f"known {one['candidate']}")
        rest = [(n, v) for (effect, n), v in values.items() if effect == own and n not in one]
        lines = text.splitlines()
        row = key_lines(text)["effects", i, "candidate"]
        text = "\n".join([*lines[:row], *(f"{n} = {v!r}" for n, v in rest), *lines[row:]]) + "\n"
    for effect in study.plan.effects:
        now = model.effect(effect.name).with_values(
            **{n: v for (e, n), v in values.items() if e == effect.name}
        )
        text += "\n" + effect_table(now, effect.name.removeprefix("known "))
    return text


_NUMBER = r"[-+]?(?:\d[\d_]*\.?[\d_]*|\.\d[\d_]*)(?:[eE][-+]?\d+)?"


def _with_number(line: str, key: str, value: float) -> str:
    """Return a line with another number after a key."""
    return re.sub(rf"(?<![\w-])({re.escape(key)}\s*=\s*){_NUMBER}", rf"\g<1>{value!r}", line, count=1)


def _numbers(values: Sequence[float] | np.ndarray) -> str:
    return ", ".join(repr(float(f"{v:.7g}")) for v in values)


def _left_unsaid(
    text: str, study: Study, updated: Updated, values: dict[ParameterRef, float], damping: bool
) -> list[str]:
    """Return what a text does not give its model, found by reading it."""
    names = {ref: p.name for p in updated.parameters for ref in p.refs}
    try:
        model = read_study(text, study.path).model
    except StudyError as reason:
        return [f"the study with the updated values cannot be read: {reason}"]
    have = model.values()
    out = [
        f"{names[ref]} = {value:.6g} has no place in the study file, which keeps the old value"
        for ref, value in values.items()
        if abs(have.get(ref, np.inf) - value) > SAME * abs(value)
    ]
    d, new = model.damping, updated.model.damping
    if damping and not (d.ratio.shape == new.ratio.shape and np.allclose(d.ratio, new.ratio, 1e-6, 0.0)):
        out.append("the updated damping has no place in the study file, which keeps the old one")
    return out
