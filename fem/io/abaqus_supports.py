"""Supports of Abaqus' and CalculiX' decks: *BOUNDARY of the model data and of steps."""

from collections.abc import Iterable

from fem.io.abaqus_assembly import Instance
from fem.io.abaqus_content import Content, Placed, check, dofs_of, lines_of, numbers_of
from fem.io.abaqus_deck import AbaqusBlock, fault, name_of

TYPES = {
    "ENCASTRE": (0, 1, 2, 3, 4, 5),
    "PINNED": (0, 1, 2),
    "XSYMM": (0, 4, 5),
    "YSYMM": (1, 3, 5),
    "ZSYMM": (2, 3, 4),
    "XASYMM": (1, 2, 3),
    "YASYMM": (0, 2, 4),
    "ZASYMM": (0, 1, 5),
    "NOWARP": (),
    "NOOVAL": (),
    "NODEFORM": (),
}
"""Degrees of freedom that a type of boundary condition fixes, counted from 0."""


def fixed_of(content: Content) -> dict[int, dict[int, AbaqusBlock]]:
    """Return the fixed degrees of freedom, counted from 0, of the rows of nodes, each with its block.

    Read are the model data and the steps up to the first one of a linear dynamic procedure, or else up to the
    first.
    """
    steps = sorted({placed.step for placed in content.placed if placed.step})
    last = min(content.procedures, default=steps[0] if steps else 0)
    if last and any(p.keyword == "BOUNDARY" and p.step for p in content.placed):
        name = f"*{content.procedures[last].name}" if last in content.procedures else "the first step"
        content.notes.append(f"supports are those of the model data and of the steps up to {last} ({name})")
    fixed: dict[int, dict[int, AbaqusBlock]] = {}
    step = 0
    for placed in content.placed:
        if placed.keyword != "BOUNDARY" or placed.step > last:
            continue
        if placed.step != step:
            step = placed.step
            if any(_new(other) for other in content.placed if other.step == step):
                fixed = {}
        _read(content, placed, fixed)
    _note_nonlinear(content, last)
    for placed, instance in content.model_data("RIGIDBODY"):
        _rotate(content, placed, instance, fixed)
    return fixed


def _rotate(
    content: Content, placed: Placed, instance: Instance, fixed: dict[int, dict[int, AbaqusBlock]]
) -> None:
    """Give the reference node the rotations that CalculiX fixes as translations of the ROT NODE."""
    block, where = placed.block, f"{placed.block.place}: *{placed.block.name}"
    if "ROTNODE" in block.options:
        turn, node = (content.node(block.options[k], instance.name, where) for k in ("ROTNODE", "REFNODE"))
        for dof, source in fixed.pop(turn, {}).items():
            if dof < 3:
                fixed.setdefault(node, {})[dof + 3] = source


def _new(placed: Placed) -> bool:
    return placed.keyword == "BOUNDARY" and placed.block.options.get("OP", "MOD").upper() == "NEW"


def _note_nonlinear(content: Content, last: int) -> None:
    for placed in content.placed:
        options = placed.block.options
        nonlinear = "PERTURBATION" in options or options.get("NLGEOM", "NO").upper() != "NO"
        if placed.keyword == "STEP" and placed.step <= last and nonlinear and last > 1:
            content.notes.append(
                f"*STEP at line {placed.block.line}: the geometric stiffness of loads before the natural "
                "frequencies is left out; give members a pretension in the study file"
            )
            return


def _read(content: Content, placed: Placed, fixed: dict[int, dict[int, AbaqusBlock]]) -> None:
    block = placed.block
    check(block, "OP", "TYPE", "AMPLITUDE", "LOADCASE", "FIXED", "BASENAME", "REGIONTYPE")
    for instance in content.assembly.owners_of(placed.part):
        for place, cells in lines_of(block):
            label, *rest = cells
            rows = content.rows("NSET", name_of(label), instance.name, f"{place}: *BOUNDARY")
            for dof in dofs_of_row(content, block, place, rest):
                for row in rows:
                    fixed.setdefault(row, {})[dof] = block


def dofs_of_row(content: Content, block: AbaqusBlock, place: str, cells: list[str]) -> Iterable[int]:
    """Return the degrees of freedom, counted from 0, that a data line fixes; ``cells`` follow the nodes."""
    word = cells[0].upper() if cells else ""
    if word in TYPES:
        return TYPES[word]
    if not word or word[0].isalpha():
        allowed = f"degrees of freedom, or one of {', '.join(TYPES)}"
        raise fault(block, f"has {word[:40] or 'nothing'} after the nodes; allowed are {allowed}", place)
    moves = len(cells) > 2 and numbers_of(block, place, cells[2:3], 1, 1, "a displacement") != [0.0]
    if moves:
        content.notes.append(f"*BOUNDARY at line {block.line} moves nodes; they are taken to be fixed")
    return dofs_of(block, place, cells)
