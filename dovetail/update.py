"""Modes and updated values of a study: identify, update, and write the results into its text."""

from collections.abc import Sequence
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
from fem.analysis.modes import first_modes, solve_modes
from fem.model import Model, ParameterRef
from fem.system import assemble
from updating.correlation.pairing import ModeComparison, compare_modes
from updating.inference.frf_data import frf_data
from updating.inference.mode_data import mode_data
from updating.inference.mode_targets import IN_PLANE
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
    return found, data, (*_beyond(data, band), *said)


def _beyond(data: Measurement, band: tuple[float, float] | None) -> tuple[str, ...]:
    """Return a warning of a band wider than the measurement's lines."""
    f = data.frf.frequency
    step = float(np.diff(f).max(initial=0.0))
    if band is None or (band[0] >= f[0] - step and band[1] <= f[-1] + step):
        return ()
    return (
        f"the band {band[0]:g} to {band[1]:g} Hz is wider than that of {data.name}, {f[0]:g} to {f[-1]:g} "
        "Hz; band in [[measurements]] may leave lines out",
    )


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
        shaped, fitted = "modes" in to, _fitted_modes(modes)
        if fitted is not modes:
            out = ", ".join(f"{f:.5g}" for f in _some(modes, modes.held_out).modes.frequency)
            notes.append(
                f"the modes at {out} Hz are held out; 'dovetail compare' of the updated study says how "
                "well it predicts them"
            )
        of_modes = mode_data(
            model, modes=fitted.modes if shaped else replace(fitted.modes, shapes=fitted.modes.shapes[:0]),
            outputs=fitted.sensors if shaped else (), frequency_std=fitted.frequency_std,
            shape_std=fitted.shape_std, model_error=plan.model_error,
            numbers=None if shaped else _numbers(model, modes),
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


def _fitted_modes(modes: MeasuredModes) -> MeasuredModes:
    """Return measured modes without those that are held out."""
    if not modes.held_out:
        return modes
    return _some(modes, [k for k in range(1, modes.modes.n_modes + 1) if k not in modes.held_out])


def _some(modes: MeasuredModes, which: Sequence[int]) -> MeasuredModes:
    """Return some of the measured modes, counted from 1."""
    at, m = np.array(sorted(which)) - 1, modes.modes
    some = replace(
        m, frequency=m.frequency[at], shapes=m.shapes[:, at], zeta=None if m.zeta is None else m.zeta[at]
    )
    return replace(
        modes, modes=some, frequency_std=modes.frequency_std[at], shape_std=modes.shape_std[at],
        numbers=tuple(modes.numbers[k] for k in at) if modes.numbers else (), held_out=(),
    )  # fmt: skip


def _numbers(model: Model, modes: MeasuredModes) -> list[int] | None:
    """Return which elastic modes the fitted frequencies belong to, from 0; None for the first ones."""
    n = modes.modes.n_modes
    kept = [k for k in range(n) if k + 1 not in modes.held_out]
    if modes.numbers:
        return [modes.numbers[k] - 1 for k in kept]
    if not modes.plane:
        return kept if modes.held_out else None
    seen = np.zeros(0, dtype=np.int64)
    for more in (10, 40, 160):  # until enough modes move in the plane
        found = first_modes(assemble(with_resting_base(model)), n + more)
        shapes = found.shapes[:, found.n_rigid :]
        motion = (np.abs(shapes.reshape(-1, 6, shapes.shape[1])[:, :3]) ** 2).sum(axis=0)
        within = motion[["xyz".index(axis) for axis in modes.plane]].sum(axis=0)
        seen = np.flatnonzero(within >= IN_PLANE * motion.sum(axis=0))
        if seen.size >= n:
            break
    if seen.size < n:
        msg = f"{modes.name}: {seen.size} modes of the model move along {modes.plane}; {n} were measured"
        raise StudyError(msg)
    return seen[kept].tolist()


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
