"""Modes and updated values of a study: identify, update, and write the results into its text."""

import os
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from dovetail.disk.output import Output, check_outputs
from dovetail.file.config import StudyContents, read_study
from dovetail.file.contents import measured, without_held_out
from dovetail.file.effects import written_values
from dovetail.file.measured_modes import MeasuredModes, ShapeLimits
from dovetail.file.paths import input_files
from dovetail.file.table import StudyError, suggest
from dovetail.file.toml import FITTED_DIGITS
from dovetail.found import text_with_model, values_in, with_test
from dovetail.modes_pipeline import (
    as_measured,
    mode_problem_and_model,
    targets_of,
)
from dovetail.pipeline import formed_problem_and_model
from dovetail.report.printed import Printed
from fem.analysis.modes import solve_modes
from fem.io.atomic import replacing
from fem.model import Model, ParameterRef
from fem.summary import counted, summary
from fem.system import assemble
from updating.correlation.pairing import ModeComparison, compare_modes
from updating.diagnosis.frf_modes import modes_in, with_more_sensors
from updating.inference.fitted_damping import fitted_damping
from updating.inference.update import update_fitted
from updating.inference.updated import Updated
from updating.measurement.measurement import Measurement, sensor_rows, with_resting_base
from updating.modal.identified_modes import IdentifiedModes
from updating.modal.peaks import peak_words

WRITTEN_VALUE_TOLERANCE = 10.0 ** (1 - FITTED_DIGITS)
"""Values of a written study differ by no more than this from those of the update, relatively [-]."""


@dataclass(frozen=True, slots=True, eq=False)
class StudyUpdate(Printed):
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

    study: StudyContents
    updated: Updated
    to: tuple[str, ...]
    modes: MeasuredModes | None
    identified: IdentifiedModes | None
    measurement: Measurement | None
    before: ModeComparison | None
    after: ModeComparison | None
    notes: tuple[str, ...]

    def __repr__(self) -> str:
        """Return the data and the ending on one line."""
        return summary(self, self._first)

    @property
    def _first(self) -> str:
        return f"{self.study.name}: updated to {' and '.join(self.to)}; {self.ending}"

    @property
    def ending(self) -> str:
        """Why the update ended, in words."""
        return self.updated.ending.value[0]

    def printed(self) -> list[str]:
        """Return the parameters with their ±, and the errors, as ``dovetail update`` prints them."""
        return [self._first, self.updated.table(), *errors_before_and_after(self)]

    def save(self, path: str | os.PathLike[str]) -> tuple[str, ...]:
        """Write the study with the updated values; return what of them a study file does not hold.

        Comments, order and spelling of the file stay.

        Raises
        ------
        OutputError
            If ``path`` is one of the files that the study reads.
        """
        path = Path(path)
        check_outputs(input_files(self.study.path), Output("path", path))
        text, unsaid = updated_text(self.study, self.updated, path.parent)
        with replacing(path) as scratch:
            scratch.write_text(text, encoding="utf-8")
        return unsaid


@dataclass(frozen=True, slots=True, eq=False)
class Identified(Printed):
    """Modes that were identified in a study's FRFs.

    Attributes
    ----------
    name : str
        The study's.
    found : IdentifiedModes
    measurement : Measurement
        With the shapes' channels as sensors.
    warnings : tuple of str
        Of the identification.
    is_roving : bool
        Whether shapes are of the places of forces.
    """

    name: str
    found: IdentifiedModes
    measurement: Measurement
    warnings: tuple[str, ...]
    is_roving: bool

    def __repr__(self) -> str:
        """Return how many modes there are, in which measurement, on one line."""
        return summary(self, f"{self.name}: {counted(self.found.modes.n_modes, 'mode')}")

    def printed(self) -> list[str]:
        """Return the modes with their uncertainty, as ``dovetail identify-modes`` prints them."""
        found, data = self.found, self.measurement
        rejected = sum(not c.accepted for c in found.candidates)
        roving = (
            f"shapes are of the {len(data.sensors)} places of forces, which are more than those of responses "
            "(reciprocity: H_jk = H_kj)"
        )
        explained = peak_words(found.unexplained)
        return [
            f"{self.name}: {found.modes.n_modes} mode(s) identified from {data.name}; {rejected} other "
            "pole(s) were tried and rejected",
            *([roving] if self.is_roving else []),
            found.table(),
            *(f"warning: {text}" for text in self.warnings if text not in explained),
        ]


def errors_before_and_after(result: StudyUpdate) -> list[str]:
    """Return the errors at the start and at the end, in sentences."""
    first, last = result.updated.path[0].errors, result.updated.path[-1].errors
    out = []
    for label, a, b in (
        ("natural frequencies, rms [%]", 100 * first.frequency, 100 * last.frequency),
        ("MAC, mean", first.mac, last.mac),
        ("FRFs, rms [dB]", first.frf_db, last.frf_db),
    ):
        if np.isfinite(a) and np.isfinite(b):
            out.append(f"{label}: {a:.3g} before, {b:.3g} after")
    return out


def identify_study(
    study: StudyContents,
    measurement: str | None = None,
    band: tuple[float, float] | None = None,
    limits: ShapeLimits | None = None,
) -> Identified:
    """Identify the modes of a study's measurement.

    Shapes are of the side with more places: of a roving hammer those of its forces.

    Parameters
    ----------
    study : Study
    measurement : str, optional
        Its name; the first unless given.
    band : (float, float), optional
        That of the study unless given [Hz].
    limits : ShapeLimits, optional
        That of the study unless given.

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
    data = with_more_sensors(data, study.model)
    found, warnings = modes_in(data, band or study.band, **asdict(limits or study.shape_limits))
    is_roving = not {s.name for s in data.sensors} <= {s.name for s in study.sensors}
    return Identified(study.name, found, data, (*_beyond(data, band), *warnings), is_roving)


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


def update_study(study: StudyContents) -> StudyUpdate:
    """Update a study's model to the data of its ``[update]``, or to all measured ones.

    Modes go before where the study gives them, FRFs where it does not.

    Raises
    ------
    StudyError
        If nothing was measured, or nothing is uncertain.
    """
    plan = study.update_plan
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
    usual = "frf" if given is None else "modes" if given.has_shapes else "frequencies"
    to = plan.to or (usual,)
    identified, notes = None, []
    modes = given
    if given is None and ("modes" in to or "frequencies" in to):
        one = identify_study(study)
        identified, notes = one.found, [*notes, *one.warnings]
        modes = as_measured(identified, one.measurement)
    shaped = "modes" in to
    targets = None
    if modes is not None and (shaped or "frequencies" in to):
        if not shaped:
            modes = replace(modes, modes=replace(modes.modes, shapes=modes.modes.shapes[:0], labels=()))
        targets = targets_of(modes)
        if modes.held_out:
            out = ", ".join(f"{f:.5g}" for f in targets.frequency[targets.held_out])
            notes.append(
                f"the modes at {out} Hz are held out; 'dovetail compare' of the updated study shows "
                "how well it predicts them"
            )
    asked = {ref for u in plan.unknowns for ref in u.refs}
    others = tuple(n for n in plan.nuisances if not asked.intersection(n.refs))
    adapted = replace(
        study,
        baseline=None,
        baseline_frfs=None,
        model=study.model.with_effect(*plan.effects),
        nuisances=(*plan.unknowns, *others),
        damping_std=study.damping_std if plan.damping else 0.0,
    )
    data = None
    if "frf" in to:
        data = without_held_out(study, measured(study, phases=False)[0])
        problem, model = formed_problem_and_model(adapted)
        problem = replace(problem, modes=targets)
    else:
        problem, model = mode_problem_and_model(replace(adapted, modes=modes, measurements=()))
    updated = update_fitted(problem, model, plan.unknowns, plan.settings)
    updated = replace(updated, model=with_resting_base(updated.model))
    before = after = None
    if modes is not None and modes.has_shapes:
        before, after = (_compared(modes, m) for m in (with_resting_base(study.model), updated.model))
    return StudyUpdate(study, updated, to, modes, identified, data, before, after, tuple(notes))


def _compared(modes: MeasuredModes, model: Model) -> ModeComparison:
    top = 1.3 * float(modes.modes.frequency[-1])
    computed = solve_modes(assemble(model), max_frequency=top)
    return compare_modes(modes.modes, computed, sensor_rows(model, modes.sensors))


# The study with other values --------------------------------------------------------------------------------


def updated_text(study: StudyContents, updated: Updated, folder: Path) -> tuple[str, tuple[str, ...]]:
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
    added = {e.name for e in study.update_plan.effects}
    known = {e.name for e in study.model.effects} | added
    new = [e for e in updated.model.effects if e.name in added or (e.is_form and e.name not in known)]
    values = values_in(study, updated.model)
    damping = None
    if any(not p.refs for p in updated.parameters):
        damping = fitted_damping(updated.problem, updated.fitted, updated.model)
    effects = [e.rebased(updated.model) for e in new]
    here, there = (
        text_with_model(study, place, values, damping, effects, ()) for place in (study.path.parent, folder)
    )
    test = updated.problem.test_of(updated.fitted)
    if test is not None:
        there = with_test(there, test)
    values |= {(e.name, key): value for e in effects for key, value in written_values(e).items()}
    return there, tuple(_omitted(here, study, updated, values, damping is not None))


def _omitted(
    text: str, study: StudyContents, updated: Updated, values: dict[ParameterRef, float], damping: bool
) -> list[str]:
    """Return the parts of its model that a text does not give, found by reading it."""
    names = {ref: p.name for p in updated.parameters for ref in p.refs}
    names = {ref: names.get(ref, ".".join(ref)) for ref in values}
    try:
        model = read_study(text, study.path).model
    except StudyError as reason:
        return [f"the study with the updated values cannot be read: {reason}"]
    have = model.values()
    have |= {(name.removeprefix("known "), p): v for (name, p), v in have.items()}
    out = [
        f"{names[ref]} = {value:.6g} has no place in the study file, which keeps the old value"
        for ref, value in values.items()
        if abs(have.get(ref, np.inf) - value) > WRITTEN_VALUE_TOLERANCE * abs(value)
    ]
    d, new = model.damping, updated.model.damping
    if damping and not (d.ratio.shape == new.ratio.shape and np.allclose(d.ratio, new.ratio, 1e-6, 0.0)):
        out.append("the updated damping has no place in the study file, which keeps the old one")
    return out
