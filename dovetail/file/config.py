"""From a study file to a :class:`Study`: a model, measurements, and what is uncertain about them."""

import os
import tomllib
from collections.abc import Collection, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from dovetail.file.connections import (
    read_constraints,
    read_joints,
    read_rigid_links,
    read_superelements,
    read_viscoelastic,
)
from dovetail.file.conventions import check_phase
from dovetail.file.effects import candidates_of, read_effects, read_values
from dovetail.file.faults import read_faults, tilted
from dovetail.file.geometry import (
    MOST_ELEMENTS,
    Geometry,
    TooManyElementsError,
    describe_sizes,
    read_geometry,
    refine,
)
from dovetail.file.lines import key_lines
from dovetail.file.measured import (
    RawMeasurement,
    labels_of,
    match,
    read_band,
    read_files,
    read_held_out,
    top_frequency,
)
from dovetail.file.measured_modes import (
    MeasuredModes,
    RawModes,
    ShapeLimits,
    UpdatePlan,
    match_modes,
    read_plan,
    read_raw_modes,
    read_shape_limits,
)
from dovetail.file.parts import (
    note_shear_centres,
    read_damping,
    read_masses,
    read_materials,
    read_members,
    read_sections,
    read_supports,
)
from dovetail.file.plausible import beside_implausible, implausible, path_of_request
from dovetail.file.sensors import Channel, channels_of_labels, read_excitations, read_sensors
from dovetail.file.suspicions import LazyComparison, suspicions
from dovetail.file.table import Source, StudyError, Table, suggest
from fem.effects import candidate_kinds
from fem.effects.joint import Joint
from fem.effects.section_shear import SectionShear
from fem.elements.frame import Frame
from fem.materials import Material
from fem.model import DIRECTIONS, Effect, Model
from updating.diagnosis.patches import with_turning
from updating.inference.fit import EXPLAINED_LEVEL
from updating.inference.parameters import Nuisance
from updating.inference.unknowns import unknown_of
from updating.measurement.measurement import Measurement, Sensor, with_sensor_masses

DEFAULT_FREQUENCY = 1000.0
"""Highest frequency of interest where neither a measurement nor the study gives one [Hz]."""


SHEAR_STD = 0.3
"""Relative standard deviation of shear coefficients of sections with walls, unless the study says it."""
NEEDS = ("sensors", "measurements")
"""What a study has besides the model: sensors with excitations, and what was measured at them."""
MOST_REPEATS = 10_000
"""Simulated measurements beyond which a mistake is taken for granted."""
MOST_LINES = 1_000_000
"""Frequency lines beyond which a mistake is taken for granted."""


@dataclass(frozen=True, slots=True, eq=False)
class Study:
    """A structure, what was measured on it, and what is uncertain.

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
    evidence : bool
        Whether effects are searched for by evidence.
    n_simulated : int
        Measurements to simulate for trying a verdict against chance.
    n_lines : int or None
        Number of frequency lines to fit; None for the program's choice.
    held_out : tuple of str
        Names of excitations whose FRFs are compared but not fitted.
    held_out_sensors : tuple of str
        Names of sensors whose FRFs are.
    frequency : ndarray
        Lines of :command:`dovetail frf` where there is no measurement [Hz].
    max_frequency : float
        What the mesh is fine enough for [Hz].
    element_size : (float, float)
        Smallest and largest element size aimed at [m].
    assumptions : tuple of str
        What the study did not say and was assumed, in sentences.
    modes : MeasuredModes or None
        Measured modes, where the study gives them.
    plan : UpdatePlan
        What :command:`dovetail update` does.
    warnings : tuple of str
        What is probably wrong in the study and its files, and what was left unread, in sentences.
    implausible : tuple of str
        Those of them that are about values of the model, with file, line and key.
    shape_limits : ShapeLimits
        How complex the shapes of modes identified in FRFs may be.
    chosen_sizes : mapping of str to float
        Element sizes of the members for which the study gives none [m].
    labels : mapping
        How files call sensors (``"outputs"``) and excitations (``"inputs"``), by their names, where the study
        says it.
    measured_notes : tuple of str
        What the readers of the measured files left out, converted or found twice, a sentence each.
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
    n_simulated: int
    n_lines: int | None
    held_out: tuple[str, ...]
    held_out_sensors: tuple[str, ...]
    frequency: np.ndarray
    max_frequency: float
    element_size: tuple[float, float]
    assumptions: tuple[str, ...]
    modes: MeasuredModes | None = None
    plan: UpdatePlan = UpdatePlan()  # noqa: RUF009 - frozen
    warnings: tuple[str, ...] = ()
    implausible: tuple[str, ...] = ()
    shape_limits: ShapeLimits = ShapeLimits()  # noqa: RUF009 - frozen
    chosen_sizes: Mapping[str, float] = field(default_factory=dict)
    labels: Mapping[str, Mapping[str, str]] = field(default_factory=lambda: {"outputs": {}, "inputs": {}})
    measured_notes: tuple[str, ...] = ()
    evidence: bool = False

    def refined(self, factor: int) -> "Study":
        """Return the study with every element divided by a factor; points keep their indices."""
        return replace(self, model=self.model.with_mesh(self.model.mesh.split(factor)))


def load_study(path: str | os.PathLike[str], needs: Collection[str] = NEEDS) -> Study:
    """Read a study file and the files that it names.

    Parameters
    ----------
    path : path
        A TOML file; see docs/study-file.md. Other files are looked for beside it.
    needs : collection of str
        What besides the model must be right, some of ``NEEDS``. Anything else that cannot be read is left
        out, which ``Study.warnings`` says.

    Raises
    ------
    StudyError
        If something in it cannot be meant; the message names file, line and key.
    OSError
        If the file cannot be opened.
    """
    path = Path(path)
    raw = path.read_bytes()
    try:
        text = raw.decode("utf-8")
    except UnicodeDecodeError as reason:
        line = raw.count(b"\n", 0, reason.start) + 1
        msg = f"{path.name}, line {line}: the text is not UTF-8"
        raise StudyError(msg) from None
    return read_study(text, path, needs)


def read_study(text: str, path: Path, needs: Collection[str] = NEEDS) -> Study:
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
    return _Reader(path, text, Table(source, (), values), needs).read()


def _parsed(text: str, name: str) -> tuple[dict[str, Any], Source]:
    """Return the values of a TOML text and where its keys stand."""
    try:
        values = tomllib.loads(text)
        return values, Source(name, key_lines(text))
    except tomllib.TOMLDecodeError as reason:
        msg = f"{name}: {reason}"
    except RecursionError:
        msg = (
            f"{name}: its lists or tables are nested hundreds of levels deep; a study has five levels at most"
        )
    except ValueError:  # Python converts no more than 4300 digits to an integer
        msg = f"{name}: it has a whole number with thousands of digits; at most 19 are allowed"
    raise StudyError(msg) from None


@dataclass(slots=True)
class _Reader:
    path: Path
    text: str
    top: Table
    needs: Collection[str]
    warnings: list[str] = field(default_factory=list)
    measured_notes: list[str] = field(default_factory=list)

    @contextmanager
    def _attempt(self, part: str) -> Iterator[None]:
        """Read a part of the study; what a command can do without is left out with a warning."""
        try:
            yield
        except (ValueError, OSError) as reason:
            if part in self.needs:
                raise
            place = f"{reason.filename}: {reason.strerror}" if isinstance(reason, OSError) else str(reason)
            self.warnings.append(
                f"left out, because this command does not need it: {' '.join(place.split())}"
            )

    @contextmanager
    def _if_all_was_read(self) -> Iterator[None]:
        """Read what refers to sensors and measurements; it has no meaning where some were left out."""
        try:
            yield
        except ValueError:
            if not self.warnings:
                raise

    def read(self) -> Study:
        top, notes = self.top, []
        head = top.table("study")
        name = head.text(
            "name", self.path.parent.resolve().name if self.path.stem == "study" else self.path.stem
        )
        description = head.get("description", "")
        head.finish()
        sections = (
            "study",
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
            "effects",
            "damping",
            "sensors",
            "excitations",
            "measurements",
            "faults",
            "modes",
            "identification",
            "update",
            "values",
            "uncertain",
            "candidates",
            "fit",
            "frequency",
        )
        for key in sections:
            top.get(key, None)
        top.finish()

        geometry = read_geometry(top, self.path.parent, notes)
        inline = "file" not in top.table("mesh").values
        materials, known_sections = read_materials(top), read_sections(top)
        properties, sizes = read_members(top, geometry.mesh, inline, materials, known_sections)
        notes.extend(note_shear_centres(properties))
        supports, joints = read_supports(top, geometry), read_joints(top, geometry)
        connections = (
            *read_viscoelastic(top, geometry),
            *read_rigid_links(top, geometry),
            *read_constraints(top, geometry),
        )
        masses = read_masses(top, geometry)
        raw, raw_modes, nodes = self._files(notes)
        sensors, excitations = self._channels(raw, raw_modes, geometry, nodes, notes)

        fit = top.table("fit")
        band, n_lines = read_band(fit), fit.whole("lines", None, 8, MOST_LINES)
        n_simulated = fit.whole("bootstrap", 0, 0, MOST_REPEATS)
        by_evidence = fit.flag("evidence", False)
        model_error = fit.number("model_error", EXPLAINED_LEVEL, least=0.0, unit="neper")
        held_out, held_out_sensors = (), ()
        fit.get("held_out", ())
        with self._if_all_was_read():
            held_out, held_out_sensors = read_held_out(fit, sensors, excitations)
        fit.finish()
        top_line = top_frequency(raw, band)
        if raw_modes is not None:
            top_line = max(top_line or 0.0, float(raw_modes.modes.frequency.max(initial=0.0))) or None
        frequency, highest = self._frequency(top_line, bool(raw), notes)
        superelements = read_superelements(top, geometry, self.path.parent, highest, notes)

        mesh_table = top.table("mesh")
        size = mesh_table.number("element_size", None, above=0, unit="m")
        most = mesh_table.whole("max_elements", MOST_ELEMENTS)
        for key in ("file", "scale", "merge_tolerance", "sets", "connect"):
            mesh_table.get(key, None)
        mesh_table.finish()
        try:
            mesh, aimed = refine(geometry.mesh, properties, highest, size, sizes, most=most)
        except TooManyElementsError as reason:
            place = path_of_request(reason, top.values, geometry.mesh)
            raise top.source.error(place, str(reason)) from reason
        except ValueError as reason:
            raise top.source.error(mesh_table.path, str(reason)) from reason
        chosen = {
            name: float(h)
            for (name, own), h in zip(sizes.items(), aimed, strict=True)
            if size is None and not any(own)
        }
        if size is None and not all(any(v) for v in sizes.values()):
            notes.append(
                "no element size is "
                f"given{' for all members' if any(any(v) for v in sizes.values()) else ''}: elements of "
                f"{describe_sizes(aimed)} ({mesh.n_lines} in all) are taken, "
                f"at least 12 for the shortest bending wave at {highest:g} Hz and 4 for a member"
            )
        damping, connection_damping = read_damping(top, self.path.parent, notes)
        effects: tuple[Effect, ...] = (
            Frame(members=properties),
            *supports,
            *joints,
            *connections,
            *superelements,
            *masses,
            *connection_damping,
        )
        with top.at():
            model = Model(mesh, effects, damping)
            model = with_sensor_masses(model, [c.sensor for c in (*sensors, *excitations)])
            groups = [[c.sensor for c in group] for group in (sensors, excitations)]
            model = read_effects(top, model, *groups)
            shear = SectionShear.of(model)
            model = model.with_effect(shear) if shear and self._shear_std() else model
            model = read_values(top, model)
            model.contributions()
        measurements, modes, faults = (), None, ()
        with self._attempt("measurements"):
            faults = read_faults(top, *groups)
            measurements = match(raw, sensors, excitations, faults, notes)
        with self._attempt("measurements"):
            modes = match_modes(raw_modes, sensors, notes)
        nuisances, damping_std = self._uncertain(model, joints, notes)
        kinds, exclude = self._candidates()
        shaped = bool(raw) or (modes is not None and bool(modes.sensors))
        has = {"frf": bool(raw), "modes": shaped, "frequencies": bool(raw) or modes is not None}
        known = [unknown_of(model, n) for n in nuisances if n.effect != SectionShear.kind]
        plan = UpdatePlan()
        with self._if_all_was_read():
            plan = read_plan(top, model, has, known, lambda kind: candidates_of(kind, model, *groups))
        odd = implausible(top, model, highest)
        if "measurements" in self.needs and measurements:
            with beside_implausible(odd), top.at():
                comparisons = LazyComparison.of(model, measurements)
                evidence = check_phase(comparisons, raw, sensors, excitations, self.warnings)
                self.warnings += suspicions(comparisons, raw, evidence)
        if not supports:
            grounded = [j.name for j in joints if j.point2 is None]
            notes.append(
                "no supports are given: the structure is free"
                if not grounded
                else f"no supports are given: {', '.join(grounded)} alone hold the structure"
            )
        return Study(
            name,
            description,
            self.path,
            self.text,
            model,
            measurements,
            tilted(groups[0], faults),
            tuple(groups[1]),
            nuisances,
            damping_std,
            kinds,
            exclude,
            band,
            model_error,
            n_simulated,
            n_lines,
            held_out,
            held_out_sensors,
            frequency,
            highest,
            (float(aimed.min()), float(aimed.max())),
            tuple(dict.fromkeys(notes)),
            modes,
            plan,
            tuple(dict.fromkeys([*odd, *self.warnings])),
            odd,
            read_shape_limits(top),
            chosen,
            {
                key: {c.sensor.name: c.written for c in group if c.written}
                for key, group in (("outputs", sensors), ("inputs", excitations))
            },
            tuple(dict.fromkeys(self.measured_notes)),
            by_evidence,
        )

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
    ) -> tuple[list[Channel], list[Channel]]:
        """Read sensors and excitations, or take those of the measured files."""
        top = self.top
        sensors: list[Channel] = []
        excitations: list[Channel] = []

        def attempt() -> AbstractContextManager[None]:
            return self._attempt("sensors")

        with attempt():
            sensors = read_sensors(top, geometry, nodes, notes, attempt)
            responses = labels_of(raw, "outputs") or ([] if raw_modes is None else raw_modes.modes.labels)
            if responses and not sensors:
                sensors = channels_of_labels(top, responses, geometry, nodes, "sensors", notes)
                notes.append(
                    f"no sensors are given: the {len(sensors)} responses of the measured files are "
                    "taken, at their nodes"
                )
        with attempt():
            excitations = read_excitations(top, geometry, sensors, nodes, notes, attempt)
            if raw and not excitations:
                excitations = self._excitations_of(labels_of(raw, "inputs"), sensors, geometry, nodes, notes)
        return sensors, excitations

    def _excitations_of(
        self,
        labels: list[str],
        sensors: list[Channel],
        geometry: Geometry,
        nodes: dict[int, np.ndarray],
        notes: list[str],
    ) -> list[Channel]:
        """Take the forces of the files: at the sensors of the same channel, or else at their nodes."""
        out = []
        for label in labels:
            found = [c for c in sensors if c.find([label]) is not None]
            out += found[:1] or channels_of_labels(self.top, [label], geometry, nodes, "excitations", notes)
        notes.append(
            "no excitations are given: the forces of the measured files are taken, "
            f"{', '.join(c.sensor.name for c in out)}"
        )
        return out

    def _frequency(self, highest: float | None, measured: bool, notes: list[str]) -> tuple[np.ndarray, float]:
        """Read ``[frequency]``."""
        t = self.top.table("frequency")
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

    def _uncertain(
        self, model: Model, joints: tuple[Joint, ...], notes: list[str]
    ) -> tuple[tuple[Nuisance, ...], float]:
        """Read ``[uncertain]``: relative standard deviations; 0 for what is known."""
        t = self.top.table("uncertain")
        default = {"E": 0.02, "rho": 0.01, "joints": 0.05, "shear": SHEAR_STD, "damping": 0.5}
        std = {key: t.number(key, None, least=0) for key in default}
        shear = model.of_kind(SectionShear)
        there = {"joints": any(j.elastic for j in joints), "shear": bool(shear)}
        assumed = [key for key, value in std.items() if value is None and there.get(key, True)]
        words = {
            "E": "E 2 %",
            "rho": "density 1 %",
            "joints": "joint stiffness 5 %",
            "shear": f"shear coefficients of walls {SHEAR_STD:.0%}".replace("%", " %"),
            "damping": "damping a factor of 1.6 (0.5 of its logarithm)",
        }
        if assumed:
            notes.append(
                "default standard deviations, for those that are not given: "
                f"{', '.join(words[key] for key in assumed)}"
            )
        std = {key: default[key] if value is None else value for key, value in std.items()}
        frame = model.effect("frame")
        materials: dict[str, Material] = frame.materials if isinstance(frame, Frame) else {}
        out = []
        by_material, by_joint = t.table("materials"), t.table("joint")
        for name in materials:
            own = by_material.table(name)
            for key in ("E", "rho"):
                out.append(Nuisance("frame", f"{key}:{name}", own.number(key, std[key], least=0)))
            own.finish()
        by_material.finish()
        for joint in joints:
            own = by_joint.table(joint.name)
            whole = own.number("k", std["joints"], least=0)
            for d in DIRECTIONS:
                value = own.number(f"k{d}", whole, least=0)
                if d in joint.elastic:
                    out.append(Nuisance(joint.name, f"k{d}", value))
                elif f"k{d}" in own.values:
                    own.refuse(
                        f"k{d}",
                        f"joint '{joint.name}' has no stiffness in {d}; elastic are "
                        f"{', '.join(joint.elastic) or 'none'}",
                    )
            eta = own.number("eta", 0.0, least=0)
            if eta and not joint.eta:
                own.refuse("eta", f"joint '{joint.name}' has no loss factor")
            out.append(Nuisance(joint.name, "eta", eta))
            own.finish()
        by_joint.finish()
        t.finish()
        out += [Nuisance(e.name, p.name, std["shear"]) for e in shear for p in e.parameters()]
        return with_turning([n for n in out if n.std > 0], model), std["damping"]

    def _shear_std(self) -> float:
        """Return how unsure shear coefficients are that the study does not state."""
        return self.top.table("uncertain").number("shear", SHEAR_STD, least=0)

    def _candidates(self) -> tuple[tuple[str, ...] | None, tuple[str, ...]]:
        t = self.top.table("candidates")
        kinds, exclude = t.texts("kinds", None), t.texts("exclude", ())
        t.finish()
        known = candidate_kinds()
        for key, words in (("kinds", kinds or ()), ("exclude", exclude)):
            for word in words:
                if word not in known:
                    t.refuse(key, f"there is no kind of effect '{word}'; {suggest(word, known)}")
        return kinds, exclude
