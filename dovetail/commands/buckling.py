"""``dovetail buckling``: load factors at which the structure buckles, and the shapes."""

import argparse

from dovetail.commands.answer import Answer
from dovetail.commands.argument_types import add_number
from dovetail.commands.common import Options, assumptions, loaded, notes_of_mesh
from dovetail.commands.load_cases import solved_case
from dovetail.commands.results import Results, write_motions
from dovetail.disk.output import Progress, result_folder
from dovetail.report.table import Column, Table
from fem.analysis.buckling import SIGNS, solve_buckling
from fem.analysis.modes import Modes
from fem.system import assemble

EXAMPLE = "dovetail buckling study.toml --case dead --number 4 --picture out/buckling"
RESULTS = Results(motions="the shapes", pictures=("each shape", "buckling-01.png"))


def add_arguments(p: argparse.ArgumentParser) -> None:
    """Add the options of the command to its parser."""
    p.add_argument(
        "--case",
        metavar="NAME",
        help="the load case or combination that grows (needed where the study has several)",
    )
    add_number(p, "number of factors", 1000, 5)
    p.add_argument(
        "--sign",
        choices=SIGNS,
        default="positive",
        help="factors of the load as it is, of its opposite, or both (default positive)",
    )


def run(options: Options, progress: Progress) -> Answer:
    """Return load factors; draw and write shapes."""
    study = loaded(options, ())
    progress("solving for load factors")
    solution = solved_case(study, options.case)
    system = assemble(study.model, reciprocal=False)
    found = solve_buckling(system, solution, options.number, sign=options.sign)
    if options.vtu is not None:
        names = [f"shape {k + 1}: factor {f:.6g}" for k, f in enumerate(found.factors)]
        write_motions(options.vtu, study, dict(zip(names, found.shapes.T, strict=True)))
    if options.picture is not None:
        from viz.render import render_mode

        shapes = Modes(found.factors, found.shapes)
        with result_folder(options.picture, options.force) as scratch:
            for k, factor in enumerate(found.factors):
                progress("drawing", k, found.factors.size)
                title = f"Buckling shape {k + 1}: load factor {factor:.4g}, {solution.cases[0]}"
                render_mode(study.model, shapes, k, scratch / f"buckling-{k + 1:02d}.png", title=title)
    table = Table.of(
        "shapes",
        Column("shape", range(1, found.factors.size + 1)),
        Column("load factor", found.factors, show=".6g"),
        Column("moves most", found.moving_members),
    )
    return Answer(
        study,
        [
            f"{study.name}, {solution.cases[0]}: {study.model.mesh.n_lines} elements",
            table if found.factors.size else "the load makes no part buckle",
            *notes_of_mesh(study),
            *assumptions(study),
        ],
        {"case": solution.cases[0], "factors": found.factors, "moves_most": table.columns[-1].values},
    )
