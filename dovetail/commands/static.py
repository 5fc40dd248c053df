"""``dovetail static``: displacements, reactions and section forces under the study's loads."""

import argparse
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from dovetail.commands.answer import Answer
from dovetail.commands.argument_types import integer_up_to
from dovetail.commands.common import Options, assumptions, first_largest, loaded, notes_of_mesh
from dovetail.commands.load_cases import add_cases, file_name, place_of_point, solved, table_of_reactions
from dovetail.commands.results import Results, write_motions
from dovetail.commands.static_cases import STRESSES, factor_fields, factor_words
from dovetail.disk.output import Progress, result_folder
from dovetail.report.table import Column, Table
from dovetail.study import Study
from fem.analysis.combinations import envelope
from fem.analysis.one_sided import one_sided
from fem.analysis.section_forces import SECTION_FORCES
from fem.analysis.static_cases import StaticCases
from fem.analysis.stations import LargestDisplacement, SectionStresses
from fem.lengths import length_text
from fem.model import DIRECTIONS

EXAMPLE = "dovetail static study.toml --case dead --case wind --picture out/static --vtu out/static.vtu"

RESULTS = Results(
    motions="displacements and section forces",
    pictures=(
        "the deflection and the diagrams of section forces and stresses of each case",
        "01-load-deflection.png",
    ),
)

Fields = dict[str, Any]
Stresses = dict[str, SectionStresses]
"""Stresses of members with an outline."""


def add_arguments(p: argparse.ArgumentParser) -> None:
    """Add the options of the command to its parser."""
    add_cases(p)
    p.add_argument(
        "--second-order",
        action="store_true",
        help="in equilibrium on the displaced structure (P-Delta), each case and combination by itself; "
        "loads at or beyond buckling are refused",
    )
    p.add_argument(
        "--pieces",
        type=integer_up_to(1000),
        default=20,
        metavar="N",
        help="equal pieces of each member, at whose ends --json gives section forces (default 20)",
    )


def run(options: Options, progress: Progress) -> Answer:
    """Return static responses; draw and write them."""
    study = loaded(options, ())
    progress("solving for the load cases")
    if options.second_order:
        solution = StaticCases.of_second_order(study.second_order(*dict.fromkeys(options.case)))
    elif one_sided(study.model):
        solution = StaticCases.of_one_sided(study.one_sided(*dict.fromkeys(options.case)))
    else:
        solution = StaticCases((solved(study, options),))
    envelopes = {
        name: columns
        for name, of in study.loads.envelopes.items()
        if (columns := [solution.case(c) for c in of if c in solution.cases]) and len(columns) == len(of)
    }
    if options.vtu is not None:
        _write_fields(options.vtu, study, solution)
    if options.picture is not None:
        _draw(options, solution, progress)
    members = {m: solution.stations(m, options.pieces) for m in study.model.mesh.members}
    stresses = {m: s for m in members if (s := solution.stresses(m, options.pieces)) is not None}
    on_lines = solution.beyond_rounding(solution.forces_on_lines(4))
    largest = [_largest_fields(study, found) for found in solution.largest_displacements()]
    each = {
        name: _envelope_fields(study, solution, on_lines, stresses, columns)
        for name, columns in envelopes.items()
    }
    return Answer(
        study,
        [
            f"{study.name}: {study.model.mesh.n_lines} elements, {len(solution.cases)} load case(s)",
            *(
                part
                for k in range(len(solution.cases))
                for part in _case(study, solution, on_lines, stresses, largest[k], k)
            ),
            *(part for name, fields in each.items() for part in _envelope(name, fields)),
            *notes_of_mesh(study),
            *assumptions(study),
        ],
        {
            "section_forces": SECTION_FORCES,
            **factor_fields(solution),
            "cases": {
                name: _case_fields(study, solution, members, stresses, largest[k], k)
                for k, name in enumerate(solution.cases)
            },
            "envelopes": each,
        },
        sheets=[_along_members(solution, members)],
    )


def _case_fields(
    study: Study, solution: StaticCases, members: Fields, stresses: Stresses, largest: Fields, k: int
) -> Fields:
    """Return a load case's responses for JSON."""
    reactions: dict[str, dict[str, float]] = {}
    for (name, direction), value in solution.support_forces.items():
        reactions.setdefault(name, {})[direction] = value[k]
    u = solution.displacements[:, k]
    return {
        "points": {
            name: dict(zip(DIRECTIONS, u[6 * p : 6 * p + 6], strict=True))
            for name, p in study.model.mesh.point_names.items()
        },
        "largest_displacement": largest,
        "reactions": reactions,
        "members": {
            name: {
                "position_m": s.positions,
                **{q: s.forces[:, i, k] for i, q in enumerate(SECTION_FORCES)},
                **{f"u_{d}": s.displacements[:, i, k] for i, d in enumerate(DIRECTIONS)},
                **_stress_fields(stresses, name, k),
            }
            for name, s in members.items()
        },
        "residual": solution.residual[k],
        "rounding": dict(zip(("force_N", "moment_Nm"), solution.rounding[:, k].tolist(), strict=True)),
    }


def _stress_fields(stresses: Stresses, member: str, k: int) -> Fields:
    """Return the stresses of a member in a load case: those that are known, and why others are not."""
    if member not in stresses:
        return {"stress_missing": "the outline of the section is not given"}
    found = stresses[member]
    missing = {"stress_missing": found.missing} if found.missing else {}
    return {f"stress_{name}": values[:, k] for name, values in found.by_name.items()} | missing


def _largest_fields(study: Study, found: LargestDisplacement) -> Fields:
    """Return the largest displacement of a load case and where it is."""
    mesh = study.model.mesh
    if found.point is not None:
        return {"m": found.size, "place": place_of_point(study, found.point), "at": mesh.points[found.point]}
    assert found.member is not None
    at = mesh.point_at(mesh.locate(found.member, found.position))
    return {"m": found.size, "place": f"{found.member} at {length_text(found.position)}", "at": at}


def _along_members(solution: StaticCases, members: Fields) -> Table:
    """Return section forces and displacements along members in all load cases, for files."""
    rows = [(m, x) for _ in solution.cases for m, s in members.items() for x in s.positions]
    units = [unit for unit in ("N", "N·m", "m", "rad") for _ in range(3)]
    parts = [
        np.hstack([s.forces[:, :, k], s.displacements[:, :, k]])
        for k in range(len(solution.cases))
        for s in members.values()
    ]
    values = zip((*SECTION_FORCES, *DIRECTIONS), np.vstack(parts).T, units, strict=True)
    return Table.of(
        "along members",
        Column("load case", np.repeat(solution.cases, len(rows) // len(solution.cases))),
        Column("member", [m for m, _ in rows]),
        Column("position", [x for _, x in rows], "m"),
        *(Column(name, column, unit) for name, column, unit in values),
    )


def _case(
    study: Study, solution: StaticCases, on_lines: np.ndarray, stresses: Stresses, largest: Fields, k: int
) -> list[str | Table]:
    """Return what is printed of a load case."""
    rows: dict[str, dict[str, float]] = {}
    for (name, direction), value in solution.forces_beyond_rounding().items():
        rows.setdefault(name, {})[direction] = float(value[k])
    reactions = table_of_reactions(rows, "reaction", "  ")
    case = solution.cases[k]
    out: list[str | Table] = [
        "",
        f"{case}: largest displacement {1e3 * largest['m']:.4g} mm, {largest['place']}"
        f"{factor_words(solution, case)}",
        replace(reactions, title=f"reactions, {case}"),
    ]
    member = study.model.mesh.member_of_line()
    each = np.moveaxis(on_lines[..., k], -1, 0)
    for q, values in zip(SECTION_FORCES, each, strict=True):
        low, high = (np.unravel_index(first_largest(v), v.shape)[0] for v in (-values, values))
        if values.any():
            out.append(
                f"  {q:2} from {values.min():12.5g} in {member[low]} to {values.max():12.5g} "
                f"in {member[high]}"
            )
    out += _stress_lines(study, stresses, k)
    return out


def _stress_lines(study: Study, stresses: Stresses, k: int) -> list[str]:
    """Return what is printed of the stresses in a load case."""
    if not stresses:
        return []
    known = list(stresses)
    low = known[first_largest([-s.low[:, k].min() for s in stresses.values()])]
    high = known[first_largest([s.high[:, k].max() for s in stresses.values()])]
    out = [
        f"  normal stress from {1e-6 * stresses[low].low[:, k].min():.5g} MPa in {low} to "
        f"{1e-6 * stresses[high].high[:, k].max():.5g} MPa in {high}{_without_stress(study, stresses)}"
    ]
    for name in ("shear", "von_mises"):
        largest = {m: float(s.by_name[name][:, k].max()) for m, s in stresses.items() if name in s.by_name}
        if largest:
            member = list(largest)[first_largest([*largest.values()])]
            out.append(f"  {STRESSES[name]} {1e-6 * largest[member]:.5g} MPa in {member}")
    bare = [m for m, s in stresses.items() if s.missing]
    if bare:
        out.append(
            f"  shear and von Mises stress not known in {', '.join(bare)}: {stresses[bare[0]].missing}"
        )
    return out


def _without_stress(study: Study, stresses: Stresses) -> str:
    """Return the words on members whose sections are given by their constants, if there are some."""
    bare = [m for m in study.model.mesh.members if m not in stresses]
    return f"; not known in {', '.join(bare)}, whose outlines are not given" if bare else ""


def _envelope_fields(
    study: Study, solution: StaticCases, on_lines: np.ndarray, stresses: Stresses, columns: list[int]
) -> Fields:
    """Return an envelope for JSON: least and largest values, and the load cases that give them."""
    names = [solution.cases[c] for c in columns]

    def fields(values: np.ndarray) -> Fields:
        flat = values.reshape(-1, values.shape[-1])
        each = envelope(flat)
        low, high = int(each.low.argmin()), int(each.high.argmax())
        return {
            "low": each.low[low],
            "low_case": names[each.low_case[low]],
            "high": each.high[high],
            "high_case": names[each.high_case[high]],
        }

    reactions: dict[str, Fields] = {}
    for (name, direction), value in solution.support_forces.items():
        reactions.setdefault(name, {})[direction] = fields(value[columns])
    return {
        "of": names,
        "reactions": reactions,
        "members": {
            member: {q: fields(on_lines[rows][:, :, i][..., columns]) for i, q in enumerate(SECTION_FORCES)}
            | (_envelope_of_stresses(stresses[member], columns, fields) if member in stresses else {})
            for member, rows in study.model.mesh.members.items()
        },
    }


def _envelope_of_stresses(
    found: SectionStresses, columns: list[int], fields: Callable[[np.ndarray], Fields]
) -> Fields:
    """Return the envelopes of a member's normal, shear and von Mises stresses."""
    normal = np.stack([found.low, found.high])
    each = {"stress": normal} | {f"stress_{name}": found.by_name.get(name) for name in ("shear", "von_mises")}
    return {name: fields(values[..., columns]) for name, values in each.items() if values is not None}


def _envelope(name: str, found: Fields) -> list[str | Table]:
    """Return what is printed of an envelope: ranges of section forces and stresses of each member."""
    members = found["members"]
    forces = [
        Column(f"{q} {end}", [of_member[q][end] for of_member in members.values()], show=".4g")
        for q in SECTION_FORCES
        for end in ("low", "high")
    ]
    table = Table(f"envelope {name}", [Column("", list(members)), *forces], "  ")
    ranges = [
        f"{member} {1e-6 * of_member['stress']['low']:.4g} to {1e-6 * of_member['stress']['high']:.4g}"
        for member, of_member in members.items()
        if "stress" in of_member
    ]
    rows = [f"  normal stress [MPa]: {', '.join(ranges)}"] if ranges else []
    for key, words in (("stress_shear", STRESSES["shear"]), ("stress_von_mises", STRESSES["von_mises"])):
        most = [f"{m} {1e-6 * each[key]['high']:.4g}" for m, each in members.items() if key in each]
        rows += [f"  {words} [MPa]: {', '.join(most)}"] if most else []
    return ["", f"envelope {name} of {', '.join(found['of'])} [N, N·m]", table, *rows]


def _write_fields(path: Path, study: Study, solution: StaticCases) -> None:
    """Write displacements, section forces in the middle of each element, and its extreme stresses."""
    middle = solution.forces_on_lines(2)[:, 1]
    lines = {q: middle[:, i] for i, q in enumerate(SECTION_FORCES)}
    on_lines = solution.stresses_on_lines(4)
    lines |= {f"stress_{name}": v for name, v in on_lines.items() if not np.isnan(v).all()}
    motions = dict(zip(solution.cases, solution.displacements.T, strict=True))
    write_motions(path, study, motions, lines=lines)


def _draw(options: Options, solution: StaticCases, progress: Progress) -> None:
    """Draw deflections, and the diagrams of section forces and stresses that are there."""
    from viz.diagrams import (
        drawn_quantities,
        drawn_stresses,
        render_deflection,
        render_diagram,
        render_stress,
    )

    with result_folder(options.picture, options.force) as scratch:
        for k, name in enumerate(solution.cases):
            progress("drawing", k, len(solution.cases))
            part, column = solution.column(k)
            render_deflection(part, scratch / file_name(k + 1, name, "deflection"), column)
            for quantity in drawn_quantities(part, column):
                render_diagram(part, quantity, scratch / file_name(k + 1, name, quantity), column)
            for stress in drawn_stresses(part, column):
                what = f"{stress.replace('_', '-')}-stress"
                render_stress(part, stress, scratch / file_name(k + 1, name, what), column)
