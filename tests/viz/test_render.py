"""Pictures: written, of the stated size, not blank, and showing what they should."""

import os
import subprocess
import sys
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

from fem import (
    Frame,
    Joint,
    Material,
    MemberProperties,
    Mesh,
    Model,
    Modes,
    Section,
    Support,
    assemble,
    check_mesh,
    check_model,
    solve_modes,
)
from fem.effects import effect_classes
from tests.frames import beam, chain, fix, with_part
from updating import Sensor
from viz import animation, render, shapes, style
from viz.markers import COLOURS, SHAPES, support_axes
from viz.models import model_surface
from viz.overlay import Mark, draw_marks
from viz.scene import DPI, Scene
from viz.shapes import view_axes
from viz.stage import View

STEEL = Material("steel", 210e9, 7850)


@pytest.fixture(scope="module")
def cross():
    """Two crossing beams, one clamped, with a closed-form shape."""
    x = np.linspace(-0.4, 0.4, 9)
    points = np.vstack([np.c_[x, 0 * x, 0 * x], np.c_[0 * x, x, 0 * x + 0.022]])
    lines = np.vstack([np.c_[np.arange(8), np.arange(1, 9)], np.c_[np.arange(9, 17), np.arange(10, 18)]])
    mesh = Mesh.from_lines(points, lines, {"lower": range(8), "upper": range(8, 16)})
    p = MemberProperties(STEEL, Section.rectangle(0.03, 0.01))
    model = Model(mesh, (Frame(members={"lower": p, "upper": p}), Support(name="clamp", point=0)))
    shape = np.zeros((18, 6))
    s = np.concatenate([x, x])
    shape[:, 2] = np.cos(np.pi * s / 0.8) - 0.5
    slope = -np.pi / 0.8 * np.sin(np.pi * s / 0.8)
    shape[:9, 4], shape[9:, 3] = -slope[:9], slope[9:]
    modes = Modes(
        np.array([0.0, 83.0]),
        np.stack([0 * shape.ravel() + 1, shape.ravel()], axis=1),
        np.full(2, 0.004),
        n_rigid=1,
    )
    up = np.array([0.0, 0.0, 1.0])
    sensors = tuple(Sensor(f"P{k + 1}z", q, up) for k, q in enumerate(points))
    return model, modes, sensors


def pixels(path):
    with Image.open(path) as image:
        return np.asarray(image.convert("RGB")).astype(int)


def near(picture, colour, tolerance=40):
    rgb = np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)])
    return int((np.abs(picture - rgb).max(axis=2) < tolerance).sum())


def looks_drawn(picture):
    """Return that there are many colours, a white page around them and ink in every quarter."""
    colours = len(np.unique((picture // 8) @ [1, 32, 1024]))
    white = (picture > 250).all(axis=2)
    h, w = white.shape
    quarters = [white[i : i + h // 2, j : j + w // 2].mean() for i in (0, h // 2) for j in (0, w // 2)]
    return colours > 150 and 0.5 < white.mean() < 0.99 and max(quarters) < 0.999


def test_model_picture_shows_members_sensors_excitations_and_highlights(cross, tmp_path):
    model, _, sensors = cross
    path = render.render_model(
        model,
        tmp_path / "new" / "model.png",
        sensors,
        sensors[3:4],
        [(sensors[5].point, "here")],
        title="Cross",
    )
    picture = pixels(path)
    assert picture.shape[1] == round(style.WIDTH * DPI)
    assert looks_drawn(picture)
    for colour in (style.SENSOR, style.EXCITATION, style.HIGHLIGHT, style.INK):
        assert near(picture, colour) > 100
    bare = pixels(render.render_model(model, tmp_path / "bare.png"))
    for colour in (style.SENSOR, style.EXCITATION, style.HIGHLIGHT):
        assert near(bare, colour) < 50
    for colour in style.MEMBERS[:2]:
        assert near(bare, colour) > 2000


def test_mode_picture_is_coloured_by_displacement_and_has_measured_arrows(cross, tmp_path):
    model, modes, sensors = cross
    points = np.array([s.point for s in sensors])
    readings = modes.shapes[:, 1].reshape(-1, 6)[:, :3] * -7.0
    with_arrows = pixels(render.render_mode(model, modes, 1, tmp_path / "a.png", measured=(points, readings)))
    without = pixels(render.render_mode(model, modes, 1, tmp_path / "b.png"))
    assert looks_drawn(with_arrows)
    assert near(with_arrows, style.EXCITATION) > near(without, style.EXCITATION) + 500
    left = without[:, : int(0.85 * without.shape[1])]
    hue = np.concatenate([left[..., k] - left[..., (k + 1) % 3] for k in range(3)])
    assert np.ptp(hue) > 150  # from violet to yellow on the structure itself, without the colour bar


def test_arrow_behind_a_member_is_seen_where_the_projection_puts_it(cross):
    """Its middle is half a diameter behind the axis, as of a force that pushes a member from below."""
    model, *_ = cross
    surface = model_surface(model)
    scene = Scene(surface.rest)
    scene.add_surface(surface, surface.rest, rgb=np.full((len(surface.triangles), 3), 0.8))
    middle = model.mesh.points[model.mesh.member_points(next(iter(model.mesh.members)))].mean(axis=0)
    middle = middle - 0.05 * scene.axes[2]
    half = 0.02 * scene.axes[1]
    scene.add_arrows(shapes.Arrows((middle - half)[None], (middle + half)[None]), style.EXCITATION, 0.003)
    with scene.open() as stage:
        picture = stage.photograph()
    x, y = scene.view().project(middle)[0].astype(int)
    red, _, blue = picture[y, x].astype(int)
    assert red - blue > 60


def test_mode_title_names_rigid_modes_frequency_and_damping(cross):
    _, modes, _ = cross
    assert render.mode_title(modes, 0) == "Mode 1: rigid body"
    assert render.mode_title(modes, 1) == "Mode 2: 83 Hz, damping ratio 0.4 %"
    grows = replace(modes, frequency=-modes.frequency)
    assert render.mode_title(grows, 1) == "Mode 2: -83 Hz, a motion that grows"


def test_animation_moves_and_is_small(cross, tmp_path):
    model, modes, _ = cross
    path = animation.animate_mode(model, modes, 1, tmp_path / "mode.gif", frames=10, width=3.0)
    assert path.stat().st_size < 1_000_000
    with Image.open(path) as gif:
        assert gif.n_frames == 10
        assert gif.size[0] == 480
        frames = []
        for k in range(gif.n_frames):
            gif.seek(k)
            frames.append(np.asarray(gif.convert("RGB")).astype(int))
    changed = [(np.abs(a - b).max(axis=2) > 30).mean() for a, b in pairwise(frames)]
    assert max(changed) > 0.01
    assert (np.abs(frames[0] - frames[5]).max(axis=2) > 30).mean() > 0.02  # half a period apart
    assert (np.abs(frames[2] - frames[8]).max(axis=2) > 30).mean() < 2e-3  # the same place on the way back
    assert (frames[0][:, 0] == 255).all()


def test_a_complex_mode_travels(cross, tmp_path):
    model, modes, _ = cross
    phase = np.repeat(np.linspace(0, 1.2, 18), 6)
    wave = Modes(modes.frequency, modes.shapes * np.exp(1j * phase)[:, None])
    path = animation.animate_mode(model, wave, 1, tmp_path / "mode.gif", frames=8, width=2.5)
    with Image.open(path) as gif:
        frames = []
        for k in (2, 6):
            gif.seek(k)
            frames.append(np.asarray(gif.convert("RGB")).astype(int))
    assert (
        np.abs(frames[0] - frames[1]).max(axis=2) > 30
    ).mean() > 2e-3  # a standing wave would be at rest in both


def test_misfit_picture_has_the_worst_colour_where_the_worst_sensor_is(cross, tmp_path):
    model, _, sensors = cross
    points, directions = np.array([s.point for s in sensors]), np.array([s.direction for s in sensors])
    names = [s.name for s in sensors]
    amount = {}
    for name, values in {"flat": np.full(18, -30.0), "one": np.r_[-3.0, np.full(17, -30.0)]}.items():
        path = render.render_misfit(
            model, points, directions, values, names, tmp_path / f"{name}.png", limits=(-30, 0)
        )
        picture = pixels(path)
        assert looks_drawn(picture)
        amount[name] = near(picture[:, : int(0.85 * picture.shape[1])], "#7a0f08", 35)
    assert amount["one"] > amount["flat"] + 150


def test_misfit_picture_can_colour_members(cross, tmp_path):
    model, _, sensors = cross
    s = sensors[0]
    picture = pixels(
        render.render_misfit(
            model,
            [s.point],
            [s.direction],
            [-10.0],
            [s.name],
            tmp_path / "m.png",
            {"lower": 0.0, "upper": 2.0},
        )
    )
    left = picture[:, : int(0.75 * picture.shape[1])]
    blue = (left[..., 2] - left[..., 0] > 50).sum()
    assert blue > 5000


def test_misfit_picture_can_colour_joints(cross, tmp_path):
    model, _, sensors = cross
    s, shares = sensors[0], {"lower": 0.0, "upper": 0.0}
    blue = []
    for joints in ([], [(model.mesh.points.mean(axis=0), 0.4)]):
        path = tmp_path / f"{len(joints)}.png"
        drawn = pixels(
            render.render_misfit(model, [s.point], [s.direction], [-10.0], [s.name], path, shares, joints)
        )
        left = drawn[:, : int(0.75 * drawn.shape[1])]
        blue.append((left[..., 2] - left[..., 0] > 50).sum())
    assert blue[0] < 50 < blue[1]


def test_misfits_must_belong_to_sensors(cross, tmp_path):
    model, _, sensors = cross
    with pytest.raises(ValueError, match="1 points, 1 directions, 2 misfits and 1 names"):
        render.render_misfit(model, [sensors[0].point], [[0, 0, 1]], [1, 2], ["a"], tmp_path / "x.png")


@pytest.mark.parametrize(
    "extent", [(1, 1, 1), (1, 0, 0), (0, 0, 1), (0, 1, 0), (1, 0, 1), (0, 1, 1), (1, 1, 0)]
)
def test_no_member_is_seen_from_its_end(extent):
    points = np.array([[0.0, 0, 0], extent])
    axes = view_axes(points)
    assert np.allclose(axes @ axes.T, np.eye(3))
    assert np.linalg.det(axes) == pytest.approx(1)
    for k in np.flatnonzero(extent):
        assert np.linalg.norm(axes[:2, k]) > 0.35


def test_projection_agrees_with_what_is_drawn(cross, tmp_path):
    model, *_ = cross
    scene = Scene(model.mesh.points)
    tail = np.array([[0.1, 0.05, 0.0]])
    scene.add_arrows(shapes.Arrows(tail, tail + np.array([0, 0, 1e-6])), "#ff0000", 1e-7, balls=0.006)
    with scene.open() as stage:
        picture = stage.photograph().astype(int)
    rows, columns = np.nonzero((picture[..., 0] - picture[..., 1]) > 60)
    assert np.allclose([columns.mean(), rows.mean()], scene.view().project(tail)[0] - 0.5, atol=1.5)


def test_pictures_need_no_display_and_print_nothing(tmp_path):
    code = (
        "from fem.mesh import Mesh; from fem.model import Model\n"
        "from fem.materials import Material; from fem.sections.section import Section\n"
        "from fem.elements.frame import Frame; from fem.elements.properties import MemberProperties\n"
        "from viz.render import render_model\n"
        "m = Mesh.from_lines([[0, 0, 0], [1, 0, 0]], [[0, 1]], {'a': [0]})\n"
        "p = MemberProperties(Material('s', 2e11, 7850), Section.rectangle(0.03, 0.01))\n"
        f"render_model(Model(m, (Frame(members={{'a': p}}),)), {str(tmp_path / 'a.png')!r})\n"
    )
    keep = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "VTK_DEFAULT_OPENGL_WINDOW")}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=keep, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert (tmp_path / "a.png").exists()


def test_faults_are_coloured_and_a_mechanism_moves(tmp_path):
    points = [[0, 0, 0], [1, 0, 0], [1, 0.5, 0], [0.5, 0.001, 0], [0.5, 0.5, 0]]
    mesh = Mesh.from_lines(points, [[0, 1], [1, 2], [3, 4]])
    faults = check_mesh(mesh)
    assert {fault.kind for fault in faults} == {"loose part", "unconnected crossing"}
    picture = pixels(render.render_faults(mesh, faults, tmp_path / "mesh.png"))
    for colour in render.FAULT_COLOURS[:2]:  # of the lines and of the ring and its name
        assert near(picture, colour) > 300
    bare = pixels(render.render_faults(mesh, (), tmp_path / "bare.png"))
    for colour in render.FAULT_COLOURS[:2]:
        assert near(bare, colour) < 50
    model = chain(2, 4, (fix(0),))
    faults = check_model(model)
    moving = pixels(render.render_faults(model, faults, tmp_path / "moving.png"))
    still = pixels(
        render.render_faults(
            model, [replace(f, motions=np.zeros((0, 0))) for f in faults], tmp_path / "x.png"
        )
    )
    # the motion's direction is any of those that nothing opposes; pictures of one size are compared
    same = moving.shape == still.shape and np.abs(moving.astype(int) - still.astype(int)).max() < 20
    assert not same, "the ghost is not drawn"
    hue = moving[..., 0] - moving[..., 2]
    assert (hue > 20).sum() > 5 * max((still[..., 0] - still[..., 2] > 20).sum(), 200)


def test_a_mode_of_a_model_with_a_part_is_drawn(tmp_path):
    model = with_part()
    modes = solve_modes(assemble(model), n=2)
    assert modes.shapes.shape[0] > 6 * model.mesh.n_points
    assert looks_drawn(pixels(render.render_mode(model, modes, 1, tmp_path / "a.png")))


def test_every_marker_that_an_effect_names_is_drawn():
    named = [cls.marker for cls in effect_classes().values() if cls.marker]
    assert named
    assert {m.shape for m in named} <= SHAPES.keys()
    assert {m.colour for m in named} <= COLOURS.keys()


OF_NO_MARKER = (
    {"position": 0.5, "inertia": 0.0, "length": 1.0, "reference": 1.0},
    {"position": 0.5, "stiffness": 0.0, "direction": "y", "length": 1.0, "reference": 1.0},
    {},
)
"""Values of three effects that name no marker."""


def test_kinds_without_a_marker_get_different_shapes():
    model = beam(4, effects=(fix(0, name="wall"),))
    kinds = [effect_classes()[kind] for kind in ("point_inertia", "side_spring", "member_damping")]
    assert all(cls.marker is None for cls in kinds)
    found = [
        cls(name=cls.kind, member="beam", **values) for cls, values in zip(kinds, OF_NO_MARKER, strict=True)
    ]
    scene = Scene(model.mesh.points)
    scene.add_effects(model.with_effect(*found))
    shapes = [mark[1] for mark in scene.marks]
    assert shapes[0] == SHAPES["triangle"]
    assert len(set(shapes)) == 4


def test_a_skew_support_is_drawn_as_a_support_turned_by_its_axes():
    """On a slope of 30° seen from the side, the triangle leans to the left by as much."""
    c, s = np.cos(np.pi / 6), np.sin(np.pi / 6)
    axes = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    tip = {"name": "slope", "point1": 1, "location": np.array([1.0, 0, 0]), "axes": axes}
    model = beam(4, effects=(fix(0, name="wall"), Joint(rigid=("y", "z"), **tip)))
    scene = Scene(model.mesh.points)
    scene.add_effects(model)
    assert [mark.shape for mark in scene.marks] == [SHAPES["triangle"]] * 2
    assert [key.get_label() for key in scene.legend] == ["support"]
    side = View(np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]), np.zeros(3), 2.0, 2.0, (200, 200))
    assert [mark.turn(side) for mark in scene.marks] == [0.0, pytest.approx(np.pi / 6)]
    above = View(np.eye(3), np.zeros(3), 2.0, 2.0, (200, 200))
    assert scene.marks[1].turn(above) == pytest.approx(0.0)
    # an elastic element to the ground in these axes, and a joint of two members, are none
    for other in (Joint(K=np.diag([0, 0, 1e3, 0, 0, 0]), **tip), Joint(rigid=("z",), point2=0, **tip)):
        assert support_axes(other, model) is None


def test_a_turned_support_stands_on_a_line_along_its_ground():
    figure = Figure(figsize=(1, 1), dpi=100)
    ax, axes = figure.add_subplot(), np.array([[0.8, 0, 0.6], [0, 1, 0], [-0.6, 0, 0.8]])
    side = View(np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]), np.zeros(3), 2.0, 2.0, (200, 200))
    draw_marks(ax, side, [Mark(np.zeros(3), "^", "k", 7.0, axes), Mark(np.ones(3), "^", "k", 7.0)], 100)
    (ground,) = (line for line in ax.lines if len(line.get_xdata()) == 2)
    (x, y) = (np.diff(v)[0] for v in ground.get_data())
    assert -y / x == pytest.approx(0.6 / 0.8)  # pixels count downwards
    assert np.mean(ground.get_xdata()) > 100  # below and to the right of the tip
    assert np.mean(ground.get_ydata()) > 100
