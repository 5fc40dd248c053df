"""Pictures of joints: dynamic stiffness over frequency with confidence bands and laws."""

import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from fem.array_types import Floats
from joint.physics import StiffnessLaw
from viz import style
from viz.axes import legend_above

_PARTS = ((np.real, "Re"), (np.imag, "Im"))


def plot_stiffness_entries(
    frequency: ArrayLike,
    curves: Mapping[str, ArrayLike],
    entries: Sequence[tuple[int, int]],
    labels: Sequence[str],
    bands: Mapping[str, ArrayLike] | None = None,
    *,
    parts: str = "both",
    level: float = 1.96,
    title: str = "",
    focus: str | None = None,
) -> Figure:
    """Plot entries of joints' dynamic stiffness matrices over frequency.

    Parameters
    ----------
    frequency : array_like (n_freq,)
        Frequencies [Hz].
    curves : mapping of str to array_like (n_freq, N, N)
        Dynamic stiffness by label [N/m, N/rad, N·m/m, N·m/rad]; the first is drawn as points, the others as
        lines.
    entries : sequence of (int, int)
        Rows and columns to plot, one axis each.
    labels : sequence of str
        Names of the N coordinates.
    bands : mapping of str to array_like (n_freq, N, N), optional
        Standard deviations of real and imaginary part, as complex numbers, of some of the curves: shaded as
        confidence bands.
    parts : str
        ``"real"``, ``"imag"`` or ``"both"``.
    level : float
        Half width of the band in standard deviations [-].
    title : str
        Heading.
    focus : str, optional
        A curve: the axes are kept to ten times its size, and to the other lines, however far points scatter.

    Raises
    ------
    ValueError
        If a curve or band does not have the shape of the others, an entry, a part or a curve that is named is
        not there, or there is nothing to plot.
    """
    f = np.asarray(frequency, dtype=float)
    data = {name: np.asarray(Z, dtype=complex) for name, Z in curves.items()}
    shaded = {name: np.asarray(Z, dtype=complex) for name, Z in (bands or {}).items()}
    shape = (f.size, len(labels), len(labels))
    for name, Z in (*data.items(), *shaded.items()):
        if Z.shape != shape:
            msg = f"'{name}' has shape {Z.shape}; {shape} is needed"
            raise ValueError(msg)
    if not data or not entries:
        msg = "there is nothing to plot: at least one curve and one entry are needed"
        raise ValueError(msg)
    for name in (*shaded, *([focus] if focus is not None else [])):
        if name not in data:
            msg = f"there is no curve '{name}'; the curves are {', '.join(data)}"
            raise ValueError(msg)
    if parts not in ("both", "real", "imag"):
        msg = f"parts is '{parts}'; allowed are both, real, imag"
        raise ValueError(msg)
    for entry in entries:
        if not all(0 <= k < len(labels) for k in entry):
            msg = f"there is no entry {tuple(entry)}; rows and columns count from 0 to {len(labels) - 1}"
            raise ValueError(msg)
    shown = [p for p in _PARTS if parts == "both" or p[1].lower() == {"real": "re", "imag": "im"}.get(parts)]
    n = len(entries)
    with style.look():
        figure = style.new_figure(height=0.9 + 1.7 * n)
        axes = figure.subplots(n, len(shown), sharex=True, squeeze=False)
        for row, (i, j) in zip(axes, entries, strict=True):
            for ax, (part, word) in zip(row, shown, strict=True):
                for k, (name, Z) in enumerate(data.items()):
                    _draw(ax, f, part(Z[:, i, j]), k, name)
                    if name in shaded:
                        half = level * part(shaded[name][:, i, j])
                        colour = style.MODELS[max(k, 1) % len(style.MODELS)][0]
                        low, high = part(Z[:, i, j]) - half, part(Z[:, i, j]) + half
                        ax.fill_between(f, low, high, color=colour, alpha=0.25, linewidth=0, zorder=1)
                wide = [
                    part(data[name][:, i, j]) + sign * level * part(X[:, i, j])
                    for name, X in shaded.items()
                    for sign in (-1, 1)
                ]
                _limits(ax, [part(Z[:, i, j]) for Z in data.values()] + wide)
                if focus is not None:
                    others = [np.nanmax(np.abs(Z[:, i, j]), initial=0.0) for Z in list(data.values())[1:]]
                    size = max(10 * float(np.abs(data[focus][:, i, j]).max()), 1.2 * max(others))
                    low, high = ax.get_ylim()
                    ax.set_ylim(max(low, -size), min(high, size))
                ax.set_ylabel(f"{word} Z({labels[i]}, {labels[j]})\n[{_unit(labels[i], labels[j])}]")
                ax.set_xlim(f[0], f[-1])
        for ax in axes[-1]:
            ax.set_xlabel("frequency [Hz]")
        legend_above(figure, title, axes[0, 0].get_legend_handles_labels()[0])
    return figure


def plot_stiffness_laws(laws: Sequence[StiffnessLaw], title: str = "") -> Figure:
    """Plot the identified stiffness of each direction of a joint and the law that fits it best.

    Parameters
    ----------
    laws : sequence of StiffnessLaw
        From `joint.physics.explain_stiffness`.
    title : str
        Heading.
    """
    with style.look():
        figure = style.new_figure(height=0.8 + 2.0 * len(laws))
        axes = figure.subplots(len(laws), 2, sharex=True, squeeze=False)
        for row, law in zip(axes, laws, strict=True):
            fitted = law.best.stiffness(law.frequency)
            for ax, (part, word) in zip(row, _PARTS, strict=True):
                _draw(ax, law.frequency, part(law.Z), 0, "identified")
                _draw(ax, law.frequency, part(fitted), 2, "best law")
                if law.rivals:
                    _draw(ax, law.frequency, part(law.rivals[0].stiffness(law.frequency)), 1, "nearest rival")
                _limits(ax, [part(law.Z), part(fitted)], part(fitted))
                ax.set_ylabel(f"{word} Z [{_unit(law.name, law.name)}]")
                ax.set_xlim(law.frequency[0], law.frequency[-1])
            row[0].set_title("\n".join(textwrap.wrap(law.sentence, 62)), fontsize=8, fontweight="normal")
        for ax in axes[-1]:
            ax.set_xlabel("frequency [Hz]")
        legend_above(figure, title, axes[0, 0].get_legend_handles_labels()[0])
    return figure


def _draw(ax: Axes, f: Floats, y: NDArray[Any], k: int, label: str) -> None:
    if k == 0:
        ax.plot(f, y, ".", color=style.MEASURED, markersize=2.6, label=label, zorder=2)
        return
    colour, line = style.MODELS[k % len(style.MODELS)]
    ax.plot(f, y, color=colour, linestyle=line, linewidth=1.4, label=label, zorder=3)


def _limits(ax: Axes, curves: Sequence[NDArray[Any]], guide: NDArray[Any] | None = None) -> None:
    """Leave out wild lines: the middle 96 % of all values, and all of a guiding curve, are seen."""
    values = np.concatenate([c[np.isfinite(c)] for c in curves])
    low, high = np.percentile(values, [2, 98])
    if guide is not None:
        low, high = min(low, guide.min()), max(high, guide.max())
    margin = 0.12 * (high - low) or 0.1 * abs(high) or 1.0
    ax.set_ylim(low - margin, high + margin)


def _unit(row: str, column: str) -> str:
    turn = [name.rpartition(":")[2].startswith("r") for name in (row, column)]
    return f"{'N·m' if turn[0] else 'N'}/{'rad' if turn[1] else 'm'}"
