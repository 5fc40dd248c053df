"""Measured FRFs at the sensors and excitations of a study."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dovetail.file.measured import RawMeasurement, array_for, pieces_of
from dovetail.file.sensors import Channel
from dovetail.file.table import StudyTable, suggest
from fem.analysis.frf import FRF
from updating.measurement.held_out import EXAMPLE, Band, band_of
from updating.measurement.measurement import STRAIN, Measurement, at_values_of, references_of
from updating.quality.corrections import Fault, set_right

Picked = tuple[Channel, str, float]
"""A channel, its label in the file, and the sign that turns the reading into its direction."""


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
        rows = picked = _pick(r, sensors, r.frf.outputs, "responses")
        columns = _pick(r, excitations, r.frf.inputs, "forces")
        for c, label, _ in columns:
            if label in r.frf.base and not c.sensor.per_acceleration:
                r.table.refuse(
                    "file",
                    f"its FRFs to {label} are to an acceleration, and excitation '{c.sensor.name}' is a "
                    'force; for a shaker table give [[excitations]] base = "x", for responses over that of a '
                    f'sensor give the excitation reference = "{label}", or give kind if the file is wrong',
                )
        for c, label, _ in rows:
            if label in r.frf.strain and c.sensor.quantity != STRAIN:
                c.table.refuse(
                    "",
                    f"channel {label} of {r.name} measures strain, and sensor '{c.sensor.name}' a motion; "
                    'give quantity = "strain" and offset, or another label',
                )
        references = references_of([c.sensor for c, _, _ in columns])
        rows = _without_references(r, rows, columns, notes)
        used |= {f"s:{s.name}" for s in references}
        used |= {f"s:{c.sensor.name}" for c, _, _ in rows} | {f"e:{c.sensor.name}" for c, _, _ in columns}
        for word, have, got in (("responses", r.frf.outputs, picked), ("forces", r.frf.inputs, columns)):
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
        H = H * sign if r.phase else np.abs(H)
        base = [c.sensor.name for c, _, _ in columns if c.sensor.per_acceleration]
        strain = [c.sensor.name for c, _, _ in rows if c.sensor.quantity == STRAIN]
        frf = FRF.from_arrays(frf.frequency, H, frf.kind, *names, base=base, strain=strain)
        _refuse_zero(r, frf)
        ends = [tuple(c.sensor for c, _, _ in part) for part in (rows, columns)]
        chosen = r.frf.select([label for _, label, _ in rows], [label for _, label, _ in columns])
        known = [None if x is None else at_values_of(x, r.frf, chosen) for x in (r.coherence, r.scatter)]
        with r.table.at("coherence"):
            measurement = Measurement(
                frf,
                ends[0],
                ends[1],
                r.force_level,
                r.name,
                known[0],
                r.averages,
                known[1],
                phase=r.phase,
                viscous=r.viscous,
                other_sensors=tuple(s for s in references if s not in ends[0]),
            )
        with r.table.at():
            measurement = set_right(measurement, faults) if faults else measurement
        if r.compared is not None:
            with r.table.at("compared"):
                choice, pieces = array_for(r.compared, measurement.frf, "compared"), pieces_of(r.compared)
                measurement = replace(measurement, compared=choice, pieces=pieces)
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
    """Return FRFs with the convention of each sensor and force corrected."""
    flip = np.logical_xor.outer(*([c.convention.conjugate for c in part] for part in (rows, columns)))
    angle = np.add.outer(*([c.convention.phase for c in part] for part in (rows, columns)))
    H = np.where(flip, np.conj(frf.H), frf.H) * np.exp(1j * np.deg2rad(angle))
    for i, c in enumerate(rows):
        old = c.convention.kind
        power = 0 if old is None else frf.kind.derivatives - old.derivatives
        if power < 0 and frf.frequency[0] == 0:
            c.table.refuse(
                "kind", f"the line at 0 Hz cannot be converted from {old} to {frf.kind}; exclude it with band"
            )
        if power:
            H[:, i] *= ((1j * frf.omega) ** power)[:, None]
    return H


def _near(channels: Sequence[Channel], labels: Sequence[str]) -> str:
    """Return which nodes of a file lie at sensors' places, as a hint; nothing if none does."""
    nodes = {label.rstrip("XYZR+-S") for label in labels}
    found = [f"node {n} is at '{c.sensor.name}'" for c in channels for n in c.near if str(n) in nodes]
    return f" ({', '.join(found[:4])}{' …' if len(found) > 4 else ''})" if found else ""


def _pick(r: RawMeasurement, channels: Sequence[Channel], labels: Sequence[str], word: str) -> list[Picked]:
    out: list[Picked] = []
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
            f"none of its {word} ({', '.join(labels[:8])}{' …' if len(labels) > 8 else ''}) belongs to a "
            f"sensor or excitation of the study; give them a label or a node{_near(channels, labels)}",
        )
    return out


def _without_references(
    r: RawMeasurement, rows: list[Picked], columns: list[Picked], notes: list[str]
) -> list[Picked]:
    """Return the rows without sensors that responses refer to: their ratio is 1 by definition."""
    names = {s.name for s in references_of([c.sensor for c, _, _ in columns])}
    kept = [row for row in rows if row[0].sensor.name not in names]
    if left_out := [c.sensor.name for c, _, _ in rows if c.sensor.name in names]:
        notes.append(f"{r.name}: the responses refer to {', '.join(left_out)}, which is not compared itself")
    if names and r.force_level is not None:
        r.table.refuse("force_level", f"the responses refer to {', '.join(names)}: the force is unknown")
    if not kept:
        r.table.refuse("file", f"its only response, {', '.join(names)}, is the one that responses refer to")
    mixed = [c.sensor.name for c, _, _ in columns if c.sensor.reference_sensor() is None]
    if mixed and len(kept) < len(rows):
        r.table.refuse(
            "file",
            f"its FRFs to {mixed[0]} have the response {', '.join(names)}, which FRFs to another excitation "
            "refer to; give the two excitations a file each",
        )
    return kept


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


def labels_of(raw: Sequence[RawMeasurement], which: str, motions: bool = False) -> list[str]:
    """Return the labels of all responses or forces of the files, each once, or of ``motions`` alone."""
    left_out = {x for r in raw for x in r.frf.strain} if motions else ()
    return list(dict.fromkeys(x for r in raw for x in getattr(r.frf, which) if x not in left_out))


def top_frequency(raw: Sequence[RawMeasurement], band: tuple[float, float] | None) -> float | None:
    """Return the highest frequency that is compared [Hz]."""
    if not raw:
        return None
    highest = max(float(r.frf.frequency[-1]) for r in raw)
    return highest if band is None else min(highest, band[1])


HeldOut = tuple[tuple[str, ...], tuple[str, ...], tuple[Band, ...]]
"""Excitations, sensors and bands [Hz] that are compared and not fitted."""


def read_held_out(fit: StudyTable, sensors: Sequence[Channel], excitations: Sequence[Channel]) -> HeldOut:
    """Return the excitations, the sensors and the bands that are kept from the fit.

    A name that both have is the excitation's; ``sensor NAME`` and ``excitation NAME`` say which is meant.
    ``band 120-180 Hz`` is a band.
    """
    have = {"excitation": [c.sensor.name for c in excitations], "sensor": [c.sensor.name for c in sensors]}
    out: dict[str, list[str]] = {"excitation": [], "sensor": []}
    bands: list[Band] = []
    for word in fit.texts("held_out", ()):
        with fit.at("held_out"):
            band = band_of(word)
        if band is not None:
            bands.append(band)
            continue
        first, _, rest = word.partition(" ")
        options = [(first, rest)] if first in have else [(role, word) for role in have]
        found = [(role, name) for role, name in options if name in have[role]]
        if not found:
            known = [name for role, _ in options for name in have[role]]
            what = " or ".join(role for role, _ in options)
            more = f"; a band is written as '{EXAMPLE}'" if first == "band" else ""
            fit.refuse(
                "held_out", f"there is no {what} '{options[0][1]}'; {suggest(options[0][1], known)}{more}"
            )
        role, name = found[0]
        out[role].append(name)
    return tuple(out["excitation"]), tuple(out["sensor"]), tuple(bands)
