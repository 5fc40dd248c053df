"""Read a study file, and the files that it names, as a :class:`dovetail.file.contents.StudyContents`."""

import os
import re
import tomllib
from collections.abc import Collection, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from dovetail.file.ambient import read_ambient
from dovetail.file.channel_errors import read_channel_errors
from dovetail.file.connections import (
    ForeignPart,
    read_constraints,
    read_foreign_parts,
    read_joints,
    read_rigid_links,
    read_sprung_masses,
    read_viscoelastic,
)
from dovetail.file.contents import SourceDeck, StudyContents
from dovetail.file.conventions import check_phase
from dovetail.file.effects import candidates_of, known_candidates, read_changes, read_effects, read_values
from dovetail.file.estimates import read_estimates
from dovetail.file.faults import as_mounted, read_faults
from dovetail.file.fit_table import read_fit
from dovetail.file.geometry import (
    Geometry,
    TooManyElementsError,
    describe_sizes,
    read_geometry,
    refine,
)
from dovetail.file.lines import key_lines
from dovetail.file.loads import Loads, read_loads
from dovetail.file.measured import RawMeasurement, read_files
from dovetail.file.measured_match import labels_of, match, top_frequency
from dovetail.file.measured_modes import (
    MeasuredModes,
    ModalTest,
    ModesState,
    RawModes,
    UpdatePlan,
    match_modes,
    read_plan,
    read_raw_modes,
    read_shape_limits,
    read_states,
)
from dovetail.file.parts import (
    note_one_sided,
    note_shear_centres,
    read_damping,
    read_masses,
    read_materials,
    read_members,
    read_sections,
    read_supports,
)
from dovetail.file.paths import refuse_device
from dovetail.file.plane import read_plane, refuse_channels, refuse_loads, refuse_space
from dovetail.file.plausible import implausible, naming_implausible, path_of_request
from dovetail.file.rotation import read_rotation, read_unbalances
from dovetail.file.sensors import Channel, ChannelReader
from dovetail.file.settings import (
    read_candidates,
    read_frequency,
    read_relevant,
    with_stated_form,
)
from dovetail.file.suspicions import LazyComparison, mode_suspicions, suspicions
from dovetail.file.table import (
    AwaitedFileError,
    MissingKeyError,
    Source,
    StudyError,
    StudyTable,
    with_unknown_keys,
)
from dovetail.file.uncertain import mode_std, read_uncertain, with_shear
from fem.analysis.frf import WITHOUT_PHASE
from fem.analysis.unbalance import Unbalance
from fem.checks import with_ties_known
from fem.effects.joint import Joint
from fem.effects.section_shear import SectionShear
from fem.elements.frame import Frame
from fem.elements.properties import MemberProperties
from fem.io.deck_units import DeckUnits
from fem.io.faults import existing
from fem.io.programs import program_of_text
from fem.mesh import Mesh
from fem.model import Damping, Effect, Model
from fem.summary import counted, listed
from fem.system import held_by
from updating.inference.parameters import Nuisance
from updating.inference.unknowns import unknown_of
from updating.measurement.channel_errors import USUAL, ChannelErrors
from updating.measurement.measurement import Measurement, Sensor, with_moving_base, with_sensor_masses
from updating.quality.corrections import Fault

BEFORE_TEST = ("sensors", "measurements")
"""Parts of a study besides the model: sensors with excitations, and measurements at them."""
NEEDS = (*BEFORE_TEST, "files")
"""The same, and that all files of measured data exist, as what compares with them needs it."""

TABLES = (
    "study",
    "source",
    "mesh",
    "points",
    "members",
    "defaults",
    "materials",
    "sections",
    "supports",
    "joints",
    "viscoelastic",
    "rigid_links",
    "constraints",
    "superelements",
    "masses",
    "sprung_masses",
    "rotation",
    "unbalances",
    "loads",
    "combinations",
    "envelopes",
    "initial",
    "effects",
    "fitted_form",
    "estimates",
    "damping",
    "sensors",
    "excitations",
    "measurements",
    "faults",
    "channel_errors",
    "relevant",
    "modes",
    "baseline",
    "states",
    "ambient",
    "identification",
    "update",
    "values",
    "uncertain",
    "candidates",
    "fit",
    "form",
    "frequency",
)
"""Tables of a study file."""


def load_study(path: str | os.PathLike[str], needs: Collection[str] = NEEDS) -> StudyContents:
    """Read a study file and the files that it names.

    Parameters
    ----------
    path : path
        A TOML file; see docs/study-file.md. Other files are looked for beside it.
    needs : collection of str
        Parts besides the model that must be right, some of ``NEEDS``. Anything else that cannot be read is
        left out, which ``Study.warnings`` says; without ``"files"`` also measured data that do not exist yet.

    Raises
    ------
    StudyError
        If something in it cannot be meant; the message names file, line and key.
    OSError
        If the file cannot be opened.
    """
    path = Path(path)
    refuse_device(path)
    raw = existing(path).read_bytes()
    try:
        text = raw.decode("utf-8")
    except UnicodeDecodeError as reason:
        _refuse_deck(raw.decode("latin-1"), path.name)
        line = raw.count(b"\n", 0, reason.start) + 1
        msg = f"{path.name}, line {line}: the text is not UTF-8"
        raise StudyError(msg) from None
    return read_study(text, path, needs)


def read_study(text: str, path: Path, needs: Collection[str] = NEEDS) -> StudyContents:
    """Read the text of a study.

    Parameters
    ----------
    text : str
    path : Path
        Where the text lies: other files are looked for beside it.
    needs : collection of str
        As in :func:`load_study`.

    Raises
    ------
    StudyError
        If something in it cannot be meant; the message names file, line and key.
    """
    values, source = _parsed(text, path.name)
    return _read(path, text, StudyTable(source, (), values), needs)


def read_study_of(text: str, path: Path, unit: Path) -> StudyContents:
    """Read the text of a study with the FRFs of another unit of the structure in place of its own.

    The first of ``[[measurements]]`` states how they are read; its repeats and coherence are of its own unit.

    Parameters
    ----------
    text : str
    path : Path
        Where the text lies.
    unit : Path
        File with FRFs of the unit.

    Raises
    ------
    StudyError
        As :func:`read_study`.
    """
    values, source = _parsed(text, path.name)
    given = values.get("measurements", [])
    first = dict(given[0]) if isinstance(given, list) and given and isinstance(given[0], dict) else {}
    for key in ("repeats", "compared", *(("coherence", "averages") if "coherence" in first else ())):
        first.pop(key, None)
    values["measurements"] = [{**first, "name": unit.name, "file": os.fspath(unit.absolute())}]
    return _read(path, text, StudyTable(source, (), values), NEEDS)


def _read(path: Path, text: str, top: StudyTable, needs: Collection[str]) -> StudyContents:
    reader = _Reader(path, text, top, needs)
    try:
        return reader.read()
    except MissingKeyError as missing:
        raise reader.explained(missing, needs) from None


def _suspicion(text: str, reason: str) -> str:
    """Return what is probably wrong where a TOML text cannot be read; nothing without a suspicion."""
    found = re.search(r"at line (\d+), column (\d+)", reason)
    line = text.splitlines()[int(found[1]) - 1] if found else ""
    given = line.partition("#")[0]
    number = re.search(r"=\s*([+-]?\d+,\d+)", given)
    if number is not None:
        decimal = number[1].replace(",", ".")
        return f"; is '{number[1]}' a number with a decimal comma? TOML has points, {decimal}"
    if escaped := re.search(r'"([^"]*\\[^"]*)"', given):
        return f"; a backslash in double quotes begins an escape: write '{escaped[1]}' in single quotes"
    value = r"=\s*[+-]?\d[\d._]*(?:[eE][+-]?\d+)?"
    if unit := re.search(rf"{value}\s*(?![eE\d])([A-Za-zµ°%][^\s,]*)\s*$", given):
        return f"; numbers stand without a unit: convert the value to SI units, and leave '{unit[1]}' out"
    bare = re.match(r"[^\s,\]}\"'#][^,\]}\"'#]*", line[int(found[2]) - 1 :]) if found else None
    if "Illegal character '\\n'" in reason:
        return "; a text needs its closing quote on the same line"
    if bare is None or not reason.startswith("Invalid value"):
        return ""
    word = bare[0].strip()
    if re.fullmatch(r"[+-]?\.\d[\d_]*(?:[eE][+-]?\d+)?", word):
        return f"; TOML writes {word.replace('.', '0.', 1)}"
    if word.lower() in ("true", "false", "inf", "nan"):
        return f"; TOML writes {word.lower()}"
    return "; texts stand in quotes: " + (f"'{word}'" if "\\" in word else f'"{word}"')


def _refuse_deck(text: str, name: str) -> None:
    """Refuse the text of a deck in place of a study."""
    program = program_of_text(text)
    if program is not None:
        msg = f"{name}: it is a deck of {program}; 'dovetail new DIR --from {name}' makes a study of it"
        raise StudyError(msg) from None


def _parsed(text: str, name: str) -> tuple[dict[str, Any], Source]:
    """Return the values of a TOML text and where its keys stand."""
    try:
        values = tomllib.loads(text)
        for key in ("sensors", "excitations"):
            if isinstance(values.get(key), str):  # a table in a file of its own
                values[key] = [{"file": values[key]}]
        if isinstance(values.get("sections"), str):
            values["sections"] = {"file": values["sections"]}
        return values, Source(name, key_lines(text))
    except tomllib.TOMLDecodeError as reason:
        _refuse_deck(text, name)
        msg = f"{name}: {reason}{_suspicion(text, str(reason))}"
    except RecursionError:
        msg = (
            f"{name}: its lists or tables are nested hundreds of levels deep; a study has five levels at most"
        )
    except ValueError:  # Python converts no more than 4300 digits to an integer
        msg = f"{name}: it has a whole number with thousands of digits; at most 19 are allowed"
    raise StudyError(msg) from None


@dataclass(frozen=True, slots=True, eq=False)
class _Parts:
    """The parts of the structure: properties and element sizes of members, and effects."""

    properties: dict[str, MemberProperties]
    sizes: dict[str, tuple[float | None, int | None]]
    supports: tuple[Effect, ...]
    joints: tuple[Joint, ...]
    connections: tuple[Effect, ...]
    masses: tuple[Effect, ...]
    loads: Loads
    unbalances: tuple[Unbalance, ...]
    foreign: tuple[ForeignPart, ...]

    @property
    def frame(self) -> tuple[Effect, ...]:
        """Members, supports and joints."""
        return Frame(members=self.properties), *self.supports, *self.joints

    def base(self, mesh: Mesh) -> np.ndarray:
        """Return the first place where the structure is supported, or the mesh's first point, (3,) [m]."""
        places = [s.locations(Model(mesh, ())) for s in self.supports]
        places += [mesh.points[[j.point1]] for j in self.joints if j.point2 is None]
        return next((at[0] for at in places if len(at)), mesh.points[0])


def free_note(model: Model) -> str:
    """Return in words what holds a structure without supports."""
    names, n_free = held_by(model)
    if not names:
        return (
            "no supports are given: the structure is free. If something holds it, [[supports]] are "
            "missing (in a deck SPC, *BOUNDARY or D)"
        )
    free = f", and free in {counted(n_free, 'rigid-body motion')}" * bool(n_free)
    return f"no supports are given: the structure is held by {listed(names)} alone{free}"


def _highest(
    raw: list[RawMeasurement], raw_modes: RawModes | None, band: tuple[float, float] | None
) -> float | None:
    """Return the highest frequency of measurements and modes, None without any [Hz]."""
    highest = top_frequency(raw, band)
    if raw_modes is not None:
        highest = max(highest or 0.0, float(raw_modes.modes.frequency.max(initial=0.0))) or None
    return highest


@dataclass(slots=True)
class _Reader:
    path: Path
    text: str
    top: StudyTable
    needs: Collection[str]
    warnings: list[str] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)
    awaited: dict[str, str] = field(default_factory=dict)
    measured_notes: list[str] = field(default_factory=list)
    channel_errors: ChannelErrors = USUAL
    explaining: bool = False

    def explained(self, missing: MissingKeyError, needs: Collection[str]) -> StudyError:
        """Return the error of a missing key with the unknown keys of its table."""
        if self.explaining:
            return missing

        def read(values: dict[str, Any]) -> object:
            top = StudyTable(self.top.source, (), values)
            return _Reader(self.path, self.text, top, needs, explaining=True).read()

        return with_unknown_keys(missing, self.top.values, read)

    @contextmanager
    def _attempt(self, part: str) -> Iterator[None]:
        """Read a part of the study; a part that the command does not need is left out with a warning."""
        try:
            yield
        except (ValueError, OSError) as reason:
            missing = isinstance(reason, AwaitedFileError) and (part == "measurements" or self.awaited)
            awaited = missing or "sensors" in self.awaited  # other tables name those without a place
            if part in self.needs and not (awaited and "files" not in self.needs):
                raise
            if isinstance(reason, MissingKeyError):
                reason = self.explained(reason, (part,))
            place = f"{reason.filename}: {reason.strerror}" if isinstance(reason, OSError) else str(reason)
            self.left_out.append(" ".join(place.split()))
            if awaited:
                self.awaited.setdefault(part, self.left_out[-1])
            needed = awaited and part in self.needs
            why = "until the measured data exist" if needed else "because this command does not need it"
            self.warnings.append(f"left out, {why}: {self.left_out[-1]}")

    @contextmanager
    def _if_all_was_read(self) -> Iterator[None]:
        """Read a part that refers to sensors and measurements; skip it where some were left out."""
        try:
            yield
        except ValueError:
            if not self.left_out:
                raise

    def read(self) -> StudyContents:
        """Return the study; errors come in the order of the steps here."""
        top, notes = self.top, []
        name, description = self._head()
        for key in TABLES:
            top.get(key, None)
        top.finish()

        geometry = read_geometry(top, self.path.parent, notes)
        plane = read_plane(top, notes)
        parts = self._parts(geometry, notes)
        refuse_loads(top, plane)
        raw, raw_modes, nodes = self._files(notes)
        sensors, excitations = self._channels(raw, raw_modes, geometry, nodes, notes, parts)
        with self._attempt("sensors"):
            refuse_channels(plane, (*sensors, *excitations))
        groups = [[c.sensor for c in group] for group in (sensors, excitations)]

        fit = read_fit(top, sensors, excitations, self.measured_notes, self._if_all_was_read)
        measured_to = _highest(raw, raw_modes, fit.band)
        frequency, highest = read_frequency(top, measured_to, notes)
        superelements = tuple(
            part.reduced(geometry.mesh, highest, notes, with_modes=mode_std(top, part.name) > 0)
            for part in parts.foreign
        )
        mesh, chosen = self._refined(geometry.mesh, parts, highest, notes)
        damping, connection_damping = read_damping(top, self.path.parent, notes)
        flat = () if plane is None else (plane,)
        more = (*parts.connections, *superelements, *parts.masses, *connection_damping, *flat)
        kinds, exclude, environment, belief = read_candidates(top)
        model = self._model(mesh, (*parts.frame, *more), damping, groups, notes).in_environment(*environment)
        model = with_stated_form(top, model.with_belief(belief), self.path.parent, form=fit.model_error > 0)
        with top.at("excitations"):
            driven = with_moving_base(model, groups[1])

        every, modes, faults = self._measured(raw, raw_modes, sensors, excitations, notes)
        phased = [r.phase for r in raw] if every else []
        measurements = tuple(m for m, phase in zip(every, phased, strict=True) if phase)
        amplitudes = tuple(m for m, phase in zip(every, phased, strict=True) if not phase)
        spreads: list[str] = []
        nuisances, damping_std = read_uncertain(top, model, spreads)
        notes += spreads
        plan = self._plan(model, groups, nuisances, bool(raw), any(r.phase for r in raw), modes)
        self.warnings += [f"{m.name} has {WITHOUT_PHASE}" for m in amplitudes]
        odd = implausible(top, model, highest)
        if "measurements" in self.needs and every:
            with naming_implausible(odd), top.at():
                self.warnings += self._suspicions(
                    driven, raw, (measurements, amplitudes), sensors, excitations
                )
        if "measurements" in self.needs and modes is not None:
            with naming_implausible(odd), top.at("modes"):
                self.warnings += mode_suspicions(modes, model)
        baseline = self._baseline(self._modal_test(raw, sensors, excitations))
        if measurements and modes is not None and "baseline" in top:
            unused = "the FRFs of [[measurements]] are" if baseline is not None else "[modes] are"
            self.warnings.append(f"{unused} not used: [baseline] says by what the two states are compared")
        if not parts.supports:
            notes.append(free_note(model))
        return StudyContents(
            name=name,
            description=description,
            path=self.path,
            text=self.text,
            model=model,
            measurements=measurements,
            amplitudes=amplitudes,
            sensors=as_mounted(groups[0], "sensor", faults),
            excitations=as_mounted(groups[1], "excitation", faults),
            nuisances=nuisances,
            damping_std=damping_std,
            kinds=kinds,
            exclude=exclude,
            **fit.contents,
            frequency=frequency,
            max_frequency=highest,
            element_size=(float(mesh.lengths().min(initial=np.inf)), float(mesh.lengths().max(initial=0.0))),
            assumptions=tuple(dict.fromkeys(notes)),
            assumed_spreads=tuple(spreads),
            modes=modes,
            update_plan=plan,
            relevant=read_relevant(top),
            channel_errors=self.channel_errors,
            warnings=tuple(dict.fromkeys([*odd, *self.warnings])),
            implausible=odd,
            left_out=tuple(dict.fromkeys(self.left_out)),
            awaited=tuple(self.awaited.values()),
            shape_limits=read_shape_limits(top),
            chosen_sizes=chosen,
            labels={
                key: {c.sensor.name: c.written for c in group if c.written}
                for key, group in (("outputs", sensors), ("inputs", excitations))
            },
            measured_notes=tuple(dict.fromkeys(self.measured_notes)),
            loads=parts.loads,
            unbalances=parts.unbalances,
            baseline=baseline,
            ambient=read_ambient(top, self.path.parent, sensors),
            baseline_frfs=self._baseline_frfs(measurements, sensors, excitations, faults, notes),
            changes=read_changes(top),
            states=self._states(self._modal_test(raw, sensors, excitations)),
            source=self._source(),
            estimates=read_estimates(top),
        )

    def _modal_test(
        self, raw: Sequence[RawMeasurement], sensors: Sequence[Channel], excitations: Sequence[Channel]
    ) -> ModalTest:
        """Return the channels of the tests of modes: all, unless FRFs are what they are for."""
        no_frfs = not raw and "measurements" not in self.top.table("baseline")
        return ModalTest(sensors, excitations, no_frfs)

    def _states(self, test: ModalTest) -> tuple[ModesState, ...]:
        """Read ``[[states]]``: the modes of states after the baseline."""
        states: tuple[ModesState, ...] = ()
        with self._attempt("measurements"):
            states = read_states(self.top, self.path.parent, self.measured_notes, test)
        return states

    def _baseline(self, test: ModalTest) -> MeasuredModes | None:
        """Read ``[baseline]``: the modes of an earlier state."""
        baseline = None
        if "measurements" in self.top.table("baseline"):
            return None
        with self._attempt("measurements"):
            raw = read_raw_modes(self.top, self.path.parent, self.measured_notes, "baseline")
            baseline = match_modes(raw, test, self.measured_notes)
        return baseline

    def _channel_errors(self, sensors: Sequence[Channel], excitations: Sequence[Channel]) -> ChannelErrors:
        return read_channel_errors(self.top, [c.sensor for c in sensors], [c.sensor for c in excitations])

    def _baseline_frfs(
        self,
        measured: Sequence[Measurement],
        sensors: Sequence[Channel],
        excitations: Sequence[Channel],
        faults: Sequence[Fault],
        notes: list[str],
    ) -> Measurement | None:
        """Read ``[[baseline.measurements]]``: the FRFs of an earlier state, in the band of the later one."""
        t = self.top.table("baseline")
        if "measurements" not in t:
            return None
        baseline = None
        with self._attempt("measurements"):
            raw, _ = read_files(t, self.path.parent, notes, self.measured_notes)
            t.finish()
            if len(raw) != 1 or not raw[0].phase:
                t.refuse("measurements", f"{len(raw)} matrices of FRFs are given; one with phases is needed")
            later = any(key in self.top for key in ("measurements", "modes", "states"))
            if not later:
                t.refuse(
                    "measurements",
                    "the study has no [[measurements]], [modes] or [[states]] to compare with these",
                )
            frf = raw[0].frf
            rows = [c for c in sensors if c.find(frf.outputs) is not None]
            columns = [c for c in excitations if c.find(frf.inputs) is not None]
            (one,) = match(raw, rows, columns, faults, notes)
            baseline = one = replace(one, errors=self._channel_errors(sensors, excitations))
            if measured:
                f = measured[0].frf.frequency
                baseline = one.with_frf(one.frf.select(band=(float(f[0]), float(f[-1]))))
        return baseline

    def _suspicions(
        self,
        model: Model,
        raw: Sequence[RawMeasurement],
        measured: tuple[Sequence[Measurement], Sequence[Measurement]],
        sensors: list[Channel],
        excitations: list[Channel],
    ) -> list[str]:
        """Judge FRFs, and amplitudes without phase, which are asked for their size alone."""
        out: list[str] = []
        comparisons = LazyComparison.of(model, measured[0])
        phased = [r for r in raw if r.phase]
        evidence = check_phase(comparisons, phased, sensors, excitations, out)
        out += suspicions(comparisons, phased, evidence)
        bare = [r for r in raw if not r.phase]
        return out + suspicions(LazyComparison.of(model, measured[1]), bare, [None] * len(bare))

    def _head(self) -> tuple[str, str]:
        """Read ``[study]``; a study without a name has that of its file or folder."""
        head, path = self.top.table("study"), self.path
        name = head.text("name", path.parent.resolve().name if path.stem == "study" else path.stem)
        description = head.get("description", "")
        head.finish()
        return name, description

    def _source(self) -> SourceDeck | None:
        """Read ``[source]``, the deck that the study was made of; the file need not be there."""
        if "source" not in self.top:
            return None
        table = self.top.table("source")
        file = self.path.parent / table.text("file")
        units = table.get("units", "SI")
        try:
            units = units if isinstance(units, str) else tuple(map(float, units))
            DeckUnits.of(units)
        except (TypeError, ValueError) as reason:
            table.refuse("units", f"{reason}")
        table.finish()
        return SourceDeck(file, units)

    def _parts(self, geometry: Geometry, notes: list[str]) -> "_Parts":
        """Read the parts of the structure that need no mesh of elements."""
        top = self.top
        inline = "file" not in top.table("mesh").values
        materials, known_sections = read_materials(top), read_sections(top, self.path.parent, notes)
        properties, sizes, layers = read_members(top, geometry.mesh, inline, materials, known_sections)
        notes.extend((*note_shear_centres(properties, known_candidates(top)), *note_one_sided(properties)))
        foreign = read_foreign_parts(top, geometry, self.path.parent)
        joints = (*(joint for part in foreign for joint in part.joints), *read_joints(top, geometry))
        supports = read_supports(top, geometry)
        connections = (
            *read_viscoelastic(top, geometry),
            *read_rigid_links(top, geometry),
            *read_constraints(top, geometry),
            *read_sprung_masses(top, geometry),
        )
        masses = (*read_masses(top, geometry), *layers)
        loads = read_loads(top, geometry, (*supports, *joints))
        unbalances = read_unbalances(top, geometry)
        return _Parts(properties, sizes, supports, joints, connections, masses, loads, unbalances, foreign)

    def _refined(
        self, mesh: Mesh, parts: "_Parts", highest: float, notes: list[str]
    ) -> tuple[Mesh, dict[str, float]]:
        """Return the mesh of elements, and the sizes aimed at that were chosen here, by member."""
        top, sizes = self.top, parts.sizes
        table = top.table("mesh")
        size = table.number("element_size", None, above=0, unit="m")
        most = table.integer("max_elements", None)
        for key in ("file", "scale", "merge_tolerance", "sets", "connect", "plane", "free_points"):
            table.get(key, None)
        table.finish()
        try:
            fine, aimed = refine(mesh, parts.properties, highest, size, sizes, most=most)
        except TooManyElementsError as reason:
            place = path_of_request(reason, top.values, mesh)
            raise top.source.error(place, str(reason)) from reason
        except ValueError as reason:
            raise top.source.error(table.path, str(reason)) from reason
        if size is not None:
            return fine, {}
        given = [any(pair) for pair in sizes.values()]
        if not all(given):
            notes.append(
                f"no element size is given{' for all members' if any(given) else ''}: elements of "
                f"{describe_sizes(fine.lengths())} ({fine.n_lines} in all) are taken, "
                f"at least 12 for the shortest bending wave at {highest:g} Hz and 4 for a member"
            )
        chosen = zip(sizes, aimed, given, strict=True)
        return fine, {name: float(h) for name, h, is_given in chosen if not is_given}

    def _model(
        self,
        mesh: Mesh,
        effects: tuple[Effect, ...],
        damping: Damping,
        groups: Sequence[list[Sensor]],
        notes: list[str],
    ) -> Model:
        """Return the model with masses of sensors, the study's effects and values, and shear coefficients."""
        top = self.top
        with top.at():
            model = with_sensor_masses(
                Model(mesh, effects, damping), [sensor for group in groups for sensor in group]
            )
            model = read_effects(top, model, *groups)
            model = read_rotation(top, read_values(top, with_shear(top, model)), notes)
            refuse_space(top, model)
            model.contributions()  # finds values that no matrix can be made of
        return with_ties_known(model)

    def _measured(
        self,
        raw: list[RawMeasurement],
        raw_modes: RawModes | None,
        sensors: list[Channel],
        excitations: list[Channel],
        notes: list[str],
    ) -> tuple[tuple[Measurement, ...], MeasuredModes | None, tuple[Fault, ...]]:
        """Return measurements and modes at the study's sensors, and the faults that the study states."""
        measurements, modes, faults = (), None, ()
        with self._attempt("measurements"):
            faults = read_faults(self.top, [c.sensor for c in sensors], [c.sensor for c in excitations])
            errors = self.channel_errors = self._channel_errors(sensors, excitations)
            measurements = tuple(
                replace(m, errors=errors) for m in match(raw, sensors, excitations, faults, notes)
            )
        with self._attempt("measurements"):
            test = self._modal_test(raw, sensors, excitations)
            modes = match_modes(raw_modes, test, self.measured_notes)
        return measurements, modes, faults

    def _plan(
        self,
        model: Model,
        groups: Sequence[list[Sensor]],
        nuisances: Sequence[Nuisance],
        has_frf: bool,
        has_phase: bool,
        modes: MeasuredModes | None,
    ) -> UpdatePlan:
        """Read ``[update]``."""
        shaped = has_phase or (modes is not None and modes.has_shapes)
        has = {"frf": has_frf, "modes": shaped, "frequencies": has_phase or modes is not None}
        shear = tuple(n for n in nuisances if n.effect == SectionShear.kind)
        known, plan = [unknown_of(model, n) for n in nuisances if n not in shear], UpdatePlan()
        with self._if_all_was_read():
            plan = read_plan(self.top, model, has, known, lambda kind: candidates_of(kind, model, *groups))
        return replace(plan, nuisances=shear)

    def _files(self, notes: list[str]) -> tuple[list[RawMeasurement], RawModes | None, dict[int, np.ndarray]]:
        """Read the measured files: FRFs, modes, and the coordinates of their nodes."""
        raw, raw_modes, nodes = [], None, {}
        with self._attempt("measurements"):
            raw, nodes = read_files(self.top, self.path.parent, notes, self.measured_notes)
        with self._attempt("measurements"):
            raw_modes = read_raw_modes(self.top, self.path.parent, self.measured_notes)
        return raw, raw_modes, nodes if raw_modes is None else {**raw_modes.nodes, **nodes}

    def _channels(
        self,
        raw: list[RawMeasurement],
        raw_modes: RawModes | None,
        geometry: Geometry,
        nodes: dict[int, np.ndarray],
        notes: list[str],
        parts: "_Parts",
    ) -> tuple[list[Channel], list[Channel]]:
        """Read sensors and excitations, or take those of the measured files."""
        sensors: list[Channel] = []
        excitations: list[Channel] = []

        def attempt() -> AbstractContextManager[None]:
            return self._attempt("sensors")

        reader = ChannelReader(self.top, self.path.parent, geometry, nodes, attempt, notes, self.warnings)
        with attempt():
            sensors = reader.sensors()
            responses = labels_of(raw, "outputs", motions=True) or (
                [] if raw_modes is None else raw_modes.modes.labels
            )
            if responses and not sensors:
                sensors = reader.of_labels(responses, "sensors")
                notes.append(
                    f"no sensors are given: the {len(sensors)} responses of the measured files are "
                    "taken, at their nodes"
                )
        with attempt():
            excitations = reader.excitations(sensors, parts.base(geometry.mesh))
            if raw and not excitations:
                # the forces at the sensors of the same channel, or else at their nodes
                forces = [
                    [c for c in sensors if c.find([label]) is not None][:1]
                    or reader.of_labels([label], "excitations")
                    for label in labels_of(raw, "inputs")
                ]
                excitations = [c for found in forces for c in found]
                notes.append(
                    "no excitations are given: the forces of the measured files are taken, "
                    f"{', '.join(c.sensor.name for c in excitations)}"
                )
        return sensors, excitations
