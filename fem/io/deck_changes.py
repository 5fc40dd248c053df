"""The part of a deck in which it differs from another one: cards that turn one model into another."""

from collections import Counter
from collections.abc import Hashable, Iterable, Iterator, Sequence
from dataclasses import fields, replace
from itertools import count
from typing import Any

import numpy as np

from fem.io.deck_nodes import FIRST_OF_PART
from fem.io.frame_deck import Bars
from fem.io.frame_of_model import ModelDeck
from fem.io.source_changes import others_than
from fem.summary import listed


def changed_deck(deck: ModelDeck, before: ModelDeck) -> ModelDeck:
    """Return the part of a deck that another deck of the same structure has not, or has otherwise.

    Nodes are the same if they have one place, and keep their number. Of bars whose properties alone differ,
    these are written. The notes name what the cards replace, and supports that no longer are.
    """
    number = dict(zip(_places(before), before.nodes.tolist(), strict=True))
    free = count(max([FIRST_OF_PART, *(n + 1 for n in number.values())]))
    numbers = [number[place] if place in number else next(free) for place in _places(deck)]
    rows = (k for k, n in enumerate(numbers) if n < FIRST_OF_PART or n in number.values())
    deck = replace(deck, nodes=np.array(numbers, dtype=np.int64))
    items = ("bodies", "connections", "links", "equations", "matrices")
    parts: dict[str, Any] = {
        name: _new(deck, before, getattr(deck, name), getattr(before, name)) for name in items
    }
    was = {_place(before, n): fixed for n, fixed in before.supports.items()}
    supports = {
        n: new
        for n, fixed in deck.supports.items()
        if (new := others_than(fixed, was.get(_place(deck, n), ())))
    }
    bars, properties, known_bars = _bars(deck, before)
    return replace(
        deck,
        bars=bars,
        properties=properties,
        supports=supports,
        part=True,
        known=frozenset(rows),
        known_bars=known_bars,
        **parts,
        notes=(
            *_replaced(deck, before, items),
            *_replaced_bars(bars, before, known_bars),
            *_freed(deck, before),
            *deck.notes,
        ),
    )


def _places(deck: ModelDeck) -> list[tuple[float, ...]]:
    """Return the places of nodes, each with its rank among nodes at one place."""
    seen: Counter[tuple[float, ...]] = Counter()
    out = []
    for p in map(tuple, deck.points.tolist()):
        out.append((*p, seen[p]))
        seen[p] += 1
    return out


def _place(deck: ModelDeck, row: int) -> tuple[float, ...]:
    return (float(deck.nodes[row]), *deck.points[row].tolist())


def _signature(deck: ModelDeck, item: Any) -> Hashable:
    """Return the content of a card but for its name, with places for nodes."""
    out: list[Any] = []
    for f in fields(item):
        value = getattr(item, f.name)
        if f.name in ("node", "nodes", "dependents"):
            out.append(
                tuple(None if n is None else _place(deck, n) for n in np.atleast_1d(np.array(value, object)))
            )
        elif f.name == "terms":
            out.append(tuple((_place(deck, n), d, a) for n, d, a in value))
        elif f.name != "name":
            out.append(tuple(value.ravel().tolist()) if isinstance(value, np.ndarray) else value)
    return tuple(out)


def _new(deck: ModelDeck, before: ModelDeck, now: Iterable[Any], then: Iterable[Any]) -> tuple[Any, ...]:
    known = {_signature(before, item) for item in then}
    return tuple(item for item in now if _signature(deck, item) not in known)


def _bars(deck: ModelDeck, before: ModelDeck) -> tuple[Bars, tuple[Any, ...], frozenset[int]]:
    """Return the bars that differ, the properties of the deck that are needed, and rows of bars that stay."""

    def bar(of: ModelDeck, k: int) -> Hashable:
        b = of.bars
        ends = tuple(_place(of, n) for n in b.ends[k])
        return (int(b.numbers[k]), *ends, *(tuple(x[k].ravel()) for x in (b.height, b.offsets, b.stiffness)))

    def property_of(of: ModelDeck, k: int) -> Hashable:
        p = of.properties[of.bars.properties[k]]
        sections = tuple(
            None if s is None else tuple(getattr(s, key) for key in ("A", "Iy", "Iz", "J", "ky", "kz", "Ip"))
            for s in (p.section, p.section2)
        )
        m = p.material
        return (m.E, m.rho, m.nu, m.loss_factor, *sections, p.theory, p.mass_per_length)

    was = {bar(before, k): property_of(before, k) for k in range(len(before.bars.numbers))}
    some = [k for k in range(len(deck.bars.numbers)) if was.get(bar(deck, k)) != property_of(deck, k)]
    stay = frozenset(i for i, k in enumerate(some) if bar(deck, k) in was)
    used, which = np.unique(deck.bars.properties[some], return_inverse=True)
    b = deck.bars
    kept = {f.name: getattr(b, f.name)[some] for f in fields(b)} | {"properties": which}
    return replace(b, **kept), tuple(deck.properties[i] for i in used), stay


def _replaced(deck: ModelDeck, before: ModelDeck, items: Sequence[str]) -> Iterator[str]:
    for name in items:
        removed = _new(before, deck, getattr(before, name), getattr(deck, name))
        if removed:
            yield f"take out of the model what these cards replace: {listed(x.name for x in removed)}"


def _replaced_bars(bars: Bars, before: ModelDeck, known: frozenset[int]) -> Iterator[str]:
    """Yield the bars that both decks have, with other nodes, orientations, offsets or springs."""
    there = set(before.bars.numbers.tolist())
    if numbers := [n for k, n in enumerate(bars.numbers.tolist()) if k not in known and n in there]:
        yield f"take out of the model the bars that these cards replace: {listed(map(str, numbers))}"


def _freed(deck: ModelDeck, before: ModelDeck) -> Iterator[str]:
    """Yield supports that the deck has no longer."""
    now = {_place(deck, n): fixed for n, fixed in deck.supports.items()}
    for n, fixed in before.supports.items():
        if free := others_than(fixed, now.get(_place(before, n), ())):
            yield f"take out of the supports of node {before.nodes[n]}: {', '.join(free)}"
