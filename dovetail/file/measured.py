"""The measured files of a study: reading, and matching with sensors."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from dovetail.file.sensors import read_convention
from dovetail.file.table import StudyTable
from fem.analysis.frf import FRF, TRANSMISSIBILITY, WITHOUT_PHASE, FRFError, FRFKind
from fem.array_types import Complexes, Floats
from fem.io import UFF_SUFFIXES
from fem.io.arrays import named_arrays
from fem.io.faults import no_file
from fem.io.frf_files import joined, read_frfs, reader_of
from fem.io.frf_reading import FORMS, Asked, Reading
from fem.io.uff import UffFile, read_quietly
from fem.io.uff_types import Function
from fem.io.uff_units import FREQUENCY, abscissa_factor
from updating.inference.defaults import MOST_SPLITS
from updating.measurement.measurement import at_values_of
from updating.measurement.noise import noise_from_repeats
from updating.quality.phase import phase_evidence

"""Kind of FRFs of accelerations for an acceleration of the base: as accelerances for a force of 1."""

G0 = 9.80665
"""Standard gravity [m/s²]."""


FREQUENCY_UNITS: dict[str, float] = {
    "Hz": 1.0,
    "kHz": 1e3,
    "rad/s": 1 / (2 * np.pi),
    "cpm": 1 / 60,
    "rpm": 1 / 60,
}
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
    phase : bool
        Whether its values have a phase; without it they are amplitudes.
    viscous : bool
        As of the measurement.
    """

    table: StudyTable
    frf: FRF
    name: str
    force_level: float | None
    check_units: bool
    check_phase: bool = True
    coherence: Floats | None = None
    averages: int | None = None
    scatter: Floats | None = None
    compared: Path | None = None
    axis_unit: str = "Hz"
    phase: bool = True
    viscous: bool = False


def read_files(
    top: StudyTable, folder: Path, notes: list[str], file_notes: list[str]
) -> tuple[list[RawMeasurement], dict[int, Floats]]:
    """Read the files of ``[[measurements]]``; return their FRFs and the coordinates of their nodes [m].

    ``notes`` gains the assumptions, ``file_notes`` the readers' notes on the files.
    """
    out: list[RawMeasurement] = []
    nodes: dict[int, Floats] = {}
    for t in top.tables("measurements"):
        files = _files(t, folder)
        name = t.text("name", Path(files[0]).name)
        stated = t.text("kind", None, [*map(str, FRFKind), TRANSMISSIBILITY])
        kind = str(FRFKind.ACCELERANCE) if stated == TRANSMISSIBILITY else stated
        level = t.number("force_level", None, above=0, unit="N")
        check, check_phase = t.flag("check_units", True), t.flag("check_phase", True)
        convention = read_convention(t)
        axis_unit = t.text("frequency_unit", "Hz", list(FREQUENCY_UNITS))
        band = read_band(t)
        scale = t.number("scale", 1.0)
        if scale == 0:
            t.refuse("scale", "0 is not allowed; the factor from the file's unit to SI is needed")
        with t.at("file"):
            read = _read(t, folder, files, kind, (notes, file_notes))
            # a stated kind also says what the reference is
            to_motion = [frf.inputs if stated == TRANSMISSIBILITY else () for frf in read.frfs]
            frfs = [
                frf if stated is None else replace(frf, base=base)
                for frf, base in zip(read.frfs, to_motion, strict=True)
            ]
            if read.points is not None:
                points = zip(read.points.labels, read.points.coordinates, strict=True)
                nodes.update({int(k): xyz for k, xyz in points})
        axis_factors = [_axis_factor(t, axis_unit, labels) for labels in read.axes]
        again = _repeats(t, folder, kind, (notes, file_notes), frfs)
        averages = t.number("averages", read.averages, least=1)
        coherent = _coherence(t, folder, read, file_notes)
        chosen, viscous = t.text("compared", None), t.flag("viscous", False)
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
            full, scatter = frf, None
            if again:
                H = np.stack([frf.H, *(r[i].H for r in again)])
                full, scatter = replace(frf, H=H.mean(axis=0)), noise_from_repeats(H)
            full = replace(full, frequency=axis_factors[i] * full.frequency)
            with t.at("band"):
                cut = full.select(band=band)
            known = [None if x is None else at_values_of(x, full, cut) for x in (coherent[i], scatter)]
            H = np.conj(cut.H) if convention.conjugate else cut.H
            cut = replace(cut, H=scale * np.exp(1j * np.deg2rad(convention.phase)) * H)
            label = name if len(frfs) == 1 else f"{name} [{i + 1}]"
            number = None if averages is None else int(averages)
            out.append(
                RawMeasurement(
                    t,
                    cut,
                    label,
                    level,
                    check,
                    check_phase,
                    known[0],
                    number,
                    known[1],
                    compared,
                    axis_unit,
                    read.phase,
                    viscous,
                )
            )
    return out, nodes


def _axis_factor(t: StudyTable, unit: str, labels: Sequence[str]) -> float:
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


def _existing(t: StudyTable, key: str, folder: Path, file: str) -> Path:
    path = folder / file
    if not path.is_file():
        t.refuse(key, no_file(path))
    return path


def _repeats(
    t: StudyTable, folder: Path, kind: str | None, notes: tuple[list[str], list[str]], first: list[FRF]
) -> list[list[FRF]]:
    """Read ``repeats``: files with the same FRFs, measured again."""
    out = []
    for file in t.texts("repeats", ()):
        _existing(t, "repeats", folder, file)
        with t.at("repeats"):
            frfs = list(_read(t, folder, [file], kind, notes).frfs)
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
                    "be wrong: correct the file, or give it as a separate measurement",
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
    nonzero = size > 0

    def distance(words: str) -> float:
        d = (np.abs(_TURNS[words](again) - first) ** 2).sum(axis=0)
        return float((d[nonzero] / size[nonzero]).mean()) if nonzero.any() else 0.0

    return min(_TURNS, key=distance)


def _coherence(t: StudyTable, folder: Path, read: Reading, notes: list[str]) -> list[Floats | None]:
    """Return the coherence of each matrix of FRFs: of the file ``coherence``, or of the FRFs' own file."""
    file, frfs = t.text("coherence", None), read.frfs
    if file is None:
        of_functions = [_coherence_in(read.functions, frf) for frf in frfs]
        return of_functions if read.coherence is None else [read.coherence, *of_functions[1:]]
    path = _existing(t, "coherence", folder, file)
    if path.suffix.lower() in UFF_SUFFIXES:
        with t.at("coherence"):
            other = read_quietly(path, FRFKind.ACCELERANCE)
        notes.extend(notes_of(other))
        found = [_coherence_in(other.functions, frf) for frf in frfs]
    elif path.suffix.lower() == ".npz":
        with t.at("coherence"):
            found = [array_for(path, frf, "coherence") for frf in frfs]
    else:
        t.refuse("coherence", f"{file} is not allowed; a universal file or .npz is needed")
    if all(c is None for c in found):
        t.refuse("coherence", f"{file} has no coherence at the lines and channels of the FRFs")
    return found


def _coherence_in(functions: Sequence[Function], frf: FRF) -> Floats | None:
    """Return the coherences among functions of a universal file, NaN where there is none."""
    out = np.full(frf.H.shape, np.nan)
    for f in functions:
        if (
            # Function type of a coherence in universal files
            f.function_type != 6 or f.response not in frf.outputs or f.reference not in frf.inputs
        ):
            continue
        if f.x.shape == frf.frequency.shape and np.allclose(f.x, frf.frequency, rtol=1e-6, atol=0):
            value = np.real(f.values)
            out[:, frf.outputs.index(f.response), frf.inputs.index(f.reference)] = value
    # Single precision and rounding lead to values a little beyond 1.
    out = np.where((out > 1) & (out < 1 + 1e-4), 1.0, out)
    return out if np.isfinite(out).any() else None


def array_for(path: Path, frf: FRF, what: str) -> Floats | None:
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
        [n for n in have if n in asked] for have, asked in zip(names, (frf.outputs, frf.inputs), strict=True)
    )
    of = FRF.from_arrays(f, np.zeros(values.shape), frf.kind, *names)
    here = frf.select(outputs, inputs)
    out = np.full(frf.H.shape, np.nan)
    at = np.ix_([frf.outputs.index(n) for n in outputs], [frf.inputs.index(n) for n in inputs])
    out[:, at[0], at[1]] = at_values_of(values, of, here)
    return out if np.isfinite(out).any() else None


def pieces_of(path: Path) -> int:
    """Return into how many pieces elements were cut when values were chosen; 0 where a file does not say."""
    pieces = np.asarray(named_arrays(path).get("pieces", 0))
    if pieces.shape or pieces.dtype.kind not in "iu" or not 0 <= pieces <= MOST_SPLITS:
        msg = f"{path.name}: pieces must be a whole number from 0 to {MOST_SPLITS}"
        raise ValueError(msg)
    return int(pieces)


def read_band(t: StudyTable) -> tuple[float, float] | None:
    """Read ``band = [lowest, highest]`` [Hz]."""
    band = t.vector("band", None, 2, "Hz")
    if band is None:
        return None
    if not 0 <= band[0] < band[1]:
        t.refuse("band", f"{band.tolist()} is not allowed; two rising frequencies [Hz] are needed")
    return float(band[0]), float(band[1])


def _read(
    t: StudyTable,
    folder: Path,
    files: Sequence[str],
    kind: str | None,
    note_lists: tuple[list[str], list[str]],
) -> Reading:
    """Read the FRFs of one file, or of several as one matrix.

    ``note_lists`` are the assumptions, and the readers' notes.
    """
    assumed, notes = note_lists
    asked, keys = _asked(t, kind)
    readings = []
    for k, file in enumerate(files):
        path = folder / file
        reader = reader_of(path)
        for key in keys:
            if key not in reader.options:
                t.refuse(key, f"it is not used for {path.name}, which is read as a {reader.words}")
        pairs = asked.pairs
        if len(files) > 1 and isinstance(pairs, tuple):
            if len(pairs) != len(files):
                t.refuse("pairs", f"{len(pairs)} pairs are given for {len(files)} files; one each is needed")
            pairs = pairs[k : k + 1]
        reading = read_frfs(path, replace(asked, pairs=pairs))
        readings.append(reading)
        if len(files) == 1:
            notes.extend(f"{path.name}: {line}" for line in reading.notes)
            if not reading.stated and reading.phase:
                _refuse_other_form(reading.frfs[0], path.name)
    reading = readings[0]
    if len(files) > 1:
        reading = joined(readings, [Path(file).name for file in files])
        notes.extend(reading.notes)
    frfs = [_renamed(t, frf, asked.outputs, asked.inputs) for frf in reading.frfs]
    if kind is not None and any(frf.kind != kind for frf in frfs):
        assumed.append(
            f"{Path(files[0]).name} calls its FRFs {frfs[0].kind}; the study's kind, {kind}, takes precedence"
        )
        frfs = [replace(frf, kind=FRFKind(kind)) for frf in frfs]
    return replace(reading, frfs=tuple(frfs), axes=reading.axes or ((),) * len(frfs))


def _asked(t: StudyTable, kind: str | None) -> tuple[Asked, list[str]]:
    """Return the study's statements about a file, and those of its keys that only some readers use."""
    pairs: tuple[str, ...] | dict[str, str] | None = None
    if isinstance(t.get("pairs", None), dict):
        named = t.table("pairs")
        pairs = {key: named.text(key) for key in named.values}
    elif "pairs" in t:
        pairs = t.texts("pairs")
    arrays = t.table("arrays")
    asked = Asked(
        kind,
        t.texts("outputs", None),
        t.texts("inputs", None),
        unit_labels="scale" not in t,
        form=t.text("form", "auto", FORMS),
        delimiter=t.text("delimiter", None)
        if t.get("delimiter", None) not in ("\t", " ")
        else t.get("delimiter"),
        header=t.flag("header", True) if "header" in t else None,
        pairs=pairs,
        arrays={key: arrays.text(key) for key in arrays.values},
        axes=t.texts("axes", ()),
    )
    return asked, [key for key in ("form", "delimiter", "header", "pairs", "arrays", "axes") if key in t]


def _files(t: StudyTable, folder: Path) -> list[str]:
    """Return ``file``: one name, or a list of names."""
    value = t.get("file")
    names = value if isinstance(value, list) else [value]
    if not names or not all(isinstance(name, str) and name.strip() for name in names):
        t.refuse("file", f"{value!r} is not allowed; a file name, or a list of file names, is needed")
    for name in names:
        if not (folder / name).is_file():
            t.refuse_awaited("file", no_file(folder / name))
    return names


def notes_of(file: UffFile) -> list[str]:
    """Return the notes on a universal file, a sentence each, with its name."""
    runs = (f"{file.name} [{i}]: {run}" for i, run in enumerate(file.frf_runs, 1) if run)
    return [*(f"{file.name}: {line}" for line in (*file.notes, *file.skipped)), *runs]


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


def _renamed(t: StudyTable, frf: FRF, outputs: Sequence[str] | None, inputs: Sequence[str] | None) -> FRF:
    for key, have, want in (("outputs", frf.outputs, outputs), ("inputs", frf.inputs, inputs)):
        if want is not None and len(want) != len(have):
            t.refuse(
                key,
                f"{len(want)} labels are given for the {len(have)} {key} of the file "
                f"({', '.join(have[:6])} …)",
            )
    base = [new for old, new in zip(frf.inputs, inputs or frf.inputs, strict=True) if old in frf.base]
    names = outputs or frf.outputs
    strain = [new for old, new in zip(frf.outputs, names, strict=True) if old in frf.strain]
    return FRF.from_arrays(frf.frequency, frf.H, frf.kind, names, inputs or frf.inputs, base, strain)
