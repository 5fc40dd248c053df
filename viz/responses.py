"""Responses to motions of the base, in time, to spectra and to random loads, as matplotlib figures."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure

from fem.analysis.frf import FRF
from fem.analysis.tabulated import Tabulated
from fem.array_types import Floats
from viz import style
from viz.chart import Axis, Chart, Curve, Panel
from viz.curves import frequency_axis
from viz.still import draw

_MOST_CURVES = 6
_DEEPEST = 1e-8
"""Least value of a logarithmic axis, relative to the largest: responses that are rounding lie below [-]."""


def plot_transmissibility(frf: FRF, response: str, *, relative: bool = False) -> Figure:
    """Plot the amplitudes of responses to a motion of the base, one panel for each motion.

    Parameters
    ----------
    frf : FRF
        As :func:`fem.analysis.base_excitation.compute_base_frf` gives it.
    response : str
        What responds: ``"displacement"``, ``"velocity"`` or ``"acceleration"``.
    relative : bool
        Whether responses are relative to the base.
    """
    unit = {"displacement": "m/m", "velocity": "(m/s)/m", "acceleration": "(m/s²)/m"}[response]
    panels = []
    for j, motion in enumerate(frf.inputs):
        sizes = np.abs(frf.H[:, :_MOST_CURVES, j])
        limits = _limits(sizes, sizes)
        label = f"{'relative ' * relative}{response} [{unit}]\n{motion}"
        panels.append(Panel(_curves(frf.frequency, sizes, frf.outputs), Axis(label, limits, log=True), 1.0))
    return _stacked(panels, frequency_axis(frf.frequency), _heading("", len(frf.outputs)))


def plot_histories(
    time: Floats, panels: Sequence[tuple[str, Floats]], names: Sequence[str], title: str = ""
) -> Figure:
    """Plot histories over time.

    Parameters
    ----------
    time : ndarray (n_t,)
        [s].
    panels : sequence of (str, ndarray (n_t, n))
        Label of the axis with its unit, and the histories, one curve each.
    names : sequence of str
        Of the curves, n.
    title : str
        Heading.
    """
    x = Axis("time [s]", (float(time[0]), float(time[-1])))
    shown = [Panel(_curves(time, values, names), Axis(label), 1.0) for label, values in panels]
    return _stacked(shown, x, _heading(title, len(names)))


def plot_densities(
    frequency: Floats, densities: Floats, names: Sequence[str], unit: str, title: str = ""
) -> Figure:
    """Plot power spectral densities over frequency, both axes logarithmic.

    Parameters
    ----------
    frequency : ndarray (n_freq,)
        [Hz].
    densities : ndarray (n_freq, n)
        One-sided densities.
    names : sequence of str
        Of the curves, n.
    unit : str
        Of the densities, such as ``"(m/s²)²/Hz"``.
    title : str
        Heading.
    """
    values = np.maximum(densities[:, :_MOST_CURVES], 1e-300)
    curves = _curves(frequency, values, names)
    y = Axis(f"power spectral density [{unit}]", _limits(values, densities), log=True)
    return draw(Chart(curves, frequency_axis(frequency, log=True), y, _heading(title, len(names))))


def plot_spectra(spectra: Mapping[str, Tabulated], frequencies: Floats, title: str = "") -> Figure:
    """Plot response spectra of the base, with a mark at each mode.

    Parameters
    ----------
    spectra : mapping of str to Tabulated
        Pseudo-acceleration by direction [m/s²].
    frequencies : ndarray (n_modes,)
        Natural frequencies [Hz].
    title : str
        Heading.
    """
    low = float(min(*(s.frequency[0] for s in spectra.values()), frequencies.min()))
    high = float(max(*(s.frequency[-1] for s in spectra.values()), frequencies.max()))
    lines = np.geomspace(low, high, 400)
    marks = []
    for (name, spectrum), colour in zip(spectra.items(), style.SERIES, strict=False):
        at_modes = {"x": frequencies, "y": spectrum.at(frequencies), "name": f"modes, {name}"}
        marks.append(Curve(x=lines, y=spectrum.at(lines), name=f"spectrum, {name}", colour=colour, dash="-"))
        marks.append(Curve(**at_modes, colour=colour, symbol="o"))
    y = Axis("pseudo-acceleration [m/s²]", log=True)
    return draw(Chart(marks, Axis("frequency [Hz]", (low, high), log=True), y, title))


def _curves(x: Floats, values: Floats, names: Sequence[str]) -> list[Curve]:
    """Return the first columns of values as curves."""
    each = zip(values.T, names, style.SERIES, strict=False)
    return [Curve(x=x, y=y, name=name, colour=colour, dash="-", width=1.3) for y, name, colour in each]


def _stacked(panels: Sequence[Panel], x: Axis, title: str) -> Figure:
    """Return a figure with panels one over the other that share their abscissa."""
    first, *below = panels
    size = style.WIDTH, 0.9 + (2.6 if not below else 1.9 * len(panels))
    return draw(Chart(first.marks, x, first.y, title, size=size, below=below))


def _heading(title: str, n: int) -> str:
    """Return the heading, with the number of curves that are left out."""
    if n <= _MOST_CURVES:
        return title
    return f"{title}{', ' if title else ''}the first {_MOST_CURVES} of {n}"


def _limits(values: Floats, of: Floats) -> tuple[float, float] | None:
    """Return the ends of a logarithmic axis of values, without those far below the largest of some."""
    shown = values[values > _DEEPEST * of.max(initial=0.0)]
    return (float(shown.min() / 2), float(2 * shown.max())) if shown.size else None
