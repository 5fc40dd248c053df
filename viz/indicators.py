"""Views of FRFs beside amplitude and phase: Nyquist plot, CMIF, FRAC, and sensitivities."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fem.analysis.frf import FRF
from updating.correlation import cmif as indicator
from viz import style
from viz.chart import Axis, Chart, ChartMark, Curve, RowBars, Rule, decibel, rows
from viz.curves import MEASURED, frequency_axis, held_out_spans
from viz.frequencies import SYMBOLS
from viz.layout import shorten

NYQUIST, SINGULAR, FRAC = "nyquist", "singular value", "frac"
"""Quantities of the curves: ``meta["quantity"]``, beside the curve's label ``meta["series"]``."""


def nyquist(measured: FRF, models: Mapping[str, FRF], pair: tuple[str, str], *, height: float = 520) -> Chart:
    """Describe the imaginary over the real part of one FRF, measured and of models.

    Parameters
    ----------
    measured : FRF
        With phase.
    models : mapping of str to FRF
        By label, of the measured kind.
    pair : (output, input)
    height : float
        Of an interactive figure [pixel].
    """
    chosen = measured.select([pair[0]], [pair[1]])
    marks: list[ChartMark] = [Rule(value=0.0, along=along, colour=style.MUTED) for along in "xy"]
    for look, known in _sources(measured, models):
        H = known.select([pair[0]], [pair[1]]).H[:, 0, 0]
        hover = [f"{f:.5g} Hz\n{look['name']}" for f in known.frequency]
        meta = {"series": look["name"], "quantity": NYQUIST}
        marks.append(Curve(x=H.real, y=H.imag, hover=hover, meta=meta, **look))
    unit = "" if chosen.unit == "-" else f" [{chosen.unit}]"
    return Chart(marks, Axis(f"real part{unit}"), Axis(f"imaginary part{unit}"), height=height, equal=True)


def cmif(
    measured: FRF,
    models: Mapping[str, FRF],
    *,
    held_out: Sequence[tuple[float, float]] = (),
    log_frequency: bool = False,
    height: float = 520,
) -> Chart:
    """Describe the largest singular values of the FRFs at each line, measured and of models.

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
        Of an interactive figure [pixel].
    """
    marks = held_out_spans(held_out)
    for look, known in _sources(measured, models):
        for k, level in enumerate(singular_levels(known.H).T):
            thin: dict[str, Any] = {"width": 1.0, "opacity": 0.55, "keyed": False} if k else {}
            meta = {"series": look["name"], "quantity": f"{SINGULAR} {k + 1}"}
            marks.append(Curve(x=known.frequency, y=level, hover="{y:.2f} dB", meta=meta, **(look | thin)))
    x = frequency_axis(measured.frequency, log=log_frequency)
    y = Axis(f"singular values\n[{decibel(measured.unit)}]")
    return Chart(marks, x, y, height=height, compares=True)


def singular_levels(H: ArrayLike) -> np.ndarray:
    """Return the largest singular values at each line, (n_freq, n) [dB]; NaN where they are 0."""
    # Singular values that are drawn [-]; further ones lie in the noise of most tests
    values = indicator(H)[:, :3]
    return 20 * np.log10(values, where=values > 0, out=np.full(values.shape, np.nan))


def frac(values: Mapping[str, ArrayLike], sensors: Sequence[str], *, force: str = "") -> Chart:
    """Describe the FRAC of each sensor with each model; the ``data`` are the sensors' names, for clicks.

    Parameters
    ----------
    values : mapping of str to array_like (n_sensors,)
        By the model's label, 0 to 1; NaN where nothing is compared.
    sensors : sequence of str
    force : str
        Excitation of these FRFs.
    """
    marks = [
        Curve(
            x=some,
            y=np.arange(len(sensors)),
            name=label,
            symbol=SYMBOLS[n % len(SYMBOLS)],
            colour=style.model_style(label, n)[0],
            hover="{y}: {x:.3f}",
            data=sensors,
            meta={"series": label, "quantity": FRAC},
        )
        for n, (label, some) in enumerate(values.items())
    ]
    words = f"FRAC of FRFs to {force} [-]" if force else "FRAC [-]"
    return _with_rows(marks, sensors, Axis(words, (-0.02, 1.02)))


def sensitivity(
    names: Sequence[str],
    values: ArrayLike,
    hover: Sequence[str],
    added: Sequence[bool],
    label: str = "mean change per standard deviation of the prior [dB]",
) -> Chart:
    """Describe the change of an FRF or a natural frequency by each parameter as bars.

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
    v, is_added = np.asarray(values, dtype=float), np.asarray(added, dtype=bool)
    bars = [
        RowBars(y=at, x=v[at], colour=colour, text=[f"{v[k]:.2g}" for k in at], hover=[hover[k] for k in at])
        for known, colour in ((is_added, style.EFFECT), (~is_added, style.FITTED))
        if (at := np.flatnonzero(known).tolist())
    ]
    return _with_rows(bars, names, Axis(label, (0, 1.12 * float(v.max(initial=1e-6)))))


def _with_rows(marks: Sequence[ChartMark], names: Sequence[str], x: Axis) -> Chart:
    """Describe a figure with a row for each name."""
    named, n = rows([shorten(name, 40) for name in names], grid=True), len(names)
    return Chart(marks, x, named, height=max(112 + 21 * n, 240), size=(style.WIDTH, 1.0 + 0.21 * n))


def _sources(measured: FRF, models: Mapping[str, FRF]) -> list[tuple[dict[str, Any], FRF]]:
    """Return measured and computed FRFs, each with the look of its curves."""
    out = [({"name": MEASURED, "dash": "-", "width": 2.4}, measured)]
    for n, (label, known) in enumerate(models.items()):
        colour, dash = style.model_style(label, n)
        out.append(({"name": label, "colour": colour, "dash": dash}, known))
    return out
