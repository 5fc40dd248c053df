"""A study to start from, made of a test's FRFs with its geometry, and a mesh or a deck."""

import csv
import io
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dovetail.file.from_deck import Structure, named_from
from dovetail.file.named_points import NamedPoints
from dovetail.file.table import StudyError
from dovetail.file.toml import toml_table, toml_value
from dovetail.file.uncertain import assumed_tables
from fem.analysis.frf import FRF
from fem.io.frf_files import read_frfs
from fem.io.frf_reading import Asked
from fem.mesh import Mesh
from updating.measurement.matching import (
    SCALES,
    GeometryMatch,
    GeometryMatchError,
    match_members,
    put_on_members,
)

SENSORS, EXCITATIONS, STUDY = "sensors.csv", "excitations.csv", "study.toml"
"""Files of a draft."""

_ALONG = 1 - 1e-9
"""Component of a unit vector from which it is written as a letter."""


@dataclass(frozen=True, slots=True)
class Placing:
    """How the test's points are put on the mesh.

    Attributes
    ----------
    tolerance : float
        Largest distance of a point from a member [m].
    unit : str or None
        Of the test's coordinates; found unless given.
    same_axes : bool
        Whether the test has the mesh's axes and origin.
    alternative : int or None
        Which of several placements.
    """

    tolerance: float = 0.01
    unit: str | None = None
    same_axes: bool = False
    alternative: int | None = None


@dataclass(frozen=True, slots=True)
class Draft:
    """Texts of a study and its tables of sensors, and notes on them.

    Attributes
    ----------
    files : dict of str to str
        Texts by file name.
    notes : tuple of str
    """

    files: dict[str, str]
    notes: tuple[str, ...]


def draft_study(
    title: str,
    measured: Path,
    structure: Structure,
    folder: Path,
    *,
    kind: str | None = None,
    points: NamedPoints | None = None,
    placing: Placing | None = None,
) -> Draft:
    """Return a study of a structure and a test, with a sensor and an excitation for each response and force.

    Parameters
    ----------
    title : str
        Name of the study.
    measured : Path
        FRFs whose labels are degrees of freedom, such as ``12Z+`` or ``12:+Z``.
    structure : Structure
        Of a deck or a mesh.
    folder : Path
        Where the study will lie; the files are named from there.
    kind : str, optional
        Kind of the FRFs, where the file does not say it.
    points : NamedPoints, optional
        Geometry of the test; that of the measured file unless given.
    placing : Placing, optional

    Raises
    ------
    StudyError
        If the test has no geometry, its labels are no degrees of freedom, or none of its points is on the
        mesh.
    UffError, TableError, GeometryMatchError
        If a file cannot be read, or the points fit nowhere.
    """
    placing = placing or Placing()
    reading = read_frfs(measured, Asked(kind))
    mesh = structure.mesh
    if points is None and reading.points is not None:
        points = NamedPoints.of(reading.points)
    if points is None:
        msg = f"{measured}: it has no coordinates of nodes (dataset 15 or 2411); give --geometry"
        raise StudyError(msg)
    notes = [*structure.notes, *(f"{measured.name}: {note}" for note in reading.notes)]
    ends = _ends(measured, reading.frfs, points, notes)
    used = {node for part in ends.values() for node, _ in part.values()}
    nodes = [name for name in points.names if name in used]
    missing = sorted(used.difference(nodes))
    if missing:
        msg = f"{measured}: the geometry has no node {missing[0]}, which its FRFs name"
        raise StudyError(msg)
    try:
        found, fine = _placed(points, nodes, mesh, placing, notes)
    except GeometryMatchError as reason:
        hint = _size_hint(structure, points, nodes)
        if reason.alternatives or not (structure.units_hint or hint):
            raise
        # materials of no solid are the cause of a geometry that fits nowhere
        raise StudyError(structure.units_hint or f"{measured}: {hint} ({reason})") from reason
    place = dict(zip(found.pairs[:, 0].tolist(), found.pairs[:, 1].tolist(), strict=True))
    at = {n: fine.points[place[i]] for i, n in enumerate(nodes) if i in place}
    off = [n for n in nodes if n not in at]
    if off:
        notes.append(
            f"the nodes {', '.join(off[:8])}{' …' if len(off) > 8 else ''} lie on no member within "
            f"{placing.tolerance:g} m; their channels are left out"
        )
    tables = {
        name: _table(part, _channel_names(part, entities), at, found)
        for name, part, entities in zip((SENSORS, EXCITATIONS), ends.values(), reading.names, strict=True)
    }
    for name, (_, n) in tables.items():
        if not n:
            msg = f"{measured}: none of its {'responses' if name == SENSORS else 'forces'} is on the mesh"
            raise StudyError(msg)
    text = _text(title, structure, measured, folder, kind)
    counts = f"{tables[SENSORS][1]} sensors and {tables[EXCITATIONS][1]} excitations"
    notes.insert(0, f"{counts}: {found.describe()}")
    files = {name: table for name, (table, _) in tables.items()}
    return Draft({STUDY: text, **structure.files, **files}, tuple(notes))


def _ends(
    measured: Path, frfs: Sequence[FRF], points: NamedPoints, notes: list[str]
) -> dict[str, dict[str, tuple[str, int]]]:
    """Return node and direction of each response and force that is a translation, by label."""
    out: dict[str, dict[str, tuple[str, int]]] = {"outputs": {}, "inputs": {}}
    skipped: list[str] = []
    strains = list(dict.fromkeys(x for frf in frfs for x in frf.strain))
    if strains:
        notes.append(
            f"the strains {', '.join(strains[:8])} are left out, as the file does not give their distance "
            'from the axis of a member; write [[sensors]] with quantity = "strain" for them'
        )
    for key, part in out.items():
        for label in dict.fromkeys(x for frf in frfs for x in getattr(frf, key)):
            if label in strains and key == "outputs":
                continue
            found = points.dof(label)
            if found is None:
                known = ", ".join(points.names[:8])
                msg = (
                    f"{measured}: the channel '{label}' does not name a point of the geometry ({known}"
                    f"{' …' if len(points.names) > 8 else ''}) and a direction, as 12Z+ and 12:+Z do; write "
                    "its [[sensors]] yourself (dovetail new without --from)"
                )
                raise StudyError(msg)
            node, direction = found
            if 1 <= abs(direction) <= 3:
                part[label] = node, direction
            else:
                skipped.append(label)
    if skipped:
        notes.append(f"the channels {', '.join(skipped[:8])} are no translations and left out")
    return out


def _size_hint(structure: Structure, points: NamedPoints, nodes: Sequence[str]) -> str:
    """Return the option for a structure in mm, if it is about 1000 times as large as its test."""
    size, tested = (float(np.ptp(xyz, axis=0).max()) for xyz in (structure.mesh.points, points.at(nodes)))
    if not 700 * tested < size < 2500 * tested:
        return ""
    option = "--units mm-t-s" if structure.complete else "--units mm"
    read = "".join(f"; {note}" for note in structure.notes if note.startswith("the deck is read as a mesh"))
    return (
        f"the structure is {size / tested:.0f} times as large as the test ({size:.4g} m and {tested:.4g} m): "
        f"if it is in mm, give {option}{read}"
    )


def _placed(
    points: NamedPoints, nodes: Sequence[str], mesh: Mesh, placing: Placing, notes: list[str]
) -> tuple[GeometryMatch, Mesh]:
    """Return the placement of nodes on a mesh: as they are if they fit so, else the most upright one."""
    xyz = points.at(nodes)
    tolerance, unit = placing.tolerance, points.unit or placing.unit
    asked = placing.alternative is not None
    if placing.same_axes or not asked:
        as_is, fine = match_members(xyz, mesh, tolerance, axes="same", unit=unit)
        if placing.same_axes or not as_is.unmatched:
            return as_is, fine
        unit = next(name for name, size in SCALES.items() if size == as_is.scale)
    try:
        return match_members(xyz, mesh, tolerance, unit=unit, alternative=placing.alternative)
    except GeometryMatchError as reason:
        if not reason.alternatives:
            raise
        notes.append(
            f"the test fits the mesh in {len(reason.alternatives)} ways, of which the most upright one is "
            "taken; 'dovetail match' draws them, and --alternative K takes another"
        )
        return put_on_members(reason.alternatives[0], mesh)


def _channel_names(ends: Mapping[str, tuple[str, int]], entities: Mapping[str, str]) -> dict[str, str]:
    """Return the names of channels by their labels.

    The name of an entity names its channel, with the direction where it has several. A name that
    several nodes share is that of a component, and names none.
    """
    of_entity: dict[str, list[str]] = {}
    for label in ends:
        of_entity.setdefault(entities.get(label, ""), []).append(label)
    names: dict[str, str] = {}
    for entity, labels in of_entity.items():
        if not entity or entity.startswith("#") or len({ends[label][0] for label in labels}) > 1:
            continue
        for label in labels:
            names[label] = entity if len(labels) == 1 else f"{entity} {label.lstrip('0123456789')}"
    taken = Counter([*names.values(), *ends])
    return {label: names[label] if taken[names.get(label, "")] == 1 else label for label in ends}


def _table(
    ends: Mapping[str, tuple[str, int]],
    names: Mapping[str, str],
    at: Mapping[str, NDArray[np.float64]],
    found: GeometryMatch,
) -> tuple[str, int]:
    """Return a table of sensors, and how many it has."""
    rows = []
    for label, (node, direction) in ends.items():
        if node not in at:
            continue
        axis = found.directions(np.sign(direction) * np.eye(3)[[abs(direction) - 1]])[0]
        main = int(np.argmax(np.abs(axis)))
        letter = ("-" if axis[main] < 0 else "") + "xyz"[main] if abs(axis[main]) > _ALONG else ""
        components = ["", "", ""] if letter else [f"{v:.9g}" for v in axis]
        rows.append([names[label], *(f"{v:.9g}" for v in at[node] + 0.0), letter, *components, label])
    head = ["name", "x", "y", "z", "direction", "dx", "dy", "dz", "label"]
    if not any(row[5] for row in rows):
        head, rows = head[:5] + head[8:], [row[:5] + row[8:] for row in rows]
    out = io.StringIO()
    csv.writer(out, lineterminator="\n").writerows([head, *rows])
    return out.getvalue(), len(rows)


def _text(title: str, structure: Structure, measured: Path, folder: Path, kind: str | None) -> str:
    """Return the text of a study of a structure and a test."""
    stated = {} if kind is None else {"kind": kind}
    change = (
        ", to be completed"
        if structure.complete
        else ", to be completed: material, sections, supports and damping are placeholders"
    )
    return f"""\
# A study of a mesh and a test{change}.
#
#   dovetail check study.toml      what is wrong or missing
#   dovetail compare study.toml    the model compared with the measurement
#
# Units are SI: m, kg, s, N, Pa, Hz. docs/study-file.md says what may stand here.

sensors = {toml_value(SENSORS)} # where the test's points lie on the mesh
excitations = {toml_value(EXCITATIONS)}

[study]
name = {toml_value(title)}

{structure.text}
{toml_table("[[measurements]]", {"file": named_from(folder, measured), **stated})}
{assumed_tables()}"""
