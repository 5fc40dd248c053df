"""Commands that select: NSEL, ESEL, NSLE, ESLN, CMSEL, ALLSEL, DOFSEL, SELTOL, and components."""

import re
from collections.abc import Callable

import numpy as np

from fem.array_types import Floats
from fem.io.ansys_content import LABELS, ON_AXIS, AnsysElement
from fem.io.ansys_script import Command
from fem.io.ansys_state import ELEM, NODE, AnsysState


def _whole(state: AnsysState, kind: str, how: str) -> bool:
    """Carry out the types of a selection that need no items; return whether it was one."""
    if how == "ALL":
        state.hidden[kind] = set()
    elif how == "NONE":
        state.hidden[kind] = set(state.table(kind))
    elif how == "INVE":
        state.hidden[kind] = set(state.table(kind)) - state.hidden[kind]
    elif how != "STAT":
        return False
    return True


def _of_range(state: AnsysState, c: Command, kind: str, values: dict[int, int]) -> list[int]:
    """Return the numbers whose values are from VMIN to VMAX, in steps of VINC."""
    if not c.raw(3):
        c.refuse("has no VMIN; give the first number of a range")
    first = c.integer(3)
    last, step = c.integer(4, first), max(abs(c.integer(5)), 1)
    if c.integer(6):  # KABS
        values = {n: abs(v) for n, v in values.items()}
    return [n for n, v in values.items() if first <= v <= last and not (v - first) % step]


def _of_place(state: AnsysState, c: Command, numbers: list[int], places: Floats) -> list[int]:
    """Return the numbers whose coordinate in the active system is from VMIN to VMAX."""
    axis = c.text(2)
    if axis not in ("X", "Y", "Z"):
        c.refuse(f"has the coordinate '{axis[:20]}', which is none of X, Y, Z")
    low = c.real(3)
    high = c.real(4) if c.raw(4) else low
    within = state.tolerance
    if within is None:
        within = 1e-8 * abs(high - low) if high != low else 0.005 * abs(low) or 1e-6
    value = state.active(c).of_global(places)[:, "XYZ".index(axis)]
    value = np.abs(value) if c.integer(6) else value  # KABS
    inside = (value >= low - within) & (value <= high + within)
    return [numbers[k] for k in np.flatnonzero(inside)]


def _named(state: AnsysState, c: Command, kind: str) -> list[int] | None:
    """Return what a component, or FITEM, in the place of VMIN has."""
    text = c.text(3)
    return state.chosen(c, kind, 3) if text == "P51X" or state.component(text) is not None else None


def nsel(state: AnsysState, c: Command) -> None:
    """Select nodes by number, component or place."""
    how, item = c.text(0) or "S", c.text(1) or "NODE"
    if _whole(state, NODE, how):
        return
    found = _named(state, c, NODE)
    if found is None and item == "NODE":
        found = _of_range(state, c, NODE, {n: n for n in state.deck.nodes})
    elif found is None and item == "LOC":
        numbers = list(state.deck.nodes)
        found = _of_place(state, c, numbers, state.points(numbers))
    elif found is None:
        c.refuse(f"by '{item[:20]}' is not read; NODE and LOC are")
    state.select(NODE, how, found, c)


_ATTRIBUTES: dict[str, Callable[[AnsysState, AnsysElement], int]] = {
    "ELEM": lambda state, e: e.number,
    "TYPE": lambda state, e: e.type,
    "MAT": lambda state, e: e.mat,
    "REAL": lambda state, e: e.real,
    "SEC": lambda state, e: e.section,
    "SECN": lambda state, e: e.section,
    "ENAM": lambda state, e: state.deck.name_number(e),
}


def esel(state: AnsysState, c: Command) -> None:
    """Select elements by number, component, attribute, name of their type or place of their centre."""
    how, item = c.text(0) or "S", c.text(1)[:4] or "ELEM"
    if _whole(state, ELEM, how):
        return
    elements = state.deck.elements
    found = _named(state, c, ELEM)
    if found is None and item in _ATTRIBUTES:
        if item == "ENAM":  # BEAM188 or 188
            c.fields[3:4] = [re.sub(r"^[A-Za-z]+(?=\d)", "", c.raw(3))]
        found = _of_range(state, c, ELEM, {n: _ATTRIBUTES[item](state, e) for n, e in elements.items()})
    elif found is None and item == "CENT":
        numbers = list(elements)
        found = _of_place(state, c, numbers, state.centres(numbers))
    elif found is None and item == "LIVE":
        found = list(elements)
    elif found is None:
        c.refuse(f"by '{c.text(1)[:20]}' is not read; ELEM, TYPE, ENAME, MAT, REAL, SEC, CENT and LIVE are")
    state.select(ELEM, how, found, c)


def nsle(state: AnsysState, c: Command) -> None:
    """Select the nodes of the selected elements."""
    which = c.text(1)[:4] or "ALL"
    if which not in ("ALL", "ACTI", "INAC"):
        c.refuse(f"of '{c.text(1)[:20]}' nodes is not read; ALL, ACTIVE and INACTIVE are")
    found: set[int] = set()
    for number in state.selected(ELEM):
        e = state.deck.elements[number]
        on_axis = ON_AXIS.get(state.deck.name_number(e), len(e.nodes))  # others orient the section
        found.update({"ALL": e.nodes, "ACTI": e.nodes[:on_axis], "INAC": e.nodes[on_axis:]}[which])
    state.select(NODE, c.text(0) or "S", found & set(state.deck.nodes), c)


def esln(state: AnsysState, c: Command) -> None:
    """Select the elements with a selected node, or with all nodes selected."""
    which = c.text(2)[:4] or "ALL"
    if which not in ("ALL", "ACTI"):
        c.refuse(f"of '{c.text(2)[:20]}' nodes is not read; ALL and ACTIVE are")
    nodes, test, found = set(state.selected(NODE)), all if c.integer(1) else any, []
    for number, e in state.deck.elements.items():
        on_axis = ON_AXIS.get(state.deck.name_number(e), len(e.nodes)) if which == "ACTI" else len(e.nodes)
        if e.nodes and test(n in nodes for n in e.nodes[:on_axis]):
            found.append(number)
    state.select(ELEM, c.text(0) or "S", found, c)


def allsel(state: AnsysState, c: Command) -> None:
    """Select everything, or the nodes below the selected elements."""
    how, entity = c.text(0) or "ALL", c.text(1)[:4] or "ALL"
    if how == "ALL":
        for kind in (NODE, ELEM):
            if entity in ("ALL", kind):
                state.hidden[kind] = set()
    elif how in ("BELO", "BELOW"):
        if entity in ("ALL", "ELEM"):
            found = {n for e in state.selected(ELEM) for n in state.deck.elements[e].nodes}
            state.select(NODE, "S", found & set(state.deck.nodes), c)
    else:
        c.refuse(f"has the type '{how[:20]}', which is neither ALL nor BELOW")


def cmsel(state: AnsysState, c: Command) -> None:
    """Select the nodes or elements of a component."""
    how = c.text(0) or "S"
    names = list(state.deck.components) if how in ("ALL", "NONE") else []
    if not names and how not in ("ALL", "NONE"):
        name = state.component(c.text(1))
        if name is None:
            c.refuse(f"selects the component '{c.text(1)[:40]}', which is not defined")
        names = [name]
    kinds = {NODE: list[int](), ELEM: list[int]()}
    touched = set[str]()
    for name in names:
        for kind, items in kinds.items():
            if state.deck.components[name][0] == kind:
                items += state.items(name, kind)
                touched.add(kind)
    for kind in touched:
        state.select(kind, {"ALL": "A", "NONE": "U"}.get(how, how), kinds[kind], c)


def cm(state: AnsysState, c: Command) -> None:
    """Name what is selected."""
    kind = c.text(1)[:4]
    state.add_component(c.raw(0), kind, state.selected(kind) if kind in (NODE, ELEM) else [])


def cmdele(state: AnsysState, c: Command) -> None:
    """Delete a component."""
    state.deck.components.pop(state.component(c.text(0)) or "", None)


def dofsel(state: AnsysState, c: Command) -> None:
    """Select the degrees of freedom that the label ALL stands for."""
    how, every = c.text(0) or "S", set(LABELS.values())
    groups = {"U": {0, 1, 2}, "ROT": {3, 4, 5}, "DISP": every, **{name: {k} for name, k in LABELS.items()}}
    wanted: set[int] = set().union(*(groups.get(c.text(k), set()) for k in range(1, 7)))
    if how in ("S", "A", "U", "R", "ALL"):
        now = state.labels
        state.labels = {"S": wanted, "A": now | wanted, "U": now - wanted, "R": now & wanted, "ALL": every}[
            how
        ]


def seltol(state: AnsysState, c: Command) -> None:
    """Set the tolerance of selections by place, or return to the rule."""
    state.tolerance = c.real(0) if c.raw(0) else None


def flst(state: AnsysState, c: Command) -> None:
    """Begin a list of picked items."""
    state.picked = []


def fitem(state: AnsysState, c: Command) -> None:
    """Add picked items: a negative number ends a range."""
    for value in c.integers(1):
        if value < 0:
            first = state.picked[-1] + 1 if state.picked else 1
            state.budget.take(
                max(0, -value - first), f"{state.deck.file}: line {c.line}", "the range of FITEM"
            )
            state.picked += range(first, -value + 1)
        elif value:
            state.picked.append(value)
