"""ANSYS commands in the order in which they run: parameters, *IF and *DO are followed.

A command is known by the first four letters of its name, after the star or the slash of one that has these.
"""

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import NoReturn

from fem.io.ansys_content import AnsysDeck
from fem.io.ansys_parameters import Parameters
from fem.io.deck import integer
from fem.mesh import MeshError

MOST_LOOPED = 200_000
"""Lines that loops may read: enough for 20 000 nodes and elements, and a second of work."""

_ASSIGNMENT = re.compile(r"([A-Za-z_]\w*(?:\([^()']*\))?)\s*=(.*)", re.DOTALL)
_DATA = tuple("+-.0123456789(")
_TOLERANCE = 1e-10
"""Of comparisons of *IF, as ANSYS has it."""
_OPERATIONS: dict[str, Callable[[float, float], bool]] = {
    "EQ": lambda a, b: abs(a - b) <= _TOLERANCE,
    "NE": lambda a, b: abs(a - b) > _TOLERANCE,
    "LT": lambda a, b: a < b - _TOLERANCE,
    "GT": lambda a, b: a > b + _TOLERANCE,
    "LE": lambda a, b: a <= b + _TOLERANCE,
    "GE": lambda a, b: a >= b - _TOLERANCE,
    "ABLT": lambda a, b: abs(a) < abs(b),
    "ABGT": lambda a, b: abs(a) > abs(b),
}
_CONJUNCTIONS: dict[str, Callable[[bool, bool], bool]] = {
    "AND": lambda a, b: a and b,
    "OR": lambda a, b: a or b,
    "XOR": lambda a, b: a != b,
}


def key_of(name: str) -> str:
    """Return what identifies a command: four letters, after a star or a slash."""
    name = name.strip().upper()
    return name[: 5 if name[:1] in ("*", "/") else 4]


def _fields(text: str) -> list[str]:
    """Return the name and the fields of a command; commas within brackets and quotes do not separate."""
    if "(" not in text and "'" not in text:
        return [cell.strip() for cell in text.split(",")]
    out, depth, quoted = [""], 0, False
    for letter in text:
        quoted ^= letter == "'"
        depth += 0 if quoted else (letter == "(") - (letter == ")")
        if letter == "," and depth <= 0 and not quoted:
            out.append("")
        else:
            out[-1] += letter
    return [cell.strip() for cell in out]


@dataclass(frozen=True, slots=True)
class Command:
    """A command: its key, its name in the file, its fields and its line."""

    key: str
    name: str
    fields: list[str]
    line: int
    deck: AnsysDeck
    parameters: Parameters

    def refuse(self, reason: str) -> NoReturn:
        """Raise a MeshError that names file, line and command."""
        raise self.deck.error(self.line, f"{self.name.upper()} {reason}")

    def raw(self, k: int) -> str:
        """Return a field as it stands, empty if the command has none."""
        return self.fields[k] if k < len(self.fields) else ""

    def text(self, k: int) -> str:
        """Return a field in capitals, or the text of the parameter that it names."""
        return self.parameters.label(self.raw(k))

    def real(self, k: int) -> float:
        """Return a number or the value of an expression, 0 for an empty field."""
        try:
            return self.parameters.number(self.raw(k))
        except ValueError as reason:
            raise self._unlike(k, reason) from reason

    def integer(self, k: int, default: int = 0) -> int:
        """Return a whole number."""
        text = self.raw(k)
        if not text:
            return default
        try:
            return integer(text)
        except ValueError as reason:
            try:
                value = self.parameters.number(text)
            except ValueError as other:
                plain = str(other).endswith("is not a number")
                raise self._unlike(k, reason if plain else other) from other
            if abs(value) > 1e12 or abs(value - round(value)) > 1e-6:
                raise self._unlike(k, reason) from reason
            return round(value)

    def reals(self, start: int, stop: int | None = None) -> list[float]:
        """Return several numbers."""
        return [self.real(k) for k in range(start, len(self.fields) if stop is None else stop)]

    def integers(self, start: int) -> list[int]:
        """Return the whole numbers of all fields from one on."""
        return [self.integer(k) for k in range(start, len(self.fields))]

    def _unlike(self, k: int, reason: ValueError) -> MeshError:
        return self.deck.error(self.line, f"{self.name.upper()}, field {k + 1}: {reason}")


@dataclass(slots=True)
class _Loop:
    line: int
    start: int
    name: str
    value: float
    last: float
    step: float

    def runs(self) -> bool:
        return (self.last - self.value) * self.step >= -_TOLERANCE * abs(self.step)


@dataclass(slots=True)
class Script:
    """The lines of a file, and which of them comes next.

    Attributes
    ----------
    rows : line number and text; a line with $ has several
    at : index of the next row
    """

    deck: AnsysDeck
    parameters: Parameters
    rows: list[tuple[int, str]]
    at: int = 0
    open: list[_Loop | int] = field(default_factory=list)
    looped: int = 0

    @classmethod
    def of(cls, deck: AnsysDeck, parameters: Parameters, text: str) -> "Script":
        """Return the script of a file's text."""
        rows = []
        for number, line in enumerate(text.splitlines(), start=1):
            several = "$" in line and not line.lstrip().startswith(("/", "C***", "c***"))
            rows += [(number, part) for part in line.split("$")] if several else [(number, line)]
        return cls(deck, parameters, rows)

    @property
    def line(self) -> int:
        """The number of the next line."""
        return self.rows[self.at][0] if self.at < len(self.rows) else self.rows[-1][0] + 1 if self.rows else 1

    def peek(self) -> str | None:
        """Return the next line, None at the end of the file."""
        return self.rows[self.at][1] if self.at < len(self.rows) else None

    def commands(self) -> Iterator[Command]:
        """Yield the commands that run, but for those of the flow."""
        while self.at < len(self.rows):
            number, text = self.rows[self.at]
            self.at += 1
            self._count(number, 1)
            command = self._command(number, text)
            if command is None:
                continue
            flow = _FLOW.get(command.key)
            if flow is None:
                yield command
            else:
                flow(self, command)

    def rest(self) -> Iterator[Command]:
        """Yield the commands that are left, without following the flow."""
        for number, text in self.rows[self.at :]:
            command = self._command(number, text, runs=False)
            if command is not None:
                yield command
        self.at, self.open = len(self.rows), []

    def finish(self) -> None:
        """Refuse a file that ends within *IF or *DO."""
        for construct in self.open[:1]:
            line = construct.line if isinstance(construct, _Loop) else construct
            name, end = ("*DO", "*ENDDO") if isinstance(construct, _Loop) else ("*IF", "*ENDIF")
            raise self.deck.error(line, f"{name} has no {end}")

    def _count(self, line: int, rows: int) -> None:
        """Count the rows that a loop reads."""
        if any(isinstance(o, _Loop) for o in self.open):
            self.looped += rows
        if self.looped > MOST_LOOPED:
            text = f"*DO loops read more than {MOST_LOOPED} lines; write the model with CDWRITE,DB instead"
            raise self.deck.error(line, text)

    def _command(self, number: int, text: str, runs: bool = True) -> Command | None:
        """Return the command of a line, None for comments, data and assignments; these are carried out."""
        text = text.split("!")[0].strip()
        if not text or text.startswith(_DATA) or text[0] == ":" or text[:4].upper() == "C***":
            return None
        text = self.parameters.filled(text) if runs else text
        assigned = _ASSIGNMENT.fullmatch(text)
        if assigned and runs:
            self._assign(number, assigned[1], assigned[2])
        if assigned:
            return None
        name, *fields = _fields(text)
        return Command(key_of(name), name, fields, number, self.deck, self.parameters)

    def _assign(self, line: int, name: str, text: str) -> None:
        try:
            self.parameters.assign(name, text)
        except ValueError as reason:
            raise self.deck.error(line, str(reason)) from reason

    # Flow --------------------------------------------------------------------------------------------------

    def _set(self, c: Command) -> None:
        self._assign(c.line, c.raw(0), c.raw(1))

    def _if(self, c: Command) -> None:
        base = self._base(c)
        holds = self._holds(c)
        if base == "THEN":
            self.open.append(c.line)
            if not holds:
                self._to_next_branch(c.line)
        elif holds:
            self._leave(c, base)

    def _base(self, c: Command) -> str:
        """Return what *IF does if its conditions hold."""
        base = c.text(3)
        return (c.text(7) if base in _CONJUNCTIONS else base) or "THEN"

    def _holds(self, c: Command) -> bool:
        result = self._compare(c, 0)
        conjunction = _CONJUNCTIONS.get(c.text(3))
        return conjunction(result, self._compare(c, 4)) if conjunction else result

    def _compare(self, c: Command, k: int) -> bool:
        operation = c.text(k + 1)
        if operation not in _OPERATIONS:
            c.refuse(f"has the operation '{operation[:20]}', which is none of {', '.join(_OPERATIONS)}")
        try:  # ANSYS takes a parameter that has no value for (nearly) zero
            a, b = (self.parameters.value(c.raw(i) or "0", undefined=0.0) for i in (k, k + 2))
        except ValueError as reason:
            c.refuse(f"cannot be decided: {reason}")
        if isinstance(a, str) or isinstance(b, str):
            return (str(a).upper() == str(b).upper()) == (operation != "NE")
        return _OPERATIONS[operation](a, b)

    def _to_next_branch(self, line: int) -> None:
        """Go on in the branch of an *IF that runs, or after its end."""
        while True:
            c = self._skip(line, "*IF", ("*ELSE", "*ENDI"))
            if c.key == "*ENDI":
                self.open.pop()
                return
            if not any(c.fields) or self._holds(c):  # *ELSE, or *ELSEIF
                return

    def _skip(self, line: int, opening: str, closing: tuple[str, ...]) -> Command:
        """Go over the rows to one that closes a construct, and return it."""
        depth = 0
        for k in range(self.at, len(self.rows)):
            number, text = self.rows[k]
            if "*" not in text:
                continue
            c = self._command(number, text, runs=False)
            if c is None or (depth and c.key != opening and c.key != closing[-1]):
                continue
            if c.key == opening and (opening != "*IF" or self._base(c) == "THEN"):
                depth += 1
            elif c.key in closing and not depth:
                self._count(number, k - self.at)
                self.at = k + 1
                return c
            elif c.key == closing[-1]:
                depth -= 1
        end = {"*ENDI": "*ENDIF", "*ENDD": "*ENDDO"}[closing[-1]]
        raise self.deck.error(line, f"{opening} has no {end}")

    def _else(self, c: Command) -> None:
        self._within(c, int)
        self._skip(c.line, "*IF", ("*ENDI",))
        self.open.pop()

    def _endif(self, c: Command) -> None:
        self._within(c, int)
        self.open.pop()

    def _within(self, c: Command, kind: type) -> None:
        if not self.open or not isinstance(self.open[-1], kind):
            c.refuse(f"has no {'*IF' if kind is int else '*DO'} before it")

    def _do(self, c: Command) -> None:
        step = c.real(3) if c.raw(3) else 1.0
        if not step:
            c.refuse("has the increment 0 and no end")
        loop = _Loop(c.line, self.at, c.raw(0).upper(), c.real(1), c.real(2), step)
        self._assign(c.line, loop.name, repr(loop.value))
        if loop.runs():
            self.open.append(loop)
        else:
            self._skip(c.line, "*DO", ("*ENDD",))

    def _enddo(self, c: Command) -> None:
        self._within(c, _Loop)
        loop = self.open[-1]
        assert isinstance(loop, _Loop)
        loop.value += loop.step
        self.parameters.values[loop.name] = loop.value
        if loop.runs():
            self.at = loop.start
        else:
            self.open.pop()

    def _leave(self, c: Command, base: str) -> None:
        """Carry out EXIT or CYCLE of the innermost loop."""
        inner = [o for o in self.open if isinstance(o, _Loop)]
        if base not in ("EXIT", "CYCLE") or not inner:
            text = f"jumps to {base}" if base not in ("EXIT", "CYCLE") else f"has {base} outside of a loop"
            c.refuse(f"{text}; write the model with CDWRITE,DB instead")
        while self.open[-1] is not inner[-1]:
            self.open.pop()
        end = self._skip(c.line, "*DO", ("*ENDD",))
        if base == "EXIT":
            self.open.pop()
        else:
            self._enddo(end)

    def _unit_of_angles(self, c: Command) -> None:
        self.parameters.degrees = c.text(0) == "DEG"


_FLOW: dict[str, Callable[[Script, Command], None]] = {
    "*SET": Script._set,
    "*IF": Script._if,
    "*ELSE": Script._else,
    "*ENDI": Script._endif,
    "*DO": Script._do,
    "*ENDD": Script._enddo,
    "*EXIT": lambda script, c: script._leave(c, "EXIT"),
    "*CYCL": lambda script, c: script._leave(c, "CYCLE"),
    "*AFUN": Script._unit_of_angles,
}
