"""The part of a deck in which it differs from another one: cards that turn one model into another."""

from collections.abc import Hashable
from dataclasses import replace
from itertools import count

import numpy as np

from fem.io.deck_nodes import FIRST_OF_PART
from fem.io.frame_of_model import ModelDeck
from fem.io.source_changes import changed_items, changed_supports, in_source, same_property, with_bars
from fem.summary import listed


def changed_deck(deck: ModelDeck, before: ModelDeck) -> ModelDeck:
    """Return the part of a deck that another deck of the same structure has not, or has otherwise.

    Nodes are the same if they have one place, and keep their number. Of bars whose properties alone differ,
    these are written. The notes name what the cards replace, and supports that no longer are.
    """
    deck = in_source(deck, before)
    n = len(before.nodes)
    free = count(max(FIRST_OF_PART, int(before.nodes.max(initial=0)) + 1))
    deck = replace(
        deck, nodes=np.array([*before.nodes, *(next(free) for _ in deck.nodes[n:])], dtype=np.int64)
    )
    removed, new = changed_items(deck, before)
    supports, freed = changed_supports(deck, before)
    deck, known_bars = _changed_bars(deck, before)
    notes = []
    if removed:
        notes.append(f"take out of the model what these cards replace: {listed(x.name for x in removed)}")
    there = set(before.bars.numbers.tolist())
    if numbers := [n for k, n in enumerate(deck.bars.numbers.tolist()) if k not in known_bars and n in there]:
        notes.append(f"take out of the model the bars that these cards replace: {listed(map(str, numbers))}")
    notes += [f"take out of the supports of node {k}: {', '.join(some)}" for k, some in freed.items()]
    return replace(
        deck,
        supports=supports,
        part=True,
        known=frozenset(range(n)),
        known_bars=known_bars,
        notes=(*notes, *deck.notes),
        **new,
    )


def _changed_bars(deck: ModelDeck, before: ModelDeck) -> tuple[ModelDeck, frozenset[int]]:
    """Return a deck with the bars that differ and their properties, and the rows of those that stay."""

    def bar(of: ModelDeck, k: int) -> Hashable:
        b = of.bars
        return (int(b.numbers[k]), *(tuple(x[k].ravel()) for x in (b.ends, b.height, b.offsets, b.stiffness)))

    was = {bar(before, k): before.properties[i] for k, i in enumerate(before.bars.properties.tolist())}
    now = [(bar(deck, k), deck.properties[i]) for k, i in enumerate(deck.bars.properties.tolist())]
    some = [k for k, (b, p) in enumerate(now) if b not in was or not same_property(p, was[b])]
    return with_bars(deck, some), frozenset(i for i, k in enumerate(some) if now[k][0] in was)
