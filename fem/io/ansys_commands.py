"""ANSYS commands that make or change a model: nodes, elements, tables, supports and equations."""

import re
from contextlib import suppress
from dataclasses import replace

import numpy as np

from fem.io.ansys_content import LABELS, AnsysEquation, CoupledSet, SectionCommand
from fem.io.ansys_script import Command
from fem.io.ansys_state import ELEM, NODE, AnsysState
from fem.io.ansys_systems import GLOBAL, AnsysSystem, angles_of, rotation


def _unblocked(c: Command) -> bool:
    # Beginning of the first field of a command in an archive of CDWRITE,…,UNBLOCKED
    return c.text(0).startswith(("R5", "UNBL"))


# Coordinate systems -----------------------------------------------------------------------------------------


def csys(state: AnsysState, c: Command) -> None:
    """Activate a coordinate system; CSYS,4 is the working plane, which is not followed."""
    if c.text(0) in ("4", "WP"):
        c.refuse("activates the working plane, which is not read; define the system by LOCAL")
    state.system = c.integer(0)
    state.active(c)


def _define(state: AnsysState, c: Command, system: AnsysSystem) -> None:
    number = c.integer(0)
    if number < 11:
        c.refuse(f"defines the coordinate system {number}; numbers from 11 on are for these")
    state.systems[number] = system
    state.system = number


def _kind(c: Command, ratios: int) -> int:
    kind = {"CART": 0, "CYLI": 1, "SPHE": 2}.get(c.text(1)[:4])
    kind = c.integer(1) if kind is None else kind
    if kind not in (0, 1, 2) or any(c.raw(k) and c.real(k) != 1 for k in (ratios, ratios + 1)):
        c.refuse(f"of type {kind} is not read; 0, 1 and 2, with ratios of 1, are")
    return kind


def local(state: AnsysState, c: Command) -> None:
    """Define and activate a coordinate system by its global origin and angles."""
    axes = rotation(c.real(5), c.real(6), c.real(7))
    _define(state, c, AnsysSystem(_kind(c, 8), axes, np.array(c.reals(2, 5))))


def clocal(state: AnsysState, c: Command) -> None:
    """Define and activate a coordinate system by its origin and angles in the active one."""
    base = state.active(c)
    origin = base.to_global(np.array([c.reals(2, 5)]))[0]
    axes = rotation(c.real(5), c.real(6), c.real(7)) @ base.axes
    _define(state, c, AnsysSystem(_kind(c, 8), axes, origin))


def cs(state: AnsysState, c: Command) -> None:
    """Define and activate a coordinate system by three nodes: origin, on x, and in the x-y plane."""
    origin, on_x, in_plane = (np.array(state.node(c, c.integer(k))[:3]) for k in (2, 3, 4))
    x, toward = on_x - origin, in_plane - origin
    z = np.cross(x, toward)
    if np.linalg.norm(z) <= 1e-9 * np.linalg.norm(x) * np.linalg.norm(toward):
        c.refuse("has three nodes on one line")
    axes = np.array([x, np.cross(z, x), z])
    _define(state, c, AnsysSystem(_kind(c, 5), axes / np.linalg.norm(axes, axis=1, keepdims=True), origin))


def csdele(state: AnsysState, c: Command) -> None:
    """Delete coordinate systems."""
    for number in _numbers(c, 0, state.systems):
        if number not in GLOBAL:
            del state.systems[number]


# Nodes ------------------------------------------------------------------------------------------------------


def node(state: AnsysState, c: Command) -> None:
    """Define a node in the active coordinate system."""
    if _unblocked(c):
        number, where = c.integer(2), c.text(1)
        if number > 0:  # -1 closes NBLOCK
            row = state.deck.nodes.setdefault(number, [0.0] * 6)
            values = (c.reals(5) if where == "LOC" else c.reals(3))[:3]
            start = 0 if where == "LOC" else 3
            row[start : start + len(values)] = values
        return
    if c.text(1) == "P":
        c.refuse("is picked on the screen; write its coordinates")
    number = c.integer(0) or 1 + max(state.deck.nodes, default=0)
    place = c.reals(1, 4)
    if state.system:
        place = state.active(c).to_global(np.array([place]))[0].tolist()
    state.add_node(number, [*place, *_angles(state, c, 4)])


def _angles(state: AnsysState, c: Command, start: int) -> list[float]:
    angles = c.reals(start, start + 3)
    if any(angles) and state.system:
        c.refuse("turns a node while a local coordinate system is active; use CSYS,0 or NROTAT")
    return angles


def nmodif(state: AnsysState, c: Command) -> None:
    """Change coordinates of nodes in the active coordinate system, and their angles; blanks retain them."""
    system = state.active(c)
    for number in state.chosen(c, NODE, 0):
        row = state.node(c, number)
        at = system.of_global(np.array([row[:3]]))[0]
        at[:] = [c.real(k + 1) if c.raw(k + 1) else at[k] for k in range(3)]
        moved = system.to_global(at[None])[0].tolist() if any(c.raw(k) for k in (1, 2, 3)) else row[:3]
        given = _angles(state, c, 4)
        angles = [given[k] if c.raw(k + 4) else row[k + 3] for k in range(3)]
        state.deck.nodes[number] = [*moved, *angles]


def nrotat(state: AnsysState, c: Command) -> None:
    """Turn the axes of nodes into the active coordinate system."""
    system = state.active(c)
    for number in state.chosen(c, NODE, 0, 1):
        row = state.node(c, number)
        row[3:] = angles_of(system.axes_at(np.array(row[:3])))


def nscale(state: AnsysState, c: Command) -> None:
    """Scale places of nodes in the active coordinate system, or those of copies with higher numbers."""
    system, more = state.active(c), c.integer(0)
    ratios = np.array([c.real(k) or 1.0 for k in (4, 5, 6)])
    numbers = state.chosen(c, NODE, 1, 2)
    rows = [state.node(c, n) for n in numbers]
    points = system.to_global(system.of_global(state.points(numbers)) * ratios)
    for number, row, point in zip(numbers, rows, points, strict=True):
        state.add_node(number + more, [*point.tolist(), *row[3:]])


def ndele(state: AnsysState, c: Command) -> None:
    """Delete selected nodes of no element, with their supports and equations."""
    used = {n for e in state.deck.elements.values() for n in e.nodes}
    hidden, deck = state.hidden[NODE], state.deck
    gone = {n for n in state.chosen(c, NODE, 0, 1) if n in deck.nodes and n not in used and n not in hidden}
    if not gone:
        return
    deck.nodes = {n: row for n, row in deck.nodes.items() if n not in gone}
    deck.supports = {key: value for key, value in deck.supports.items() if key[0] not in gone}
    deck.equations = {k: e for k, e in deck.equations.items() if not gone & {n for n, _ in e.terms}}
    deck.coupled = {k: s for k, s in deck.coupled.items() if not gone & set(s.nodes)}


# Elements ---------------------------------------------------------------------------------------------------


def attribute(state: AnsysState, c: Command) -> None:
    """Set the current type, material, real constants or section."""
    name = {"SECN": "SECNUM"}.get(c.key, c.key)
    state.attributes[name] = c.integer(0) or 1


def _current(state: AnsysState) -> tuple[int, int, int, int]:
    now = state.attributes
    return now["TYPE"], now["MAT"], now["REAL"], now["SECNUM"]


def element(state: AnsysState, c: Command) -> None:
    """Define an element between nodes (E), with its number (EN)."""
    if not _unblocked(c):
        nodes = c.integers(1 if c.key == "EN" else 0)
        number = (c.integer(0) if c.key == "EN" else 0) or state.last_element + 1
        state.add_element(number, _current(state), nodes, c.line)
    elif c.text(1) == "ATTR":
        state.pending = c.integers(2)
    else:
        if len(state.pending) < 7:
            c.refuse("with NODE has no EN,…,ATTR with the attributes before it")
        _, mat, kind, constants, section, _, number = state.pending[:7]
        state.add_element(number, (kind, mat, constants, section), c.integers(2), c.line)


def edele(state: AnsysState, c: Command) -> None:
    """Delete selected elements."""
    hidden, elements = state.hidden[ELEM], state.deck.elements
    for number in state.chosen(c, ELEM, 0, 1):
        if number in elements and number not in hidden:
            del elements[number]
    state.last_element = max(elements, default=0)


def mpchg(state: AnsysState, c: Command) -> None:
    """Change the material of elements."""
    _change(state, c, state.chosen(c, ELEM, 1), mat=c.integer(0))


def emodif(state: AnsysState, c: Command) -> None:
    """Change attributes or nodes of elements."""
    numbers, place = state.chosen(c, ELEM, 0), c.text(1)
    name = {"TYPE": "type", "MAT": "mat", "REAL": "real", "SECN": "section", "SEC": "section"}.get(place[:4])
    if place == "ESYS":
        return
    if name is not None:
        _change(state, c, numbers, **{name: c.integer(2) or 1})
        return
    start = c.integer(1)
    kind, mat, constants, section = _current(state)
    attributes = {"type": kind, "mat": mat, "real": constants, "section": section} if start >= 0 else {}
    _change(state, c, numbers, **attributes)
    for number in numbers if start and c.raw(2) else ():
        nodes = [*state.deck.elements[number].nodes]
        for k in range(2, len(c.fields)):
            at = abs(start) - 1 + k - 2
            if c.raw(k) and at > len(nodes):
                c.refuse(f"changes node {at + 1} of element {number}, which has {len(nodes)}")
            nodes[at : at + 1] = [c.integer(k)] if c.raw(k) else nodes[at : at + 1]
        _change(state, c, [number], nodes=tuple(nodes))


def _change(state: AnsysState, c: Command, numbers: list[int], **values: object) -> None:
    for number in numbers:
        if number not in state.deck.elements:
            c.refuse(f"refers to element {number}, which is not defined")
        state.deck.elements[number] = replace(state.deck.elements[number], **values)


# Types, real constants, materials, sections -----------------------------------------------------------------


def et(state: AnsysState, c: Command) -> None:
    """Define an element type by its name or the number in it, and its options."""
    name = c.text(1).lstrip("ABCDEFGHIJKLMNOPQRSTUVWXYZ")
    kind = c.integer(1) if name == c.text(1) else _plain(c, name)
    state.add_type(c.integer(0), kind, c.integers(2), c.line)


def _plain(c: Command, digits: str) -> int:
    if not re.fullmatch(r"[0-9]{1,4}", digits):
        c.refuse(f"has the element type '{c.raw(1)[:20]}'; its name or number, such as BEAM188, is needed")
    return int(digits)


def keyopt(state: AnsysState, c: Command) -> None:
    """Set an option of an element type."""
    state.deck.keyopts[c.integer(0), c.integer(1)] = c.integer(2)


def r(state: AnsysState, c: Command) -> None:
    """Define a set of real constants."""
    if _unblocked(c):  # R,R5.0,set,LOC,first,values
        number, start, values = c.integer(1), c.integer(3), c.reals(4)
        state.deck.reals.setdefault(number, {}).update(enumerate(values, start=start))
        return
    number = c.integer(0)
    state.deck.reals[number] = dict(enumerate(c.reals(1, min(7, len(c.fields))), start=1))
    state.last_real = (number, 7)


def rmore(state: AnsysState, c: Command) -> None:
    """Add six constants to the last set."""
    number, start = state.last_real
    state.deck.reals.setdefault(number, {}).update(enumerate(c.reals(0)[:6], start=start))
    state.last_real = (number, start + 6)


def rmodif(state: AnsysState, c: Command) -> None:
    """Change constants of a set."""
    number, start = c.integer(0), c.integer(1)
    state.deck.reals.setdefault(number, {}).update(enumerate(c.reals(2), start=start))


def mp(state: AnsysState, c: Command) -> None:
    """Set a property of a material: its value at 0°."""
    label, number = c.text(0), c.integer(1) or state.attributes["MAT"]
    state.deck.materials.setdefault(number, {})[label] = c.real(2)
    if any(c.reals(3)):
        state.deck.notes.append(f"line {c.line}: MP,{label} depends on temperature: its value at 0° is taken")


def mpdata(state: AnsysState, c: Command) -> None:
    """Set a property of a material at temperatures: the first value."""
    at = 2 if _unblocked(c) else 0
    label, number = c.text(at), c.integer(at + 1) or state.attributes["MAT"]
    table = state.deck.materials.setdefault(number, {})
    if c.integer(at + 2) > 1 or any(c.reals(at + 4)):
        state.deck.notes.append(
            f"line {c.line}: MPDATA,{label} depends on temperature: its first value is taken"
        )
    if c.integer(at + 2) <= 1 or label not in table:
        table[label] = c.real(at + 3)


def mpdele(state: AnsysState, c: Command) -> None:
    """Delete a property of materials, or all of them."""
    label = c.text(0)
    for number in _numbers(c, 1, state.deck.materials):
        table = state.deck.materials[number]
        table.clear() if label == "ALL" else table.pop(label, None)


def delete_tables(state: AnsysState, c: Command) -> None:
    """Delete element types, sets of real constants or sections."""
    table: dict = {"ETDE": state.deck.types, "RDEL": state.deck.reals, "SDEL": state.deck.sections}[c.key]
    for number in _numbers(c, 0, table):
        del table[number]


def _numbers(c: Command, k: int, table: dict) -> list[int]:
    """Return the numbers of a table in a range of fields: first, last and step."""
    if c.text(k) == "ALL":
        return list(table)
    first = c.integer(k)
    last, step = c.integer(k + 1) or first, max(abs(c.integer(k + 2)), 1)
    return [n for n in table if first <= n <= last and not (n - first) % step]


def sectype(state: AnsysState, c: Command) -> None:
    """Begin a section."""
    number = c.integer(0) or 1 + max(state.deck.sections, default=0)
    state.section = SectionCommand(c.text(1), c.text(2), c.raw(3), c.line)
    state.deck.sections[number] = state.section


def of_section(state: AnsysState, c: Command) -> None:
    """Keep data, offset or controls of the last section."""
    if state.section is None:
        c.refuse("has no SECTYPE before it")
    if c.key == "SECO":
        state.section.offset = [c.raw(0), *(repr(v) for v in c.reals(1))]
    elif c.key == "SECD":
        state.section.data.append(c.reals(0))
    else:
        state.section.control = c.reals(0)


def damping(state: AnsysState, c: Command) -> None:
    """Keep damping of the structure."""
    name = {"ALPH": "ALPHAD", "BETA": "BETAD", "DMPR": "DMPRAT", "DMPS": "DMPSTR"}[c.key]
    state.deck.damping[name] = c.real(0)


# Supports and equations -------------------------------------------------------------------------------------


def d(state: AnsysState, c: Command) -> None:
    """Fix degrees of freedom of nodes."""
    # a table of values, %name%, moves the node by what is not known here
    value = float("nan") if c.raw(2).startswith("%") else c.real(2)
    directions = state.directions(c, (1, *range(6, 11)))
    if not any(c.raw(k) for k in (1, *range(6, 11))):
        c.refuse(f"has no label; one of {', '.join(LABELS)} and ALL is needed")
    numbers = state.chosen(c, NODE, 0, 4)
    if not numbers:
        state.deck.notes.append(
            f"line {c.line}: D fixes nothing: no node is selected, or its component is empty"
        )
    for number in numbers:
        for k in directions:
            state.deck.supports[number, k] = (value, c.line)


def ddele(state: AnsysState, c: Command) -> None:
    """Release degrees of freedom of nodes."""
    directions = state.directions(c, (1,)) if c.raw(1) else sorted(state.labels)
    for number in state.chosen(c, NODE, 0, 2):
        for k in directions:
            state.deck.supports.pop((number, k), None)


def _reference(c: Command, text: str, table: dict, name: int) -> int:
    """Return the number of an equation or a coupled set: its own, HIGH or NEXT."""
    highest = max(table, default=0)
    if text in ("", "HIGH"):
        return highest or 1
    return highest + 1 if text == "NEXT" else c.integer(name)


def ce(state: AnsysState, c: Command) -> None:
    """Define an equation, or add terms to one."""
    equations = state.deck.equations
    if _unblocked(c) and c.text(1) == "DEFI":
        number = c.integer(3)
        equations[number] = AnsysEquation(c.line, c.real(4))
        state.pending = [number]
        return
    if _unblocked(c):
        number = state.pending[0] if state.pending else max(equations, default=0)
    else:
        number = _reference(c, c.text(0), equations, 0)
    equation = equations.setdefault(number, AnsysEquation(c.line))
    if not _unblocked(c) and c.raw(1):
        equation.constant = c.real(1)
    for k in range(2, len(c.fields) - 1, 3):
        if c.raw(k):
            _term(c, number, equation, k)


def _term(c: Command, number: int, equation: AnsysEquation, k: int) -> None:
    node, label, factor = c.integer(k), c.text(k + 1), c.real(k + 2)
    if label not in LABELS:
        c.refuse(f"equation {number}: the label {label[:20]!r} is none of {', '.join(LABELS)}")
    key = abs(node), LABELS[label]
    if node < 0:
        equation.terms.pop(key, None)
    elif key in equation.terms:
        c.refuse(f"repeats node {node}, {label} in equation {number}; each term stands once")
    elif factor:
        equation.terms[key] = factor


def cp(state: AnsysState, c: Command) -> None:
    """Define coupled sets, or add nodes to one and take them out (-NODE)."""
    coupled = state.deck.coupled
    if _unblocked(c):
        labels = [k for k in range(len(c.fields)) if c.text(k) in LABELS]
        if labels:
            at = labels[0]
            state.pending = [c.integer(at - 1)]
            coupled[state.pending[0]] = CoupledSet(c.line, LABELS[c.text(at)])
            _couple(state, c, state.pending[0], [n for n in c.integers(at + 1) if n], c.text(1) == "DEFI")
        elif state.pending:
            _couple(state, c, state.pending[0], [n for n in c.integers(2) if n])
        return
    label = c.text(1)
    if label == "ALL":
        first = c.integer(0) if c.text(0) not in ("", "HIGH", "NEXT") else 1 + max(coupled, default=0)
        sets = [(first + k, direction) for k, direction in enumerate(LABELS.values())]
    else:
        sets = [(_reference(c, c.text(0), coupled, 0), _label_of_set(state, c, label))]
    for number, direction in sets:
        coupled.setdefault(number, CoupledSet(c.line, direction)).label = direction
        nodes = state.chosen(c, NODE, 2) if _a_name(state, c, 2) else [n for n in c.integers(2) if n]
        _couple(state, c, number, nodes)


def _a_name(state: AnsysState, c: Command, k: int) -> bool:
    """Whether a field names several nodes."""
    return c.text(k) in ("ALL", "P51X") or state.component(c.text(k)) is not None


def _label_of_set(state: AnsysState, c: Command, label: str) -> int:
    known = state.deck.coupled.get(_reference(c, c.text(0), state.deck.coupled, 0))
    if label in LABELS:
        return LABELS[label]
    if label or known is None:
        found = ",".join(c.fields[:3])
        c.refuse(f"needs one of {', '.join(LABELS)} and ALL, found {found[:60]}")
    return known.label


def _couple(
    state: AnsysState, c: Command, number: int, nodes: list[int], count_follows: bool = False
) -> None:
    kept = state.deck.coupled[number].nodes
    for node in () if count_follows else nodes:
        if node < 0 and -node in kept:
            kept.remove(-node)
        elif node > 0 and node not in kept:
            kept.append(node)


def cpngen(state: AnsysState, c: Command) -> None:
    """Add a range of nodes to a coupled set, or take it out (-NODE1)."""
    number = _reference(c, c.text(0), state.deck.coupled, 0)
    direction = _label_of_set(state, c, c.text(1))
    sign = -1 if c.raw(2).startswith("-") else 1
    if sign < 0:
        c.fields[2] = c.raw(2)[1:]
    state.deck.coupled.setdefault(number, CoupledSet(c.line, direction)).label = direction
    _couple(state, c, number, [sign * n for n in state.chosen(c, NODE, 2, 3)])


def cedele(state: AnsysState, c: Command) -> None:
    """Delete equations (CEDELE) or coupled sets (CPDELE) with a selected node, or with all nodes selected."""
    deck = state.deck
    nodes = (
        {k: {n for n, _ in e.terms} for k, e in deck.equations.items()}
        if c.key == "CEDE"
        else {k: set(s.nodes) for k, s in deck.coupled.items()}
    )
    hidden = state.hidden[NODE]
    for number in _numbers(c, 0, nodes):
        free = nodes[number] - hidden
        if not nodes[number] or (free == nodes[number] if c.text(3) == "ALL" else free):
            (deck.equations if c.key == "CEDE" else deck.coupled).pop(number)


def cecmod(state: AnsysState, c: Command) -> None:
    """Change the constant of an equation."""
    if c.integer(0) in state.deck.equations:
        state.deck.equations[c.integer(0)].constant = c.real(1)


# Values of the model ----------------------------------------------------------------------------------------


def get(state: AnsysState, c: Command) -> None:
    """Set a parameter to a value of the model; what ANSYS alone knows cannot be used after that."""
    try:
        value = _value(state, c)
        if value is None:
            state.script.parameters.forget(c.raw(0), f"*GET of {', '.join(c.fields[1:6])}"[:80])
        else:
            state.script.parameters.assign(c.raw(0), repr(float(value)))
    except ValueError as reason:
        c.refuse(str(reason))


def _value(state: AnsysState, c: Command) -> float | None:
    entity, number, item, more = c.text(1)[:4], c.raw(2), c.text(3)[:4], c.text(4)
    if entity == "ACTI":
        now = state.attributes | {"INT": 0, "CSYS": state.system}  # read in batch mode
        return now.get({"SECT": "SECNUM"}.get(item, item))
    if entity not in (NODE, ELEM):
        return None
    numbers = state.selected(entity)
    if item == "COUN":
        return len(numbers)
    if item == "NUM":
        return {"MAX": max, "MIN": min}[more](numbers, default=0) if more in ("MAX", "MIN") else None
    if item == "LOC" and entity == NODE and number and more in ("X", "Y", "Z"):
        return state.coordinate(c.integer(2), "XYZ".index(more))
    return None


def forget(state: AnsysState, c: Command) -> None:
    """Mark a parameter or an array that the user, a file or a command that is not read gives."""
    with suppress(ValueError):  # some commands have other things in this field
        state.script.parameters.forget(c.raw(0).partition("(")[0], f"{c.name.upper()} gives it")


def units(state: AnsysState, c: Command) -> None:
    """Keep the system of units that a deck names."""
    state.deck.units = (c.text(0), c.line)
