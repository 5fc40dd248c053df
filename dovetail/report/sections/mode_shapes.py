"""Mode shapes of the reported model, with the measured ones."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dovetail.result import RunResult, by_frfs, by_modes_alone
from fem.analysis.modes import Modes
from updating.diagnosis.diagnosis import Diagnosis
from updating.diagnosis.fitted_modes import FittedModePair, modes_of, most_changed, pair_modes
from updating.diagnosis.reported_modes import ReportedModes
from updating.diagnosis.verdict import EFFECT, Verdict
from updating.inference.mode_targets import ModeTargets
from updating.measurement.measurement import MOTION, Sensor, motions_of
from viz.interactive.modes import MeasuredShape
from viz.shapes import real_shape


@dataclass(frozen=True, slots=True, eq=False)
class Shapes:
    """Modes that are shown.

    Attributes
    ----------
    modes : Modes
    headings : mapping of int to str
        Of the modes that are shown, by number.
    measured : mapping of int to MeasuredShape
    changed : FittedModePair or None
        The mode that the found effects change most.
    """

    modes: Modes
    headings: Mapping[int, str]
    measured: Mapping[int, MeasuredShape]
    changed: FittedModePair | None = None


def shapes_of(result: RunResult[Verdict]) -> Shapes:
    """Return the elastic modes in the band of FRFs, or the partners of measured modes."""
    d, reported = result.diagnosis, result.reported
    if by_frfs(d):
        _, without, modes = modes_of(d)
        pairs = pair_modes(without, modes, d.model.mesh.n_points) if d.verdict == EFFECT else ()
        headings = {k: heading_of(modes, k) for k in range(modes.n_rigid, modes.n_modes)}
        return Shapes(modes, headings, quadrature_shapes(d, modes), most_changed(pairs))
    assert by_modes_alone(d)
    assert reported is not None
    modes, partner = reported.modes, reported.partner
    headings = {
        int(k): f"{heading_of(modes, int(k))}; measured mode {i + 1}" for i, k in enumerate(partner) if k >= 0
    }
    return Shapes(modes, headings, partner_shapes(d.problem.targets, reported))


def heading_of(modes: Modes, k: int) -> str:
    """Return number, frequency and damping of a mode."""
    zeta = None if modes.zeta is None else float(modes.zeta[k])
    return mode_heading(k, modes.n_rigid, float(modes.frequency[k]), zeta)


def mode_heading(k: int, n_rigid: int, frequency: float, zeta: float | None) -> str:
    """Return the heading of an elastic mode, counted from 1 without rigid-body modes."""
    text = f"Elastic mode {k - n_rigid + 1}: {frequency:.4g} Hz"
    if frequency < 0:
        return f"{text}, a motion that grows"
    return text if zeta is None else f"{text}, damping {100 * zeta:.2g} %"


def partner_shapes(t: ModeTargets, reported: ReportedModes) -> dict[int, MeasuredShape]:
    """Return the measured shapes by the number of the mode of the model, at the sensors that have them."""
    if not t.has_shapes:
        return {}
    pairs = ((int(k), shape_at(t.sensors, t.shapes[:, i])) for i, k in enumerate(reported.partner) if k >= 0)
    return {k: shape for k, shape in pairs if shape is not None}


def shape_at(sensors: Sequence[Sensor], shape: NDArray[np.number]) -> MeasuredShape | None:
    """Return the places and displacement vectors of a measured shape (n_sensors,); None without motions."""
    points, directions = (np.array([getattr(s, key) for s in sensors]) for key in ("point", "direction"))
    known = np.isfinite(shape) & np.array([s.quantity == MOTION for s in sensors])
    if not known.any():
        return None
    return points[known], real_shape(shape[known])[:, None] * directions[known]


def quadrature_shapes(d: Diagnosis, modes: Modes) -> dict[int, MeasuredShape]:
    """Return the measured motion near each natural frequency, by the mode's number.

    At the line nearest to it, the imaginary part of the receptances: there a mode with little damping answers
    in quadrature. Of several forces it is the part that most of them share, the first left singular vector.
    """
    sensors = motions_of(d.problem.data.measurement.sensors)
    if (
        not d.problem.data.phase or not sensors
    ):  # amplitudes do not tell which sensors move against each other
        return {}
    frf = d.measured.select([s.name for s in sensors], lines=d.measured.frequency > 0).as_kind("receptance")
    out: dict[int, MeasuredShape] = {}
    for k in range(modes.n_rigid, modes.n_modes):
        f = modes.frequency[k]
        if frf.frequency[0] <= f <= frf.frequency[-1]:
            line = int(np.argmin(np.abs(frf.frequency - f)))
            points, directions = (
                np.array([getattr(s, key) for s in sensors]) for key in ("point", "direction")
            )
            out[k] = points, np.linalg.svd(frf.H[line].imag)[0][:, :1] * directions
    return out
