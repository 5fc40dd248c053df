"""Checks of arrays that all functions of the package share, with their messages."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from fem.array_types import Complexes, Floats

_Array = TypeVar("_Array", bound=npt.NDArray[Any])


def frozen_copy(array: _Array) -> _Array:
    """Return a copy of an array that cannot be written to."""
    copy = array.copy()
    copy.flags.writeable = False
    return copy


def checked_noise(noise: npt.ArrayLike, shape: tuple[int, ...]) -> Floats:
    """Return noise as a relative number, or as absolute values of a shape."""
    level = np.asarray(noise, dtype=float)
    if not (np.isfinite(level).all() and (level > 0).all()):
        msg = "the noise must be positive and finite: relative as a number, or absolute as an array"
        raise ValueError(msg)
    try:
        return level if level.ndim == 0 else np.broadcast_to(level, shape)
    except ValueError as error:
        msg = f"noise has shape {level.shape}; a number or an array that broadcasts to {shape} is needed"
        raise ValueError(msg) from error


def as_frequency(frequency: npt.ArrayLike) -> Floats:
    """Return frequency lines as a 1-D float array [Hz], finite, non-negative and increasing."""
    lines = np.atleast_1d(np.asarray(frequency, dtype=float))
    if lines.ndim != 1 or lines.size == 0:
        msg = f"frequency has shape {lines.shape}; a non-empty vector (n_freq,) in Hz is needed"
        raise ValueError(msg)
    if not np.isfinite(lines).all() or lines[0] < 0:
        msg = "frequency holds a negative or non-finite value; finite lines from 0 Hz up are allowed"
        raise ValueError(msg)
    steps = np.diff(lines)
    if (steps <= 0).any():
        line = int(np.argmax(steps <= 0)) + 1
        msg = (
            f"frequency line {line} is {lines[line]:g} Hz after {lines[line - 1]:g} Hz; "
            "lines must increase, without repetition"
        )
        raise ValueError(msg)
    return lines


def check_same_lines(frequency: Floats, reference: Floats, name: str, reference_name: str) -> None:
    """Raise ValueError unless two sets of frequency lines are the same, to 1e-9 of the highest."""
    if frequency.shape != reference.shape:
        msg = (
            f"{name} has {frequency.size} frequency lines, against {reference.size} of {reference_name}; "
            "both must share one set of lines"
        )
        raise ValueError(msg)
    apart = np.abs(frequency - reference) > 1e-9 * reference[-1]
    if apart.any():
        line = int(np.argmax(apart))
        msg = (
            f"line {line} of {name} is at {frequency[line]:g} Hz, but in {reference_name} at "
            f"{reference[line]:g} Hz; both must share one set of lines"
        )
        raise ValueError(msg)


def as_lines(
    values: npt.ArrayLike,
    name: str,
    frequency: Floats,
    rows: Sequence[str],
    columns: Sequence[str],
) -> Complexes:
    """Return a complex array (n_freq, n_rows, n_columns) after checking its shape and that it is finite."""
    array = as_shape(values, name, frequency, rows, columns)
    # one pass: a sum is finite if every value is, unless it overflows
    with np.errstate(over="ignore", invalid="ignore"):
        total = array.sum()
    if not np.isfinite(total):
        check_finite(array, name, frequency, rows, columns)
    return array


def as_shape(
    values: npt.ArrayLike,
    name: str,
    frequency: Floats,
    rows: Sequence[str],
    columns: Sequence[str],
) -> Complexes:
    """Return a complex array after checking that its shape is (n_freq, n_rows, n_columns)."""
    array = np.asarray(values, dtype=complex)
    shape = (frequency.size, len(rows), len(columns))
    if array.shape != shape:
        msg = (
            f"{name} has shape {array.shape}; {shape} is needed: "
            f"{shape[0]} frequency lines, {shape[1]} rows and {shape[2]} columns"
        )
        raise ValueError(msg)
    return array


def check_finite(
    array: Complexes, name: str, frequency: Floats, rows: Sequence[str], columns: Sequence[str]
) -> None:
    """Raise ValueError that names the first value of (n_freq, n_rows, n_columns) that is not finite."""
    if (bad := ~np.isfinite(array)).any():
        line, row, column = (int(i) for i in np.argwhere(bad)[0])
        msg = (
            f"{name} holds {int(bad.sum())} values that are not finite, the first at line {line} "
            f"({frequency[line]:g} Hz), row {rows[row]}, column {columns[column]}; "
            "leave out such lines or coordinates (a free body has no receptance at 0 Hz)"
        )
        raise ValueError(msg)


def as_square(values: npt.ArrayLike | None, name: str, n: int) -> Floats:
    """Return a real finite matrix (n, n); None means zero."""
    if values is None:
        return np.zeros((n, n))
    array = np.asarray(values, dtype=float)
    if array.shape != (n, n):
        msg = f"{name} has shape {array.shape}; {(n, n)} is needed"
        raise ValueError(msg)
    if not np.isfinite(array).all():
        msg = f"{name} holds values that are not finite; a real, finite matrix is needed"
        raise ValueError(msg)
    return array


def solve_lines(A: Complexes, B: Complexes) -> Complexes:
    """Return A⁻¹ B at each line.

    With many columns the inverse and one step of refinement give the solution in less time: LAPACK's
    triangular solutions of small matrices are slow, and products are not.
    """
    # Right-hand sides for each unknown from which products cost less than triangular solutions [-]
    if B.shape[-1] <= 4 * A.shape[-1]:
        return np.asarray(np.linalg.solve(A, B), dtype=complex)
    inverse = np.linalg.inv(A)
    X = inverse @ B
    return np.asarray(X + inverse @ (B - A @ X), dtype=complex)
