"""What a report on modes draws: its still pictures and its interactive figures."""

from collections.abc import Sequence
from math import floor, log10
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from plotly.graph_objects import Figure

from dovetail.mode_result import ModeRunResult, mode_steps
from dovetail.report import words
from dovetail.report.figures import Figures, moving_modes
from dovetail.report.pictures import N_MODES, Album, Say, add_modes, mode_heading, plot_staircase
from updating.diagnosis.mode_diagnosis import ModeDiagnosis
from updating.diagnosis.reported_modes import ReportedModes
from updating.measurement.measurement import MOTION, Sensor
from viz import frequencies, heat_maps
from viz.interactive.error import probability_figure, staircase_figure
from viz.interactive.frequencies import deviations_figure, mac_figure
from viz.interactive.model import model_figure
from viz.interactive.modes import MeasuredShape
from viz.interactive.solids import MarkedPlace
from viz.offscreen import NO_OPENGL, can_draw, why_not
from viz.shapes import real_shape

LADDER: dict[str, Any] = {
    "ylabel": "error of natural frequencies [%]",
    "unit": "%",
    "names": ("of fitted modes", "of held-out modes"),
}
"""Words of the staircase."""
STAIRCASE = (
    "Root mean square deviation of computed from measured natural frequencies after each step. The grey "
    "floor is the standard deviation of the measurement and the mesh error."
)
DEVIATIONS = (
    "Computed less measured natural frequencies, mode by mode. The bars around zero are two standard "
    "deviations of the measurement."
)
MAC = "Modal assurance criterion of measured shapes with those of the model reported."


def step_errors(d: ModeDiagnosis) -> list[tuple[str, float, float | None]]:
    """Return label and errors of each step, of fitted modes and of those held out [%]."""
    each = [words.effect_label(e.kind, e.where) for e in d.found]
    added = f"+ {each[0]}" if len(each) == 1 else f"+ {len(each)} effects"
    out = []
    for label, f in mode_steps(d).items():
        fit, held_out = (100 * d.modes.errors(f, k) for k in (False, True))
        name = added if label.startswith("with ") else label
        out.append((name, fit, held_out if np.isfinite(held_out) else None))
    return out


def digits_of(d: ModeDiagnosis) -> int:
    """Return the digits after the point that leave two of the noise floor in percent."""
    return int(np.clip(1 - floor(log10(max(100 * d.noise_limit, 1e-9))), 1, 6))


def hypotheses_by_modes(d: ModeDiagnosis) -> list[tuple[str, float]]:
    """Return the explanations in words, numbered, with their probabilities."""
    return [(f"{k}: {e.label}", e.probability) for k, e in enumerate(d.explanations, 1)]


def places_by_modes(result: ModeRunResult) -> list[MarkedPlace]:
    """Return the places of the effects found, and those of other explanations of the credible set."""
    d, model = result.diagnosis, result.study.model
    out: dict[tuple[float, ...], list[tuple[str, str, str]]] = {}
    others = [e for x in d.credible for e in x.effects]
    for role, effects in (("finding", d.found), ("candidate", others)):
        for effect in effects:
            for xyz in effect.locations(model)[:6]:
                here = out.setdefault(tuple(np.round(xyz, 9)), [])
                if not here or here[0][2] == role:
                    here.append((effect.where, effect.kind.replace("_", " "), role))
    return [
        MarkedPlace(np.array(xyz), here[0][0], " and ".join(dict.fromkeys(t[1] for t in here)), here[0][2])
        for xyz, here in out.items()
    ]


def draw_modes(result: ModeRunResult, drawn: ReportedModes, folder: Path, say: Say) -> Album:
    """Draw everything that a report on modes shows without a script."""
    folder.mkdir(parents=True, exist_ok=True)
    album = Album(folder)
    say("drawing curves", 0.0)
    _draw_curves(result, drawn, album)
    say("drawing the structure", 0.3)
    if not can_draw():
        album.failures.append(
            f"Pictures of the structure and of its modes are missing: {why_not() or NO_OPENGL}."
        )
        return album
    _draw_structure(result, album)
    modes = drawn.modes
    chosen = [int(k) for k in drawn.partner if k >= 0][:N_MODES]
    titles = {k: _heading(drawn, k) for k in chosen}
    add_modes(album, result.diagnosis.model, modes, titles, measured_shapes(result, drawn), say)
    return album


def _draw_curves(result: ModeRunResult, drawn: ReportedModes, album: Album) -> None:
    d = result.diagnosis
    m, steps, ladder = d.modes, mode_steps(d), {"digits": digits_of(d), **LADDER}
    floor = 100 * d.noise_limit
    album.plot("staircase", staircase_alt(d), STAIRCASE, plot_staircase, step_errors(d), floor, **ladder)
    alt = f"Deviations of the natural frequencies of {', '.join(steps)} from {len(m.measured)} measured ones."
    shown = m.measured, m.std, steps, m.held_out
    album.plot("deviations", alt, DEVIATIONS, frequencies.plot_deviations, *shown)
    if (mac := drawn.mac) is not None:
        alt = f"Modal assurance criteria of {len(mac)} measured shapes with {mac.shape[1]} computed ones."
        axes = "measured [Hz]", "computed [Hz]"
        album.plot("mac", alt, MAC, heat_maps.plot_mac, mac, mac_names(d, drawn), axes)


def staircase_alt(d: ModeDiagnosis) -> str:
    """Return the staircase in words."""
    digits = digits_of(d)
    steps = "; ".join(f"{label} {fit:.{digits}f} %" for label, fit, _ in step_errors(d))
    return f"Error of natural frequencies after each step: {steps}; noise floor {100 * d.noise_limit:.2g} %."


def _draw_structure(result: ModeRunResult, album: Album) -> None:
    from viz import render

    study = result.study
    sensors = study.modes.sensors if study.modes else ()
    marks = [(p.point, p.label) for p in places_by_modes(result) if p.role == "finding"]
    seen = f" with {len(sensors)} sensors" if sensors else ""
    seen += f"; marked: {', '.join(dict.fromkeys(label for _, label in marks))}" if marks else ""
    album.add(
        "structure",
        f"The structure{seen}.",
        f"The model{seen}.",
        lambda p: render.render_model(study.model, p, sensors, (), marks),
    )


def make_mode_figures(result: ModeRunResult, drawn: ReportedModes) -> Figures:
    """Make every interactive figure of a report on modes."""
    out, d = Figures(), result.diagnosis
    m, steps = d.modes, step_errors(d)
    sensors = result.study.modes.sensors if result.study.modes else ()
    out.add(
        "model",
        lambda: model_figure(result.study.model, sensors, places=places_by_modes(result), height=430),
    )
    out.add(
        "staircase",
        lambda: staircase_figure(steps, 100 * d.noise_limit, height=430, digits=digits_of(d), **LADDER),
    )
    out.add("probability", lambda: probability_figure(hypotheses_by_modes(d)))
    out.add("deviations", lambda: deviations_figure(m.measured, m.std, mode_steps(d), held_out=m.held_out))
    if drawn.mac is not None:
        mac = drawn.mac
        out.add("mac", lambda: mac_figure(mac, *mac_names(d, drawn)))
    out.add("modes", lambda: _modes(result, drawn))
    return out


def mac_names(d: ModeDiagnosis, drawn: ReportedModes) -> tuple[list[str], list[str]]:
    """Return measured and computed natural frequencies as names of modes [Hz]."""
    computed = drawn.modes.frequency[drawn.modes.n_rigid :]
    return [f"{f:.4g}" for f in d.modes.measured], [f"{f:.4g}" for f in computed]


def _modes(result: ModeRunResult, drawn: ReportedModes) -> Figure | None:
    chosen = [int(k) for k in drawn.partner if k >= 0]
    labels = {k: _heading(drawn, k) for k in chosen}
    shapes = measured_shapes(result, drawn)
    return moving_modes(result.diagnosis.model, drawn.modes, chosen, shapes, labels=labels)


def _heading(drawn: ReportedModes, k: int) -> str:
    """Return number, frequency and damping of a mode, and which measured one it is."""
    modes, i = drawn.modes, int(np.flatnonzero(drawn.partner == k)[0])
    zeta = None if modes.zeta is None else float(modes.zeta[k])
    return f"{mode_heading(k, modes.n_rigid, float(modes.frequency[k]), zeta)}; measured mode {i + 1}"


def measured_shapes(result: ModeRunResult, drawn: ReportedModes) -> dict[int, MeasuredShape]:
    """Return the measured shapes by the number of the mode of the model, at the sensors that have them."""
    t = result.diagnosis.problem.targets
    if not t.has_shapes:
        return {}
    shapes = ((int(k), shape_at(t.sensors, t.shapes[:, i])) for i, k in enumerate(drawn.partner) if k >= 0)
    return {k: shape for k, shape in shapes if shape is not None}


def shape_at(sensors: Sequence[Sensor], shape: NDArray[np.number]) -> MeasuredShape | None:
    """Return the places and displacement vectors of a measured shape (n_sensors,); None without motions."""
    points, directions = (np.array([getattr(s, key) for s in sensors]) for key in ("point", "direction"))
    known = np.isfinite(shape) & np.array([s.quantity == MOTION for s in sensors])
    if not known.any():
        return None
    return points[known], real_shape(shape[known])[:, None] * directions[known]
