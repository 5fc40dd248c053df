"""The state that ANSYS commands change: the model, the selection, current attributes, coordinate systems."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from fem.array_types import Floats
from fem.io.ansys_content import LABELS, AnsysDeck, AnsysElement, SectionCommand
from fem.io.ansys_parameters import Parameters
from fem.io.ansys_script import Command, Script
from fem.io.ansys_systems import GLOBAL, AnsysSystem
from fem.io.deck import DeckBudget, words

NODE, ELEM = "NODE", "ELEM"


@dataclass(slots=True)
class AnsysState:
    """A model while commands make it.

    Attributes
    ----------
    deck : AnsysDeck
    script : Script
    hidden : numbers of nodes and of elements that are not selected
    attributes : current TYPE, MAT, REAL and SECNUM
    system : number of the active coordinate system
    systems : the coordinate systems by number
    labels : degrees of freedom that ALL stands for (DOFSEL)
    tolerance : of selections by value, None for the rule of ANSYS (SELTOL)
    picked : items of FITEM
    processor : PREP7, SOLU, BEGIN or another one
    section : the last SECTYPE
    last_real : number of the last set of real constants, and of its next constant
    pending : attributes of EN,…,ATTR, or the coupled set of CP,…,DEFI
    last_element : highest number of an element
    """

    deck: AnsysDeck
    script: Script
    hidden: dict[str, set[int]] = field(default_factory=lambda: {NODE: set(), ELEM: set()})
    attributes: dict[str, int] = field(default_factory=lambda: {"TYPE": 1, "MAT": 1, "REAL": 1, "SECNUM": 1})
    system: int = 0
    systems: dict[int, AnsysSystem] = field(default_factory=lambda: dict(GLOBAL))
    labels: set[int] = field(default_factory=lambda: set(LABELS.values()))
    tolerance: float | None = None
    picked: list[int] = field(default_factory=list)
    processor: str = "PREP7"
    section: SectionCommand | None = None
    last_real: tuple[int, int] = (0, 1)
    pending: list[int] = field(default_factory=list)
    last_element: int = 0
    budget: DeckBudget = field(default_factory=DeckBudget)

    @classmethod
    def of(cls, file: str, text: str) -> "AnsysState":
        """Return the state before the first command of a file."""
        deck, parameters = AnsysDeck(file), Parameters()
        state = cls(deck, Script.of(deck, parameters, text))
        for k, name in enumerate(("NX", "NY", "NZ")):
            parameters.functions[name] = lambda n, k=k: state.coordinate(n, k)
        parameters.functions["NODE"] = lambda x, y, z: state._nearest(x, y, z)
        return state

    # What a field names ------------------------------------------------------------------------------------

    def table(self, kind: str) -> Mapping[int, object]:
        """Return all nodes or elements by number."""
        return self.deck.nodes if kind == NODE else self.deck.elements

    def selected(self, kind: str) -> list[int]:
        """Return the numbers of selected nodes or elements, in the order of the model."""
        hidden = self.hidden[kind]
        return [n for n in self.table(kind) if n not in hidden]

    def chosen(self, c: Command, kind: str, k: int, end: int | None = None) -> list[int]:
        """Return the nodes or elements that a field names.

        ALL is what is selected; a component and the items of FITEM are themselves. With fields for the end
        and the step of a range, this has the selected ones of the range; one number is taken as it is.
        """
        text = c.text(k)
        if text == "ALL":
            return self.selected(kind)
        if text == "P51X":
            return list(self.picked)
        name = self.component(text)
        if name is not None:
            return self.items(name, kind)
        first = c.integer(k)
        if first < 1:
            c.refuse(
                f"names no {'node' if kind == NODE else 'element'} in field {k + 1}, but {text or 'nothing'}"
            )
        last = c.integer(end) if end is not None else 0
        if end is None or last <= first:
            return [first]
        step = max(abs(c.integer(end + 1)), 1)
        return [n for n in self.selected(kind) if first <= n <= last and not (n - first) % step]

    def component(self, name: str) -> str | None:
        """Return the name of a component as it was defined; capitals do not matter."""
        return next((n for n in self.deck.components if n.upper() == name), None) if name else None

    def items(self, name: str, kind: str) -> list[int]:
        """Return the nodes or elements of a component that exist; an assembly has those of its components."""
        its_kind, numbers = self.deck.components[name]
        return [n for n in numbers if n in self.table(kind)] if its_kind == kind else []

    def directions(self, c: Command, labels: Iterable[int]) -> list[int]:
        """Return the degrees of freedom that fields name; those of other physics are noted."""
        out: list[int] = []
        for k in labels:
            text = c.text(k)
            if text == "ALL":
                out += sorted(self.labels)
            elif text in LABELS:
                out.append(LABELS[text])
            elif text in _OTHER_LABELS:
                self.ignore(f"{c.name.upper()} of {text}", c.line)
            elif text:
                c.refuse(f"has the label '{text[:20]}', which is none of {', '.join(LABELS)} and ALL")
        return out

    # Changes -----------------------------------------------------------------------------------------------

    def ignore(self, name: str, line: int) -> None:
        """Count a command that is not applied."""
        self.deck.ignored.setdefault(name, []).append(line)

    def select(self, kind: str, how: str, found: Iterable[int], c: Command) -> None:
        """Select (S), reselect (R), add (A) or unselect (U) nodes or elements."""
        every, now, wanted = set(self.table(kind)), set(self.selected(kind)), set(found)
        if how not in _SETS:
            c.refuse(f"has the type '{how[:20]}'; {', '.join(_SETS)}, ALL, NONE and INVE are read")
        self.hidden[kind] = every - _SETS[how](now, wanted)

    def add_node(self, number: int, values: list[float]) -> None:
        """Define a node, or define it anew; it is selected."""
        self.deck.nodes[number] = values[:6]
        self.hidden[NODE].discard(number)

    def add_element(
        self, number: int, attributes: tuple[int, int, int, int], nodes: Sequence[int], line: int
    ) -> None:
        """Define an element by its type, material, real constants and section; it is selected."""
        self.deck.elements[number] = AnsysElement(number, *attributes, tuple(n for n in nodes if n), line)
        self.hidden[ELEM].discard(number)
        self.last_element = max(self.last_element, number)

    def add_type(self, number: int, kind: int, options: Sequence[int], line: int) -> None:
        """Define an element type anew, with its options."""
        self.deck.types[number] = (kind, line)
        others = {key: value for key, value in self.deck.keyopts.items() if key[0] != number}
        self.deck.keyopts = others | {(number, k): value for k, value in enumerate(options, start=1)}

    def add_component(self, name: str, kind: str, items: list[int]) -> None:
        """Define a component, or define it anew."""
        self.deck.components.pop(self.component(name.upper()) or "", None)
        self.deck.components[name] = (kind, items)

    # Places ------------------------------------------------------------------------------------------------

    def active(self, c: Command) -> AnsysSystem:
        """Return the active coordinate system."""
        if self.system not in self.systems:
            known = ", ".join(map(str, self.systems))
            c.refuse(f"is in the coordinate system {self.system}, which is not defined; {known} are")
        return self.systems[self.system]

    def points(self, numbers: Sequence[int]) -> Floats:
        """Return the global places of nodes, shape (n, 3)."""
        return np.array([self.deck.nodes[n][:3] for n in numbers], dtype=float).reshape(-1, 3)

    def centres(self, numbers: Sequence[int]) -> Floats:
        """Return the mean places of the nodes of elements, shape (n, 3)."""
        nodes = [[n for n in self.deck.elements[e].nodes if n in self.deck.nodes] for e in numbers]
        return np.array([self.points(n).mean(axis=0) if n else [np.nan] * 3 for n in nodes]).reshape(-1, 3)

    def node(self, c: Command, number: int) -> list[float]:
        """Return the place and the angles of a node, which must exist."""
        if number not in self.deck.nodes:
            c.refuse(f"refers to node {number}, which is not defined")
        return self.deck.nodes[number]

    def coordinate(self, number: float, k: int) -> float:
        """Return a coordinate of a node in the active system."""
        if number not in self.deck.nodes:
            msg = f"node {number:g} is not defined"
            raise ValueError(msg)
        system = self.systems.get(self.system, AnsysSystem())
        return float(system.of_global(self.points([int(number)]))[0, k])

    def _nearest(self, *local: float) -> float:
        numbers = self.selected(NODE)
        if not numbers:
            msg = "no node is selected"
            raise ValueError(msg)
        point = self.systems.get(self.system, AnsysSystem()).to_global(np.array([local]))
        return float(numbers[int(np.argmin(np.linalg.norm(self.points(numbers) - point, axis=1)))])


_SETS = {
    "S": lambda now, wanted: wanted,
    "R": lambda now, wanted: now & wanted,
    "A": lambda now, wanted: now | wanted,
    "U": lambda now, wanted: now - wanted,
}
_OTHER_LABELS = words(
    """TEMP TBOT TTOP VOLT MAG AZ PRES CONC WARP HDSP EMF CURR VELX VELY VELZ OMGX OMGY OMGZ ACCX ACCY
    ACCZ"""
)
