"""Time data of files: a table of readers that give channels, their units and one sample rate."""

import logging
import os
import re
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from fem.analysis.frf import FRFKind
from fem.io.arrays import TableError, named_arrays
from fem.io.columns import Columns, read_columns
from fem.io.frf_files import is_universal
from fem.io.frf_reading import optional
from fem.io.mat_hdf5 import HDF5_MARK, Named, read_hdf5, read_mat
from fem.io.uff import read_quietly
from fem.io.uff_units import TIME, abscissa_factor, force_factor, motion_factor

SAME_RATE = 1e-3
"""Relative difference of sample rates that is rounding [-]."""
UNEVEN = 1e-3
"""Largest deviation of a time step from the median one, beyond which samples do not follow evenly [-]."""

_TIMES = ("time", "t", "zeit", "seconds", "times")
_RATES = ("fs", "samplerate", "samplingrate", "samplefrequency", "samplingfrequency", "rate")
_STEPS = ("dt", "timestep", "increment", "samplingtime")
_NAMES = ("channels", "names", "labels", "channelnames", "channellabels")
_UNIT = re.compile(r"[\[(]([^\[\]()]*(?:\([^()]*\)[^\[\]()]*)*)[\])]\s*$")

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class TimeData:
    """Channels that were sampled together.

    Attributes
    ----------
    name : str
        The file.
    sample_rate : float
        [Hz].
    channels : tuple of str
    values : ndarray (n_samples, n_channels)
        In the units of the file.
    units : tuple of str
        Labels; empty where the file has none.
    full_scale : float or None
        Value at which a sample is clipped, where the format has one.
    stated_rate : float or None
        Sample rate of the file where the one asked for took its place [Hz].
    """

    name: str
    sample_rate: float
    channels: tuple[str, ...]
    values: Floats
    units: tuple[str, ...]
    full_scale: float | None = None
    stated_rate: float | None = None

    @property
    def rate_note(self) -> str:
        """A note that the sample rate is not that of the file; empty where the file states no other."""
        if self.stated_rate is None or np.isclose(self.stated_rate, self.sample_rate, rtol=SAME_RATE):
            return ""
        return (
            f"{self.name} states a sample rate of {self.stated_rate:.6g} Hz, and {self.sample_rate:.6g} Hz, "
            "as asked for, takes its place"
        )

    def channel(self, name: str) -> int:
        """Return the index of a channel.

        Raises
        ------
        TableError
            If there is none of that name.
        """
        if name not in self.channels:
            msg = f"{self.name}: there is no channel '{name}'; it has {', '.join(self.channels)}"
            raise TableError(msg)
        return self.channels.index(name)


def force_unit(label: str) -> float | None:
    """Return the size of a unit of force [N]; None for another label."""
    return force_factor(label, moment=False)


def motion_unit(label: str) -> tuple[FRFKind, float] | None:
    """Return of which kind of FRF a motion is the response, and the size of its unit in SI; None for none."""
    for kind in FRFKind:
        factor = motion_factor(label, kind, turned=False) if label else None
        if factor is not None and "/n" not in label.lower():
            return kind, factor
    return None


@dataclass(frozen=True, slots=True)
class TimeReader:
    """A reader of one format of time data; attributes as of :class:`fem.io.frf_files.FRFReader`."""

    words: str
    suffixes: tuple[str, ...]
    read: Callable[[Path, float | None], TimeData]
    begins: Callable[[bytes], bool] = lambda head: False


def read_time_data(path: str | os.PathLike[str], sample_rate: float | None = None) -> TimeData:
    """Read time data of a file; its first bytes, or else its ending, say how.

    Parameters
    ----------
    path : path
    sample_rate : float, optional
        Of files that do not say it [Hz]; of others it goes before.

    Raises
    ------
    TableError
        If the file is of no known format, cannot be read as what it is, does not say its sample rate, has
        samples that do not follow evenly, or none at all.
    """
    file = Path(path)
    with file.open("rb") as opened:
        head = opened.read(4096)
    reader = next((r for r in READERS if r.begins(head)), None)
    reader = reader or next((r for r in READERS if file.suffix.lower() in r.suffixes), None)
    if reader is None:
        known = "; ".join(f"{', '.join(r.suffixes)} ({r.words})" for r in READERS)
        msg = f"{file.name}: time data are read from files that end in {known}, not '{file.suffix.lower()}'"
        raise TableError(msg)
    data = reader.read(file, sample_rate)
    if sample_rate is not None:
        data = replace(data, sample_rate=sample_rate, stated_rate=_stated_rate(reader, file))
    if len(set(data.channels)) < len(data.channels):
        twice = next(c for c in data.channels if data.channels.count(c) > 1)
        _refuse(file, f"two channels are called '{twice}'; names must differ")
    if data.values.size == 0:
        _refuse(file, "it has no samples")
    bad = np.argwhere(~np.isfinite(data.values))
    if bad.size:
        row, column = (int(v) for v in bad[0])
        _refuse(
            file,
            f"sample {row + 1} of channel '{data.channels[column]}' is not finite, {len(bad)} in all; "
            "samples "
            "must follow evenly, without gaps",
        )
    return data


def _stated_rate(reader: TimeReader, file: Path) -> float | None:
    """Return the sample rate that a file states; None where it states none, or times that are uneven."""
    try:
        return reader.read(file, None).sample_rate
    except TableError:
        return None


def _refuse(path: Path, text: str) -> NoReturn:
    msg = f"{path.name}: {text}"
    raise TableError(msg)


def _rate(path: Path, given: float | None, found: float | None) -> float:
    rate = given if given is not None else found
    if rate is None or not (np.isfinite(rate) and rate > 0):
        _refuse(path, "it does not say its sample rate; give it [Hz], --sample-rate")
    return float(rate)


def _rate_of(path: Path, time: Floats) -> float:
    """Return the sample rate of times that follow evenly."""
    if time.size < 2:
        _refuse(path, "it has fewer than two samples")
    step = np.diff(time)
    usual = float(np.median(step))
    off = np.flatnonzero(~(np.abs(step - usual) <= UNEVEN * abs(usual)))
    if off.size and _rounded(time):
        off = off[:0]
    if off.size or usual <= 0:
        k = int(off[0]) if off.size else 0
        _refuse(
            path,
            f"its samples do not follow evenly: {time[k + 1]:.9g} s follows {time[k]:.9g} s (sample {k + 2}) "
            f"where the usual step is {usual:.6g} s; --sample-rate overrides the times",
        )
    return (time.size - 1) / (time[-1] - time[0])


def _rounded(time: Floats) -> bool:
    """Return whether times follow evenly but for the digits that a file has printed.

    Those of the largest times are whole multiples of a power of ten, by half of which all may be off; a step
    that is missing or twice there moves times by half a step at least.
    """
    even = time[0] + (time[-1] - time[0]) * np.arange(time.size) / (time.size - 1)
    off, step = float(np.abs(time - even).max()), float(even[1] - even[0])
    largest = float(np.abs(time).max())
    large = time[np.abs(time) >= 10.0 ** np.floor(np.log10(max(largest, 1e-300)))]
    for power in range(int(np.floor(np.log10(max(step, 1e-300)))) + 1, -16, -1):
        multiple = large / 10.0**power
        if (np.abs(multiple - np.round(multiple)) < 1e-6 + 1e-12 * np.abs(multiple)).all():
            return off <= min(1.01 * 10.0**power, 0.25 * step)
    return False


def _wav(path: Path, sample_rate: float | None) -> TimeData:
    from scipy.io import wavfile  # a second to import

    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            rate, values = wavfile.read(path)
    except Exception as reason:  # damaged files raise whatever struct and NumPy come upon
        msg = f"{path.name}: it cannot be read as WAV ({' '.join(str(reason).split())[:100]})"
        raise TableError(msg) from reason
    cut = next((str(w.message) for w in caught if "EOF" in str(w.message)), None)
    if cut is not None:
        _refuse(path, f"it is cut short ({cut})")
    if not values.size:
        _refuse(path, "it holds no samples")
    values = values.reshape(len(values), -1)
    full = None
    if values.dtype.kind in "iu":
        # 24 bits are read into the upper ones of 32
        size, middle = {1: (128.0, 128.0), 2: (2.0**15, 0.0)}.get(values.dtype.itemsize, (2.0**31, 0.0))
        values, full = (values.astype(float) - middle) / size, 1.0
    channels = tuple(f"ch{k + 1}" for k in range(values.shape[1]))
    return TimeData(
        path.name, _rate(path, sample_rate, rate), channels, values.astype(float), ("",) * len(channels), full
    )


def _tdms(path: Path, sample_rate: float | None) -> TimeData:
    nptdms = optional("nptdms", "tdms", path.name)
    # it writes about damaged files to standard error, which are refused below
    logs = [logging.getLogger(f"nptdms.{part}") for part in ("reader", "types", "tdms_segment", "tdms")]
    levels = [log.level for log in logs]
    for log in logs:
        log.setLevel(logging.CRITICAL)
    try:
        file = nptdms.TdmsFile.read(path)
        found = [
            (group.name, channel.name, dict(channel.properties), np.asarray(channel[:]))
            for group in file.groups()
            for channel in group.channels()
        ]
    except Exception as reason:  # damaged files raise whatever the library comes upon
        msg = f"{path.name}: it cannot be read as TDMS ({' '.join(str(reason).split())[:100]})"
        raise TableError(msg) from reason
    finally:
        for log, level in zip(logs, levels, strict=True):
            log.setLevel(level)
    if file.file_status.incomplete_final_segment:
        _refuse(path, "it is cut short: its last segment is not complete")
    found = [f for f in found if f[3].dtype.kind in "fiu" and f[3].ndim == 1 and f[3].size]
    if not found:
        _refuse(path, "it has no channels of numbers")
    names = [name for _, name, _, _ in found]
    alike = len(set(names)) < len(names)
    channels = tuple(f"{group}/{name}" if alike else name for group, name, _, _ in found)
    steps = {name: f[2].get("wf_increment") for name, f in zip(channels, found, strict=True)}
    known = {s for s in steps.values() if isinstance(s, float | int) and s > 0}
    if len(known) > 1:
        _refuse(
            path, f"its channels have different sample steps, {', '.join(f'{s:g} s' for s in sorted(known))}"
        )
    rate = 1 / known.pop() if known else None
    units = tuple(str(f[2].get("unit_string", "")) for f in found)
    curves = [f[3].astype(float) for f in found]
    return _together(path, _rate(path, sample_rate, rate), channels, curves, units)


def _together(
    path: Path, rate: float, channels: Sequence[str], curves: Sequence[Floats], units: Sequence[str]
) -> TimeData:
    sizes = {name: c.size for name, c in zip(channels, curves, strict=True)}
    if len(set(sizes.values())) > 1:
        shown = ", ".join(f"{name} {n}" for name, n in list(sizes.items())[:6])
        _refuse(path, f"its channels have different numbers of samples ({shown}); one number is needed")
    return TimeData(path.name, rate, tuple(channels), np.column_stack(curves), tuple(units))


def _text(path: Path, sample_rate: float | None) -> TimeData:
    table = read_columns(path)
    if np.iscomplexobj(table.values):
        _refuse(path, "it has complex numbers; time data are real")
    names, units = _heads(table)
    at = next((k for k, n in enumerate(names) if n.lower().partition(" ")[0] in _TIMES), None)
    step = np.diff(table.values[:, 0].real)
    rises = step.size > 0 and bool((step > 0).all()) and bool(np.ptp(step) <= 2 * UNEVEN * step.mean())
    if at is None and sample_rate is None and rises:
        at = 0
    factor = 1.0
    if at is not None:
        factor = abscissa_factor(TIME, units[at])[0] if units[at] else 1.0
    rate = sample_rate
    if at is not None and rate is None:
        rate = _rate_of(path, factor * table.values[:, at].real)
    rest = [k for k in range(table.width) if k != at]
    channels = [names[k] or f"ch{i + 1}" for i, k in enumerate(rest)]
    values = np.asarray(table.values[:, rest], dtype=float)
    return TimeData(
        path.name, _rate(path, sample_rate, rate), tuple(channels), values, tuple(units[k] for k in rest)
    )


def _heads(table: Columns) -> tuple[list[str], list[str]]:
    """Return names and units above the columns of time data."""
    names, units = [], []
    for k in range(table.width):
        name = unit = ""
        for row in table.heads[::-1]:
            cell = row[k]
            known = force_unit(cell) is not None or motion_unit(cell) is not None
            known = known or cell.lower() in ("v", "mv", "s", "ms", "-", "pa")
            if known and not unit and len(table.heads) > 1:
                unit = cell
            elif cell and not name:
                found = _UNIT.search(cell)
                unit = unit or (found[1].strip() if found else "")
                name = cell[: found.start()].strip() if found else cell
        names.append(name or "")
        units.append(unit)
    return names, units


def _arrays(path: Path, arrays: dict[str, Named], sample_rate: float | None) -> TimeData:
    """Return the channels among named arrays: those with as many samples as the longest."""
    plain = {re.sub(r"[^a-z]", "", key.rpartition("/")[2].lower()): key for key in arrays}

    def pick(words: Sequence[str]) -> Any:
        return next((np.squeeze(arrays[plain[w]].values) for w in words if w in plain), None)

    time, rate, step, names = (pick(w) for w in (_TIMES, _RATES, _STEPS, _NAMES))
    known = {plain[w] for words in (_TIMES, _RATES, _STEPS, _NAMES) for w in words if w in plain}
    found = None
    if sample_rate is not None:
        found = sample_rate
    elif time is not None and time.ndim == 1 and time.dtype.kind in "fiu":
        found = _rate_of(path, time.astype(float))
    elif rate is not None and rate.size == 1 and rate.dtype.kind in "fiu":
        found = float(rate)
    elif step is not None and step.size == 1 and step.dtype.kind in "fiu" and float(step) > 0:
        found = 1 / float(step)
    data = {
        k: np.squeeze(v.values) for k, v in arrays.items() if k not in known and v.values.dtype.kind in "fiu"
    }
    data = {k: v for k, v in data.items() if v.ndim in (1, 2) and v.size > 1}
    if not data:
        _refuse(path, f"it has no arrays of samples; it has {', '.join(arrays) or 'none'}")
    n = int(time.size) if time is not None and time.ndim == 1 else max(max(v.shape) for v in data.values())
    channels: list[str] = []
    curves: list[Floats] = []
    units: list[str] = []
    for key, value in data.items():
        if n not in value.shape:
            continue
        columns = value.reshape(n, 1) if value.ndim == 1 else value if value.shape[0] == n else value.T
        count = columns.shape[1]
        own = [f"{key}[{k + 1}]" for k in range(count)]
        if names is not None and names.dtype.kind == "U" and names.size == count:
            own = [str(x) for x in names.reshape(-1)]
        channels += own if count > 1 else [key]
        curves += list(columns.T.astype(float))
        units += [arrays[key].unit] * count
    if not curves:
        sizes = ", ".join(f"{key} {'x'.join(str(m) for m in v.shape)}" for key, v in data.items())
        _refuse(path, f"its times are {n}, and no array has as many samples; it has {sizes}")
    return _together(path, _rate(path, sample_rate, found), channels, curves, units)


def _npz(path: Path, sample_rate: float | None) -> TimeData:
    return _arrays(path, {key: Named(value) for key, value in named_arrays(path).items()}, sample_rate)


def _uff(path: Path, sample_rate: float | None) -> TimeData:
    """Return the time responses of a universal file (function type 1)."""
    records = [f for f in read_quietly(path, FRFKind.ACCELERANCE).functions if f.function_type == 1]
    if not records:
        _refuse(path, "it has no time responses (dataset 58, function type 1)")
    rates = [_rate_of(path, f.x) for f in records]
    if not np.allclose(rates, rates[0], rtol=UNEVEN):
        _refuse(path, f"its records have different sample rates, {min(rates):g} to {max(rates):g} Hz")
    labels = [f.response for f in records]
    names = labels if len(set(labels)) == len(labels) else [f.response_name or f.response for f in records]
    if len(set(names)) < len(names):
        names = [f"{name} ({k + 1})" for k, name in enumerate(names)]
    curves = [np.real(f.values).astype(float) for f in records]
    return _together(path, _rate(path, sample_rate, rates[0]), names, curves, [f.unit for f in records])


READERS: tuple[TimeReader, ...] = (
    TimeReader("WAV", (".wav",), _wav, lambda head: head[:4] == b"RIFF" and head[8:12] == b"WAVE"),
    TimeReader("LabVIEW TDMS", (".tdms",), _tdms, lambda head: head[:4] == b"TDSm"),
    TimeReader("universal file", (".uff", ".unv", ".uf", ".ufb"), _uff, is_universal),
    TimeReader("NumPy archive", (".npz",), _npz, lambda head: head[:4] == b"PK\x03\x04"),
    TimeReader(
        "HDF5 file", (".h5", ".hdf5", ".hdf"), lambda path, rate: _arrays(path, read_hdf5(path), rate),
        lambda head: any(head[k : k + 8] == HDF5_MARK for k in (0, 512, 1024, 2048)),
    ),
    TimeReader(
        "MATLAB file, of 7.3 too", (".mat",), lambda path, rate: _arrays(path, read_mat(path), rate),
        lambda head: head.startswith(b"MATLAB 5.0 MAT-file"),
    ),
    TimeReader("text in columns", (".csv", ".txt", ".tsv", ".dat", ".asc"), _text),
)  # fmt: skip
"""All formats of time data."""
