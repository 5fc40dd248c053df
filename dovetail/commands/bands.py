"""Columns of errors by frequency band."""

from itertools import pairwise

import numpy as np

from dovetail.report.table import Column


def columns_of_bands(bands: np.ndarray, errors_db: np.ndarray) -> list[Column]:
    """Return a column for each band [Hz], of the errors (n_rows, n_bands) [dB]."""
    names = [f"{a:.4g}-{b:.4g}" for a, b in pairwise(bands)]
    return [
        Column(f"{name} Hz", errors, "dB", ".2f", head=name)
        for name, errors in zip(names, errors_db.T, strict=True)
    ]
