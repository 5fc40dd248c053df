"""FRFs over frequency: amplitude, phase and coherence of one pair, and the error of all."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from matplotlib.colors import to_rgb
from numpy.typing import ArrayLike, NDArray
from plotly.graph_objects import Figure

from fem.analysis.frf import FRF
from viz import style
from viz.axes import Band
from viz.interactive.theme import DASHES, axis, key, layout, plain, shaded, single

Floats = NDArray[np.float64]

MAGNITUDE, PHASE, LOW, HIGH, COHERENCE = "magnitude", "phase", "low", "high", "coherence"
"""Quantities of a figure's traces: ``meta["quantity"]``, beside the curve's label ``meta["series"]``."""
MEASURED = "measured"
_DB_PER_NEPER = 20 / np.log(10)
_WIDEST = 150.0
"""Prediction bands are drawn no wider than this either way [dB]."""


@dataclass(frozen=True, slots=True, eq=False)
class Curves:
    """The FRFs of one source, for all pairs, as they are drawn.

    Attributes
    ----------
    label, colour, dash : str
    frequency : ndarray (n_freq,)
        [Hz].
    magnitude : ndarray (n_freq, n_out, n_in)
        20 lg |H| [dB re 1 SI unit]; NaN where H is 0.
    phase : ndarray (n_freq, n_out, n_in) or None
        [degrees]; NaN where H is 0. None beside measured amplitudes, which have none.
    spread : ndarray (n_freq, n_out, n_in) or None
        Half width of the 95 % prediction band [dB].
    outputs, inputs : tuple of str
    """

    label: str
    colour: str
    dash: str
    frequency: Floats
    magnitude: Floats
    phase: Floats | None
    spread: Floats | None
    outputs: tuple[str, ...]
    inputs: tuple[str, ...]

    def of(self, pair: tuple[str, str]) -> tuple[Floats, Floats | None, Floats | None]:
        """Return magnitude, phase and spread of a pair (output, input), (n_freq,) each."""
        o, i = self.outputs.index(pair[0]), self.inputs.index(pair[1])
        phase, spread = (None if x is None else x[:, o, i] for x in (self.phase, self.spread))
        return self.magnitude[:, o, i], phase, spread


def frf_curves(
    measured: FRF | None,
    models: Mapping[str, FRF] | None = None,
    deviations: Mapping[str, ArrayLike] | None = None,
    compared: ArrayLike | None = None,
) -> tuple[Curves, ...]:
    """Return measured FRFs and those of models in decibels and degrees.

    Parameters
    ----------
    measured : FRF or None
    models : mapping of str to FRF, optional
        By label, in the order nominal, fitted, with the effect, its rival; converted to the measured kind.
    deviations : mapping of str to array_like, optional
        Standard deviation of ln|H| of some models, by label, of the shape of their H [-].
    compared : array_like of bool (n_freq, n_out, n_in), optional
        Which measured values errors are of: the dark curve has these alone, a pale one below it has all.
    """
    kind = measured.kind if measured else None
    out = [_curves(MEASURED, measured, style.MEASURED, "solid", None)] if measured else []
    if measured is not None and compared is not None and not np.all(compared):
        seen = replace(measured, H=np.where(compared, measured.H, 0.0))
        pale = replace(out[0], label=style.NOT_COMPARED_LABEL, colour=style.NOT_COMPARED)
        out = [pale, _curves(MEASURED, seen, style.MEASURED, "solid", None)]
    for n, (label, frf) in enumerate((models or {}).items()):
        colour, line = style.model_style(label, n)
        spread = (deviations or {}).get(label)
        out.append(_curves(label, frf.as_kind(kind) if kind else frf, colour, DASHES[line], spread))
    if measured is not None and not measured.has_phase:
        out = [replace(c, phase=None) for c in out]
    return tuple(out)


def _curves(label: str, frf: FRF, colour: str, dash: str, deviation: ArrayLike | None) -> Curves:
    size = np.abs(frf.H)
    known = size > 0
    magnitude = 20 * np.log10(size, where=known, out=np.full(size.shape, np.nan))
    phase = np.where(known, np.rad2deg(np.angle(frf.H)), np.nan)
    spread = (
        None
        if deviation is None
        else np.minimum(1.96 * _DB_PER_NEPER * np.asarray(deviation, dtype=float), _WIDEST)
    )
    return Curves(label, colour, dash, frf.frequency, magnitude, phase, spread, frf.outputs, frf.inputs)


def frf_figure(
    measured: FRF | None,
    models: Mapping[str, FRF] | None = None,
    pair: tuple[str, str] | None = None,
    *,
    deviations: Mapping[str, ArrayLike] | None = None,
    held_out: Sequence[Band] = (),
    coherence: ArrayLike | None = None,
    compared: ArrayLike | None = None,
    log_frequency: bool = False,
    title: str | None = None,
    height: float = 520,
) -> Figure:
    """Return amplitude and phase of one FRF, measured and of models, over frequency.

    If the measured FRFs are amplitudes without phase, no phase is drawn.

    Every trace's ``meta`` has its ``series`` (the label) and ``quantity`` (``magnitude``, ``phase``, ``low``
    and ``high`` of the prediction band, ``coherence``), so that a page can put in other values.

    Parameters
    ----------
    measured : FRF or None
        None where there is no measurement.
    models : mapping of str to FRF, optional
        By label, in the order nominal, fitted, with the effect, its rival; converted to the measured kind.
    pair : (output, input), optional
        Labels of response and force; the first of each unless given.
    deviations : mapping of str to array_like, optional
        Standard deviation of ln|H| of some models, by label, of the shape of their H [-]; their 95 %
        interval is shaded.
    held_out : sequence of (low, high)
        Bands that were kept from the fit, shaded [Hz].
    coherence : array_like (n_freq, n_out, n_in), optional
        Coherence of the measured FRFs, 0 to 1; drawn below the phase.
    compared : array_like of bool (n_freq, n_out, n_in), optional
        Which measured values errors are of; the others are drawn pale.
    log_frequency : bool
        Whether the axis of frequency is logarithmic.
    title : str
        Heading; ``output / input`` unless given.
    height : float
        [pixel].

    Raises
    ------
    ValueError
        If there is nothing to draw.
    FRFError
        For a pair that the data do not have.
    """
    first = measured or next(iter((models or {}).values()), None)
    if first is None:
        msg = "neither measured FRFs nor those of a model are given; at least one is needed"
        raise ValueError(msg)
    pair = pair or (first.outputs[0], first.inputs[0])
    for frf in (measured, *(models or {}).values()):
        if frf is not None:
            frf.select([pair[0]], [pair[1]])
    curves = frf_curves(measured, models, deviations, compared)
    traces = [trace for c in curves for trace in curve_traces(c, pair)]
    with_coherence = False
    if coherence is not None and measured is not None:
        with_coherence = True
        traces.append(_coherence_trace(measured, np.asarray(coherence, dtype=float), pair))
    if held_out:
        traces.append(key("held out from the fit", style.HELD_OUT))
    look = layout(
        height,
        f"{pair[0]} / {pair[1]}" if title is None else title,
        hovermode="x unified",
        shapes=shaded(held_out),
        meta={"output": pair[0], "input": pair[1]},
        **_axes(
            first.select([pair[0]], [pair[1]]),
            magnitude_range(curves[0].of(pair)[0]),
            phases=curves[0].phase is not None,
            coherence=with_coherence,
            log=log_frequency,
        ),
    )
    return Figure(traces, look)


def magnitude_title(frf: FRF) -> str:
    """Return the title of the axis of one FRF's amplitude, with its unit."""
    return f"{frf.quantity}<br>[{decibel(frf.unit)}]"


def magnitude_range(magnitude: ArrayLike) -> tuple[float, float]:
    """Return the ends of the amplitude's axis, which leave out only the deepest antiresonances [dB]."""
    known = np.asarray(magnitude, dtype=float)
    known = known[np.isfinite(known)]
    if not known.size:
        return -1.0, 1.0
    low, high = float(np.percentile(known, 0.3)), float(known.max())
    room = 0.12 * max(high - low, 20.0)
    return low - room, high + room


def curve_traces(curve: Curves, pair: tuple[str, str]) -> list[dict[str, Any]]:
    """Return the traces of one source and one pair: prediction band, magnitude, phase."""
    magnitude, phase, spread = curve.of(pair)
    name = plain(curve.label)
    line = {"color": curve.colour, "dash": curve.dash, "width": 2.4 if curve.label == MEASURED else 1.6}
    common = {"type": "scatter", "mode": "lines", "legendgroup": name, "x": single(curve.frequency)}
    pale = curve.label == style.NOT_COMPARED_LABEL  # below the dark curve, which has the same values

    def hover(template: str) -> dict[str, str]:
        return {"hoverinfo": "skip"} if pale else {"hovertemplate": template}

    out = []
    if spread is not None:
        r, g, b = (round(255 * c) for c in to_rgb(curve.colour))
        edge = {**common, "line": {"width": 0}, "hoverinfo": "skip", "yaxis": "y", "connectgaps": False}
        fill = {"fill": "tonexty", "fillcolor": f"rgba({r},{g},{b},0.22)"}
        out += [
            {
                **edge,
                "y": single(magnitude - spread),
                "meta": _meta(curve, LOW),
                "showlegend": False,
                "legendgroup": f"{name}, 95 %",
            },
            {
                **edge,
                **fill,
                "y": single(magnitude + spread),
                "meta": _meta(curve, HIGH),
                "name": f"{name}, 95 %",
                "showlegend": True,
                "legendgroup": f"{name}, 95 %",
            },
        ]
    out.append(
        {
            **common,
            "y": single(magnitude),
            "yaxis": "y",
            "name": name,
            "line": line,
            "meta": _meta(curve, MAGNITUDE),
            **hover("%{y:.2f} dB"),
        },
    )
    if phase is not None:
        f, wrapped = without_wraps(curve.frequency, phase)
        out.append(
            {
                **common,
                "x": single(f),
                "y": single(wrapped),
                "yaxis": "y2",
                "name": name,
                "line": line,
                "meta": _meta(curve, PHASE),
                "showlegend": False,
                **hover("%{y:.1f}°"),
            },
        )
    return out


def without_wraps(f: Floats, phase: Floats) -> tuple[Floats, Floats]:
    """Return a phase with a gap wherever it jumps by more than half a turn, and its frequencies."""
    wraps = np.flatnonzero(np.abs(np.diff(phase)) > 180) + 1
    return np.insert(f, wraps, f[wraps]), np.insert(phase, wraps, np.nan)


def _meta(curve: Curves, quantity: str) -> dict[str, str]:
    return {"series": curve.label, "quantity": quantity}


def _coherence_trace(measured: FRF, coherence: Floats, pair: tuple[str, str]) -> dict[str, Any]:
    o, i = measured.outputs.index(pair[0]), measured.inputs.index(pair[1])
    return {
        "type": "scatter",
        "mode": "lines",
        "x": single(measured.frequency),
        "yaxis": "y3",
        "y": single(coherence[:, o, i]),
        "line": {"color": style.MEASURED, "width": 1.2},
        "name": "coherence",
        "showlegend": False,
        "hovertemplate": "γ² %{y:.3f}",
        "meta": {"series": MEASURED, "quantity": COHERENCE},
    }


def frequency_axis(frequency: Floats, *, log: bool = False, **more: Any) -> dict[str, Any]:
    """Return the axis of frequencies [Hz] from the first line to the last; a logarithmic one leaves out 0."""
    shown = frequency[frequency > 0] if log else frequency
    ends = [float(shown[0]), float(shown[-1])]
    scale = {"type": "log", "range": np.log10(ends).tolist(), "dtick": "D2"} if log else {"range": ends}
    hover = {"hoverformat": ".5~g", "unifiedhovertitle": {"text": "%{x:.5~g} Hz"}}
    return axis("frequency [Hz]", **scale, **hover, **more)


def decibel(unit: str) -> str:
    """Return the unit of a level in decibel."""
    return "dB" if unit == "-" else f"dB re 1 {unit}"


def _axes(
    frf: FRF, limits: tuple[float, float], *, phases: bool, coherence: bool, log: bool
) -> dict[str, Any]:
    """Return the axes: magnitude above, phase below it, and coherence at the bottom."""
    low = 0.18 if coherence else 0.0
    split = low + 0.34 * (1 - low) if phases else low - (0.0 if coherence else 0.03)
    lowest = "y3" if coherence else "y2" if phases else "y"
    out = {
        "xaxis": frequency_axis(frf.frequency, log=log, anchor=lowest),
        "yaxis": axis(magnitude_title(frf), domain=[split + 0.03, 1], range=list(limits)),
    }
    if phases:
        out["yaxis2"] = axis(
            "phase [°]",
            domain=[low + (0.03 if coherence else 0), split - 0.02],
            range=[-190, 190],
            tickvals=[-180, -90, 0, 90, 180],
        )
    if coherence:
        out["yaxis3"] = axis("γ² [-]", domain=[0, low - 0.03], range=[-0.02, 1.04], tickvals=[0, 0.5, 1])
    return out


def frf_error_figure(
    frequency: ArrayLike,
    errors: Mapping[str, ArrayLike],
    *,
    floor: ArrayLike | None = None,
    held_out: Sequence[Band] = (),
    title: str = "",
    height: float = 320,
) -> Figure:
    """Return the error of models over frequency.

    Parameters
    ----------
    frequency : array_like (n_freq,)
        [Hz].
    errors : mapping of str to array_like (n_freq,)
        Relative error of each model, by label in the order nominal, fitted, with the effect [dB].
    floor : array_like (n_freq,), optional
        Relative error that noise alone would leave [dB].
    held_out : sequence of (low, high)
        Bands that were kept from the fit [Hz].
    title : str
    height : float
        [pixel].
    """
    f = np.asarray(frequency, dtype=float)
    shown = {label: np.asarray(e, dtype=float) for label, e in errors.items()}
    ends = (
        np.concatenate([[np.nanpercentile(e, 1), np.nanmax(e)] for e in shown.values()])
        if shown
        else [-60, 0]
    )
    low, high = float(np.min(ends)), float(np.max(ends))
    traces: list[dict[str, Any]] = []
    if floor is not None:
        noise = np.asarray(floor, dtype=float)
        low = min(low, float(np.nanmedian(noise)) - 3)
        common = {
            "type": "scatter",
            "mode": "lines",
            "x": single(f),
            "line": {"width": 0},
            "hoverinfo": "skip",
        }
        traces += [
            {**common, "y": np.full(f.size, low - 100.0, dtype=np.float32), "showlegend": False},
            {
                **common,
                "y": single(noise),
                "fill": "tonexty",
                "fillcolor": style.NOISE,
                "name": "below the noise, 1 σ",
                "showlegend": True,
            },
        ]
    for n, (label, e) in enumerate(shown.items()):
        colour, line = style.model_style(label, n)
        traces.append(
            {
                "type": "scatter",
                "mode": "lines",
                "x": single(f),
                "y": single(e),
                "name": plain(label),
                "line": {"color": colour, "dash": DASHES[line], "width": 1.6},
                "hovertemplate": "%{y:.1f} dB",
                "meta": {"series": label, "quantity": "error"},
            }
        )
    if held_out:
        traces.append(key("held out from the fit", style.HELD_OUT))
    look = layout(
        height,
        title,
        hovermode="x unified",
        shapes=shaded(held_out),
        xaxis=axis(
            "frequency [Hz]",
            range=[float(f[0]), float(f[-1])],
            hoverformat=".5~g",
            unifiedhovertitle={"text": "%{x:.5~g} Hz"},
        ),
        yaxis=axis("relative error [dB]", range=[low - 4, high + 4]),
    )
    return Figure(traces, look)
