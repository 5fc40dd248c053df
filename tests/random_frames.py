"""The one generator of random frames: connected, in space, of whatever members a test asks for."""

from collections.abc import Callable
from itertools import combinations

import numpy as np

from fem import Frame, Joint, Material, MemberProperties, Mesh, Model, Section, Support
from tests.frames import FLAT, STEEL

METALS = (STEEL, Material("aluminium", 70e9, 2700.0, 0.33))
SHAPES = (FLAT, Section.circle(0.02), Section.tube(0.03, 0.002))

Part = Callable[[np.random.Generator], MemberProperties]
"""Draws the material, section and theory of a member."""


def steel_shape(rng):
    """Draw a steel flat, rod or tube by Timoshenko's theory or by Euler and Bernoulli's."""
    theory = ("timoshenko", "euler-bernoulli")[rng.integers(2)]
    return MemberProperties(STEEL, SHAPES[rng.integers(len(SHAPES))], theory=theory)


def metal_block(theory):
    """Return what draws a member whose torsion constant and shear coefficients follow from no shape.

    A program that exchanges two of them is then found out.
    """

    def draw(rng):
        b, h = rng.uniform(0.02, 0.15, 2)
        Iy, Iz = b * h**3 / 12, h * b**3 / 12
        J, ky, kz = rng.uniform(0.1, 0.9) * (Iy + Iz), *rng.uniform(0.4, 1.0, 2)
        return MemberProperties(METALS[rng.integers(2)], Section(b * h, Iy, Iz, J, ky, kz), theory=theory)

    return draw


def draw_outline(rng, n_points, loops, reach, course, spread):
    """Return points on a course with steps of 1 m, and the lines of a tree; those that close loops come last.

    A line of the tree begins at one of the last `reach` points: with 1 it is a chain.
    """
    points = rng.uniform(-spread, spread, (n_points, 3))
    points[1:] += np.cumsum(np.eye(3)[["xyz".index(course[i % len(course)]) for i in range(n_points - 1)]], 0)
    tree = [(int(rng.integers(max(0, i - reach), i)), i) for i in range(1, n_points)]
    others = sorted(set(combinations(range(n_points), 2)) - set(tree))
    return points, np.array(tree + [others[k] for k in rng.choice(len(others), loops, replace=False)])


def random_frame(
    seed,
    part: Part = steel_shape,
    *,
    n_points=5,
    loops=1,
    reach=3,
    course="x",
    spread=0.5,
    size=1.0,
    split=1,
    offset=0.0,
    foot=True,
    spring=False,
    rotation=None,
    order=None,
    flip=None,
):
    """Return a connected frame with random points, members and orientations; members are m0, m1, ...

    Parameters
    ----------
    seed : int
    part : callable
        Draws the properties of each member.
    n_points, loops : int
        The frame has n_points - 1 + loops members; those that close loops are the last.
    reach : int
        How many points back the other end of a member may be; 1 for a chain and its loops.
    course : str
        Axes along which one point follows another, in turns.
    spread : float
        Largest deviation of a point from its course in each direction, in steps.
    size : float
        Length of a step [m].
    split : int
        Elements of each member.
    offset : float
        Standard deviation of the offsets of members' ends [m].
    foot, spring : bool
        Whether point 0 is clamped, and whether a spring of six directions holds point 2.
    rotation, order, flip : array_like, optional
        The same frame turned by a matrix (3, 3), with the point i as number order[i], and with some members
        drawn from their other end.
    """
    rng = np.random.default_rng(seed)
    points, lines = draw_outline(rng, n_points, loops, reach, course, spread)
    points, m = size * points, len(lines)
    up, offsets = rng.standard_normal((m, 3)), offset * rng.standard_normal((m, 2, 3))
    K = rng.standard_normal((6, 6))
    parts = [part(rng) for _ in range(m)]
    R = np.eye(3) if rotation is None else rotation
    new = np.arange(n_points) if order is None else np.asarray(order)
    turn = np.zeros(m, dtype=bool) if flip is None else np.asarray(flip)
    moved = np.empty_like(points)
    moved[new] = points @ R.T
    rows = new[lines]
    rows[turn] = rows[turn][:, ::-1]
    members = {}
    for i, p in enumerate(parts):
        first, second = offsets[i][::-1] @ R.T if turn[i] else offsets[i] @ R.T
        members[f"m{i}"] = MemberProperties(
            p.material, p.section, R @ up[i], offset1=first, offset2=second, theory=p.theory
        )
    effects = [Frame(members=members)]
    if spring:
        axes = np.kron(np.eye(2), R)
        K = axes @ (1e4 * K @ K.T) @ axes.T
        effects.append(Joint(name="spring", point1=int(new[2]), location=moved[new[2]], K=K))
    if foot:
        effects.append(Support(name="foot", point=int(new[0])))
    mesh = Mesh.from_lines(moved, rows, {f"m{i}": [i] for i in range(m)})
    return Model(mesh.split(split), tuple(effects))
