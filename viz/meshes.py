"""PyVista meshes of surfaces, edges and arrows."""

import numpy as np
import pyvista as pv

from fem.array_types import Floats, Ints
from viz.shapes import Arrows, arrow_triangles


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
