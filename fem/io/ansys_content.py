"""The content of ANSYS commands after the last of them: tables of nodes, elements, sections and supports."""

from dataclasses import dataclass, field

from fem.mesh import MeshError

LABELS = {"UX": 0, "UY": 1, "UZ": 2, "ROTX": 3, "ROTY": 4, "ROTZ": 5}
ON_AXIS = {1: 2, 3: 2, 4: 2, 8: 2, 10: 2, 16: 2, 44: 2, 180: 2, 188: 2, 189: 3, 288: 2, 289: 3}
"""Nodes on the axis of beams, pipes and links, by the number in the name of the element type."""


@dataclass(frozen=True, slots=True)
class AnsysElement:
    """An element: numbers of its type, material, real constants and section, its nodes, its line."""

    number: int
    type: int
    mat: int
    real: int
    section: int
    nodes: tuple[int, ...]
    line: int


@dataclass(slots=True)
class SectionCommand:
    """A section: its type, subtype, data (one row for each SECDATA), offset and controls, its line."""

    kind: str
    subtype: str
    name: str
    line: int
    data: list[list[float]] = field(default_factory=list)
    offset: list[str] = field(default_factory=list)
    control: list[float] = field(default_factory=list)


@dataclass(slots=True)
class AnsysEquation:
    """A constraint equation (CE): coefficients by node and label index, constant, line."""

    line: int
    constant: float = 0.0
    terms: dict[tuple[int, int], float] = field(default_factory=dict)


@dataclass(slots=True)
class CoupledSet:
    """A coupled set (CP): label index, nodes in their order, line."""

    line: int
    label: int
    nodes: list[int] = field(default_factory=list)


@dataclass(slots=True)
class AnsysDeck:
    """The model that commands make, with values in its units.

    Attributes
    ----------
    file : str
    nodes : number to x, y, z and the angles THXY, THYZ, THZX [deg]
    elements : by number, in their order
    types : number of an element type to the number in its name (188 of BEAM188), and its line
    keyopts : (type, number) to value
    reals, materials, sections : tables by number
    components : name to kind (NODE, ELEM or another) and numbers
    supports : (node, label index) to value and line; the value of a table is NaN
    equations, coupled : by reference number
    damping : values of ALPHAD, BETAD, DMPRAT and DMPSTR
    ignored : lines of commands that are not applied and may matter, by name
    """

    file: str
    nodes: dict[int, list[float]] = field(default_factory=dict)
    elements: dict[int, AnsysElement] = field(default_factory=dict)
    types: dict[int, tuple[int, int]] = field(default_factory=dict)
    keyopts: dict[tuple[int, int], int] = field(default_factory=dict)
    reals: dict[int, dict[int, float]] = field(default_factory=dict)
    materials: dict[int, dict[str, float]] = field(default_factory=dict)
    sections: dict[int, SectionCommand] = field(default_factory=dict)
    components: dict[str, tuple[str, list[int]]] = field(default_factory=dict)
    supports: dict[tuple[int, int], tuple[float, int]] = field(default_factory=dict)
    equations: dict[int, AnsysEquation] = field(default_factory=dict)
    coupled: dict[int, CoupledSet] = field(default_factory=dict)
    damping: dict[str, float] = field(default_factory=dict)
    units: tuple[str, int] | None = None
    ignored: dict[str, list[int]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    def error(self, line: int, text: str) -> MeshError:
        """Return an error that names the file and the line."""
        return MeshError(f"{self.file}: line {line}: {text}")

    def keyopt(self, number: int, k: int) -> int:
        """Return an option of an element type, 0 unless given."""
        return self.keyopts.get((number, k), 0)

    def kind(self, element: AnsysElement) -> int:
        """Return the number in the name of an element's type, 188 of BEAM188.

        Raises
        ------
        MeshError
            For a type that no ET defines.
        """
        if element.type not in self.types:
            text = f"element {element.number} has the type {element.type}, which no ET defines"
            raise self.error(element.line, text)
        return self.types[element.type][0]

    def check_nodes(self, element: AnsysElement) -> None:
        """Refuse an element whose nodes the deck does not have."""
        missing = next((n for n in element.nodes if n not in self.nodes), None)
        if missing is not None:
            text = f"element {element.number} refers to node {missing}, which is not defined"
            raise self.error(element.line, text)

    def name_number(self, element: AnsysElement) -> int:
        """Return the number in the name of an element's type: 188 of BEAM188; 0 without an ET."""
        return self.types.get(element.type, (0, 0))[0]
