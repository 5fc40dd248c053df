"""Pictures of structures: models, mode shapes, misfits at sensors, and faults of a mesh."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.colors import Normalize, to_hex, to_rgb
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import ArrayLike, NDArray

from fem.analysis.modes import Modes
from fem.array_types import Floats
from fem.checks import Defect
from fem.elements.frame import Frame
from fem.elements.properties import MemberProperties
from fem.materials import Material
from fem.mesh import Mesh
from fem.model import Model
from fem.sections.section import Section
from updating.measurement.measurement import Sensor
from viz import style
from viz.layout import in_order, merge_names, shorten
from viz.models import (
    displacement_at,
    drawn_names,
    drawn_size,
    member_families,
    model_surface,
    surface_places,
)
from viz.overlay import (
    Bar,
    Label,
    Mark,
    arrow_key,
)
from viz.scene import Scene, unit_vectors
from viz.shapes import (
    Arrows,
    amplification,
    arrows,
    group_components,
    match_scale,
    real_shape,
)
from viz.stage import polydata, wire_mesh


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
    surface, size = model_surface(model), drawn_size(model)
    families = member_families(model)
    names = in_order(families)
    colour = {name: style.MEMBERS[i % len(style.MEMBERS)] for i, name in enumerate(names)}
    member = drawn_names(model)
    rgb = np.array([to_rgb(colour[families[name]]) for name in member])[surface.line]
    scene = Scene(surface.rest, title=title)
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
    phase = shape_phase(shape)
    motion = real_shape(shape)
    surface, size = model_surface(model, motion), drawn_size(model)
    scale = amplification(surface, size)
    scene = Scene(surface.rest, surface.deformed(scale), title=title or mode_title(modes, index))
    scene.add_ghost(surface)
    scene.add_moving(surface, scale)
    if measured is not None:
        points, vectors = np.array(measured[0], dtype=float, ndmin=2), np.array(measured[1], ndmin=2)
        known = ~np.isnan(vectors).any(axis=1)
        points, vectors = points[known], vectors[known]
        computed = displacement_at(model, shape * phase, points)
        factor = match_scale(vectors, computed)
        moved = np.real(factor * vectors)
        along = unit_vectors(moved)
        expected = np.einsum("ij,ij->i", np.real(computed), along)[:, None] * along
        groups = group_components(points, moved, 1e-6 * size)
        at = np.array([points[group[0]] for group in groups])
        moved, expected = (np.array([v[group].sum(axis=0) for group in groups]) for v in (moved, expected))
        scene.add_comparison(Arrows(at, at + scale * moved), at + scale * expected)
    scene.legend.append(Line2D([], [], color=style.AT_REST, linewidth=1, label="at rest"))
    return scene.save(path)


def render_misfit(
    model: Model,
    points: ArrayLike,
    directions: ArrayLike,
    misfit_db: ArrayLike,
    names: Sequence[str],
    path: str | Path,
    members: Mapping[str, float] | None = None,
    joints: Sequence[tuple[ArrayLike, float]] = (),
    title: str = "",
    label: str = "misfit [dB]",
    members_label: str = "member [-]",
    limits: tuple[float, float] | None = None,
) -> Path:
    """Draw sensors coloured by their misfit, and members by a value.

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
    joints : sequence of (ArrayLike, float)
        Points of joints and supports [m], with the same value.
    title : str
        Heading.
    label, members_label : str
        Labels of the colour bars, with unit.
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
    surface, size = model_surface(model), drawn_size(model)
    scene = Scene(surface.rest, title=title)
    bars = [Bar(style.misfit_map(), _colour_limits(misfit, limits), label)]
    rgb = np.tile(to_rgb("#e4e7eb"), (len(surface.triangles), 1))
    if members:
        values = np.array([members.get(name, np.nan) for name in drawn_names(model)], dtype=float)[
            surface.line
        ]
        every = np.array([*members.values(), *(v for _, v in joints)])
        bar = Bar(style.agreement_map(), _colour_limits(every, None), members_label)
        light = style.lighter(bar.cmap, 0.25)
        for point, value in joints:
            colour = to_hex(light(float(bar.norm(value))))
            scene.marks.append(Mark(np.asarray(point, dtype=float), "D", colour, 8.0))
        known = np.isfinite(values)
        rgb[known] = 0.25 + 0.75 * bar.colours(values[known])
        bars.append(Bar(light, bar.norm, members_label))
    scene.bars = bars
    scene.add_surface(surface, surface.rest, rgb=rgb)
    base = surface_places(model, points, directions, scene.axes[2])
    pointers = arrows(base, directions, 0.085 * size)
    scene.add_arrows(pointers, bars[0].colours(misfit), 0.005 * size, balls=0.0095 * size)
    order = np.argsort(-misfit)
    merged = merge_names([str(names[k]) for k in order], points[order], 1e-6 * size)
    for text, k in merged:
        scene.labels.append(Label(pointers.tip[order[k]], text, style.INK, 6.5))
    scene.legend.append(arrow_key(style.MUTED, "sensor in its positive direction"))
    return scene.save(path)


FAULT_COLOURS = (style.VERMILION, style.BLUE, style.PURPLE, style.GREEN, style.ORANGE, style.SKY)
"""Colours of the kinds of fault in a picture, in order."""


def render_faults(model: Model | Mesh, faults: Sequence[Defect], path: str | Path) -> Path:
    """Draw the faults of a mesh or model, and the motion of a mechanism.

    Faulty lines are coloured; faulty points are ringed and named. Where there is a mechanism, a ghost of the
    structure shows a motion that nothing resists.

    Parameters
    ----------
    model : Model or Mesh
        Members without a section are drawn with a round one.
    faults : sequence of Defect
        As :func:`fem.checks.check_model` gives them.
    path : str or Path
        PNG file to write.
    """
    drawn = _with_sections(model)
    surface, mesh = model_surface(drawn), drawn.mesh
    motions = next((f.motions for f in faults if f.motions.size), np.zeros((0, 0)))
    ghost = model_surface(drawn, motions[:, 0]) if motions.size else surface
    moved = ghost.deformed(amplification(ghost, drawn_size(drawn), 0.15))
    kinds = list(dict.fromkeys(fault.kind for fault in faults))
    words = ", ".join(f"{sum(f.kind == kind for f in faults)} x {kind}" for kind in kinds) or "no fault"
    if motions.shape[1] > 1:
        words += f" (motion 1 of {motions.shape[1]})"
    scene = Scene(surface.rest, moved, title=words[0].upper() + words[1:])
    colour = {kind: FAULT_COLOURS[k % len(FAULT_COLOURS)] for k, kind in enumerate(kinds)}
    rgb = np.tile(to_rgb("#d3d8de"), (len(surface.triangles), 1))
    for fault in reversed(faults):
        rgb[np.isin(surface.line, fault.lines)] = to_rgb(colour[fault.kind])
    scene.add_surface(surface, surface.rest, rgb=rgb)
    if motions.size:
        moved = moved + 10 * scene.lift  # in front of the structure at rest
        veil = polydata(moved, ghost.triangles)
        scene.actors.append((veil, {"color": colour["mechanism"], "opacity": 0.3, "culling": "back"}))
        scene.actors.append(
            (wire_mesh(moved, ghost.edges), {"color": colour["mechanism"], "line_width": 1.0})
        )
    scene.add_effects(drawn)
    named: set[int] = set()
    for fault in faults:
        if fault.kind in ("loose part", "mechanism"):
            continue  # its lines or its motion show its place
        for point in fault.points.tolist():
            scene.marks.append(Mark(mesh.points[point], "ring", colour[fault.kind], 11.0))
            if point not in named:
                scene.labels.append(Label(mesh.points[point], str(point), colour[fault.kind], 7.5, bold=True))
            named.add(point)
        if not fault.points.size and fault.lines.size:
            place = mesh.points[mesh.lines[fault.lines]].mean(axis=(0, 1))
            scene.labels.append(Label(place, f"line {fault.lines[0]}", colour[fault.kind], 7.5, bold=True))
    scene.legend += [Patch(facecolor=colour[kind], label=kind) for kind in kinds]
    return scene.save(path)


def _with_sections(model: Model | Mesh) -> Model:
    """Return a model that can be drawn: members without properties get a round section."""
    mesh, effects = (model, ()) if isinstance(model, Mesh) else (model.mesh, model.effects)
    frame = next((e for e in effects if isinstance(e, Frame)), None)
    have = frame.members if frame is not None else {}
    if frame is not None and all(name in have for name in mesh.members):
        return Model(mesh, effects)
    plain = MemberProperties(Material("drawn", 1.0, 1.0), Section.circle(0.012 * mesh.size))
    complete = Frame(members={name: have.get(name, plain) for name in mesh.members})
    others = tuple(e for e in effects if not isinstance(e, Frame))
    return Model(mesh, (complete, *others))


def mode_title(modes: Modes, index: int) -> str:
    """Return a heading for a mode: its number, frequency and damping."""
    f = modes.frequency[index]
    text = f"Mode {index + 1}: {'rigid body' if index < modes.n_rigid else f'{f:.4g} Hz'}"
    if f < 0:
        return f"{text}, a motion that grows"
    if modes.zeta is not None and index >= modes.n_rigid:
        text += f", damping ratio {100 * float(modes.zeta[index]):.2g} %"
    return text


def shape_phase(shape: NDArray[Any]) -> complex:
    """Return the factor that turns a complex shape to the phase at which most of it moves."""
    return (
        complex(np.exp(-0.5j * np.angle((np.asarray(shape, dtype=complex) ** 2).sum())))
        if np.iscomplexobj(shape)
        else 1.0
    )


def _colour_limits(values: Floats, limits: tuple[float, float] | None) -> Normalize:
    """Return the ends of a colour bar, given or those of the values."""
    if limits is not None:
        return Normalize(*limits)
    finite = values[np.isfinite(values)]
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 1.0)
    return Normalize(low, high if high > low else low + 1.0)
