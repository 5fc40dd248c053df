"""Values by member's name, with the arrays that are made of them on a mesh."""

from collections.abc import Callable, ItemsView, Iterator, Mapping, ValuesView
from typing import Any, Generic, TypeVar

from fem.mesh import Mesh
from fem.recent import Recent

T = TypeVar("T")

_MESHES = 8
"""Number of meshes for which arrays are kept."""


class ByMember(Mapping[str, T], Generic[T]):
    """Values by member's name that never change.

    Frames with other moduli share one such object. It owns the arrays that depend on its values and on a mesh
    alone, so that a fit forms them once.

    Parameters
    ----------
    values : mapping of str to T
        Copied, so that later changes of it do no harm.
    """

    __slots__ = ("_on_meshes", "_values")

    def __init__(self, values: Mapping[str, T]) -> None:
        self._values = dict(values)
        self._on_meshes = Recent(_MESHES)

    @classmethod
    def of(cls, values: Mapping[str, T]) -> "ByMember[T]":
        """Return values as such an object: themselves if they are one."""
        return values if isinstance(values, ByMember) else cls(values)

    def on(self, mesh: Mesh, make: Callable[["ByMember[T]", Mesh], Any]) -> Any:
        """Return ``make(self, mesh)``, kept for the last few meshes."""
        return self._on_meshes.get((make, mesh), lambda: make(self, mesh))

    def __getitem__(self, name: str) -> T:
        return self._values[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    # the views of the dictionary itself: those of Mapping look every name up, and a frame has thousands

    def __contains__(self, name: object) -> bool:
        return name in self._values

    def values(self) -> ValuesView[T]:
        """Return the values."""
        return self._values.values()

    def items(self) -> ItemsView[str, T]:
        """Return pairs of name and value."""
        return self._values.items()

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self._values!r})"
