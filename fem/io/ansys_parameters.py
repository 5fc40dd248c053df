"""Parameters of ANSYS' command language, and the arithmetic of its fields."""

import math
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from fem.io.deck import real

_TOKEN = re.compile(r"\s*((?:\d+\.?\d*|\.\d+)(?:[EeDd][-+]?\d+)?|[A-Za-z_]\w*|\*\*|[-+*/(),])")
_NAME = re.compile(r"[A-Za-z_]\w{0,31}(\(.*\))?")
_QUOTED = re.compile(r"%(\w+)%")
LONGEST, DEEPEST = 300, 30
"""Characters of an expression, and its brackets."""


def _log(x: float) -> float:
    return math.log(x)


FUNCTIONS: dict[str, Callable[..., float]] = {
    "ABS": math.fabs,
    "SQRT": math.sqrt,
    "EXP": math.exp,
    "LOG": _log,
    "LOG10": math.log10,
    "NINT": lambda x: math.floor(x + 0.5),
    "MOD": math.fmod,
    "SIGN": math.copysign,
}
_OF_ANGLE: dict[str, Callable[[float], float]] = {"SIN": math.sin, "COS": math.cos, "TAN": math.tan}
_ANGLE_OF: dict[str, Callable[..., float]] = {
    "ASIN": math.asin,
    "ACOS": math.acos,
    "ATAN": math.atan,
    "ATAN2": math.atan2,
}


@dataclass(slots=True)
class Parameters:
    """Values of parameters, by names in capitals; elements of arrays are ``A(1,2)``.

    Attributes
    ----------
    unknown : name to the reason why its value is not known here
    functions : those that ask the model, such as NX
    degrees : whether angles of functions are in degrees (*AFUN)
    """

    values: dict[str, float | str] = field(default_factory=dict)
    unknown: dict[str, str] = field(default_factory=dict)
    functions: dict[str, Callable[..., float]] = field(default_factory=dict)
    degrees: bool = False

    def assign(self, name: str, text: str) -> None:
        """Set a parameter; an empty text deletes it, and one that cannot be evaluated makes it unknown.

        Raises
        ------
        ValueError
            If this is no name of a parameter.
        """
        key = self._key(name)
        self.values.pop(key, None)
        self.unknown.pop(key, None)
        text = text.strip()
        if not text:
            return
        try:
            self.values[key] = self.value(text)
        except ValueError as reason:
            self.unknown[key] = str(reason)

    def forget(self, name: str, reason: str) -> None:
        """Mark a parameter whose value only ANSYS knows."""
        key = self._key(name)
        for old in [n for n in self.values if n == key or n.startswith(f"{key}(")]:
            del self.values[old]
        self.unknown[key] = reason

    def _key(self, name: str) -> str:
        name = name.strip().upper()
        if not _NAME.fullmatch(name):
            msg = f"'{name[:40]}' is not the name of a parameter"
            raise ValueError(msg)
        head, bracket, indices = name.partition("(")
        if not bracket:
            return head
        return f"{head}({','.join(f'{self.number(i):g}' for i in indices[:-1].split(','))})"

    def filled(self, text: str) -> str:
        """Return a line with the values of parameters in percent signs."""

        def value(match: re.Match[str]) -> str:
            found = self.values.get(match[1].upper())
            return match[0] if found is None else found if isinstance(found, str) else f"{found:.12g}"

        return _QUOTED.sub(value, text) if "%" in text else text

    def value(self, text: str, undefined: float | None = None) -> float | str:
        """Return a text in quotes, or what an expression gives."""
        text = text.strip()
        if text[:1] == "'":
            return text.strip("'").strip()
        found = self.values.get(text.upper())
        return found if isinstance(found, str) else self.number(text, undefined)

    def label(self, text: str) -> str:
        """Return a label in capitals, by a parameter if it names one with a text."""
        text = text.strip().strip("'").strip().upper()
        found = self.values.get(text)
        return found.upper() if isinstance(found, str) else text

    def number(self, text: str, undefined: float | None = None) -> float:
        """Return the value of an expression; names that nobody defines have the value ``undefined``.

        Raises
        ------
        ValueError
            If it is none.
        """
        try:
            return real(text)
        except ValueError as reason:
            plain = reason
        if len(text) > LONGEST or text.count("(") > DEEPEST or "'" in text:
            raise plain
        try:
            value = _Expression(self, text, undefined).result()
        except (ArithmeticError, TypeError) as reason:
            msg = f"'{text}' has no value ({reason})"
            raise ValueError(msg) from reason
        except _NoExpressionError as reason:
            raise (ValueError(f"{plain}{reason}") if str(reason) else plain) from reason
        if not math.isfinite(value):
            msg = f"'{text}' has no finite value"
            raise ValueError(msg)
        return value

    def call(self, name: str, arguments: list[float]) -> float | None:
        """Return the value of a function or of an array's element, None for another name."""
        turn = math.pi / 180 if self.degrees else 1.0
        if name in _OF_ANGLE and len(arguments) == 1:
            return _OF_ANGLE[name](arguments[0] * turn)
        if name in _ANGLE_OF:
            return _ANGLE_OF[name](*arguments) / turn
        function = FUNCTIONS.get(name) or self.functions.get(name)
        if function is not None:
            return float(function(*arguments))
        return self.named(f"{name}({','.join(f'{a:g}' for a in arguments)})")

    def named(self, name: str) -> float | None:
        """Return the value of a parameter, None if it has none."""
        value = self.values.get(name)
        return value if isinstance(value, float) else None


class _NoExpressionError(Exception):
    pass


@dataclass(slots=True)
class _Expression:
    """One expression, evaluated from left to right: ``**``, then ``*`` and ``/``, then ``+`` and ``-``."""

    parameters: Parameters
    text: str
    undefined: float | None
    tokens: Iterator[str] = field(init=False)
    token: str = ""

    def __post_init__(self) -> None:
        self.tokens = self._split()
        self._next()

    def _split(self) -> Iterator[str]:
        at, text = 0, self.text.rstrip()
        while at < len(text):
            match = _TOKEN.match(text, at)
            if match is None:
                raise _NoExpressionError
            at = match.end()
            yield match[1].upper()

    def _next(self) -> str:
        before, self.token = self.token, next(self.tokens, "")
        return before

    def result(self) -> float:
        value = self._sum()
        if self.token:
            raise _NoExpressionError
        return value

    def _sum(self) -> float:
        value = self._product()
        while self.token in ("+", "-"):
            value = value + self._product() if self._next() == "+" else value - self._product()
        return value

    def _product(self) -> float:
        value = self._power()
        while self.token in ("*", "/"):
            value = value * self._power() if self._next() == "*" else value / self._power()
        return value

    def _power(self) -> float:
        if self.token in ("+", "-"):
            return self._power() if self._next() == "+" else -self._power()
        base = self._atom()
        if self.token != "**":
            return base
        self._next()
        value = base ** self._power()
        if isinstance(value, complex):
            msg = "a root of a negative number"
            raise ArithmeticError(msg)
        return value

    def _atom(self) -> float:
        token = self._next()
        if token == "(":
            value = self._sum()
            self._close()
            return value
        if token[:1].isdigit() or token[:1] == ".":
            return real(token)
        if not token or not (token[0].isalpha() or token[0] == "_"):
            raise _NoExpressionError
        value = self._call(token) if self.token == "(" else self.parameters.named(token)
        if value is not None:
            return value
        if token in self.parameters.unknown:
            msg = f"; the value of {token} is not known here: {self.parameters.unknown[token]}"
            raise _NoExpressionError(msg)
        if self.undefined is None:
            raise _NoExpressionError("" if token == self.text.upper() else f"; {token} has no value")
        return self.undefined

    def _call(self, name: str) -> float | None:
        self._next()
        arguments = [self._sum()]
        while self.token == ",":
            self._next()
            arguments.append(self._sum())
        self._close()
        try:
            return self.parameters.call(name, arguments)
        except ValueError as reason:  # a root of a negative number
            raise ArithmeticError(str(reason)) from reason

    def _close(self) -> None:
        if self._next() != ")":
            raise _NoExpressionError
