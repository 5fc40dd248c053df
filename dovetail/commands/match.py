"""``dovetail match``: the points of a test's geometry on the model."""

import argparse
from pathlib import Path

from dovetail.commands.answer import Answer
from dovetail.commands.argument_types import add_placing
from dovetail.commands.common import Options, loaded
from dovetail.commands.results import Results
from dovetail.disk.output import Progress
from dovetail.file.named_points import read_named_points, unit_of
from dovetail.report.table import Column, Table

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
    test = read_named_points(options.geometry)
    names = list(test.names)
    progress("matching")
    found, mesh = match_members(
        test.xyz,
        study.model.mesh,
        options.tolerance,
        axes="same" if options.same_axes else "any",
        unit=unit_of(test, options.unit, options.geometry),
        alternative=options.alternative,
    )
    if options.picture is not None:
        from viz.correlation import plot_geometry_match
        from viz.style import save

        save(plot_geometry_match(mesh, found, names), options.picture)
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
