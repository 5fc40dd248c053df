"""Channels and labelled arrays of other packages: tables as pyFBS has them, arrays as sdynpy has them.

Nothing of either need be installed: a table is anything whose columns are found by name (a dictionary of
lists, a pandas DataFrame), and labelled arrays are NumPy's.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from fem.analysis.frf import FRF, FRFKind
from fem.analysis.modes import Modes
from fem.array_types import Complexes, Floats
from fem.io.frf_labels import matrix_of
from fem.io.uff_format import UffError, label_of, parse_label
from updating.measurement.measurement import MOTION, MeasurementError, Sensor

COORDINATE = np.dtype([("node", "u8"), ("direction", "i1")])
"""A degree of freedom in labelled arrays: node, and 1 to 6 for X, Y, Z, RX, RY, RZ, negative if opposite."""

_CHANNEL = ("Direction_1", "Direction_2", "Direction_3")
_SENSOR = ("Orientation_1", "Orientation_2", "Orientation_3")


def sensors_from_table(table: Any, scale: float = 1.0) -> tuple[Sensor, ...]:
    """Return the sensors or exciters of a table of channels, impacts, or triaxial sensors.

    A row of a table of channels or impacts has ``Name``, ``Position_1`` to ``Position_3`` and ``Direction_1``
    to ``Direction_3``. A row of a table of triaxial sensors has ``Orientation_1`` to ``Orientation_3``: the
    angles [degrees] of the sensor's rotation about the fixed axes x, then y, then z, as pyFBS 1.0.7 has it
    (``generate_channels_from_sensors``). Its axes are the columns of R = Rz Ry Rx; each gives a channel,
    with ``x``, ``y``, ``z`` after the sensor's name.

    Parameters
    ----------
    table : mapping of str to sequence, or DataFrame
        Its columns by name; others are passed over.
    scale : float
        Metres in the table's unit of length.

    Raises
    ------
    MeasurementError
        If a column is missing or does not fit, a direction is zero, or two channels have one name.
    """
    columns = [str(c) for c in table]
    place = ("Name", "Position_1", "Position_2", "Position_3")
    turned = _CHANNEL[0] not in columns and _SENSOR[0] in columns
    directions = _SENSOR if turned else _CHANNEL
    missing = [c for c in (*place, *directions) if c not in columns]
    if missing:
        msg = (
            f"the table has no column {', '.join(missing)}; it has {', '.join(columns)}. Directions are "
            f"{', '.join(_CHANNEL)} of channels, or {', '.join(_SENSOR)} of triaxial sensors [degrees]"
        )
        raise MeasurementError(msg)
    names = [str(v) for v in table["Name"]]
    if not names:
        msg = "the table has no rows; one for each channel or sensor is needed"
        raise MeasurementError(msg)
    try:
        xyz, d = (
            np.array([[float(v) for v in table[c]] for c in keys]).T.reshape(len(names), -1)
            for keys in (place[1:], directions)
        )
    except (TypeError, ValueError) as reason:
        msg = f"positions and directions must be numbers, as many as names ({len(names)}): {reason}"
        raise MeasurementError(msg) from None
    axes_of = d.reshape(len(names), -1, 3)
    if turned and not np.isfinite(d).all():
        k = int(np.flatnonzero(~np.isfinite(d).all(axis=1))[0])
        msg = f"sensor '{names[k]}' is turned by {d[k].tolist()} degrees; finite numbers are needed"
        raise MeasurementError(msg)
    if turned and len(names):
        axes_of = (
            scipy.spatial.transform.Rotation.from_euler("xyz", d, degrees=True).as_matrix().transpose(0, 2, 1)
        )
    out: list[Sensor] = []
    for name, point, axes in zip(names, xyz, axes_of, strict=True):
        for axis, word in zip(axes, ("",) if len(axes) == 1 else "xyz", strict=True):
            size = float(np.linalg.norm(axis))
            if not (np.isfinite(point).all() and np.isfinite(size) and size > 0):
                msg = (
                    f"channel '{name}{word}' is at {point.tolist()} in direction {axis.tolist()}; finite "
                    "numbers and a direction that is not zero are needed"
                )
                raise MeasurementError(msg)
            out.append(Sensor(f"{name}{word}", scale * point, axis / size))
    twice = [s.name for k, s in enumerate(out) if s.name in [o.name for o in out[:k]]]
    if twice:
        msg = f"the table has two channels named '{twice[0]}'; names must differ"
        raise MeasurementError(msg)
    return tuple(out)


def table_from_sensors(
    sensors: Sequence[Sensor], quantity: str = "Acceleration", scale: float = 1.0
) -> dict[str, list[Any]]:
    """Return a table of channels or impacts, columns by name; ``pandas.DataFrame(…)`` takes it as it is.

    ``Grouping`` numbers the places from 1: channels at one place share it. A gain is left out.

    Parameters
    ----------
    sensors : sequence of Sensor
    quantity : str
        ``"Acceleration"``, ``"Force"``, … of motions; strain gauges have ``"Strain"``.
    scale : float
        Metres in the table's unit of length.
    """
    places: list[Floats] = []
    groups: list[int] = []
    for s in sensors:
        near = [k for k, p in enumerate(places) if np.allclose(p, s.point, rtol=0, atol=1e-9)]
        if not near:
            places.append(s.point)
        groups.append(1 + (near[0] if near else len(places) - 1))
    table: dict[str, list[Any]] = {
        "Name": [s.name for s in sensors],
        "Description": ["" for _ in sensors],
        "Quantity": [quantity if s.quantity == MOTION else s.quantity.capitalize() for s in sensors],
        "Grouping": groups,
    }
    for i in range(3):
        table[f"Position_{i + 1}"] = [float(s.point[i]) / scale for s in sensors]
    for i in range(3):
        table[f"Direction_{i + 1}"] = [float(s.direction[i]) for s in sensors]
    return table


def frf_from_labelled(
    abscissa: ArrayLike, ordinate: ArrayLike, coordinate: Any, kind: FRFKind | str = FRFKind.ACCELERANCE
) -> FRF:
    """Return FRFs from labelled functions in any arrangement.

    Parameters
    ----------
    abscissa : array_like (n_freq,) or (…, n_freq)
        Frequencies, the same for all functions [Hz].
    ordinate : array_like (…, n_freq)
    coordinate : array_like (…, 2)
        Response and reference of each function: labels such as ``"101X+"``, or structured arrays with
        ``node`` and ``direction``.
    kind : FRFKind or str

    Raises
    ------
    MeasurementError
        If shapes do not fit, frequencies differ, a function comes twice, or the matrix has holes.
    """
    H = np.asarray(ordinate, dtype=complex)
    labels = _labels(coordinate)
    f = np.asarray(abscissa, dtype=float)
    if H.ndim < 1 or labels.shape != (*H.shape[:-1], 2) or f.shape[-1:] != H.shape[-1:]:
        msg = (
            f"ordinates have shape {H.shape}, coordinates {labels.shape} and abscissas {f.shape}; "
            "(…, n_freq), (…, 2) and (n_freq,) or (…, n_freq) are expected"
        )
        raise MeasurementError(msg)
    lines = f.reshape(-1, f.shape[-1])
    if not (lines == lines[0]).all():
        msg = "the functions have different frequencies; give those of one set of lines at a time"
        raise MeasurementError(msg)
    pairs = [(str(o), str(i)) for o, i in labels.reshape(-1, 2)]
    cells = dict(zip(pairs, H.reshape(-1, H.shape[-1]), strict=True))
    if len(cells) < len(pairs):
        twice = next(p for k, p in enumerate(pairs) if p in pairs[:k])
        msg = f"the function {twice[0]}/{twice[1]} comes twice; give one of each"
        raise MeasurementError(msg)
    outputs, inputs, holes = matrix_of(pairs)
    if holes:
        msg = (
            f"{len(outputs)} responses and {len(inputs)} references need {len(outputs) * len(inputs)} "
            f"functions; {', '.join(holes[:5])}{' …' if len(holes) > 5 else ''} are missing"
        )
        raise MeasurementError(msg)
    values = np.array([[cells[o, i] for i in inputs] for o in outputs]).transpose(2, 0, 1)
    return FRF.from_arrays(lines[0], values, kind, outputs, inputs)


def labelled_from_frf(
    frf: FRF, dofs: Mapping[str, str] | None = None
) -> tuple[Floats, Complexes, NDArray[Any]]:
    """Return abscissa (n_freq,), ordinate (n_out, n_in, n_freq) and coordinate (n_out, n_in, 2) of FRFs.

    Parameters
    ----------
    frf : FRF
    dofs : mapping of str to str, optional
        Labels such as ``"101X+"`` for responses and forces that are named otherwise.

    Raises
    ------
    MeasurementError
        For a name that is no degree of freedom.
    """
    outputs, inputs = (
        _coordinates([(dofs or {}).get(x, x) for x in part]) for part in (frf.outputs, frf.inputs)
    )
    coordinate = np.empty((len(outputs), len(inputs), 2), dtype=COORDINATE)
    coordinate[:, :, 0], coordinate[:, :, 1] = outputs[:, None], inputs[None, :]
    return frf.frequency.copy(), np.ascontiguousarray(frf.H.transpose(1, 2, 0)), coordinate


def modes_from_labelled(
    frequency: ArrayLike, shape_matrix: ArrayLike, coordinate: Any, damping: ArrayLike | None = None
) -> Modes:
    """Return modes from labelled shapes.

    Parameters
    ----------
    frequency, damping : array_like (n_modes,)
        [Hz], and ratios [-].
    shape_matrix : array_like (n_modes, n_dof)
    coordinate : array_like (n_dof,) or (n_modes, n_dof)
        As in :func:`frf_from_labelled`; the same for all modes.

    Raises
    ------
    MeasurementError
        If shapes do not fit, or modes have different degrees of freedom.
    """
    f, shapes = np.array(frequency, dtype=float, ndmin=1), np.array(shape_matrix, ndmin=2)
    labels = _labels(coordinate)
    rows = labels.reshape(-1, labels.shape[-1])
    zeta = None if damping is None else np.array(damping, dtype=float, ndmin=1)
    fits = shapes.shape == (f.size, rows.shape[1]) and (zeta is None or zeta.shape == f.shape)
    if not fits or not (rows == rows[0]).all():
        msg = (
            f"{f.size} frequencies, shapes {shapes.shape} and coordinates {labels.shape}; (n_modes,), "
            "(n_modes, n_dof) and (n_dof,) are expected, the same coordinates for all modes"
        )
        raise MeasurementError(msg)
    order = np.argsort(f, kind="stable")
    return Modes(
        f[order], shapes.T[:, order], None if zeta is None else zeta[order], tuple(str(x) for x in rows[0])
    )


def labelled_from_modes(
    modes: Modes, dofs: Mapping[str, str] | None = None
) -> tuple[Floats, NDArray[Any], NDArray[Any]]:
    """Return frequency (n_modes,), shape matrix (n_modes, n_dof) and coordinate (n_dof,) of labelled modes.

    Raises
    ------
    MeasurementError
        For modes without labels, or a name that is no degree of freedom.
    """
    if not modes.labels:
        msg = "the modes have no labels; labelled arrays need one for each row of the shapes"
        raise MeasurementError(msg)
    coordinate = _coordinates([(dofs or {}).get(x, x) for x in modes.labels])
    return modes.frequency.copy(), np.ascontiguousarray(modes.shapes.T), coordinate


def _labels(coordinate: Any) -> NDArray[np.str_]:
    """Return labels of structured or written coordinates, checked."""
    given = np.asarray(coordinate)
    try:
        if given.dtype.names:
            flat = [
                label_of(int(n), int(d))
                for n, d in zip(given["node"].flat, given["direction"].flat, strict=True)
            ]
        else:
            flat = [label_of(*parse_label(str(x))) for x in given.flat]
    except UffError as reason:
        raise MeasurementError(str(reason)) from None
    return np.array(flat, dtype=str).reshape(given.shape)


def _coordinates(labels: Sequence[str]) -> NDArray[Any]:
    try:
        return np.array([parse_label(x) for x in labels], dtype=COORDINATE)
    except UffError as reason:
        msg = f"{reason}; name its degree of freedom in dofs, such as {{'U1z': '12Z+'}}"
        raise MeasurementError(msg) from None
