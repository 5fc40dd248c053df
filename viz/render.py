"""Pictures of structures: PyVista draws the surfaces off screen, matplotlib sets the text.

Every picture is in parallel projection, so that places on the structure map to pixels by one affine map and
the labels have the same fonts as the curves of :mod:`viz.curves`.
"""

import gc
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Colormap, Normalize, to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke
from numpy.typing import ArrayLike, NDArray
from PIL import Image

from fem.analysis.modes import Modes
from fem.checks import Fault
from fem.elements.frame import Frame
from fem.elements.properties import MemberProperties
from fem.materials import Material
from fem.mesh import Mesh
from fem.model import Model
from fem.sections.section import Section
from updating.measurement.measurement import Sensor
from viz import style
from viz.layout import in_order, merge_names, place_labels, shorten
from viz.shapes import (
    Arrows,
    Floats,
    Surface,
    amplification,
    arrows,
    displacement_at,
    group_components,
    match_scale,
    member_families,
    model_surface,
    real_shape,
    surface_places,
    view_axes,
)

DPI = 200
"""Resolution of the pictures [1/inch]."""

_MARKERS = {
    "support": ("^", style.SUPPORT),
    "support_flexibility": ("v", style.SUPPORT),
    "joint": ("D", style.JOINT),
    "joint_stiffness": ("D", style.PURPLE),
    "joint_viscous_damping": ("h", style.PURPLE),
    "joint_structural_damping": ("H", style.PURPLE),
    "added_mass": ("o", style.GREEN),
    "point_mass": ("o", style.GREEN),
    "member_density": ("s", style.GREEN),
    "member_stiffness": ("s", style.ORANGE),
    "stiffness_loss": ("X", style.VERMILION),
    "preload": ("P", style.SKY),
    "crack": ("X", style.ORANGE),
    "end_release": ("d", style.ORANGE),
    "rigid_end_zone": ("d", style.SKY),
    "solid_corner": ("s", style.PURPLE),
    "joint_patch": ("s", style.SKY),
    "member_section": ("s", style.SKY),
    "ground_spring": ("v", style.GREEN),
    "foundation": ("v", style.VERMILION),
    "foundation_dashpot": ("v", style.PURPLE),
    "joint_mass": ("D", style.GREEN),
    "joint_zener": ("D", style.SKY),
    "joint_fractional": ("D", style.VERMILION),
    "joint_offset": ("D", style.ORANGE),
    "distributed_mass": ("8", style.GREEN),
    "fluid_added_mass": ("8", style.SKY),
    "sensor_mass": (".", style.GREEN),
    "driver_mass": ("*", style.GREEN),
    "stinger": ("*", style.PURPLE),
}
"""Shape and colour of the marker of each kind of effect; a kind that is not here gets one of the others."""
_OTHER_MARKERS = ("p", "*", "<", ">", "d", "8")


def render_model(
    model: Model,
    path: str | Path,
    sensors: Sequence[Sensor] = (),
    excitations: Sequence[Sensor] = (),
    highlights: Sequence[tuple[ArrayLike, str]] = (),
    title: str = "",
) -> Path:
    """Draw a structure with its sections, sensors, excitations, supports and joints.

    Parameters
    ----------
    model : Model
    path : str or Path
        PNG file to write.
    sensors, excitations : sequence of Sensor
        Drawn as small arrows in the sensors' positive directions, and as larger ones that push at the
        excited points. Sensors at one place share a label.
    highlights : sequence of (point (3,), label)
        Places to be pointed out [m].
    title : str
        Heading.

    Returns
    -------
    Path
        The file.
    """
    surface, size = model_surface(model), model.mesh.size
    families = member_families(model)
    names = in_order(families)
    colour = {name: style.MEMBERS[i % len(style.MEMBERS)] for i, name in enumerate(names)}
    member = model.mesh.member_of_line()
    rgb = np.array([to_rgb(colour[families[name]]) for name in member])[surface.line]
    scene = _Scene(surface.rest, title=title)
    scene.add_surface(surface, surface.rest, rgb=rgb)
    if len(names) > 1:
        scene.legend += [
            Patch(facecolor=colour[n], edgecolor=style.MUTED, linewidth=0.5, label=shorten(n, 40))
            for n in names
        ]
    scene.add_sensors(model, sensors, 0.055 * size, style.SENSOR, "sensor")
    scene.add_sensors(model, excitations, 0.11 * size, style.EXCITATION, "excitation", towards=True)
    scene.add_effects(model)
    scene.add_highlights(highlights)
    return scene.save(path)


def render_mode(
    model: Model,
    modes: Modes,
    index: int,
    path: str | Path,
    measured: tuple[ArrayLike, ArrayLike] | None = None,
    title: str = "",
) -> Path:
    """Draw a mode shape: the deformed structure coloured by displacement over its outline at rest.

    Parameters
    ----------
    model : Model
    modes : Modes
        With a row for every DOF of the model's mesh.
    index : int
        Mode, counted from 0.
    path : str or Path
        PNG file to write.
    measured : (points (n, 3), vectors (n, 3)), optional
        A measured shape: places [m] and displacement vectors, one for each sensor, drawn as arrows from the
        places at rest to where the measurement puts them. It is scaled by the modal scale factor, so it may
        have any scale, sign and phase. Sensors with NaN, which were not measured, are left out.
    title : str
        Heading; number, frequency and damping unless given.
    """
    shape = modes.shapes[:, index]
    phase = _phase(shape)
    motion = real_shape(shape)
    surface, size = model_surface(model, motion), model.mesh.size
    scale = amplification(surface, size)
    scene = _Scene(surface.rest, surface.deformed(scale), title=title or mode_title(modes, index))
    scene.add_ghost(surface)
    scene.add_moving(surface, scale)
    if measured is not None:
        points, vectors = np.array(measured[0], dtype=float, ndmin=2), np.array(measured[1], ndmin=2)
        known = ~np.isnan(vectors).any(axis=1)
        points, vectors = points[known], vectors[known]
        computed = displacement_at(model, shape * phase, points)
        factor = match_scale(vectors, computed)
        moved = np.real(factor * vectors)
        along = _unit(moved)
        expected = np.einsum("ij,ij->i", np.real(computed), along)[:, None] * along
        groups = group_components(points, moved, 1e-6 * size)
        at = np.array([points[group[0]] for group in groups])
        moved, expected = (np.array([v[group].sum(axis=0) for group in groups]) for v in (moved, expected))
        scene.add_comparison(Arrows(at, at + scale * moved), at + scale * expected)
    scene.legend.append(Line2D([], [], color=style.AT_REST, linewidth=1, label="at rest"))
    return scene.save(path)


def animate_mode(
    model: Model,
    modes: Modes,
    index: int,
    path: str | Path,
    frames: int = 20,
    width: float = 4.5,
    title: str = "",
) -> Path:
    """Write a mode shape as an animated GIF of one period.

    Parameters
    ----------
    model : Model
    modes : Modes
        With a row for every DOF of the model's mesh; a complex shape travels.
    index : int
        Mode, counted from 0.
    path : str or Path
        GIF file to write.
    frames : int
        Number of pictures in a period.
    width : float
        Width [inch at 160 dpi].
    title : str
        Heading; number, frequency and damping unless given.
    """
    shape = modes.shapes[:, index] * _phase(modes.shapes[:, index])
    real, imag = np.ascontiguousarray(shape.real, dtype=float), np.ascontiguousarray(shape.imag, dtype=float)
    surface, quadrature = model_surface(model, real), model_surface(model, imag)
    scale = amplification(surface, model.mesh.size)
    phases = 2 * np.pi * np.arange(frames) / frames

    def at(phase: float) -> Surface:
        c, s = np.cos(phase), np.sin(phase)
        return surface.with_motion(
            c * surface.translation - s * quadrature.translation,
            c * surface.rotation - s * quadrature.rotation,
        )

    places = [at(phase).deformed(scale) for phase in phases]
    scene = _Scene(surface.rest, *places, title=title or mode_title(modes, index), width=width, dpi=160)
    scene.add_ghost(surface)
    moving = scene.add_moving(surface, scale)
    with scene.open() as stage:
        pictures = []
        for place in places:
            for mesh, lift in zip(moving, (0.0, scene.lift), strict=True):
                mesh.points = (place + lift).astype(np.float32)
            pictures.append(stage.photograph())
        overlay = scene.overlay(pictures[0])
    images = [Image.fromarray(_blend(scene.embed(picture), overlay)) for picture in pictures]
    palette = _palette(np.asarray(images[0]), np.asarray(images[frames // 2]))
    images = [_indexed(image, palette) for image in images]
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    images[0].save(
        path, save_all=True, append_images=images[1:], duration=60, loop=0, optimize=False, disposal=1
    )
    return path


def render_misfit(
    model: Model,
    points: ArrayLike,
    directions: ArrayLike,
    misfit_db: ArrayLike,
    names: Sequence[str],
    path: str | Path,
    members: Mapping[str, float] | None = None,
    title: str = "",
    label: str = "misfit [dB]",
    members_label: str = "member [-]",
    limits: tuple[float, float] | None = None,
) -> Path:
    """Draw where a model misses the measurement: sensors coloured by their misfit.

    Parameters
    ----------
    model : Model
    points, directions : array_like (n, 3)
        Places [m] and directions of the sensors.
    misfit_db : array_like (n,)
        Misfit of each sensor [dB].
    names : sequence of str
        Names of the sensors. The worst are labelled first, others while there is room.
    path : str or Path
        PNG file to write.
    members : mapping of str to float, optional
        A value for members, which are then coloured by it.
    title : str
        Heading.
    label, members_label : str
        What the colour bars show, with unit.
    limits : (float, float), optional
        Ends of the misfit's colour bar [dB]; give the same for pictures that will be compared.
    """
    points, directions = np.array(points, dtype=float, ndmin=2), np.array(directions, dtype=float, ndmin=2)
    misfit = np.array(misfit_db, dtype=float, ndmin=1)
    if not len(points) == len(directions) == len(misfit) == len(names):
        msg = (
            f"{len(points)} points, {len(directions)} directions, {len(misfit)} misfits and {len(names)} "
            "names are given; every sensor needs one of each"
        )
        raise ValueError(msg)
    surface, size = model_surface(model), model.mesh.size
    scene = _Scene(surface.rest, title=title)
    bars = [_Bar(style.misfit_map(), _limits(misfit, limits), label)]
    rgb = np.tile(to_rgb("#e4e7eb"), (len(surface.triangles), 1))
    if members:
        values = np.array([members.get(name, np.nan) for name in model.mesh.member_of_line()], dtype=float)[
            surface.line
        ]
        bar = _Bar(style.agreement_map(), _limits(np.array(list(members.values())), None), members_label)
        known = np.isfinite(values)
        rgb[known] = 0.25 + 0.75 * bar.colours(values[known])
        bars.append(_Bar(style.lighter(bar.cmap, 0.25), bar.norm, members_label))
    scene.bars = bars
    scene.add_surface(surface, surface.rest, rgb=rgb)
    base = surface_places(model, points, directions, scene.axes[2])
    pointers = arrows(base, directions, 0.085 * size)
    scene.add_arrows(pointers, bars[0].colours(misfit), 0.005 * size, balls=0.0095 * size)
    order = np.argsort(-misfit)
    merged = merge_names([str(names[k]) for k in order], points[order], 1e-6 * size)
    for text, k in merged:
        scene.labels.append(_Label(pointers.tip[order[k]], text, style.INK, 6.5))
    scene.legend.append(_arrow_key(style.MUTED, "sensor in its positive direction"))
    return scene.save(path)


def render_faults(
    model: Model | Mesh, faults: Sequence[Fault], path: str | Path, motion: int = 0, title: str = ""
) -> Path:
    """Draw where the faults of a mesh or model are, and how a mechanism moves.

    Faulty lines are coloured; faulty points are ringed and named. Where there is a mechanism, a ghost of the
    structure moves as nothing hinders it to.

    Parameters
    ----------
    model : Model or Mesh
        Members without a section are drawn with a round one.
    faults : sequence of Fault
        As :func:`fem.checks.check_model` gives them.
    path : str or Path
        PNG file to write.
    motion : int
        Which of a mechanism's motions, counted from 0.
    title : str
        Heading; the number of faults of each kind unless given.
    """
    drawn = _with_sections(model)
    surface, mesh = model_surface(drawn), drawn.mesh
    motions = next((f.motions for f in faults if f.motions.shape[1] > motion), np.zeros((0, 0)))
    ghost = model_surface(drawn, motions[:, motion]) if motions.size else surface
    moved = ghost.deformed(amplification(ghost, mesh.size, 0.15))
    kinds = list(dict.fromkeys(fault.kind for fault in faults))
    words = ", ".join(f"{sum(f.kind == kind for f in faults)} x {kind}" for kind in kinds) or "no fault"
    if motions.shape[1] > 1:
        words += f" (motion {motion + 1} of {motions.shape[1]})"
    scene = _Scene(surface.rest, moved, title=title or words[0].upper() + words[1:])
    colour = {kind: _FAULTS[k % len(_FAULTS)] for k, kind in enumerate(kinds)}
    rgb = np.tile(to_rgb("#d3d8de"), (len(surface.triangles), 1))
    for fault in reversed(faults):
        rgb[np.isin(surface.line, fault.lines)] = to_rgb(colour[fault.kind])
    scene.add_surface(surface, surface.rest, rgb=rgb)
    if motions.size:
        moved = moved + 10 * scene.lift  # in front of what has not moved
        veil = _polydata(moved, ghost.triangles)
        scene.actors.append((veil, {"color": colour["mechanism"], "opacity": 0.3, "culling": "back"}))
        scene.actors.append((_wire(moved, ghost.edges), {"color": colour["mechanism"], "line_width": 1.0}))
    scene.add_effects(drawn)
    named: set[int] = set()
    for fault in faults:
        if fault.kind in ("loose part", "mechanism"):
            continue  # its lines or its motion say where it is
        for point in fault.points.tolist():
            scene.marks.append((mesh.points[point], "ring", colour[fault.kind], 11.0))
            if point not in named:
                scene.labels.append(
                    _Label(mesh.points[point], str(point), colour[fault.kind], 7.5, bold=True)
                )
            named.add(point)
        if not fault.points.size and fault.lines.size:
            place = mesh.points[mesh.lines[fault.lines]].mean(axis=(0, 1))
            scene.labels.append(_Label(place, f"line {fault.lines[0]}", colour[fault.kind], 7.5, bold=True))
    scene.legend += [Patch(facecolor=colour[kind], label=kind) for kind in kinds]
    return scene.save(path)


_FAULTS = (style.VERMILION, style.BLUE, style.PURPLE, style.GREEN, style.ORANGE, style.SKY)


def _with_sections(model: Model | Mesh) -> Model:
    """Return a model that can be drawn: members without properties get a round section."""
    mesh, effects = (model, ()) if isinstance(model, Mesh) else (model.mesh, model.effects)
    frame = next((e for e in effects if isinstance(e, Frame)), None)
    have = frame.members if frame is not None else {}
    if frame is not None and all(name in have for name in mesh.members):
        return Model(mesh, effects)
    plain = MemberProperties(Material("drawn", 1.0, 1.0), Section.circle(0.012 * mesh.size))
    whole = Frame(members={name: have.get(name, plain) for name in mesh.members})
    others = tuple(e for e in effects if not isinstance(e, Frame))
    return Model(mesh, (whole, *others))


def mode_title(modes: Modes, index: int) -> str:
    """Return a heading for a mode: its number, frequency and damping."""
    f = modes.frequency[index]
    text = f"Mode {index + 1}: {'rigid body' if index < modes.n_rigid else f'{f:.4g} Hz'}"
    if f < 0:
        return f"{text}, a motion that grows"
    if modes.zeta is not None and index >= modes.n_rigid:
        text += f", damping ratio {100 * float(modes.zeta[index]):.2g} %"
    return text


@dataclass(frozen=True, slots=True, eq=False)
class _Label:
    """A name at a place."""

    point: Floats
    text: str
    colour: str
    size: float
    bold: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class _Bar:
    """A colour bar."""

    cmap: Colormap
    norm: Normalize
    label: str

    def colours(self, values: ArrayLike) -> Floats:
        return np.asarray(self.cmap(self.norm(np.asarray(values, dtype=float))))[..., :3]


@dataclass(frozen=True, slots=True, eq=False)
class _View:
    """Parallel projection: ``axes @ (place - focus)`` is to the right, up and towards the eye."""

    axes: Floats
    focus: Floats
    width: float
    height: float
    pixels: tuple[int, int]

    def project(self, points: ArrayLike) -> Floats:
        """Return pixel coordinates from the top left corner, shape (n, 2)."""
        at = (np.array(points, dtype=float, ndmin=2) - self.focus) @ self.axes[:2].T
        x = (at[:, 0] / self.width + 0.5) * self.pixels[0]
        y = (0.5 - at[:, 1] / self.height) * self.pixels[1]
        return np.stack([x, y], axis=1)


@dataclass(eq=False)
class _Scene:
    """Everything in one picture, until it is drawn and written."""

    bounds: list[Floats]
    title: str
    width: float
    dpi: int
    axes: Floats
    legend: list[Any] = field(default_factory=list)
    bars: list[_Bar] = field(default_factory=list)
    labels: list[_Label] = field(default_factory=list)
    marks: list[tuple[Floats, str, str, float]] = field(default_factory=list)
    actors: list[tuple[pv.PolyData, dict[str, Any]]] = field(default_factory=list)
    occupied_by: list[tuple[Floats, Floats, float]] = field(default_factory=list)
    measured: Arrows | None = None
    computed: Floats = field(default_factory=lambda: np.empty((0, 3)))

    def __init__(self, *points: Floats, title: str = "", width: float = style.WIDTH, dpi: int = DPI) -> None:
        self.bounds, self.title, self.width, self.dpi = list(points), title, width, dpi
        self.axes = view_axes(points[0])
        self.measured, self.computed = None, np.empty((0, 3))
        self.legend, self.bars, self.labels, self.marks, self.actors, self.occupied_by = (
            [],
            [],
            [],
            [],
            [],
            [],
        )

    @property
    def lift(self) -> Floats:
        """Return the step towards the eye that keeps edges in front of their surfaces [m]."""
        return 3e-4 * float(np.ptp(self.bounds[0], axis=0).max()) * self.axes[2]

    # ---------------------------------------------------------------------------------- what is in it

    def add_surface(self, surface: Surface, vertices: Floats, rgb: Floats | None = None) -> None:
        """Add a surface in given colours of its triangles, with its sharp edges."""
        mesh = _polydata(vertices, surface.triangles)
        if rgb is not None:
            mesh.cell_data["rgb"] = (255 * rgb).astype(np.uint8)
        self.actors.append((mesh, {"scalars": "rgb", "rgb": True}))
        wire = _wire(vertices + self.lift, surface.edges)
        self.actors.append((wire, {"color": "#4a525a", "line_width": 1.0}))

    def add_ghost(self, surface: Surface) -> None:
        """Add the structure at rest as a veil with its edges."""
        veil = _polydata(surface.rest, surface.triangles)
        self.actors.append((veil, {"color": style.AT_REST, "opacity": 0.2, "culling": "back"}))
        self.actors.append((_wire(surface.rest, surface.edges), {"color": style.AT_REST, "line_width": 1.0}))

    def add_moving(self, surface: Surface, scale: float) -> list[pv.PolyData]:
        """Add a deformed surface coloured by displacement; return the meshes that may be moved."""
        size = np.linalg.norm(surface.displacement, axis=1)
        bar = _Bar(style.displacement_map(), Normalize(0, 1), "relative displacement [-]")
        place = surface.deformed(scale)
        mesh, wire = _polydata(place, surface.triangles), _wire(place + self.lift, surface.edges)
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
        mesh = _arrow_mesh(pointers, radius, rgb, balls)
        self.actors.append((mesh, {"scalars": "rgb", "rgb": True, "ambient": 0.55, "diffuse": 0.6}))
        self.bounds += [pointers.tail, pointers.tip]

    def add_comparison(self, measured: Arrows, computed: Floats) -> None:
        """Add measured arrows, in front of everything, and rings where the model puts their tips."""
        self.measured, self.computed = measured, computed
        self.bounds += [measured.tail, measured.tip]
        ring = Line2D([], [], linestyle="", marker="o", markersize=4.5, markerfacecolor="white")
        ring.set(markeredgecolor=style.INK, label="computed at the sensors")
        self.legend += [_arrow_key(style.EXCITATION, "measured, scaled to the mode"), ring]

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
            _unit(np.array([s.direction for s in sensors])),
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
            label = _Label(free[k], text, colour, size, bold=towards)
            self.labels.insert(0, label) if towards else self.labels.append(label)
        self.legend.append(_arrow_key(colour, word))

    def _clearance(self, points: Floats, outwards: Floats) -> Floats:
        """Return how far arrows must stand off so as not to cover earlier ones there [m]."""
        out = np.zeros(len(points))
        for others, directions, length in self.occupied_by:
            near = np.linalg.norm(points[:, None] - others[None], axis=2) < 0.2 * length
            out[(near & (outwards @ directions.T > 0.9)).any(axis=1)] += 1.15 * length
        return out

    def add_effects(self, model: Model) -> None:
        """Add a marker at every place where an effect other than the frame acts."""
        others = iter(_OTHER_MARKERS * 4)
        marker = dict(_MARKERS)
        seen: list[str] = []
        for effect in model.effects:
            places = effect.locations(model)
            if not len(places):
                continue
            if effect.kind not in marker:
                marker[effect.kind] = (next(others), style.GREEN)
            shape, colour = marker[effect.kind]
            self.marks += [(place, shape, colour, 7.0) for place in places]
            if effect.kind not in seen:
                seen.append(effect.kind)
                key = Line2D(
                    [], [], linestyle="", marker=shape, color=colour, markersize=6, markeredgecolor="white"
                )
                key.set_label(effect.kind.replace("_", " "))
                self.legend.append(key)

    def add_highlights(self, highlights: Sequence[tuple[ArrayLike, str]]) -> None:
        """Add rings with names."""
        for point, text in highlights:
            place = np.asarray(point, dtype=float)
            self.marks.append((place, "ring", style.HIGHLIGHT, 13.0))
            self.labels.insert(0, _Label(place, text, style.HIGHLIGHT, 8.0, bold=True))

    # ------------------------------------------------------------------------------------ how it is drawn

    def view(self) -> _View:
        """Return the projection that fits everything, with room for the labels."""
        at = np.vstack(self.bounds) @ self.axes.T
        low, high = at.min(axis=0), at.max(axis=0)
        centre, extent = (low + high) / 2, np.maximum((high - low)[:2], 1e-9)
        side, above = (0.55, 0.3) if self.labels else (0.25, 0.2)
        inches = self._picture_width()
        tallest = 0.8 * self.width
        scale = max(extent[0] / (inches - 2 * side), extent[1] / (tallest - 2 * above))
        height = max(extent[1] / scale + 2 * above, 1.7 if self.bars else 0.9)
        pixels = (round(inches * self.dpi), round(height * self.dpi))
        return _View(self.axes, centre @ self.axes, inches * scale, height * scale, pixels)

    def _picture_width(self) -> float:
        return self.width - 0.85 * len(self.bars)

    def _legend_columns(self) -> int:
        longest = max((len(str(key.get_label())) for key in self.legend), default=1)
        return max(1, int((self.width - 0.1) / (0.55 + 0.068 * longest)))

    def open(self) -> "_Stage":
        """Return the scene set up in a plotter, as a context."""
        return _Stage(self)

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
            self._draw_comparison(ax, view)
            self._draw_marks(ax, view)
            corner = self._draw_triad(ax, view)
            self._draw_labels(ax, canvas, view, picture, corner)
            if self.title:
                figure.text(
                    0.012, 1 - 0.09 * self.dpi / height, self.title, fontsize=9.5, weight="bold", va="top"
                )
            self._draw_bars(figure, nx / width, bottom / height, ny / height)
            if self.legend:
                figure.legend(
                    handles=self.legend, loc="lower left", ncols=self._legend_columns(), fontsize=7.5,
                    bbox_to_anchor=(0.005, 0.0), borderaxespad=0.2, handlelength=1.6, handletextpad=0.5,
                    columnspacing=1.4, labelspacing=0.35,
                )  # fmt: skip
            canvas.draw()
            return np.asarray(canvas.buffer_rgba()).copy()

    def save(self, path: str | Path) -> Path:
        """Draw the scene and write it as PNG."""
        with self.open() as stage:
            picture = stage.photograph()
        image = Image.fromarray(_blend(self.embed(picture), self.overlay(picture)))
        path = Path(path)
        path.parent.mkdir(parents=True, exist_ok=True)
        image.save(path, dpi=(self.dpi, self.dpi), optimize=True)
        return path

    def _draw_comparison(self, ax: Any, view: _View) -> None:
        if self.measured is None:
            return
        ends = view.project(self.computed)
        ax.plot(
            *ends.T,
            "o",
            markersize=4.5,
            markerfacecolor="white",
            markeredgecolor=style.INK,
            markeredgewidth=0.8,
        )
        for tail, tip in zip(view.project(self.measured.tail), view.project(self.measured.tip), strict=True):
            ax.plot(*tail, "o", markersize=1.8, color=style.EXCITATION)
            if np.linalg.norm(tip - tail) < 0.02 * self.dpi:
                continue
            head = float(np.clip(72 / self.dpi * np.linalg.norm(tip - tail) / 2, 2.5, 7))
            for colour, width, arrow in (("white", 2.6, "-"), (style.EXCITATION, 1.4, "-|>")):
                look = {"arrowstyle": arrow, "color": colour, "lw": width, "mutation_scale": head}
                ax.annotate("", xy=tip, xytext=tail, arrowprops={**look, "shrinkA": 0, "shrinkB": 0})

    def _draw_marks(self, ax: Any, view: _View) -> None:
        drawn: list[tuple[float, float]] = []
        for place, shape, colour, size in self.marks:
            x, y = (float(v) for v in view.project(place)[0])
            if shape == "ring":
                for edge, width in (("white", 3.4), (colour, 1.8)):
                    look = {"markeredgecolor": edge, "markeredgewidth": width}
                    ax.plot(x, y, "o", markersize=size, markerfacecolor="none", **look)
                continue
            step = size * self.dpi / 72
            if shape in "^v":
                y += step / 2
            while any(abs(x - u) < 0.8 * step and abs(y - v) < 0.8 * step for u, v in drawn):
                x += step  # beside the marker of another effect at the same place
            drawn.append((x, y))
            ax.plot(x, y, shape, color=colour, markersize=size, markeredgecolor="white", markeredgewidth=0.7)

    def _draw_triad(self, ax: Any, view: _View) -> tuple[float, float, float, float]:
        length = 0.26 * self.dpi
        ends = {k: length * np.array([self.axes[0, k], -self.axes[1, k]]) for k in range(3)}
        reach = np.array(list(ends.values()))
        pad = 0.16 * self.dpi
        x0 = pad - min(reach[:, 0].min(), 0)
        y0 = view.pixels[1] - pad - max(reach[:, 1].max(), 0)
        for k, end in ends.items():
            ax.annotate(
                "", xy=(x0 + end[0], y0 + end[1]), xytext=(x0, y0),
                arrowprops={"arrowstyle": "-|>", "color": style.INK, "lw": 0.9, "mutation_scale": 6,
                            "shrinkA": 0, "shrinkB": 0},
            )  # fmt: skip
            far = end * (1 + 0.1 * self.dpi / max(float(np.linalg.norm(end)), 1.0))
            ax.text(
                x0 + far[0], y0 + far[1], "xyz"[k], fontsize=7.5, style="italic", ha="center", va="center"
            )
        low, high = reach.min(axis=0), reach.max(axis=0)
        return (
            x0 + min(low[0], 0) - pad,
            y0 + min(low[1], 0) - pad,
            x0 + max(high[0], 0) + pad,
            float(view.pixels[1]),
        )

    def _draw_labels(
        self,
        ax: Any,
        canvas: FigureCanvasAgg,
        view: _View,
        picture: NDArray[np.uint8],
        corner: tuple[float, float, float, float],
    ) -> None:
        if not self.labels:
            return
        renderer = canvas.get_renderer()
        anchors = view.project(np.array([label.point for label in self.labels]))
        texts = [
            ax.text(
                *anchor, label.text, fontsize=label.size, color=label.colour, ha="center", va="center",
                weight="bold" if label.bold else "normal",
                path_effects=[withStroke(linewidth=1.8, foreground="white", alpha=0.85)],
            )
            for anchor, label in zip(anchors, self.labels, strict=True)
        ]  # fmt: skip
        boxes = [text.get_window_extent(renderer) for text in texts]
        sizes = np.array([[box.width + 3, box.height + 1] for box in boxes])
        occupied = np.asarray(np.min(picture, axis=2) < 245)
        for place, _, _, size in self.marks:
            x, y = view.project(place)[0]
            r = size * self.dpi / 72 / 2
            occupied[max(int(y - r), 0) : int(y + 2 * r), max(int(x - r), 0) : int(x + r)] = True
        spots = place_labels(anchors, sizes, occupied, [corner])
        for text, anchor, centre, box, shown in zip(
            texts, anchors, spots.centre, boxes, spots.shown, strict=True
        ):
            text.set_visible(bool(shown))
            text.set_position((float(centre[0]), float(centre[1])))
            if not shown:
                continue
            half = np.array([box.width, box.height]) / 2
            near = np.clip(anchor, centre - half, centre + half)
            if np.linalg.norm(near - anchor) > 0.09 * self.dpi:
                ax.plot(
                    *zip(near, anchor, strict=True),
                    color=text.get_color(),
                    linewidth=0.5,
                    alpha=0.6,
                    zorder=1,
                )

    def _draw_bars(self, figure: Figure, left: float, bottom: float, height: float) -> None:
        share = 0.85 / self.width
        for k, bar in enumerate(self.bars):
            cax = figure.add_axes(
                (left + (k + 0.16) * share, bottom + 0.12 * height, 0.16 * share, 0.76 * height)
            )
            scale = figure.colorbar(ScalarMappable(bar.norm, bar.cmap), cax=cax)
            scale.set_label(bar.label, fontsize=8)
            scale.outline.set_linewidth(0.5)
            cax.tick_params(labelsize=7.5)


class _Stage:
    """A plotter that is always closed."""

    def __init__(self, scene: _Scene) -> None:
        self.scene = scene
        self.view = scene.view()

    def __enter__(self) -> "_Stage":
        # VTK reports on stderr that there is no display before it falls back to an off-screen context
        self.quiet = pv.vtk_verbosity("off")
        self.quiet.__enter__()
        view = self.view
        self.plotter = pv.Plotter(off_screen=True, window_size=list(view.pixels), lighting="none")
        self.plotter.renderer.SetBackground(1.0, 1.0, 1.0)
        right, up, eye = view.axes
        for strength, direction in (
            (0.62, eye + 0.9 * up - 0.35 * right),
            (0.3, eye - 0.3 * up + 0.9 * right),
        ):
            light = pv.Light(
                position=tuple(direction), focal_point=(0, 0, 0), light_type="scene light", intensity=strength
            )
            light.positional = False
            self.plotter.add_light(light)
        for mesh, options in self.scene.actors:
            if mesh.n_lines:
                self.plotter.add_mesh(mesh, lighting=False, show_scalar_bar=False, **options)
            else:
                look = {"ambient": 0.46, "diffuse": 0.74, "specular": 0.0, **options}
                self.plotter.add_mesh(mesh, show_scalar_bar=False, **look)
        camera = self.plotter.camera
        reach = 4 * max(view.width, view.height)
        camera.focal_point = tuple(view.focus)
        camera.position = tuple(view.focus + reach * eye)
        camera.up = tuple(up)
        camera.parallel_projection = True
        camera.parallel_scale = view.height / 2
        camera.clipping_range = (0.01 * reach, 2 * reach)
        self.plotter.enable_anti_aliasing("ssaa")
        return self

    def __exit__(self, *_: object) -> None:
        self.plotter.close()
        self.plotter.deep_clean()
        del self.plotter
        gc.collect()  # plotters and figures hold their images in cycles, which would pile up over a report
        self.quiet.__exit__(None, None, None)

    def photograph(self) -> NDArray[np.uint8]:
        """Return the scene as an RGB image."""
        self.plotter.render()
        image = self.plotter.screenshot(return_img=True, transparent_background=False)
        return np.asarray(image)[..., :3].astype(np.uint8)


def _polydata(vertices: Floats, triangles: NDArray[np.int64]) -> pv.PolyData:
    faces = np.column_stack([np.full(len(triangles), 3), triangles]).ravel()
    return pv.PolyData(vertices.astype(np.float32), faces=faces)


def _wire(vertices: Floats, edges: NDArray[np.int64]) -> pv.PolyData:
    return pv.PolyData(
        vertices.astype(np.float32), lines=np.column_stack([np.full(len(edges), 2), edges]).ravel()
    )


def _arrow_mesh(pointers: Arrows, radius: float, rgb: Floats, balls: float) -> pv.PolyData:
    """Return arrows, and balls at their tails, as one mesh."""
    turns = 14
    phi = 2 * np.pi * np.arange(turns) / turns
    vertices, triangles, colours = [], [], []
    ball = pv.Sphere(radius=balls, theta_resolution=16, phi_resolution=12) if balls else None
    start = 0
    for tail, tip, colour in zip(pointers.tail, pointers.tip, rgb, strict=True):
        length = float(np.linalg.norm(tip - tail))
        if ball is not None:
            faces = ball.faces.reshape(-1, 4)[:, 1:]
            vertices.append(np.asarray(ball.points) + tail)
            triangles.append(faces + start)
            colours.append(np.tile(colour, (len(faces), 1)))
            start += ball.n_points
        if length == 0:
            continue
        x = (tip - tail) / length
        y = np.cross(x, np.eye(3)[int(np.argmin(np.abs(x)))])
        y /= np.linalg.norm(y)
        circle = np.cos(phi)[:, None] * y + np.sin(phi)[:, None] * np.cross(x, y)
        head = min(0.45 * length, 5 * radius)
        rings = [
            (0.0, 0.0),
            (0.0, radius),
            (length - head, radius),
            (length - head, 2.3 * radius),
            (length, 0.0),
        ]
        vertices.append(np.vstack([tail + s * x + r * circle for s, r in rings]))
        a = np.arange(turns)
        b = (a + 1) % turns
        for k in range(len(rings) - 1):
            p, q = start + turns * k, start + turns * (k + 1)
            triangles += [np.stack([p + a, p + b, q + b], axis=1), np.stack([p + a, q + b, q + a], axis=1)]
        colours.append(np.tile(colour, (2 * turns * (len(rings) - 1), 1)))
        start += turns * len(rings)
    mesh = _polydata(np.vstack(vertices), np.vstack(triangles))
    mesh.cell_data["rgb"] = (255 * np.vstack(colours)).astype(np.uint8)
    return mesh


def _arrow_key(colour: str, label: str) -> Line2D:
    return Line2D([], [], color=colour, linewidth=1.6, marker=">", markevery=[1], markersize=4.5, label=label)


def _blend(page: NDArray[np.uint8], overlay: NDArray[np.uint8]) -> NDArray[np.uint8]:
    alpha = overlay[..., 3:].astype(np.float32) / 255
    return (page * (1 - alpha) + overlay[..., :3] * alpha + 0.5).astype(np.uint8)


def _palette(*pictures: NDArray[np.uint8]) -> Image.Image:
    """Return one palette for all frames, so that colours do not flicker, with the white of the page in it."""
    seen = np.concatenate([p.reshape(-1, 3) for p in pictures])
    seen = seen[(seen < 250).any(axis=1)]
    rows = Image.fromarray(np.ascontiguousarray(seen[None]))
    colours = (
        rows.quantize(255, method=Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE).getpalette() or []
    )[:765]
    palette = Image.new("P", (1, 1))
    palette.putpalette([255, 255, 255, *colours])
    return palette


def _indexed(image: Image.Image, palette: Image.Image) -> Image.Image:
    """Return an image in the colours of a palette, the first of which is exactly white."""
    index = np.array(image.quantize(palette=palette, dither=Image.Dither.NONE))
    index[(np.asarray(image) >= 250).all(axis=2)] = 0
    out = Image.fromarray(index)
    out.putpalette(palette.getpalette() or [])
    return out


def _unit(vectors: Floats) -> Floats:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-300)


def _phase(shape: NDArray[Any]) -> complex:
    return (
        complex(np.exp(-0.5j * np.angle((np.asarray(shape, dtype=complex) ** 2).sum())))
        if np.iscomplexobj(shape)
        else 1.0
    )


def _limits(values: Floats, limits: tuple[float, float] | None) -> Normalize:
    if limits is not None:
        return Normalize(*limits)
    finite = values[np.isfinite(values)]
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 1.0)
    return Normalize(low, high if high > low else low + 1.0)
