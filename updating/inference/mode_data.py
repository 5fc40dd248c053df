"""Measured natural frequencies and shapes, checked and placed on a model."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fem.analysis.modes import Modes
from fem.model import Model, ModelError
from updating.inference.places import Places, place_vectors

COMMON = 0.5
"""Part of the variance of a model's errors of frequencies that all modes share: too stiff throughout [-]."""


@dataclass(frozen=True, slots=True, eq=False)
class ModeData:
    """Measured natural frequencies, and shapes if there are any.

    Attributes
    ----------
    frequency : ndarray (n,)
        Rising [Hz].
    covariance : ndarray (n, n)
        Of their logarithms, the model's error included [-].
    shapes : ndarray (n_out, n) or None
        Real, each of length 1; NaN where a mode was not measured.
    shape_std : ndarray (n,)
        Standard deviation of each component of a shape, relative to the root mean square of them all [-].
    rows : ndarray (n_dof, n_out)
        Sensors as combinations of DOFs.
    numbers : ndarray of int (n,) or None
        Which modes of the model at the start they are, counted from 0 without rigid-body modes: these are
        followed. Without numbers and shapes, modes belong together in the order of their frequencies.
    zeta : ndarray (n,) or None
        Damping ratios [-].
    close : float
        Modes whose frequencies differ by less than this, relatively, are compared as a space [-].
    """

    frequency: NDArray[np.float64]
    covariance: NDArray[np.float64]
    shapes: NDArray[np.float64] | None
    shape_std: NDArray[np.float64]
    rows: NDArray[np.float64]
    numbers: NDArray[np.int64] | None
    zeta: NDArray[np.float64] | None
    close: float

    def whitening(self, kept: NDArray[np.bool_]) -> NDArray[np.float64]:
        """Return W (n, n) with W C Wᵀ = 1 for the modes kept, C their covariance; others are scaled alone."""
        W = np.diag(1 / np.sqrt(np.diag(self.covariance)))
        block = np.ix_(kept, kept)
        W[block] = np.linalg.inv(np.linalg.cholesky(self.covariance[block]))
        return W

    @property
    def n_data(self) -> int:
        """Number of independent residuals of frequencies and shapes: a shape's length says nothing."""
        n = len(self.frequency)
        return n if self.shapes is None else int(np.isfinite(self.shapes).sum())


def mode_data(
    model: Model,
    frequency: ArrayLike | None = None,
    shapes: ArrayLike | None = None,
    *,
    modes: Modes | None = None,
    outputs: Places = (),
    numbers: Sequence[int] | None = None,
    frequency_std: ArrayLike = 1e-3,
    shape_std: ArrayLike = 0.03,
    model_error: float = 1e-3,
    close: float = 0.01,
) -> ModeData:
    """Check measured modes and place them on a model.

    Parameters
    ----------
    model : Model
    frequency : array_like (n,), optional
        Natural frequencies, without rigid-body modes [Hz].
    shapes : array_like (n_out, n), optional
        Shapes at the outputs; complex ones are turned to be as real as they can be. NaN is a gap: an output
        at which that mode was not measured.
    modes : Modes, optional
        Both, and damping ratios, in place of bare arrays; those with 0 Hz are left out.
    outputs : places
        Where the shapes are measured.
    numbers : sequence of int, optional
        Which of the model's elastic modes the frequencies belong to, counted from 0, where there are no
        shapes to tell.
    frequency_std, shape_std : float or array_like (n,)
        Standard deviations: of frequencies, relative [-]; of a component of a shape, relative to the root
        mean square of the shape [-].
    model_error : float
        Relative standard deviation with which even the right parameters meet a frequency; half of its
        variance is common to all [-].
    close : float
        Modes whose frequencies differ by less, relatively, are compared as a space [-].

    Raises
    ------
    ModelError
        If arrays do not fit one another, or values are not finite and positive.
    """
    labels: Sequence[str] | None = None
    zeta = None
    if modes is not None:
        elastic = modes.frequency > 0
        frequency, shapes = modes.frequency[elastic], modes.shapes[:, elastic]
        zeta = None if modes.zeta is None else np.asarray(modes.zeta, dtype=float)[elastic]
        labels = modes.labels or None
        if not shapes.shape[0]:
            shapes = None
    f = np.array(frequency, dtype=float, ndmin=1)
    if f.ndim != 1 or not f.size or not (np.isfinite(f) & (f > 0)).all():
        msg = f"the measured frequencies are {f.tolist()[:8]}; at least one is needed, all positive [Hz]"
        raise ModelError(msg)
    if shapes is None and numbers is None and (np.diff(f) < 0).any():
        msg = (
            f"the measured frequencies {f.tolist()[:8]} Hz do not rise; without shapes they are those of the "
            "model in their order: sort them, or say which modes they are (numbers=…)"
        )
        raise ModelError(msg)
    rows = np.zeros((model.n_dof, 0))
    psi = None
    if shapes is not None:
        rows, _ = place_vectors(model, outputs, labels)
        psi = np.asarray(shapes)
        if psi.shape != (rows.shape[1], f.size):
            msg = (
                f"the shapes have shape {psi.shape}; {rows.shape[1]} outputs and {f.size} frequencies need "
                f"({rows.shape[1]}, {f.size})"
            )
            raise ModelError(msg)
        if len(psi) < 2:
            msg = "a shape at one output says nothing; leave the shapes out"
            raise ModelError(msg)
        _check_gaps(psi, f)
        psi = _real(psi)
    if numbers is not None and len(numbers) != f.size:
        msg = f"{len(numbers)} numbers of modes are given for {f.size} frequencies"
        raise ModelError(msg)
    order = np.argsort(f, kind="stable")
    each = [np.broadcast_to(np.asarray(s, dtype=float), f.shape) for s in (frequency_std, shape_std)]
    if not all((np.isfinite(s) & (s >= 0)).all() for s in each) or not (each[0] + model_error > 0).all():
        msg = (
            "standard deviations must be finite and not negative, those of frequencies or the model's above 0"
        )
        raise ModelError(msg)
    return ModeData(
        f[order],
        np.diag(each[0][order] ** 2)
        + model_error**2 * (1 - COMMON) * np.eye(f.size)
        + model_error**2 * COMMON,
        None if psi is None else psi[:, order],
        np.maximum(each[1][order], 1e-6),
        rows,
        None if numbers is None else np.asarray(numbers, dtype=np.int64)[order],
        None if zeta is None or not (zeta > 0).all() else zeta[order],
        close,
    )


def _check_gaps(shapes: NDArray[np.number], frequency: NDArray[np.float64]) -> None:
    """Refuse infinite values, and modes that were measured at one output or none."""
    if np.isinf(shapes).any():
        i, k = np.argwhere(np.isinf(shapes))[0]
        msg = (
            f"the shape at {frequency[k]:.6g} Hz is infinite at output {i}, counted from 0; values are "
            "finite, or NaN where a mode was not measured"
        )
        raise ModelError(msg)
    n = (~np.isnan(shapes)).sum(axis=0)
    if (n < 2).any():
        k = int(np.argmin(n))
        msg = (
            f"the shape at {frequency[k]:.6g} Hz has values at {n[k]} of {len(shapes)} outputs; two or more "
            "are needed: leave the mode out"
        )
        raise ModelError(msg)


def _real(shapes: NDArray[np.number]) -> NDArray[np.float64]:
    """Return shapes of length 1, turned in the complex plane so that most of them is real; gaps stay NaN."""
    known = ~np.isnan(shapes)
    shapes = np.where(known, shapes, 0)
    turn = np.exp(-0.5j * np.angle((shapes**2).sum(axis=0)))
    out = np.real(shapes * turn)
    return np.where(known, out / np.maximum(np.linalg.norm(out, axis=0), 1e-300), np.nan)
