"""Cells and widths of printed tables."""

from collections.abc import Iterable
from itertools import pairwise

import numpy as np


def width_of(names: Iterable[str]) -> int:
    """Return the width of a column of names, at least 21."""
    return max([len(n) for n in names] + [21])


def cell(value: float, width: int, digits: int = 2) -> str:
    """Return a number for a table, a dash where there is none."""
    return f"{value:{width}.{digits}f}" if np.isfinite(value) else f"{'-':>{width}}"


def band_names(bands: np.ndarray) -> list[str]:
    """Return the frequency bands as headings [Hz]."""
    return [f"{a:.4g}-{b:.4g}" for a, b in pairwise(bands)]
