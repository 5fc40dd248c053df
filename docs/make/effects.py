"""The documentation's tables of effects, from what these declare.

A page has a table below ``<!-- effects NAME -->``; `TABLES` has the names.
"""

import textwrap
from collections.abc import Callable, Mapping

from fem.declarations import Entry, Environment
from fem.effects import candidate_kinds, effect_classes
from fem.model import Effect
from updating.inference.belief import UNSTATED


def candidates() -> dict[str, tuple[type[Effect], Entry]]:
    """Return the classes that a search proposes, with their rows in the documentation, by kind.

    Raises
    ------
    LookupError
        If one of them declares no row.
    """
    classes = effect_classes()
    out = {}
    for kind in candidate_kinds():
        entry = classes[kind].entry
        if entry is None:
            msg = f"{kind} is proposed by a search and declares no entry for the documentation"
            raise LookupError(msg)
        out[kind] = classes[kind], entry
    return out


def list_of_kinds() -> str:
    """Return the names of all kinds as a paragraph."""
    names = ", ".join(f"`{kind}`" for kind in candidates())
    return textwrap.fill(f"Kinds of effect: {names}.", 118, break_long_words=False) + "\n"


def table_of_parameters() -> str:
    """Return a table with the parameters and the meaning of each kind."""
    rows = [f"| `{kind}` | {e.quantities} | {e.meaning} |" for kind, (_, e) in candidates().items()]
    return "\n".join(["| kind | parameters | meaning |", "|---|---|---|", *rows, ""])


def table_of_places() -> str:
    """Return a table of the places at which kinds are proposed, with their roles."""
    groups: dict[str, list[str]] = {}
    for kind, (cls, e) in candidates().items():
        groups.setdefault(e.places, []).append(f"`{kind}` ({cls.role.words})")
    rows = [f"| {places} | {', '.join(names)} |" for places, names in sorted(groups.items())]
    return "\n".join(["| where | candidates, and what they change |", "|---|---|", *rows, ""])


def table_of_environments() -> str:
    """Return a table of the environments that a study may state, with the kinds that need them."""
    rows = []
    for name in Environment:
        kinds = ", ".join(f"`{kind}`" for kind, (cls, _) in candidates().items() if cls.environment == name)
        odds = f"odds × {UNSTATED[name]:g}" if UNSTATED[name] else "not proposed"
        rows.append(f"| `{name}` | {name.meaning} | {kinds} | {odds} |")
    head = "| environment | meaning | kinds that need it | where it is not stated |"
    return "\n".join([head, "|---|---|---|---|", *rows, ""])


TABLES: Mapping[str, Callable[[], str]] = {
    "kinds": list_of_kinds,
    "parameters": table_of_parameters,
    "places": table_of_places,
    "environments": table_of_environments,
}
"""What a page can hold, by the name in its comment."""
