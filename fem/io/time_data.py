"""Time data of files: a table of readers that give channels, their units and one sample rate."""

import logging
import os
import re
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from fem.analysis.frf import FRFKind
from fem.array_types import Floats
from fem.io.arrays import TableError, named_arrays
from fem.io.columns import Columns, read_columns
from fem.io.faults import error_at
from fem.io.frf_files import is_universal
from fem.io.frf_labels import frequency_factor
from fem.io.frf_reading import optional
from fem.io.mat_hdf5 import HDF5_MARK, Named, read_hdf5, read_mat
from fem.io.uff import read_quietly
from fem.io.units import TIME_NAMES, UnitHeading, conversion, heading_of, size_of, split_heading

_FACTORS = ("scalefactor", "scale", "scaling", "gain", "slope", "multiplier", "calibrationfactor")
_OFFSETS = ("addoffset", "offset")
"""Attributes that scale and shift values, in small letters alone."""
SAME_RATE = 1e-3
"""Relative difference of sample rates that is rounding [-]."""
UNEVEN = 1e-3
"""Largest deviation of a time step from the median one, beyond which samples do not follow evenly [-]."""

_TIMES = (*TIME_NAMES, "seconds", "xvalue")
_RATES = ("fs", "samplerate", "samplingrate", "samplefrequency", "samplingfrequency", "rate")
_STEPS = ("dt", "timestep", "increment", "samplingtime")
_UNITS = ("units", "unit", "channelunits", "unitlabels")
_NAMES = ("channels", "names", "labels", "channelnames", "channellabels")
_UNIT_KEYS = ("unit_string", "unit", "units", "NI_UnitDescription")
"""Properties of TDMS that hold a channel's unit; the first that is there counts."""
_TDMS_SCALES = (
    "Linear",
    "Polynomial",
    "RTD",
    "Strain",
    "Table",
    "Thermistor",
    "Thermocouple",
    "Add",
    "Subtract",
    "AdvancedAPI",
)
"""Scales of TDMS that nptdms applies; of another one it returns the raw counts."""
_LEAD_IN = 28
"""Bytes of the lead-in of a TDMS segment."""
_QUANTITY_WORDS = {
    (1, 0, 0, 0): r"force|load|hammer|shaker|kraft|impact",
    (0, 1, -2, 0): r"acc|accel|acceleration|accelerometer|beschl\w*",
    (0, 1, -1, 0): r"vel|velocity|speed|geschw\w*",
    (0, 1, 0, 0): r"disp|displacement|defl|deflection|weg|laser",
}
"""Words of a channel's name by the dimension of the quantity; with one, a unit may follow an underscore."""

MOTION_UNITS = {FRFKind.RECEPTANCE: "m", FRFKind.MOBILITY: "m/s", FRFKind.ACCELERANCE: "m/s^2"}
"""SI units of translations, by the kind of the FRF whose response they are."""


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
    notes : tuple of str
        Omissions, such as samples before all channels have started.
    """

    name: str
    sample_rate: float
    channels: tuple[str, ...]
    values: Floats
    units: tuple[str, ...]
    full_scale: float | None = None
    stated_rate: float | None = None
    notes: tuple[str, ...] = ()

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
    return conversion(label, "N")


def motion_unit(label: str) -> tuple[FRFKind, float] | None:
    """Return of which kind of FRF a motion is the response, and the size of its unit in SI; None for none."""
    for kind, unit in MOTION_UNITS.items():
        factor = conversion(label, unit)
        if factor is not None:
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
            "samples must follow evenly, without gaps",
        )
    return data


def _stated_rate(reader: TimeReader, file: Path) -> float | None:
    """Return the sample rate that a file states; None where it states none, or times that are uneven."""
    try:
        return reader.read(file, None).sample_rate
    except TableError:
        return None


def _refuse(path: Path, text: str) -> NoReturn:
    raise error_at(path.name, text, TableError)


def _rate(path: Path, given: float | None, found: float | None) -> float:
    rate = given if given is not None else found
    if rate is None or not (np.isfinite(rate) and rate > 0):
        _refuse(path, "it does not say its sample rate; give it [Hz], --sample-rate")
    return float(rate)


def _rate_of(path: Path, time: Floats) -> float:
    """Return the sample rate of times that follow evenly."""
    if time.size < 2:
        _refuse(path, "it has fewer than two samples")
    if not np.isfinite(time).all():
        k = int(np.argmin(np.isfinite(time)))
        _refuse(path, f"the time of sample {k + 1} is {time[k]:g}; finite times are needed")
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
    nptdms = optional("nptdms", path.name)
    _refuse_cut_tdms(path)
    # it writes about damaged files to standard error, which are refused below
    logs: Any = optional("nptdms.log", path.name).log_manager
    level = logs.log_level
    logs.set_level(logging.CRITICAL)
    try:
        file = nptdms.TdmsFile.read(path)
        found: list[tuple[Any, ...]] = []
        for group in file.groups():
            for channel in group.channels():
                for properties in (file.properties, group.properties, channel.properties):
                    _refuse_number_of_scales(path, channel.name, properties)
                merged = file.properties | group.properties | channel.properties
                found.append((group.name, channel.name, merged, channel[:]))
    except TableError:
        raise
    except Exception as reason:  # damaged files raise whatever the library comes upon
        msg = f"{path.name}: it cannot be read as TDMS ({' '.join(str(reason).split())[:100]})"
        raise TableError(msg) from reason
    finally:
        logs.set_level(level)
    if file.file_status.incomplete_final_segment:
        _refuse(path, "it is cut short: its last segment is not complete")
    found = [(*f[:3], np.asarray(f[3])) for f in found]
    found = [f for f in found if f[3].dtype.kind in "fiu" and f[3].ndim == 1 and f[3].size]
    if not found:
        _refuse(path, "it has no channels of numbers")
    names = [name for _, name, _, _ in found]
    alike = len(set(names)) < len(names)
    channels = tuple(f"{group}/{name}" if alike else name for group, name, _, _ in found)
    for name, f in zip(channels, found, strict=True):
        _refuse_unknown_scale(path, name, f[2])
    known = {step for name, f in zip(channels, found, strict=True) if (step := _tdms_step(path, name, f[2]))}
    if len(known) > 1:
        _refuse(
            path, f"its channels have different sample steps, {', '.join(f'{s:g} s' for s in sorted(known))}"
        )
    rate = 1 / known.pop() if known else None
    units = tuple(next((str(f[2][k]) for k in _UNIT_KEYS if f[2].get(k)), "") for f in found)
    curves = [f[3].astype(float) for f in found]
    given = _rate(path, sample_rate, rate)
    return _together(path, given, channels, curves, units, _tdms_starts(path, channels, found, rate or given))


def _refuse_cut_tdms(path: Path) -> None:
    """Refuse a file that does not end with a segment; nptdms reads it to the last complete one.

    A segment begins with TDSm, its table of contents, its version, and the bytes from the end of these 28 to
    the next segment (NI, *TDMS File Format Internal Structure*).
    """
    size, at = path.stat().st_size, 0
    with path.open("rb") as file:
        while at < size:
            file.seek(at)
            lead = file.read(_LEAD_IN)
            if len(lead) < _LEAD_IN or lead[:4] != b"TDSm":
                _refuse(
                    path, f"it is cut short or damaged: no complete segment begins at byte {at} of {size}"
                )
            big = bool(int.from_bytes(lead[4:8], "little") & 0x40)
            after = at + _LEAD_IN + int.from_bytes(lead[12:20], "big" if big else "little")
            if after > size:
                _refuse(
                    path, f"it is cut short: its segment from byte {at} on is not complete ({size} bytes)"
                )
            at = after


def _refuse_number_of_scales(path: Path, name: str, properties: Mapping[str, Any]) -> None:
    """Refuse more scales than there are properties, which nptdms would count to the end."""
    known = [int(found[1]) + 1 for key in properties if (found := re.match(r"NI_Scale\[(\d+)\]", key))]
    number = max([int(properties.get("NI_Number_Of_Scales", 0)), *known])
    if number > len(properties):
        _refuse(
            path,
            f"channel '{name}' would have {number} scales (NI_Number_Of_Scales), and {len(properties)} "
            "properties in all; each scale has one at least",
        )


def _refuse_unknown_scale(path: Path, name: str, properties: Mapping[str, Any]) -> None:
    """Refuse a channel with a scale that would be left out."""
    if properties.get("NI_Scaling_Status") == "scaled":
        return
    for key, value in properties.items():
        if re.fullmatch(r"NI_Scale\[\d+\]_Scale_Type", key) and value not in _TDMS_SCALES:
            _refuse(
                path,
                f"channel '{name}' has the scale '{value}' ({key}), which is not known; known are "
                f"{', '.join(_TDMS_SCALES)}: apply it and write the scaled samples",
            )
    _refuse_scale_attribute(path, name, properties)


def _refuse_scale_attribute(path: Path, name: str, attributes: Mapping[str, Any]) -> None:
    """Refuse an attribute that scales or shifts the values of a channel."""
    for key, value in attributes.items():
        plain = re.sub(r"[^a-z]", "", key.lower())
        neutral = 1.0 if plain in _FACTORS else 0.0 if plain in _OFFSETS else None
        if neutral is None:
            continue
        try:
            same = bool(np.all(np.asarray(value, dtype=float) == neutral))
        except (TypeError, ValueError):
            same = False
        if not same:
            _refuse(
                path,
                f"channel '{name}' has the attribute {key} = {value}, which is not applied; apply it and "
                f"write the scaled samples without it",
            )


def _tdms_step(path: Path, name: str, properties: Mapping[str, Any]) -> float | None:
    """Return the time between samples [s]; None where the file does not state it."""
    step, label = properties.get("wf_increment"), str(properties.get("wf_xunit_string", ""))
    if not (isinstance(step, float | int) and step > 0):
        return None
    return float(step) * _seconds(path, f"channel '{name}' (wf_xunit_string)", label)


def _tdms_starts(
    path: Path, channels: Sequence[str], found: Sequence[tuple[Any, ...]], rate: float
) -> list[float]:
    """Return the starts of channels [s]: their offset from their date, and this from the first one."""
    dates = [f[2].get("wf_start_time") for f in found]
    dated = [np.datetime64(d, "us") for d in dates if d is not None]
    if len(set(dated)) > 1 and len(dated) < len(dates):
        bare = channels[dates.index(None)]
        _refuse(
            path,
            f"channel '{bare}' has no wf_start_time and others start at different ones; they cannot be "
            "aligned",
        )
    out = []
    for name, f, date in zip(channels, found, dates, strict=True):
        offset = f[2].get("wf_start_offset", 0.0)
        label = str(f[2].get("wf_xunit_string", ""))
        offset = float(offset) * _seconds(path, f"channel '{name}' (wf_xunit_string)", label)
        since = (
            0.0 if date is None else float((np.datetime64(date, "us") - min(dated)) / np.timedelta64(1, "s"))
        )
        # a date in microseconds may be off by one of these
        steps = float(np.round(since * rate))
        out.append(offset + (steps / rate if abs(since - steps / rate) <= min(1e-6, 0.25 / rate) else since))
    return out


def _seconds(path: Path, what: str, label: str) -> float:
    """Return the size of a unit of time [s]; 1 where there is none."""
    factor = conversion(label, "s") if label.strip() else 1.0
    if factor is None:
        _refuse(
            path, f"{what} is in '{label}', which is no unit of time that is known; s, ms, us and min are"
        )
    return factor


def _together(
    path: Path,
    rate: float,
    channels: Sequence[str],
    curves: Sequence[Floats],
    units: Sequence[str],
    starts: Sequence[float] | None = None,
    file_rate: float | None = None,
) -> TimeData:
    """Return channels of one rate on the samples that all of them have.

    Parameters
    ----------
    path : Path
    rate : float
        [Hz].
    channels, curves, units : sequences
    starts : sequence of float, optional
        Times of their first samples [s].
    file_rate : float, optional
        That of the starts, where another one is asked for [Hz].
    """
    shift = np.zeros(len(curves)) if starts is None else np.asarray(starts, dtype=float)
    shift = (shift - shift.min()) * (file_rate or rate)
    with np.errstate(invalid="ignore"):
        offsets = np.round(shift).astype(np.int64)
    # Largest distance of a start from the samples of other channels that counts as rounding [samples]
    bad = ~(np.abs(shift - offsets) <= 0.02)  # starts that are no number among them
    if bad.any():
        k = int(np.argmax(bad))
        _refuse(
            path,
            f"channel '{channels[k]}' starts {shift[k]:.6g} samples after the first one; channels that share "
            "their samples, a whole number of them apart, are needed",
        )
    sizes = {name: c.size for name, c in zip(channels, curves, strict=True)}
    if not offsets.any():
        if len(set(sizes.values())) > 1:
            shown = ", ".join(f"{name} {n}" for name, n in list(sizes.items())[:6])
            _refuse(path, f"its channels have different numbers of samples ({shown}); one number is needed")
        return TimeData(path.name, rate, tuple(channels), np.column_stack(curves), tuple(units))
    first, last = offsets.max(), min(w + c.size for w, c in zip(offsets, curves, strict=True))
    if last - first < 1:
        _refuse(path, "its channels have no time in common")
    values = np.column_stack([c[first - w : last - w] for w, c in zip(offsets, curves, strict=True)])
    late = channels[int(np.argmax(offsets))]
    note = (
        f"{path.name}: its channels start at different times, '{late}' "
        f"{offsets.max() / (file_rate or rate):.6g} s after the first; the {last - first} samples that all "
        "of them have are used"
    )
    return TimeData(path.name, rate, tuple(channels), values, tuple(units), notes=(note,))


def _text(path: Path, sample_rate: float | None) -> TimeData:
    table = read_columns(path)
    if np.iscomplexobj(table.values):
        _refuse(path, "it has complex numbers; time data are real")
    heads = _heads(table)
    times = {k: t for k, h in enumerate(heads) if (t := _time_heading(h, first=k == 0)) is not None}
    if not times and sample_rate is None and _rises(table.values[:, 0].real):
        times = {0: _unnamed_times(path, heads[0])}
    rest = [k for k in range(table.width) if k not in times]
    seconds = {}
    for k, heading in times.items():
        stamped = k == 0 and table.stamped
        label = "" if stamped else heading.unit
        seconds[k] = _seconds(path, f"the column '{heading.name}'", label) * table.values[:, k].real
    starts, file_rate = _starts_of_columns(path, rest, seconds, even=sample_rate is None)
    channels = [heads[k].name or f"ch{i + 1}" for i, k in enumerate(rest)]
    curves = [np.asarray(table.values[:, k], dtype=float) for k in rest]
    units = [heads[k].unit for k in rest]
    if not rest:
        _refuse(path, "it has times and no other channels")
    return _together(path, _rate(path, sample_rate, file_rate), channels, curves, units, starts, file_rate)


def _rises(x: Floats) -> bool:
    """Return whether numbers rise evenly, as times without a name do."""
    step = np.diff(x)
    return step.size > 0 and bool((step > 0).all()) and bool(np.ptp(step) <= 2 * UNEVEN * step.mean())


def _time_heading(heading: UnitHeading, first: bool) -> UnitHeading | None:
    """Return the heading of a column of times with its unit; None for another column.

    A first column may have a unit of time alone for its name, or any name and a unit of time.
    """
    found = heading_of(heading.name, _TIMES, digits=True)
    if found is not None:
        return UnitHeading(heading.name, heading.unit or found.unit)
    if not first:
        return None
    if not heading.unit and conversion(heading.name, "s") is not None:
        return UnitHeading(heading.name, heading.name)
    return heading if conversion(heading.unit, "s") is not None else None


def _unnamed_times(path: Path, heading: UnitHeading) -> UnitHeading:
    """Return the heading of a first column that rises evenly, which may have no name."""
    if heading.unit or heading.name.lower() not in ("", "x", "x-axis", "x axis", "abscissa"):
        unit = f" [{heading.unit}]" if heading.unit else ""
        _refuse(
            path,
            f"it does not say its sample rate: its first column '{heading.name}'{unit} rises evenly, and is "
            "not called time; name it, such as 'time [s]', or give the rate [Hz], --sample-rate",
        )
    return heading


def _starts_of_columns(
    path: Path, channels: Sequence[int], seconds: Mapping[int, Floats], even: bool
) -> tuple[list[float] | None, float | None]:
    """Return the start of each channel by the times to its left [s], and their rate [Hz].

    ``even`` refuses times that do not follow evenly; of one column they are else left out.
    """
    if not seconds or (not even and len(seconds) == 1):
        return None, None
    rates = {k: _rate_of(path, t) for k, t in seconds.items()}
    low, high = min(rates.values()), max(rates.values())
    if high - low > SAME_RATE * high:
        _refuse(path, f"its columns of times have different sample rates, {low:.6g} to {high:.6g} Hz")
    columns = list(seconds)
    of = [max((c for c in columns if c < k), default=columns[0]) for k in channels]
    return [float(seconds[c][0]) for c in of], rates[columns[0]]


def _heads(table: Columns) -> list[UnitHeading]:
    """Return names and units above the columns of time data."""
    out = []
    for k in range(table.width):
        name = unit = ""
        for row in table.heads[::-1]:
            cell = row[k]
            known = size_of(cell) is not None or cell.lower() in ("v", "mv", "pa")
            if known and not unit and len(table.heads) > 1:
                unit = cell
            elif cell and not name:
                found = split_heading(cell)
                name, unit = found.name, unit or found.unit
        out.append(UnitHeading(name, unit or _unit_behind(name)))
    return out


def _unit_behind(name: str) -> str:
    """Return the unit behind an underscore of a name that states its quantity, ``acc_g``; else nothing.

    ``acc_N`` has none: the N is not one of accelerations, but may be the north.
    """
    words = re.split(r"[_\s]+", name)
    found = size_of(words[-1]) if len(words) > 1 else None
    quantity = _QUANTITY_WORDS.get(found[1]) if found is not None else None
    if quantity is None or not any(re.fullmatch(rf"({quantity})\d*", w, re.IGNORECASE) for w in words[:-1]):
        return ""
    return words[-1]


def _arrays(path: Path, arrays: dict[str, Named], sample_rate: float | None) -> TimeData:
    """Return the channels among named arrays: those with as many samples as the times, or the longest."""

    def named(words: Sequence[str]) -> dict[str, UnitHeading]:
        found = {key: heading_of(key.rpartition("/")[2], words) for key in arrays}
        return {key: heading for key, heading in found.items() if heading is not None}

    names, unit_labels = (
        next((np.squeeze(arrays[key].values) for key in named(words)), None) for words in (_NAMES, _UNITS)
    )
    times = {
        key: _seconds(path, f"'{key}'", arrays[key].unit or heading.unit)
        * np.ravel(arrays[key].values).astype(float)
        for key, heading in named(_TIMES).items()
        if arrays[key].values.dtype.kind in "fiu"
        and arrays[key].values.size == max(arrays[key].values.shape, default=0) > 1
    }
    known = {key for words in (_TIMES, _RATES, _STEPS, _NAMES, _UNITS) for key in named(words)}
    data = {
        k: np.squeeze(v.values) for k, v in arrays.items() if k not in known and v.values.dtype.kind in "fiu"
    }
    data = {k: v for k, v in data.items() if v.ndim in (1, 2) and v.size > 1}
    if not data:
        _refuse(path, f"it has no arrays of samples; it has {', '.join(arrays) or 'none'}")
    file_rate = _rate_of_times(path, times) if times and (sample_rate is None or len(times) > 1) else None
    found = sample_rate or file_rate or _stated(path, arrays, named(_RATES), named(_STEPS))
    longest = max(max(v.shape) for v in data.values())
    channels: list[str] = []
    curves: list[Floats] = []
    units: list[str] = []
    starts: list[float] = []
    for key, value in data.items():
        time = _times_of(path, key, times)
        n = longest if time is None else time.size
        if n not in value.shape:
            continue
        _refuse_scale_attribute(path, key, arrays[key].attributes)
        columns = value.reshape(n, 1) if value.ndim == 1 else value if value.shape[0] == n else value.T
        count = columns.shape[1]
        labels = [f"{key}[{k + 1}]" for k in range(count)]
        if names is not None and names.dtype.kind == "U" and names.size == count:
            labels = [str(x) for x in names.reshape(-1)]
        of_columns = [arrays[key].unit] * count
        if (
            unit_labels is not None
            and unit_labels.dtype.kind == "U"
            and unit_labels.size == count
            and count > 1
        ):
            of_columns = [str(x) for x in unit_labels.reshape(-1)]
        channels += labels if count > 1 else [key]
        curves += list(columns.T.astype(float))
        units += [unit or _unit_behind(key.rpartition("/")[2]) for unit in of_columns]
        starts += [0.0 if time is None else float(time[0])] * count
    if not curves:
        listed = ", ".join(f"{k} {' × '.join(map(str, v.shape))}" for k, v in data.items())
        sizes = ", ".join(f"{k} {t.size}" for k, t in times.items())
        _refuse(path, f"no array has as many samples as its times ({sizes}); it has {listed}")
    return _together(path, _rate(path, sample_rate, found), channels, curves, units, starts, file_rate)


def _rate_of_times(path: Path, times: Mapping[str, Floats]) -> float:
    """Return the one sample rate of vectors of times [Hz]."""
    rates = {key: _rate_of(path, t) for key, t in times.items()}
    if max(rates.values()) - min(rates.values()) > SAME_RATE * max(rates.values()):
        listed = ", ".join(f"{key} {rate:.6g} Hz" for key, rate in rates.items())
        _refuse(path, f"its times have different sample rates ({listed})")
    return next(iter(rates.values()))


def _stated(
    path: Path,
    arrays: Mapping[str, Named],
    rates: Mapping[str, UnitHeading],
    steps: Mapping[str, UnitHeading],
) -> float | None:
    """Return the sample rate that a number of the file states, or its inverse [Hz]; None without one."""
    for of, inverse in ((rates, False), (steps, True)):
        for key, heading in of.items():
            value, label = np.squeeze(arrays[key].values), arrays[key].unit or heading.unit
            if value.size != 1 or value.dtype.kind not in "fiu" or float(value) <= 0:
                continue
            if inverse:
                return 1 / (float(value) * _seconds(path, f"'{key}'", label))
            factor = frequency_factor(label) if label else 1.0
            if factor is None:
                _refuse(
                    path, f"'{key}' is in '{label}', which is no unit of a sample rate that is known; Hz is"
                )
            return float(value) * factor
    return None


def _times_of(path: Path, key: str, times: Mapping[str, Floats]) -> Floats | None:
    """Return the times of a channel: of its folder or name where there are several; None without any.

    ``acc/time`` and ``time_acc`` are those of ``acc/values`` and ``acc``.
    """
    every = list(times.values())
    if not every:
        return None
    if all(t.size == every[0].size and np.array_equal(t, every[0]) for t in every):
        return every[0]
    folder, _, name = key.rpartition("/")
    for other, time in times.items():
        parent, _, last = other.rpartition("/")
        words = re.split(r"[_\s]+", last.lower())
        if (parent and folder == parent) or (parent == folder and name.lower() in words):
            return time
    _refuse(
        path,
        f"it has several vectors of times that differ ({', '.join(times)}), and none of them is named after "
        f"'{key}', as time_{name} would be",
    )


def _npz(path: Path, sample_rate: float | None) -> TimeData:
    return _arrays(path, {key: Named(value) for key, value in named_arrays(path).items()}, sample_rate)


def _uff(path: Path, sample_rate: float | None) -> TimeData:
    """Return the time responses of a universal file (function type 1)."""
    records = [f for f in read_quietly(path, FRFKind.ACCELERANCE).functions if f.function_type == 1]
    if not records:
        _refuse(path, "it has no time responses (dataset 58, function type 1)")
    times = [f.x * _seconds(path, f"the abscissa of {f.response}", f.x_unit) for f in records]
    rates = [_rate_of(path, t) for t in times]
    if not np.allclose(rates, rates[0], rtol=UNEVEN):
        _refuse(path, f"its records have different sample rates, {min(rates):g} to {max(rates):g} Hz")
    labels = [f.response for f in records]
    names = labels if len(set(labels)) == len(labels) else [f.response_name or f.response for f in records]
    if len(set(names)) < len(names):
        names = [f"{name} ({k + 1})" for k, name in enumerate(names)]
    curves = [np.real(f.values).astype(float) for f in records]
    starts, units = [float(t[0]) for t in times], [f.unit for f in records]
    return _together(path, _rate(path, sample_rate, rates[0]), names, curves, units, starts, rates[0])


READERS: tuple[TimeReader, ...] = (
    TimeReader("WAV", (".wav",), _wav, lambda head: head[:4] == b"RIFF" and head[8:12] == b"WAVE"),
    TimeReader("LabVIEW TDMS", (".tdms",), _tdms, lambda head: head[:4] == b"TDSm"),
    TimeReader("universal file", (".uff", ".unv", ".uf", ".ufb"), _uff, is_universal),
    TimeReader("NumPy archive", (".npz",), _npz, lambda head: head[:4] == b"PK\x03\x04"),
    TimeReader(
        "HDF5 file",
        (".h5", ".hdf5", ".hdf"),
        lambda path, rate: _arrays(path, read_hdf5(path), rate),
        lambda head: any(head[k : k + 8] == HDF5_MARK for k in (0, 512, 1024, 2048)),
    ),
    TimeReader(
        "MATLAB file, of 7.3 too",
        (".mat",),
        lambda path, rate: _arrays(path, read_mat(path), rate),
        lambda head: head.startswith(b"MATLAB 5.0 MAT-file"),
    ),
    TimeReader("text in columns", (".csv", ".txt", ".tsv", ".dat", ".asc"), _text),
)
"""All formats of time data."""
