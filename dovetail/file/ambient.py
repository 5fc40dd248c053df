"""Responses to unknown forces that a study names, ``[ambient]``, and their channels at its sensors."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dovetail.file.sensors import Channel
from dovetail.file.table import StudyTable, as_vector
from fem.analysis.frf import FRFKind
from fem.io.faults import no_file
from fem.io.time_data import TimeData, motion_unit, read_time_data
from updating.measurement.measurement import Sensor

MOTIONS = {
    FRFKind.RECEPTANCE: "displacement",
    FRFKind.MOBILITY: "velocity",
    FRFKind.ACCELERANCE: "acceleration",
}
"""The motion that a kind of FRF is the response in."""


@dataclass(frozen=True, slots=True, eq=False)
class AmbientTest:
    """Time data of an ambient test as the study names them.

    Attributes
    ----------
    table : Table
        Where it stands in the study.
    paths : tuple of Path
        The file of each set-up.
    sample_rate : float or None
        Of a file that does not say it [Hz].
    band : (float, float) or None
        Lowest and highest frequency of modes [Hz].
    scale : mapping of str to float
        Factors of channels, in place of their units [-].
    channels : tuple of Channel
        Sensors of the study.
    """

    table: StudyTable
    paths: tuple[Path, ...]
    sample_rate: float | None
    band: tuple[float, float] | None
    scale: Mapping[str, float]
    channels: tuple[Channel, ...]

    @property
    def name(self) -> str:
        """Names of the files."""
        return ", ".join(p.name for p in self.paths)


@dataclass(frozen=True, slots=True, eq=False)
class AmbientChannels:
    """Responses at the sensors of a study: values (n_samples, n_sensors), sample rate [Hz], and notes."""

    values: np.ndarray
    sample_rate: float
    sensors: tuple[Sensor, ...]
    notes: tuple[str, ...]


def read_ambient(top: StudyTable, folder: Path, channels: Sequence[Channel]) -> AmbientTest | None:
    """Read ``[ambient]``; the file is read when modes are identified in it."""
    t = top.table("ambient")
    if not t.values:
        return None
    given = t.get("file")
    names = t.texts("file") if isinstance(given, list) else (t.text("file"),)
    twice = [name for k, name in enumerate(names) if name in names[:k]]
    if twice:
        t.refuse("file", f"'{twice[0]}' is named twice; each set-up has a file of its own")
    rate = t.number("sample_rate", None, above=0, unit="Hz")
    band = t.vector("band", None, 2, "Hz")
    if band is not None and not 0 < band[0] < band[1]:
        t.refuse("band", f"{band.tolist()} is not allowed; two rising positive frequencies [Hz] are needed")
    scales = t.table("scale")
    scale = {key: float(as_vector(scales, key, [value], 1, "-")[0]) for key, value in scales.values.items()}
    t.finish()
    limits = None if band is None else (float(band[0]), float(band[1]))
    return AmbientTest(t, tuple(folder / name for name in names), rate, limits, scale, tuple(channels))


def read_channels(test: AmbientTest) -> tuple[AmbientChannels, ...]:
    """Read the time data of each set-up of an ambient test at the study's sensors, in one unit.

    Raises
    ------
    StudyError
        If there is no such file, it cannot be read, a factor is of no channel, fewer than two of its channels
        belong to sensors, or these measure motions of different kinds.
    """
    t, every = test.table, []
    for path in test.paths:
        if not path.is_file():
            t.refuse("file", no_file(path))
        with t.at("file"):
            every.append(read_time_data(path, test.sample_rate))
    channels = list(dict.fromkeys(name for data in every for name in data.channels))
    for name in test.scale:
        if name not in channels:
            t.refuse("scale", f"{test.name} has no channel '{name}'; it has {', '.join(channels)}")
    return tuple(_at_sensors(test, data) for data in every)


def _at_sensors(test: AmbientTest, data: TimeData) -> AmbientChannels:
    """Return the channels of a file that belong to sensors."""
    t = test.table
    found = [(c.sensor, *got) for c in test.channels if (got := c.find(data.channels)) is not None]
    if len(found) < 2:
        t.refuse(
            "file",
            f"of its channels ({', '.join(data.channels[:8])}{' …' if len(data.channels) > 8 else ''}) "
            f"{len(found)} belong(s) to sensors of the study; two or more are needed: give sensors a label",
        )
    labels = [label for _, label, _ in found]
    factors, notes = _factors(test, data, labels)
    values = data.values[:, [data.channel(label) for label in labels]]
    full = data.full_scale
    notes += [
        f"channel {label} of {data.name} reaches the end of its range: it may be clipped"
        for k, label in enumerate(labels)
        if full is not None and (np.abs(values[:, k]) >= 0.999 * full).any()
    ]
    notes += data.notes
    if data.rate_note:
        notes.append(data.rate_note)
    rest = [c for c in data.channels if c not in labels]
    if rest:
        shown = f"{', '.join(rest[:8])}{' …' if len(rest) > 8 else ''}"
        notes.append(f"{data.name}: the channels {shown} belong to no sensor and are not used")
    signs = np.array([sign for _, _, sign in found])
    sensors = tuple(sensor for sensor, _, _ in found)
    return AmbientChannels(values * factors * signs, data.sample_rate, sensors, tuple(notes))


def _factors(test: AmbientTest, data: TimeData, labels: Sequence[str]) -> tuple[np.ndarray, list[str]]:
    """Return factors that bring channels to one unit, and a note on those of no known unit."""
    known = {c: motion_unit(data.units[data.channel(c)]) for c in labels}
    kinds = {c: MOTIONS[k[0]] for c, k in known.items() if k is not None and c not in test.scale}
    if len(set(kinds.values())) > 1:
        listed = ", ".join(f"{c}: {kind}" for c, kind in kinds.items())
        test.table.refuse(
            "file",
            f"its channels measure different kinds of motion ({listed}); give sensors of one kind",
        )
    bare = [c for c in labels if c not in kinds and c not in test.scale]
    notes = []
    if bare and len(bare) < len(labels):
        notes.append(
            f"channels without a known unit are taken to have that of the others in SI: {', '.join(bare)}; "
            "scale in [ambient] corrects that"
        )
    factors = [test.scale.get(c, 1.0 if (unit := known[c]) is None else unit[1]) for c in labels]
    return np.array(factors), notes
