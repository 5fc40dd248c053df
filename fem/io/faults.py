"""Errors of readers and writers: each names its place first."""

from typing import TypeVar

from fem.mesh import MeshError

E = TypeVar("E", bound=ValueError)


def error_at(place: object, words: str, error: type[E] = MeshError) -> E:
    """Return an error whose message is a place (a file, its line, a card) and what is wrong there."""
    return error(f"{place}: {words}")
