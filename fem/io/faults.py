"""Errors of readers and writers."""

from typing import NoReturn, TypeVar

from fem.mesh import MeshError

E = TypeVar("E", bound=ValueError)


def error_at(place: object, words: str, error: type[E] = MeshError) -> E:
    """Return an error whose message is a place (a file, its line, a card) and what is wrong there."""
    return error(f"{place}: {words}")


def refuse(words: str, error: type[ValueError] = ValueError) -> NoReturn:
    """Raise an error; a ValueError gets its place from a caller."""
    raise error(words)
