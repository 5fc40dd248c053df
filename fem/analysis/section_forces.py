"""Section forces of lines from equilibrium, and the motion that loads add between the nodes.

Internal forces follow from the equilibrium of the part of an element before a cut, so that they are exact
wherever the element is: a distributed load bends N, V and M between the nodes as it does in the beam.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.analysis.line_loads import (
    LineAxes,
    SpreadLoads,
    elements_on_lines,
    force_at,
    line_dofs,
    rigidity_at,
)
from fem.array_types import Floats, Ints
from fem.elements import tapered
from fem.elements.connections import moved_by_loads
from fem.elements.frame import Frame
from fem.elements.interpolation import gauss_points
from fem.model import Model

SECTION_FORCES = ("N", "Vy", "Vz", "T", "My", "Mz")
"""Forces [N] and moments [N·m] on the positive face of a section, in the member's axes."""


@dataclass(frozen=True, slots=True, eq=False)
class LineEquilibrium:
    """Forces on the lines in all load cases, from which their section forces follow.

    Attributes
    ----------
    ends : ndarray (n_lines, 6, n_cases)
        Force and moment of the first node on the line, global [N, N·m].
    fixed : ndarray (n_lines, 12, n_cases)
        Forces and moments of both nodes while all nodes rest.
    initial : ndarray (n_lines, 2, 2, 3)
        Forces and moments of geometric stiffness at both nodes (`initial_forces`).
    loads : SpreadLoads
        Loads between the ends, the lines' weight included.
    strain : ndarray (n_lines, 6, n_cases)
        Initial strains.
    gravity : ndarray (3, n_cases)
        Acceleration of gravity [m/s²].
    """

    ends: Floats
    fixed: Floats
    initial: Floats
    loads: SpreadLoads
    strain: Floats
    gravity: Floats

    def case(self, column: int) -> "LineEquilibrium":
        """Return the forces of one load case alone."""
        ends, fixed, strain = (x[..., [column]] for x in (self.ends, self.fixed, self.strain))
        return LineEquilibrium(
            ends, fixed, self.initial, self.loads.case_of(column), strain, self.gravity[:, [column]]
        )


def line_stiffness(model: Model) -> Floats:
    """Return the stiffness of each line with all effects that change it, shape (n_lines, 12, 12)."""
    return _line_matrices(model, "K")


def line_mass(model: Model) -> Floats:
    """Return the mass of each line with all effects that change it, shape (n_lines, 12, 12)."""
    return _line_matrices(model, "M")


def _line_matrices(model: Model, key: str) -> Floats:
    out = np.zeros((model.mesh.n_lines, 12, 12))
    for rows, c in elements_on_lines(model):
        X = getattr(c, key)
        if X is not None:
            np.add.at(out, rows, np.real(X))
    return out


def initial_forces(model: Model, axes: LineAxes, K: Floats) -> Floats:
    """Return the forces of the nodes on the lines whose geometric stiffness is in the lines' stiffness.

    A rotation θ of a line meets no other resistance, and turns these forces:
    K r = (θ × f, θ × m / 2) at each node, the moment being semitangential. Where rounding is larger, 0.

    Returns
    -------
    ndarray (n_lines, 2, 2, 3)
        Forces and moments at both nodes, global [N, N·m].
    """
    points = model.mesh.points[model.mesh.lines]
    arm = points - points.mean(axis=1, keepdims=True)
    out = np.zeros((len(K), 2, 2, 3))
    largest, size = np.zeros(len(K)), abs(K)
    for axis in np.eye(3):
        r = np.zeros((len(K), 2, 2, 3))
        r[:, :, 0], r[:, :, 1] = np.cross(axis, arm), axis
        r = r.reshape(-1, 12)
        out -= np.cross(axis, (K @ r[:, :, None]).reshape(-1, 2, 2, 3)) * [[0.5], [1.0]]
        largest = np.maximum(largest, np.einsum("bi,bi->b", abs(r), (size @ abs(r)[:, :, None])[:, :, 0]))
    rounding = (
        1e-12
        * largest[:, None, None, None]
        * np.stack([1 / axes.span, 0 * axes.span + 1], axis=1)[:, None, :, None]
    )
    return np.where(abs(out) > rounding, out, 0.0)


def section_forces(model: Model, equilibrium: LineEquilibrium, u: Floats, lines: Ints, xi: Floats) -> Floats:
    """Return the section forces at fractions of lines, shape (n, 6, n_cases).

    They hold the part before the cut in equilibrium with its node's force and its loads. Under geometric
    stiffness that part is displaced, and the initial forces on it add moments; axes stay as they were.
    """
    spread, initial, ends = equilibrium.loads, equilibrium.initial, equilibrium.ends
    axes = spread.axes
    a, b = np.moveaxis(model.mesh.points[model.mesh.lines[lines]] + axes.offset[lines], 1, 0)
    place = a + xi[:, None] * (b - a)
    node = model.mesh.points[model.mesh.lines[lines, 0]]
    force = -ends[lines, :3]
    moment = -ends[lines, 3:] - np.cross((node - place)[:, :, None], ends[lines, :3], axis=1)
    # pairs of a cut and a load on its line
    first, last = (np.searchsorted(spread.line, lines, side=side) for side in ("left", "right"))
    count = last - first
    cut = np.repeat(np.arange(lines.size), count)
    load = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count) + np.repeat(first, count)
    lo, hi = spread.xi[load, 0], np.minimum(spread.xi[load, 1], xi[cut])
    point = spread.xi[load, 0] == spread.xi[load, 1]
    for x, w in zip(*gauss_points(2), strict=True):
        at = lo + x * (hi - lo)
        length = np.where(hi > lo, w * (hi - lo) * axes.span[lines[cut]], 0.0)
        length = np.where(point, 0.5 * (lo < xi[cut]), length)
        q = force_at(spread, load, at) * length[:, None]
        at = np.where(point, lo, at)
        arm = a[cut] + at[:, None] * (b - a)[cut] - place[cut]
        np.subtract.at(np.moveaxis(force, 1, 2), (cut, spread.case[load]), q)
        np.subtract.at(np.moveaxis(moment, 1, 2), (cut, spread.case[load]), np.cross(arm, q))
    loaded = np.flatnonzero(initial[lines].any(axis=(1, 2, 3)))
    if loaded.size:
        moment[loaded] -= _moments_of_displacement(model, lines[loaded], xi[loaded], initial, u)
    R = axes.R[lines]
    return np.concatenate([R @ force, R @ moment], axis=1)


def _moments_of_displacement(model: Model, lines: Ints, xi: Floats, initial: Floats, u: Floats) -> Floats:
    """Return the moments about displaced places of the initial forces before them, shape (n, 3, n_cases).

    The node's force f and a uniform load that closes the line's equilibrium act at displaced places; the
    node's moment m is turned, by θ × m/2 beyond the turn that its work on the rotation vector contains.
    """
    (frame,), dofs = model.of_kind(Frame), line_dofs(model)[lines]
    f, m = initial[lines, 0, 0], initial[lines, 0, 1]
    per_axis = -(initial[lines, 0, 0] + initial[lines, 1, 0])

    def moved(x: Floats, some: Any = slice(None)) -> Floats:
        return frame.axis_displacements(model.mesh, lines[some], x, u)

    here, node = moved(xi), u[dofs[:, :3]]
    out: NDArray[Any] = np.cross(node - here, f[:, :, None], axis=1)
    out += 0.5 * np.cross(u[dofs[:, 3:6]], m[:, :, None], axis=1)
    size = abs(initial[lines, :, 0]).max(axis=(1, 2))
    # Relative size below which the sum of the forces at a line's ends is rounding
    spread = np.flatnonzero(abs(per_axis).max(axis=1) > 1e-12 * size)
    for x, w in zip(*gauss_points(3), strict=True) if spread.size else ():
        load = (w * xi[spread])[:, None, None] * per_axis[spread, :, None]
        out[spread] += np.cross(moved(x * xi[spread], spread) - here[spread], load, axis=1)
    return out


def motion_between_nodes(
    model: Model, equilibrium: LineEquilibrium, u: Floats, line: int, xi: Floats
) -> Floats:
    """Return the motion that the loads on a line add between its nodes, shape (n, 6, n_cases).

    With the strains ε, γ and κ of the section forces that hold the loads while the nodes rest, v = ∫ γ ds +
    ∫ (x - s) κ ds. Ends that slip in releases and springs move as
    :func:`fem.elements.connections.moved_by_loads` has it, and a rotation brings the second end to its place.
    """
    axes, (frame,) = equilibrium.loads.axes, model.of_kind(Frame)
    a, b = axes.zone[line, 0], 1 - axes.zone[line, 1]
    at_rest = replace(equilibrium, ends=equilibrium.fixed[:, :6], initial=0 * equilibrium.initial)
    breaks = np.unique(np.clip([a, b, *equilibrium.loads.xi[equilibrium.loads.line == line].ravel()], a, b))

    n_points = tapered.N_STATIONS if frame.has_tapers else 4

    def strains(at: Floats) -> Floats:
        lines = np.full(at.size, line)
        extra = section_forces(model, at_rest, u, lines, at)
        rigidity = np.broadcast_to(rigidity_at(model, line, at)[:, :, None], extra.shape)
        e = np.divide(extra, rigidity, out=np.zeros_like(extra), where=rigidity > 0)
        return e + equilibrium.strain[line]

    def integrated(x: float) -> Floats:
        total = np.zeros((6, u.shape[1]))
        for lo, hi in zip(breaks[:-1], np.minimum(breaks[1:], x), strict=True):
            if hi <= lo:
                continue
            t, w = gauss_points(n_points)
            at = lo + t * (hi - lo)
            # section forces are those just before a place; within a stretch they are smooth
            e = strains(at) * (w * (hi - lo) * axes.span[line])[:, None, None]
            arm = ((x - at) * axes.span[line])[:, None]
            total[[0, 3, 4, 5]] += e[:, [0, 3, 4, 5]].sum(axis=0)
            total[1] += (e[:, 1] + arm * e[:, 5]).sum(axis=0)
            total[2] += (e[:, 2] - arm * e[:, 4]).sum(axis=0)
        return total

    end = integrated(b)
    ends = np.zeros((2, 6, u.shape[1]))
    g = frame.lines(model.mesh, [line])
    if g.soft.size:
        cuts = np.array([np.nextafter(a, b), b])  # between forces at the ends
        force = section_forces(model, at_rest, u, np.full(2, line), cuts) * [[[-1.0]], [[1.0]]]
        stretched = np.concatenate([np.zeros_like(end), end])
        ends = moved_by_loads(g, stretched, force.reshape(12, -1)).reshape(ends.shape)
    chord = (ends[1, :3] - ends[0, :3] - end[:3]) / ((b - a) * axes.span[line])
    out = []
    for x in np.clip(xi, a, b):
        here = integrated(float(x))
        here[:3] += ends[0, :3] + (x - a) * axes.span[line] * chord
        here[3:] += [ends[0, 3], -chord[2], chord[1]]
        out.append(here)
    R = axes.R[line]
    local = np.array(out).reshape(-1, 6, u.shape[1])
    motion = np.concatenate([R.T @ local[:, :3], R.T @ local[:, 3:]], axis=1)
    arm = -axes.offset_at(np.full(xi.size, line), xi)  # from the axis to the line
    motion[:, :3] += np.cross(motion[:, 3:], arm[:, :, None], axis=1)
    return motion
