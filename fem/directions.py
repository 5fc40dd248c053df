"""Words for directions: unit vectors, and sets of degrees of freedom."""

import re
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from fem.array_types import Floats
from fem.model import DIRECTIONS, ModelError

_RUN, _RUNS = re.compile(r"r?[xyz]"), re.compile(r"(r?[xyz])+")
"""A direction, and several in one word."""


def direction_vector(direction: str | ArrayLike) -> Floats:
    """Return a unit vector for ``"x"``, ``"-z"`` or three components, shape (3,).

    Raises
    ------
    ModelError
        If it is not a direction.
    """
    if isinstance(direction, str):
        sign, letter = (-1.0, direction[1:]) if direction[:1] == "-" else (1.0, direction.removeprefix("+"))
        if letter.lower() in ("x", "y", "z"):
            return sign * np.eye(3)["xyz".index(letter.lower())]
    else:
        v = np.asarray(direction, dtype=float)
        if v.shape == (3,) and np.isfinite(v).all() and np.linalg.norm(v) > 0:
            return v / np.linalg.norm(v)
    msg = (
        f"{direction!r} is not a direction; use x, y, z, -x, -y, -z or three components that are not all zero"
    )
    raise ModelError(msg)


def directions_from(text: str | Sequence[str], what: str) -> tuple[str, ...]:
    """Return DOF directions from words.

    ``"all"``, ``"translations"``, ``"rotations"`` or some of x y z rx ry rz, as ``"x, ry"`` or ``"xyz"``.

    Raises
    ------
    ModelError
        If a word is not one of these.
    """
    named = {"all": DIRECTIONS, "translations": DIRECTIONS[:3], "rotations": DIRECTIONS[3:]}
    words: Iterable[str] = named.get(text, text.replace(",", " ").split()) if isinstance(text, str) else text
    words = [d for word in words for d in (_RUN.findall(word) if _RUNS.fullmatch(str(word)) else [word])]
    for word in words:
        if word not in DIRECTIONS:
            msg = (
                f"{what}: '{word}' is not a direction; allowed are {', '.join(DIRECTIONS)}, all, "
                "translations, rotations"
            )
            raise ModelError(msg)
    return tuple(d for d in DIRECTIONS if d in words)
