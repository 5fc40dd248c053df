"""From measured translations to all coordinates of a joint: virtual point, SEREP, SEMM.

Rotations cannot be measured well. They come from rigid motion near the joint (virtual point) or from a model
(SEREP, SEMM). The result names the method: `ExpandedFRF.method`, and `SubstructureFRF.expanded_by`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fem.array_types import Complexes, Floats
from joint._checks import as_frequency, as_lines, frozen_copy
from joint.interface import CoordinateSet, coordinates_of


class ExpansionError(ValueError):
    """Measured FRFs that do not determine the requested coordinates; the message names those lost."""


@dataclass(frozen=True, slots=True, eq=False)
class ExpandedFRF:
    """Hold receptances at more coordinates than were measured.

    Attributes
    ----------
    frequency : (n_freq,) array
        Lines [Hz].
    outputs, inputs : CoordinateSet
    H : (n_freq, n_out, n_in) complex array
        Receptances x/f [m/N, rad/N, m/(N m), rad/(N m)].
    method : str
        Method of the expansion.
    condition : float
        Largest 2-norm condition number of the matrices inverted.
    consistency : (n_freq,) array
        ‖H measured as the expansion reproduces it‖ / ‖H measured‖ [-]: below 1 where the expansion's motions
        cannot follow the data.
    """

    frequency: Floats
    outputs: CoordinateSet
    inputs: CoordinateSet
    H: Complexes
    method: str
    condition: float
    consistency: Floats

    def __post_init__(self) -> None:
        for name in ("frequency", "H", "consistency"):
            object.__setattr__(self, name, frozen_copy(getattr(self, name)))


def rigid_rows(places: npt.ArrayLike, directions: npt.ArrayLike, point: npt.ArrayLike) -> Floats:
    """Return the readings of sensors for rigid motions of a point, (n, 6): u = eᵀ (q + θ × r).

    Parameters
    ----------
    places, directions : (n, 3) array_like
        Coordinates [m] and unit vectors of sensors, or of forces.
    point : (3,) array_like
        The virtual point [m].
    """
    r = np.atleast_2d(np.asarray(places, dtype=float)) - np.asarray(point, dtype=float)
    e = np.atleast_2d(np.asarray(directions, dtype=float))
    return np.hstack([e, np.cross(r, e)])


def virtual_point(
    frequency: npt.ArrayLike,
    H: npt.ArrayLike,
    R_out: npt.ArrayLike | CoordinateSet,
    R_in: npt.ArrayLike | CoordinateSet,
    node: str,
    *,
    weight_out: npt.ArrayLike | None = None,
    weight_in: npt.ArrayLike | None = None,
) -> ExpandedFRF:
    """Transform FRFs of sensors and forces around a point to that point's six coordinates.

    q = (RᵀWR)⁻¹ RᵀW u, m = Rᵀ f:   H_q = T_u H T_f, T_u = (RᵀWR)⁻¹ RᵀW, T_f = W R (RᵀWR)⁻¹

    van der Seijs, van den Bosch, Rixen & de Klerk, Proc. COMPDYN 2013. A joint with several nodes of one side
    becomes a joint with one: give the rows of all of them.

    Parameters
    ----------
    frequency : (n_freq,) array_like
        Lines [Hz].
    H : (n_freq, n_out, n_in) array_like
        Receptances of the sensors to the forces.
    R_out, R_in : (n_out, 6), (n_in, 6) array_like, or CoordinateSet
        `rigid_rows` of sensors and of forces. Where only one of them lies at the point, give the coordinates
        of the other: they are kept.
    node : str
        Name of the virtual point.
    weight_out, weight_in : array_like, optional
        Positive weights of sensors and forces; 1 unless given.

    Raises
    ------
    ValueError
        If shapes do not fit or a value is not finite.
    ExpansionError
        If sensors or forces do not determine the six motions (the lacking one is named), rows or weights do
        not fit, or coordinates are kept on both sides.
    """
    lines = as_frequency(frequency)
    if isinstance(R_out, CoordinateSet) and isinstance(R_in, CoordinateSet):
        msg = "coordinates are kept on both sides; nothing is left for a virtual point"
        raise ExpansionError(msg)
    outputs, Ro, T_u, cond_out = _side(R_out, weight_out, "sensors", node)
    inputs, Ri, T_f, cond_in = _side(R_in, weight_in, "forces", node)
    data = as_lines(H, "H", lines, [f"o{i}" for i in range(len(Ro))], [f"i{i}" for i in range(len(Ri))])
    q = T_u @ data @ T_f.T
    consistency = _kept(Ro @ q @ Ri.T, data)
    return ExpandedFRF(lines, outputs, inputs, q, "virtual point", max(cond_out, cond_in), consistency)


def _kept(part: Complexes, data: Complexes) -> Floats:
    """Return the size of a part of FRFs over theirs, line by line; 1 without any."""
    size = np.linalg.norm(data, axis=(1, 2))
    return np.divide(np.linalg.norm(part, axis=(1, 2)), size, out=np.ones(len(size)), where=size > 0)


def _side(
    rows: npt.ArrayLike | CoordinateSet, weight: npt.ArrayLike | None, what: str, node: str
) -> tuple[CoordinateSet, Floats, Floats, float]:
    """Return coordinates, the map to their sensors, its inverse, and the condition number."""
    if isinstance(rows, CoordinateSet):
        unit = np.eye(len(rows))
        return rows, unit, unit, 1.0
    R = np.asarray(rows, dtype=float)
    if R.ndim != 2 or R.shape[1] != 6 or not np.isfinite(R).all():
        msg = f"the rows of the {what} have shape {R.shape}; (n, 6), finite, is needed, as of rigid_rows"
        raise ExpansionError(msg)
    W = np.ones(len(R)) if weight is None else np.asarray(weight, dtype=float)
    if W.shape != (len(R),) or not (np.isfinite(W).all() and (W > 0).all()):
        msg = f"the weights of the {what} have shape {W.shape}; {len(R)} positive, finite ones are needed"
        raise ExpansionError(msg)
    T, condition = _reduction(R, W, what, node)
    return coordinates_of([node]), R, T, condition


def _reduction(R: Floats, weight: Floats, what: str, node: str) -> tuple[Floats, float]:
    # rotations in units of the mean arm, so that the condition depends on geometry only
    arm = float(np.sqrt((R[:, 3:] ** 2).sum() / max((R[:, :3] ** 2).sum(), 1e-300))) or 1.0
    scale = np.array([1, 1, 1, arm, arm, arm])
    s = np.linalg.svd(R / scale, compute_uv=False)
    if len(R) < 6 or s[-1] < 1e-6 * s[0]:
        Vt = np.linalg.svd(np.vstack([R / scale, np.zeros((6, 6))]))[2]
        lost = ("x", "y", "z", "rx", "ry", "rz")[int(np.argmax(np.abs(Vt[-1])))]
        msg = f"{len(R)} {what} do not determine the motion of '{node}' in {lost}; place more, off one line"
        raise ExpansionError(msg)
    RW = R.T * weight
    return np.asarray(np.linalg.solve(RW @ R, RW), dtype=float), float(s[0] / s[-1])


def expand_serep(
    frequency: npt.ArrayLike,
    H: npt.ArrayLike,
    shapes_out: npt.ArrayLike,
    shapes_in: npt.ArrayLike,
    full_out: npt.ArrayLike,
    full_in: npt.ArrayLike,
    outputs: CoordinateSet,
    inputs: CoordinateSet,
) -> ExpandedFRF:
    """Expand FRFs on the mode shapes of a model: SEREP.

    H_full = Φ_full Φ_out⁺ H (Φ_in⁺)ᵀ Φ_fullᵀ

    O'Callahan, Avitabile & Riemer, Proc. IMAC VII (1989) 29-37. Only the span of the modes is kept: take as
    many as the sensors tell apart, and more than lie in the band.

    Parameters
    ----------
    frequency : (n_freq,) array_like
        Lines [Hz].
    H : (n_freq, n_out, n_in) array_like
        Measured receptances.
    shapes_out, shapes_in : (n_out, m), (n_in, m) array_like
        Mode shapes of the model at the sensors and at the forces.
    full_out, full_in : (len(outputs), m), (len(inputs), m) array_like
        The same modes at the coordinates wanted.
    outputs, inputs : CoordinateSet
        Coordinates wanted.

    Raises
    ------
    ExpansionError
        If there are fewer sensors or forces than modes, or they do not tell the modes apart.
    """
    lines = as_frequency(frequency)
    So, Si = np.asarray(shapes_out, dtype=float), np.asarray(shapes_in, dtype=float)
    data = as_lines(H, "H", lines, [f"o{i}" for i in range(len(So))], [f"i{i}" for i in range(len(Si))])
    inverse_out, cond_out = _modal_inverse(So, "sensors")
    inverse_in, cond_in = _modal_inverse(Si, "forces")
    modal = inverse_out @ data @ inverse_in.T
    full = np.asarray(full_out, dtype=float) @ modal @ np.asarray(full_in, dtype=float).T
    consistency = _kept(So @ modal @ Si.T, data)
    return ExpandedFRF(lines, outputs, inputs, full, "SEREP", max(cond_out, cond_in), consistency)


def _modal_inverse(shapes: Floats, what: str) -> tuple[Floats, float]:
    n, m = shapes.shape
    unit = shapes / np.maximum(np.linalg.norm(shapes, axis=0), 1e-300)
    s = np.linalg.svd(unit, compute_uv=False)
    if n < m or s[-1] < 1e-6 * s[0]:
        if n < m:
            msg = f"{n} {what} cannot distinguish {m} modes; at least {m} are needed, or fewer modes"
            raise ExpansionError(msg)
        v = np.abs(np.linalg.svd(unit)[2][-1])
        words = ", ".join(str(i + 1) for i in np.argsort(-v)[:3] if v[i] > 0.3)
        msg = f"the {what} do not distinguish modes {words}; add some where these differ, or leave modes out"
        raise ExpansionError(msg)
    return np.asarray(np.linalg.pinv(shapes), dtype=float), float(s[0] / s[-1])


def expand_semm(
    frequency: npt.ArrayLike,
    H: npt.ArrayLike,
    model: npt.ArrayLike,
    outputs: CoordinateSet,
    inputs: CoordinateSet,
    measured_outputs: CoordinateSet,
    measured_inputs: CoordinateSet,
    *,
    rcond: float = 1e-10,
) -> ExpandedFRF:
    """Mix measured FRFs into a model's: SEMM with a fully extended interface.

    H = Y - Y (Y_o)⁺ (Y_oi - H_measured) (Y_i)⁺ Y

    with the model Y at all coordinates, Y_o its rows at the measured outputs, Y_i its columns at the measured
    inputs, Y_oi both.

    Klaassen, van der Seijs & de Klerk, Mechanical Systems and Signal Processing 105 (2018) 90-112: at the
    measured coordinates the result is the measurement, elsewhere the model corrected by it.

    Parameters
    ----------
    frequency : (n_freq,) array_like
        Lines [Hz].
    H : (n_freq, n_out, n_in) array_like
        Measured receptances at ``measured_outputs`` and ``measured_inputs``.
    model : (n_freq, len(outputs), len(inputs)) array_like
        The model's receptances at all coordinates, the measured ones among them.
    outputs, inputs : CoordinateSet
        All coordinates.
    measured_outputs, measured_inputs : CoordinateSet
    rcond : float
        Singular values below this part of the largest at a line are left out.

    Raises
    ------
    ValueError
        If a measured coordinate is not among those of the model, or shapes do not fit.
    """
    lines = as_frequency(frequency)
    data = as_lines(H, "H", lines, measured_outputs.labels, measured_inputs.labels)
    Y = as_lines(model, "model", lines, outputs.labels, inputs.labels)
    o, i = outputs.positions(measured_outputs.labels), inputs.positions(measured_inputs.labels)
    rows, columns = Y[:, o], Y[:, :, i]
    left = np.linalg.pinv(rows, rcond=rcond)  # inputs from measured outputs
    right = np.linalg.pinv(columns, rcond=rcond)
    full = Y - Y @ left @ (rows[:, :, i] - data) @ right @ Y
    again = full[:, o][:, :, i]
    s = np.linalg.svd(rows, compute_uv=False)
    condition = float((s[:, 0] / np.maximum(s[:, -1], 1e-300)).max())
    size = np.linalg.norm(data, axis=(1, 2))
    off = np.linalg.norm(again - data, axis=(1, 2))
    consistency = 1 - np.divide(off, size, out=np.zeros(lines.size), where=size > 0)
    return ExpandedFRF(
        lines, outputs, inputs, np.asarray(full, dtype=complex), "SEMM", condition, consistency
    )
