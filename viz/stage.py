"""A PyVista plotter off screen, in parallel projection."""

import gc
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyvista as pv
from numpy.typing import ArrayLike, NDArray

from fem.array_types import Floats, Ints
from viz.shapes import Arrows, arrow_triangles

Actor = tuple[pv.PolyData, dict[str, Any]]
"""A mesh and PyVista's options for it."""


@dataclass(frozen=True, slots=True, eq=False)
class View:
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


class Stage:
    """A plotter that is always closed."""

    def __init__(self, view: View, actors: list[Actor]) -> None:
        self.view, self.actors = view, actors

    def __enter__(self) -> "Stage":
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
        for mesh, options in self.actors:
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


# PyVista meshes of surfaces, edges and arrows ---------------------------------------------------------------


def polydata(vertices: Floats, triangles: Ints) -> pv.PolyData:
    """Return triangles as a mesh."""
    faces = np.column_stack([np.full(len(triangles), 3), triangles]).ravel()
    return pv.PolyData(vertices.astype(np.float32), faces=faces)


def wire_mesh(vertices: Floats, edges: Ints) -> pv.PolyData:
    """Return edges as a mesh of lines."""
    return pv.PolyData(
        vertices.astype(np.float32), lines=np.column_stack([np.full(len(edges), 2), edges]).ravel()
    )


def arrow_mesh(pointers: Arrows, radius: float, rgb: Floats, balls: float) -> pv.PolyData:
    """Return arrows, and balls at their tails, as one mesh."""
    points, faces, arrow = arrow_triangles(pointers, radius)
    vertices, triangles, colours = [points], [faces], [rgb[arrow]]
    if balls:
        ball = pv.Sphere(radius=balls, theta_resolution=16, phi_resolution=12)
        start = len(points)
        for tail, colour in zip(pointers.tail, rgb, strict=True):
            round_ = ball.faces.reshape(-1, 4)[:, 1:]
            vertices.append(np.asarray(ball.points) + tail)
            triangles.append(round_ + start)
            colours.append(np.tile(colour, (len(round_), 1)))
            start += ball.n_points
    mesh = polydata(np.vstack(vertices), np.vstack(triangles))
    mesh.cell_data["rgb"] = (255 * np.vstack(colours)).astype(np.uint8)
    return mesh
