"""Diagrams of section forces and stresses on the structure, and deflections under static loads."""

from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv
from matplotlib.colors import LinearSegmentedColormap, Normalize, to_rgb
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from fem.analysis.section_forces import SECTION_FORCES
from fem.analysis.statics import StaticSolution
from fem.analysis.stations import forces_on_lines, stresses_on_lines
from fem.array_types import Floats, Ints
from fem.elements.frame import Frame
from fem.model import Model
from viz import style
from viz.models import drawn_size, model_surface
from viz.overlay import Bar, Label
from viz.scene import Scene
from viz.shapes import amplification
from viz.stage import polydata, wire_mesh
from viz.surfaces import Surface

POSITIVE, NEGATIVE = "#2c7fb8", "#d95f0e"
_PIECES = 24
"""Least number of pieces along a member."""
_HOLDERS = ("support", "joint")
"""Colours of the marks of effects that hold the structure."""
LEAST_DRAWN_FORCE = 1e-6
"""Section forces below this part of the largest of their kind, forces or moments, are not drawn [-]."""

_SIDES = {"N": (1, 1.0), "Vy": (0, 1.0), "Vz": (1, 1.0), "T": (1, 1.0), "My": (1, 1.0), "Mz": (0, -1.0)}
"""Local axis (0: y, 1: z) and sense along which positive values are drawn: moments on the side in tension."""

_STRESSES = {
    "normal": ("least and largest normal stress", ("low", "high")),
    "von_mises": ("largest von Mises stress", ("von_mises",)),
}
"""Words on the stresses that are drawn, and their curves."""


_NORMAL = LinearSegmentedColormap.from_list("normal stress", [NEGATIVE, "#f2f2f2", POSITIVE])
"""Colours of compression and tension, as of negative and positive section forces."""

_WORDS = {
    "N": "axial force N",
    "Vy": "shear force Vy",
    "Vz": "shear force Vz",
    "T": "torsional moment T",
    "My": "bending moment My",
    "Mz": "bending moment Mz",
}


def render_diagram(solution: StaticSolution, quantity: str, path: str | Path, case: int = 0) -> Path:
    """Draw the diagram of a section force on the structure.

    Parameters
    ----------
    solution : StaticSolution
    quantity : str
        ``"N"``, ``"Vy"``, ``"Vz"``, ``"T"``, ``"My"`` or ``"Mz"``. Moments are drawn on the side in tension.
    path : str or Path
        PNG file to write.
    case : int
        Column of the load case.

    Raises
    ------
    ValueError
        For an unknown quantity.
    """
    if quantity not in SECTION_FORCES:
        msg = f"'{quantity}' is no section force; allowed are {', '.join(SECTION_FORCES)}"
        raise ValueError(msg)
    pieces = _pieces(solution)
    forces = forces_on_lines(solution, pieces)[..., case]
    k = SECTION_FORCES.index(quantity)
    like = slice(0, 3) if k < 3 else slice(3, 6)
    least = max(LEAST_DRAWN_FORCE * abs(forces[..., like]).max(), solution.rounding[k // 3, case])
    values = np.where(abs(forces[..., k]) > least, forces[..., k], 0.0)
    unit = "N" if k < 3 else "N·m"
    heading = f"{_WORDS[quantity]} [{unit}], {solution.cases[case]}"
    axis, sense = _SIDES[quantity]
    scene, (tips,) = _diagram(solution, heading[0].upper() + heading[1:], axis, sense, values)
    _add_ribbons(scene, _base(solution, pieces), tips, values)
    _name_extremes(scene, solution, tips, values)
    scene.legend += [Patch(facecolor=POSITIVE, label="positive"), Patch(facecolor=NEGATIVE, label="negative")]
    return scene.save(path)


def render_stress(solution: StaticSolution, quantity: str, path: str | Path, case: int = 0) -> Path:
    """Draw the extremes of a stress over each section along the members, in colour.

    Parameters
    ----------
    solution : StaticSolution
    quantity : str
        ``"normal"``: the least and the largest normal stress, as two curves; ``"von_mises"``: the largest
        von Mises stress.
    path : str or Path
        PNG file to write.
    case : int
        Column of the load case.

    Raises
    ------
    ValueError
        For an unknown quantity, and where the stress is known of no member.
    """
    if quantity not in _STRESSES:
        msg = f"'{quantity}' is no stress that is drawn; allowed are {', '.join(_STRESSES)}"
        raise ValueError(msg)
    words, names = _STRESSES[quantity]
    mesh, pieces = solution.model.mesh, _pieces(solution)
    found = stresses_on_lines(solution, pieces)
    curves = [found[name][..., case] for name in names]
    known = ~np.isnan(curves[0]).all(axis=1)
    if not known.any():
        msg = f"the {words} is known of no member; sections need a shape"
        raise ValueError(msg)
    largest = float(np.nanmax(np.abs(curves)))
    # Stress from which on a picture is in MPa [Pa]
    factor, unit = (1e-6, "MPa") if largest >= 1e4 else (1.0, "Pa")
    curves = [factor * np.nan_to_num(c) for c in curves]
    heading = f"{words} [{unit}], {solution.cases[case]}"
    scene, tips = _diagram(solution, heading[0].upper() + heading[1:], 1, 1.0, *curves)
    most = factor * largest or 1.0
    if quantity == "normal":
        bar = Bar(_NORMAL, Normalize(-most, most), f"normal stress [{unit}]")
    else:
        bar = Bar(style.misfit_map(), Normalize(0.0, most), f"von Mises stress [{unit}]")
    scene.bars.append(bar)
    # one member's area behind another's where they overlap in one plane; lines are before all of them
    behind = -scene.lift * (1 + np.argsort(mesh.chains()[0])[:, None, None] / mesh.n_lines)
    base = _base(solution, pieces) + behind
    for ends, values in zip(tips, curves, strict=True):
        _add_ribbons(scene, base, ends + behind, values, bar)
    named = np.concatenate(tips, axis=1), np.concatenate(curves, axis=1)
    _name_extremes(scene, solution, *named, ink=style.INK, least=quantity == "normal")
    if not known.all():
        scene.legend.append(Line2D([], [], color=style.MUTED, linewidth=1.6, label="stress not known"))
    return scene.save(path)


def drawn_stresses(solution: StaticSolution, case: int) -> tuple[str, ...]:
    """Return the stresses that are known of a member and not zero in a load case."""
    found = stresses_on_lines(solution, 4)
    return tuple(
        quantity
        for quantity, (_, names) in _STRESSES.items()
        if any(np.nan_to_num(found[name][..., case]).any() for name in names)
    )


def _pieces(solution: StaticSolution) -> int:
    """Return the number of pieces of each line in diagrams."""
    return -(-_PIECES // min(len(rows) for rows in solution.model.mesh.members.values()))


def _base(solution: StaticSolution, pieces: int) -> Floats:
    """Return places along the axes of all lines, (n_lines, pieces + 1, 3) [m]."""
    ends = _axis_ends(solution)
    return np.asarray(ends[:, :1] + np.linspace(0, 1, pieces + 1)[:, None] * (ends[:, 1:] - ends[:, :1]))


def _axis_ends(solution: StaticSolution) -> Floats:
    mesh = solution.model.mesh
    return np.asarray(mesh.points[mesh.lines] + solution.equilibrium.loads.axes.offset)


def _diagram(
    solution: StaticSolution, title: str, axis: int, sense: float, *curves: Floats
) -> tuple[Scene, list[Floats]]:
    """Return a scene with the axes of the structure and outlines of curves over them, and the curves' tips.

    Parameters
    ----------
    axis : int
        Local axis along which values are drawn (0: y, 1: z).
    sense : float
        Sense of positive values along it.
    *curves : ndarray (n_lines, pieces + 1)
        Values along the lines, drawn to one scale.
    """
    mesh, ends = solution.model.mesh, _axis_ends(solution)
    base = _base(solution, curves[0].shape[1] - 1)
    largest = max(float(abs(values).max()) for values in curves)
    # Largest ordinate as a part of the structure's size [-]
    scale = sense * 0.13 * mesh.size / largest if largest else 0.0
    way = solution.equilibrium.loads.axes.R[:, None, 1 + axis]
    tips = [np.asarray(base + (scale * values)[..., None] * way) for values in curves]
    scene = Scene(mesh.points, *(t.reshape(-1, 3) for t in tips), title=title)
    scene.actors.append(
        (wire_mesh(ends.reshape(-1, 3), _pairs(len(ends))), {"color": style.MUTED, "line_width": 5.0})
    )
    for values, at in zip(curves, tips, strict=True):
        edges = [_outline(base[rows], at[rows]) for rows in mesh.members.values() if values[rows].any()]
        scene.actors += [(edge, {"color": style.INK, "line_width": 1.6}) for edge in edges]
    scene.add_effects(_holders(solution.model))
    return scene, tips


def drawn_quantities(solution: StaticSolution, case: int) -> tuple[str, ...]:
    """Return the section forces that are more than rounding in a load case."""
    size = abs(forces_on_lines(solution, 4)[..., case]).max(axis=(0, 1))
    largest = np.repeat([size[:3].max(), size[3:].max()], 3)
    kept = size > np.maximum(LEAST_DRAWN_FORCE * largest, np.repeat(solution.rounding[:, case], 3))
    return tuple(q for q, yes in zip(SECTION_FORCES, kept.tolist(), strict=True) if yes)


def render_deflection(solution: StaticSolution, path: str | Path, case: int = 0) -> Path:
    """Draw the structure under a load case, its displacements enlarged.

    Parameters
    ----------
    solution : StaticSolution
    path : str or Path
        PNG file to write.
    case : int
        Column of the load case.
    """
    surface = model_surface(solution.model, solution.displacements[:, case])
    scale = amplification(surface, drawn_size(solution.model))
    name = solution.cases[case]
    scene = Scene(surface.rest, surface.deformed(scale), title=f"Displacements × {scale:.3g}, {name}")
    scene.add_ghost(surface)
    _add_deformed(scene, surface, scale)
    scene.add_effects(_holders(solution.model))
    scene.legend.append(Line2D([], [], color=style.AT_REST, linewidth=1, label="without load"))
    return scene.save(path)


def _add_deformed(scene: Scene, surface: Surface, scale: float) -> None:
    """Add the deformed surface with a colour bar in millimetres."""
    scene.add_moving(surface, scale)
    largest = 1e3 * float(np.linalg.norm(surface.displacement, axis=1).max())
    (bar,) = scene.bars
    scene.bars = [Bar(bar.cmap, type(bar.norm)(0, largest or 1.0), "displacement [mm]")]


def _add_ribbons(scene: Scene, base: Floats, tips: Floats, values: Floats, bar: Bar | None = None) -> None:
    """Add the areas between the axis and the ordinates, cut where the sign changes.

    They have the colours of a bar by the value at each height, or two colours by sign.
    """
    vertices: list[Floats] = []
    heights: list[float] = []
    triangles: list[list[int]] = []
    positive: list[bool] = []

    def add(points: list[Floats], at: list[float]) -> None:
        first = len(vertices)
        vertices.extend(points)
        heights.extend(at)
        triangles.extend([first, first + i, first + i + 1] for i in range(1, len(points) - 1))
        positive.extend([sum(at) > 0] * (len(points) - 2))

    for p, q, v in zip(base, tips, values, strict=True):
        for i in range(len(v) - 1):
            a, b = float(v[i]), float(v[i + 1])
            if a == 0 and b == 0:
                continue
            if a * b >= 0:
                add([p[i], p[i + 1], q[i + 1], q[i]], [0.0, 0.0, b, a])
            else:
                middle = p[i] + a / (a - b) * (p[i + 1] - p[i])
                add([p[i], middle, q[i]], [0.0, 0.0, a])
                add([middle, p[i + 1], q[i + 1]], [0.0, 0.0, b])
    if not triangles:
        return
    mesh = polydata(np.array(vertices), np.array(triangles))
    look: dict[str, Any] = {"ambient": 1.0, "diffuse": 0.0}
    if bar is not None:
        mesh.point_data["stress"] = np.array(heights)
        look |= {"scalars": "stress", "cmap": bar.cmap, "clim": (bar.norm.vmin, bar.norm.vmax)}
    else:
        rgb = 255 * np.array([to_rgb(NEGATIVE), to_rgb(POSITIVE)])
        mesh.cell_data["rgb"] = rgb[np.array(positive, dtype=int)].astype(np.uint8)
        look |= {"scalars": "rgb", "rgb": True, "opacity": 0.55}
    scene.actors.append((mesh, look))


def _outline(base: Floats, tips: Floats) -> pv.PolyData:
    """Return the line along the tips of a member's ordinates, with those at its ends."""
    points = np.vstack([base[0, :1], tips.reshape(-1, 3), base[-1, -1:]])
    n = np.arange(len(points) - 1)
    return wire_mesh(points, np.column_stack([n, n + 1]))


def _pairs(n: int) -> Ints:
    """Return the edges between n pairs of points in a row."""
    return np.arange(2 * n).reshape(n, 2)


def _holders(model: Model) -> Model:
    """Return a model with supports and joints alone, to draw what holds the structure."""
    drawn = [e for e in model.effects if isinstance(e, Frame) or (e.marker and e.marker.colour in _HOLDERS)]
    return Model(model.mesh, tuple(drawn))


def _name_extremes(
    scene: Scene,
    solution: StaticSolution,
    tips: Floats,
    values: Floats,
    *,
    ink: str | None = None,
    least: bool = True,
) -> None:
    """Label the largest value of each member and its least, the largest of all first."""
    found: list[tuple[float, Floats]] = []
    for rows in solution.model.mesh.members.values():
        of_member = values[rows]
        constant = np.isclose(of_member.max(), of_member.min(), rtol=1e-9, atol=0)
        ends = (int(of_member.argmax()), int(of_member.argmin())) if least else (int(of_member.argmax()),)
        for at in (of_member.size // 2,) if constant else ends:
            line, station = np.unravel_index(at, of_member.shape)
            value = float(of_member[line, station])
            if abs(value) > 0.02 * abs(values).max() and not _taken(found, value, tips[rows][line, station]):
                found.append((value, tips[rows][line, station]))
    found.sort(key=lambda pair: -abs(pair[0]))
    for value, place in found[:24]:
        colour = ink or (POSITIVE if value > 0 else NEGATIVE)
        scene.labels.append(Label(place, readable(value), colour, 7.0, bold=True))


def _taken(found: list[tuple[float, Floats]], value: float, place: Floats) -> bool:
    """Whether the same value is named at this place already, as that of another member."""
    return any(np.isclose(v, value) and np.allclose(p, place) for v, p in found)


def readable(value: float) -> str:
    """Return a value with three digits and an SI prefix: ``-12.3k``."""
    for factor, prefix in ((1e9, "G"), (1e6, "M"), (1e3, "k")):
        if abs(value) >= factor:
            return f"{value / factor:.3g}{prefix}"
    return f"{value:.3g}"
