"""Short texts of objects, for prompts and notebooks: sizes, ranges and values with their units."""

from collections.abc import Iterable, Mapping
from dataclasses import fields
from difflib import get_close_matches
from itertools import accumulate
from typing import Any

import numpy as np

_MOST_NAMES = 4
"""Names that a list shows before it counts the rest."""
_MOST_VALUES = 6
"""Parameters that an effect shows before it counts the rest."""
_LONGEST = 60
"""Characters of a text or of a value inside a summary."""


def quantity(value: Any, unit: str = "-") -> str:
    """Return a value with four digits and its unit; ``"-"`` is none."""
    return f"{value:.4g}" + ("" if unit == "-" else f" {unit}")


def span(values: Any, unit: str = "-") -> str:
    """Return the least and the largest of some values with their unit, such as ``2 to 3200 Hz``."""
    values = np.asarray(values, dtype=float).ravel()
    values = values[np.isfinite(values)]
    if not values.size:
        return "no values"
    low, high = values.min(), values.max()
    return quantity(low, unit) if low == high else f"{low:.4g} to {quantity(high, unit)}"


def percent(probability: float) -> str:
    """Return a probability in per cent without decimals, with a no-break space; never 0 or 100.

    Data and priors are not known well enough to tell one in a hundred from one in a million.
    """
    bound = "above 99" if probability > 0.99 else "below 1" if probability < 0.01 else ""
    return f"{bound or format(100 * probability, '.0f')}\u00a0%"


def counted(n: int, noun: str) -> str:
    """Return a number and a noun, in the plural unless it is one."""
    return f"{n} {noun if n == 1 else noun + 's'}"


def listed(names: Iterable[str]) -> str:
    """Return the first names of a list, and how many more there are."""
    names = list(names)
    more = f" and {len(names) - _MOST_NAMES} more" if len(names) > _MOST_NAMES else ""
    return (", ".join(names[:_MOST_NAMES]) + more) or "none"


def nearest(word: str, known: Iterable[str], n: int = 1, likeness: float = 0.6) -> list[str]:
    """Return the words, ``n`` at most, that are most like another one, capitals or not, the nearest first.

    ``likeness`` is the least ratio of :class:`difflib.SequenceMatcher` [-].
    """
    found: dict[str, str] = {}
    for one in known:
        found.setdefault(one.casefold(), one)
    return [found[key] for key in get_close_matches(word.casefold(), found, n, likeness)]


def did_you_mean(word: str, known: Iterable[str], likeness: float = 0.6) -> str:
    """Return the question for the word that is most like another one; empty if none is."""
    return "".join(f"did you mean '{one}'?" for one in nearest(word, known, 1, likeness))


def summary(self: Any, text: str) -> str:
    """Return ``<Class text>`` on one line, for an object's ``__repr__``."""
    return f"<{type(self).__name__} {' '.join(text.split())}>"


def fields_summary(self: Any) -> str:
    """Return the class of a dataclass and its fields, arrays and long values by their shape.

    Classes take it as their ``__repr__``: the one that dataclasses make would print every array.
    """
    texts = [f"{f.name}={_short(getattr(self, f.name))}" for f in fields(self) if f.repr]
    # Characters of all fields of an object before the rest of them is counted
    shown = [
        text for text, end in zip(texts, accumulate(len(t) + 2 for t in texts), strict=True) if end < 240
    ]
    more = [counted(len(texts) - len(shown), "more field")] if len(shown) < len(texts) else []
    return f"{type(self).__name__}({', '.join([*shown, *more])})"


def _short(value: Any) -> str:
    """Return a value as it is if it is short, otherwise its type and size."""
    if isinstance(value, np.ndarray):
        if value.size <= _MOST_NAMES and value.dtype.kind in "biufc":
            return np.array2string(value, precision=4, separator=", ").replace("\n", "")
        return f"array {value.shape} {value.dtype}"
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, Mapping | tuple | list):
        contents = _contents(value)
        return contents if len(contents) <= _LONGEST else f"{type(value).__name__} of {len(value)}"
    shape = getattr(value, "shape", None)
    if isinstance(shape, tuple):
        return f"{type(value).__name__} {shape}"
    text = " ".join(repr(value).split())
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 2]} …"


def _contents(value: Mapping[Any, Any] | tuple[Any, ...] | list[Any]) -> str:
    """Return all of a small collection; of a large one only enough to see that it is large."""
    if len(value) > _LONGEST // 3:
        return " " * (_LONGEST + 1)
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{k!r}: {_short(v)}" for k, v in value.items()) + "}"
    comma = "," if isinstance(value, tuple) and len(value) == 1 else ""
    left, right = "()" if isinstance(value, tuple) else "[]"
    return left + ", ".join(map(_short, value)) + comma + right


def effect_summary(self: Any) -> str:
    """Return an effect's name, place and parameters with units on one line."""
    values = [f"{p.name} {quantity(p.value, p.unit)}" for p in self.parameters()]
    more = f" and {len(values) - _MOST_VALUES} more" if len(values) > _MOST_VALUES else ""
    stated = f": {', '.join(values[:_MOST_VALUES])}{more}" if values else ""
    return summary(self, f"{self.name} at {self.where}{stated}")


def damping_summary(self: Any) -> str:
    """Return the damping ratios and other damping on one line."""
    parts = [f"ζ {span(np.real(self.ratio))}"]
    parts += [f"at {span(self.frequency, 'Hz')}"] if len(self.frequency) > 1 else []
    parts += [f"alpha {quantity(self.alpha, '1/s')}"] if self.alpha else []
    parts += [f"beta {quantity(self.beta, 's')}"] if self.beta else []
    parts += [f"loss factor {quantity(self.loss_factor)}"] if self.loss_factor else []
    return summary(self, ", ".join(parts))


def model_summary(self: Any) -> str:
    """Return a model's members, degrees of freedom and effects on one line."""
    mesh, effects = self.mesh, listed(e.name for e in self.effects)
    size = f"{counted(len(mesh.members), 'member')}, {counted(mesh.n_lines, 'line')}"
    return summary(self, f"{size}, {self.n_dof} DOFs; effects: {effects}")
