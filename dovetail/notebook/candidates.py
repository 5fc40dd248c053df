"""Candidates as a user meets them: names, places, and parameters with units and bounds."""

import re
from collections.abc import Iterable
from typing import Any, SupportsIndex, overload

from dovetail.file.table import suggest
from dovetail.report.html_table import table
from fem.analysis.frf import imported
from fem.declarations import Entry
from fem.model import Effect, ModelError, Parameter
from fem.summary import counted, quantity


def places_of(effect: Effect) -> tuple[str, ...]:
    """Return the places that an effect names, such as ``("joint:J",)`` or ``("member:U", "end:U.1")``.

    Effects that name neither joint, support nor member act on the whole structure or belong to the test:
    their place is ``"structure"``.
    """
    found = [f"{kind}:{name}" for kind in ("joint", "support", "member") for name in _names(effect, kind)]
    ends: tuple[tuple[str, int], ...] = getattr(effect, "ends", ())
    if hasattr(effect, "member") and getattr(effect, "end", None) in (1, 2):
        ends = ((effect.member, effect.end),)  # pyright: ignore[reportAttributeAccessIssue]
    found += [f"member:{member}" for member, _ in ends] + [f"end:{member}.{end}" for member, end in ends]
    if not found:
        found = _places_in_words(str(getattr(effect, "place", "")))
    return tuple(dict.fromkeys(found)) or ("structure",)


def _places_in_words(text: str) -> list[str]:
    """Return the places that effects at a point state in words: an end, a joint, a place on a member."""
    if end := re.match(r"(?:excitation at )?end (\d) of member (.+?)(?:, |$)", text):
        return [f"member:{end[2]}", f"end:{end[2]}.{end[1]}"]
    if joint := re.match(r"joint (.+?)(?: on its second side|, |$)", text):
        return [f"joint:{joint[1]}"]
    if member := re.match(r"(?:excitation at )?member (.+?) at ", text):
        return [f"member:{member[1]}"]
    return []


def _names(effect: Effect, kind: str) -> tuple[str, ...]:
    """Return the joints, supports or members that an effect names."""
    one, many = getattr(effect, kind, None), getattr(effect, f"{kind}s", ())
    named = tuple(x for x in many if isinstance(x, str)) if isinstance(many, tuple) else ()
    return (one, *named) if isinstance(one, str) else named


class Candidates(tuple[Effect, ...]):
    """Effects that may be added to a model, as a tuple that can be filtered by place and shown as a table.

    Attributes
    ----------
    asked : tuple of str
        Places that :meth:`at` was asked for; empty without it.
    """

    asked: tuple[str, ...] = ()

    @overload
    def __getitem__(self, key: SupportsIndex) -> Effect: ...
    @overload
    def __getitem__(self, key: slice) -> "Candidates": ...
    @overload
    def __getitem__(self, key: str) -> Effect: ...
    def __getitem__(self, key: Any) -> Any:
        """Return a candidate by its name or number, or some of them by a slice.

        Raises
        ------
        ModelError
            If there is no candidate of the name.
        """
        if isinstance(key, str):
            by_name = {e.name: e for e in self}
            if key not in by_name:
                msg = f"there is no candidate '{key}'; {suggest(key, by_name)}"
                raise ModelError(msg)
            return by_name[key]
        found = super().__getitem__(key)
        return Candidates(found) if isinstance(key, slice) else found

    @property
    def names(self) -> tuple[str, ...]:
        """Names, as :meth:`dovetail.Study.add` takes them."""
        return tuple(e.name for e in self)

    @property
    def places(self) -> tuple[str, ...]:
        """All places at which there are candidates, sorted."""
        return tuple(sorted({place for e in self for place in places_of(e)}))

    def at(self, *places: str) -> "Candidates":
        """Return the candidates at some places, such as ``"joint:J"`` or ``"member:U"``.

        Raises
        ------
        ModelError
            If no candidate is at one of them; the message names the places that there are.
        """
        known = self.places
        for place in places:
            if place not in known:
                msg = f"no candidate is at '{place}'; {suggest(place, known)}"
                raise ModelError(msg)
        out = Candidates(e for e in self if set(places) & set(places_of(e)))
        out.asked = places
        return out

    def rows(self) -> list[dict[str, Any]]:
        """Return a mapping for each candidate: name, kind, where, places, and its parameters."""
        return [
            {
                "name": e.name,
                "kind": e.kind,
                "where": e.where,
                "places": list(places_of(e)),
                "parameters": [
                    {"name": p.name, "unit": p.unit, "value": p.value, "lower": p.lower, "upper": p.upper}
                    for p in e.parameters()
                ],
            }
            for e in self
        ]

    def to_frame(self) -> Any:
        """Return a pandas ``DataFrame`` with a row for each parameter of each candidate.

        Columns: candidate, kind, where, parameter, unit, value, lower, upper.

        Raises
        ------
        ImportError
            If pandas is not installed.
        """
        rows = [
            {"candidate": e.name, "kind": e.kind, "where": e.where, "parameter": p.name, "unit": p.unit}
            | {"value": p.value, "lower": p.lower, "upper": p.upper}
            for e in self
            for p in e.parameters()
        ]
        return imported("pandas").DataFrame(rows)

    def __repr__(self) -> str:
        """Return their number, kinds, and the places asked for, or all of them, on one line."""
        kinds = counted(len({e.kind for e in self}), "kind")
        at = self.asked or self.places  # effects at several places have more than those asked for
        places = ", ".join(at[:6]) + (" …" if len(at) > 6 else "")
        return f"<{counted(len(self), 'candidate')} of {kinds} at {places or 'no place'}>"

    def _repr_html_(self) -> str:
        """Return a table of names, places and parameters."""
        rows = [(e.name, e.where, parameters_text(e.parameters()), _meaning(e)) for e in self]
        return table(
            ("candidate", "where", "parameters: value (bounds)", "meaning"), rows, repr(self).strip("<>")
        )


def parameter_text(p: Parameter) -> str:
    """Return a parameter with its value, its bounds and its unit: ``mass 0.04 kg (0 to 38)``.

    That of a spring in both forms, of which either may be given.
    """
    forms = (p,) if p.reciprocal is None else (p, p.reciprocal)
    return " or ".join(
        f"{f.name} {quantity(f.value, f.unit)} ({f.lower:.4g} to {f.upper:.4g})" for f in forms
    )


def parameters_text(parameters: Iterable[Parameter]) -> str:
    """Return parameters with their values, bounds and units on one line."""
    return ", ".join(map(parameter_text, parameters))


def _meaning(effect: Effect) -> str:
    entry: Entry | None = effect.entry
    return entry.meaning.replace("`", "") if entry else ""
