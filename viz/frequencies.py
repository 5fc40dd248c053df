"""Measured and computed modes compared: deviations of frequencies, and modal assurance criteria."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from viz import style
from viz.axes import number
from viz.chart import Axis, Chart, Curve, Matrix, Rule, Span, columns, rows

SYMBOLS = ("o", "s", "D", "P")
"""Of models in the order nominal, fitted, with the effect, others."""
MOST_NUMBERS = 24
"""Largest number of modes of a matrix with printed numbers."""


def deviations(
    measured: ArrayLike,
    std: ArrayLike,
    computed: Mapping[str, ArrayLike],
    held_out: ArrayLike | None = None,
    title: str = "",
) -> Chart:
    """Describe how far computed natural frequencies are from measured ones, mode by mode.

    Bars around zero are two standard deviations of the measurement.

    Parameters
    ----------
    measured : array_like (n,)
        Natural frequencies [Hz].
    std : array_like (n,)
        Relative standard deviations [-].
    computed : mapping of str to array_like (n,)
        Frequencies by the model's label, in the order nominal, fitted, with the effect; NaN where a mode has
        none [Hz]. They are the ``data`` of its marks.
    held_out : array_like of bool (n,), optional
        Modes that no fit has seen, which are shaded.
    title : str

    Raises
    ------
    ValueError
        If there is not one number for each measured mode.
    """
    f, spread = np.asarray(measured, dtype=float), 200 * np.asarray(std, dtype=float)
    at, step = np.arange(f.size), -(-f.size // 20)
    predicted = np.zeros(f.size, bool) if held_out is None else np.asarray(held_out, dtype=bool)
    names = dict.fromkeys(np.flatnonzero(predicted).tolist()[-1:], "predicted, not fitted")
    marks = [
        Curve(
            x=at,
            y=np.zeros(f.size),
            symbol="_",
            spread=spread,
            name="measured ± 2 std",
            hover=[f"measured {x:.5g} Hz ± {s / 2:.2g} %" for x, s in zip(f, spread, strict=True)],
            data=f.tolist(),
            meta={"series": "measured"},
        )
    ]
    for n, (label, values) in enumerate(computed.items()):
        g = np.asarray(values, dtype=float)
        if g.shape != f.shape:
            msg = f"'{label}' has {g.size} frequencies for {f.size} measured modes"
            raise ValueError(msg)
        off = 100 * (g / f - 1)
        marks.append(
            Curve(
                x=at + 0.12 * (n + 1),
                y=off,
                symbol=SYMBOLS[n % len(SYMBOLS)],
                colour=style.model_style(label, n)[0],
                name=label,
                hover=[
                    f"measured {a:.5g} Hz\n{label}: {b:.5g} Hz, {d:+.3g} %".replace("-", "−")
                    for a, b, d in zip(f, g, off, strict=True)
                ],
                data=g.tolist(),
                meta={"series": label},
            )
        )
    marks += [
        Span(low=k - 0.4, high=k + 0.6, colour=style.HELD_OUT, name=names.get(k, ""))
        for k in np.flatnonzero(predicted).tolist()
    ]
    ticks = at[::step].tolist(), [f"{x:.4g}" for x in f[::step]]
    return Chart(
        [*marks, Rule(value=0.0, along="y", colour=style.MUTED)],
        Axis("measured natural frequency [Hz]", (-0.6, f.size - 0.2), ticks, grid=False),
        Axis("computed less measured [%]"),
        title,
        height=400,
    )


def mac_map(
    mac: ArrayLike,
    measured: Sequence[str],
    computed: Sequence[str],
    names: tuple[str, str] = ("measured [Hz]", "computed [Hz]"),
    title: str = "",
) -> Chart:
    """Describe a matrix of modal assurance criteria.

    Parameters
    ----------
    mac : array_like (n_measured, n_computed)
        Values from 0 to 1 [-].
    measured, computed : sequence of str
        Names of the modes, such as their frequencies.
    names : (str, str)
        Labels of rows and columns.
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
    hover = [
        [f"measured {a}, computed {b}: {number(v, 3)}" for b, v in zip(computed, row, strict=True)]
        for a, row in zip(measured, values, strict=True)
    ]
    cell = 0.42 if max(n, m) <= 12 else 0.3
    cells = Matrix(
        cells=values,
        colours=style.agreement_map(),
        limits=(0.0, 1.0),
        label="MAC [-]",
        digits=2 if max(n, m) <= MOST_NUMBERS else None,
        hover=hover,
    )
    size = (float(np.clip(1.9 + cell * m, 3.4, style.WIDTH)), float(np.clip(1.3 + cell * n, 2.6, 9)))
    return Chart([cells], columns(computed, names[1]), rows(measured, names[0]), title, 124 + 24 * n, size)
