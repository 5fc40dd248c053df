"""A picture of both structures with an FRF of each: CalculiX, and the models with parts."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from numpy.typing import NDArray

from benchmarks.parts_ccx import bolts, corner
from benchmarks.parts_ccx.calculix import SAME_PLACE, Solid
from dovetail import load_study
from fem import FRF

SIDES = ((0, 1, 2, 3), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))
"""Corners of the six faces of a hexahedron."""
GREY, BLUE, ORANGE, RED = "#9aa3ad", "#1f6fb4", "#d98c1f", "#c0392b"


def outside(solid: Solid) -> NDArray[np.float64]:
    """Return the corners of the faces that only one element has, shape (n, 4, 3) [mm]."""
    faces: dict[tuple[int, ...], list[int]] = {}
    for element in solid.elements:
        for side in SIDES:
            numbers = [int(element[k]) for k in side]
            key = tuple(sorted(numbers))
            if faces.pop(key, None) is None:
                faces[key] = numbers
    return np.array([solid.nodes[np.array(face) - 1] for face in faces.values()])


def _draw_solid(ax: Any, solid: Solid, colour: str, alpha: float = 1.0) -> None:
    ax.add_collection3d(
        Poly3DCollection(outside(solid), facecolor=colour, edgecolor="#444444", linewidth=0.25, alpha=alpha)
    )


def _frame(ax: Any, low: NDArray[np.float64], high: NDArray[np.float64], zoom: float) -> None:
    for axis, a, b in zip("xyz", low, high, strict=True):
        getattr(ax, f"set_{axis}lim")(a, b)
    ax.set_box_aspect(high - low, zoom=zoom)
    ax.set_axis_off()


def _curve(ax: Axes, frf: FRF, output: str, force: str, label: str, **style: Any) -> None:
    H = frf.H[:, frf.outputs.index(output), frf.inputs.index(force)]
    ax.semilogy(frf.frequency, abs(H), label=label, **style)


def draw(folder: Path, picture: Path) -> None:
    """Draw the studies in a folder: the first case with a soft bolt, and the frame on a corner piece."""
    figure = Figure(figsize=(11, 7.4), layout="constrained")
    grid = figure.add_gridspec(2, 2, width_ratios=(1, 1.25))
    case = min(folder.glob("bolts-*-soft"))
    _draw_plates(figure.add_subplot(grid[0, 0], projection="3d"), case)
    ax = figure.add_subplot(grid[0, 1])
    study, found = load_study(case / "study.toml"), load_study(case / "report" / "found.toml")
    output, force = "13z", "21z"
    _curve(ax, study.measurements[0].frf, output, force, "CalculiX with 1 % noise", color="k", lw=2.2)
    _curve(ax, study.frf(bolts.LINES), output, force, "study as drawn", color=ORANGE, lw=1, ls="--")
    _curve(ax, found.frf(bolts.LINES), output, force, "with the soft bolt found", color=BLUE, lw=1)
    ax.set_title(f"cover, sensor {output}, force {force}", fontsize=10)
    _draw_corner(figure.add_subplot(grid[1, 0], projection="3d"))
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


def _draw_plates(ax: Any, case: Path) -> None:
    base, cover = bolts.plates()
    _draw_solid(ax, base, GREY)
    _draw_solid(ax, cover, BLUE, 0.35)
    soft = json.loads((case / "truth.json").read_text())["soft"]
    for name, (x, y) in bolts.BOLTS.items():
        ax.plot([x, x], [y, y], [0, 40], color=RED if name == soft else "k", lw=3, zorder=10)
        ax.text(x, y, 46, name, color=RED if name == soft else "k", fontsize=9, zorder=11)
    _frame(ax, np.array([0.0, 0.0, -40.0]), np.array([528.0, 168.0, 70.0]), 1.05)
    ax.view_init(32, -62)
    ax.set_title("two plates, four bolts; the red one is soft along x and y", fontsize=10)


def _draw_corner(ax: Any) -> None:
    solid = corner.solids()
    inside = (solid.nodes[solid.elements - 1] <= corner.CUT + SAME_PLACE).all(axis=(1, 2))
    _draw_solid(ax, replace(solid, elements=solid.elements[~inside]), GREY)
    _draw_solid(ax, replace(solid, elements=solid.elements[inside]), BLUE)
    low, high = solid.nodes.min(axis=0), solid.nodes.max(axis=0)
    _frame(ax, low, high, 1.1)
    ax.view_init(24, 38)
    ax.set_title("three bars on a solid corner (blue: superelement)", fontsize=10)
