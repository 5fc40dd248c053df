"""Reading the tables of a study file, with file, line and key in every error."""

import copy
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from dovetail.file.lines import Path
from fem.directions import direction_vector, directions_from
from fem.summary import did_you_mean, nearest

MOST = 2**63 - 1
"""Largest whole number that is read."""


MISSING: Any = object()
"""Default of a key that must be given."""


class StudyError(ValueError):
    """A fault of a study file; the message names file, line and key."""


class StudyFileError(OSError, StudyError):  # OSError.__new__ sets errno and filename
    """A study file, or one that it names, that cannot be opened; the message is that of the command line."""

    def __str__(self) -> str:
        """Return the file and the reason."""
        return f"{self.filename}: {self.strerror}"


class AwaitedFileError(StudyError):
    """A file with measured data that does not exist, or data of which one is a part."""


class MissingKeyError(StudyError):
    """A key that a table must have and has not.

    Attributes
    ----------
    path : tuple
        Of the table.
    key : str
    stand_in : object
        A value that the key may have; None where that depends on the study.
    """

    def __init__(self, message: str, path: Path, key: str, stand_in: Any = None) -> None:
        super().__init__(message)
        self.path, self.key, self.stand_in = path, key, stand_in


class UnknownKeyError(StudyError):
    """Keys of a table that nothing reads.

    Attributes
    ----------
    path : tuple
        Of the table.
    unknown, allowed : tuple of str
    """

    def __init__(self, message: str, path: Path, unknown: Iterable[str], allowed: Iterable[str]) -> None:
        super().__init__(message)
        self.path, self.unknown, self.allowed = path, tuple(unknown), tuple(allowed)


LEAST = 1e-30
"""Smallest size of a number that is not zero, in any SI unit; the largest is its inverse."""


@dataclass(frozen=True, slots=True)
class Source:
    """A study file's name and where its keys stand."""

    file: str
    lines: dict[Path, int]

    def place(self, path: Path) -> str:
        """Return ``file, line, key`` of a path; of the table around it where it is not in the file."""
        known = path
        while known and known not in self.lines:
            known = known[:-1]
        line = f", line {self.lines[known]}" if known else ""
        key = ""
        for part in path:
            key += f"[{part + 1}]" if isinstance(part, int) else f".{part}" if key else part
        return f"{self.file}{line}{', ' + key if key else ''}"

    def error(self, path: Path, text: str) -> StudyError:
        """Return an error at a path."""
        return StudyError(f"{self.place(path)}: {text}")


@dataclass(slots=True)
class StudyTable:
    """One table of the file; every key that is read is ticked off, the rest are errors."""

    source: Source
    path: Path
    values: dict[str, Any]
    _known: set[str] = field(default_factory=set)

    def __contains__(self, key: str) -> bool:
        self._known.add(key)
        return key in self.values

    def error(self, key: str, text: str) -> StudyError:
        """Return an error at a key, or at the table for an empty key."""
        return self.source.error((*self.path, key) if key else self.path, text)

    def refuse(self, key: str, text: str) -> NoReturn:
        """Raise an error at a key, or at the table for an empty key."""
        raise self.error(key, text)

    def refuse_awaited(self, key: str, text: str) -> NoReturn:
        """Raise an error at a key for measured data that do not exist yet."""
        raise AwaitedFileError(str(self.error(key, text)))

    @contextmanager
    def at(self, key: str = "") -> Iterator[None]:
        """Give the place of a key to errors of the layers below."""
        try:
            yield
        except StudyError:
            raise
        except ValueError as reason:
            raise self.error(key, str(reason)) from reason

    def finish(self) -> None:
        """Refuse keys that nothing has read.

        Raises
        ------
        StudyError
            For the first of them, with the nearest known one.
        """
        unknown = [key for key in self.values if key not in self._known]
        for key in unknown:
            allowed = sorted(self._known)
            hint = " ".join(filter(None, [did_you_mean(key, allowed), f"allowed are {', '.join(allowed)}"]))
            text = f"unknown key; {hint}"
            raise UnknownKeyError(str(self.error(key, text)), self.path, unknown, sorted(self._known))

    def get(self, key: str, default: Any = MISSING, stand_in: Any = None) -> Any:
        """Return a value as it is; ``stand_in`` is as of :class:`MissingKeyError`."""
        self._known.add(key)
        if key in self.values:
            return self.values[key]
        if default is MISSING:
            self.refuse_without(key, f"'{key}' is missing", stand_in)
        return default

    def unread_like(self, key: str) -> str:
        """Return the unread key that is most like another one, capitals or not; empty if none is."""
        return "".join(nearest(key, (k for k in self.values if k not in self._known)))

    def refuse_without(self, key: str, text: str, stand_in: Any = None) -> NoReturn:
        """Raise the error that a key is missing, with an unread key that is like it."""
        close = self.unread_like(key)
        hint = f"; is it the unknown key '{close}'?" if close else ""
        raise MissingKeyError(str(self.error("", f"{text}{hint}")), self.path, key, stand_in)

    def number(
        self,
        key: str,
        default: Any = MISSING,
        *,
        above: float | None = None,
        least: float | None = None,
        unit: str = "",
        infinite: bool = False,
    ) -> float:
        """Return a number, above or at least a bound; ``inf`` only where it may be ``infinite``."""
        value = self.get(key, default, (above or least or 0.0) + 1.0)
        if value is default and default is not MISSING:
            return value
        words = f"a number {f'above {above:g}' if above is not None else ''}"
        words = f"a number of at least {least:g}" if least is not None else words.strip()
        words = {"a number above 0": "a positive number"}.get(words, words)
        if isinstance(value, float) and not np.isfinite(value):
            words = words.replace("a ", "a finite ", 1)
        words += f" [{unit}]" if unit else ""
        ok = _is_number(value) or (infinite and value == np.inf)
        ok = ok and (above is None or value > above) and (least is None or value >= least)
        if not ok:
            self.refuse(key, f"{_shown(value)} is not allowed; {words} is needed")
        return float(value)

    def integer(self, key: str, default: Any = MISSING, least: int = 1, most: int = MOST) -> int:
        """Return a whole number, at least and at most a bound."""
        value = self.get(key, default, least)
        if value is default and default is not MISSING:
            return value
        if not isinstance(value, int) or isinstance(value, bool) or not least <= value <= most:
            bounds = f"of at least {least}" if most == MOST else f"from {least} to {most}"
            self.refuse(key, f"{_shown(value)} is not allowed; a whole number {bounds} is needed")
        return value

    def text(self, key: str, default: Any = MISSING, choices: Sequence[str] = ()) -> str:
        """Return a text, one of some if there are choices."""
        value = self.get(key, default, choices[0] if choices else None)
        if value is default and default is not MISSING:
            return value
        if not isinstance(value, str) or not value.strip():
            self.refuse(key, f"{_shown(value)} is not allowed; a text is needed")
        if choices and value not in choices:
            self.refuse(key, f"{_shown(value)} is not allowed; {suggest(value, choices)}")
        return value

    def flag(self, key: str, default: bool) -> bool:
        """Return true or false."""
        value = self.get(key, default)
        if not isinstance(value, bool):
            self.refuse(key, f"{_shown(value)} is not allowed; true or false is needed")
        return value

    def vector(self, key: str, default: Any = MISSING, size: int | None = 3, unit: str = "m") -> Any:
        """Return a list of finite numbers as an array."""
        value = self.get(key, default, [1.0] * (size or 1))
        if value is default and default is not MISSING:
            return value
        return as_vector(self, key, value, size, unit)

    def texts(self, key: str, default: Any = MISSING) -> Any:
        """Return a list of texts, or the words of one text, as a tuple."""
        value = self.get(key, default)
        if value is default and default is not MISSING:
            return value
        if isinstance(value, str):
            value = value.replace(",", " ").split()
        if not isinstance(value, list) or not all(isinstance(v, str) for v in value) or not value:
            self.refuse(key, f"{_shown(value)} is not allowed; a list of texts is needed")
        return tuple(value)

    def direction(self, key: str, value: Any = MISSING) -> NDArray[np.float64]:
        """Return a unit vector from ``"x"``, ``"-z"`` or three numbers, of the key or as given."""
        value = self.get(key, stand_in="x") if value is MISSING else value
        if not isinstance(value, str):
            value = as_vector(self, key, value, 3, "-")
        with self.at(key):
            return direction_vector(value)

    def directions(self, key: str, default: Any = MISSING) -> tuple[str, ...]:
        """Return some of x y z rx ry rz, from ``"all"``, ``"x ry"`` or a list."""
        value = self.get(key, default, "all")
        if not isinstance(value, str | list):
            self.refuse(
                key,
                f"{_shown(value)} is not allowed; all, translations, rotations or "
                "some of x y z rx ry rz are needed",
            )
        with self.at(key):
            return directions_from(value, key)

    def matrix(self, key: str, size: int = 6) -> NDArray[np.float64]:
        """Return a square matrix from rows or from its diagonal."""
        value = self.get(key, stand_in=[1.0] * size)
        try:
            array = np.array(value, dtype=float)
        except (ValueError, TypeError):
            array = np.zeros(0)
        if array.shape == (size,):
            array = np.diag(array)
        if array.shape != (size, size) or not np.isfinite(array).all():
            self.refuse(
                key, f"{size} rows of {size} numbers, or the {size} numbers of a diagonal, are needed"
            )
        return array

    def table(self, key: str) -> "StudyTable":
        """Return a table, empty where there is none."""
        value = self.get(key, {})
        if not isinstance(value, dict):
            self.refuse(key, f"{_shown(value)} is not allowed; a table, [{key}], is needed")
        return StudyTable(self.source, (*self.path, key), value)

    def tables(self, key: str) -> list["StudyTable"]:
        """Return an array of tables."""
        value = self.get(key, [])
        if not isinstance(value, list) or not all(isinstance(v, dict) for v in value):
            self.refuse(key, f"an array of tables is needed: write [[{key}]] over each")
        return [StudyTable(self.source, (*self.path, key, i), v) for i, v in enumerate(value)]

    def named(self) -> Iterator[tuple[str, "StudyTable"]]:
        """Return the tables in a table of tables, such as ``[materials.steel]``, by name."""
        for key in self.values:
            yield key, self.table(key)


def with_unknown_keys(
    missing: MissingKeyError, values: dict[str, Any], read: Callable[[dict[str, Any]], object]
) -> StudyError:
    """Return the error of a missing key with the unknown keys of its table, which may stand for it.

    Which keys a table may have shows when it has been read to its end. So the study is read once more, with
    values that stand in for what is missing.

    Parameters
    ----------
    missing : MissingKeyError
    values : dict
        Of the study; it stays as it is.
    read : callable
        Reads such values, and raises as a study does.
    """
    filled, absent = values, missing
    # Missing keys of one table that values stand in for, to find its unknown keys
    for _ in range(8):
        found, trial = None, filled
        for value in _stand_ins(absent, values):
            trial = copy.deepcopy(filled)
            table = _table_at(trial, absent.path)
            if table is None:
                return missing
            table[absent.key] = value
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    read(trial)
            except (MissingKeyError, UnknownKeyError) as reason:
                found = reason if reason.path == missing.path else None
                break
            except (ValueError, OSError):  # the value that stands in is not allowed there
                continue
            return missing
        if isinstance(found, UnknownKeyError):
            return StudyError(_missing_words(missing, found))
        if found is None:
            return missing
        filled, absent = trial, found
    return missing


def _stand_ins(missing: MissingKeyError, values: dict[str, Any]) -> Iterator[Any]:
    """Yield values that a missing key may have: the reader's, names of the study, or a place."""
    if missing.stand_in is not None:
        yield missing.stand_in
        return
    for kind in ("points", "members", "materials", "sections"):
        if isinstance(values.get(kind), dict):
            yield from list(values[kind])[:2]
    for kind in ("sensors", "joints"):
        of_kind = values.get(kind)
        tables = of_kind if isinstance(of_kind, list) else []
        yield from [one["name"] for one in tables if isinstance(one, dict) and "name" in one][:1]
    yield from ([0.0, 0.0, 0.0], "x", 1.0)


def _table_at(values: Any, path: Path) -> dict[str, Any] | None:
    """Return the table at a path, None where it is in another file."""
    for part in path:
        try:
            values = values[part]
        except (KeyError, IndexError, TypeError):
            return None
    return values if isinstance(values, dict) else None


def _missing_words(missing: MissingKeyError, found: UnknownKeyError) -> str:
    named = nearest(missing.key, found.unknown) or (found.unknown if len(found.unknown) == 1 else ())
    text = str(missing).partition("; is it the unknown key")[0]
    listed = " and ".join(f"'{key}'" for key in found.unknown)
    hint = f"is it the unknown key '{named[0]}'?" if named else f"{listed} are unknown keys;"
    others = [key for key in found.unknown if key not in named] if named else []
    more = f" unknown too: {', '.join(others)};" if others else ""
    return f"{text}; {hint}{more} allowed are {', '.join(found.allowed)}"


def as_vector(table: StudyTable, key: str, value: Any, size: int | None, unit: str) -> NDArray[np.float64]:
    """Return a list of finite numbers as an array."""
    if not isinstance(value, list) or not all(_is_number(v) for v in value) or (size and len(value) != size):
        table.refuse(key, f"{_shown(value)} is not allowed; {size or 'some'} numbers [{unit}] are needed")
    return np.array(value, dtype=float)


def suggest(word: str, known: Iterable[str]) -> str:
    """Return the allowed words instead of one, the nearest first."""
    known = list(known)
    listed = ", ".join(known[:20]) + (f" and {len(known) - 20} more" if len(known) > 20 else "")
    return " ".join(filter(None, [did_you_mean(word, known), f"allowed are {listed or 'none'}"]))


def no_candidate(name: str, known: Sequence[str]) -> str:
    """Return that a model has no candidate of a name, and the nearest ones of its kind."""
    near = nearest(name, known, 3, 0.3) or known[:3]
    among = f"; the nearest are {', '.join(near)}" if near else ", nor another of this kind"
    return f"the model has no candidate '{name}'{among}"


def _is_number(value: Any) -> bool:
    # no quantity in SI units is larger or smaller; powers of sizes must not overflow
    number = isinstance(value, int | float) and not isinstance(value, bool)
    return number and (value == 0 or LEAST <= abs(value) <= 1 / LEAST)


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
