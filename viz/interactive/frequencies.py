"""Measured and computed modes compared: deviations of frequencies, and modal assurance criteria."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike
from plotly.graph_objects import Figure

from viz import style
from viz.interactive.theme import CELL, axis, heat_map, key, layout, named_axis, plain, rows_axis, shaded

SYMBOLS = ("circle", "square", "diamond", "cross")
"""Of models in the order nominal, fitted, with the effect, others."""
MOST_NUMBERS = 24
"""Largest number of modes of a matrix with printed numbers."""


def deviations_figure(
    measured: ArrayLike,
    std: ArrayLike,
    computed: Mapping[str, ArrayLike],
    *,
    held_out: ArrayLike | None = None,
    title: str = "",
    height: float = 400,
) -> Figure:
    """Return how far computed natural frequencies are from measured ones, mode by mode.

    Bars around zero are two standard deviations of the measurement. A trace's ``customdata`` has the computed
    frequencies [Hz].

    Parameters
    ----------
    measured : array_like (n,)
        Natural frequencies [Hz].
    std : array_like (n,)
        Relative standard deviations [-].
    computed : mapping of str to array_like (n,)
        Frequencies by the model's label, in the order nominal, fitted, with the effect; NaN where a mode has
        none [Hz].
    held_out : array_like of bool (n,), optional
        Modes that no fit has seen, which are shaded.
    title : str
    height : float
        [pixel].

    Raises
    ------
    ValueError
        If there is not one number for each measured mode.
    """
    f, spread = np.asarray(measured, dtype=float), 200 * np.asarray(std, dtype=float)
    at = np.arange(f.size)
    traces = [
        {
            "type": "scatter",
            "mode": "markers",
            "x": at.tolist(),
            "y": np.zeros(f.size).tolist(),
            "name": "measured ± 2 std",
            "meta": {"series": "measured"},
            "hoverinfo": "text",
            "marker": {"symbol": "line-ew-open", "size": 12, "color": style.MEASURED},
            "error_y": {"type": "data", "array": spread.tolist(), "color": style.MEASURED, "thickness": 1.2},
            "hovertext": [f"measured {x:.5g} Hz ± {s / 2:.2g} %" for x, s in zip(f, spread, strict=True)],
            "customdata": f.tolist(),
        }
    ]
    for n, (label, values) in enumerate(computed.items()):
        g = np.asarray(values, dtype=float)
        if g.shape != f.shape:
            msg = f"'{label}' has {g.size} frequencies for {f.size} measured modes"
            raise ValueError(msg)
        off, symbol = 100 * (g / f - 1), SYMBOLS[n % len(SYMBOLS)]
        traces.append(
            {
                "type": "scatter",
                "mode": "markers",
                "x": (at + 0.12 * (n + 1)).tolist(),
                "y": off.tolist(),
                "name": plain(label),
                "meta": {"series": label},
                "hoverinfo": "text",
                "cliponaxis": False,
                "marker": {"symbol": symbol, "size": 9, "color": style.model_style(label, n)[0]},
                "hovertext": [
                    f"measured {a:.5g} Hz<br>{plain(label)}: {b:.5g} Hz, {d:+.3g} %".replace("-", "−")
                    for a, b, d in zip(f, g, off, strict=True)
                ],
                "customdata": g.tolist(),
            }
        )
    predicted = np.zeros(f.size, bool) if held_out is None else np.asarray(held_out, dtype=bool)
    if predicted.any():
        traces.append(key("predicted, not fitted", style.HELD_OUT))
    step = -(-f.size // 20)
    zero = {"zeroline": True, "zerolinecolor": style.MUTED, "zerolinewidth": 1}
    look = layout(
        height,
        title,
        shapes=shaded((int(k) - 0.4, int(k) + 0.6) for k in np.flatnonzero(predicted)),
        xaxis=axis(
            "measured natural frequency [Hz]",
            tickvals=at[::step].tolist(),
            showgrid=False,
            ticktext=[f"{x:.4g}" for x in f[::step]],
            range=[-0.6, f.size - 0.2],
        ),
        yaxis=axis("computed less measured [%]", **zero),
    )
    return Figure(traces, look)


def mac_figure(
    mac: ArrayLike, measured: Sequence[str], computed: Sequence[str], *, title: str = ""
) -> Figure:
    """Return modal assurance criteria of measured with computed shapes as a map.

    Parameters
    ----------
    mac : array_like (n_measured, n_computed)
        [-].
    measured, computed : sequence of str
        Names of the modes, such as their frequencies.
    title : str

    Raises
    ------
    ValueError
        If the matrix has another shape.
    """
    values = np.array(mac, dtype=float, ndmin=2)
    n, m = values.shape
    if (n, m) != (len(measured), len(computed)):
        msg = f"the MAC has shape {values.shape} for {len(measured)} measured and {len(computed)} modes"
        raise ValueError(msg)
    trace = heat_map(values, "MAC", style.agreement_map(), 0.0, 1.0)
    trace["hovertext"] = [
        [f"measured {plain(a)}, computed {plain(b)}: {v:.3f}" for b, v in zip(computed, row, strict=True)]
        for a, row in zip(measured, values, strict=True)
    ]
    if max(n, m) <= MOST_NUMBERS:
        trace |= {"texttemplate": "%{z:.2f}", "textfont": {"size": 10}}
    look = layout(
        124 + 24 * n,
        title,
        legend=False,
        plot_bgcolor=CELL,
        xaxis=named_axis([plain(s) for s in computed], "computed [Hz]"),
        yaxis=rows_axis([plain(s) for s in measured], "measured [Hz]"),
    )
    return Figure([trace], look)
