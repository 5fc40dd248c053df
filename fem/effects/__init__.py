"""Physical effects, one file each.

A file that defines a subclass of :class:`fem.model.Effect` with ``propose`` adds a kind of candidate to every diagnosis; nothing
else has to be changed.
"""

import importlib
import pkgutil

from fem.model import Effect


def effect_classes() -> dict[str, type[Effect]]:
    """Return every effect class by its kind, from all modules of this package."""
    for module in pkgutil.iter_modules(__path__):
        importlib.import_module(f"{__name__}.{module.name}")
    out: dict[str, type[Effect]] = {}
    waiting = list(Effect.__subclasses__())
    while waiting:
        cls = waiting.pop()
        waiting += cls.__subclasses__()
        if cls.__module__.startswith(__name__) and "kind" in cls.__dict__:
            out[cls.kind] = cls
    return dict(sorted(out.items()))


def candidate_kinds() -> tuple[str, ...]:
    """Return the kinds of effect that propose candidates."""
    return tuple(kind for kind, cls in effect_classes().items() if cls.propose.__func__ is not Effect.propose.__func__)
