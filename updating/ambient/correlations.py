"""Correlations of responses that were measured together, of the whole record and block by block."""

from dataclasses import dataclass

import numpy as np

from fem.array_types import Floats
from fem.summary import fields_summary


@dataclass(frozen=True, slots=True, eq=False)
class Correlations:
    """Correlations R_i = E[y(t + i) y_ref(t)ᵀ] of the lags i = 1, 2 and so on.

    Attributes
    ----------
    mean : ndarray (n_lags, n_channels, n_references)
        Of the whole record [product of the channels' units].
    of_block : ndarray (n_blocks, n_lags, n_channels, n_references)
        Of its consecutive blocks; their mean is ``mean``.
    """

    mean: Floats
    of_block: Floats

    __repr__ = fields_summary


def block_correlations(y: Floats, n_lags: int, n_blocks: int, references: list[int]) -> Correlations:
    """Return the correlations of a record and of each of its blocks.

    A block's products y(t + i) y_ref(t) begin in the block and may end in the next one, so that no product
    is lost at its edges and the mean over blocks is the correlation of the record.

    Parameters
    ----------
    y : ndarray (n_samples, n_channels)
        Without mean.
    n_lags, n_blocks : int
    references : list of int
        Channels that every response is correlated with.
    """
    length = (len(y) - n_lags) // n_blocks
    used = n_blocks * length
    past = y[:used, references].reshape(n_blocks, length, -1)
    out = np.empty((n_blocks, n_lags, y.shape[1], len(references)))
    for i in range(n_lags):
        future = y[i + 1 : i + 1 + used].reshape(n_blocks, length, -1)
        out[:, i] = future.transpose(0, 2, 1) @ past / length
    return Correlations(out.mean(axis=0), out)
