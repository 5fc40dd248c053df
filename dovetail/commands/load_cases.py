"""What the commands on loads share: the load cases asked for, and names of pictures."""

import argparse
import re
from collections.abc import Mapping

from dovetail.commands.common import Options
from dovetail.file.table import StudyError
from dovetail.report.table import Column, Table
from dovetail.study import Study
from fem.analysis.statics import StaticSolution
from fem.lengths import length_text
from fem.model import DIRECTIONS
from updating.measurement.measurement import Sensor, motions_of


def add_cases(p: argparse.ArgumentParser) -> None:
    """Add the option that chooses load cases."""
    p.add_argument(
        "--case",
        action="append",
        default=[],
        metavar="NAME",
        help="a load case or combination of the study (default: all); repeatable",
    )


def solved(study: Study, options: Options) -> StaticSolution:
    """Return the responses to the load cases asked for."""
    return study.static(*dict.fromkeys(options.case))


def solved_case(study: Study, name: str | None) -> StaticSolution:
    """Return the response to one load case: the one named, or the only one.

    Raises
    ------
    StudyError
        If none is named and the study has several.
    """
    if name is None and len(study.loads.names) > 1:
        msg = f"the study has several load cases; give --case, one of {', '.join(study.loads.names)}"
        raise StudyError(msg)
    return study.static(*([] if name is None else [name]))


def require_sensors(study: Study) -> tuple[Sensor, ...]:
    """Return the sensors of motions, at which responses are computed; strain gauges are not among them.

    Raises
    ------
    StudyError
        If there is none.
    """
    found = motions_of(study.sensors)
    if not found:
        none = "no sensors of motions" if study.sensors else "no sensors"
        msg = f"{study.path.name}: the study has {none}, so that there is no response; give [[sensors]]"
        raise StudyError(msg)
    return found


def refuse_gauges(study: Study) -> None:
    """Raise a StudyError for a study with sensors that read no motion, where all FRFs have one unit."""
    gauges = [s.name for s in study.sensors if s not in motions_of(study.sensors)]
    if gauges:
        msg = (
            f"{study.path.name}: {', '.join(gauges[:4])}{' …' if len(gauges) > 4 else ''} measure no motion, "
            "and ensembles are of motions alone; leave them out"
        )
        raise StudyError(msg)


def table_of_reactions(rows: Mapping[str, Mapping[str, float]], heading: str, indent: str = "") -> Table:
    """Return forces by place and direction.

    Those in directions that are none of the six, as of a place with several points, follow in words.
    """
    others = [", ".join(f"{d} {v:.5g}" for d, v in r.items() if d not in DIRECTIONS) for r in rows.values()]
    columns = [
        Column(heading, list(rows)),
        *(Column(d, [row.get(d) for row in rows.values()]) for d in DIRECTIONS),
        Column("N, N·m", others),
    ]
    return Table("reactions", columns, indent)


def place_of_point(study: Study, point: int) -> str:
    """Return a point's name, or its place on a member."""
    mesh = study.model.mesh
    for name, known in mesh.point_names.items():
        if known == point:
            return name
    member, s, _ = mesh.nearest_on_members(mesh.points[point])
    return f"{member} at {length_text(s)}"


def file_name(number: int, name: str, what: str) -> str:
    """Return the name of a picture: number, name without signs that a file system refuses, and contents."""
    plain = re.sub(r"[^\w.-]+", "-", name).strip("-.") or "case"
    return f"{number:02d}-{plain}-{what}.png"
