"""Views of FRFs beside amplitude and phase: Nyquist plot, CMIF, FRAC, and sensitivities."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from plotly.graph_objects import Figure

from fem.analysis.frf import FRF
from updating.correlation import cmif
from viz import style
from viz.axes import Band
from viz.interactive.frf import MEASURED, decibel, frequency_axis
from viz.interactive.theme import BAR, DASHES, axis, layout, plain, rows_axis, shaded, single
from viz.layout import shorten

NYQUIST, SINGULAR, FRAC = "nyquist", "singular value", "frac"
"""Quantities of the traces: ``meta["quantity"]``, beside the curve's label ``meta["series"]``."""
MOST_SINGULAR_VALUES = 3
"""Singular values that are drawn [-]; further ones lie in the noise of most tests."""
ROW = 21
"""Height of a row with a name [pixel]."""


def nyquist_figure(
    measured: FRF, models: Mapping[str, FRF], pair: tuple[str, str], *, height: float = 520
) -> Figure:
    """Return the imaginary over the real part of one FRF, measured and of models.

    Parameters
    ----------
    measured : FRF
        With phase.
    models : mapping of str to FRF
        By label, of the measured kind.
    pair : (output, input)
    height : float
        [pixel].
    """
    chosen = measured.select([pair[0]], [pair[1]])
    traces = []
    for look, frf in _sources(measured, models):
        H = frf.select([pair[0]], [pair[1]]).H[:, 0, 0]
        at = {"x": single(H.real), "y": single(H.imag), "text": [f"{f:.5g} Hz" for f in frf.frequency]}
        traces.append({**look, **at, "meta": {**look["meta"], "quantity": NYQUIST}, "hoverinfo": "text+name"})
    unit = "" if chosen.unit == "-" else f" [{chosen.unit}]"
    zero = {"zeroline": True, "zerolinecolor": style.MUTED, "exponentformat": "power"}
    look = layout(
        height,
        hovermode="closest",
        xaxis=axis(f"real part{unit}", **zero),
        yaxis=axis(f"imaginary part{unit}", scaleanchor="x", **zero),
    )
    return Figure(traces, look)


def cmif_figure(
    measured: FRF,
    models: Mapping[str, FRF],
    *,
    held_out: Sequence[Band] = (),
    log_frequency: bool = False,
    height: float = 520,
) -> Figure:
    """Return the largest singular values of the FRFs at each line, measured and of models.

    Parameters
    ----------
    measured : FRF
        With phase.
    models : mapping of str to FRF
        By label, of the measured kind, outputs and inputs.
    held_out : sequence of (low, high)
        Bands that were kept from the fit, shaded [Hz].
    log_frequency : bool
    height : float
        [pixel].
    """
    traces = []
    for look, frf in _sources(measured, models):
        levels = singular_levels(frf.H)
        for k, level in enumerate(levels.T):
            line = {**look["line"], "width": look["line"]["width"] if k == 0 else 1.0}
            quantity = {**look["meta"], "quantity": f"{SINGULAR} {k + 1}"}
            traces.append(
                {
                    **look,
                    "x": single(frf.frequency),
                    "y": single(level),
                    "line": line,
                    "meta": quantity,
                    "opacity": 1.0 if k == 0 else 0.55,
                    "showlegend": k == 0,
                    "hovertemplate": "%{y:.2f} dB",
                }
            )
    unit = measured.unit
    look = layout(
        height,
        hovermode="x unified",
        shapes=shaded(held_out),
        xaxis=frequency_axis(measured.frequency, log=log_frequency),
        yaxis=axis(f"singular values<br>[{decibel(unit)}]"),
    )
    return Figure(traces, look)


def singular_levels(H: ArrayLike) -> np.ndarray:
    """Return the largest singular values at each line, (n_freq, n) [dB]; NaN where they are 0."""
    values = cmif(H)[:, :MOST_SINGULAR_VALUES]
    return 20 * np.log10(values, where=values > 0, out=np.full(values.shape, np.nan))


def frac_figure(values: Mapping[str, ArrayLike], sensors: Sequence[str], *, force: str = "") -> Figure:
    """Return the FRAC of each sensor with each model; ``customdata`` has the sensors' names for clicks.

    Parameters
    ----------
    values : mapping of str to array_like (n_sensors,)
        By the model's label, 0 to 1; NaN where nothing is compared.
    sensors : sequence of str
    force : str
        Excitation of these FRFs.
    """
    rows = list(range(len(sensors)))
    traces = []
    for n, (label, frac) in enumerate(values.items()):
        x, symbol = np.asarray(frac, dtype=float), ("circle-open", "circle", "diamond")[n % 3]
        traces.append(
            {
                "type": "scatter",
                "mode": "markers",
                "x": single(x),
                "y": rows,
                "name": plain(label),
                "marker": {"symbol": symbol, "size": 9, "color": style.model_style(label, n)[0]},
                "customdata": list(sensors),
                "meta": {"series": label, "quantity": FRAC},
                "cliponaxis": False,
                "hovertemplate": [f"{plain(s)}: %{{x:.3f}}" for s in sensors],
            }
        )
    words = f"FRAC of FRFs to {plain(force)} [-]" if force else "FRAC [-]"
    return Figure(traces, _rows_layout(sensors, axis(words, range=[-0.02, 1.02])))


def sensitivity_figure(
    names: Sequence[str],
    values: ArrayLike,
    hover: Sequence[str],
    added: Sequence[bool],
    label: str = "mean change per standard deviation of the prior [dB]",
) -> Figure:
    """Return bars of the change of an FRF or a natural frequency by each parameter.

    Parameters
    ----------
    names, hover : sequence of str
        Parameters, and words about each.
    values : array_like (n,)
        Absolute changes, such as the mean over the lines [dB].
    added : sequence of bool
        Which parameters are those of added effects.
    label : str
        Of the axis, with the unit.
    """
    values = np.asarray(values, dtype=float)
    bars = {
        **BAR,
        "x": single(values),
        "y": list(range(len(names))),
        "marker": {"color": [style.EFFECT if one else style.FITTED for one in added]},
        "hovertext": [plain(text) for text in hover],
        "showlegend": False,
        "text": [f"{v:.2g}" for v in values],
    }
    top = 1.12 * float(values.max(initial=1e-6))
    scale = axis(label, range=[0, top])
    return Figure([bars], _rows_layout(names, scale))


def _rows_layout(names: Sequence[str], scale: dict[str, Any]) -> dict[str, Any]:
    """Return a layout with a row for each name."""
    rows = rows_axis([plain(shorten(name, 40)) for name in names], showgrid=True)
    return layout(max(112 + ROW * len(names), 240), hovermode="closest", xaxis=scale, yaxis=rows)


def _sources(measured: FRF, models: Mapping[str, FRF]) -> list[tuple[dict[str, Any], FRF]]:
    """Return measured and computed FRFs, each with the look of its curves."""
    looks = [(MEASURED, style.MEASURED, "solid", 2.4, measured)]
    for n, (label, frf) in enumerate(models.items()):
        colour, dash = style.model_style(label, n)
        looks.append((label, colour, DASHES[dash], 1.6, frf))
    return [
        (
            {
                "type": "scatter",
                "mode": "lines",
                "name": plain(label),
                "legendgroup": plain(label),
                "line": {"color": colour, "dash": dash, "width": width},
                "meta": {"series": label},
            },
            frf,
        )
        for label, colour, dash, width, frf in looks
    ]
