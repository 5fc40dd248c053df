"""A cache of limited size that its owner holds by name."""

from collections.abc import Callable, Hashable
from typing import Any


class Recent:
    """The last results of a function of hashable values.

    Unlike ``functools.lru_cache`` it ends with its owner, so that results that belong to one model, basis or
    solved state need no key of that object.

    Parameters
    ----------
    limit : int
        Number of results that are kept; of more, the one that was not asked for the longest goes.
    """

    def __init__(self, limit: int) -> None:
        self.limit = limit
        self._known: dict[Hashable, Any] = {}

    def get(self, key: Hashable, make: Callable[[], Any]) -> Any:
        """Return the result of a key, made now unless it is there."""
        value = self._known.pop(key) if key in self._known else make()
        return self.put(key, value)

    def find(self, key: Hashable) -> Any:
        """Return the result of a key, None if it is not there."""
        return self._known.get(key)

    def put(self, key: Hashable, value: Any) -> Any:
        """Keep a result as the newest, and return it."""
        self._known.pop(key, None)
        while len(self._known) >= self.limit:
            self._known.pop(next(iter(self._known)))
        self._known[key] = value
        return value


class Unsent(Recent):
    """The same, empty where its owner is sent to another process: its keys are objects of this one."""

    def __reduce__(self) -> tuple[Any, ...]:
        """Return what makes an empty one."""
        return type(self), (self.limit,)
