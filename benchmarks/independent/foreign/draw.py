"""Draw what cases hide: how many things, of which kinds, and how strong, from a seed."""

from dataclasses import dataclass

import numpy as np

from benchmarks.independent.foreign import kinds
from benchmarks.independent.foreign.bench import Hidden

SHARES = {"nothing": 0.15, "one": 0.45, "connections": 0.1, "mixed": 0.1, "two": 0.2}
"""How often cases hide nothing, one thing, two soft connections, a soft connection and a mass, any two."""
CLEAR_DB = 1.0
"""What something must change at least beyond nuisances, or a fault on its own channels, rms."""
MOST_DB = 15.0
"""What something may change at most, rms: beyond it everything would be seen."""
EACH_DB = 0.3
"""What each direction of a connection must change beside the others, beyond nuisances."""
TRIES, KINDS_TRIED = 10, 6


@dataclass(frozen=True)
class Plan:
    """A case before its strengths are drawn: its structure, and the kind of each hidden thing."""

    number: int
    structure: str
    sort: str
    turns: tuple


class Deck:
    """Things drawn without putting back, shuffled anew when all were drawn."""

    def __init__(self, things, rng):
        self.things, self.rng, self.left = list(things), rng, []

    def draw(self):
        if not self.left:
            self.left = [self.things[i] for i in self.rng.permutation(len(self.things))]
        return self.left.pop()


def sorts(rng, shares):
    """Yield sorts of cases, twenty at a time in their shares."""
    twenty = [sort for sort, share in shares.items() for _ in range(round(20 * share))]
    deck = Deck(twenty, rng)
    while True:
        yield deck.draw()


def plans(seed, n, structures, shares=SHARES):
    """Return n plans; those of a larger n begin with the same."""
    decks = np.random.default_rng(seed).spawn(5)
    structure, sort = Deck(structures, decks[0]), sorts(decks[1], shares)
    every, soft = Deck(kinds.EVERY, decks[2]), Deck(kinds.CONNECTIONS, decks[3])
    outside = Deck(kinds.OUTSIDE, decks[4])
    out = []
    for number in range(1, n + 1):
        what = next(sort)
        firsts = {
            "nothing": (),
            "one": (every,),
            "connections": (soft, soft),
            "mixed": (soft, Deck([kinds.point_mass], decks[3])),
            "two": (every, every),
            "outside": (outside,),
        }[what]
        turns = tuple(deck.draw() for deck in firsts)
        out.append(Plan(number, structure.draw(), what, turns))
    return out


def which_are_real(seed, n):
    """Return by number of case whether its test is not as described: one of each two."""
    deck = Deck((True, False), np.random.default_rng(seed))
    return {number: deck.draw() for number in range(1, n + 1)}


def shows(bench, thing, beside):
    """Say whether one thing shows clearly beside others, and how much in dB."""
    if thing.sensors:
        db = bench.change_of(thing.sensors, thing.hidden, beside)
        return db >= CLEAR_DB, {"change_db": round(db, 2)}
    db, left = bench.change(thing.hidden, beside)
    told = {"change_db": round(db, 2), "beyond_nuisances_db": round(left, 2)}
    clear = left >= CLEAR_DB and db <= MOST_DB
    for k, one in enumerate(thing.each if clear else ()):
        others = Hidden()
        for other in (*thing.each[:k], *thing.each[k + 1 :]):
            others |= other
        clear = clear and bench.change(one, beside | others)[1] >= EACH_DB
    return clear, told


def draw_thing(bench, kind, rng, before):
    """Return a thing of a kind that shows clearly beside what was drawn before, and how much; or None."""
    for _ in range(TRIES):
        thing = kind(bench, rng)
        if thing is None or any(thing.where == other.where for other in before):
            continue
        beside = Hidden()
        for other in before:
            beside |= other.hidden
        clear, told = shows(bench, thing, beside)
        for other in before if clear else ():
            clear = clear and shows(bench, other, thing.hidden)[0]
        if clear:
            return thing, told
    return None


def draw(bench, plan, rng):
    """Return what a case hides, the things and how much each shows; other kinds where one has no place."""
    things, told = [], []
    for kind in plan.turns:
        others = [kinds.EVERY[i] for i in rng.permutation(len(kinds.EVERY))]
        if plan.sort in ("connections", "mixed"):
            others = [kinds.point_mass, kinds.soft_axis]
        if plan.sort == "outside":
            others = list(kinds.OUTSIDE)
        for attempt in (kind, *others[:KINDS_TRIED]):
            found = draw_thing(bench, attempt, rng, things)
            if found:
                things.append(found[0])
                told.append({"kind": attempt.__name__} | found[1])
                break
    hidden = Hidden()
    for thing in things:
        hidden |= thing.hidden
    return hidden, things, told
