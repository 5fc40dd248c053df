"""A scene: everything in one picture of a structure, until it is drawn and written.

PyVista draws the surfaces off screen (`viz.stage`), matplotlib sets the text (`viz.overlay`). The projection
is parallel, so that places on the structure map to pixels by one affine map, and labels have the same fonts
as the curves of `viz.curves`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import Normalize, to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike, NDArray
from PIL import Image

from fem.array_types import Floats
from fem.declarations import SUPPORT_MARKER
from fem.io.atomic import replacing
from fem.model import Model
from updating.measurement.measurement import Sensor
from viz import style
from viz.layout import merge_names
from viz.markers import COLOURS, OTHER_MARKERS, SHAPES, support_axes
from viz.models import surface_places
from viz.overlay import (
    Bar,
    Label,
    Mark,
    arrow_key,
    blend,
    draw_bars,
    draw_comparison,
    draw_labels,
    draw_marks,
    draw_triad,
    occupied_pixels,
)
from viz.shapes import Arrows, arrows, view_axes
from viz.stage import Actor, Stage, View, arrow_mesh, polydata, wire_mesh
from viz.surfaces import Surface

DPI = 200
"""Resolution of the pictures [1/inch]."""


@dataclass(eq=False)
class Scene:
    """Everything in one picture, until it is drawn and written."""

    bounds: list[Floats]
    title: str
    width: float
    dpi: int
    axes: Floats
    legend: list[Any] = field(default_factory=list)
    bars: list[Bar] = field(default_factory=list)
    labels: list[Label] = field(default_factory=list)
    marks: list[Mark] = field(default_factory=list)
    actors: list[Actor] = field(default_factory=list)
    occupied_by: list[tuple[Floats, Floats, float]] = field(default_factory=list)
    measured: Arrows | None = None
    computed: Floats = field(default_factory=lambda: np.empty((0, 3)))

    def __init__(self, *points: Floats, title: str = "", width: float = style.WIDTH, dpi: int = DPI) -> None:
        self.bounds, self.title, self.width, self.dpi = list(points), title, width, dpi
        self.axes = view_axes(points[0])
        self.measured, self.computed = None, np.empty((0, 3))
        self.legend, self.bars, self.labels = [], [], []
        self.marks, self.actors, self.occupied_by = [], [], []

    @property
    def lift(self) -> Floats:
        """Return the step towards the eye that keeps edges in front of their surfaces [m]."""
        return 3e-4 * float(np.ptp(self.bounds[0], axis=0).max()) * self.axes[2]

    @property
    def before_all(self) -> Floats:
        """Return the step towards the eye that puts arrows in front of all members [m]."""
        return 1.5 * float(np.linalg.norm(np.ptp(self.bounds[0], axis=0))) * self.axes[2]

    # ------------------------------------------------------------------------------------- contents

    def add_surface(self, surface: Surface, vertices: Floats, rgb: Floats | None = None) -> None:
        """Add a surface in given colours of its triangles, with its sharp edges."""
        mesh = polydata(vertices, surface.triangles)
        if rgb is not None:
            mesh.cell_data["rgb"] = (255 * rgb).astype(np.uint8)
        self.actors.append((mesh, {"scalars": "rgb", "rgb": True}))
        wire = wire_mesh(vertices + self.lift, surface.edges)
        self.actors.append((wire, {"color": "#4a525a", "line_width": 1.0}))

    def add_ghost(self, surface: Surface) -> None:
        """Add the structure at rest as a veil with its edges."""
        veil = polydata(surface.rest, surface.triangles)
        self.actors.append((veil, {"color": style.AT_REST, "opacity": 0.2, "culling": "back"}))
        self.actors.append(
            (wire_mesh(surface.rest, surface.edges), {"color": style.AT_REST, "line_width": 1.0})
        )

    def add_moving(self, surface: Surface, scale: float) -> list[pv.PolyData]:
        """Add a deformed surface coloured by displacement; return the meshes that may be moved."""
        size = np.linalg.norm(surface.displacement, axis=1)
        bar = Bar(style.displacement_map(), Normalize(0, 1), "relative displacement [-]")
        place = surface.deformed(scale)
        mesh, wire = polydata(place, surface.triangles), wire_mesh(place + self.lift, surface.edges)
        mesh.point_data["rgb"] = (255 * bar.colours(size / max(size.max(), 1e-300))).astype(np.uint8)
        self.actors += [
            (mesh, {"scalars": "rgb", "rgb": True}),
            (wire, {"color": "#2b3138", "line_width": 1.0}),
        ]
        self.bars.append(bar)
        return [mesh, wire]

    def add_arrows(self, pointers: Arrows, colour: str | Floats, radius: float, balls: float = 0.0) -> None:
        """Add arrows with shafts of a radius [m], in one colour or one for each, and balls at their tails."""
        if not len(pointers.tail):
            return
        rgb = np.broadcast_to(to_rgb(colour) if isinstance(colour, str) else colour, (len(pointers.tail), 3))
        mesh = arrow_mesh(pointers, radius, rgb, balls)
        # in front of everything: along the eye's direction a parallel projection moves nothing
        mesh.points = np.asarray(mesh.points) + self.before_all
        self.actors.append((mesh, {"scalars": "rgb", "rgb": True, "ambient": 0.55, "diffuse": 0.6}))
        self.bounds += [pointers.tail, pointers.tip]

    def add_comparison(self, measured: Arrows, computed: Floats) -> None:
        """Add measured arrows, in front of everything, and rings where the model puts their tips."""
        self.measured, self.computed = measured, computed
        self.bounds += [measured.tail, measured.tip]
        ring = Line2D([], [], linestyle="", marker="o", markersize=4.5, markerfacecolor="white")
        ring.set(markeredgecolor=style.INK, label="computed at the sensors")
        self.legend += [arrow_key(style.EXCITATION, "measured, scaled to the mode"), ring]

    def add_sensors(
        self,
        model: Model,
        sensors: Sequence[Sensor],
        length: float,
        colour: str,
        word: str,
        *,
        towards: bool = False,
    ) -> None:
        """Add the arrows and names of sensors or excitations."""
        if not sensors:
            return
        points, directions = (
            np.array([s.point for s in sensors]),
            unit_vectors(np.array([s.direction for s in sensors])),
        )
        side = -1.0 if towards else 1.0
        base = surface_places(model, points, side * directions, self.axes[2])
        base = base + side * self._clearance(points, side * directions)[:, None] * directions
        self.occupied_by.append((points, side * directions, length))
        pointers = arrows(base, directions, length, towards=towards)
        self.add_arrows(pointers, colour, length * (0.045 if towards else 0.07))
        free = pointers.tail if towards else pointers.tip
        size = 7.5 if towards else 7.0 if len(sensors) <= 24 else 6.0
        for text, k in merge_names([s.name for s in sensors], points, 1e-6 * model.mesh.size):
            label = Label(free[k], text, colour, size, bold=towards)
            self.labels.insert(0, label) if towards else self.labels.append(label)
        self.legend.append(arrow_key(colour, word))

    def _clearance(self, points: Floats, outwards: Floats) -> Floats:
        """Return the distances at which arrows clear earlier ones at their places [m]."""
        out = np.zeros(len(points))
        for others, directions, length in self.occupied_by:
            near = np.linalg.norm(points[:, None] - others[None], axis=2) < 0.2 * length
            out[(near & (outwards @ directions.T > 0.9)).any(axis=1)] += 1.15 * length
        return out

    def add_effects(self, model: Model) -> None:
        """Add a marker at every place where an effect other than the frame acts."""
        others = iter(OTHER_MARKERS * 4)
        seen: dict[str, tuple[str, str]] = {}
        for effect in model.effects:
            places = effect.locations(model)
            if effect.is_form or not (effect.is_marked and len(places)):
                continue
            axes = support_axes(effect, model)
            kind, marker = (effect.kind, effect.marker) if axes is None else ("support", SUPPORT_MARKER)
            if kind in seen:
                shape, colour = seen[kind]
            elif marker is None:
                shape, colour = next(others), style.GREEN
            else:
                shape, colour = SHAPES[marker.shape], COLOURS[marker.colour]
            turned = None if axes is None or np.array_equal(axes, np.eye(3)) else axes
            self.marks += [Mark(place, shape, colour, 7.0, turned) for place in places]
            if kind not in seen:
                seen[kind] = shape, colour
                key = Line2D(
                    [], [], linestyle="", marker=shape, color=colour, markersize=6, markeredgecolor="white"
                )
                key.set_label(kind.replace("_", " "))
                self.legend.append(key)

    def add_highlights(self, highlights: Sequence[tuple[ArrayLike, str]]) -> None:
        """Add rings with names."""
        for point, text in highlights:
            place = np.asarray(point, dtype=float)
            self.marks.append(Mark(place, "ring", style.HIGHLIGHT, 13.0))
            self.labels.insert(0, Label(place, text, style.HIGHLIGHT, 8.0, bold=True))

    # -------------------------------------------------------------------------------------- drawing

    def view(self) -> View:
        """Return the projection that fits everything, with room for the labels."""
        at = np.vstack(self.bounds) @ self.axes.T
        low, high = at.min(axis=0), at.max(axis=0)
        centre, extent = (low + high) / 2, np.maximum((high - low)[:2], 1e-9)
        side, above = (0.55, 0.3) if self.labels else (0.25, 0.2)
        inches = self.width - 0.85 * len(self.bars)
        tallest = 0.8 * self.width
        scale = max(extent[0] / (inches - 2 * side), extent[1] / (tallest - 2 * above))
        height = max(extent[1] / scale + 2 * above, 1.7 if self.bars else 0.9)
        pixels = (round(inches * self.dpi), round(height * self.dpi))
        return View(self.axes, centre @ self.axes, inches * scale, height * scale, pixels)

    def _legend_columns(self) -> int:
        longest = max((len(str(key.get_label())) for key in self.legend), default=1)
        return max(1, int((self.width - 0.1) / (0.55 + 0.068 * longest)))

    def open(self) -> Stage:
        """Return the scene set up in a plotter, as a context."""
        return Stage(self.view(), self.actors)

    def frame(self) -> tuple[int, int, int]:
        """Return the pixels of the picture's margins above and below, and of the whole figure's height."""
        top = round(self.dpi * (0.3 if self.title else 0.04))
        rows = -(-len(self.legend) // self._legend_columns())
        bottom = round(self.dpi * (0.06 + 0.2 * rows))
        return top, bottom, top + bottom + self.view().pixels[1]

    def embed(self, picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Return the picture on the white page of the figure."""
        top, _, height = self.frame()
        page = np.full((height, round(self.width * self.dpi), 3), 255, dtype=np.uint8)
        page[top : top + picture.shape[0], : picture.shape[1]] = picture
        return page

    def overlay(self, picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Return markers, labels, legend, colour bars and axes on a transparent page, RGBA."""
        with style.look():
            _, bottom, height = self.frame()
            view, width = self.view(), round(self.width * self.dpi)
            figure = Figure(figsize=(width / self.dpi, height / self.dpi), dpi=self.dpi)
            figure.patch.set_alpha(0)
            canvas = FigureCanvasAgg(figure)
            nx, ny = view.pixels
            ax = figure.add_axes((0, bottom / height, nx / width, ny / height))
            ax.set_xlim(0, nx)
            ax.set_ylim(ny, 0)
            ax.axis("off")
            if self.measured is not None:
                draw_comparison(ax, view, self.measured, self.computed, self.dpi)
            draw_marks(ax, view, self.marks, self.dpi)
            corner = draw_triad(ax, view, self.dpi)
            if self.labels:
                occupied = occupied_pixels(picture, view, self.marks, self.dpi)
                draw_labels(ax, canvas, view, self.labels, occupied, [corner], self.dpi)
            if self.title:
                figure.text(
                    0.012, 1 - 0.09 * self.dpi / height, self.title, fontsize=9.5, weight="bold", va="top"
                )
            draw_bars(figure, self.bars, nx / width, bottom / height, ny / height, 0.85 / self.width)
            if self.legend:
                figure.legend(
                    handles=self.legend,
                    loc="lower left",
                    ncols=self._legend_columns(),
                    fontsize=7.5,
                    bbox_to_anchor=(0.005, 0.0),
                    borderaxespad=0.2,
                    handlelength=1.6,
                    handletextpad=0.5,
                    columnspacing=1.4,
                    labelspacing=0.35,
                )
            canvas.draw()
            return np.asarray(canvas.buffer_rgba()).copy()

    def save(self, path: str | Path) -> Path:
        """Draw the scene and write it as PNG."""
        with self.open() as stage:
            picture = stage.photograph()
        image = Image.fromarray(blend(self.embed(picture), self.overlay(picture)))
        path = Path(path)
        path.parent.mkdir(parents=True, exist_ok=True)
        # level 9, or `optimize`, takes two to three times as long and makes the file 1 % smaller
        with replacing(path) as scratch:
            image.save(scratch, dpi=(self.dpi, self.dpi), compress_level=7)
        return path


def unit_vectors(vectors: Floats) -> Floats:
    """Return vectors (n, 3) of length 1."""
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-300)
