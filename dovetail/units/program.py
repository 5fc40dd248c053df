"""Fingerprints of the program, and of what a unit depends on: results of other versions are not reused."""

import hashlib
from collections.abc import Iterable
from functools import lru_cache
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.system import System

PACKAGES = ("fem", "updating", "joint", "viz", "dovetail")
NUMERICS = ("numpy", "scipy")


@lru_cache(maxsize=1)
def fingerprint() -> str:
    """Return a short hash of the program's code and of the versions of NumPy and SciPy."""
    digest = hashlib.sha256()
    root = Path(__file__).parents[2]
    for package in PACKAGES:
        for file in sorted((root / package).rglob("*.py")):
            digest.update(file.relative_to(root).as_posix().encode())
            digest.update(file.read_bytes())
    for name in NUMERICS:
        digest.update(f"{name} {metadata.version(name)}".encode())
    return digest.hexdigest()[:12]


def digest_of(arrays: Iterable[NDArray[Any]], words: object = (), system: System | None = None) -> str:
    """Return a short hash of all on which a unit depends, the program included.

    Parameters
    ----------
    arrays : iterable of array
        Numbers.
    words : object
        Anything else; its ``repr`` counts.
    system : System, optional
        Its matrices count as well.
    """
    digest = hashlib.sha256(fingerprint().encode())
    matrices = () if system is None else (system.K, system.M, system.C, system.D)
    for array in (*(X.tocsr().data for X in matrices), *arrays):
        digest.update(np.ascontiguousarray(array).tobytes())
    digest.update(repr(words).encode())
    return digest.hexdigest()[:16]
