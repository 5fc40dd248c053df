"""One look for every picture: palette, fonts and sizes, shared by the curves and the renderings.

The colours are those of Okabe and Ito (2008), told apart with any common colour blindness; fields are drawn
with colour maps of monotonic lightness, so that they also survive a black-and-white printer.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any, cast

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import Colormap, LinearSegmentedColormap, ListedColormap
from matplotlib.figure import Figure
from PIL import Image

from fem.io.atomic import replacing

INK = "#1f2328"
"""Text, axes and measured data."""
MUTED = "#6e7781"
"""Secondary text and reference lines."""
FAINT = "#d0d7de"
"""Colour of grids and of outlines that are only context."""
BLUE, VERMILION, GREEN, ORANGE = "#0072B2", "#D55E00", "#009E73", "#E69F00"
PURPLE, SKY, YELLOW, GREY = "#CC79A7", "#56B4E9", "#F0E442", "#999999"

MEASURED = INK
NOMINAL, FITTED, EFFECT = GREY, BLUE, VERMILION
SENSOR, EXCITATION, SUPPORT, JOINT, HIGHLIGHT = BLUE, VERMILION, INK, "#7B3294", "#B3005E"
AT_REST = "#98a1ab"
HELD_OUT = "#fff4d6"
NOISE = "#e6e8eb"
NOT_COMPARED = "#b8bec6"
NOT_COMPARED_LABEL = "measured, not compared"
"""Label of measured values that no error is of, as those lost in noise."""

MEMBERS = ("#8fb8d8", "#e8c38a", "#9fcfb8", "#d9a9c2", "#b9b4dc", "#e3a08a", "#c9cf94", "#b5bdc5")
"""Soft versions of the palette for surfaces, on which labels and arrows must stay readable."""

MODELS = ((NOMINAL, "--"), (FITTED, "-."), (EFFECT, "-"), (GREEN, "--"), (PURPLE, "-."), (ORANGE, "-"))
"""Colour and line style of models in the order nominal, fitted, with the effect, others."""

SERIES = (BLUE, VERMILION, GREEN, ORANGE, PURPLE, SKY, GREY)
"""Colours of curves that are no models."""

WIDTH = 7.5
"""Width of a figure [inch]."""
DPI = 160
"""Resolution of a saved figure [1/inch]."""

_RC: dict[str, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 8.5,
    "axes.titlesize": 9.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 8.5,
    "axes.labelcolor": INK,
    "axes.edgecolor": MUTED,
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.unicode_minus": True,
    "grid.color": FAINT,
    "grid.linewidth": 0.5,
    "grid.alpha": 0.7,
    "text.color": INK,
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "xtick.major.width": 0.7,
    "ytick.major.width": 0.7,
    "legend.fontsize": 8,
    "legend.frameon": False,
    "lines.linewidth": 1.3,
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
    "figure.dpi": 100,
    "mathtext.fontset": "dejavusans",
}


@contextmanager
def look() -> Iterator[None]:
    """Use the fonts and colours of Dovetail within a block, and leave matplotlib's settings as they were."""
    with mpl.rc_context(cast(Any, _RC)):
        yield


def new_figure(width: float = WIDTH, height: float = 4.0) -> Figure:
    """Return an empty figure with an Agg canvas, which needs no screen; sizes in inches."""
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def save(figure: Figure, path: str | Path, dpi: float = DPI) -> Path:
    """Write a figure to a file in the format of its suffix (png, pdf, svg) and return the path.

    Raises
    ------
    WriteError
        If the file cannot be written; one that was there before is as it was.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as scratch:
        if path.suffix.lower() == ".png":
            scratch.write_bytes(figure_png(figure, dpi))
        else:
            with look():
                figure.savefig(scratch, dpi=dpi)
    return path


def figure_png(figure: Figure, dpi: float = DPI) -> bytes:
    """Return a figure as PNG.

    It is drawn once: `savefig` draws a figure with a layout engine a first time for its layout alone.
    """
    buffer, before = BytesIO(), figure.dpi
    canvas = FigureCanvasAgg(figure)
    with look():
        figure.set_dpi(dpi)
        canvas.draw()
        image = Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")
        figure.set_dpi(before)
    image.save(buffer, "PNG", dpi=(dpi, dpi))
    return buffer.getvalue()


def displacement_map() -> ListedColormap:
    """Return the colour map of displacement magnitudes: dark blue at rest to yellow at the antinodes."""
    return ListedColormap(mpl.colormaps["viridis"](np.linspace(0.12, 1.0, 256)), "displacement")


def misfit_map() -> LinearSegmentedColormap:
    """Return the colour map of misfits: pale where the model fits, dark red where it does not."""
    stops = ["#fff7d6", "#fed98e", "#fe9929", "#d95f0e", "#a1220a", "#4d0606"]
    return LinearSegmentedColormap.from_list("misfit", stops, N=256)


def agreement_map() -> LinearSegmentedColormap:
    """Return the colour map of correlations from 0 (white) to 1 (dark blue)."""
    return LinearSegmentedColormap.from_list(
        "agreement", ["#ffffff", "#cfe3f2", "#6baed6", BLUE, "#08306b"], N=256
    )


def lighter(cmap: Colormap, by: float) -> ListedColormap:
    """Return a colour map mixed with white, as it looks on surfaces that carry labels."""
    rgba = np.asarray(cmap(np.linspace(0, 1, 256)))
    rgba[:, :3] = by + (1 - by) * rgba[:, :3]
    return ListedColormap(rgba, f"light {cmap.name}")


def model_style(label: str, index: int) -> tuple[str, str]:
    """Return colour and line style of a model's curve.

    A label that begins with "nominal" or "fitted" keeps its colour in every figure; others take theirs from
    their place in the order nominal, fitted, with the effect.
    """
    word = label.lower()
    if word.startswith("nominal"):
        return MODELS[0]
    if word.startswith("fitted"):
        return MODELS[1]
    if word.startswith(("with ", "+")):
        return MODELS[2]
    return MODELS[index % len(MODELS)]


def ink_on(rgba: tuple[float, float, float, float]) -> str:
    """Return black or white, whichever is easier to read on a colour."""
    r, g, b = rgba[:3]
    return INK if 0.299 * r + 0.587 * g + 0.114 * b > 0.55 else "white"
