"""Views of the FRFs: the figure of each, and its changes while a slider moves."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from plotly.graph_objects import Figure

from dovetail.desk import figures
from dovetail.desk.compared_modes import ComparedModes
from dovetail.desk.figures import HERE, NOMINAL, SECOND
from dovetail.desk.session import Desk
from dovetail.report.words import effect_label, number
from fem.analysis.frf import FRF
from updating.live.engine import Evaluation
from updating.live.hypothesis import Hypothesis
from updating.live.sensitivity import FrequencySensitivity, Sensitivity
from updating.measurement.held_out import Band
from viz import indicators
from viz.indicators import FRAC, NYQUIST, SINGULAR, singular_levels
from viz.interactive.live import draw

HEIGHT = 400
"""Of figures over frequency [pixel]."""
ROUNDED = 1e-4
"""Relative error of the ends of a band in its fields, which show five digits [-]."""
MOST_BARS = 16
"""Parameters whose sensitivity is shown, the largest first [-]."""


@dataclass(frozen=True, slots=True)
class Chosen:
    """The FRFs to show.

    Attributes
    ----------
    pair : (str, str)
        Names of a sensor and an excitation.
    log : bool
        Whether the axis of frequency is logarithmic.
    band : (float, float)
        Ends of the visible frequencies [Hz].
    """

    pair: tuple[str, str]
    log: bool
    band: Band


Changes = Mapping[str, Mapping[str, Any]]
"""New coordinates of the present hypothesis's traces, by their quantity."""


def _no_changes(shown: Evaluation, chosen: Chosen) -> Changes:
    return {}


@dataclass(frozen=True, slots=True)
class DeskView:
    """One view of the FRFs.

    Attributes
    ----------
    words : str
        For screen readers.
    draw : callable
        Makes the figure.
    changes : callable
        Returns the changes with a slider; none for a figure that is drawn when the slider rests.
    one_frf : bool
        Whether it shows the chosen FRF alone.
    over_frequency, of_band : bool
        Whether frequency is its axis, and whether it shows the lines of the chosen band alone.
    needs_phase : bool
    """

    words: str
    draw: Callable[[Desk, Chosen], Figure]
    changes: Callable[[Evaluation, Chosen], Changes] = _no_changes
    one_frf: bool = True
    over_frequency: bool = False
    of_band: bool = False
    needs_phase: bool = True

    def moved(self, figure: Figure, shown: Evaluation, chosen: Chosen) -> tuple[list[Any], list[int]]:
        """Return the changes of its figure with a slider: new coordinates, and the traces that get them."""
        at = {t.meta["quantity"]: n for n, t in enumerate(figure.data) if t.meta and t.meta["series"] == HERE}
        new = {k: v for k, v in self.changes(shown, chosen).items() if k in at}
        return list(new.values()), [at[k] for k in new]


def _models(desk: Desk) -> dict[str, Evaluation]:
    second = desk.second()
    shown = {NOMINAL: desk.nominal, HERE: desk.shown}
    return shown if second is None else {**shown, SECOND: second}


def _frfs(desk: Desk) -> dict[str, FRF]:
    return {label: e.frf for label, e in _models(desk).items()}


def _amplitude(desk: Desk, chosen: Chosen) -> Figure:
    return figures.frf(desk, chosen.pair, HEIGHT, log=chosen.log)


def _nyquist(desk: Desk, chosen: Chosen) -> Figure:
    models = {label: _one(frf, chosen) for label, frf in _frfs(desk).items()}
    measured = _one(desk.shown.measured, chosen)
    return draw(indicators.nyquist(measured, models, chosen.pair, height=HEIGHT))


def _nyquist_changes(shown: Evaluation, chosen: Chosen) -> Changes:
    H = _one(shown.frf, chosen).H[:, 0, 0]
    return {NYQUIST: {"x": H.real.astype(np.float32), "y": H.imag.astype(np.float32)}}


def _one(frf: FRF, chosen: Chosen) -> FRF:
    """Return the chosen FRF at the lines of the band; at all lines if the band has none."""
    low, high = chosen.band
    f = frf.frequency
    lines = (f >= low * (1 - ROUNDED)) & (f <= high * (1 + ROUNDED))
    return frf.select([chosen.pair[0]], [chosen.pair[1]], lines=lines if lines.any() else None)


def _cmif(desk: Desk, chosen: Chosen) -> Figure:
    counted = [name for name in desk.shown.measured.outputs if name not in desk.now.hypothesis.off]
    bands = figures.held_out_bands(desk.live.data_of(desk.now.hypothesis))
    models = {label: frf.select(counted) for label, frf in _frfs(desk).items()}
    measured = desk.shown.measured.select(counted)
    more = {"held_out": bands, "log_frequency": chosen.log, "height": HEIGHT}
    return draw(indicators.cmif(measured, models, **more))


def _cmif_changes(shown: Evaluation, chosen: Chosen) -> Changes:
    counted = [name for name in shown.frf.outputs if name not in shown.hypothesis.off]
    levels = singular_levels(shown.frf.select(counted).H)
    return {f"{SINGULAR} {k + 1}": {"y": figures.sent(level, 2)} for k, level in enumerate(levels.T)}


def _frac(desk: Desk, chosen: Chosen) -> Figure:
    values = {label: _frac_to(e, chosen) for label, e in _models(desk).items()}
    return draw(indicators.frac(values, desk.shown.measured.outputs, force=chosen.pair[1]))


def _frac_to(shown: Evaluation, chosen: Chosen) -> np.ndarray:
    return shown.comparison.frac[:, shown.comparison.inputs.index(chosen.pair[1])]


def _frac_changes(shown: Evaluation, chosen: Chosen) -> Changes:
    return {FRAC: {"x": figures.sent(_frac_to(shown, chosen), 4)}}


def _sensitivity(desk: Desk, chosen: Chosen) -> Figure:
    best = desk.sensitivities(chosen.pair)[:MOST_BARS]
    names = [_name(desk.now.hypothesis, s) for s in best]
    hover = [f"{name}: {_change(s)}" for name, s in zip(names, best, strict=True)]
    added = [s.added for s in best]
    return draw(indicators.sensitivity(names, [s.mean_db for s in best], hover, added))


def frequency_bars(desk: Desk, found: ComparedModes, j: int) -> Figure:
    """Return bars of the change of an elastic computed mode's natural frequency by each parameter."""
    best = desk.frequency_sensitivities(found, j)[:MOST_BARS]
    names = [_name(found.hypothesis, s) for s in best]
    hover = [f"{name}: {s.percent:+.2g} % {_step(s)}" for name, s in zip(names, best, strict=True)]
    label = "change per standard deviation of the prior [%]"
    sizes, added = [abs(s.percent) for s in best], [s.added for s in best]
    return draw(indicators.sensitivity(names, sizes, hover, added, label))


def _name(h: Hypothesis, s: Sensitivity | FrequencySensitivity) -> str:
    effect, parameter = s.refs[0]
    if not s.added:
        return f"{effect}.{parameter}"
    added = h.effect(effect)
    return f"{parameter.replace('_', ' ')} of {effect_label(added.kind, added.where)}"


def _change(s: Sensitivity) -> str:
    return f"{number(s.largest_db)} dB at most, at {number(s.frequency, 4)} Hz, {_step(s)}"


def _step(s: Sensitivity | FrequencySensitivity) -> str:
    return "by 20 %, as it has no prior" if s.assumed else "by one standard deviation of its prior"


VIEWS = {
    "Amplitude and phase": DeskView(
        "Amplitude and phase of one FRF, measured and computed",
        _amplitude,
        lambda shown, chosen: figures.curve_changes(shown, chosen.pair),
        over_frequency=True,
        needs_phase=False,
    ),
    "Nyquist": DeskView(
        "Imaginary over real part of one FRF, measured and computed",
        _nyquist,
        _nyquist_changes,
        of_band=True,
    ),
    "CMIF": DeskView(
        "Complex mode indication function of all FRFs, measured and computed",
        _cmif,
        _cmif_changes,
        one_frf=False,
        over_frequency=True,
    ),
    "FRAC": DeskView(
        "FRAC of every sensor for the chosen excitation; click a row for its FRF",
        _frac,
        _frac_changes,
        one_frf=False,
    ),
    "Sensitivity": DeskView(
        "Change of the chosen FRF by each parameter, per standard deviation of its prior",
        _sensitivity,
        needs_phase=False,
    ),
}
"""All views by the name in the list."""
