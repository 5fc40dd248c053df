"""The measured files of a study: reading, and matching with sensors."""

import os
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dovetail.file.sensors import Channel, read_convention
from dovetail.file.table import Table, suggest
from fem.analysis.frf import FRF, WITHOUT_PHASE, FRFError, FRFKind
from fem.io import UFF_SUFFIXES, read_csv, read_npz
from fem.io.arrays import named_arrays
from fem.io.uff import UffFile, read_quietly
from fem.io.uff_types import Function
from fem.io.uff_units import FREQUENCY, abscissa_factor
from updating.measurement.measurement import Measurement, at_values_of
from updating.measurement.noise import noise_from_repeats
from updating.quality.corrections import Fault, set_right
from updating.quality.phase import phase_evidence

COHERENCE_TYPE = 6
"""Function type of a coherence in universal files."""

G0 = 9.80665
"""Standard gravity [m/s²]."""

Complexes = NDArray[np.complex128]

FREQUENCY_UNITS: dict[str, float] = {
    "Hz": 1.0, "kHz": 1e3, "rad/s": 1 / (2 * np.pi), "cpm": 1 / 60, "rpm": 1 / 60,
}  # fmt: skip
"""Units of a frequency axis, and their size [Hz]."""


@dataclass(frozen=True, slots=True, eq=False)
class RawMeasurement:
    """One matrix of FRFs as the file has it.

    Attributes
    ----------
    table : Table
        Its ``[[measurements]]``.
    frf : FRF
    name : str
    force_level : float or None
        [N].
    check_units, check_phase : bool
        Whether unit, and phase and time convention, are judged.
    coherence, scatter : ndarray (n_freq, n_out, n_in) or None
        As in :class:`updating.measurement.measurement.Measurement`.
    averages : int or None
    compared : Path or None
        File that says which values count.
    axis_unit : str
        ``frequency_unit``, the unit of the file's frequencies, one of ``FREQUENCY_UNITS``.
    """

    table: Table
    frf: FRF
    name: str
    force_level: float | None
    check_units: bool
    check_phase: bool = True
    coherence: NDArray[np.float64] | None = None
    averages: int | None = None
    scatter: NDArray[np.float64] | None = None
    compared: Path | None = None
    axis_unit: str = "Hz"


@dataclass(frozen=True, slots=True, eq=False)
class _ReadFile:
    """FRFs of a file, its other functions, and the unit labels of each FRF's frequencies."""

    frfs: list[FRF]
    functions: Sequence[Function]
    axes: Sequence[tuple[str, ...]]


def read_files(
    top: Table, folder: Path, notes: list[str], said: list[str]
) -> tuple[list[RawMeasurement], dict[int, NDArray[np.float64]]]:
    """Read the files of ``[[measurements]]``; return their FRFs and the coordinates of their nodes [m].

    ``notes`` gains the assumptions, ``said`` the readers' notes on the files.
    """
    out: list[RawMeasurement] = []
    nodes: dict[int, NDArray[np.float64]] = {}
    for t in top.tables("measurements"):
        file = t.text("file")
        path = folder / file
        if not path.is_file():
            t.refuse("file", f"there is no file '{os.fspath(path)}'")
        name = t.text("name", Path(file).name)
        kind = t.text("kind", None, [str(k) for k in FRFKind])
        level = t.number("force_level", None, above=0, unit="N")
        check, check_phase = t.flag("check_units", True), t.flag("check_phase", True)
        convention = read_convention(t)
        axis_unit = t.text("frequency_unit", "Hz", list(FREQUENCY_UNITS))
        band = read_band(t)
        scale = t.number("scale", 1.0)
        if scale == 0:
            t.refuse("scale", "0 is not allowed; the factor from the file's unit to SI is needed")
        with t.at("file"):
            read = _read(t, path, kind, nodes, (notes, said), "scale" in t)
            frfs = read.frfs
            for frf in frfs:
                _refuse_without_phase(frf, path.name)
        axis_factors = [_axis_factor(t, axis_unit, labels) for labels in read.axes]
        again = _repeats(t, folder, kind, (notes, said), frfs)
        averages = t.number("averages", None, least=1)
        coherent = _coherence(t, folder, frfs, read.functions, said)
        chosen = t.text("compared", None)
        compared = None if chosen is None else _existing(t, "compared", folder, chosen)
        if averages is not None and averages != int(averages):
            t.refuse("averages", f"{averages:g} is not allowed; a whole number of averages is needed")
        if any(c is not None for c in coherent) and averages is None and not again:
            notes.append(
                f"{name} has coherences, and averages = … is not given: its noise is estimated from the "
                "scatter between neighbouring lines instead"
            )
        if averages is not None and all(c is None for c in coherent):
            t.refuse(
                "averages", "averages is used with coherence only; give coherence too, or leave averages out"
            )
        t.finish()
        for i, frf in enumerate(frfs):
            whole, scatter = frf, None
            if again:
                H = np.stack([frf.H, *(r[i].H for r in again)])
                whole, scatter = replace(frf, H=H.mean(axis=0)), noise_from_repeats(H)
            whole = replace(whole, frequency=axis_factors[i] * whole.frequency)
            with t.at("band"):
                cut = whole.select(band=band)
            known = [None if x is None else at_values_of(x, whole, cut) for x in (coherent[i], scatter)]
            H = np.conj(cut.H) if convention.conjugate else cut.H
            cut = replace(cut, H=scale * np.exp(1j * np.deg2rad(convention.phase)) * H)
            label = name if len(frfs) == 1 else f"{name} [{i + 1}]"
            number = None if averages is None else int(averages)
            out.append(
                RawMeasurement(
                    t, cut, label, level, check, check_phase, known[0], number, known[1], compared, axis_unit
                )
            )
    return out, nodes


def _axis_factor(t: Table, unit: str, labels: Sequence[str]) -> float:
    """Return the factor of frequencies to Hz, after a reader has converted labelled ones.

    A label of Hz, which programs write by default, gives way to ``frequency_unit``; any other has to agree.
    """
    factor = FREQUENCY_UNITS[unit]
    by_label = {x: abscissa_factor(FREQUENCY, x)[0] for x in labels}
    if all(size == 1.0 for size in by_label.values()):
        return factor
    if "frequency_unit" not in t:
        return 1.0
    for label, size in by_label.items():
        if not np.isclose(size, factor, rtol=1e-9, atol=0):
            t.refuse(
                "frequency_unit",
                f"it is '{unit}', and the file labels its frequencies '{label}', by which they are "
                "converted; leave frequency_unit out, or correct the label if it is wrong",
            )
    return 1.0


def _existing(t: Table, key: str, folder: Path, file: str) -> Path:
    path = folder / file
    if not path.is_file():
        t.refuse(key, f"there is no file '{os.fspath(path)}'")
    return path


def _repeats(
    t: Table, folder: Path, kind: str | None, notes: tuple[list[str], list[str]], first: list[FRF]
) -> list[list[FRF]]:
    """Read ``repeats``: files with the same FRFs, measured again."""
    out = []
    for file in t.texts("repeats", ()):
        path = _existing(t, "repeats", folder, file)
        with t.at("repeats"):
            frfs = _read(t, path, kind, {}, notes, "scale" in t).frfs
        alike = len(frfs) == len(first) and all(
            a.kind == b.kind
            and a.outputs == b.outputs
            and a.inputs == b.inputs
            and np.array_equal(a.frequency, b.frequency)
            for a, b in zip(frfs, first, strict=True)
        )
        if not alike:
            t.refuse(
                "repeats", f"{file} has other lines, channels or another kind of FRF than the first file"
            )
        if any(np.array_equal(a.H, b.H) for known in (first, *out) for a, b in zip(frfs, known, strict=True)):
            t.refuse(
                "repeats",
                f"{file} has the same values as another file of this measurement, which would make it free "
                "of noise; a repeat is measured by itself",
            )
        for a, b in zip(frfs, first, strict=True):
            turned = _turned(a.H, b.H)
            if turned:
                t.refuse(
                    "repeats",
                    f"the FRFs of {file} are nearer to those of the first file {turned}; their average would "
                    "be wrong: correct the file, or give it as a measurement of its own",
                )
        out.append(frfs)
    return out


_TURNS: dict[str, Callable[[Complexes], Complexes]] = {
    "": lambda H: H,
    "conjugated (e^{-iωt} in place of e^{+iωt})": np.conj,
    "with the opposite sign": lambda H: -H,
    "multiplied by i": lambda H: 1j * H,
    "multiplied by -i": lambda H: -1j * H,
}


def _turned(again: Complexes, first: Complexes) -> str:
    """Return the change that brings repeated FRFs (n_freq, n_out, n_in) nearest to the first; empty for none.

    Nearest in the mean over the FRFs of their relative square distance: noise of a repeat makes a
    turned one the nearest only where it is larger than the signal.
    """
    size = (np.abs(first) ** 2).sum(axis=0)
    heard = size > 0

    def distance(words: str) -> float:
        d = (np.abs(_TURNS[words](again) - first) ** 2).sum(axis=0)
        return float((d[heard] / size[heard]).mean()) if heard.any() else 0.0

    return min(_TURNS, key=distance)


def _coherence(
    t: Table, folder: Path, frfs: list[FRF], functions: Sequence[Function], said: list[str]
) -> list[NDArray[np.float64] | None]:
    """Return the coherence of each matrix of FRFs: of the file ``coherence``, or of the FRFs' own file."""
    file = t.text("coherence", None)
    if file is None:
        return [_coherence_in(functions, frf) for frf in frfs]
    path = _existing(t, "coherence", folder, file)
    if path.suffix.lower() in UFF_SUFFIXES:
        with t.at("coherence"):
            other = read_quietly(path, FRFKind.ACCELERANCE)
        said.extend(notes_of(other))
        found = [_coherence_in(other.functions, frf) for frf in frfs]
    elif path.suffix.lower() == ".npz":
        with t.at("coherence"):
            found = [_array(path, frf, "coherence") for frf in frfs]
    else:
        t.refuse("coherence", f"{file} is not allowed; a universal file or .npz is needed")
    if all(c is None for c in found):
        t.refuse("coherence", f"{file} has no coherence at the lines and channels of the FRFs")
    return found


def _coherence_in(functions: Sequence[Function], frf: FRF) -> NDArray[np.float64] | None:
    """Return the coherences among functions of a universal file, NaN where there is none."""
    out = np.full(frf.H.shape, np.nan)
    for f in functions:
        if (
            f.function_type != COHERENCE_TYPE
            or f.response not in frf.outputs
            or f.reference not in frf.inputs
        ):
            continue
        if f.x.shape == frf.frequency.shape and np.allclose(f.x, frf.frequency, rtol=1e-6, atol=0):
            value = np.real(f.values)
            out[:, frf.outputs.index(f.response), frf.inputs.index(f.reference)] = value
    # Single precision and rounding lead to values a little beyond 1.
    out = np.where((out > 1) & (out < 1 + 1e-4), 1.0, out)
    return out if np.isfinite(out).any() else None


def _array(path: Path, frf: FRF, what: str) -> NDArray[np.float64] | None:
    """Read ``frequency``, an array at FRFs' values and, where channels differ, ``outputs`` and ``inputs``.

    Returns (n_freq, n_out, n_in), NaN for values of which the file says nothing; None where it has none.
    """
    arrays = named_arrays(path)
    missing = [key for key in ("frequency", what) if key not in arrays]
    if missing:
        msg = f"{path.name} has no array '{missing[0]}'; frequency and {what} are needed"
        raise ValueError(msg)
    f, values = np.asarray(arrays["frequency"], dtype=float), np.asarray(arrays[what], dtype=float)
    names = [
        [str(x) for x in np.atleast_1d(arrays[key])] if key in arrays else list(getattr(frf, key))
        for key in ("outputs", "inputs")
    ]
    if values.shape != (f.size, *(len(n) for n in names)):
        msg = (
            f"{path.name}: {what} has shape {values.shape} for {f.size} frequencies, {len(names[0])} "
            f"outputs and {len(names[1])} inputs"
        )
        raise ValueError(msg)
    outputs, inputs = (
        [n for n in have if n in own] for have, own in zip(names, (frf.outputs, frf.inputs), strict=True)
    )
    of = FRF.from_arrays(f, np.zeros(values.shape), frf.kind, *names)
    here = frf.select(outputs, inputs)
    out = np.full(frf.H.shape, np.nan)
    at = np.ix_([frf.outputs.index(n) for n in outputs], [frf.inputs.index(n) for n in inputs])
    out[:, at[0], at[1]] = at_values_of(values, of, here)
    return out if np.isfinite(out).any() else None


def read_held_out(
    fit: Table, sensors: Sequence[Channel], excitations: Sequence[Channel]
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the excitations and the sensors that are kept from the fit.

    A name that both have is the excitation's; ``sensor NAME`` and ``excitation NAME`` say which is meant.
    """
    have = {"excitation": [c.sensor.name for c in excitations], "sensor": [c.sensor.name for c in sensors]}
    out: dict[str, list[str]] = {"excitation": [], "sensor": []}
    for word in fit.texts("held_out", ()):
        first, _, rest = word.partition(" ")
        options = [(first, rest)] if first in have else [(role, word) for role in have]
        found = [(role, name) for role, name in options if name in have[role]]
        if not found:
            known = [name for role, _ in options for name in have[role]]
            what = " or ".join(role for role, _ in options)
            fit.refuse("held_out", f"there is no {what} '{options[0][1]}'; {suggest(options[0][1], known)}")
        role, name = found[0]
        out[role].append(name)
    return tuple(out["excitation"]), tuple(out["sensor"])


def read_band(t: Table) -> tuple[float, float] | None:
    """Read ``band = [lowest, highest]`` [Hz]."""
    band = t.vector("band", None, 2, "Hz")
    if band is None:
        return None
    if not 0 <= band[0] < band[1]:
        t.refuse("band", f"{band.tolist()} is not allowed; two rising frequencies [Hz] are needed")
    return float(band[0]), float(band[1])


def _read(
    t: Table,
    path: Path,
    kind: str | None,
    nodes: dict[int, NDArray[np.float64]],
    notes: tuple[list[str], list[str]],
    scaled: bool,
) -> _ReadFile:
    suffix = path.suffix.lower()
    assumed, said = notes
    functions: Sequence[Function] = ()
    axes: tuple[tuple[str, ...], ...] = ()
    outputs, inputs = t.texts("outputs", None), t.texts("inputs", None)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        if suffix in UFF_SUFFIXES:
            file = read_quietly(path, kind, unit_labels=not scaled)
            if not file.frfs:
                file.frf()  # its error names the file's content
            functions = file.functions
            axes = file.frf_axes
            if file.points is not None:
                nodes.update(
                    {int(k): xyz for k, xyz in zip(file.points.labels, file.points.coordinates, strict=True)}
                )
            said.extend(notes_of(file))
            frfs = list(file.frfs)
        elif suffix == ".npz":
            frfs = [read_npz(path, kind)]
        else:
            form = t.text("form", "auto")
            frfs = [
                read_csv(
                    path,
                    kind,
                    outputs=outputs,
                    inputs=inputs,
                    delimiter=t.text("delimiter", None),
                    header=t.flag("header", True) if "header" in t else None,
                    form=form,
                )
            ]
            if form == "auto":
                _refuse_other_form(frfs[0], path.name)
            outputs = inputs = None
    said.extend(str(w.message) for w in caught)
    out = [_renamed(t, frf, outputs, inputs) for frf in frfs]
    if kind is not None and any(frf.kind != kind for frf in out):
        assumed.append(
            f"{path.name} calls its FRFs {out[0].kind}; the study's kind, {kind}, takes precedence"
        )
        out = [replace(frf, kind=FRFKind(kind)) for frf in out]
    return _ReadFile(out, functions, axes or ((),) * len(out))


def notes_of(file: UffFile) -> list[str]:
    """Return the notes on a universal file, a sentence each, with its name."""
    runs = (f"{file.name} [{i}]: {run}" for i, run in enumerate(file.frf_runs, 1) if run)
    return [*(f"{file.name}: {line}" for line in (*file.notes, *file.skipped)), *runs]


def _refuse_without_phase(frf: FRF, name: str) -> None:
    """Refuse amplitudes that pass for FRFs: values that are real and never negative."""
    if frf.n_freq > 1 and frf.H.any() and not frf.H.imag.any() and (frf.H.real >= 0).all():
        msg = f"{name}: its FRFs are real and never negative: {WITHOUT_PHASE}"
        raise FRFError(msg)


def _refuse_other_form(frf: FRF, name: str) -> None:
    """Refuse a text table whose pairs of columns look like another form than real and imaginary part.

    Raises
    ------
    FRFError
        If the second columns are as little negative as the first (amplitudes), or make causal FRFs when they
        are taken for degrees and not else.
    """
    if (frf.H.real < 0).any() or not frf.H.imag.any():
        return
    if (frf.H.imag >= 0).all() and not (phase_evidence(frf).direction > 0).any():
        msg = (
            f"{name}: no value of its FRFs is negative, so its columns look like amplitudes: "
            f"{WITHOUT_PHASE}; "
            'form = "re-im" reads them as real and imaginary parts'
        )
        raise FRFError(msg)
    degrees = bool(np.abs(frf.H.imag).max() > 2 * np.pi + 0.01)
    angle = np.deg2rad(frf.H.imag) if degrees else frf.H.imag
    polar = replace(frf, H=frf.H.real * np.exp(1j * angle))
    if (phase_evidence(polar).direction != 0).any() and not (phase_evidence(frf).direction > 0).any():
        remedy = 'give form = "magnitude-degrees"'
        if not degrees:
            remedy = 'the angles are in radians: make them degrees and give form = "magnitude-degrees"'
        msg = (
            f"{name}: its columns look like amplitude and angle, not real and imaginary part; {remedy}, or "
            'form = "re-im" if they are parts'
        )
        raise FRFError(msg)


def _renamed(t: Table, frf: FRF, outputs: Sequence[str] | None, inputs: Sequence[str] | None) -> FRF:
    for key, have, want in (("outputs", frf.outputs, outputs), ("inputs", frf.inputs, inputs)):
        if want is not None and len(want) != len(have):
            t.refuse(
                key,
                f"{len(want)} labels are given for the {len(have)} {key} of the file "
                f"({', '.join(have[:6])} …)",
            )
    return FRF.from_arrays(frf.frequency, frf.H, frf.kind, outputs or frf.outputs, inputs or frf.inputs)


def match(
    raw: Sequence[RawMeasurement],
    sensors: Sequence[Channel],
    excitations: Sequence[Channel],
    faults: Sequence[Fault],
    notes: list[str],
) -> tuple[Measurement, ...]:
    """Return the measurements by the names of their sensors and excitations, without known faults.

    Raises
    ------
    StudyError
        If a sensor or excitation is in no file, two share a channel, a file has none, or an FRF is zero.
    """
    out = []
    used: set[str] = set()
    for r in raw:
        rows = _pick(r, sensors, r.frf.outputs, "responses")
        columns = _pick(r, excitations, r.frf.inputs, "forces")
        used |= {f"s:{c.sensor.name}" for c, _, _ in rows} | {f"e:{c.sensor.name}" for c, _, _ in columns}
        for word, have, got in (("responses", r.frf.outputs, rows), ("forces", r.frf.inputs, columns)):
            rest = [x for x in have if x not in {label for _, label, _ in got}]
            if rest:
                notes.append(
                    f"{r.name}: the {word} {', '.join(rest[:8])}{' …' if len(rest) > 8 else ''} "
                    "match no sensor or excitation of the study and are not used"
                )
        frf = r.frf.select([label for _, label, _ in rows], [label for _, label, _ in columns])
        sign = np.outer([s for _, _, s in rows], [s for _, _, s in columns])
        for c, label, s in (*rows, *columns):
            if s < 0:
                notes.append(
                    f"{r.name}: channel {label} is multiplied by -1, because {c.sensor.name} has the "
                    "opposite direction"
                )
        names = [tuple(c.sensor.name for c, _, _ in part) for part in (rows, columns)]
        H = _in_convention(frf, [c for c, _, _ in rows], [c for c, _, _ in columns])
        frf = FRF.from_arrays(frf.frequency, H * sign, frf.kind, *names)
        _refuse_zero(r, frf)
        picked = [tuple(c.sensor for c, _, _ in part) for part in (rows, columns)]
        chosen = r.frf.select([label for _, label, _ in rows], [label for _, label, _ in columns])
        known = [None if x is None else at_values_of(x, r.frf, chosen) for x in (r.coherence, r.scatter)]
        with r.table.at("coherence"):
            measurement = Measurement(
                frf, picked[0], picked[1], r.force_level, r.name, known[0], r.averages, known[1]
            )
        with r.table.at():
            measurement = set_right(measurement, faults) if faults else measurement
        if r.compared is not None:
            with r.table.at("compared"):
                measurement = replace(measurement, compared=_array(r.compared, measurement.frf, "compared"))
        out.append(measurement)
    for mark, channels in (("s", sensors), ("e", excitations)):
        for c in channels:
            if raw and f"{mark}:{c.sensor.name}" not in used:
                have = dict.fromkeys(x for r in raw for x in (r.frf.outputs if mark == "s" else r.frf.inputs))
                word = "sensor" if mark == "s" else "excitation"
                asked = f"channel '{c.label}'" if c.label else "channel"
                c.table.refuse(
                    "",
                    f"{word} '{c.sensor.name}' has no {asked} in the measured files; they have "
                    f"{', '.join(list(have)[:20])}{' …' if len(have) > 20 else ''}; give label",
                )
    return tuple(out)


def _in_convention(frf: FRF, rows: Sequence[Channel], columns: Sequence[Channel]) -> NDArray[np.complex128]:
    """Return FRFs with each sensor's and force's own convention set right."""
    flip = np.logical_xor.outer(*([c.convention.conjugate for c in part] for part in (rows, columns)))
    angle = np.add.outer(*([c.convention.phase for c in part] for part in (rows, columns)))
    H = np.where(flip, np.conj(frf.H), frf.H) * np.exp(1j * np.deg2rad(angle))
    for i, c in enumerate(rows):
        own = c.convention.kind
        power = 0 if own is None else frf.kind.derivatives - own.derivatives
        if power < 0 and frf.frequency[0] == 0:
            c.table.refuse(
                "kind", f"the line at 0 Hz cannot be converted from {own} to {frf.kind}; exclude it with band"
            )
        if power:
            H[:, i] *= ((1j * frf.omega) ** power)[:, None]
    return H


def _near(channels: Sequence[Channel], labels: Sequence[str]) -> str:
    """Return which nodes of a file lie at sensors' places, as a hint; nothing if none does."""
    nodes = {label.rstrip("XYZR+-S") for label in labels}
    found = [f"node {n} is at '{c.sensor.name}'" for c in channels for n in c.near if str(n) in nodes]
    return f" ({', '.join(found[:4])}{' …' if len(found) > 4 else ''})" if found else ""


def _pick(
    r: RawMeasurement, channels: Sequence[Channel], labels: Sequence[str], word: str
) -> list[tuple[Channel, str, float]]:
    out: list[tuple[Channel, str, float]] = []
    owner: dict[str, str] = {}
    for c in channels:
        found = c.find(labels)
        if found is None:
            continue
        if found[0] in owner:
            c.table.refuse(
                "", f"'{c.sensor.name}' and '{owner[found[0]]}' are both channel {found[0]} of {r.name}"
            )
        owner[found[0]] = c.sensor.name
        out.append((c, *found))
    if not out:
        r.table.refuse(
            "file",
            f"none of its {word} ({', '.join(labels[:8])}{' …' if len(labels) > 8 else ''}) "
            "belongs to a sensor or excitation of the study; give them a label or a node"
            f"{_near(channels, labels)}",
        )
    return out


def _refuse_zero(r: RawMeasurement, frf: FRF) -> None:
    zero = ~np.any(frf.H, axis=0)
    if zero.all():
        r.table.refuse("file", "all its FRFs are zero; the file holds no measurement")
    if zero.any():
        i, j = np.argwhere(zero)[0]
        r.table.refuse(
            "file",
            f"{zero.sum()} of its FRFs are zero at all frequencies, the first "
            f"'{frf.outputs[i]}' to a force at '{frf.inputs[j]}'; leave dead channels out",
        )


def labels_of(raw: Sequence[RawMeasurement], which: str) -> list[str]:
    """Return the labels of all responses or forces of the files, each once."""
    return list(dict.fromkeys(x for r in raw for x in getattr(r.frf, which)))


def top_frequency(raw: Sequence[RawMeasurement], band: tuple[float, float] | None) -> float | None:
    """Return the highest frequency that is compared [Hz]."""
    if not raw:
        return None
    highest = max(float(r.frf.frequency[-1]) for r in raw)
    return highest if band is None else min(highest, band[1])
