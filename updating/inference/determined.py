"""Which unknowns data determine: directions without information, and modes that nothing moves."""

from collections.abc import Sequence

import numpy as np

from fem.array_types import Bools, Floats

SEEN = 1e-3
"""Least change of the data that counts, for a change of an unknown by its width [standard deviations]."""

ROUNDING = 1e-13
"""Eigenvalue of the information, over the largest, that rounding may be [-]."""

SHARE = 1e-2
"""Part of a direction beyond which an unknown takes part in it [-]."""


def blind_directions(A: Floats, width: Floats, prior: Floats) -> Floats:
    """Return directions of unknowns along which the merit does not change, in units of their widths, (n, k).

    Parameters
    ----------
    A : ndarray (n, n)
        Gauss and Newton's matrix of the merit, priors included.
    width : ndarray (n,)
        Possible error of each unknown.
    prior : ndarray (n,)
        Information of the priors, 1/σ², which is part of A: beside precise data A has lost it by rounding.
    """
    values, vectors = _information(A, width, prior)
    return vectors[:, values < SEEN**2]


def _information(A: Floats, width: Floats, prior: Floats) -> tuple[Floats, Floats]:
    """Return information and directions in units of widths; where A is rounding, that of the priors."""
    if not len(A):
        return np.zeros(0), np.zeros((0, 0))
    values, vectors = np.linalg.eigh(A * np.outer(width, width))
    lost = values < ROUNDING * values[-1]
    weak = vectors[:, lost]
    values[lost], turn = np.linalg.eigh(weak.T @ ((prior * width**2)[:, None] * weak))
    vectors[:, lost] = weak @ turn
    return values, vectors


def split_covariance(A: Floats, width: Floats, prior: Floats, fixed: Bools) -> tuple[Floats, Floats]:
    """Return the covariance (n, n) of the free unknowns, and the directions without information (n, k).

    Along the latter there is no variance in the former; rows of fixed ones are 0.
    """
    out, blind = np.zeros(A.shape), np.zeros((len(A), 0))
    use = np.flatnonzero(~fixed)
    if not use.size:
        return out, blind
    w = width[use]
    values, vectors = _information(A[np.ix_(use, use)], w, prior[use])
    weak = values < SEEN**2
    inverse = vectors @ (np.where(weak, 0.0, 1 / np.where(weak, 1.0, values))[:, None] * vectors.T)
    out[np.ix_(use, use)] = inverse * np.outer(w, w)
    blind = np.zeros((len(A), int(weak.sum())))
    blind[use] = vectors[:, weak]
    return out, blind


def taking_part(blind: Floats) -> Bools:
    """Mark the unknowns that take part in directions without information, (n,)."""
    return (blind**2).sum(axis=1) > SHARE**2


def blind_words(blind: Floats, names: Sequence[str], what: str, moved: Bools) -> list[str]:
    """Return sentences on unknowns that data do not determine: alone, or but for a combination of several.

    Parameters
    ----------
    blind : ndarray (n, k)
        `blind_directions`.
    names : sequence of str
        Of the n unknowns.
    what : str
        Kind of data, such as ``"measured mode"``, in the singular.
    moved : ndarray of bool (n,)
        Which of them left their start before nothing changed with them any more.
    """
    projector = blind @ blind.T
    lost = np.flatnonzero(taking_part(blind)).tolist()
    alone = [i for i in lost if projector[i, i] > 1 - SHARE]
    out = []
    for went, end in (
        (False, "the start is kept"),
        (True, "values farther off are as good as the one reached"),
    ):
        some = [names[i] for i in alone if moved[i] == went]
        if some:
            out.append(
                f"the data do not determine {', '.join(some)}: no {what} changes with "
                f"{'it' if len(some) == 1 else 'them'}{' any more' if went else ''}; {end}"
            )
    ungrouped = [i for i in lost if i not in alone]
    while ungrouped:  # groups that share directions
        group = [ungrouped[0]]
        for i in group:
            group += [j for j in ungrouped if j not in group and abs(projector[i, j]) > SHARE**2]
        ungrouped = [i for i in ungrouped if i not in group]
        out.append(
            f"the data do not determine {_listed([names[i] for i in group])} one by one, only a combination "
            "of them: give one a prior, or leave it out"
        )
    return out


def _listed(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
