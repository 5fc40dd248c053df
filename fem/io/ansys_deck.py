"""ANSYS archive files (``.cdb``, of CDWRITE and of other programs): the commands, as tables of their content.

Blocked and unblocked archives are read. An archive has numbers only; a script that generates a model
(``FILL``, ``EGEN``, ``*DO``, ``LMESH``) is refused: without such a command the model would be another one.
"""

import re
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from fem.io.deck import Files, integer, named, real, words
from fem.mesh import MeshError

REFUSED = {
    **dict.fromkeys(
        words(
            """FILL NGEN NSYM EGEN ESYM EMORE EMODIF NMODIF ENGEN NKPT LMESH AMESH VMESH *DO *REPEAT *USE"""
        ),
        "generates or changes parts of the model; solve or save it in ANSYS, and write it with CDWRITE,DB",
    ),
    **dict.fromkeys(
        words("DSYM DK DL DA CERIG RBE3 CEINTF CPINTF CPLGEN CPSGEN"),
        "becomes supports or equations of nodes only in ANSYS; write the file with CDWRITE,DB after that",
    ),
    "CDREAD": "reads another file; write all into one",
    "/INPUT": "reads another file; write all into one",
}
NAMED = {
    "MDAMP": "the damping ratios of single modes are left out",
    "INISTATE": "the initial stress is left out, and its stiffness with it",
    "ISTRESS": "the initial stress is left out, and its stiffness with it",
    "PSTRES": "stress stiffening is left out: the model vibrates about the unloaded state",
    "OMEGA": "rotation is left out: no gyroscopic or spin softening effects",
    "CORIOLIS": "gyroscopic effects are left out",
    "LUMPM": "masses are consistent here",
    "M": "master degrees of freedom are left out: all of them are solved",
}
_BLOCKS = ("NBLOCK", "EBLOCK", "RLBLOCK", "ETBLOCK", "CMBLOCK")
_SHORT = {
    "SECT": "SECTYPE",
    "SECD": "SECDATA",
    "SECO": "SECOFFSET",
    "SECC": "SECCONTROL",
    "SECN": "SECNUM",
    "KEYO": "KEYOPT",
    "MPDA": "MPDATA",
    "RMOD": "RMODIF",
    "RMOR": "RMORE",
    "ALPH": "ALPHAD",
    "BETA": "BETAD",
    "INIS": "INISTATE",
    "ISTR": "ISTRESS",
    "PSTR": "PSTRES",
    "CORI": "CORIOLIS",
}
LABELS = {"UX": 0, "UY": 1, "UZ": 2, "ROTX": 3, "ROTY": 4, "ROTZ": 5}


@dataclass(frozen=True, slots=True)
class Element:
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
class AnsysDeck:
    """The content of an archive, with values in its units.

    Attributes
    ----------
    file : str
    nodes : number to x, y, z and the angles THXY, THYZ, THZX [deg]
    elements : in their order
    types : number of an element type to the number in its name (188 of BEAM188), and its line
    keyopts : (type, number) to value
    reals, materials, sections, components : tables by number or name
    supports : (node, label index, value, line)
    equations : name, terms (node, label index, coefficient), constant, line
    damping : values of ALPHAD, BETAD, DMPRAT and DMPSTR
    ignored : counts of commands that were not read
    """

    file: str
    nodes: dict[int, list[float]] = field(default_factory=dict)
    elements: list[Element] = field(default_factory=list)
    types: dict[int, tuple[int, int]] = field(default_factory=dict)
    keyopts: dict[tuple[int, int], int] = field(default_factory=dict)
    reals: dict[int, dict[int, float]] = field(default_factory=dict)
    materials: dict[int, dict[str, float]] = field(default_factory=dict)
    sections: dict[int, SectionCommand] = field(default_factory=dict)
    components: dict[str, tuple[str, list[int]]] = field(default_factory=dict)
    supports: list[tuple[int, int, float, int]] = field(default_factory=list)
    equations: list[tuple[str, list[tuple[int, int, float]], float, int]] = field(default_factory=list)
    damping: dict[str, float] = field(default_factory=dict)
    units: tuple[str, int] | None = None
    ignored: Counter[str] = field(default_factory=Counter)
    notes: list[str] = field(default_factory=list)

    def error(self, line: int, text: str) -> MeshError:
        """Return an error that names the file and the line."""
        return MeshError(f"{self.file}: line {line}: {text}")

    def keyopt(self, number: int, k: int) -> int:
        """Return an option of an element type, 0 unless given."""
        return self.keyopts.get((number, k), 0)


def read_deck(path: Path) -> AnsysDeck:
    """Return the content of an archive.

    Raises
    ------
    MeshError
        With file, line and command if a command cannot be read, a block is cut, or a command generates parts
        of the model.
    """
    text = Files(path).first().text
    reader = _Reader(AnsysDeck(path.name), text.splitlines())
    reader.read()
    return reader.deck


def _widths(text: str) -> tuple[list[int], int]:
    """Return the columns' widths of a Fortran format such as (3i9,6e21.13e3), and how many are integers."""
    widths, n_integers = [], 0
    for count, kind, width in re.findall(r"(\d*)\s*([aeigdf])\s*(\d+)(?:\.\d+)?(?:e\d+)?", text.lower()):
        n = int(count or 1)
        widths += [int(width)] * n
        n_integers += n if kind in "ia" else 0
    return widths, n_integers


@dataclass(slots=True)
class _Reader:
    deck: AnsysDeck
    lines: list[str]
    at: int = 0
    name: str = ""
    current: dict[str, int] = field(default_factory=lambda: {"TYPE": 1, "MAT": 1, "REAL": 1, "SECNUM": 1})
    section: SectionCommand | None = None
    last_real: list[int] = field(default_factory=lambda: [0, 1])
    label: int = 0
    csys: int = 0
    pending: list[int] = field(default_factory=list)
    row_of: dict[int, int] = field(default_factory=dict)
    commands: dict[str, Callable[[list[str]], None]] = field(init=False)

    def __post_init__(self) -> None:
        self.commands = {
            "N": self._node,
            "EN": self._element,
            "E": self._element,
            "ET": self._et,
            "KEYOPT": self._keyopt,
            "R": self._r,
            "RMORE": self._rmore,
            "RMODIF": self._rmodif,
            "MP": self._mp,
            "MPDATA": self._mpdata,
            "SECTYPE": self._sectype,
            "D": self._d,
            "DDELE": self._ddele,
            "EDELE": self._edele,
            "CEDELE": self._cedele,
            "CE": self._ce,
            "CP": self._cp,
            **dict.fromkeys(("SECDATA", "SECOFFSET", "SECCONTROL"), self._of_section),
            "NBLOCK": self._nblock,
            "EBLOCK": self._eblock,
            "RLBLOCK": self._rlblock,
            "ETBLOCK": self._etblock,
            "CMBLOCK": self._cmblock,
        }

    def read(self) -> None:
        """Read all commands."""
        while self.at < len(self.lines):
            line = self.lines[self.at].split("!")[0].strip()
            self.at += 1
            if not line or line[0] in "(+-.0123456789":  # rows of blocks that are not read
                continue
            for text in line.split("$") if not line.startswith("/") else (line,):
                self._command(text.strip())

    def _command(self, text: str) -> None:
        name, *fields = (f.strip() for f in text.split(","))
        name = name.upper()
        name = _SHORT.get(name[:4], name) if name not in _BLOCKS else name
        self.name = name
        if name in REFUSED:
            raise self.deck.error(self.at, f"{name} {REFUSED[name]}")
        if name in self.current:
            self.current[name] = self._int(fields, 0) or 1
        elif name in ("ALPHAD", "BETAD", "DMPRAT", "DMPSTR"):
            self.deck.damping[name] = self._real(fields, 0)
        elif name == "/UNITS":
            self.deck.units = (fields[0].upper() if fields else "", self.at)
        elif name == "CSYS":
            self.csys = self._int(fields, 0)
        elif name in self.commands:
            try:
                self.commands[name](fields)
            except IndexError as reason:
                raise self.deck.error(self.at, f"{name} has too few fields: {text[:60]}") from reason
        elif not (name in ("OMEGA", "LUMPM", "PSTRES", "CORIOLIS") and not _is_on(fields)):
            self.deck.ignored[name] += 1

    # Numbers -----------------------------------------------------------------------------------------------

    def _int(self, fields: list[str], k: int) -> int:
        return int(self._number(fields, k, lambda text: integer(text or "0")))

    def _real(self, fields: list[str], k: int) -> float:
        return self._number(fields, k, real)

    def _number(self, fields: list[str], k: int, convert: Callable[[str], float]) -> float:
        try:
            return convert(fields[k] if k < len(fields) else "")
        except ValueError as reason:
            raise self.deck.error(self.at, f"{self.name}, field {k + 1}: {reason}") from reason

    def _ints(self, fields: list[str], start: int = 0) -> list[int]:
        return [self._int(fields, k) for k in range(start, len(fields))]

    def _reals(self, fields: list[str]) -> list[float]:
        return [self._real(fields, k) for k in range(len(fields))]

    # Blocks ------------------------------------------------------------------------------------------------

    def _rows(self, count: int | None = None, stated: int = 0) -> Iterator[list[str]]:
        """Yield the rows of a block, cut as its format says, to -1 or for ``count`` rows.

        Without -1 a block may end with the file, if it has as many rows as it states.
        """
        header = self.at
        name, (widths, _) = self.name, self._format()
        taken = 0
        while count is None or taken < count:
            if self.at >= len(self.lines):
                if stated and taken == stated:
                    return
                raise self.deck.error(header, f"{name} has no end: the file ends after {taken} of its rows")
            line = self.lines[self.at]
            first = line.strip()[:1]
            if first and first not in "+-.0123456789":
                if count is None and name == "NBLOCK":  # closed by N,R5.3,LOC,-1
                    return
                of = f" of {count}" if count else ""
                text = f"{name} ends after {taken} rows{of} at {line.strip()[:30]!r}"
                raise self.deck.error(self.at + 1, text)
            self.at += 1
            if line.strip() == "-1":
                if count is not None:
                    raise self.deck.error(self.at, f"{name} ends after {taken} rows of {count}")
                return
            starts = np.cumsum([0, *widths])
            cells = [line[a : a + w].strip() for a, w in zip(starts, widths, strict=False)]
            taken += 1
            while cells and not cells[-1]:  # trailing zeros may be blank
                cells.pop()
            if cells:
                yield cells

    def _format(self) -> tuple[list[int], int]:
        line = self.lines[self.at].strip() if self.at < len(self.lines) else ""
        widths, n_integers = _widths(line) if line.startswith("(") else ([], 0)
        if not widths:
            raise self.deck.error(
                self.at + 1, f"{self.name} needs a format such as (19i9), found {line[:30]!r}"
            )
        self.at += 1
        return widths, n_integers

    def _check_count(self, header: int, found: int, fields: list[str], k: int) -> None:
        stated = self._int(fields, k)
        if stated and stated != found:
            raise self.deck.error(header, f"{self.name} states {stated} rows, and has {found}")

    def _nblock(self, fields: list[str]) -> None:
        header, found = self.at, 0
        n_integers = _widths(self.lines[self.at])[1] if self.at < len(self.lines) else 0
        for row in self._rows():
            number = self._int(row, 0)
            values = self._reals(row[n_integers:])
            self.deck.nodes[number] = [*values, *[0.0] * (6 - len(values))]
            found += 1
        self._check_count(header, found, fields, 3)

    def _eblock(self, fields: list[str]) -> None:
        header, found = self.at, 0
        solid = len(fields) > 1 and fields[1].upper() == "SOLID"
        rest, row = 0, []
        for cells in self._rows(stated=self._int(fields, 3)):
            values = self._ints(cells)
            row = [*row, *values] if rest else values
            n = row[8] if solid and len(row) > 10 else len(row) - 5
            rest = 11 + n - len(row) if solid else 0
            if rest > 0:
                continue
            found += 1
            rest = 0
            if solid:
                self._add(row[10], row[1], row[0], row[2], row[3], row[11 : 11 + n])
            else:
                self._add(row[0], self.current["TYPE"], row[3], row[2], row[1], row[5:])
        if rest > 0:
            raise self.deck.error(self.at, f"EBLOCK ends within an element: {rest} of its nodes are missing")
        self._check_count(header, found, fields, 3)

    def _add(self, number: int, kind: int, mat: int, constants: int, section: int, nodes: list[int]) -> None:
        ends = tuple(n for n in nodes if n)
        element = Element(number, kind, mat, constants, section, ends, self.at)
        at = self.row_of.get(number)
        if at is None:
            self.row_of[number] = len(self.deck.elements)
            self.deck.elements.append(element)
        else:  # as ANSYS: a second definition takes the place of the first
            self.deck.elements[at] = element

    def _rlblock(self, fields: list[str]) -> None:
        sets = self._int(fields, 0)
        first, more = self._format()[0], self._format()[0]
        for _ in range(sets):
            row = self._cells(first)
            number, count = self._int(row, 0), self._int(row, 1)
            values = row[2:]
            while len(values) < count:
                values += self._cells(more)
            reals = [self._real(values, k) for k in range(count)]
            self.deck.reals[number] = dict(enumerate(reals, start=1))

    def _cells(self, widths: list[int]) -> list[str]:
        line = self.lines[self.at] if self.at < len(self.lines) else "end of file"
        if line.strip()[:1] not in tuple("+-.0123456789"):
            raise self.deck.error(
                self.at + 1, f"{self.name} is cut: found {line.strip()[:30]!r} within a set"
            )
        self.at += 1
        starts = np.cumsum([0, *widths])
        return [line[a : a + w].strip() for a, w in zip(starts, widths, strict=False)]

    def _etblock(self, fields: list[str]) -> None:
        for row in self._rows():
            self._type(self._ints(row))

    def _type(self, row: list[int]) -> None:
        """Keep an element type: its number, the one of its name, and its options."""
        number, kind, *options = row
        self.deck.types[number] = (kind, self.at)
        self.deck.keyopts |= {(number, k): value for k, value in enumerate(options, start=1)}

    def _cmblock(self, fields: list[str]) -> None:
        name, kind, count = (
            fields[0],
            fields[1][:4].upper() if len(fields) > 1 else "",
            self._int(fields, 2),
        )
        widths = _widths(self.lines[self.at])[0] if self.at < len(self.lines) else []
        items: list[int] = []
        for row in self._rows(-(-count // max(len(widths), 1))):
            for k in range(len(row)):
                value = self._int(row, k)
                items += [value] if value >= 0 else range(items[-1] + 1 if items else 1, -value + 1)
        self.deck.components[name] = (kind, items)

    # Nodes and elements ------------------------------------------------------------------------------------

    def _node(self, fields: list[str]) -> None:
        if fields and fields[0].upper() in ("R5.3", "UNBL", "R5.1", "R5.0"):
            number = self._int(fields, 2)
            if number > 0:
                where = fields[1].upper()
                row = self.deck.nodes.setdefault(number, [0.0] * 6)
                values = self._reals(fields[5:8] if where == "LOC" else fields[3:6])
                start = 0 if where == "LOC" else 3
                row[start : start + len(values)] = values
            return
        if self.csys:
            raise self.deck.error(self.at, f"N in coordinate system {self.csys} is not read; use CSYS,0")
        values = self._reals(fields[1:7])
        self.deck.nodes[self._int(fields, 0)] = [*values, *[0.0] * (6 - len(values))]

    def _element(self, fields: list[str]) -> None:
        now = self.current
        if not (fields and fields[0].upper().startswith(("R5.", "UNBL"))):
            nodes = self._ints(fields)
            if self._named_number:
                number, nodes = nodes[0], nodes[1:]
            else:
                number = 1 + max(self.row_of, default=0)
            self._add(number, now["TYPE"], now["MAT"], now["REAL"], now["SECNUM"], nodes)
        elif fields[1].upper() == "ATTR":
            self.pending = self._ints(fields, 2)
        else:
            if len(self.pending) < 7:
                raise self.deck.error(self.at, "EN,…,NODE without the attributes of EN,…,ATTR before it")
            _, mat, kind, constants, section, _, number = self.pending[:7]
            nodes = self._ints(fields, 2)
            self._add(number, kind, mat, constants, section, nodes)

    @property
    def _named_number(self) -> bool:
        return self.lines[self.at - 1].strip().upper().startswith("EN")

    def _et(self, fields: list[str]) -> None:
        name = re.sub(r"^[A-Za-z]+", "", fields[1]) if len(fields) > 1 else ""
        self._type(self._ints([fields[0], name, *fields[2:]]))

    def _keyopt(self, fields: list[str]) -> None:
        kind, k, value = (self._int(fields, i) for i in range(3))
        self.deck.keyopts[kind, k] = value

    # Real constants, materials, sections -------------------------------------------------------------------

    def _r(self, fields: list[str]) -> None:
        if fields and fields[0].upper().startswith("R5"):  # R,R5.0,set,LOC,first,values
            self._rmodif([fields[1], *fields[3:]])
            return
        number = self._int(fields, 0)
        self.deck.reals[number] = dict(enumerate(self._reals(fields[1:7]), start=1))
        self.last_real = [number, 7]

    def _rmore(self, fields: list[str]) -> None:
        number, start = self.last_real
        values = self._reals(fields[:6])
        self.deck.reals.setdefault(number, {}).update(enumerate(values, start=start))
        self.last_real = [number, start + 6]

    def _rmodif(self, fields: list[str]) -> None:
        number, start = self._int(fields, 0), self._int(fields, 1)
        self.deck.reals.setdefault(number, {}).update(enumerate(self._reals(fields[2:]), start=start))

    def _mp(self, fields: list[str]) -> None:
        label, number = fields[0].upper(), self._int(fields, 1) or self.current["MAT"]
        self.deck.materials.setdefault(number, {})[label] = self._real(fields, 2)
        if any(self._reals(fields[3:])):
            self.deck.notes.append(
                f"line {self.at}: MP,{label} depends on temperature: its value at 0° is taken"
            )

    def _mpdata(self, fields: list[str]) -> None:
        if fields and fields[0].upper().startswith(("R5", "UNBL")):
            fields = fields[2:]
        label, number = fields[0].upper(), self._int(fields, 1) or self.current["MAT"]
        table = self.deck.materials.setdefault(number, {})
        if self._int(fields, 2) > 1 or any(self._reals(fields[4:])):
            self.deck.notes.append(
                f"line {self.at}: MPDATA,{label} depends on temperature: its first value is taken"
            )
        if self._int(fields, 2) > 1:  # further temperatures
            table.setdefault(label, self._real(fields, 3))
        else:
            table[label] = self._real(fields, 3)

    def _sectype(self, fields: list[str]) -> None:
        number = self._int(fields, 0) or 1 + max(self.deck.sections, default=0)
        kind, subtype, name = ([f.upper() for f in fields[1:3]] + fields[3:4] + [""] * 3)[:3]
        self.section = SectionCommand(kind, subtype, name, self.at)
        self.deck.sections[number] = self.section

    def _of_section(self, fields: list[str]) -> None:
        if self.section is None:
            raise self.deck.error(self.at, f"{self.name} without a SECTYPE before it")
        if self.name == "SECOFFSET":
            self._reals(fields[1:])
            self.section.offset = fields
        elif self.name == "SECDATA":
            self.section.data.append(self._reals(fields))
        else:
            self.section.control = self._reals(fields)

    # Supports and equations --------------------------------------------------------------------------------

    def _d(self, fields: list[str]) -> None:
        first = fields[0].upper() if fields else ""
        last, step = self._int(fields, 4), self._int(fields, 5) or 1
        if first == "ALL":
            nodes = list(self.deck.nodes)
        else:
            start = self._int(fields, 0)
            nodes = list(range(start, max(last, start) + 1, step))
        value = self._real(fields, 2)
        for label in (f.upper() for f in [*fields[1:2], *fields[6:11]] if f):
            dofs = range(6) if label == "ALL" else [LABELS[label]] if label in LABELS else []
            self.deck.supports += [(n, k, value, self.at) for n in nodes for k in dofs]

    def _range(self, fields: list[str], k: int) -> range:
        """Return the numbers of three fields: first, last and step."""
        first, last, step = (self._int(fields, k + i) for i in range(3))
        return range(first, max(first, last) + 1, step or 1)

    def _ddele(self, fields: list[str]) -> None:
        label = fields[1].upper()
        every = fields[0].upper() == "ALL"
        nodes = self.deck.nodes.keys() if every else set(self._range([fields[0], *fields[2:]], 0))
        self.deck.supports = [
            row
            for row in self.deck.supports
            if not (row[0] in nodes and (label == "ALL" or LABELS.get(label) == row[1]))
        ]

    def _edele(self, fields: list[str]) -> None:
        gone = set(self.row_of) if fields[0].upper() == "ALL" else set(self._range(fields, 0))
        self.deck.elements = [e for e in self.deck.elements if e.number not in gone]
        self.row_of = {e.number: k for k, e in enumerate(self.deck.elements)}

    def _cedele(self, fields: list[str]) -> None:
        every = fields[0].upper() == "ALL"
        names = set[str]() if every else {f"CE {n}" for n in self._range(fields, 0)}
        self.deck.equations = [
            row
            for row in self.deck.equations
            if row[0] not in names and not (every and row[0].startswith("CE "))
        ]

    def _terms(self, fields: list[str]) -> list[tuple[int, int, float]]:
        out = []
        for k in range(0, len(fields) - 2, 3):
            label = fields[k + 1].upper()
            if not fields[k]:
                continue
            if label not in LABELS:
                raise self.deck.error(
                    self.at, f"{self.name}: the label {label!r} is none of {', '.join(LABELS)}"
                )
            out.append((self._int(fields, k), LABELS[label], self._real(fields, k + 2)))
        return out

    def _ce(self, fields: list[str]) -> None:
        if fields and fields[0].upper().startswith("R5"):
            if fields[1].upper() == "DEFI":
                self.deck.equations.append((f"CE {fields[3]}", [], self._real(fields, 4), self.at))
            elif self.deck.equations:
                self.deck.equations[-1][1].extend(self._terms(fields[2:]))
            return
        number = fields[0]
        if number.upper() == "HIGH" and self.deck.equations:
            self.deck.equations[-1][1].extend(self._terms(fields[2:]))
        else:
            row = (f"CE {number}", self._terms(fields[2:]), self._real(fields, 1), self.at)
            self.deck.equations.append(row)

    def _cp(self, fields: list[str]) -> None:
        blocked = bool(fields) and fields[0].upper().startswith("R5")
        labels = [f.upper() for f in fields if f.upper() in LABELS]
        if labels:
            self.label = LABELS[labels[0]]
            self.pending = []
        elif not blocked:
            raise self.deck.error(
                self.at, f"CP needs one of {', '.join(LABELS)}, found {','.join(fields[:3])}"
            )
        if blocked and fields[1].upper() == "DEFI":
            return
        nodes = [n for k in range(2, len(fields)) if (n := self._int(fields, k))]
        self.pending += nodes
        first = self.pending[0] if self.pending else 0
        for node in nodes[1:] if self.pending == nodes else nodes:
            terms = [(first, self.label, 1.0), (node, self.label, -1.0)]
            self.deck.equations.append((f"CP {first} {node}", terms, 0.0, self.at))


def _is_on(fields: list[str]) -> bool:
    return any(f.upper() not in ("", "0", "OFF") and f.strip("0.+-E ") for f in fields[:3])


def ignored_notes(deck: AnsysDeck) -> list[str]:
    """Return sentences on the commands that were left out and matter."""
    named_ones = [f"{n} {name}: {NAMED[name]}" for name, n in deck.ignored.items() if name in NAMED]
    loads = [n for n in ("F", "SFE", "SFBEAM", "ACEL", "BF", "BFE", "SFEBEAM") if deck.ignored[n]]
    return named_ones + ([f"loads are left out: {named(loads)}"] if loads else [])
