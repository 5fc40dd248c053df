"""The contents of a study file: a model, measurements, and their uncertainties."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from dovetail.file.ambient import AmbientTest
from dovetail.file.estimates import FittedEstimate
from dovetail.file.loads import Loads
from dovetail.file.measured_modes import (
    MeasuredModes,
    ModesState,
    ShapeLimits,
    UpdatePlan,
)
from dovetail.file.table import StudyError
from fem.analysis.frf import WITHOUT_PHASE
from fem.analysis.unbalance import Unbalance
from fem.declarations import Relevant
from fem.elements.splitting import split
from fem.io.deck_units import DeckUnits
from fem.model import Model
from updating.inference.parameters import Nuisance
from updating.measurement.channel_errors import USUAL, ChannelErrors
from updating.measurement.measurement import Measurement, Sensor


@dataclass(frozen=True, slots=True)
class SourceDeck:
    """The deck that a study was made of.

    Attributes
    ----------
    file : Path
    units : str or (length, mass, time)
        Of the deck [m, kg, s].
    """

    file: Path
    units: str | tuple[float, ...] = "SI"

    @property
    def length(self) -> float:
        """One unit of length of the deck [m]."""
        return DeckUnits.of(self.units).length


@dataclass(frozen=True, slots=True, eq=False)
class StudyContents:
    """A structure, its measurements, and its uncertain parameters.

    Attributes
    ----------
    name, description : str
    path : Path
        The study file.
    text : str
        Its text.
    model : Model
        With the mesh refined and points where sensors, supports, joints and masses are.
    measurements : tuple of Measurement
        By the names of the study's sensors and excitations; empty where none are given.
    amplitudes : tuple of Measurement
        Those without phase, whose FRFs are amplitudes.
    sensors, excitations : tuple of Sensor
        All of the study.
    nuisances : tuple of Nuisance
        Parameters of the model that are uncertain.
    damping_std : float
        Standard deviation of the logarithm of the damping [-].
    kinds : tuple of str or None
        Kinds of candidate effects; None for every kind.
    exclude : tuple of str
        Kinds that are left out.
    band : (float, float) or None
        Band of comparison and fit; None for that of the measurements [Hz].
    model_error : float
        Residual level up to which a model of beams counts as right [neper].
    n_lines : int or None
        Number of frequency lines to fit; None for the program's choice.
    held_out : tuple of str
        Names of excitations whose FRFs are compared but not fitted.
    held_out_sensors : tuple of str
        Names of sensors whose FRFs are.
    held_out_bands : tuple of (float, float)
        Bands that are, in place of the blocks of lines that the program holds out [Hz].
    frequency : ndarray
        Lines of :command:`dovetail frf` where there is no measurement [Hz].
    max_frequency : float
        Highest frequency that the mesh resolves [Hz].
    element_size : (float, float)
        Lengths of the shortest and the longest element [m].
    assumptions : tuple of str
        Assumptions for missing entries, in sentences.
    assumed_spreads : tuple of str
        Those of them that are about standard deviations, which analyses of one model do not use.
    modes : MeasuredModes or None
        Measured modes, where the study gives them.
    baseline : MeasuredModes or None
        Those of an earlier state, where what has changed is asked for.
    ambient : AmbientTest or None
        Time data of a test with unknown forces, which are read when modes are identified in them.
    baseline_frfs : Measurement or None
        FRFs of an earlier state, where the study has these.
    changes : tuple of str
        Names of effects of the model that have come since the baseline.
    states : tuple of State
        Modes of later states, where their history is asked for.
    update_plan : UpdatePlan
        Plan of :command:`dovetail update`.
    warnings : tuple of str
        Probable faults of the study and its files, and parts left unread, in sentences.
    left_out : tuple of str
        Errors of parts that were left unread.
    awaited : tuple of str
        Those of them that are of measured data whose files do not exist.
    implausible : tuple of str
        Those of the warnings that are about values of the model, with file, line and key.
    shape_limits : ShapeLimits
        How complex the shapes of modes identified in FRFs may be.
    chosen_sizes : mapping of str to float
        Element sizes of the members for which the study gives none [m].
    labels : mapping
        How files call sensors (``"outputs"``) and excitations (``"inputs"``), by their names, where the study
        says it.
    measured_notes : tuple of str
        Records that the readers of the measured files left out, converted or found twice, a sentence each.
    loads : Loads
        Load cases, combinations and envelopes.
    unbalances : tuple of Unbalance
        Of members that spin.
    relevant : Relevant
        Sizes of effects that a planned test is to show.
    channel_errors : ChannelErrors
        How well sensors and excitations are described.
    source : SourceDeck or None
        The deck that it was made of.
    estimates : mapping of str to FittedEstimate
        Of parameters that were fitted, by ``effect.parameter``.
    """

    name: str
    description: str
    path: Path
    text: str
    model: Model
    measurements: tuple[Measurement, ...]
    sensors: tuple[Sensor, ...]
    excitations: tuple[Sensor, ...]
    nuisances: tuple[Nuisance, ...]
    damping_std: float
    kinds: tuple[str, ...] | None
    exclude: tuple[str, ...]
    band: tuple[float, float] | None
    model_error: float
    n_lines: int | None
    held_out: tuple[str, ...]
    held_out_sensors: tuple[str, ...]
    frequency: np.ndarray
    max_frequency: float
    element_size: tuple[float, float]
    assumptions: tuple[str, ...]
    assumed_spreads: tuple[str, ...] = ()
    held_out_bands: tuple[tuple[float, float], ...] = ()
    modes: MeasuredModes | None = None
    update_plan: UpdatePlan = UpdatePlan()  # noqa: RUF009 - frozen
    warnings: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()
    awaited: tuple[str, ...] = ()
    implausible: tuple[str, ...] = ()
    shape_limits: ShapeLimits = ShapeLimits()  # noqa: RUF009 - frozen
    chosen_sizes: Mapping[str, float] = field(default_factory=dict)
    labels: Mapping[str, Mapping[str, str]] = field(default_factory=lambda: {"outputs": {}, "inputs": {}})
    measured_notes: tuple[str, ...] = ()
    amplitudes: tuple[Measurement, ...] = ()
    loads: Loads = Loads()  # noqa: RUF009 - frozen
    baseline: MeasuredModes | None = None
    ambient: AmbientTest | None = None
    baseline_frfs: Measurement | None = None
    changes: tuple[str, ...] = ()
    states: tuple[ModesState, ...] = ()
    unbalances: tuple[Unbalance, ...] = ()
    relevant: Relevant = Relevant()  # noqa: RUF009 - frozen
    channel_errors: ChannelErrors = USUAL
    source: SourceDeck | None = None
    estimates: Mapping[str, FittedEstimate] = field(default_factory=dict)

    @property
    def length_unit(self) -> float:
        """One unit of length of its deck [m]; 1 for a study that was not made of one."""
        return 1.0 if self.source is None else self.source.length

    @property
    def has_baseline(self) -> bool:
        """Whether what has changed since an earlier state is asked for."""
        return self.baseline is not None or self.baseline_frfs is not None

    @property
    def has_data(self) -> bool:
        """Whether it has measurements, or modes."""
        return bool(self.measurements or self.amplitudes or self.states or self.has_baseline or self.modes)

    @property
    def lack_of_frfs(self) -> str:
        """Why it has no FRFs, in words after "it has"."""
        if self.awaited:
            return f"no measured data yet ({self.awaited[0]})"
        names = ", ".join(m.name for m in self.amplitudes)
        return f"in {names} {WITHOUT_PHASE}" if names else "no [[measurements]]"

    def refined(self, factor: int) -> "StudyContents":
        """Return the study with every element divided by a factor; points keep their indices."""
        return replace(self, model=split(self.model, factor))

    def require_ends(self) -> None:
        """Raise a :class:`StudyError` if the study has no sensors or no excitations."""
        for part in ("sensors", "excitations"):
            if not getattr(self, part):
                awaited = f" ({self.awaited[-1]})" if self.awaited else ""
                msg = f"{self.path}: it has no [[{part}]]{awaited}; a test has both sensors and excitations"
                raise StudyError(msg)


def has_modes_alone(study: StudyContents) -> bool:
    """Whether a study is diagnosed by modes: it has no FRFs, or its baseline has modes."""
    if study.baseline is not None:
        return study.modes is not None or bool(study.measurements)
    return study.modes is not None and not study.measurements and not study.amplitudes


def measured(study: StudyContents, *, phases: bool = True) -> tuple[Measurement, ...]:
    """Return the measurements of a study; those without ``phases`` where they may do, and it has no others.

    Raises
    ------
    StudyError
        If it has none, or holds all of its excitations or sensors out.
    """
    given = study.measurements or (() if phases else study.amplitudes)
    if not given:
        lack = "there is nothing to compare the model with"
        if study.modes is not None:
            lack = "this needs FRFs; 'compare', 'diagnose' and 'run' take modes alone"
        msg = f"{study.path}: it has {study.lack_of_frfs}; {lack}"
        raise StudyError(msg)
    frf = given[0].frf
    for what, names, every in (
        ("excitation", study.held_out, frf.inputs),
        ("sensor", study.held_out_sensors, frf.outputs),
    ):
        if names and set(names) >= set(every):
            msg = f"{study.path}: [fit] held_out names every measured {what}; leave at least one for the fit"
            raise StudyError(msg)
    return given


def without_held_out(study: StudyContents, measurement: Measurement) -> Measurement:
    """Return a measurement without excitations and sensors that are kept from the fit, its bands marked."""
    frf = measurement.frf
    outputs = [name for name in frf.outputs if name not in study.held_out_sensors]
    inputs = [name for name in frf.inputs if name not in study.held_out]
    if study.held_out_bands:
        measurement = replace(measurement, held_out=study.held_out_bands)
    if len(outputs) == len(frf.outputs) and len(inputs) == len(frf.inputs):
        return measurement
    return measurement.with_frf(frf.select(outputs, inputs))
