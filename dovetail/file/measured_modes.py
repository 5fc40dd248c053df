"""Measured modes of a study, their identification, and updates: [modes], [identification], [update]."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from pathlib import Path

import numpy as np

from dovetail.file.measured import notes_of
from dovetail.file.mode_table import TABLE_SUFFIXES, read_mode_table
from dovetail.file.sensors import Channel, Nodes
from dovetail.file.table import StudyTable, no_candidate, suggest
from fem.analysis.modes import Modes
from fem.effects import candidate_kinds
from fem.io import UFF_SUFFIXES, read_modes, read_npz_mode_std
from fem.io.arrays import MODE_STD
from fem.io.faults import no_file
from fem.io.uff import read_quietly
from fem.model import Effect, Model, ParameterRef
from updating.correlation.complexity import LARGEST_MPD, LEAST_MPC
from updating.inference.parameters import Nuisance
from updating.inference.unknowns import Unknown, checked_unknowns
from updating.inference.update_settings import UpdateSettings
from updating.measurement.measurement import Sensor, shapes_like_motions

TARGETS: tuple[str, ...] = ("frf", "modes", "frequencies")
"""Data that a model may be updated to: FRFs, natural frequencies with shapes, natural frequencies alone."""


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredModes:
    """Natural frequencies, and shapes where there are any, at sensors of the study.

    Attributes
    ----------
    modes : Modes
        Rows of the shapes by the names of the sensors, NaN where a mode was not measured; no rows where
        frequencies alone are known.
    sensors : tuple of Sensor
        Of the rows of the shapes; without shapes those of the test, where they are known.
    frequency_std : ndarray (n_modes,)
        Relative standard deviations of the frequencies [-].
    shape_std : ndarray (n_modes,)
        Standard deviations of a component, relative to the root mean square of the shape [-].
    name : str
        Where they come from.
    zeta_std : float or ndarray (n_modes,)
        Relative standard deviations of the damping ratios [-].
    numbers : tuple of int
        Which elastic modes of the model they are, counted from 1; empty where the data say it.
    plane : str
        Axes along which the test has seen motion, such as ``"xz"``; empty for all.
    held_out : tuple of int
        Modes that are predicted and not fitted, counted from 1 in rising order.
    driven : tuple of Sensor
        Forces of the test, where they are known.
    """

    modes: Modes
    sensors: tuple[Sensor, ...]
    frequency_std: np.ndarray
    shape_std: np.ndarray
    name: str
    zeta_std: float | np.ndarray = 0.1
    numbers: tuple[int, ...] = ()
    plane: str = ""
    held_out: tuple[int, ...] = ()
    driven: tuple[Sensor, ...] = ()

    @property
    def has_shapes(self) -> bool:
        """Whether shapes were measured."""
        return len(self.modes.shapes) > 0


@dataclass(frozen=True, slots=True, eq=False)
class ModesState:
    """The modes of one of several states of a structure.

    Attributes
    ----------
    name : str
    modes : MeasuredModes
    since : str
        Name of the earlier state that it is compared with; empty for the baseline.
    """

    name: str
    modes: MeasuredModes
    since: str = ""


@dataclass(frozen=True, slots=True)
class ShapeLimits:
    """How complex the shapes of identified modes may be.

    Attributes
    ----------
    least_mpc : float
        Smallest modal phase collinearity, 0 to 1 [-].
    largest_mpd : float
        Largest mean phase deviation, 0 to 90 [degrees].
    """

    least_mpc: float = LEAST_MPC
    largest_mpd: float = LARGEST_MPD


def read_shape_limits(top: StudyTable) -> ShapeLimits:
    """Read ``[identification]``."""
    t = top.table("identification")
    limits = ShapeLimits(
        t.number("least_mpc", LEAST_MPC, least=0.0), t.number("largest_mpd", LARGEST_MPD, least=0.0)
    )
    for key, value, most in (("least_mpc", limits.least_mpc, 1), ("largest_mpd", limits.largest_mpd, 90)):
        if value > most:
            t.refuse(key, f"it is {value:g}; 0 to {most} is allowed")
    t.finish()
    return limits


@dataclass(frozen=True, slots=True, eq=False)
class UpdatePlan:
    """Parameters to update, and the data for it.

    Attributes
    ----------
    to : tuple of str
        Some of ``TARGETS``; empty for all that the study has.
    unknowns : tuple of Unknown
    damping : bool
        Whether damping is updated, too.
    settings : UpdateSettings
    effects : tuple of Effect
        Candidates that parameters are of and the model has not; they join it for the update.
    nuisances : tuple of Nuisance
        Further uncertain parameters.
    """

    to: tuple[str, ...] = ()
    unknowns: tuple[Unknown, ...] = ()
    damping: bool = True
    settings: UpdateSettings = UpdateSettings()  # noqa: RUF009 - frozen
    effects: tuple[Effect, ...] = ()
    nuisances: tuple[Nuisance, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class ModalTest:
    """Channels of the tests that gave measured modes.

    Attributes
    ----------
    sensors, excitations : sequence of Channel
        Of the study.
    alone : bool
        Whether the study has no FRFs, so that all of them are of the tests of its modes.
    """

    sensors: Sequence[Channel]
    excitations: Sequence[Channel]
    alone: bool


@dataclass(frozen=True, slots=True, eq=False)
class RawModes:
    """Modes as their file has them, with the coordinates of its nodes [m] and its standard deviations [-]."""

    table: StudyTable
    modes: Modes
    nodes: Nodes
    name: str
    std: Mapping[str, np.ndarray] = field(default_factory=dict)


def read_raw_modes(
    top: StudyTable, folder: Path, file_notes: list[str], key: str = "modes"
) -> RawModes | None:
    """Read ``[modes]``, or another table with its keys: the modes of a file, or frequencies alone.

    ``file_notes`` gains the reader's notes.
    """
    return _raw_modes_of(top.table(key), folder, file_notes)


def read_states(
    top: StudyTable, folder: Path, file_notes: list[str], test: ModalTest
) -> tuple[ModesState, ...]:
    """Read ``[[states]]``: the modes of later states, in their order; ``file_notes`` gains notes."""
    out: list[ModesState] = []
    for k, t in enumerate(top.tables("states"), 1):
        name, earlier = t.text("name", f"state {k}"), [s.name for s in out]
        if name in earlier:
            t.refuse("name", f"two states have the name '{name}'; each needs its own")
        since = t.text("since", "")
        if since and since not in earlier:
            t.refuse("since", f"there is no earlier state '{since}'; {suggest(since, earlier)}")
        modes = match_modes(_raw_modes_of(t, folder, file_notes), test, file_notes)
        if modes is None:
            t.refuse("", "it has no modes; give file or frequency")
        out.append(ModesState(name, modes, since))
    return tuple(out)


def _raw_modes_of(t: StudyTable, folder: Path, file_notes: list[str]) -> RawModes | None:
    for one in MODE_STD:
        if not isinstance(t.get(one, None), list):
            t.number(one, None, above=0)
    frequency, zeta = t.vector("frequency", None, None, "Hz"), t.vector("zeta", None, None, "-")
    file = t.text("file", None)
    for one in ("numbers", "plane", "held_out", "sensors", "excitations"):
        t.get(one, None)
    t.finish()
    if not t.values:
        return None
    if (file is None) == (frequency is None):
        t.refuse("", "give either file, with frequencies and shapes, or frequency, a list [Hz]")
    if frequency is not None:
        if not frequency.size or (frequency <= 0).any():
            t.refuse("frequency", f"{frequency.tolist()} is not allowed; positive numbers [Hz] are needed")
        if t.get("shape_std", None) is not None:
            t.refuse("shape_std", "there are frequencies but no shapes; give file")
        if zeta is not None and (len(zeta) != len(frequency) or (zeta <= 0).any()):
            t.refuse(
                "zeta", f"{len(zeta)} values are given for {len(frequency)} frequencies; one each, above 0"
            )
        order = np.argsort(frequency, kind="stable")
        f, zeta = frequency[order], None if zeta is None else zeta[order]
        return RawModes(t, Modes(f, np.zeros((0, f.size)), zeta), {}, "frequencies of the study")
    if zeta is not None:
        t.refuse("zeta", "damping ratios stand in the file; give them with frequency")
    path = folder / file
    if not path.is_file():
        t.refuse_awaited("file", no_file(path))
    nodes: dict[int, np.ndarray] = {}
    std: dict[str, np.ndarray] = {}
    with t.at("file"):
        if path.suffix.lower() in UFF_SUFFIXES:
            uff = read_quietly(path)
            modes = uff.one_set_of_modes()
            file_notes.extend(notes_of(uff))
            if uff.points is not None:
                labels, xyz = uff.points.labels.tolist(), uff.points.coordinates
                nodes = dict(zip(labels, xyz, strict=True))
        elif path.suffix.lower() in TABLE_SUFFIXES:
            modes, std = read_mode_table(path)
        elif path.suffix.lower() != ".npz":
            allowed = f"{', '.join(UFF_SUFFIXES)}, .npz or {', '.join(TABLE_SUFFIXES)}"
            t.refuse("file", f"'{file}' is not allowed; a file of the kind {allowed} is needed")
        else:
            modes = read_modes(path)
            std = read_npz_mode_std(path)
    if not modes.labels and len(modes.shapes):
        t.refuse("file", "its shapes have no labels, so the sensor of each row is unknown")
    return RawModes(t, modes, nodes, Path(file).name, std)


def match_modes(raw: RawModes | None, test: ModalTest, notes: list[str]) -> MeasuredModes | None:
    """Return measured modes at the sensors whose channels they have; without shapes at those of their test.

    Raises
    ------
    StudyError
        If shapes belong to no sensor, or to one alone.
    """
    if raw is None:
        return None
    t, modes, sensors = raw.table, raw.modes, test.sensors
    elastic = modes.frequency > 0
    modes = Modes(
        modes.frequency[elastic],
        modes.shapes[:, elastic],
        None if modes.zeta is None else modes.zeta[elastic],
        modes.labels,
    )
    n = modes.n_modes
    f_std, zeta_std, s_std = (
        _std(t, key, n, raw.std[key][elastic] if key in raw.std else np.full(n, default))
        for key, default in zip(MODE_STD, (1e-3, 0.1, 0.03), strict=True)
    )
    more = {
        "zeta_std": zeta_std,
        "numbers": _numbers(t, "numbers", n, 1000),
        "plane": _plane(t),
        "held_out": _numbers(t, "held_out", n, n),
        "driven": _named(t, "excitations", test.excitations, alone=test.alone and not modes.labels),
    }
    if more["numbers"] and len(more["numbers"]) != n:
        t.refuse("numbers", f"{len(more['numbers'])} numbers are given for {n} modes; one each is needed")
    if len(more["held_out"]) >= n > 0:
        t.refuse("held_out", "it names every mode; leave at least one for the fit")
    if not modes.labels:
        seen_by = _named(t, "sensors", sensors, alone=test.alone)
        return MeasuredModes(modes, seen_by, f_std, s_std, raw.name, **more)
    if t.get("sensors", None) is not None:
        t.refuse("sensors", "the rows of the shapes say which sensors they belong to; leave it out")
    if not n:
        t.refuse("file", "it has no mode above 0 Hz")
    found = [(c.sensor, got) for c in sensors if (got := c.find(modes.labels)) is not None]
    if len(found) < 2:
        t.refuse(
            "file",
            f"its shapes' rows ({', '.join(modes.labels[:8])}{' …' if len(modes.labels) > 8 else ''}) belong "
            f"to {len(found)} sensor(s) of the study; two or more are needed: give sensors a label or a node",
        )
    used = {label for _, (label, _) in found}
    rest = [x for x in modes.labels if x not in used]
    if rest:
        notes.append(
            f"{raw.name}: the rows {', '.join(rest[:8])}{' …' if len(rest) > 8 else ''} of the shapes belong "
            "to no sensor and are not used"
        )
    without = [c.sensor.name for c in sensors if c.find(modes.labels) is None]
    if without:
        notes.append(
            f"{raw.name}: its shapes have no row of the sensors {', '.join(without[:8])}"
            f"{' …' if len(without) > 8 else ''}"
        )
    rows = [modes.labels.index(label) for _, (label, _) in found]
    signs = np.array([sign for _, (_, sign) in found])
    at = tuple(sensor for sensor, _ in found)
    shapes = modes.shapes[rows] * signs[:, None]
    known = ~np.isnan(shapes)
    if (few := np.flatnonzero(known.sum(axis=0) < 2)).size:
        k = int(few[0])
        have = [s.name for s, there in zip(at, known[:, k], strict=True) if there]
        t.refuse(
            "file",
            f"the shape of mode {k + 1}, at {modes.frequency[k]:.6g} Hz, has values at "
            f"{f'the sensor {have[0]} alone' if have else 'no sensor'}; two or more are needed: leave the "
            "mode out",
        )
    if (still := np.flatnonzero(~(known & (shapes != 0)).any(axis=0))).size:
        k = int(still[0])
        t.refuse(
            "file",
            f"the shape of mode {k + 1}, at {modes.frequency[k]:.6g} Hz, is zero at every sensor, "
            f"{', '.join(label for _, (label, _) in found[:8])}{' …' if len(found) > 8 else ''}; leave the "
            "mode out",
        )
    names = tuple(s.name for s in at)
    shapes, at = shapes_like_motions(shapes, at)
    return MeasuredModes(replace(modes, shapes=shapes, labels=names), at, f_std, s_std, raw.name, **more)


def _std(t: StudyTable, key: str, n: int, default: np.ndarray) -> np.ndarray:
    """Return the relative standard deviation of each mode: one for all, a list, or that of the file."""
    value = t.get(key, None)
    if not isinstance(value, list):
        return default if value is None else np.full(n, t.number(key, above=0))
    each = t.vector(key, None, None, "-")
    if len(each) != n or (each <= 0).any():
        t.refuse(key, f"{len(each)} values are given for {n} modes; one, or one each, above 0")
    return each


def _numbers(t: StudyTable, key: str, n: int, most: int) -> tuple[int, ...]:
    """Return numbers of modes, counted from 1."""
    value = t.get(key, [])
    allowed = isinstance(value, list) and all(isinstance(v, int) and not isinstance(v, bool) for v in value)
    if not allowed or len(set(value)) < len(value) or any(not 1 <= v <= most for v in value):
        t.refuse(key, f"{value} is not allowed; different whole numbers from 1 to {most} are needed")
    return tuple(value)


def _named(t: StudyTable, key: str, channels: Sequence[Channel], *, alone: bool) -> tuple[Sensor, ...]:
    """Return the channels that a list names; without a list all, where the modes are ``alone``."""
    every = {c.sensor.name: c.sensor for c in channels}
    if t.get(key, None) is None:
        return tuple(every.values()) if alone else ()
    for name in (names := t.texts(key)):
        if name not in every:
            t.refuse(key, f"the study has no '{name}' in [[{key}]]; {suggest(name, every)}")
    return tuple(every[name] for name in dict.fromkeys(names))


def _plane(t: StudyTable) -> str:
    """Return axes, some of x, y and z."""
    value = t.get("plane", "")
    if not isinstance(value, str) or set(value) - set("xyz") or len(set(value)) < len(value):
        t.refuse("plane", f"'{value}' is not allowed; axes such as \"xz\" are needed")
    return value


def read_plan(
    top: StudyTable,
    model: Model,
    has: Mapping[str, bool],
    default: Sequence[Unknown],
    candidates: Callable[[str], tuple[Effect, ...]],
) -> UpdatePlan:
    """Read ``[update]``.

    Parameters
    ----------
    top : Table
    model : Model
    has : mapping of str to bool
        Which of ``TARGETS`` the study has data for.
    default : sequence of Unknown
        What is uncertain, unless ``[[update.parameters]]`` say more of it.
    candidates : callable
        Return the candidates of a kind of effect.
    """
    t = top.table("update")
    to = t.texts("to", ())
    for word in to:
        if word not in TARGETS:
            t.refuse("to", f"'{word}' is not allowed; {suggest(word, TARGETS)}")
        if not has[word]:
            need = (
                "[[measurements]]" if word == "frf" else "[modes] or [[measurements]] to identify them from"
            )
            t.refuse("to", f"the study has no data for '{word}'; it needs {need}")
    if "modes" in to and "frequencies" in to:
        t.refuse("to", "'modes' holds the frequencies; leave 'frequencies' out")
    damping = t.flag("damping", True)
    with t.at():
        settings = UpdateSettings(
            n_starts=t.integer("starts", 1, most=1000),
            select=t.text("select", "", ("pivoting", "forward")),
            regularisation=t.text("regularisation", "", ("tikhonov",)),
            n_samples=t.integer("samples", 0, least=0, most=1_000_000),
        )
    unknowns: list[Unknown] = []
    seen: dict[ParameterRef, int] = {}
    more: dict[str, Effect] = {}
    for k, one in enumerate(t.tables("parameters")):
        found, effects = _unknowns(one, model.with_effect(*more.values()), candidates)
        more |= {e.name: e for e in effects}
        for ref in (ref for unknown in found for ref in unknown.refs):
            if ref in seen:
                one.refuse(
                    "parameter", f"'{ref[1]}' of '{ref[0]}' is updated by parameter {seen[ref]} already"
                )
            seen[ref] = k + 1
        unknowns += found
    t.finish()
    unknowns += [u for u in default if not any(ref in seen for ref in u.refs)]
    return UpdatePlan(tuple(to), tuple(unknowns), damping, settings, tuple(more.values()))


def _unknowns(
    t: StudyTable, model: Model, candidates: Callable[[str], tuple[Effect, ...]]
) -> tuple[list[Unknown], list[Effect]]:
    """Read one of ``[[update.parameters]]``; return also the candidates that the model has to gain."""
    effects = _effects(t, model, candidates)
    first = effects[0]
    known = [p.name for p in first.parameters()]
    words = t.get("parameter", known[0] if len(known) == 1 else None)
    words = [words] if isinstance(words, str) else words
    if not isinstance(words, list) or not words or not all(isinstance(w, str) for w in words):
        t.refuse(
            "parameter",
            f"a parameter's name, or a list of names that move together, is needed; '{first.name}' has "
            f"{', '.join(known)}",
        )
    for effect in effects:
        have = [p.name for p in effect.parameters()]
        for word in words:
            if word not in have:
                t.refuse("parameter", f"'{effect.name}' has no parameter '{word}'; {suggest(word, have)}")
    std, mean, start, lower, upper = (
        t.number(key, None) for key in ("std", "mean", "start", "lower", "upper")
    )
    each, name = t.flag("each", False), t.text("name", "")
    t.finish()
    if each and name:
        t.refuse("name", "with each = true the parameters have the names of their effects; leave name out")
    there = {e.name for e in model.effects}
    new = [e for e in effects if e.name not in there]
    if start is not None:  # parameters that are rigid or nothing when absent begin elsewhere
        new = [e.with_values(**dict.fromkeys(words, start)) for e in new]
    refs = [tuple((e.name, w) for w in words) for e in effects]
    unknowns = [
        Unknown(
            r,
            std=std,
            mean=mean,
            start=start,
            lower=lower,
            upper=upper,
            name=name or " ".join(r[0]).removeprefix("known "),
        )
        for r in (refs if each else [tuple(ref for r in refs for ref in r)])
    ]
    with t.at("parameter"):
        checked_unknowns(model.with_effect(*new), unknowns)
    return unknowns, new


def _effects(t: StudyTable, model: Model, candidates: Callable[[str], tuple[Effect, ...]]) -> list[Effect]:
    """Return the effects that ``effect`` names: of the model, or candidates, called as in ``[[effects]]``."""
    words = t.get("effect")
    words = [words] if isinstance(words, str) else words
    if not isinstance(words, list) or not words or not all(isinstance(w, str) for w in words):
        t.refuse("effect", "the name of an effect, or a list of names, is needed")
    names = {e.name: e for e in model.effects if e.parameters()}
    out: dict[str, Effect] = {}
    for word in words:
        kind, _, where = word.partition(":")
        if word in names:
            found = [names[word]]
        elif kind in candidate_kinds() and where:
            proposed = {e.name: replace(e, name=f"known {e.name}") for e in candidates(kind)}
            members = [f"{kind}:{m}" for m in model.mesh.groups.get(where, ())]
            wanted = [n for n in proposed if fnmatchcase(n, word) or n == word or n in members]
            if not wanted:
                t.refuse("effect", no_candidate(word, list(proposed)))
            found = [names.get(f"known {n}", proposed[n]) for n in wanted]
        elif where and kind not in candidate_kinds():
            t.refuse("effect", f"there is no kind of effect '{kind}'; {suggest(kind, candidate_kinds())}")
        else:
            t.refuse(
                "effect",
                f"there is no effect '{word}' with parameters; {suggest(word, list(names))}, or a candidate "
                "such as member_stiffness:MEMBER",
            )
        for effect in found:
            if effect.name in out:
                t.refuse("effect", f"'{effect.name}' is named twice")
            out[effect.name] = effect
    return list(out.values())
