"""A picture of both structures with an FRF of each: CalculiX, and the models with parts."""

import json
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import imread
from numpy.typing import NDArray

from benchmarks.parts_ccx import bolts, corner
from dovetail import Study, load_study
from fem import FRF, Joint
from viz import render_model

BLUE, ORANGE = "#1f6fb4", "#d98c1f"


def _curve(ax: Axes, frf: FRF, output: str, force: str, label: str, **style: Any) -> None:
    H = frf.H[:, frf.outputs.index(output), frf.inputs.index(force)]
    ax.semilogy(frf.frequency, abs(H), label=label, **style)


def draw(folder: Path, picture: Path) -> None:
    """Draw the studies in a folder: the first case with a soft bolt, and the frame on a corner piece."""
    figure = Figure(figsize=(11, 7.4), layout="constrained")
    grid = figure.add_gridspec(2, 2, width_ratios=(1, 1.25))
    case = min(folder.glob("bolts-*-soft"))
    ax = figure.add_subplot(grid[0, 1])
    study, found = load_study(case / "study.toml"), load_study(case / "report" / "found.toml")
    soft = f"bolt {json.loads((case / 'truth.json').read_text())['soft']}"
    place = next(joint.location for joint in study.model.of_kind(Joint) if joint.name == soft)
    _structure(figure.add_subplot(grid[0, 0]), study, [(place, soft)])
    output, force = "13z", "21z"
    _curve(ax, study.measurements[0].frf, output, force, "CalculiX with 1 % noise", color="k", lw=2.2)
    _curve(ax, study.frf(bolts.LINES), output, force, "study as drawn", color=ORANGE, lw=1, ls="--")
    _curve(ax, found.frf(bolts.LINES), output, force, "with the soft bolt found", color=BLUE, lw=1)
    ax.set_title(f"cover, sensor {output}, force {force}", fontsize=10)
    _structure(figure.add_subplot(grid[1, 0]), load_study(folder / "corner" / "rigid.toml"))
    lower = figure.add_subplot(grid[1, 1])
    output, force = "4z", "21z"
    measured = load_study(folder / "corner" / "rigid.toml").measurements[0].frf
    _curve(lower, measured, output, force, "CalculiX, all solid", color="k", lw=2.2)
    for model, label, style in (
        ("zones", "centre lines, rigid inside the block", {"color": ORANGE, "lw": 1, "ls": "--"}),
        ("rigid", "corner piece as a superelement", {"color": BLUE, "lw": 1}),
    ):
        frf = load_study(folder / "corner" / f"{model}.toml").frf(corner.LINES)
        _curve(lower, frf, output, force, label, **style)
    lower.set_title(f"bar along y, sensor {output}, force {force}; nothing fitted", fontsize=10)
    for axes in (ax, lower):
        axes.set_xlabel("frequency [Hz]")
        axes.set_ylabel("accelerance [1/kg]")
        axes.grid(alpha=0.25)
        axes.legend(fontsize=8, frameon=False)
    figure.savefig(picture, dpi=110)


def _structure(ax: Axes, study: Study, marks: Sequence[tuple[NDArray[np.float64], str]] = ()) -> None:
    with TemporaryDirectory() as scratch:
        file = render_model(study.model, Path(scratch) / "structure.png", highlights=marks)
        ax.imshow(imread(file))
    ax.set_axis_off()
