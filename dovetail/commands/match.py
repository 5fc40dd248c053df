"""``dovetail match``: the points of a test's geometry on the model."""

import argparse
import csv
from pathlib import Path

import numpy as np

from dovetail.commands.answer import Answer
from dovetail.commands.argument_types import add_placing
from dovetail.commands.common import Options, loaded
from dovetail.commands.results import Results
from dovetail.disk.output import Progress
from dovetail.file.table import StudyError
from dovetail.report.table import Column, Table
from fem.io import UFF_SUFFIXES, read_uff
from fem.io.atomic import replacing

EXAMPLE = "dovetail match study.toml geometry.unv --tolerance 0.005 --picture match.png"

RESULTS = Results(picture="the points on the model", read={"geometry": "the geometry"})


def add_arguments(p: argparse.ArgumentParser) -> None:
    """Add the options of the command to its parser."""
    p.add_argument(
        "geometry", type=Path, help="universal file with points, or a table (CSV) of name, x, y, z"
    )
    add_placing(p, "model")


def run(options: Options, progress: Progress) -> Answer:
    """Return where the points of a test's geometry are on the model; draw it."""
    from updating.measurement.matching import match_members

    study = loaded(options, ())
    names, points = _test_points(options.geometry)
    progress("matching")
    found, mesh = match_members(
        points,
        study.model.mesh,
        options.tolerance,
        axes="same" if options.same_axes else "any",
        unit=options.unit,
        alternative=options.alternative,
    )
    if options.picture is not None:
        from viz.correlation import plot_geometry_match
        from viz.style import save

        with replacing(options.picture) as scratch:
            save(plot_geometry_match(mesh, found, names), scratch)
    places = [mesh.nearest_on_members(mesh.points[p]) for _, p in found.pairs.tolist()]
    points_on = mesh.points[[p for _, p in found.pairs.tolist()]]
    table = Table.of(
        "points",
        Column("point", [names[i] for i, _ in found.pairs.tolist()], key="name"),
        *(Column(x, points_on[:, k], "m", ".4f") for k, x in enumerate("xyz")),
        Column("", list(points_on), key="point_m", places=()),
        Column("member", [member for member, _, _ in places], key="member"),
        Column("position", [position for _, position, _ in places], "m", ".4f", key="position_m"),
        Column("off", found.distance, "mm", ".2f", 1e3, key="distance_m"),
    )
    unmatched = [names[i] for i in found.unmatched]
    return Answer(
        study,
        [
            f"{study.name}: {found.describe()}",
            table,
            *(f"{name} lies on no member within the tolerance" for name in unmatched),
        ],
        {
            "scale_m": found.scale,
            "rotation": found.R,
            "translation_m": found.translation,
            "points": table.records(),
            "unmatched": unmatched,
        },
    )


def _test_points(path: Path) -> tuple[list[str], np.ndarray]:
    """Read the points of a universal file, or of a table with name, x, y and z."""
    if path.suffix.lower() in UFF_SUFFIXES:
        points = read_uff(path).points
        if points is None:
            msg = f"{path}: it has no points (dataset 15 or 2411)"
            raise StudyError(msg)
        return [str(int(k)) for k in points.labels], points.coordinates
    suffixes = ", ".join(UFF_SUFFIXES)
    allowed = f"a table of names and three coordinates, or a universal file ({suffixes}), is needed"
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            rows = [row for row in csv.reader(file) if row and any(cell.strip() for cell in row)]
    except (UnicodeDecodeError, csv.Error) as reason:
        msg = f"{path}: it is no text in UTF-8; {allowed}"
        raise StudyError(msg) from reason
    names, xyz = [], []
    for k, row in enumerate(rows):
        try:
            values = [float(cell) for cell in row[1:4]]
        except ValueError:
            if k == 0:
                continue  # a heading
            values = []
        if len(values) != 3 or not np.isfinite(values).all():
            msg = f"{path}: row {k + 1} is {', '.join(row)}; {allowed}"
            raise StudyError(msg)
        names.append(row[0].strip())
        xyz.append(values)
    if not xyz:
        msg = f"{path}: it has no points; {allowed}"
        raise StudyError(msg)
    return names, np.array(xyz)
