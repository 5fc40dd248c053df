"""Measured arrays, FRFs and modes as data of fits, checked and with their places on a model."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fem.analysis.frf import FRF, FRFKind
from fem.analysis.modes import Modes
from fem.analysis.selection import Selection, dof_vectors
from fem.array_types import Floats
from fem.model import Model, ModelError
from updating.inference.mode_targets import ModeTargets
from updating.measurement.measurement import Combination, Measurement, Sensor

# Places of responses and forces as channels of a measurement ------------------------------------------------


Places = Selection | Sequence[Sensor] | Mapping[str, tuple[int, str]]
"""Where responses are measured: DOF numbers, (point, direction) pairs, rows (n, n_dof), sensors, or (point,
direction) by label."""


def channels(model: Model, places: Places, names: Sequence[str] | None = None) -> tuple[Sensor, ...]:
    """Return places as sensors; ``names`` picks labelled ones, in their order.

    Raises
    ------
    ModelError
        For a label without a place, and for coordinates inside of effects, which a finer mesh has not.
    """
    labels: Sequence[str] | None = None
    given: Any = places
    if isinstance(places, Mapping):
        labels = tuple(places) if names is None else tuple(names)
        missing = [name for name in labels if name not in places]
        if missing:
            msg = f"there is no place for {', '.join(missing[:6])}; places are given for {', '.join(places)}"
            raise ModelError(msg)
        given = [places[name] for name in labels]
    sensors = [p for p in given if isinstance(p, Sensor)]
    if sensors:
        if len(sensors) != len(given):
            msg = f"{len(given) - len(sensors)} of {len(given)} places are no sensors; give one kind only"
            raise ModelError(msg)
        by_name = {s.name: s for s in sensors}
        return tuple(by_name[n] for n in names) if names and set(names) <= set(by_name) else tuple(sensors)
    columns, dof_names = dof_vectors(model, given)
    n = 6 * model.mesh.n_points
    if columns[n:].any():
        msg = f"a place is a coordinate inside of an effect; DOFs of points are 0 to {n - 1}"
        raise ModelError(msg)
    nowhere = np.zeros(3)
    return tuple(
        Combination(name, nowhere, nowhere, factors=row)
        for name, row in zip(_distinct(labels or dof_names), columns[:n].T, strict=True)
    )


def _distinct(names: Sequence[str]) -> list[str]:
    """Return names of which none is there twice."""
    return [n if n not in names[:k] else f"{n} ({k + 1})" for k, n in enumerate(names)]


# ------------------------------------------------------------------------------------------------------------


def frf_data(
    model: Model,
    frf: FRF | Measurement | ArrayLike,
    *,
    lines: ArrayLike | None = None,
    outputs: Places | None = None,
    inputs: Places | None = None,
    kind: FRFKind | str = FRFKind.ACCELERANCE,
    noise: ArrayLike | None = None,
) -> Measurement:
    """Return FRFs as a measurement with places on a model.

    Parameters
    ----------
    model : Model
    frf : FRF, Measurement or array_like (n_freq, n_out, n_in)
        NaN is where nothing was measured, in bare arrays.
    lines : array_like (n_freq,)
        Frequencies of a bare array [Hz].
    outputs, inputs : places
        Of a measurement its own unless given.
    kind : FRFKind or str
        Of a bare array.
    noise : float or array_like, optional
        Relative standard deviation of the real and of the imaginary part, one number or one that broadcasts
        to the array; that of the measurement, or else estimated from the roughness of the lines, unless given
        [-].

    Raises
    ------
    ModelError
        If arrays and places are missing or do not fit one another.
    """
    given: dict[str, Any] = {}
    if isinstance(frf, Measurement):
        if outputs is None and inputs is None:
            return frf if noise is None else replace(frf, scatter=_level(noise, frf.frf.H.shape))
        outputs = frf.sensors if outputs is None else outputs
        inputs = frf.excitations if inputs is None else inputs
        known = (
            "name",
            "phase",
            "coherence",
            "averages",
            "scatter",
            "compared",
            "held_out",
            "viscous",
            "errors",
        )
        given = {key: getattr(frf, key) for key in known}
        frf = frf.frf
    labelled = isinstance(frf, FRF)
    if not isinstance(frf, FRF):
        if lines is None:
            msg = "bare FRFs need their lines [Hz]: lines=…"
            raise ModelError(msg)
        H = np.array(frf, dtype=complex)
        known = np.isfinite(H)
        frf = FRF.from_arrays(lines, np.where(known, H, 0.0), kind)
        if not known.all():
            given["compared"] = np.where(known, np.nan, 0.0).reshape(frf.H.shape)
        if noise is not None and H.ndim < 3 and np.shape(noise) == H.shape:
            noise = np.reshape(noise, frf.H.shape)
    if outputs is None or inputs is None:
        msg = "FRFs need the places of their responses and forces: outputs=…, inputs=…"
        raise ModelError(msg)
    sensors = channels(model, outputs, frf.outputs if labelled else None)
    excitations = channels(model, inputs, frf.inputs if labelled else None)
    if frf.H.shape[1:] != (len(sensors), len(excitations)):
        msg = (
            f"the FRFs have shape {frf.H.shape}, but {len(sensors)} outputs and {len(excitations)} inputs "
            "have places"
        )
        raise ModelError(msg)
    if noise is not None:
        given["scatter"] = _level(noise, frf.H.shape)
    outs, ins = (tuple(s.name for s in part) for part in (sensors, excitations))
    frf = replace(
        frf,
        outputs=outs,
        inputs=ins,
        strain=tuple(name for name, old in zip(outs, frf.outputs, strict=True) if old in frf.strain),
        base=tuple(name for name, old in zip(ins, frf.inputs, strict=True) if old in frf.base),
    )
    return Measurement(frf, sensors, excitations, **given)


def _level(noise: ArrayLike, shape: tuple[int, ...]) -> Floats:
    given = np.asarray(noise, dtype=float)
    try:
        level = np.broadcast_to(given, shape)
    except ValueError:
        msg = f"the noise has shape {given.shape}; a number or that of the FRFs, {shape}, is needed"
        raise ModelError(msg) from None
    if np.isinf(level).any() or (level < 0).any():
        msg = "the noise must be finite and not negative: the relative standard deviation [-]"
        raise ModelError(msg)
    return level


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
    zeta_std: ArrayLike = 0.1,
) -> ModeTargets:
    """Return measured modes as data of fits.

    Parameters
    ----------
    model : Model
    frequency : array_like (n,), optional
        Natural frequencies, without rigid-body modes [Hz].
    shapes : array_like (n_out, n), optional
        Shapes at the outputs. NaN is a gap: an output at which that mode was not measured.
    modes : Modes, optional
        Both, and damping ratios, in place of bare arrays; those with 0 Hz are left out.
    outputs : places
        Where the shapes are measured.
    numbers : sequence of int, optional
        Which of the model's elastic modes the frequencies belong to, counted from 0, where there are no
        shapes to tell.
    frequency_std, shape_std, zeta_std : float or array_like (n,)
        Standard deviations: of frequencies and damping ratios, relative [-]; of a component of a shape,
        relative to the root mean square of the shape [-].

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
        given = (np.asarray(s, dtype=float) for s in (frequency_std, shape_std, zeta_std))
        frequency_std, shape_std, zeta_std = (s[elastic] if s.shape == elastic.shape else s for s in given)
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
    if numbers is not None and len(numbers) != f.size:
        msg = f"{len(numbers)} numbers of modes are given for {f.size} frequencies"
        raise ModelError(msg)
    if numbers is not None and min(numbers, default=0) < 0:
        msg = f"the modes' numbers are {list(numbers)}; they count from 0"
        raise ModelError(msg)
    deviations = [np.broadcast_to(np.asarray(s, dtype=float), f.shape) for s in (frequency_std, shape_std)]
    if not all((np.isfinite(s) & (s > 0)).all() for s in deviations):
        msg = "standard deviations must be finite and positive"
        raise ModelError(msg)
    sensors: tuple[Sensor, ...] = ()
    psi = None
    if shapes is not None:
        sensors, psi = channels(model, outputs, labels), np.asarray(shapes)
        _check_shapes(psi, f, len(sensors))
    return ModeTargets.of(
        f,
        deviations[0],
        zeta=zeta,
        zeta_std=np.asarray(zeta_std, dtype=float),
        shapes=psi,
        shape_std=deviations[1],
        sensors=sensors,
        numbers=numbers,
    )


def _check_shapes(shapes: NDArray[np.number], frequency: Floats, n_out: int) -> None:
    """Refuse shapes of another size, infinite values, and modes that were measured at one output or none."""
    if shapes.shape != (n_out, frequency.size):
        msg = (
            f"the shapes have shape {shapes.shape}; {n_out} outputs and {frequency.size} frequencies need "
            f"({n_out}, {frequency.size})"
        )
        raise ModelError(msg)
    if len(shapes) < 2:
        msg = "a shape at one output has no information; omit the shapes"
        raise ModelError(msg)
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
