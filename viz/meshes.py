"""PyVista meshes of surfaces, edges and arrows."""

import numpy as np
import pyvista as pv
from numpy.typing import NDArray

from viz.shapes import Arrows
from viz.triangles import Floats


def polydata(vertices: Floats, triangles: NDArray[np.int64]) -> pv.PolyData:
    """Return triangles as a mesh."""
    faces = np.column_stack([np.full(len(triangles), 3), triangles]).ravel()
    return pv.PolyData(vertices.astype(np.float32), faces=faces)


def wire_mesh(vertices: Floats, edges: NDArray[np.int64]) -> pv.PolyData:
    """Return edges as a mesh of lines."""
    return pv.PolyData(
        vertices.astype(np.float32), lines=np.column_stack([np.full(len(edges), 2), edges]).ravel()
    )


def arrow_mesh(pointers: Arrows, radius: float, rgb: Floats, balls: float) -> pv.PolyData:
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
    mesh = polydata(np.vstack(vertices), np.vstack(triangles))
    mesh.cell_data["rgb"] = (255 * np.vstack(colours)).astype(np.uint8)
    return mesh
