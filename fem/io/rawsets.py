"""Sets of lines as mesh files have them: several, overlapping or empty; members as a model needs them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fem.array_types import Ints
from fem.mesh import free_name

MOST_LISTED = 8
"""Names that a note lists; of more it gives the number."""


@dataclass(frozen=True, slots=True, eq=False)
class LineSets:
    """Sets of lines, one after the other: the number of the set and the line of each entry."""

    names: Sequence[str]
    number: Ints
    line: Ints

    @classmethod
    def of(cls, sets: Mapping[str, ArrayLike]) -> "LineSets":
        """Return the sets of a reader."""
        parts = [np.asarray(rows, dtype=np.int64).ravel() for rows in sets.values()]
        number = np.repeat(np.arange(len(parts)), [len(part) for part in parts])
        line = np.concatenate(parts) if parts else np.zeros(0, dtype=np.int64)
        return cls(list(sets), number, line)

    def over(self, first: Ints, count: Ints) -> "LineSets":
        """Return the sets after line i has become lines ``first[i]`` to ``first[i] + count[i] - 1``."""
        n = count[self.line]
        step = np.arange(n.sum()) - np.repeat(np.cumsum(n) - n, n)
        return LineSets(self.names, np.repeat(self.number, n), np.repeat(first[self.line], n) + step)

    def mapping(self) -> dict[str, Ints]:
        """Return the lines of each set by its name."""
        order = np.argsort(self.number, kind="stable")
        ends = np.cumsum(np.bincount(self.number, minlength=len(self.names))).tolist()
        rows = self.line[order]
        return {name: rows[i:j] for name, i, j in zip(self.names, [0, *ends], ends, strict=False)}

    def empty(self) -> list[str]:
        """Return the names of the sets without lines."""
        filled = np.bincount(self.number, minlength=len(self.names)) > 0
        return [name for name, some in zip(self.names, filled.tolist(), strict=True) if not some]

    def disjoint(self, n_lines: int) -> tuple[dict[str, Ints], dict[str, tuple[str, ...]], list[str]]:
        """Cut overlapping sets into parts that do not overlap.

        Returns the parts, the names of the parts of each set that is not a part itself, and the names of
        the parts that several sets share without one of them being the part. A part has the name of the set
        that it equals; ``A.rest`` are the lines in A and in no smaller set, ``A & B`` those in both.
        """
        if not self.line.size:
            return {}, {}, []
        pair = distinct(self.line * max(1, len(self.names)) + self.number)
        line, number = np.divmod(pair, max(1, len(self.names)))
        size = np.bincount(number, minlength=len(self.names))
        part = _parts(line, np.argsort(np.argsort(size, kind="stable"))[number], n_lines)
        used = np.flatnonzero(part >= 0)
        rows = np.split(used[np.argsort(part[used], kind="stable")], np.cumsum(np.bincount(part[used]))[:-1])
        holders = _holders(number, part[line], np.argsort(size, kind="stable"), len(rows))
        named = self._named(holders, [len(r) for r in rows], size)
        place = {name: k for k, name in enumerate(self.names)}
        parts = sorted(range(len(rows)), key=lambda k: place.get(named[k], len(place)))
        parts_of: dict[str, list[str]] = {}
        for k, keys in enumerate(holders):
            for key in keys:
                parts_of.setdefault(self.names[key], []).append(named[k])
        alone = set(named)
        groups = {n: tuple(parts_of[n]) for n in self.names if n in parts_of and n not in alone}
        shared = [named[k] for k in parts if len(holders[k]) > 1 and named[k] not in place]
        return {named[k]: rows[k] for k in parts}, groups, shared

    def _named(self, holders: list[list[int]], n: list[int], size: Ints) -> list[str]:
        taken = set(self.names)
        named: list[str] = []
        for keys, count in zip(holders, n, strict=True):
            equal = next((key for key in keys if size[key] == count), None)
            if equal is not None:
                named.append(self.names[equal])
                continue
            words = [self.names[key] for key in keys]
            word = f"{words[0]}.rest" if len(words) == 1 else " & ".join(words)
            named.append(free_name(word, word, taken))
            taken.add(named[-1])
        return named


def _parts(line: Ints, rank: Ints, n_lines: int) -> Ints:
    """Return for each line which part it is in, by the sets that hold it; -1 for none.

    Parts are numbered in the order of their first lines. ``line`` is sorted.
    """
    count = np.bincount(line, minlength=n_lines)
    start = np.cumsum(count) - count
    code = np.full(n_lines, -1)
    used = 0
    n_sets = int(rank.max(initial=0)) + 1
    for n in np.flatnonzero(np.bincount(count)[1:]) + 1:
        here = np.flatnonzero(count == n)
        sets = np.sort(rank[start[here][:, None] + np.arange(n)], axis=1)
        label = np.zeros(len(here), dtype=np.int64)
        for column in sets.T:
            _, label = np.unique(label * n_sets + column, return_inverse=True)
        code[here] = used + label
        used += int(label.max()) + 1
    in_sets = np.flatnonzero(code >= 0)
    _, first, label = np.unique(code[in_sets], return_index=True, return_inverse=True)
    order = np.empty_like(first)
    order[np.argsort(first)] = np.arange(len(first))
    code[in_sets] = order[label]
    return code


def _holders(number: Ints, part: Ints, by_size: Ints, n_parts: int) -> list[list[int]]:
    """Return the numbers of the sets that hold each part, the smallest first."""
    rank = np.empty_like(by_size)
    rank[by_size] = np.arange(len(by_size))
    key = distinct(part * max(1, len(by_size)) + rank[number])
    of, which = np.divmod(key, max(1, len(by_size)))
    numbers, ends = by_size[which].tolist(), np.cumsum(np.bincount(of, minlength=n_parts)).tolist()
    return [numbers[i:j] for i, j in zip([0, *ends[:-1]], ends, strict=True)]


def distinct(values: Ints) -> Ints:
    """Return the different values in ascending order; sorting takes a tenth of `np.unique`'s hashing."""
    values = np.sort(values)
    return values[np.r_[True, values[1:] != values[:-1]]] if values.size else values


def listed(names: Sequence[str]) -> str:
    """Return names for a note: all of a few, else the first and how many there are."""
    shown = ", ".join(f"'{name}'" for name in names[:MOST_LISTED])
    return shown if len(names) <= MOST_LISTED else f"{shown} and {len(names) - MOST_LISTED} more"
