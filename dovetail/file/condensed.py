"""Condensed parts in files next to the study, so that the next command does not condense them again."""

import hashlib
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from fem.effects.superelement import Superelement
from fem.elements.part_ties import Attachment
from fem.io.atomic import replacing
from fem.matrices import Matrices
from fem.mesh import Mesh

WORTH_KEEPING = 20_000
"""Rows of a part from which it takes seconds to condense."""

FORMAT = 1
"""Raised where the reduction or the arrays change: files of other formats are made anew."""

_ARRAYS = ("K", "M", "C", "D", "recovery", "fixed_frequency", "left_out")
_NUMBERS = ("limit", "order", "reach")


def fingerprint(
    part: Matrices, mesh: Mesh, attachments: Sequence[Attachment], settings: Sequence[Any]
) -> str:
    """Return a digest of everything that a condensed part follows from."""
    digest = hashlib.sha256(repr((FORMAT, *settings)).encode())
    for X in (part.K, part.M, part.C, part.D):
        for array in () if X is None else (X.data, X.indices, X.indptr):
            digest.update(np.ascontiguousarray(array).tobytes())
    for array in (part.node, part.direction, part.nodes, part.points):
        digest.update(np.ascontiguousarray(array).tobytes())
    for a in attachments:
        digest.update(repr((a.point, a.nodes, a.tie, a.weights, mesh.points[a.point].tolist())).encode())
    return digest.hexdigest()


def stored(
    file: Path, key: str, name: str, part: Matrices, points: tuple[int, ...]
) -> tuple[Superelement, list[str]] | None:
    """Return the condensed part of a file and its notes; None if it is missing or of something else."""
    try:
        with np.load(file, allow_pickle=False) as arrays:
            if str(arrays["key"]) != key:
                return None
            values: dict[str, Any] = {k: arrays[k] for k in _ARRAYS if k in arrays}
            values |= {k: arrays[k].item() for k in _NUMBERS}
            notes = arrays["notes"].tolist()
    except Exception:  # damaged archives raise whatever zipfile, zlib and numpy come upon
        return None
    return Superelement(name=name, points=points, part=part, **values), notes


def store(file: Path, key: str, part: Superelement, notes: Sequence[str]) -> None:
    """Write a condensed part with its notes; a folder that cannot be written to is no fault."""
    known = {f.name: getattr(part, f.name) for f in fields(part)}
    arrays: dict[str, Any] = {k: np.asarray(known[k]) for k in (*_ARRAYS, *_NUMBERS) if known[k] is not None}
    arrays |= {"key": np.array(key), "notes": np.array(notes, dtype=str)}
    try:
        with replacing(file) as scratch, scratch.open("wb") as out:
            np.savez(out, **arrays)
    except OSError:
        return
