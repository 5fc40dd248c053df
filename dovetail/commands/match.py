"""``dovetail match``: the points of a test's geometry on the model."""

import argparse
import csv
from pathlib import Path

import numpy as np

from dovetail.commands.argument_types import positive
from dovetail.commands.common import (
    Options,
    check_places,
    loaded,
    say,
)
from dovetail.disk.output import Output, OutputError, Progress, write_json
from dovetail.file.paths import InputFile
from dovetail.file.table import StudyError
from fem.io import UFF_SUFFIXES, read_uff
from fem.io.atomic import replacing

HELP = "find where the points of a test's geometry lie on the model, with units and axes"
EXAMPLE = "dovetail match study.toml geometry.unv --tolerance 0.005 --picture match.png"


def add_arguments(p: argparse.ArgumentParser) -> None:
    """Add the options of the command to its parser."""
    p.add_argument(
        "geometry", type=Path, help="universal file with points, or a table (CSV) of name, x, y, z"
    )
    p.add_argument(
        "--tolerance", type=positive, default=0.01, metavar="M", help="largest distance [m] (default 0.01)"
    )
    p.add_argument("--unit", choices=["m", "mm", "cm", "in", "ft"], help="of the geometry (default: found)")
    p.add_argument("--same-axes", action="store_true", help="the geometry has the model's axes and origin")
    p.add_argument(
        "--alternative", type=int, metavar="K", help="which of several placements, as an error numbers them"
    )
    p.add_argument("--picture", type=Path, metavar="FILE", help="also draw the points on the model")


def run(options: Options, progress: Progress) -> None:
    """Find where the points of a test's geometry are on the model; draw it."""
    from updating.measurement.matching import match_members

    if options.picture is not None and options.picture.suffix.lower() != ".png":
        msg = f"{options.picture}: the picture is written as .png"
        raise OutputError(msg)
    geometry = InputFile(options.geometry, "the geometry")
    check_places(options, Output("--picture", options.picture), more=[geometry])
    study = loaded(options, ())
    names, points = _test_points(options.geometry)
    progress("matching")
    found, mesh = match_members(
        points, study.model.mesh, options.tolerance,
        axes="same" if options.same_axes else "any", unit=options.unit, alternative=options.alternative,
    )  # fmt: skip
    if options.picture is not None:
        from viz.correlation import plot_geometry_match
        from viz.style import save

        with replacing(options.picture) as scratch:
            save(plot_geometry_match(mesh, found, names), scratch)
    progress.close()
    rows = []
    for (i, p), distance in zip(found.pairs.tolist(), found.distance, strict=True):
        member, position, _ = mesh.nearest_on_members(mesh.points[p])
        rows.append((names[i], mesh.points[p], member, position, float(distance)))
    write_json(
        options.json,
        {
            "study": study.name,
            "scale_m": found.scale,
            "rotation": found.R,
            "translation_m": found.translation,
            "points": [
                {"name": n, "point_m": xyz, "member": m, "position_m": s, "distance_m": d}
                for n, xyz, m, s, d in rows
            ],
            "unmatched": [names[i] for i in found.unmatched],
        },
    )
    say(
        options,
        f"{study.name}: {found.describe()}",
        f"{'point':>10}  {'x m':>9} {'y m':>9} {'z m':>9}  {'off mm':>7}  member, position m",
        *(
            f"{n:>10}  {xyz[0]:9.4f} {xyz[1]:9.4f} {xyz[2]:9.4f}  {1e3 * d:7.2f}  {m}, {s:.4f}"
            for n, xyz, m, s, d in rows
        ),
        *(f"{names[i]:>10}  lies on no member within the tolerance" for i in found.unmatched),
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
