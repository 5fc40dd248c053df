"""The desk's figures, and their changes while a slider moves."""

from collections.abc import Collection, Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from plotly.graph_objects import Figure

from dovetail.desk.compared_modes import ComparedModes
from dovetail.desk.session import Desk
from dovetail.report import words
from dovetail.report.sections.mode_shapes import shape_at
from fem.analysis.frf import FRF
from updating.inference.fit_data import FitData
from updating.live.engine import Evaluation
from viz import curves, search
from viz.curves import MAGNITUDE, PHASE
from viz.heat_maps import error_map as map_of_errors
from viz.interactive import live
from viz.interactive.model import model_figure
from viz.interactive.modes import modes_figure
from viz.interactive.solids import MarkedPlace

HERE, NOMINAL, SECOND = "this hypothesis", "nominal", "second hypothesis"
AT_ONCE = {"frame": {"duration": 0, "redraw": False}, "transition": {"duration": 0}, "mode": "immediate"}
"""Options of plotly's ``animate``: a frame at once, and no other part of the figure drawn anew."""
NEAR, MARK, JOINT_MARK = 24.0, 5.0, 8.0
"""A click picks a mark so near, and is on a mark, or on that of a joint, that is so near [pixel]."""
MODE_HEAD = ("mode", "measured [Hz]", "computed [Hz]", "Δf [%]", "MAC", "ζ [%]")
"""Columns of the table of modes."""


def model(desk: Desk, chosen: str, height: float) -> Figure:
    """Return the structure with its sensors by error, the added effects, and the places of candidates.

    Parameters
    ----------
    desk : Desk
    chosen : str
        The spot whose candidates are listed; empty for all.
    height : float
        [pixel].
    """
    marks = []
    for effect in desk.shown.hypothesis.effects:
        points = effect.locations(desk.live.problem.reduced.model)
        marks += [MarkedPlace(p, effect.name, words.place(effect.where), "finding") for p in points[:1]]
    for spot in (s for s in desk.spots.values() if s.on_structure):
        role = "chosen place" if spot.name == chosen else "candidate"
        marks.append(MarkedPlace(np.array(spot.point), spot.name, ", ".join(spot.places), role))
    errors = dict(zip(desk.shown.comparison.outputs, desk.shown.by_sensor().tolist(), strict=True))
    measurement = desk.live.problem.data.measurement
    return model_figure(
        desk.study.model,
        measurement.sensors,
        measurement.excitations,
        errors={name: e for name, e in errors.items() if np.isfinite(e)},
        limits=(0.0, float(np.nanmax(desk.nominal.by_sensor()))),
        places=marks,
        height=height,
    )


def frf(desk: Desk, pair: tuple[str, str], height: float, *, log: bool = False) -> Figure:
    """Return amplitude and phase of one FRF: measured, nominal, this hypothesis and the second one."""
    second = desk.second()
    models = {NOMINAL: desk.nominal.frf, HERE: desk.shown.frf}
    if second is not None:
        models[SECOND] = second.frf
    held = {f"sensor {pair[0]}", f"excitation {pair[1]}"} & desk.now.hypothesis.held_out
    f = desk.shown.frf.frequency
    bands = [(float(f[0]), float(f[-1]))] if held else held_out_bands(desk.live.data_of(desk.now.hypothesis))
    more = {"held_out": bands, "log_frequency": log, "title": "", "height": height}
    figure = live.draw(curves.frf(desk.shown.measured, models, pair, **more))
    for trace in figure.data:  # gaps in place of further points: a slider moves ordinates only
        if trace.meta and trace.meta["series"] == HERE and trace.meta["quantity"] == PHASE:
            phase = _cut(_decibels(desk.shown.frf, pair)[1])
            trace.update(x=desk.shown.frf.frequency.astype(np.float32), y=sent(phase, 1))
    return figure  # without a title: the fields above name the pair


def error_map(desk: Desk) -> Figure:
    """Return the error of each sensor in each band, on the colours of the nominal model."""
    c, edges = desk.shown.comparison, desk.shown.comparison.bands
    bands = [(float(a), float(b)) for a, b in pairwise(edges)]
    limits = (0.0, float(np.nanmax(desk.nominal.by_band())))
    held = desk.now.hypothesis.held_out
    names = [f"{name} (held out)" if f"sensor {name}" in held else name for name in c.outputs]
    figure = live.draw(map_of_errors(desk.shown.by_band(), names, bands, limits=limits))
    for name, cells in zip(c.outputs, figure.data[0].customdata, strict=True):
        for cell in cells:
            cell[0] = name  # clicks name the sensor alone
    return figure


def staircase(desk: Desk) -> Figure:
    """Return the errors after each step, with the present one where values were moved by hand since."""
    steps = [(s.label, s.fit_db, _known(s.held_out_db)) for s in desk.now.stairs]
    r = desk.shown.result
    # Smallest difference of errors that their numbers show [dB]
    if abs(r.fit_db - steps[-1][1]) >= 0.005:
        steps.append(("now", r.fit_db, _known(r.held_out_db)))
    return live.draw(search.staircase(steps, desk.shown.noise_db, height=300))


def held_out_bands(data: FitData) -> list[tuple[float, float]]:
    """Return the bands of lines that no fit sees [Hz]."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], data.held_out, [False]]).astype(int)))
    f = data.frequency
    return [(float(f[a]), float(f[b - 1])) for a, b in edges.reshape(-1, 2)]


def curve_changes(shown: Evaluation, pair: tuple[str, str]) -> dict[str, dict[str, Any]]:
    """Return the new ordinates of an FRF's amplitude and phase."""
    magnitude, phase = _decibels(shown.frf, pair)
    return {MAGNITUDE: {"y": sent(magnitude, 2)}, PHASE: {"y": sent(_cut(phase), 1)}}


def nearest_mark(
    marks: Sequence[Mapping[str, Any]],
    touched: Mapping[str, Any],
    reach: float,
    joints: Collection[str] = (),
) -> Mapping[str, Any] | None:
    """Return the mark that a click in the model means.

    That is a joint whose mark is under the mouse, whatever lies over it: a list has the sensors, too. Else it
    is the foremost mark under the mouse, or the nearest to it.

    Parameters
    ----------
    marks : sequence of mapping
        With ``point`` [m], ``off`` (distance on the screen from the click [pixel]) and ``depth``.
    touched : mapping
        The foremost thing under the mouse, with ``point`` and ``depth``.
    reach : float
        Marks behind it by more are hidden [m]; nearer ones lie inside it, as joints do in their members.
    joints : collection of str
        Names of the marks at joints.
    """

    def hidden(m: Mapping[str, Any]) -> bool:
        off = float(np.linalg.norm(np.subtract(m["point"], touched["point"])))
        return m["depth"] > touched["depth"] and off >= reach

    shown = [m for m in marks if m["off"] <= NEAR and not hidden(m)]
    at_joint = [m for m in shown if m["name"] in joints and m["off"] <= JOINT_MARK]
    if at_joint:
        return min(at_joint, key=lambda m: m["off"])
    under = [m for m in shown if m["off"] <= MARK]
    if under:
        return min(under, key=lambda m: m["depth"])
    return min(shown, key=lambda m: m["off"], default=None)


def moved_map(shown: Evaluation) -> dict[str, Any]:
    """Return the changes of the error map with a slider."""
    return {"z": [sent(shown.by_band(), 3)]}


def sent(values: NDArray[Any], digits: int) -> NDArray[np.float32]:
    """Return values in the form that goes to the page, with the digits that a picture shows."""
    return np.ascontiguousarray(np.round(values, digits), dtype=np.float32)


def _cut(phase: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a phase (n_freq,) with a gap at each step from one end of its axis to the other [degrees]."""
    steps = np.abs(np.diff(phase, prepend=phase[:1])) > 180
    return np.where(steps, np.nan, phase)


def _decibels(frf: FRF, pair: tuple[str, str]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    H = frf.H[:, frf.outputs.index(pair[0]), frf.inputs.index(pair[1])]
    size = np.abs(H)
    magnitude = 20 * np.log10(size, where=size > 0, out=np.full(size.shape, np.nan))
    return magnitude, np.rad2deg(np.angle(H))


def _known(value: float) -> float | None:
    return value if np.isfinite(value) else None


def mode_rows(found: ComparedModes) -> list[dict[str, Any]]:
    """Return a row of the table for each measured mode, with the number of its partner, from 0, or None."""
    measured, computed = found.frequencies()
    zeta = found.measured.modes.zeta
    out = []
    for i, f in enumerate(measured):
        j = found.partner.get(i)
        cells = (
            ("–", "–", "–")
            if j is None
            else (f"{computed[j]:.5g}", f"{100 * (computed[j] / f - 1):+.2f}", f"{found.mac[i, j]:.3f}")
        )
        damping = f"{100 * zeta[i]:.2g}" if zeta is not None and np.isfinite(zeta[i]) else "–"
        out.append({**dict(zip(MODE_HEAD, (i + 1, f"{f:.5g}", *cells, damping), strict=True)), "partner": j})
    return out


def comac_rows(found: ComparedModes) -> list[dict[str, str]]:
    """Return a row for each sensor with its CoMAC, the lowest first; none for fewer than two pairs."""
    names, order = [s.name for s in found.measured.sensors], np.argsort(found.comac)
    return [
        {"sensor": names[k], "CoMAC": f"{found.comac[k]:.3f}"} for k in order if np.isfinite(found.comac[k])
    ]


def shapes_title(found: ComparedModes, i: int, j: int) -> str:
    """Return which modes are shown, with their frequencies and MAC."""
    measured, computed = found.frequencies()
    return (
        f"Measured mode {i + 1}, {measured[i]:.4g} Hz (lines at the sensors); computed mode {j + 1}, "
        f"{computed[j]:.4g} Hz (surface); MAC {found.mac[i, j]:.3f}"
    )


def shapes_figure(found: ComparedModes, i: int, j: int) -> Figure:
    """Return the structure in a computed shape, with a measured one at the sensors, scaled to it."""
    k = found.computed.n_rigid + j
    shape = shape_at(found.measured.sensors, found.measured.modes.shapes[:, i])
    measured = {} if shape is None else {k: shape}
    # Height of a figure of shapes [pixel]
    return modes_figure(found.model, found.computed, [k], measured=measured, height=420)
