"""FRFs over frequency: amplitude, phase and coherence of one pair, and the error of all."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from fem.analysis.frf import FRF
from fem.array_types import Floats
from updating.correlation import DB_PER_NEPER
from updating.measurement.frf_estimation import EstimatedFRF
from viz import still, style
from viz.axes import number
from viz.chart import Axis, Band, Chart, ChartMark, Curve, Panel, Span
from viz.still import draw

MAGNITUDE, PHASE, LOW, HIGH, COHERENCE = "magnitude", "phase", "low", "high", "coherence"
"""Quantities of a figure's marks: ``meta["quantity"]``, beside the curve's label ``meta["series"]``."""
MEASURED = "measured"
_WIDEST = 150.0
"""Prediction bands are drawn no wider than this either way [dB]."""


BELOW_NOISE = "below the noise, 1 σ"


def held_out_spans(bands: Sequence[tuple[float, float]]) -> list[ChartMark]:
    """Return the marks of bands of frequency that were held out from the fit [Hz]."""
    return [
        Span(low=low, high=high, colour=style.HELD_OUT, name="" if k else "held out from the fit")
        for k, (low, high) in enumerate(bands)
    ]


def phase_axis() -> Axis:
    """Return the axis of phases [°]."""
    ticks = [-180, -90, 0, 90, 180]
    return Axis("phase [°]", (-190, 190), (ticks, [number(t, 0) for t in ticks]))


def frequency_axis(frequency: Floats, *, log: bool = False) -> Axis:
    """Return the axis of frequencies [Hz] from the first line to the last; a logarithmic one leaves out 0."""
    shown = frequency[frequency > 0] if log else frequency
    return Axis("frequency [Hz]", (float(shown[0]), float(shown[-1])), log=log)


@dataclass(frozen=True, slots=True, eq=False)
class Curves:
    """The FRFs of one source, for all pairs, as they are drawn.

    Attributes
    ----------
    label, colour, dash : str
        Dash as matplotlib spells it.
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
    label: str = MEASURED,
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
    out = [_curves(label, measured, style.MEASURED, "-", None)] if measured else []
    if measured is not None and compared is not None and not np.all(compared):
        seen = replace(measured, H=np.where(compared, measured.H, 0.0))
        pale = replace(out[0], label=style.NOT_COMPARED_LABEL, colour=style.NOT_COMPARED)
        out = [pale, _curves(label, seen, style.MEASURED, "-", None)]
    for n, (name, model) in enumerate((models or {}).items()):
        colour, line = style.model_style(name, n)
        spread = (deviations or {}).get(name)
        out.append(_curves(name, model.as_kind(kind) if kind else model, colour, line, spread))
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
        else np.minimum(1.96 * DB_PER_NEPER * np.asarray(deviation, dtype=float), _WIDEST)
    )
    return Curves(label, colour, dash, frf.frequency, magnitude, phase, spread, frf.outputs, frf.inputs)


def frf(
    measured: FRF | None,
    models: Mapping[str, FRF] | None = None,
    pair: tuple[str, str] | None = None,
    *,
    deviations: Mapping[str, ArrayLike] | None = None,
    held_out: Sequence[tuple[float, float]] = (),
    coherence: ArrayLike | None = None,
    compared: ArrayLike | None = None,
    floor: ArrayLike | None = None,
    label: str = MEASURED,
    log_frequency: bool = False,
    title: str | None = None,
    height: float = 520,
) -> Chart:
    """Describe amplitude and phase of one FRF, measured and of models, over frequency.

    If the measured FRFs are amplitudes without phase, no phase is drawn.

    Every curve's ``meta`` has its ``series`` (the label) and ``quantity`` (``magnitude``, ``phase``, ``low``
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
    floor : array_like, optional
        Standard deviation of the measured FRFs, of the shape of ``measured.H`` or one that broadcasts to it
        [unit of ``measured``].
    label : str
        Of the measured curve.
    log_frequency : bool
        Whether the axis of frequency is logarithmic.
    title : str
        Heading; ``output / input`` unless given.
    height : float
        Of an interactive figure [pixel].

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
    for known in (measured, *(models or {}).values()):
        if known is not None:
            known.select([pair[0]], [pair[1]])
    o, i = first.outputs.index(pair[0]), first.inputs.index(pair[1])
    shown, f = first.select([pair[0]], [pair[1]]), first.frequency
    curves = frf_curves(measured, models, deviations, compared, label)
    limits = magnitude_range(curves[0].of(pair)[0])
    top: list[ChartMark] = held_out_spans(held_out)
    if floor is not None:
        sigma = np.broadcast_to(np.asarray(floor, dtype=float), first.H.shape)[:, o, i]
        noise = 20 * np.log10(np.maximum(sigma, 1e-300))
        top.append(Band(x=f, low=limits[0] - 100, high=noise, colour=style.NOISE, name=BELOW_NOISE))
    phases: list[ChartMark] = []
    for c in curves:
        magnitude, phase, spread = c.of(pair)
        if spread is not None:
            ends: dict[str, Any] = {"low": magnitude - spread, "high": magnitude + spread}
            band = Band(x=c.frequency, **ends, colour=c.colour, opacity=0.22, name=f"{c.label}, 95 %")
            top.append(replace(band, meta={"series": c.label}))
        pale = c.label == style.NOT_COMPARED_LABEL  # below the dark curve, which has the same values
        look: dict[str, Any] = {"name": c.label, "colour": c.colour, "dash": c.dash}
        look["width"] = 2.4 if c.label == label and measured else 1.6
        meta, hover = {"series": c.label, "quantity": MAGNITUDE}, "" if pale else "{y:.2f} dB"
        top.append(Curve(x=c.frequency, y=magnitude, hover=hover, meta=meta, **look))
        if phase is not None:
            x, y = without_wraps(c.frequency, phase)
            meta, hover = {"series": c.label, "quantity": PHASE}, "" if pale else "{y:.1f}°"
            phases.append(Curve(x=x, y=y, hover=hover, meta=meta, keyed=False, **look))
    below = []
    if phases:
        below.append(Panel(phases, phase_axis(), 0.5))
    if coherence is not None and measured is not None:
        gamma, meta = np.asarray(coherence)[:, o, i], {"series": MEASURED, "quantity": COHERENCE}
        more: dict[str, Any] = {"hover": "γ² {y:.3f}", "name": COHERENCE, "keyed": False, "meta": meta}
        axis = Axis("γ² [-]", (-0.02, 1.04), ([0, 0.5, 1], ["0", "0.5", "1"]))
        below.append(Panel([Curve(x=f, y=gamma, dash="-", width=1.2, **more)], axis, 0.25))
    return Chart(
        top,
        frequency_axis(f, log=log_frequency),
        Axis(shown.quantity, limits, decibels=shown.unit),
        f"{pair[0]} / {pair[1]}" if title is None else title,
        height,
        (style.WIDTH, 4.0),
        below=below,
        compares=True,
        meta={"output": pair[0], "input": pair[1]},
    )


def plot_frf(
    measured: FRF,
    models: Mapping[str, FRF] | None = None,
    pairs: Sequence[tuple[str, str]] | None = None,
    *,
    compared: ArrayLike | None = None,
    title: str = "",
    **more: Any,
) -> Figure:
    """Plot several FRFs in one still picture, each as :func:`frf` describes it.

    Parameters
    ----------
    measured : FRF
    models : mapping of str to FRF, optional
        By label, in the order nominal, fitted, with the effect; converted to the measured kind.
    pairs : sequence of (output, input), optional
        Pairs to plot, by label; the first four pairs unless given.
    compared : array_like of bool (n_freq, n_out, n_in), optional
        Which measured values errors are of; the others are drawn pale.
    title : str
        Heading.
    **more
        Further arguments of :func:`frf`.
    """
    pictures = []
    for o, i in frf_pairs(measured, pairs, 4):
        index = measured.outputs.index(o), measured.inputs.index(i)
        some = compared is not None and not np.asarray(compared)[:, *index].all()
        pictures.append(frf(measured, models, (o, i), compared=compared if some else None, **more))
    return still.draw(pictures, title)


def magnitude_range(magnitude: ArrayLike) -> tuple[float, float]:
    """Return the ends of the amplitude's axis, which leave out only the deepest antiresonances [dB]."""
    known = np.asarray(magnitude, dtype=float)
    known = known[np.isfinite(known)]
    if not known.size:
        return -1.0, 1.0
    low, high = float(np.percentile(known, 0.3)), float(known.max())
    room = 0.12 * max(high - low, 20.0)
    return low - room, high + room


def without_wraps(f: Floats, phase: Floats) -> tuple[Floats, Floats]:
    """Return a phase with a gap wherever it jumps by more than half a turn, and its frequencies."""
    wraps = np.flatnonzero(np.abs(np.diff(phase)) > 180) + 1
    return np.insert(f, wraps, f[wraps]), np.insert(phase, wraps, np.nan)


def error_curves(
    frequency: ArrayLike,
    errors: Mapping[str, ArrayLike],
    *,
    floor: ArrayLike | None = None,
    held_out: Sequence[tuple[float, float]] = (),
) -> Chart:
    """Describe the error of models over frequency, as :func:`frf_errors` gives it.

    Parameters
    ----------
    frequency : array_like (n_freq,)
        [Hz].
    errors : mapping of str to array_like (n_freq,)
        Relative error of each model, by label in the order nominal, fitted, with the effect [dB].
    floor : array_like (n_freq,), optional
        Relative error that noise alone would leave [dB].
    held_out : sequence of (low, high)
        Bands that were kept from the fit, shaded [Hz].
    """
    f = np.asarray(frequency, dtype=float)
    shown = [np.asarray(e, dtype=float) for e in errors.values()]
    ends = [end for e in shown for end in (np.nanpercentile(e, 1), np.nanmax(e))] or [-60.0, 0.0]
    ends += [] if floor is None else [min(ends), float(np.nanmedian(np.asarray(floor))) - 3]
    marks = held_out_spans(held_out)
    if floor is not None:
        marks.append(Band(x=f, low=min(ends) - 100, high=floor, colour=style.NOISE, name=BELOW_NOISE))
    for n, (label, e) in enumerate(zip(errors, shown, strict=True)):
        colour, dash = style.model_style(label, n)
        look: dict[str, Any] = {"name": label, "colour": colour, "dash": dash, "hover": "{y:.1f} dB"}
        marks.append(Curve(x=f, y=e, meta={"series": label, "quantity": "error"}, **look))
    y = Axis("relative error [dB]", (min(ends) - 4, max(ends) + 4))
    return Chart(marks, frequency_axis(f), y, "", 320, (style.WIDTH, 2.9), compares=True)


def frf_errors(
    measured: FRF,
    models: Mapping[str, FRF],
    pairs: Sequence[tuple[str, str]] | None = None,
    floor: ArrayLike | None = None,
    smooth: int = 1,
) -> tuple[dict[str, Floats], Floats | None]:
    """Return the error of models over frequency, 10 lg (Σ |H_model - H|² / Σ |H|²), summed over pairs.

    Strains count as much as motions: all values of either are divided by the root mean square over all lines.

    Parameters
    ----------
    measured : FRF
    models : mapping of str to FRF
        By label, on the measured lines.
    pairs : sequence of (output, input), optional
        Pairs to sum over; all unless given.
    floor : array_like, optional
        Standard deviation of the measured FRF, of the shape of ``measured.H`` or one that broadcasts to it.
    smooth : int
        Number of lines over which both sums run, to calm noisy curves.

    Returns
    -------
    tuple of dict of str to ndarray (n_freq,), ndarray (n_freq,) or None
        Errors by label, and the noise's [dB]; NaN where nothing was measured.

    Raises
    ------
    ValueError
        If a model is not on the measured lines.
    """
    pairs = frf_pairs(measured, pairs, None)
    index = [(measured.outputs.index(o), measured.inputs.index(i)) for o, i in pairs]
    rows, cols = (np.array(k) for k in zip(*index, strict=True))
    H, size = measured.H[:, rows, cols], np.ones(rows.size)
    strain = measured.is_strain[rows]
    if strain.any() and not strain.all():
        for alike in (strain, ~strain):
            size[alike] = np.sqrt((np.abs(H[:, alike]) ** 2).mean()) or 1.0
    H = H / size
    power = _moving(np.sum(np.abs(H) ** 2, axis=1), smooth)
    power = np.where(power > 0, power, np.nan)
    noise = None
    if floor is not None:
        sigma = np.broadcast_to(np.asarray(floor, dtype=float), measured.H.shape)[:, rows, cols]
        noise = 10 * np.log10(_moving(np.sum((sigma / size) ** 2, axis=1), smooth) / power)
    out = {}
    for label, model in models.items():
        if model.n_freq != measured.n_freq or not np.allclose(model.frequency, measured.frequency):
            msg = f"model '{label}' has {model.n_freq} lines, not the {measured.n_freq} measured ones"
            raise ValueError(msg)
        part = model.as_kind(measured.kind)
        got = np.stack([part.select([o], [i]).H[:, 0, 0] for o, i in pairs], axis=1) / size
        error = _moving(np.sum(np.abs(got - H) ** 2, axis=1), smooth)
        out[label] = 10 * np.log10(np.maximum(error / power, 1e-30))
    return out, noise


def frf_pairs(
    frf: FRF, pairs: Sequence[tuple[str, str]] | None, at_most: int | None
) -> list[tuple[str, str]]:
    """Return the pairs of output and input to plot, after a check."""
    if pairs is None:
        return [(o, i) for i in frf.inputs for o in frf.outputs][:at_most]
    for output, input_ in pairs:
        frf.select([output], [input_])
    return list(pairs)


def _moving(values: Floats, lines: int) -> Floats:
    """Return the moving average over a number of lines."""
    if lines <= 1:
        return values
    kernel = np.ones(min(lines, values.size))
    return np.convolve(values, kernel, "same") / np.convolve(np.ones(values.size), kernel, "same")


# Picture of FRFs that were estimated from time data: amplitude, phase and coherence -------------------------


def plot_estimate(
    estimate: EstimatedFRF, pairs: Sequence[tuple[str, str]] | None = None, title: str = ""
) -> Figure:
    """Plot estimated FRFs with their standard deviation, and the coherence below each.

    Parameters
    ----------
    estimate : EstimatedFRF
    pairs : sequence of (output, input), optional
        FRFs to plot, by label; the first four unless given.
    title : str
        Heading.
    """
    sigma = estimate.std if np.isfinite(estimate.std).any() else None
    shown = {"floor": sigma, "coherence": estimate.coherence, "label": "estimated"}
    return draw([frf(estimate.frf, None, pair, **shown) for pair in frf_pairs(estimate.frf, pairs, 4)], title)
