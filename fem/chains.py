"""Chains of lines: which lines of a set follow one another, and in which order and direction."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from fem.array_types import Bools, Floats, Ints

STRAIGHT = 0.5
"""Least cosine of the angle by which a chain may turn at a point: 60°."""


def chains_of(points: Floats, lines: Ints, owner: Ints) -> tuple[Ints, Ints, Bools]:
    """Return the lines of every set as chains: order (n_lines,), length of each chain, and lines to reverse.

    A chain continues at a point where just two lines of its set meet, without a sharp corner. The chains of
    the first set come first; those of one set are in the order of their first lines. The direction is that
    which most lines of the chain have already.

    Parameters
    ----------
    points : ndarray (n_points, 3)
    lines : ndarray of int (n_lines, 2)
    owner : ndarray of int (n_lines,)
        Number of the set of each line.
    """
    rows = np.argsort(owner, kind="stable")
    partner = _partners(points, lines[rows], owner[rows])
    chain, place, turned = _walked(partner)
    order = np.empty_like(rows)
    length = np.bincount(chain)
    order[(np.cumsum(length) - length)[chain] + place] = rows
    flipped = np.empty(len(rows), dtype=bool)
    flipped[rows] = turned
    return order, length, flipped


def _partners(points: Floats, lines: Ints, owner: Ints) -> Ints:
    """Return the end, 2 · line + 0 or 1, with which each line's ends continue, -1 for none, (2 n_lines,)."""
    t = points[lines[:, 1]] - points[lines[:, 0]]
    t /= np.linalg.norm(t, axis=1, keepdims=True)
    place = lines.ravel() + np.repeat(owner, 2) * len(points)
    ends = np.argsort(place, kind="stable")
    place = place[ends]
    start = np.flatnonzero(np.r_[True, place[1:] != place[:-1]])
    pair = start[np.diff(np.r_[start, len(place)]) == 2]
    first, second = ends[pair], ends[pair + 1]
    turn = np.where((first + second) % 2, 1.0, -1.0)  # both at their first or both at their second points
    straight = turn * np.einsum("ij,ij->i", t[first // 2], t[second // 2]) > STRAIGHT
    partner = np.full(lines.size, -1)
    partner[first[straight]], partner[second[straight]] = second[straight], first[straight]
    return partner


def _walked(partner: Ints) -> tuple[Ints, Ints, Bools]:
    """Return the chain of each line, its place in the chain, and whether it is passed from end 1 to end 0.

    Chains are ranked by pointer doubling (Wyllie, 1979), because a loop in Python over 10⁶ lines takes
    seconds.
    """
    n = len(partner) // 2
    first, chain = _joined(partner)
    partner = _opened(partner, first, chain)
    # a state is the end at which a line is entered; the next is the end beyond the line's other end
    to = partner[np.arange(2 * n) ^ 1]
    steps, last = _steps_to_last(to)
    forward = last[0::2] == last[2 * first[chain]]  # the chain's first line is passed from 0 to 1
    length = np.bincount(chain)
    place = length[chain] - 1 - steps[2 * np.arange(n) + ~forward]
    backward = 2 * np.bincount(chain, weights=~forward) > length
    turned = ~forward ^ backward[chain]
    place = np.where(backward[chain], length[chain] - 1 - place, place)
    return chain, place, turned


def _joined(partner: Ints) -> tuple[Ints, Ints]:
    """Return the first line of each chain, in ascending order, and the number of the chain of each line."""
    n = len(partner) // 2
    end = np.flatnonzero(partner >= 0)
    links = coo_array((np.ones(len(end), dtype=bool), (end // 2, partner[end] // 2)), shape=(n, n))
    _, label = connected_components(links, directed=False)
    _, first, label = np.unique(label, return_index=True, return_inverse=True)
    rank = np.empty_like(first)
    rank[np.argsort(first)] = np.arange(len(first))
    return np.sort(first), rank[label]


def _opened(partner: Ints, first: Ints, chain: Ints) -> Ints:
    """Cut closed chains after their first lines, so that each has two ends."""
    free = np.bincount(chain, weights=(partner < 0).reshape(-1, 2).sum(axis=1))
    cut = 2 * first[free == 0] + 1
    partner = partner.copy()
    partner[partner[cut]] = -1
    partner[cut] = -1
    return partner


def _steps_to_last(following: Ints) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return the number of steps from each state to the last one of its chain, and the last one."""
    n = len(following)
    to: NDArray[Any] = following.astype(np.int32) if n < 2**31 else following  # half the memory to move
    steps, last = np.zeros_like(to), np.arange(n, dtype=to.dtype)
    moving = np.flatnonzero(to >= 0)
    last[moving], steps[moving] = to[moving], 1
    while True:
        beyond = last[moving]
        moves = steps[beyond] > 0
        if not moves.any():
            return steps, last
        moving, beyond = moving[moves], beyond[moves]
        more, further = steps[beyond], last[beyond]
        steps[moving] += more
        last[moving] = further
