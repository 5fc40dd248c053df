"""Elements that figures share: legends, heat maps and numbers."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from fem.array_types import Floats
from viz import style


def keys_of(*axes: Axes) -> list[Any]:
    """Return the legend's keys of the curves of several axes, each label once."""
    pairs = (pair for ax in axes for pair in zip(*ax.get_legend_handles_labels(), strict=True))
    return list({label: key for key, label in pairs}.values())


def legend_above(figure: Figure, title: str, keys: Sequence[Any]) -> None:
    """Set the heading and the legend above the axes, in as many columns as the width allows."""
    longest = max((len(str(key.get_label())) for key in keys), default=1)
    columns = max(1, int(figure.get_figwidth() / (0.6 + 0.066 * longest)))
    legend = figure.legend(
        handles=keys,
        loc="outside upper left",
        ncols=min(columns, len(keys)),
        columnspacing=1.4,
        title=title or None,
    )
    legend.set_alignment("left")
    legend.get_title().set(fontsize=9.5, fontweight="bold")


def heat_map(ax: Axes, values: Floats, cmap: Any, norm: Normalize, label: str, digits: int | None) -> None:
    """Draw a matrix as coloured cells and a bar of its colours, with its numbers if digits are given."""
    n, m = values.shape
    cmap = cmap.with_extremes(bad="#f0f1f3")
    image = ax.imshow(values, cmap=cmap, norm=norm, aspect="auto", interpolation="nearest")
    ax.grid(visible=False)
    ax.set_xticks(np.arange(m + 1) - 0.5, minor=True)
    ax.set_yticks(np.arange(n + 1) - 0.5, minor=True)
    ax.grid(visible=True, which="minor", color="white", linewidth=0.8, alpha=1)
    ax.tick_params(which="both", length=0)
    for spine in ax.spines.values():
        spine.set_visible(False)
    if digits is not None:
        for (i, j), value in np.ndenumerate(values):
            if np.isfinite(value):
                ink = style.ink_on(cmap(norm(value)))
                ax.text(j, i, number(value, digits), ha="center", va="center", fontsize=6.8, color=ink)
    bar = ax.figure.colorbar(image, ax=ax, fraction=0.05, pad=0.02, aspect=30)
    bar.set_label(label)
    bar.outline.set_visible(False)


def number(value: float, digits: int) -> str:
    """Return a number with a proper minus sign."""
    return f"{value:.{digits}f}".replace("-", "−")
