"""Pictures of correlation: criteria over DOFs and lines, mode pairs, pretest plans and matched geometry."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import ArrayLike

from fem.array_types import Floats
from fem.mesh import Mesh
from fem.model import Model
from updating.correlation.frf_correlation import BandError
from updating.correlation.pairing import ModeComparison
from updating.measurement.matching import GeometryMatch
from updating.measurement.pretest import PretestPlan
from viz import style
from viz.axes import heat_map, legend_above
from viz.chart import Axis, Chart, Curve, Matrix, columns, rows
from viz.curves import frequency_axis
from viz.heat_maps import error_map
from viz.shapes import view_axes
from viz.still import draw


def plot_coordinates(values: Mapping[str, ArrayLike], names: Sequence[str], mark: int = 3) -> Figure:
    """Plot criteria over DOFs as bars, one panel each, with the worst DOFs coloured.

    Parameters
    ----------
    values : mapping of str to array_like (n_dof,)
        By label, such as ``{"CoMAC": …, "ECoMAC": …}``, 0 to 1 [-]. Labels that begin with "E" are errors,
        for which large is bad; for others small is.
    names : sequence of n_dof str
        Names of the DOFs.
    mark : int
        Number of worst DOFs that are coloured and named above their bars.

    Raises
    ------
    ValueError
        If numbers differ.
    """
    n = len(names)
    with style.look():
        figure = style.new_figure(height=0.6 + 1.6 * len(values))
        axes = figure.subplots(len(values), 1, sharex=True, squeeze=False)[:, 0]
        for ax, (label, data) in zip(axes, values.items(), strict=True):
            v = np.asarray(data, dtype=float)
            if v.shape != (n,):
                msg = f"'{label}' has shape {v.shape} for {n} names"
                raise ValueError(msg)
            bad_is_large = label.startswith("E")
            worst = np.argsort(-v if bad_is_large else v, kind="stable")[:mark]
            colour = [style.EFFECT if k in worst else "#b9c3cd" for k in range(n)]
            ax.bar(np.arange(n), v, color=colour, width=0.8)
            for k in worst:
                ax.annotate(
                    names[k], (k, v[k]), xytext=(0, 2), textcoords="offset points", ha="center", fontsize=7
                )
            ax.set_ylim(0, 1.12 if not bad_is_large else max(1.25 * float(v.max(initial=0.0)), 1e-3))
            ax.set_ylabel(f"{label} [-]")
            ax.grid(visible=False, axis="x")
        step = -(-n // 40)
        axes[-1].set_xticks(
            np.arange(0, n, step), list(names)[::step], rotation=90 if n > 12 else 0, fontsize=7
        )
        axes[-1].set_xlim(-0.7, n - 0.3)
    return figure


def plot_fdac(
    frequency_x: ArrayLike,
    frequency_a: ArrayLike,
    values: ArrayLike,
    title: str = "",
    ratio: float | None = None,
) -> Figure:
    """Plot the FDAC of one force as a map: equal frequencies lie on the dashed line.

    Parameters
    ----------
    frequency_x, frequency_a : array_like (n_freq_x,), (n_freq_a,)
        Lines of the measured and the computed FRFs, rising [Hz].
    values : array_like (n_freq_x, n_freq_a)
        0 to 1 [-].
    title : str
        Heading.
    ratio : float, optional
        A frequency ratio computed over measured, drawn as another line.

    Raises
    ------
    ValueError
        If the shape does not fit the lines.
    """
    fx, fa, v = (np.asarray(p, dtype=float) for p in (frequency_x, frequency_a, values))
    if v.shape != (fx.size, fa.size):
        msg = f"the FDAC has shape {v.shape} for {fx.size} measured and {fa.size} computed lines"
        raise ValueError(msg)
    with style.look():
        figure = style.new_figure(5.4, 4.6)
        ax = figure.add_subplot()
        image = ax.pcolormesh(
            fx, fa, v.T, cmap=style.agreement_map(), norm=Normalize(0, 1), shading="nearest", rasterized=True
        )
        ax.axline((0, 0), slope=1, color=style.INK, linestyle="--", linewidth=0.9, label="equal frequencies")
        if ratio is not None:
            ax.axline(
                (0, 0),
                slope=ratio,
                color=style.EFFECT,
                linestyle="-",
                linewidth=0.9,
                label=f"ratio {ratio:.3g}",
            )
        ax.set_xlim(fx[0], fx[-1])
        ax.set_ylim(fa[0], fa[-1])
        ax.set_xlabel("frequency, measured [Hz]")
        ax.set_ylabel("frequency, computed [Hz]")
        ax.grid(visible=False)
        bar = figure.colorbar(image, ax=ax, fraction=0.05, pad=0.02, aspect=30)
        bar.set_label("FDAC [-]")
        bar.outline.set_visible(False)
        legend_above(figure, title, ax.get_legend_handles_labels()[0])
    return figure


def plot_signature(frequency: ArrayLike, curves: Mapping[str, ArrayLike], modes: ArrayLike = ()) -> Figure:
    """Plot criteria over frequency, such as CSAC and CSF.

    Parameters
    ----------
    frequency : array_like (n_freq,)
        [Hz].
    curves : mapping of str to array_like (n_freq,) or (n_freq, n_in)
        By label, 0 to 1 [-]; the forces of one label are drawn alike.
    modes : array_like
        Measured natural frequencies, drawn as ticks [Hz].
    """
    f, ticks = np.asarray(frequency, dtype=float), np.asarray(modes, dtype=float)
    marks = [
        Curve(x=f, y=column, name=label, keyed=j == 0, colour=style.SERIES[k % len(style.SERIES)], dash="-")
        for k, (label, data) in enumerate(curves.items())
        for j, column in enumerate(np.asarray(data, dtype=float).reshape(f.size, -1).T)
    ]
    if ticks.size:
        marks.append(Curve(x=ticks, y=np.full(ticks.size, 0.02), symbol="^", name="measured modes"))
    y = Axis("agreement [-]", (0, 1.03))
    return draw(Chart(marks, frequency_axis(f), y, size=(style.WIDTH, 2.9)))


def plot_agreement(
    values: ArrayLike, row_names: Sequence[str], column_names: Sequence[str], label: str
) -> Figure:
    """Plot a matrix of values from 0 to 1 with its numbers: FRAC or SAC over sensors and forces.

    Parameters
    ----------
    values : array_like (n_rows, n_columns)
        [-].
    row_names, column_names : sequence of str
    label : str
        Quantity of the colours, such as ``"SAC [-]"``.

    Raises
    ------
    ValueError
        If numbers differ.
    """
    v = np.array(values, dtype=float, ndmin=2)
    return draw(_agreement(v, (row_names, column_names), ("", ""), label, 1.2 + 0.24 * len(v)))


def plot_orthogonality(
    values: ArrayLike,
    labels: tuple[Sequence[str], Sequence[str]],
    names: tuple[str, str] = ("measured", "computed"),
    limit: float = 0.1,
) -> Figure:
    """Plot a mass orthogonality (POC) as a matrix; entries off the diagonal and above the limit are framed.

    Parameters
    ----------
    values : array_like (n_x, n_a)
        Of ``orthogonality`` or ``cross_orthogonality``, the pairs on the diagonal; drawn by size [-].
    labels : (sequence of n_x str, sequence of n_a str)
        Names of the modes.
    names : (str, str)
        Names of the rows and of the columns.
    limit : float
        Largest size off the diagonal; on it, pairs below 1 - limit are framed too [-].

    Raises
    ------
    ValueError
        If numbers differ.
    """
    v = np.abs(np.array(values, ndmin=2))
    figure = draw(_agreement(v, labels, names, "size of φᵀMφ [-]", 1.4 + 0.3 * len(v)))
    on = np.eye(*v.shape, dtype=bool)
    for i, j in np.argwhere(np.where(on, v < 1 - limit, v > limit)):
        frame = Rectangle((j - 0.48, i - 0.48), 0.96, 0.96, fill=False, edgecolor=style.VERMILION)
        figure.axes[0].add_patch(frame).set_linewidth(1.6)
    return figure


def band_error_map(error: BandError, outputs: Sequence[str], what: str = "log_error") -> Chart:
    """Describe errors of FRFs by sensor and band as a heat map, summed over the forces.

    Parameters
    ----------
    error : BandError
    outputs : sequence of str
        Names of the sensors.
    what : str
        ``"relative"``, ``"level_db"`` or ``"log_error"``, the methods of the error.

    Raises
    ------
    ValueError
        For another kind of error, or numbers that differ.
    """
    labels = {
        "relative": ("difference over measured", "-"),
        "level_db": ("level", "dB"),
        "log_error": ("logarithmic error", "-"),
    }
    if what not in labels:
        msg = f"errors '{what}' are not known; allowed are {', '.join(labels)}"
        raise ValueError(msg)
    parts = ("measured", "computed", "difference", "log_square", "n_log")
    summed = replace(error, **{part: getattr(error, part).sum(axis=2, keepdims=True) for part in parts})
    values = getattr(summed, what)("each")[:, :, 0].T
    if len(values) != len(outputs):
        msg = f"the errors have {len(values)} outputs; {len(outputs)} names are given"
        raise ValueError(msg)
    bands = [f"{a:.4g} to {b:.4g} Hz" for a, b in zip(error.bands[:-1], error.bands[1:], strict=True)]
    top = max(float(np.nanmax(values)), 1e-12) if what != "level_db" and np.isfinite(values).any() else None
    limits = None if top is None else (0.0, top)
    return error_map(values, outputs, bands, *labels[what], limits=limits)


def plot_mode_pairs(comparison: ModeComparison) -> Figure:
    """Plot computed over measured natural frequencies of the pairs, and those that have no partner.

    Parameters
    ----------
    comparison : ModeComparison
    """
    c = comparison
    fa = c.frequency_computed[sorted({j for _, j in c.pairs} | set(c.unpaired_computed))]
    high = 1.08 * max([*c.frequency_measured, *fa], default=1.0)
    with style.look():
        figure = style.new_figure(6.2, 4.6)
        ax = figure.add_subplot()
        x = np.array([0.0, high])
        ax.fill_between(x, 0.95 * x, 1.05 * x, color=style.NOISE, linewidth=0, label="± 5 %")
        ax.plot(x, x, color=style.MUTED, linewidth=0.8)
        for mixed, marker, word in ((False, "o", "pair of modes"), (True, "D", "close modes, as a subspace")):
            rows = [
                (x, a, g.mac)
                for g in c.groups
                if (len(g.subspace) > 1) is mixed
                for x, a in zip(g.frequency_measured, g.frequency_computed, strict=True)
            ]
            if rows:
                px, pa, value = np.array(rows).T
                dots = ax.scatter(
                    px,
                    pa,
                    c=value,
                    marker=marker,
                    cmap=style.agreement_map(),
                    norm=Normalize(0, 1),
                    s=42,
                    edgecolors=style.INK,
                    linewidths=0.7,
                    zorder=3,
                    label=word,
                )
                if not any(a is not ax for a in figure.axes):
                    bar = figure.colorbar(dots, ax=ax, fraction=0.05, pad=0.02, aspect=30)
                    bar.set_label("MAC [-]")
                    bar.outline.set_visible(False)
        for g in c.groups:
            errors = ", ".join(f"{100 * e:+.1f}".replace("-", "−") for e in g.frequency_error)
            at = (float(g.frequency_measured.max()), float(g.frequency_computed.min()))
            ax.annotate(f"{errors} %", at, xytext=(6, -9), textcoords="offset points", fontsize=7)
        for f in c.frequency_measured[list(c.unpaired_measured)]:
            ax.axvline(f, color=style.EFFECT, linestyle=":", linewidth=1)
        for f in c.frequency_computed[list(c.unpaired_computed)]:
            ax.axhline(f, color=style.BLUE, linestyle=":", linewidth=1)
        if c.unpaired_measured:
            ax.plot([], [], color=style.EFFECT, linestyle=":", linewidth=1, label="measured, no partner")
        if c.unpaired_computed:
            ax.plot([], [], color=style.BLUE, linestyle=":", linewidth=1, label="computed, no partner")
        ax.set_xlim(0, high)
        ax.set_ylim(0, high)
        ax.set_xlabel("measured [Hz]")
        ax.set_ylabel("computed [Hz]")
        legend_above(figure, "", ax.get_legend_handles_labels()[0])
    return figure


def plot_pretest(plan: PretestPlan, title: str = "") -> Figure:
    """Plot a pretest plan: the autoMAC at its sensors, and how well modes are observed and excited."""
    o, n = plan.observability, plan.frequency.size
    names = [f"{f:.4g} Hz" for f in plan.frequency]
    with style.look():
        figure = style.new_figure(height=float(np.clip(1.6 + 0.26 * n, 3.0, 8.0)))
        left, right = figure.subplots(1, 2, width_ratios=[1.25, 1])
        digits = 2 if n <= 12 else None
        heat_map(left, o.auto_mac, style.agreement_map(), Normalize(0, 1), "MAC at the sensors [-]", digits)
        left.set_yticks(range(n), names, fontsize=7)
        left.set_xticks(range(n), names, fontsize=7, rotation=60, ha="right", rotation_mode="anchor")
        y = np.arange(n)
        right.barh(y - 0.2, o.seen, 0.38, color=style.SENSOR, label="seen by the sensors")
        right.barh(
            y + 0.2, np.minimum(plan.driven, 1), 0.38, color=style.EXCITATION, label="driven by the exciters"
        )
        right.set_yticks(y, names, fontsize=7)
        right.set_ylim(n - 0.5, -0.5)
        right.set_xlim(0, 1.02)
        right.set_xlabel("share of the possible maximum [-]")
        right.grid(visible=False, axis="y")
        legend_above(figure, title, right.get_legend_handles_labels()[0])
    return figure


def render_pretest(model: Model, plan: PretestPlan, path: str | Path, title: str = "") -> Path:
    """Draw the sensors and exciters of a pretest plan on the structure, and return the file."""
    from viz.render import render_model

    return render_model(model, path, plan.sensors, plan.exciters, title=title)


def plot_geometry_match(
    mesh: Mesh, match: GeometryMatch, names: Sequence[str] | None = None, title: str = ""
) -> Figure:
    """Draw test points on the mesh where a match puts them, with the distances of the pairs.

    Parameters
    ----------
    mesh : Mesh
        Its points are those that were matched.
    match : GeometryMatch
    names : sequence of str, optional
        Names of the test points; their numbers unless given.
    title : str
        Heading; a summary of the match unless given.
    """
    axes = view_axes(mesh.points)[:2]
    points, placed = mesh.points @ axes.T, match.points @ axes.T
    rows, columns = match.pairs.T
    bare = list(match.unmatched)
    words = [str(k) for k in range(len(placed))] if names is None else list(names)
    with style.look():
        figure = style.new_figure(6.4, 5.0)
        ax = figure.add_subplot()
        ax.add_collection(
            LineCollection(list(points[mesh.lines]), colors=style.AT_REST, linewidths=1.2, zorder=1)
        )
        ax.plot(*points.T, ".", color=style.AT_REST, markersize=3, zorder=2, label="mesh points")
        ax.add_collection(
            LineCollection(
                [np.array([placed[i], points[j]]) for i, j in match.pairs],
                colors=style.BLUE,
                linewidths=0.9,
                zorder=3,
            )
        )
        ax.plot(
            *points[columns].T, "o", color="none", markeredgecolor=style.BLUE, markersize=7, label="matched"
        )
        ax.plot(*placed[rows].T, "o", color=style.BLUE, markersize=3.2, zorder=4, label="test points")
        if bare:
            ax.plot(
                *placed[bare].T, "X", color=style.EFFECT, markersize=7, zorder=4, label="without a mesh point"
            )
        for word, at in zip(words, placed, strict=True):
            ax.annotate(word, at, xytext=(5, 4), textcoords="offset points", fontsize=7)
        ax.set_aspect("equal", adjustable="datalim")
        ax.margins(0.06)
        ax.set_axis_off()
        words = match.describe()
        legend_above(figure, title or words[:1].upper() + words[1:], ax.get_legend_handles_labels()[0])
    return figure


def _agreement(
    v: Floats, labels: tuple[Sequence[str], Sequence[str]], names: tuple[str, str], label: str, height: float
) -> Chart:
    """Describe a matrix of values from 0 to 1, with its numbers while they fit."""
    n, m = map(len, labels)
    if v.shape != (n, m):
        msg = f"the values have shape {v.shape} for {n} rows and {m} columns"
        raise ValueError(msg)
    digits = 2 if max(v.shape) <= 12 else None
    cells = Matrix(cells=v, colours=style.agreement_map(), limits=(0.0, 1.0), label=label, digits=digits)
    size = float(np.clip(2.2 + 0.5 * m, 3.4, style.WIDTH)), float(np.clip(height, 2.2, 9))
    return Chart([cells], columns(labels[1], names[1]), rows(labels[0], names[0]), size=size)
