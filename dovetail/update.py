"""Modes and updated values of a study: identify, update, and write the results into its text."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from dovetail.file.config import Study, read_study
from dovetail.file.measured_modes import MeasuredModes, ShapeLimits
from dovetail.file.paths import with_paths
from dovetail.file.table import StudyError, suggest
from dovetail.file.writing import rebased_values, with_damping, with_effects, with_parameters
from dovetail.identified import as_measured, modes_in
from dovetail.pipeline import measured, without_held_out
from fem.analysis.modes import solve_modes
from fem.model import Model, ParameterRef
from fem.system import assemble
from updating.correlation.pairing import ModeComparison, compare_modes
from updating.inference.frf_data import frf_data
from updating.inference.mode_data import mode_data
from updating.inference.update import update
from updating.inference.updated import Updated
from updating.measurement.measurement import Measurement, sensor_rows, with_moving_base, with_resting_base
from updating.modal.identified_modes import IdentifiedModes

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
        Data that it was updated to.
    modes : MeasuredModes or None
        The measured modes, given or identified.
    identified : IdentifiedModes or None
        From the FRFs, where modes were needed and not given.
    measurement : Measurement or None
        The FRFs that were used, without held-out lines and sensors.
    before, after : ModeComparison or None
        Measured modes beside those of the model at the start and at the end.
    notes : tuple of str
        Sentences beside the update's own messages.
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
    found, said = modes_in(data, band or study.band, limits or study.shape_limits)
    return found, data, said


def update_study(study: Study) -> StudyUpdate:
    """Update a study's model to the data of its ``[update]``, or to all measured ones.

    Modes go before where the study gives them, FRFs where it does not.

    Raises
    ------
    StudyError
        If nothing was measured, or nothing is uncertain.
    """
    plan = study.plan
    if study.modes is None and not (study.measurements or study.amplitudes):
        msg = (
            f"{study.path}: it has {study.lack_of_frfs} and no [modes]; an update needs measured FRFs or "
            "modes"
        )
        raise StudyError(msg)
    if not plan.unknowns:
        msg = f"{study.path}: no parameter is uncertain; name some in [[update.parameters]] or [uncertain]"
        raise StudyError(msg)
    given = study.modes
    usual = "frf" if given is None else "modes" if given.sensors else "frequencies"
    to = plan.to or (usual,)
    identified, notes = None, []
    modes = given
    if given is None and ("modes" in to or "frequencies" in to):
        identified, data, said = identify_study(study)
        notes += said
        modes = as_measured(identified, data)
    of_frf = _fitted(study) if "frf" in to else None
    model, of_modes = study.model.with_effect(*plan.effects), None
    if of_frf is not None:
        model = with_moving_base(model, of_frf.excitations)
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
        before, after = (_compared(modes, m) for m in (with_resting_base(model), updated.model))
    return StudyUpdate(study, updated, to, modes, identified, of_frf, before, after, tuple(notes))


def _fitted(study: Study) -> Measurement:
    """Return the first measurement without held-out lines and sensors."""
    return without_held_out(study, measured(study, phases=False)[0])


def _compared(modes: MeasuredModes, model: Model) -> ModeComparison:
    top = 1.3 * float(modes.modes.frequency[-1])
    computed = solve_modes(assemble(model), max_frequency=top)
    return compare_modes(modes.modes, computed, sensor_rows(model, modes.sensors))


# The study with other values --------------------------------------------------------------------------------


def updated_text(study: Study, updated: Updated, folder: Path) -> tuple[str, tuple[str, ...]]:
    """Return the text of a study with updated values, to be written into a folder.

    Values are put where the study has them; comments and order stay. The text is read again; parts that
    it does not give the model are named.

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
        Parts of the update that the text does not hold.
    """
    have = updated.model.values()
    values = {ref: float(f"{have[ref]:.10g}") for p in updated.parameters for ref in p.refs}
    added = {e.name for e in study.plan.effects}
    values |= rebased_values(updated.model, updated.model.effects)
    text = with_parameters(study.text, {ref: v for ref, v in values.items() if ref[0] not in added})
    ratios = [p for p in updated.parameters if not p.refs]
    if ratios:
        text = with_damping(text, updated.model.damping, None)
    new = (updated.model.effect(e.name) for e in study.plan.effects)
    text = with_effects(text, [e.rebased(updated.model) for e in new])
    unsaid = tuple(_left_unsaid(text, study, updated, values, bool(ratios)))
    return with_paths(text, study.path.parent, folder), unsaid


def _left_unsaid(
    text: str, study: Study, updated: Updated, values: dict[ParameterRef, float], damping: bool
) -> list[str]:
    """Return the parts of its model that a text does not give, found by reading it."""
    names = {ref: p.name for p in updated.parameters for ref in p.refs}
    names = {ref: names.get(ref, ".".join(ref)) for ref in values}
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
